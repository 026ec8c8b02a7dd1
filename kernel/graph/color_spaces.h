// Hue, saturation and value or lightness of colours; all components within 0…1 where the colour's are.
//
// Smith 1978, "Color Gamut Transform Pairs".
#pragma once

#include <cmath>

#include "kernel/math/vec.h"

namespace relief {

/// Hue of a colour whose largest and smallest components are known to differ, [0, 1).
RELIEF_KERNEL float color_hue(Vec3f c, float largest, float smallest)
{
  const Vec3f away = (splat3(largest) - c) / (largest - smallest);
  const float sector = c.x == largest   ? away.z - away.y
                       : c.y == largest ? 2.0f + away.x - away.z
                                        : 4.0f + away.y - away.x;
  const float hue = sector / 6.0f;
  return hue < 0.0f ? hue + 1.0f : hue;
}

RELIEF_KERNEL Vec3f rgb_to_hsv(Vec3f c)
{
  const float largest = max_component(c), smallest = min(min(c.x, c.y), c.z);
  const float range = largest - smallest;
  const float saturation = largest != 0.0f ? range / largest : 0.0f;
  return {saturation != 0.0f ? color_hue(c, largest, smallest) : 0.0f, saturation, largest};
}

RELIEF_KERNEL Vec3f hsv_to_rgb(Vec3f hsv)
{
  const float saturation = hsv.y, value = hsv.z;
  if (saturation == 0.0f) return splat3(value);
  const float h = (hsv.x == 1.0f ? 0.0f : hsv.x) * 6.0f;
  const float sector = std::floor(h), f = h - sector;
  const float p = value * (1.0f - saturation);
  const float q = value * (1.0f - saturation * f);
  const float t = value * (1.0f - saturation * (1.0f - f));
  if (sector == 0.0f) return {value, t, p};
  if (sector == 1.0f) return {q, value, p};
  if (sector == 2.0f) return {p, value, t};
  if (sector == 3.0f) return {p, q, value};
  if (sector == 4.0f) return {t, p, value};
  return {value, p, q};
}

RELIEF_KERNEL Vec3f rgb_to_hsl(Vec3f c)
{
  const float largest = max_component(c), smallest = min(min(c.x, c.y), c.z);
  const float lightness = min(1.0f, (largest + smallest) / 2.0f);
  if (largest == smallest) return {0.0f, 0.0f, lightness};
  const float range = largest - smallest;
  const float saturation = lightness > 0.5f ? range / (2.0f - largest - smallest) : range / (largest + smallest);
  return {color_hue(c, largest, smallest), saturation, lightness};
}

RELIEF_KERNEL Vec3f hsl_to_rgb(Vec3f hsl)
{
  const auto ramp = [](float x) { return clamp(x, 0.0f, 1.0f); };
  const float h = hsl.x * 6.0f;
  const Vec3f hue{ramp(__builtin_fabsf(h - 3.0f) - 1.0f), ramp(2.0f - __builtin_fabsf(h - 2.0f)),
                  ramp(2.0f - __builtin_fabsf(h - 4.0f))};
  const float chroma = (1.0f - __builtin_fabsf(2.0f * hsl.z - 1.0f)) * hsl.y;
  return (hue - splat3(0.5f)) * chroma + splat3(hsl.z);
}

}  // namespace relief
