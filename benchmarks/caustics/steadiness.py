#!/usr/bin/python3
"""How much caustics flicker between the frames of an animation, against their noise.

    benchmarks/caustics/steadiness.py --relief build/release/cli/relief [--scene sphere] [--frames 8] [--samples 16]

Three animations of one scene: nothing moves, the camera moves, everything that casts moves; each with the scene's seed in
all frames, and with a seed for each frame. Of the layer `caustic` it prints the RMS difference of successive frames over the
noise, that is the RMS difference of frames that differ by their seed alone: 0 is perfectly steady, 1 is a new noise pattern
in every frame. What truly changes between frames is in it; steps are a tenth of a pixel. The camera's frames are compared
through points of the floor, by the mean over blocks of pixels: its step is along the view. Radii of the first pass are
printed as their largest change from frame to frame. Needs numpy (Debian: python3-numpy).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [_FOLDER, os.path.join(_FOLDER, "..", "cycles")]

from exr import read_rgb  # noqa: E402
from scenes import SCENES  # noqa: E402

_STEP = 0.001  # metres a frame


def render(options, folder, moving, frame, seed):
    """The layer of caustics, and the first pass's radius."""
    document = SCENES[options.scene]()
    settings = document.gltf["extensions"]["RELIEF_render"]
    settings["caustics"] = {"mode": "on"}
    settings["diffuseBounces"] = 1
    for node in document.gltf["nodes"]:
        is_camera = "camera" in node
        is_caster = node.get("name") not in ("floor", "wall", "lamp", "sun", "bottom") and not is_camera
        if (moving == "camera" and is_camera) or (moving == "casters" and is_caster):
            x, y, z = node.get("translation", (0, 0, 0))
            node["translation"] = [x + _STEP * frame, y, z]
    document.save(folder)
    output = os.path.join(folder, "picture.exr")
    subprocess.run(
        [options.relief, "render", os.path.join(folder, document.name + ".gltf"), "-o", output, "--float", "--filter", "box",
         "--aov", "caustic", "--spp", str(options.samples), "--seed", str(seed), "--resolution", options.resolution,
         "--progress", "none", "--stats", output + ".json"],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    with open(output + ".json", encoding="utf-8") as file:
        return read_rgb(output, "caustic"), json.load(file)["caustics"]["first_radius"]


def rms_of_differences(pictures):
    return float(np.sqrt(np.mean([(b - a) ** 2 for a, b in zip(pictures, pictures[1:])])))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--relief", required=True, help="binary")
    parser.add_argument("--scene", default="sphere", help=f"of {', '.join(SCENES)}")
    parser.add_argument("--frames", default=8, type=int)
    parser.add_argument("--samples", default=16, type=int)
    parser.add_argument("--resolution", default="100x75")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        still = [render(options, folder, "nothing", 0, 1 + seed) for seed in range(options.frames)]
        noise = rms_of_differences([picture for picture, _ in still])
        signal = float(np.sqrt(np.mean(np.mean([picture for picture, _ in still], axis=0) ** 2)))
        print(f"{options.scene}: RMS of the caustic {signal:.4f}, noise of differences {noise:.4f}")
        print("\n| what moves | seed | difference over noise | largest change of the radius |\n| --- | --- | --: | --: |")
        for moving in ("nothing", "camera", "casters"):
            for each in (False, True):
                if moving == "nothing" and each:
                    frames = still
                else:
                    frames = [render(options, folder, moving, f, 1 + f if each else 1) for f in range(options.frames)]
                radii = np.array([radius for _, radius in frames])
                change = np.max(np.abs(np.diff(radii)) / radii[:-1])
                ratio = rms_of_differences([picture for picture, _ in frames]) / noise
                print(f"| {moving} | {'a frame its own' if each else 'one'} | {ratio:.3f} | {change:.4f} |", flush=True)


if __name__ == "__main__":
    main()
