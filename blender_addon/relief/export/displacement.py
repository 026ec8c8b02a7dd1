# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Displacement node as RELIEF_displacement.

Both move a point along the interpolated normal by scale · (height − midlevel), measured in object or world space, so
the values are taken as they are. A height of value · texture + offset is folded into scale and midlevel.
"""

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


def export_displacement(material, settings, textures, texture_info, images):
    """Value of RELIEF_displacement.

    @param  material      bpy material with nodes
    @param  settings      scene.relief: method, level of detail and seams of all materials
    @param  textures      TextureReader
    @param  texture_info  makes glTF's texture reference of a Texture used as numbers; None if its image is missing
    @param  images        ImageExporter
    @return               None if nothing moves
    """
    output = nodes.active_output(material.node_tree, "ShaderNodeOutputMaterial")
    source = nodes.follow(output.inputs["Displacement"]) if output else None
    if source is None:
        return None
    if compat.displacement_method(material) == "BUMP":
        textures.warn(
            'its Displacement node, as its setting is "Bump Only"',
            'nothing is displaced; choose "Displacement Only" in Material > relief Displacement',
        )
        return None
    node = source.node
    if node.bl_idname != "ShaderNodeDisplacement":
        textures.warn(f'node "{node.name}" ({node.bl_label}) as displacement', "nothing is displaced")
        return None
    if nodes.follow(node.inputs["Normal"], source.groups) is not None:
        textures.warn(f'node "{node.name}": a normal for the displacement', "the surface's own was used")
    scale = textures.constant_number(node.inputs["Scale"], source.groups)
    midlevel = textures.constant_number(node.inputs["Midlevel"], source.groups)
    height = textures.number(node.inputs["Height"], source.groups)
    if scale == 0:
        return None
    # scale · (value · h + offset − midlevel) = (scale · value) · (h − (midlevel − offset) / value)
    if height.texture is None:
        return _constant(height.value, scale, midlevel, node, images)
    info = texture_info(height.texture)
    if info is None or height.value == 0:
        return None
    folded = (midlevel - height.offset) / height.value
    if not 0 <= folded <= 1:
        textures.warn(f'node "{node.name}": a midlevel of {folded:.4g}', "it was limited to between 0 and 1")
        folded = min(max(folded, 0.0), 1.0)
    return {
        "heightTexture": info,
        "scale": scale * height.value,
        "midlevel": folded,
        "space": _SPACES[node.space],
        "method": settings.displacement_method,
        "lod": "auto" if settings.lod < 0 else settings.lod,
        "smoothing": compat.displacement_method(material) == "BOTH",
        "seams": "weld" if settings.weld_seams else "keep",
    }


def _constant(height, scale, midlevel, node, images):
    """Displacement by one height everywhere: a map of one texel."""
    if height == midlevel:
        return None
    texel = np.full((1, 1), 1.0, dtype=np.float32)
    return {
        "heightTexture": {"uri": images.write_pixels({"Y": texel})},
        "scale": scale * (height - midlevel),
        "midlevel": 0.0,
        "space": _SPACES[node.space],
    }
