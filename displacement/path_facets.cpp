#include "displacement/path_facets.h"

#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

Vec3f normal_to_object(const InstanceView& instance, Vec3f n)
{
  return normalize(transform_normal(instance.world_from_object, as_normal(n)));
}

/// Lets a path meet one of the facets around its hit, as seen from where it comes.
/// @return  false if no facet is seen from there
bool meet_facet(PathState& state,
                std::uint32_t path,
                const InstanceView& instance,
                const LevelFacets& facets,
                float choice)
{
  FacetState& f = state.facets[path];
  if (!facet_choose(facets, -f.side * path_direction(state, path), choice, &f.normal)) return false;
  state.hit_Ng[path] = state.hit_Ns[path] = normal_to_object(instance, f.normal);
  return true;
}

Vec2f facet_sample(const PathState& state, std::uint32_t path, FacetDimension use)
{
  return sample_2d(state.pixel_hash[path], state.sample_index[path], dimension_facet(path_surface(state, path), use));
}

/// Facets around the place that a path has hit.
/// @param Ng  of the level, object space
bool facets_at_hit(const DisplacementSet& displacements,
                   const PathState& state,
                   std::uint32_t path,
                   const InstanceView& instance,
                   Vec3f Ng,
                   LevelFacets* facets)
{
  return displacements.facets(state.hit_object[path],
                              {instance, state.hit_triangle[path], state.hit_u[path], state.hit_v[path],
                               state.facets[path].level, state.hit_P[path], Ng, path_time(state, path)},
                              facet_sample(state, path, FacetDimension::kJitter), facets);
}

}  // namespace

void path_enter_facets(const DisplacementSet& displacements,
                       PathState& state,
                       std::uint32_t path,
                       const InstanceView& instance,
                       float level)
{
  FacetState& f = state.facets[path];
  f.height = 0.0f;
  if (!(level > 0.0f)) return;
  f.level = level;
  LevelFacets facets;
  if (!facets_at_hit(displacements, state, path, instance, state.hit_Ng[path], &facets)) return;
  f.moments = facet_moments(facets);
  const Vec3f wo = -path_direction(state, path);
  f.side = dot(wo, facets.normal) < 0.0f ? -1.0f : 1.0f;
  const Vec2f choice = facet_sample(state, path, FacetDimension::kChoice);
  if (!meet_facet(state, path, instance, facets, choice.x)) return;
  f.height = facet_height(facet_lambda(f.moments, f.side * wo), choice.y);
}

bool path_stays_among_facets(const KernelGlobals& g,
                             const DisplacementSet& displacements,
                             PathState& state,
                             std::uint32_t path)
{
  FacetState& f = state.facets[path];
  const Vec3f wi = path_direction(state, path);
  // A ray that has passed through a surface goes on from there.
  if (state.t_min[path] != kLeastDistance || !is_over_facets(f, wi)) return false;
  const float lambda = facet_lambda(f.moments, f.side * wi);
  const float u = sample_1d(state.pixel_hash[path], state.sample_index[path],
                            dimension_facet(path_surface(state, path), FacetDimension::kLeave));
  if (u < facets_leave_chance(f.height, lambda)) return false;
  const InstanceView& instance = path_instance(g, state, path);
  LevelFacets facets;
  const Vec2f choice = facet_sample(state, path, FacetDimension::kChoice);
  if (!facets_at_hit(displacements, state, path, instance, normal_to_object(instance, f.moments.mean), &facets) ||
      !meet_facet(state, path, instance, facets, choice.x)) {
    return false;
  }
  f.height = facet_next_height(f.height, lambda, u);
  state.hit_t[path] = 0.0f;
  // No photon is kept that came from a facet beside.
  std::uint32_t& flags = state.flags[path];
  if ((flags & (kPathPhoton | kPathAfterSoft)) == kPathAfterSoft) flags = path_flags_left_to_paths(flags);
  return true;
}

}  // namespace relief
