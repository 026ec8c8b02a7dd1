"""Settings: those of Cycles are taken over unless relief's own are wanted, and mean what they mean there."""

import json
import os
import re
import subprocess

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
    read_rgb,
    set_world,
)


def _fresh_scene():
    """A scene in which nobody has touched a setting of either engine's, but for a small picture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="relief")
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    set_world((0.4, 0.5, 0.6))
    add_plane(6, diffuse((0.7, 0.7, 0.7)))
    add_sphere(1.0, diffuse((0.8, 0.2, 0.1), "red"), (0, 0, 1))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0)
    add_camera((0, -6, 4), degrees(57, 0, 0))
    return scene


def _exported(scene):
    """(RELIEF_render of the scene, warnings)."""
    from relief.exporter import export_frames

    with folder() as path:
        warnings, _ = export_frames(scene, f"{path}/scene.gltf", [scene.frame_current])
        with open(f"{path}/scene.gltf", encoding="utf-8") as file:
            return json.load(file)["extensions"]["RELIEF_render"], warnings


def test_cycles_settings_are_taken_over():
    from relief import final
    from relief.export.settings import sampling_of

    scene = _fresh_scene()
    cycles = scene.cycles
    cycles.samples, cycles.preview_samples, cycles.seed, cycles.time_limit = 77, 0, 5, 33
    cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.adaptive_min_samples = True, 0.0625, 40
    cycles.sample_clamp_direct, cycles.blur_glossy = 8.5, 0.25
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 9, 2, 3
    cycles.transmission_bounces, cycles.transparent_max_bounces, cycles.sample_clamp_indirect = 5, 6, 7.5
    cycles.volume_bounces = 4
    assert scene.relief.use_cycles_settings
    found, warnings = _exported(scene)
    expected = {
        "samples": 77,
        "noiseThreshold": 0.0625,
        "noiseMaths": "3.4" if bpy.app.version < (3, 5, 0) else "4.3",
        "minSamples": 40,
        "filterGlossy": 0.25,
        "clampDirect": 8.5,
        "maxBounces": 9,
        "diffuseBounces": 2,
        "glossyBounces": 3,
        "transmissionBounces": 5,
        "volumeBounces": 4,
        "transparentBounces": 6,
        "seed": 5,
        "clampIndirect": 7.5,
        "pixelFilter": {"type": "blackman-harris", "width": 3.0},
    }
    assert {key: found[key] for key in expected} == expected and not warnings, (found, warnings)
    assert "--time-limit 33" in " ".join(final.command_line(scene, scene.view_layers[0]))
    assert sampling_of(scene, scene.view_layers[0]).preview_samples == 16777216  # Cycles' 0 is no end
    cycles.adaptive_threshold = 0  # Cycles chooses
    assert _exported(scene)[0]["noiseThreshold"] == 1 / 77
    cycles.use_adaptive_sampling = False
    assert _exported(scene)[0]["noiseThreshold"] == 0


def test_cycles_checkbox_denoises():
    """Denoise of the scene and of the view layer are Cycles' own, until relief's settings are chosen; scripts have both in one."""
    from relief.export.settings import denoiser_of
    from relief.result import enabled_passes

    scene = _fresh_scene()
    layer, settings = scene.view_layers[0], scene.relief
    assert scene.cycles.use_denoising  # Blender's default

    def found():
        names = {p.name for p in enabled_passes(scene, layer)}
        assert ("Noisy Image" in names) == ("Denoised Error" in names) == (denoiser_of(scene, layer) != "none"), names
        return denoiser_of(scene, layer)

    assert found() == settings.denoise == "builtin"
    layer.cycles.use_denoising = False
    assert found() == "none"
    layer.cycles.use_denoising = True
    settings.denoise = "none"
    assert not scene.cycles.use_denoising and found() == "none" and settings.use_cycles_settings
    settings.denoise = "oidn"
    assert scene.cycles.use_denoising and found() == "oidn" and settings.use_cycles_settings
    settings.use_cycles_settings = False
    assert found() == settings.denoise == "none"
    settings.denoise = "builtin"
    assert settings.use_denoising and found() == "builtin"


def test_animated_seeds_differ_from_frame_to_frame():
    scene = _fresh_scene()
    scene.cycles.use_animated_seed = True
    seeds = set()
    for frame in range(1, 6):
        scene.frame_set(frame)
        seeds.add(_exported(scene)[0]["seed"])
    assert len(seeds) == 5, seeds


def test_what_changes_cycles_picture_alone_is_warned_about():
    from relief.export.settings import warn_unread_settings

    def said():
        texts = []
        warn_unread_settings(scene, lambda *text: texts.append("; ".join(text)))
        return texts

    scene = _fresh_scene()
    scene.relief.use_cycles_settings = True
    cycles, lamp, ball = scene.cycles, add_light("POINT"), add_sphere()
    set_world((1, 1, 1))
    for owner, name, value, text in (
        (cycles, "use_fast_gi", True, "Fast GI"),
        (lamp.data.cycles, "max_bounces", 1, f'light "{lamp.data.name}"'),
        (scene.world.cycles, "max_bounces", 1, "the world"),
    ):
        assert not said(), said()
        before = getattr(owner, name)
        setattr(owner, name, value)
        assert len(said()) == 1 and text in said()[0], (name, said())
        setattr(owner, name, before)
    ball.cycles.use_camera_cull = cycles.use_camera_cull = True
    assert not said(), said()  # Simplify is off
    scene.render.use_simplify = True
    assert len(said()) == 1, said()
    if hasattr(cycles, "texture_resolution_render"):
        cycles.texture_resolution_render = 0.25
    else:
        cycles.texture_limit_render = "256"
    assert len(said()) == 2 and "Camera Culling" in said()[0] and "limit of textures" in said()[1], said()


def test_all_of_cycles_panels_is_in_the_documentation():
    """Every property that Cycles shows for final renders under Sampling and Light Paths has its row in docs/blender.md."""
    import cycles.ui

    with open(cycles.ui.__file__, encoding="utf-8") as file:
        classes = re.split(r"^class ", file.read(), flags=re.MULTILINE)
    panels = [text for text in classes if re.match(r"CYCLES_RENDER_PT_(sampling|light_paths)(?!_viewport)", text)]
    shown = {name for text in panels for name in re.findall(r'\.prop\(\w+, "(\w+)"', text)}
    shown = {name for name in shown if not name.startswith(("guiding", "use_guiding", "preview_")) and "guiding" not in name}
    assert len(shown) > 30, shown
    docs = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(__file__))), "docs", "blender.md")
    with open(docs, encoding="utf-8") as file:
        told = set(re.findall(r"`(\w+)`", file.read()))
    assert not shown - told, shown - told


def test_another_sample_offset_has_other_samples():
    scene = _fresh_scene()
    seeds = []
    for offset in (0, 64, 128):
        scene.cycles.sample_offset = offset
        if hasattr(scene.cycles, "use_sample_subset"):
            scene.cycles.use_sample_subset = offset > 0
            scene.cycles.sample_subset_length, scene.cycles.samples = 48, 256
        found = _exported(scene)[0]
        seeds.append(found["seed"])
        assert found["samples"] == (48 if offset and hasattr(scene.cycles, "use_sample_subset") else scene.cycles.samples)
    assert seeds[0] == scene.cycles.seed and len(set(seeds)) == 3, seeds


def test_threads_are_blenders_own():
    from relief import final

    scene = _fresh_scene()
    layer = scene.view_layers[0]
    assert "--threads" not in final.command_line(scene, layer)
    scene.render.threads_mode, scene.render.threads = "FIXED", 3
    assert "--threads 3" in " ".join(final.command_line(scene, layer))
    scene.relief.threads = 2
    assert "--threads 2" in " ".join(final.command_line(scene, layer))


def test_the_status_line_has_what_cycles_has():
    from relief.final import status

    progress = {"fraction": 0.25, "samples": 16, "photons": 0, "seconds": 40.0, "seconds_left": 125.4}
    progress |= {"rays_per_second": 2.5e6, "memory_bytes": 3 << 20, "peak_memory_bytes": 5 << 20}
    text = status(progress, "Scene, ViewLayer", 64)
    assert text.split(" | ")[:2] == ["Remaining:02:05", "Mem:3M, Peak:5M"], text
    assert "Scene, ViewLayer | Sample 16/64" in text, text
    assert status({**progress, "seconds_left": 3725}, "", 64).startswith("Remaining:1:02:05")
    assert "Remaining" not in status({**progress, "fraction": 0}, "", 64)  # nothing tells yet


def test_own_settings_are_kept():
    """What files and scripts have set before there was a choice counts, also after saving and loading."""
    scene = _fresh_scene()
    scene.relief.samples = 21
    assert not scene.relief.use_cycles_settings
    assert _exported(scene)[0]["samples"] == 21
    with folder() as path:
        bpy.ops.wm.save_as_mainfile(filepath=f"{path}/scene.blend")
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.wm.open_mainfile(filepath=f"{path}/scene.blend")
        scene = bpy.context.scene
        assert not scene.relief.use_cycles_settings
        found = _exported(scene)[0]
        assert found["samples"] == 21 and found["maxBounces"] == 12 and found["clampIndirect"] == 0, found
        scene.relief.use_cycles_settings = True  # a choice outweighs them, whatever comes later
        scene.relief.max_bounces = 3
        scene.cycles.samples = 34
        bpy.ops.wm.save_as_mainfile(filepath=f"{path}/scene.blend")
        bpy.ops.wm.open_mainfile(filepath=f"{path}/scene.blend")
        scene = bpy.context.scene
        assert scene.relief.use_cycles_settings
        found = _exported(scene)[0]
        assert found["samples"] == 34 and found["maxBounces"] == scene.cycles.max_bounces, found
        scene.relief.use_cycles_settings = False
        assert _exported(scene)[0]["maxBounces"] == 3


def test_without_cycles_relief_has_its_own():
    scene = _fresh_scene()
    bpy.ops.preferences.addon_disable(module="cycles")
    assert not hasattr(scene, "cycles")
    assert _exported(scene)[0]["samples"] == 128


def test_properties_are_as_the_program_declares_them():
    """What relief info --settings says of those that the add-on offers: words, limits, defaults and tooltips."""
    shown = subprocess.run([os.environ["RELIEF_BINARY"], "info", "--settings"], capture_output=True, check=True)
    declared = {setting["name"]: setting for setting in json.loads(shown.stdout)}
    properties = _fresh_scene().relief.bl_rna.properties
    for name, of_the_format in {
        "samples": "samples",
        "seed": "seed",
        "noise_threshold": "noiseThreshold",
        "max_bounces": "maxBounces",
        "diffuse_bounces": "diffuseBounces",
        "glossy_bounces": "glossyBounces",
        "transmission_bounces": "transmissionBounces",
        "volume_bounces": "volumeBounces",
        "transparent_bounces": "transparentBounces",
        "min_samples": "minSamples",
        "filter_glossy": "filterGlossy",
        "clamp_direct": "clampDirect",
        "clamp_indirect": "clampIndirect",
        "caustics": "caustics.mode",
        "caustic_kinds": "caustics.kinds",
        "filter_type": "pixelFilter.type",
        "filter_width": "pixelFilter.width",
    }.items():
        found, expected = properties[name], declared[of_the_format]
        assert found.description.startswith(expected["description"] + " (default "), found.description
        assert name == "samples" or found.default == expected["default"], name
        if expected["type"] == "choice":
            assert set(found.enum_items.keys()) == set(expected["range"]), name
            continue
        low, high = expected["range"]
        assert abs(found.hard_min - low) <= 1e-6 * abs(low), (name, found.hard_min)
        # Blender's properties are of 32 bits.
        assert high is None or abs(found.hard_max - min(high, 2**31 - 1)) <= 1e-6 * high, (name, found.hard_max)


def test_pixel_filters_are_as_wide_as_those_of_cycles():
    """The picture of a lit square before black, by each filter: its edge is as soft as that of Cycles."""
    for kind, width in (("BLACKMAN_HARRIS", 1.5), ("BLACKMAN_HARRIS", 4.0), ("GAUSSIAN", 3.0), ("BOX", 5.0)):
        scene = _fresh_scene()
        for shown in list(scene.objects):
            bpy.data.objects.remove(shown)
        set_world((0, 0, 0))
        glow = bpy.data.materials.new("glow")
        glow.use_nodes = True
        glow.node_tree.nodes.clear()
        emission = glow.node_tree.nodes.new("ShaderNodeEmission")
        output = glow.node_tree.nodes.new("ShaderNodeOutputMaterial")
        glow.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
        add_plane(3, glow)
        add_camera()
        scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = 1024, False, False
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width
        pictures = []
        with folder() as path:
            for engine in ("RELIEF", "CYCLES"):
                scene.render.engine, scene.render.filepath = engine, os.path.join(path, "picture.exr")
                bpy.ops.render.render(write_still=True)
                pictures.append(read_rgb(scene.render.filepath)[..., 0])
        relief, cycles = pictures
        difference = np.abs(relief - cycles).max()
        print(kind, width, difference)
        # A width that is wrong by a fifth shows as 0.04.
        assert difference < 0.015, (kind, width, difference)
        assert relief.max() > 0.99


def test_cycles_defaults_end_at_the_noise_threshold():
    """Of the 4,096 samples that Cycles would take at most, a plain scene needs few; its error is about the threshold."""
    scene = _fresh_scene()
    scene.render.engine = "RELIEF"
    scene.cycles.use_denoising = False
    with folder() as path:
        scene.render.filepath = f"{path}/picture.exr"
        bpy.ops.render.render(write_still=True)
        picture = read_rgb(scene.render.filepath)
        with open(scene.render.filepath, "rb") as file:
            assert b"noise_threshold" in file.read(20000)
        scene.cycles.use_adaptive_sampling, scene.cycles.samples, scene.cycles.seed = False, 8192, 1
        bpy.ops.render.render(write_still=True)
        reference = read_rgb(scene.render.filepath)
    error = np.sqrt(((picture - reference) ** 2).mean()) / reference.mean()
    print("relative error", error)
    assert error < 0.015, error
