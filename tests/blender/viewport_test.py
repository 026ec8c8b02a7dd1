"""The viewport in a real window, on a display without a screen (Xvfb)."""

import json
import os
import shutil
import struct
import subprocess

import bpy
import numpy as np

from scenes import folder

_HERE = os.path.dirname(os.path.abspath(__file__))


def _pixels(path, view):
    """What the display showed of a part of the window: float (height, width, 3), top row first.

    @param  path  a copy of Xvfb's frame buffer: X11's XWD format, version 7, 32 bits a pixel
    @param  view  x, y of the lower left corner in the window, which fills the display; width, height
    """
    with open(path, "rb") as file:
        data = file.read()
    header_size, _, _, _, _, height = struct.unpack_from(">6I", data)
    bytes_per_line, num_colors = struct.unpack_from(">I", data, 48)[0], struct.unpack_from(">I", data, 76)[0]
    first = header_size + 12 * num_colors
    rows = np.frombuffer(data, np.uint8, height * bytes_per_line, first).reshape(height, bytes_per_line // 4, 4)
    x, y, view_width, view_height = view
    # Blue comes first. Blender counts rows from the bottom.
    return rows[height - y - view_height : height - y, x : x + view_width, 2::-1] / 255.0


def _share(pixels, channel):
    """Share of pixels in which one colour is far above the others."""
    others = np.delete(pixels, channel, axis=2).max(axis=2)
    return float((pixels[..., channel] > 1.8 * others + 0.05).mean())


def _run_session(name, path):
    """Runs viewport_session.py in a Blender with a window; returns what Blender said."""
    assert shutil.which("Xvfb"), "Xvfb is not installed"
    read, write = os.pipe()
    display = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp", "-fbdir", path],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as number:
            environment = {**os.environ, "DISPLAY": f":{number.readline().strip()}", "LIBGL_ALWAYS_SOFTWARE": "1"}
        environment["TMPDIR"] = path
        command = [bpy.app.binary_path, "--factory-startup", "--no-window-focus", "-p", "0", "0", "800", "600"]
        command += ["--python-exit-code", "9", "--python", os.path.join(_HERE, "viewport_session.py"), "--", name, path]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=200)
    finally:
        display.terminate()
        display.wait()
    output = done.stdout + done.stderr
    assert done.returncode == 0 and "Traceback" not in output, output
    return output


def _processes_with(text):
    """Command lines of running processes that have a text in them."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open(f"/proc/{entry}/cmdline", "rb") as file:
                    command = file.read().decode("utf-8", "replace")
            except OSError:
                continue
            if text in command:
                found.append(command)
    return found


def test_quitting_in_the_middle_leaves_nothing():
    """Blender ends while its viewport renders: so does the program, and its files go."""
    with folder() as path:
        _run_session("quit", path)
        assert not _processes_with(f"{path}/blender_"), _processes_with(path)
        left = [n for _, folders, _ in os.walk(path) for n in folders if n.startswith("relief_")]
        assert not left, left


def test_rendered_shading_follows_the_scene():
    """A red ball is shown, painted green, made larger, seen from afar; an error is survived; leaving ends the program."""
    with folder() as path:
        output = _run_session("follow", path)
        with open(f"{path}/seen.json", encoding="utf-8") as file:
            seen = json.load(file)
        pixels = {name: _pixels(f"{path}/{name}.xwd", state["view"]) for name, state in seen.items()}
    red, green = ({n: _share(p, c) for n, p in pixels.items()} for c in (0, 1))
    print("red", red, "green", green, seen)
    # Shares of the whole 3D view, its borders included.
    assert red["rendered"] > 0.005 and green["rendered"] < 0.001
    assert green["edited"] > 0.005 and red["edited"] < 0.002
    assert 2.0 < green["grown"] / green["edited"] < 2.5
    assert 0.1 < green["moved"] / green["grown"] < 0.5
    assert "/nowhere/relief" in output
    assert green["repaired"] > 0.001
    # Between two runs there may be none: one of the pictures shows one.
    assert seen["rendered"]["folders"] and any(state["programs"] for state in seen.values())
    assert not seen["left"]["programs"] and not seen["left"]["folders"], seen["left"]


def test_the_viewport_and_the_panel_tell_of_warnings():
    """The status says how many there are; the panel draws them; a click shows all in a text editor."""
    with folder() as path:
        output = _run_session("warnings", path)
        with open(f"{path}/seen.json", encoding="utf-8") as file:
            seen = json.load(file)
    assert "12 warnings" in seen["warned"]["status"], seen
    assert len(seen["editors"]) == 1 and seen["editors"][0].count("pattern ") == 12, seen
    assert output.count("relief: warning: ") == 12, output  # each once, however often the view is drawn
    assert "rna_uiItemR" not in output and "Error" not in output, output


def _noise(pixels):
    """How much pixels differ from their neighbours."""
    return float(np.abs(np.diff(pixels, axis=1)).mean())


def test_f12_shows_the_picture_as_it_refines():
    """While a render is at work, the window shows a red ball, with less and less noise. Then Blender is ended."""
    with folder() as path:
        _run_session("render", path)
        assert not _processes_with(f"{path}/blender_"), _processes_with(path)
        with open(f"{path}/seen.json", encoding="utf-8") as file:
            seen = json.load(file)
        shots = [_pixels(f"{path}/{name}.xwd", s["view"]) for name, s in seen.items() if s["is_rendering"]]
    assert len(shots) == 4, seen
    red, noise = [_share(shot, 0) for shot in shots], [_noise(shot) for shot in shots]
    print("red", red, "noise", noise)
    assert red[-1] > 0.02, "the picture is not shown"
    assert noise[-1] < noise[0] or red[0] < 0.01, "the picture does not change"


def test_panels_draw():
    """Every tab of the properties editor, for a mesh, a light and a camera: no panel fails, and a red ball's icon is red."""
    with folder() as path:
        output = _run_session("panels", path)
        with open(f"{path}/seen.json", encoding="utf-8") as file:
            seen = json.load(file)
    assert len(seen) == 11
    red, green, blue = seen["preview"]
    assert red > 1.8 * max(green, blue), seen["preview"]
    assert "rna_uiItemR" not in output and "Error" not in output, output
