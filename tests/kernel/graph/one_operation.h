// Runs one operation of value graphs by each interpreter that this machine has.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ostream>
#include <random>
#include <vector>

#include "integrator/stages.h"
#include "kernel/graph/graph_op.h"
#include "kernel/graph/voxel_view.h"

namespace relief::test {

/// An interpreter that is compiled for some instruction set.
struct Interpreter {
  const char* name;
  GraphRun run;
  bool is_runnable;  ///< on this machine
};

inline std::vector<Interpreter> interpreters()
{
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  return {{"baseline", graph_run_baseline, true},
          {"avx2", graph_run_avx2, has_avx2},
          {"avx512", graph_run_avx512, has_avx512}};
}

/// How GoogleTest prints an interpreter.
inline void PrintTo(const Interpreter& interpreter, std::ostream* out) { *out << interpreter.name; }

inline const GraphOpShape& shape_of(GraphOp op) { return kGraphOpShapes[static_cast<int>(op)]; }

/// One brick of numbers from -2 to 4, between one that has none and emptiness.
inline const VoxelView& some_voxels()
{
  static const std::vector<std::uint16_t> values = [] {
    constexpr std::uint16_t kHalves[] = {0, 0x3400, 0x3800, 0x3c00, 0x4000, 0xbc00, 0xc000, 0x4400};
    std::vector<std::uint16_t> halves(2 * kBrickVoxels, 0);
    for (std::size_t i = 0; i < kBrickVoxels; ++i) halves[kBrickVoxels + i] = kHalves[(i * 37 >> 3) % 8];
    return halves;
  }();
  static constexpr std::array<std::uint32_t, 2> kBricks = {0, 1};
  static constexpr std::array<VoxelRange, 2> kRanges = {VoxelRange{}, VoxelRange{{-2, -2, -2}, {4, 4, 4}}};
  static const VoxelView view = [] {
    VoxelView v;
    v.bricks = kBricks.data(), v.values = values.data(), v.ranges = kRanges.data();
    v.first[0] = -1;
    v.count[0] = 2, v.count[1] = v.count[2] = 1;
    v.range = kRanges[1];
    return v;
  }();
  return view;
}

/// Outputs of an operation over eight points: [output][lane].
using Outputs = std::vector<std::vector<float>>;

/// @param in          [input][lane]
/// @param immediates  those that are left out, and inputs, are 0
inline Outputs run_one(GraphRun run,
                       GraphOp op,
                       const std::vector<std::vector<float>>& in,
                       const std::vector<std::uint16_t>& immediates = {},
                       const TextureView* textures = nullptr,
                       const std::vector<float>& table = {})
{
  GraphRegisters registers;
  std::vector<std::uint16_t> code = {static_cast<std::uint16_t>(op)};
  code.insert(code.end(), immediates.begin(), immediates.end());
  code.resize(1 + static_cast<std::size_t>(shape_of(op).num_immediates), 0);
  std::uint16_t next = 0;
  for (int i = 0; i < shape_of(op).num_outputs; ++i) code.push_back(next++);
  for (const std::vector<float>& lanes : in) {
    registers.lanes[next] = load8(lanes.data());
    code.push_back(next++);
  }
  for (auto i = static_cast<int>(in.size()); i < shape_of(op).num_inputs; ++i) {
    registers.lanes[next] = F8{};
    code.push_back(next++);
  }
  GraphProgramView program;
  program.code = code.data();
  program.num_words = static_cast<std::uint32_t>(code.size());
  program.tables = table.data();
  program.voxels = &some_voxels();
  run(program, textures, registers);
  Outputs out;
  for (int i = 0; i < shape_of(op).num_outputs; ++i) {
    out.emplace_back(8);
    store8(out.back().data(), registers.lanes[i]);
  }
  return out;
}

/// Numbers of all sizes, with those among them that break things.
class HardNumbers {
 public:
  explicit HardNumbers(unsigned seed) : random_(seed) {}

  float any()
  {
    switch (random_() % 8) {
      case 0:
        return kHard[random_() % std::size(kHard)];
      case 1:
        return within(-1e6f, 1e6f);
      case 2: {
        const float size = std::exp2(within(-149, 127));
        return random_() % 2 == 0 ? size : -size;
      }
      case 3:
        return std::floor(within(-8, 8));
      case 4:
        return within(0, 1);
      default:
        return within(-4, 4);
    }
  }
  float within(float low, float high)
  {
    return low + (high - low) * static_cast<float>(random_() >> 8) / static_cast<float>(1u << 24);
  }
  /// @return  [input][lane]
  std::vector<std::vector<float>> lanes(std::size_t count)
  {
    std::vector<std::vector<float>> out(count, std::vector<float>(8));
    for (std::vector<float>& row : out) {
      for (float& x : row) x = any();
    }
    return out;
  }
  std::vector<float> row(float low, float high)
  {
    std::vector<float> out(8);
    for (float& x : out) x = within(low, high);
    return out;
  }
  unsigned word() { return static_cast<unsigned>(random_()); }

 private:
  static constexpr float kInf = std::numeric_limits<float>::infinity();
  static constexpr float kMax = std::numeric_limits<float>::max();
  static constexpr float kHard[] = {0.0f,
                                    -0.0f,
                                    1.0f,
                                    -1.0f,
                                    0.5f,
                                    -0.5f,
                                    1e-45f,
                                    -1e-45f,
                                    1e-38f,
                                    3e9f,
                                    -3e9f,
                                    2147483648.0f,
                                    kMax,
                                    -kMax,
                                    kInf,
                                    -kInf,
                                    std::numeric_limits<float>::quiet_NaN(),
                                    16777216,
                                    8388609,
                                    1e30f,
                                    -1e30f,
                                    3.14159274f};
  std::mt19937 random_;
};

/// Both are numbers and near, or neither is, or both are as large.
inline bool is_like(double found, double expected, double tolerance)
{
  if (std::isnan(expected)) return std::isnan(found);
  // Beyond the range of floats.
  if (std::abs(expected) > 3.4028e38) return std::abs(found) > 3.40e38 && std::signbit(found) == std::signbit(expected);
  return std::abs(found - expected) <= tolerance;
}

}  // namespace relief::test
