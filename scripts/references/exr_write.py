"""Writes a reference as an OpenEXR file: float channels R, G, B and variance.R, variance.G, variance.B, ZIP compressed.

@source  OpenEXR file layout, https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

import struct
import zlib

import numpy as np

_ROWS_PER_BLOCK = 16
_ZIP = 3
_FLOAT = 2


def write_reference(path, mean, variance, attributes):
    """
    @param  mean, variance  arrays of shape (height, width, 3), row 0 the top one
    @param  attributes      text by name
    """
    layers = {f"{c}": mean[..., i] for i, c in enumerate("RGB")}
    layers |= {f"variance.{c}": variance[..., i] for i, c in enumerate("RGB")}
    write_exr(path, layers, attributes)


def rounded_to_noise(mean, variance):
    """Mean and variance without the bits that say nothing, which a file cannot compress.

    The mean is rounded to half of its standard error or less, the variance of few runs to a quarter of itself.
    """

    def rounded(values, unit):
        exact = ~((unit > 0) & np.isfinite(unit))
        step = np.exp2(np.floor(np.log2(np.where(exact, 1, unit))))
        return np.where(exact, values, np.rint(values / step) * step)

    return rounded(mean, np.sqrt(variance) / 2), rounded(variance, variance / 4)


def write_exr(path, channels, attributes=None):
    """Any float channels of one shape (height, width), by name."""
    names = sorted(channels)
    height, width = channels[names[0]].shape
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(n.encode() + b"\0" + struct.pack("<iB3xii", _FLOAT, 0, 1, 1) for n in names) + b"\0"
    header = b"".join(
        [
            _attribute("channels", "chlist", listed),
            _attribute("compression", "compression", bytes([_ZIP])),
            _attribute("dataWindow", "box2i", window),
            _attribute("displayWindow", "box2i", window),
            _attribute("lineOrder", "lineOrder", b"\0"),
            _attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            _attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            _attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
            *(_attribute(name, "string", text.encode()) for name, text in sorted((attributes or {}).items())),
            b"\0",
        ]
    )
    # Bit 10 of the version allows names longer than 31 characters.
    start = struct.pack("<II", 20000630, 2 | 0x400) + header
    blocks = []
    for y in range(0, height, _ROWS_PER_BLOCK):
        rows = range(y, min(y + _ROWS_PER_BLOCK, height))
        raw = b"".join(channels[n][row].astype("<f4").tobytes() for row in rows for n in names)
        packed = _deflated(raw)
        data = packed if len(packed) < len(raw) else raw
        blocks.append(struct.pack("<ii", y, len(data)) + data)
    offset = len(start) + 8 * len(blocks)
    offsets = []
    for block in blocks:
        offsets.append(offset)
        offset += len(block)
    with open(path, "wb") as file:
        file.write(start + struct.pack(f"<{len(offsets)}Q", *offsets) + b"".join(blocks))


def _attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def _deflated(raw):
    """OpenEXR's ZIP: even bytes, then odd bytes, as differences from the byte before, deflated."""
    data = np.frombuffer(raw, np.uint8)
    data = np.concatenate([data[0::2], data[1::2]]).astype(np.int16)
    data[1:] = data[1:] - data[:-1] + 128
    return zlib.compress((data & 255).astype(np.uint8).tobytes(), 9)
