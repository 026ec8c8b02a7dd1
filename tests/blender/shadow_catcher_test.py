"""Shadow catchers: alpha, background and pass beside Cycles."""

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
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _stage():
    """A coloured ball on a floor that catches its shadow, under a sun, a lamp and a world."""
    scene = new_scene()
    scene.render.film_transparent = True
    floor = add_plane(4, diffuse((0.6, 0.5, 0.4)))
    floor.is_shadow_catcher = True
    ball = add_sphere(0.7, diffuse((0.9, 0.15, 0.1)), (0.2, 0.1, 0.7))
    set_world((0.3, 0.4, 0.5))
    add_light("SUN", rotation=degrees(35, 30, 0), energy=1.5, angle=0.2)
    add_light("POINT", (-1.5, -1.5, 2.5), energy=150, shadow_soft_size=0.3)
    add_camera((0, -6, 4), degrees(58, 0, 0), lens=45)
    set_bounces(scene, 3)
    return scene, floor, ball


def _picture(scene, engine, layers, samples):
    """(height, width, channels) of layers of the view layer's, one after the other; what shadow catchers leave is multiplied by what
    shows through the picture."""
    channels = {name.split(".", 1)[1]: values.astype(np.float64) for name, values in passes(scene, engine, samples).items()}
    clear = 1 - channels["Combined.A"]
    return np.stack(
        [channels[f"{layer}.{c}"] * (clear if layer == "Shadow Catcher" else 1) for layer, ids in layers for c in ids], axis=-1
    )


def _assert_same(scene, layers=(("Combined", "RGBA"),), samples=256, block=4):
    """Fails unless both engines have the same means of blocks. Cycles' are off where an object's edge is in the same pixel as a
    catcher, by its own approximation.
    @return  relief's picture
    """
    relief, cycles = (_picture(scene, engine, layers, samples) for engine in ("RELIEF", "CYCLES"))
    assert np.isfinite(relief).all()
    height, width = (side // block * block for side in relief.shape[:2])
    shape = (height // block, block, width // block, block, -1)
    blocks = [p[:height, :width].reshape(shape).mean(axis=(1, 3)) for p in (relief, cycles)]
    off = np.abs(blocks[0] - blocks[1])
    print("greatest difference of a block", off.max(axis=(0, 1)), "of the mean", np.abs(relief.mean((0, 1)) - cycles.mean((0, 1))))
    assert (off < 0.05 * np.maximum(blocks[1], 1)).all() and np.abs(relief.mean((0, 1)) - cycles.mean((0, 1))).max() < 0.004
    return relief


def test_before_nothing_and_before_the_world():
    scene, _, _ = _stage()
    clear = _assert_same(scene)
    alpha, is_black = clear[..., 3], (clear[..., :3] == 0).all(axis=-1)
    assert alpha.max() == 1 and (is_black & (alpha > 0.2)).sum() > 50, "there is no shadow"
    assert is_black.mean() > 0.6, "the floor is seen"
    scene.render.film_transparent = False
    shown = _assert_same(scene)
    assert (shown[..., 3] == 1).all() and np.allclose(shown[0, 0, :3], (0.3, 0.4, 0.5), atol=0.02)


def test_its_pass_has_the_colour_of_bounced_light():
    """And the combined pass is without the shadow then, whatever the film is."""
    scene, _, _ = _stage()
    scene.view_layers[0].cycles.use_pass_shadow_catcher = True
    for scene.render.film_transparent in (True, False):
        both = _assert_same(scene, (("Combined", "RGBA"), ("Shadow Catcher", "RGB")))
        catcher = both[..., 4:]
        # Next to the ball there is more red than without it, but less of the others.
        assert (catcher[..., 0] - catcher[..., 2]).max() > 0.05
        assert (both[..., 3] == 0).mean() > 0.2, "the catcher covers nothing"


def test_glass_and_mirrors():
    """A catcher behind clear glass catches; one in a mirror is an object."""
    scene, _, ball = _stage()
    for lamp in [item for item in scene.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    scene.cycles.film_transparent_glass = True
    ball.data.materials[0] = new_material("glass", "ShaderNodeBsdfGlass", IOR=1.02, Roughness=0.0)[0]
    mirror = add_plane(1.5, new_material("mirror", "ShaderNodeBsdfGlossy", Roughness=0.0)[0], (-1.2, 1.2, 0.75))
    mirror.rotation_euler = degrees(90, 0, 30)
    _assert_same(scene)


def test_lamps_and_meshes_that_are_not_of_the_footage():
    scene, floor, ball = _stage()
    scene.view_layers[0].cycles.use_pass_shadow_catcher = True
    lamp = next(o for o in scene.objects if o.type == "LIGHT" and o.data.type == "POINT")
    lamp.is_shadow_catcher = False
    ball.data.materials[0] = new_material("glow", "ShaderNodeEmission", Strength=0.6)[0]
    both = _assert_same(scene, (("Combined", "RGBA"), ("Shadow Catcher", "RGB")))
    assert both[..., 4:].max() > 1.5, "the lamp does not brighten"


def test_instances_catch_if_what_makes_them_does():
    scene, floor, _ = _stage()
    collection = bpy.data.collections.new("floor")
    for owner in floor.users_collection:
        owner.objects.unlink(floor)
    collection.objects.link(floor)
    empty = bpy.data.objects.new("empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    scene.collection.objects.link(empty)
    floor.is_shadow_catcher = False
    for empty.is_shadow_catcher in (False, True):
        picture = _picture(scene, "RELIEF", (("Combined", "A"),), 4)
        assert (picture == 0).mean() > 0.3 if empty.is_shadow_catcher else (picture > 0.9).mean() > 0.3
