# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as Blender sees it: forwards to final.py, viewport.py and preview.py, and tells every failure."""

import traceback

import bpy

from . import compat, exporter, final, preview, result
from .report import ReliefError, say
from .viewport import Viewport, stop_all


class ReliefEngine(bpy.types.RenderEngine):
    bl_idname = "RELIEF"
    bl_label = "relief"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_custom_freestyle = True
    bl_use_eevee_viewport = True  # material preview is Eevee's

    def __init__(self, *arguments, **keywords):
        compat.engine_init(ReliefEngine, self, *arguments, **keywords)
        self._viewport = None
        self.meshes = final.FinalMeshes()

    def __del__(self):
        # Blender may drop an engine whose __init__ it has not run, or of which it has taken down its own part.
        try:
            viewport = getattr(self, "_viewport", None)
        except ReferenceError:
            return
        if viewport is not None:
            viewport.stop()

    def render(self, depsgraph):
        if self.is_preview:
            self._preview(depsgraph)
            return
        self._guard(lambda: exporter.capture(self, depsgraph) or final.render(self, depsgraph))

    def update_render_passes(self, scene=None, renderlayer=None):
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for p in result.enabled_passes(scene, renderlayer):
            self.register_pass(scene, renderlayer, p.name, len(p.ids), p.ids, p.kind)

    def view_update(self, context, depsgraph):
        if self._viewport is None:
            self._viewport = Viewport(self)
        self._guard(lambda: self._viewport.update(context, depsgraph))

    def view_draw(self, context, depsgraph):
        if self._viewport is not None:
            self._guard(lambda: self._viewport.draw(context, depsgraph))

    def _preview(self, depsgraph):
        """A preview that fails is black; only the console says why, as Blender asks for one with each glance at a list."""
        try:
            preview.render(self, depsgraph)
        except ReliefError as error:
            say(f"warning: no preview: {error}")
        except Exception as error:
            say(f"warning: no preview: {''.join(traceback.format_exception(error))}")

    def _guard(self, action):
        """Runs an action and reports its failure. An exception that left here would leave a black picture and no word."""
        try:
            action()
        except ReliefError as error:
            self._tell(str(error))
        except Exception as error:  # whatever it is, the artist must see it
            say("".join(traceback.format_exception(error)))
            self._tell(f"{type(error).__name__}: {error} (a mistake in the add-on; the console has the details)")

    def _tell(self, text):
        say(f"error: {text}")
        self.error_set(text)
        self.report({"ERROR"}, text)


def register():
    bpy.utils.register_class(ReliefEngine)


def unregister():
    stop_all()
    bpy.utils.unregister_class(ReliefEngine)
