"""Point clouds of geometry nodes are Cycles': balls with the radius, the material and the attributes of each point."""

import bpy

from scenes import (
    IS_5_0,
    add_camera,
    add_group_socket,
    add_light,
    add_plane,
    add_sphere,
    agreement,
    assert_agrees,
    degrees,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _scene(bounces=1):
    scene = new_scene(48, 32)
    set_bounces(scene, bounces)
    add_camera((0, -7, 1.6), degrees(82, 0, 0), lens=35)
    add_plane(20)
    add_light("AREA", (2, -2, 4), degrees(35, 25, 0), energy=300.0, size=1.5)
    set_world((0.2, 0.25, 0.3))
    return scene


def _cloud(material, scale=(1, 1, 1)):
    """A sphere's vertices as balls whose radius and attribute "tint" vary."""
    tree = bpy.data.node_groups.new("geometry", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        add_group_socket(tree, "Geometry", direction, "NodeSocketGeometry")
    points, noise, radius, store, paint = (
        tree.nodes.new(kind)
        for kind in (
            "GeometryNodeMeshToPoints",
            "ShaderNodeTexNoise",
            "ShaderNodeMath",
            "GeometryNodeStoreNamedAttribute",
            "GeometryNodeSetMaterial",
        )
    )
    radius.operation = "MULTIPLY_ADD"
    radius.inputs[1].default_value, radius.inputs[2].default_value = 0.6, -0.15
    noise.inputs["Scale"].default_value = 2.0
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], points.inputs[0])
    tree.links.new(noise.outputs[0], radius.inputs[0])
    tree.links.new(radius.outputs[0], points.inputs["Radius"])
    store.data_type = "FLOAT_COLOR"
    store.inputs["Name"].default_value = "tint"
    value = next(s for s in store.inputs if s.type == "RGBA" and s.enabled)
    tree.links.new(points.outputs[0], store.inputs[0])
    tree.links.new(noise.outputs["Color"], value)
    paint.inputs["Material"].default_value = material
    tree.links.new(store.outputs[0], paint.inputs[0])
    tree.links.new(paint.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    cloud = add_sphere(1.2, location=(0, 0, 1.4))
    cloud.scale = scale
    cloud.modifiers.new("geometry", "NODES").node_group = tree
    return cloud


def _linked(kind, output, node_kind, **options):
    """A material whose colour is an output of a node."""
    material, tree, shader = new_material("points", kind)
    node = tree.nodes.new(node_kind)
    for name, value in options.items():
        setattr(node, name, value)
    tree.links.new(node.outputs[output], shader.inputs["Color"])
    return material


def test_balls_with_an_attribute():
    scene = _scene()
    _cloud(_linked("ShaderNodeBsdfDiffuse", "Color", "ShaderNodeAttribute", attribute_name="tint"))
    assert_agrees(scene, samples=64)


def test_balls_of_glass():
    """Rays enter them and never leave. Since 5.0 Cycles' do, and its balls are darker: docs/blender.md."""
    scene = _scene(6)
    scene.relief.caustics = "off"
    _cloud(new_material("glass", "ShaderNodeBsdfGlass", Roughness=0.2)[0])
    if IS_5_0:
        _, brighter = agreement(scene, samples=64)
        assert 0.04 < brighter < 0.08, brighter
        return
    assert_agrees(scene, samples=64)


def test_point_info():
    """All three outputs, of a cloud that is turned and scaled."""
    for output in ("Random", "Radius", "Position"):
        scene = _scene(0)
        cloud = _cloud(_linked("ShaderNodeEmission", output, "ShaderNodePointInfo"), scale=(1.3, 1.3, 1.3))
        cloud.rotation_euler = degrees(20, 30, 40)
        assert_agrees(scene, samples=16)


def test_point_info_of_a_mesh_is_nothing():
    scene = _scene(0)
    add_sphere(1.0, _linked("ShaderNodeEmission", "Position", "ShaderNodePointInfo"), (0, 0, 1.2))
    assert_agrees(scene, samples=16)
