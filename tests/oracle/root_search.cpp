#include "tests/oracle/root_search.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace relief::oracle {

namespace {

using Interval3 = std::array<Interval, 3>;

/// Rectangles looked at within one leaf, and of one ray, before the rest is called undecided. A ray that lies in the
/// surface would need all there are.
constexpr std::size_t kMaxRectanglesInLeaf = 1024, kMaxRectangles = 1 << 18;
/// A ray with that many undecided rectangles lies in the surface, and the next leaves are given up sooner.
constexpr std::size_t kManyUndecided = 512, kMaxRectanglesInLeafAfter = 16;
/// Smallest rectangle, relative to a texel or to the triangle. Two roots closer to each other than this are one
/// undecided one; what matters is that it is well above the rounding errors of S.
constexpr double kMinWidth = 0x1p-34;
/// The same where N may vanish.
constexpr double kMinWidthAtSingularity = 0x1p-20;

Interval dot(const Vector3& a, const Interval3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 cross(const Vector3& a, const Vector3& b)
{
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double length(const Vector3& a) { return std::hypot(a[0], a[1], a[2]); }
Vector3 mid(const Interval3& a) { return {a[0].mid(), a[1].mid(), a[2].mid()}; }

/// What is known of a rectangle after one step.
struct Contraction {
  bool is_empty = false;   ///< no root
  bool is_single = false;  ///< at most one root
  bool is_proven = false;  ///< exactly one root, but for the rounding of the equations without t
  Rectangle rectangle;     ///< every root is in here
};

/// A root that exists and is the only one of a rectangle.
struct Root {
  Rectangle neighbourhood;  ///< holds no other root
  Rectangle bracket;        ///< holds the root
  Interval t;
};

class RootSearch {
 public:
  RootSearch(const PreparedSurface& surface, const Ray& ray) : surface_(surface), ray_(ray)
  {
    for (std::size_t k = 0; k < 3; ++k) {
      O_[k] = thin(ray.O[k]) - thin(surface.triangle.P[0][k]);
      D_[k] = thin(ray.D[k]);
    }
    unit_p_ = surface.parameters_are_texels ? std::min(1., surface.root.p.width()) : 1;
    unit_q_ = surface.parameters_are_texels ? std::min(1., surface.root.q.width()) : 1;
    const bool has_normals =
        length(surface.triangle.N[0]) > 0 || length(surface.triangle.N[1]) > 0 || length(surface.triangle.N[2]) > 0;
    is_valid_ = has_normals && length(ray.D) > 0 && std::isfinite(length(ray.D)) && std::isfinite(length(ray.O));
  }

  std::vector<Hit> run();

 private:
  bool clip(const Interval3& box, Interval& t) const;
  void search_large(const Rectangle& domain);
  void search(const Rectangle& domain, const LeafPatch* leaf);
  Contraction contract(const Rectangle& domain,
                       const Interval3& S_center,
                       const Patch<Interval>& patch,
                       const Interval& t) const;
  std::optional<Root> find_root(const Rectangle& domain) const;
  std::optional<Root> prove(double p_start, double q_start, double radius) const;
  bool is_small(const Rectangle& r, const Patch<Interval>& patch) const
  {
    const double width = patch.has_derivatives ? kMinWidth : kMinWidthAtSingularity;
    return r.p.width() <= width * unit_p_ && r.q.width() <= width * unit_q_;
  }
  std::array<Rectangle, 2> halves(const Rectangle& r, const Patch<Interval>& patch) const;
  bool is_covered(const Rectangle& r) const;
  void add_root(const Root& root);
  void add_undecided(const Rectangle& domain, const Patch<Interval>& patch, const Interval& t);
  Hit make_hit(double p, double q, const Interval& t) const;
  std::vector<Hit> collect() const;

  const PreparedSurface& surface_;
  const Ray& ray_;
  Interval3 O_{}, D_{};  ///< O relative to corner 0
  double unit_p_ = 1, unit_q_ = 1;
  bool is_valid_ = false;
  std::size_t num_rectangles_ = 0;
  std::vector<Root> roots_;
  std::vector<Hit> undecided_;
};

std::vector<Hit> RootSearch::run()
{
  if (!is_valid_) return {};
  std::vector<std::int32_t> stack{0};
  while (!stack.empty()) {
    const SurfaceNode& node = surface_.nodes[static_cast<std::size_t>(stack.back())];
    stack.pop_back();
    Interval t;
    if (!clip(node.box, t)) continue;
    if (node.num_children > 0) {
      for (std::int32_t child = 0; child < node.num_children; ++child) stack.push_back(node.first_child + child);
    } else if (node.patch_index >= 0) {
      const LeafPatch& leaf = surface_.patches[static_cast<std::size_t>(node.patch_index)];
      if (!contract(node.domain, leaf.S_center, leaf.patch, t).is_empty) search(node.domain, &leaf);
    } else {
      search_large(node.domain);
    }
  }
  return collect();
}

/// @param t  set to the ray's part in the box, within its limits
/// @return   false if there is none
bool RootSearch::clip(const Interval3& box, Interval& t) const
{
  t = {ray_.t_min, ray_.t_max};
  for (std::size_t k = 0; k < 3; ++k) {
    const double low = round_down(box[k].low - O_[k].high), high = round_up(box[k].high - O_[k].low);
    if (ray_.D[k] == 0) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    const double first = low / ray_.D[k], second = high / ray_.D[k];
    t.low = std::max(t.low, round_down(std::min(first, second)));
    t.high = std::min(t.high, round_up(std::max(first, second)));
  }
  return t.low <= t.high;
}

/// Leaves of more than a texel.
void RootSearch::search_large(const Rectangle& domain)
{
  std::vector<Rectangle> stack{domain};
  while (!stack.empty()) {
    Rectangle rectangle = stack.back();
    stack.pop_back();
    if (!surface_.clip(rectangle)) continue;
    Interval t;
    if (!clip(surface_.evaluate(rectangle.p, rectangle.q, false).S, t)) continue;
    if (!surface_.is_large(rectangle)) {
      search(rectangle, nullptr);
      continue;
    }
    for (const Rectangle& half : surface_.split(rectangle)) stack.push_back(half);
  }
}

/// @param leaf  what is known of the whole domain already, or null
void RootSearch::search(const Rectangle& domain, const LeafPatch* leaf)
{
  // First in, first out: what the limit leaves undecided is then equally small everywhere.
  std::vector<Rectangle> queue{domain};
  for (std::size_t index = 0; index < queue.size(); ++index) {
    Rectangle rectangle = queue[index];
    const bool is_known = index == 0 && leaf;
    if (!is_known && !surface_.clip(rectangle)) continue;
    if (is_covered(rectangle)) continue;
    ++num_rectangles_;
    const Patch<Interval> patch = is_known ? leaf->patch : surface_.evaluate(rectangle.p, rectangle.q, true);
    Interval t;
    if (!clip(patch.S, t)) continue;
    Rectangle rest = rectangle;
    if (patch.has_derivatives) {
      const Interval3 S_center =
          is_known ? leaf->S_center : surface_.evaluate(thin(rectangle.p.mid()), thin(rectangle.q.mid()), false).S;
      const Contraction contraction = contract(rectangle, S_center, patch, t);
      if (contraction.is_empty) continue;
      rest = contraction.rectangle;
      const bool is_tiny = rest.p.width() < 0x1p-16 * unit_p_ && rest.q.width() < 0x1p-16 * unit_q_;
      if (contraction.is_single && (contraction.is_proven || is_tiny)) {
        if (const std::optional<Root> root = find_root(rest)) {
          add_root(*root);
          if (rectangle.p.contains(root->bracket.p) && rectangle.q.contains(root->bracket.q)) {
            continue;
          }
        }
      }
      if (is_covered(rest)) continue;
    }
    const std::size_t limit = undecided_.size() < kManyUndecided ? kMaxRectanglesInLeaf : kMaxRectanglesInLeafAfter;
    if (is_small(rest, patch) || queue.size() > limit || num_rectangles_ > kMaxRectangles) {
      add_undecided(rest, patch, t);
      continue;
    }
    const double p_ratio = rest.p.width() / rectangle.p.width(), q_ratio = rest.q.width() / rectangle.q.width();
    if (p_ratio * q_ratio < .25) {
      queue.push_back(rest);
      continue;
    }
    for (const Rectangle& half : halves(rest, patch)) queue.push_back(half);
  }
}

/// Halves of a rectangle, cut where S is longest.
std::array<Rectangle, 2> RootSearch::halves(const Rectangle& r, const Patch<Interval>& patch) const
{
  const double p_size = r.p.width() / unit_p_, q_size = r.q.width() / unit_q_;
  double p_cost = p_size, q_cost = q_size;
  // A direction along which S does not move is still halved now and then: N may turn there.
  constexpr double kMaxRatio = 64;
  if (patch.has_derivatives && p_size <= kMaxRatio * q_size && q_size <= kMaxRatio * p_size) {
    p_cost = r.p.width() * length(mid(patch.S_p));
    q_cost = r.q.width() * length(mid(patch.S_q));
  }
  if (p_cost >= q_cost) return {{{{r.p.low, r.p.mid()}, r.q}, {{r.p.mid(), r.p.high}, r.q}}};
  return {{{r.p, {r.q.low, r.q.mid()}}, {r.p, {r.q.mid(), r.q.high}}}};
}

/// One step of Hansen and Sengupta on the two combinations of the equations that do not hold t.
Contraction RootSearch::contract(const Rectangle& domain,
                                 const Interval3& S_center,
                                 const Patch<Interval>& patch,
                                 const Interval& t) const
{
  Contraction result;
  result.rectangle = domain;
  const Vector3 S_p = mid(patch.S_p), S_q = mid(patch.S_q);
  // The first direction is perpendicular to S_q, the second to S_p, both to D up to rounding.
  const Vector3 directions[2] = {cross(S_q, ray_.D), cross(ray_.D, S_p)};
  const double p_mid = domain.p.mid(), q_mid = domain.q.mid();
  const Interval p = domain.p - thin(p_mid), q = domain.q - thin(q_mid);
  Interval F[2], F_p[2], F_q[2];
  for (int row = 0; row < 2; ++row) {
    const Vector3& direction = directions[row];
    F[row] = dot(direction, {S_center[0] - O_[0], S_center[1] - O_[1], S_center[2] - O_[2]}) - dot(direction, D_) * t;
    F_p[row] = dot(direction, patch.S_p);
    F_q[row] = dot(direction, patch.S_q);
    const Interval range = F[row] + F_p[row] * p + F_q[row] * q;
    if (range.low > 0 || range.high < 0) {
      result.is_empty = true;
      return result;
    }
  }
  result.is_single = F_p[0].mignitude() * p.width() > F_q[0].magnitude() * q.width() &&
                     F_q[1].mignitude() * q.width() > F_p[1].magnitude() * p.width();
  if (!result.is_single) return result;
  const Interval p_new = -(F[0] + F_q[0] * q) / F_p[0];
  if (!p.overlaps(p_new)) {
    result.is_empty = true;
    return result;
  }
  const Interval p_rest = intersection(p, p_new);
  const Interval q_new = -(F[1] + F_p[1] * p_rest) / F_q[1];
  if (!q.overlaps(q_new)) {
    result.is_empty = true;
    return result;
  }
  const Interval q_rest = intersection(q, q_new);
  result.is_proven = p.holds_strictly(p_new) && q.holds_strictly(q_new);
  const Interval p_found = thin(p_mid) + p_rest, q_found = thin(q_mid) + q_rest;
  if (p_found.overlaps(domain.p)) result.rectangle.p = intersection(p_found, domain.p);
  if (q_found.overlaps(domain.q)) result.rectangle.q = intersection(q_found, domain.q);
  return result;
}

/// @return  a root in or next to the rectangle, if one can be proven
std::optional<Root> RootSearch::find_root(const Rectangle& domain) const
{
  double p = domain.p.mid(), q = domain.q.mid();
  const Vector3 O = mid(O_);
  for (int step = 0; step < 12; ++step) {
    const Patch<double> patch = surface_.evaluate(p, q, true);
    const Vector3 distance{patch.S[0] - O[0], patch.S[1] - O[1], patch.S[2] - O[2]};
    const Vector3 first = cross(patch.S_q, ray_.D), second = cross(ray_.D, patch.S_p);
    const double determinant = dot(first, patch.S_p);
    const double dp = -dot(first, distance) / determinant, dq = -dot(second, distance) / determinant;
    if (!std::isfinite(dp) || !std::isfinite(dq)) return {};
    p = std::clamp(p + dp, domain.p.low - .5 * domain.p.width(), domain.p.high + .5 * domain.p.width());
    q = std::clamp(q + dq, domain.q.low - .5 * domain.q.width(), domain.q.high + .5 * domain.q.width());
    if (std::abs(dp) < 1e-15 * unit_p_ && std::abs(dq) < 1e-15 * unit_q_) break;
  }
  for (const double radius : {0x1p-16, 0x1p-24, 0x1p-32, 0x1p-38, 0x1p-44}) {
    if (std::optional<Root> root = prove(p, q, radius)) return root;
  }
  return {};
}

/// Krawczyk's test of all three equations around a point, in which the triangle and the map go on past their borders.
std::optional<Root> RootSearch::prove(double p_start, double q_start, double radius) const
{
  Root root;
  root.bracket = {thin(p_start) + Interval{-radius * unit_p_, radius * unit_p_},
                  thin(q_start) + Interval{-radius * unit_q_, radius * unit_q_}};
  root.neighbourhood = root.bracket;
  // The first pass proves the root. The others narrow its bracket, slowly while a border of texels runs through it.
  constexpr int kMaxPasses = 64;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    Interval& p_range = root.bracket.p;
    Interval& q_range = root.bracket.q;
    const double p = p_range.mid(), q = q_range.mid();
    const Interval3 S = surface_.evaluate(thin(p), thin(q), false).S;
    const Patch<Interval> patch = surface_.evaluate(p_range, q_range, true);
    if (!patch.has_derivatives) return {};
    const Interval3 S_O{S[0] - O_[0], S[1] - O_[1], S[2] - O_[2]};
    const double t = pass == 0 ? dot(ray_.D, mid(S_O)) / dot(ray_.D, ray_.D) : root.t.mid();
    const Interval3 F{S_O[0] - t * D_[0], S_O[1] - t * D_[1], S_O[2] - t * D_[2]};
    const Vector3 S_p = mid(patch.S_p), S_q = mid(patch.S_q);
    const Vector3 rows[3] = {cross(S_q, ray_.D), cross(ray_.D, S_p), cross(S_q, S_p)};
    const double determinant = dot(rows[0], S_p);
    if (!(std::abs(determinant) > 0) || !std::isfinite(1 / determinant)) return {};

    Interval offset[3] = {p_range - thin(p), q_range - thin(q), pass == 0 ? thin(0) : root.t - thin(t)};
    const auto image = [&](std::size_t row) {
      const Vector3 Y{rows[row][0] / determinant, rows[row][1] / determinant, rows[row][2] / determinant};
      return (thin(row == 0 ? 1 : 0) - dot(Y, patch.S_p)) * offset[0] +
             (thin(row == 1 ? 1 : 0) - dot(Y, patch.S_q)) * offset[1] +
             (thin(row == 2 ? 1 : 0) + dot(Y, D_)) * offset[2] - dot(Y, F);
    };
    if (pass == 0) {
      // t is not known beforehand: twice what p and q make of it.
      const double t_radius = 2 * image(2).magnitude();
      offset[2] = {-t_radius, t_radius};
      root.t = widened(thin(t), t_radius);
    }
    const Interval images[3] = {image(0), image(1), image(2)};
    for (int k = 0; k < 3; ++k) {
      if (pass == 0 && !offset[k].holds_strictly(images[k])) return {};
    }
    const Interval p_new = thin(p) + images[0], q_new = thin(q) + images[1], t_new = thin(t) + images[2];
    // Outward rounding keeps them together; numbers that overflowed may not be.
    if (!p_range.overlaps(p_new) || !q_range.overlaps(q_new) || !root.t.overlaps(t_new)) break;
    const bool is_narrowing = p_new.width() < .9 * p_range.width() || q_new.width() < .9 * q_range.width() ||
                              t_new.width() < .9 * root.t.width();
    p_range = intersection(p_range, p_new);
    q_range = intersection(q_range, q_new);
    root.t = intersection(root.t, t_new);
    if (!is_narrowing) break;
  }
  return root;
}

/// Every root in the rectangle is a known one.
bool RootSearch::is_covered(const Rectangle& r) const
{
  return std::any_of(roots_.begin(), roots_.end(), [&](const Root& root) {
    return root.neighbourhood.p.contains(r.p) && root.neighbourhood.q.contains(r.q);
  });
}

void RootSearch::add_root(const Root& root)
{
  const auto holds = [](const Rectangle& a, const Rectangle& b) { return a.p.contains(b.p) && a.q.contains(b.q); };
  for (const Root& other : roots_) {
    if (holds(other.neighbourhood, root.bracket) || holds(root.neighbourhood, other.bracket)) return;
  }
  roots_.push_back(root);
}

Hit RootSearch::make_hit(double p, double q, const Interval& t) const
{
  const DisplacedTriangle& triangle = surface_.triangle;
  const std::array<Interval, 3> b = surface_.barycentric({thin(p), thin(q)});
  const Patch<double> patch = surface_.evaluate(p, q, true);
  Hit hit;
  hit.t_low = t.low;
  hit.t_high = t.high;
  hit.t = t.mid();
  hit.b = {b[1].mid(), b[2].mid()};
  for (std::size_t k = 0; k < 3; ++k) {
    hit.P[k] = std::isfinite(patch.S[k]) ? triangle.P[0][k] + patch.S[k] : ray_.O[k] + hit.t * ray_.D[k];
  }
  for (std::size_t k = 0; k < 2; ++k) {
    hit.uv[k] = triangle.uv[0][k] + hit.b[0] * (triangle.uv[1][k] - triangle.uv[0][k]) +
                hit.b[1] * (triangle.uv[2][k] - triangle.uv[0][k]);
  }
  // The parameters may run round the triangle the other way than b1 and b2 do.
  const Vector3 product = surface_.is_mirrored ? cross(patch.S_q, patch.S_p) : cross(patch.S_p, patch.S_q);
  hit.Ng = normal_oriented(triangle, hit.b, product);
  return hit;
}

void RootSearch::add_undecided(const Rectangle& domain, const Patch<Interval>& patch, const Interval& t)
{
  const double p = domain.p.mid(), q = domain.q.mid();
  if (patch.has_derivatives || !is_small(domain, patch)) {
    undecided_.push_back(make_hit(p, q, t));
    return;
  }
  // S is not defined where N vanishes. Its closure is part of the circle of radius |d| around P that is perpendicular
  // to the axis of the normals, or of a sphere if they have none; only a ray through it is in doubt.
  const Interval3 P = surface_.base_point(domain);
  const Interval d = surface_.displacement(domain);
  const Vector3 center = mid(P), axis = surface_.normals_axis();
  const double radius = std::abs(d.mid());
  const double tolerance = d.width() + P[0].width() + P[1].width() + P[2].width() + 1e-6 * radius;
  const Vector3 from_center{O_[0].mid() - center[0], O_[1].mid() - center[1], O_[2].mid() - center[2]};
  const double a = dot(ray_.D, ray_.D), half_b = dot(ray_.D, from_center);
  const double discriminant = half_b * half_b - a * (dot(from_center, from_center) - radius * radius);
  const double root = std::sqrt(std::max(discriminant, 0.));
  for (const double t_sphere : {(-half_b - root) / a, (-half_b + root) / a}) {
    const Vector3 X{from_center[0] + t_sphere * ray_.D[0], from_center[1] + t_sphere * ray_.D[1],
                    from_center[2] + t_sphere * ray_.D[2]};
    const bool is_on_sphere = std::abs(length(X) - radius) <= tolerance;
    const bool is_in_plane = std::abs(dot(X, axis)) <= tolerance * length(axis);
    const Interval t_doubt = widened(thin(t_sphere), tolerance / length(ray_.D));
    if (is_on_sphere && is_in_plane && t_doubt.overlaps(t)) undecided_.push_back(make_hit(p, q, t_doubt));
  }
}

std::vector<Hit> RootSearch::collect() const
{
  std::vector<Hit> hits;
  for (const Root& root : roots_) {
    const std::array<Interval, 3> b = surface_.barycentric(root.bracket);
    if (b[0].high < 0 || b[1].high < 0 || b[2].high < 0) continue;
    if (root.t.high < ray_.t_min || root.t.low > ray_.t_max) continue;
    Hit hit = make_hit(root.bracket.p.mid(), root.bracket.q.mid(), root.t);
    hit.certain =
        b[0].low >= 0 && b[1].low >= 0 && b[2].low >= 0 && root.t.low >= ray_.t_min && root.t.high <= ray_.t_max;
    hits.push_back(hit);
  }
  // Neighbouring rectangles are undecided together: where they overlap in t, they are one.
  std::vector<Hit> undecided = undecided_;
  const auto by_t = [](const Hit& a, const Hit& c) { return a.t_low < c.t_low; };
  std::sort(undecided.begin(), undecided.end(), by_t);
  std::size_t num_merged = 0;
  for (const Hit& hit : undecided) {
    if (num_merged > 0 && hit.t_low <= undecided[num_merged - 1].t_high) {
      Hit& last = undecided[num_merged - 1];
      last.t_high = std::max(last.t_high, hit.t_high);
    } else {
      undecided[num_merged++] = hit;
    }
  }
  undecided.resize(num_merged);
  hits.insert(hits.end(), undecided.begin(), undecided.end());
  std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& c) { return a.t < c.t; });
  return hits;
}

}  // namespace

std::vector<Hit> roots_find(const PreparedSurface& surface, const Ray& ray) { return RootSearch(surface, ray).run(); }

}  // namespace relief::oracle
