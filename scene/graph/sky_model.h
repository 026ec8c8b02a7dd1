// The clear sky that Cycles 3.4 computes for its Sky Texture "Nishita": light of the sun that is scattered once on its way to
// the eye, by air and by dust, and absorbed by ozone.
//
// Nishita, Sirai, Tadamura, Nakamae 1993, "Display of the Earth Taking into Account Atmospheric Scattering". Numbers of the
// atmosphere, of the steps and of the spectrum are those of Cycles.
#pragma once

#include <vector>

#include "kernel/math/vec.h"

namespace relief {

struct SkyModel {
  float sun_elevation = 0;  ///< radians
  float altitude = 1;       ///< metres, 1 to 59,999
  float air = 1, dust = 1, ozone = 1;
};

/// Rows give red, green and blue, with Rec.709's primaries and white.
inline constexpr Vec3f kRec709FromXyz[] = {{3.2404542f, -1.5371385f, -0.4985314f},
                                           {-0.9692660f, 1.8760108f, 0.0415560f},
                                           {0.0556434f, -0.2040259f, 1.0572252f}};

inline constexpr int kSkyColumns = 512, kSkyRows = 128;

/// Radiance of the sky without its sun, as linear Rec.709, which may be negative: kSkyRows rows of kSkyColumns texels, row y of
/// which lies at the elevation (π/2 + π/512) · (y / kSkyRows)², and column x at an angle of 2π · x / kSkyColumns − π to the sun.
/// The second half of the columns mirrors the first.
/// @cost  a second of computing
std::vector<float> sky_table(const SkyModel& sky);

/// Radiance of the sun seen through the atmosphere; ozone does not dim it.
/// @param elevation  of the part of it that is meant, at least 0
/// @param diameter   angle, radians
Vec3f sky_sun_radiance(const SkyModel& sky, float elevation, float diameter);

}  // namespace relief
