#include "scene/gltf_motion.h"

#include <algorithm>
#include <cmath>

#include "scene/world_displacement.h"

namespace relief {
namespace {

bool is_equal(const Affine3& a, const Affine3& b) { return a.x == b.x && a.y == b.y && a.z == b.z && a.p == b.p; }

}  // namespace

ShutterNodes::ShutterNodes(DocumentSet& documents,
                           const GltfDocument& root,
                           const Shutter& shutter,
                           double frame,
                           double frames_per_second)
{
  Warnings unheard;  // the load has the same
  for (int step = 0; step <= shutter.steps; ++step) {
    const double at = shutter.frame_at(frame, static_cast<double>(step) / shutter.steps);
    std::size_t visit = 0;
    composition_traverse(documents, root, at / frames_per_second, unheard, [&](const PlacedNode& node) {
      const std::size_t number = visit++;
      if (!node.animated) return;
      memory_.add(sizeof(Transform), root.file + ": motion of nodes");
      worlds_[number].push_back(node.world);
      if (!node.weights.empty()) weights_[number].push_back(node.weights);
    });
  }
  // What an animation lets stand needs no time.
  std::erase_if(weights_, [](const auto& entry) {
    return std::all_of(entry.second.begin(), entry.second.end(),
                       [&](const std::vector<double>& weights) { return weights == entry.second.front(); });
  });
  std::erase_if(worlds_, [](const auto& entry) {
    const Affine3 first = transform_to_affine(entry.second.front());
    return std::all_of(entry.second.begin(), entry.second.end(),
                       [&](const Transform& world) { return is_equal(transform_to_affine(world), first); });
  });
}

std::vector<Affine3> ShutterNodes::steps(std::size_t visit, const Transform& copy) const
{
  const auto found = worlds_.find(visit);
  std::vector<Affine3> out;
  if (found == worlds_.end()) return out;
  for (const Transform& world : found->second) out.push_back(transform_to_affine(world * copy));
  return out;
}

std::vector<std::vector<double>> ShutterNodes::weights(std::size_t visit) const
{
  const auto found = weights_.find(visit);
  return found == weights_.end() ? std::vector<std::vector<double>>{} : found->second;
}

std::string motion_defect(const std::vector<Affine3>& steps)
{
  const bool mirrors = determinant(steps.front()) < 0;
  for (const Affine3& m : steps) {
    const auto column = [](Vec3f v) {
      return Vec3d{static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
    };
    switch (transform_defect({column(m.x), column(m.y), column(m.z), column(m.p)})) {
      case TransformDefect::kSingular:
        return "a singular transform";
      case TransformDefect::kNotFinite:
        return "a transform beyond single precision";
      case TransformDefect::kNone:
        break;
    }
    if ((determinant(m) < 0) != mirrors) return "a transform that mirrors at some of the steps";
  }
  return "";
}

std::vector<Affine3> light_motion(const std::vector<Affine3>& steps, const Affine3& placed, Vec3f P)
{
  std::vector<Affine3> out;
  const Affine3 back = inverse(placed);
  for (const Affine3& step : steps) {
    Affine3 moved = step * back;
    moved.p = transform_point(moved, P);
    float scale = 0;
    constexpr float kTolerance = 1e-4f;
    if (!is_similarity(moved, &scale) || !(std::fabs(scale - 1) <= kTolerance) || determinant(moved) < 0) return {};
    out.push_back(moved);
  }
  return out;
}

}  // namespace relief
