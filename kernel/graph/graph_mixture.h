// A material's closures at a point, their inputs read from its program: a mixture of lobes, emission and transparency.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "kernel/bsdf/mixture_make.h"
#include "kernel/bsdf/plain_lanes.h"
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
    if (columns != nullptr && i < 64 && (columns->closures >> i & 1u) != 0) {
      if (build.lobes != nullptr) lobe_columns_list(*columns, static_cast<int>(i), at.lane, build);
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

/// How many columns of lobes a closure may need that eight hits can be given at once. @return  0: they cannot
RELIEF_KERNEL int closure_most_columns(const GraphProgramView& program, const SurfaceClosureSpec& spec)
{
  const auto is_none = [&](std::size_t offset) { return closure_input_is_none(program, spec, offset); };
  const auto vector_is_none = [&](std::size_t offset) { return closure_vector_is_none(program, spec, offset); };
  const bool is_ggx = spec.distribution == ClosureDistribution::kGgx;
  const bool scatters_once = is_ggx || spec.distribution == ClosureDistribution::kBeckmann;
  switch (spec.kind) {
    case ClosureKind::diffuse:
      return is_none(offsetof(DiffuseInputs, roughness)) ? 1 : 0;
    case ClosureKind::translucent:
      return 1;
    case ClosureKind::glossy:
      return scatters_once && vector_is_none(offsetof(GlossyInputs, tangent)) ? 1 : 0;
    case ClosureKind::refraction:
      return scatters_once ? 1 : 0;
    case ClosureKind::glass:
      return scatters_once && spec.maths < Maths::k43 ? 2 : 0;
    case ClosureKind::principled3: {
      using In = Principled3Inputs;
      const bool has_more = !is_none(offsetof(In, subsurface)) || !is_none(offsetof(In, transmission)) ||
                            !vector_is_none(offsetof(In, tangent));
      if (!is_ggx || has_more) return 0;
      return 2 + (is_none(offsetof(In, sheen)) ? 0 : 1) + (is_none(offsetof(In, clearcoat)) ? 0 : 1);
    }
    case ClosureKind::principled4: {
      using In = Principled4Inputs;
      const auto is_white = [&](std::size_t offset) {
        const int first = spec.first_result + 1 + static_cast<int>(offset / sizeof(float));
        const float* const color = program.result_values + first;
        return program.varying_before[first] == program.varying_before[first + 3] && color[0] == 1.0f &&
               color[1] == 1.0f && color[2] == 1.0f;
      };
      const bool has_coat = !is_none(offsetof(In, coat_weight));
      const bool has_more = !is_none(offsetof(In, diffuse_roughness)) || !is_none(offsetof(In, subsurface_weight)) ||
                            !is_none(offsetof(In, transmission_weight)) ||
                            !is_none(offsetof(In, thin_film_thickness)) || !vector_is_none(offsetof(In, tangent)) ||
                            (has_coat && !is_white(offsetof(In, coat_tint)));
      if (!(is_ggx || spec.distribution == ClosureDistribution::kMultiscatterGgx) || has_more) return 0;
      const bool is_metal = !is_none(offsetof(In, metallic));
      return 2 + (is_metal ? 1 : 0) + (is_none(offsetof(In, sheen_weight)) ? 0 : 1) + (has_coat ? 1 : 0);
    }
    default:
      return 0;
  }
}

/// Closures of a program that eight hits can be given at once, as many as there are columns for.
/// @return  bit by bit; 0: there is none, or the surface's normal is not its hit's
RELIEF_KERNEL std::uint64_t closures_with_columns(const GraphProgramView& program)
{
  std::uint64_t found = 0;
  if (program.surface_normal != kNoGraphOperand) return found;
  int left = kMostLobeColumns;
  for (std::uint32_t i = 0; i < program.num_closures && i < 64; ++i) {
    const int most = closure_most_columns(program, program.closures[i]);
    if (most == 0 || most > left) continue;
    found |= std::uint64_t{1} << i;
    left -= most;
  }
  return found;
}

/// Whether nothing else of a program scatters.
/// @param columns  of closures_with_columns
RELIEF_KERNEL bool closures_scatter_alone(const GraphProgramView& program, std::uint64_t columns)
{
  for (std::uint32_t i = 0; i < program.num_closures; ++i) {
    const ClosureKind kind = program.closures[i].kind;
    const bool scatters =
        kind != ClosureKind::emission && kind != ClosureKind::transparent && kind != ClosureKind::holdout;
    if (scatters && !(i < 64 && (columns >> i & 1u) != 0)) return false;
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

/// Adds the columns of a closure.
/// @pre  closure_most_columns
RELIEF_KERNEL void closure_add_columns(const GraphProgramView& program,
                                       const SurfaceClosureSpec& spec,
                                       const GraphRegisters& registers,
                                       const MixtureBuildLanes& b,
                                       LobeColumns& columns)
{
  const int first = spec.first_result;
  const auto number = [&](std::size_t offset) {
    return closure_input_lanes(program, registers, first + 1 + static_cast<int>(offset / sizeof(float)));
  };
  const auto vector = [&](std::size_t offset) {
    return Vec3x8{number(offset), number(offset + sizeof(float)), number(offset + 2 * sizeof(float))};
  };
  const F8 weight = graph_result_lanes(program, registers, first);
  const auto facets = [&]<typename In>(const In&) {
    FacetLanes in;
    in.weight = weight;
    in.color = vector(offsetof(In, color));
    in.roughness = number(offsetof(In, roughness));
    in.normal = vector(offsetof(In, normal));
    if constexpr (requires { In::ior; }) in.ior = number(offsetof(In, ior));
    if constexpr (requires { In::anisotropy; }) in.anisotropy = number(offsetof(In, anisotropy));
    return in;
  };
  if (spec.kind == ClosureKind::diffuse) {
    using In = DiffuseInputs;
    diffuse_columns_add(b, spec, weight, vector(offsetof(In, color)), vector(offsetof(In, normal)), columns);
    return;
  }
  if (spec.kind == ClosureKind::translucent) {
    using In = TranslucentInputs;
    translucent_columns_add(b, spec, weight, vector(offsetof(In, color)), vector(offsetof(In, normal)), columns);
    return;
  }
  if (spec.kind == ClosureKind::glossy) return glossy_columns_add(b, spec, facets(GlossyInputs{}), columns);
  if (spec.kind == ClosureKind::refraction) return refraction_columns_add(b, spec, facets(RefractionInputs{}), columns);
  if (spec.kind == ClosureKind::glass) return glass3_columns_add(b, spec, facets(GlassInputs{}), columns);
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

/// Resolves closures of eight hits.
/// @param closures   of closures_with_columns
/// @param registers  of the program's run
[[gnu::noinline]] RELIEF_KERNEL void closures_resolve_columns(const GraphProgramView& program,
                                                              std::uint64_t closures,
                                                              const GraphRegisters& registers,
                                                              const MixtureBuildLanes& b,
                                                              LobeColumns& columns)
{
  lobe_columns_begin(columns);
  columns.closures = closures;
  columns.on_curves = b.on_curves;
  for (std::uint64_t left = closures; left != 0; left &= left - 1) {
    const int i = __builtin_ctzll(left), before = columns.num_lobes;
    closure_add_columns(program, program.closures[i], registers, b, columns);
    for (int lobe = before; lobe < columns.num_lobes; ++lobe) columns.lobes[lobe].closure = i;
  }
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
