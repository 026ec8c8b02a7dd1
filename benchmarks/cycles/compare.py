#!/usr/bin/python3
"""relief against Blender's Cycles on the same scenes: speed against error, and whether both mean the same image.

Renders every scene with both, interleaved, at several sample counts, and N times more with other seeds. The mean of
a renderer's N runs is its own reference; the spread of the runs is the variance that the test of agreement uses and
that is taken off the errors for the reference's own noise. Writes markdown to standard output and all numbers to a
JSON file. Needs Blender 3.4 and numpy (Debian: blender python3-numpy).

Error measures: RMSE = √ mean (a − r)², relMSE = mean (a − r)² / (r² + 0.01), over pixels and channels. Times are of
the path tracing alone, without loading, synchronizing or building; those stand in the JSON file.
"""

import argparse
import dataclasses
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, _FOLDER)

from agreement import compare_runs  # noqa: E402
from exr import read_rgb  # noqa: E402
from render_cycles import render_cycles  # noqa: E402
from scenes import SCENES  # noqa: E402

_RELMSE_FLOOR = 0.01  # as in exporters/image_metrics.h


@dataclasses.dataclass
class Job:
    """What stays the same for all renders of one scene."""

    scene: str  # path of the .gltf
    folder: str  # where pictures go
    resolution: tuple
    threads: int
    relief: str  # path of the binary


def render_relief(job, runs, options=()):
    """The counterpart of `render_cycles`: same runs, same keys in the result; one process a run.

    @param  options  further words of relief's command line
    """
    result = {"runs": [], "peak_memory_bytes": 0}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for run in runs:
        stats_path = run["output"] + ".json"
        width, height = job.resolution
        command = [job.relief, "render", job.scene, "-o", run["output"], "--stats", stats_path]
        command += ["--spp", str(run["samples"]), "--seed", str(run["seed"]), "--threads", str(job.threads)]
        command += ["--resolution", f"{width}x{height}", "--filter", "box", "--progress", "none", *options]
        # Linux counts the memory of the process that starts another into the latter's peak; a shell has little.
        command = ["/bin/sh", "-c", '"$@"; exit $?', "sh", *command]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode != 0:
            sys.exit(f"compare: relief ended with {done.returncode}:\n{done.stderr}")
        with open(stats_path, encoding="utf-8") as file:
            stats = json.load(file)
        preparation = stats["load_seconds"] + stats["build_seconds"]
        result["runs"].append(
            {
                **run,
                "render_seconds": stats["render_seconds"],
                "synchronize_seconds": preparation,
                "preparation_seconds": preparation,
            }
        )
        result["peak_memory_bytes"] = max(result["peak_memory_bytes"], stats["peak_memory_bytes"])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    result["processor_seconds"] = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return result


def _render(renderer, job, runs):
    """Renders and loads: (result as of render_cycles, pictures of shape (runs, height, width, 3))."""
    if renderer == "relief":
        result = render_relief(job, runs)
    else:
        result = render_cycles(job.scene, runs, job.resolution, job.threads)
    return result, np.stack([read_rgb(run["output"]) for run in runs])


def _runs(job, renderer, label, samples, seeds):
    return [
        {"samples": samples, "seed": seed, "output": os.path.join(job.folder, f"{renderer}_{label}_{seed}.exr")}
        for seed in seeds
    ]


def _errors(picture, reference, reference_variance):
    """MSE and relMSE against a noisy reference whose own variance is known."""
    squared = (picture - reference) ** 2 - reference_variance
    return float(squared.mean()), float((squared / (reference**2 + _RELMSE_FLOOR)).mean())


def compare_scene(job, samples, repeats, num_runs, run_samples):
    """Everything about one scene, as a JSON-able dictionary.

    @param  samples      samples a pixel of the timed renders, rising
    @param  repeats      timed renders of each kind; times are medians, errors are means
    @param  num_runs     renders that make the reference and the variance, per renderer
    @param  run_samples  samples a pixel of each of these
    """
    references, variances, stacks = {}, {}, {}
    result = {"resolution": job.resolution, "renderers": {}}
    for renderer in ("relief", "cycles"):
        seeds = range(1000, 1000 + num_runs)
        report, stack = _render(renderer, job, _runs(job, renderer, "reference", run_samples, seeds))
        stacks[renderer] = stack
        references[renderer] = stack.mean(axis=0)
        variances[renderer] = stack.var(axis=0, ddof=1) / num_runs
        result["approximate"] = report.get("approximate", [])
        result["renderers"][renderer] = {"timed": []}
    for count in samples:
        timed = {"relief": [], "cycles": []}
        for repeat in range(repeats):
            # Interleaved, the first one in turns: whatever else the machine does hits both alike.
            order = ("relief", "cycles") if repeat % 2 == 0 else ("cycles", "relief")
            for renderer in order:
                runs = _runs(job, renderer, f"timed{count}", count, [1 + repeat])
                report, pictures = _render(renderer, job, runs)
                errors = _errors(pictures[0], references[renderer], variances[renderer])
                timed[renderer].append((report["runs"][0], errors, report["peak_memory_bytes"]))
        for renderer, measured in timed.items():
            seconds = float(np.median([run["render_seconds"] for run, _, _ in measured]))
            result["renderers"][renderer]["timed"].append(
                {
                    "samples": count,
                    "render_seconds": seconds,
                    "preparation_seconds": float(
                        np.median([run["synchronize_seconds"] for run, _, _ in measured])
                    ),
                    "samples_per_second": job.resolution[0] * job.resolution[1] * count / seconds,
                    "rmse": math.sqrt(max(np.mean([e[0] for _, e, _ in measured]), 0)),
                    "relmse": float(np.mean([e[1] for _, e, _ in measured])),
                    "peak_memory_bytes": max(memory for _, _, memory in measured),
                }
            )
    result["agreement"] = dataclasses.asdict(compare_runs(stacks["relief"], stacks["cycles"]))
    result["equal_error"] = _equal_error(result["renderers"])
    return result


def _equal_error(renderers):
    """Seconds of both to the RMSE that Cycles has at its middle sample count, by a power law through all points."""
    middle = renderers["cycles"]["timed"][len(renderers["cycles"]["timed"]) // 2]
    target = middle["rmse"]
    seconds = {}
    for renderer, values in renderers.items():
        times = np.log([point["render_seconds"] for point in values["timed"]])
        errors = np.log([max(point["rmse"], 1e-12) for point in values["timed"]])
        slope, offset = np.polyfit(errors, times, 1)
        seconds[renderer] = float(np.exp(slope * math.log(target) + offset))
    return {"rmse": target, "seconds": seconds, "speedup": seconds["cycles"] / seconds["relief"]}


def _markdown(results):
    """The two tables: speed against error, and agreement."""
    lines = [
        "| scene | spp | relief Msamples/s | Cycles | ratio | relief RMSE | Cycles | relief relMSE | Cycles |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, result in results.items():
        pairs = zip(*(result["renderers"][renderer]["timed"] for renderer in ("relief", "cycles")))
        for relief, cycles in pairs:
            speeds = [point["samples_per_second"] / 1e6 for point in (relief, cycles)]
            lines.append(
                f"| {name} | {relief['samples']} | {speeds[0]:.3f} | {speeds[1]:.3f} | {speeds[0] / speeds[1]:.2f} "
                f"| {relief['rmse']:.4f} | {cycles['rmse']:.4f} | {relief['relmse']:.4f} | {cycles['relmse']:.4f} |"
            )
    lines += [
        "",
        "| scene | RMSE | relief s | Cycles s | speed-up | relief MiB | Cycles MiB | same image? | image mean, relief / Cycles − 1 | blocks with p < 0.05 |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: |",
    ]
    for name, result in results.items():
        equal, agreement = result["equal_error"], result["agreement"]
        memory = [
            max(point["peak_memory_bytes"] for point in result["renderers"][renderer]["timed"]) / 2**20
            for renderer in ("relief", "cycles")
        ]
        verdict = "yes" if agreement["passed"] else "NO"
        verdict += f" (p {min(agreement['block_p'], agreement['mean_p']):.2g})"
        if result["approximate"]:
            verdict = "not tested: materials only alike"
        lines.append(
            f"| {name} | {equal['rmse']:.4f} | {equal['seconds']['relief']:.2f} | {equal['seconds']['cycles']:.2f} "
            f"| {equal['speedup']:.2f} | {memory[0]:.0f} | {memory[1]:.0f} | {verdict} "
            f"| {100 * agreement['relative_difference']:+.3f} % ± {100 * agreement['relative_standard_error']:.3f} % "
            f"| {100 * agreement['small_p_fraction']:.1f} % of {agreement['num_blocks']} |"
        )
    return "\n".join(lines)


def main():
    root = os.path.dirname(os.path.dirname(_FOLDER))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)} (default: all)")
    parser.add_argument("--spp", default="16,64,256", help="samples a pixel of the timed renders (default: 16,64,256)")
    parser.add_argument("--repeats", type=int, default=3, help="timed renders of each kind (default: 3)")
    parser.add_argument("--runs", type=int, default=16, help="renders per reference, at least 4 (default: 16)")
    parser.add_argument("--run-spp", type=int, default=256, help="samples a pixel of each of them (default: 256)")
    parser.add_argument("--scale", type=float, default=0.5, help="factor on the scenes' resolutions (default: 0.5)")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--relief", default=os.path.join(root, "build", "release", "cli", "relief"))
    parser.add_argument("--keep", metavar="FOLDER", help="keep scenes and pictures here")
    parser.add_argument("--json", default="cycles_comparison.json", help="where the numbers go")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.scenes if name not in SCENES]
    if unknown:
        parser.error(f"no scene is called {unknown[0]}; there are {', '.join(SCENES)}")
    if arguments.runs < 4:
        parser.error("--runs must be at least 4: the variance comes from them")
    samples = [int(count) for count in arguments.spp.split(",")]

    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in arguments.scenes or SCENES:
            folder = os.path.join(arguments.keep or scratch, name)
            document = SCENES[name]()
            document.save(folder)
            full = document.gltf["extensions"]["RELIEF_render"]["resolution"]
            resolution = tuple(max(8, round(side * arguments.scale)) for side in full)
            scene = os.path.join(folder, f"{document.name}.gltf")
            job = Job(scene, folder, resolution, arguments.threads, os.path.abspath(arguments.relief))
            print(f"{name}, {resolution[0]}x{resolution[1]}", file=sys.stderr)
            results[name] = compare_scene(
                job, samples, arguments.repeats, arguments.runs, arguments.run_spp
            )
            record = {
                "machine": {"processor": platform.processor() or platform.machine(), "threads": arguments.threads},
                "settings": vars(arguments),
                "scenes": results,
            }
            with open(arguments.json, "w", encoding="utf-8") as file:
                json.dump(record, file, indent=1)
    print(_markdown(results))
    differing = [n for n, r in results.items() if not r["approximate"] and not r["agreement"]["passed"]]
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
