"""What cannot be rendered is left out of its frame with a word, and the rest is rendered."""

import math

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_image_node,
    add_light,
    add_plane,
    add_sphere,
    asymmetric_pixels,
    diffuse,
    folder,
    new_image,
    new_material,
    new_scene,
    render,
    set_world,
)


def _stage():
    """A floor under a grey sky, and a scene that says what it leaves out instead of failing."""
    scene = new_scene(32, 24)
    scene.relief.strict = False
    set_world((0.5, 0.5, 0.5))
    add_plane()
    add_camera()
    return scene


def _render(scene, samples=1):
    """(picture, warnings)."""
    from relief import report

    with folder() as path:
        picture = render(scene, "RELIEF", f"{path}/picture.exr", samples=samples)
    assert np.isfinite(picture).all()
    return picture, report.last_warnings[scene.name]


def _assert_left_out(make, *texts):
    """Fails unless a thing that `make` adds changes nothing of the picture but a warning with some texts."""
    scene = _stage()
    empty, warnings = _render(scene)
    assert not warnings, warnings
    make()
    picture, warnings = _render(scene)
    assert any(all(text in warning for text in texts) for warning in warnings), warnings
    assert np.array_equal(picture, empty), np.abs(picture - empty).max()


def test_a_scale_of_zero():
    for scale in ((0, 0, 0), (1, 0, 0)):
        _assert_left_out(lambda s=scale: setattr(add_sphere(), "scale", s), "Sphere", "scale of 0", "left out")


def test_a_place_that_is_not_finite():
    for x in (math.nan, math.inf, 1e30):
        _assert_left_out(lambda x=x: setattr(add_sphere().location, "x", x), "Sphere", "left out")


def test_vertices_that_are_not_finite():
    """Triangles that touch one are left out; all of them, if all touch."""

    def make():
        sphere = add_sphere(segments=8)
        sphere.data.vertices.foreach_set("co", [math.nan] * 3 * len(sphere.data.vertices))

    _assert_left_out(make, "Sphere", "26 of 26 vertices", "left out")
    scene = _stage()
    empty, _ = _render(scene)
    add_sphere(segments=8).data.vertices[3].co.x = math.nan
    picture, warnings = _render(scene)
    assert any("1 of 26 vertices" in warning for warning in warnings), warnings
    assert not np.array_equal(picture, empty)


def test_uv_and_colours_that_are_not_finite():
    scene = _stage()
    material, tree, node = new_material("textured")
    image = add_image_node(tree, new_image(asymmetric_pixels()))
    tree.links.new(image.outputs[0], node.inputs["Color"])
    add_sphere(0.5, material, segments=8).data.uv_layers[0].data[5].uv = (math.nan, 0)
    add_sphere(0.5, diffuse((math.nan, 0.5, 0.5), "coloured"))
    _, warnings = _render(scene)
    for texts in (("Sphere", "texture coordinates"), ("coloured", "Color")):
        assert any(all(text in warning for text in texts) for warning in warnings), warnings


def test_lights_that_are_not_finite():
    for kind in ("POINT", "SUN", "SPOT", "AREA"):
        _assert_left_out(lambda k=kind: setattr(add_light(k).location, "x", math.nan), "light", "transform", "left out")
        _assert_left_out(lambda k=kind: add_light(k, energy=math.nan), "light", "power", "left out")


def test_a_light_of_scale_zero_has_no_direction():
    _assert_left_out(lambda: setattr(add_light("SPOT"), "scale", (0, 0, 0)), "light", "scale of 0")
    scene = _stage()
    empty, _ = _render(scene)
    add_light("POINT", energy=1000, shadow_soft_size=0).scale = (0, 0, 0)  # needs none
    assert _render(scene)[0].mean() > 1.1 * empty.mean()


def test_a_camera_that_is_nowhere_is_reported():
    scene = _stage()
    for what, value in (("scale", (0, 0, 0)), ("location", (math.nan, 0, 0))):
        scene.camera = add_camera()
        setattr(scene.camera, what, value)
        try:
            _render(scene)
        except RuntimeError as error:
            assert "where the camera" in str(error), error
        else:
            raise AssertionError(f"a camera of {what} {value} was taken")


def test_empty_meshes_are_nothing():
    scene = _stage()
    empty, _ = _render(scene)
    add_sphere().data.clear_geometry()
    picture, warnings = _render(scene)
    assert not warnings and np.array_equal(picture, empty)


def test_a_flat_object_is_seen():
    """Scaled to nothing along one axis, as Cycles shows it."""
    scene = _stage()
    ball = add_sphere(1.5, diffuse((0.9, 0.1, 0.1), "red"), (0, 0, 1))
    ball.rotation_euler, ball.scale = (0.6, 0.2, 0.4), (1, 1, 0)
    picture, warnings = _render(scene, 64)
    assert not warnings, warnings
    with folder() as path:
        cycles = render(scene, "CYCLES", f"{path}/picture.exr", samples=64)
    red, meant = (p[..., 0] > 3 * p[..., 1] for p in (picture, cycles))
    assert meant.mean() > 0.05 and (red != meant).mean() < 0.02, (red.mean(), meant.mean())


def test_a_scale_animated_to_zero_does_not_end_the_animation():
    """In frames 1 and 3 a ball is there, in 2 it has shrunk to nothing."""
    from relief import report

    scene = _stage()
    ball = add_sphere(1.0, diffuse((0.9, 0.1, 0.1), "red"), (0, 0, 1))
    for frame, scale in ((1, 1), (2, 0), (3, 1)):
        ball.scale = (scale,) * 3
        ball.keyframe_insert("scale", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.engine, scene.relief.samples = "RELIEF", 1
    told = set()
    kept = report.publish

    def publish(name, warnings, *known):
        told.update((scene.frame_current, warning) for warning in warnings)
        kept(name, warnings, *known)

    report.publish = publish
    try:
        with folder() as path:
            scene.render.filepath = f"{path}/####.exr"
            bpy.ops.render.render(animation=True)
            from scenes import read_rgb

            red = [(read_rgb(f"{path}/{f:04d}.exr")[12, 16] * (1, -3, 0)).sum() > 0 for f in (1, 2, 3)]
    finally:
        report.publish = kept
    assert red == [True, False, True], red
    assert told == {(2, 'object "Sphere": a scale of 0; it is left out of this frame')}, told
