"""Photons from Blender: a slab of glass under a sun has a known caustic, and objects and lights may stay out of it."""

import math
import os

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
    link,
    new_material,
    new_scene,
    set_bounces,
    set_file_format,
    set_world,
)

_ALBEDO = 0.02
_SUN = 5.0


def _slab():
    """A floor, a horizontal slab of glass above it, a sun at the zenith, a camera between the two looking down."""
    scene = new_scene(32, 32)
    set_bounces(scene, 8)
    set_world((0, 0, 0))
    add_plane(8, diffuse((_ALBEDO,) * 3))
    corners = [(x, y, z) for x in (-2, 2) for y in (-2, 2) for z in (1.5, 1.7)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = bpy.data.meshes.new("slab")
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(new_material("glass", "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5)[0])
    slab = link(mesh, "slab")
    sun = add_light("SUN", (0, 0, 5), energy=_SUN, angle=0)
    add_camera((0, 0, 1.2), lens=50)
    scene.view_layers[0].relief.use_pass_caustic = True
    return scene, slab, sun


def _caustic(scene):
    """Mean of the caustic pass."""
    from relief import exr

    scene.render.engine = "RELIEF"
    scene.relief.samples = 8
    set_file_format("OPEN_EXR_MULTILAYER", "32")
    with folder() as path:
        scene.render.filepath = os.path.join(path, "picture.exr")
        bpy.ops.render.render(write_still=True)
        channels = exr.read(scene.render.filepath).channels
    return float(np.mean([channels[f"{scene.view_layers[0].name}.Caustics.{c}"] for c in "RGB"]))


def _architects_pane(bits):
    """The slab's stage, whose glass lets rays of some kinds pass as if it were not there."""
    scene, slab, sun = _slab()
    material = slab.data.materials[0]
    tree = material.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    glass = output.inputs["Surface"].links[0].from_socket
    light_path, transparent, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "BsdfTransparent", "MixShader"))
    factor = None
    for bit in bits:
        socket = light_path.outputs[bit]
        if factor is not None:
            most = tree.nodes.new("ShaderNodeMath")
            most.operation = "MAXIMUM"
            tree.links.new(factor, most.inputs[0])
            tree.links.new(socket, most.inputs[1])
            socket = most.outputs[0]
        factor = socket
    tree.links.new(factor, mix.inputs[0])
    tree.links.new(glass, mix.inputs[1])
    tree.links.new(transparent.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return scene, sun


def test_glass_that_shadow_rays_pass_casts_no_photons():
    """Light came twice: past the pane, and as photons through it."""
    from scenes import assert_agrees

    for bits in (("Is Shadow Ray",), ("Is Shadow Ray", "Is Diffuse Ray"), ("Is Shadow Ray", "Is Reflection Ray")):
        scene, _ = _architects_pane(bits)
        assert _caustic(scene) == 0.0
        set_file_format("OPEN_EXR", "32")
        assert_agrees(scene, samples=32, least_mean=0.001)


def test_slab_transmits_what_its_two_sides_leave():
    scene, _, _ = _slab()
    reflectance = 0.2**2
    expected = _SUN * (1 - reflectance) / (1 + reflectance) * _ALBEDO / math.pi
    # The slab shows the floor to itself: at most its albedo times what glass reflects of diffuse light, on two sides.
    assert 0.99 * expected < _caustic(scene) < (1 + 2 * 0.1 * _ALBEDO + 0.01) * expected


def test_objects_and_lights_may_stay_out():
    scene, slab, sun = _slab()
    slab.relief.caustic_caster = "no"
    assert _caustic(scene) == 0
    slab.relief.caustic_caster = "yes"
    assert _caustic(scene) > 0
    sun.relief.caustic_light = False
    assert _caustic(scene) == 0
    sun.relief.caustic_light = True
    scene.relief.caustics = "off"
    assert _caustic(scene) == 0
    scene.relief.caustics = "on"
    scene.relief.caustic_kinds = "reflective"
    assert _caustic(scene) == 0
    scene.relief.caustic_kinds = "both"
    for thing in scene.objects:
        thing.relief.caustic_receiver = False
    assert _caustic(scene) == 0


def _balls():
    """Glass and metal of all kinds on plastic, under a lamp that paths find by them."""
    # Each sample of a pixel has photons of its own, which take most of the time: many pixels of few samples each.
    scene = new_scene(96, 64)
    set_bounces(scene, 8)
    set_world((0.3, 0.35, 0.4))
    scene.cycles.blur_glossy = 0.0
    add_plane(8, new_material("plastic", "ShaderNodeBsdfPrincipled", Roughness=0.3, Base_Color=(0.7, 0.7, 0.7, 1))[0])
    materials = (
        new_material("rough glass", "ShaderNodeBsdfGlass", Roughness=0.1)[0],
        new_material("glass", "ShaderNodeBsdfGlass", Roughness=0.0)[0],
        new_material("metal", "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.1)[0],
        new_material("mirror", "ShaderNodeBsdfAnisotropic", Roughness=0.0)[0],
        new_material("principled glass", "ShaderNodeBsdfPrincipled", Transmission=1.0, Roughness=0.2)[0],
    )
    for i, material in enumerate(materials):
        add_sphere(0.5, material, (1.1 * (i - 2), 0.6 * (i % 2), 0.51))
    add_light("AREA", (1, -1, 3), degrees(15, 18, 0), energy=200).data.size = 2
    add_camera((0, -4, 2.6), degrees(58, 0, 0), lens=35)
    return scene


def test_switches_of_caustics_are_those_of_cycles():
    from scenes import assert_agrees

    for reflective, refractive in ((False, False), (True, False), (False, True)):
        scene = _balls()
        scene.relief.use_cycles_settings = True
        scene.cycles.caustics_reflective, scene.cycles.caustics_refractive = reflective, refractive
        for mode in ("on", "off"):
            scene.relief.caustics = mode
            # Photons blur what is as narrow as their radius, and pixels of few of them stand out.
            assert_agrees(scene, runs=5, samples=16, block=16, tolerance=0.02 if mode == "on" else 0.0)
