# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's lights in relief's units.

What Blender means by power, and what the scene format wants (checked against Cycles, tests/blender/light_test.py):

    point, spot   P watts    radiant intensity P / 4π   a spot is a point behind a screen: its cone takes from P
    sun           E W/m²     irradiance E
    area          P watts    radiance P / πA            before 4.0 P / 4A: a factor older than Blender's watts

Sizes: points and spots shine from a ball or from a disk that faces each point, a sun is seen under an angle from everywhere.
"""

import math
from dataclasses import dataclass
from typing import Callable

import numpy as np

from .. import compat
from .light_graph import multiplied, read_emission

#: The widest sun that is understood.
_WIDEST_SUN = math.pi * 0.99

#: The least spread of an area light.
_NARROWEST_SPREAD = math.radians(1)

#: The narrowest edge of a spot, as a difference of cosines: the format wants two different cones.
_NARROWEST_EDGE = 1e-6


@dataclass
class Place:
    """Where a light stands, and what its export needs.

    node               glTF node without scale: its −Z is the light's direction; its children are nodes, not indices yet
    scale              of Blender's object along X, Y and Z: areas follow the first two
    visible_to_camera  whether its surface is seen
    random             what Object Info says of the light's object
    writer             GltfWriter
    images             ImageExporter
    warn               called with what is not understood, and what was used instead
    """

    node: dict
    scale: tuple
    visible_to_camera: bool
    random: float
    writer: object
    images: object
    warn: Callable


def export_light(light, place):
    """Adds a bpy light to the node of its place."""
    color, graph = compat.light_color(light), None
    if light.use_nodes:
        factor = read_emission(light, place.random, place.writer, place.images, place.warn)
        if isinstance(factor, list):
            color = tuple(a * b for a, b in zip(color, factor))
        else:
            graph = factor
    energy = compat.light_energy(light, place.scale)
    sizes = [getattr(light, name, 0.0) for name in ("shadow_soft_size", "size", "size_y", "angle", "spot_size")]
    if not all(math.isfinite(value) for value in (energy, *color, *sizes)):
        place.warn("a power, colour or size that is not finite", "it is left out")
        return
    if compat.is_portal(light):
        return
    if not compat.casts_shadow(light):
        place.warn("a light without shadows", "it casts them")
    signs = [math.copysign(1.0, energy * c) for c in color]
    if min(signs) < 0 and energy * any(color) != 0:
        graph = multiplied(graph, signs)
    energy, color = abs(energy), [abs(c) for c in color]
    own = {"graph": graph} if graph else {}
    if light.type == "POINT":
        value = {"type": "point", "intensity": energy / (4 * math.pi)}
        if light.shadow_soft_size > 0 or own:
            place.writer.extend(value, "RELIEF_light", {**_size(light, place), **own})
        _add_punctual(place, value, color)
    elif light.type == "SPOT":
        if compat.SPOTS_ARE_SCALED and max(place.scale) > 1.001 * min(place.scale):
            place.warn("the uneven scale of a spot", "its cone is round")
        _add_punctual(place, _spot(light, energy / (4 * math.pi), own, place), color)
    elif light.type == "SUN":
        value = {"type": "directional", "intensity": energy}
        if light.angle > 0:
            angle = min(light.angle, _WIDEST_SUN)
            own = {"angle": angle, **own}
            if compat.SUNS_ARE_FLAT:
                # The format has the irradiance that it causes on a plane across.
                cosine = math.cos(angle / 2)
                value["intensity"] *= 2 * cosine / (1 + cosine)
                own["shape"] = "disk"
        if own:
            place.writer.extend(value, "RELIEF_light", own)
        _add_punctual(place, value, color)
    else:
        _add_area(place, light, color, energy, own)


def _add_punctual(place, light, color):
    lights = place.writer.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
    value = {**light, "color": list(color)}
    if value not in lights:
        lights.append(value)
    place.writer.extend(place.node, "KHR_lights_punctual", {"light": lights.index(value)})


def _add_child(place, child, name, value):
    """Puts a light extension on a node below the light's own."""
    place.writer.extend(child, name, value)
    place.node["children"] = [child]


def _spot(light, intensity, own, place):
    """A spot, with what RELIEF_light has of its own."""
    outer = min(light.spot_size / 2, math.pi / 2)
    cos_outer = math.cos(outer)
    # Blender's edge takes a share of 1 − cos(outer).
    cos_inner = cos_outer + max((1 - cos_outer) * light.spot_blend, _NARROWEST_EDGE)
    out = {"type": "spot", "intensity": intensity}
    out["spot"] = {"innerConeAngle": math.acos(min(cos_inner, 1.0)), "outerConeAngle": outer}
    place.writer.extend(out, "RELIEF_light", {"falloff": compat.SPOT_FALLOFF, **_size(light, place), **own})
    return out


def _size(light, place):
    """The part of RELIEF_light that is the size of a point or spot."""
    return {
        "radius": light.shadow_soft_size,
        "shape": "disk" if compat.faces_viewer(light) else "ball",
        "visibleToCamera": place.visible_to_camera,
    }


def _add_area(place, light, color, energy, own):
    round_shape = light.shape in {"DISK", "ELLIPSE"}
    width = light.size * place.scale[0]
    height = (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size) * place.scale[1]
    area = width * height * (math.pi / 4 if round_shape else 1)
    if area <= 0:
        return
    value = {"radiance": energy / (compat.AREA_DIVISOR * area), "color": list(color), "visibleToCamera": place.visible_to_camera}
    value.update(own)
    if light.spread < math.pi - 1e-4:
        if light.spread < _NARROWEST_SPREAD and compat.SPREADS_TO_NOTHING:
            place.warn("a spread of less than a degree", "it spreads by a degree")
        value["spread"] = max(light.spread, _NARROWEST_SPREAD)
        value["radiance"] *= _spread_gain(value["spread"])
    if round_shape:
        # A disk of diameter 1, stretched by a node: ellipses have no shape of their own in the format.
        value.update(shape="disk", radius=0.5)
        _add_child(place, {"scale": [width, height, 1.0]}, "RELIEF_area_light", value)
    else:
        value.update(shape="rectangle", width=width, height=height)
        place.writer.extend(place.node, "RELIEF_area_light", value)


def _spread_gain(spread):
    """What rounding makes of a narrow light in Cycles before 4.0, which takes the difference of nearly equal numbers in single
    precision: 1.25 at a degree, 1.007 at three.

    @param  spread  radians, below π
    """
    if compat.SPREADS_TO_NOTHING:
        return 1.0
    one, pi = np.float32, np.float32(math.pi)
    angle = one(0.5) * (pi - one(spread))
    rounded = one(2) / (one(2) + (one(2) * angle - pi) * np.tan(angle))
    tangent = math.tan(spread / 2)
    return float(rounded) * (tangent - spread / 2) / tangent


def set_emission(material, radiance, writer):
    """Emission of a material: glTF's factor ends at 1, an extension goes on."""
    largest = max(radiance)
    if largest <= 0:
        material["emissiveFactor"] = [0, 0, 0]
        return
    material["emissiveFactor"] = [max(0.0, c / largest) for c in radiance]
    writer.extend(material, "KHR_materials_emissive_strength", {"emissiveStrength": largest})
