#include "exporters/image_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/exporters/test_pictures.h"

namespace relief {

TEST(ImageErrors, AgreeWithTheirDefinitions)
{
  const Picture a = random_picture(31, 17, 1, 4.f), b = random_picture(31, 17, 2, 4.f);
  long double square = 0, relative = 0, absolute = 0, sum = 0, largest = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < 31 * 17; ++i) {
      const long double x = a.channels[c].values[i], y = b.channels[c].values[i];
      square += (x - y) * (x - y);
      relative += (x - y) * (x - y) / (y * y + .01L);
      absolute += std::abs(x - y);
      sum += x - y;
      largest = std::max(largest, std::abs(x - y));
    }
  }
  const long double n = 3 * 31 * 17;
  const ImageErrors errors = image_errors(picture_layer(a, ""), picture_layer(b, ""));
  EXPECT_NEAR(errors.rmse, static_cast<double>(std::sqrt(square / n)), 1e-13);
  EXPECT_NEAR(errors.relmse / static_cast<double>(relative / n), 1, 1e-13);
  EXPECT_NEAR(errors.mae, static_cast<double>(absolute / n), 1e-13);
  EXPECT_NEAR(errors.bias, static_cast<double>(sum / n), 1e-13);
  EXPECT_NEAR(errors.psnr, static_cast<double>(-10 * std::log10(square / n)), 1e-12);
  EXPECT_EQ(errors.max_difference, static_cast<double>(largest));
  EXPECT_EQ(errors.num_values, 3u * 31 * 17);
}

TEST(ImageErrors, SayWhereTheLargestDifferenceIs)
{
  Picture a = constant_picture(9, 5, 1, 1, 1);
  a.channels[1].values[3 * 9 + 7] = .25f;
  const ImageErrors errors = image_errors(picture_layer(a, ""), picture_layer(constant_picture(9, 5, 1, 1, 1), ""));
  EXPECT_EQ(errors.max_difference, .75);
  EXPECT_EQ(errors.max_x, 7);
  EXPECT_EQ(errors.max_y, 3);
  EXPECT_EQ(errors.max_channel, "G");
}

TEST(ImageErrors, OfEqualPicturesAreZero)
{
  const Picture a = random_picture(8, 8, 3);
  const ImageErrors errors = image_errors(picture_layer(a, ""), picture_layer(a, ""));
  EXPECT_EQ(errors.rmse, 0);
  EXPECT_EQ(errors.relmse, 0);
  EXPECT_TRUE(std::isinf(errors.psnr));
  EXPECT_GT(errors.psnr, 0);
}

TEST(ImageErrors, LeaveOutAndCountWhatIsNotFinite)
{
  Picture a = constant_picture(4, 1, 1, 1, 1);
  a.channels[0].values[1] = std::nanf("");
  a.channels[2].values[0] = std::numeric_limits<float>::infinity();
  const ImageErrors errors = image_errors(picture_layer(a, ""), picture_layer(constant_picture(4, 1, 1, 1, 1), ""));
  EXPECT_EQ(errors.num_nonfinite, 2u);
  EXPECT_EQ(errors.num_values, 10u);
  EXPECT_EQ(errors.rmse, 0);
}

TEST(ImageErrors, OfAFilmAndAPictureGoTheSameWay)
{
  const TestFilm film(5, 4, 1);
  const ImageView beauty = film_layer(film.view, Aov::kBeauty);
  ASSERT_EQ(beauty.channels.size(), 4u);
  EXPECT_EQ(image_errors(beauty, beauty).num_values, 80u);
}

TEST(MetricsJson, IsValidAndHasNullForInfinity)
{
  ImageErrors errors;
  errors.psnr = std::numeric_limits<double>::infinity();
  errors.rmse = .5;
  ZTestResult z;
  z.p = .25;
  const nlohmann::json json = nlohmann::json::parse(metrics_json("a.exr", "b.exr", errors, .125, z));
  EXPECT_TRUE(json["psnr"].is_null());
  EXPECT_EQ(json["rmse"], .5);
  EXPECT_EQ(json["flip"], .125);
  EXPECT_EQ(json["z_test"]["p"], .25);
  const nlohmann::json bare = nlohmann::json::parse(metrics_json("a.exr", "b.exr", errors, {}, {}));
  EXPECT_FALSE(bare.contains("flip"));
  EXPECT_FALSE(bare.contains("z_test"));
}

}  // namespace relief
