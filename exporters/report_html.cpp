#include "exporters/report_html.h"

#include "exporters/page_style.h"
#include "exporters/png_encode.h"

namespace relief {

namespace {

bool is_number(std::string_view cell)
{
  constexpr std::string_view kTimes = "×";
  if (cell.substr(0, kTimes.size()) == kTimes) return true;
  const char first = cell.empty() ? ' ' : cell.front();
  return (first >= '0' && first <= '9') || first == '-' || first == '+' || first == '.';
}

}  // namespace

std::string html_escape(std::string_view text)
{
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string html_heading(std::string_view text, int level)
{
  const std::string tag = "h" + std::to_string(level);
  return "<" + tag + ">" + html_escape(text) + "</" + tag + ">\n";
}

std::string html_paragraph(std::string_view text) { return "<p>" + html_escape(text) + "</p>\n"; }

std::string html_table(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows)
{
  // Words of headings are whole: a table may be wider than the page.
  std::string html = "<div class='scroll'><table><tr>";
  for (const std::string& cell : header) html += "<th>" + html_escape(cell) + "</th>";
  html += "</tr>\n";
  for (const std::vector<std::string>& row : rows) {
    html += "<tr>";
    for (std::size_t c = 0; c < header.size(); ++c) {
      const std::string cell = c < row.size() ? row[c] : "";
      html += (is_number(cell) ? "<td class='n'>" : "<td>") + html_escape(cell) + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string html_picture(int width, int height, std::span<const std::uint8_t> rgb, std::string_view caption, int scale)
{
  return "<figure><img width='" + std::to_string(width * scale) + "' height='" + std::to_string(height * scale) +
         "' alt='" + html_escape(caption) + "' src='data:image/png;base64," +
         base64_encode(png_encode(width, height, rgb)) + "'><figcaption>" + html_escape(caption) +
         "</figcaption></figure>\n";
}

std::string html_row(const std::vector<std::string>& pieces)
{
  std::string html = "<div class='row'>";
  for (const std::string& piece : pieces) html += piece;
  return html + "</div>\n";
}

std::string html_page(std::string_view title, const std::vector<std::string>& pieces)
{
  std::string html =
      "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
      "content='width=device-width'><title>" +
      html_escape(title) + "</title><style>" + kPageStyle + "</style></head><body>\n<h1>" + html_escape(title) +
      "</h1>\n";
  for (const std::string& piece : pieces) html += piece;
  return html + "</body></html>\n";
}

std::string base64_encode(std::string_view bytes)
{
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
  }
  return text;
}

}  // namespace relief
