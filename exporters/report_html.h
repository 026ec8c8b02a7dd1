// One self-contained HTML page with tables, plots and pictures, for people who want to see a measurement rather than
// read its numbers: plots are inline SVG (svg_plot.h), pictures PNG in data URIs, and nothing is loaded from elsewhere.
//
// Every function returns a piece of the page's body; `html_page` puts pieces together. Pages follow the reader's choice of a
// light or a dark scheme.
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

/// The whole document.
std::string html_page(std::string_view title, const std::vector<std::string>& pieces);

std::string base64_encode(std::string_view bytes);

}  // namespace relief
