#include "tests/oracle/procedural.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>

namespace relief::oracle {
namespace {

using Word = std::uint32_t;
using Point = std::vector<double>;

Word turned(Word x, int by) { return x << by | x >> (32 - by); }

/// lookup3's hashword without a seed: public domain, Bob Jenkins, 2006.
Word lookup3(const std::vector<Word>& key)
{
  Word s[3];
  std::fill(s, s + 3, 0xdeadbeefu + static_cast<Word>(key.size() << 2) + 13u);
  std::size_t taken = 0;
  for (; key.size() - taken > 3; taken += 3) {
    for (std::size_t i = 0; i < 3; ++i) s[i] += key[taken + i];
    const int by[] = {4, 6, 8, 16, 19, 4};
    for (int k = 0; k < 6; ++k) {
      Word &a = s[k % 3], &b = s[(k + 1) % 3], &c = s[(k + 2) % 3];
      a -= c;
      a ^= turned(c, by[k]);
      c += b;
    }
  }
  for (std::size_t i = 0; taken + i < key.size(); ++i) s[i] += key[taken + i];
  const int by[] = {14, 11, 25, 16, 4, 14, 24};
  for (int k = 0; k < 7; ++k) {
    Word &to = s[(k + 2) % 3], &from = s[(k + 1) % 3];
    to ^= from;
    to -= turned(from, by[k]);
  }
  return s[2];
}

/// The gradients of each number of dimensions: those of a hash's low bits.
Point gradient(std::size_t dims, Word hash)
{
  const auto sign = [hash](int bit) { return (hash >> bit & 1u) != 0 ? -1.0 : 1.0; };
  Point g(dims, 0.0);
  if (dims == 1) {
    g[0] = sign(3) * (1.0 + (hash & 7u));
  } else if (dims == 2) {
    const std::size_t first = (hash & 4u) != 0 ? 1 : 0;
    g[first] = sign(0);
    g[1 - first] = 2 * sign(1);
  } else if (dims == 3) {
    const Word h = hash & 15u;
    // Twelve edges of a cube; four of them twice.
    const std::size_t first = h < 8 ? 0 : 1;
    const std::size_t second = h < 4 ? 1 : h == 12 || h == 14 ? 0 : 2;
    g[first] += sign(0);
    g[second] += sign(1);
  } else {
    // The three axes that are not left out, and their signs.
    const std::size_t left_out = 3 - (hash & 31u) / 8;
    std::size_t bit = 0;
    for (std::size_t axis = 0; axis < 4; ++axis) {
      if (axis != left_out) g[axis] = sign(static_cast<int>(bit++));
    }
  }
  return g;
}

Word lattice_word(double at) { return static_cast<Word>(static_cast<std::int64_t>(at)); }

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

/// All offsets of cells up to `reach` away, the first axis fastest.
void each_offset(std::size_t dims, int reach, const std::function<void(const std::vector<float>&)>& visit)
{
  std::vector<float> offset(dims, static_cast<float>(-reach));
  for (;;) {
    visit(offset);
    std::size_t axis = 0;
    while (axis < dims && offset[axis] == static_cast<float>(reach)) offset[axis++] = static_cast<float>(-reach);
    if (axis == dims) return;
    offset[axis] += 1;
  }
}

/// A cell's own point, from its corner; and its colour.
Point point_of(const std::vector<float>& c)
{
  switch (c.size()) {
    case 1:
      return {hash_unit(c)};
    case 2:
      return {hash_unit(c), hash_unit({c[0], c[1], 1})};
    case 3:
      return {hash_unit(c), hash_unit({c[0], c[1], c[2], 1}), hash_unit({c[0], c[1], c[2], 2})};
    default:
      return {hash_unit(c), hash_unit({c[3], c[0], c[1], c[2]}), hash_unit({c[2], c[3], c[0], c[1]}),
              hash_unit({c[1], c[2], c[3], c[0]})};
  }
}

std::array<double, 3> color_of(const std::vector<float>& c)
{
  if (c.size() == 4) return {hash_unit(c), hash_unit({c[2], c[0], c[3], c[1]}), hash_unit({c[3], c[2], c[1], c[0]})};
  std::array<double, 3> out{};
  for (std::size_t i = 0; i < 3; ++i) {
    std::vector<float> key = c;
    if (i > 0) key.push_back(static_cast<float>(i));
    out[i] = hash_unit(key);
  }
  return out;
}

double distance_between(const Point& a, const Point& b, const CellSettings& s)
{
  double sum = 0, most = 0, squares = 0, powers = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    sum += d;
    most = std::max(most, d);
    squares += d * d;
    powers += std::pow(d, s.exponent);
  }
  if (a.size() == 1) return sum;
  switch (s.metric) {
    case Metric::kManhattan:
      return sum;
    case Metric::kChebychev:
      return most;
    case Metric::kMinkowski:
      return std::pow(powers, 1 / s.exponent);
    default:
      return std::sqrt(squares);
  }
}

struct Candidate {
  double distance;
  std::vector<float> cell;
  Point point;  ///< from the corner of the middle cell
};

}  // namespace

double hash_unit(const std::vector<float>& key)
{
  std::vector<Word> words;
  for (const float x : key) {
    Word word = 0;
    std::memcpy(&word, &x, sizeof word);
    words.push_back(word);
  }
  return lookup3(words) / 4294967295.0;
}

double noise_signed(const Point& p)
{
  const std::size_t dims = p.size();
  double sum = 0;
  for (Word corner = 0; corner < 1u << dims; ++corner) {
    double weight = 1, slope = 0;
    std::vector<Word> key;
    Point from;
    for (std::size_t i = 0; i < dims; ++i) {
      const double low = std::floor(p[i]);
      const Word step = corner >> i & 1u;
      key.push_back(lattice_word(low) + step);
      from.push_back(p[i] - low - step);
      weight *= step != 0 ? fade(p[i] - low) : 1 - fade(p[i] - low);
    }
    const Point g = gradient(dims, lookup3(key));
    for (std::size_t i = 0; i < dims; ++i) slope += g[i] * from[i];
    sum += weight * slope;
  }
  constexpr double kScale[] = {0.25, 0.6616, 0.9820, 0.8344};
  return sum * kScale[dims - 1];
}

double noise_fractal(const Point& p, double detail, double roughness, double lacunarity, bool normalize)
{
  // Octaves up to a whole number, mixed with one more by what is left of it.
  const auto up_to = [&](int last) {
    double sum = 0, size = 0, amplitude = 1, frequency = 1;
    for (int i = 0; i <= last; ++i) {
      Point scaled = p;
      for (double& x : scaled) x *= frequency;
      sum += amplitude * noise_signed(scaled);
      size += amplitude;
      amplitude *= roughness;
      frequency *= lacunarity;
    }
    return normalize ? 0.5 * sum / size + 0.5 : sum;
  };
  const int whole = static_cast<int>(detail);
  const double rest = detail - whole;
  return rest == 0 ? up_to(whole) : (1 - rest) * up_to(whole) + rest * up_to(whole + 1);
}

double
terrain(Terrain kind, const Point& p, double octaves, double falloff, double lacunarity, double offset, double gain)
{
  const int whole = static_cast<int>(octaves);
  const double rest = octaves - whole;
  const auto noise = [&](int octave) {
    Point scaled = p;
    for (double& x : scaled) x *= std::pow(lacunarity, octave);
    return noise_signed(scaled);
  };
  const auto size = [&](int octave) { return std::pow(falloff, octave); };
  double value = 0;
  if (kind == Terrain::kFbm) {
    for (int i = 0; i < whole; ++i) value += noise(i) * size(i);
    return value + rest * noise(whole) * size(whole);
  }
  if (kind == Terrain::kMultifractal) {
    value = 1;
    for (int i = 0; i < whole; ++i) value *= 1 + noise(i) * size(i);
    return value * (1 + rest * noise(whole) * size(whole));
  }
  if (kind == Terrain::kHetero) {
    value = offset + noise(0);
    int i = 1;
    for (; i < whole; ++i) value *= 1 + (noise(i) + offset) * size(i);
    return value * (1 + rest * (noise(i) + offset) * size(i));
  }
  if (kind == Terrain::kRidged) {
    double signal = std::pow(offset - std::abs(noise(0)), 2);
    value = signal;
    for (int i = 1; i < whole; ++i) {
      const double weight = std::clamp(signal * gain, 0.0, 1.0);
      signal = std::pow(offset - std::abs(noise(i)), 2) * weight;
      value += signal * size(i);
    }
    return value;
  }
  double weight = 1;
  int i = 0;
  for (; i < whole && weight > 0.001; ++i) {
    weight = std::min(weight, 1.0);
    const double signal = (noise(i) + offset) * size(i);
    value += weight * signal;
    weight *= gain * signal;
  }
  if (rest != 0 && weight > 0.001) value += rest * std::min(weight, 1.0) * (noise(i) + offset) * size(i);
  return value;
}

Cell cells(const Point& p, const CellSettings& s)
{
  const std::size_t dims = p.size();
  std::vector<float> middle;
  Point local;
  for (const double x : p) {
    middle.push_back(static_cast<float>(std::floor(x)));
    local.push_back(x - std::floor(x));
  }
  const auto around = [&](const std::vector<float>& center, int reach, const CellSettings& by) {
    std::vector<Candidate> out;
    each_offset(dims, reach, [&](const std::vector<float>& offset) {
      Candidate c;
      c.point = Point(dims);
      for (std::size_t i = 0; i < dims; ++i) c.cell.push_back(center[i] + offset[i]);
      const Point own = point_of(c.cell);
      for (std::size_t i = 0; i < dims; ++i) {
        const double corner = static_cast<double>(c.cell[i]) - static_cast<double>(middle[i]);
        c.point[i] = corner + own[i] * s.randomness;
      }
      c.distance = distance_between(c.point, local, by);
      out.push_back(c);
    });
    return out;
  };
  const auto sorted = [](std::vector<Candidate> all) {
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.distance < b.distance; });
    return all;
  };
  CellSettings euclidean = s;
  euclidean.metric = Metric::kEuclidean;
  Cell out;
  if (s.cells == Cells::kSmooth) {
    out.distance = 8;
    for (const Candidate& c : around(middle, 2, s)) {
      const double t = std::clamp(0.5 + 0.5 * (out.distance - c.distance) / s.smoothness, 0.0, 1.0);
      const double h = t * t * (3 - 2 * t);
      const double dip = s.smoothness * h * (1 - h), dip_of_others = dip / (1 + 3 * s.smoothness);
      const auto blended = [h](double from, double to, double less) { return from + h * (to - from) - less; };
      const std::array<double, 3> color = color_of(c.cell);
      out.distance = blended(out.distance, c.distance, dip);
      for (std::size_t i = 0; i < 3; ++i) out.color[i] = blended(out.color[i], color[i], dip_of_others);
      for (std::size_t i = 0; i < dims; ++i) out.position[i] = blended(out.position[i], c.point[i], dip_of_others);
    }
    for (std::size_t i = 0; i < dims; ++i) out.position[i] += static_cast<double>(middle[i]);
    return out;
  }
  if (s.cells == Cells::kEdge) {
    const std::vector<Candidate> near = sorted(around(middle, 1, euclidean));
    out.margin = near[1].distance - near[0].distance;
    out.distance = 8;
    for (std::size_t n = 1; n < near.size(); ++n) {
      double along = 0, length_squared = 0;
      for (std::size_t i = 0; i < dims; ++i) {
        const double a = near[0].point[i] - local[i], b = near[n].point[i] - local[i];
        along += (a + b) / 2 * (b - a);
        length_squared += (b - a) * (b - a);
      }
      if (length_squared > 1e-4) out.distance = std::min(out.distance, along / std::sqrt(length_squared));
    }
    return out;
  }
  if (s.cells == Cells::kRadius) {
    const std::vector<Candidate> near = sorted(around(middle, 1, euclidean));
    out.margin = near[1].distance - near[0].distance;
    double nearest = std::numeric_limits<double>::infinity();
    for (const Candidate& c : around(near[0].cell, 1, euclidean)) {
      if (c.cell == near[0].cell) continue;
      nearest = std::min(nearest, distance_between(c.point, near[0].point, euclidean));
    }
    out.distance = nearest / 2;
    return out;
  }
  const std::vector<Candidate> near = sorted(around(middle, 1, s));
  const std::size_t n = s.cells == Cells::kSecond ? 1 : 0;
  out.margin = std::min(near[1].distance - near[0].distance, near[2].distance - near[1].distance);
  out.distance = near[n].distance;
  out.color = color_of(near[n].cell);
  for (std::size_t i = 0; i < dims; ++i) out.position[i] = near[n].point[i] + static_cast<double>(middle[i]);
  return out;
}

}  // namespace relief::oracle
