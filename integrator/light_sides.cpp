#include "integrator/light_sides.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "integrator/instance_hit.h"
#include "integrator/light_tree_build.h"
#include "integrator/scene_context.h"
#include "kernel/sample/sobol.h"
#include "kernel/sample/warp.h"

namespace relief {
namespace {

constexpr std::uint32_t kSideRays = 256;
constexpr std::uint32_t kNearlyAll = 240;
constexpr std::size_t kMostPieces = 1024;

/// Lights of one emissive mesh, and the instances that have them.
struct Piece {
  std::size_t first_light = 0;
  std::vector<std::size_t> instances;
};

std::vector<Piece> pieces_of(const SceneContext& context)
{
  std::vector<Piece> pieces;
  std::vector<std::int32_t> known(context.lights.lights.size(), -1);
  for (std::size_t i = 0; i < context.scene.num_placed(); ++i) {
    const std::int32_t first = context.lights.first_light_index[i];
    if (first < 0) continue;
    const Instance& instance = context.scene.instances[i];
    const Material& material = context.scene.materials[static_cast<std::size_t>(instance.material_index)];
    if (!material.double_sided || material.alpha_mode != AlphaMode::kOpaque || material.transmission > 0.0f) continue;
    std::int32_t& piece = known[static_cast<std::size_t>(first)];
    if (piece < 0) {
      if (pieces.size() == kMostPieces) continue;
      piece = static_cast<std::int32_t>(pieces.size());
      pieces.push_back({static_cast<std::size_t>(first), {}});
    }
    pieces[static_cast<std::size_t>(piece)].instances.push_back(i);
  }
  return pieces;
}

/// By area, of lights that may be chosen.
std::vector<double> areas_summed(std::span<const Light> lights)
{
  std::vector<double> sums;
  double sum = 0;
  for (const Light& light : lights)
    sums.push_back(sum += is_zero(light.emission) ? 0.0 : static_cast<double>(light.area));
  return sums;
}

/// What a ray that leaves a mesh meets first.
enum class Met : std::uint8_t { kNothing, kItself, kOther };

/// @param side  +1: front, −1: back
/// @param sums  areas_summed
Met ray_meets(const SceneContext& context,
              const Piece& piece,
              std::span<const Light> lights,
              std::span<const double> sums,
              float side,
              std::uint32_t ray_index)
{
  const std::uint32_t hash = sample_pixel_hash(0x51de5, static_cast<int>(piece.first_light), side > 0.0f ? 1 : 0);
  const auto number = [&](std::uint32_t dimension) { return sample_2d(hash, ray_index, dimension); };
  const Vec2f which = number(0), place = number(1);
  const double target = static_cast<double>(which.x) * sums.back();
  const auto chosen = static_cast<std::size_t>(std::upper_bound(sums.begin(), sums.end(), target) - sums.begin());
  const Light& light = lights[std::min(chosen, lights.size() - 1)];
  const bool is_triangle = light.kind == LightKind::kTriangle;
  const Vec2f at = is_triangle ? warp_triangle(place) : Vec2f{2.0f * place.x - 1.0f, 2.0f * place.y - 1.0f};
  Vec3f P = light.P + at.x * light.edge_u + at.y * light.edge_v;
  Vec3f N = light.axis * side;
  float size = std::sqrt(light.area);
  const auto user = std::min(static_cast<std::size_t>(which.y * static_cast<float>(piece.instances.size())),
                             piece.instances.size() - 1);
  const std::size_t instance = piece.instances[user];
  if (const std::int32_t copy_index = context.lights.light_copy_index[instance]; copy_index >= 0) {
    const LightCopy& copy = context.lights.copies[static_cast<std::size_t>(copy_index)];
    P = transform_point(copy.world_from_object, P);
    N = transform_vector(copy.world_from_object, N) / copy.scale;
    size *= copy.scale;
  }
  // Off the triangle itself. What would be hidden by something nearer than this counts as seen.
  constexpr float kOff = 1e-3f, kRounding = 4e-6f;
  const Vec3f O = P + N * (kOff * size + kRounding * max_component(abs(P)));
  const Vec3f D = from_local(frame_from_normal(N), warp_cosine_hemisphere(number(2)));
  const std::optional<InstanceHit> met = instance_hit_next(context, O, D, 0.5f, 0.0f, kInfinity, kRayShadow);
  if (!met) return Met::kNothing;
  return met->instance == instance ? Met::kItself : Met::kOther;
}

/// Of the rays that leave a side.
struct SideRays {
  std::uint32_t on_itself = 0;  ///< end on the mesh
  bool any_other = false;       ///< meets something else
};

/// @param side  +1: front, −1: back
/// @return      of as many rays as it takes to see that it is not nearly dark
SideRays side_rays(const SceneContext& context,
                   const Piece& piece,
                   std::span<const Light> lights,
                   std::span<const double> sums,
                   float side)
{
  SideRays seen;
  for (std::uint32_t i = 0; i < kSideRays; ++i) {
    const Met met = ray_meets(context, piece, lights, sums, side, i);
    seen.on_itself += met == Met::kItself ? 1 : 0;
    seen.any_other |= met == Met::kOther;
    if (seen.any_other && i + 1 - seen.on_itself > kSideRays - kNearlyAll) break;
  }
  return seen;
}

/// @return  as Light::dark_side
std::int8_t dark_side_of(const SceneContext& context, const Piece& piece, std::span<const Light> lights)
{
  const std::vector<double> sums = areas_summed(lights);
  if (!(sums.back() > 0.0) || !std::isfinite(sums.back())) return 0;
  const SideRays front = side_rays(context, piece, lights, sums, 1.0f);
  const SideRays back = side_rays(context, piece, lights, sums, -1.0f);
  const auto darkness = [](const SideRays& side) {
    return side.on_itself == kSideRays ? 2 : side.on_itself >= kNearlyAll ? 1 : 0;
  };
  const int of_front = darkness(front), of_back = darkness(back);
  if (of_back > of_front && front.any_other) return static_cast<std::int8_t>(-of_back);
  if (of_front > of_back && back.any_other) return static_cast<std::int8_t>(of_front);
  return 0;
}

}  // namespace

void light_sides_find(SceneContext& context)
{
  LightSet& set = context.lights;
  const std::vector<Piece> pieces = pieces_of(context);
  std::atomic<bool> found = false;
  tbb::parallel_for(std::size_t{0}, pieces.size(), [&](std::size_t i) {
    const Piece& piece = pieces[i];
    const Mesh& mesh =
        context.scene.meshes[static_cast<std::size_t>(context.scene.instances[piece.instances[0]].mesh_index)];
    const std::span<Light> lights = std::span(set.lights).subspan(piece.first_light, mesh.triangles.size());
    const std::int8_t dark = dark_side_of(context, piece, lights);
    if (dark == 0) return;
    for (Light& light : lights) light.dark_side = dark;
    found = true;
  });
  if (found) light_tree_build(set);
}

}  // namespace relief
