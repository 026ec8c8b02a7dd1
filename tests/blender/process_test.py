"""The program fails, hangs, is missing or is cancelled: Blender lives, the artist is told, no files are left."""

import contextlib
import os
import signal
import stat
import subprocess
import time
from types import SimpleNamespace

import bpy
import numpy as np

from scenes import IS_5_0, add_camera, add_plane, folder, new_scene, render, set_file_format, set_world


def _scene():
    scene = new_scene()
    set_world((1, 1, 1))
    add_plane()
    add_camera()
    return scene


@contextlib.contextmanager
def _program(script):
    """Puts a shell script in the program's place; it answers --version itself."""
    with folder() as path:
        name = os.path.join(path, "relief")
        with open(name, "w", encoding="utf-8") as file:
            file.write(f'#!/bin/bash\nif [ "$1" = --version ]; then echo relief 0.1.9; exit; fi\n{script}\n')
        os.chmod(name, stat.S_IRWXU)
        kept = os.environ.get("RELIEF_BINARY")
        os.environ["RELIEF_BINARY"] = name
        try:
            yield name
        finally:
            os.environ["RELIEF_BINARY"] = kept


def _failure(scene):
    """What a render that fails tells the artist."""
    with folder() as path:
        try:
            render(scene, "RELIEF", f"{path}/picture.exr")
        except RuntimeError as error:
            assert not os.path.exists(f"{path}/picture.exr"), "a picture was saved all the same"
            return str(error)
    raise AssertionError("nothing was reported")


def _assert_clean():
    left = [n for n in os.listdir(bpy.app.tempdir) if n.startswith("relief_")]
    assert not left, left


def test_a_crash_is_reported():
    scene = _scene()
    with _program("kill -SEGV $$"):
        assert "ended by signal 11" in _failure(scene)
    _assert_clean()


def test_an_error_is_reported_in_the_programs_words():
    scene = _scene()
    with _program("echo 'relief: the disk is full' >&2; exit 1"):
        assert "the disk is full" in _failure(scene)
    _assert_clean()


def test_a_broken_picture_is_reported():
    scene = _scene()
    value = r"""value_of() { [[ $line =~ \"$1\",\ \"([^\"]*)\" ]] && echo "${BASH_REMATCH[1]}"; }; read -r line"""
    answer = """echo '{"event": "end", "id": 1, "exit_code": 0}'; read -r line"""
    with _program(f"{value}\necho nonsense > $(value_of -o)\necho {{}} > $(value_of --stats)\n{answer}"):
        assert "not an uncompressed" in _failure(scene)
    _assert_clean()


def test_a_missing_program_is_reported():
    scene = _scene()
    kept = os.environ.pop("RELIEF_BINARY")
    path = os.environ["PATH"]
    os.environ["PATH"] = "/nowhere"
    try:
        assert "was not found" in _failure(scene)
    finally:
        os.environ["RELIEF_BINARY"], os.environ["PATH"] = kept, path


def _refusal(content):
    """What is said of a file with this content in the program's place."""
    from relief import process

    with folder() as path:
        name = os.path.join(path, "relief")
        with open(name, "wb") as file:
            file.write(content)
        os.chmod(name, stat.S_IRWXU)
        try:
            process.check_version(name)
        except process.ReliefError as error:
            return str(error).removeprefix(name)
    raise AssertionError("it was taken")


def test_another_version_is_reported():
    assert _refusal(b"#!/bin/sh\necho relief 7.2.0\n") == " is relief 7.2.0; this add-on needs 0.1.x"


def test_a_program_that_does_not_start_is_reported_with_the_reason():
    lacks = b"relief: error while loading shared libraries: libfmt.so.9: cannot open shared object file"
    assert _refusal(b"#!/bin/sh\necho '" + lacks + b"' >&2; exit 127\n") == " cannot be run: " + lacks.decode()
    old = b"libc.so.6: version GLIBC_2.36 not found"
    assert _refusal(b"#!/bin/sh\necho '" + old + b"\n" + old + b"' >&2; exit 1\n") == " cannot be run: " + old.decode()
    assert _refusal(b"#!/bin/sh\nkill -ILL $$\n") == " cannot be run: ended by signal 4"
    # The header of a program for ARM.
    arm = b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x02\x00\xb7\x00\x01\x00\x00\x00"
    assert _refusal(arm) == " cannot be run: Exec format error"


def test_the_preference_wins():
    scene = _scene()
    with _program("echo 'relief: from the preference' >&2; exit 1") as name:
        os.environ["RELIEF_BINARY"] = "/nowhere/relief"
        bpy.context.preferences.addons["relief"].preferences.binary = name
        assert "from the preference" in _failure(scene)


def test_a_scene_without_camera_is_reported():
    scene = _scene()
    scene.camera = None
    # Blender asks for a camera before it asks an engine.
    assert "camera" in _failure(scene).lower()


def test_a_mistake_in_the_addon_is_reported():
    from relief import final

    scene = _scene()
    kept = final.export_scene
    final.export_scene = lambda *_, **__: 1 / 0
    try:
        assert "ZeroDivisionError" in _failure(scene)
    finally:
        final.export_scene = kept
    _assert_clean()


def test_a_program_that_does_not_listen_is_killed():
    """One that ignores being asked to end is ended within its patience, and soon."""
    from relief.process import Process

    begin = time.monotonic()
    with Process(["/bin/bash", "-c", "trap '' TERM; while true; do sleep 0.1; done"]) as process:
        time.sleep(0.3)
        code = process.end()
    assert code == -signal.SIGKILL and time.monotonic() - begin < 8


def test_cancel_keeps_what_was_rendered():
    """Ctrl-C in a rendering Blender: it ends soon, alive, with the picture so far; the program is gone, files too."""
    with folder() as path:
        script = (
            "import sys; sys.path.insert(0, sys.argv[-1]); import process_test, bpy; s = process_test._scene();"
            f"s.render.engine = 'RELIEF'; s.relief.samples = 16000000; s.render.filepath = '{path}/out.exr';"
            "bpy.ops.render.render(write_still=True); print('ALIVE', flush=True)"
        )
        # Session temporary folders go where TMPDIR says.
        environment = {**os.environ, "TMPDIR": path}
        here = os.path.dirname(os.path.abspath(__file__))
        # Blender 5 tells how a render comes on only when asked.
        log = ["--log", "render", "--log-level", "info"] if IS_5_0 else []
        command = [bpy.app.binary_path, "-b", "--factory-startup", *log, "--python-expr", script, "--", here]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        blender = subprocess.Popen(command, text=True, env=environment, **pipes)
        try:
            lines = []
            for line in blender.stdout:
                lines.append(line)
                if "Sample" in line:
                    blender.send_signal(signal.SIGINT)
                    break
            begin = time.monotonic()
            rest, _ = blender.communicate(timeout=30)
        finally:
            blender.kill()
        assert time.monotonic() - begin < 10, "cancelling took too long"
        assert "ALIVE" in rest, "".join(lines) + rest
        assert not [n for n in _all_files(path) if "relief_" in n], _all_files(path)


def test_a_hung_program_is_ended_by_cancelling():
    """Ctrl-C while the program neither works nor listens: it is killed, Blender lives on, no files are left."""
    with _program("trap '' TERM; while true; do sleep 0.1; done") as name, folder() as path:
        script = (
            "import sys; sys.path.insert(0, sys.argv[-1]); import process_test, bpy; s = process_test._scene();"
            "s.render.engine = 'RELIEF'; print('STARTS', flush=True); bpy.ops.render.render(); print('ALIVE', flush=True)"
        )
        environment = {**os.environ, "TMPDIR": path}
        here = os.path.dirname(os.path.abspath(__file__))
        command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-expr", script, "--", here]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        blender = subprocess.Popen(command, text=True, env=environment, **pipes)
        try:
            while not _programs(name):
                assert blender.poll() is None
                time.sleep(0.1)
            blender.send_signal(signal.SIGINT)
            output, _ = blender.communicate(timeout=60)
        finally:
            blender.kill()
        assert "ALIVE" in output, output
        assert not _programs(name)
        assert not [n for n in _all_files(path) if "relief_" in n], _all_files(path)


def _programs(name):
    """Numbers of the processes that render with a program."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError), open(f"/proc/{entry}/cmdline", "rb") as file:
            command = file.read().decode("utf-8", "replace").split("\0")
            if name in command and "serve" in command:
                found.append(int(entry))
    return found


def _all_files(path):
    return [os.path.join(where, name) for where, _, names in os.walk(path) for name in names]


def test_no_files_are_left():
    scene = _scene()
    with folder() as path:
        render(scene, "RELIEF", f"{path}/picture.exr")
    _assert_clean()


def test_the_picture_is_shown_while_it_is_rendered():
    """It is the one that is there in the end, with its passes, however often it was shown; nothing is left behind."""
    from relief import exr, final, result

    scene = _scene()
    scene.view_layers[0].use_pass_normal = scene.view_layers[0].relief.use_pass_samples = True
    scene.render.use_border, scene.render.border_min_x = True, 0.3
    scene.relief.samples = 200
    set_file_format("OPEN_EXR_MULTILAYER", "32")
    shown, kept = [], (final._is_watched, result.show)

    def show(engine, picture, *arguments):
        shown.append(picture.attributes["relief:samples"])
        kept[1](engine, picture, *arguments)

    with folder() as path:
        scene.render.engine, pictures = "RELIEF", []
        for is_watched in (False, True):
            final._is_watched, result.show = (lambda w=is_watched: w), show
            scene.render.filepath = f"{path}/{is_watched}.exr"
            bpy.ops.render.render(write_still=True)
            assert bool(shown) == is_watched, shown
            pictures.append(exr.read(scene.render.filepath).channels)
        final._is_watched, result.show = kept
    assert shown[0] == 1, shown
    assert pictures[0].keys() == pictures[1].keys() and len(pictures[0]) > 4, (pictures[0].keys(), pictures[1].keys())
    for name, values in pictures[0].items():
        assert np.array_equal(values, pictures[1][name]), name
    _assert_clean()


def test_waiting_does_not_hold_previews_up():
    """A picture that is long in coming, as on a busy machine, is followed by the next; one that takes work is not."""
    from relief import final

    def work():
        end = time.thread_time() + 0.8
        while time.thread_time() < end:
            pass

    def times_shown(action):
        shown = []
        preview = final._Preview("", lambda picture: shown.append(picture) or action())
        for _ in range(2):
            preview.refresh()
        return len(shown)

    kept, final.exr = final.exr, SimpleNamespace(read=lambda path: path)
    try:
        assert times_shown(lambda: time.sleep(0.8)) == 2
        assert times_shown(work) == 1
    finally:
        final.exr = kept


def test_numbers_of_the_render_are_in_the_picture():
    """Seconds, memory, seed and warnings can be read from the image's file."""
    scene = _scene()
    scene.relief.strict = False
    scene.render.use_motion_blur, scene.cycles.rolling_shutter_type = True, "TOP"
    with folder() as path:
        render(scene, "RELIEF", f"{path}/picture.exr", seed=5)
        with open(f"{path}/picture.exr", "rb") as file:
            data = file.read(20000)
    for name in ("relief.render_seconds", "relief.export_seconds", "relief.total_seconds", "relief.peak_memory_bytes"):
        assert name.encode() in data, name
    assert b"a rolling shutter" in data
