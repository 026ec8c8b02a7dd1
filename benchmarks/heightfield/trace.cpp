#include "benchmarks/heightfield/trace.h"

#include <algorithm>
#include <cmath>

namespace relief {

namespace {

/// To the next line between texel centres, along one axis.
/// @source [B], Eq. 1
double cell_distance(double p, double v, int n)
{
  if (v == 0) return HUGE_VAL;
  return ((std::floor(p * n + 0.5) + 0.5 * (v > 0 ? 1 : -1)) / n - p) / v;
}

double height_over(const HeightTexture& t, const TextureRay& r, double at)
{
  return 1 + r.dz * at - t.height(r.u + r.du * at, r.v + r.dv * at);
}

double secant(const HeightTexture& t, const TextureRay& r, double above, double below)
{
  const double a = height_over(t, r, above), b = height_over(t, r, below);
  return a > 0 && b <= 0 ? above + (below - above) * (a / (a - b)) : below;
}

/// First root in a bilinear cell between two parameters; negative: none.
double patch_root(const HeightTexture& t, const TextureRay& r, double from, double to)
{
  // Heights along the ray are quadratic in a cell: three points tell.
  const double middle = 0.5 * (from + to), width = to - from;
  const double a = height_over(t, r, from), b = height_over(t, r, middle), c = height_over(t, r, to);
  if (a <= 0) return from;
  const double p = 2 * (a + c - 2 * b), q = 4 * b - 3 * a - c;
  const double discriminant = q * q - 4 * p * a;
  if (!(discriminant >= 0)) return c <= 0 ? to : -1;
  const double s = -0.5 * (q + std::copysign(std::sqrt(discriminant), q));
  double best = 2;
  for (const double root : {s / p, a / s}) {
    if (root >= 0 && root <= 1 && root < best) best = root;
  }
  if (best <= 1) return from + best * width;
  return c <= 0 ? to : -1;
}

}  // namespace

TextureHit cone_trace(const HeightTexture& texture,
                      const ConeMap& cones,
                      const TextureRay& r,
                      ConeStepping stepping,
                      ConeRefinement refinement,
                      int max_iterations)
{
  TextureHit out;
  const double planar = std::hypot(r.du, r.dv), end = -1 / r.dz;
  const double least = 0.5 / (texture.size * std::max(planar, 1e-12));
  double t = 0, before = 0;
  for (; out.num_steps < max_iterations; ++out.num_steps) {
    const double u = r.u + r.du * t, v = r.v + r.dv * t;
    const double above = 1 + r.dz * t - texture.height(u, v);
    if (above <= 0 || t >= end) break;
    const double cone = texture.at(cones, u, v);
    double step = cone * above / (planar - cone * r.dz);
    if (stepping == ConeStepping::kOriginal) {
      step = std::max(step, least);
    } else {
      // A little over the line, so that the next cell is the next.
      const double cell = std::min(cell_distance(u, r.du, texture.size), cell_distance(v, r.dv, texture.size));
      step = std::max(step, cell + 1e-9);
    }
    before = t;
    t = std::min(t + step, end);
  }
  out.converged = out.num_steps < max_iterations;
  out.hit = height_over(texture, r, t) <= 0 || t >= end;
  if (refinement == ConeRefinement::kSecant) t = secant(texture, r, before, t);
  if (refinement == ConeRefinement::kBisection) {
    for (int k = 0; k < 7; ++k) {
      const double middle = 0.5 * (before + t);
      (height_over(texture, r, middle) > 0 ? before : t) = middle;
    }
  }
  out.t = t;
  return out;
}

TextureHit linear_trace(const HeightTexture& texture, const TextureRay& r, int num_steps)
{
  const double end = -1 / r.dz;
  for (int k = 1; k <= num_steps; ++k) {
    const double t = end * k / num_steps;
    if (height_over(texture, r, t) > 0 && k < num_steps) continue;
    return {true, true, secant(texture, r, end * (k - 1) / num_steps, t), k};
  }
  return {};
}

MaximumPyramid::MaximumPyramid(const HeightTexture& texture) : texture_(texture)
{
  // Cell (i, j) lies between the centres of texels (i, j) and (i + 1, j + 1).
  std::vector<float> level;
  for (int j = 0; j < texture.size; ++j) {
    for (int i = 0; i < texture.size; ++i) {
      level.push_back(std::max(std::max(texture.texel(i, j), texture.texel(i + 1, j)),
                               std::max(texture.texel(i, j + 1), texture.texel(i + 1, j + 1))));
    }
  }
  levels_.push_back(std::move(level));
  for (int size = texture.size / 2; size >= 1; size /= 2) {
    const std::vector<float>& below = levels_.back();
    std::vector<float> next;
    const auto at = [&](int i, int j) { return below[static_cast<std::size_t>(j * 2 * size + i)]; };
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) {
        next.push_back(std::max(std::max(at(2 * i, 2 * j), at(2 * i + 1, 2 * j)),
                                std::max(at(2 * i, 2 * j + 1), at(2 * i + 1, 2 * j + 1))));
      }
    }
    levels_.push_back(std::move(next));
  }
}

TextureHit MaximumPyramid::trace(const TextureRay& r, bool exact, int max_iterations) const
{
  TextureHit out;
  const int n = texture_.size;
  const double end = -1 / r.dz;
  auto level = static_cast<int>(levels_.size()) - 1;
  double t = 0;
  for (; out.num_steps < max_iterations; ++out.num_steps) {
    if (t >= end) {
      out.hit = true;
      out.t = end;
      return out;
    }
    const int count = n >> level;
    // Cells begin at texel centres.
    const double x = (r.u + r.du * t) * n - 0.5, y = (r.v + r.dv * t) * n - 0.5;
    const double size = 1 << level, i = std::floor(x / size), j = std::floor(y / size);
    const auto leaves = [&](double at, double d, double cell) {
      if (d == 0) return HUGE_VAL;
      return ((d > 0 ? cell + 1 : cell) * size - at) / (d * n);
    };
    const double next = std::min(t + std::max(std::min(leaves(x, r.du, i), leaves(y, r.dv, j)), 0.0) + 1e-10, end);
    const auto wrap = [count](double k) { return ((static_cast<int>(k) % count) + count) % count; };
    const double most = static_cast<double>(
        levels_[static_cast<std::size_t>(level)][static_cast<std::size_t>(wrap(j) * count + wrap(i))]);
    if (1 + r.dz * next > most) {
      t = next;
      level = std::min(level + 1, static_cast<int>(levels_.size()) - 1);
      continue;
    }
    if (level > 0) {
      // Up to where the ray falls below the node's height nothing is met.
      t = std::max(t, std::min((most - 1) / r.dz, next));
      --level;
      continue;
    }
    const double root = exact                                 ? patch_root(texture_, r, t, next)
                        : height_over(texture_, r, next) <= 0 ? secant(texture_, r, t, next)
                                                              : -1;
    if (root >= 0) {
      out.hit = true;
      out.t = root;
      return out;
    }
    t = next;
  }
  out.converged = false;
  out.t = t;
  return out;
}

TextureHit exact_trace(const HeightTexture& texture, const TextureRay& r)
{
  TextureHit out;
  const double end = -1 / r.dz;
  double t = 0;
  while (t < end) {
    ++out.num_steps;
    const double u = r.u + r.du * t, v = r.v + r.dv * t;
    const double x = u * texture.size - 0.5, y = v * texture.size - 0.5;
    const auto leaves = [&](double at, double d) {
      if (d == 0) return HUGE_VAL;
      return ((d > 0 ? std::floor(at) + 1 : std::ceil(at) - 1) - at) / (d * texture.size);
    };
    const double next = std::min(t + std::min(leaves(x, r.du), leaves(y, r.dv)), end);
    const double root = patch_root(texture, r, t, next);
    if (root >= 0) {
      out.hit = true;
      out.t = root;
      return out;
    }
    t = next + 1e-12;
  }
  out.hit = true;  // the bottom
  out.t = end;
  return out;
}

}  // namespace relief
