#!/usr/bin/python3
"""Checks the conversion from relief's scene format to Cycles against closed forms, by rendering.

Each check makes a small scene, renders it through render_cycles.py and compares radiance with what can be computed
by hand: camera framing, the orientation of the environment, light units, one-sidedness, texture coordinates,
Fresnel, absorption, depth of field. Needs Blender and numpy; takes about a minute. Exit code 1 if any check fails.
"""

import math
import os
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(_FOLDER, "..", "..", "scripts"))

from examples import gltf, images, meshes, vector  # noqa: E402
from exr import read_rgb  # noqa: E402
from render_cycles import render_cycles  # noqa: E402

_ALBEDO = (0.8, 0.5, 0.2)


def _document(resolution=(8, 8), max_bounces=0):
    return gltf.Document("check", {"resolution": list(resolution), "maxBounces": max_bounces})


def _render(document, samples):
    """The picture of a scene, shape (height, width, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        document.save(folder)
        output = os.path.join(folder, "out.exr")
        runs = [{"samples": samples, "seed": 1, "output": output}]
        result = render_cycles(os.path.join(folder, "check.gltf"), runs)
        if result["approximate"]:
            raise AssertionError(f"a material meant to be exact is not: {result['approximate']}")
        return read_rgb(output)


def _add_floor(document):
    """A Lambertian floor at y = 0, watched from above through a field of view of 0.2 degrees."""
    material = document.add_material(gltf.lambert("floor", _ALBEDO))
    floor = meshes.quad((-50, 0, 50), (100, 0, 0), (0, 0, -100))
    document.add_node("floor", mesh=document.add_mesh("floor", floor, material))
    document.add_camera((1e-3, 0.5, 0), (0, 0, 0), 0.2)


def _floor_radiance(irradiance):
    return np.array(_ALBEDO) * irradiance / math.pi


def _rectangle_irradiance(width, height, distance, radiance):
    """Irradiance below the centre of a parallel rectangle (four form factors, one a corner)."""
    a, b = width / 2 / distance, height / 2 / distance
    ra, rb = math.sqrt(1 + a * a), math.sqrt(1 + b * b)
    corner = (a / ra * math.atan(b / ra) + b / rb * math.atan(a / rb)) / (2 * math.pi)
    return 4 * corner * math.pi * radiance


def check_point_light():
    """A point light of I W/sr gives E = I / h²."""
    document = _document()
    _add_floor(document)
    lights = [{"type": "point", "color": [1, 1, 1], "intensity": 5.0}]
    document.gltf["extensions"]["KHR_lights_punctual"] = {"lights": lights}
    document.add_node("light", translation=[0, 2, 0], extensions={"KHR_lights_punctual": {"light": 0}})
    return _render(document, 16).mean(axis=(0, 1)), _floor_radiance(5.0 / 4.0), 1e-3


def check_sun():
    """A sun of E W/m² across its direction gives E cos θ."""
    document = _document()
    _add_floor(document)
    document.add_sun((1, 2, 2), (3.0, 3.0, 3.0))
    return _render(document, 16).mean(axis=(0, 1)), _floor_radiance(3.0 * 2 / 3), 1e-3


def check_area_light_radiance():
    """A rectangle of given radiance, seen from below its centre: the form factor of a parallel rectangle."""
    document = _document()
    _add_floor(document)
    document.add_area_light("light", (0, 2, 0), (1e-6, 0, 0), 3.0, 1.0, (4.0, 4.0, 4.0))
    return (
        _render(document, 256).mean(axis=(0, 1)),
        _floor_radiance(_rectangle_irradiance(3.0, 1.0, 2.0, 4.0)),
        3e-3,
    )


def check_area_light_power():
    """A disk of P watts has radiance P / (π · area); below its centre E = π L r² / (r² + h²)."""
    document = _document()
    _add_floor(document)
    light = {"shape": "disk", "radius": 1.5, "power": 40.0}
    document.add_node(
        "light",
        translation=[0, 2, 0],
        rotation=list(vector.look_at((0, 2, 0), (1e-6, 0, 0))),
        extensions={"RELIEF_area_light": light},
    )
    radiance = 40.0 / (math.pi * math.pi * 1.5**2)
    expected = _floor_radiance(math.pi * radiance * 1.5**2 / (1.5**2 + 4.0))
    return _render(document, 256).mean(axis=(0, 1)), expected, 3e-3


def check_area_light_back():
    """Nothing leaves the back of an area light."""
    document = _document()
    _add_floor(document)
    document.add_area_light("light", (0, 2, 0), (1e-6, 5, 0), 3.0, 1.0, (4.0, 4.0, 4.0))
    return _render(document, 64).mean(axis=(0, 1)), np.zeros(3), 1e-6


def check_area_light_visible():
    """The camera sees an area light with its radiance."""
    document = _document()
    document.add_area_light("light", (0, 0, -2), (0, 0, 0), 3.0, 3.0, (4.0, 2.0, 1.0))
    document.add_camera((0, 0, 0), (0, 0, -1), 20)
    return _render(document, 16).mean(axis=(0, 1)), np.array((4.0, 2.0, 1.0)), 1e-3


def _emissive_quad(document, faces_down):
    material = document.add_material(gltf.emitter("lamp", (4.0, 4.0, 4.0)))
    # Not larger: Cycles 3.4 itself loses light of large emissive triangles, 0.4 % of a 3 m × 1 m quad at 2 m, 1.4 %
    # at 6 m, nothing of this one.
    lamp = meshes.quad((-0.75, 2, -0.25), (1.5, 0, 0), (0, 0, 0.5))  # its front looks down
    document.add_node(
        "lamp", mesh=document.add_mesh("lamp", lamp if faces_down else meshes.inside_out(lamp), material)
    )


def check_emissive_mesh():
    """An emissive quad lights like a rectangle of that radiance."""
    document = _document()
    _add_floor(document)
    _emissive_quad(document, faces_down=True)
    expected = _floor_radiance(_rectangle_irradiance(1.5, 0.5, 2.0, 4.0))
    return _render(document, 1024).mean(axis=(0, 1)), expected, 2e-3


def check_emissive_mesh_back():
    """Nothing leaves the back of an emissive mesh."""
    document = _document()
    _add_floor(document)
    _emissive_quad(document, faces_down=False)
    return _render(document, 64).mean(axis=(0, 1)), np.zeros(3), 1e-6


def check_emissive_mirrored():
    """A mesh under a negative scale keeps its front: mirrored in x, the lamp still shines down."""
    document = _document()
    _add_floor(document)
    _emissive_quad(document, faces_down=True)
    document.gltf["nodes"][-1]["scale"] = [-1, 1, 1]
    expected = _floor_radiance(_rectangle_irradiance(1.5, 0.5, 2.0, 4.0))
    return _render(document, 1024).mean(axis=(0, 1)), expected, 2e-3


def check_environment_and_camera():
    """A map that is linear in the direction, seen through a skewed camera: every pixel is known."""
    width, height, rotation = 48, 32, 0.7
    document = _document((width, height))

    def radiance(direction):
        return tuple(1.0 + 0.9 * component for component in direction)

    document.set_environment(
        "map.hdr", images.environment(radiance, 1024, 512), rotation=rotation, strength=1.5
    )
    eye, target, degrees = (1.0, 2.0, 3.0), (-3.0, 3.5, 2.0), 50.0
    document.add_camera(eye, target, degrees)
    back = vector.normalize(vector.subtract(eye, target))
    right = vector.normalize(vector.cross((0.0, 1.0, 0.0), back))
    up = vector.cross(back, right)
    half = math.tan(math.radians(degrees) / 2)
    expected = np.empty((height, width, 3))
    for y in range(height):
        for x in range(width):
            across = (2 * (x + 0.5) / width - 1) * half * width / height
            above = (1 - 2 * (y + 0.5) / height) * half
            d = vector.normalize(
                vector.subtract(vector.add(vector.scale(right, across), vector.scale(up, above)), back)
            )
            # The surroundings turn by +rotation about +Y, so the map is looked up at −rotation.
            c, s = math.cos(rotation), math.sin(rotation)
            expected[y, x] = [1.5 * v for v in radiance((c * d[0] - s * d[2], d[1], s * d[0] + c * d[2]))]
    return _render(document, 256), expected, 8e-3


def check_texture():
    """sRGB colours of four texels, nearest, on a quad that fills the view: top left of the file is v = 0."""
    document = _document((4, 4))
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [1, 1, 1]}
    texels = [[(255, 0, 0), (0, 188, 0)], [(0, 0, 128), (255, 255, 255)]]
    texture = document.add_texture("texels.png", images.png(texels), nearest=True)
    mesh = meshes.quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    mesh.uvs = [(0, 1), (1, 1), (1, 0), (0, 0)]
    material = document.add_material(gltf.lambert("texels", (1, 1, 1), texture))
    document.add_node("quad", mesh=document.add_mesh("quad", mesh, material))
    document.add_camera((0, 0, 10), (0, 0, 0), math.degrees(2 * math.atan(0.1)))

    def linear(code):
        value = code / 255
        return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4

    expected = np.array([[[linear(code) for code in texel] for texel in row] for row in texels])
    expected = expected.repeat(2, axis=0).repeat(2, axis=1)
    return _render(document, 256), expected, 3e-3


def check_mirror():
    """A metal of roughness 0 under a constant sky reflects Schlick's F0 + (1 − F0)(1 − cos θ)⁵; here θ = 75°."""
    document = _document(max_bounces=2)
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [1, 1, 1]}
    color = (0.9, 0.5, 0.1)
    material = document.add_material(gltf.metal("mirror", color, 0.0))
    floor = meshes.quad((-50, 0, 50), (100, 0, 0), (0, 0, -100))
    document.add_node("floor", mesh=document.add_mesh("floor", floor, material))
    angle = math.radians(75)
    document.add_camera((math.sin(angle), math.cos(angle), 0), (0, 0, 0), 0.05)
    expected = np.array(color) + (1 - np.array(color)) * (1 - math.cos(angle)) ** 5
    return _render(document, 16).mean(axis=(0, 1)), expected, 1e-3


def check_glass_slab():
    """A slab of absorbing glass in a constant sky, looked at squarely: the sum over all inner reflections."""
    document = _document(max_bounces=32)
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [1, 1, 1]}
    color, distance, thickness, ior = (0.8, 0.3, 0.05), 0.5, 0.4, 1.6
    material = document.add_material(gltf.glass("glass", ior, 0.0, color, distance))
    document.add_node("slab", mesh=document.add_mesh("slab", meshes.box((4, 4, thickness)), material))
    document.add_camera((0, 2, 5), (0, 2, 0), 0.05)
    f = ((ior - 1) / (ior + 1)) ** 2
    a = np.array(color) ** (thickness / distance)
    reflected = f + (1 - f) ** 2 * f * a**2 / (1 - f**2 * a**2)
    transmitted = (1 - f) ** 2 * a / (1 - f**2 * a**2)
    return _render(document, 4096).mean(axis=(0, 1)), reflected + transmitted, 4e-3


def check_depth_of_field():
    """A small lamp behind the plane of focus spreads over a disk of radius r (z − f) / z on that plane."""
    radius, focus, depth, degrees, size = 0.05, 2.0, 4.0, 10.0, 64
    document = _document((size, size))
    side = 0.01
    lamp = meshes.quad((-side / 2, -side / 2, -depth), (side, 0, 0), (0, side, 0))
    material = document.add_material(gltf.emitter("lamp", (1.0, 1.0, 1.0)))
    document.add_node("lamp", mesh=document.add_mesh("lamp", lamp, material))
    document.add_camera(
        (0, 0, 0), (0, 0, -1), degrees, {"apertureRadius": radius, "focusDistance": focus}
    )
    picture = _render(document, 4096)[:, :, 1]
    pixel = 2 * focus * math.tan(math.radians(degrees) / 2) / size
    centers = (np.arange(size) + 0.5 - size / 2) * pixel
    second_moment = (picture.sum(axis=0) * centers**2).sum() / picture.sum()
    # A uniform disk has R²/4 about each axis; the lamp and the pixel add their own w²/12.
    blur = radius * (depth - focus) / depth
    expected = blur**2 / 4 + (side * focus / depth) ** 2 / 12 + pixel**2 / 12
    return np.array([math.sqrt(second_moment)]), np.array([math.sqrt(expected)]), 1e-2


CHECKS = [value for name, value in list(globals().items()) if name.startswith("check_")]


def main():
    wanted = sys.argv[1:]
    num_failed = 0
    for check in CHECKS:
        if wanted and check.__name__ not in wanted:
            continue
        measured, expected, tolerance = check()
        # Relative to the picture's own scale, so that a zero channel does not ask for infinite accuracy.
        error = np.abs(measured - expected).max() / max(np.abs(expected).max(), 1.0 if tolerance < 1e-5 else 1e-12)
        passed = error <= tolerance
        num_failed += not passed
        print(f"{'ok  ' if passed else 'FAIL'} {check.__name__}: error {error:.2e}, allowed {tolerance:.0e}", flush=True)
        if not passed:
            print(f"     measured {measured.reshape(-1, measured.shape[-1])[:4].round(5).tolist()}")
            print(f"     expected {expected.reshape(-1, expected.shape[-1])[:4].round(5).tolist()}")
    sys.exit(1 if num_failed else 0)


if __name__ == "__main__":
    main()
