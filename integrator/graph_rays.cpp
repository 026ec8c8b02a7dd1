#include "integrator/graph_rays.h"

#include <bit>

#include "kernel/math/rounding.h"
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

/// Whether a ray of the given length is stopped by something that casts shadows, or by one instance of it.
bool is_stopped(const Accel& accel, Vec3f O, Vec3f D, float length, std::int32_t instance)
{
  // The closest hit, for what lets shadow rays through in part stops these.
  float from = kLeastDistance;
  for (;;) {
    EmbreeContext context;
    embree_context_init(context, false);
    RTCRayHit ray{};
    ray.ray.org_x = O.x, ray.ray.org_y = O.y, ray.ray.org_z = O.z;
    ray.ray.dir_x = D.x, ray.ray.dir_y = D.y, ray.ray.dir_z = D.z;
    ray.ray.tnear = from;
    ray.ray.tfar = length;
    ray.ray.mask = kRayShadow;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    accel.intersect(context, ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    const unsigned object = ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? ray.hit.instID[0] : ray.hit.geomID;
    if (instance < 0 || object == static_cast<unsigned>(instance)) return true;
    // Embree would give the same hit again: a ray that starts at one meets it.
    from = t_min_behind(ray.ray.tfar);
  }
}

/// @source as Cycles' Ambient Occlusion: rays by the cosine to the normal
float open_share(const void* scene, const GraphOpenShare& question)
{
  const Vec3f Ng = y_up(question.Ng), N = y_up(question.N), O[2] = {y_up(question.O[0]), y_up(question.O[1])};
  if (!(question.distance > 0.0f) || question.num_rays < 1 || !(length_squared(N) > 0.0f) || !is_finite(N)) return 1.0f;
  const Accel& accel = *static_cast<const Accel*>(scene);
  const Frame frame = frame_from_normal(normalize(N));
  const std::uint32_t hash = hash_of(O[0], question.wo);
  int num_open = 0;
  for (int i = 0; i < question.num_rays; ++i) {
    const Vec3f D = from_local(frame, warp_cosine_hemisphere(sample_2d(hash, static_cast<std::uint32_t>(i), 0)));
    // By the smooth normal rays leave on either side of a facet, which itself is never in their way.
    const Vec3f& from = dot(D, Ng) > 0.0f ? O[0] : O[1];
    if (!is_stopped(accel, from, D, question.distance, question.instance)) ++num_open;
  }
  return static_cast<float>(num_open) / static_cast<float>(question.num_rays);
}

}  // namespace

GraphRays graph_rays_make(const Accel& accel) { return {open_share, &accel}; }

}  // namespace relief
