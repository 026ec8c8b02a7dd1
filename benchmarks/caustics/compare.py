#!/usr/bin/python3
"""Error over time of caustics: relief's photons, its path tracer, and Cycles without and with MNEE, in one run.

    benchmarks/caustics/compare.py --relief build/release/cli/relief [--scenes sphere,ring,…] [--json out.json]

Every renderer does each sample count once; errors are against a long run of relief with photons and another seed, whose
means the tests hold against path tracing. Prints a table a scene: RMSE, relMSE (squared error over r² + 0.01), the
picture's mean over the reference's, processor seconds of all threads, which what else runs on the machine changes least: of
relief's whole process, of Cycles' synchronizing and rendering. Cycles has the surface of
`water` as a smooth mesh, a pair of triangles a texel. Needs Blender 3.4 and numpy (Debian: blender python3-numpy).
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [_FOLDER, os.path.join(_FOLDER, "..", "cycles")]

from exr import read_rgb  # noqa: E402
from render_cycles import render_cycles  # noqa: E402
from scenes import SCENES  # noqa: E402


def render_relief(options, scene, output, samples, seed, mode):
    """Processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [options.relief, "render", scene, "-o", output, "--float", "--filter", "box", "--spp", str(samples), "--seed",
         str(seed), "--caustics", mode, "--resolution", options.resolution, "--progress", "none"],
        check=True, stdout=subprocess.DEVNULL)  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def errors(picture, reference):
    """RMSE, relMSE, mean over the reference's."""
    squared = (picture - reference) ** 2
    return float(np.sqrt(squared.mean())), float((squared / (reference**2 + 0.01)).mean()), float(
        picture.mean() / reference.mean())


def compare(options, name, folder):
    """Rows (renderer, samples, seconds, RMSE, relMSE, mean)."""
    SCENES[name]().save(folder)
    scene = os.path.join(folder, f"{name}.gltf")
    path = os.path.join(folder, "picture.exr")
    render_relief(options, scene, path, options.reference_spp, 4242, "on")
    reference = read_rgb(path)
    rows = []
    for mode, label in (("on", "photons"), ("off", "paths")):
        for samples in options.spp:
            seconds = render_relief(options, scene, path, samples, 1, mode)
            rows.append((f"relief {label}", samples, seconds, *errors(read_rgb(path), reference)))
    if name == "water":
        SCENES[name](tessellated=True).save(folder)
    size = tuple(int(side) for side in options.resolution.split("x"))
    for manifold, label in ((False, "Cycles"), (True, "Cycles MNEE")):
        runs = [{"samples": s, "seed": 1, "output": os.path.join(folder, f"cycles{s}.exr")} for s in options.spp]
        result = render_cycles(scene, runs, resolution=size, manifold=manifold)
        for run in result["runs"]:
            rows.append((label, run["samples"], run["processor_seconds"], *errors(read_rgb(run["output"]), reference)))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--relief", required=True, help="binary")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--resolution", default="200x150")
    parser.add_argument("--spp", default="1,4,16,64,256", type=lambda text: [int(s) for s in text.split(",")])
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--json", help="file to write all rows to")
    options = parser.parse_args()
    table = {}
    for name in options.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            table[name] = compare(options, name, folder)
        print(f"\n## {name}\n\n| renderer | samples | processor seconds | RMSE | relMSE | mean |\n| --- | --: | --: | --: | --: | --: |")
        for renderer, samples, seconds, rmse, relmse, mean in table[name]:
            print(f"| {renderer} | {samples} | {seconds:.2f} | {rmse:.4f} | {relmse:.5f} | {mean:.3f} |", flush=True)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(table, file, indent=1)


if __name__ == "__main__":
    main()
