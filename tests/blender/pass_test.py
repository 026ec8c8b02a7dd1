"""Passes: what Blender calls depth, normal, position, … is what it gets, in its own axes and units."""

import os

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    degrees,
    diffuse,
    folder,
    new_scene,
    set_bounces,
    set_world,
)


def _passes(scene, engine, samples=16):
    """Channels of a multilayer file by name: float32 (height, width), bottom row first."""
    from relief import exr

    scene.render.engine = engine
    scene.relief.samples = scene.cycles.samples = samples
    settings = scene.render.image_settings
    settings.file_format, settings.exr_codec, settings.color_depth = "OPEN_EXR_MULTILAYER", "NONE", "32"
    with folder() as path:
        scene.render.filepath = os.path.join(path, "picture.exr")
        bpy.ops.render.render(write_still=True)
        return exr.read(scene.render.filepath).channels


def _stage():
    scene = new_scene()
    set_world((0.3, 0.4, 0.5))
    add_plane(5, diffuse((0.6, 0.4, 0.2)))
    add_sphere(1.0, diffuse((0.2, 0.7, 0.3)), (0.2, 0.3, 1), segments=64)
    add_light("SUN", rotation=degrees(30, 20, 0), energy=2, angle=0)
    add_camera((1, -5, 3), degrees(62, 0, 12), lens=30)
    return scene


def _compared(setting, names):
    """Channels of one pass from relief and Cycles, and how much the latter vary from pixel to pixel: (height, width)."""
    scene = _stage()
    layer = scene.view_layers[0]
    setattr(layer, setting, True)
    prefix = f"{layer.name}."
    pictures = [_passes(scene, engine) for engine in ("RELIEF", "CYCLES")]
    # Engines average differently over edges: pixels whose neighbours are alike are compared.
    relief, cycles = (np.stack([p[prefix + name] for name in names]).astype(np.float64) for p in pictures)
    spread = np.max([np.abs(np.gradient(c, axis=axis)) for c in np.minimum(cycles, 100) for axis in (0, 1)], axis=0)
    # At the picture's border only one neighbour is known.
    spread[[0, -1], :] = spread[:, [0, -1]] = np.inf
    return relief, cycles, spread


def test_depth():
    relief, cycles, spread = _compared("use_pass_z", ["Depth.Z"])
    inside = spread < 0.2
    assert inside.mean() > 0.5
    assert np.abs(relief - cycles)[0][inside & (cycles[0] < 100)].max() < 0.1
    assert np.array_equal(relief[0][inside] > 1e9, cycles[0][inside] > 1e9)


def test_normal():
    relief, cycles, spread = _compared("use_pass_normal", ["Normal.X", "Normal.Y", "Normal.Z"])
    inside = spread < 0.1
    assert inside.mean() > 0.5
    assert np.abs(relief - cycles)[:, inside].max() < 0.05


def test_position():
    relief, cycles, spread = _compared("use_pass_position", ["Position.X", "Position.Y", "Position.Z"])
    inside = spread < 0.2
    assert inside.mean() > 0.4
    assert np.abs(relief - cycles)[:, inside].max() < 0.15


def test_uv():
    relief, cycles, spread = _compared("use_pass_uv", ["UV.U", "UV.V"])
    inside = spread < 0.05
    assert inside.mean() > 0.3
    assert np.abs(relief - cycles)[:, inside].max() < 0.05


def test_diffuse_color():
    relief, cycles, spread = _compared("use_pass_diffuse_color", ["DiffCol.R", "DiffCol.G", "DiffCol.B"])
    inside = spread < 1e-3
    assert inside.mean() > 0.5
    assert np.abs(relief - cycles)[:, inside].max() < 5e-3


def test_direct_and_indirect_make_the_whole():
    scene = _stage()
    set_bounces(scene, 4)
    layer = scene.view_layers[0]
    for name in ("direct", "indirect", "samples", "variance"):
        setattr(layer.relief, f"use_pass_{name}", True)
    channels = _passes(scene, "RELIEF")
    for c in "RGB":
        whole = channels[f"{layer.name}.Combined.{c}"]
        parts = channels[f"{layer.name}.Direct.{c}"] + channels[f"{layer.name}.Indirect.{c}"]
        assert np.abs(whole - parts).max() < 1e-3
    assert channels[f"{layer.name}.Indirect.R"].max() > 0.01
    assert (channels[f"{layer.name}.Samples.X"] == 16).all()


def test_two_view_layers():
    """Each layer gets its own picture: the second one has no ball."""
    scene = _stage()
    ball = next(o for o in scene.objects if o.name.startswith("Sphere"))
    collection = bpy.data.collections.new("ball")
    scene.collection.children.link(collection)
    scene.collection.objects.unlink(ball)
    collection.objects.link(ball)
    second = scene.view_layers.new("second")
    second.layer_collection.children["ball"].exclude = True
    channels = _passes(scene, "RELIEF")
    first = channels[f"{scene.view_layers[0].name}.Combined.R"]
    assert np.abs(first - channels["second.Combined.R"]).max() > 0.1
