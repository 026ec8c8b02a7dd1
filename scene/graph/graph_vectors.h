// Sums, products and turns of the values of a graph that is being built.
#pragma once

#include "scene/graph/graph_builder.h"

namespace relief {

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
/// v turned by Euler's angles, about x first, then y, then z.
GraphVector rotated(GraphBuilder& b, const GraphVector& v, const GraphVector& angles, bool back);
GraphScalar sum3(GraphBuilder& b, GraphScalar x, GraphScalar y, GraphScalar z);

}  // namespace relief
