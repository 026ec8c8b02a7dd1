// Pictures in memory: the owned one that comes from a file, and strided views by which metrics and writers look at it
// and at a film alike.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "kernel/film/film_layout.h"

namespace relief {

/// How a channel's values lie in a file.
enum class ChannelType : std::uint8_t { kUint, kHalf, kFloat };

/// One channel of an image owned elsewhere. Strides are in floats; row 0 is the top.
struct ChannelView {
  const float* first = nullptr;
  std::ptrdiff_t pixel_stride = 1, row_stride = 0;
  ChannelType type = ChannelType::kFloat;  ///< of the file it came from: how far its values were rounded
  std::string name;                        ///< as in a file, e.g. "R" or "albedo.R"

  float at(int x, int y) const { return first[x * pixel_stride + y * row_stride]; }
};

/// Channels of one size that belong together.
struct ImageView {
  int width = 0, height = 0;
  std::vector<ChannelView> channels;
};

/// A channel with its own values, row by row from the top. Integers above 2^24 are rounded to floats.
struct Channel {
  std::string name;
  ChannelType type = ChannelType::kFloat;
  std::vector<float> values;
};

/// Text that goes with a picture; names without a namespace belong to OpenEXR, ours start with "relief:".
using Attributes = std::map<std::string, std::string>;

/// A number as the text of an attribute: nine significant digits, so that a float comes back exactly.
std::string attribute_number(double value);

/// A picture read from a file.
struct Picture {
  std::string file;            ///< where it came from, for messages
  int width = 0, height = 0;   ///< of the stored window
  int crop_x = 0, crop_y = 0;  ///< where that window lies in the full image
  int full_width = 0, full_height = 0;
  bool lossy = false;  ///< its compression changed the values
  std::vector<Channel> channels;
  Attributes attributes;

  /// Channel of that name, or null.
  const Channel* find(std::string_view name) const;
};

/// How the name of the layer of a group of lights begins.
inline constexpr std::string_view kLightGroupLayer = "light_group_";

/// Name of an AOV's channel in a file: the beauty's are "R" … "A", others are layers, "albedo.R".
/// @param light_groups  names, for Aov::kLightGroups
std::string channel_name(const AovInfo& info, std::size_t channel, const std::string* light_groups = nullptr);

/// The channels of one AOV of a film. @return no channels if the film does not keep it
ImageView film_layer(const FilmView& film, Aov aov);

/// The channels of one layer of a picture in the order R G B, then others by name; alpha only if there is nothing else.
/// @param layer  "beauty" (or empty) for the channels without a layer; otherwise the text before the last dot
/// @return no channels if there is no such layer
ImageView picture_layer(const Picture& picture, std::string_view layer);

/// Names of all layers, in the file's order.
std::vector<std::string> picture_layers(const Picture& picture);

}  // namespace relief
