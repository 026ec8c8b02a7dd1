#!/usr/bin/python3
"""Displaced scenes from Blender, in relief and in Cycles: preparation, memory, error, time to equal error.

    RELIEF_BINARY=… BLENDER_USER_SCRIPTS=… tests/blender/measure_displaced.py [--size WxH] [--samples N] [--scenes LIST] [--dicing R]

Not a test: it takes ten minutes at 1080p on two cores and wants them for itself. Prints a Markdown table.

Three scenes have height maps; `planet` has 12 octaves of noise over Generated coordinates, which relief computes at cells
of a pixel. Cycles dices to R pixels (1) by adaptive subdivision. Errors are against the texel-exact surface (of the planet
against cells of a quarter of a pixel): with two more pictures r, s of relief, of other seeds, the mean of
(a − r)(a − s) is the squared error of a, the noise of r and s drops out. Cycles'
error has the bias of its dicing in it; it is what an artist gets. The time to Cycles' error is relief's preparation and
as many of its samples as bring its noise there, at least one.

Runs outside Blender, and, with --inside, in it.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time

_HERE = os.path.dirname(os.path.abspath(__file__))
_SCENES = ("sphere", "landscape", "torus", "planet")


# --------------------------------------------------------------------------- inside Blender


def _height_map(path, size, kind):
    """Saves a tiling 16-bit height map."""
    import bpy
    import numpy as np
    from scenes import set_file_format

    random = np.random.default_rng(7)
    v, u = np.mgrid[0:size, 0:size].astype(np.float32) / size
    if kind == "woven":
        over, under = np.sin(2 * np.pi * 16 * u), np.sign(np.sin(2 * np.pi * 8 * v))
        h = 0.5 + 0.25 * over * under + 0.2 * np.cos(2 * np.pi * 32 * v)
    else:
        # Waves whose amplitude falls with their frequency, in all directions: stone, or mountains.
        spectrum = np.zeros((size, size), dtype=np.complex64)
        k = np.fft.fftfreq(size, 1 / size)
        radius = np.hypot(*np.meshgrid(k, k))
        band = (radius > 1) & (radius < size / 6)
        phases = random.uniform(0, 2 * np.pi, band.sum())
        spectrum[band] = np.exp(1j * phases) / radius[band] ** 1.9
        h = np.fft.ifft2(spectrum).real
        h = (h - h.min()) / np.ptp(h)
    image = bpy.data.images.new("heights", size, size, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.ones((size, size, 4), dtype=np.float32)
    pixels[..., :3] = np.clip(h, 0, 1)[..., None]
    image.pixels.foreach_set(pixels.ravel())
    set_file_format("PNG", "16", color_mode="BW")
    bpy.context.scene.view_settings.view_transform = "Raw"
    image.save_render(path)
    bpy.data.images.remove(image)


def _build(name, folder):
    """Makes one of the scenes; the displaced object has simple adaptive subdivision, which relief does not need."""
    import bpy
    import scenes

    scene = scenes.new_scene()
    from relief import compat  # now that the add-on is on

    scenes.set_bounces(scene, 4)
    scenes.set_world((0.4, 0.5, 0.7))
    scenes.add_light("SUN", rotation=scenes.degrees(55, 10, 30), energy=3, angle=0)
    material, tree, _ = scenes.new_material("displaced", Color=(0.6, 0.5, 0.4, 1), Roughness=0.0)
    mapping, coordinate = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    node = tree.nodes.new("ShaderNodeDisplacement")
    tiles, scale = {
        "sphere": ((8, 6, 1), 0.08),
        "landscape": ((2, 2, 1), 1.2),
        "torus": ((5, 5, 1), 0.06),
        "planet": ((2.9, 2.9, 2.9), 0.3),
    }[name]
    if name == "planet":
        texture = tree.nodes.new("ShaderNodeTexNoise")
        for input_name, value in {"Scale": 1.0, "Detail": 11.0, "Roughness": 0.55}.items():
            texture.inputs[input_name].default_value = value
    else:
        path = os.path.join(folder, "heights.png")
        _height_map(path, {"landscape": 4096}.get(name, 2048), "woven" if name == "torus" else "stone")
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        texture = scenes.add_image_node(tree, image)
    mapping.inputs["Scale"].default_value = tiles
    node.inputs["Scale"].default_value = scale
    tree.links.new(coordinate.outputs["Generated" if name == "planet" else "UV"], mapping.inputs[0])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], node.inputs["Height"])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    compat.set_displacement_method(material, "DISPLACEMENT")
    if name in ("sphere", "planet"):
        made = scenes.add_sphere(1.0, material, segments=32)
        scenes.add_camera((0, -3.2, 0.6), scenes.degrees(80, 0, 0), lens=50)
    elif name == "landscape":
        made = scenes.add_plane(16, material, subdivisions=8)
        scenes.add_camera((0, -7.5, 1.4), scenes.degrees(80, 0, 0), lens=28)
    else:
        bpy.ops.mesh.primitive_torus_add(major_segments=72, minor_segments=36, major_radius=1, minor_radius=0.4)
        made = bpy.context.object
        made.data.materials.append(material)
        scenes.add_camera((0, -3.2, 2.2), scenes.degrees(57, 0, 0), lens=50)
    bpy.ops.object.select_all(action="DESELECT")
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.shade_smooth()
    return scene, made


def _render_inside(job):
    """Renders the runs of a job: {"scene", "engine", "size", "dicing", "runs": [{"seed", "samples", "cells", "output"}]}."""
    import scenes

    with tempfile.TemporaryDirectory() as folder:
        scene, made = _build(job["scene"], folder)
        scene.render.resolution_x, scene.render.resolution_y = job["size"]
        if job["engine"] == "CYCLES":
            scene.cycles.feature_set = "EXPERIMENTAL"
            scene.cycles.dicing_rate = job["dicing"]
            made.modifiers.new("dicing", "SUBSURF").subdivision_type = "SIMPLE"
            made.cycles.use_adaptive_subdivision = True
        for run in job["runs"]:
            scene.relief.cell_pixels = run["cells"]
            begin = time.perf_counter()
            scenes.render(scene, job["engine"], run["output"], run["seed"], run["samples"])
            print("RUN", time.perf_counter() - begin, flush=True)


# --------------------------------------------------------------------------- outside


def _wrapped_program(folder):
    """A shell between Blender and the program: a process is counted the memory of the one that started it, too."""
    path = os.path.join(folder, "relief")
    with open(path, "w", encoding="utf-8") as file:
        file.write(f'#!/bin/sh\n"{os.environ["RELIEF_BINARY"]}" "$@"\nexit $?\n')
    os.chmod(path, 0o755)
    return path


def _render(job, program):
    """Runs a job in a Blender of its own: (its log, peak bytes of Blender)."""
    with tempfile.NamedTemporaryFile("w+", suffix=".log") as log:
        command = ["blender", "-b", "--factory-startup", "--debug-cycles", "--python-exit-code", "9"]
        command += ["--python", os.path.abspath(__file__), "--", "--inside", json.dumps(job)]
        environment = {**os.environ, "PATH": "/usr/bin:" + os.environ["PATH"], "RELIEF_BINARY": program}
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
        log.seek(0)
        text = log.read()
    if status != 0:
        sys.exit(text[-3000:])
    return text, usage.ru_maxrss * 1024


def _numbers(pattern, text):
    return [float(n) for n in re.findall(pattern, text)]


def _measure(name, size, samples, dicing, folder):
    """One row of the table."""
    import numpy as np

    sys.path.insert(0, os.path.join(_HERE, "..", "..", "benchmarks", "cycles"))
    from exr import read_rgb

    names = {n: os.path.join(folder, f"{name}.{n}.exr") for n in ("relief", "cycles", "r", "s")}
    runs = [
        {"seed": i, "samples": samples, "cells": cells, "output": names[n]}
        for i, (n, cells) in enumerate((("relief", 1.0), ("r", 0.25), ("s", 0.25)))
    ]
    job, program = {"scene": name, "size": size, "dicing": dicing}, _wrapped_program(folder)
    log, _ = _render({**job, "engine": "RELIEF", "runs": runs}, program)
    total = _numbers(r"relief: ([0-9.]+) s in all", log)[0]
    sampling = _numbers(r"render ([0-9.]+);", log)[0]
    relief_bytes = _numbers(r"peak (\d+) MiB", log)[0] * 2**20
    run = {"seed": 0, "samples": samples, "cells": 1.0, "output": names["cycles"]}
    log, cycles_bytes = _render({**job, "engine": "CYCLES", "runs": [run]}, program)
    cycles_total = _numbers(r"RUN ([0-9.]+)", log)[0]
    cycles_sampling = _numbers(r"without synchronization\): ([0-9.]+)", log)
    pictures = {n: read_rgb(path) for n, path in names.items()}
    errors = {}
    for n in ("relief", "cycles"):
        products = (pictures[n] - pictures["r"]) * (pictures[n] - pictures["s"])
        errors[n] = float(np.sqrt(max(0.0, products.mean())))
    preparation = total - sampling
    equal = preparation + sampling * max(1 / samples, (errors["relief"] / errors["cycles"]) ** 2)
    return (
        f"| {name} | {preparation:.1f} / {cycles_total - cycles_sampling[-1]:.1f} | {relief_bytes / 2**20:.0f} / "
        f"{cycles_bytes / 2**20:.0f} | {errors['relief']:.4f} / {errors['cycles']:.4f} | {total:.1f} / "
        f"{cycles_total:.1f} | {equal:.1f} / {cycles_total:.1f} |"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inside", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--dicing", type=float, default=1.0)
    parser.add_argument("--scenes", default=",".join(_SCENES))
    inside = "--" in sys.argv
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if inside else None)
    if arguments.inside:
        sys.path.insert(0, _HERE)
        return _render_inside(arguments.inside)
    size = [int(n) for n in arguments.size.split("x")]
    print(f"{arguments.size}, {arguments.samples} samples a pixel; each pair is relief / Cycles\n")
    print("| scene | preparation, s | memory, MiB | RMSE | time, s | time to Cycles' RMSE, s |")
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes.split(","):
            print(_measure(name, size, arguments.samples, arguments.dicing, folder), flush=True)


if __name__ == "__main__":
    main()
