// Shadow rays through surfaces of which graphs say what they let through: for eight points of one material at a time.
#include <cmath>

#include "tests/support/loaded_scene.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using nlohmann::json;

constexpr float kHalf = 1.6f;  ///< of the floor that is seen, metres

/// A sheet by its height, its lower corner and its side.
struct Sheet {
  float z, x, y, side;
  bool is_dull;  ///< of the second material
};

/// What it lets through. Cycles' second coordinate of an image points up, glTF's down.
Vec3f color_of(const Sheet& sheet, float x, float y)
{
  const Vec3f uv{(x - sheet.x) / sheet.side, 1 - (y - sheet.y) / sheet.side, 0};
  return sheet.is_dull ? 0.5f * uv + Vec3f{0.3f, 0.3f, 0.3f} : uv;
}

/// A white floor at z = 0 under sheets, a camera at z = 4 and a sun above all.
Scene scene_of(const std::vector<Sheet>& sheets, int transparent_bounces)
{
  const json uv = {{"node", 0}, {"output", "uv"}};
  const json nodes = {
      {{"type", "texture-coordinate"}},
      {{"type", "vector-math"}, {"operation", "multiply"}, {"inputs", {{"a", uv}, {"b", {0.5, 0.5, 0.5}}}}},
      {{"type", "vector-math"},
       {"operation", "add"},
       {"inputs", {{"a", {{"node", 1}, {"output", "vector"}}}, {"b", {0.3, 0.3, 0.3}}}}}};
  const auto transparent = [](const json& color) { return json::array({{{"type", "transparent"}, {"color", color}}}); };
  GltfBuilder b;
  const std::vector<float> P{0, 0, 0, 1, 0, 0, 0, 1, 0};
  for (const json& closures : {transparent(uv), transparent({{"node", 2}, {"output", "vector"}}),
                               json::array({{{"type", "diffuse"}, {"color", {1, 1, 1}}}})}) {
    const json extensions = {{"RELIEF_graph", {{"nodes", nodes}}}, {"RELIEF_surface", {{"closures", closures}}}};
    b.mesh({{"attributes", {{"POSITION", b.accessor(P, "VEC3")}}},
            {"material", b.push("materials", {{"extensions", extensions}})}});
    b.root_node({{"mesh", b.json["meshes"].size() - 1}});
  }
  Scene scene = load(b);
  const std::vector<Instance> loaded = scene.instances;
  scene.meshes.clear();
  scene.instances.clear();
  scene.lights.clear();
  scene.cameras = empty_scene().cameras;
  const auto add = [&](Mesh mesh, std::size_t of) {
    mesh.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    mesh.material_index = loaded[of].material_index;
    scene.instances.push_back(loaded[of]);
    scene.instances.back().mesh_index = static_cast<int>(scene.meshes.size());
    scene.meshes.push_back(std::move(mesh));
  };
  // Its diagonal is not seen.
  add(quad_mesh({-40, -60, 0}, {100, 0, 0}, {0, 100, 0}), 2);
  for (const Sheet& s : sheets) {
    add(quad_mesh({s.x, s.y, s.z}, {s.side, 0, 0}, {0, s.side, 0}), s.is_dull ? 1 : 0);
  }
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  scene.environment.color = {0, 0, 0};
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  scene.render.transparent_bounces = transparent_bounces;
  scene.render.caustics.mode = CausticsMode::kOff;
  return scene;
}

/// Sheets of either material by turns, of many sizes, of which some hang below the camera.
std::vector<Sheet> sheets_of(int above, int below)
{
  std::vector<Sheet> out;
  for (int i = 0; i < above + below; ++i) {
    const float k = static_cast<float>(i), side = 4.5f + 0.4f * k;
    out.push_back({i < above ? 5 + 0.1f * k : 1 + 0.1f * k, -1.8f - 0.2f * k, -2.6f - 0.1f * k, side, i % 2 == 1});
  }
  return out;
}

TEST(ShadowSurfaces, LetThroughTheProductOfTheirColors)
{
  // Fewer than are run at once, as many, more than a ray has waiting, and some that the camera sees through.
  for (const auto& [above, below] :
       {std::pair(1, 0), std::pair(2, 0), std::pair(8, 0), std::pair(11, 0), std::pair(5, 2)}) {
    const std::vector<Sheet> sheets = sheets_of(above, below);
    constexpr int kSize = 24;
    const Rendered seen = render_scene(scene_of(sheets, 32), render_options(scene_of(sheets, 32), kSize, 16));
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const float at_x = (2 * (static_cast<float>(x) + 0.5f) / kSize - 1) * kHalf;
        const float at_y = (1 - 2 * (static_cast<float>(y) + 0.5f) / kSize) * kHalf;
        Vec3f expected = splat3(3 / kPi);
        for (const Sheet& s : sheets) {
          expected *= color_of(s, at_x, at_y);
          // The camera sees this one from a slant.
          if (s.z < 4) expected *= color_of(s, at_x * (4 - s.z) / 4, at_y * (4 - s.z) / 4);
        }
        const float* const pixel = seen.image.view.pixels + (y * kSize + x) * seen.image.view.layout.num_floats;
        // Of where in a pixel its samples are.
        for (int c = 0; c < 2; ++c) {
          const float wanted = c == 0 ? expected.x : expected.y;
          ASSERT_NEAR(pixel[c], wanted, 0.03f * wanted + 1e-6f) << above << " " << below << " at " << x << ", " << y;
        }
      }
    }
  }
}

TEST(ShadowSurfaces, StopLightBehindAsManyAsAPathMayPass)
{
  // As in Cycles: what the path has passed counts too, and one more stops the light.
  for (const auto& [above, below, limit, is_lit] :
       {std::tuple(4, 0, 4, true), std::tuple(5, 0, 4, false), std::tuple(3, 1, 5, true), std::tuple(3, 1, 4, false),
        std::tuple(1, 0, 0, false), std::tuple(0, 0, 0, true), std::tuple(9, 0, 9, true),
        std::tuple(10, 0, 9, false)}) {
    const Scene scene = scene_of(sheets_of(above, below), limit);
    EXPECT_EQ(render_scene(scene, render_options(scene, 4, 1)).mean() > 0, is_lit)
        << above << " " << below << " " << limit;
  }
}

TEST(ShadowSurfaces, BehindOneMoreAPathSeesWhatShines)
{
  for (const auto& [below, limit, is_seen] :
       {std::tuple(1, 0, true), std::tuple(2, 0, false), std::tuple(4, 3, true), std::tuple(5, 3, false)}) {
    Scene scene = scene_of(sheets_of(0, below), limit);
    scene.lights.clear();
    scene.instances.erase(scene.instances.begin());  // the floor
    scene.environment.color = {1, 1, 1};
    EXPECT_EQ(render_scene(scene, render_options(scene, 4, 1)).mean() > 0, is_seen) << below << " " << limit;
  }
}

}  // namespace
}  // namespace relief::test
