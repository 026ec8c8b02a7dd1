#!/usr/bin/python3
"""Renders a relief scene with Blender's Cycles and prints what it cost, as JSON.

Needs Blender 3.4 or 5.2 and, for the python that runs inside it, numpy (Debian: blender python3-numpy). The picture is a
linear float EXR. `render_seconds` is Cycles' own "render time (without synchronization)"; `synchronize_seconds` is
what it spends on taking the scene over, `preparation_seconds` that and dicing, displacing and building its BVH;
`peak_memory_bytes` is that of the whole process, an empty Blender being about 270 MiB.
"""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile

_FOLDER = os.path.dirname(os.path.abspath(__file__))
_SYNCHRONIZE = re.compile(r"Total time spent synchronizing data: ([0-9.e+-]+)")
_TOTAL = re.compile(r"Total render time: ([0-9.e+-]+)")
_RENDER = re.compile(r"Render time \(without synchronization\): ([0-9.e+-]+)")


class CyclesError(Exception):
    """Blender failed, or said nothing that could be understood; the message ends with its last lines."""


def blender_version(blender="blender"):
    """The version of a Blender, as a tuple of integers. @error CyclesError"""
    said = subprocess.run([blender, "--version"], capture_output=True, text=True, check=False).stdout
    match = re.search(r"Blender (\d+)\.(\d+)\.(\d+)", said)
    if match is None:
        raise CyclesError(f"{blender} does not say its version:\n{said}")
    return tuple(map(int, match.groups()))


def render_cycles(scene, runs, resolution=None, threads=None, blend=None, blender="blender", manifold=False):
    """Renders a scene once a run, in one Blender process.

    @param  scene       path of a .gltf
    @param  runs        list of {"samples": int, "seed": int, "output": path of an EXR}
    @param  resolution  (width, height) instead of the scene's
    @param  threads     number of render threads; None: all
    @param  blend       where to save the scene as a .blend, for looking at it; None: nowhere
    @param  manifold    use Cycles' shadow caustics (MNEE)
    @return             {"runs": the runs with render_seconds, synchronize_seconds, preparation_seconds, wall_seconds,
                        processor_seconds (all threads, preparation included) added, "approximate": materials that Cycles'
                        closures only come near to, "import_seconds", "peak_memory_bytes", "processor_seconds" of the whole
                        process}
    @error              CyclesError
    """
    job = {"runs": runs, "resolution": resolution, "threads": threads, "blend": blend, "manifold": manifold}
    with tempfile.TemporaryDirectory() as folder:
        job_path = os.path.join(folder, "job.json")
        with open(job_path, "w", encoding="utf-8") as file:
            json.dump(job, file)
        log_path = os.path.join(folder, "log.txt")
        verbose = ["--log", "cycles", "--log-level", "debug"] if blender_version(blender) >= (5, 0, 0) else ["--debug-cycles"]
        command = [blender, "-b", "--factory-startup", *verbose, "--python-exit-code", "9"]
        command += ["--python", os.path.join(_FOLDER, "blender_scene.py"), "--", os.path.abspath(scene), job_path]
        with open(log_path, "w", encoding="utf-8") as log:
            # Debian's Blender borrows modules from the first python3 on PATH: let that be Debian's, which has numpy.
            environment = {**os.environ, "PATH": os.pathsep.join(["/usr/bin", "/bin", os.environ.get("PATH", "")])}
            process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
            try:
                _, status, usage = os.wait4(process.pid, 0)
            except KeyboardInterrupt:
                process.send_signal(signal.SIGTERM)
                raise
        with open(log_path, encoding="utf-8", errors="replace") as file:
            log_text = file.read()
    try:
        result = _parse_log(log_text)
    except (KeyError, ValueError, IndexError) as cause:
        raise CyclesError(f"cannot read Blender's log ({cause}):\n{_tail(log_text)}") from cause
    if os.waitstatus_to_exitcode(status) != 0 or len(result["runs"]) != len(runs):
        raise CyclesError(f"Blender ended with {os.waitstatus_to_exitcode(status)}:\n{_tail(log_text)}")
    result["peak_memory_bytes"] = usage.ru_maxrss * 1024
    result["processor_seconds"] = usage.ru_utime + usage.ru_stime
    return result


def _tail(text):
    return "\n".join(text.splitlines()[-25:])


def _parse_log(text):
    """Joins our own SCENE and RUN lines with the times Cycles logs before each RUN line."""
    result = {"runs": []}
    synchronize = total = render = None
    for line in text.splitlines():
        if match := _SYNCHRONIZE.search(line):
            synchronize = float(match[1])
        elif match := _TOTAL.search(line):
            total = float(match[1])
        elif match := _RENDER.search(line):
            render = float(match[1])
        elif line.startswith("SCENE "):
            result.update(json.loads(line[6:]))
        elif line.startswith("RUN "):
            if None in (synchronize, total, render):
                raise ValueError("no times before a RUN line")
            run = json.loads(line[4:])
            run.update(render_seconds=render, synchronize_seconds=synchronize, preparation_seconds=total - render)
            result["runs"].append(run)
            synchronize = total = render = None
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", help="a .gltf in relief's scene format")
    parser.add_argument("output", help="the EXR to write")
    parser.add_argument("--spp", type=int, default=64, help="samples a pixel (default: 64)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resolution", metavar="WxH", help="instead of the scene's own")
    parser.add_argument("--threads", type=int, help="default: all")
    parser.add_argument("--manifold", action="store_true", help="use Cycles' shadow caustics (MNEE)")
    parser.add_argument("--blend", help="also save the scene as this .blend")
    arguments = parser.parse_args()
    resolution = [int(n) for n in arguments.resolution.split("x")] if arguments.resolution else None
    runs = [{"samples": arguments.spp, "seed": arguments.seed, "output": os.path.abspath(arguments.output)}]
    try:
        result = render_cycles(arguments.scene, runs, resolution, arguments.threads, arguments.blend, manifold=arguments.manifold)
    except (CyclesError, OSError) as error:
        sys.exit(f"render_cycles: {error}")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
