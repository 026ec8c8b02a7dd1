#include "integrator/photon_pass.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <concepts>
#include <numeric>

#include <tbb/parallel_for.h>

#include "integrator/checkpoint.h"
#include "integrator/flush_denormals.h"
#include "integrator/instance_box.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"

namespace relief {

namespace {

/// Radii in media, of those that have as many photons within as on surfaces: a ray finds those of its whole way, so that a quarter of
/// them will do. (How dense they lie is not told by so few.)
constexpr double kSmallerInMedia = 0.63;

Vec3f box_centre(const Box3& box) { return 0.5f * (box.low + box.high); }

float box_radius(const Box3& box) { return 0.5f * length(box.high - box.low); }

struct Caster {
  std::size_t instance;
  Box3 box;
};

/// Splits casters at the median of their widest axis until a group is small enough.
void group(std::vector<Caster>::iterator begin,
           std::vector<Caster>::iterator end,
           std::ptrdiff_t largest,
           PhotonSources& out)
{
  if (end - begin <= largest) {
    Box3 box = begin->box;
    for (auto caster = begin; caster != end; ++caster) {
      box = box_union(box, caster->box);
      out.target_of[caster->instance] = static_cast<std::int32_t>(out.targets.size());
    }
    out.targets.push_back(box);
    return;
  }
  Box3 centres = box_empty();
  for (auto caster = begin; caster != end; ++caster) {
    const Vec3f c = box_centre(caster->box);
    centres = box_union(centres, {c, c});
  }
  const Vec3f size = centres.high - centres.low;
  const auto key = [&](const Caster& caster) {
    const Vec3f c = box_centre(caster.box);
    return size.x >= size.y && size.x >= size.z ? c.x : size.y >= size.z ? c.y : c.z;
  };
  const auto middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end, [&](const Caster& a, const Caster& b) {
    return key(a) != key(b) ? key(a) < key(b) : a.instance < b.instance;
  });
  group(begin, middle, largest, out);
  group(middle, end, largest, out);
}

/// A box as seen from a light's place.
struct BoxSeen {
  BoxSeen(const Light& light, const Box3& box)
  {
    const Vec3f to_box = box_centre(box) - light.P;
    distance = length(to_box);
    const float radius = box_radius(box);
    const Vec3f D = distance > 0.0f ? to_box / distance : light.axis;
    const float outside = std::max(distance, radius);
    omega = std::min(2.0 * static_cast<double>(kPi),
                     static_cast<double>(box_shadow_area(box, D)) / static_cast<double>(sqr(outside)));
    // How far the box, seen from anywhere on a ball, reaches from its centre's direction.
    const float reach = radius + light.radius;
    const float spread = distance > reach ? std::asin(reach / distance) : kPi;
    angle = std::max(0.0f, std::acos(clamp(dot(D, light.axis), -1.0f, 1.0f)) - spread);
  }

  float distance;
  double omega;  ///< solid angle, sr
  float angle;   ///< the least between the light's axis and a direction to the box
};

/// Estimate of the flux from a light to a box, W, by the light's form.
/// @param emitted  light_scalar of its emission
double flux_to_box(FarLight, const Light& light, double emitted, const Box3& box)
{
  return emitted * static_cast<double>(box_shadow_area(box, light.axis));
}

template <std::derived_from<BallLight> Kind>
double flux_to_box(Kind kind, const Light& light, double emitted, const Box3& box)
{
  const BoxSeen seen(light, box);
  return light_falloff(kind, light, std::cos(seen.angle)) > 0.0f ? emitted * seen.omega : 0.0;
}

double flux_to_box(FlatLight, const Light& light, double emitted, const Box3& box)
{
  const BoxSeen seen(light, box);
  const float extent = length(light.edge_u) + length(light.edge_v);
  const float slack = seen.distance > extent ? std::asin(extent / seen.distance) : kPi;
  const float cosine = light.two_sided ? 1.0f : std::cos(std::max(0.0f, seen.angle - slack));
  return cosine > 0.0f ? emitted * static_cast<double>(light.area * std::max(cosine, 0.05f)) * seen.omega : 0.0;
}

/// Estimate of the flux from a light to a box, W; 0 only where there is none.
double flux_estimate(const Light& light, const Box3& box)
{
  const double emitted = static_cast<double>(light_scalar(light.emission));
  return light_visit(light, [&](auto kind) { return flux_to_box(kind, light, emitted, box); });
}

/// The most of it while the shutter is open, for a light that moves.
double most_flux(const LightsView& lights, LightRef ref, const Box3& box)
{
  Light storage;
  if (lights.lights[ref.light_index].motion_index < 0) return flux_estimate(lights_at(lights, ref, storage), box);
  constexpr int kTimes = 16;
  double most = 0;
  for (int i = 0; i <= kTimes; ++i) {
    most = std::max(most, flux_estimate(lights_at(lights, ref, storage, static_cast<float>(i) / kTimes), box));
  }
  return most;
}

}  // namespace

PhotonSourcesView PhotonSources::view(double photons_a_pass) const
{
  PhotonSourcesView v;
  v.sources = sources.data();
  v.cdf = cdf.data();
  v.num_sources = static_cast<std::uint32_t>(sources.size());
  v.targets = targets.data();
  v.target_of = target_of.data();
  v.scene_box = scene_box;
  v.photons_a_pass = photons_a_pass;
  if (!factors.empty()) v.factors = factors.data();
  return v;
}

PhotonSources photon_sources_make(const SceneContext& context)
{
  const Scene& scene = context.scene;
  PhotonSources out;
  out.target_of.assign(scene.instances.size(), -1);
  std::vector<Caster> casters;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if ((scene.instances[i].flags & kCausticCaster) != 0) casters.push_back({i, {}});
  }
  std::vector<LightRef> lights;
  const auto add_lights = [&](std::size_t first, std::size_t count, std::int32_t copy) {
    for (std::size_t i = first; i < first + count; ++i) {
      const Light& light = context.lights.lights[i];
      if (light.casts_caustics && !is_zero(light.emission)) lights.push_back({static_cast<std::int32_t>(i), copy});
    }
  };
  std::size_t next = 0;
  for (const SharedLights& shared : context.lights.shared) {
    add_lights(next, shared.first_light - next, -1);
    next = shared.first_light + shared.num_lights;
    for (std::uint32_t copy = 0; copy < shared.num_copies; ++copy) {
      add_lights(shared.first_light, shared.num_lights, static_cast<std::int32_t>(shared.first_copy + copy));
    }
  }
  add_lights(next, context.lights.lights.size() - next, -1);
  if (context.lights.environment_casts_caustics && context.lights.environment_flux_density > 0) lights.push_back({});
  if (casters.empty() || lights.empty()) return out;

  tbb::parallel_for(std::size_t{0}, casters.size(),
                    [&](std::size_t i) { casters[i].box = instance_box(context, casters[i].instance); });
  // A choice has 24 random bits: pairs beyond this many would be chosen unevenly.
  constexpr std::size_t kMostPairs = 1u << 16;
  const std::size_t most_groups = std::max<std::size_t>(1, kMostPairs / lights.size());
  group(casters.begin(), casters.end(), static_cast<std::ptrdiff_t>((casters.size() + most_groups - 1) / most_groups),
        out);

  out.scene_box = context.accel->bounds();
  const LightsView light_view = context.lights.view();
  for (const LightRef light : lights) {
    for (std::size_t t = 0; t < out.targets.size(); ++t) {
      const Box3& box = out.targets[t];
      const Vec3f size = box.high - box.low;
      const double surface = 2.0 * static_cast<double>(size.x * size.y + size.y * size.z + size.z * size.x);
      const double flux =
          light.light_index < 0 ? context.lights.environment_flux_density * surface : most_flux(light_view, light, box);
      if (!(flux > 0)) continue;
      out.sources.push_back({light, static_cast<std::uint32_t>(t)});
      out.cdf.push_back(std::min(flux, 1e30));
    }
  }
  if (out.sources.empty()) return out;
  const double sum = std::accumulate(out.cdf.begin(), out.cdf.end(), 0.0);
  double before = 0;
  for (double& entry : out.cdf) {
    // An estimate may be wrong; none is trusted to be less than a tenth of the mean.
    const double share = 0.9 * entry / sum + 0.1 / static_cast<double>(out.sources.size());
    entry = before;
    before += share;
  }
  for (double& entry : out.cdf) entry /= before;
  out.cdf.push_back(1.0);
  return out;
}

double photons_wanted(const RenderSettings& settings)
{
  constexpr double kFewest = 1 << 15;
  const double num_pixels = static_cast<double>(settings.width) * settings.height;
  const double asked = settings.caustics.photons;
  return std::min(asked > 0 ? std::max(asked, 1.0) : std::max(num_pixels, kFewest), 1e8);
}

std::uint32_t photon_turn_samples(double active)
{
  // Batches hold no more, and more would be beyond what the threshold asks for.
  constexpr double kMostOfMap = kMostPassSamples / 2;
  if (active >= 1) return 1;
  return 2 * static_cast<std::uint32_t>(std::min(std::ceil(1 / active), kMostOfMap));
}

PhotonPass::PhotonPass(const SceneContext& context, const RenderSettings& settings, PhotonSources sources)
    : context_(context), settings_(settings.caustics), sources_(std::move(sources))
{
  photons_a_pass_ = static_cast<std::uint32_t>(sources_.share * photons_wanted(settings));
  if (settings.noise_threshold > 0) settings_.memory_mib /= kMaps;
}

void PhotonPass::keep_to_memory(const KernelGlobals& g, const StageTable& stages, Wavefront& worker)
{
  // Of a photon that is kept: as it was traced, its place in the map, which may have grown by doubling, and in its buckets,
  // while it is sorted and while its like are counted.
  constexpr double kBytes = sizeof(Photon) + 2.0 * (sizeof(PhotonArrival) + 4 * sizeof(float) + 8) + 52;
  const double most_kept = std::max(1.0, settings_.memory_mib * 1048576.0 / kBytes);
  // A path is kept at each surface that it meets, if they are all casters that show caustics: rough glass for one.
  // And before each of them in a medium.
  const double kinds = shows_photons_in_media(context_.scene) ? 2 : 1;
  if (photons_a_pass_ * (g.limits.total + 1.0) * kinds <= most_kept) return;
  KeptPhotons kept;
  worker.trace_photons(g, *context_.accel, stages, context_.surface_kernels(true), sources_.view(photons_a_pass_), 0,
                       kBatchPaths, kept);
  // What these paths leave out of account: four standard errors of as many that each keep nothing or one.
  constexpr double kMargin = 1 + 4.0 / 64;
  const auto num_kept = static_cast<double>(kept.on_surfaces.size() + kept.in_media.size());
  const double kept_a_path = kMargin * std::max(1.0, num_kept) / kBatchPaths;
  photons_a_pass_ = static_cast<std::uint32_t>(std::clamp(most_kept / kept_a_path, 1.0, 1.0 * photons_a_pass_));
}

void PhotonPass::restore(const PhotonPassState& state, std::uint32_t skipped)
{
  photons_a_pass_ = state.photons_a_pass;
  surfaces_.first_radius = state.first_radius;
  media_.first_radius = state.first_radius_in_media;
  stored_ = state.stored;
  seconds_ = state.seconds;
  passes_ = state.passes;
  num_maps_ = state.maps;
  served_ = state.served;
  skipped_ = skipped;
  are_lost_ = true;
}

void PhotonPass::next_turn(std::array<KernelGlobals, kMaps>& g,
                           std::uint32_t samples,
                           double active,
                           const StageTable& stages,
                           const std::function<Wavefront&()>& worker,
                           const std::atomic<bool>& stop,
                           const std::function<void()>& report)
{
  const std::uint32_t wanted = samples > 1 ? kMaps : 1;
  // A turn of one sample has photons of its own.
  const bool are_used_up = wanted == 1 || num_maps_ < wanted || served_ >= num_maps_;
  if (are_used_up) {
    num_maps_ = wanted;
    served_ = 0;
  } else if (are_lost_) {
    passes_ -= num_maps_;
  }
  if (are_used_up || are_lost_) {
    const std::uint64_t stored = stored_;
    for (std::uint32_t slot = 0; slot < num_maps_; ++slot) next(g[slot], slot, stages, worker, stop, report);
    if (!are_used_up) stored_ = stored;
  }
  are_lost_ = false;
  served_ += samples * active;
}

std::vector<float> PhotonPass::radii(Kept& kept, PhotonPlaces places) const
{
  const double within = sources_.within;
  std::size_t count = 0;
  for (const std::vector<Photon>& chunk : kept.chunks) count += chunk.size();
  if (count == 0) return {};
  const bool is_set = settings_.radius > 0;
  float& first = kept.first_radius;
  if (!(first > 0)) first = is_set ? settings_.radius : photon_radius_for(kept.chunks, within, places);
  // A single photon, or all at one point: their light is shown all the same.
  constexpr float kOfCaster = 0.1f;
  if (!(first > 0)) first = kOfCaster * box_radius(sources_.targets.front());
  std::vector<float> radii =
      is_set ? std::vector<float>(count, first) : photon_radii(kept.chunks, within, first, passes_, places);
  double factor = photon_radius_factor(passes_, settings_.alpha);
  if (places == PhotonPlaces::kMedia && !is_set) factor *= kSmallerInMedia;
  for (float& radius : radii) radius *= static_cast<float>(factor);
  return radii;
}

void PhotonPass::build_maps(KernelGlobals& g, std::size_t slot)
{
  const std::vector<float> on_surfaces = radii(surfaces_, PhotonPlaces::kSurfaces);
  if (!on_surfaces.empty()) {
    maps_[slot].build(surfaces_.chunks, on_surfaces);
    g.caustics.map = maps_[slot].view();
  }
  const std::vector<float> in_media = radii(media_, PhotonPlaces::kMedia);
  if (!in_media.empty()) {
    maps_in_media_[slot].build(media_.chunks, in_media);
    g.caustics.in_media = maps_in_media_[slot].view();
  }
  stored_ += on_surfaces.size() + in_media.size();
}

void PhotonPass::next(KernelGlobals& g,
                      std::size_t slot,
                      const StageTable& stages,
                      const std::function<Wavefront&()>& worker,
                      const std::atomic<bool>& stop,
                      const std::function<void()>& report)
{
  const auto start = std::chrono::steady_clock::now();
  g.caustics.map = {};
  g.caustics.in_media = {};
  // Every pixel's sample of this pass, and all of its photons, are of one time. No pixel of an image is there.
  g.caustics.time =
      sample_1d(sample_pixel_hash(g.seed, -2, -1), sample_sequence_index(passes_, g.log2_stream), kTimeDimension);
  if (!sources_.sources.empty()) {
    if (passes_ == 0) keep_to_memory(g, stages, worker());
    const PhotonSourcesView view = sources_.view(photons_a_pass_);
    const std::uint64_t first = std::uint64_t{passes_} * photons_a_pass_;
    const std::size_t num_chunks = (photons_a_pass_ + kBatchPaths - 1) / kBatchPaths;
    for (Kept* kept : {&surfaces_, &media_}) kept->chunks.resize(num_chunks);
    tbb::parallel_for(
        std::size_t{0}, num_chunks,
        [&](std::size_t c) {
          for (Kept* kept : {&surfaces_, &media_}) kept->chunks[c].clear();
          if (stop.load(std::memory_order_relaxed)) return;
          const FlushDenormals flush;
          const auto begin = static_cast<std::uint32_t>(c) * kBatchPaths;
          const std::uint32_t count = std::min(kBatchPaths, photons_a_pass_ - begin);
          // Tracing wants room for all paths of a batch, of which few may be kept.
          KeptPhotons kept;
          worker().trace_photons(g, *context_.accel, stages, context_.surface_kernels(true), view, first + begin, count,
                                 kept);
          surfaces_.chunks[c].assign(kept.on_surfaces.begin(), kept.on_surfaces.end());
          media_.chunks[c].assign(kept.in_media.begin(), kept.in_media.end());
          under_way_ += count;
          report();
        },
        tbb::simple_partitioner());
    build_maps(g, slot);
  }
  ++passes_;
  under_way_ = 0;
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void PhotonPass::skip_to(std::uint32_t pass)
{
  skipped_ += pass - passes_;
  passes_ = pass;
}

std::uint64_t PhotonPass::photons() const
{
  return sources_.sources.empty() ? 0 : std::uint64_t{passes_ - skipped_} * photons_a_pass_ + under_way_.load();
}

void PhotonPass::fill(CausticStatistics& stats) const
{
  stats.passes = passes_ - skipped_;
  stats.photons = photons();
  stats.stored = stored_;
  stats.num_sources = sources_.sources.size();
  stats.first_radius = surfaces_.first_radius > 0 ? surfaces_.first_radius : media_.first_radius;
  stats.radius = passes_ > 0 ? stats.first_radius * photon_radius_factor(passes_ - 1, settings_.alpha) : 0;
  stats.seconds = seconds_;
  stats.bytes = 0;
  for (const PhotonMap& map : maps_) stats.bytes += map.bytes();
  for (const MediumPhotonMap& map : maps_in_media_) stats.bytes += map.bytes();
  for (const Kept* kept : {&surfaces_, &media_}) {
    for (const std::vector<Photon>& chunk : kept->chunks) stats.bytes += chunk.capacity() * sizeof(Photon);
  }
}

}  // namespace relief
