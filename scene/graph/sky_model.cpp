#include "scene/graph/sky_model.h"

#include <algorithm>
#include <cmath>

#include "kernel/math/cie_1931.h"
#include "scene/graph/sky_columns.h"
#include "scene/parallel.h"

namespace relief {
namespace {

constexpr float kPiAngle = 3.14159265f;
constexpr float kEarthRadius = 6360e3f, kAtmosphereRadius = 6420e3f;  // metres
constexpr float kAirHeight = 8e3f, kDustHeight = 1.2e3f;              // in which densities fall to 1/e
constexpr float kDustScattering = 2e-5f;                              // 1/m at sea level
constexpr float kDustExtinction = 1.11f * kDustScattering;
constexpr float kDustAnisotropy = 0.76f;
constexpr int kSegments = 32;
constexpr float kWavelengthStep = 20;  // nm

/// What depends on a wavelength; from 380 to 780 nm.
struct Wavelength {
  float sunlight;  ///< above the atmosphere, W/m²/nm
  float air;       ///< scattered, 1/m at sea level
  float ozone;     ///< absorbed, 1/m where it is densest
  float x, y, z;   ///< CIE 1931
};
constexpr Wavelength kSpectrum[] = {
    {1.45756829855f, 5.424820087636e-5f, 3.25126849861e-9f, 0.001368f, 0.000039f, 0.006450001f},
    {1.56596305559f, 4.418549866505e-5f, 5.85395365047e-9f, 0.01431f, 0.000396f, 0.06785001f},
    {1.65148449067f, 3.635151910165e-5f, 1.977191155085e-8f, 0.13438f, 0.004f, 0.6456f},
    {1.71496242737f, 3.017929012024e-5f, 7.309568762914e-8f, 0.34828f, 0.023f, 1.74706f},
    {1.75797983805f, 2.526320226989e-5f, 2.0084561514287e-7f, 0.2908f, 0.06f, 1.6692f},
    {1.78256407885f, 2.130859310621e-5f, 4.0383958096161e-7f, 0.09564f, 0.13902f, 0.8129501f},
    {1.79095108475f, 1.809838025320e-5f, 6.3551335912363e-7f, 0.0049f, 0.323f, 0.272f},
    {1.78541550133f, 1.547057129129e-5f, 9.6707041180970e-7f, 0.06327f, 0.71f, 0.07824999f},
    {1.76815554864f, 1.330284977336e-5f, 1.54797400424410e-6f, 0.2904f, 0.954f, 0.0203f},
    {1.74122069647f, 1.150184784075e-5f, 2.09038647223331e-6f, 0.5945f, 0.995f, 0.0039f},
    {1.70647127164f, 9.99557429990e-6f, 2.46128056164565e-6f, 0.9163f, 0.87f, 0.001650001f},
    {1.66556087452f, 8.72799973630e-6f, 2.73551299461512e-6f, 1.0622f, 0.631f, 0.0008f},
    {1.61993437242f, 7.65513700977e-6f, 2.15125862873e-6f, 0.8544499f, 0.381f, 0.00019f},
    {1.57083597368f, 6.74217203751e-6f, 1.59051840791988e-6f, 0.4479f, 0.175f, 0.00002f},
    {1.51932335059f, 5.96134125832e-6f, 1.12356197979857e-6f, 0.1649f, 0.061f, 0},
    {1.46628494965f, 5.29034598065e-6f, 7.3527551487574e-7f, 0.04677f, 0.017f, 0},
    {1.41245852740f, 4.71115687557e-6f, 4.6450130357806e-7f, 0.01135916f, 0.004102f, 0},
    {1.35844961970f, 4.20910481110e-6f, 3.3096079921048e-7f, 0.002899327f, 0.001047f, 0},
    {1.30474913844f, 3.77218381260e-6f, 2.2512612292678e-7f, 0.0006900786f, 0.0002492f, 0},
    {1.25174963272f, 3.39051255477e-6f, 1.4879129266490e-7f, 0.0001661505f, 0.00006f, 0},
    {1.19975998755f, 3.05591531679e-6f, 1.6828623364192e-7f, 0.00004150994f, 0.00001499f, 0},
};

/// Parts of a kind each; along a path, metres of them at their reference density.
struct Matter {
  float air = 0, dust = 0, ozone = 0;
};
Matter operator*(Matter a, float s) { return {a.air * s, a.dust * s, a.ozone * s}; }
Matter operator*(Matter a, Matter b) { return {a.air * b.air, a.dust * b.dust, a.ozone * b.ozone}; }
Matter operator+(Matter a, Matter b) { return {a.air + b.air, a.dust + b.dust, a.ozone + b.ozone}; }

/// Densities relative to their greatest.
Matter densities_at(Vec3f p)
{
  const float height = length(p) - kEarthRadius;
  // A tent over a layer from 10 to 40 km.
  const float ozone = std::max(0.0f, 1.0f - std::fabs(height - 25000.0f) / 15000.0f);
  return {std::exp(-height / kAirHeight), std::exp(-height / kDustHeight), ozone};
}

/// How far a ray from within the atmosphere has to its end.
float way_out(Vec3f p, Vec3f d)
{
  const float along = dot(p, d);
  return -along + std::sqrt(along * along - dot(p, p) + kAtmosphereRadius * kAtmosphereRadius);
}

/// Whether the earth stands between a point and the sun.
bool is_shadowed(Vec3f p, Vec3f towards_sun)
{
  if (towards_sun.z >= 0) return false;
  const float along = dot(p, towards_sun);
  return along * along >= dot(p, p) - kEarthRadius * kEarthRadius;
}

/// Matter between a point and space: a Gauss–Laguerre quadrature of eight points, whose last lies just within.
Matter matter_to_space(Vec3f p, Vec3f d)
{
  struct Node {
    float at, weight;
  };
  static constexpr Node kNodes[] = {{0.006811185292f, 0.01750893642f}, {0.03614807107f, 0.04135477391f},
                                    {0.09004346519f, 0.06678839063f},  {0.1706680068f, 0.09507698807f},
                                    {0.2818362161f, 0.1283416365f},    {0.4303406404f, 0.1707430204f},
                                    {0.6296271457f, 0.2327233347f},    {0.9145252695f, 0.3562490486f}};
  const float distance = way_out(p, d);
  Matter sum;
  for (const Node& node : kNodes) sum = sum + densities_at(p + d * (node.at * distance)) * node.weight;
  return sum * distance;
}

/// Sum over the spectrum of what `power` gives for a wavelength.
template <class Power>
Vec3f color_of(const Power& power)
{
  Vec3f sum;
  for (const Wavelength& w : kSpectrum) sum += Vec3f{w.x, w.y, w.z} * power(w);
  return rec709_of_xyz(sum * kWavelengthStep);
}

Vec3f elevated(float elevation, float turn)
{
  return {std::cos(elevation) * std::cos(turn), std::cos(elevation) * std::sin(turn), std::sin(elevation)};
}

/// Light scattered once towards the eye from a direction, but for the phase functions.
SkySums sums_from(const SkyModel& sky, Vec3f d, Vec3f towards_sun)
{
  constexpr int kWavelengths = sizeof(kSpectrum) / sizeof(kSpectrum[0]);
  const Matter amounts{sky.air, sky.dust, sky.ozone};
  const Vec3f eye{0, 0, kEarthRadius + sky.altitude};
  const float segment = way_out(eye, d) / kSegments;
  float air[kWavelengths] = {}, dust[kWavelengths] = {};
  Matter passed;
  for (int i = 0; i < kSegments; ++i) {
    const Vec3f p = eye + d * ((static_cast<float>(i) + 0.5f) * segment);
    const Matter here = densities_at(p) * amounts;
    passed = passed + here * segment;
    if (is_shadowed(p, towards_sun)) continue;
    const Matter all = passed + matter_to_space(p, towards_sun) * amounts;
    for (int k = 0; k < kWavelengths; ++k) {
      const Wavelength& w = kSpectrum[k];
      const float left = std::exp(-(all.air * w.air + all.dust * kDustExtinction + all.ozone * w.ozone));
      air[k] += left * here.air * w.air * w.sunlight * segment;
      dust[k] += left * here.dust * kDustScattering * w.sunlight * segment;
    }
  }
  return {color_of([&air](const Wavelength& w) { return air[&w - kSpectrum]; }),
          color_of([&dust](const Wavelength& w) { return dust[&w - kSpectrum]; }),
          {}};
}

/// @param cosine  of the angle between the direction and the sun
Vec3f radiance_of(const SkySums& sums, float cosine)
{
  constexpr float kG = kDustAnisotropy;
  const float lobes = 1 + cosine * cosine;
  const float air_phase = 3 / (16 * kPiAngle) * lobes;
  const float dust_phase =
      3 / (8 * kPiAngle) * (1 - kG * kG) * lobes / ((2 + kG * kG) * std::pow(1 + kG * kG - 2 * kG * cosine, 1.5f));
  return sums.air * air_phase + sums.dust * dust_phase;
}

}  // namespace

std::vector<float> sky_table(const SkyModel& sky)
{
  if (sky.kind == SkyKind::kMultipleScattering) return sky_multiple_table(sky);
  const bool is_nishita = sky.kind == SkyKind::kNishita;
  constexpr std::size_t kColumns = kSkyColumns;
  const std::size_t rows = is_nishita ? kSkyRows : kScatteringRows, first = is_nishita ? 0 : rows / 2;
  const float most = is_nishita ? 0.5f + 0.25f / kSkyRows : 0.5f;
  std::vector<float> table(kColumns * rows * 3);
  const Vec3f towards_sun = elevated(sky.sun_elevation, 0);
  // The earth's shadow has a rim, across which nothing can be interpolated.
  const bool is_dusk = towards_sun.z < 0;
  for_each_in_parallel(rows - first, [&](std::size_t i) {
    const std::size_t y = first + i;
    const float v = static_cast<float>(y) / static_cast<float>(rows);
    const float part = is_nishita ? v : 2 * v - 1;
    const float elevation = most * kPiAngle * part * part;
    const auto direction_at = [&](std::size_t x) {
      return elevated(elevation, 2 * kPiAngle * static_cast<float>(x) / kColumns - kPiAngle);
    };
    std::vector<SkySums> knots;
    if (!is_dusk) {
      for (std::size_t k = 0; k < kSkyKnots; ++k) {
        knots.push_back(sums_from(sky, direction_at(k * kSkyStride), towards_sun));
      }
    }
    for (std::size_t x = 0; x < kColumns / 2; ++x) {
      const Vec3f d = direction_at(x);
      const SkySums sums = is_dusk ? sums_from(sky, d, towards_sun) : sky_sums_at(knots, static_cast<float>(x));
      const Vec3f radiance = radiance_of(sums, dot(d, towards_sun));
      for (const std::size_t column : {x, kColumns - 1 - x}) {
        float* texel = &table[(y * kColumns + column) * 3];
        texel[0] = radiance.x, texel[1] = radiance.y, texel[2] = radiance.z;
      }
    }
  });
  // The horizon's colour fades away below it; Nishita's has a formula for that.
  for (std::size_t y = 0; y < first; ++y) {
    const float part = 1 - 2 * static_cast<float>(y) / static_cast<float>(rows);
    const float left = std::max(0.0f, 1 - std::sin(most * kPiAngle * part * part) / kGroundDepth);
    const float fade = left * left * left;
    const float* horizon = &table[first * kColumns * 3];
    for (std::size_t i = 0; i < kColumns * 3; ++i) table[y * kColumns * 3 + i] = horizon[i] * fade;
  }
  return table;
}

Vec3f sky_sun_radiance(const SkyModel& sky, float elevation, float diameter)
{
  // Rounded as in Cycles, which costs it a few digits of a small sun.
  const float solid_angle = 2 * kPiAngle * (1 - std::cos(diameter / 2));
  if (sky.kind == SkyKind::kMultipleScattering) return sky_multiple_sun_radiance(sky, elevation, solid_angle);
  const Matter passed = matter_to_space({0, 0, kEarthRadius + sky.altitude}, elevated(elevation, 0));
  return color_of([&](const Wavelength& w) {
    return w.sunlight * std::exp(-(passed.air * sky.air * w.air + passed.dust * sky.dust * kDustExtinction)) /
           solid_angle;
  });
}

}  // namespace relief
