// Plots as inline SVG for pages of report_html.h, and as files.
#pragma once

#include <cstddef>
#include <map>
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

/// Colours and marks of a page's series: what has the same name looks the same in all plots. What stands in brackets behind a name
/// does not count.
class PlotStyles {
 public:
  struct Style {
    std::string color;
    int mark = 0;  ///< a circle, a square, a triangle or a diamond
  };
  /// Styles are given out in the order in which names are asked for; no two of the first 64 are alike, and no two of the first 16 in
  /// colour.
  Style of(const std::string& name);

 private:
  std::map<std::string, std::size_t> index_of_;
};

/// Lines with a mark at every point, but for guides.
std::string svg_line_plot(const PlotAxes& axes, const std::vector<PlotSeries>& series, PlotStyles& styles);

/// A group of bars a label, one bar a series; from 0, or from the smallest power of ten below all values if logarithmic.
std::string svg_bar_plot(const PlotAxes& axes,
                         const std::vector<std::string>& labels,
                         const std::vector<PlotSeries>& series,
                         PlotStyles& styles);

/// A plot as a file of its own.
struct PlotFile {
  std::string name;  ///< without a suffix: number and title in letters, digits and hyphens
  std::string svg;
};

/// The plots of a page, in their order, as black on white.
std::vector<PlotFile> plot_files(const std::string& page);

}  // namespace relief
