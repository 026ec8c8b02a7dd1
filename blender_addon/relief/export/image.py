# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as files that the program reads as Blender means them.

The program decides by the use of a texture: colours stored as integers are sRGB, everything else is linear. Where
Blender's colour space says the same, the file itself is named, and packed files are written out as they are: no value
passes through Blender's pixels, heights keep their 16 bits. Otherwise the pixels are taken, made linear and written as
32-bit floats, which no use changes.

What Cycles does with alpha goes by the file, not by whether Blender calls it straight or premultiplied: colours that a
file has apart from alpha are multiplied by it, as they are stored; and divided again, after filtering, where the node's
Alpha is used. Since 5.2 it goes by the alpha mode alone (compat.ALPHA_BY_MODE).
"""

import os
import struct
import zlib

import bpy
import numpy as np

from .. import compat, exr
from . import color_space
from .image_header import (
    file_head,
    image_header,
    is_associated_file,
    is_float_file,
    is_grey_file,
    may_have_alpha,
    png_is_opaque,
    suffix,
)

#: Colour of an image that is missing.
MISSING = (1.0, 0.0, 1.0)


class ImageExporter:
    """Finds or makes the file of each image once.

    @param  writer  GltfWriter
    @param  scene   bpy scene, whose current frame image sequences are at

    moment  (frame, its fraction with it; seconds) that the scene is at
    """

    def __init__(self, writer, scene):
        self._writer = writer
        self._frame = scene.frame_current
        frame = scene.frame_current_final
        self.moment = (frame, frame * scene.render.fps_base / scene.render.fps)
        self._uris = {}
        self._associated = {}
        self._of_pixels = set()

    def color_uri(self, image, user, warn):
        """URI of an image used as a colour, with its colours as they are stored."""
        return self._uri(image, user, True, warn)

    def stored_uri(self, image, user, is_color, warn, associates=False):
        """URI of an image with its colours as they are stored, whatever its alpha.

        @param  associates  whether they are to be multiplied by alpha; what the program can do itself it is left to
        @return  (URI, whether the colours are multiplied by alpha already)
        """
        uri = self._uri(image, user, is_color, warn, associates, is_encoded(image))
        if compat.ALPHA_BY_MODE and uri not in self._of_pixels:
            return uri, image.alpha_mode == "PREMUL"
        return uri, self._associated.get(uri, False)

    def tile_uris(self, image, is_color, warn):
        """URIs of a tiled image's files by the number of the tile; empty without any, which is warned about."""
        path = bpy.path.abspath(image.filepath, library=image.library)
        if "<UDIM>" not in path and "<UVTILE>" not in path or image.packed_files:
            warn(f'image "{image.name}": tiles that are not files', "it is left out")
            return {}
        found = {}
        for number in (tile.number for tile in image.tiles):
            column, row = (number - 1001) % 10, (number - 1001) // 10
            tile = path.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
            if not os.path.isfile(tile):
                warn(f'image "{image.name}": no file {tile!r}', "the tile is magenta")
                found[number] = self._missing()
                continue
            with open(tile, "rb") as file:
                is_same = self._means_the_same(image, file.read(4096), tile, is_color)
            found[number] = self._writer.file_uri(tile) if is_same else self._tile_from_pixels(image, tile, warn)
        return found

    def _tile_from_pixels(self, image, path, warn):
        """URI of a tile in the colour space of its image."""
        key = (image.name_full, path)
        if key not in self._uris:
            tile = bpy.data.images.load(path)
            try:
                tile.colorspace_settings.name = image.colorspace_settings.name
                tile.alpha_mode = image.alpha_mode
                self._uris[key] = self._make_from_pixels(tile, warn, False)
            finally:
                bpy.data.images.remove(tile)
        return self._uris[key]

    def data_uri(self, image, user, warn):
        """URI of an image used as one number, which of colours is their luminance."""
        uri = self._uri(image, user, False, warn)
        is_plain = uri != self._uris.get("missing") and uri not in self._of_pixels and _is_grey(image)
        return uri if is_plain else self.channel_uri(image, None, warn)

    def channel_uri(self, image, channel, warn):
        """URI of a grey image with one channel (0…3) of another, as numbers."""
        key = (image.name_full, "channel", channel, self._frame if image.source == "SEQUENCE" else 0)
        if key not in self._uris:
            plane = self._plane(image, channel, warn)
            self._uris[key] = None if plane is None else self.write_pixels({"Y": plane})
        return self._uris[key]

    def alpha_uri(self, image, channel, warn):
        """URI of a white image whose alpha is a channel of an image, or its grey value."""
        key = (image.name_full, "alpha", channel)
        if key not in self._uris:
            plane = self._plane(image, channel, warn)
            white = None if plane is None else np.ones_like(plane)
            uri = None if plane is None else self.write_pixels({"R": white, "G": white, "B": white, "A": plane})
            self._uris[key] = uri
        return self._uris[key]

    def _plane(self, image, channel, warn):
        """One channel, or the grey value: float32 (height, width)."""
        pixels = self._linear_pixels(image, warn)
        if pixels is None:
            pixels = np.full((1, 1, 4), (*MISSING, 1.0), dtype=np.float32)
        if channel is not None:
            return pixels[..., min(channel, pixels.shape[-1] - 1)]
        weights = np.array(color_space.luminance_weights(), dtype=np.float32)
        return pixels[..., :3] @ weights if pixels.shape[-1] >= 3 else pixels[..., 0]

    def write_pixels(self, channels):
        """Writes float32 planes, bottom row first, as an image of linear floats; returns its URI."""
        planes = {name: np.ascontiguousarray(plane[::-1], dtype=np.float32) for name, plane in channels.items()}
        return self._writer.write_file(".exr", exr.encode(planes))

    def _uri(self, image, user, is_color, warn, associates=False, encoded=False):
        key = (image.name_full, is_color, self._frame if image.source == "SEQUENCE" else 0, associates, encoded)
        if key not in self._uris:
            self._uris[key] = self._make(image, user, is_color, warn, associates, encoded)
        return self._uris[key]

    def _make(self, image, user, is_color, warn, associates, encoded):
        if image.source in {"MOVIE", "TILED", "VIEWER"}:
            warn(f'image "{image.name}": {image.source.lower()} images', "magenta was used")
            return self._missing()
        packed = _packed_bytes(image)
        if image.source == "GENERATED" or image.is_dirty:
            return self._make_from_pixels(image, warn, associates)
        if packed is not None:
            # Cycles takes Blender's pixels, which of 16 bits are floats multiplied by alpha.
            is_changed = image_header(image).is_float and not is_float_file(packed[:4096], image.filepath) and has_transparency(image)
            is_changed = is_changed or _alpha_needs_pixels(image, packed[:4096], image.filepath, associates)
            if not is_changed and self._means_the_same(image, packed[:4096], image.filepath, is_color):
                uri = self._writer.write_file(suffix(packed, image.filepath), packed)
                return self._note_alpha(uri, packed[:4096], image.filepath)
            return self._make_from_pixels(image, warn, associates)
        path = self._path(image, user)
        if not os.path.isfile(path):
            warn(f'image "{image.name}": no file {path!r}', "magenta was used")
            return self._missing()
        with open(path, "rb") as file:
            first = file.read(4096)
        is_changed = _alpha_needs_pixels(image, first, path, associates)
        if not is_changed and self._means_the_same(image, first, path, is_color, encoded):
            return self._note_alpha(self._writer.file_uri(path), first, path)
        return self._make_from_pixels(image, warn, associates)

    def _note_alpha(self, uri, first_bytes, path):
        if is_associated_file(first_bytes, path):
            self._associated[uri] = True
        return uri

    def _missing(self):
        """URI of what stands for an image that is missing: one texel, magenta and opaque."""
        if "missing" not in self._uris:
            self._uris["missing"] = self._writer.write_file(".png", _one_texel_png((255, 0, 255)))
        return self._uris["missing"]

    def _path(self, image, user):
        path = bpy.path.abspath(image.filepath, library=image.library)
        if image.source != "SEQUENCE" or user is None:
            return path
        frame = self._frame - user.frame_start + 1
        frame = (frame - 1) % user.frame_duration + 1 if user.use_cyclic else min(max(frame, 1), user.frame_duration)
        frame += user.frame_offset
        folder, name = os.path.split(path)
        stem, suffix = os.path.splitext(name)
        digits = len(stem) - len(stem.rstrip("0123456789"))
        return os.path.join(folder, f"{stem[: len(stem) - digits]}{frame:0{digits}d}{suffix}") if digits else path

    def _means_the_same(self, image, first_bytes, path, is_color, encoded=False):
        """Whether the program reads the file and makes of it what Blender makes of it.

        @param  encoded  whether it is told of floats that are sRGB
        """
        if suffix(first_bytes, path) is None:
            return False
        meaning = color_space.meaning(image.colorspace_settings)
        if is_float_file(first_bytes, path) or not is_color:
            return meaning == "linear" or encoded and meaning == "srgb"
        return meaning == "srgb"

    def _make_from_pixels(self, image, warn, associates):
        """As Blender has the pixels: bytes apart from alpha, floats multiplied by it."""
        pixels = self._linear_pixels(image, warn, associates and not image.is_float)
        if pixels is None:
            return self._missing()
        names = "RGBA"[: pixels.shape[-1]] if pixels.shape[-1] != 1 else "Y"
        uri = self.write_pixels({name: pixels[..., c] for c, name in enumerate(names)})
        self._associated[uri] = image.is_float or associates
        self._of_pixels.add(uri)
        return uri

    def _linear_pixels(self, image, warn, darkened=False):
        """An image's scene-linear values: float32 of shape (height, width, channels), bottom row first.

        @param  darkened  multiply the stored colours by their alpha
        """
        width, height = image.size
        if width * height == 0:
            warn(f'image "{image.name}" has no pixels', "magenta was used")
            return None
        pixels = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(height, width, image.channels)
        if darkened and image.channels == 4:
            # Cycles does it in bytes, rounding down; the little more is for products that are whole numbers.
            pixels[..., :3] = np.floor(pixels[..., :3] * pixels[..., 3:] * 255 + 1e-3) / 255
        # Blender keeps floats scene-linear, bytes as they were stored.
        if not image.is_float:
            color = np.repeat(pixels[..., :1], 3, axis=2) if image.channels < 3 else pixels[..., :3]
            pixels[..., :3] = color_space.to_scene_linear(color, image.colorspace_settings)[..., : pixels.shape[-1]]
        return pixels


def _alpha_needs_pixels(image, first_bytes, path, associates):
    """Whether the program makes something else of a file's alpha than Cycles does since 5.2, but not of Blender's pixels.

    @param  associates  whether colours are to be multiplied by alpha
    """
    # Of a sequence Blender has the pixels of one frame alone, and none yet where it has not been shown.
    if not compat.ALPHA_BY_MODE or image.source == "SEQUENCE" or not has_transparency(image):
        return False
    if suffix(first_bytes, path) == ".webp":
        return True
    if image.colorspace_settings.is_data or image.alpha_mode in {"NONE", "CHANNEL_PACKED"}:
        return False
    if image.alpha_mode == "STRAIGHT":
        return is_associated_file(first_bytes, path)
    # Cycles divides codes by alpha, the program light; Blender's bytes are divided.
    return not associates and not is_float_file(first_bytes, path)


def is_missing(image):
    """Whether the one file of an image is not there."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    return image.source == "FILE" and not image.is_dirty and image.packed_file is None and not os.path.isfile(path)


def is_linear(image):
    """Whether an image's colours are stored as light, or are data."""
    return color_space.meaning(image.colorspace_settings) == "linear"


def is_encoded(image):
    """Whether an image's file has floats that are sRGB, of all things."""
    if image.source not in {"FILE", "SEQUENCE"} or image.is_dirty or image.packed_file is not None:
        return False
    return color_space.meaning(image.colorspace_settings) == "srgb" and is_float_file(file_head(image), image.filepath)


def has_pixels_of_all_frames(image, is_color):
    """Whether no pixels are needed of an image for a use in glTF's core: of a sequence Blender has those of one frame alone.

    @param  is_color  whether it is used as a colour
    """
    if image.source != "SEQUENCE":
        return True
    if is_color and not is_float_file(file_head(image), image.filepath):
        return color_space.meaning(image.colorspace_settings) == "srgb"
    return is_linear(image) and (is_color or is_grey_file(file_head(image)))


def reads_as_stored(image, is_color, uses_alpha):
    """Whether Cycles shows an image's colours as its file has them, and its alpha too if that is used.

    @param  is_color    whether it is used as a colour
    @param  uses_alpha  whether the node's Alpha is linked to anything
    """
    if not has_transparency(image):
        return True
    if image_header(image).is_float or is_associated_file(file_head(image), image.filepath):
        return False
    if image.alpha_mode == "NONE":
        return not uses_alpha
    # Blender's pixels, which other spaces need, are not always what the file has.
    if color_space.meaning(image.colorspace_settings) != ("srgb" if is_color else "linear"):
        return False
    if image.colorspace_settings.is_data or image.alpha_mode == "CHANNEL_PACKED":
        return True
    return uses_alpha and (image.alpha_mode == "STRAIGHT" or is_color and not compat.ALPHA_BY_MODE)


#: Whether images have transparent pixels, by what tells an image and its state: looking costs a second at 8k.
_transparency = {}


def has_transparency(image):
    """Whether an image has an alpha below one somewhere. Of images with several files nothing is known: perhaps."""
    # Blender's pixels are opaque where it is told to ignore alpha, of which the file may have made something.
    if image.source not in {"FILE", "GENERATED"} or image.alpha_mode == "NONE":
        return may_have_alpha(file_head(image))
    if image.source == "FILE" and not image.is_dirty:
        head = file_head(image)
        if head and not may_have_alpha(head):
            return False
    key = None if image.is_dirty else _state_of(image)
    if key is None or key not in _transparency:
        _transparency[key] = _looks_transparent(image)
    return _transparency[key]


def _state_of(image):
    """What tells an image and its file; None: nothing does."""
    if image.source != "FILE":
        return None
    if image.packed_file is not None:
        return image.name_full, zlib.crc32(image.packed_file.data), image.packed_file.size
    path = bpy.path.abspath(image.filepath, library=image.library)
    return (image.name_full, path, os.stat(path).st_mtime_ns) if os.path.isfile(path) else None


def _looks_transparent(image):
    """Whether a pixel of an image has an alpha below one."""
    if image.source == "FILE" and not image.is_dirty:
        is_opaque = png_is_opaque(_file_bytes(image))
        if is_opaque is not None:
            return not is_opaque
    if image.channels != 4:
        return False
    pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return bool((pixels[3::4] < 1).any())


def _file_bytes(image):
    """Bytes of an image's PNG, packed or not; empty of other files."""
    if not file_head(image).startswith(b"\x89PNG"):
        return b""
    if image.packed_file is not None:
        return image.packed_file.data
    with open(bpy.path.abspath(image.filepath, library=image.library), "rb") as file:
        return file.read()


def _is_grey(image):
    """Whether all colours of an image are equal: its pixels are looked at, unless its file cannot have others."""
    first = b"" if image.is_dirty else file_head(image)
    if is_grey_file(first) or image.source == "SEQUENCE" or image.channels < 3:
        return True
    pixels = np.empty(image.size[0] * image.size[1] * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(-1, image.channels)
    return bool((pixels[:, 0] == pixels[:, 1]).all() and (pixels[:, 0] == pixels[:, 2]).all())


def _one_texel_png(color):
    """A PNG of one opaque texel."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    texel = zlib.compress(b"\0" + bytes(color))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", texel) + chunk(b"IEND", b"")


def _packed_bytes(image):
    if image.packed_file is not None:
        return image.packed_file.data
    return None
