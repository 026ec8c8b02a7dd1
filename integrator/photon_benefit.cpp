#include "integrator/photon_benefit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include "integrator/flush_denormals.h"
#include "integrator/media.h"
#include "integrator/photon_guide.h"
#include "scene/material_traits.h"

namespace relief {

namespace {

constexpr double kPilotPi = 3.14159265358979;

/// Samples of a pixel in the pilot: as few as quarters of them can be told apart, see error_extrapolate.
constexpr std::uint32_t kPilotSamples = 8;

/// Paths that a pilot needs to say anything.
constexpr double kLeastPilotPaths = 4096;

/// What of its sources' factors a pilot's photons carry: so little that the beauty is that without caustics.
constexpr double kTrace = 1e-9;

/// Solid angle of even light that leaves the noise that a lobe does: the mean of GGX's density by itself is a third of its
/// peak, 1/(4πα²) for what is reflected.
double lobe_solid_angle(double alpha) { return std::min(12 * kPilotPi * alpha * alpha, 2 * kPilotPi); }

/// Lobes of a group of casters.
struct GroupLobes {
  double alpha = 1;  ///< width of the sharpest, by the factors of their roughness
  double ior = 0;    ///< of those that let light in; 0: none does
};

std::vector<GroupLobes> group_lobes(const Scene& scene, const PhotonSources& sources)
{
  std::vector<GroupLobes> groups(sources.targets.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (sources.target_of[i] < 0) continue;
    const Material& material = scene.materials[static_cast<std::size_t>(scene.instances[i].material_index)];
    GroupLobes& group = groups[static_cast<std::size_t>(sources.target_of[i])];
    const auto roughness = static_cast<double>(material.roughness);
    group.alpha = std::min(group.alpha, roughness * roughness);
    if (material_lets_light_in(material)) group.ior = std::max(group.ior, static_cast<double>(material.ior));
  }
  return groups;
}

/// Least width α of what paths see after a diffuse bounce: as path_blur.
double blurred_alpha(double filter_glossy)
{
  constexpr double kDensity = 0.2;  // of directions by a cosine, in the middle
  return kDensity < filter_glossy ? 0.5 * std::sqrt(1 - kDensity / filter_glossy) : 0.0;
}

/// What the pilot's photons carry of their power.
std::vector<float> pilot_factors(const SceneContext& context,
                                 const PhotonSources& sources,
                                 const RenderSettings& settings)
{
  const std::vector<GroupLobes> lobes = group_lobes(context.scene, sources);
  const LightsView lights = context.lights.view();
  std::vector<float> factors;
  for (const PhotonSource& source : sources.sources) {
    const GroupLobes& of_group = lobes[source.target];
    const Box3& box = sources.targets[source.target];
    const double alpha = std::max(of_group.alpha, blurred_alpha(static_cast<double>(settings.filter_glossy)));
    CausticLight light;
    if (source.light.light_index < 0) {
      light = {4 * context.lights.environment_flux_density,
               std::max(context.lights.environment_solid_angle,
                        lobe_solid_angle(caster_bending(of_group.ior, false) * alpha))};
    } else {
      Light storage;
      const Light& lamp = lights_at(lights, source.light, storage, 0.5f);
      light = caustic_light(lamp, box, caster_bending(of_group.ior, box_contains(box, lamp.P)) * alpha);
    }
    factors.push_back(static_cast<float>(
        kTrace * caustic_second_moment(light, static_cast<double>(settings.clamp_indirect), settings.samples)));
  }
  return factors;
}

/// What a pilot has seen.
struct Pilot {
  double seen_error = 0;     ///< squared error of the beauty, of one sample, relative as Statistics::error_relmse
  double caustic_error = 0;  ///< that of caustics by paths
  double photon_error = 0;   ///< that of caustics by photons
  Counters counters;         ///< of camera paths and photons
  double stored = 0;         ///< photons
};

/// @param mean_factor  of the photons that carry the light; 0: all of theirs, and the beauty has it
Pilot pilot_read(Film& film, double mean_factor)
{
  Pilot pilot;
  const FilmAccumulatorView sums = film.accumulator();
  double least_seen = 0, most_seen = 0;
  const auto squared = [](double x) { return x * x; };
  for (std::uint32_t p = 0; p < film.num_pixels(); ++p) {
    const float* record = film_record(sums, p);
    for (int c = 0; c < 3; ++c) {
      const auto sum_of = [&](int quantity) { return static_cast<double>(record[quantity + c]); };
      double caustic = 0;
      if (mean_factor > 0) {
        const double squares = sum_of(sums.layout.caustic) / kPilotSamples / kTrace;
        caustic = squares / mean_factor;
        const double scale = 1 / (squared(sum_of(AccumulatorLayout::kBeauty) / kPilotSamples + caustic) + 0.01);
        pilot.caustic_error += squares * scale;
        pilot.photon_error += caustic * caustic * scale;
      }
      // What a half's quarters differ by, beside the other half and beside its own: the other may miss what is small and bright,
      // and a firefly is none beside its own light.
      constexpr double kHalf = kPilotSamples / 2;
      const double even = sum_of(AccumulatorLayout::kEven), odd = sum_of(AccumulatorLayout::kBeauty) - even;
      const double even_error = squared(2 * sum_of(AccumulatorLayout::kQuarter0) - even) / kPilotSamples;
      const double odd_error = squared(2 * sum_of(AccumulatorLayout::kQuarter1) - odd) / kPilotSamples;
      const double beside_even = squared(even / kHalf + caustic) + 0.01;
      const double beside_odd = squared(odd / kHalf + caustic) + 0.01;
      most_seen += even_error / beside_odd + odd_error / beside_even;
      least_seen += even_error / beside_even + odd_error / beside_odd;
    }
  }
  // Some 24 photons stand for a density, weighed by Epanechnikov's kernel: a relative variance of 4/3 over their number.
  constexpr double kDensityVariance = 4.0 / 3 / 24;
  const double count = 3.0 * static_cast<double>(film.num_pixels());
  pilot.seen_error = std::sqrt(least_seen * most_seen) / count;
  pilot.caustic_error /= count;
  pilot.photon_error *= kDensityVariance / count;
  return pilot;
}

/// A film of few pixels, each of the size of one of the whole picture's.
/// @param g  gets it
Film pilot_film(const RenderSettings& settings, double num_pixels, KernelGlobals& g)
{
  const double aspect = static_cast<double>(settings.width) / settings.height;
  const int width = std::clamp(static_cast<int>(std::sqrt(num_pixels * aspect)), 1, settings.width);
  const int height = std::clamp(static_cast<int>(num_pixels / width), 1, settings.height);
  Film film(width, height, aov_bit(Aov::kBeauty) | aov_bit(Aov::kCaustic));
  g.film = film.accumulator();
  g.filter_width *= static_cast<float>(width) / static_cast<float>(settings.width);
  g.full_width = width;
  g.full_height = height;
  g.crop_x = g.crop_y = 0;
  g.log2_stream = sample_log2_stream(kPilotSamples);
  return film;
}

Wavefront pilot_worker(const SceneContext& context, const Media& media, const std::atomic<bool>& stop)
{
  Wavefront worker(context.columns(true, false));
  worker.stop = &stop;
  if (media.exist()) worker.media = &media;
  return worker;
}

/// Renders such a film.
/// @param num_pixels  of it, about
Pilot pilot_run(const SceneContext& context,
                const RenderOptions& options,
                const KernelGlobals& of_render,
                PhotonSources sources,
                std::uint32_t num_photons,
                double num_pixels,
                std::uint64_t seed,
                const std::atomic<bool>& stop)
{
  const RenderSettings& settings = options.settings;
  KernelGlobals g = of_render;
  g.seed = seed;
  Film film = pilot_film(settings, num_pixels, g);
  const StageTable& stages = stage_table_select();
  const Media media(context);
  tbb::enumerable_thread_specific<Wavefront> workers([&] { return pilot_worker(context, media, stop); });
  double factors = 0;
  for (std::size_t i = 0; i < sources.factors.size(); ++i) {
    factors += static_cast<double>(sources.factors[i]) * (sources.cdf[i + 1] - sources.cdf[i]);
  }
  RenderSettings of_pilot = settings;
  of_pilot.caustics.photons = num_photons;
  PhotonPass photons(context, of_pilot, std::move(sources));
  photons.next(
      g, 0, stages, [&]() -> Wavefront& { return workers.local(); }, stop, [] {});
  tbb::parallel_for(0, film.num_tiles(), [&](int tile) {
    const FlushDenormals flush;
    workers.local().run(g, *context.accel, stages, context.surface_kernels(true),
                        tile_batch(film, tile, 0, kPilotSamples));
    film.add_tile_samples(tile, kPilotSamples);
  });
  Pilot pilot = pilot_read(film, factors / kTrace);
  for (const Wavefront& worker : workers) counters_add(pilot.counters, worker.counters);
  CausticStatistics traced;
  photons.fill(traced);
  pilot.stored = static_cast<double>(traced.stored);
  return pilot;
}

/// Cost of a sample with photons over that of one without, by the rays that both take.
struct PhotonCosts {
  double searches = 0;  ///< in samples' costs
  double photons = 0;   ///< likewise, of all that are wanted

  double ratio(double share) const { return 1 + searches + share * photons; }
};

/// @param photons_a_sample  wanted
PhotonCosts photon_costs(const Pilot& pilot, bool has_media, double samples, double photons_a_sample)
{
  // In rays of camera paths, shading included. Measured on scenes of few and of many objects and lamps: a photon's ray is one
  // to 1.8 of them, a photon that is kept 0.5 (it is sorted into the map), a search for photons 0.7 to 2.
  constexpr double kPhotonRay = 1.5, kStored = 0.5, kSearch = 1.5;
  const Counters& c = pilot.counters;
  const auto rays = static_cast<double>(c.camera_rays + c.bounce_rays + c.shadow_rays);
  const double of_photons =
      (kPhotonRay * static_cast<double>(c.photon_rays) + kStored * pilot.stored) / static_cast<double>(c.photon_paths);
  // In media each ray is one as well.
  const std::uint64_t in_media = has_media ? c.camera_rays + c.bounce_rays : 0;
  const double searches = kSearch * static_cast<double>(c.surface_hits + in_media);
  return {searches / rays, of_photons * photons_a_sample * samples / rays};
}

/// Part of the photons that are wanted which leaves the least squared error × cost. Beside noise that photons do not take away
/// fewer will do.
double best_share(const Pilot& pilot, double seen_error, const PhotonCosts& costs, double least)
{
  double best = 1;
  const auto effort = [&](double share) { return (seen_error + pilot.photon_error / share) * costs.ratio(share); };
  for (const double share : {0.5, 0.25}) {
    if (effort(std::max(share, least)) < effort(best)) best = std::max(share, least);
  }
  return best;
}

/// Sends photons where the picture shows them, see photon_sources_guide.
void photons_guide(const SceneContext& context,
                   const RenderSettings& settings,
                   const KernelGlobals& of_render,
                   const std::atomic<bool>& stop,
                   PhotonChoice& choice)
{
  PhotonSources& all = choice.sources;
  if (all.sources.size() < 2) return;
  // As many whatever is planned, so that the photons are the same if --resume takes more samples.
  constexpr std::uint32_t kPaths = 16384;
  KernelGlobals g = of_render;
  Film film = pilot_film(settings, static_cast<double>(kPaths) / kPilotSamples, g);
  // What is seen after one diffuse bounce; each further one would tell less.
  g.limits.diffuse = std::min(g.limits.diffuse, 1);
  g.caustics.time = 0.5f;
  // Other numbers than the render's: chances that follow from its own would favour what they bring.
  g.seed = ~g.seed;
  const StageTable& stages = stage_table_select();
  const Media media(context);
  tbb::enumerable_thread_specific<Wavefront> workers([&] { return pilot_worker(context, media, stop); });
  std::vector<std::vector<RecordedRay>> rays(static_cast<std::size_t>(film.num_tiles()));
  tbb::parallel_for(0, film.num_tiles(), [&](int tile) {
    const FlushDenormals flush;
    Wavefront& worker = workers.local();
    worker.recorder = &rays[static_cast<std::size_t>(tile)];
    worker.run(g, *context.accel, stages, context.surface_kernels(true), tile_batch(film, tile, 0, kPilotSamples));
  });
  std::vector<Vec3f> looks;
  for (const std::vector<RecordedRay>& of_tile : rays) {
    for (const RecordedRay& ray : of_tile) {
      if (!ray.shadow && ray.t < kInfinity) looks.push_back(ray.O + ray.D * ray.t);
    }
  }
  // Neighbours stand beside each other: what shows is told of groups of them where there are many.
  constexpr std::size_t kMostGroups = 1024;
  const std::size_t num_groups = std::min(all.sources.size(), kMostGroups);
  std::vector<std::size_t> groups;
  for (std::size_t j = 0; j <= num_groups; ++j) groups.push_back(j * all.sources.size() / num_groups);
  // Of those in media none is told: the half of all photons that is shared out as before brings what shows there alone.
  std::vector<KeptPhotons> kept(num_groups);
  tbb::parallel_for(std::size_t{0}, num_groups, [&](std::size_t j) {
    if (stop.load(std::memory_order_relaxed)) return;
    const FlushDenormals flush;
    const double before = all.cdf[groups[j]], chance = all.cdf[groups[j + 1]] - before;
    std::vector<double> cdf;
    for (std::size_t s = groups[j]; s <= groups[j + 1]; ++s) cdf.push_back((all.cdf[s] - before) / chance);
    // Two at least, so that there is one of each half.
    const auto count = 2 * static_cast<std::uint32_t>(std::ceil(std::max(kPaths * chance, 1.0) / 2));
    PhotonSourcesView view = all.view(count);
    view.sources += groups[j];
    view.num_sources = static_cast<std::uint32_t>(groups[j + 1] - groups[j]);
    view.cdf = cdf.data();
    view.factors = nullptr;
    for (std::uint32_t first = 0; first < count; first += kBatchPaths) {
      workers.local().trace_photons(g, *context.accel, stages, context.surface_kernels(true), view, first,
                                    std::min(kBatchPaths, count - first), kept[j]);
    }
  });
  std::vector<std::vector<Photon>> photons;
  for (KeptPhotons& of_group : kept) photons.push_back(std::move(of_group.on_surfaces));
  const double denser = photon_sources_guide(all, groups, photons, looks, photon_radius_for(photons, all.within));
  if (!(denser > 1)) return;
  char figures[96];
  std::snprintf(figures, sizeof figures, "; photons lie %.2g times as dense where the picture shows them", denser);
  choice.reason += figures;
}

/// A light as a box sees it: irradiance over light_scalar of its emission, and the solid angle that it fills.
struct LightSeen {
  double irradiance, solid_angle;
};

/// Distance at which a light shines on what a box holds: as near as its faces on each side, if it is inside; else no further than
/// the middle, and no more than twice as far as the nearest point, within which a plane there has half of the light.
double distance_to_box(const Light& light, const Box3& box)
{
  // A lamp that touches is near one point alone.
  const double least = std::max(1e-3 * static_cast<double>(length(box.high - box.low)), 1e-30);
  const Vec3f nearest = max(box.low, min(light.P, box.high));
  const auto outside = static_cast<double>(length(nearest - light.P));
  if (outside > 0) {
    const auto to_middle = static_cast<double>(length(0.5f * (box.low + box.high) - light.P));
    return std::max(std::min(2 * outside, to_middle), least);
  }
  const Vec3f inside = min(light.P - box.low, box.high - light.P);
  return std::max(static_cast<double>(inside.x + inside.y + inside.z) / 3, least);
}

LightSeen light_seen(FarLight, const Light& light, const Box3&)
{
  return {1, 2 * kPilotPi * static_cast<double>(light.cone)};
}

LightSeen light_seen(BallLight, const Light& light, const Box3& box)
{
  const double distance = distance_to_box(light, box);
  const double sine = std::min(1.0, static_cast<double>(light.radius) / distance);
  return {1 / (distance * distance), kPilotPi * sine * sine};
}

LightSeen light_seen(FlatLight, const Light& light, const Box3& box)
{
  constexpr double kLeastCosine = 0.05;
  const double distance = distance_to_box(light, box);
  const auto along = static_cast<double>(std::abs(dot(0.5f * (box.low + box.high) - light.P, light.axis)));
  const double omega =
      static_cast<double>(light.area) * std::clamp(along / distance, kLeastCosine, 1.0) / (distance * distance);
  return {omega, omega};
}

}  // namespace

double caster_bending(double ior, bool is_light_inside)
{
  if (!(ior > 0)) return 1;
  const double turn = std::abs(ior - 1) / (is_light_inside ? ior : 1.0);
  return std::clamp(0.5 * turn, 0.05, 1.0);
}

CausticLight caustic_light(const Light& light, const Box3& box, double alpha)
{
  const auto emitted = static_cast<double>(light_scalar(light.emission));
  const LightSeen seen = light_visit(light, [&](auto kind) { return light_seen(kind, light, box); });
  return {emitted * seen.irradiance, std::max(seen.solid_angle, lobe_solid_angle(alpha))};
}

double caustic_second_moment(CausticLight light, double clamp, double samples)
{
  // Of the light of a point in smooth glass paths bring nothing: its square is the error of any number of samples.
  const double most = samples * light.irradiance / kPilotPi;
  if (!(light.solid_angle > 0)) return most;
  // What receivers reflect, and casters on the way.
  constexpr double kReflected = 0.5;
  const double met = kReflected * light.irradiance / light.solid_angle;
  const double counted = clamp > 0 ? std::min(met, clamp) : met;
  return met > 0 ? std::min(counted * counted / met, most) : 0.0;
}

PhotonChoice photon_choice_make(const SceneContext& context,
                                const RenderOptions& options,
                                KernelGlobals& g,
                                const std::atomic<bool>& stop)
{
  PhotonChoice choice;
  choice.reason = context.caustics_reason;
  choice.photons = g.caustics.enabled;
  if (!choice.photons) return choice;
  choice.sources = photon_sources_make(context);
  const RenderSettings& settings = options.settings;
  if (settings.caustics.mode == CausticsMode::kOn) {
    photons_guide(context, settings, g, stop, choice);
    return choice;
  }
  const auto leave_to_paths = [&](std::string reason) {
    choice.photons = g.caustics.enabled = false;
    choice.sources = {};
    choice.reason = std::move(reason);
  };
  if (choice.sources.sources.empty()) {
    leave_to_paths("no light reaches what casts caustics");
    return choice;
  }

  const auto figures = [&](const char* if_so) {
    char text[160];
    std::snprintf(text, sizeof text, "take the squared error to 1/%.3g%s for %.3g times the cost", choice.error_ratio,
                  if_so, choice.cost_ratio);
    return std::string(text);
  };
  // The pilot is a hundredth of the render, as far as that says enough and not more than enough. A quarter of it will do where
  // photons do not pay by far.
  const double num_pixels = static_cast<double>(settings.width) * settings.height;
  const double whole = std::clamp(num_pixels * settings.samples / 128, kLeastPilotPaths, 32768.0);
  PhotonSources pilots = choice.sources;
  pilots.factors = pilot_factors(context, pilots, settings);
  const auto run = [&](const PhotonSources& sources, double paths, std::uint64_t seed) {
    return pilot_run(context, options, g, sources, static_cast<std::uint32_t>(paths), paths / kPilotSamples, seed,
                     stop);
  };
  // As many photons as a small picture has show what there is.
  constexpr double kFewest = 1 << 14;
  const double wanted = photons_wanted(settings);
  const double least_share = settings.caustics.photons > 0 ? 1.0 : std::min(1.0, kFewest / wanted);
  Pilot pilot;
  PhotonCosts costs;
  double without = 0;
  const auto compare = [&](double seen_error) {
    const double share = best_share(pilot, seen_error, costs, least_share);
    choice.sources.share = share;
    choice.cost_ratio = costs.ratio(share);
    choice.error_ratio = without / std::max(seen_error + pilot.photon_error / share, 1e-30);
  };
  for (const double part : {0.25, 1.0}) {
    const double paths = part * whole;
    if (paths < kLeastPilotPaths) continue;
    pilot = run(pilots, paths, g.seed);
    const bool shows = pilot.stored > 0 && pilot.caustic_error > 0;
    if (!shows && part < 1) continue;
    if (!shows) {
      leave_to_paths("no caustic shows in the picture");
      return choice;
    }
    without = pilot.seen_error + pilot.caustic_error;
    costs = photon_costs(pilot, shows_photons_in_media(context.scene), paths, wanted / num_pixels);
    // At best: no more is seen of the noise than without caustics.
    compare(pilot.seen_error);
    constexpr double kByFar = 0.6;
    if (choice.error_ratio > (part < 1 ? kByFar : 1.0) * choice.cost_ratio) continue;
    leave_to_paths("left to paths: photons would " + figures(" at best"));
    return choice;
  }
  // With photons a path that comes by chance to a bright caustic has noise of its own.
  const Pilot shown = run(choice.sources, whole, g.seed);
  const double seen_error = std::max(shown.seen_error, pilot.seen_error);
  compare(seen_error);
  // A single photon may have told that: where it is close, another pilot has to say so, too.
  constexpr double kClear = 2.5;
  if (choice.error_ratio > choice.cost_ratio && choice.error_ratio < kClear * choice.cost_ratio) {
    const Pilot second = run(pilots, whole, ~g.seed);
    pilot.photon_error = 0.5 * (pilot.photon_error + second.photon_error);
    without = pilot.seen_error + std::min(pilot.caustic_error, second.caustic_error);
    compare(seen_error);
  }
  if (choice.error_ratio <= choice.cost_ratio) {
    leave_to_paths("left to paths: photons would " + figures(""));
    return choice;
  }
  choice.reason += ": they " + figures("");
  photons_guide(context, settings, g, stop, choice);
  return choice;
}

}  // namespace relief
