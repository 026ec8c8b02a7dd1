"""Scenes of what came with Blender 4 and 5, as those of scenes.py, which writes them: they need 5.0 or later."""

import random

import bpy
import stage
from stage import NodeTree


def _socket(node, name, kind):
    """An input or output of a node that has several of its name, by its type."""
    return next(s for s in (*node.inputs, *node.outputs) if s.name == name and s.type == kind and s.enabled)


def _finished(t, shader, **inputs):
    """A material that ends in a shader node; inputs by their names, "_" for a space."""
    named = {name.replace("_", " "): value for name, value in inputs.items()}
    return t.end(t.node(shader, named).outputs[0])


def new_file():
    """What a new file holds, with a bevelled cube on a floor: its camera, its lamp, its world."""
    bpy.ops.wm.read_factory_settings()
    bpy.ops.preferences.addon_enable(module="relief")
    bpy.context.scene.render.engine = "CYCLES"
    cube = bpy.data.objects["Cube"]
    bevel = cube.modifiers.new("bevel", "BEVEL")
    bevel.width, bevel.segments = 0.1, 4
    stage.add("plane", stage.checked("floor", (0.6, 0.6, 0.6), (0.2, 0.2, 0.22), 1.0), (0, 0, -1), size=30)
    stage.add("monkey", stage.plastic("monkey", (0.1, 0.35, 0.7), 0.3), (2.6, 1.5, 0), rotation=(-20, 0, 100), subdivide=2)
    stage.add("torus", stage.metal("ring"), (-1.5, -2.5, -0.75))


def alloys():
    """Metallic BSDF by tints and by indices, thin films, sheens, new coats."""
    stage.softboxes(0.5)
    stage.backdrop(stage.plastic("backdrop", (0.35, 0.35, 0.37), 0.5), 14, 5, 5)
    gold = NodeTree("gold")
    gold = gold.end(gold.node("BsdfMetallic", {"Base Color": (1, 0.75, 0.3, 1), "Edge Tint": (0.9, 0.95, 1, 1), "Roughness": 0.2}).outputs[0])
    copper = NodeTree("copper")
    physical = copper.node("BsdfMetallic", fresnel_type="PHYSICAL_CONDUCTOR")
    physical.inputs["IOR"].default_value, physical.inputs["Extinction"].default_value = (0.2, 0.92, 1.1), (3.9, 2.45, 2.14)
    brushed = copper.node("TexNoise", {0: copper.place((1, 1, 40)), "Scale": 3.0}).outputs[0]
    copper.tree.links.new(copper.node("MapRange", {0: brushed, 3: 0.15, 4: 0.4}).outputs[0], physical.inputs["Roughness"])
    physical.inputs["Anisotropy"].default_value = 0.6
    copper = copper.end(physical.outputs[0])
    bubble = _finished(NodeTree("bubble"), "BsdfGlass", Roughness=0.0, IOR=1.1, Thin_Film_Thickness=420.0, Thin_Film_IOR=1.4)
    oil = _finished(NodeTree("oil"), "BsdfMetallic", Roughness=0.15, Thin_Film_Thickness=300.0, Thin_Film_IOR=1.45)
    velvet = NodeTree("velvet")
    cloth, sheen = velvet.node("BsdfDiffuse", {"Color": (0.2, 0.02, 0.06, 1)}), velvet.node("BsdfSheen", {"Color": (0.9, 0.6, 0.7, 1), "Roughness": 0.4})
    velvet = velvet.end(velvet.node("AddShader", {0: cloth.outputs[0], 1: sheen.outputs[0]}).outputs[0])
    lacquer = NodeTree("lacquer")
    wood = lacquer.ramp(lacquer.node("TexNoise", {0: lacquer.place((1, 8, 1)), "Scale": 2.0}).outputs[0], (0.2, 0.07, 0.02), (0.5, 0.25, 0.1))
    coated = lacquer.principled(wood, 0.6, Clearcoat=1.0)
    node = coated.node
    node.inputs["Coat IOR"].default_value, node.inputs["Coat Tint"].default_value = 1.7, (1, 0.8, 0.5, 1)
    node.inputs["Sheen Weight"].default_value, node.inputs["Diffuse Roughness"].default_value = 0.2, 0.8
    lacquer = lacquer.end(coated)
    for i, material in enumerate((gold, copper, bubble, oil, velvet, lacquer)):
        x, y = 1.5 * (i % 3) - 1.5, 1.6 * (i // 3) - 0.5
        stage.add("uv_sphere", material, (x, y, 0.62), radius=0.6, segments=64, ring_count=32)
    stage.camera((0.8, -6.5, 2.6), (0, 0.3, 0.5), 50)


def patterns():
    """Gabor, all kinds of Noise, fractal Voronoi, white noise, and what 4.0 and later made of Mix and Hue."""
    stage.begin((0.5, 0.55, 0.65), 0.7)
    kinds = ("FBM", "MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
    made = []
    for i, kind in enumerate(kinds):
        t = NodeTree(kind.lower())
        noise = t.node("TexNoise", {0: t.place((1, 1, 1)), "Scale": 3.0, "Detail": 6.0}, noise_type=kind, normalize=i % 2 == 0)
        height = noise.outputs[0]
        made.append(t.end(t.principled(t.ramp(height, (0.02, 0.05 * i, 0.2), (0.9, 0.5, 0.1 * i)), 0.5, height)))
    for gabor in ("2D", "3D"):
        t = NodeTree("gabor")
        node = t.node("TexGabor", {0: t.place((1, 1, 1)), "Scale": 2.0, "Frequency": 3.0, "Anisotropy": 0.8}, gabor_type=gabor)
        made.append(t.end(t.principled(t.ramp(node.outputs["Value"], (0.02, 0.02, 0.02), (0.8, 0.7, 0.5)), 0.3, node.outputs["Intensity"])))
    for feature, distance in (("F1", "EUCLIDEAN"), ("F2", "CHEBYCHEV"), ("SMOOTH_F1", "MINKOWSKI"), ("DISTANCE_TO_EDGE", "EUCLIDEAN")):
        t = NodeTree("cells")
        node = t.node("TexVoronoi", {0: t.place((1, 1, 1))}, feature=feature, distance=distance, normalize=True)
        node.inputs["Scale"].default_value, node.inputs["Detail"].default_value = 3.0, 2.5
        color = node.outputs["Color"] if feature != "DISTANCE_TO_EDGE" else t.ramp(node.outputs["Distance"], (0, 0, 0), (0.9, 0.8, 0.6))
        made.append(t.end(t.principled(color, 0.4, node.outputs["Distance"])))
    t = NodeTree("white")
    snapped = t.node("VectorMath", {0: t.place((6, 6, 6))}, operation="FLOOR").outputs[0]
    white = t.node("TexWhiteNoise", {"Vector": snapped}, noise_dimensions="3D")
    mix = t.node("Mix", data_type="RGBA", blend_type="EXCLUSION")
    _socket(mix, "Factor", "VALUE").default_value, _socket(mix, "B", "RGBA").default_value = 0.7, (0.9, 0.3, 0.1, 1)
    t.tree.links.new(white.outputs["Color"], _socket(mix, "A", "RGBA"))
    hue = t.node("HueSaturation", {"Hue": 0.8, "Saturation": 1.3, "Color": _socket(mix, "Result", "RGBA")})
    made.append(t.end(t.principled(hue.outputs[0], 0.3)))
    for i, material in enumerate(made):
        stage.add("cube", material, (1.15 * (i % 6) - 2.9, 1.2 * (i // 6), 0.45 + 0.9 * (i // 6)), (0.9, 0.9, 0.9), (0, 0, 20), False, size=1)
    stage.add("plane", stage.plastic("floor", (0.6, 0.6, 0.58), 0.7), size=30)
    stage.lamp("AREA", (-3, -5, 6), (0, 0, 0.5), 500.0, size=2, use_temperature=True, temperature=4500.0)
    stage.camera((0.5, -7.5, 3.0), (0, 0.4, 0.75), 48)


def scattered():
    """Geometry nodes: stones, blades and beads on a hill, with attributes that materials read, as a mesh, curves and points."""
    stage.sky(elevation=30, rotation=140)
    hill = NodeTree.of_geometry("hill")
    grid = hill.node("GeometryNodeMeshGrid", {"Size X": 12.0, "Size Y": 12.0, "Vertices X": 120, "Vertices Y": 120}).outputs[0]
    noise = hill.node("TexNoise", {"Scale": 0.5, "Detail": 4.0}).outputs[0]
    up = hill.node("CombineXYZ", {"Z": hill.math("MULTIPLY", noise, 1.6)}).outputs[0]
    hill_mesh = hill.node("GeometryNodeSetPosition", {"Geometry": grid, "Offset": up}).outputs[0]
    spread = hill.node("GeometryNodeDistributePointsOnFaces", {"Mesh": hill_mesh}, distribute_method="RANDOM")
    _socket(spread, "Density", "VALUE").default_value = 6.0
    size = hill.node("FunctionNodeRandomValue", data_type="FLOAT")
    _socket(size, "Min", "VALUE").default_value, _socket(size, "Max", "VALUE").default_value = 0.04, 0.16
    ball = hill.node("GeometryNodeMeshIcoSphere", {"Radius": 1.0, "Subdivisions": 3}).outputs[0]
    stones = hill.node("GeometryNodeInstanceOnPoints", {"Points": spread.outputs["Points"], "Instance": ball, "Rotation": spread.outputs["Rotation"]})
    hill.tree.links.new(_socket(size, "Value", "VALUE"), stones.inputs["Scale"])
    tint = hill.node("FunctionNodeRandomValue", data_type="FLOAT_VECTOR")
    stored = hill.node("GeometryNodeStoreNamedAttribute", {"Geometry": stones.outputs[0], "Name": "tint"}, data_type="FLOAT_VECTOR", domain="INSTANCE")
    hill.tree.links.new(_socket(tint, "Value", "VECTOR"), _socket(stored, "Value", "VECTOR"))
    real = hill.node("GeometryNodeRealizeInstances", {"Geometry": stored.outputs[0]}).outputs[0]
    t = NodeTree("stone")
    painted = t.end(t.principled(t.node("Attribute", attribute_name="tint").outputs["Color"], 0.4))
    stones_end = hill.node("GeometryNodeSetMaterial", {"Geometry": real, "Material": painted}).outputs[0]
    ground = stage.mottled("ground", (0.1, 0.07, 0.03), (0.25, 0.2, 0.1), scale=6.0, roughness=(0.8, 1.0))
    ground_end = hill.node("GeometryNodeSetMaterial", {"Geometry": hill_mesh, "Material": ground}).outputs[0]
    line = hill.node("GeometryNodeCurvePrimitiveLine", {"End": (0.0, 0.03, 0.5)}).outputs[0]
    blades = hill.node("GeometryNodeDistributePointsOnFaces", {"Mesh": hill_mesh}, distribute_method="RANDOM")
    _socket(blades, "Density", "VALUE").default_value, _socket(blades, "Seed", "INT").default_value = 120.0, 3
    grass = hill.node("GeometryNodeInstanceOnPoints", {"Points": blades.outputs["Points"], "Instance": line, "Rotation": blades.outputs["Rotation"]})
    grass = hill.node("GeometryNodeRealizeInstances", {"Geometry": grass.outputs[0]}).outputs[0]
    thin = hill.node("GeometryNodeSetCurveRadius", {"Curve": grass, "Radius": 0.006})
    leaf = NodeTree("blade")
    leaf = leaf.end(leaf.principled((0.06, 0.2, 0.03, 1), 0.5))
    grass_end = hill.node("GeometryNodeSetMaterial", {"Geometry": thin.outputs[0], "Material": leaf}).outputs[0]
    beads = hill.node("GeometryNodeDistributePointsOnFaces", {"Mesh": hill_mesh}, distribute_method="RANDOM")
    _socket(beads, "Density", "VALUE").default_value, _socket(beads, "Seed", "INT").default_value = 8.0, 7
    raised = hill.node("GeometryNodeSetPosition", {"Geometry": beads.outputs["Points"], "Offset": (0, 0, 0.4)}).outputs[0]
    sized = hill.node("GeometryNodeSetPointRadius", {"Points": raised, "Radius": 0.05}).outputs[0]
    dew = hill.node("GeometryNodeSetMaterial", {"Geometry": sized, "Material": stage.metal("dew", (0.9, 0.95, 1), 0.1)}).outputs[0]
    joined = hill.node("GeometryNodeJoinGeometry")
    for end in (stones_end, ground_end, grass_end, dew):
        hill.tree.links.new(end, joined.inputs[0])
    hill.make(stage.add("plane", None, size=1), joined.outputs[0])
    stage.camera((0, -7.5, 3.0), (0, 0, 0.8), 40)


def clouds():
    """Media by their phase functions: a cloud of droplets, a blue shell of air, murky water, dust by coefficients."""
    stage.begin((0.12, 0.2, 0.4), 0.6)
    stage.add("plane", stage.checked("floor", (0.5, 0.5, 0.5), (0.25, 0.25, 0.25), 1.0), size=30)
    bpy.context.scene.cycles.volume_bounces = 3

    def medium(name, kind, phase, **inputs):
        t = NodeTree(name)
        node = t.node(kind, phase=phase)
        for socket, value in inputs.items():
            node.inputs[socket.replace("_", " ")].default_value = value
        t.node("OutputMaterial", {"Volume": node.outputs[0]})
        return t.material

    droplets = medium("droplets", "VolumeScatter", "MIE", Color=(0.98, 0.98, 0.98, 1), Density=4.0, Diameter=10.0)
    air = medium("air", "VolumeScatter", "RAYLEIGH", Color=(0.3, 0.5, 0.9, 1), Density=1.2)
    water = medium("water", "VolumeScatter", "FOURNIER_FORAND", Color=(0.5, 0.9, 0.8, 1), Density=2.0, IOR=1.2, Backscatter=0.1)
    coefficients = {"Scatter_Coefficients": (1.6, 1.1, 0.6), "Absorption_Coefficients": (0.1, 0.3, 0.8)}
    dust = medium("dust", "VolumeCoefficients", "DRAINE", **coefficients, Anisotropy=0.5, Alpha=0.8)
    for i, material in enumerate((droplets, air, water, dust)):
        x = 1.7 * i - 2.55
        stage.add("ico_sphere", material, (x, 0, 0.95), radius=0.75, subdivisions=5)
        stage.add("cylinder", stage.plastic("post", (0.5, 0.1, 0.05), 0.4), (x + 0.3, 1.0, 0.7), radius=0.12, depth=1.4)
    stage.lamp("SUN", (-2, 6, 3.0), (0, 0, 0.9), 3.0, angle=0.02)
    stage.lamp("AREA", (3, -4, 4), (0, 0, 0.8), 200.0, size=1.0, color=(1, 0.8, 0.6))
    stage.camera((0, -7.0, 1.9), (0, 0, 0.85), 45)


def flesh():
    """Random walks of 5.2 in a head and fruits, and hair by Huang's model."""
    stage.softboxes(0.6)
    stage.add("plane", stage.plastic("table", (0.3, 0.25, 0.22), 0.5), size=12)
    skin = NodeTree("skin")
    blotches = skin.node("TexNoise", {0: skin.place((1, 1, 1)), "Scale": 5.0, "Detail": 4.0}).outputs[0]
    shader = skin.principled(skin.ramp(blotches, (0.75, 0.35, 0.25), (0.9, 0.6, 0.48)), 0.4, blotches)
    shader.node.inputs["Subsurface Weight"].default_value, shader.node.inputs["Subsurface Scale"].default_value = 1.0, 0.08
    head = stage.add("monkey", skin.end(shader), (-0.9, 0, 0.95), rotation=(-10, 0, 15), subdivide=2)
    bpy.context.view_layer.objects.active = head
    grape = NodeTree("grape")
    inputs = {"Color": (0.35, 0.6, 0.1, 1), "Scale": 0.12, "Radius": (1.0, 0.9, 0.3), "Anisotropy": 0.5}
    inside = grape.node("SubsurfaceScattering", inputs, falloff="RANDOM_WALK_SKIN")
    coat = grape.node("BsdfGlossy", {"Roughness": 0.15})
    rim = grape.node("Fresnel", {0: 1.4}).outputs[0]
    grape = grape.end(grape.node("MixShader", {0: rim, 1: inside.outputs[0], 2: coat.outputs[0]}).outputs[0])
    chance = random.Random(5)
    for _ in range(12):
        place = (chance.uniform(0.35, 1.2), chance.uniform(-0.8, 0.0), 0.18 + chance.uniform(0, 0.2))
        stage.add("uv_sphere", grape, place, radius=0.18, segments=32, ring_count=16)
    ball = stage.add("uv_sphere", stage.plastic("scalp", (0.1, 0.05, 0.03)), (1.0, 0.8, 0.6), radius=0.45)
    hair = NodeTree("hair")
    strand = hair.node("BsdfHairPrincipled", {"Roughness": 0.3, "Random Color": 0.3}, parametrization="MELANIN", model="HUANG")
    strand.inputs["Melanin"].default_value, strand.inputs["Melanin Redness"].default_value = 0.5, 0.8
    ball.data.materials.append(hair.end(strand.outputs[0]))
    system = ball.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count, system.hair_length, system.material = "HAIR", 4000, 0.25, 2
    system.root_radius, system.radius_scale = 1.0, 0.004
    stage.camera((0, -4.2, 1.7), (0, 0.1, 0.7), 50)


def shaders_that_repeat():
    """A fractal by a repeat zone, a choice by a menu, bundles and closures."""
    stage.softboxes(0.6)
    stage.backdrop(stage.plastic("backdrop", (0.5, 0.5, 0.5), 0.5), 10, 4, 5)
    t = NodeTree("fractal")
    first, last = t.node("GeometryNodeRepeatInput"), t.node("GeometryNodeRepeatOutput")
    first.pair_with_output(last)
    last.repeat_items.new("VECTOR", "z")
    last.repeat_items.new("FLOAT", "count")
    first.inputs["Iterations"].default_value = 12
    t.tree.links.new(t.place((1.6, 1.6, 1.6)), first.inputs["z"])
    # z² + c of complex numbers.
    parts, start = t.node("SeparateXYZ", {0: first.outputs["z"]}), t.node("SeparateXYZ", {0: t.place((1.6, 1.6, 1.6))})
    x, y = parts.outputs["X"], parts.outputs["Z"]
    real = t.math("ADD", t.math("SUBTRACT", t.math("MULTIPLY", x, x), t.math("MULTIPLY", y, y)), start.outputs["X"])
    imaginary = t.math("ADD", t.math("MULTIPLY", t.math("MULTIPLY", x, y), 2.0), start.outputs["Z"])
    z = t.node("CombineXYZ", {"X": t.math("MINIMUM", t.math("MAXIMUM", real, -9.0), 9.0), "Z": t.math("MINIMUM", t.math("MAXIMUM", imaginary, -9.0), 9.0)})
    t.tree.links.new(z.outputs[0], last.inputs["z"])
    length = t.node("VectorMath", {0: first.outputs["z"]}, operation="LENGTH").outputs["Value"]
    t.tree.links.new(t.math("ADD", first.outputs["count"], t.math("LESS_THAN", length, 2.0)), last.inputs["count"])
    share = t.math("DIVIDE", last.outputs["count"], 12.0)
    board = t.end(t.principled(t.ramp(share, (0.02, 0.02, 0.1), (0.9, 0.5, 0.1), (0.95, 0.9, 0.8)), 0.3))
    stage.add("plane", board, (0, 1.0, 1.3), rotation=(80, 0, 0), size=2.4)
    s = NodeTree("packed")
    pack, unpack = s.node("NodeCombineBundle"), s.node("NodeSeparateBundle")
    for node in (pack, unpack):
        node.bundle_items.new("FLOAT", "rough")
        node.bundle_items.new("RGBA", "color")
    stripes = s.node("TexWave", {0: s.place((2, 2, 2)), "Distortion": 3.0}).outputs[0]
    s.tree.links.new(s.ramp(stripes, (0.1, 0.3, 0.6), (0.9, 0.9, 0.8)), pack.inputs["color"])
    s.tree.links.new(s.math("MULTIPLY", stripes, 0.6), pack.inputs["rough"])
    s.tree.links.new(pack.outputs[0], unpack.inputs[0])
    packed = s.end(s.principled(unpack.outputs["color"], unpack.outputs["rough"]))
    stage.add("uv_sphere", packed, (-1.1, -0.6, 0.5), radius=0.5)
    stage.add("uv_sphere", stage.glass("glass", ior=1.5), (1.1, -0.6, 0.5 + stage.CLEAR), radius=0.5)
    stage.camera((0, -5.2, 1.7), (0, 0.3, 0.95), 45)


def lit_meshes():
    """Lamps that are meshes, with blackbodies and textures, in a room under the sky of 5.0."""
    stage.sky(elevation=8, rotation=-100, strength=0.05)
    stage.room_shell(stage.plaster(), stage.wood("floor"))
    stage.furniture(stage.plastic("sofa", (0.2, 0.25, 0.15), 0.9, Sheen=0.4), stage.wood())
    warm = NodeTree("warm")
    color = warm.node("Blackbody", {0: 2700.0}).outputs[0]
    warm = warm.end(warm.node("Emission", {"Color": color, "Strength": 12.0}).outputs[0])
    for x, y in ((-1.2, 0.6), (0.0, 1.4), (1.2, 0.2)):
        stage.add("torus", warm, (x, y, 2.2), major_radius=0.22, minor_radius=0.03)
    screen = NodeTree("screen")
    colors = screen.node("TexVoronoi", {0: screen.place((1, 1, 1)), "Scale": 3.0}).outputs["Color"]
    screen = screen.end(screen.node("Emission", {"Color": colors, "Strength": 3.0}).outputs[0])
    stage.box(screen, (-0.9, 2.9, 1.1), (0.5, 2.95, 1.9), 0)
    stage.camera((0.6, -2.8, 1.5), (-0.2, 1.5, 1.1), 22)


#: By name, in the order of the tables.
SCENES = {f.__name__: f for f in (new_file, alloys, patterns, scattered, clouds, flesh, shaders_that_repeat, lit_meshes)}
