#include "displacement/embree_geometry.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "displacement/clearance.h"
#include "displacement/deformation.h"
#include "displacement/level_blend.h"
#include "displacement/point_tiles.h"
#include "displacement/seam_walls.h"
#include "displacement/trace_procedural.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

namespace {

void bounds(const RTCBoundsFunctionArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  const DisplacedMeshView& mesh = geometry.mesh;
  const Box3 box = geometry.tiles != nullptr ? geometry.tiles->padded_box(arguments->primID)
                   : mesh.deformation != nullptr
                       ? deforming_triangle_bounds(mesh, arguments->primID, arguments->timeStep)
                       : displaced_triangle_bounds(mesh, arguments->primID);
  RTCBounds* out = arguments->bounds_o;
  out->lower_x = box.low.x;
  out->lower_y = box.low.y;
  out->lower_z = box.low.z;
  out->upper_x = box.high.x;
  out->upper_y = box.high.y;
  out->upper_z = box.high.z;
}

/// A geometry's mesh and one of its triangles, with the heights around a point of it on one level.
struct OnSurface {
  MeshAtTime then;
  DisplacedMeshView mesh;
  DisplacedTriangle tri;
  std::optional<TriangleOnTile> tile;

  OnSurface(const DisplacedGeometry& geometry, std::uint32_t triangle, int level, double b1, double b2, float time)
      : then(geometry.mesh, triangle, time), mesh(then.mesh), tri(then.tri())
  {
    if (geometry.procedural != nullptr) {
      tile.emplace(then.mesh, *geometry.procedural, then.triangle,
                   lattice_tile_at(*geometry.procedural, triangle, b1, b2));
      mesh = tile->mesh;
      tri = tile->tri;
    } else if (level > 0) {
      mesh.field = geometry.levels[level].field;
      tri = triangle_on_level(tri, *geometry.mesh.field, *mesh.field);
    }
  }
};

/// A box around a point of the surface that reaches over sides of its triangle.
struct BoxOverSides {
  const DisplacedGeometry& geometry;
  std::uint32_t triangle;
  const DisplacedTriangle& tri;
  int level;
  float time;         ///< of the ray
  double weights[3];  ///< of the triangle's vertices; 0 where the box reaches over the side opposite to them
  Vec3d P;            ///< the point
  double d;           ///< its displacement, metres
  Vec3d reach;
  double clearance;  ///< of the triangle itself, then of its neighbours too
  bool has_neighbors = false, has_walls = false;
  Vec3d error = {};                          ///< as in add_planes_in_box
  std::vector<NearPlane>* planes = nullptr;  ///< to which those of neighbours are added; null: they are not
};

/// Looks for walls along the edges that a box reaches over, and adds the planes of those that pass its point.
/// @param then  a triangle with these edges
/// @param b     weights of its vertices, as BoxOverSides::weights
void find_walls(BoxOverSides& box, const MeshAtTime& then, const double (&b)[3])
{
  // Computed heights have none.
  if (then.mesh.seam_edges == nullptr || box.geometry.procedural != nullptr) return;
  const SeamLevel level{box.geometry.mesh.field, box.geometry.levels[box.level].field};
  for (int edge = 0; edge < 3; ++edge) {
    const int next = edge == 2 ? 0 : edge + 1, opposite = next == 2 ? 0 : next + 1;
    if (b[opposite] != 0 || (then.mesh.seam_edges[then.triangle] >> edge & 1) == 0) continue;
    const double fraction = b[next];
    const SeamHeights heights = seam_heights(then.mesh, then.triangle, edge, fraction, level);
    const double near = length(box.reach);
    if (!(heights.high > heights.low && box.d >= heights.low - near && box.d <= heights.high + near)) continue;
    box.has_walls = true;
    if (box.planes == nullptr) continue;
    // Between its sides, where it is known which is the lower one; the wall holds the whole displacement line.
    const SurfacePoint wall =
        seam_wall_point(then.mesh, then.triangle, edge, fraction, 0.5 * (heights.low + heights.high), level);
    box.planes->push_back({wall.Ng, 2 * dot(abs(wall.Ng), box.error) + std::abs(dot(box.P - wall.P, wall.Ng))});
  }
}

/// Widens the clearance by that of a triangle that has all vertices between which the point is, if it has the surface in
/// common there: at a seam it has not.
bool widen_by_neighbor(RTCPointQueryFunctionArguments* arguments)
{
  auto& box = *static_cast<BoxOverSides*>(arguments->userPtr);
  if (arguments->primID == box.triangle) return false;
  const MeshAtTime then(box.geometry.mesh, arguments->primID, box.time);
  const DisplacedTriangle &own = box.tri, &neighbor = then.tri();
  double b[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    if (box.weights[k] == 0) continue;
    int at = 0;
    while (at < 3 && !(neighbor.P[at] == own.P[k] && neighbor.N[at] == own.N[k])) ++at;
    if (at == 3) return false;
    b[at] = box.weights[k];
  }
  find_walls(box, then, b);
  const OnSurface other(box.geometry, arguments->primID, box.level, b[1], b[2], box.time);
  // From the point to where it is on the side, and from there once more.
  const SurfaceInBox near = surface_in_box(other.mesh, other.tri, b[1], b[2], 2.0 * box.reach);
  const double d = traced_surface_point(other.mesh, other.tri, b[1], b[2]).d;
  if (!(std::abs(d - box.d) <= near.clearance)) return false;
  box.clearance = std::max(box.clearance, near.clearance);
  box.has_neighbors = true;
  if (box.planes != nullptr)
    add_planes_in_box(other.mesh, other.tri, b[1], b[2], box.error, 2.0 * box.reach, box.planes);
  return false;
}

void find_neighbors(BoxOverSides& box, Vec3d point)
{
  const Vec3f P = to_float(point);
  RTCPointQuery query{P.x, P.y, P.z, box.time, static_cast<float>(2.0 * length(box.reach))};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(box.geometry.scene, &query, &context, widen_by_neighbor, &box);
}

/// How far a ray's origin has to be moved to leave a point of the surface, or of a wall, where there is a crease.
/// @param point   at that place
/// @param errors  of the point, object space
/// @return        to the side of N, object space; zero: it can leave along the normal
Vec3d leave_of(const DisplacedGeometry& geometry,
               std::uint32_t triangle,
               const DisplacedPlace& at,
               const SurfacePoint& point,
               const LeavingErrors& errors)
{
  const bool is_wall = at.edge >= 0;
  const double b1 = at.b1, b2 = at.b2;
  const Vec3d reach = errors.reach;
  const OnSurface on(geometry, triangle, at.level, b1, b2, at.time);
  const SurfaceInBox own = surface_in_box(on.mesh, on.tri, b1, b2, reach);
  double distance = own.crease ? own.clearance : 0;
  std::optional<BoxOverSides> box;
  // A triangle within the box has no side that it could share.
  if (own.sides != 0 && own.sides != 7 && geometry.scene != nullptr) {
    box.emplace(BoxOverSides{geometry,
                             triangle,
                             on.then.tri(),
                             at.level,
                             at.time,
                             {1.0 - b1 - b2, b1, b2},
                             point.P,
                             point.d,
                             reach,
                             own.clearance});
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      if ((own.sides >> k & 1) != 0) box->weights[k] = 0;
      sum += box->weights[k];
    }
    for (double& weight : box->weights) weight /= sum;
    find_walls(*box, on.then, box->weights);
    find_neighbors(*box, point.P);
    if (box->has_neighbors) distance = box->clearance;
  }
  // Walls are as steep as the displacement lines.
  const bool has_walls = is_wall || (box && box->has_walls);
  if (!(distance > 0) && !has_walls) return {};
  // Steeper surfaces than of so many metres a metre are as good as parallel to their displacement lines.
  constexpr double kSteepest = 64;
  if (!has_walls && distance <= kSteepest * length(reach)) {
    const Vec3d N = base_point(on.tri, b1, b2).N;
    return N * (distance / length(N));
  }
  std::vector<NearPlane> planes;
  if (!is_wall || std::abs(point.d - traced_surface_point(on.mesh, on.tri, b1, b2).d) <= own.clearance) {
    add_planes_in_box(on.mesh, on.tri, b1, b2, errors.error, reach, &planes);
  }
  if (box) {
    box->error = errors.error;
    box->planes = &planes;
    find_walls(*box, on.then, box->weights);
    find_neighbors(*box, point.P);
  }
  return planes_leave(planes, point.Ng);
}

}  // namespace

LeavingErrors leaving_errors(const InstanceView& placement, Vec3f P, Vec3f Ng)
{
  const DisplacedPointError error =
      displaced_point_error(placement, P, transform_point(placement.world_from_object, P));
  const Vec3f N = normalize(transform_normal(placement.object_from_world, as_normal(Ng)));
  const Vec3f offset = transform_vector(placement.object_from_world, 2.0f * dot(abs(N), error.world) * N);
  // The origin has as large an error as the point.
  return {offset, to_double(error.object), to_double(2.0f * error.object + abs(offset))};
}

SurfacePoint displaced_surface_point(const DisplacedGeometry& geometry,
                                     std::uint32_t triangle,
                                     const DisplacedPlace& place)
{
  if (place.edge >= 0) {
    const MeshAtTime then(geometry.mesh, triangle, place.time);
    return seam_wall_point(then.mesh, then.triangle, place.edge, place.fraction, place.d,
                           {geometry.mesh.field, geometry.levels[place.level].field});
  }
  const OnSurface on(geometry, triangle, place.level, place.b1, place.b2, place.time);
  return traced_surface_point(on.mesh, on.tri, place.b1, place.b2);
}

Vec3d displaced_edge_point(const DisplacedGeometry& geometry,
                           std::uint32_t triangle,
                           int side,
                           double fraction,
                           int level,
                           float time)
{
  double b[3] = {0, 0, 0};
  b[side] = 1.0 - fraction;
  b[side == 2 ? 0 : side + 1] = fraction;
  const OnSurface on(geometry, triangle, level, b[1], b[2], time);
  return traced_surface_point(on.mesh, on.tri, b[1], b[2]).P;
}

Vec3d displaced_smooth_normal(const DisplacedGeometry& geometry, std::uint32_t triangle, const DisplacedPlace& place)
{
  const double b1 = place.b1, b2 = place.b2;
  const OnSurface on(geometry, triangle, place.level, b1, b2, place.time);
  if (!on.tile) return traced_smooth_normal(on.mesh, on.tri, b1, b2);
  const auto [x, y] = lattice_point(on.tri, b1, b2);
  const LatticeNode tile = lattice_tile_at(*geometry.procedural, triangle, b1, b2);
  const LatticeSlopes slopes = geometry.procedural->smooth_slopes(triangle, b1, b2, *on.mesh.field, tile.i, tile.j);
  return surface_normal(base_point(on.tri, b1, b2), displacement_at(on.mesh, x, y), on.mesh.scale, slopes.x, slopes.y);
}

void displaced_point_set_level(const DisplacedGeometry& geometry,
                               const InstanceView& placement,
                               float level,
                               DisplacedPoint* point)
{
  if (!geometry.facets || !(level > 0.0f)) return;
  point->level = level;
  if (is_zero(point->leave)) point->leave = leaving_errors(placement, point->P, point->Ng).offset;
}

DisplacedPoint displaced_resolve(const DisplacedGeometry& geometry,
                                 const InstanceView& placement,
                                 float texel,
                                 std::uint32_t triangle,
                                 EmbreeHitRecord record)
{
  const DisplacedPlace place = displaced_hit_decode(record);
  const SurfacePoint point = displaced_surface_point(geometry, triangle, place);
  DisplacedPoint out{triangle, place.b1, place.b2};
  out.P = to_float(point.P);
  out.Ng = out.Ns = to_float(point.Ng);
  if (geometry.lod.by_cone) out.width = lod_width_of_level(texel, place.level);
  out.leave = to_float(leave_of(geometry, triangle, place, point, leaving_errors(placement, out.P, out.Ng)));
  if (place.edge >= 0) return out;
  const float between = geometry.mesh.blend != nullptr ? static_cast<float>(geometry.mesh.blend->weight) : 0.0f;
  displaced_point_set_level(geometry, placement, static_cast<float>(geometry.first_level + place.level) + between,
                            &out);
  if (geometry.smooth) out.Ns = to_float(displaced_smooth_normal(geometry, triangle, place));
  return out;
}

RTCGeometry displaced_geometry_make(RTCDevice device, const DisplacedGeometry& geometry, const TraversalTable& table)
{
  RTCGeometry out = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  const bool tiles = geometry.tiles != nullptr;
  rtcSetGeometryUserPrimitiveCount(out, tiles ? geometry.tiles->num_tiles() : geometry.mesh.num_triangles);
  // Embree hands the pointer back as it was given; no callback writes through it.
  rtcSetGeometryUserData(out, const_cast<DisplacedGeometry*>(&geometry));
  if (const Deformation* const deformation = geometry.mesh.deformation)
    rtcSetGeometryTimeStepCount(out, static_cast<unsigned>(deformation->steps.size()));
  rtcSetGeometryBoundsFunction(out, bounds, nullptr);
  rtcSetGeometryIntersectFunction(out, tiles ? table.intersect_tiles : table.intersect);
  rtcSetGeometryOccludedFunction(out, tiles ? table.occluded_tiles : table.occluded);
  return out;
}

}  // namespace relief
