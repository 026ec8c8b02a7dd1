"""Runs in a Blender with a window: shows the viewport rendered, edits, moves, leaves the mode; writes what it saw.

Not a test by itself: viewport_test.py starts it, with "follow", "quit", "panels", "warnings" or "render" and a folder. Steps run in Blender's timers,
since the window is only drawn between them. Pictures are copies of what is on the display: Blender's own screenshots are black on some.
"""

import json
import os
import shutil
import sys

import bpy
from mathutils import Matrix

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from scenes import add_light, add_plane, add_sphere, degrees, diffuse, set_world  # noqa: E402

_SESSION, _OUTPUT = sys.argv[-2:]

#: Seconds between two steps: at least, for the window to be drawn; at most, where the viewport has not come to rest.
_LEAST_SECONDS, _MOST_SECONDS = 1.0, 40.0
_POLL_SECONDS = 0.1

_seen = {}


def _area():
    areas = bpy.context.window_manager.windows[0].screen.areas
    # A render that fills the window hides them.
    views = [a for a in areas if a.type == "VIEW_3D"] or list(areas)
    return max(views, key=lambda a: a.width * a.height)


def _viewport():
    """The add-on's viewport in rendered shading; None outside of it."""
    if "relief" not in bpy.context.preferences.addons:
        return None
    from relief import viewport

    return next((v for v in viewport._alive if not v._is_stopped), None)


def _is_shown():
    """Whether the view shows a picture of the scene as it is, or there is none to come."""
    shown = _viewport()
    if shown is None:
        return True
    if shown._exporter is None:  # an error
        return shown._request is None
    return shown._samples > 0 and shown._picture is None


def _programs():
    """Process numbers of the programs that are children of this Blender."""
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            with open(f"/proc/{entry}/stat", encoding="utf-8") as file:
                fields = file.read().rsplit(")", 1)[1].split()
            with open(f"/proc/{entry}/cmdline", "rb") as file:
                command = file.read().split(b"\0")
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z" and b"serve" in command:
            found.append(int(entry))
    return found


def _shot(name):
    """Notes the picture and the state."""
    shutil.copy(os.path.join(_OUTPUT, "Xvfb_screen0"), os.path.join(_OUTPUT, f"{name}.xwd"))
    area = _area()
    folders = [n for n in os.listdir(bpy.app.tempdir) if n.startswith("relief_")]
    _seen[name] = {"programs": _programs(), "folders": folders, "view": [area.x, area.y, area.width, area.height]}


def _start():
    bpy.ops.preferences.addon_enable(module="relief")
    scene = bpy.context.scene
    for made in list(scene.objects):
        bpy.data.objects.remove(made)
    set_world((0.6, 0.7, 0.9))
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    add_sphere(1.0, diffuse((0.9, 0.1, 0.1), "red"), (0, 0, 1)).name = "ball"
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0)
    scene.render.engine = "RELIEF"
    scene.relief.preview_samples = 100000
    scene.view_settings.view_transform = "Standard"
    space = _area().spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_distance = 8
    space.shading.type = "RENDERED"


def _edit():
    bpy.data.materials["red"].node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1, 0.9, 0.1, 1)


def _grow():
    """Changes the mesh itself."""
    mesh = bpy.data.objects["ball"].data
    mesh.transform(Matrix.Scale(1.5, 4))
    mesh.update()


def _move():
    _area().spaces.active.region_3d.view_distance = 16


def _mistake():
    """A program that cannot be found must be told, not end Blender."""
    bpy.context.preferences.addons["relief"].preferences.binary = "/nowhere/relief"
    bpy.data.objects["ball"].location.x = 0.5


def _repair():
    bpy.context.preferences.addons["relief"].preferences.binary = ""
    bpy.data.objects["ball"].location.x = 1.0


def _leave():
    _area().spaces.active.shading.type = "SOLID"


def _show_panels(active, tab):
    """Shows one tab of the properties editor for an active object; mistakes in a panel end up on the console."""

    def show():
        made = bpy.data.objects[active]
        bpy.context.view_layer.objects.active = made
        for area in bpy.context.window_manager.windows[0].screen.areas:
            if area.type == "PROPERTIES":
                area.spaces.active.context = tab
                area.tag_redraw()
        _seen[f"{tab} of {active}"] = {}

    return show


def _panels():
    _start()
    _leave()
    material = bpy.data.materials["red"]
    tree = material.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(tree.nodes.new("ShaderNodeDisplacement").outputs[0], output.inputs["Displacement"])
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.scene.collection.objects.link(camera)
    # Panels are closed at first where there are many; a high editor shows the beginning of all of them.
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "OUTLINER":
            area.type = "PROPERTIES"


def _watch_previews():
    """Notes the colour in the middle of the first icon that Blender has the engine render: the Material tab's."""
    from relief import preview

    show = preview.result.show

    def note(engine, picture, *arguments):
        height, width = picture.height, picture.width
        middle = picture.layer("R", "G", "B").reshape(height, width, 3)[height // 3 : -height // 3, width // 3 : -width // 3]
        _seen.setdefault("preview", middle.mean(axis=(0, 1)).tolist())
        show(engine, picture, *arguments)

    preview.result.show = note


def _warn():
    """Materials of several balls have what relief does not know; the Render tab is shown."""
    bpy.context.scene.relief.use_cycles_settings = True
    for index in range(12):
        material = diffuse((0.2, 0.3, 0.8), f"pattern {index}")
        tree = material.node_tree
        tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs["Color"], tree.nodes["Diffuse BSDF"].inputs["Color"])
        add_sphere(0.2, material, (index * 0.3 - 2, -2, 0.2))
    _show_panels("ball", "RENDER")()
    _area().spaces.active.shading.type = "RENDERED"


def _note_status():
    _shot("warned")
    _seen["warned"]["status"] = _viewport()._status()


def _click():
    bpy.ops.relief.show_warnings("EXEC_DEFAULT", index=0)
    editors = [a for w in bpy.context.window_manager.windows for a in w.screen.areas if a.type == "TEXT_EDITOR"]
    _seen["editors"] = [editor.spaces.active.text.as_string() for editor in editors]


def _render():
    """F12 with so many samples that it does not end by itself; the picture fills the window."""
    _start()
    _leave()
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0, -7, 5), degrees(57, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 480, 320
    scene.relief.samples = 1000000
    bpy.context.preferences.view.render_display_type = "SCREEN"
    bpy.ops.render.render("INVOKE_DEFAULT")


def _note_job(name):
    """Notes the whole window, and whether a render is at work."""

    def note():
        _shot(name)
        window = bpy.context.window_manager.windows[0]
        _seen[name]["view"] = [0, 0, window.width, window.height]
        _seen[name]["is_rendering"] = bpy.app.is_job_running("RENDER")

    return note


def _finish():
    with open(os.path.join(_OUTPUT, "seen.json"), "w", encoding="utf-8") as file:
        json.dump(_seen, file)
    bpy.ops.wm.quit_blender()


def _steps():
    """What is done, one a timer's turn."""
    if _SESSION == "panels":
        yield _panels
        yield _watch_previews
        for active, tab in (
            ("light", "DATA"),
            ("camera", "DATA"),
            ("ball", "RENDER"),
            ("ball", "OUTPUT"),
            ("ball", "VIEW_LAYER"),
            ("ball", "SCENE"),
            ("ball", "WORLD"),
            ("ball", "OBJECT"),
            ("ball", "DATA"),
            ("ball", "MATERIAL"),
        ):
            yield _show_panels(active, tab)
        while "preview" not in _seen:  # the test has a limit
            yield lambda: None
        yield _finish
    if _SESSION == "warnings":
        yield _panels
        yield _warn
        yield _note_status
        yield _click
        yield lambda: _shot("clicked")
        yield _finish
    if _SESSION == "render":
        yield _render
        for number in range(4):
            yield _note_job(f"shot {number}")
        yield _finish
    yield _start
    if _SESSION == "quit":
        yield _finish
    yield lambda: _shot("rendered")
    yield _edit
    yield lambda: _shot("edited")
    yield _grow
    yield lambda: _shot("grown")
    yield _move
    yield lambda: _shot("moved")
    yield _mistake
    yield lambda: _shot("mistake")
    yield _repair
    yield lambda: _shot("repaired")
    yield _leave
    yield lambda: _shot("left")
    yield _finish


# The welcome screen comes after the command line and would hide the view.
bpy.context.preferences.view.show_splash = False
_todo = _steps()


_waited = _LEAST_SECONDS


def _next():
    """Blender's timer: does the next step once the last one's effect is seen."""
    global _waited
    _waited += _POLL_SECONDS
    if _waited < _LEAST_SECONDS or (not _is_shown() and _waited < _MOST_SECONDS):
        return _POLL_SECONDS
    step = next(_todo, None)
    if step is None:
        return None
    shown = _viewport()
    if shown is not None:
        shown._sum, shown._samples = None, 0  # what comes next has to be taken anew
    step()
    _waited = 0.0
    return _POLL_SECONDS


bpy.app.timers.register(_next, first_interval=1.0)
