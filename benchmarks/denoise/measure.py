#!/usr/bin/env python3
"""Error over time of the denoiser on the example scenes, beside none.

    benchmarks/denoise/measure.py [SCENE...] [--spp 4,16,64] [--reference-spp 4096] [--resolution 256x192]
                                  [--denoise builtin] [--keep FOLDER]

Prints a line of a Markdown table for each scene and number of samples: seconds of sampling and of denoising, the errors
against a reference of another seed without and with denoising (less that of the reference), and the error that the denoiser claims over the true one,
beside what the layer `variance` says of the picture before.
References are kept in FOLDER and used again.
"""

import argparse
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BINARY = os.environ.get("RELIEF_BINARY", os.path.join(ROOT, "build/release/cli/relief"))
#: `caustics` is left out: paths that no reference samples enough are most of its error.
SCENES = ("cornell", "spheres", "product", "glass", "many_lights", "displaced", "desert_tire", "instances")


def render(scene, output, *options):
    """Renders a scene and returns the program's last event."""
    path = os.path.join(ROOT, "examples", scene, scene + ".gltf")
    command = [BINARY, "render", path, "-o", output, "--progress", "json", "--float", "--noise-threshold", "0", *options]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def attribute(path, name):
    """A number of an OpenEXR file's header."""
    with open(path, "rb") as file:
        header = file.read(65536)
    start = header.index(name.encode() + b"\0string\0") + len(name) + 8
    (size,) = struct.unpack_from("<i", header, start)
    return float(header[start + 4 : start + 4 + size])


def measure(scene, arguments, folder):
    size = ["--resolution", arguments.resolution]
    reference = os.path.join(folder, scene + ".ref.exr")
    if not os.path.exists(reference):
        render(scene, reference, *size, "--spp", str(arguments.reference_spp), "--seed", "1")
    # What a reference lacks itself is no error of the picture.
    noise, relative_noise = (attribute(reference, f"relief:error_{name}") for name in ("rmse", "relmse"))
    for spp in arguments.spp.split(","):
        done = render(scene, os.path.join(folder, f"{scene}.{spp}.exr"), *size, "--spp", spp, "--seed", "7",
                      "--denoise", arguments.denoise, "--reference", reference)  # fmt: skip
        rmse, denoised = (math.sqrt(max(done[f"{which}reference_rmse"] ** 2 - noise**2, 0)) for which in ("", "denoised_"))
        relmse, denoised_relmse = (done[f"{which}reference_relmse"] - relative_noise for which in ("", "denoised_"))
        print(
            f"| {scene} | {spp} | {done['seconds']:.2f} | {rmse:.4f} | {relmse:.5f} | {done['denoise_seconds']:.2f} | "
            f"{denoised:.4f} | {denoised_relmse:.5f} | {relmse / denoised_relmse:.2f} | "
            f"{done['denoised_rmse'] / denoised:.2f} | {done['error_rmse'] / rmse:.2f} |",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--spp", default="4,16,64")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--resolution", default="256x192")
    parser.add_argument("--denoise", default="builtin")
    parser.add_argument("--keep")
    arguments = parser.parse_args()
    print("| scene | samples | s | RMSE | relMSE | s more | denoised RMSE | relMSE | less relMSE, times | claimed / true RMSE | before |")
    print("| --- | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as temporary:
        for scene in arguments.scenes:
            measure(scene, arguments, arguments.keep or temporary)


if __name__ == "__main__":
    sys.exit(main())
