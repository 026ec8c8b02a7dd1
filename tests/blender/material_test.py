"""Materials: each shader that both engines mean exactly agrees with Cycles; what is only near is told, or bounded."""

import bpy

from scenes import (
    IS_5_0,
    add_camera,
    add_group_socket,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    make_sharp,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _stage(material, bounces=4):
    """A ball of the material on a floor, below a sky and an area light, in the scene that run_test.py has made."""
    scene = bpy.context.scene
    set_bounces(scene, bounces)
    set_world((0.4, 0.5, 0.7))
    add_plane(8, diffuse((0.6, 0.4, 0.3)))
    add_sphere(1.0, material, (0, 0, 1), segments=64)
    add_light("AREA", (2, -2, 4), degrees(30, 25, 0), energy=150, size=1.5)
    add_camera((0, -5, 3), degrees(67, 0, 0), lens=45)
    return scene


def _mixed(kind, first, second, factor=None, factor_node=None):
    """A material of two shader nodes.

    @param  first, second  (kind, inputs) of the shaders
    """
    material, tree, node = new_material("mixed", kind)
    offset = 1 if kind == "ShaderNodeMixShader" else 0
    for i, (shader, inputs) in enumerate((first, second)):
        made = tree.nodes.new(shader)
        for name, value in inputs.items():
            made.inputs[name].default_value = value
        tree.links.new(made.outputs[0], node.inputs[i + offset])
    if factor is not None:
        node.inputs[0].default_value = factor
    if factor_node is not None:
        made = tree.nodes.new(factor_node)
        tree.links.new(made.outputs[0], node.inputs[0])
    return material


_RED = ("ShaderNodeBsdfDiffuse", {"Color": (0.8, 0.2, 0.1, 1), "Roughness": 0.0})
_BLUE = ("ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.2, 0.8, 1), "Roughness": 0.0})
_CLEAR = ("ShaderNodeBsdfTransparent", {})
_GLOW = ("ShaderNodeEmission", {"Color": (0.2, 1, 0.3, 1), "Strength": 1.5})


def test_diffuse():
    assert_agrees(_stage(diffuse((0.2, 0.7, 0.4))), samples=16)


def test_principled_without_specular():
    values = {"Base_Color": (0.2, 0.7, 0.4, 1), "Specular": 0.0}
    material, _, node = new_material("principled", "ShaderNodeBsdfPrincipled", **values)
    node.inputs["Roughness"].default_value = 0.5
    assert_agrees(_stage(material), samples=16)


def test_principled_metal():
    material = new_material(
        "metal", "ShaderNodeBsdfPrincipled", Base_Color=(0.9, 0.6, 0.2, 1), Metallic=1.0, Roughness=0.2
    )[0]
    assert_agrees(_stage(material), samples=16)


def test_principled_plastic():
    material = new_material("plastic", "ShaderNodeBsdfPrincipled", Base_Color=(0.5, 0.1, 0.1, 1), Roughness=0.3)[0]
    assert_agrees(_stage(material), samples=16)


def test_mirror():
    material, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1))
    make_sharp(node)
    # glTF's metals reflect all light at grazing angles, Cycles' glossy node its colour at all of them.
    assert_agrees(_stage(material), samples=16)


def test_white_mirror_long():
    material, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1))
    make_sharp(node)
    assert_agrees(_stage(material), samples=64)


def test_smooth_glass():
    material, _, node = new_material("glass", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), IOR=1.5)
    make_sharp(node)
    scene = _stage(material, 8)
    # Caustics of the lamp would never settle; the sky's do.
    bpy.data.objects.remove(next(o for o in scene.objects if o.type == "LIGHT"))
    assert_agrees(scene, samples=16)


def test_absorbing_glass():
    material, tree, node = new_material("glass", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), IOR=1.3)
    make_sharp(node)
    volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
    volume.inputs["Color"].default_value = (0.2, 0.6, 0.9, 1)
    volume.inputs["Density"].default_value = 0.7
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    scene = _stage(material, 8)
    bpy.data.objects.remove(next(o for o in scene.objects if o.type == "LIGHT"))
    assert_agrees(scene, samples=16)


def _absorbing_ball(radius, location=(0, 0, 0), color=(0.2, 0.6, 0.9, 1)):
    """A ball of the index of air, which absorbs."""
    material, tree, node = new_material("absorbing", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), IOR=1.0001)
    make_sharp(node)
    volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
    volume.inputs["Color"].default_value = color
    volume.inputs["Density"].default_value = 0.8
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    return add_sphere(radius, material, location)


def test_a_camera_in_what_absorbs():
    """Light was absorbed only where the path had come in through the surface."""
    for is_orthographic in (False, True):
        scene = new_scene()
        _absorbing_ball(1)
        add_sphere(0.2, None, (0.2, 0.5, 0.1))
        set_world((1, 1, 1))
        add_camera((0, -0.2, 0), (1.4, 0, -0.3), lens=20).data.type = "ORTHO" if is_orthographic else "PERSP"
        scene.camera.data.ortho_scale = 3
        set_bounces(scene, 4)
        assert_agrees(scene, samples=16)


def test_a_lamp_in_what_absorbs():
    scene = new_scene()
    _absorbing_ball(2)
    add_plane(1.5, None, (0, 0, -0.5))
    add_light("AREA", (0.2, 0.1, 0.6), energy=20, size=0.5)
    add_camera((0, -1.2, 0.3), degrees(65, 0, 0), lens=30)
    set_bounces(scene, 4)
    assert_agrees(scene, samples=32)


def test_absorbing_things_in_each_other_add_up():
    """Only the surface counted that light had come through last: behind the inner ball of two the outer one was clear."""
    for location, camera in (((0.2, 0.2, 0), (0, -4, 0.3)), ((0.8, 0, 0), (0, -4, 0.3)), ((0.1, 0.5, 0), (0, 0.4, 0))):
        scene = new_scene()
        _absorbing_ball(1)
        _absorbing_ball(0.5, location, (0.9, 0.4, 0.3, 1))
        add_sphere(0.2, diffuse((0.8, 0.8, 0.8)), (0.3, 0.7, 0.1))
        add_camera(camera, degrees(90, 0, 0), lens=40)
        set_world((1, 1, 1))
        set_bounces(scene, 8)
        assert_agrees(scene, samples=16)


def test_emission_that_takes_light_away():
    """Seen, mirrored, and lit by it: of constants, of a Principled, and a value in a shader's place."""
    scene = new_scene()
    add_plane(6, diffuse((0.8, 0.8, 0.8)))
    dark = new_material("dark", "ShaderNodeEmission", Color=(1, 0.4, 0.1, 1), Strength=-0.5)[0]
    add_plane(1, dark, location=(0, 0, 1.5))
    glow = {"Emission": (0.2, 1, 0.5, 1), "Emission_Strength": -0.3}
    add_sphere(0.5, new_material("principled", "ShaderNodeBsdfPrincipled", **glow)[0], location=(-1.2, 0, 0.5))
    mirror, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1))
    make_sharp(node)
    add_sphere(0.5, mirror, location=(1.2, 0, 0.5))
    value, _, node = new_material("value", "ShaderNodeValue")
    node.outputs[0].default_value = -0.3
    add_sphere(0.3, value, location=(0, -1, 0.3))
    add_camera((0, -5, 2.5), degrees(65, 0, 0), lens=35)
    set_world((1, 1, 1))
    assert_agrees(scene, samples=16)


def test_emission():
    glow = new_material("glow", "ShaderNodeEmission", Color=(1, 0.4, 0.1, 1), Strength=2.5)[0]
    assert_agrees(_stage(glow), samples=16)


def test_transparency():
    assert_agrees(_stage(_mixed("ShaderNodeMixShader", _CLEAR, _RED, 0.4)), samples=16)


def test_transparency_second():
    assert_agrees(_stage(_mixed("ShaderNodeMixShader", _RED, _CLEAR, 0.4)), samples=16)


def test_mix_of_diffuse_shaders():
    assert_agrees(_stage(_mixed("ShaderNodeMixShader", _RED, _BLUE, 0.3)), samples=32)


def test_diffuse_plus_emission():
    assert_agrees(_stage(_mixed("ShaderNodeAddShader", _RED, _GLOW)), samples=16)


def test_node_group():
    """Values pass through a group's inputs; the shader sits inside."""
    group = bpy.data.node_groups.new("paint", "ShaderNodeTree")
    add_group_socket(group, "Paint", "INPUT", "NodeSocketColor")
    add_group_socket(group, "Shader", "OUTPUT", "NodeSocketShader")
    inside, out = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    shader, reroute = group.nodes.new("ShaderNodeBsdfDiffuse"), group.nodes.new("NodeReroute")
    group.links.new(inside.outputs["Paint"], reroute.inputs[0])
    group.links.new(reroute.outputs[0], shader.inputs["Color"])
    group.links.new(shader.outputs[0], out.inputs["Shader"])
    material, tree, _ = new_material("grouped", "ShaderNodeBsdfDiffuse")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Paint"].default_value = (0.1, 0.8, 0.5, 1)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    assert_agrees(_stage(material), samples=16)


def test_material_without_nodes():
    material = bpy.data.materials.new("plain")
    material.diffuse_color = (0.3, 0.6, 0.2, 1)
    # Since 5.0 it has nodes from the start, and they are plastic.
    assert_agrees(_stage(material), samples=32, tolerance=0.02 if IS_5_0 else 0)


def test_shader_that_is_not_understood_is_warned_about():
    material = new_material("realtime", "ShaderNodeEeveeSpecular")[0]
    assert_warns(_stage(material), 'material "realtime"', "Specular BSDF", "diffuse surface of its colour")


def test_unknown_color_node_is_warned_about():
    material, tree, node = new_material("realtime", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.2, 0.1, 1))
    odd = tree.nodes.new("ShaderNodeShaderToRGB")
    tree.links.new(odd.outputs["Color"], node.inputs["Color"])
    assert_warns(_stage(material), 'material "realtime"', "Shader to RGB", "[0.3, 0.2, 0.1] was used")


def test_what_later_principled_surfaces_have_is_warned_about():
    """Thin walls, since 5.2."""
    material, _, node = new_material("later", "ShaderNodeBsdfPrincipled")
    if "Thin Wall" in node.inputs:
        node.inputs["Thin Wall"].default_value = True
        assert_warns(_stage(material), 'material "later"', "a thin wall")


def test_a_volume_behind_an_opaque_surface_is_not_seen():
    material, tree, node = new_material("filled", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.7, 0.4, 1))
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    assert_agrees(_stage(material), samples=16)
