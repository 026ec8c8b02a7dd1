// What tests of the plain Principled closure of eight hits share: a program of one, and its inputs at random.
#pragma once

#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "kernel/graph/graph_mixture.h"
#include "tests/support/chi2.h"

namespace relief {

inline constexpr int kNumbers = sizeof(Principled3Inputs) / sizeof(float);

/// A program of one Principled closure, whose inputs are constants or registers.
class PlainPrincipled : public testing::Test {
 protected:
  PlainPrincipled()
  {
    spec_.kind = ClosureKind::principled3;
    for (int i = 0; i < 1 + kNumbers; ++i) results_.push_back(static_cast<std::uint16_t>(kMostGraphRegisters + i));
    const Principled3Inputs defaults;
    constants_[0] = 1.0f;
    std::memcpy(constants_ + 1, &defaults, sizeof defaults);
  }

  static int result_of(std::size_t offset) { return 1 + static_cast<int>(offset / sizeof(float)); }

  void vary(int result) { results_[static_cast<std::size_t>(result)] = static_cast<std::uint16_t>(result); }

  const GraphProgramView& program()
  {
    varying_.clear();
    for (std::size_t i = 0; i < results_.size(); ++i) {
      varying_before_[i] = static_cast<std::uint16_t>(varying_.size());
      if (results_[i] < kMostGraphRegisters) varying_.push_back(static_cast<std::uint16_t>(i));
    }
    varying_before_[results_.size()] = static_cast<std::uint16_t>(varying_.size());
    view_.constants = view_.result_values = constants_;
    view_.results = results_.data();
    view_.varying_before = varying_before_;
    view_.varying = varying_.data();
    view_.closures = &spec_;
    view_.num_closures = 1;
    return view_;
  }

  Vec3f direction() { return normalize(Vec3f{random_.next() - 0.5f, random_.next() - 0.5f, random_.next() + 0.01f}); }

  /// Makes all numbers that a plain closure has registers.
  void vary_all()
  {
    using In = Principled3Inputs;
    for (const std::size_t offset :
         {offsetof(In, base_color), offsetof(In, base_color) + 4, offsetof(In, base_color) + 8, offsetof(In, metallic),
          offsetof(In, specular), offsetof(In, specular_tint), offsetof(In, roughness), offsetof(In, anisotropic),
          offsetof(In, normal), offsetof(In, normal) + 4, offsetof(In, normal) + 8}) {
      vary(result_of(offset));
    }
  }

  /// A number of an input: now and then a corner, or what is out of range.
  float thrown()
  {
    const float chance = random_.next();
    if (chance < 0.1f) return random_.next() < 0.5f ? 0.0f : 1.0f;
    if (chance < 0.12f) return random_.next() < 0.5f ? -0.5f : kInfinity;
    if (chance < 0.125f) return std::numeric_limits<float>::quiet_NaN();
    return random_.next();
  }

  /// Throws the registers of a lane.
  /// @param is_bent  with a normal of the closure's own
  void throw_inputs(int lane, bool is_bent)
  {
    for (const std::uint16_t result : varying_) registers_.lanes[result][lane] = thrown();
    if (is_bent) return;
    for (int c = 0; c < 3; ++c) registers_.lanes[result_of(offsetof(Principled3Inputs, normal)) + c][lane] = 0.0f;
  }

  TestRandom random_{11};
  SurfaceClosureSpec spec_;
  float constants_[kNumbers + 16] = {};
  std::vector<std::uint16_t> results_, varying_;
  std::uint16_t varying_before_[kNumbers + 16] = {};
  GraphProgramView view_;
  GraphRegisters registers_{};
};

}  // namespace relief
