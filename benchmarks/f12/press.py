"""One F12 inside Blender, and what it cost: blender … --python press.py -- JOB.json

The job: {"blend", "engine", "samples", "threshold" (0: none), "seed", "resolution": [w, h], "threads", "relief": {property of
scene.relief: value}, "output": path without suffix}. Writes output.exr, linear, output.png, as Blender shows it, and
output.json: processor and wall seconds from before the render to after it, of Blender and of the programs that it started, and
the peak memory of the larger one.
"""

import json
import os
import resource
import sys
import time

import bpy


def set_up(scene, job):
    """Blender's default settings but for what the job names; the engine relief takes those of Cycles."""
    cycles, render = scene.cycles, scene.render
    render.engine = job["engine"]
    render.resolution_x, render.resolution_y = job["resolution"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", job["threads"]
    render.use_compositing = render.use_sequencer = False
    cycles.device, cycles.seed, cycles.samples = "CPU", job["seed"], job["samples"]
    cycles.use_denoising = False
    cycles.use_adaptive_sampling = job["threshold"] > 0
    if job["threshold"] > 0:
        cycles.adaptive_threshold = job["threshold"]
    for name, value in job["relief"].items():
        setattr(scene.relief, name, value)


def press(engine):
    """Renders as F12 does. Returns {"processor_seconds", "wall_seconds", "peak_memory_bytes"}."""
    begin, wall = _processor_seconds(), time.monotonic()
    bpy.ops.render.render()
    if engine == "RELIEF":
        # Its program would wait for the next picture; only what has ended counts as a child's.
        from relief import session

        session.render_server().stop()
    wall = time.monotonic() - wall
    # Not the sum: Linux counts what starts a program into that program's peak.
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return {"processor_seconds": _processor_seconds() - begin, "wall_seconds": wall, "peak_memory_bytes": peak * 1024}


def _processor_seconds():
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def save(scene, output):
    """The picture, linear and as it is shown."""
    picture, settings = bpy.data.images["Render Result"], scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        settings.media_type = "IMAGE"
    settings.color_mode = "RGB"
    for file_format, depth, suffix in (("PNG", "8", ".png"), ("OPEN_EXR", "32", ".exr")):
        settings.file_format, settings.color_depth = file_format, depth
        picture.save_render(output + suffix, scene=scene)


def main(path):
    with open(path, encoding="utf-8") as file:
        job = json.load(file)
    bpy.ops.wm.open_mainfile(filepath=job["blend"])
    scene = bpy.context.scene
    set_up(scene, job)
    cost = press(job["engine"])
    save(scene, job["output"])
    with open(job["output"] + ".json", "w", encoding="utf-8") as file:
        json.dump(cost, file)


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    main(sys.argv[sys.argv.index("--") + 1])
