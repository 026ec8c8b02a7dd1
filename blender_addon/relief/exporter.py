# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Export > relief scene: a frame or a shot as a scene file, for rendering without Blender.

What a render shows (modifiers at their render level, particles of a render) only a render engine gets to see. So each
frame is rendered with this engine while a Capture is at work, which takes the scene and leaves the program out.
"""

import os

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import final, report
from .export import color_space
from .export.animation import Shot
from .export.gltf import GltfWriter
from .export.scene import SceneExporter
from .report import ReliefError, Report

_running = None


class Capture:
    """Collects frames into one scene file.

    @param  path       of the scene file; buffers go to a folder beside it, named after it
    @param  has_lines  the scene's pictures get Freestyle lines
    """

    def __init__(self, path, has_lines):
        folder, self._name = os.path.split(os.path.abspath(path))
        stem = os.path.splitext(self._name)[0]
        self._writer = GltfWriter(folder, f"{stem}_data")
        self._shot = None
        self._fixed = None
        self._has_lines = has_lines
        self.report = None

    def add(self, engine, depsgraph):
        """Adds the depsgraph's frame."""
        scene = depsgraph.scene
        if self.report is None:
            self.report = Report(strict=scene.relief.strict)
            self._shot = Shot(scene.render.fps / scene.render.fps_base)
        final.warn_unread(scene, self.report)
        view, crop = final.view_of(engine, depsgraph, self.report)
        for is_on, what, instead in (
            (self._has_lines, "Freestyle lines", "they are left out"),
            (scene.render.use_multiview, "stereoscopy", "the scene's camera alone was used"),
        ):
            if is_on:
                self.report.warn(f'scene "{scene.name}"', what, instead)
        if scene.render.use_motion_blur:
            self.report.warn(f'scene "{scene.name}"', "motion blur", "everything stands still")
        if color_space.scene_linear_from_rec709() is not None:
            what = "a working space with other primaries than Rec. 709, by $OCIO"
            self.report.warn(f'scene "{scene.name}"', what, "its colours are in it, which the program does not know")
        if crop:
            self.report.warn(f'scene "{scene.name}"', "a render region", "whole pictures; use --crop")
        exporter = SceneExporter(depsgraph, self._writer, self.report)
        exporter.add_all(view)
        report.last_coverage[scene.name] = self.report.coverage
        self._shot.add_frame(scene.frame_current, exporter.nodes)
        extensions = self._writer.json["extensions"]
        fixed = {name: extensions[name] for name in ("RELIEF_render", "RELIEF_environment")}
        if self._fixed is None:
            self._fixed = fixed
        elif fixed != self._fixed:
            self.report.warn(f'scene "{scene.name}"', "an animated world or animated settings", "the first frame's")
            extensions.update(self._fixed)

    def write(self):
        """Writes the scene file; returns the number of bytes written, buffers included."""
        self._shot.write(self._writer)
        self._writer.write(self._name)
        return self._writer.bytes_written


def capture(engine, depsgraph):
    """Takes a frame if an export is running; returns whether one is."""
    if _running is None:
        return False
    _running.add(engine, depsgraph)
    return True


def export_frames(scene, path, frames):
    """Exports frames of a scene.

    @param  frames  increasing frame numbers
    @return         (warnings, bytes written)
    @error          ReliefError with what an engine would have reported
    """
    global _running
    # What Blender would do with the picture, which there is none of.
    after = ("use_compositing", "use_sequencer", "use_freestyle")
    before = scene.render.engine, scene.frame_current, [getattr(scene.render, name) for name in after]
    _running = Capture(path, scene.render.use_freestyle)
    try:
        scene.render.engine = "RELIEF"
        for name in after:
            setattr(scene.render, name, False)
        for frame in frames:
            scene.frame_set(frame)
            bpy.ops.render.render(scene=scene.name)
        return _running.report.warnings, _running.write()
    except RuntimeError as error:
        raise ReliefError(str(error).removeprefix("Error: ").strip()) from error
    finally:
        _running = None
        scene.render.engine, frame, values = before
        for name, value in zip(after, values):
            setattr(scene.render, name, value)
        scene.frame_set(frame)


class RELIEF_OT_export(bpy.types.Operator, ExportHelper):
    """Write the scene for `relief render`"""

    bl_idname = "export_scene.relief"
    bl_label = "Export relief Scene"
    filename_ext = ".gltf"

    filter_glob: StringProperty(default="*.gltf", options={"HIDDEN"})
    use_range: BoolProperty(
        name="Frame Range", description="Export a shot instead of the current frame (default off)", default=False
    )
    frame_start: IntProperty(name="Start", description="First frame of the shot (default 1)", default=1, min=0)
    frame_end: IntProperty(name="End", description="Last frame of the shot (default 250)", default=250, min=0)

    def invoke(self, context, event):
        self.frame_start, self.frame_end = context.scene.frame_start, context.scene.frame_end
        return super().invoke(context, event)

    def execute(self, context):
        scene = context.scene
        frames = range(self.frame_start, self.frame_end + 1) if self.use_range else [scene.frame_current]
        if not frames:
            self.report({"ERROR"}, "the frame range ends before it starts")
            return {"CANCELLED"}
        try:
            warnings, num_bytes = export_frames(scene, self.filepath, frames)
        except (ReliefError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        report.publish(scene.name, warnings)
        for text in warnings:
            self.report({"WARNING"}, text)
        self.report({"INFO"}, f"{len(frames)} frames, {num_bytes / 1e6:.1f} MB: {self.filepath}")
        return {"FINISHED"}


def _draw_menu(menu, _context):
    menu.layout.operator(RELIEF_OT_export.bl_idname, text="relief scene (.gltf)")


def register():
    bpy.utils.register_class(RELIEF_OT_export)
    bpy.types.TOPBAR_MT_file_export.append(_draw_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_draw_menu)
    bpy.utils.unregister_class(RELIEF_OT_export)
