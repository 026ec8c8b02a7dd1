#include "integrator/graph_rays.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>

#include "integrator/ray_surface.h"
#include "integrator/scene_context.h"
#include "kernel/math/rounding.h"
#include "kernel/math/trigonometry.h"
#include "kernel/sample/sobol.h"
#include "kernel/sample/warp.h"

namespace relief {
namespace {

/// What tells one question from another: a graph knows no path, but two paths hardly see one point from one direction.
std::uint32_t hash_of(Vec3f O, Vec3f wo)
{
  std::uint32_t hash = 0x9e3779b9u;
  for (const float v : {O.x, O.y, O.z, wo.x, wo.y, wo.z}) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(v)) * 0x85ebca6bu;
    hash ^= hash >> 15;
  }
  return hash;
}

Vec3f y_up(Vec3f v) { return {v.x, v.z, -v.y}; }
Vec3f z_up(Vec3f v) { return {v.x, -v.z, v.y}; }

struct LookingRay {
  Vec3f O, D;
  float length;
  float time;
  unsigned mask;
};

RTCRayHit ray_make(const LookingRay& looking)
{
  RTCRayHit ray{};
  ray.ray.org_x = looking.O.x, ray.ray.org_y = looking.O.y, ray.ray.org_z = looking.O.z;
  ray.ray.dir_x = looking.D.x, ray.ray.dir_y = looking.D.y, ray.ray.dir_z = looking.D.z;
  ray.ray.tnear = kLeastDistance;
  ray.ray.tfar = looking.length;
  ray.ray.time = looking.time;
  ray.ray.mask = looking.mask;
  return ray;
}

/// @source as Cycles' Ambient Occlusion: rays by the cosine to the normal
float open_share(const void* scene, const GraphOpenShare& question)
{
  const Vec3f Ng = y_up(question.Ng), N = y_up(question.N), O[2] = {y_up(question.O[0]), y_up(question.O[1])};
  if (!(question.distance > 0.0f) || question.num_rays < 1 || !(length_squared(N) > 0.0f) || !is_finite(N)) return 1.0f;
  const SceneContext& context = *static_cast<const SceneContext*>(scene);
  // What casts no shadow is in the way of its own object alone.
  const bool is_local = question.instance >= 0;
  const unsigned mask = is_local ? ~0u : unsigned{kRayShadow};
  const Frame frame = frame_from_normal(normalize(N));
  const std::uint32_t hash = hash_of(O[0], question.wo);
  int num_open = 0;
  for (int i = 0; i < question.num_rays; ++i) {
    const Vec3f D = from_local(frame, warp_cosine_hemisphere(sample_2d(hash, static_cast<std::uint32_t>(i), 0)));
    // By the smooth normal rays leave on either side of a facet, which itself is never in their way.
    const Vec3f& from = dot(D, Ng) > 0.0f ? O[0] : O[1];
    // The closest hits, for what lets shadow rays through in part stops these.
    const auto stops = [&](unsigned met) {
      return !is_local || context.accel->are_of_one_object(met, static_cast<unsigned>(question.instance));
    };
    EmbreeContext embree;
    embree_context_init(embree, false);
    RTCRayHit ray = ray_make({from, D, question.distance, question.time, mask});
    if (context.accel->intersect_only(embree, ray, stops) == RTC_INVALID_GEOMETRY_ID) ++num_open;
  }
  return static_cast<float>(num_open) / static_cast<float>(question.num_rays);
}

/// A place where a ray met a surface.
struct MetSurface {
  Vec3f P, Ng, Ns;  ///< world; normals unit, on the front side
};

MetSurface met_surface(const SceneContext& context, unsigned object, const RTCRayHit& ray)
{
  const SceneMotion& motion = context.motion;
  InstanceView instance = context.instances[object];
  MeshView mesh = context.meshes[static_cast<std::size_t>(instance.mesh_index)];
  if ((instance.flags & (kMoves | kDeforms)) != 0) {
    const bool deforms = (instance.flags & kDeforms) != 0;
    instance = motion.instance_at(instance, ray.ray.time);
    if (deforms) mesh = motion.mesh_at(instance, mesh, ray.ray.time);
  }
  if ((instance.flags & kDisplaced) == 0) {
    const SurfaceHit hit = surface_hit_of_ray(mesh, instance, ray);
    return {hit.P, hit.Ng, hit.Ns};
  }
  const DisplacedPoint at = context.displacements.resolve(object, instance, ray.hit.primID,
                                                          {ray.hit.u, ray.hit.v, ray.hit.Ng_x, ray.ray.time});
  const auto normal = [&](Vec3f n) { return normalize(transform_normal(instance.object_from_world, as_normal(n))); };
  return {transform_point(instance.world_from_object, at.P), normal(at.Ng), normal(at.Ns)};
}

/// @source as Cycles' Bevel: the mean of the object's smooth normals around the point, each by (radius − distance)³, which rays
///         along three axes meet at places of a disk; the axes are weighted by the power heuristic. King et al. 2013, "BSSRDF
///         Importance Sampling". Sums of few rays are normalized, so that pictures depend on how they are spread.
Vec3f bevel(const void* scene, const GraphBevel& question)
{
  const SceneContext& context = *static_cast<const SceneContext*>(scene);
  const Vec3f P = y_up(question.P), Ng = y_up(question.Ng);
  const float radius = question.radius;
  if (!(radius > 0.0f && radius < kInfinity) || !is_finite(P)) return {};
  constexpr float kChances[3] = {0.5f, 0.25f, 0.25f};
  const Frame frame = frame_from_normal(Ng);
  const Vec3f axes[3] = {frame.n, frame.s, frame.t};
  const std::uint32_t hash = hash_of(P, question.wo);
  Vec3f sum;
  // Cycles keeps four of a ray's, chosen at random where there are more.
  std::array<RTCRayHit, 16> hits;
  for (int i = 0; i < question.num_rays; ++i) {
    const Vec2f u = sample_2d(hash, static_cast<std::uint32_t>(i), 0);
    const int axis = u.x < 0.5f ? 0 : u.x < 0.75f ? 1 : 2;
    const float before = axis == 0 ? 0.0f : axis == 1 ? 0.5f : 0.75f;
    const SinCos turn = sin_cos_turn((u.x - before) / kChances[axis]);
    const float r = bevel_distance(u.y), half = std::sqrt(std::max(0.0f, 1.0f - r * r));
    if (!(r < 1.0f)) continue;
    const Vec3f along = axes[axis], across = axes[(axis + 1) % 3] * turn.cos + axes[(axis + 2) % 3] * turn.sin;
    const RTCRayHit ray =
        ray_make({P + (along * half + across * r) * radius, -along, 2.0f * half * radius, question.time, ~0u});
    const std::size_t num_hits = context.accel->gather_hits(static_cast<unsigned>(question.instance), ray, hits);
    for (const RTCRayHit& hit : std::span(hits).first(num_hits)) {
      const MetSurface at = met_surface(context, met_object(hit), hit);
      const float near = 1.0f - length(at.P - P) / radius;
      if (!(near > 0.0f)) continue;
      float squares = 0;
      for (int k = 0; k < 3; ++k) {
        const float pdf = kChances[k] * dot(axes[k], at.Ng);
        squares += pdf * pdf;
      }
      const float ratio = near / (1.0f - r);
      sum += at.Ns * (ratio * ratio * ratio * kChances[axis] * std::fabs(dot(along, at.Ng)) / squares);
    }
  }
  const float size = length(sum);
  return size > 0.0f && is_finite(sum) ? z_up(sum / size) : Vec3f{};
}

}  // namespace

float bevel_distance(float u)
{
  // Nearly straight by the root of 1 − u^¼, at both ends: their quotient, fitted for the least of the greatest errors of r and 1 − r,
  // relative to both.
  const float square_root = std::sqrt(u);
  const float w = std::sqrt((1.0f - u) / ((1.0f + square_root) * (1.0f + std::sqrt(square_root))));
  constexpr float kFit[] = {0.63245448f, 0.40007765f, -0.03253859f, -0.00392782f, 0.00541042f, -0.00147615f};
  float quotient = 0;
  for (int i = 5; i >= 0; --i) quotient = quotient * w + kFit[i];
  return w * quotient;
}

GraphRays graph_rays_make(const SceneContext& context) { return {open_share, bevel, &context}; }

}  // namespace relief
