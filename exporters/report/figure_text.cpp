#include "exporters/report/figure_text.h"

#include <array>
#include <cmath>
#include <cstdio>

namespace relief {

namespace {

std::string printed(const char* format, int digits, double value)
{
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, digits, value);
  return text.data();
}

}  // namespace

std::string figure_text(double value, int digits)
{
  if (!(std::abs(value) >= 1000 && std::abs(value) < 1e15)) return printed("%.*g", digits, value);
  // Nobody reads 1.2e+07.
  const double unit = std::pow(10.0, std::max(0.0, std::floor(std::log10(std::abs(value))) + 1 - digits));
  std::string text = printed("%.*f", 0, std::round(value / unit) * unit);
  for (auto at = static_cast<std::ptrdiff_t>(text.size()) - 3; at > (value < 0 ? 1 : 0); at -= 3) {
    text.insert(static_cast<std::size_t>(at), ",");
  }
  return text;
}

std::string bytes_text(double bytes)
{
  constexpr std::array kUnits = {"B", "KiB", "MiB", "GiB", "TiB"};
  std::size_t unit = 0;
  while (bytes >= 1000 && unit + 1 < kUnits.size()) {
    bytes /= 1024;
    ++unit;
  }
  return figure_text(bytes, 3) + " " + kUnits[unit];
}

std::string seconds_text(double seconds)
{
  if (seconds < 1) return figure_text(1000 * seconds, 3) + " ms";
  if (seconds < 100) return figure_text(seconds, 3) + " s";
  const double whole = std::round(seconds);
  const double minutes = std::floor(whole / 60);
  if (minutes < 60) return printed("%.*f min ", 0, minutes) + printed("%.*f s", 0, whole - 60 * minutes);
  return printed("%.*f h ", 0, std::floor(minutes / 60)) + printed("%.*f min", 0, std::fmod(minutes, 60));
}

}  // namespace relief
