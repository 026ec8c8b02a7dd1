// Nodes that are textures over directions: images all around, and the sky.
#include <cmath>

#include "kernel/math/cie_1931.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"
#include "scene/graph/hosek_wilkie.h"
#include "scene/graph/sky_model.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;
constexpr float kPiAngle = 3.14159265f;

/// The vector input; not given, it is the position: in an environment the direction.
GraphVector direction(GraphNode& n)
{
  return n.is_given("vector") ? n.vector("vector") : quantities(n.build, Q::position_x, Q::position_y, Q::position_z);
}

/// Whether a vector is the direction itself, where the graph is that of an environment.
bool is_direction(GraphBuilder& b, const GraphVector& v)
{
  return v == quantities(b, Q::position_x, Q::position_y, Q::position_z) ||
         v == quantities(b, Q::generated_x, Q::generated_y, Q::generated_z) ||
         v == quantities(b, Q::object_x, Q::object_y, Q::object_z);
}

constexpr GraphSocket kDirectionInputs[] = {{"vector", kVector}};

void lower_environment(GraphNode& n)
{
  static constexpr std::string_view kProjections[] = {"equirectangular", "mirror-ball"};
  GraphBuilder& b = n.build;
  const GraphVector d = normalized(b, direction(n));
  const GraphScalar half = b.constant(0.5f), one = b.constant(1), zero = b.constant(0);
  GraphScalar u, v;
  if (n.reader.choice("projection", kProjections, 0) == 0) {
    u = b(Op::subtract, {half, scaled(b, b(Op::arctangent2, {d[1], d[0]}), 0.5f / kPiAngle)});
    v = b(Op::subtract, {one, scaled(b, b(Op::arccosine, {d[2]}), 1 / kPiAngle)});
  } else {
    // The normal of the ball that reflects the direction to a viewer far away on −y: half way between the two.
    const GraphScalar towards = b(Op::maximum, {scaled(b, b(Op::subtract, {one, d[1]}), 0.5f), zero});
    const GraphScalar width = scaled(b, b(Op::square_root, {towards}), 4);
    u = b(Op::add, {b(Op::divide, {d[0], width}), half});
    v = b(Op::add, {b(Op::divide, {d[2], width}), half});
  }
  const GraphScalar inputs[] = {u, v, zero};
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.texture(n.reader)), 0};
  const std::vector<GraphScalar> rgba = b.apply(Op::image, inputs, immediates);
  n.set("color", {rgba[0], rgba[1], rgba[2]}, kColor);
  n.set("alpha", rgba[3]);
}

GraphVector color_constant(GraphBuilder& b, Vec3f v) { return {b.constant(v.x), b.constant(v.y), b.constant(v.z)}; }

GraphVector selected(GraphBuilder& b, GraphScalar is, const GraphVector& yes, const GraphVector& no)
{
  return {b(Op::select, {is, yes[0], no[0]}), b(Op::select, {is, yes[1], no[1]}), b(Op::select, {is, yes[2], no[2]})};
}

/// The sun's disk, brighter above where it is seen through less air, and dimmer towards its rim.
struct Disk {
  Vec3f towards;
  float low, high;  ///< elevations
  float diameter;
  Vec3f bottom, top;  ///< radiance there
};

Disk disk_of(const SkyModel& sky, float turn, float diameter, float intensity)
{
  const float radius = diameter / 2, e = sky.sun_elevation;
  const auto seen_at = [&](float elevation) {
    const bool may_be_below = sky.kind == SkyKind::kMultipleScattering;
    return sky_sun_radiance(sky, may_be_below ? elevation : std::fmax(elevation, 0.0f), diameter) * intensity;
  };
  Disk disk{{std::cos(e) * std::cos(turn), std::cos(e) * std::sin(turn), std::sin(e)},
            e - radius,
            e + radius,
            diameter,
            seen_at(e - radius),
            seen_at(e + radius)};
  if (sky.kind == SkyKind::kNishita) {
    // What shows of it.
    disk.low = e > radius ? e - radius : 0.0f;
    disk.high = std::fmax(e + radius, 1e-6f);
  }
  return disk;
}

/// @param angle  between the direction and the sun's middle
GraphVector disk_radiance(GraphBuilder& b, const Disk& disk, GraphScalar elevation, GraphScalar angle)
{
  const float radius = disk.diameter / 2;
  const GraphScalar t = scaled(b, b(Op::subtract, {elevation, b.constant(disk.low)}), 1 / (disk.high - disk.low));
  const GraphScalar from_middle = scaled(b, angle, 1 / radius);
  const GraphScalar one = b.constant(1);
  const GraphScalar height = b(Op::square_root, {b(Op::subtract, {one, b(Op::multiply, {from_middle, from_middle})})});
  constexpr float kLimbDarkening = 0.6f;
  const GraphScalar limb = b(Op::add, {b.constant(1 - kLimbDarkening), scaled(b, height, kLimbDarkening)});
  GraphVector out = mixed(b, t, color_constant(b, disk.bottom), color_constant(b, disk.top));
  for (GraphScalar& c : out) c = b(Op::multiply, {c, limb});
  return out;
}

/// How the sky's luminance, or a coordinate of its colour, varies.
/// @source Preetham, Shirley, Smits 1999, "A Practical Analytic Model for Daylight", after Perez
struct PerezLobe {
  float a, b, c, d, e;
  float zenith;

  float at(float theta, float gamma) const
  {
    const float cosine = std::cos(gamma);
    return (1 + a * std::exp(b / std::cos(theta))) * (1 + c * std::exp(d * gamma) + e * cosine * cosine);
  }

  /// @param cos_theta  from the zenith
  /// @param gamma      angle to the sun
  GraphScalar lower(GraphBuilder& g, GraphScalar cos_theta, GraphScalar gamma, float sun_theta) const
  {
    const GraphScalar one = g.constant(1), cosine = g(Op::cosine, {gamma});
    const GraphScalar by_height =
        g(Op::add, {one, scaled(g, g(Op::exponent, {g(Op::divide, {g.constant(b), cos_theta})}), a)});
    const GraphScalar by_sun = sum3(g, one, scaled(g, g(Op::exponent, {scaled(g, gamma, d)}), c),
                                    scaled(g, g(Op::multiply, {cosine, cosine}), e));
    return scaled(g, g(Op::multiply, {by_height, by_sun}), zenith / at(0, sun_theta));
  }
};

/// a t³ + b t² + c t + d.
float cubic(float t, float a, float b, float c, float d) { return ((a * t + b) * t + c) * t + d; }

/// Unit direction towards the sun.
Vec3f read_sun_direction(const JsonReader& r)
{
  const std::vector<double> given = r.numbers("sunDirection", 3, 3, -1e6, 1e6);
  if (given.empty()) return {0, 0, 1};
  const Vec3f sun{static_cast<float>(given[0]), static_cast<float>(given[1]), static_cast<float>(given[2])};
  if (!(length(sun) > 0)) r.fail("sunDirection", "a vector with a length");
  return normalize(sun);
}

/// Linear Rec.709 without what is below 0.
GraphVector color_of_xyz(GraphBuilder& b, const GraphVector& xyz)
{
  GraphVector color;
  for (std::size_t c = 0; c < 3; ++c) {
    const Vec3f row = kRec709FromXyz[c];
    const GraphScalar sum = sum3(b, scaled(b, xyz[0], row.x), scaled(b, xyz[1], row.y), scaled(b, xyz[2], row.z));
    color[c] = b(Op::maximum, {sum, b.constant(0)});
  }
  return color;
}

/// Cosine to the zenith; below the horizon these skies are what they are on it.
GraphScalar cosine_above_horizon(GraphBuilder& b, const GraphVector& d)
{
  return b(Op::maximum, {d[2], b.constant(std::sin(0.001f))});
}

void lower_preetham(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const Vec3f sun = read_sun_direction(n.reader);
  const float T = n.reader.number_f("turbidity", 2.2f, 1, 1000);
  const float theta = std::acos(sun.z);
  const float chi = (4.0f / 9.0f - T / 120.0f) * (kPiAngle - 2 * theta);
  constexpr float kUnit = 0.06f;  // of Cycles, for kcd/m²
  const PerezLobe luminance{
      0.1787f * T - 1.4630f,  -0.3554f * T + 0.4275f,
      -0.0227f * T + 5.3251f, 0.1206f * T - 2.5771f,
      -0.0670f * T + 0.3703f, kUnit * ((4.0453f * T - 4.9710f) * std::tan(chi) - 0.2155f * T + 2.4192f)};
  const PerezLobe x{-0.0193f * T - 0.2592f,
                    -0.0665f * T + 0.0008f,
                    -0.0004f * T + 0.2125f,
                    -0.0641f * T - 0.8989f,
                    -0.0033f * T + 0.0452f,
                    cubic(theta, 0.00166f, -0.00375f, 0.00209f, 0) * T * T +
                        cubic(theta, -0.02903f, 0.06377f, -0.03202f, 0.00394f) * T +
                        cubic(theta, 0.11693f, -0.21196f, 0.06052f, 0.25886f)};
  const PerezLobe y{-0.0167f * T - 0.2608f,
                    -0.0950f * T + 0.0092f,
                    -0.0079f * T + 0.2102f,
                    -0.0441f * T - 1.6537f,
                    -0.0109f * T + 0.0529f,
                    cubic(theta, 0.00275f, -0.00610f, 0.00317f, 0) * T * T +
                        cubic(theta, -0.04214f, 0.08970f, -0.04153f, 0.00516f) * T +
                        cubic(theta, 0.15346f, -0.26756f, 0.06670f, 0.26688f)};
  const GraphVector d = direction(n);
  const GraphScalar gamma = b(Op::arccosine, {dot(b, d, color_constant(b, sun))});
  const GraphScalar cos_theta = cosine_above_horizon(b, d);
  const GraphScalar Y = luminance.lower(b, cos_theta, gamma, theta);
  const GraphScalar cx = x.lower(b, cos_theta, gamma, theta), cy = y.lower(b, cos_theta, gamma, theta);
  const GraphScalar rest = b(Op::subtract, {b(Op::subtract, {b.constant(1), cx}), cy});
  const GraphScalar by = b(Op::divide, {Y, cy});
  const GraphScalar X = b(Op::multiply, {cx, by}), Z = b(Op::multiply, {rest, by});
  n.set("color", color_of_xyz(b, {X, Y, Z}), kColor);
}

/// @param gamma  angle to the sun
GraphScalar lower_lobe(GraphBuilder& b, const HosekWilkieLobe& lobe, GraphScalar cos_theta, GraphScalar gamma)
{
  const GraphScalar one = b.constant(1), cosine = b(Op::cosine, {gamma});
  const GraphScalar squared = b(Op::multiply, {cosine, cosine});
  const GraphScalar from_horizon = b(Op::add, {cos_theta, b.constant(0.01f)});
  const GraphScalar by_height =
      b(Op::add, {one, scaled(b, b(Op::exponent, {b(Op::divide, {b.constant(lobe.b), from_horizon})}), lobe.a)});
  const GraphScalar base = b(Op::add, {b.constant(1 + lobe.h * lobe.h), scaled(b, cosine, -2 * lobe.h)});
  const GraphScalar around_sun = b(Op::divide, {b(Op::add, {one, squared}), b(Op::power, {base, b.constant(1.5f)})});
  const GraphScalar scattered = sum3(b, scaled(b, b(Op::exponent, {scaled(b, gamma, lobe.e)}), lobe.d),
                                     scaled(b, squared, lobe.f), scaled(b, around_sun, lobe.g));
  const GraphScalar by_sun = sum3(b, b.constant(lobe.c), scattered, scaled(b, b(Op::square_root, {cos_theta}), lobe.i));
  return scaled(b, b(Op::multiply, {by_height, by_sun}), lobe.radiance);
}

void lower_hosek_wilkie(GraphNode& n)
{
  GraphBuilder& b = n.build;
  Vec3f sun = read_sun_direction(n.reader);
  // The model's suns stand above the horizon.
  if (sun.z < 0) sun = sun.x == 0 && sun.y == 0 ? Vec3f{0, 1, 0} : normalize(Vec3f{sun.x, sun.y, 0});
  const float turbidity = n.reader.number_f("turbidity", 2.2f, 0, 1000);
  const float albedo = n.reader.number_f("groundAlbedo", 0.3f, 0, 1);
  const HosekWilkieSky sky = hosek_wilkie_make(turbidity, albedo, kPiAngle / 2 - std::acos(std::fmin(sun.z, 1.0f)));
  const GraphVector d = direction(n);
  const GraphScalar gamma = b(Op::arccosine, {dot(b, d, color_constant(b, sun))});
  const GraphScalar cos_theta = cosine_above_horizon(b, d);
  // Of Cycles, for watts.
  constexpr float kUnit = 2 * kPiAngle / 683;
  GraphVector xyz;
  for (std::size_t c = 0; c < 3; ++c) xyz[c] = scaled(b, lower_lobe(b, sky.xyz[c], cos_theta, gamma), kUnit);
  n.set("color", color_of_xyz(b, xyz), kColor);
}

/// Clear sky of scattered light, of each kind.
void lower_scattering(GraphNode& n, SkyKind kind)
{
  GraphBuilder& b = n.build;
  const JsonReader& r = n.reader;
  const bool is_nishita = kind == SkyKind::kNishita;
  SkyModel sky;
  sky.kind = kind;
  sky.sun_elevation = r.number_f("sunElevation", 0.2617994f, -kPiAngle / 2, kPiAngle / 2);
  // Below a metre, and out in space, the model breaks down.
  const float altitude = r.number_f("altitude", 0, -1e9, 1e9);
  sky.altitude = std::fmin(std::fmax(altitude, 1.0f), kind == SkyKind::kMultipleScattering ? 99999.0f : 59999.0f);
  sky.air = r.number_f("air", 1, 0, 1000);
  sky.dust = r.number_f("dust", 1, 0, 1000);
  sky.ozone = r.number_f("ozone", 1, 0, 1000);
  const bool has_disk = r.boolean("sunDisc", true);
  // Less than this is lost in single precision.
  const float diameter = std::fmax(r.number_f("sunSize", 0.009512f, 0, kPiAngle), 0.0005f);
  const float intensity = r.number_f("sunIntensity", 1, 0, 1e6);
  float turn = std::fmod(r.number_f("sunRotation", 0, -1e6, 1e6), 2 * kPiAngle);
  if (turn < 0) turn += 2 * kPiAngle;
  turn = 2 * kPiAngle - turn;  // clockwise, seen from above

  const std::vector<float> table = sky_table(sky);
  const std::uint32_t place = b.add_table(table);
  const auto rows = static_cast<std::uint16_t>(is_nishita ? kSkyRows : kScatteringRows);
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(place & 0xffffu),
                                      static_cast<std::uint16_t>(place >> 16), kSkyColumns, rows};
  const auto look_up = [&](GraphScalar u, GraphScalar v) {
    const GraphScalar inputs[] = {u, v};
    const std::vector<GraphScalar> rgb = b.apply(Op::grid, inputs, immediates);
    return GraphVector{rgb[0], rgb[1], rgb[2]};
  };
  const GraphVector d = direction(n);
  const GraphScalar zero = b.constant(0), one = b.constant(1);
  const GraphScalar elevation = b(Op::subtract, {b.constant(kPiAngle / 2), b(Op::arccosine, {d[2]})});
  GraphScalar u =
      scaled(b, b(Op::add, {b(Op::arctangent2, {d[0], d[1]}), b.constant(kPiAngle + turn)}), 0.5f / kPiAngle);
  u = b(Op::select, {b(Op::greater_than, {u, one}), b(Op::subtract, {u, one}), u});
  const float radius = diameter / 2;
  GraphVector color;
  if (is_nishita) {
    color = look_up(u, b(Op::square_root, {scaled(b, elevation, 2 / kPiAngle)}));
  } else {
    const GraphScalar away = b(Op::square_root, {b(Op::absolute, {scaled(b, elevation, 2 / kPiAngle)})});
    const GraphScalar signed_away = b(Op::multiply, {away, b(Op::sign, {elevation})});
    color = look_up(u, b(Op::add, {b.constant(0.5f), scaled(b, signed_away, 0.5f)}));
  }
  if (has_disk && (sky.sun_elevation + radius > 0 || kind == SkyKind::kMultipleScattering)) {
    const Disk disk = disk_of(sky, turn + kPiAngle / 2, diameter, intensity);
    // By the tangent of half the angle: it is exact for small ones.
    const GraphVector to = color_constant(b, disk.towards);
    GraphVector apart, along;
    for (std::size_t c = 0; c < 3; ++c) {
      apart[c] = b(Op::subtract, {d[c], to[c]});
      along[c] = b(Op::add, {d[c], to[c]});
    }
    const GraphScalar angle = scaled(
        b, b(Op::arctangent2, {b(Op::square_root, {dot(b, apart, apart)}), b(Op::square_root, {dot(b, along, along)})}),
        2);
    const GraphVector sun = disk_radiance(b, disk, elevation, angle);
    const GraphScalar is_sun = b(Op::less_than, {angle, b.constant(radius)});
    if (is_nishita) {
      color = selected(b, is_sun, sun, color);
    } else {
      // The air before it shines, too. From above the horizon is below 0.
      constexpr float kEarthKilometres = 6371;
      const float horizon = std::acos(kEarthKilometres / (kEarthKilometres + std::fmax(altitude, 0.0f) / 1000));
      const GraphScalar is_seen = b(Op::multiply, {is_sun, b(Op::greater_than, {elevation, b.constant(-horizon)})});
      color = selected(b, is_seen, each(b, Op::add, color, sun), color);
    }
    if (is_direction(b, d)) n.suns.push_back({disk.towards, radius});
  }
  if (is_nishita) {
    // The horizon's colour fades away below it.
    const GraphScalar left = b(Op::maximum, {b(Op::add, {one, scaled(b, d[2], 1 / kGroundDepth)}), zero});
    const GraphScalar fade = b(Op::multiply, {b(Op::multiply, {left, left}), left});
    GraphVector ground = look_up(u, zero);
    for (GraphScalar& c : ground) c = b(Op::multiply, {c, fade});
    color = selected(b, b(Op::less_than, {d[2], zero}), ground, color);
  }
  for (GraphScalar& c : color) c = b(Op::maximum, {c, zero});
  n.set("color", color, kColor);
}

void lower_sky(GraphNode& n)
{
  static constexpr std::string_view kModels[] = {"nishita", "single-scattering", "multiple-scattering", "preetham",
                                                 "hosek-wilkie"};
  const int model = n.reader.choice("sky", kModels, 0);
  if (model == 3) {
    lower_preetham(n);
  } else if (model == 4) {
    lower_hosek_wilkie(n);
  } else {
    lower_scattering(n, static_cast<SkyKind>(model));
  }
}

constexpr GraphNodeKind kKinds[] = {
    {"environment-texture", kDirectionInputs, lower_environment},
    {"sky-texture", kDirectionInputs, lower_sky},
};

}  // namespace

std::span<const GraphNodeKind> graph_sky_nodes() { return kKinds; }

}  // namespace relief
