# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's value nodes as RELIEF_graph, one to one: an input that varies in a way that no texture can say.

One function a kind of node, listed at the end with the names of its outputs. The program does the mathematics
(docs/graphs.md); what is said here is which socket is which, and what an unlinked one means.
"""

from .. import compat
from . import nodes
from .graph_inputs import OUTPUTS, mesh_attribute

#: Entries of the tables that stand for ramps and curves: as many as Cycles'.
_TABLE = 256


class NotUnderstood(Exception):
    """A node that graphs do not know; its text names it."""


class GraphWriter:
    """Collects the nodes of one material's graph.

    @param  coordinate_set  gives the number, 0 or 1, of the set that a ("uv", name) is in; None: no room for it
    @param  texture         gives glTF's reference to an Image Texture node's image, and whether it is stored as sRGB; None
                            without a file
    @param  material_index  Pass Index of the material
    @param  view_layer      gives the things whose properties are the view layer's attributes, the first one first
    nodes          JSON of the nodes so far
    outputs        JSON of what the graph gives
    uses_generated whether meshes need _GENERATED
    attributes     attributes of meshes that are read: see attributes.py
    values         values of objects that are read: see instance_values.py
    """

    def __init__(self, coordinate_set, texture, material_index=0, view_layer=tuple):
        self.coordinate_set = coordinate_set
        self.texture = texture
        self.nodes = []
        self.outputs = {}
        self.uses_generated = False
        self.material_index = material_index
        self.view_layer = view_layer
        self.attributes = []
        self.values = []
        self._known = {}

    def value(self, socket, groups=()):
        """An input as graphs have it: numbers, or a reference.

        @error  NotUnderstood
        """
        source = nodes.follow(socket, groups)
        constant = nodes.fold(socket, groups)
        if constant is not None:
            finite = nodes.finite(constant, socket.name, lambda *_: None)
            return list(finite[:3]) if isinstance(finite, tuple) else finite
        return self.output(source)

    def output(self, source):
        """Reference to what a nodes.Source gives."""
        node = source.node
        if node.bl_idname in OUTPUTS:
            return OUTPUTS[node.bl_idname](self, source)
        write, names = _NODES.get(node.bl_idname, (None, {}))
        name = names.get(source.socket.identifier, names.get(source.socket.name))
        if write is None or name is None:
            raise NotUnderstood(f'node "{node.name}" ({node.bl_label}), {source.socket.name}')
        key = (node.as_pointer(), tuple(group.as_pointer() for group in source.groups))
        if key not in self._known:
            self._known[key] = write(self, node, source.groups)
        index = self._known[key]
        return {"node": index, "output": name}

    def add(self, kind, inputs=None, **options):
        """Adds a node; equal ones become one.

        @return  its index
        """
        json = {"type": kind, **{k: v for k, v in options.items() if v is not None}}
        if inputs:
            json["inputs"] = inputs
        if json in self.nodes:
            return self.nodes.index(json)
        self.nodes.append(json)
        return len(self.nodes) - 1

    def inputs(self, node, groups, names):
        """Inputs of a node by our names.

        @param  names  our name by Blender's, or by the number of the socket
        """
        out = {}
        for theirs, ours in names.items():
            socket = node.inputs[theirs] if isinstance(theirs, int) else node.inputs.get(theirs)
            if socket is not None:
                out[ours] = self.value(socket, groups)
        return out

    def vector(self, node, groups, implicit):
        """A texture's Vector, or what Blender takes where nothing is linked: generated or uv."""
        socket = node.inputs["Vector"]
        if nodes.follow(socket, groups) is not None:
            return self.value(socket, groups)
        if implicit == "generated":
            self.uses_generated = True
            return {"node": self.add("texture-coordinate"), "output": "generated"}
        return self.uv("")

    def uv(self, name):
        number = self.coordinate_set(("uv", name))
        if number is None:
            return mesh_attribute(self, "uv", name, "vector")
        return {"node": self.add("texture-coordinate"), "output": "uv1" if number else "uv"}

    def scaled(self, reference, factor, is_color):
        """A value times a number, or times a colour."""
        if is_color:
            if tuple(factor) == (1.0, 1.0, 1.0):
                return reference
            inputs = {"factor": 1.0, "a": reference, "b": list(factor)}
            return {"node": self.add("mix-color", inputs, blend="multiply"), "output": "color"}
        if factor == 1.0:
            return reference
        return {"node": self.add("math", {"a": reference, "b": factor}, operation="multiply"), "output": "value"}

    def shifted(self, reference, offset):
        if offset == 0.0:
            return reference
        return {"node": self.add("math", {"a": reference, "b": offset}, operation="add"), "output": "value"}


def _label(name):
    """Blender's name of a choice as graphs spell it."""
    return name.lower().replace("_", "-")


def _choice(node, value, labels):
    """A choice by Blender's name.

    @error  NotUnderstood
    """
    if value not in labels:
        raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): {_label(value)}')
    return labels[value]


_DIMENSIONS = {"1D": 1, "2D": 2, "3D": 3, "4D": 4}


def _point(g, node, groups):
    """Inputs and options of a texture over 1 to 4 dimensions."""
    dimensions = _DIMENSIONS[node.noise_dimensions]
    inputs = {"vector": g.vector(node, groups, "generated")} if dimensions > 1 else {}
    if dimensions in {1, 4}:
        inputs["w"] = g.value(node.inputs["W"], groups)
    return inputs, dimensions


def _noise(g, node, groups):
    if getattr(node, "noise_type", "FBM") != "FBM":
        raise NotUnderstood(f'node "{node.name}": type {_label(node.noise_type)}')
    inputs, dimensions = _point(g, node, groups)
    names = {"Scale": "scale", "Detail": "detail", "Roughness": "roughness", "Lacunarity": "lacunarity"}
    inputs.update(g.inputs(node, groups, {**names, "Distortion": "distortion"}))
    if compat.CLAMPS_NOISE_ROUGHNESS:
        inputs["roughness"] = _clamped(g, inputs["roughness"])
    return g.add("noise-texture", inputs, dimensions=dimensions, normalize=getattr(node, "normalize", True))


def _clamped(g, value):
    if isinstance(value, dict):
        return {"node": g.add("clamp", {"value": value}), "output": "value"}
    return min(max(value, 0.0), 1.0)


def _white_noise(g, node, groups):
    dimensions = _DIMENSIONS[node.noise_dimensions]
    inputs = {"vector": g.value(node.inputs["Vector"], groups)} if dimensions > 1 else {}
    if dimensions in {1, 4}:
        inputs["w"] = g.value(node.inputs["W"], groups)
    return g.add("white-noise-texture", inputs, dimensions=dimensions)


def _image(g, node, groups):
    if node.projection != "FLAT" or node.extension == "CLIP" or node.interpolation in {"Cubic", "Smart"}:
        raise NotUnderstood(f'node "{node.name}": a projection, extension or interpolation of its own')
    if node.image is None:
        magenta = {"red": 1.0, "green": 0.0, "blue": 1.0}
        return g.add("combine-color", magenta)
    found = g.texture(node)
    if found is None:
        raise NotUnderstood(f'node "{node.name}": an image without file')
    info, is_srgb = found
    vector = g.vector(node, groups, "uv")
    space = "srgb" if is_srgb else "linear"
    return g.add("image-texture", {"vector": vector}, texture=info, colorSpace=space)


_VORONOI = {
    "F1": "f1",
    "F2": "f2",
    "SMOOTH_F1": "smooth-f1",
    "DISTANCE_TO_EDGE": "distance-to-edge",
    "N_SPHERE_RADIUS": "n-sphere-radius",
}


def _voronoi(g, node, groups):
    if compat.IS_5_0:
        raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): the cells of 5.0')
    node_detail = node.inputs.get("Detail")
    if node_detail is not None and nodes.fold(node_detail, groups) != 0.0 or getattr(node, "normalize", False):
        raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): detail or normalisation')
    dimensions = _DIMENSIONS[node.voronoi_dimensions]
    inputs = {"vector": g.vector(node, groups, "generated")} if dimensions > 1 else {}
    if dimensions in {1, 4}:
        inputs["w"] = g.value(node.inputs["W"], groups)
    names = {"Scale": "scale", "Smoothness": "smoothness", "Exponent": "exponent", "Randomness": "randomness"}
    inputs.update(g.inputs(node, groups, names))
    feature = _choice(node, node.feature, _VORONOI)
    return g.add("voronoi-texture", inputs, dimensions=dimensions, feature=feature, metric=_label(node.distance))


def _musgrave(g, node, groups):
    dimensions = _DIMENSIONS[node.musgrave_dimensions]
    inputs = {"vector": g.vector(node, groups, "generated")} if dimensions > 1 else {}
    if dimensions in {1, 4}:
        inputs["w"] = g.value(node.inputs["W"], groups)
    names = {"Scale": "scale", "Detail": "detail", "Dimension": "dimension", "Lacunarity": "lacunarity"}
    inputs.update(g.inputs(node, groups, {**names, "Offset": "offset", "Gain": "gain"}))
    return g.add("musgrave-texture", inputs, dimensions=dimensions, musgrave=_label(node.musgrave_type))


def _brick(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    names = {"Color1": "color1", "Color2": "color2", "Mortar": "mortar", "Scale": "scale", "Mortar Size": "mortarSize"}
    names.update({"Mortar Smooth": "mortarSmooth", "Bias": "bias", "Brick Width": "brickWidth", "Row Height": "rowHeight"})
    inputs.update(g.inputs(node, groups, names))
    return g.add(
        "brick-texture",
        inputs,
        offset=node.offset,
        offsetFrequency=node.offset_frequency,
        squash=node.squash,
        squashFrequency=node.squash_frequency,
    )


def _gradient(g, node, groups):
    kinds = {
        "LINEAR": "linear",
        "QUADRATIC": "quadratic",
        "EASING": "easing",
        "DIAGONAL": "diagonal",
        "RADIAL": "radial",
        "QUADRATIC_SPHERE": "quadratic-sphere",
        "SPHERICAL": "spherical",
    }
    kind = _choice(node, node.gradient_type, kinds)
    return g.add("gradient-texture", {"vector": g.vector(node, groups, "generated")}, gradient=kind)


def _checker(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    inputs.update(g.inputs(node, groups, {"Color1": "color1", "Color2": "color2", "Scale": "scale"}))
    return g.add("checker-texture", inputs)


def _magic(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    inputs.update(g.inputs(node, groups, {"Scale": "scale", "Distortion": "distortion"}))
    return g.add("magic-texture", inputs, depth=node.turbulence_depth)


def _wave(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    names = {"Scale": "scale", "Distortion": "distortion", "Detail": "detail", "Detail Scale": "detailScale"}
    names.update({"Detail Roughness": "detailRoughness", "Phase Offset": "phaseOffset"})
    inputs.update(g.inputs(node, groups, names))
    if compat.CLAMPS_NOISE_ROUGHNESS:
        inputs["detailRoughness"] = _clamped(g, inputs["detailRoughness"])
    are_rings = node.wave_type == "RINGS"
    direction = node.rings_direction if are_rings else node.bands_direction
    return g.add(
        "wave-texture",
        inputs,
        wave="rings" if are_rings else "bands",
        direction=_label(direction),
        profile=_choice(node, node.wave_profile, {"SIN": "sine", "SAW": "saw", "TRI": "triangle"}),
    )


def _ramp(g, node, groups):
    table = [c for i in range(_TABLE) for c in node.color_ramp.evaluate(i / (_TABLE - 1))]
    interpolated = node.color_ramp.interpolation != "CONSTANT"
    inputs = g.inputs(node, groups, {0: "factor"})
    return g.add("color-ramp", inputs, table=table, interpolate=interpolated)


def _curve_table(mapping, curves, combined=None):
    """Options of curves: their tables over the range that they are drawn in.

    @param  curves    one or three CurveMap
    @param  combined  CurveMap that values pass before; None: none
    """
    mapping.initialize()
    ends = [point.location[0] for curve in (*curves, *([combined] if combined else [])) for point in curve.points]
    low, high = min(ends), max(ends)
    table = []
    for i in range(_TABLE):
        x = low + (high - low) * i / (_TABLE - 1)
        if combined is not None:
            x = mapping.evaluate(combined, x)
        table.extend(mapping.evaluate(curve, x) for curve in curves)
    return {"table": table, "min": low, "max": high, "extrapolate": mapping.extend == "EXTRAPOLATED"}


def _rgb_curves(g, node, groups):
    inputs = g.inputs(node, groups, {0: "factor", "Color": "color"})
    curves = node.mapping.curves
    return g.add("color-curves", inputs, **_curve_table(node.mapping, curves[:3], curves[3]))


def _vector_curves(g, node, groups):
    inputs = g.inputs(node, groups, {0: "factor", "Vector": "vector"})
    return g.add("vector-curves", inputs, **_curve_table(node.mapping, node.mapping.curves[:3]))


def _float_curve(g, node, groups):
    inputs = g.inputs(node, groups, {0: "factor", "Value": "value"})
    return g.add("number-curve", inputs, **_curve_table(node.mapping, node.mapping.curves[:1]))


_BLENDS = (
    "MIX DARKEN MULTIPLY BURN LIGHTEN SCREEN DODGE ADD OVERLAY SOFT_LIGHT LINEAR_LIGHT DIFFERENCE EXCLUSION SUBTRACT DIVIDE"
    " HUE SATURATION COLOR VALUE"
).split()


def _mix_rgb(g, node, groups):
    """The node of before 3.4."""
    inputs = g.inputs(node, groups, {0: "factor", 1: "a", 2: "b"})
    blend = _choice(node, node.blend_type, {name: _label(name) for name in _BLENDS})
    return g.add("mix-color", inputs, blend=blend, clampResult=node.use_clamp)


def _mix(g, node, groups):
    shown = {socket.name: socket for socket in node.inputs if socket.enabled}
    inputs = {ours: g.value(shown[theirs], groups) for theirs, ours in (("Factor", "factor"), ("A", "a"), ("B", "b"))}
    if node.data_type == "RGBA":
        blend = _choice(node, node.blend_type, {name: _label(name) for name in _BLENDS})
        return g.add("mix-color", inputs, blend=blend, clampFactor=node.clamp_factor, clampResult=node.clamp_result)
    kind = {"FLOAT": "mix-number", "VECTOR": "mix-vector"}
    return g.add(_choice(node, node.data_type, kind), inputs, clampFactor=node.clamp_factor)


def _simple(kind, names, **options):
    """Writer of a node that is the same here, but for the names of its inputs.

    @param  options  attributes of Blender's node by the names of ours
    """

    def write(g, node, groups):
        values = {ours: _label(getattr(node, theirs)) for ours, theirs in options.items()}
        return g.add(kind, g.inputs(node, groups, names), **values)

    return write


def _clamp(g, node, groups):
    inputs = g.inputs(node, groups, {"Value": "value", "Min": "min", "Max": "max"})
    return g.add("clamp", inputs, clamp="range" if node.clamp_type == "RANGE" else "min-max")


def _map_range(g, node, groups):
    is_vector = getattr(node, "data_type", "FLOAT") == "FLOAT_VECTOR"
    shown = {socket.name: socket for socket in node.inputs if socket.enabled}
    names = {"From Min": "fromMin", "From Max": "fromMax", "To Min": "toMin", "To Max": "toMax", "Steps": "steps"}
    names["Vector" if is_vector else "Value"] = "vector" if is_vector else "value"
    inputs = {ours: g.value(shown[theirs], groups) for theirs, ours in names.items() if theirs in shown}
    return g.add(
        "map-range-vector" if is_vector else "map-range",
        inputs,
        interpolation=_label(node.interpolation_type),
        clamp=node.clamp,
    )


#: Blender's names of operations, where ours are not the same in small letters.
_OPERATIONS = {
    "LOGARITHM": "logarithm",
    "SQRT": "square-root",
    "INVERSE_SQRT": "inverse-square-root",
    "SMOOTH_MIN": "smooth-minimum",
    "SMOOTH_MAX": "smooth-maximum",
    "TRUNC": "truncate",
    "FRACT": "fraction",
    "PINGPONG": "ping-pong",
    "ARCTAN2": "arctangent2",
    "CROSS_PRODUCT": "cross",
    "DOT_PRODUCT": "dot",
}


def _math(g, node, groups):
    operation = _OPERATIONS.get(node.operation, _label(node.operation))
    inputs = {name: g.value(socket, groups) for name, socket in zip("abc", node.inputs) if socket.enabled}
    return g.add("math", inputs, operation=operation, clamp=node.use_clamp or None)


def _vector_math(g, node, groups):
    operation = _OPERATIONS.get(node.operation, _label(node.operation))
    if operation == "power":
        raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): power')
    inputs = {name: g.value(socket, groups) for name, socket in zip("abc", node.inputs) if socket.enabled}
    if node.operation in {"SCALE", "REFRACT"}:
        inputs["scale"] = g.value(node.inputs["Scale"], groups)
    return g.add("vector-math", inputs, operation=operation)


def _separate_rgb(g, node, groups):
    return g.add("separate-color", g.inputs(node, groups, {0: "color"}), space=_label(getattr(node, "mode", "RGB")))


def _combine_rgb(g, node, groups):
    inputs = g.inputs(node, groups, {0: "red", 1: "green", 2: "blue"})
    return g.add("combine-color", inputs, space=_label(getattr(node, "mode", "RGB")))


def _hue(g, node, groups):
    names = {"Hue": "hue", "Saturation": "saturation", "Value": "value", "Fac": "factor", "Color": "color"}
    if "Factor" in node.inputs:
        names["Factor"] = "factor"
    return g.add("hue-saturation", g.inputs(node, groups, names))


_FACTOR = {"Fac": "factor", "Factor": "factor", "Color": "color"}
_XYZ = {"X": "x", "Y": "y", "Z": "z"}
_RGB = {
    **{"R": "red", "G": "green", "B": "blue"},
    **{"Red": "red", "Green": "green", "Blue": "blue"},
    **{"Hue": "red", "Saturation": "green", "Value": "blue", "Lightness": "blue"},
}

#: What writes a node, and our name of each of its outputs by Blender's.
_NODES = {
    "ShaderNodeTexNoise": (_noise, _FACTOR),
    "ShaderNodeTexWhiteNoise": (_white_noise, {"Value": "value", "Color": "color"}),
    "ShaderNodeTexImage": (_image, {"Color": "color", "Alpha": "alpha"}),
    "ShaderNodeTexGradient": (_gradient, _FACTOR),
    "ShaderNodeTexChecker": (_checker, _FACTOR),
    "ShaderNodeTexMagic": (_magic, _FACTOR),
    "ShaderNodeTexWave": (_wave, _FACTOR),
    "ShaderNodeTexVoronoi": (
        _voronoi,
        {"Distance": "distance", "Color": "color", "Position": "position", "W": "w", "Radius": "radius"},
    ),
    "ShaderNodeTexMusgrave": (_musgrave, _FACTOR),
    "ShaderNodeTexBrick": (_brick, _FACTOR),
    "ShaderNodeRGBCurve": (_rgb_curves, {"Color": "color"}),
    "ShaderNodeVectorCurve": (_vector_curves, {"Vector": "vector"}),
    "ShaderNodeFloatCurve": (_float_curve, {"Value": "value"}),
    "ShaderNodeValToRGB": (_ramp, {"Color": "color", "Alpha": "alpha"}),
    "ShaderNodeMixRGB": (_mix_rgb, {"Color": "color"}),
    "ShaderNodeInvert": (_simple("invert", {0: "factor", "Color": "color"}), {"Color": "color"}),
    "ShaderNodeGamma": (_simple("gamma", {"Color": "color", "Gamma": "gamma"}), {"Color": "color"}),
    "ShaderNodeBrightContrast": (
        _simple("bright-contrast", {"Color": "color", 1: "bright", "Contrast": "contrast"}),
        {"Color": "color"},
    ),
    "ShaderNodeHueSaturation": (_hue, {"Color": "color"}),
    "ShaderNodeSeparateColor": (_separate_rgb, _RGB),
    "ShaderNodeSeparateRGB": (_separate_rgb, _RGB),
    "ShaderNodeCombineColor": (_combine_rgb, {"Color": "color"}),
    "ShaderNodeCombineRGB": (_combine_rgb, {"Image": "color"}),
    "ShaderNodeRGBToBW": (_simple("rgb-to-bw", {"Color": "color"}), {"Val": "value"}),
    "ShaderNodeSeparateXYZ": (_simple("separate", {"Vector": "vector"}), _XYZ),
    "ShaderNodeCombineXYZ": (_simple("combine", {"X": "x", "Y": "y", "Z": "z"}), {"Vector": "vector"}),
    "ShaderNodeClamp": (_clamp, {"Result": "value"}),
    "ShaderNodeMapRange": (_map_range, {"Result": "value", "Vector": "vector"}),
    "ShaderNodeMapping": (
        _simple(
            "mapping",
            {"Vector": "vector", "Location": "location", "Rotation": "rotation", "Scale": "scale"},
            mapping="vector_type",
        ),
        {"Vector": "vector"},
    ),
    "ShaderNodeMath": (_math, {"Value": "value"}),
    "ShaderNodeVectorMath": (_vector_math, {"Vector": "vector", "Value": "value"}),
    "ShaderNodeMix": (
        _mix,
        {"Result_Color": "color", "Result_Vector": "vector", "Result_Float": "value"},
    ),
}
