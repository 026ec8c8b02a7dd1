// Hits of one material of closures are shaded eight together, or one by one where there are too few: the picture is the same.
#include <cmath>
#include <vector>

#include "tests/support/loaded_scene.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using nlohmann::json;

json principled(const json& inputs)
{
  json closure = {{"type", "principled"}};
  closure.update(inputs);
  return closure;
}

/// Balls on a floor, each of a material of its own, under lamps, one of which some rays do not see.
/// @param materials  lists of closures; the floor's first
/// @param nodes      that they read; null: none
Scene scene_of(const std::vector<json>& materials, const json& nodes = {})
{
  GltfBuilder b;
  const std::vector<float> P{0, 0, 0, 1, 0, 0, 0, 1, 0};
  for (const json& closures : materials) {
    json extensions = {{"RELIEF_surface", {{"closures", closures}}}};
    if (!nodes.is_null()) extensions["RELIEF_graph"] = {{"nodes", nodes}};
    b.mesh({{"attributes", {{"POSITION", b.accessor(P, "VEC3")}}},
            {"material", b.push("materials", {{"extensions", extensions}})}});
    b.root_node({{"mesh", b.json["meshes"].size() - 1}});
  }
  Scene scene = load(b);
  scene.lights.clear();
  scene.cameras = empty_scene().cameras;
  scene.cameras.front().camera.world_from_camera.p = {0, 0.3f, 4};
  for (std::size_t i = 0; i < materials.size(); ++i) {
    Mesh mesh = i == 0 ? quad_mesh({-3, -0.6f, 3}, {6, 0, 0}, {0, 0, -6}) : sphere_mesh(0.5f, 24, 12, i % 2 == 1);
    mesh.material_index = scene.meshes[i].material_index;
    const float k = static_cast<float>(i) - 1;
    if (i > 0) {
      for (Vec3f& vertex : mesh.P)
        vertex += Vec3f{0.7f * std::fmod(k, 4.0f) - 1.05f, -0.1f + 0.6f * std::floor(k / 4), 0};
    }
    scene.meshes[i] = mesh;
  }
  scene.environment.color = {0.3f, 0.35f, 0.4f};
  for (const bool is_hidden : {false, true}) {
    Light disk;
    disk.kind = LightKind::kDisk;
    disk.P = {is_hidden ? 1.5f : -1.5f, 2, 2};
    disk.axis = normalize(-disk.P);
    disk.edge_u = {0.5f, 0, 0};
    disk.edge_v = cross(disk.axis, disk.edge_u);
    disk.area = kPi * 0.25f;
    disk.emission = {8, 7, 6};
    if (is_hidden) disk.hidden_from = 1u << static_cast<int>(PathEvent::kDiffuse);
    scene.lights.push_back(disk);
  }
  scene.render.caustics.mode = CausticsMode::kOff;
  scene.render.filter_glossy = 1;
  return scene;
}

std::vector<json> plain_materials()
{
  const json glass = {{"type", "transparent"}, {"weight", 0.4}}, light = {{"type", "emission"}, {"strength", 0.3}};
  return {
      json::array({principled({{"baseColor", {0.7, 0.5, 0.3}}, {"normal", {0.3, 0.1, 1}}})}),
      json::array({principled({{"baseColor", {0.8, 0.2, 0.1}}, {"roughness", 0.2}})}),
      json::array({principled({{"metallic", 1}, {"roughness", 0.3}, {"anisotropic", 0.8}})}),
      json::array({principled({{"metallic", 0.6}, {"roughness", 0}, {"specularTint", 0.5}})}),
      json::array({principled({{"weight", 0.6}, {"roughness", 1}}), glass}),
      json::array({principled({{"specular", 0}, {"baseColor", {0.2, 0.4, 0.9}}}), light}),
      json::array({principled({{"weight", 0.7}}), {{"type", "holdout"}, {"weight", 0.3}}}),
      json::array({principled({{"maths", "4.3"}, {"distribution", "multiscatter-ggx"}, {"roughness", 0.3}})}),
      json::array(
          {principled({{"maths", "5.2"}, {"metallic", 1}, {"roughness", 0.4}, {"baseColor", {0.9, 0.6, 0.2}}})}),
      json::array({{{"type", "diffuse"}, {"weight", 0.5}, {"color", {0.2, 0.7, 0.3}}},
                   {{"type", "glossy"}, {"weight", 0.5}, {"color", {0.9, 0.9, 0.9}}, {"roughness", 0.1}}}),
      json::array({principled(
          {{"clearcoat", 1}, {"clearcoatRoughness", 0.1}, {"normal", {0.2, 0, 1}}, {"baseColor", {0.5, 0.05, 0.05}}})}),
      json::array({principled({{"clearcoat", 0.7}, {"clearcoatRoughness", 0}, {"sheen", 1}, {"roughness", 0.7}})}),
      json::array({principled({{"maths", "4.3"},
                               {"distribution", "multiscatter-ggx"},
                               {"coatWeight", 0.8},
                               {"coatNormal", {0, 0.3, 1}},
                               {"metallic", 0.5}})}),
      json::array({principled({{"maths", "5.2"},
                               {"distribution", "multiscatter-ggx"},
                               {"coatWeight", 0.5},
                               {"sheenWeight", 0.6},
                               {"sheenTint", {0.9, 0.7, 0.5}}})}),
      json::array({principled({{"maths", "4.3"}, {"coatWeight", 1}, {"coatTint", {0.9, 0.6, 0.3}}})}),
  };
}

/// What lets light through, beside what does not.
std::vector<json> clear_materials()
{
  const auto closure = [](const char* type, const json& inputs) {
    json one = {{"type", type}};
    one.update(inputs);
    return one;
  };
  const auto translucent = [&](float weight) {
    return closure("translucent", {{"weight", weight}, {"color", {0.3, 0.7, 0.2}}});
  };
  return {
      json::array({principled({{"weight", 0.6}, {"baseColor", {0.7, 0.5, 0.3}}, {"normal", {0.3, 0.1, 1}}}),
                   translucent(0.4f)}),
      json::array({closure("glass", {{"roughness", 0.3}, {"ior", 1.4}, {"distribution", "beckmann"}})}),
      json::array({closure(
          "glass", {{"roughness", 0.4}, {"ior", 1.3}, {"maths", "4.3"}, {"distribution", "multiscatter-ggx"}})}),
      json::array({closure("glass", {{"roughness", 0}, {"ior", 1.2}, {"maths", "5.2"}, {"color", {0.9, 0.6, 0.9}}})}),
      json::array({closure("refraction", {{"weight", 0.6}, {"roughness", 0.5}, {"ior", 1.2}}),
                   closure("glossy", {{"weight", 0.4}, {"roughness", 0.5}, {"distribution", "beckmann"}})}),
      json::array({principled({{"transmission", 0.7}, {"roughness", 0.5}, {"transmissionRoughness", 0.2}})}),
      json::array({principled({{"maths", "4.3"},
                               {"distribution", "multiscatter-ggx"},
                               {"transmissionWeight", 0.6},
                               {"specularTint", {0.5, 0.8, 1}},
                               {"roughness", 0.4}})}),
      json::array(
          {closure("diffuse", {{"weight", 0.3}}), translucent(0.3f), {{"type", "transparent"}, {"weight", 0.4}}}),
      json::array({principled({{"maths", "5.2"}, {"weight", 0.5}, {"coatWeight", 0.5}}), translucent(0.5f)}),
  };
}

/// What light walks below, bumped by nodes that bumped_nodes has.
std::vector<json> waxen_materials()
{
  const json normal = {{"node", 2}, {"output", "normal"}}, color = {{"node", 1}, {"output", "color"}};
  const json wax = {{"type", "subsurface"}, {"scale", 0.2}, {"color", color}, {"normal", normal}};
  const json skin =
      principled({{"subsurface", 0.4}, {"subsurfaceColor", color}, {"normal", normal}, {"roughness", 0.6}});
  return {json::array({wax}), json::array({skin}), json::array({wax}), json::array({skin}), json::array({wax})};
}

json bumped_nodes()
{
  const auto of = [](int node, const char* output) { return json{{"node", node}, {"output", output}}; };
  return {{{"type", "texture-coordinate"}},
          {{"type", "noise-texture"}, {"inputs", {{"vector", of(0, "object")}, {"scale", 6}, {"detail", 0}}}},
          {{"type", "bump"}, {"inputs", {{"distance", 0.2}, {"height", of(1, "factor")}}}}};
}

/// Renders a picture whole, and each pixel by itself. A pixel's two paths are too few for a group.
/// @return  of the whole
Counters compare_with_ones(const Scene& scene)
{
  constexpr int kSize = 16, kSamples = 2;
  RenderOptions options = render_options(scene, kSize, kSamples);
  const Rendered whole = render_scene(scene, options);
  const int floats = whole.image.view.layout.num_floats;
  // Of rounding, that curved mirrors make larger.
  constexpr float kRelative = 2e-3f, kAbsolute = 2e-4f;
  int num_others = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      options.crop_x0 = x;
      options.crop_y0 = y;
      options.crop_x1 = x + 1;
      options.crop_y1 = y + 1;
      const Rendered one = render_scene(scene, options);
      const float* a = one.image.view.pixels;
      const float* b = whole.image.view.pixels + (y * kSize + x) * floats;
      bool is_same = true;
      for (int i = 0; i < floats; ++i) {
        is_same = is_same && (a[i] == b[i] || std::fabs(a[i] - b[i]) <= kRelative * std::fabs(b[i]) + kAbsolute ||
                              (std::isnan(a[i]) && std::isnan(b[i])));
      }
      num_others += is_same ? 0 : 1;
    }
  }
  EXPECT_EQ(num_others, 0);
  return whole.stats.counters;
}

TEST(SurfaceGroups, OfEightAndOfOneMakeTheSamePicture)
{
  EXPECT_GT(compare_with_ones(scene_of(plain_materials())).transparent_hits, 20u);
}

TEST(SurfaceGroups, ThatLightGoesThroughMakeTheSamePictureAsOnes)
{
  EXPECT_GT(compare_with_ones(scene_of(clear_materials())).transparent_hits, 5u);
}

/// Strands in the place of balls, some of them flat, some of them round; on the floor, too, there are some.
TEST(SurfaceGroups, OnStrandsMakeTheSamePictureAsOnes)
{
  for (const auto& materials : {plain_materials(), clear_materials()}) {
    Scene scene = scene_of(materials);
    for (std::size_t i = 1; i < materials.size(); ++i) {
      const float k = static_cast<float>(i) - 1;
      const Vec3f middle{0.7f * std::fmod(k, 4.0f) - 1.05f, -0.1f + 0.6f * std::floor(k / 4), 0};
      Mesh mesh;
      mesh.material_index = scene.meshes[i].material_index;
      mesh.are_ribbons = i % 2 == 1;
      for (int strand = 0; strand < 3; ++strand) {
        const auto first = static_cast<std::uint32_t>(mesh.P.size());
        for (int point = 0; point < 5; ++point) {
          const float y = 0.15f * (static_cast<float>(point) - 2), x = 0.2f * static_cast<float>(strand - 1);
          mesh.P.push_back(middle + Vec3f{x + y * y, y, 0.3f * x});
          mesh.radius.push_back(0.08f);
        }
        for (std::uint32_t segment = 1; segment < 3; ++segment) {
          mesh.triangles.push_back({first + segment, first + segment + 1, first + segment});
        }
      }
      scene.meshes[i] = mesh;
    }
    EXPECT_GT(compare_with_ones(scene).surface_hits, 200u);
  }
}

TEST(SurfaceGroups, ThatPathsLeaveMakeTheSamePictureAsOnes)
{
  const Scene scene = scene_of(waxen_materials(), bumped_nodes());
  EXPECT_TRUE(scene.materials.front().scatters_below);
  compare_with_ones(scene);
}

}  // namespace
}  // namespace relief::test
