#include "integrator/subsurface_stage.h"

#include <cmath>

#include "integrator/path_lod.h"
#include "kernel/bsdf/subsurface.h"
#include "kernel/bsdf/subsurface_profile.h"
#include "kernel/math/rounding.h"
#include "kernel/stage/surface_interaction.h"
#include "kernel/volume/distance.h"
#include "kernel/volume/henyey_greenstein.h"

namespace relief {

namespace {

/// As in Cycles: walks that are longer, or carry less, are given up.
constexpr int kMostSteps = 256;
constexpr float kLeastCarried = 1e-6f;

/// The random numbers of one walk: those of its first steps are stratified among a pixel's samples, of later ones that would gain
/// nothing.
class WalkNumbers {
 public:
  WalkNumbers(std::uint32_t pixel_hash, std::uint32_t sample) : pixel_hash_(pixel_hash), sample_(sample) {}
  float next()
  {
    constexpr std::uint32_t kStratified = 20;
    const std::uint32_t n = count_++;
    if (n < kStratified) return sample_1d(pixel_hash_, sample_, dimension_below(n));
    return unit_float(hash_mix_32(hash_mix_32(sample_ * 0x9e3779b1u + pixel_hash_) + n * 0x9e3779b9u));
  }
  Vec2f next_2d()
  {
    const float u = next();
    return {u, next()};
  }

 private:
  std::uint32_t pixel_hash_, sample_, count_ = 0;
};

/// Dwivedi's distribution of directions along a normal: of light that finds its way out of a half space.
class Guide {
 public:
  /// @param length  of diffusion, in free paths, above 1
  explicit Guide(float length) : length_(length), log_(std::log((length + 1.0f) / (length - 1.0f))) {}

  /// @source Meng and others 2016, Eq. 10
  float sample_cosine(float u) const { return length_ - (length_ + 1.0f) * std::exp(-u * log_); }
  /// Density of a direction, per steradian. @source Eq. 9
  float pdf(float cosine) const { return 0.5f * kInvPi / ((length_ - cosine) * log_); }
  /// Factor on sigma_t for the way along a direction.
  float stretch(float cosine) const { return 1.0f - cosine / length_; }
  float length() const { return length_; }

 private:
  float length_, log_;
};

/// @source d'Eon and Křivánek 2020, Eq. 67
float diffusion_length(float albedo)
{
  return 1.0f / std::sqrt(1.0f - std::pow(albedo, 2.44294f - 0.0215813f * albedo + 0.578637f / albedo));
}

/// Density of a free flight's end in each channel, or, where it has met the surface, its chance to get that far.
/// @param passed  share of light that gets there
Vec3f flight_pdf(Vec3f sigma_t, Vec3f passed, bool is_out) { return is_out ? passed : sigma_t * passed; }

/// What the walks of a queue share.
struct Walker {
  const KernelGlobals& g;
  const Accel& accel;
  PathState& state;
  EmbreeContext context{};

  /// The nearest hit on the object that a path is in, on whichever of its parts.
  /// @param t_min  0, or behind a hit
  /// @return       the part, an instance; RTC_INVALID_GEOMETRY_ID: none is met
  unsigned meet(std::uint32_t path, Vec3f P, Vec3f D, float t_min, float t_max, RTCRayHit& ray);
  bool walk(std::uint32_t path);
  bool leave_by_profile(std::uint32_t path);
  /// Takes a hit for the path's.
  void take(std::uint32_t path, unsigned part, const RTCRayHit& ray);
};

unsigned Walker::meet(std::uint32_t path, Vec3f P, Vec3f D, float t_min, float t_max, RTCRayHit& ray)
{
  ray.ray.org_x = P.x, ray.ray.org_y = P.y, ray.ray.org_z = P.z;
  ray.ray.dir_x = D.x, ray.ray.dir_y = D.y, ray.ray.dir_z = D.z;
  ray.ray.tnear = t_min;
  ray.ray.tfar = t_max;
  ray.ray.time = path_time(state, path);
  ray.ray.mask = ~0u;
  ray.ray.id = 0;
  ray.ray.flags = 0;
  const std::uint32_t own = state.hit_object[path];
  return accel.intersect_only(context, ray, [this, own](unsigned object) {
    return accel.are_of_one_object(object, own) && (g.instances[object].flags & kCurves) == 0;
  });
}

void Walker::take(std::uint32_t path, unsigned part, const RTCRayHit& ray)
{
  state.hit_object[path] = part;
  state.hit_triangle[path] = ray.hit.primID;
  state.hit_u[path] = ray.hit.u;
  state.hit_v[path] = ray.hit.v;
  path_resolve_hit(g, accel, state, path, ray.hit.Ng_x);
}

/// A path leaves by a profile: at one of the places where a probe meets its object, chosen by its share of what they carry together.
bool Walker::leave_by_profile(std::uint32_t path)
{
  const SubsurfaceState& below = state.subsurface.entries[path];
  const Vec3f free_path = below.surface.radius, P = path_origin(state, path);
  WalkNumbers u(state.pixel_hash[path], state.sample_index[path]);
  const ProfileProbe probe = profile_probe_make(free_path, P, -path_direction(state, path), u.next_2d());
  float u_choice = u.next(), sum = 0.0f, t_min = 0.0f;
  Vec3f P_left, N_left, carried;
  RTCRayHit ray, left{};
  unsigned left_part = RTC_INVALID_GEOMETRY_ID;
  for (int hit = 0; hit < kMostSteps; ++hit) {
    const unsigned part = meet(path, probe.O, probe.D, t_min, probe.length, ray);
    if (part == RTC_INVALID_GEOMETRY_ID) break;
    t_min = t_min_behind(ray.ray.tfar);
    take(path, part, ray);
    const Vec3f Ng = normalize(hit_plane(g, state, path, path_instance(g, state, path)).Ng);
    const Vec3f P_hit = probe.O + ray.ray.tfar * probe.D;
    const Vec3f gain = profile_probe_gain(probe, free_path, length(P_hit - P), Ng);
    const float weight = mean_component(gain);
    if (!(weight > 0.0f && weight < kInfinity)) continue;
    sum += weight;
    const float share = weight / sum;
    if (!(u_choice < share)) {
      u_choice = (u_choice - share) / (1.0f - share);
      continue;
    }
    u_choice /= share;
    left = ray;
    left_part = part;
    P_left = P_hit;
    N_left = below.front ? Ng : -Ng;
    carried = gain / weight;
  }
  if (!(sum > 0.0f)) return false;
  const float way = length(P_left - P);
  path_set_ray(state, path, P_left + way * N_left, -N_left);
  state.hit_t[path] = way;
  state.throughput[path] = path_throughput(state, path) * carried * sum;
  take(path, left_part, left);
  if (state.media != nullptr) state.media[path].hit_inside = kWholeWorld;
  return true;
}

bool Walker::walk(std::uint32_t path)
{
  const SubsurfaceState& below = state.subsurface.entries[path];
  const SubsurfaceMedium medium = subsurface_medium(below.surface);
  const float length = diffusion_length(max_component(medium.albedo));
  if (!(length > 1.0f && length < kInfinity)) return false;
  const Guide guide(length);
  const Vec3f start = path_origin(state, path), N = below.N;
  Vec3f P = start, D = path_direction(state, path);
  Vec3f throughput = path_throughput(state, path) * medium.gain;
  WalkNumbers u(state.pixel_hash[path], state.sample_index[path]);
  LodCone cone;
  if (accel.displacements().has_levels()) {
    cone = PathLod(state, path).cone(state.cone_width[path], 0.0f);
    context.cones = &cone;
  }
  // After this many steps an anisotropic medium is as good as the even one that is similar to it.
  constexpr int kAnisotropicSteps = 10;
  const float g0 = below.surface.anisotropy;
  const Vec3f sigma_s0 = medium.sigma_t * medium.albedo, sigma_s_even = (1.0f - g0) * sigma_s0;
  float across = -1.0f;  // of the object, along −N from where it was entered; −1: no other side is near
  for (int step = 0; step < kMostSteps; ++step) {
    const bool is_even = step >= kAnisotropicSteps;
    const float g_now = is_even ? 0.0f : g0;
    const Vec3f sigma_s = is_even ? sigma_s_even : sigma_s0;
    const Vec3f sigma_t = is_even ? medium.sigma_t - sigma_s0 + sigma_s_even : medium.sigma_t;
    // Half or less of the steps are guided: by directions along N or, towards another side, against it.
    const float guided_share = is_even ? 0.75f : 1.0f - max(0.5f, std::pow(std::abs(g_now), 0.125f));
    const Vec3f chances = channel_chances(abs(throughput * medium.albedo));
    float sampled_sigma = channel_choose(sigma_t, chances, u.next());
    float back_share = 0.0f, cosine = 0.0f, phase = 1.0f;
    if (step > 0) {
      const bool is_guided = u.next() < guided_share;
      if (across >= 0.0f) {
        const float depth = clamp(dot(P - start, -N), 0.0f, across);
        back_share = 1.0f / (1.0f + std::exp((across - 2.0f * depth) / length));
      }
      const bool is_back = across >= 0.0f && u.next() < back_share;
      const Vec2f u_direction = u.next_2d();
      Vec3f next;
      if (is_guided) {
        cosine = guide.sample_cosine(u_direction.x);
        if (is_back) cosine = -cosine;
        next = from_local(frame_from_normal(N), direction_from_z(clamp(cosine, -1.0f, 1.0f), u_direction.y));
        sampled_sigma *= guide.stretch(is_back ? -cosine : cosine);
      } else {
        next = henyey_greenstein_sample(D, g_now, u_direction);
        cosine = dot(next, N);
      }
      phase = henyey_greenstein_pdf(dot(D, next), g_now);
      D = next;
    }
    float t = free_distance_sample(sampled_sigma, u.next());
    // The first ray looks for another side as well.
    constexpr float kFarInFreePaths = 10.0f;
    const float least_sigma = min(sigma_t.x, min(sigma_t.y, sigma_t.z));
    RTCRayHit ray;
    const unsigned part = meet(path, P, D, 0.0f, step == 0 ? max(t, kFarInFreePaths / least_sigma) : t, ray);
    bool is_out = part != RTC_INVALID_GEOMETRY_ID;
    if (step == 0 && is_out) {
      across = max(dot(P + ray.ray.tfar * D - start, -N), 0.0f);
      is_out = ray.ray.tfar < t;
    }
    if (is_out) t = ray.ray.tfar;
    P += t * D;

    const Vec3f passed = medium_transmittance(sigma_t, t);
    Vec3f pdf = flight_pdf(sigma_t, passed, is_out);
    if (step > 0) {
      const auto stretched_pdf = [&](float stretch) {
        const Vec3f sigma = stretch * sigma_t;
        return flight_pdf(sigma, medium_transmittance(sigma, t), is_out);
      };
      Vec3f guided = (guide.pdf(cosine) / phase) * stretched_pdf(guide.stretch(cosine));
      if (across >= 0.0f) {
        const Vec3f back = (guide.pdf(-cosine) / phase) * stretched_pdf(guide.stretch(-cosine));
        guided = lerp(back_share, guided, back);
      }
      pdf = lerp(guided_share, pdf, guided);
    }
    throughput *= (is_out ? passed : sigma_s * passed) / dot(chances, pdf);
    if (!is_finite(throughput)) return false;
    if (is_out) {
      // Paths come from outside to where they are shaded.
      path_set_ray(state, path, P + t * D, -D);
      state.hit_t[path] = t;
      state.throughput[path] = throughput;
      // What fills the object besides is not walked in.
      if (state.media != nullptr) state.media[path].hit_inside = kWholeWorld;
      take(path, part, ray);
      return true;
    }
    if (max_component(throughput) < kLeastCarried) return false;
  }
  return false;
}

}  // namespace

void walk_below_surfaces(const KernelGlobals& g,
                         const Accel& accel,
                         PathState& state,
                         const QueueView& queue,
                         QueueView& left,
                         DisplacementWork& displacement)
{
  Walker walker{g, accel, state};
  embree_context_init(walker.context, false);
  walker.context.displacement = &displacement.total;
  walker.context.texels = accel.displacements().texels();
  for (std::uint32_t i = 0; i < queue.size; ++i) {
    const std::uint32_t path = queue.paths[i];
    const bool by_profile = state.subsurface.entries[path].surface.entry == SubsurfaceEntry::kProfile;
    if (by_profile ? walker.leave_by_profile(path) : walker.walk(path)) queue_push(left, path);
  }
}

}  // namespace relief
