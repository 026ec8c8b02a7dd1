#include "scene/tangents.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <unordered_map>

namespace relief {
namespace {

/// Which way round a triangle's uv run.
enum class Handedness : std::uint8_t { kPositive, kNegative, kUnknown };

using VertexKey = std::array<std::uint32_t, 8>;

struct VertexKeyHash {
  std::size_t operator()(const VertexKey& key) const
  {
    std::uint64_t h = 0x9e3779b97f4a7c15u;
    for (const std::uint32_t word : key) {
      h = (h ^ word) * 0xff51afd7ed558ccdu;
      h ^= h >> 32;
    }
    return static_cast<std::size_t>(h);
  }
};

/// Bits of a float with −0 taken as 0.
std::uint32_t key_bits(float x) { return std::bit_cast<std::uint32_t>(x == 0.0f ? 0.0f : x); }

/// For each vertex, the first one with equal position, normal and uv.
std::vector<std::uint32_t> first_equal_vertex(const Mesh& mesh, const std::vector<Normal3f>& N, int uv_set)
{
  std::unordered_map<VertexKey, std::uint32_t, VertexKeyHash> first;
  first.reserve(mesh.P.size());
  std::vector<std::uint32_t> out(mesh.P.size());
  for (std::uint32_t v = 0; v < out.size(); ++v) {
    const Vec3f p = mesh.P[v];
    const Normal3f n = N[v];
    const Vec2f t = mesh.uv[uv_set][v];
    out[v] = first
                 .try_emplace({key_bits(p.x), key_bits(p.y), key_bits(p.z), key_bits(n.x), key_bits(n.y), key_bits(n.z),
                               key_bits(t.x), key_bits(t.y)},
                              v)
                 .first->second;
  }
  return out;
}

template <typename T>
void gather(std::vector<T>& values, const std::vector<std::uint32_t>& from)
{
  if (values.empty()) {
    return;
  }
  std::vector<T> out(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    out[i] = values[from[i]];
  }
  values = std::move(out);
}

/// New vertex i is a copy of old vertex `from[i]`.
void gather_vertices(Mesh& mesh, const std::vector<std::uint32_t>& from)
{
  gather(mesh.P, from);
  gather(mesh.N, from);
  gather(mesh.uv[0], from);
  gather(mesh.uv[1], from);
  gather(mesh.color, from);
  gather(mesh.generated, from);
  for (AttributeColumn& column : mesh.columns) {
    std::vector<float> values;
    const auto n = static_cast<std::size_t>(column.num_components);
    values.reserve(from.size() * n);
    for (const std::uint32_t v : from) {
      const auto first = column.values.begin() + static_cast<std::ptrdiff_t>(v * n);
      values.insert(values.end(), first, first + static_cast<std::ptrdiff_t>(n));
    }
    column.values = std::move(values);
  }
}

/// Gives every triangle vertices of its own.
void separate_triangles(Mesh& mesh)
{
  std::vector<std::uint32_t> from;
  from.reserve(mesh.triangles.size() * 3);
  for (TriangleIndices& t : mesh.triangles) {
    const auto base = static_cast<std::uint32_t>(from.size());
    from.insert(from.end(), {t.v0, t.v1, t.v2});
    t = {base, base + 1, base + 2};
  }
  gather_vertices(mesh, from);
}

/// Unit normal of a triangle. Edges are scaled to about 1 first, so that their product does not underflow.
Normal3f triangle_normal(Vec3f a, Vec3f b, Vec3f c)
{
  const Vec3f e1 = b - a, e2 = c - a;
  const Vec3f n = normalize(cross(e1 / max_component(abs(e1)), e2 / max_component(abs(e2))));
  return is_finite(n) ? as_normal(n) : Normal3f{0, 0, 1};
}

/// The mesh's normals, or the triangles' own for a mesh whose triangles share no vertices.
std::vector<Normal3f> shading_normals(const Mesh& mesh)
{
  if (!mesh.N.empty()) {
    return mesh.N;
  }
  std::vector<Normal3f> N(mesh.P.size());
  for (const TriangleIndices& t : mesh.triangles) {
    N[t.v0] = N[t.v1] = N[t.v2] = triangle_normal(mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]);
  }
  return N;
}

/// v without its part along the unit vector n, made unit; zero if nothing is left.
Vec3f project_unit(Vec3f v, Vec3f n)
{
  const Vec3f in_plane = v - n * dot(v, n);
  const float size = length(in_plane);
  return size > 0 ? in_plane / size : Vec3f{};
}

/// ∂P/∂u of a triangle up to a positive factor, and how its uv run.
struct TriangleTangent {
  Vec3f dPdu;
  Handedness handedness = Handedness::kUnknown;
};

TriangleTangent triangle_tangent(const Mesh& mesh, const TriangleIndices& t, int uv_set)
{
  const std::vector<Vec2f>& uv = mesh.uv[uv_set];
  const Vec3f e1 = mesh.P[t.v1] - mesh.P[t.v0], e2 = mesh.P[t.v2] - mesh.P[t.v0];
  const Vec2f d1 = uv[t.v1] - uv[t.v0], d2 = uv[t.v2] - uv[t.v0];
  const float area = difference_of_products(d1.x, d2.y, d2.x, d1.y);
  if (area == 0 || !is_finite(area)) {
    return {};
  }
  // Against v, which points down, so a positive area in (u, v) is a mirrored image.
  const Vec3f tangent = e1 * d2.y - e2 * d1.y;
  return {area > 0 ? tangent : -tangent, area < 0 ? Handedness::kPositive : Handedness::kNegative};
}

class TangentBuilder {
 public:
  TangentBuilder(Mesh& mesh, int uv_set)
      : mesh_(mesh), uv_set_(uv_set), N_(shading_normals(mesh)), first_equal_(first_equal_vertex(mesh, N_, uv_set))
  {
    for (auto& sums : sums_) {
      sums.resize(mesh.P.size());
    }
  }

  void build()
  {
    std::vector<Handedness> handedness(mesh_.triangles.size());
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      const TriangleTangent tangent = triangle_tangent(mesh_, mesh_.triangles[i], uv_set_);
      handedness[i] = tangent.handedness;
      if (tangent.handedness != Handedness::kUnknown) {
        accumulate(mesh_.triangles[i], tangent);
      }
    }
    split_and_assign(handedness);
  }

 private:
  void accumulate(const TriangleIndices& t, const TriangleTangent& tangent)
  {
    const std::array<std::uint32_t, 3> corner{t.v0, t.v1, t.v2};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t v = corner[c];
      const Vec3f n = as_vector(N_[v]), p = mesh_.P[v];
      const Vec3f to_next = project_unit(mesh_.P[corner[(c + 1) % 3]] - p, n);
      const Vec3f to_previous = project_unit(mesh_.P[corner[(c + 2) % 3]] - p, n);
      const float angle = std::acos(clamp(dot(to_next, to_previous), -1.0f, 1.0f));
      sums_[static_cast<std::size_t>(tangent.handedness)][first_equal_[v]] += project_unit(tangent.dPdu, n) * angle;
    }
  }

  /// A vertex takes the handedness of the first triangle that knows one; triangles of the other kind get a copy.
  void split_and_assign(const std::vector<Handedness>& handedness)
  {
    const std::size_t num_vertices = mesh_.P.size();
    std::vector<Handedness> side(num_vertices, Handedness::kUnknown);
    std::vector<std::uint32_t> copy_of(num_vertices);
    for (std::uint32_t v = 0; v < num_vertices; ++v) {
      copy_of[v] = v;
    }
    constexpr std::uint32_t kNone = ~0u;
    std::vector<std::uint32_t> other(num_vertices, kNone);
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
      TriangleIndices& t = mesh_.triangles[i];
      const Handedness h = handedness[i];
      for (std::uint32_t* v : {&t.v0, &t.v1, &t.v2}) {
        if (h == Handedness::kUnknown || side[*v] == h) {
          continue;
        }
        if (side[*v] == Handedness::kUnknown) {
          side[*v] = h;
          continue;
        }
        if (other[*v] == kNone) {
          other[*v] = static_cast<std::uint32_t>(copy_of.size());
          copy_of.push_back(*v);
          side.push_back(h);
        }
        *v = other[*v];
      }
    }
    if (copy_of.size() > num_vertices) {
      gather_vertices(mesh_, copy_of);
    }
    mesh_.tangent.resize(copy_of.size());
    for (std::size_t v = 0; v < copy_of.size(); ++v) {
      mesh_.tangent[v] = tangent_of(copy_of[v], side[v]);
    }
  }

  Vec4f tangent_of(std::uint32_t vertex, Handedness side) const
  {
    const std::uint32_t first = first_equal_[vertex];
    // Of triangles without area in uv that is what neighbours have; or else what MikkTSpace leaves there, as far as it is in the plane.
    const bool positive = side == Handedness::kPositive || (side == Handedness::kUnknown && !is_zero(sums_[0][first]));
    const Vec3f sum = sums_[positive ? 0 : 1][first];
    const Vec3f t = project_unit(is_zero(sum) ? Vec3f{1, 0, 0} : sum, as_vector(N_[vertex]));
    return {t.x, t.y, t.z, positive ? 1.0f : -1.0f};
  }

  Mesh& mesh_;
  int uv_set_;
  std::vector<Normal3f> N_;
  std::vector<std::uint32_t> first_equal_;
  std::array<std::vector<Vec3f>, 2> sums_;  ///< by handedness, at the first equal vertex
};

}  // namespace

void tangents_derive(Mesh& mesh, int uv_set)
{
  if (mesh.N.empty()) {
    separate_triangles(mesh);
  }
  TangentBuilder(mesh, uv_set).build();
}

}  // namespace relief
