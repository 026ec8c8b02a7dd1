#include "benchmarks/displacement/vector_scenes.h"

#include <algorithm>
#include <cmath>

namespace relief {

namespace {

constexpr double kHalfTurn = 3.141592653589793;

double mix(double a, double b, double t) { return a + t * (b - a); }

/// A meadow of mushrooms, six a side: each a profile that goes up its stem, out below its hat and back over it.
Vec3d mushrooms(Vec3d P, Vec3d)
{
  constexpr double kSide = 1.0 / 6;  // half of one
  const auto within = [](double x) { return 2 * (x / (2 * kSide) - std::floor(x / (2 * kSide))) - 1; };
  const double x = within(P.x), z = within(P.z), r = std::hypot(x, z), q = r / 0.9;
  if (q >= 1) return {};
  double out, up;
  if (q > 0.6) {
    const double t = (1 - q) / 0.4;
    out = mix(0.9, 0.25, t), up = 0.15 * t * t;
  } else if (q > 0.45) {
    const double t = (0.6 - q) / 0.15;
    out = mix(0.25, 0.22, t), up = mix(0.15, 0.9, t);
  } else if (q > 0.3) {
    const double t = (0.45 - q) / 0.15;
    out = mix(0.22, 0.75, t), up = mix(0.9, 0.8, t);
  } else {
    const double t = kHalfTurn / 2 * q / 0.3;
    out = 0.75 * std::sin(t), up = 0.8 + 0.5 * std::cos(t);
  }
  const double stretch = r > 0 ? kSide * (out / r - 1) : 0;
  return {stretch * x, kSide * 1.5 * up, stretch * z};
}

/// Waves that roll over.
Vec3d curls(Vec3d P, Vec3d)
{
  const double wave = 12 * (P.x + P.z) + 9 * P.y;
  return 0.06 * Vec3d{std::sin(2 * wave), std::sin(wave) * std::cos(3 * P.z), std::cos(wave + 5 * P.y)};
}

/// A head, as sculpted: a nose and a chin that hang over, ears that turn back, sockets, brows, lips and folds.
Vec3d head(Vec3d P, Vec3d N)
{
  struct Pull {
    Vec3d at;      ///< on the unit ball
    double width;  ///< of a bell around it
    Vec3d by;
  };
  static constexpr Pull kPulls[] = {
      {{0, -0.05, 1}, 0.16, {0, -0.10, 0.26}},        {{0, 0.12, 0.99}, 0.14, {0, 0, 0.10}},
      {{0.32, 0.15, 0.93}, 0.13, {0, 0, -0.11}},      {{-0.32, 0.15, 0.93}, 0.13, {0, 0, -0.11}},
      {{0.34, 0.33, 0.88}, 0.13, {0, -0.05, 0.09}},   {{-0.34, 0.33, 0.88}, 0.13, {0, -0.05, 0.09}},
      {{0, -0.33, 0.94}, 0.11, {0, -0.03, 0.09}},     {{0, -0.45, 0.89}, 0.10, {0, 0.03, 0.08}},
      {{0, -0.72, 0.69}, 0.22, {0, -0.12, 0.16}},     {{1, 0.05, -0.05}, 0.13, {0.26, 0.10, -0.24}},
      {{-1, 0.05, -0.05}, 0.13, {-0.26, 0.10, -0.24}}};
  const Vec3d d = P * (1 / length(P));
  Vec3d sum{};
  for (const Pull& pull : kPulls) {
    const Vec3d from = d - pull.at * (1 / length(pull.at));
    sum = sum + std::exp(-dot(from, from) / (pull.width * pull.width)) * pull.by;
  }
  const double fold = std::sin(90 * d.y + 6 * std::sin(9 * d.x)) * std::sin(31 * d.x + 11 * d.z);
  return sum + (0.004 * fold) * N;
}

/// Ridges that lean over the cracks between them.
Vec3d bark(Vec3d P, Vec3d N)
{
  const double along = 5 * P.y, phase = 22 * P.x + 1.5 * std::sin(along) + 0.7 * std::sin(3.1 * along + 9 * P.x);
  const double ridge = std::sqrt(std::abs(std::sin(phase))), lean = std::sin(2 * phase);
  const Vec3d across = cross(Vec3d{0, 1, 0}, N);
  const double rough = 0.15 * std::sin(140 * P.x + 40 * P.y) * std::sin(90 * P.y);
  return (0.07 * (ridge + rough * ridge)) * N + (0.035 * lean * ridge) * across;
}

// One line a scene, so that they can be compared:
// clang-format off
const VectorSceneSpec kSpecs[] = {
    {{"mushrooms", {}, BenchShape::kPlane, 24, 24, BenchMap::kDomes, 4, 1, 1, 0, {0.4, 1.2, 2.3}, 32, {}}, 64, mushrooms},
    {{"curl", {}, BenchShape::kTorus, 40, 24, BenchMap::kDomes, 4, 1, 1, 0, {0.3, 2.1, 2.2}, 27, {}}, 32, curls},
    {{"head", {}, BenchShape::kSphere, 32, 32, BenchMap::kDomes, 4, 1, 1, 0, {0.9, 0.3, 2.8}, 28, {}}, 32, head},
    {{"bark", {}, BenchShape::kPlate, 20, 20, BenchMap::kDomes, 4, 1, 1, 0, {0.4, 0.3, 2.4}, 30, {}}, 64, bark},
};
// clang-format on

}  // namespace

std::span<const VectorSceneSpec> vector_scene_specs() { return kSpecs; }

VectorScene::VectorScene(const VectorSceneSpec& spec, std::int32_t cells)
    : base_(bench_scene_make(spec.base, {})), cells_(cells), move_(spec.move)
{
  double area = 0;
  for (const TriangleIndices& t : base_.triangles) {
    const Vec3d P = to_double(base_.P[t.v0]);
    area += length(cross(to_double(base_.P[t.v1]) - P, to_double(base_.P[t.v2]) - P));
  }
  base_.texel_metres = std::sqrt(area / static_cast<double>(base_.triangles.size())) / cells_;
}

void VectorScene::eval(const void* owner, std::uint32_t triangle, const float (*b)[8], Vec3f* moves)
{
  const auto& self = *static_cast<const VectorScene*>(owner);
  const TriangleIndices& t = self.base_.triangles[triangle];
  const std::uint32_t corners[] = {t.v0, t.v1, t.v2};
  for (int k = 0; k < 8; ++k) {
    Vec3d P{}, N{};
    for (int c = 0; c < 3; ++c) {
      const auto weight = static_cast<double>(b[c][k]);
      P = P + weight * to_double(self.base_.P[corners[c]]);
      N = N + weight * to_double(as_vector(self.base_.N[corners[c]]));
    }
    moves[k] = to_float(self.move_(P, N * (1 / std::max(length(N), 1e-30))));
  }
}

}  // namespace relief
