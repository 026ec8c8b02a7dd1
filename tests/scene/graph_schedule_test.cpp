// Programs that leave out what factors of 0 make needless: that they do, and that they say the same.
#include "scene/graph/graph_schedule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>

#include "kernel/graph/graph_eval.h"
#include "scene/graph/graph_builder.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;

/// The program's first output, each lane having its own inputs.
std::array<float, 8> roughness_of(const GraphProgram& program,
                                  const std::function<float(Q, int)>& quantity,
                                  unsigned used)
{
  GraphRegisters registers;
  registers.used = used;
  // What was left by other programs must not matter.
  for (F8& lanes : registers.lanes) lanes = splat8(std::numeric_limits<float>::quiet_NaN());
  for (const GraphInput& input : program.inputs) {
    for (int k = 0; k < 8; ++k) registers.lanes[input.register_index][k] = quantity(input.quantity, k);
  }
  const GraphProgramView view = program.view();
  graph_run(view, nullptr, registers);
  std::array<float, 8> out{};
  for (int k = 0; k < 8; ++k) {
    out[static_cast<std::size_t>(k)] =
        graph_values({&view, &registers, k}).of[static_cast<int>(GraphOutput::roughness)].x;
  }
  return out;
}

/// Noise at a point of which one coordinate is known.
GraphScalar noise_of(GraphBuilder& b, GraphScalar x)
{
  const GraphScalar one = b.constant(1), half = b.constant(0.5f);
  const GraphScalar inputs[] = {x, one, half, half, half, one};
  const std::uint16_t modes[] = {1, 0};
  return b.apply(Op::noise_3d, inputs, modes).front();
}

/// An operation that fails where it is run: an image without textures.
GraphScalar trap_of(GraphBuilder& b, GraphScalar x)
{
  const GraphScalar inputs[] = {x, x, x};
  const std::uint16_t modes[] = {0, 0};
  return b.apply(Op::image, inputs, modes).front();
}

GraphScalar guarded(GraphBuilder& b, GraphScalar value, GraphScalar factor)
{
  return b.guarded({&value, 1}, factor).front();
}

void set_roughness(GraphBuilder& b, GraphScalar a) { b.set_output(GraphOutput::roughness, {a, a, a}); }

TEST(GraphSchedule, LeavesOutWhatNoPointNeeds)
{
  GraphBuilder b;
  const GraphScalar factor = b.quantity(Q::object_x), x = b.quantity(Q::object_y);
  const GraphScalar value = guarded(b, b(Op::sine, {trap_of(b, x)}), factor);
  set_roughness(b, b(Op::add, {b(Op::multiply, {factor, value}), x}));
  const auto all_zero = [](Q q, int k) { return q == Q::object_x ? 0.0f : static_cast<float>(k); };
  const std::array<float, 8> out = roughness_of(b.compile(), all_zero, 0xff);
  for (std::size_t k = 0; k < 8; ++k) EXPECT_EQ(out[k], static_cast<float>(k));
}

TEST(GraphSchedule, LanesWithoutPointsDoNotCount)
{
  GraphBuilder b;
  const GraphScalar factor = b.quantity(Q::object_x), x = b.quantity(Q::object_y);
  set_roughness(b, guarded(b, b(Op::sine, {trap_of(b, x)}), factor));
  const auto beyond = [](Q q, int k) { return q == Q::object_x ? (k < 3 ? 0.0f : 1.0f) : 0.0f; };
  EXPECT_EQ(roughness_of(b.compile(), beyond, 0b111)[2], 0.0f);
}

TEST(GraphSchedule, OnePointThatNeedsItGetsIt)
{
  GraphBuilder b;
  const GraphScalar factor = b.quantity(Q::object_x), x = b.quantity(Q::object_y);
  const GraphScalar noise = noise_of(b, x);
  set_roughness(b, guarded(b, noise, factor));
  GraphBuilder plain;
  set_roughness(plain, noise_of(plain, plain.quantity(Q::object_y)));
  const auto one = [](Q q, int k) { return q == Q::object_x ? (k == 5 ? 0.25f : 0.0f) : 0.3f * static_cast<float>(k); };
  const std::array<float, 8> out = roughness_of(b.compile(), one, 0xff), all = roughness_of(plain.compile(), one, 0xff);
  for (std::size_t k = 0; k < 8; ++k) EXPECT_EQ(out[k], k == 5 ? all[5] : 0.0f);
  EXPECT_GT(all[5], 0.0f);
}

TEST(GraphSchedule, WhatOthersNeedTooIsRun)
{
  GraphBuilder b;
  const GraphScalar factor = b.quantity(Q::object_x), x = b.quantity(Q::object_y);
  const GraphScalar shared = noise_of(b, x);
  const GraphScalar value = guarded(b, noise_of(b, shared), factor);
  set_roughness(b, b(Op::add, {value, shared}));
  GraphBuilder plain;
  set_roughness(plain, noise_of(plain, plain.quantity(Q::object_y)));
  const auto zero = [](Q q, int k) { return q == Q::object_x ? 0.0f : 0.7f * static_cast<float>(k); };
  EXPECT_EQ(roughness_of(b.compile(), zero, 0xff), roughness_of(plain.compile(), zero, 0xff));
}

TEST(GraphSchedule, CheapValuesAreNotAskedFor)
{
  GraphBuilder b;
  const GraphScalar factor = b.quantity(Q::object_x), x = b.quantity(Q::object_y);
  set_roughness(b, b(Op::multiply, {factor, guarded(b, b(Op::add, {x, b.constant(1)}), factor)}));
  GraphBuilder plain;
  const GraphScalar y = plain.quantity(Q::object_y);
  set_roughness(plain, plain(Op::multiply, {plain.quantity(Q::object_x), plain(Op::add, {y, plain.constant(1)})}));
  EXPECT_EQ(b.compile().code.size(), plain.compile().code.size());
}

TEST(GraphSchedule, KnownFactorsNeedNoGuards)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_y);
  EXPECT_EQ(guarded(b, x, b.constant(0.5f)), x);
  EXPECT_EQ(guarded(b, x, b.constant(0)), b.constant(0));
}

// Chains of guards that are deep: what regions need from outside is not listed for each level.
TEST(GraphSchedule, DeepChainsAreCompiledInLinearTime)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_y), shared = noise_of(b, b.quantity(Q::object_z));
  GraphScalar at = noise_of(b, x);
  for (int i = 0; i < 20'000; ++i) {
    const GraphScalar factor = b(Op::less_than, {b.quantity(Q::object_x), b.constant(static_cast<float>(i))});
    at = guarded(b, b(Op::add, {at, shared}), factor);
  }
  set_roughness(b, at);
  const auto where = [](Q q, int k) { return q == Q::object_x ? (k == 2 ? -1.0f : 19'998.5f) : 0.5f; };
  const std::array<float, 8> out = roughness_of(b.compile(), where, 0xff);
  EXPECT_GT(out[2], 1000.0f);
  // Of the last link alone.
  GraphBuilder plain;
  set_roughness(plain, noise_of(plain, plain.quantity(Q::object_z)));
  EXPECT_EQ(out[0], roughness_of(plain.compile(), where, 0xff)[0]);
}

// Guards within guards, of shared values, of factors that come from guarded values themselves.
TEST(GraphSchedule, RandomGraphsSayTheSameWithoutGuards)
{
  std::mt19937 random(11);
  const auto below = [&](std::size_t n) { return random() % n; };
  std::size_t num_skips = 0;
  for (int round = 0; round < 400; ++round) {
    GraphBuilder b;
    std::vector<GraphScalar> graph;
    for (int i = 0; i < 6; ++i) graph.push_back(b.quantity(static_cast<Q>(i)));
    graph.push_back(b.constant(0.5f));
    const auto pick = [&] { return graph[graph.size() - 1 - below(std::min<std::size_t>(graph.size(), 12))]; };
    const std::size_t size = 5 + below(120);
    for (std::size_t i = 0; i < size; ++i) {
      switch (below(5)) {
        case 0:
          graph.push_back(noise_of(b, pick()));
          break;
        case 1:
          graph.push_back(b(Op::less_than, {pick(), graph[below(6)]}));
          break;
        case 2:
          graph.push_back(b(Op::multiply_add, {pick(), pick(), pick()}));
          break;
        default: {
          std::vector<GraphScalar> values(1 + below(3));
          for (GraphScalar& a : values) a = pick();
          const GraphScalar factor = b(Op::less_than, {pick(), graph[below(6)]});
          // Only where the factor is not 0 do guarded values count, so the program without guards has to say the same.
          for (const GraphScalar a : b.guarded(values, factor)) {
            graph.push_back(b(Op::select, {factor, a, b.constant(0.25f)}));
          }
        }
      }
    }
    set_roughness(b, graph.back());
    const GraphProgram skipping = b.compile(), plain = b.compile(false);
    num_skips += static_cast<std::size_t>(
        std::count(skipping.code.begin(), skipping.code.end(), static_cast<std::uint16_t>(Op::skip)));
    std::uniform_real_distribution<float> uniform(-1, 1);
    const float spread = below(2) == 0 ? 0.0f : 1.0f;  // all lanes alike: more is skipped
    std::array<std::array<float, 8>, 6> values{};
    for (auto& quantity : values) {
      const float all = uniform(random);
      for (float& v : quantity) v = all + spread * uniform(random);
    }
    const auto quantity = [&](Q q, int k) { return values[static_cast<std::size_t>(q)][static_cast<std::size_t>(k)]; };
    const unsigned used = below(2) == 0 ? 0xff : 0x3f;
    const std::array<float, 8> found = roughness_of(skipping, quantity, used);
    const std::array<float, 8> expected = roughness_of(plain, quantity, used);
    for (std::size_t k = 0; k < (used == 0xff ? 8u : 6u); ++k) EXPECT_EQ(found[k], expected[k]) << round;
  }
  EXPECT_GT(num_skips, 400u);
}

}  // namespace
}  // namespace relief
