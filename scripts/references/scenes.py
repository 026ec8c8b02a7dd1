"""Small scenes that references are made of; each covers what no example isolates. `build_…` return a `Document`."""

import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from examples import gltf, meshes, vector  # noqa: E402

from .exr_write import write_exr  # noqa: E402

RESOLUTION = (64, 48)
FLOOR_COLOR = (0.75, 0.5, 0.25)
CAMERA = {"eye": (0.0, 1.0, 4.0), "target": (0.0, 0.0, 0.5), "vertical_degrees": 22.0}

# Above the picture, leaning towards the camera: the far end of the floor lies behind it and stays dark.
RECTANGLE = {"eye": (0.3, 1.6, -0.5), "target": (0.0, 0.0, 0.6), "width": 1.2, "height": 0.7, "radiance": (6.0, 7.0, 8.0)}

SUN = {"towards": (0.4, 1.0, 0.3), "irradiance": (1.0, 0.9, 0.8)}
POINT = {"position": (-0.8, 0.7, 0.2), "intensity": (0.3, 0.5, 0.9)}
SPOT = {"eye": (0.9, 2.0, 0.5), "target": (0.5, 0.0, 0.9), "intensity": (4.0, 3.0, 1.0), "inner": 0.12, "outer": 0.3}
# Keeps the sun from part of the floor; too high up for the picture.
BLOCKER = {"corner": (-1.2, 2.6, 0.2), "edge_u": (1.3, 0.0, 0.2), "edge_v": (0.1, 0.3, 0.9)}

ROTATION = 0.7
POLYHEDRON_CAMERA = {"eye": (1.5, 1.2, 4.0), "target": (0.0, 0.0, 0.0), "vertical_degrees": 34.0}


def _document(name, max_bounces):
    render = {"resolution": list(RESOLUTION), "samples": 64, "maxBounces": max_bounces}
    render["pixelFilter"] = {"type": "box", "width": 1}
    return gltf.Document(name, render)


def _add_floor(document):
    material = document.add_material(gltf.lambert("floor", FLOOR_COLOR))
    ground = meshes.quad((-30, 0, 30), (60, 0, 0), (0, 0, -60))
    document.add_node("floor", mesh=document.add_mesh("floor", ground, material))


def build_rectangle_floor():
    document = _document("rectangle_floor", 4)
    _add_floor(document)
    document.add_area_light("light", **RECTANGLE)
    document.add_camera(**CAMERA)
    return document


def build_punctual_floor():
    document = _document("punctual_floor", 0)
    _add_floor(document)
    black = document.add_material(gltf.lambert("blocker", (0, 0, 0)))
    blocker = meshes.quad(BLOCKER["corner"], BLOCKER["edge_u"], BLOCKER["edge_v"])
    document.add_node("blocker", mesh=document.add_mesh("blocker", blocker, black))
    document.add_sun(SUN["towards"], SUN["irradiance"])
    lights = document.gltf["extensions"]["KHR_lights_punctual"]["lights"]
    for kind, light, placement in (
        ("point", POINT, {"translation": list(POINT["position"])}),
        (
            "spot",
            SPOT,
            {"translation": list(SPOT["eye"]), "rotation": list(vector.look_at(SPOT["eye"], SPOT["target"]))},
        ),
    ):
        strength = max(light["intensity"])
        color = [channel / strength for channel in light["intensity"]]
        lights.append({"type": kind, "color": color, "intensity": strength})
        if kind == "spot":
            lights[-1]["spot"] = {"innerConeAngle": SPOT["inner"], "outerConeAngle": SPOT["outer"]}
        document.add_node(kind, **placement, extensions={"KHR_lights_punctual": {"light": len(lights) - 1}})
    document.add_camera(**CAMERA)
    return document


def environment_map():
    """A lat-long map without any symmetry, a small bright lamp in it: float array of shape (16, 32, 3)."""
    rows, columns = np.mgrid[0:16, 0:32]
    map_ = np.stack([0.2 + 0.02 * columns, 0.1 + 0.05 * rows, 0.9 - 0.015 * columns - 0.02 * rows], axis=-1)
    map_[4:6, 9:11] = (40.0, 30.0, 20.0)
    return map_.astype(np.float32).astype(np.float64)


def polyhedron():
    """A regular icosahedron: convex, so that its faces see nothing but the environment."""
    return meshes.icosphere(0)


def build_environment_polyhedron():
    document = _document("environment_polyhedron", 4)
    material = document.add_material(gltf.lambert("solid", FLOOR_COLOR))
    document.add_node("solid", mesh=document.add_mesh("solid", polyhedron(), material))
    document.gltf["extensions"]["RELIEF_environment"] = {
        "uri": "environment_polyhedron.exr",
        "rotation": ROTATION,
        "visibleToCamera": False,
    }
    document.add_camera(**POLYHEDRON_CAMERA)
    return document


def build_glass_gem():
    """Coloured glass with flat faces, a mirror and a checker of two diffuse colours under a uniform sky."""
    document = _document("glass_gem", 12)
    glass = document.add_material(gltf.glass("glass", ior=1.5, attenuation=(0.3, 0.8, 0.6), distance=0.8))
    gem = document.add_mesh("gem", meshes.icosphere(1), glass)
    mirror = document.add_material(gltf.metal("mirror", (0.9, 0.8, 0.6), 0.0))
    ball = document.add_mesh("mirror", meshes.icosphere(0), mirror)
    document.add_node("gem", mesh=gem, translation=[-0.75, 0.96, 0.2])
    document.add_node("mirror", mesh=ball, translation=[1.0, 0.66, -0.3], scale=[0.7, 0.7, 0.7])
    for i, color in enumerate([(0.7, 0.2, 0.1), (0.2, 0.4, 0.7)]):
        material = document.add_material(gltf.lambert(f"floor {i}", color))
        tiles = [
            meshes.quad((x, 0, z + 1), (1, 0, 0), (0, 0, -1))
            for x in range(-5, 5)
            for z in range(-6, 4)
            if (x + z) % 2 == i
        ]
        document.add_node(f"floor {i}", mesh=document.add_mesh(f"floor {i}", meshes.joined(tiles), material))
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [0.8, 0.9, 1.0], "strength": 1.5}
    document.add_camera((0.0, 2.2, 5.5), (0.0, 0.6, 0.0), 34.0)
    return document


SCENES = {
    "rectangle_floor": build_rectangle_floor,
    "punctual_floor": build_punctual_floor,
    "environment_polyhedron": build_environment_polyhedron,
    "glass_gem": build_glass_gem,
}


def save(name, folder):
    """Writes a scene's files; the environment is stored as floats, which no rounding separates from its closed form."""
    SCENES[name]().save(folder)
    if name == "environment_polyhedron":
        map_ = environment_map()
        write_exr(os.path.join(folder, f"{name}.exr"), {c: map_[..., i] for i, c in enumerate("RGB")})
