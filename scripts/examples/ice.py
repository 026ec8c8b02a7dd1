"""A block of ice whose top is displaced: each bump is a lens, and what it focuses is seen as a shaft of light in the cloudy ice."""

import math

from . import images
from .gltf import Document, dielectric, displaced, glass, lambert
from .meshes import Mesh, ground, quad, uv_sphere
from .vector import smoothstep

MAP_SIZE = 192
TILES = (4, 2)
CELLS = 2  # bumps along each side of a tile
MARGIN = 0.03  # of a tile: there the map is flat, so that tiles meet, and the block's sides close with its top


def _bumps():
    """Of each cell a point near its middle, how wide its bump is, and how high."""
    return [
        (
            i + 0.5 + 0.34 * (images.noise(i, j, 6) - 0.5),
            j + 0.5 + 0.34 * (images.noise(i, j, 7) - 0.5),
            0.60 + 0.25 * images.noise(i, j, 8),
            0.45 + 0.55 * images.noise(i, j, 9),
        )
        for i in range(CELLS)
        for j in range(CELLS)
    ]


BUMPS = _bumps()


def melted(u, v):
    """Round bumps that melt into each other, and nothing at a tile's border."""
    x, y = CELLS * u, CELLS * v
    height = 0.0
    for bump_x, bump_y, radius, top in BUMPS:
        squared = ((x - bump_x) ** 2 + (y - bump_y) ** 2) / radius**2
        if squared < 1.0:
            height += top * (1.0 - squared) ** 2
    inside = 1.0
    for t in (u, v):
        inside *= smoothstep(MARGIN, 0.14, t) * smoothstep(1.0 - MARGIN, 0.86, t)
    return min(1.0, 0.8 * height) * inside


def _block(size):
    """A closed box, whose sides have the flat margin of the map: they stay where they are."""
    x, y, z = size[0] / 2, size[1], size[2] / 2
    top = quad((-x, y, z), (2 * x, 0, 0), (0, 0, -2 * z))
    top.uvs = [(0, TILES[1]), (TILES[0], TILES[1]), (TILES[0], 0), (0, 0)]
    sides = [
        quad((-x, 0, z), (2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, -z), (-2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, z), (0, 0, -2 * z), (0, y, 0)),
        quad((-x, 0, -z), (0, 0, 2 * z), (0, y, 0)),
        quad((-x, 0, -z), (2 * x, 0, 0), (0, 0, 2 * z)),
    ]
    flat = 0.5 * MARGIN
    mesh = Mesh(list(top.positions), list(top.triangles), [], list(top.uvs))
    for side in sides:
        first = len(mesh.positions)
        mesh.positions += side.positions
        mesh.triangles += [tuple(first + i for i in triangle) for triangle in side.triangles]
        mesh.uvs += [(0.2 * flat, 0.2 * flat), (flat, 0.2 * flat), (flat, flat), (0.2 * flat, flat)]
    normals = [(0.0, 1.0, 0.0)] * 4
    for normal in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)):
        normals += [normal] * 4
    mesh.normals = normals
    return mesh


def _ball():
    return uv_sphere(1.0, 48, 24)


def build():
    document = Document(
        "ice", {"resolution": [640, 360], "samples": 16, "maxBounces": 8, "transmissionBounces": 8, "volumeBounces": 2}
    )
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [0.018, 0.03, 0.05]}
    document.add_sun((-0.45, 1.0, -0.42), (15.0, 14.0, 12.4))

    slate = lambert("slate", (0.02, 0.021, 0.024))
    document.add_node("table", mesh=document.add_mesh("table", ground(12.0, 2), document.add_material(slate)))

    heights = document.add_texture("melted.png", images.height_map(melted, MAP_SIZE))
    ice = displaced(glass("ice", 1.31), heights, 0.09, 0.0, smoothing=True)
    ice["extensions"]["RELIEF_volume"] = {
        "closures": [
            {"type": "scatter", "color": [1, 1, 1], "density": 0.20, "anisotropy": 0.5},
            {"type": "absorption", "color": [0.35, 0.85, 0.95], "density": 0.35},
        ]
    }
    # A millimetre above the table: two surfaces in one plane would be a draw.
    document.add_node(
        "ice", mesh=document.add_mesh("ice", _block((2.2, 1.0, 1.2)), document.add_material(ice)), translation=[0, 0.001, 0]
    )

    stone = document.add_mesh("stone", _ball(), document.add_material(dielectric("stone", (0.5, 0.07, 0.04), 0.5)))
    for i, (x, y, z, r) in enumerate(((-0.42, 0.42, 0.1, 0.13), (0.5, 0.3, -0.15, 0.16), (0.1, 0.62, 0.25, 0.07))):
        document.add_node(f"stone {i}", mesh=stone, translation=[x, y, z], scale=[r, r, r])

    document.add_camera((0.35, 1.25, 4.1), (0.0, 0.5, 0.0), 24)
    return document
