# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bounced rays see a thing, in the format's words."""

_SETTINGS = {
    "diffuse": "visibleToDiffuse",
    "glossy": "visibleToGlossy",
    "transmission": "visibleToTransmission",
    "volume_scatter": "visibleToScattered",
}


def hidden_settings(is_seen_by):
    """Settings of RELIEF_object and RELIEF_environment for the kinds of rays that do not see something.

    @param  is_seen_by  called with Blender's names of kinds
    """
    return {setting: False for ray, setting in _SETTINGS.items() if not is_seen_by(ray)}
