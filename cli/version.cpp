#include "cli/version.h"

#include "integrator/isa.h"

namespace relief {

std::string version_text()
{
  return "relief " RELIEF_VERSION "\ncommit " + std::string(kCommit) + "\ninstruction sets: " + isa_description() +
         "\nlibraries: " RELIEF_LIBRARIES;
}

}  // namespace relief
