#include "benchmarks/procedural/smoothing_study.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "displacement/curved_heights.h"

namespace relief {

namespace {

constexpr int kInnerPoints = 15;  ///< of a side, without its ends
constexpr double kDegrees = 180 / M_PI;

struct Corner {
  Vec3f P, N;
  auto key() const { return std::array{P.x, P.y, P.z, N.x, N.y, N.z}; }
};

struct Face {
  std::array<Corner, 3> corners;

  CurvedTriangle curved() const
  {
    const Vec3f P[3] = {corners[0].P, corners[1].P, corners[2].P}, N[3] = {corners[0].N, corners[1].N, corners[2].N};
    return {P, N};
  }
  Vec3d flat_normal() const
  {
    const Vec3d P = to_double(corners[0].P);
    return cross(to_double(corners[1].P) - P, to_double(corners[2].P) - P);
  }
};

/// Side k of a face runs from corner k to the next.
struct Side {
  const Face* face = nullptr;
  int k = 0;
};

Vec3d surface(const Face& face, const CurvedTriangle& curved, const std::array<double, 3>& b)
{
  Vec3d P{}, N{};
  for (std::size_t k = 0; k < 3; ++k) {
    P = P + b[k] * to_double(face.corners[k].P);
    N = N + b[k] * to_double(face.corners[k].N);
  }
  return P + N * (curved.displacement(b.data()) / length(N));
}

/// Normal on a side, by differences of second order.
/// @param t  along the side, 0…1
Vec3d curved_normal(const Side& side, const CurvedTriangle& curved, double t)
{
  constexpr double kStep = 1e-5;
  const auto from = static_cast<std::size_t>(side.k);
  const auto at = [&](double along, double inward) {
    std::array<double, 3> b{};
    b[from] = (1 - along) * (1 - inward);
    b[(from + 1) % 3] = along * (1 - inward);
    b[(from + 2) % 3] = inward;
    return surface(*side.face, curved, b);
  };
  const Vec3d here = at(t, 0), along = at(t + kStep, 0) - at(t - kStep, 0);
  const Vec3d inward = (at(t, kStep) - here) * 4.0 - (at(t, 2 * kStep) - here);
  return cross(along, inward);
}

double angle(Vec3d a, Vec3d b) { return kDegrees * std::atan2(length(cross(a, b)), dot(a, b)); }

bool is_known(const CurvedTriangle& curved)
{
  double low, high;
  curved.bounds(&low, &high);
  return std::isfinite(high);
}

std::vector<Face> faces_of(const MeshView& mesh)
{
  std::vector<Face> faces;
  for (std::uint32_t k = 0; k < mesh.num_triangles; ++k) {
    const TriangleIndices& t = mesh.triangles[k];
    const auto corner = [&](std::uint32_t v) { return Corner{mesh.P[v], as_vector(mesh.N[v])}; };
    faces.push_back({{corner(t.v0), corner(t.v1), corner(t.v2)}});
  }
  return faces;
}

}  // namespace

SmoothingResult smoothing_study(const std::string& name, const MeshView& mesh)
{
  const std::vector<Face> faces = faces_of(mesh);
  SmoothingResult out;
  out.mesh = name;
  out.num_triangles = faces.size();
  // Sides that wait for the triangle on their other side, by where they begin and end.
  std::map<std::array<std::array<float, 6>, 2>, Side> open;
  double num_points = 0;
  for (const Face& face : faces) {
    for (int k = 0; k < 3; ++k) {
      const auto from = face.corners[static_cast<std::size_t>(k)].key(),
                 to = face.corners[static_cast<std::size_t>((k + 1) % 3)].key();
      const auto other = open.find({to, from});
      if (other == open.end()) {
        open.insert({{from, to}, {&face, k}});
        continue;
      }
      const Side sides[2] = {{&face, k}, other->second};
      open.erase(other);
      ++out.num_sides;
      const CurvedTriangle curved[2] = {sides[0].face->curved(), sides[1].face->curved()};
      if (!is_known(curved[0]) || !is_known(curved[1])) {
        ++out.num_left_out;
        continue;
      }
      const double flat = angle(sides[0].face->flat_normal(), sides[1].face->flat_normal());
      for (int point = 1; point <= kInnerPoints; ++point, ++num_points) {
        const double t = static_cast<double>(point) / (kInnerPoints + 1);
        const double jump = angle(curved_normal(sides[0], curved[0], t), curved_normal(sides[1], curved[1], 1 - t));
        out.flat.largest = std::max(out.flat.largest, flat);
        out.flat.mean += flat;
        out.curved.largest = std::max(out.curved.largest, jump);
        out.curved.mean += jump;
        if (jump > 0.1) ++out.steps_share;
      }
    }
  }
  const double inverse = 1 / std::max(num_points, 1.0);
  out.flat.mean *= inverse;
  out.curved.mean *= inverse;
  out.steps_share *= inverse;
  return out;
}

SmoothingResult smoothing_study_of_icosahedron()
{
  constexpr float kA = 0.525731f, kB = 0.850651f;
  const Vec3f P[12] = {{-kA, 0, kB}, {kA, 0, kB},   {-kA, 0, -kB}, {kA, 0, -kB}, {0, kB, kA},  {0, kB, -kA},
                       {0, -kB, kA}, {0, -kB, -kA}, {kB, kA, 0},   {-kB, kA, 0}, {kB, -kA, 0}, {-kB, -kA, 0}};
  std::vector<TriangleIndices> triangles;
  // Corners that are neighbours of one another make a face.
  const auto are_neighbours = [&](std::uint32_t a, std::uint32_t b) { return length(P[a] - P[b]) < 1.2f; };
  for (std::uint32_t a = 0; a < 12; ++a) {
    for (std::uint32_t b = a + 1; b < 12; ++b) {
      for (std::uint32_t c = b + 1; c < 12; ++c) {
        if (!are_neighbours(a, b) || !are_neighbours(b, c) || !are_neighbours(c, a)) continue;
        const bool is_outward = dot(cross(P[b] - P[a], P[c] - P[a]), P[a]) > 0;
        triangles.push_back(is_outward ? TriangleIndices{a, b, c} : TriangleIndices{a, c, b});
      }
    }
  }
  Normal3f N[12];
  std::transform(P, P + 12, N, [](Vec3f p) { return as_normal(p); });
  MeshView mesh;
  mesh.P = P;
  mesh.N = N;
  mesh.triangles = triangles.data();
  mesh.num_vertices = 12;
  mesh.num_triangles = static_cast<std::uint32_t>(triangles.size());
  return smoothing_study("icosahedron", mesh);
}

}  // namespace relief
