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
  EXPECT_EQ(m.attenuation_color.y, 1.0f);
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
