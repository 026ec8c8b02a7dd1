"""What a view layer leaves out, overrides and adds, as Cycles has it."""

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    folder,
    new_scene,
    render,
    set_file_format,
    set_world,
)


def _stage():
    scene = new_scene(48, 32)
    set_world((0.3, 0.4, 0.5))
    add_plane(4, diffuse((0.6, 0.4, 0.2)))
    add_light("SUN", rotation=degrees(30, 20, 0), energy=2, angle=0)
    add_camera((1, -5, 3), degrees(62, 0, 12), lens=30)
    return scene, scene.view_layers[0]


def test_without_environment():
    """It is not seen, and lights nothing."""
    scene, layer = _stage()
    layer.use_sky = False
    assert_agrees(scene, runs=2, samples=16)


def test_without_surfaces():
    scene, layer = _stage()
    layer.use_solid = False
    scene.relief.strict = False  # the program warns of a scene without meshes
    assert_agrees(scene, runs=2, samples=4)


def test_material_override():
    scene, layer = _stage()
    layer.material_override = diffuse((0.1, 0.2, 0.7), "override")
    assert_agrees(scene, runs=2, samples=32)


def test_samples():
    """Those of the view layer, if it has any; Cycles may ignore them, or take them as a bound."""
    from relief.export.settings import sampling_of

    scene, layer = _stage()
    scene.relief.use_cycles_settings, scene.cycles.samples = True, 32
    for own, use, expected in ((0, "USE", 32), (8, "USE", 8), (64, "USE", 64), (64, "BOUNDED", 32), (8, "IGNORE", 32)):
        layer.samples, scene.cycles.use_layer_samples = own, use
        assert sampling_of(scene, layer).samples == expected, (own, use)
    scene.relief.use_cycles_settings, scene.relief.samples, layer.samples = False, 16, 4
    assert sampling_of(scene, layer).samples == 4


def test_without_motion_blur():
    scene, layer = _stage()
    ball = add_sphere(0.5, location=(-1, 0, 1))
    ball.keyframe_insert("location", frame=0)
    ball.location.x = 1
    ball.keyframe_insert("location", frame=2)
    scene.frame_set(1)
    with folder() as path:
        still = render(scene, "RELIEF", f"{path}/still.exr")
        scene.render.use_motion_blur = True
        blurred = render(scene, "RELIEF", f"{path}/blurred.exr")
        layer.use_motion_blur = False
        again = render(scene, "RELIEF", f"{path}/again.exr")
    assert np.abs(blurred - still).max() > 0.05
    assert np.array_equal(still, again)


def test_each_layer_has_its_own():
    """Two layers of one file: all of it, and a ball alone without the environment."""
    from relief import exr

    scene, layer = _stage()
    layer.name = "all"
    other = scene.view_layers.new("ball")
    other.use_sky = False
    own = bpy.data.collections.new("own")
    scene.collection.children.link(own)
    ball = add_sphere(0.5, diffuse((0.1, 0.7, 0.1)), (0, 0, 1))
    for collection in list(ball.users_collection):
        collection.objects.unlink(ball)
    own.objects.link(ball)
    layer.layer_collection.children["own"].exclude = True
    set_file_format("OPEN_EXR_MULTILAYER", "32")
    with folder() as path:
        render_path = f"{path}/picture.exr"
        scene.render.engine, scene.render.filepath, scene.relief.samples = "RELIEF", render_path, 4
        bpy.ops.render.render(write_still=True)
        channels = exr.read(render_path).channels
    whole, alone = (np.stack([channels[f"{name}.Combined.{c}"] for c in "RGB"]) for name in ("all", "ball"))
    assert (whole[:, -1] > 0.2).all(), "no sky in the first layer"
    assert (alone[:, -1] == 0).all(), "a sky in the second layer"
    assert (alone[1] > 2 * alone[0] + 0.05).any() and not (whole[1] > 2 * whole[0] + 0.05).any()
