#include "displacement/border_strips.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

/// A side of a part of a triangle that lies on a side of the triangle.
struct PartSide {
  std::uint32_t part = 0;
  int side = 0;             ///< of the part, from its corner to the next
  double from = 0, to = 1;  ///< fractions of the triangle's side at these
};

using PartsOfEdges = std::unordered_map<std::uint32_t, std::vector<PartSide>>;

/// The sides of all parts that lie on sides of their triangles, by edge.
std::shared_ptr<const PartsOfEdges> parts_of_edges(std::span<const LatticeTriangle> parts)
{
  auto out = std::make_shared<PartsOfEdges>();
  for (std::uint32_t part = 0; part < parts.size(); ++part) {
    const LatticeTriangle& t = parts[part];
    double weights[3][3];  // of the triangle's vertices at the part's corners; exact (lattice_split.cpp)
    for (int k = 0; k < 3; ++k) {
      weights[k][1] = static_cast<double>(t.corner[k].x);
      weights[k][2] = static_cast<double>(t.corner[k].y);
      weights[k][0] = 1.0 - weights[k][1] - weights[k][2];
    }
    for (int side = 0; side < 3; ++side) {
      const double *a = weights[side], *b = weights[(side + 1) % 3];
      for (int edge = 0; edge < 3; ++edge) {
        const int next = (edge + 1) % 3, opposite = (edge + 2) % 3;
        if (a[opposite] != 0 || b[opposite] != 0) continue;
        (*out)[3 * t.base + static_cast<std::uint32_t>(edge)].push_back({part, side, a[next], b[next]});
      }
    }
  }
  return out;
}

/// The sides of an edge's parts; of a mesh without parts the edge itself.
std::vector<PartSide> sides_on(const PartsOfEdges* parts, std::uint32_t edge)
{
  if (parts == nullptr) return {{edge / 3, static_cast<int>(edge % 3), 0, 1}};
  const auto found = parts->find(edge);
  return found == parts->end() ? std::vector<PartSide>{} : found->second;
}

/// Points of a curve in any order, to be put in their own.
class CurvePoints {
 public:
  explicit CurvePoints(std::size_t num_steps) : num_steps_(num_steps) {}
  /// @param P  by step
  void add(double fraction, std::vector<Vec3d> P) { points_.push_back({fraction, std::move(P)}); }
  /// @param margin  of a curve; none: they are the vertices of a polyline
  BorderCurve curve(std::optional<double> margin)
  {
    std::stable_sort(points_.begin(), points_.end(),
                     [](const Point& a, const Point& b) { return a.fraction < b.fraction; });
    BorderCurve out;
    out.P.resize(num_steps_);
    out.is_polyline = !margin;
    out.margin = margin.value_or(0);
    for (const Point& point : points_) {
      constexpr double kSame = 1e-12;
      if (!out.fractions.empty() && point.fraction - out.fractions.back() < kSame) continue;
      out.fractions.push_back(point.fraction);
      for (std::size_t step = 0; step < num_steps_; ++step) out.P[step].push_back(point.P[step]);
    }
    return out;
  }

 private:
  struct Point {
    double fraction;
    std::vector<Vec3d> P;
  };
  std::size_t num_steps_;
  std::vector<Point> points_;
};

Vec3d between(Vec3d a, Vec3d b, double t) { return (1 - t) * a + t * b; }

/// Number of a lattice's point (i, j) in the order of its rows.
std::uint32_t lattice_index(std::int32_t n, std::int32_t i, std::int32_t j)
{
  return static_cast<std::uint32_t>(j * (n + 1) - j * (j - 1) / 2 + i);
}

/// Where lattice lines cross a side of a triangle, fractions of the side.
void add_crossings(double from, double to, std::vector<double>* breaks)
{
  const double length = to - from;
  // Of longer ones as many as these.
  constexpr double kMost = 1 << 16;
  const double first = std::ceil(std::min(from, to)), last = std::floor(std::max(from, to));
  const double step = std::max(1.0, std::ceil((last - first) / kMost));
  for (double at = first; at <= last && length != 0; at += step) breaks->push_back((at - from) / length);
}

/// The border of one side of a triangle that is traced as it is displaced.
class TracedSide {
 public:
  TracedSide(const DisplacedGeometry& geometry, std::uint32_t triangle, int side)
      : geometry_(geometry),
        triangle_(triangle),
        side_(side),
        num_steps_(geometry.mesh.deformation != nullptr ? geometry.mesh.deformation->steps.size() : 1)
  {
  }

  /// @return  the largest distance of what is traced from the chords between the points
  double add(const PartSide& at, CurvePoints* points) const
  {
    std::vector<double> fractions = breaks();
    double margin = 0;
    for (std::size_t k = 0; k + 1 < fractions.size(); ++k) {
      points->add(at.from + fractions[k] * (at.to - at.from), places(fractions[k]));
      margin = std::max(margin, add_between(at, fractions[k], fractions[k + 1], 0, points));
    }
    points->add(at.to, places(1));
    for (const double f : fractions) margin = std::max(margin, spread(f));
    return margin;
  }

 private:
  float time(double step) const
  {
    return num_steps_ < 2 ? 0.0f : static_cast<float>(step / static_cast<double>(num_steps_ - 1));
  }
  Vec3d place(double fraction, float time) const
  {
    return displaced_edge_point(geometry_, triangle_, side_, fraction, 0, time);
  }
  std::vector<Vec3d> places(double fraction) const
  {
    std::vector<Vec3d> out;
    for (std::size_t step = 0; step < num_steps_; ++step)
      out.push_back(place(fraction, time(static_cast<double>(step))));
    return out;
  }
  /// Where the curve may have a bend, with the ends.
  std::vector<double> breaks() const
  {
    std::vector<double> out{0, 1};
    if (geometry_.procedural != nullptr) {
      const std::int32_t n = geometry_.procedural->triangles()[triangle_].side_n[side_];
      for (std::int32_t k = 1; k < n; ++k) out.push_back(static_cast<double>(k) / n);
    } else {
      const DisplacedTriangle& tri = geometry_.mesh.triangles[triangle_];
      const HeightMapView& finest = geometry_.mesh.field->map;
      const int next = (side_ + 1) % 3;
      const auto add = [&](const HeightFieldView& level) {
        const auto x = [&](int k) { return lattice_on_level(tri.x[k], finest.width, level.map.width); };
        const auto y = [&](int k) { return lattice_on_level(tri.y[k], finest.height, level.map.height); };
        add_crossings(x(side_), x(next), &out);
        add_crossings(y(side_), y(next), &out);
      };
      add(*geometry_.mesh.field);
      if (geometry_.mesh.blend != nullptr) add(*geometry_.mesh.blend->coarse);
    }
    std::sort(out.begin(), out.end());
    constexpr double kSame = 1e-12;
    out.erase(std::unique(out.begin(), out.end(), [](double a, double b) { return b - a < kSame; }), out.end());
    out.back() = 1;
    return out;
  }
  /// Adds points between two where the curve is far off its chord.
  /// @return  the largest distance that is left
  double add_between(const PartSide& at, double a, double b, int depth, CurvePoints* points) const
  {
    double off = 0, longest = 0;
    for (std::size_t step = 0; step < num_steps_; ++step) {
      const float then = time(static_cast<double>(step));
      const Vec3d from = place(a, then), to = place(b, then);
      longest = std::max(longest, length(to - from));
      for (const double t : {0.25, 0.5, 0.75})
        off = std::max(off, length(place(a + t * (b - a), then) - between(from, to, t)));
    }
    constexpr int kMostHalvings = 6;
    constexpr double kStraight = 0x1p-13;  // of a chord
    if (off <= kStraight * longest || depth == kMostHalvings) return 2 * off;
    const double middle = 0.5 * (a + b);
    points->add(at.from + middle * (at.to - at.from), places(middle));
    return std::max(add_between(at, a, middle, depth + 1, points), add_between(at, middle, b, depth + 1, points));
  }
  /// How far a point of the curve is between steps from the straight line.
  double spread(double fraction) const
  {
    double most = 0;
    for (std::size_t step = 0; step < num_steps_; ++step) {
      const auto at = static_cast<double>(step);
      const Vec3d P = place(fraction, time(at));
      if (step + 1 == num_steps_) continue;
      const Vec3d next = place(fraction, time(at + 1));
      for (const double t : {0.25, 0.5, 0.75})
        most = std::max(most, 2 * length(place(fraction, time(at + t)) - between(P, next, t)));
    }
    return most;
  }

  const DisplacedGeometry& geometry_;
  std::uint32_t triangle_;
  int side_;
  std::size_t num_steps_;
};

/// The same curve from its other end.
BorderCurve turned(BorderCurve curve)
{
  std::reverse(curve.fractions.begin(), curve.fractions.end());
  for (double& f : curve.fractions) f = 1 - f;
  for (std::vector<Vec3d>& P : curve.P) std::reverse(P.begin(), P.end());
  return curve;
}

/// The point of a curve at a fraction, asked for in rising order.
class CurveReader {
 public:
  explicit CurveReader(const BorderCurve& curve) : curve_(curve) {}
  Vec3d at(double fraction, std::size_t step)
  {
    const std::vector<double>& f = curve_.fractions;
    while (next_ + 1 < f.size() && f[next_] < fraction) ++next_;
    const std::vector<Vec3d>& P = curve_.P[std::min(step, curve_.P.size() - 1)];
    if (next_ == 0 || f[next_] <= fraction) return P[next_];
    return between(P[next_ - 1], P[next_], (fraction - f[next_ - 1]) / (f[next_] - f[next_ - 1]));
  }

 private:
  const BorderCurve& curve_;
  std::size_t next_ = 0;
};

/// What becomes of one edge.
struct Strip {
  std::vector<float> fractions;       ///< of its vertices
  std::vector<std::vector<Vec3f>> P;  ///< likewise, by step
  std::vector<TriangleIndices> triangles;
  struct Piece {
    float from, to;
    bool rises[2];  ///< as either side has it
  };
  std::vector<Piece> pieces;  ///< along the edge

  /// @param places  by step
  std::uint32_t add(double fraction, const std::vector<Vec3d>& places)
  {
    fractions.push_back(static_cast<float>(fraction));
    for (std::size_t step = 0; step < P.size(); ++step) P[step].push_back(to_float(places[step]));
    return static_cast<std::uint32_t>(fractions.size() - 1);
  }
  /// Adds a triangle that has an area.
  void add(std::uint32_t a, std::uint32_t b, std::uint32_t c)
  {
    const bool is_nothing = std::all_of(P.begin(), P.end(), [&](const std::vector<Vec3f>& at) {
      return at[a] == at[b] || at[b] == at[c] || at[c] == at[a];
    });
    if (!is_nothing) triangles.push_back({a, b, c});
  }
};

/// The sum of a mesh's normals at the ends of an edge.
Vec3d edge_normal(const MeshView& mesh, std::uint32_t edge)
{
  const TriangleIndices& t = mesh.triangles[edge / 3];
  const std::uint32_t v[4] = {t.v0, t.v1, t.v2, t.v0};
  if (mesh.N == nullptr) {
    const Vec3d P = to_double(mesh.P[t.v0]);
    return cross(to_double(mesh.P[t.v1]) - P, to_double(mesh.P[t.v2]) - P);
  }
  return to_double(as_vector(mesh.N[v[edge % 3]])) + to_double(as_vector(mesh.N[v[edge % 3 + 1]]));
}

/// Points of both sides, by step.
struct BothSides {
  std::vector<Vec3d> P[2];
  Vec3d gap(std::size_t step) const { return P[0][step] - P[1][step]; }
};

BothSides mix(const BothSides& a, const BothSides& b, double t)
{
  BothSides out;
  for (int side = 0; side < 2; ++side) {
    for (std::size_t step = 0; step < a.P[side].size(); ++step)
      out.P[side].push_back(between(a.P[side][step], b.P[side][step], t));
  }
  return out;
}

/// A stretch of an edge along which no side has another vertex, and the sides do not change places.
struct Stretch {
  double from, to;
  BothSides at_from, at_to;
};

/// @return  in their order
std::vector<Stretch> stretches_of(const BorderCurve& first, const BorderCurve& second, std::size_t num_steps)
{
  std::vector<double> fractions;
  std::merge(first.fractions.begin(), first.fractions.end(), second.fractions.begin(), second.fractions.end(),
             std::back_inserter(fractions));
  constexpr double kSame = 1e-12;
  fractions.erase(std::unique(fractions.begin(), fractions.end(), [](double a, double b) { return b - a < kSame; }),
                  fractions.end());
  std::vector<CurveReader> readers[2];
  for (std::size_t step = 0; step < num_steps; ++step) {
    readers[0].emplace_back(first);
    readers[1].emplace_back(second);
  }
  std::vector<Stretch> out;
  BothSides before;
  for (std::size_t k = 0; k < fractions.size(); ++k) {
    BothSides at;
    for (int side = 0; side < 2; ++side) {
      for (std::size_t step = 0; step < num_steps; ++step)
        at.P[side].push_back(readers[side][step].at(fractions[k], step));
    }
    if (k > 0) {
      const double from = fractions[k - 1], to = fractions[k];
      const Vec3d a = before.gap(0), b = at.gap(0);
      if (dot(a, b) < 0) {
        const double t = length(a) / (length(a) + length(b)), middle = from + t * (to - from);
        const BothSides there = mix(before, at, t);
        out.push_back({from, middle, before, there});
        out.push_back({middle, to, there, at});
      } else {
        out.push_back({from, to, before, at});
      }
    }
    before = std::move(at);
  }
  return out;
}

/// Adds a stretch that reaches beyond the curves of its sides.
void add_stretch(const BorderCurve (&curves)[2],
                 const Stretch& stretch,
                 Vec3d along,
                 Vec3d normal,
                 double rounding,
                 Strip* strip)
{
  const double margins[2] = {curves[0].margin + rounding, curves[1].margin + rounding};
  const double least = margins[0] + margins[1];
  const std::size_t num_steps = strip->P.size();
  std::vector<Vec3d> P[2][2];  // by side and end
  for (std::size_t step = 0; step < num_steps; ++step) {
    const Vec3d gaps[2] = {stretch.at_from.gap(step), stretch.at_to.gap(step)};
    const double sizes[2] = {length(gaps[0]), length(gaps[1])};
    for (int end = 0; end < 2; ++end) {
      // To the first side; where the gap closes that of the other end, and whichever side is above it reaches beyond both.
      const int from = sizes[end] > least ? end : 1 - end;
      const Vec3d up = sizes[from] > least ? gaps[from] * (1 / sizes[from]) : normal;
      const double more = sizes[end] > least ? 0 : least + sizes[end];
      // Where several strips end at one line, each with points of its own, they reach beyond it.
      const bool is_last = end == 0 ? stretch.from == 0 : stretch.to == 1;
      const Vec3d out = is_last ? along * (end == 0 ? -rounding : rounding) : Vec3d{};
      const BothSides& at = end == 0 ? stretch.at_from : stretch.at_to;
      P[0][end].push_back(at.P[0][step] + out + (margins[0] + more) * up);
      P[1][end].push_back(at.P[1][step] + out - (margins[1] + more) * up);
    }
  }
  const std::uint32_t b1 = strip->add(stretch.to, P[1][1]), b0 = strip->add(stretch.from, P[1][0]),
                      a0 = strip->add(stretch.from, P[0][0]), a1 = strip->add(stretch.to, P[0][1]);
  strip->add(b1, b0, a0);
  strip->add(b1, a0, a1);
}

/// What rounding does to points between vertices of triangles, which are all traced alike; metres.
double rounding_of_triangles(const BorderCurve (&curves)[2])
{
  double farthest = 0;
  for (const BorderCurve& curve : curves) {
    for (const std::vector<Vec3d>& step : curve.P) {
      for (const Vec3d P : step) farthest = max(farthest, max(std::abs(P.x), max(std::abs(P.y), std::abs(P.z))));
    }
  }
  constexpr double kUnits = 0x1p-20;  // sixteen; four let one of 65,536 rays through (BorderWalls.LetNoRayOut)
  return kUnits * farthest;
}

/// @param along    the edge, unit
/// @param normals  of both sides, any length
Strip strip_of(const BorderCurve (&curves)[2],
               Vec3d along,
               const Vec3d (&normals)[2],
               std::size_t num_steps,
               double rounding)
{
  Strip strip;
  strip.P.resize(num_steps);
  if (curves[0].fractions.empty() || curves[1].fractions.empty()) return strip;
  const double size = length(normals[1]);
  const Vec3d normal = size > 0 ? normals[1] * (1 / size) : Vec3d{};
  if (curves[0].is_polyline && curves[1].is_polyline) rounding = std::min(rounding, rounding_of_triangles(curves));
  const bool is_one_curve =
      std::equal(curves[0].fractions.begin(), curves[0].fractions.end(), curves[1].fractions.begin(),
                 curves[1].fractions.end(), [](double a, double b) { return std::abs(a - b) < 1e-9; });
  const std::vector<Stretch> stretches = stretches_of(curves[0], curves[1], num_steps);
  for (const Stretch& stretch : stretches) {
    bool is_closed = is_one_curve;
    for (std::size_t step = 0; is_closed && step < num_steps; ++step)
      is_closed = length(stretch.at_from.gap(step)) <= rounding && length(stretch.at_to.gap(step)) <= rounding;
    if (is_closed) continue;
    const Vec3d middle = stretch.at_from.gap(0) + stretch.at_to.gap(0);
    strip.pieces.push_back({static_cast<float>(stretch.from),
                            static_cast<float>(stretch.to),
                            {dot(middle, normals[0]) < 0, dot(middle, normals[1]) > 0}});
    add_stretch(curves, stretch, along, normal, rounding, &strip);
  }
  return strip;
}

}  // namespace

BorderSide border_of_vertices(const TriangleIndices* triangles, std::vector<const Vec3f*> steps)
{
  return [triangles, steps = std::move(steps)](std::uint32_t edge) {
    const TriangleIndices& t = triangles[edge / 3];
    const std::uint32_t v[4] = {t.v0, t.v1, t.v2, t.v0};
    BorderCurve curve;
    curve.fractions = {0, 1};
    curve.is_polyline = true;
    for (const Vec3f* P : steps) curve.P.push_back({to_double(P[v[edge % 3]]), to_double(P[v[edge % 3 + 1]])});
    return curve;
  };
}

namespace {

/// @param vertex  places by step of a point (i, j) of a part's lattice: (part, i, j)
template <typename Vertex>
BorderSide border_of_parts(std::span<const LatticeTriangle> parts, std::size_t num_steps, const Vertex& vertex)
{
  return [parts, num_steps, vertex, of_edges = parts_of_edges(parts)](std::uint32_t edge) {
    CurvePoints points(num_steps);
    for (const PartSide& on : sides_on(of_edges.get(), edge)) {
      const LatticeTriangle& part = parts[on.part];
      const std::int32_t n = part.n, width = n / part.side_n[on.side];
      for (std::int32_t k = 0; k <= n; k += width) {
        const std::int32_t i = on.side == 0   ? k
                               : on.side == 1 ? n - k
                                              : 0,
                           j = on.side == 0   ? 0
                               : on.side == 1 ? k
                                              : n - k;
        points.add(on.from + k * (on.to - on.from) / n, vertex(on.part, i, j));
      }
    }
    return points.curve(std::nullopt);
  };
}

}  // namespace

BorderSide border_of_divided(const MovedMesh& mesh, std::span<const LatticeTriangle> parts)
{
  auto first_vertex = std::make_shared<std::vector<std::uint32_t>>();
  std::uint32_t next = 0;
  for (const LatticeTriangle& part : parts) {
    first_vertex->push_back(next);
    next += lattice_index(part.n, 0, part.n) + 1;
  }
  std::vector<const Vec3f*> steps;
  for (const MovedShape& step : mesh.steps) steps.push_back(step.P.data());
  if (steps.empty()) steps.push_back(mesh.P.data());
  const auto vertex = [parts, first_vertex, steps](std::uint32_t part, std::int32_t i, std::int32_t j) {
    const std::uint32_t index = (*first_vertex)[part] + lattice_index(parts[part].n, i, j);
    std::vector<Vec3d> P;
    for (const Vec3f* step : steps) P.push_back(to_double(step[index]));
    return P;
  };
  return border_of_parts(parts, steps.size(), vertex);
}

BorderSide border_of_tiles(const PointTiles& tiles)
{
  return border_of_parts(tiles.parts(), 1, [&tiles](std::uint32_t part, std::int32_t i, std::int32_t j) {
    return std::vector<Vec3d>{to_double(tiles.point(part, i, j))};
  });
}

BorderSide border_of_tessellation(const Tessellation& tessellation, std::span<const LatticeTriangle> parts)
{
  return [&tessellation, of_edges = parts.empty() ? nullptr : parts_of_edges(parts)](std::uint32_t edge) {
    CurvePoints points(1);
    for (const PartSide& on : sides_on(of_edges.get(), edge)) {
      for (const SidePoint& at : tessellation.side(on.part, on.side))
        points.add(on.from + at.fraction * (on.to - on.from), {to_double(at.P)});
    }
    return points.curve(std::nullopt);
  };
}

BorderSide border_of_displaced(const DisplacedGeometry& geometry)
{
  std::shared_ptr<const PartsOfEdges> of_edges;
  if (geometry.procedural != nullptr) of_edges = parts_of_edges(geometry.procedural->triangles());
  return [&geometry, of_edges](std::uint32_t edge) {
    CurvePoints points(geometry.mesh.deformation != nullptr ? geometry.mesh.deformation->steps.size() : 1);
    double margin = 0;
    for (const PartSide& on : sides_on(of_edges.get(), edge))
      margin = std::max(margin, TracedSide(geometry, on.part, on.side).add(on, &points));
    return points.curve(margin);
  };
}

BorderStrips border_strips_make(std::span<const BorderEdge> edges,
                                const MeshView& mesh,
                                const MeshView (&meshes)[2],
                                const BorderSide (&sides)[2],
                                std::size_t num_steps,
                                double rounding)
{
  std::vector<Strip> strips(edges.size());
  num_steps = std::max<std::size_t>(num_steps, 1);
  tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t k) {
    const BorderEdge& edge = edges[k];
    const BorderCurve first = sides[0](edge.edges[0]);
    const BorderCurve curves[2] = {edge.same_way ? first : turned(first), sides[1](edge.edges[1])};
    const Vec3d normals[2] = {edge_normal(meshes[0], edge.edges[0]), edge_normal(meshes[1], edge.edges[1])};
    const TriangleIndices& t = mesh.triangles[k];
    const Vec3d along = to_double(mesh.P[t.v1]) - to_double(mesh.P[t.v0]);
    strips[k] = strip_of(curves, along * (1 / std::max(length(along), 1e-300)), normals, num_steps, rounding);
  });
  BorderStrips out;
  std::vector<MeshPlace> places;
  std::vector<TriangleIndices> triangles;
  std::vector<MovedShape> steps(num_steps);
  for (std::uint32_t k = 0; k < strips.size(); ++k) {
    const Strip& strip = strips[k];
    const auto first = static_cast<std::uint32_t>(places.size());
    for (const TriangleIndices& t : strip.triangles) triangles.push_back({first + t.v0, first + t.v1, first + t.v2});
    for (std::size_t vertex = 0; vertex < strip.fractions.size(); ++vertex) {
      places.push_back({k, {strip.fractions[vertex], 0}});
      for (std::size_t step = 0; step < steps.size(); ++step) steps[step].P.push_back(strip.P[step][vertex]);
    }
    // From the end where the side's edge begins.
    const std::size_t num_pieces = strip.pieces.size();
    out.num_pieces.push_back(static_cast<std::uint32_t>(num_pieces));
    for (std::size_t piece = 0; piece < num_pieces; ++piece) {
      const Strip::Piece& own = strip.pieces[piece];
      const Strip::Piece& other = strip.pieces[edges[k].same_way ? piece : num_pieces - 1 - piece];
      out.pieces[1].push_back({own.from, own.rises[1]});
      out.pieces[0].push_back({edges[k].same_way ? other.from : 1.0f - other.to, other.rises[0]});
    }
  }
  out.mesh = placed_mesh_make(mesh, places, std::move(triangles), std::move(steps));
  return out;
}

void walls_beside_add(std::span<const BorderEdge> edges, const BorderStrips& strips, int side, WallsBeside* out)
{
  auto piece = strips.pieces[side].begin();
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const auto end = piece + strips.num_pieces[k];
    if (piece != end) out->edges[edges[k].edges[side]].assign(piece, end);
    piece = end;
  }
}

Vec3d WallsBeside::leave(const MeshView& mesh,
                         std::uint32_t triangle,
                         const double (&weights)[3],
                         Vec3d Ng,
                         double distance) const
{
  const TriangleIndices& t = mesh.triangles[triangle];
  const Vec3d P[3] = {to_double(mesh.P[t.v0]), to_double(mesh.P[t.v1]), to_double(mesh.P[t.v2])};
  Vec3d sum{};
  for (std::uint32_t k = 0; k < 3; ++k) {
    const std::uint32_t next = (k + 1) % 3, opposite = (k + 2) % 3;
    const Vec3d along = P[next] - P[k], across = P[opposite] - P[k];
    const double squared = dot(along, along);
    if (!(squared > 0)) continue;
    const Vec3d inwards = across - along * (dot(across, along) / squared);
    const double height = length(inwards);
    if (!(weights[opposite] * height < distance)) continue;
    const auto found = edges.find(3 * triangle + k);
    if (found == edges.end()) continue;
    const std::vector<Piece>& pieces = found->second;
    const double fraction = weights[next] / std::max(weights[k] + weights[next], 1e-300);
    auto piece = std::upper_bound(pieces.begin(), pieces.end(), fraction,
                                  [](double f, const Piece& p) { return f < static_cast<double>(p.fraction); });
    if (piece != pieces.begin()) --piece;
    // Along the surface, which may be steep.
    const Vec3d flat = inwards - Ng * dot(inwards, Ng);
    const double size = length(flat);
    if (size > 0) sum = sum + flat * ((piece->rises ? distance : -distance) / size);
  }
  return sum;
}

}  // namespace relief
