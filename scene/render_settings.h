// RELIEF_render: the settings of a scene, made from the list in render_settings.inc, and what is known of each.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "kernel/film/film_layout.h"
#include "kernel/film/mist.h"
#include "scene/limits.h"

namespace relief {

enum class PixelFilter : std::uint8_t { kBox, kBlackmanHarris, kGaussian };
inline constexpr std::string_view kPixelFilterLabels[] = {"box", "blackman-harris", "gaussian"};

/// Width of a pixel filter that nobody gave one, pixels.
constexpr float pixel_filter_width(PixelFilter filter)
{
  constexpr float kWidths[] = {1.0f, 1.5f, 4.5f};
  return kWidths[static_cast<int>(filter)];
}

/// Versions of Blender that judge noise differently: up to 3.4 against the root of the light, since 3.5 bright light against
/// itself.
enum class NoiseMaths : std::uint8_t { k34, k43 };
inline constexpr std::string_view kNoiseMathsLabels[] = {"3.4", "4.3"};

enum class CausticsMode : std::uint8_t { kAuto, kOn, kOff };
inline constexpr std::string_view kCausticsModeLabels[] = {"auto", "on", "off"};

/// Which light reaches diffuse surfaces by way of microfacets: what was reflected last, or refracted.
enum class CausticKinds : std::uint8_t { kBoth, kReflective, kRefractive, kNone };
inline constexpr std::string_view kCausticKindsLabels[] = {"both", "reflective", "refractive", "none"};

inline constexpr std::string_view kMistFalloffLabels[] = {"linear", "quadratic",
                                                          "inverse-quadratic"};  ///< of MistFalloff

/// What a setting may be.
struct SettingRange {
  double low = -std::numeric_limits<double>::infinity();  ///< of numbers, as `high`; both are allowed
  double high = std::numeric_limits<double>::infinity();
  std::span<const std::string_view> labels = {};  ///< of choices, by enumerator
};
constexpr SettingRange setting_within(double low, double high = std::numeric_limits<double>::infinity())
{
  return {low, high};
}
constexpr SettingRange setting_among(std::span<const std::string_view> labels) { return {.labels = labels}; }

enum class SettingType : std::uint8_t { kInteger, kNumber, kText, kChoice, kIntegerPair };
inline constexpr std::string_view kSettingTypeLabels[] = {"integer", "number", "text", "choice", "integer pair"};

/// Type of a setting whose value is a `Value`.
template <class Value>
constexpr SettingType setting_type()
{
  return std::is_enum_v<Value>             ? SettingType::kChoice
         : std::is_integral_v<Value>       ? SettingType::kInteger
         : std::is_floating_point_v<Value> ? SettingType::kNumber
                                           : SettingType::kText;
}

/// One line of the list, without its default: RenderSettings::visit has that.
struct SettingInfo {
  std::string_view name;  ///< in RELIEF_render; "caustics.photons" is `photons` of the object `caustics`
  SettingType type;
  SettingRange range;
  std::string_view description;
};

inline constexpr double kLargestSettingInt = std::numeric_limits<int>::max();

inline constexpr SettingInfo kRenderSettings[] = {
#define RELIEF_SETTING(Type, member, name, fallback, range, description) \
  {name, setting_type<Type>(), range, description},
#define RELIEF_SETTING_PAIR(first, second, name, first_fallback, second_fallback, range, description) \
  {name, SettingType::kIntegerPair, range, description},
#define RELIEF_CAUSTIC_SETTING RELIEF_SETTING
#define RELIEF_MIST_SETTING RELIEF_SETTING
#include "scene/render_settings.inc"
};

/// The setting of that name; a name that is in no line does not compile.
consteval const SettingInfo& setting_info(std::string_view name)
{
  for (const SettingInfo& info : kRenderSettings) {
    if (info.name == name) return info;
  }
  throw "no such setting";
}

/// The photon pass, see integrator/photon_pass.h.
struct CausticSettings {
#define RELIEF_CAUSTIC_SETTING(Type, member, name, fallback, range, description) Type member = fallback;
#include "scene/render_settings.inc"
};

/// RELIEF_render; the command line overrides single fields.
struct RenderSettings {
#define RELIEF_SETTING(Type, member, name, fallback, range, description) Type member = fallback;
#define RELIEF_SETTING_PAIR(first, second, name, first_fallback, second_fallback, range, description) \
  int first = first_fallback, second = second_fallback;
#include "scene/render_settings.inc"
  CausticSettings caustics;
  Mist mist;

  /// Goes through all settings in the order of the list.
  /// @param visitor  called with (SettingInfo, value, default), for a pair with (SettingInfo, both values, both defaults). It
  ///                 may change values: defaults are of what is there when their turn comes
  template <class Visitor>
  void visit(Visitor&& visitor)
  {
#define RELIEF_SETTING(Type, member, name, fallback, range, description) \
  visitor(setting_info(name), member, Type{fallback});
#define RELIEF_SETTING_PAIR(first, second, name, first_fallback, second_fallback, range, description) \
  visitor(setting_info(name), first, second, first_fallback, second_fallback);
#define RELIEF_CAUSTIC_SETTING(Type, member, name, fallback, range, description) \
  visitor(setting_info(name), caustics.member, Type{fallback});
#define RELIEF_MIST_SETTING(Type, member, name, fallback, range, description) \
  visitor(setting_info(name), mist.member, Type{fallback});
#include "scene/render_settings.inc"
  }
};

}  // namespace relief
