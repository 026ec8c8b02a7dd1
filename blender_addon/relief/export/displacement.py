# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Displacement node as RELIEF_displacement.

Both move a point along the interpolated normal by scale · (height − midlevel), measured in object or world space, so
the values are taken as they are. A height of value · texture + offset is folded into scale and midlevel; any other one is
a graph, and so are sums and mixes of such displacements. What does not go along the normal is a graph that gives a vector.
The program evaluates those that vary with texture coordinates
alone into a map, others at points.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from .. import compat
from . import nodes
from .displacement_graph import SPACES, AlongNormal, InObject, is_along_normal
from .not_understood import NotUnderstood


def has_displacement_node(material):
    """Whether a material's output has something linked to its Displacement."""
    if not material.use_nodes or material.node_tree is None:
        return False
    output = nodes.active_output(material.node_tree, "ShaderNodeOutputMaterial")
    return output is not None and nodes.follow(output.inputs["Displacement"]) is not None


def needs_switch(material):
    """Whether a material has a Displacement node, but its setting makes it bump alone."""
    return has_displacement_node(material) and compat.displacement_method(material) == "BUMP"


@dataclass(frozen=True)
class _Move:
    """How far points move: scale · (height − midlevel), in a space; or by a vector.

    node    whose Height it is, in its groups; None: `height` or `vector` is
    height  a number or a reference
    vector  a reference
    """

    node: object
    groups: tuple
    scale: float
    midlevel: float
    space: str
    height: object = None
    vector: object = None


def bump_displaces(material, settings):
    """Whether a Bump node of a material is to move its surface: the artist wants it, and nothing else moves it."""
    return settings.bump_displaces and not has_displacement_node(material)


def export_displacement(material, settings, textures, texture_info, images, graph, coordinates):
    """Value of RELIEF_displacement.

    @param  material        bpy material with nodes
    @param  settings        scene.relief: method, level of detail and seams of all materials
    @param  textures        TextureReader, which has read the surface
    @param  texture_info    makes glTF's texture reference of a Texture used as numbers; None if its image is missing
    @param  images          ImageExporter
    @param  graph           GraphWriter, still empty, of a height that is none
    @param  coordinates     what the sets of texture coordinates are, ("uv", name) and so on, by number
    @return                 None if nothing moves
    """
    move = _move_of_bump(textures) if textures.bump else _move_of_output(material, settings, textures, graph)
    if move is None or move.scale == 0:
        return None
    height = move.height
    if move.vector is not None:
        return {
            "vectorGraph": {"nodes": graph.nodes, "outputs": {"vector": move.vector}},
            "cellPixels": settings.cell_pixels,
            **_how(material, move, settings),
        }
    if move.node is not None:
        height = textures.image(move.node.inputs["Height"], move.groups)
        if height is None:
            node = move.node
            try:
                height = graph.value(node.inputs["Height"], move.groups)
            except NotUnderstood as error:
                textures.warn(f'node "{node.name}" ({node.bl_label}): its height ({error})', "nothing is displaced")
                return None
    if isinstance(height, dict):
        value = {
            "heightGraph": _height_graph(material, height, graph, coordinates),
            "scale": move.scale,
            "midlevel": move.midlevel,
            **_how(material, move, settings),
        }
        if _only_set(graph) is None:
            value["cellPixels"] = settings.cell_pixels
        return value
    if isinstance(height, float):
        return _constant(height, move, images)
    # scale · (value · h + offset − midlevel) = (scale · value) · (h − (midlevel − offset) / value)
    if height.texture is None:
        return _constant(height.value, move, images)
    info = texture_info(height.texture)
    if info is None or height.value == 0:
        return None
    value = {
        "heightTexture": info,
        "scale": move.scale * height.value,
        "midlevel": (move.midlevel - height.offset) / height.value,
        **_how(material, move, settings),
    }
    if compat.displacement_method(material) == "BOTH":
        value["divide"] = True  # what is between vertices is seen, in Cycles as bumps
    return value


def diced(displacement, dicing):
    """What RELIEF_displacement has besides where Cycles dices an object, whose rate is then one of the scene's own.

    @param  displacement  what it has elsewhere: with cellPixels if it moves points, which are computed
    @param  dicing        compat.Dicing
    """
    is_computed = "cellPixels" in displacement
    more = {"divide": True} if is_computed else {}
    if dicing.pixels is not None:
        pixels = min(max(displacement.get("cellPixels", 1.0) * dicing.pixels, 0.01), 1000.0)
        if is_computed or pixels != 1:
            more["cellPixels"] = pixels
        if dicing.outside != 4:
            more["coarserOutside"] = dicing.outside
    elif is_computed:
        more["cellLength"] = dicing.length
    if is_computed and dicing.most_cells is not None:
        more["mostCells"] = dicing.most_cells
    return more


def _how(material, move, settings):
    """What of RELIEF_displacement is not the height."""
    return {
        "space": move.space,
        "method": settings.displacement_method,
        "lod": "auto" if settings.lod < 0 else settings.lod,
        # That of smooth faces is set when they are met; bump smooths flat ones, too.
        "smoothing": compat.displacement_method(material) == "BOTH",
        "seams": "weld" if settings.weld_seams else "keep",
    }


def _height_graph(material, height, graph, coordinates):
    """heightGraph of a reference."""
    json = {"nodes": graph.nodes, "outputs": {"height": height}}
    number = _only_set(graph)
    if number is not None:
        if number:
            json["texCoord"] = number
        covered = _uv_range(material, coordinates[number][1])
        if covered is not None:
            json["uvRange"] = covered
    return json


def _only_set(graph):
    """Number of the uv map that is all a height varies with; None: it varies with something else."""
    numbers = set()
    for node in graph.nodes:
        if node["type"] in _VARYING:
            return None
        for value in node.get("inputs", {}).values():
            if not isinstance(value, dict) or graph.nodes[value["node"]]["type"] != "texture-coordinate":
                continue
            numbers.add({"uv": 0, "uv1": 1}.get(value["output"]))
    return numbers.pop() if len(numbers) == 1 else None


#: Nodes whose outputs differ between points of equal texture coordinates, or have images.
_VARYING = {
    *("geometry", "vertex-color", "attribute", "object-info", "light-path", "camera-data", "tangent", "normal-map"),
    *("fresnel", "layer-weight", "bump", "wireframe", "ambient-occlusion", "bevel", "transform", "vector-transform"),
    *("image-texture", "environment-texture"),
}


def _uv_range(material, name):
    """What the meshes of a material cover of a uv map, as glTF's coordinates [u, v, u, v]; None: nothing that is known."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for item in bpy.data.objects:
        mesh = item.data
        if item.type != "MESH" or all(slot.material != material.original for slot in item.material_slots):
            continue
        layer = mesh.uv_layers.get(name) if name else next((la for la in mesh.uv_layers if la.active_render), None)
        if layer is None or not len(layer.data):
            continue
        uv = np.empty(2 * len(layer.data), dtype=np.float32)
        layer.data.foreach_get("uv", uv)
        uv = uv.reshape(-1, 2).astype(float)
        uv = uv[np.isfinite(uv).all(axis=1)]
        if len(uv):
            low, high = np.minimum(low, uv.min(axis=0)), np.maximum(high, uv.max(axis=0))
    # The format wants a rectangle that is neither endless nor without area.
    low, high = np.clip(low, -1e6, 1e6), np.clip(high, -1e6, 1e6)
    if not (high >= low).all():
        return None
    high = np.maximum(high, low + 1e-5 * np.maximum(1.0, np.abs(low)))
    return [float(low[0]), float(1.0 - high[1]), float(high[0]), float(1.0 - low[1])]


def _move_of_output(material, settings, textures, graph):
    """What is linked to a material output's Displacement asks for; None: nothing that is understood."""
    output = nodes.active_output(nodes.tree_of(material), "ShaderNodeOutputMaterial")
    source = nodes.linked(output.inputs["Displacement"]) if output else None
    if source is None:
        return None
    if compat.displacement_method(material) == "BUMP" and not settings.bump_displaces:
        return None
    node, groups = source.node, source.groups
    if is_along_normal(source):
        scale, midlevel = (nodes.fold(node.inputs[name], groups) for name in ("Scale", "Midlevel"))
        if scale is not None and midlevel is not None:
            scale, midlevel = (textures.constant_number(node.inputs[name], groups) for name in ("Scale", "Midlevel"))
            return _Move(node, groups, scale, midlevel, SPACES[node.space])
    along = AlongNormal(graph)
    try:
        height = along.output(source)
        if len(along.spaces) < 2:
            return _Move(None, (), 1.0, 0.0, next(iter(along.spaces), "object"), height=height)
    except NotUnderstood:
        pass
    try:
        return _Move(None, (), 1.0, 0.0, "object", vector=InObject(graph).output(source))
    except NotUnderstood as error:
        textures.warn(f'node "{node.name}" ({node.bl_label}) as displacement ({error})', "nothing is displaced")
        return None


def _move_of_bump(textures):
    """What a Bump node would look like if it moved the surface: by its Distance in the world, grey staying where it is."""
    node, groups = textures.bump.node, textures.bump.groups
    scale = textures.constant_number(node.inputs["Strength"], groups)
    scale *= textures.constant_number(node.inputs["Distance"], groups)
    return _Move(node, groups, -scale if node.invert else scale, 0.5, "world")


def _constant(height, move, images):
    """Displacement by one height everywhere: a map of one texel."""
    if height == move.midlevel:
        return None
    texel = np.full((1, 1), 1.0, dtype=np.float32)
    return {
        "heightTexture": {"uri": images.write_pixels({"Y": texel})},
        "scale": move.scale * (height - move.midlevel),
        "midlevel": 0.0,
        "space": move.space,
        "smoothing": False,
    }
