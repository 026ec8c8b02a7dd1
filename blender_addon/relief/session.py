# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders for scenes and pictures on their way between Blender and the program.

They live in Blender's own temporary folder, which Blender removes when it ends. Within one render job (all frames of
an animation) the folder stays, so that buffers of one frame serve the next, and so does the program; then both go. With
Blender's Persistent Data they stay for the next job, until another file is opened or that is switched off.
"""

import os
import shutil
import tempfile

import bpy
from bpy.app.handlers import persistent

from .server import Server

_PREFIX = "relief_"
_render_folder = None
_render_server = None
_subscriber = object()


def make_folder():
    """A new empty folder, to be removed with remove_folder."""
    return tempfile.mkdtemp(prefix=_PREFIX, dir=bpy.app.tempdir or None)


def remove_folder(path):
    """Removes a folder and what is in it; silent if it is gone."""
    shutil.rmtree(path, ignore_errors=True)


def render_folder():
    """The folder of the running render job, made when it is first asked for."""
    global _render_folder
    if _render_folder is None or not os.path.isdir(_render_folder):
        _render_folder = make_folder()
    return _render_folder


def render_server():
    """The program of the running render job."""
    global _render_server
    if _render_server is None:
        _render_server = Server()
    return _render_server


def remove_stale(folder, keep):
    """Removes files of a folder whose names are not to be kept: buffers that the last frame did not use."""
    for name in os.listdir(folder):
        if name not in keep:
            os.remove(os.path.join(folder, name))


@persistent
def end_render_job(scene, *_):
    """Ends what belongs to the render job that is done, unless the scene wants it for the next."""
    if not _is_kept(scene):
        end_all()
        return
    # The artist hears of no update when the memory is wanted back.
    for name in ("use_persistent_data", "engine"):
        bpy.msgbus.subscribe_rna(
            key=(bpy.types.RenderSettings, name), owner=_subscriber, args=(), notify=_end_unless_kept
        )


@persistent
def end_all(*_):
    """Ends the program of render jobs, and removes their folder."""
    global _render_folder, _render_server
    bpy.msgbus.clear_by_owner(_subscriber)
    if _render_server is not None:
        _render_server.stop()
        _render_server = None
    if _render_folder is not None:
        remove_folder(_render_folder)
        _render_folder = None


def _is_kept(scene):
    return scene.render.use_persistent_data and scene.render.engine == "RELIEF"


def _end_unless_kept():
    if not any(_is_kept(scene) for scene in bpy.data.scenes):
        end_all()


def register():
    bpy.app.handlers.render_complete.append(end_render_job)
    bpy.app.handlers.render_cancel.append(end_render_job)
    bpy.app.handlers.load_pre.append(end_all)


def unregister():
    bpy.app.handlers.render_complete.remove(end_render_job)
    bpy.app.handlers.render_cancel.remove(end_render_job)
    bpy.app.handlers.load_pre.remove(end_all)
    end_all()
