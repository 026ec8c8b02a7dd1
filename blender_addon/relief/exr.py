# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files as relief writes them without compression, and as it reads converted images: one scanline part.

Blender's own reader knows pictures, not layers with their own meaning (counts, ids, variances), and would go through
an image datablock.

@source  OpenEXR file layout, https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

import struct

import numpy as np

from .report import ReliefError

_MAGIC = 20000630
_LONG_NAMES = 0x400
_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
_CODES = {dtype: code for code, dtype in _TYPES.items()}


class Picture:
    """Channels of one picture.

    width, height  pixels of the data window
    channels       float32 arrays of shape (height, width) by full channel name; row 0 is the bottom, as in Blender
    attributes     texts and numbers of the header by name
    """

    def __init__(self, width, height, channels, attributes):
        self.width = width
        self.height = height
        self.channels = channels
        self.attributes = attributes

    def layer(self, *names):
        """Channels side by side: float32 of shape (pixels, channels), bottom row first; None if one is missing."""
        if any(name not in self.channels for name in names):
            return None
        return np.stack([self.channels[name].ravel() for name in names], axis=-1)


#: What attributes of a kind are, from their bytes.
_ATTRIBUTES = {
    "string": lambda value: value.decode("utf-8", "replace"),
    "int": lambda value: struct.unpack("<i", value)[0],
    "float": lambda value: struct.unpack("<f", value)[0],
    "double": lambda value: struct.unpack("<d", value)[0],
}


def read(path):
    """Reads all channels of an uncompressed file.

    @error  ReliefError if it is not one, or shorter than its header says
    """
    with open(path, "rb") as file:
        data = file.read()
    try:
        return _parse(data)
    except (struct.error, ValueError, KeyError, IndexError) as cause:
        raise ReliefError(f"{path}: not an uncompressed scanline OpenEXR ({cause})") from cause


def _parse(data):
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or version & ~0xFF & ~_LONG_NAMES:
        raise ValueError("wrong first bytes")
    header, position = _parse_header(data)
    if header["compression"][1] != b"\0":
        raise ValueError("compressed")
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"][1])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    # A scanline: its y, its size, then all values of the first channel, of the second, …
    row = np.dtype(
        [("y", "<i4"), ("size", "<i4")]
        + [(name, dtype, (width,)) for name, dtype in _parse_channels(header["channels"][1])]
    )
    (first,) = struct.unpack_from("<Q", data, position)
    rows = np.frombuffer(data, row, height, first)
    if not np.array_equal(rows["y"], np.arange(y0, y1 + 1)):
        raise ValueError("scanlines out of order")
    channels = {name: rows[name][::-1].astype(np.float32) for name in row.names[2:]}
    attributes = {name: _ATTRIBUTES[kind](value) for name, (kind, value) in header.items() if kind in _ATTRIBUTES}
    return Picture(width, height, channels, attributes)


def _parse_header(data):
    """({name: (type, bytes)}, offset of what follows)."""
    position, header = 8, {}
    while data[position] != 0:
        name, position = _parse_text(data, position)
        kind, position = _parse_text(data, position)
        (size,) = struct.unpack_from("<i", data, position)
        header[name] = (kind, data[position + 4 : position + 4 + size])
        position += 4 + size
    return header, position + 1


def _parse_text(data, position):
    end = data.index(b"\0", position)
    return data[position:end].decode("utf-8", "replace"), end + 1


def _parse_channels(data):
    """[(name, dtype)] in the order of the file."""
    channels, position = [], 0
    while data[position] != 0:
        name, position = _parse_text(data, position)
        kind, _, x_sampling, y_sampling = struct.unpack_from("<4i", data, position)
        if (x_sampling, y_sampling) != (1, 1):
            raise ValueError(f"channel {name} is subsampled")
        channels.append((name, _TYPES[kind]))
        position += 16
    return channels


def encode(channels):
    """An uncompressed OpenEXR file.

    @param  channels  arrays of shape (height, width) by name, float16 or float32, row 0 the top one
    @return           bytes of the file
    """
    names = sorted(channels)
    height, width = channels[names[0]].shape
    listing = b"".join(
        name.encode() + b"\0" + struct.pack("<4i", _CODES[channels[name].dtype.newbyteorder("<")], 0, 1, 1)
        for name in names
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = (
        ("channels", "chlist", listing + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    )
    header = struct.pack("<II", _MAGIC, 2)
    for name, kind, value in attributes:
        header += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    row = np.dtype([("y", "<i4"), ("size", "<i4")] + [(name, channels[name].dtype, (width,)) for name in names])
    rows = np.empty(height, row)
    rows["y"] = np.arange(height)
    rows["size"] = row.itemsize - 8
    for name in names:
        rows[name] = channels[name]
    first = len(header) + 8 * height
    offsets = first + row.itemsize * np.arange(height, dtype="<u8")
    return header + offsets.astype("<u8").tobytes() + rows.tobytes()
