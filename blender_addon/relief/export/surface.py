# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's shader trees: as the closures of RELIEF_surface, or in glTF's own words where these say exactly the same.

A tree of Mix and Add Shaders is a weighted sum of closures. Each shader node becomes one closure (the Principled BSDF's
emission and alpha one each besides), with the weight that the mixes give it; inputs and weights that vary are references
into the material's graph. One entry a node, listed at the end.

What glTF's core means exactly as Cycles does stays there: it costs less, and emission is sampled as a light.
"""

from dataclasses import dataclass, field, replace
from enum import Enum

from .. import compat
from . import nodes
from .graph_inputs import mesh_attribute, strand_ellipse
from .not_understood import NotUnderstood
from .texture import Input, TextureReader

_WHITE = (1.0, 1.0, 1.0)
_BLACK = (0.0, 0.0, 0.0)

#: Up to this roughness Cycles takes gloss and glass for perfectly smooth.
_SHARP = 1e-4


@dataclass
class Surface:
    """A surface in the words of glTF's core. Colours are linear RGB; every Input may be textured.

    is_mirror  a white, perfectly smooth mirror
    ior        of white, perfectly smooth glass; None: it is none
    emission   radiance
    """

    base_color: Input = field(default_factory=lambda: Input(_BLACK))
    alpha: Input = field(default_factory=lambda: Input(1.0))
    is_mirror: bool = False
    ior: object = None
    emission: Input = field(default_factory=lambda: Input(_BLACK))

    def emits(self):
        return not self.emission.is_constant(_BLACK)

    def is_transparent(self):
        return self.alpha.is_constant(0.0) and not self.emits()

    def is_black(self):
        return self.base_color.is_constant(_BLACK) and not self.is_mirror and self.ior is None and self.alpha.is_constant(1.0)

    def is_lambertian(self):
        """Whether it is diffuse and emits, or less: sums of such are such."""
        return not self.is_mirror and self.ior is None and self.alpha.is_constant(1.0)


class Inside(Enum):
    """What gets into what a surface bounds.

    CLOSED   no light
    OPEN     light, past or through a surface without thickness
    BOUNDED  light, through glass
    """

    CLOSED = 0
    OPEN = 1
    BOUNDED = 2


#: What is not there, such as the surface of a volume that has none of its own.
TRANSPARENT = Surface(alpha=Input(0.0))


class _NotPlain(Exception):
    """Something that glTF's core cannot say, or does not mean as Cycles does."""


def plain_surface(source, bends, filters_glossy):
    """A shader output in glTF's core.

    @param  source          nodes.Source of a shader, None: nothing linked, which is black
    @param  bends           tells of a Normal input and its groups whether it gives another normal than the mesh's
    @param  filters_glossy  mirrors and glass may be blurred, which Cycles does by microfacets of its own
    @return                 Surface; None if the core cannot say it
    """
    return _unless_refused(lambda textures: _Plain(textures, bends, filters_glossy).surface(source))


def _unless_refused(read):
    """What a function makes of a TextureReader; None if that has something to warn about."""

    def refuse(*_):
        raise _NotPlain

    try:
        return read(TextureReader(refuse))
    except (_NotPlain, RecursionError):
        return None


def _plain_color(socket, groups, textures):
    color = textures.color(socket, groups)
    if color.texture is not None and color.texture.channel is not None or _is_tiled(color):
        raise _NotPlain
    return color


def _is_tiled(value):
    """Whether an Input is of an image of several tiles, of which glTF's textures have one."""
    return value.texture is not None and value.texture.node.image.source == "TILED"


def _plain_emission(color, strength, groups, textures):
    emission = _plain_color(color, groups, textures)
    if emission.color_map is not None:
        raise _NotPlain
    emission = scaled(emission, textures.constant_number(strength, groups))
    if min(emission.value) < 0:  # it takes light away: a closure's to say
        raise _NotPlain
    return emission


class _Plain:
    def __init__(self, textures, bends, filters_glossy):
        self._textures = textures
        self._bends = bends
        self._filters_glossy = filters_glossy

    def surface(self, source):
        if source is None or source.is_value:
            return Surface()
        if source.node.bl_idname not in self._NODES or source.socket.type != "SHADER":
            raise _NotPlain
        return self._NODES[source.node.bl_idname](self, source.node, source.groups)

    def _color(self, socket, groups):
        return _plain_color(socket, groups, self._textures)

    def _base_color(self, socket, groups):
        color = self._color(socket, groups)
        if not all(0.0 <= c <= 1.0 for c in color.value):
            raise _NotPlain
        return color

    def _constant(self, socket, groups):
        return self._textures.constant_number(socket, groups)

    def _require(self, condition):
        if not condition:
            raise _NotPlain

    def _diffuse(self, node, groups):
        self._require(self._constant(node.inputs["Roughness"], groups) == 0)
        self._require(not self._bends(node.inputs["Normal"], groups))
        return Surface(base_color=self._base_color(node.inputs["Color"], groups))

    def _emission(self, node, groups):
        color, strength = node.inputs["Color"], node.inputs["Strength"]
        return Surface(emission=_plain_emission(color, strength, groups, self._textures))

    def _transparent(self, node, groups):
        self._require(self._color(node.inputs["Color"], groups).is_constant(_WHITE))
        return replace(TRANSPARENT)

    def _require_sharp_white(self, node, groups):
        self._require(not self._filters_glossy)
        self._require(not self._bends(node.inputs["Normal"], groups))
        self._require(self._color(node.inputs["Color"], groups).is_constant(_WHITE))
        if node.distribution != "SHARP":
            self._require(self._constant(node.inputs["Roughness"], groups) <= _SHARP)

    def _mirror(self, node, groups):
        self._require_sharp_white(node, groups)
        return Surface(base_color=Input(_WHITE), is_mirror=True)

    def _glass(self, node, groups):
        self._require_sharp_white(node, groups)
        film = node.inputs.get("Thin Film Thickness")
        self._require(film is None or self._constant(film, groups) == 0)
        ior = self._constant(node.inputs["IOR"], groups)
        self._require(ior >= 1)
        return Surface(base_color=Input(_WHITE), ior=ior)

    def _add(self, node, groups):
        first, second = (self.surface(nodes.follow(socket, groups)) for socket in node.inputs[:2])
        for one, other in ((first, second), (second, first)):
            if other.is_black() and not (one.emits() and other.emits()):
                self._require(one.is_lambertian() or not other.emits())
                return replace(one, emission=other.emission) if other.emits() else one
        raise _NotPlain

    def _mix(self, node, groups):
        factor = self._textures.number(node.inputs[0], groups)
        first, second = (nodes.follow(socket, groups) for socket in node.inputs[1:3])
        if factor.is_constant():
            return self._mix_by(min(max(factor.value, 0.0), 1.0), first, second)
        first, second = self.surface(first), self.surface(second)
        self._require(first.is_transparent() and second.alpha.is_constant(1.0))
        self._require(not _is_tiled(factor))
        self._require(factor.offset == 0 and factor.value == 1 and self._holds_alpha(second, factor.texture))
        return replace(second, alpha=factor)

    def _mix_by(self, weight, first, second):
        if weight in {0.0, 1.0}:
            return self.surface(second if weight else first)
        first, second = self.surface(first), self.surface(second)
        for one, other, share in ((second, first, weight), (first, second, 1 - weight)):
            if other.is_transparent() and (one.alpha.is_constant() or one.alpha.texture):
                return replace(one, alpha=replace(one.alpha, value=one.alpha.value * share))
        self._require(first.is_lambertian() and second.is_lambertian())
        base = self._sum(scaled(first.base_color, 1 - weight), scaled(second.base_color, weight))
        emission = self._sum(scaled(first.emission, 1 - weight), scaled(second.emission, weight))
        return Surface(base_color=base, emission=emission)

    def _sum(self, first, second):
        if first.is_constant() and second.is_constant():
            return Input(tuple(a + b for a, b in zip(first.value, second.value)))
        self._require(first.is_constant(_BLACK) or second.is_constant(_BLACK))
        return second if first.is_constant(_BLACK) else first

    def _holds_alpha(self, surface, own):
        """Whether an opacity has room beside a base colour: in its image, or in place of one."""
        base = surface.base_color.texture
        if base is None:
            return True
        return own.channel == 3 and own.node.image == base.node.image and own.mapping == base.mapping

    _NODES = {
        "ShaderNodeBsdfDiffuse": _diffuse,
        "ShaderNodeBsdfGlossy": _mirror,
        "ShaderNodeBsdfAnisotropic": _mirror,
        "ShaderNodeBsdfGlass": _glass,
        "ShaderNodeBsdfTransparent": _transparent,
        "ShaderNodeEmission": _emission,
        "ShaderNodeBackground": _emission,
        "ShaderNodeMixShader": _mix,
        "ShaderNodeAddShader": _add,
    }


def scaled(color, factor):
    return replace(color, value=tuple(c * factor for c in color.value))


class ClosureWriter:
    """Collects the closures of one material's shader tree.

    @param  graph      GraphWriter, which gets what varies
    @param  past_bump  gives the Normal input and its groups that count in place of others: behind a Bump that displaces
    @param  fail       called with a nodes.Source, what is not understood of it, and what was used instead
    @param  filters_glossy  as of plain_surface
    closures   JSON of the closures
    emission   Input of the radiance that no graph gives, which stays in the core
    transmits  whether there is glass
    """

    def __init__(self, graph, past_bump, fail, filters_glossy):
        self.graph = graph
        self.filters_glossy = filters_glossy
        self.closures = []
        self.emission = Input(_BLACK)
        self.transmits = False
        self._past_bump = past_bump
        self._fail = fail
        self._emitters = []  # (radiance without a graph or None, (Source, its sockets), weight)

    def write(self, source):
        """Adds the closures of a shader output.

        @param  source  nodes.Source
        """
        for part, weight in self._parts(source):
            if part.socket.type != "SHADER":
                self._shine(part, weight)
            elif part.node.bl_idname in _NODES:
                _NODES[part.node.bl_idname](self, part, weight)
            else:
                label = f'node "{part.node.name}" ({part.node.bl_label})'
                self._fail(part, f"{label} as surface", "a grey diffuse surface was used")
                self.add("diffuse", weight)
        self._add_emission()

    @property
    def inside(self):
        if self.transmits:
            return Inside.BOUNDED
        is_open = any(closure["type"] in {"transparent", "translucent"} for closure in self.closures)
        return Inside.OPEN if is_open else Inside.CLOSED

    def _parts(self, source):
        """(nodes.Source, weight) of all shaders of a tree that are not mixes, each once, in the order that they stand in.

        Weights are summed over all ways to a node, the later nodes after the earlier ones: so the number of ways does
        not matter.
        """
        order = []
        self._visit(source, order, set())
        weights = {(source.key, source.socket.identifier): 1.0}
        parts = []
        for part in reversed(order):
            weight = weights[part.key, part.socket.identifier]
            if part.node.bl_idname not in _COMBINATIONS or part.socket.type != "SHADER":
                parts.append((part, weight))
                continue
            for child, share in self._children(part):
                key = child.key, child.socket.identifier
                weights[key] = self._plus(weights.get(key, 0.0), self.times(weight, share))
        return parts

    def _visit(self, source, order, seen):
        key = source.key, source.socket.identifier
        if key in seen:
            return
        seen.add(key)
        if source.node.bl_idname in _COMBINATIONS and source.socket.type == "SHADER":
            # The last first, as the order is read from its end.
            for child, _ in reversed(self._children(source)):
                self._visit(child, order, seen)
        order.append(source)

    def _children(self, source):
        """[(nodes.Source, its share)] of a Mix or Add Shader, those of no weight left out."""
        node, groups = source.node, source.groups
        if node.bl_idname == "ShaderNodeAddShader":
            sockets, shares = node.inputs[:2], (1.0, 1.0)
        else:
            factor = self._saturated(self.input(node.inputs[0], source))
            sockets, shares = node.inputs[1:3], (self.rest(factor), factor)
        children = ((nodes.linked(socket, groups), share) for socket, share in zip(sockets, shares))
        return [(child, share) for child, share in children if child is not None and share != 0]

    def _saturated(self, value):
        if isinstance(value, dict):
            return self.graph.op("clamp", {"value": value}, "value")
        return min(max(value, 0.0), 1.0)

    def rest(self, share):
        """What a share leaves of 1."""
        return 1.0 - share if not isinstance(share, dict) else self._math("subtract", 1.0, share)

    def times(self, first, second):
        """Product of two numbers or references."""
        for one, other in ((first, second), (second, first)):
            if one == 1:
                return other
        are_numbers = not isinstance(first, dict) and not isinstance(second, dict)
        return first * second if are_numbers else self._math("multiply", first, second)

    def _plus(self, first, second):
        if first == 0:
            return second
        are_numbers = not isinstance(first, dict) and not isinstance(second, dict)
        return first + second if are_numbers else self._math("add", first, second)

    def _math(self, operation, a, b):
        return self.graph.op("math", {"a": a, "b": b}, "value", operation=operation)

    def add(self, kind, weight, **values):
        """Adds a closure; what is None is left out, and so is a weight of 1."""
        closure = {"type": kind}
        if weight != 1:
            closure["weight"] = weight
        closure.update((name, value) for name, value in values.items() if value is not None)
        self.closures.append(closure)

    def input(self, socket, source):
        """Number, numbers or reference of a node's input; its own value where its graph is not understood."""
        try:
            return self.graph.value(socket, source.groups)
        except NotUnderstood as error:
            value = nodes.finite(nodes.own_value(socket), socket.name, lambda *_: None)
            value = nodes.as_number(value) if socket.type == "VALUE" else list(nodes.as_color(value))
            shown = [round(v, 4) for v in value] if isinstance(value, list) else round(value, 4)
            self._fail(source, f"{error} as {socket.name}", f"the value {shown} was used", error)
            return value

    def inputs(self, source, names):
        """Values by our names.

        @param  names  ours by Blender's; normals and tangents are known by them, and what a version lacks is left out
        """
        out = {}
        for theirs, ours in names.items():
            socket = source.node.inputs.get(theirs)
            if socket is None:
                continue
            if theirs.endswith("Normal"):
                out[ours] = self._bent_normal(socket, source)
            else:
                out[ours] = self.input(socket, source)
        return out

    def _bent_normal(self, socket, source):
        """Reference to a Normal input; None: it is the surface's own."""
        try:
            reference = self.graph.normal(*self._past_bump(socket, source.groups))
        except NotUnderstood as error:
            self._fail(source, f"{error} as normal", "the surface's own normal was used", error)
            return None
        # What a displacement bumps stands beside the closures.
        return None if reference == self.graph.own_normal else reference

    def anisotropy(self, source, names):
        """Anisotropy, its turn and the tangent of a node, unless it is none.

        @param  names  Blender's of the first two; our own by them
        """
        node, groups = source.node, source.groups
        amount, turn = names
        if amount not in node.inputs or self.graph.constant(node.inputs[amount], groups) == 0:
            return {}
        values = self.inputs(source, names)
        tangent = nodes.linked(node.inputs["Tangent"], groups)
        if tangent is not None:
            values["tangent"] = self._tangent(node.inputs["Tangent"], source)
        else:
            self.graph.uses_generated = True
            values["tangent"] = self.graph.op("tangent", {}, "tangent", direction="radial-z")
        return values

    def _tangent(self, socket, source):
        try:
            return self.graph.normal(socket, source.groups)
        except NotUnderstood as error:
            self._fail(source, f"{error} as tangent", "that of the mesh was used", error)
            return None

    def emit(self, source, color, strength, weight):
        """Adds emission.

        @param  color, strength  input sockets of the nodes.Source
        """
        groups = source.groups
        if self.graph.constant(strength, groups) == 0 or self.graph.constant(color, groups) == [0, 0, 0]:
            return
        plain = None
        if not isinstance(weight, dict):
            plain = _unless_refused(lambda textures: scaled(_plain_emission(color, strength, groups, textures), weight))
        self._emitters.append((plain, (source, color, strength), weight))

    def _shine(self, source, weight):
        """A value in place of a shader is emitted."""
        node = source.node
        if node.bl_idname in {"ShaderNodeRGB", "ShaderNodeValue"} and not isinstance(weight, dict):
            plain = Input(tuple(weight * c for c in nodes.as_color(nodes.own_value(source.socket))))
            if min(plain.value) < 0:
                self.add("emission", 1, color=list(plain.value))
            else:
                self._emitters.append((plain, None, weight))
            return
        try:
            self.add("emission", weight, color=self.graph.output(source))
        except NotUnderstood as error:
            self._fail(source, f"{error} as surface", "a black surface was used", error)

    def _add_emission(self):
        """Emission that no graph gives is the core's: all constants, or else one image."""
        plain = [p for p, _, _ in self._emitters if p is not None]
        kept = [p for p in plain if p.is_constant()] or plain[:1]
        for radiance, node, weight in self._emitters:
            if not any(radiance is k for k in kept):
                source, color, strength = node
                self.add("emission", weight, color=self.input(color, source), strength=self.input(strength, source))
        if kept:
            total = tuple(sum(channels) for channels in zip(*(k.value for k in kept)))
            self.emission = replace(kept[0], value=total)

    def with_alpha(self, source, socket, weight):
        """What an Alpha input leaves of a weight; the rest is transparent."""
        alpha = self._saturated(self.input(socket, source))
        if alpha == 1:
            return weight
        self.add("transparent", self.times(weight, self.rest(alpha)))
        return self.times(weight, alpha)

    def unread(self, source, what, instead):
        """Tells of a part of a node that the format cannot say."""
        self._fail(source, f'node "{source.node.name}": {what}', instead)


_COMBINATIONS = {"ShaderNodeMixShader", "ShaderNodeAddShader"}

_DISTRIBUTIONS = {
    "GGX": "ggx",
    "MULTI_GGX": "multiscatter-ggx",
    "BECKMANN": "beckmann",
    "ASHIKHMIN_SHIRLEY": "ashikhmin-shirley",
    "SHARP": "sharp",
}

#: What closures say of their version: many mean something of its own, and all take bent normals as it does.
_MATHS = {} if compat.MATHS == "3.4" else {"maths": compat.MATHS}


def _distribution(node):
    return _DISTRIBUTIONS.get(getattr(node, "distribution", None))


def _microfacets(w, node, values):
    """The roughness and distribution of gloss and glass. Up to 3.6 Cycles has others for constant roughnesses: where it
    filters, sharp ones are microfacets, which can be blurred, else those without roughness are sharp."""
    roughness, distribution = values["roughness"], _distribution(node)
    if compat.MATHS == "3.4" and not isinstance(roughness, dict):
        if w.filters_glossy and distribution == "sharp":
            roughness, distribution = 0.0, "ggx"
        elif not w.filters_glossy and roughness <= _SHARP:
            distribution = "sharp"
    return {"roughness": roughness, "distribution": distribution}


def _diffuse(w, source, weight):
    values = w.inputs(source, {"Color": "color", "Roughness": "roughness", "Normal": "normal"})
    w.add("diffuse", weight, **values, **_MATHS)


def _translucent(w, source, weight):
    w.add("translucent", weight, **w.inputs(source, {"Color": "color", "Normal": "normal"}), **_MATHS)


def _transparent(w, source, weight):
    w.add("transparent", weight, **w.inputs(source, {"Color": "color"}))


def _emission(w, source, weight):
    w.emit(source, source.node.inputs["Color"], source.node.inputs["Strength"], weight)


def _holdout(w, source, weight):
    w.add("holdout", weight)


def _glossy(w, source, weight):
    values = w.inputs(source, {"Color": "color", "Roughness": "roughness", "Normal": "normal"})
    values.update(w.anisotropy(source, {"Anisotropy": "anisotropy", "Rotation": "rotation"}))
    w.add("glossy", weight, **{**values, **_microfacets(w, source.node, values)}, **_MATHS)


def _glass_like(kind):
    def write(w, source, weight):
        names = {"Color": "color", "Roughness": "roughness", "IOR": "ior", "Normal": "normal"}
        names.update({"Thin Film Thickness": "thinFilmThickness", "Thin Film IOR": "thinFilmIor"})
        w.transmits = True
        values = w.inputs(source, names)
        w.add(kind, weight, **{**values, **_microfacets(w, source.node, values)}, **_MATHS)

    return write


def _metallic(w, source, weight):
    """The Metallic BSDF, which came with 4.3."""
    node = source.node
    is_f82 = node.fresnel_type == "F82"
    names = {"Roughness": "roughness", "Normal": "normal"}
    names.update(
        {"Base Color": "baseColor", "Edge Tint": "edgeTint"} if is_f82 else {"IOR": "ior", "Extinction": "extinction"}
    )
    names.update({"Thin Film Thickness": "thinFilmThickness", "Thin Film IOR": "thinFilmIor"})  # since 5.0
    values = w.inputs(source, names)
    values.update(w.anisotropy(source, {"Anisotropy": "anisotropy", "Rotation": "rotation"}))
    fresnel = "f82" if is_f82 else "physical"
    w.add("metallic", weight, **values, fresnel=fresnel, distribution=_distribution(node), **_MATHS)


def _velvet(w, source, weight):
    w.add("velvet", weight, **w.inputs(source, {"Color": "color", "Sigma": "sigma", "Normal": "normal"}))


def _sheen(w, source, weight):
    """The Sheen BSDF of 4.0, one of whose kinds is the Velvet BSDF of before."""
    is_velvet = source.node.distribution == "ASHIKHMIN"
    names = {"Color": "color", "Roughness": "sigma" if is_velvet else "roughness", "Normal": "normal"}
    w.add("velvet" if is_velvet else "sheen", weight, **w.inputs(source, names), **_MATHS)


def _toon(w, source, weight):
    values = w.inputs(source, {"Color": "color", "Size": "size", "Smooth": "smooth", "Normal": "normal"})
    w.add("toon", weight, **values, component=source.node.component.lower(), **_MATHS)


def _subsurface(w, source, weight):
    names = ("Color", "Radius", "Scale", "Roughness", "Anisotropy", "Normal")
    values = w.inputs(source, {**{name: name.lower() for name in names}, "IOR": "ior"})
    w.add("subsurface", weight, **values, method=compat.SUBSURFACE_METHODS[source.node.falloff], **_MATHS)


def _hair(w, source, weight):
    names = {"Color": "color", "Offset": "offset", "RoughnessU": "roughnessU", "RoughnessV": "roughnessV"}
    values = w.inputs(source, names)
    tangent = nodes.linked(source.node.inputs["Tangent"], source.groups)
    if tangent is not None:
        values["tangent"] = w.input(source.node.inputs["Tangent"], source)
    w.add("hair", weight, **values, component=source.node.component.lower())


#: Names of the Principled Hair BSDF's inputs in the file.
_FIBRE_INPUTS = {
    "Color": "color",
    "Melanin": "melanin",
    "Melanin Redness": "melaninRedness",
    "Tint": "tint",
    "Absorption Coefficient": "absorption",
    "Roughness": "roughness",
    "Radial Roughness": "radialRoughness",
    "Coat": "coat",
    "IOR": "ior",
    "Offset": "offset",
    "Random Color": "randomColor",
    "Random Roughness": "randomRoughness",
}


#: The same of its model "Huang".
_FACET_FIBRE_INPUTS = {
    **{theirs: ours for theirs, ours in _FIBRE_INPUTS.items() if theirs not in {"Radial Roughness", "Coat"}},
    "Aspect Ratio": "aspect",
    "Reflection": "reflection",
    "Transmission": "transmission",
    "Secondary Reflection": "secondaryReflection",
}


def _fibre(w, source, weight):
    node = source.node
    is_of_facets = getattr(node, "model", "CHIANG") == "HUANG"
    values = w.inputs(source, _FACET_FIBRE_INPUTS if is_of_facets else _FIBRE_INPUTS)
    if is_of_facets:
        values["model"] = "huang"
        if values["aspect"] != 1:
            axis, is_met = strand_ellipse(w.graph, values["aspect"])
            values["normal"] = axis
            w.add("transparent", w.times(weight, w.rest(is_met)))
            weight = w.times(weight, is_met)
    random = node.inputs.get("Random")
    if random is not None and nodes.linked(random, source.groups) is not None:
        values["random"] = w.input(random, source)
    else:
        values["random"] = mesh_attribute(w.graph, "hair", "random", "value")
    w.add("fibre", weight, **values, pigment=node.parametrization.lower())


def _colored(what):
    """Writer of a node of which the colour alone is taken."""

    def write(w, source, weight):
        w.unread(source, what, "a diffuse surface of its colour was used")
        names = {"Color": "color", "Base Color": "color", "Normal": "normal"}
        w.add("diffuse", weight, **w.inputs(source, names), **_MATHS)

    return write


def _volume(w, source, weight):
    w.unread(source, "a volume as surface", "nothing is there, as in Cycles")


def _portal(w, source, weight):
    w.unread(source, "a portal for rays", "a transparent surface of its colour was used")
    w.add("transparent", weight, **w.inputs(source, {"Color": "color"}))


def _principled(w, source, weight):
    node, groups = source.node, source.groups

    def socket(name):
        return compat.principled_socket(node, name)

    weight = w.with_alpha(source, socket("Alpha"), weight)
    if weight == 0:
        return
    w.emit(source, socket("Emission"), socket("Emission Strength"), weight)
    wall = node.inputs.get("Thin Wall")  # since 5.2
    if wall is not None and w.graph.constant(wall, groups) != 0:
        w.unread(source, "a thin wall", "what bounds a solid was used")
    if w.graph.constant(socket("Transmission"), groups) != 0:
        w.transmits = True
    values = w.inputs(source, compat.PRINCIPLED_INPUTS)
    values.update(w.anisotropy(source, {"Anisotropic": "anisotropic", "Anisotropic Rotation": "anisotropicRotation"}))
    if w.graph.constant(socket("Subsurface"), groups) != 0:
        values.update(w.inputs(source, compat.SUBSURFACE_INPUTS))
        values["subsurfaceMethod"] = compat.SUBSURFACE_METHODS[node.subsurface_method]
    w.add("principled", weight, **values, distribution=_distribution(node), maths=compat.MATHS)


_NODES = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfMetallic": _metallic,
    "ShaderNodeBsdfGlass": _glass_like("glass"),
    "ShaderNodeBsdfRefraction": _glass_like("refraction"),
    "ShaderNodeBsdfTranslucent": _translucent,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeBsdfVelvet": _velvet,
    "ShaderNodeBsdfSheen": _sheen,
    "ShaderNodeBsdfToon": _toon,
    "ShaderNodeSubsurfaceScattering": _subsurface,
    "ShaderNodeBsdfHair": _hair,
    "ShaderNodeBsdfHairPrincipled": _fibre,
    "ShaderNodeEeveeSpecular": _colored("a shader of Eevee's alone"),
    "ShaderNodeBsdfRayPortal": _portal,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeHoldout": _holdout,
    "ShaderNodeVolumeAbsorption": _volume,
    "ShaderNodeVolumeScatter": _volume,
    "ShaderNodeVolumePrincipled": _volume,
    "ShaderNodeVolumeCoefficients": _volume,
}


def knows(node):
    """Whether a shader node can be written."""
    return node.bl_idname in _NODES or node.bl_idname in _COMBINATIONS
