#!/usr/bin/env python3
"""Seconds a frame of animations: each frame by a process of its own, by one run with --frames, and by `relief serve`.

    benchmarks/frames/frames.py RELIEF [NAME…]

Makes its scenes in a temporary folder; needs numpy. In each the camera moves; in `object` a small object moves too. With
`relief serve` the camera comes from a file of its own, as from the add-on. Pictures are small: what is measured is what comes
before sampling. Of each way the median of the frames after the first is printed, as a row of a Markdown table.
"""

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

import numpy as np

FRAMES = 6
SMALL = ["--resolution", "160x90", "--spp", "1", "--compression", "none", "--aov", "beauty"]
EXAMPLES = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "examples")


def write_png(path, texels):
    """A grey (height, width) or RGB image, 8 or 16 bits."""
    height, width = texels.shape[:2]
    bits, kind = 8 * texels.dtype.itemsize, 2 if texels.ndim == 3 else 0
    rows = texels.astype(texels.dtype.newbyteorder(">")).reshape(height, -1)
    data = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(data, 1)) + chunk(b"IEND", b""))


class Writer:
    """A glTF file in the making."""

    def __init__(self, folder):
        self.folder = folder
        self.bytes = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "extensionsUsed": []}

    def push(self, kind, value):
        self.json.setdefault(kind, []).append(value)
        return len(self.json[kind]) - 1

    def accessor(self, array, kind):
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": array.nbytes}
        self.bytes += array.tobytes()
        component = 5126 if array.dtype == np.float32 else 5125
        value = {"bufferView": self.push("bufferViews", view), "componentType": component, "count": len(array), "type": kind}
        if kind == "VEC3":
            value.update(min=array.min(axis=0).tolist(), max=array.max(axis=0).tolist())
        return self.push("accessors", value)

    def node(self, **node):
        self.json["scenes"][0]["nodes"].append(self.push("nodes", node))
        return len(self.json["nodes"]) - 1

    def grid(self, side, material, height=0.0):
        """A square of 2 m with 2 side² triangles; returns the mesh."""
        u, v = (a.ravel().astype(np.float32) for a in np.meshgrid(*[np.linspace(0, 1, side + 1)] * 2))
        bumps = (height * np.sin(40 * u) * np.sin(50 * v)).astype(np.float32)
        P = np.stack([2 * u - 1, bumps, 1 - 2 * v], axis=1)
        first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
        corners = np.stack([first, first + 1, first + side + 1, first + side + 1, first + 1, first + side + 2], axis=1)
        N = np.tile(np.float32([0, 1, 0]), (len(P), 1))
        attributes = {"POSITION": self.accessor(P, "VEC3"), "NORMAL": self.accessor(N, "VEC3")}
        attributes["TEXCOORD_0"] = self.accessor(np.stack([u, v], axis=1), "VEC2")
        indices = self.accessor(corners.ravel().astype(np.uint32), "SCALAR")
        return self.push("meshes", {"primitives": [{"attributes": attributes, "indices": indices, "material": material}]})

    def animate(self, node, first, last):
        times = self.accessor(np.float32([0, FRAMES / 24]), "SCALAR")
        places = self.accessor(np.float32([first, last]), "VEC3")
        animation = self.json.setdefault("animations", [{"samplers": [], "channels": []}])[0]
        animation["samplers"].append({"input": times, "output": places})
        target = {"node": node, "path": "translation"}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})

    def write(self):
        self.json["extensions"] = {"RELIEF_environment": {"color": [1, 1, 1]}}
        self.json["extensionsUsed"] = ["RELIEF_environment", "RELIEF_displacement"]
        camera = {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}
        eye = self.node(camera=self.push("cameras", camera), translation=[0, 0.5, 2])
        self.animate(eye, [0, 0.5, 2], [0.5, 0.5, 2])
        with open(os.path.join(self.folder, "scene.bin"), "wb") as file:
            file.write(self.bytes)
        self.json["buffers"] = [{"uri": "scene.bin", "byteLength": len(self.bytes)}]
        with open(os.path.join(self.folder, "scene.gltf"), "w", encoding="utf-8") as file:
            json.dump(self.json, file)
        view = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "cameras": [camera]}
        return os.path.join(self.folder, "scene.gltf"), view


def terrain(w):
    """200,000 displaced triangles under a map of 4096 texels a side."""
    heights = np.random.default_rng(1).integers(0, 65536, (4096, 4096), dtype=np.uint16)
    write_png(os.path.join(w.folder, "heights.png"), heights)
    displacement = {"heightTexture": {"uri": "heights.png"}, "scale": 0.01}
    w.node(mesh=w.grid(316, w.push("materials", {"extensions": {"RELIEF_displacement": displacement}})))


def triangles(w):
    """A mesh of two million triangles."""
    w.node(mesh=w.grid(1000, w.push("materials", {}), 0.02))


def moved(w):
    """A displaced terrain, a mesh of a million triangles that stands twice, and a small one that moves."""
    terrain(w)
    mesh = w.grid(707, w.push("materials", {}), 0.02)
    for x in (-1, 1):
        w.node(mesh=mesh, translation=[x, 0.3, -1])
    w.animate(w.node(mesh=w.grid(4, 1), scale=[0.1, 0.1, 0.1]), [0, 0.5, 0], [0.3, 0.5, 0])


def textures(w):
    """Sixteen textures of 2048 texels a side."""
    for number in range(16):
        texels = np.random.default_rng(number).integers(0, 256, (2048, 2048, 3), dtype=np.uint8)
        write_png(os.path.join(w.folder, f"{number}.png"), texels)
        texture = w.push("textures", {"source": w.push("images", {"uri": f"{number}.png"})})
        material = w.push("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}})
        w.node(mesh=w.grid(4, material), translation=[number % 4 - 2, 0, number // 4 - 2])


def desert_tire(w):
    """The example, as it is."""
    shutil.copytree(os.path.join(EXAMPLES, "desert_tire"), w.folder, dirs_exist_ok=True)
    return os.path.join(w.folder, "desert_tire.gltf"), None


SCENES = {f.__name__: f for f in (terrain, triangles, moved, textures, desert_tire)}


def seconds_of(function):
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def frames_alone(relief, scene, output):
    def frame(number):
        command = [relief, "render", scene, "-o", output, "--frames", str(number), "--progress", "none", *SMALL]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)

    return [seconds_of(lambda n=n: frame(n)) for n in range(1, FRAMES + 1)]


def frames_of_run(relief, scene, output):
    """By the times at which their ends are told."""
    command = [relief, "render", scene, "-o", output, "--frames", f"1-{FRAMES}", "--progress", "json", *SMALL]
    times = [time.perf_counter()]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        times += [time.perf_counter() for line in process.stdout if json.loads(line)["event"] == "done"]
    return np.diff(times)


def frames_served(relief, scene, output, view):
    """A picture a request, from a camera that moves alone."""
    words = [scene, "-o", output, *SMALL]
    seconds = []
    command = [relief, "serve"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, text=True, **pipes) as process:
        for number in range(FRAMES):
            more = ["--look-from", f"{0.1 * number},0.5,2"]
            if view is not None:
                path = os.path.join(os.path.dirname(scene), "view.gltf")
                view["nodes"] = [{"camera": 0, "translation": [0.1 * number, 0.5, 2]}]
                with open(path, "w", encoding="utf-8") as file:
                    json.dump(view, file)
                more = ["--camera-from", path]
            begin = time.perf_counter()
            process.stdin.write(json.dumps({"id": number, "render": words + more}) + "\n")
            process.stdin.flush()
            for line in process.stdout:
                event = json.loads(line)
                if event["event"] == "end":
                    assert event["exit_code"] == 0, event
                    break
            seconds.append(time.perf_counter() - begin)
        process.stdin.close()
    return seconds


def has_serve(relief):
    return "serve" in subprocess.run([relief, "--help"], capture_output=True, text=True, check=True).stdout


def main():
    relief, names = os.path.abspath(sys.argv[1]), sys.argv[2:] or list(SCENES)
    print("| scene | alone | `--frames` | `serve`, camera alone |\n| --- | --: | --: | --: |")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            writer = Writer(folder)
            scene, view = SCENES[name](writer) or writer.write()
            output = os.path.join(folder, "out.####.exr")
            columns = [frames_alone(relief, scene, output), frames_of_run(relief, scene, output)]
            if has_serve(relief):
                columns.append(frames_served(relief, scene, os.path.join(folder, "out.exr"), view))
            print(f"| {name} |", " | ".join(f"{np.median(column[1:]):.2f}" for column in columns), "|", flush=True)


if __name__ == "__main__":
    main()
