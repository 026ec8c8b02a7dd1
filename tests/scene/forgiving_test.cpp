// What is wrong with a file but has an obvious meaning is given it, with a warning that names the place.
#include <gtest/gtest.h>

#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::has_warning;

GltfBuilder square_with(const json& material)
{
  GltfBuilder b = test::square_scene();
  b.push("materials", material);
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

TEST(Forgiving, FactorsALittleOutOfRangeCountAsItsEnd)
{
  const Scene scene = load(square_with(
      {{"pbrMetallicRoughness",
        {{"baseColorFactor", {1.1, 0.5, -0.1, 1.0001}}, {"metallicFactor", 1.1}, {"roughnessFactor", -0.01}}},
       {"emissiveFactor", {-1, 0, 2}},
       {"alphaMode", "GLASS"},
       {"extensions",
        {{"KHR_materials_transmission", {{"transmissionFactor", 1.1}}},
         {"KHR_materials_clearcoat", {{"clearcoatFactor", -0.1}, {"clearcoatRoughnessFactor", 1.5}}},
         {"KHR_materials_sheen", {{"sheenRoughnessFactor", 2}}},
         {"KHR_materials_specular", {{"specularFactor", 1.01}}},
         {"KHR_materials_volume", {{"attenuationColor", {0.5, 1.2, 1}}}}}}}));
  const Material& m = scene.materials[0];
  EXPECT_EQ(m.base_color.x, 1.0f);
  EXPECT_EQ(m.base_color.y, 0.5f);
  EXPECT_EQ(m.base_color.z, 0.0f);
  EXPECT_EQ(m.base_alpha, 1.0f);
  EXPECT_EQ(m.metallic, 1.0f);
  EXPECT_EQ(m.roughness, 0.0f);
  EXPECT_EQ(m.emission.x, 0.0f);
  EXPECT_EQ(m.emission.z, 2.0f);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kOpaque);
  EXPECT_EQ(m.transmission, 1.0f);
  EXPECT_EQ(m.clearcoat, 0.0f);
  EXPECT_EQ(m.clearcoat_roughness, 1.0f);
  EXPECT_EQ(m.sheen_roughness, 1.0f);
  EXPECT_EQ(m.specular, 1.0f);
  for (const char* place :
       {"/baseColorFactor/0: expected a number within 0…1, found 1.1; 1 is used", "/baseColorFactor/2",
        "/baseColorFactor/3", "/metallicFactor", "/roughnessFactor", "/emissiveFactor/0", "/alphaMode",
        "/transmissionFactor", "/clearcoatFactor", "/clearcoatRoughnessFactor", "/sheenRoughnessFactor",
        "/specularFactor", "/attenuationColor"}) {
    EXPECT_TRUE(has_warning(scene, place)) << place;
  }
}

TEST(Forgiving, AnInterpolationThatIsNoneIsLinear)
{
  for (const json& interpolation : {json(9729), json("EASE")}) {
    GltfBuilder b = test::square_scene();
    const int times = b.accessor<float>({0, 1}, "SCALAR"), values = b.accessor<float>({0, 0, 0, 4, 0, 0}, "VEC3");
    b.push("animations", {{"samplers", {{{"input", times}, {"output", values}, {"interpolation", interpolation}}}},
                          {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
    const test::TemporaryFolder folder;
    LoadOptions options;
    options.has_frame = true;
    options.frame = 6;
    const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()), options);
    EXPECT_NEAR(scene.instances[0].world_from_object.p.x, 1, 1e-6);
    EXPECT_TRUE(has_warning(scene, "/animations/0/samplers/0/interpolation: expected one of LINEAR|STEP|CUBICSPLINE"));
  }
}

TEST(Forgiving, NodesOfASceneThatAreNoRootsCountOnce)
{
  GltfBuilder b = test::square_scene();
  b.push("nodes", {{"mesh", 0}, {"translation", {5, 0, 0}}});
  b.json["nodes"][0]["children"] = {1};
  b.json["nodes"][0]["translation"] = {1, 0, 0};
  // The child stands below its parent already.
  b.json["scenes"][0]["nodes"] = {1, 0, 0};
  Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.instances[1].world_from_object.p.x, 6.0f);
  EXPECT_TRUE(has_warning(scene, "/scenes/0/nodes/0: node 1 is no root"));
  EXPECT_TRUE(has_warning(scene, "/scenes/0/nodes/2: node 0 is listed twice"));
  // Without its parent it is a root.
  b.json["scenes"][0]["nodes"] = {1};
  scene = load(b);
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].world_from_object.p.x, 5.0f);
  EXPECT_TRUE(has_warning(scene, "which is not in the scene"));
}

TEST(Forgiving, ANodeWithTwoParentsStaysWithTheFirst)
{
  GltfBuilder b = test::square_scene();
  b.push("nodes", {{"children", {0}}, {"translation", {3, 0, 0}}});
  b.push("nodes", {{"children", {0}}, {"translation", {7, 0, 0}}});
  b.json["scenes"][0]["nodes"] = {1, 2};
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].world_from_object.p.x, 3.0f);
  EXPECT_TRUE(has_warning(scene, "/nodes/2/children/0: expected a node without another parent, found node 0, a child of node 1"));
}

TEST(Forgiving, WhatIsSingularOrBeyondTheNumbersIsLeftOut)
{
  for (const auto& [transform, what] :
       {std::pair{json{{"scale", {1, 0, 1}}}, "singular transform, left out"},
        {json{{"matrix", {1, 1, 0, 0, 2, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}, "singular transform, left out"},
        {json{{"scale", {1e-18, 1e-18, 1e-18}}}, "scaled to less than 1e-15, left out"}}) {
    GltfBuilder b = test::square_scene();
    for (const char* kind : {"mesh", "camera"}) {
      json node = transform;
      node[kind] = 0;
      b.root_node(node);
    }
    b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}});
    json light = transform;
    light["extensions"]["KHR_lights_punctual"] = {{"light", 0}};
    b.root_node(light);
    b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "point"}}}}};
    const Scene scene = load(b);
    EXPECT_EQ(scene.instances.size(), 1u) << transform;
    EXPECT_TRUE(has_warning(scene, std::string("/nodes/1: ") + what)) << transform;
  }
}

TEST(Forgiving, WhatIsNullIsNotThere)
{
  GltfBuilder b = square_with({{"pbrMetallicRoughness", {{"metallicFactor", nullptr}, {"roughnessFactor", 0.25}}},
                               {"normalTexture", nullptr},
                               {"extras", {{"note", nullptr}}}});
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "directional"}, {"spot", nullptr}}}}};
  b.root_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const Scene scene = load(b);
  EXPECT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(scene.materials[0].metallic, 1.0f);
  EXPECT_EQ(scene.materials[0].roughness, 0.25f);
  EXPECT_TRUE(has_warning(scene, "/extensions/KHR_lights_punctual/lights/0/spot: expected a value, found null, which counts "
                                 "as nothing (3 in all)"));
}

TEST(Forgiving, AMeshOfABufferViewWithoutAByteIsLeftOut)
{
  for (const char* user : {"POSITION", "indices"}) {
    GltfBuilder b = test::square_scene();
    json mesh = b.json["meshes"][0];
    const int view = static_cast<int>(b.json["bufferViews"].size());
    b.push("bufferViews", {{"buffer", 0}, {"byteLength", 0}});
    json accessor = b.json["accessors"][mesh["primitives"][0]["attributes"]["POSITION"].get<std::size_t>()];
    if (user == std::string("indices")) accessor = {{"componentType", 5125}, {"count", 3}, {"type", "SCALAR"}};
    accessor["bufferView"] = view;
    const std::size_t index = b.json["accessors"].size();
    b.push("accessors", accessor);
    (user == std::string("indices") ? mesh["primitives"][0] : mesh["primitives"][0]["attributes"])[user] = index;
    b.push("meshes", mesh);
    b.root_node({{"mesh", 1}});
    const Scene scene = load(b);
    EXPECT_EQ(scene.instances.size(), 1u) << user;
    EXPECT_TRUE(has_warning(scene, "/accessors/" + std::to_string(index) + " reads from a buffer view without a byte: left out"));
  }
  // One that nobody reads is nobody's trouble, nor is such a buffer.
  GltfBuilder b = test::square_scene();
  b.push("bufferViews", {{"buffer", 0}, {"byteLength", 0}});
  EXPECT_EQ(load(b).instances.size(), 1u);
}

TEST(Forgiving, ExtensionsThatAreNotDeclaredAreReadOrNamed)
{
  GltfBuilder b = square_with({{"extensions", {{"KHR_materials_ior", {{"ior", 2}}}}}});
  b.declares_extensions = false;
  b.json["nodes"][0]["extensions"]["ACME_rocket"] = {{"thrust", 3}};
  b.json["nodes"][0]["extras"]["extensions"]["NOT_one"] = 1;
  const Scene scene = load(b);
  EXPECT_EQ(scene.materials[0].ior, 2.0f);
  EXPECT_TRUE(has_warning(scene, "does not list KHR_materials_ior, which the file has; it is read all the same"));
  EXPECT_TRUE(has_warning(scene, "does not list ACME_rocket, which the file has; it is not read"));
  EXPECT_FALSE(has_warning(scene, "NOT_one"));
}

/// The error of a scene whose buffer's file holds too few bytes.
std::string error_of_buffer(const std::string& bytes)
{
  GltfBuilder b = test::square_scene();
  const test::TemporaryFolder folder;
  folder.write("mesh.bin", bytes);
  b.json["buffers"] = {{{"byteLength", b.binary.size()}, {"uri", "mesh.bin"}}};
  try {
    scene_load(folder.write("scene.gltf", b.gltf()));
  } catch (const SceneError& e) {
    return e.what();
  }
  return "none";
}

TEST(Forgiving, ABufferThatIsAGitLfsPointerIsNamed)
{
  const std::string error =
      error_of_buffer("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n");
  EXPECT_NE(error.find("git lfs pull"), std::string::npos) << error;
}

TEST(Forgiving, ABufferThatBeginsLikeABitmapIsOnlyShort)
{
  const std::string error = error_of_buffer("BM\1\2\3\4");
  EXPECT_NE(error.find("byteLength: expected at most the 6 bytes that there are"), std::string::npos) << error;
}

}  // namespace
}  // namespace relief
