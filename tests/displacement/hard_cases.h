// The named cases that every method of tracing displaced triangles has to pass. A bug that is found gets a case here
// first.
//
// All numbers that the renderer takes are floats kept in doubles, so that it and the oracle are given the same problem.
// Instances with shear or negative scale transform the ray, not the surface, and are tested where instances are.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/displacement/random_cases.h"

namespace relief {

struct HardCase {
  std::string name;
  std::vector<oracle::DisplacedTriangle> triangles;
  oracle::HeightMap map;
  std::vector<oracle::Ray> rays{};
  /// The triangles enclose a volume without gaps: a line meets the surface an even number of times.
  bool is_closed = false;
  /// Not empty: heights as stored, some not finite; in `map` those are replaced by the mean of the others.
  std::vector<float> heights_with_nonfinite{};
};

namespace hard_case_parts {

using oracle::DisplacedTriangle;
using oracle::HeightMap;
using oracle::Ray;
using oracle::Vector2;
using oracle::Vector3;
using oracle::Wrap;

inline constexpr std::uint64_t kSeed = 20231;
inline constexpr int kNumRays = 400;
inline constexpr double kPi = 3.141592653589793;

inline HeightMap noise_map(int width, int height, double scale, double midlevel = .5)
{
  std::mt19937_64 random(kSeed + static_cast<std::uint64_t>(width * 8192 + height));
  HeightMap map{width, height, {}, Wrap::kRepeat, Wrap::kRepeat, float_rounded(scale), midlevel};
  for (int i = 0; i < width * height; ++i) map.h.push_back(random_unit(random));
  return map;
}

inline DisplacedTriangle float_rounded(DisplacedTriangle triangle)
{
  for (std::size_t k = 0; k < 3; ++k) {
    triangle.P[k] = relief::float_rounded(triangle.P[k]);
    triangle.N[k] = relief::float_rounded(triangle.N[k]);
    triangle.uv[k] = {relief::float_rounded(triangle.uv[k][0]), relief::float_rounded(triangle.uv[k][1])};
  }
  return triangle;
}

/// In the plane z = 0, normals along z.
inline DisplacedTriangle flat_triangle()
{
  return {{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}}, {{{0, 0}, {1, 0}, {0, 1}}}};
}

/// Askew, its normals about 50° apart.
inline DisplacedTriangle domed_triangle()
{
  return float_rounded({{{{.1, -.2, .3}, {1.2, .1, .5}, {.3, .9, .1}}},
                        {{{-.4, -.5, .9}, {.5, -.2, 1.1}, {0, .6, .8}}},
                        {{{.03, .05}, {.97, .11}, {.21, .93}}}});
}

inline DisplacedTriangle scaled_uv(DisplacedTriangle triangle, double scale, double shift_u, double shift_v)
{
  for (Vector2& uv : triangle.uv) uv = {scale * uv[0] + shift_u, scale * uv[1] + shift_v};
  return float_rounded(triangle);
}

/// Barycentric weights of the corners 1 and 2 at a place of the map.
inline Vector2 weights_at_uv(const DisplacedTriangle& triangle, const Vector2& uv)
{
  const Vector2 a = triangle.uv[0], b = triangle.uv[1], c = triangle.uv[2];
  const double bu = b[0] - a[0], bv = b[1] - a[1], cu = c[0] - a[0], cv = c[1] - a[1];
  const double u = uv[0] - a[0], v = uv[1] - a[1], determinant = bu * cv - bv * cu;
  return {(u * cv - v * cu) / determinant, (bu * v - bv * u) / determinant};
}

inline DisplacedTriangle scaled(DisplacedTriangle triangle, double scale, const Vector3& shift)
{
  for (Vector3& P : triangle.P) P = combination(scale, P, 1, shift);
  return float_rounded(triangle);
}

inline void add_random_rays(HardCase& hard_case, int num_rays = kNumRays)
{
  std::mt19937_64 random(kSeed);
  const int num_triangles = static_cast<int>(hard_case.triangles.size());
  for (const DisplacedTriangle& triangle : hard_case.triangles) {
    const std::vector<Ray> rays = random_rays(random, triangle, hard_case.map, std::max(8, num_rays / num_triangles));
    hard_case.rays.insert(hard_case.rays.end(), rays.begin(), rays.end());
  }
}

inline HardCase random_rays_case(const std::string& name, const DisplacedTriangle& triangle, const HeightMap& map)
{
  HardCase hard_case{name, {triangle}, map, {}};
  add_random_rays(hard_case);
  return hard_case;
}

/// Calls a maker of rays until there are enough.
inline HardCase special_rays_case(const std::string& name,
                                  const DisplacedTriangle& triangle,
                                  const HeightMap& map,
                                  const std::function<Ray(std::mt19937_64&)>& make)
{
  std::mt19937_64 random(kSeed);
  HardCase hard_case{name, {triangle}, map, {}};
  for (int i = 0; i < kNumRays; ++i) hard_case.rays.push_back(make(random));
  return hard_case;
}

inline Vector3 random_prism_point(std::mt19937_64& random, const DisplacedTriangle& triangle, const HeightMap& map)
{
  const auto [lowest, highest] = displacement_range(map);
  return relief::random_prism_point(random, triangle, lowest, highest);
}

inline void add_directions(std::vector<HardCase>& cases)
{
  const DisplacedTriangle flat = flat_triangle(), domed = domed_triangle();
  const HeightMap map = noise_map(16, 16, .1);
  cases.push_back(special_rays_case("grazing", domed, map, [&](std::mt19937_64& random) {
    const Vector3 target = random_prism_point(random, domed, map);
    const Vector3 other = prism_point(domed, random_barycentric(random), 0);
    const Vector3 base = prism_point(domed, random_barycentric(random), 0);
    const Vector3 tangent = combination(1, other, -1, base);
    const double tilt = std::pow(10, random_between(random, -6, -1));
    const Vector3 D = combination(1, tangent, tilt, random_direction(random));
    return ray_through(combination(1, target, -3, D), target);
  }));
  cases.push_back(special_rays_case("parallel to the base", flat, map, [&](std::mt19937_64& random) {
    // Half of them at the height of a texel, which the surface touches without crossing it, or of the base itself.
    const double texel_height = map.scale * (map.h[static_cast<std::size_t>(random_index(random, 256))] - map.midlevel);
    const double heights[4] = {random_between(random, -.05, .05), random_between(random, -.05, .05), texel_height, 0};
    const double phi = random_between(random, 0, 2 * kPi);
    const Vector3 target{random_between(random, 0, .6), random_between(random, 0, .4),
                         heights[random_index(random, 4)]};
    const Vector3 D{std::cos(phi), std::sin(phi), 0};
    return ray_through(combination(1, target, -2, D), target);
  }));
  // Seen edge-on at one s: weights are 0/0 there.
  cases.push_back(special_rays_case("in the plane of a facet", domed, map, [&](std::mt19937_64& random) {
    const double s = random_between(random, -.05, .05), tilt = std::pow(10, random_between(random, -16, -8));
    const auto facet_point = [&](const Vector2& b) {
      Vector3 at{};
      const double weights[3] = {1 - b[0] - b[1], b[0], b[1]};
      for (std::size_t k = 0; k < 3; ++k) {
        at = combination(1, at, weights[k], domed.P[k]);
        at = combination(1, at, weights[k] * s, domed.N[k]);
      }
      return at;
    };
    const Vector3 from = facet_point(random_barycentric(random)), to = facet_point(random_barycentric(random));
    const Vector3 D = combination(1, combination(1, to, -1, from), tilt, random_direction(random));
    return ray_through(combination(1, from, -3, D), from);
  }));
  for (const auto& [name, triangle] :
       {std::pair{"along a displacement line", domed}, std::pair{"along a displacement line of parallel ones", flat}}) {
    cases.push_back(special_rays_case(name, triangle, map, [&, t = triangle](std::mt19937_64& random) {
      Vector2 b = random_barycentric(random);
      // A corner, an edge's middle, and texel centres of the flat one.
      const Vector2 special[4] = {b, {0, 0}, {.5, 0}, {.09375, .28125}};
      b = special[random_index(random, 4)];
      const double side = random_index(random, 2) == 0 ? 1 : -1;
      return ray_through(prism_point(t, b, 2 * side), prism_point(t, b, random_between(random, -.05, .05)));
    }));
  }
  for (int num_zeros = 1; num_zeros <= 2; ++num_zeros) {
    const std::string name = num_zeros == 2 ? "two components zero" : "one component zero";
    for (const auto& [suffix, triangle] : {std::pair{"", domed}, std::pair{", flat", flat}}) {
      cases.push_back(special_rays_case(name + suffix, triangle, map, [&, t = triangle](std::mt19937_64& random) {
        const Vector3 target = relief::float_rounded(random_prism_point(random, t, map));
        const std::size_t axis = static_cast<std::size_t>(random_index(random, 3));
        Vector3 D{};
        D[axis] = random_index(random, 2) == 0 ? 1 : -1;
        if (num_zeros == 1) D[(axis + 1) % 3] = random_between(random, -1, 1);
        // A negative zero is a zero.
        D[(axis + 2) % 3] = random_index(random, 2) == 0 ? 0. : -0.;
        D = relief::float_rounded(D);
        return Ray{relief::float_rounded(combination(1, target, -4, D)), D, 0, HUGE_VAL};
      }));
    }
  }
}

inline void add_origins(std::vector<HardCase>& cases)
{
  const DisplacedTriangle domed = domed_triangle();
  const HeightMap map = noise_map(16, 16, .1);
  cases.push_back(special_rays_case("origin inside the prism", domed, map, [&](std::mt19937_64& random) {
    const Vector3 O = random_prism_point(random, domed, map);
    return ray_through(O, combination(1, O, 1, random_direction(random)));
  }));
  cases.push_back(special_rays_case("origin on the surface", domed, map, [&](std::mt19937_64& random) {
    const Vector3 O = oracle::surface_eval(domed, map, random_barycentric(random)).P;
    const double t_min = random_index(random, 2) == 0 ? 0 : 1e-5;
    return ray_through(O, combination(1, O, 1, random_direction(random)), t_min);
  }));
  cases.push_back(special_rays_case("origin a million away", domed, map, [&](std::mt19937_64& random) {
    const Vector3 target = random_prism_point(random, domed, map);
    return ray_through(combination(1, target, 1e6, random_direction(random)), target);
  }));
  cases.push_back(special_rays_case("limits of t inside the prism", domed, map, [&](std::mt19937_64& random) {
    const Vector3 inside = random_prism_point(random, domed, map);
    const Vector3 O = combination(1, inside, 1, random_direction(random));
    const double t_min = random_between(random, .9, 1.05);
    return ray_through(O, inside, t_min, t_min + random_between(random, 0, .1));
  }));
}

inline void add_normals(std::vector<HardCase>& cases)
{
  const DisplacedTriangle domed = domed_triangle();
  // Its displacement lines meet about 1.2 below the base.
  cases.push_back(random_rays_case("displacement lines cross", domed, noise_map(8, 8, -3, 0)));
  cases.push_back(random_rays_case("displacement lines nearly meet", domed, noise_map(8, 8, -1.2, 0)));
  DisplacedTriangle triangle = domed;
  triangle.N = {{{1, 0, .25}, {-1, .25, .125}, {0, -1, .25}}};
  cases.push_back(random_rays_case("normals over 90 degrees apart", triangle, noise_map(8, 8, .25)));
  triangle.N = {{{1, 0, 0}, {-1, 0, 0}, {0, 0, 1}}};
  cases.push_back(random_rays_case("normal zero on an edge", triangle, noise_map(8, 8, .25)));
  triangle.N = {{{1, 0, 0}, {-1, 1, 0}, {0, -1, 0}}};
  cases.push_back(random_rays_case("normal zero inside", triangle, noise_map(8, 8, .25)));
  triangle.N = {{{0, 0, 0}, {.5, -.25, 1}, {0, .5, 1}}};
  cases.push_back(random_rays_case("normal zero at a corner", triangle, noise_map(8, 8, .25)));
  // Its rays aim at where the surface would be otherwise.
  cases.push_back(random_rays_case("no normals", domed, noise_map(8, 8, .25)));
  cases.back().triangles[0].N = {};
  triangle.N = {{{.015625, 0, 1}, {0, 64, 16}, {0, 0, 1024}}};
  cases.push_back(random_rays_case("normals of very different length", triangle, noise_map(8, 8, .25)));
}

inline void add_shapes(std::vector<HardCase>& cases)
{
  const HeightMap map = noise_map(8, 8, .1);
  DisplacedTriangle triangle = domed_triangle();
  triangle.P = {{{0, 0, 0}, {1, .5, .25}, {.5, .2500001, .125}}};
  cases.push_back(random_rays_case("needle", float_rounded(triangle), map));
  triangle.P = {{{0, 0, 0}, {1, .5, .25}, {.0001, 0, 0}}};
  cases.push_back(random_rays_case("needle with a short edge", float_rounded(triangle), map));
  triangle.P = {{{0, 0, 0}, {1, .5, .25}, {.5, .25, .125}}};
  cases.push_back(random_rays_case("corners on a line", triangle, map));
  triangle.P = {{{0, 0, 0}, {1, .5, .25}, {1, .5, .25}}};
  cases.push_back(random_rays_case("two corners equal", triangle, map));
  triangle.P = {{{1, .5, .25}, {1, .5, .25}, {1, .5, .25}}};
  cases.push_back(random_rays_case("all corners equal", triangle, map));
  triangle.N = {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}};
  cases.push_back(random_rays_case("all corners and normals equal", triangle, map));
}

inline void add_texture_coordinates(std::vector<HardCase>& cases)
{
  const HeightMap map = noise_map(16, 8, .1);
  const DisplacedTriangle domed = domed_triangle();
  DisplacedTriangle triangle = domed;
  triangle.uv = {{{.25, .75}, {.25, .75}, {.25, .75}}};
  cases.push_back(random_rays_case("uv all equal", triangle, map));
  triangle.uv = {{{0, 0}, {1, .5}, {.5, .25}}};
  cases.push_back(random_rays_case("uv on a line", triangle, map));
  triangle.uv = {{{.25, 0}, {.25, 1}, {.25, .5}}};
  cases.push_back(random_rays_case("uv on a line of texel centres and borders", triangle, map));
  triangle.uv = {{{0, 0}, {1, .5}, {.5, .25001}}};
  cases.push_back(random_rays_case("uv nearly on a line", float_rounded(triangle), map));
  triangle = domed;
  for (Vector2& uv : triangle.uv) uv[0] = -uv[0];
  cases.push_back(random_rays_case("mirrored uv", triangle, map));
  cases.push_back(random_rays_case("uv at 10000", scaled_uv(domed, 1, 10000, -10000), map));
  // So far beside a clamped map that floats do not count the texels in between. What varies is the other axis.
  for (const auto& [size, far_uv] : {std::pair{1024, 10000.}, std::pair{4096, 10000.}, std::pair{16384, 1100.}}) {
    const std::string at = "clamp at uv " + std::to_string(static_cast<int>(far_uv)) + " on a map of ";
    const double span = 256. / size;
    HeightMap across = noise_map(size, 4, .1), down = noise_map(4, size, .1);
    across.wrap_u = down.wrap_v = Wrap::kClamp;
    triangle = domed;
    triangle.uv = {{{far_uv, 0}, {far_uv + span, 0}, {far_uv, 1}}};
    cases.push_back(random_rays_case(at + std::to_string(size) + " x 4", float_rounded(triangle), across));
    triangle.uv = {{{0, far_uv}, {0, far_uv + span}, {1, far_uv}}};
    cases.push_back(random_rays_case(at + "4 x " + std::to_string(size), float_rounded(triangle), down));
    across.wrap_v = Wrap::kClamp;
    triangle.uv = {{{-far_uv, far_uv}, {span - far_uv, far_uv}, {-far_uv, 1 + far_uv}}};
    cases.push_back(random_rays_case(at + std::to_string(size) + " x 4, both axes", float_rounded(triangle), across));
  }
  // From beside a clamped map over it to the other side. (Farther spans take the oracle minutes: see EveryTraversal.)
  HeightMap island = noise_map(64, 16, .1);
  island.wrap_u = island.wrap_v = Wrap::kClamp;
  triangle = domed;
  triangle.uv = {{{-20, -20}, {20, -6}, {4, 20}}};
  cases.push_back(random_rays_case("clamp over a uv span of 40", triangle, island));
  // Half of the rays at the little that is over the map.
  std::mt19937_64 random(kSeed);
  for (std::size_t i = 0; i < kNumRays; i += 2) {
    const Vector2 b = weights_at_uv(triangle, {random_unit(random), random_unit(random)});
    const Vector3 target = oracle::surface_eval(triangle, island, b).P;
    cases.back().rays[i] = ray_through(combination(1, target, 1, random_direction(random)), target);
  }
  // Long rays close to borders of the bounds' nodes, which they cross at a small angle.
  HardCase along{"long rays along borders of nodes", {flat_triangle()}, noise_map(1024, 1024, .004), {}};
  for (int i = 0; i < kNumRays; ++i) {
    const double border = 64 * (1 + random_index(random, 8)), off = std::pow(10, -3 - 4 * random_unit(random));
    const double at = random_unit(random) * 400 + 50, side = random_unit(random) < .5 ? -1 : 1;
    Vector2 uv{(border + side * off + .5) / 1024, (at + .5) / 1024};
    Vector3 direction{side * off * std::pow(10, -2 * random_unit(random)), 1, -.004 * (.2 + random_unit(random))};
    if (random_index(random, 2) == 0) {
      std::swap(uv[0], uv[1]);
      std::swap(direction[0], direction[1]);
    }
    const Vector3 target = oracle::surface_eval(along.triangles[0], along.map, weights_at_uv(along.triangles[0], uv)).P;
    along.rays.push_back(ray_through(combination(1, target, -1, direction), target));
  }
  cases.push_back(along);
  cases.push_back(random_rays_case("uv far below a texel", scaled_uv(domed, 1. / 512, .25, .25), map));
  HardCase tiled = random_rays_case("tiled 1000 times", scaled_uv(domed, 1000, 0, 0), noise_map(8, 8, .002));
  cases.push_back(tiled);
  cases.push_back(random_rays_case("tiled 1000 times, mirrored and clamped", tiled.triangles[0], tiled.map));
  cases.back().map.wrap_u = Wrap::kMirror;
  cases.back().map.wrap_v = Wrap::kClamp;
}

inline void add_maps(std::vector<HardCase>& cases)
{
  const DisplacedTriangle domed = domed_triangle();
  HeightMap map{32, 32, std::vector<double>(32 * 32, 0.), Wrap::kRepeat, Wrap::kRepeat, .5, 0};
  std::mt19937_64 random(kSeed);
  for (int i = 0; i < 24; ++i) map.h[static_cast<std::size_t>(random_index(random, 32 * 32))] = 1;
  cases.push_back(random_rays_case("spikes of one texel", domed, map));
  map = {4, 4, std::vector<double>(16, .75), Wrap::kRepeat, Wrap::kRepeat, .25, .5};
  cases.push_back(random_rays_case("constant map", domed, map));
  cases.push_back(random_rays_case("constant map, flat", flat_triangle(), map));
  map.midlevel = .75;
  cases.push_back(random_rays_case("constant map at the midlevel", domed, map));
  cases.push_back(random_rays_case("scale zero", domed, noise_map(16, 16, 0)));
  cases.push_back(random_rays_case("negative scale", domed, noise_map(16, 16, -.2)));

  const int sizes[][2] = {{1, 1}, {1, 7}, {7, 1}, {2, 1}, {2, 2}, {3, 5}, {13, 6}, {31, 33}};
  for (const auto& size : sizes) {
    const std::string name = "map of " + std::to_string(size[0]) + " x " + std::to_string(size[1]);
    cases.push_back(random_rays_case(name, scaled_uv(domed, 2, -.3, .4), noise_map(size[0], size[1], .1)));
  }
  // A thin slice of it: its texels are forty times as high as wide.
  cases.push_back(random_rays_case("map of 4097 x 33", domed, noise_map(4097, 33, .02)));

  const Wrap wraps[] = {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp};
  const char* const labels[] = {"repeat", "mirror", "clamp"};
  for (std::size_t u = 0; u < 3; ++u) {
    for (std::size_t v = 0; v < 3; ++v) {
      map = noise_map(5, 4, .1);
      map.wrap_u = wraps[u];
      map.wrap_v = wraps[v];
      const std::string name = std::string("wrap ") + labels[u] + ", " + labels[v];
      cases.push_back(random_rays_case(name, scaled_uv(domed, 4, -1.7, -2.3), map));
    }
  }

  map = noise_map(9, 7, .2);
  std::vector<float> stored;
  for (const double h : map.h) stored.push_back(static_cast<float>(h));
  stored[3] = std::numeric_limits<float>::quiet_NaN();
  stored[24] = std::numeric_limits<float>::infinity();
  stored[25] = -std::numeric_limits<float>::infinity();
  stored[62] = -std::numeric_limits<float>::quiet_NaN();
  double sum = 0;
  int num_finite = 0;
  for (const float h : stored) {
    if (!std::isfinite(h)) continue;
    sum += static_cast<double>(h);
    ++num_finite;
  }
  for (std::size_t i = 0; i < stored.size(); ++i) {
    if (!std::isfinite(stored[i])) map.h[i] = relief::float_rounded(sum / num_finite);
  }
  cases.push_back(random_rays_case("texels that are not finite", domed, map));
  cases.back().heights_with_nonfinite = stored;
}

inline void add_world_scales(std::vector<HardCase>& cases)
{
  for (const double scale : {1e-4, 1e-2, 1e3, 1e6}) {
    const DisplacedTriangle triangle = scaled(domed_triangle(), scale, {});
    cases.push_back(random_rays_case("world scale " + std::to_string(scale), triangle, noise_map(16, 16, .1 * scale)));
  }
  const DisplacedTriangle far = scaled(domed_triangle(), 1, {4000, -3000, 1000});
  cases.push_back(random_rays_case("far from the world's origin", far, noise_map(16, 16, .1)));
}

/// A grid of quads over (u, v) in [0, 1]², two triangles each; degenerate ones are left out.
/// @param P_of, N_of  functions of the indices in u and v, which must agree where the grid closes
inline std::vector<DisplacedTriangle> grid_triangles(int num_u,
                                                     int num_v,
                                                     double tiles_u,
                                                     double tiles_v,
                                                     const std::function<Vector3(int, int)>& P_of,
                                                     const std::function<Vector3(int, int)>& N_of)
{
  std::vector<DisplacedTriangle> triangles;
  const auto add = [&](const std::array<std::array<int, 2>, 3>& corners) {
    DisplacedTriangle triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [i, j] = corners[k];
      triangle.P[k] = P_of(i, j);
      triangle.N[k] = N_of(i, j);
      triangle.uv[k] = {tiles_u * i / num_u, tiles_v * j / num_v};
    }
    triangle = float_rounded(triangle);
    if (triangle.P[0] != triangle.P[1] && triangle.P[1] != triangle.P[2] && triangle.P[2] != triangle.P[0]) {
      triangles.push_back(triangle);
    }
  };
  for (int j = 0; j < num_v; ++j) {
    for (int i = 0; i < num_u; ++i) {
      add({{{i, j}, {i + 1, j + 1}, {i + 1, j}}});
      add({{{i, j}, {i, j + 1}, {i + 1, j + 1}}});
    }
  }
  return triangles;
}

/// A globe: poles on the z axis, u around it. The map is constant near the poles, where u is not continuous.
inline HardCase sphere_case(const std::string& name, double amplitude)
{
  constexpr int kNumU = 8, kNumV = 4;
  const auto P_of = [](int i, int j) -> Vector3 {
    if (j == 0 || j == kNumV) return {0, 0, j == 0 ? 1. : -1.};
    const double theta = kPi * j / kNumV, phi = 2 * kPi * (i % kNumU) / kNumU;
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  };
  HardCase result{name, grid_triangles(kNumU, kNumV, 1, 1, P_of, P_of), noise_map(32, 16, amplitude), {}};
  result.map.wrap_v = Wrap::kClamp;
  for (std::size_t row = 0; row < 16; ++row) {
    if (row > 4 && row < 11) continue;
    for (std::size_t column = 0; column < 32; ++column) result.map.h[32 * row + column] = .5;
  }
  result.is_closed = true;
  return result;
}

inline void add_closed_surfaces(std::vector<HardCase>& cases)
{
  std::mt19937_64 random(kSeed);
  HardCase from_center = sphere_case("from the centre of a closed sphere", .2);
  for (int i = 0; i < 2 * kNumRays; ++i) from_center.rays.push_back(ray_through({0, 0, 0}, random_direction(random)));
  for (const DisplacedTriangle& triangle : from_center.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      // Through corners and middles of edges, and along the axes.
      from_center.rays.push_back(ray_through({0, 0, 0}, triangle.P[k]));
      from_center.rays.push_back(ray_through({0, 0, 0}, combination(.5, triangle.P[k], .5, triangle.P[(k + 1) % 3])));
    }
  }
  cases.push_back(from_center);

  HardCase poles = sphere_case("at the poles of a closed sphere", .2);
  for (int i = 0; i < kNumRays; ++i) {
    const double side = i % 2 == 0 ? 1 : -1;
    const double distance = std::pow(10, random_between(random, -8, -1));
    const Vector3 near_pole = combination(distance, random_direction(random), 1, {0, 0, side});
    poles.rays.push_back(ray_through(combination(1, near_pole, 3, random_direction(random)), near_pole));
    poles.rays.push_back(ray_through({0, 0, 4 * side}, {0, 0, 0}));
  }
  cases.push_back(poles);

  HardCase across = sphere_case("through a closed sphere", .4);
  for (int i = 0; i < 2 * kNumRays; ++i) {
    const Vector3 inside = random_vector(random, 0, 1.1);
    across.rays.push_back(ray_through(combination(4, random_direction(random), 0, {}), inside));
  }
  cases.push_back(across);

  constexpr int kNumAround = 10, kNumTube = 6;
  const auto angle_u = [](int i) { return 2 * kPi * (i % kNumAround) / kNumAround; };
  const auto angle_v = [](int j) { return -2 * kPi * (j % kNumTube) / kNumTube; };
  const auto N_of = [&](int i, int j) -> Vector3 {
    return {std::cos(angle_v(j)) * std::cos(angle_u(i)), std::cos(angle_v(j)) * std::sin(angle_u(i)),
            std::sin(angle_v(j))};
  };
  const auto P_of = [&](int i, int j) {
    return combination(.4, N_of(i, j), 1, {std::cos(angle_u(i)), std::sin(angle_u(i)), 0});
  };
  HardCase torus{"closed torus", grid_triangles(kNumAround, kNumTube, 2, 1, P_of, N_of), noise_map(16, 12, .15), {}};
  torus.is_closed = true;
  for (int i = 0; i < 2 * kNumRays; ++i) {
    const double phi = random_between(random, 0, 2 * kPi);
    const Vector3 inside = combination(.5, random_direction(random), 1, {std::cos(phi), std::sin(phi), 0});
    torus.rays.push_back(ray_through(combination(4, random_direction(random), 0, {}), inside));
  }
  cases.push_back(torus);
}

inline void add_neighbours(std::vector<HardCase>& cases)
{
  // Six triangles around a corner, as a hat.
  HardCase hat{"through shared corners and edges", {}, noise_map(8, 8, .2), {}};
  const auto rim = [](int i) -> Vector3 {
    const double phi = 2 * kPi * (i % 6) / 6;
    return {std::cos(phi), std::sin(phi), -.5};
  };
  for (int i = 0; i < 6; ++i) {
    const Vector3 a = rim(i), b = rim(i + 1);
    DisplacedTriangle triangle{{{{0, 0, 0}, a, b}}, {{{0, 0, 1}, a, b}}, {}};
    for (std::size_t k = 0; k < 3; ++k) {
      if (k > 0) triangle.N[k][2] = 1;
      triangle.uv[k] = {.5 * triangle.P[k][0], .5 * triangle.P[k][1]};
    }
    hat.triangles.push_back(float_rounded(triangle));
  }
  std::mt19937_64 random(kSeed);
  for (int i = 0; i < kNumRays; ++i) {
    const DisplacedTriangle& triangle = hat.triangles[static_cast<std::size_t>(random_index(random, 6))];
    // On the shared corner, on shared edges, a few ulps beside them.
    const double along = random_unit(random), beside = i % 3 == 0 ? 0 : std::pow(10, random_between(random, -17, -6));
    const Vector2 b = i % 5 == 0 ? Vector2{0, 0} : Vector2{along * (1 - beside), along * beside};
    const Vector3 target = oracle::surface_eval(triangle, hat.map, b).P;
    hat.rays.push_back(ray_through(combination(1, target, 2, random_direction(random)), target));
    if (i % 5 == 0) hat.rays.push_back({{0, 0, i % 2 == 0 ? 2. : -2.}, {0, 0, i % 2 == 0 ? -1. : 1.}, 0, HUGE_VAL});
  }
  cases.push_back(hat);

  // Corner 0 is a texel's centre, and rays pass so close to it that the stretch inside the prism is far below a texel.
  const DisplacedTriangle cornered = scaled_uv(domed_triangle(), 1, .46875 - .03, .53125 - .05);
  const HeightMap around_corner = noise_map(16, 16, .25);
  cases.push_back(
      special_rays_case("past a corner at a texel's centre", cornered, around_corner, [&](auto& corner_random) {
        const double away = std::pow(10, random_between(corner_random, -11, -5));
        const Vector2 direction = random_barycentric(corner_random);
        const Vector3 target =
            oracle::surface_eval(cornered, around_corner, {away * direction[0], away * direction[1]}).P;
        return ray_through(combination(1, target, 1, random_direction(corner_random)), target);
      }));

  // The wall over the edge from corner 0 to corner 1 of the flat triangle is the plane y = 0.
  const DisplacedTriangle flat = flat_triangle(), domed = domed_triangle();
  const HeightMap map = noise_map(8, 8, .25);
  cases.push_back(special_rays_case("in the plane of a wall", flat, map, [](std::mt19937_64& wall_random) {
    const double phi = random_between(wall_random, 0, 2 * kPi);
    const Vector3 target{random_between(wall_random, 0, 1), 0, random_between(wall_random, -.12, .12)};
    return ray_through(combination(1, target, 2, {std::cos(phi), 0, std::sin(phi)}), target);
  }));
  DisplacedTriangle twisted = domed;
  twisted.N = {{{-.5, -1, 1}, {.5, 1, 1}, {0, .25, 1}}};
  cases.push_back(special_rays_case("twice through a twisted wall", twisted, map, [&](std::mt19937_64& wall_random) {
    // From one point of the wall over an edge to another, on opposite sides of the edge's middle.
    const auto wall_point = [&](double low, double high) {
      const double b1 = random_between(wall_random, low, high);
      return prism_point(twisted, {b1, 0}, random_between(wall_random, -.12, .12));
    };
    const Vector3 first = wall_point(0, .5), second = wall_point(.5, 1);
    return ray_through(combination(2, first, -1, second), first);
  }));

  // Two surfaces that face each other; at their highest texels the gap is a thousandth of the displacement.
  HardCase gap{"two surfaces that almost touch", {flat, flat}, noise_map(8, 8, .125, 0), {}};
  const double highest = displacement_range(gap.map)[1];
  for (Vector3& P : gap.triangles[1].P) P[2] = relief::float_rounded(2 * highest + 1. / 8192);
  std::swap(gap.triangles[1].P[1], gap.triangles[1].P[2]);
  std::swap(gap.triangles[1].uv[1], gap.triangles[1].uv[2]);
  for (Vector3& N : gap.triangles[1].N) N = {0, 0, -1};
  for (int i = 0; i < kNumRays; ++i) {
    const Vector2 b = random_barycentric(random);
    const Vector3 lower = oracle::surface_eval(gap.triangles[0], gap.map, b).P;
    const Vector3 upper = oracle::surface_eval(gap.triangles[1], gap.map, {b[1], b[0]}).P;
    const Vector3 other = oracle::surface_eval(gap.triangles[1], gap.map, random_barycentric(random)).P;
    // Shadow rays from one to the other that end just before it, just after it, and rays between both.
    gap.rays.push_back(ray_through(lower, upper, 1e-3, i % 2 == 0 ? .999 : 1.001));
    gap.rays.push_back(ray_through(lower, other, 1e-4, .9999));
    gap.rays.push_back(ray_through({-1, b[1], highest}, {b[0], b[1], highest + random_between(random, 0, 1. / 8192)}));
  }
  cases.push_back(gap);
}

}  // namespace hard_case_parts

/// All cases, the same on every call.
inline std::vector<HardCase> hard_cases()
{
  std::vector<HardCase> cases;
  hard_case_parts::add_directions(cases);
  hard_case_parts::add_origins(cases);
  hard_case_parts::add_normals(cases);
  hard_case_parts::add_shapes(cases);
  hard_case_parts::add_texture_coordinates(cases);
  hard_case_parts::add_maps(cases);
  hard_case_parts::add_world_scales(cases);
  hard_case_parts::add_closed_surfaces(cases);
  hard_case_parts::add_neighbours(cases);
  return cases;
}

}  // namespace relief
