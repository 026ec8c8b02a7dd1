// PNG files in memory, read back by OpenImageIO.
#include "exporters/png_encode.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "exporters/errors.h"

namespace relief {
namespace {

template <typename Code>
class PngEncode : public testing::Test {
};
using CodeTypes = testing::Types<std::uint8_t, std::uint16_t>;
TYPED_TEST_SUITE(PngEncode, CodeTypes);

TYPED_TEST(PngEncode, CodesComeBackAsTheyWere)
{
  constexpr int kWidth = 37, kHeight = 23;
  constexpr auto kType = sizeof(TypeParam) == 1 ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::UINT16;
  std::mt19937 random(5);
  for (const int num_channels : {1, 2, 3, 4}) {
    std::vector<TypeParam> codes(static_cast<std::size_t>(kWidth * kHeight * num_channels));
    for (TypeParam& code : codes) code = static_cast<TypeParam>(random());
    std::string png = png_encode(kWidth, kHeight, std::span<const TypeParam>(codes));
    OIIO::Filesystem::IOMemReader reader(png.data(), png.size());
    OIIO::ImageSpec wanted;
    wanted.attribute("oiio:UnassociatedAlpha", 1);
    const auto in = OIIO::ImageInput::create("png");
    OIIO::ImageSpec spec;
    ASSERT_TRUE(in->set_ioproxy(&reader) && in->open("a.png", spec, wanted)) << in->geterror();
    EXPECT_EQ(spec.width, kWidth);
    EXPECT_EQ(spec.height, kHeight);
    ASSERT_EQ(spec.nchannels, num_channels);
    EXPECT_EQ(spec.format, kType);
    EXPECT_EQ(spec.alpha_channel, num_channels % 2 == 0 ? num_channels - 1 : -1);
    EXPECT_EQ(spec.get_string_attribute("oiio:ColorSpace"), "sRGB");
    std::vector<TypeParam> back(codes.size());
    ASSERT_TRUE(in->read_image(0, 0, 0, num_channels, kType, back.data()));
    EXPECT_EQ(back, codes) << num_channels;
  }
}

TYPED_TEST(PngEncode, ASizeThatLibpngRefusesIsAnErrorWithItsReason)
{
  constexpr int kWidth = 1000001;
  const std::vector<TypeParam> codes(kWidth);
  try {
    png_encode(kWidth, 1, std::span<const TypeParam>(codes));
    FAIL() << "no error";
  } catch (const OutputError& error) {
    EXPECT_NE(error.cause.find("width"), std::string::npos) << error.cause;
  }
}

}  // namespace
}  // namespace relief
