# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the panels."""

import bpy

from . import compat
from .export.displacement import needs_switch


class RELIEF_OT_displace(bpy.types.Operator):
    """Let the material's Displacement node move the surface; with "Bump Only" it does nothing in relief"""

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


def register():
    bpy.utils.register_class(RELIEF_OT_displace)


def unregister():
    bpy.utils.unregister_class(RELIEF_OT_displace)
