"""Exported files: the same pictures as F12, shots whose frames change in every way, and how little is written again."""

import os
import subprocess
import time

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    degrees,
    diffuse,
    folder,
    new_scene,
    read_rgb,
    render,
    set_bounces,
    set_world,
)


def _shot():
    """Three frames: a camera that moves and zooms, balls that move, turn and stretch, a light that dims, a mesh that
    deforms, something that appears."""
    scene = new_scene(64, 48)
    set_bounces(scene, 2)
    set_world((0.3, 0.3, 0.4))
    scene.frame_start, scene.frame_end = 1, 3
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    camera = add_camera((0, -6, 4), degrees(57, 0, 0), lens=40)
    light = add_light("POINT", (1, -1, 3), energy=200, shadow_soft_size=0)
    moving = add_sphere(0.5, diffuse((0.9, 0.2, 0.1), "red"), (-1.5, 0, 0.6))
    turning = add_sphere(0.5, diffuse((0.1, 0.2, 0.9), "blue"), (1.5, 0, 0.6), segments=6)
    waving = add_plane(1.5, diffuse((0.2, 0.8, 0.2), "green"), (0, 0.5, 0.7), subdivisions=8)
    waving.modifiers.new("wave", "WAVE").height = 0.4
    appearing = add_sphere(0.3, diffuse((0.9, 0.9, 0.1), "yellow"), (0, -1.5, 0.3))
    for frame in (1, 3):
        camera.location.x = 0.2 * frame
        camera.data.lens = 40 + 2 * frame
        moving.location.z = 0.4 * frame
        turning.rotation_euler, turning.scale = degrees(0, 20 * frame, 70 * frame), (1, 1 + 0.2 * frame, 1)
        light.data.energy = 100 * frame
        appearing.hide_render = frame == 1
        camera.keyframe_insert("location", frame=frame)
        camera.data.keyframe_insert("lens", frame=frame)
        moving.keyframe_insert("location", frame=frame)
        turning.keyframe_insert("rotation_euler", frame=frame)
        turning.keyframe_insert("scale", frame=frame)
        light.data.keyframe_insert("energy", frame=frame)
        appearing.keyframe_insert("hide_render", frame=frame)
    return scene


def _run(*arguments):
    done = subprocess.run([os.environ["RELIEF_BINARY"], *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


def test_command_line_frames_are_those_of_f12():
    from relief.exporter import export_frames

    scene = _shot()
    scene.relief.samples = 8
    with folder() as path:
        warnings, _ = export_frames(scene, f"{path}/shot.gltf", [1, 2, 3])
        assert not warnings, warnings
        _run("render", f"{path}/shot.gltf", "--frames", "1-3", "-o", f"{path}/batch.####.exr", "--float")
        for frame in (1, 2, 3):
            scene.frame_set(frame)
            shown = render(scene, "RELIEF", f"{path}/f12.exr", samples=8)
            batch = read_rgb(f"{path}/batch.{frame:04d}.exr")
            # Rotations pass through quaternions: single rays may graze an edge on the other side.
            different = np.abs(shown - batch).max(axis=-1) > 1e-3
            assert different.mean() < 0.01, (frame, different.mean())
            assert shown.mean() > 0.05
            scene.frame_set(frame)
        frames = [read_rgb(f"{path}/batch.{f:04d}.exr") for f in (1, 2, 3)]
        assert np.abs(frames[0] - frames[1]).mean() > 0.005 < np.abs(frames[1] - frames[2]).mean()


def test_still_is_the_picture_of_f12():
    from relief.exporter import export_frames

    scene = _shot()
    scene.relief.samples = 8
    scene.frame_set(2)
    with folder() as path:
        export_frames(scene, f"{path}/still.gltf", [2])
        _run("render", f"{path}/still.gltf", "-o", f"{path}/still.exr", "--float")
        assert np.array_equal(read_rgb(f"{path}/still.exr"), render(scene, "RELIEF", f"{path}/f12.exr", samples=8))


def test_the_operator_exports_a_range():
    scene = _shot()
    with folder() as path:
        assert bpy.ops.export_scene.relief(
            filepath=f"{path}/shot.gltf", use_range=True, frame_start=1, frame_end=2
        ) == {"FINISHED"}
        assert "animations" in open(f"{path}/shot.gltf", encoding="utf-8").read()
        assert scene.render.engine != "RELIEF", "the scene's engine was changed"
        _run("info", f"{path}/shot.gltf")


def test_animation_renders_every_frame():
    """blender -a: three frames, each its own."""
    scene = _shot()
    scene.render.engine = "RELIEF"
    scene.relief.samples = 8
    with folder() as path:
        scene.render.filepath = f"{path}/####.exr"
        bpy.ops.render.render(animation=True)
        frames = [read_rgb(f"{path}/{f:04d}.exr") for f in (1, 2, 3)]
    assert np.abs(frames[0] - frames[1]).mean() > 0.005 < np.abs(frames[1] - frames[2]).mean()
    assert not [n for n in os.listdir(bpy.app.tempdir) if n.startswith("relief_")]


def test_a_second_frame_writes_what_changed():
    """After a frame with a large mesh, one in which only the camera moved costs a few kilobytes."""
    from relief import final

    scene = new_scene()
    set_world((1, 1, 1))
    add_plane(8, subdivisions=200)
    camera = add_camera()
    for frame in (1, 2):
        camera.location.x = 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.engine, scene.relief.samples = "RELIEF", 1
    written = []
    kept = final.export_scene

    def spy(*arguments):
        exported = kept(*arguments)
        written.append(exported.bytes_written)
        return exported

    final.export_scene = spy
    with folder() as path:
        scene.render.filepath = f"{path}/####.exr"
        bpy.ops.render.render(animation=True)
    final.export_scene = kept
    assert written[0] > 1e6 and written[1] < 5000, written


def _export_seconds(scene):
    from relief.exporter import export_frames

    with folder() as path:
        begin = time.perf_counter()
        export_frames(scene, f"{path}/scene.gltf", [1])
        seconds = time.perf_counter() - begin
        size = sum(os.path.getsize(f"{path}/scene_data/{n}") for n in os.listdir(f"{path}/scene_data"))
        return seconds, size


def test_a_million_vertices():
    scene = new_scene()
    add_camera()
    add_plane(8, subdivisions=1000)
    seconds, size = _export_seconds(scene)
    print(f"1,002,001 vertices: {seconds:.2f} s, {size / 1e6:.1f} MB")
    # Ten times what it takes, so that a busy machine passes and a loop over vertices in Python does not.
    assert seconds < 20


def test_a_hundred_thousand_instances():
    """Faces of a plane carry an object: one mesh, one node, 40 bytes an instance."""
    scene = new_scene()
    add_camera()
    carrier = add_plane(100, subdivisions=316)
    child = add_sphere(0.1, segments=8)
    child.parent = carrier
    carrier.instance_type = "FACES"
    seconds, size = _export_seconds(scene)
    print(f"99,856 instances: {seconds:.2f} s, {size / 1e6:.1f} MB")
    assert seconds < 30 and size < 12e6, (seconds, size)
