"""Two thousand trees, one mesh: a hill country in autumn under a clear sky and a low sun."""

import math
import random

from . import images, vector
from .gltf import Document, lambert
from .meshes import Mesh, height_field

# One texel a colour; trees point into its middle, so no filter mixes two. Two swatches of bark, three of leaves,
# darkest first; one palette a season, and the share of the trees that wear it.
BARK = ((0.20, 0.12, 0.07), (0.13, 0.075, 0.045))
SEASONS = (
    ("summer", ((0.055, 0.13, 0.022), (0.10, 0.20, 0.030), (0.17, 0.29, 0.040)), 0.52),
    ("turning", ((0.24, 0.22, 0.025), (0.40, 0.33, 0.035), (0.58, 0.44, 0.050)), 0.28),
    ("autumn", ((0.34, 0.075, 0.018), (0.50, 0.14, 0.022), (0.66, 0.25, 0.035)), 0.20),
)
NUM_SWATCHES = 5
NUM_TREES = 2000
NUM_LEAVES = 1920


def _land(x, z):
    """Height of the ground, metres: a valley along the view between rolling hills."""
    valley = 11.0 * (1.0 - math.exp(-(((x - 10.0 * math.sin(z * 0.018)) / 42.0) ** 2)))
    rolling = 5.0 * math.sin(x * 0.035 + 1.0) * math.cos(z * 0.03) + 1.3 * math.sin(x * 0.11) * math.sin(z * 0.09 + 2)
    return valley + rolling - 0.03 * z


def _swatch(index):
    return ((index + 0.5) / NUM_SWATCHES, 0.5)


def tree():
    """A broadleaf tree 5.3 m tall: a tapered trunk and 1,920 two-triangle leaves about a lumpy crown."""
    generator = random.Random(7)
    positions, uvs, triangles = [], [], []
    sides = 9
    rings = ((0.26, 0.0), (0.17, 0.5), (0.14, 1.4), (0.10, 2.6), (0.03, 4.0))
    for radius, height in rings:
        for side in range(sides):
            phi = 2.0 * math.pi * side / sides
            positions.append((radius * math.cos(phi), height, -radius * math.sin(phi)))
            uvs.append(_swatch(side % 2))
    for ring in range(len(rings) - 1):
        for side in range(sides):
            a, b = ring * sides + side, ring * sides + (side + 1) % sides
            triangles += [(a, b, b + sides), (a, b + sides, a + sides)]
    for _ in range(NUM_LEAVES):
        y = generator.uniform(-1.0, 1.0)
        phi = generator.uniform(0.0, 2.0 * math.pi)
        ring = math.sqrt(1.0 - y * y)
        direction = (ring * math.cos(phi), y, ring * math.sin(phi))
        lumps = 0.74 + 0.52 * images.noise(
            2.2 * direction[0] + 9.0, 2.2 * direction[1] + 9.0, 2.2 * direction[2] + 9.0
        )
        depth = lumps * generator.uniform(0.55, 1.0) ** (1 / 3)
        center = (1.75 * depth * direction[0], 3.35 + 1.95 * depth * direction[1], 1.75 * depth * direction[2])
        tilt = [generator.uniform(-0.8, 0.8) for _ in range(3)]
        normal = vector.normalize(vector.add(vector.add(direction, (0.0, 0.35, 0.0)), tilt))
        along = vector.normalize(vector.cross(normal, (generator.uniform(-1, 1), generator.uniform(-1, 1), 1.1)))
        across = vector.cross(normal, along)
        length, width = generator.uniform(0.20, 0.30), generator.uniform(0.10, 0.15)
        first = len(positions)
        for step_along, step_across in ((-length, 0.0), (0.0, width), (length, 0.0), (0.0, -width)):
            positions.append(
                vector.add(
                    center,
                    vector.add(vector.scale(along, step_along), vector.scale(across, step_across)),
                )
            )
            uvs.append(_swatch(0))
        # Outer and upper leaves are the lighter ones.
        shade = min(max(int(2.0 * depth * (0.6 + 0.4 * y) + generator.uniform(-0.4, 1.2)), 0), 2)
        uvs[first:] = [_swatch(2 + shade)] * 4
        triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return Mesh(positions, triangles, [], uvs)


def _plant(generator):
    """Positions, turns, scales and seasons of the trees: groves on the slopes, none on the path."""
    places = []
    while len(places) < NUM_TREES:
        z = 44.0 - 185.0 * generator.random() ** 1.1
        half = 9.0 + 0.46 * (72.0 - z)
        x = generator.uniform(-half, half)
        distance = abs(x - 10.0 * math.sin(z * 0.018))
        grove = images.noise(x * 0.055 + 50, z * 0.055 + 50, 0.5)
        density = vector.smoothstep(3.0, 16.0, distance) * (0.12 + vector.smoothstep(0.42, 0.62, grove))
        if generator.random() > density:
            continue
        size = generator.uniform(0.65, 1.25)
        turn = vector.axis_angle((0.0, 1.0, 0.0), generator.uniform(0.0, 360.0))
        scale = (size, size * generator.uniform(0.85, 1.2), size)
        # Neighbours turn together, with exceptions.
        season = images.noise(x * 0.09 + 7, z * 0.09 + 7, 9.5) * 0.7 + generator.random() * 0.3
        places.append(((x, _land(x, z) - 0.05, z), turn, scale, season))
    places.sort(key=lambda place: place[3])
    return places


def build():
    document = Document("instances", {"resolution": [768, 432], "samples": 64, "maxBounces": 4})
    sky = images.sky(horizon=(1.05, 0.93, 0.78), zenith=(0.10, 0.24, 0.60), ground=(0.30, 0.27, 0.20))
    document.set_environment("sky.hdr", images.environment(sky), strength=0.85)
    document.add_sun((-0.80, 0.46, 0.38), (6.2, 4.7, 3.0))

    meadow = document.add_material(lambert("meadow", (0.27, 0.25, 0.075)))
    land = height_field(lambda x, z: _land(x, z - 80.0), 190.0, 160.0, 70, 60)
    document.add_node("land", mesh=document.add_mesh("land", land, meadow), translation=[0, 0, -80])

    stored = document.add_attributes(tree())
    places = _plant(random.Random(2026))
    first = 0
    for season, leaves, share in SEASONS:
        swatches = [[tuple(images.srgb_byte(channel) for channel in color) for color in BARK + leaves]]
        palette = document.add_texture(f"{season}.png", images.png(swatches), nearest=True)
        material = document.add_material(lambert(season, (1, 1, 1), palette))
        mesh = document.add_mesh_like(f"tree in {season}", stored, material)
        last = first + round(share * NUM_TREES)
        translations, rotations, scales, _ = zip(*places[first:last])
        document.add_instances(f"trees in {season}", mesh, translations, rotations, scales)
        first = last
    document.add_camera((2, 26.0, 78), (1, 7.5, 0), 27)
    return document
