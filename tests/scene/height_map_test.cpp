// Height maps: texels are those of the file to the last bit, whatever the file; what is no height is replaced and said.
// Images are written by OpenImageIO, or by hand where it cannot, and compared with what was written.
#include "scene/height_map.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include "scene/load.h"
#include "scene/texture_store.h"
#include "tests/support/gltf_builder.h"

namespace relief {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <class T>
constexpr OIIO::TypeDesc::BASETYPE type_of()
{
  if constexpr (std::is_same_v<T, std::uint8_t>) return OIIO::TypeDesc::UINT8;
  if constexpr (std::is_same_v<T, std::uint16_t>) return OIIO::TypeDesc::UINT16;
  if constexpr (std::is_same_v<T, std::uint32_t>) return OIIO::TypeDesc::UINT32;
  if constexpr (std::is_same_v<T, double>) return OIIO::TypeDesc::DOUBLE;
  return OIIO::TypeDesc::FLOAT;
}

/// An image as it is written; channels interleaved.
template <class T>
struct TestImage {
  int width = 1, height = 1, num_channels = 1;
  std::vector<T> values;
  OIIO::TypeDesc stored = type_of<T>();
  int tile_side = 0;
  int bits_per_sample = 0;  ///< 0: all of the type
  std::string color_space = {};
};

template <class T>
fs::path image_write(const fs::path& path, const TestImage<T>& image)
{
  const auto out = OIIO::ImageOutput::create(path.string());
  if (out == nullptr) {
    ADD_FAILURE() << path;
    return path;
  }
  OIIO::ImageSpec spec(image.width, image.height, image.num_channels, image.stored);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  if (image.bits_per_sample > 0) {
    spec.attribute("oiio:BitsPerSample", image.bits_per_sample);
  }
  if (!image.color_space.empty()) {
    spec.attribute("oiio:ColorSpace", image.color_space);
  }
  spec.tile_width = spec.tile_height = image.tile_side;
  EXPECT_TRUE(out->open(path.string(), spec)) << out->geterror();
  EXPECT_TRUE(out->write_image(type_of<T>(), image.values.data())) << out->geterror();
  EXPECT_TRUE(out->close());
  return path;
}

TextureRequest request_for(const fs::path& path)
{
  TextureRequest request;
  request.file = path;
  request.label = path.filename().string();
  request.scene_file = "scene.gltf";
  request.json_path = "/images/0";
  return request;
}

TextureRequest embedded_request(std::vector<unsigned char> bytes)
{
  TextureRequest request = request_for("");
  request.label = "embedded";
  request.encoded = std::move(bytes);
  return request;
}

std::vector<unsigned char> file_bytes(const fs::path& path)
{
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

struct Loaded {
  HeightMap map;
  std::vector<std::string> warnings;
};

Loaded load(const TextureRequest& request)
{
  Warnings warnings;
  HeightMapSet set = height_maps_load({&request, 1}, warnings);
  EXPECT_EQ(set.maps.size(), 1u);
  EXPECT_EQ(set.map_of_request, std::vector<int>{0});
  return {set.maps.at(0), warnings.texts()};
}

template <class T>
Loaded load(const std::string& name, const TestImage<T>& image)
{
  const TemporaryFolder folder;
  return load(request_for(image_write(folder / name, image)));
}

template <class T>
std::vector<T> texels_of(const HeightMap& map)
{
  EXPECT_EQ(map.bytes(), static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height) * sizeof(T));
  std::vector<T> out(map.bytes() / sizeof(T));
  std::memcpy(out.data(), map.texels.get(), map.bytes());
  return out;
}

template <class T>
std::vector<T> random_values(std::size_t n, unsigned seed)
{
  std::mt19937 random(seed);
  std::vector<T> out(n);
  for (T& value : out) {
    value = static_cast<T>(random());
  }
  return out;
}

// --- storage ---

TEST(HeightMap, SixteenBitPngKeepsEveryCode)
{
  TestImage<std::uint16_t> image{256, 256, 1, {}};
  for (int code = 0; code < 65536; ++code) {
    image.values.push_back(static_cast<std::uint16_t>(code));
  }
  const Loaded loaded = load("h.png", image);
  EXPECT_EQ(loaded.map.format, HeightFormat::kU16);
  EXPECT_EQ(texels_of<std::uint16_t>(loaded.map), image.values);
  EXPECT_TRUE(loaded.warnings.empty());
  const HeightMapView view = loaded.map.view();
  for (const int code : {0, 1, 32768, 65534, 65535}) {
    EXPECT_NEAR(height_at(view, code), code / 65535.0, 6e-8) << code;
  }
}

TEST(HeightMap, EightBitImagesStaySo)
{
  const TestImage<std::uint8_t> image{37, 29, 1, random_values<std::uint8_t>(37 * 29, 1)};
  for (const char* name : {"h.png", "h.tif", "h.bmp", "h.tga"}) {
    const Loaded loaded = load(name, image);
    EXPECT_EQ(loaded.map.format, HeightFormat::kU8) << name;
    EXPECT_EQ(texels_of<std::uint8_t>(loaded.map), image.values) << name;
    EXPECT_TRUE(loaded.warnings.empty()) << name << loaded.warnings[0];
  }
}

TEST(HeightMap, ClaimsToBeSrgbChangeNothing)
{
  TestImage<std::uint8_t> bytes{64, 4, 1, random_values<std::uint8_t>(256, 2)};
  bytes.color_space = "sRGB";
  EXPECT_EQ(texels_of<std::uint8_t>(load("h.png", bytes).map), bytes.values);
  TestImage<std::uint16_t> words{64, 4, 1, random_values<std::uint16_t>(256, 3)};
  words.color_space = "sRGB";
  EXPECT_EQ(texels_of<std::uint16_t>(load("h.png", words).map), words.values);
}

/// PNG of four texels, made by hand: OpenImageIO does not write fewer than 8 bits.
struct SmallPng {
  const char* name;
  std::string base64;
  std::vector<std::uint8_t> texels;
};

/// The square, displaced by an image.
std::string displaced_by(const std::string& image_uri)
{
  test::GltfBuilder b = test::square_scene();
  b.json["images"] = {{{"uri", image_uri}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {{{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b.gltf();
}

TEST(HeightMap, FewBitsAndPalettesBecomeBytes)
{
  const TemporaryFolder folder;
  const SmallPng pngs[] = {
      {"1 bit",
       "iVBORw0KGgoAAAANSUhEUgAAAAQAAAABAQAAAADRRzJgAAAACklEQVR42mMIAAAAUgBRWqmjOgAAAABJRU5ErkJggg==",
       {0, 255, 0, 255}},
      {"2 bits",
       "iVBORw0KGgoAAAANSUhEUgAAAAQAAAABAgAAAACW50iwAAAACklEQVR42mOQBgAAHQAcI3yPrAAAAABJRU5ErkJggg==",
       {0, 85, 170, 255}},
      {"4 bits",
       "iVBORw0KGgoAAAANSUhEUgAAAAQAAAABBAAAAAAZp70QAAAAC0lEQVR42mNgXQ8AALwAtRHl9XsAAAAASUVORK5CYII=",
       {0, 85, 170, 255}},
      {"palette",
       "iVBORw0KGgoAAAANSUhEUgAAAAQAAAABAgMAAACEUudeAAAADFBMVEUJCQlGRkaCgoL///+VCedvAAAACklEQVR42mOQBgAA"
       "HQAcI3yPrAAAAABJRU5ErkJggg==",
       {9, 70, 130, 255}},
  };
  for (const SmallPng& png : pngs) {
    const Scene scene = scene_load(folder.write("s.gltf", displaced_by("data:image/png;base64," + png.base64)));
    ASSERT_EQ(scene.height_maps.size(), 1u) << png.name;
    EXPECT_EQ(scene.height_maps[0].format, HeightFormat::kU8) << png.name;
    EXPECT_EQ(texels_of<std::uint8_t>(scene.height_maps[0]), png.texels) << png.name;
  }
}

// 12 bits reach the full range of 16: code · 65535 / 4095, off by less than one.
TEST(HeightMap, TwelveBitsBecomeSixteen)
{
  TestImage<std::uint16_t> image{64, 64, 1, {}};
  for (int code = 0; code < 4096; ++code) {
    image.values.push_back(static_cast<std::uint16_t>(std::lround(code * 65535.0 / 4095)));
  }
  image.bits_per_sample = 12;
  const Loaded loaded = load("h.tif", image);
  EXPECT_EQ(loaded.map.format, HeightFormat::kU16);
  const std::vector<std::uint16_t> texels = texels_of<std::uint16_t>(loaded.map);
  EXPECT_EQ(texels.front(), 0);
  EXPECT_EQ(texels.back(), 65535);
  for (std::size_t code = 0; code < 4096; ++code) {
    EXPECT_NEAR(texels[code], static_cast<double>(code) * 65535 / 4095, 1) << code;
  }
}

TEST(HeightMap, FloatsAreExact)
{
  TestImage<float> image{61, 19, 1, {}};
  std::mt19937 random(4);
  std::normal_distribution<float> normal(-3, 1000);
  for (int i = 0; i < 61 * 19; ++i) {
    image.values.push_back(normal(random));
  }
  image.values[7] = 1e30f;
  image.values[8] = 1e-38f;
  for (const char* name : {"h.exr", "h.tif"}) {
    const Loaded loaded = load(name, image);
    EXPECT_EQ(loaded.map.format, HeightFormat::kFloat) << name;
    EXPECT_EQ(texels_of<float>(loaded.map), image.values) << name;
    EXPECT_TRUE(loaded.warnings.empty()) << name;
  }
}

// Every finite half, subnormals included.
TEST(HeightMap, HalvesAreExact)
{
  TestImage<float> image{256, 248, 1, {}, OIIO::TypeDesc::HALF};
  for (int sign = 0; sign < 2; ++sign) {
    for (int bits = 0; bits < 31 * 1024; ++bits) {
      const int exponent = bits >> 10, mantissa = bits & 1023;
      const float value = exponent == 0 ? std::ldexp(static_cast<float>(mantissa), -24)
                                        : std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
      image.values.push_back(sign == 0 ? value : -value);
    }
  }
  const Loaded loaded = load("h.exr", image);
  EXPECT_EQ(loaded.map.format, HeightFormat::kFloat);
  EXPECT_EQ(texels_of<float>(loaded.map), image.values);
  EXPECT_TRUE(loaded.warnings.empty());
}

TEST(HeightMap, WideIntegersBecomeFloats)
{
  const TestImage<std::uint32_t> integers{2, 2, 1, {0, 1u << 30, 3u << 30, 4294967295u}};
  EXPECT_EQ(texels_of<float>(load("h.tif", integers).map), (std::vector<float>{0, 0.25f, 0.75f, 1}));
}

// Bands of rows, rows of tiles and the map's own size go into each other in no way.
TEST(HeightMap, AllRowsArriveFromTilesAndStrips)
{
  TestImage<std::uint16_t> image{131, 517, 1, random_values<std::uint16_t>(131 * 517, 5)};
  for (const int tile_side : {0, 48, 64, 512}) {
    image.tile_side = tile_side;
    EXPECT_EQ(texels_of<std::uint16_t>(load("h.tif", image).map), image.values) << tile_side;
  }
}

// --- channels ---

TEST(HeightMap, GreyInColoursAndAlphaNeedsNoWarning)
{
  TestImage<std::uint16_t> image{16, 16, 4, {}};
  const std::vector<std::uint16_t> heights = random_values<std::uint16_t>(256, 6);
  const std::vector<std::uint16_t> alpha = random_values<std::uint16_t>(256, 7);
  for (std::size_t i = 0; i < heights.size(); ++i) {
    image.values.insert(image.values.end(), {heights[i], heights[i], heights[i], alpha[i]});
  }
  for (const char* name : {"h.png", "h.tif"}) {
    const Loaded loaded = load(name, image);
    EXPECT_EQ(texels_of<std::uint16_t>(loaded.map), heights) << name;
    EXPECT_TRUE(loaded.warnings.empty()) << name;
  }
}

TEST(HeightMap, ColoursGiveTheirFirstChannelAndOneWarning)
{
  TestImage<std::uint8_t> image{16, 16, 3, {}};
  const std::vector<std::uint8_t> heights = random_values<std::uint8_t>(256, 8);
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const auto other = static_cast<std::uint8_t>(i % 64 == 0 ? heights[i] ^ 1 : heights[i]);
    image.values.insert(image.values.end(), {heights[i], heights[i], other});
  }
  const Loaded loaded = load("h.png", image);
  EXPECT_EQ(texels_of<std::uint8_t>(loaded.map), heights);
  ASSERT_EQ(loaded.warnings.size(), 1u);
  EXPECT_NE(loaded.warnings[0].find("h.png: a colour image"), std::string::npos) << loaded.warnings[0];
  EXPECT_NE(loaded.warnings[0].find("in 4 texels"), std::string::npos) << loaded.warnings[0];
}

// --- what is no height ---

TEST(HeightMap, NonFiniteTexelsBecomeTheMeanOfTheOthers)
{
  TestImage<float> image{4, 3, 1, {1, 2, 3, 4, 5, 6, kNan, 8, kInfinity, -kInfinity, 2e30f, -2e30f}};
  const float mean = (1 + 2 + 3 + 4 + 5 + 6 + 8) / 7.0f;
  const Loaded loaded = load("h.exr", image);
  EXPECT_EQ(texels_of<float>(loaded.map), (std::vector<float>{1, 2, 3, 4, 5, 6, mean, 8, mean, mean, mean, mean}));
  ASSERT_EQ(loaded.warnings.size(), 1u);
  EXPECT_NE(loaded.warnings[0].find("h.exr: 5 heights"), std::string::npos) << loaded.warnings[0];
  EXPECT_NE(loaded.warnings[0].find("column 2, row 1"), std::string::npos) << loaded.warnings[0];
}

TEST(HeightMap, WithoutAnyHeightIsFlat)
{
  const Loaded loaded = load("h.exr", TestImage<float>{2, 1, 1, {kNan, kInfinity}});
  EXPECT_EQ(texels_of<float>(loaded.map), (std::vector<float>{0, 0}));
  EXPECT_EQ(loaded.warnings.size(), 1u);
}

TEST(HeightMap, InfiniteHalvesAreReplacedToo)
{
  EXPECT_EQ(texels_of<float>(load("h.exr", TestImage<float>{2, 1, 1, {kInfinity, 3}, OIIO::TypeDesc::HALF}).map),
            (std::vector<float>{3, 3}));
}

TEST(HeightMap, RangeIsThatOfTheTexels)
{
  const Loaded loaded = load("h.exr", TestImage<float>{3, 1, 1, {0.5f, -7, kNan}});
  const HeightRange range = height_map_range(loaded.map.view());
  EXPECT_EQ(range.low, -7);
  EXPECT_EQ(range.high, 0.5f);
}

// --- sharing ---

TEST(HeightMap, EqualRequestsShareAMapAndEqualImagesTheirTexels)
{
  const TemporaryFolder folder;
  const fs::path path = image_write(folder / "h.png", TestImage<std::uint16_t>{2, 2, 1, {1, 2, 3, 4}});
  std::vector<TextureRequest> requests(5, request_for(path));
  requests[1].wrap_u = Wrap::kClamp;
  requests[2].file = folder / "." / "h.png";
  requests[2].label = "another name";
  requests[3].filter = TexelFilter::kNearest;
  requests[4] = embedded_request(file_bytes(path));
  Warnings warnings;
  const HeightMapSet set = height_maps_load(requests, warnings);
  EXPECT_EQ(set.map_of_request, (std::vector<int>{0, 1, 0, 0, 2}));
  ASSERT_EQ(set.maps.size(), 3u);
  EXPECT_EQ(set.maps[0].texels, set.maps[1].texels);
  EXPECT_NE(set.maps[0].texels, set.maps[2].texels);
  EXPECT_EQ(set.maps[0].view().wrap_u, Wrap::kRepeat);
  EXPECT_EQ(set.maps[1].view().wrap_u, Wrap::kClamp);
  EXPECT_EQ(height_map_bytes(set.maps), 16u);
  ASSERT_EQ(warnings.texts().size(), 1u);
  EXPECT_NE(warnings.texts()[0].find("nearest"), std::string::npos) << warnings.texts()[0];
}

// --- damage ---

void expect_error(const TextureRequest& request, const std::string& part)
{
  try {
    load(request);
    ADD_FAILURE() << "no error: " << part;
  } catch (const SceneError& e) {
    EXPECT_EQ(e.file, "scene.gltf");
    EXPECT_EQ(e.json_path, "/images/0");
    EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
  }
}

TEST(HeightMap, UnreadableImagesAreErrorsThatNameThem)
{
  const TemporaryFolder folder;
  expect_error(request_for(folder / "missing.png"), "missing.png");
  expect_error(request_for(folder.write("text.png", "no image")), "text.png");
  expect_error(embedded_request({}), "no data");
  const fs::path wide =
      image_write(folder / "wide.png", TestImage<std::uint8_t>{65537, 1, 1, std::vector<std::uint8_t>(65537)});
  expect_error(request_for(wide), "at most 65536 texels");
}

// The library reads them as zeros and does not complain.
TEST(HeightMap, DoubleTiffsAreErrors)
{
  const TemporaryFolder folder;
  expect_error(request_for(image_write(folder / "h.tif", TestImage<double>{2, 1, 1, {0.5, 1}})), "32 bits a sample");
}

TEST(HeightMap, TruncatedImagesAreErrors)
{
  const TemporaryFolder folder;
  const TestImage<std::uint16_t> image{200, 200, 1, random_values<std::uint16_t>(40000, 9)};
  for (const char* name : {"h.png", "h.tif", "h.exr"}) {
    std::vector<unsigned char> bytes = file_bytes(image_write(folder / name, image));
    bytes.resize(bytes.size() / 2);
    expect_error(request_for(folder.write(name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()})), name);
  }
}

}  // namespace
}  // namespace relief
