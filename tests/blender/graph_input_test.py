"""Input nodes give what Cycles gives, on objects that are turned, scaled unevenly, mirrored and instanced.

An output is emitted by everything in the picture, plus a number that leaves nothing negative. Both engines look at the
middle of each pixel, all but, so that they see the same points; what is left is the width of the filter, and pixels at edges.
"""

import math
import os

import bpy
import numpy as np
from graph_test import _assert_nodes_agree, _node
from scenes import (
    IS_5_0,
    add_camera,
    add_light,
    add_plane,
    assert_agrees,
    assert_warns,
    diffuse,
    folder,
    link,
    make_sharp,
    new_material,
    new_scene,
    render,
    set_bounces,
    set_world,
)

_OFFSET = 8.0


def _scene(width=96, height=72):
    """Objects of one material, seen by a camera that is turned and shifted; returns (scene, material, objects)."""
    scene = new_scene(width, height)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 1 / 64
    scene.relief.filter_width = 1 / 64
    material = bpy.data.materials.new("inputs")
    material.use_nodes, material.pass_index = True, 7
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, location=(-1.6, 0.3, 0.2))
    sphere = bpy.context.object
    bpy.ops.object.shade_smooth()
    sphere.rotation_euler, sphere.scale = (0.5, 0.3, 0.9), (1.2, 0.7, 0.9)
    bpy.ops.mesh.primitive_cube_add(size=1.4, location=(1.5, 0.4, 0.1))
    cube = bpy.context.object
    cube.rotation_euler, cube.scale = (0.3, 0.8, 0.2), (1.1, 0.8, 1.3)
    bpy.ops.mesh.primitive_monkey_add(size=1.8, location=(0.2, -1.3, 0.4))
    monkey = bpy.context.object
    monkey.rotation_euler, monkey.scale = (-0.7, 0.2, 0.4), (-1.0, 0.8, 1.0)
    # Faces that are shaded flat but are not flat have one normal here, and as many as triangles there.
    monkey.modifiers.new("triangles", "TRIANGULATE")
    objects = [sphere, cube, monkey]
    # Cones that a collection shows twice; evenly scaled, as Cycles interpolates the normals of instances before their
    # transform, of others after it.
    bpy.ops.mesh.primitive_cone_add(vertices=12, radius1=0.6, depth=1.2)
    cone = bpy.context.object
    bpy.ops.object.shade_smooth()
    group = bpy.data.collections.new("group")
    for owner in list(cone.users_collection):
        owner.objects.unlink(cone)
    group.objects.link(cone)
    for number, place in enumerate([(-0.3, 1.6, 0.0), (2.0, 1.9, 0.3)]):
        shown = link(None, f"shown {number}")
        shown.instance_type, shown.instance_collection = "COLLECTION", group
        shown.location, shown.rotation_euler, shown.scale = place, (0.4, 0.5 * number, 0.3), (0.7 + number,) * 3
        shown.color = (0.3, 0.1, 0.5 + 0.4 * number, 0.6)
    objects.append(cone)
    for number, thing in enumerate(objects):
        thing.data.materials.append(material)
        thing.color, thing.pass_index = (0.2 * number, 0.7, 0.1, 0.3 + 0.1 * number), number + 3
    add_camera((0.6, -5.0, 4.2), (0.85, 0.05, 0.1), lens=40, shift_x=0.05, shift_y=-0.03)
    return scene, material, objects


def _emit(material, build):
    """Makes a material emit the socket that build(tree) gives, plus _OFFSET."""
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    emission = tree.nodes.new("ShaderNodeEmission")
    moved = tree.nodes.new("ShaderNodeVectorMath")
    moved.inputs[1].default_value = (_OFFSET,) * 3
    tree.links.new(build(tree), moved.inputs[0])
    tree.links.new(moved.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


def _output(kind, name, **settings):
    """A builder of one output of a node without inputs."""

    def build(tree):
        node = tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        return node.outputs[name]

    return build


def _assert_agree(scene, material, builders, tolerance=3e-4, most_off=0.02, samples=8):
    """Fails where pictures of outputs differ by more than a tolerance on more than a share of the pixels."""
    wrong = []
    with folder() as path:
        for name, build in builders.items():
            _emit(material, build)
            ours = render(scene, "RELIEF", os.path.join(path, "relief.exr"), samples=samples).reshape(-1, 3)
            theirs = render(scene, "CYCLES", os.path.join(path, "cycles.exr"), samples=samples).reshape(-1, 3)
            error = np.abs(ours - theirs).max(axis=1) / np.maximum(1, np.abs(theirs - _OFFSET).max(axis=1))
            off, seen = (error > tolerance).mean(), theirs.max(axis=1) > 0
            values = theirs[seen] - _OFFSET
            text = f"{name}: {off:.2%} beyond {tolerance}, median {np.median(error[seen]):.2g}"
            print(text, "range", values.min(axis=0).round(3), values.max(axis=0).round(3))
            if off > most_off:
                worst = int(np.where(seen, error, 0).argmax())
                wrong.append(f"{text}, worst {ours[worst] - _OFFSET} for {theirs[worst] - _OFFSET}")
    assert not wrong, "\n".join(wrong)


def test_texture_coordinates():
    scene, material, objects = _scene()
    names = ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
    builders = {name: _output("ShaderNodeTexCoord", name) for name in names}
    other = link(None, "other")
    other.location, other.rotation_euler, other.scale = (0.3, 0.2, 0.5), (0.5, 0.1, 0.7), (1.5, 0.6, 0.8)
    builders["of another"] = _output("ShaderNodeTexCoord", "Object", object=other)
    for name in ("Generated", "UV"):
        builders[f"{name} of the instancer"] = _output("ShaderNodeTexCoord", name, from_instancer=True)
    _assert_agree(scene, material, builders)


def test_instances_on_faces():
    """Generated coordinates and uv of what makes an instance are different at each."""
    scene, material, objects = _scene()
    for thing in objects[:3]:
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=3, size=4)
    grid = bpy.context.object
    grid.data.materials.append(diffuse((0, 0, 0)))
    bpy.ops.mesh.primitive_ico_sphere_add(radius=0.4)
    ball = bpy.context.object
    ball.data.materials.append(material)
    ball.parent, grid.instance_type = grid, "FACES"
    grid["tint"], grid["size"] = (0.2, 0.4, 0.9), 3
    builders = {
        f"{name} of the instancer": _output("ShaderNodeTexCoord", name, from_instancer=True)
        for name in ("Generated", "UV")
    }
    builders["uv map"] = _output("ShaderNodeUVMap", "UV", from_instancer=True)
    builders["random"] = _output("ShaderNodeObjectInfo", "Random")
    for name in ("tint", "size", "location"):
        settings = {"attribute_type": "INSTANCER", "attribute_name": name}
        builders[f"attribute {name}"] = _output("ShaderNodeAttribute", "Vector", **settings)
    _assert_agree(scene, material, builders)


def test_geometry():
    scene, material, objects = _scene()
    names = ("Position", "Normal", "Tangent", "True Normal", "Incoming", "Backfacing")
    _assert_agree(scene, material, {name: _output("ShaderNodeNewGeometry", name) for name in names})
    # From 0 to 1 over triangles of a few pixels: a 64th of one is a lot.
    _assert_agree(scene, material, {"Parametric": _output("ShaderNodeNewGeometry", "Parametric")}, tolerance=5e-3)


def test_pointiness_and_islands():
    scene, material, objects = _scene()
    names = ("Pointiness", "Random Per Island")
    _assert_agree(scene, material, {name: _output("ShaderNodeNewGeometry", name) for name in names})


def test_object_info():
    scene, material, objects = _scene()
    objects[0].name = "Kügelchen"
    names = ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random")
    _assert_agree(scene, material, {name: _output("ShaderNodeObjectInfo", name) for name in names})


def test_particle_info():
    scene, material, objects = _scene()
    bpy.ops.mesh.primitive_plane_add(size=4, location=(0, 0, -0.5))
    emitter = bpy.context.object
    emitter.data.materials.append(diffuse((0, 0, 0)))
    emitter.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 40, 1, 6, 80
    settings.physics_type, settings.normal_factor, settings.lifetime_random = "NEWTON", 1.0, 0.5
    settings.render_type, settings.instance_object = "OBJECT", objects[1]
    settings.particle_size, settings.size_random, settings.angular_velocity_mode = 0.25, 0.5, "VELOCITY"
    for frame in range(1, 9):
        scene.frame_set(frame)
    names = ("Index", "Random", "Age", "Lifetime", "Location", "Size", "Velocity", "Angular Velocity")
    _assert_agree(scene, material, {name: _output("ShaderNodeParticleInfo", name) for name in names})


def test_camera_data():
    scene, material, objects = _scene()
    names = ("View Vector", "View Z Depth", "View Distance")
    _assert_agree(scene, material, {name: _output("ShaderNodeCameraData", name) for name in names})
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 7
    builders = {name: _output("ShaderNodeCameraData", name) for name in names}
    builders["window"] = _output("ShaderNodeTexCoord", "Window")
    _assert_agree(scene, material, builders)


def _attributes(objects):
    """Attributes of all types on all objects but one."""
    random = np.random.default_rng(3)
    for thing in objects[:-1]:
        mesh = thing.data
        for kind, prop, width in (
            ("FLOAT", "value", 1),
            ("INT", "value", 1),
            ("BOOLEAN", "value", 1),
            ("FLOAT2", "vector", 2),
            ("FLOAT_VECTOR", "vector", 3),
            ("FLOAT_COLOR", "color", 4),
            ("BYTE_COLOR", "color", 4),
        ):
            for domain in ("POINT", "CORNER", "FACE"):
                if kind in {"FLOAT_COLOR", "BYTE_COLOR"} and domain == "FACE":
                    continue
                attribute = mesh.attributes.new(f"{kind} {domain}", kind, domain)
                values = random.random((len(attribute.data), width), dtype=np.float32)
                if kind == "INT":
                    values = (9 * values).astype(np.int32)
                if kind == "BOOLEAN":
                    values = values > 0.5
                attribute.data.foreach_set(prop, values.ravel())


def test_attributes():
    scene, material, objects = _scene()
    _attributes(objects)
    builders = {}
    for attribute in objects[0].data.attributes:
        kind, _, domain = attribute.name.rpartition(" ")
        for name in ("Color", "Fac", "Alpha") if domain == "CORNER" else ("Vector",):
            node = _output("ShaderNodeAttribute", name, attribute_name=attribute.name)
            if domain in {"POINT", "CORNER", "FACE"} and kind:
                builders[f"{attribute.name} {name}"] = node
    builders["none"] = _output("ShaderNodeAttribute", "Alpha", attribute_name="nothing")
    # Random values at the corners of triangles of a few pixels, of which a filter has a 64th.
    _assert_agree(scene, material, builders, tolerance=5e-3, samples=4)


def test_colors_and_uv_maps():
    """Several of each in one graph."""
    scene, material, objects = _scene()
    _attributes(objects)
    for thing in objects:
        first = thing.data.uv_layers[0]
        uv = np.empty(2 * len(first.data), dtype=np.float32)
        first.data.foreach_get("uv", uv)
        for number in range(3):
            layer = thing.data.uv_layers.new(name=f"map {number}")
            layer.data.foreach_set("uv", uv * (number + 0.5) + 0.1 * number)

    def several(kind, prop, names, out):
        def build(tree):
            total = None
            for name in names:
                node = tree.nodes.new(kind)
                setattr(node, prop, name)
                if total is None:
                    total = node.outputs[out]
                    continue
                added = tree.nodes.new("ShaderNodeVectorMath")
                added.operation = "CROSS_PRODUCT" if kind == "ShaderNodeVertexColor" else "MULTIPLY_ADD"
                tree.links.new(total, added.inputs[0])
                tree.links.new(node.outputs[out], added.inputs[1])
                total = added.outputs[0]
            return total

        return build

    colors = ("FLOAT_COLOR POINT", "BYTE_COLOR CORNER", "FLOAT_COLOR CORNER")
    builders = {
        "uv maps": several("ShaderNodeUVMap", "uv_map", ("map 0", "map 1", "map 2"), "UV"),
        "colours": several("ShaderNodeVertexColor", "layer_name", colors, "Color"),
        "active colour": several("ShaderNodeVertexColor", "layer_name", ("",), "Color"),
        "alpha": several("ShaderNodeVertexColor", "layer_name", colors[:1], "Alpha"),
        "no alpha": several("ShaderNodeVertexColor", "layer_name", ("nothing",), "Alpha"),
    }
    _assert_agree(scene, material, builders, tolerance=5e-3, samples=4)


def test_properties():
    scene, material, objects = _scene()
    scene["weight"] = 0.7
    for number, thing in enumerate(objects[:3]):
        thing["weight"], thing["tint"] = 0.25 * number, (0.3, 0.1 * number, 0.8)
        thing.data["of its data"] = 3 * number
    builders = {}
    for kind, name in (
        ("OBJECT", "weight"),
        ("OBJECT", "tint"),
        ("OBJECT", "of its data"),
        ("OBJECT", "color"),
        ("OBJECT", "location"),
        ("INSTANCER", "location"),
        ("VIEW_LAYER", "weight"),
    ):
        for out in ("Vector", "Fac", "Alpha"):
            settings = {"attribute_type": kind, "attribute_name": name}
            builders[f"{kind} {name} {out}"] = _output("ShaderNodeAttribute", out, **settings)
    _assert_agree(scene, material, builders, samples=4)


def test_tangents():
    scene, material, objects = _scene()
    builders = {
        f"radial {axis}": _output("ShaderNodeTangent", 0, direction_type="RADIAL", axis=axis) for axis in "XYZ"
    }
    builders["uv"] = _output("ShaderNodeTangent", 0, direction_type="UV_MAP")
    _assert_agree(scene, material, builders)


def test_tangents_without_a_uv_map():
    """They run around the object's origin, before 4.5 where the mesh is at rest; those of a map that is missing are none."""
    scene, material, objects = _scene()
    bend = objects[0].modifiers.new("bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.deform_axis, bend.factor = "STRETCH", "X", 0.6
    # A cone's base is a latitude: there Cycles' tangents are what rounding leaves of them.
    bpy.data.objects.remove(objects.pop())
    for thing in objects:
        while thing.data.uv_layers:
            thing.data.uv_layers.remove(thing.data.uv_layers[0])

    def mapped(tree):
        node = tree.nodes.new("ShaderNodeNormalMap")
        node.inputs["Color"].default_value = (0.7, 0.4, 0.9, 1)
        return node.outputs[0]

    builders = {
        "active": _output("ShaderNodeTangent", 0, direction_type="UV_MAP"),
        "normal map": mapped,
    }
    # Where longitudes begin anew, tangents of its triangles are grouped in another way.
    _assert_agree(scene, material, builders, most_off=0.06)


def test_bumped_normals():
    """Those that look away from the viewer are turned back, up to 3.5; so are those that occlusion and weights take."""
    scene, material, objects = _scene()

    def bump_of(tree, distance):
        point, wave, bump = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexCoord", "TexWave", "Bump"))
        wave.inputs["Scale"].default_value = 0.4
        bump.inputs["Distance"].default_value = distance
        tree.links.new(point.outputs["Object"], wave.inputs["Vector"])
        tree.links.new(wave.outputs["Fac"], bump.inputs["Height"])
        return bump.outputs["Normal"]

    def bump_of_nothing(kind, out):
        """Of heights that a bump asks for at one point alone."""

        def build(tree):
            node, bump = tree.nodes.new(kind), tree.nodes.new("ShaderNodeBump")
            tree.links.new(node.outputs[out], bump.inputs["Height"])
            return bump.outputs["Normal"]

        return build

    def build_of(kind, out, distance, blend=None):
        def build(tree):
            normal = bump_of(tree, distance)
            if kind is None:
                return normal
            node = tree.nodes.new(kind)
            if blend is not None:
                node.inputs["Blend"].default_value = blend
            tree.links.new(normal, node.inputs["Normal"])
            return node.outputs[out]

        return build

    builders = {f"normal {distance}": build_of(None, 0, distance) for distance in (0.3, 2.0, -2.0)}
    builders["occlusion"] = bump_of_nothing("ShaderNodeAmbientOcclusion", "AO")
    builders["depth"] = bump_of_nothing("ShaderNodeCameraData", "View Z Depth")
    builders["distance"] = bump_of_nothing("ShaderNodeCameraData", "View Distance")
    for blend in (0.0, 0.3, 1.0):
        for out in ("Fresnel", "Facing"):
            builders[f"{out} {blend}"] = build_of("ShaderNodeLayerWeight", out, 1.0, blend)
    # Before normals were turned back, 19 to 33 % of the pixels were off. What is left is where waves are a few pixels long.
    _assert_agree(scene, material, builders, tolerance=3e-3, most_off=0.08)


def _from_position(tree):
    """A vector that varies."""
    return tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]


def test_vector_transforms():
    scene, material, objects = _scene()

    def transform(kind, first, second):
        def build(tree):
            node = tree.nodes.new("ShaderNodeVectorTransform")
            node.vector_type, node.convert_from, node.convert_to = kind, first, second
            tree.links.new(_from_position(tree), node.inputs[0])
            return node.outputs[0]

        return build

    spaces = ("WORLD", "OBJECT", "CAMERA")
    builders = {
        f"{kind} {first} {second}": transform(kind, first, second)
        for kind in ("POINT", "VECTOR", "NORMAL")
        for first in spaces
        for second in spaces
        if first != second
    }
    _assert_agree(scene, material, builders, samples=4)


def test_vector_rotate():
    builders = {}
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        for invert in (False, True):
            inputs = {"Vector": "xyz", "Center": (0.3, -0.2, 0.5)}
            if kind == "AXIS_ANGLE":
                inputs["Axis"] = (0.4, -0.7, 0.9)
            if kind == "EULER_XYZ":
                inputs["Rotation"] = (0.4, -0.7, 1.1)
            else:
                inputs["Angle"] = "w"
            builders[f"{kind} {invert}"] = _node("ShaderNodeVectorRotate", inputs, rotation_type=kind, invert=invert)
    builders["no axis"] = _node("ShaderNodeVectorRotate", {"Vector": "xyz", "Axis": (0, 0, 0), "Angle": "w"})

    def normal(out):
        def build(tree, xyz, w):
            node = tree.nodes.new("ShaderNodeNormal")
            node.outputs["Normal"].default_value = (0.3, -0.5, 0.7)
            tree.links.new(xyz, node.inputs[0])
            return node.outputs[out]

        return build

    builders["normal"], builders["dot"] = normal("Normal"), normal("Dot")
    _assert_nodes_agree(builders, absolute=3e-6)


def test_normal_maps():
    scene, material, objects = _scene()

    def build_of(space, strength):
        def build(tree):
            node = tree.nodes.new("ShaderNodeNormalMap")
            node.space = space
            node.inputs["Strength"].default_value = strength
            point = tree.nodes.new("ShaderNodeTexCoord")
            tree.links.new(point.outputs["Generated"], node.inputs["Color"])
            return node.outputs[0]

        return build

    builders = {
        f"{space} {strength}": build_of(space, strength)
        for space in ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD")
        for strength in (1.0, 0.6)
    }
    # Between the monkey's lips, tangents of triangles whose uv are folded are grouped in another way.
    _assert_agree(scene, material, builders, most_off=0.03)


def test_linked_normals():
    scene, material, objects = _scene()

    def build_of(kind, out):
        def build(tree):
            bent = tree.nodes.new("ShaderNodeNormalMap")
            bent.space = "OBJECT"
            tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], bent.inputs["Color"])
            node = tree.nodes.new(kind)
            tree.links.new(bent.outputs[0], node.inputs["Normal"])
            return node.outputs[out]

        return build

    builders = {
        "fresnel": build_of("ShaderNodeFresnel", "Fac"),
        "layer fresnel": build_of("ShaderNodeLayerWeight", "Fresnel"),
        "facing": build_of("ShaderNodeLayerWeight", "Facing"),
    }
    _assert_agree(scene, material, builders, most_off=0.03)


def test_wires():
    scene, material, objects = _scene()

    def wire(tree):
        node = tree.nodes.new("ShaderNodeWireframe")
        node.inputs[0].default_value = 0.1
        return node.outputs[0]

    def wire_of_pixels(tree):
        socket = wire(tree)
        socket.node.use_pixel_size = True
        socket.node.inputs[0].default_value = 3.0
        return socket

    _assert_agree(scene, material, {"wires": wire, "of pixels": wire_of_pixels}, most_off=0.03)


def _occluded_scene(**settings):
    """Things on a floor that emit how much is open over them."""
    scene, material, objects = _scene(64, 48)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=9, location=(0, 0, -0.5))
    bpy.context.object.data.materials.append(material)
    tree = material.node_tree
    tree.nodes.clear()
    occlusion, emission, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("AmbientOcclusion", "Emission", "OutputMaterial")
    )
    occlusion.inputs["Color"].default_value = (0.9, 0.6, 0.2, 1)
    for key, value in settings.items():
        setattr(occlusion, key, value)
    tree.links.new(occlusion.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    set_bounces(scene, 0)
    return scene, occlusion


def test_ambient_occlusion():
    scene, node = _occluded_scene()
    node.inputs["Distance"].default_value = 1.2
    assert_agrees(scene, samples=16)


def test_ambient_occlusion_as_far_as_the_world_says():
    """A distance of 0 is none: files of before 2.80, whose nodes had none to set, are read so."""
    scene, node = _occluded_scene()
    node.inputs["Distance"].default_value = 0.0
    assert_agrees(scene, samples=16)
    scene.world = bpy.data.worlds.new("World")
    scene.world.light_settings.distance = 1.2
    assert_agrees(scene, samples=16)


def test_ambient_occlusion_of_one_object_inside():
    scene, node = _occluded_scene(only_local=True, inside=True, samples=5)
    node.inputs["Distance"].default_value = 0.8
    assert_agrees(scene, samples=16)


def test_ambient_occlusion_through_a_ramp():
    """The factor, of a distance that varies, sharpened: the noise of its rays is in the mean."""
    scene, node = _occluded_scene()
    tree = node.id_data
    noise, power = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeMath")
    tree.links.new(noise.outputs["Fac"], node.inputs["Distance"])
    power.operation = "POWER"
    power.inputs[1].default_value = 3.0
    tree.links.new(node.outputs["AO"], power.inputs[0])
    tree.links.new(power.outputs[0], tree.nodes["Emission"].inputs["Strength"])
    assert_agrees(scene, samples=16)


def _beveled_scene(samples, radius=0.3):
    """Things that emit their normal with rounded edges; two of them are one object of two materials."""
    scene, material, objects = _scene(64, 48)
    tree = material.node_tree
    tree.nodes.clear()
    bevel, shifted, emission, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Bevel", "VectorMath", "Emission", "OutputMaterial")
    )
    bevel.samples, bevel.inputs["Radius"].default_value = samples, radius
    shifted.operation = "ADD"
    shifted.inputs[1].default_value = (1.5, 1.5, 1.5)
    tree.links.new(bevel.outputs["Normal"], shifted.inputs[0])
    tree.links.new(shifted.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    bpy.ops.mesh.primitive_cube_add(size=1.4, location=(0.3, -1.2, 0.4), rotation=(0.3, 0.2, 0.5))
    cube = bpy.context.object
    cube.scale = (-1, 0.7, 1.2)
    for each in (material, material.copy()):
        cube.data.materials.append(each)
    for number, polygon in enumerate(cube.data.polygons):
        polygon.material_index = number % 2
    set_bounces(scene, 0)
    return scene, bevel


def test_bevel():
    scene, _ = _beveled_scene(8)
    assert_agrees(scene, samples=16)


def test_bevel_of_few_rays_over_a_bump():
    """A normal that is given is turned as the surface's own is; sums of few rays are normalized."""
    scene, bevel = _beveled_scene(2)
    tree = bevel.id_data
    bump, noise = tree.nodes.new("ShaderNodeBump"), tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 2
    tree.links.new(noise.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], bevel.inputs["Normal"])
    assert_agrees(scene, samples=16)


def test_bevel_of_metal():
    """Mirror-like things that mirror each other: paths that have left a wide lobe see edges as they are."""
    scene, _ = _beveled_scene(8)
    for each in {slot.material for thing in bpy.data.objects for slot in thing.material_slots}:
        nodes = each.node_tree.nodes
        if "Bevel" not in nodes:
            continue
        glossy = nodes.get("Glossy BSDF") or nodes.new("ShaderNodeBsdfGlossy")
        glossy.inputs["Roughness"].default_value = 0.3
        each.node_tree.links.new(nodes["Bevel"].outputs[0], glossy.inputs["Normal"])
        each.node_tree.links.new(glossy.outputs[0], nodes["Material Output"].inputs["Surface"])
    bpy.ops.mesh.primitive_plane_add(size=9, location=(0, 0, -0.5))
    bpy.context.object.data.materials.append(diffuse())
    set_world((0.6, 0.7, 1.0))
    set_bounces(scene, 3)
    assert_agrees(scene, samples=16)


def test_what_is_there_of_hair_and_points():
    scene, material, objects = _scene()
    builders = {
        name: _output("ShaderNodeHairInfo", name)
        for name in ("Is Strand", "Intercept", "Length", "Thickness", "Tangent Normal", "Random")
    }
    builders.update({f"point {n}": _output("ShaderNodePointInfo", n) for n in ("Position", "Radius", "Random")})
    _assert_agree(scene, material, builders, samples=4)


_LIGHT_PATH = (
    "Is Camera Ray",
    "Is Shadow Ray",
    "Is Diffuse Ray",
    "Is Glossy Ray",
    "Is Singular Ray",
    "Is Reflection Ray",
    "Is Transmission Ray",
    "Ray Length",
    "Ray Depth",
    "Diffuse Depth",
    "Glossy Depth",
    "Transparent Depth",
    "Transmission Depth",
)


def _with_mirror_and_glass():
    scene, material, objects = _scene()
    set_bounces(scene, 4)
    mirror, _, gloss = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1))
    make_sharp(gloss)
    add_plane(3, mirror, (-1.2, 2.5, 0.5)).rotation_euler = (1.2, 0.3, 0.2)
    pane, tree, clear = new_material("pane", "ShaderNodeBsdfTransparent")
    add_plane(1.2, pane, (0.6, -2.6, 1.2)).rotation_euler = (0.9, 0, 0.2)
    return scene, material


def test_light_path_of_camera_rays_and_mirrors():
    scene, material = _with_mirror_and_glass()
    builders = {name: _output("ShaderNodeLightPath", name) for name in _LIGHT_PATH}
    for name in ("Quadratic", "Linear", "Constant"):

        def falloff(tree, name=name):
            node = tree.nodes.new("ShaderNodeLightFalloff")
            node.inputs["Strength"].default_value, node.inputs["Smooth"].default_value = 0.1, 2.0
            return node.outputs[name]

        builders[f"falloff {name}"] = falloff
    _assert_agree(scene, material, builders, most_off=0.03)


def _transparent_by(name, factor=1.0, has_lamp=True):
    """A floor under a plate that is transparent by an output of Light Path times a factor, under a lamp and an even world or that alone."""
    scene = new_scene(48, 36)
    set_bounces(scene, 3)
    plate, tree, surface = new_material("plate", Color=(0.7, 0.3, 0.2, 1))
    path, scaled = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMath")
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    scaled.operation, scaled.inputs[1].default_value = "MULTIPLY", factor
    tree.links.new(path.outputs[name], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], mix.inputs[0])
    tree.links.new(surface.outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    add_plane(8, diffuse((0.6, 0.6, 0.6)))
    add_plane(1.5, plate, (0.3, 0.2, 1.2))
    add_plane(1.0, plate, (0.5, 0.3, 1.6))
    if has_lamp:
        add_light("AREA", (0.5, 0.4, 4), energy=300, size=0.5)
    set_world((0.2, 0.3, 0.4))
    add_camera((0, -5, 5), (math.radians(45), 0, 0))
    return scene


def test_shadow_rays_under_an_even_world():
    """Cycles does not ask an even world for light: its paths meet the plate."""
    assert_agrees(_transparent_by("Is Shadow Ray", has_lamp=False), runs=4, samples=64)


def test_shadow_rays():
    """What only shadow rays do not see casts no shadow."""
    assert_agrees(_transparent_by("Is Shadow Ray", 0.8), runs=4, samples=16)


def test_lengths_and_depths_of_shadow_rays():
    assert_agrees(_transparent_by("Ray Length", 0.1), runs=4, samples=16)
    assert_agrees(_transparent_by("Ray Depth", 0.3), runs=4, samples=16)


def test_depths_of_diffuse_rays():
    assert_agrees(_transparent_by("Diffuse Depth", 0.5), runs=4, samples=16)
    assert_agrees(_transparent_by("Is Diffuse Ray", 0.8), runs=4, samples=16)


def _lit_by_kinds_of_rays(kind, **inputs):
    """A sheet between two plates that emit by what kind of ray sees them, the upper one behind the camera."""
    scene = new_scene(24, 18)
    set_bounces(scene, 2)
    plate, tree, emission = new_material("plate", "ShaderNodeEmission")
    path, total = tree.nodes.new("ShaderNodeLightPath"), None
    kinds = ("Is Diffuse Ray", "Is Transmission Ray", "Is Reflection Ray", "Is Glossy Ray", "Is Singular Ray")
    for i, name in enumerate(kinds):
        # Sums of powers of two are told apart.
        node = tree.nodes.new("ShaderNodeMath")
        node.operation, node.inputs[1].default_value = "MULTIPLY_ADD", 2.0**-i
        tree.links.new(path.outputs[name], node.inputs[0])
        if total is None:
            node.inputs[2].default_value = 0.1
        else:
            tree.links.new(total, node.inputs[2])
        total = node.outputs[0]
    tree.links.new(total, emission.inputs["Strength"])
    add_plane(8, new_material("sheet", kind, **inputs)[0])
    for height in (-1, 4):
        add_plane(60, plate, (0, 0, height))
    set_world((0, 0, 0))
    add_camera((0, -1.5, 1.5), (math.radians(45), 0, 0))
    return scene


def test_rays_are_told_what_lobe_they_left():
    """Behind translucent sheets they were no diffuse rays, so that panes for diffuse rays let the sun in twice."""
    through = [("ShaderNodeBsdfTranslucent", {}), ("ShaderNodeBsdfRefraction", {"Roughness": 0.3})]
    reflected = [
        ("ShaderNodeBsdfDiffuse", {}),
        ("ShaderNodeBsdfGlossy", {"Roughness": 0.3}),
        ("ShaderNodeBsdfVelvet" if hasattr(bpy.types, "ShaderNodeBsdfVelvet") else "ShaderNodeBsdfSheen", {}),
    ]
    # The upper plate is asked for light too, which is told of no kind of ray: how bright that makes it depends on how Cycles
    # weighs both, and does so since 5.0 by other densities.
    for kind, inputs in through if IS_5_0 else through + reflected:
        assert_agrees(_lit_by_kinds_of_rays(kind, **inputs), runs=4, samples=16)
