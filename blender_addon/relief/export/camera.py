# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras as glTF cameras with RELIEF_camera."""

import math
from dataclasses import dataclass

from .. import compat

@dataclass(frozen=True)
class Frame:
    """A whole picture: its size in pixels, and a pixel's width over its height."""

    width: int
    height: int
    pixel_aspect: float


@dataclass(frozen=True)
class Window:
    """What a camera sees of the plane that the picture is on.

    half_height  in metres, or at distance 1 for a perspective
    aspect       width over height
    shift        in fractions of width and height
    sensor       width and height in millimetres of what the picture covers
    """

    half_height: float
    aspect: float
    shift: tuple
    sensor: tuple


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
    if camera.type not in {"PERSP", "ORTHO", "PANO"}:
        warn(f"a camera of the kind {camera.type.lower()}", "a perspective one with its focal length was used")
    window = window_of(camera, own_shift, frame)
    clip = (camera.clip_start, camera.clip_end)
    out = lens_json(camera.type == "ORTHO", window.half_height, window.aspect, window.shift, clip)
    out["name"] = camera.name
    extension = out["extensions"]["RELIEF_camera"]
    extension.update(aperture(camera, focus_distance))
    if camera.type == "PANO" and (shown := panorama(camera, window, warn)) is not None:
        # It fills the picture, whatever that is shaped like, and shifts are parts of either side.
        extension.update({"panorama": shown, "shift": list(own_shift)})
    elif frame.pixel_aspect != 1:
        extension["pixelAspect"] = frame.pixel_aspect
    return out


def window_of(camera, own_shift, frame):
    """Window of a bpy camera, as if it were a perspective one if it is neither that nor orthographic. Arguments as in camera_json."""
    aspect = frame.width * frame.pixel_aspect / frame.height
    is_horizontal = camera.sensor_fit == "HORIZONTAL" or (camera.sensor_fit == "AUTO" and aspect >= 1)
    # Blender's lengths (sensor, orthographic scale, shift) are fractions of one side of the picture, the fitted one.
    by_width, by_height = (1.0, aspect) if is_horizontal else (1 / aspect, 1.0)
    # AUTO always measures with the sensor's width.
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    if camera.type == "ORTHO":
        half_height = camera.ortho_scale / 2 / by_height
    else:
        half_height = 0.5 * sensor / camera.lens / by_height
    return Window(half_height, aspect, (own_shift[0] * by_width, own_shift[1] * by_height), (sensor / by_width, sensor / by_height))


def panorama(camera, window, warn):
    """The part of RELIEF_camera that makes a panoramic camera; None for a kind that is not understood.

    @param  window  Window
    @param  warn    as in camera_json
    """
    lens = compat.panorama_of(camera)
    kind = lens.panorama_type if lens is not None else "unknown"
    if kind in {"MIRRORBALL", "EQUIANGULAR_CUBEMAP_FACE"}:
        return {"type": "mirror-ball" if kind == "MIRRORBALL" else "cube-face"}
    if kind == "EQUIRECTANGULAR":
        longitude, latitude = [lens.longitude_min, lens.longitude_max], [lens.latitude_min, lens.latitude_max]
        return {"type": "equirectangular", "longitude": longitude, "latitude": latitude}
    if kind == "CENTRAL_CYLINDRICAL":
        low, high = (getattr(lens, f"central_cylindrical_range_{end}") for end in ("v_min", "v_max"))
        longitude = [lens.central_cylindrical_range_u_min, lens.central_cylindrical_range_u_max]
        heights = [low / lens.central_cylindrical_radius, high / lens.central_cylindrical_radius]
        return {"type": "cylindrical", "longitude": longitude, "heights": heights}
    out = {"fieldOfView": lens.fisheye_fov} if lens is not None else {}
    if kind == "FISHEYE_EQUIDISTANT":
        return {"type": "equidistant", **out}
    out["sensor"] = list(window.sensor)
    if kind == "FISHEYE_EQUISOLID":
        return {"type": "equisolid", **out, "focalLength": lens.fisheye_lens}
    if kind == "FISHEYE_LENS_POLYNOMIAL":
        # Blender's give the angle's negative.
        coefficients = [-getattr(lens, f"fisheye_polynomial_k{i}") for i in range(5)]
        return {"type": "polynomial", **out, "coefficients": coefficients}
    warn(f"a panoramic camera of the kind {kind.lower()}", "a perspective one with its focal length was used")
    return None


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
