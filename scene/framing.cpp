#include "scene/framing.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <system_error>

namespace relief {
namespace {

constexpr double kDefaultFov = 40;  // degrees: a normal lens
constexpr double kFilled = 0.88;    // of the window

double dot_double(Vec3f a, Vec3f b)
{
  return static_cast<double>(a.x) * static_cast<double>(b.x) + static_cast<double>(a.y) * static_cast<double>(b.y) +
         static_cast<double>(a.z) * static_cast<double>(b.z);
}

/// tan of half a field of view.
double half_window(double fov) { return std::tan((fov > 0 ? fov : kDefaultFov) * std::numbers::pi / 360); }

SceneCamera perspective(const char* name, const Affine3& frame, double half_height, float image_aspect, double distance)
{
  SceneCamera out;
  out.name = name;
  out.camera.world_from_camera = frame;
  out.camera.half_height = static_cast<float>(half_height);
  camera_fit(out.camera, image_aspect, 1);
  out.camera.focus_distance = static_cast<float>(distance);
  return out;
}

}  // namespace

std::optional<std::size_t> camera_named(std::span<const SceneCamera> cameras, const std::string& text)
{
  if (text.empty() && !cameras.empty()) return 0;
  const auto named = std::find_if(cameras.begin(), cameras.end(), [&](const SceneCamera& c) { return c.name == text; });
  if (named != cameras.end()) return static_cast<std::size_t>(named - cameras.begin());
  std::size_t index = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), index);
  if (read.ec == std::errc() && read.ptr == text.data() + text.size() && index < cameras.size()) return index;
  return {};
}

Affine3 camera_frame(Vec3f z, Vec3f up, Vec3f P)
{
  Affine3 m;
  m.z = normalize(z);
  m.x = normalize(cross(up, m.z));
  m.y = cross(m.z, m.x);
  m.p = P;
  return m;
}

std::vector<Vec3f> extreme_points(const std::vector<Vec3f>& points)
{
  constexpr std::size_t kNumDirections = 128;
  if (points.size() <= kNumDirections) return points;
  std::array<Vec3f, kNumDirections> directions;
  for (std::size_t i = 0; i < kNumDirections; ++i) {
    // A spiral from pole to pole, by the golden angle.
    const double z = 1 - (2 * static_cast<double>(i) + 1) / kNumDirections;
    const double r = std::sqrt(1 - z * z), phi = static_cast<double>(i) * 2.39996322972865332;
    directions[i] = {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
                     static_cast<float>(z)};
  }
  std::array<float, kNumDirections> farthest;
  farthest.fill(-kInfinity);
  std::array<std::size_t, kNumDirections> index{};
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (std::size_t i = 0; i < kNumDirections; ++i) {
      const float reach = dot(points[k], directions[i]);
      if (reach > farthest[i]) farthest[i] = reach, index[i] = k;
    }
  }
  std::sort(index.begin(), index.end());
  const auto end = std::unique(index.begin(), index.end());
  std::vector<Vec3f> out;
  std::transform(index.begin(), end, std::back_inserter(out), [&](std::size_t k) { return points[k]; });
  return out;
}

Framing::Framing(double fov, float image_aspect)
    : half_width_(half_window(fov) * static_cast<double>(image_aspect)),
      half_height_(half_window(fov)),
      nearest_(-std::numeric_limits<double>::infinity())
{
  axes_ = camera_frame({0.5f, 0.4f, 1.0f}, {0, 1, 0}, {});
  const auto k_x = static_cast<float>(kFilled * half_width_), k_y = static_cast<float>(kFilled * half_height_);
  side_[0] = axes_.x + axes_.z * k_x;
  side_[1] = -axes_.x + axes_.z * k_x;
  side_[2] = axes_.y + axes_.z * k_y;
  side_[3] = -axes_.y + axes_.z * k_y;
  std::fill(std::begin(reach_), std::end(reach_), -std::numeric_limits<double>::infinity());
}

void Framing::add(const Affine3& world_from_object,
                  const std::vector<Vec3f>& points,
                  float reach_object,
                  float reach_world)
{
  const Affine3& m = world_from_object;
  // How far a ball of radius reach_object gets in a direction.
  const auto reach = [&](Vec3f direction) {
    const Vec3f in_object{dot(m.x, direction), dot(m.y, direction), dot(m.z, direction)};
    return static_cast<double>(reach_object * length(in_object) + reach_world * length(direction));
  };
  double extra[kNumSides];
  for (int i = 0; i < kNumSides; ++i) extra[i] = reach(side_[i]);
  const double extra_near = reach(axes_.z);
  const Vec3f extra_box{static_cast<float>(reach({1, 0, 0})), static_cast<float>(reach({0, 1, 0})),
                        static_cast<float>(reach({0, 0, 1}))};
  for (const Vec3f p : points) {
    const Vec3f P = transform_point(m, p);
    if (!is_finite(P)) continue;
    for (int i = 0; i < kNumSides; ++i) reach_[i] = std::max(reach_[i], dot_double(P, side_[i]) + extra[i]);
    nearest_ = std::max(nearest_, dot_double(P, axes_.z) + extra_near);
    low_ = min(low_, P - extra_box);
    high_ = max(high_, P + extra_box);
  }
}

Vec3f Framing::middle() const { return low_.x <= high_.x ? low_ * 0.5f + high_ * 0.5f : Vec3f{}; }

// Seen from (a, b, c) in the camera's axes, a point (X, Y, Z) lies within the window if |X − a| ≤ k_x (c − Z), and likewise
// for Y. All points do if the farthest ones do along X + k_x Z and −X + k_x Z: their reaches R₊ ≤ a + k_x c and
// R₋ ≤ −a + k_x c. So the nearest c is (R₊ + R₋) / 2 k_x, or that of Y if it is larger, and (R₊ − R₋) / 2 is halfway.
SceneCamera Framing::camera() const
{
  if (!(low_.x <= high_.x)) {
    Framing cube = *this;
    cube.add({}, {{-1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}, {-1, 1, 1}, {1, -1, -1}, {1, -1, 1}, {1, 1, -1}, {1, 1, 1}});
    return cube.camera();
  }
  const double k_x = kFilled * half_width_, k_y = kFilled * half_height_;
  const double a = (reach_[0] - reach_[1]) / 2, b = (reach_[2] - reach_[3]) / 2;
  // Of a point, or a line along the axis, the nearest place would be the point itself.
  const double size = static_cast<double>(length(high_ - low_));
  const double away = std::max(0.01 * size, 1e-6 * std::max(1.0, static_cast<double>(length(middle()))));
  const double c =
      std::max({(reach_[0] + reach_[1]) / (2 * k_x), (reach_[2] + reach_[3]) / (2 * k_y), nearest_ + away});
  Affine3 frame = axes_;
  const auto along = [&](float Vec3f::*axis) {
    return static_cast<float>(a * static_cast<double>(axes_.x.*axis) + b * static_cast<double>(axes_.y.*axis) +
                              c * static_cast<double>(axes_.z.*axis));
  };
  frame.p = {along(&Vec3f::x), along(&Vec3f::y), along(&Vec3f::z)};
  const auto image_aspect = static_cast<float>(half_width_ / half_height_);
  return perspective("framing", frame, half_height_, image_aspect, c - dot_double(middle(), axes_.z));
}

SceneCamera look_camera(Vec3f from, Vec3f at, double fov, float image_aspect)
{
  Vec3f z = from - at;
  const float distance = length(z);
  z = distance > 0 ? normalize(z) : Vec3f{0, 0, 1};
  // Straight up or down there is no upright; the front is below then, as on a map.
  constexpr float kSteepest = 0.99999f;
  const Vec3f up = std::fabs(z.y) < kSteepest ? Vec3f{0, 1, 0} : Vec3f{0, 0, z.y > 0 ? -1.0f : 1.0f};
  return perspective("look-from", camera_frame(z, up, from), half_window(fov), image_aspect,
                     static_cast<double>(max(distance, 1e-6f)));
}

}  // namespace relief
