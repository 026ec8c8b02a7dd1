#include "scene/graph/graph_vectors.h"

namespace relief {

using Op = GraphOp;

GraphVector each(GraphBuilder& b, Op op, const GraphVector& x, const GraphVector& y)
{
  return {b(op, {x[0], y[0]}), b(op, {x[1], y[1]}), b(op, {x[2], y[2]})};
}

GraphVector splat(GraphScalar a) { return {a, a, a}; }

GraphScalar scaled(GraphBuilder& b, GraphScalar a, float by) { return b(Op::multiply, {a, b.constant(by)}); }

GraphScalar dot(GraphBuilder& b, const GraphVector& x, const GraphVector& y)
{
  const GraphVector p = each(b, Op::multiply, x, y);
  return b(Op::add, {b(Op::add, {p[0], p[1]}), p[2]});
}

GraphScalar clamped(GraphBuilder& b, GraphScalar a, float low, float high)
{
  return b(Op::minimum, {b(Op::maximum, {a, b.constant(low)}), b.constant(high)});
}

GraphVector clamped(GraphBuilder& b, const GraphVector& v)
{
  return {clamped(b, v[0]), clamped(b, v[1]), clamped(b, v[2])};
}

GraphScalar mixed(GraphBuilder& b, GraphScalar t, GraphScalar x, GraphScalar y)
{
  const GraphScalar rest = b(Op::subtract, {b.constant(1), t});
  return b(Op::add, {b(Op::multiply, {rest, x}), b(Op::multiply, {t, y})});
}

GraphVector mixed(GraphBuilder& b, GraphScalar t, const GraphVector& x, const GraphVector& y)
{
  return {mixed(b, t, x[0], y[0]), mixed(b, t, x[1], y[1]), mixed(b, t, x[2], y[2])};
}

GraphVector normalized(GraphBuilder& b, const GraphVector& v)
{
  const GraphScalar length = b(Op::square_root, {dot(b, v, v)});
  return each(b, Op::divide, v, splat(length));
}

GraphVector cross(GraphBuilder& b, const GraphVector& x, const GraphVector& y)
{
  const auto minor = [&](int i, int j) {
    const auto n = [](int k) { return static_cast<std::size_t>(k); };
    return b(Op::subtract, {b(Op::multiply, {x[n(i)], y[n(j)]}), b(Op::multiply, {x[n(j)], y[n(i)]})});
  };
  return {minor(1, 2), minor(2, 0), minor(0, 1)};
}

GraphVector colors(GraphBuilder& b, Op op, const GraphVector& v)
{
  const std::vector<GraphScalar> out = b.apply(op, v);
  return {out[0], out[1], out[2]};
}

GraphVector quantities(GraphBuilder& b, GraphQuantity x, GraphQuantity y, GraphQuantity z)
{
  return {b.quantity(x), b.quantity(y), b.quantity(z)};
}

GraphVector transformed(GraphBuilder& b, GraphQuantity matrix, const GraphVector& v, bool is_point)
{
  GraphVector out;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto element = [&](std::size_t c) { return b.quantity(matrix, static_cast<std::uint16_t>(4 * row + c)); };
    out[row] = dot(b, {element(0), element(1), element(2)}, v);
    if (is_point) out[row] = b(Op::add, {out[row], element(3)});
  }
  return out;
}

GraphVector vector_in_object(GraphBuilder& b,
                             VectorSpace space,
                             const GraphVector& v,
                             const GraphVector& tangent,
                             GraphScalar handedness)
{
  if (space == VectorSpace::kObject) return v;
  if (space == VectorSpace::kWorld) return transformed(b, GraphQuantity::object_from_world, v, false);
  const GraphVector normal = normalized(
      b, quantities(b, GraphQuantity::vertex_normal_x, GraphQuantity::vertex_normal_y, GraphQuantity::vertex_normal_z));
  const GraphVector across = each(b, Op::multiply, normalized(b, cross(b, normal, tangent)), splat(handedness));
  const auto along = [&](const GraphVector& axis, GraphScalar by) { return each(b, Op::multiply, axis, splat(by)); };
  return each(b, Op::add, each(b, Op::add, along(tangent, v[0]), along(normal, v[1])), along(across, v[2]));
}

GraphVector rotated(GraphBuilder& b, const GraphVector& v, const GraphVector& angles, bool back)
{
  const auto turn = [&](GraphVector w, std::size_t axis) {
    const std::size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    const GraphScalar c = b(Op::cosine, {angles[axis]}), s = b(Op::sine, {angles[axis]});
    const GraphScalar ci = b(Op::multiply, {c, w[i]}), sj = b(Op::multiply, {s, w[j]});
    const GraphScalar cj = b(Op::multiply, {c, w[j]}), si = b(Op::multiply, {s, w[i]});
    w[i] = b(back ? Op::add : Op::subtract, {ci, sj});
    w[j] = b(back ? Op::subtract : Op::add, {cj, si});
    return w;
  };
  return back ? turn(turn(turn(v, 2), 1), 0) : turn(turn(turn(v, 0), 1), 2);
}

GraphScalar sum3(GraphBuilder& b, GraphScalar x, GraphScalar y, GraphScalar z)
{
  return b(Op::add, {b(Op::add, {x, y}), z});
}

}  // namespace relief
