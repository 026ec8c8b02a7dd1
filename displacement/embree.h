// The one place that knows which Embree is installed: 3.13 (Debian 12) or 4. Everything else calls these wrappers.
#pragma once

#include <cstdint>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#elif __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#error "Embree 3.13 or 4 is needed"
#endif

#include "displacement/vec3d.h"

namespace relief {

struct LodCone;
struct PrismVisits;
struct TraversalCounters;

/// A ray inside an instance, where Embree has it rounded to floats: t of the world = t_start + t_scale · t.
struct ObjectRay {
  Vec3d O, D;  ///< object space; moved to the instance, see far_ray.h
  double t_start = 0, t_scale = 1;
};

/// Where a ray of the world starts that was moved near.
struct FarStart {
  bool is_far = false;  ///< whether it was moved
  Vec3d O;              ///< Embree has it rounded
  double t = 0;         ///< how far it was moved
};

/// Of a scene whose hits a query may filter, see embree_context_filter.
#if RTC_VERSION_MAJOR >= 4
inline constexpr RTCSceneFlags kSceneTakesFilter = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
#else
inline constexpr RTCSceneFlags kSceneTakesFilter = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
#endif

/// What a query hands to callbacks: Embree's own context first, so that a callback can cast back. Every query of a scene
/// with displaced geometry uses one of these.
struct EmbreeContext {
#if RTC_VERSION_MAJOR >= 4
  RTCRayQueryContext rtc;
  RTCFilterFunctionN filter = nullptr;  ///< see embree_context_filter
#else
  RTCIntersectContext rtc;
#endif
  TraversalCounters* displacement = nullptr;  ///< where displaced geometry counts; null: nowhere
  std::uint32_t* steps = nullptr;  ///< bounds and texels a ray, added to the entry of its id; null: not wanted
  const LodCone* cones = nullptr;  ///< by the rays' ids; null: the finest detail
  const float* texels = nullptr;   ///< widths of finest texels by instance, metres, world; null: those of object space
  PrismVisits* visits = nullptr;   ///< record of the prisms that are visited (explain.h); null: not wanted
  FarStart far_start;              ///< of the ray that is traced
  const ObjectRay* object_ray = nullptr;  ///< of the ray that is traced, inside an instance; null: outside of any
};

/// @param coherent  rays come in order from one origin or direction
inline void embree_context_init(EmbreeContext& context, [[maybe_unused]] bool coherent)
{
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&context.rtc);
#else
  rtcInitIntersectContext(&context.rtc);
  context.rtc.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
#endif
}

/// Makes searches for the nearest hit of one ray ask of each hit whether it counts. User geometry does not ask.
inline void embree_context_filter(EmbreeContext& context, RTCFilterFunctionN filter)
{
#if RTC_VERSION_MAJOR >= 4
  context.filter = filter;
#else
  context.rtc.filter = filter;
#endif
}

inline void embree_intersect1(RTCScene scene, EmbreeContext& context, RTCRayHit& ray)
{
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context.rtc;
  if (context.filter != nullptr) {
    arguments.filter = context.filter;
    arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
  }
  rtcIntersect1(scene, &ray, &arguments);
#else
  rtcIntersect1(scene, &context.rtc, &ray);
#endif
}

inline void embree_intersect8(const int* valid, RTCScene scene, EmbreeContext& context, RTCRayHit8& rays)
{
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  arguments.context = &context.rtc;
  rtcIntersect8(valid, scene, &rays, &arguments);
#else
  rtcIntersect8(valid, scene, &context.rtc, &rays);
#endif
}

inline void embree_occluded1(RTCScene scene, EmbreeContext& context, RTCRay& ray)
{
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context.rtc;
  rtcOccluded1(scene, &ray, &arguments);
#else
  rtcOccluded1(scene, &context.rtc, &ray);
#endif
}

}  // namespace relief
