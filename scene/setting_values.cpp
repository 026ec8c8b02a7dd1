#include "scene/setting_values.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace relief {
namespace {

using nlohmann::json;

/// Sets settings to what a file says of them, or else to their defaults.
class SettingsReader {
 public:
  explicit SettingsReader(const JsonReader& root) : root_(root) {}

  template <class Value>
  void operator()(const SettingInfo& info, Value& value, const Value& fallback)
  {
    value = fallback;
    const auto [object, name] = place_of(info.name);
    if (object == nullptr) return;
    const auto [low, high, labels] = info.range;
    if constexpr (std::is_enum_v<Value>) {
      value = static_cast<Value>(object->choice(name, labels, static_cast<int>(fallback)));
    } else if constexpr (std::is_integral_v<Value>) {
      value = static_cast<Value>(object->integer(name, static_cast<std::int64_t>(fallback),
                                                 static_cast<std::int64_t>(low), static_cast<std::int64_t>(high)));
    } else if constexpr (std::is_same_v<Value, float>) {
      value = object->number_f(name, fallback, low, high);
    } else if constexpr (std::is_same_v<Value, double>) {
      value = object->number(name, fallback, low, high);
    } else {
      value = object->string(name, fallback);
    }
  }

  void operator()(const SettingInfo& info, int& first, int& second, int first_fallback, int second_fallback)
  {
    first = first_fallback;
    second = second_fallback;
    const std::vector<double> v = root_.numbers(info.name, 2, 2, info.range.low, info.range.high);
    if (v.empty()) return;
    if (v[0] != std::floor(v[0]) || v[1] != std::floor(v[1])) root_.fail(info.name, "two integers");
    first = static_cast<int>(v[0]);
    second = static_cast<int>(v[1]);
  }

  void warn_unread(Warnings& warnings) const
  {
    for (const auto& [name, object] : objects_) {
      if (object) object->warn_unread(warnings);
    }
    root_.warn_unread(warnings);
  }

 private:
  /// The object that would have a setting, null if the file has none, and the setting's name there.
  std::pair<const JsonReader*, std::string_view> place_of(std::string_view name)
  {
    const std::size_t dot = name.find('.');
    if (dot == std::string_view::npos) return {&root_, name};
    const std::string_view group = name.substr(0, dot);
    if (objects_.empty() || objects_.back().first != group) {
      objects_.emplace_back(group, root_.has(group) ? std::optional(root_.object(group)) : std::nullopt);
    }
    const std::optional<JsonReader>& object = objects_.back().second;
    return {object ? &*object : nullptr, name.substr(dot + 1)};
  }

  const JsonReader& root_;
  std::vector<std::pair<std::string_view, std::optional<JsonReader>>> objects_;  ///< those of a group stand together
};

/// The setting as a file would say it; null if it may not.
template <class Value>
json json_of(const SettingInfo& info, const Value& value)
{
  if constexpr (std::is_enum_v<Value>) {
    return info.range.labels[static_cast<std::size_t>(value)];
  } else if constexpr (std::is_same_v<Value, std::string>) {
    return value;
  } else {
    const auto number = static_cast<double>(value);
    if (!(number >= info.range.low && number <= info.range.high)) return nullptr;
    char text[32];
    return json::parse(text, std::to_chars(std::begin(text), std::end(text), value).ptr);
  }
}

}  // namespace

RenderSettings render_settings_read(const JsonReader& r, Warnings& warnings)
{
  RenderSettings s;
  SettingsReader reader(r);
  s.visit(reader);
  if (s.frame_end < s.frame_start) {
    r.fail(setting_info("frameRange").name, "a first frame that is not after the last");
  }
  reader.warn_unread(warnings);
  return s;
}

namespace {

/// Collects settings as JSON.
struct ValueCollector {
  std::vector<SettingValue> values;

  template <class Value>
  void operator()(const SettingInfo& info, const Value& value, const Value& fallback)
  {
    values.push_back({&info, json_of(info, value), json_of(info, fallback)});
  }

  void operator()(const SettingInfo& info, int first, int second, int first_fallback, int second_fallback)
  {
    values.push_back({&info, {first, second}, {first_fallback, second_fallback}});
  }
};

}  // namespace

std::vector<SettingValue> setting_values(RenderSettings settings)
{
  ValueCollector collector;
  settings.visit(collector);
  return std::move(collector.values);
}

std::string setting_text(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

}  // namespace relief
