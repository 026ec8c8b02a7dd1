# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading node graphs: following links through reroutes, groups and muted nodes, and folding constants."""

import contextlib
import math
import re
import sys
import threading
from dataclasses import dataclass

import bpy

from .. import compat
from . import color_space


@dataclass(frozen=True)
class Source:
    """The output socket that feeds an input.

    groups  group nodes that were entered on the way, the outermost first: what a Group Input inside leads back to
    """

    node: bpy.types.Node
    socket: bpy.types.NodeSocket
    groups: tuple = ()

    @property
    def key(self):
        """What tells the node from others, and from itself in another use of its group."""
        return (self.node.as_pointer(), *(group.as_pointer() for group in self.groups))

    @property
    def is_value(self):
        """Whether it is only an unlinked input of a group, with a value of its own."""
        return not self.socket.is_output


def active_output(tree, idname):
    """The tree's active output node of a kind; None if there is none. Outputs for another engine alone do not count."""
    outputs = [n for n in tree.nodes if n.bl_idname == idname and getattr(n, "target", "ALL") in {"ALL", "CYCLES"}]
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)


#: Frames of Python that a material may take: a node takes up to six.
_DEEPEST = 30000

_tables = None
_inlined = None

#: Nodes of shader trees that are read as they stand, though their names do not begin as those of shaders do.
_READ_AS_THEY_STAND = {"NodeFrame", "NodeReroute", "NodeGroupInput", "NodeGroupOutput", "GeometryNodeInputSceneTime"}

#: Held while trees are read: a preview or the viewport may be exported while a picture is.
_one_reader = threading.RLock()


@contextlib.contextmanager
def reading():
    """While no tree changes: links are looked up in tables, where Blender goes through all of a tree, long chains are
    followed to their end, and trees that tree_of makes stay."""
    global _tables, _inlined
    with _one_reader:
        before, deepest = (_tables, _inlined), sys.getrecursionlimit()
        _tables, _inlined = {}, {}
        if sys.version_info >= (3, 11):  # before, each frame takes of the thread's stack
            sys.setrecursionlimit(max(deepest, _DEEPEST))
        try:
            yield
        finally:
            _tables, _inlined = before
            sys.setrecursionlimit(deepest)


def tree_of(owner):
    """The nodes of a material, world or light as Cycles is given them; within `reading` alone.

    Since 5.0 trees may repeat parts of themselves, choose between them by menus, and hand them around in bundles and
    closures. Blender makes a plain tree of such a one, in which names begin with numbers: see original_name.
    """
    if not _is_inlined(owner):
        return owner.node_tree
    key = owner.as_pointer()
    if key not in _inlined:
        _inlined[key] = owner.inline_shader_nodes()  # which owns the tree
    return _inlined[key].node_tree


def _is_inlined(owner):
    return hasattr(owner, "inline_shader_nodes") and _has_to_be_inlined(owner.node_tree, set())


def _has_to_be_inlined(tree, seen):
    if tree is None or tree.as_pointer() in seen:
        return False
    seen.add(tree.as_pointer())
    for node in tree.nodes:
        if not node.bl_idname.startswith("ShaderNode") and node.bl_idname not in _READ_AS_THEY_STAND:
            return True
        if node.bl_idname == "ShaderNodeGroup" and _has_to_be_inlined(node.node_tree, seen):
            return True
    return False


def original_names(owner, text):
    """A text about nodes of tree_of, or one's name, with the names that they have in the owner's own tree."""
    if owner is None or not _is_inlined(owner):
        return text
    return re.sub(r'(^|node ")\d+_', r"\1", text)


def _link(socket):
    """The link to an input that has one."""
    if _tables is None:
        return socket.links[0]
    tree = socket.id_data
    table = _tables.get(tree.as_pointer())
    if table is None:
        table = {link.to_socket.as_pointer(): link for link in tree.links}
        _tables[tree.as_pointer()] = table
    return table[socket.as_pointer()]


def follow(socket, groups=()):
    """What is linked to an input socket; None: nothing, so that its own value counts."""
    while socket is not None and socket.is_linked:
        link = _link(socket)
        if not link.is_valid or link.is_muted or not link.from_socket.enabled:
            return None
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


def linked(socket, groups=()):
    """What is linked to an input that means something else where nothing is: a normal, texture coordinates.

    @return  Source; None: nothing, an unlinked input of a group counting as such
    """
    source = follow(socket, groups)
    return None if source is None or source.is_value else source


def has_plain_mapping(node):
    """Whether a texture node's own mapping, which the user interface shows no longer, changes nothing."""
    mapping = getattr(node, "texture_mapping", None)
    if mapping is None:
        return True
    is_moved = any(mapping.translation) or any(mapping.rotation) or tuple(mapping.scale) != (1.0, 1.0, 1.0)
    axes = (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z)
    return not is_moved and axes == ("X", "Y", "Z") and not mapping.use_min and not mapping.use_max


def is_used(output):
    """Whether an output socket leads, through whichever nodes, to where a tree ends."""
    seen, waiting = set(), [output]
    while waiting:
        for link in waiting.pop().links:
            node = link.to_node
            if not node.outputs:
                return True
            if node.as_pointer() not in seen:
                seen.add(node.as_pointer())
                waiting.extend(node.outputs)
    return False


def _power(base, exponent):
    """What is no number, Blender takes for 0; what is too large, for infinite."""
    if base == 0 and exponent < 0 and compat.NEGATIVE_POWERS_OF_0_ARE_0:
        return 0.0
    try:
        result = base**exponent
    except (OverflowError, ZeroDivisionError):
        return math.inf
    return 0.0 if isinstance(result, complex) else result


_MATH = {
    "ADD": lambda a, b, _: a + b,
    "SUBTRACT": lambda a, b, _: a - b,
    "MULTIPLY": lambda a, b, _: a * b,
    "DIVIDE": lambda a, b, _: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, _: _power(a, b),
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


def fold(socket, groups=(), known=None):
    """Value of an input that depends on constants alone: a number or a tuple; None if it does not.

    @param  known  values of nodes from calls before, which is added to; without, each call finds out anew
    """
    source = follow(socket, groups)
    if source is None:
        return own_value(socket)
    if source.is_value or source.node.bl_idname in {"ShaderNodeValue", "ShaderNodeRGB"}:
        return own_value(source.socket)
    build = _FOLDS.get(source.node.bl_idname)
    if build is None:
        return None
    known = {} if known is None else known
    key = (source.key, source.socket.identifier)
    if key not in known:
        known[key] = None  # what depends on itself is no constant
        try:
            known[key] = build(source, lambda i: fold(i, source.groups, known))
        except RecursionError:
            pass
    return known[key]


def _fold_math(source, value):
    node = source.node
    if node.operation not in _MATH:
        return None
    values = [value(socket) for socket in node.inputs]
    if None in values:
        return None
    result = _MATH[node.operation](*(as_number(v) for v in values))
    return min(max(result, 0.0), 1.0) if node.use_clamp else result


def _fold_combine(source, value):
    values = [value(socket) for socket in source.node.inputs]
    if None in values or getattr(source.node, "mode", "RGB") != "RGB":
        return None
    parts = tuple(as_number(v) for v in values)
    return parts if source.node.bl_idname == "ShaderNodeCombineXYZ" else (*parts, 1.0)


def _fold_separate(source, value):
    node, whole = source.node, value(source.node.inputs[0])
    if whole is None or getattr(node, "mode", "RGB") != "RGB":
        return None
    index = next(i for i, socket in enumerate(node.outputs) if socket == source.socket)
    return as_color(whole)[index]


def _fold_clamp(source, value):
    values = [value(socket) for socket in source.node.inputs]
    if None in values or source.node.clamp_type != "MINMAX":
        return None
    number, low, high = (as_number(v) for v in values)
    return min(max(number, low), high)


def _fold_mix(source, value):
    node = source.node
    is_old = node.bl_idname == "ShaderNodeMixRGB"
    kind = "RGBA" if is_old else node.data_type
    if kind == "RGBA" and node.blend_type != "MIX" or kind == "VECTOR" and node.factor_mode != "UNIFORM":
        return None
    values = [value(socket) for socket in node.inputs if socket.enabled]
    if None in values or len(values) != 3:
        return None
    factor = as_number(values[0])
    if is_old or node.clamp_factor:
        factor = min(max(factor, 0.0), 1.0)
    if kind == "FLOAT":
        return (1 - factor) * as_number(values[1]) + factor * as_number(values[2])
    mixed = tuple((1 - factor) * a + factor * b for a, b in zip(as_color(values[1]), as_color(values[2])))
    if kind == "RGBA" and (node.use_clamp if is_old else node.clamp_result):
        mixed = tuple(min(max(c, 0.0), 1.0) for c in mixed)
    return (*mixed, 1.0) if kind == "RGBA" else mixed


def _fold_light_falloff(source, value):
    """Falloff with the square of the distance is that of light itself."""
    strength, smooth = value(source.node.inputs["Strength"]), value(source.node.inputs["Smooth"])
    return strength if source.socket.identifier == "Quadratic" and smooth == 0 else None


def _fold_normal(source, value):
    if source.socket.name != "Normal":
        return None
    direction = own_value(source.socket)
    length = math.sqrt(sum(x * x for x in direction))
    return tuple(x / length for x in direction) if length else direction


_FOLDS = {
    "ShaderNodeLightFalloff": _fold_light_falloff,
    "ShaderNodeNormal": _fold_normal,
    "ShaderNodeMath": _fold_math,
    "ShaderNodeCombineXYZ": _fold_combine,
    "ShaderNodeCombineColor": _fold_combine,
    "ShaderNodeCombineRGB": _fold_combine,
    "ShaderNodeSeparateXYZ": _fold_separate,
    "ShaderNodeSeparateColor": _fold_separate,
    "ShaderNodeSeparateRGB": _fold_separate,
    "ShaderNodeClamp": _fold_clamp,
    "ShaderNodeMix": _fold_mix,
    "ShaderNodeMixRGB": _fold_mix,
}


def as_color(value):
    """A number or a tuple where Blender wants a colour: linear RGB."""
    return tuple(value[:3]) if isinstance(value, tuple) else (value,) * 3


def as_number(value):
    """A number or a tuple where Blender wants a number: of colours, which have four, the luminance, of vectors the mean."""
    if not isinstance(value, tuple):
        return value
    if len(value) < 4:
        return sum(value) / len(value)
    return sum(w * v for w, v in zip(color_space.luminance_weights(), value))
