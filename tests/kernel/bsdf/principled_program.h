// What tests of Principled closures of eight hits share: a program of one, and its inputs at random.
#pragma once

#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "kernel/graph/graph_mixture.h"
#include "tests/support/chi2.h"

namespace relief {

/// Tables with all that closures ask for, made once a process.
inline const BsdfTables& closure_tables()
{
  static const BsdfTables* tables = [] {
    auto* made = new BsdfTables;
    bsdf_tables_make(*made, kFeatureAll | kFeatureMixture);
    return made;
  }();
  return *tables;
}

/// A closure whose lobes eight hits are given at once.
struct PrincipledCase {
  const char* name;
  ClosureKind kind = ClosureKind::principled3;
  Maths maths = Maths::k34;
  ClosureDistribution distribution = ClosureDistribution::kGgx;
  bool has_sheen = false, has_coat = false;
};

inline constexpr PrincipledCase kPrincipledCases[] = {
    {.name = "3.4"},
    {.name = "3.4 with sheen", .has_sheen = true},
    {.name = "3.4 with a coat", .has_coat = true},
    {.name = "3.4 with both", .has_sheen = true, .has_coat = true},
    {"4.3", ClosureKind::principled4, Maths::k43, ClosureDistribution::kMultiscatterGgx},
    {"4.3, once", ClosureKind::principled4, Maths::k43, ClosureDistribution::kGgx},
    {"4.3 with sheen", ClosureKind::principled4, Maths::k43, ClosureDistribution::kMultiscatterGgx, true, false},
    {"4.3 with a coat", ClosureKind::principled4, Maths::k43, ClosureDistribution::kMultiscatterGgx, false, true},
    {"5.2", ClosureKind::principled4, Maths::k52, ClosureDistribution::kMultiscatterGgx},
    {"5.2 with sheen", ClosureKind::principled4, Maths::k52, ClosureDistribution::kMultiscatterGgx, true, false},
    {"5.2 with a coat", ClosureKind::principled4, Maths::k52, ClosureDistribution::kGgx, false, true},
    {"5.2 with both", ClosureKind::principled4, Maths::k52, ClosureDistribution::kMultiscatterGgx, true, true},
};

/// A program of one Principled closure, whose inputs are constants or registers.
class PrincipledProgram : public testing::Test {
 protected:
  PrincipledProgram() { use({}); }

  /// Makes the closure one of a case, with its defaults, and layers that are there by half.
  void use(const PrincipledCase& one)
  {
    spec_.kind = one.kind;
    spec_.maths = one.maths;
    spec_.distribution = one.distribution;
    std::memset(constants_, 0, sizeof constants_);
    constants_[0] = 1.0f;
    if (one.kind == ClosureKind::principled3) {
      set(Principled3Inputs{});
      if (one.has_sheen) constants_[result_of(offsetof(Principled3Inputs, sheen))] = 0.5f;
      if (one.has_coat) constants_[result_of(offsetof(Principled3Inputs, clearcoat))] = 0.5f;
    } else {
      set(Principled4Inputs{});
      if (one.has_sheen) constants_[result_of(offsetof(Principled4Inputs, sheen_weight))] = 0.5f;
      if (one.has_coat) constants_[result_of(offsetof(Principled4Inputs, coat_weight))] = 0.5f;
    }
  }

  /// Makes the closure another one.
  template <typename Inputs>
  void use(const SurfaceClosureSpec& spec, const Inputs& inputs)
  {
    spec_ = spec;
    std::memset(constants_, 0, sizeof constants_);
    constants_[0] = 1.0f;
    set(inputs);
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

  /// Makes all numbers registers that a case has.
  void vary_all(const PrincipledCase& one)
  {
    const auto numbers = [&](std::initializer_list<std::size_t> offsets) {
      for (const std::size_t offset : offsets) vary(result_of(offset));
    };
    const auto vectors = [&](std::initializer_list<std::size_t> offsets) {
      for (const std::size_t offset : offsets) numbers({offset, offset + 4, offset + 8});
    };
    if (one.kind == ClosureKind::principled3) {
      using In = Principled3Inputs;
      vectors({offsetof(In, base_color), offsetof(In, normal)});
      numbers({offsetof(In, metallic), offsetof(In, specular), offsetof(In, specular_tint), offsetof(In, roughness),
               offsetof(In, anisotropic)});
      if (one.has_sheen) numbers({offsetof(In, sheen), offsetof(In, sheen_tint)});
      if (one.has_coat) {
        numbers({offsetof(In, clearcoat), offsetof(In, clearcoat_roughness)});
        vectors({offsetof(In, clearcoat_normal)});
      }
      return;
    }
    using In = Principled4Inputs;
    vectors({offsetof(In, base_color), offsetof(In, specular_tint), offsetof(In, normal)});
    numbers({offsetof(In, metallic), offsetof(In, roughness), offsetof(In, ior), offsetof(In, specular_ior_level),
             offsetof(In, anisotropic)});
    if (one.has_sheen) {
      numbers({offsetof(In, sheen_weight), offsetof(In, sheen_roughness)});
      vectors({offsetof(In, sheen_tint)});
    }
    if (one.has_coat) {
      numbers({offsetof(In, coat_weight), offsetof(In, coat_roughness), offsetof(In, coat_ior)});
      vectors({offsetof(In, coat_normal)});
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
  /// @param is_bent  with normals of the closure's own
  void throw_inputs(int lane, bool is_bent)
  {
    for (const std::uint16_t result : varying_) registers_.lanes[result][lane] = thrown();
    const bool is_3 = spec_.kind == ClosureKind::principled3;
    if (!is_3) {
      // From both sides of 1, at which there is no reflection.
      registers_.lanes[result_of(offsetof(Principled4Inputs, ior))][lane] *= 2.5f;
      registers_.lanes[result_of(offsetof(Principled4Inputs, coat_ior))][lane] *= 2.5f;
      if (random_.next() < 0.5f) {
        registers_.lanes[result_of(offsetof(Principled4Inputs, specular_ior_level))][lane] = 0.5f;
      }
    }
    if (is_bent) return;
    const std::size_t normals[] = {
        is_3 ? offsetof(Principled3Inputs, normal) : offsetof(Principled4Inputs, normal),
        is_3 ? offsetof(Principled3Inputs, clearcoat_normal) : offsetof(Principled4Inputs, coat_normal)};
    for (const std::size_t normal : normals) {
      for (int c = 0; c < 3; ++c) registers_.lanes[result_of(normal) + c][lane] = 0.0f;
    }
  }

  static constexpr int kMostResults = 64;
  TestRandom random_{11};
  SurfaceClosureSpec spec_;
  float constants_[kMostResults] = {};
  std::vector<std::uint16_t> results_, varying_;
  std::uint16_t varying_before_[kMostResults] = {};
  GraphProgramView view_;
  GraphRegisters registers_{};

 private:
  template <typename Inputs>
  void set(const Inputs& defaults)
  {
    static_assert(sizeof(Inputs) / sizeof(float) + 2 <= kMostResults);
    std::memcpy(constants_ + 1, &defaults, sizeof defaults);
    results_.clear();
    for (std::size_t i = 0; i < 1 + sizeof(Inputs) / sizeof(float); ++i) {
      results_.push_back(static_cast<std::uint16_t>(kMostGraphRegisters + i));
    }
  }
};

}  // namespace relief
