#include "cli/error_text.h"

#include <new>

#include "scene/diagnostics.h"
#include "scene/memory.h"

namespace relief {

bool is_of_memory(const std::exception& error)
{
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) return true;
  // What is wrong with a scene is told in our own words; a library may mean memory.
  return dynamic_cast<const SceneError*>(&error) == nullptr && is_out_of_memory(error.what());
}

std::string error_text(const std::exception& error)
{
  if (!is_of_memory(error)) return error.what();
  const bool says_nothing =
      dynamic_cast<const std::bad_alloc*>(&error) != nullptr && dynamic_cast<const OutOfMemory*>(&error) == nullptr;
  return says_nothing ? "out of memory" : std::string("out of memory: ") + error.what();
}

}  // namespace relief
