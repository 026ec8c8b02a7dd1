// Typed, bounded reading of JSON objects. Every wrong type or range is a SceneError that names the place; properties
// that nothing asked for are reported at the end. Used for everything that is not glTF's core (see validation.h).
#pragma once

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "kernel/math/vec.h"
#include "scene/diagnostics.h"

namespace relief {

/// JSON path with one more step; '~' and '/' in names are escaped as in RFC 6901.
std::string json_path_join(const std::string& path, std::string_view name);
std::string json_path_join(const std::string& path, std::size_t index);

/// Short text of a value for messages: the value itself if it is simple, else its kind and size.
std::string json_describe(const nlohmann::json& value);

/// Number as messages show it: six significant digits.
std::string number_text(double x);

class JsonReader {
 public:
  static constexpr double kNoLimit = std::numeric_limits<double>::infinity();

  /// @param value  outlives the reader
  /// @error SceneError unless `value` is an object
  JsonReader(const nlohmann::json& value, std::string file, std::string path);

  const std::string& file() const { return file_; }
  const std::string& path() const { return path_; }
  bool has(std::string_view name) const;

  /// Each returns `fallback` when the property is absent.
  /// @error SceneError for a wrong type, a non-finite number, or a value outside [low, high]
  double number(std::string_view name, double fallback, double low = -kNoLimit, double high = kNoLimit) const;
  float number_f(std::string_view name, float fallback, double low = -kNoLimit, double high = kNoLimit) const;
  /// A number within 0…1; what is beyond counts as the end it is beyond, with a warning.
  float factor(std::string_view name, float fallback, Warnings& warnings) const;
  std::int64_t integer(std::string_view name, std::int64_t fallback, std::int64_t low, std::int64_t high) const;
  bool boolean(std::string_view name, bool fallback) const;
  std::string string(std::string_view name, const std::string& fallback) const;
  Vec3f color(std::string_view name, Vec3f fallback) const;  ///< three numbers ≥ 0

  /// Numbers of an array whose length is within [shortest, longest]; empty when absent.
  std::vector<double> numbers(std::string_view name,
                              std::size_t shortest,
                              std::size_t longest,
                              double low = -kNoLimit,
                              double high = kNoLimit) const;
  /// Position of the text in `labels`; `fallback` when absent.
  int choice(std::string_view name, std::span<const std::string_view> labels, int fallback) const;
  /// Index into an array of `size` things, called `what` in messages; −1 when absent.
  int index(std::string_view name, std::size_t size, std::string_view what) const;

  /// @pre has(name)
  JsonReader object(std::string_view name) const;
  const nlohmann::json& raw(std::string_view name) const;

  /// @throws SceneError for the property `name` (or the object itself, if empty)
  [[noreturn]] void fail(std::string_view name, const std::string& expected) const;
  [[noreturn]] void fail(std::string_view name, const std::string& expected, const std::string& found) const;

  /// One warning for each property that no call above asked for; `extensions` and `extras` are always allowed.
  void warn_unread(Warnings& warnings) const;

 private:
  const nlohmann::json* find(std::string_view name) const;

  const nlohmann::json* value_;
  std::string file_, path_;
  mutable std::vector<std::string> asked_;
};

}  // namespace relief
