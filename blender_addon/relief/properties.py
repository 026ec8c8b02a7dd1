# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.relief and view_layer.relief: the settings, each with its unit and default in the tooltip."""

import json
import os

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from .export.settings import SHARED, cycles_settings

# What `relief info --settings` says, by name, and `relief info --methods`.
with open(os.path.join(os.path.dirname(__file__), "declared.json"), encoding="utf-8") as _file:
    _program = json.load(_file)
_DECLARED = {setting["name"]: setting for setting in _program["settings"]}
_METHODS = tuple(
    (method["name"], method["title"], method["description"] + (" (default)" if method["name"] == "auto" else ""))
    for method in _program["methods"]
)

_DENOISERS = (
    ("builtin", "Built-in", "By what its two halves of samples, albedo, normals and depth tell (default)"),
    ("oidn", "Open Image Denoise", "Intel's denoiser, if it is installed on this machine"),
)

# Blender's whole numbers go no further.
_LARGEST_INT = 2**31 - 1


def _declared(name, **own):
    """Arguments of a property that is a setting of RELIEF_render: its default, range and tooltip.

    @param  own  Blender's own: another default, the items of a choice, and soft_max, up to where a slider makes sense
    """
    setting = _DECLARED[name]
    arguments = {"default": setting["default"], **own}
    if setting["type"] == "choice":
        shown = next(label for value, label, _ in own["items"] if value == arguments["default"])
    else:
        shown = f"{arguments['default']:g}"
        low, high = setting["range"]
        if low is not None:
            arguments["min"] = low
        if high is not None:
            arguments["max"] = min(high, _LARGEST_INT) if setting["type"] == "integer" else high
    return {**arguments, "description": f"{setting['description']} (default {shown})"}


def _uses_cycles_settings(settings):
    if settings.settings_source == "auto":
        return not any(settings.is_property_set(name) for name in SHARED)
    return settings.settings_source == "cycles"


def _denoise(settings):
    owner = cycles_settings(settings.id_data) or settings
    return 1 + settings.bl_rna.properties["denoiser"].enum_items.find(settings.denoiser) if owner.use_denoising else 0


def _set_denoise(settings, value):
    owner = cycles_settings(settings.id_data) or settings
    owner.use_denoising = value > 0
    if value > 0:
        settings.denoiser = _DENOISERS[value - 1][0]


def _use_cycles_settings(settings, value):
    settings.settings_source = "cycles" if value else "relief"


class ReliefSceneSettings(bpy.types.PropertyGroup):
    # Files and scripts that know nothing of Cycles' settings, but have set relief's, mean these.
    settings_source: EnumProperty(
        name="Settings",
        description="Whose settings of sampling, bounces, clamping and filter are used (default Automatic)",
        items=(
            ("auto", "Automatic", "Those of Cycles, unless one of relief's has been set (default)"),
            ("cycles", "Cycles", "The scene's settings for Cycles"),
            ("relief", "relief", "Settings of its own"),
        ),
        default="auto",
        options={"HIDDEN"},
    )
    use_cycles_settings: BoolProperty(
        name="Use Cycles Settings",
        description="Take samples, noise threshold, time limit, denoising, seed, bounces, clamping and pixel filter from "
        "the scene's settings for Cycles (default on, unless one of relief's own has been set)",
        get=_uses_cycles_settings,
        set=_use_cycles_settings,
    )
    samples: IntProperty(
        name="Samples",
        # Twice what a file has that says nothing: the first picture of an artist should not be noisy.
        **_declared("samples", default=128, soft_max=16777216),
    )
    preview_samples: IntProperty(
        name="Viewport Samples",
        description="Samples a pixel after which the viewport's picture is finished (default 256)",
        default=256,
        min=1,
        max=16777216,
    )
    seed: IntProperty(name="Seed", **_declared("seed"))
    time_limit: FloatProperty(
        name="Time Limit",
        description="Seconds of sampling after which no further pass is started; 0 is no limit (default 0)",
        default=0.0,
        min=0.0,
        unit="TIME_ABSOLUTE",
    )
    use_denoising: BoolProperty(
        name="Denoise",
        description="Take the noise out of the finished picture. The pass Noisy Image is the picture as it was rendered, "
        "Denoised Error what the denoised one may be off by (default off)",
        default=False,
    )
    denoiser: EnumProperty(
        name="Denoiser",
        description="What takes the noise out (default Built-in)",
        items=_DENOISERS,
        default="builtin",
    )
    denoise: EnumProperty(
        name="Denoise",
        description="Denoise and Denoiser in one, for scripts (default none)",
        items=(("none", "None", "The picture as it was rendered"), *_DENOISERS),
        get=_denoise,
        set=_set_denoise,
        options={"HIDDEN"},
    )
    noise_threshold: FloatProperty(name="Noise Threshold", precision=4, **_declared("noiseThreshold", soft_max=1.0))
    min_samples: IntProperty(name="Min Samples", **_declared("minSamples", soft_max=4096))
    max_bounces: IntProperty(name="Total", **_declared("maxBounces", soft_max=200))
    diffuse_bounces: IntProperty(name="Diffuse", **_declared("diffuseBounces", soft_max=200))
    glossy_bounces: IntProperty(name="Glossy", **_declared("glossyBounces", soft_max=200))
    transmission_bounces: IntProperty(name="Transmission", **_declared("transmissionBounces", soft_max=200))
    volume_bounces: IntProperty(name="Volume", **_declared("volumeBounces", soft_max=200))
    transparent_bounces: IntProperty(name="Transparent", **_declared("transparentBounces", soft_max=1024))
    filter_glossy: FloatProperty(name="Filter Glossy", **_declared("filterGlossy", soft_max=10.0))
    clamp_direct: FloatProperty(name="Clamp Direct", **_declared("clampDirect"))
    clamp_indirect: FloatProperty(name="Clamp Indirect", **_declared("clampIndirect"))
    caustics: EnumProperty(
        name="Caustics",
        **_declared(
            "caustics.mode",
            items=(
                ("auto", "Automatic", "Where something focuses the light of lamps, or of a world with a sun (default)"),
                ("on", "On", "Where something focuses light, even that of an evenly bright world"),
                ("off", "Off", "Never: it is path traced, with more noise"),
            ),
        ),
    )
    caustic_kinds: EnumProperty(
        name="Kinds of Caustics",
        **_declared(
            "caustics.kinds",
            items=(
                ("both", "Both", "Reflections and refractions (default)"),
                ("reflective", "Reflective", "Reflections alone"),
                ("refractive", "Refractive", "Refractions alone"),
                ("none", "None", "Neither"),
            ),
        ),
    )
    displacement_method: EnumProperty(
        name="Method",
        description="How displaced meshes are traced. All but the tessellating ones show the same surface (default "
        "Automatic)",
        items=_METHODS,
        default="auto",
    )
    lod: FloatProperty(
        name="Level of Detail",
        description="Level of all height maps: 0 is the map itself, each further one is averaged to half the size a "
        "side, between two both are mixed; -1 chooses what a pixel can show (default 0)",
        default=0.0,
        min=-1.0,
        max=16.0,
    )
    displacement_error: FloatProperty(
        name="Error",
        description="Pixels that detail of height maps may be wide and shown by its light alone, as Cycles' dicing "
        "rate, which is much faster; 0 is none. Where Cycles dices an object, in units of its dicing rate (default 1)",
        default=1.0,
        min=0.0,
        soft_max=8.0,
        max=1000.0,
    )
    cell_pixels: FloatProperty(
        name="Cell Size",
        description="How fine heights are computed that no map holds, as of noise over Generated coordinates: pixels "
        "from one to the next. Where Cycles dices an object, in units of its dicing rate (default 1)",
        default=1.0,
        min=0.01,
        soft_min=0.1,
        max=100.0,
    )
    bump_displaces: BoolProperty(
        name="Bump Displaces",
        description="Bump nodes with an image move the surface by their distance in metres, medium grey staying where "
        "it is, and so do Displacement nodes of materials set to Bump Only (default off)",
        default=False,
    )
    weld_seams: BoolProperty(
        name="Weld Seams",
        description="Close the gaps along texture seams whose sides are displaced differently, by walls (default on)",
        default=True,
    )
    memory_limit: FloatProperty(
        name="Memory",
        description="GiB that the automatic method may take for tessellating where that is faster; 0 is none, so that "
        "nothing is tessellated (default 0)",
        default=0.0,
        min=0.0,
        max=1024.0,
    )
    texture_memory: FloatProperty(
        name="Texture Memory",
        description="GiB of textures to keep in memory; what is more is read from its files when needed (default 4)",
        default=4.0,
        min=0.01,
        max=1024.0,
    )
    threads: IntProperty(
        name="Threads",
        description="Threads to use; 0 is what Blender's own setting says, one for each processor at first (default 0)",
        default=0,
        min=0,
        max=1024,
    )
    strict: BoolProperty(
        name="Strict",
        description="Make an error of each warning, so that nothing is left out in silence (default off)",
        default=False,
    )
    filter_type: EnumProperty(
        name="Filter",
        **_declared(
            "pixelFilter.type",
            items=(
                ("blackman-harris", "Blackman-Harris", "Smooth"),
                ("gaussian", "Gaussian", "Smooth, six standard deviations to either side"),
                ("box", "Box", "Equal weights"),
            ),
        ),
    )
    filter_width: FloatProperty(name="Filter Width", **_declared("pixelFilter.width", soft_max=10.0))


class ReliefViewLayerSettings(bpy.types.PropertyGroup):
    use_pass_direct: BoolProperty(
        name="Direct Light", description="Light after at most one scattering event (default off)", default=False
    )
    use_pass_indirect: BoolProperty(
        name="Indirect Light", description="Light after two or more scattering events (default off)", default=False
    )
    use_pass_samples: BoolProperty(
        name="Sample Count", description="Samples taken in each pixel (default off)", default=False
    )
    use_pass_variance: BoolProperty(
        name="Variance", description="Estimated variance of each pixel's radiance (default off)", default=False
    )
    use_pass_caustic: BoolProperty(
        name="Caustics", description="Light that photons brought, a part of indirect light (default off)", default=False
    )
    use_pass_displacement_steps: BoolProperty(
        name="Displacement Steps",
        description="Bounds and texels tested for a camera ray in displaced meshes (default off)",
        default=False,
    )


class ReliefObjectSettings(bpy.types.PropertyGroup):
    caustic_caster: EnumProperty(
        name="Casts Caustics",
        description="Whether photons are aimed at the object (default Automatic)",
        items=(
            ("auto", "Automatic", "If its material is glass or metal of a roughness of at most 0.5 (default)"),
            ("yes", "Yes", "Whatever its material is"),
            ("no", "No", "What it focuses is path traced"),
        ),
        default="auto",
    )
    caustic_receiver: BoolProperty(
        name="Receives Caustics",
        description="Photons show on the object; otherwise caustics on it are path traced (default on)",
        default=True,
    )
    caustic_light: BoolProperty(
        name="Lights Caustics",
        description="Photons start from the object's light; otherwise its caustics are path traced (default on)",
        default=True,
    )


class ReliefWorldSettings(bpy.types.PropertyGroup):
    caustic_light: BoolProperty(
        name="Lights Caustics",
        description="Photons may start from the world; otherwise its caustics are path traced (default on)",
        default=True,
    )


_classes = (ReliefSceneSettings, ReliefViewLayerSettings, ReliefObjectSettings, ReliefWorldSettings)


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.relief = PointerProperty(type=ReliefSceneSettings)
    bpy.types.ViewLayer.relief = PointerProperty(type=ReliefViewLayerSettings)
    bpy.types.Object.relief = PointerProperty(type=ReliefObjectSettings)
    bpy.types.World.relief = PointerProperty(type=ReliefWorldSettings)


def unregister():
    del bpy.types.World.relief
    del bpy.types.Object.relief
    del bpy.types.ViewLayer.relief
    del bpy.types.Scene.relief
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)
