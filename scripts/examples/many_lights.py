"""A nave at night, lit by a thousand small lanterns and nothing else."""

import math
import random

from . import vector
from .gltf import Document, emitter, lambert
from .meshes import Mesh, box, catmull_rom, icosphere, joined, lathe, quad

# Radiance of each kind of lantern, W/m²/sr.
LANTERNS = {
    "candle": (12.0, 5.8, 1.6),
    "amber": (13.0, 4.3, 0.5),
    "rose": (13.0, 1.3, 3.0),
    "pearl": (6.0, 5.7, 5.3),
    "teal": (0.7, 8.6, 11.5),
}
# What winds about the columns, bay by bay; the pearls fly above the aisle.
BAYS = ("candle", "amber", "teal", "candle", "rose", "amber", "teal", "candle", "rose")
NUM_LANTERNS, NUM_PER_COLUMN = 1000, 42
HALF_WIDTH, LENGTH, BAY, COLUMN_X = 6.0, 36.0, 4.0, 4.3


def _moved(mesh, offset):
    return Mesh([vector.add(p, offset) for p in mesh.positions], mesh.triangles, mesh.normals, mesh.uvs)


def _vault():
    """A round barrel vault from wall to wall, seen from inside, flat shaded in 32 strips."""
    steps, spring = 32, 6.5
    strips = []
    for step in range(steps):
        a, b = (math.pi * s / steps for s in (step, step + 1))
        p = (HALF_WIDTH * math.cos(a), spring + 0.75 * HALF_WIDTH * math.sin(a), 0.0)
        q = (HALF_WIDTH * math.cos(b), spring + 0.75 * HALF_WIDTH * math.sin(b), 0.0)
        strips.append(quad(p, (0, 0, -LENGTH), vector.subtract(q, p)))
    return joined(strips)


def _column():
    shaft = catmull_rom(
        [(0.62, 0.0), (0.62, 0.22), (0.46, 0.40), (0.40, 0.55), (0.38, 2.2), (0.35, 4.6), (0.40, 4.8), (0.60, 5.3)], 5
    )
    flat = lathe(shaft, 20)
    flat.normals, flat.uvs = [], []
    return joined([flat, _moved(box((1.5, 0.35, 1.5)), (0, 5.3, 0))])


def _places(generator):
    """Centres of the lanterns by kind: rising spirals about the columns, a loose double helix along the nave."""
    places = {name: [] for name in LANTERNS}
    for bay, name in enumerate(BAYS):
        for side in (-1, 1):
            for i in range(NUM_PER_COLUMN):
                t = (i + generator.uniform(0.1, 0.9)) / NUM_PER_COLUMN
                turn = 2.0 * math.pi * (2.5 * t + 0.37 * bay) * side
                radius = 0.85 + generator.gauss(0.0, 0.07)
                x = side * COLUMN_X + radius * math.cos(turn)
                places[name].append((x, 0.3 + 4.7 * t, -2.0 - BAY * bay + radius * math.sin(turn)))
    strands = NUM_LANTERNS - sum(len(kind) for kind in places.values())
    for i in range(strands):
        along = (i + generator.random()) / strands
        turn = 2.0 * math.pi * (3.0 * along + 0.5 * (i % 2)) + generator.gauss(0.0, 0.12)
        radius = 1.9 + generator.gauss(0.0, 0.15)
        places["pearl"].append(
            (radius * math.cos(turn), 5.6 + radius * math.sin(turn), -5.0 - along * (LENGTH - 7.0))
        )
    return places


def build():
    document = Document("many_lights", {"resolution": [640, 480], "samples": 64, "maxBounces": 6})
    stone = document.add_material(lambert("stone", (0.72, 0.70, 0.66)))
    floor = document.add_material(lambert("floor", (0.46, 0.40, 0.35)))
    walls = joined(
        [
            quad((-HALF_WIDTH, 0, 0), (0, 0, -LENGTH), (0, 6.5, 0)),
            quad((HALF_WIDTH, 0, -LENGTH), (0, 0, LENGTH), (0, 6.5, 0)),
            quad((-HALF_WIDTH, 0, -LENGTH), (2 * HALF_WIDTH, 0, 0), (0, 12, 0)),
            quad((HALF_WIDTH, 0, 0), (-2 * HALF_WIDTH, 0, 0), (0, 12, 0)),
            _vault(),
        ]
    )
    document.add_node("hall", mesh=document.add_mesh("hall", walls, stone))
    ground = quad((-HALF_WIDTH, 0, 0), (2 * HALF_WIDTH, 0, 0), (0, 0, -LENGTH))
    document.add_node("floor", mesh=document.add_mesh("floor", ground, floor))
    column = document.add_mesh("column", _column(), stone)
    places = [(side * COLUMN_X, 0.0, -2.0 - BAY * bay) for bay in range(len(BAYS)) for side in (-1, 1)]
    document.add_instances("columns", column, places, [(0, 0, 0, 1)] * len(places), [(1, 1, 1)] * len(places))

    generator = random.Random(1000)
    stored = document.add_attributes(icosphere(0))
    for name, centers in _places(generator).items():
        mesh = document.add_mesh_like(name, stored, document.add_material(emitter(name, LANTERNS[name])))
        turns = [vector.axis_angle((0.0, 1.0, 0.0), generator.uniform(0.0, 72.0)) for _ in centers]
        sizes = [(generator.uniform(0.035, 0.075),) * 3 for _ in centers]
        document.add_instances(f"{name} lanterns", mesh, centers, turns, sizes)
    document.add_camera((0.7, 1.6, -0.3), (-0.1, 3.4, -13), 62)
    return document
