# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras as glTF cameras with RELIEF_camera."""

import math

#: Blender's focal lengths and sensors are in millimetres.
_METRES_PER_MILLIMETRE = 1e-3


def camera_json(camera, own_shift, frame, focus_distance, warn):
    """glTF camera of a bpy camera.

    @param  camera          bpy camera
    @param  own_shift       its shift along both axes, that of its eye
    @param  frame           (width, height) of the whole picture in pixels
    @param  focus_distance  metres along the camera's axis
    @param  warn            called with what is not understood, and what was used instead
    """
    aspect = frame[0] / frame[1]
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
    out["extensions"]["RELIEF_camera"].update(aperture(camera, focus_distance, warn))
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


def aperture(camera, focus_distance, warn):
    """The part of RELIEF_camera that is depth of field; {} without."""
    if not camera.dof.use_dof:
        return {}
    if camera.dof.aperture_blades > 2 or camera.dof.aperture_ratio != 1:
        warn("an aperture with blades or a ratio", "a round one was used")
    # An orthographic camera has no focal length; Blender then takes the lens to be a metre long.
    focal_length = camera.lens * _METRES_PER_MILLIMETRE if camera.type != "ORTHO" else 1.0
    radius = focal_length / (2 * max(camera.dof.aperture_fstop, 1e-5))
    return {"apertureRadius": radius, "focusDistance": max(focus_distance, 1e-5)}
