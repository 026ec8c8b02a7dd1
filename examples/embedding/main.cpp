// A square of two triangles under a map of 64 x 64 heights, in an Embree scene beside anything else one likes. Rays are sent down
// on it, and what they hit is held against the heights themselves.
#include <relief/displaced_geometry.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

namespace {

constexpr int kSide = 64;
constexpr float kScale = .2f;

float height(int x, int y) { return .5f + .5f * std::sin(.3f * static_cast<float>(x)) * std::cos(.2f * static_cast<float>(y)); }

/// Bilinear between the centres of texels, as the surface is.
float height_at(float u, float v)
{
  const float x = u * kSide - .5f, y = v * kSide - .5f;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
  return (1 - fy) * ((1 - fx) * height(i, j) + fx * height(i + 1, j)) + fy * ((1 - fx) * height(i, j + 1) + fx * height(i + 1, j + 1));
}

float largest_error(RTCScene scene, const relief::DisplacedEmbreeGeometry& displaced)
{
  float largest = 0;
  for (int k = 0; k < 1000; ++k) {
    RTCRayHit ray{};
    ray.ray.org_x = .05f + .9f * std::fmod(.618f * static_cast<float>(k), 1.f);
    ray.ray.org_y = .05f + .0009f * static_cast<float>(k);
    ray.ray.org_z = 2;
    ray.ray.dir_z = -1;
    ray.ray.tfar = 100;
    ray.ray.mask = ~0u;
    ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
    rtcIntersect1(scene, &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &ray);
#endif
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID || !(ray.hit.Ng_z > 0)) return HUGE_VALF;
    const relief::DisplacedSurfacePoint point = displaced.point(ray.hit.primID, ray.hit.u, ray.hit.v);
    const float z = kScale * height_at(point.uv[0], point.uv[1]);
    largest = std::max({largest, std::abs(ray.ray.org_z - ray.ray.tfar - z), std::abs(point.P[2] - z),
                        std::abs(point.P[0] - ray.ray.org_x), std::abs(point.Ng[2] - ray.hit.Ng_z)});
  }
  return largest;
}

}  // namespace

int main()
try {
  const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
  const float uv[] = {0, 0, 1, 0, 0, 1, 1, 1};
  const std::uint32_t triangles[] = {0, 1, 2, 2, 1, 3};
  std::vector<float> heights;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) heights.push_back(height(x, y));
  }
  relief::DisplacementSource source{positions, normals, uv, triangles, heights, kSide, kSide};
  source.scale = kScale;

  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  float error = 0;
  {
    const relief::DisplacedEmbreeGeometry displaced(device, source);
    rtcAttachGeometry(scene, displaced.geometry());
    rtcCommitScene(scene);
    error = largest_error(scene, displaced);
    rtcReleaseScene(scene);  // before what it points to
  }
  rtcReleaseDevice(device);
  std::printf("1000 rays, largest error %g\n", static_cast<double>(error));
  return error < 1e-5f ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "embedding: %s\n", error.what());
  return 1;
}
