"""Height maps as functions of (u, v) that repeat after 1, made with numpy, and the 16-bit PNG they are stored in.

A map takes u of shape (1, n) and v of shape (m, 1) and returns heights of shape (m, n) in 0…1, so that a band of rows
can be made at a time: a map of 16k × 16k never exists as floating point numbers.
"""

import struct
import zlib

import numpy as np

_ROWS_PER_BAND = 128


def encode_png(height, size):
    """A 16-bit grey PNG of `height(u, v)` at the centres of size × size texels, row 0 at v = 0."""
    u = ((np.arange(size, dtype=np.float32) + 0.5) / size)[None, :]
    packer = zlib.compressobj(1)
    body = []
    previous = np.zeros((1, 2 * size), np.uint8)
    for first in range(0, size, _ROWS_PER_BAND):
        last = min(first + _ROWS_PER_BAND, size)
        v = ((np.arange(first, last, dtype=np.float32) + 0.5) / size)[:, None]
        texels = np.rint(np.clip(height(u, v), 0, 1) * 65535).astype(">u2")
        lines = np.ascontiguousarray(np.broadcast_to(texels, (last - first, size))).view(np.uint8)
        above = np.concatenate([previous, lines[:-1]])
        # Filter 2, the difference from the row above, is one subtraction for all rows.
        filters = np.full((len(lines), 1), 2, np.uint8)
        body.append(packer.compress(np.concatenate([filters, lines - above], axis=1).tobytes()))
        previous = lines[-1:]
    body.append(packer.flush())

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", size, size, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"".join(body)) + chunk(b"IEND", b"")


def _smooth_step(low, high, x):
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _lattice(period, seed, count=1):
    """`count` uniform random numbers at each point of a lattice, shape (count, period, period)."""
    return np.random.default_rng(seed).random((count, period, period), dtype=np.float32)


def noise(u, v, period, seed):
    """Smooth noise in 0…1 through random heights at period × period lattice points."""
    heights = _lattice(period, seed)[0]
    x, y = u.ravel() * period, v.ravel() * period
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = _smooth_step(0, 1, x - i), _smooth_step(0, 1, y - j)[:, None]
    # Rows of the lattice first: they are few, and each is needed by many rows of texels.
    first = j.min()
    needed = heights[np.arange(first, j.max() + 2) % period]
    along_u = needed[:, i % period] * (1 - fx) + needed[:, (i + 1) % period] * fx
    return along_u[j - first] * (1 - fy) + along_u[j - first + 1] * fy


def octaves(u, v, period, count, gain, seed, shape=lambda n: n):
    """Noise at `count` scales, each twice as fine as the one before and `gain` times as high; in 0…1."""
    total, weight, whole = 0.0, 1.0, 0.0
    for octave in range(count):
        total = total + weight * shape(noise(u, v, period << octave, seed + octave))
        whole += weight
        weight *= gain
    return total / whole


def _dome(distance, radius):
    return np.sqrt(np.maximum(0, 1 - (distance / radius) ** 2))


def _scattered_domes(u, v, period, seed):
    """The highest of half balls, one a lattice cell, each of its own place and size."""
    shift_x, shift_y, size = _lattice(period, seed, 3)
    x, y = u * period, v * period
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    highest = np.zeros((v.size, u.size), np.float32)
    for dj in (-1, 0, 1):
        for di in (-1, 0, 1):
            cell = (j + dj) % period, (i + di) % period
            distance = np.hypot(i + di + 0.25 + 0.5 * shift_x[cell] - x, j + dj + 0.25 + 0.5 * shift_y[cell] - y)
            radius = 0.3 + 0.4 * size[cell]
            highest = np.maximum(highest, radius * _dome(distance, radius))
    return highest


def domes(u, v):
    """Large and small knobs on a rough skin; flat along v = 0, so that a sphere's poles close."""
    height = 0.75 * _scattered_domes(u, v, 5, 1) + 0.3 * _scattered_domes(u, v, 19, 2)
    height = height + 0.08 * octaves(u, v, 32, 5, 0.5, 3)
    return height * _smooth_step(0.003, 0.04, np.minimum(v, 1 - v))


def weave(u, v):
    """Eight strands each way, over and under one another, of twisted fibres."""
    x, y = 8 * u, 8 * v
    column, row = np.floor(x), np.floor(y)

    def strand(across, along, turns, fuzz):
        arch = _dome(across - 0.5, 0.47) * (0.6 + 0.34 * np.cos(np.pi * along))
        twist = np.sin(2 * np.pi * (6 * across + turns))
        return np.where(arch > 0, arch + 0.02 * twist + 0.03 * (fuzz - 0.5), 0)

    lengthwise = strand(y - row, x - 0.5 + row, 4 * x, noise(u, v, 512, 4))
    crosswise = strand(x - column, y + 0.5 + column, 4 * y, noise(u, v, 256, 5))
    return np.maximum(lengthwise, crosswise)


def rock(u, v):
    """Ridges on ridges, down to eight texels of a 4k map."""
    return octaves(u, v, 4, 8, 0.52, 50, lambda n: 1 - np.abs(2 * n - 1)) ** 1.5


def cliffs(u, v):
    """Terraced ridges with detail down to four texels of a 16k map."""
    ridges = octaves(u, v, 4, 11, 0.5, 70, lambda n: 1 - np.abs(2 * n - 1))
    steps = 9 * ridges
    step = np.floor(steps)
    return 0.6 * ridges + 0.4 * (step + _smooth_step(0.6, 1, steps - step)) / 9
