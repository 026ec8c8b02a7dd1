"""Blender's materials of many nodes in relief and in Cycles: samples a second, side by side, and how far the pictures differ.

    blender -b --factory-startup --python benchmarks/cycles/graph_speed.py [-- --threads 1 --rounds 3]

A ball and a floor of the same material under a sky and a lamp, or a sun. The rate is that of the samples alone: the time of a picture
of few samples is taken from that of a picture of many, so that neither program's preparation counts. The engines take
turns; figures are medians over the rounds. `nodes` says what the nodes cost: the time for the same picture without them, every
linked input of its shaders at a constant, is taken from that with them.

Needs the add-on in Blender's scripts folder, as tests/blender/run_test.py has it.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time

import bpy

_ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(_ROOT, "tests", "blender"), os.path.dirname(os.path.abspath(__file__))]

import scenes  # noqa: E402
from node_tree import NodeTree  # noqa: E402

_FEW, _MANY = 4, 36


def wood():
    t = NodeTree("wood")
    p = t.place((1, 1, 0.2))
    noise = t.node("TexNoise", {0: p, "Scale": 2, "Detail": 3})
    bent = t.node("VectorMath", {0: p, 1: noise.outputs[1]}, operation="ADD").outputs[0]
    rings = t.node("TexWave", {0: bent, "Scale": 3, "Distortion": 4, "Detail": 2}, wave_type="RINGS").outputs[1]
    fibre = t.node("TexNoise", {0: t.place((40, 40, 1)), "Scale": 3, "Detail": 4}).outputs[0]
    color = t.ramp(rings, (0.25, 0.1, 0.03), (0.5, 0.25, 0.1), (0.6, 0.35, 0.15))
    color = t.mix(t.math("MULTIPLY", fibre, 0.4), color, (0.1, 0.05, 0.02, 1))
    color = t.node("HueSaturation", {"Color": color, "Saturation": 1.1}).outputs[0]
    rough = t.node("MapRange", {0: fibre, 3: 0.35, 4: 0.7}).outputs[0]
    height = t.math("ADD", t.math("MULTIPLY", rings, 0.3), fibre)
    return t.end(t.principled(color, rough, height))


def marble():
    t = NodeTree("marble")
    p = t.place((1, 1, 1))
    color = (0.9, 0.9, 0.88, 1)
    height = 0.5
    for i, (scale, tone) in enumerate(((1, (0.2, 0.2, 0.25)), (3, (0.5, 0.45, 0.4)), (8, (0.3, 0.33, 0.35)))):
        noise = t.node("TexNoise", {0: p, "Scale": scale, "Detail": 6, "Distortion": 0.5})
        vein = t.math("ABSOLUTE", t.math("SUBTRACT", noise.outputs[0], 0.5))
        factor = t.ramp(vein, (1, 1, 1), (0.2, 0.2, 0.2), (0, 0, 0))
        color = t.mix(factor, color, (*tone, 1))
        height = t.math("SUBTRACT", height, t.math("MULTIPLY", factor, 0.1 / (i + 1)))
    rough = t.node("MapRange", {0: height, 3: 0.1, 4: 0.4}).outputs[0]
    return t.end(t.principled(color, rough, height))


def rust():
    t = NodeTree("rust")
    p = t.place((1, 1, 1))
    mask = 0.0
    for scale in (1.5, 4, 11):
        noise = t.node("TexNoise", {0: p, "Scale": scale, "Detail": 5}).outputs[0]
        mask = t.math("ADD", mask, t.math("MULTIPLY", noise, 0.4))
    edge = t.ramp(mask, (0, 0, 0), (0.2, 0.2, 0.2), (1, 1, 1))
    grain = t.node("TexMusgrave", {0: p, "Scale": 9, "Detail": 4}).outputs[0] if not scenes.IS_4_0 else mask
    cells = t.node("TexVoronoi", {0: p, "Scale": 14}).outputs[0]
    color = t.ramp(t.math("ADD", grain, cells), (0.15, 0.03, 0.01), (0.4, 0.12, 0.03), (0.6, 0.25, 0.08))
    color = t.mix(0.5, color, t.ramp(cells, (0.1, 0.05, 0.03), (0.5, 0.2, 0.1)), "OVERLAY")
    scratches = t.node("TexNoise", {0: t.place((1, 60, 1)), "Scale": 2, "Detail": 2}).outputs[0]
    steel = t.principled(
        t.ramp(scratches, (0.3, 0.3, 0.32), (0.6, 0.6, 0.6)),
        t.node("MapRange", {0: scratches, 3: 0.35, 4: 0.6}).outputs[0],
        scratches,
        Specular=0.8,
    )
    rusty = t.principled(color, t.node("MapRange", {0: grain, 3: 0.7, 4: 1}).outputs[0], t.math("ADD", grain, cells))
    return t.end(t.node("MixShader", {0: edge, 1: steel, 2: rusty}).outputs[0])


def layers(name, count):
    """A stack of weathered coats: each by a texture of another kind, of its own colours, roughness and height."""
    t = NodeTree(name)
    p = t.place((1, 1, 1))
    color, rough, height = (0.5, 0.5, 0.5, 1), 0.5, 0.0
    for i in range(count):
        kind = ("TexNoise", "TexVoronoi", "TexWave", "TexMagic")[i % 4]
        texture = t.node(kind, {0: p, "Scale": 2.0 + i}).outputs[0]
        factor = t.ramp(t.math("FRACT", t.math("MULTIPLY", texture, 1.7)), (0, 0, 0), (1, 1, 1))
        tone = t.node("HueSaturation", {"Color": (0.6, 0.3, 0.2, 1), "Hue": 0.1 * i % 1}).outputs[0]
        color = t.mix(factor, color, t.mix(texture, tone, (0.2, 0.2, 0.2, 1), "MULTIPLY"))
        rough = t.math("ADD", t.math("MULTIPLY", rough, 0.8), t.math("MULTIPLY", factor, 0.1))
        height = t.math("ADD", height, t.math("MULTIPLY", factor, 0.2))
    return t.end(t.principled(color, rough, height))


def scales():
    return layers("scales", 5)


def planet():
    return layers("planet", 9)


def car_paint():
    t = NodeTree("car_paint")
    p = t.place((1, 1, 1))
    facing = t.node("LayerWeight", {"Blend": 0.3}).outputs["Facing"]
    flakes = t.node("TexVoronoi", {0: p, "Scale": 60}).outputs[1]
    tone = t.ramp(facing, (0.5, 0.02, 0.02), (0.25, 0.01, 0.03), (0.05, 0.0, 0.02))
    color = t.mix(0.15, tone, flakes, "OVERLAY")
    rough = t.node("MapRange", {0: flakes, 3: 0.3, 4: 0.5}).outputs[0]
    return t.end(t.principled(color, rough, Metallic=0.7, Clearcoat=1.0, Clearcoat_Roughness=0.03))


def skin():
    t = NodeTree("skin")
    p = t.place((1, 1, 1))
    blotches = t.node("TexNoise", {0: p, "Scale": 3, "Detail": 4}).outputs[0]
    pores = t.node("TexVoronoi", {0: p, "Scale": 30}).outputs[0]
    color = t.ramp(blotches, (0.6, 0.3, 0.22), (0.75, 0.45, 0.35), (0.55, 0.22, 0.18))
    rough = t.node("MapRange", {0: blotches, 3: 0.35, 4: 0.55}).outputs[0]
    return t.end(t.principled(color, rough, pores, Clearcoat=0.25, Clearcoat_Roughness=0.25, Sheen=0.4))


def glass_and_metal():
    t = NodeTree("glass_and_metal")
    p = t.place((1, 1, 1))
    mask = t.ramp(t.node("TexNoise", {0: p, "Scale": 2, "Detail": 2}).outputs[0], (0, 0, 0), (0, 0, 0), (1, 1, 1))
    glass = t.node("BsdfGlass", {"Color": (0.9, 0.95, 0.9, 1), "Roughness": 0.05}).outputs[0]
    worn = t.node("TexNoise", {0: p, "Scale": 7, "Detail": 3}).outputs[0]
    metal = t.principled((0.8, 0.6, 0.3, 1), t.node("MapRange", {0: worn, 3: 0.1, 4: 0.4}).outputs[0], Metallic=1.0)
    return t.end(t.node("MixShader", {0: mask, 1: glass, 2: metal}).outputs[0])


def leaves():
    t = NodeTree("leaves")
    p = t.place((1, 1, 1))
    cells = t.node("TexVoronoi", {0: p, "Scale": 4})
    veins = t.node("TexWave", {0: p, "Scale": 3, "Distortion": 2, "Detail": 1}).outputs[1]
    color = t.mix(veins, t.mix(0.7, cells.outputs[1], (0.1, 0.3, 0.04, 1)), (0.2, 0.35, 0.1, 1))
    holes = t.ramp(cells.outputs[0], (1, 1, 1), (1, 1, 1), (0, 0, 0), (0, 0, 0))
    through = t.node("BsdfTranslucent", {"Color": color}).outputs[0]
    leaf = t.node("MixShader", {0: 0.4, 1: t.principled(color, 0.4, veins), 2: through}).outputs[0]
    clear = t.node("BsdfTransparent").outputs[0]
    return t.end(t.node("MixShader", {0: holes, 1: clear, 2: leaf}).outputs[0])


def plain():
    t = NodeTree("plain")
    return t.end(t.principled((0.6, 0.3, 0.2, 1)))


_MATERIALS = (wood, marble, rust, scales, planet, car_paint, skin, glass_and_metal, leaves, plain)


def _without_nodes(material):
    """The same shaders with no nodes before them."""
    bare = material.copy()
    tree = bare.node_tree
    for node in tree.nodes:
        for socket in node.inputs:
            if socket.is_linked and socket.type != "SHADER":
                tree.links.remove(socket.links[0])
    return bare


def _stage(make, is_bare, threads):
    scene = scenes.new_scene(480, 360)
    scene.relief.strict = False
    scene.relief.caustics = "off"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.relief.threads = threads
    scenes.set_bounces(scene, 4)
    scenes.set_world((0.4, 0.5, 0.7))
    material = make()
    if is_bare:
        material = _without_nodes(material)
    scenes.add_plane(8, material)
    scenes.add_sphere(1.0, material, (0, 0, 1), segments=64)
    if make is plain:
        scenes.add_light("SUN", (2, -2, 4), scenes.degrees(30, 25, 0), energy=3)
    else:
        scenes.add_light("AREA", (2, -2, 4), scenes.degrees(30, 25, 0), energy=150, size=1.5)
    scenes.add_camera((0, -5, 3), scenes.degrees(67, 0, 0), lens=45)
    return scene


def _seconds_a_sample(scene, engine, path):
    times = []
    for samples in (_FEW, _MANY):
        start = time.perf_counter()
        picture = scenes.render(scene, engine, path, seed=samples, samples=samples)
        times.append(time.perf_counter() - start)
    return (times[1] - times[0]) / (_MANY - _FEW), picture


def _measure(make, threads, rounds, path):
    seconds, pictures = {}, {}
    for _ in range(rounds):
        for is_bare in (False, True):
            scene = _stage(make, is_bare, threads)
            if not is_bare:
                num_nodes = len(bpy.data.materials[make.__name__].node_tree.nodes)
            for engine in ("RELIEF", "CYCLES"):
                one, picture = _seconds_a_sample(scene, engine, path)
                seconds.setdefault((engine, is_bare), []).append(one)
                pictures[engine, is_bare] = picture
    return num_nodes, {key: statistics.median(values) for key, values in seconds.items()}, pictures


def main(arguments):
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*")
    options = parser.parse_args(arguments)
    print("| material | nodes | relief, samples/s | Cycles | ratio | nodes, µs a sample | Cycles | ratio | means differ |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory() as folder:
        for make in _MATERIALS:
            if options.only and make.__name__ not in options.only:
                continue
            nodes, seconds, pictures = _measure(make, options.threads, options.rounds, os.path.join(folder, "picture.exr"))
            ours, theirs = seconds["RELIEF", False], seconds["CYCLES", False]
            pixels = 480 * 360
            costs = [1e6 * (seconds[e, False] - seconds[e, True]) / pixels for e in ("RELIEF", "CYCLES")]
            difference = pictures["RELIEF", False].mean() / pictures["CYCLES", False].mean() - 1
            row = (f"{pixels / ours:,.0f}", f"{pixels / theirs:,.0f}", f"{theirs / ours:.2f}", f"{costs[0]:.2f}")
            # Two nodes are a shader and the output.
            ratio = f"{costs[1] / costs[0]:.2f}" if nodes > 2 else ""
            row += (f"{costs[1]:.2f}", ratio, f"{difference:+.2%}")
            print("|", " | ".join((make.__name__, str(nodes), *row)), "|", flush=True)


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
