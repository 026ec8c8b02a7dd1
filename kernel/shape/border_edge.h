// Where two meshes meet that have one place: parts of one thing with materials of their own.
#pragma once

#include <cstdint>

namespace relief {

/// An edge that two meshes have by position.
struct BorderEdge {
  std::uint32_t edges[2] = {0, 0};  ///< of either mesh, 3 · triangle + k: from the triangle's vertex k to the next
  bool same_way = false;            ///< both run the same way; neighbours that face the same side do not
};

}  // namespace relief
