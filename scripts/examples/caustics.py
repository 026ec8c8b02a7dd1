"""A tumbler of hammered glass and an amber ball with spiral ribs, both displaced, throw a small lamp's light on a table."""

import math

from . import images
from .gltf import Document, displaced, glass, lambert
from .meshes import Mesh, catmull_rom, lathe, swept, uv_sphere
from .vector import axis_angle, smoothstep

MAP_SIZE = 192
AROUND, CELLS_U, CELLS_V = 4, 4, 6  # repetitions of the map about the axis; bumps in each, and from foot to rim


def _bumps():
    """A point near the middle of each of CELLS_U × CELLS_V cells, every other row shifted, and how high its bump is."""
    return [
        (
            i + (0.5 if j % 2 else 0.0) + 0.30 * (images.noise(i, j, 3) - 0.5),
            j + 0.5 + 0.30 * (images.noise(i, j, 4) - 0.5),
            0.75 + 0.25 * images.noise(i, j, 5),
        )
        for i in range(CELLS_U)
        for j in range(CELLS_V)
    ]


BUMPS = _bumps()


def hammered(u, v):
    """Round bumps side by side, each a lens; the midlevel 0.5 at foot and rim, where other surfaces go on."""
    x, y = CELLS_U * u, CELLS_V * v
    height = 0.0
    for bump_x, bump_y, top in BUMPS:
        across = (x - bump_x + CELLS_U / 2) % CELLS_U - CELLS_U / 2
        squared = across * across + (y - bump_y) ** 2
        if squared < 1.0:
            height = max(height, top * (1.0 - squared) ** 2)
    inside = smoothstep(0.0, 0.06, v) * smoothstep(1.0, 0.94, v)
    return 0.5 + 0.5 * inside * height


def ribbed(u, v):
    """Ribs that wind from pole to pole, and end before they meet."""
    inside = smoothstep(0.03, 0.2, v) * smoothstep(0.97, 0.8, v)
    return 0.5 + 0.5 * inside * math.sin(2.0 * math.pi * (u + v))


def _tumbler():
    """Outside wall from foot to rim, and all that closes it: rim, inside, and the foot from below."""
    steps, segments = 9, 80
    foot, rim, height = 0.36, 0.44, 1.0
    wall = [(foot + (rim - foot) * i / steps, 0.04 + (height - 0.04) * i / steps) for i in range(steps + 1)]
    inside = [(rim, height), (rim - 0.012, height + 0.012), (rim - 0.03, height)]
    inside += [(rim - 0.03 - (rim - foot) * i / steps, height - 0.78 * i / steps) for i in range(1, steps + 1)]
    inside += [(foot - 0.07, 0.185), (foot - 0.14, 0.165), (0.1, 0.155), (0.0, 0.155)]
    below = [(0.0, 0.0), (foot - 0.04, 0.0), (foot - 0.012, 0.012), (foot, 0.04)]
    return [lathe(profile, segments) for profile in (wall, catmull_rom(inside, 2), below)]


def _ball():
    segments, rings = 56, 28
    mesh = uv_sphere(1.0, segments, rings)
    mesh.uvs = [(s / segments, r / rings) for r in range(rings + 1) for s in range(segments + 1)]
    return mesh


def build():
    document = Document(
        "caustics", {"resolution": [640, 360], "samples": 32, "maxBounces": 12, "transmissionBounces": 12}
    )
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [0.09, 0.11, 0.15]}

    table = lambert("table", (0.5, 0.42, 0.34))
    bend = [(3.0 * math.sin(a), 3.0 - 3.0 * math.cos(a)) for a in (math.pi / 2 * i / 12 for i in range(13))]
    profile = [(6.0, 0.0), *((-5.0 - z, y) for z, y in bend), (-8.0, 8.0)]
    document.add_node("table", mesh=document.add_mesh("table", swept(profile, 12.0), document.add_material(table)))

    bumps = document.add_texture("hammered.png", images.height_map(hammered, MAP_SIZE))
    wall, inside, below = _tumbler()
    # A millimetre above the table: two surfaces in one plane would be a draw.
    place = {"translation": [0.45, 0.001, 0.0]}
    walls = displaced(glass("hammered"), bumps, 0.026, 0.5, (AROUND, 1), smoothing=True)
    document.add_node("wall", mesh=document.add_mesh("wall", wall, document.add_material(walls)), **place)
    plain = document.add_material(glass("clear"))
    document.add_node("inside", mesh=document.add_mesh("inside", inside, plain), **place)
    document.add_node("foot", mesh=document.add_mesh("foot", below, plain), **place)

    ribs = document.add_texture("ribs.png", images.height_map(ribbed, 64))
    amber = displaced(glass("amber", 1.5, 0.0, (0.95, 0.5, 0.1), 0.35), ribs, 0.10, 0.5, (12, 1), smoothing=True)
    document.add_node(
        "ball",
        mesh=document.add_mesh("ball", _ball(), document.add_material(amber)),
        translation=[-0.62, 0.335, 0.25],
        rotation=list(axis_angle((0.0, 0.0, 1.0), 24.0)),
        scale=[0.32] * 3,
    )

    document.add_area_light("lamp", (2.5, 3.0, -3.9), (-0.3, 0.0, 1.2), 0.08, 0.08, (20000, 18600, 16600))
    document.add_camera((-0.15, 2.3, 4.3), (-0.15, 0.22, 0.35), 29)
    return document
