"""The displaced scenes: those that Cycles can dice, and two that no tessellation fits into memory.

`sphere`      960 triangles, a 2k map tiled 8×6
`landscape`   128 triangles, a 4k map tiled 2×2, seen from just above the ground
`torus`       5,120 triangles, a woven 2k map tiled 5×5
`pebbles`     300 instances of 480 triangles, a 1k map tiled 3×2
`glazed`      the torus and its map again, glossy
`scan`        17,684 triangles with the 4k map that was made for them; from the folder RELIEF_BENCH_DATA, which has
              meshes/lee_perry_smith.glb and maps/lee_perry_smith_disp_4k.jpg
`huge_torus`  8,192 triangles, a 4k map tiled 25×25: ten billion texels as seen
`huge_plane`  two triangles, one map of 16k × 16k

Base meshes have the normals that Blender computes, since Cycles' subdivision knows no others.
"""

import json
import math
import os
import struct
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts"))

import displaced_maps as maps  # noqa: E402
from examples import gltf, meshes  # noqa: E402

_RENDER = {"resolution": [1920, 1080], "samples": 16, "maxBounces": 4}


def _document(name):
    document = gltf.Document(name, dict(_RENDER))
    # One colour: Cycles would spend two seconds on the importance of a map, whatever its size.
    document.gltf["extensions"]["RELIEF_environment"] = {"color": [0.6, 0.75, 1.0], "strength": 0.7}
    document.add_sun((-0.7, 0.6, 0.5), (3.2, 2.8, 2.3))
    return document


def _grid(point, columns, rows, closed):
    """A mesh of columns × rows quads over point(a, b), a and b in 0…1, texture coordinates (a, b).

    @param  point   arrays a, b of one shape → positions, one more axis of 3; a grows to the right of b's direction
                    as seen from the front
    @param  closed  whether a = 0 and 1 are the same points, and b = 0 and 1: to the last bit
    """
    a, b = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows)
    positions = point(a % 1 if closed[0] else a, b % 1 if closed[1] else b).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    triangles = np.concatenate(
        [np.stack([corner, below, corner + 1], 1), np.stack([corner + 1, below, below + 1], 1)]
    )
    return _smooth_mesh(positions, triangles, np.stack([a.ravel(), b.ravel()], 1))


def _smooth_mesh(positions, triangles, uvs):
    """A mesh with smooth normals, closed where positions are equal; triangles between two copies of a place are left out."""
    vertices, merged = np.unique(positions, axis=0, return_inverse=True)
    merged = merged.ravel()
    triangles = triangles[[len(set(triangle)) == 3 for triangle in merged[triangles].tolist()]]
    normals = _angle_weighted_normals(vertices.astype(np.float64), merged[triangles])[merged]
    return meshes.Mesh(positions.tolist(), triangles.tolist(), normals.tolist(), uvs.tolist())


def _read_glb(path):
    """Positions, triangles and texture coordinates of a GLB file's one primitive."""
    with open(path, "rb") as file:
        data = file.read()
    (length,) = struct.unpack_from("<I", data, 12)
    gltf, start = json.loads(data[20 : 20 + length]), 28 + length

    def accessor(index, dtype, width):
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        offset = start + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return np.frombuffer(data, dtype, accessor["count"] * width, offset).reshape(-1, width)

    primitive = gltf["meshes"][0]["primitives"][0]
    indices = np.uint32 if gltf["accessors"][primitive["indices"]]["componentType"] == 5125 else np.uint16
    return (
        accessor(primitive["attributes"]["POSITION"], np.float32, 3),
        accessor(primitive["indices"], indices, 1).reshape(-1, 3).astype(np.int64),
        accessor(primitive["attributes"]["TEXCOORD_0"], np.float32, 2),
    )


def _angle_weighted_normals(vertices, triangles):
    """Unit normals of vertices: those of the triangles around, each weighted by its angle at the vertex."""
    P = vertices[triangles]
    faces = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    normals = np.zeros_like(vertices)
    for k in range(3):
        before, after = P[:, k - 1] - P[:, k], P[:, (k + 1) % 3] - P[:, k]
        cosine = (before * after).sum(1) / np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1)
        np.add.at(normals, triangles[:, k], faces * np.arccos(np.clip(cosine, -1, 1))[:, None])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _sphere(a, b):
    phi, theta = 2 * math.pi * a, math.pi * b
    ring = np.where((b == 0) | (b == 1), 0, np.sin(theta))
    return np.stack([ring * np.cos(phi), np.cos(theta), -ring * np.sin(phi)], -1)


def _torus(a, b):
    phi, tube = 2 * math.pi * a, 2 * math.pi * b
    radius = 1 + 0.42 * np.cos(tube)
    return np.stack([radius * np.cos(phi), -0.42 * np.sin(tube), -radius * np.sin(phi)], -1)


def _hills(a, b):
    x, z = 20 * (2 * a - 1), 20 * (2 * b - 1)
    return np.stack([x, 1.2 * np.sin(0.21 * x) * np.cos(0.17 * z) + 0.6 * np.sin(0.3 * z), z], -1)


def _plane(a, b):
    return np.stack([8 * (2 * a - 1), 0 * a, 8 * (2 * b - 1)], -1)


def _add_displaced(document, mesh, color, height, map_size, scale, tiles, **properties):
    texture = document.add_texture("heights.png", maps.encode_png(height, map_size))
    material = gltf.displaced(gltf.lambert("displaced", color), texture, scale, 0.5, tiles)
    document.add_node("displaced", mesh=document.add_mesh("base", mesh, document.add_material(material)), **properties)


def sphere():
    document = _document("sphere")
    mesh = _grid(_sphere, 32, 16, (True, False))
    _add_displaced(document, mesh, (0.55, 0.5, 0.4), maps.domes, 2048, 0.12, (8, 6))
    document.add_camera((1.6, 1.1, 3.1), (0, 0, 0), 36)
    return document


def landscape():
    document = _document("landscape")
    mesh = _grid(_hills, 8, 8, (False, False))
    _add_displaced(document, mesh, (0.45, 0.38, 0.3), maps.rock, 4096, 3.0, (2, 2))
    document.add_camera((3, 4.5, 17), (-1, 0.8, 0), 34)
    return document


def torus():
    document = _document("torus")
    mesh = _grid(_torus, 64, 40, (True, True))
    _add_displaced(document, mesh, (0.5, 0.3, 0.14), maps.weave, 2048, 0.09, (5, 5))
    document.add_camera((0.4, 2.2, 2.6), (0, -0.05, 0.05), 36)
    return document


def pebbles():
    document = _document("pebbles")
    document.add_node("ground", mesh=document.add_mesh(
        "ground", _grid(_plane, 1, 1, (False, False)), document.add_material(gltf.lambert("ground", (0.4, 0.36, 0.3)))))  # fmt: skip
    texture = document.add_texture("heights.png", maps.encode_png(maps.rock, 1024))
    material = document.add_material(gltf.displaced(gltf.lambert("pebble", (0.5, 0.47, 0.42)), texture, 0.5, 0.5, (3, 2)))
    mesh = document.add_mesh("pebble", _grid(_sphere, 24, 12, (True, False)), material)
    random = np.random.default_rng(3)
    places, sizes = random.uniform((-4, 0, -4), (4, 0, 4), (300, 3)), random.uniform(0.08, 0.3, 300)
    places[:, 1] = 0.7 * sizes
    turns = random.normal(size=(300, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    document.add_instances("pebbles", mesh, places.tolist(), turns.tolist(), np.repeat(sizes[:, None], 3, 1).tolist())
    document.add_camera((0.6, 1.9, 5.2), (0, 0, 0.6), 34)
    return document


def glazed():
    document = _document("glazed")
    texture = document.add_texture("heights.png", maps.encode_png(maps.weave, 2048))
    material = gltf.displaced(gltf.dielectric("glaze", (0.06, 0.2, 0.25), 0.2), texture, 0.09, 0.5, (5, 5))
    mesh = document.add_mesh("base", _grid(_torus, 64, 40, (True, True)), document.add_material(material))
    document.add_node("displaced", mesh=mesh)
    document.add_camera((0.4, 2.2, 2.6), (0, -0.05, 0.05), 36)
    return document


def scan():
    data = os.environ.get("RELIEF_BENCH_DATA")
    if data is None:
        sys.exit("scan: RELIEF_BENCH_DATA names no folder of meshes and maps")
    document = _document("scan")
    with open(os.path.join(data, "maps", "lee_perry_smith_disp_4k.jpg"), "rb") as file:
        texture = document.add_texture("heights.jpg", file.read())
    mesh = _smooth_mesh(*_read_glb(os.path.join(data, "meshes", "lee_perry_smith.glb")))
    material = gltf.displaced(gltf.dielectric("skin", (0.5, 0.33, 0.26), 0.45), texture, 0.5, 0.5)
    document.add_node("scan", mesh=document.add_mesh("head", mesh, document.add_material(material)))
    document.add_camera((1.5, 0.6, 11.0), (0, -0.1, 0), 34)
    return document


def huge_torus():
    document = _document("huge_torus")
    mesh = _grid(_torus, 64, 64, (True, True))
    _add_displaced(document, mesh, (0.5, 0.4, 0.3), maps.rock, 4096, 0.04, (25, 25))
    document.add_camera((0.4, 2.2, 2.6), (0, -0.05, 0.05), 36)
    return document


def huge_plane():
    document = _document("huge_plane")
    mesh = _grid(_plane, 1, 1, (False, False))
    _add_displaced(document, mesh, (0.45, 0.38, 0.3), maps.cliffs, 16384, 1.2, (1, 1))
    document.add_camera((1.5, 2.6, 8.5), (-0.5, 0, 1.5), 40)
    return document


COMPARED = {
    "sphere": sphere,
    "landscape": landscape,
    "torus": torus,
    "pebbles": pebbles,
    "glazed": glazed,
    "scan": scan,
}
HUGE = {"huge_torus": huge_torus, "huge_plane": huge_plane}
