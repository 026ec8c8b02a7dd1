// The texture store: formats, mip chains, the tile cache, and damaged files. Images are written by OpenImageIO in a
// temporary folder; look-ups are compared with OpenImageIO's own texture system.
#include "scene/texture_store.h"
#include "scene/memory.h"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/texture.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <thread>

#include "kernel/texture/texture.h"
#include "scene/mip_chain.h"
#include "scene/texture_faults.h"
#include "scene/texture_source.h"
#include "tests/support/image_bytes.h"

namespace relief {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPlenty = std::size_t{1} << 30;

/// A folder that goes away with the test.
class TemporaryFolder {
 public:
  TemporaryFolder()
  {
    static std::atomic<int> count = 0;
    path_ = fs::temp_directory_path() / ("relief_texture_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    fs::create_directories(path_);
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// Values of an image as floats in the file's own scale (codes / 255 for integers).
struct TestImage {
  int width = 0, height = 0, num_channels = 0;
  std::vector<float> values;

  float& at(int x, int y, int c) { return values[static_cast<std::size_t>((y * width + x) * num_channels + c)]; }
  float at(int x, int y, int c) const { return values[static_cast<std::size_t>((y * width + x) * num_channels + c)]; }
};

TestImage random_image(int width, int height, int num_channels, unsigned seed)
{
  TestImage image{width, height, num_channels, {}};
  std::mt19937 random(seed);
  for (int i = 0; i < width * height * num_channels; ++i) {
    image.values.push_back(static_cast<float>(random() % 256) / 255.0f);
  }
  return image;
}

void image_write(const fs::path& path,
                 const TestImage& image,
                 const OIIO::TypeDesc& type,
                 const std::vector<std::pair<std::string, std::string>>& attributes = {},
                 int tile_size = 0)
{
  const auto out = OIIO::ImageOutput::create(path.string());
  ASSERT_NE(out, nullptr) << path;
  OIIO::ImageSpec spec(image.width, image.height, image.num_channels, type);
  if (image.num_channels == 2) {
    spec.channelnames = {"Y", "A"};
    spec.alpha_channel = 1;
  }
  // Values are stored as they are, not multiplied by alpha.
  spec.attribute("oiio:UnassociatedAlpha", 1);
  for (const auto& [name, value] : attributes) {
    spec.attribute(name, value);
  }
  spec.tile_width = spec.tile_height = tile_size;
  ASSERT_TRUE(out->open(path.string(), spec)) << out->geterror();
  ASSERT_TRUE(out->write_image(OIIO::TypeDesc::FLOAT, image.values.data())) << out->geterror();
  ASSERT_TRUE(out->close());
}

std::vector<unsigned char> file_bytes(const fs::path& path)
{
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void bytes_write(const fs::path& path, const std::vector<unsigned char>& bytes, std::size_t count)
{
  std::ofstream stream(path, std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(count));
}

TextureRequest request_for(const fs::path& path, TextureColor color = TextureColor::kLinear)
{
  TextureRequest request;
  request.file = path;
  request.label = path.filename().string();
  request.scene_file = "scene.gltf";
  request.json_path = "/images/0";
  request.color = color;
  return request;
}

TextureRequest embedded_request(std::vector<unsigned char> bytes, TextureColor color = TextureColor::kLinear)
{
  TextureRequest request = request_for("", color);
  request.encoded = std::move(bytes);
  return request;
}

/// The store's only texture and what it was warned of.
struct Loaded {
  Warnings warnings;
  std::unique_ptr<TextureStore> store;
  const TextureView& view() const { return store->views()[0]; }
};

Loaded load(TextureRequest request, std::size_t budget_bytes = kPlenty)
{
  Loaded loaded;
  std::vector<TextureRequest> requests;
  requests.push_back(std::move(request));
  loaded.store = std::make_unique<TextureStore>(std::move(requests), budget_bytes, loaded.warnings);
  return loaded;
}

double linear_from_srgb(double encoded)
{
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

Vec4f texel(const TextureView& view, int x, int y)
{
  const Vec2f centre{(static_cast<float>(x) + 0.5f) / static_cast<float>(view.width),
                     (static_cast<float>(y) + 0.5f) / static_cast<float>(view.height)};
  return texture_sample(view, centre, 0.0f);
}

float component(Vec4f v, int i) { return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w; }

struct FormatCase {
  const char* extension;
  OIIO::TypeDesc::BASETYPE type;
  int num_channels;
  TexelFormat expected;
};

class TextureFormats : public testing::TestWithParam<FormatCase> {};

TEST_P(TextureFormats, TexelsAreTheFilesValues)
{
  const FormatCase& format = GetParam();
  const TemporaryFolder folder;
  const fs::path path = folder / (std::string("image.") + format.extension);
  const TestImage image = random_image(19, 11, format.num_channels, 1);
  image_write(path, image, format.type);
  for (const bool embedded : {false, true}) {
    const Loaded loaded = load(embedded ? embedded_request(file_bytes(path)) : request_for(path));
    const TextureView& view = loaded.view();
    ASSERT_EQ(view.width, 19);
    ASSERT_EQ(view.height, 11);
    ASSERT_EQ(view.num_channels, format.num_channels);
    ASSERT_EQ(view.format, format.expected);
    EXPECT_TRUE(loaded.warnings.texts().empty());
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        for (int c = 0; c < image.num_channels; ++c) {
          const int component_index = image.num_channels == 2 && c == 1 ? 3 : c;
          ASSERT_NEAR(component(texel(view, x, y), component_index), image.at(x, y, c), 1.0 / 2048) << x << ' ' << y;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         TextureFormats,
                         testing::Values(FormatCase{"png", OIIO::TypeDesc::UINT8, 1, TexelFormat::kU8},
                                         FormatCase{"png", OIIO::TypeDesc::UINT8, 2, TexelFormat::kU8},
                                         FormatCase{"png", OIIO::TypeDesc::UINT8, 3, TexelFormat::kU8},
                                         FormatCase{"png", OIIO::TypeDesc::UINT8, 4, TexelFormat::kU8},
                                         FormatCase{"png", OIIO::TypeDesc::UINT16, 1, TexelFormat::kHalf},
                                         FormatCase{"png", OIIO::TypeDesc::UINT16, 4, TexelFormat::kHalf},
                                         FormatCase{"tif", OIIO::TypeDesc::UINT8, 3, TexelFormat::kU8},
                                         FormatCase{"tif", OIIO::TypeDesc::UINT16, 1, TexelFormat::kHalf},
                                         FormatCase{"tif", OIIO::TypeDesc::FLOAT, 4, TexelFormat::kHalf},
                                         FormatCase{"exr", OIIO::TypeDesc::HALF, 3, TexelFormat::kHalf},
                                         FormatCase{"exr", OIIO::TypeDesc::FLOAT, 1, TexelFormat::kHalf},
                                         FormatCase{"bmp", OIIO::TypeDesc::UINT8, 3, TexelFormat::kU8},
                                         FormatCase{"tga", OIIO::TypeDesc::UINT8, 3, TexelFormat::kU8}),
                         [](const auto& name) {
                           return std::string(name.param.extension) + "_" + OIIO::TypeDesc(name.param.type).c_str() +
                                  "_" + std::to_string(name.param.num_channels);
                         });

TEST(TextureColors, SrgbIsDecodedForIntegersOnlyAndNeverForAlpha)
{
  const TemporaryFolder folder;
  const TestImage image = random_image(16, 16, 4, 2);
  image_write(folder / "a.png", image, OIIO::TypeDesc::UINT8);
  image_write(folder / "b.png", image, OIIO::TypeDesc::UINT16);
  const Loaded bytes = load(request_for(folder / "a.png", TextureColor::kSrgb));
  const Loaded words = load(request_for(folder / "b.png", TextureColor::kSrgb));
  EXPECT_EQ(bytes.view().format, TexelFormat::kU8Srgb);
  EXPECT_EQ(words.view().format, TexelFormat::kHalf);
  for (int i = 0; i < 16; ++i) {
    EXPECT_NEAR(texel(bytes.view(), i, i).y, linear_from_srgb(static_cast<double>(image.at(i, i, 1))), 1e-6);
    EXPECT_NEAR(texel(words.view(), i, i).y, linear_from_srgb(static_cast<double>(image.at(i, i, 1))), 1.0 / 2048);
    EXPECT_NEAR(texel(bytes.view(), i, i).w, image.at(i, i, 3), 1e-6);
    EXPECT_NEAR(texel(words.view(), i, i).w, image.at(i, i, 3), 1.0 / 2048);
  }
  const TestImage colors = random_image(16, 16, 3, 2);
  image_write(folder / "c.exr", colors, OIIO::TypeDesc::FLOAT);
  EXPECT_NEAR(texel(load(request_for(folder / "c.exr", TextureColor::kSrgb)).view(), 3, 5).x, colors.at(3, 5, 0),
              1.0 / 2048);
}

TEST(TextureChannels, OfManyThoseNamedRgbaAreTaken)
{
  const TemporaryFolder folder;
  const auto out = OIIO::ImageOutput::create("exr");
  OIIO::ImageSpec spec(2, 2, 6, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"Z", "id", "R", "G", "B", "A"};
  ASSERT_TRUE(out->open((folder / "layers.exr").string(), spec));
  std::vector<float> values;
  for (int i = 0; i < 4; ++i) {
    values.insert(values.end(), {7.0f, 8.0f, 0.25f, 0.5f, 0.75f, 1.0f});
  }
  ASSERT_TRUE(out->write_image(OIIO::TypeDesc::FLOAT, values.data()) && out->close());
  const Loaded loaded = load(request_for(folder / "layers.exr"));
  EXPECT_EQ(loaded.view().num_channels, 4);
  const Vec4f value = texel(loaded.view(), 1, 1);
  EXPECT_EQ(value.x, 0.25f);
  EXPECT_EQ(value.y, 0.5f);
  EXPECT_EQ(value.z, 0.75f);
  EXPECT_EQ(value.w, 1.0f);
}

TEST(TextureChannels, TwoWithoutAlphaAreRedAndGreen)
{
  const TemporaryFolder folder;
  const auto out = OIIO::ImageOutput::create("exr");
  OIIO::ImageSpec spec(1, 1, 2, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"R", "G"};
  spec.alpha_channel = -1;
  const float values[2] = {0.25f, 0.5f};
  ASSERT_TRUE(out->open((folder / "rg.exr").string(), spec) && out->write_image(OIIO::TypeDesc::FLOAT, values) &&
              out->close());
  const Vec4f value = texel(load(request_for(folder / "rg.exr")).view(), 0, 0);
  EXPECT_EQ(value.x, 0.25f);
  EXPECT_EQ(value.y, 0.5f);
  EXPECT_EQ(value.z, 0.0f);
  EXPECT_EQ(value.w, 1.0f);
}

TEST(TextureRepairs, NonFiniteValuesAreReplacedCountedAndReported)
{
  const TemporaryFolder folder;
  TestImage image = random_image(8, 8, 1, 3);
  image.at(1, 0, 0) = std::numeric_limits<float>::quiet_NaN();
  image.at(2, 0, 0) = std::numeric_limits<float>::infinity();
  image_write(folder / "bad.exr", image, OIIO::TypeDesc::FLOAT);
  for (const std::size_t budget : {kPlenty, std::size_t{0}}) {
    const Loaded loaded = load(request_for(folder / "bad.exr"), budget);
    EXPECT_EQ(texel(loaded.view(), 1, 0).x, 0.0f);
    EXPECT_EQ(texel(loaded.view(), 2, 0).x, 0.0f);
    const std::vector<std::string> texts = loaded.warnings.texts();
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_NE(texts[0].find("bad.exr: 2 values"), std::string::npos) << texts[0];
  }
}

// A sky with its sun: halves end at 65504.
TEST(TextureWide, ValuesBeyondHalvesAreKept)
{
  const TemporaryFolder folder;
  for (int num_channels = 1; num_channels <= 4; ++num_channels) {
    for (const std::string format : {"exr", "tif", "hdr"}) {
      if (format == "hdr" && num_channels != 3) continue;
      TestImage image = random_image(7, 5, num_channels, 3);
      double sum = 0;
      for (int c = 0; c < num_channels; ++c) image.at(3, 2, c) = 1048576.0f * static_cast<float>(c + 1);
      for (int i = 0; i < 35; ++i) sum += static_cast<double>(image.values[static_cast<std::size_t>(i * num_channels)]);
      image_write(folder / ("sun." + format), image, OIIO::TypeDesc::FLOAT);
      for (const std::size_t budget : {kPlenty, std::size_t{0}}) {
        const Loaded loaded = load(request_for(folder / ("sun." + format)), budget);
        EXPECT_EQ(loaded.store->is_cached(0), budget == 0);
        EXPECT_TRUE(loaded.warnings.texts().empty());
        const Vec4f sun = texel(loaded.view(), 3, 2);
        EXPECT_NEAR(sun.x, 1048576.0f, 16.0f) << format << num_channels;
        if (num_channels >= 3) {
          EXPECT_NEAR(sun.z, 3 * 1048576.0f, 64.0f);
        }
        if (num_channels % 2 == 1) {
          EXPECT_EQ(sun.w, 1.0f);
        }
        // HDR shares its exponents.
        EXPECT_NEAR(texel(loaded.view(), 1, 1).x, image.at(1, 1, 0), format == "hdr" ? 0.01f : 1e-4f);
        const Vec4f mean = texture_sample(loaded.view(), {0.5f, 0.5f}, 100.0f);
        // The tile cache's levels are rounded down, and weigh otherwise.
        if (budget > 0) {
          EXPECT_NEAR(mean.x / (sum / 35), 1, 0.005);
        }
      }
    }
  }
}

TEST(TextureWide, ComputedOnesToo)
{
  Warnings warnings;
  TextureStore store({}, kPlenty, warnings);
  std::vector<float> rgb(4 * 2 * 3, 0.25f);
  rgb[5 * 3 + 1] = 1e9f;
  const int index = store.add_image("sky", 4, 2, rgb, Wrap::kRepeat, Wrap::kClamp);
  const TextureView& view = store.views()[static_cast<std::size_t>(index)];
  EXPECT_EQ(texture_sample(view, {1.5f / 4, 1.5f / 2}, 0).y, 1e9f);
  EXPECT_EQ(texture_sample(view, {1.5f / 4, 1.5f / 2}, 0).x, 0.25f);
}

// What is as large again fits no longer: budgets hold for it, too.
TEST(TextureWide, CountsTwiceInTheBudget)
{
  const TemporaryFolder folder;
  TestImage image = random_image(64, 64, 3, 3);
  image_write(folder / "plain.exr", image, OIIO::TypeDesc::FLOAT);
  image.at(63, 63, 0) = 1e6f;
  image_write(folder / "sun.exr", image, OIIO::TypeDesc::FLOAT);
  const std::size_t halves = mip_chain_bytes({64, 64, 3, TexelFormat::kHalf});
  EXPECT_FALSE(load(request_for(folder / "plain.exr"), halves + 1000).store->is_cached(0));
  const Loaded sun = load(request_for(folder / "sun.exr"), halves + 1000);
  EXPECT_TRUE(sun.store->is_cached(0));
  EXPECT_EQ(texel(sun.view(), 63, 63).x, 1e6f);
}

// As Cycles has it: four channels alone, each code by itself, integers rounded down.
TEST(TextureAlpha, StraightColorsAreMultipliedWhereAskedFor)
{
  const TemporaryFolder folder;
  TestImage image{1, 1, 4, {128 / 255.0f, 64 / 255.0f, 200 / 255.0f, 100 / 255.0f}};
  image_write(folder / "8.png", image, OIIO::TypeDesc::UINT8);
  image_write(folder / "16.png", image, OIIO::TypeDesc::UINT16);
  image_write(folder / "8.tif", image, OIIO::TypeDesc::UINT8);
  image_write(folder / "8.tga", image, OIIO::TypeDesc::UINT8);
  const auto red = [&](const char* name, TextureColor color) {
    return static_cast<double>(texel(load(request_for(folder / name, color)).view(), 0, 0).x);
  };
  for (const char* name : {"8.png", "8.tif", "8.tga"}) {
    EXPECT_NEAR(red(name, TextureColor::kLinear), 128 / 255.0, 1e-6) << name;
    EXPECT_NEAR(red(name, TextureColor::kLinearAssociated), 50 / 255.0, 1e-6) << name;  // floor(50.196)
    EXPECT_NEAR(red(name, TextureColor::kSrgbAssociated), linear_from_srgb(50 / 255.0), 1e-6) << name;
  }
  const double code = std::floor(128 * 257.0 * 100 * 257 / 65535) / 65535;
  EXPECT_NEAR(red("16.png", TextureColor::kLinearAssociated), code, 1e-4);
  EXPECT_NEAR(red("16.png", TextureColor::kSrgbAssociated), linear_from_srgb(code), 1e-4);
  image_write(folder / "f.exr", image, OIIO::TypeDesc::FLOAT);
  EXPECT_NEAR(red("f.exr", TextureColor::kSrgbAssociated), 128 / 255.0, 1e-3) << "multiplied already";
  EXPECT_NEAR(red("f.exr", TextureColor::kEncodedSrgb), linear_from_srgb(128 / 255.0), 1e-3);
  EXPECT_NEAR(red("f.exr", TextureColor::kEncodedSrgbDivided), linear_from_srgb(1.28) * 100 / 255, 2e-3);
}

TEST(TextureFaults, AreToldTogetherOrShownAsMagenta)
{
  const TemporaryFolder folder;
  image_write(folder / "good.png", random_image(4, 4, 3, 1), OIIO::TypeDesc::UINT8);
  image_write(folder / "cut.png", random_image(40, 40, 3, 1), OIIO::TypeDesc::UINT8);
  const std::vector<unsigned char> bytes = file_bytes(folder / "cut.png");
  bytes_write(folder / "cut.png", bytes, bytes.size() / 2);
  TextureFaults faults;
  std::vector<TextureRequest> requests;
  for (const char* name : {"cut.png", "good.png", "gone.png"}) requests.push_back(request_for(folder / name));
  requests.push_back(request_for(""));
  requests.back().is_missing = true;
  for (TextureRequest& request : requests) request.faults = &faults;
  Warnings warnings;
  const TextureStore store(std::move(requests), kPlenty, warnings);
  for (const std::size_t i : {0u, 2u, 3u}) {
    const Vec4f value = texel(store.views()[i], 0, 0);
    EXPECT_TRUE(value.x == 1 && value.y == 0 && value.z == 1 && value.w == 1) << i;
  }
  EXPECT_EQ(store.views()[1].width, 4);
  faults.settle(true, warnings);
  EXPECT_EQ(warnings.texts().size(), 2u) << "of the third someone knew";
  try {
    faults.settle(false, warnings);
    FAIL();
  } catch (const SceneError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("2 that cannot"), std::string::npos) << text;
    EXPECT_NE(text.find("cut.png"), std::string::npos) << text;
    EXPECT_NE(text.find("gone.png"), std::string::npos) << text;
  }
}

TEST(TextureSharing, EqualImagesWithDifferentSamplersShareTexels)
{
  const TemporaryFolder folder;
  image_write(folder / "a.png", random_image(8, 8, 3, 4), OIIO::TypeDesc::UINT8);
  const std::vector<unsigned char> bytes = file_bytes(folder / "a.png");
  std::vector<TextureRequest> requests;
  requests.push_back(request_for(folder / "a.png"));
  requests.push_back(request_for((folder / ".") / "a.png"));
  requests[1].wrap_u = Wrap::kClamp;
  requests.push_back(request_for(folder / "a.png", TextureColor::kSrgb));
  requests.push_back(embedded_request(bytes));
  requests.push_back(embedded_request(bytes));
  Warnings warnings;
  const TextureStore store(std::move(requests), kPlenty, warnings);
  const auto views = store.views();
  ASSERT_EQ(views.size(), 5u);
  EXPECT_EQ(views[0].levels[0], views[1].levels[0]);
  EXPECT_EQ(views[1].wrap_u, Wrap::kClamp);
  EXPECT_EQ(views[0].wrap_u, Wrap::kRepeat);
  EXPECT_NE(views[0].levels[0], views[2].levels[0]);
  EXPECT_EQ(views[3].levels[0], views[4].levels[0]);
  EXPECT_EQ(store.bytes(), 3 * mip_chain_bytes({8, 8, 3, TexelFormat::kU8}));
  EXPECT_EQ(store.label(0), "a.png");
}

TEST(TextureStoreEmpty, HasNoViews)
{
  Warnings warnings;
  const TextureStore store({}, 0, warnings);
  EXPECT_TRUE(store.views().empty());
  EXPECT_EQ(store.bytes(), 0u);
}

// --- mip chains ------------------------------------------------------------------------------------------------------

double mean_of_level(const MipChain& chain, int level, int channel)
{
  const TexelLayout& layout = chain.layout();
  const int texels = mip_size(layout.width, level) * mip_size(layout.height, level);
  double sum = 0;
  for (int i = 0; i < texels; ++i) {
    const int index = i * layout.num_channels + channel;
    if (layout.format == TexelFormat::kHalf) {
      std::uint16_t half;
      std::memcpy(&half, chain.level(level) + 2 * index, 2);
      sum += static_cast<double>(float_from_half(half));
    } else {
      const double code = chain.level(level)[index] / 255.0;
      sum += layout.format == TexelFormat::kU8Srgb && !(channel == 3) ? linear_from_srgb(code) : code;
    }
  }
  return sum / texels;
}

MipChain random_chain(const TexelLayout& layout, unsigned seed)
{
  MipChain chain(layout);
  std::mt19937 random(seed);
  const int count = layout.width * layout.height * layout.num_channels;
  for (int i = 0; i < count; ++i) {
    if (layout.format == TexelFormat::kHalf) {
      const std::uint16_t half = half_from_float(static_cast<float>(random() % 10000) * 0.1f);
      std::memcpy(chain.level(0) + 2 * i, &half, 2);
    } else {
      chain.level(0)[i] = static_cast<unsigned char>(random());
    }
  }
  mip_chain_build(chain);
  return chain;
}

TEST(MipChain, EveryLevelHasTheImagesMeanWhateverItsSize)
{
  for (const auto& [width, height] : {std::pair{64, 64}, {63, 65}, {1, 100}, {37, 1}, {5, 3}, {127, 2}}) {
    for (const TexelFormat format : {TexelFormat::kU8, TexelFormat::kU8Srgb, TexelFormat::kHalf}) {
      const MipChain chain = random_chain({width, height, 4, format}, 5);
      const bool coarsest_is_one_texel =
          mip_size(width, chain.num_levels() - 1) == 1 && mip_size(height, chain.num_levels() - 1) == 1;
      EXPECT_TRUE(coarsest_is_one_texel);
      for (int level = 1; level < chain.num_levels(); ++level) {
        for (int channel = 0; channel < 4; ++channel) {
          const double texels = mip_size(width, level) * mip_size(height, level);
          // Each texel is rounded: by half a code at most (a code of sRGB is up to 0.0089 of linear), uniformly, so the
          // means of n texels wander by 1/√(12 n) codes a level; five deviations, plus one code's worst for n = 1.
          const double code = format == TexelFormat::kU8 ? 1 / 255.0 : format == TexelFormat::kU8Srgb ? 0.0089 : 0.5;
          EXPECT_NEAR(mean_of_level(chain, level, channel), mean_of_level(chain, level - 1, channel),
                      5 * code / std::sqrt(12 * texels) + 1e-9)
              << width << 'x' << height << " level " << level << " format " << static_cast<int>(format);
        }
      }
    }
  }
}

TEST(MipChain, OddSidesWeighTexelsByTheirCoverage)
{
  MipChain chain({3, 1, 1, TexelFormat::kHalf});
  const std::uint16_t texels[3] = {half_from_float(6), half_from_float(12), half_from_float(24)};
  std::memcpy(chain.level(0), texels, sizeof texels);
  mip_chain_build(chain);
  std::uint16_t coarse[2];
  std::memcpy(coarse, chain.level(1), sizeof coarse);
  EXPECT_EQ(float_from_half(coarse[0]), (6 * 2 + 12) / 3.0f);
  EXPECT_EQ(float_from_half(coarse[1]), (12 + 24 * 2) / 3.0f);
}

TEST(MipChain, SrgbIsAveragedInLinearLight)
{
  MipChain chain({2, 1, 1, TexelFormat::kU8Srgb});
  chain.level(0)[0] = 0;
  chain.level(0)[1] = 255;
  mip_chain_build(chain);
  EXPECT_EQ(chain.level(1)[0], 188);  // 255 · (1.055 · 0.5^(1/2.4) − 0.055) = 187.5…
}

TEST(MipChain, ConstantImagesStayConstant)
{
  for (const TexelFormat format : {TexelFormat::kU8, TexelFormat::kU8Srgb}) {
    for (int code = 0; code < 256; ++code) {
      MipChain chain({7, 5, 3, format});
      std::memset(chain.level(0), code, 7 * 5 * 3);
      mip_chain_build(chain);
      for (int level = 1; level < chain.num_levels(); ++level) {
        ASSERT_EQ(chain.level(level)[0], code);
      }
    }
  }
}

// --- agreement with OpenImageIO and of the cache with memory ---------------------------------------------------------

/// OpenImageIO's bilinear look-up at the finest level.
class OiioSampler {
 public:
  // The shared system is never destroyed: OpenImageIO 2.4 deletes private ones through another type (AddressSanitizer).
  OiioSampler() : system_(OIIO::TextureSystem::create(true))
  {
    system_->attribute("automip", 1);
    system_->attribute("autotile", 64);
    system_->attribute("flip_t", 0);
  }

  void sample(const fs::path& path, Vec2f uv, OIIO::TextureOpt::Wrap wrap, float* result)
  {
    OIIO::TextureOpt options;
    options.swrap = options.twrap = wrap;
    options.interpmode = OIIO::TextureOpt::InterpBilinear;
    options.mipmode = OIIO::TextureOpt::MipModeNoMIP;
    ASSERT_TRUE(system_->texture(OIIO::ustring(path.string()), options, uv.x, uv.y, 0, 0, 0, 0, 3, result));
  }

 private:
  OIIO::TextureSystem* system_;
};

TEST(TextureAgreement, BilinearLookUpsEqualThoseOfOpenImageIO)
{
  const TemporaryFolder folder;
  TestImage impulse{4, 4, 3, std::vector<float>(48)};
  impulse.at(1, 2, 0) = impulse.at(0, 0, 1) = impulse.at(3, 3, 2) = 1;
  image_write(folder / "impulse.png", impulse, OIIO::TypeDesc::UINT8);
  image_write(folder / "two.png", random_image(2, 2, 3, 1), OIIO::TypeDesc::UINT8);
  image_write(folder / "random.png", random_image(37, 23, 3, 6), OIIO::TypeDesc::UINT8);
  OiioSampler oiio;
  const std::pair<Wrap, OIIO::TextureOpt::Wrap> wraps[] = {{Wrap::kRepeat, OIIO::TextureOpt::WrapPeriodic},
                                                           {Wrap::kMirror, OIIO::TextureOpt::WrapMirror},
                                                           {Wrap::kClamp, OIIO::TextureOpt::WrapClamp}};
  for (const char* name : {"impulse.png", "two.png", "random.png"}) {
    for (const auto& [wrap, oiio_wrap] : wraps) {
      TextureRequest request = request_for(folder / name);
      request.wrap_u = request.wrap_v = wrap;
      const Loaded loaded = load(request);
      std::mt19937 random(8);
      std::uniform_real_distribution<float> coordinate(-2.0f, 2.0f);
      for (int i = 0; i < 1000; ++i) {
        const Vec2f uv{coordinate(random), coordinate(random)};
        const Vec4f value = texture_sample(loaded.view(), uv, 0.0f);
        float expected[3];
        oiio.sample(folder / name, uv, oiio_wrap, expected);
        for (int c = 0; c < 3; ++c) {
          // OpenImageIO keeps fractions of texels to about 1e-5.
          ASSERT_NEAR(component(value, c), expected[c], 1e-4) << name << " uv " << uv.x << ' ' << uv.y;
        }
      }
    }
  }
}

struct CacheCase {
  const char* name;
  int width, height, num_channels;
  OIIO::TypeDesc::BASETYPE type;
  TextureColor color;
  int tile_size;
};

class TextureCacheAgreement : public testing::TestWithParam<CacheCase> {};

TEST_P(TextureCacheAgreement, LookUpsEqualThoseInMemory)
{
  const CacheCase& c = GetParam();
  const TemporaryFolder folder;
  const fs::path path = folder / c.name;
  image_write(path, random_image(c.width, c.height, c.num_channels, 7), c.type, {}, c.tile_size);
  for (const TexelFilter filter : {TexelFilter::kLinear, TexelFilter::kNearest}) {
    for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
      TextureRequest request = request_for(path, c.color);
      request.wrap_u = wrap;
      request.wrap_v = wrap == Wrap::kMirror ? Wrap::kClamp : wrap;
      request.filter = filter;
      const Loaded resident = load(request), cached = load(request, 0);
      ASSERT_FALSE(resident.store->is_cached(0));
      ASSERT_TRUE(cached.store->is_cached(0));
      ASSERT_EQ(cached.store->bytes(), 0u);
      ASSERT_NE(cached.view().lookup, nullptr);
      std::mt19937 random(9);
      std::uniform_real_distribution<float> coordinate(-2.0f, 3.0f);
      const bool power_of_two = (c.width & (c.width - 1)) == 0 && (c.height & (c.height - 1)) == 0;
      for (int i = 0; i < 2000; ++i) {
        const Vec2f uv{coordinate(random), coordinate(random)};
        // Levels of odd sizes differ in size between the two, so there only the finest is the same.
        const float width = power_of_two ? static_cast<float>(i % 5) * 0.02f : 0.0f;
        const Vec4f expected = texture_sample(resident.view(), uv, width);
        const Vec4f found = texture_sample(cached.view(), uv, width);
        // The cache keeps sRGB as halves (2⁻¹¹). In the levels codes are rounded by half a code at most each time, up
        // to three times on either side; an sRGB code is up to 0.0089 of linear, on the side of memory only.
        const double tolerance = width == 0.0f ? 1.0 / 2000 : c.color == TextureColor::kSrgb ? 1.5 * 0.0089 : 3.0 / 255;
        for (int k = 0; k < 4; ++k) {
          ASSERT_NEAR(component(found, k), component(expected, k), tolerance)
              << "uv " << uv.x << ' ' << uv.y << " width " << width << " component " << k;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All,
    TextureCacheAgreement,
    testing::Values(CacheCase{"a.png", 256, 128, 4, OIIO::TypeDesc::UINT8, TextureColor::kLinear, 0},
                    CacheCase{"b.png", 256, 256, 3, OIIO::TypeDesc::UINT8, TextureColor::kSrgb, 0},
                    CacheCase{"c.png", 97, 203, 2, OIIO::TypeDesc::UINT8, TextureColor::kSrgb, 0},
                    CacheCase{"d.exr", 128, 256, 3, OIIO::TypeDesc::HALF, TextureColor::kLinear, 32},
                    CacheCase{"e.tif", 200, 150, 1, OIIO::TypeDesc::UINT16, TextureColor::kLinear, 48},
                    CacheCase{"f.png", 1, 300, 1, OIIO::TypeDesc::UINT8, TextureColor::kLinear, 0},
                    CacheCase{"g.png", 1, 1, 3, OIIO::TypeDesc::UINT8, TextureColor::kLinear, 0}),
    [](const auto& name) { return std::string(1, name.param.name[0]); });

TEST(TextureCacheLevels, OfOddSizesHaveTheImagesMean)
{
  const TemporaryFolder folder;
  image_write(folder / "odd.png", random_image(301, 157, 3, 7), OIIO::TypeDesc::UINT8);
  const Loaded resident = load(request_for(folder / "odd.png")), cached = load(request_for(folder / "odd.png"), 0);
  const Vec4f expected = texture_sample(resident.view(), {0.5f, 0.5f}, 10.0f);
  const Vec4f found = texture_sample(cached.view(), {0.5f, 0.5f}, 10.0f);
  EXPECT_NEAR(found.x, expected.x, 0.02f);
  EXPECT_NEAR(found.y, expected.y, 0.02f);
  EXPECT_NEAR(found.z, expected.z, 0.02f);
}

TEST(TextureCacheThreads, LookUpsFromManyThreadsAreThoseOfOne)
{
  const TemporaryFolder folder;
  image_write(folder / "a.png", random_image(700, 900, 3, 11), OIIO::TypeDesc::UINT8);
  const Loaded resident = load(request_for(folder / "a.png")), cached = load(request_for(folder / "a.png"), 0);
  std::atomic<int> num_wrong = 0;
  tbb::parallel_for(0, 64, [&](int task) {
    std::mt19937 random(static_cast<unsigned>(task));
    std::uniform_real_distribution<float> coordinate(0.0f, 1.0f);
    for (int i = 0; i < 2000; ++i) {
      const Vec2f uv{coordinate(random), coordinate(random)};
      num_wrong += std::abs(texture_sample(resident.view(), uv, 0).x - texture_sample(cached.view(), uv, 0).x) > 1e-5f;
    }
  });
  EXPECT_EQ(num_wrong, 0);
}

TEST(TextureBudget, LargestTexturesGoToTheCache)
{
  const TemporaryFolder folder;
  image_write(folder / "small.png", random_image(32, 32, 1, 1), OIIO::TypeDesc::UINT8);
  image_write(folder / "large.png", random_image(256, 256, 1, 1), OIIO::TypeDesc::UINT8);
  image_write(folder / "medium.png", random_image(64, 64, 1, 1), OIIO::TypeDesc::UINT8);
  const auto stored = [&](std::size_t budget) {
    Warnings warnings;
    return std::make_unique<TextureStore>(
        std::vector{request_for(folder / "small.png"), request_for(folder / "large.png"),
                    request_for(folder / "medium.png")},
        budget, warnings);
  };
  const auto bytes = [](int size) { return mip_chain_bytes({size, size, 1, TexelFormat::kU8}); };
  const auto everything = stored(bytes(32) + bytes(256) + bytes(64));
  EXPECT_FALSE(everything->is_cached(0) || everything->is_cached(1) || everything->is_cached(2));
  const auto less = stored(bytes(32) + bytes(256) + bytes(64) - 1);
  EXPECT_TRUE(less->is_cached(1));
  EXPECT_FALSE(less->is_cached(0) || less->is_cached(2));
  EXPECT_EQ(less->bytes(), bytes(32) + bytes(64));
}

TEST(TextureCacheEmbedded, IsServedFromTheBytesInMemory)
{
  const TemporaryFolder folder;
  const TestImage image = random_image(130, 70, 3, 12);
  image_write(folder / "a.png", image, OIIO::TypeDesc::UINT8);
  const Loaded cached = load(embedded_request(file_bytes(folder / "a.png")), 0);
  ASSERT_TRUE(cached.store->is_cached(0));
  for (int i = 0; i < 70; ++i) {
    EXPECT_NEAR(texel(cached.view(), i, i).y, image.at(i, i, 1), 1e-5f);
  }
}

// --- damaged input ---------------------------------------------------------------------------------------------------

void expect_scene_error(TextureRequest request, const std::string& found, std::size_t budget = kPlenty)
{
  try {
    const Loaded loaded = load(std::move(request), budget);
    ADD_FAILURE() << "no error; expected one about " << found;
  } catch (const SceneError& error) {
    EXPECT_EQ(error.file, "scene.gltf");
    EXPECT_EQ(error.json_path, "/images/0");
    EXPECT_NE(std::string(error.what()).find(found), std::string::npos) << error.what();
  }
}

/// An ICC profile with tags of its own: OpenImageIO 2.4 remembers each name of a tag that it meets.
std::string icc_profile(unsigned seed)
{
  constexpr std::uint32_t kNumTags = 24, kHeaderBytes = 128, kTagBytes = 12, kDataBytes = 12;
  std::mt19937 random(seed);
  const std::uint32_t data = kHeaderBytes + 4 + kNumTags * kTagBytes, size = data + kDataBytes;
  std::string word(4, ' ');
  const auto any_word = [&] {
    for (char& c : word) c = static_cast<char>('a' + random() % 26);
    return word;
  };
  std::string profile = test::big_endian(size, 4) + "lcms" + test::big_endian(0x04000000, 4) + "mntrRGB XYZ " +
                        std::string(12, '\0') + "acsp" + any_word();
  profile.resize(68, '\0');
  for (const std::uint32_t d50 : {0xf6d6u, 0x10000u, 0xd32du}) profile += test::big_endian(d50, 4);
  profile.resize(kHeaderBytes, '\0');
  profile += test::big_endian(kNumTags, 4);
  for (std::uint32_t tag = 0; tag < kNumTags; ++tag) {
    profile += any_word() + test::big_endian(data, 4) + test::big_endian(kDataBytes, 4);
  }
  return profile + "text" + std::string(4, '\0') + "abc" + std::string(1, '\0');
}

// Without a lock about headers a quarter of the runs of this test ended by SIGSEGV or SIGABRT, in decode_icc_profile.
TEST(TextureThreads, HeadersWithProfilesAreReadBySixteenAtOnce)
{
  TemporaryFolder folder;
  constexpr unsigned kThreads = 16, kOpened = 2000;
  std::vector<TextureSource> sources;
  for (const std::string format : {"jpg", "png", "tif", "webp", "exr", "hdr", "tga", "bmp"}) {
    for (unsigned i = 0; i < kThreads; ++i) {
      const fs::path path = folder / (std::to_string(i) + "." + format);
      const TestImage image = random_image(8, 8, 3, i);
      const std::string profile = icc_profile(i);
      OIIO::ImageSpec spec(image.width, image.height, image.num_channels,
                           format == "exr" || format == "hdr" ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
      spec.attribute("ICCProfile", OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(profile.size())),
                     profile.data());
      spec.attribute("Exif:FNumber", 2.8f);
      spec.attribute("Exif:UserComment", "comment " + std::to_string(i));
      spec.attribute("GPS:Altitude", 100.0f);
      spec.attribute("IPTC:Keywords", "word; another");
      spec.attribute("XMP:Rating", static_cast<int>(i % 5));
      spec.attribute("DateTime", "2026:11:27 00:00:00");
      const auto out = OIIO::ImageOutput::create(path.string());
      ASSERT_NE(out, nullptr) << format;
      ASSERT_TRUE(out->open(path.string(), spec)) << out->geterror();
      ASSERT_TRUE(out->write_image(OIIO::TypeDesc::FLOAT, image.values.data())) << out->geterror();
      ASSERT_TRUE(out->close());
      sources.push_back({{path.string(), {}, "scene.gltf", "/images/0"}, TextureColor::kSrgb});
    }
  }
  std::atomic<unsigned> next = 0, num_read = 0;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (unsigned i = next++; i < kOpened; i = next++) {
        TextureReader reader(sources[i * 37 % sources.size()]);
        const TexelLayout& layout = reader.layout();
        std::vector<unsigned char> texels(8 * texel_row_bytes(layout));
        reader.read_rows(4, 8, texels.data());
        reader.read_rows(0, 4, texels.data());  // most decoders begin anew for this
        ++num_read;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_read, kOpened);
}

TEST(TextureErrors, NameTheFileAndWhatIsWrong)
{
  const TemporaryFolder folder;
  expect_scene_error(request_for(folder / "missing.png"), "no such file");
  expect_scene_error(request_for(folder / "."), "not a file");
  bytes_write(folder / "text.png", {'h', 'e', 'l', 'l', 'o'}, 5);
  expect_scene_error(request_for(folder / "text.png"), "text.png");
  bytes_write(folder / "empty.png", {}, 0);
  expect_scene_error(request_for(folder / "empty.png"), "empty.png");
  bytes_write(folder / "no_extension", {'h', 'e', 'l', 'l', 'o'}, 5);
  expect_scene_error(request_for(folder / "no_extension"), "no_extension");
  expect_scene_error(embedded_request({}), "no data");
  expect_scene_error(embedded_request({1, 2, 3, 4, 5}), "unknown format");
  expect_scene_error(embedded_request({0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb}), "KTX");
}

// OpenImageIO makes a picture of any file whose name ends in .null, and its rarer readers crash on damaged files: with IFF
// it frees memory twice, with DPX it fails an assertion. They are never asked.
TEST(TextureErrors, OtherFormatsAreRefusedByContentWhateverTheirNames)
{
  const TemporaryFolder folder;
  struct Case {
    std::string_view head, found;
  };
  using namespace std::string_view_literals;
  for (const Case& c : {Case{"GIF89a"sv, "a GIF image"}, Case{"SDPX\0\0\x08\0"sv, "a DPX image"},
                        Case{"FOR4\0\0\0\x10"sv, "an IFF image"}, Case{"8BPS"sv, "a Photoshop image"},
                        Case{"version https://git-lfs.github.com/spec/v1\n"sv, "a Git LFS pointer"},
                        Case{"PK\x03\x04"sv, "a ZIP archive"}, Case{"\x01\xda"sv, "an SGI image"},
                        Case{"\0\0\0 ftypavif"sv, "an AVIF image"}, Case{"RIFF"sv, "unknown format"},
                        Case{"nothing at all, in more than eighteen bytes"sv, "unknown format"}}) {
    std::vector<unsigned char> bytes(c.head.begin(), c.head.end());
    bytes.resize(300, 0);
    for (const char* name : {"a.null", "a.iff", "a.dpx", "a.gif", "a.png", "a.tga", "a.fits", "a"}) {
      bytes_write(folder / name, bytes, bytes.size());
      expect_scene_error(request_for(folder / name), std::string(c.found));
      expect_scene_error(request_for(folder / name),
                         "expected a PNG, JPEG, OpenEXR, HDR, TIFF, BMP, TGA or WebP image");
    }
    expect_scene_error(embedded_request(bytes), std::string(c.found));
  }
  bytes_write(folder / "picture.null?RES=640x480", {}, 0);
  expect_scene_error(request_for(folder / "picture.null?RES=640x480"), "no data");
}

TEST(TextureFormatsByContent, NamesDoNotMatter)
{
  const TemporaryFolder folder;
  const TestImage image = random_image(19, 11, 3, 1);
  for (const char* extension : {"png", "jpg", "exr", "hdr", "tif", "bmp", "tga", "webp"}) {
    const std::string name = std::string("image.") + extension;
    image_write(folder / name, image, OIIO::TypeDesc::UINT8);
    const std::vector<unsigned char> bytes = file_bytes(folder / name);
    const Vec4f expected = texel(load(request_for(folder / name)).view(), 3, 5);
    for (const char* other : {"other.null", "other.iff", "other.exr", "other.tga", "other.png", "other"}) {
      bytes_write(folder / other, bytes, bytes.size());
      const Vec4f found = texel(load(request_for(folder / other)).view(), 3, 5);
      EXPECT_EQ(found.x, expected.x) << name << " as " << other;
      EXPECT_EQ(found.z, expected.z) << name << " as " << other;
    }
  }
}

// Nothing in a TGA of the first version tells what it is.
TEST(TextureFormatsByContent, TgaWithoutAFooterGoesByNameAndHeader)
{
  const TemporaryFolder folder;
  image_write(folder / "image.tga", random_image(19, 11, 3, 1), OIIO::TypeDesc::UINT8);
  std::vector<unsigned char> bytes = file_bytes(folder / "image.tga");
  constexpr std::ptrdiff_t kFooterBytes = 26;
  bytes.erase(bytes.end() - kFooterBytes, bytes.end());
  bytes_write(folder / "image.TGA", bytes, bytes.size());
  EXPECT_EQ(load(request_for(folder / "image.TGA")).view().width, 19);
  bytes_write(folder / "image.iff", bytes, bytes.size());
  expect_scene_error(request_for(folder / "image.iff"), "unknown format");
  bytes[16] = 7;  // bits a texel
  bytes_write(folder / "image.TGA", bytes, bytes.size());
  expect_scene_error(request_for(folder / "image.TGA"), "unknown format");
}

TEST(TextureErrors, FirstOfSeveralIsReportedWhateverTheThreads)
{
  const TemporaryFolder folder;
  for (int repetition = 0; repetition < 20; ++repetition) {
    std::vector<TextureRequest> requests;
    for (int i = 0; i < 30; ++i) {
      requests.push_back(request_for(folder / ("missing" + std::to_string(i) + ".png")));
      requests.back().json_path = "/images/" + std::to_string(i);
    }
    Warnings warnings;
    try {
      const TextureStore store(std::move(requests), kPlenty, warnings);
      FAIL();
    } catch (const SceneError& error) {
      ASSERT_EQ(error.json_path, "/images/0");
    }
  }
}

TEST(TextureErrors, AbsurdSizesAreRefusedBeforeMemoryIsAsked)
{
  // PNG headers with a right checksum and no data behind them.
  const auto big_endian = [](std::uint32_t v) {
    return std::vector<unsigned char>{static_cast<unsigned char>(v >> 24), static_cast<unsigned char>(v >> 16),
                                      static_cast<unsigned char>(v >> 8), static_cast<unsigned char>(v)};
  };
  for (const auto& [width, height] :
       {std::pair<std::uint32_t, std::uint32_t>{900000, 900000}, {70000, 1}, {30000, 30000}}) {
    std::vector<unsigned char> chunk = {'I', 'H', 'D', 'R'};
    for (const std::uint32_t v : {width, height}) {
      const auto bytes = big_endian(v);
      chunk.insert(chunk.end(), bytes.begin(), bytes.end());
    }
    chunk.insert(chunk.end(), {8, 2, 0, 0, 0});
    std::uint32_t crc = 0xffffffffu;
    for (const unsigned char byte : chunk) {
      crc ^= byte;
      for (int bit = 0; bit < 8; ++bit) {
        crc = (crc >> 1) ^ ((crc & 1) ? 0xedb88320u : 0u);
      }
    }
    std::vector<unsigned char> png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13};
    std::ranges::copy(chunk, std::back_inserter(png));
    std::ranges::copy(big_endian(~crc), std::back_inserter(png));
    for (const std::size_t budget : {std::size_t{4} << 30, std::size_t{1} << 40}) {
      expect_scene_error(embedded_request(png), "found", budget);
    }
  }
}

struct DamageCase {
  const char* name;
  OIIO::TypeDesc::BASETYPE type;
  const char* compression;
  int tile_size;
  std::size_t trailer_bytes;  ///< at the end, without texels (TGA's extension area, PNG's last chunks)
};

class TextureDamage : public testing::TestWithParam<DamageCase> {
 protected:
  void SetUp() override
  {
    const DamageCase& c = GetParam();
    const fs::path path = folder_ / c.name;
    std::vector<std::pair<std::string, std::string>> attributes;
    if (c.compression[0] != 0) attributes.emplace_back("compression", c.compression);
    image_write(path, random_image(41, 29, 3, 13), c.type, attributes, c.tile_size);
    bytes_ = file_bytes(path);
    ASSERT_GT(bytes_.size(), 100u);
  }

  const TemporaryFolder folder_;
  std::vector<unsigned char> bytes_;
};

TEST_P(TextureDamage, TruncatedFilesAreErrorsAtEveryLength)
{
  const DamageCase& c = GetParam();
  const fs::path path = folder_ / (std::string("cut_") + c.name);
  const std::size_t step = std::max<std::size_t>(1, bytes_.size() / 150);
  const std::size_t last = bytes_.size() - 1 - c.trailer_bytes;
  for (std::size_t length = 0; length <= last; length += step) {
    bytes_write(path, bytes_, length);
    for (const std::size_t budget : {kPlenty, std::size_t{0}}) {
      EXPECT_THROW(load(request_for(path), budget), SceneError) << length << " of " << bytes_.size();
    }
    if (std::string(c.name).find("tga") == std::string::npos) {
      const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(length);
      EXPECT_THROW(load(embedded_request({bytes_.begin(), end})), SceneError) << length << " of " << bytes_.size();
    }
  }
}

TEST_P(TextureDamage, ChangedBytesGiveAnErrorOrFiniteTexels)
{
  std::mt19937 random(14);
  const fs::path path = folder_ / (std::string("changed_") + GetParam().name);
  for (int i = 0; i < 200; ++i) {
    std::vector<unsigned char> bytes = bytes_;
    for (int k = 0; k < 1 + i % 5; ++k) {
      // Half of the changes hit the header.
      const std::size_t range = k % 2 == 0 ? std::min<std::size_t>(bytes.size(), 400) : bytes.size();
      bytes[random() % range] = static_cast<unsigned char>(random());
    }
    bytes_write(path, bytes, bytes.size());
    try {
      const Loaded loaded = load(request_for(path), std::size_t{64} << 20);
      const Vec4f value = texture_sample(loaded.view(), {0.3f, 0.6f}, 0.01f);
      EXPECT_TRUE(is_finite(xyz(value)) && is_finite(value.w)) << "seed 14, change " << i;
    } catch (const SceneError&) {
    } catch (const OutOfMemory&) {  // a header that asks for more than there is
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         TextureDamage,
                         testing::Values(DamageCase{"rgb.png", OIIO::TypeDesc::UINT8, "", 0, 40},
                                         DamageCase{"words.png", OIIO::TypeDesc::UINT16, "", 0, 40},
                                         DamageCase{"photo.jpg", OIIO::TypeDesc::UINT8, "", 0, 0},
                                         DamageCase{"none.tif", OIIO::TypeDesc::UINT8, "none", 0, 0},
                                         DamageCase{"zip.tif", OIIO::TypeDesc::UINT16, "zip", 0, 0},
                                         DamageCase{"lzw_tiled.tif", OIIO::TypeDesc::UINT8, "lzw", 16, 0},
                                         DamageCase{"zip.exr", OIIO::TypeDesc::HALF, "zip", 0, 0},
                                         DamageCase{"piz_tiled.exr", OIIO::TypeDesc::FLOAT, "piz", 16, 0},
                                         DamageCase{"sky.hdr", OIIO::TypeDesc::FLOAT, "", 0, 0},
                                         DamageCase{"a.bmp", OIIO::TypeDesc::UINT8, "", 0, 0},
                                         DamageCase{"a.tga", OIIO::TypeDesc::UINT8, "", 0, 521},
                                         DamageCase{"a.webp", OIIO::TypeDesc::UINT8, "", 0, 0}),
                         [](const auto& name) {
                           std::string text = name.param.name;
                           std::replace(text.begin(), text.end(), '.', '_');
                           return text;
                         });

}  // namespace
}  // namespace relief
