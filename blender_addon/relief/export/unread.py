# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of objects and lights that change Cycles' picture and not relief's: one warning for each that is not as usual.

Which do was found by setting them one by one and rendering in Cycles: of most kinds of objects, not of all. Those of scenes are in settings.py.
"""

from .. import compat

#: Of objects, in Cycles' settings or, since 4.2, their own.
_OBJECT = (
    (("shadow_terminator_offset", "shadow_terminator_shading_offset"), 0.0, "Shading Offset of the shadow terminator"),
    (("shadow_terminator_geometry_offset",), 0.1, "Geometry Offset of the shadow terminator"),
)


def warn_unread_of_object(shown, scene, warn):
    """Of an original object that has a surface.

    @param  warn  called with what is not understood, and what was used instead
    """
    owners = (getattr(shown, "cycles", None), shown)
    for names, usual, what in _OBJECT:
        values = [getattr(owner, name) for owner in owners for name in names if hasattr(owner, name)]
        if values and abs(values[0] - usual) > 1e-6:
            warn(what, "relief's own was used")
    modifier = compat.dicing_modifier(shown, scene)
    if modifier is not None and modifier.subdivision_type != "SIMPLE":
        warn("adaptive subdivision", f"its render level, {modifier.render_levels}, was used")
