"""Twelve more scenes, as those of scenes.py, which writes them."""

import math
import random

import bpy
import numpy as np
import stage
from mathutils import Euler, Vector
from stage import NodeTree


def product():
    stage.softboxes(0.35)
    stage.backdrop(stage.plastic("backdrop", (0.7, 0.68, 0.65), 0.4), 6, 3, 4, 1.0)
    label = stage.checked("label", (0.05, 0.15, 0.25), (0.8, 0.7, 0.4), 3.0, 0.5)
    jar = [(0.001, 0), (0.4, 0), (0.42, 0.03), (0.42, 0.5), (0.38, 0.55), (0.001, 0.55)]
    stage.turned(stage.plastic("jar", (0.9, 0.88, 0.85), 0.15, Clearcoat=0.5), jar, (0, 0, 0), 64)
    stage.turned(label, [(0.422, 0.1), (0.422, 0.42)], (0, 0, 0), 64)
    lid = [(0.001, 0), (0.42, 0), (0.43, 0.02), (0.43, 0.18), (0.41, 0.2), (0.001, 0.2)]
    stage.turned(stage.metal("lid", (1.0, 0.8, 0.5), 0.15), lid, (0, 0, 0.55), 64)
    stage.box(stage.plastic("carton", (0.05, 0.2, 0.3), 0.35), (-1.3, 0.0, 0), (-0.6, 0.6, 1.0), 0.01)
    tube = [(0.001, 0), (0.1, 0), (0.12, 0.02), (0.12, 0.6), (0.04, 0.7), (0.04, 0.75), (0.001, 0.75)]
    stage.turned(stage.metal("tube", (0.85, 0.85, 0.87), 0.3), tube, (0.75, -0.1, 0))
    stage.camera((0.4, -4.6, 1.5), (-0.2, 0, 0.42), 52)


def night():
    stage.begin((0.01, 0.015, 0.04), 1.0)
    stage.room_shell(stage.plaster("wall", (0.55, 0.5, 0.45)), stage.wood("floor"))
    stage.furniture(stage.plastic("sofa", (0.3, 0.12, 0.08), 0.9, Sheen=0.5), stage.wood())
    paper = NodeTree("shade")
    cloth = paper.node("BsdfTranslucent", {"Color": (0.8, 0.65, 0.45, 1)})
    solid = paper.node("BsdfDiffuse", {"Color": (0.8, 0.7, 0.55, 1)})
    shade = paper.end(paper.node("MixShader", {0: 0.5, 1: cloth.outputs[0], 2: solid.outputs[0]}).outputs[0])
    for x, y, z in ((2.1, 2.65, 1.2), (-2.1, 2.3, 1.3), (0.0, 1.1, 2.0)):
        stage.turned(shade, [(0.22, -0.15), (0.15, 0.15)], (x, y, z))
        stage.lamp("POINT", (x, y, z), (x, y, 0), 25.0, shadow_soft_size=0.05, color=(1, 0.65, 0.3))
        stage.tube(stage.metal("stand", (0.2, 0.2, 0.2), 0.4), [(x, y, 0 if z < 1.5 else 2.7), (x, y, z)], 0.012)
    stage.box(stage.glowing("television", (0.3, 0.45, 1.0), 4.0), (-2.45, -0.6, 0.8), (-2.42, 0.6, 1.5), 0)
    stage.lamp("SUN", (-6, -3, 6), (0, 0.5, 0), 0.2, color=(0.6, 0.7, 1))
    stage.camera((-0.6, -2.8, 1.5), (0.3, 1.5, 0.9), 24)


def _tree(trunk, leaf, chance):
    """A trunk and a crown of leaves, in one mesh each, out of sight."""
    wood = stage.turned(trunk, [(0.16, 0), (0.1, 1.2), (0.07, 2.4), (0.001, 3.4)], (0, 0, -50), 12)
    points, faces = [], []
    for _ in range(1500):
        a, b, r = chance.uniform(0, math.tau), math.acos(chance.uniform(-1, 1)), 1.3 * chance.random() ** 0.4
        x, y, z = r * math.sin(b) * math.cos(a), r * math.sin(b) * math.sin(a), 2.8 + 1.2 * r * math.cos(b)
        u, v = ([chance.gauss(0, 0.07) for _ in range(3)] for _ in range(2))
        k = len(points)
        points += [(x, y, z), (x + u[0], y + u[1], z + u[2]), (x + u[0] + v[0], y + u[1] + v[1], z + u[2] + v[2])]
        points.append((x + v[0], y + v[1], z + v[2]))
        faces.append((k, k + 1, k + 2, k + 3))
    mesh = bpy.data.meshes.new("crown")
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(leaf)
    crown = stage.link(mesh, "crown")
    crown.location = (0, 0, -50)
    return wood, crown


def garden():
    stage.sky(elevation=40, rotation=-60)
    grass = stage.mottled("grass", (0.03, 0.08, 0.01), (0.12, 0.2, 0.04), scale=2.0, roughness=(0.8, 1.0))
    stage.add("plane", grass, size=120)
    leaf = NodeTree("leaf")
    front = leaf.node("BsdfDiffuse", {"Color": (0.1, 0.25, 0.04, 1)})
    through = leaf.node("BsdfTranslucent", {"Color": (0.2, 0.4, 0.05, 1)})
    leaf = leaf.end(leaf.node("MixShader", {0: 0.35, 1: front.outputs[0], 2: through.outputs[0]}).outputs[0])
    chance = random.Random(8)
    trunk = stage.mottled("bark", (0.08, 0.05, 0.03), (0.2, 0.14, 0.09), scale=10.0, roughness=(0.8, 1.0))
    parts = _tree(trunk, leaf, chance)
    for _ in range(120):
        x, y = chance.uniform(-25, 25), chance.uniform(-2, 45)
        if abs(x) < 5 and y < 9:
            continue
        size, turn = chance.uniform(0.8, 1.9), chance.uniform(0, math.tau)
        for part in parts:
            stage.copy(part, (x, y, 0), size, (0, 0, turn))
    wall = stage.plaster("render", (0.7, 0.66, 0.58))
    stage.box(wall, (-3, 2, 0), (3, 7, 2.8))
    gable = bpy.data.meshes.new("gable")
    gable.from_pydata([(-3, 2, 2.8), (3, 2, 2.8), (0, 2, 4.4)], [], [(0, 1, 2)])
    gable.materials.append(wall)
    stage.link(gable, "gable")
    roof = stage.mottled("tiles", (0.25, 0.07, 0.04), (0.35, 0.12, 0.07), scale=8.0, roughness=(0.6, 0.9))
    for side in (-1, 1):
        stage.add("cube", roof, (1.6 * side, 4.5, 3.5), (3.8, 5.8, 0.12), (0, 28 * side, 0), smooth=False, size=1)
    for x in (-1.9, 1.1):
        stage.box(stage.plastic("frame", stage.WHITE), (x - 0.08, 1.93, 0.9), (x + 0.98, 2.0, 2.1), 0.01)
        stage.box(stage.plastic("pane", (0.02, 0.03, 0.04), 0.02), (x, 1.91, 0.98), (x + 0.9, 1.99, 2.02), 0)
    stage.box(stage.wood("door"), (-0.5, 1.94, 0), (0.45, 2.0, 2.1), 0.01)
    stage.camera((4.5, -8.5, 1.8), (-0.3, 3, 1.7), 35)


def character():
    stage.begin((0.25, 0.27, 0.32), 0.6)
    stage.backdrop(stage.plastic("backdrop", (0.25, 0.4, 0.45), 0.8), 10, 5, 6, 2.0)
    skin = stage.plastic("skin", (0.75, 0.42, 0.3), 0.45)
    cloth = stage.mottled("jumper", (0.5, 0.1, 0.08), (0.6, 0.15, 0.1), scale=40.0, roughness=(0.8, 1.0))
    trousers, boot = stage.plastic("trousers", (0.06, 0.09, 0.2), 0.8, Sheen=0.6), stage.plastic("boot", (0.08, 0.04, 0.02), 0.3)
    eye, pupil = stage.plastic("eye", (0.9, 0.9, 0.9), 0.05, Clearcoat=1.0), stage.plastic("pupil", stage.BLACK, 0.05)
    stage.add("uv_sphere", skin, (0, 0, 1.75), (1, 0.95, 1.05), radius=0.5, subdivide=1)
    stage.add("uv_sphere", cloth, (0, 0, 0.95), (1, 0.8, 1.15), radius=0.42, subdivide=1)
    stage.add("uv_sphere", skin, (0, -0.5, 1.7), (1, 1, 0.9), radius=0.09)
    stage.add("torus", cloth, (0, 0, 1.3), major_radius=0.2, minor_radius=0.09)
    hat = [(0.001, 0.45), (0.2, 0.42), (0.42, 0.2), (0.5, 0.0), (0.56, -0.02), (0.54, -0.06), (0.46, -0.04)]
    stage.turned(cloth, hat[::-1], (0, 0, 2.0))
    stage.add("uv_sphere", stage.plastic("bobble", stage.WHITE, 1.0, Sheen=1.0), (0, 0, 2.5), radius=0.13)
    for side in (-1, 1):
        stage.add("uv_sphere", eye, (0.19 * side, -0.4, 1.83), radius=0.11)
        stage.add("uv_sphere", pupil, (0.185 * side, -0.485, 1.83), (1, 0.6, 1), radius=0.055)
        stage.tube(cloth, [(0.3 * side, 0, 1.15), (0.6 * side, -0.05, 0.9), (0.68 * side, -0.2, 0.65)], 0.11)
        stage.add("uv_sphere", skin, (0.69 * side, -0.24, 0.58), radius=0.13)
        stage.tube(trousers, [(0.18 * side, 0, 0.6), (0.2 * side, 0, 0.15)], 0.17)
        stage.add("uv_sphere", boot, (0.21 * side, -0.09, 0.1), (1, 1.5, 0.65), radius=0.18)
    stage.lamp("AREA", (-3, -3.5, 3.5), (0, 0, 1.2), 300.0, size=1.5)
    stage.lamp("AREA", (3.5, -2.5, 2), (0, 0, 1.2), 80.0, size=2, color=(0.8, 0.9, 1))
    stage.lamp("AREA", (1.5, 3, 3.5), (0, 0, 1.6), 250.0, size=1, color=(1, 0.9, 0.8))
    stage.camera((0.6, -6.5, 1.7), (0, 0, 1.3), 42)


def bottle():
    stage.begin((0.4, 0.42, 0.45), 0.6)
    stage.backdrop(stage.plastic("backdrop", (0.6, 0.6, 0.58), 0.5), 8, 3, 5, 1.5)
    outer = [(0.001, 0.0), (0.36, 0.0), (0.38, 0.04), (0.38, 1.1), (0.3, 1.3), (0.12, 1.5), (0.11, 1.85), (0.13, 1.86)]
    inner = [(0.13, 1.92), (0.085, 1.92), (0.085, 1.5), (0.27, 1.27), (0.35, 1.08), (0.35, 0.06), (0.001, 0.05)]
    stage.turned(stage.glass("bottle", (0.9, 1.0, 0.93), ior=1.5), outer + inner, (0, 0, stage.CLEAR), 64)
    # A little into the glass, as it is done so that no air is in between.
    liquid = [(0.001, 0.045), (0.353, 0.055), (0.353, 0.95), (0.001, 0.95)]
    stage.turned(stage.plastic("liquid", (0.9, 0.35, 0.1), 0.0, Transmission=1.0, IOR=1.33), liquid, (0, 0, stage.CLEAR), 64)
    stage.turned(stage.plastic("cork", (0.4, 0.25, 0.12), 0.9), [(0.001, 1.75), (0.083, 1.75), (0.1, 2.05), (0.001, 2.05)])
    tumbler = [(0.001, 0), (0.2, 0), (0.24, 0.5), (0.22, 0.5), (0.185, 0.05), (0.001, 0.05)]
    stage.turned(stage.glass("tumbler"), tumbler, (0.75, -0.35, stage.CLEAR))
    water = [(0.001, 0.048), (0.186, 0.048), (0.2105, 0.3), (0.001, 0.3)]
    stage.turned(stage.plastic("water", stage.WHITE, 0.0, Transmission=1.0, IOR=1.33), water, (0.75, -0.35, stage.CLEAR))
    lemon = stage.mottled("lemon", (0.8, 0.6, 0.05), (0.9, 0.7, 0.1), scale=25.0, roughness=(0.3, 0.5))
    stage.add("uv_sphere", lemon, (-0.7, -0.3, 0.2), (1.25, 1, 1), radius=0.2)
    stage.lamp("AREA", (-3, -1.5, 3), (0, 0, 0.7), 200.0, size=1.2)
    stage.lamp("AREA", (2.5, 1.0, 2.2), (0, 0, 0.8), 100.0, shape="RECTANGLE", size=0.5, size_y=2.0)
    stage.camera((0.2, -5.4, 1.6), (0.05, 0, 0.95), 44)


def scan():
    stage.softboxes(0.4)
    stage.backdrop(stage.plastic("backdrop", (0.12, 0.12, 0.13), 0.7), 8, 4, 5, 1.5)
    disk = [(0.001, 0.0), (1.2, 0.0), (1.22, 0.02), (1.22, 0.13), (1.2, 0.15), (0.001, 0.15)]
    stage.turned(stage.plastic("turntable", (0.3, 0.3, 0.3), 0.3), disk, steps=96)
    painted = NodeTree("scan")
    colors = painted.node("VertexColor", layer_name="scanned").outputs[0]
    skin = painted.end(painted.principled(colors, 0.6))
    statue = stage.add("monkey", skin, (0, 0, 1.05), rotation=(-20, 0, 25), size=1.7)
    for kind, settings in (("SUBSURF", {"levels": 5, "render_levels": 5}), ("DISPLACE", {"strength": 0.02, "mid_level": 0.5})):
        modifier = statue.modifiers.new(kind.lower(), kind)
        for name, value in settings.items():
            setattr(modifier, name, value)
    texture = bpy.data.textures.new("pores", "CLOUDS")
    texture.noise_scale = 0.06
    modifier.texture = texture
    for modifier in list(statue.modifiers):
        bpy.ops.object.modifier_apply(modifier=modifier.name)
    layer = statue.data.color_attributes.new("scanned", "FLOAT_COLOR", "POINT")
    values = []
    for vertex in statue.data.vertices:
        x, y, z = vertex.co
        worn = 0.5 + 0.5 * math.sin(9 * x + 4 * math.sin(7 * z)) * math.sin(8 * y + 5 * x)
        values += [0.3 + 0.35 * worn, 0.22 + 0.25 * worn, 0.15 + 0.12 * worn, 1.0]
    layer.data.foreach_set("color", values)
    stage.camera((0, -5.2, 2.0), (0, 0, 0.95), 60)


def isometric():
    stage.begin((0.8, 0.85, 1.0), 0.7)
    stage.add("plane", stage.plastic("table", (0.75, 0.6, 0.55), 0.8), (0, 0, -0.2), size=60)
    wall, floor = stage.plastic("wall", (0.45, 0.6, 0.65), 0.8), stage.checked("floor", (0.6, 0.5, 0.4), (0.45, 0.33, 0.22), 2.0)
    stage.box(floor, (-2, -2, -0.2), (2, 2, 0))
    stage.box(wall, (-2, 2, -0.2), (2.15, 2.15, 2.6))
    stage.box(wall, (-2.15, -2, -0.2), (-2, 2.15, 2.6))
    wood, cushion = stage.wood(), stage.plastic("cushion", (0.7, 0.35, 0.3), 0.9)
    stage.box(wood, (-1.95, 0.3, 0.1), (-0.9, 1.95, 0.35), 0.03)
    stage.box(stage.plastic("mattress", (0.8, 0.78, 0.7), 0.9), (-1.93, 0.33, 0.3), (-0.92, 1.93, 0.55), 0.08)
    stage.box(cushion, (-1.8, 1.45, 0.55), (-1.05, 1.85, 0.7), 0.06)
    stage.box(wood, (0.4, 1.35, 0.7), (1.9, 1.95, 0.76))
    for x in (0.45, 1.8):
        stage.box(wood, (x, 1.4, 0), (x + 0.06, 1.9, 0.7), 0.01)
    stage.box(stage.plastic("case", stage.BLACK, 0.3), (0.9, 1.75, 0.82), (1.5, 1.79, 1.2), 0.01)
    stage.box(stage.glowing("screen", (0.4, 0.7, 1.0), 2.0), (0.92, 1.74, 0.84), (1.48, 1.752, 1.18), 0)
    stage.turned(stage.plastic("pot", (0.7, 0.25, 0.12), 0.7), [(0.001, 0), (0.15, 0), (0.2, 0.3), (0.001, 0.28)], (1.6, -1.5, 0))
    leaf = stage.plastic("leaf", (0.08, 0.3, 0.08), 0.4)
    for k in range(14):
        a = 2.4 * k
        turn = (50 + 2 * k, 0, math.degrees(a))
        place = (1.6 + 0.16 * math.sin(a), -1.5 - 0.16 * math.cos(a), 0.5)
        stage.add("uv_sphere", leaf, place, (0.35, 0.05, 1), turn, radius=0.28)
    stage.turned(stage.plastic("rug", (0.8, 0.75, 0.5), 1.0), [(0.001, 0.02), (0.8, 0.02), (0.8, 0)], (0.5, -0.4, 0))
    stage.add("uv_sphere", stage.metal("globe", (0.9, 0.6, 0.3), 0.3), (0.4, -0.5, 0.25), radius=0.22)
    stage.lamp("SUN", (5, -4, 7), (0, 0, 0), 3.0, angle=0.05)
    stage.lamp("POINT", (0.6, 1.6, 1.4), (0, 0, 0), 20.0, color=(1, 0.7, 0.4))
    stage.camera((12, -12, 10), (0.15, 0.15, 0.75), type="ORTHO", ortho_scale=8.5)


def logo():
    stage.begin((0.02, 0.02, 0.025), 1.0)
    stage.add("plane", stage.plastic("floor", (0.03, 0.03, 0.035), 0.15), size=40)
    stage.text(stage.metal("gold", (1.0, 0.75, 0.35), 0.18), "RELIEF", (0, 0, 0.02), 1.4, extrude=0.15, bevel=0.03)
    stage.text(stage.plastic("blue", (0.05, 0.2, 0.7), 0.3, Clearcoat=1.0), "render", (1.3, -0.9, 0.02), 0.6, extrude=0.08)
    stage.lamp("AREA", (-4, -4, 4), (0, 0, 0.5), 400.0, shape="RECTANGLE", size=3, size_y=0.6)
    stage.lamp("AREA", (4, -2, 2.5), (0, 0, 0.5), 150.0, size=1, color=(0.6, 0.75, 1))
    stage.lamp("AREA", (0, 4, 3), (0, 0, 0.5), 300.0, size=2, color=(1, 0.7, 0.5))
    stage.camera((-0.8, -6.5, 1.5), (0, 0, 0.5), 42)


def corridor():
    stage.begin((0, 0, 0), 1.0)
    panel = stage.mottled("panel", (0.18, 0.19, 0.2), (0.28, 0.29, 0.3), scale=3.0, roughness=(0.2, 0.5))
    panel.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 0.8
    dark = stage.metal("dark", (0.1, 0.1, 0.11), 0.4)
    white, red = stage.glowing("white", (0.75, 0.9, 1.0), 30.0), stage.glowing("red", (1.0, 0.1, 0.05), 20.0)
    stage.box(dark, (-1.5, -2, -0.1), (1.5, 22, 0), 0)
    stage.box(dark, (-1.5, -2, 2.6), (1.5, 22, 2.7), 0)
    stage.box(dark, (-1.5, 22, 0), (1.5, 22.1, 2.7), 0)
    pieces = []
    for side in (-1, 1):
        pieces.append(stage.box(panel, (side * 1.5 - 0.05, 0.05, 0.25), (side * 1.5 + 0.05, 1.85, 2.2), 0.04))
        pieces.append(stage.box(dark, (side * 1.42 - 0.1, -0.08, 0), (side * 1.42 + 0.1, 0.08, 2.6), 0.03))
        pieces.append(stage.box(white, (side * 1.3 - 0.03, 0.3, 2.52), (side * 1.3 + 0.03, 1.7, 2.56), 0))
        pieces.append(stage.box(white, (side * 1.44 - 0.02, 0.3, 0.1), (side * 1.44 + 0.02, 1.7, 0.14), 0))
    pieces.append(stage.box(panel, (-1.2, 0.05, -0.02), (1.2, 1.95, 0.02), 0.01))
    for piece in pieces:
        array = piece.modifiers.new("array", "ARRAY")
        array.count, array.use_relative_offset, array.use_constant_offset = 11, False, True
        array.constant_offset_displace = (0, 2, 0)
    for z in (2.35, 2.45):
        stage.tube(stage.metal("pipe", (0.7, 0.5, 0.3), 0.3), [(-0.9, -2, z), (-0.9, 22, z)], 0.04)
    stage.box(red, (-0.6, 21.95, 1.2), (0.6, 21.98, 1.3), 0)
    stage.camera((0.25, -1.5, 1.4), (0, 10, 1.15), 24)


def macro():
    stage.softboxes(0.4)
    stage.add("plane", stage.wood("board"), size=3)
    chance = random.Random(2)
    skin = stage.mottled("berry", (0.02, 0.03, 0.12), (0.06, 0.06, 0.2), scale=6.0, roughness=(0.3, 0.6), bump=False)
    berry = stage.add("uv_sphere", skin, (0, 0, 0.1), (1, 1, 0.9), radius=0.11, segments=48, ring_count=24)
    drop = stage.add("ico_sphere", stage.glass("dew", ior=1.33), (0.03, -0.09, 0.165), subdivisions=3, radius=0.014)
    for _ in range(46):
        x, y = chance.gauss(0, 0.45), chance.gauss(0.25, 0.55)
        stage.copy(berry, (x, y, 0.1), chance.uniform(0.8, 1.1), [chance.uniform(0, 3) for _ in range(3)])
    for _ in range(60):
        a, b = chance.uniform(math.pi, math.tau), chance.uniform(0.3, 1.4)
        place = (0.11 * math.sin(b) * math.cos(a), 0.11 * math.sin(b) * math.sin(a), 0.1 + 0.1 * math.cos(b))
        stage.copy(drop, place, chance.uniform(0.3, 0.9))
    green = stage.plastic("leaf", (0.06, 0.25, 0.04), 0.35)
    sides = {"x_subdivisions": 12, "y_subdivisions": 8}
    leaf = stage.add("grid", green, (-0.25, -0.15, 0.06), (0.16, 0.08, 1), (10, -15, 30), **sides)
    bend = leaf.modifiers.new("bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle = "BEND", 0.8
    stage.camera((0.25, -1.5, 0.65), (0.0, -0.09, 0.13), 75, fstop=1.4)


def _leaf():
    """A leaf that is an image on a square, clear around its shape."""
    across, along = np.meshgrid(np.linspace(0, 1, 256), np.linspace(0, 1, 256))
    shape = (across - 0.5) ** 2 / 0.04 + (along - 0.5) ** 2 / 0.2 < 1
    pixels = np.stack((0.1 + 0.05 * np.sin(40 * across), 0.35 + 0.2 * along, 0.05 + 0 * along, shape), -1)
    image = bpy.data.images.new("leaf", 256, 256, alpha=True)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    t = NodeTree("leaf")
    look = t.node("TexImage")
    look.image = image
    shader = t.node("BsdfPrincipled", {"Base Color": look.outputs[0], "Alpha": look.outputs[1]})
    return t.end(shader.outputs[0])


def forest():
    stage.begin((0.5, 0.6, 0.8), 1.0)
    stage.add("plane", stage.plastic("ground", (0.2, 0.25, 0.1), 0.9), size=80)
    chance = random.Random(2)
    points, faces = [], []
    for _ in range(2500):
        middle = [chance.gauss(0, 0.7), chance.gauss(0, 0.7), 2.6 + chance.gauss(0, 0.6)]
        turn = Euler([chance.uniform(0, math.tau) for _ in range(3)])
        for corner in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            place = Vector((0.12 * corner[0], 0.12 * corner[1], 0))
            place.rotate(turn)
            points.append([a + b for a, b in zip(middle, place)])
        faces.append(range(len(points) - 4, len(points)))
    mesh = bpy.data.meshes.new("crown")
    mesh.from_pydata(points, [], faces)
    places = mesh.uv_layers.new().data
    for i, place in enumerate(places):
        place.uv = ((0, 0), (1, 0), (1, 1), (0, 1))[i % 4]
    mesh.materials.append(_leaf())
    crown = stage.link(mesh, "crown")
    trunk = stage.turned(stage.plastic("bark", (0.2, 0.12, 0.07), 0.9), [(0.15, 0), (0.06, 2.5)], (0, 0, 0), 8)
    for part in (crown, trunk):
        part.location = (0, 0, -50)
    for _ in range(150):
        x, y = chance.uniform(-20, 20), chance.uniform(-2, 40)
        size, turn = chance.uniform(0.8, 1.6), chance.uniform(0, math.tau)
        for part in (crown, trunk):
            stage.copy(part, (x, y, 0), size, (0, 0, turn))
    stage.lamp("SUN", (-3, -8, 9), (0, 0, 0), 4.0, angle=0.01)
    stage.camera((0, -9, 2.2), (0, 0, 3), 32)


def _packed(name, pixels, is_color=True):
    """An 8-bit image of (height, width, 3) values, packed into the file."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(name, width, height)
    if not is_color:
        image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.dstack((pixels, np.ones((height, width)))).astype(np.float32).ravel())
    image.pack()
    return image


def _parquet():
    """Planks as people load them: images of colour, roughness and normals, repeated by a Mapping node."""
    size = 1024
    v, u = np.mgrid[0:size, 0:size] / size
    chance = np.random.default_rng(5)
    row = (v * 8).astype(int)
    plank = (row * 3 + ((u * 2 + row * 0.37) % 2).astype(int)) % 24
    tone = chance.uniform(0.6, 1.0, 24)[plank]
    grain = np.sin(2 * np.pi * (60 * v + 3 * np.sin(2 * np.pi * u) + plank)) * np.sin(2 * np.pi * (7 * u + plank))
    across, along = (v * 8) % 1, (u * 2 + row * 0.37) % 1
    gap = (np.minimum(across, 1 - across) < 0.02) | (np.minimum(along, 1 - along) < 0.004)
    height = np.where(gap, -1.0, 0.15 * grain)
    color = np.where(gap[..., None], 0.02, (tone * (0.8 + 0.2 * grain))[..., None] * np.array((0.62, 0.4, 0.24)))
    slopes = [np.roll(height, 1, axis) - np.roll(height, -1, axis) for axis in (1, 0)]
    normal = np.dstack((*slopes, np.full_like(height, 2.0)))
    normal = 0.5 + 0.5 * normal / np.linalg.norm(normal, axis=2, keepdims=True)
    roughness = np.repeat(np.where(gap, 0.9, 0.25 + 0.1 * grain)[..., None], 3, 2)
    t = NodeTree("parquet")
    place = t.node("Mapping", {0: t.node("TexCoord").outputs["UV"], "Scale": (4, 4, 4)}).outputs[0]
    looks = []
    for name, pixels in (("color", color), ("roughness", roughness), ("normal", normal)):
        looks.append(t.node("TexImage", {0: place}))
        looks[-1].image = _packed(f"parquet {name}", pixels, name == "color")
    bumped = t.node("NormalMap", {"Color": looks[2].outputs[0], "Strength": 0.6})
    return t.end(t.principled(looks[0].outputs[0], looks[1].outputs[0], Normal=bumped.outputs[0]))


def _painting(number):
    """A picture of fine and coarse lines, letters and patches."""
    v, u = np.mgrid[0:768, 0:1024] / 1024
    chance = np.random.default_rng(number)
    color = np.ones((768, 1024, 3)) * chance.uniform(0.1, 0.9, 3)
    for _ in range(60):
        x, y, w, h = chance.uniform(0, 1), chance.uniform(0, 0.75), chance.exponential(0.08), chance.exponential(0.08)
        inside = (abs(u - x) < w) & (abs(v - y) < h)
        stripes = 0.5 + 0.5 * np.sign(np.sin(2 * np.pi * chance.integers(10, 120) * (u if chance.random() < 0.5 else v)))
        color = np.where(inside[..., None], chance.uniform(0, 1, 3) * (0.3 + 0.7 * stripes)[..., None], color)
    t = NodeTree("painting")
    look = t.node("TexImage")
    look.image = _packed("painting", color)
    return t.end(t.principled(look.outputs[0], 0.6))


def gallery():
    stage.begin((0.8, 0.85, 0.95), 0.15)
    stage.room_shell(stage.plaster("wall", (0.8, 0.79, 0.77)), stage.plaster("under"), 7.0, 7.0, 3.2)
    stage.add("plane", _parquet(), (0, 0, 0.005), smooth=False, size=6.9)
    for i in range(5):
        stage.add("plane", _painting(i), (-2.6 + 1.3 * i, 3.49, 1.5), (0.5, 0.4, 1), (90, 0, 0), smooth=False)
    for i in range(3):
        stage.add("plane", _painting(9 + i), (3.49, -1.5 + 1.8 * i, 1.5), (0.6, 0.5, 1), (90, 0, -90), smooth=False)
    bench = stage.plastic("bench", (0.04, 0.04, 0.045), 0.2)
    stage.box(bench, (-0.9, 0.4, 0.38), (0.9, 0.9, 0.46))
    for x in (-0.85, 0.75):
        stage.box(bench, (x, 0.45, 0), (x + 0.1, 0.85, 0.38))
    for x in (-2.0, 0.0, 2.0):
        stage.lamp("AREA", (x, 0.5, 3.15), (x, 0.5, 0), 60, shape="RECTANGLE", size=0.3, size_y=4.0)
    stage.camera((-1.4, -3.2, 1.55), (0.5, 2.0, 1.1), 26)


SCENES = {
    f.__name__: f
    for f in (product, night, garden, character, bottle, scan, isometric, logo, corridor, macro, forest, gallery)
}
