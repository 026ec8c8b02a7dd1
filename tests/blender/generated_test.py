"""Generated coordinates are those of a mesh at rest, whatever deforms it, as in Cycles."""

import math

import bpy

from scenes import (
    IS_4_0,
    add_camera,
    add_group_socket,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    dice,
    link,
    new_material,
    new_scene,
    set_world,
)


def _showing():
    """A material that shines in what it has for Generated coordinates, brought to where nothing is negative."""
    material, tree, emission = new_material("generated", "ShaderNodeEmission")
    shift = tree.nodes.new("ShaderNodeVectorMath")
    shift.operation = "MULTIPLY_ADD"
    shift.inputs[1].default_value, shift.inputs[2].default_value = (0.25,) * 3, (1.0,) * 3
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], shift.inputs[0])
    tree.links.new(shift.outputs["Vector"], emission.inputs["Color"])
    return material


def _stage():
    """A picture of 4 × 3 places two metres apart, seen from the front and a little from above."""
    scene = new_scene(96, 72)
    set_world((0, 0, 0))
    add_camera((0, -20, 6), degrees(73.3, 0, 0), type="ORTHO", ortho_scale=8.4)
    return scene


def _place(thing, number):
    thing.location = (2 * (number % 4) - 3, 0, 2 * (number // 4) - 2)
    return thing


def _tube(number, material, vertices=16, rings=8):
    """A tube of radius .4 and height 1.4 around its origin."""
    positions, faces = [], []
    for ring in range(rings + 1):
        for k in range(vertices):
            angle = 2 * math.pi * k / vertices
            positions.append((0.4 * math.cos(angle), 0.4 * math.sin(angle), 1.4 * ring / rings - 0.7))
            if ring:
                a, b = vertices * (ring - 1) + k, vertices * (ring - 1) + (k + 1) % vertices
                faces.append((a, b, b + vertices, a + vertices))
    mesh = bpy.data.meshes.new("tube")
    mesh.from_pydata(positions, [], faces)
    mesh.materials.append(material)
    return _place(link(mesh, "tube"), number)


def _bulge(thing):
    """Deforms a mesh by a shape key."""
    thing.shape_key_add(name="rest")
    key = thing.shape_key_add(name="bulge")
    for point in key.data:
        factor = 1 + 0.8 * math.exp(-(3 * point.co.z) ** 2)
        point.co = (point.co.x * factor, point.co.y * factor, 0.7 * point.co.z + 0.1)
    key.value = 1.0
    return thing


def _modifier(thing, kind, **settings):
    modifier = thing.modifiers.new(kind.lower(), kind)
    for name, value in settings.items():
        setattr(modifier, name, value)
    return thing


def _with_armature(thing):
    bpy.ops.object.armature_add(location=thing.location)
    armature = bpy.context.object
    thing.vertex_groups.new(name=armature.data.bones[0].name).add(
        [v.index for v in thing.data.vertices if v.co.z > 0], 1.0, "REPLACE"
    )
    armature.pose.bones[0].rotation_mode = "XYZ"
    armature.pose.bones[0].rotation_euler = (0.3, 0.9, 0.6)
    return _modifier(thing, "ARMATURE", object=armature)


def _in_lattice(thing):
    lattice = bpy.data.lattices.new("lattice")
    cage = link(lattice, "cage")
    cage.location, cage.scale = thing.location, (1, 1, 1.6)
    for point in lattice.points:
        x, y, z = point.co_deform
        point.co_deform = (x * (1.2 + z), y, 0.7 * z + 0.3 * x)
    return _modifier(thing, "LATTICE", object=cage)


def test_what_deforms_does_not_move_them():
    scene, material = _stage(), _showing()
    _tube(0, material)
    _bulge(_tube(1, material))
    _with_armature(_tube(2, material))
    _in_lattice(_tube(3, material))
    _modifier(_tube(4, material), "CAST", factor=1.0)
    waves = _place(add_plane(1.4, material, subdivisions=24), 5)
    waves.rotation_euler = degrees(70, 0, 0)
    _modifier(waves, "WAVE", height=0.4, width=0.5, narrowness=3, time_offset=-50)
    _modifier(_tube(6, material), "SIMPLE_DEFORM", deform_method="BEND", angle=1.5, deform_axis="X")
    _modifier(_tube(7, material), "DISPLACE", texture=bpy.data.textures.new("clouds", "CLOUDS"), strength=0.6)
    _modifier(_tube(8, material, rings=2), "SMOOTH", factor=1.0, iterations=6)
    # Objects that share a mesh, of which one is deformed further.
    both = _bulge(_tube(9, material))
    _modifier(_place(link(both.data), 10), "CAST", factor=0.6)
    assert_agrees(scene, samples=16)


def test_what_makes_or_removes_vertices_carries_them_along():
    scene, material = _stage(), _showing()
    _modifier(_bulge(_tube(0, material, 8, 2)), "SUBSURF", levels=0, render_levels=3)
    mirrored = _bulge(_tube(1, material))
    for block in mirrored.data.shape_keys.key_blocks:
        for point in block.data:
            point.co.x = 0.5 * point.co.x + 0.5
    for vertex in mirrored.data.vertices:
        vertex.co.x = 0.5 * vertex.co.x + 0.5
    _modifier(mirrored, "MIRROR")
    row = _bulge(_tube(2, material))
    row.scale = (0.4, 0.4, 1)
    _modifier(row, "ARRAY", count=2, relative_offset_displace=(1.2, 0, 0))
    late = _tube(3, material)
    late.scale = (0.4, 0.4, 1)
    _modifier(_modifier(late, "ARRAY", count=2, relative_offset_displace=(1.2, 0, 0)), "CAST", factor=0.6)
    _modifier(_bulge(_tube(4, material)), "SOLIDIFY", thickness=0.2)
    _modifier(_bulge(_tube(5, material, 8, 2)), "BEVEL", width=0.1, segments=2)
    _modifier(_bulge(_tube(6, material)), "DECIMATE", ratio=0.3)
    _modifier(_bulge(_tube(7, material)), "WELD", merge_threshold=0.15)
    _modifier(_bulge(_tube(8, material, 8, 4)), "WIREFRAME", thickness=0.1)
    _modifier(_bulge(_tube(9, material)), "TRIANGULATE")
    assert_agrees(scene, samples=16)


def _geometry_nodes(thing, build):
    """A modifier of geometry nodes.

    @param  build  makes the output socket of a tree and its input socket
    """
    tree = bpy.data.node_groups.new("geometry", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        add_group_socket(tree, "Geometry", direction, "NodeSocketGeometry")
    begin, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(build(tree, begin.outputs[0]), end.inputs[0])
    return _modifier(thing, "NODES", node_group=tree)


def _widened(tree, geometry):
    node, position = tree.nodes.new("GeometryNodeSetPosition"), tree.nodes.new("GeometryNodeInputPosition")
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY"
    scale.inputs[1].default_value = (0.5, 0.2, 0.3)
    tree.links.new(position.outputs[0], scale.inputs[0])
    tree.links.new(geometry, node.inputs["Geometry"])
    tree.links.new(scale.outputs[0], node.inputs["Offset"])
    return node.outputs[0]


def _twice(tree, geometry):
    node, line = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeMeshLine")
    line.inputs["Count"].default_value = 2
    line.inputs["Start Location"].default_value, line.inputs["Offset"].default_value = (-0.4, 0, 0), (0.8, 0, 0)
    tree.links.new(line.outputs[0], node.inputs["Points"])
    tree.links.new(geometry, node.inputs["Instance"])
    node.inputs["Scale"].default_value = (0.5, 0.5, 0.8)
    return node.outputs[0]


def _real(tree, geometry):
    node = tree.nodes.new("GeometryNodeRealizeInstances")
    tree.links.new(_twice(tree, geometry), node.inputs[0])
    return node.outputs[0]


def test_geometry_nodes_and_instances():
    scene, material = _stage(), _showing()
    _geometry_nodes(_tube(0, material), _widened)
    _geometry_nodes(_bulge(_tube(1, material)), _widened)
    _geometry_nodes(_bulge(_tube(2, material)), _twice)
    _geometry_nodes(_bulge(_tube(3, material)), _real)
    _modifier(_geometry_nodes(_tube(4, material, 8, 2), _widened), "SUBSURF", levels=0, render_levels=2)
    _modifier(_geometry_nodes(_tube(5, material), _widened), "CAST", factor=0.8)
    hidden = _bulge(_tube(6, material))
    collection = bpy.data.collections.new("collection")
    collection.objects.link(hidden)
    scene.collection.objects.unlink(hidden)
    hidden.location = (0, 0, 0)
    for number in (6, 7):
        place = _place(link(None, "place"), number)
        place.instance_type, place.instance_collection = "COLLECTION", collection
        place.scale, place.rotation_euler = (0.7, 0.7, 1), degrees(0, 10 * number, 0)
    # Texture spaces by hand. One that is flat gives a mesh that nothing deforms the same everywhere.
    for number, mesh, size in ((8, _bulge(_tube(8, material)).data, (2, 0.7, 1.5)), (9, _tube(9, material).data, (2, 0, 1.5))):
        mesh.use_auto_texspace = False
        mesh.texspace_location, mesh.texspace_size = (0.3, 0, 0.2), size
    assert_agrees(scene, samples=16)


def test_curves_surfaces_text_and_metaballs():
    scene, material = _stage(), _showing()

    def made(number, scale=0.5):
        thing = _place(bpy.context.object, number)
        thing.scale, thing.rotation_euler = (scale,) * 3, degrees(60, 0, 20)
        thing.data.materials.append(material)
        return thing

    for number in (0, 1, 2):
        bpy.ops.curve.primitive_bezier_curve_add()
        curve = made(number)
        curve.data.bevel_depth = 0.3
        if number == 1:
            _modifier(curve, "CAST", factor=0.6)
        if number == 2:
            curve.shape_key_add(name="rest")
            key = curve.shape_key_add(name="up")
            key.data[1].co.z += 1
            key.value = 1.0
    for number in (4, 5):
        bpy.ops.surface.primitive_nurbs_surface_torus_add()
        surface = made(number)
        if number == 5:
            _modifier(surface, "CAST", factor=0.6)
    for number in (6, 7):
        bpy.ops.object.text_add()
        text = made(number, 0.8)
        text.data.body, text.data.extrude, text.data.align_x = "Re", 0.1, "CENTER"
        if number == 7:
            _modifier(text, "SIMPLE_DEFORM", deform_method="BEND", angle=1.0)
    bpy.ops.object.metaball_add()
    made(9, 0.4)
    bpy.ops.object.metaball_add()
    made(10, 0.3)
    assert_agrees(scene, samples=16)


def test_bump_stays_where_it_is_on_a_mesh_at_rest():
    scene = new_scene(64, 48)
    set_world((0.1, 0.1, 0.1))
    add_light("SUN", rotation=degrees(45, 25, 20), energy=3, angle=0.05)
    add_camera((0, -6, 1), degrees(80.5, 0, 0), lens=60)
    material, tree, shader = new_material("bumped", Color=(0.8, 0.8, 0.8, 1))
    noise, bump = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBump")
    noise.inputs["Scale"].default_value, bump.inputs["Distance"].default_value = 3, 0.3
    # Without a link a texture takes Generated.
    tree.links.new(noise.outputs["Fac" if not IS_4_0 else 0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    _bulge(add_sphere(1.0, material, segments=48))
    assert_agrees(scene, samples=64, tolerance=0.02)


def test_computed_heights_stay_where_they_are_on_a_mesh_at_rest():
    scene = new_scene(64, 48)
    set_world((0.1, 0.1, 0.1))
    add_light("SUN", rotation=degrees(45, 25, 20), energy=3, angle=0.05)
    add_camera((0, -4, 3), degrees(53, 0, 0))
    material, tree, _ = new_material("displaced", Color=(0.8, 0.8, 0.8, 1))
    noise, move = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeDisplacement")
    noise.inputs["Scale"].default_value, move.inputs["Scale"].default_value = 4, 0.3
    tree.links.new(noise.outputs[0], move.inputs["Height"])
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(move.outputs[0], output.inputs["Displacement"])
    from relief import compat

    compat.set_displacement_method(material, "DISPLACEMENT")
    for x in (-0.9, 0.9):
        ground = add_plane(2, material, subdivisions=4, location=(x, 0, 0))
        ground.shape_key_add(name="rest")
        key = ground.shape_key_add(name="moved")
        for point in key.data:
            point.co = (point.co.x * (0.4 + 0.4 * abs(point.co.x)), 0.7 * point.co.y + 0.2 * x, 0)
        key.value = 1.0
        dice(ground, scene)
    # Cycles shades what it has diced to a pixel, relief cells of a pixel, each by normals of its own.
    assert_agrees(scene, samples=64, tolerance=0.05)
