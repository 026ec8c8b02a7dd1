"""Glass on a checker floor: clear, coloured by depth, hollow, frosted and faceted, and a slab to look through."""

import math

from . import images, vector
from .gltf import Document, glass, lambert
from .meshes import Mesh, box, icosphere, inside_out, joined, quad, uv_sphere


def checker(tiles, size):
    """Two meshes, the light and the dark tiles of a square floor about the origin."""
    fields = ([], [])
    start = -tiles * size / 2
    for row in range(tiles):
        for column in range(tiles):
            corner = (start + column * size, 0, start + (row + 1) * size)
            fields[(row + column) % 2].append(quad(corner, (size, 0, 0), (0, 0, -size)))
    return joined(fields[0]), joined(fields[1])


def faceted(mesh):
    """The same triangles with vertices of their own, so that no reader smooths them."""
    positions = [mesh.positions[i] for triangle in mesh.triangles for i in triangle]
    return Mesh(positions, [(i, i + 1, i + 2) for i in range(0, len(positions), 3)])


def brilliant():
    """A cut gem of radius 1 about the origin: table, crown, girdle and pavilion, eight-fold, flat shaded."""
    rings = ((0.55, 0.38), (1.0, 0.0), (1.0, -0.06))
    positions = [(0.0, rings[0][1], 0.0), (0.0, -0.86, 0.0)]
    sides = 8
    for turn, (r, y) in enumerate(rings):
        for side in range(sides):
            phi = 2.0 * math.pi * (side + (0.5 if turn == 0 else 0.0)) / sides
            positions.append((r * math.cos(phi), y, -r * math.sin(phi)))
    triangles = []
    for i in range(sides):
        j = (i + 1) % sides
        table, table_next = 2 + i, 2 + j
        girdle, girdle_next = 2 + sides + i, 2 + sides + j
        low, low_next = 2 + 2 * sides + i, 2 + 2 * sides + j
        triangles += [(0, table, table_next), (girdle, girdle_next, table), (girdle_next, table_next, table)]
        triangles += [(low, low_next, girdle), (low_next, girdle_next, girdle), (1, low_next, low)]
    return faceted(Mesh(positions, triangles))


def build():
    document = Document(
        "glass", {"resolution": [768, 432], "samples": 64, "maxBounces": 16, "transmissionBounces": 16}
    )
    sky = images.layered(
        images.sky(horizon=(0.72, 0.77, 0.83), zenith=(0.22, 0.34, 0.55), ground=(0.50, 0.53, 0.57)),
        images.soft_box((-0.9, 0.6, -0.4), 0.35, 0.35, (5.0, 4.6, 4.0)),
    )
    document.set_environment("sky.hdr", images.environment(sky))

    light, dark = checker(24, 0.5)
    light_tiles = document.add_material(lambert("light tiles", (0.72, 0.70, 0.66)))
    dark_tiles = document.add_material(lambert("dark tiles", (0.16, 0.19, 0.22)))
    document.add_node("light tiles", mesh=document.add_mesh("light tiles", light, light_tiles))
    document.add_node("dark tiles", mesh=document.add_mesh("dark tiles", dark, dark_tiles))

    # Everything floats 2 mm above the floor: two surfaces in one plane would be a draw.
    gap = 0.002

    def place(name, stored, material, position, scale=1.0, turn=0.0):
        mesh = document.add_mesh_like(name, stored, document.add_material(material))
        document.add_node(
            name,
            mesh=mesh,
            translation=[position[0], position[1] + gap, position[2]],
            rotation=list(vector.axis_angle((0.0, 1.0, 0.0), turn)),
            scale=[scale] * 3,
        )

    ball = document.add_attributes(uv_sphere(1.0, 80, 40))
    place("clear sphere", ball, glass("clear"), (0.05, 0.55, -0.15), 0.55)
    amber = glass("amber", 1.5, 0.0, (0.95, 0.45, 0.08), 0.35)
    place("amber sphere", ball, amber, (-1.0, 0.34, 0.75), 0.34)
    frosted = glass("frosted", 1.5, 0.25, (0.45, 0.80, 0.95), 0.6)
    place("frosted sphere", ball, frosted, (0.62, 0.36, 1.05), 0.36)
    shell = document.add_attributes(joined([uv_sphere(1.0, 56, 28), inside_out(uv_sphere(0.9, 56, 28))]))
    place("hollow shell", shell, glass("thin"), (1.25, 0.42, 0.25), 0.42)
    sea_green = glass("sea green", 1.5, 0.0, (0.25, 0.85, 0.62), 0.5)
    slab = document.add_attributes(box((1.3, 1.5, 0.22)))
    place("slab", slab, sea_green, (-1.2, 0.0, -0.75), turn=24)
    ruby = glass("ruby", 1.77, 0.0, (0.92, 0.08, 0.16), 0.25)
    place("ruby", document.add_attributes(brilliant()), ruby, (-0.25, 0.86 * 0.3, 1.25), 0.3, 10)
    crystal = glass("crystal", 1.5, 0.0, (0.62, 0.55, 0.95), 0.5)
    gem = document.add_attributes(faceted(icosphere(0)))
    place("icosahedron", gem, crystal, (1.75, 0.39, -0.95), 0.4, 20)

    document.add_area_light("area light", (2.2, 3.6, 1.6), (0, 0.3, 0), 1.6, 1.6, (16.0, 14.6, 12.6))
    document.add_camera((0.1, 1.75, 5.6), (0.05, 0.42, 0.0), 27)
    return document
