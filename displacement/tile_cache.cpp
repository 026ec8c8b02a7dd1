#include "displacement/tile_cache.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "displacement/height_tile.h"
#include "displacement/point_tile.h"

namespace relief {

TileSlots::TileSlots(std::size_t num_slots)
    : num_sets_(std::max<std::size_t>(num_slots / kWays, 1)), sets_(num_sets_ * sizeof(Set))
{
}

TileSlots::Place TileSlots::find(std::uint64_t key)
{
  const std::uint64_t wanted = key + 1;
  // splitmix64's finalizer: neighbours go to different sets.
  std::uint64_t hash = wanted;
  hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;
  hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
  hash ^= hash >> 31;
  const std::size_t index = hash % num_sets_;
  Set& set = sets()[index];
  const auto slot_of = [&](std::uint32_t way) { return static_cast<std::uint32_t>(index * kWays + way); };
  const auto now = static_cast<std::uint32_t>(num_made_.load(std::memory_order_relaxed));
  for (std::uint32_t way = 0; way < kWays; ++way) {
    if (set.key[way].load(std::memory_order_acquire) != wanted) continue;
    std::int32_t pins = set.pins[way].load(std::memory_order_relaxed);
    bool is_pinned = false;
    while (!is_pinned && set.key[way].load(std::memory_order_acquire) == wanted) {
      if (pins == kInMaking) {  // soon done
        std::this_thread::yield();
        pins = set.pins[way].load(std::memory_order_relaxed);
      } else {
        is_pinned = set.pins[way].compare_exchange_weak(pins, pins + 1, std::memory_order_acquire);
      }
    }
    if (!is_pinned) continue;
    // A slot that is in use is not given away, so what it holds now it keeps.
    if (set.key[way].load(std::memory_order_acquire) == wanted) {
      if (set.used[way].load(std::memory_order_relaxed) != now) set.used[way].store(now, std::memory_order_relaxed);
      return {slot_of(way), false};
    }
    set.pins[way].fetch_sub(1, std::memory_order_release);
  }
  num_made_.fetch_add(1, std::memory_order_relaxed);
  for (std::uint32_t tries = 0; tries < kWays; ++tries) {
    std::uint32_t oldest = kWays, most = 0;
    for (std::uint32_t way = 0; way < kWays; ++way) {
      if (set.pins[way].load(std::memory_order_relaxed) != 0) continue;
      const bool is_empty = set.key[way].load(std::memory_order_relaxed) == 0;
      const std::uint32_t age = is_empty ? ~0u : now - set.used[way].load(std::memory_order_relaxed);
      if (oldest != kWays && age <= most) continue;
      oldest = way;
      most = age;
    }
    if (oldest == kWays) break;
    std::int32_t none = 0;
    if (!set.pins[oldest].compare_exchange_strong(none, kInMaking, std::memory_order_acquire)) continue;
    if (set.key[oldest].load(std::memory_order_relaxed) == 0) {
      set.tile[oldest] = num_taken_.fetch_add(1, std::memory_order_relaxed);
    } else {
      num_evicted_.fetch_add(1, std::memory_order_relaxed);
    }
    set.key[oldest].store(wanted, std::memory_order_release);
    set.used[oldest].store(now, std::memory_order_relaxed);
    return {slot_of(oldest), true};
  }
  return {kNone, true};
}

template <class Tile>
MadeTileCache<Tile>::Pin::Pin() noexcept = default;
template <class Tile>
MadeTileCache<Tile>::Pin::Pin(Pin&& other) noexcept
    : slots_(std::exchange(other.slots_, nullptr)), slot_(other.slot_), tile_(other.tile_), own_(std::move(other.own_))
{
}
template <class Tile>
typename MadeTileCache<Tile>::Pin& MadeTileCache<Tile>::Pin::operator=(Pin&& other) noexcept
{
  std::swap(slots_, other.slots_);
  std::swap(slot_, other.slot_);
  std::swap(tile_, other.tile_);
  std::swap(own_, other.own_);
  return *this;
}
template <class Tile>
MadeTileCache<Tile>::Pin::~Pin()
{
  if (slots_ != nullptr) slots_->release(slot_);
}

template <class Tile>
MadeTileCache<Tile>::MadeTileCache(std::size_t bytes)
    : slots_(std::max<std::size_t>(bytes / sizeof(Tile), 1)), tiles_(slots_.num_slots() * sizeof(Tile))
{
}

template class MadeTileCache<HeightTile>;
template class MadeTileCache<PointTile>;

}  // namespace relief
