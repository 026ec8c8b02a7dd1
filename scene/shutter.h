// How long a camera's shutter is open, and when.
#pragma once

#include <cstdint>
#include <string_view>

namespace relief {

/// Where the frame's own time lies while the shutter is open.
enum class ShutterPosition : std::uint8_t { kStart, kCenter, kEnd };
inline constexpr std::string_view kShutterPositionLabels[] = {"start", "center", "end"};

inline constexpr int kMostShutterSteps = 64;
inline constexpr double kLongestShutter = 1e6;  ///< frames

struct Shutter {
  float frames = 0;  ///< how long it is open; 0: nothing takes time
  ShutterPosition position = ShutterPosition::kCenter;
  int steps =
      2;  ///< from one to the next of the places that are looked up; in between what moves goes straight and turns evenly

  /// Frame number when a part of the time has passed.
  /// @param part  0: it opens; 1: it closes
  constexpr double frame_at(double frame, double part) const
  {
    const double opened = position == ShutterPosition::kStart ? 0 : position == ShutterPosition::kCenter ? 0.5 : 1;
    return frame + static_cast<double>(frames) * (part - opened);
  }
};

}  // namespace relief
