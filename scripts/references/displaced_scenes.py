"""Small scenes of displaced surfaces and caustics, each as relief reads it and as a twin of plain fine triangles.

`build(name)` is the scene of RELIEF_displacement, `build(name, steps)` the twin, by tessellation.py. Both are made of the
same numbers. Twins of scenes without displacement are the scenes themselves.
"""

import math

import numpy as np

from examples import gltf, images, meshes, vector

from . import tessellation
from .tessellation import HeightMap

RESOLUTION = (48, 36)
CLAY = (0.7, 0.55, 0.4)
SLATE = (0.3, 0.4, 0.5)
_CLAMP_TO_EDGE = 33071
SKY = {"color": [0.7, 0.85, 1.0], "strength": 0.8}


class _Scene:
    """A document whose displaced meshes are displaced, or with `steps` tessellated."""

    def __init__(self, name, steps, max_bounces, **render):
        settings = {"resolution": list(RESOLUTION), "samples": 64, "maxBounces": max_bounces, **render}
        settings["pixelFilter"] = {"type": "box", "width": 1}
        self.document = gltf.Document(name, settings)
        self.document.gltf["extensions"]["RELIEF_environment"] = {"color": [0, 0, 0]}
        self.steps = steps
        self.textures = {}

    def mesh(self, name, mesh, material):
        return self.document.add_mesh(name, mesh, self.document.add_material(material))

    def by_map(self, name, mesh, material, heights, bits=8, walls=False, **properties):
        """A mesh displaced by a map; `properties` are RELIEF_displacement's."""
        if self.steps:
            triangles = tessellation.by_map(mesh, heights, self.steps)
            if walls:
                triangles = np.concatenate([triangles, tessellation.seam_walls(mesh, heights)])
            return self.mesh(name, tessellation.as_mesh(triangles), material)
        file_name = f"{self.document.name}_{name}.png"
        texels = np.rint(heights.texels * (2**bits - 1)).astype(int)
        rows = [[(int(texel),) for texel in row] for row in texels]
        texture = self.document.add_texture(file_name, images.png(rows, bits))
        if heights.clamped:
            self.document.gltf["samplers"] = [{"wrapS": _CLAMP_TO_EDGE, "wrapT": _CLAMP_TO_EDGE}]
            self.document.gltf["textures"][texture]["sampler"] = 0
        if walls:
            properties["seams"] = "weld"
        gltf.displaced(material, texture, heights.scale, heights.midlevel, heights.tiles, **properties)
        if heights.offset != (0.0, 0.0):
            reference = material["extensions"]["RELIEF_displacement"]["heightTexture"]
            transform = reference.setdefault("extensions", {}).setdefault("KHR_texture_transform", {})
            transform["offset"] = list(heights.offset)
        return self.mesh(name, mesh, material)

    def node(self, name, mesh, **placement):
        self.document.add_node(name, mesh=mesh, **placement)

    def floor(self, color, y=0.0, half=6.0):
        quad = meshes.quad((-half, y, half), (2 * half, 0, 0), (0, 0, -2 * half))
        self.node("floor", self.mesh("floor", quad, gltf.lambert("floor", color)))

    def terrace(self):
        """A floor under a blue sky and a sun."""
        self.floor(SLATE)
        self.environment(color=[0.6, 0.8, 1.0], strength=0.3)
        self.document.add_sun((-0.7, 0.8, 0.5), (2.6, 2.4, 2.0))

    def checker(self, y, half, colors=((0.7, 0.2, 0.1), (0.2, 0.4, 0.7)), size=1.0):
        for i, color in enumerate(colors):
            tiles = [
                meshes.quad((size * x, y, size * (z + 1)), (size, 0, 0), (0, 0, -size))
                for x in range(-half, half)
                for z in range(-half, half)
                if (x + z) % 2 == i
            ]
            self.node(f"tiles {i}", self.mesh(f"tiles {i}", meshes.joined(tiles), gltf.lambert(f"tiles {i}", color)))

    def environment(self, **settings):
        self.document.gltf["extensions"]["RELIEF_environment"] = settings


def _stored(heights, bits):
    """Heights in 0…1 as a file of so many bits has them."""
    largest = 2**bits - 1
    return np.rint(np.clip(heights, 0, 1) * largest) / largest


def _texel_centers(columns, rows):
    return np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)


def _bumps(columns, rows, bits):
    """Round bumps of several sizes without any symmetry; repeats."""
    u, v = _texel_centers(columns, rows)
    heights = np.zeros_like(u)
    for i in range(9):
        x, y = (0.13 + 0.618 * i) % 1, (0.29 + 0.755 * i) % 1
        radius, top = 0.1 + 0.045 * (i % 3), 0.45 + 0.55 * ((i * 0.37) % 1)
        du, dv = (u - x + 0.5) % 1 - 0.5, (v - y + 0.5) % 1 - 0.5
        heights = np.maximum(heights, top * np.clip(1 - (du * du + dv * dv) / radius**2, 0, 1))
    return _stored(heights, bits)


def _patch(half_x, half_z, uv=((0, 0), (1, 0), (1, 1), (0, 1))):
    """A rectangle on the floor that faces up; uv at its corners (left, far), (right, far), (right, near), (left, near)."""
    positions = [(-half_x, 0, -half_z), (half_x, 0, -half_z), (half_x, 0, half_z), (-half_x, 0, half_z)]
    return meshes.Mesh(positions, [(0, 3, 2), (0, 2, 1)], [(0, 1, 0)] * 4, [tuple(map(float, at)) for at in uv])


def _ball(segments, rings, radius=1.0):
    """A coarse sphere of smooth normals, u once around, v from the top down."""
    ball = meshes.uv_sphere(radius, segments, rings)
    ball.uvs = [(column / segments, row / rings) for row in range(rings + 1) for column in range(segments + 1)]
    return ball


def displaced_bumps(steps):
    """A hard shadow's border lies on bumps and between them: a sun over a 16-bit map."""
    scene = _Scene("displaced_bumps", steps, 3)
    heights = HeightMap(_bumps(32, 32, 16), 0.45, 0.0)
    scene.node("bumps", scene.by_map("bumps", _patch(1.6, 1.6), gltf.lambert("clay", CLAY), heights, 16))
    scene.document.add_sun((-0.9, 0.55, 0.25), (3.0, 2.7, 2.2))
    scene.document.add_camera((0.3, 2.6, 3.4), (0, 0, 0.1), 38)
    return scene


def displaced_pits(steps):
    """Below the base: a midlevel near the top, a map turned, tiled and moved on the mesh, under a uniform sky."""
    scene = _Scene("displaced_pits", steps, 4)
    heights = HeightMap(_bumps(24, 16, 8), -0.5, -0.1, (2.0, 1.5), (0.3, 0.15))
    turned = _patch(1.6, 1.6, ((0, 0), (0.8, -0.6), (1.4, 0.2), (0.6, 0.8)))
    scene.node("pits", scene.by_map("pits", turned, gltf.lambert("slate", (0.75, 0.7, 0.65)), heights))
    scene.environment(**SKY)
    scene.document.add_camera((0.3, 2.6, 2.8), (0, -0.2, 0.1), 40)
    return scene


def displaced_sphere(steps):
    """A curved base: normals of a coarse sphere, shorter than one inside of its triangles, and a map tiled around it."""
    scene = _Scene("displaced_sphere", steps, 3)
    texels = _bumps(12, 32, 8) * np.sin(math.pi * (np.arange(32)[:, None] + 0.5) / 32) ** 0.5
    texels[0] = texels[-1] = 0
    heights = HeightMap(_stored(texels, 8), 0.35, 0.2, (5.0, 1.0))
    scene.node("ball", scene.by_map("ball", _ball(10, 6), gltf.lambert("clay", CLAY), heights), translation=[0, 1.1, 0])
    scene.terrace()
    scene.document.add_camera((0.8, 2.6, 4.6), (0, 0.95, 0), 36)
    return scene


def displaced_seam(steps):
    """The two sides of a seam ask for different heights: on the left it stays open, on the right a wall closes it."""
    scene = _Scene("displaced_seam", steps, 3)
    heights = HeightMap(_bumps(16, 16, 8), 0.5, 0.3)
    left = _patch(0.5, 1.2, ((0, 0), (0.5, 0), (0.5, 1), (0, 1)))
    right = _patch(0.5, 1.2, ((0.25, 0.375), (0.75, 0.375), (0.75, 1.375), (0.25, 1.375)))
    move = lambda mesh, x: [(p[0] + x, p[1], p[2]) for p in mesh.positions]  # noqa: E731
    left.positions, right.positions = move(left, -0.5), move(right, 0.5)
    halves = meshes.joined([left, right])
    for x, name, walls in ((-1.1, "open", False), (1.1, "welded", True)):
        mesh = scene.by_map(name, halves, gltf.lambert(name, CLAY), heights, walls=walls)
        scene.node(name, mesh, translation=[x, 0.6, 0])
    scene.floor((0.2, 0.5, 0.3))
    scene.environment(color=[0.6, 0.8, 1.0], strength=0.3)
    scene.document.add_sun((-0.75, 0.8, 0.3), (2.6, 2.4, 2.0))
    scene.document.add_camera((-0.5, 3.4, 3.9), (0, 0.4, 0.1), 38)
    return scene


def displaced_cliff(steps):
    """Walls of one texel and plains between them, in light that grazes: a small lamp just above the tops."""
    scene = _Scene("displaced_cliff", steps, 3)
    texels = np.zeros((16, 16))
    texels[2:7, 2:5] = 1
    texels[9:14, 3:4] = 0.8
    texels[4:6, 8:14] = 0.6
    texels[10:12, 8:10] = 1
    texels[9:13, 12:14] = 0.4
    heights = HeightMap(_stored(texels, 8), 0.7, 0.0, clamped=True)
    scene.node("cliffs", scene.by_map("cliffs", _patch(1.6, 1.6), gltf.lambert("clay", CLAY), heights))
    scene.document.add_area_light("lamp", (-3.2, 0.9, 0.7), (0, 0.3, 0), 0.6, 0.5, (30, 24, 16))
    scene.environment(color=[0.6, 0.8, 1.0], strength=0.05)
    scene.document.add_camera((0.8, 2.7, 3.3), (0, 0.1, 0.1), 38)
    return scene


def _slab(scene, heights, half, top, bottom, bits=8):
    """A slab of glass whose top is displaced; the map's border stays where the sides begin."""
    material = gltf.glass("glass", ior=1.4)
    # Beyond the centres of its outermost texels a clamped map goes on, so the border of the slab is level.
    face = _patch(half, half)
    face.positions = [(x, top, z) for x, _, z in face.positions]
    scene.node("slab's top", scene.by_map("top", face, material, heights, bits))
    box = meshes.box((2 * half, top - bottom, 2 * half))
    lid = 8  # of a box's triangles, the two that face up
    box.triangles = box.triangles[:lid] + box.triangles[lid + 2 :]
    box.positions = [(x, y + bottom, z) for x, y, z in box.positions]
    scene.node("slab's sides", scene.mesh("sides", box, gltf.glass("glass", ior=1.4)))


def _waves(size, bits):
    """Waves that die out before the border; also the height there, which is one that the file can have exactly."""
    u, v = _texel_centers(size, size)
    fade = np.clip(np.minimum.reduce([u, 1 - u, v, 1 - v]) * 5 - 5 / size, 0, 1)
    waves = np.sin(9 * u + 4 * v + 0.5) + np.sin(3 * u - 11 * v) + 0.7 * np.sin(15 * u + 9 * v * v)
    middle = (2 ** (bits - 1) - 1) / (2**bits - 1)
    return _stored(middle + 0.17 * waves * fade * fade * (3 - 2 * fade), bits), middle


def displaced_slab(steps):
    """Refraction: tiles through a slab of glass with waves on top."""
    scene = _Scene("displaced_slab", steps, 12)
    texels, middle = _waves(24, 16)
    _slab(scene, HeightMap(texels, 0.5, middle, clamped=True), 1.4, 0.75, 0.15, 16)
    scene.checker(0, 5, size=0.5)
    scene.environment(**SKY)
    scene.document.add_camera((0.4, 2.9, 3.6), (0, 0.4, 0.1), 38)
    return scene


def _graph(terms):
    """A height graph over object coordinates: the sum of amplitude · sin(frequency · coordinate + phase)."""
    nodes = [{"type": "texture-coordinate"}, {"type": "separate", "inputs": {"vector": {"node": 0, "output": "object"}}}]
    total = 0.0
    for axis, frequency, phase, amplitude in terms:
        coordinate = {"node": 1, "output": "xyz"[axis]}
        last = len(nodes)
        nodes += [
            {"type": "math", "operation": "multiply-add", "inputs": {"a": coordinate, "b": frequency, "c": phase}},
            {"type": "math", "operation": "sine", "inputs": {"a": {"node": last, "output": "value"}}},
            {
                "type": "math",
                "operation": "multiply-add",
                "inputs": {"a": {"node": last + 1, "output": "value"}, "b": amplitude, "c": total},
            },
        ]
        total = {"node": last + 2, "output": "value"}
    return {"nodes": nodes, "outputs": {"height": total}}


def _sum_of_sines(terms, P):
    return sum(amplitude * np.sin(frequency * P[..., axis] + phase) for axis, frequency, phase, amplitude in terms)


def displaced_graph(steps):
    """Computed heights: waves of object coordinates on an icosahedron's smooth normals, by their closed form."""
    terms = ((0, 9.0, 0.3, 0.6), (1, 13.0, 1.0, 0.4), (2, 7.0, 2.0, 0.7))
    scale = 0.08
    scene = _Scene("displaced_graph", steps, 3)
    solid = meshes.icosphere(0)
    solid.normals = list(solid.positions)
    material = gltf.lambert("clay", CLAY)
    if steps:
        triangles = tessellation.by_function(solid, lambda P: scale * (_sum_of_sines(terms, P) - 0.25), 16 * steps)
        mesh = scene.mesh("waves", tessellation.as_mesh(triangles), material)
    else:
        settings = {"heightGraph": _graph(terms), "scale": scale, "midlevel": 0.25, "cells": 256}
        material["extensions"]["RELIEF_displacement"] = settings
        mesh = scene.mesh("waves", solid, material)
    scene.node("waves", mesh, translation=[0, 1.1, 0], rotation=list(vector.axis_angle((1, 0, 0), 20)))
    scene.terrace()
    scene.document.add_camera((0.8, 2.6, 4.6), (0, 0.95, 0), 36)
    return scene


def displaced_curved(steps):
    """A curved base through a ball's vertices is the ball; with a graph of directions on top, a ball of waves."""
    waves = 0.05
    scene = _Scene("displaced_curved", steps, 3)
    coarse = meshes.icosphere(2)
    coarse.normals = list(coarse.positions)
    stored = None if steps else scene.document.add_attributes(coarse)
    for x, name, color, amplitude in ((-1.1, "ball", CLAY, 0.0), (1.1, "waves", (0.4, 0.6, 0.45), waves)):
        material = gltf.lambert(name, color)
        if steps:
            # A facet's inner points lie below the ball by a few 10⁻⁵.
            ball = meshes.icosphere(3 + round(math.log2(steps)))
            direction = np.array(ball.positions)
            radius = 1 + amplitude * np.sin(11 * direction[:, 0]) * np.sin(11 * direction[:, 1] + 0.5)
            ball.positions = (direction * radius[:, None]).tolist()
            mesh = scene.mesh(name, ball, material)
        else:
            settings = {"curved": True, "cells": 64}
            if amplitude:
                settings |= {"heightGraph": _product_of_sines(11, 0.5), "scale": amplitude, "midlevel": 0}
            material["extensions"]["RELIEF_displacement"] = settings
            mesh = scene.document.add_mesh_like(name, stored, scene.document.add_material(material))
        scene.node(name, mesh, translation=[x, 1.0, 0])
    scene.terrace()
    scene.document.add_camera((0.3, 2.4, 5.6), (0, 0.75, 0), 36)
    return scene


def _product_of_sines(frequency, phase):
    """sin(frequency · x) · sin(frequency · y + phase) of the direction (x, y, z) from the object's origin."""
    value = lambda node, output="value": {"node": node, "output": output}  # noqa: E731
    nodes = [
        {"type": "texture-coordinate"},
        {"type": "vector-math", "operation": "normalize", "inputs": {"a": value(0, "object")}},
        {"type": "separate", "inputs": {"vector": value(1, "vector")}},
        {"type": "math", "operation": "multiply", "inputs": {"a": value(2, "x"), "b": frequency}},
        {"type": "math", "operation": "sine", "inputs": {"a": value(3)}},
        {"type": "math", "operation": "multiply-add", "inputs": {"a": value(2, "y"), "b": frequency, "c": phase}},
        {"type": "math", "operation": "sine", "inputs": {"a": value(5)}},
        {"type": "math", "operation": "multiply", "inputs": {"a": value(4), "b": value(6)}},
    ]
    return {"nodes": nodes, "outputs": {"height": value(7)}}


def displaced_instances(steps):
    """One displaced mesh many times, stretched unevenly and turned; and one whose metres are those of the world."""
    scene = _Scene("displaced_instances", steps, 3)
    texels = _bumps(8, 16, 8)
    texels[0] = texels[-1] = 0
    heights = HeightMap(texels, 0.3, 0.1, (4.0, 1.0))
    ball = _ball(8, 5, 0.5)
    copies = scene.by_map("copies", ball, gltf.lambert("clay", CLAY), heights)
    placements = [
        ((-1.5, 0.5, -0.4), ((0, 1, 0), 30), (0.9, 0.6, 1.5)),
        ((0.0, 0.8, -0.9), ((0, 0, 1), 70), (1.6, 0.7, 0.8)),
        ((-0.3, 0.35, 0.9), ((1, 0, 0), -40), (1.2, 0.5, 0.6)),
    ]
    rotations = [vector.axis_angle(axis, degrees) for _, (axis, degrees), _ in placements]
    scene.document.add_instances("copies", copies, [p[0] for p in placements], rotations, [p[2] for p in placements])
    size, place = (0.6, 1.5, 1.1), (1.45, 0.75, 0.1)
    if steps:
        # The normal between vertices is interpolated first and then brought to the world: stretched the other way round.
        stretched = meshes.Mesh(
            (np.array(ball.positions) * size).tolist(),
            ball.triangles,
            (np.array(ball.normals) / size).tolist(),
            ball.uvs,
        )
        scene.node("world", scene.by_map("world", stretched, gltf.lambert("green", (0.4, 0.6, 0.45)), heights),
                   translation=list(place))
    else:
        material = gltf.lambert("green", (0.4, 0.6, 0.45))
        scene.node("world", scene.by_map("world", ball, material, heights, space="world"), translation=list(place),
                   scale=list(size))
    scene.terrace()
    scene.document.add_camera((0.3, 2.6, 4.6), (0, 0.45, 0), 36)
    return scene


def displaced_mirror(steps):
    """A displaced column, seen in a flat mirror and in one that is itself displaced."""
    scene = _Scene("displaced_mirror", steps, 6, caustics={"mode": "off"})
    texels, middle = _waves(24, 16)
    ripples = HeightMap(texels, 0.12, middle, clamped=True)
    scene.node("pool", scene.by_map("pool", _patch(2.0, 2.0), gltf.metal("silver", (0.9, 0.85, 0.8), 0.0), ripples, 16))
    mirror = meshes.quad((-2.0, 0.0, -1.8), (3.2, 0, -0.6), (0, 2.4, 0))
    scene.node("mirror", scene.mesh("mirror", mirror, gltf.metal("gold", (0.9, 0.7, 0.4), 0.0)))
    column = _ball(10, 6, 0.6)
    texels = _bumps(12, 16, 8)
    texels[0] = texels[-1] = 0
    heights = HeightMap(texels, 0.25, 0.2, (3.0, 1.0))
    scene.node("column", scene.by_map("column", column, gltf.lambert("clay", CLAY), heights), translation=[0.5, 1.05, -0.5])
    scene.environment(**SKY)
    scene.document.add_area_light("lamp", (1.6, 3.6, 2.2), (0, 0.8, 0), 1.6, 1.6, (6, 5, 4))
    scene.document.add_camera((0.2, 2.1, 4.2), (0, 0.6, -0.4), 38)
    return scene


def caustic_ball(steps):
    """Photons through a ball of flat facets on to a floor. The twin is the same scene."""
    # A first radius of a fiftieth of the focus: the bias of wider ones could be seen.
    scene = _Scene("caustic_ball", steps, 8, caustics={"mode": "on", "radius": 0.02})
    glass = scene.mesh("ball", meshes.icosphere(2), gltf.glass("glass", ior=1.5))
    scene.node("ball", glass, translation=[0.1, 0.75, 0], scale=[0.5, 0.5, 0.5])
    scene.floor((0.75, 0.7, 0.6))
    scene.document.add_area_light("lamp", (-1.2, 2.6, 0.4), (0, 0.3, 0), 1.2, 1.2, (6, 5.5, 5))
    scene.document.add_camera((0.5, 2.0, 3.0), (0.2, 0.3, 0), 36)
    return scene


def caustic_slab(steps):
    """Photons through a displaced surface: waves of glass over a floor."""
    scene = _Scene("caustic_slab", steps, 8, caustics={"mode": "on", "radius": 0.02})
    texels, middle = _waves(24, 16)
    _slab(scene, HeightMap(texels, 0.5, middle, clamped=True), 0.9, 1.1, 0.8, 16)
    scene.floor((0.75, 0.7, 0.6))
    scene.document.add_area_light("lamp", (0.6, 3.4, -0.6), (0, 0, 0), 1.2, 1.2, (6, 5.5, 5))
    scene.document.add_camera((0.4, 1.5, 3.8), (0, 0.35, 0), 38)
    return scene


SCENES = {
    scene.__name__: scene
    for scene in (
        displaced_bumps,
        displaced_pits,
        displaced_sphere,
        displaced_seam,
        displaced_cliff,
        displaced_slab,
        displaced_graph,
        displaced_curved,
        displaced_instances,
        displaced_mirror,
        caustic_ball,
        caustic_slab,
    )
}


def save(name, folder):
    """Writes the scene that relief reads; returns the number of bytes."""
    return SCENES[name](None).document.save(folder)


def save_twin(name, folder, steps):
    """Writes the twin of triangles; its displaced cells are cut into two times steps² of them."""
    return SCENES[name](steps).document.save(folder)
