#include "displacement/shared_edges.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <map>
#include <utility>

#include <tbb/parallel_for.h>

#include "kernel/sample/sobol.h"

namespace relief {

namespace {

/// Indices in groups by their hashes, rising in each.
class HashGroups {
 public:
  static constexpr std::size_t kGroups = 64;

  /// @param hash  64 bits of an index
  template <typename Hash>
  HashGroups(std::size_t count, const Hash& hash) : indices_(count), hashes_(count)
  {
    constexpr std::size_t kBlock = 1 << 14;
    const auto group_of = [](std::uint64_t h) { return h >> 58; };
    const std::size_t num_blocks = (count + kBlock - 1) / kBlock;
    std::vector<std::array<std::uint32_t, kGroups>> next(num_blocks);
    const auto for_each = [&](const auto& body) {
      tbb::parallel_for(std::size_t{0}, num_blocks, [&](std::size_t block) {
        const std::size_t end = std::min((block + 1) * kBlock, count);
        for (std::size_t index = block * kBlock; index < end; ++index) body(next[block], index, hash(index));
      });
    };
    for_each([&](auto& sizes, std::size_t, std::uint64_t h) { ++sizes[group_of(h)]; });
    std::uint32_t sum = 0;
    for (std::size_t group = 0; group < kGroups; ++group) {
      starts_[group] = sum;
      for (std::array<std::uint32_t, kGroups>& of_block : next) sum += std::exchange(of_block[group], sum);
    }
    starts_[kGroups] = sum;
    for_each([&](auto& places, std::size_t index, std::uint64_t h) {
      const std::uint32_t place = places[group_of(h)]++;
      indices_[place] = static_cast<std::uint32_t>(index);
      hashes_[place] = h;
    });
  }

  /// @param first_of  receives for every index of a group the first one with its hash
  void find_first(std::size_t group, std::vector<std::uint32_t>* first_of) const
  {
    constexpr std::uint32_t kNone = ~0u;
    const std::size_t mask = std::bit_ceil(2 * std::size_t{starts_[group + 1] - starts_[group]} + 1) - 1;
    std::vector<std::uint32_t> slots(mask + 1, kNone);
    for (std::uint32_t place = starts_[group]; place < starts_[group + 1]; ++place) {
      std::size_t slot = hashes_[place] & mask;
      while (slots[slot] != kNone && hashes_[slots[slot]] != hashes_[place]) slot = (slot + 1) & mask;
      if (slots[slot] == kNone) slots[slot] = place;
      (*first_of)[indices_[place]] = indices_[slots[slot]];
    }
  }

 private:
  std::vector<std::uint32_t> indices_;
  std::vector<std::uint64_t> hashes_;
  std::array<std::uint32_t, kGroups + 1> starts_{};
};

/// @param key   a function of an index; equal keys are one
/// @param hash  of a key
/// @return      for every index the first one with the same key
/// @cost        parallel; 16 bytes an index besides while it works
template <typename Key, typename Hash>
std::vector<std::uint32_t> first_equals(std::size_t count, const Key& key, const Hash& hash)
{
  std::vector<std::uint32_t> first(count);
  const auto key_of = [&](std::size_t index) { return key(static_cast<std::uint32_t>(index)); };
  {
    const HashGroups groups(count, [&](std::size_t index) { return hash(key_of(index)); });
    tbb::parallel_for(std::size_t{0}, HashGroups::kGroups,
                      [&](std::size_t group) { groups.find_first(group, &first); });
  }
  std::atomic<bool> are_equal{true};
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t index) {
    if (first[index] != index && key_of(index) != key_of(first[index]))
      are_equal.store(false, std::memory_order_relaxed);
  });
  if (are_equal) return first;
  // Two keys have one hash, as one mesh of ten million triangles in some tens of thousands has.
  std::map<decltype(key(0)), std::uint32_t> known;
  for (std::uint32_t index = 0; index < count; ++index)
    first[index] = known.try_emplace(key(index), index).first->second;
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
