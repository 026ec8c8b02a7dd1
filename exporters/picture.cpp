#include "exporters/picture.h"

#include <algorithm>
#include <cstdio>

#include "scene/cryptomatte.h"

namespace relief {

namespace {

constexpr std::string_view kBeautyLayer = kAovInfo[0].name;

std::string_view layer_of(std::string_view channel)
{
  const std::size_t dot = channel.rfind('.');
  return dot == std::string_view::npos ? kBeautyLayer : channel.substr(0, dot);
}

std::string_view letter_of(std::string_view channel)
{
  const std::size_t dot = channel.rfind('.');
  return dot == std::string_view::npos ? channel : channel.substr(dot + 1);
}

/// R, G and B come first, in this order, whatever the file's (alphabetical) one; alpha goes last.
int rank_of(std::string_view letter)
{
  constexpr std::string_view kOrder[] = {"R", "G", "B"};
  const auto found = std::find(std::begin(kOrder), std::end(kOrder), letter);
  return letter == "A" ? 4 : static_cast<int>(found - std::begin(kOrder));
}

}  // namespace

const Channel* Picture::find(std::string_view name) const
{
  const auto found =
      std::find_if(channels.begin(), channels.end(), [&](const Channel& channel) { return channel.name == name; });
  return found == channels.end() ? nullptr : &*found;
}

std::string attribute_number(double value)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::string channel_name(const AovInfo& info, std::size_t channel, const std::string* light_groups)
{
  if (info.channels.empty()) {
    // By its specification, one layer for every two levels.
    const char digits[] = {static_cast<char>('0' + channel / 40), static_cast<char>('0' + channel / 4 % 10), 0};
    const int index = static_cast<int>(info.aov) - kFirstCryptomatte;
    return std::string(cryptomatte_layer(index)) + digits + "." + "rgba"[channel % 4];
  }
  const std::string letter(1, info.channels[channel % info.channels.size()]);
  if (info.aov == Aov::kLightGroups) return std::string(kLightGroupLayer) + light_groups[channel / 3] + "." + letter;
  return info.aov == Aov::kBeauty ? letter : std::string(info.name) + "." + letter;
}

ImageView film_layer(const FilmView& film, Aov aov)
{
  ImageView view{film.width, film.height, {}};
  const int offset = film.layout.offset[static_cast<std::size_t>(aov)];
  if (offset < 0) return view;
  const AovInfo& info = kAovInfo[static_cast<std::size_t>(aov)];
  const int num_channels = aov_num_channels(info, film.layout);
  for (int c = 0; c < num_channels; ++c) {
    const std::ptrdiff_t pixel_stride = film.layout.num_floats;
    view.channels.push_back({film.pixels + offset + c, pixel_stride, pixel_stride * film.width, ChannelType::kFloat,
                             channel_name(info, static_cast<std::size_t>(c), film.light_groups)});
  }
  return view;
}

ImageView picture_layer(const Picture& picture, std::string_view layer)
{
  if (layer.empty()) layer = kBeautyLayer;
  ImageView view{picture.width, picture.height, {}};
  for (const Channel& channel : picture.channels) {
    if (layer_of(channel.name) != layer) continue;
    view.channels.push_back({channel.values.data(), 1, picture.width, channel.type, channel.name});
  }
  std::stable_sort(view.channels.begin(), view.channels.end(), [](const ChannelView& a, const ChannelView& b) {
    return rank_of(letter_of(a.name)) < rank_of(letter_of(b.name));
  });
  if (view.channels.size() > 1 && letter_of(view.channels.back().name) == "A") view.channels.pop_back();
  return view;
}

std::vector<std::string> picture_layers(const Picture& picture)
{
  std::vector<std::string> layers;
  for (const Channel& channel : picture.channels) {
    const std::string layer(layer_of(channel.name));
    if (std::find(layers.begin(), layers.end(), layer) == layers.end()) layers.push_back(layer);
  }
  return layers;
}

}  // namespace relief
