// Levels of height maps against sums over every texel, and the smooth normal against the surface's own.
#include "displacement/height_level.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "displacement/displaced_mesh.h"

namespace relief {
namespace {

/// A map of random texels.
struct RandomMap {
  RandomMap(int width, int height, HeightFormat format, Wrap wrap = Wrap::kRepeat)
      : bytes(16 + 4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
  {
    std::mt19937 random(static_cast<unsigned>(width * 1000 + height));
    const auto count = static_cast<std::size_t>(width * height);
    for (std::size_t i = 0; i < count; ++i) {
      switch (format) {
        case HeightFormat::kU8:
          bytes[i] = static_cast<std::uint8_t>(random() & 255);
          break;
        case HeightFormat::kU16:
          reinterpret_cast<std::uint16_t*>(bytes.data())[i] = static_cast<std::uint16_t>(random() & 65535);
          break;
        case HeightFormat::kFloat:
          reinterpret_cast<float*>(bytes.data())[i] = static_cast<float>(random() % 100001) * 1e-4f - 5.0f;
          break;
      }
    }
    view = {bytes.data(), width, height, format, wrap, wrap};
  }

  std::vector<std::uint8_t> bytes;
  HeightMapView view;
};

double overlap(double a0, double a1, double b0, double b1)
{
  return std::max(0.0, std::min(a1, b1) - std::max(a0, b0));
}

/// Mean height over the area of one texel of a level, from every texel of the map.
double brute_force_mean(const HeightMapView& map, int width, int height, int i, int j)
{
  const double sx = static_cast<double>(map.width) / width, sy = static_cast<double>(map.height) / height;
  double sum = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      sum += static_cast<double>(height_at(map, std::int64_t{y} * map.width + x)) *
             overlap(x, x + 1, i * sx, (i + 1) * sx) * overlap(y, y + 1, j * sy, (j + 1) * sy);
    }
  }
  return sum / (sx * sy);
}

TEST(HeightLevel, IsTheMeanOverTheAreaOfATexel)
{
  for (const HeightFormat format : {HeightFormat::kU8, HeightFormat::kU16, HeightFormat::kFloat}) {
    for (const auto& [w, h] : {std::pair{8, 8}, {16, 4}, {7, 5}, {13, 1}, {1, 9}, {1, 1}, {33, 17}}) {
      const RandomMap map(w, h, format, Wrap::kMirror);
      int expected_w = w, expected_h = h;
      for (int level = 1; level <= 7; ++level) {
        expected_w = std::max(1, (expected_w + 1) / 2);
        expected_h = std::max(1, (expected_h + 1) / 2);
        const HeightLevel coarse(map.view, level);
        const HeightMapView view = coarse.view();
        ASSERT_EQ(view.width, expected_w);
        ASSERT_EQ(view.height, expected_h);
        EXPECT_EQ(view.wrap_u, Wrap::kMirror);
        EXPECT_EQ(view.wrap_v, Wrap::kMirror);
        const bool is_float = format == HeightFormat::kFloat;
        EXPECT_EQ(view.format, is_float ? HeightFormat::kFloat : HeightFormat::kU16);
        EXPECT_EQ(coarse.bytes(), static_cast<std::size_t>(expected_w * expected_h) * (is_float ? 4 : 2));
        // Half a step of 16 bits, and the rounding of height_at's float; or that of a float below 8.
        const double tolerance = is_float ? 5e-7 : 0.5 / 65535 + 1e-7;
        for (int j = 0; j < expected_h; ++j) {
          for (int i = 0; i < expected_w; ++i) {
            ASSERT_NEAR(static_cast<double>(height_at(view, std::int64_t{j} * view.width + i)),
                        brute_force_mean(map.view, expected_w, expected_h, i, j), tolerance)
                << w << "x" << h << " level " << level << " texel " << i << "," << j;
          }
        }
      }
    }
  }
}

TEST(HeightLevel, OfAConstantMapIsTheMap)
{
  for (const int value : {0, 1, 128, 254, 255}) {
    const std::vector<std::uint8_t> texels(7 * 6, static_cast<std::uint8_t>(value));
    const HeightMapView map{texels.data(), 7, 6, HeightFormat::kU8, Wrap::kRepeat, Wrap::kRepeat};
    for (int level = 1; level < 5; ++level) {
      const HeightLevel coarse(map, level);
      const HeightMapView view = coarse.view();
      for (std::int64_t k = 0; k < view.width * view.height; ++k) {
        EXPECT_EQ(static_cast<const std::uint16_t*>(view.texels)[k], value * 257);
      }
    }
  }
}

/// Height of a map between texel centres, by its definition.
double brute_force_height(const HeightMapView& map, double x, double y)
{
  const auto wrapped = [](std::int64_t i, int size, Wrap wrap) {
    if (wrap == Wrap::kClamp) return std::clamp<std::int64_t>(i, 0, size - 1);
    const std::int64_t period = wrap == Wrap::kRepeat ? size : 2 * size, k = ((i % period) + period) % period;
    return k < size ? k : 2 * size - 1 - k;
  };
  double sum = 0;
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const auto i = static_cast<std::int64_t>(std::floor(x)) + dx, j = static_cast<std::int64_t>(std::floor(y)) + dy;
      const double weight = (1 - std::abs(x - static_cast<double>(i))) * (1 - std::abs(y - static_cast<double>(j)));
      sum += weight * static_cast<double>(height_at(
                          map, wrapped(j, map.height, map.wrap_v) * map.width + wrapped(i, map.width, map.wrap_u)));
    }
  }
  return sum;
}

TEST(LevelLoss, IsThatOfEveryTexel)
{
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
    for (const auto& size : {std::pair{16, 16}, {64, 32}, {37, 51}, {9, 1}, {1, 1}}) {
      const int w = size.first, h = size.second;
      const RandomMap map(w, h, HeightFormat::kU16, wrap);
      const HeightLevel level(map.view, 1);
      const HeightMapView coarse = level.view();
      const auto difference = [&](int i, int j) {
        const double x = (i + .5) * coarse.width / w - .5, y = (j + .5) * coarse.height / h - .5;
        return static_cast<double>(height_at(map.view, std::int64_t{j} * w + i)) - brute_force_height(coarse, x, y);
      };
      double height = 0, slope_u = 0, slope_v = 0;
      for (int part_y = 0; part_y < 8; ++part_y) {
        for (int part_x = 0; part_x < 8; ++part_x) {
          double u = 0, v = 0;
          int count = 0;
          for (int j = h * part_y / 8; j < h * (part_y + 1) / 8; ++j) {
            for (int i = w * part_x / 8; i < w * (part_x + 1) / 8; ++i) {
              ++count;
              height = std::max(height, std::abs(difference(i, j)));
              if (i > 0) u += std::pow(w * (difference(i, j) - difference(i - 1, j)), 2);
              if (j > 0) v += std::pow(h * (difference(i, j) - difference(i, j - 1)), 2);
            }
          }
          if (count == 0) continue;
          slope_u = std::max(slope_u, std::sqrt(u / count));
          slope_v = std::max(slope_v, std::sqrt(v / count));
        }
      }
      const LevelLoss loss = level_loss(map.view, coarse);
      EXPECT_NEAR(loss.height, height, 1e-6) << w << "x" << h;
      EXPECT_NEAR(loss.slope_u, slope_u, 1e-4 * (1 + slope_u)) << w << "x" << h;
      EXPECT_NEAR(loss.slope_v, slope_v, 1e-4 * (1 + slope_v)) << w << "x" << h;
    }
  }
}

TEST(MapDensity, IsTheMeanOfTheGradientsOfUv)
{
  // A rectangle of 2 × 3 metres over 4 × 6 sides of the map turned by 90°, and one of 1 × 1 under 5 × 5; the first has six
  // times the area.
  const Vec3f P[8] = {{0, 0, 0}, {2, 0, 0}, {2, 3, 0}, {0, 3, 0}, {5, 0, 1}, {6, 0, 1}, {6, 1, 1}, {5, 1, 1}};
  const Vec2f uv[8] = {{0, 0}, {0, 4}, {6, 4}, {6, 0}, {0, 0}, {5, 0}, {5, 5}, {0, 5}};
  const TriangleIndices triangles[4] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  MeshView mesh;
  mesh.P = P;
  mesh.uv[0] = uv;
  mesh.triangles = triangles;
  mesh.num_vertices = 8;
  mesh.num_triangles = 4;
  const double expected = std::sqrt((6 * 2. * 2 + 1 * 5. * 5) / 7);
  const MapDensity density = map_density(mesh, {});
  EXPECT_NEAR(density.u, expected, 1e-6);
  EXPECT_NEAR(density.v, expected, 1e-6);
  // The texture's transform counts: u twice as dense, v not at all.
  TextureRef mapping;
  mapping.m00 = 2;
  mapping.m11 = 0;
  EXPECT_NEAR(map_density(mesh, mapping).u, 2 * expected, 1e-6);
  EXPECT_EQ(map_density(mesh, mapping).v, 0);
}

/// One triangle under a map, with normals that lean apart.
struct OneTriangle {
  explicit OneTriangle(const HeightMapView& map) : field(map)
  {
    mesh.P = P;
    mesh.N = N;
    mesh.uv[0] = uv;
    mesh.triangles = &indices;
    mesh.num_triangles = 1;
    displaced = DisplacedMesh(mesh, field.view(), {{}, 0.1, 0.5});
  }

  Vec3f P[3] = {{0, 0, 0}, {1, 0, 0.1f}, {0.1f, 1, 0}};
  Normal3f N[3] = {{-0.2f, -0.1f, 1}, {0.3f, 0, 0.9f}, {0, 0.3f, 1.1f}};
  Vec2f uv[3] = {{0.1f, 0.2f}, {0.9f, 0.3f}, {0.2f, 0.8f}};
  TriangleIndices indices{0, 1, 2};
  MeshView mesh;
  HeightField field;
  DisplacedMesh displaced;
};

double angle(Vec3d a, Vec3d b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

TEST(SmoothNormal, IsTheSurfacesOwnOnASlope)
{
  // h = x/32 along a map of 32 columns: central differences of a plane are its slopes.
  std::vector<float> texels;
  for (int row = 0; row < 32; ++row) {
    for (int k = 0; k < 32; ++k) texels.push_back(static_cast<float>(k) / 32 + static_cast<float>(row) / 64);
  }
  const HeightMapView map{texels.data(), 32, 32, HeightFormat::kFloat, Wrap::kClamp, Wrap::kClamp};
  const OneTriangle t(map);
  const DisplacedMeshView view = t.displaced.view();
  for (double b1 = 0.05; b1 < 0.9; b1 += 0.13) {
    for (double b2 = 0.05; b1 + b2 < 1; b2 += 0.11) {
      const Vec3d Ng = surface_point(view, view.triangles[0], b1, b2).Ng;
      EXPECT_LT(angle(Ng, surface_smooth_normal(view, view.triangles[0], b1, b2)), 1e-7);
    }
  }
}

TEST(SmoothNormal, IsContinuousWhereTheFacetsOfTexelsMeet)
{
  const RandomMap map(32, 32, HeightFormat::kU16);
  const OneTriangle t(map.view);
  const DisplacedMeshView view = t.displaced.view();
  const DisplacedTriangle& tri = view.triangles[0];
  // A line of small steps across the triangle: the surface's own normal jumps, the smooth one does not.
  constexpr int kSteps = 20000;
  double largest_jump = 0, largest_smooth_jump = 0, largest_difference = 0;
  Vec3d last{}, last_smooth{};
  for (int k = 0; k <= kSteps; ++k) {
    const double b1 = 0.1 + 0.7 * k / kSteps, b2 = 0.15 * (1 - static_cast<double>(k) / kSteps) + 0.02;
    const Vec3d Ng = surface_point(view, tri, b1, b2).Ng;
    const Vec3d smooth = surface_smooth_normal(view, tri, b1, b2);
    ASSERT_NEAR(length(smooth), 1, 1e-12);
    if (k > 0) {
      largest_jump = std::max(largest_jump, angle(last, Ng));
      largest_smooth_jump = std::max(largest_smooth_jump, angle(last_smooth, smooth));
    }
    largest_difference = std::max(largest_difference, angle(Ng, smooth));
    last = Ng;
    last_smooth = smooth;
  }
  // 20 texels in 20000 steps: the smooth normal turns by about a radian a texel, a thousandth of that a step.
  EXPECT_LT(largest_smooth_jump, 0.02);
  EXPECT_GT(largest_jump, 0.3);
  EXPECT_GT(largest_difference, 0.1);
}

}  // namespace
}  // namespace relief
