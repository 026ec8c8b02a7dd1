#include "displacement/displacement_set.h"

namespace relief {

namespace {

/// Brings a point's place from a part of a triangle to the triangle.
void set_base_place(const ProceduralField& field, DisplacedPoint* point)
{
  const LatticeTriangle& part = field.triangles()[point->triangle];
  const Vec2f place = part.base_weights(point->u, point->v);
  point->triangle = part.base;
  point->u = place.x;
  point->v = place.y;
}

}  // namespace

void DisplacementSet::leave_walls(const PreparedMesh& d, const InstanceView& placement, DisplacedPoint* point) const
{
  // As on plain meshes: the sharper the angle, the farther from a wall a height above the surface is clear of it.
  constexpr double kHeights = 16;
  const LeavingErrors errors = leaving_errors(placement, point->P, point->Ng);
  const double u = static_cast<double>(point->u), v = static_cast<double>(point->v);
  const Vec3d leave =
      d.walls.leave(meshes_[static_cast<std::size_t>(d.mesh_index)], point->triangle, {1 - u - v, u, v},
                    to_double(point->Ng), kHeights * length(to_double(errors.offset)) + length(errors.error));
  if (dot(leave, leave) == 0) return;
  if (is_zero(point->leave)) point->leave = errors.offset;
  point->leave += to_float(leave);
}

DisplacedPoint DisplacementSet::resolve(std::size_t instance,
                                        const InstanceView& placement,
                                        std::uint32_t primitive,
                                        EmbreeHitRecord record) const
{
  const PreparedMesh& d = displaced(instance);
  if (d.tiles != nullptr) {
    DisplacedPoint out = d.tiles->resolve(placement, primitive, record);
    if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
    return out;
  }
  if (d.tessellation == nullptr) {
    DisplacedPoint out = displaced_resolve(d.geometry, placement, texel_of_instance_[instance], primitive, record);
    if (d.procedural != nullptr) set_base_place(*d.procedural, &out);
    if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
    return out;
  }
  const MicroHit hit = d.tessellation->hit(primitive, record.u, record.v);
  DisplacedPoint out{hit.triangle, static_cast<float>(hit.b1), static_cast<float>(hit.b2)};
  out.P = to_float(hit.P);
  out.Ng = out.Ns = to_float(hit.Ng);
  if (d.geometry.scene != nullptr) {
    const LeavingErrors errors = leaving_errors(placement, out.P, out.Ng);
    out.leave = to_float(d.tessellation->leave(d.geometry.scene, primitive, record.u, record.v, hit, errors.error,
                                               2 * length(errors.reach)));
  }
  auto level = static_cast<float>(d.geometry.first_level);
  if (d.dicing != nullptr) {
    const Vec3d P = base_point(d.dicing->mesh().triangles[hit.triangle], hit.b1, hit.b2).P;
    level = static_cast<float>(d.dicing->level(P));
    d.dicing->set_base_place(&out.triangle, &out.u, &out.v);
  }
  if (d.geometry.smooth) {
    out.Ns = to_float(displaced_smooth_normal(d.geometry, out.triangle, {out.u, out.v}));
  } else if (d.dicing != nullptr && !(level > 0.0f)) {
    // Micro-triangles across the line between two texels would show as teeth where texels are wider than pixels.
    out.Ns = to_float(displaced_surface_point(d.geometry, out.triangle, {out.u, out.v}).Ng);
  }
  displaced_point_set_level(d.geometry, placement, level, &out);
  if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
  return out;
}

DisplacedPoint DisplacementSet::locate(std::size_t instance, std::uint32_t primitive, EmbreeHitRecord record) const
{
  const PreparedMesh& d = displaced(instance);
  if (d.tiles != nullptr) return d.tiles->locate(primitive, record);
  if (d.tessellation == nullptr) {
    const DisplacedPlace place = displaced_hit_decode(record);
    DisplacedPoint out{primitive, place.b1, place.b2};
    if (d.procedural != nullptr) set_base_place(*d.procedural, &out);
    return out;
  }
  const MicroHit hit = d.tessellation->locate(primitive, record.u, record.v);
  DisplacedPoint out{hit.triangle, static_cast<float>(hit.b1), static_cast<float>(hit.b2)};
  if (d.dicing != nullptr) d.dicing->set_base_place(&out.triangle, &out.u, &out.v);
  return out;
}

}  // namespace relief
