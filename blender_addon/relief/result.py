# SPDX-License-Identifier: GPL-3.0-or-later
"""The program's picture as Blender's render result: which layers to ask for, and where they go."""

from dataclasses import dataclass
from typing import Callable

import numpy as np

from . import compat
from .export.axes import blender_from_gltf

#: What Blender's depth pass holds where nothing was hit.
_FAR = 1e10


@dataclass(frozen=True)
class Pass:
    """One render pass.

    name      Blender's, or our own
    setting   property that switches it on: of the view layer, or of view_layer.relief
    is_own    our own passes have to be registered and added; Blender makes the others itself
    aov       layer of the program's picture
    channels  names of channels there
    ids       Blender's channel names
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


def _rgb(layer):
    return tuple(f"{layer}.{c}" for c in "RGB")


def _xyz(layer):
    return tuple(f"{layer}.{c}" for c in "XYZ")


def _with_zero(values, _):
    return np.concatenate([values, np.zeros((len(values), 1), dtype=np.float32)], axis=1)


PASSES = (
    Pass("Depth", "use_pass_z", False, "depth", ("depth.Z",), "Z", "VALUE",
         lambda z, coverage: np.where(coverage[:, None] > 0, z, np.float32(_FAR))),
    Pass("Normal", "use_pass_normal", False, "normal", _xyz("normal"), "XYZ", "VECTOR",
         lambda n, _: blender_from_gltf(n)),
    Pass("Position", "use_pass_position", False, "position", _xyz("position"), "XYZ", "VECTOR",
         lambda p, _: blender_from_gltf(p)),
    Pass("UV", "use_pass_uv", False, "uv", ("uv.U", "uv.V"), "UVA", "VECTOR",
         lambda uv, coverage: _with_zero(uv * (1, -1) + (0, 1) * (coverage[:, None] > 0), coverage)),
    Pass("DiffCol", "use_pass_diffuse_color", False, "albedo", _rgb("albedo"), "RGB", "COLOR"),
    Pass("Direct", "use_pass_direct", True, "direct", _rgb("direct"), "RGB", "COLOR"),
    Pass("Indirect", "use_pass_indirect", True, "indirect", _rgb("indirect"), "RGB", "COLOR"),
    Pass("Caustics", "use_pass_caustic", True, "caustic", _rgb("caustic"), "RGB", "COLOR"),
    Pass("Samples", "use_pass_samples", True, "samples", ("samples.N",), "X", "VALUE"),
    Pass("Variance", "use_pass_variance", True, "variance", _rgb("variance"), "RGB", "COLOR"),
    Pass("Displacement Steps", "use_pass_displacement_steps", True, "displacement_steps", ("displacement_steps.N",),
         "X", "VALUE"),
)  # fmt: skip


def enabled_passes(view_layer):
    """Passes that a view layer asks for, besides the combined one."""
    return [p for p in PASSES if getattr(view_layer.relief if p.is_own else view_layer, p.setting, False)]


def aov_list(passes):
    """Value of --aov for some passes."""
    return ",".join(["beauty", *(p.aov for p in passes)])


def combined(picture, is_transparent):
    """Blender's combined pass: float32 of shape (pixels, 4), bottom row first.

    @param  is_transparent  whether the film shows nothing where nothing was hit; elsewhere alpha is one
    """
    pixels = picture.layer("R", "G", "B", "A")
    if not is_transparent:
        pixels[:, 3] = 1.0
    return pixels


def fill(engine, picture, layer_name, passes, is_transparent, metadata):
    """Hands a picture to Blender.

    @param  engine      bpy.types.RenderEngine inside render()
    @param  picture     exr.Picture of the size that Blender expects
    @param  layer_name  view layer
    @param  metadata    texts by name, for the image's file
    """
    for render_pass in passes:
        if render_pass.is_own:
            engine.add_pass(render_pass.name, len(render_pass.ids), render_pass.ids, layer=layer_name)
    result = engine.begin_result(0, 0, picture.width, picture.height, layer=layer_name)
    layer = result.layers[0]
    compat.set_pixels(layer.passes["Combined"], combined(picture, is_transparent))
    coverage = picture.channels["A"].ravel()
    for render_pass in passes:
        values = picture.layer(*render_pass.channels)
        target = layer.passes.get(render_pass.name)
        if values is not None and target is not None:
            converted = render_pass.convert(values, coverage)
            compat.set_pixels(target, np.ascontiguousarray(converted, dtype=np.float32))
    engine.end_result(result)
    # Of what begin_result gives, Blender takes over the pixels alone.
    whole = engine.get_result()
    for name, text in metadata.items():
        whole.stamp_data_add_field(name, text)
