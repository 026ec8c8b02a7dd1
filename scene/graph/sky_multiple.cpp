// The clear sky that Cycles 5 calls "multiple scattering": four wavelengths stand for the spectrum, and light that was scattered
// before is a fit to the earth's atmosphere.
//
// García Liñán 2022 and 2024, "Efficient spectral rendering of the sky": the atmosphere's numbers, the four wavelengths with
// their colours, and the fit. Hillaire 2016, "Physically Based Sky, Atmosphere and Cloud Rendering in Frostbite": the integral
// over a step.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "kernel/math/cie_1931.h"
#include "scene/graph/sky_columns.h"
#include "scene/graph/sky_model.h"
#include "scene/parallel.h"

namespace relief {
namespace {

constexpr float kPiAngle = 3.14159265f;
constexpr float kEarthRadius = 6371, kThickness = 100, kAtmosphereRadius = kEarthRadius + kThickness;  // kilometres
constexpr float kDustAnisotropy = 0.8f;
constexpr int kSteps = 64;

/// At 630, 560, 490 and 430 nm.
using Spectrum = std::array<float, 4>;
constexpr Spectrum kSunlight{1.679f, 1.828f, 1.986f, 1.307f};
constexpr Spectrum kAirScattering{6.605e-3f, 1.067e-2f, 1.842e-2f, 3.156e-2f};  // 1/km at sea level
constexpr Spectrum kOzoneCrossSection{3.472e-25f, 3.914e-25f, 1.349e-25f, 11.03e-27f};
constexpr Spectrum kDustAbsorption{2.8722e-24f, 4.6168e-24f, 7.9706e-24f, 1.3578e-23f};
constexpr Spectrum kDustScattering{1.5908e-22f, 1.7711e-22f, 2.0942e-22f, 2.4033e-22f};
constexpr Spectrum kMultipleFit{0.217f, 0.347f, 0.594f, 1.0f};
constexpr float kDobson = 334.5f, kDustDensity = 1.3681e20f, kDustBackground = 2e6f, kDustHeight = 0.73f;
constexpr float kGroundAlbedo = 0.3f;
constexpr Vec3f kXyz[4] = {{53.386917738564668f, 22.981337506691025f, 0.0f},
                           {43.904844466369358f, 71.347795700053394f, 0.10250686796574131f},
                           {1.6137278251608962f, 18.422960591455485f, 31.742921188390806f},
                           {20.762668673810577f, 2.3614213523314369f, 110.48009643252140f}};

Vec3f color_of(const Spectrum& power)
{
  Vec3f xyz;
  for (std::size_t w = 0; w < power.size(); ++w) xyz += kXyz[w] * power[w];
  return rec709_of_xyz(xyz);
}

/// What a kilometre of the atmosphere does at some height.
struct Matter {
  Spectrum air, dust;   ///< scattered
  Spectrum extinction;  ///< scattered or absorbed
};

Matter matter_at(const SkyModel& sky, float height)
{
  const float air = sky.air * std::exp(-0.07771971f * std::pow(height, 1.16364243f));
  const float log_height = std::log(std::max(height, 1e-4f));
  const float layer = log_height - 3.22261f;
  const float ozone = sky.ozone * kDobson * 3.78547397e20f * std::exp(-5.55555555f * layer * layer - log_height);
  const float dust = sky.dust * kDustDensity * (std::exp(-height / kDustHeight) + kDustBackground / kDustDensity);
  Matter m;
  for (std::size_t w = 0; w < m.air.size(); ++w) {
    m.air[w] = kAirScattering[w] * air;
    m.dust[w] = kDustScattering[w] * dust;
    m.extinction[w] = m.air[w] + m.dust[w] + kOzoneCrossSection[w] * ozone + kDustAbsorption[w] * dust;
  }
  return m;
}

float height_of(Vec3f p) { return std::max(length(p) - kEarthRadius, 0.0f); }

/// Distance to a sphere around the earth's centre; negative: the ray misses it.
float distance_to(Vec3f p, Vec3f d, float radius)
{
  const float b = dot(p, d), c = dot(p, p) - radius * radius;
  if (c > 0 && b > 0) return -1;
  const float root = b * b - c;
  if (root < 0) return -1;
  return root >= b * b ? -b + std::sqrt(root) : -b - std::sqrt(root);
}

/// As far from the zenith as the sun is.
Vec3f towards_sun_at(float cosine) { return {-std::sqrt(std::max(0.0f, 1 - cosine * cosine)), 0, cosine}; }

/// What is left of the sun's light at a height, where the earth is no shadow but dense air.
/// @param cosine  of the sun's angle to the zenith
Spectrum sunlight_left(const SkyModel& sky, float cosine, float height)
{
  const Vec3f origin{0, 0, kEarthRadius + height}, d = towards_sun_at(cosine);
  const float step = distance_to(origin, d, kAtmosphereRadius) / kSteps;
  Spectrum depth{};
  for (int i = 0; i < kSteps; ++i) {
    const Matter m = matter_at(sky, height_of(origin + d * ((static_cast<float>(i) + 0.5f) * step)));
    for (std::size_t w = 0; w < depth.size(); ++w) depth[w] += m.extinction[w] * step;
  }
  for (float& x : depth) x = std::exp(-x);
  return depth;
}

/// sunlight_left by the sun's cosine, −1 to 1, and by the height.
class SunlightTable {
 public:
  explicit SunlightTable(const SkyModel& sky)
  {
    for_each_in_parallel(kRows, [&](std::size_t y) {
      for (std::size_t x = 0; x < kColumns; ++x) {
        const float cosine = 2 * static_cast<float>(x) / (kColumns - 1) - 1;
        cells_[y][x] = sunlight_left(sky, cosine, kThickness * static_cast<float>(y) / (kRows - 1));
      }
    });
  }

  Spectrum at(float cosine, float height) const
  {
    const Place x = place(cosine * 0.5f + 0.5f, kColumns), y = place(height / kThickness, kRows);
    Spectrum out;
    for (std::size_t w = 0; w < out.size(); ++w) {
      const float low = lerp(x.rest, cells_[y.first][x.first][w], cells_[y.first][x.second][w]);
      const float high = lerp(x.rest, cells_[y.second][x.first][w], cells_[y.second][x.second][w]);
      out[w] = lerp(y.rest, low, high);
    }
    return out;
  }

 private:
  static constexpr std::size_t kColumns = 256, kRows = 64;
  struct Place {
    std::size_t first, second;
    float rest;
  };
  static Place place(float at, std::size_t size)
  {
    const float x = std::clamp(at, 0.0f, 1.0f) * static_cast<float>(size - 1);
    const auto first = static_cast<std::size_t>(x);
    return {first, std::min(first + 1, size - 1), x - static_cast<float>(first)};
  }
  Spectrum cells_[kRows][kColumns];
};

/// Light that comes to a point in equal parts from all around, having been scattered by the ground or elsewhere in the air.
/// @param cosine  of the sun's angle to the point's zenith
Spectrum scattered_before(const SunlightTable& sunlight, float cosine, float height)
{
  const float sine = kEarthRadius / (kEarthRadius + height);
  const float ground_angle = 2 * kPiAngle * (1 - std::sqrt(std::max(0.0f, 1 - sine * sine)));
  const Spectrum ground = sunlight.at(cosine, 0), whole = sunlight.at(1, 0), above = sunlight.at(1, height);
  const float fit = 0.02f / (1 + 5 * std::exp(-17.92f * cosine));
  Spectrum out;
  for (std::size_t w = 0; w < out.size(); ++w) {
    const float from_ground =
        ground_angle / (4 * kPiAngle) * (kGroundAlbedo / kPiAngle) * ground[w] * whole[w] / above[w] * cosine;
    out[w] = kMultipleFit[w] * fit + from_ground;
  }
  return out;
}

SkySums sums_from(const SkyModel& sky, const SunlightTable& sunlight, Vec3f eye, Vec3f d, Vec3f towards_sun)
{
  const float to_ground = distance_to(eye, d, kEarthRadius);
  const float step = (to_ground < 0 ? distance_to(eye, d, kAtmosphereRadius) : to_ground) / kSteps;
  Spectrum air{}, dust{}, even{}, left{1, 1, 1, 1};
  for (int i = 0; i < kSteps; ++i) {
    const Vec3f p = eye + d * ((static_cast<float>(i) + 0.5f) * step);
    const float sun_cosine = dot(p, towards_sun) / length(p), height = height_of(p);
    const Matter m = matter_at(sky, height);
    const Spectrum direct = sunlight.at(sun_cosine, height), before = scattered_before(sunlight, sun_cosine, height);
    for (std::size_t w = 0; w < left.size(); ++w) {
      const float passed = std::exp(-step * m.extinction[w]);
      const float seen = kSunlight[w] * left[w] * (1 - passed) / std::max(m.extinction[w], 1e-7f);
      air[w] += seen * m.air[w] * direct[w];
      dust[w] += seen * m.dust[w] * direct[w];
      even[w] += seen * (m.air[w] + m.dust[w]) * before[w];
      left[w] *= passed;
    }
  }
  return {color_of(air), color_of(dust), color_of(even)};
}

/// @param cosine  of the angle between the direction and the sun
Vec3f radiance_of(const SkySums& sums, float cosine)
{
  constexpr float kG = kDustAnisotropy;
  const float air_phase = 3 / (16 * kPiAngle) * (1 + cosine * cosine);
  const float dust_phase = (1 - kG * kG) / (4 * kPiAngle * std::pow(1 + kG * kG - 2 * kG * cosine, 1.5f));
  return sums.air * air_phase + sums.dust * dust_phase + sums.even;
}

/// Kilometres at which the model still works.
float height_of_eye(const SkyModel& sky) { return std::clamp(sky.altitude, 1.0f, 99999.0f) / 1000; }

}  // namespace

std::vector<float> sky_multiple_table(const SkyModel& sky)
{
  constexpr std::size_t kColumns = kSkyColumns, kRows = kScatteringRows;
  std::vector<float> table(kColumns * kRows * 3);
  const auto sunlight = std::make_unique<SunlightTable>(sky);
  const Vec3f towards_sun = towards_sun_at(std::sin(sky.sun_elevation));
  const Vec3f eye{0, 0, kEarthRadius + height_of_eye(sky)};
  for_each_in_parallel(kRows, [&](std::size_t y) {
    const float v = 2 * (static_cast<float>(y) + 0.5f) / kRows - 1;
    const float elevation = std::copysign(v * v, v) * kPiAngle / 2;
    const auto direction_at = [&](float place) {
      const float turn = 2 * kPiAngle * place / kColumns;
      return Vec3f{std::cos(elevation) * std::cos(turn), std::cos(elevation) * std::sin(turn), std::sin(elevation)};
    };
    std::vector<SkySums> knots;
    for (std::size_t k = 0; k < kSkyKnots; ++k) {
      knots.push_back(sums_from(sky, *sunlight, eye, direction_at(static_cast<float>(k * kSkyStride)), towards_sun));
    }
    for (std::size_t x = 0; x < kColumns / 2; ++x) {
      const float place = static_cast<float>(x) + 0.5f;
      const Vec3f radiance = radiance_of(sky_sums_at(knots, place), dot(direction_at(place), towards_sun));
      for (const std::size_t column : {x, kColumns - 1 - x}) {
        float* texel = &table[(y * kColumns + column) * 3];
        texel[0] = radiance.x, texel[1] = radiance.y, texel[2] = radiance.z;
      }
    }
  });
  return table;
}

Vec3f sky_multiple_sun_radiance(const SkyModel& sky, float elevation, float solid_angle)
{
  Spectrum power = sunlight_left(sky, std::sin(elevation), height_of_eye(sky));
  for (std::size_t w = 0; w < power.size(); ++w) power[w] *= kSunlight[w] / solid_angle;
  return color_of(power);
}

}  // namespace relief
