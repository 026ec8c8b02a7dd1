"""Image files made by hand: 8- and 16-bit PNG, Radiance HDR, and the lat-long environments in it.

A picture is a list of rows, top first, of tuples. Also the lattice noise that textures and shapes share.
"""

import math
import struct
import zlib

from . import vector


def png(rows, bits=8):
    """A PNG of rows of 1- to 4-tuples of integers of 8 or 16 bits (grey, grey+alpha, RGB, RGBA)."""
    color_type = {1: 0, 2: 4, 3: 2, 4: 6}[len(rows[0][0])]
    channels = len(rows[0][0]) * bits // 8  # bytes of a pixel
    previous = bytes(len(rows[0]) * channels)
    data = bytearray()
    for row in rows:
        line = b"".join(value.to_bytes(bits // 8, "big") for pixel in row for value in pixel)
        # PNG's filters 1 (left neighbour) and 2 (row above): the one with the smaller residuals packs better.
        left = bytes((line[i] - (line[i - channels] if i >= channels else 0)) & 255 for i in range(len(line)))
        above = bytes((a - b) & 255 for a, b in zip(line, previous))
        filtered = min((1, left), (2, above), key=lambda choice: sum(min(b, 256 - b) for b in choice[1]))
        data.append(filtered[0])
        data += filtered[1]
        previous = line

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), bits, color_type, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(data), 9))
        + chunk(b"IEND", b"")
    )


def height_map(height, size):
    """A square 16-bit PNG of height(u, v), both in [0, 1)."""
    centers = [(i + 0.5) / size for i in range(size)]
    rows = [[(round(65535 * min(max(height(u, v), 0.0), 1.0)),) for u in centers] for v in centers]
    return png(rows, bits=16)


def hdr(rows):
    """A run-length encoded Radiance HDR of rows of linear RGB floats; width from 8 to 32767."""
    width = len(rows[0])
    data = bytearray(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {len(rows)} +X {width}\n".encode())
    for row in rows:
        data += struct.pack(">BBH", 2, 2, width)
        pixels = [_rgbe(pixel) for pixel in row]
        for component in range(4):
            data += _run_length_encoded([pixel[component] for pixel in pixels])
    return bytes(data)


def _rgbe(pixel):
    """Three mantissas and a shared exponent, rounded to nearest."""
    largest = max(pixel)
    if largest < 1e-32:
        return (0, 0, 0, 0)
    exponent = math.frexp(largest)[1]
    if round(math.ldexp(largest, 8 - exponent)) > 255:
        exponent += 1
    return (*(round(math.ldexp(channel, 8 - exponent)) for channel in pixel), exponent + 128)


def _run_length_encoded(values):
    encoded = bytearray()
    i = 0
    while i < len(values):
        run = 1
        while i + run < len(values) and run < 127 and values[i + run] == values[i]:
            run += 1
        if run >= 4:
            encoded += bytes((128 + run, values[i]))
            i += run
            continue
        start = i
        while i < len(values) and i - start < 128 and len(set(values[i : i + 4])) > 1:
            i += 1
        if i == start:  # the tail of a row: fewer than four equal values
            i = min(len(values), start + 4)
        encoded += bytes((i - start, *values[start:i]))
    return encoded


def srgb_byte(linear):
    """The 8-bit sRGB code of a linear value."""
    linear = min(max(linear, 0.0), 1.0)
    code = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
    return int(code * 255 + 0.5)


def environment(radiance, width=256, height=128):
    """A lat-long HDR file of `radiance(direction)`, linear RGB, oriented as docs/scene_format.md says."""
    rows = []
    for y in range(height):
        theta = math.pi * (y + 0.5) / height
        row = []
        for x in range(width):
            phi = 2.0 * math.pi * ((x + 0.5) / width - 0.5)
            row.append(
                radiance(
                    (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
                )
            )
        rows.append(row)
    return hdr(rows)


def sky(horizon, zenith, ground):
    """Radiance of a clear sky: pale at the horizon, deeper above, one colour below."""

    def radiance(direction):
        height = direction[1]
        if height < 0:
            return vector.mix(horizon, ground, vector.smoothstep(0.0, 0.12, -height))
        return vector.mix(horizon, zenith, height**0.5)

    return radiance


def soft_box(center, half_width, half_height, color):
    """Radiance of a studio light: a rectangle seen under the given half angles (radians), soft at its rim."""
    z = vector.normalize(center)
    x = vector.normalize(vector.cross((0.0, 1.0, 0.0), z))
    y = vector.cross(z, x)

    def radiance(direction):
        depth = vector.dot(direction, z)
        if depth <= 0.05:
            return (0.0, 0.0, 0.0)
        across = abs(math.atan(vector.dot(direction, x) / depth)) / half_width
        along = abs(math.atan(vector.dot(direction, y) / depth)) / half_height
        mask = vector.smoothstep(1.05, 0.9, across) * vector.smoothstep(1.05, 0.9, along)
        return vector.scale(color, mask)

    return radiance


def layered(*layers):
    """The sum of several radiance functions."""

    def radiance(direction):
        total = (0.0, 0.0, 0.0)
        for layer in layers:
            total = vector.add(total, layer(direction))
        return total

    return radiance


def _lattice(x, y, z):
    """A hash of three integers, uniform in [0, 1)."""
    h = (x * 0x8DA6B343 + y * 0xD8163841 + z * 0xCB1AB31F) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    return ((h ^ (h >> 16)) & 0xFFFFFF) / 16777216.0


def noise(x, y, z, period=None):
    """Smooth lattice noise in [0, 1); with a period (integers per axis, 0 for none) it repeats."""
    ix, iy, iz = math.floor(x), math.floor(y), math.floor(z)
    fx, fy, fz = (t * t * (3.0 - 2.0 * t) for t in (x - ix, y - iy, z - iz))
    corners = []
    for dz in (0, 1):
        for dy in (0, 1):
            for dx in (0, 1):
                cell = (ix + dx, iy + dy, iz + dz)
                if period:
                    cell = tuple(c % p if p else c for c, p in zip(cell, period))
                corners.append(_lattice(*cell))
    along_x = [a + (b - a) * fx for a, b in zip(corners[0::2], corners[1::2])]
    along_y = [a + (b - a) * fy for a, b in zip(along_x[0::2], along_x[1::2])]
    return along_y[0] + (along_y[1] - along_y[0]) * fz


def fractal_noise(x, y, z, octaves):
    """Sum of octaves of `noise`, scaled to [0, 1)."""
    total, amplitude, norm = 0.0, 1.0, 0.0
    for octave in range(octaves):
        f = 2.0**octave
        total += amplitude * noise(x * f, y * f, z * f)
        norm += amplitude
        amplitude *= 0.5
    return total / norm
