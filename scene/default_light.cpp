#include "scene/default_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <unordered_map>

#include "kernel/shape/material_lookup.h"
#include "scene/texture_store.h"

namespace relief {
namespace {

constexpr std::uint32_t kNumReceivers = 256, kNumEmitterPoints = 2048;

/// A point of a surface in the world, and how much of the surface it stands for.
struct SurfacePoint {
  Vec3f P;
  Vec3f Ng;             ///< unit, of the front
  float area = 0;       ///< m²; 0: the surface has none
  double radiance = 0;  ///< luminance that it emits
  bool double_sided = false;
};

class SurfaceSampler {
 public:
  SurfaceSampler(const Scene& scene, std::span<const TextureView> textures) : scene_(scene), textures_(textures) {}

  float uniform() { return static_cast<float>(random_() >> 8) * 0x1p-24f; }

  /// A point of a placed mesh, uniform by area but for what is said here: of eight triangles, one by its area. On the mean
  /// over many calls, `area` times a function of the point is that function's integral.
  SurfacePoint sample(const Placement& placement)
  {
    const Mesh& mesh = scene_.meshes[static_cast<std::size_t>(placement.mesh_index)];
    const Material& material = scene_.materials[static_cast<std::size_t>(placement.material_index)];
    constexpr std::size_t kCandidates = 8;
    std::array<std::uint32_t, kCandidates> candidates{};
    std::array<float, kCandidates> areas{};
    float sum = 0;
    SurfacePoint point;
    point.double_sided = material.double_sided;
    const auto num_triangles = static_cast<std::uint32_t>(mesh.triangles.size());
    if (num_triangles == 0) return point;
    for (std::size_t k = 0; k < kCandidates; ++k) {
      candidates[k] = static_cast<std::uint32_t>(random_() % num_triangles);
      areas[k] = 0.5f * length(across(placement, mesh, candidates[k]));
      sum += areas[k];
    }
    if (!(sum > 0) || !is_finite(sum)) return point;
    std::size_t chosen = 0;
    for (float left = uniform() * sum - areas[0]; left > 0 && chosen + 1 < kCandidates; left -= areas[chosen]) ++chosen;
    const float root = std::sqrt(uniform());
    const Vec2f barycentric{1 - root, uniform() * root};
    const TriangleIndices t = mesh.triangles[candidates[chosen]];
    const Vec3f P = mesh.P[t.v0] * (1 - barycentric.x - barycentric.y) + mesh.P[t.v1] * barycentric.x +
                    mesh.P[t.v2] * barycentric.y;
    point.P = transform_point(placement.world_from_object, P);
    const Vec3f normal = across(placement, mesh, candidates[chosen]);
    const Affine3& m = placement.world_from_object;
    const bool mirrors = dot(cross(m.x, m.y), m.z) < 0;
    point.Ng = length(normal) > 0 ? normalize(normal) * (mirrors ? -1.0f : 1.0f) : Vec3f{};
    point.area = sum / kCandidates * static_cast<float>(num_triangles);
    point.radiance = static_cast<double>(luminance(
        material.unlit ? Vec3f{}
                       : triangle_emission(material, textures_.data(), mesh.view(), candidates[chosen], barycentric)));
    return point;
  }

 private:
  static Vec3f across(const Placement& placement, const Mesh& mesh, std::uint32_t triangle)
  {
    const TriangleIndices t = mesh.triangles[triangle];
    return cross(transform_vector(placement.world_from_object, mesh.P[t.v1] - mesh.P[t.v0]),
                 transform_vector(placement.world_from_object, mesh.P[t.v2] - mesh.P[t.v0]));
  }

  const Scene& scene_;
  std::span<const TextureView> textures_;
  std::mt19937 random_{20};  // its numbers are the same everywhere, as a picture must be
};

const Material& material_of(const Scene& scene, const Placement& placement)
{
  return scene.materials[static_cast<std::size_t>(placement.material_index)];
}

/// Emission by area that a placed mesh has if its texture is white; the area is that of the mesh under the mean scale, which
/// is all that choosing needs.
std::vector<double> emission_weights(const Scene& scene, std::span<const Placement> placements)
{
  std::unordered_map<int, double> area_of;
  std::vector<double> weights;
  weights.reserve(placements.size());
  for (const Placement& p : placements) {
    const Material& material = material_of(scene, p);
    if (is_zero(material.emission) || material.unlit) {
      weights.push_back(0);
      continue;
    }
    const auto [area, is_new] = area_of.try_emplace(p.mesh_index, 0);
    if (is_new) {
      const Mesh& mesh = scene.meshes[static_cast<std::size_t>(p.mesh_index)];
      for (const TriangleIndices t : mesh.triangles) {
        area->second +=
            0.5 * static_cast<double>(length(cross(mesh.P[t.v1] - mesh.P[t.v0], mesh.P[t.v2] - mesh.P[t.v0])));
      }
    }
    const Affine3& m = p.world_from_object;
    const double scale = static_cast<double>(dot(m.x, m.x) + dot(m.y, m.y) + dot(m.z, m.z)) / 3;
    weights.push_back(area->second * scale * static_cast<double>(luminance(material.emission)));
  }
  return weights;
}

/// Points of emissive surfaces; the sum over them of area × f is the integral of f over all those surfaces.
std::vector<SurfacePoint> emitter_points(const Scene& scene,
                                         std::span<const Placement> placements,
                                         SurfaceSampler& sampler)
{
  const std::vector<double> weights = emission_weights(scene, placements);
  double total = 0;
  for (const double weight : weights) total += weight;
  std::vector<SurfacePoint> points;
  if (!(total > 0) || !std::isfinite(total)) return points;
  std::size_t at = 0;
  double reached = weights[0];
  for (std::uint32_t i = 0; i < kNumEmitterPoints; ++i) {
    const double target = total * (i + static_cast<double>(sampler.uniform())) / kNumEmitterPoints;
    while (reached < target && at + 1 < weights.size()) reached += weights[++at];
    if (weights[at] == 0) continue;
    SurfacePoint point = sampler.sample(placements[at]);
    point.area *= static_cast<float>(total / (weights[at] * kNumEmitterPoints));
    if (point.radiance * static_cast<double>(point.area) > 0) points.push_back(point);
  }
  return points;
}

/// Irradiance of a surface at a point, turned to the light, by π: the radiance that white has there.
double white_radiance(const SurfacePoint& point, const std::vector<SurfacePoint>& emitters)
{
  double irradiance = 0;
  for (const SurfacePoint& e : emitters) {
    const Vec3f to_point = point.P - e.P;
    const double squared = static_cast<double>(dot(to_point, to_point));
    // A point of the emitter itself: 0 / 0.
    if (!(squared > 0)) continue;
    const auto facing = [&](const SurfacePoint& of, Vec3f towards) {
      const double cosine = static_cast<double>(dot(towards, of.Ng)) / std::sqrt(squared);
      return of.double_sided ? std::fabs(cosine) : std::max(cosine, 0.0);
    };
    irradiance += e.radiance * static_cast<double>(e.area) * facing(e, to_point) / squared;
  }
  return irradiance * std::numbers::inv_pi;
}

}  // namespace

bool emission_lights_scene(const Scene& scene,
                           std::span<const Placement> placements,
                           std::span<const TextureView> textures)
{
  SurfaceSampler sampler(scene, textures);
  const std::vector<SurfacePoint> emitters = emitter_points(scene, placements, sampler);
  if (emitters.empty()) return false;
  int num_dull = 0;
  int num_lit = 0;
  double area = 0;
  double glowing_area = 0;
  for (std::uint32_t i = 0; i < kNumReceivers; ++i) {
    const double place = (i + static_cast<double>(sampler.uniform())) / kNumReceivers;
    const Placement& p = placements[static_cast<std::size_t>(place * static_cast<double>(placements.size()))];
    const SurfacePoint point = sampler.sample(p);
    if (!(point.area > 0) || material_of(scene, p).unlit) continue;
    area += static_cast<double>(point.area);
    if (point.radiance >= kGlowingRadiance) {
      glowing_area += static_cast<double>(point.area);
    } else {
      ++num_dull;
      if (white_radiance(point, emitters) >= kLitRadiance) ++num_lit;
    }
  }
  return num_lit >= kLitFraction * num_dull || glowing_area >= kGlowingFraction * area;
}

namespace {

/// What cameras see in the studio's place.
EnvironmentMap backdrop_make()
{
  // Interpolation makes the rest of it, all around the same.
  constexpr float kBelow = 0.09f, kAbove = 0.3f, kPiAngle = 3.14159265f;
  EnvironmentMap map;
  map.width = 1;
  map.height = 128;
  for (int y = 0; y < map.height; ++y) {
    const float up = std::cos((static_cast<float>(y) + 0.5f) * kPiAngle / static_cast<float>(map.height));
    const float t = clamp(0.5f + 0.7f * up, 0.0f, 1.0f);
    map.rgb.insert(map.rgb.end(), 3, kBelow + (kAbove - kBelow) * t * t * (3 - 2 * t));
  }
  return map;
}

}  // namespace

void environment_set(Scene& scene, const EnvironmentChoice& choice, bool has_backdrop, TextureStore& textures)
{
  scene.environment = Environment{};
  if (choice.source == EnvironmentSource::kNone) return;
  const EnvironmentMap map = environment_preset_make(choice.source);
  const std::string_view label = kEnvironmentPresetLabels[static_cast<std::size_t>(choice.source)];
  // Round about there is no border; at the poles there is.
  scene.environment.texture_index =
      textures.add_image(std::string(label), map.width, map.height, map.rgb, Wrap::kRepeat, Wrap::kClamp);
  scene.environment.color = splat3(choice.strength);
  const bool is_studio = choice.source == EnvironmentSource::kStudio;
  // Before a studio's walls and lamps nothing stands out.
  scene.environment.visible_to_camera = !is_studio || has_backdrop;
  if (!is_studio || !has_backdrop) return;
  const EnvironmentMap seen = backdrop_make();
  Surroundings& backdrop = scene.environment.backdrop.emplace();
  backdrop.color = splat3(1);
  backdrop.texture_index =
      textures.add_image("backdrop", seen.width, seen.height, seen.rgb, Wrap::kRepeat, Wrap::kClamp);
}

void default_light_add(Scene& scene,
                       std::span<const Placement> placements,
                       bool has_backdrop,
                       const std::function<bool()>& emission_shows,
                       TextureStore& textures,
                       Warnings& warnings)
{
  const bool reflects = std::any_of(placements.begin(), placements.end(),
                                    [&](const Placement& p) { return !material_of(scene, p).unlit; });
  const bool emits = std::any_of(placements.begin(), placements.end(), [&](const Placement& p) {
    return !is_zero(material_of(scene, p).emission) && !material_of(scene, p).unlit;
  });
  if (!reflects) return;
  if (emits && emission_lights_scene(scene, placements, textures.views()) && (!emission_shows || emission_shows())) {
    return;
  }
  warnings.add(
      scene.file +
      (emits ? ": no light, and emission that leaves most of the scene dark" : ": no light or environment") +
      ": a soft studio lights it, before a grey backdrop; --environment, --background or RELIEF_environment says "
      "otherwise");
  environment_set(scene, {}, has_backdrop, textures);
}

}  // namespace relief
