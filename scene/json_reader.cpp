#include "scene/json_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace relief {

using nlohmann::json;

std::string json_path_join(const std::string& path, std::string_view name)
{
  std::string out = path + '/';
  for (const char c : name) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

std::string json_path_join(const std::string& path, std::size_t index) { return path + '/' + std::to_string(index); }

std::string json_describe(const json& value)
{
  switch (value.type()) {
    case json::value_t::object:
      return "an object";
    case json::value_t::array:
      return "an array of " + std::to_string(value.size());
    case json::value_t::string:
      return '"' + value.get_ref<const std::string&>() + '"';
    case json::value_t::null:
      return "null";
    default:
      return value.dump();
  }
}

std::string number_text(double x)
{
  char text[32];
  std::snprintf(text, sizeof(text), "%g", x);
  return text;
}

namespace {

std::string range_text(const std::string& what, double low, double high)
{
  const bool has_low = low > -JsonReader::kNoLimit, has_high = high < JsonReader::kNoLimit;
  if (has_low && has_high) {
    return what + " within " + number_text(low) + "…" + number_text(high);
  }
  if (has_low) {
    return what + " ≥ " + number_text(low);
  }
  return has_high ? what + " ≤ " + number_text(high) : what;
}

}  // namespace

JsonReader::JsonReader(const json& value, std::string file, std::string path)
    : value_(&value), file_(std::move(file)), path_(std::move(path))
{
  if (!value.is_object()) {
    fail("", "an object");
  }
}

const json* JsonReader::find(std::string_view name) const
{
  asked_.emplace_back(name);
  const auto it = value_->find(name);
  return it == value_->end() ? nullptr : &*it;
}

bool JsonReader::has(std::string_view name) const { return find(name) != nullptr; }

const json& JsonReader::raw(std::string_view name) const
{
  const json* v = find(name);
  if (v == nullptr) {
    fail(name, "a value");
  }
  return *v;
}

void JsonReader::fail(std::string_view name, const std::string& expected) const
{
  if (name.empty()) {
    fail(name, expected, json_describe(*value_));
  }
  const auto it = value_->find(name);
  fail(name, expected, it == value_->end() ? "nothing" : json_describe(*it));
}

void JsonReader::fail(std::string_view name, const std::string& expected, const std::string& found) const
{
  throw SceneError(file_, name.empty() ? path_ : json_path_join(path_, name), expected, found);
}

double JsonReader::number(std::string_view name, double fallback, double low, double high) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return fallback;
  }
  const double x = v->is_number() ? v->get<double>() : std::nan("");
  if (!(std::isfinite(x) && x >= low && x <= high)) {
    fail(name, range_text("a number", low, high));
  }
  return x;
}

float JsonReader::number_f(std::string_view name, float fallback, double low, double high) const
{
  constexpr double kLargest = std::numeric_limits<float>::max();
  return static_cast<float>(
      number(name, static_cast<double>(fallback), std::max(low, -kLargest), std::min(high, kLargest)));
}

float JsonReader::factor(std::string_view name, float fallback, Warnings& warnings) const
{
  const float value = number_f(name, fallback);
  if (value >= 0 && value <= 1) {
    return value;
  }
  const float used = std::clamp(value, 0.0f, 1.0f);
  warnings.add(file_ + ": " + json_path_join(path_, name) + ": expected a number within 0…1, found " +
               number_text(static_cast<double>(value)) + "; " + number_text(static_cast<double>(used)) + " is used");
  return used;
}

std::int64_t JsonReader::integer(std::string_view name,
                                 std::int64_t fallback,
                                 std::int64_t low,
                                 std::int64_t high) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return fallback;
  }
  // Writers that know only floating point write 3.0; doubles are exact up to 2^53.
  const double x = v->is_number() ? v->get<double>() : std::nan("");
  constexpr double kExact = 9007199254740992.0;
  const bool whole = x == std::floor(x) && std::fabs(x) <= kExact;
  if (!whole || static_cast<std::int64_t>(x) < low || static_cast<std::int64_t>(x) > high) {
    fail(name, range_text("an integer", static_cast<double>(low), static_cast<double>(high)));
  }
  return static_cast<std::int64_t>(x);
}

bool JsonReader::boolean(std::string_view name, bool fallback) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return fallback;
  }
  if (!v->is_boolean()) {
    fail(name, "true or false");
  }
  return v->get<bool>();
}

std::string JsonReader::string(std::string_view name, const std::string& fallback) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return fallback;
  }
  if (!v->is_string()) {
    fail(name, "a string");
  }
  return v->get<std::string>();
}

std::vector<double> JsonReader::numbers(std::string_view name,
                                        std::size_t shortest,
                                        std::size_t longest,
                                        double low,
                                        double high) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return {};
  }
  if (!v->is_array() || v->size() < shortest || v->size() > longest) {
    const std::string lengths =
        shortest == longest ? std::to_string(shortest) : std::to_string(shortest) + " to " + std::to_string(longest);
    fail(name, "an array of " + lengths + " numbers");
  }
  std::vector<double> out;
  for (std::size_t i = 0; i < v->size(); ++i) {
    const json& e = (*v)[i];
    const double x = e.is_number() ? e.get<double>() : std::nan("");
    if (!(std::isfinite(x) && x >= low && x <= high)) {
      throw SceneError(file_, json_path_join(json_path_join(path_, name), i), range_text("a number", low, high),
                       json_describe(e));
    }
    out.push_back(x);
  }
  return out;
}

Vec3f JsonReader::color(std::string_view name, Vec3f fallback) const
{
  const std::vector<double> v = numbers(name, 3, 3, 0, std::numeric_limits<float>::max());
  return v.empty() ? fallback : Vec3f{static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

int JsonReader::choice(std::string_view name, std::span<const std::string_view> labels, int fallback) const
{
  const json* v = find(name);
  if (v == nullptr) {
    return fallback;
  }
  if (v->is_string()) {
    const auto at = std::find(labels.begin(), labels.end(), std::string_view(v->get_ref<const std::string&>()));
    if (at != labels.end()) {
      return static_cast<int>(at - labels.begin());
    }
  }
  std::string expected;
  for (const std::string_view label : labels) {
    expected += (expected.empty() ? "\"" : ", \"") + std::string(label) + '"';
  }
  fail(name, "one of " + expected);
}

int JsonReader::index(std::string_view name, std::size_t size, std::string_view what) const
{
  if (find(name) == nullptr) {
    return -1;
  }
  const json& v = raw(name);
  const double x = v.is_number() ? v.get<double>() : -1;
  if (!(x >= 0 && x < static_cast<double>(size) && x == std::floor(x))) {
    fail(name, "the index of one of " + std::to_string(size) + " " + std::string(what));
  }
  return static_cast<int>(x);
}

JsonReader JsonReader::object(std::string_view name) const
{
  return JsonReader(raw(name), file_, json_path_join(path_, name));
}

void JsonReader::warn_unread(Warnings& warnings) const
{
  for (const auto& item : value_->items()) {
    const std::string& key = item.key();
    if (key != "extensions" && key != "extras" && std::find(asked_.begin(), asked_.end(), key) == asked_.end()) {
      warnings.add(file_ + ": " + json_path_join(path_, key) + ": unknown property, ignored");
    }
  }
}

}  // namespace relief
