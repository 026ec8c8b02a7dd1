// A compiled value graph as the kernel sees it: a list of instructions over eight points at a time.
//
// An instruction is a run of 16-bit words: its opcode (graph_op.h), its immediates, its output registers, its inputs. An
// input below kMostGraphRegisters is a register, one above a constant of the program. scene/graph/ makes programs;
// graph_eval.h runs them.
#pragma once

#include <cstdint>

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/math/vec.h"

namespace relief {

enum class GraphQuantity : std::uint16_t {
#define X(name) name,
#include "kernel/graph/graph_quantities.inc"
#undef X
  kCount
};

enum class GraphOutput : std::uint8_t {
#define X(name, json, components) name,
#include "kernel/graph/graph_outputs.inc"
#undef X
  kCount
};
inline constexpr int kNumGraphOutputs = static_cast<int>(GraphOutput::kCount);

inline constexpr std::uint16_t kMostGraphRegisters = 512;
inline constexpr std::uint16_t kNoGraphOperand = 0xffff;

/// Where a quantity is read: at the point, or some footprints away from it along the surface. Bumps ask for all three.
enum class GraphShift : std::uint16_t { kNone, kAlongX, kAlongY };

/// Register that is filled before a program runs.
struct GraphInput {
  GraphQuantity quantity;
  GraphShift shift;
  std::uint16_t register_index;
  std::uint16_t index = 0;  ///< which, of a quantity that is many
  float width = 1;          ///< footprints that the shift is long
};

struct VoxelView;  // kernel/graph/voxel_view.h

struct GraphProgramView {
  const std::uint16_t* code = nullptr;
  std::uint32_t num_words = 0;
  const float* constants = nullptr;
  const float* tables = nullptr;  ///< of `table` instructions: rows of floats, one after the other
  const VoxelView* voxels = nullptr;  ///< of `voxels` instructions
  const GraphInput* inputs = nullptr;
  std::uint32_t num_inputs = 0;
  bool is_shifted = false;  ///< some input is read away from the point
  /// Operands of each output's components; kNoGraphOperand: the graph does not give it.
  std::uint16_t outputs[kNumGraphOutputs][3] = {};
  const std::uint16_t* results = nullptr;  ///< operands, see SurfaceClosureSpec; kNoGraphOperand: 0
  /// By result: its value as a closure's input where that is constant, and how many results before it vary. Eight more values follow.
  const float* result_values = nullptr;
  const std::uint16_t* varying_before = nullptr;
  const std::uint16_t* varying = nullptr;  ///< results that are registers, in order
  const SurfaceClosureSpec* closures = nullptr;
  std::uint32_t num_closures = 0;
  /// First of three results: the shading normal, Z up, in place of the surface's; kNoGraphOperand: that stays.
  std::uint16_t surface_normal = kNoGraphOperand;
};

/// What a graph gives at one point.
struct GraphValues {
  Vec3f of[kNumGraphOutputs];  ///< numbers are in x
  std::uint32_t given = 0;     ///< bit GraphOutput
};

struct GraphRegisters;  // kernel/graph/graph_registers.h
struct TextureView;     // kernel/texture/texture_view.h

/// Runs a program over eight points. A pointer, as the interpreter is compiled once for every instruction set, and apart from
/// the stages.
/// @param textures   those of the scene
/// @param registers  the program's inputs are filled; lanes that mean nothing may hold anything
using GraphRun = void (*)(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers);

}  // namespace relief
