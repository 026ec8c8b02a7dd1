"""Light groups: the passes of lamps, meshes and worlds by their group, beside Cycles."""

import bpy
import numpy as np

from pass_test import passes
from scenes import add_camera, add_light, add_plane, add_sphere, degrees, diffuse, new_material, new_scene, set_bounces, set_world


def _stage():
    """A floor and two balls, one of which glows, under two lamps, a sun and a world."""
    scene = new_scene()
    add_plane(5, diffuse((0.6, 0.5, 0.4)))
    add_sphere(0.7, diffuse((0.9, 0.2, 0.1)), (0.9, 0.1, 0.7))
    glow = add_sphere(0.4, new_material("glow", "ShaderNodeEmission", Strength=2.0, Color=(0.2, 0.9, 0.4, 1))[0], (-0.9, 0, 0.4))
    set_world((0.3, 0.4, 0.5))
    sun = add_light("SUN", rotation=degrees(35, 30, 0), energy=1, angle=0.2)
    area = add_light("AREA", (0, 1.2, 1.5), degrees(-50, 0, 0), energy=40, size=1)
    point = add_light("POINT", (-1.5, -1.5, 2.5), energy=100, shadow_soft_size=0.3)
    add_camera((0, -6, 4), degrees(58, 0, 0), lens=35)
    set_bounces(scene, 3)
    for name in ("key", "rest 1"):
        bpy.ops.scene.view_layer_add_lightgroup(name=name)
    sun.lightgroup = glow.lightgroup = "key"
    area.lightgroup = scene.world.lightgroup = "rest 1"
    point.lightgroup = "not in this view layer"
    return scene


def test_groups_have_their_light():
    scene = _stage()
    prefix = scene.view_layers[0].name
    for scene.render.film_transparent in (False, True):
        relief, cycles = (passes(scene, engine, 256) for engine in ("RELIEF", "CYCLES"))
        assert not any("not in" in name for name in relief)
        for name in ("key", "rest 1"):
            layer = [np.stack([p[f"{prefix}.Combined_{name}.{c}"] for c in "RGB"], axis=-1).astype(np.float64) for p in (relief, cycles)]
            means = [picture.mean(axis=(0, 1)) for picture in layer]
            print(name, means)
            assert np.allclose(*means, rtol=0.01) and means[0].min() > 0.02
            blocks = [p[:48, :64].reshape(12, 4, 16, 4, 3).mean(axis=(1, 3)) for p in layer]
            assert np.allclose(*blocks, rtol=0.1, atol=0.02), np.abs(blocks[0] - blocks[1]).max()


def test_a_group_of_nothing_is_black():
    scene = _stage()
    bpy.ops.scene.view_layer_add_lightgroup(name="empty")
    relief = passes(scene, "RELIEF", 4)
    prefix = scene.view_layers[0].name
    assert (relief[f"{prefix}.Combined_empty.R"] == 0).all() and relief[f"{prefix}.Combined_key.R"].max() > 0.1
