# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's shader nodes as one layered surface: what glTF's material with its extensions can say.

One function a node, listed at the end. Mix and Add Shader are understood where the result is again one layered surface:
transparency, emission on top, a coat of gloss by Fresnel, metal and plastic. Other mixes are approximated, and say so.
"""

from dataclasses import dataclass, field, replace

from .. import compat
from . import nodes
from .texture import Input

_WHITE = (1.0, 1.0, 1.0)
_BLACK = (0.0, 0.0, 0.0)


@dataclass
class Surface:
    """glTF's parameters. Colours are linear RGB; every Input may be textured.

    specular        weight of the dielectric's reflection; 0: diffuse alone
    specular_color  multiplies the reflection at normal incidence that `ior` gives
    normal          Input of a tangent-space normal map, whose value is its strength; None: none
    emission        radiance
    """

    base_color: Input = field(default_factory=lambda: Input(_WHITE))
    alpha: Input = field(default_factory=lambda: Input(1.0))
    metallic: Input = field(default_factory=lambda: Input(0.0))
    roughness: Input = field(default_factory=lambda: Input(1.0))
    transmission: Input = field(default_factory=lambda: Input(0.0))
    ior: float = 1.5
    specular: float = 0.0
    specular_color: tuple = _WHITE
    coat: Input = field(default_factory=lambda: Input(0.0))
    coat_roughness: Input = field(default_factory=lambda: Input(0.0))
    sheen_color: tuple = _BLACK
    sheen_roughness: float = 0.5
    normal: object = None
    emission: Input = field(default_factory=lambda: Input(_BLACK))

    def emits(self):
        return not self.emission.is_constant(_BLACK)


#: What is not there, such as the surface of a volume that has none of its own.
TRANSPARENT = Surface(base_color=Input(_BLACK), alpha=Input(0.0))


def surface_from(source, textures):
    """The layered surface of a shader output.

    @param  source    nodes.Source of a shader, None: nothing linked, which is black
    @param  textures  TextureReader
    @return           Surface
    """
    if source is None:
        return Surface(base_color=Input(_BLACK))
    build = _NODES.get(source.node.bl_idname)
    if build is None:
        node = source.node
        textures.warn(f'node "{node.name}" ({node.bl_label}) as surface', "a grey diffuse surface was used")
        return Surface(base_color=Input((0.8, 0.8, 0.8)))
    return build(source, textures)


def _inputs(source, textures):
    """(color, number, constant number): readers of the node's inputs by name."""
    node, groups = source.node, source.groups
    return (
        lambda name: textures.color(node.inputs[name], groups),
        lambda name: textures.number(node.inputs[name], groups),
        lambda name: textures.constant_number(node.inputs[name], groups),
    )


def _normal(socket, groups, textures):
    """Normal map behind a Normal input; others are warned about, unless a Bump is to displace."""
    source = nodes.follow(socket, groups)
    if source is None:
        return None
    node = source.node
    if node.bl_idname == "ShaderNodeBump" and textures.takes_bump and textures.bump in (None, source):
        textures.bump = source
        return _normal(node.inputs["Normal"], source.groups, textures)
    if node.bl_idname != "ShaderNodeNormalMap":
        textures.warn(f'node "{node.name}" ({node.bl_label}) as normal', "the surface's own normal was used")
        return None
    if node.space != "TANGENT":
        textures.warn(f'node "{node.name}": space {node.space.lower()}', "the surface's own normal was used")
        return None
    color = textures.image(node.inputs["Color"], source.groups, is_color=True)
    if color is None:
        textures.warn(f'node "{node.name}": a normal map that is no image', "the surface's own normal was used")
    if color is None or color.texture is None:
        return None
    if node.uv_map:
        mapping = replace(color.texture.mapping, source=("uv", node.uv_map))
        if color.texture.mapping.source not in {("uv", ""), ("uv", node.uv_map)}:
            textures.warn(f'node "{node.name}": tangents of another uv map than its texture', "the texture's were used")
        else:
            color = replace(color, texture=replace(color.texture, mapping=mapping))
    return replace(color, value=textures.constant_number(node.inputs["Strength"], source.groups))


#: Inputs of the Principled BSDF that are 0 unless something is asked for that the format cannot say.
_UNREAD = (
    ("Subsurface", "subsurface scattering", "its colour was used as a diffuse one"),
    ("Anisotropic", "anisotropy", "the roughness was used in all directions"),
    ("Transmission Roughness", "transmission roughness", "the roughness of the surface was used"),
    ("Diffuse Roughness", "roughness of the diffuse layer", "Lambert's law was used"),
    ("Thin Film Thickness", "a thin film", "it is left out"),
)


def _principled(source, textures):
    node, groups = source.node, source.groups

    def socket(name):
        return compat.principled_socket(node, name)

    def constant(name, default=0.0):
        return textures.constant_number(socket(name), groups) if socket(name) is not None else default

    def warn(what, instead):
        textures.warn(f'node "{node.name}": {what}', instead)

    for name, what, instead in _UNREAD:
        if constant(name) != 0:
            warn(what, instead)
    surface = Surface(
        base_color=textures.color(socket("Base Color"), groups),
        alpha=textures.number(socket("Alpha"), groups),
        metallic=textures.number(socket("Metallic"), groups),
        roughness=textures.number(socket("Roughness"), groups),
        transmission=textures.number(socket("Transmission"), groups),
        coat=textures.number(socket("Clearcoat"), groups),
        coat_roughness=textures.number(socket("Clearcoat Roughness"), groups),
        normal=_normal(socket("Normal"), groups, textures),
    )
    surface.base_color = _with_subsurface_color(surface, constant("Subsurface"), socket("Subsurface Color"), groups, textures)
    surface.coat = replace(surface.coat, value=surface.coat.value * compat.COAT_SCALE)
    if not surface.coat.is_constant(0.0):
        if nodes.follow(socket("Clearcoat Normal"), groups) is not None:
            warn("a normal of the coat", "that of the surface was used")
        if compat.has_uncommon_coat(node):
            warn("a coat with a tint or an index other than 1.5", "a clear one with 1.5 was used")
    surface.ior, surface.specular, surface.specular_color = compat.principled_reflection(
        constant("Specular", 0.5),
        constant("IOR", 1.5),
        _specular_tint(surface, socket("Specular Tint"), groups, textures, warn),
        not surface.transmission.is_constant(0.0),
    )
    _set_sheen(surface, node, groups, constant, textures)
    emission = textures.color(socket("Emission"), groups)
    strength = constant("Emission Strength", 1.0)
    surface.emission = _scaled(emission, strength)
    return surface


def _with_subsurface_color(surface, weight, socket, groups, textures):
    """Base colour of a Principled BSDF with its Subsurface Color, which was there before 4.0.

    Cycles takes the colour of all diffuse light from between both, by the weight of the subsurface scattering; what metal
    reflects and glass lets through keeps the base colour.
    """
    base = surface.base_color
    weight = min(max(weight, 0.0), 1.0)
    if socket is None or weight == 0:
        return base
    if not surface.metallic.is_constant(0.0) or not surface.transmission.is_constant(0.0):
        textures.warn("the Subsurface Color of a surface that is in part metal or glass", "its base colour was used")
        return base
    below = textures.color(socket, groups)
    mixed = tuple((1 - weight) * a + weight * b for a, b in zip(base.value, below.value))
    if (base.texture, base.color_map, base.graph) == (below.texture, below.color_map, below.graph):
        return replace(base, value=mixed)
    heavier = below if weight >= 0.5 else base
    if weight < 1:
        textures.warn("a mix of base and Subsurface Color of which one is textured", "the heavier one was used")
    return heavier


def _specular_tint(surface, socket, groups, textures, warn):
    """Colour of a Principled BSDF's reflection at normal incidence."""
    if not compat.TINTS_ARE_COLORS:
        if textures.constant_number(socket, groups) > 0:
            warn("specular tint", "an untinted reflection was used")
        return _WHITE
    tint = textures.constant_color(socket, groups)
    if tint != _WHITE and not surface.metallic.is_constant(0.0):
        warn("specular tint of a metal", "it reflects all light at grazing angles")
    return tint


def _set_sheen(surface, node, groups, constant, textures):
    weight = constant("Sheen")
    if weight <= 0:
        return
    tint_socket = compat.principled_socket(node, "Sheen Tint")
    reader = textures.constant_color if compat.TINTS_ARE_COLORS else textures.constant_number
    base = surface.base_color.value
    surface.sheen_color = compat.sheen_color(base, weight, reader(tint_socket, groups))
    surface.sheen_roughness = constant("Sheen Roughness", surface.sheen_roughness)
    textures.warn(f'node "{node.name}": sheen', "glTF's sheen was used, which looks a little different")


def _scaled(color, factor):
    return replace(color, value=tuple(c * factor for c in color.value))


def _diffuse(source, textures):
    color, _, constant = _inputs(source, textures)
    if constant("Roughness") > 0:
        textures.warn(f'node "{source.node.name}": roughness of a diffuse surface', "Lambert's law was used")
    normal = _normal(source.node.inputs["Normal"], source.groups, textures)
    return Surface(base_color=color("Color"), normal=normal)


def _glossy(source, textures):
    color, number, constant = _inputs(source, textures)
    node = source.node
    roughness = Input(0.0) if getattr(node, "distribution", "") == "SHARP" else number("Roughness")
    if getattr(node, "distribution", "") in {"BECKMANN", "ASHIKHMIN_SHIRLEY"}:
        textures.warn(f'node "{node.name}": distribution {node.distribution.lower()}', "GGX was used")
    _warn_anisotropy(node, constant, textures)
    normal = _normal(node.inputs["Normal"], source.groups, textures)
    return Surface(base_color=color("Color"), metallic=Input(1.0), roughness=roughness, specular=1.0, normal=normal)


def _warn_anisotropy(node, constant, textures):
    if "Anisotropy" in node.inputs and constant("Anisotropy") != 0:
        textures.warn(f'node "{node.name}": anisotropy', "the roughness was used in all directions")


def _metallic(source, textures):
    """The Metallic BSDF, which came with 4.3."""
    color, number, constant = _inputs(source, textures)
    node = source.node
    if node.fresnel_type != "F82":
        textures.warn(f'node "{node.name}": a metal by its indices', "its base colour was used")
    elif textures.constant_color(node.inputs["Edge Tint"], source.groups) != _WHITE:
        textures.warn(f'node "{node.name}": edge tint', "it reflects all light at grazing angles")
    if node.distribution == "BECKMANN":
        textures.warn(f'node "{node.name}": distribution beckmann', "GGX was used")
    _warn_anisotropy(node, constant, textures)
    return Surface(
        base_color=color("Base Color"),
        metallic=Input(1.0),
        roughness=number("Roughness"),
        specular=1.0,
        normal=_normal(node.inputs["Normal"], source.groups, textures),
    )


def _glass(source, textures):
    color, number, constant = _inputs(source, textures)
    node = source.node
    roughness = Input(0.0) if node.distribution == "SHARP" else number("Roughness")
    surface = Surface(
        base_color=color("Color"),
        roughness=roughness,
        transmission=Input(1.0),
        ior=max(1.0, constant("IOR")),
        specular=1.0,
        normal=_normal(node.inputs["Normal"], source.groups, textures),
    )
    if not surface.base_color.is_constant(_WHITE):
        textures.warn(f'node "{node.name}": coloured glass', "its reflections are white")
    return surface


def _refraction(source, textures):
    textures.warn(f'node "{source.node.name}": refraction alone', "glass was used, which reflects too")
    return _glass(source, textures)


def _translucent(source, textures):
    textures.warn(f'node "{source.node.name}": translucency', "a diffuse surface of its colour was used")
    color, _, _ = _inputs(source, textures)
    return Surface(base_color=color("Color"))


def _transparent(source, textures):
    color = textures.constant_color(source.node.inputs["Color"], source.groups)
    if max(color) - min(color) > 1e-4:
        textures.warn(f'node "{source.node.name}": coloured transparency', "its mean was used, without colour")
    return Surface(base_color=Input(_BLACK), alpha=Input(1.0 - min(1.0, sum(color) / 3)))


def _emission(source, textures):
    color, _, constant = _inputs(source, textures)
    return Surface(base_color=Input(_BLACK), emission=_scaled(color("Color"), constant("Strength")))


def _holdout(source, textures):
    textures.warn(f'node "{source.node.name}": holdout', "a black surface was used")
    return Surface(base_color=Input(_BLACK))


def _is_transparent(surface):
    return surface.alpha.is_constant(0.0) and not surface.emits()


def _is_black(surface):
    return surface.base_color.is_constant(_BLACK) and surface.specular == 0 and not surface.metallic.value


def _add(source, textures):
    first, second = (
        surface_from(nodes.follow(socket, source.groups), textures) for socket in source.node.inputs[:2]
    )
    for one, other in ((first, second), (second, first)):
        if other.emits() and _is_black(other) and not one.emits():
            return replace(one, emission=other.emission)
        if _is_black(other) and not other.emits():
            return one
    textures.warn(f'node "{source.node.name}": a sum of shaders', "half of each was used")
    return _blend(0.5, first, second)


def _mix(source, textures):
    node, groups = source.node, source.groups
    first, second = (nodes.follow(socket, groups) for socket in node.inputs[1:3])
    first, second = surface_from(first, textures), surface_from(second, textures)
    by_fresnel = _fresnel_ior(nodes.follow(node.inputs[0], groups), textures)
    if by_fresnel is not None and second.metallic.is_constant(1.0):
        return _plastic(first, second, by_fresnel, node, textures)
    factor = textures.number(node.inputs[0], groups)
    if _is_transparent(first):
        return replace(second, alpha=_times(factor, second.alpha, node, textures))
    if _is_transparent(second):
        if factor.texture is None:
            rest = replace(factor, value=-factor.value, offset=1.0 - factor.offset) if factor.graph else Input(1.0 - factor.value)
            return replace(first, alpha=_times(rest, first.alpha, node, textures))
        textures.warn(f'node "{node.name}": a textured mix with transparency second', "swap its shaders; it is opaque")
        return first
    if not factor.is_constant():
        are_pure = first.metallic.is_constant(0.0) and second.metallic.is_constant(1.0)
        if first.base_color == second.base_color and are_pure:
            return replace(first, metallic=factor, roughness=second.roughness)
        textures.warn(f'node "{node.name}": a textured mix of shaders', "half of each was used")
        return _blend(0.5, first, second)
    weight = min(max(factor.value, 0.0), 1.0)
    if weight in {0.0, 1.0}:
        return second if weight else first
    if not _blends_exactly(first, second):
        textures.warn(f'node "{node.name}": a mix of different shaders', "one with the mean of their values was used")
    return _blend(weight, first, second)


def _fresnel_ior(source, textures):
    """Index of a mix by Fresnel's equations; None for other factors."""
    if source is None or source.node.bl_idname not in {"ShaderNodeFresnel", "ShaderNodeLayerWeight"}:
        return None
    if source.node.bl_idname == "ShaderNodeFresnel":
        return max(1.0, textures.constant_number(source.node.inputs["IOR"], source.groups))
    if source.socket.name != "Fresnel":
        return None
    blend = textures.constant_number(source.node.inputs["Blend"], source.groups)
    return 1.0 / max(1.0 - blend, 1e-5)


def _plastic(below, gloss, ior, node, textures):
    """Gloss over something else by Fresnel: glTF's dielectric."""
    if not gloss.base_color.is_constant(_WHITE):
        textures.warn(f'node "{node.name}": coloured gloss', "its reflection at normal incidence has the colour")
    tint = gloss.base_color.value if gloss.base_color.is_constant() else _WHITE
    return replace(below, roughness=gloss.roughness, ior=ior, specular=1.0, specular_color=tint)


def _times(factor, alpha, node, textures):
    """Product of two opacities, of which only one may be textured."""
    if alpha.is_constant():
        return replace(factor, value=factor.value * alpha.value, offset=factor.offset * alpha.value)
    if factor.is_constant():
        return replace(alpha, value=alpha.value * factor.value, offset=alpha.offset * factor.value)
    textures.warn(f'node "{node.name}": two textured opacities', "the one of the mix was used")
    return factor


def _blends_exactly(first, second):
    """Whether the mean of the parameters is the mean of the surfaces: diffuse, emission and black ones are linear."""
    return all(
        s.specular == 0 and s.transmission.is_constant(0.0) and s.coat.is_constant(0.0) and s.alpha.is_constant(1.0)
        for s in (first, second)
    )


def _blend(weight, first, second):
    """A surface with mixed parameters. Where both sides are textured, the heavier one's texture stays."""

    def mixed(a, b):
        if isinstance(a, tuple):
            return tuple((1 - weight) * x + weight * y for x, y in zip(a, b))
        return (1 - weight) * a + weight * b

    def inputs(a, b):
        if a.is_constant() and b.is_constant():
            return Input(mixed(a.value, b.value))
        return a if (weight < 0.5 or b.is_constant()) and not a.is_constant() else b

    out = Surface(ior=first.ior if weight < 0.5 else second.ior, normal=first.normal or second.normal)
    for name in ("base_color", "alpha", "metallic", "roughness", "transmission", "coat", "coat_roughness", "emission"):
        setattr(out, name, inputs(getattr(first, name), getattr(second, name)))
    for name in ("specular", "specular_color", "sheen_color", "sheen_roughness"):
        setattr(out, name, mixed(getattr(first, name), getattr(second, name)))
    return out


_NODES = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfMetallic": _metallic,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _refraction,
    "ShaderNodeBsdfTranslucent": _translucent,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeHoldout": _holdout,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}
