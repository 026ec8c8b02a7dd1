#include "displacement/shared_edges.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "kernel/sample/sobol.h"

namespace relief {

namespace {

/// @param key   a function of an index; equal keys are one
/// @param hash  of a key
/// @return      for every index the first one with the same key
template <typename Key, typename Hash>
std::vector<std::uint32_t> first_equals(std::size_t count, const Key& key, const Hash& hash)
{
  constexpr std::uint32_t kNone = ~0u;
  const std::size_t num_slots = std::bit_ceil(2 * count + 1);
  std::vector<std::uint32_t> slots(num_slots, kNone), first(count);
  for (std::uint32_t index = 0; index < count; ++index) {
    const auto wanted = key(index);
    std::size_t slot = hash(wanted) & (num_slots - 1);
    while (slots[slot] != kNone && key(slots[slot]) != wanted) slot = (slot + 1) & (num_slots - 1);
    if (slots[slot] == kNone) slots[slot] = index;
    first[index] = slots[slot];
  }
  return first;
}

/// By its bits; −0 and 0 are one place.
std::uint32_t place_bits(float x) { return std::bit_cast<std::uint32_t>(x + 0.0f); }

/// Of a displacement line.
std::array<std::uint32_t, 6> line_bits(Vec3f P, Vec3f N)
{
  return {place_bits(P.x), place_bits(P.y), place_bits(P.z), place_bits(N.x), place_bits(N.y), place_bits(N.z)};
}

template <std::size_t N>
std::uint64_t place_hash(const std::array<std::uint32_t, N>& place)
{
  std::uint64_t hash = 0;
  for (const std::uint32_t part : place) hash = hash_mix(hash ^ part);
  return hash;
}

}  // namespace

std::vector<std::uint32_t> weld_corners(std::span<const DisplacedTriangle> triangles)
{
  const auto key = [&](std::uint32_t corner) {
    const DisplacedTriangle& tri = triangles[corner / 3];
    return line_bits(tri.P[corner % 3], tri.N[corner % 3]);
  };
  return first_equals(3 * triangles.size(), key, place_hash<6>);
}

std::vector<std::uint32_t> weld_vertices(std::span<const Vec3f> P, std::span<const Normal3f> N)
{
  const auto key = [&](std::uint32_t vertex) { return line_bits(P[vertex], as_vector(N[vertex])); };
  return first_equals(P.size(), key, place_hash<6>);
}

std::vector<std::uint32_t> weld_positions(std::span<const DisplacedTriangle> triangles)
{
  const auto place_of = [&](std::uint32_t corner) -> std::array<std::uint32_t, 3> {
    const Vec3f P = triangles[corner / 3].P[corner % 3];
    return {place_bits(P.x), place_bits(P.y), place_bits(P.z)};
  };
  return first_equals(3 * triangles.size(), place_of, place_hash<3>);
}

std::vector<std::uint32_t> weld_edges(std::span<const std::uint32_t> corners)
{
  const auto ends_of = [&](std::uint32_t edge) {
    const std::uint32_t a = corners[edge], b = corners[edge_end(edge)];
    return std::pair(std::min(a, b), std::max(a, b));
  };
  return first_equals(corners.size(), ends_of, [](const std::pair<std::uint32_t, std::uint32_t>& ends) {
    return hash_mix(std::uint64_t{ends.first} << 32 | ends.second);
  });
}

}  // namespace relief
