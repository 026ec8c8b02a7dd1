// How a graph's operations become a program: registers for what is in use, words of code, and what is given.
#include "scene/graph/graph_builder.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/graph/graph_eval.h"
#include "kernel/graph/voronoi.h"

namespace relief {
namespace {

/// Tells a program's results that are constant from those that vary.
void results_split(GraphProgram& program)
{
  for (std::size_t i = 0; i < program.results.size(); ++i) {
    const std::uint16_t operand = program.results[i];
    const bool is_constant = operand >= kMostGraphRegisters && operand != kNoGraphOperand;
    program.varying_before.push_back(static_cast<std::uint16_t>(program.varying.size()));
    if (operand < kMostGraphRegisters) program.varying.push_back(static_cast<std::uint16_t>(i));
    program.result_values.push_back(
        is_constant ? closure_input(program.constants[std::size_t{operand} - kMostGraphRegisters]) : 0.0f);
  }
  program.varying_before.push_back(static_cast<std::uint16_t>(program.varying.size()));
  program.result_values.resize(program.results.size() + 8);
}

}  // namespace

/// A program in the making.
class GraphBuilder::Compilation {
 public:
  Compilation(const GraphBuilder& builder, const GraphSchedule& schedule) : builder_(builder), schedule_(schedule) {}

  /// @error GraphTooLarge
  GraphProgram run();

 private:
  using StepKind = ScheduleStep::Kind;

  const Operation& operation_at(std::int32_t i) const { return builder_.operations_[static_cast<std::size_t>(i)]; }
  GraphScalar source(GraphScalar a) const;
  std::size_t source_index(GraphScalar a) const { return static_cast<std::size_t>(source(a).index); }
  void find_last_uses();
  std::uint16_t take_register();
  void place_leaves();
  void write_code();
  void write_operation(const Operation& operation, std::int32_t position);
  void free_registers(const Operation& operation, std::int32_t position);
  std::vector<std::uint16_t> placed(const Operation& operation);
  void write_outputs();

  const GraphBuilder& builder_;
  const GraphSchedule& schedule_;
  GraphProgram program_;
  /// Of every value: position in the schedule, or beyond it for outputs; −1: none.
  std::vector<std::int32_t> last_use_;
  std::vector<std::uint16_t> operand_of_;
  std::vector<std::uint16_t> free_registers_;
  /// Of the tables that the program has, by those of the builder.
  std::map<std::uint32_t, std::uint32_t> table_places_;
};

/// What gives a number: guards that are not run hand on what they guard.
GraphScalar GraphBuilder::Compilation::source(GraphScalar a) const
{
  for (;;) {
    const Node& node = builder_.nodes_[static_cast<std::size_t>(a.index)];
    if (node.kind != Node::Kind::kOperation || operation_at(node.operation).op != GraphOp::guard) return a;
    const std::size_t group = operation_at(node.operation).immediates[0];
    if (group < schedule_.is_guarded.size() && schedule_.is_guarded[group] != 0) return a;
    a = operation_at(node.operation).inputs[0];
  }
}

void GraphBuilder::Compilation::find_last_uses()
{
  constexpr auto kEver = std::numeric_limits<std::int32_t>::max();
  last_use_.assign(builder_.nodes_.size(), -1);
  for (std::size_t position = 0; position < schedule_.steps.size(); ++position) {
    if (schedule_.steps[position].kind != StepKind::kRun) continue;
    for (const GraphScalar a : operation_at(schedule_.steps[position].index).inputs) {
      last_use_[source_index(a)] = static_cast<std::int32_t>(position);
    }
  }
  for (const GraphScalar a : builder_.wanted()) last_use_[source_index(a)] = kEver;
}

std::uint16_t GraphBuilder::Compilation::take_register()
{
  if (!free_registers_.empty()) {
    const std::uint16_t taken = free_registers_.back();
    free_registers_.pop_back();
    return taken;
  }
  if (program_.num_registers == kMostGraphRegisters) {
    throw GraphTooLarge("one that needs at most " + std::to_string(kMostGraphRegisters) + " values at a time");
  }
  return static_cast<std::uint16_t>(program_.num_registers++);
}

/// Gives places to quantities and constants that are used.
void GraphBuilder::Compilation::place_leaves()
{
  operand_of_.assign(builder_.nodes_.size(), kNoGraphOperand);
  for (std::size_t i = 0; i < builder_.nodes_.size(); ++i) {
    if (last_use_[i] < 0) continue;
    const Node& node = builder_.nodes_[i];
    if (node.kind == Node::Kind::kQuantity) {
      operand_of_[i] = take_register();
      program_.inputs.push_back({node.quantity, node.shift, operand_of_[i], node.index, node.width});
    } else if (node.kind == Node::Kind::kConstant) {
      constexpr std::size_t kMostConstants = kNoGraphOperand - kMostGraphRegisters;
      if (program_.constants.size() == kMostConstants) {
        throw GraphTooLarge("one with at most " + std::to_string(kMostConstants) + " different constants");
      }
      operand_of_[i] = static_cast<std::uint16_t>(kMostGraphRegisters + program_.constants.size());
      program_.constants.push_back(node.value);
    }
  }
}

void GraphBuilder::Compilation::write_code()
{
  // Factor of each group, and where the words to leave out are to be written.
  std::vector<GraphScalar> factors(builder_.guard_groups_.size());
  for (const Operation& operation : builder_.operations_) {
    if (operation.op == GraphOp::guard) factors[operation.immediates[0]] = operation.inputs[1];
  }
  std::vector<std::size_t> skips(builder_.guard_groups_.size());
  std::vector<std::uint16_t>& code = program_.code;
  for (std::size_t position = 0; position < schedule_.steps.size(); ++position) {
    const ScheduleStep step = schedule_.steps[position];
    const auto group = static_cast<std::size_t>(step.index);
    switch (step.kind) {
      case StepKind::kSkip:
        code.insert(code.end(),
                    {static_cast<std::uint16_t>(GraphOp::skip), 0, 0, operand_of_[source_index(factors[group])]});
        skips[group] = code.size();
        break;
      case StepKind::kEnd: {
        const std::size_t words = code.size() - skips[group];
        code[skips[group] - 3] = static_cast<std::uint16_t>(words & 0xffffu);
        code[skips[group] - 2] = static_cast<std::uint16_t>(words >> 16);
        break;
      }
      case StepKind::kRun:
        write_operation(operation_at(step.index), static_cast<std::int32_t>(position));
        break;
    }
  }
}

void GraphBuilder::Compilation::write_operation(const Operation& operation, std::int32_t position)
{
  std::vector<std::uint16_t>& code = program_.code;
  // Outputs first: an operation may write one before it has read all that it reads.
  for (const GraphScalar a : operation.outputs) operand_of_[static_cast<std::size_t>(a.index)] = take_register();
  code.push_back(static_cast<std::uint16_t>(operation.op));
  const std::vector<std::uint16_t> immediates = placed(operation);
  code.insert(code.end(), immediates.begin(), immediates.end());
  for (const GraphScalar a : operation.outputs) code.push_back(operand_of_[static_cast<std::size_t>(a.index)]);
  for (const GraphScalar a : operation.inputs) code.push_back(operand_of_[source_index(a)]);
  free_registers(operation, position);
}

/// Gives back the registers of what nobody reads after an operation.
void GraphBuilder::Compilation::free_registers(const Operation& operation, std::int32_t position)
{
  std::vector<std::size_t> ended;
  for (const GraphScalar a : operation.inputs) {
    if (last_use_[source_index(a)] == position) ended.push_back(source_index(a));
  }
  for (const GraphScalar a : operation.outputs) {
    const auto i = static_cast<std::size_t>(a.index);
    if (last_use_[i] < 0) ended.push_back(i);
  }
  std::sort(ended.begin(), ended.end());
  ended.erase(std::unique(ended.begin(), ended.end()), ended.end());
  for (const std::size_t i : ended) {
    if (operand_of_[i] < kMostGraphRegisters) free_registers_.push_back(operand_of_[i]);
  }
}

/// Immediates of an operation in the program, which gets the table or the voxels that it reads.
std::vector<std::uint16_t> GraphBuilder::Compilation::placed(const Operation& operation)
{
  std::vector<std::uint16_t> immediates = operation.immediates;
  if (operation.op >= GraphOp::voronoi_1d && operation.op <= GraphOp::voronoi_4d) {
    // Distances come first, and once more last.
    const bool is_bare =
        std::none_of(operation.outputs.begin() + 1, operation.outputs.end() - 1,
                     [this](GraphScalar a) { return last_use_[static_cast<std::size_t>(a.index)] >= 0; });
    if (is_bare) immediates[2] |= kVoronoiBare;
    return immediates;
  }
  if (operation.op == GraphOp::voxels) {
    const std::size_t from = immediates[0];
    immediates[0] = static_cast<std::uint16_t>(program_.voxels.size());
    program_.voxels.push_back(builder_.voxels_[from]);
    program_.voxel_owners.push_back(builder_.voxel_owners_[from]);
    return immediates;
  }
  const bool are_tiles = operation.op == GraphOp::image_tiles;
  const bool is_grid = operation.op == GraphOp::grid;
  const bool is_ies = operation.op == GraphOp::ies;
  if (!are_tiles && !is_grid && !is_ies && operation.op != GraphOp::table) return immediates;
  const std::size_t low = are_tiles ? 2 : 0;  // where the place stands
  const int size = are_tiles ? immediates[1] * kImageTileColumns
                   : is_grid ? immediates[2] * immediates[3] * 3
                   : is_ies  ? ies_table_size(immediates[2], immediates[3])
                             : immediates[2];
  const std::uint32_t from = immediates[low] | std::uint32_t{immediates[low + 1]} << 16;
  const auto [it, is_new] = table_places_.try_emplace(from, static_cast<std::uint32_t>(program_.tables.size()));
  if (is_new) {
    const auto row = builder_.tables_.begin() + from;
    program_.tables.insert(program_.tables.end(), row, row + size);
  }
  immediates[low] = static_cast<std::uint16_t>(it->second & 0xffffu);
  immediates[low + 1] = static_cast<std::uint16_t>(it->second >> 16);
  return immediates;
}

void GraphBuilder::Compilation::write_outputs()
{
  const auto& outputs = builder_.outputs_;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const bool is_given = outputs[i][0].index >= 0;
    if (is_given) program_.given |= 1u << i;
    for (std::size_t c = 0; c < 3; ++c) {
      program_.outputs[i][c] = is_given ? operand_of_[source_index(outputs[i][c])] : kNoGraphOperand;
    }
  }
  for (const GraphScalar a : builder_.results_) {
    program_.results.push_back(a.index < 0 ? kNoGraphOperand : operand_of_[source_index(a)]);
  }
  results_split(program_);
}

GraphProgram GraphBuilder::Compilation::run()
{
  find_last_uses();
  place_leaves();
  write_code();
  write_outputs();
  return std::move(program_);
}

GraphProgram GraphBuilder::compile(bool skips) const
{
  if (skips) {
    // What is shared is held for longer, which may be too long.
    try {
      return Compilation(*this, schedule(true)).run();
    } catch (const GraphTooLarge&) {
    }
  }
  return Compilation(*this, schedule(false)).run();
}

}  // namespace relief
