// Asks a light for what it sends to a point: at surfaces (surface_light.h) and in media (shade_medium.h).
#pragma once

#include "kernel/stage/emitter.h"

namespace relief {

/// What a chosen light sends to a point of a path.
struct LightAnswer {
  LightSample sample;              ///< pdf 0: nothing
  Vec3f radiance{};                ///< incident; of lights that do not shine evenly, from the place that was sampled
  const Light* emitter = nullptr;  ///< in world space; null: the environment
};

/// Whether anything comes from there.
RELIEF_KERNEL bool light_answers(const LightAnswer& answer)
{
  return answer.sample.pdf > 0.0f && !is_zero(answer.radiance);
}

/// Samples a light that lights_choose has chosen.
/// @param P, N     as given to lights_choose, of the LightReceiver
/// @param storage  as of lights_at; lives as long as the answer
RELIEF_KERNEL LightAnswer light_ask(const KernelGlobals& g,
                                    const PathState& state,
                                    std::uint32_t path,
                                    LightsChoice chosen,
                                    Vec3f P,
                                    Vec3f N,
                                    Light& storage)
{
  LightAnswer answer;
  if (chosen.ref.light_index >= 0) answer.emitter = &lights_at(g.lights, chosen.ref, storage, path_time(state, path));
  const LightSample& light = answer.sample = lights_sample_chosen(g.lights, chosen, answer.emitter, P, N);
  answer.radiance = light.radiance;
  // Any path may ask a textured or transparent emitter, so this is not a feature of the surface that is lit.
  if (answer.emitter != nullptr && !answer.emitter->is_even && light.pdf > 0.0f) {
    answer.radiance = emitter_radiance(
        g, *answer.emitter, light.radiance,
        {P + light.wi * light.distance, light.barycentric, -light.wi, path_light_ray(state, path, light.distance)});
  }
  return answer;
}

}  // namespace relief
