"""One program for many pictures: what it is asked for, what it answers, and what becomes of a program that dies."""

import contextlib
import os
import signal
import time

import bpy

from scenes import add_camera, add_light, add_plane, diffuse, folder, new_scene

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
