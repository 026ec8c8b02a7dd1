# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shaders of worlds and lights come to: a sum of colours, each times its weight."""

from . import nodes
from .not_understood import NotUnderstood

BLACK = [0.0, 0.0, 0.0]

_EMITTERS = {"ShaderNodeBackground", "ShaderNodeEmission"}


class EmissionTree:
    """A tree of Mix and Add Shaders over Emission and Background nodes.

    @param  graph  GraphWriter, which gets what varies
    @param  warn   called with what is not understood, and what was used instead
    terms          (Source of a node that emits, its weight)
    """

    def __init__(self, graph, warn):
        self.graph = graph
        self.warn = warn
        self.terms = []

    def collect(self, source):
        """Finds the terms below a shader, None: nothing."""
        self._collect(source, 1.0, ())

    def total(self):
        """Sum of the terms: three numbers, or a reference into the graph."""
        total = BLACK
        for term, weight in self.terms:
            total = self._sum(total, self._times(self._radiance(term), weight))
        return total

    def _collect(self, source, weight, above):
        """Adds the terms below a shader."""
        if source is None or source.is_value or weight == 0.0:
            return
        node, inputs = source.node, source.node.inputs
        if source.key in above:
            self.warn(f'node "{node.name}" ({node.bl_label}), which is linked in a circle', "black was used")
            return
        above = (*above, source.key)

        def below(socket, weight):
            self._collect(nodes.linked(socket, source.groups), weight, above)

        if node.bl_idname == "ShaderNodeAddShader":
            below(inputs[0], weight)
            below(inputs[1], weight)
        elif node.bl_idname == "ShaderNodeMixShader":
            factor = self.factor(inputs[0], source.groups)
            below(inputs[1], self._product(weight, self._inverse(factor)))
            below(inputs[2], self._product(weight, factor))
        elif node.bl_idname in _EMITTERS:
            self.terms.append((source, weight))
        else:
            self.warn(f'node "{node.name}" ({node.bl_label}) as surface', "black was used")

    def factor(self, socket, groups):
        """A Mix Shader's factor, from 0 to 1."""
        value = self._value(socket, groups)
        if isinstance(value, dict):
            return self.graph.op("clamp", {"value": value}, "value")
        return min(max(value, 0.0), 1.0)

    def _value(self, socket, groups):
        """An input as graphs have it; what they do not know is warned about, and the socket's own value taken."""
        try:
            return self.graph.value(socket, groups)
        except NotUnderstood as error:
            value = nodes.own_value(socket)
            if isinstance(value, tuple):
                value = [float(c) for c in value[:3]]
                self.warn(str(error), f"the value {tuple(round(c, 4) for c in value)} was used")
            else:
                self.warn(str(error), f"the value {round(value, 4)} was used")
            return value

    def _radiance(self, source):
        inputs = source.node.inputs
        strength = self._value(inputs["Strength"], source.groups)
        if strength == 0.0:
            return BLACK
        return self._times(self._value(inputs["Color"], source.groups), strength)

    def _product(self, a, b):
        """Of two numbers."""
        if not isinstance(a, dict) and not isinstance(b, dict):
            return a * b
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        if a == 0.0 or b == 0.0:
            return 0.0
        return self.graph.op("math", {"a": a, "b": b}, "value", operation="multiply")

    def _inverse(self, factor):
        if not isinstance(factor, dict):
            return 1.0 - factor
        return self.graph.op("math", {"a": 1.0, "b": factor}, "value", operation="subtract")

    def _times(self, color, weight):
        if weight == 0.0 or color == BLACK:
            return BLACK
        if weight == 1.0:
            return color
        if isinstance(color, list) and not isinstance(weight, dict):
            return [c * weight for c in color]
        return self.graph.op("vector-math", {"a": color, "scale": weight}, "vector", operation="scale")

    def _sum(self, a, b):
        if a == BLACK or b == BLACK:
            return b if a == BLACK else a
        if isinstance(a, list) and isinstance(b, list):
            return [x + y for x, y in zip(a, b)]
        return self.graph.op("vector-math", {"a": a, "b": b}, "vector", operation="add")
