#!/usr/bin/python3
"""How bias and noise of the photon pass fall with the number of passes, beside what is predicted.

    benchmarks/caustics/bias.py --relief build/release/cli/relief [--scenes sphere,ring,rough] [--html bias.html] [--json bias.json]

Every number of passes is rendered with many seeds; only the layer `caustic` is looked at. The squared bias is the product
of the differences of two halves of the seeds from two long references, so that no noise is left in its expectation; the
references have an eighth of the first radius, and keep it. The first radius is wider than
the automatic one, which would leave noise alone to be seen. Prediction (Knaus and Zwicker 2011, Eq. 8, 9 and 15): with radii
r_i of the passes, a smooth irradiance has a bias of the mean of r_i², and a variance of the mean of 1/r_i² over n; for large
n that is n^(α−1) and n^(−α). Where irradiance jumps, as on the edges of a caustic, bias falls slower: it is therefore shown
for all pixels, and for blocks of them, whose width in the scene is that of many radii. Needs numpy (Debian: python3-numpy).
"""

import argparse
import html
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

_SEEDS = {1: 64, 4: 32, 16: 16, 64: 8, 256: 6, 1024: 4}

# The caustic fills the picture: eye, target, vertical degrees.
_CLOSE = {
    "sphere": ((-1.6, 0.7, -0.07), (-0.14, 0.0, -0.07), 10),
    "ring": ((0.0, 2.0, 0.3), (0.0, 0.0, 0.0), 28),
    "rough": ((-0.68, 1.2, -0.9), (-0.68, 0.0, 0.13), 16),
}


def radii_squared(passes, alpha):
    """Squares of the radii of the passes over that of the first."""
    squared = np.ones(passes)
    for i in range(1, passes):
        squared[i] = squared[i - 1] * (i + alpha) / (i + 1)
    return squared


def predicted(passes, alpha):
    """Bias and standard deviation after `passes` over those after one."""
    squared = radii_squared(passes, alpha)
    return squared.mean(), np.sqrt((1 / squared).mean() / passes)


def render(options, document, folder, passes, seed, **caustics):
    """The layer of caustics, and the statistics of the pass."""
    settings = document.gltf["extensions"]["RELIEF_render"]
    settings["caustics"] = {"mode": "on", **caustics}
    # Caustics as the camera sees them, and not by way of other surfaces: what those add is noise of the path tracer.
    settings["diffuseBounces"] = 1
    document.save(folder)
    output = os.path.join(folder, "picture.exr")
    subprocess.run(
        [options.relief, "render", os.path.join(folder, document.name + ".gltf"), "-o", output, "--float", "--filter", "box",
         "--aov", "caustic", "--spp", str(passes), "--seed", str(seed), "--resolution", options.resolution, "--progress",
         "none", "--stats", output + ".json"],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    with open(output + ".json", encoding="utf-8") as file:
        return read_rgb(output, "caustic"), json.load(file)["caustics"]


def blocks(picture, size):
    """Means of squares of pixels."""
    height, width, channels = picture.shape
    whole = picture[: height // size * size, : width // size * size]
    return whole.reshape(height // size, size, width // size, size, channels).mean((1, 3))


def measure(pictures, references, size):
    """Bias and standard deviation of one render over the root of the reference's mean square, all over blocks of pixels.

    The bias is signed by its square: below noise it may come out negative.
    """
    stack = np.stack([blocks(p, size) for p in pictures])
    first, second = (blocks(r, size) for r in references)
    scale = (first * second).mean()
    halves = stack[0::2].mean(0) - first, stack[1::2].mean(0) - second
    squared = (halves[0] * halves[1]).mean() / scale
    # Of the product of two independent noisy differences.
    count = max(len(stack) // 2, 1)
    of_half = stack.var(0, ddof=1) / count
    noise = np.sqrt((of_half**2 + 2 * of_half * np.maximum(halves[0] * halves[1], 0)).sum()) / of_half.size / scale
    return np.sign(squared) * np.sqrt(abs(squared)), noise, np.sqrt(stack.var(0, ddof=1).mean() / scale)


def study(options, name, folder):
    """Rows of dictionaries, one a number of passes and a size of blocks."""
    document = SCENES[name]()
    if name in _CLOSE:
        nodes = document.gltf["nodes"]
        old = next(i for i, node in enumerate(nodes) if "camera" in node)
        document.gltf["scenes"][0]["nodes"].remove(old)
        document.add_camera(*_CLOSE[name])
    pilot = render(options, document, folder, 1, 1, photons=options.photons, alpha=options.alpha)[1]
    radius = options.wider * pilot["first_radius"]
    references = [
        render(options, document, folder, options.reference_passes, 9000 + i, photons=options.reference_photons, alpha=1,
               radius=radius / 8)[0]
        for i in range(2)
    ]  # fmt: skip
    rows = []
    for passes in options.passes:
        pictures = [
            render(options, document, folder, passes, 100 + seed, photons=options.photons, alpha=options.alpha, radius=radius)[0]
            for seed in range(_SEEDS[passes])
        ]
        for size in options.blocks:
            bias, noise, deviation = measure(pictures, references, size)
            rows.append({"scene": name, "block": size, "passes": passes, "seeds": len(pictures), "radius": radius,
                         "bias": bias, "noise_of_squared_bias": noise, "deviation": deviation,
                         "rmse": float(np.sqrt(max(bias * abs(bias), 0) + deviation**2))})  # fmt: skip
    return rows


def slope(rows, key):
    """Of a line through the logarithms; rows whose bias is lost in noise are left out. None: too few are left."""
    kept = [r for r in rows if r[key] > 0 and (key != "bias" or r["bias"] ** 2 > 3 * r["noise_of_squared_bias"])]
    if len(kept) < 2:
        return None
    return float(np.polyfit(np.log([r["passes"] for r in kept]), np.log([r[key] for r in kept]), 1)[0])


def summary(options, rows):
    """Slopes measured and predicted, the latter fitted over the same passes."""
    exact = [dict(zip(("bias", "deviation"), predicted(r["passes"], options.alpha)), passes=r["passes"],
                  noise_of_squared_bias=0) for r in rows]  # fmt: skip
    return {key: (slope(rows, key), slope(exact, key)) for key in ("bias", "deviation")}


def plot(options, title, rows):
    """Bias, deviation and RMSE against passes on logarithmic axes, predictions dashed through the first point: SVG."""
    width, height, left, bottom = 420, 320, 62, 44
    values = [abs(r[k]) for r in rows for k in ("bias", "deviation", "rmse") if r[k] > 0]
    exact = {r["passes"]: predicted(r["passes"], options.alpha) for r in rows}
    low, high = np.log10(min(values)) - 0.1, np.log10(max(values)) + 0.1
    last = np.log10(max(r["passes"] for r in rows))

    def x(passes):
        return left + (width - left - 12) * np.log10(passes) / last

    def y(value):
        return 26 + (height - 26 - bottom) * (high - np.log10(value)) / (high - low)

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
             'font-family="sans-serif" font-size="11">', '<rect width="100%" height="100%" fill="white"/>',
             f'<text x="{width / 2}" y="16" text-anchor="middle" font-size="13">{html.escape(title)}</text>']  # fmt: skip
    for r in rows:
        parts.append(f'<line x1="{x(r["passes"]):.1f}" y1="26" x2="{x(r["passes"]):.1f}" y2="{height - bottom}" stroke="#ddd"/>'
                     f'<text x="{x(r["passes"]):.1f}" y="{height - bottom + 14}" text-anchor="middle">{r["passes"]}</text>')
    for decade in range(int(np.floor(low)), int(np.ceil(high)) + 1):
        for mantissa in (1, 2, 5):
            value = mantissa * 10.0**decade
            if low <= np.log10(value) <= high:
                parts.append(f'<line x1="{left}" y1="{y(value):.1f}" x2="{width - 12}" y2="{y(value):.1f}" stroke="#ddd"/>'
                             f'<text x="{left - 5}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    parts.append(f'<text x="{(left + width) / 2}" y="{height - 8}" text-anchor="middle">passes</text>')
    slopes = summary(options, rows)
    for line, (key, colour) in enumerate((("bias", "#c33"), ("deviation", "#36c"), ("rmse", "#555"))):
        kept = [r for r in rows if r[key] > 0]
        points = " ".join(f"{x(r['passes']):.1f},{y(r[key]):.1f}" for r in kept)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts += [f'<circle cx="{x(r["passes"]):.1f}" cy="{y(r[key]):.1f}" r="3" fill="{colour}"/>' for r in kept]
        label = key
        if key in slopes and kept:
            start = kept[0]
            of = 0 if key == "bias" else 1
            factor = start[key] / exact[start["passes"]][of]
            points = " ".join(f"{x(p):.1f},{y(max(e[of] * factor, 10**low)):.1f}" for p, e in sorted(exact.items()))
            parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-dasharray="4 3"/>')
            found, wanted = slopes[key]
            label += f": slope {'in noise' if found is None else f'{found:.2f}'}, predicted {wanted:.2f}"
        parts.append(f'<text x="{left + 8}" y="{height - bottom - 36 + 14 * line}" fill="{colour}">{label}</text>')
    return "\n".join([*parts, "</svg>"])


def main():
    def numbers(text):
        return [int(n) for n in text.split(",")]

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--relief", required=True, help="binary")
    parser.add_argument("--scenes", default="sphere,ring,rough")
    parser.add_argument("--resolution", default="48x36")
    parser.add_argument("--passes", default="1,4,16,64,256", type=numbers, help=f"of {', '.join(map(str, _SEEDS))}")
    parser.add_argument("--blocks", default="1,6", type=numbers, help="pixels a side that are averaged")
    parser.add_argument("--wider", default=4, type=float, help="first radius over the automatic one, so that bias shows")
    parser.add_argument("--photons", default=8192, type=int, help="a pass")
    parser.add_argument("--alpha", default=2 / 3, type=float)
    parser.add_argument("--reference-passes", default=128, type=int)
    parser.add_argument("--reference-photons", default=65536, type=int)
    parser.add_argument("--html", help="file to write the plots to")
    parser.add_argument("--json", help="file to write all rows to")
    options = parser.parse_args()
    rows, plots = [], []
    for name in options.scenes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            found = study(options, name, folder)
        rows += found
        for size in options.blocks:
            of_size = [r for r in found if r["block"] == size]
            title = f"{name}, {'pixels' if size == 1 else f'blocks of {size}×{size} pixels'}, α = {options.alpha:.3g}"
            plots.append(plot(options, title, of_size))
            print(f"\n## {title}\n\n| passes | seeds | bias | deviation | RMSE |\n| --: | --: | --: | --: | --: |")
            for r in of_size:
                print(f"| {r['passes']} | {r['seeds']} | {r['bias']:.4f} | {r['deviation']:.4f} | {r['rmse']:.4f} |")
            for key, (measured, wanted) in summary(options, of_size).items():
                print(f"{key}: slope {'lost in noise' if measured is None else f'{measured:.3f}'}, predicted {wanted:.3f}",
                      flush=True)
    if options.html:
        with open(options.html, "w", encoding="utf-8") as file:
            file.write("<!DOCTYPE html><meta charset='utf-8'><title>Bias of the photon pass</title>\n" + "\n".join(plots) + "\n")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
