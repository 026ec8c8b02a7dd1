"""Lights whose nodes vary: what they read, and IES files."""

import math
import os

import bpy
import numpy as np
from scenes import (
    IS_4_0,
    IS_5_0,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    folder,
    make_sharp,
    new_material,
    new_scene,
    set_bounces,
)


def _stage(light):
    """A floor with a ball on it, lit by one light.

    @param  light  bpy object, or what makes it
    """
    scene = new_scene()
    add_plane(material=diffuse((0.8, 0.5, 0.3)))
    add_sphere(0.6, location=(0.3, 0.2, 0.6))
    add_camera((0, -6, 5), degrees(50, 0, 0), lens=40)
    light()
    return scene


class _Nodes:
    """The node tree of a light.

    output  its Light Output
    emission  its Emission node
    """

    def __init__(self, light):
        light.data.use_nodes = True
        self.tree = light.data.node_tree
        self.output = next(n for n in self.tree.nodes if n.bl_idname == "ShaderNodeOutputLight")
        self.emission = next(n for n in self.tree.nodes if n.bl_idname == "ShaderNodeEmission")

    def new(self, kind, **options):
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in options.items():
            setattr(node, name, value)
        return node

    def link(self, output, target):
        self.tree.links.new(output, target)

    def color(self, output):
        self.link(output, self.emission.inputs["Color"])

    def strength(self, output):
        self.link(output, self.emission.inputs["Strength"])

    def math(self, operation, a, b):
        """A Math node of sockets or numbers; returns its output."""
        node = self.new("Math", operation=operation)
        for socket, value in zip(node.inputs, (a, b)):
            if isinstance(value, (int, float)):
                socket.default_value = value
            else:
                self.link(value, socket)
        return node.outputs[0]

    def checker(self, vector, scale):
        """Colour of patches of red and blue."""
        node = self.new("TexChecker")
        node.inputs["Color1"].default_value = (1.0, 0.3, 0.1, 1)
        node.inputs["Color2"].default_value = (0.1, 0.3, 1.0, 1)
        node.inputs["Scale"].default_value = scale
        self.link(vector, node.inputs["Vector"])
        return node.outputs["Color"]


def _image():
    """An image of 4 × 4 texels of many colours, packed."""
    image = bpy.data.images.new("slide", 4, 4, float_buffer=False)
    pixels = np.ones((4, 4, 4), dtype=np.float32)
    pixels[..., 0] = np.linspace(0, 1, 4)
    pixels[..., 1] = np.linspace(1, 0.2, 4)[:, None]
    pixels[..., 2] = np.eye(4)
    image.pixels = pixels.ravel()
    image.pack()
    return image


def test_point_by_black_body():
    def light():
        nodes = _Nodes(add_light("POINT", (1, -1, 3), energy=100, shadow_soft_size=0.1))
        body = nodes.new("Blackbody")
        body.inputs[0].default_value = 2700
        nodes.color(body.outputs[0])

    assert_agrees(_stage(light), samples=16)


def _falloff(output, smooth):
    def light():
        nodes = _Nodes(add_light("POINT", (1, -1, 2), energy=60, shadow_soft_size=0.1))
        falloff = nodes.new("LightFalloff")
        falloff.inputs["Strength"].default_value = 1.0
        falloff.inputs["Smooth"].default_value = smooth
        nodes.strength(falloff.outputs[output])

    return _stage(light)


def test_linear_falloff():
    assert_agrees(_falloff("Linear", 0.0), samples=16)


def test_constant_falloff_with_smooth():
    assert_agrees(_falloff("Constant", 3.0), samples=16)


def test_quadratic_falloff_with_smooth():
    assert_agrees(_falloff("Quadratic", 5.0), samples=16)


def _add_area(**options):
    sizes = {"shape": "RECTANGLE", "energy": 200, "size": 1.6, "size_y": 1.0, **options}
    return add_light("AREA", (0.6, 0.4, 2), degrees(10, 15, 30), **sizes)


def test_area_by_parametric():
    def light():
        nodes = _Nodes(_add_area())
        nodes.color(nodes.checker(nodes.new("NewGeometry").outputs["Parametric"], 3.0))

    assert_agrees(_stage(light), samples=32)


def test_area_by_an_image():
    def light():
        nodes = _Nodes(_add_area())
        image = nodes.new("TexImage", image=_image())
        nodes.link(nodes.new("NewGeometry").outputs["Parametric"], image.inputs["Vector"])
        nodes.color(image.outputs["Color"])

    assert_agrees(_stage(light), samples=32)


def test_area_by_an_image_in_a_mirror():
    """Met by glossy rays, and by the camera's."""
    scene = new_scene()
    material, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1))
    make_sharp(node)
    add_plane(material=material)
    light = add_light("AREA", (0.3, 0, 2), degrees(0, 0, 20), shape="RECTANGLE", energy=60, size=1.6, size_y=1.0)
    nodes = _Nodes(light)
    image = nodes.new("TexImage", image=_image(), interpolation="Closest")
    nodes.link(nodes.new("NewGeometry").outputs["Parametric"], image.inputs["Vector"])
    nodes.color(image.outputs["Color"])
    add_camera((0, 0, 4), lens=50)
    set_bounces(scene, 1)
    assert_agrees(scene, samples=16, block=4)


def test_area_by_uv():
    """Without a link images use UV, which lights have since 4.0."""

    def light():
        nodes = _Nodes(_add_area(shape="ELLIPSE"))
        nodes.color(nodes.new("TexImage", image=_image()).outputs["Color"])

    assert_agrees(_stage(light), samples=32)


def test_area_by_position_and_direction():
    def light():
        nodes = _Nodes(_add_area())
        geometry, coordinates = nodes.new("NewGeometry"), nodes.new("TexCoord")
        add = nodes.new("VectorMath", operation="ADD")
        nodes.link(geometry.outputs["Incoming"], add.inputs[0])
        nodes.link(coordinates.outputs["Object"], add.inputs[1])
        nodes.color(nodes.checker(add.outputs[0], 2.0))

    assert_agrees(_stage(light), samples=32)


def _gobo(radius, output="Normal"):
    def light():
        spot = {"energy": 800, "spot_size": math.radians(70), "spot_blend": 0.3, "shadow_soft_size": radius}
        nodes = _Nodes(add_light("SPOT", (0, -1, 4), degrees(-10, 5, 40), **spot))
        nodes.color(nodes.checker(nodes.new("TexCoord").outputs[output], 6.0))

    return _stage(light)


def test_gobo_by_normal():
    assert_agrees(_gobo(0.0), samples=16)


def test_gobo_by_generated():
    # Since 5.0 in the light's own space: without a size it would be at a corner of squares, whose colour is rounding's to say.
    assert_agrees(_gobo(0.25 if IS_5_0 else 0.0, "Generated"), samples=16)


def test_gobo_projected_by_the_cone():
    """An image divided by depth, as slides are made."""

    def light():
        spot = {"energy": 800, "spot_size": math.radians(60), "spot_blend": 0.1, "shadow_soft_size": 0.0}
        nodes = _Nodes(add_light("SPOT", (0, -1, 4), degrees(-10, 5, 40), **spot))
        parts, vector = nodes.new("SeparateXYZ"), nodes.new("CombineXYZ")
        nodes.link(nodes.new("TexCoord").outputs["Normal"], parts.inputs[0])
        for axis in "XY":
            divided = nodes.math("DIVIDE", parts.outputs[axis], parts.outputs["Z"])
            nodes.link(nodes.math("ADD", divided, 0.5), vector.inputs[axis])
        image = nodes.new("TexImage", image=_image())
        nodes.link(vector.outputs[0], image.inputs["Vector"])
        nodes.color(image.outputs["Color"])

    assert_agrees(_stage(light), samples=16)


def test_spot_and_point_by_their_uv():
    def light():
        spot = {"energy": 400, "spot_size": math.radians(60), "spot_blend": 0.1, "shadow_soft_size": 0.0}
        for made in (
            add_light("SPOT", (0, -1, 4), degrees(-10, 5, 40), **spot),
            add_light("POINT", (1, 1, 2), degrees(20, 30, 0), energy=100, shadow_soft_size=0.0),
        ):
            nodes = _Nodes(made)
            image = nodes.new("TexImage", image=_image(), interpolation="Closest")
            nodes.link(nodes.new("TexCoord").outputs["UV"], image.inputs["Vector"])
            nodes.color(image.outputs["Color"])

    assert_agrees(_stage(light), samples=16)


def test_point_with_radius_by_normal():
    def light():
        nodes = _Nodes(add_light("POINT", (0.8, -0.6, 1.8), degrees(0, 0, 0), energy=100, shadow_soft_size=0.4))
        nodes.color(nodes.checker(nodes.new("NewGeometry").outputs["Normal"], 2.0))

    assert_agrees(_stage(light), samples=64)


def test_sun_by_direction():
    """Factors of what a sun has one of."""

    def light():
        nodes = _Nodes(add_light("SUN", rotation=degrees(30, 20, 0), energy=3, angle=math.radians(4)))
        nodes.color(nodes.new("NewGeometry").outputs["Position"])
        absolute = nodes.new("VectorMath", operation="ABSOLUTE")
        nodes.link(nodes.new("NewGeometry").outputs["Position"], absolute.inputs[0])
        nodes.color(absolute.outputs[0])
        nodes.strength(nodes.new("LightFalloff").outputs["Quadratic"])

    assert_agrees(_stage(light), samples=32)


def test_object_info_of_lights():
    def light():
        for number, place in enumerate(((1, -1, 3), (-1, 0, 2))):
            made = add_light("POINT", place, energy=200, shadow_soft_size=0.0)
            made.name = f"lamp of some name {number}"
            nodes = _Nodes(made)
            info, add = nodes.new("ObjectInfo"), nodes.new("VectorMath", operation="ADD")
            nodes.link(info.outputs["Location"], add.inputs[0])
            nodes.link(info.outputs["Random"], add.inputs[1])
            nodes.color(add.outputs[0])

    if bpy.app.version >= (5, 0, 0):
        assert_warns(_stage(light), "Location of a light")
    else:
        assert_agrees(_stage(light), samples=16)


def _mixed_by(output):
    """A lamp that the camera sees: green where an output of Light Path is not 0, else red."""

    def light():
        made = add_light("AREA", (0.5, 1.2, 1.2), degrees(60, 0, 0), energy=60, size=1.2)
        made.visible_camera = True
        nodes = _Nodes(made)
        other, mix = nodes.new("Emission"), nodes.new("MixShader")
        nodes.emission.inputs["Color"].default_value = (1, 0.1, 0.1, 1)
        other.inputs["Color"].default_value = (0.1, 1, 0.1, 1)
        nodes.link(nodes.new("LightPath").outputs[output], mix.inputs[0])
        nodes.link(nodes.emission.outputs[0], mix.inputs[1])
        nodes.link(other.outputs[0], mix.inputs[2])
        nodes.link(mix.outputs[0], nodes.output.inputs["Surface"])

    return _stage(light)


def test_camera_rays_are_of_no_kind():
    """As in Cycles, which asks lights without saying who asks."""
    assert_agrees(_mixed_by("Is Camera Ray"), samples=32, block=4)


def test_depths():
    """A mix by depth less 1: 0 where the camera sees the lamp and where it lights what the camera sees."""
    scene = _mixed_by("Is Camera Ray")
    tree = next(o for o in scene.objects if o.type == "LIGHT").data.node_tree
    mix = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeMixShader")
    less = tree.nodes.new("ShaderNodeMath")
    less.operation = "SUBTRACT"
    path = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeLightPath")
    tree.links.new(path.outputs["Ray Depth"], less.inputs[0])
    less.inputs[1].default_value = 1.0
    tree.links.new(less.outputs[0], mix.inputs[0])
    # Light that a path meets by chance counts one more in Cycles: not here. (relief says that it uses it all the same.)
    scene.relief.strict = False
    next(o for o in scene.objects if o.type == "LIGHT").data.cycles.use_multiple_importance_sampling = False
    set_bounces(scene, 1)
    assert_agrees(scene, samples=64, block=8)


def test_sum_of_emissions():
    def light():
        nodes = _Nodes(_add_area())
        other, add = nodes.new("Emission"), nodes.new("AddShader")
        other.inputs["Color"].default_value = (0.1, 0.2, 0.8, 1)
        nodes.color(nodes.checker(nodes.new("NewGeometry").outputs["Parametric"], 2.0))
        nodes.link(nodes.emission.outputs[0], add.inputs[0])
        nodes.link(other.outputs[0], add.inputs[1])
        nodes.link(add.outputs[0], nodes.output.inputs["Surface"])

    assert_agrees(_stage(light), samples=32)


#: Angles of a profile that is the same nowhere.
_VERTICAL = [0, 10, 25, 40, 55, 70, 80, 90, 120, 150, 180]
_HORIZONTAL = [0, 30, 90, 150, 180, 240, 300, 360]


def _ies(vertical=_VERTICAL, horizontal=_HORIZONTAL, kind=1, factor=20.0):
    """Text of an IES file of an asymmetric profile."""
    rows = []
    for h in horizontal:
        turn = math.radians(h % 360)
        values = [
            100 * (1.2 + math.cos(turn) + 0.6 * math.sin(2 * turn)) * math.exp(-(((v - 35) / 40) ** 2)) + 5
            for v in vertical
        ]
        rows.append(" ".join(f"{v:.4f}" for v in values))
    numbers = [f"1 1000 {factor} {len(vertical)} {len(horizontal)} {kind} 2 0.1 0.1 0.1", "1 1 50"]
    numbers += [" ".join(map(str, vertical)), " ".join(map(str, horizontal)), *rows]
    return "\n".join(["IESNA:LM-63-2002", "[TEST] none", "TILT=NONE", *numbers, ""])


def _ies_scene(make, text=None, radius=0.0, kind="POINT"):
    """A light with an IES Texture.

    @param  make  called with the node, to set what it reads
    """

    def light():
        spot = {"spot_size": math.radians(120)} if kind == "SPOT" else {}
        made = add_light(kind, (0.4, -0.6, 2.2), degrees(15, 20, 30), energy=6, shadow_soft_size=radius, **spot)
        nodes = _Nodes(made)
        node = nodes.new("TexIES")
        node.inputs["Strength"].default_value = 1.5
        make(node)
        nodes.strength(node.outputs[0])

    return _stage(light)


def _set_text(text):
    def make(node):
        data = bpy.data.texts.new("profile.ies")
        data.write(text)
        node.mode, node.ies = "INTERNAL", data

    return make


def test_ies_text():
    assert_agrees(_ies_scene(_set_text(_ies())), samples=16)


def test_ies_of_a_spot():
    assert_agrees(_ies_scene(_set_text(_ies()), kind="SPOT"), samples=16)


def test_ies_file_of_a_quadrant():
    with folder() as path:
        name = os.path.join(path, "profile.ies")
        with open(name, "w") as file:
            file.write(_ies(horizontal=[0, 20, 45, 90]))

        def make(node):
            node.mode, node.filepath = "EXTERNAL", name

        assert_agrees(_ies_scene(make), samples=16)


def test_ies_of_one_plane():
    assert_agrees(_ies_scene(_set_text(_ies(horizontal=[0]))), samples=16)


def test_ies_to_the_side_alone():
    """Nothing above 90°."""
    assert_agrees(_ies_scene(_set_text(_ies(vertical=[0, 10, 25, 40, 55, 70, 80, 90]))), samples=16)


def test_ies_of_types_a_and_b():
    if not IS_4_0:
        return  # not read, or read otherwise
    for kind, horizontal in ((2, [-90, -40, 0, 30, 90]), (3, [0, 20, 60, 90])):
        text = _ies(vertical=[-90, -50, -20, 0, 30, 60, 90], horizontal=horizontal, kind=kind)
        assert_agrees(_ies_scene(_set_text(text)), samples=64)


def test_ies_by_a_vector():
    def make(node):
        _set_text(_ies())(node)
        tree = node.id_data
        geometry = tree.nodes.new("ShaderNodeNewGeometry")
        tree.links.new(geometry.outputs["Incoming"], node.inputs["Vector"])

    assert_agrees(_ies_scene(make), samples=16)


def test_missing_ies_file():
    def make(node):
        node.mode, node.filepath = "EXTERNAL", "/nowhere/profile.ies"

    assert_warns(_ies_scene(make), "IES Texture", "without a file")


def test_ies_files_that_cycles_does_not_read():
    """It takes 100 for them; the program reads them, and the difference is told."""
    texts = {"CR alone": _ies().replace("\n", "\r"), "begins with TILT": _ies().partition("none\n")[2]}
    if not IS_4_0:
        texts["of type A"] = _ies(vertical=[-90, 0, 90], horizontal=[0, 90], kind=3)
    for what, text in texts.items():
        with folder() as path:
            name = os.path.join(path, "profile.ies")
            with open(name, "w", newline="") as file:
                file.write(text)

            def make(node):
                node.mode, node.filepath = "EXTERNAL", name

            assert_warns(_ies_scene(make), "IES Texture", what)


def test_spread_of_areas():
    for shape, spread in (("RECTANGLE", 100), ("DISK", 60)):
        scene = _stage(lambda: _add_area(shape=shape, spread=math.radians(spread)))
        assert_agrees(scene, samples=256)


def test_narrow_spreads():
    """Beams: where they shine is sampled, and Cycles' rounding is met. Of disks Cycles samples all, and tells nothing for noise."""
    for shape, spread in (("RECTANGLE", 1), ("RECTANGLE", 4)):
        scene = _stage(lambda: _add_area(shape=shape, spread=math.radians(spread)))
        assert_agrees(scene, samples=256)
