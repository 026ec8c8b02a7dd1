// The levels of height maps with what rays need of them, kept from one displacement set to the next: a map that stays has
// its bounds and tables made once, whatever becomes of the meshes, scales and methods.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <tuple>

#include "displacement/embree_geometry.h"
#include "displacement/height_field.h"
#include "displacement/height_level.h"
#include "displacement/method.h"

namespace relief {

class HeightFields {
 public:
  /// A level of a height map with its bounds.
  struct Field {
    HeightLevel level;  ///< empty at level 0, which is the map itself
    HeightField bounds;
  };

  /// A map and who owns its texels: they stay as long as something is kept of them.
  struct Map {
    HeightMapView view;
    std::shared_ptr<const void> owner;  ///< null: they outlive this object
  };

  const Field& field(const Map& map, int level);
  /// What a level loses of the one before.
  /// @param level  > 0
  const LevelLoss& loss(const Map& map, int level);
  /// Whether a level is there.
  bool has(const Map& map, int level) const { return entries_.contains(key_of(map, level)); }
  void drop(const Map& map, int level) { entries_.erase(key_of(map, level)); }
  /// A level with the table that a method needs, made once for its options.
  DisplacementLevel level(const Map& map,
                          int level,
                          const DisplacementMethodEntry& method,
                          const RmipOptions& rmip_options);

  std::uint64_t bytes() const;  ///< of all that is there, besides the maps

  struct Tally {
    std::uint64_t count = 0, bytes = 0;
    double seconds = 0;  ///< that making it took
  };
  /// Ends the questions of a set: what it did not ask for goes. There is no other set then that still needs it.
  /// @return  of what was asked for and there
  Tally end_set();

 private:
  using Key = std::tuple<const void*, int, int, HeightFormat, Wrap, Wrap, int>;
  using TableKey = std::tuple<decltype(DisplacementMethodEntry::table_make), int>;
  struct Entry {
    std::shared_ptr<const void> owner;
    Field field;
    std::map<TableKey, MethodTable> tables;
    std::map<int, LevelLoss> losses;  ///< of level 0: by level
    double seconds = 0;
    bool is_kept = false, is_wanted = false;

    std::uint64_t bytes() const;
  };
  static Key key_of(const Map& map, int level);
  Entry& entry(const Map& map, int level);

  std::map<Key, Entry> entries_;
};

}  // namespace relief
