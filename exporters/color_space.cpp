#include "exporters/color_space.h"

#include <algorithm>

#include "exporters/picture.h"

namespace relief {

namespace {

using Column = std::array<double, 3>;

constexpr ColorMatrix kCones = {{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};

constexpr std::array<std::string_view, 9> kColorLayers = {
    "", "direct", "indirect", "caustic", "albedo", "emission", "environment", "denoising_albedo", "denoised"};

ColorMatrix product(const ColorMatrix& a, const ColorMatrix& b)
{
  ColorMatrix out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) out[i][j] += a[i][k] * b[k][j];
    }
  }
  return out;
}

Column product(const ColorMatrix& a, const Column& b)
{
  Column out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = a[i][0] * b[0] + a[i][1] * b[1] + a[i][2] * b[2];
  return out;
}

ColorMatrix inverse(const ColorMatrix& m)
{
  const auto minor = [&](std::size_t i, std::size_t j) {
    const std::size_t a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
    return m[a][c] * m[b][d] - m[a][d] * m[b][c];
  };
  const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
  ColorMatrix out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) out[j][i] = minor(i, j) / determinant;
  }
  return out;
}

Column xyz(const std::array<double, 2>& xy) { return {xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]}; }

ColorMatrix xyz_from(const Chromaticities& c)
{
  const Column red = xyz(c.red), green = xyz(c.green), blue = xyz(c.blue);
  ColorMatrix columns{};
  for (std::size_t i = 0; i < 3; ++i) columns[i] = {red[i], green[i], blue[i]};
  const Column scale = product(inverse(columns), xyz(c.white));
  for (Column& row : columns) row = {row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]};
  return columns;
}

}  // namespace

ColorMatrix color_matrix(ColorSpace from, ColorSpace to)
{
  const Chromaticities& a = kChromaticities[static_cast<std::size_t>(from)];
  const Chromaticities& b = kChromaticities[static_cast<std::size_t>(to)];
  const Column cones_a = product(kCones, xyz(a.white)), cones_b = product(kCones, xyz(b.white));
  ColorMatrix gain{};
  for (std::size_t i = 0; i < 3; ++i) gain[i][i] = cones_b[i] / cones_a[i];
  const ColorMatrix adapted = product(inverse(kCones), product(gain, kCones));
  return product(inverse(xyz_from(b)), product(adapted, xyz_from(a)));
}

std::optional<std::size_t> color_component(std::string_view channel)
{
  const std::size_t dot = channel.rfind('.');
  const std::string_view layer = dot == std::string_view::npos ? std::string_view() : channel.substr(0, dot);
  const std::string_view last = dot == std::string_view::npos ? channel : channel.substr(dot + 1);
  const bool is_color = std::find(kColorLayers.begin(), kColorLayers.end(), layer) != kColorLayers.end() ||
                        layer.starts_with(kLightGroupLayer);
  if (last.size() != 1 || !is_color) return {};
  const std::size_t component = std::string_view("RGB").find(last[0]);
  if (component == std::string_view::npos) return {};
  return component;
}

}  // namespace relief
