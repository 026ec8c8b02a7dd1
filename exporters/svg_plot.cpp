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

/// What a page's style (page_style.h) says of plots, for those that stand by themselves.
constexpr const char* kFileStyle =
    "<style>svg{color:#1f2328;font-family:'DejaVu "
    "Sans',sans-serif}text{fill:#1f2328}.grid{stroke:#d1d9e0}.axis{stroke:#1f2328}"
    ".guide{stroke:#59636e;fill:none;stroke-width:1.4;stroke-dasharray:6 4}</style>"
    "<rect width='100%' height='100%' fill='#fff'/>";
constexpr std::string_view kBegin = "<svg width='", kEnd = "</svg>";

/// A title as part of a file's name.
std::string name_of(std::string_view title)
{
  std::string name;
  for (const char c : title) {
    const bool is_upper = c >= 'A' && c <= 'Z';
    if (is_upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) {
      name += is_upper ? static_cast<char>(c - 'A' + 'a') : c;
    } else if (!name.empty() && name.back() != '-') {
      name += '-';
    }
  }
  constexpr std::size_t kMost = 60;
  name.resize(std::min(name.size(), kMost));
  while (!name.empty() && name.back() == '-') name.pop_back();
  return name;
}

/// The first seven can be told apart with any kind of colour vision; marks help with the others.
/// @source Okabe, Ito 2008, "Color Universal Design"; yellow left out: too light for lines on white; the light blue, too: there is a
///         blue already
constexpr std::array kColors = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "currentColor", "#8c8c8c",
                                "#7a4fa3", "#e31a1c", "#6b8e23", "#8c510a", "#35c4c4", "#b8a000", "#ff9da7", "#5c0a3a",
                                "#a6d854"};
constexpr int kNumMarks = 4;

/// Sizes at which words can be read when the page is shown at half its size.
constexpr int kWidth = 820, kHeight = 500, kFont = 18, kTitleFont = 20;
constexpr int kLeft = 96, kRight = 240, kTop = 40, kBottom = 76;
constexpr double kLegendLine = 25;

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

/// The mark of a style around a point.
std::string svg_mark(double x, double y, double radius, const PlotStyles::Style& style)
{
  const auto at = [&](double dx, double dy) {
    return coordinate_text(x + dx * radius) + "," + coordinate_text(y + dy * radius) + " ";
  };
  const std::string fill = "fill='" + style.color + "'";
  switch (style.mark) {
    case 0:
      return "<circle cx='" + coordinate_text(x) + "' cy='" + coordinate_text(y) + "' r='" + coordinate_text(radius) +
             "' " + fill + "/>";
    case 1:
      return "<polygon points='" + at(-.9, -.9) + at(.9, -.9) + at(.9, .9) + at(-.9, .9) + "' " + fill + "/>";
    case 2:
      return "<polygon points='" + at(0, -1.3) + at(1.2, .9) + at(-1.2, .9) + "' " + fill + "/>";
    default:
      return "<polygon points='" + at(0, -1.4) + at(1.4, 0) + at(0, 1.4) + at(-1.4, 0) + "' " + fill + "/>";
  }
}

/// Frame, title, labels, the y axis with its grid, and the legend.
/// @param styles      of the series
/// @param has_marks   the legend shows those of lines, and else squares
std::string svg_begin(const PlotAxes& axes,
                      const Scale& y,
                      const std::vector<PlotSeries>& series,
                      const std::vector<PlotStyles::Style>& styles,
                      bool has_marks)
{
  const std::string size = std::to_string(kWidth) + " " + std::to_string(kHeight);
  std::string svg = "<svg width='" + std::to_string(kWidth) + "' viewBox='0 0 " + size + "' class='plot' font-size='" +
                    std::to_string(kFont) + "'>";
  svg += svg_text(kLeft, kTitleFont + 6, axes.title,
                  "font-weight='bold' font-size='" + std::to_string(kTitleFont) + "'");
  svg += svg_text((kLeft + kWidth - kRight) / 2.0, kHeight - 12, axes.x_label, "text-anchor='middle'");
  const double middle = (kTop + kHeight - kBottom) / 2.0;
  const std::string y_label_x = std::to_string(kFont + 2);
  svg += svg_text(kFont + 2, middle, axes.y_label,
                  "text-anchor='middle' transform='rotate(-90 " + y_label_x + " " + coordinate_text(middle) + ")'");
  for (const double tick : ticks_of(y)) {
    svg += svg_line(kLeft, y.at(tick), kWidth - kRight, y.at(tick), "class='grid'");
    svg += svg_text(kLeft - 7, y.at(tick) + 6, number_text(tick), "text-anchor='end'");
  }
  svg += svg_line(kLeft, kTop, kLeft, kHeight - kBottom, "class='axis'");
  svg += svg_line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "class='axis'");
  for (std::size_t s = 0; s < series.size(); ++s) {
    const double line_y = kTop + 14 + kLegendLine * static_cast<double>(s);
    constexpr double kSign = kWidth - kRight + 24, kName = kWidth - kRight + 42;
    if (series[s].is_guide) {
      svg += svg_line(kSign - 12, line_y - 6, kSign + 12, line_y - 6, "class='guide'");
    } else {
      svg += svg_mark(kSign, line_y - 6, has_marks ? 6 : 8,
                      has_marks ? styles[s] : PlotStyles::Style{styles[s].color, 1});
    }
    svg += svg_text(kName, line_y, series[s].name, "");
  }
  return svg;
}

std::vector<double> all_values(const std::vector<PlotSeries>& series, std::vector<double> PlotSeries::*axis)
{
  std::vector<double> values;
  for (const PlotSeries& s : series) values.insert(values.end(), (s.*axis).begin(), (s.*axis).end());
  return values;
}

/// Guides have none of their own.
std::vector<PlotStyles::Style> styles_of(const std::vector<PlotSeries>& series, PlotStyles& styles)
{
  std::vector<PlotStyles::Style> all;
  for (const PlotSeries& s : series) all.push_back(s.is_guide ? PlotStyles::Style{} : styles.of(s.name));
  return all;
}

}  // namespace

PlotStyles::Style PlotStyles::of(const std::string& name)
{
  const std::size_t index = index_of_.try_emplace(name.substr(0, name.find(" (")), index_of_.size()).first->second;
  return {kColors[index % kColors.size()], static_cast<int>((index + index / kColors.size()) % kNumMarks)};
}

std::string svg_line_plot(const PlotAxes& axes, const std::vector<PlotSeries>& series, PlotStyles& page_styles)
{
  const std::vector<PlotStyles::Style> styles = styles_of(series, page_styles);
  const Scale x = scale_of(all_values(series, &PlotSeries::x), axes.log_x, false, kLeft + 8, kWidth - kRight - 8);
  const Scale y = scale_of(all_values(series, &PlotSeries::y), axes.log_y, false, kHeight - kBottom - 6, kTop + 6);
  std::string svg = svg_begin(axes, y, series, styles, true);
  for (const double tick : ticks_of(x)) {
    svg += svg_line(x.at(tick), kHeight - kBottom, x.at(tick), kHeight - kBottom + 6, "class='axis'");
    svg += svg_text(x.at(tick), kHeight - kBottom + kFont + 8, number_text(tick), "text-anchor='middle'");
  }
  for (std::size_t s = 0; s < series.size(); ++s) {
    std::string path, marks;
    bool pen_down = false;
    for (std::size_t k = 0; k < std::min(series[s].x.size(), series[s].y.size()); ++k) {
      if (!x.shows(series[s].x[k]) || !y.shows(series[s].y[k])) {
        pen_down = false;
        continue;
      }
      const double px = x.at(series[s].x[k]), py = y.at(series[s].y[k]);
      path += (pen_down ? "L" : "M") + coordinate_text(px) + " " + coordinate_text(py);
      marks += svg_mark(px, py, 4.5, styles[s]);
      pen_down = true;
    }
    if (series[s].is_guide) {
      svg += "<path d='" + path + "' class='guide'/>";
    } else {
      svg += "<path d='" + path + "' fill='none' stroke='" + styles[s].color + "' stroke-width='2.2'/>" + marks;
    }
  }
  return svg + "</svg>\n";
}

std::string svg_bar_plot(const PlotAxes& axes,
                         const std::vector<std::string>& labels,
                         const std::vector<PlotSeries>& series,
                         PlotStyles& page_styles)
{
  const std::vector<PlotStyles::Style> styles = styles_of(series, page_styles);
  const Scale y = scale_of(all_values(series, &PlotSeries::y), axes.log_y, true, kHeight - kBottom, kTop + 6);
  std::string svg = svg_begin(axes, y, series, styles, false);
  const double group =
      static_cast<double>(kWidth - kRight - kLeft) / static_cast<double>(std::max<std::size_t>(labels.size(), 1));
  const double bar = 0.8 * group / static_cast<double>(std::max<std::size_t>(series.size(), 1));
  for (std::size_t g = 0; g < labels.size(); ++g) {
    const double left = kLeft + group * static_cast<double>(g);
    constexpr int kLabel = kHeight - kBottom + kFont + 2;
    const std::string turned = "text-anchor='end' font-size='16' transform='rotate(-28 " +
                               coordinate_text(left + group / 2) + " " + std::to_string(kLabel) + ")'";
    svg += svg_text(left + group / 2, kLabel, labels[g], labels.size() > 3 ? turned : "text-anchor='middle'");
    for (std::size_t s = 0; s < series.size(); ++s) {
      if (g >= series[s].y.size() || !y.shows(series[s].y[g])) continue;
      const double top = y.at(series[s].y[g]);
      svg += "<rect x='" + coordinate_text(left + 0.1 * group + bar * static_cast<double>(s)) + "' y='" +
             coordinate_text(top) + "' width='" + coordinate_text(std::max(bar - 0.5, 0.5)) + "' height='" +
             coordinate_text(kHeight - kBottom - top) + "' fill='" + styles[s].color + "'/>";
    }
  }
  return svg + "</svg>\n";
}

std::vector<PlotFile> plot_files(const std::string& page)
{
  std::vector<PlotFile> files;
  for (std::size_t begin = page.find(kBegin); begin != std::string::npos; begin = page.find(kBegin, begin + 1)) {
    const std::size_t head = page.find('>', begin), end = page.find(kEnd, begin);
    if (head == std::string::npos || end == std::string::npos) break;
    // svg_begin writes the title first.
    const std::size_t title = page.find('>', head + 1), title_end = page.find('<', title);
    char number[32];
    std::snprintf(number, sizeof number, "%02zu-", files.size() + 1);
    files.push_back({number + name_of(std::string_view(page).substr(title + 1, title_end - title - 1)),
                     "<svg xmlns='http://www.w3.org/2000/svg' " + page.substr(begin + 5, head - begin - 4) +
                         kFileStyle + page.substr(head + 1, end - head - 1) + "</svg>\n"});
  }
  return files;
}

}  // namespace relief
