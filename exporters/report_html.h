// One self-contained HTML page with tables, plots and pictures, for people who want to see a measurement rather than
// read its numbers: plots are inline SVG, pictures PNG in data URIs, and nothing is loaded from elsewhere.
//
// Every function returns a piece of the page's body; `html_page` puts pieces together.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace relief {

/// Text with the characters that mean something in HTML replaced.
std::string html_escape(std::string_view text);

std::string html_heading(std::string_view text, int level);
std::string html_paragraph(std::string_view text);

/// A table; cells that begin with a digit, sign or × are aligned to the right.
/// @param rows  as long as the header, or shorter: missing cells are empty
std::string html_table(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows);

/// A picture with a caption.
/// @param rgb    rows from the top, 3 bytes a pixel
/// @param scale  screen pixels a picture's pixel
std::string html_picture(int width, int height, std::span<const std::uint8_t> rgb, std::string_view caption, int scale);

/// Pieces side by side, as many as fit.
std::string html_row(const std::vector<std::string>& pieces);

/// One line of a plot, or one colour of bars.
struct PlotSeries {
  std::string name;
  std::vector<double> x;  ///< not used by bars
  std::vector<double> y;  ///< NaN leaves a gap
};

struct PlotAxes {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;  ///< values must be above 0; others are left out
};

/// Lines with a mark at every point.
std::string svg_line_plot(const PlotAxes& axes, const std::vector<PlotSeries>& series);

/// A group of bars a label, one bar a series; from 0, or from the smallest power of ten below all values if logarithmic.
std::string svg_bar_plot(const PlotAxes& axes,
                         const std::vector<std::string>& labels,
                         const std::vector<PlotSeries>& series);

/// The whole document.
std::string html_page(std::string_view title, const std::vector<std::string>& pieces);

std::string base64_encode(std::string_view bytes);

}  // namespace relief
