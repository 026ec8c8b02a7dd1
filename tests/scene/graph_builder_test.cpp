// What becomes of operations: folded, shared, left out, ordered; and that programs then say the same.
#include "scene/graph/graph_builder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/support/graph_scene.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
using test::graph_at;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

GraphProgram program_of(GraphBuilder& b, GraphScalar a)
{
  b.set_output(GraphOutput::roughness, {a, a, a});
  return b.compile();
}

float value_of(const GraphProgram& program, const std::function<float(Q)>& quantity)
{
  return graph_at(program, quantity).of[static_cast<int>(GraphOutput::roughness)].x;
}

std::size_t num_instructions(const GraphProgram& program)
{
  std::size_t count = 0;
  for (std::size_t at = 0; at < program.code.size(); ++count) {
    const GraphOpShape& shape = kGraphOpShapes[program.code[at]];
    at += static_cast<std::size_t>(1 + shape.num_immediates + shape.num_outputs + shape.num_inputs);
  }
  return count;
}

TEST(GraphBuilder, ComputesWhatIsKnown)
{
  GraphBuilder b;
  const GraphScalar sum = b(Op::add, {b.constant(2), b(Op::multiply, {b.constant(3), b.constant(5)})});
  float value = 0;
  ASSERT_TRUE(b.is_constant(sum, &value));
  EXPECT_EQ(value, 17);
  const GraphProgram program = program_of(b, sum);
  EXPECT_TRUE(program.code.empty());
  EXPECT_EQ(program.num_registers, 0);
  EXPECT_EQ(value_of(program, [](Q) { return 0.0f; }), 17);
}

TEST(GraphBuilder, WhatIsUnfilteredHasNoFootprint)
{
  GraphBuilder b;
  const GraphScalar width = b(Op::multiply, {b.quantity(Q::uv0_width), b.constant(4)});
  const GraphScalar sum = b(Op::add, {b(Op::sine, {width}), b.quantity(Q::uv0_u)});
  const auto at = [](Q q) { return q == Q::uv0_width ? 0.5f : 0.25f; };
  EXPECT_FLOAT_EQ(value_of(program_of(b, sum), at), std::sin(2.0f) + 0.25f);
  const GraphScalar fine = b.unfiltered(sum);
  EXPECT_FLOAT_EQ(value_of(program_of(b, fine), at), 0.25f);
  EXPECT_EQ(b.unfiltered(sum).index, fine.index);
  EXPECT_EQ(b.unfiltered(fine).index, fine.index);
}

TEST(GraphBuilder, ComputesTexturesAtKnownPoints)
{
  GraphBuilder b;
  const GraphScalar p[] = {b.constant(0.3f), b.constant(-1.7f), b.constant(4.4f)};
  float value = 0;
  const std::uint16_t repeats = 0;
  ASSERT_TRUE(b.is_constant(b.apply(Op::signed_noise_3d, p, {&repeats, 1})[0], &value));
  EXPECT_GT(std::abs(value), 1e-3f);
  EXPECT_LT(std::abs(value), 1.1f);
}

TEST(GraphBuilder, DoesNotComputeImages)
{
  GraphBuilder b;
  const GraphScalar zero = b.constant(0), in[] = {zero, zero, zero};
  const std::uint16_t texture[] = {0, 0};
  EXPECT_FALSE(b.is_constant(b.apply(Op::image, in, texture)[0]));
}

TEST(GraphBuilder, MakesEqualPartsOnce)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x), y = b.quantity(Q::object_y);
  const auto part = [&] { return b(Op::sine, {b(Op::add, {x, b(Op::multiply, {y, b.constant(3)})})}); };
  const GraphScalar a = part(), c = part();
  EXPECT_EQ(a, c);
  EXPECT_EQ(num_instructions(program_of(b, b(Op::multiply, {a, c}))), 4u);
}

TEST(GraphBuilder, TellsPartsWithOtherImmediatesApart)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x);
  const GraphScalar in[] = {x, b.constant(2), b.constant(0.5f), b.constant(2)};
  const std::uint16_t plain = 0, normalized = 1;
  EXPECT_FALSE(b.apply(Op::noise_1d, in, {&plain, 1})[0] == b.apply(Op::noise_1d, in, {&normalized, 1})[0]);
}

TEST(GraphBuilder, KeepsEqualTablesOnce)
{
  GraphBuilder b;
  const float first[] = {0, 1, 2}, second[] = {0, 1, 3};
  EXPECT_EQ(b.add_table(first), b.add_table(first));
  EXPECT_NE(b.add_table(first), b.add_table(second));
}

TEST(GraphBuilder, TellsZerosApart)
{
  GraphBuilder b;
  EXPECT_FALSE(b.constant(0.0f) == b.constant(-0.0f));
  EXPECT_EQ(b.constant(kNan), b.constant(kNan));
}

TEST(GraphBuilder, LeavesOutWhatNothingNeeds)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x);
  for (int i = 0; i < 100; ++i) b(Op::add, {b.quantity(Q::object_y), b.constant(static_cast<float>(i + 1))});
  const GraphProgram program = program_of(b, b(Op::sine, {x}));
  EXPECT_EQ(num_instructions(program), 1u);
  EXPECT_EQ(program.inputs.size(), 1u);
  EXPECT_TRUE(program.constants.empty());
  EXPECT_EQ(program.given, 1u << static_cast<unsigned>(GraphOutput::roughness));
}

TEST(GraphBuilder, LeavesOutTablesThatNothingReads)
{
  GraphBuilder b;
  const float unread[] = {1, 2, 3, 4}, read[] = {5, 6, 8};
  b.add_table(unread);
  const std::uint32_t place = b.add_table(read);
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(place), 0, 3, 1, 0};
  const GraphScalar x = b.quantity(Q::object_x);
  const GraphProgram program = program_of(b, b.apply(Op::table, {&x, 1}, immediates)[0]);
  EXPECT_EQ(program.tables.size(), 3u);
  EXPECT_EQ(value_of(program, [](Q) { return 0.75f; }), 7);
}

TEST(GraphBuilder, LeavesOutOperationsThatDoNothing)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x), one = b.constant(1), zero = b.constant(0);
  EXPECT_EQ(b(Op::multiply, {x, one}), x);
  EXPECT_EQ(b(Op::multiply, {one, x}), x);
  EXPECT_EQ(b(Op::add, {x, zero}), x);
  EXPECT_EQ(b(Op::add, {zero, x}), x);
  EXPECT_EQ(b(Op::subtract, {x, zero}), x);
  EXPECT_EQ(b(Op::divide, {x, one}), x);
  EXPECT_EQ(b(Op::multiply_add, {x, one, zero}), x);
  EXPECT_EQ(b(Op::select, {one, x, zero}), x);
  EXPECT_EQ(b(Op::select, {zero, one, x}), x);
  EXPECT_EQ(b(Op::select, {x, zero, zero}), zero);
}

// 0·∞ and ∞ − ∞ are no numbers: what looks like nothing is one where its input is none.
TEST(GraphBuilder, LeavesWhatMayBeNoNumber)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x), zero = b.constant(0);
  const GraphScalar parts[] = {b(Op::multiply, {x, zero}), b(Op::subtract, {x, x})};
  for (const GraphScalar part : parts) {
    const GraphProgram program = program_of(b, part);
    EXPECT_EQ(value_of(program, [](Q) { return 3.0f; }), 0);
    EXPECT_TRUE(std::isnan(value_of(program, [](Q) { return kInf; })));
    EXPECT_TRUE(std::isnan(value_of(program, [](Q) { return kNan; })));
  }
  const GraphProgram zero_over = program_of(b, b(Op::divide, {zero, x}));
  EXPECT_TRUE(std::isnan(value_of(zero_over, [](Q) { return kNan; })));
  EXPECT_EQ(value_of(zero_over, [](Q) { return 0.0f; }), 0);
}

// A constant folds to what the kernel gives for it, numbers or not.
TEST(GraphBuilder, FoldsAsTheKernelRuns)
{
  const float hard[] = {0.0f, -0.0f, 1.0f, -2.5f, 1e-38f, -3e38f, kInf, -kInf, kNan};
  for (int op = 0; op <= static_cast<int>(Op::hsl_to_rgb); ++op) {
    const GraphOpShape& shape = kGraphOpShapes[op];
    if (shape.num_immediates > 0) continue;  // guards and skips, which compiling makes
    for (const float x : hard) {
      for (const float y : hard) {
        const float at[] = {x, y, 0.25f};
        GraphBuilder b;
        std::vector<GraphScalar> known, read;
        for (int i = 0; i < shape.num_inputs; ++i) {
          known.push_back(b.constant(at[i]));
          read.push_back(b.quantity(static_cast<Q>(i)));
        }
        for (int out = 0; out < shape.num_outputs; ++out) {
          float folded = 0;
          ASSERT_TRUE(b.is_constant(b.apply(static_cast<Op>(op), known)[static_cast<std::size_t>(out)], &folded));
          const GraphScalar run = b.apply(static_cast<Op>(op), read)[static_cast<std::size_t>(out)];
          const float value = value_of(program_of(b, run), [&](Q q) { return at[static_cast<int>(q)]; });
          EXPECT_TRUE(folded == value || (std::isnan(folded) && std::isnan(value)))
              << "opcode " << op << " of " << x << ", " << y << ": " << folded << " or " << value;
        }
      }
    }
  }
}

TEST(GraphBuilder, OutputsMayBeConstantsAndQuantities)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::uv0_u), half = b.constant(0.5f);
  b.set_output(GraphOutput::base_color, {x, half, x});
  b.set_output(GraphOutput::alpha, {half, half, half});
  const GraphProgram program = b.compile();
  EXPECT_TRUE(program.code.empty());
  const GraphValues values = graph_at(program, [](Q) { return 0.25f; });
  EXPECT_EQ(values.of[static_cast<int>(GraphOutput::base_color)].x, 0.25f);
  EXPECT_EQ(values.of[static_cast<int>(GraphOutput::base_color)].y, 0.5f);
  EXPECT_EQ(values.of[static_cast<int>(GraphOutput::alpha)].x, 0.5f);
  EXPECT_EQ(values.given,
            1u << static_cast<unsigned>(GraphOutput::base_color) | 1u << static_cast<unsigned>(GraphOutput::alpha));
}

TEST(GraphBuilder, NothingIsAProgramToo)
{
  const GraphProgram program = GraphBuilder().compile();
  EXPECT_TRUE(program.code.empty());
  EXPECT_EQ(program.given, 0u);
}

TEST(GraphBuilder, AChainOfAHundredThousandNeedsThreeRegisters)
{
  GraphBuilder b;
  const GraphScalar x = b.quantity(Q::object_x);
  GraphScalar at = x;
  for (int i = 0; i < 100'000; ++i) at = b(Op::sine, {b(Op::add, {at, x})});
  const GraphProgram program = program_of(b, at);
  EXPECT_EQ(num_instructions(program), 200'000u);
  EXPECT_LE(program.num_registers, 3);
  float expected = 0.3f;
  for (int i = 0; i < 100'000; ++i) expected = std::sin(expected + 0.3f);
  EXPECT_NEAR(value_of(program, [](Q) { return 0.3f; }), expected, 1e-4f);
}

/// A balanced tree of sums over 2^depth sines.
GraphScalar balanced(GraphBuilder& b, int depth, int& leaf)
{
  if (depth == 0) {
    return b(Op::sine, {b(Op::multiply, {b.quantity(Q::object_x), b.constant(static_cast<float>(++leaf))})});
  }
  const GraphScalar left = balanced(b, depth - 1, leaf);
  return b(Op::add, {left, balanced(b, depth - 1, leaf)});
}

// Sethi and Ullman: depth + 1 for the tree; and one that is read, and one as results do not share their inputs' registers.
TEST(GraphBuilder, ABalancedTreeNeedsARegisterALevel)
{
  for (const int depth : {1, 4, 10, 15}) {
    GraphBuilder b;
    int leaf = 0;
    const GraphProgram program = program_of(b, balanced(b, depth, leaf));
    EXPECT_LE(program.num_registers, depth + 3) << depth;
    double expected = 0;
    for (int i = 1; i <= leaf; ++i) expected += std::sin(0.01 * i);
    EXPECT_NEAR(static_cast<double>(value_of(program, [](Q) { return 0.01f; })), expected, 1e-3 * leaf) << depth;
  }
}

// Whichever side the chain hangs on, its other side waits for its turn.
TEST(GraphBuilder, ACombNeedsFewRegistersWhicheverSideItHangsOn)
{
  for (const bool hangs_left : {true, false}) {
    GraphBuilder b;
    const GraphScalar x = b.quantity(Q::object_x);
    GraphScalar at = b(Op::cosine, {x});
    for (int i = 1; i <= 2000; ++i) {
      const GraphScalar leaf = b(Op::sine, {b(Op::multiply, {x, b.constant(static_cast<float>(i))})});
      at = hangs_left ? b(Op::subtract, {at, leaf}) : b(Op::subtract, {leaf, at});
    }
    EXPECT_LE(program_of(b, at).num_registers, 5) << hangs_left;
  }
}

/// Sines of multiples of x, each used at both ends of a sum: all of them are alive in its middle.
GraphScalar all_alive(GraphBuilder& b, int count)
{
  std::vector<GraphScalar> sines;
  for (int i = 1; i <= count; ++i) {
    sines.push_back(b(Op::sine, {b(Op::multiply, {b.quantity(Q::object_x), b.constant(static_cast<float>(i + 1))})}));
  }
  GraphScalar at = b.constant(1);
  for (int i = 0; i < count; ++i) at = b(Op::add, {sines[static_cast<std::size_t>(i)], b(Op::sine, {at})});
  for (int i = 0; i < count; ++i) at = b(Op::add, {sines[static_cast<std::size_t>(i)], b(Op::sine, {at})});
  return at;
}

TEST(GraphBuilder, ManyValuesAtATimeAreRefused)
{
  {
    GraphBuilder b;
    EXPECT_LE(program_of(b, all_alive(b, 500)).num_registers, int{kMostGraphRegisters});
  }
  GraphBuilder b;
  const GraphScalar at = all_alive(b, 1400);
  try {
    program_of(b, at);
    FAIL();
  } catch (const GraphTooLarge& error) {
    EXPECT_STREQ(error.what(), "one that needs at most 512 values at a time");
  }
}

TEST(GraphBuilder, ManyConstantsAreRefused)
{
  GraphBuilder b;
  GraphScalar at = b.quantity(Q::object_x);
  for (int i = 0; i < 65'100; ++i) at = b(Op::add, {at, b.constant(static_cast<float>(i + 1))});
  try {
    program_of(b, at);
    FAIL();
  } catch (const GraphTooLarge& error) {
    EXPECT_STREQ(error.what(), "one with at most 65023 different constants");
  }
}

// Registers are used again as soon as they may be: a value that is overwritten too early would show.
TEST(GraphBuilder, RandomGraphsSayWhatTheirOperationsSay)
{
  std::mt19937 random(7);
  const auto below = [&](std::size_t n) { return random() % n; };
  constexpr Op kOps[] = {Op::add,          Op::subtract, Op::multiply,  Op::minimum,    Op::maximum,    Op::sine,
                         Op::multiply_add, Op::select,   Op::less_than, Op::rgb_to_hsv, Op::hsv_to_rgb, Op::floor};
  for (int round = 0; round < 300; ++round) {
    GraphBuilder b;
    std::vector<GraphScalar> graph;
    std::vector<float> expected;
    for (int i = 0; i < 6; ++i) {
      graph.push_back(b.quantity(static_cast<Q>(i)));
      expected.push_back(static_cast<float>(below(2000)) * 1e-3f);
      graph.push_back(b.constant(static_cast<float>(below(4))));
      float value = 0;
      b.is_constant(graph.back(), &value);
      expected.push_back(value);
    }
    const std::vector<float> quantities = expected;
    for (std::size_t i = 0; i < 5 + below(200); ++i) {
      const Op op = kOps[below(std::size(kOps))];
      const GraphOpShape& shape = kGraphOpShapes[static_cast<int>(op)];
      GraphProgram alone;
      std::vector<GraphScalar> in;
      alone.code = {static_cast<std::uint16_t>(op)};
      for (int k = 0; k < shape.num_outputs; ++k) alone.code.push_back(static_cast<std::uint16_t>(k));
      for (int k = 0; k < shape.num_inputs; ++k) {
        const std::size_t from = below(graph.size());
        in.push_back(graph[from]);
        alone.code.push_back(static_cast<std::uint16_t>(kMostGraphRegisters + k));
        alone.constants.push_back(expected[from]);
      }
      GraphRegisters registers;
      graph_run(alone.view(), nullptr, registers);
      const std::vector<GraphScalar> out = b.apply(op, in);
      for (std::size_t k = 0; k < out.size(); ++k) {
        graph.push_back(out[k]);
        expected.push_back(registers.lanes[k][0]);
      }
    }
    std::size_t taken[3] = {below(graph.size()), graph.size() - 1, below(graph.size())};
    b.set_output(GraphOutput::base_color, {graph[taken[0]], graph[taken[1]], graph[taken[2]]});
    const Vec3f value = graph_at(b.compile(), [&](Q q) {
                          return quantities[2 * static_cast<std::size_t>(q)];
                        }).of[static_cast<int>(GraphOutput::base_color)];
    const float found[] = {value.x, value.y, value.z};
    for (int c = 0; c < 3; ++c) {
      const float e = expected[taken[c]];
      EXPECT_TRUE(found[c] == e || (std::isnan(found[c]) && std::isnan(e)))
          << round << ": " << found[c] << " for " << e;
    }
  }
}

TEST(GraphBuilder, FindsHowCoordinatesGoIntoASum)
{
  GraphBuilder b;
  const GraphScalar u = b.quantity(Q::uv0_u), v = b.quantity(Q::uv0_v), x = b.quantity(Q::object_x);
  const GraphScalar at =
      b(Op::add, {b(Op::multiply, {b(Op::subtract, {u, v}), b.constant(3)}), b(Op::divide, {u, b.constant(2)})});
  const auto part = b.linear_part(b(Op::add, {at, b.constant(7)}), u, v);
  ASSERT_TRUE(part.has_value());
  EXPECT_EQ((*part)[0], 3.5);
  EXPECT_EQ((*part)[1], -3);
  EXPECT_FALSE(b.linear_part(b(Op::add, {at, x}), u, v).has_value());
  EXPECT_FALSE(b.linear_part(b(Op::multiply, {u, v}), u, v).has_value());
  EXPECT_FALSE(b.linear_part(b(Op::sine, {u}), u, v).has_value());
}

// Sums of sums of themselves have 2^n terms.
TEST(GraphBuilder, LooksAtSomeTermsOfASumOnly)
{
  GraphBuilder b;
  const GraphScalar u = b.quantity(Q::uv0_u), v = b.quantity(Q::uv0_v);
  GraphScalar at = u;
  for (int i = 0; i < 60; ++i) at = b(Op::add, {at, at});
  EXPECT_FALSE(b.linear_part(at, u, v).has_value());
}

}  // namespace
}  // namespace relief
