# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's small pictures of materials, worlds and lights: of the panel Preview, and as icons."""

import os

from . import exr, final, result, session
from .export.scene import export_scene
from .preferences import find_checked_binary
from .process import Process
from .report import ReliefError, Report

_POLL_SECONDS = 0.02

#: Samples a pixel, or as many as there is time for: somebody waits.
_SAMPLES, _SECONDS = 64, 2.0


def render(engine, depsgraph):
    """Renders the scene that Blender has made for a preview, by a program of its own: other renders may be under way.

    @error  ReliefError
    """
    binary = find_checked_binary()
    scene = depsgraph.scene
    unread = Report()
    folder = session.make_folder()
    try:
        view, _ = final.view_of(engine, depsgraph, unread)
        exported = export_scene(depsgraph, view, folder, "preview.gltf", unread)
        path = os.path.join(folder, "preview.exr")
        words = [binary, "render", exported.path, "-o", path, "--spp", str(_SAMPLES), "--time-limit", str(_SECONDS)]
        with Process([*words, "--progress", "none", "--compression", "none", "--float"]) as program:
            while (code := program.wait(_POLL_SECONDS)) is None:
                if engine.test_break():
                    return
            if code != 0:
                raise ReliefError(program.failure(code))
        result.show(engine, exr.read(path), {"layer": depsgraph.view_layer.name}, scene.render.film_transparent)
    finally:
        session.remove_folder(folder)
