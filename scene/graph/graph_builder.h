// Builds a value graph of scalar operations and compiles it. Operations whose inputs are known are computed at once, equal
// ones become one, and what no output needs is left out; what remains is put into an order that needs few registers and
// leaves out what factors of 0 make needless (graph_schedule.h).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "kernel/graph/graph_op.h"
#include "scene/graph/graph_program.h"
#include "scene/graph/graph_schedule.h"

namespace relief {

/// A number of the graph.
struct GraphScalar {
  std::int32_t index = -1;
  bool operator==(const GraphScalar&) const = default;
};

/// A vector or colour.
using GraphVector = std::array<GraphScalar, 3>;

/// A graph that no program can be made of. what() says why, without its place.
class GraphTooLarge : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class GraphBuilder {
 public:
  GraphScalar constant(float value);
  /// @param index  of quantities that are many, see GraphInput
  /// @param width  footprints that the shift is long
  GraphScalar quantity(GraphQuantity quantity,
                       std::uint16_t index = 0,
                       GraphShift shift = GraphShift::kNone,
                       float width = 1);

  /// A quantity that no bump moves: it is asked for at the point, wherever a height that depends on it is.
  GraphScalar quantity_here(GraphQuantity quantity, std::uint16_t index = 0);

  /// @param inputs      as many as the operation has
  /// @param immediates  likewise
  /// @return            its outputs
  std::vector<GraphScalar> apply(GraphOp op,
                                 std::span<const GraphScalar> inputs,
                                 std::span<const std::uint16_t> immediates = {});

  /// An operation with one output and no immediates.
  GraphScalar operator()(GraphOp op, std::initializer_list<GraphScalar> inputs);

  /// Values that count only where a factor is not 0, and are 0 elsewhere. What they alone need is left out where the factor
  /// is 0 at all points of a run.
  std::vector<GraphScalar> guarded(std::span<const GraphScalar> values, GraphScalar factor);

  /// Whether a number is known, and which it is.
  bool is_constant(GraphScalar a, float* value = nullptr) const;

  /// How often two numbers go into a third, where it is a sum of multiples of both and something known; else empty.
  std::optional<std::array<double, 2>> linear_part(GraphScalar a, GraphScalar u, GraphScalar v) const;

  /// Adds floats that `table` operations read.
  /// @return place of the first; equal tables are kept once
  std::uint32_t add_table(std::span<const float> values);

  /// Adds what `voxels` operations read.
  /// @param owner  of what the view looks at
  /// @return       its number
  std::uint16_t add_voxels(const VoxelView& view, std::shared_ptr<const Voxels> owner);

  void set_output(GraphOutput output, const GraphVector& value);

  /// Adds a number that the program gives beside its outputs.
  /// @param a  index −1: 0
  /// @return   its place among the results
  std::uint16_t add_result(GraphScalar a);

  /// Leaves out all outputs, and all results but these closures'; their places are moved.
  /// @param numbers  of results that each has
  void keep_results(std::vector<SurfaceClosureSpec>& closures, int numbers);

  /// A number as it is some footprints away: everything that leads to it is asked for there.
  /// @param width  footprints, above 0
  GraphScalar shifted(GraphScalar a, GraphShift shift, float width);

  /// A number as the finest levels of all images give it. Normals and heights are read so: what a pixel makes of many of them
  /// is not what it makes of their mean.
  GraphScalar unfiltered(GraphScalar a);

  /// @param skips  whether what guards make needless is left out
  /// @error GraphTooLarge
  GraphProgram compile(bool skips = true) const;

 private:
  /// One output of an operation; or a constant, or a quantity.
  struct Node {
    enum class Kind : std::uint8_t { kConstant, kQuantity, kOperation } kind;
    std::int32_t operation = -1;  ///< into operations_
    int output = 0;
    float value = 0;
    GraphQuantity quantity{};
    GraphShift shift{};
    std::uint16_t index = 0;  ///< of the quantity
    float width = 1;          ///< of the shift; 0: there is to be none
  };
  struct Operation {
    GraphOp op;
    std::vector<std::uint16_t> immediates;
    std::vector<GraphScalar> inputs;
    std::vector<GraphScalar> outputs;
  };
  class Compilation;
  using Key = std::vector<std::int64_t>;
  using Rewritten = std::map<std::int32_t, GraphScalar>;  ///< by what they were

  template <typename Leaf>
  GraphScalar rewritten(GraphScalar a, Rewritten& known, Leaf&& leaf);
  GraphScalar add(const Node& node, const Key& key);
  std::vector<GraphScalar> wanted() const;
  bool simplify(GraphOp op, std::span<const GraphScalar> in, GraphScalar* out) const;
  std::vector<GraphScalar> fold(GraphOp op,
                                std::span<const GraphScalar> inputs,
                                std::span<const std::uint16_t> immediates);
  GraphSchedule schedule(bool skips) const;

  std::vector<Node> nodes_;
  std::vector<Operation> operations_;
  std::map<Key, std::int32_t> known_;  ///< first node of what a key says
  std::vector<float> tables_;
  std::map<std::vector<float>, std::uint32_t> table_places_;
  std::vector<VoxelView> voxels_;
  std::vector<std::shared_ptr<const Voxels>> voxel_owners_;
  std::array<GraphVector, kNumGraphOutputs> outputs_;
  std::vector<GraphScalar> results_;
  std::map<std::pair<GraphShift, float>, Rewritten> shifted_;
  Rewritten unfiltered_;
  std::map<std::vector<std::int32_t>, std::uint16_t> guard_groups_;  ///< by their values and, at the end, their factor
};

}  // namespace relief
