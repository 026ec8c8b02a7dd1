// A material's closures at a point, their inputs read from its program: a mixture of lobes, emission and transparency.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "kernel/bsdf/mixture_make.h"
#include "kernel/bsdf/principled3_lanes.h"
#include "kernel/bsdf/principled4_lanes.h"
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
/// @param columns  of closures_resolve_columns; null: there are none
[[gnu::noinline]] RELIEF_KERNEL void closures_resolve(const GraphLane& at,
                                                      MixtureBuild& build,
                                                      const LobeColumns* columns = nullptr)
{
  for (std::uint32_t i = 0; i < at.program->num_closures; ++i) {
    const SurfaceClosureSpec& spec = at.program->closures[i];
    const float weight = graph_result(at, spec.first_result);
    if (!(weight > kLeastClosureWeight && weight < kInfinity)) continue;
    build.maths = spec.maths;
    if (columns != nullptr && columns->first_result == spec.first_result) {
      if (build.lobes != nullptr) lobe_columns_list(*columns, at.lane, build);
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

/// Whether a number of a closure is always 0. @param offset  of its inputs
RELIEF_KERNEL bool closure_input_is_none(const GraphProgramView& program,
                                         const SurfaceClosureSpec& spec,
                                         std::size_t offset)
{
  const int i = spec.first_result + 1 + static_cast<int>(offset / sizeof(float));
  return program.varying_before[i] == program.varying_before[i + 1] && program.result_values[i] == 0.0f;
}

RELIEF_KERNEL bool closure_vector_is_none(const GraphProgramView& program,
                                          const SurfaceClosureSpec& spec,
                                          std::size_t offset)
{
  return closure_input_is_none(program, spec, offset) && closure_input_is_none(program, spec, offset + sizeof(float)) &&
         closure_input_is_none(program, spec, offset + 2 * sizeof(float));
}

/// Whether eight hits can be given a closure's lobes at once: it is a Principled one, of nothing but a base, reflections, sheen and a coat.
RELIEF_KERNEL bool closure_has_columns(const GraphProgramView& program, const SurfaceClosureSpec& spec)
{
  const auto is_none = [&](std::size_t offset) { return closure_input_is_none(program, spec, offset); };
  if (spec.kind == ClosureKind::principled3) {
    using In = Principled3Inputs;
    return spec.distribution == ClosureDistribution::kGgx && is_none(offsetof(In, subsurface)) &&
           is_none(offsetof(In, transmission)) && closure_vector_is_none(program, spec, offsetof(In, tangent));
  }
  if (spec.kind != ClosureKind::principled4) return false;
  using In = Principled4Inputs;
  const auto is_white = [&](std::size_t offset) {
    const int first = spec.first_result + 1 + static_cast<int>(offset / sizeof(float));
    const float* const color = program.result_values + first;
    return program.varying_before[first] == program.varying_before[first + 3] && color[0] == 1.0f && color[1] == 1.0f &&
           color[2] == 1.0f;
  };
  return (spec.distribution == ClosureDistribution::kGgx ||
          spec.distribution == ClosureDistribution::kMultiscatterGgx) &&
         is_none(offsetof(In, diffuse_roughness)) && is_none(offsetof(In, subsurface_weight)) &&
         is_none(offsetof(In, transmission_weight)) && is_none(offsetof(In, thin_film_thickness)) &&
         closure_vector_is_none(program, spec, offsetof(In, tangent)) &&
         (is_none(offsetof(In, coat_weight)) || is_white(offsetof(In, coat_tint)));
}

/// The first such closure of a program. @return  null: there is none, or the surface's normal is not its hit's
RELIEF_KERNEL const SurfaceClosureSpec* closures_with_columns(const GraphProgramView& program)
{
  if (program.surface_normal != kNoGraphOperand) return nullptr;
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    if (closure_has_columns(program, program.closures[i])) return &program.closures[i];
  }
  return nullptr;
}

/// Whether nothing else of a program scatters.
/// @param alone  of closures_with_columns
RELIEF_KERNEL bool closure_scatters_alone(const GraphProgramView& program, const SurfaceClosureSpec& alone)
{
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    const SurfaceClosureSpec& spec = program.closures[i];
    const bool scatters = spec.kind != ClosureKind::emission && spec.kind != ClosureKind::transparent &&
                          spec.kind != ClosureKind::holdout;
    if (scatters && &spec != &alone) return false;
  }
  return true;
}

/// What a result of a program is at eight hits.
RELIEF_KERNEL F8 graph_result_lanes(const GraphProgramView& program, const GraphRegisters& registers, int result)
{
  const std::uint16_t operand = program.results[result];
  return operand == kNoGraphOperand ? splat8(0.0f) : graph_operand(program, registers, operand);
}

/// As closure_input of results.
RELIEF_KERNEL F8 closure_input_lanes(const GraphProgramView& program, const GraphRegisters& registers, int result)
{
  if (program.varying_before[result] == program.varying_before[result + 1]) {
    return splat8(program.result_values[result]);
  }
  const float largest = closure_input(__FLT_MAX__);
  const F8 x = graph_result_lanes(program, registers, result);
  return x - x == 0.0f ? clamp(x, -largest, largest) : splat8(0.0f);
}

/// Resolves a closure of eight hits.
/// @param spec       of closures_with_columns
/// @param registers  of the program's run
[[gnu::noinline]] RELIEF_KERNEL void closures_resolve_columns(const GraphProgramView& program,
                                                              const SurfaceClosureSpec& spec,
                                                              const GraphRegisters& registers,
                                                              const MixtureBuildLanes& b,
                                                              LobeColumns& columns)
{
  const int first = columns.first_result = spec.first_result;
  const auto number = [&](std::size_t offset) {
    return closure_input_lanes(program, registers, first + 1 + static_cast<int>(offset / sizeof(float)));
  };
  const auto vector = [&](std::size_t offset) {
    return Vec3x8{number(offset), number(offset + sizeof(float)), number(offset + 2 * sizeof(float))};
  };
  const F8 weight = graph_result_lanes(program, registers, first);
  if (spec.kind == ClosureKind::principled3) {
    using In = Principled3Inputs;
    Principled3Lanes in;
    in.weight = weight;
    in.base_color = vector(offsetof(In, base_color));
    in.metallic = number(offsetof(In, metallic));
    in.specular = number(offsetof(In, specular));
    in.specular_tint = number(offsetof(In, specular_tint));
    in.roughness = number(offsetof(In, roughness));
    in.anisotropic = number(offsetof(In, anisotropic));
    in.normal = vector(offsetof(In, normal));
    in.has_sheen = !closure_input_is_none(program, spec, offsetof(In, sheen));
    if (in.has_sheen) {
      in.sheen = number(offsetof(In, sheen));
      in.sheen_tint = number(offsetof(In, sheen_tint));
    }
    in.has_coat = !closure_input_is_none(program, spec, offsetof(In, clearcoat));
    if (in.has_coat) {
      in.coat = number(offsetof(In, clearcoat));
      in.coat_roughness = number(offsetof(In, clearcoat_roughness));
      in.coat_normal = vector(offsetof(In, clearcoat_normal));
    }
    principled3_columns_make(b, in, columns);
    return;
  }
  using In = Principled4Inputs;
  Principled4Lanes in;
  in.maths = spec.maths;
  in.gives_back = spec.distribution == ClosureDistribution::kMultiscatterGgx;
  in.weight = weight;
  in.base_color = vector(offsetof(In, base_color));
  in.metallic = number(offsetof(In, metallic));
  in.roughness = number(offsetof(In, roughness));
  in.ior = number(offsetof(In, ior));
  in.specular_ior_level = number(offsetof(In, specular_ior_level));
  in.specular_tint = vector(offsetof(In, specular_tint));
  in.anisotropic = number(offsetof(In, anisotropic));
  in.normal = vector(offsetof(In, normal));
  in.has_sheen = !closure_input_is_none(program, spec, offsetof(In, sheen_weight));
  in.has_coat = !closure_input_is_none(program, spec, offsetof(In, coat_weight));
  if (in.has_sheen || in.has_coat) {
    in.coat = number(offsetof(In, coat_weight));
    in.coat_normal = vector(offsetof(In, coat_normal));
  }
  if (in.has_sheen) {
    in.sheen = number(offsetof(In, sheen_weight));
    in.sheen_roughness = number(offsetof(In, sheen_roughness));
    in.sheen_tint = vector(offsetof(In, sheen_tint));
  }
  if (in.has_coat) {
    in.coat_roughness = number(offsetof(In, coat_roughness));
    in.coat_ior = number(offsetof(In, coat_ior));
  }
  principled4_columns_make(b, in, columns);
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

/// Lanes at which nothing but transparent closures weighs, bit by bit.
RELIEF_KERNEL unsigned closures_clear(const GraphProgramView& program, const GraphRegisters& registers)
{
  I8 weighs{};
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    const SurfaceClosureSpec& spec = program.closures[i];
    if (spec.kind != ClosureKind::transparent) {
      weighs |= graph_result_lanes(program, registers, spec.first_result) > kLeastClosureWeight;
    }
  }
  return ~mask_of(weighs) & registers.used;
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
