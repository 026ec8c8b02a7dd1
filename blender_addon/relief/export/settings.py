# SPDX-License-Identifier: GPL-3.0-or-later
"""What a picture is sampled by, from scene.relief or from scene.cycles, and all of it as RELIEF_render."""

import zlib
from dataclasses import dataclass, fields

from .. import compat

#: Cycles' pixel filters: relief's name, and what a width of Cycles' is multiplied by. Relief's widths are where filters end.
_FILTERS = {"BOX": ("box", 0.0), "BLACKMAN_HARRIS": ("blackman-harris", 2.0), "GAUSSIAN": ("gaussian", 3.0)}

#: The format's names of which caustics there are, by whether there are reflective and refractive ones.
_CAUSTIC_KINDS = {(True, True): "both", (True, False): "reflective", (False, True): "refractive", (False, False): "none"}

#: Cycles' 0, where it means no end.
_ENDLESS = 16777216

#: Cycles' least threshold of those that it chooses itself.
_LEAST_THRESHOLD = 0.001

#: The format's names of how mist thickens.
_MIST_FALLOFFS = {"LINEAR": "linear", "QUADRATIC": "quadratic", "INVERSE_QUADRATIC": "inverse-quadratic"}


@dataclass(frozen=True)
class Sampling:
    """Settings that Cycles has, too: as scene.relief's, which have these names."""

    samples: int
    preview_samples: int
    noise_threshold: float
    min_samples: int
    time_limit: float
    use_denoising: bool
    seed: int
    max_bounces: int
    diffuse_bounces: int
    glossy_bounces: int
    transmission_bounces: int
    volume_bounces: int
    transparent_bounces: int
    filter_glossy: float
    clamp_direct: float
    clamp_indirect: float
    filter_type: str
    filter_width: float
    caustic_kinds: str


#: Names of scene.relief's settings that Cycles has, too.
SHARED = tuple(field.name for field in fields(Sampling))


def cycles_settings(scene):
    """Cycles' settings of a scene if they are to be used; None if the artist wants others, or Cycles is switched off."""
    return getattr(scene, "cycles", None) if scene.relief.use_cycles_settings else None


def sampling_of(scene, view_layer):
    """Sampling of a scene's view layer in its current frame."""
    cycles = cycles_settings(scene)
    if cycles is None:
        own = {name: getattr(scene.relief, name) for name in SHARED}
        return Sampling(**{**own, "samples": view_layer.samples or own["samples"]})
    samples, share = _subset(cycles, _layer_samples(cycles, view_layer))
    threshold = 0.0
    if cycles.use_adaptive_sampling:
        threshold = share**0.5 * (cycles.adaptive_threshold or max(_LEAST_THRESHOLD, 1 / cycles.samples))
    filter_type, width_factor = _FILTERS[cycles.pixel_filter_type]
    return Sampling(
        samples=samples,
        preview_samples=cycles.preview_samples or _ENDLESS,
        noise_threshold=threshold,
        min_samples=cycles.adaptive_min_samples,
        time_limit=cycles.time_limit,
        use_denoising=cycles.use_denoising and view_layer.cycles.use_denoising,
        seed=_seed(cycles, scene.frame_current),
        max_bounces=cycles.max_bounces,
        diffuse_bounces=cycles.diffuse_bounces,
        glossy_bounces=cycles.glossy_bounces,
        transmission_bounces=cycles.transmission_bounces,
        volume_bounces=cycles.volume_bounces,
        transparent_bounces=cycles.transparent_max_bounces,
        filter_glossy=cycles.blur_glossy,
        clamp_direct=cycles.sample_clamp_direct,
        clamp_indirect=cycles.sample_clamp_indirect,
        filter_type=filter_type,
        filter_width=cycles.filter_width * width_factor or 1.0,
        caustic_kinds=_CAUSTIC_KINDS[cycles.caustics_reflective, cycles.caustics_refractive],
    )


def _layer_samples(cycles, view_layer):
    """Samples of a view layer: it may have a number of its own, and the scene may want that ignored or as a bound."""
    if view_layer.samples <= 0 or cycles.use_layer_samples == "IGNORE":
        return cycles.samples
    if cycles.use_layer_samples == "BOUNDED":
        return min(cycles.samples, view_layer.samples)
    return view_layer.samples


def _subset(cycles, samples):
    """(samples that are taken of as many, their share). Since 4.5 a part of them can be asked for, for several machines."""
    if not getattr(cycles, "use_sample_subset", False):
        return samples, 1.0
    taken = min(cycles.sample_subset_length, samples - cycles.sample_offset)
    return max(taken, 1), max(taken, 1) / samples


def _seed(cycles, frame):
    """A seed that tells nothing of those of other frames and of other offsets, whose samples Cycles takes in its stead."""
    offset = cycles.sample_offset if getattr(cycles, "use_sample_subset", True) else 0
    words = [cycles.seed, *([frame] if cycles.use_animated_seed else []), *(["offset", offset] if offset else [])]
    return cycles.seed if len(words) == 1 else zlib.crc32(" ".join(map(str, words)).encode()) >> 1


def denoiser_of(scene, view_layer):
    """Value of --denoise for the final render of a view layer."""
    return scene.relief.denoiser if sampling_of(scene, view_layer).use_denoising else "none"


def filters_glossy(scene):
    """Whether what unlikely paths see in mirrors and through glass is blurred."""
    cycles = cycles_settings(scene)
    return (scene.relief.filter_glossy if cycles is None else cycles.blur_glossy) > 0


def occlusion_distance(scene):
    """How far Ambient Occlusion nodes look whose own distance is 0, in metres: as far as the world says, without one any way."""
    return scene.world.light_settings.distance if scene.world is not None else 1e30


def warn_unread_settings(scene, warn):
    """Warns about those of Cycles' settings that change the picture, but not relief's.

    @param  warn  called with what is not understood, and what was used instead
    """
    cycles = cycles_settings(scene)
    if cycles is None:
        return
    if cycles.use_fast_gi:
        warn("Fast GI Approximation", "all bounces were traced")
    if scene.render.use_simplify:
        for name, label in (("use_camera_cull", "Camera Culling"), ("use_distance_cull", "Distance Culling")):
            if getattr(cycles, name) and any(getattr(getattr(o, "cycles", None), name, False) for o in scene.objects):
                warn(f"Simplify's {label}", "nothing was left out")
        limit, resolution = (getattr(cycles, f"texture_{name}_render", None) for name in ("limit", "resolution"))
        if limit not in (None, "OFF") or resolution not in (None, 1.0):
            warn("Simplify's limit of textures", "they have their full size")
    lit = {o.data.name: o.data for o in scene.objects if o.type == "LIGHT"}
    for name, light in lit.items():
        if light.cycles.max_bounces < cycles.max_bounces:
            warn(f'Max Bounces of light "{name}"', "it lights all bounces")
    world = scene.world.cycles if scene.world is not None else None
    if world is not None and world.max_bounces < cycles.max_bounces:
        warn("Max Bounces of the world", "it lights all bounces")
    if not getattr(world, "use_shadows", True):
        warn("a world without shadows", "it casts them")


def render_settings(scene, view_layer, size):
    """Value of RELIEF_render.

    @param  scene       bpy scene
    @param  view_layer  of the picture
    @param  size        (width, height) of the whole picture in pixels
    """
    sampling = sampling_of(scene, view_layer)
    return {
        **_pass_settings(compat.world_of(scene, view_layer), view_layer),
        "filmExposure": compat.film_exposure(scene),
        "resolution": list(size),
        "samples": sampling.samples,
        "noiseThreshold": sampling.noise_threshold,
        "noiseMaths": compat.NOISE_MATHS,
        "minSamples": sampling.min_samples,
        "maxBounces": sampling.max_bounces,
        "diffuseBounces": min(sampling.diffuse_bounces, sampling.max_bounces),
        "glossyBounces": min(sampling.glossy_bounces, sampling.max_bounces),
        "transmissionBounces": min(sampling.transmission_bounces, sampling.max_bounces),
        "volumeBounces": min(sampling.volume_bounces, sampling.max_bounces),
        "transparentBounces": sampling.transparent_bounces,
        "seed": sampling.seed,
        "exposure": scene.view_settings.exposure,
        "filterGlossy": sampling.filter_glossy,
        "clampDirect": sampling.clamp_direct,
        "clampIndirect": sampling.clamp_indirect,
        "pixelFilter": {"type": sampling.filter_type, "width": sampling.filter_width},
        "caustics": {"mode": scene.relief.caustics, "kinds": sampling.caustic_kinds},
        "frameRange": [scene.frame_start, scene.frame_end],
        "fps": scene.render.fps / scene.render.fps_base,
    }


def _pass_settings(world, view_layer):
    """What some passes ask for; {} without them."""
    out = {}
    if view_layer.use_pass_mist and world is not None:
        mist = world.mist_settings
        out["mist"] = {"start": mist.start, "depth": max(mist.depth, 1e-5), "falloff": _MIST_FALLOFFS[mist.falloff]}
    if view_layer.use_pass_ambient_occlusion and world is not None:
        out["occlusionDistance"] = world.light_settings.distance
    if any(getattr(view_layer, f"use_pass_cryptomatte_{kind}") for kind in ("object", "material", "asset")):
        out["cryptomatteLevels"] = view_layer.pass_cryptomatte_depth
    return out
