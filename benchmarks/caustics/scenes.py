"""Six scenes with caustics, each hard for a path tracer in its own way. `python3 -m benchmarks.caustics.scenes FOLDER`
writes them from the repository's root.

sphere    a glass sphere over a floor under a small area light
ring      a gold ring under a sun, which a path tracer never finds by chance
water     a glass bowl of light: a displaced, rippled slab over a basin under a small lamp
mirror    a glass prism whose caustic is seen in a mirror, and falls on a wall
rough     spheres of glass and metal of rising roughness, across the threshold between photons and paths
hall      200 glass spheres under one lamp, of which the camera sees one
"""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts"))

from examples import images  # noqa: E402
from examples.gltf import Document, displaced, glass, lambert, metal  # noqa: E402
from examples.meshes import Mesh, joined, lathe, quad, uv_sphere  # noqa: E402

RENDER = {"resolution": [400, 300], "samples": 256, "maxBounces": 12, "pixelFilter": {"type": "box", "width": 1}}


def floor(document, half=2.0, color=(0.6, 0.6, 0.6), height=0.0):
    mesh = quad((-half, height, half), (2 * half, 0, 0), (0, 0, -2 * half))
    material = document.add_material(lambert("floor", color))
    return document.add_node("floor", mesh=document.add_mesh("floor", mesh, material))


def place(document, name, mesh, material, **properties):
    index = document.add_mesh(name, mesh, document.add_material(material))
    return document.add_node(name, mesh=index, **properties)


def sphere():
    document = Document("sphere", dict(RENDER))
    floor(document)
    place(document, "ball", uv_sphere(0.4, 96, 48), glass("glass"), translation=[0, 0.45, 0])
    document.add_area_light("lamp", (0.6, 2.4, 0.3), (0, 0.4, 0), 0.1, 0.1, (400, 400, 400))
    document.add_camera((0.0, 1.3, 3.0), (0, 0.3, 0), 32)
    return document


def ring():
    document = Document("ring", dict(RENDER))
    floor(document)
    outer, inner, height = 0.5, 0.46, 0.2
    corners = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, 0.0)]
    walls = joined([lathe(wall, 256) for wall in zip(corners, corners[1:])])
    place(document, "ring", walls, metal("gold", (1.0, 0.78, 0.34), 0.05), translation=[0, 0.002, 0])
    document.add_sun((-0.7, 0.75, 0.35), (3, 3, 3))
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [0.1, 0.12, 0.15]}
    document.add_camera((0.0, 1.9, 1.6), (0, 0.05, 0.05), 30)
    return document


def ripples(u, v):
    """Height 0 … 1 of waves that tile."""
    turn = 2 * math.pi
    return 0.5 + 0.5 * (0.4 * math.sin(turn * (2 * u + v)) + 0.3 * math.sin(turn * (3 * v - u) + 1.0)
                        + 0.3 * math.sin(turn * (u + 2 * v) + 2.0))


def grid(size, height, normal):
    """The water's surface as size × size pairs of triangles, of heights and normals by u and v."""
    corners = [(column / size, row / size) for row in range(size + 1) for column in range(size + 1)]
    positions = [(-0.8 + 1.6 * u, height(u, v), 0.8 - 1.6 * v) for u, v in corners]
    triangles = []
    for row in range(size):
        for column in range(size):
            a = row * (size + 1) + column
            triangles += [(a, a + 1, a + size + 2), (a, a + size + 2, a + size + 1)]
    return Mesh(positions, triangles, [normal(u, v) for u, v in corners], corners)


def tessellated_ripples(tiles, scale):
    """What the displaced surface of `water` approximates, a pair of triangles a texel."""
    step = 1e-4

    def height(u, v):
        return 0.6 + scale * (ripples(tiles * u, tiles * v) - 0.5)

    def normal(u, v):
        dhdx = (height(u + step, v) - height(u - step, v)) / (2 * step * 1.6)
        dhdz = (height(u, v - step) - height(u, v + step)) / (2 * step * 1.6)
        length = math.sqrt(dhdx * dhdx + 1 + dhdz * dhdz)
        return (-dhdx / length, 1 / length, -dhdz / length)

    return grid(512, height, normal)


def water(tessellated=False):
    """@param tessellated  as a smooth mesh instead, for who cannot displace as relief does"""
    document = Document("water", dict(RENDER))
    floor(document, 1.2)
    tiles, scale = 2, 0.03
    if tessellated:
        place(document, "surface", tessellated_ripples(tiles, scale), glass("water", 1.33))
    else:
        size = 256
        rows = [[(round(65535 * ripples((x + 0.5) / size, (y + 0.5) / size)),) for x in range(size)] for y in range(size)]
        heights = document.add_texture("ripples.png", images.png(rows, bits=16))
        material = displaced(glass("water", 1.33), heights, scale, tiles=(tiles, tiles))
        place(document, "surface", grid(8, lambda u, v: 0.6, lambda u, v: (0.0, 1.0, 0.0)), material)
    place(document, "bottom", quad((-0.8, 0.45, -0.8), (1.6, 0, 0), (0, 0, 1.6)), glass("water below", 1.33))
    document.add_area_light("lamp", (0.3, 2.6, 0.2), (0, 0, 0), 0.06, 0.06, (900, 860, 800))
    document.add_camera((0.0, 0.42, 2.6), (0, 0.22, 0), 34)
    return document


def mirror():
    document = Document("mirror", dict(RENDER))
    floor(document)
    place(document, "wall", quad((-2, 0, -1), (4, 0, 0), (0, 2, 0)), lambert("wall", (0.6, 0.6, 0.6)))
    prism = Mesh([(-0.35, 0, -0.3), (0.35, 0, -0.3), (0, 0.6, -0.3), (-0.35, 0, 0.3), (0.35, 0, 0.3), (0, 0.6, 0.3)],
                 [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)])
    positions = [prism.positions[i] for t in prism.triangles for i in t]
    prism = Mesh(positions, [(i, i + 1, i + 2) for i in range(0, len(positions), 3)])
    place(document, "prism", prism, glass("prism", 1.6), translation=[-0.2, 0.05, 0])
    place(document, "mirror", quad((0.9, 0.0, 0.6), (0.4, 0, -1.3), (0, 1.2, 0)), metal("mirror", (0.95, 0.95, 0.95), 0.0))
    document.add_area_light("lamp", (-1.8, 1.1, 0.2), (-0.2, 0.3, 0), 0.12, 0.12, (250, 250, 250))
    document.add_camera((-0.4, 1.1, 3.2), (0.15, 0.4, -0.2), 34)
    return document


def rough():
    document = Document("rough", dict(RENDER))
    floor(document)
    for i, roughness in enumerate((0.0, 0.15, 0.24, 0.26, 0.4)):
        x = (i - 2) * 0.55
        place(document, f"glass {roughness}", uv_sphere(0.22, 64, 32), glass(f"glass {roughness}", 1.5, roughness),
              translation=[x, 0.25, 0.3])
        place(document, f"metal {roughness}", uv_sphere(0.2, 64, 32), metal(f"metal {roughness}", (0.9, 0.6, 0.5), roughness),
              translation=[x, 0.22, -0.4])
    document.add_area_light("lamp", (0.5, 2.2, 1.6), (0, 0.2, 0), 0.3, 0.3, (60, 60, 60))
    document.add_camera((0.0, 1.6, 3.0), (0, 0.2, 0), 34)
    return document


def hall():
    # What bright caustics throw on to other surfaces is noise of its own, which no photon helps.
    document = Document("hall", {**RENDER, "diffuseBounces": 1})
    floor(document, 12.0)
    columns, rows = 20, 10
    ball = document.add_mesh("ball", uv_sphere(0.3, 64, 32), document.add_material(glass("glass")))
    for i in range(columns * rows):
        column, row = i % columns, i // columns
        document.add_node(f"ball {i}", mesh=ball, translation=[column - columns / 2, 0.35, row - rows / 2])
    document.add_area_light("lamp", (9, 8, -3), (0, 0, 0), 0.2, 0.2, (5000, 5000, 5000))
    document.add_camera((0.0, 1.6, 1.3), (-0.4, 0, 0.15), 14)
    return document


SCENES = {build.__name__: build for build in (sphere, ring, water, mirror, rough, hall)}


def main(folder):
    for name, build in SCENES.items():
        build().save(os.path.join(folder, name))


if __name__ == "__main__":
    main(sys.argv[1])
