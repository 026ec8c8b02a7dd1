// Boxes that media fill which vary from place to place.
#pragma once

#include <functional>
#include <initializer_list>
#include <utility>
#include <vector>

#include "scene/graph/graph_builder.h"
#include "tests/support/medium_scenes.h"

namespace relief::test {

using Op = GraphOp;
using Q = GraphQuantity;

/// Builds what gives a medium.
struct Varying {
  GraphBuilder build;
  std::vector<VolumeClosureSpec> closures;

  GraphScalar number(double value) { return build.constant(static_cast<float>(value)); }
  GraphScalar z(double scale, double offset)
  {
    return build(Op::multiply_add, {build.quantity(Q::object_z), number(scale), number(offset)});
  }

  /// @param inputs  float by float; the weight is 1
  void add(VolumeClosureKind kind, std::initializer_list<GraphScalar> inputs)
  {
    closures.push_back({kind, build.add_result(number(1))});
    for (const GraphScalar input : inputs) build.add_result(input);
  }

  VolumeProgram program() const { return {build.compile(), closures}; }
};

inline void add_varying(Scene& scene, Mesh mesh, const VolumeProgram& volume, Vec3f at = {})
{
  scene.varying_media.resize(scene.media.size());
  add_medium(scene, std::move(mesh), {}, at);
  scene.varying_media.push_back(volume);
}

/// Of a smooth function from a to b, by Simpson's rule.
inline double integral(double a, double b, const std::function<double(double)>& f)
{
  constexpr int kSteps = 20000;
  const double h = (b - a) / kSteps;
  double sum = f(a) + f(b);
  for (int i = 1; i < kSteps; ++i) sum += (i % 2 == 1 ? 4 : 2) * f(a + h * i);
  return sum * h / 3;
}

}  // namespace relief::test
