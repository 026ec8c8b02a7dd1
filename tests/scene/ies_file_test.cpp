// Luminaires of IESNA files: what symmetry leaves out, interpolation against its definition in double, and that whatever is
// wrong with a file ends in one SceneError.
#include "scene/graph/ies_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "kernel/graph/ies.h"
#include "scene/diagnostics.h"

namespace relief {
namespace {

/// A file of type C, B or A whose values are all different.
std::string file_of(const std::string& vertical, const std::string& horizontal, int type = 1)
{
  const auto num = [](const std::string& list) { return 1 + std::count(list.begin(), list.end(), ' '); };
  const auto num_v = num(vertical), num_h = num(horizontal);
  std::string text = "IESNA:LM-63-2002\r\n[TEST] none\r\nTILT=NONE\r\n1 1000 2 " + std::to_string(num_v) + ' ' +
                     std::to_string(num_h) + ' ' + std::to_string(type) + " 2 0.1,0.2,0.3\r\n0.5 1 50\r\n" + vertical +
                     "\r\n" + horizontal + "\r\n";
  for (std::int64_t h = 0; h < num_h; ++h) {
    for (std::int64_t v = 0; v < num_v; ++v) text += std::to_string(10 * h + v + 1) + ' ';
    text += "\r\n";
  }
  return text;
}

IesProfile parsed(const std::string& text) { return ies_parse(text, "scene.gltf", "/place/uri"); }

/// What is wrong with a file.
std::string complaint(const std::string& text)
{
  try {
    parsed(text);
  } catch (const SceneError& error) {
    EXPECT_EQ(error.file, "scene.gltf");
    EXPECT_EQ(error.json_path, "/place/uri");
    EXPECT_NE(error.expected.find("an IES file with "), std::string::npos) << error.expected;
    return error.expected + ", found " + error.found;
  }
  return "nothing";
}

void expect_angles(const std::vector<double>& found, const std::vector<double>& expected)
{
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-9) << i;
}

/// Candelas of a row's first value.
std::vector<double> first_values(const IesProfile& p)
{
  std::vector<double> out;
  for (const auto& row : p.rows) {
    out.push_back(std::round(static_cast<double>(row.front()) / IesProfile::kWattsPerCandela));
  }
  return out;
}

TEST(IesFile, CandelasAreScaledByAllFactors)
{
  const IesProfile p = parsed(file_of("0 45 90", "0 120 240 360"));
  ASSERT_EQ(p.rows.size(), 4u);
  // 2 × 0.5 × 1.
  EXPECT_FLOAT_EQ(p.rows[1][2], static_cast<float>(13 * IesProfile::kWattsPerCandela));
}

TEST(IesFile, QuadrantsAndHalvesAreMirrored)
{
  const IesProfile quadrant = parsed(file_of("0 90", "0 30 90"));
  expect_angles(quadrant.horizontal, {0, 30, 90, 150, 180, 210, 270, 330, 360});
  EXPECT_EQ(first_values(quadrant), (std::vector<double>{1, 11, 21, 11, 1, 11, 21, 11, 1}));
  const IesProfile half = parsed(file_of("0 90", "0 90 180"));
  expect_angles(half.horizontal, {0, 90, 180, 270, 360});
  const IesProfile turned = parsed(file_of("0 90", "90 180 270"));
  EXPECT_EQ(turned.horizontal, half.horizontal);
  const IesProfile plane = parsed(file_of("0 90", "0"));
  expect_angles(plane.horizontal, {0, 360});
  const IesProfile open = parsed(file_of("0 90", "0 90 180 270"));
  expect_angles(open.horizontal, {0, 90, 180, 270, 360});
  EXPECT_EQ(first_values(open).back(), 1);
}

TEST(IesFile, TypeBIsTurnedAndTypeAIsSeenFromTheFront)
{
  const IesProfile b = parsed(file_of("0 40 90", "-90 0 90", 2));
  expect_angles(b.horizontal, {0, 50, 90, 130, 180});
  expect_angles(b.vertical, {0, 90, 180});
  EXPECT_EQ(first_values(b), (std::vector<double>{3, 2, 1, 2, 3}));
  const IesProfile a = parsed(file_of("-90 0 90", "0 45 90", 3));
  expect_angles(a.vertical, {0, 90, 180});
  expect_angles(a.horizontal, {90, 135, 180, 225, 270});
  EXPECT_EQ(first_values(a), (std::vector<double>{21, 11, 1, 11, 21}));
}

TEST(IesFile, TiltsAreSkipped)
{
  std::string text = file_of("0 90", "0");
  text.replace(text.find("NONE"), 4, "INCLUDE\n1\n2\n0 90\n1.0 0.5");
  EXPECT_EQ(parsed(text).rows, parsed(file_of("0 90", "0")).rows);
}

double cubic(const double v[4], double x)
{
  // Hermite's, with half of the differences across as slopes.
  const double m0 = (v[2] - v[0]) / 2, m1 = (v[3] - v[1]) / 2;
  return (2 * x * x * x - 3 * x * x + 1) * v[1] + (x * x * x - 2 * x * x + x) * m0 +
         (-2 * x * x * x + 3 * x * x) * v[2] + (x * x * x - x * x) * m1;
}

TEST(IesFile, LinesMayEndWithEitherOfTheirEnds)
{
  const std::string text = file_of("0 90", "0 90 180 270");
  for (const char end : {'\r', '\n'}) {
    std::string other;
    for (const char c : text) {
      if (c == '\n') other += end;
      if (c != '\n' && c != '\r') other += c;
    }
    const IesProfile p = parsed(other), q = parsed(text);
    EXPECT_EQ(p.vertical, q.vertical);
    EXPECT_EQ(p.horizontal, q.horizontal);
    EXPECT_EQ(p.rows, q.rows);
  }
  // The words in the middle of a line are no line.
  EXPECT_NE(complaint("IESNA\r[OTHER] TILT=NONE\r1 1 1 2 1 1 2 0 0 0 1 1 1 0 90 0 1 2").find("a line TILT="),
            std::string::npos);
}

TEST(IesFile, OfASingleVerticalAngleIsDark)
{
  const IesProfile p = parsed(file_of("0", "0"));
  ASSERT_GE(p.vertical.size(), 2u);
  for (const std::vector<float>& row : p.rows) {
    for (const float value : row) EXPECT_EQ(value, 0.0f);
  }
}

TEST(IesFile, InterpolationIsThatOfCatmullAndRom)
{
  const IesProfile p = parsed(file_of("0 20 50 110 180", "0 40 90 200 300 360"));
  const std::vector<float> table = ies_table(p, IesEnds::k34);
  const int num_h = static_cast<int>(p.horizontal.size()), num_v = static_cast<int>(p.vertical.size());
  ASSERT_EQ(static_cast<int>(table.size()), ies_table_size(num_h, num_v));
  constexpr double kRadians = 3.14159265358979 / 180;
  for (int h = 0; h + 1 < num_h; ++h) {
    for (int v = 0; v + 1 < num_v; ++v) {
      for (const double x : {0.0, 0.3, 0.8}) {
        double along[4];
        for (int i = 0; i < 4; ++i) {
          // Around the circle the last row is the first; straight down the next value stands for the one beyond, straight up the last.
          const int row = (h - 1 + i + num_h - 1) % (num_h - 1);
          double across[4];
          for (int k = 0; k < 4; ++k) {
            const int column = v - 1 + k;
            const int inside = column < 0 ? 1 : column == num_v ? num_v - 1 : column;
            const int last = h - 1 + i == num_h - 1 ? num_h - 1 : row;
            across[k] = static_cast<double>(p.rows[static_cast<std::size_t>(last)][static_cast<std::size_t>(inside)]);
          }
          along[i] = cubic(across, x);
        }
        const auto between = [x](const std::vector<double>& angles, int i) {
          const auto n = static_cast<std::size_t>(i);
          return static_cast<float>((angles[n] + x * (angles[n + 1] - angles[n])) * kRadians);
        };
        const double expected = std::max(0.0, cubic(along, x));
        const float found = ies_eval(table.data(), num_h, num_v, between(p.horizontal, h), between(p.vertical, v));
        EXPECT_NEAR(static_cast<double>(found), expected, 2e-5 * (1 + std::abs(expected))) << h << ' ' << v << ' ' << x;
      }
    }
  }
}

TEST(IesFile, EndsAreThoseOfTheVersions)
{
  IesProfile p = parsed(file_of("0 90 180", "0"));
  p.rows = {{8, 8, 8}, {8, 8, 8}};
  const auto at = [&](IesEnds ends, float h, float v) {
    return static_cast<double>(ies_eval(ies_table(p, ends).data(), 2, 3, h, v)) / 8;
  };
  // Of four values of which the outer ones are 0 the middle is 9/8.
  EXPECT_NEAR(at(IesEnds::k34, kPi, 0.8f), 1, 1e-6);
  EXPECT_NEAR(at(IesEnds::k43, kPi, 0.8f), 1.125, 1e-6);
  EXPECT_NEAR(at(IesEnds::k52, kPi, 0.8f), 1, 1e-6);
  EXPECT_NEAR(at(IesEnds::k43, kPi, 0.75f * kPi), 1.125 * 1.0625, 1e-5);
}

TEST(IesFile, ThereIsNothingOutsideOfTheAngles)
{
  const IesProfile p = parsed(file_of("0 45 90", "0"));
  const std::vector<float> table = ies_table(p, IesEnds::k34);
  const auto at = [&](float h, float v) { return ies_eval(table.data(), 2, 3, h, v); };
  EXPECT_GT(at(1, 1.5f), 0);
  EXPECT_EQ(at(1, 1.6f), 0);
  EXPECT_EQ(at(7, 1), 0);
  EXPECT_EQ(at(std::numeric_limits<float>::quiet_NaN(), 1), 0);
  EXPECT_EQ(at(1, std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(IesFile, BrokenFilesAreNamed)
{
  const std::string good = file_of("0 45 90", "0 90");
  EXPECT_EQ(complaint(good), "nothing");
  EXPECT_EQ(complaint(""), "an IES file with a line TILT=…, found none");
  EXPECT_EQ(complaint("TILT=NONE"), "an IES file with a number of lamps, found its end");
  EXPECT_EQ(complaint(file_of("0 90 45", "0")), "an IES file with vertical angles that ascend, found 45 after 90");
  EXPECT_EQ(complaint(file_of("0 90", "0 0")), "an IES file with horizontal angles that ascend, found 0 after 0");

  EXPECT_EQ(complaint(file_of("0 1e9", "0")), "an IES file with vertical angles within 360°, found 1e+09");
  EXPECT_EQ(complaint(file_of("0 90", "0", 4)), "an IES file with a photometric type from 1 to 3, found 4");
  const auto with = [&good](const std::string& what, const std::string& instead) {
    std::string text = good;
    return complaint(text.replace(text.find(what), what.size(), instead));
  };
  EXPECT_EQ(with("1 1000 2 3 2", "1 1000 2 4000 4000"), "an IES file with at most 1,048,576 values, found 16000000");
  EXPECT_EQ(with("1 1000 2 3 2", "1 1000 2 3 -2"),
            "an IES file with a number of horizontal angles from 1 to 4096, found -2");
  EXPECT_EQ(with("1 1000 2 3 2", "1 1000 2 3.5 2"),
            "an IES file with a number of vertical angles from 1 to 4096, found 3.5");
  EXPECT_EQ(with("0.5 1 50", "nan 1 50"), "an IES file with a ballast factor, found \"nan\"");
  EXPECT_EQ(with("0.5 1 50", "1e999 1 50"), "an IES file with a ballast factor, found \"1e999\"");
  EXPECT_EQ(with("0.5 1 50", "0x10 1 50"), "an IES file with a ballast factor, found \"0x10\"");
}

TEST(IesFile, WhateverIsCutOffOrChangedIsAnErrorOrAProfile)
{
  std::string good = file_of("0 45 90 180", "0 30 90");
  for (std::size_t length = 0; length < good.size(); ++length) complaint(good.substr(0, length));
  std::uint32_t random = 1;
  for (int run = 0; run < 20000; ++run) {
    std::string text = good;
    for (int change = 0; change < 3; ++change) {
      random = random * 1664525u + 1013904223u;
      constexpr char kBytes[] = "0123456789 .-+eE\n,\0\xffTN";
      text[(random >> 8) % text.size()] = kBytes[(random >> 3) % (sizeof(kBytes) - 1)];
    }
    try {
      const IesProfile p = parsed(text);
      const std::vector<float> table = ies_table(p, static_cast<IesEnds>(run % 3));
      const auto num_h = static_cast<int>(p.horizontal.size()), num_v = static_cast<int>(p.vertical.size());
      ASSERT_EQ(static_cast<int>(table.size()), ies_table_size(num_h, num_v));
      const float found = ies_eval(table.data(), num_h, num_v, 1.0f, 0.5f);
      ASSERT_TRUE(found >= 0) << text;
    } catch (const SceneError&) {
    }
  }
}

}  // namespace
}  // namespace relief
