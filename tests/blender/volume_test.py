"""Volumes are Cycles': what absorbs, scatters and shines within meshes and in the whole world, lit, seen through and from within."""

import bpy

from scenes import (
    add_camera,
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


def _scene(bounces=0, volume_bounces=0, width=48, height=32):
    scene = new_scene(width, height)
    set_bounces(scene, bounces)
    scene.cycles.volume_bounces = scene.relief.volume_bounces = volume_bounces
    add_camera((0, -7, 1.6), degrees(82, 0, 0), lens=35)
    return scene


def _volume(kind, surface=None, **inputs):
    """A material of one volume shader.

    @param  surface  type of the node that is its surface; None: it has none
    """
    material, tree, node = new_material("volume", kind, **inputs)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.remove(output.inputs["Surface"].links[0])
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    if surface is not None:
        made = tree.nodes.new(surface)
        tree.links.new(made.outputs[0], output.inputs["Surface"])
        if surface == "ShaderNodeBsdfGlass":
            make_sharp(made)
    return material


def _add_box(size, material, location=(0, 0, 1)):
    bpy.ops.mesh.primitive_cube_add(size=1, location=location)
    box = bpy.context.object
    box.scale = size
    box.data.materials.append(material)
    return box


def test_absorption_without_a_surface():
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(40, 20, 0), energy=3.0)
    set_world((0.4, 0.5, 0.7))
    add_sphere(1.2, _volume("ShaderNodeVolumeAbsorption", Color=(0.9, 0.5, 0.2, 1), Density=1.5), (0, 0, 1.2))
    assert_agrees(scene)


def test_fog_with_a_sun():
    scene = _scene()
    add_plane(20)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (0.5, 0, 1.2))
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.05, 0.07, 0.1))
    _add_box((6, 4, 3), _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.2), (0, 0, 1.4))
    assert_agrees(scene, samples=96)


def test_lamp_in_fog():
    """The light is small and near the camera's rays, which its own distance is the best measure for."""
    scene = _scene()
    add_plane(20)
    add_light("POINT", (0.8, 0, 1.5), energy=60.0, shadow_soft_size=0.05)
    box = _volume("ShaderNodeVolumeScatter", Color=(0.9, 0.8, 0.6, 1), Density=0.3, Anisotropy=0.6)
    _add_box((6, 4, 3), box, (0, 0, 1.4))
    assert_agrees(scene, samples=128)


def test_dense_ball_long():
    scene = _scene(8, 8)
    add_plane(20)
    add_light("AREA", (2, -2, 4), degrees(35, 25, 0), energy=200.0, size=1.5)
    set_world((0.2, 0.25, 0.3))
    ball = _volume("ShaderNodeVolumeScatter", Color=(0.95, 0.9, 0.7, 1), Density=4.0, Anisotropy=-0.3)
    add_sphere(1.2, ball, (0, 0, 1.2))
    assert_agrees(scene, samples=96)


def test_principled_absorbs_scatters_and_shines():
    scene = _scene(2, 2)
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=2.0)
    fire = _volume(
        "ShaderNodeVolumePrincipled",
        Color=(0.4, 0.5, 0.6, 1),
        Density=0.8,
        Anisotropy=0.3,
        Absorption_Color=(0.1, 0.3, 0.2, 1),
        Emission_Strength=0.2,
        Emission_Color=(1, 0.6, 0.3, 1),
        Blackbody_Intensity=0.4,
        Blackbody_Tint=(1, 0.9, 0.8, 1),
        Temperature=1500.0,
    )
    add_sphere(1.2, fire, (0, 0, 1.2))
    assert_agrees(scene, samples=96)


def test_domains_that_overlap():
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.1))
    add_sphere(1.0, _volume("ShaderNodeVolumeScatter", Color=(1, 0.3, 0.2, 1), Density=1.0), (-0.6, 0, 1.2))
    add_sphere(1.0, _volume("ShaderNodeVolumeAbsorption", Color=(0.2, 0.4, 1, 1), Density=1.0), (0.6, 0, 1.2))
    add_sphere(0.4, diffuse((0.2, 0.8, 0.2)), (0, 0.2, 1.2))
    assert_agrees(scene, samples=96)


def test_camera_within():
    scene = _scene(1, 1)
    add_plane(20)
    add_light("POINT", (1.0, 1, 2.0), energy=120.0, shadow_soft_size=0.2)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    box = _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.08)
    _add_box((30, 30, 8), box, (0, 0, 3.9))
    assert_agrees(scene, samples=128)


def test_world():
    scene = _scene(1, 1)
    add_plane(20)
    add_light("POINT", (1.0, 0, 2.0), energy=150.0, shadow_soft_size=0.3)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    tree = set_world((0.3, 0.4, 0.6))
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Color"].default_value = (0.8, 0.85, 0.9, 1)
    scatter.inputs["Density"].default_value = 0.06
    tree.links.new(scatter.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    assert_agrees(scene, samples=128)


def test_mixed_shaders():
    """One that scatters: of several, 3.4 adds the phase functions up without their weights."""
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.1))
    material = _volume("ShaderNodeVolumeScatter", Color=(1, 0.5, 0.2, 1), Density=1.2, Anisotropy=0.4)
    tree = material.node_tree
    scatter = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeVolumeScatter")
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    dark, shine = tree.nodes.new("ShaderNodeVolumeAbsorption"), tree.nodes.new("ShaderNodeEmission")
    dark.inputs["Color"].default_value = (0.2, 0.6, 0.9, 1)
    shine.inputs["Color"].default_value, shine.inputs["Strength"].default_value = (0.2, 0.4, 1, 1), 0.1
    mix, add = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeAddShader")
    mix.inputs[0].default_value = 0.3
    tree.links.new(scatter.outputs[0], mix.inputs[1])
    tree.links.new(dark.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add.inputs[0])
    tree.links.new(shine.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], output.inputs["Volume"])
    add_sphere(1.2, material, (0, 0, 1.2))
    assert_agrees(scene, samples=96)


def test_scattering_in_glass():
    """Lit by the world, as the light of lamps does not get into glass but by caustics."""
    scene = _scene(6, 4)
    scene.relief.caustics = "off"
    add_plane(20)
    set_world((0.5, 0.6, 0.8))
    milk = _volume("ShaderNodeVolumeScatter", "ShaderNodeBsdfGlass", Color=(0.9, 0.85, 0.8, 1), Density=1.5)
    add_sphere(1.2, milk, (0, 0, 1.2))
    assert_agrees(scene, samples=96)


def test_what_varies_is_warned_about():
    scene = _scene()
    material = _volume("ShaderNodeVolumeScatter")
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], tree.nodes["Volume Scatter"].inputs["Density"])
    add_sphere(1.2, material, (0, 0, 1.2))
    set_world((0.5, 0.6, 0.8))
    assert_warns(scene, 'material "volume"', "what varies in a volume", "left out")
