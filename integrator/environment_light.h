// The environment's light as a whole.
#pragma once

#include "integrator/environment_tables.h"
#include "integrator/light_set.h"

namespace relief {

/// Irradiance of what the tables sample, by their own importance sampling: exact up to the variation within cells, so a
/// small sun in the map is not missed.
/// @param channels  as LightSet's
EnvironmentIrradiance environment_irradiance(const EnvironmentTables& tables, Vec3f channels);

/// Fills in what is known of all of the environment's light: flux density, colour and solid angle.
void environment_integrate(LightSet& set);

}  // namespace relief
