# SPDX-License-Identifier: GPL-3.0-or-later
"""What is linked to a material's Displacement as a graph: Displacement nodes, and what adds, scales and mixes them.

Where all of them go along the surface's normal it is one height (AlongNormal), else a vector (InObject).
"""

from . import nodes
from .graph import clamped, displaced_in_object, to_object
from .not_understood import NotUnderstood

#: Ours by Blender's.
SPACES = {"OBJECT": "object", "WORLD": "world"}


def is_along_normal(source):
    """Whether it is a Displacement node that moves points along the surface's own normal."""
    node = source.node
    return node.bl_idname == "ShaderNodeDisplacement" and nodes.linked(node.inputs["Normal"], source.groups) is None


class _Moves:
    """Writes what nodes make of displacements. What kind of thing these are is the heirs': they give one of a node that is not
    linear in others (`leaf`), of three numbers (`constant`), sums and multiples.

    graph  GraphWriter
    """

    def __init__(self, graph):
        self.graph = graph
        self._known = {}

    def output(self, source):
        """What a nodes.Source moves points by.

        @error  NotUnderstood
        """
        node = source.node
        key = (*source.key, source.socket.identifier)
        if key not in self._known:
            # Stays only if the node depends on itself.
            self._known[key] = NotUnderstood(f'node "{node.name}" ({node.bl_label}), which is linked in a circle')
            try:
                write = _LINEAR.get(node.bl_idname)
                found = write(self, node, source.groups) if write else None
                self._known[key] = self.leaf(source) if found is None else found
            except NotUnderstood as error:
                self._known[key] = error
        found = self._known[key]
        if isinstance(found, NotUnderstood):
            raise found
        return found

    def term(self, socket, groups):
        """An input that is a displacement."""
        constant = nodes.fold(socket, groups)
        if constant is not None:
            return self.constant(socket, nodes.as_color(constant))
        return self.output(nodes.follow(socket, groups))

    def factor(self, socket, groups):
        """An input that multiplies all components by the same number; None: it does not."""
        constant = nodes.fold(socket, groups)
        if constant is not None:
            components = nodes.as_color(constant)
            return components[0] if min(components) == max(components) else None
        source = nodes.follow(socket, groups)
        return self.graph.output(source) if source.socket.type in {"VALUE", "INT", "BOOLEAN"} else None


class AlongNormal(_Moves):
    """Heights in metres: numbers, or references to numbers.

    spaces  "object" or "world", of the nodes met so far
    """

    def __init__(self, graph):
        super().__init__(graph)
        self.spaces = set()

    def leaf(self, source):
        node, g = source.node, self.graph
        if not is_along_normal(source):
            raise NotUnderstood(f'node "{node.name}" ({node.bl_label}), which does not go along the normal')
        self.spaces.add(SPACES[node.space])
        height, midlevel, scale = (g.value(node.inputs[name], source.groups) for name in ("Height", "Midlevel", "Scale"))
        return self.multiple(self.sum(height, self.multiple(midlevel, -1.0)), scale)

    def constant(self, socket, vector):
        if any(vector):
            raise NotUnderstood(f'{socket.name} of node "{socket.node.name}", which does not go along the normal')
        return 0.0

    def sum(self, a, b):
        if not isinstance(a, dict) and not isinstance(b, dict):
            return a + b
        if a == 0 or b == 0:
            return b if a == 0 else a
        return self.graph.op("math", {"a": a, "b": b}, "value", operation="add")

    def multiple(self, a, factor):
        if not isinstance(a, dict) and not isinstance(factor, dict):
            return a * factor
        if a == 1 or factor == 1:
            return factor if a == 1 else a
        if a == 0 or factor == 0:
            return 0.0
        return self.graph.op("math", {"a": a, "b": factor}, "value", operation="multiply")


class InObject(_Moves):
    """References to vectors in object space."""

    def leaf(self, source):
        if source.node.bl_idname in {"ShaderNodeDisplacement", "ShaderNodeVectorDisplacement"}:
            return displaced_in_object(self.graph, source.node, source.groups)
        return to_object(self.graph, self.graph.output(source))

    def constant(self, socket, vector):
        if not any(vector):
            return self.graph.op("combine", {"x": 0.0}, "vector")
        return to_object(self.graph, list(vector))

    def sum(self, a, b):
        return self.graph.op("vector-math", {"a": a, "b": b}, "vector", operation="add")

    def multiple(self, a, factor):
        return a if factor == 1 else self.graph.op("vector-math", {"a": a, "scale": factor}, "vector", operation="scale")


def _linear_vector_math(moves, node, groups):
    a, b, c = node.inputs[:3]
    if node.operation in {"ADD", "SUBTRACT"}:
        second = moves.term(b, groups)
        return moves.sum(moves.term(a, groups), second if node.operation == "ADD" else moves.multiple(second, -1.0))
    if node.operation == "SCALE":
        return moves.multiple(moves.term(a, groups), moves.graph.value(node.inputs["Scale"], groups))
    if node.operation not in {"MULTIPLY", "MULTIPLY_ADD"}:
        return None
    factor, moved = moves.factor(b, groups), a
    if factor is None:
        factor, moved = moves.factor(a, groups), b
    if factor is None:
        return None
    product = moves.multiple(moves.term(moved, groups), factor)
    return product if node.operation == "MULTIPLY" else moves.sum(product, moves.term(c, groups))


def _linear_mix(moves, node, groups):
    is_old = node.bl_idname == "ShaderNodeMixRGB"
    kind = "RGBA" if is_old else node.data_type
    if kind == "RGBA" and (node.blend_type != "MIX" or (node.use_clamp if is_old else node.clamp_result)):
        return None
    if kind not in {"RGBA", "VECTOR"} or kind == "VECTOR" and node.factor_mode != "UNIFORM":
        return None
    share, a, b = (socket for socket in node.inputs if socket.enabled)
    share = moves.graph.value(share, groups)
    if is_old or node.clamp_factor:
        share = clamped(moves.graph, share)
    first = moves.term(a, groups)
    return moves.sum(first, moves.multiple(moves.sum(moves.term(b, groups), moves.multiple(first, -1.0)), share))


#: Nodes whose output is linear in the displacements that go in: called with what writes these, give one; None: not as they are set.
_LINEAR = {
    "ShaderNodeVectorMath": _linear_vector_math,
    "ShaderNodeMix": _linear_mix,
    "ShaderNodeMixRGB": _linear_mix,
}
