"""Displacement: height, direction, midlevel, space and mapping are Blender's.

Cycles displaces the vertices of a mesh, so it is given one that is subdivided to several vertices a texel; relief gets
the coarse one and finds the surface itself. What is left of Cycles' tessellation is smaller than the noise here.
"""

import bpy
import numpy as np

from scenes import (
    IS_5_0,
    add_camera,
    add_image_node,
    add_light,
    add_plane,
    add_sphere,
    assert_same_expectation,
    assert_warns,
    degrees,
    dice,
    new_image,
    new_material,
    new_scene,
    render_runs,
    set_world,
)

#: Edges of the square's finest tessellation: 16 to a texel of the map.
_FINE = 512


def _heights(size=32):
    """A smooth map without symmetry, between 0.1 and 0.9, that tiles."""
    v, u = np.mgrid[0:size, 0:size] * (2 * np.pi / size)
    h = 0.5 + 0.2 * np.sin(u + 0.4) * np.cos(2 * v) + 0.15 * np.sin(3 * v + u)
    pixels = np.ones((size, size, 4), dtype=np.float32)
    pixels[..., :3] = h[..., None]
    return pixels


def _material(scale=0.4, midlevel=0.5, space="OBJECT", method="DISPLACEMENT", is_float=True):
    """(material, its tree, Image Texture node, Displacement node) of a displaced diffuse surface."""
    from relief import compat

    material, tree, _ = new_material("displaced", Color=(0.8, 0.7, 0.6, 1), Roughness=0.0)
    texture = add_image_node(tree, new_image(_heights(), "Non-Color", is_float))
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.space = space
    node.inputs["Scale"].default_value, node.inputs["Midlevel"].default_value = scale, midlevel
    tree.links.new(texture.outputs["Color"], node.inputs["Height"])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    compat.set_displacement_method(material, method)
    return material, tree, texture, node


def _stage():
    scene = new_scene(80, 60)
    scene.relief.displacement_error = 0.0
    set_world((0.05, 0.05, 0.1))
    add_light("SUN", rotation=degrees(50, 20, 0), energy=3, angle=0)
    add_camera((0, -5, 3.2), degrees(57, 0, 0), lens=45)
    return scene


def _runs(scene, engine, detail, make):
    made = make(detail)
    pictures = render_runs(scene, engine, 4, 16)
    bpy.data.objects.remove(made)
    return pictures


def _assert_agrees(scene, make, tolerance=0.002, cycles=None):
    """Compares relief's picture of a coarse mesh with Cycles' of a fine one.

    @param  make    called with "coarse" or "fine": makes the displaced object
    @param  cycles  Cycles' pictures, where another comparison has made them
    @return         Cycles' pictures
    """
    relief = _runs(scene, "RELIEF", "coarse", make)
    cycles = _runs(scene, "CYCLES", "fine", make) if cycles is None else cycles
    # Cycles' facets are not the surface; the tolerance is larger than what that changed of any block (.001 for squares).
    assert_same_expectation(relief, cycles, 10, 0.05, tolerance)
    return cycles


def _square(material, scale=(1, 1, 1)):
    def make(detail):
        plane = add_plane(4, material, subdivisions=_FINE if detail == "fine" else 2)
        plane.scale = scale
        # Smooth facets a sixteenth of a texel wide have the slope of the map and no steps; a smooth coarse face would
        # have relief smooth the slope over whole texels.
        if detail == "fine":
            bpy.ops.object.shade_smooth()
        return plane

    return make


def _sphere(material, radius, scale=(1, 1, 1)):
    def make(detail):
        sphere = add_sphere(radius, material, (0, 0, 1), segments=64)
        sphere.scale = scale
        if detail == "fine":
            modifier = sphere.modifiers.new("fine", "SUBSURF")
            modifier.subdivision_type, modifier.render_levels = "SIMPLE", 4
        return sphere

    return make


def test_height_and_midlevel():
    scene = _stage()
    material, _, _, _ = _material(scale=0.4, midlevel=0.3)
    _assert_agrees(scene, _square(material))


def test_error_of_a_pixel():
    """As it is by default: diced, and the same but for what is finer than pixels."""
    scene = _stage()
    scene.relief.property_unset("displacement_error")
    assert scene.relief.displacement_error == 1.0
    material, _, _, _ = _material(scale=0.4)
    _assert_agrees(scene, _square(material), 0.01)


def test_a_mesh_finer_than_pixels():
    """Its vertices are moved, as in Cycles: what is between them is not seen. Exactly traced, the picture was 8 % brighter."""
    scene = _stage()
    v, u = np.mgrid[0:1024, 0:1024] * (2 * np.pi / 1024)
    rough = np.ones((1024, 1024, 4), dtype=np.float32)
    rough[..., :3] = (0.5 + 0.03 * np.sin(90 * u) * np.sin(90 * v) + 0.3 * np.sin(u + 2 * v))[..., None]
    material, _, texture, _ = _material(scale=0.2)
    texture.image = new_image(rough, "Non-Color", True)
    add_plane(4, material, subdivisions=160)
    bpy.ops.object.shade_smooth()
    pictures = [render_runs(scene, engine, 4, 16) for engine in ("RELIEF", "CYCLES")]
    assert_same_expectation(*pictures, 10, 0.05)


def _bend(tree, strength=1.0):
    """Gives the diffuse surface a normal map that leans every way. @return its node"""
    v, u = np.mgrid[0:32, 0:32] * (2 * np.pi / 32)
    pixels = np.ones((32, 32, 4), dtype=np.float32)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 0.6 + 0.25 * np.sin(u + v), 0.45 + 0.2 * np.cos(2 * u - v), 0.9
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.inputs["Strength"].default_value = strength
    image = add_image_node(tree, new_image(pixels, "Non-Color"))
    tree.links.new(image.outputs["Color"], node.inputs["Color"])
    surface = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    tree.links.new(node.outputs[0], surface.inputs["Normal"])
    return node


def test_normal_maps_over_what_is_displaced():
    """They stand over the displaced surface; where a node says so, since 5.2, over that of before."""
    for strength in (1.0, 0.6):
        scene = _stage()
        material, tree, _, _ = _material()
        node = _bend(tree, strength)
        for base in ("DISPLACED", "ORIGINAL") if hasattr(node, "base") else (None,):
            if base:
                node.base = base
            cycles = None
            for error in (0.0, 1.0):
                scene.relief.displacement_error = error
                cycles = _assert_agrees(scene, _square(material), 0.01, cycles)


def test_normal_maps_over_moved_vertices():
    """Likewise over what is as fine as pixels, where relief moves vertices as Cycles does."""
    scene = _stage()
    noise = lambda tree: _displacing(tree, "ShaderNodeDisplacement", _texture(tree, "ShaderNodeTexNoise", Scale=4.0, Detail=0.0), Scale=0.5).outputs[0]
    material = _displaced_by(noise)
    node = _bend(material.node_tree, 0.6)
    add_plane(4, material, subdivisions=200)
    bpy.ops.object.shade_smooth()
    for base in ("DISPLACED", "ORIGINAL") if hasattr(node, "base") else (None,):
        if base:
            node.base = base
        relief, cycles = (render_runs(scene, engine, 4, 16) for engine in ("RELIEF", "CYCLES"))
        assert_same_expectation(relief, cycles, 10, 0.05, 0.003)


def test_negative_scale():
    scene = _stage()
    material, _, _, _ = _material(scale=-0.4, midlevel=0.5)
    _assert_agrees(scene, _square(material))


def test_object_space_follows_the_objects_scale():
    scene = _stage()
    material, _, _, _ = _material()
    _assert_agrees(scene, _square(material, (0.9, 1.1, 1.8)))


def test_world_space_does_not():
    scene = _stage()
    material, _, _, _ = _material(space="WORLD")
    _assert_agrees(scene, _square(material, (1.3, 1.3, 1.3)))


def test_world_space_on_an_uneven_scale():
    scene = _stage()
    material, _, _, _ = _material(space="WORLD")
    _assert_agrees(scene, _square(material, (0.9, 1.1, 1.8)))


def test_world_space_on_a_squeezed_sphere():
    """Its normals are not what the object's scale makes of lengths."""
    scene = _stage()
    material, _, _, _ = _material(scale=0.2, space="WORLD")
    _assert_agrees(scene, _sphere(material, 1.0, (1.6, -0.9, 0.5)), tolerance=0.04)


def test_midlevel_in_metres():
    """Float heights of 100 m, more or less, which stay where they are."""
    scene = _stage()
    material, tree, texture, node = _material(scale=1.0, midlevel=100.2)
    texture.image = new_image(_heights() * 0.4 + 100.0, "Non-Color")
    _assert_agrees(scene, _square(material))


def test_byte_heights():
    scene = _stage()
    material, _, _, _ = _material(is_float=False)
    _assert_agrees(scene, _square(material))


def test_tiling_rotation_and_offset():
    scene = _stage()
    material, tree, texture, _ = _material(scale=0.25)
    node, coordinate = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    node.inputs["Location"].default_value = (0.2, 0.1, 0)
    node.inputs["Rotation"].default_value = degrees(0, 0, 30)
    node.inputs["Scale"].default_value = (1.6, 1.2, 1)
    tree.links.new(coordinate.outputs["UV"], node.inputs["Vector"])
    tree.links.new(node.outputs["Vector"], texture.inputs["Vector"])
    _assert_agrees(scene, _square(material))


def test_heights_scaled_and_shifted_by_nodes():
    """0.5 − 0.8 · h goes into scale and midlevel."""
    scene = _stage()
    material, tree, texture, node = _material(scale=0.5, midlevel=0.1)
    times, minus = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
    times.operation, minus.operation = "MULTIPLY", "SUBTRACT"
    times.inputs[1].default_value, minus.inputs[0].default_value = 0.8, 0.5
    tree.links.new(texture.outputs["Color"], times.inputs[0])
    tree.links.new(times.outputs[0], minus.inputs[1])
    tree.links.new(minus.outputs[0], node.inputs["Height"])
    _assert_agrees(scene, _square(material))


def test_direction_on_a_sphere():
    """The normals of the coarse sphere say where points go: the fine one has those normals, interpolated linearly."""
    scene = _stage()
    material, _, _, _ = _material(scale=0.25)
    # The subdivided mesh has the coarse one's facets but new smooth normals: 64 segments keep both within this.
    _assert_agrees(scene, _sphere(material, 1.2), tolerance=0.04)


def test_flat_faces_stay_together():
    """A flat-shaded cube opens no cracks: a light inside it is not seen."""
    scene = _stage()
    material, _, _, _ = _material(scale=0.3)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    bpy.data.objects.remove(next(o for o in scene.objects if o.type == "LIGHT"))
    bpy.ops.mesh.primitive_cube_add(size=1.6, location=(0, 0, 1))
    cube = bpy.context.object
    cube.data.materials.append(material)
    cube.data.uv_layers.remove(cube.data.uv_layers[0])
    # One map over all sides without a seam.
    node = material.node_tree.nodes.new("ShaderNodeTexCoord")
    texture = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeTexImage")
    material.node_tree.links.new(node.outputs["Generated"], texture.inputs["Vector"])
    glow = new_material("glow", "ShaderNodeEmission", Strength=100.0)[0]
    add_sphere(0.2, glow, (0, 0, 1))
    scene.relief.strict = False
    assert render_runs(scene, "RELIEF", 1, 64).max() == 0


def test_constant_height():
    scene = _stage()
    material, tree, texture, node = _material(scale=0.5, midlevel=0.0)
    tree.links.remove(node.inputs["Height"].links[0])
    node.inputs["Height"].default_value = 0.7
    _assert_agrees(scene, _square(material))


def _graph_material(kind, scale, coordinates="UV", **values):
    """(material, texture node) of a surface that a texture without image displaces."""
    material, tree, texture, node = _material(scale=scale)
    tree.nodes.remove(texture)
    texture, coordinate = tree.nodes.new(kind), tree.nodes.new("ShaderNodeTexCoord")
    for name, value in values.items():
        texture.inputs[name].default_value = value
    tree.links.new(coordinate.outputs[coordinates], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Fac"], node.inputs["Height"])
    return material, texture


def _displacement_of(scene):
    """RELIEF_displacement of the first material as the add-on writes it."""
    import json

    from relief.exporter import export_frames
    from scenes import folder

    with folder() as path:
        export_frames(scene, f"{path}/scene.gltf", [1])
        with open(f"{path}/scene.gltf", encoding="utf-8") as file:
            return json.load(file)["materials"][0].get("extensions", {}).get("RELIEF_displacement")


def test_noise_over_texture_coordinates():
    scene = _stage()
    material, _ = _graph_material("ShaderNodeTexNoise", 0.8, Scale=5.0, Detail=2.0)
    _assert_agrees(scene, _square(material))


def test_wave_over_texture_coordinates():
    scene = _stage()
    material, _ = _graph_material("ShaderNodeTexWave", 0.25, Scale=1.3, Distortion=1.5)
    _assert_agrees(scene, _square(material))


def test_graphs_cover_what_meshes_use_of_their_uv_map():
    scene = _stage()
    plane = add_plane(4, _graph_material("ShaderNodeTexNoise", 0.8)[0])
    for corner in plane.data.uv_layers[0].data:
        corner.uv = (3 * corner.uv[0] - 1, corner.uv[1] / 2)
    value = _displacement_of(scene)
    assert np.allclose(value["heightGraph"]["uvRange"], [-1, 0.5, 2, 1]), value
    assert abs(value["scale"] - 0.8) < 1e-6


def test_heights_over_generated_coordinates():
    """No uv map has them."""
    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    material, _ = _graph_material("ShaderNodeTexNoise", 0.5, coordinates="Generated", Scale=3.0, Detail=1.0)
    _assert_agrees(scene, _sphere(material, 1), tolerance=0.004)


def test_heights_over_object_coordinates():
    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    material, _ = _graph_material("ShaderNodeTexWave", 0.2, coordinates="Object", Scale=1.0, Distortion=1.5)
    _assert_agrees(scene, _square(material), tolerance=0.004)


def _displacing(tree, kind, height, **values):
    """A Displacement or Vector Displacement node."""
    node = tree.nodes.new(kind)
    for name, value in values.items():
        if name == "space":
            node.space = value
        else:
            node.inputs[name].default_value = value
    tree.links.new(height, node.inputs[0])
    return node


def _texture(tree, kind, output="Fac", coordinates="UV", **values):
    texture, coordinate = tree.nodes.new(kind), tree.nodes.new("ShaderNodeTexCoord")
    for name, value in values.items():
        texture.inputs[name].default_value = value
    tree.links.new(coordinate.outputs[coordinates], texture.inputs["Vector"])
    return texture.outputs[output]


def _displaced_by(build, method="DISPLACEMENT"):
    """A diffuse material whose Displacement is what `build` makes in its tree."""
    from relief import compat

    material, tree, _ = new_material("displaced", Color=(0.8, 0.7, 0.6, 1), Roughness=0.0)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(build(tree), output.inputs["Displacement"])
    compat.set_displacement_method(material, method)
    return material


def test_masks_in_scale_and_midlevel():
    """An image times a mask of noise: one height, without a warning."""

    def build(tree):
        texture = add_image_node(tree, new_image(_heights(), "Non-Color"))
        node = _displacing(tree, "ShaderNodeDisplacement", texture.outputs["Color"])
        tree.links.new(_texture(tree, "ShaderNodeTexNoise", Scale=2.0, Detail=0.0), node.inputs["Scale"])
        tree.links.new(_texture(tree, "ShaderNodeTexGradient"), node.inputs["Midlevel"])
        return node.outputs[0]

    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    _assert_agrees(scene, _square(_displaced_by(build)), tolerance=0.004)


def _sum(tree, operation="ADD"):
    """Noise over one uv map and waves over object coordinates, added."""
    total = tree.nodes.new("ShaderNodeVectorMath")
    total.operation = operation
    noise = _texture(tree, "ShaderNodeTexNoise", Scale=4.0, Detail=1.0)
    waves = _texture(tree, "ShaderNodeTexWave", coordinates="Object", Scale=0.6)
    first = _displacing(tree, "ShaderNodeDisplacement", noise, Scale=0.5)
    second = _displacing(tree, "ShaderNodeDisplacement", waves, Scale=0.2, Midlevel=0.2)
    tree.links.new(first.outputs[0], total.inputs[0])
    tree.links.new(second.outputs[0], total.inputs[1])
    return total.outputs[0]


def test_displacements_that_are_added():
    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    _assert_agrees(scene, _square(_displaced_by(_sum)), tolerance=0.004)


def _mixed_in_a_group(tree):
    """A group that mixes two displacements by its input, behind a reroute, scaled."""
    inside = bpy.data.node_groups.new("mixed", "ShaderNodeTree")
    if IS_5_0:
        inside.interface.new_socket("Share", in_out="INPUT", socket_type="NodeSocketFloat")
        inside.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketVector")
    else:
        inside.inputs.new("NodeSocketFloat", "Share")
        inside.outputs.new("NodeSocketVector", "Out")
    share, out = inside.nodes.new("NodeGroupInput"), inside.nodes.new("NodeGroupOutput")
    mix = inside.nodes.new("ShaderNodeMix")
    mix.data_type = "VECTOR"
    factor, *sides = (socket for socket in mix.inputs if socket.enabled)
    inside.links.new(share.outputs[0], factor)
    for side, scale in zip(sides, (3.0, 7.0)):
        noise = _texture(inside, "ShaderNodeTexNoise", Scale=scale, Detail=0.0)
        inside.links.new(_displacing(inside, "ShaderNodeDisplacement", noise, Scale=2 / scale).outputs[0], side)
    inside.links.new(next(socket for socket in mix.outputs if socket.enabled), out.inputs[0])
    group, reroute, scaled = (tree.nodes.new(kind) for kind in ("ShaderNodeGroup", "NodeReroute", "ShaderNodeVectorMath"))
    group.node_tree, scaled.operation = inside, "SCALE"
    scaled.inputs["Scale"].default_value = 0.7
    tree.links.new(_texture(tree, "ShaderNodeTexGradient"), group.inputs[0])
    tree.links.new(group.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], scaled.inputs[0])
    return scaled.outputs[0]


def test_displacements_that_are_mixed_in_a_group():
    """Over one uv map: a map."""
    scene = _stage()
    scene.relief.strict = True
    material = _displaced_by(_mixed_in_a_group)
    plane = _square(material)("coarse")
    value = _displacement_of(scene)
    bpy.data.objects.remove(plane)
    assert "heightGraph" in value and "cellPixels" not in value, value
    _assert_agrees(scene, _square(material))


def test_tiled_images_displace():
    """Each tile of its own size, one is missing."""
    import os

    from scenes import folder

    with folder() as path:
        for number, size in ((1001, 16), (1002, 32), (1012, 8)):
            image = new_image(_heights(size), "Non-Color")
            image.filepath_raw, image.file_format = os.path.join(path, f"tile.{number}.exr"), "OPEN_EXR"
            image.save()

        def build(tree):
            image = bpy.data.images.load(os.path.join(path, "tile.1001.exr"))
            image.source, image.colorspace_settings.name = "TILED", "Non-Color"
            image.filepath = os.path.join(path, "tile.<UDIM>.exr")
            for number in (1002, 1012):
                if number not in {tile.number for tile in image.tiles}:
                    image.tiles.new(number)
            texture = add_image_node(tree, image)
            return _displacing(tree, "ShaderNodeDisplacement", texture.outputs["Color"], Scale=0.2).outputs[0]

        scene = _stage()
        scene.relief.strict, scene.relief.cell_pixels = True, 0.1
        square = _square(_displaced_by(build))

        def make(detail):
            plane = square(detail)
            uv = np.empty(2 * len(plane.data.loops), dtype=np.float32)
            plane.data.uv_layers[0].data.foreach_get("uv", uv)
            plane.data.uv_layers[0].data.foreach_set("uv", 0.01 + 1.98 * uv)
            return plane

        # Steps between tiles are as wide as the triangles of each engine.
        _assert_agrees(scene, make, tolerance=0.02)


def _vectors(size=32):
    """A smooth map of vectors, between .1 and .9, that tiles."""
    v, u = np.mgrid[0:size, 0:size] * (2 * np.pi / size)
    pixels = np.ones((size, size, 4), dtype=np.float32)
    pixels[..., 0] = 0.5 + 0.3 * np.sin(2 * u + 0.4)
    pixels[..., 1] = 0.5 + 0.3 * np.cos(v) * np.sin(u)
    pixels[..., 2] = 0.5 + 0.3 * np.sin(u + 2 * v)
    return pixels


def _by_vectors(space):
    def build(tree):
        texture = add_image_node(tree, new_image(_vectors(), "Non-Color"))
        values = {"space": space, "Scale": 0.5, "Midlevel": 0.5}
        return _displacing(tree, "ShaderNodeVectorDisplacement", texture.outputs["Color"], **values).outputs[0]

    return build


def test_vectors_in_every_space():
    for space in ("OBJECT", "WORLD", "TANGENT"):
        scene = _stage()
        scene.relief.strict, scene.relief.cell_pixels = True, 0.1
        square = _square(_displaced_by(_by_vectors(space)), (0.9, 1.1, 0.6))

        def make(detail):
            plane = square(detail)
            plane.rotation_euler = degrees(10, -15, 30)
            return plane

        _assert_agrees(scene, make, tolerance=0.006)


def test_vectors_on_a_sphere():
    """Tangents turn with the surface."""
    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.25
    sphere = add_sphere(1.2, _displaced_by(_by_vectors("TANGENT")), (0, 0, 1), segments=32)
    dice(sphere, scene, 0.25)
    relief, cycles = (render_runs(scene, engine, 4, 16) for engine in ("RELIEF", "CYCLES"))
    # Triangles are not the same at the silhouette.
    assert_same_expectation(relief, cycles, 10, 0.05, 0.02)


def test_a_normal_of_its_own_and_sums_with_vectors():
    """A Displacement node with a Normal, one of the world and a vector, on an object with an uneven scale."""

    def build(tree):
        normal = tree.nodes.new("ShaderNodeCombineXYZ")
        normal.inputs["X"].default_value, normal.inputs["Z"].default_value = 0.6, 0.8
        first, second = tree.nodes.new("ShaderNodeVectorMath"), tree.nodes.new("ShaderNodeVectorMath")
        noise = _texture(tree, "ShaderNodeTexNoise", Scale=3.0, Detail=0.0)
        leaning = _displacing(tree, "ShaderNodeDisplacement", noise, Scale=0.6)
        tree.links.new(normal.outputs[0], leaning.inputs["Normal"])
        upright = _displacing(tree, "ShaderNodeDisplacement", noise, Scale=0.3, space="WORLD")
        tree.links.new(leaning.outputs[0], first.inputs[0])
        tree.links.new(upright.outputs[0], first.inputs[1])
        tree.links.new(first.outputs[0], second.inputs[0])
        tree.links.new(_by_vectors("OBJECT")(tree), second.inputs[1])
        return second.outputs[0]

    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    _assert_agrees(scene, _square(_displaced_by(build), (0.9, 1.1, 1.8)), tolerance=0.006)


def test_any_vector_displaces():
    """A colour of noise over Generated, linked without a node of its own: a vector of the world."""

    def build(tree):
        scaled = tree.nodes.new("ShaderNodeVectorMath")
        scaled.operation = "SCALE"
        scaled.inputs["Scale"].default_value = 0.4
        noise = _texture(tree, "ShaderNodeTexNoise", "Color", "Generated", Scale=3.0, Detail=0.0)
        tree.links.new(noise, scaled.inputs[0])
        return scaled.outputs[0]

    scene = _stage()
    scene.relief.strict, scene.relief.cell_pixels = True, 0.1
    _assert_agrees(scene, _square(_displaced_by(build)), tolerance=0.006)


def test_sums_and_vectors_that_bump_only():
    for build in (_sum, _by_vectors("TANGENT")):
        scene = _stage()
        scene.relief.strict = True
        _square(_displaced_by(build, "BUMP"))("coarse")
        relief, cycles = (render_runs(scene, engine, 4, 16) for engine in ("RELIEF", "CYCLES"))
        assert_same_expectation(relief, cycles, 10, 0.05, 0.01)


def test_adaptive_subdivision_divides_what_nodes_displace():
    for is_adaptive in (False, True):
        scene = _stage()
        plane = add_plane(4, _displaced_by(_sum))
        if is_adaptive:
            dice(plane, scene, 1.0)
        assert _displacement_of(scene).get("divide", False) == is_adaptive


def test_dicing_rates_are_followed():
    """The scene's and the object's, beside each other, and what else says how fine Cycles dices, where points have to be."""
    scene = _stage()
    scene.relief.use_cycles_settings = True
    plane = add_plane(4, _displaced_by(_sum))
    assert "cellLength" not in _displacement_of(scene) and _displacement_of(scene)["cellPixels"] == 1
    dice(plane, scene, 0.5)
    usual = _displacement_of(scene)
    assert usual["cellPixels"] == 0.5 and usual["divide"] and not {"coarserOutside", "mostCells"} & usual.keys(), usual
    cycles = scene.cycles
    if IS_5_0:
        cycles.dicing_rate = 3.0
    else:
        plane.cycles.dicing_rate = 3.0
    cycles.offscreen_dicing_scale, cycles.max_subdivisions, scene.relief.cell_pixels = 9.0, 6, 0.5
    value = _displacement_of(scene)
    found = value["cellPixels"], value["coarserOutside"], value["mostCells"]
    assert found == (0.75, 9.0, 64), value
    cycles.dicing_rate = 0.1
    if not IS_5_0:
        assert abs(_displacement_of(scene)["cellPixels"] - 0.15) < 1e-6
        plane.cycles.dicing_rate = 0.5
    value = _displacement_of(scene)
    assert abs(value["cellPixels"] - 0.05) < 1e-6, "Cycles dices no finer than a tenth of a pixel"
    scene.relief.use_cycles_settings = False
    value = _displacement_of(scene)
    assert value["cellPixels"] == 0.25 and "mostCells" not in value, "the object's own rate alone is left"
    scene.relief.use_cycles_settings = True
    if IS_5_0:
        modifier = plane.modifiers[-1]
        modifier.adaptive_space, modifier.adaptive_object_edge_length, cycles.dicing_rate = "OBJECT", 0.02, 2.0
        value = _displacement_of(scene)
        assert abs(value["cellLength"] - 0.04) < 1e-7 and value["cellPixels"] == 0.5, value


def test_what_bumps_show_besides_is_not_left_to_vertices():
    for method, divides in (("DISPLACEMENT", False), ("BOTH", True)):
        _stage()
        add_plane(4, _material(method=method)[0])
        assert _displacement_of(bpy.context.scene).get("divide", False) == divides, method


def test_maps_are_diced_at_their_rate():
    """Exact they stay where no error is wanted; where it is, in units of Cycles' rate."""
    scene = _stage()
    scene.relief.use_cycles_settings = True
    plane = add_plane(4, _material()[0])
    dice(plane, scene, 1.0)
    assert not {"cellPixels", "divide", "coarserOutside"} & _displacement_of(scene).keys()
    exact = render_runs(scene, "RELIEF", 1, 4)
    plane.modifiers.clear()
    dice(plane, scene, 4.0)
    assert _displacement_of(scene)["cellPixels"] == 4
    assert (render_runs(scene, "RELIEF", 1, 4) == exact).all()


def test_detail_is_what_the_dicing_rate_leaves():
    """Noise as fine as pixels: what faces of a rate leave of it, both engines alike; at another rate it is another picture."""

    def build(tree):
        noise = _texture(tree, "ShaderNodeTexNoise", coordinates="Object", Scale=7.3, Detail=0.0)
        return _displacing(tree, "ShaderNodeDisplacement", noise, Scale=0.15).outputs[0]

    means = {}
    for rate in (8.0, 0.5):
        scene = _stage()
        scene.relief.use_cycles_settings = True
        plane = add_plane(4, _displaced_by(build))
        bpy.ops.object.shade_smooth()
        dice(plane, scene, rate)
        means[rate] = [render_runs(scene, engine, 1, 64)[0].mean() for engine in ("RELIEF", "CYCLES")]
    print("means, relief's and Cycles', by rate", means)
    (coarse, cycles_coarse), (fine, cycles_fine) = means[8.0], means[0.5]
    assert cycles_fine / cycles_coarse > 1.05, "the rate makes no difference"
    assert abs(coarse / cycles_coarse - 1) < 0.01 and abs(fine / cycles_fine - 1) < 0.01, means


def test_bump_may_displace():
    """A Bump node that displaces, and a Displacement node that says the same in its own words."""
    scene = _stage()
    material, tree, texture, node = _material(scale=0.4 * 0.75, midlevel=0.5, space="WORLD")
    _square(material)("coarse")
    meant = render_runs(scene, "RELIEF", 1, 16)
    tree.nodes.remove(node)
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value, bump.inputs["Strength"].default_value = 0.4, 0.75
    tree.links.new(texture.outputs["Color"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse").inputs["Normal"])
    scene.relief.bump_displaces = True
    shown = render_runs(scene, "RELIEF", 1, 16)
    assert np.array_equal(shown, meant), np.abs(shown - meant).max()
    bump.invert = True
    assert np.abs(render_runs(scene, "RELIEF", 1, 16) - meant).max() > 0.1


def test_the_panels_switch():
    """The button does what the warning asks for."""
    _stage()
    material, _, _, _ = _material(method="BUMP")
    plane = add_plane(4, material)
    from relief import compat
    from relief.export.displacement import needs_switch

    assert needs_switch(material)
    with bpy.context.temp_override(material=material, object=plane):
        assert bpy.ops.relief.displace() == {"FINISHED"}
    assert not needs_switch(material) and compat.displacement_method(material) == "DISPLACEMENT"


def test_settings_reach_the_program():
    """Method, level of detail and seams of the scene are in every displaced material, smoothing where there is bump."""
    import json

    from relief.exporter import export_frames
    from scenes import folder

    scene = _stage()
    material, _, _, _ = _material(method="BOTH")
    add_plane(4, material)
    scene.relief.displacement_method, scene.relief.lod = "rmip", 2
    assert scene.relief.weld_seams
    scene.relief.weld_seams = False
    with folder() as path:
        export_frames(scene, f"{path}/scene.gltf", [1])
        with open(f"{path}/scene.gltf", encoding="utf-8") as file:
            document = json.load(file)
    value = document["materials"][0]["extensions"]["RELIEF_displacement"]
    assert (value["method"], value["lod"], value["smoothing"], value["seams"]) == ("rmip", 2, True, "keep"), value


def _smoothing_of(make):
    """What `smoothing` is in the materials of the primitives that `make` adds."""
    import json

    from relief.exporter import export_frames
    from scenes import folder

    scene = _stage()
    make(scene)
    with folder() as path:
        export_frames(scene, f"{path}/scene.gltf", [1])
        with open(f"{path}/scene.gltf", encoding="utf-8") as file:
            document = json.load(file)
    parts = [p for mesh in document["meshes"] for p in mesh["primitives"]]
    materials = [document["materials"][p["material"]] for p in parts]
    return [m["extensions"]["RELIEF_displacement"]["smoothing"] for m in materials]


def test_smooth_faces_have_smooth_slopes():
    """Faces that are shaded smooth get them, flat ones keep their facets, whatever moves them."""

    def make(scene, faces, method="DISPLACEMENT", bump=False):
        scene.relief.bump_displaces = bump
        plane = add_plane(4, _material(method=method)[0], subdivisions=2)
        plane.data.polygons.foreach_set("use_smooth", faces)

    flat, smooth, mixed = [False] * 4, [True] * 4, [True, False, False, True]
    assert _smoothing_of(lambda s: make(s, flat)) == [False]
    assert _smoothing_of(lambda s: make(s, smooth)) == [True]
    assert _smoothing_of(lambda s: make(s, mixed)) == [False, True]
    assert _smoothing_of(lambda s: make(s, mixed, "BUMP", bump=True)) == [False, True]
    # Bump smooths flat faces, too.
    assert _smoothing_of(lambda s: make(s, mixed, "BOTH")) == [True]


def test_smoothing_is_that_of_every_method():
    """The same picture, but for what a tessellation is not."""
    scene = _stage()
    add_plane(4, _material(scale=0.2)[0], subdivisions=2)
    facets = render_runs(scene, "RELIEF", 1, 16)[0]
    bpy.ops.object.shade_smooth()
    pictures = {}
    items = scene.relief.bl_rna.properties["displacement_method"].enum_items
    for method in [item.identifier for item in items if item.identifier != "auto"]:
        scene.relief.displacement_method = method
        pictures[method] = render_runs(scene, "RELIEF", 1, 16)[0]
    difference = np.abs(facets - pictures["chord"]).mean()
    assert difference > 0.002
    differences = {method: np.abs(p - pictures["chord"]).mean() / difference for method, p in pictures.items()}
    print("differences", differences)
    for method, relative in differences.items():
        assert relative < (0.5 if method.startswith("tessellate") else 0.1), differences


def test_smooth_faces_are_near_cycles_at_its_default_dicing():
    """A steep map at a pixel a texel: smooth slopes come nearer than facets to what Cycles dices to a pixel."""
    random = np.random.default_rng(3)
    size = 64
    radius = np.hypot(*np.meshgrid(*[np.fft.fftfreq(size, 1 / size)] * 2))
    spectrum = np.maximum(radius, 1) ** -1.5 * np.exp(2j * np.pi * random.uniform(size=(size, size)))
    heights = np.fft.ifft2(np.where(radius > 0, spectrum, 0)).real
    pixels = np.ones((size, size, 4), dtype=np.float32)
    pixels[..., :3] = ((heights - heights.min()) / np.ptp(heights))[..., None]
    scene = new_scene(size, size)
    set_world((0.05, 0.05, 0.1))
    add_light("SUN", rotation=degrees(60, 0, 30), energy=3, angle=0)
    add_camera(type="ORTHO", ortho_scale=4)
    material, _, texture, _ = _material(scale=0.3)
    texture.image = new_image(pixels, "Non-Color")
    plane = add_plane(4, material)
    facets = render_runs(scene, "RELIEF", 1, 64)[0]
    bpy.ops.object.shade_smooth()
    smooth = render_runs(scene, "RELIEF", 1, 64)[0]
    dice(plane, scene)
    cycles = render_runs(scene, "CYCLES", 1, 64)[0]
    before, after = (np.sqrt(((p - cycles) ** 2).mean()) / cycles.mean() for p in (facets, smooth))
    print(f"means {facets.mean() / cycles.mean():.4f} {smooth.mean() / cycles.mean():.4f}, RMS {before:.4f} {after:.4f}")
    assert after < 0.8 * before and abs(smooth.mean() / cycles.mean() - 1) < 0.02
