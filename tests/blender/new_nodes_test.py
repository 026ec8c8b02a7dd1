"""Nodes that came with Blender 5.0 and later. Of what repeats, is chosen by a menu or handed around Cycles sees a plain tree."""

import bpy

from scenes import IS_5_0, IS_5_2, add_camera, add_light, add_plane, add_sphere, assert_agrees, degrees, diffuse, new_scene, set_world


def _stage():
    """A scene with a place for a ball; returns it."""
    scene = new_scene(48, 36)
    set_world((0.3, 0.35, 0.4))
    add_plane(8, diffuse((0.6, 0.5, 0.4)), (0, 0, -1))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0.05)
    add_camera((0, -5, 1), degrees(80, 0, 0), lens=45)
    return scene


def _ball():
    """A ball of a new material; returns (material, tree, its Principled BSDF)."""
    material = bpy.data.materials.new("inlined")
    material.use_nodes = True
    add_sphere(1.2, material)
    return material, material.node_tree, material.node_tree.nodes["Principled BSDF"]


def _noise(tree, scale=3.0):
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = scale
    return noise.outputs["Color"]


def _math(tree, operation, first, second=0.5):
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for value, socket in zip((first, second), node.inputs):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node.outputs[0]


def _link_repeated(tree, target):
    """Links a colour to an input that a zone makes three times brighter and redder of noise, by its iteration too."""
    first, last = tree.nodes.new("GeometryNodeRepeatInput"), tree.nodes.new("GeometryNodeRepeatOutput")
    first.pair_with_output(last)
    last.repeat_items.new("RGBA", "color")
    first.inputs["Iterations"].default_value = 3
    tree.links.new(_noise(tree), first.inputs["color"])
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    sockets = {s.identifier: s for s in mix.inputs}
    tree.links.new(first.outputs["color"], sockets["A_Color"])
    sockets["B_Color"].default_value = (0.9, 0.2, 0.05, 1)
    tree.links.new(_math(tree, "MULTIPLY", first.outputs["Iteration"], 0.2), sockets["Factor_Float"])
    tree.links.new(next(s for s in mix.outputs if s.identifier == "Result_Color"), last.inputs["color"])
    tree.links.new(last.outputs["color"], target)


def test_zones_that_repeat():
    if not IS_5_0:
        return
    scene = _stage()
    _, tree, shader = _ball()
    _link_repeated(tree, shader.inputs["Base Color"])
    assert_agrees(scene)


def _group_with_a_menu():
    group = bpy.data.node_groups.new("kinds", "ShaderNodeTree")
    group.interface.new_socket("Kind", in_out="INPUT", socket_type="NodeSocketMenu")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    inside, outside = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    switch = group.nodes.new("GeometryNodeMenuSwitch")
    switch.data_type = "RGBA"
    group.links.new(inside.outputs["Kind"], switch.inputs["Menu"])
    switch.inputs["A"].default_value = (0.9, 0.02, 0.02, 1)
    group.links.new(_noise(group), switch.inputs["B"])
    group.links.new(switch.outputs["Output"], outside.inputs["Color"])
    return group


def test_menus_choose():
    if not IS_5_0:
        return
    for kind in "AB":
        scene = _stage()
        _, tree, shader = _ball()
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = _group_with_a_menu()
        node.inputs["Kind"].default_value = kind
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        assert_agrees(scene)


def test_bundles_and_closures():
    if not IS_5_0:
        return
    scene = _stage()
    _, tree, shader = _ball()
    pack, unpack = tree.nodes.new("NodeCombineBundle"), tree.nodes.new("NodeSeparateBundle")
    for node in (pack, unpack):
        node.bundle_items.new("FLOAT", "rough")
        node.bundle_items.new("RGBA", "color")
    pack.inputs["rough"].default_value = 0.25
    tree.links.new(_noise(tree, 2.0), pack.inputs["color"])
    tree.links.new(pack.outputs[0], unpack.inputs[0])
    first, last = tree.nodes.new("NodeClosureInput"), tree.nodes.new("NodeClosureOutput")
    first.pair_with_output(last)
    last.input_items.new("FLOAT", "x")
    last.output_items.new("FLOAT", "y")
    tree.links.new(_math(tree, "POWER", first.outputs["x"], 0.7), last.inputs["y"])
    call = tree.nodes.new("NodeEvaluateClosure")
    call.input_items.new("FLOAT", "x")
    call.output_items.new("FLOAT", "y")
    tree.links.new(last.outputs[0], call.inputs[0])
    tree.links.new(unpack.outputs["rough"], call.inputs["x"])
    tree.links.new(call.outputs["y"], shader.inputs["Roughness"])
    tree.links.new(unpack.outputs["color"], shader.inputs["Base Color"])
    assert_agrees(scene)


def test_numbers_of_their_own_nodes():
    if not IS_5_0:
        return
    scene = _stage()
    _, tree, shader = _ball()
    vector, number, truth = (tree.nodes.new(f"FunctionNodeInput{kind}") for kind in ("Vector", "Int", "Bool"))
    vector.vector, number.integer, truth.boolean = (0.7, 0.3, 0.1), 1, True
    tree.links.new(vector.outputs[0], shader.inputs["Base Color"])
    tree.links.new(truth.outputs[0], shader.inputs["Metallic"])
    tree.links.new(_math(tree, "MULTIPLY", number.outputs[0], 0.3), shader.inputs["Roughness"])
    assert_agrees(scene)


def test_the_scenes_time():
    if not IS_5_2:
        return
    scene = _stage()
    _, tree, shader = _ball()
    time = tree.nodes.new("GeometryNodeInputSceneTime")
    tree.links.new(_math(tree, "MULTIPLY", time.outputs["Frame"], 0.02), shader.inputs["Base Color"])
    tree.links.new(_math(tree, "MULTIPLY", time.outputs["Seconds"], 0.3), shader.inputs["Roughness"])
    scene.frame_set(36)
    assert_agrees(scene)


def test_worlds_and_lights_have_such_trees():
    if not IS_5_0:
        return
    scene = _stage()
    add_sphere(1.2)
    world = scene.world.node_tree
    _link_repeated(world, world.nodes["Background"].inputs["Color"])
    light = add_light("AREA", (0, -3, 3), degrees(40, 0, 0), energy=60, size=2)
    light.data.use_nodes = True
    tree = light.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    vector = tree.nodes.new("FunctionNodeInputVector")
    vector.vector = (0.9, 0.4, 0.1)
    tree.links.new(vector.outputs[0], emission.inputs["Color"])
    assert_agrees(scene)


def test_what_is_not_understood_keeps_its_name():
    if not IS_5_0:
        return
    scene = _stage()
    material, tree, shader = _ball()
    _link_repeated(tree, shader.inputs["Base Color"])
    node = tree.nodes.new("ShaderNodeRaycast")
    node.name = "2_rays"
    tree.links.new(node.outputs["Hit Distance"], shader.inputs["Roughness"])
    from relief.export.dry_run import try_material

    coverage, warnings = try_material(material, scene.relief)
    assert [name for name, _ in coverage.not_understood] == ["2_rays"], coverage
    assert len(warnings) == 1 and 'node "2_rays"' in warnings[0], warnings


def test_radial_tiling():
    """All outputs, of corners and round, normalized or not."""
    if not IS_5_0:
        return
    for sides, roundness, normalize, output in (
        (5, 0.0, False, "Segment Coordinates"),
        (6, 0.0, True, "Segment Coordinates"),
        (2, 0.0, True, "Segment Coordinates"),
        (3, 1.0, True, "Segment Coordinates"),
        (4, 1.0, False, "Segment Coordinates"),
        (7, 0.0, False, "Segment ID"),
        (5, 0.0, False, "Segment Width"),
        (5, 1.0, False, "Segment Width"),
        (8, 0.0, False, "Segment Rotation"),
    ):
        scene = _stage()
        material, tree, shader = _ball()
        node = tree.nodes.new("ShaderNodeRadialTiling")
        node.normalize = normalize
        node.inputs["Sides"].default_value, node.inputs["Roundness"].default_value = sides, roundness
        shift = tree.nodes.new("ShaderNodeVectorMath")
        shift.operation, shift.inputs[1].default_value = "ADD", (0.1, 0.03, 0.0)
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Object"], shift.inputs[0])
        tree.links.new(shift.outputs[0], node.inputs["Vector"])
        made = node.outputs[output]
        if output == "Segment Coordinates":
            checks = tree.nodes.new("ShaderNodeTexChecker")
            checks.inputs["Scale"].default_value = 3.3
            tree.links.new(made, checks.inputs["Vector"])
            made = checks.outputs["Color"]
        else:
            made = _math(tree, "MULTIPLY", made, 0.1)
        tree.links.new(made, shader.inputs["Base Color"])
        assert_agrees(scene, runs=4, samples=24)
