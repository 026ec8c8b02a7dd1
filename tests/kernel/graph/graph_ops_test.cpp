// Operations of value graphs against their definitions in double precision, for numbers of all kinds; and the interpreters of
// both instruction sets against each other.
#include <gtest/gtest.h>

#include <functional>

#include "tests/kernel/graph/one_operation.h"

namespace relief {
namespace {

using test::HardNumbers;
using test::is_like;
using test::run_one;
using Op = GraphOp;
using In = const double*;

struct Definition {
  Op op;
  std::function<double(In)> value;
  /// Largest of the numbers on the way, which rounding is relative to; empty: the value.
  std::function<double(In)> size = {};
};

const Definition kDefinitions[] = {
    {Op::copy, [](In x) { return x[0]; }},
    {Op::add, [](In x) { return x[0] + x[1]; }},
    {Op::subtract, [](In x) { return x[0] - x[1]; }},
    {Op::multiply, [](In x) { return x[0] * x[1]; }},
    {Op::divide, [](In x) { return x[1] == 0 ? 0 : x[0] / x[1]; }},
    {Op::multiply_add, [](In x) { return x[0] * x[1] + x[2]; },
     [](In x) { return std::abs(x[0] * x[1]) + std::abs(x[2]); }},
    {Op::minimum, [](In x) { return x[0] < x[1] ? x[0] : x[1]; }},
    {Op::maximum, [](In x) { return x[0] > x[1] ? x[0] : x[1]; }},
    {Op::less_than, [](In x) { return x[0] < x[1] ? 1 : 0; }},
    {Op::greater_than, [](In x) { return x[0] > x[1] ? 1 : 0; }},
    {Op::equal, [](In x) { return x[0] == x[1] ? 1 : 0; }},
    {Op::select, [](In x) { return x[0] != 0 ? x[1] : x[2]; }},
    {Op::floor, [](In x) { return std::floor(x[0]); }},
    {Op::ceil, [](In x) { return std::ceil(x[0]); }},
    {Op::absolute, [](In x) { return std::abs(x[0]); }},
    {Op::sign, [](In x) { return x[0] > 0   ? 1
                                 : x[0] < 0 ? -1
                                            : 0; }},
    {Op::square_root, [](In x) { return x[0] > 0 ? std::sqrt(x[0]) : 0; }},
    {Op::power,
     [](In x) {
       const bool is_whole = x[1] == std::trunc(x[1]) && x[1] >= -0x1p31 && x[1] < 0x1p31;
       return x[0] < 0 && !is_whole ? 0.0 : std::pow(x[0], x[1]);
     }},
    {Op::logarithm, [](In x) { return x[0] <= 0 || x[1] <= 0 || x[1] == 1 ? 0 : std::log(x[0]) / std::log(x[1]); }},
    {Op::exponent, [](In x) { return std::exp(x[0]); }},
    {Op::modulo, [](In x) { return x[1] == 0 ? 0 : std::fmod(x[0], x[1]); }},
    {Op::sine, [](In x) { return std::sin(x[0]); }},
    {Op::cosine, [](In x) { return std::cos(x[0]); }},
    {Op::tangent, [](In x) { return std::tan(x[0]); }},
    {Op::arcsine, [](In x) { return std::asin(x[0] > -1 ? std::min(x[0], 1.0) : -1); }},
    {Op::arccosine, [](In x) { return std::acos(x[0] > -1 ? std::min(x[0], 1.0) : -1); }},
    {Op::arctangent, [](In x) { return std::atan(x[0]); }},
    {Op::arctangent2, [](In x) { return std::atan2(x[0], x[1]); }},
    {Op::sinh, [](In x) { return std::sinh(x[0]); }},
    {Op::cosh, [](In x) { return std::cosh(x[0]); }},
    {Op::tanh, [](In x) { return std::tanh(x[0]); }},
};

class GraphOps : public testing::TestWithParam<test::Interpreter> {
 protected:
  void SetUp() override
  {
    if (!GetParam().is_runnable) GTEST_SKIP() << "no " << GetParam().name << " here";
  }
};

TEST_P(GraphOps, AreTheirDefinitions)
{
  HardNumbers numbers(1);
  for (const Definition& d : kDefinitions) {
    int num_wrong = 0;
    for (int round = 0; round < 20'000 && num_wrong < 3; ++round) {
      const auto in = numbers.lanes(static_cast<std::size_t>(test::shape_of(d.op).num_inputs));
      const std::vector<float> out = run_one(GetParam().run, d.op, in)[0];
      for (std::size_t k = 0; k < 8; ++k) {
        double x[3] = {};
        for (std::size_t i = 0; i < in.size(); ++i) x[i] = static_cast<double>(in[i][k]);
        const double expected = d.value(x), size = d.size ? d.size(x) : std::abs(expected);
        // Denormal numbers keep fewer digits.
        if (is_like(static_cast<double>(out[k]), expected, 1e-6 * size + 1e-44)) continue;
        if (d.op == Op::multiply_add && size > 3.4e38) continue;  // the product alone is too large without fusion
        ADD_FAILURE() << "opcode " << static_cast<int>(d.op) << " of " << x[0] << ", " << x[1] << ", " << x[2] << ": "
                      << out[k] << " for " << expected;
        ++num_wrong;
      }
    }
  }
}

// Closed forms that know no sectors.
TEST_P(GraphOps, ColoursAreTheirDefinitions)
{
  HardNumbers numbers(2);
  const auto hue_of = [](In c, double most, double range) {
    if (range == 0) return 0.0;
    const double h = most == c[0]   ? (c[1] - c[2]) / range
                     : most == c[1] ? (c[2] - c[0]) / range + 2
                                    : (c[0] - c[1]) / range + 4;
    return (h < 0 ? h + 6 : h) / 6;
  };
  const auto most_of = [](In c) { return std::max({c[0], c[1], c[2]}); };
  const auto least_of = [](In c) { return std::min({c[0], c[1], c[2]}); };
  const auto modulo = [](double a, double b) { return a - b * std::floor(a / b); };
  const auto hsv_channel = [&](In c, double n) {
    const double k = modulo(n + 6 * c[0], 6);
    return c[2] - c[2] * c[1] * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  const auto hsl_channel = [&](In c, double n) {
    const double k = modulo(n + 12 * c[0], 12);
    return c[2] - c[1] * std::min(c[2], 1 - c[2]) * std::clamp(std::min(k - 3, 9 - k), -1.0, 1.0);
  };
  struct Conversion {
    Op op;
    std::function<std::array<double, 3>(In)> value;
  };
  const Conversion conversions[] = {
      {Op::rgb_to_hsv,
       [&](In c) -> std::array<double, 3> {
         const double most = most_of(c), range = most - least_of(c);
         return {hue_of(c, most, range), most == 0 ? 0 : range / most, most};
       }},
      {Op::hsv_to_rgb,
       [&](In c) -> std::array<double, 3> {
         return {hsv_channel(c, 5), hsv_channel(c, 3), hsv_channel(c, 1)};
       }},
      {Op::rgb_to_hsl,
       [&](In c) -> std::array<double, 3> {
         const double most = most_of(c), range = most - least_of(c), l = (most + least_of(c)) / 2;
         return {hue_of(c, most, range), range == 0 ? 0 : range / (1 - std::abs(2 * l - 1)), l};
       }},
      {Op::hsl_to_rgb,
       [&](In c) -> std::array<double, 3> {
         return {hsl_channel(c, 0), hsl_channel(c, 8), hsl_channel(c, 4)};
       }},
  };
  for (const Conversion& c : conversions) {
    for (int round = 0; round < 5'000; ++round) {
      std::vector<std::vector<float>> in = {numbers.row(0, 1), numbers.row(0, 1), numbers.row(0, 1)};
      if (round % 4 == 0) in[round / 4 % 3] = in[(round / 4 + 1) % 3];  // two alike
      if (round % 50 == 0) in[0] = in[1] = in[2];
      const test::Outputs out = run_one(GetParam().run, c.op, in);
      for (std::size_t k = 0; k < 8; ++k) {
        double x[3];
        for (std::size_t i = 0; i < 3; ++i) x[i] = static_cast<double>(in[i][k]);
        const std::array<double, 3> expected = c.value(x);
        // Hues of what is nearly grey, and saturations of what is nearly black or white, lose digits.
        const double range = most_of(x) - least_of(x);
        const double tolerance = c.op == Op::rgb_to_hsv   ? 1e-6 + 2e-7 / (range + 1e-9)
                                 : c.op == Op::rgb_to_hsl ? 1e-6 + 2e-7 / (range + 1e-9) +
                                                                4e-7 / (1e-7 + std::min(expected[2], 1 - expected[2]))
                                                          : 2e-6;
        for (std::size_t i = 0; i < 3; ++i) {
          ASSERT_NEAR(static_cast<double>(out[i][k]), expected[i], tolerance)
              << static_cast<int>(c.op) << " of " << x[0] << ", " << x[1] << ", " << x[2];
        }
      }
    }
  }
}

TEST_P(GraphOps, TablesAreInterpolated)
{
  HardNumbers numbers(3);
  for (int round = 0; round < 2'000; ++round) {
    const std::size_t entries = 1 + numbers.word() % 9, before = numbers.word() % 5;
    const bool interpolated = numbers.word() % 2 == 0, goes_on = numbers.word() % 2 == 0;
    std::vector<float> table(before + entries);
    for (float& x : table) x = numbers.within(-2, 2);
    const auto in = numbers.lanes(1);
    const std::vector<std::uint16_t> immediates = {static_cast<std::uint16_t>(before), 0,
                                                   static_cast<std::uint16_t>(entries), interpolated, goes_on};
    const std::vector<float> out = run_one(GetParam().run, Op::table, in, immediates, nullptr, table)[0];
    const float* row = table.data() + before;
    const auto at = [&](std::size_t i) { return static_cast<double>(row[i]); };
    const double last = static_cast<double>(entries - 1);
    for (std::size_t k = 0; k < 8; ++k) {
      const double x = static_cast<double>(in[0][k]), place = x > 0 ? std::min(x, 1.0) * last : 0;
      const auto i = static_cast<std::size_t>(place);
      double expected = interpolated && i + 1 < entries ? at(i) + (at(i + 1) - at(i)) * (place - double(i)) : at(i);
      double size = 2;
      if (goes_on && entries > 1 && (x < 0 || x > 1)) {
        const double slope = x < 0 ? at(1) - at(0) : at(entries - 1) - at(entries - 2);
        expected = x < 0 ? at(0) + slope * x * last : at(entries - 1) + slope * (x - 1) * last;
        size += std::abs(expected);
      }
      // Without interpolation rounding of the place decides at its steps.
      if (!interpolated && std::abs(place - std::round(place)) < 1e-5) continue;
      EXPECT_TRUE(is_like(static_cast<double>(out[k]), expected, 4e-6 * size))
          << out[k] << " for " << expected << " at " << x << " of " << entries;
    }
  }
}

TEST_P(GraphOps, FresnelIsThatOfADielectric)
{
  HardNumbers numbers(4);
  for (int round = 0; round < 5'000; ++round) {
    const std::vector<std::vector<float>> in = {numbers.row(-1, 1), numbers.row(0.3f, 4)};
    const std::vector<float> out = run_one(GetParam().run, Op::fresnel, in)[0];
    for (std::size_t k = 0; k < 8; ++k) {
      const double c = std::abs(static_cast<double>(in[0][k])), eta = static_cast<double>(in[1][k]);
      const double g_squared = eta * eta - 1 + c * c;
      if (std::abs(g_squared) < 1e-3) continue;  // at total reflection it is as steep as a root
      double expected = 1;
      if (g_squared > 0) {
        const double g = std::sqrt(g_squared), a = (g - c) / (g + c), b = (c * (g + c) - 1) / (c * (g - c) + 1);
        expected = 0.5 * a * a * (1 + b * b);
      }
      EXPECT_NEAR(static_cast<double>(out[k]), expected, 2e-5) << c << ", " << eta;
    }
  }
}

TEST_P(GraphOps, ImagesAreLookedUpWithVUp)
{
  const unsigned char texels[] = {0, 1, 2, 3, 4, 5, 6, 7};
  TextureView textures[2];
  textures[1].levels[0] = texels;
  textures[1].width = 4, textures[1].height = 2, textures[1].num_levels = 1, textures[1].num_channels = 1;
  textures[1].filter = TexelFilter::kNearest;
  const std::vector<std::vector<float>> in = {{0.1f, 0.3f, 0.6f, 0.9f, 0.1f, 0.3f, 0.6f, 0.9f},
                                              {0.9f, 0.9f, 0.9f, 0.9f, 0.1f, 0.1f, 0.1f, 0.1f},
                                              std::vector<float>(8, 0.0f)};
  const test::Outputs out = run_one(GetParam().run, Op::image, in, {1}, textures);
  for (std::size_t k = 0; k < 8; ++k) {
    EXPECT_FLOAT_EQ(out[0][k], static_cast<float>(k) / 255.0f);
    EXPECT_EQ(out[3][k], 1);
  }
}

TEST_P(GraphOps, ImagesAreReadAtAnyCoordinates)
{
  const unsigned char texels[] = {0, 255, 64, 128, 32, 8};
  HardNumbers numbers(5);
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kMirror, Wrap::kClamp}) {
    for (const TexelFilter filter : {TexelFilter::kNearest, TexelFilter::kLinear}) {
      TextureView texture;
      texture.levels[0] = texels;
      texture.width = 3, texture.height = 2, texture.num_levels = 1, texture.num_channels = 1;
      texture.wrap_u = texture.wrap_v = wrap, texture.filter = filter;
      for (int round = 0; round < 2'000; ++round) {
        for (const std::vector<float>& channel :
             run_one(GetParam().run, Op::image, numbers.lanes(3), {0, 0}, &texture)) {
          for (const float x : channel) EXPECT_TRUE(x >= 0 && x <= 1) << x;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, GraphOps, testing::ValuesIn(test::interpreters()), [](const auto& each) {
  return std::string(each.param.name);
});

/// Choices of an operation's immediates: all for modes, some for numbers.
std::vector<std::vector<std::uint16_t>> immediates_of(Op op)
{
  std::vector<std::vector<std::uint16_t>> out;
  if (op >= Op::noise_1d && op <= Op::noise_4d) return {{0}, {1}};
  if (op >= Op::musgrave_1d && op <= Op::musgrave_4d) return {{0}, {1}, {2}, {3}, {4}};
  if (op == Op::table) return {{0, 0, 4, 1, 1}, {0, 0, 4, 0, 0}};
  if (op == Op::grid) return {{0, 0, 5, 7}, {0, 0, 1, 1}};
  if (op == Op::ies) return {{0, 0, 3, 5}};
  if (op == Op::brick) return {{0, 2}, {2, 0}, {1, 1}, {2, 3}, {1000, 1000}};
  if (op >= Op::voronoi_1d && op <= Op::voronoi_4d) {
    for (std::uint16_t feature = 0; feature < 5; ++feature) {
      for (std::uint16_t metric = 0; metric < 4; ++metric) out.push_back({feature, metric});
    }
    return out;
  }
  return {{}};
}

// No trap, no endless loop, and numbers where the other has numbers, whatever comes in.
TEST(GraphInterpreters, TakeAnyNumbers)
{
  HardNumbers numbers(6);
  const unsigned char texels[] = {0, 255, 64, 128, 32, 8};
  TextureView texture;
  texture.levels[0] = texels;
  texture.width = 3, texture.height = 2, texture.num_levels = 1, texture.num_channels = 1;
  const std::vector<float> table(4096, 0.0f);
  std::vector<test::Interpreter> others = test::interpreters();
  std::erase_if(others, [](const auto& other) { return !other.is_runnable || other.run == graph_run_baseline; });
  for (int i = 0; i < static_cast<int>(std::size(kGraphOpShapes)); ++i) {
    const Op op = static_cast<Op>(i);
    const bool is_slow = op >= Op::voronoi_1d && op <= Op::musgrave_4d;
    for (const std::vector<std::uint16_t>& immediates : immediates_of(op)) {
      int num_apart = 0, num_all = 0;
      for (int round = 0; round < (is_slow ? 100 : 1000); ++round) {
        const auto in = numbers.lanes(static_cast<std::size_t>(test::shape_of(op).num_inputs));
        const test::Outputs baseline = run_one(graph_run_baseline, op, in, immediates, &texture, table);
        for (const test::Interpreter& other : others) {
          const test::Outputs outputs = run_one(other.run, op, in, immediates, &texture, table);
          for (std::size_t o = 0; o < baseline.size(); ++o) {
            for (std::size_t k = 0; k < 8; ++k) {
              const double a = static_cast<double>(baseline[o][k]), b = static_cast<double>(outputs[o][k]);
              const bool is_moderate =
                  std::all_of(in.begin(), in.end(), [k](const auto& row) { return std::abs(row[k]) <= 100; });
              if (!is_moderate && std::isfinite(a) && std::isfinite(b)) continue;
              ++num_all;
              num_apart += is_like(a, b, 1e-4 * std::max(1.0, std::abs(b))) ? 0 : 1;
            }
          }
        }
      }
      // Fusion decides which cell of a lattice a point is in, and what is left where numbers cancel.
      EXPECT_LE(num_apart, num_all / 50) << "opcode " << i << ", " << (immediates.empty() ? 0 : immediates[0]);
    }
  }
}

TEST(GraphInterpreters, StayWithinWhatTheyPromise)
{
  HardNumbers numbers(7);
  const auto check = [&](Op op, const std::vector<std::uint16_t>& immediates, std::size_t num_checked, double low,
                         double high, const auto& change) {
    for (int round = 0; round < 500; ++round) {
      auto in = numbers.lanes(static_cast<std::size_t>(test::shape_of(op).num_inputs));
      change(in);
      const test::Outputs out = run_one(graph_run_baseline, op, in, immediates);
      for (std::size_t o = 0; o < num_checked; ++o) {
        for (const float x : out[o]) {
          EXPECT_TRUE(static_cast<double>(x) >= low && static_cast<double>(x) <= high)
              << "opcode " << static_cast<int>(op) << ": " << x;
        }
      }
    }
  };
  const auto unchanged = [](auto&) {};
  for (int d = 1; d <= 4; ++d) {
    const auto of = [d](Op first) { return static_cast<Op>(static_cast<int>(first) + d - 1); };
    check(of(Op::hash_1d), {}, 1, 0, 1, unchanged);
    check(of(Op::signed_noise_1d), {}, 1, -1.2, 1.2, unchanged);
    // Detail may be anything, the rest is a texture's.
    check(of(Op::noise_1d), {1}, 1, -0.1, 1.1, [&](auto& in) {
      in[static_cast<std::size_t>(d) + 1] = numbers.row(0, 1);
      in[static_cast<std::size_t>(d) + 2] = numbers.row(1, 4);
    });
    const auto of_cells = [&](auto& in) {
      in.resize(static_cast<std::size_t>(d) + 2);
      in.push_back(numbers.row(0, 1));
    };
    check(of(Op::voronoi_1d), {0, 0}, 4, 0, 8, of_cells);
    check(of(Op::voronoi_1d), {4, 0}, 1, 0, 4, of_cells);
  }
  check(Op::brick, {2, 2}, 2, 0, 1, unchanged);
  check(Op::fresnel, {}, 1, 0, 1.0001, [&](auto& in) {
    in[0] = numbers.row(-1, 1);
    in[1] = numbers.row(0.01f, 100);
  });
}

}  // namespace
}  // namespace relief
