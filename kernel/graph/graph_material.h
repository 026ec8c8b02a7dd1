// Value graphs of materials at surface points: what they read of a point, and the material with what they give.
#pragma once

#include "kernel/bsdf/surface_params.h"
#include "kernel/graph/graph_mixture.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/shape/primitive.h"

namespace relief {

/// A world-space vector with Z up.
RELIEF_KERNEL Vec3f graph_z_up(Vec3f v) { return {v.x, -v.z, v.y}; }

/// Two vectors along the surface as long as the footprint.
struct GraphFootprint {
  Vec3f dPdx, dPdy;  ///< world
};

/// What a graph may read of a hit beside it. Points that are on no primitive have what is read of one nowhere: attributes are 0, edges
/// infinitely far, footprints points; generated coordinates are those of the object.
struct GraphPoint {
  PrimitivePlace place;
  const InstanceView* instance;  ///< kNoInstance: there are no values of one either
  const SurfaceHit* hit;
  Vec3f wo;           ///< unit, world
  float uv_width[2];  ///< footprint in each set's uv units
  float footprint;    ///< metres
  const GraphScene* scene;
  GraphRay ray;
  Vec3f P_object{};                                ///< set by graph_load_point
  const GraphFootprint* footprint_axes = nullptr;  ///< see graph_footprint; null: not known yet
};

/// Least footprint over the rounding of its point: a ray without width still needs slopes.
inline constexpr float kFootprintRoundings = 256.0f;

RELIEF_KERNEL GraphFootprint graph_footprint(const GraphPoint& at)
{
  if (at.footprint_axes != nullptr) return *at.footprint_axes;
  if (at.place.mesh == nullptr) return {};
  const Vec3f Ng = dot(at.hit->Ng, at.wo) < 0.0f ? -at.hit->Ng : at.hit->Ng;
  // Cycles' axes: a slope is a forward difference, so that bumps of few pixels look otherwise along others.
  const Vec3f across = cross(Vec3f{1, 1, -1}, Ng);
  const bool is_parallel = !(length_squared(across) > 1e-12f);
  const Vec3f x = is_parallel ? frame_from_normal(Ng).s : normalize(across);
  const float width = max(at.footprint, kFootprintRoundings * max_component(at.hit->P_error));
  return {x * width, cross(Ng, x) * width};
}

/// A point some way along the surface, whose slopes bumps are made of. On the back of a face what the vertices carry is read
/// as far on the other side, as Cycles does: so that a bump seen from behind is a hollow.
/// @param moved  its hit, which the result points to
RELIEF_KERNEL GraphPoint graph_point_shifted(const GraphPoint& at, Vec3f by, SurfaceHit& moved)
{
  GraphPoint out = at;
  out.place = primitive_moved(at.place, *at.instance, by, dot(at.hit->Ng, at.wo) < 0.0f ? -1.0f : 1.0f);
  moved = *at.hit;
  moved.P += by;
  primitive_interpolate(out.place, &moved);
  out.P_object = transform_point(at.instance->object_from_world, moved.P);
  out.hit = &moved;
  return out;
}

/// A named attribute at a point: of the mesh, else of the instance, else 0.
/// @param component  0 to 2; 3: alpha; 4: as one number
RELIEF_KERNEL float graph_attribute(const GraphPoint& at, std::uint32_t name, int component)
{
  const std::uint32_t num_columns = at.place.mesh != nullptr ? at.place.mesh->num_columns : 0u;
  for (std::uint32_t i = 0; i < num_columns; ++i) {
    const MeshColumn& column = at.place.mesh->columns[i];
    if (column.name != name) continue;
    const std::uint32_t n = column.num_components;
    const auto number = [&](std::uint32_t c) { return primitive_column(at.place, column, c); };
    if (component == 4) return n < 3 ? number(0) : (number(0) + number(1) + number(2)) * (1.0f / 3.0f);
    if (component == 3) return n == 4 ? number(3) : 1.0f;
    if (n == 1) return number(0);
    return static_cast<std::uint32_t>(component) < n ? number(static_cast<std::uint32_t>(component)) : 0.0f;
  }
  const bool has_values = at.instance->index != kNoInstance;
  for (std::uint32_t i = 0; has_values && i < at.scene->num_columns; ++i) {
    if (at.scene->columns[i].name != name) continue;
    const float* v = at.scene->columns[i].values + 4 * std::size_t{at.instance->index};
    return component == 4 ? (v[0] + v[1] + v[2]) * (1.0f / 3.0f) : v[component];
  }
  return component == 3 ? 1.0f : 0.0f;
}

/// The mesh's normal at a point, interpolated and not made unit, object space.
RELIEF_KERNEL Vec3f graph_vertex_normal(const GraphPoint& at)
{
  const Vec3f n = primitive_vertex_normal(at.place);
  if (!is_zero(n)) return n;
  return normalize(transform_normal(at.instance->world_from_object, as_normal(at.hit->Ng)));
}

/// What normal maps stand over: the mesh's normal likewise, or that of a displaced surface, unit.
RELIEF_KERNEL Vec3f graph_smooth_normal(const GraphPoint& at)
{
  if ((at.instance->flags & kDisplaced) == 0) return graph_vertex_normal(at);
  // A normal goes back by the transpose of what points go there by.
  return normalize(transform_normal(at.instance->world_from_object, as_normal(at.hit->Ns)));
}

/// Element of the matrix between a space and the world, both with Z up, of 3 rows and 4 columns.
/// @param m        takes the world, Y up, to the space
/// @param element  row by row
RELIEF_KERNEL float graph_from_world(const Affine3& m, int element)
{
  const int column = element & 3;
  const Vec3f v = column == 0 ? m.x : column == 1 ? -m.z : column == 2 ? m.y : m.p;
  const int row = element >> 2;
  return row == 0 ? v.x : row == 1 ? v.y : v.z;
}

/// @param m  takes the space to the world, Y up
RELIEF_KERNEL float graph_to_world(const Affine3& m, int element)
{
  const int column = element & 3;
  const Vec3f v = graph_z_up(column == 0 ? m.x : column == 1 ? m.y : column == 2 ? m.z : m.p);
  const int row = element >> 2;
  return row == 0 ? v.x : row == 1 ? v.y : v.z;
}

/// Place of a point in the picture.
/// @param axis  0: from the left; 1: from the bottom; 0 to 1
RELIEF_KERNEL float graph_window(const GraphScene& scene, Vec3f P, int axis)
{
  const Camera& camera = scene.camera;
  Vec3f p = transform_point(scene.camera_from_world, P);
  if (__builtin_expect(camera.projection == Projection::kPanoramic, 0)) {
    const Vec2f at = panorama_project(camera.panorama, camera_from_graph_frame(camera, p));
    p = {at.x, at.y, p.z};
  }
  float seen = axis == 0 ? p.x / camera.half_width : p.y / camera.half_height;
  if (camera.projection == Projection::kPerspective) seen /= -p.z;
  return 0.5f + 0.5f * seen - (axis == 0 ? camera.shift_x : camera.shift_y);
}

/// Element of one of the matrices between spaces, all with Z up and the camera looking along −Z.
RELIEF_KERNEL float graph_matrix_element(const GraphPoint& at, GraphQuantity quantity, std::uint16_t index)
{
  using Q = GraphQuantity;
  switch (quantity) {
    case Q::world_from_object:
      return graph_to_world(at.instance->world_from_object, index);
    case Q::object_from_world:
      return graph_from_world(at.instance->object_from_world, index);
    case Q::camera_from_world: {
      const float element = graph_from_world(at.scene->camera_from_world, index);
      return index >= 8 ? -element : element;
    }
    case Q::world_from_camera: {
      const float element = graph_to_world(at.scene->camera.world_from_camera, index);
      return (index & 3) == 2 ? -element : element;
    }
    default:
      return 0.0f;
  }
}

/// A component of a vector.
RELIEF_KERNEL float graph_component(Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// What a graph reads of the primitive that a point is on.
/// @param index  as of graph_quantity, which asks this for what it has not
RELIEF_KERNEL float graph_primitive_quantity(const GraphPoint& at, GraphQuantity quantity, std::uint16_t index)
{
  using Q = GraphQuantity;
  const auto axis_of = [quantity](Q first) { return static_cast<int>(quantity) - static_cast<int>(first); };
  const bool is_on_primitive = at.place.mesh != nullptr;
  switch (quantity) {
    case Q::generated_x:
    case Q::generated_y:
    case Q::generated_z:
      return graph_component(is_on_primitive ? primitive_generated(at.place) : at.P_object, axis_of(Q::generated_x));
    case Q::vertex_normal_x:
    case Q::vertex_normal_y:
    case Q::vertex_normal_z:
      return graph_component(graph_vertex_normal(at), axis_of(Q::vertex_normal_x));
    case Q::smooth_normal_x:
    case Q::smooth_normal_y:
    case Q::smooth_normal_z:
      return graph_component(graph_smooth_normal(at), axis_of(Q::smooth_normal_x));
    case Q::attribute_value:
      return graph_attribute(at, index, 4);
    case Q::attribute_x:
    case Q::attribute_y:
    case Q::attribute_z:
    case Q::attribute_alpha:
      return graph_attribute(at, index, axis_of(Q::attribute_x));
    case Q::parametric_x:
      return is_on_primitive ? 1.0f - at.place.u - at.place.v : at.hit->uv[0].x;
    case Q::parametric_y:
      return is_on_primitive ? at.place.u : 1.0f - at.hit->uv[0].y;
    case Q::tangent_normal_x:
    case Q::tangent_normal_y:
    case Q::tangent_normal_z: {
      if (!is_on_primitive || !has_strands(*at.instance)) return 0.0f;
      const Vec3f tangent = primitive_strand(at.place, *at.instance, at.wo);
      const Vec3f across = at.wo - tangent * dot(tangent, at.wo);
      return is_zero(across) ? 0.0f : graph_component(graph_z_up(normalize(across)), axis_of(Q::tangent_normal_x));
    }
    case Q::edge_distance:
      return primitive_edge_distance(at.place, *at.instance, at.hit->P);
    case Q::instance:
      return at.instance->index != kNoInstance ? static_cast<float>(at.instance->index) : -1.0f;
    default:
      return 0.0f;
  }
}

/// @param  index  of quantities that are many
/// @return world space turns as graph_z_up; components of vectors by `axis`
RELIEF_KERNEL float graph_quantity(const GraphPoint& at, GraphQuantity quantity, std::uint16_t index)
{
  using Q = GraphQuantity;
  const auto axis_of = [quantity](Q first) { return static_cast<int>(quantity) - static_cast<int>(first); };
  const SurfaceHit& hit = *at.hit;
  const float to_viewer = dot(hit.Ng, at.wo) < 0.0f ? -1.0f : 1.0f;
  switch (quantity) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
      return graph_component(at.P_object, axis_of(Q::object_x));
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
      return graph_component(graph_z_up(hit.P), axis_of(Q::position_x));
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
      return graph_component(graph_z_up(hit.Ns), axis_of(Q::normal_x)) * to_viewer;
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
      return graph_component(graph_z_up(hit.Ng), axis_of(Q::true_normal_x)) * to_viewer;
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
      return graph_component(graph_z_up(at.wo), axis_of(Q::incoming_x));
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
      return graph_component(graph_z_up(graph_footprint(at).dPdx), axis_of(Q::dpdx_x));
    case Q::dpdy_x:
    case Q::dpdy_y:
    case Q::dpdy_z:
      return graph_component(graph_z_up(graph_footprint(at).dPdy), axis_of(Q::dpdy_x));
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z: {
      // A normal goes back by the transpose of what points go there by.
      const Vec3f n = normalize(transform_normal(at.instance->world_from_object, as_normal(hit.Ns)));
      return graph_component(n, axis_of(Q::object_normal_x)) * to_viewer;
    }
    case Q::world_from_object:
    case Q::object_from_world:
    case Q::camera_from_world:
    case Q::world_from_camera:
      return graph_matrix_element(at, quantity, index);
    case Q::ray_kind:
      return (at.ray.kinds >> index & 1u) != 0 ? 1.0f : 0.0f;
    case Q::ray_depth:
      return static_cast<float>(index == static_cast<int>(GraphRayDepth::kTransparent)
                                    ? at.ray.transparent
                                    : at.ray.depths >> (8 * index) & 0xffu);
    case Q::ray_origin_x:
    case Q::ray_origin_y:
    case Q::ray_origin_z: {
      const bool is_front = (to_viewer > 0.0f) == (index == 0);
      return graph_component(graph_z_up(surface_hit_origin(hit, hit.P, is_front)), axis_of(Q::ray_origin_x));
    }
    case Q::ray_length:
      return at.ray.length;
    case Q::window_x:
    case Q::window_y:
      return graph_window(*at.scene, hit.P, axis_of(Q::window_x));
    case Q::shutter_time:
      return at.ray.time;
    default:
      return graph_primitive_quantity(at, quantity, index);
  }
}

/// As graph_load_point, of a program that reads points beside it.
/// @param at  whose P_object is set
template <typename Wanted>
RELIEF_KERNEL void graph_load_shifted(const GraphProgramView& program,
                                      GraphPoint at,
                                      int lane,
                                      GraphRegisters& registers,
                                      const Wanted& wanted)
{
  const GraphFootprint footprint = graph_footprint(at);
  // Whatever else a point has, it is on the same triangle.
  at.footprint_axes = &footprint;
  SurfaceHit moved[2];
  GraphPoint shifted[2];
  const GraphPoint* const points[3] = {&at, &shifted[0], &shifted[1]};
  float width = -1.0f;  // by which the points are moved
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput input = program.inputs[i];
    if (!wanted(input)) continue;
    // Few programs have bumps of several widths.
    if (input.shift != GraphShift::kNone && input.width != width) {
      width = input.width;
      shifted[0] = graph_point_shifted(at, footprint.dPdx * width, moved[0]);
      shifted[1] = graph_point_shifted(at, footprint.dPdy * width, moved[1]);
    }
    registers.lanes[input.register_index][lane] =
        graph_quantity(*points[static_cast<int>(input.shift)], input.quantity, input.index);
  }
}

/// Writes a point's quantities to its lane of the registers.
/// @param wanted  inputs that are written
template <typename Wanted>
RELIEF_KERNEL void graph_load_point(const GraphProgramView& program,
                                    GraphPoint at,
                                    int lane,
                                    GraphRegisters& registers,
                                    const Wanted& wanted)
{
  if (program.num_inputs == 0) return;
  at.P_object = transform_point(at.instance->object_from_world, at.hit->P);
  if (program.is_shifted) return graph_load_shifted(program, at, lane, registers, wanted);
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput& input = program.inputs[i];
    if (!wanted(input)) continue;
    registers.lanes[input.register_index][lane] = graph_quantity(at, input.quantity, input.index);
  }
}
RELIEF_KERNEL void graph_load_point(const GraphProgramView& program,
                                    const GraphPoint& at,
                                    int lane,
                                    GraphRegisters& registers)
{
  graph_load_point(program, at, lane, registers, [](const GraphInput&) { return true; });
}

/// A graph at one point alone.
/// @param registers  what the result reads
RELIEF_KERNEL GraphLane graph_at_point(GraphRun run,
                                       const GraphProgramView& program,
                                       const TextureView* textures,
                                       const GraphPoint& at,
                                       GraphRegisters& registers)
{
  graph_load_point(program, at, 0, registers);
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    F8& lanes = registers.lanes[program.inputs[i].register_index];
    lanes = splat8(lanes[0]);
  }
  registers.used = 1;
  // As in Cycles, what shadow rays meet does not look around.
  const bool is_shadow = (at.ray.kinds >> static_cast<int>(GraphRayKind::kShadow) & 1u) != 0;
  registers.rays = is_shadow ? GraphRays{} : at.scene->rays;
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
  given(O::emission, [&m](Vec3f c) { m.emission = is_finite(c) ? c : Vec3f{}; });
  // A graph reads the mesh's colours where it wants them.
  Vec4f color = hit.color;
  given(O::base_color, [&color](Vec3f) { color = {1, 1, 1, color.w}; });
  given(O::alpha, [&color](Vec3f) { color.w = 1; });
  return surface_params_eval<kFeatures>(m, textures, hit.uv, color, uv_width);
}

/// Opacity by a graph, finest texture level.
/// @param lane  of the material's program
/// @param hit   that it ran for
RELIEF_KERNEL float graph_alpha(const Material& material,
                                const GraphLane& lane,
                                const TextureView* textures,
                                const SurfaceHit& hit)
{
  constexpr float kFinest[2] = {0.0f, 0.0f};
  return graph_surface_params<kFeatureTextures | kFeatureTransparency>(material, graph_values(lane), textures, hit,
                                                                       kFinest)
      .alpha;
}

}  // namespace relief
