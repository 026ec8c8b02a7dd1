// Every way of tracing displaced triangles, compiled for every instruction set this machine has, against the oracle.
#include <gtest/gtest.h>

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "tests/displacement/hard_cases.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

std::string test_name_of(std::string text)
{
  for (char& c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return text;
}

/// One judge for each instruction set of a method.
std::vector<Judge> judges_of(TraversalMethod method)
{
  std::vector<Judge> judges{Judge(method, traversal_table_baseline())};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    judges.emplace_back(method, traversal_table_avx2());
  return judges;
}

/// Prints figures, also of a test that passes: they are what the documentation quotes.
void report(const std::string& label, const Judgement& judgement)
{
  std::cout << "[ figures  ] " << label << ": " << judgement.text() << "\n";
}

constexpr int kRaysPerCase = 40;
constexpr HeightFormat kFormats[] = {HeightFormat::kFloat, HeightFormat::kU16, HeightFormat::kFloat, HeightFormat::kU8};

/// @param judges   all of them answer the same rays, so that the oracle is asked once
void judge_random_cases(std::vector<Judge>& judges, std::uint64_t first_case, std::uint64_t num_cases)
{
  for (std::uint64_t number = first_case; number < first_case + num_cases; ++number) {
    std::mt19937_64 random(number);
    RandomCase drawn = random_case(random, kRaysPerCase);
    const HeightFormat format = kFormats[number % 4];
    drawn.map = stored_heights(drawn.map, format);
    const TracedCase traced({drawn.triangle}, drawn.map, format);
    const JudgedTriangle triangle(drawn.triangle, drawn.map);
    for (std::size_t k = 0; k < drawn.rays.size(); ++k) {
      const std::vector<oracle::Hit> roots = triangle.surface.intersect_all(drawn.rays[k]);
      const std::string label = "random case " + std::to_string(number) + " ray " + std::to_string(k);
      for (Judge& judge : judges) judge.judge(traced, 0, triangle, drawn.rays[k], roots, label);
    }
  }
}

class TracingMethod : public testing::TestWithParam<TraversalMethodLabel> {};

TEST_P(TracingMethod, FindsWhatTheOracleFindsOnRandomTriangles)
{
  std::vector<Judge> judges = judges_of(GetParam().method);
  judge_random_cases(judges, 1, num_test_rays(200000) / kRaysPerCase);
  for (const Judge& judge : judges) {
    const Judgement& j = judge.judgement();
    report(std::string(GetParam().name), j);
    EXPECT_EQ(j.num_faults(), 0u) << j.text();
    // One ray in ten thousand may be decided by rounding: most of those start on the surface.
    EXPECT_LE(j.num_beside, j.num_rays / 10000) << j.text();
  }
}

INSTANTIATE_TEST_SUITE_P(Displacement, TracingMethod, testing::ValuesIn(kTraversalMethods), [](const auto& each) {
  return test_name_of(std::string(each.param.name));
});

/// The hard cases with their names; made once a process.
const std::vector<HardCase>& all_hard_cases()
{
  static const std::vector<HardCase> cases = hard_cases();
  return cases;
}

class HardCaseOfMethods : public testing::TestWithParam<std::size_t> {};

TEST_P(HardCaseOfMethods, IsSolvedAsTheOracleDoes)
{
  const HardCase& hard_case = all_hard_cases()[GetParam()];
  std::vector<Judge> judges;
  for (const TraversalMethodLabel& label : kTraversalMethods) {
    for (const Judge& judge : judges_of(label.method)) judges.push_back(judge);
  }
  const TracedCase traced(hard_case.triangles, hard_case.map);
  for (std::uint32_t index = 0; index < hard_case.triangles.size(); ++index) {
    const JudgedTriangle triangle(hard_case.triangles[index], hard_case.map);
    for (std::size_t k = 0; k < hard_case.rays.size(); ++k) {
      const std::vector<oracle::Hit> roots = triangle.surface.intersect_all(hard_case.rays[k]);
      const std::string label = "case \"" + hard_case.name + "\" ray " + std::to_string(k);
      for (Judge& judge : judges) judge.judge(traced, index, triangle, hard_case.rays[k], roots, label);
    }
  }
  for (std::size_t k = 0; k < judges.size(); ++k) {
    EXPECT_EQ(judges[k].judgement().num_faults(), 0u) << judges[k].judgement().text();
  }
  report(hard_case.name, judges.back().judgement());
}

INSTANTIATE_TEST_SUITE_P(Displacement,
                         HardCaseOfMethods,
                         testing::Range(std::size_t{0}, all_hard_cases().size()),
                         [](const auto& each) { return test_name_of(all_hard_cases()[each.param].name); });

}  // namespace
}  // namespace relief
