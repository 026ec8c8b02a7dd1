// A material's closures at a point, their inputs read from its program: a mixture of lobes, emission and transparency.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "kernel/bsdf/mixture_make.h"
#include "kernel/bsdf/principled3_lanes.h"
#include "kernel/graph/graph_registers.h"

namespace relief {

/// Inputs of one closure.
template <typename Inputs>
RELIEF_KERNEL Inputs closure_inputs(const GraphLane& at, const SurfaceClosureSpec& spec)
{
  Inputs inputs;
  // Structs of nothing but floats, in the order in which they were read.
  if constexpr (!std::is_empty_v<Inputs>) {
    constexpr int kNumbers = sizeof(Inputs) / sizeof(float);
    const GraphProgramView& program = *at.program;
    const int first = spec.first_result + 1;
    alignas(32) float numbers[(kNumbers + 7) / 8 * 8];
    for (int i = 0; i < kNumbers; i += 8) store8(numbers + i, load8(program.result_values + first + i));
    for (int i = program.varying_before[first]; i < program.varying_before[first + kNumbers]; ++i) {
      const int result = program.varying[i];
      numbers[result - first] = closure_input(at.registers->lanes[program.results[result]][at.lane]);
    }
    std::memcpy(&inputs, numbers, sizeof(Inputs));
  }
  return inputs;
}

/// Resolves all closures that have a weight at the point.
/// @param build    its list of lobes may be missing where those of columns are all
/// @param columns  of closures_resolve_plain; null: there are none
[[gnu::noinline]] RELIEF_KERNEL void closures_resolve(const GraphLane& at,
                                                      MixtureBuild& build,
                                                      const Principled3Columns* columns = nullptr)
{
  for (std::uint32_t i = 0; i < at.program->num_closures; ++i) {
    const SurfaceClosureSpec& spec = at.program->closures[i];
    const float weight = graph_result(at, spec.first_result);
    if (!(weight > kLeastClosureWeight && weight < kInfinity)) continue;
    build.maths = spec.maths;
    if (columns != nullptr && columns->first_result == spec.first_result) {
      if (build.lobes != nullptr) principled3_lane_add(build, *columns, at.lane);
      continue;
    }
    switch (spec.kind) {
#define CLOSURE(name, Type, most_lobes)                                       \
  case ClosureKind::name:                                                     \
    closure_add(build, spec, weight, closure_inputs<Type##Inputs>(at, spec)); \
    break;
#include "kernel/bsdf/closure_inputs.inc"
      case ClosureKind::kCount:
        break;
    }
  }
}

/// Whether a closure is a plain Principled of 3.4, whose lobes eight hits can be given at once.
RELIEF_KERNEL bool closure_is_plain(const GraphProgramView& program, const SurfaceClosureSpec& spec)
{
  if (spec.kind != ClosureKind::principled3 || spec.distribution != ClosureDistribution::kGgx) return false;
  const auto is_none = [&](std::size_t offset, int numbers) {
    const int first = spec.first_result + 1 + static_cast<int>(offset / sizeof(float));
    for (int i = first; i < first + numbers; ++i) {
      if (program.varying_before[i] != program.varying_before[i + 1] || program.result_values[i] != 0.0f) return false;
    }
    return true;
  };
  using In = Principled3Inputs;
  return is_none(offsetof(In, subsurface), 1) && is_none(offsetof(In, sheen), 1) &&
         is_none(offsetof(In, clearcoat), 1) && is_none(offsetof(In, transmission), 1) &&
         is_none(offsetof(In, tangent), 3);
}

/// The first such closure of a program. @return  null: there is none, or the surface's normal is not its hit's
RELIEF_KERNEL const SurfaceClosureSpec* closures_plain(const GraphProgramView& program)
{
  if (program.surface_normal != kNoGraphOperand) return nullptr;
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    if (closure_is_plain(program, program.closures[i])) return &program.closures[i];
  }
  return nullptr;
}

/// Whether nothing else of a program scatters.
/// @param plain  of closures_plain
RELIEF_KERNEL bool closure_scatters_alone(const GraphProgramView& program, const SurfaceClosureSpec& plain)
{
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    const SurfaceClosureSpec& spec = program.closures[i];
    const bool scatters = spec.kind != ClosureKind::emission && spec.kind != ClosureKind::transparent &&
                          spec.kind != ClosureKind::holdout;
    if (scatters && &spec != &plain) return false;
  }
  return true;
}

/// Resolves a plain Principled closure of eight hits.
/// @param spec       of closures_plain
/// @param registers  of the program's run
RELIEF_KERNEL void closures_resolve_plain(const GraphProgramView& program,
                                          const SurfaceClosureSpec& spec,
                                          const GraphRegisters& registers,
                                          const MixtureBuildLanes& b,
                                          Principled3Columns& columns)
{
  const int first = columns.first_result = spec.first_result;
  const auto raw = [&](int result) {
    const std::uint16_t operand = program.results[result];
    return operand == kNoGraphOperand ? splat8(0.0f) : graph_operand(program, registers, operand);
  };
  Principled3Lanes in;
  in.weight = raw(first);
  const float largest = closure_input(__FLT_MAX__);
  const auto number = [&](std::size_t offset) {
    const int result = first + 1 + static_cast<int>(offset / sizeof(float));
    if (program.varying_before[result] == program.varying_before[result + 1]) {
      return splat8(program.result_values[result]);
    }
    const F8 x = raw(result);
    return x - x == 0.0f ? clamp(x, -largest, largest) : splat8(0.0f);
  };
  const auto vector = [&](std::size_t offset) {
    return Vec3x8{number(offset), number(offset + sizeof(float)), number(offset + 2 * sizeof(float))};
  };
  using In = Principled3Inputs;
  in.base_color = vector(offsetof(In, base_color));
  in.metallic = number(offsetof(In, metallic));
  in.specular = number(offsetof(In, specular));
  in.specular_tint = number(offsetof(In, specular_tint));
  in.roughness = number(offsetof(In, roughness));
  in.anisotropic = number(offsetof(In, anisotropic));
  in.normal = vector(offsetof(In, normal));
  principled3_columns_make(b, in, columns);
}

/// What transparent closures alone let through.
RELIEF_KERNEL Vec3f closures_transparency(const GraphLane& at)
{
  Vec3f sum;
  for (std::uint32_t i = 0; i < at.program->num_closures; ++i) {
    const SurfaceClosureSpec& spec = at.program->closures[i];
    if (spec.kind != ClosureKind::transparent) continue;
    const float weight = graph_result(at, spec.first_result);
    if (weight > kLeastClosureWeight) sum += weight * max(closure_inputs<TransparentInputs>(at, spec).color, Vec3f{});
  }
  return sum;
}

/// What emission closures alone send out.
RELIEF_KERNEL Vec3f closures_emission(const GraphLane& at)
{
  MixtureBuild build{};
  for (std::uint32_t i = 0; i < at.program->num_closures; ++i) {
    const SurfaceClosureSpec& spec = at.program->closures[i];
    if (spec.kind != ClosureKind::emission) continue;
    const float weight = graph_result(at, spec.first_result);
    if (weight > kLeastClosureWeight) closure_add(build, spec, weight, closure_inputs<EmissionInputs>(at, spec));
  }
  return build.emission;
}

}  // namespace relief
