"""A small shot for tests of whole runs: a white square that slides under a grey sky, and what its pictures say."""

import json
import os
import pathlib
import struct
import subprocess

TINY = ["--resolution", "24x16", "--spp", "16"]


def write_shot(path, spin=1.0):
    """Writes a scene of `path` and a buffer beside it; one second of animation."""
    path = pathlib.Path(path)
    corners = struct.pack("<12f", -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0)
    data = corners + struct.pack("<6H", 0, 1, 2, 0, 2, 3) + struct.pack("<2f", 0, 1) + struct.pack("<6f", 0, 0, 0, spin, 0.5, -1)
    path.with_suffix(".bin").write_bytes(data)
    views = [(0, 48), (48, 12), (60, 8), (68, 24)]
    accessors = [(0, 5126, 4, "VEC3", [-1, -1, 0], [1, 1, 0]), (1, 5123, 6, "SCALAR", [0], [3]), (2, 5126, 2, "SCALAR", [0], [1]),
                 (3, 5126, 2, "VEC3", [0, 0, -1], [spin, 0.5, 0])]
    scene = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 4]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.9, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": path.with_suffix(".bin").name.replace(" ", "%20"), "byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views],
        "accessors": [{"bufferView": view, "componentType": kind, "count": count, "type": shape, "min": low, "max": high}
                      for view, kind, count, shape, low, high in accessors],
        "animations": [{"samplers": [{"input": 2, "output": 3}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
        "extensionsUsed": ["RELIEF_environment"],
        "extensions": {"RELIEF_environment": {"color": [0.5, 0.6, 0.7]}},
    }
    path.write_text(json.dumps(scene))


def run(program, *words, folder=None, check=True, **environment):
    return subprocess.run([program, *map(str, words)], cwd=folder, env={**os.environ, **environment}, text=True, capture_output=True,
                          check=check, stdin=subprocess.DEVNULL)


def difference(program, a, b, layer="beauty"):
    """Figures of relief compare."""
    return json.loads(run(program, "compare", a, b, "--layer", layer, "--json", "-").stdout)
