// Images that stay in memory from one frame to the next.
#include "scene/kept_images.h"

#include <gtest/gtest.h>

#include "scene/load.h"
#include "scene/texture_store.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/image_bytes.h"

namespace relief {
namespace {

using test::GltfBuilder;

/// The square under a material with a height map and a colour in files, and a grey pixel in the scene itself.
GltfBuilder square_with_images()
{
  GltfBuilder b = test::square_scene();
  b.json["images"] = {{{"uri", "h.tga"}}, {{"uri", "c.tga"}}, {{"uri", test::kGreyPixelPng}}};
  b.json["textures"] = {{{"source", 0}}, {{"source", 1}}, {{"source", 2}}};
  b.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}, {"metallicRoughnessTexture", {{"index", 2}}}}},
       {"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

/// Of what is in files; the studio's light that follows is computed.
std::vector<const void*> texels_of(const Scene& scene)
{
  std::vector<const void*> out;
  for (const HeightMap& map : scene.height_maps) out.push_back(map.texels.get());
  for (int i = 0; i < 2; ++i) out.push_back(scene.textures->views()[static_cast<std::size_t>(i)].levels[0]);
  return out;
}

TEST(KeptImages, AreReadAgainWhereTheirFilesChange)
{
  const test::TemporaryFolder folder;
  folder.write("h.tga", test::tga_grey(2, 2, "abcd"));
  folder.write("c.tga", test::tga_grey(2, 2, "efgh"));
  const std::filesystem::path scene = folder.write("s.gltf", square_with_images().gltf());
  KeptImages kept;
  LoadOptions options;
  options.kept = &kept;
  const Scene first = scene_load(scene, options);
  EXPECT_EQ(kept.end_frame().count, 0u);
  const Scene second = scene_load(scene, options);
  const KeptTally tally = kept.end_frame();
  EXPECT_EQ(tally.count, 3u);
  EXPECT_EQ(tally.bytes, kept.bytes());
  EXPECT_EQ(texels_of(second), texels_of(first));

  // Without them, as before.
  EXPECT_NE(texels_of(scene_load(scene)), texels_of(first));

  folder.write("h.tga", test::tga_grey(1, 2, "xy"));
  const Scene third = scene_load(scene, options);
  EXPECT_EQ(kept.end_frame().count, 2u);
  EXPECT_EQ(third.height_maps[0].width, 1);
  EXPECT_EQ(static_cast<const unsigned char*>(third.height_maps[0].texels.get())[0], 'x');
  EXPECT_EQ(third.textures->views()[0].levels[0], first.textures->views()[0].levels[0]);
}

TEST(KeptImages, ThatNobodyAsksForGo)
{
  const test::TemporaryFolder folder;
  folder.write("h.tga", test::tga_grey(2, 2, "abcd"));
  folder.write("c.tga", test::tga_grey(2, 2, "efgh"));
  const std::filesystem::path scene = folder.write("s.gltf", square_with_images().gltf());
  const std::filesystem::path bare = folder.write("bare.gltf", test::square_scene().gltf());
  KeptImages kept;
  LoadOptions options;
  options.kept = &kept;
  static_cast<void>(scene_load(scene, options));
  static_cast<void>(kept.end_frame());
  EXPECT_GT(kept.bytes(), 0u);
  static_cast<void>(scene_load(bare, options));
  static_cast<void>(kept.end_frame());
  EXPECT_EQ(kept.bytes(), 0u);
}

TEST(KeptImages, SayTheSameOfAnImageEachTime)
{
  const test::TemporaryFolder folder;
  // A colour image as height map.
  std::string rgb("\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\x18\x20", 18);
  folder.write("h.tga", rgb + "abc");
  folder.write("c.tga", test::tga_grey(1, 1, "e"));
  const std::filesystem::path scene = folder.write("s.gltf", square_with_images().gltf());
  KeptImages kept;
  LoadOptions options;
  options.kept = &kept;
  const std::vector<std::string> first = scene_load(scene, options).warnings;
  static_cast<void>(kept.end_frame());
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(scene_load(scene, options).warnings, first);
}

}  // namespace
}  // namespace relief
