# SPDX-License-Identifier: GPL-3.0-or-later
"""One final render: export, run the program, take its picture over. Errors are raised, engine.py tells them."""

import json
import os
import time

import bpy
import numpy as np

from . import exr, report, result, session
from .export.camera import Frame, camera_json
from .export.motion import Motion, shutter_of
from .export.scene import DATA_FOLDER, StoredMeshes, View, export_scene, write_view
from .export.settings import denoiser_of, sampling_of, warn_unread_settings
from .preferences import find_checked_binary
from .report import ReliefError, Report, say

_POLL_SECONDS = 0.05

#: How long the program may take to save what it has when the artist cancels.
_PATIENCE_SECONDS = 5.0

#: Part of the time that pictures may take that are shown while rendering, and seconds more for the first ones.
_PREVIEW_SHARE, _FIRST_PREVIEW_SECONDS = 0.02, 0.5


def render(engine, depsgraph):
    """Renders the depsgraph's view layer into Blender's result.

    @param  engine     the RenderEngine, for progress, cancelling and the result
    @param  depsgraph  evaluated for rendering
    @error  ReliefError
    """
    begin = time.perf_counter()
    meshes = engine.meshes.of(depsgraph)
    binary = find_checked_binary()
    scene = depsgraph.scene
    warnings = Report(strict=scene.relief.strict)
    warn_unread(scene, warnings)
    where = f'scene "{scene.name}"'
    shutter = shutter_of(scene, depsgraph.view_layer, lambda *text: warnings.warn(where, *text))
    if shutter is not None:  # shapes at several times are written anew
        engine.meshes.forget()
        meshes = None
    now = scene.frame_current, scene.frame_subframe
    for eye in _eyes(scene):
        engine.active_view_set(eye)
        try:
            motion = Motion(engine, depsgraph, shutter, warnings) if shutter is not None else None
            _render(engine, depsgraph, binary, warnings, meshes, motion, eye, begin)
        finally:
            if shutter is not None:
                engine.frame_set(*now)
        if engine.test_break():
            return


class FinalMeshes:
    """What an engine's renders wrote, for its next one: an engine has one where Blender's Persistent Data let it live."""

    def __init__(self):
        self._place = None
        self._stored = StoredMeshes()

    def of(self, depsgraph):
        """StoredMeshes, without those that have changed. To be called in each render, before anything may fail: Blender
        says what has changed once."""
        place = depsgraph.scene.name, depsgraph.view_layer.name, session.render_folder()
        if self._place == place:
            self._stored.forget_changed(depsgraph)
        else:
            self._place, self._stored = place, StoredMeshes()
        return self._stored

    def forget(self):
        """A render writes others."""
        self._stored = StoredMeshes()


def _eyes(scene):
    """Names of the stereoscopic views that are to be rendered; one without name where there is but one."""
    render = scene.render
    if not render.use_multiview:
        return [""]
    is_stereo = render.views_format == "STEREO_3D"
    return [view.name for view in render.views if view.use and (not is_stereo or view.name in {"left", "right"})]


def _render(engine, depsgraph, binary, warnings, meshes, motion, eye, begin):
    """The rest of it.

    @param  meshes  StoredMeshes of renders before; None: there are none
    @param  motion  Motion, which has left the engine when the shutter is half done; None: nothing takes time
    @param  eye     the stereoscopic view, which the engine has as its active one
    @param  begin   time.perf_counter when it all began
    """
    scene = depsgraph.scene
    view, crop = view_of(engine, depsgraph, warnings)
    folder = session.render_folder()
    layer_name = depsgraph.view_layer.name
    place = {"layer": layer_name, "view": eye}
    denoiser = denoiser_of(scene, depsgraph.view_layer)
    passes = result.enabled_passes(scene, depsgraph.view_layer)
    result.warn_missing_passes(depsgraph.view_layer, warnings)

    engine.update_stats("", f"{scene.name}, {layer_name} | Exporting")
    # Where nothing takes time the view has a file of its own: if it alone moves, the program keeps all that it has loaded and
    # built.
    scene_view = view if motion is not None else any_view(view.size)
    exported = export_scene(depsgraph, scene_view, folder, "scene.gltf", warnings, motion, view, meshes)
    session.remove_stale(os.path.join(folder, DATA_FOLDER), exported.used_files)
    known = set(warnings.warnings)
    report.last_coverage[scene.name] = warnings.coverage
    report.publish(scene.name, warnings.warnings)

    has_holes = exported.has_holdouts or any(p.aov == "shadow_catcher" for p in passes)
    aovs = result.aov_list(passes, has_holes and not scene.render.film_transparent)
    number = "" if motion is None else f".{motion.frame}"

    def output(name, suffix):
        """(what the program is told, where it then writes to)."""
        told = os.path.join(folder, f"{name}{'.#' if number else ''}{suffix}")
        return told, os.path.join(folder, f"{name}{number}{suffix}")

    (told_picture, picture_path), (told_stats, stats_path) = output("picture", ".exr"), output("stats", ".json")
    arguments = [exported.path, "-o", told_picture, "--stats", told_stats]
    if motion is not None:
        arguments += ["--frames", str(motion.frame)]
    else:
        arguments += ["--camera-from", write_view(view, folder, "view.gltf")]
    arguments += ["--compression", "none", "--float", "--aov", aovs]
    arguments += command_line(scene, depsgraph.view_layer, crop)
    # Not in the viewport: there a moved camera would have everything diced again.
    if scene.relief.displacement_error > 0:
        arguments += ["--displacement-error", f"{scene.relief.displacement_error:g}"]
    if denoiser != "none":
        arguments += ["--denoise", denoiser]
    preview = None
    if _is_watched():
        told_preview, preview_path = output("preview", ".exr")
        arguments += ["--preview", told_preview]
        preview = _Preview(preview_path, lambda p: result.show(engine, p, place, scene.render.film_transparent))
    try:
        _run(engine, binary, arguments, depsgraph, warnings, preview)
        report.publish(scene.name, warnings.warnings, known)
        if not os.path.exists(picture_path):  # cancelled before the first sample
            return
        picture = exr.read(picture_path)
        statistics = _read_statistics(stats_path)
    finally:
        for path in (picture_path, stats_path, preview.path if preview else ""):
            if os.path.exists(path):
                os.remove(path)
    seconds = {"export": exported.seconds, "total": time.perf_counter() - begin}
    metadata = _metadata(statistics, warnings.warnings, seconds, exported.bytes_written)
    result.fill(engine, picture, place, passes, scene.render.film_transparent, metadata)
    _log(statistics, seconds, exported.bytes_written)


def _is_watched():
    """Whether somebody may look at the picture while it is rendered."""
    return not bpy.app.background


class _Preview:
    """The picture so far, shown as often as takes a small part of the time.

    What counts is what the thread computes: it also waits, for the window that is drawn and for a processor. One such
    wait of 0.7 s on a busy machine would leave the picture as it is for ten seconds.

    @param  path  of the file that the program writes it to, again and again and each time whole
    @param  show  called with it, an exr.Picture
    """

    def __init__(self, path, show):
        self.path = path
        self._show = show
        self._begin = time.perf_counter()
        self._spent = 0.0

    def refresh(self):
        """Called when there is a new one."""
        if self._spent > _FIRST_PREVIEW_SECONDS + _PREVIEW_SHARE * (time.perf_counter() - self._begin):
            return
        begin = time.thread_time()
        self._show(exr.read(self.path))
        self._spent += time.thread_time() - begin


def _run(engine, binary, arguments, depsgraph, warnings, preview=None):
    """Has the program render to the end, or to the artist's cancelling.

    @param  arguments  after `relief render`
    @param  depsgraph  what is rendered
    @param  warnings  Report that gets the program's own
    @param  preview   _Preview, or None where nobody looks
    @error            ReliefError if it failed by itself
    """
    request = session.render_server().ask(binary, arguments)
    scene, layer = depsgraph.scene, depsgraph.view_layer
    _follow(engine, request, f"{scene.name}, {layer.name}", sampling_of(scene, layer).samples, preview)
    if request.code != 0 and not engine.test_break():
        raise ReliefError(request.failure())
    for text in request.warnings:
        warnings.warn("program", text)


def command_line(scene, view_layer, crop=None):
    """Options of the program that the scene format has no place for.

    @param  crop  (x0, y0, x1, y1) from the top left, or None
    """
    settings, time_limit = scene.relief, sampling_of(scene, view_layer).time_limit
    arguments = ["--texture-memory", f"{settings.texture_memory:g}", "--continue-without-textures"]
    if settings.memory_limit > 0:
        arguments += ["--displacement-memory", f"{settings.memory_limit:g}"]
    if time_limit > 0:
        arguments += ["--time-limit", f"{time_limit:g}"]
    threads = settings.threads
    if threads == 0 and scene.render.threads_mode == "FIXED":  # or by blender's -t
        threads = scene.render.threads
    if threads > 0:
        arguments += ["--threads", str(threads)]
    if settings.strict:
        arguments.append("--strict")
    if crop:
        arguments += ["--crop", ",".join(str(x) for x in crop)]
    return arguments


def focus_distance(camera_object, matrix, depsgraph):
    """Metres along a camera's axis to what it focuses on."""
    dof = camera_object.data.dof
    if dof.focus_object is None:
        return dof.focus_distance
    target = dof.focus_object.evaluated_get(depsgraph)
    place = target.matrix_world
    bone = target.pose.bones.get(dof.focus_subtarget) if target.pose is not None else None
    if bone is not None:
        place = place @ bone.matrix
    axis = matrix.to_3x3().col[2].normalized()
    return abs((place.translation - matrix.translation).dot(axis))


def any_view(size):
    """A View that stands in a scene's file where the camera has one of its own: the same wherever one looks from."""
    return View({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}, np.eye(4).tolist(), size)


def frame_of(scene):
    """Frame of a scene's pictures."""
    render = scene.render
    width, height = (int(side * render.resolution_percentage / 100) for side in (render.resolution_x, render.resolution_y))
    return Frame(width, height, render.pixel_aspect_x / render.pixel_aspect_y)


def view_of(engine, depsgraph, warnings):
    """(View of the scene's camera, render region as (x0, y0, x1, y1) from the top left or None)."""
    scene = depsgraph.scene
    shown = engine.camera_override or scene.camera
    if shown is None:
        raise ReliefError("the scene has no camera")
    camera = shown.evaluated_get(depsgraph)
    if camera.type != "CAMERA":
        raise ReliefError(f'the scene looks through "{camera.name}", which is not a camera')
    matrix = engine.camera_model_matrix(camera)
    render = scene.render
    frame = frame_of(scene)
    width, height = frame.width, frame.height
    distance = focus_distance(camera, camera.matrix_world, depsgraph)
    shift = (engine.camera_shift_x(camera), camera.data.shift_y)
    where = f'camera "{camera.name}"'
    lens = camera_json(camera.data, shift, frame, distance, lambda *t: warnings.warn(where, *t))
    if engine.use_spherical_stereo(camera):
        warnings.warn(where, "spherical stereoscopy", "eyes look from where those of a flat picture do")
    view = View(lens, [list(row) for row in matrix], (width, height))
    if not render.use_border:
        return view, None
    # Blender truncates the product of two floats; the same here, or the region misses Blender's result by a pixel.
    x0, x1 = (int(np.float32(x) * np.float32(width)) for x in (render.border_min_x, render.border_max_x))
    y0, y1 = (int(np.float32(y) * np.float32(height)) for y in (render.border_min_y, render.border_max_y))
    return view, (x0, height - y1, x1, height - y0)


def warn_unread(scene, warnings):
    """Warns about settings of a scene that have no effect."""
    where = f'scene "{scene.name}"'
    warn_unread_settings(scene, lambda *text: warnings.warn(where, *text))


def status(progress, layer, samples):
    """The line that says how far a render is, in the order that Cycles has.

    @param  progress  the program's event
    @param  layer     "scene, view layer"
    @param  samples   a pixel, when it is done
    """
    parts = []
    if 0 < progress["fraction"] < 1:
        minutes, seconds = divmod(round(progress["seconds_left"]), 60)
        hours, minutes = divmod(minutes, 60)
        parts.append(f"Remaining:{f'{hours}:' if hours else ''}{minutes:02d}:{seconds:02d}")
    if memory := _memory(progress):
        parts.append("Mem:{:.0f}M, Peak:{:.0f}M".format(*memory))
    parts += [layer, f"Sample {progress['samples']:.0f}/{samples}"]
    if progress["photons"]:
        parts.append(f"{progress['photons'] / 1e6:.1f} M photons")
    parts.append(f"{progress['rays_per_second'] / 1e6:.1f} Mrays/s")
    return " | ".join(parts)


def _memory(progress):
    """(now, at most) of the program, in MiB; None: one of the first does not tell."""
    if "memory_bytes" not in progress:
        return None
    return progress["memory_bytes"] / 2**20, progress["peak_memory_bytes"] / 2**20


def _follow(engine, request, layer, samples, preview):
    """Shows progress until the request ends; ends it if the artist cancels. Arguments as for status."""
    engine.update_stats("", f"{layer} | Loading")
    while request.code is None:
        for event in request.events(_POLL_SECONDS):
            if event.get("event") == "preview" and preview is not None:
                preview.refresh()
            if event.get("event") == "progress":
                engine.update_progress(event["fraction"])
                if memory := _memory(event):
                    engine.update_memory_stats(memory_used=memory[0], memory_peak=memory[1])
                engine.update_stats("", status(event, layer, samples))
        if request.code is None and engine.test_break():
            _cancel(request)
            return


def _cancel(request):
    """Waits for what the program saves of a picture; ends a program that takes too long over it."""
    request.cancel()
    end = time.monotonic() + _PATIENCE_SECONDS
    while request.code is None:
        if time.monotonic() > end:
            session.render_server().stop()
            return
        request.events(_POLL_SECONDS)


def _read_statistics(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def _metadata(statistics, warnings, seconds, bytes_written):
    """Texts for the image's file: what the render was, took and left out."""
    out = {f"relief.{key}": f"{statistics[key]:.6g}" for key in _NUMBERS if statistics.get(key) is not None}
    out.update({f"relief.{key}": str(statistics.get(key)) for key in ("version", "seed", "stop_reason")})
    out.update({f"relief.{key}_seconds": f"{value:.3f}" for key, value in seconds.items()})
    out["relief.export_bytes"] = str(bytes_written)
    out["relief.statistics"] = json.dumps({k: v for k, v in statistics.items() if k != "warnings"})
    out["relief.warnings"] = "\n".join(warnings)
    return out


_NUMBERS = ("load_seconds", "build_seconds", "render_seconds", "samples_per_pixel", "error_rmse", "peak_memory_bytes")


def _log(statistics, seconds, bytes_written):
    say(
        f"{seconds['total']:.2f} s in all: export {seconds['export']:.2f} ({bytes_written / 1e6:.2f} MB), "
        f"load {statistics['load_seconds']:.2f}, build {statistics['build_seconds']:.2f}, "
        f"render {statistics['render_seconds']:.2f}; {statistics['samples_per_pixel']:.4g} samples a pixel, "
        f"peak {statistics['peak_memory_bytes'] / 2**20:.0f} MiB"
    )
