// A material's closures at a point, their inputs read from its program: a mixture of lobes, emission and transparency.
#pragma once

#include <cstring>
#include <type_traits>

#include "kernel/bsdf/mixture_make.h"
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
[[gnu::noinline]] RELIEF_KERNEL void closures_resolve(const GraphLane& at, MixtureBuild& build)
{
  for (std::uint32_t i = 0; i < at.program->num_closures; ++i) {
    const SurfaceClosureSpec& spec = at.program->closures[i];
    const float weight = graph_result(at, spec.first_result);
    if (!(weight > kLeastClosureWeight && weight < kInfinity)) continue;
    build.maths = spec.maths;
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
