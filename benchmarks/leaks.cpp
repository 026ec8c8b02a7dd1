// Rays from inside of real closed meshes under displacement: every one has to hit something.
//
//   relief_bench_leaks MESH MAP [--scale S] [--midlevel M] [--tiles T] [--rays N] [--methods LIST] [--part K] [--from LIST]
//                         [--open-seams]
//
// A point whose winding number about the base mesh is not zero, and which is farther from it than any displacement, keeps
// its winding number while the mesh moves out to the displaced surface. So no ray from there can get out, whatever the
// mesh looks like and however it folds, if its seams are closed; that needs no oracle. Rays go in all directions and, on
// purpose, at displaced vertices and edges, beside them and along prism walls, each as a closest-hit and a shadow ray.
//
// With --from they start that many sizes of the mesh away and pass, as single precision has them, an inner point by less
// than its distance from any displacement: the same points are aimed at, but from beyond, or from behind the inner point.
//
// Tessellations are Embree's own triangles. It finds a shared edge on the same side from both of its triangles, but not
// all edges around a vertex: rays that meet a vertex to the last bit slip through any mesh now and then. What these rays
// do is counted apart and not held against tessellations.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/tick_count.h>
#include <CLI/CLI.hpp>

#include "displacement/displaced_triangle.h"
#include "integrator/flush_denormals.h"
#include "integrator/scene_context.h"
#include "scene/load.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

struct Settings {
  std::string mesh, map;
  float scale = 0.02f, midlevel = 0.5f, tiles = 1;
  double num_rays = 1e6;
  std::vector<std::string> methods;  ///< empty: all that do not tessellate
  std::uint64_t part = 0;
  std::vector<double> distances{0};  ///< sizes of the mesh
  bool open_seams = false;
};

/// A mesh of its own file with a displacement that the file does not have.
Scene displaced_scene(const Settings& settings)
{
  Scene scene = scene_load(settings.mesh);
  TextureRequest request;
  request.file = settings.map;
  request.label = settings.map;
  Warnings warnings;
  scene.height_maps = height_maps_load(std::span(&request, 1), warnings).maps;
  DisplacementSettings displacement;
  displacement.height.texture_index = 0;
  displacement.height.m00 = displacement.height.m11 = settings.tiles;
  displacement.scale = settings.scale;
  displacement.midlevel = settings.midlevel;
  displacement.weld_seams = !settings.open_seams;
  scene.displacements = {displacement};
  for (Material& material : scene.materials) material.displacement_index = 0;
  return scene;
}

using Triangle = std::array<Vec3d, 3>;

/// Solid angle of a triangle as seen from a point, by its sign turned away or towards it.
/// @source Van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle", eq. 8
double solid_angle(const Triangle& triangle, Vec3d O)
{
  const Vec3d a = triangle[0] - O, b = triangle[1] - O, c = triangle[2] - O;
  const double la = length(a), lb = length(b), lc = length(c);
  return 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

double segment_distance(Vec3d a, Vec3d b, Vec3d O)
{
  const Vec3d along = b - a;
  const double squared = dot(along, along);
  const double t = squared > 0 ? std::clamp(dot(O - a, along) / squared, 0.0, 1.0) : 0.0;
  return length(a + t * along - O);
}

double triangle_distance(const Triangle& triangle, Vec3d O)
{
  const Vec3d n = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
  double nearest = HUGE_VAL;
  bool above = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d a = triangle[k], b = triangle[(k + 1) % 3];
    nearest = std::min(nearest, segment_distance(a, b, O));
    above = above && dot(cross(b - a, O - a), n) > 0;
  }
  return above ? std::min(nearest, std::abs(dot(O - triangle[0], n)) / length(n)) : nearest;
}

/// A point that stays inside, and a ball around it.
struct InnerPoint {
  Vec3f P;
  double radius = 0;
};

/// Points that stay inside whatever the displacement, in the order of a random walk through the mesh's box.
std::vector<InnerPoint> inner_points(const DisplacedMeshView& mesh, double largest_displacement, std::size_t count)
{
  std::vector<Triangle> triangles;
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  for (std::uint32_t i = 0; i < mesh.num_triangles; ++i) {
    Triangle& triangle = triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d P = triangle[k] = to_double(mesh.triangles[i].P[k]);
      low = {std::min(low.x, P.x), std::min(low.y, P.y), std::min(low.z, P.z)};
      high = {std::max(high.x, P.x), std::max(high.y, P.y), std::max(high.z, P.z)};
    }
  }
  std::vector<InnerPoint> points;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit;
  constexpr int kMostTrials = 100'000;
  for (int trial = 0; trial < kMostTrials && points.size() < count; ++trial) {
    const double x = unit(random), y = unit(random), z = unit(random);
    const Vec3f rounded =
        to_float(Vec3d{low.x + x * (high.x - low.x), low.y + y * (high.y - low.y), low.z + z * (high.z - low.z)});
    const Vec3d O = to_double(rounded);
    double turns = 0, nearest = HUGE_VAL;
    for (const Triangle& triangle : triangles) {
      turns += solid_angle(triangle, O) / (4 * M_PI);
      nearest = std::min(nearest, triangle_distance(triangle, O));
      if (nearest <= 1.001 * largest_displacement) break;
    }
    if (nearest > 1.001 * largest_displacement && std::abs(std::round(turns)) >= 1)
      points.push_back({rounded, nearest - 1.001 * largest_displacement});
  }
  return points;
}

struct Target {
  Vec3d P;
  bool is_vertex = false;
};

/// Where a ray is aimed at: the displaced surface's vertices and edges, next to them, prism walls, anywhere.
Target random_target(const DisplacedMeshView& mesh, Vec3d O, std::mt19937_64& random)
{
  const auto unit = [&] { return std::uniform_real_distribution<double>()(random); };
  const DisplacedTriangle& tri = mesh.triangles[random() % mesh.num_triangles];
  const auto k = static_cast<std::size_t>(random() % 3);
  const double along = unit(), beside = std::pow(10, -17 + 12 * unit());
  constexpr double corners[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  const double edges[3][2] = {{along, 0}, {0, along}, {along, 1 - along}};
  const double* edge = edges[k];
  switch (random() % 8) {
    case 0:
      return {surface_point(mesh, tri, corners[k][0], corners[k][1]).P, true};
    case 1:
      return {surface_point(mesh, tri, edge[0], edge[1]).P};
    case 2:
      return {surface_point(mesh, tri, edge[0] + beside * (1. / 3 - edge[0]), edge[1] + beside * (1. / 3 - edge[1])).P};
    case 3: {
      const BasePoint base = base_point(tri, edge[0], edge[1]);
      const double s =
          static_cast<double>(tri.s_min) + unit() * (static_cast<double>(tri.s_max) - static_cast<double>(tri.s_min));
      return {base.P + s * base.N};
    }
    case 4: {
      Vec3d axis{};
      (k == 0 ? axis.x : (k == 1 ? axis.y : axis.z)) = unit() < .5 ? 1 : -1;
      return {O + axis};
    }
    default:
      break;
  }
  const double z = 2 * unit() - 1, phi = 2 * M_PI * unit(), r = std::sqrt(1 - z * z);
  return {O + Vec3d{r * std::cos(phi), r * std::sin(phi), z}};
}

struct Leaks {
  std::uint64_t num_closest = 0, num_shadow = 0;  ///< rays not aimed at vertices
  std::uint64_t num_at_vertices = 0;              ///< of either kind
  double seconds = 0;
};

struct WorldRay {
  Vec3f O, D;
};

/// A ray that passes through a ball, if single precision has one: from within, or from afar.
/// @param to        where it would go from the ball's centre, object space
/// @param distance  from the centre, metres of object space; 0: it starts there
std::optional<WorldRay> world_ray(const Affine3& world_from_object, const InnerPoint& ball, Vec3d to, double distance)
{
  const Vec3d centre = to_double(ball.P), along = to - centre;
  if (distance == 0)
    return WorldRay{transform_point(world_from_object, ball.P), transform_vector(world_from_object, to_float(along))};
  const Vec3d O_object = centre + (distance / length(along)) * along;
  const WorldRay ray{transform_point(world_from_object, to_float(O_object)),
                     transform_vector(world_from_object, to_float(centre - O_object))};
  const Affine3& m = world_from_object;
  const Vec3d centre_world =
      centre.x * to_double(m.x) + centre.y * to_double(m.y) + centre.z * to_double(m.z) + to_double(m.p);
  const Vec3d D = to_double(ray.D);
  const double passes = length(cross(centre_world - to_double(ray.O), D)) / length(D);
  // The ball is an ellipsoid in the world, whose least axis is no shorter than this.
  const Affine3 inverse_of_it = inverse(m);
  const double least =
      ball.radius / length(Vec3d{length(to_double(inverse_of_it.x)), length(to_double(inverse_of_it.y)),
                                 length(to_double(inverse_of_it.z))});
  return passes < least ? std::optional(ray) : std::nullopt;
}

/// @param distance  of the rays' origins, sizes of the mesh; 0: inside
Leaks count_leaks(SceneContext& context,
                  const std::vector<InnerPoint>& points,
                  std::uint64_t num_rays,
                  std::uint64_t part,
                  double distance)
{
  const DisplacedMeshView& mesh = context.displacements.geometry(0).mesh;
  const Affine3& world_from_object = context.instances[0].world_from_object;
  const Box3 box = context.accel->displaced_bounds(0);
  const double metres = distance * static_cast<double>(length(box.high - box.low));
  std::atomic<std::uint64_t> num_closest{0}, num_shadow{0}, num_at_vertices{0};
  constexpr std::uint64_t kChunk = 1 << 16;
  const tbb::tick_count start = tbb::tick_count::now();
  tbb::parallel_for(std::uint64_t{0}, (num_rays + kChunk - 1) / kChunk, [&](std::uint64_t chunk) {
    const FlushDenormals flush;
    std::mt19937_64 random((part << 32) + chunk);
    EmbreeContext embree;
    embree_context_init(embree, false);
    TraversalCounters counters;
    embree.displacement = &counters;
    for (std::uint64_t i = chunk * kChunk; i < std::min(num_rays, (chunk + 1) * kChunk); ++i) {
      Target target;
      std::optional<WorldRay> ray;
      while (!ray) {
        const InnerPoint& from = points[random() % points.size()];
        target = random_target(mesh, to_double(from.P), random);
        // From afar, half of them meet what they are aimed at where they come out.
        const Vec3d to = metres > 0 && random() % 2 == 0 ? 2.0 * to_double(from.P) - target.P : target.P;
        ray = world_ray(world_from_object, from, to, metres);
      }
      const Vec3f O = ray->O, D = ray->D;
      RTCRayHit query{};
      query.ray.org_x = O.x;
      query.ray.org_y = O.y;
      query.ray.org_z = O.z;
      query.ray.dir_x = D.x;
      query.ray.dir_y = D.y;
      query.ray.dir_z = D.z;
      query.ray.tfar = HUGE_VALF;
      query.ray.mask = kRayBounce | kRayShadow;
      RTCRay shadow = query.ray;
      query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      context.accel->intersect(embree, query);
      context.accel->occluded(embree, shadow);
      const bool leaks = query.hit.geomID == RTC_INVALID_GEOMETRY_ID, dark_leaks = !(shadow.tfar < 0);
      if ((leaks || dark_leaks) && num_closest + num_shadow + num_at_vertices == 0) {
        fmt::print("  first: O {:.9g} {:.9g} {:.9g} D {:.9g} {:.9g} {:.9g}, {} ray\n", O.x, O.y, O.z, D.x, D.y, D.z,
                   leaks ? "closest-hit" : "shadow");
      }
      (target.is_vertex ? num_at_vertices : num_closest) += leaks ? 1 : 0;
      (target.is_vertex ? num_at_vertices : num_shadow) += dark_leaks ? 1 : 0;
    }
  });
  return {num_closest, num_shadow, num_at_vertices, (tbb::tick_count::now() - start).seconds()};
}

/// @return  whether nothing leaks
bool run(const Settings& settings)
{
  const Scene scene = displaced_scene(settings);
  if (scene.instances.size() != 1) throw std::runtime_error(settings.mesh + ": expected one object");
  const HeightRange range = height_map_range(scene.height_maps[0].view());
  const double most =
      static_cast<double>(std::abs(settings.scale) *
                          std::max(std::abs(range.low - settings.midlevel), std::abs(range.high - settings.midlevel)));
  const auto num_rays = static_cast<std::uint64_t>(settings.num_rays);
  std::vector<InnerPoint> points;
  bool tight = true;
  for (const DisplacementMethod method : kDisplacementMethods) {
    const std::string name(displacement_method_label(method));
    const bool is_wanted = settings.methods.empty() ? displacement_method(method).traverse != nullptr
                                                    : std::find(settings.methods.begin(), settings.methods.end(),
                                                                name) != settings.methods.end();
    if (!is_wanted) continue;
    DisplacementOptions options;
    options.method = method;
    SceneContext context(scene, options);
    if (points.empty()) {
      constexpr std::size_t kNumPoints = 64;
      points = inner_points(context.displacements.geometry(0).mesh, most, kNumPoints);
      if (points.empty())
        throw std::runtime_error("found no point that is inside and farther from the mesh than " +
                                 std::to_string(most));
      const DisplacedMeshReport report = context.displacements.report();
      fmt::print("{}: {} triangles, {} walls, {} folded prisms; {} inner points\n", settings.mesh,
                 context.displacements.num_triangles(), report.num_walls, report.num_folded, points.size());
    }
    for (const double distance : settings.distances) {
      const Leaks leaks = count_leaks(context, points, num_rays, settings.part, distance);
      fmt::print(
          "  {:<16}{} rays from {}: {} closest-hit and {} shadow rays got out, and {} aimed at vertices; {:.2f} "
          "Mrays/s\n",
          name, num_rays, distance > 0 ? fmt::format("{} sizes away", distance) : "inside", leaks.num_closest,
          leaks.num_shadow, leaks.num_at_vertices, 2e-6 * settings.num_rays / leaks.seconds);
      std::fflush(stdout);
      const bool is_tessellation = displacement_method(*options.method).tessellation.has_value();
      tight = tight && leaks.num_closest + leaks.num_shadow + (is_tessellation ? 0 : leaks.num_at_vertices) == 0;
    }
  }
  return tight;
}

}  // namespace

}  // namespace relief

int main(int argc, char** argv)
{
  relief::Settings settings;
  CLI::App app("Rays from inside of a closed mesh under displacement, none of which may get out");
  app.add_option("mesh", settings.mesh, "Scene file with one closed mesh (.gltf, .glb)")->required();
  app.add_option("map", settings.map, "Height map")->required();
  app.add_option("--scale", settings.scale, "Metres of displacement for a difference of 1");
  app.add_option("--midlevel", settings.midlevel, "Height that is not displaced");
  app.add_option("--tiles", settings.tiles, "Tiles of the map for a unit of the texture coordinates");
  app.add_option("--rays", settings.num_rays, "Rays of each kind for each method")->check(CLI::Range(1.0, 1e12));
  app.add_option("--methods", settings.methods, "Methods, by commas; default: all that do not tessellate")
      ->delimiter(',')
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(relief::kDisplacementMethodLabels) + 1,
                                                     std::end(relief::kDisplacementMethodLabels))));
  app.add_option("--part", settings.part, "Rays of its own for each part of a long run");
  app.add_option("--from", settings.distances, "Sizes of the mesh that rays start away, by commas; 0: inside")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 1e9));
  app.add_flag("--open-seams", settings.open_seams, "Without walls at texture seams, to see that leaks are found");
  CLI11_PARSE(app, argc, argv);
  try {
    return relief::run(settings) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "relief_bench_leaks: {}\n", error.what());
    return 2;
  }
}
