#include "integrator/camera_medium.h"

#include <algorithm>
#include <numeric>

#include "integrator/instance_box.h"
#include "integrator/instance_hit.h"
#include "kernel/bsdf/surface_params.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

/// Whether a mesh of the material bounds what light gets into.
bool is_solid(const Material& m) { return m.transmission > 0.0f && (m.thickness > 0.0f || m.has_closures); }

bool absorbs(const Material& m) { return is_solid(m) && m.attenuation_distance < kInfinity; }

/// When the shutter is half done.
constexpr float kShutterCentre = 0.5f;

}  // namespace

CameraMedium::CameraMedium(const SceneContext& context) : context_(context)
{
  const Scene& scene = context.scene;
  const auto material_of = [&scene](const Instance& instance) -> const Material& {
    return scene.materials[static_cast<std::size_t>(instance.material_index)];
  };
  absorbs_ = std::any_of(scene.instances.begin(), scene.instances.end(),
                         [&](const Instance& instance) { return absorbs(material_of(instance)); });
  if (!absorbs_) return;
  solid_of_.resize(scene.instances.size(), -1);
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Material& m = material_of(scene.instances[i]);
    if (!is_solid(m)) continue;
    solid_of_[i] = static_cast<std::int32_t>(solids_.size());
    const Vec3f sigma_a = absorbs(m) ? volume_sigma_a(m.attenuation_color, m.attenuation_distance) : Vec3f{};
    solids_.push_back({instance_box(context, i), sigma_a, i});
  }
}

/// The solid around a point whose surface comes first along some ray.
/// @param wanted  −1: any; otherwise only this one is asked for
/// @return        −1: none
std::int32_t CameraMedium::innermost_at(Vec3f P, float time, std::int32_t wanted) const
{
  // Along no axis, on which things are built: there edges are met.
  constexpr Vec3f kDirection{0.36851f, 0.81479f, 0.44771f};
  // Of what is entered on the way as much has to be left; a surface that is left besides is one around P.
  std::vector<int> entered(solids_.size(), 0);
  float from = kLeastDistance;
  constexpr int kMostHits = 1 << 16;
  for (int i = 0; i < kMostHits; ++i) {
    const std::optional<InstanceHit> hit = instance_hit_next(context_, P, kDirection, time, from, kInfinity, kRayBounce);
    if (!hit) break;
    from = t_min_behind(hit->t);
    const std::int32_t solid = hit->instance < solid_of_.size() ? solid_of_[hit->instance] : -1;
    if (solid < 0 || (wanted >= 0 && solid != wanted)) continue;
    int& count = entered[static_cast<std::size_t>(solid)];
    if (dot(kDirection, hit->Ng) < 0.0f) {
      ++count;
    } else if (count-- == 0) {
      return solid;
    }
  }
  return -1;
}

/// Whether some corner of a solid is within another.
bool CameraMedium::stands_in(const Solid& solid, std::int32_t other) const
{
  constexpr std::size_t kCorners = 16;
  const InstanceView& instance = context_.instances[solid.instance];
  const MeshView& mesh = context_.meshes[static_cast<std::size_t>(instance.mesh_index)];
  const std::span<const Vec3f> corners(mesh.P, mesh.num_vertices);
  const std::size_t step = std::max<std::size_t>(1, corners.size() / kCorners);
  const Box3& box = solids_[static_cast<std::size_t>(other)].box;
  for (std::size_t i = 0; i < corners.size(); i += step) {
    const Vec3f P = transform_point(instance.world_from_object, corners[i]);
    if (boxes_overlap(box, {P, P}) && innermost_at(P, kShutterCentre, other) == other) return true;
  }
  return false;
}

std::vector<std::string> CameraMedium::overlaps() const
{
  std::vector<std::size_t> order(solids_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [this](std::size_t a, std::size_t b) { return solids_[a].box.low.x < solids_[b].box.low.x; });
  std::vector<std::string> out;
  constexpr std::size_t kMostNamed = 10;
  for (std::size_t i = 0; i < order.size() && out.size() < kMostNamed; ++i) {
    const Solid& a = solids_[order[i]];
    for (std::size_t k = i + 1; k < order.size() && solids_[order[k]].box.low.x <= a.box.high.x; ++k) {
      const Solid& b = solids_[order[k]];
      if (out.size() >= kMostNamed) break;
      if ((is_zero(a.sigma_a) && is_zero(b.sigma_a)) || !boxes_overlap(a.box, b.box)) continue;
      if (!stands_in(a, static_cast<std::int32_t>(order[k])) && !stands_in(b, static_cast<std::int32_t>(order[i])))
        continue;
      const auto name = [this](const Solid& solid) {
        return '"' + context_.scene.instances[solid.instance].name + '"';
      };
      out.push_back(name(a) + " and " + name(b) +
                    " stand in each other, and light is absorbed in there: it counts where light has come through the "
                    "surface of what absorbs last");
    }
  }
  return out;
}

void CameraMedium::apply(PathState& state, std::uint32_t count) const
{
  Vec3f before_O, sigma_a;
  float before_time = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vec3f O = path_origin(state, i) + path_direction(state, i) * state.t_min[i];
    const float time = path_time(state, i);
    if (i == 0 || O != before_O || time != before_time) {
      const bool may_be_within = std::any_of(solids_.begin(), solids_.end(), [O](const Solid& solid) {
        return boxes_overlap(solid.box, {O, O});
      });
      const std::int32_t solid = may_be_within ? innermost_at(O, time, -1) : -1;
      sigma_a = solid >= 0 ? solids_[static_cast<std::size_t>(solid)].sigma_a : Vec3f{};
    }
    before_O = O;
    before_time = time;
    state.sigma_a[i] = sigma_a;
  }
}

}  // namespace relief
