// Whether a decoder says of an image what another one says.
#pragma once

#include <gtest/gtest.h>

#include "scene/image_io.h"

namespace relief::test {

inline void expect_same_header(const ImageHeader& header, const ImageHeader& expected)
{
  EXPECT_EQ(header.width, expected.width);
  EXPECT_EQ(header.height, expected.height);
  EXPECT_EQ(header.depth, expected.depth);
  EXPECT_EQ(header.num_channels, expected.num_channels);
  EXPECT_EQ(header.tile_width, expected.tile_width);
  EXPECT_EQ(header.tile_height, expected.tile_height);
  EXPECT_EQ(header.sample_type, expected.sample_type);
  EXPECT_EQ(header.sample_bits, expected.sample_bits);
  EXPECT_EQ(header.is_integer, expected.is_integer);
  EXPECT_EQ(header.is_deep, expected.is_deep);
  EXPECT_EQ(header.channel_names, expected.channel_names);
  EXPECT_EQ(header.alpha_channel, expected.alpha_channel);
  EXPECT_EQ(header.format_name, expected.format_name);
}

}  // namespace relief::test
