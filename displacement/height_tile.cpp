#include "displacement/height_tile.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace relief {

void height_tile_finish(HeightTile* tile)
{
  HeightMapView map;
  map.texels = tile->texels;
  map.width = map.height = kTileTexels;
  map.format = HeightFormat::kFloat;
  map.wrap_u = map.wrap_v = Wrap::kClamp;
  tile->field = small_height_field_make(map, tile->lines, kTileLines);
}

HeightTileCache::Pin::Pin() noexcept = default;
HeightTileCache::Pin::Pin(Pin&& other) noexcept
    : slot_(std::exchange(other.slot_, nullptr)), own_(std::move(other.own_))
{
}
HeightTileCache::Pin& HeightTileCache::Pin::operator=(Pin&& other) noexcept
{
  std::swap(slot_, other.slot_);
  std::swap(own_, other.own_);
  return *this;
}
HeightTileCache::Pin::~Pin()
{
  if (slot_ != nullptr) slot_->pins.fetch_sub(1, std::memory_order_release);
}
const HeightFieldView& HeightTileCache::Pin::field() const
{
  return slot_ != nullptr ? slot_->tile.field : own_->field;
}

HeightTileCache::HeightTileCache(std::size_t bytes)
    : num_sets_(std::max<std::size_t>(bytes / (kWays * sizeof(Slot)), 1)), slots_(num_sets_ * kWays * sizeof(Slot))
{
}

std::size_t HeightTileCache::bytes() const { return num_taken_.load(std::memory_order_relaxed) * sizeof(Slot); }

HeightTileCache::Place HeightTileCache::find(std::uint64_t key)
{
  const std::uint64_t wanted = key + 1;
  // splitmix64's finalizer: neighbours go to different sets.
  std::uint64_t hash = wanted;
  hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;
  hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
  hash ^= hash >> 31;
  Slot* const set = slots() + hash % num_sets_ * kWays;
  const auto now = static_cast<std::uint32_t>(num_made_.load(std::memory_order_relaxed));
  for (int way = 0; way < kWays; ++way) {
    Slot& slot = set[way];
    if (slot.key.load(std::memory_order_acquire) != wanted) continue;
    std::int32_t pins = slot.pins.load(std::memory_order_relaxed);
    bool is_pinned = false;
    while (!is_pinned && slot.key.load(std::memory_order_acquire) == wanted) {
      if (pins == kInMaking) {  // soon done
        std::this_thread::yield();
        pins = slot.pins.load(std::memory_order_relaxed);
      } else {
        is_pinned = slot.pins.compare_exchange_weak(pins, pins + 1, std::memory_order_acquire);
      }
    }
    if (!is_pinned) continue;
    // A slot that is in use is not given away, so what it holds now it keeps.
    if (slot.key.load(std::memory_order_acquire) == wanted) {
      if (slot.used.load(std::memory_order_relaxed) != now) slot.used.store(now, std::memory_order_relaxed);
      return {&slot, false};
    }
    slot.pins.fetch_sub(1, std::memory_order_release);
  }
  num_made_.fetch_add(1, std::memory_order_relaxed);
  for (int tries = 0; tries < kWays; ++tries) {
    Slot* oldest = nullptr;
    std::uint32_t most = 0;
    for (int way = 0; way < kWays; ++way) {
      Slot& slot = set[way];
      if (slot.pins.load(std::memory_order_relaxed) != 0) continue;
      const bool is_empty = slot.key.load(std::memory_order_relaxed) == 0;
      const std::uint32_t age = is_empty ? ~0u : now - slot.used.load(std::memory_order_relaxed);
      if (oldest != nullptr && age <= most) continue;
      oldest = &slot;
      most = age;
    }
    if (oldest == nullptr) break;
    std::int32_t none = 0;
    if (!oldest->pins.compare_exchange_strong(none, kInMaking, std::memory_order_acquire)) continue;
    if (oldest->key.load(std::memory_order_relaxed) == 0) num_taken_.fetch_add(1, std::memory_order_relaxed);
    oldest->key.store(wanted, std::memory_order_release);
    oldest->used.store(now, std::memory_order_relaxed);
    return {oldest, true};
  }
  return {nullptr, true};
}

}  // namespace relief
