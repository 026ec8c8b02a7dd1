"""Cryptomattes: the same ids and coverages as Cycles', and mattes that Blender's own node makes of them."""

import json
import os

import bpy
import numpy as np

from pass_test import passes
from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    degrees,
    diffuse,
    folder,
    new_material,
    new_scene,
    set_file_format,
)

_KINDS = ("object", "material", "asset")


def _stage():
    """A floor, two balls of which one hangs on the other, and one that lets half of what is behind it through."""
    scene = new_scene()
    add_plane(5, diffuse((0.6, 0.4, 0.2), "wood"))
    bpy.context.object.name = "floor"
    parent = add_sphere(0.8, diffuse((0.2, 0.7, 0.3), "paint"), (0.2, 0.3, 0.8), segments=64)
    parent.name = "ball"
    child = add_sphere(0.4, diffuse((0.2, 0.3, 0.7), "ünïcode"), (-1.2, -0.3, 0.4), segments=64)
    child.name = "small ball"
    child.parent = parent
    child.matrix_parent_inverse = parent.matrix_world.inverted()
    veil, tree, node = new_material("veil", "ShaderNodeMixShader")
    node.inputs[0].default_value = 0.5
    for i, kind in ((1, "ShaderNodeBsdfTransparent"), (2, "ShaderNodeBsdfDiffuse")):
        tree.links.new(tree.nodes.new(kind).outputs[0], node.inputs[i])
    add_plane(1.5, veil, (1.2, -1, 1))
    bpy.context.object.name = "veil"
    add_light("SUN", rotation=degrees(30, 20, 0), energy=2, angle=0)
    add_camera((1, -5, 3), degrees(62, 0, 12), lens=30)
    for kind in _KINDS:
        setattr(scene.view_layers[0], f"use_pass_cryptomatte_{kind}", True)
    return scene


def _coverage(picture, layer, kind, name, levels):
    """Share of each pixel that is something by its name: (height, width)."""
    from relief.cryptomatte import murmur_hash

    bits = murmur_hash(name)
    if bits >> 23 & 255 in (0, 255):
        bits ^= 1 << 23
    wanted = np.array(bits, dtype=np.uint32).view(np.float32)
    total = 0.0
    for i in range((levels + 1) // 2):
        r, g, b, a = (
            next(v for n, v in picture.items() if n.lower() == f"{layer}.crypto{kind}{i:02d}.{c}".lower()) for c in "rgba"
        )
        total = total + np.where(r == wanted, g, 0) + np.where(b == wanted, a, 0)
    return total


def test_ids_and_coverages_are_those_of_cycles():
    names = {
        "object": ("floor", "ball", "small ball", "veil"),
        "material": ("wood", "paint", "ünïcode", "veil"),
        "asset": ("floor", "ball", "veil"),
    }
    for levels in (2, 6):
        scene = _stage()
        layer = scene.view_layers[0]
        layer.pass_cryptomatte_depth = levels
        relief, cycles = (passes(scene, engine, 64) for engine in ("RELIEF", "CYCLES"))
        for kind in _KINDS:
            for name in names[kind]:
                ours, theirs = (_coverage(p, layer.name, kind, name, levels) for p in (relief, cycles))
                assert theirs.mean() > 0.01, (kind, name)
                # Of pixels with more things than levels each engine keeps others.
                largest = 0.35 if levels > 2 else 1
                assert np.abs(ours - theirs).max() < largest and abs(ours.mean() - theirs.mean()) < 0.005, (kind, name)


def test_files_of_16_bits_keep_ids():
    """As numbers of 32 bits, like Cycles': by the names of channels, by which DWA decides what it may damage, too."""
    from relief import exr

    scene = _stage()
    scene.view_layers[0].relief.use_pass_variance = True
    scene.relief.denoise = "builtin"
    found = {}
    for engine in ("RELIEF", "CYCLES"):
        scene.render.engine, scene.relief.samples, scene.cycles.samples = engine, 16, 16
        set_file_format("OPEN_EXR_MULTILAYER", "16")
        with folder() as path:
            scene.render.filepath = os.path.join(path, "picture.exr")
            bpy.ops.render.render(write_still=True)
            found[engine] = exr.read(scene.render.filepath).channels
    layer = scene.view_layers[0].name
    for name in ("floor", "ball", "small ball"):
        ours, theirs = (_coverage(found[engine], layer, "object", name, 6) for engine in ("RELIEF", "CYCLES"))
        assert theirs.mean() > 0.01 and abs(ours.mean() - theirs.mean()) < 0.01, name
    names = {engine: {n for n in channels if "Crypto" in n} for engine, channels in found.items()}
    assert names["RELIEF"] == names["CYCLES"] and names["RELIEF"], names
    own = {f"{layer}.{kind}.{c}" for kind in ("Variance", "Denoised Error") for c in "rgb"}
    assert own <= found["RELIEF"].keys(), found["RELIEF"].keys()


def test_metadata_is_that_of_cycles():
    from relief import exr

    found = {}
    for engine in ("RELIEF", "CYCLES"):
        scene = _stage()
        scene.render.engine, scene.relief.samples, scene.cycles.samples = engine, 1, 1
        set_file_format("OPEN_EXR_MULTILAYER", "32")
        with folder() as path:
            scene.render.filepath = os.path.join(path, "picture.exr")
            bpy.ops.render.render(write_still=True)
            texts = exr.read(scene.render.filepath).attributes
        found[engine] = {name: text for name, text in texts.items() if name.startswith("cryptomatte/")}
    assert found["RELIEF"].keys() == found["CYCLES"].keys() and len(found["RELIEF"]) == 12
    for name, theirs in found["CYCLES"].items():
        ours = found["RELIEF"][name]
        if not name.endswith("/manifest"):
            assert ours == theirs, name
            continue
        ours, theirs = json.loads(ours), json.loads(theirs)
        # Cycles lists what is not seen, too.
        assert ours.items() <= theirs.items(), (ours, theirs)
        assert len(ours) >= 3


def _matte(scene, set_source, matte_id, path):
    """What Blender's Cryptomatte node cuts out: (height, width)."""
    from relief import exr

    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    set_source(node)
    node.matte_id = matte_id
    # Without it Blender sees no need to render.
    tree.links.new(tree.nodes.new("CompositorNodeRLayers").outputs["Image"], node.inputs["Image"])
    output = tree.nodes.new("CompositorNodeComposite")
    tree.links.new(node.outputs["Matte"], output.inputs["Image"])
    scene.render.filepath = path
    settings = scene.render.image_settings
    settings.file_format, settings.exr_codec, settings.color_mode = "OPEN_EXR", "NONE", "RGB"
    bpy.ops.render.render(write_still=True)
    return exr.read(path).channels["R"]


def test_blenders_node_makes_mattes():
    """Of the engine's passes, and of a file that the program has written."""
    if bpy.app.version >= (5, 0, 0):  # compositing became a group of nodes that its user makes
        return
    import subprocess

    from relief.exporter import export_frames

    scene = _stage()
    scene.render.engine, scene.relief.samples = "RELIEF", 32
    layer = scene.view_layers[0].name
    with folder() as path:
        gltf, picture = os.path.join(path, "scene.gltf"), os.path.join(path, "scene.exr")
        export_frames(scene, gltf, [1])
        crypto = "crypto_object,crypto_material,crypto_asset"
        command = [os.environ["RELIEF_BINARY"], "render", gltf, "-o", picture, "--aov", crypto]
        subprocess.run(command, check=True)
        image = bpy.data.images.load(picture)

        def from_file(node):
            node.source, node.image, node.layer_name = "IMAGE", image, "CryptoObject"

        def from_render(node):
            node.source, node.scene, node.layer_name = "RENDER", scene, f"{layer}.CryptoObject"

        name = os.path.join(path, "matte.exr")
        by_file = _matte(scene, from_file, "small ball", name)
        by_render = _matte(scene, from_render, "small ball", name)
        nothing = _matte(scene, from_render, "nobody", name)
    assert 0.01 < by_render.mean() < 0.2 and by_render.max() > 0.99
    assert np.abs(by_file - by_render).max() < 1e-3
    assert nothing.max() == 0
