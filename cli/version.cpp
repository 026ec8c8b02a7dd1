#include "cli/version.h"

#include "integrator/isa.h"
#include "scene/image_io.h"

namespace relief {

std::string version_text()
{
  // The module that needs it may have been left out, or not be installed.
  const char* image_library =
      image_io_is_there() && *RELIEF_IMAGE_LIBRARY != '\0' ? ", " RELIEF_IMAGE_LIBRARY : ", without OpenImageIO";
  return "relief " RELIEF_VERSION "\ncommit " + std::string(kCommit) + "\ninstruction sets: " + isa_description() +
         "\nlibraries: " RELIEF_LIBRARIES + image_library;
}

}  // namespace relief
