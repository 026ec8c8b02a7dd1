"""Noise over the number of samples, in relief and in Cycles: how evenly either spreads its points.

    blender -b --factory-startup --addons relief --python benchmarks/cycles/variance.py [-- CASE… --samples 16,64,256 --seeds 2]

Small scenes, each with one thing that is chosen or sampled: lamps by number and by kind, lamps beside a world, closures,
the lens, time, bounces, the pixel filter. Prints the variance of a pixel over the square of the picture's mean, from
pictures that differ in their seeds, and relief's over Cycles': what a picture of as many samples has. `fall` is the exponent of
the number of samples between the first and the last: −1 for random points.
"""

import argparse
import itertools
import math
import os
import random
import sys
import tempfile

import bpy
import numpy as np
from mathutils import Vector

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from exr import read_rgb  # noqa: E402


def _link(name, data, location=(0, 0, 0), look=None, scale=(1, 1, 1)):
    made = bpy.data.objects.new(name, data)
    made.location, made.scale = location, scale
    if look is not None:
        made.rotation_euler = (Vector(look) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(made)
    return made


def _material(kind, **inputs):
    material = bpy.data.materials.new(kind)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new("ShaderNode" + kind), tree.nodes.new("ShaderNodeOutputMaterial")
    for name, value in inputs.items():
        shader.inputs[name.replace("_", " ")].default_value = value
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _grey(value=0.5):
    return _material("BsdfDiffuse", Color=(value, value, value, 1))


def _stage(material=_grey, world=0.0):
    """A floor, a ball and a block on it, a camera above. @param material  makes it: an empty file has none"""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (world, world, world, 1)
    material = material()
    bpy.ops.mesh.primitive_plane_add(size=30)
    floor = bpy.context.object
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1, location=(-1.2, 0, 1), segments=48, ring_count=24)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    bpy.ops.mesh.primitive_cube_add(size=1.4, location=(1.3, 0.6, 0.7), rotation=(0, 0, 0.5))
    for made in (floor, ball, bpy.context.object):
        made.data.materials.append(material)
    scene.camera = _link("Camera", bpy.data.cameras.new("Camera"), (0, -7, 4), (0, 0, 0.6))
    return scene


def _lamp(kind, energy, location, look=(0, 0, 0), **attributes):
    lamp = bpy.data.lights.new(kind, kind)
    lamp.energy = energy
    for name, value in attributes.items():
        setattr(lamp, name, value)
    return _link(kind, lamp, location, look)


def _lamps(number, kind, **attributes):
    """Lamps around the stage, of powers between a third and three times their mean."""
    numbers = random.Random(number)
    reach = 4 if number <= 16 else 14
    for _ in range(number):
        angle, radius = 2 * math.pi * numbers.random(), reach * math.sqrt(numbers.uniform(0.3, 1))
        place = (radius * math.cos(angle), radius * math.sin(angle), numbers.uniform(2, 6))
        size = {"size": numbers.uniform(0.5, 2)} if kind == "AREA" else {"shadow_soft_size": numbers.uniform(0.05, 0.4)}
        _lamp(kind, 600 / number * 9 ** numbers.uniform(-0.5, 0.5), place, **{**size, **attributes})


def _many(number, kind="AREA", world=0.0, **attributes):
    def make():
        _stage(world=world)
        _lamps(number, kind, **attributes)

    return make


def _glowing():
    """A ring of 512 triangles that glow."""
    _stage()
    bpy.ops.mesh.primitive_torus_add(major_radius=2.5, minor_radius=0.1, major_segments=32, minor_segments=8, location=(0, 0, 3.5))
    bpy.context.object.data.materials.append(_material("Emission", Strength=12.0))


def _sky():
    """A world by an image with a bright patch, and a lamp."""
    scene = _stage()
    height, width = 64, 128
    texels = np.ones((height, width, 4), np.float32)
    texels[..., :3] = 0.2 + 0.6 * np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    texels[40:46, 20:32, :3] = 40
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    image.pixels.foreach_set(texels.ravel())
    image.pack()
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs[0])
    _lamp("AREA", 300, (3, -3, 4), size=1)


def _suns():
    _stage()
    for turn in (0.3, 2.2, 4.4):
        _lamp("SUN", 1.5, (4 * math.cos(turn), 4 * math.sin(turn), 5), angle=0.1)


def _four_lamps():
    """Of several sizes over a dark, half glossy plane."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.033, 0.033, 0.033, 1)
    bpy.ops.mesh.primitive_plane_add(size=30)
    bpy.context.object.data.materials.append(_material("BsdfPrincipled", Base_Color=(0.017, 0.017, 0.017, 1), Specular=0.28))
    _lamp("POINT", 1361, (0.45, -2.1, 5.9), shadow_soft_size=0.1)
    _lamp("AREA", 10835, (15, -6, 7.6), size=7.9)
    _lamp("AREA", 2800, (-6, -16, 9.8), size=4.8)
    _lamp("AREA", 1385, (-11, 7, 10.7), size=4.8)
    scene.camera = _link("Camera", bpy.data.cameras.new("Camera"), (0, -9, 6), (0, 0, 0))


def _plastic():
    """Closures: a glossy coat over colour, half metal, under an even world."""
    inputs = {"Base_Color": (0.5, 0.2, 0.1, 1), "Metallic": 0.5, "Roughness": 0.3, "Clearcoat": 0.5}
    _stage(lambda: _material("BsdfPrincipled", **inputs), world=1.0)


def _rough_glass():
    scene = _stage(world=1.0)
    ball = next(o for o in scene.objects if o.name.startswith("Sphere"))
    ball.data.materials[0] = _material("BsdfGlass", Roughness=0.3)


def _room():
    """Closed, white and lit by one lamp: paths end by roulette."""
    scene = _stage(lambda: _grey(0.7))
    bpy.ops.mesh.primitive_cube_add(size=16, location=(0, 0, 7.9))
    bpy.context.object.data.materials.append(_grey(0.7))
    _lamp("AREA", 300, (2, -2, 5), size=1)
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 12


def _lens():
    scene = _stage()
    _lamps(1, "AREA")
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_distance = 4
    scene.camera.data.dof.aperture_fstop = 0.2


def _time():
    scene = _stage()
    _lamps(1, "AREA")
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0
    ball = next(o for o in scene.objects if o.name.startswith("Sphere"))
    for frame, x in ((0, -2.2), (2, -0.2)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    scene.frame_set(1)


def _filter():
    _stage()
    _lamps(1, "AREA")


CASES = {
    **{f"{n}_area": _many(n) for n in (1, 2, 4, 16, 1000)},
    **{f"{n}_point": _many(n, "POINT") for n in (4, 16)},
    "4_delta": _many(4, "POINT", shadow_soft_size=0.0),
    "16_spot": _many(16, "SPOT", spot_size=1.2),
    "1_under_world": _many(1, world=0.03),
    "3_under_world": _many(3, world=0.1),
    "suns": _suns,
    "four_lamps": _four_lamps,
    "glowing": _glowing,
    "sky": _sky,
    "plastic": _plastic,
    "rough_glass": _rough_glass,
    "room": _room,
    "lens": _lens,
    "time": _time,
    "filter": _filter,
}


def _render(scene, engine, samples, seed, path, wide_filter):
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 80, 60, 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    cycles = scene.cycles
    cycles.samples, cycles.seed = samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.light_sampling_threshold = 0
    if not wide_filter:
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    return read_rgb(path).mean(axis=2)


def _variance(scene, engine, samples, seeds, folder, wide_filter):
    pictures = np.stack(
        [_render(scene, engine, samples, seed, os.path.join(folder, "p.exr"), wide_filter) for seed in range(1, seeds + 1)]
    )
    return float(pictures.var(axis=0, ddof=1).mean() / pictures.mean() ** 2), float(pictures.mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], metavar="CASE")
    parser.add_argument("--samples", default="16,64,256")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--engines", default="CYCLES,RELIEF")
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    options = parser.parse_args(words)
    counts = [int(n) for n in options.samples.split(",")]
    engines = options.engines.split(",")
    rows = ["| case | engine | " + " | ".join(map(str, counts)) + " | fall | mean |", "|---" * (len(counts) + 4) + "|"]
    with tempfile.TemporaryDirectory() as folder:
        for name in options.cases or CASES:
            CASES[name]()
            blend = os.path.join(folder, name + ".blend")
            bpy.ops.wm.save_as_mainfile(filepath=blend)
            found = {}
            for engine, count in itertools.product(engines, counts):
                bpy.ops.wm.open_mainfile(filepath=blend)
                found[engine, count] = _variance(bpy.context.scene, engine, count, options.seeds, folder, name == "filter")
            for engine in engines:
                row = [found[engine, count][0] for count in counts]
                fall = math.log(row[-1] / row[0]) / math.log(counts[-1] / counts[0]) if len(counts) > 1 else 0
                cells = " | ".join(f"{value:.3g}" for value in row)
                rows.append(f"| {name} | {engine.lower()} | {cells} | {fall:.2f} | {found[engine, counts[-1]][1]:.4f} |")
            if len(engines) == 2:
                ratios = " | ".join(f"{found[engines[1], n][0] / found[engines[0], n][0]:.2f}" for n in counts)
                rows.append(f"| {name} | ratio | {ratios} | | |")
            print("\n".join(rows), flush=True)
            rows = []


if __name__ == "__main__":
    main()
