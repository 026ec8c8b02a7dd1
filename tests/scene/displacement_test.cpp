// Displacement of materials: settings, where the height maps come from, and what is said of the meshes under them.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "kernel/texture/texture.h"
#include "scene/displaced_mesh.h"
#include "scene/texture_store.h"
#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::num_warnings;

/// The square under one displaced material, whose texture 0 is a grey pixel.
GltfBuilder square_displaced(const json& settings)
{
  GltfBuilder b = test::square_scene();
  b.json["images"] = {{{"uri", test::kGreyPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {{{"name", "bark"}, {"extensions", {{"RELIEF_displacement", settings}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

GltfBuilder square_displaced() { return square_displaced({{"heightTexture", {{"index", 0}}}}); }

const DisplacementSettings& settings(const Scene& scene) { return scene.displacements.at(0); }

const HeightMap& height_map(const Scene& scene)
{
  return scene.height_maps.at(static_cast<std::size_t>(settings(scene).height.texture_index));
}

// --- settings ---

TEST(Displacement, IsRead)
{
  const Scene scene = load(square_displaced(
      {{"heightTexture", {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"scale", {8, 8}}}}}}}},
       {"scale", -0.25},
       {"midlevel", 0.1},
       {"space", "world"},
       {"method", "tfdm"},
       {"lod", 2},
       {"smoothing", true},
       {"seams", "weld"}}));
  ASSERT_EQ(scene.displacements.size(), 1u);
  EXPECT_EQ(scene.materials.at(0).displacement_index, 0);
  const DisplacementSettings& d = settings(scene);
  EXPECT_EQ(d.height.texture_index, 0);
  EXPECT_EQ(d.height.m00, 8);
  EXPECT_EQ(d.scale, -0.25f);
  EXPECT_EQ(d.midlevel, 0.1f);
  EXPECT_EQ(d.space, DisplacementSpace::kWorld);
  EXPECT_EQ(d.method, DisplacementMethod::tfdm);
  EXPECT_EQ(d.lod, 2);
  EXPECT_EQ(DisplacementSettings{}.lod, 0);
  EXPECT_TRUE(d.smoothing);
  EXPECT_TRUE(d.weld_seams);
  EXPECT_EQ(scene.textures->views().size(), 2u);  // of the default light and what stands behind it: heights are none
}

TEST(Displacement, EveryMethodHasItsName)
{
  for (std::size_t k = 0; k < std::size(kDisplacementMethodLabels); ++k) {
    const std::string name(kDisplacementMethodLabels[k]);
    EXPECT_EQ(settings(load(square_displaced({{"heightTexture", {{"index", 0}}}, {"method", name}}))).method,
              static_cast<DisplacementMethod>(k))
        << name;
  }
}

TEST(Displacement, MidlevelIsAnyNumber)
{
  for (const double midlevel : {-3.0, 8848.5}) {
    const Scene scene = load(square_displaced({{"heightTexture", {{"index", 0}}}, {"midlevel", midlevel}}));
    EXPECT_EQ(settings(scene).midlevel, static_cast<float>(midlevel));
  }
}

// offset + factor · h = scale · (h − midlevel)
TEST(Displacement, TheUnofficialExtensionMeansTheSame)
{
  GltfBuilder b = square_displaced();
  b.json["materials"][0]["extensions"] = {{"KHR_materials_displacement",
                                           {{"displacementGeometryTexture", {{"index", 0}}},
                                            {"displacementGeometryFactor", 0.5},
                                            {"displacementGeometryOffset", -0.1}}}};
  const Scene scene = load(b);
  const DisplacementSettings& d = settings(scene);
  for (const float h : {0.0f, 0.3f, 1.0f}) {
    EXPECT_NEAR(d.scale * (h - d.midlevel), -0.1f + 0.5f * h, 1e-7f);
  }
  EXPECT_EQ(height_map(scene).width, 1);
}

// --- where height maps come from ---

TEST(Displacement, WrapModesAreTheSamplers)
{
  constexpr int kClampToEdge = 33071, kMirroredRepeat = 33648;
  GltfBuilder b = square_displaced();
  b.json["samplers"] = {{{"wrapS", kClampToEdge}, {"wrapT", kMirroredRepeat}}};
  EXPECT_EQ(height_map(load(b)).wrap_u, Wrap::kRepeat);
  b.json["textures"][0]["sampler"] = 0;
  const Scene scene = load(b);
  EXPECT_EQ(height_map(scene).wrap_u, Wrap::kClamp);
  EXPECT_EQ(height_map(scene).wrap_v, Wrap::kMirror);
  EXPECT_EQ(num_warnings(scene, "images"), 0u);
}

TEST(Displacement, NearestFilterIsAWarning)
{
  constexpr int kNearest = 9728;
  GltfBuilder b = square_displaced();
  b.json["samplers"] = {{{"magFilter", kNearest}}};
  b.json["textures"][0]["sampler"] = 0;
  EXPECT_EQ(num_warnings(load(b), "heights are interpolated"), 1u);
}

TEST(Displacement, AnImageMayBeColourAndHeight)
{
  GltfBuilder b = square_displaced();
  b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  b.json["extensions"]["RELIEF_environment"] = json::object();
  const Scene scene = load(b);
  EXPECT_EQ(scene.textures->views().size(), 1u);
  ASSERT_EQ(scene.height_maps.size(), 1u);
  EXPECT_EQ(scene.materials.at(0).base_color_texture.texture_index, 0);
  EXPECT_EQ(scene.textures->views()[0].format, TexelFormat::kU8Srgb);
  // 128/255 as it is, not its linear value
  EXPECT_EQ(*static_cast<const std::uint8_t*>(height_map(scene).texels.get()), 128);
}

TEST(Displacement, MaterialsShareEqualMapsHoweverTheyNameThem)
{
  const test::TemporaryFolder folder;
  const std::string_view uri = test::kGreyPixelPng;
  GltfBuilder b = square_displaced({{"heightTexture", {{"uri", "h.png"}}}});
  b.json["images"][0]["uri"] = "h.png";
  b.push("materials", {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}});
  b.json["meshes"].push_back(b.json["meshes"][0]);
  b.json["meshes"][1]["primitives"][0]["material"] = 1;
  b.root_node({{"mesh", 1}});
  folder.write("h.png", test::from_base64(uri.substr(uri.find(',') + 1)));
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_EQ(scene.displacements.size(), 2u);
  EXPECT_EQ(scene.height_maps.size(), 1u);
  EXPECT_EQ(scene.displacements[1].height.texture_index, 0);
  EXPECT_EQ(height_map(scene).width, 1);
  EXPECT_NE(std::find(scene.files.begin(), scene.files.end(), file_stamp(folder / "h.png")), scene.files.end());
}

TEST(Displacement, MapsInBufferViewsAreRead)
{
  GltfBuilder b = square_displaced();
  const std::string_view uri = test::kGreyPixelPng;
  const std::string png = test::from_base64(uri.substr(uri.find(',') + 1));
  const int view = b.view(std::vector<char>(png.begin(), png.end()));
  b.json["images"] = {{{"bufferView", view}, {"mimeType", "image/png"}}};
  EXPECT_EQ(*static_cast<const std::uint8_t*>(height_map(load(b)).texels.get()), 128);
}

// --- heights by graph ---

/// Nodes of ½ + ½ sin(turns · 2π u) + rise · v, over coordinates whose v points up.
json sine_graph(double turns, double rise = 0)
{
  constexpr double kTwoPi = 6.283185307179586;
  const json uv = {{"node", 0}, {"output", "uv"}};
  const auto math = [](const char* operation, const json& a, const json& b) {
    return json{{"type", "math"}, {"operation", operation}, {"inputs", {{"a", a}, {"b", b}}}};
  };
  const auto node = [](int index) { return json{{"node", index}}; };
  const json x = {{"node", 1}, {"output", "x"}}, y = {{"node", 1}, {"output", "y"}};
  return {{"nodes",
           {{{"type", "texture-coordinate"}},
            {{"type", "separate"}, {"inputs", {{"vector", uv}}}},
            math("multiply", x, turns * kTwoPi),
            math("sine", node(2), 0),
            math("multiply", node(3), 0.5),
            math("add", node(4), 0.5),
            math("multiply", y, rise),
            math("add", node(5), node(6))}},
          {"outputs", {{"height", {{"node", 7}}}}}};
}

/// Bilinear height at a mesh's texture coordinates.
float height_of(const Scene& scene, float u, float v)
{
  const HeightMapView map = height_map(scene).view();
  const Vec2f at = texture_ref_uv(settings(scene).height, {u, v});
  const float x = at.x * static_cast<float>(map.width) - 0.5f, y = at.y * static_cast<float>(map.height) - 0.5f;
  const auto wrap = [](Wrap mode, int i, int n) {
    return mode == Wrap::kRepeat ? (i % n + n) % n : std::clamp(i, 0, n - 1);
  };
  const auto texel = [&](int i, int j) {
    return height_at(map, std::int64_t{wrap(map.wrap_v, j, map.height)} * map.width + wrap(map.wrap_u, i, map.width));
  };
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const float s = x - std::floor(x), t = y - std::floor(y);
  return (texel(i, j) * (1 - s) + texel(i + 1, j) * s) * (1 - t) +
         (texel(i, j + 1) * (1 - s) + texel(i + 1, j + 1) * s) * t;
}

/// Largest difference to ½ + ½ sin(turns · 2π u) + rise · (1 − v) within a rectangle.
float sine_error(const Scene& scene, float turns, float rise, Vec2f low, Vec2f high)
{
  float error = 0;
  constexpr int kSteps = 97;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const float u = low.x + (high.x - low.x) * static_cast<float>(i) / kSteps;
      const float v = low.y + (high.y - low.y) * static_cast<float>(j) / kSteps;
      const float meant = 0.5f + 0.5f * std::sin(turns * 6.2831853f * u) + rise * (1 - v);
      error = std::max(error, std::abs(height_of(scene, u, v) - meant));
    }
  }
  return error;
}

json with(json graph, const json& more)
{
  graph.update(more);
  return graph;
}

TEST(HeightGraph, IsEvaluatedIntoAMapThatRepeats)
{
  const Scene scene = load(square_displaced({{"heightGraph", sine_graph(4)}, {"scale", 0.25}}));
  EXPECT_EQ(settings(scene).scale, 0.25f);
  EXPECT_EQ(height_map(scene).wrap_u, Wrap::kRepeat);
  EXPECT_EQ(height_map(scene).wrap_v, Wrap::kRepeat);
  EXPECT_EQ(height_map(scene).width, 256);
  EXPECT_EQ(settings(scene).height.m00, 1);
  EXPECT_LT(sine_error(scene, 4, 0, {-1.5f, -0.5f}, {2.5f, 1.5f}), 1.0f / 512);
  EXPECT_EQ(num_warnings(scene, "heightGraph"), 0u);
}

TEST(HeightGraph, IsEvaluatedByTheInterpreterThatIsGiven)
{
  static std::atomic<int> num_runs;
  num_runs = 0;
  LoadOptions options;
  options.run_graph = [](const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers) {
    ++num_runs;
    graph_program_run(program, textures, registers);
  };
  const Scene scene = load(square_displaced({{"heightGraph", sine_graph(4)}}), options);
  EXPECT_GE(num_runs, height_map(scene).width * height_map(scene).height / 8);
}

TEST(HeightGraph, RepeatsAlongTheDirectionThatIsPeriodic)
{
  const Scene scene = load(square_displaced({{"heightGraph", sine_graph(3, 2)}}));
  EXPECT_EQ(height_map(scene).wrap_u, Wrap::kRepeat);
  EXPECT_EQ(height_map(scene).wrap_v, Wrap::kClamp);
  EXPECT_LT(sine_error(scene, 3, 2, {-1.5f, 0}, {2.5f, 1}), 3.0f / 512);
}

TEST(HeightGraph, CoversWhatTheFileSaysWhereItDoesNotRepeat)
{
  const json graph = with(sine_graph(0.3, -1), {{"uvRange", {-2, 0.25, 3, 0.5}}});
  GltfBuilder b = square_displaced({{"heightGraph", graph}});
  const Scene scene = load(b);
  EXPECT_EQ(height_map(scene).wrap_u, Wrap::kClamp);
  EXPECT_EQ(height_map(scene).wrap_v, Wrap::kClamp);
  EXPECT_LT(sine_error(scene, 0.3f, -1, {-2, 0.25f}, {3, 0.5f}), 1.3f / 512);
  // The square's coordinates are 0…1.
  EXPECT_EQ(num_warnings(scene, "texture coordinates beyond the uvRange"), 1u);
}

TEST(HeightGraph, IsAsFineAsItsDetail)
{
  const auto size = [](const json& graph) {
    return height_map(load(square_displaced({{"heightGraph", graph}}))).width;
  };
  EXPECT_EQ(size(sine_graph(1)), 256);
  // Between texels 2π turns / size apart, a sine sags by an eighth of that squared.
  EXPECT_EQ(size(sine_graph(20)), 1024);
  EXPECT_EQ(size(with(sine_graph(20), {{"resolution", 128}})), 128);
}

TEST(HeightGraph, TellsOfDetailThatIsLost)
{
  const Scene scene = load(square_displaced({{"heightGraph", with(sine_graph(20), {{"resolution", 128}})}}));
  EXPECT_EQ(num_warnings(scene, "the height of material \"bark\" is known to"), 1u);
}

TEST(HeightGraph, ConstantsAreATexel)
{
  const json graph = {{"nodes", {{{"type", "math"}, {"operation", "add"}, {"inputs", {{"a", 0.25}, {"b", 0.5}}}}}},
                      {"outputs", {{"height", {{"node", 0}}}}}};
  const Scene scene = load(square_displaced({{"heightGraph", graph}}));
  EXPECT_EQ(height_map(scene).width, 1);
  EXPECT_EQ(height_of(scene, 0.3f, 0.7f), 0.75f);
}

TEST(HeightGraph, EqualOnesShareAMapBesideImages)
{
  GltfBuilder b = square_displaced({{"heightGraph", sine_graph(2)}});
  const json same = {{"heightGraph", sine_graph(2)}, {"smoothing", true}};
  b.push("materials", {{"extensions", {{"RELIEF_displacement", same}}}});
  b.push("materials", {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}});
  for (int i = 1; i < 3; ++i) {
    b.json["meshes"].push_back(b.json["meshes"][0]);
    b.json["meshes"][static_cast<std::size_t>(i)]["primitives"][0]["material"] = i;
    b.root_node({{"mesh", i}});
  }
  const Scene scene = load(b);
  ASSERT_EQ(scene.displacements.size(), 3u);
  ASSERT_EQ(scene.height_maps.size(), 2u);
  EXPECT_EQ(scene.displacements[0].height.texture_index, scene.displacements[1].height.texture_index);
  const int image = scene.displacements[2].height.texture_index;
  EXPECT_EQ(scene.height_maps[static_cast<std::size_t>(image)].width, 1);
}

TEST(HeightGraph, OfOtherInputsIsKept)
{
  const auto with_output = [](const json& reference) {
    json graph = sine_graph(1);
    graph["nodes"][1]["inputs"]["vector"] = reference;
    return graph;
  };
  json image = sine_graph(1);
  image["nodes"].push_back({{"type", "image-texture"},
                            {"texture", {{"index", 0}}},
                            {"inputs", {{"vector", {{"node", 0}, {"output", "uv"}}}}}});
  image["nodes"][1]["inputs"]["vector"] = {{"node", 8}, {"output", "color"}};
  for (const json& graph :
       {with_output({{"node", 0}, {"output", "object"}}), with_output({{"node", 0}, {"output", "generated"}}),
        with_output({{"node", 0}, {"output", "uv1"}}), image, with(sine_graph(1), {{"evaluate", "points"}})}) {
    const Scene scene = load(square_displaced({{"heightGraph", graph}}));
    ASSERT_EQ(scene.displacements.size(), 1u) << graph;
    const DisplacementSettings& d = settings(scene);
    ASSERT_GE(d.graph_index, 0) << graph;
    EXPECT_EQ(d.num_cells, 0);
    EXPECT_EQ(d.cell_pixels, 1.0f);
    EXPECT_TRUE(scene.height_maps.empty());
    EXPECT_EQ(scene.graphs.at(static_cast<std::size_t>(d.graph_index)).results.size(), 1u);
    EXPECT_EQ(num_warnings(scene, "heightGraph"), 0u) << graph;
  }
}

TEST(Displacement, SaysHowFineComputedHeightsAre)
{
  const json graph = with(sine_graph(1), {{"evaluate", "points"}});
  const Scene scene = load(square_displaced({{"heightGraph", graph}, {"cells", 4096}, {"cellPixels", 0.5}}));
  EXPECT_EQ(settings(scene).num_cells, 4096);
  EXPECT_EQ(settings(scene).cell_pixels, 0.5f);
  const Scene by_length = load(square_displaced(
      {{"heightGraph", graph}, {"cellLength", 0.25}, {"mostCells", 64}, {"coarserOutside", 2}, {"divide", true}}));
  EXPECT_EQ(settings(by_length).cell_length, 0.25f);
  EXPECT_EQ(settings(by_length).most_cells, 64);
  EXPECT_EQ(settings(by_length).coarser_outside, 2.0f);
  EXPECT_EQ(settings(scene).coarser_outside, 4.0f);
  for (const json& wrong :
       {json{{"mostCells", 63}}, json{{"mostCells", "auto"}}, json{{"cellLength", 0}}, json{{"coarserOutside", 0.5}}}) {
    json displacement{{"heightGraph", graph}};
    displacement.update(wrong);
    EXPECT_THROW(load(square_displaced(displacement)), SceneError) << wrong;
  }
}

/// A map has no cells, but where it is diced sides of some length.
TEST(Displacement, SaysHowFineMapsAreDiced)
{
  const json map{{"heightGraph", sine_graph(1)}, {"cellPixels", 2}, {"coarserOutside", 8}};
  const Scene scene = load(square_displaced(map));
  EXPECT_EQ(settings(scene).cell_pixels, 2.0f);
  EXPECT_EQ(settings(scene).coarser_outside, 8.0f);
  EXPECT_EQ(num_warnings(scene, "cellPixels") + num_warnings(scene, "coarserOutside"), 0u);
}

TEST(Displacement, WarnsOfWhatIsOfTheOtherKind)
{
  for (const char* name : {"cells", "cellLength", "mostCells"})
    EXPECT_EQ(num_warnings(load(square_displaced({{"heightGraph", sine_graph(1)}, {name, 4}})), name), 1u);
  const json points = with(sine_graph(1), {{"evaluate", "points"}, {"resolution", 4}});
  EXPECT_EQ(num_warnings(load(square_displaced({{"heightGraph", points}})), "resolution"), 1u);
}

TEST(Displacement, MayCurveTheBaseAlone)
{
  const Scene scene = load(square_displaced({{"curved", true}}));
  EXPECT_TRUE(settings(scene).curved);
  EXPECT_LT(settings(scene).height.texture_index, 0);
  EXPECT_TRUE(displacement_is_computed(settings(scene)));
}

TEST(HeightGraph, MistakesAreNamed)
{
  json without_output = sine_graph(1), cycle = sine_graph(1), unknown = sine_graph(1);
  without_output["outputs"] = json::object();
  cycle["nodes"][2]["inputs"]["a"] = {{"node", 5}};
  unknown["nodes"][3]["type"] = "sinus";
  const std::pair<json, const char*> cases[] = {
      {{{"heightGraph", without_output}}, "/heightGraph/outputs/height"},
      {{{"heightGraph", cycle}}, "/heightGraph/nodes"},
      {{{"heightGraph", unknown}}, "/heightGraph/nodes/3/type"},
      {{{"heightGraph", with(sine_graph(1), {{"uvRange", {0, 0, 0, 1}}})}}, "/heightGraph/uvRange"},
      {{{"heightGraph", with(sine_graph(1), {{"texCoord", 2}})}}, "/heightGraph/texCoord"},
      {{{"heightGraph", with(sine_graph(1), {{"resolution", 1}})}}, "/heightGraph/resolution"},
      {{{"heightGraph", with(sine_graph(1), {{"resolution", 0}})}}, "/heightGraph/resolution"},
      {{{"heightGraph", with(sine_graph(1), {{"evaluate", "often"}})}}, "/heightGraph/evaluate"},
      {{{"curved", true}, {"cells", 3}}, "/cells"},
      {{{"curved", true}, {"cells", "all"}}, "/cells"},
      {{{"curved", true}, {"cellPixels", 0}}, "/cellPixels"},
      {{{"heightGraph", sine_graph(1)}, {"heightTexture", {{"index", 0}}}}, "either heightTexture or heightGraph"},
      {json::object(), "a heightTexture, heightGraph, vectorTexture or vectorGraph"}};
  for (const auto& [value, place] : cases) {
    try {
      load(square_displaced(value));
      ADD_FAILURE() << place;
    } catch (const SceneError& error) {
      EXPECT_NE(std::string(error.what()).find(place), std::string::npos) << error.what();
    }
  }
}

// --- meshes ---

TEST(DisplacedMesh, ASoundOneGivesNoWarning)
{
  const Scene scene = load(square_displaced());
  EXPECT_EQ(num_warnings(scene, "displaced"), 0u);
}

TEST(DisplacedMesh, MissingAttributesAreSaidOnceAMesh)
{
  GltfBuilder b = square_displaced();
  json& attributes = b.json["meshes"][0]["primitives"][0]["attributes"];
  attributes.erase("NORMAL");
  attributes.erase("TEXCOORD_0");
  b.root_node({{"mesh", 0}, {"translation", {3, 0, 0}}});
  const Scene scene = load(b);
  EXPECT_EQ(num_warnings(scene, "/meshes/0: displaced without normals"), 1u);
  EXPECT_EQ(num_warnings(scene, "/meshes/0: displaced without TEXCOORD_0"), 1u);
  EXPECT_EQ(num_warnings(scene, "(×"), 0u);
}

/// The square as two triangles with vertices of their own: 0 1 2 and 3 4 5, along the diagonal 0–2 = 3–4.
GltfBuilder split_square(const std::vector<float>& normals, const std::vector<float>& uv)
{
  GltfBuilder b = square_displaced();
  json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive.erase("indices");
  json& attributes = primitive["attributes"];
  attributes["POSITION"] = b.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  attributes["NORMAL"] = b.accessor<float>(normals, "VEC3");
  attributes["TEXCOORD_0"] = b.accessor<float>(uv, "VEC2");
  return b;
}

const std::vector<float> kUpNormals = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
const std::vector<float> kWholeUv = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};

TEST(DisplacedMesh, SplitNormalsAreCountedByPosition)
{
  EXPECT_EQ(num_warnings(load(split_square(kUpNormals, kWholeUv)), "displaced"), 0u);
  std::vector<float> normals = kUpNormals;
  normals[3 * 4 + 1] = 1;  // at (1, 1), 45° from its twin
  const Scene scene = load(split_square(normals, kWholeUv));
  EXPECT_EQ(num_warnings(scene, "cracks open at 1 positions, whose normals are up to 45° apart"), 1u);
}

TEST(DisplacedMesh, TrianglesWithoutUvAreaAreCounted)
{
  std::vector<float> uv = kWholeUv;
  std::fill(uv.begin() + 6, uv.end(), 0.3f);
  EXPECT_EQ(num_warnings(load(split_square(kUpNormals, uv)), "displaced with 1 triangles that have no area"), 1u);
}

TEST(DisplacedMesh, UvBoundsAreAfterTheTransform)
{
  const Scene scene = load(square_displaced(
      {{"heightTexture",
        {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"scale", {25, 8}}, {"offset", {-1, 0.5}}}}}}}}}));
  const UvBounds bounds = displaced_mesh_uv_bounds(scene.meshes.at(0), settings(scene).height);
  EXPECT_EQ(bounds.low, (Vec2f{-1, 0.5f}));
  EXPECT_EQ(bounds.high, (Vec2f{24, 8.5f}));
}

TEST(DisplacedMesh, MaterialsOfInstancesCount)
{
  Scene scene;
  scene.meshes.resize(2);
  scene.materials.resize(3);
  scene.materials[1].displacement_index = 0;
  scene.materials[2].displacement_index = 1;
  for (const auto& [mesh, material] : {std::pair{0, 0}, {0, 1}, {1, 2}, {0, 1}, {0, 2}}) {
    Instance instance;
    instance.mesh_index = mesh;
    instance.material_index = material;
    scene.instances.push_back(instance);
  }
  const std::vector<MeshDisplacement> displaced = displaced_meshes(scene);
  ASSERT_EQ(displaced.size(), 3u);
  EXPECT_EQ(displaced[0].mesh_index, 0);
  EXPECT_EQ(displaced[0].displacement_index, 0);
  EXPECT_EQ(displaced[1].mesh_index, 1);
  EXPECT_EQ(displaced[2].displacement_index, 1);
}

TEST(DisplacedMesh, WeldingFindsTheFirstOfEqualPositions)
{
  const std::vector<Vec3f> P = {{1, 2, 3}, {0, 0, 0}, {1, 2, 3}, {-0.0f, 0, 0}, {1, 2, 4}};
  EXPECT_EQ(weld_positions(P), (std::vector<std::uint32_t>{0, 1, 0, 1, 4}));
  EXPECT_TRUE(weld_positions({}).empty());
}

// --- vectors ---

/// What loading a displacement fails with; empty: nothing.
std::string fault_of(const json& settings)
{
  try {
    load(square_displaced(settings));
  } catch (const SceneError& error) {
    return error.json_path + ": " + error.what();
  }
  return "";
}

TEST(VectorDisplacement, OfAMapOrAGraphGivesThreeNumbers)
{
  json graph = sine_graph(1);
  graph["nodes"].push_back({{"type", "combine"}, {"inputs", {{"x", 1}}}});
  graph["outputs"] = {{"vector", {{"node", graph["nodes"].size() - 1}}}};
  GltfBuilder map = square_displaced({{"vectorTexture", {{"index", 0}}}, {"space", "world"}});
  map.json["images"][0]["uri"] = test::kPixelPng;
  for (const Scene& scene : {load(square_displaced({{"vectorGraph", graph}, {"divide", true}})), load(map)}) {
    const DisplacementSettings& d = settings(scene);
    EXPECT_TRUE(d.by_vectors);
    EXPECT_FALSE(d.has_graph);
    EXPECT_EQ(num_warnings(scene, "unknown property"), 0u);
    ASSERT_GE(d.graph_index, 0);
    EXPECT_EQ(scene.graphs.at(static_cast<std::size_t>(d.graph_index)).results.size(), 3u);
    EXPECT_EQ(d.divide, scene.height_maps.empty() && scene.graphs[0].inputs.empty());
  }
}

TEST(VectorDisplacement, SaysWhatIsNoVector)
{
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const std::string path = "/materials/0/extensions/RELIEF_displacement";
  json number = sine_graph(1);
  number["outputs"] = {{"vector", number["outputs"]["height"]}};
  const std::string scalar = fault_of({{"vectorGraph", number}});
  EXPECT_TRUE(has(scalar, (path + "/vectorGraph/outputs/vector").c_str())) << scalar;
  EXPECT_TRUE(has(scalar, "expected a vector or a colour, found a number")) << scalar;
  EXPECT_TRUE(has(fault_of({{"vectorGraph", sine_graph(1)}}), "/vectorGraph/outputs/vector"));
  const std::string grey = fault_of({{"vectorTexture", {{"index", 0}}}});
  EXPECT_TRUE(has(grey, "expected an image of three channels, as it is one of vectors, found one channel")) << grey;
  EXPECT_TRUE(has(fault_of({{"vectorTexture", {{"index", 5}}}}), (path + "/vectorTexture/index").c_str()));
  EXPECT_TRUE(has(fault_of({{"vectorTexture", {{"uri", "a.exr"}}}}), (path + "/vectorTexture/index").c_str()));
  const std::string both = fault_of({{"vectorTexture", {{"index", 0}}}, {"heightTexture", {{"index", 0}}}});
  EXPECT_TRUE(has(both, "expected either heightTexture or vectorTexture, found both")) << both;
  json vectors = number;
  vectors["outputs"] = {{"vector", {{"node", 0}, {"output", "object"}}}};
  EXPECT_TRUE(has(fault_of({{"vectorGraph", vectors}, {"curved", true}}), (path + "/curved").c_str()));
  EXPECT_TRUE(has(fault_of({{"vectorGraph", vectors}, {"space", "camera"}}), (path + "/space").c_str()));
}

}  // namespace
}  // namespace relief
