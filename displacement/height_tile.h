// Small height maps made on demand: 32 × 32 cells of a triangle's lattice, with a texel more on all sides and the pyramid
// that the traversals descend. A cache of bounded size keeps those that rays meet.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "displacement/height_field.h"
#include "displacement/zero_pages.h"

namespace relief {

inline constexpr int kTileCells = 32;
/// Texel (c, r) of a tile is the lattice point (c − 1, r − 1) from its first cell's corner.
inline constexpr int kTileTexels = kTileCells + 3;
inline constexpr int kTileLines = 10;  ///< of the pyramid over kTileTexels + 1 cells a side

struct HeightTile {
  HeightFieldView field;  ///< once the texels are there
  float texels[kTileTexels * kTileTexels];
  PyramidLine lines[kTileLines];
};

/// Makes a tile's field from its texels.
void height_tile_finish(HeightTile* tile);

/// Keeps tiles until their room is needed. Tiles in use stay.
class HeightTileCache {
  struct Slot;

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
    const HeightFieldView& field() const;

   private:
    friend class HeightTileCache;
    Slot* slot_ = nullptr;
    std::unique_ptr<HeightTile> own_;  ///< where all slots that it could be in are in use
  };

  /// @param bytes  at most; memory is taken as tiles are made
  explicit HeightTileCache(std::size_t bytes);

  /// @param key   of the tile, below 2⁶⁴ − 1
  /// @param make  void(HeightTile*): fills in the texels
  template <class Make>
  Pin get(std::uint64_t key, Make&& make)
  {
    const Place place = find(key);
    Pin pin;
    if (place.slot == nullptr) {
      pin.own_ = std::make_unique<HeightTile>();
      make(pin.own_.get());
      return pin;
    }
    pin.slot_ = place.slot;
    if (place.is_new) {
      make(&place.slot->tile);
      // Of this thread alone until now; whoever waits for it may go on.
      place.slot->pins.store(1, std::memory_order_release);
    }
    return pin;
  }

  std::size_t bytes() const;  ///< taken so far
  std::uint64_t num_made() const { return num_made_.load(std::memory_order_relaxed); }

 private:
  static constexpr int kWays = 8;
  static constexpr std::int32_t kInMaking = -1;

  struct Slot {
    std::atomic<std::uint64_t> key;   ///< plus one; 0: empty
    std::atomic<std::int32_t> pins;   ///< kInMaking, or how many use it
    std::atomic<std::uint32_t> used;  ///< when it was last, by num_made_
    HeightTile tile;
  };
  struct Place {
    Slot* slot;   ///< pinned; null: there is none
    bool is_new;  ///< it has to be filled and its pins to be set
  };
  Place find(std::uint64_t key);

  Slot* slots() const { return static_cast<Slot*>(slots_.data()); }

  std::size_t num_sets_;
  ZeroPages slots_;  ///< all bits zero are empty slots
  std::atomic<std::uint64_t> num_made_{0}, num_taken_{0};
};

}  // namespace relief
