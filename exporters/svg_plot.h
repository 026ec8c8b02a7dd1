// Plots as inline SVG for pages of report_html.h.
#pragma once

#include <string>
#include <vector>

namespace relief {

/// One line of a plot, or one colour of bars.
struct PlotSeries {
  std::string name;
  std::vector<double> x;  ///< not used by bars
  std::vector<double> y;  ///< NaN leaves a gap
  bool is_guide = false;  ///< dashed and without marks: something to compare with
};

struct PlotAxes {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;  ///< values must be above 0; others are left out
};

/// Lines with a mark at every point, but for guides.
std::string svg_line_plot(const PlotAxes& axes, const std::vector<PlotSeries>& series);

/// A group of bars a label, one bar a series; from 0, or from the smallest power of ten below all values if logarithmic.
std::string svg_bar_plot(const PlotAxes& axes,
                         const std::vector<std::string>& labels,
                         const std::vector<PlotSeries>& series);

}  // namespace relief
