"""A woven sphere on cobblestones: two small height maps, repeated many times over few triangles, under a low sun."""

import math

from . import images
from .gltf import Document, dielectric, displaced, lambert
from .meshes import ground, uv_sphere
from .vector import axis_angle, smoothstep

MAP_SIZE = 256
WEAVE_TILES = (12, 6)
COBBLE_TILES = (10, 10)


def _strand(across, along):
    """Height of a round strand that dips below the next one; 0 between strands."""
    profile = 1.0 - (2.0 * across - 1.0) ** 2
    return math.sqrt(max(profile, 0.0)) * (0.55 + 0.45 * math.cos(math.pi * along))


def weave(u, v):
    """Four strands each way, over and under one another."""
    x, y = 4.0 * u, 4.0 * v
    column, row = math.floor(x), math.floor(y)
    lengthwise = _strand(y - row, x - 0.5 + row)
    crosswise = _strand(x - column, y + 0.5 + column)
    return max(lengthwise, crosswise)


def _stones(cells):
    """A point in each of cells × cells squares, away from their borders, and how high its stone is."""
    return {
        (i, j): (
            i + 0.12 + 0.76 * images.noise(i, j, 0),
            j + 0.12 + 0.76 * images.noise(i, j, 1),
            images.noise(i, j, 2),
        )
        for i in range(cells)
        for j in range(cells)
    }


CELLS = 6
STONES = _stones(CELLS)


def cobbles(u, v):
    """Rounded stones around scattered points, each of its own height, with gaps where two are equally near."""
    x, y = CELLS * u, CELLS * v
    nearest = []
    for i in range(math.floor(x) - 2, math.floor(x) + 3):
        for j in range(math.floor(y) - 2, math.floor(y) + 3):
            px, py, top = STONES[i % CELLS, j % CELLS]
            distance = math.hypot(px + (i - i % CELLS) - x, py + (j - j % CELLS) - y)
            nearest.append((distance, top))
    nearest.sort()
    (first, top), (second, _) = nearest[:2]
    rise = smoothstep(0.02, 0.30, second - first) ** 0.5
    grain = images.noise(64 * u, 64 * v, 0.5, (64, 64, 0))
    return rise * (0.55 + 0.35 * top - 0.15 * first) + 0.05 * grain


def _sphere():
    segments, rings = 32, 16
    mesh = uv_sphere(1.0, segments, rings)
    mesh.uvs = [(s / segments, r / rings) for r in range(rings + 1) for s in range(segments + 1)]
    return mesh


def build():
    document = Document("displaced", {"resolution": [768, 432], "samples": 64, "maxBounces": 4})
    sky = images.sky(horizon=(0.95, 0.86, 0.76), zenith=(0.12, 0.25, 0.55), ground=(0.2, 0.18, 0.15))
    document.set_environment("sky.hdr", images.environment(sky), strength=0.7)
    document.add_sun((-0.75, 0.55, 0.45), (5.4, 4.5, 3.4))

    stone = lambert("cobbles", (0.24, 0.225, 0.21))
    cobble_map = document.add_texture("cobbles.png", images.height_map(cobbles, MAP_SIZE))
    stone = displaced(stone, cobble_map, 0.22, 0.5, COBBLE_TILES, smoothing=True)
    document.add_node("ground", mesh=document.add_mesh("ground", ground(20.0, 8), document.add_material(stone)))

    wicker = dielectric("wicker", (0.42, 0.20, 0.07), 0.45)
    weave_map = document.add_texture("weave.png", images.height_map(weave, MAP_SIZE))
    wicker = displaced(wicker, weave_map, 0.09, 0.5, WEAVE_TILES)
    # The poles, where the strands run together, are at the sides.
    document.add_node(
        "ball",
        mesh=document.add_mesh("ball", _sphere(), document.add_material(wicker)),
        translation=[0, 1.08, 0],
        rotation=list(axis_angle((0.0, 0.0, 1.0), 64.0)),
    )
    document.add_camera((0.4, 2.2, 6.2), (0.15, 0.95, 0), 28)
    return document
