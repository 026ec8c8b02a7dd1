# SPDX-License-Identifier: GPL-3.0-or-later
"""The program's picture as Blender's render result: which layers to ask for, and where they go."""

from dataclasses import dataclass
from typing import Callable

import numpy as np

from . import compat, cryptomatte
from .export.axes import blender_from_gltf
from .export.settings import denoiser_of

#: What Blender's depth pass holds where nothing was hit.
_FAR = 1e10


@dataclass(frozen=True)
class Pass:
    """One render pass.

    name      this Blender's (see compat.pass_name), or our own
    setting   property that switches it on
    owner     whose property: "" for the view layer, or "relief" or "cycles" of it
    is_own    our own passes, and those that Cycles adds, have to be registered and added; Blender makes the others itself
    aov       layers of the program's picture, separated by commas
    channels  names of channels there
    ids       Blender's channel names; small ones where they are no colours: of those Blender keeps 32 bits in files of 16,
              and DWA loses nothing
    kind      'COLOR', 'VECTOR' or 'VALUE'
    convert   from float32 (pixels, channels) and coverage (pixels,) to what Blender wants
    """

    name: str
    setting: str
    is_own: bool
    aov: str
    channels: tuple
    ids: str
    kind: str
    convert: Callable = lambda values, coverage: values
    owner: str = ""

    def is_enabled(self, view_layer):
        holder = getattr(view_layer, self.owner, None) if self.owner else view_layer
        return getattr(holder, self.setting, False)


def _rgb(layer):
    return tuple(f"{layer}.{c}" for c in "RGB")


def _xyz(layer):
    return tuple(f"{layer}.{c}" for c in "XYZ")


def _with_zero(values, _):
    return np.concatenate([values, np.zeros((len(values), 1), dtype=np.float32)], axis=1)


def _is_met(values, coverage):
    """Where a layer has something: shadow catchers cover nothing where they are in no shadow. (pixels, 1)"""
    return (coverage > 0)[:, None] | (values != 0).any(axis=1, keepdims=True)


def _grey(values, _):
    return np.repeat(values, 3, axis=1)


def _without_color(values, _):
    """Light over the colour of what scatters it, as compositors multiply it by that again. Where a channel of the colour is 0, it
    has the mean of the others.
    @param  values  light and colour, (pixels, 6)
    """
    light, color = values[:, :3], values[:, 3:]
    is_colored = color != 0
    over = np.divide(light, color, out=np.zeros_like(light), where=is_colored)
    num_colored = is_colored.sum(axis=1, keepdims=True)
    mean = np.divide(over.sum(axis=1, keepdims=True), num_colored, out=np.zeros_like(over[:, :1]), where=num_colored > 0)
    return np.where(is_colored, over, mean)


def _light_passes():
    """Those that tell light apart by what the surface that is seen does to it."""
    for short, layer in (("Diff", "diffuse"), ("Gloss", "glossy"), ("Trans", "transmission")):
        color = f"{layer}_color"
        for part, way in (("Dir", "direct"), ("Ind", "indirect")):
            light = f"{layer}_{way}"
            yield Pass(compat.pass_name(short + part), f"use_pass_{light}", False, f"{light},{color}", _rgb(light) + _rgb(color),
                       "RGB", "COLOR", _without_color)
        yield Pass(compat.pass_name(short + "Col"), f"use_pass_{color}", False, color, _rgb(color), "RGB", "COLOR")


PASSES = (
    Pass("Depth", "use_pass_z", False, "depth", ("depth.Z",), "Z", "VALUE",
         lambda z, _: np.where(np.isfinite(z), z, np.float32(_FAR))),
    Pass("Mist", "use_pass_mist", False, "mist", ("mist.Z",), "Z", "VALUE"),
    Pass("Normal", "use_pass_normal", False, "normal", _xyz("normal"), "XYZ", "VECTOR",
         lambda n, _: blender_from_gltf(n)),
    Pass("Position", "use_pass_position", False, "position", _xyz("position"), "XYZ", "VECTOR",
         lambda p, _: blender_from_gltf(p)),
    Pass("UV", "use_pass_uv", False, "uv", ("uv.U", "uv.V"), "UVA", "VECTOR",
         lambda uv, coverage: _with_zero(uv * (1, -1) + (0, 1) * _is_met(uv, coverage), coverage)),
    *_light_passes(),
    Pass(compat.pass_name("Emit"), "use_pass_emit", False, "emission", _rgb("emission"), "RGB", "COLOR"),
    Pass(compat.pass_name("Env"), "use_pass_environment", False, "environment", _rgb("environment"), "RGB", "COLOR"),
    Pass(compat.pass_name("AO"), "use_pass_ambient_occlusion", False, "ambient_occlusion", ("ambient_occlusion.Y",), "RGB",
         "COLOR", _grey),
    Pass(compat.pass_name("VolumeDir"), "use_pass_volume_direct", True, "volume_direct", _rgb("volume_direct"), "RGB", "COLOR",
         owner="cycles"),
    Pass(compat.pass_name("VolumeInd"), "use_pass_volume_indirect", True, "volume_indirect", _rgb("volume_indirect"), "RGB",
         "COLOR", owner="cycles"),
    Pass("Shadow Catcher", "use_pass_shadow_catcher", True, "shadow_catcher", _rgb("shadow_catcher"), "RGB", "COLOR",
         owner="cycles"),
    Pass("Denoising Normal", "denoising_store_passes", True, "denoising_normal", _xyz("denoising_normal"), "XYZ", "VECTOR",
         owner="cycles"),
    Pass("Denoising Albedo", "denoising_store_passes", True, "denoising_albedo", _rgb("denoising_albedo"), "RGB", "COLOR",
         owner="cycles"),
    Pass("Denoising Depth", "denoising_store_passes", True, "denoising_depth", ("denoising_depth.Z",), "Z", "VALUE",
         owner="cycles"),
    Pass("Direct", "use_pass_direct", True, "direct", _rgb("direct"), "RGB", "COLOR", owner="relief"),
    Pass("Indirect", "use_pass_indirect", True, "indirect", _rgb("indirect"), "RGB", "COLOR", owner="relief"),
    Pass("Caustics", "use_pass_caustic", True, "caustic", _rgb("caustic"), "RGB", "COLOR", owner="relief"),
    Pass("Samples", "use_pass_samples", True, "samples", ("samples.N",), "X", "VALUE", owner="relief"),
    Pass("Variance", "use_pass_variance", True, "variance", _rgb("variance"), "rgb", "COLOR", owner="relief"),
    Pass("Displacement Steps", "use_pass_displacement_steps", True, "displacement_steps", ("displacement_steps.N",),
         "X", "VALUE", owner="relief"),
)  # fmt: skip

#: Passes that a picture has besides if it is denoised: the combined pass as it was rendered, under Cycles' name, and the
#: root mean square error that is left.
NOISY = Pass("Noisy Image", "", True, "", tuple("RGBA"), "RGBA", "COLOR")
_DENOISED = (NOISY, Pass("Denoised Error", "", True, "", _rgb("denoised_error"), "rgb", "COLOR"))

#: Cryptomattes that a view layer may ask for.
CRYPTOMATTES = ("object", "material", "asset")

#: Passes that a view layer cannot be without, or that are no part of a picture.
_NO_PASSES = {"use_pass_combined", "use_pass_cryptomatte_accurate"}


def enabled_passes(scene, view_layer):
    """Passes that a view layer of a scene asks for, besides the combined one."""
    passes = [p for p in PASSES if p.is_enabled(view_layer)]
    if denoiser_of(scene, view_layer) != "none":
        passes += _DENOISED
    for group in view_layer.lightgroups:
        passes.append(
            Pass(f"Combined_{group.name}", "", True, "light_groups", _rgb(f"light_group_{group.name}"), "RGB", "COLOR")
        )
    for kind in CRYPTOMATTES:
        setting = f"use_pass_cryptomatte_{kind}"
        if not getattr(view_layer, setting):
            continue
        for i in range((view_layer.pass_cryptomatte_depth + 1) // 2):
            name = f"Crypto{kind.capitalize()}{i:02d}"
            channels = tuple(f"{name}.{c}" for c in "rgba")
            passes.append(Pass(name, setting, True, f"crypto_{kind}", channels, "rgba", "COLOR"))
    return passes


def warn_missing_passes(view_layer, warnings):
    """Warns about passes that a view layer asks for and does not get."""
    known = {(p.owner, p.setting) for p in PASSES} | {("", f"use_pass_cryptomatte_{kind}") for kind in CRYPTOMATTES}
    where = f'view layer "{view_layer.name}"'
    for owner in ("", "cycles"):
        holder = getattr(view_layer, owner, None) if owner else view_layer
        if holder is None:
            continue
        for setting, rna in holder.bl_rna.properties.items():
            is_pass = setting.startswith("use_pass_") or setting.startswith("pass_debug_")
            if is_pass and setting not in _NO_PASSES and (owner, setting) not in known and getattr(holder, setting) is True:
                warnings.warn(where, f'the pass "{rna.name}"', "it is left empty")
    for item in view_layer.aovs:
        warnings.warn(where, f'the shader AOV "{item.name}"', "it has no pass")


def aov_list(passes, has_holdouts=False):
    """Value of --aov for some passes.

    @param  has_holdouts  the combined pass has holes that its coverage does not tell from the world
    """
    return ",".join(["beauty", *(p.aov for p in passes if p.aov), *(["holdout"] if has_holdouts else [])])


def combined(picture, is_transparent, is_noisy=False):
    """Blender's combined pass: float32 of shape (pixels, 4), bottom row first; denoised if the picture has been.

    @param  is_noisy        as it was rendered
    @param  is_transparent  whether the film shows nothing where nothing was hit; elsewhere alpha is one, but in holdouts
    """
    pixels = picture.layer("R", "G", "B", "A")
    denoised = None if is_noisy else picture.layer(*_rgb("denoised"))
    if denoised is not None:
        pixels[:, :3] = denoised
    if not is_transparent:
        holdout = picture.layer("holdout.A")
        pixels[:, 3] = 1.0 if holdout is None else 1.0 - holdout[:, 0]
    return pixels


def show(engine, picture, place, is_transparent):
    """Shows a picture that is not finished: its combined pass alone. Arguments as for fill."""
    result = engine.begin_result(0, 0, picture.width, picture.height, **place)
    compat.set_pixels(result.layers[0].passes["Combined"], combined(picture, is_transparent))
    engine.end_result(result)


def fill(engine, picture, place, passes, is_transparent, metadata):
    """Hands a picture to Blender.

    @param  engine      bpy.types.RenderEngine inside render()
    @param  picture     exr.Picture of the size that Blender expects
    @param  place       {"layer": name of the view layer, "view": name of the stereoscopic view}
    @param  metadata    texts by name, for the image's file
    """
    layer_name = place["layer"]
    for render_pass in passes:
        if render_pass.is_own:
            engine.add_pass(render_pass.name, len(render_pass.ids), render_pass.ids, layer=layer_name)
    result = engine.begin_result(0, 0, picture.width, picture.height, **place)
    layer = result.layers[0]
    compat.set_pixels(layer.passes["Combined"], combined(picture, is_transparent))
    coverage = picture.channels["A"].ravel()
    for render_pass in passes:
        if render_pass is NOISY:
            values = combined(picture, is_transparent, is_noisy=True)
        else:
            values = picture.layer(*render_pass.channels)
        target = layer.passes.get(render_pass.name)
        if values is not None and target is not None:
            converted = render_pass.convert(values, coverage)
            compat.set_pixels(target, np.ascontiguousarray(converted, dtype=np.float32))
    engine.end_result(result)
    # Of what begin_result gives, Blender takes over the pixels alone.
    whole = engine.get_result()
    for name, text in {**metadata, **cryptomatte.metadata(picture.attributes, layer_name)}.items():
        whole.stamp_data_add_field(name, text)
