// Displaced meshes diced for a picture: closed, as fine as asked for, and with the light of what is left out.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "scene/memory.h"
#include "tests/support/block_cells.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// A closed sphere with a smooth map, tiled, seen from just above it.
/// @param size   texels a side of the map
/// @param tiles  around the sphere, even
/// @param noise  of the map, part of its range
Scene close_sphere(int size, int tiles, double noise, const Affine3& world_from_object = {})
{
  Scene scene = empty_scene();
  Mesh sphere = sphere_mesh(1, 24, 12, true);
  for (int r = 0; r <= 12; ++r) {
    for (int c = 0; c <= 24; ++c) {
      sphere.uv[0].push_back({static_cast<float>(c * tiles) / 24, static_cast<float>(r * tiles) / 24});
    }
  }
  // Closed to the last bit: at the seam and the poles.
  for (std::size_t i = 0; i < sphere.P.size(); ++i) {
    const std::size_t r = i / 25, first = r * 25;
    if (i % 25 == 24) sphere.P[i] = sphere.P[first];
    if (r == 0 || r == 12) sphere.P[i] = {0, r == 0 ? 1.0f : -1.0f, 0};
    sphere.N[i] = as_normal(sphere.P[i]);
  }
  Material material = diffuse_material({0.8f, 0.8f, 0.8f});
  material.displacement_index = 0;
  add_object(scene, sphere, material, world_from_object);
  const std::vector<std::uint16_t> random = noise_texels(size, 5);
  std::vector<std::uint16_t> texels;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      // Around the poles, texel rows −½, all heights are one on all levels.
      const double pole = std::sin(3.14159265 * (y + 0.5) / size);
      const double h = 0.5 + pole * (0.2 * std::sin(2 * 3.14159265 * x / size) +
                                     noise * (random[static_cast<std::size_t>(y * size + x)] / 65535.0 - 0.5));
      texels.push_back(
          static_cast<std::uint16_t>(65535 * (std::min(y, size - 1 - y) < (size > 64 ? size / 16 : 1) ? 0.5 : h)));
    }
  }
  add_displacement(scene, size, std::move(texels), 0.1f);
  scene.cameras[0].camera.world_from_camera.p = transform_point(world_from_object, {0.2f, 0.1f, 1.3f});
  return scene;
}

DisplacementOptions options_of(const Scene& scene, double error, int height)
{
  DisplacementOptions options;
  options.error = error;
  options.camera = scene.cameras[0].camera;
  options.picture_height = height;
  options.num_rays = 1e9;
  return options;
}

const Tessellation& tessellation_of(const SceneContext& context)
{
  EXPECT_EQ(context.displacements.method_names(), "tessellate");
  return *context.displacements.tessellation(0);
}

TEST(Dicing, LetsNoRayOut)
{
  const Scene scene = close_sphere(512, 32, 0.1);
  // With parts of triangles, and levels from the map's own on.
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  std::vector<TraceRay> rays;
  for (int i = 0; i < 200'000; ++i) {
    const Vec3f O = 0.2f * Vec3f{normal(random), normal(random), normal(random)};
    if (length(O) > 0.8f) continue;
    rays.push_back({O, normalize(Vec3f{normal(random), normal(random), normal(random)}), 0, kInfinity});
  }
  // Few rays a micro-triangle, and many.
  for (const auto& [num_rays, kind] :
       {std::pair(3e6, TessellationKind::kBlocks), std::pair(1e9, TessellationKind::kQuads)}) {
    DisplacementOptions options = options_of(scene, 1, 600);
    options.num_rays = num_rays;
    const SceneContext context(scene, options);
    const TessellationLayout& layout = tessellation_of(context).layout();
    ASSERT_EQ(layout.kind, kind) << layout.num_micro_triangles;
    ASSERT_GT(layout.triangles.size(), scene.meshes[0].triangles.size());
    for (const TraceHit& hit : trace_rays(context, rays)) ASSERT_LT(hit.t, 3.0f);
  }
}

/// Paths within a closed surface that is dark, in a bright world: whatever light they find has leaked.
TEST(Dicing, LetsNoPathOut)
{
  Scene scene = close_sphere(64, 4, 0.9);
  scene.displacements[0].weld_seams = true;
  scene.cameras[0].camera.world_from_camera.p = {};
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1;
  scene.environment.color = {1e6f, 1e6f, 1e6f};
  scene.render.max_bounces = scene.render.diffuse_bounces = 8;
  for (const DisplacementMethod method :
       {DisplacementMethod::kAuto, DisplacementMethod::tessellate, DisplacementMethod::tessellate_grid}) {
    RenderOptions options = render_options(scene, 128, 64);
    options.displacement.method = method;
    if (method == DisplacementMethod::kAuto) options.displacement.error = 1;
    const Rendered rendered = render_scene(scene, options);
    EXPECT_EQ(rendered.stats.displacement.method,
              method == DisplacementMethod::tessellate_grid ? "tessellate-grid" : "tessellate");
    int num_bright = 0;
    for (int y = 0; y < 128; ++y) {
      for (int x = 0; x < 128; ++x) num_bright += rendered.radiance(x, y).x > 0 ? 1 : 0;
    }
    // Of 10⁶ paths over larger micro-triangles one remains, of five: where its ray passes exactly through the bottom of a valley,
    // Embree names the slope behind as the nearest.
    EXPECT_LE(num_bright, method == DisplacementMethod::tessellate ? 1 : 0) << displacement_method_label(method);
  }
}

/// A strip that reaches beneath the camera is as fine there as it would be by itself, however many instances are nearer by
/// their middles.
TEST(Dicing, IsAsFineAsAnyOfItsInstancesAsks)
{
  Scene scene = empty_scene();
  Mesh strip = quad_mesh({-60, -0.5f, 0}, {120, 0, 0}, {0, 1, 0});
  strip.uv[0] = {{0, 0}, {120, 0}, {120, 1}, {0, 1}};
  Material material = diffuse_material({0.8f, 0.8f, 0.8f});
  material.displacement_index = 0;
  const Affine3 under{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-58, 0, 0}};
  add_object(scene, strip, material, under);
  add_displacement(scene, 64, noise_texels(64, 2), 0.02f);
  scene.cameras[0].camera.world_from_camera.p = {0, 0, 1};
  const DisplacementOptions options = options_of(scene, 1, 200);
  const std::uint64_t alone = tessellation_of(SceneContext(scene, options)).layout().num_micro_triangles;
  for (int i = 0; i < 40; ++i) {
    scene.instances.push_back(scene.instances[0]);
    scene.instances.back().world_from_object.p = {0, 20, 10 + 0.1f * static_cast<float>(i)};
  }
  const std::uint64_t among_others = tessellation_of(SceneContext(scene, options)).layout().num_micro_triangles;
  EXPECT_GE(among_others, alone);
}

/// The error of the picture in a material's own unit, and how much coarser it may be where the camera does not look.
TEST(Dicing, IsAsFineAsItsMaterialAsks)
{
  const auto num_micro_triangles = [](double error, float cell_pixels, float coarser_outside) {
    Scene scene = close_sphere(512, 32, 0.1);
    scene.displacements[0].cell_pixels = cell_pixels;
    scene.displacements[0].coarser_outside = coarser_outside;
    return tessellation_of(SceneContext(scene, options_of(scene, error, 200))).layout().num_micro_triangles;
  };
  const std::uint64_t usual = num_micro_triangles(1, 1, 4);
  EXPECT_EQ(num_micro_triangles(2, 0.5f, 4), usual);
  EXPECT_EQ(num_micro_triangles(0.5, 2, 4), usual);
  const std::uint64_t less_coarse = num_micro_triangles(1, 1, 2);
  EXPECT_GT(less_coarse, usual);
  EXPECT_GT(num_micro_triangles(1, 1, 1), less_coarse);
}

/// What of many instances is seen largest, beside all of them looked at.
TEST(Dicing, LooksAtEveryInstance)
{
  std::mt19937 random(8);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto vector = [&] { return Vec3f{uniform(random), uniform(random), uniform(random)}; };
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic, Projection::kPanoramic}) {
    for (const float half : {0.001f, 0.4f}) {
      Camera camera;
      camera.projection = projection;
      camera.half_width = camera.half_height = half;
      camera.panorama.kind = PanoramaKind::kEquidistant;
      const PictureView view(camera, 500, 1 + 5 * std::abs(static_cast<double>(uniform(random))));
      const Mesh mesh = quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
      std::vector<Affine3> instances;
      for (int i = 0; i < 300; ++i) {
        const float size = std::exp(2 * uniform(random));
        instances.push_back({size * vector(), size * vector(), size * vector(), 30 * vector()});
      }
      for (const auto coarser : {SeenInstances::Coarser::kOutside, SeenInstances::Coarser::kAfar}) {
        const SeenInstances seen(mesh.view(), view, instances, coarser);
        const auto coarsening = [&](Vec3d P) {
          return coarser == SeenInstances::Coarser::kOutside ? view.coarsening(P) : view.coarsening_afar(P);
        };
        for (int k = 0; k < 300; ++k) {
          const Vec3f a{uniform(random), uniform(random), 0}, b{uniform(random), uniform(random), 0};
          double metre = 0, line = 0;
          for (const Affine3& m : instances) {
            const Vec3f from = transform_point(m, a), to = transform_point(m, b);
            const double stretch = std::max({length(m.x), length(m.y), length(m.z)});
            // The largest singular value is at least that.
            metre = std::max(metre, stretch * view.pixels_a_metre(to_double(from)) / coarsening(to_double(from)));
            const double ends = std::min(coarsening(to_double(from)), coarsening(to_double(to)));
            line = std::max(
                line, view.pixels(from, to) / std::min(ends, coarsening(0.5 * (to_double(from) + to_double(to)))));
          }
          EXPECT_GE(seen.pixels_a_metre(to_double(a)) * (1 + 1.0 / 16), metre);
          const double found = seen.pixels(a, b);
          EXPECT_LE(found, line * (1 + 1e-9));
          EXPECT_GE(found * (1 + 1.0 / 16), line);
        }
      }
    }
  }
}

/// Every side of a micro-triangle is one of another, the other way, with the same ends to the last bit.
TEST(Dicing, OfAClosedMeshIsClosed)
{
  Scene scene = close_sphere(512, 32, 0.1);
  // Texture coordinates are cut around the poles.
  scene.displacements[0].weld_seams = true;
  DisplacementOptions options = options_of(scene, 1, 400);
  options.num_rays = 3e6;
  const SceneContext context(scene, options);
  const Tessellation& t = tessellation_of(context);
  ASSERT_EQ(t.layout().kind, TessellationKind::kBlocks);
  ASSERT_GT(t.layout().triangles.size(), scene.meshes[0].triangles.size());
  std::vector<std::array<float, 6>> sides[2];  // from a lower to a higher end, and those from a higher one
  std::uint64_t num_triangles = 0;
  const auto add_triangle = [&](const std::uint64_t* vertices) {
    ++num_triangles;
    Vec3f corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = t.vertex(vertices[k]);
    for (int k = 0; k < 3; ++k) {
      std::array<float, 3> a{corner[k].x, corner[k].y, corner[k].z};
      const Vec3f& to = corner[(k + 1) % 3];
      std::array<float, 3> b{to.x, to.y, to.z};
      if (a == b) continue;
      const bool turned = b < a;
      if (turned) std::swap(a, b);
      sides[turned].push_back({a[0], a[1], a[2], b[0], b[1], b[2]});
    }
  };
  for_each_cell(t, [&](const BlockCell& cell) {
    add_triangle(cell.lower);
    if (cell.has_upper) add_triangle(cell.upper);
  });
  EXPECT_EQ(num_triangles, t.layout().num_micro_triangles);
  for (auto& each : sides) std::sort(each.begin(), each.end());
  std::vector<std::array<float, 6>> open;
  std::set_symmetric_difference(sides[0].begin(), sides[0].end(), sides[1].begin(), sides[1].end(),
                                std::back_inserter(open));
  EXPECT_EQ(open.size(), 0u) << "of " << 2 * sides[0].size();
}

/// Sides of micro-triangles in the picture, where the camera looks.
TEST(Dicing, IsAsFineAsThePicture)
{
  const Affine3 placement{{0, 3, 0}, {-3, 0, 0}, {0, 0, 3}, {1, 2, 3}};
  const Scene scene = close_sphere(512, 32, 0.1, placement);
  double num_micro_triangles = 0;
  for (const double error : {2.0, 1.0}) {
    const SceneContext context(scene, options_of(scene, error, 400));
    const Tessellation& t = tessellation_of(context);
    double longest = 0, sum = 0;
    int count = 0;
    const Camera& camera = scene.cameras[0].camera;
    const double scale = 400 / (2.0 * static_cast<double>(camera.half_height));
    for_each_cell(t, [&](const BlockCell& cell) {
      // On the sphere itself, since heights make sides longer.
      Vec3f corner[2];
      for (int k = 0; k < 2; ++k) {
        const Vec3f P = t.vertex(cell.lower[k]);
        corner[k] = transform_point(placement, P / length(P));
      }
      const Vec3f middle = 0.5f * (corner[0] + corner[1]) - camera.world_from_camera.p;
      if (std::max(std::abs(middle.x), std::abs(middle.y)) > -0.4f * middle.z) return;
      const double pixels = scale * static_cast<double>(length(corner[1] - corner[0]) / length(middle));
      longest = std::max(longest, pixels);
      sum += pixels;
      ++count;
    });
    ASSERT_GT(count, 1000);
    // Sides of sides are; where a triangle's rows meet a side that has fewer points, they are dragged by up to half a step.
    EXPECT_LT(longest, 1.7 * error) << error;
    EXPECT_GT(sum / count, 0.4 * error) << error;
    EXPECT_LT(sum / count, error) << error;
    const auto all = static_cast<double>(t.layout().num_micro_triangles);
    if (num_micro_triangles > 0) {
      EXPECT_NEAR(all / num_micro_triangles, 4, 1);
    }
    num_micro_triangles = all;
  }
}

TEST(Dicing, FindsTheSurfaceWhereTexelsAreWiderThanPixels)
{
  Scene scene = close_sphere(64, 4, 0);
  const SceneContext exact(scene);
  const SceneContext diced(scene, options_of(scene, 1, 8000));
  tessellation_of(diced);
  std::vector<TraceRay> rays;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-0.3f, 0.3f);
  const Vec3f O = scene.cameras[0].camera.world_from_camera.p;
  for (int i = 0; i < 2000; ++i)
    rays.push_back({O, normalize(Vec3f{uniform(random), uniform(random), -1}), 0, kInfinity});
  const std::vector<TraceHit> a = trace_rays(exact, rays), b = trace_rays(diced, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_LT(a[i].t, kInfinity);
    // A texel is 25 mm wide. Where a sixteenth of its bilinear patch is two triangles they differ by a quarter of the twist,
    // 3 µm, and rays go down at angles.
    EXPECT_NEAR(a[i].t, b[i].t, 5e-5) << i;
    EXPECT_EQ(a[i].triangle_index, b[i].triangle_index) << i;
  }
}

/// Where no triangle is cut, hits name the mesh's own.
TEST(Dicing, TakesTheMeshAsItIsWhereNoSideIsLong)
{
  const Scene scene = close_sphere(64, 4, 0);
  const SceneContext exact(scene), diced(scene, options_of(scene, 1, 100));
  const Tessellation& t = tessellation_of(diced);
  ASSERT_EQ(t.layout().triangles.size(), scene.meshes[0].triangles.size());
  std::vector<TraceRay> rays;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-0.3f, 0.3f);
  for (int i = 0; i < 2000; ++i) {
    rays.push_back({scene.cameras[0].camera.world_from_camera.p, normalize(Vec3f{uniform(random), uniform(random), -1}),
                    0, kInfinity});
  }
  const std::vector<TraceHit> a = trace_rays(exact, rays), b = trace_rays(diced, rays);
  int num_same = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_LT(b[i].t, kInfinity);
    num_same += a[i].triangle_index == b[i].triangle_index && std::abs(a[i].u - b[i].u) < 0.05f ? 1 : 0;
  }
  // Heights of coarser levels are met elsewhere at angles.
  EXPECT_GT(num_same, 1800);
}

/// Micro-triangles that cross the line between two texels would show.
TEST(Dicing, ShadesTexelsThatAreWiderThanPixelsAsTheMapHasThem)
{
  const Scene scene = close_sphere(64, 4, 0);
  const SceneContext exact(scene), diced(scene, options_of(scene, 1, 8000));
  int num_shaded = 0, num_cells = 0;
  for_each_cell(tessellation_of(diced), [&](const BlockCell& cell) {
    if (++num_cells % 97 != 0) return;
    const DisplacedPoint point =
        diced.displacements.resolve(0, {}, cell.primitive, {cell.u + 0.3f * cell.side, cell.v + 0.4f * cell.side, 0});
    if (point.level > 0) return;
    const DisplacedPoint expected = exact.displacements.resolve(0, {}, point.triangle, {point.u, point.v, 0});
    EXPECT_EQ(point.Ns, expected.Ng) << cell.primitive;
    ++num_shaded;
  });
  EXPECT_GT(num_shaded, 1000);
}

TEST(Dicing, KeepsTheMeanOfThePicture)
{
  Scene scene = close_sphere(64, 4, 0.2);
  scene.cameras[0].camera.world_from_camera.p = {0, 0, 4};
  scene.environment.color = {0.3f, 0.3f, 0.3f};
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{-1, 0, -0.3f});
  sun.emission = {1, 1, 1};
  scene.lights.push_back(sun);
  scene.render.max_bounces = scene.render.diffuse_bounces = 4;
  RenderOptions options = render_options(scene, 32, 1024);
  const double exact = render_scene(scene, options).mean();
  options.displacement.error = 1;
  Rendered diced = render_scene(scene, options);
  EXPECT_EQ(diced.stats.displacement.method, "tessellate");
  EXPECT_NEAR(diced.mean() / exact, 1, 0.006);
  // Too little memory: the map itself.
  options.displacement.auto_bytes = 1;
  diced = render_scene(scene, options);
  EXPECT_EQ(diced.stats.displacement.method, "chord");
  EXPECT_EQ(diced.mean(), exact);
}

TEST(Dicing, PaysForManyInstancesAsForOne)
{
  Scene scene = close_sphere(512, 32, 0.1);
  DisplacementOptions options = options_of(scene, 1, 60);
  options.num_rays = 1e7;
  EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "tessellate");
  for (int i = 1; i < 100; ++i) {
    scene.instances.push_back(scene.instances[0]);
    scene.instances.back().world_from_object.p = {0.02f * static_cast<float>(i), 0, 0};
  }
  EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "tessellate");
  // What the picture hardly shows is not worth its building.
  options.camera->world_from_camera.p = {0, 0, 1000};
  options.num_rays = 1e4;
  EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "chord");
}

/// What counts are the rays that meet a mesh: those of its part of the picture, and of that what others leave.
TEST(Dicing, PaysByThePartOfThePictureThatAMeshFills)
{
  Scene scene = close_sphere(64, 4, 0.2);
  DisplacementOptions options = options_of(scene, 1, 200);
  options.camera->world_from_camera.p = {0, 0, 3};
  // Seconds by chord that the first mesh is said to take.
  const auto seconds = [&] {
    const SceneContext context(scene, options);
    const std::string reason = context.displacements.reasons().at(0);
    const std::size_t end = reason.find(" s by chord");
    const std::size_t start = reason.rfind(' ', end - 1);
    return std::stod(reason.substr(start + 1, end - start - 1));
  };
  const Camera& camera = *options.camera;
  const double window = 4.0 * static_cast<double>(camera.half_width) * static_cast<double>(camera.half_height);
  const double outline = 3.14159265 / 8 / window;
  ASSERT_LT(outline, 1);
  EXPECT_NEAR(seconds(), 1250 * outline, 0.1 * 1250 * outline);
  options.camera->world_from_camera.p = {0, 0, 30};
  EXPECT_NEAR(seconds(), 1250 * outline * 8 / 899, 0.1 * 1250 * outline * 8 / 899);
  options.camera->world_from_camera.p = {0, 0, 3};
  // A wall in the same picture, displaced as well, takes all of it: the ball has its part of both together.
  scene.meshes.push_back(scene.meshes[0]);
  scene.instances.push_back(scene.instances[0]);
  Instance& wall = scene.instances.back();
  wall.mesh_index = 1;
  wall.world_from_object = {{30, 0, 0}, {0, 30, 0}, {0, 0, 30}, {0, 0, -40}};
  EXPECT_NEAR(seconds(), 1250 * outline / (1 + outline), 0.1 * 1250 * outline / (1 + outline));
}

/// However it is diced, a mesh has the triangles that it has: where these do not pay, those that dicing would make are not counted,
/// which takes longer than tracing a small picture of a mesh of millions.
TEST(Dicing, IsNotCountedWhereTheMeshAloneDoesNotPay)
{
  const Scene scene = close_sphere(64, 4, 0.2);
  DisplacementOptions options = options_of(scene, 1, 200);
  const auto reason = [&] {
    const SceneContext context(scene, options);
    EXPECT_EQ(context.displacements.reasons().size(), 1u);
    return context.displacements.reasons()[0];
  };
  EXPECT_EQ(reason().find("or more"), std::string::npos);
  options.num_rays = 100;
  EXPECT_NE(reason().find("or more"), std::string::npos) << reason();
  EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "chord");
  // What was diced in a picture before stays so, however little of it the next one shows.
  options.num_rays = 1e7;
  DisplacementOptions far = options;
  far.camera->world_from_camera.p = {0, 0, 1000};
  EXPECT_EQ(SceneContext(scene, far).displacements.method_names(), "chord");
  options.choices = far.choices = std::make_shared<DicingChoices>();
  for (const DisplacementOptions& picture : {options, far})
    EXPECT_EQ(SceneContext(scene, picture).displacements.method_names(), "tessellate");
}

/// What takes more than half of the allowance is not diced in the first picture of a sequence; in later ones it stays what it
/// was, with all of the allowance.
TEST(Dicing, IsDecidedOnceForASequence)
{
  const Scene scene = close_sphere(64, 4, 0.2);
  DisplacementOptions far = options_of(scene, 1, 200), near = far;
  far.camera->world_from_camera.p = {0, 0, 3};
  const SceneContext alone(scene, near);
  // Enough for blocks, which take the least.
  const TessellationLayout blocks = tessellation_layout_as(TessellationKind::kBlocks, tessellation_of(alone).layout());
  near.auto_bytes = tessellation_peak_bytes(blocks, kRenderTessellation) * 13 / 10;
  far.auto_bytes = near.auto_bytes;
  EXPECT_EQ(SceneContext(scene, near).displacements.method_names(), "tessellate");
  near.choices = far.choices = std::make_shared<DicingChoices>();
  for (const DisplacementOptions& options : {far, near, far})
    EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "tessellate");
  near.choices = far.choices = std::make_shared<DicingChoices>();
  for (const DisplacementOptions& options : {near, far, near})
    EXPECT_EQ(SceneContext(scene, options).displacements.method_names(), "chord");
}

/// Trees are refused memory while they are built.
TEST(SceneMemory, BoundsTrees)
{
  Scene scene = empty_scene();
  add_object(scene, sphere_mesh(1, 1000, 500, false), diffuse_material({1, 1, 1}));
  memory_limit_set(memory_limit().bytes - memory_left() + (std::uint64_t{40} << 20));
  EXPECT_THROW(SceneContext{scene}, OutOfMemory);
  memory_limit_reset();
  const SceneContext context(scene);
  EXPECT_TRUE(trace_rays(context, std::vector<TraceRay>{{{0, 0, 4}, {0, 0, -1}, 0, kInfinity}})[0].hit);
}

TEST(Dicing, IsOfMapsThatSayNothingElse)
{
  Scene scene = close_sphere(64, 4, 0.2);
  const auto is_diced = [&] {
    return SceneContext(scene, options_of(scene, 1, 200)).displacements.tessellation(0) != nullptr;
  };
  EXPECT_TRUE(is_diced());
  scene.displacements[0].lod = -1;
  EXPECT_TRUE(is_diced());
  scene.displacements[0].lod = 1;
  EXPECT_FALSE(is_diced());
  scene.displacements[0].lod = 0;
  scene.displacements[0].method = DisplacementMethod::chord;
  EXPECT_FALSE(is_diced());
}

}  // namespace
}  // namespace relief::test
