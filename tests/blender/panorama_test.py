"""Panoramic cameras are Cycles' own: all kinds, what they leave black, focus, clipping, passes, and what shaders know of them."""

import math

import bpy
import numpy as np

from camera_test import assert_eyes_agree
from pass_test import passes
from scenes import (
    IS_5_0,
    add_camera,
    add_sphere,
    assert_agrees,
    assert_warns,
    degrees,
    dice,
    folder,
    new_material,
    new_scene,
    render,
    set_world,
)


def _lens_of(camera):
    """Owner of the panoramic properties: Cycles' settings before 5.0."""
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def _around(width, height, kind, camera_settings=None, **settings):
    """Bright balls of many colours all around a camera that looks some way of its own."""
    scene = new_scene(width, height)
    set_world((0.1, 0.15, 0.25))
    for n in range(60):
        z = 1 - 2 * (n + 0.5) / 60
        turn = n * 2.399963
        place = [3 * math.sqrt(1 - z * z) * f(turn) for f in (math.cos, math.sin)] + [3 * z]
        color = [0.2 + 0.8 * (n >> bit & 1) for bit in range(3)]
        glow = new_material(f"glow {n}", "ShaderNodeEmission", Color=(*color, 1), Strength=1.0)[0]
        add_sphere(0.2 + 0.1 * (n % 4), glow, place, segments=16)
    camera = add_camera((0.2, -0.1, 0.15), degrees(75, 10, 35), type="PANO", **(camera_settings or {}))
    lens = _lens_of(camera.data)
    lens.panorama_type = kind
    for name, value in settings.items():
        setattr(lens, name, value)
    return scene, camera.data


def test_equirectangular():
    assert_agrees(_around(64, 32, "EQUIRECTANGULAR")[0], block=4)


def test_equirectangular_part():
    part = {"latitude_min": -0.4, "latitude_max": 1.2, "longitude_min": -2.5, "longitude_max": 0.7}
    assert_agrees(_around(64, 40, "EQUIRECTANGULAR", **part)[0], block=4)


def test_equidistant():
    assert_agrees(_around(48, 48, "FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(220))[0], block=4)


def test_equidistant_in_a_wide_picture():
    """Its circle becomes an ellipse."""
    assert_agrees(_around(64, 40, "FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(150))[0], block=4)


def test_equisolid():
    scene, _ = _around(64, 40, "FISHEYE_EQUISOLID", fisheye_lens=10.5, fisheye_fov=math.radians(180))
    assert_agrees(scene, block=4)


def test_equisolid_portrait():
    scene, _ = _around(40, 64, "FISHEYE_EQUISOLID", {"sensor_width": 22}, fisheye_lens=8, fisheye_fov=math.radians(140))
    assert_agrees(scene, block=4)


def test_equisolid_fitted_by_height_with_wide_pixels():
    sensor = {"sensor_fit": "VERTICAL", "sensor_height": 20}
    scene, _ = _around(64, 40, "FISHEYE_EQUISOLID", sensor, fisheye_lens=8, fisheye_fov=math.radians(200))
    scene.render.pixel_aspect_x = 1.5
    assert_agrees(scene, block=4)


def test_polynomial():
    lens = {f"fisheye_polynomial_k{i}": k for i, k in enumerate((0, -0.05, -2e-4, 1e-5, 1e-7))}
    assert_agrees(_around(64, 40, "FISHEYE_LENS_POLYNOMIAL", fisheye_fov=math.radians(170), **lens)[0], block=4)


def test_mirror_ball():
    assert_agrees(_around(48, 48, "MIRRORBALL")[0], block=4)


def test_cube_face():
    assert_agrees(_around(48, 48, "EQUIANGULAR_CUBEMAP_FACE")[0], block=4)


def test_cylindrical():
    if not IS_5_0:
        return
    scene, data = _around(64, 40, "CENTRAL_CYLINDRICAL")
    data.central_cylindrical_range_v_min, data.central_cylindrical_range_v_max = -0.5, 1.5
    data.central_cylindrical_range_u_min, data.central_cylindrical_range_u_max = -1.0, 2.0
    data.central_cylindrical_radius = 1.2
    assert_agrees(scene, block=4)


def test_shift():
    """By parts of either side, not of the longer one as in other cameras."""
    assert_agrees(_around(64, 32, "EQUIRECTANGULAR", {"shift_x": 0.2, "shift_y": 0.1})[0], block=4)
    assert_agrees(_around(40, 64, "FISHEYE_EQUISOLID", {"shift_x": 0.1, "shift_y": -0.2})[0], block=4)


def test_in_a_viewport():
    """What is seen within the camera's frame is the picture, however large the frame is in the view."""
    from relief.export.camera import Frame, window_of
    from relief.viewport import panorama_in_view

    _, data = _around(64, 32, "EQUIRECTANGULAR", {"shift_x": 0.2, "shift_y": 0.1})
    frame = window_of(data, (0.2, 0.1), Frame(64, 32, 1.0))
    own = {"type": "equirectangular", "longitude": [-math.pi, math.pi], "latitude": [-math.pi / 2, math.pi / 2]}
    for size in (1.0, 0.5):
        sides = (frame.half_height * frame.aspect, frame.half_height)
        projection = np.diag([size / sides[0], size / sides[1], 1.0, 0.0])
        # The frame is in the view's middle: the window of the view is moved as far as the frame's own.
        middle = [shift * size for shift in frame.shift]
        value = panorama_in_view(data, frame, projection, middle)
        panorama = value["panorama"]
        assert np.allclose(panorama.pop("window"), 1 / size), value
        assert np.allclose(value["shift"], (0.2 * size, 0.1 * size)), value
        assert panorama.keys() == own.keys() and all(np.allclose(panorama[k], own[k]) for k in ("longitude", "latitude"))


def test_clipping():
    scene, _ = _around(64, 32, "EQUIRECTANGULAR", {"clip_start": 2.75, "clip_end": 3.1})
    assert_agrees(scene, block=4)


def _out_of_focus(scene, data, blades):
    data.lens = 50
    data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 1.0, 0.08
    data.dof.aperture_blades, data.dof.aperture_rotation, data.dof.aperture_ratio = blades, 0.4, 1.5
    assert_agrees(scene, block=4, samples=64)


def test_depth_of_field():
    _out_of_focus(*_around(64, 32, "EQUIRECTANGULAR"), 0)


def test_depth_of_field_with_blades():
    _out_of_focus(*_around(48, 48, "FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(180)), 3)


def test_depth_of_field_with_blades_by_a_mirror_ball():
    _out_of_focus(*_around(48, 48, "MIRRORBALL"), 3)


def test_motion_blur():
    scene, _ = _around(64, 32, "EQUIRECTANGULAR")
    scene.frame_set(1)
    scene.camera.keyframe_insert("rotation_euler", frame=1)
    scene.camera.rotation_euler.z += 0.3
    scene.camera.keyframe_insert("rotation_euler", frame=2)
    for curve in _curves(scene.camera):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    assert_agrees(scene, block=4)


def _curves(animated):
    action = animated.animation_data.action
    if hasattr(action, "fcurves"):
        return action.fcurves
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves]


def _pictures(scene, *settings):
    """Channels of both engines' passes by their names, without the layer's: (height, width)."""
    layer = scene.view_layers[0]
    for name in settings:
        setattr(layer, name, True)
    out = []
    for engine in ("RELIEF", "CYCLES"):
        channels = passes(scene, engine, 64)
        out.append({key.removeprefix(f"{layer.name}."): value.astype(np.float64) for key, value in channels.items()})
    return out


def test_what_a_lens_does_not_show_is_black_and_covered():
    """With a transparent film as well, as in Cycles."""
    for is_transparent in (False, True):
        scene, _ = _around(48, 48, "FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(120))
        scene.render.film_transparent = is_transparent
        relief, cycles = _pictures(scene)
        for channel in "RGBA":
            ours, theirs = (picture[f"Combined.{channel}"] for picture in (relief, cycles))
            assert ours[0, 0] == theirs[0, 0] == (channel == "A"), (channel, ours[0, 0], theirs[0, 0])
            assert np.abs(ours - theirs).mean() < 0.02, channel


def test_depth_is_the_distance():
    scene, _ = _around(64, 32, "EQUIRECTANGULAR")
    relief, cycles = _pictures(scene, "use_pass_z", "use_pass_mist")
    seen = (relief["Depth.Z"] < 100) & (cycles["Depth.Z"] < 100)
    assert seen.mean() > 0.1
    # Cycles takes one sample; by the axis balls at the side would be at 0.
    assert np.median(np.abs(relief["Depth.Z"] - cycles["Depth.Z"])[seen]) < 0.05
    assert np.abs(relief["Mist.Z"] - cycles["Mist.Z"]).mean() < 0.01


def _glows_by(kind, node, output, **settings):
    scene, _ = _around(64, 40, kind, **settings)
    material, tree, emission = new_material("coordinates", "ShaderNodeEmission", Strength=1.0)
    source = tree.nodes.new(node)
    absolute = tree.nodes.new("ShaderNodeVectorMath")
    absolute.operation = "ABSOLUTE"
    tree.links.new(source.outputs[output], absolute.inputs[0])
    tree.links.new(absolute.outputs[0], emission.inputs["Color"])
    for thing in scene.objects:
        if thing.type == "MESH":
            thing.data.materials.clear()
            thing.data.materials.append(material)
    assert_agrees(scene, block=4)


def test_window_coordinates():
    _glows_by("EQUIRECTANGULAR", "ShaderNodeTexCoord", "Window")


def test_window_coordinates_by_a_mirror_ball():
    _glows_by("MIRRORBALL", "ShaderNodeTexCoord", "Window")


def test_window_coordinates_by_fisheyes():
    """Places in the picture. Cycles 3.4 has them mirrored, and those of polynomials are not those of its own rays."""
    for kind in ("FISHEYE_EQUIDISTANT", "FISHEYE_EQUISOLID", "FISHEYE_LENS_POLYNOMIAL", "EQUIANGULAR_CUBEMAP_FACE"):
        scene, _ = _around(48, 40, kind)
        material, tree, emission = new_material("window", "ShaderNodeEmission", Strength=1.0)
        source = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(source.outputs["Window"], emission.inputs["Color"])
        add_sphere(1, material, scene.camera.location, segments=64)
        with folder() as path:
            picture = render(scene, "RELIEF", f"{path}/picture.exr", samples=64)
        rows, columns = np.mgrid[0:40, 0:48]
        seen = picture.sum(axis=2) > 0
        seen &= np.hypot(rows - 19.5, columns - 23.5) < 19  # within the lens
        assert seen.mean() > 0.3, kind
        assert np.abs(picture[..., 0] - (columns + 0.5) / 48)[seen].max() < 0.01, kind
        assert np.abs(picture[..., 1] - (39.5 - rows) / 40)[seen].max() < 0.01, kind


def test_camera_coordinates():
    for kind in ("EQUIRECTANGULAR", "MIRRORBALL"):
        _glows_by(kind, "ShaderNodeTexCoord", "Camera")
        for output in ("View Vector", "View Z Depth", "View Distance"):
            _glows_by(kind, "ShaderNodeCameraData", output)


def _stereo():
    scene, data = _around(64, 32, "EQUIRECTANGULAR")
    scene.render.use_multiview = True
    data.stereo.interocular_distance, data.stereo.convergence_distance = 1.0, 5.0
    return scene, data.stereo


def test_stereoscopy():
    scene, stereo = _stereo()
    for convergence in ("OFFAXIS", "PARALLEL", "TOE"):
        stereo.convergence_mode = convergence
        assert_eyes_agree(scene)


def test_spherical_stereoscopy_is_warned_about():
    scene, stereo = _stereo()
    scene.render.engine, stereo.use_spherical_stereo = "RELIEF", True
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        assert "spherical stereoscopy" in str(error), error
        return
    raise AssertionError("a strict render said nothing")


def test_a_kind_that_is_not_understood_is_warned_about():
    if not IS_5_0:
        return
    scene, data = _around(64, 32, "EQUIRECTANGULAR")
    data.type = "CUSTOM"
    assert_warns(scene, "a camera of the kind custom")


def test_displacement_in_all_directions_is_diced():
    """What is behind a panoramic camera is as fine as what is before it."""
    scene, _ = _around(64, 32, "EQUIRECTANGULAR")
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=5)
    dome = bpy.context.object
    material, tree, emission = new_material("dome", "ShaderNodeEmission", Strength=1.0)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.5
    displacement = tree.nodes.new("ShaderNodeDisplacement")
    displacement.inputs["Scale"].default_value = 0.8
    tree.links.new(noise.outputs["Fac"], displacement.inputs["Height"])
    tree.links.new(displacement.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    absolute = tree.nodes.new("ShaderNodeVectorMath")
    absolute.operation = "ABSOLUTE"
    tree.links.new(geometry.outputs["True Normal"], absolute.inputs[0])
    tree.links.new(absolute.outputs[0], emission.inputs["Color"])
    dome.data.materials.append(material)
    from relief import compat

    compat.set_displacement_method(material, "DISPLACEMENT")
    dice(dome, scene)
    assert_agrees(scene, block=8, tolerance=0.05)
