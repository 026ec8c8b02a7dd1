# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras as glTF cameras with RELIEF_camera."""

import math
from dataclasses import dataclass

@dataclass(frozen=True)
class Frame:
    """A whole picture: its size in pixels, and a pixel's width over its height."""

    width: int
    height: int
    pixel_aspect: float


#: Blender's focal lengths and sensors are in millimetres.
_METRES_PER_MILLIMETRE = 1e-3


def camera_json(camera, own_shift, frame, focus_distance, warn):
    """glTF camera of a bpy camera.

    @param  camera          bpy camera
    @param  own_shift       its shift along both axes, that of its eye
    @param  frame           Frame
    @param  focus_distance  metres along the camera's axis
    @param  warn            called with what is not understood, and what was used instead
    """
    aspect = frame.width * frame.pixel_aspect / frame.height
    is_horizontal = camera.sensor_fit == "HORIZONTAL" or (camera.sensor_fit == "AUTO" and aspect >= 1)
    # Blender's lengths (sensor, orthographic scale, shift) are fractions of one side of the picture, the fitted one.
    by_width, by_height = (1.0, aspect) if is_horizontal else (1 / aspect, 1.0)
    if camera.type == "ORTHO":
        half_height = camera.ortho_scale / 2 / by_height
    else:
        if camera.type != "PERSP":
            warn("a panoramic camera", "a perspective one with its focal length was used")
        # AUTO always measures with the sensor's width.
        sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
        half_height = 0.5 * sensor / camera.lens / by_height
    shift = (own_shift[0] * by_width, own_shift[1] * by_height)
    clip = (camera.clip_start, camera.clip_end)
    out = lens_json(camera.type == "ORTHO", half_height, aspect, shift, clip)
    out["name"] = camera.name
    if frame.pixel_aspect != 1:
        out["extensions"]["RELIEF_camera"]["pixelAspect"] = frame.pixel_aspect
    out["extensions"]["RELIEF_camera"].update(aperture(camera, focus_distance))
    return out


def lens_json(is_orthographic, half_height, aspect, shift, clip):
    """glTF camera of a lens.

    @param  half_height  of the window: metres, or at distance 1 for a perspective
    @param  shift        of the window, in fractions of its width and height
    @param  clip         (start, end) in metres along the axis
    """
    extension = {"shift": list(shift), "clip": list(clip)}
    if is_orthographic:
        lens = {"xmag": half_height * aspect, "ymag": half_height, "znear": 0.0, "zfar": clip[1]}
        return {"type": "orthographic", "orthographic": lens, "extensions": {"RELIEF_camera": extension}}
    lens = {"yfov": 2 * math.atan(half_height), "znear": max(clip[0], 1e-6)}
    return {"type": "perspective", "perspective": lens, "extensions": {"RELIEF_camera": extension}}


def aperture(camera, focus_distance):
    """The part of RELIEF_camera that is depth of field; {} without."""
    dof = camera.dof
    if not dof.use_dof:
        return {}
    # An orthographic camera has no focal length; Blender then takes the lens to be a metre long.
    focal_length = camera.lens * _METRES_PER_MILLIMETRE if camera.type != "ORTHO" else 1.0
    radius = focal_length / (2 * max(dof.aperture_fstop, 1e-5))
    out = {"apertureRadius": radius, "focusDistance": max(focus_distance, 1e-5)}
    if dof.aperture_blades > 2:
        out["apertureBlades"], out["apertureRotation"] = dof.aperture_blades, dof.aperture_rotation
    if dof.aperture_ratio != 1:
        out["apertureRatio"] = dof.aperture_ratio
    return out
