// Tangent frames for normal maps, for meshes that come without.
#pragma once

#include "scene/scene.h"

namespace relief {

/// Fills `mesh.tangent` from a set of texture coordinates: the triangles' ∂P/∂u, projected into each vertex's tangent
/// plane and averaged with the corner angle as weight, over vertices of equal position, normal and uv. Triangles with
/// mirrored uv are averaged apart; a vertex both kinds share is split. w follows glTF: bitangent = w · N × T points
/// against v, which runs down the image.
/// @param uv_set  0 or 1
/// @pre   mesh.uv[uv_set] is not empty; vertex normals, if there are any, are unit
/// @post  without normals (flat shading) no two triangles share a vertex
/// @source conventions of MikkTSpace (Mikkelsen 2008), without its merging of vertices that differ in normal or uv
void tangents_derive(Mesh& mesh, int uv_set);

}  // namespace relief
