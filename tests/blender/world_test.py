"""Worlds: colours and lat-long images light and are seen as in Cycles."""

import bpy

from scenes import (
    LINEAR,
    add_camera,
    add_light,
    add_sphere,
    asymmetric_pixels,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    make_sharp,
    new_image,
    new_material,
    new_scene,
    set_bounces,
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
    """Without any light a file would get some from the program; Blender's scenes do not, whatever makes the world dark."""
    from scenes import folder, render

    def image_without_strength():
        _image_world()
        bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0

    for make in (lambda: None, lambda: set_world((0, 0, 0)), lambda: set_world((0.5, 0.4, 0.3), 0), image_without_strength):
        scene = _stage()
        make()
        with folder() as path:
            assert render(scene, "RELIEF", f"{path}/picture.exr").max() < 1e-15


def test_an_environment_node_without_image_is_magenta():
    scene = _stage()
    tree = set_world((1, 1, 1), 0.5)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    assert_agrees(scene)


#: What the engines make of the coarse facets of smooth balls where light grazes them; a hidden world is a third and more.
_FACETS = 0.04


def _hidden_from(*rays):
    """A diffuse, a glossy and a glass ball, and a world that some rays do not see."""
    from relief import compat

    scene = new_scene()
    glossy, _, glossy_node = new_material("glossy", "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1))
    glass, _, glass_node = new_material("glass", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), IOR=1.3)
    for node in (glossy_node, glass_node):
        make_sharp(node)
    add_sphere(0.9, diffuse((0.7, 0.5, 0.3)), (-2, 0, 0))
    add_sphere(0.9, glossy)
    add_sphere(0.9, glass, (2, 0, 0))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=1, angle=0)
    add_camera((0, -9, 0), degrees(90, 0, 0), lens=40)
    tree = set_world((0.3, 0.6, 0.9))
    world = bpy.context.scene.world
    for ray in rays:
        owner = getattr(world, "cycles_visibility", None)
        setattr(*((owner, ray) if owner is not None else (world, f"visible_{ray}")), False)
        assert not compat.sees_world(world, ray)
    set_bounces(scene, 8)
    return scene


def test_a_world_hidden_from_the_camera():
    assert_agrees(_hidden_from("camera"), samples=128, tolerance=_FACETS)


def test_a_world_hidden_from_diffuse_rays():
    assert_agrees(_hidden_from("diffuse"), samples=128, tolerance=_FACETS)


def test_a_world_hidden_from_glossy_rays():
    assert_agrees(_hidden_from("glossy"), samples=128, tolerance=_FACETS)


def test_a_world_hidden_from_transmission_rays():
    assert_agrees(_hidden_from("transmission"), samples=128, tolerance=_FACETS)
