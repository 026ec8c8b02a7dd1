"""What the scenes of this benchmark are put together from, inside Blender: a stage, lamps, a camera, materials, shapes.

All of Blender's settings stay as a new file has them. Lengths are metres; colours are linear.
"""

import math
import os
import random
import sys

import bpy
import numpy as np
from mathutils import Vector

sys.dont_write_bytecode = True
_ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path[:0] = [os.path.join(_ROOT, "tests", "blender"), os.path.join(_ROOT, "benchmarks", "cycles")]

from node_tree import NodeTree  # noqa: E402
from scenes import LINEAR, link, new_image  # noqa: E402

WHITE, BLACK = (0.8, 0.8, 0.8), (0.02, 0.02, 0.02)

#: Height that glass stands at: in the plane of a table, which of the two a ray meets first would be the engine's chance.
CLEAR = 0.002

#: Where scenes are written to, for what has to lie beside them.
folder = ""


def begin(color=(0.05, 0.05, 0.05), strength=1.0):
    """An empty file with the add-on and a plain world; returns the world's node tree."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="relief")
    bpy.context.scene.render.engine = "CYCLES"
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return world.node_tree


def sky(elevation=35.0, rotation=120.0, strength=0.07):
    """A file whose world is a Sky Texture as a new one is: with a sun. Angles in degrees."""
    tree = begin(strength=strength)
    texture = tree.nodes.new("ShaderNodeTexSky")
    texture.sun_elevation, texture.sun_rotation = math.radians(elevation), math.radians(rotation)
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])


def softboxes(strength=1.0):
    """A file whose world is an HDRI of a studio, packed into it: three soft boxes and a window in a dark room."""
    tree = begin(strength=strength)
    v, u = np.mgrid[0:512, 0:1024] / (512.0, 1024.0)[0]
    pixels = np.ones((512, 1024, 4), np.float32)
    pixels[..., :3] = (0.06 + 0.1 * v)[..., None] * np.float32((1.0, 0.95, 0.9))
    for (left, bottom, width, height), color in (
        ((0.2, 0.62, 0.35, 0.2), (22, 21, 20)),
        ((1.0, 0.55, 0.12, 0.3), (14, 16, 20)),
        ((1.45, 0.7, 0.3, 0.1), (30, 27, 22)),
        ((0.7, 0.85, 0.6, 0.08), (9, 9, 9)),
    ):
        inside = (u > left) & (u < left + width) & (v > bottom) & (v < bottom + height)
        pixels[inside, :3] = color
    image = new_image(pixels, LINEAR)
    image.pack()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])


def _aim(thing, location, target):
    thing.location = location
    thing.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def camera(location, target, lens=50.0, **settings):
    """The scene's camera; its settings by their names in bpy, `fstop` for depth of field focused on the target."""
    data = bpy.data.cameras.new("camera")
    fstop = settings.pop("fstop", None)
    if fstop is not None:
        data.dof.use_dof, data.dof.aperture_fstop = True, fstop
        data.dof.focus_distance = (Vector(target) - Vector(location)).length
    data.lens = lens
    for name, value in settings.items():
        setattr(data, name, value)
    made = link(data, "camera")
    _aim(made, location, target)
    bpy.context.scene.camera = made


def lamp(kind, location, target, energy, **settings):
    """A lamp that shines at a target; settings by their names in bpy."""
    data = bpy.data.lights.new("lamp", kind)
    data.energy = energy
    for name, value in settings.items():
        setattr(data, name, value)
    _aim(link(data, "lamp"), location, target)


def plastic(name, color, roughness=0.5, **inputs):
    """A Principled material without textures; inputs as of NodeTree.principled."""
    t = NodeTree(name)
    return t.end(t.principled((*color, 1), roughness, **inputs))


def metal(name, color=(0.9, 0.9, 0.9), roughness=0.25):
    return plastic(name, color, roughness, Metallic=1.0)


def glass(name="glass", color=(1, 1, 1), roughness=0.0, ior=1.45):
    t = NodeTree(name)
    return t.end(t.node("BsdfGlass", {"Color": (*color, 1), "Roughness": roughness, "IOR": ior}).outputs[0])


def window_glass(name="window"):
    """Architects' glass: what is lit through it is lit as through air."""
    t = NodeTree(name)
    ray = t.node("LightPath")
    seen_through = t.math("MAXIMUM", ray.outputs["Is Shadow Ray"], ray.outputs["Is Diffuse Ray"])
    clear = t.node("BsdfTransparent")
    pane = t.node("BsdfGlass", {"Color": (0.95, 1.0, 0.98, 1)})
    return t.end(t.node("MixShader", {0: seen_through, 1: pane.outputs[0], 2: clear.outputs[0]}).outputs[0])


def glowing(name, color, strength):
    t = NodeTree(name)
    return t.end(t.node("Emission", {"Color": (*color, 1), "Strength": strength}).outputs[0])


def mottled(name, *colors, scale=4.0, roughness=(0.3, 0.7), bump=True, stretch=(1, 1, 1)):
    """A Principled material whose colour, roughness and bumps follow noise, as most materials that people make."""
    t = NodeTree(name)
    noise = t.node("TexNoise", {0: t.place(stretch), "Scale": scale, "Detail": 6.0}).outputs[0]
    rough = t.node("MapRange", {0: noise, 3: roughness[0], 4: roughness[1]}).outputs[0]
    return t.end(t.principled(t.ramp(noise, *colors), rough, noise if bump else None))


def checked(name, first, second, scale, roughness=0.4):
    t = NodeTree(name)
    checks = t.node("TexChecker", {0: t.place((1, 1, 1)), "Color1": (*first, 1), "Color2": (*second, 1), "Scale": scale})
    return t.end(t.principled(checks.outputs[0], roughness))


def add(shape, material, location=(0, 0, 0), scale=(1, 1, 1), rotation=(0, 0, 0), smooth=True, subdivide=0, **arguments):
    """A primitive of Blender's Add menu: "plane", "cube", "uv_sphere", "monkey" and so on. Returns the object.

    @param  rotation   degrees about x, y, z
    @param  subdivide  levels of a Subdivision modifier
    @param  arguments  of bpy.ops.mesh.primitive_…_add
    """
    angles = [math.radians(angle) for angle in rotation]
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(location=location, rotation=angles, **arguments)
    made = bpy.context.object
    made.scale = scale
    if smooth:
        bpy.ops.object.shade_smooth()
    if subdivide:
        modifier = made.modifiers.new("subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = subdivide
    if material is not None:
        made.data.materials.append(material)
    return made


def box(material, low, high, bevel=0.02):
    """A box from one corner to the other, its edges rounded off as people do it: by a modifier."""
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    made = add("cube", material, middle, [b - a for a, b in zip(low, high)], smooth=False, size=1)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    if bevel:
        modifier = made.modifiers.new("bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 3
    return made


def turned(material, profile, location=(0, 0, 0), steps=48):
    """What a lathe makes of a profile, points (radius, height) with the inside on their left: a Screw modifier."""
    mesh = bpy.data.meshes.new("turned")
    points = [(radius, 0.0, height) for radius, height in profile]
    mesh.from_pydata(points, [(i, i + 1) for i in range(len(points) - 1)], [])
    mesh.materials.append(material)
    made = link(mesh, "turned")
    made.location = location
    screw = made.modifiers.new("screw", "SCREW")
    screw.steps = screw.render_steps = steps
    screw.use_merge_vertices = True
    screw.use_normal_flip = True
    return made


def copy(original, location, scale=1.0, rotation=(0, 0, 0)):
    """Another object of the same mesh. Rotation in radians."""
    made = link(original.data, original.name)
    for modifier in original.modifiers:
        again = made.modifiers.new(modifier.name, modifier.type)
        if modifier.type == "SUBSURF":
            again.levels, again.render_levels = modifier.levels, modifier.render_levels
    made.location, made.scale, made.rotation_euler = location, (scale,) * 3, rotation
    return made


def text(material, words, location, size=1.0, rotation=(90, 0, 0), extrude=0.1, bevel=0.02):
    """Words as a solid."""
    data = bpy.data.curves.new("text", "FONT")
    data.body, data.size, data.extrude, data.bevel_depth, data.bevel_resolution = words, size, extrude, bevel, 3
    data.align_x = "CENTER"
    data.materials.append(material)
    made = link(data, "text")
    made.location, made.rotation_euler = location, [math.radians(angle) for angle in rotation]
    return made


def tube(material, points, radius):
    """A tube along points: a curve with a round bevel."""
    data = bpy.data.curves.new("tube", "CURVE")
    data.dimensions, data.bevel_depth, data.bevel_resolution = "3D", radius, 4
    spline = data.splines.new("POLY")
    spline.points.add(len(points) - 1)
    for point, place in zip(spline.points, points):
        point.co = (*place, 1)
    data.materials.append(material)
    return link(data, "tube")


def backdrop(material, width=12.0, depth=6.0, height=5.0, radius=1.5):
    """A floor that bends up into a wall behind."""
    bend = [(depth - radius * (1 - math.sin(a)), radius * (1 - math.cos(a))) for a in np.linspace(0, math.pi / 2, 12)]
    profile = [(-depth, 0.0), *bend, (depth, height)]
    points = [(x, y, z) for y, z in profile for x in (-width, width)]
    faces = [(i, i + 1, i + 3, i + 2) for i in range(0, len(points) - 2, 2)]
    mesh = bpy.data.meshes.new("backdrop")
    mesh.from_pydata(points, [], faces)
    mesh.polygons.foreach_set("use_smooth", [True] * len(faces))
    mesh.materials.append(material)
    return link(mesh, "backdrop")


def wood(name="wood"):
    return mottled(
        name, (0.16, 0.07, 0.03), (0.38, 0.2, 0.09), scale=2.0, roughness=(0.25, 0.5), stretch=(1, 12, 1)
    )


def plaster(name="wall", color=(0.75, 0.72, 0.66)):
    return plastic(name, color, 0.8)


def room_shell(wall, floor, width=5.0, depth=6.0, height=2.7, window=(1.2, 3.6, 0.9, 2.2)):
    """A room about (0, 0) with a window in its left wall: from and to along y (from the front), and in height."""
    x, near, far = width / 2, -depth / 2, depth / 2
    box(floor, (-x, near, -0.1), (x, far, 0), 0)
    box(wall, (-x - 0.2, near, height), (x + 0.2, far, height + 0.2), 0)
    box(wall, (-x - 0.2, far, 0), (x + 0.2, far + 0.2, height), 0)
    box(wall, (-x - 0.2, near - 0.2, 0), (x + 0.2, near, height), 0)
    box(wall, (x, near, 0), (x + 0.2, far, height), 0)
    y0, y1, z0, z1 = near + window[0], near + window[1], window[2], window[3]
    for low, high in (((near, 0), (y0, height)), ((y1, 0), (far, height)), ((y0, 0), (y1, z0)), ((y0, z1), (y1, height))):
        box(wall, (-x - 0.2, *low), (-x, *high), 0)


def furniture(cloth, wood):
    """A sofa, a table and a shelf with books, for rooms of room_shell."""
    box(cloth, (0.9, 0.2, 0.12), (2.3, 2.4, 0.45), 0.06)
    box(cloth, (1.9, 0.2, 0.4), (2.35, 2.4, 0.9), 0.08)
    for y in (0.1, 2.25):
        box(cloth, (0.9, y, 0.12), (2.3, y + 0.25, 0.65), 0.06)
    box(wood, (-0.6, 0.5, 0.38), (0.5, 1.7, 0.43))
    for x in (-0.55, 0.4):
        for y in (0.55, 1.6):
            box(wood, (x, y, 0), (x + 0.06, y + 0.06, 0.38), 0.005)
    chance = random.Random(3)
    for level in range(3):
        box(wood, (-1.8, 2.65, 0.6 + 0.5 * level), (0.2, 2.98, 0.64 + 0.5 * level), 0.005)
        x = -1.75
        while x < 0.0:
            thick, high = chance.uniform(0.03, 0.08), chance.uniform(0.22, 0.36)
            book = plastic("book", [chance.uniform(0.03, 0.6) for _ in range(3)], 0.6)
            box(book, (x, 2.7, 0.64 + 0.5 * level), (x + thick, 2.95, 0.64 + 0.5 * level + high), 0)
            x += thick + chance.uniform(0.002, 0.03)
