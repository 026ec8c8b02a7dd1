# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of shaders that may be textured: a constant times an Image Texture, with its mapping.

What is understood between an input and its image: Mapping, Texture Coordinate, UV Map, Separate Color, and
multiplication by a constant (Math, Vector Math, Mix); for heights addition of one, too.
"""

import math
import os
from dataclasses import dataclass, replace

import bpy
import numpy as np

from .. import compat
from . import nodes
from .image import MISSING, has_pixels_of_all_frames, is_linear, is_encoded, reads_as_stored
from .image_header import image_header

#: glTF's wrap modes by Blender's extension.
_WRAP = {"REPEAT": 10497, "EXTEND": 33071, "CLIP": 33071, "MIRROR": 33648}

_CHANNELS = {"Red": 0, "Green": 1, "Blue": 2, "R": 0, "G": 1, "B": 2, "X": 0, "Y": 1, "Z": 2, "Alpha": 3}


@dataclass(frozen=True)
class Mapping:
    """Texture coordinates: rotation · scale · coordinate + location, in Blender's orientation (v up).

    source  as Wanted.coordinates has it
    """

    source: tuple = ("uv", "")
    location: tuple = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple = (1.0, 1.0)

    def transform(self):
        """The same as KHR_texture_transform, in glTF's orientation (v down); None if it changes nothing.

        With v = 1 − v', a turn by +r becomes one by the same r as the extension counts it (counter-clockwise on an
        image whose v points down), and the fixed point moves from the bottom to the top left corner.
        """
        if self.location == (0.0, 0.0) and self.rotation == 0.0 and self.scale == (1.0, 1.0):
            return None
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        # u' = c·su·u − s·sv·v + lx,  v' = s·su·u + c·sv·v + ly;  then v → 1 − v on both sides.
        u_offset = self.location[0] - s * self.scale[1]
        v_offset = 1.0 - self.location[1] - c * self.scale[1]
        transform = {"offset": [u_offset, v_offset], "scale": list(self.scale)}
        if self.rotation != 0.0:
            transform["rotation"] = self.rotation
        return transform


@dataclass(frozen=True)
class Texture:
    """One image as a shader input sees it.

    node     Image Texture node
    channel  0…3 for one channel, None for the colour
    mapping  Mapping
    """

    node: object
    channel: object
    mapping: Mapping

    @property
    def wrap(self):  # an environment has no extension, and goes round
        return _WRAP.get(getattr(self.node, "extension", None), _WRAP["REPEAT"])

    @property
    def nearest(self):
        return self.node.interpolation == "Closest"


@dataclass(frozen=True)
class Input:
    """value · texture + offset. Without a texture, the value.

    value      linear RGB or a number
    color_map  name of a colour attribute in place of a texture, "" for the one active in renders; None: none
    """

    value: object = 1.0
    texture: object = None
    offset: float = 0.0
    color_map: object = None

    def is_constant(self, value=None):
        """Whether nothing varies over the surface; with a value, whether it is that one everywhere."""
        return self.texture is None and self.color_map is None and (value is None or self.value == value)


@dataclass
class TextureReader:
    """Reads inputs of one material's nodes.

    @param  warn        called with what is not understood, and what was used instead
    @param  takes_bump  whether a Bump node is kept, to displace by, instead of warned about
    bump                the nodes.Source of that Bump node
    """

    warn: object
    takes_bump: bool = False
    bump: object = None

    def color(self, socket, groups=()):
        """A colour input: Input whose value is linear RGB."""
        return self._input(socket, groups, True)

    def number(self, socket, groups=()):
        """A number input."""
        return self._input(socket, groups, False)

    def image(self, socket, groups=(), is_color=False):
        """An input that is a constant or an image; None if it is neither, which is not warned about."""
        if nodes.fold(socket, groups) is not None:
            return self._input(socket, groups, is_color)
        return self._textured(nodes.follow(socket, groups), is_color)

    def constant_number(self, socket, groups=()):
        """A number where textures are not possible."""
        return nodes.Reader(self.warn, groups).number(socket)

    def constant_color(self, socket, groups=()):
        return nodes.Reader(self.warn, groups).color(socket)

    def _input(self, socket, groups, is_color):
        if nodes.fold(socket, groups) is None:
            found = self._textured(nodes.follow(socket, groups), is_color)
            if found is not None:
                return found
        reader = nodes.Reader(self.warn, groups)
        return Input(reader.color(socket) if is_color else reader.number(socket))

    def _textured(self, source, is_color):
        """Input of a source that varies; None if it is not understood, or if glTF's textures do not mean it."""
        found = self._read(source, is_color)
        if found is not None and found.texture is not None:
            node = found.texture.node
            if not reads_as_stored(node.image, is_color, uses_alpha(node)):
                return None
            if is_encoded(node.image) or not has_pixels_of_all_frames(node.image, is_color) or (
                node.image.source == "SEQUENCE" and found.texture.channel is not None
            ):
                return None
        return found

    def _read(self, source, is_color):
        node, one = source.node, (1.0, 1.0, 1.0) if is_color else 1.0
        if node.bl_idname == "ShaderNodeTexImage":
            if node.image is None:
                value = 1.0 if source.socket.name == "Alpha" else (*MISSING, 1.0)
                return Input(nodes.as_color(value) if is_color else nodes.as_number(value))
            channel = 3 if source.socket.name == "Alpha" else None
            return Input(one, Texture(node, channel, self._mapping(node, source.groups)))
        if node.bl_idname in {"ShaderNodeSeparateColor", "ShaderNodeSeparateRGB", "ShaderNodeSeparateXYZ"}:
            if getattr(node, "mode", "RGB") == "RGB":
                return self._channel(source, one)
        if is_color and node.bl_idname == "ShaderNodeVertexColor" and source.socket.name == "Color":
            return Input(one, color_map=node.layer_name)
        factors = self._factors(node)
        return self._product(source, factors, is_color) if factors is not None else None

    def _channel(self, source, one):
        inner = nodes.follow(source.node.inputs[0], source.groups)
        if inner is None or inner.node.bl_idname != "ShaderNodeTexImage" or inner.socket.name == "Alpha":
            return None
        if inner.node.image is None:
            value = MISSING[_CHANNELS[source.socket.name]]
            return Input((value,) * 3 if isinstance(one, tuple) else value)
        mapping = self._mapping(inner.node, inner.groups)
        return Input(one, Texture(inner.node, _CHANNELS[source.socket.name], mapping))

    def _factors(self, node):
        """(kind, the two sockets that a node multiplies or adds); None for other nodes."""
        if node.bl_idname in {"ShaderNodeMath", "ShaderNodeVectorMath"}:
            if node.operation in {"MULTIPLY", "ADD", "SUBTRACT"} and not getattr(node, "use_clamp", False):
                return node.operation, node.inputs[0], node.inputs[1]
        if node.bl_idname == "ShaderNodeMixRGB" and node.blend_type == "MULTIPLY":
            if nodes.fold(node.inputs[0]) == 1.0:
                return "MULTIPLY", node.inputs[1], node.inputs[2]
        if node.bl_idname == "ShaderNodeMix" and node.data_type == "RGBA" and node.blend_type == "MULTIPLY":
            if nodes.fold(node.inputs[0]) == 1.0:
                return "MULTIPLY", *(s for s in node.inputs if s.enabled and s.type == "RGBA")
        return None

    def _product(self, source, factors, is_color):
        kind, first, second = factors
        left, right = nodes.fold(first, source.groups), nodes.fold(second, source.groups)
        if (left is None) == (right is None):
            return None
        constant = right if left is None else left
        if not np.isfinite(constant).all():
            return None
        varying = nodes.follow(first if left is None else second, source.groups)
        inner = self._read(varying, is_color)
        if inner is None:
            return None
        if is_color:
            if kind != "MULTIPLY":
                return None
            factor = constant[:3] if isinstance(constant, tuple) else (constant,) * 3
            return replace(inner, value=tuple(a * b for a, b in zip(inner.value, factor)))
        if isinstance(constant, tuple):
            constant = constant[0]
        if kind == "MULTIPLY":
            return replace(inner, value=inner.value * constant, offset=inner.offset * constant)
        if kind == "SUBTRACT" and left is not None:  # constant − texture
            return replace(inner, value=-inner.value, offset=constant - inner.offset)
        return replace(inner, offset=inner.offset + (constant if kind == "ADD" else -constant))

    def _mapping(self, node, groups):
        if not nodes.has_plain_mapping(node):
            self.warn(f'node "{node.name}": its own mapping', "it is left out")
        if node.projection != "FLAT":
            self.warn(f'node "{node.name}": projection {node.projection.lower()}', "flat was used")
        if node.extension == "CLIP":
            self.warn(f'node "{node.name}": extension Clip', "Extend was used")
        if node.interpolation in {"Cubic", "Smart"}:
            self.warn(f'node "{node.name}": interpolation {node.interpolation}', "Linear was used")
        return self._coordinates(nodes.follow(node.inputs["Vector"], groups), Mapping())

    def _coordinates(self, source, mapping):
        """Follows texture coordinates to where they come from."""
        if source is None:
            return mapping
        node = source.node
        if getattr(node, "from_instancer", False):
            self.warn(f'node "{node.name}": coordinates from an instancer', "the object's own were used")
        if node.bl_idname == "ShaderNodeUVMap":
            return replace(mapping, source=("uv", node.uv_map))
        if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY":
            return replace(mapping, source=("uv", node.attribute_name))
        if node.bl_idname == "ShaderNodeTexCoord" and source.socket.name in {"UV", "Generated", "Object"}:
            if source.socket.name == "Object" and node.object is not None:
                self.warn(f'node "{node.name}": coordinates of another object', "the object's own were used")
            return replace(mapping, source=(source.socket.name.lower(), ""))
        if node.bl_idname == "ShaderNodeMapping" and mapping == Mapping():
            inner = self._coordinates(nodes.follow(node.inputs["Vector"], source.groups), Mapping())
            if inner.transform() is None:
                return self._mapped(node, source.groups, inner.source)
        self.warn(f'node "{node.name}" ({node.bl_label}) as texture coordinates', "the uv map was used")
        return mapping

    def _mapped(self, node, groups, source):
        reader = nodes.Reader(self.warn, groups)
        location = reader.vector(node.inputs["Location"])[:2] if "Location" in node.inputs else (0.0, 0.0)
        turn, scale = reader.vector(node.inputs["Rotation"]), reader.vector(node.inputs["Scale"])[:2]
        if abs(turn[0]) + abs(turn[1]) > 1e-7:
            self.warn(f'node "{node.name}": rotation about X or Y', "the one about Z alone was used")
        if node.vector_type in {"POINT", "VECTOR"}:
            return Mapping(source, tuple(location), turn[2], tuple(scale))
        # TEXTURE is the inverse; NORMAL lengthens to unit, which no texture wants.
        if node.vector_type == "TEXTURE" and all(scale):
            c, s = math.cos(turn[2]), math.sin(turn[2])
            inverse = np.diag([1 / scale[0], 1 / scale[1]]) @ np.array([[c, s], [-s, c]])
            if turn[2] == 0 or scale[0] == scale[1]:
                moved = tuple(float(x) for x in -inverse @ np.array(location))
                return Mapping(source, moved, -turn[2], (1 / scale[0], 1 / scale[1]))
        self.warn(f'node "{node.name}": a mapping that shears ({node.vector_type.lower()})', "the uv map was used")
        return Mapping(source)


def uses_alpha(node):
    """Whether the alpha that an Image Texture node gives leads anywhere. Environment Texture nodes give none."""
    alpha = node.outputs.get("Alpha")
    return alpha is not None and nodes.is_used(alpha)


def image_options(node, writer, images, warn):
    """Options of image-texture and environment-texture: which image an Image or Environment Texture node reads, and what of it.

    @param  writer  GltfWriter
    @param  images  ImageExporter
    @return         None without tiles
    """
    image = node.image
    is_data = image.colorspace_settings.is_data
    is_opaque = image.alpha_mode == "NONE"
    is_separate = is_data or image.alpha_mode == "CHANNEL_PACKED" or image.source == "FILE" and image_header(image).channels not in {2, 4}
    associates = not (is_opaque or is_separate or uses_alpha(node))
    texture = Texture(node, None, Mapping())

    def info(uri):
        return {"index": writer.add_texture(uri, texture.wrap, texture.nearest)}

    options = {"colorSpace": "linear" if is_linear(image) else "encoded-srgb" if is_encoded(image) else "srgb"}
    if node.bl_idname == "ShaderNodeTexEnvironment":
        uri, is_multiplied = images.stored_uri(image, node.image_user, not is_linear(image), warn, associates)
        if associates and not is_multiplied:
            options["alpha"] = "straight"
        return {**options, "texture": info(uri)}
    is_multiplied = image.alpha_mode == "PREMUL" and (compat.ALPHA_BY_MODE or image_header(image).is_float)
    if image.source == "TILED":
        uris = images.tile_uris(image, not is_linear(image), warn)
        tiles = [{"tile": number, "texture": info(uri), **options} for number, uri in sorted(uris.items())]
        if not tiles:
            return None
        # One tile is an image like any other, as in Cycles.
        options = {"tiles": tiles} if len(tiles) > 1 else {**options, "texture": tiles[0]["texture"]}
    else:
        uri, is_multiplied = images.stored_uri(image, node.image_user, not is_linear(image), warn, associates)
        options["texture"] = info(uri)
    if is_opaque:
        options["alpha"] = "opaque"
    elif not is_separate:
        options["alpha"] = "associated" if is_multiplied else "straight"
        if uses_alpha(node):
            options["unassociate"] = True
    return options


def ies_uri(node, writer):
    """URI of the file or text that an IES Texture node reads; None: there is none.

    @param  writer  GltfWriter
    """
    if node.mode == "INTERNAL":
        return writer.write_file(".ies", node.ies.as_string().encode()) if node.ies is not None else None
    path = bpy.path.abspath(node.filepath, library=node.id_data.library)
    return writer.file_uri(path) if os.path.isfile(path) else None
