#include "displacement/level_blend.h"

namespace relief {

double blended_displacement(const DisplacedMeshView& mesh, double x, double y)
{
  return mesh.scale * (blended_height(mesh, x, y) - mesh.midlevel);
}

}  // namespace relief
