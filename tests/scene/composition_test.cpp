// Node trees, instances and references between files.
#include "scene/composition.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::has_warning;

void expect_near(Vec3f a, Vec3f b, float tolerance = 1e-6f)
{
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

/// A file without meshes whose one root node refers to another.
GltfBuilder reference_to(const json& reference)
{
  GltfBuilder b;
  b.root_node({{"name", "holder"}, {"extensions", {{"RELIEF_reference", reference}}}});
  return b;
}

TEST(Transform, TrsIsTranslationAfterRotationAfterScale)
{
  const double s = std::sqrt(0.5);
  const Transform t = transform_from_trs({{1, 2, 3}, {0, 0, s, s}, {2, 3, 4}});  // 90° about z
  const Affine3 m = transform_to_affine(t);
  expect_near(m.x, {0, 2, 0});
  expect_near(m.y, {-3, 0, 0});
  expect_near(m.z, {0, 0, 4});
  expect_near(m.p, {1, 2, 3});
}

TEST(Transform, QuaternionsNeedNotBeUnit)
{
  const Affine3 m = transform_to_affine(transform_from_trs({{}, {0, 0, 5, 5}, {1, 1, 1}}));
  expect_near(m.x, {0, 1, 0});
  expect_near(transform_to_affine(transform_from_trs({{}, {0, 0, 0, 0}, {1, 1, 1}})).x, {1, 0, 0});
}

TEST(Transform, MatricesAreColumnMajor)
{
  const auto t = transform_from_matrix({1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 10, 0, 11, 12, 13, 1});
  ASSERT_TRUE(t.has_value());
  EXPECT_EQ(transform_to_affine(*t).x, (Vec3f{1, 2, 3}));
  EXPECT_EQ(transform_to_affine(*t).p, (Vec3f{11, 12, 13}));
  EXPECT_FALSE(transform_from_matrix({1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}).has_value());
}

TEST(Transform, DefectsAreFlatnessAtSinglePrecision)
{
  const auto scaled = [](double x, double y, double z) { return transform_from_trs({{}, {0, 0, 0, 1}, {x, y, z}}); };
  EXPECT_EQ(transform_defect(scaled(1, 1, 1e-9)), TransformDefect::kNone);
  EXPECT_EQ(transform_defect(scaled(1e-12, 1e-12, 1e-12)), TransformDefect::kNone);
  EXPECT_EQ(transform_defect(scaled(1, 0, 1)), TransformDefect::kSingular);
  EXPECT_EQ(transform_defect(scaled(1e39, 1, 1)), TransformDefect::kNotFinite);
  EXPECT_EQ(transform_defect(scaled(NAN, 1, 1)), TransformDefect::kNotFinite);
  // A turned, flattened box: the determinant is not exactly zero, only noise.
  const Transform turned = transform_from_trs({{}, {0.1, 0.2, 0.3, 0.9}, {1, 1, 1}});
  EXPECT_EQ(transform_defect(turned * scaled(1, 0, 1) * turned), TransformDefect::kSingular);
}

TEST(Composition, ChildrenAreInTheSpaceOfTheirParents)
{
  GltfBuilder b = test::square_scene();
  b.json["nodes"] = json::array();
  b.json["scenes"][0]["nodes"] = json::array();
  b.root_node({{"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}, {"children", {1}}});
  b.push("nodes", {{"translation", {0, 3, 0}}, {"children", {2}}});
  b.push("nodes", {{"name", "leaf"}, {"translation", {1, 0, 0}}, {"mesh", 0}});
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].name, "leaf");
  expect_near(scene.instances[0].world_from_object.p, {12, 6, 0});
  expect_near(scene.instances[0].world_from_object.x, {2, 0, 0});
}

TEST(Composition, AMeshUsedTwiceIsKeptOnce)
{
  GltfBuilder b = test::square_scene();
  b.root_node({{"mesh", 0}, {"translation", {5, 0, 0}}});
  const Scene scene = load(b);
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.instances.size(), 2u);
}

TEST(Composition, EachPrimitiveIsAnInstance)
{
  GltfBuilder b = test::square_scene();
  json& primitives = b.json["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  b.json["materials"] = {{{"name", "second"}}};
  primitives[1]["material"] = 0;
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.material_names[static_cast<std::size_t>(scene.instances[0].material_index)], "default");
  EXPECT_EQ(scene.material_names[static_cast<std::size_t>(scene.instances[1].material_index)], "second");
}

TEST(Composition, OnlyTheDefaultSceneIsRead)
{
  GltfBuilder b = test::square_scene();
  b.json["nodes"].push_back({{"mesh", 0}});
  b.json["scenes"].push_back({{"nodes", {1}}});
  EXPECT_EQ(load(b).instances.size(), 1u);
}

TEST(Composition, WithoutScenesEveryRootIsRead)
{
  GltfBuilder b = test::square_scene();
  b.json.erase("scene");
  b.json.erase("scenes");
  b.json["nodes"] = {{{"children", {1}}}, {{"mesh", 0}}, {{"mesh", 0}}};
  EXPECT_EQ(load(b).instances.size(), 2u);
}

TEST(Composition, MirroringIsFlaggedByDeterminant)
{
  GltfBuilder b = test::square_scene();
  b.root_node({{"mesh", 0}, {"scale", {-1, 1, 1}}});
  b.root_node({{"mesh", 0}, {"scale", {-1, -1, 1}}});
  const Scene scene = load(b);
  EXPECT_FALSE(scene.instances[0].flags & kMirrored);
  EXPECT_TRUE(scene.instances[1].flags & kMirrored);
  EXPECT_FALSE(scene.instances[2].flags & kMirrored);
}

TEST(Composition, AHundredThousandNestedNodesAreFine)
{
  GltfBuilder b = test::square_scene();
  constexpr int kDepth = 100000;
  b.json["nodes"] = json::array();
  for (int i = 0; i < kDepth; ++i) {
    b.json["nodes"].push_back({{"children", {i + 1}}});
  }
  b.json["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(load(b).instances.size(), 1u);
}

TEST(Composition, ObjectSettingsAreInheritedAndOverruled)
{
  GltfBuilder b = test::square_scene();
  b.json["nodes"] = {
      {{"children", {1, 2}}, {"extensions", {{"RELIEF_object", {{"castsShadow", false}, {"causticCaster", true}}}}}},
      {{"mesh", 0}},
      {{"mesh", 0},
       {"extensions",
        {{"RELIEF_object",
          {{"castsShadow", true},
           {"visibleToCamera", false},
           {"causticCaster", false},
           {"causticReceiver", false}}}}}}};
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.instances[0].flags, kVisibleToCamera | kCausticCaster | kCausticReceiver);
  EXPECT_EQ(scene.instances[1].flags, kCastsShadow);
}

TEST(Composition, ShadowCatchersAreInheritedAndNoNumbers)
{
  GltfBuilder b = test::square_scene();
  b.json["nodes"] = {
      {{"children", {1, 2}}, {"extensions", {{"RELIEF_object", {{"shadowCatcher", true}}}}}},
      {{"mesh", 0}},
      {{"extensions",
        {{"RELIEF_area_light", {{"radiance", 1}}},
         {"RELIEF_object", {{"shadowCatcher", false}, {"lightsFootage", false}, {"multipleImportance", false}}}}},
       {"mesh", 0}}};
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_NE(scene.instances[0].flags & kShadowCatcher, 0u);
  EXPECT_EQ(scene.instances[1].flags & kShadowCatcher, 0u);
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_FALSE(scene.lights[0].in_footage);
  EXPECT_FALSE(scene.lights[0].multiple_importance);
  for (const char* name : {"shadowCatcher", "lightsFootage", "multipleImportance"}) {
    b.json["nodes"][0]["extensions"]["RELIEF_object"] = {{name, 1}};
    try {
      load(b);
      ADD_FAILURE() << "expected an error";
    } catch (const SceneError& e) {
      EXPECT_EQ(e.json_path, std::string("/nodes/0/extensions/RELIEF_object/") + name);
      EXPECT_EQ(e.expected, "true or false");
    }
  }
}

TEST(Composition, LightGroupsAreNumberedAsTheyAreMet)
{
  GltfBuilder b = test::square_scene();
  const auto in_group = [](const json& name) { return json{{"RELIEF_object", {{"lightGroup", name}}}}; };
  b.json["nodes"] = {{{"children", {1, 2}}, {"extensions", in_group("a")}},
                     {{"mesh", 0}},
                     {{"mesh", 0}, {"extensions", in_group("b")}},
                     {{"mesh", 0}, {"extensions", in_group("")}}};
  b.json["scenes"][0]["nodes"] = {0, 3};
  b.json["extensions"]["RELIEF_environment"] = {{"color", {1, 1, 1}}, {"lightGroup", "b"}};
  const Scene scene = load(b);
  EXPECT_EQ(scene.light_groups, (std::vector<std::string>{"a", "b"}));
  ASSERT_EQ(scene.instances.size(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ((scene.instances[i].flags & kLightGroup) >> kLightGroupShift, (i + 1) % 3);
  }
  EXPECT_EQ(scene.environment.light_group, 2u);

  const auto error_of = [&] {
    try {
      load(b);
    } catch (const SceneError& e) {
      return e.json_path + ": " + e.expected;
    }
    return std::string("no error");
  };
  for (int i = 0; i < 30; ++i) {
    b.json["nodes"].push_back({{"mesh", 0}, {"extensions", in_group(std::to_string(i))}});
    b.json["scenes"][0]["nodes"].push_back(4 + i);
  }
  EXPECT_EQ(error_of(), "/nodes/33/extensions/RELIEF_object/lightGroup: at most 31 groups of lights");
  b.json["nodes"][0]["extensions"] = in_group(std::string(201, 'x'));
  EXPECT_EQ(error_of(), "/nodes/0/extensions/RELIEF_object/lightGroup: a name of at most 200 bytes");
  b.json["nodes"][0]["extensions"] = in_group(3);
  EXPECT_EQ(error_of(), "/nodes/0/extensions/RELIEF_object/lightGroup: a string");
}

// --- EXT_mesh_gpu_instancing ---

TEST(Instancing, PlacesCopiesInTheNodesSpace)
{
  GltfBuilder b = test::square_scene();
  const int t = b.accessor<float>({1, 0, 0, 0, 1, 0}, "VEC3");
  const int r = b.accessor<std::int16_t>({0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", true);
  const int s = b.accessor<float>({1, 1, 1, 3, 3, 3}, "VEC3");
  b.json["nodes"][0]["translation"] = {100, 0, 0};
  b.json["nodes"][0]["scale"] = {2, 2, 2};
  b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s}};
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 2u);
  expect_near(scene.instances[0].world_from_object.p, {102, 0, 0});
  expect_near(scene.instances[1].world_from_object.p, {100, 2, 0});
  expect_near(scene.instances[1].world_from_object.x, {-6, 0, 0}, 1e-5f);  // half a turn about z, times 2 · 3
  EXPECT_EQ(scene.instances[1].mesh_index, 0);
}

// --- RELIEF_reference ---

TEST(References, BringInAnotherFilesRoots)
{
  const test::TemporaryFolder folder;
  folder.write("square.gltf", test::square_scene().gltf());
  GltfBuilder b = reference_to({{"uri", "square.gltf"}});
  b.json["nodes"][0]["translation"] = {0, 0, 7};
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].name, "square");
  expect_near(scene.instances[0].world_from_object.p, {0, 0, 7});
  ASSERT_EQ(scene.files.size(), 2u);
  EXPECT_EQ(scene.files[1].path, (folder / "square.gltf").string());
}

TEST(References, AFileReferredToTwiceSharesItsMeshes)
{
  const test::TemporaryFolder folder;
  folder.write("square.glb", test::square_scene().glb());
  GltfBuilder b = reference_to({{"uri", "square.glb"}});
  b.root_node({{"extensions", {{"RELIEF_reference", {{"uri", "./square.glb"}}}}}});
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  EXPECT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.materials.size(), 1u);
}

TEST(References, CanNameOneNode)
{
  const test::TemporaryFolder folder;
  GltfBuilder library = test::square_scene();
  library.root_node({{"name", "other"}, {"mesh", 0}, {"translation", {1, 2, 3}}});
  folder.write("library.gltf", library.gltf());
  const Scene scene =
      scene_load(folder.write("scene.gltf", reference_to({{"uri", "library.gltf"}, {"node", "other"}}).gltf()));
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].name, "other");
  EXPECT_THROW(scene_load(folder.write("bad.gltf", reference_to({{"uri", "library.gltf"}, {"node", "none"}}).gltf())),
               SceneError);
}

TEST(References, CyclesAreNamed)
{
  const test::TemporaryFolder folder;
  folder.write("a.gltf", reference_to({{"uri", "b.gltf"}}).gltf());
  folder.write("b.gltf", reference_to({{"uri", "c.gltf"}}).gltf());
  folder.write("c.gltf", reference_to({{"uri", "a.gltf"}}).gltf());
  try {
    scene_load(folder / "a.gltf");
    FAIL();
  } catch (const SceneError& e) {
    EXPECT_EQ(e.file, (folder / "c.gltf").string());
    EXPECT_EQ(e.json_path, "/nodes/0/extensions/RELIEF_reference/uri");
    EXPECT_NE(std::string(e.what()).find("cycle"), std::string::npos);
  }
}

TEST(References, TheSameFileInTwoBranchesIsNoCycle)
{
  const test::TemporaryFolder folder;
  folder.write("square.gltf", test::square_scene().gltf());
  folder.write("b.gltf", reference_to({{"uri", "square.gltf"}}).gltf());
  GltfBuilder a = reference_to({{"uri", "b.gltf"}});
  a.root_node({{"extensions", {{"RELIEF_reference", {{"uri", "square.gltf"}}}}}});
  EXPECT_EQ(scene_load(folder.write("a.gltf", a.gltf())).instances.size(), 2u);
}

// Forty files, each of which refers to the next one twice, are 2^40 nodes.
TEST(References, ThatMultiplyWithoutEndAreRefused)
{
  const test::TemporaryFolder folder;
  for (int i = 0; i < 40; ++i) {
    GltfBuilder b = reference_to({{"uri", std::to_string(i + 1) + ".gltf"}});
    b.root_node({{"extensions", {{"RELIEF_reference", {{"uri", std::to_string(i + 1) + ".gltf"}}}}}});
    folder.write(std::to_string(i) + ".gltf", b.gltf());
  }
  folder.write("40.gltf", GltfBuilder().gltf());
  EXPECT_THROW(scene_load(folder / "0.gltf"), SceneError);
}

TEST(References, OverridesMoveNodesAndChangeMaterials)
{
  const test::TemporaryFolder folder;
  GltfBuilder library = test::square_scene();
  library.json["nodes"][0]["translation"] = {1, 1, 1};
  library.json["nodes"][0]["scale"] = {2, 2, 2};
  folder.write("square.gltf", library.gltf());
  GltfBuilder b = reference_to(
      {{"uri", "square.gltf"}, {"overrides", {{"square", {{"translation", {9, 0, 0}}, {"material", "red"}}}}}});
  b.json["materials"] = {{{"name", "blue"}}, {{"name", "red"}}};
  b.root_node({{"extensions", {{"RELIEF_reference", {{"uri", "square.gltf"}}}}}});
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_EQ(scene.instances.size(), 2u);
  expect_near(scene.instances[0].world_from_object.p, {9, 0, 0});
  expect_near(scene.instances[0].world_from_object.x, {2, 0, 0});  // what is not overridden stays
  EXPECT_EQ(scene.material_names[static_cast<std::size_t>(scene.instances[0].material_index)], "red");
  expect_near(scene.instances[1].world_from_object.p, {1, 1, 1});
  EXPECT_EQ(scene.material_names[static_cast<std::size_t>(scene.instances[1].material_index)], "default");
  EXPECT_EQ(scene.meshes.size(), 1u);
}

TEST(References, TheOutermostOverrideWinsPropertyByProperty)
{
  const test::TemporaryFolder folder;
  folder.write("square.gltf", test::square_scene().gltf());
  folder.write("middle.gltf",
               reference_to({{"uri", "square.gltf"},
                             {"overrides", {{"square", {{"translation", {1, 0, 0}}, {"scale", {5, 5, 5}}}}}}})
                   .gltf());
  const GltfBuilder outer =
      reference_to({{"uri", "middle.gltf"}, {"overrides", {{"square", {{"translation", {2, 0, 0}}}}}}});
  const Scene scene = scene_load(folder.write("outer.gltf", outer.gltf()));
  expect_near(scene.instances.at(0).world_from_object.p, {2, 0, 0});
  expect_near(scene.instances.at(0).world_from_object.x, {5, 0, 0});
}

TEST(References, OverridesOfNobodyAreWarnedAbout)
{
  const test::TemporaryFolder folder;
  folder.write("square.gltf", test::square_scene().gltf());
  const GltfBuilder b = reference_to({{"uri", "square.gltf"}, {"overrides", {{"sqare", {{"scale", {1, 1, 1}}}}}}});
  EXPECT_TRUE(has_warning(scene_load(folder.write("scene.gltf", b.gltf())), "overrides/sqare"));
}

TEST(References, OverridesReachNodesByIndex)
{
  const test::TemporaryFolder folder;
  GltfBuilder library = test::square_scene();
  library.json["nodes"][0].erase("name");
  library.root_node({{"mesh", 0}});
  folder.write("square.gltf", library.gltf());
  const GltfBuilder b =
      reference_to({{"uri", "square.gltf"},
                    {"overrides", {{"/nodes/1", {{"translation", {9, 0, 0}}}}, {"/nodes/7", json::object()}}}});
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_EQ(scene.instances.size(), 2u);
  expect_near(scene.instances[0].world_from_object.p, {0, 0, 0});
  expect_near(scene.instances[1].world_from_object.p, {9, 0, 0});
  EXPECT_TRUE(has_warning(scene, "~1nodes~17: no referenced node has this name or index"));
  const Scene one = scene_load(folder.write("one.gltf", reference_to({{"uri", "square.gltf"}, {"node", 1}}).gltf()));
  EXPECT_EQ(one.instances.size(), 1u);
}

TEST(References, MaterialsAreReplacedByNameOrAll)
{
  const test::TemporaryFolder folder;
  GltfBuilder library = test::square_scene();
  library.json["materials"] = {{{"name", "wood"}}, {{"name", "paint"}}};
  json& primitives = library.json["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  primitives.push_back(primitives[0]);
  primitives[0]["material"] = 0;
  primitives[1]["material"] = 1;
  folder.write("square.gltf", library.gltf());
  const auto names = [&](const json& reference) {
    GltfBuilder b = reference_to(reference);
    b.json["materials"] = {{{"name", "blue"}}, {{"name", "red"}}, {{"name", "gold"}}};
    const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
    std::string text;
    for (const Instance& i : scene.instances)
      text += scene.material_names[static_cast<std::size_t>(i.material_index)] + ' ';
    for (const std::string& warning : scene.warnings) {
      if (warning.find("no referenced mesh has a material") != std::string::npos) text += "(unused)";
    }
    return text;
  };
  EXPECT_EQ(names({{"uri", "square.gltf"}, {"materials", {{"paint", "red"}}}}), "wood red default ");
  EXPECT_EQ(names({{"uri", "square.gltf"}, {"materials", {{"paint", "red"}, {"*", "blue"}}}}), "blue red blue ");
  EXPECT_EQ(names({{"uri", "square.gltf"}, {"materials", {{"pint", "red"}}}}), "wood paint default (unused)");
  // What is said of the node is said of less, and so counts more.
  EXPECT_EQ(names({{"uri", "square.gltf"},
                   {"materials", {{"*", "blue"}}},
                   {"overrides", {{"square", {{"material", "gold"}}}}}}),
            "gold gold gold ");
  // The outermost file has the last word.
  GltfBuilder middle = reference_to({{"uri", "square.gltf"}, {"overrides", {{"square", {{"material", "own"}}}}}});
  middle.json["materials"] = {{{"name", "own"}}};
  folder.write("middle.gltf", middle.gltf());
  EXPECT_EQ(names({{"uri", "middle.gltf"}, {"materials", {{"wood", "red"}}}}), "red own own ");
}

TEST(References, AnOverrideWithAnUnknownMaterialIsAnError)
{
  const test::TemporaryFolder folder;
  folder.write("square.gltf", test::square_scene().gltf());
  const GltfBuilder b = reference_to({{"uri", "square.gltf"}, {"overrides", {{"square", {{"material", "gold"}}}}}});
  EXPECT_THROW(scene_load(folder.write("scene.gltf", b.gltf())), SceneError);
}

TEST(References, PercentEncodedNamesAreDecoded)
{
  const test::TemporaryFolder folder;
  folder.write("a square.gltf", test::square_scene().gltf());
  EXPECT_EQ(scene_load(folder.write("s.gltf", reference_to({{"uri", "a%20square.gltf"}}).gltf())).instances.size(), 1u);
  EXPECT_EQ(scene_load(folder.write("s.gltf", reference_to({{"uri", "a square.gltf"}}).gltf())).instances.size(), 1u);
}

}  // namespace
}  // namespace relief
