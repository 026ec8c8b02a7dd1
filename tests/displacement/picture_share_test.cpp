// How much of a picture meshes are taken to fill, by areas that are known.
#include "displacement/picture_share.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace relief::test {
namespace {

/// Of n × n quads over [−1, 1]² at z = 0, or wrapped to a sphere of radius 1 whose triangles face outwards.
struct Grid {
  std::vector<Vec3f> P;
  std::vector<TriangleIndices> triangles;

  explicit Grid(std::uint32_t n, bool is_sphere = false)
  {
    for (std::uint32_t j = 0; j <= n; ++j) {
      for (std::uint32_t i = 0; i <= n; ++i) {
        const float x = static_cast<float>(i) / static_cast<float>(n),
                    y = static_cast<float>(j) / static_cast<float>(n);
        const float phi = 6.2831853f * x, theta = 3.14159265f * y;
        P.push_back(is_sphere
                        ? Vec3f{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), -std::cos(theta)}
                        : Vec3f{2 * x - 1, 2 * y - 1, 0});
        if (i == n || j == n) continue;
        const std::uint32_t a = j * (n + 1) + i, above = a + n + 1;
        triangles.insert(triangles.end(), {{a, a + 1, above + 1}, {a, above + 1, above}});
      }
    }
  }
  MeshView view() const
  {
    MeshView mesh;
    mesh.P = P.data();
    mesh.num_vertices = static_cast<std::uint32_t>(P.size());
    mesh.triangles = triangles.data();
    mesh.num_triangles = static_cast<std::uint32_t>(triangles.size());
    return mesh;
  }
};

/// At z, looking down; at z = 0 it shows 2 m by 1 m of each metre of distance.
Camera camera_at(float z)
{
  Camera camera;
  camera.half_width = 1;
  camera.half_height = 0.5f;
  camera.world_from_camera.p = {0, 0, z};
  return camera;
}

double share(const Grid& grid, const Camera& camera, const std::vector<Affine3>& places = {Affine3{}})
{
  return picture_share(grid.view(), places, PictureView(camera, 100));
}

TEST(PictureShare, IsThePartThatASquareCovers)
{
  const Grid square(2);
  // 4 m² of 16 m × 8 m.
  EXPECT_NEAR(share(square, camera_at(8)), 4.0 / 128, 1e-6);
  // As seen from behind.
  Affine3 turned;
  turned.x.x = -1;
  turned.z.z = -1;
  EXPECT_NEAR(share(square, camera_at(8), {turned}), 4.0 / 128, 1e-6);
  // Its left half is out of the picture: 1 m × 2 m of 16 m × 8 m.
  Camera shifted = camera_at(8);
  shifted.world_from_camera.p.x = 8;
  EXPECT_NEAR(share(square, shifted), 2.0 / 128, 1e-6);
  shifted = camera_at(8);
  shifted.shift_x = 0.5f;
  EXPECT_NEAR(share(square, shifted), 2.0 / 128, 1e-6);
  EXPECT_NEAR(share(square, camera_at(0.5f)), 1, 1e-6);
  EXPECT_EQ(share(square, camera_at(-1)), 0);
  Camera orthographic = camera_at(1);
  orthographic.projection = Projection::kOrthographic;
  orthographic.half_width = orthographic.half_height = 4;
  EXPECT_NEAR(share(square, orthographic), 4.0 / 64, 1e-6);
}

/// A panorama of all that is around: the ball's share of all directions, wherever it is.
TEST(PictureShare, IsTheSolidAngleInAPanorama)
{
  Camera camera = camera_at(10);
  camera.projection = Projection::kPanoramic;
  camera.panorama.kind = PanoramaKind::kMirrorBall;
  camera.half_width = camera.half_height = 1;
  camera_fit(camera, 100, 100);
  // A cap of half angle asin(1/10). The picture's square has the area of 4/π of its circle, which shows everything.
  const double cap = (1 - std::sqrt(1 - 0.01)) / 2 * 3.14159265 / 4;
  EXPECT_NEAR(share(Grid(64, true), camera), cap, 0.01 * cap);
  camera.world_from_camera.x.x = camera.world_from_camera.z.z = -1;  // looks the other way
  EXPECT_NEAR(share(Grid(64, true), camera), cap, 0.01 * cap);
}

TEST(PictureView, IsAsCoarseAsAPanoramaShows)
{
  Camera camera = camera_at(10);
  camera.projection = Projection::kPanoramic;
  camera.half_width = camera.half_height = 1;
  camera_fit(camera, 200, 100);
  // 200 pixels a turn, at the equator.
  EXPECT_NEAR(PictureView(camera, 100).pixels({0, 0, 0}, {0.001f, 0, 0}), 0.001 / 10 * 100 / 3.14159265, 1e-6);
  EXPECT_EQ(PictureView(camera, 100).coarsening({0, 0, 30}), 1);
  camera.panorama.kind = PanoramaKind::kEquidistant;
  camera.panorama.half_field = 0.5f;
  EXPECT_EQ(PictureView(camera, 100).coarsening({1, 0, 0}), 1);
  EXPECT_EQ(PictureView(camera, 100).coarsening({0, 0, 30}), PictureView::kUsualCoarsening);
}

/// Lengths are counted by the shorter side of a pixel, so that nothing is too coarse.
TEST(PictureView, TakesTheShorterSideOfAPixel)
{
  Camera camera = camera_at(8);
  const auto pixels = [&camera](float aspect) {
    camera.pixel_aspect = aspect;
    return PictureView(camera, 100).pixels({0, 0, 0}, {1, 0, 0});
  };
  const double square = pixels(1);
  EXPECT_NEAR(pixels(3), square, 1e-6 * square);
  EXPECT_NEAR(pixels(0.5f), 2 * square, 1e-6 * square);
}

/// A ground on which the camera stands covers what is below the horizon, however large its triangles are.
TEST(PictureShare, IsBelowTheHorizonForAGround)
{
  const Grid ground(1);
  Affine3 large;
  large.x = {1e5f, 0, 0};
  large.y = {0, 1e5f, 0};
  Camera level = camera_at(1);
  level.world_from_camera.y = {0, 0, 1};
  level.world_from_camera.z = {0, -1, 0};
  EXPECT_NEAR(share(ground, level, {large}), 0.5, 1e-3);
}

TEST(PictureShare, IsTheOutlineOfAClosedMesh)
{
  // From 10 m a ball of 1 m has an outline of radius 1/√99 on the plane 1 m away, which is 2 m².
  EXPECT_NEAR(share(Grid(64, true), camera_at(10)), 3.14159265 / 99 / 2, 1e-4);
}

/// Not all triangles of many instances are looked at, but all instances are.
TEST(PictureShare, IsOfAllInstances)
{
  std::vector<Affine3> places(1000);
  for (std::size_t i = 0; i < places.size(); ++i) {
    places[i].x.x = places[i].y.y = 0.01f;
    // Every second one is behind the camera.
    places[i].p = {0, 0, i % 2 == 0 ? 0.0f : 100.0f};
  }
  const double expected = 500 * 4e-4 / 128;
  EXPECT_NEAR(share(Grid(8), camera_at(8), places), expected, 0.02 * expected);
}

}  // namespace
}  // namespace relief::test
