# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the panels."""

import bpy
from bpy.props import IntProperty

from . import compat
from .export.displacement import needs_switch
from .export.dry_run import try_material
from .report import group, last_coverage, last_warnings

#: Name of the text that warnings are written to.
_TEXT_NAME = "relief warnings"

#: Things that a tooltip names of those with the same warning.
_MOST_IN_TOOLTIP = 25


class RELIEF_OT_displace(bpy.types.Operator):
    """Let the material's Displacement node move the surface; with "Bump Only" it bends normals alone"""

    bl_idname = "relief.displace"
    bl_label = "Use Displacement"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        material = getattr(context, "material", None)
        return material is not None and needs_switch(material)

    def execute(self, context):
        compat.set_displacement_method(context.material, "DISPLACEMENT")
        return {"FINISHED"}


class RELIEF_OT_check_materials(bpy.types.Operator):
    """Count which nodes of the file's materials relief understands, without rendering"""

    bl_idname = "relief.check_materials"
    bl_label = "Check Materials"

    def execute(self, context):
        scene = context.scene
        checked = {m.name: try_material(m, scene.relief)[0] for m in bpy.data.materials if m.users}
        last_coverage[scene.name] = {name: coverage for name, coverage in checked.items() if coverage is not None}
        return {"FINISHED"}


class RELIEF_OT_show_warnings(bpy.types.Operator):
    """Show all warnings of the last render in a text editor"""

    bl_idname = "relief.show_warnings"
    bl_label = "Show Warnings"

    index: IntProperty(
        name="Group", description="Which group of warnings; -1 is all (default -1)", default=-1, options={"SKIP_SAVE"}
    )

    @classmethod
    def description(cls, context, properties):
        groups = group(last_warnings.get(context.scene.name, []))
        if not 0 <= properties.index < len(groups):
            return cls.__doc__
        return groups[properties.index].text(_MOST_IN_TOOLTIP) + "\n\nClick to see all warnings in a text editor"

    def execute(self, context):
        groups = group(last_warnings.get(context.scene.name, []))
        text = bpy.data.texts.get(_TEXT_NAME) or bpy.data.texts.new(_TEXT_NAME)
        text.from_string("\n\n".join(members.text() for members in groups) + "\n")
        first = sum(members.text().count("\n") + 2 for members in groups[: max(self.index, 0)])
        text.select_set(first, 0, first, 0)
        _show_text(context, text)
        return {"FINISHED"}


def _show_text(context, text):
    """Shows a text in a text editor, in a new window if there is none. Without windows it is only written."""
    windows = context.window_manager.windows
    areas = [area for window in windows for area in window.screen.areas]
    editor = next((area for area in areas if area.type == "TEXT_EDITOR"), None)
    if editor is None and not bpy.app.background:
        bpy.ops.wm.window_new()
        editor = windows[-1].screen.areas[0]
        editor.type = "TEXT_EDITOR"
    if editor is not None:
        space = editor.spaces.active
        space.text, space.show_word_wrap, space.show_syntax_highlight = text, True, False
        space.top = max(0, text.current_line_index - 3)


_classes = (RELIEF_OT_displace, RELIEF_OT_check_materials, RELIEF_OT_show_warnings)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)
