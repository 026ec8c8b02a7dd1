// surface_hit_make for eight hits at once, which paths that have hit one material are made of: the same numbers in the same
// order of operations.
#pragma once

#include <new>

#include "kernel/math/vec_lanes.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

/// Triangles and places on them, as given to surface_hit_make. Lanes behind the last repeat any.
struct SurfaceHitQuestions {
  const MeshView* mesh[8];
  const InstanceView* instance[8];
  std::uint32_t triangle[8];
  float bary_u[8], bary_v[8];
};

/// As triangle_clearance.
RELIEF_KERNEL Vec3x8 triangle_clearance(const Vec3x8& w,
                                        const Vec3x8& edge1,
                                        const Vec3x8& edge2,
                                        F8 double_area,
                                        const Vec3x8& Ng,
                                        const Vec3x8& error)
{
  const Vec3x8 across = abs(edge1) + abs(edge2);
  const F8 clearance = kClearedHeights * 2.0f * dot(abs(Ng), error) + length(error);
  const F8 margin = clearance * (across.x + across.y + across.z);
  const I8 is_near = min_component(w) * double_area < margin;
  const Vec3x8 none{};
  if (mask_of(is_near) == 0) [[likely]]
    return none;
  const F8 least = min(margin / double_area, splat8(kMostClearanceWeight));
  return select(is_near, (least - 3.0f * least * w.y) * edge1 + (least - 3.0f * least * w.z) * edge2, none);
}

/// What eight triangles are, side by side; of those without normals these are 0.
struct TriangleLanes {
  TriangleIndices tri[8];
  Vec3x8 p[3], n[3];  ///< of vertices, object space
  I8 has_normals, is_mirrored, is_traced_in_object;
  Affine3x8 world_from_object, object_from_world;
};

[[gnu::always_inline]] RELIEF_KERNEL TriangleLanes triangle_lanes_load(const SurfaceHitQuestions& q, int num_hits)
{
  TriangleLanes out;
  // Columns in memory: what is gathered, number by number.
  alignas(32) float in[18][8] = {};
  alignas(32) std::int32_t has_N[8] = {}, mirrored[8] = {}, traced_in_object[8] = {};
  bool is_one_instance = true;
  const auto put = [](float(*columns)[8], int k, Vec3f v) {
    columns[0][k] = v.x;
    columns[1][k] = v.y;
    columns[2][k] = v.z;
  };
  for (int k = 0; k < num_hits; ++k) {
    const MeshView& mesh = *q.mesh[k];
    out.tri[k] = mesh.triangles[q.triangle[k]];
    const std::uint32_t vertices[3] = {out.tri[k].v0, out.tri[k].v1, out.tri[k].v2};
    for (int v = 0; v < 3; ++v) put(in + 3 * v, k, mesh_P(mesh, vertices[v]));
    if (mesh.N != nullptr) {
      has_N[k] = -1;
      for (int v = 0; v < 3; ++v) put(in + 9 + 3 * v, k, as_vector(mesh_N(mesh, vertices[v])));
    }
    mirrored[k] = (q.instance[k]->flags & kMirrored) != 0 ? -1 : 0;
    traced_in_object[k] = (q.instance[k]->flags & kTracedInObjectSpace) != 0 ? -1 : 0;
    is_one_instance = is_one_instance && q.instance[k] == q.instance[0];
  }
  const auto take = [](const float(*columns)[8]) {
    return Vec3x8{load8(columns[0]), load8(columns[1]), load8(columns[2])};
  };
  const auto mask = [](const std::int32_t* lanes) {
    I8 m;
    __builtin_memcpy(&m, lanes, sizeof m);
    return m;
  };
  for (int v = 0; v < 3; ++v) {
    out.p[v] = take(in + 3 * v);
    out.n[v] = take(in + 9 + 3 * v);
  }
  out.has_normals = mask(has_N);
  out.is_mirrored = mask(mirrored);
  out.is_traced_in_object = mask(traced_in_object);
  out.world_from_object = splat8(q.instance[0]->world_from_object);
  out.object_from_world = splat8(q.instance[0]->object_from_world);
  if (!is_one_instance) {
    for (int k = 1; k < num_hits; ++k) {
      lane_set(out.world_from_object, k, q.instance[k]->world_from_object);
      lane_set(out.object_from_world, k, q.instance[k]->object_from_world);
    }
  }
  return out;
}

/// Evaluates triangles' attributes at hits.
/// @param num_hits  1 to 8
/// @param hits      gets those
[[gnu::noinline]] RELIEF_KERNEL void surface_hits_make(const SurfaceHitQuestions& q, int num_hits, SurfaceHit* hits[8])
{
  const TriangleLanes at = triangle_lanes_load(q, num_hits);
  const Vec3x8 *const p = at.p, *const n = at.n;
  const Affine3x8 &m = at.world_from_object, &inverse = at.object_from_world;
  const F8 bary_u = load8(q.bary_u), bary_v = load8(q.bary_v);
  const F8 w0 = 1.0f - bary_u - bary_v;
  const Vec3x8 P_object = w0 * p[0] + bary_u * p[1] + bary_v * p[2];
  const Vec3x8 P_object_sum = abs(w0 * p[0]) + abs(bary_u * p[1]) + abs(bary_v * p[2]);
  const Vec3x8 P = transform_point(m, P_object);
  const auto abs_transform = [](const Affine3x8& by, const Vec3x8& v) {
    return abs(by.x) * v.x + abs(by.y) * v.y + abs(by.z) * v.z;
  };
  const Vec3x8 spread = abs_transform(m, P_object_sum);
  Vec3x8 P_error =
      splat8((1.0f + gamma_bound(3)) * gamma_bound(7)) * spread + splat8(gamma_bound(3)) * (spread + abs(m.p));
  if (mask_of(at.is_traced_in_object) != 0) {
    const Vec3x8 more = splat8(gamma_bound(6)) * abs_transform(m, abs_transform(inverse, abs(P)) + abs(inverse.p));
    P_error = select(at.is_traced_in_object, P_error + more, P_error);
  }

  const Vec3x8 edge1 = transform_vector(m, p[1] - p[0]), edge2 = transform_vector(m, p[2] - p[0]);
  const Vec3x8 turned = cross(edge1, edge2);
  const Vec3x8 normal_area = select(at.is_mirrored, -turned, turned);
  const F8 double_area = length(normal_area);
  const Vec3x8 Ng = normal_area / double_area;
  const Vec3x8 clear = triangle_clearance({w0, bary_u, bary_v}, edge1, edge2, double_area, Ng, P_error);

  Vec3x8 Ns = Ng, lift_N{};
  LiftHeights<F8> lift{};
  if (mask_of(at.has_normals) != 0) {
    const Vec3x8 n0 = normalize(transform_normal(inverse, n[0])), n1 = normalize(transform_normal(inverse, n[1])),
                 n2 = normalize(transform_normal(inverse, n[2]));
    const Vec3x8 mean = w0 * n0 + bary_u * n1 + bary_v * n2;
    const F8 mean_length = length(mean);
    Ns = select(at.has_normals & (mean_length > 1e-6f), mean / mean_length, Ng);
    // Of meshes without normals zeros were loaded for these, which are NaN by now.
    const LiftHeights<F8> of_smooth = triangle_lift(w0, bary_u, bary_v, edge1, edge2, n0, n1, n2);
    const F8 none{};
    lift_N = select(at.has_normals, mean, lift_N);
    lift.front = at.has_normals ? of_smooth.front : none;
    lift.back = at.has_normals ? of_smooth.back : none;
  }

  alignas(32) float out[21][8];
  const auto give = [](float(*columns)[8], const Vec3x8& v) {
    store8(columns[0], v.x);
    store8(columns[1], v.y);
    store8(columns[2], v.z);
  };
  give(out, P);
  give(out + 3, P_error);
  give(out + 6, Ng);
  give(out + 9, Ns);
  give(out + 12, lift_N);
  give(out + 15, clear);
  store8(out[18], double_area);
  store8(out[19], lift.front);
  store8(out[20], lift.back);
  for (int k = 0; k < num_hits; ++k) {
    const auto number = [&](int first) { return Vec3f{out[first][k], out[first + 1][k], out[first + 2][k]}; };
    SurfaceHit& hit = *new (hits[k]) SurfaceHit;
    hit.P = number(0);
    hit.P_error = number(3);
    hit.Ng = number(6);
    hit.Ns = number(9);
    hit.lift = {number(12), out[19][k], out[20][k]};
    hit.clear = number(15);
    surface_hit_interpolate(*q.mesh[k], at.tri[k], q.bary_u[k], q.bary_v[k], &hit);
    surface_hit_density(*q.mesh[k], at.tri[k], out[18][k], &hit);
  }
}

}  // namespace relief
