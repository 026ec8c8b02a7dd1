#include "exporters/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "kernel/assert.h"
#include "scene/memory.h"

namespace relief {

namespace {

using Plane = std::vector<float>;
using Triple = std::array<float, 3>;
using Planes = std::array<Plane, 3>;
using Kernel = std::vector<float>;  ///< weights at −radius … radius

constexpr float kPi = 3.14159265358979f;

// Between linear Rec.709 and XYZ relative to the white D65, derived from the primaries: white is (1, 1, 1).
constexpr float kXyzFromRgb[3][3] = {{.433887346f, .376224009f, .189888645f},
                                     {.212639006f, .715168679f, .072192315f},
                                     {.017750040f, .109447621f, .872802339f}};
constexpr float kRgbFromXyz[3][3] = {{3.080399091f, -1.537383178f, -.543015913f},
                                     {-.921223359f, 1.875967502f, .045255857f},
                                     {.052873939f, -.203976959f, 1.151103020f}};

Triple multiply(const float (&matrix)[3][3], const Triple& v)
{
  Triple result{};
  for (std::size_t i = 0; i < 3; ++i) {
    result[i] = matrix[i][0] * v[0] + matrix[i][1] * v[1] + matrix[i][2] * v[2];
  }
  return result;
}

/// Linear opponent space: luminance, red-green, blue-yellow.
Triple ycxcz_from_linear(const Triple& rgb)
{
  const Triple xyz = multiply(kXyzFromRgb, rgb);
  return {116 * xyz[1] - 16, 500 * (xyz[0] - xyz[1]), 200 * (xyz[1] - xyz[2])};
}

Triple linear_from_ycxcz(const Triple& opponent)
{
  const float y = (opponent[0] + 16) / 116;
  return multiply(kRgbFromXyz, {y + opponent[1] / 500, y, y - opponent[2] / 200});
}

/// CIELAB, with chroma scaled by lightness for the Hunt effect: colours of dark places differ less.
Triple hunt_lab_from_linear(const Triple& rgb)
{
  const auto f = [](float t) {
    constexpr float kDelta = 6.f / 29;
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.f / 29;
  };
  const Triple xyz = multiply(kXyzFromRgb, rgb);
  const float fx = f(xyz[0]), fy = f(xyz[1]), fz = f(xyz[2]);
  const float L = 116 * fy - 16;
  return {L, .01f * L * 500 * (fx - fy), .01f * L * 200 * (fy - fz)};
}

/// HyAB: city block in lightness, Euclidean in chroma; holds for large differences too.
float hyab(const Triple& a, const Triple& b) { return std::abs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]); }

/// Filters rows with one kernel and columns with another; pixels outside repeat the edge.
Plane convolve(const Plane& plane, int width, int height, const Kernel& along_x, const Kernel& along_y)
{
  const int radius = static_cast<int>(along_x.size() / 2);
  const std::size_t row_size = static_cast<std::size_t>(width);
  Plane rows(plane.size());
  std::vector<float> padded(row_size + 2 * static_cast<std::size_t>(radius));
  for (int y = 0; y < height; ++y) {
    const float* row = plane.data() + static_cast<std::size_t>(y) * row_size;
    for (int x = 0; x < width + 2 * radius; ++x) {
      padded[static_cast<std::size_t>(x)] = row[std::clamp(x - radius, 0, width - 1)];
    }
    float* target = rows.data() + static_cast<std::size_t>(y) * row_size;
    for (std::size_t x = 0; x < row_size; ++x) {
      float sum = 0;
      for (std::size_t k = 0; k < along_x.size(); ++k) {
        sum += along_x[k] * padded[x + k];
      }
      target[x] = sum;
    }
  }
  Plane result(plane.size());
  for (int y = 0; y < height; ++y) {
    float* target = result.data() + static_cast<std::size_t>(y) * row_size;
    for (int k = -radius; k <= radius; ++k) {
      const float* row = rows.data() + static_cast<std::size_t>(std::clamp(y + k, 0, height - 1)) * row_size;
      const int tap = k + radius;
      const float weight = along_y[static_cast<std::size_t>(tap)];
      for (std::size_t x = 0; x < row_size; ++x) {
        target[x] += weight * row[x];
      }
    }
  }
  return result;
}

// ---- Spatial filtering (section 4.1.1): what the eye's contrast sensitivity blurs away --------------------------------------

/// One term a·√(π/b)·exp(−π²x²/b) of a channel's filter, x in degrees.
struct SensitivityTerm {
  float a, b;
};

// Table 1 of the paper. The chroma channel blue-yellow is the sum of two Gaussians.
constexpr SensitivityTerm kAchromatic{1.f, .0047f};
constexpr SensitivityTerm kRedGreen{1.f, .0053f};
constexpr SensitivityTerm kBlueYellow[2] = {{34.1f, .04f}, {13.5f, .025f}};

/// Three standard deviations of the widest term, for all channels alike.
int sensitivity_radius(float pixels_per_degree)
{
  return static_cast<int>(std::ceil(3 * std::sqrt(kBlueYellow[0].b / (2 * kPi * kPi)) * pixels_per_degree));
}

/// Samples of exp(−π²x²/b). The two-dimensional Gaussian is the product of two of these.
Kernel gaussian_make(float b, int radius, float pixels_per_degree)
{
  Kernel kernel;
  for (int i = -radius; i <= radius; ++i) {
    const float x = static_cast<float>(i) / pixels_per_degree;
    kernel.push_back(std::exp(-kPi * kPi * x * x / b));
  }
  return kernel;
}

float sum_of(const Kernel& kernel)
{
  float sum = 0;
  for (float weight : kernel) {
    sum += weight;
  }
  return sum;
}

Kernel scaled(Kernel kernel, float factor)
{
  for (float& weight : kernel) {
    weight *= factor;
  }
  return kernel;
}

Plane filter_achromatic(const Plane& plane, int width, int height, SensitivityTerm term, float pixels_per_degree)
{
  const Kernel kernel = gaussian_make(term.b, sensitivity_radius(pixels_per_degree), pixels_per_degree);
  const Kernel unit = scaled(kernel, 1 / sum_of(kernel));
  return convolve(plane, width, height, unit, unit);
}

Plane filter_blue_yellow(const Plane& plane, int width, int height, float pixels_per_degree)
{
  Plane result(plane.size());
  std::array<Kernel, 2> kernels;
  std::array<float, 2> heights{};
  float total = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    kernels[i] = gaussian_make(kBlueYellow[i].b, sensitivity_radius(pixels_per_degree), pixels_per_degree);
    heights[i] = kBlueYellow[i].a * std::sqrt(kPi / kBlueYellow[i].b);
    total += heights[i] * sum_of(kernels[i]) * sum_of(kernels[i]);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const Plane part = convolve(plane, width, height, scaled(kernels[i], heights[i] / total), kernels[i]);
    std::transform(result.begin(), result.end(), part.begin(), result.begin(), std::plus<>());
  }
  return result;
}

// ---- Feature detection (section 4.2): edges and points of the luminance ------------------------------------------------------

constexpr float kFeatureWidthDegrees = .082f;

struct FeatureKernels {
  Kernel gaussian, edge, point;
};

/// Makes the positive weights sum to 1 and the negative ones to −1.
Kernel balanced(Kernel kernel)
{
  float positive = 0, negative = 0;
  for (float weight : kernel) {
    (weight > 0 ? positive : negative) += std::abs(weight);
  }
  for (float& weight : kernel) {
    weight /= weight > 0 ? positive : negative;
  }
  return kernel;
}

FeatureKernels feature_kernels_make(float pixels_per_degree)
{
  const float sigma = .5f * kFeatureWidthDegrees * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  FeatureKernels kernels;
  for (int i = -radius; i <= radius; ++i) {
    const float x = static_cast<float>(i);
    const float g = std::exp(-x * x / (2 * sigma * sigma));
    kernels.gaussian.push_back(g);
    kernels.edge.push_back(-x * g);
    kernels.point.push_back((x * x / (sigma * sigma) - 1) * g);
  }
  kernels.gaussian = scaled(kernels.gaussian, 1 / sum_of(kernels.gaussian));
  kernels.edge = balanced(kernels.edge);
  kernels.point = balanced(kernels.point);
  return kernels;
}

/// Length of the gradient-like vector that a kernel finds across and along.
Plane feature_sizes(const Plane& luminance, int width, int height, const Kernel& kernel, const Kernel& gaussian)
{
  Plane across = convolve(luminance, width, height, kernel, gaussian);
  const Plane along = convolve(luminance, width, height, gaussian, kernel);
  std::transform(across.begin(), across.end(), along.begin(), across.begin(),
                 [](float x, float y) { return std::hypot(x, y); });
  return across;
}

// ---- The two pipelines of Fig. 2 --------------------------------------------------------------------------------------------

/// What both pipelines need of one picture.
struct Perceived {
  Planes hunt_lab;      ///< filtered as the eye does
  Plane edges, points;  ///< feature strengths of the unfiltered luminance
};

/// The display's value: exposed and clamped. NaN becomes 0.
float displayed(float linear, float gain)
{
  const float value = linear * gain;
  return value > 0 ? std::min(value, 1.f) : 0.f;
}

Planes ycxcz_planes(const ImageView& image, float gain)
{
  Planes planes;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Triple opponent =
          ycxcz_from_linear({displayed(image.channels[0].at(x, y), gain), displayed(image.channels[1].at(x, y), gain),
                             displayed(image.channels[2].at(x, y), gain)});
      for (std::size_t i = 0; i < 3; ++i) {
        planes[i].push_back(opponent[i]);
      }
    }
  }
  return planes;
}

Perceived perceive(const ImageView& image, const FlipOptions& options)
{
  const float pixels_per_degree = static_cast<float>(options.pixels_per_degree);
  const int width = image.width, height = image.height;
  const Planes opponent = ycxcz_planes(image, static_cast<float>(std::exp2(options.exposure)));
  Perceived result;
  result.hunt_lab[0] = filter_achromatic(opponent[0], width, height, kAchromatic, pixels_per_degree);
  result.hunt_lab[1] = filter_achromatic(opponent[1], width, height, kRedGreen, pixels_per_degree);
  result.hunt_lab[2] = filter_blue_yellow(opponent[2], width, height, pixels_per_degree);
  for (std::size_t i = 0; i < opponent[0].size(); ++i) {
    Triple rgb = linear_from_ycxcz({result.hunt_lab[0][i], result.hunt_lab[1][i], result.hunt_lab[2][i]});
    for (float& channel : rgb) {
      channel = std::clamp(channel, 0.f, 1.f);
    }
    const Triple lab = hunt_lab_from_linear(rgb);
    for (std::size_t c = 0; c < 3; ++c) {
      result.hunt_lab[c][i] = lab[c];
    }
  }
  Plane luminance = opponent[0];
  for (float& value : luminance) {
    value = (value + 16) / 116;
  }
  const FeatureKernels kernels = feature_kernels_make(pixels_per_degree);
  result.edges = feature_sizes(luminance, width, height, kernels.edge, kernels.gaussian);
  result.points = feature_sizes(luminance, width, height, kernels.point, kernels.gaussian);
  return result;
}

/// Colour difference in [0, 1] (section 4.1.3): compressed by a power, then by two lines that meet at (p_c·max, p_t).
float color_error(const Triple& a, const Triple& b)
{
  constexpr float kPower = .7f, kMeetAt = .4f, kMeetValue = .95f;
  // The largest difference that a display can show is between its green and its blue.
  static const float largest = std::pow(hyab(hunt_lab_from_linear({0, 1, 0}), hunt_lab_from_linear({0, 0, 1})), kPower);
  const float error = std::pow(hyab(a, b), kPower);
  const float meet = kMeetAt * largest;
  if (error < meet) return kMeetValue / meet * error;
  return std::min(1.f, kMeetValue + (error - meet) / (largest - meet) * (1 - kMeetValue));
}

}  // namespace

std::vector<float> flip_map(const ImageView& a, const ImageView& b, const FlipOptions& options)
{
  RELIEF_ASSERT(a.width == b.width && a.height == b.height);
  RELIEF_ASSERT(a.channels.size() >= 3 && b.channels.size() >= 3);
  constexpr std::uint64_t kPixelBytes = 40 * sizeof(float);
  memory_require(static_cast<std::uint64_t>(a.width) * static_cast<std::uint64_t>(a.height) * kPixelBytes, "FLIP");
  const Perceived seen_a = perceive(a, options), seen_b = perceive(b, options);
  std::vector<float> map(seen_a.edges.size());
  for (std::size_t i = 0; i < map.size(); ++i) {
    const float color = color_error({seen_a.hunt_lab[0][i], seen_a.hunt_lab[1][i], seen_a.hunt_lab[2][i]},
                                    {seen_b.hunt_lab[0][i], seen_b.hunt_lab[1][i], seen_b.hunt_lab[2][i]});
    // Feature differences are at most √2, the length of (1, 1).
    const float difference =
        std::max(std::abs(seen_a.edges[i] - seen_b.edges[i]), std::abs(seen_a.points[i] - seen_b.points[i]));
    const float feature = std::min(1.f, std::sqrt(difference / std::sqrt(2.f)));
    map[i] = std::pow(color, 1 - feature);
  }
  return map;
}

double flip_mean(const std::vector<float>& map)
{
  double sum = 0;
  for (float error : map) {
    sum += double{error};
  }
  return map.empty() ? 0 : sum / static_cast<double>(map.size());
}

}  // namespace relief
