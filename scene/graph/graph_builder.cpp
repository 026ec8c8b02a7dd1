#include "scene/graph/graph_builder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "kernel/graph/graph_eval.h"
#include "kernel/graph/image.h"

namespace relief {
namespace {

const GraphOpShape& shape_of(GraphOp op) { return kGraphOpShapes[static_cast<int>(op)]; }

}  // namespace

bool graph_op_reads_images(GraphOp op)
{
  return op == GraphOp::image || op == GraphOp::image_box || op == GraphOp::image_tiles || op == GraphOp::voxels;
}

std::vector<int> graph_textures(const GraphProgram& program)
{
  std::vector<int> out;
  for (std::size_t word = 0; word < program.code.size();) {
    const auto op = static_cast<GraphOp>(program.code[word]);
    const std::uint16_t* const immediates = &program.code[word] + 1;
    if (op == GraphOp::image || op == GraphOp::image_box) out.push_back(immediates[0]);
    if (op == GraphOp::image_tiles) {
      const float* const tiles = &program.tables[immediates[2] | std::uint32_t{immediates[3]} << 16];
      for (int i = 0; i < immediates[1] * kImageTileColumns; ++i) {
        if (tiles[i] >= 0) out.push_back(static_cast<int>(tiles[i]));
      }
    }
    const GraphOpShape& shape = kGraphOpShapes[static_cast<std::size_t>(op)];
    word += 1 + static_cast<std::size_t>(shape.num_immediates + shape.num_outputs + shape.num_inputs);
  }
  return out;
}

GraphProgramView GraphProgram::view() const
{
  GraphProgramView v;
  v.code = code.data();
  v.num_words = static_cast<std::uint32_t>(code.size());
  v.constants = constants.data();
  v.tables = tables.data();
  v.voxels = voxels.data();
  v.inputs = inputs.data();
  v.num_inputs = static_cast<std::uint32_t>(inputs.size());
  v.is_shifted = std::any_of(inputs.begin(), inputs.end(),
                             [](const GraphInput& input) { return input.shift != GraphShift::kNone; });
  v.results = results.data();
  v.result_values = result_values.data();
  v.varying_before = varying_before.data();
  v.varying = varying.data();
  v.closures = closures.data();
  v.num_closures = static_cast<std::uint32_t>(closures.size());
  v.surface_normal = surface_normal;
  std::copy(&outputs[0][0], &outputs[0][0] + std::size(outputs) * 3, &v.outputs[0][0]);
  return v;
}

std::size_t GraphProgram::bytes() const
{
  return code.size() * sizeof(std::uint16_t) + (constants.size() + tables.size()) * sizeof(float) +
         inputs.size() * sizeof(GraphInput) + result_values.size() * sizeof(float) +
         (results.size() + varying_before.size() + varying.size()) * sizeof(std::uint16_t) +
         closures.size() * sizeof(SurfaceClosureSpec) + voxels.size() * sizeof(VoxelView) + sizeof(GraphProgram);
}

void graph_program_run(const GraphProgramView& program, const TextureView* /*textures*/, GraphRegisters& registers)
{
  graph_run(program, nullptr, registers);
}

GraphScalar GraphBuilder::add(const Node& node, const Key& key)
{
  const auto [it, is_new] = known_.try_emplace(key, static_cast<std::int32_t>(nodes_.size()));
  if (is_new) nodes_.push_back(node);
  return {it->second};
}

GraphScalar GraphBuilder::constant(float value)
{
  Node node{Node::Kind::kConstant};
  node.value = value;
  return add(node, {-1, std::bit_cast<std::int32_t>(value)});
}

GraphScalar GraphBuilder::quantity(GraphQuantity quantity, std::uint16_t index, GraphShift shift, float width)
{
  Node node{Node::Kind::kQuantity};
  node.quantity = quantity;
  node.index = index;
  node.shift = shift;
  node.width = width;
  return add(node, {-2, static_cast<std::int64_t>(quantity), static_cast<std::int64_t>(shift), index,
                    std::bit_cast<std::int32_t>(width)});
}

GraphScalar GraphBuilder::quantity_here(GraphQuantity quantity, std::uint16_t index)
{
  return this->quantity(quantity, index, GraphShift::kNone, 0);
}

bool GraphBuilder::is_constant(GraphScalar a, float* value) const
{
  const Node& node = nodes_[static_cast<std::size_t>(a.index)];
  if (node.kind != Node::Kind::kConstant) return false;
  if (value != nullptr) *value = node.value;
  return true;
}

/// What needs no operation: products with 1, sums with 0 and the like.
bool GraphBuilder::simplify(GraphOp op, std::span<const GraphScalar> in, GraphScalar* out) const
{
  const auto is = [&](std::size_t i, float wanted) {
    float value = 0;
    return is_constant(in[i], &value) && value == wanted;
  };
  switch (op) {
    case GraphOp::copy:
      *out = in[0];
      return true;
    case GraphOp::add:
      if (!is(0, 0) && !is(1, 0)) return false;
      *out = is(0, 0) ? in[1] : in[0];
      return true;
    case GraphOp::subtract:
      *out = in[0];
      return is(1, 0);
    case GraphOp::multiply:
      if (!is(0, 1) && !is(1, 1)) return false;
      *out = is(0, 1) ? in[1] : in[0];
      return true;
    case GraphOp::divide:
      *out = in[0];
      return is(1, 1);
    case GraphOp::multiply_add:
      *out = in[0];
      return is(1, 1) && is(2, 0);
    case GraphOp::select: {
      float value = 0;
      if (!is_constant(in[0], &value)) {
        *out = in[1];
        return in[1] == in[2];
      }
      *out = value != 0 ? in[1] : in[2];
      return true;
    }
    default:
      return false;
  }
}

std::vector<GraphScalar> GraphBuilder::fold(GraphOp op,
                                            std::span<const GraphScalar> inputs,
                                            std::span<const std::uint16_t> immediates)
{
  const GraphOpShape& shape = shape_of(op);
  GraphProgram program;
  program.code.push_back(static_cast<std::uint16_t>(op));
  program.code.insert(program.code.end(), immediates.begin(), immediates.end());
  for (int i = 0; i < shape.num_outputs; ++i) program.code.push_back(static_cast<std::uint16_t>(i));
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    program.code.push_back(static_cast<std::uint16_t>(kMostGraphRegisters + i));
    program.constants.push_back(nodes_[static_cast<std::size_t>(inputs[i].index)].value);
  }
  GraphProgramView view = program.view();
  view.tables = tables_.data();
  GraphRegisters registers;
  graph_program_run(view, nullptr, registers);
  std::vector<GraphScalar> out;
  for (int i = 0; i < shape.num_outputs; ++i) out.push_back(constant(registers.lanes[i][0]));
  return out;
}

std::vector<GraphScalar> GraphBuilder::apply(GraphOp op,
                                             std::span<const GraphScalar> inputs,
                                             std::span<const std::uint16_t> immediates)
{
  const GraphOpShape& shape = shape_of(op);
  if (!graph_op_reads_images(op) &&
      std::all_of(inputs.begin(), inputs.end(), [this](GraphScalar a) { return is_constant(a); })) {
    return fold(op, inputs, immediates);
  }
  if (GraphScalar simple; simplify(op, inputs, &simple)) return {simple};
  Key key{static_cast<std::int64_t>(op)};
  key.insert(key.end(), immediates.begin(), immediates.end());
  for (const GraphScalar a : inputs) key.push_back(a.index);
  if (const auto it = known_.find(key); it != known_.end()) {
    const Node& node = nodes_[static_cast<std::size_t>(it->second)];
    return operations_[static_cast<std::size_t>(node.operation)].outputs;
  }
  const auto operation = static_cast<std::int32_t>(operations_.size());
  known_.emplace(std::move(key), static_cast<std::int32_t>(nodes_.size()));
  std::vector<GraphScalar> outputs;
  for (int i = 0; i < shape.num_outputs; ++i) {
    outputs.push_back({static_cast<std::int32_t>(nodes_.size())});
    Node node{Node::Kind::kOperation};
    node.operation = operation;
    node.output = i;
    nodes_.push_back(node);
  }
  operations_.push_back({op, {immediates.begin(), immediates.end()}, {inputs.begin(), inputs.end()}, outputs});
  return outputs;
}

GraphScalar GraphBuilder::operator()(GraphOp op, std::initializer_list<GraphScalar> inputs)
{
  return apply(op, std::span(inputs.begin(), inputs.size())).front();
}

std::vector<GraphScalar> GraphBuilder::guarded(std::span<const GraphScalar> values, GraphScalar factor)
{
  std::vector<GraphScalar> out(values.begin(), values.end());
  float known = 0;
  if (is_constant(factor, &known)) {
    if (known == 0) std::fill(out.begin(), out.end(), constant(0));
    return out;
  }
  std::vector<std::int32_t> key;
  for (const GraphScalar a : values) key.push_back(a.index);
  key.push_back(factor.index);
  constexpr std::size_t kMostGroups = 65536;
  if (guard_groups_.size() == kMostGroups && !guard_groups_.contains(key)) return out;
  const auto next = static_cast<std::uint16_t>(guard_groups_.size());
  const std::uint16_t group = guard_groups_.try_emplace(std::move(key), next).first->second;
  for (GraphScalar& a : out) {
    const GraphScalar inputs[] = {a, factor};
    if (!is_constant(a)) a = apply(GraphOp::guard, inputs, {&group, 1}).front();
  }
  return out;
}

std::optional<std::array<double, 2>> GraphBuilder::linear_part(GraphScalar a, GraphScalar u, GraphScalar v) const
{
  // a = first · u + second · v + rest, gathered by following sums and known factors down to u and v.
  struct Term {
    GraphScalar of;
    double factor;
  };
  constexpr int kMostTerms = 256;
  std::vector<Term> open{{a, 1.0}};
  std::array<double, 2> out{};
  for (int taken = 0; !open.empty(); ++taken) {
    if (taken == kMostTerms) return {};
    const auto [of, factor] = open.back();
    open.pop_back();
    if (of == u || of == v) {
      out[of == u ? 0 : 1] += factor;
      continue;
    }
    const Node& node = nodes_[static_cast<std::size_t>(of.index)];
    if (node.kind == Node::Kind::kConstant) continue;
    if (node.kind == Node::Kind::kQuantity) return {};
    const auto& [op, immediates, in, outputs] = operations_[static_cast<std::size_t>(node.operation)];
    float known = 0;
    if (op == GraphOp::add || op == GraphOp::subtract) {
      open.push_back({in[0], factor});
      open.push_back({in[1], op == GraphOp::add ? factor : -factor});
    } else if (op == GraphOp::divide && is_constant(in[1], &known) && known != 0) {
      open.push_back({in[0], factor / static_cast<double>(known)});
    } else if ((op == GraphOp::multiply || op == GraphOp::multiply_add) &&
               (is_constant(in[0], &known) || is_constant(in[1], &known))) {
      open.push_back({is_constant(in[0]) ? in[1] : in[0], factor * static_cast<double>(known)});
      if (op == GraphOp::multiply_add) open.push_back({in[2], factor});
    } else {
      return {};
    }
  }
  return out;
}

std::uint32_t GraphBuilder::add_table(std::span<const float> values)
{
  const auto [it, is_new] =
      table_places_.try_emplace({values.begin(), values.end()}, static_cast<std::uint32_t>(tables_.size()));
  if (is_new) tables_.insert(tables_.end(), values.begin(), values.end());
  return it->second;
}

std::uint16_t GraphBuilder::add_voxels(const VoxelView& view, std::shared_ptr<const Voxels> owner)
{
  voxels_.push_back(view);
  voxel_owners_.push_back(std::move(owner));
  return static_cast<std::uint16_t>(voxels_.size() - 1);
}

void GraphBuilder::set_output(GraphOutput output, const GraphVector& value)
{
  outputs_[static_cast<std::size_t>(output)] = value;
}

std::uint16_t GraphBuilder::add_result(GraphScalar a)
{
  if (results_.size() == kNoGraphOperand) {
    throw GraphTooLarge("closures with at most " + std::to_string(kNoGraphOperand) + " inputs");
  }
  results_.push_back(a);
  return static_cast<std::uint16_t>(results_.size() - 1);
}

void GraphBuilder::keep_results(std::vector<SurfaceClosureSpec>& closures, int numbers)
{
  outputs_ = {};
  std::vector<GraphScalar> kept;
  for (SurfaceClosureSpec& closure : closures) {
    const auto first = results_.begin() + closure.first_result;
    closure.first_result = static_cast<std::uint16_t>(kept.size());
    kept.insert(kept.end(), first, first + numbers);
  }
  results_ = std::move(kept);
}

/// A number with other constants and quantities in their places.
/// @param done  what has been rewritten so already
/// @param leaf  of a constant or quantity and its node: what stands in its place
template <typename Leaf>
GraphScalar GraphBuilder::rewritten(GraphScalar a, Rewritten& done, Leaf&& leaf)
{
  // Inputs have lower numbers than what uses them, but graphs are deep: no recursion.
  std::vector<std::int32_t> stack{a.index};
  const auto known = [&](GraphScalar of) -> GraphScalar {
    const auto it = done.find(of.index);
    return it == done.end() ? GraphScalar{} : it->second;
  };
  while (!stack.empty()) {
    const GraphScalar of{stack.back()};
    if (known(of).index >= 0) {
      stack.pop_back();
      continue;
    }
    const Node node = nodes_[static_cast<std::size_t>(of.index)];
    if (node.kind != Node::Kind::kOperation) {
      done[of.index] = leaf(of, node);
      stack.pop_back();
      continue;
    }
    const Operation operation = operations_[static_cast<std::size_t>(node.operation)];
    // Guards of rewritten values would be others, and not stand side by side: these do without.
    const bool is_guard = operation.op == GraphOp::guard;
    std::vector<GraphScalar> inputs;
    bool are_known = true;
    for (const GraphScalar input : operation.inputs) {
      inputs.push_back(known(input));
      if (inputs.back().index >= 0) continue;
      are_known = false;
      stack.push_back(input.index);
    }
    if (!are_known) continue;
    const std::vector<GraphScalar> outputs =
        is_guard ? std::vector{inputs[0]} : apply(operation.op, inputs, operation.immediates);
    for (std::size_t i = 0; i < outputs.size(); ++i) done[operation.outputs[i].index] = outputs[i];
    stack.pop_back();
  }
  return known(a);
}

GraphScalar GraphBuilder::shifted(GraphScalar a, GraphShift shift, float width)
{
  return rewritten(a, shifted_[{shift, width}], [&](GraphScalar of, const Node& node) {
    // What a bump within a bump has moved already stays where it is.
    const bool moves = node.kind == Node::Kind::kQuantity && node.shift == GraphShift::kNone && node.width != 0;
    return moves ? quantity(node.quantity, node.index, shift, width) : of;
  });
}

GraphScalar GraphBuilder::unfiltered(GraphScalar a)
{
  return rewritten(a, unfiltered_, [&](GraphScalar of, const Node& node) {
    const bool is_width = node.kind == Node::Kind::kQuantity &&
                          (node.quantity == GraphQuantity::uv0_width || node.quantity == GraphQuantity::uv1_width);
    return is_width ? constant(0) : of;
  });
}

/// All numbers that the program has to give.
std::vector<GraphScalar> GraphBuilder::wanted() const
{
  std::vector<GraphScalar> all;
  for (const GraphVector& output : outputs_) all.insert(all.end(), output.begin(), output.end());
  all.insert(all.end(), results_.begin(), results_.end());
  std::erase_if(all, [](GraphScalar a) { return a.index < 0; });
  return all;
}

GraphSchedule GraphBuilder::schedule(bool skips) const
{
  const auto operation_of = [this](GraphScalar a) { return nodes_[static_cast<std::size_t>(a.index)].operation; };
  std::vector<ScheduleOperation> operations;
  for (const Operation& operation : operations_) {
    operations.push_back({operation.op, {}, operation.op == GraphOp::guard ? operation.immediates[0] : -1});
    for (const GraphScalar a : operation.inputs) operations.back().needs.push_back(operation_of(a));
  }
  std::vector<std::int32_t> wanted_operations;
  for (const GraphScalar a : wanted()) {
    if (operation_of(a) >= 0) wanted_operations.push_back(operation_of(a));
  }
  return graph_schedule(operations, wanted_operations, skips ? guard_groups_.size() : 0);
}

}  // namespace relief
