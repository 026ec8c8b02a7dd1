// Room for the walls between parts of an object that are displaced differently, or not all of them. What the walls are like depends
// on how the parts are traced (displacement/border_strips.h); here they are edges without any area.
#pragma once

namespace relief {

struct Scene;

/// Adds a border's mesh for every two meshes of an object that have edges in common by position, of which one is displaced at least
/// and its material welds seams; and an instance of it wherever the two are.
/// @param scene  everything is placed, world_displacement_bake included
/// @cost  a sort of the vertices of such objects with several materials; nothing for others
void border_walls_add(Scene& scene);

}  // namespace relief
