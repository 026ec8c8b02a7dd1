// Levels of height maps and photons: the facets that stand for a level send photons on, show them, and share the light with
// paths as whole surfaces do. Each rule has a scene where leaving it out shows.
#include <memory>

#include "kernel/stage/path_access.h"
#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

constexpr int kSize = 256;

/// Height of the maps, metres: on squares of 4 m slopes have a root mean square of 37 times that.
enum class Noise { kGentle, kRough };

/// A square of 4 m whose material is displaced by noise, at a level that has lost all of it but facets.
void add_noisy(Scene& scene, Mesh mesh, Material material, Noise noise, std::uint32_t flags)
{
  mesh.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  material.displacement_index = static_cast<int>(scene.displacements.size());
  add_object(scene, std::move(mesh), material);
  scene.instances.back().flags |= flags;
  add_displacement(scene, kSize, noise_texels(kSize, 3), noise == Noise::kGentle ? 0.008f : 0.03f).lod = 5;
}

Mesh noisy_floor() { return quad_mesh({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}); }

/// The wall x = −1, seen from the right.
Mesh noisy_wall() { return quad_mesh({-1, 0, 2}, {0, 0, -4}, {0, 4, 0}); }

/// A lamp in front of the wall, that faces it.
Scene lamp_at_a_wall()
{
  Scene scene = empty_scene();
  scene.lights.push_back(square_light({-0.3f, 1.6f, 0}, {-1, 0, 0}, 0.8f, 10));
  look_down(scene, {0.6f, 0, 0}, 0.5f, 2);
  return scene;
}

constexpr std::uint32_t kCasts = kCausticCaster | kCausticReceiver, kReceives = kCausticReceiver;

TEST(CausticFacets, ShowPhotons)
{
  for (const Noise noise : {Noise::kGentle, Noise::kRough}) {
    Scene scene = lamp_at_a_wall();
    add_caster(scene, noisy_wall(), mirror_material());
    add_noisy(scene, noisy_floor(), diffuse_material({0.8f, 0.8f, 0.8f}), noise, kReceives);
    expect_same(scene, 128, 16, 0.005, noise == Noise::kGentle ? "gentle floor" : "rough floor");
  }
}

TEST(CausticFacets, SendPhotonsOn)
{
  for (const Noise noise : {Noise::kGentle, Noise::kRough}) {
    Scene scene = lamp_at_a_wall();
    add_floor(scene, 3);
    Material metal;
    metal.roughness = 0.2f;
    add_noisy(scene, noisy_wall(), metal, noise, kCasts);
    expect_same(scene, 256, 16, 0.005, noise == Noise::kGentle ? "gentle wall" : "rough wall");
  }
}

TEST(CausticFacets, ReflectEachOther)
{
  // What one facet of a surface mirrors onto the next is the paths' to bring.
  Scene scene = lamp_at_a_wall();
  scene.lights[0] = square_light({0.6f, 2.5f, 0.5f}, normalize(Vec3f{0, -1, -0.2f}), 0.5f, 20);
  Material half_metal;
  half_metal.metallic = 0.5f;
  half_metal.roughness = 0.1f;
  half_metal.base_color = {0.9f, 0.5f, 0.1f};
  add_noisy(scene, noisy_floor(), half_metal, Noise::kRough, kCasts);
  expect_same(scene, 128, 32, 0.005, "half metal floor");
}

TEST(CausticFacets, OfGlassRefractPhotons)
{
  // The floor is in glass, as is the camera.
  for (const Noise noise : {Noise::kGentle, Noise::kRough}) {
    Scene scene = empty_scene();
    add_floor(scene, 3);
    add_noisy(scene, quad_mesh({-2, 0.6f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(), noise, kCasts);
    scene.lights.push_back(square_light({0.3f, 1.5f, 0}, {0, -1, 0}, 0.4f, 10));
    look_down(scene, {0, 0, 0}, 0.25f, 0.4f);
    expect_same(scene, 256, 16, 0.005, noise == Noise::kGentle ? "gentle glass" : "rough glass");
  }
}

TEST(CausticFacets, OfGlassThatIsSeenRefractPhotons)
{
  // From above: the camera's paths meet the facets as well.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_noisy(scene, quad_mesh({-2, 0.3f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(), Noise::kRough, kCasts);
  scene.lights.push_back(square_light({0.3f, 1.5f, 0}, {0, -1, 0}, 0.4f, 10));
  look_down(scene, {0, 0, 0}, 0.5f, 1.2f);
  expect_same(scene, 256, 16, 0.005, "glass above a floor");
}

TEST(CausticFacets, OfEachSurfaceHaveRandomNumbersOfTheirOwn)
{
  const auto state = std::make_unique<PathState>();
  state->bounces[0] = 1;
  state->flags[0] = kPathPhoton;
  EXPECT_EQ(path_surface(*state, 0), 1);
  // The first scattering of a photon is not among its bounces; of a camera path every one is.
  state->flags[0] = kPathPhoton | kPathCaustic;
  EXPECT_EQ(path_surface(*state, 0), 2);
  state->flags[0] = kPathCaustic;
  EXPECT_EQ(path_surface(*state, 0), 1);
}

}  // namespace
}  // namespace relief::test
