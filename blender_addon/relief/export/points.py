# SPDX-License-Identifier: GPL-3.0-or-later
"""Point clouds as points of glTF that are balls (RELIEF_points), as Cycles has them."""

import numpy as np

from . import attributes

#: Radius of points that have none, in Cycles.
_USUAL_RADIUS = 0.01

#: Metres from the origin beyond which the program refuses geometry.
_FARTHEST = 1e15


def arrays_of(cloud, wanted, warn):
    """Arrays of a glTF primitive by their names; None: there is no point.

    @param  cloud   evaluated bpy point cloud
    @param  wanted  Wanted of the material
    @param  warn    called with what is wrong, and what was used instead
    """
    positions = attributes.of_points(cloud, "position")
    if positions is None or not len(positions):
        return None
    radius = attributes.of_points(cloud, "radius")
    radius = np.full(len(positions), _USUAL_RADIUS, dtype=np.float32) if radius is None else np.maximum(radius[:, 0], 0)
    with np.errstate(invalid="ignore"):
        stays = (np.abs(positions) < _FARTHEST).all(axis=1) & (radius < _FARTHEST)
    if not stays.all():
        warn(f"{(~stays).sum()} of {len(stays)} points are not finite, or {_FARTHEST:.0e} m away", "they are left out")
    numbers = np.flatnonzero(stays & (radius > 0))
    if not len(numbers):
        return None

    def kept(values):
        values = np.where(np.isfinite(values), values, np.float32(0)).astype(np.float32)
        return np.ascontiguousarray(values[numbers])

    out = {"POSITION": kept(positions), "_RADIUS": kept(radius)}
    for number, (kind, name) in enumerate(wanted.coordinates):
        uv = attributes.of_points(cloud, name) if kind == "uv" and name else None
        uv = np.zeros((len(positions), 2), dtype=np.float32) if uv is None else np.resize(uv[:, :2], (len(positions), 2)).copy()
        if kind == "object":
            uv = positions[:, :2].copy()
        uv[:, 1] = 1 - uv[:, 1]
        out[f"TEXCOORD_{number}"] = kept(uv)
    if wanted.color is not None and (color := attributes.of_points(cloud, wanted.color)) is not None:
        out["COLOR_0"] = kept(_as_color(color))
    for source in wanted.attributes:
        values = _attribute(cloud, source, positions, radius)
        if values is not None:
            out[attributes.file_name(source)] = kept(values)
    return out


def _as_color(values):
    """Four numbers of each point."""
    if values.shape[1] == 4:
        return values
    grey = np.repeat(values, 3, axis=1) if values.shape[1] == 1 else np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
    return np.concatenate([grey, np.ones((len(values), 1), dtype=np.float32)], axis=1)


def _attribute(cloud, source, positions, radius):
    kind, name = source
    if kind == "point":
        if name == "random":
            number = np.arange(len(radius), dtype=np.uint32)
            return attributes.hashed(number, np.zeros_like(number))
        return {"position": positions, "radius": radius, "is_point": np.ones_like(radius)}[name]
    return attributes.of_points(cloud, name) if kind in {"attribute", "color", "uv"} else None
