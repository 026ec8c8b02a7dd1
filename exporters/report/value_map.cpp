#include "exporters/report/value_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "exporters/color_map.h"
#include "exporters/png_encode.h"
#include "exporters/report/figure_text.h"
#include "exporters/report_html.h"

namespace relief {

namespace {

/// A map is shown half as wide as the page; more pixels only make the file larger.
constexpr int kMostPixels = 960;

std::string gradient_text()
{
  std::string text = "linear-gradient(to right";
  constexpr int kStops = 16;
  for (int i = 0; i <= kStops; ++i) {
    const std::array<std::uint8_t, 3> c = color_map(static_cast<double>(i) / kStops);
    text += ",rgb(" + std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]) + ")";
  }
  return text + ")";
}

std::string legend_html(const ValueScale& scale, std::string_view unit)
{
  std::string html = "<div class='scale' style='background:" + gradient_text() + "'></div><div class='ticks'>";
  for (const double tick : scale.ticks()) {
    const double percent = 100 * scale.at(tick);
    // Labels at the ends stay within the map.
    const char* shift = percent < 4 ? "0" : percent > 96 ? "-100%" : "-50%";
    html += "<span style='left:" + figure_text(percent) + "%;transform:translateX(" + shift + ")'>" +
            figure_text(tick, 3) + "</span>";
  }
  return html + "</div>" + (unit.empty() ? "" : "<div class='unit'>" + html_escape(unit) + "</div>");
}

}  // namespace

ValueImage value_image_of(const ImageView& image, std::size_t channel)
{
  ValueImage plane{image.width, image.height, {}};
  plane.values.reserve(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) plane.values.push_back(image.channels[channel].at(x, y));
  }
  return plane;
}

ValueImage value_image_reduced(const ValueImage& image, int most, int* factor)
{
  const int f = std::max(1, (std::max(image.width, image.height) + most - 1) / most);
  *factor = f;
  ValueImage reduced{(image.width + f - 1) / f, (image.height + f - 1) / f, {}};
  reduced.values.reserve(static_cast<std::size_t>(reduced.width) * static_cast<std::size_t>(reduced.height));
  for (int y0 = 0; y0 < image.height; y0 += f) {
    for (int x0 = 0; x0 < image.width; x0 += f) {
      double sum = 0;
      int count = 0;
      for (int y = y0; y < std::min(y0 + f, image.height); ++y) {
        for (int x = x0; x < std::min(x0 + f, image.width); ++x, ++count) {
          sum += image.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                              static_cast<std::size_t>(x)];
        }
      }
      reduced.values.push_back(static_cast<float>(sum / count));
    }
  }
  return reduced;
}

double ValueScale::at(double value) const
{
  if (std::isnan(value)) return value;
  // What has no logarithm is below the scale.
  if (log && !(value > 0)) return 0;
  const double t = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  return std::clamp(t, 0.0, 1.0);
}

std::vector<double> ValueScale::ticks() const
{
  std::vector<double> ticks;
  if (!log) {
    const double rough = (high - low) / 4, power = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = power * (rough / power >= 5 ? 5 : rough / power >= 2 ? 2 : 1);
    for (double i = std::ceil(low / step); i * step <= high; ++i) ticks.push_back(i * step);
    return ticks;
  }
  // Decades, or 1, 2, 5 where there are few of those; at most eight, so that labels have room.
  const double first = std::floor(std::log10(low)), last = std::ceil(std::log10(high));
  const double stride = std::ceil((last - first) / 8);
  const std::vector<double> digits =
      std::log10(high / low) < 2.5 ? std::vector<double>{1, 2, 5} : std::vector<double>{1};
  for (double decade = first; decade <= last; decade += stride) {
    for (const double digit : digits) {
      const double tick = digit * std::pow(10.0, decade);
      if (tick >= low * 0.999 && tick <= high * 1.001) ticks.push_back(tick);
    }
  }
  return ticks;
}

ValueScale value_scale_make(const std::vector<float>& values, bool log)
{
  std::vector<double> sorted;
  for (const float value : values) {
    if (std::isfinite(value) && (!log || value > 0)) sorted.push_back(value);
  }
  if (sorted.empty()) return {log ? 0.1 : 0.0, 1.0, log};
  std::sort(sorted.begin(), sorted.end());
  const auto quantile = [&](double share) {
    return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
  };
  if (!log) return {std::min(0.0, sorted.front()), sorted.back() > 0 ? sorted.back() : 1.0, false};
  ValueScale scale{quantile(0.01), quantile(0.998), true};
  // Six decades are more than an eye can tell apart, and a scale needs some extent.
  scale.low = std::max(scale.low, scale.high * 1e-6);
  if (!(scale.high > 2 * scale.low)) scale = {scale.high / 2, scale.high * 2, true};
  return scale;
}

std::string html_value_map(std::string_view title,
                           std::string_view meaning,
                           const ValueImage& image,
                           bool log,
                           std::string_view unit)
{
  int factor = 1;
  const ValueImage shown = value_image_reduced(image, kMostPixels, &factor);
  const ValueScale scale = value_scale_make(shown.values, log);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * shown.values.size());
  for (const float value : shown.values) {
    const std::array<std::uint8_t, 3> color = color_map(scale.at(value));
    rgb.insert(rgb.end(), color.begin(), color.end());
  }
  double sum = 0, largest = 0;
  std::size_t count = 0;
  for (const float value : image.values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    largest = count == 0 ? value : std::max(largest, static_cast<double>(value));
    ++count;
  }
  const bool has_gaps = count < image.values.size();
  std::string caption = std::string(meaning);
  if (count > 0)
    caption +=
        " Mean " + figure_text(sum / static_cast<double>(count), 4) + ", largest " + figure_text(largest, 4) + ".";
  if (factor > 1) caption += " Means of " + std::to_string(factor) + " × " + std::to_string(factor) + " pixels.";
  if (has_gaps) caption += " Grey: not finite.";
  return "<figure class='map'><h3>" + html_escape(title) + "</h3><img width='" + std::to_string(shown.width) +
         "' height='" + std::to_string(shown.height) + "' alt='" + html_escape(title) +
         "' src='data:image/png;base64," + base64_encode(png_encode(shown.width, shown.height, rgb)) + "'>" +
         legend_html(scale, unit) + "<figcaption>" + html_escape(caption) + "</figcaption></figure>\n";
}

}  // namespace relief
