"""Reads the colours of an OpenEXR file into numpy, so that the comparison needs no image library.

Understands one scanline part, uncompressed or ZIP compressed, half or float channels: what Blender and relief write.

@source  OpenEXR file layout, https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

import struct
import zlib

import numpy as np

_MAGIC = 20000630
_ROWS_PER_BLOCK = {0: 1, 2: 1, 3: 16}  # by compression: none, ZIPS, ZIP
_CHANNEL_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


class ExrError(Exception):
    """Not an EXR file, or one of a kind that is not read here."""


def read_rgb(path, layer=""):
    """The layer of the channels R, G, B; of a named one, `layer.R` and so on.

    @return  float64 array of shape (height, width, 3), row 0 the top one; linear values as stored
    @error   ExrError with the path and what was found
    """
    with open(path, "rb") as file:
        data = file.read()
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or version & ~0xFF & ~0x400:  # 0x400: long names
        raise ExrError(f"{path}: not a single-part scanline EXR")
    attributes, position = _read_header(data)
    compression = attributes["compression"][0]
    if compression not in _ROWS_PER_BLOCK:
        raise ExrError(f"{path}: compression {compression}, expected none, ZIPS or ZIP")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels = _read_channels(attributes["channels"])
    row_bytes = sum(dtype.itemsize for _, dtype in channels) * width
    wanted = [f"{layer}.{c}" if layer else c for c in "RGB"]
    pixels = {name: np.empty((height, width)) for name, _ in channels if name in wanted}
    if len(pixels) != 3:
        raise ExrError(f"{path}: no channels {', '.join(wanted)}")

    rows_per_block = _ROWS_PER_BLOCK[compression]
    num_blocks = -(-height // rows_per_block)
    for offset in struct.unpack_from(f"<{num_blocks}Q", data, position):
        y, size = struct.unpack_from("<ii", data, offset)
        first = y - y0
        num_rows = min(rows_per_block, height - first)
        block = data[offset + 8 : offset + 8 + size]
        if size < num_rows * row_bytes:  # a block that would grow is stored as it is
            block = _inflate(block)
        start = 0
        for row in range(first, first + num_rows):
            for name, dtype in channels:
                if name in pixels:
                    pixels[name][row] = np.frombuffer(block, dtype, width, start)
                start += dtype.itemsize * width
    return np.stack([pixels[name] for name in wanted], axis=-1)


def _read_string(data, position):
    end = data.index(b"\0", position)
    return data[position:end].decode(), end + 1


def _read_header(data):
    """Attributes as {name: bytes}, and the position behind the header."""
    attributes, position = {}, 8
    while data[position] != 0:
        name, position = _read_string(data, position)
        _, position = _read_string(data, position)
        (size,) = struct.unpack_from("<i", data, position)
        attributes[name] = data[position + 4 : position + 4 + size]
        position += 4 + size
    return attributes, position + 1


def _read_channels(data):
    """[(name, dtype)] in file order."""
    channels, position = [], 0
    while data[position] != 0:
        name, position = _read_string(data, position)
        pixel_type, _, sampling_x, sampling_y = struct.unpack_from("<iiii", data, position)
        if (sampling_x, sampling_y) != (1, 1):
            raise ExrError(f"channel {name} is subsampled")
        channels.append((name, _CHANNEL_TYPES[pixel_type]))
        position += 16
    return channels


def _inflate(block):
    """Undoes ZIP compression: inflate, add up the differences of bytes, interleave the two halves."""
    packed = np.frombuffer(zlib.decompress(block), np.uint8)
    differences = packed.astype(np.int64)
    differences[1:] -= 128
    total = (np.cumsum(differences) & 255).astype(np.uint8)
    result = np.empty_like(total)
    half = (len(total) + 1) // 2
    result[0::2] = total[:half]
    result[1::2] = total[half:]
    return result.tobytes()
