# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.relief and Blender's own render settings as RELIEF_render."""


def render_settings(scene, size):
    """Value of RELIEF_render.

    @param  scene  bpy scene
    @param  size   (width, height) of the whole picture in pixels
    """
    settings = scene.relief
    return {
        "resolution": list(size),
        "samples": settings.samples,
        "noiseThreshold": settings.noise_threshold,
        "maxBounces": settings.max_bounces,
        "diffuseBounces": min(settings.diffuse_bounces, settings.max_bounces),
        "glossyBounces": min(settings.glossy_bounces, settings.max_bounces),
        "transmissionBounces": min(settings.transmission_bounces, settings.max_bounces),
        "transparentBounces": settings.transparent_bounces,
        "seed": settings.seed,
        "exposure": scene.view_settings.exposure,
        "clampIndirect": settings.clamp_indirect,
        "pixelFilter": {"type": settings.filter_type, "width": settings.filter_width},
        "caustics": {"mode": settings.caustics},
        "frameRange": [scene.frame_start, scene.frame_end],
        "fps": scene.render.fps / scene.render.fps_base,
    }
