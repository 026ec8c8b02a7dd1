# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's picture: short renders by one program that stays, each with a seed of its own, joined as they come in.

The first is a coarse one, so that something is seen soon; then each takes as many samples as all before it. A change ends
the render and starts anew; but a coarse one is let come to its end, which is near, so that pictures keep coming while a
view is turned or an object dragged. The view has a file of its own: a change of it alone leaves the scene's file as it is,
and the program keeps all that it has loaded and built.
"""

import os
import weakref
from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import exr, final, report, result, session
from .export.camera import aperture, lens_json, panorama, window_of
from .export.gltf import GltfWriter
from .export.scene import DATA_FOLDER, SceneExporter, StoredMeshes, View, scene_json, write_view
from .export.settings import sampling_of
from .preferences import find_checked_binary
from .report import Report, ReliefError
from .server import Server, ServerEnded

_POLL_SECONDS = 0.02

#: Exit code of a render that was cancelled.
_CANCELLED = 130

#: The first run's picture is so many times smaller a side.
_COARSE = 4


_alive = weakref.WeakSet()


def stop_all():
    """Stops all viewports: the add-on is switched off, or Blender ends."""
    for viewport in list(_alive):
        viewport.stop()


@dataclass
class _Run:
    """One run: a divisor of the resolution, samples, seed."""

    divisor: int
    samples: int
    seed: int


class Viewport:
    """One viewport in rendered shading. All methods are called in Blender's main thread.

    @param  engine  the RenderEngine; only a weak reference is kept, as Blender ends the mode by dropping it
    """

    def __init__(self, engine):
        self._engine = weakref.ref(engine)
        self._folder = session.make_folder()
        self._exporter = None
        self._meshes = StoredMeshes()
        self._view = None
        self._is_changed = False
        self._is_written = False
        self._server = Server()
        self._was_restarted = False
        self._request = None
        self._run = None
        self._sum = None
        self._samples = 0
        self._texture = None
        self._picture = None
        self._is_stopped = False
        _alive.add(self)
        bpy.app.timers.register(self._poll, first_interval=_POLL_SECONDS)

    def update(self, context, depsgraph):
        """The scene has changed: exports it and starts anew."""
        self._exporter = None  # until it is whole
        scene = depsgraph.scene
        warnings = Report()
        view = _view(context, depsgraph)
        self._meshes.forget_changed(depsgraph)
        exporter = SceneExporter(depsgraph, GltfWriter(self._folder, DATA_FOLDER), warnings, self._meshes)
        exporter.add_all(final.any_view((1, 1)))
        self._binary = find_checked_binary()
        sampling = sampling_of(scene, depsgraph.view_layer)
        self._options = final.command_line(scene, depsgraph.view_layer)
        self._most_samples = sampling.preview_samples
        self._seed = sampling.seed
        self._is_transparent = scene.render.film_transparent
        self._exporter = exporter
        self._is_written = False
        final.warn_unread(scene, warnings)
        self._scene_name, self._warnings = scene.name, warnings
        report.last_coverage[scene.name] = warnings.coverage
        self._publish()
        self._begin(view)

    def draw(self, context, depsgraph):
        """Draws what there is; a view that has moved starts anew."""
        if self._exporter is not None:
            view = _view(context, depsgraph)
            if view != self._view:
                self._begin(view)
        if self._picture is not None:
            self._upload()
        if self._texture is None:
            return
        gpu.state.blend_set("ALPHA_PREMULT")
        engine = self._engine()
        engine.bind_display_space_shader(depsgraph.scene)
        draw_texture_2d(self._texture, (0, 0), context.region.width, context.region.height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def stop(self):
        """Ends the program and removes the files."""
        self._is_stopped = True
        self._request = None
        self._server.stop()
        session.remove_folder(self._folder)

    def _begin(self, view):
        """Notes what is to be rendered from now on."""
        self._view = view
        self._is_changed = True
        if self._request is not None and self._run.divisor == 1:
            self._request.cancel()

    def _poll(self):
        """Blender's timer: the seconds until the next call, None for never again."""
        engine = self._engine()
        if self._is_stopped or engine is None:
            return None
        try:
            self._step(engine)
        except ReliefError as error:
            self._request = None
            self._exporter = None
            engine.error_set(str(error))
            report.say(f"error: {error}")
            engine.tag_redraw()
        return _POLL_SECONDS

    def _step(self, engine):
        """Takes over what a run has rendered, and starts the next one."""
        if self._request is not None:
            try:
                self._request.events()
            except ServerEnded as error:
                self._restart(error)
                return
            if self._request.code is None:
                return
            self._finish(engine)
        if self._exporter is None:
            return
        if self._is_changed:
            self._is_changed = False
            self._write()
            self._sum, self._samples = None, 0
            self._run = _Run(_COARSE, 1, self._seed)
            self._start()
        elif self._samples < self._most_samples:
            samples = min(max(1, self._samples), self._most_samples - self._samples)
            self._run = _Run(1, samples, self._run.seed + 1)
            self._start()

    def _finish(self, engine):
        """Takes over what a request has brought."""
        request, self._request = self._request, None
        if request.code == _CANCELLED:
            return
        if request.code != 0:
            raise ReliefError(request.failure())
        self._was_restarted = False
        for text in request.warnings:
            self._warnings.warn("program", text)
        self._publish()
        self._add(exr.read(self._picture_path()))
        engine.update_stats("", self._status())
        engine.tag_redraw()

    def _restart(self, error):
        """Starts anew where the program has ended by itself; once, as it may end again of the same cause.

        @error  the ServerEnded
        """
        self._request = None
        if self._was_restarted:
            raise error
        self._was_restarted = True
        report.say(f"warning: {error}; it is started again")
        self._is_changed = True

    def _publish(self):
        """Shows the warnings there are, if these are others than before."""
        warnings = self._warnings.warnings
        known = report.last_warnings.get(self._scene_name, [])
        if warnings == known:
            return
        report.publish(self._scene_name, warnings, set(known))
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()

    def _status(self):
        """What the view's corner says."""
        number = len(self._warnings.warnings)
        noun = "warning" if number == 1 else "warnings"
        hint = f" | {number} {noun}: see Render Properties" if number else ""
        return f"relief: {self._samples} of {self._most_samples} samples{hint}"

    def _write(self):
        """Writes the scene and the view as they are now. No run may be reading them."""
        write_view(self._view, self._folder, "view.gltf")
        if self._is_written:
            return
        writer = self._exporter.writer
        writer.json.update(scene_json(self._exporter.nodes))
        writer.write("scene.gltf")
        session.remove_stale(os.path.join(self._folder, DATA_FOLDER), writer.used_files)
        self._is_written = True

    def _start(self):
        run = self._run
        width, height = (max(1, side // run.divisor) for side in self._view.size)
        words = [os.path.join(self._folder, "scene.gltf"), "-o", self._picture_path()]
        words += ["--camera-from", os.path.join(self._folder, "view.gltf")]
        words += ["--resolution", f"{width}x{height}", "--spp", str(run.samples), "--seed", str(run.seed)]
        words += ["--compression", "none", "--float", "--aov", "beauty"]
        self._request = self._server.ask(self._binary, words + self._options)

    def _picture_path(self):
        return os.path.join(self._folder, "picture.exr")

    def _add(self, picture):
        """Joins a run's picture with those before; a coarse one is only shown."""
        pixels = result.combined(picture, self._is_transparent).reshape(picture.height, picture.width, 4)
        if self._run.divisor > 1:
            self._picture = pixels
            return
        weighted = pixels.astype(np.float64) * self._run.samples
        self._sum = weighted if self._sum is None else self._sum + weighted
        self._samples += self._run.samples
        self._picture = (self._sum / self._samples).astype(np.float32)

    def _upload(self):
        height, width, _ = self._picture.shape
        values = np.ascontiguousarray(self._picture).ravel()
        buffer = gpu.types.Buffer("FLOAT", len(values), values)
        self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
        self._picture = None


def panorama_in_view(lens, frame, projection, shift):
    """What of RELIEF_camera makes a panorama that fills a camera's frame, which is a part of a view or more; {}: it is none.

    @param  lens        bpy camera
    @param  frame       Window of the camera
    @param  projection  matrix of the view
    @param  shift       of the view, in fractions of its width and height
    """
    shown = panorama(lens, frame, lambda *_: None)
    if shown is None:
        return {}
    sizes = (frame.half_height * frame.aspect * projection[0, 0], frame.half_height * projection[1, 1])  # of the frame in the view
    shown["window"] = [1 / size for size in sizes]
    moved = zip(shift, frame.shift, (lens.shift_x, lens.shift_y), sizes)
    return {"panorama": shown, "shift": [of_view + (own - of_frame) * size for of_view, of_frame, own, size in moved]}


def _view(context, depsgraph):
    """What a 3D view shows, by its projection matrix: holds for free views and zoomed or moved camera views."""
    region, space, view3d = context.region, context.space_data, context.region_data
    projection = np.array(view3d.window_matrix, dtype=np.float64)
    matrix = np.array(view3d.view_matrix.inverted(), dtype=np.float64)
    is_orthographic = not view3d.is_perspective
    size = (region.width, region.height)
    shift = -projection[:2, 3] / 2 if is_orthographic else projection[:2, 2] / 2
    looks_through = space.camera if view3d.view_perspective == "CAMERA" else None
    has_camera = looks_through is not None and looks_through.type == "CAMERA"
    lens = looks_through.evaluated_get(depsgraph).data if has_camera else space
    clip = (lens.clip_start, lens.clip_end)
    if is_orthographic and not has_camera:
        # A free orthographic view sees as far behind its centre as before it.
        matrix[:3, 3] += matrix[:3, 2] * clip[1] / 2
        clip = (0.0, clip[1])
    camera = lens_json(is_orthographic, 1 / projection[1, 1], size[0] / size[1], shift.tolist(), clip)
    if has_camera:
        distance = final.focus_distance(looks_through.evaluated_get(depsgraph), looks_through.matrix_world, depsgraph)
        camera["extensions"]["RELIEF_camera"].update(aperture(lens, distance))
        if lens.type == "PANO":
            frame = window_of(lens, (lens.shift_x, lens.shift_y), final.frame_of(depsgraph.scene))
            camera["extensions"]["RELIEF_camera"].update(panorama_in_view(lens, frame, projection, shift))
    return View(camera, matrix.tolist(), size)
