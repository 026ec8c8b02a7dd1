// A medium that varies from place to place: its closures' inputs are what a value graph gives, and a grid bounds what they come to.
#pragma once

#include <new>

#include "kernel/globals.h"
#include "kernel/graph/graph_material.h"
#include "kernel/volume/medium_closures.h"
#include "kernel/volume/rate_grid.h"
#include "kernel/volume/varying_place.h"

namespace relief {

RELIEF_KERNEL const VaryingPlace& varying_place(const VaryingMedium& medium, std::int32_t instance)
{
  return medium.places[medium.place_of_instance != nullptr ? medium.place_of_instance[instance] : 0];
}

/// In place of the object of what fills the world: its space is the world's, with Z up.
inline constexpr Affine3 kZUpFromWorld{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}, {}};
inline constexpr Affine3 kWorldFromZUp{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}, {}};

/// In place of the object of what fills the world.
inline constexpr InstanceView kWorldObject{.world_from_object = kWorldFromZUp,
                                           .object_from_world = kZUpFromWorld,
                                           .index = kNoInstance};

/// @param instance  whose medium it is, or kWholeWorld
RELIEF_KERNEL const InstanceView& medium_object(const KernelGlobals& g, std::int32_t instance)
{
  return instance == kWholeWorld ? kWorldObject : g.instances[instance];
}

/// A point of a medium and what a graph reads there. As in Cycles, the normal is against the ray, which has no length.
struct MediumPoint {
  const GraphScene* scene;
  const InstanceView* node;
  Vec3f wo;
  GraphRay ray;
  SurfaceHit hit;
  Vec3f P_object, P_generated;
};

RELIEF_KERNEL MediumPoint medium_point_make(const KernelGlobals& g,
                                            const VaryingPlace& place,
                                            std::int32_t instance,
                                            Vec3f P,
                                            Vec3f D,
                                            GraphRay ray)
{
  MediumPoint at{&g.graph_scene, &medium_object(g, instance), -D, ray, {}, {}, {}};
  at.hit.P = P;
  at.hit.Ng = at.hit.Ns = at.wo;
  // (0, 0) to graphs, whose v goes up.
  at.hit.uv[0] = at.hit.uv[1] = {0, 1};
  at.P_object = transform_point(at.node->object_from_world, P);
  at.P_generated = instance != kWholeWorld ? at.P_object * place.generated_scale + place.generated_offset : at.P_object;
  at.ray.length = 0;
  return at;
}

RELIEF_KERNEL float medium_quantity(const MediumPoint& at, const GraphInput& input)
{
  using Q = GraphQuantity;
  if (input.quantity == Q::generated_x) return at.P_generated.x;
  if (input.quantity == Q::generated_y) return at.P_generated.y;
  if (input.quantity == Q::generated_z) return at.P_generated.z;
  GraphPoint point{{}, at.node, &at.hit, at.wo, {0.0f, 0.0f}, 0.0f, at.scene, at.ray};
  point.P_object = at.P_object;
  return graph_quantity(point, input.quantity, input.index);
}

/// Most points that are asked for at once.
inline constexpr int kMediumPoints = 8;

/// Fills a program's inputs at up to eight points, where all it reads are their coordinates.
/// @return false: it reads other things, too
RELIEF_KERNEL bool medium_points_load(const KernelGlobals& g,
                                      const VaryingMedium& medium,
                                      std::int32_t instance,
                                      const Vec3f* P,
                                      int count,
                                      GraphRegisters& registers)
{
  using Q = GraphQuantity;
  const VaryingPlace& place = varying_place(medium, instance);
  F8 x{}, y{}, z{};
  for (int k = 0; k < count; ++k) {
    x[k] = P[k].x;
    y[k] = P[k].y;
    z[k] = P[k].z;
  }
  const Affine3& m = medium_object(g, instance).object_from_world;
  const F8 object[3] = {x * m.x.x + y * m.y.x + z * m.z.x + m.p.x, x * m.x.y + y * m.y.y + z * m.z.y + m.p.y,
                        x * m.x.z + y * m.y.z + z * m.z.z + m.p.z};
  for (std::uint32_t i = 0; i < medium.program.num_inputs; ++i) {
    const GraphInput& input = medium.program.inputs[i];
    F8& lanes = registers.lanes[input.register_index];
    const auto axis_of = [&input](Q first) { return static_cast<int>(input.quantity) - static_cast<int>(first); };
    switch (input.quantity) {
      case Q::object_x:
      case Q::object_y:
      case Q::object_z:
        lanes = object[axis_of(Q::object_x)];
        break;
      case Q::generated_x:
      case Q::generated_y:
      case Q::generated_z: {
        const int axis = axis_of(Q::generated_x);
        const auto part = [axis](Vec3f v) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; };
        lanes = instance == kWholeWorld ? object[axis]
                                        : object[axis] * part(place.generated_scale) + part(place.generated_offset);
        break;
      }
      case Q::position_x:
        lanes = x;
        break;
      case Q::position_y:
        lanes = -z;
        break;
      case Q::position_z:
        lanes = y;
        break;
      default:
        return false;
    }
  }
  return true;
}

/// What a medium is at up to eight points of a ray.
/// @param instance  whose it is, or kWholeWorld
/// @param media     room for `count`
RELIEF_KERNEL void varying_medium_eval(const KernelGlobals& g,
                                       const VaryingMedium& medium,
                                       std::int32_t instance,
                                       const Vec3f* P,
                                       int count,
                                       Vec3f D,
                                       const GraphRay& ray,
                                       Medium* media)
{
  GraphRegisters registers;
  registers.used = (1u << count) - 1u;
  const VaryingPlace& place = varying_place(medium, instance);
  if (!medium_points_load(g, medium, instance, P, count, registers)) {
    for (int k = 0; k < count; ++k) {
      const MediumPoint point = medium_point_make(g, place, instance, P[k], D, ray);
      for (std::uint32_t i = 0; i < medium.program.num_inputs; ++i) {
        const GraphInput& input = medium.program.inputs[i];
        registers.lanes[input.register_index][k] = medium_quantity(point, input);
      }
    }
  }
  g.run_graph(medium.program, g.textures, registers);
  for (int k = 0; k < count; ++k) {
    new (&media[k]) Medium(medium_resolve({medium.closures, medium.num_closures}, {&medium.program, &registers, k}));
    const float most = max_component(media[k].sigma_t);
    const float densest = place.densest / static_cast<float>(1u << rate_grid_level(place.rates, P[k]));
    if (!(most > densest)) continue;
    const float scale = densest / most;
    media[k].sigma_t *= scale;
    for (int i = 0; i < media[k].num_phases; ++i) media[k].phases[i].sigma_s *= scale;
  }
}

}  // namespace relief
