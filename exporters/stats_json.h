// The `--stats` file: what a render reports about itself, as JSON for people and programs.
#pragma once

#include <string>

#include "kernel/statistics.h"

namespace relief {

/// The statistics as one indented JSON object, newline at the end. Keys are the field names; rays are given by kind and as a
/// rate; numbers that are not finite become null, since JSON has no other word for them.
std::string stats_json(const Statistics& statistics);

}  // namespace relief
