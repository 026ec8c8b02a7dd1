# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: where the program is."""

import bpy
from bpy.props import StringProperty

from . import process
from .report import ReliefError


class ReliefPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    binary: StringProperty(
        name="Program",
        description="Path of the relief program; empty: $RELIEF_BINARY, then the one that came with the add-on, then the PATH (default empty)",
        subtype="FILE_PATH",
    )

    def draw(self, _context):
        self.layout.prop(self, "binary")
        try:
            path = process.find_binary(bpy.path.abspath(self.binary))
            self.layout.label(text=f"relief {process.check_version(path)}: {path}", icon="CHECKMARK")
        except ReliefError as error:
            self.layout.label(text=str(error), icon="ERROR")


def find_checked_binary():
    """Path of a program that this add-on can talk to.

    @error  ReliefError that says what to do
    """
    addon = bpy.context.preferences.addons.get(__package__)
    path = process.find_binary(bpy.path.abspath(addon.preferences.binary) if addon else "")
    process.check_version(path)
    return path


def register():
    bpy.utils.register_class(ReliefPreferences)


def unregister():
    bpy.utils.unregister_class(ReliefPreferences)
