"""Worlds: colours and lat-long images light and are seen as in Cycles."""

from scenes import (
    LINEAR,
    add_camera,
    add_sphere,
    asymmetric_pixels,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    new_image,
    new_scene,
    set_world,
    smooth_pixels,
)


def _stage(width=64, height=48):
    """A ball and the horizon: the surroundings are seen and light something."""
    scene = new_scene(width, height)
    add_sphere(1.0, diffuse((0.7, 0.7, 0.7)))
    add_camera((0, -5, 0.5), degrees(85, 0, 15), lens=20)
    return scene


def _image_world(turn=(0, 0, 0), kind="POINT", is_float=True, color_space=LINEAR, pixels=None):
    tree = set_world((1, 1, 1), 1.5)
    image = new_image(asymmetric_pixels(32, 16) if pixels is None else pixels, color_space, is_float)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    coordinate, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = kind
    mapping.inputs["Rotation"].default_value = turn
    tree.links.new(coordinate.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    return mapping


def test_color():
    scene = _stage()
    set_world((0.2, 0.5, 0.9), 1.7)
    assert_agrees(scene)


def test_color_without_nodes():
    scene = _stage()
    set_world((1, 1, 1))
    scene.world.use_nodes = False
    scene.world.color = (0.3, 0.2, 0.6)
    assert_agrees(scene)


def test_lat_long_image():
    scene = _stage()
    _image_world()
    assert_agrees(scene, samples=128, block=4)


def test_lat_long_image_turned():
    scene = _stage()
    _image_world(degrees(0, 0, 70))
    assert_agrees(scene, samples=128, block=4)


def test_lat_long_image_turned_as_texture():
    scene = _stage()
    _image_world(degrees(0, 0, 70), kind="TEXTURE")
    assert_agrees(scene, samples=128, block=4)


def test_srgb_image():
    """Neighbouring texels differ little: between them Cycles interpolates what is stored, relief what it means."""
    scene = _stage()
    _image_world(is_float=False, color_space="sRGB", pixels=smooth_pixels())
    assert_agrees(scene, samples=128, block=4, tolerance=0.01)


def test_a_turn_about_x_is_warned_about():
    scene = _stage()
    _image_world(degrees(20, 0, 0))
    assert_warns(scene, 'world "world"', "turned about X")


def test_a_volume_is_warned_about():
    scene = _stage()
    tree = set_world((0.2, 0.5, 0.9))
    volume = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(volume.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    assert_warns(scene, 'world "world"', "a volume")


def test_transparent_film():
    """Where nothing is, alpha is 0; elsewhere the picture stays."""
    import numpy as np
    import bpy
    from scenes import folder, render

    scene = _stage()
    set_world((0.2, 0.5, 0.9))
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"
    with folder() as path:
        picture = render(scene, "RELIEF", f"{path}/picture.exr")
        saved = bpy.data.images.load(f"{path}/picture.exr")
        rgba = np.array(saved.pixels[:]).reshape(48, 64, 4)
    # The camera looks past the ball, which is to the right of the middle.
    assert rgba[0, 0, 3] == 0 and rgba[24, 41, 3] == 1, (rgba[0, 0], rgba[24, 41])
    assert picture[47, 0].max() == 0 and picture[24, 41].min() > 0.05


def test_no_light_is_black():
    """Without any light a file would get some from the program; Blender's scenes do not."""
    from scenes import folder, render

    scene = _stage()
    with folder() as path:
        assert render(scene, "RELIEF", f"{path}/picture.exr").max() < 1e-15
