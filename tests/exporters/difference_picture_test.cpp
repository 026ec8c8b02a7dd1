#include "exporters/difference_picture.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

class DifferencePicture : public FolderTest {
 protected:
  /// Writes, and reads the pixels back.
  double write(const Picture& a, const Picture& b)
  {
    const double scale = difference_picture_write(file("d.png"), picture_layer(a, ""), picture_layer(b, ""));
    const auto input = OIIO::ImageInput::open(file("d.png").string());
    width_ = input->spec().width;
    bytes_.resize(static_cast<std::size_t>(width_ * input->spec().height * 3));
    input->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, bytes_.data());
    return scale;
  }

  std::vector<int> pixel(int x, int y) const
  {
    const std::size_t at = static_cast<std::size_t>((y * width_ + x) * 3);
    return {bytes_[at], bytes_[at + 1], bytes_[at + 2]};
  }

  int width_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

TEST_F(DifferencePicture, ShowsBothAndTheSignOfTheirDifference)
{
  Picture a = constant_picture(50, 20, .5f, .5f, .5f);
  const Picture b = constant_picture(50, 20, .5f, .5f, .5f);
  for (Channel& channel : a.channels) {
    for (std::size_t y = 0; y < 20; ++y) {
      channel.values[y * 50] = .5f + .125f;  // a column brighter, one darker by half as much
      channel.values[y * 50 + 1] = .5f - .0625f;
    }
  }
  EXPECT_DOUBLE_EQ(write(a, b), .2);
  ASSERT_EQ(width_, 3 * 50 + 8);
  EXPECT_EQ(pixel(30, 10), (std::vector<int>{188, 188, 188}));  // sRGB of 0.5
  EXPECT_GT(pixel(0, 10)[0], 188);
  EXPECT_EQ(pixel(54, 10), (std::vector<int>{188, 188, 188}));
  const std::vector<int> brighter = pixel(108, 10), darker = pixel(109, 10), same = pixel(110, 10);
  EXPECT_GT(brighter[0], brighter[2] + 50);
  EXPECT_GT(darker[2], darker[0] + 20);
  EXPECT_EQ(same, (std::vector<int>{255, 255, 255}));
}

TEST_F(DifferencePicture, OutliersSaturateInsteadOfHidingTheRest)
{
  Picture a = random_picture(64, 64, 1, .01f);
  const Picture b = constant_picture(64, 64, 0, 0, 0);
  a.channels[0].values[5] = 1e6f;
  EXPECT_LE(write(a, b), .02);
}

TEST_F(DifferencePicture, EqualOrTinyOrNonFinitePicturesAreNoProblem)
{
  const Picture one = constant_picture(1, 1, 1, 2, 3);
  EXPECT_EQ(write(one, one), 1);
  Picture nan = constant_picture(4, 4, 1, 1, 1);
  nan.channels[1].values[0] = std::numeric_limits<float>::quiet_NaN();
  write(nan, constant_picture(4, 4, 1, 1, 1));
  EXPECT_EQ(pixel(16, 0), (std::vector<int>{0, 160, 0}));
}

}  // namespace relief
