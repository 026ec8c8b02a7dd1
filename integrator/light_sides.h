// Which side of glowing meshes shines on nothing but the mesh itself.
#pragma once

namespace relief {

struct SceneContext;

/// Finds the inner sides of closed meshes that glow, and of tubes that are open at their ends, by rays from all over each side: 256 of
/// which all, or 240, end on the mesh itself, while some from the other side meet something else (Light::dark_side). Then the tree is
/// built anew. What is dark in it is not chosen any more: paths that get there all the same find its light by themselves. What is nearly
/// dark is chosen as a part of what lights there, since the little that gets out would be noise.
///
/// Left as they are: meshes that let light through, and all but the first 1,024.
/// @param context  with its lights and all that rays can hit; lights.view() is another afterwards
/// @return         same bits for the same scene, whatever the thread count
void light_sides_find(SceneContext& context);

}  // namespace relief
