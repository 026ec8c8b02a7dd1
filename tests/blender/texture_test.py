"""Textures: orientation, mapping, channels, colour spaces and sources of images are Blender's."""

import os

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_light,
    add_image_node,
    add_plane,
    asymmetric_pixels,
    assert_agrees,
    degrees,
    folder,
    new_image,
    new_material,
    new_scene,
    set_bounces,
    set_file_format,
    set_world,
)


def _stage(make_image, kind="ShaderNodeEmission", socket="Color", **settings):
    """A textured square that fills the picture, seen from above; emission shows the texture's values themselves.

    @param  make_image  called in the new scene
    @param  kind        of the shader whose socket is textured
    @param  settings    of the Image Texture node
    @return             (scene, tree, Image Texture node, shader node)
    """
    scene = new_scene(64, 48)
    set_world((1, 1, 1), 1.0 if kind != "ShaderNodeEmission" else 0.0)
    material, tree, node = new_material("textured", kind)
    texture = add_image_node(tree, make_image(), **settings)
    tree.links.new(texture.outputs["Color"], node.inputs[socket])
    add_plane(4, material)
    add_camera((0.1, -0.2, 6), degrees(2, 3, 10), type="ORTHO", ortho_scale=3.6)
    return scene, tree, texture, node


def _bytes(color_space="sRGB"):
    """Bytes. Between texels of sRGB Cycles interpolates what is stored, relief what it means: tests show texels."""
    return lambda: new_image(asymmetric_pixels(), color_space, is_float=False)


def _floats():
    return new_image(asymmetric_pixels())


def _mapping(tree, texture, kind="POINT", location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1)):
    """A Mapping node before a texture."""
    node, coordinate = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    node.vector_type = kind
    node.inputs["Location"].default_value = location
    node.inputs["Rotation"].default_value = rotation
    node.inputs["Scale"].default_value = scale
    tree.links.new(coordinate.outputs["UV"], node.inputs["Vector"])
    tree.links.new(node.outputs["Vector"], texture.inputs["Vector"])


def _assert_shows(scene):
    # Cycles keeps bytes as bytes and interpolates after decoding them, as relief does; both filter alike up close.
    assert_agrees(scene, samples=64, block=4, tolerance=0.005)


def test_orientation_of_bytes():
    _assert_shows(_stage(_bytes(), interpolation="Closest")[0])


def test_orientation_of_floats():
    _assert_shows(_stage(lambda: new_image(asymmetric_pixels() * (3, 3, 3, 1)))[0])


def test_non_color_bytes():
    _assert_shows(_stage(_bytes("Non-Color"))[0])


def test_extended_border():
    scene, tree, texture, node = _stage(_floats, extension="EXTEND")
    _mapping(tree, texture, location=(-0.5, -0.5, 0), scale=(2, 2, 1))
    _assert_shows(scene)


def test_tiling_and_offset():
    scene, tree, texture, node = _stage(_floats)
    _mapping(tree, texture, location=(0.2, 0.35, 0), scale=(3, 2, 1))
    _assert_shows(scene)


def test_rotation():
    scene, tree, texture, node = _stage(_floats)
    _mapping(tree, texture, location=(0.1, 0.3, 0), rotation=degrees(0, 0, 25), scale=(1.5, 0.8, 1))
    _assert_shows(scene)


def test_mapping_as_texture():
    scene, tree, texture, node = _stage(_floats)
    _mapping(tree, texture, "TEXTURE", (0.1, 0.3, 0), degrees(0, 0, 25), (0.5, 0.5, 1))
    _assert_shows(scene)


def test_two_uv_maps():
    """The second uv map, by name, though the first is active."""
    scene, tree, texture, node = _stage(_floats)
    plane = next(o for o in scene.objects if o.type == "MESH")
    second = plane.data.uv_layers.new(name="other")
    uv = np.empty(2 * len(second.data), dtype=np.float32)
    second.data.foreach_get("uv", uv)
    second.data.foreach_set("uv", uv.reshape(-1, 2)[:, ::-1].ravel() * 1.7 + 0.2)
    source = tree.nodes.new("ShaderNodeUVMap")
    source.uv_map = "other"
    tree.links.new(source.outputs[0], texture.inputs["Vector"])
    _assert_shows(scene)


def test_generated_coordinates():
    scene, tree, texture, node = _stage(_floats)
    source = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(source.outputs["Generated"], texture.inputs["Vector"])
    _assert_shows(scene)


def test_tinted_texture():
    scene, tree, texture, node = _stage(_floats)
    mix = tree.nodes.new("ShaderNodeMixRGB")
    mix.blend_type = "MULTIPLY"
    mix.inputs[0].default_value = 1.0
    mix.inputs[2].default_value = (0.9, 0.5, 0.2, 1)
    tree.links.new(texture.outputs["Color"], mix.inputs[1])
    tree.links.new(mix.outputs[0], node.inputs["Color"])
    _assert_shows(scene)


def test_transparency_that_is_not_used_darkens():
    """Blender multiplies stored colours by an alpha that is linked to nothing."""
    pixels = asymmetric_pixels()
    pixels[..., 3] = 0.2 + 0.8 * pixels[..., 0]
    _assert_shows(_stage(lambda: new_image(pixels, "sRGB", is_float=False), interpolation="Closest")[0])


def test_opacity_from_the_images_alpha():
    pixels = asymmetric_pixels()
    pixels[..., 3] = pixels[..., 0]
    scene, tree, texture, node = _stage(lambda: new_image(pixels, "Non-Color", is_float=False))
    texture.image.alpha_mode = "CHANNEL_PACKED"
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(node.outputs[0], mix.inputs[2])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    set_world((0.2, 0.7, 0.4))
    assert_agrees(scene, samples=128, tolerance=0.005)


def test_opacity_from_another_image():
    scene, tree, texture, node = _stage(_floats)
    tree.links.remove(node.inputs["Color"].links[0])
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    separate = tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(texture.outputs["Color"], separate.inputs[0])
    tree.links.new(separate.outputs["Green"], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    diffuse_node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(diffuse_node.outputs[0], mix.inputs[2])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    set_world((0.2, 0.7, 0.4))
    set_bounces(scene, 2)
    assert_agrees(scene, samples=128, tolerance=0.005)


def test_roughness_from_a_grey_image_long():
    """A mirror whose blur varies over the square."""
    pixels = asymmetric_pixels()
    pixels[..., :3] = (0.15 + 0.5 * pixels[..., :1]) * np.ones(3)
    scene, tree, texture, node = _stage(
        lambda: new_image(pixels, "Non-Color", is_float=False), "ShaderNodeBsdfGlossy", "Roughness"
    )
    node.inputs["Color"].default_value = (1, 1, 1, 1)
    node.distribution = "MULTI_GGX"
    set_bounces(scene, 1)
    from scenes import add_light

    add_light("AREA", (0, 0, 9), energy=900, size=1.2)
    assert_agrees(scene, samples=64, tolerance=0.02)


def test_normal_map():
    """Tilted facets under a sun: the tangents' directions show."""
    pixels = np.ones((4, 4, 4), dtype=np.float32)
    tilt = np.random.default_rng(3).uniform(-0.4, 0.4, (4, 4, 2))
    pixels[..., :2] = 0.5 + 0.5 * tilt
    pixels[..., 2] = 0.5 + 0.5 * np.sqrt(1 - (tilt**2).sum(axis=-1))
    scene, tree, texture, node = _stage(
        lambda: new_image(pixels, "Non-Color", is_float=False), "ShaderNodeBsdfDiffuse", interpolation="Closest"
    )
    tree.links.remove(node.inputs["Color"].links[0])
    normal = tree.nodes.new("ShaderNodeNormalMap")
    tree.links.new(texture.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs["Normal"], node.inputs["Normal"])
    set_world((0, 0, 0))
    from scenes import add_light

    add_light("SUN", rotation=degrees(25, 35, 0), energy=2, angle=0)
    # Cycles softens what faces away from the mesh's own normal; tangents the wrong way would differ by ten times this.
    assert_agrees(scene, samples=64, block=4, tolerance=0.04)


def _painted(kind):
    """A square whose colour attribute is the colour of a shader."""
    scene = new_scene()
    set_world((1, 1, 1))
    material, tree, node = new_material("painted", kind)
    plane = add_plane(4, material, subdivisions=6)
    attribute = plane.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    colors = np.random.default_rng(5).uniform(0, 1, (len(attribute.data), 4)).astype(np.float32)
    attribute.data.foreach_set("color", colors.ravel())
    source = tree.nodes.new("ShaderNodeVertexColor")
    source.layer_name = "paint"
    tree.links.new(source.outputs["Color"], node.inputs["Color"])
    add_camera((0, 0, 6), type="ORTHO", ortho_scale=3.6)
    return scene


def test_color_attribute():
    assert_agrees(_painted("ShaderNodeBsdfDiffuse"), samples=64, tolerance=0.005)


def test_color_attribute_of_emission():
    assert_agrees(_painted("ShaderNodeEmission"), samples=64, tolerance=0.005)


def _save(path, file_format="PNG", depth="16"):
    """Writes the asymmetric picture as a file, by Blender's own means."""
    scene = new_scene()
    set_file_format(file_format, depth, color_mode="RGB")
    scene.view_settings.view_transform = "Standard"
    new_image(asymmetric_pixels()).save_render(path)
    return path


def test_files_are_named_not_copied():
    """An image file reaches the program by its path; only the scene and the mesh are written."""
    from relief.exporter import export_frames

    with folder() as path:
        name = _save(f"{path}/image 16.png")
        # Sixteen bits of sRGB, too, are interpolated as stored by Cycles.
        scene, _, _, _ = _stage(lambda: bpy.data.images.load(name), interpolation="Closest")
        export_frames(scene, f"{path}/out/scene.gltf", [1])
        with open(f"{path}/out/scene.gltf", encoding="utf-8") as file:
            assert "../image%2016.png" in file.read()
        assert all(n.endswith(".bin") for n in os.listdir(f"{path}/out/scene_data"))
        _assert_shows(scene)


def test_float_files():
    with folder() as path:
        name = _save(f"{path}/image.exr", "OPEN_EXR", "16")
        _assert_shows(_stage(lambda: bpy.data.images.load(name))[0])


def test_files_in_another_color_space_than_their_use_expects():
    def load():
        image = bpy.data.images.load(name)
        image.colorspace_settings.name = "Non-Color"
        return image

    with folder() as path:
        name = _save(f"{path}/image.png")
        _assert_shows(_stage(load)[0])


def test_packed_files_keep_their_bytes():
    from relief.exporter import export_frames

    with folder() as path:
        name = _save(f"{path}/image.png")
        with open(name, "rb") as file:
            data = file.read()
        scene, _, texture, _ = _stage(lambda: bpy.data.images.load(name))
        texture.image.pack()
        os.remove(name)
        export_frames(scene, f"{path}/out/scene.gltf", [1])
        written = [n for n in os.listdir(f"{path}/out/scene_data") if n.endswith(".png")]
        with open(f"{path}/out/scene_data/{written[0]}", "rb") as file:
            assert file.read() == data
        _assert_shows(scene)


def test_image_sequence():
    """Each frame has its own file."""
    from relief.exporter import export_frames

    with folder() as path:
        _save(f"{path}/shot_007.png")
        _save(f"{path}/shot_008.png")

        def load():
            image = bpy.data.images.load(f"{path}/shot_007.png")
            image.source = "SEQUENCE"
            return image

        scene, _, texture, _ = _stage(load)
        texture.image_user.frame_start, texture.image_user.frame_duration = 3, 2
        texture.image_user.frame_offset = 6
        for frame, name in ((3, "shot_007.png"), (4, "shot_008.png"), (9, "shot_008.png")):
            export_frames(scene, f"{path}/out/scene.gltf", [frame])
            with open(f"{path}/out/scene.gltf", encoding="utf-8") as file:
                assert name in file.read(), frame


def test_missing_file_is_warned_about():
    from scenes import assert_warns

    with folder() as path:
        name = _save(f"{path}/image.png")
        scene, _, _, _ = _stage(lambda: bpy.data.images.load(name))
        os.remove(name)
        assert_warns(scene, 'image "image.png"', "no file", "magenta")


def _missing_node(tree, **settings):
    """An Image Texture node of a file that is gone."""
    image = bpy.data.images.new("gone", 4, 4)
    image.source = "FILE"
    image.filepath = "/nowhere/gone.png"
    return add_image_node(tree, image, **settings)


def test_missing_files_are_magenta_in_every_use():
    """As a colour, an opacity, a number, a mask, a normal, a bump, a height and a lamp's colour."""
    from relief import compat

    scene = new_scene(96, 48)
    set_world((0.5, 0.6, 0.7))
    kinds = ("color", "opacity", "roughness", "mask", "normal", "bump", "height", "clipped")
    for i, use in enumerate(kinds):
        is_glossy = use == "roughness"
        material, tree, node = new_material(use, "ShaderNodeBsdfGlossy" if is_glossy else "ShaderNodeBsdfDiffuse")
        texture = _missing_node(tree, extension="CLIP" if use == "clipped" else "REPEAT")
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        color = texture.outputs["Color"]
        if use in {"color", "clipped"}:
            tree.links.new(color, node.inputs["Color"])
        elif use == "roughness":
            tree.links.new(color, node.inputs["Roughness"])
        elif use in {"opacity", "mask"}:
            mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
            tree.links.new(texture.outputs["Alpha"] if use == "opacity" else color, mix.inputs[0])
            tree.links.new(clear.outputs[0], mix.inputs[1])
            tree.links.new(node.outputs[0], mix.inputs[2])
            tree.links.new(mix.outputs[0], output.inputs["Surface"])
        elif use == "height":
            move = tree.nodes.new("ShaderNodeDisplacement")
            tree.links.new(color, move.inputs["Height"])
            tree.links.new(move.outputs[0], output.inputs["Displacement"])
            compat.set_displacement_method(material, "DISPLACEMENT")
        else:
            bend = tree.nodes.new("ShaderNodeNormalMap" if use == "normal" else "ShaderNodeBump")
            tree.links.new(color, bend.inputs["Color" if use == "normal" else "Height"])
            tree.links.new(bend.outputs["Normal"], node.inputs["Normal"])
        add_plane(1.8, material, (2 * (i % 4) - 3, 2 * (i // 4) - 1, 0))
    light = add_light("SPOT", (2, -1, 4), energy=300, spot_size=2)
    light.data.use_nodes = True
    tree = light.data.node_tree
    tree.links.new(_missing_node(tree).outputs["Color"], tree.nodes["Emission"].inputs["Color"])
    add_light("SUN", rotation=degrees(20, 30, 0), energy=1, angle=0)
    add_camera((0, 0, 9), lens=40)
    scene.relief.strict = False
    assert_agrees(scene, samples=64, block=4, tolerance=0.02)


def test_an_image_node_without_image_is_magenta():
    """As a colour, as a number, by its channels and alpha, and in a graph."""
    scene = new_scene()
    for i, output in enumerate(("Color", "Red", "Green", "Alpha", "Varied Color", "Varied Alpha")):
        material, tree, node = new_material(f"material {i}")
        image = tree.nodes.new("ShaderNodeTexImage")
        source = image.outputs["Alpha" if "Alpha" in output else "Color"]
        if "Varied" in output:
            noise, product = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeVectorMath")
            product.operation = "MULTIPLY"
            tree.links.new(noise.outputs["Fac"], product.inputs[0])
            tree.links.new(source, product.inputs[1])
            source = product.outputs[0]
        if output in {"Red", "Green"}:
            separate = tree.nodes.new("ShaderNodeSeparateColor")
            tree.links.new(source, separate.inputs["Color"])
            source = separate.outputs[output]
        tree.links.new(source, node.inputs["Color"])
        add_plane(1.8, material, (2 * (i % 3) - 2, 2 * (i // 3) - 1, 0))
    add_light("SUN", energy=3, angle=0)
    add_camera((0, 0, 9))
    assert_agrees(scene, block=4)
