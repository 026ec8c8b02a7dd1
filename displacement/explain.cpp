#include "displacement/explain.h"

#include <cmath>
#include <optional>

#include "displacement/deformation.h"
#include "displacement/trace_procedural.h"

namespace relief {

namespace {

/// Texels before the period that a lattice coordinate lies in.
double whole_periods(const LatticeAxis& axis, double x)
{
  return axis.wrap == Wrap::kClamp ? 0.0 : std::floor(x / axis.num_cells) * axis.num_cells;
}

}  // namespace

PrismExplanation prism_explain(const PrismVisit& visit, double t_unit)
{
  const MeshAtTime then(visit.geometry->mesh, visit.triangle, visit.time);
  DisplacedMeshView mesh = then.mesh;
  DisplacedTriangle tri = then.tri();
  PrismExplanation out;
  const ObjectRay& ray = visit.ray;
  const auto t_asked = [&](double t) { return (ray.t_start + ray.t_scale * t) * t_unit; };
  out.ray.D = to_float(ray.D * (1.0 / (ray.t_scale * t_unit)));
  out.ray.O = to_float(ray.O - ray.D * (ray.t_start / ray.t_scale));
  out.t_min = t_asked(visit.t_min);
  out.t_max = t_asked(visit.t_max);
  out.t = t_asked(visit.hit.t);
  out.folded = mesh.unfolded[then.triangle] == 0;
  RayCurve curve;
  if (ray_curve_make(ray_frame_make(ray.O, ray.D), tri, &curve)) {
    for (int k = 0; k < curve.num_segments; ++k) {
      const CurveSegment& g = curve.segments[k];
      out.stretches[out.num_stretches++] = {t_asked(g.t0), t_asked(g.t1), g.s0, g.s0 + g.ds};
    }
  }
  const ProceduralField* const procedural = visit.geometry->procedural;
  out.has_map = procedural == nullptr;
  out.triangle = out.has_map ? visit.triangle : procedural->triangles()[visit.triangle].base;
  if (!visit.found) return out;
  const DisplacedHit& hit = visit.hit;
  out.b1 = hit.b1;
  out.b2 = hit.b2;
  std::optional<TriangleOnTile> tile;
  if (!out.has_map) {
    tile.emplace(mesh, *procedural, then.triangle, lattice_tile_at(*procedural, visit.triangle, hit.b1, hit.b2));
    mesh = tile->mesh;
    tri = tile->tri;
    const LatticeTriangle& part = procedural->triangles()[visit.triangle];
    const Vec2f b = part.base_weights(static_cast<float>(hit.b1), static_cast<float>(hit.b2));
    out.b1 = b.x;
    out.b2 = b.y;
  } else if (hit.level > 0) {
    const HeightFieldView& level = *visit.geometry->levels[hit.level].field;
    tri = triangle_on_level(tri, *mesh.field, level);
    mesh.field = &level;
  }
  const double x = tri.x[0] + hit.b1 * (tri.x[1] - tri.x[0]) + hit.b2 * (tri.x[2] - tri.x[0]);
  const double y = tri.y[0] + hit.b1 * (tri.y[1] - tri.y[0]) + hit.b2 * (tri.y[2] - tri.y[0]);
  out.h = interpolate_height(*mesh.field, x, y);
  out.d = hit.edge >= 0 ? hit.d : displacement_at(mesh, x, y);
  out.i = hit.i;
  out.j = hit.j;
  if (!out.has_map) return out;
  out.u = (x + 0.5 - whole_periods(mesh.field->x, x + 0.5)) / mesh.field->map.width;
  out.v = (y + 0.5 - whole_periods(mesh.field->y, y + 0.5)) / mesh.field->map.height;
  out.i -= static_cast<std::int64_t>(whole_periods(mesh.field->x, static_cast<double>(hit.i)));
  out.j -= static_cast<std::int64_t>(whole_periods(mesh.field->y, static_cast<double>(hit.j)));
  return out;
}

}  // namespace relief
