// Search for all roots of S(p, q) = O + tD on a prepared surface.
#pragma once

#include <vector>

#include "tests/oracle/prepared_surface.h"

namespace relief::oracle {

/// @return  as Surface::intersect_all
std::vector<Hit> roots_find(const PreparedSurface& surface, const Ray& ray);

}  // namespace relief::oracle
