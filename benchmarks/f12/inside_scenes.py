"""Scenes of light inside things, as those of scenes.py, which writes them: volumes, subsurface scattering and hair.

Bounces in volumes, of which a new file has none, are set where people set them.
"""

import math
import os
import random

import bpy
import stage
from stage import NodeTree

# ---- volumes


def _bounces(count):
    bpy.context.scene.cycles.volume_bounces = count


def _fill(t, shader, surface=None):
    """Ends a tree with a volume's shader and maybe a surface's; returns the material."""
    t.node("OutputMaterial", {"Volume": shader} | ({} if surface is None else {"Surface": surface}))
    return t.material


def _fog(density, color=(1, 1, 1), anisotropy=0.0):
    t = NodeTree("fog")
    inputs = {"Color": (*color, 1), "Density": density, "Anisotropy": anisotropy}
    return _fill(t, t.node("VolumeScatter", inputs).outputs[0])


def _smoke(t, density, **inputs):
    """A Principled Volume; inputs by their names, "_" for a space."""
    named = {name.replace("_", " "): value for name, value in inputs.items()}
    return _fill(t, t.node("VolumePrincipled", {"Density": density} | named).outputs[0])


def _lump(t, coarse, fine, edge):
    """Noise that fades towards the surface of a ball of radius 1: 0 and less outside of what is to be seen."""
    place = t.place((1, 1, 1))
    inside = t.node("TexGradient", {0: place}, gradient_type="SPHERICAL").outputs["Fac"]
    noise = t.node("TexNoise", {0: place, "Scale": coarse, "Detail": fine}).outputs["Fac"]
    return t.math("SUBTRACT", t.math("ADD", noise, inside), edge)


def sunny_room():
    stage.begin((0.55, 0.7, 1.0), 4.0)
    stage.room_shell(stage.plaster("wall", (0.8, 0.79, 0.76)), stage.wood("floor"))
    stage.furniture(stage.plastic("sofa", (0.25, 0.3, 0.35), 0.9), stage.wood())
    stage.box(_fog(0.06, (1, 0.98, 0.95), 0.3), (-2.49, -2.99, 0.01), (2.49, 2.99, 2.69), 0)
    stage.lamp("SUN", (-6, -1, 4), (0, 0, 0), 40.0)
    stage.lamp("AREA", (-2.45, 0.0, 1.5), (0, 0, 1.5), 60.0, shape="RECTANGLE", size=1.2, size_y=2.3, color=(0.7, 0.85, 1))
    stage.camera((0.6, -2.8, 1.5), (-0.3, 1.5, 1.1), 22)


def haze():
    stage.begin((0.01, 0.01, 0.02), 1.0)
    stage.add("plane", stage.plastic("stage", (0.05, 0.05, 0.05), 0.2), size=20)
    stage.box(stage.plastic("curtain", (0.3, 0.02, 0.02), 0.9), (-6, 3, 0), (6, 3.2, 6), 0)
    stage.add("monkey", stage.plastic("figure", (0.6, 0.6, 0.6)), (0, 0, 1), rotation=(-15, 0, 10), subdivide=2)
    stage.box(_fog(0.05, anisotropy=0.5), (-6, -8, 0.01), (6, 2.99, 6), 0)
    for x, color in ((-3, (1, 0.2, 0.3)), (0, (0.9, 0.95, 1)), (3, (0.2, 0.4, 1))):
        stage.lamp("SPOT", (x, 1, 5.5), (0.2 * x, -0.3, 0.6), 4000.0, spot_size=0.4, color=color, shadow_soft_size=0.05)
    stage.camera((0, -9, 1.6), (0, 0, 2.1), 32)


def underwater():
    stage.begin((0.1, 0.3, 0.4), 1.0)
    sand = stage.mottled("sand", (0.4, 0.35, 0.25), (0.55, 0.5, 0.38), scale=6.0, roughness=(0.8, 1.0))
    stage.add("plane", sand, size=40)
    water = NodeTree("water")
    scatter = water.node("VolumeScatter", {"Color": (0.2, 0.6, 0.8, 1), "Density": 0.05, "Anisotropy": 0.6})
    absorb = water.node("VolumeAbsorption", {"Color": (0.4, 0.8, 0.9, 1), "Density": 0.08})
    water = _fill(water, water.node("AddShader", {0: scatter.outputs[0], 1: absorb.outputs[0]}).outputs[0])
    stage.box(water, (-12, -14, 0.01), (12, 12, 5), 0)
    chance = random.Random(4)
    for _ in range(14):
        place, size = (chance.uniform(-5, 5), chance.uniform(-4, 7), 0.1), [chance.uniform(0.2, 0.8) for _ in range(3)]
        stage.add("ico_sphere", stage.mottled("rock", (0.1, 0.1, 0.1), (0.3, 0.28, 0.22)), place, size, subdivisions=4)
    fish = stage.plastic("fish", (0.9, 0.4, 0.1), 0.3)
    for _ in range(9):
        place = (chance.uniform(-2, 2), chance.uniform(-3, 3), chance.uniform(1, 3))
        stage.add("uv_sphere", fish, place, (0.3, 0.07, 0.13), (0, 0, chance.uniform(-20, 20)))
    # What waves do to the sun: it comes through gaps.
    mesh = bpy.data.meshes.new("gaps")
    tiles = [(x, y) for x in range(-12, 12) for y in range(-12, 12) if chance.random() < 0.7]
    points = [(x + a, y + b, 5.3) for x, y in tiles for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mesh.from_pydata(points, [], [tuple(range(4 * k, 4 * k + 4)) for k in range(len(tiles))])
    stage.link(mesh, "gaps")
    stage.lamp("SUN", (2, 3, 8), (0, 0, 0), 15.0)
    stage.camera((0, -8, 1.2), (0, 0, 1.7), 28)


def smoke():
    """A domain as it is after one second, baked beside the file."""
    stage.begin((0.4, 0.55, 0.8), 0.6)
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(stage.folder, "smoke.blend"))
    stage.add("plane", stage.checked("floor", (0.5, 0.5, 0.5), (0.35, 0.35, 0.35), 2.0), size=20)
    t = NodeTree("smoke")
    domain = stage.add("cube", _smoke(t, 12.0, Color_Attribute="color"), (0, 0, 1.25), (1.6, 1.6, 2.4), size=1)
    domain.modifiers.new("fluid", "FLUID").fluid_type = "DOMAIN"
    settings = domain.modifiers["fluid"].domain_settings
    settings.domain_type, settings.resolution_max, settings.vorticity = "GAS", 48, 0.3
    settings.cache_type, settings.cache_frame_end, settings.cache_directory = "REPLAY", 24, "//smoke_cache"
    for x, color in ((-0.25, (0.9, 0.5, 0.2)), (0.25, (0.3, 0.5, 0.9))):
        source = stage.add("uv_sphere", None, (x, 0, 0.4), radius=0.18)
        source.hide_render = True
        source.modifiers.new("fluid", "FLUID").fluid_type = "FLOW"
        flow = source.modifiers["fluid"].flow_settings
        flow.flow_behavior, flow.smoke_color, flow.temperature = "INFLOW", color, 2.0
    for frame in range(1, 25):
        bpy.context.scene.frame_set(frame)
    stage.lamp("SUN", (4, -3, 6), (0, 0, 0), 4.0)
    stage.camera((0, -6, 1.6), (0, 0, 1.1), 45)


def puff():
    """A volume object, whose grid is what a .vdb file has."""
    stage.begin((0.35, 0.5, 0.8), 0.8)
    grid = NodeTree.of_geometry("puff")
    noise = grid.node("TexNoise", {"Scale": 2.5, "Detail": 5.0}).outputs["Fac"]
    length = grid.node("VectorMath", {0: grid.node("GeometryNodeInputPosition").outputs[0]}, operation="LENGTH").outputs["Value"]
    density = grid.math("SUBTRACT", grid.math("MULTIPLY", noise, 2.2), grid.math("ADD", length, 0.2))
    density = grid.math("MAXIMUM", grid.math("MINIMUM", grid.math("MULTIPLY", density, 4.0), 1.0), 0.0)
    inputs = {"Density": density} | {f"Resolution {axis}": 80 for axis in "XYZ"}
    cube = grid.node("GeometryNodeVolumeCube", inputs).outputs[0]
    made = stage.link(bpy.data.volumes.new("puff"), "puff")
    made.location = (0, 0, 1.2)
    made.data.materials.append(_smoke(NodeTree("steam"), 80.0, Anisotropy=0.3))
    grid.make(made, cube)
    _bounces(4)
    stage.add("plane", stage.plastic("floor", (0.4, 0.4, 0.35), 0.8), size=20)
    stage.lamp("SUN", (-4, -2, 5), (0, 0, 0), 5.0, angle=0.05)
    stage.camera((0, -6, 1.6), (0, 0, 1.1), 50)


def nebula():
    stage.begin((0.0, 0.0, 0.002), 1.0)
    t = NodeTree("nebula")
    lump = _lump(t, 2.5, 6.0, 0.75)
    color = t.ramp(t.node("TexNoise", {0: t.place((1, 1, 1)), "Scale": 1.5}).outputs["Fac"], (0.1, 0.2, 1), (1, 0.2, 0.5))
    thick, bright = t.math("MAXIMUM", lump, 0.0), t.math("MAXIMUM", t.math("SUBTRACT", lump, 0.1), 0.0)
    inputs = {"Emission_Color": color, "Emission_Strength": t.math("MULTIPLY", bright, 4.0)}
    material = _smoke(t, t.math("MULTIPLY", thick, 12.0), Color=(0.6, 0.7, 1, 1), **inputs)
    stage.add("cube", material, (0, 0, 0), (1.8, 1.2, 1.2), size=2)
    for place, color in (((-0.5, -0.2, 0.3), (0.6, 0.8, 1)), ((0.8, 0.3, -0.2), (1, 0.7, 0.4))):
        stage.lamp("POINT", place, (0, 0, 0), 60.0, color=color, shadow_soft_size=0.03)
    chance, star = random.Random(6), stage.glowing("star", (1, 1, 1), 10.0)
    for _ in range(60):
        place = (chance.uniform(-6, 6), 6, chance.uniform(-3.5, 3.5))
        stage.add("ico_sphere", star, place, subdivisions=1, radius=chance.uniform(0.01, 0.025))
    stage.camera((0, -5, 0), (0, 0, 0), 42)


def cloud():
    stage.begin((0.25, 0.45, 0.9), 0.8)
    t = NodeTree("cloud")
    density = t.math("MULTIPLY", t.math("MAXIMUM", _lump(t, 2.0, 5.0, 0.8), 0.0), 40.0)
    stage.add("cube", _smoke(t, density, Color=(0.95, 0.95, 0.95, 1), Anisotropy=0.4), (0, 0, 0), (2, 1.2, 1), size=2)
    _bounces(8)
    stage.lamp("SUN", (3, -2, 4), (0, 0, 0), 6.0)
    stage.camera((0, -7, -0.6), (0, 0, 0.1), 48)


def explosion():
    stage.begin((0.1, 0.12, 0.18), 1.0)
    stage.add("plane", stage.mottled("ground", (0.08, 0.07, 0.06), (0.15, 0.13, 0.1), roughness=(0.8, 1.0)), size=20)
    t = NodeTree("fire")
    lump = _lump(t, 2.0, 4.0, 0.7)
    heat = t.math("MULTIPLY", t.math("MAXIMUM", t.math("SUBTRACT", lump, 0.1), 0.0), 6000.0)
    density = t.math("MULTIPLY", t.math("MAXIMUM", lump, 0.0), 15.0)
    inputs = {"Color": (0.2, 0.18, 0.16, 1), "Blackbody_Intensity": 4.0, "Temperature": heat, "Temperature_Attribute": ""}
    stage.add("cube", _smoke(t, density, **inputs), (0, 0, 1.2), (1.2, 1.2, 1.15), size=2)
    for side in (-1, 1):
        stage.box(stage.plastic("wall", (0.4, 0.38, 0.35), 0.9), (2.2 * side - 0.15, -1, 0), (2.2 * side + 0.15, 2, 1.6))
    stage.lamp("SUN", (-3, -4, 5), (0, 0, 0), 1.0)
    stage.camera((0, -6.5, 1.6), (0, 0, 1.05), 40)


def candle():
    stage.begin((0.01, 0.012, 0.02), 1.0)
    stage.add("plane", stage.wood("table"), size=6)
    wax = [(0.001, 0), (0.19, 0), (0.2, 0.01), (0.2, 0.5), (0.18, 0.54), (0.1, 0.55), (0.001, 0.54)]
    stage.turned(_flesh("wax", (0.9, 0.85, 0.7), (0.95, 0.8, 0.55), (0.15, 0.08, 0.04)), wax)
    stage.tube(stage.plastic("wick", stage.BLACK), [(0, 0, 0.5), (0, 0, 0.63)], 0.008)
    t = NodeTree("flame")
    height = t.node("SeparateXYZ", {0: t.node("TexCoord").outputs["Generated"]}).outputs["Z"]
    shine = t.node("Emission", {"Color": t.ramp(height, (0.1, 0.2, 1), (1, 0.5, 0.1), (1, 0.75, 0.3)), "Strength": 60.0})
    flame = stage.add("uv_sphere", _fill(t, shine.outputs[0]), (0, 0, 0.72), (1, 1, 2.4), radius=0.05)
    flame.visible_shadow = False
    stage.lamp("POINT", (0, 0, 0.74), (0, 0, 0), 15.0, color=(1, 0.6, 0.25), shadow_soft_size=0.03)
    mug = [(0.001, 0), (0.16, 0), (0.16, 0.35), (0.145, 0.35), (0.145, 0.02), (0.001, 0.02)]
    stage.turned(stage.plastic("mug", (0.2, 0.35, 0.5), 0.2), mug, (0.6, 0.3, 0))
    stage.box(stage.plastic("book", (0.3, 0.05, 0.05)), (-0.9, 0.1, 0), (-0.35, 0.6, 0.1))
    stage.camera((0.1, -2.6, 0.8), (0, 0, 0.42), 50)


_TUMBLER = [(0.001, 0), (0.27, 0), (0.29, 0.01), (0.3, 0.04), (0.345, 0.76), (0.348, 0.79), (0.342, 0.8), (0.328, 0.8)]
_TUMBLER += [(0.322, 0.79), (0.318, 0.76), (0.278, 0.1), (0.265, 0.06), (0.24, 0.05), (0.001, 0.05)]
#: What is in it, a little into the glass.
_DRINK = [(0.001, 0.047), (0.238, 0.047), (0.268, 0.058), (0.281, 0.1), (0.309, 0.57), (0.309, 0.597), (0.304, 0.6), (0.001, 0.6)]


def milk():
    stage.begin((0.7, 0.7, 0.7), 0.7)
    stage.add("plane", stage.checked("cloth", (0.7, 0.7, 0.7), (0.2, 0.3, 0.6), 4.0, 0.8), size=6)
    stage.turned(stage.glass(), _TUMBLER, (0, 0, stage.CLEAR))
    t = NodeTree("milk")
    inside = t.node("VolumeScatter", {"Color": (0.99, 0.97, 0.9, 1), "Density": 12.0})
    white = _fill(t, inside.outputs[0], t.node("BsdfGlass", {"IOR": 1.35}).outputs[0])
    stage.turned(white, _DRINK, (0, 0, stage.CLEAR))
    _bounces(8)
    biscuit = stage.mottled("biscuit", (0.5, 0.28, 0.1), (0.7, 0.45, 0.2), scale=10.0, roughness=(0.7, 0.9))
    stage.turned(biscuit, [(0.001, 0), (0.3, 0), (0.32, 0.04), (0.28, 0.08), (0.001, 0.09)], (0.75, -0.2, 0))
    stage.lamp("AREA", (-2, -1.5, 2.5), (0, 0, 0.3), 100.0, size=1.0)
    stage.camera((0.25, -3.2, 1.3), (0.2, 0, 0.35), 50)


def tea():
    stage.begin((0.7, 0.72, 0.75), 0.7)
    stage.backdrop(stage.plastic("backdrop", (0.7, 0.68, 0.65), 0.5), 6, 3, 4, 1.0)
    for x, color in ((-0.5, (0.9, 0.45, 0.08)), (0.5, (0.7, 0.1, 0.15))):
        stage.turned(stage.glass(), _TUMBLER, (x, 0, stage.CLEAR))
        t = NodeTree("tea")
        inside = t.node("VolumeAbsorption", {"Color": (*color, 1), "Density": 5.0})
        liquid = _fill(t, inside.outputs[0], t.node("BsdfGlass", {"IOR": 1.33}).outputs[0])
        stage.turned(liquid, _DRINK, (x, 0, stage.CLEAR))
    stage.lamp("AREA", (-2, 1.5, 2.5), (0, 0, 0.3), 100.0, size=1.0)
    stage.camera((0, -3.4, 1.3), (0, 0, 0.38), 50)


def ground_fog():
    stage.begin((0.5, 0.6, 0.8), 0.6)
    stage.add("plane", stage.mottled("meadow", (0.05, 0.09, 0.02), (0.13, 0.16, 0.05), roughness=(0.8, 1.0)), size=120)
    t = NodeTree("fog")
    height = t.node("SeparateXYZ", {0: t.node("NewGeometry").outputs["Position"]}).outputs["Z"]
    wisps = t.node("TexNoise", {0: t.place((1, 1, 1)), "Scale": 0.4, "Detail": 2.0}).outputs["Fac"]
    density = t.math("MULTIPLY", t.math("POWER", 0.4, height), t.math("MULTIPLY", wisps, 0.25))
    stage.box(_smoke(t, density, Color=(1, 1, 1, 1), Anisotropy=0.5), (-30, -15, 0.01), (30, 45, 6), 0)
    chance = random.Random(12)
    needles = stage.mottled("needles", (0.02, 0.05, 0.02), (0.05, 0.09, 0.03), scale=8.0, roughness=(0.8, 1.0))
    crown = stage.add("cone", needles, (0, 0, -20), vertices=24, radius1=0.9, depth=3.6)
    for _ in range(50):
        size = chance.uniform(0.8, 1.7)
        x, y = chance.uniform(-16, 16), chance.uniform(-3, 30)
        stage.copy(crown, (x, y, 2.1 * size), size)
    stage.lamp("SUN", (6, 10, 5), (0, 0, 0), 5.0)
    stage.camera((0, -12, 1.7), (0, 0, 1.9), 30)


# ---- subsurface scattering


def _flesh(name, color, below, depth, roughness=0.4, amount=1.0, **inputs):
    """A Principled BSDF with light below the surface.

    @param  below  colour there
    @param  depth  how far each channel goes, metres
    """
    own = {"Subsurface": amount, "Subsurface_Color": (*below, 1), "Subsurface_Radius": depth}
    return stage.plastic(name, color, roughness, **own, **inputs)


def skin():
    stage.begin((0.5, 0.6, 0.8), 0.5)
    stage.backdrop(stage.plastic("backdrop", (0.3, 0.35, 0.3), 0.9), 10, 5, 6, 2.0)
    t = NodeTree("skin")
    noise = t.node("TexNoise", {0: t.place((1, 1, 1)), "Scale": 6.0, "Detail": 8.0}).outputs["Fac"]
    color, pores = t.ramp(noise, (0.6, 0.3, 0.22), (0.8, 0.5, 0.38)), t.node("TexVoronoi", {"Scale": 60.0}).outputs["Distance"]
    inputs = {"Subsurface": 0.3, "Subsurface_Color": (0.8, 0.25, 0.15, 1), "Subsurface_Radius": (0.3, 0.08, 0.04)}
    face = t.end(t.principled(color, 0.45, pores, **inputs))
    stage.add("monkey", face, (0, 0, 1.1), rotation=(-10, 0, 20), subdivide=3)
    stage.lamp("SUN", (-4, -3, 5), (0, 0, 1), 3.5)
    stage.camera((0, -5, 1.5), (0, 0, 1.1), 55)


def marble():
    stage.softboxes(0.3)
    stage.backdrop(stage.plastic("backdrop", (0.15, 0.15, 0.17), 0.7), 8, 4, 5, 1.5)
    t = NodeTree("marble")
    noise = t.node("TexNoise", {0: t.place((1, 1, 1)), "Scale": 3.0, "Detail": 8.0, "Distortion": 2.0}).outputs["Fac"]
    color = t.ramp(t.math("ABSOLUTE", t.math("SUBTRACT", noise, 0.5)), (0.3, 0.3, 0.33), (0.85, 0.84, 0.8), (0.9, 0.9, 0.88))
    inputs = {"Subsurface": 0.5, "Subsurface_Color": color, "Subsurface_Radius": (0.15, 0.12, 0.1), "Clearcoat": 0.5}
    stone = t.end(t.principled(color, 0.25, **inputs))
    pillar = [(0.001, 0), (0.7, 0), (0.7, 0.15), (0.5, 0.25), (0.45, 0.5), (0.55, 0.55), (0.55, 0.65), (0.001, 0.65)]
    stage.turned(stone, pillar)
    stage.add("monkey", stone, (0, 0, 1.25), rotation=(-15, 0, 25), subdivide=3, size=1.2)
    stage.camera((0, -5, 1.6), (0, 0, 0.95), 55)


def jade():
    """A displaced surface with light below it."""
    stage.begin((0.3, 0.32, 0.35), 0.5)
    stage.add("plane", stage.wood("table"), size=6)
    t = NodeTree("jade")
    cells = t.node("TexVoronoi", {0: t.node("TexCoord").outputs["UV"], "Scale": 12.0}, feature="SMOOTH_F1").outputs["Distance"]
    inputs = {"Subsurface": 1.0, "Subsurface_Color": (0.25, 0.7, 0.4, 1), "Subsurface_Radius": (0.15, 0.25, 0.15)}
    t.end(t.principled((0.3, 0.7, 0.45, 1), 0.15, **inputs))
    displacement = t.node("Displacement", {"Height": cells, "Midlevel": 0.5, "Scale": 0.2})
    output = next(node for node in t.tree.nodes if node.type == "OUTPUT_MATERIAL")
    t.tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
    stone = t.material
    (stone.cycles if bpy.app.version < (4, 1, 0) else stone).displacement_method = "DISPLACEMENT"
    stage.add("uv_sphere", stone, (0, 0, 0.62), radius=0.6, segments=256, ring_count=128)
    stage.add("torus", stone, (0.95, -0.5, 0.12), major_radius=0.3, minor_radius=0.12, major_segments=192, minor_segments=64)
    stage.lamp("AREA", (1.5, 2.0, 1.6), (0, 0, 0.6), 120.0, size=0.5)
    stage.lamp("AREA", (-2.5, -2, 2.5), (0, 0, 0.5), 60.0, size=1.0)
    stage.camera((0.2, -3.6, 1.4), (0.15, 0, 0.5), 50)


def leaves():
    stage.sky(elevation=35, rotation=20)
    leaf = _flesh("leaf", (0.15, 0.4, 0.05), (0.3, 0.6, 0.08), (0.005, 0.007, 0.003), 0.35)
    sides = {"x_subdivisions": 12, "y_subdivisions": 8}
    first = stage.add("grid", leaf, (0, 0, -20), (0.5, 0.22, 1), **sides)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    bend = {"deform_method": "BEND", "deform_axis": "Y", "angle": 0.9}
    for kind, settings in (("SIMPLE_DEFORM", bend), ("SOLIDIFY", {"thickness": 0.008})):
        modifier = first.modifiers.new(kind, kind)
        for name, value in settings.items():
            setattr(modifier, name, value)
        bpy.ops.object.modifier_apply(modifier=modifier.name)
    chance = random.Random(9)
    for _ in range(160):
        place = (chance.gauss(0, 1.3), chance.gauss(0.5, 0.8), chance.gauss(1.5, 0.9))
        stage.copy(first, place, chance.uniform(0.5, 1.0), [chance.uniform(0, math.tau) for _ in range(3)])
    stage.tube(stage.wood("branch"), [(-3, 0.6, 0.2), (-1, 0.5, 1.2), (0.5, 0.4, 1.7), (3, 0.3, 2.6)], 0.05)
    stage.camera((0, -4.5, 1.3), (0, 0, 1.5), 42)


def grapes():
    stage.softboxes(0.35)
    stage.add("plane", stage.plaster("table", (0.6, 0.55, 0.5)), size=6)
    kinds = [
        _flesh("green", (0.35, 0.5, 0.1), (0.5, 0.7, 0.1), (0.12, 0.15, 0.05), 0.2, Clearcoat=0.3),
        _flesh("red", (0.2, 0.02, 0.05), (0.5, 0.03, 0.06), (0.1, 0.03, 0.03), 0.3),
    ]
    chance = random.Random(10)
    for x, kind in ((-0.55, kinds[0]), (0.55, kinds[1])):
        berry = stage.add("uv_sphere", kind, (x, 0, 0.13), (1, 1, 1.15), radius=0.12)
        for k in range(45):
            layer, turn = k // 15, 2.4 * k
            radius = (0.45 - 0.13 * layer) * math.sqrt((k % 15 + 0.5) / 15)
            place = (x + radius * math.cos(turn), radius * math.sin(turn), 0.13 + 0.19 * layer)
            stage.copy(berry, place, chance.uniform(0.85, 1.05), [chance.uniform(-0.5, 0.5) for _ in range(3)])
    stage.camera((0, -3.2, 1.4), (0, 0, 0.25), 50)


def gummies():
    stage.begin((0.8, 0.8, 0.8), 0.5)
    stage.add("plane", stage.plastic("table", (0.8, 0.78, 0.75), 0.6), size=6)
    chance = random.Random(13)
    for i, color in enumerate(((0.9, 0.05, 0.05), (0.1, 0.7, 0.1), (0.95, 0.6, 0.05), (0.95, 0.9, 0.7), (0.9, 0.3, 0.05))):
        gum = _flesh("gum", color, color, [0.4 * c + 0.02 for c in color], 0.25, 0.7, Transmission=0.3)
        x, y = 0.55 * (i - 2), chance.uniform(-0.3, 0.3)
        turn = (0, 0, chance.uniform(-40, 40))
        body = stage.add("uv_sphere", gum, (x, y, 0.22), (0.8, 0.6, 1.1), turn, radius=0.2)
        stage.add("uv_sphere", gum, (x, y, 0.48), (1, 0.8, 0.9), turn, radius=0.14)
        body.modifiers.new("smooth", "SUBSURF")
        for side in (-1, 1):
            stage.add("uv_sphere", gum, (x + 0.1 * side, y - 0.02, 0.6), radius=0.055)
            stage.add("uv_sphere", gum, (x + 0.13 * side, y - 0.12, 0.3), (0.7, 1.2, 0.7), radius=0.07)
            stage.add("uv_sphere", gum, (x + 0.1 * side, y - 0.13, 0.07), (0.8, 1.3, 0.8), radius=0.08)
    stage.lamp("AREA", (1.5, 2.5, 2.0), (0, 0, 0.2), 120.0, size=0.7)
    stage.camera((0, -3.2, 1.2), (0, 0, 0.3), 48)


def snow():
    stage.sky(elevation=15, rotation=70)
    white = _flesh("snow", (0.9, 0.92, 0.95), (0.9, 0.95, 1), (0.1, 0.15, 0.25), 0.6)
    drift = stage.add("grid", white, size=24, x_subdivisions=300, y_subdivisions=300)
    for scale, strength in ((3.0, 1.6), (0.25, 0.06)):
        texture = bpy.data.textures.new("drift", "CLOUDS")
        texture.noise_scale = scale
        modifier = drift.modifiers.new("drift", "DISPLACE")
        modifier.texture, modifier.strength, modifier.mid_level = texture, strength, 0.5
    rock = stage.mottled("rock", (0.08, 0.08, 0.08), (0.2, 0.19, 0.18), scale=3.0, roughness=(0.7, 0.9))
    for place, size in (((-1.5, 1, 0.1), 0.7), ((1.8, 3, 0.2), 1.0), ((0.6, -1.5, 0), 0.35)):
        stage.add("ico_sphere", rock, place, (1.2, 1, 0.9), subdivisions=3, radius=size)
    stage.camera((0, -8, 1.8), (0, 0, 0.2), 38)


def cheese():
    """By the profiles that files of before 3.0 have."""
    stage.begin((0.5, 0.5, 0.5), 0.6)
    stage.turned(stage.wood("board"), [(0.001, 0), (1.2, 0), (1.2, 0.06), (0.001, 0.06)])
    t = NodeTree("cheese")
    inside = {"Color": (0.9, 0.65, 0.2, 1), "Radius": (0.5, 0.3, 0.1), "Scale": 0.3}
    below = t.node("SubsurfaceScattering", inside, falloff="BURLEY").outputs[0]
    gloss = t.node("BsdfGlossy", {"Roughness": 0.35}).outputs[0]
    rind = t.end(t.node("MixShader", {0: t.node("Fresnel", {"IOR": 1.4}).outputs[0], 1: below, 2: gloss}).outputs[0])
    wedge = stage.add("cylinder", rind, (-0.1, 0.2, 0.31), rotation=(0, 0, 10), vertices=3, radius=0.85, depth=0.5, smooth=False)
    wedge.modifiers.new("bevel", "BEVEL").width = 0.03
    for place, radius in (((0.1, -0.5, 0.16), 0.1), ((0.5, -0.45, 0.13), 0.07), ((-0.6, -0.55, 0.18), 0.12)):
        stage.add("uv_sphere", rind, place, radius=radius)
    stage.lamp("AREA", (2, 1.0, 2.5), (0, 0, 0.2), 120.0, size=0.8)
    stage.camera((0, -3.4, 1.6), (0, 0, 0.2), 48)


# ---- hair


def _grow(ground, material, count, length, **settings):
    """Hair on an object, of a material that becomes its second; settings of the particles by their names in bpy."""
    ground.data.materials.append(material)
    ground.modifiers.new("hair", "PARTICLE_SYSTEM")
    hair = ground.particle_systems[-1].settings
    hair.type, hair.count, hair.hair_length, hair.material = "HAIR", count, length, len(ground.data.materials)
    for name, value in {"root_radius": 1.0, "tip_radius": 0.2, **settings}.items():
        setattr(hair, name, value)
    return hair


def _hair(name, parametrization, **inputs):
    t = NodeTree(name)
    named = {key.replace("_", " "): value for key, value in inputs.items()}
    return t.end(t.node("BsdfHairPrincipled", named, parametrization=parametrization).outputs[0])


def fur_ball():
    stage.softboxes(0.4)
    stage.backdrop(stage.plastic("backdrop", (0.5, 0.4, 0.35), 0.7), 8, 4, 5, 1.5)
    ball = stage.add("uv_sphere", stage.plastic("hide", (0.3, 0.2, 0.12), 0.8), (0, 0, 0.9), radius=0.7)
    fur = _hair("fur", "MELANIN", Melanin=0.5, Melanin_Redness=0.7, Random_Color=0.3)
    settings = {"child_type": "SIMPLE", "rendered_child_count": 15, "child_radius": 0.1, "roughness_2": 0.05}
    _grow(ball, fur, 1500, 0.3, radius_scale=0.004, brownian_factor=0.05, **settings)
    for side in (-1, 1):
        stage.add("uv_sphere", stage.plastic("eye", stage.BLACK, 0.05), (0.25 * side, -0.85, 1.1), radius=0.11)
    stage.camera((0, -5, 1.6), (0, 0, 0.85), 60)


def hairdo():
    stage.begin((0.3, 0.32, 0.35), 0.6)
    stage.backdrop(stage.plastic("backdrop", (0.3, 0.4, 0.5), 0.8), 10, 5, 6, 2.0)
    face = _flesh("skin", (0.75, 0.45, 0.35), (0.8, 0.3, 0.2), (0.1, 0.03, 0.02), 0.45, 0.3)
    stage.add("uv_sphere", face, (0, 0, 1.2), (0.85, 0.95, 1.1), radius=0.6)
    cap = stage.add("uv_sphere", stage.plastic("scalp", (0.1, 0.05, 0.03)), (0, 0.03, 1.23), (0.85, 0.95, 1.1), (-30, 0, 0), radius=0.6)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.bisect(plane_co=(0, 0.0, 1.35), plane_no=(0, 0.5, 0.87), clear_inner=True)
    bpy.ops.object.mode_set(mode="OBJECT")
    hair = _hair("hair", "MELANIN", Melanin=0.65, Melanin_Redness=0.5, Random_Color=0.2, Coat=0.1)
    settings = {"child_type": "INTERPOLATED", "rendered_child_count": 40, "clump_factor": 0.5, "kink": "WAVE"}
    settings |= {"kink_amplitude": 0.03, "kink_frequency": 4.0, "object_align_factor": (0, 0.3, -0.3)}
    _grow(cap, hair, 400, 0.6, radius_scale=0.004, hair_step=8, render_step=5, **settings).effector_weights.gravity = 0.0
    stage.lamp("AREA", (-3, -3, 3.5), (0, 0, 1.2), 250.0, size=1.5)
    stage.lamp("AREA", (2, 3, 3), (0, 0, 1.3), 200.0, size=1)
    stage.camera((1.5, -5, 1.6), (0, 0, 1.15), 55)


def curls():
    """Curves of geometry nodes: spirals on a ball."""
    stage.softboxes(0.4)
    stage.backdrop(stage.plastic("backdrop", (0.35, 0.35, 0.4), 0.7), 8, 4, 5, 1.5)
    ball = stage.add("uv_sphere", stage.plastic("ball", (0.2, 0.05, 0.02), 0.8), (0, 0, 0.95), radius=0.6)
    tree = NodeTree.of_geometry("curls")
    grown = tree.node("GeometryNodeObjectInfo", {"Object": ball}, transform_space="RELATIVE").outputs["Geometry"]
    roots = tree.node("GeometryNodeDistributePointsOnFaces", {0: grown, "Density": 200.0})
    curl = {"Resolution": 12, "Rotations": 4.0, "Start Radius": 0.03, "End Radius": 0.05, "Height": 0.4}
    curl = tree.node("GeometryNodeCurveSpiral", curl).outputs[0]
    placed = {"Points": roots.outputs["Points"], "Instance": curl, "Rotation": roots.outputs["Rotation"]}
    strands = tree.node("GeometryNodeRealizeInstances", {0: tree.node("GeometryNodeInstanceOnPoints", placed).outputs[0]})
    strands = tree.node("GeometryNodeSetCurveRadius", {0: strands.outputs[0], "Radius": 0.008}).outputs[0]
    hair = _hair("hair", "COLOR", Color=(0.5, 0.16, 0.06, 1))
    made = stage.link(bpy.data.hair_curves.new("curls"), "curls")
    made.data.materials.append(hair)
    tree.make(made, tree.node("GeometryNodeSetMaterial", {0: strands, "Material": hair}).outputs[0])
    stage.camera((0, -5, 1.5), (0, 0, 0.95), 55)


def _blade(name, root, tip):
    """Grass: a colour along each strand, by half of the light through it."""
    t = NodeTree(name)
    color = t.mix(t.node("HairInfo").outputs["Intercept"], (*root, 1), (*tip, 1))
    through, front = t.node("BsdfTranslucent", {0: color}).outputs[0], t.node("BsdfDiffuse", {0: color}).outputs[0]
    return t.end(t.node("MixShader", {0: 0.4, 1: front, 2: through}).outputs[0])


def lawn():
    stage.sky(elevation=30, rotation=60)
    earth = stage.mottled("earth", (0.06, 0.04, 0.02), (0.12, 0.08, 0.05), roughness=(0.9, 1.0))
    ground = stage.add("grid", earth, size=8, x_subdivisions=40, y_subdivisions=40)
    blade = _blade("grass", (0.05, 0.12, 0.01), (0.3, 0.45, 0.08))
    settings = {"child_type": "SIMPLE", "rendered_child_count": 10, "child_radius": 0.2, "roughness_1": 0.05}
    _grow(ground, blade, 3000, 0.35, radius_scale=0.015, brownian_factor=0.06, **settings)
    stage.add("uv_sphere", stage.plastic("ball", (0.7, 0.1, 0.08), 0.3), (0.3, -0.6, 0.35), radius=0.35)
    stage.camera((0, -4.5, 1.1), (0, 0, 0.25), 38)


def meadow():
    """Tufts as instances of a collection."""
    stage.sky(elevation=45, rotation=-80)
    stage.add("plane", stage.mottled("earth", (0.06, 0.05, 0.02), (0.1, 0.1, 0.04), roughness=(0.9, 1.0)), size=60)
    tufts = []
    for k, tip in enumerate(((0.35, 0.45, 0.1), (0.6, 0.5, 0.2), (0.15, 0.35, 0.06))):
        root = stage.add("circle", stage.plastic("root", stage.BLACK), radius=0.12, fill_type="NGON")
        _grow(root, _blade("blade", (0.04, 0.1, 0.02), tip), 60, 0.5, radius_scale=0.012, brownian_factor=0.15)
        tufts.append(bpy.data.collections.new(f"tuft {k}"))
        tufts[-1].objects.link(root)
        bpy.context.collection.objects.unlink(root)
    chance = random.Random(15)
    for _ in range(1500):
        thing = stage.link(None, "tuft")
        thing.instance_type, thing.instance_collection = "COLLECTION", chance.choice(tufts)
        thing.location = (chance.uniform(-7, 7), chance.uniform(-4, 14), 0)
        thing.scale, thing.rotation_euler = [chance.uniform(0.6, 1.3)] * 3, (0, 0, chance.uniform(0, math.tau))
    stage.camera((0, -6, 1.2), (0, 0, 0.5), 35)


def rug():
    """Colours of a map at the root."""
    stage.begin((0.55, 0.65, 0.9), 0.7)
    stage.add("plane", stage.wood("floor"), size=12)
    back, sides = stage.plastic("back", (0.4, 0.35, 0.3), 0.9), {"x_subdivisions": 30, "y_subdivisions": 20}
    cloth = stage.add("grid", back, (0, 0, 0.01), (1.5, 1, 1), size=2, **sides)
    t = NodeTree("wool")
    maps = t.node("TexCoord").outputs["UV"]
    checks = t.node("TexChecker", {0: maps, "Color1": (0.6, 0.08, 0.05, 1), "Color2": (0.8, 0.7, 0.5, 1), "Scale": 8.0})
    wool = t.end(t.principled(checks.outputs["Color"], 0.8))
    settings = {"child_type": "INTERPOLATED", "rendered_child_count": 20, "kink": "CURL", "kink_amplitude": 0.015}
    _grow(cloth, wool, 2000, 0.12, radius_scale=0.008, brownian_factor=0.02, **settings)
    stage.lamp("SUN", (-4, -1, 4), (0, 0, 0), 3.0)
    stage.camera((0, -4.2, 2.0), (0, 0, 0), 45)


def sheep():
    """Wool of short curls, by the Hair BSDFs."""
    stage.begin((0.6, 0.7, 0.9), 0.7)
    stage.add("plane", stage.mottled("grass", (0.04, 0.1, 0.02), (0.1, 0.18, 0.04), roughness=(0.8, 1.0)), size=20)
    t = NodeTree("wool")
    bright = t.node("BsdfHair", {"Color": (0.9, 0.88, 0.8, 1), "RoughnessU": 0.4, "RoughnessV": 1.0}, component="Reflection")
    through = t.node("BsdfHair", {"Color": (0.85, 0.8, 0.7, 1), "RoughnessU": 0.5, "RoughnessV": 1.0}, component="Transmission")
    wool = t.end(t.node("MixShader", {0: 0.5, 1: bright.outputs[0], 2: through.outputs[0]}).outputs[0])
    dark = stage.plastic("face", (0.06, 0.05, 0.05), 0.6)
    body = stage.add("uv_sphere", stage.plastic("hide", (0.5, 0.45, 0.4)), (0, 0, 0.9), (1.3, 0.85, 0.85), radius=0.65)
    settings = {"child_type": "SIMPLE", "rendered_child_count": 12, "kink": "CURL", "kink_amplitude": 0.04, "kink_frequency": 4.0}
    _grow(body, wool, 2500, 0.16, radius_scale=0.006, child_radius=0.06, render_step=4, **settings)
    stage.add("uv_sphere", dark, (-0.95, -0.15, 1.15), (1.2, 0.8, 0.9), (0, -25, 0), radius=0.28)
    for x, y in ((-0.45, -0.3), (-0.45, 0.3), (0.45, -0.3), (0.45, 0.3)):
        stage.tube(dark, [(x, y, 0.5), (x, y, 0)], 0.07)
    stage.lamp("SUN", (-3, -5, 6), (0, 0, 0), 3.5)
    stage.camera((-0.8, -5, 1.4), (-0.1, 0, 0.75), 50)


def brush():
    """Few thick tubes."""
    stage.begin((0.6, 0.6, 0.62), 0.6)
    bpy.context.scene.cycles_curves.shape = "THICK"
    stage.add("plane", stage.plaster("table", (0.55, 0.6, 0.6)), size=6)
    handle = stage.plastic("handle", (0.1, 0.35, 0.5), 0.25, Clearcoat=0.5)
    stage.box(handle, (-1.2, -0.16, 0.2), (0.5, 0.16, 0.34), 0.05)
    plate = stage.add("grid", handle, (-0.7, 0, 0.35), (0.42, 0.13, 1), size=2, x_subdivisions=14, y_subdivisions=5)
    bristle = stage.plastic("bristle", (0.85, 0.82, 0.75), 0.35, Transmission=0.2)
    settings = {"emit_from": "FACE", "use_modifier_stack": True, "child_type": "SIMPLE", "rendered_child_count": 8}
    _grow(plate, bristle, 84, 0.4, radius_scale=0.02, tip_radius=0.8, child_radius=0.05, **settings)
    stage.lamp("AREA", (-2, -2, 3), (0, 0, 0.2), 120.0, size=1.0)
    stage.camera((-0.2, -3.2, 1.3), (-0.35, 0, 0.35), 50)


VOLUMES = (sunny_room, haze, underwater, smoke, puff, nebula, cloud, explosion, candle, milk, tea, ground_fog)
SUBSURFACE = (skin, marble, jade, leaves, grapes, gummies, snow, cheese)
HAIR = (fur_ball, hairdo, curls, lawn, meadow, rug, sheep, brush)
SCENES = {f.__name__: f for f in (*VOLUMES, *SUBSURFACE, *HAIR)}
