"""A tire half sunk into rippled sand: two meshes with a height map each, one tiled 25 × 25 and one 6 × 1, as in the scene
of the RMIP paper (Thonat and others 2023, Table 1)."""

import math

from . import images
from .gltf import Document, dielectric, displaced, lambert
from .meshes import Mesh, ground
from .vector import axis_angle, smoothstep

MAP_SIZE = 256
SAND_TILES = (25, 25)
TREAD_TILES = (6, 1)


def sand(u, v):
    """Ripples that meander, steep on one side, with grains."""
    bend = 0.16 * math.sin(2 * math.pi * u) + 0.05 * math.sin(2 * math.pi * (2 * u + v))
    phase = (3 * v + bend) % 1.0
    ripple = smoothstep(0.0, 0.7, phase) * (1.0 - smoothstep(0.7, 1.0, phase))
    grain = images.noise(96 * u, 96 * v, 0.5, (96, 96, 0))
    return 0.86 * ripple + 0.1 * grain


def tread(u, v):
    """Slanted blocks, three along the tile, on the outer half of the tube (v around it), and a rim on its sides."""
    across = 2 * v - 1
    outer = 1.0 - smoothstep(0.36, 0.42, abs(across))
    block = (3 * u + 1.6 * abs(across)) % 1.0
    gap = smoothstep(0.0, 0.08, block) * (1.0 - smoothstep(0.62, 0.7, block))
    middle = smoothstep(0.02, 0.05, abs(across))
    rim = 1.0 - smoothstep(0.012, 0.03, abs(abs(across) - 0.6))
    return 0.1 + 0.85 * outer * gap * middle + 0.3 * rim


def _tire():
    """A torus around the z axis; u along the ring, v around the tube from its inner side, so that v = ½ is the tread."""
    ring, tube, segments, sides = 0.8, 0.34, 48, 24
    positions, normals, uvs, triangles = [], [], [], []
    for j in range(sides + 1):
        around = 2 * math.pi * (j % sides) / sides + math.pi
        for i in range(segments + 1):
            along = 2 * math.pi * (i % segments) / segments
            out, side = math.cos(around), math.sin(around)
            normal = (out * math.cos(along), out * math.sin(along), side)
            center = (ring * math.cos(along), ring * math.sin(along), 0.0)
            positions.append(tuple(c + tube * n for c, n in zip(center, normal)))
            normals.append(normal)
            uvs.append((i / segments, j / sides))
    for j in range(sides):
        for i in range(segments):
            a = j * (segments + 1) + i
            b = a + segments + 1
            triangles += [(a, a + 1, b + 1), (a, b + 1, b)]
    return Mesh(positions, triangles, normals, uvs)


def build():
    document = Document("desert_tire", {"resolution": [768, 432], "samples": 64, "maxBounces": 4})
    sky = images.sky(horizon=(0.95, 0.86, 0.76), zenith=(0.12, 0.25, 0.55), ground=(0.3, 0.24, 0.16))
    document.set_environment("sky.hdr", images.environment(sky), strength=0.7)
    document.add_sun((-0.75, 0.4, 0.3), (5.4, 4.5, 3.4))

    dune = lambert("sand", (0.46, 0.32, 0.18))
    sand_map = document.add_texture("sand.png", images.height_map(sand, MAP_SIZE))
    dune = displaced(dune, sand_map, 0.06, 0.5, SAND_TILES, smoothing=True)
    document.add_node("ground", mesh=document.add_mesh("ground", ground(9.0, 8), document.add_material(dune)))

    rubber = dielectric("rubber", (0.025, 0.024, 0.023), 0.55)
    tread_map = document.add_texture("tread.png", images.height_map(tread, MAP_SIZE))
    rubber = displaced(rubber, tread_map, 0.08, 0.0, TREAD_TILES)
    document.add_node(
        "tire",
        mesh=document.add_mesh("tire", _tire(), document.add_material(rubber)),
        translation=[0, 0.8, 0],
        rotation=list(axis_angle((0.0, 1.0, 0.0), 35.0)),
    )
    document.add_camera((0.6, 1.9, 5.2), (0.1, 0.75, 0), 30)
    return document
