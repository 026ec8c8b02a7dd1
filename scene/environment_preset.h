// Surroundings that no file describes: a soft studio and a sunny sky, computed as small lat-long maps.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace relief {

/// Where the light around a scene comes from, if not from the scene.
enum class EnvironmentSource : std::uint8_t { kStudio, kSky, kNone, kFile };
/// Of all but kFile.
inline constexpr std::string_view kEnvironmentPresetLabels[] = {"studio", "sky", "none"};

/// Surroundings in place of a scene's own.
struct EnvironmentChoice {
  EnvironmentSource source = EnvironmentSource::kStudio;
  std::string file;    ///< kFile: a lat-long image
  float strength = 1;  ///< factor of its radiance

  bool operator==(const EnvironmentChoice&) const = default;
};

/// A lat-long map as RELIEF_environment has it: its centre looks along −Z.
struct EnvironmentMap {
  int width = 0, height = 0;
  std::vector<float> rgb;  ///< radiance, linear Rec.709, rows from the top
};

/// The map of kStudio or kSky. In either, white paper is about as bright as white in a picture of exposure 0.
/// - studio: grey all around, brighter above, with three soft lamps: a large one in front on the left, a dim one on the right,
///   one behind. "In front" is +Z, where glTF has the front of models.
/// - sky: a clear sky with a hazy sun, 2.4° wide, 50° high in front on the left, over grey ground.
EnvironmentMap environment_preset_make(EnvironmentSource source);

}  // namespace relief
