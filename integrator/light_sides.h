// Which side of glowing meshes shines on nothing but the mesh itself.
#pragma once

namespace relief {

struct SceneContext;

/// Finds the inner sides of closed meshes that glow, and those of whatever else is as good as closed, by rays: a side is one if all of 256 rays from all over
/// it end on the mesh itself, while some from the other side meet something else. Then that side is not chosen any more (Light::dark_side),
/// half of all samples or more are saved, and the tree is built anew. Paths that get there all the same, say through a gap, find its light
/// by themselves.
///
/// Left as they are: meshes that let light through, and all but the first 1,024.
/// @param context  with its lights and all that rays can hit; lights.view() is another afterwards
/// @return         same bits for the same scene, whatever the thread count
void light_sides_find(SceneContext& context);

}  // namespace relief
