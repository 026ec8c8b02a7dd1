# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's side of relief: a render engine that writes the scene format and runs the `relief` program.

Read in this order: engine.py (what Blender calls), export/scene.py (from Blender's data to a scene file), process.py
and server.py (the program), result.py (its picture back into Blender). What differs between versions of Blender is in compat.py.
"""

import sys

bl_info = {
    "name": "relief",
    "description": "Path tracer for scenes whose detail lives in displacement maps",
    "author": "The relief authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Render properties > Render Engine > relief",
    "category": "Render",
}

# Blender imports this file anew when an update has been installed; so must be the files below it.
for _name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
    del sys.modules[_name]
    globals().pop(_name.removeprefix(f"{__name__}."), None)

from .find_numpy import find_numpy  # noqa: E402
from .refusal import refuse_second  # noqa: E402

find_numpy(__name__)
refuse_second(__name__)

from . import engine, exporter, operators, preferences, properties, session, ui  # noqa: E402

_modules = (session, preferences, properties, engine, operators, exporter, ui)


def register():
    # Once more: Blender does not import again what was disabled.
    refuse_second(__name__)
    for module in _modules:
        module.register()


def unregister():
    for module in reversed(_modules):
        module.unregister()
