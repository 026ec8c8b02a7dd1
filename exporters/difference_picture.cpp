#include "exporters/difference_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "exporters/png_ocio.h"
#include "kernel/assert.h"

namespace relief {

namespace {

using Color = std::array<std::uint8_t, 3>;

constexpr Color kWhite{255, 255, 255}, kBlack{0, 0, 0}, kRed{178, 24, 43}, kBlue{33, 102, 172}, kGreen{0, 160, 0};
constexpr int kGap = 4;  // pixels between panels
constexpr int kBarHeight = 12;
constexpr int kGlyphScale = 2;  // a glyph is 3 × 5 dots of 2 × 2 pixels
constexpr int kStripHeight = kGap + kBarHeight + kGap + 5 * kGlyphScale + kGap;

struct Canvas {
  int width, height;
  std::vector<std::uint8_t> rgb;

  Canvas(int w, int h) : width(w), height(h), rgb(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 3, 255) {}

  /// Ignores what lies outside: text may be wider than a tiny picture.
  void set(int x, int y, const Color& color)
  {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const std::size_t at =
        (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * 3;
    std::copy(color.begin(), color.end(), rgb.begin() + static_cast<std::ptrdiff_t>(at));
  }
};

/// Rows of a glyph from the top, an octal digit each, whose bits are dots from the left.
std::string_view glyph_of(char c)
{
  constexpr std::string_view kCharacters = "0123456789.-+e";
  constexpr std::string_view kGlyphs[] = {"75557", "26227", "71747", "71717", "55711", "74717", "74757",
                                          "71222", "75757", "75717", "00002", "00700", "02720", "07747"};
  const std::size_t index = kCharacters.find(c);
  return index == std::string_view::npos ? "00000" : kGlyphs[index];
}

int text_width(std::string_view text) { return static_cast<int>(text.size()) * 4 * kGlyphScale; }

void draw_text(Canvas& canvas, int x0, int y0, std::string_view text)
{
  for (const char c : text) {
    const std::string_view glyph = glyph_of(c);
    for (int y = 0; y < 5 * kGlyphScale; ++y) {
      for (int x = 0; x < 3 * kGlyphScale; ++x) {
        const int row = glyph[static_cast<std::size_t>(y / kGlyphScale)] - '0';
        if ((row >> (2 - x / kGlyphScale) & 1) != 0) canvas.set(x0 + x, y0 + y, kBlack);
      }
    }
    x0 += 4 * kGlyphScale;
  }
}

/// @param t  difference over scale; beyond ±1 it saturates
Color difference_color(double t)
{
  if (std::isnan(t)) return kGreen;
  const Color& end = t > 0 ? kRed : kBlue;
  const double amount = std::min(std::abs(t), 1.0);
  Color color{};
  for (std::size_t c = 0; c < 3; ++c) {
    color[c] = static_cast<std::uint8_t>(std::lround(kWhite[c] + amount * (end[c] - kWhite[c])));
  }
  return color;
}

/// Mean difference of the channels; NaN if it is not finite.
double difference_at(const ImageView& a, const ImageView& b, int x, int y)
{
  double sum = 0;
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    sum += double{a.channels[c].at(x, y)} - double{b.channels[c].at(x, y)};
  }
  return std::isfinite(sum) ? sum / static_cast<double>(a.channels.size()) : std::nan("");
}

/// The smallest of 1, 2, 5 times a power of ten that is not below the value. @return 1 for 0: any scale shows agreement
double round_up(double value)
{
  if (!(value > 0)) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * power >= value) return step * power;
  }
  return 10 * power;
}

double scale_of(const ImageView& a, const ImageView& b)
{
  std::vector<double> sizes;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      const double difference = difference_at(a, b, x, y);
      if (!std::isnan(difference)) sizes.push_back(std::abs(difference));
    }
  }
  if (sizes.empty()) return 1;
  const auto percentile = sizes.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(sizes.size() - 1) * .995);
  std::nth_element(sizes.begin(), percentile, sizes.end());
  // Where nearly all pixels agree, the few that do not set the scale.
  return round_up(*percentile > 0 ? *percentile : *std::max_element(sizes.begin(), sizes.end()));
}

/// What a picture looks like; a layer of one or two channels is shown in grey.
Color display_color(const ImageView& image, int x, int y, float gain)
{
  Color color{};
  for (std::size_t c = 0; c < 3; ++c) {
    const float value = image.channels[image.channels.size() >= 3 ? c : 0].at(x, y);
    color[c] = static_cast<std::uint8_t>(std::lround(255 * srgb_from_linear(value * gain)));
  }
  return color;
}

void draw_scale(Canvas& canvas, int x0, int y0, int width, double scale)
{
  for (int x = 0; x < width; ++x) {
    const double t = width > 1 ? 2.0 * x / (width - 1) - 1 : 0;
    for (int y = 0; y < kBarHeight; ++y) {
      canvas.set(x0 + x, y0 + y, difference_color(t));
    }
  }
  char number[32];
  std::snprintf(number, sizeof number, "%g", scale);
  const int text_y = y0 + kBarHeight + kGap;
  const std::string positive = "+" + std::string(number);
  draw_text(canvas, x0, text_y, "-" + std::string(number));
  draw_text(canvas, x0 + width - text_width(positive), text_y, positive);
}

}  // namespace

double difference_picture_write(const std::filesystem::path& path,
                                const ImageView& a,
                                const ImageView& b,
                                double exposure)
{
  RELIEF_ASSERT(a.width == b.width && a.height == b.height);
  RELIEF_ASSERT(!a.channels.empty() && a.channels.size() == b.channels.size());
  const float gain = static_cast<float>(std::exp2(exposure));
  const double scale = scale_of(a, b);
  const int step = a.width + kGap;
  Canvas canvas(3 * a.width + 2 * kGap, a.height + kStripHeight);
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      canvas.set(x, y, display_color(a, x, y, gain));
      canvas.set(x + step, y, display_color(b, x, y, gain));
      canvas.set(x + 2 * step, y, difference_color(difference_at(a, b, x, y) / scale));
    }
  }
  draw_scale(canvas, 2 * step, a.height + kGap, a.width, scale);
  png_write_bytes(path, canvas.width, canvas.height, canvas.rgb);
  return scale;
}

}  // namespace relief
