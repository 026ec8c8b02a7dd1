"""Passes: what Blender calls depth, normal, position, … is what it gets, in its own axes and units."""

import os

import bpy
import numpy as np

from scenes import (
    IS_5_0,
    IS_5_2,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_same_expectation,
    assert_warns,
    degrees,
    diffuse,
    folder,
    make_sharp,
    new_material,
    new_scene,
    set_bounces,
    set_file_format,
    set_world,
)


def passes(scene, engine, samples=16):
    """Channels of a multilayer file by name: float32 (height, width), bottom row first."""
    from relief import exr

    scene.render.engine = engine
    scene.relief.samples = scene.cycles.samples = samples
    set_file_format("OPEN_EXR_MULTILAYER", "32")
    with folder() as path:
        scene.render.filepath = os.path.join(path, "picture.exr")
        bpy.ops.render.render(write_still=True)
        return exr.read(scene.render.filepath).channels


def _name(name):
    from relief import compat

    return compat.pass_name(name)


def _stage(segments=64):
    scene = new_scene()
    set_world((0.3, 0.4, 0.5))
    add_plane(5, diffuse((0.6, 0.4, 0.2)))
    add_sphere(1.0, diffuse((0.2, 0.7, 0.3)), (0.2, 0.3, 1), segments=segments)
    add_light("SUN", rotation=degrees(30, 20, 0), energy=2, angle=0)
    add_camera((1, -5, 3), degrees(62, 0, 12), lens=30)
    return scene


def _compared(setting, names):
    """Channels of one pass from relief and Cycles, and how much the latter vary from pixel to pixel: (height, width)."""
    scene = _stage()
    layer = scene.view_layers[0]
    setattr(layer, setting, True)
    from relief import compat

    prefix = f"{layer.name}."
    names = [".".join((compat.pass_name(name), channel)) for name, channel in (n.split(".") for n in names)]
    pictures = [passes(scene, engine) for engine in ("RELIEF", "CYCLES")]
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


def _bumped_stage():
    """Bumps as wide as several blocks: of all closures, of one of two that are mixed, and of one beside the smooth rest."""
    scene = new_scene()
    set_world((0.3, 0.4, 0.5))
    for x, kind in ((-2.2, "ShaderNodeBsdfPrincipled"), (0, "ShaderNodeMixShader"), (2.2, "ShaderNodeBsdfDiffuse")):
        material, tree, node = new_material("bumped", kind)
        noise, bump = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBump")
        noise.inputs["Scale"].default_value, bump.inputs["Distance"].default_value = 1.0, 3.0
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Object"], noise.inputs["Vector"])
        tree.links.new(noise.outputs[0], bump.inputs["Height"])
        if kind == "ShaderNodeMixShader":
            node.inputs["Fac"].default_value = 0.3
            smooth, node_of_bump = (tree.nodes.new(f"ShaderNodeBsdf{name}") for name in ("Diffuse", "Glossy"))
            for index, part in enumerate((smooth, node_of_bump)):
                tree.links.new(part.outputs[0], node.inputs[1 + index])
            node = node_of_bump
        tree.links.new(bump.outputs[0], node.inputs["Normal"])
        add_plane(2, material, (x, 0, 0))
    add_camera((0, 0, 6), lens=40)
    return scene


def test_normals_are_bumped():
    axes = [f"Normal.{axis}" for axis in "XYZ"]
    _assert_blocks_agree("use_pass_normal", axes, 0.01, stage=_bumped_stage)
    axes = [f"Denoising Normal.{axis}" for axis in "XYZ"]
    # Since 5.0 Cycles' are other ones by up to .1: docs/blender.md.
    _assert_blocks_agree("denoising_store_passes", axes, 0.12 if IS_5_0 else 0.02, owner="cycles", stage=_bumped_stage)


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


def _blocks(channel, size=8):
    height, width = (side // size * size for side in channel.shape)
    return channel[:height, :width].reshape(height // size, size, width // size, size).mean(axis=(1, 3))


def _assert_blocks_agree(setting, names, tolerance, owner=None, stage=_stage, samples=64, far=np.inf):
    """Fails unless a pass of both engines has the same means over blocks of pixels, and is not the same everywhere.

    @param  far  where Cycles' values are not below it, it saw nothing: relief's are left out, and have to be mostly 0
    """
    scene = stage()
    layer = scene.view_layers[0]
    setattr(getattr(layer, owner) if owner else layer, setting, True)
    relief, cycles = (passes(scene, engine, samples) for engine in ("RELIEF", "CYCLES"))
    for name in names:
        ours, theirs = (picture[f"{layer.name}.{name}"].astype(np.float64) for picture in (relief, cycles))
        is_near = theirs < far
        assert is_near.all() or (ours[~is_near] == 0).mean() > 0.8, name
        ours, theirs = (_blocks(np.where(is_near, values, 0)) for values in (ours, theirs))
        assert np.ptp(theirs) > 3 * tolerance, f"{name} shows nothing"
        assert np.abs(ours - theirs).max() < tolerance, (name, np.abs(ours - theirs).max())


def test_denoised():
    """Combined is denoised, Noisy Image as without; the error that it claims is the difference to a clean picture."""
    # Blender sums the normals of more than 1,024 faces in several threads: their last bits are others from time to time.
    scene = _stage(segments=32)
    name = f"{scene.view_layers[0].name}."
    plain = passes(scene, "RELIEF", 4)
    assert name + "Noisy Image.R" not in plain
    scene.relief.denoise = "builtin"
    denoised = passes(scene, "RELIEF", 4)
    scene.relief.denoise = "none"
    clean = passes(scene, "RELIEF", 1024)[name + "Combined.R"].astype(np.float64)
    for channel in "RGBA":
        assert np.array_equal(denoised[f"{name}Noisy Image.{channel}"], plain[f"{name}Combined.{channel}"]), channel

    def rmse(values):
        return np.sqrt(np.mean((values - clean) ** 2))

    left = rmse(denoised[name + "Combined.R"])
    assert left < 0.7 * rmse(plain[name + "Combined.R"]), (left, rmse(plain[name + "Combined.R"]))
    claimed = np.sqrt(np.mean(denoised[name + "Denoised Error.r"].astype(np.float64) ** 2))
    assert 0.6 < claimed / left < 1.6, (claimed, left)
    assert np.array_equal(denoised[name + "Combined.A"], plain[name + "Combined.A"])


def test_mist():
    for falloff in ("LINEAR", "QUADRATIC", "INVERSE_QUADRATIC"):

        def stage():
            scene = _stage()
            mist = scene.world.mist_settings
            mist.start, mist.depth, mist.falloff = 3.0, 5.0, falloff
            return scene

        _assert_blocks_agree("use_pass_mist", ["Mist.Z"], 0.02, stage=stage)


def _glowing_stage():
    scene = _stage()
    lamp = add_light("AREA", (-1.5, 0, 2), degrees(60, 0, -30), energy=20, size=1)
    lamp.visible_camera = True
    add_sphere(0.4, new_material("glow", "ShaderNodeEmission", Color=(1, 0.5, 0.2, 1), Strength=2.0)[0], (-1, -1, 0.4))
    return scene


def test_emission():
    names = [f"{_name('Emit')}.{c}" for c in "RGB"]
    _assert_blocks_agree("use_pass_emit", names, 0.1, stage=_glowing_stage)


def test_environment():
    names = [f"{_name('Env')}.{c}" for c in "RGB"]
    for is_transparent in (False, True):

        def stage():
            scene = _stage()
            scene.render.film_transparent = is_transparent
            return scene

        _assert_blocks_agree("use_pass_environment", names, 0.02, stage=stage)


def test_ambient_occlusion():
    def stage():
        scene = _stage()
        scene.world.light_settings.distance = 1.5
        return scene

    names = [f"{_name('AO')}.{c}" for c in "RGB"]
    _assert_blocks_agree("use_pass_ambient_occlusion", names, 0.05, stage=stage, samples=128)


def _mirror_stage(color):
    """The denoising passes show what mirrors mirror."""
    scene = _stage()
    mirror, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=color)
    make_sharp(node)
    add_sphere(0.7, mirror, (1.7, -0.6, 0.7), segments=64)
    set_bounces(scene, 4)
    return scene


def _assert_denoising(name, channels, tolerance, color=(0.9, 0.8, 0.7, 1), far=np.inf):
    """@param color  of the mirror"""
    names = [f"Denoising {name}.{c}" for c in channels]
    _assert_blocks_agree(
        "denoising_store_passes", names, tolerance, owner="cycles", stage=lambda: _mirror_stage(color), far=far
    )


def test_denoising_albedo():
    # A white mirror: at its rim a coloured metal of glTF is white, Blender's is not.
    _assert_denoising("Albedo", "RGB", 0.03, (1, 1, 1, 1))


def test_denoising_normal():
    # Since 5.2 Cycles multiplies normals by the mean colour of the mirrors that show them; relief's are of length one.
    color = (1, 1, 1, 1) if IS_5_2 else (0.9, 0.8, 0.7, 1)
    _assert_denoising("Normal", "XYZ", 0.06, color)


def test_denoising_depth():
    # Since 5.2 one sample that hits nothing makes the sum of Cycles' pixel the largest float; before it counted as 0.
    _assert_denoising("Depth", "Z", 0.3, far=1e30 if IS_5_2 else np.inf)


def test_passes_that_are_not_there_are_warned_about():
    scene = _stage()
    layer = scene.view_layers[0]
    layer.use_pass_vector = True
    assert_warns(scene, f'view layer "{layer.name}"', "the pass", "left empty")
    layer.use_pass_vector = False
    if hasattr(layer, "use_pass_shadow"):
        layer.use_pass_shadow = True
        assert_warns(scene, "the pass", "Shadow", "left empty")
        layer.use_pass_shadow = False
    layer.aovs.add().name = "mask"
    assert_warns(scene, 'shader AOV "mask"')


def test_direct_and_indirect_make_the_whole():
    scene = _stage()
    set_bounces(scene, 4)
    layer = scene.view_layers[0]
    for name in ("direct", "indirect", "samples", "variance"):
        setattr(layer.relief, f"use_pass_{name}", True)
    channels = passes(scene, "RELIEF")
    for c in "RGB":
        whole = channels[f"{layer.name}.Combined.{c}"]
        parts = channels[f"{layer.name}.Direct.{c}"] + channels[f"{layer.name}.Indirect.{c}"]
        assert np.abs(whole - parts).max() < 1e-3
    assert channels[f"{layer.name}.Indirect.R"].max() > 0.01
    assert (channels[f"{layer.name}.Samples.X"] == 16).all()


def test_volume_passes():
    """What volumes scatter, and with what else there is the whole picture."""
    scene = new_scene(32, 24)
    set_bounces(scene, 2)
    scene.cycles.volume_bounces = scene.relief.volume_bounces = 2
    set_world((0.1, 0.15, 0.2))
    add_plane(20, diffuse((0.6, 0.4, 0.2)))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=3)
    add_camera((0, -7, 1.6), degrees(82, 0, 0), lens=35)
    material, tree, scatter = new_material("fog", "ShaderNodeVolumeScatter", Density=0.5, Color=(0.9, 0.7, 0.5, 1))
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.remove(output.inputs["Surface"].links[0])
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    add_sphere(1.2, material, (0, 0, 1.0))
    layer = scene.view_layers[0]
    layer.cycles.use_pass_volume_direct = layer.cycles.use_pass_volume_indirect = True
    runs = {}
    for engine in ("RELIEF", "CYCLES"):
        pictures = []
        for seed in range(5):
            scene.cycles.seed = scene.relief.seed = seed
            pictures.append(passes(scene, engine, 256))
        for name in ("VolumeDir", "VolumeInd"):
            channels = [f"{layer.name}.{_name(name)}.{c}" for c in "RGB"]
            runs[engine, name] = np.stack([[p[c] for c in channels] for p in pictures]).transpose(0, 2, 3, 1).astype(np.float64)
    for name in ("VolumeDir", "VolumeInd"):
        assert_same_expectation(runs["RELIEF", name], runs["CYCLES", name], least_mean=0.001)


#: Passes of light by what the surface that is seen does to it.
LIGHT_PASSES = [kind + part for kind in ("Diff", "Gloss", "Trans") for part in ("Dir", "Ind", "Col")]


def _mixed_stage(size=(48, 32)):
    """Matter that does all of it: plastic, metal, leaves and a pane under a hazy sun and a sky."""
    scene = new_scene(*size)
    set_bounces(scene, 3)
    set_world((0.3, 0.4, 0.5))
    add_plane(6, diffuse((0.6, 0.4, 0.2)))
    add_light("SUN", rotation=degrees(30, 20, 0), energy=2, angle=1.0)
    plastic = new_material("plastic", "ShaderNodeBsdfPrincipled", **{"Base Color": (0.7, 0.2, 0.1, 1), "Roughness": 0.4})[0]
    metal = new_material("metal", "ShaderNodeBsdfPrincipled",
                         **{"Base Color": (0.9, 0.7, 0.3, 1), "Metallic": 1.0, "Roughness": 0.3})[0]  # fmt: skip
    glossy = new_material("glossy", "ShaderNodeBsdfGlossy", Color=(0.4, 0.6, 0.9, 1), Roughness=0.2)[0]
    pane = new_material("pane", "ShaderNodeBsdfRefraction", Color=(0.9, 0.8, 0.6, 1), Roughness=0.3, IOR=1.2)[0]
    leaf = new_material("leaf", "ShaderNodeBsdfTranslucent", Color=(0.3, 0.7, 0.2, 1))[0]
    for i, material in enumerate((plastic, metal, glossy, leaf)):
        add_sphere(0.55, material, (1.25 * (i - 2), 0.4 * (i % 2), 0.6), segments=32)
    card = add_plane(1.6, pane, (2.3, -0.5, 0.7))
    card.rotation_euler = degrees(80, 0, 20)
    add_camera((0, -7, 2.5), degrees(73, 0, 0), lens=42)
    return scene


def _switch_on_light_passes(layer):
    for kind in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)


def _stacked(picture, layer, name):
    return np.stack([picture[f"{layer.name}.{_name(name)}.{c}"] for c in "RGB"], axis=-1).astype(np.float64)


def test_light_by_events_is_that_of_cycles():
    scene = _mixed_stage()
    layer = scene.view_layers[0]
    _switch_on_light_passes(layer)
    runs = {name: {} for name in LIGHT_PASSES}
    for engine in ("RELIEF", "CYCLES"):
        pictures = []
        for seed in range(5):
            scene.cycles.seed = scene.relief.seed = seed
            pictures.append(passes(scene, engine, 2048))
        for name in LIGHT_PASSES:
            runs[name][engine] = np.stack([_stacked(p, layer, name) for p in pictures])
    for name in LIGHT_PASSES:
        assert np.abs(runs[name]["CYCLES"]).max() > 0.01, f"{name} shows nothing"
        assert_same_expectation(runs[name]["RELIEF"], runs[name]["CYCLES"], least_mean=0.001)


def test_light_by_events_makes_the_picture():
    """As compositors put it together again."""
    scene = _mixed_stage()
    layer = scene.view_layers[0]
    _switch_on_light_passes(layer)
    layer.use_pass_environment = layer.use_pass_emit = True
    picture = passes(scene, "RELIEF", 16)
    whole = _stacked(picture, layer, "Env") + _stacked(picture, layer, "Emit")
    for kind in ("Diff", "Gloss", "Trans"):
        light = _stacked(picture, layer, kind + "Dir") + _stacked(picture, layer, kind + "Ind")
        whole += light * _stacked(picture, layer, kind + "Col")
    combined = np.stack([picture[f"{layer.name}.Combined.{c}"] for c in "RGB"], axis=-1)
    assert np.abs(whole - combined).max() < 2e-3, np.abs(whole - combined).max()


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
    channels = passes(scene, "RELIEF")
    first = channels[f"{scene.view_layers[0].name}.Combined.R"]
    assert np.abs(first - channels["second.Combined.R"]).max() > 0.1
