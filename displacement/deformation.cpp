#include "displacement/deformation.h"

#include <algorithm>
#include <cmath>

#include "displacement/prism.h"
#include "displacement/procedural_field.h"
#include "kernel/math/rounding.h"
#include "kernel/math/step_place.h"

namespace relief {

namespace {

/// P and N of a triangle on the way from one shape to another.
void place_between(const Deformation& deformation,
                   std::uint32_t triangle,
                   const MeshShape& from,
                   const MeshShape& to,
                   float part,
                   DisplacedTriangle* tri)
{
  const LatticeTriangle* const lattice = deformation.parts != nullptr ? deformation.parts + triangle : nullptr;
  const TriangleIndices& v = deformation.triangles[lattice != nullptr ? lattice->base : triangle];
  const std::uint32_t vertices[3] = {v.v0, v.v1, v.v2};
  Vec3f P[3], N[3];
  for (int k = 0; k < 3; ++k) {
    P[k] = mesh_mix(from.P[vertices[k]], to.P[vertices[k]], part);
    if (from.N != nullptr) N[k] = mesh_mix(as_vector(from.N[vertices[k]]), as_vector(to.N[vertices[k]]), part);
  }
  corners_place(P, from.N != nullptr ? N : nullptr, lattice, tri);
}

/// A bound from below on the length of all mixes of some vectors: how far they reach along their mean, at least.
double least_length(const Vec3d* vectors, int count)
{
  Vec3d sum;
  for (int i = 0; i < count; ++i) sum = sum + vectors[i];
  double least = length(sum) > 0 ? dot(vectors[0], sum) : 0;
  for (int i = 1; i < count; ++i) least = std::min(least, dot(vectors[i], sum));
  return least > 0 ? least / length(sum) : 0;
}

}  // namespace

void deforming_triangle_at_step(const Deformation& deformation,
                                std::uint32_t triangle,
                                std::uint32_t step,
                                DisplacedTriangle* tri)
{
  const MeshShape& shape = deformation.steps[step];
  place_between(deformation, triangle, shape, shape, 0, tri);
}

DeformingBounds deforming_bounds_make(const Deformation& deformation,
                                      std::uint32_t triangle,
                                      double d_low,
                                      double d_high)
{
  DeformingBounds out{d_low, d_high};
  // Normals of their own do not go straight.
  if (deformation.steps.front().N == nullptr) return out;
  double least = static_cast<double>(kInfinity), longest = 0;
  Vec3d N[6];  // of a step and of the next
  for (std::uint32_t step = 0; step < deformation.steps.size(); ++step) {
    DisplacedTriangle tri;
    deforming_triangle_at_step(deformation, triangle, step, &tri);
    for (int k = 0; k < 3; ++k) {
      N[k] = N[3 + k];
      N[3 + k] = to_double(tri.N[k]);
      longest = std::max(longest, length(N[3 + k]));
    }
    if (step > 0) least = std::min(least, least_length(N, 6));
  }
  // Where normals turn so far that they become short in between, what bounds d alone is tighter.
  constexpr double kShortest = 0.5;
  if (!(least > kShortest * longest)) return out;
  // Mixes are rounded to floats.
  constexpr auto kRounding = static_cast<double>(gamma_bound(8));
  least *= 1 - kRounding;
  longest *= 1 + kRounding;
  out.s_min = round_down(std::min(d_low / least, d_low / longest));
  out.s_max = round_up(std::max(d_high / least, d_high / longest));
  return out;
}

/// At a time between two steps, P and N of a point of the triangle are mixes of theirs at the steps, with the same weights,
/// and so is P + s·N for any s. Its surface there has an s within the bounds, which hold at all times; so it is within the
/// mix of two boxes that hold P + s·N at the steps for all s in the bounds. Likewise, as no point is further from P than its
/// displacement, within the mix of the boxes of the base triangle, enlarged by that.
///
/// What both boxes of a step have in common would be a still triangle's. The mix of that of two steps may be smaller than
/// what the mixes have in common: so a triangle has one of the two kinds at all steps.
Box3 deforming_triangle_bounds(const DisplacedMeshView& mesh, std::uint32_t triangle, std::uint32_t step)
{
  const Deformation& deformation = *mesh.deformation;
  const DeformingBounds& known = deformation.bounds[triangle];
  DisplacedTriangle tri;
  deforming_triangle_at_step(deformation, triangle, step, &tri);
  const double reach = std::max(std::abs(known.d_low), std::abs(known.d_high));
  const bool has_prism = known.s_min <= known.s_max;
  // Of what is mixed, of Embree's times and of the mix of two boxes.
  const auto rounding = static_cast<double>(gamma_bound(16 + 8 * static_cast<int>(deformation.steps.size())));
  const auto bounds = [&](float Vec3f::*axis, float* low, float* high) {
    double least = static_cast<double>(kInfinity), most = -least, magnitude = 0;
    for (int k = 0; k < 3; ++k) {
      const double p = tri.P[k].*axis, n = tri.N[k].*axis;
      const double ends[2] = {has_prism ? known.s_min * n : -reach, has_prism ? known.s_max * n : reach};
      for (const double end : ends) {
        least = std::min(least, p + end);
        most = std::max(most, p + end);
        magnitude = std::max(magnitude, std::abs(p) + std::abs(end));
      }
    }
    const double pad = rounding * magnitude + mesh.pad;
    *low = round_down(least - pad);
    *high = round_up(most + pad);
  };
  Box3 box;
  bounds(&Vec3f::x, &box.low.x, &box.high.x);
  bounds(&Vec3f::y, &box.low.y, &box.high.y);
  bounds(&Vec3f::z, &box.low.z, &box.high.z);
  return box;
}

TriangleAtTime::TriangleAtTime(const DisplacedMeshView& deforming, std::uint32_t triangle, float time)
    : tri(deforming.triangles[triangle]), mesh(deforming)
{
  const Deformation& deformation = *deforming.deformation;
  const DeformingBounds& known = deformation.bounds[triangle];
  const StepPlace place = step_place(time, static_cast<std::uint32_t>(deformation.steps.size()));
  place_between(deformation, triangle, deformation.steps[place.step], deformation.steps[place.step + 1], place.part,
                &tri);
  unfolded = prism_bound(known.d_low, known.d_high, &tri).unfolded ? 1 : 0;
  mesh.triangles = &tri;
  mesh.unfolded = &unfolded;
  mesh.num_triangles = 1;
  mesh.first_triangle = triangle;
  if (mesh.seam_edges != nullptr) mesh.seam_edges += triangle;
  mesh.deformation = nullptr;
}

}  // namespace relief
