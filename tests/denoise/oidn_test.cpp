// What is said to Open Image Denoise, by a library that stands in for it: the test is linked with it under its name.
#include "denoise/oidn.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/denoise/test_picture.h"

namespace relief::test {
namespace {

TEST(Oidn, DenoisesWithWhatItIsGiven)
{
  const TestPicture picture = test_picture(13, 7, {}, [](int x, int y) { return x + 0.1 * y; });
  const DenoiseResult result = denoise_oidn(picture.input());
  const std::vector<float> noisy = picture.noisy();
  ASSERT_EQ(result.color.size(), noisy.size());
  for (std::size_t i = 0; i < noisy.size(); ++i) EXPECT_NEAR(result.color[i], 2 * noisy[i], 1e-5f);
  EXPECT_EQ(result.error.size(), noisy.size());
}

// What doubles the picture doubles its noise, and is off by the picture itself.
TEST(Oidn, ItsErrorIsEstimatedToo)
{
  const TestPicture picture = test_picture(128, 96, {0.1, 0, 0, 1}, [](int, int) { return 1; });
  const DenoiseResult result = denoise_oidn(picture.input());
  EXPECT_NEAR(result.rmse / picture.rmse(result.color), 1, 0.1);
}

TEST(Oidn, GivesUpWhenToldTo)
{
  const std::atomic<bool> stop{true};
  const TestPicture picture = test_picture(16, 16, {}, [](int, int) { return 1; });
  DenoiseInput input = picture.input();
  input.stop = &stop;
  EXPECT_THROW(denoise_oidn(input), DenoiseStopped);
}

TEST(Oidn, ItsOwnErrorsAreTold)
{
  TestPicture picture = test_picture(8, 8, {}, [](int, int) { return 1; });
  picture.features[5] = 2;
  try {
    denoise_oidn(picture.input());
    FAIL() << "expected an error";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "Open Image Denoise: the albedo is too bright");
  }
}

}  // namespace
}  // namespace relief::test
