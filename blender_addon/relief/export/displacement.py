# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Displacement node as RELIEF_displacement.

Both move a point along the interpolated normal by scale · (height − midlevel), measured in object or world space, so
the values are taken as they are. A height of value · texture + offset is folded into scale and midlevel.
"""

from dataclasses import dataclass

import numpy as np

from .. import compat
from . import nodes

_SPACES = {"OBJECT": "object", "WORLD": "world"}


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
    """How far points move: scale · (height − midlevel), in a space, by the Height of a node."""

    node: object
    groups: tuple
    scale: float
    midlevel: float
    space: str


def bump_displaces(material, settings):
    """Whether a Bump node of a material is to move its surface: the artist wants it, and nothing else moves it."""
    return settings.bump_displaces and not has_displacement_node(material)


def export_displacement(material, settings, textures, texture_info, images):
    """Value of RELIEF_displacement.

    @param  material      bpy material with nodes
    @param  settings      scene.relief: method, level of detail and seams of all materials
    @param  textures      TextureReader, which has read the surface
    @param  texture_info  makes glTF's texture reference of a Texture used as numbers; None if its image is missing
    @param  images        ImageExporter
    @return               None if nothing moves
    """
    move = _move_of_bump(textures) if textures.bump else _move_of_output(material, settings, textures)
    if move is None or move.scale == 0:
        return None
    height = textures.image(move.node.inputs["Height"], move.groups)
    if height is None:
        node = move.node
        textures.warn(f'node "{node.name}" ({node.bl_label}): a height that is no image', "nothing is displaced")
        return None
    # scale · (value · h + offset − midlevel) = (scale · value) · (h − (midlevel − offset) / value)
    if height.texture is None:
        return _constant(height.value, move, images)
    info = texture_info(height.texture)
    if info is None or height.value == 0:
        return None
    return {
        "heightTexture": info,
        "scale": move.scale * height.value,
        "midlevel": (move.midlevel - height.offset) / height.value,
        "space": move.space,
        "method": settings.displacement_method,
        "lod": "auto" if settings.lod < 0 else settings.lod,
        # That of smooth faces is set when they are met; bump smooths flat ones, too.
        "smoothing": compat.displacement_method(material) == "BOTH",
        "seams": "weld" if settings.weld_seams else "keep",
    }


def _move_of_output(material, settings, textures):
    """What the Displacement node at a material's output asks for."""
    output = nodes.active_output(material.node_tree, "ShaderNodeOutputMaterial")
    source = nodes.follow(output.inputs["Displacement"]) if output else None
    if source is None:
        return None
    if compat.displacement_method(material) == "BUMP" and not settings.bump_displaces:
        return None
    node, groups = source.node, source.groups
    if node.bl_idname != "ShaderNodeDisplacement":
        textures.warn(f'node "{node.name}" ({node.bl_label}) as displacement', "nothing is displaced")
        return None
    if nodes.follow(node.inputs["Normal"], groups) is not None:
        textures.warn(f'node "{node.name}": a normal for the displacement', "the surface's own was used")
    scale = textures.constant_number(node.inputs["Scale"], groups)
    return _Move(node, groups, scale, textures.constant_number(node.inputs["Midlevel"], groups), _SPACES[node.space])


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
