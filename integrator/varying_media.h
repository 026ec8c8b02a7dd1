// Media that vary from place to place, made ready for rays: where each is, and a grid of what it takes away there: what it was found to
// be at some points, and what the bounds of its value graph (kernel/graph/graph_bounds.h) say that it may be.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "kernel/math/box.h"
#include "kernel/volume/varying_place.h"

namespace relief {

struct SceneContext;

class VaryingMedia {
 public:
  /// @param context  with its meshes, instances, graphs and tree; must outlive this
  /// @cost  256 Ki boxes in all at most, 20 bytes each; a run of a graph a box
  void make(const SceneContext& context);

  /// By Material::medium_index and, last, what fills the world; null: none varies.
  const VaryingMedium* view() const { return media_.empty() ? nullptr : media_.data(); }

  /// Whether one of them may send out light.
  bool shines() const
  {
    return std::any_of(media_.begin(), media_.end(), [](const VaryingMedium& medium) { return medium.shines; });
  }

  /// Media without useful bounds, a line each.
  const std::vector<std::string>& problems() const { return problems_; }

 private:
  struct Problem {
    bool has_bounds = true, is_tamed = false;  ///< the latter is not told of the world, whose fog often grows downwards
    bool shines = false;                       ///< it may send out light somewhere
  };
  /// Whose boxes, and how many: see RateGrid.
  struct RatesOf {
    const SceneContext& context;
    const VaryingMedium& medium;
    std::int32_t instance;
    float diagonal;  ///< metres, of all of it
    std::int32_t size, num_levels;
  };
  Problem add_rates(const SceneContext& context, const VaryingMedium& medium, std::int32_t instance);
  static Problem make_rates(const RatesOf& of, Box3 box, VaryingPlace& place, std::vector<RateBox>& all);

  std::vector<VaryingMedium> media_;
  std::vector<VaryingPlace> places_;
  std::vector<std::int32_t> place_of_instance_;
  std::vector<std::vector<RateBox>> boxes_;
  std::vector<std::string> problems_;
  std::int32_t size_ = 0;
};

}  // namespace relief
