# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender says of an image, from the bytes of its file: asking Blender has it decode the whole, for nothing where the
program reads the file itself (8192² texels of 16 bits are a second and a gigabyte)."""

import os
import struct
import zlib
from dataclasses import dataclass

import bpy
import numpy as np

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_GREY, _PNG_PALETTE, _PNG_GREY_ALPHA, _PNG_RGBA = 0, 3, 4, 6

_TIFF_BITS, _TIFF_SAMPLE_FORMAT, _TIFF_IEEE_FLOAT = 258, 339, 3
_TIFF_EXTRA_SAMPLES, _TIFF_ASSOCIATED = 338, 1

_FLOAT_SUFFIXES = {".exr", ".hdr"}

#: Bit of the version field of OpenEXR files with several parts.
_EXR_MULTIPART = 1 << 12

#: Of a file whose head is looked at.
_HEAD_BYTES = 4096


@dataclass(frozen=True)
class Header:
    """Of an image's file.

    channels  that Blender has of it
    is_float  whether Blender keeps it as floats
    """

    channels: int
    is_float: bool


def file_head(image):
    """First bytes of an image's file, packed or not, or of the first of several; empty without one."""
    if image.packed_file is not None:
        return image.packed_file.data[:_HEAD_BYTES]
    path = bpy.path.abspath(image.filepath, library=image.library)
    if not os.path.isfile(path):
        return b""
    with open(path, "rb") as file:
        return file.read(_HEAD_BYTES)


def image_header(image):
    """Header of an image, without decoding what its file tells."""
    found = None
    if image.source == "FILE" and not image.is_dirty:
        found = read_header(file_head(image), image.filepath)
    return found or Header(image.channels, image.is_float)


def read_header(head, path):
    """Header by the first bytes of a file; None: they do not tell.

    Blender widens whatever it reads to four channels; of files with several layers it has those of one.
    """
    kind = suffix(head, path)
    if kind is None or kind == ".exr" and not _exr_has_one_layer(head):
        return None
    if kind == ".png":
        return Header(4, len(head) > 24 and head[24] == 16)
    if kind == ".tif":
        bits = tiff_value(head, _TIFF_BITS)
        return None if bits is None else Header(4, bits > 8)
    return Header(4, kind in _FLOAT_SUFFIXES)


def suffix(data, name):
    """Suffix of a file, by its first bytes, as the program sees them; None for what it does not read."""
    for start, kind in (
        (b"\x89PNG", ".png"),
        (b"\xff\xd8", ".jpg"),
        (b"v/1\x01", ".exr"),
        (b"#?", ".hdr"),
        (b"II*\0", ".tif"),
        (b"MM\0*", ".tif"),
        (b"BM", ".bmp"),
    ):
        if data.startswith(start):
            return kind
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return ".webp"
    return ".tga" if os.path.splitext(name)[1].lower() == ".tga" else None


def is_float_file(head, path):
    kind = suffix(head, path)
    if kind == ".tif":
        return tiff_value(head, _TIFF_SAMPLE_FORMAT) == _TIFF_IEEE_FLOAT
    return kind in _FLOAT_SUFFIXES


def is_associated_file(head, path):
    """Whether a file's colours are multiplied by its alpha."""
    kind = suffix(head, path)
    if kind == ".tif":
        return tiff_value(head, _TIFF_EXTRA_SAMPLES) == _TIFF_ASSOCIATED
    # OpenImageIO, and so Cycles, takes WebP's colours for multiplied, which they are not.
    return kind in _FLOAT_SUFFIXES or kind == ".webp"


def is_grey_file(head):
    """Whether a file has no colours, by its first bytes; of other formats than PNG nothing is known."""
    return head.startswith(_PNG) and len(head) > 25 and head[25] in {_PNG_GREY, _PNG_GREY_ALPHA}


def may_have_alpha(head):
    """Whether a file can have transparent pixels, by its first bytes."""
    if head.startswith(_PNG) and len(head) > 25:
        return head[25] in {_PNG_GREY_ALPHA, _PNG_RGBA} or any(kind == b"tRNS" for kind, _ in _png_chunks(head))
    return not head.startswith((b"\xff\xd8", b"#?"))


def png_is_opaque(data):
    """Whether all pixels of a PNG with an alpha channel are opaque; None: its bytes do not tell so easily.

    No pixel is decoded: as long as all alphas are 255, what a filter predicts of the next one is known, and so is what
    remains of it in the file.

    @source  PNG (third edition), section 9: filters
    """
    if not data.startswith(_PNG) or len(data) < 29:
        return None
    width, height, depth, color, _, _, interlace = struct.unpack_from(">IIBBBBB", data, 16)
    if color not in {_PNG_GREY_ALPHA, _PNG_RGBA} or interlace or depth not in {8, 16} or not width * height:
        return None
    alpha_bytes = depth // 8
    pixel = alpha_bytes * (2 if color == _PNG_GREY_ALPHA else 4)
    row_bytes = 1 + width * pixel
    inflate = zlib.decompressobj()
    rest, number = b"", 0
    try:
        for kind, body in _png_chunks(data):
            if kind != b"IDAT":
                continue
            while body and number < height:
                rest += inflate.decompress(body, max(1 << 22, row_bytes))
                body = inflate.unconsumed_tail
                count = min(len(rest) // row_bytes, height - number)
                rows = np.frombuffer(rest, np.uint8, count * row_bytes).reshape(count, row_bytes)
                if not _rows_are_opaque(rows, number == 0, pixel, alpha_bytes):
                    return False
                rest, number = rest[count * row_bytes :], number + count
    except zlib.error:
        return None
    return True if number == height else None


#: What is left of an opaque alpha by filter: in the first column of the first row, in others of the first row, in the first
#: column of other rows, and elsewhere.
_OPAQUE_LEFT = np.array(
    [[255, 255, 255, 255], [255, 0, 255, 0], [255, 255, 0, 0], [255, 128, 128, 0], [255, 0, 0, 0]], dtype=np.uint8
)


def _rows_are_opaque(rows, has_first, pixel, alpha_bytes):
    """Whether rows of filtered bytes are opaque, if all before them are.

    @param  rows  uint8 (rows, 1 + bytes), each after its filter's number
    """
    if len(rows) == 0:
        return True
    filters = rows[:, 0]
    if (filters >= len(_OPAQUE_LEFT)).any():
        return False
    expected = _OPAQUE_LEFT[filters]
    if has_first:
        expected[0, 2:] = expected[0, :2]
    texels = rows[:, 1:].reshape(len(rows), -1, pixel)
    for byte in range(pixel - alpha_bytes, pixel):
        alpha = texels[:, :, byte]
        if (alpha[:, 0] != expected[:, 2]).any() or (alpha[:, 1:] != expected[:, 3:]).any():
            return False
    return True


def _png_chunks(data):
    """(kind, bytes) of a PNG's chunks, as far as they are whole."""
    place = len(_PNG)
    while place + 8 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        if place + 8 + size > len(data):
            return
        yield data[place + 4 : place + 8], data[place + 8 : place + 8 + size]
        place += 12 + size


def tiff_value(data, wanted):
    """The first number of a TIFF's tag; None: it has none, or its directory is beyond the bytes at hand.

    @source  TIFF 6.0, sections 2, 18 (ExtraSamples) and 19 (SampleFormat)
    """
    order = "<" if data.startswith(b"II") else ">"
    if len(data) < 8:
        return None
    (directory,) = struct.unpack_from(order + "I", data, 4)
    if directory + 2 > len(data):
        return None
    (count,) = struct.unpack_from(order + "H", data, directory)
    for entry in range(directory + 2, min(directory + 2 + 12 * count, len(data) - 11), 12):
        tag, kind, number, value = struct.unpack_from(order + "HHIH", data, entry)
        if tag != wanted:
            continue
        if number <= 2:
            return value
        # More shorts than fit stand elsewhere.
        (place,) = struct.unpack_from(order + "I", data, entry + 8)
        return struct.unpack_from(order + "H", data, place)[0] if kind == 3 and place + 2 <= len(data) else None
    return None


def _exr_has_one_layer(head):
    """Whether an OpenEXR file has one part of one layer, by its first bytes.

    @source  OpenEXR File Layout: version field, header, channel list
    """
    if len(head) < 8 or struct.unpack_from("<I", head, 4)[0] & _EXR_MULTIPART:
        return False
    place = 8
    while (end := head.find(b"\0", place)) > place:
        name = head[place:end]
        kind_end = head.find(b"\0", end + 1)
        if kind_end < 0 or kind_end + 5 > len(head):
            return False
        (size,) = struct.unpack_from("<I", head, kind_end + 1)
        place = kind_end + 5
        if name == b"channels":
            return _exr_channel_names(head[place : place + size]) <= {b"R", b"G", b"B", b"A", b"Y"}
        place += size
    return False


def _exr_channel_names(channels):
    """Names of a channel list."""
    names, place = set(), 0
    while (end := channels.find(b"\0", place)) > place:
        names.add(channels[place:end])
        place = end + 1 + 16
    return names
