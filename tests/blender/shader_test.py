"""Shader nodes are Cycles' shader nodes: each of them, sums and mixes by graphs, bumps, both Principled BSDFs by chance.

material_test.py has what was there before closures were, with the same stage.
"""

import bpy
import random_principled
from material_test import _stage
from scenes import IS_4_0, IS_5_0, assert_agrees, new_material


def _agrees(material, tolerance=0.0, samples=32, **settings):
    assert_agrees(_stage(material, **settings), samples=samples, tolerance=tolerance)


def _single(kind, tolerance=0.0, samples=32, attributes=(), **inputs):
    """One shader node by itself.

    @param  attributes  of the node, by their names
    """
    material, _, node = new_material("single", kind, **inputs)
    for name, value in dict(attributes).items():
        setattr(node, name, value)
    _agrees(material, tolerance, samples)


def _noise(tree, scale=3.0, low=0.35, high=0.65):
    """A number that varies over an object from 0 to 1."""
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeMapRange")
    noise.inputs["Scale"].default_value = scale
    ramp.inputs["From Min"].default_value, ramp.inputs["From Max"].default_value = low, high
    tree.links.new(noise.outputs[0], ramp.inputs["Value"])
    return ramp.outputs[0]


def _mixed(first, second):
    """A material of two shader nodes, mixed by noise.

    @param  first, second  (kind, values by the inputs' names)
    """
    material, tree, mix = new_material("mixed", "ShaderNodeMixShader")
    tree.links.new(_noise(tree), mix.inputs[0])
    for number, (kind, values) in enumerate((first, second), 1):
        node = tree.nodes.new(kind)
        for name, value in values.items():
            node.inputs[name].default_value = value
        tree.links.new(node.outputs[0], mix.inputs[number])
    return material


def test_rough_diffuse():
    _single("ShaderNodeBsdfDiffuse", Color=(0.7, 0.5, 0.3, 1), Roughness=0.8)


def test_translucent():
    _single("ShaderNodeBsdfTranslucent", Color=(0.7, 0.5, 0.3, 1))


def test_velvet():
    if not IS_4_0:
        _single("ShaderNodeBsdfVelvet", Color=(0.7, 0.5, 0.3, 1), Sigma=0.6)


def test_toon():
    """Without a soft edge, which Cycles evaluates otherwise where its own samples find light."""
    _single("ShaderNodeBsdfToon", Color=(0.7, 0.5, 0.3, 1), Size=0.6, Smooth=0.0)


def test_glossy_toon():
    _single("ShaderNodeBsdfToon", attributes={"component": "GLOSSY"}, Size=0.3, Smooth=0.0)


def test_glossy_of_each_distribution_long():
    for distribution in ("GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY"):
        material, _, node = new_material("glossy", "ShaderNodeBsdfGlossy", Color=(0.9, 0.6, 0.2, 1), Roughness=0.4)
        node.distribution = distribution
        _agrees(material)
        _clear()


def test_glossy_that_scatters_more_than_once_long():
    """Of 3.4's random walk the energy is there, not all of the shape."""
    attributes = {"distribution": "MULTI_GGX"}
    _single("ShaderNodeBsdfGlossy", 0.1, attributes=attributes, Color=(0.9, 0.6, 0.2, 1), Roughness=0.4)


def test_coloured_rough_glass_long():
    _single("ShaderNodeBsdfGlass", Color=(0.9, 0.6, 0.5, 1), Roughness=0.3, IOR=1.5)


def test_refraction():
    _single("ShaderNodeBsdfRefraction", Color=(0.9, 0.6, 0.5, 1), Roughness=0.2, IOR=1.3)


def test_coloured_transparency_mixed_by_fresnel_long():
    material, tree, mix = new_material("mixed", "ShaderNodeMixShader")
    clear, gloss = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfGlossy")
    clear.inputs[0].default_value = (1.0, 0.4, 0.2, 1.0)
    gloss.inputs["Roughness"].default_value = 0.3
    tree.links.new(tree.nodes.new("ShaderNodeFresnel").outputs[0], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(gloss.outputs[0], mix.inputs[2])
    _agrees(material)


def test_diffuse_and_gloss_mixed_by_noise():
    diffuse = ("ShaderNodeBsdfDiffuse", {"Color": (0.8, 0.1, 0.1, 1), "Roughness": 0.0})
    _agrees(_mixed(diffuse, ("ShaderNodeBsdfGlossy", {"Roughness": 0.3})))


def test_emission_and_glass_mixed_by_noise_long():
    emission = ("ShaderNodeEmission", {"Color": (0.2, 1, 0.3, 1), "Strength": 0.5})
    _agrees(_mixed(emission, ("ShaderNodeBsdfGlass", {"Roughness": 0.4})))


def test_a_sum_of_three():
    material, tree, add = new_material("sum", "ShaderNodeAddShader")
    inner = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(inner.outputs[0], add.inputs[0])
    for socket, kind in ((add.inputs[1], "ShaderNodeBsdfTranslucent"), (inner.inputs[0], "ShaderNodeBsdfDiffuse"), (inner.inputs[1], "ShaderNodeBsdfGlossy")):
        node = tree.nodes.new(kind)
        node.inputs["Color"].default_value = (0.3, 0.25, 0.2, 1)
        tree.links.new(node.outputs[0], socket)
    _agrees(material)


def test_thin_films_on_metal():
    """Of the Principled BSDF, and of both kinds of the Metallic one, since 5.0."""
    if not IS_5_0:
        return
    film = {"Thin Film Thickness": 400.0, "Thin Film IOR": 1.4, "Roughness": 0.3}
    _single("ShaderNodeBsdfPrincipled", Metallic=1.0, Base_Color=(0.9, 0.6, 0.3, 1), **film)
    for fresnel in ("F82", "PHYSICAL_CONDUCTOR"):
        _clear()
        _single("ShaderNodeBsdfMetallic", attributes={"fresnel_type": fresnel, "distribution": "GGX"}, **film)


def test_thin_films_on_glass():
    if "Thin Film Thickness" in new_material("probe", "ShaderNodeBsdfPrincipled")[2].inputs:
        film = {"Thin Film Thickness": 500.0, "Thin Film IOR": 1.4, "Roughness": 0.3}
        _single("ShaderNodeBsdfPrincipled", Base_Color=(0.1, 0.1, 0.1, 1), **film)


def test_rough_coats():
    """What a rough coat reflects is taken from below it since 5.0, what a smooth one would before."""
    if IS_4_0:
        for roughness in (0.4, 0.8):
            coat = {"Coat Weight": 1.0, "Coat Roughness": roughness, "Specular IOR Level": 0.0}
            _single("ShaderNodeBsdfPrincipled", 0.0 if IS_5_0 else 0.01, Base_Color=(0.8, 0.5, 0.3, 1), **coat)
            _clear()


def _clear():
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()


def _bumped(kind="ShaderNodeBsdfPrincipled", strength=0.5, invert=False, chained=False, **inputs):
    material, tree, node = new_material("bumped", kind, **inputs)
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.invert = strength, invert
    bump.inputs["Distance"].default_value = 1.0  # less in later versions
    # Wide, so that what lies within a pixel is even: the engines ask for slopes along different axes.
    tree.links.new(_noise(tree, 2.0, 0.0, 1.0), bump.inputs["Height"])
    if chained:
        below = tree.nodes.new("ShaderNodeBump")
        below.inputs["Strength"].default_value = 0.3
        below.inputs["Distance"].default_value = 1.0
        wave = tree.nodes.new("ShaderNodeTexWave")
        tree.links.new(wave.outputs[0], below.inputs["Height"])
        tree.links.new(below.outputs[0], bump.inputs["Normal"])
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    return material


def test_bump():
    _agrees(_bumped(), 0.01)


def test_inverted_bump():
    _agrees(_bumped(invert=True, strength=1.0), 0.01)


def test_chained_bumps_of_gloss_long():
    _agrees(_bumped("ShaderNodeBsdfGlossy", chained=True, Roughness=0.3), 0.02)


def test_filter_width_of_bumps():
    """Detail finer than a pixel, from heights a fiftieth of a pixel away to heights three pixels away; after 4.3."""
    material = _bumped()
    tree = material.node_tree
    bump = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBump")
    if "Filter Width" not in bump.inputs:
        return
    # Some facets see no light: what the engines' axes do with detail is a few parts in a hundred of a block.
    next(n for n in tree.nodes if n.bl_idname == "ShaderNodeTexNoise").inputs["Scale"].default_value = 60.0
    for width in (0.02, 3.0):
        bump.inputs["Filter Width"].default_value = width
        bump.inputs["Distance"].default_value = 0.02
        _agrees(material, 0.02)
        _clear()


def test_displacement_that_bumps_only():
    material, tree, node = new_material("bumped", "ShaderNodeBsdfPrincipled")
    displacement = tree.nodes.new("ShaderNodeDisplacement")
    displacement.inputs["Scale"].default_value = 0.3
    tree.links.new(_noise(tree, 2.0, 0.0, 1.0), displacement.inputs["Height"])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
    _agrees(material, 0.01)


def test_principled_by_chance_long():
    """The first three of measure_random_principled.py."""
    for seed in range(3):
        found, difference = random_principled.compare(random_principled.values(seed))
        print(f"seed {seed}: {random_principled.describe(found, difference)}")
        assert found.passed, f"seed {seed} differs"
