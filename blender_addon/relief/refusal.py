# SPDX-License-Identifier: GPL-3.0-or-later
"""An add-on that cannot be enabled says why, in one message."""

import bpy


def refuse(package, *lines):
    """Ends the import of a package.

    @error  ImportError about the package, which Blender prints without a traceback when it starts
    """
    if not bpy.app.background:
        # While an add-on is loaded there is no window that a message could be shown in.
        bpy.app.timers.register(lambda: _show(lines))
    raise ImportError(" ".join(lines), name=package)


def refuse_second(package):
    """Fails where another add-on has registered relief's engine: an add-on of old beside an extension, or two copies.

    Blender would let the later one take over class after class, and could then disable neither.
    """
    for engine in bpy.types.RenderEngine.__subclasses__():
        other = engine.__module__.rpartition(".")[0]
        if getattr(engine, "bl_idname", "") == "RELIEF" and other != package and engine.is_registered:
            refuse(package, f"Another add-on of relief is enabled, {other}.", f"Disable or remove it before enabling {package}.")


def _show(lines):
    """Shows a message in a window."""

    def draw(menu, _context):
        for line in lines:
            menu.layout.label(text=line)

    bpy.context.window_manager.popup_menu(draw, title="relief", icon="ERROR")
