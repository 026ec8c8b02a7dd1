#include "displacement/seen_instances.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "displacement/stretch.h"
#include "kernel/math/box.h"

namespace relief {

namespace {

/// What is shown larger by less than this is not looked for.
constexpr double kLarger = 1 + 1.0 / 16;

Vec3d place(const Affine3& m, Vec3d P)
{
  return P.x * to_double(m.x) + P.y * to_double(m.y) + P.z * to_double(m.z) + to_double(m.p);
}

}  // namespace

SeenInstances::SeenInstances(const MeshView& mesh,
                             const PictureView& view,
                             std::span<const Affine3> instances,
                             Coarser coarser)
    : view_(view), coarser_(coarser)
{
  Box3 box = box_empty();
  for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) box = box_union(box, {mesh.P[i], mesh.P[i]});
  const Vec3d middle = 0.5 * (to_double(box.low) + to_double(box.high));
  const double radius = 0.5 * length(to_double(box.high) - to_double(box.low));
  instances_.reserve(instances.size());
  for (const Affine3& m : instances) {
    const double stretch = stretch_of(m).most;
    const bool is_coarser = coarser == Coarser::kOutside;
    instances_.push_back(
        {m, stretch, stretch * view.most_pixels_a_metre(place(m, middle), stretch * radius, is_coarser)});
  }
  std::stable_sort(instances_.begin(), instances_.end(), [](const Seen& a, const Seen& b) { return a.most > b.most; });
}

double SeenInstances::coarsening(Vec3d P_world) const
{
  return coarser_ == Coarser::kOutside ? view_.coarsening(P_world) : view_.coarsening_afar(P_world);
}

double SeenInstances::pixels(Vec3f a, Vec3f b) const
{
  if (std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z)) std::swap(a, b);
  const double metres = length(to_double(b) - to_double(a));
  double most = 0;
  for (const Seen& seen : instances_) {
    if (!(seen.most * metres > kLarger * most)) break;
    const Vec3f ends[2] = {transform_point(seen.world_from_object, a), transform_point(seen.world_from_object, b)};
    const Vec3d from = to_double(ends[0]), to = to_double(ends[1]);
    const double coarser = min(coarsening(0.5 * (from + to)), min(coarsening(from), coarsening(to)));
    most = max(most, view_.pixels(ends[0], ends[1]) / coarser);
  }
  return most;
}

double SeenInstances::most_pixels_a_metre(Vec3d middle, double radius) const
{
  double most = 0;
  for (const Seen& seen : instances_) {
    if (!(seen.most > most)) break;
    most = max(most, seen.stretch * view_.most_pixels_a_metre(place(seen.world_from_object, middle),
                                                              seen.stretch * radius, coarser_ == Coarser::kOutside));
  }
  return most;
}

double SeenInstances::pixels_a_metre(Vec3d P) const
{
  double most = 0;
  for (const Seen& seen : instances_) {
    if (!(seen.most > kLarger * most)) break;
    const Vec3d P_world = place(seen.world_from_object, P);
    most = max(most, seen.stretch * view_.pixels_a_metre(P_world) / coarsening(P_world));
  }
  return most;
}

}  // namespace relief
