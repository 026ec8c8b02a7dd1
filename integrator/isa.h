// What of the stages was built for which processors; stages.h has the tables themselves.
#pragma once

#include <string>

namespace relief {

/// Instruction sets that the stages were built for, and what this machine runs of them.
std::string isa_description();

}  // namespace relief
