"""Worlds: colours and lat-long images light and are seen as in Cycles."""

import math

import bpy

from scenes import (
    IS_5_0,
    LINEAR,
    add_camera,
    add_image_node,
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


def test_coordinates_of_the_camera():
    """A gradient across the picture, which the ball shows as well; and a lens that is shifted."""
    for name in ("Window", "Camera"):
        scene = _stage()
        scene.camera.data.shift_x = 0.1
        tree = set_world((1, 1, 1))
        coordinate, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Rotation"].default_value = (0, 0, 0.5)
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(coordinate.outputs[name], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], gradient.inputs["Vector"])
        tree.links.new(gradient.outputs["Color"], tree.nodes["Background"].inputs["Color"])
        assert_agrees(scene, samples=16)


def test_color_without_nodes():
    scene = _stage()
    set_world((1, 1, 1))
    scene.world.use_nodes = False
    scene.world.color = (0.3, 0.2, 0.6)
    assert_agrees(scene)


def test_a_strength_that_takes_light_away():
    """Alone the picture would be all negative."""
    scene = _stage()
    add_light("POINT", (2, -3, 3), energy=3000)
    set_world((0.02, 0.01, 0.005), -1.0)
    assert_agrees(scene, samples=64)


def test_a_world_that_takes_light_away_in_parts():
    """Cycles' importance map takes negative means for densities, and loses some of the light: it does without here."""
    scene = _stage()
    tree = set_world((1, 1, 1))
    scene.world.cycles.sampling_method = "NONE"
    coordinate, parts, ramp = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "MapRange"))
    ramp.clamp = False
    ramp.inputs["From Min"].default_value, ramp.inputs["To Min"].default_value = -1, -0.6
    tree.links.new(coordinate.outputs["Generated"], parts.inputs[0])
    tree.links.new(parts.outputs["Z"], ramp.inputs["Value"])
    tree.links.new(ramp.outputs[0], tree.nodes["Background"].inputs["Color"])
    assert_agrees(scene, samples=64)


def test_an_image_that_takes_light_away():
    scene = _stage()
    _image_world()
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = -0.1
    add_light("POINT", (2, -3, 3), energy=3000)
    assert_agrees(scene, samples=64)


def test_lat_long_image():
    scene = _stage()
    _image_world()
    assert_agrees(scene, samples=64, block=4)


def test_lat_long_image_turned():
    scene = _stage()
    _image_world(degrees(0, 0, 70))
    assert_agrees(scene, samples=64, block=4)


def test_lat_long_image_turned_as_texture_long():
    scene = _stage()
    _image_world(degrees(0, 0, 70), kind="TEXTURE")
    assert_agrees(scene, samples=64, block=4)


def test_srgb_image():
    """Neighbouring texels differ little: between them Cycles interpolates what is stored, relief what it means."""
    scene = _stage()
    _image_world(is_float=False, color_space="sRGB", pixels=smooth_pixels())
    assert_agrees(scene, samples=64, block=4, tolerance=0.01)


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


#: Of a picture's mean: what interpolation leaves at the rim of the black ground, where a sky fades to a hundred thousandth.
_RIM = 2e-4

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
    assert_agrees(_hidden_from("camera"), samples=32, tolerance=_FACETS)


def test_a_world_hidden_from_diffuse_rays_long():
    assert_agrees(_hidden_from("diffuse"), samples=128, tolerance=_FACETS)


def test_a_world_hidden_from_glossy_rays_long():
    assert_agrees(_hidden_from("glossy"), samples=128, tolerance=_FACETS)


def test_a_world_hidden_from_transmission_rays_long():
    assert_agrees(_hidden_from("transmission"), samples=128, tolerance=_FACETS)


def _nodes(tree, *kinds):
    return [tree.nodes.new(f"ShaderNode{kind}") for kind in kinds]


def test_a_gradient_of_generated_coordinates():
    """Across turned axes: Generated is the direction, Z up."""
    scene = _stage()
    tree = set_world((1, 1, 1), 0.8)
    coordinate, mapping, gradient, ramp = _nodes(tree, "TexCoord", "Mapping", "TexGradient", "ValToRGB")
    mapping.inputs["Rotation"].default_value = degrees(20, 50, 30)
    mapping.inputs["Location"].default_value = (0.3, 0.4, 0.5)
    ramp.color_ramp.elements[0].color = (0.9, 0.2, 0.1, 1)
    ramp.color_ramp.elements[1].color = (0.1, 0.3, 0.9, 1)
    tree.links.new(coordinate.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    assert_agrees(scene, samples=64, block=4)


def test_directions():
    """Each output that is a direction, as its colour."""
    for kind, output in (("TexCoord", "Object"), ("TexCoord", "Normal"), ("NewGeometry", "Incoming")):
        scene = _stage(32, 24)
        tree = set_world((1, 1, 1))
        source, mapping = _nodes(tree, kind, "Mapping")
        mapping.inputs["Scale"].default_value = (0.5, 0.3, 0.4)
        mapping.inputs["Location"].default_value = (0.6, 0.6, 0.6)
        tree.links.new(source.outputs[output], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], tree.nodes["Background"].inputs["Color"])
        assert_agrees(scene, samples=16, block=4)


def test_clouds_long():
    scene = _stage()
    tree = set_world((1, 1, 1), 1.0)
    noise, ramp = _nodes(tree, "TexNoise", "ValToRGB")
    noise.inputs["Scale"].default_value = 3
    noise.inputs["Detail"].default_value = 4
    ramp.color_ramp.elements[0].position = 0.4
    ramp.color_ramp.elements[0].color = (0.1, 0.3, 0.8, 1)
    ramp.color_ramp.elements[1].position = 0.7
    tree.links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    strength = tree.nodes.new("ShaderNodeMath")
    strength.operation = "MULTIPLY_ADD"
    strength.inputs[1].default_value, strength.inputs[2].default_value = 2.0, 0.2
    tree.links.new(noise.outputs["Fac"], strength.inputs[0])
    tree.links.new(strength.outputs[0], tree.nodes["Background"].inputs["Strength"])
    assert_agrees(scene, samples=64, block=4)


def _mixed(factor=None):
    """Three backgrounds: two mixed, the third added to them."""
    tree = set_world((0.9, 0.3, 0.2), 1.5)
    first = tree.nodes["Background"]
    second, third, mix, add = _nodes(tree, "Background", "Background", "MixShader", "AddShader")
    second.inputs["Color"].default_value = (0.1, 0.4, 0.9, 1)
    second.inputs["Strength"].default_value = 0.7
    third.inputs["Color"].default_value = (0.05, 0.1, 0.02, 1)
    mix.inputs[0].default_value = 0.3
    tree.links.new(first.outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add.inputs[0])
    tree.links.new(third.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    if factor is not None:
        tree.links.new(factor(tree), mix.inputs[0])
    return tree


def test_backgrounds_mixed_and_added():
    scene = _stage()
    _mixed()
    assert_agrees(scene)


def test_backgrounds_mixed_by_height():
    """A factor beyond 0 and 1 is cut off. Where it bends there, the map rounds it between texels: by 0.4 % of a block."""

    def height(tree):
        coordinate, separate, scale = _nodes(tree, "TexCoord", "SeparateXYZ", "Math")
        scale.operation = "MULTIPLY_ADD"
        scale.inputs[1].default_value, scale.inputs[2].default_value = 2.5, 0.4
        tree.links.new(coordinate.outputs["Generated"], separate.inputs[0])
        tree.links.new(separate.outputs["Z"], scale.inputs[0])
        return scale.outputs[0]

    scene = _stage()
    _mixed(height)
    assert_agrees(scene, samples=64, block=4, tolerance=0.005)


def _by_camera_ray(tree):
    return tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]


def test_a_world_that_the_camera_does_not_see_by_light_path():
    """Nothing where the camera looks: that is said by visibility."""
    scene = _stage()
    tree = set_world((0.2, 0.5, 0.9))
    (mix,) = _nodes(tree, "MixShader")
    tree.links.new(_by_camera_ray(tree), mix.inputs[0])
    tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    assert_agrees(scene)


def test_another_world_for_the_camera():
    scene = _stage()
    _mixed(_by_camera_ray)
    assert_agrees(scene)


def test_a_strength_that_the_camera_sees_otherwise():
    """By a value, and behind what is transparent."""
    scene = _stage()
    tree = set_world((0.2, 0.5, 0.9))
    add, scale = _nodes(tree, "Math", "Math")
    add.operation, scale.operation = "ADD", "MULTIPLY"
    tree.links.new(_by_camera_ray(tree), scale.inputs[0])
    scale.inputs[1].default_value = 2.0
    tree.links.new(scale.outputs[0], add.inputs[0])
    tree.links.new(add.outputs[0], tree.nodes["Background"].inputs["Strength"])
    bpy.ops.mesh.primitive_plane_add(size=1, location=(0.2, -2, 0.7), rotation=degrees(80, 0, 0))
    pane = bpy.context.object
    pane.data.materials.append(bpy.data.materials.new("pane"))
    pane.active_material.use_nodes = True
    (glass,) = _nodes(pane.active_material.node_tree, "BsdfTransparent")
    glass.inputs["Color"].default_value = (0.8, 0.3, 0.6, 1)
    output = pane.active_material.node_tree.nodes["Material Output"]
    pane.active_material.node_tree.links.new(glass.outputs[0], output.inputs["Surface"])
    assert_agrees(scene)


def test_a_world_of_its_own_for_mirrors_is_warned_about():
    scene = _stage()
    _mixed(lambda tree: tree.nodes.new("ShaderNodeLightPath").outputs["Is Glossy Ray"])
    assert_warns(scene, 'world "world"', "Is Glossy Ray")


def _sky_world(strength=0.1, **settings):
    tree = set_world((1, 1, 1), strength)
    (sky,) = _nodes(tree, "TexSky")
    # By another name since 5.0.
    sky.sky_type = "SINGLE_SCATTERING" if IS_5_0 else "NISHITA"
    for name, value in settings.items():
        setattr(sky, "aerosol_density" if IS_5_0 and name == "dust_density" else name, value)
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return tree


def test_sky_at_dusk():
    """The sun's disk is in it, a hand's breadth above the horizon, where the camera does not look."""
    scene = _stage()
    _sky_world(0.2, sun_elevation=math.radians(6), sun_rotation=math.radians(120), sun_size=math.radians(2))
    assert_agrees(scene, samples=64, block=4, dark=_RIM)


def test_sky_without_disk_long():
    """Every setting that is not its default."""
    scene = _stage()
    settings = {"altitude": 2000, "air_density": 1.5, "dust_density": 3, "ozone_density": 4}
    _sky_world(0.2, sun_disc=False, sun_elevation=math.radians(2), sun_rotation=math.radians(-20), **settings)
    assert_agrees(scene, samples=64, block=4, dark=_RIM)


def test_a_small_sun():
    """Half a degree of sky gives most of the light, and casts a shadow."""
    scene = _stage()
    _sky_world(0.05, sun_elevation=math.radians(40), sun_rotation=math.radians(200), sun_intensity=0.5)
    assert_agrees(scene, samples=64, block=8, dark=_RIM)


def test_a_sun_past_the_zenith_long():
    scene = _stage()
    _sky_world(0.2, sun_disc=False, sun_elevation=math.radians(170), sun_rotation=math.radians(30))
    assert_agrees(scene, samples=64, block=4, dark=_RIM)


def test_a_tiny_sun_long():
    """Its disk is smaller than a texel of the map of the sky. Of one of 0.05 degrees Cycles loses 7 % of the light: in single
    precision 1 less its cosine has a digit or two."""
    scene = _stage()
    settings = {"sun_elevation": math.radians(40), "sun_rotation": math.radians(200), "sun_size": math.radians(0.2)}
    _sky_world(0.05, sun_intensity=0.5, **settings)
    assert_agrees(scene, samples=256, block=8, dark=_RIM)


def test_sky_of_multiple_scattering():
    """Each setting that is not its default; once with the sun's disk, once at dusk without."""
    if not IS_5_0:
        return
    densities = {"altitude": 2000, "air_density": 1.5, "aerosol_density": 2, "ozone_density": 3}
    for settings in (
        {"sun_elevation": math.radians(20), "sun_rotation": math.radians(200), "sun_size": math.radians(2)},
        {"sun_elevation": math.radians(-2), "sun_disc": False, **densities},
    ):
        scene = _stage()
        _sky_world(0.1, sky_type="MULTIPLE_SCATTERING", **settings)
        assert_agrees(scene, samples=256, block=8)


def test_hosek_wilkie_sky():
    """On the horizon, where it is held, the map rounds it between texels: by 0.4 % of a block."""
    scene = _stage()
    sky = {"sky_type": "HOSEK_WILKIE", "sun_direction": (0.3, -0.5, 0.4), "turbidity": 3.5, "ground_albedo": 0.7}
    _sky_world(0.3, **sky)
    assert_agrees(scene, samples=16, block=4, tolerance=0.005)


def test_hosek_wilkie_sky_of_a_sun_below_the_horizon_long():
    scene = _stage()
    _sky_world(10.0, sky_type="HOSEK_WILKIE", sun_direction=(0.3, 0.5, -0.4), turbidity=8.5)
    assert_agrees(scene, samples=64, block=4)


def test_preetham_sky():
    scene = _stage()
    sky = {"sky_type": "PREETHAM", "sun_direction": (0.3, -0.5, 0.4), "turbidity": 3.5}
    _sky_world(0.3, **sky)
    assert_agrees(scene, samples=64, block=4)


def test_an_image_turned_about_x():
    scene = _stage()
    _image_world(degrees(20, 0, 0))
    assert_agrees(scene, samples=16, block=4)


def test_a_mirror_ball():
    scene = _stage()
    _image_world(degrees(10, 30, 200), pixels=smooth_pixels())
    texture = next(n for n in bpy.context.scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment")
    texture.projection = "MIRROR_BALL"
    assert_agrees(scene, samples=16, block=4)


def test_an_image_and_a_colour_mixed():
    scene = _stage()
    tree = set_world((0.1, 0.2, 0.7), 1.5)
    first = tree.nodes["Background"]
    second, texture, mix = _nodes(tree, "Background", "TexEnvironment", "MixShader")
    texture.image = new_image(asymmetric_pixels(32, 16), LINEAR, True)
    tree.links.new(texture.outputs["Color"], second.inputs["Color"])
    tree.links.new(first.outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    assert_agrees(scene, samples=16, block=4)


def _image_in_world(**settings):
    """The world by an Image Texture node."""
    scene = _stage()
    tree = set_world((1, 1, 1))
    texture = add_image_node(tree, new_image(smooth_pixels(64, 32)), **settings)
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return scene, tree, texture


def test_image_textures_of_every_projection():
    for projection in ("FLAT", "SPHERE", "TUBE", "BOX"):
        scene, tree, texture = _image_in_world(projection=projection, projection_blend=0.3)
        coordinate = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinate.outputs["Generated"], texture.inputs["Vector"])
        print(projection)
        assert_agrees(scene, samples=16, tolerance=0.01)


def test_an_image_texture_without_coordinates():
    """A world has no uv map: it is the texel at the origin everywhere."""
    scene, tree, texture = _image_in_world()
    assert_agrees(scene, tolerance=0.01)


def test_missing_images_are_magenta():
    scene, tree, texture = _image_in_world(projection="SPHERE")
    texture.image.source = "FILE"
    texture.image.filepath = "/nowhere/gone.png"
    assert_warns(scene, 'image "image"', "no file", "magenta")
    assert_agrees(scene, tolerance=0.001)
