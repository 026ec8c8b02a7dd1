#include "displacement/moved_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <tbb/parallel_for.h>

#include "displacement/shared_edges.h"
#include "displacement/vec3d.h"

namespace relief {

namespace {

constexpr std::uint32_t kNone = ~0u;

/// The first corner, 3 · triangle + k, of each vertex that stands for others; kNone for those that do not, or are of no triangle.
std::vector<std::uint32_t> first_corners(const MeshView& mesh, const std::vector<std::uint32_t>& stands_for)
{
  std::vector<std::uint32_t> corners(mesh.num_vertices, kNone);
  for (std::uint32_t triangle = 0; triangle < mesh.num_triangles; ++triangle) {
    const TriangleIndices& t = mesh.triangles[triangle];
    const std::uint32_t vertices[3] = {t.v0, t.v1, t.v2};
    for (std::uint32_t k = 0; k < 3; ++k) {
      std::uint32_t& corner = corners[stands_for[vertices[k]]];
      if (corner == kNone) corner = 3 * triangle + k;
    }
  }
  return corners;
}

/// A vertex where a height moves it to.
Vec3f moved_point(Vec3f P, Vec3f along, float h, const VertexDisplacement& by)
{
  const Vec3d N = to_double(along);
  const double d = by.scale * (static_cast<double>(h) - static_cast<double>(by.midlevel)) / length(N);
  return std::isfinite(d) ? to_float(to_double(P) + d * N) : P;
}

/// @param N  what vertices without a triangle of any area keep
void smooth_normals(std::span<const TriangleIndices> triangles,
                    const std::vector<Vec3f>& P,
                    const std::vector<std::uint32_t>& stands_for,
                    std::vector<Normal3f>* N)
{
  std::vector<Vec3d> sums(P.size());
  for (const TriangleIndices& t : triangles) {
    const Vec3d P0 = to_double(P[t.v0]);
    const Vec3d normal = cross(to_double(P[t.v1]) - P0, to_double(P[t.v2]) - P0);
    const double size = length(normal);
    if (!(size > 0)) continue;
    for (const std::uint32_t vertex : {t.v0, t.v1, t.v2}) {
      Vec3d& sum = sums[stands_for[vertex]];
      sum = sum + normal * (1 / size);
    }
  }
  for (std::size_t vertex = 0; vertex < P.size(); ++vertex) {
    const Vec3d& sum = sums[stands_for[vertex]];
    const double size = length(sum);
    if (size > 0) (*N)[vertex] = as_normal(to_float(sum * (1 / size)));
  }
}

std::uint64_t lattice_points(std::int32_t n)
{
  return static_cast<std::uint64_t>(n + 1) * static_cast<std::uint64_t>(n + 2) / 2;
}

/// Weights of the base triangle's vertices 1 and 2 at the points (i, j) of a part's lattice, row by row of j. Where a side has fewer
/// points those of the lattice are moved to the nearest of them: each of the side's own is met by some.
std::vector<Vec2f> lattice_weights(const LatticeTriangle& part)
{
  const auto snap = [&](std::int32_t at, int side) {
    const std::int32_t step = part.n / part.side_n[side];
    return (at + step / 2) / step * step;
  };
  std::vector<Vec2f> weights;
  weights.reserve(lattice_points(part.n));
  for (std::int32_t j = 0; j <= part.n; ++j) {
    for (std::int32_t i = 0; i + j <= part.n; ++i) {
      std::int32_t x = i, y = j;
      if (j == 0) {
        x = snap(i, 0);
      } else if (i + j == part.n) {
        y = snap(j, 1);
        x = part.n - y;
      } else if (i == 0) {
        y = part.n - snap(part.n - j, 2);
      }
      const auto n = static_cast<float>(part.n);
      weights.push_back(part.base_weights(static_cast<float>(x) / n, static_cast<float>(y) / n));
    }
  }
  return weights;
}

/// The triangles of a lattice, row by row: but for the last of each, two and two are quadrilaterals.
/// @param first  vertex of the lattice
void divide(std::int32_t n, std::uint32_t first, TriangleIndices* triangles)
{
  std::uint32_t row = first;
  for (std::int32_t j = 0; j < n; ++j) {
    const std::uint32_t next = row + static_cast<std::uint32_t>(n - j + 1);
    for (std::int32_t i = 0; i + j < n; ++i) {
      const std::uint32_t a = row + static_cast<std::uint32_t>(i), above = next + static_cast<std::uint32_t>(i);
      *triangles++ = {a, a + 1, above};
      if (i + j + 1 < n) *triangles++ = {a + 1, above + 1, above};
    }
    row = next;
  }
}

/// Calls a function with the vertices of some thousands of a mesh's triangles.
template <typename F>
void for_some_triangles(const MeshView& mesh, F&& f)
{
  constexpr std::uint32_t kLooked = 4096;
  const std::uint32_t step = std::max(mesh.num_triangles / kLooked, 1u);
  for (std::uint32_t triangle = 0; triangle < mesh.num_triangles; triangle += step) {
    const TriangleIndices& t = mesh.triangles[triangle];
    const Vec3f P[3] = {mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]};
    f(P);
  }
}

}  // namespace

/// What a divided mesh has besides places and normals.
struct DividedMesh {
  std::vector<TriangleIndices> triangles;
  std::vector<Vec2f> uv[2];
  std::vector<Vec4f> tangent, color;
  std::vector<Vec3f> generated;
  std::vector<std::vector<float>> values;  ///< of columns
  std::vector<MeshColumn> columns;
  std::size_t num_vertices = 0;

  /// Makes room for what a mesh has.
  void resize(const MeshView& mesh, std::size_t vertices, std::size_t num_of_triangles)
  {
    num_vertices = vertices;
    triangles.resize(num_of_triangles);
    for (int set = 0; set < 2; ++set) uv[set].resize(mesh.uv[set] != nullptr ? vertices : 0);
    tangent.resize(mesh.tangent != nullptr ? vertices : 0);
    color.resize(mesh.color != nullptr ? vertices : 0);
    generated.resize(mesh.generated != nullptr ? vertices : 0);
    for (std::uint32_t k = 0; k < mesh.num_columns; ++k) {
      MeshColumn column = mesh.columns[k];
      values.emplace_back(vertices * column.num_components);
      column.values = values.back().data();
      columns.push_back(column);
    }
  }

  /// Sets what a vertex has, by its weights in a triangle of the mesh.
  void interpolate(const MeshView& mesh, const TriangleIndices& t, Vec2f w, std::size_t vertex)
  {
    const float w0 = 1.0f - w.x - w.y;
    const auto mix = [&](const auto* of) { return w0 * of[t.v0] + w.x * of[t.v1] + w.y * of[t.v2]; };
    for (int set = 0; set < 2; ++set) {
      if (mesh.uv[set] != nullptr) uv[set][vertex] = mix(mesh.uv[set]);
    }
    const auto mix4 = [&](const Vec4f* of) {
      const Vec4f &a = of[t.v0], &b = of[t.v1], &c = of[t.v2];
      return Vec4f{w0 * a.x + w.x * b.x + w.y * c.x, w0 * a.y + w.x * b.y + w.y * c.y, w0 * a.z + w.x * b.z + w.y * c.z,
                   w0 * a.w + w.x * b.w + w.y * c.w};
    };
    if (mesh.tangent != nullptr) {
      tangent[vertex] = mix4(mesh.tangent);
      tangent[vertex].w = mesh.tangent[t.v0].w;
    }
    if (mesh.color != nullptr) color[vertex] = mix4(mesh.color);
    if (mesh.generated != nullptr) generated[vertex] = mix(mesh.generated);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::size_t width = columns[k].num_components;
      const float* of = mesh.columns[k].values;
      for (std::size_t c = 0; c < width; ++c) {
        values[k][vertex * width + c] =
            w0 * of[t.v0 * width + c] + w.x * of[t.v1 * width + c] + w.y * of[t.v2 * width + c];
      }
    }
  }

  MeshView view() const
  {
    const auto data = [](const auto& of) { return of.empty() ? nullptr : of.data(); };
    MeshView out;
    out.uv[0] = data(uv[0]);
    out.uv[1] = data(uv[1]);
    out.tangent = data(tangent);
    out.color = data(color);
    out.generated = data(generated);
    out.columns = data(columns);
    out.num_columns = static_cast<std::uint32_t>(columns.size());
    out.triangles = data(triangles);
    out.num_triangles = static_cast<std::uint32_t>(triangles.size());
    out.num_vertices = static_cast<std::uint32_t>(num_vertices);
    return out;
  }

  static std::size_t bytes_a_vertex(const MeshView& mesh)
  {
    std::size_t sum = (mesh.uv[0] != nullptr ? sizeof(Vec2f) : 0) + (mesh.uv[1] != nullptr ? sizeof(Vec2f) : 0) +
                      (mesh.tangent != nullptr ? sizeof(Vec4f) : 0) + (mesh.color != nullptr ? sizeof(Vec4f) : 0) +
                      (mesh.generated != nullptr ? sizeof(Vec3f) : 0);
    for (std::uint32_t k = 0; k < mesh.num_columns; ++k) sum += mesh.columns[k].num_components * sizeof(float);
    return sum;
  }
  std::size_t bytes() const
  {
    MeshView own = view();
    return triangles.size() * sizeof(TriangleIndices) + num_vertices * bytes_a_vertex(own);
  }
};

namespace {

/// The sides of a mesh's triangles, those between the same two vertices as one.
struct MeshSides {
  std::vector<std::uint32_t> of_triangles;  ///< 3 · triangle + k: number of the side from its vertex k to the next
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ends;

  explicit MeshSides(const MeshView& mesh) : of_triangles(3 * std::size_t{mesh.num_triangles})
  {
    const auto ends_of = [&mesh](std::uint32_t side) {
      const TriangleIndices& t = mesh.triangles[side / 3];
      const std::uint32_t vertices[3] = {t.v0, t.v1, t.v2};
      const std::uint32_t a = vertices[side % 3], b = vertices[(side + 1) % 3];
      return std::pair{std::min(a, b), std::max(a, b)};
    };
    // Sorted by their lower vertices, by counting, and then by the others, of which there are few each.
    const auto num_sides = static_cast<std::uint32_t>(of_triangles.size());
    std::vector<std::uint32_t> first(std::size_t{mesh.num_vertices} + 1), sorted(num_sides);
    for (std::uint32_t side = 0; side < num_sides; ++side) ++first[std::size_t{ends_of(side).first} + 1];
    for (std::size_t vertex = 0; vertex < mesh.num_vertices; ++vertex) first[vertex + 1] += first[vertex];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (std::uint32_t side = 0; side < num_sides; ++side) sorted[next[ends_of(side).first]++] = side;
    tbb::parallel_for(std::uint32_t{0}, mesh.num_vertices, [&](std::uint32_t vertex) {
      std::sort(sorted.begin() + first[vertex], sorted.begin() + first[vertex + 1],
                [&](std::uint32_t a, std::uint32_t b) {
                  return std::pair{ends_of(a), a} < std::pair{ends_of(b), b};
                });
    });
    for (const std::uint32_t side : sorted) {
      if (const auto two = ends_of(side); ends.empty() || ends.back() != two) ends.push_back(two);
      of_triangles[side] = static_cast<std::uint32_t>(ends.size() - 1);
    }
  }
};

MovedMesh halve(const MeshView& mesh)
{
  const MeshSides sides(mesh);
  const auto divided = std::make_shared<DividedMesh>();
  const std::size_t num_vertices = mesh.num_vertices + sides.ends.size();
  divided->resize(mesh, num_vertices, 4 * std::size_t{mesh.num_triangles});
  MovedMesh out;
  out.P.resize(num_vertices);
  out.N.resize(num_vertices);
  tbb::parallel_for(std::size_t{0}, num_vertices, [&](std::size_t vertex) {
    const auto own = static_cast<std::uint32_t>(vertex);
    const bool is_new = vertex >= mesh.num_vertices;
    const auto [a, b] = is_new ? sides.ends[vertex - mesh.num_vertices] : std::pair{own, own};
    // The same from either end, so that the two sides of a cut of texture coordinates stay one place.
    out.P[vertex] = is_new ? 0.5f * (mesh.P[a] + mesh.P[b]) : mesh.P[a];
    out.N[vertex] = is_new ? as_normal(0.5f * (as_vector(mesh.N[a]) + as_vector(mesh.N[b]))) : mesh.N[a];
    divided->interpolate(mesh, {a, b, b}, {is_new ? 0.5f : 0.0f, 0.0f}, vertex);
  });
  tbb::parallel_for(std::uint32_t{0}, mesh.num_triangles, [&](std::uint32_t triangle) {
    const TriangleIndices& t = mesh.triangles[triangle];
    const auto middle = [&](std::size_t k) {
      return mesh.num_vertices + sides.of_triangles[3 * std::size_t{triangle} + k];
    };
    const std::uint32_t m0 = middle(0), m1 = middle(1), m2 = middle(2);
    TriangleIndices* const four = divided->triangles.data() + 4 * std::size_t{triangle};
    four[0] = {t.v0, m0, m2};
    four[1] = {m0, m1, m2};
    four[2] = {m0, t.v1, m1};
    four[3] = {m2, m1, t.v2};
  });
  out.divided = divided;
  return out;
}

}  // namespace

MovedMesh halved_mesh_make(const MeshView& mesh, int times)
{
  MovedMesh out = halve(mesh);
  for (int k = 1; k < times; ++k) out = halve(out.view(mesh));
  return out;
}

CornerHeights corner_heights(const HeightSource& source)
{
  return [source](const std::uint32_t* corners, float* h) {
    for (int lane = 0; lane < 8; ++lane) {
      float b[3][8] = {}, at_one[8];
      std::fill_n(b[corners[lane] % 3], 8, 1.0f);
      source.eval(source.owner, corners[lane] / 3, b, at_one);
      h[lane] = at_one[0];
    }
  };
}

MeshView MovedMesh::view(const MeshView& mesh) const
{
  MeshView out = divided != nullptr ? divided->view() : mesh;
  out.P = P.data();
  out.N = N.empty() ? nullptr : N.data();
  return out;
}

std::size_t MovedMesh::bytes() const
{
  std::size_t sum = P.capacity() * sizeof(P[0]) + N.capacity() * sizeof(N[0]);
  for (const MovedShape& step : steps) sum += step.P.capacity() * sizeof(P[0]) + step.N.capacity() * sizeof(N[0]);
  return sum + (divided != nullptr ? divided->bytes() : 0);
}

namespace {

/// For each vertex the first one at the same place.
std::vector<std::uint32_t> weld_places(std::span<const Vec3f> P)
{
  return weld_vertices(P, std::vector<Normal3f>(P.size()));
}

/// @param move        where eight vertices go: (corners, vertices, their places); a vertex may be there more than once
/// @param stands_for  of each vertex the one with which it moves
/// @param shaded_as   likewise, with which it has a normal; empty: there are none
template <typename Move>
MovedMesh move_own(const MeshView& mesh,
                   const std::vector<std::uint32_t>& stands_for,
                   const std::vector<std::uint32_t>& shaded_as,
                   const Move& move)
{
  const std::vector<std::uint32_t> corners = first_corners(mesh, stands_for);
  std::vector<std::uint32_t> asked;  // vertices
  for (std::uint32_t vertex = 0; vertex < mesh.num_vertices; ++vertex) {
    if (corners[vertex] != kNone) asked.push_back(vertex);
  }
  MovedMesh out;
  // Embree reads 16 bytes at the last vertex.
  out.P.reserve(mesh.num_vertices + std::size_t{1});
  out.P.assign(mesh.P, mesh.P + mesh.num_vertices);
  tbb::parallel_for(std::size_t{0}, (asked.size() + 7) / 8, [&](std::size_t eight) {
    std::uint32_t vertices[8], of_corners[8];
    Vec3f P[8];
    for (std::size_t lane = 0; lane < 8; ++lane) {
      vertices[lane] = asked[std::min(8 * eight + lane, asked.size() - 1)];
      of_corners[lane] = corners[vertices[lane]];
    }
    move(of_corners, vertices, P);
    for (int lane = 0; lane < 8; ++lane) out.P[vertices[lane]] = P[lane];
  });
  for (std::uint32_t vertex = 0; vertex < mesh.num_vertices; ++vertex) out.P[vertex] = out.P[stands_for[vertex]];
  if (!shaded_as.empty()) {
    out.N.assign(mesh.N, mesh.N + mesh.num_vertices);
    smooth_normals({mesh.triangles, mesh.num_triangles}, out.P, shaded_as, &out.N);
  }
  return out;
}

/// @param smooth  vertices have normals
MovedMesh move_divided(const MeshView& mesh,
                       std::span<const LatticeTriangle> parts,
                       bool smooth,
                       const PointMover& mover)
{
  const auto out = std::make_shared<DividedMesh>();
  std::vector<std::uint32_t> first_vertex(parts.size() + 1), first_triangle(parts.size() + 1);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    first_vertex[k + 1] = first_vertex[k] + static_cast<std::uint32_t>(lattice_points(parts[k].n));
    first_triangle[k + 1] = first_triangle[k] + static_cast<std::uint32_t>(parts[k].n * parts[k].n);
  }
  const std::size_t num_vertices = first_vertex.back();
  MovedMesh moved;
  moved.P.reserve(num_vertices + 1);
  moved.P.resize(num_vertices);
  out->resize(mesh, num_vertices, first_triangle.back());
  std::vector<Vec3f> base_P(num_vertices);
  std::vector<Normal3f> base_N(num_vertices);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
    const LatticeTriangle& part = parts[k];
    const TriangleIndices& t = mesh.triangles[part.base];
    const std::vector<Vec2f> weights = lattice_weights(part);
    for (std::size_t first = 0; first < weights.size(); first += 8) {
      float b[3][8];
      Vec3f P[8], P_moved[8];
      Normal3f N[8];
      for (std::size_t lane = 0; lane < 8; ++lane) {
        const Vec2f w = weights[std::min(first + lane, weights.size() - 1)];
        b[0][lane] = static_cast<float>(1.0 - static_cast<double>(w.x) - static_cast<double>(w.y));
        b[1][lane] = w.x;
        b[2][lane] = w.y;
        P[lane] = lattice_corner(w, mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]);
        if (mesh.N == nullptr) continue;
        N[lane] =
            as_normal(lattice_corner(w, as_vector(mesh.N[t.v0]), as_vector(mesh.N[t.v1]), as_vector(mesh.N[t.v2])));
      }
      mover.move(part.base, b, P, N, P_moved);
      for (std::size_t lane = 0; lane < std::min<std::size_t>(8, weights.size() - first); ++lane) {
        const std::size_t vertex = first_vertex[k] + first + lane;
        base_P[vertex] = P[lane];
        base_N[vertex] = N[lane];
        moved.P[vertex] = P_moved[lane];
        out->interpolate(mesh, t, weights[first + lane], vertex);
      }
    }
    divide(part.n, first_vertex[k], out->triangles.data() + first_triangle[k]);
  });
  std::vector<std::uint32_t> of_lines, of_places;
  if (mover.along || smooth) of_lines = weld_vertices(base_P, base_N);
  if (!mover.along) of_places = weld_places(base_P);
  const std::vector<std::uint32_t>& stands_for = mover.along ? of_lines : of_places;
  for (std::size_t vertex = 0; vertex < num_vertices; ++vertex) moved.P[vertex] = moved.P[stands_for[vertex]];
  if (smooth) {
    moved.N = std::move(base_N);
    smooth_normals(out->triangles, moved.P, of_lines, &moved.N);
  }
  moved.divided = out;
  return moved;
}

}  // namespace

PointMover point_mover_make(const HeightSource& source, const VertexDisplacement& by)
{
  return {[source, by](std::uint32_t triangle, const float(*b)[8], const Vec3f* P, const Normal3f* N, Vec3f* moved) {
            float h[8];
            source.eval(source.owner, triangle, b, h);
            for (int k = 0; k < 8; ++k) moved[k] = moved_point(P[k], as_vector(N[k]), h[k], by);
          },
          true};
}

PointMover point_mover_make(const PointMoves& moves)
{
  return {[moves](std::uint32_t triangle, const float(*b)[8], const Vec3f* P, const Normal3f*, Vec3f* moved) {
            moves.eval(moves.owner, triangle, b, moved);
            for (int k = 0; k < 8; ++k) moved[k] = P[k] + moved[k];
          },
          false};
}

MovedMesh moved_mesh_make(const MeshView& mesh, const CornerHeights& heights, const VertexDisplacement& by)
{
  const std::vector<std::uint32_t> stands_for = weld_vertices({mesh.P, mesh.num_vertices}, {mesh.N, mesh.num_vertices});
  return move_own(mesh, stands_for, by.smooth ? stands_for : std::vector<std::uint32_t>{},
                  [&](const std::uint32_t* corners, const std::uint32_t* vertices, Vec3f* P) {
                    float h[8];
                    heights(corners, h);
                    for (int lane = 0; lane < 8; ++lane) {
                      const std::uint32_t vertex = vertices[lane];
                      P[lane] = moved_point(mesh.P[vertex], as_vector(mesh.N[vertex]), h[lane], by);
                    }
                  });
}

MovedMesh moved_mesh_make(const MeshView& mesh, const PointMoves& moves, bool smooth, std::span<const MeshShape> steps)
{
  const std::span<const Vec3f> places{mesh.P, mesh.num_vertices};
  std::vector<std::uint32_t> shaded_as;
  if (smooth && mesh.N != nullptr) shaded_as = weld_vertices(places, {mesh.N, mesh.num_vertices});
  MovedMesh out = move_own(mesh, weld_places(places), shaded_as,
                           [&](const std::uint32_t* corners, const std::uint32_t* vertices, Vec3f* P) {
                             moves.eval_corners(moves.owner, corners, P);
                             for (int lane = 0; lane < 8; ++lane) P[lane] = mesh.P[vertices[lane]] + P[lane];
                           });
  for (const MeshShape& step : steps) {
    MovedShape& shape = out.steps.emplace_back();
    shape.P.reserve(mesh.num_vertices + std::size_t{1});
    for (std::size_t k = 0; k < mesh.num_vertices; ++k) shape.P.push_back(step.P[k] + (out.P[k] - mesh.P[k]));
    if (shaded_as.empty()) continue;
    shape.N = out.N;
    smooth_normals({mesh.triangles, mesh.num_triangles}, shape.P, shaded_as, &shape.N);
  }
  return out;
}

MovedMesh divided_mesh_make(const MeshView& mesh,
                            const HeightSource& source,
                            std::span<const LatticeTriangle> parts,
                            const VertexDisplacement& by)
{
  return move_divided(mesh, parts, by.smooth, point_mover_make(source, by));
}

MovedMesh divided_mesh_make(const MeshView& mesh,
                            const PointMoves& moves,
                            std::span<const LatticeTriangle> parts,
                            bool smooth,
                            std::span<const MeshShape> steps)
{
  smooth = smooth && mesh.N != nullptr;
  MovedMesh out = move_divided(mesh, parts, smooth, point_mover_make(moves));
  if (steps.empty()) return out;
  std::vector<Vec3f> base_P;
  std::vector<Normal3f> base_N;
  for (std::size_t k = 0; k < steps.size(); ++k) out.steps.emplace_back().P.reserve(out.P.size() + 1);
  for (const LatticeTriangle& part : parts) {
    const TriangleIndices& t = mesh.triangles[part.base];
    for (const Vec2f w : lattice_weights(part)) {
      const Vec3f P = lattice_corner(w, mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]);
      const Vec3f move = out.P[base_P.size()] - P;
      base_P.push_back(P);
      if (smooth) {
        base_N.push_back(
            as_normal(lattice_corner(w, as_vector(mesh.N[t.v0]), as_vector(mesh.N[t.v1]), as_vector(mesh.N[t.v2]))));
      }
      for (std::size_t k = 0; k < steps.size(); ++k) {
        const Vec3f* const at = steps[k].P;
        out.steps[k].P.push_back(lattice_corner(w, at[t.v0], at[t.v1], at[t.v2]) + move);
      }
    }
  }
  if (!smooth) return out;
  const std::vector<std::uint32_t> of_lines = weld_vertices(base_P, base_N);
  for (MovedShape& shape : out.steps) {
    shape.N = out.N;
    smooth_normals(out.divided->triangles, shape.P, of_lines, &shape.N);
  }
  return out;
}

MovedMesh placed_mesh_make(const MeshView& mesh,
                           std::span<const MeshPlace> places,
                           std::vector<TriangleIndices> triangles,
                           std::vector<MovedShape> steps)
{
  const auto divided = std::make_shared<DividedMesh>();
  divided->resize(mesh, places.size(), 0);
  divided->triangles = std::move(triangles);
  for (std::size_t vertex = 0; vertex < places.size(); ++vertex)
    divided->interpolate(mesh, mesh.triangles[places[vertex].triangle], places[vertex].weights, vertex);
  MovedMesh out;
  // Embree reads 16 bytes at the last vertex.
  for (MovedShape& step : steps) step.P.reserve(places.size() + 1);
  out.P = steps[steps.size() / 2].P;
  out.P.reserve(places.size() + 1);
  if (steps.size() > 1) out.steps = std::move(steps);
  out.divided = divided;
  return out;
}

namespace {

/// Of a divided mesh whose vertices are moved.
std::uint64_t bytes_of(const MeshView& mesh, std::uint64_t vertices, std::uint64_t triangles)
{
  // Twelve bytes of vertices' numbers, ten of quadrilaterals', and 57 that Embree's tree takes while it is built: 9.4 million triangles with
  // uv and tangents took a process 1.05 GB, where this says 1.16.
  constexpr std::uint64_t kTriangle = 80;
  constexpr std::uint64_t kWhileMoving = 2 * (sizeof(Vec3f) + sizeof(Normal3f)) + 12;
  return vertices * (kWhileMoving + DividedMesh::bytes_a_vertex(mesh)) + triangles * kTriangle;
}

}  // namespace

std::uint64_t divided_mesh_bytes(const MeshView& mesh, std::span<const LatticeTriangle> parts)
{
  std::uint64_t vertices = 0, triangles = 0;
  for (const LatticeTriangle& part : parts) {
    vertices += lattice_points(part.n);
    triangles += static_cast<std::uint64_t>(part.n) * static_cast<std::uint64_t>(part.n);
  }
  return bytes_of(mesh, vertices, triangles);
}

std::uint64_t halved_mesh_bytes(const MeshView& mesh, int times)
{
  // A triangle has one and a half sides of its own, each of which gets a vertex.
  std::uint64_t vertices = mesh.num_vertices, triangles = mesh.num_triangles;
  for (int k = 0; k < times; ++k) {
    vertices += triangles + (triangles + 1) / 2;
    triangles *= 4;
  }
  return bytes_of(mesh, vertices, triangles);
}

double mean_cells_a_side(const MeshView& mesh, const CellsAlong& cells)
{
  double sum = 0;
  std::uint32_t count = 0;
  for_some_triangles(mesh, [&](const Vec3f* P) {
    sum += cells(P[0], P[1]) + cells(P[1], P[2]) + cells(P[2], P[0]);
    ++count;
  });
  return sum / (3.0 * count);
}

double mean_pixels_a_side(const MeshView& mesh, const SeenInstances& seen)
{
  double sum = 0, areas = 0;
  for_some_triangles(mesh, [&](const Vec3f* P) {
    const double sides[3] = {seen.pixels(P[0], P[1]), seen.pixels(P[1], P[2]), seen.pixels(P[2], P[0])};
    const double mean = (sides[0] + sides[1] + sides[2]) / 3;
    const double half = 1.5 * mean;
    const double area =
        std::sqrt(std::max(half * (half - sides[0]) * (half - sides[1]) * (half - sides[2]), 0.0));  // Heron's
    sum += area * mean;
    areas += area;
  });
  return areas > 0 ? sum / areas : 0.0;
}

}  // namespace relief
