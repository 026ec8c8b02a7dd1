#!/usr/bin/python3
"""relief against Blender's Cycles on displaced scenes: preparation, memory, and error over time.

Cycles dices to triangles of one pixel (adaptive subdivision, true displacement); relief does too (`--displacement-error
1`) and, as `relief_lod0`, traces every texel of the map. The reference of all is relief's picture of
every texel (`--lod 0`), other seeds, of the middle of the picture; errors are measured there, what the reference's
noise adds is taken off. Times are of whole pictures, including preparation (reading, dicing, building); processor
seconds, of the whole process and both threads, bear other work on the machine better. The renderers take turns, all
timed pictures come before all references.

Bias is what would be left of the error at infinitely many samples: of two pictures a, b and two halves r, s of the
reference, all independent, mean (a − r)(b − s) is the squared bias, without the noise of any of them.

`huge_torus` and `huge_plane` are rendered by relief alone: memory, preparation, and a PNG to look at.

Writes markdown to standard output and all numbers to a JSON file. Needs Blender 3.4 or 5.2 and numpy (Debian: blender
python3-numpy). With several Blenders each has its turn.
"""

import argparse
import json
import math
import os
import platform
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, _FOLDER)

from compare import Job, render_relief  # noqa: E402
from displaced_scenes import COMPARED, HUGE  # noqa: E402
from exr import read_rgb  # noqa: E402
from render_cycles import blender_version, render_cycles  # noqa: E402

_MIB = 2**20
_REFERENCE_RUNS = 4

# What relief is told besides; of layers, Cycles writes the picture alone.
_RELIEF_OPTIONS = {
    "relief": ["--aov", "beauty", "--float", "--displacement-error", "1"],
    "relief_lod0": ["--aov", "beauty", "--float", "--lod", "0"],
}


def _window(resolution):
    """x0, y0, x1, y1 of the middle of the picture, half its width and height."""
    width, height = resolution
    return width // 4, height // 4, width // 4 + width // 2, height // 4 + height // 2


def _save(name, arguments, folder):
    """Makes a scene; returns its Job."""
    document = {**COMPARED, **HUGE}[name]()
    document.save(folder)
    full = document.gltf["extensions"]["RELIEF_render"]["resolution"]
    resolution = tuple(max(8, round(side * arguments.scale)) for side in full)
    scene = os.path.join(folder, f"{name}.gltf")
    return Job(scene, folder, resolution, arguments.threads, os.path.abspath(arguments.relief))


def _timed(job, renderer, samples, blenders):
    """One whole picture by a process of its own: (run with the process's costs added, the picture's window)."""
    # Every picture has its own seed, so that no two share their noise.
    output = os.path.join(job.folder, f"{renderer}_{samples}.exr")
    runs = [{"samples": samples, "seed": samples, "output": output}]
    if renderer in blenders:
        report = render_cycles(job.scene, runs, job.resolution, job.threads, blender=blenders[renderer])
    else:
        report = render_relief(job, runs, _RELIEF_OPTIONS[renderer])
    x0, y0, x1, y1 = _window(job.resolution)
    costs = {key: report[key] for key in ("peak_memory_bytes", "processor_seconds")}
    return {**report["runs"][0], **costs}, read_rgb(output)[y0:y1, x0:x1]


def _reference(job, samples):
    """Relief's pictures of the window, every texel seen: shape (runs, height, width, 3)."""
    runs = [
        {"samples": samples, "seed": 1000 + i, "output": os.path.join(job.folder, f"reference_{i}.exr")}
        for i in range(_REFERENCE_RUNS)
    ]
    options = ["--displacement", "chord", "--lod", "0", "--crop", ",".join(map(str, _window(job.resolution)))]
    render_relief(job, runs, [*options, "--float"])
    return np.stack([read_rgb(run["output"]) for run in runs])


def render_pictures(job, samples, blenders):
    """All timed pictures of a scene, the renderers in turns.

    @param  samples   samples a pixel of the pictures of each renderer, two or more, by name
    @param  blenders  programs of those that are Cycles, by name
    @return           lists of what `_timed` returns, by name
    """
    pictures = {renderer: [] for renderer in samples}
    for turn in range(max(map(len, samples.values()))):
        for renderer, counts in samples.items():
            if turn < len(counts):
                pictures[renderer].append(_timed(job, renderer, counts[turn], blenders))
    return pictures


def compare_scene(job, pictures, reference_samples):
    """Everything about one scene, as a JSON-able dictionary.

    @param  pictures           as of `render_pictures`
    @param  reference_samples  samples a pixel of each of the reference's parts
    """
    parts = _reference(job, reference_samples)
    reference = parts.mean(axis=0)
    variance = float((parts.var(axis=0, ddof=1) / len(parts)).mean())
    halves = parts[: len(parts) // 2].mean(axis=0), parts[len(parts) // 2 :].mean(axis=0)
    result = {"resolution": job.resolution, "reference_rmse": math.sqrt(variance), "renderers": {}}
    for renderer, rendered in pictures.items():
        points = []
        for run, picture in rendered:
            squared = float(((picture - reference) ** 2).mean()) - variance
            points.append(
                {
                    "samples": run["samples"],
                    "preparation_seconds": run["preparation_seconds"],
                    "render_seconds": run["render_seconds"],
                    "processor_seconds": run["processor_seconds"],
                    "peak_memory_bytes": run["peak_memory_bytes"],
                    "rmse": math.sqrt(max(squared, 0)),
                }
            )
        a, b = rendered[-2][1], rendered[-1][1]
        pairings = (a - halves[0]) * (b - halves[1]), (a - halves[1]) * (b - halves[0])
        bias = float(np.mean(pairings))
        first, last = points[0], points[-1]
        result["renderers"][renderer] = {
            "pictures": points,
            "processor_seconds_a_sample": (last["processor_seconds"] - first["processor_seconds"])
            / (last["samples"] - first["samples"]),
            "bias_rmse": math.sqrt(max(bias, 0)),
            "relative_bias_of_mean": float(b.mean() / reference.mean()) - 1,
        }
    for renderer in _RELIEF_OPTIONS:
        points = result["renderers"][renderer]["pictures"]
        result["renderers"][renderer]["equal_error"] = [
            {"cycles": cycles, **_equal_error(points, target)}
            for cycles in pictures
            if cycles not in _RELIEF_OPTIONS
            for target in result["renderers"][cycles]["pictures"]
        ]
    return result


def _seconds(point):
    return point["preparation_seconds"] + point["render_seconds"]


def _equal_error(points, target):
    """Seconds that relief takes, preparation included, to the error of one picture of Cycles.

    Between relief's pictures a power law; below the first, its time: less than one sample a pixel is no picture.
    """
    first = points[0]
    needed = float(first["samples"])
    is_beyond = target["rmse"] < points[-1]["rmse"]
    for a, b in zip(points, points[1:]):
        if target["rmse"] < a["rmse"]:
            slope = math.log(b["samples"] / a["samples"]) / math.log(b["rmse"] / a["rmse"])
            needed = a["samples"] * (target["rmse"] / a["rmse"]) ** slope
    counts = [point["samples"] for point in points]
    preparation = float(np.median([point["preparation_seconds"] for point in points]))
    rate = float(np.polyfit(counts, [point["render_seconds"] for point in points], 1)[0])
    seconds = preparation + first["render_seconds"] + rate * (needed - first["samples"])
    return {
        "cycles_samples": target["samples"],
        "rmse": target["rmse"],
        "samples": needed,
        "extrapolated": is_beyond,
        "seconds": {"relief": seconds, "cycles": _seconds(target)},
        "speedup": _seconds(target) / seconds,
    }


def render_huge(job, samples):
    """Memory and preparation of a scene that only relief renders; huge.png in its folder is for looking at."""
    output = os.path.join(job.folder, "huge.exr")
    runs = [{"samples": samples, "seed": 1, "output": output}]
    report = render_relief(job, runs, ["--aov", "beauty", "--png", os.path.join(job.folder, "huge.png")])
    with open(output + ".json", encoding="utf-8") as file:
        stats = json.load(file)
    return {
        "resolution": job.resolution,
        "samples": samples,
        **{key: report["runs"][0][key] for key in ("preparation_seconds", "render_seconds")},
        "peak_memory_bytes": report["peak_memory_bytes"],
        "film_bytes": stats["film_bytes"],
        "map_bytes": stats["displacement"]["map_bytes"],
        "table_bytes": stats["displacement"]["bytes"],
    }


def _markdown(results):
    lines = [
        "| scene | renderer | preparation s | peak MiB | spp | s, all included | processor s | a sample | RMSE | bias RMSE | bias of mean |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, result in results.items():
        for renderer, values in result["renderers"].items():
            for point in values["pictures"]:
                lines.append(
                    f"| {name} | {renderer} | {point['preparation_seconds']:.2f} "
                    f"| {point['peak_memory_bytes'] / _MIB:.0f} | {point['samples']} | {_seconds(point):.1f} "
                    f"| {point['processor_seconds']:.1f} | {values['processor_seconds_a_sample']:.2f} "
                    f"| {point['rmse']:.4f} | {values['bias_rmse']:.4f} | {100 * values['relative_bias_of_mean']:+.2f} % |"
                )
    lines += [
        "",
        "| scene | Cycles | RMSE | Cycles spp | Cycles s | renderer | spp | s | speed-up | memory, Cycles / relief |",
        "| --- | --- | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: |",
    ]
    for name, result in results.items():
        peaks = {
            renderer: max(point["peak_memory_bytes"] for point in values["pictures"])
            for renderer, values in result["renderers"].items()
        }
        for renderer in _RELIEF_OPTIONS:
            for equal in result["renderers"][renderer]["equal_error"]:
                lines.append(
                    f"| {name} | {equal['cycles']} | {equal['rmse']:.4f} | {equal['cycles_samples']} | {equal['seconds']['cycles']:.1f} "
                    f"| {renderer} | {equal['samples']:.1f}{' (extrapolated)' if equal['extrapolated'] else ''} "
                    f"| {equal['seconds']['relief']:.1f} | {equal['speedup']:.2f} "
                    f"| {peaks[equal['cycles']] / peaks[renderer]:.1f} |"
                )
    return "\n".join(lines)


def _markdown_huge(results):
    lines = [
        "| scene | preparation s | render s | peak MiB | map MiB | tables MiB | film MiB |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, result in results.items():
        sizes = " | ".join(
            f"{result[key] / _MIB:.0f}" for key in ("peak_memory_bytes", "map_bytes", "table_bytes", "film_bytes")
        )
        seconds = f"{result['preparation_seconds']:.2f} | {result['render_seconds']:.1f}"
        lines.append(f"| {name}, {result['samples']} spp | {seconds} | {sizes} |")
    return "\n".join(lines)


def _counts(text):
    counts = [int(count) for count in text.split(",")]
    if len(counts) < 2 or counts != sorted(set(counts)):
        raise argparse.ArgumentTypeError("expected two or more rising numbers, separated by commas")
    return counts


def main():
    root = os.path.dirname(os.path.dirname(_FOLDER))
    names = [*COMPARED, *HUGE]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(names)} (default: {', '.join(COMPARED)})"
    )
    parser.add_argument("--relief-spp", type=_counts, default="1,4,16", help="its samples a pixel (default: 1,4,16)")
    parser.add_argument("--cycles-spp", type=_counts, default="1,4,16", help="likewise (default: 1,4,16)")
    parser.add_argument(
        "--reference-spp", type=int, default=64, help=f"of each of the reference's {_REFERENCE_RUNS} parts (default: 64)"
    )
    parser.add_argument("--huge-spp", type=int, default=8, help="of the huge scenes (default: 8)")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on 1920x1080 (default: 1)")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument(
        "--blender", action="append", help="program whose Cycles is compared; may be repeated (default: blender)"
    )
    parser.add_argument("--relief", default=os.path.join(root, "build", "release", "cli", "relief"))
    parser.add_argument("--keep", metavar="FOLDER", help="keep scenes and pictures here")
    parser.add_argument("--json", default="cycles_displaced.json", help="where the numbers go")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.scenes if name not in names]
    if unknown:
        parser.error(f"no scene is called {unknown[0]}; there are {', '.join(names)}")

    arguments.blender = arguments.blender or ["blender"]
    blenders = {"cycles " + ".".join(map(str, blender_version(path))): path for path in arguments.blender}
    samples = {renderer: arguments.relief_spp for renderer in _RELIEF_OPTIONS}
    samples |= {cycles: arguments.cycles_spp for cycles in blenders}
    jobs, pictures, results, huge = {}, {}, {}, {}
    with tempfile.TemporaryDirectory() as scratch:
        # All scenes first: one of them may lack what it is made of.
        for name in arguments.scenes or COMPARED:
            jobs[name] = _save(name, arguments, os.path.join(arguments.keep or scratch, name))
        for name in jobs:
            print(f"{name}, {jobs[name].resolution[0]}x{jobs[name].resolution[1]}", file=sys.stderr, flush=True)
            if name in HUGE:
                huge[name] = render_huge(jobs[name], arguments.huge_spp)
            else:
                pictures[name] = render_pictures(jobs[name], samples, blenders)
        print("references", file=sys.stderr, flush=True)
        for name, rendered in pictures.items():
            results[name] = compare_scene(jobs[name], rendered, arguments.reference_spp)
    record = {
        "machine": {"processor": platform.processor() or platform.machine(), "threads": arguments.threads},
        "settings": vars(arguments),
        "scenes": results,
        "huge": huge,
    }
    with open(arguments.json, "w", encoding="utf-8") as file:
        json.dump(record, file, indent=1)
    if results:
        print(_markdown(results))
    if huge:
        print(_markdown_huge(huge))


if __name__ == "__main__":
    main()
