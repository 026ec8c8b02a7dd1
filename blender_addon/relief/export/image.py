# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as files that the program reads as Blender means them.

The program decides by the use of a texture: colours stored as integers are sRGB, everything else is linear. Where
Blender's colour space says the same, the file itself is named, and packed files are written out as they are: no value
passes through Blender's pixels, heights keep their 16 bits. Otherwise the pixels are taken, made linear and written as
32-bit floats, which no use changes.
"""

import os
import struct

import bpy
import numpy as np

from .. import exr
from . import color_space

_FLOAT_SUFFIXES = {".exr", ".hdr"}
_TIFF_SAMPLE_FORMAT, _TIFF_IEEE_FLOAT = 339, 3


class ImageExporter:
    """Finds or makes the file of each image once.

    @param  writer  GltfWriter
    @param  frame   Blender's current frame, for image sequences
    """

    def __init__(self, writer, frame):
        self._writer = writer
        self._frame = frame
        self._uris = {}
        self._of_pixels = set()

    def color_uri(self, image, user, warn, alpha_is_linked=True):
        """URI of an image used as a colour; None if there is none to use, which is warned about.

        @param  alpha_is_linked  whether the node's Alpha is used: if not, Blender darkens what is transparent
        """
        if not alpha_is_linked and _is_transparent(image):
            key = (image.name_full, "darkened")
            if key not in self._uris:
                pixels = self._linear_pixels(image, warn, darkened=True)
                self._uris[key] = self.write_pixels({name: pixels[..., c] for c, name in enumerate("RGB")})
            return self._uris[key]
        return self._uri(image, user, True, warn)

    def stored_uri(self, image, user, is_color, warn):
        """URI of an image with its colours as they are stored, whatever its alpha.

        @return  (URI, or None without a file; whether the colours are multiplied by alpha already)
        """
        uri = self._uri(image, user, is_color, warn)
        # Blender's own floats always are.
        return uri, image.is_float and (image.alpha_mode == "PREMUL" or image.name_full in self._of_pixels)

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
                warn(f'image "{image.name}": no file {tile!r}', "the tile is left out")
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
                self._uris[key] = self._make_from_pixels(tile, warn)
            finally:
                bpy.data.images.remove(tile)
        return self._uris[key]

    def data_uri(self, image, user, warn):
        """URI of an image used as numbers: roughness, normals, heights."""
        return self._uri(image, user, False, warn)

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
        """One channel, or the grey value: float32 (height, width); None without pixels."""
        pixels = self._linear_pixels(image, warn)
        if pixels is None:
            return None
        if channel is not None:
            return pixels[..., min(channel, pixels.shape[-1] - 1)]
        weights = np.array(color_space.luminance_weights(), dtype=np.float32)
        return pixels[..., :3] @ weights if pixels.shape[-1] >= 3 else pixels[..., 0]

    def write_pixels(self, channels):
        """Writes float32 planes, bottom row first, as an image of linear floats; returns its URI."""
        planes = {name: np.ascontiguousarray(plane[::-1], dtype=np.float32) for name, plane in channels.items()}
        return self._writer.write_file(".exr", exr.encode(planes))

    def _uri(self, image, user, is_color, warn):
        key = (image.name_full, is_color, self._frame if image.source == "SEQUENCE" else 0)
        if key not in self._uris:
            self._uris[key] = self._make(image, user, is_color, warn)
        return self._uris[key]

    def _make(self, image, user, is_color, warn):
        if image.source in {"MOVIE", "TILED", "VIEWER"}:
            warn(f'image "{image.name}": {image.source.lower()} images', "it is left out")
            return None
        packed = _packed_bytes(image)
        if image.source == "GENERATED" or image.is_dirty:
            return self._make_from_pixels(image, warn)
        if packed is not None:
            if self._means_the_same(image, packed[:4096], image.filepath, is_color):
                return self._writer.write_file(_suffix(packed, image.filepath), packed)
            return self._make_from_pixels(image, warn)
        path = self._path(image, user)
        if not os.path.isfile(path):
            warn(f'image "{image.name}": no file {path!r}', "it is left out")
            return None
        with open(path, "rb") as file:
            first = file.read(4096)
        if self._means_the_same(image, first, path, is_color):
            return self._writer.file_uri(path)
        return self._make_from_pixels(image, warn)

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

    def _means_the_same(self, image, first_bytes, path, is_color):
        """Whether the program reads the file and makes of it what Blender makes of it."""
        if _suffix(first_bytes, path) is None:
            return False
        expected = "linear" if _is_float_file(first_bytes, path) or not is_color else "srgb"
        return color_space.meaning(image.colorspace_settings) == expected

    def _make_from_pixels(self, image, warn):
        pixels = self._linear_pixels(image, warn)
        if pixels is None:
            return None
        self._of_pixels.add(image.name_full)
        names = "RGBA"[: pixels.shape[-1]] if pixels.shape[-1] != 1 else "Y"
        return self.write_pixels({name: pixels[..., c] for c, name in enumerate(names)})

    def _linear_pixels(self, image, warn, darkened=False):
        """An image's scene-linear values: float32 of shape (height, width, channels), bottom row first.

        @param  darkened  multiply the stored colours by their alpha
        """
        width, height = image.size
        if width * height == 0:
            warn(f'image "{image.name}" has no pixels', "it is left out")
            return None
        pixels = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(height, width, image.channels)
        if darkened:
            # Cycles does it in bytes, rounding down; the little more is for products that are whole numbers.
            pixels[..., :3] = np.floor(pixels[..., :3] * pixels[..., 3:] * 255 + 1e-3) / 255
        # Blender keeps floats scene-linear, bytes as they were stored.
        if not image.is_float:
            color = np.repeat(pixels[..., :1], 3, axis=2) if image.channels < 3 else pixels[..., :3]
            pixels[..., :3] = color_space.to_scene_linear(color, image.colorspace_settings)[..., : pixels.shape[-1]]
        return pixels


#: Whether images have transparent pixels, by what tells an image and its state: looking costs a second at 8k.
_transparency = {}


def _is_transparent(image):
    """Whether an image has colours that are stored apart from an alpha below one."""
    if image.is_float or image.channels != 4 or image.alpha_mode != "STRAIGHT" or image.source not in {"FILE", "GENERATED"}:
        return False
    path = bpy.path.abspath(image.filepath, library=image.library)
    stamp = os.stat(path).st_mtime_ns if image.source == "FILE" and os.path.isfile(path) else None
    key = (image.name_full, path, stamp, tuple(image.size))
    if image.is_dirty or stamp is None or key not in _transparency:
        pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        _transparency[key] = bool((pixels[3::4] < 1).any())
    return _transparency[key]


def _packed_bytes(image):
    if image.packed_file is not None:
        return image.packed_file.data
    return None


def _suffix(data, name):
    """Suffix of a file, by its first bytes, as the program sees them; None for what it does not read."""
    for start, suffix in (
        (b"\x89PNG", ".png"),
        (b"\xff\xd8", ".jpg"),
        (b"v/1\x01", ".exr"),
        (b"#?", ".hdr"),
        (b"II*\0", ".tif"),
        (b"MM\0*", ".tif"),
        (b"BM", ".bmp"),
    ):
        if data.startswith(start):
            return suffix
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return ".webp"
    return ".tga" if os.path.splitext(name)[1].lower() == ".tga" else None


def _is_float_file(first_bytes, path):
    suffix = _suffix(first_bytes, path)
    if suffix == ".tif":
        return _tiff_is_float(first_bytes)
    return suffix in _FLOAT_SUFFIXES


def _tiff_is_float(data):
    """Whether a TIFF holds floats. A directory beyond the bytes at hand is taken to be one of integers.

    @source  TIFF 6.0, sections 2 and 19 (SampleFormat)
    """
    order = "<" if data.startswith(b"II") else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    if directory + 2 > len(data):
        return False
    (count,) = struct.unpack_from(order + "H", data, directory)
    for entry in range(directory + 2, min(directory + 2 + 12 * count, len(data) - 11), 12):
        tag, _, number, value = struct.unpack_from(order + "HHIH", data, entry)
        if tag == _TIFF_SAMPLE_FORMAT and number <= 2:
            return value == _TIFF_IEEE_FLOAT
    return False
