"""Volume objects are Cycles': grids of OpenVDB from files and of geometry nodes, by any transform and by the names of attributes."""

import os

import bpy

from scenes import (
    add_camera,
    add_group_socket,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_grids_agree,
    assert_warns,
    degrees,
    diffuse,
    folder,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _scene(bounces=0):
    scene = new_scene(48, 32)
    set_bounces(scene, bounces)
    scene.cycles.volume_bounces = scene.relief.volume_bounces = bounces
    scene.cycles.volume_step_rate = 0.2
    add_camera((0, -7, 1.6), degrees(82, 0, 0), lens=35)
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=3.0)
    set_world((0.15, 0.15, 0.2))
    return scene


def _volume(kind="ShaderNodeVolumePrincipled", **inputs):
    """(material of one volume shader, its tree, that shader)"""
    material, tree, node = new_material("volume", kind, **inputs)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.remove(output.inputs["Surface"].links[0])
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    return material, tree, node


def _cloud(material=None, resolution=24):
    """An object whose geometry nodes make a grid "density" of noise, in a box from -1.3 to 1.3."""
    tree = bpy.data.node_groups.new("geometry", "GeometryNodeTree")
    add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
    cube, noise, level = (tree.nodes.new(kind) for kind in ("GeometryNodeVolumeCube", "ShaderNodeTexNoise", "ShaderNodeMath"))
    noise.inputs["Scale"].default_value = 1.5
    level.operation = "MULTIPLY_ADD"
    level.inputs[1].default_value, level.inputs[2].default_value = 12.0, -5.0
    tree.links.new(noise.outputs[0], level.inputs[0])
    tree.links.new(level.outputs[0], cube.inputs["Density"])
    for name, value in {"Min": (-1.3, -1.3, -1.3), "Max": (1.3, 1.3, 1.3)}.items():
        cube.inputs[name].default_value = value
    for axis in "XYZ":
        cube.inputs[f"Resolution {axis}"].default_value = resolution
    last = cube
    if material is not None:
        last = tree.nodes.new("GeometryNodeSetMaterial")
        last.inputs["Material"].default_value = material
        tree.links.new(cube.outputs[0], last.inputs[0])
    tree.links.new(last.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    cloud = add_sphere(0.5, location=(0, 0, 1.4))
    cloud.modifiers.new("geometry", "NODES").node_group = tree
    return cloud


def _save(path):
    """Writes the grids of the only volume that is shown to a file."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shown = next(i.object.data for i in depsgraph.object_instances if i.object.type == "VOLUME")
    shown.grids.save(filepath=path)


def _of_file(path, material, location=(0, 0, 1.4)):
    volume = bpy.data.volumes.new("cloud")
    volume.filepath = path
    if material is not None:
        volume.materials.append(material)
    shown = bpy.data.objects.new("cloud", volume)
    shown.location = location
    bpy.context.scene.collection.objects.link(shown)
    return shown


def _saved(path):
    """Saves the cloud of nodes as a file, and takes it away."""
    cloud = _cloud()
    _save(path)
    bpy.data.objects.remove(cloud)


def _assert_agrees(scene, samples):
    shown = [item for item in scene.objects if item.type == "VOLUME" or item.modifiers.get("geometry") is not None]
    assert_grids_agree(scene, shown, samples)


def test_geometry_nodes_make_a_volume():
    scene = _scene()
    _cloud(_volume(Color=(0.9, 0.7, 0.5, 1), Density=1.5, Anisotropy=0.3)[0])
    _assert_agrees(scene, 24)


def test_a_file_under_a_transform():
    """Scattered more than once, in front of a ball within it."""
    with folder() as path:
        scene = _scene(2)
        _saved(f"{path}/cloud.vdb")
        cloud = _of_file(f"{path}/cloud.vdb", _volume(Color=(0.8, 0.85, 0.9, 1), Density=2.0)[0])
        cloud.rotation_euler, cloud.scale = degrees(10, 20, 30), (0.9, 1.2, 0.7)
        add_sphere(0.4, diffuse((0.7, 0.2, 0.2)), (0.3, 0.2, 1.4))
        _assert_agrees(scene, 24)


def test_attributes_by_name():
    """What shines by Attribute and by Volume Info."""
    with folder() as path:
        scene = _scene()
        _saved(f"{path}/cloud.vdb")
        material, tree, shader = _volume(Density=0.5, Color=(0.9, 0.6, 0.3, 1))
        attribute, info, weak = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "VolumeInfo", "Math"))
        attribute.attribute_name = "density"
        weak.operation = "MULTIPLY"
        weak.inputs[1].default_value = 0.05
        tree.links.new(attribute.outputs["Color"], shader.inputs["Emission Color"])
        tree.links.new(info.outputs["Density"], weak.inputs[0])
        tree.links.new(weak.outputs[0], shader.inputs["Emission Strength"])
        _of_file(f"{path}/cloud.vdb", material)
        _assert_agrees(scene, 16)


def test_without_a_material():
    with folder() as path:
        scene = _scene()
        _saved(f"{path}/cloud.vdb")
        _of_file(f"{path}/cloud.vdb", None)
        _assert_agrees(scene, 24)


def test_what_does_not_fill_it_is_not_there():
    with folder() as path:
        scene = _scene()
        _saved(f"{path}/cloud.vdb")
        _of_file(f"{path}/cloud.vdb", diffuse((1, 0, 0)))
        assert_agrees(scene, samples=16)


def test_the_file_of_each_frame():
    """Of a sequence; where there is none for the frame nothing is there, and that is said."""
    with folder() as path:
        scene = _scene()
        cloud = _cloud()
        for number, scale in ((1, 1.5), (2, 3.0)):
            cloud.modifiers[0].node_group.nodes["Noise Texture"].inputs["Scale"].default_value = scale
            bpy.context.view_layer.update()
            _save(f"{path}/cloud_{number}.vdb")
        bpy.data.objects.remove(cloud)
        shown = _of_file(f"{path}/cloud_1.vdb", _volume(Density=1.5)[0])
        shown.data.is_sequence, shown.data.frame_duration = True, 3
        scene.frame_set(2)
        _assert_agrees(scene, 16)
        scene.frame_set(3)
        assert_warns(scene, 'object "cloud"', "cloud_", "left out")


def test_a_file_that_is_missing_is_told():
    scene = _scene()
    _of_file(os.path.join(os.sep, "nowhere", "cloud.vdb"), _volume()[0])
    assert_warns(scene, 'object "cloud"', "cloud.vdb", "left out")
