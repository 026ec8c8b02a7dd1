"""One program for many pictures: what it is asked for, what it answers, and what becomes of a program that dies."""

import contextlib
import math
import os
import signal
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
    set_world,
)

_SCENE = (
    '{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"camera": 0}], "cameras": '
    '[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}], "extensionsUsed": ["RELIEF_environment"], '
    '"extensions": {"RELIEF_environment": {"color": [1, 1, 1]}}}'
)

#: Samples that no test waits for.
_ENDLESS = "16000000"


def _words(path, samples="1", size="8x8"):
    with open(f"{path}/s.gltf", "w", encoding="utf-8") as file:
        file.write(_SCENE)
    return [f"{path}/s.gltf", "-o", f"{path}/o.exr", "--resolution", size, "--spp", samples]


def _wait(request):
    """Its exit code."""
    end = time.monotonic() + 100
    while request.code is None and time.monotonic() < end:
        request.events(0.1)
    return request.code


def _server():
    from relief.server import Server

    return Server(), os.environ["RELIEF_BINARY"]


def test_requests_are_answered_by_one_program():
    server, binary = _server()
    with folder() as path:
        first = server.ask(binary, _words(path))
        assert _wait(first) == 0 and os.path.exists(f"{path}/o.exr")
        number = server._process._popen.pid
        failed = server.ask(binary, _words(path, "none"))
        assert _wait(failed) == 2 and "--spp" in failed.failure(), failed.failure()
        assert any("nothing to render" in text for text in first.warnings), first.warnings
        second = server.ask(binary, _words(path))
        assert _wait(second) == 0 and server._process._popen.pid == number
    server.stop()


def test_a_cancelled_request_ends_soon():
    server, binary = _server()
    with folder() as path:
        request = server.ask(binary, _words(path, _ENDLESS, "300x300"))
        while not request.events(0.1):
            assert request.code is None, request.failure()
        begin = time.monotonic()
        request.cancel()
        assert _wait(request) == 130 and time.monotonic() - begin < 8
    server.stop()


def test_a_program_that_dies_is_told_of_and_started_again():
    from relief.server import ServerEnded

    server, binary = _server()
    with folder() as path:
        request = server.ask(binary, _words(path, _ENDLESS))
        os.kill(server._process._popen.pid, signal.SIGKILL)
        try:
            _wait(request)
        except ServerEnded as error:
            assert "ended by signal 9" in str(error), error
        else:
            raise AssertionError("nobody was told")
        assert _wait(server.ask(binary, _words(path))) == 0
    server.stop()


@contextlib.contextmanager
def _watched():
    """Gathers what renders within kept of those before, (scene, preparation), and their programs."""
    from relief import final, server

    kept, programs = [], []
    read, ask = final._read_statistics, server.Server.ask

    def reading(path):
        statistics = read(path)
        kept.append((statistics["kept"]["scene"], statistics["kept"]["preparation"]))
        return statistics

    def asking(self, binary, words):
        request = ask(self, binary, words)
        programs.append(self._process._popen)
        return request

    final._read_statistics, server.Server.ask = reading, asking
    try:
        yield kept, programs
    finally:
        final._read_statistics, server.Server.ask = read, ask


def _lit_plane():
    scene = new_scene(24, 16)
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    add_light("POINT", (0, 0, 3), energy=100)
    scene.relief.samples = 1
    scene.render.engine = "RELIEF"
    return scene, add_camera()


def test_frames_of_an_animation_have_one_program():
    """Only the camera moves: after the first frame nothing is loaded or built."""
    from relief import session

    scene, camera = _lit_plane()
    camera.location.x = 0
    camera.keyframe_insert("location", frame=1)
    camera.location.x = 1
    camera.keyframe_insert("location", frame=3)
    scene.frame_start, scene.frame_end = 1, 3
    with _watched() as (kept, programs), folder() as path:
        scene.render.filepath = f"{path}/####"
        bpy.ops.render.render(animation=True)
    assert kept == [(False, False), (True, True), (True, True)], kept
    assert len(set(programs)) == 1, programs
    assert session._render_server is None


def test_persistent_data_stay_for_the_next_job():
    """Until they are not wanted any more, or another file is opened."""
    scene, _ = _lit_plane()
    with _watched() as (kept, programs), folder() as path:
        scene.render.use_persistent_data = True
        bpy.ops.render.render()
        bpy.ops.render.render()
        scene.render.use_persistent_data = False
        bpy.ops.render.render()
        bpy.ops.render.render()
        scene.render.use_persistent_data = True
        bpy.ops.render.render()
        assert programs[-1].poll() is None
        bpy.ops.wm.save_as_mainfile(filepath=f"{path}/a.blend", copy=True)
        bpy.ops.wm.open_mainfile(filepath=f"{path}/a.blend")
    assert kept == [(False, False), (True, True), (True, True), (False, False), (False, False)], kept
    assert [programs.index(program) for program in programs] == [0, 0, 0, 3, 4]
    assert all(program.poll() is not None for program in programs)


def _edits(scene):
    """(name, what an artist does), one after the other; each is seen in the picture."""
    plane = add_plane(8, diffuse((0.5, 0.5, 0.5)))
    ball = add_sphere(1, diffuse((0.8, 0.2, 0.2)), (-1, 0, 1), segments=8)
    wire = _wire(scene, (1, -1, 0.3))
    subdivision = ball.modifiers.new("s", "SUBSURF")
    key = _shape_key(plane)
    set_world((0.4, 0.4, 0.5))

    def move_vertex():
        ball.data.vertices[0].co.z += 1
        ball.data.update()

    def grow_hair():
        settings = plane.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system.settings
        settings.type, settings.count, settings.hair_length = "HAIR", 40, 1

    def add():
        other = add_sphere(0.7, diffuse((0.1, 0.8, 0.2)), (1.5, 1, 0.7), segments=8)
        other.modifiers.new("s", "SUBSURF")

    def copy():
        other = ball.copy()
        other.location.x = 2
        scene.collection.objects.link(other)

    def remove_and_add():
        bpy.data.objects.remove(wire)
        _wire(scene, (0, -2, 0.5))

    def coarsen():
        # Blender hears of the level in the viewport: if that of renders alone changes, Cycles keeps the old shape too.
        subdivision.render_levels = subdivision.levels = 0

    def make_flat():
        ball.data.polygons.foreach_set("use_smooth", [False] * len(ball.data.polygons))
        ball.data.update()

    def simplify():
        scene.render.simplify_subdivision_render = 0
        scene.render.use_simplify = True

    colour = ball.data.materials[0].node_tree.nodes["Diffuse BSDF"].inputs["Color"]
    yield "nothing", lambda: None
    yield "a vertex", move_vertex
    yield "a place", lambda: setattr(ball.location, "z", 1.6)
    yield "a modifier", coarsen
    yield "shading", make_flat
    yield "a curve", lambda: setattr(wire.data, "bevel_depth", 0.4)
    yield "a shape key", lambda: setattr(key, "value", 1)
    yield "a material", lambda: setattr(colour, "default_value", (0, 0, 1, 1))
    yield "a slot", lambda: ball.data.materials.__setitem__(0, diffuse((0.9, 0.8, 0.1)))
    yield "a new object", add
    yield "a copy", copy
    yield "one that is hidden", lambda: setattr(plane, "hide_render", True)
    yield "one that is shown", lambda: setattr(plane, "hide_render", False)
    yield "hair", grow_hair
    yield "longer hair", lambda: setattr(plane.particle_systems[0].settings, "hair_length", 0.4)
    yield "one in place of another", remove_and_add
    yield "another frame", lambda: scene.frame_set(5)
    yield "a simpler scene", simplify


def _wire(scene, location):
    """A thick circle."""
    curve = bpy.data.curves.new("wire", "CURVE")
    curve.bevel_depth = 0.2
    spline = curve.splines.new("POLY")
    spline.points.add(7)
    for i, point in enumerate(spline.points):
        point.co = (math.cos(i * math.pi / 4), math.sin(i * math.pi / 4), 0, 1)
    spline.use_cyclic_u = True
    thing = bpy.data.objects.new("wire", curve)
    thing.location = location
    scene.collection.objects.link(thing)
    return thing


def _shape_key(thing):
    """A key that lifts it, and one that does so by and by."""
    thing.shape_key_add(name="basis")
    slow, quick = thing.shape_key_add(name="slow"), thing.shape_key_add(name="quick")
    for block in (slow, quick):
        for point in block.data:
            point.co.z += 0.5
    for frame, value in ((1, 0), (9, 1)):
        slow.value = value
        slow.keyframe_insert("value", frame=frame)
    quick.value = 0
    return quick


def test_persistent_data_are_those_of_the_scene():
    """After every edit the next picture is that of a Blender that kept nothing."""
    scene = new_scene(48, 32)
    add_light("POINT", (1, -2, 4), energy=300)
    add_camera((0, -7, 5), degrees(55, 0, 0))
    kept = {}
    with folder() as path:
        scene.render.use_persistent_data = True
        for i, (name, edit) in enumerate(_edits(scene)):
            edit()
            kept[name] = render(scene, "RELIEF", f"{path}/kept.exr", samples=4)
            bpy.ops.wm.save_as_mainfile(filepath=f"{path}/{i}.blend", copy=True)
        scene.render.use_persistent_data = False
        fresh = dict(zip(kept, _pictures_of_files(path, len(kept))))
    last = None
    for name, picture in kept.items():
        assert np.abs(picture - fresh[name]).max() < 1e-3, (name, np.abs(picture - fresh[name]).max())
        assert last is None or np.abs(picture - last).max() > 0.01, name
        last = picture


def _pictures_of_files(path, count):
    """Of files 0.blend and so on, rendered by another Blender that keeps nothing."""
    script = (
        f"import bpy\nfor i in range({count}):\n"
        f"    bpy.ops.wm.open_mainfile(filepath=f'{path}/{{i}}.blend')\n"
        "    scene = bpy.context.scene\n"
        "    scene.render.use_persistent_data = False\n"
        f"    scene.render.filepath = f'{path}/{{i}}.exr'\n"
        "    bpy.ops.render.render(write_still=True)\n"
    )
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "9", "--addons", "relief"]
    subprocess.run([*command, "--python-expr", script], check=True, stdout=subprocess.DEVNULL)
    return [read_rgb(f"{path}/{i}.exr") for i in range(count)]
