# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading node graphs: following links through reroutes, groups and muted nodes, and folding constants."""

import math
from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Source:
    """The output socket that feeds an input.

    groups  group nodes that were entered on the way, the outermost first: what a Group Input inside leads back to
    """

    node: bpy.types.Node
    socket: bpy.types.NodeSocket
    groups: tuple = ()


def active_output(tree, idname):
    """The tree's active output node of a kind; None if there is none. Outputs for another engine alone do not count."""
    outputs = [n for n in tree.nodes if n.bl_idname == idname and getattr(n, "target", "ALL") in {"ALL", "CYCLES"}]
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)


def follow(socket, groups=()):
    """What is linked to an input socket; None: nothing, so that its own value counts."""
    while socket is not None and socket.is_linked:
        link = socket.links[0]
        node, output = link.from_node, link.from_socket
        if node.mute:
            passed = next((i.from_socket for i in node.internal_links if i.to_socket == output), None)
            socket = passed
        elif node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            inner = active_output(node.node_tree, "NodeGroupOutput")
            socket = next((i for i in inner.inputs if i.identifier == output.identifier), None) if inner else None
            groups = (*groups, node)
            if socket is not None and not socket.is_linked:
                return Source(inner, socket, groups)
        elif node.bl_idname == "NodeGroupInput" and groups:
            outer = groups[-1]
            socket = next((i for i in outer.inputs if i.identifier == output.identifier), None)
            groups = groups[:-1]
            if socket is not None and not socket.is_linked:
                return Source(outer, socket, groups)
        else:
            return Source(node, output, groups)
    return None


_MATH = {
    "ADD": lambda a, b, _: a + b,
    "SUBTRACT": lambda a, b, _: a - b,
    "MULTIPLY": lambda a, b, _: a * b,
    "DIVIDE": lambda a, b, _: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, _: a**b if a > 0 else 0.0,
    "MINIMUM": lambda a, b, _: min(a, b),
    "MAXIMUM": lambda a, b, _: max(a, b),
    "SQRT": lambda a, *_: math.sqrt(max(a, 0.0)),
}


class Reader:
    """Values of input sockets where no texture is possible.

    @param  warn    called with what is not understood, and what was used instead
    @param  groups  the groups around the node whose sockets are read
    """

    def __init__(self, warn, groups=()):
        self._warn = warn
        self._groups = groups

    def number(self, socket):
        """A socket's constant number."""
        return as_number(self.constant(socket))

    def color(self, socket):
        """A socket's constant linear RGB."""
        return as_color(self.constant(socket))

    vector = color

    def constant(self, socket):
        """A socket's constant: a number or a tuple. What is linked but not constant is warned about."""
        value = fold(socket, self._groups)
        if value is None:
            node = follow(socket, self._groups).node
            value = own_value(socket)
            shown = tuple(round(v, 4) for v in value) if isinstance(value, tuple) else round(value, 4)
            self._warn(f'node "{node.name}" ({node.bl_label}) as {socket.name}', f"the value {shown} was used")
        return finite(value, socket.name, self._warn)


def finite(value, name, warn):
    """A number or a tuple with 0 for what is not finite, which is warned about."""
    is_tuple = isinstance(value, tuple)
    if all(math.isfinite(v) for v in (value if is_tuple else (value,))):
        return value
    warn(f"{name}: a value that is not finite", "0 was used")
    return tuple(v if math.isfinite(v) else 0.0 for v in value) if is_tuple else 0.0


def own_value(socket):
    """A socket's unlinked value: a number or a tuple."""
    value = getattr(socket, "default_value", 0.0)
    return tuple(value) if hasattr(value, "__len__") else float(value)


def fold(socket, groups=()):
    """Value of an input that depends on constants alone: a number or a tuple; None if it does not."""
    source = follow(socket, groups)
    if source is None:
        return own_value(socket)
    node = source.node
    if node.bl_idname in {"ShaderNodeValue", "ShaderNodeRGB"}:
        return own_value(source.socket)
    if not source.socket.is_output:  # an unlinked input of a group
        return own_value(source.socket)
    if node.bl_idname == "ShaderNodeMath" and node.operation in _MATH:
        values = [fold(i, source.groups) for i in node.inputs]
        if all(v is not None for v in values):
            numbers = [as_number(v) for v in values]
            result = _MATH[node.operation](*numbers)
            return min(max(result, 0.0), 1.0) if node.use_clamp else result
    if node.bl_idname == "ShaderNodeCombineXYZ":
        values = [fold(i, source.groups) for i in node.inputs]
        if all(isinstance(v, float) for v in values):
            return tuple(values)
    return None


def as_color(value):
    """A number or a tuple where Blender wants a colour: linear RGB."""
    return tuple(value[:3]) if isinstance(value, tuple) else (value,) * 3


def as_number(value):
    """A number or a tuple where Blender wants a number: of colours, which have four, the luminance, of vectors the mean."""
    if not isinstance(value, tuple):
        return value
    if len(value) < 4:
        return sum(value) / len(value)
    return 0.2126 * value[0] + 0.7152 * value[1] + 0.0722 * value[2]
