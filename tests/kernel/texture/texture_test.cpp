// Look-ups against a double-precision sum over the texel lattice that shares nothing with the code under test: it finds
// texels by integer arithmetic on the infinite, wrapped lattice and weights every one of them by its tent.
#include "kernel/texture/texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace relief {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// A texture with one level and the values it means.
struct TestTexture {
  TextureView view;
  std::vector<unsigned char> bytes;
  std::vector<double> values;  ///< decoded, num_channels interleaved

  double value(int x, int y, int channel) const
  {
    const auto i = static_cast<std::size_t>((y * view.width + x) * view.num_channels + channel);
    return values[i];
  }
};

double linear_from_srgb(double encoded)
{
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

TestTexture random_texture(int width, int height, int num_channels, TexelFormat format, unsigned seed)
{
  TestTexture texture;
  std::mt19937 random(seed);
  for (int i = 0; i < width * height * num_channels; ++i) {
    const bool is_alpha = num_channels % 2 == 0 && i % num_channels == num_channels - 1;
    if (format == TexelFormat::kHalf) {
      const float value = std::uniform_real_distribution<float>(-3.0f, 900.0f)(random);
      const std::uint16_t half = half_from_float(value);
      texture.bytes.push_back(static_cast<unsigned char>(half & 0xff));
      texture.bytes.push_back(static_cast<unsigned char>(half >> 8));
      texture.values.push_back(float_from_half(half));
    } else {
      const auto code = static_cast<unsigned char>(random() & 0xff);
      texture.bytes.push_back(code);
      const double encoded = code / 255.0;
      texture.values.push_back(format == TexelFormat::kU8Srgb && !is_alpha ? linear_from_srgb(encoded) : encoded);
    }
  }
  texture.view.levels[0] = texture.bytes.data();
  texture.view.width = width;
  texture.view.height = height;
  texture.view.num_levels = 1;
  texture.view.num_channels = num_channels;
  texture.view.format = format;
  return texture;
}

long long modulo(long long a, long long n) { return ((a % n) + n) % n; }

/// Texel that the infinite lattice shows at an integer position.
int wrapped(long long i, int size, Wrap wrap)
{
  switch (wrap) {
    case Wrap::kRepeat:
      return static_cast<int>(modulo(i, size));
    case Wrap::kMirror: {
      const long long m = modulo(i, 2LL * size);
      return static_cast<int>(m < size ? m : 2LL * size - 1 - m);
    }
    case Wrap::kClamp:
      break;
  }
  return static_cast<int>(i < 0 ? 0 : i >= size ? size - 1 : i);
}

double oracle(const TestTexture& texture, Vec2f uv, int channel)
{
  const TextureView& view = texture.view;
  const double x = static_cast<double>(uv.x) * view.width, y = static_cast<double>(uv.y) * view.height;
  double sum = 0;
  for (long long j = std::llround(std::floor(y)) - 2; j <= std::llround(std::floor(y)) + 2; ++j) {
    for (long long i = std::llround(std::floor(x)) - 2; i <= std::llround(std::floor(x)) + 2; ++i) {
      const double wx = std::max(0.0, 1 - std::abs(x - (static_cast<double>(i) + 0.5)));
      const double wy = std::max(0.0, 1 - std::abs(y - (static_cast<double>(j) + 0.5)));
      if (wx > 0 && wy > 0) {
        sum +=
            wx * wy * texture.value(wrapped(i, view.width, view.wrap_u), wrapped(j, view.height, view.wrap_v), channel);
      }
    }
  }
  return sum;
}

/// The channel of the image that a component of a look-up shows; −1: none (alpha 1).
int channel_of(int component, int num_channels)
{
  if (component == 3) return num_channels == 2 ? 1 : num_channels == 4 ? 3 : -1;
  return num_channels <= 2 ? 0 : component;
}

float component(Vec4f v, int i) { return i == 0 ? v.x : i == 1 ? v.y : i == 2 ? v.z : v.w; }

struct Storage {
  TexelFormat format;
  int num_channels;
};

class TextureSample : public testing::TestWithParam<Storage> {};

TEST_P(TextureSample, EqualsTheSumOverTheTexelLattice)
{
  const auto [format, num_channels] = GetParam();
  std::mt19937 random(7);
  std::uniform_real_distribution<float> coordinate(-3.0f, 3.0f);
  const double scale = format == TexelFormat::kHalf ? 900.0 : 1.0;
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {5, 1}, {2, 2}, {4, 4}, {33, 17}}) {
    TestTexture texture = random_texture(width, height, num_channels, format, 11);
    for (const Wrap wrap_u : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
      for (const Wrap wrap_v : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
        texture.view.wrap_u = wrap_u;
        texture.view.wrap_v = wrap_v;
        for (int k = 0; k < 200; ++k) {
          const Vec2f uv{coordinate(random), coordinate(random)};
          const Vec4f value = texture_sample(texture.view, uv, 0.0f);
          for (int c = 0; c < 4; ++c) {
            const int channel = channel_of(c, num_channels);
            const double expected = channel < 0 ? 1.0 : oracle(texture, uv, channel);
            // uv has 22 bits below the point: 33 texels wide, 33 · 2^-22 of a texel, times the step between texels.
            ASSERT_NEAR(component(value, c), expected, 2e-5 * scale)
                << "uv " << uv.x << ' ' << uv.y << " size " << width << 'x' << height << " component " << c;
          }
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllStorages,
                         TextureSample,
                         testing::Values(Storage{TexelFormat::kU8, 1},
                                         Storage{TexelFormat::kU8, 2},
                                         Storage{TexelFormat::kU8, 3},
                                         Storage{TexelFormat::kU8, 4},
                                         Storage{TexelFormat::kU8Srgb, 1},
                                         Storage{TexelFormat::kU8Srgb, 2},
                                         Storage{TexelFormat::kU8Srgb, 3},
                                         Storage{TexelFormat::kU8Srgb, 4},
                                         Storage{TexelFormat::kHalf, 1},
                                         Storage{TexelFormat::kHalf, 2},
                                         Storage{TexelFormat::kHalf, 3},
                                         Storage{TexelFormat::kHalf, 4}));

TEST(TextureImpulse, OneTexelOfFourIsATentAroundItsCentre)
{
  TestTexture texture = random_texture(2, 2, 1, TexelFormat::kU8, 1);
  texture.bytes = {255, 0, 0, 0};  // top left
  texture.view.levels[0] = texture.bytes.data();
  texture.view.wrap_u = texture.view.wrap_v = Wrap::kClamp;
  const auto at = [&](float u, float v) { return texture_sample(texture.view, {u, v}, 0.0f).x; };
  EXPECT_EQ(at(0.25f, 0.25f), 1.0f);
  EXPECT_EQ(at(0.0f, 0.0f), 1.0f);
  EXPECT_EQ(at(0.5f, 0.25f), 0.5f);
  EXPECT_EQ(at(0.5f, 0.5f), 0.25f);
  EXPECT_EQ(at(0.75f, 0.25f), 0.0f);
  texture.view.wrap_u = texture.view.wrap_v = Wrap::kRepeat;
  EXPECT_EQ(at(0.0f, 0.25f), 0.5f);
  EXPECT_EQ(at(0.0f, 0.0f), 0.25f);
  EXPECT_EQ(at(1.0f, 1.0f), 0.25f);
}

TEST(TextureSampleNearest, ReadsTheTexelThatContainsTheCoordinate)
{
  TestTexture texture = random_texture(5, 3, 1, TexelFormat::kU8, 3);
  texture.view.filter = TexelFilter::kNearest;
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
    texture.view.wrap_u = texture.view.wrap_v = wrap;
    for (int j = -6; j < 9; ++j) {
      for (int i = -10; i < 15; ++i) {
        // Not at texel borders, where either side is right.
        const Vec2f uv{(static_cast<float>(i) + 0.3f) / 5.0f, (static_cast<float>(j) + 0.7f) / 3.0f};
        const double expected = texture.value(wrapped(i, 5, wrap), wrapped(j, 3, wrap), 0);
        EXPECT_FLOAT_EQ(texture_sample(texture.view, uv, 0.0f).x, static_cast<float>(expected));
      }
    }
  }
}

TEST(TextureSampleAnyFloat, StaysInsideTheTexelsAndFinite)
{
  // Every texel is 1; the memory around them holds another value, which would show.
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 9}, {7, 1}, {8, 8}, {65, 3}}) {
    std::vector<unsigned char> memory(static_cast<std::size_t>(width * height) + 256, 77);
    std::fill_n(memory.begin() + 128, width * height, static_cast<unsigned char>(255));
    TextureView view;
    view.levels[0] = memory.data() + 128;
    view.width = width;
    view.height = height;
    view.num_levels = 1;
    view.num_channels = 1;
    std::vector<float> coordinates = {0.0f,   -0.0f,  1.0f,      0.99999994f, 1.0000001f,  -1e-9f, -1e-38f,
                                      1e-45f, 1e6f,   -1e6f,     123456.7f,   16777216.0f, 3e9f,   -3e9f,
                                      1e30f,  -1e30f, kInfinity, -kInfinity,  kNan};
    std::mt19937 random(5);
    for (int i = 0; i < 300; ++i) {
      coordinates.push_back(__builtin_bit_cast(float, static_cast<std::uint32_t>(random())));
    }
    for (const TexelFilter filter : {TexelFilter::kLinear, TexelFilter::kNearest}) {
      for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
        view.filter = filter;
        view.wrap_u = view.wrap_v = wrap;
        for (const float u : coordinates) {
          ASSERT_EQ(texture_sample(view, {u, 0.5f}, 0.0f).x, 1.0f) << u;
          ASSERT_EQ(texture_sample(view, {0.5f, u}, 0.0f).x, 1.0f) << u;
          ASSERT_EQ(texture_sample(view, {u, u}, u).x, 1.0f) << u;
        }
      }
    }
  }
}

TEST(TextureWrap, RepeatIsContinuousOverTheSeam)
{
  const TestTexture texture = random_texture(256, 1, 1, TexelFormat::kU8, 9);
  const float step = 1e-6f;
  const float below = texture_sample(texture.view, {1.0f - step, 0.5f}, 0.0f).x;
  const float above = texture_sample(texture.view, {1.0f + step, 0.5f}, 0.0f).x;
  EXPECT_NEAR(below, above, 2 * 256 * step);
  EXPECT_EQ(texture_sample(texture.view, {0.0f, 0.5f}, 0.0f).x, texture_sample(texture.view, {1.0f, 0.5f}, 0.0f).x);
}

TEST(MipSelect, IsTheLogarithmOfTheFootprintInTexels)
{
  for (float texels = 1.0f; texels < 300.0f; texels *= 1.03f) {
    const MipSelection mip = mip_select(512, 128, 10, texels / 256.0f);
    const double level = mip.level + static_cast<double>(mip.blend);
    EXPECT_NEAR(level, std::log2(static_cast<double>(texels)), 0.0861) << texels;  // max of log2(1 + x) − x
  }
  EXPECT_EQ(mip_select(256, 256, 9, 4.0f / 256).level, 2);
  EXPECT_EQ(mip_select(256, 256, 9, 4.0f / 256).blend, 0.0f);
}

TEST(MipSelect, AnyFootprintGivesLevelsThatExist)
{
  for (const float width : {-1.0f, 0.0f, kNan, 1e-30f}) {
    EXPECT_EQ(mip_select(256, 256, 9, width).level, 0);
    EXPECT_EQ(mip_select(256, 256, 9, width).blend, 0.0f);
  }
  for (const float width : {1.0f, 1e10f, 3e38f, kInfinity}) {
    EXPECT_EQ(mip_select(256, 256, 9, width).level, 8);
    EXPECT_EQ(mip_select(256, 256, 9, width).blend, 0.0f);
  }
}

TEST(MipSelect, TrilinearBlendsTheTwoLevels)
{
  unsigned char fine[4] = {0, 0, 0, 0}, coarse[1] = {255};
  TextureView view;
  view.levels[0] = fine;
  view.levels[1] = coarse;
  view.width = view.height = 2;
  view.num_levels = 2;
  view.num_channels = 1;
  EXPECT_EQ(texture_sample(view, {0.3f, 0.3f}, 0.75f).x, 0.5f);
  EXPECT_EQ(texture_sample(view, {0.3f, 0.3f}, 0.5f).x, 0.0f);
  EXPECT_EQ(texture_sample(view, {0.3f, 0.3f}, 1.0f).x, 1.0f);
  view.filter = TexelFilter::kNearest;
  EXPECT_EQ(texture_sample(view, {0.3f, 0.3f}, 0.7f).x, 0.0f);
  EXPECT_EQ(texture_sample(view, {0.3f, 0.3f}, 0.8f).x, 1.0f);
}

TEST(MipSize, IsRepeatedHalvingRoundedUp)
{
  for (const int size : {1, 2, 3, 5, 31, 33, 4097, 65536}) {
    int expected = size;
    for (int level = 0; level < 18; ++level) {
      EXPECT_EQ(mip_size(size, level), expected);
      expected = (expected + 1) / 2;
    }
  }
}

TEST(SrgbTable, EqualsTheFormula)
{
  for (int code = 0; code < 256; ++code) {
    EXPECT_EQ(kLinearFromSrgb8[code], static_cast<float>(linear_from_srgb(code / 255.0))) << code;
  }
}

double half_value(std::uint16_t half)
{
  const int exponent = (half >> 10) & 31, fraction = half & 1023;
  const double magnitude = exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024 + fraction, exponent - 25);
  return half & 0x8000 ? -magnitude : magnitude;
}

TEST(Half, AllValuesConvertExactlyAndBack)
{
  for (int bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    const float value = float_from_half(half);
    const bool special = ((half >> 10) & 31) == 31;
    if (special && (half & 1023) != 0) {
      ASSERT_TRUE(std::isnan(value)) << bits;
      ASSERT_TRUE(std::isnan(float_from_half(half_from_float(value)))) << bits;
      continue;
    }
    if (special) {
      ASSERT_EQ(value, (half & 0x8000) ? -kInfinity : kInfinity);
    } else {
      ASSERT_EQ(static_cast<double>(value), half_value(half)) << bits;
    }
    ASSERT_EQ(half_from_float(value), half);
  }
}

TEST(Half, RoundsToTheNearestTiesToEven)
{
  // Between all neighbours: just below, at, and just above the midpoint.
  for (int bits = 0; bits < 0x7bff; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    const auto next = static_cast<std::uint16_t>(bits + 1);
    const auto middle = static_cast<float>((half_value(half) + half_value(next)) / 2);
    ASSERT_EQ(half_from_float(middle), bits % 2 == 0 ? half : next) << bits;
    ASSERT_EQ(half_from_float(std::nextafter(middle, 0.0f)), half) << bits;
    ASSERT_EQ(half_from_float(std::nextafter(middle, kInfinity)), next) << bits;
  }
  EXPECT_EQ(half_from_float(65519.996f), 0x7bff);
  EXPECT_EQ(half_from_float(65520.0f), 0x7c00);
}

TEST(TextureRefUv, AppliesTheTransformAndScalesFootprintsByItsArea)
{
  TextureRef ref;
  ref.m00 = 0.0f;
  ref.m01 = -2.0f;
  ref.m02 = 0.25f;
  ref.m10 = 8.0f;
  ref.m11 = 0.0f;
  ref.m12 = -1.0f;
  const Vec2f uv = texture_ref_uv(ref, {0.5f, 0.25f});
  EXPECT_EQ(uv.x, -0.25f);
  EXPECT_EQ(uv.y, 3.0f);
  EXPECT_FLOAT_EQ(texture_ref_width(ref, 0.5f), 2.0f);
  EXPECT_EQ(texture_ref_width(TextureRef{}, 0.5f), 0.5f);
}

}  // namespace
}  // namespace relief
