// The judge of tracing methods: gives one ray to a method and to the oracle, and says what is wrong with the answer.
//
// What an exact method may still get wrong. A method computes in doubles from floats, so what it finds is a hit of a
// problem whose numbers differ from the given ones by rounding: seen from the ray, points move by a few 2^-53 of the
// distance to the ray's origin and of the prism's size, and heights by as much of their terms and of the map's slope times the rounding of the
// weights. `hit_error` adds these up, with kRoundings for the number of operations in sequence: the bound on how far
// from the ray a point of the surface may be that is called a hit. In t this is hit_error / |D · Ng| (to first order).
//
// The first order fails where the ray touches the surface. With roots at distance Δ, the ray dips below the surface by
// about |D · Ng|·Δ/4 between them, so two roots nearer to each other than four times the bound may vanish together; and
// a hit that matches no root is one of a moved surface if its own point is within hit_error of the ray (`beside`: just
// over an edge, a touch, a limit of t). Those are counted, and tests bound how many there are.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "displacement/embree_geometry.h"
#include "displacement/height_level.h"
#include "displacement/level_blend.h"
#include "tests/displacement/random_cases.h"
#include "tests/oracle/displaced_triangle.h"
#include "tests/support/displacement_methods.h"
#include "tests/support/test_rays.h"

namespace relief {

/// How many values fall between powers of two: quantiles of very many errors in a few bytes.
class ErrorHistogram {
 public:
  void add(double value)
  {
    const int exponent = value > 0 ? std::ilogb(value) + 1 : kLeast;
    ++counts_[static_cast<std::size_t>(std::clamp(exponent, kLeast, kMost) - kLeast)];
    largest_ = std::max(largest_, value);
    ++total_;
  }
  void add(const ErrorHistogram& other)
  {
    for (std::size_t k = 0; k < counts_.size(); ++k) counts_[k] += other.counts_[k];
    largest_ = std::max(largest_, other.largest_);
    total_ += other.total_;
  }
  /// @return  a power of two that at least this part of the values does not exceed
  double quantile(double part) const
  {
    double sum = 0;
    for (std::size_t k = 0; k < counts_.size(); ++k) {
      sum += static_cast<double>(counts_[k]);
      if (sum >= part * static_cast<double>(total_)) return std::ldexp(1, static_cast<int>(k) + kLeast);
    }
    return HUGE_VAL;
  }
  double largest() const { return largest_; }
  std::uint64_t total() const { return total_; }

 private:
  static constexpr int kLeast = -80, kMost = 20;
  std::array<std::uint64_t, kMost - kLeast + 1> counts_{};
  std::uint64_t total_ = 0;
  double largest_ = 0;
};

/// Median, 99 %, 99.9 % and largest.
inline std::string quantiles_text(const ErrorHistogram& errors)
{
  std::ostringstream out;
  out.precision(2);
  out << "< " << errors.quantile(.5) << ", < " << errors.quantile(.99) << ", < " << errors.quantile(.999) << ", "
      << errors.largest();
  return out.str();
}

/// Heights as an integer format keeps them; of floats: themselves.
inline oracle::HeightMap stored_heights(oracle::HeightMap map, HeightFormat format)
{
  if (format == HeightFormat::kFloat) return map;
  const double most = format == HeightFormat::kU8 ? 255 : 65535;
  for (double& h : map.h) h = std::round(std::clamp(h, 0., 1.) * most) / most;
  return map;
}

/// Triangles of the oracle and their map, as the renderer stores them.
class TracedCase {
 public:
  /// @param map         what `stored_heights` makes of the format; float heights must be floats
  /// @param num_levels  of detail, by the rays' cones if there are several
  /// @param steps       the same triangles at times while the shutter is open; none: they do not deform
  TracedCase(const std::vector<oracle::DisplacedTriangle>& triangles,
             const oracle::HeightMap& map,
             HeightFormat format = HeightFormat::kFloat,
             int num_levels = 1,
             bool weld_seams = false,
             const std::vector<std::vector<oracle::DisplacedTriangle>>& steps = {})
  {
    const auto add_shape = [](const oracle::DisplacedTriangle& triangle, std::vector<Vec3f>* P,
                              std::vector<Normal3f>* N) {
      for (std::size_t k = 0; k < 3; ++k) {
        P->push_back(vector3(triangle.P[k]));
        N->push_back(as_normal(vector3(triangle.N[k])));
      }
    };
    steps_.resize(steps.size());
    std::vector<MeshShape> shapes;
    for (std::size_t step = 0; step < steps.size(); ++step) {
      for (const oracle::DisplacedTriangle& triangle : steps[step])
        add_shape(triangle, &steps_[step].first, &steps_[step].second);
      shapes.push_back({steps_[step].first.data(), steps_[step].second.data()});
    }
    for (const oracle::DisplacedTriangle& triangle : triangles) {
      const auto first = static_cast<std::uint32_t>(P_.size());
      add_shape(triangle, &P_, &N_);
      for (std::size_t k = 0; k < 3; ++k) {
        uv_.push_back({static_cast<float>(triangle.uv[k][0]), static_cast<float>(triangle.uv[k][1])});
      }
      indices_.push_back({first, first + 1, first + 2});
    }
    HeightMapView view;
    view.width = map.width;
    view.height = map.height;
    view.format = format;
    view.wrap_u = wrap(map.wrap_u);
    view.wrap_v = wrap(map.wrap_v);
    for (const double h : map.h) {
      if (format == HeightFormat::kFloat) floats_.push_back(static_cast<float>(h));
      if (format == HeightFormat::kU16) words_.push_back(static_cast<std::uint16_t>(std::lround(h * 65535)));
      if (format == HeightFormat::kU8) bytes_.push_back(static_cast<std::uint8_t>(std::lround(h * 255)));
    }
    if (format == HeightFormat::kFloat) view.texels = floats_.data();
    if (format == HeightFormat::kU16) view.texels = words_.data();
    if (format == HeightFormat::kU8) view.texels = bytes_.data();

    MeshView mesh;
    mesh.P = P_.data();
    mesh.N = N_.data();
    mesh.uv[0] = uv_.data();
    mesh.triangles = indices_.data();
    mesh.num_vertices = static_cast<std::uint32_t>(P_.size());
    mesh.num_triangles = static_cast<std::uint32_t>(indices_.size());
    DisplacementMapping mapping;
    mapping.scale = map.scale;
    mapping.midlevel = map.midlevel;
    mapping.weld_seams = weld_seams;
    std::vector<const HeightFieldView*> coarser;
    for (int k = 0; k < num_levels; ++k) {
      levels_.push_back(std::make_unique<Level>(view, k));
      if (k > 0) coarser.push_back(&levels_.back()->field.view());
    }
    mesh_ = DisplacedMesh(mesh, levels_[0]->field.view(), mapping, coarser, shapes);
  }
  TracedCase(const TracedCase&) = delete;
  TracedCase& operator=(const TracedCase&) = delete;

  DisplacedMeshView mesh() const { return mesh_.view(); }
  const DisplacedMesh& displaced_mesh() const { return mesh_; }
  /// What a method is given to trace the triangles with.
  DisplacedGeometry geometry(DisplacementMethod method) const
  {
    DisplacedGeometry result;
    result.mesh = mesh_.view();
    result.method = method;
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      const Level& level = *levels_[k];
      result.levels[k].field = &level.field.view();
      const auto make = displacement_method(method).table_make;
      if (make != nullptr) result.levels[k].table = level.table(make);
    }
    const auto num_levels = static_cast<int>(levels_.size());
    result.lod = {num_levels, num_levels > 1, 0, mesh_.widest_texel()};
    return result;
  }

  static Vec3f vector3(const oracle::Vector3& a)
  {
    return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
  }
  static Wrap wrap(oracle::Wrap mode)
  {
    return mode == oracle::Wrap::kRepeat ? Wrap::kRepeat
                                         : (mode == oracle::Wrap::kMirror ? Wrap::kMirror : Wrap::kClamp);
  }

 private:
  std::vector<Vec3f> P_;
  std::vector<Normal3f> N_;
  std::vector<std::pair<std::vector<Vec3f>, std::vector<Normal3f>>> steps_;
  std::vector<Vec2f> uv_;
  std::vector<TriangleIndices> indices_;
  std::vector<float> floats_;
  std::vector<std::uint16_t> words_;
  std::vector<std::uint8_t> bytes_;
  using TableMake = decltype(DisplacementMethodEntry::table_make);
  /// A level of the map, and what methods need of it.
  struct Level {
    Level(const HeightMapView& map, int level)
        : texels(level > 0 ? HeightLevel(map, level) : HeightLevel()), field(level > 0 ? texels.view() : map)
    {
      for (const DisplacementMethod method : kDisplacementMethods) {
        const auto make = displacement_method(method).table_make;
        if (make != nullptr && !tables.contains(make)) tables[make] = make(field.view(), {});
      }
    }
    const void* table(TableMake make) const { return tables.at(make).view; }

    HeightLevel texels;
    HeightField field;
    std::map<TableMake, MethodTable> tables;
  };
  std::vector<std::unique_ptr<Level>> levels_;
  DisplacedMesh mesh_;
};

/// A ray as a question to a geometry.
inline DisplacedQuery displaced_query(const oracle::Ray& ray, bool any_hit, float time = 0)
{
  DisplacedQuery query{to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D)), ray.t_min,
                       ray.t_max};
  query.any_hit = any_hit;
  query.time = time;
  return query;
}

/// Operations in sequence, and so roundings of 2^-53 relative to the largest operand, that lead from a ray and a triangle
/// to a hit: about a dozen from the corners to the edge functions, as many to a weight, a point, its height and t. Their
/// errors add up rather than average out in the worst case, hence some more.
inline constexpr double kRoundings = 64;
/// Where |N| is smaller than this part of its largest length, there is no surface (displaced_mesh.cpp).
inline constexpr double kLeastNormalPart = 1e-3;

/// A triangle with what the bounds on errors need.
struct JudgedTriangle {
  JudgedTriangle(const oracle::DisplacedTriangle& triangle_, const oracle::HeightMap& map_)
      : triangle(triangle_), map(map_), surface(triangle_, map_)
  {
    double h_low = HUGE_VAL, h_high = -HUGE_VAL;
    for (const double h : map.h) {
      h_low = std::min(h_low, h);
      h_high = std::max(h_high, h);
    }
    const double scale = std::abs(map.scale);
    largest_d = scale * std::max(std::abs(h_low - map.midlevel), std::abs(h_high - map.midlevel));
    height_terms = scale * (std::max(std::abs(h_low), std::abs(h_high)) + std::abs(map.midlevel));
    const double sizes[2] = {static_cast<double>(map.width), static_cast<double>(map.height)};
    const oracle::Wrap wraps[2] = {map.wrap_u, map.wrap_v};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (const oracle::Vector2& uv : triangle.uv) {
        low = std::min(low, uv[axis] * sizes[axis]);
        high = std::max(high, uv[axis] * sizes[axis]);
      }
      // Lattice coordinates keep whole periods out, but a clamped axis has none.
      const double offset = wraps[axis] == oracle::Wrap::kClamp ? std::max(std::abs(low), std::abs(high)) : 0;
      steepness += scale * (h_high - h_low) * (high - low + 2 * sizes[axis] + offset);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      longest_N = std::max(longest_N, vector_length(triangle.N[k]));
      N_change = std::max(N_change, vector_length(combination(1, triangle.N[k], -1, triangle.N[(k + 1) % 3])));
    }
    constexpr int kSteps = 16;
    double shortest_N = longest_N;
    for (int k = 0; k <= kSteps; ++k) {
      for (int m = 0; m <= kSteps - k; ++m)
        shortest_N = std::min(shortest_N, N_length({1. / kSteps * k, 1. / kSteps * m}));
    }
    prism_reach = largest_d * longest_N / std::max(shortest_N, kLeastNormalPart * longest_N);
    double edge = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      edge = std::max(edge, vector_length(combination(1, triangle.P[(k + 1) % 3], -1, triangle.P[k])));
    }
    // Weights are quotients of quadratics in s, whose terms are as large as the square of that.
    if (prism_reach > edge && edge > 0) prism_reach *= prism_reach / edge;
  }

  double N_length(const oracle::Vector2& b) const
  {
    const oracle::Vector3 N01 = combination(1 - b[0] - b[1], triangle.N[0], b[0], triangle.N[1]);
    return vector_length(combination(1, N01, b[1], triangle.N[2]));
  }

  /// How far from the ray a point with these weights may be that is called a hit, see above; metres.
  double hit_error(const oracle::Ray& ray, const oracle::Vector2& b) const
  {
    double reach = 0;
    for (const oracle::Vector3& P : triangle.P) {
      reach = std::max(reach, vector_length(combination(1, P, -1, ray.O)));
    }
    const double turning = largest_d * N_change / N_length(b);
    return kRoundings * 0x1p-53 * (reach + prism_reach + height_terms + steepness + turning);
  }

  oracle::DisplacedTriangle triangle;
  const oracle::HeightMap& map;
  oracle::Surface surface;
  double largest_d = 0, height_terms = 0, longest_N = 0, N_change = 0;
  double steepness = 0;    ///< bound of the change of d with a weight, metres
  double prism_reach = 0;  ///< how far s·N goes: further than d where |N| at a corner is larger than inside; metres
};

/// What was found wrong, and how large errors were.
struct Judgement {
  std::uint64_t num_rays = 0, num_hits = 0, num_certain = 0;
  std::uint64_t num_missed = 0;           ///< a hit that exists was passed over
  std::uint64_t num_invented = 0;         ///< a hit where no root is
  std::uint64_t num_misplaced = 0;        ///< its weights are not those of the ray's point, or the normal is wrong
  std::uint64_t num_any_hit_differs = 0;  ///< a shadow ray sees what the ray does not, or the other way round
  std::uint64_t num_beside = 0;           ///< hits of a surface moved by rounding; no fault
  ErrorHistogram t_error;  ///< against the oracle's root, relative to the distance of the triangle's farthest corner
  ErrorHistogram t_over_bound;      ///< the same in units of its bound
  ErrorHistogram texel_error;       ///< of lattice coordinates
  ErrorHistogram normal_angle;      ///< radians
  std::vector<std::string> faults;  ///< the first ones, with all that is needed to see them again

  std::uint64_t num_faults() const { return num_missed + num_invented + num_misplaced + num_any_hit_differs; }

  void add(const Judgement& other)
  {
    num_rays += other.num_rays;
    num_hits += other.num_hits;
    num_certain += other.num_certain;
    num_missed += other.num_missed;
    num_invented += other.num_invented;
    num_misplaced += other.num_misplaced;
    num_any_hit_differs += other.num_any_hit_differs;
    num_beside += other.num_beside;
    t_error.add(other.t_error);
    t_over_bound.add(other.t_over_bound);
    texel_error.add(other.texel_error);
    normal_angle.add(other.normal_angle);
    faults.insert(faults.end(), other.faults.begin(), other.faults.end());
  }

  /// One line of figures, then the faults.
  std::string text() const
  {
    std::ostringstream out;
    out << num_rays << " rays, " << num_certain << " with a certain hit; missed " << num_missed << ", invented "
        << num_invented << ", misplaced " << num_misplaced << ", any-hit differs " << num_any_hit_differs << "; beside "
        << num_beside << "; error (median, 99 %, 99.9 %, largest): t " << quantiles_text(t_error) << ", of its bound "
        << quantiles_text(t_over_bound) << ", texels " << quantiles_text(texel_error) << ", normal "
        << quantiles_text(normal_angle);
    for (const std::string& fault : faults) out << "\n  " << fault;
    return out.str();
  }
};

/// Judges one method, compiled for one instruction set.
class Judge {
 public:
  Judge(DisplacementMethod method, const TraversalTable& table) : method_(method), table_(table) {}

  /// @param traced      holds the triangle as number `index`
  /// @param roots       what the oracle finds for the ray
  /// @param case_label  says where the ray is from, should it be looked at again
  void judge(const TracedCase& traced,
             std::uint32_t index,
             const JudgedTriangle& triangle,
             const oracle::Ray& ray,
             const std::vector<oracle::Hit>& roots,
             const std::string& case_label);

  /// Puts the questions to another geometry, of the surface that the oracle is given; null: to the case's own.
  void ask(const DisplacedGeometry* geometry) { asked_ = geometry; }
  const Judgement& judgement() const { return judgement_; }
  DisplacementMethod method() const { return method_; }
  /// Of the method and the instruction set.
  std::string name() const { return std::string(displacement_method_label(method_)) + ", " + table_.isa; }
  const TraversalCounters& counters() const { return counters_; }

 private:
  enum class Match { kRoot, kBeside, kNone };

  /// One ray, and what the oracle says of it.
  struct Question {
    const TracedCase& traced;
    std::uint32_t index;
    const JudgedTriangle& triangle;
    const oracle::Ray& ray;
    const std::vector<oracle::Hit>& roots;
  };

  bool trace(const Question& q, bool any_hit, DisplacedHit* hit)
  {
    const DisplacedGeometry geometry = asked_ != nullptr ? *asked_ : q.traced.geometry(method_);
    return table_.trace(geometry, q.index, displaced_query(q.ray, any_hit), hit, &counters_);
  }
  static double t_bound(const Question& q, const oracle::Hit& root);
  static const oracle::Hit* required_root(const Question& q);
  static Match match(const Question& q, const DisplacedHit& hit, const oracle::Hit** root);
  static double distance_from_ray(const Question& q, const DisplacedHit& hit);
  double normal_angle(const Question& q, const DisplacedHit& hit) const;
  void record_errors(const Question& q, const DisplacedHit& hit, const oracle::Hit& root);
  void record_fault(std::uint64_t& count,
                    const char* what,
                    const Question& q,
                    const DisplacedHit* hit,
                    const std::string& case_label);

  DisplacementMethod method_;
  const TraversalTable& table_;
  const DisplacedGeometry* asked_ = nullptr;
  TraversalCounters counters_;
  Judgement judgement_;
};

/// Normals are compared by formulas that both lose digits where the tangents are nearly parallel or long.
inline constexpr double kLargestNormalAngle = 1e-6;
/// Lattice coordinates this near to a line of texel centres may be called by either side's cell.
inline constexpr double kLatticeLineWidth = 1e-8;

inline double Judge::t_bound(const Question& q, const oracle::Hit& root)
{
  const double along = std::abs(root.Ng[0] * q.ray.D[0] + root.Ng[1] * q.ray.D[1] + root.Ng[2] * q.ray.D[2]);
  return q.triangle.hit_error(q.ray, root.b) / along + 4 * 0x1p-53 * std::abs(root.t);
}

/// The nearest root that a method has to find, or null: one that exists whatever rounding does.
inline const oracle::Hit* Judge::required_root(const Question& q)
{
  for (std::size_t k = 0; k < q.roots.size(); ++k) {
    const oracle::Hit& root = q.roots[k];
    const double bound = t_bound(q, root);
    if (!root.certain || !(bound < HUGE_VAL)) continue;
    if (q.triangle.N_length(root.b) < 2 * kLeastNormalPart * q.triangle.longest_N) continue;
    if (root.t_low - bound <= q.ray.t_min || root.t_high + bound >= q.ray.t_max) continue;
    const bool vanishes_with_last = k > 0 && root.t_low - q.roots[k - 1].t_high <= 4 * bound;
    const bool vanishes_with_next = k + 1 < q.roots.size() && q.roots[k + 1].t_low - root.t_high <= 4 * bound;
    if (!vanishes_with_last && !vanishes_with_next) return &root;
  }
  return nullptr;
}

/// Distance of the surface's point with the hit's weights from the ray's point with the hit's t. Measured near the ray's
/// origin and near uv (0, 0), where fewer digits are lost.
inline double Judge::distance_from_ray(const Question& q, const DisplacedHit& hit)
{
  oracle::DisplacedTriangle local = q.triangle.triangle;
  for (oracle::Vector3& P : local.P) P = combination(1, P, -1, q.ray.O);
  const std::array<oracle::Wrap, 2> wraps{q.triangle.map.wrap_u, q.triangle.map.wrap_v};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (wraps[axis] == oracle::Wrap::kClamp) continue;
    const double periods = 2 * std::floor(.5 * local.uv[0][axis]);
    for (oracle::Vector2& uv : local.uv) uv[axis] -= periods;
  }
  const oracle::Vector3 on_surface = oracle::surface_eval(local, q.triangle.map, {hit.b1, hit.b2}).P;
  return vector_length(combination(1, on_surface, -hit.t, q.ray.D));
}

/// @param root  the nearest one in t, if there is a match
inline Judge::Match Judge::match(const Question& q, const DisplacedHit& hit, const oracle::Hit** root)
{
  double nearest = HUGE_VAL;
  for (const oracle::Hit& candidate : q.roots) {
    const double off = std::max({0., candidate.t_low - hit.t, hit.t - candidate.t_high});
    // Nothing is known of the normal of an undecided root; NaN is no match.
    const double bound = t_bound(q, candidate);
    if ((off <= bound || (!candidate.certain && off == 0)) && off < nearest) {
      nearest = off;
      *root = &candidate;
    }
  }
  if (nearest < HUGE_VAL) return Match::kRoot;
  return distance_from_ray(q, hit) <= q.triangle.hit_error(q.ray, {hit.b1, hit.b2}) ? Match::kBeside : Match::kNone;
}

/// Angle between the hit's normal and the oracle's for the same weights; on a line between texels the nearest one of
/// those on its sides. Normals are on the side of N; the oracle's are on that of the undisplaced triangle, which differs
/// where all of it is displaced through the points in which displacement lines meet.
inline double Judge::normal_angle(const Question& q, const DisplacedHit& hit) const
{
  // Computed heights are known as a map's to the case alone, a blend of levels to the geometry alone.
  const DisplacedMeshView mesh = asked_ != nullptr && asked_->mesh.blend != nullptr ? asked_->mesh : q.traced.mesh();
  const DisplacedTriangle& tri = mesh.triangles[q.index];
  const SurfacePoint point = mesh.blend != nullptr ? blended_surface_point(mesh, tri, hit.b1, hit.b2, hit.i, hit.j)
                                                   : surface_point(mesh, tri, hit.b1, hit.b2, hit.i, hit.j);
  if (dot(point.Ng, point.N) < -1e-12 * length(point.N)) return 4;
  const double xu = tri.x[1] - tri.x[0], xv = tri.x[2] - tri.x[0];
  const double yu = tri.y[1] - tri.y[0], yv = tri.y[2] - tri.y[0];
  const double determinant = xu * yv - xv * yu;
  double least = HUGE_VAL;
  for (const double step_x : {0., kLatticeLineWidth, -kLatticeLineWidth}) {
    for (const double step_y : {0., kLatticeLineWidth, -kLatticeLineWidth}) {
      oracle::Vector2 b{hit.b1, hit.b2};
      if (determinant != 0) {
        b[0] += (yv * step_x - xv * step_y) / determinant;
        b[1] += (xu * step_y - yu * step_x) / determinant;
      }
      const oracle::Vector3 expected = oracle::surface_eval(q.triangle.triangle, q.triangle.map, b).Ng;
      if (!(vector_length(expected) > .5)) return 0;
      const oracle::Vector3 actual{point.Ng.x, point.Ng.y, point.Ng.z};
      const double sine = vector_length(cross_product(expected, actual));
      const double cosine = expected[0] * actual[0] + expected[1] * actual[1] + expected[2] * actual[2];
      least = std::min(least, std::atan2(sine, std::abs(cosine)));
      if (least <= kLargestNormalAngle) return least;
    }
  }
  return least;
}

inline void Judge::record_errors(const Question& q, const DisplacedHit& hit, const oracle::Hit& root)
{
  double reach = 0;
  for (const oracle::Vector3& P : q.triangle.triangle.P) {
    reach = std::max(reach, vector_length(combination(1, P, -1, q.ray.O)));
  }
  const double error = std::abs(hit.t - root.t);
  judgement_.t_error.add(error * vector_length(q.ray.D) / reach);
  judgement_.t_over_bound.add(error / t_bound(q, root));
  const DisplacedTriangle& tri = q.traced.mesh().triangles[q.index];
  const double db1 = hit.b1 - root.b[0], db2 = hit.b2 - root.b[1];
  judgement_.texel_error.add(std::hypot(db1 * (tri.x[1] - tri.x[0]) + db2 * (tri.x[2] - tri.x[0]),
                                        db1 * (tri.y[1] - tri.y[0]) + db2 * (tri.y[2] - tri.y[0])));
}

inline void Judge::record_fault(std::uint64_t& count,
                                const char* what,
                                const Question& q,
                                const DisplacedHit* hit,
                                const std::string& case_label)
{
  ++count;
  constexpr std::size_t kMostFaults = 5;
  if (judgement_.faults.size() >= kMostFaults) return;
  std::ostringstream out;
  out.precision(17);
  out << what << " (" << name() << "): " << case_label << ", triangle " << q.index << ", O " << q.ray.O[0] << " "
      << q.ray.O[1] << " " << q.ray.O[2] << " D " << q.ray.D[0] << " " << q.ray.D[1] << " " << q.ray.D[2] << " t in "
      << q.ray.t_min << " " << q.ray.t_max << "; ";
  if (hit != nullptr) {
    out << "t " << hit->t << " b " << hit->b1 << " " << hit->b2 << " cell " << hit->i << " " << hit->j << ", "
        << distance_from_ray(q, *hit) << " from the ray, allowed " << q.triangle.hit_error(q.ray, {hit->b1, hit->b2})
        << ", normal off by " << normal_angle(q, *hit);
  } else {
    out << "no hit";
  }
  out << "; oracle:";
  for (const oracle::Hit& root : q.roots) {
    out << (root.certain ? " certain [" : " uncertain [") << root.t_low << ", " << root.t_high << "] b " << root.b[0]
        << " " << root.b[1] << " bound " << t_bound(q, root);
  }
  judgement_.faults.push_back(out.str());
}

inline void Judge::judge(const TracedCase& traced,
                         std::uint32_t index,
                         const JudgedTriangle& triangle,
                         const oracle::Ray& ray,
                         const std::vector<oracle::Hit>& roots,
                         const std::string& case_label)
{
  const Question q{traced, index, triangle, ray, roots};
  Judgement& j = judgement_;
  ++j.num_rays;
  DisplacedHit hit;
  const bool found = trace(q, false, &hit);
  j.num_hits += found ? 1 : 0;

  const oracle::Hit* required = required_root(q);
  j.num_certain += required != nullptr ? 1 : 0;
  if (required != nullptr && !(found && hit.t <= required->t_high + t_bound(q, *required))) {
    record_fault(j.num_missed, "missed", q, found ? &hit : nullptr, case_label);
  }
  const auto judge_hit = [&](const DisplacedHit& h) {
    const oracle::Hit* root = nullptr;
    const bool inside = h.t >= ray.t_min && h.t <= ray.t_max;
    const Match kind = match(q, h, &root);
    if (kind == Match::kNone || !inside) {
      record_fault(j.num_invented, "invented", q, &h, case_label);
      return;
    }
    const double largest_distance = triangle.hit_error(ray, {h.b1, h.b2}) + 8 * 0x1p-53 * vector_length(ray.D) * h.t;
    if (!(distance_from_ray(q, h) <= largest_distance)) {
      record_fault(j.num_misplaced, "misplaced", q, &h, case_label);
      return;
    }
    const double angle = normal_angle(q, h);
    if (!(angle <= kLargestNormalAngle)) record_fault(j.num_misplaced, "wrong normal", q, &h, case_label);
    if (kind == Match::kBeside) ++j.num_beside;
    if (&h != &hit || root == nullptr || !root->certain) return;
    record_errors(q, h, *root);
    j.normal_angle.add(angle);
  };
  if (found) judge_hit(hit);

  DisplacedHit some_hit;
  if (trace(q, true, &some_hit) != found) {
    record_fault(j.num_any_hit_differs, "any-hit differs", q, found ? &hit : &some_hit, case_label);
  } else if (found) {
    judge_hit(some_hit);
  }
}

inline const TraversalTable& best_table()
{
  const bool has_avx2 =
      __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
  return has_avx2 ? traversal_table_avx2() : traversal_table_baseline();
}

/// A judge for each method, compiled for one instruction set.
inline std::vector<Judge> judges_of_all_methods(const TraversalTable& table)
{
  std::vector<Judge> judges;
  for (const DisplacementMethod method : traversing_methods()) judges.emplace_back(method, table);
  return judges;
}

/// A judge for each method and each instruction set that this machine has.
inline std::vector<Judge> judges_of_all_methods()
{
  std::vector<Judge> judges;
  for (const DisplacementMethod method : traversing_methods()) {
    judges.emplace_back(method, traversal_table_baseline());
    if (&best_table() != &traversal_table_baseline()) judges.emplace_back(method, best_table());
  }
  return judges;
}

}  // namespace relief
