"""Lenses: framing, shift, sensor fit, depth of field and clipping are Cycles' own."""

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    folder,
    new_material,
    new_scene,
    read_rgb,
    set_world,
)


def _stage(width, height, location=(2, -5, 4), rotation=(55, 0, 22), **settings):
    """Bright balls under an even sky: edges everywhere."""
    scene = new_scene(width, height)
    set_world((0.2, 0.3, 0.5))
    glow = new_material("glow", "ShaderNodeEmission", Color=(1, 0.6, 0.2, 1), Strength=1.0)[0]
    add_plane(6, diffuse((0, 0, 0)))
    for x in range(-2, 3):
        for y in range(-2, 3):
            add_sphere(0.25 + 0.04 * x, glow, (x, y, 0.3), segments=16)
    camera = add_camera(location, degrees(*rotation), **settings)
    return scene, camera


def test_perspective_landscape():
    assert_agrees(_stage(64, 40, lens=35)[0], block=4)


def test_perspective_portrait():
    assert_agrees(_stage(40, 64, lens=35)[0], block=4)


def test_sensor_fit_vertical():
    assert_agrees(_stage(64, 40, lens=30, sensor_fit="VERTICAL", sensor_height=20)[0], block=4)


def test_sensor_fit_horizontal_in_portrait():
    assert_agrees(_stage(40, 64, lens=30, sensor_fit="HORIZONTAL", sensor_width=30)[0], block=4)


def test_shift_landscape():
    assert_agrees(_stage(64, 40, lens=35, shift_x=0.15, shift_y=-0.1)[0], block=4)


def test_shift_portrait():
    assert_agrees(_stage(40, 64, lens=35, shift_x=-0.15, shift_y=0.2)[0], block=4)


def test_orthographic_with_shift():
    assert_agrees(_stage(64, 40, type="ORTHO", ortho_scale=5, shift_x=0.1, shift_y=0.05)[0], block=4)


def test_orthographic_portrait():
    assert_agrees(_stage(40, 64, type="ORTHO", ortho_scale=5)[0], block=4)


def test_a_quarter_of_a_pixel_is_noticed():
    """The comparison itself: framing that is off by so little must fail."""
    from scenes import assert_same_expectation, render_runs

    scene, camera = _stage(64, 40, lens=35)
    cycles = render_runs(scene, "CYCLES", 5, 32)
    camera.data.shift_x += 0.25 / 64
    relief = render_runs(scene, "RELIEF", 5, 32)
    try:
        assert_same_expectation(relief, cycles, 4)
    except AssertionError as error:
        assert "differ" in str(error), error
        return
    raise AssertionError("a shift of a quarter of a pixel was not noticed")


def test_clipping():
    assert_agrees(_stage(64, 40, lens=35, clip_start=5.0, clip_end=7.5)[0], block=4)


def test_scaled_camera():
    scene, camera = _stage(64, 40, lens=35)
    camera.scale = (2, 0.5, 3)
    assert_agrees(scene, block=4)


def _focus(camera, fstop):
    camera.data.dof.use_dof = True
    camera.data.dof.aperture_fstop = fstop
    camera.data.dof.focus_distance = 5.0


def test_depth_of_field():
    scene, camera = _stage(64, 40, lens=50)
    _focus(camera, 0.08)
    assert_agrees(scene, block=4, samples=32)


def test_depth_of_field_on_an_object():
    scene, camera = _stage(64, 40, lens=50)
    _focus(camera, 0.08)
    camera.data.dof.focus_object = next(o for o in scene.objects if o.location.y == 1 and o.location.x == 1)
    assert_agrees(scene, block=4, samples=32)


def test_depth_of_field_on_a_bone():
    scene, camera = _stage(64, 40, lens=50)
    _focus(camera, 0.08)
    bpy.ops.object.armature_add(location=(0, 6, 0))
    armature = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("far")
    bone.head, bone.tail = (0, -4, 0), (0, -4, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    camera.data.dof.focus_object, camera.data.dof.focus_subtarget = armature, "far"
    assert_agrees(scene, block=4, samples=32)


def test_depth_of_field_orthographic():
    scene, camera = _stage(64, 40, type="ORTHO", ortho_scale=5)
    _focus(camera, 2.0)
    assert_agrees(scene, block=4, samples=32)


def _bokeh(width, height, **settings):
    """A few small bright balls far out of focus: each is the shape of the aperture."""
    scene = new_scene(width, height)
    set_world((0.02, 0.02, 0.02))
    glow = new_material("glow", "ShaderNodeEmission", Color=(1, 0.6, 0.2, 1), Strength=30.0)[0]
    for x in (-1.8, 0, 1.8):
        for y in (-0.9, 0.9):
            add_sphere(0.15, glow, (x, y, -8), segments=12)
    camera = add_camera((0, 0, 0), (0, 0, 0), lens=50, **settings)
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = 2.0, 0.08
    return scene, camera.data.dof


def test_aperture_with_blades():
    scene, dof = _bokeh(64, 40)
    dof.aperture_blades = 5
    assert_agrees(scene, block=4, samples=256)


def test_aperture_that_is_turned():
    scene, dof = _bokeh(64, 40)
    dof.aperture_blades, dof.aperture_rotation = 3, 0.5
    assert_agrees(scene, block=4, samples=256)


def test_aperture_by_ratio():
    scene, dof = _bokeh(64, 40)
    dof.aperture_ratio = 2.5
    assert_agrees(scene, block=4, samples=256)


def test_aperture_of_all_at_once_orthographic():
    scene, dof = _bokeh(40, 64, type="ORTHO", ortho_scale=5)
    dof.aperture_fstop, dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 1.6, 4, -0.4, 0.6
    assert_agrees(scene, block=4, samples=256)


def _with_pixels(scene, x, y):
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = x, y
    return scene


def test_wide_pixels():
    assert_agrees(_with_pixels(_stage(64, 40, lens=35, shift_x=0.1, shift_y=0.05)[0], 1.5, 1), block=4)


def test_high_pixels_that_make_a_portrait():
    """The sensor's side that counts is chosen by the picture's true shape: 64 × 40 pixels are higher than wide here."""
    assert_agrees(_with_pixels(_stage(64, 40, lens=35, shift_x=0.1, shift_y=0.05)[0], 1, 2), block=4)


def test_wide_pixels_fitted_by_height():
    scene = _stage(64, 40, lens=30, sensor_fit="VERTICAL", sensor_height=20, shift_x=0.1)[0]
    assert_agrees(_with_pixels(scene, 1.4, 1), block=4)


def test_wide_pixels_orthographic():
    scene = _stage(40, 64, type="ORTHO", ortho_scale=5, shift_x=0.1, shift_y=0.05)[0]
    assert_agrees(_with_pixels(scene, 2, 1), block=4)


def test_wide_pixels_out_of_focus():
    scene, camera = _stage(64, 40, lens=50)
    _focus(camera, 0.08)
    assert_agrees(_with_pixels(scene, 1.5, 1), block=4, samples=32)


def _eyes(scene, engine):
    """Pictures of both eyes: {"L" or "R": (height, width, 3)}."""
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.engine = engine
    scene.relief.samples = scene.cycles.samples = 64
    with folder() as path:
        scene.render.filepath = f"{path}/picture.exr"
        bpy.ops.render.render(write_still=True)
        return {eye: read_rgb(f"{path}/picture_{eye}.exr") for eye in "LR"}


def assert_eyes_agree(scene):
    relief, cycles = _eyes(scene, "RELIEF"), _eyes(scene, "CYCLES")
    noise = 0.03
    for eye in "LR":
        assert np.sqrt(np.mean((relief[eye] - cycles[eye]) ** 2)) < noise, eye
    assert np.sqrt(np.mean((cycles["L"] - cycles["R"]) ** 2)) > 3 * noise, "both eyes see the same"


def test_stereoscopy():
    scene, camera = _stage(64, 40, lens=35)
    scene.render.use_multiview = True
    camera.data.stereo.interocular_distance, camera.data.stereo.convergence_distance = 1.0, 5.0
    for convergence in ("OFFAXIS", "PARALLEL", "TOE"):
        camera.data.stereo.convergence_mode = convergence
        assert_eyes_agree(scene)


def test_views_by_several_cameras():
    scene, camera = _stage(64, 40, lens=35)
    scene.render.use_multiview, scene.render.views_format = True, "MULTIVIEW"
    camera.name = "camera_L"
    other = add_camera((1, -5, 5), degrees(50, 0, 12), lens=30)
    other.name = "camera_R"
    scene.camera = camera
    scene.render.views["left"].camera_suffix, scene.render.views["right"].camera_suffix = "_L", "_R"
    assert_eyes_agree(scene)


def test_render_region():
    """A region is the window of the whole picture that it says it is."""
    import numpy as np
    from scenes import folder, render

    scene, _ = _stage(64, 40, lens=35)
    with folder() as path:
        whole = render(scene, "RELIEF", f"{path}/whole.exr")
        scene.render.use_border = scene.render.use_crop_to_border = True
        scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
        scene.render.border_min_y, scene.render.border_max_y = 0.1, 0.6
        part = render(scene, "RELIEF", f"{path}/part.exr")
    assert part.shape[:2] == (20, 32), part.shape
    # Its rows count from the bottom: 4 to 24 of 40.
    assert np.allclose(part, whole[16:36, 16:48], atol=1e-6)
