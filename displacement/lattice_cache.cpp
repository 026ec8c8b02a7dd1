#include "displacement/lattice_cache.h"

#include <algorithm>

namespace relief {

NodeRangeCache::NodeRangeCache(std::size_t bytes)
    : num_lines_(std::max<std::size_t>(bytes / sizeof(Line), 1)), lines_(num_lines_ * sizeof(Line))
{
}

NodeRangeCache::Line& NodeRangeCache::line_of(std::uint64_t key) const
{
  std::uint64_t hash = (key + 1) * 0x9e3779b97f4a7c15u;
  hash = (hash ^ (hash >> 29)) * 0xbf58476d1ce4e5b9u;
  return static_cast<Line*>(lines_.data())[(hash >> 32) % num_lines_];
}

bool NodeRangeCache::find(std::uint64_t key, LatticeRange* children) const
{
  const Line& line = line_of(key);
  const std::uint32_t before = line.version.load(std::memory_order_acquire);
  if ((before & 1) != 0 || line.key.load(std::memory_order_relaxed) != key + 1) return false;
  for (int k = 0; k < 4; ++k) {
    children[k] = {line.low[k].load(std::memory_order_relaxed), line.high[k].load(std::memory_order_relaxed)};
  }
  std::atomic_thread_fence(std::memory_order_acquire);
  return line.version.load(std::memory_order_relaxed) == before;
}

void NodeRangeCache::keep(std::uint64_t key, const LatticeRange* children)
{
  Line& line = line_of(key);
  std::uint32_t version = line.version.load(std::memory_order_relaxed);
  // Whoever comes second keeps what it found to itself.
  if ((version & 1) != 0 || !line.version.compare_exchange_strong(version, version + 1, std::memory_order_acquire))
    return;
  std::atomic_thread_fence(std::memory_order_release);
  if (line.key.load(std::memory_order_relaxed) == 0) num_taken_.fetch_add(1, std::memory_order_relaxed);
  line.key.store(key + 1, std::memory_order_relaxed);
  for (int k = 0; k < 4; ++k) {
    line.low[k].store(children[k].low, std::memory_order_relaxed);
    line.high[k].store(children[k].high, std::memory_order_relaxed);
  }
  line.version.store(version + 2, std::memory_order_release);
}

void NodeRangeCache::improve(std::uint64_t key, int child, LatticeRange range)
{
  Line& line = line_of(key);
  std::uint32_t version = line.version.load(std::memory_order_acquire);
  if ((version & 1) != 0 || line.key.load(std::memory_order_relaxed) != key + 1 ||
      !line.version.compare_exchange_strong(version, version + 1, std::memory_order_acquire)) {
    return;
  }
  std::atomic_thread_fence(std::memory_order_release);
  line.low[child].store(range.low, std::memory_order_relaxed);
  line.high[child].store(range.high, std::memory_order_relaxed);
  line.version.store(version + 2, std::memory_order_release);
}

}  // namespace relief
