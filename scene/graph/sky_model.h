// The clear sky that Cycles 3.4 computes for its Sky Texture "Nishita", and Cycles 5 as "single scattering": light of the sun
// that is scattered once on its way to the eye, by air and by dust, and absorbed by ozone. And, in sky_multiple.cpp, its "multiple
// scattering".
//
// Nishita, Sirai, Tadamura, Nakamae 1993, "Display of the Earth Taking into Account Atmospheric Scattering". Numbers of the
// atmosphere, of the steps and of the spectrum are those of Cycles.
#pragma once

#include <cstdint>
#include <vector>

#include "kernel/math/vec.h"

namespace relief {

enum class SkyKind : std::uint8_t { kNishita, kSingleScattering, kMultipleScattering };

struct SkyModel {
  SkyKind kind = SkyKind::kNishita;
  float sun_elevation = 0;  ///< radians
  float altitude = 1;       ///< metres, 1 to 59,999; of multiple scattering to 99,999
  float air = 1, dust = 1, ozone = 1;
};

inline constexpr int kSkyColumns = 512, kSkyRows = 128, kScatteringRows = 256;

/// How deep below the horizon its colour has faded to black, as a sine.
inline constexpr float kGroundDepth = 0.4f;

/// Radiance of the sky without its sun, as linear Rec.709, which may be negative: rows of kSkyColumns texels. Column x lies at an
/// angle of 2π · x / kSkyColumns − π to the sun, of multiple scattering by half a column more; the second half of the columns
/// mirrors the first.
///
/// Nishita's are kSkyRows rows, row y at the elevation (π/2 + π/512) · (y / kSkyRows)². The others are kScatteringRows, from
/// below to above, at ±π/2 · v² for the v from −1 to 1 on which the rows lie: of single scattering at their lower edges, with
/// what fades away below the horizon.
/// @cost  a second of computing
std::vector<float> sky_table(const SkyModel& sky);

/// Radiance of the sun seen through the atmosphere; ozone dims it in multiple scattering alone.
/// @param elevation  of the part of it that is meant; at least 0, but for multiple scattering
/// @param diameter   angle, radians
Vec3f sky_sun_radiance(const SkyModel& sky, float elevation, float diameter);

/// Both for multiple scattering.
std::vector<float> sky_multiple_table(const SkyModel& sky);
Vec3f sky_multiple_sun_radiance(const SkyModel& sky, float elevation, float solid_angle);

}  // namespace relief
