#include "tests/oracle/prepared_surface.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>

namespace relief::oracle {

namespace {

/// Nodes of a tree whose leaves are still larger than a texel; past it, rays split on their own.
constexpr std::size_t kMaxNodes = 8192;
/// Nodes of a tree that is refined within texels, so that leaves of small triangles are nearly flat.
constexpr std::size_t kMinNodes = 128;

/// a + b, without width if that is a double.
Interval sum(double a, double b)
{
  const double result = a + b;
  const double b_part = result - a;
  const double error = (a - (result - b_part)) + (b - b_part);
  return error == 0 ? thin(result) : Interval{round_down(result), round_up(result)};
}

Interval sum(const Interval& a, double b) { return {sum(a.low, b).low, sum(a.high, b).high}; }

/// a · b, without width if that is a double.
Interval product(double a, double b)
{
  const double result = a * b;
  return std::fma(a, b, -result) == 0 ? thin(result) : Interval{round_down(result), round_up(result)};
}

Interval difference(const Interval& a, const Interval& b)
{
  return {sum(a.low, -b.high).low, sum(a.high, -b.low).high};
}

std::int64_t to_int(double value) { return static_cast<std::int64_t>(value); }

/// First and last cell of the lattice that an interval of texel coordinates reaches into.
struct CellRange {
  std::int64_t first, last;
  std::int64_t count() const { return last - first + 1; }
  /// A line of the lattice between the cells, if there is more than one.
  double middle() const
  {
    const std::int64_t line = first + count() / 2;
    return static_cast<double>(line);
  }
};

CellRange cells_of(const Interval& x)
{
  const std::int64_t first = to_int(std::floor(x.low));
  return {first, std::max(first, to_int(std::ceil(x.high)) - 1)};
}

std::int64_t wrapped(std::int64_t i, int size, Wrap wrap)
{
  const std::int64_t n = size;
  switch (wrap) {
    case Wrap::kRepeat:
      return ((i % n) + n) % n;
    case Wrap::kMirror: {
      const std::int64_t phase = ((i % (2 * n)) + 2 * n) % (2 * n);
      return phase < n ? phase : 2 * n - 1 - phase;
    }
    case Wrap::kClamp:
      break;
  }
  return std::clamp<std::int64_t>(i, 0, n - 1);
}

/// Texels at the corners of a range of cells, without those that a wrapped map only repeats.
CellRange distinct_texels(const CellRange& cells, std::int64_t origin, int size, Wrap wrap)
{
  if (wrap == Wrap::kClamp) {
    const std::int64_t end = size - 1;
    return {std::clamp<std::int64_t>(cells.first + origin, 0, end) - origin,
            std::clamp<std::int64_t>(cells.last + 1 + origin, 0, end) - origin};
  }
  return {cells.first, std::min<std::int64_t>(cells.last + 1, cells.first + 2 * size - 1)};
}

double texel_value(const HeightMap& map, std::int64_t x, std::int64_t y)
{
  const std::int64_t column = wrapped(x, map.width, map.wrap_u), row = wrapped(y, map.height, map.wrap_v);
  return map.h[static_cast<std::size_t>(row * map.width + column)];
}

template <typename T>
T as(const Interval& value);
template <>
double as<double>(const Interval& value)
{
  return value.mid();
}
template <>
Interval as<Interval>(const Interval& value)
{
  return value;
}

template <typename T>
T value_of(const Linear& f, const T& p, const T& q)
{
  return as<T>(f.c) + as<T>(f.p_slope) * p + as<T>(f.q_slope) * q;
}

double square_root(double value) { return std::sqrt(value); }
double square(double value) { return value * value; }

/// @return  false if the vector may be zero
bool is_positive(double value) { return value > 0; }
bool is_positive(const Interval& value) { return value.low > 0; }

/// Every component of a unit vector lies in [−1, 1].
double clamped_to_unit(double value) { return value; }
Interval clamped_to_unit(const Interval& value) { return {std::max(value.low, -1.), std::min(value.high, 1.)}; }

/// Where N may vanish, N/|N| can be any unit vector.
void set_unknown_direction(double& component) { component = std::nan(""); }
void set_unknown_direction(Interval& component) { component = {-1, 1}; }

double length(const std::array<Linear, 3>& f, Interval Linear::*slope)
{
  return std::hypot((f[0].*slope).mid(), (f[1].*slope).mid(), (f[2].*slope).mid());
}

}  // namespace

PreparedSurface::PreparedSurface(const DisplacedTriangle& triangle_, const HeightMap& map_)
    : triangle(triangle_), map(map_)
{
  const auto [lowest, highest] = std::minmax_element(map.h.begin(), map.h.end());
  map_range_ = {*lowest, *highest};
  map_magnitude_ = map_range_.magnitude();

  std::array<Interval, 3> x, y;
  for (std::size_t k = 0; k < 3; ++k) {
    x[k] = sum(product(triangle.uv[k][0], map.width), -.5);
    y[k] = sum(product(triangle.uv[k][1], map.height), -.5);
  }
  const double origin_x = std::floor(std::min({x[0].low, x[1].low, x[2].low}));
  const double origin_y = std::floor(std::min({y[0].low, y[1].low, y[2].low}));
  origin_x_ = to_int(origin_x);
  origin_y_ = to_int(origin_y);
  for (std::size_t k = 0; k < 3; ++k) {
    x[k] = sum(x[k], -origin_x);
    y[k] = sum(y[k], -origin_y);
  }

  const double x1 = x[1].mid() - x[0].mid(), x2 = x[2].mid() - x[0].mid();
  const double y1 = y[1].mid() - y[0].mid(), y2 = y[2].mid() - y[0].mid();
  const double longest = std::max({std::hypot(x1, y1), std::hypot(x2, y2), std::hypot(x1 - x2, y1 - y2)});
  // Much thinner triangles fill little of the texels that they cross, and S is far off in the rest. The limit only
  // chooses the better conditioned of two sound ways.
  constexpr double kMinHeight = 1;
  parameters_are_texels = std::abs(x1 * y2 - x2 * y1) > kMinHeight * longest;
  is_mirrored = parameters_are_texels && x1 * y2 < x2 * y1;
  if (parameters_are_texels) {
    set_texel_parameters(x, y);
  } else {
    set_barycentric_parameters(x, y);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Interval P1 = sum(triangle.P[1][axis], -triangle.P[0][axis]);
    const Interval P2 = sum(triangle.P[2][axis], -triangle.P[0][axis]);
    const Interval N0 = thin(triangle.N[0][axis]);
    const Interval N1 = sum(triangle.N[1][axis], -triangle.N[0][axis]);
    const Interval N2 = sum(triangle.N[2][axis], -triangle.N[0][axis]);
    const auto combination = [&](Interval Linear::*member, const Interval& first, const Interval& second) {
      return b_[1].*member * first + b_[2].*member * second;
    };
    P_[axis] = {combination(&Linear::c, P1, P2), combination(&Linear::p_slope, P1, P2),
                combination(&Linear::q_slope, P1, P2)};
    N_[axis] = {N0 + combination(&Linear::c, N1, N2), combination(&Linear::p_slope, N1, N2),
                combination(&Linear::q_slope, N1, N2)};
  }
  build();
}

void PreparedSurface::set_texel_parameters(const std::array<Interval, 3>& x, const std::array<Interval, 3>& y)
{
  const Interval x1 = difference(x[1], x[0]), x2 = difference(x[2], x[0]), x21 = difference(x[2], x[1]);
  const Interval y1 = difference(y[1], y[0]), y2 = difference(y[2], y[0]), y12 = difference(y[1], y[2]);
  const Interval area = x1 * y2 - x2 * y1;
  b_[0].p_slope = y12 / area;
  b_[0].q_slope = x21 / area;
  b_[1].p_slope = y2 / area;
  b_[1].q_slope = -x2 / area;
  b_[2].p_slope = -y1 / area;
  b_[2].q_slope = x1 / area;
  for (std::size_t k = 0; k < 3; ++k) {
    b_[k].c = thin(k == 0 ? 1 : 0) - (b_[k].p_slope * x[0] + b_[k].q_slope * y[0]);
  }
  root = {hull(hull(x[0], x[1]), x[2]), hull(hull(y[0], y[1]), y[2])};
}

void PreparedSurface::set_barycentric_parameters(const std::array<Interval, 3>& x, const std::array<Interval, 3>& y)
{
  b_[0] = {thin(1), thin(-1), thin(-1)};
  b_[1] = {thin(0), thin(1), thin(0)};
  b_[2] = {thin(0), thin(0), thin(1)};
  x_ = {x[0], difference(x[1], x[0]), difference(x[2], x[0])};
  y_ = {y[0], difference(y[1], y[0]), difference(y[2], y[0])};
  root = {{0, 1}, {0, 1}};
}

std::array<Interval, 3> PreparedSurface::barycentric(const Rectangle& domain) const
{
  return {value_of(b_[0], domain.p, domain.q), value_of(b_[1], domain.p, domain.q),
          value_of(b_[2], domain.p, domain.q)};
}

bool PreparedSurface::clip(Rectangle& domain) const
{
  for (const Linear& b : b_) {
    // c + p_slope · p + q_slope · q >= 0
    const auto clip_one = [](Interval& x, const Interval& slope, const Interval& rest) {
      if (slope.low > 0) x.low = std::max(x.low, (-rest / slope).low);
      if (slope.high < 0) x.high = std::min(x.high, (-rest / slope).high);
    };
    clip_one(domain.p, b.p_slope, b.c + b.q_slope * domain.q);
    clip_one(domain.q, b.q_slope, b.c + b.p_slope * domain.p);
    if (!(domain.p.low <= domain.p.high && domain.q.low <= domain.q.high)) return false;
  }
  return true;
}

Interval PreparedSurface::displacement(const Rectangle& domain) const
{
  const Rectangle texels = texels_of(domain);
  Interval h, h_x, h_y;
  height(texels.p, texels.q, h, h_x, h_y);
  return map.scale * (h - thin(map.midlevel));
}

std::array<Interval, 3> PreparedSurface::base_point(const Rectangle& domain) const
{
  return {value_of(P_[0], domain.p, domain.q), value_of(P_[1], domain.p, domain.q),
          value_of(P_[2], domain.p, domain.q)};
}

Vector3 PreparedSurface::normals_axis() const
{
  const auto slope = [&](Interval Linear::*member) -> Vector3 {
    return {(N_[0].*member).mid(), (N_[1].*member).mid(), (N_[2].*member).mid()};
  };
  const Vector3 a = slope(&Linear::p_slope), b = slope(&Linear::q_slope);
  const Vector3 axis{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  const Vector3& N = triangle.N[0];
  const double along = N[0] * axis[0] + N[1] * axis[1] + N[2] * axis[2];
  const double size = std::hypot(axis[0], axis[1], axis[2]) * std::hypot(N[0], N[1], N[2]);
  // The rounding errors of a dozen operations; normals that are perpendicular to nothing are far above.
  return std::abs(along) <= 1e-13 * size ? axis : Vector3{};
}

Rectangle PreparedSurface::texels_of(const Rectangle& domain) const
{
  if (parameters_are_texels) return domain;
  return {value_of(x_, domain.p, domain.q), value_of(y_, domain.p, domain.q)};
}

bool PreparedSurface::is_large(const Rectangle& domain) const
{
  const Rectangle texels = texels_of(domain);
  // Rectangles of barycentric coordinates are not aligned with texels, so there is no end to their straddling.
  const std::int64_t limit = parameters_are_texels ? 1 : 2;
  return cells_of(texels.p).count() > limit || cells_of(texels.q).count() > limit;
}

std::array<Rectangle, 2> PreparedSurface::split(const Rectangle& domain) const
{
  double p_cost = 0, q_cost = 0;
  double p_middle = domain.p.mid(), q_middle = domain.q.mid();
  if (!is_large(domain)) {
    p_cost = domain.p.width() * length(P_, &Linear::p_slope);
    q_cost = domain.q.width() * length(P_, &Linear::q_slope);
  } else if (parameters_are_texels) {
    const CellRange columns = cells_of(domain.p), rows = cells_of(domain.q);
    p_cost = static_cast<double>(columns.count());
    q_cost = static_cast<double>(rows.count());
    p_middle = columns.middle();
    q_middle = rows.middle();
  } else {
    p_cost = domain.p.width() * std::max(x_.p_slope.magnitude(), y_.p_slope.magnitude());
    q_cost = domain.q.width() * std::max(x_.q_slope.magnitude(), y_.q_slope.magnitude());
  }
  if (!(p_cost > 0 || q_cost > 0)) {
    p_cost = domain.p.width() / root.p.width();
    q_cost = domain.q.width() / root.q.width();
  }
  if (p_cost >= q_cost) return {{{{domain.p.low, p_middle}, domain.q}, {{p_middle, domain.p.high}, domain.q}}};
  return {{{domain.p, {domain.q.low, q_middle}}, {domain.p, {q_middle, domain.q.high}}}};
}

double PreparedSurface::texel(std::int64_t x, std::int64_t y) const
{
  return texel_value(map, x + origin_x_, y + origin_y_);
}

Interval PreparedSurface::height_range(const Rectangle& texels) const
{
  const CellRange columns = cells_of(texels.p), rows = cells_of(texels.q);
  if (columns.count() >= 2 * map.width && rows.count() >= 2 * map.height) return map_range_;
  const CellRange x_range = distinct_texels(columns, origin_x_, map.width, map.wrap_u);
  const CellRange y_range = distinct_texels(rows, origin_y_, map.height, map.wrap_v);
  Interval range = thin(texel(x_range.first, y_range.first));
  for (std::int64_t y = y_range.first; y <= y_range.last; ++y) {
    for (std::int64_t x = x_range.first; x <= x_range.last; ++x) range = hull(range, thin(texel(x, y)));
  }
  return range;
}

void PreparedSurface::height(double x, double y, double& h, double& h_x, double& h_y) const
{
  const double column = std::floor(x), row = std::floor(y);
  const std::int64_t i = to_int(column), j = to_int(row);
  const double fx = x - column, fy = y - row;
  const double h00 = texel(i, j), h10 = texel(i + 1, j), h01 = texel(i, j + 1), h11 = texel(i + 1, j + 1);
  h = (1 - fy) * ((1 - fx) * h00 + fx * h10) + fy * ((1 - fx) * h01 + fx * h11);
  h_x = (1 - fy) * (h10 - h00) + fy * (h11 - h01);
  h_y = (1 - fx) * (h01 - h00) + fx * (h11 - h10);
}

void PreparedSurface::height(const Interval& x, const Interval& y, Interval& h, Interval& h_x, Interval& h_y) const
{
  // A dozen operations on numbers of this size.
  const double error = 16 * rounding_bound(map_magnitude_);
  bool is_first = true;
  const auto include = [&](Interval& range, double a, double b) {
    const Interval part{std::min(a, b) - error, std::max(a, b) + error};
    range = is_first ? part : hull(range, part);
  };
  const CellRange columns = cells_of(x), rows = cells_of(y);
  for (std::int64_t j = rows.first; j <= rows.last; ++j) {
    for (std::int64_t i = columns.first; i <= columns.last; ++i) {
      const double column = static_cast<double>(i), row = static_cast<double>(j);
      // Differences with the cell's corner are exact.
      const double x0 = std::clamp(x.low - column, 0., 1.), x1 = std::clamp(x.high - column, 0., 1.);
      const double y0 = std::clamp(y.low - row, 0., 1.), y1 = std::clamp(y.high - row, 0., 1.);
      const double h00 = texel(i, j), h10 = texel(i + 1, j), h01 = texel(i, j + 1), h11 = texel(i + 1, j + 1);
      const auto slope_x = [&](double fy) { return (1 - fy) * (h10 - h00) + fy * (h11 - h01); };
      const auto slope_y = [&](double fx) { return (1 - fx) * (h01 - h00) + fx * (h11 - h10); };
      const auto bilinear = [&](double fx, double fy) {
        return (1 - fy) * ((1 - fx) * h00 + fx * h10) + fy * ((1 - fx) * h01 + fx * h11);
      };
      // A bilinear function is extreme at corners, and its slopes at ends.
      const double a = bilinear(x0, y0), b = bilinear(x1, y0), c = bilinear(x0, y1), d = bilinear(x1, y1);
      include(h, std::min(std::min(a, b), std::min(c, d)), std::max(std::max(a, b), std::max(c, d)));
      include(h_x, slope_x(y0), slope_x(y1));
      include(h_y, slope_y(x0), slope_y(x1));
      is_first = false;
    }
  }
}

template <typename T>
Patch<T> PreparedSurface::evaluate(const T& p, const T& q, bool with_derivatives) const
{
  constexpr bool kIsInterval = std::is_same_v<T, Interval>;
  T x = p, y = q;
  if (!parameters_are_texels) {
    x = value_of(x_, p, q);
    y = value_of(y_, p, q);
  }
  T h{}, h_x{}, h_y{};
  if constexpr (kIsInterval) {
    constexpr std::int64_t kMaxCellsAcross = 4;
    if (cells_of(x).count() <= kMaxCellsAcross && cells_of(y).count() <= kMaxCellsAcross) {
      height(x, y, h, h_x, h_y);
    } else {
      h = height_range({x, y});
      with_derivatives = false;
    }
  } else {
    height(x, y, h, h_x, h_y);
  }
  const T scale = as<T>(thin(map.scale));
  const T d = scale * (h - as<T>(thin(map.midlevel)));

  Patch<T> patch;
  std::array<T, 3> N{}, n{};
  for (std::size_t k = 0; k < 3; ++k) N[k] = value_of(N_[k], p, q);
  const T length_squared = square(N[0]) + square(N[1]) + square(N[2]);
  const bool has_direction = is_positive(length_squared);
  const T inverse_length = has_direction ? as<T>(thin(1)) / square_root(length_squared) : T{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (has_direction) {
      n[k] = clamped_to_unit(N[k] * inverse_length);
    } else {
      set_unknown_direction(n[k]);
    }
    patch.S[k] = value_of(P_[k], p, q) + d * n[k];
  }
  patch.has_derivatives = with_derivatives && has_direction;
  if (!patch.has_derivatives) return patch;

  T d_p = scale * h_x, d_q = scale * h_y;
  if (!parameters_are_texels) {
    d_p = scale * (h_x * as<T>(x_.p_slope) + h_y * as<T>(y_.p_slope));
    d_q = scale * (h_x * as<T>(x_.q_slope) + h_y * as<T>(y_.q_slope));
  }
  const auto derivative = [&](Interval Linear::*slope, const T& d_slope, std::array<T, 3>& S_slope) {
    const std::array<T, 3> N_slope{as<T>(N_[0].*slope), as<T>(N_[1].*slope), as<T>(N_[2].*slope)};
    const T along = n[0] * N_slope[0] + n[1] * N_slope[1] + n[2] * N_slope[2];
    const T s = d * inverse_length;
    for (std::size_t k = 0; k < 3; ++k) {
      S_slope[k] = as<T>(P_[k].*slope) + d_slope * n[k] + s * (N_slope[k] - along * n[k]);
    }
  };
  derivative(&Linear::p_slope, d_p, patch.S_p);
  derivative(&Linear::q_slope, d_q, patch.S_q);
  return patch;
}

template Patch<double> PreparedSurface::evaluate(const double&, const double&, bool) const;
template Patch<Interval> PreparedSurface::evaluate(const Interval&, const Interval&, bool) const;

void PreparedSurface::build()
{
  nodes.push_back({root});
  for (std::size_t index = 0; index < nodes.size(); ++index) {
    const Rectangle domain = nodes[index].domain;
    if (nodes.size() >= (is_large(domain) ? kMaxNodes : kMinNodes)) continue;
    nodes[index].first_child = static_cast<std::int32_t>(nodes.size());
    for (Rectangle half : split(domain)) {
      if (clip(half)) nodes.push_back({half});
    }
    nodes[index].num_children = static_cast<std::int32_t>(nodes.size()) - nodes[index].first_child;
  }
  for (std::size_t index = nodes.size(); index-- > 0;) {
    SurfaceNode& node = nodes[index];
    if (node.num_children > 0) {
      node.box = nodes[static_cast<std::size_t>(node.first_child)].box;
      for (std::int32_t child = node.first_child + 1; child < node.first_child + node.num_children; ++child) {
        const SurfaceNode& other = nodes[static_cast<std::size_t>(child)];
        for (std::size_t k = 0; k < 3; ++k) node.box[k] = hull(node.box[k], other.box[k]);
      }
      continue;
    }
    const Patch<Interval> patch = evaluate(node.domain.p, node.domain.q, true);
    node.box = patch.S;
    if (patch.has_derivatives && !is_large(node.domain)) {
      const Patch<Interval> center = evaluate(thin(node.domain.p.mid()), thin(node.domain.q.mid()), false);
      node.patch_index = static_cast<std::int32_t>(patches.size());
      patches.push_back({center.S, patch});
    }
  }
}

}  // namespace relief::oracle
