#!/usr/bin/python3
"""What displaced scenes cost before their first pixel, in memory, and as whole pictures, by every way of tracing them.

Scenes are those of benchmarks/cycles/displaced_scenes.py (`scan` needs the folder RELIEF_BENCH_DATA), the example
`displaced`, and `plane`, which a simple subdivision cut into two million triangles. `NAME-points` is the same with its
maps' images as graphs, whose heights are evaluated at points; so are those of `noise`, a torus of 320 triangles.

`exact`  nothing is built (`--displacement chord`); of graphs, heights are evaluated where rays ask
`built`  all micro-triangles before the first ray: maps diced by `--displacement-error 1`, graphs over divided triangles
`tiles`  of graphs, tiles of the same triangles, made when a ray asks
`auto`   what auto chooses for a picture of so many samples, with the same options

Times are processor seconds of whole processes: `first` of a picture of one sample, `before` of that without what a
further sample takes. So that few samples are built for as well, they are of pictures of many that are not finished.
Samples that --spp does not have are extrapolated from its last two pictures, and marked ~.
"""

import argparse
import json
import os
import platform
import re
import resource
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
_ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path.insert(0, os.path.join(_ROOT, "benchmarks", "cycles"))
sys.path.insert(0, os.path.join(_ROOT, "scripts"))

import displaced_scenes as scenes  # noqa: E402
from examples import displaced  # noqa: E402

_SHOWN = (4, 16, 64)
_WAYS = ("exact", "built", "tiles", "auto")
_MEMORY = 8.0  # GiB that auto may use
_MANY = 4096  # samples with which building always pays


def _plane():
    document = scenes._document("plane")
    mesh = scenes._grid(scenes._plane, 1000, 1000, (False, False))
    scenes._add_displaced(document, mesh, (0.45, 0.38, 0.3), scenes.maps.rock, 1024, 0.3, (4, 4))
    document.add_camera((1.5, 2.6, 8.5), (-0.5, 0, 1.5), 40)
    return document


def _noise():
    document = scenes._document("noise")
    material = scenes.gltf.lambert("noise", (0.5, 0.4, 0.3))
    nodes = [{"type": "noise-texture", "inputs": {"vector": {"node": 1, "output": "object"}, "scale": 3, "detail": 8}}]
    nodes.append({"type": "texture-coordinate"})
    graph = {"nodes": nodes, "outputs": {"height": {"node": 0, "output": "factor"}}}
    material["extensions"]["RELIEF_displacement"] = {"heightGraph": graph, "scale": 0.4, "midlevel": 0.5}
    mesh = document.add_mesh("base", scenes._grid(scenes._torus, 16, 10, (True, True)), document.add_material(material))
    document.add_node("displaced", mesh=mesh)
    document.add_camera((0.4, 2.2, 2.6), (0, -0.05, 0.05), 36)
    return document


def _at_points(document):
    """Puts graphs of the same images in the place of height maps."""
    for material in document.gltf["materials"]:
        displacement = material.get("extensions", {}).get("RELIEF_displacement")
        if displacement is None:
            continue
        texture = displacement.pop("heightTexture")
        tiles = texture.get("extensions", {}).get("KHR_texture_transform", {}).get("scale", [1, 1])
        nodes = [
            {"type": "texture-coordinate"},
            {"type": "mapping", "inputs": {"vector": {"node": 0, "output": "uv"}, "scale": [*tiles, 1]}},
            {"type": "image-texture", "texture": {"index": texture["index"]}, "colorSpace": "linear", "inputs": {"vector": {"node": 1, "output": "vector"}}},
        ]  # fmt: skip
        displacement["heightGraph"] = {
            "nodes": nodes,
            "outputs": {"height": {"node": 2, "output": "color"}},
            "evaluate": "points",
        }
    return document


def _document(name):
    made = {**scenes.COMPARED, "displaced": displaced.build, "plane": _plane, "noise": _noise}
    base = name.removesuffix("-points")
    if base not in made:
        sys.exit(f"first_pixel: no scene is called {name}; there are {', '.join(made)}, and these with -points")
    document = made[base]()
    return document if base == name else _at_points(document)


class Runner:
    """Renders one scene."""

    def __init__(self, arguments, scene, folder):
        self._arguments, self._scene, self._folder = arguments, scene, folder
        self._built = None  # GiB that auto says that building takes

    def _options(self, way, samples):
        if way == "exact":
            return ["--spp", str(samples), "--displacement", "chord"]
        # Less than building takes, which is told to a tenth.
        if way == "tiles" and not self._built:
            sys.exit("first_pixel: tiles are chosen by what is built before, .1 GiB or more: --ways built,tiles at a larger --resolution")
        memory = _MEMORY if way != "tiles" else 0.5 * self._built
        options = ["--displacement-error", "1", "--displacement-memory", f"{memory:.3f}"]
        if way == "auto":
            return [*options, "--spp", str(samples)]
        # A part has four samples at least. One is what has been sampled when time is up at once.
        unfinished = ["--part", f"1/{_MANY // samples}"] if samples >= 4 else ["--time-limit", "1e-3"]
        return [*options, "--spp", str(_MANY), *unfinished]

    def render(self, way, samples):
        """One picture: processor seconds, bytes, and what was chosen."""
        output = os.path.join(self._folder, "out.exr")
        command = [self._arguments.relief, "render", self._scene, "-o", output, "--stats", output + ".json"]
        command += ["--resolution", self._arguments.resolution, "--aov", "beauty", "--progress", "none"]
        # Linux counts the memory of the process that starts another into the latter's peak; a shell has little.
        command = ["/bin/sh", "-c", '"$@"; exit $?', "sh", *command, *self._options(way, samples)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode != 0:
            sys.exit(f"first_pixel: relief ended with {done.returncode}:\n{done.stderr}")
        with open(output + ".json", encoding="utf-8") as file:
            stats = json.load(file)
        reasons = stats["displacement"]["reasons"]
        takes = [float(m) for reason in reasons for m in re.findall(r"takes? ([\d.]+) GiB", reason)]
        self._built = sum(takes) or self._built
        return {
            "samples": samples,
            "seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            "bytes": stats["peak_memory_bytes"],
            "rays": stats["rays"]["total"],
            "method": stats["displacement"]["method"],
            "reasons": reasons,
        }


def _whole(pictures, samples):
    """Seconds of so many samples, as text."""
    for picture in pictures:
        if picture["samples"] == samples:
            return f"{picture['seconds']:.1f}"
    if len(pictures) < 2:
        return "–"
    a, b = pictures[:2] if samples == 0 else pictures[-2:]
    slope = (b["seconds"] - a["seconds"]) / (b["samples"] - a["samples"])
    return f"~{max(a['seconds'] + slope * (samples - a['samples']), 0):.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["displaced", "sphere", "torus", "scan", "landscape", "plane", "pebbles"])
    parser.add_argument("--ways", default=",".join(_WAYS), help="of exact, built, tiles, auto")
    parser.add_argument("--spp", default="1,4,16", help="rising: 1, then powers of two from 4 to 64")
    parser.add_argument("--rounds", type=int, default=1, help="the least of so many, in turns")
    parser.add_argument("--resolution", default="1920x1080")
    parser.add_argument("--relief", default=os.path.join(_ROOT, "build", "release", "cli", "relief"))
    parser.add_argument("--json", help="file that gets all figures")
    arguments = parser.parse_args()
    ways = [way for way in _WAYS if way in arguments.ways.split(",")]
    counts = [int(count) for count in arguments.spp.split(",")]
    print(f"{platform.processor() or platform.machine()}, {arguments.resolution}; processor seconds\n")
    print("| scene | way | before | first | most MB |", *(f"{n} |" for n in _SHOWN), "traced by |")
    print("|", " --- |" * (6 + len(_SHOWN)), sep="")
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes:
            document = _document(name)
            document.save(folder)
            runner = Runner(arguments, os.path.join(folder, f"{document.name}.gltf"), folder)
            has_tiles = name == "noise" or name.endswith("-points")
            kinds = [way for way in ways if way != "tiles" or has_tiles]
            pictures = {way: [] for way in kinds}
            for count in counts:
                for way in kinds * arguments.rounds:
                    run = runner.render(way, count)
                    if pictures[way] and pictures[way][-1]["samples"] == count:
                        run = min(run, pictures[way].pop(), key=lambda r: r["seconds"])
                    pictures[way].append(run)
            figures[name] = pictures
            for way, runs in pictures.items():
                first, most = runs[0], max(run["bytes"] for run in runs) / 1e6
                methods = ", ".join(dict.fromkeys(run["method"] for run in runs))
                wholes = " | ".join(_whole(runs, n) for n in _SHOWN)
                row = f"| {name} | {way} | {_whole(runs, 0)} | {first['seconds']:.1f} | {most:.0f} | {wholes}"
                print(f"{row} | {methods} |", flush=True)
            if arguments.json:
                with open(arguments.json, "w", encoding="utf-8") as file:
                    json.dump(figures, file, indent=1)


if __name__ == "__main__":
    main()
