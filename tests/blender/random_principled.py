"""Principled BSDFs with inputs by chance, each version's own, and how a ball of them compares with Cycles' picture.

Left out are subsurface scattering, emission, 3.4's Multiscatter GGX: docs/blender.md says what is known of them.
"""

import random

import bpy
from material_test import _stage
from scenes import IS_4_0, IS_5_0, agreement, new_material, new_scene

#: Relative difference of a block that is allowed.
TOLERANCE = 0.02 if IS_4_0 and not IS_5_0 else 0.01


def _color(chance):
    return tuple(chance.random() for _ in range(3)) + (1.0,)


def values(seed):
    """Values by the names of inputs; inputs that are not named keep their defaults. "distribution" is the node's own."""
    chance = random.Random(seed)

    def often(make):
        """Every second time nothing."""
        value = make()
        return value if chance.random() < 0.5 else None

    number = chance.random
    found = {
        "Base Color": _color(chance),
        "Roughness": 0.2 + 0.8 * number(),
        "Metallic": chance.choice((0.0, 0.0, 1.0, number())),
        "IOR": 1.1 + number(),
        "Alpha": chance.choice((1.0, 1.0, number())),
        "Anisotropic": often(number),
        "Anisotropic Rotation": often(number),
    }
    transmission, specular = chance.choice((0.0, 0.0, number())), number()
    if IS_4_0:
        found |= {
            "distribution": chance.choice(("GGX", "MULTI_GGX")),
            "Transmission Weight": transmission,
            "Specular IOR Level": specular,
            "Specular Tint": often(lambda: _color(chance)),
            "Diffuse Roughness": often(number),
            "Coat Weight": often(number),
            "Coat Roughness": 0.1 + 0.9 * number(),
            "Coat IOR": 1.1 + number(),
            "Coat Tint": often(lambda: _color(chance)),
            "Sheen Weight": often(number),
            "Sheen Roughness": 0.1 + 0.9 * number(),
            "Sheen Tint": often(lambda: _color(chance)),
            "Thin Film Thickness": often(lambda: 100 + 900 * number()),
            "Thin Film IOR": 1.1 + number(),
        }
    else:
        found |= {
            "Transmission": transmission,
            "Transmission Roughness": often(number),
            "Specular": specular,
            "Specular Tint": often(number),
            "Sheen": often(number),
            "Sheen Tint": number(),
            "Clearcoat": often(number),
            "Clearcoat Roughness": 0.1 + 0.9 * number(),
        }
    return {name: value for name, value in found.items() if value is not None}


def material(inputs):
    """A material of one Principled BSDF; inputs that this version does not have are left out."""
    made, _, node = new_material("principled", "ShaderNodeBsdfPrincipled")
    for name, value in inputs.items():
        if name == "distribution":
            node.distribution = value
        elif name in node.inputs:
            node.inputs[name].default_value = value
    return made


def compare(inputs, samples=32):
    """Agreement of a ball's two pictures, and the relative difference of their means."""
    new_scene()
    return agreement(_stage(material(inputs)), samples=samples, tolerance=TOLERANCE)


def describe(found, difference):
    """One line on what compare gives: the block is that of the least p, its difference what is above the tolerance."""
    noise, share = found.relative_standard_error, found.small_p_fraction
    block = f"block {found.worst_block} {found.worst_block_ratio - 1:+.1%}, p {found.block_p:.1g}"
    return f"{judgement(found)}: mean {difference:+.2%} ± {noise:.2%}, {block}, {share:.0%} of blocks below p .05"


def judgement(found):
    return "agrees" if found.passed else "differs"
