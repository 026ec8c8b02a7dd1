// Luminaires' intensities by angles, in the files of IESNA LM-63.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace relief {

/// Intensities over a grid of angles as kernel/graph/ies.h looks them up: horizontal angles go around the axis, vertical ones away
/// from it, from straight down.
struct IesProfile {
  std::vector<double> horizontal, vertical;  ///< degrees, ascending, at least two each
  std::vector<std::vector<float>> rows;      ///< one a horizontal angle
  /// Watts a steradian times 4π, for candelas of daylight's 177.83 lumens a watt: what Blender takes candelas for.
  static constexpr double kWattsPerCandela = 0.0706650768394;
};

/// Reads a file: types A, B and C, with what symmetry leaves out filled in.
/// @param file, json_path  who names it, for messages
/// @error SceneError: no TILT line, too few or too many numbers, angles that do not ascend
/// @source ANSI/IESNA LM-63-02; LM-75-01 for the types. Type B is turned: its polar axis becomes the luminaire's, as in Blender
IesProfile ies_parse(std::string_view text, const std::string& file, const std::string& json_path);

/// What cubic interpolation takes for the values beyond the first and last angles, by versions of Blender. 3.4 goes around the
/// axis, 4.3 takes 0, since rounding hides from it that 360° is 0°, and 5.2 repeats those at hand.
enum class IesEnds { k34, k43, k52 };

/// Floats of the table that a graph's operation reads, see ies_table_size.
std::vector<float> ies_table(const IesProfile& profile, IesEnds ends);

}  // namespace relief
