// Sums, products and turns of the values of a graph that is being built.
#pragma once

#include <string_view>

#include "scene/graph/graph_builder.h"

namespace relief {

/// Where the axes of a vector that displaces lie.
enum class VectorSpace : std::uint8_t { kTangent, kObject, kWorld };
inline constexpr std::string_view kVectorSpaceLabels[] = {"tangent", "object", "world"};

/// Applies an operation to each component.
GraphVector each(GraphBuilder& b, GraphOp op, const GraphVector& x, const GraphVector& y);
GraphVector splat(GraphScalar a);
GraphScalar scaled(GraphBuilder& b, GraphScalar a, float by);
GraphScalar dot(GraphBuilder& b, const GraphVector& x, const GraphVector& y);
GraphScalar clamped(GraphBuilder& b, GraphScalar a, float low = 0, float high = 1);
GraphVector clamped(GraphBuilder& b, const GraphVector& v);
/// (1 − t) a + t b.
GraphScalar mixed(GraphBuilder& b, GraphScalar t, GraphScalar x, GraphScalar y);
GraphVector mixed(GraphBuilder& b, GraphScalar t, const GraphVector& x, const GraphVector& y);
/// A vector of unit length; one without length stays.
GraphVector normalized(GraphBuilder& b, const GraphVector& v);
GraphVector cross(GraphBuilder& b, const GraphVector& x, const GraphVector& y);
GraphVector colors(GraphBuilder& b, GraphOp op, const GraphVector& v);
GraphVector quantities(GraphBuilder& b, GraphQuantity x, GraphQuantity y, GraphQuantity z);
/// A vector by a matrix of the point.
/// @param is_point  whether the matrix's last column is added
GraphVector transformed(GraphBuilder& b, GraphQuantity matrix, const GraphVector& v, bool is_point);
/// v turned by Euler's angles, about x first, then y, then z.
GraphVector rotated(GraphBuilder& b, const GraphVector& v, const GraphVector& angles, bool back);
/// A vector in the space of the mesh: x along the tangent, y along the normal and z along the bitangent, or of the world.
/// @param tangent     of the mesh, as its attribute has it; not read in other spaces, like the next
/// @param handedness  likewise
GraphVector vector_in_object(GraphBuilder& b,
                             VectorSpace space,
                             const GraphVector& v,
                             const GraphVector& tangent,
                             GraphScalar handedness);
GraphScalar sum3(GraphBuilder& b, GraphScalar x, GraphScalar y, GraphScalar z);

}  // namespace relief
