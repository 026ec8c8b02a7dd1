// How much of a picture a mesh fills, before anything is traced.
#pragma once

#include <span>

#include "displacement/picture_view.h"
#include "kernel/math/affine.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Which part of the picture a mesh's instances cover, about: the areas of its triangles in the picture, those seen from the front or
/// those from behind, whichever are more. Of a closed mesh that is its outline. What covers what is not looked at.
/// @param places  the world from the mesh's own space, of each instance
/// @return        0 to 1
/// @cost          some thousands of triangles, whatever there are
double picture_share(const MeshView& mesh, std::span<const Affine3> places, const PictureView& view);

/// How much of the picture the boxes of a mesh's instances would fill as near as they are, wherever they are, together at most all of it;
/// less where things may be coarser (PictureView::coarsening).
double box_share(const MeshView& mesh, std::span<const Affine3> places, const PictureView& view);

}  // namespace relief
