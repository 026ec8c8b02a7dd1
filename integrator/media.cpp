#include "integrator/media.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "integrator/instance_box.h"
#include "integrator/instance_hit.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

/// Whether what an instance bounds does no more than to darken what is seen through its surface. Openings are in sight there, and such
/// meshes are often sewn from parts that meet up to rounding alone.
bool is_absorbing_glass(const Scene& scene, const Instance& instance)
{
  const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
  const auto medium = static_cast<std::size_t>(material.medium_index);
  const bool varies = medium < scene.varying_media.size() && !scene.varying_media[medium].closures.empty();
  return !material.is_boundary && !varies && scene.media[medium].num_phases == 0 &&
         is_zero(scene.media[medium].emission);
}

}  // namespace

Media::Media(const SceneContext& context) : context_(context), exist_(!context.media.empty())
{
  for (std::size_t i = 0; i < context.scene.num_placed(); ++i) {
    const auto material = static_cast<std::size_t>(context.scene.instances[i].material_index);
    if (context.scene.materials[material].medium_index < 0) continue;
    filled_.push_back({instance_box(context, i), static_cast<std::int32_t>(i)});
  }
}

std::vector<std::string> Media::problems() const
{
  std::vector<std::string> out;
  std::map<int, std::string> told;  // by mesh
  constexpr std::size_t kMostNamed = 10;
  for (const Filled& filled : filled_) {
    const Instance& instance = context_.scene.instances[static_cast<std::size_t>(filled.instance)];
    if (is_absorbing_glass(context_.scene, instance)) continue;
    if (!told.try_emplace(instance.mesh_index).second || out.size() >= kMostNamed) continue;
    const Mesh& mesh = context_.scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
    // By places, not by numbers: what is sharp or unwrapped has vertices twice.
    std::vector<std::tuple<float, float, float>> places;
    for (const Vec3f P : mesh.P) places.emplace_back(P.x, P.y, P.z);
    std::sort(places.begin(), places.end());
    const auto number = [&](std::uint32_t v) {
      const Vec3f P = mesh.P[v];
      return std::lower_bound(places.begin(), places.end(), std::tuple(P.x, P.y, P.z)) - places.begin();
    };
    std::vector<std::pair<std::ptrdiff_t, std::ptrdiff_t>> edges;
    double volume = 0;
    for (const TriangleIndices& tri : mesh.triangles) {
      const std::ptrdiff_t a = number(tri.v0), b = number(tri.v1), c = number(tri.v2);
      for (const auto& edge : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) edges.push_back(edge);
      volume += static_cast<double>(dot(mesh.P[tri.v0], cross(mesh.P[tri.v1], mesh.P[tri.v2])));
    }
    std::sort(edges.begin(), edges.end());
    const bool is_open = std::any_of(edges.begin(), edges.end(), [&](const auto& edge) {
      return edge.first != edge.second &&
             !std::binary_search(edges.begin(), edges.end(), std::pair(edge.second, edge.first));
    });
    const std::string who = '"' + instance.name + "\" bounds a medium and is ";
    if (is_open) {
      out.push_back(who + "not closed: where a ray gets in or out beside it the medium begins or ends elsewhere");
    } else if (volume < 0) {
      out.push_back(who + "inside out: rays do not get into it");
    }
  }
  return out;
}

bool Media::has_medium(unsigned instance) const
{
  if (instance >= context_.scene.instances.size()) return false;
  const auto material = static_cast<std::size_t>(context_.scene.instances[instance].material_index);
  return context_.scene.materials[material].medium_index >= 0;
}

/// The media around a point.
void Media::find(Vec3f P, float time, MediumState& out) const
{
  out.size = 0;
  if (context_.globals.world_medium >= 0) out.inside[out.size++] = kWholeWorld;
  const bool may_be_within = std::any_of(filled_.begin(), filled_.end(), [P](const Filled& filled) {
    return boxes_overlap(filled.box, {P, P});
  });
  if (!may_be_within) return;
  // Along no axis, on which things are built: there edges are met.
  constexpr Vec3f kDirection{0.36851f, 0.81479f, 0.44771f};
  // Of what is entered on the way as much has to be left; a surface that is left besides is one around P.
  std::map<unsigned, int> entered;
  float from = kLeastDistance;
  constexpr int kMostHits = 1 << 16;
  for (int i = 0; i < kMostHits; ++i) {
    const std::optional<InstanceHit> hit =
        instance_hit_next(context_, P, kDirection, time, from, kInfinity, kRayCamera);
    if (!hit) break;
    from = t_min_behind(hit->t);
    if (!has_medium(hit->instance)) continue;
    int& count = entered[hit->instance];
    if (dot(kDirection, hit->Ng) < 0.0f) {
      ++count;
    } else if (count-- == 0) {
      medium_cross(out, static_cast<std::int32_t>(hit->instance), true);
    }
  }
}

/// Goes from a point to another.
void Media::follow(Vec3f P, Vec3f D, float to, float time, MediumState& out) const
{
  for (float from = 0; from < to;) {
    const std::optional<InstanceHit> hit = instance_hit_next(context_, P, D, time, from, to, kRayCamera);
    if (!hit) break;
    from = t_min_behind(hit->t);
    if (has_medium(hit->instance)) {
      medium_cross(out, static_cast<std::int32_t>(hit->instance), dot(D, hit->Ng) < 0.0f);
    }
  }
}

void Media::start(PathState& state, const QueueView& paths) const
{
  Vec3f before_O;
  MediumState inside{};
  float before_time = 0;
  for (std::uint32_t k = 0; k < paths.size; ++k) {
    const std::uint32_t i = paths.paths[k];
    const Vec3f O = path_origin(state, i);
    const float time = path_time(state, i);
    if (k == 0 || O != before_O || time != before_time) find(O, time, inside);
    before_O = O;
    before_time = time;
    inside.hit_inside = kWholeWorld;
    state.media[i] = inside;
    if (!filled_.empty()) follow(O, path_direction(state, i), state.t_min[i], time, state.media[i]);
  }
}

Vec3f shadow_transmittance(const KernelGlobals& g,
                           MediumState inside,
                           std::vector<ShadowBoundary>& boundaries,
                           const ShadowWay& way)
{
  std::sort(boundaries.begin(), boundaries.end(), [](const ShadowBoundary& a, const ShadowBoundary& b) {
    return std::tuple(a.t, a.instance, a.triangle) < std::tuple(b.t, b.instance, b.triangle);
  });
  Vec3f passes{1, 1, 1};
  float from = 0;
  for (const ShadowBoundary& boundary : boundaries) {
    passes *= g.shadow_transmittance(g, inside, way, from, boundary.t);
    if (is_zero(passes)) return passes;
    from = boundary.t;
    medium_cross(inside, boundary.instance, boundary.is_front);
  }
  if (!(way.t_max < kInfinity)) medium_leave_all(inside);
  return passes * g.shadow_transmittance(g, inside, way, from, way.t_max);
}

}  // namespace relief
