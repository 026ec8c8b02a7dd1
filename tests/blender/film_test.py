"""View layers and film: holdouts, what the camera alone does not see, overrides, exposure."""

import os

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    folder,
    new_material,
    new_scene,
    render,
    render_runs,
    set_bounces,
    set_file_format,
    set_world,
)


def _stage():
    """A floor, and a ball in a collection of its own, which is returned as the view layer has it."""
    scene = new_scene()
    add_plane(6, diffuse((0.8, 0.5, 0.3)))
    ball = add_sphere(0.8, diffuse((0.2, 0.7, 0.4)), (0.2, 0.2, 0.8))
    collection = bpy.data.collections.new("ball")
    scene.collection.children.link(collection)
    for owner in ball.users_collection:
        owner.objects.unlink(ball)
    collection.objects.link(ball)
    set_world((0.3, 0.4, 0.5))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0)
    add_camera((0, -6, 4), degrees(58, 0, 0), lens=40)
    set_bounces(scene, 2)
    return scene, scene.view_layers[0].layer_collection.children["ball"]


def _alpha(scene, engine):
    """Alpha of a picture: (height, width)."""
    from relief import exr

    settings = scene.render.image_settings
    settings.color_mode, settings.exr_codec = "RGBA", "NONE"
    with folder() as path:
        name = os.path.join(path, "picture.exr")
        render(scene, engine, name, samples=64)
        return exr.read(name).channels["A"]


def _assert_same_alpha(scene):
    for is_transparent in (False, True):
        scene.render.film_transparent = is_transparent
        relief, cycles = _alpha(scene, "RELIEF"), _alpha(scene, "CYCLES")
        assert np.abs(relief - cycles).max() < 0.25 and abs(relief.mean() - cycles.mean()) < 0.005, is_transparent
        assert relief.min() < 0.01 < 0.99 < relief.max()


def test_collection_holdout():
    """A hole in the picture, which still casts its shadow and colours its surroundings."""
    scene, collection = _stage()
    collection.holdout = True
    assert_agrees(scene, samples=16)
    _assert_same_alpha(scene)


def test_object_holdout():
    scene, _ = _stage()
    next(o for o in scene.objects if o.name.startswith("Sphere")).is_holdout = True
    assert_agrees(scene, samples=16)


def test_holdouts_of_materials():
    """Alpha was 1 in the holes that a Holdout node makes, unless the film was transparent."""
    for share in (1.0, 0.4):
        scene, collection = _stage()
        material, tree, node = new_material("hole", "ShaderNodeMixShader", Fac=share)
        held, shown = tree.nodes.new("ShaderNodeHoldout"), tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(shown.outputs[0], node.inputs[1])
        tree.links.new(held.outputs[0], node.inputs[2])
        collection.collection.objects[0].data.materials[0] = material
        assert_agrees(scene, samples=16)
        for is_transparent in (False, True):
            scene.render.film_transparent = is_transparent
            relief, cycles = _alpha(scene, "RELIEF"), _alpha(scene, "CYCLES")
            assert abs(relief.mean() - cycles.mean()) < 0.005 < 1 - cycles.mean(), (share, is_transparent, relief.mean(), cycles.mean())


def test_collection_indirect_only():
    scene, collection = _stage()
    collection.indirect_only = True
    assert_agrees(scene, samples=16)


def test_an_instance_is_held_out_with_what_makes_it():
    """Two instances of a collection, of which one is a hole."""
    scene, collection = _stage()
    collection.exclude = True
    held = bpy.data.collections.new("held")
    scene.collection.children.link(held)
    for place, owner in ((-1.2, scene.collection), (1.2, held)):
        empty = bpy.data.objects.new("empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["ball"]
        empty.location = (place, 0, 0)
        owner.objects.link(empty)
    scene.view_layers[0].layer_collection.children["held"].holdout = True
    assert_agrees(scene, samples=16)


def test_material_override():
    """Of all slots, and of objects without a material."""
    scene, _ = _stage()
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(-1.5, 0, 0.3))
    scene.view_layers[0].material_override = diffuse((0.9, 0.2, 0.6), "override")
    assert_agrees(scene, samples=16)


def _glass_stage(roughness, threshold):
    """Balls of smooth and of rougher glass, a coloured filter and a ball behind, before nothing."""
    scene = new_scene()
    scene.render.film_transparent = True
    scene.cycles.film_transparent_glass = True
    scene.cycles.film_transparent_roughness = threshold
    for x, rough in ((-1.0, 0.0), (1.0, roughness)):
        glass = new_material("glass", "ShaderNodeBsdfGlass", IOR=1.3, Roughness=rough, Color=(0.9, 0.8, 0.7, 1))[0]
        add_sphere(0.7, glass, (x, 0, 0.8))
    add_sphere(0.4, diffuse((0.8, 0.5, 0.3)), (0.6, 2.0, 0.8))
    held = add_sphere(0.4, diffuse((0.8, 0.5, 0.3)), (-0.6, 2.0, 0.8))
    held.is_holdout = True
    add_plane(1.0, new_material("filter", "ShaderNodeBsdfTransparent", Color=(0.5, 0.3, 0.2, 1))[0], (0, -1, 1.7)).rotation_euler = degrees(80, 0, 0)
    set_world((0.3, 0.4, 0.5))
    add_light("POINT", (2, -3, 3), energy=200)
    add_camera((0, -6, 1), degrees(90, 0, 0), lens=50)
    set_bounces(scene, 6)
    return scene


def test_transparent_glass():
    """Glass up to a roughness is as clear as the film behind it, rougher glass is not, and filters are by their colour."""
    # The first is the darker, and so the noisier one.
    for roughness, threshold, samples in ((0.2, 0.3, 640), (0.3, 0.1, 160)):
        scene = _glass_stage(roughness, threshold)
        assert_agrees(scene, samples=samples, least_mean=0.005, tolerance=0.03)
        relief, cycles = _alpha(scene, "RELIEF"), _alpha(scene, "CYCLES")
        assert abs(relief.mean() - cycles.mean()) < 0.004, (relief.mean(), cycles.mean())
        blocks = [a[:48, :64].reshape(6, 8, 8, 8).mean(axis=(1, 3)) for a in (relief, cycles)]
        assert np.abs(blocks[0] - blocks[1]).max() < 0.05
        scene.cycles.film_transparent_glass = False
        assert _alpha(scene, "RELIEF").mean() > relief.mean() + 0.02


def test_media_cover_a_transparent_film():
    """By what they do not let through: even ones and such that vary, before nothing and before a floor."""
    scene = new_scene()
    scene.render.film_transparent = True
    scene.cycles.volume_step_rate = 0.2
    add_plane(3, diffuse((0.8, 0.5, 0.3)))
    for x, is_even in ((-1.0, True), (1.0, False)):
        material, tree, node = new_material("smoke", "ShaderNodeVolumePrincipled", Density=1.5)
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        tree.links.remove(output.inputs["Surface"].links[0])
        tree.links.new(node.outputs[0], output.inputs["Volume"])
        if not is_even:
            tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Fac"], node.inputs["Density"])
        add_sphere(0.8, material, (x, 0, 0.9))
    set_world((0.3, 0.4, 0.5))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2)
    add_camera((0, -6, 1.5), degrees(85, 0, 0), lens=50)
    set_bounces(scene, 1)
    relief, cycles = _alpha(scene, "RELIEF"), _alpha(scene, "CYCLES")
    assert abs(relief.mean() - cycles.mean()) < 0.004, (relief.mean(), cycles.mean())
    blocks = [a[:48, :64].reshape(6, 8, 8, 8).mean(axis=(1, 3)) for a in (relief, cycles)]
    assert np.abs(blocks[0] - blocks[1]).max() < 0.03, np.abs(blocks[0] - blocks[1]).max()


def test_holdouts_are_black():
    """Closures of an object that is held out left their light where alpha is 0."""
    from relief import exr

    scene, _ = _stage()
    scene.render.film_transparent = True
    ball = next(o for o in scene.objects if o.name.startswith("Sphere"))
    material, tree, node = new_material("shiny", "ShaderNodeBsdfGlossy", Roughness=0.4)
    ball.data.materials[0] = material
    ball.is_holdout = True
    scene.render.image_settings.color_mode, scene.render.image_settings.exr_codec = "RGBA", "NONE"
    with folder() as path:
        name = os.path.join(path, "picture.exr")
        render(scene, "RELIEF", name, samples=16)
        channels = exr.read(name).channels
    hole = channels["A"] == 0
    assert hole.any()
    assert max(channels[c][hole].max() for c in "RGB") == 0
    assert_agrees(scene, samples=16)


def test_film_exposure():
    scene, _ = _stage()
    scene.cycles.film_exposure = 2.5
    assert_agrees(scene, samples=16)


def test_film_exposure_of_passes():
    """All that is light is multiplied, its variance twice, and nothing else."""
    from relief import exr

    scene, _ = _stage()
    layer = scene.view_layers[0]
    for name in ("direct", "indirect", "variance", "samples"):
        setattr(layer.relief, f"use_pass_{name}", True)
    layer.use_pass_diffuse_color = layer.use_pass_environment = True
    set_file_format("OPEN_EXR_MULTILAYER", "32")
    scene.render.engine, scene.relief.samples = "RELIEF", 16
    pictures = []
    with folder() as path:
        scene.render.filepath = os.path.join(path, "picture.exr")
        for scene.cycles.film_exposure in (1.0, 4.0):
            bpy.ops.render.render(write_still=True)
            pictures.append(exr.read(scene.render.filepath).channels)
    for name, first in pictures[0].items():
        layer_name = name.split(".")[-2]
        factor = {"Variance": 16, "Samples": 1, "DiffCol": 1, "Diffuse Color": 1}.get(layer_name, 4)
        factor = 1 if name.endswith(".A") else factor
        assert np.allclose(factor * first, pictures[1][name], rtol=1e-5, atol=1e-7), name


def test_freestyle_lines():
    """By relief itself, as Cycles has them: Eevee's would need OpenGL."""
    from relief import report

    scene, _ = _stage()
    scene.render.line_thickness_mode, scene.render.line_thickness = "ABSOLUTE", 3.0
    without = render_runs(scene, "CYCLES", 1, 16)[0]
    scene.render.use_freestyle = True
    lines = scene.view_layers[0].freestyle_settings.linesets
    (lines[0] if lines else lines.new("lines")).linestyle = bpy.data.linestyles.new("line")
    report.last_warnings.clear()
    relief, cycles = (render_runs(scene, engine, 1, 64)[0] for engine in ("RELIEF", "CYCLES"))
    assert len(report.last_warnings) == 2, "the scene of the lines was rendered by another engine"
    drawn = np.abs(cycles - without).max(axis=-1) > 0.1
    assert drawn.mean() > 0.01, "there are no lines"
    assert np.abs(relief - cycles)[drawn].mean() < 0.02, np.abs(relief - cycles)[drawn].mean()
    assert relief[drawn].mean() < 0.7 * without[drawn].mean(), "lines are black"
