// Value graphs of materials at surface points: what they read of a point, and the material with what they give.
#pragma once

#include "kernel/bsdf/surface_params.h"
#include "kernel/graph/graph_mixture.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

/// A world-space vector with Z up.
RELIEF_KERNEL Vec3f graph_z_up(Vec3f v) { return {v.x, -v.z, v.y}; }

/// What a graph may read of a hit beside it.
struct GraphPoint {
  const MeshView* mesh;
  const InstanceView* instance;
  std::uint32_t triangle;
  float bary_u, bary_v;
  const SurfaceHit* hit;
  Vec3f wo;           ///< unit, world
  float uv_width[2];  ///< footprint in each set's uv units
  float footprint;    ///< metres
};

/// Two vectors along the surface as long as the footprint, as Cycles has them: which way they point is left to chance.
struct GraphFootprint {
  Vec3f dPdx, dPdy;  ///< world
};

RELIEF_KERNEL GraphFootprint graph_footprint(const GraphPoint& at)
{
  const Vec3f Ng = dot(at.hit->Ng, at.wo) < 0.0f ? -at.hit->Ng : at.hit->Ng;
  const Frame frame = frame_from_normal(Ng);
  // A ray without width still needs slopes: over what rounding leaves of its point.
  constexpr float kRoundings = 256.0f;
  const float width = max(at.footprint, kRoundings * max_component(at.hit->P_error));
  return {frame.s * width, frame.t * width};
}

/// A point a footprint away.
/// @param moved  its hit, which the result points to
RELIEF_KERNEL GraphPoint graph_point_shifted(const GraphPoint& at, Vec3f by, SurfaceHit& moved)
{
  const TriangleIndices tri = at.mesh->triangles[at.triangle];
  const Affine3& m = at.instance->world_from_object;
  const Vec3f edge1 = transform_vector(m, at.mesh->P[tri.v1] - at.mesh->P[tri.v0]);
  const Vec3f edge2 = transform_vector(m, at.mesh->P[tri.v2] - at.mesh->P[tri.v0]);
  // Least squares: on a displaced surface the vector does not lie in the triangle.
  const float a = dot(edge1, edge1), b = dot(edge1, edge2), c = dot(edge2, edge2);
  const float determinant = difference_of_products(a, c, b, b);
  GraphPoint out = at;
  if (determinant > 0.0f) {
    const float p = dot(edge1, by), q = dot(edge2, by);
    out.bary_u += difference_of_products(c, p, b, q) / determinant;
    out.bary_v += difference_of_products(a, q, b, p) / determinant;
  }
  const SurfaceHit there = surface_hit_make(*at.mesh, *at.instance, at.triangle, out.bary_u, out.bary_v);
  moved = *at.hit;
  moved.P += by;
  moved.uv[0] = there.uv[0];
  moved.uv[1] = there.uv[1];
  moved.color = there.color;
  out.hit = &moved;
  return out;
}

/// @return world space turns as graph_z_up; components of vectors by `axis`
RELIEF_KERNEL float graph_quantity(const GraphPoint& at, GraphQuantity quantity)
{
  using Q = GraphQuantity;
  const auto axis_of = [quantity](Q first) { return static_cast<int>(quantity) - static_cast<int>(first); };
  const auto component = [](Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; };
  const SurfaceHit& hit = *at.hit;
  const float to_viewer = dot(hit.Ng, at.wo) < 0.0f ? -1.0f : 1.0f;
  switch (quantity) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
      return component(transform_point(at.instance->object_from_world, hit.P), axis_of(Q::object_x));
    case Q::generated_x:
    case Q::generated_y:
    case Q::generated_z: {
      if (at.mesh->generated == nullptr) return 0.0f;
      const TriangleIndices tri = at.mesh->triangles[at.triangle];
      const float w0 = 1.0f - at.bary_u - at.bary_v;
      const Vec3f* g = at.mesh->generated;
      return component(w0 * g[tri.v0] + at.bary_u * g[tri.v1] + at.bary_v * g[tri.v2], axis_of(Q::generated_x));
    }
    case Q::uv0_u:
      return hit.uv[0].x;
    case Q::uv0_v:
      return 1.0f - hit.uv[0].y;
    case Q::uv1_u:
      return hit.uv[1].x;
    case Q::uv1_v:
      return 1.0f - hit.uv[1].y;
    case Q::uv0_width:
      return at.uv_width[0];
    case Q::uv1_width:
      return at.uv_width[1];
    case Q::position_x:
    case Q::position_y:
    case Q::position_z:
      return component(graph_z_up(hit.P), axis_of(Q::position_x));
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
      return component(graph_z_up(hit.Ns), axis_of(Q::normal_x)) * to_viewer;
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
      return component(graph_z_up(hit.Ng), axis_of(Q::true_normal_x)) * to_viewer;
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
      return component(graph_z_up(at.wo), axis_of(Q::incoming_x));
    case Q::color_r:
      return hit.color.x;
    case Q::color_g:
      return hit.color.y;
    case Q::color_b:
      return hit.color.z;
    case Q::color_a:
      return hit.color.w;
    case Q::backfacing:
      return to_viewer < 0.0f ? 1.0f : 0.0f;
    case Q::dpdx_x:
    case Q::dpdx_y:
    case Q::dpdx_z:
      return component(graph_z_up(graph_footprint(at).dPdx), axis_of(Q::dpdx_x));
    case Q::dpdy_x:
    case Q::dpdy_y:
    case Q::dpdy_z:
      return component(graph_z_up(graph_footprint(at).dPdy), axis_of(Q::dpdy_x));
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z: {
      // A normal goes back by the transpose of what points go there by.
      const Vec3f n = normalize(transform_normal(at.instance->world_from_object, as_normal(hit.Ns)));
      return component(n, axis_of(Q::object_normal_x)) * to_viewer;
    }
    case Q::kCount:
      break;
  }
  return 0.0f;
}

/// Writes a point's quantities to its lane of the registers.
RELIEF_KERNEL void graph_load_point(const GraphProgramView& program,
                                    const GraphPoint& at,
                                    int lane,
                                    GraphRegisters& registers)
{
  SurfaceHit moved[2];
  GraphPoint points[3] = {at, at, at};
  if (program.is_shifted) {
    const GraphFootprint footprint = graph_footprint(at);
    points[1] = graph_point_shifted(at, footprint.dPdx, moved[0]);
    points[2] = graph_point_shifted(at, footprint.dPdy, moved[1]);
  }
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput input = program.inputs[i];
    registers.lanes[input.register_index][lane] =
        graph_quantity(points[static_cast<int>(input.shift)], input.quantity);
  }
}

/// A graph at one point alone.
/// @param registers  what the result reads
RELIEF_KERNEL GraphLane graph_at_point(GraphRun run,
                                       const GraphProgramView& program,
                                       const TextureView* textures,
                                       const GraphPoint& at,
                                       GraphRegisters& registers)
{
  for (int lane = 0; lane < 8; ++lane) graph_load_point(program, at, lane, registers);
  run(program, textures, registers);
  return {&program, &registers, 0};
}

/// A material at a point with what its graph gives in place of its factors; textures of the same places multiply them still.
template <unsigned kFeatures>
RELIEF_KERNEL SurfaceParams graph_surface_params(Material m,
                                                 const GraphValues& values,
                                                 const TextureView* textures,
                                                 const SurfaceHit& hit,
                                                 const float uv_width[2])
{
  const auto given = [&values](GraphOutput output, auto&& use) {
    if ((values.given >> static_cast<int>(output) & 1u) != 0) use(values.of[static_cast<int>(output)]);
  };
  using O = GraphOutput;
  given(O::base_color, [&m](Vec3f c) { m.base_color = c; });
  given(O::alpha, [&m](Vec3f a) { m.base_alpha = a.x; });
  given(O::metallic, [&m](Vec3f a) { m.metallic = a.x; });
  given(O::roughness, [&m](Vec3f a) { m.roughness = a.x; });
  given(O::transmission, [&m](Vec3f a) { m.transmission = a.x; });
  given(O::clearcoat, [&m](Vec3f a) { m.clearcoat = a.x; });
  given(O::clearcoat_roughness, [&m](Vec3f a) { m.clearcoat_roughness = a.x; });
  given(O::sheen_color, [&m](Vec3f c) { m.sheen_color = c; });
  given(O::sheen_roughness, [&m](Vec3f a) { m.sheen_roughness = a.x; });
  given(O::specular, [&m](Vec3f a) { m.specular = a.x; });
  given(O::specular_color, [&m](Vec3f c) { m.specular_color = c; });
  given(O::emission, [&m](Vec3f c) { m.emission = c; });
  // A graph reads the mesh's colours where it wants them.
  Vec4f color = hit.color;
  given(O::base_color, [&color](Vec3f) { color = {1, 1, 1, color.w}; });
  given(O::alpha, [&color](Vec3f) { color.w = 1; });
  return surface_params_eval<kFeatures>(m, textures, hit.uv, color, uv_width);
}

/// Opacity by a graph, finest texture level.
RELIEF_KERNEL float graph_alpha(const Material& material,
                                GraphRun run,
                                const GraphProgramView& program,
                                const TextureView* textures,
                                const GraphPoint& at)
{
  GraphRegisters registers;
  const GraphValues values = graph_values(graph_at_point(run, program, textures, at, registers));
  return graph_surface_params<kFeatureTextures | kFeatureTransparency>(material, values, textures, *at.hit, at.uv_width)
      .alpha;
}

/// What a material's transparent closures let through, finest texture level.
/// @param program  see Material::transparency_index
RELIEF_KERNEL Vec3f graph_transparency(GraphRun run,
                                       const GraphProgramView& program,
                                       const TextureView* textures,
                                       const GraphPoint& at)
{
  GraphRegisters registers;
  return closures_transparency(graph_at_point(run, program, textures, at, registers));
}

}  // namespace relief
