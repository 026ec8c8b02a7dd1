#include "scene/graph/graph_builder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "kernel/graph/graph_eval.h"
#include "kernel/graph/image.h"

namespace relief {
namespace {

const GraphOpShape& shape_of(GraphOp op) { return kGraphOpShapes[static_cast<int>(op)]; }

}  // namespace

bool graph_op_reads_images(GraphOp op)
{
  return op == GraphOp::image || op == GraphOp::image_box || op == GraphOp::image_tiles;
}

GraphProgramView GraphProgram::view() const
{
  GraphProgramView v;
  v.code = code.data();
  v.num_words = static_cast<std::uint32_t>(code.size());
  v.constants = constants.data();
  v.tables = tables.data();
  v.inputs = inputs.data();
  v.num_inputs = static_cast<std::uint32_t>(inputs.size());
  v.is_shifted = std::any_of(inputs.begin(), inputs.end(),
                             [](const GraphInput& input) { return input.shift != GraphShift::kNone; });
  v.results = results.data();
  v.closures = closures.data();
  v.num_closures = static_cast<std::uint32_t>(closures.size());
  v.surface_normal = surface_normal;
  std::copy(&outputs[0][0], &outputs[0][0] + std::size(outputs) * 3, &v.outputs[0][0]);
  return v;
}

std::size_t GraphProgram::bytes() const
{
  return code.size() * sizeof(std::uint16_t) + (constants.size() + tables.size()) * sizeof(float) +
         inputs.size() * sizeof(GraphInput) + results.size() * sizeof(std::uint16_t) +
         closures.size() * sizeof(SurfaceClosureSpec) + sizeof(GraphProgram);
}

void graph_program_run(const GraphProgramView& program, GraphRegisters& registers)
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
  graph_program_run(view, registers);
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

/// Immediates of an operation in a program, which gets the table that it reads.
/// @param places  of the tables that the program has, by those in tables_
std::vector<std::uint16_t> GraphBuilder::placed(const Operation& operation,
                                                std::map<std::uint32_t, std::uint32_t>& places,
                                                GraphProgram& program) const
{
  std::vector<std::uint16_t> immediates = operation.immediates;
  const bool are_tiles = operation.op == GraphOp::image_tiles;
  const bool is_grid = operation.op == GraphOp::grid;
  if (!are_tiles && !is_grid && operation.op != GraphOp::table) return immediates;
  const std::size_t low = are_tiles ? 2 : 0;  // where the place stands
  const int size = are_tiles ? immediates[1] * kImageTileColumns
                   : is_grid ? immediates[2] * immediates[3] * 3
                             : immediates[2];
  const std::uint32_t from = immediates[low] | std::uint32_t{immediates[low + 1]} << 16;
  const auto [it, is_new] = places.try_emplace(from, static_cast<std::uint32_t>(program.tables.size()));
  if (is_new) {
    const auto row = tables_.begin() + from;
    program.tables.insert(program.tables.end(), row, row + size);
  }
  immediates[low] = static_cast<std::uint16_t>(it->second & 0xffffu);
  immediates[low + 1] = static_cast<std::uint16_t>(it->second >> 16);
  return immediates;
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

GraphScalar GraphBuilder::shifted(GraphScalar a, GraphShift shift, float width)
{
  // Inputs have lower numbers than what uses them, but graphs are deep: no recursion.
  std::vector<std::int32_t> stack{a.index};
  const auto known = [&](GraphScalar of) -> GraphScalar {
    const auto it = shifted_.find({of.index, shift, width});
    return it == shifted_.end() ? GraphScalar{} : it->second;
  };
  while (!stack.empty()) {
    const GraphScalar of{stack.back()};
    if (known(of).index >= 0) {
      stack.pop_back();
      continue;
    }
    const Node node = nodes_[static_cast<std::size_t>(of.index)];
    if (node.kind != Node::Kind::kOperation) {
      // What a bump within a bump has moved already stays where it is.
      const bool moves = node.kind == Node::Kind::kQuantity && node.shift == GraphShift::kNone;
      shifted_[{of.index, shift, width}] = moves ? quantity(node.quantity, node.index, shift, width) : of;
      stack.pop_back();
      continue;
    }
    const Operation operation = operations_[static_cast<std::size_t>(node.operation)];
    std::vector<GraphScalar> inputs;
    bool are_known = true;
    for (const GraphScalar input : operation.inputs) {
      inputs.push_back(known(input));
      if (inputs.back().index >= 0) continue;
      are_known = false;
      stack.push_back(input.index);
    }
    if (!are_known) continue;
    const std::vector<GraphScalar> outputs = apply(operation.op, inputs, operation.immediates);
    for (std::size_t i = 0; i < outputs.size(); ++i) shifted_[{operation.outputs[i].index, shift, width}] = outputs[i];
    stack.pop_back();
  }
  return known(a);
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

/// The operations that outputs need, each after what it needs itself; of several inputs the one that needs most registers
/// comes first.
std::vector<std::int32_t> GraphBuilder::order() const
{
  // Inputs have lower numbers than what uses them, so one pass each way does.
  std::vector<int> registers(operations_.size(), 0);
  const auto operation_of = [this](GraphScalar a) { return nodes_[static_cast<std::size_t>(a.index)].operation; };
  const auto inputs_by_need = [&](const Operation& operation) {
    std::vector<std::int32_t> needed;
    for (const GraphScalar a : operation.inputs) {
      if (operation_of(a) >= 0) needed.push_back(operation_of(a));
    }
    std::sort(needed.begin(), needed.end());
    needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
    std::stable_sort(needed.begin(), needed.end(), [&](std::int32_t a, std::int32_t b) {
      return registers[static_cast<std::size_t>(a)] > registers[static_cast<std::size_t>(b)];
    });
    return needed;
  };
  for (std::size_t i = 0; i < operations_.size(); ++i) {
    int most = static_cast<int>(operations_[i].outputs.size()), held = 0;
    for (const std::int32_t input : inputs_by_need(operations_[i])) {
      const auto n = static_cast<std::size_t>(input);
      most = std::max(most, held + registers[n]);
      held += static_cast<int>(operations_[n].outputs.size());
    }
    registers[i] = most;
  }

  std::vector<std::int32_t> ordered;
  std::vector<char> is_placed(operations_.size(), 0);
  std::vector<std::pair<std::int32_t, bool>> stack;  // operation, whether its inputs are done
  for (const GraphScalar component : wanted()) {
    if (operation_of(component) < 0) continue;
    stack.emplace_back(operation_of(component), false);
    while (!stack.empty()) {
      const auto [operation, are_inputs_done] = stack.back();
      stack.pop_back();
      const auto n = static_cast<std::size_t>(operation);
      if (is_placed[n] != 0) continue;
      if (are_inputs_done) {
        is_placed[n] = 1;
        ordered.push_back(operation);
        continue;
      }
      stack.emplace_back(operation, true);
      const std::vector<std::int32_t> needed = inputs_by_need(operations_[n]);
      for (auto it = needed.rbegin(); it != needed.rend(); ++it) stack.emplace_back(*it, false);
    }
  }
  return ordered;
}

GraphProgram GraphBuilder::compile() const
{
  const std::vector<std::int32_t> ordered = order();
  // Last use of every value: position in the order, or beyond it for outputs.
  constexpr auto kEver = std::numeric_limits<std::int32_t>::max();
  std::vector<std::int32_t> last_use(nodes_.size(), -1);
  for (std::size_t position = 0; position < ordered.size(); ++position) {
    for (const GraphScalar a : operations_[static_cast<std::size_t>(ordered[position])].inputs) {
      last_use[static_cast<std::size_t>(a.index)] = static_cast<std::int32_t>(position);
    }
  }
  for (const GraphScalar a : wanted()) last_use[static_cast<std::size_t>(a.index)] = kEver;

  GraphProgram program;
  std::map<std::uint32_t, std::uint32_t> table_places;
  std::vector<std::uint16_t> operand_of(nodes_.size(), kNoGraphOperand);
  std::vector<std::uint16_t> free_registers;
  const auto take_register = [&] {
    if (!free_registers.empty()) {
      const std::uint16_t taken = free_registers.back();
      free_registers.pop_back();
      return taken;
    }
    if (program.num_registers == kMostGraphRegisters) {
      throw GraphTooLarge("one that needs at most " + std::to_string(kMostGraphRegisters) + " values at a time");
    }
    return static_cast<std::uint16_t>(program.num_registers++);
  };
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (last_use[i] < 0) continue;
    if (nodes_[i].kind == Node::Kind::kQuantity) {
      operand_of[i] = take_register();
      program.inputs.push_back({nodes_[i].quantity, nodes_[i].shift, operand_of[i], nodes_[i].index, nodes_[i].width});
    } else if (nodes_[i].kind == Node::Kind::kConstant) {
      constexpr std::size_t kMostConstants = kNoGraphOperand - kMostGraphRegisters;
      if (program.constants.size() == kMostConstants) {
        throw GraphTooLarge("one with at most " + std::to_string(kMostConstants) + " different constants");
      }
      operand_of[i] = static_cast<std::uint16_t>(kMostGraphRegisters + program.constants.size());
      program.constants.push_back(nodes_[i].value);
    }
  }
  for (std::size_t position = 0; position < ordered.size(); ++position) {
    const Operation& operation = operations_[static_cast<std::size_t>(ordered[position])];
    // Outputs first: an operation may write one before it has read all that it reads.
    for (const GraphScalar a : operation.outputs) operand_of[static_cast<std::size_t>(a.index)] = take_register();
    program.code.push_back(static_cast<std::uint16_t>(operation.op));
    const std::vector<std::uint16_t> immediates = placed(operation, table_places, program);
    program.code.insert(program.code.end(), immediates.begin(), immediates.end());
    for (const GraphScalar a : operation.outputs) program.code.push_back(operand_of[static_cast<std::size_t>(a.index)]);
    for (const GraphScalar a : operation.inputs) program.code.push_back(operand_of[static_cast<std::size_t>(a.index)]);
    std::vector<std::int32_t> ended;
    for (const GraphScalar a : operation.inputs) {
      if (last_use[static_cast<std::size_t>(a.index)] == static_cast<std::int32_t>(position)) ended.push_back(a.index);
    }
    for (const GraphScalar a : operation.outputs) {
      if (last_use[static_cast<std::size_t>(a.index)] < 0) ended.push_back(a.index);
    }
    std::sort(ended.begin(), ended.end());
    ended.erase(std::unique(ended.begin(), ended.end()), ended.end());
    for (const std::int32_t i : ended) {
      const std::uint16_t operand = operand_of[static_cast<std::size_t>(i)];
      if (operand < kMostGraphRegisters) free_registers.push_back(operand);
    }
  }
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const bool is_given = outputs_[i][0].index >= 0;
    if (is_given) program.given |= 1u << i;
    for (std::size_t c = 0; c < 3; ++c) {
      program.outputs[i][c] = is_given ? operand_of[static_cast<std::size_t>(outputs_[i][c].index)] : kNoGraphOperand;
    }
  }
  for (const GraphScalar a : results_) {
    program.results.push_back(a.index < 0 ? kNoGraphOperand : operand_of[static_cast<std::size_t>(a.index)]);
  }
  return program;
}

}  // namespace relief
