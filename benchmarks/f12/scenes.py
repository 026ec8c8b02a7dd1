"""Scenes of the kinds that people make, each a function without arguments that builds it in the open file.

With Blender's default settings. Volumes, subsurface scattering and hair are in inside_scenes.py, what only Blender 4 and 5 have in new_scenes.py.

    blender -b --factory-startup --addons relief --python benchmarks/f12/scenes.py -- FOLDER [SCENE…]

writes each as FOLDER/SCENE.blend; needs the add-on in Blender's scripts folder, as benchmarks/f12/run.py has it.
"""

import math
import os
import random
import sys

import bpy

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import inside_scenes  # noqa: E402
import more_scenes  # noqa: E402
import new_scenes  # noqa: E402
import stage  # noqa: E402
from stage import NodeTree  # noqa: E402



def monkeys():
    stage.begin((0.3, 0.45, 0.7), 0.5)
    stage.add("plane", stage.checked("floor", (0.5, 0.5, 0.5), (0.3, 0.3, 0.3), 2.0), size=20)
    skins = (
        stage.plastic("plain", (0.7, 0.2, 0.1)),
        stage.metal("metal", (0.9, 0.7, 0.4), 0.25),
        stage.plastic("coated", (0.05, 0.2, 0.6), 0.5, Clearcoat=1.0),
        stage.plastic("cloth", (0.2, 0.5, 0.15), 0.8, Sheen=1.0),
    )
    for i, skin in enumerate(skins):
        stage.add("monkey", skin, (2.4 * i - 3.6, 0, 0.95), rotation=(-10, 0, 15 * i - 20), subdivide=2)
    stage.lamp("SUN", (-4, -6, 8), (0, 0, 0), 3.0)
    stage.camera((0, -11, 3.2), (0, 0, 0.8), 38)


_GOBLET = [(0.001, 0), (0.38, 0), (0.36, 0.03), (0.05, 0.08), (0.04, 0.55), (0.3, 0.75), (0.42, 1.1), (0.36, 1.5), (0.34, 1.5)]
_GOBLET += [(0.39, 1.1), (0.28, 0.78), (0.001, 0.62)]


def still_life():
    stage.begin((0.2, 0.22, 0.25), 0.5)
    stage.add("plane", stage.wood("table"), size=8)
    stage.turned(stage.glass(), _GOBLET, (-0.9, 0.2, stage.CLEAR))
    stage.add("uv_sphere", stage.glass("ball", (0.9, 1, 0.95)), (0.1, -0.7, 0.35), radius=0.35, segments=48, ring_count=24)
    kettle = [(0.001, 0), (0.5, 0.0), (0.62, 0.2), (0.6, 0.5), (0.4, 0.8), (0.15, 0.9), (0.08, 1.0), (0.001, 1.03)]
    stage.turned(stage.metal("steel", (0.8, 0.8, 0.82), 0.08), kettle, (0.75, 0.6, 0))
    gold = stage.metal("gold", (1.0, 0.72, 0.3), 0.2)
    stage.add("torus", gold, (-0.3, -0.9, 0.06), major_radius=0.22, minor_radius=0.06)
    apple = stage.mottled("apple", (0.5, 0.03, 0.02), (0.6, 0.3, 0.05), roughness=(0.2, 0.35), bump=False)
    stage.add("uv_sphere", apple, (1.1, -0.6, 0.3), (1, 1, 0.9), radius=0.33)
    stage.add("uv_sphere", apple, (0.7, -1.0, 0.27), (1, 1, 0.9), radius=0.3)
    stage.box(stage.plaster("book", (0.1, 0.15, 0.3)), (-2, 0.6, 0), (-1.1, 1.6, 0.2))
    stage.lamp("AREA", (-2.5, -1.5, 3.5), (0, 0, 0.3), 160.0, size=1.2)
    stage.lamp("AREA", (3.0, 1.0, 2.0), (0, 0, 0.4), 40.0, size=0.8, color=(1, 0.8, 0.6))
    stage.camera((0, -5.2, 2.0), (0, 0, 0.5), 60)


def room():
    stage.begin((0.55, 0.7, 1.0), 4.0)
    stage.room_shell(stage.plaster("wall", (0.8, 0.79, 0.76)), stage.wood("floor"), window=(1.0, 4.4, 0.7, 2.3))
    stage.furniture(stage.plastic("sofa", (0.25, 0.3, 0.35), 0.9, Sheen=0.5), stage.wood())
    vase = [(0.001, 0), (0.08, 0), (0.13, 0.15), (0.05, 0.3), (0.07, 0.34)]
    stage.turned(stage.plaster("vase", (0.8, 0.8, 0.85)), vase, (0, 1, 0.43))
    frame = stage.metal("frame", (0.8, 0.7, 0.5), 0.3)
    stage.box(frame, (2.44, 0.6, 1.3), (2.49, 1.9, 2.2), 0.01)
    stage.box(stage.mottled("picture", (0.1, 0.2, 0.5), (0.7, 0.5, 0.2), bump=False), (2.43, 0.65, 1.35), (2.45, 1.85, 2.15), 0)
    stage.lamp("SUN", (-6, -3, 6), (0, 0.5, 0), 6.0)
    # As people help a window: a lamp in its place.
    stage.lamp("AREA", (-2.75, -0.3, 1.5), (0, -0.3, 1.5), 150.0, shape="RECTANGLE", size=1.6, size_y=3.4, color=(0.7, 0.85, 1))
    stage.camera((-0.6, -2.8, 1.5), (0.3, 1.5, 0.9), 24)


def lamps():
    stage.begin((0.02, 0.03, 0.05), 1.0)
    wood, dark = stage.wood("desk"), stage.plastic("black", stage.BLACK, 0.3)
    stage.box(wood, (-1.6, -0.6, -0.06), (1.6, 0.8, 0))
    stage.box(stage.plaster(), (-4, 1.2, -2), (4, 1.3, 3), 0)
    stage.box(dark, (-0.55, 0.25, 0.1), (0.55, 0.29, 0.75), 0.01)
    stage.box(stage.glowing("screen", (0.3, 0.5, 1.0), 2.0), (-0.5, 0.24, 0.14), (0.5, 0.252, 0.71), 0)
    stage.box(dark, (-0.4, -0.3, 0), (0.4, -0.1, 0.02), 0.005)
    shade = stage.metal("shade", (0.85, 0.8, 0.75), 0.3)
    for x in (-1.2, 1.2):
        stage.turned(shade, [(0.03, 0.3), (0.06, 0.28), (0.17, 0.1), (0.165, 0.1), (0.05, 0.27)], (x, 0.2, 0.42))
        stage.tube(dark, [(x, 0.45, 0), (x, 0.45, 0.8), (x, 0.2, 0.75)], 0.012)
        stage.lamp("POINT", (x, 0.2, 0.55), (x, 0.2, 0), 8.0, shadow_soft_size=0.03, color=(1, 0.75, 0.45))
    stage.lamp("SPOT", (0.2, -1.6, 2.2), (0.3, 0.1, 0), 60.0, spot_size=0.7, shadow_soft_size=0.05)
    stage.lamp("AREA", (-1.5, -1.0, 1.8), (0, 0.2, 0.1), 12.0, size=0.5, color=(0.6, 0.75, 1))
    mug = [(0.001, 0), (0.09, 0), (0.1, 0.02), (0.1, 0.22), (0.09, 0.22), (0.09, 0.03), (0.001, 0.02)]
    stage.turned(stage.plastic("mug", (0.6, 0.08, 0.05), 0.2), mug, (0.75, -0.2, 0))
    stage.turned(stage.glass("tumbler"), mug, (-0.75, -0.25, stage.CLEAR))
    for i, color in enumerate(((0.1, 0.2, 0.4), (0.5, 0.4, 0.1), (0.3, 0.05, 0.1))):
        stage.box(stage.plastic("book", color), (0.95 - 0.03 * i, 0.25, 0.05 * i), (1.4 - 0.05 * i, 0.6, 0.05 * i + 0.05), 0.005)
    stage.camera((0.2, -2.6, 1.35), (0, 0.2, 0.25), 40)


def doughnuts():
    stage.begin((0.9, 0.85, 0.8), 0.6)
    chance = random.Random(5)
    stage.add("plane", stage.checked("cloth", (0.7, 0.7, 0.7), (0.6, 0.15, 0.15), 4.0, 0.8), size=8)
    plate = [(0.001, 0.02), (0.9, 0.02), (1.5, 0.2), (1.52, 0.18), (0.9, 0.0), (0.001, 0)]
    stage.turned(stage.plastic("plate", stage.WHITE, 0.1), plate, steps=64)
    dough = stage.mottled("dough", (0.45, 0.2, 0.06), (0.7, 0.4, 0.15), scale=8.0, roughness=(0.6, 0.9))
    colors = ((0.75, 0.25, 0.35), (0.15, 0.05, 0.02), (0.8, 0.75, 0.6))
    crumbs = [stage.plastic("crumb", c, 0.4) for c in ((0.9, 0.8, 0.1), (0.1, 0.5, 0.8), (0.9, 0.9, 0.9))]
    for i, color in enumerate(colors):
        x, y = 0.62 * math.cos(2.1 * i + 0.6), 0.62 * math.sin(2.1 * i + 0.6)
        shape = {"major_radius": 0.38, "minor_radius": 0.2}
        stage.add("torus", dough, (x, y, 0.22), (1, 1, 0.85), subdivide=2, **shape)
        icing = stage.mottled("icing", color, [1.2 * c for c in color], scale=15.0, roughness=(0.15, 0.3))
        stage.add("torus", icing, (x, y, 0.26), (1.01, 1.01, 0.8), subdivide=2, **shape)
        first = None
        for k in range(60):
            a, b = chance.uniform(0, math.tau), chance.uniform(0.5, 2.6)
            r = 0.38 + 0.205 * math.cos(b)
            place = (x + r * math.cos(a), y + r * math.sin(a), 0.26 + 0.17 * math.sin(b))
            turn = [chance.uniform(0, math.tau) for _ in range(3)]
            if k % 20 == 0:
                first = stage.add("cylinder", crumbs[k // 20], place, vertices=12, radius=0.012, depth=0.07)
            else:
                stage.copy(first, place, 1.0, turn)
    stage.lamp("AREA", (2, -1.5, 3), (0, 0, 0), 120.0, size=1.5)
    stage.camera((0, -3.2, 2.3), (0, -0.05, 0.15), 55)


def landscape():
    stage.begin((0.35, 0.5, 0.8), 0.8)
    t = NodeTree("ground")
    noise = t.node("TexNoise", {0: t.place((1, 1, 0)), "Scale": 0.3, "Detail": 8.0, "Roughness": 0.5}).outputs[0]
    color = t.ramp(noise, (0.1, 0.18, 0.04), (0.25, 0.2, 0.13), (0.85, 0.87, 0.9))
    ground = t.end(t.principled(color, 0.85))
    displacement = t.node("Displacement", {"Height": noise, "Midlevel": 0.5, "Scale": 3.5})
    output = next(node for node in t.tree.nodes if node.type == "OUTPUT_MATERIAL")
    t.tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
    (ground.cycles if bpy.app.version < (4, 1, 0) else ground).displacement_method = "DISPLACEMENT"
    stage.add("grid", ground, x_subdivisions=640, y_subdivisions=640, size=30)
    stage.lamp("SUN", (-8, 3, 5), (0, 0, 0), 4.0)
    stage.camera((0, -15, 2.6), (0, 0, 0.4), 35)


def pavilion():
    stage.sky(elevation=28, rotation=140)
    concrete = stage.mottled("concrete", (0.35, 0.35, 0.34), (0.5, 0.49, 0.47), scale=3.0, roughness=(0.6, 0.9))
    stage.add("plane", stage.mottled("lawn", (0.04, 0.1, 0.02), (0.1, 0.2, 0.05), scale=1.0, roughness=(0.8, 1.0)), size=60)
    stage.box(concrete, (-6, -4, 0), (6, 4, 0.3))
    stage.box(concrete, (-6.3, -4.3, 3.3), (6.3, 4.3, 3.6))
    steel, pane = stage.metal("steel", (0.6, 0.6, 0.6), 0.3), stage.window_glass()
    for x in (-5.5, -1.8, 1.8, 5.5):
        for y in (-3.5, 3.5):
            stage.box(steel, (x - 0.08, y - 0.08, 0.3), (x + 0.08, y + 0.08, 3.3), 0.01)
    for x in (-5.5, -1.8, 1.8):
        for y in (-3.5, 3.5):
            stage.box(pane, (x + 0.09, y - 0.01, 0.3), (x + 3.55, y + 0.01, 3.3), 0)
    for x in (-5.5, 5.5):
        stage.box(pane, (x - 0.01, -3.4, 0.3), (x + 0.01, 3.4, 3.3), 0)
    leather, wood = stage.plastic("leather", (0.15, 0.06, 0.03), 0.4), stage.wood()
    for x in (-3, 2.2):
        stage.box(leather, (x, -0.5, 0.5), (x + 1.2, 0.6, 0.75), 0.05)
        stage.box(leather, (x, 0.45, 0.7), (x + 1.2, 0.7, 1.2), 0.05)
    stage.box(wood, (-0.8, -0.6, 0.7), (0.9, 0.5, 0.76))
    stage.box(wood, (-0.2, -0.2, 0.3), (0.3, 0.1, 0.7))
    stage.camera((8, -12, 2.2), (0, 0, 1.7), 32)


def pebbles():
    stage.begin((0.6, 0.7, 0.9), 0.8)
    chance = random.Random(11)
    stage.add("plane", stage.mottled("sand", (0.35, 0.27, 0.17), (0.5, 0.42, 0.3), scale=30.0, roughness=(0.8, 1.0)), size=12)
    shapes = []
    for i in range(6):
        grey = chance.uniform(0.1, 0.5)
        colors = [(grey * c, grey * 0.95 * c, grey * 0.85 * c) for c in (0.7, 1.1)]
        skin = stage.mottled("stone", *colors, scale=6.0, roughness=(0.35, 0.7))
        stone = stage.add("ico_sphere", skin, (0, 0, -5), subdivisions=4, radius=0.16)
        texture = bpy.data.textures.new("lumps", "CLOUDS")
        texture.noise_scale = 0.3
        lumps = stone.modifiers.new("lumps", "DISPLACE")
        lumps.texture, lumps.strength = texture, 0.12
        bpy.ops.object.modifier_apply(modifier="lumps")
        shapes.append(stone)
    for _ in range(900 - len(shapes)):
        turn = [chance.uniform(0, math.tau) for _ in range(3)]
        place = (chance.gauss(0, 1.6), chance.gauss(0.5, 1.6), chance.uniform(0.02, 0.12))
        stage.copy(chance.choice(shapes), place, chance.uniform(0.5, 1.4), turn)
    stage.lamp("SUN", (-3, -4, 5), (0, 0, 0), 3.0)
    stage.camera((0, -4.2, 2.1), (0, 0, 0), 45)


def neon():
    stage.begin((0.01, 0.012, 0.02), 1.0)
    brick = NodeTree("brick")
    bricks = brick.node("TexBrick", {0: brick.node("TexCoord").outputs["Generated"], "Scale": 12.0})
    bricks.inputs["Color1"].default_value, bricks.inputs["Color2"].default_value = (0.3, 0.1, 0.06, 1), (0.2, 0.06, 0.04, 1)
    wall = brick.end(brick.principled(bricks.outputs["Color"], 0.7, bricks.outputs["Fac"]))
    stage.add("plane", wall, (0, 2, 2), (2, 1, 1), (90, 0, 0), size=6)
    wet = stage.mottled("street", (0.02, 0.02, 0.02), (0.06, 0.06, 0.06), scale=1.5, roughness=(0.03, 0.5), bump=False)
    stage.add("plane", wet, size=12)
    stage.text(stage.glowing("pink", (1.0, 0.1, 0.4), 18.0), "OPEN", (-0.7, 1.85, 1.7), 1.1, extrude=0.02, bevel=0.015)
    circle = [(1.6 + 0.7 * math.cos(a), 1.85, 2.1 + 0.7 * math.sin(a)) for a in [k * math.tau / 48 for k in range(49)]]
    stage.tube(stage.glowing("blue", (0.1, 0.5, 1.0), 25.0), circle, 0.03)
    arrow = [(1.2, 1.85, 2.1), (2.0, 1.85, 2.1), (1.75, 1.85, 2.35), (2.0, 1.85, 2.1), (1.75, 1.85, 1.85)]
    stage.tube(stage.glowing("green", (0.2, 1.0, 0.3), 20.0), arrow, 0.03)
    stage.tube(stage.glowing("orange", (1.0, 0.4, 0.05), 12.0), [(-2.6, 1.85, 1.2), (0.9, 1.85, 1.2)], 0.025)
    barrel = [(0.001, 0.9), (0.3, 0.9), (0.31, 0.6), (0.3, 0.58), (0.31, 0.3), (0.3, 0.28), (0.3, 0)]
    stage.turned(stage.metal("barrel", (0.5, 0.5, 0.5), 0.35), barrel, (-2.2, 1.2, 0))
    stage.box(stage.plastic("crate", (0.2, 0.12, 0.06), 0.7), (1.3, 0.8, 0), (2.1, 1.5, 0.6))
    stage.camera((0.2, -4.5, 1.4), (0, 1.5, 1.35), 35)


def _car(paint, dark, tint, rim):
    """A car along x: a body under a Subdivision modifier, a cabin of tinted glass, four wheels."""
    sections = ((-2.1, 0.45, 0.55, 0.7), (-1.9, 0.35, 0.85, 0.85), (-0.9, 0.3, 0.95, 0.9), (0.9, 0.3, 0.9, 0.9))
    sections += ((1.9, 0.35, 0.75, 0.85), (2.15, 0.45, 0.6, 0.7))
    cabin = ((-1.5, 0.85, 0.95, 0.75), (-0.7, 0.8, 1.4, 0.68), (0.3, 0.8, 1.42, 0.68), (1.1, 0.8, 0.92, 0.75))
    for material, rings in ((paint, sections), (tint, cabin)):
        points, faces = [], []
        for x, low, high, half in rings:
            points += [(x, -half, low), (x, half, low), (x, half, high), (x, -half, high)]
        for k in range(0, len(points) - 4, 4):
            faces += [(k + i, k + (i + 1) % 4, k + 4 + (i + 1) % 4, k + 4 + i) for i in range(4)]
        faces += [(3, 2, 1, 0), tuple(len(points) - 4 + i for i in range(4))]
        mesh = bpy.data.meshes.new("body")
        mesh.from_pydata(points, [], faces)
        mesh.polygons.foreach_set("use_smooth", [True] * len(faces))
        mesh.materials.append(material)
        body = stage.link(mesh, "body")
        modifier = body.modifiers.new("subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = 4
    for x in (-1.35, 1.4):
        for y in (-0.85, 0.85):
            tyre = {"major_radius": 0.28, "minor_radius": 0.1, "major_segments": 64, "minor_segments": 24}
            stage.add("torus", dark, (x, y, 0.38), rotation=(90, 0, 0), **tyre)
            stage.add("cylinder", rim, (x, y, 0.38), rotation=(90, 0, 0), radius=0.21, depth=0.16, vertices=48, smooth=False)
    lamp = stage.glowing("lamp", (1, 0.95, 0.85), 6.0)
    for y in (-0.5, 0.5):
        stage.add("uv_sphere", lamp, (2.02, y, 0.62), (0.4, 1, 0.6), radius=0.14)


def car():
    stage.begin((0.1, 0.1, 0.1), 0.5)
    stage.backdrop(stage.plastic("backdrop", (0.5, 0.5, 0.5), 0.6), 14, 6, 6, 2.0)
    paint = stage.plastic("paint", (0.6, 0.02, 0.02), 0.35, Metallic=0.6, Clearcoat=1.0)
    tint = stage.plastic("tint", (0.3, 0.35, 0.35), 0.0, Transmission=0.9)
    _car(paint, stage.plastic("rubber", stage.BLACK, 0.8), tint, stage.metal("rim", (0.9, 0.9, 0.9), 0.2))
    stage.lamp("AREA", (0, 0, 5), (0, 0, 0), 400.0, shape="RECTANGLE", size=5, size_y=2)
    stage.lamp("AREA", (5, -4, 3), (0, 0, 0.5), 150.0, size=2)
    stage.lamp("AREA", (-6, -2, 2), (0, 0, 0.5), 100.0, size=2, color=(0.7, 0.8, 1))
    stage.camera((5.5, -6.5, 1.9), (0.1, 0, 0.55), 50)


#: By name, in the order of the tables.
SCENES = {f.__name__: f for f in (monkeys, still_life, room, lamps, doughnuts, landscape, pavilion, pebbles, neon, car)}
SCENES |= more_scenes.SCENES
SCENES |= inside_scenes.SCENES
if bpy.app.version >= (5, 0, 0):
    SCENES |= new_scenes.SCENES


def main(folder, names):
    stage.folder = os.path.abspath(folder)
    for name in names or SCENES:
        if name not in SCENES:
            sys.exit(f"{name}: Blender {bpy.app.version_string} cannot make this scene, which needs 5.0 or later")
        SCENES[name]()
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(stage.folder, f"{name}.blend"))


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    main(words[0], words[1:])
