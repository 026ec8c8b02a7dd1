# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's colour spaces: which ones the program reads by itself, and the others' values as scene-linear ones.

In Blender's own colour configuration the names of spaces say what they are. In one that $OCIO names they say nothing, and
scene-linear light may have other primaries than those of Rec. 709. There Blender is asked: a picture of sample values is
loaded in the space.
"""

import functools
import os
import tempfile

import bpy
import numpy as np
from mathutils import Color

from .. import exr

#: Names in Blender's own configurations of what is stored as it is.
_LINEAR_NAMES = {"Non-Color", "Raw", "Linear", "Linear Rec.709", "Generic Data"}

#: What red, green and blue add to the luminance in Rec. 709, which is what the program takes.
REC709_WEIGHTS = (0.2126, 0.7152, 0.0722)

#: How far values may be off that went through a colour configuration.
_ROUNDING = 2e-5

_samples = np.array(
    [[0, 0, 0], [1, 1, 1], [0.03, 0.03, 0.03], [0.5, 0.5, 0.5], [0.8, 0, 0], [0, 0.8, 0], [0, 0, 0.8], [0.2, 0.5, 0.9]],
    dtype=np.float32,
)

_meanings = {}


def meaning(settings):
    """"linear" or "srgb": how the program has to read values of a space to get Blender's; None: neither gives them.

    @param  settings  colorspace_settings of an image
    """
    if settings.is_data:
        return "linear"
    name = settings.name
    if not os.environ.get("OCIO"):
        return "linear" if name in _LINEAR_NAMES else "srgb" if name == "sRGB" else None
    if name not in _meanings:
        values = _loaded(_samples[None], name)[0]
        same = [label for label, expected in (("linear", _samples), ("srgb", from_srgb(_samples))) if _equal(values, expected)]
        _meanings[name] = same[0] if same else None
    return _meanings[name]


def to_scene_linear(values, settings):
    """Stored values as scene-linear ones.

    @param  values    float32 (height, width, 3)
    @param  settings  colorspace_settings of the image
    """
    kind = meaning(settings)
    return values if kind == "linear" else from_srgb(values) if kind == "srgb" else _loaded(values, settings.name)


def from_srgb(values):
    """@source  IEC 61966-2-1"""
    return np.where(values <= 0.04045, values / 12.92, (np.maximum(values, 0.04045) + 0.055) ** 2.4 / 1.055**2.4)


@functools.cache
def scene_linear_from_rec709():
    """Matrix (3, 3) of the colours that the program makes itself; None: they are scene-linear as they are."""
    columns = [Color([float(i == k) for i in range(3)]).from_rec709_linear_to_scene_linear() for k in range(3)]
    matrix = np.array(columns, dtype=np.float64).T
    return None if _equal(matrix, np.eye(3)) else matrix


@functools.cache
def luminance_weights():
    """What red, green and blue of scene-linear light add to its luminance: three numbers."""
    matrix = scene_linear_from_rec709()
    weights = np.array(REC709_WEIGHTS)
    return REC709_WEIGHTS if matrix is None else tuple((weights @ np.linalg.inv(matrix)).tolist())


def _equal(values, expected):
    return np.allclose(values, expected, rtol=_ROUNDING, atol=_ROUNDING)


def _loaded(values, name):
    """What Blender makes of values of a space when it loads them: float32 of the same shape."""
    handle, path = tempfile.mkstemp(suffix=".exr", dir=bpy.app.tempdir)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(exr.encode({c: np.ascontiguousarray(values[::-1, :, i], dtype=np.float32) for i, c in enumerate("RGB")}))
        image = bpy.data.images.load(path)
        try:
            image.colorspace_settings.name = name
            pixels = np.empty(len(values) * values.shape[1] * image.channels, dtype=np.float32)
            image.pixels.foreach_get(pixels)
            return pixels.reshape(*values.shape[:2], image.channels)[..., :3]
        finally:
            bpy.data.images.remove(image)
    finally:
        os.remove(path)
