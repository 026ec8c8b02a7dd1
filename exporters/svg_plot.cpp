#include "exporters/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <span>
#include <string_view>

#include "exporters/report_html.h"

namespace relief {

namespace {

/// Colours that can be told apart with any kind of colour vision.
/// @source Okabe, Ito 2008, "Color Universal Design"; yellow left out: too light for lines on white
constexpr std::array kColors = {"#0072b2", "#d55e00",      "#009e73", "#cc79a7", "#56b4e9",
                                "#e69f00", "currentColor", "#999999", "#7a4fa3", "#6b8e23"};

constexpr int kWidth = 620, kHeight = 360;
constexpr int kLeft = 62, kRight = 170, kTop = 30, kBottom = 48;

std::string number_text(double value)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

/// Digits enough for a screen.
std::string coordinate_text(double value)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

/// One axis of a plot: from values to pixels.
struct Scale {
  double low = 0, high = 1;
  bool log = false;
  double pixel_low = 0, pixel_high = 1;

  bool shows(double value) const { return std::isfinite(value) && (!log || value > 0); }
  double at(double value) const
  {
    const double t = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return pixel_low + t * (pixel_high - pixel_low);
  }
};

/// A scale that holds all values.
/// @param from_zero  bars of a linear scale stand on 0
Scale scale_of(const std::vector<double>& values, bool log, bool from_zero, double pixel_low, double pixel_high)
{
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (!std::isfinite(value) || (log && !(value > 0))) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(low <= high)) low = high = 1;
  if (log) {
    if (from_zero) {
      // The next of 1, 2, 5, 10, … below, so that the least bar has some height and not most of the plot.
      const double power = std::pow(10.0, std::floor(std::log10(0.9 * low))), digit = 0.9 * low / power;
      low = power * (digit >= 5 ? 5 : (digit >= 2 ? 2 : 1));
    }
    if (low == high) high = 2 * low;
    return {low, high, log, pixel_low, pixel_high};
  }
  if (from_zero || (low > 0 && low < 0.5 * high)) low = std::min(0.0, low);
  if (low == high) high = low + 1;
  return {low, high + 0.03 * (high - low), log, pixel_low, pixel_high};
}

/// Round numbers along a scale.
std::vector<double> ticks_of(const Scale& scale)
{
  std::vector<double> ticks;
  if (scale.log) {
    constexpr double kDecades[] = {1}, kUsual[] = {1, 2, 5}, kFine[] = {1, 1.5, 2, 3, 4, 5, 6, 8};
    const double range = scale.high / scale.low;
    const std::span<const double> steps = range > 200 ? std::span<const double>(kDecades)
                                          : range > 5 ? std::span<const double>(kUsual)
                                                      : std::span<const double>(kFine);
    const auto last = static_cast<int>(std::floor(std::log10(scale.high)));
    for (auto decade = static_cast<int>(std::floor(std::log10(scale.low))); decade <= last; ++decade) {
      for (const double step : steps) {
        const double tick = step * std::pow(10.0, decade);
        if (tick >= scale.low * 0.999 && tick <= scale.high * 1.001) ticks.push_back(tick);
      }
    }
    return ticks;
  }
  const double rough = (scale.high - scale.low) / 5, power = std::pow(10.0, std::floor(std::log10(rough)));
  const double step = rough / power > 5 ? 10 * power : (rough / power > 2 ? 5 * power : 2 * power);
  const auto last = static_cast<std::int64_t>(std::floor(scale.high / step));
  for (auto i = static_cast<std::int64_t>(std::ceil(scale.low / step)); i <= last; ++i) {
    ticks.push_back(static_cast<double>(i) * step);
  }
  return ticks;
}

std::string svg_text(double x, double y, std::string_view text, std::string_view attributes)
{
  return "<text x='" + coordinate_text(x) + "' y='" + coordinate_text(y) + "' " + std::string(attributes) + ">" +
         html_escape(text) + "</text>";
}

std::string svg_line(double x0, double y0, double x1, double y1, std::string_view attributes)
{
  return "<line x1='" + coordinate_text(x0) + "' y1='" + coordinate_text(y0) + "' x2='" + coordinate_text(x1) +
         "' y2='" + coordinate_text(y1) + "' " + std::string(attributes) + "/>";
}

std::string color_of(std::size_t series) { return kColors[series % kColors.size()]; }

/// Frame, title, labels, the y axis with its grid, and the legend.
std::string svg_begin(const PlotAxes& axes, const Scale& y, const std::vector<PlotSeries>& series)
{
  std::string svg = "<svg width='" + std::to_string(kWidth) + "' height='" + std::to_string(kHeight) +
                    "' class='plot' font-size='11'>";
  svg += svg_text(kLeft, 18, axes.title, "font-size='13' font-weight='bold'");
  svg += svg_text((kLeft + kWidth - kRight) / 2.0, kHeight - 8, axes.x_label, "text-anchor='middle'");
  const double middle = (kTop + kHeight - kBottom) / 2.0;
  svg += svg_text(14, middle, axes.y_label,
                  "text-anchor='middle' transform='rotate(-90 14 " + coordinate_text(middle) + ")'");
  for (const double tick : ticks_of(y)) {
    svg += svg_line(kLeft, y.at(tick), kWidth - kRight, y.at(tick), "class='grid'");
    svg += svg_text(kLeft - 5, y.at(tick) + 4, number_text(tick), "text-anchor='end'");
  }
  svg += svg_line(kLeft, kTop, kLeft, kHeight - kBottom, "class='axis'");
  svg += svg_line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "class='axis'");
  for (std::size_t s = 0; s < series.size(); ++s) {
    const double line_y = kTop + 8 + 16 * static_cast<double>(s);
    if (series[s].is_guide) {
      svg += svg_line(kWidth - kRight + 10, line_y - 3, kWidth - kRight + 24, line_y - 3, "class='guide'");
      svg += svg_text(kWidth - kRight + 27, line_y + 1, series[s].name, "");
      continue;
    }
    svg += "<rect x='" + std::to_string(kWidth - kRight + 12) + "' y='" + coordinate_text(line_y - 8) +
           "' width='10' height='10' fill='" + color_of(s) + "'/>";
    svg += svg_text(kWidth - kRight + 27, line_y + 1, series[s].name, "");
  }
  return svg;
}

std::vector<double> all_values(const std::vector<PlotSeries>& series, std::vector<double> PlotSeries::*axis)
{
  std::vector<double> values;
  for (const PlotSeries& s : series) values.insert(values.end(), (s.*axis).begin(), (s.*axis).end());
  return values;
}

}  // namespace

std::string svg_line_plot(const PlotAxes& axes, const std::vector<PlotSeries>& series)
{
  const Scale x = scale_of(all_values(series, &PlotSeries::x), axes.log_x, false, kLeft + 8, kWidth - kRight - 8);
  const Scale y = scale_of(all_values(series, &PlotSeries::y), axes.log_y, false, kHeight - kBottom - 6, kTop + 6);
  std::string svg = svg_begin(axes, y, series);
  for (const double tick : ticks_of(x)) {
    svg += svg_line(x.at(tick), kHeight - kBottom, x.at(tick), kHeight - kBottom + 4, "class='axis'");
    svg += svg_text(x.at(tick), kHeight - kBottom + 16, number_text(tick), "text-anchor='middle'");
  }
  for (std::size_t s = 0; s < series.size(); ++s) {
    std::string path, marks;
    bool pen_down = false;
    for (std::size_t k = 0; k < std::min(series[s].x.size(), series[s].y.size()); ++k) {
      if (!x.shows(series[s].x[k]) || !y.shows(series[s].y[k])) {
        pen_down = false;
        continue;
      }
      const std::string px = coordinate_text(x.at(series[s].x[k])), py = coordinate_text(y.at(series[s].y[k]));
      path += (pen_down ? "L" : "M") + px + " " + py;
      marks += "<circle cx='" + px + "' cy='" + py + "' r='3' fill='" + color_of(s) + "'/>";
      pen_down = true;
    }
    if (series[s].is_guide) {
      svg += "<path d='" + path + "' class='guide'/>";
    } else {
      svg += "<path d='" + path + "' fill='none' stroke='" + color_of(s) + "' stroke-width='1.6'/>" + marks;
    }
  }
  return svg + "</svg>\n";
}

std::string svg_bar_plot(const PlotAxes& axes,
                         const std::vector<std::string>& labels,
                         const std::vector<PlotSeries>& series)
{
  const Scale y = scale_of(all_values(series, &PlotSeries::y), axes.log_y, true, kHeight - kBottom, kTop + 6);
  std::string svg = svg_begin(axes, y, series);
  const double group =
      static_cast<double>(kWidth - kRight - kLeft) / static_cast<double>(std::max<std::size_t>(labels.size(), 1));
  const double bar = 0.8 * group / static_cast<double>(std::max<std::size_t>(series.size(), 1));
  for (std::size_t g = 0; g < labels.size(); ++g) {
    const double left = kLeft + group * static_cast<double>(g);
    svg += svg_text(left + group / 2, kHeight - kBottom + 14, labels[g],
                    labels.size() > 5
                        ? "text-anchor='end' font-size='9' transform='rotate(-20 " + coordinate_text(left + group / 2) +
                              " " + std::to_string(kHeight - kBottom + 14) + ")'"
                        : "text-anchor='middle'");
    for (std::size_t s = 0; s < series.size(); ++s) {
      if (g >= series[s].y.size() || !y.shows(series[s].y[g])) continue;
      const double top = y.at(series[s].y[g]);
      svg += "<rect x='" + coordinate_text(left + 0.1 * group + bar * static_cast<double>(s)) + "' y='" +
             coordinate_text(top) + "' width='" + coordinate_text(std::max(bar - 0.5, 0.5)) + "' height='" +
             coordinate_text(kHeight - kBottom - top) + "' fill='" + color_of(s) + "'/>";
    }
  }
  return svg + "</svg>\n";
}

}  // namespace relief
