#include "exporters/png_ocio.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <tuple>

#include "exporters/errors.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

// A configuration of our own: "Standard" is the analytic sRGB curve, "Double" is twice as bright, and the default is neither.
constexpr const char* kConfig = R"(ocio_profile_version: 2
search_path: ""
roles:
  scene_linear: lin
  default: lin
displays:
  Screen:
    - !<View> {name: Double, colorspace: double}
    - !<View> {name: Standard, colorspace: srgb}
colorspaces:
  - !<ColorSpace>
    name: lin
  - !<ColorSpace>
    name: srgb
    from_reference: !<ExponentWithLinearTransform> {gamma: [2.4, 2.4, 2.4, 1], offset: [0.055, 0.055, 0.055, 0], direction: inverse}
  - !<ColorSpace>
    name: double
    from_reference: !<MatrixTransform> {matrix: [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}
)";

constexpr const char* kBlenderConfig = "/usr/share/blender/datafiles/colormanagement/config.ocio";

struct LoadedPng {
  int width = 0, height = 0, num_channels = 0, bits = 0;
  std::vector<std::uint16_t> codes;  ///< as stored
};

LoadedPng png_load(const std::filesystem::path& path)
{
  const OIIO::ImageSpec wanted = [] {
    OIIO::ImageSpec spec;
    spec.attribute("oiio:UnassociatedAlpha", 1);
    return spec;
  }();
  const auto input = OIIO::ImageInput::open(path.string(), &wanted);
  if (!input) throw std::runtime_error(OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  LoadedPng png{spec.width, spec.height, spec.nchannels, static_cast<int>(spec.format.size()) * 8, {}};
  const std::size_t num_codes = static_cast<std::size_t>(spec.width * spec.height * spec.nchannels);
  png.codes.resize(num_codes);
  if (png.bits == 16) {
    input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT16, png.codes.data());
  } else {
    std::vector<std::uint8_t> bytes(num_codes);
    input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, bytes.data());
    png.codes.assign(bytes.begin(), bytes.end());
  }
  return png;
}

double srgb_exact(double linear)
{
  const double limited = std::min(std::max(linear, 0.0), 1.0);
  return limited <= 0.0031308 ? 12.92 * limited : 1.055 * std::pow(limited, 1 / 2.4) - 0.055;
}

/// Every test decides by itself what $OCIO is.
class PngOcio : public FolderTest {
 protected:
  void SetUp() override
  {
    FolderTest::SetUp();
    write_bytes(file("config.ocio"), kConfig);
    use_config(file("config.ocio").string());
  }
  void TearDown() override
  {
    unsetenv("OCIO");
    FolderTest::TearDown();
  }
  static void use_config(const std::string& path) { setenv("OCIO", path.c_str(), 1); }

  /// A grey ramp of 1024 values from 0 to 1.2, denser near black, where sRGB is steep.
  static Picture ramp()
  {
    Picture picture = constant_picture(1024, 1, 0, 0, 0);
    for (Channel& channel : picture.channels) {
      for (int x = 0; x < 1024; ++x) {
        const float t = static_cast<float>(x) / 1023.f;
        channel.values[static_cast<std::size_t>(x)] = 1.2f * t * t;
      }
    }
    return picture;
  }

  /// Largest difference of the written codes from the exact sRGB curve.
  int worst_code(int bits)
  {
    const Picture picture = ramp();
    PngOptions options;
    options.bits = bits;
    png_write(file("a.png"), picture_layer(picture, ""), options);
    const LoadedPng png = png_load(file("a.png"));
    EXPECT_EQ(png.bits, bits);
    int worst = 0;
    const double largest = bits == 8 ? 255 : 65535;
    for (std::size_t i = 0; i < 1024; ++i) {
      const double exact = std::floor(srgb_exact(double{picture.channels[0].values[i]}) * largest + .5);
      worst = std::max(worst, static_cast<int>(std::abs(exact - png.codes[i * 3])));
    }
    return worst;
  }
};

}  // namespace

TEST_F(PngOcio, StandardViewIsTheDefaultAndWithinOneCodeOfExactSrgb) { EXPECT_LE(worst_code(8), 1); }

TEST_F(PngOcio, DisplaysHaveViewsOfTheirOwn)
{
  std::string config = kConfig;
  config.replace(config.find("colorspaces:"), 0, "  Projector:\n    - !<View> {name: Plain, colorspace: lin}\n");
  write_bytes(file("config.ocio"), config);
  const std::array<float, 3> linear = {0.25f, 0.5f, 0.75f};
  std::array<float, 3> shown = linear;
  ColorView("", "Projector").apply(shown);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(shown[c], linear[c], 1e-6f);
  shown = linear;
  ColorView("Double", "Screen").apply(shown);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(shown[c], 2 * linear[c], 1e-6f);
  for (const auto& [view, display, listed] :
       {std::tuple("", "Wall", "'Projector'"), std::tuple("Double", "Projector", "'Plain'")}) {
    try {
      ColorView unused(view, display);
      FAIL() << display;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(listed), std::string::npos) << error.what();
    }
  }
}

TEST_F(PngOcio, SixteenBitsKeepSixteenBits) { EXPECT_LE(worst_code(16), 8); }

TEST_F(PngOcio, BlendersStandardViewIsWithinOneCodeOfExactSrgb)
{
  if (!std::filesystem::exists(kBlenderConfig)) GTEST_SKIP() << "no Blender installed";
  use_config(kBlenderConfig);
  EXPECT_LE(worst_code(8), 1);
}

TEST_F(PngOcio, WithoutAVariableAnInstalledConfigurationOrTheBuiltInCurveGivesTheSame)
{
  unsetenv("OCIO");
  EXPECT_LE(worst_code(8), 1);
}

TEST_F(PngOcio, SaysWhichViewAndWhoseConfigurationItUsed)
{
  const std::string used = png_write(file("a.png"), picture_layer(ramp(), ""));
  EXPECT_EQ(used, "view 'Standard' of display 'Screen' from " + file("config.ocio").string());
}

TEST_F(PngOcio, AViewIsUsedWhenAskedFor)
{
  const Picture picture = constant_picture(2, 2, .25f, .1f, .6f);
  PngOptions options;
  options.view = "Double";
  png_write(file("a.png"), picture_layer(picture, ""), options);
  const LoadedPng png = png_load(file("a.png"));
  EXPECT_EQ(png.codes[0], 128);  // 0.5 · 255 = 127.5
  EXPECT_EQ(png.codes[1], 51);
  EXPECT_EQ(png.codes[2], 255);
}

TEST_F(PngOcio, AnUnknownViewIsAnErrorThatListsTheOthers)
{
  PngOptions options;
  options.view = "Sepia";
  try {
    png_write(file("a.png"), picture_layer(ramp(), ""), options);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(error.cause.find("'Sepia'"), std::string::npos);
    EXPECT_NE(error.cause.find("'Double', 'Standard'"), std::string::npos) << error.cause;
  }
  EXPECT_FALSE(std::filesystem::exists(file("a.png")));
}

TEST_F(PngOcio, ABrokenVariableIsAnError)
{
  for (const std::string content : {"", "not: [a", "ocio_profile_version: 99\n"}) {
    write_bytes(file("broken.ocio"), content);
    use_config(file("broken.ocio").string());
    EXPECT_THROW(ColorView(""), InputError) << content;
  }
  use_config(file("missing.ocio").string());
  EXPECT_THROW(ColorView(""), InputError);
}

TEST_F(PngOcio, ExposureIsInStops)
{
  const Picture dim = constant_picture(1, 1, .1f, .05f, .2f), bright = constant_picture(1, 1, .4f, .2f, .8f);
  PngOptions options;
  png_write(file("bright.png"), picture_layer(bright, ""), options);
  options.exposure = 2;
  png_write(file("dim.png"), picture_layer(dim, ""), options);
  EXPECT_EQ(png_load(file("dim.png")).codes, png_load(file("bright.png")).codes);
}

TEST_F(PngOcio, AlphaIsUnassociatedAndOptional)
{
  TestFilm film(1, 2, 1, aov_bit(Aov::kBeauty));
  film.pixels = {.25f, .1f, .05f, .5f, .3f, .3f, .3f, 0.f};
  film.view.pixels = film.pixels.data();
  PngOptions options;
  png_write(file("black.png"), film.view, options);
  const LoadedPng over_black = png_load(file("black.png"));
  EXPECT_EQ(over_black.num_channels, 3);
  EXPECT_NEAR(over_black.codes[0], srgb_exact(.25) * 255, 1);
  EXPECT_NEAR(over_black.codes[3], srgb_exact(.3) * 255, 1);
  options.alpha = true;
  png_write(file("alpha.png"), film.view, options);
  const LoadedPng with_alpha = png_load(file("alpha.png"));
  EXPECT_EQ(with_alpha.num_channels, 4);
  EXPECT_NEAR(with_alpha.codes[0], srgb_exact(.5) * 255, 1);
  EXPECT_NEAR(with_alpha.codes[1], srgb_exact(.2) * 255, 1);
  EXPECT_EQ(with_alpha.codes[3], 128);
  EXPECT_EQ(with_alpha.codes[7], 0);
}

TEST_F(PngOcio, NanAndInfinityBecomeBlackAndWhite)
{
  Picture picture = constant_picture(3, 1, 0, 0, 0);
  for (Channel& channel : picture.channels) {
    channel.values = {std::nanf(""), std::numeric_limits<float>::infinity(), -1.f};
  }
  png_write(file("a.png"), picture_layer(picture, ""));
  const LoadedPng png = png_load(file("a.png"));
  EXPECT_EQ(png.codes, (std::vector<std::uint16_t>{0, 0, 0, 255, 255, 255, 0, 0, 0}));
}

TEST_F(PngOcio, AFilmWithoutBeautyIsAnError)
{
  const TestFilm film(2, 2, 1, aov_bit(Aov::kDepth));
  EXPECT_THROW(png_write(file("a.png"), film.view), OutputError);
}

TEST_F(PngOcio, BytesAreWrittenAsTheyAre)
{
  const std::vector<std::uint8_t> bytes = {0, 1, 2, 253, 254, 255, 7, 8, 9, 100, 101, 102};
  png_write_bytes(file("a.png"), 2, 2, bytes);
  const LoadedPng png = png_load(file("a.png"));
  EXPECT_EQ(png.codes, std::vector<std::uint16_t>(bytes.begin(), bytes.end()));
  EXPECT_THROW(png_write_bytes(file("nowhere/a.png"), 2, 2, bytes), OutputError);
}

}  // namespace relief
