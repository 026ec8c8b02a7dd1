#include "integrator/emissive_meshes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "integrator/emitter_graph.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/texture/texture.h"
#include "scene/material_traits.h"
#include "scene/world_displacement.h"

namespace relief {
namespace {

/// Mean of an emission texture over a triangle, as a scalar.
/// @param emission  factor that the texture multiplies: channels that do not emit do not count
/// @cost            ten look-ups, each with the footprint of a tenth of the triangle
float mean_emission_scale(const TextureView& texture,
                          const TextureRef& ref,
                          const MeshView& mesh,
                          std::uint32_t triangle,
                          Vec3f emission)
{
  const Vec2f* uv = mesh.uv[ref.uv_set];
  const TriangleIndices tri = mesh.triangles[triangle];
  const Vec2f zero{};
  const Vec2f t0 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v0] : zero);
  const Vec2f t1 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v1] : zero);
  const Vec2f t2 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v2] : zero);
  const Vec2f d1 = t1 - t0, d2 = t2 - t0;
  const float uv_area = 0.5f * std::abs(difference_of_products(d1.x, d2.y, d1.y, d2.x));
  // Points of a regular lattice of three a side; with footprints that overlap, no texel of the triangle is left out.
  constexpr int kSide = 3;
  const float width = std::sqrt(uv_area / (0.5f * kSide * kSide)) * 1.5f;
  Vec3f sum{};
  int count = 0;
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; i + j <= kSide; ++j) {
      const float b1 = (static_cast<float>(i) + 1.0f / 3.0f) / (kSide + 1.0f);
      const float b2 = (static_cast<float>(j) + 1.0f / 3.0f) / (kSide + 1.0f);
      sum += abs(xyz(texture_sample(texture, t0 + b1 * d1 + b2 * d2, width)));
      ++count;
    }
  }
  const float mean = light_scalar(emission * sum) / (static_cast<float>(count) * light_scalar(emission));
  return is_finite(mean) ? mean : 1.0f;
}

Light triangle_light(const Affine3& placed, const MeshView& mesh, std::uint32_t triangle, bool two_sided)
{
  Light light;
  light.kind = LightKind::kTriangle;
  light.two_sided = two_sided;
  const TriangleIndices tri = mesh.triangles[triangle];
  light.P = transform_point(placed, mesh.P[tri.v0]);
  light.edge_u = transform_vector(placed, mesh.P[tri.v1] - mesh.P[tri.v0]);
  light.edge_v = transform_vector(placed, mesh.P[tri.v2] - mesh.P[tri.v0]);
  const Vec3f normal = cross(light.edge_u, light.edge_v);
  const float double_area = length(normal);
  if (double_area > 0.0f && is_finite(double_area)) {
    light.area = 0.5f * double_area;
    light.axis = normal * ((determinant(placed) < 0.0f ? -1.0f : 1.0f) / double_area);
  }
  light.triangle_index = static_cast<std::int32_t>(triangle);
  return light;
}

/// Makes one light of two triangles that are a rectangle, as those of most lamps made of meshes are: one choice less, and
/// its samples are spread over all of it.
/// @param lights  of a mesh that emits evenly, one a triangle, from index `first` on; pairs are looked for in their order
void rectangles_join(std::span<Light> lights, std::int32_t first)
{
  for (std::size_t t = 0; t + 1 < lights.size(); ++t) {
    const std::array<Vec3f, 3> a{lights[t].P, lights[t].P + lights[t].edge_u, lights[t].P + lights[t].edge_v};
    const Light& second = lights[t + 1];
    const std::array<Vec3f, 3> b{second.P, second.P + second.edge_u, second.P + second.edge_v};
    const bool has_areas = lights[t].area > 0.0f && second.area > 0.0f;
    if (!has_areas || !(dot(lights[t].axis, second.axis) > 0.0f)) continue;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3f P = a[corner], u = a[(corner + 1) % 3] - P, v = a[(corner + 2) % 3] - P;
      const Vec3f opposite = P + u + v;
      const float size_squared = length_squared(u) + length_squared(v);
      // Rounding of world coordinates, and as much of a skew as sampling takes for none (rectangle.h).
      const float near = 1e-5f * __builtin_sqrtf(size_squared);
      const auto is_vertex = [&](Vec3f Q) {
        return std::any_of(b.begin(), b.end(), [&](Vec3f q) { return length_squared(q - Q) <= sqr(near); });
      };
      const bool is_right = sqr(dot(u, v)) <= 1e-9f * length_squared(u) * length_squared(v);
      if (!is_right || !is_vertex(opposite) || !is_vertex(P + u) || !is_vertex(P + v)) continue;
      Light& light = lights[t];
      light.kind = LightKind::kRectangle;
      light.P = P + 0.5f * (u + v);
      light.edge_u = 0.5f * u;
      light.edge_v = 0.5f * v;
      light.area = light.area + second.area;
      Light& part = lights[t + 1];
      part.emission = {};
      part.whole_index = first + static_cast<std::int32_t>(t);
      ++t;
      break;
    }
  }
}

/// Instances whose emissive triangles become one piece of LightSet::lights.
struct EmissiveMesh {
  std::vector<std::size_t> instances;
  std::size_t first_light = 0;
};

/// The emissive instances of a scene, those together that will share their lights; in the order of the first of each.
std::vector<EmissiveMesh> emissive_meshes(const Scene& scene, LightSet& set)
{
  const auto triangles = [&](const Instance& instance) {
    return scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size();
  };
  std::vector<std::size_t> emissive;
  // Walls between displaced parts are found by paths alone.
  for (std::size_t i = 0; i < scene.num_placed(); ++i) {
    const Instance& instance = scene.instances[i];
    if (triangles(instance) == 0 ||
        !material_is_light(scene.materials[static_cast<std::size_t>(instance.material_index)]))
      continue;
    // What moves is left to paths: there is no light where it is at their time. So are curves.
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
    if (instance.motion_index >= 0 || !mesh.steps.empty() || !mesh.radius.empty()) continue;
    emissive.push_back(i);
    set.num_emissive_triangles += triangles(instance);
  }
  const bool may_share = set.num_emissive_triangles > static_cast<std::size_t>(kLightTreeWidth);
  std::vector<EmissiveMesh> meshes;
  std::map<std::tuple<int, int, std::uint32_t>, std::size_t> known;
  for (const std::size_t i : emissive) {
    const Instance& instance = scene.instances[i];
    float scale = 0;
    if (may_share && is_similarity(instance.world_from_object, &scale)) {
      const auto [place, is_new] =
          known.try_emplace({instance.mesh_index, instance.material_index,
                             instance.flags & (kNoCausticLight | kHiddenFrom | kShadowCatcher | kLightGroup)},
                            meshes.size());
      if (!is_new) {
        meshes[place->second].instances.push_back(i);
        continue;
      }
    }
    meshes.push_back({{i}});
  }
  return meshes;
}

}  // namespace

void emissive_meshes_add(const Scene& scene,
                         std::span<const TextureView> textures,
                         const KernelGlobals* globals,
                         LightSet& set)
{
  std::vector<EmissiveMesh> meshes = emissive_meshes(scene, set);
  std::size_t num_lights = set.lights.size();
  for (EmissiveMesh& emissive : meshes) {
    emissive.first_light = num_lights;
    const Instance& instance = scene.instances[emissive.instances[0]];
    num_lights += scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size();
  }
  set.lights.resize(num_lights);
  set.first_light_index.assign(scene.instances.size(), -1);
  set.light_copy_index.assign(scene.instances.size(), -1);
  set.emission_scales.assign(num_lights, 1.0f);
  for (const EmissiveMesh& emissive : meshes) {
    const std::size_t i = emissive.instances[0];
    const Instance& instance = scene.instances[i];
    const bool is_shared = emissive.instances.size() > 1;
    const Affine3 placed = is_shared ? Affine3{} : instance.world_from_object;
    const MeshView mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)].view();
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    const TextureRef& ref = material.emission_texture;
    const TextureView* texture =
        ref.texture_index >= 0 ? &textures[static_cast<std::size_t>(ref.texture_index)] : nullptr;
    std::vector<Vec3f> means;
    bool asks_for_path = false;
    if (material.emission_index >= 0 && globals != nullptr) {
      asks_for_path = emitter_graph_asks_for_path(globals->graphs[material.emission_index]);
      means.resize(mesh.num_triangles);
      emitter_graph_means(*globals, i, means);
    }
    tbb::parallel_for(std::uint32_t{0}, mesh.num_triangles, [&](std::uint32_t triangle) {
      Light light = triangle_light(placed, mesh, triangle, material.double_sided);
      light.emission = means.empty() ? material.emission : means[triangle];
      light.is_even = emission_is_even(material);
      // Photons do not start where no point was seen to shine: paths find that light.
      const bool is_dark = !means.empty() && is_zero(means[triangle]);
      light.hidden_from = static_cast<std::uint8_t>((instance.flags & kHiddenFrom) >> kHiddenFromShift);
      light.casts_caustics =
          (instance.flags & kNoCausticLight) == 0 && light.hidden_from == 0 && !is_dark && !asks_for_path;
      light.light_group = static_cast<std::uint8_t>((instance.flags & kLightGroup) >> kLightGroupShift);
      light.in_footage = (instance.flags & kShadowCatcher) != 0;
      light.instance_index = static_cast<std::int32_t>(i);
      set.lights[emissive.first_light + triangle] = light;
      if (texture != nullptr && means.empty()) {
        set.emission_scales[emissive.first_light + triangle] =
            mean_emission_scale(*texture, ref, mesh, triangle, material.emission);
      }
    });
    const auto first = static_cast<std::int32_t>(emissive.first_light);
    if (emission_is_even(material)) {
      rectangles_join(std::span(set.lights).subspan(emissive.first_light, mesh.num_triangles), first);
    }
    for (const std::size_t user : emissive.instances) set.first_light_index[user] = first;
    if (!is_shared) continue;
    set.shared.push_back({static_cast<std::uint32_t>(emissive.first_light), mesh.num_triangles,
                          static_cast<std::uint32_t>(set.copies.size()),
                          static_cast<std::uint32_t>(emissive.instances.size())});
    for (const std::size_t user : emissive.instances) {
      LightCopy copy;
      copy.world_from_object = scene.instances[user].world_from_object;
      copy.object_from_world = inverse(copy.world_from_object);
      is_similarity(copy.world_from_object, &copy.scale);
      copy.instance_index = static_cast<std::int32_t>(user);
      set.light_copy_index[user] = static_cast<std::int32_t>(set.copies.size());
      set.copies.push_back(copy);
    }
  }
}

}  // namespace relief
