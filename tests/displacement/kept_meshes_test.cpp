// What is found again of a displacement set before: the same content, once, and no later than the next set.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "displacement/prepared_mesh.h"

namespace relief::test {
namespace {

ContentHash hash_of_text(const std::string& text)
{
  ContentHasher hash;
  hash.add_array(text.data(), text.size());
  return hash.result();
}

TEST(ContentHash, EachBitAndTheLengthCount)
{
  for (const std::size_t length : {1u, 7u, 8u, 9u, 64u, 1000u}) {
    std::string text(length, '\0');
    std::set<ContentHash> known = {hash_of_text(text)};
    for (std::size_t bit = 0; bit < 8 * length; ++bit) {
      text[bit / 8] = static_cast<char>(1 << (bit % 8));
      EXPECT_TRUE(known.insert(hash_of_text(text)).second) << length << " " << bit;
      text[bit / 8] = 0;
    }
    EXPECT_TRUE(known.insert(hash_of_text(text + '\0')).second);
  }
}

TEST(ContentHash, TheBordersOfArraysCount)
{
  const float values[3] = {1, 2, 3};
  std::set<ContentHash> known;
  for (int first = 0; first <= 3; ++first) {
    ContentHasher hash;
    hash.add_array(values, static_cast<std::size_t>(first));
    hash.add_array(values + first, static_cast<std::size_t>(3 - first));
    EXPECT_TRUE(known.insert(hash.result()).second);
  }
  ContentHasher absent;
  absent.add_array<float>(nullptr, 0);
  absent.add_array(values, 3);
  EXPECT_TRUE(known.insert(absent.result()).second);
}

TEST(ContentHash, OrderAndSignsOfZeroCount)
{
  const auto of = [](double a, double b) {
    ContentHasher hash;
    hash.add(a, b);
    return hash.result();
  };
  EXPECT_NE(of(1, 2), of(2, 1));
  EXPECT_NE(of(0, 1), of(-0.0, 1));
  EXPECT_EQ(of(std::numeric_limits<double>::quiet_NaN(), 1), of(std::numeric_limits<double>::quiet_NaN(), 1));
}

std::unique_ptr<PreparedMesh> mesh_of(const std::string& text)
{
  auto mesh = std::make_unique<PreparedMesh>();
  mesh->name = text;
  mesh->content = hash_of_text(text);
  mesh->seconds = 2;
  return mesh;
}

TEST(KeptMeshes, EachIsTakenOnceAndByItsContent)
{
  KeptMeshes kept;
  kept.put(mesh_of("a"));
  kept.put(mesh_of("a"));
  kept.put(mesh_of("b"));
  EXPECT_EQ(kept.take(hash_of_text("c")), nullptr);
  EXPECT_EQ(kept.take(hash_of_text("b"))->name, "b");
  EXPECT_EQ(kept.take(hash_of_text("b")), nullptr);
  EXPECT_NE(kept.take(hash_of_text("a")), nullptr);
  EXPECT_NE(kept.take(hash_of_text("a")), nullptr);
  EXPECT_EQ(kept.take(hash_of_text("a")), nullptr);
  const KeptMeshes::Tally tally = kept.end_set();
  EXPECT_EQ(tally.count, 3u);
  EXPECT_EQ(tally.seconds, 6);
  EXPECT_EQ(kept.end_set().count, 0u);
}

TEST(KeptMeshes, WhatASetDoesNotTakeGoes)
{
  KeptMeshes kept;
  kept.put(mesh_of("a"));
  kept.end_set();
  EXPECT_EQ(kept.take(hash_of_text("a")), nullptr);
}

}  // namespace
}  // namespace relief::test
