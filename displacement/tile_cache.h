// A cache of bounded size for what is made on demand, tile by tile, and met by many rays. Keys stand apart from the tiles, which are
// taken in order, so that those in use lie together.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "displacement/zero_pages.h"

namespace relief {

/// Which of a number of slots holds which key, and which are in use.
class TileSlots {
 public:
  explicit TileSlots(std::size_t num_slots);

  struct Place {
    std::uint32_t slot = kNone;  ///< pinned
    bool is_new = false;         ///< it has to be filled, and then `set_made`
  };
  static constexpr std::uint32_t kNone = ~0u;  ///< all that the key could be in are in use

  /// @param key  below 2⁶⁴ − 1
  Place find(std::uint64_t key);
  /// Whoever waits for a new slot may go on.
  void set_made(std::uint32_t slot) { pins(slot).store(1, std::memory_order_release); }
  void release(std::uint32_t slot) { pins(slot).fetch_sub(1, std::memory_order_release); }
  /// Where a slot's tile is: tiles are numbered in the order in which slots are first used.
  std::uint32_t tile(std::uint32_t slot) const { return sets()[slot / kWays].tile[slot % kWays]; }

  std::uint64_t num_made() const { return num_made_.load(std::memory_order_relaxed); }
  std::uint64_t num_evicted() const { return num_evicted_.load(std::memory_order_relaxed); }
  std::size_t num_taken() const { return num_taken_.load(std::memory_order_relaxed); }
  std::size_t num_slots() const { return num_sets_ * kWays; }

 private:
  static constexpr std::uint32_t kWays = 8;
  static constexpr std::int32_t kInMaking = -1;

  /// All bits zero: empty.
  struct alignas(64) Set {
    std::atomic<std::uint64_t> key[kWays];   ///< plus one; 0: empty
    std::atomic<std::int32_t> pins[kWays];   ///< kInMaking, or how many use it
    std::atomic<std::uint32_t> used[kWays];  ///< when it was last, by num_made_
    std::uint32_t tile[kWays];
  };
  Set* sets() const { return static_cast<Set*>(sets_.data()); }
  std::atomic<std::int32_t>& pins(std::uint32_t slot) const { return sets()[slot / kWays].pins[slot % kWays]; }

  std::size_t num_sets_;
  ZeroPages sets_;
  std::atomic<std::uint64_t> num_made_{0}, num_evicted_{0};
  std::atomic<std::uint32_t> num_taken_{0};
};

/// Keeps tiles until their room is needed. Tiles in use stay.
template <class Tile>
class MadeTileCache {
 public:
  /// A tile in use.
  class Pin {
   public:
    // Defined once, as callers are compiled for several instruction sets.
    Pin() noexcept;
    Pin(Pin&& other) noexcept;
    Pin& operator=(Pin&& other) noexcept;
    Pin(const Pin&) = delete;
    Pin& operator=(const Pin&) = delete;
    ~Pin();
    const Tile& tile() const { return *tile_; }

   private:
    friend class MadeTileCache;
    TileSlots* slots_ = nullptr;
    std::uint32_t slot_ = TileSlots::kNone;
    const Tile* tile_ = nullptr;
    std::unique_ptr<Tile> own_;  ///< where all slots that it could be in are in use
  };

  /// @param bytes  at most; memory is taken as tiles are made
  explicit MadeTileCache(std::size_t bytes);

  /// @param key   of the tile, below 2⁶⁴ − 1
  /// @param make  void(Tile*): fills it in
  template <class Make>
  Pin get(std::uint64_t key, Make&& make)
  {
    const TileSlots::Place place = slots_.find(key);
    Pin pin;
    if (place.slot == TileSlots::kNone) {
      pin.own_ = std::make_unique<Tile>();
      make(pin.own_.get());
      pin.tile_ = pin.own_.get();
      return pin;
    }
    pin.slots_ = &slots_;
    pin.slot_ = place.slot;
    Tile* const tile = static_cast<Tile*>(tiles_.data()) + slots_.tile(place.slot);
    pin.tile_ = tile;
    if (place.is_new) {
      make(tile);
      slots_.set_made(place.slot);
    }
    return pin;
  }

  std::size_t bytes() const { return slots_.num_taken() * sizeof(Tile); }  ///< taken so far
  std::uint64_t num_made() const { return slots_.num_made(); }
  std::uint64_t num_evicted() const { return slots_.num_evicted(); }

 private:
  TileSlots slots_;
  ZeroPages tiles_;
};

}  // namespace relief
