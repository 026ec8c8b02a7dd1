// Noise, cells, terrain, bricks and checkers of value graphs against a plain implementation in double precision.
#include <gtest/gtest.h>

#include "kernel/graph/voronoi.h"
#include "tests/kernel/graph/one_operation.h"
#include "tests/oracle/procedural.h"

namespace relief {
namespace {

using test::HardNumbers;
using test::run_one;
using Op = GraphOp;

Op of_dimensions(Op first, std::size_t dims) { return static_cast<Op>(static_cast<std::size_t>(first) + dims - 1); }

std::vector<double> lane(const std::vector<std::vector<float>>& in, std::size_t count, std::size_t k)
{
  std::vector<double> p;
  for (std::size_t i = 0; i < count; ++i) p.push_back(static_cast<double>(in[i][k]));
  return p;
}

class GraphProcedural : public testing::TestWithParam<std::tuple<test::Interpreter, std::size_t>> {
 protected:
  void SetUp() override
  {
    const test::Interpreter& interpreter = std::get<0>(GetParam());
    if (!interpreter.is_runnable) GTEST_SKIP() << "no " << interpreter.name << " here";
  }
  static GraphRun run() { return std::get<0>(GetParam()).run; }
  static std::size_t dims() { return std::get<1>(GetParam()); }
  static std::vector<std::vector<float>> point(HardNumbers& numbers, float range)
  {
    std::vector<std::vector<float>> in;
    for (std::size_t i = 0; i < dims(); ++i) in.push_back(numbers.row(-range, range));
    return in;
  }
};

TEST_P(GraphProcedural, HashesAreJenkins)
{
  HardNumbers numbers(1);
  for (int round = 0; round < 2'000; ++round) {
    const auto in = numbers.lanes(dims());
    const std::vector<float> out = run_one(run(), of_dimensions(Op::hash_1d, dims()), in)[0];
    for (std::size_t k = 0; k < 8; ++k) {
      std::vector<float> key;
      for (std::size_t i = 0; i < dims(); ++i) key.push_back(in[i][k]);
      ASSERT_NEAR(static_cast<double>(out[k]), oracle::hash_unit(key), 1e-7);
    }
  }
}

TEST_P(GraphProcedural, NoiseIsPerlins)
{
  HardNumbers numbers(2);
  for (const float range : {2.0f, 100.0f, 1e5f}) {
    for (int round = 0; round < 1'000; ++round) {
      const auto in = point(numbers, range);
      const std::vector<float> out = run_one(run(), of_dimensions(Op::signed_noise_1d, dims()), in)[0];
      for (std::size_t k = 0; k < 8; ++k) {
        ASSERT_NEAR(static_cast<double>(out[k]), oracle::noise_signed(lane(in, dims(), k)), 2e-6);
      }
    }
  }
}

TEST_P(GraphProcedural, NoiseHasLatticePointsEverywhere)
{
  HardNumbers numbers(3);
  for (int round = 0; round < 500; ++round) {
    auto in = point(numbers, 1000);
    for (std::vector<float>& row : in) {
      for (float& x : row) x = std::floor(x);
    }
    const std::vector<float> out = run_one(run(), of_dimensions(Op::signed_noise_1d, dims()), in)[0];
    for (const float x : out) EXPECT_EQ(x, 0);
  }
}

TEST_P(GraphProcedural, OctavesAddUp)
{
  HardNumbers numbers(4);
  for (const bool normalize : {false, true}) {
    for (int round = 0; round < 300; ++round) {
      auto in = point(numbers, 4);
      in.push_back(numbers.row(0, 6));
      if (round % 3 == 0) {
        for (float& x : in.back()) x = std::floor(x);
      }
      in.push_back(numbers.row(0, 1));
      in.push_back(numbers.row(1, 2.5f));
      const std::vector<float> out =
          run_one(run(), of_dimensions(Op::noise_1d, dims()), in, {std::uint16_t{normalize}})[0];
      for (std::size_t k = 0; k < 8; ++k) {
        const std::vector<double> s = lane({in.end() - 3, in.end()}, 3, k);
        // Coordinates are rounded at each octave, and noise is as steep as four a unit there.
        const double tolerance = 4 * 4 * std::pow(s[2], std::ceil(s[0])) * 1e-6;
        ASSERT_NEAR(static_cast<double>(out[k]),
                    oracle::noise_fractal(lane(in, dims(), k), s[0], s[1], s[2], normalize), tolerance);
      }
    }
  }
}

TEST_P(GraphProcedural, TerrainIsMusgraves)
{
  HardNumbers numbers(5);
  for (std::uint16_t kind = 0; kind < 5; ++kind) {
    int num_off = 0;
    for (int round = 0; round < 200; ++round) {
      auto in = point(numbers, 4);
      in.push_back(numbers.row(0, 6));
      in.push_back(numbers.row(0.2f, 1));
      in.push_back(numbers.row(1, 2.2f));
      in.push_back(numbers.row(0, 1));
      in.push_back(numbers.row(0, 3));
      const std::vector<float> out = run_one(run(), of_dimensions(Op::musgrave_1d, dims()), in, {kind})[0];
      for (std::size_t k = 0; k < 8; ++k) {
        const std::vector<double> s = lane({in.end() - 5, in.end()}, 5, k);
        const double expected =
            oracle::terrain(static_cast<oracle::Terrain>(kind), lane(in, dims(), k), s[0], s[1], s[2], s[3], s[4]);
        num_off += std::abs(static_cast<double>(out[k]) - expected) > 1e-3 * std::max(1.0, std::abs(expected)) ? 1 : 0;
      }
    }
    // A hybrid's octaves end where its weight falls below a thousandth: rounding decides there.
    EXPECT_LE(num_off, kind == 2 ? 4 : 0) << kind;
  }
}

TEST_P(GraphProcedural, CellsAreWorleys)
{
  HardNumbers numbers(6);
  for (std::uint16_t feature = 0; feature < 5; ++feature) {
    for (std::uint16_t metric = 0; metric < 4; ++metric) {
      // Borders and radii have no other metric, and one coordinate has one.
      if ((feature > 2 || dims() == 1) && metric > 0) continue;
      int num_off = 0, num_all = 0;
      for (int round = 0; round < (dims() < 4 ? 60 : 20); ++round) {
        auto in = point(numbers, round % 2 == 0 ? 4.0f : 500.0f);
        in.push_back(numbers.row(0.01f, 0.5f));
        in.push_back(numbers.row(0.5f, 4));
        in.push_back(std::vector<float>(8, round % 5 == 0 ? 1.0f : numbers.within(0.1f, 1)));
        const test::Outputs out = run_one(run(), of_dimensions(Op::voronoi_1d, dims()), in, {feature, metric});
        for (std::size_t k = 0; k < 8; ++k) {
          const std::vector<double> s = lane({in.end() - 3, in.end()}, 3, k);
          const oracle::Cell expected = oracle::cells(
              lane(in, dims(), k),
              {static_cast<oracle::Cells>(feature), static_cast<oracle::Metric>(metric), s[0], s[1], s[2]});
          if (expected.margin < 1e-4) continue;
          const auto off = [&](float found, double wanted) {
            const double size = std::max(1.0, std::abs(wanted));
            return std::abs(static_cast<double>(found) - wanted) > 1e-4 * size;
          };
          bool is_off = off(out[0][k], expected.distance) || off(out[8][k], expected.distance);
          for (std::size_t i = 0; feature < 3 && i < 3; ++i) is_off = is_off || off(out[1 + i][k], expected.color[i]);
          for (std::size_t i = 0; feature < 3 && i < dims(); ++i) {
            // The only coordinate of one dimension is w.
            is_off = is_off || off(out[dims() == 1 ? 7 : 4 + i][k], expected.position[i]);
          }
          num_off += is_off ? 1 : 0;
          ++num_all;
        }
      }
      EXPECT_EQ(num_off, 0) << "feature " << feature << ", metric " << metric << " of " << num_all;
    }
  }
}

// Cells that are too far for all eight points are left out, and what nobody asks for.
TEST_P(GraphProcedural, SmoothCellsAreTheSameOfPointsTogetherAndApart)
{
  HardNumbers numbers(8);
  for (std::uint16_t metric = 0; metric < 4; ++metric) {
    for (const unsigned flags : {0u, unsigned{kVoronoiFar}, unsigned{kVoronoiPcg}}) {
      int num_off = 0;
      for (int round = 0; round < (dims() < 4 ? 40 : 8); ++round) {
        const auto middle = point(numbers, round % 2 == 0 ? 4.0f : 500.0f);
        const float spread = round % 3 == 0 ? 1.0f : 0.1f;
        std::vector<std::vector<float>> together(dims());
        for (std::size_t i = 0; i < dims(); ++i) {
          for (const float more : numbers.row(-spread, spread)) together[i].push_back(middle[i][0] + more);
        }
        const std::vector<std::vector<float>> settings = {numbers.row(0.01f, 0.5f), numbers.row(0.5f, 4),
                                                          std::vector<float>(8, round % 5 == 0 ? 1.0f : 0.4f)};
        together.insert(together.end(), settings.begin(), settings.end());
        const Op op = of_dimensions(Op::voronoi_1d, dims());
        constexpr std::uint16_t kSmooth = 2;
        const auto all_flags = static_cast<std::uint16_t>(flags);
        const auto bare_flags = static_cast<std::uint16_t>(flags | kVoronoiBare);
        const test::Outputs out = run_one(run(), op, together, {kSmooth, metric, all_flags});
        const test::Outputs bare = run_one(run(), op, together, {kSmooth, metric, bare_flags});
        for (std::size_t k = 0; k < 8; ++k) {
          auto apart = point(numbers, 1000.0f);
          for (std::size_t i = 0; i < dims(); ++i) apart[i][k] = together[i][k];
          apart.insert(apart.end(), settings.begin(), settings.end());
          const test::Outputs alone = run_one(run(), op, apart, {kSmooth, metric, all_flags});
          for (std::size_t o = 0; o < alone.size(); ++o) num_off += alone[o][k] != out[o][k] ? 1 : 0;
          num_off += bare[0][k] != out[0][k] || bare[8][k] != out[8][k] ? 1 : 0;
        }
      }
      EXPECT_EQ(num_off, 0) << "metric " << metric << ", flags " << flags;
    }
  }
}

std::string name_of(const testing::TestParamInfo<std::tuple<test::Interpreter, std::size_t>>& info)
{
  return std::get<0>(info.param).name + std::to_string(std::get<1>(info.param)) + "d";
}
INSTANTIATE_TEST_SUITE_P(All,
                         GraphProcedural,
                         testing::Combine(testing::ValuesIn(test::interpreters()),
                                          testing::Values<std::size_t>(1, 2, 3, 4)),
                         name_of);

TEST(GraphPatterns, CheckersChangeAtEveryBorder)
{
  HardNumbers numbers(7);
  for (int round = 0; round < 2'000; ++round) {
    const std::vector<std::vector<float>> in = {numbers.row(-300, 300), numbers.row(-300, 300), numbers.row(-300, 300)};
    const std::vector<float> out = run_one(graph_run_baseline, Op::checker, in)[0];
    for (std::size_t k = 0; k < 8; ++k) {
      int sum = 0;
      bool is_border = false;
      for (std::size_t i = 0; i < 3; ++i) {
        sum += static_cast<int>(std::floor(in[i][k]));
        is_border = is_border || std::abs(in[i][k] - std::round(in[i][k])) < 1e-3f;
      }
      if (is_border) continue;
      EXPECT_EQ(out[k], static_cast<float>(sum & 1));
    }
  }
}

double brick_tint(std::int64_t row, std::int64_t column)
{
  constexpr std::int64_t kWord = std::int64_t{1} << 32, kBits = (std::int64_t{1} << 31) - 1;
  const auto word = [&](std::int64_t x) { return ((x % kWord) + kWord) % kWord; };
  std::int64_t n = word(row * 65536 + (word(column) & 65535) + 1013) & kBits;
  n ^= n >> 13;
  const std::int64_t square = word(word(n * n) * 60493 + 19990303);
  // Modulo 2^32 each way, as products of 64 bits would not fit.
  const std::int64_t product =
      word(word((n & 65535) * square) + word(word((n >> 16) * square) << 16) + 1376312589) & kBits;
  return static_cast<double>(product) / 2147483648.0;
}

TEST(GraphPatterns, BricksAreInTheirRows)
{
  HardNumbers numbers(8);
  int num_checked = 0;
  for (int round = 0; round < 3'000; ++round) {
    const std::vector<std::vector<float>> in = {numbers.row(-20, 20),    numbers.row(-20, 20), numbers.row(0, 0.1f),
                                                numbers.row(0, 1),       numbers.row(-1, 1),   numbers.row(0.2f, 1),
                                                numbers.row(0.2f, 0.6f), numbers.row(0, 1),    numbers.row(0.5f, 2)};
    const auto shifted = static_cast<std::uint16_t>(numbers.word() % 4),
               squashed = static_cast<std::uint16_t>(numbers.word() % 4);
    const test::Outputs out = run_one(graph_run_baseline, Op::brick, in, {shifted, squashed});
    for (std::size_t k = 0; k < 8; ++k) {
      const std::vector<double> a = lane(in, 9, k);
      double width = a[5], shift = 0;
      const double row = std::floor(a[1] / a[6]);
      if (shifted > 0 && squashed > 0) {
        if (std::fmod(row, squashed) == 0) width *= a[8];
        if (std::fmod(row, shifted) == 0) shift = width * a[7];
      }
      const double column = std::floor((a[0] + shift) / width);
      const double x = a[0] + shift - column * width, y = a[1] - row * a[6];
      const double inside = std::min({x, y, width - x, a[6] - y});
      // Rounding decides which brick it is, and whether what is sharp is mortar.
      if (inside < 1e-4 || a[2] < 1e-3 || a[3] < 1e-2 || std::abs(inside - a[2]) < 1e-4) continue;
      ++num_checked;
      const double t = std::clamp((1 - inside / a[2]) / a[3], 0.0, 1.0);
      const double tint = brick_tint(static_cast<std::int64_t>(row), static_cast<std::int64_t>(column));
      EXPECT_NEAR(static_cast<double>(out[0][k]), std::clamp(tint + a[4], 0.0, 1.0), 1e-6);
      EXPECT_NEAR(static_cast<double>(out[1][k]), inside >= a[2] ? 0 : t * t * (3 - 2 * t),
                  5e-2 * (a[3] < 0.1 ? 1 : 0.1));
    }
  }
  EXPECT_GT(num_checked, 10'000);
}

}  // namespace
}  // namespace relief
