// Every way of tracing displaced triangles, compiled for every instruction set this machine has, against the oracle on
// the hard cases.
#include <gtest/gtest.h>

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <string>
#include <vector>

#include "tests/displacement/hard_cases.h"
#include "tests/displacement/judge.h"

namespace relief {
namespace {

std::string test_name_of(std::string text)
{
  for (char& c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return text;
}

/// Prints figures, also of a test that passes: they are what the documentation quotes.
void report(const std::string& label, const Judgement& judgement)
{
  std::cout << "[ figures  ] " << label << ": " << judgement.text() << "\n";
}

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
  std::vector<Judge> judges = judges_of_all_methods();
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
