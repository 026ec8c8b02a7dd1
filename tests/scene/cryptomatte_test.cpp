// Cryptomatte's hashes against published values, and its manifests.
#include "scene/cryptomatte.h"

#include <bit>
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace relief {
namespace {

TEST(Cryptomatte, HashesAreMurmurs)
{
  // Of every length modulo four.
  EXPECT_EQ(cryptomatte_hash(""), 0u);
  EXPECT_EQ(cryptomatte_hash("test"), 0xba6bd213u);
  EXPECT_EQ(cryptomatte_hash("hello"), 0x248bfa47u);
  EXPECT_EQ(cryptomatte_hash("Hello, world!"), 0xc0363e43u);
  EXPECT_EQ(cryptomatte_hash("The quick brown fox jumps over the lazy dog"), 0x2e4ff723u);
}

TEST(Cryptomatte, IdsAreThoseOfTheSpecification)
{
  // The values of its reference implementation's own tests.
  EXPECT_FLOAT_EQ(cryptomatte_id(cryptomatte_hash("hello")), 6.0705627102400005616e-17f);
  EXPECT_FLOAT_EQ(cryptomatte_id(cryptomatte_hash("cube")), -4.08461912519e+15f);
  EXPECT_FLOAT_EQ(cryptomatte_id(cryptomatte_hash("sphere")), 2.79018604383e+15f);
  EXPECT_FLOAT_EQ(cryptomatte_id(cryptomatte_hash("plane")), 3.66557617593e-11f);
}

TEST(Cryptomatte, IdsAreNormalNumbers)
{
  for (const std::uint32_t hash : {0u, 1u, 0x80000000u, 0x7fffffu, 0x7f800000u, 0xff800000u, 0xffffffffu}) {
    const float id = cryptomatte_id(hash);
    EXPECT_TRUE(std::isnormal(id)) << hash;
    EXPECT_EQ(std::bit_cast<std::uint32_t>(id) ^ hash, 1u << 23);
  }
  EXPECT_EQ(std::bit_cast<std::uint32_t>(cryptomatte_id(0x3f800001u)), 0x3f800001u);
}

TEST(Cryptomatte, ManifestsNameEachThingOnce)
{
  Scene scene;
  scene.meshes.emplace_back();
  scene.meshes[0].name = "mesh";
  for (const char* name : {"tree", "tree", "", "a \"quoted\"\n\xff name"}) {
    scene.instances.emplace_back();
    scene.instances.back().name = name;
    scene.instances.back().asset = "wood";
  }
  const nlohmann::json objects = nlohmann::json::parse(cryptomatte_manifest(scene, 0));
  EXPECT_EQ(objects.size(), 3u);
  EXPECT_TRUE(objects.contains("tree") && objects.contains("mesh"));
  EXPECT_EQ(nlohmann::json::parse(cryptomatte_manifest(scene, 1)).size(), 0u);
  EXPECT_EQ(cryptomatte_manifest(scene, 2).substr(0, 9), "{\"wood\":\"");
  const CryptomatteIds ids = cryptomatte_ids(scene, aov_bit(Aov::kCryptoObject));
  ASSERT_EQ(ids[0].size(), 4u);
  EXPECT_EQ(ids[0][0], ids[0][1]);
  EXPECT_EQ(ids[0][2], cryptomatte_id(cryptomatte_hash("mesh")));
  EXPECT_TRUE(ids[1].empty() && ids[2].empty());
}

}  // namespace
}  // namespace relief
