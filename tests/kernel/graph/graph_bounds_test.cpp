// Ranges of operations of value graphs: never narrower than samples show, and tight where functions are smooth.
#include <gtest/gtest.h>

#include <array>
#include <set>

#include "integrator/graph_bounds_stage.h"
#include "kernel/graph/noise_range.h"
#include "kernel/graph/voronoi_range.h"
#include "scene/height_image.h"
#include "tests/kernel/graph/one_operation.h"
#include "tests/support/test_rays.h"

namespace relief {
namespace {

using test::HardNumbers;
using Op = GraphOp;

/// What an operation's inputs may be in a test.
struct Shape {
  Op op;
  int num_varying;  ///< the first ones; others are single numbers between the bounds below
  float low = 0, high = 1;
  std::vector<std::vector<std::uint16_t>> immediates = {{}};
  bool is_bounded = true;  ///< bounds are known of ordinary numbers
};

std::vector<std::vector<std::uint16_t>> pairs(std::uint16_t first, std::uint16_t second)
{
  std::vector<std::vector<std::uint16_t>> out;
  for (std::uint16_t a = 0; a < first; ++a) {
    for (std::uint16_t b = 0; b < second; ++b) out.push_back({a, b});
  }
  return out;
}

std::vector<std::vector<std::uint16_t>> voronoi_kinds()
{
  std::vector<std::vector<std::uint16_t>> out;
  for (std::uint16_t feature = 0; feature < 5; ++feature) {
    for (std::uint16_t metric = 0; metric < 4; ++metric) {
      for (std::uint16_t flags = 0; flags < 8; ++flags) out.push_back({feature, metric, flags});
    }
  }
  return out;
}

constexpr std::uint16_t kEntries = 9;
/// And a luminaire's after it: two angles on each axis, and the values around and between them.
const std::vector<float> kTable = {0.5f,  0.7f,  0.1f,  0.1f,  2.0f,  -1.0f, 0.0f,  0.25f, 0.5f,  0.0f,
                                   6.28f, 0.0f,  3.14f, 0.3f,  -2.0f, -1.5f, 0.25f, 0.0f,  1.25f, -0.5f,
                                   0.1f,  0.75f, 2.0f,  3.0f,  4.0f,  0.0f,  0.5f,  0.25f, 1.0f,  0.0f,
                                   -1.0f, -1.0f, -1.0f, -1.0f, -1.0f, -1.0f, -1.0f, -1.0f, -1.0f};

/// Where the table has a row of tiles, of which the first alone is there.
constexpr std::uint16_t kFirstTile = 29;

/// One row an opcode; a new one has to be given a row.
const std::vector<Shape>& shapes()
{
  static const std::vector<Shape> all = {
      {Op::copy, 1},
      {Op::add, 2},
      {Op::subtract, 2},
      {Op::multiply, 2},
      {Op::divide, 2},
      {Op::multiply_add, 3},
      {Op::minimum, 2},
      {Op::maximum, 2},
      {Op::less_than, 2},
      {Op::greater_than, 2},
      {Op::equal, 2},
      {Op::select, 3},
      {Op::guard, 2},
      {Op::floor, 1},
      {Op::ceil, 1},
      {Op::absolute, 1},
      {Op::sign, 1},
      {Op::square_root, 1},
      {Op::power, 1, -2, 5},
      {Op::power, 2},
      {Op::logarithm, 1, 0.5f, 12},
      {Op::logarithm, 2},
      {Op::exponent, 1},
      {Op::modulo, 1, -3, 3},
      {Op::modulo, 2},
      {Op::sine, 1},
      {Op::cosine, 1},
      {Op::tangent, 1},
      {Op::arcsine, 1},
      {Op::arccosine, 1},
      {Op::arctangent, 1},
      {Op::arctangent2, 2},
      {Op::sinh, 1},
      {Op::cosh, 1},
      {Op::tanh, 1},
      {Op::rgb_to_hsv, 3},
      {Op::hsv_to_rgb, 3},
      {Op::rgb_to_hsl, 3},
      {Op::hsl_to_rgb, 3},
      {Op::noise_1d, 1, 0, 3, pairs(2, 2)},
      {Op::noise_2d, 2, 0, 3, pairs(2, 2)},
      {Op::noise_3d, 3, 0, 3, pairs(2, 2)},
      {Op::noise_4d, 4, 0, 3, pairs(2, 2)},
      {Op::noise_3d, 6, 0, 3, pairs(2, 2)},
      {Op::noise_1d, 4, 0, 3, pairs(2, 2)},
      {Op::signed_noise_1d, 1, 0, 1, {{0}, {1}}},
      {Op::signed_noise_2d, 2, 0, 1, {{0}, {1}}},
      {Op::signed_noise_3d, 3, 0, 1, {{0}, {1}}},
      {Op::signed_noise_4d, 4, 0, 1, {{0}, {1}}},
      {Op::hash_1d, 1},
      {Op::hash_2d, 2},
      {Op::hash_3d, 3},
      {Op::hash_4d, 4},
      {Op::voronoi_1d, 1, 0, 1, voronoi_kinds()},
      {Op::voronoi_2d, 2, 0, 1, voronoi_kinds()},
      {Op::voronoi_3d, 3, 0, 1, voronoi_kinds()},
      {Op::voronoi_4d, 4, 0, 1, voronoi_kinds()},
      {Op::voronoi_1d, 7, 0, 1, voronoi_kinds()},
      {Op::voronoi_2d, 8, 0, 1, voronoi_kinds()},
      {Op::voronoi_3d, 9, 0, 1, voronoi_kinds()},
      {Op::voronoi_2d, 2, 0, 3, voronoi_kinds()},
      {Op::voronoi_3d, 3, 0, 3, voronoi_kinds()},
      {Op::musgrave_1d, 1, 0, 3, pairs(5, 2)},
      {Op::musgrave_2d, 2, 0, 3, pairs(5, 2)},
      {Op::musgrave_3d, 3, 0, 3, pairs(5, 2)},
      {Op::musgrave_4d, 4, 0, 3, pairs(5, 2)},
      {Op::musgrave_1d, 6, 0, 3, pairs(5, 2)},
      {Op::musgrave_3d, 8, 0, 3, pairs(5, 2)},
      {Op::brick, 2, 0.01f, 1, pairs(3, 3)},
      {Op::image, 2, 0, 1},
      {Op::image_box, 6, 0, 1},
      {Op::table, 1, 0, 1, {{0, 0, kEntries, 0, 0}, {0, 0, kEntries, 1, 0}, {0, 0, kEntries, 1, 1}, {0, 0, 1, 1, 1}}},
      {Op::checker, 3},
      {Op::grid, 2, 0, 1, {{0, 0, 3, 1}}},
      {Op::fresnel, 2},
      {Op::fresnel, 1, 1, 3},
      {Op::open_share, 18},
      {Op::bevel, 12},
      {Op::ies, 2, 0, 1, {{kEntries, 0, 2, 2}}},
      {Op::gabor_2d, 2},
      {Op::gabor_3d, 3},
      {Op::blackbody, 1},
      {Op::image_tiles, 2, 0, 1, {{0, 1, kFirstTile, 0}}},
      {Op::voxels, 3},
      // Of this nothing is known, which no sample contradicts.
      {Op::skip, 1},
  };
  return all;
}

bool is_unknown_to_ranges(Op op) { return op == Op::skip; }

/// A parallelogram in the space of an operation's inputs.
struct Parallelogram {
  float c = 0, d1 = 0, d2 = 0, rest = 0;
};

std::vector<GraphRange> ranges_of(GraphBoundsRun run,
                                  Op op,
                                  const std::vector<std::array<Parallelogram, 8>>& in,
                                  const std::vector<std::uint16_t>& immediates,
                                  const TextureView* textures)
{
  const auto registers = std::make_unique<GraphRangeRegisters>();
  std::vector<std::uint16_t> code = {static_cast<std::uint16_t>(op)};
  code.insert(code.end(), immediates.begin(), immediates.end());
  code.resize(1 + static_cast<std::size_t>(test::shape_of(op).num_immediates), 0);
  std::uint16_t next = 0;
  for (int i = 0; i < test::shape_of(op).num_outputs; ++i) code.push_back(next++);
  for (const auto& lanes : in) {
    GraphRange& range = registers->lanes[next];
    range = range_unknown();
    for (int k = 0; k < 8; ++k) {
      const Parallelogram& p = lanes[static_cast<std::size_t>(k)];
      range.c[k] = p.c;
      range.d1[k] = p.d1;
      range.d2[k] = p.d2;
      range.rest[k] = p.rest;
    }
    const GraphRange closed = range_closed(range), point = range_point(range.c);
    range = range_select(range_radius(range) == 0.0f, point, closed);
    code.push_back(next++);
  }
  GraphProgramView program;
  program.code = code.data();
  program.num_words = static_cast<std::uint32_t>(code.size());
  program.tables = kTable.data();
  program.voxels = &test::some_voxels();
  run(program, textures, *registers);
  std::vector<GraphRange> out;
  for (int i = 0; i < test::shape_of(op).num_outputs; ++i) out.push_back(registers->lanes[i]);
  return out;
}

class GraphBounds : public testing::Test {
 protected:
  GraphBounds()
  {
    for (int i = 0; i < 64; ++i) texels_[i] = static_cast<std::uint8_t>(i * 37);
    image_.levels[0] = texels_;
    image_.width = image_.height = 8;
    image_.num_levels = image_.num_channels = 1;
  }
  std::uint8_t texels_[64];
  TextureView image_;
};

TEST_F(GraphBounds, KnowEveryOperation)
{
  std::set<Op> known;
  for (const Shape& shape : shapes()) known.insert(shape.op);
  EXPECT_EQ(known.size(), std::size(kGraphOpShapes));
}

TEST_F(GraphBounds, AreNeverNarrowerThanSamples)
{
  const std::uint64_t num_samples = num_test_rays(30000);
  constexpr int kSamplesAParallelogram = 24;
  const GraphBoundsRun runs[] = {graph_bounds_baseline, graph_bounds_select()};
  unsigned number = 0;
  for (const Shape& shape : shapes()) {
    if (is_unknown_to_ranges(shape.op)) continue;
    HardNumbers numbers(++number);
    const auto num_inputs = static_cast<std::size_t>(test::shape_of(shape.op).num_inputs);
    int num_wrong = 0;
    for (std::uint64_t round = 0; round * 8 * kSamplesAParallelogram < num_samples && num_wrong < 3; ++round) {
      const float place = std::exp2(numbers.within(-3, 6)), size = std::exp2(numbers.within(-14, 3));
      std::vector<std::array<Parallelogram, 8>> in(num_inputs);
      for (std::size_t i = 0; i < num_inputs; ++i) {
        const float setting = numbers.within(shape.low, shape.high);
        for (Parallelogram& p : in[i]) {
          if (static_cast<int>(i) >= shape.num_varying) {
            p.c = numbers.word() % 4 == 0 ? std::floor(setting) : setting;
            continue;
          }
          p.c = numbers.within(-place, place);
          if (numbers.word() % 8 == 0) p.c = std::floor(p.c);
          if (numbers.word() % 8 == 0) continue;
          p.d1 = numbers.within(-size, size);
          p.d2 = numbers.within(-size, size);
          if (numbers.word() % 2 == 0) p.rest = numbers.within(0, size);
        }
      }
      const std::vector<std::uint16_t>& immediates = shape.immediates[round % shape.immediates.size()];
      const std::vector<GraphRange> ranges = ranges_of(runs[round % 2], shape.op, in, immediates, &image_);
      for (int sample = 0; sample < kSamplesAParallelogram && num_wrong < 3; ++sample) {
        std::vector<std::vector<float>> at(num_inputs, std::vector<float>(8));
        for (std::size_t k = 0; k < 8; ++k) {
          const bool is_corner = numbers.word() % 4 == 0;
          const auto symbol = [&] {
            return is_corner ? (numbers.word() % 2 == 0 ? 1.0f : -1.0f) : numbers.within(-1, 1);
          };
          const float e1 = symbol(), e2 = symbol();
          for (std::size_t i = 0; i < num_inputs; ++i) {
            const Parallelogram& p = in[i][k];
            at[i][k] = static_cast<float>(static_cast<double>(p.c) + static_cast<double>(e1) * p.d1 +
                                          static_cast<double>(e2) * p.d2 + static_cast<double>(symbol()) * p.rest);
          }
        }
        const test::Interpreter interpreter = test::interpreters()[sample % 2 == 1 ? 0 : 1];
        if (!interpreter.is_runnable) continue;
        const test::Outputs out = test::run_one(interpreter.run, shape.op, at, immediates, &image_, kTable);
        for (std::size_t o = 0; o < out.size(); ++o) {
          for (int k = 0; k < 8; ++k) {
            const float value = out[o][static_cast<std::size_t>(k)];
            const GraphRange& r = ranges[o];
            ASSERT_FALSE(std::isnan(r.low[k]) || std::isnan(r.high[k])) << static_cast<int>(shape.op);
            const float radius = range_radius(r)[k];
            // The affine form holds as well.
            const bool inside =
                value >= r.low[k] && value <= r.high[k] && !(std::abs(value - r.c[k]) > radius * 1.0001f + 1e-30f);
            if (inside || (r.low[k] == -kInfinity && r.high[k] == kInfinity)) continue;
            ADD_FAILURE() << "opcode " << static_cast<int>(shape.op) << " output " << o << ": " << value
                          << " is not in [" << r.low[k] << ", " << r.high[k] << "], " << r.c[k] << " ± " << radius
                          << "; immediates " << testing::PrintToString(immediates) << " size " << size << " of input "
                          << at[0][static_cast<std::size_t>(k)] << " "
                          << (at.size() > 1 ? at[1][static_cast<std::size_t>(k)] : 0.0f);
            ++num_wrong;
          }
        }
      }
    }
  }
}

/// Of images of bytes and of floats, with all wraps, filters and readings of opacity, over windows of any size.
TEST(ImageBounds, HoldAllThatIsReadFromAWindow)
{
  HardNumbers numbers(41);
  constexpr int kWidth = 53, kHeight = 37;
  std::vector<std::uint8_t> texels(kWidth * kHeight * 4);
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<std::uint8_t>(numbers.word() >> 7);
  for (int round = 0; round < 4000; ++round) {
    TextureView texture;
    texture.width = kWidth;
    texture.height = kHeight;
    texture.num_levels = 1;
    texture.num_channels = 1 + round % 4;
    texture.format = round / 4 % 2 == 0 ? TexelFormat::kU8 : TexelFormat::kU8Srgb;
    texture.filter = round / 8 % 2 == 0 ? TexelFilter::kLinear : TexelFilter::kNearest;
    texture.wrap_u = static_cast<Wrap>(numbers.word() % 3);
    texture.wrap_v = static_cast<Wrap>(numbers.word() % 3);
    texture.levels[0] = texels.data();
    HeightImage image(nullptr, {kWidth, kHeight, texture.num_channels, texture.format}, "");
    const ImageBounds bounds = image.bounds(texture);
    const unsigned flags = numbers.word() % 32;
    const float size = std::exp2(numbers.within(-8, 1));
    const float u[2] = {numbers.within(-3, 3), 0}, v[2] = {numbers.within(-3, 3), 0};
    const float us[2] = {u[0], u[0] + size * numbers.within(0, 1)}, vs[2] = {v[0], v[0] + size * numbers.within(0, 1)};
    const TexelRange range = image_range(texture, bounds, us, vs, true, flags);
    for (int sample = 0; sample < 60; ++sample) {
      const Vec4f value = image_sample(texture, numbers.within(us[0], us[1]), numbers.within(vs[0], vs[1]), 0, flags);
      const float channels[4] = {value.x, value.y, value.z, value.w};
      for (int c = 0; c < 4; ++c) {
        // Sums of sixteen products, and quotients, are rounded.
        const float rounding = 1e-5f * std::max(1.0f, std::abs(channels[c]));
        ASSERT_TRUE(channels[c] >= range.low[c] - rounding && channels[c] <= range.high[c] + rounding)
            << channels[c] << " in [" << range.low[c] << ", " << range.high[c] << "] channel " << c << " flags "
            << flags << " round " << round;
      }
    }
  }
}

/// Of a ramp they are no wider than the window and the texels around it, up to the blocks' size.
TEST(ImageBounds, AreTightWhereWindowsAreSmall)
{
  constexpr int kSize = 256;
  std::vector<std::uint8_t> texels(kSize * kSize);
  for (int i = 0; i < kSize * kSize; ++i) texels[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(i % kSize);
  TextureView texture;
  texture.width = texture.height = kSize;
  texture.num_levels = texture.num_channels = 1;
  texture.wrap_u = texture.wrap_v = Wrap::kClamp;
  texture.levels[0] = texels.data();
  HeightImage image(nullptr, {kSize, kSize, 1, TexelFormat::kU8}, "");
  const ImageBounds bounds = image.bounds(texture);
  for (const float size : {0.004f, 0.02f, 0.1f, 0.3f}) {
    const float u[2] = {0.4f, 0.4f + size}, v[2] = {0.2f, 0.2f + size};
    const TexelRange range = image_range(texture, bounds, u, v, true, 0);
    EXPECT_LE(range.high[0] - range.low[0], 2 * size + 10.0f / kSize) << size;
    EXPECT_LE(range.low[0], 0.4f);
    EXPECT_GE(range.high[0], 0.4f + size - 1.0f / kSize);
  }
}

/// Heights that depend on bounds are cut off where there are none: so what is bounded everywhere is known to be, also over what is
/// much wider than a cell, of coordinates of which nothing is known, and of settings that vary.
TEST_F(GraphBounds, OfWhatIsBoundedEverywhereAreFinite)
{
  HardNumbers numbers(31);
  for (const Shape& shape : shapes()) {
    const bool is_pattern = (shape.op >= Op::noise_1d && shape.op <= Op::brick) || shape.op == Op::checker ||
                            shape.op == Op::grid || (shape.op >= Op::ies && shape.op <= Op::blackbody) ||
                            shape.op == Op::image || shape.op == Op::image_box || shape.op == Op::image_tiles;
    if (!is_pattern) continue;
    const auto num_inputs = static_cast<std::size_t>(test::shape_of(shape.op).num_inputs);
    // Ops of one to four dimensions come by fours.
    int num_coordinates = shape.num_varying;
    for (const Op first : {Op::noise_1d, Op::signed_noise_1d, Op::hash_1d, Op::voronoi_1d, Op::musgrave_1d}) {
      const int dimensions = static_cast<int>(shape.op) - static_cast<int>(first) + 1;
      if (dimensions >= 1 && dimensions <= 4) num_coordinates = dimensions;
    }
    for (const std::vector<std::uint16_t>& immediates : shape.immediates) {
      std::vector<std::array<Parallelogram, 8>> in(num_inputs);
      for (std::size_t i = 0; i < num_inputs; ++i) {
        // Octaves get finer; other settings are between 0 and 1.
        const bool is_lacunarity = shape.op >= Op::voronoi_1d && shape.op <= Op::voronoi_4d && i + 1 == num_inputs;
        for (Parallelogram& p : in[i]) {
          p = static_cast<int>(i) < num_coordinates      ? Parallelogram{numbers.within(-1e3f, 1e3f), 40, 30, 1e4f}
              : static_cast<int>(i) >= shape.num_varying ? Parallelogram{is_lacunarity ? 2.0f : 0.8f, 0, 0, 0}
                                                         : Parallelogram{is_lacunarity ? 2.0f : 0.8f, 0.05f, 0, 0.1f};
        }
      }
      for (const GraphRange& r : ranges_of(graph_bounds_select(), shape.op, in, immediates, &image_)) {
        const bool is_whole = r.low[0] > -kInfinity && r.high[0] < kInfinity;
        EXPECT_TRUE(is_whole) << "opcode " << static_cast<int>(shape.op) << " " << testing::PrintToString(immediates);
      }
    }
  }
}

/// Middles of points of neighbouring cells near the origin that are one when it comes to borders.
template <bool kPcg>
std::vector<std::array<float, 2>> voronoi_twins()
{
  constexpr int kCells = 1024;
  const auto points_of = [](int x, int y) {
    F8 cell[2], point[2];
    for (int k = 0; k < 8; ++k) {
      cell[0][k] = static_cast<float>(x + k);
      cell[1][k] = static_cast<float>(y);
    }
    voronoi_point<2, kPcg>(cell, point);
    return std::array<F8, 2>{cell[0] + point[0], cell[1] + point[1]};
  };
  std::vector<std::array<float, 2>> out;
  for (int y = -kCells; y < kCells; ++y) {
    for (int x = -kCells; x < kCells; x += 8) {
      const std::array<F8, 2> here = points_of(x, y), others[] = {points_of(x + 1, y), points_of(x, y + 1)};
      for (const std::array<F8, 2>& other : others) {
        const F8 across[2] = {other[0] - here[0], other[1] - here[1]};
        const F8 squared = across[0] * across[0] + across[1] * across[1];
        for (int k = 0; k < 8; ++k) {
          if (squared[k] > 0.9f * kVoronoiTwins) continue;
          out.push_back({here[0][k] + 0.5f * across[0][k], here[1][k] + 0.5f * across[1][k]});
        }
      }
    }
  }
  return out;
}

/// Of two points that are one when it comes to borders, each has borders of its own: distances to them jump between them.
/// Once in some hundred thousand cells, so that random parallelograms do not meet it.
template <bool kPcg>
void expect_jumps_are_known()
{
  const VoronoiSettings<2, kPcg> settings{
      VoronoiFeature::kDistanceToEdge, VoronoiMetric::kEuclidean, F8{}, F8{}, splat8(1.0f), kPcg ? unsigned{kVoronoiPcg} : 0u};
  HardNumbers numbers(21);
  int num_jumps = 0;
  const std::vector<std::array<float, 2>> twins = voronoi_twins<kPcg>();
  for (std::size_t round = 0; round < 20000 * twins.size(); ++round) {
    const std::array<float, 2>& twin = twins[round % twins.size()];
    const float size = std::exp2(numbers.within(-14, -6)), around = std::exp2(numbers.within(-8, -2));
    F8 cell[2], a[2], b[2], way{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      cell[axis] = splat8(std::floor(twin[axis]));
      for (int k = 0; k < 8; ++k) {
        a[axis][k] = clamp(twin[axis] - cell[axis][k] + around * numbers.within(-1, 1), 0.0f, 1.0f);
        b[axis][k] = clamp(a[axis][k] + size * numbers.within(-1, 1), 0.0f, 1.0f);
      }
      way += (a[axis] - b[axis]) * (a[axis] - b[axis]);
    }
    way = sqrt(way);
    const F8 change = abs(voronoi_edge<2>(cell, a, settings) - voronoi_edge<2>(cell, b, settings));
    const I8 is_known = voronoi_has_twins<2>(cell, a, way, settings);
    for (int k = 0; k < 8; ++k) {
      if (change[k] <= way[k] + kVoronoiEdgeRounding) continue;
      ++num_jumps;
      ASSERT_NE(is_known[k], 0) << change[k] << " in " << way[k] << " near " << twin[0] << " " << twin[1];
    }
  }
  EXPECT_GT(num_jumps, 10);
}

TEST_F(GraphBounds, OfDistancesToBordersKnowWhereTheyJump)
{
  expect_jumps_are_known<false>();
  expect_jumps_are_known<true>();
}

TEST_F(GraphBounds, OfNothingTimesTheUnknownAreUnknown)
{
  // 0 · ∞ is not a number, for which the midlevel stands.
  for (const bool is_first : {false, true}) {
    std::vector<std::array<Parallelogram, 8>> in(2);
    for (Parallelogram& p : in[is_first ? 1 : 0]) p.rest = kInfinity;
    const GraphRange range = ranges_of(graph_bounds_select(), Op::multiply, in, {}, nullptr)[0];
    EXPECT_EQ(range.low[0], -kInfinity);
    EXPECT_EQ(range.high[0], kInfinity);
  }
}

/// By how much a range is wider than what the operation does, of sums of squares over parallelograms.
double mean_excess(Op op, float size, int num_varying, float setting, float from, float to)
{
  HardNumbers numbers(7);
  const auto num_inputs = static_cast<std::size_t>(test::shape_of(op).num_inputs);
  double excess = 0;
  constexpr int kRounds = 100;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<std::array<Parallelogram, 8>> in(num_inputs);
    for (std::size_t i = 0; i < num_inputs; ++i) {
      for (Parallelogram& p : in[i]) {
        p.c = setting;
        if (static_cast<int>(i) >= num_varying) continue;
        p.c = numbers.within(from, to);
        p.d1 = size * numbers.within(-1, 1);
        p.d2 = size * numbers.within(-1, 1);
      }
    }
    const std::vector<GraphRange> ranges = ranges_of(graph_bounds_select(), op, in, {}, nullptr);
    std::array<float, 8> low, high;
    low.fill(kInfinity);
    high.fill(-kInfinity);
    constexpr int kSteps = 8;
    for (int a = 0; a <= kSteps; ++a) {
      for (int b = 0; b <= kSteps; ++b) {
        std::vector<std::vector<float>> at(num_inputs, std::vector<float>(8));
        for (std::size_t i = 0; i < num_inputs; ++i) {
          for (std::size_t k = 0; k < 8; ++k) {
            const Parallelogram& p = in[i][k];
            at[i][k] = p.c + p.d1 * (2.0f * static_cast<float>(a) / kSteps - 1) +
                       p.d2 * (2.0f * static_cast<float>(b) / kSteps - 1);
          }
        }
        const std::vector<float> out = test::run_one(graph_run_baseline, op, at)[0];
        for (std::size_t k = 0; k < 8; ++k) {
          low[k] = std::min(low[k], out[k]);
          high[k] = std::max(high[k], out[k]);
        }
      }
    }
    for (int k = 0; k < 8; ++k) {
      const auto lane = static_cast<std::size_t>(k);
      excess += static_cast<double>(ranges[0].high[k] - high[lane]) + static_cast<double>(low[lane] - ranges[0].low[k]);
    }
  }
  return excess / (8 * kRounds);
}

TEST_F(GraphBounds, OfSmoothOperationsAreTightWithTheSquareOfTheSize)
{
  struct Smooth {
    Op op;
    int num_varying;
    float size, from, to;
  };
  // Sizes at which rounding does not show.
  for (const Smooth& s :
       {Smooth{Op::multiply, 2, 0.4f, -2, 2}, Smooth{Op::sine, 1, 0.4f, -4, 4}, Smooth{Op::exponent, 1, 0.4f, -2, 2},
        Smooth{Op::square_root, 1, 0.3f, 1, 4}, Smooth{Op::divide, 2, 0.2f, 1, 3},
        Smooth{Op::signed_noise_2d, 2, 0.05f, -9, 9}, Smooth{Op::signed_noise_3d, 3, 0.05f, -9, 9}}) {
    const double wide = mean_excess(s.op, s.size, s.num_varying, 2, s.from, s.to);
    const double narrow = mean_excess(s.op, s.size / 4, s.num_varying, 2, s.from, s.to);
    constexpr double kRounding = 3e-5;  // what is left of functions that grow, whose intervals are tight
    EXPECT_LT(narrow, wide / 10 + kRounding) << static_cast<int>(s.op) << ": " << wide << " " << narrow;
  }
}

TEST_F(GraphBounds, OfNoiseHaveItsSlopes)
{
  HardNumbers numbers(9);
  for (int round = 0; round < 20000; ++round) {
    F8 p[3], moved[3], step{};
    for (F8& x : p) {
      for (int k = 0; k < 8; ++k) x[k] = numbers.within(-20, 20);
    }
    const NoiseSlopes<3> at = noise_slopes<3>(p);
    const F8 value = noise_signed<3>(p);
    const int axis = round % 3;
    constexpr float kStep = 1.0f / 256;
    for (int i = 0; i < 3; ++i) moved[i] = p[i] + (i == axis ? kStep : 0.0f);
    step = (noise_signed<3>(moved) - value) / kStep;
    for (int k = 0; k < 8; ++k) {
      ASSERT_NEAR(at.value[k], value[k], 1e-5f);
      // A secant is off by half of the second derivative times the step.
      ASSERT_NEAR(at.slope[axis][k], step[k], 0.5f * kNoiseBend[2] * kStep + 1e-2f);
    }
  }
}

/// Largest sums over a cell's corners, each with its worst gradient: what no gradients exceed.
TEST_F(GraphBounds, NoiseIsNoSteeperThanTheySay)
{
  const auto fade = [](double t) { return t * t * t * (t * (t * 6 - 15) + 10); };
  const auto fade1 = [](double t) { return 30 * t * t * (t - 1) * (t - 1); };
  const auto fade2 = [](double t) { return 60 * t * (t - 1) * (2 * t - 1); };
  constexpr double kScale[] = {.25, .6616, .982, .8344};
  constexpr int kSteps[] = {2000, 200, 40, 14};
  const auto worst = [](int dims, const double* a) {
    double m[4] = {};
    for (int i = 0; i < dims; ++i) m[i] = std::abs(a[i]);
    if (dims == 1) return 8 * m[0];
    if (dims == 2) return std::max(m[0] + 2 * m[1], m[1] + 2 * m[0]);
    // All but the least.
    return dims == 3 ? m[0] + m[1] + m[2] - std::min({m[0], m[1], m[2]})
                     : m[0] + m[1] + m[2] + m[3] - std::min({m[0], m[1], m[2], m[3]});
  };
  for (int dims = 1; dims <= 4; ++dims) {
    const int n = kSteps[dims - 1];
    double largest = 0, slope = 0, bend = 0, twist = 0;
    int total = 1;
    for (int i = 0; i < dims; ++i) total *= n + 1;
    for (int number = 0; number < total; ++number) {
      double d[4];
      for (int i = 0, rest = number; i < dims; ++i, rest /= n + 1) d[i] = static_cast<double>(rest % (n + 1)) / n;
      double sums[4] = {};
      for (int corner = 0; corner < 1 << dims; ++corner) {
        double w = 1, wx = 1, wy = 1, wxx = 1, wxy = 1, from[4];
        for (int i = 0; i < dims; ++i) {
          const int side = corner >> i & 1;
          const double f = side == 1 ? fade(d[i]) : 1 - fade(d[i]), sign = side == 1 ? 1 : -1;
          from[i] = d[i] - side;
          w *= f;
          wx *= i == 0 ? sign * fade1(d[i]) : f;
          wy *= i == 1 ? sign * fade1(d[i]) : f;
          wxx *= i == 0 ? sign * fade2(d[i]) : f;
          wxy *= i < 2 ? sign * fade1(d[i]) : f;
        }
        double a[4][4];
        for (int i = 0; i < dims; ++i) {
          a[0][i] = w * from[i];
          a[1][i] = wx * from[i] + (i == 0 ? w : 0);
          a[2][i] = wxx * from[i] + (i == 0 ? 2 * wx : 0);
          a[3][i] = wxy * from[i] + (i == 0 ? wy : 0) + (i == 1 ? wx : 0);
        }
        for (int k = 0; k < 4; ++k) sums[k] += worst(dims, a[k]);
      }
      largest = std::max(largest, sums[0]);
      slope = std::max(slope, sums[1]);
      bend = std::max(bend, sums[2]);
      if (dims > 1) twist = std::max(twist, sums[3]);
    }
    const double scale = kScale[dims - 1];
    EXPECT_LE(largest * scale, static_cast<double>(kNoiseLargest[dims - 1])) << dims;
    EXPECT_LE(slope * scale, static_cast<double>(kNoiseSlope[dims - 1])) << dims;
    EXPECT_LE(bend * scale, static_cast<double>(kNoiseBend[dims - 1])) << dims;
    EXPECT_LE(twist * scale, static_cast<double>(kNoiseTwist[dims - 1])) << dims;
    // Nor are the bounds idle.
    EXPECT_GE(slope * scale * 1.05, static_cast<double>(kNoiseSlope[dims - 1])) << dims;
  }
}

}  // namespace
}  // namespace relief
