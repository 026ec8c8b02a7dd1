#include "scene/graph/ies_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <utility>

#include "kernel/graph/ies.h"
#include "scene/diagnostics.h"
#include "scene/json_reader.h"

namespace relief {
namespace {

using Rows = std::vector<std::vector<float>>;

constexpr double kDegreesToRadians = 3.14159265358979323846 / 180;

/// Finer than any goniometer; what is filled in makes four of one.
constexpr std::size_t kMostAngles = 4096, kMostValues = std::size_t{1} << 20;

/// Angles that files round to.
bool is_near(double a, double b) { return std::abs(a - b) < 1e-4; }

/// The numbers of a file, one after the other.
class Numbers {
 public:
  Numbers(std::string_view text, const std::string& file, const std::string& json_path)
      : rest_(text), file_(file), json_path_(json_path)
  {
  }

  [[noreturn]] void fail(const std::string& expected, const std::string& found) const
  {
    throw SceneError(file_, json_path_, "an IES file with " + expected, found);
  }

  /// @param what  the number is, for messages
  double next(const char* what)
  {
    constexpr std::string_view kBetween = " \t\r\n\v\f,";
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kBetween), rest_.size()));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(kBetween));
    rest_.remove_prefix(word.size());
    if (word.empty()) fail(what, "its end");
    const std::string_view digits = word.substr(word.front() == '+' ? 1 : 0);
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size() || !(std::abs(value) < 1e30)) {
      fail(what, '"' + std::string(word.substr(0, 32)) + '"');
    }
    return value;
  }

  std::size_t count(const char* what, std::size_t least, std::size_t most)
  {
    const double value = next(what);
    if (!(value >= static_cast<double>(least) && value <= static_cast<double>(most)) || value != std::floor(value)) {
      fail(std::string(what) + " from " + std::to_string(least) + " to " + std::to_string(most), number_text(value));
    }
    return static_cast<std::size_t>(value);
  }

  std::vector<double> angles(const char* what, std::size_t num)
  {
    std::vector<double> out;
    while (out.size() < num) {
      out.push_back(next(what));
      if (!(std::abs(out.back()) <= 360)) fail(std::string(what) + " within 360°", number_text(out.back()));
      if (out.size() > 1 && !(out.back() > out[out.size() - 2])) {
        fail(std::string(what) + " that ascend",
             number_text(out.back()) + " after " + number_text(out[out.size() - 2]));
      }
    }
    return out;
  }

 private:
  std::string_view rest_;
  const std::string& file_;
  const std::string& json_path_;
};

/// Adds what lies beyond the last angle, which the others are mirrored at.
void mirror_at_end(std::vector<double>& angles, Rows& rows)
{
  const double end = angles.back();
  for (std::size_t i = angles.size() - 1; i-- > 0;) {
    angles.push_back(2 * end - angles[i]);
    rows.push_back(rows[i]);
  }
}

/// Angles from −90° to 90°, or from 0°, which they are then mirrored at; made 0° to 180°.
void mirror_at_start(std::vector<double>& angles, Rows& rows)
{
  if (is_near(angles.front(), 0)) {
    const std::size_t num = angles.size();
    std::vector<double> all;
    Rows all_rows;
    for (std::size_t i = num; i-- > 1;) {
      all.push_back(-angles[i]);
      all_rows.push_back(rows[i]);
    }
    all.insert(all.end(), angles.begin(), angles.end());
    all_rows.insert(all_rows.end(), rows.begin(), rows.end());
    angles = std::move(all);
    rows = std::move(all_rows);
  }
  for (double& angle : angles) angle += 90;
}

Rows transposed(const Rows& rows)
{
  Rows out(rows.front().size(), std::vector<float>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t k = 0; k < rows[i].size(); ++k) out[k][i] = rows[i][k];
  }
  return out;
}

/// Around a vertical axis, of which a plane, a quadrant or a half may stand for all.
void fill_type_c(IesProfile& p)
{
  std::vector<double>& h = p.horizontal;
  if (is_near(h.front(), 90)) {
    for (double& angle : h) angle -= 90;
  }
  if (h.size() == 1) {
    h = {0, 360};
    p.rows.push_back(p.rows.front());
  }
  if (is_near(h.back(), 90)) mirror_at_end(h, p.rows);
  if (is_near(h.back(), 180)) mirror_at_end(h, p.rows);
  if (!is_near(h.front(), 0) || is_near(h.back(), 360)) return;
  // Some files leave out that 360° is 0°.
  const double gap = 360 - h.back();
  if (is_near(gap, h[1] - h[0]) || is_near(gap, h.back() - h[h.size() - 2])) {
    h.push_back(360);
    p.rows.push_back(p.rows.front());
  }
}

/// Horizontal planes seen from the luminaire's front.
void fill_type_a(IesProfile& p)
{
  for (double& angle : p.vertical) angle += 90;
  const std::vector<double> h = std::exchange(p.horizontal, {});
  const Rows rows = std::exchange(p.rows, {});
  for (std::size_t i = h.size(); i-- > 0;) {
    p.horizontal.push_back(180 - h[i]);
    p.rows.push_back(rows[i]);
  }
  if (!is_near(h.front(), 0)) return;
  for (std::size_t i = 1; i < h.size(); ++i) {
    p.horizontal.push_back(180 + h[i]);
    p.rows.push_back(rows[i]);
  }
}

void fill_type_b(IesProfile& p)
{
  p.rows = transposed(p.rows);
  std::swap(p.horizontal, p.vertical);
  mirror_at_start(p.horizontal, p.rows);
  p.rows = transposed(p.rows);
  mirror_at_start(p.vertical, p.rows);
  p.rows = transposed(p.rows);
}

}  // namespace

IesProfile ies_parse(std::string_view text, const std::string& file, const std::string& json_path)
{
  constexpr std::string_view kTilt = "TILT=";
  // Lines end with CR LF, and in files of some makers with either of them.
  std::size_t tilt = text.find(kTilt);
  while (tilt != std::string_view::npos && tilt > 0 && text[tilt - 1] != '\n' && text[tilt - 1] != '\r') {
    tilt = text.find(kTilt, tilt + 1);
  }
  const Numbers whole(text, file, json_path);
  if (tilt == std::string_view::npos) whole.fail("a line TILT=…", "none");
  const std::string_view kind = text.substr(tilt + kTilt.size(), 7);
  const std::size_t line_end = std::min(text.find_first_of("\r\n", tilt), text.size());
  Numbers numbers(text.substr(line_end), file, json_path);
  if (kind == "INCLUDE") {
    numbers.next("a lamp's geometry");
    const std::size_t num_tilts = numbers.count("a number of tilts", 0, kMostAngles);
    for (std::size_t i = 0; i < 2 * num_tilts; ++i) numbers.next("tilts and their factors");
  }
  numbers.next("a number of lamps");
  numbers.next("lumens");
  double factor = numbers.next("a candela multiplier");
  const std::size_t num_vertical = numbers.count("a number of vertical angles", 1, kMostAngles);
  const std::size_t num_horizontal = numbers.count("a number of horizontal angles", 1, kMostAngles);
  if (num_vertical * num_horizontal > kMostValues) {
    numbers.fail("at most 1,048,576 values", std::to_string(num_vertical * num_horizontal));
  }
  const std::size_t type = numbers.count("a photometric type", 1, 3);
  for (const char* what : {"a unit", "a width", "a length", "a height"}) numbers.next(what);
  factor *= numbers.next("a ballast factor");
  factor *= numbers.next("a ballast-lamp factor");
  numbers.next("watts");

  IesProfile profile;
  profile.vertical = numbers.angles("vertical angles", num_vertical);
  profile.horizontal = numbers.angles("horizontal angles", num_horizontal);
  for (std::size_t i = 0; i < num_horizontal; ++i) {
    std::vector<float>& row = profile.rows.emplace_back();
    for (std::size_t k = 0; k < num_vertical; ++k) {
      row.push_back(static_cast<float>(numbers.next("candelas") * factor * IesProfile::kWattsPerCandela));
      if (!std::isfinite(row.back())) numbers.fail("finite candelas", number_text(static_cast<double>(row.back())));
    }
  }
  if (type == 1 && num_vertical == 1) {
    // Within a single angle there is nothing, so that the luminaire is dark, in Blender too.
    profile.vertical = {0, 180};
    for (std::vector<float>& row : profile.rows) row = {0.0f, 0.0f};
  }
  if (type == 1) fill_type_c(profile);
  if (type == 2) fill_type_b(profile);
  if (type == 3) fill_type_a(profile);
  if (profile.horizontal.size() < 2 || profile.vertical.size() < 2) {
    numbers.fail("at least two angles on each axis", "one");
  }
  return profile;
}

std::vector<float> ies_table(const IesProfile& p, IesEnds ends)
{
  std::vector<float> table;
  for (const double angle : p.horizontal) table.push_back(static_cast<float>(angle * kDegreesToRadians));
  for (const double angle : p.vertical) table.push_back(static_cast<float>(angle * kDegreesToRadians));
  const std::size_t num_h = p.horizontal.size(), num_v = p.vertical.size();
  const bool is_round = is_near(p.horizontal.front(), 0) && is_near(p.horizontal.back(), 360);
  const bool from_below = is_near(p.vertical.front(), 0);
  const auto add_row = [&](const std::vector<float>* row) {
    if (row == nullptr) {
      table.insert(table.end(), num_v + 2, 0.0f);
      return;
    }
    // Straight down all versions take the luminaire for symmetrical.
    table.push_back(from_below ? (*row)[1] : ends == IesEnds::k52 ? row->front() : 0.0f);
    table.insert(table.end(), row->begin(), row->end());
    table.push_back(ends == IesEnds::k43 ? 0.0f : row->back());
  };
  const bool goes_around = ends == IesEnds::k34 && is_round;
  add_row(ends == IesEnds::k52 ? &p.rows.front() : goes_around ? &p.rows[num_h - 2] : nullptr);
  for (const std::vector<float>& row : p.rows) add_row(&row);
  add_row(ends == IesEnds::k52 ? &p.rows[num_h - 2] : goes_around ? &p.rows[1] : nullptr);
  return table;
}

}  // namespace relief
