# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's value nodes as RELIEF_graph, one to one: an input that varies in a way that no texture can say.

One function a kind of node, listed at the end with the names of its outputs. The program does the mathematics
(docs/graphs.md); what is said here is which socket is which, and what an unlinked one means.
"""

from json import dumps

from .. import compat
from . import color_space, nodes
from .graph_inputs import OUTPUTS, image_of_nothing, mesh_attribute, tangent_set, transformed_normal
from .image import is_missing
from .not_understood import NotUnderstood


#: Nodes of other engines alone: Cycles cuts what is linked to them.
_NOT_IN_CYCLES = {"ShaderNodeShaderToRGB", "ShaderNodeUVAlongStroke"}


class GraphWriter:
    """Collects the nodes of one material's graph.

    @param  coordinate_set  gives the number, 0 or 1, of the set that a ("uv", name) is in; None: no room for it
    @param  texture         gives the options of image-texture and environment-texture that say which image a node reads;
                            None without a file
    @param  ies             gives the URI of what an IES Texture node reads; None: nothing
    @param  warn            called with what a value is, if it is no number, and what was used instead
    @param  material_index  Pass Index of the material
    @param  view_layer      gives the things whose properties are the view layer's attributes, the first one first
    @param  moment          (frame, seconds) that the scene is at
    @param  occlusion_distance  in metres, of Ambient Occlusion nodes whose own is 0
    nodes          JSON of the nodes so far
    uses_generated whether meshes need _GENERATED
    uses_tangents  whether tangents along the uv map that is active in renders are read
    attributes     attributes of meshes that are read: see attributes.py
    values         values of objects that are read: see instance_values.py
    own_normal     reference to the surface's normal as a displacement bumps it; None: it is the mesh's
    displaces      whether the material moves the surface whose graph this is
    not_understood texts by the keys of the nodes that they are about
    """

    def __init__(
        self,
        coordinate_set,
        texture,
        ies,
        warn=lambda what, instead: None,
        material_index=0,
        view_layer=tuple,
        moment=(0.0, 0.0),
        occlusion_distance=0.0,
    ):
        self.coordinate_set = coordinate_set
        self.texture = texture
        self.ies = ies
        self.warn = warn
        self.nodes = []
        self.uses_generated = self.uses_tangents = False
        self.voxels = None
        self.material_index = material_index
        self.view_layer = view_layer
        self.moment = moment
        self.occlusion_distance = occlusion_distance
        self.attributes = []
        self.values = []
        self.own_normal = None
        self.displaces = False
        self.not_understood = {}
        self._indices = {}
        self._known = {}
        self._folded = {}

    def constant(self, socket, groups=()):
        """An input's number or list, finite and of the socket's type; None if it varies."""
        value = nodes.fold(socket, groups, self._folded)
        return None if value is None else self._number_or_color(value, socket)

    def _number_or_color(self, value, socket):
        value = nodes.finite(value, socket.name, self.warn)
        if socket.type in {"VALUE", "INT", "BOOLEAN"}:
            return nodes.as_number(value)
        return list(nodes.as_color(value))

    def value(self, socket, groups=()):
        """An input as graphs have it: numbers, or a reference.

        @error  NotUnderstood
        """
        constant = self.constant(socket, groups)
        if constant is not None:
            return constant
        source = nodes.follow(socket, groups)
        found = self.output(source)
        return self.grey(found) if socket.type == "VALUE" and source.socket.type == "RGBA" else found

    def grey(self, color):
        """The luminance of a reference to a colour, which where it is that of Rec. 709 is what numbers take of colours."""
        weights = color_space.luminance_weights()
        if weights == color_space.REC709_WEIGHTS or not isinstance(color, dict):
            return color
        return self.op("vector-math", {"a": color, "b": list(weights)}, "value", operation="dot")

    def made_color(self, color):
        """A reference to a colour that the program makes itself, in Blender's working space."""
        matrix = color_space.scene_linear_from_rec709()
        if matrix is None:
            return color
        rows = [self.op("vector-math", {"a": color, "b": row}, "value", operation="dot") for row in matrix.tolist()]
        return self.op("combine", dict(zip("xyz", rows)), "vector")

    def normal(self, socket, groups=()):
        """Reference to a Normal input, in the world; None: nothing is linked, and the surface has the mesh's own.

        @error  NotUnderstood
        """
        source = self._normal_source(nodes.linked(socket, groups))
        if source is None:
            return self.own_normal
        constant = self.constant(socket, groups)
        if constant is None:
            return self.output(source)
        return self.op("combine", dict(zip("xyz", constant)), "vector")

    def bends(self, socket, groups=()):
        """Whether a Normal input has a normal of its own."""
        return self._normal_source(nodes.linked(socket, groups)) is not None

    def _normal_source(self, source):
        """What gives a normal, past Bump nodes whose height is the same everywhere."""
        seen = set()
        while source is not None and source.node.bl_idname == "ShaderNodeBump" and source.key not in seen:
            seen.add(source.key)
            if self.constant(source.node.inputs["Height"], source.groups) is None:
                break
            source = nodes.linked(source.node.inputs["Normal"], source.groups)
        return source

    def output(self, source):
        """Reference to what a nodes.Source gives."""
        node = source.node
        if node.bl_idname == "ShaderNodeBump" and self._normal_source(source) != source:
            return self.normal(node.inputs["Normal"], source.groups) or self.geometry_normal()
        if node.bl_idname == "ShaderNodeNewGeometry" and source.socket.identifier == "Normal":
            return self.own_normal or self.geometry_normal()
        if node.bl_idname in {"ShaderNodeTexImage", "ShaderNodeTexEnvironment"} and node.image is None:
            return image_of_nothing(self, source)
        give = OUTPUTS.get(node.bl_idname)
        write, names = _NODES.get(node.bl_idname, (None, {}))
        name = names.get(source.socket.identifier, names.get(source.socket.name))
        if give is None and (write is None or name is None):
            raise self._failure(source, NotUnderstood(f'node "{node.name}" ({node.bl_label}), {source.socket.name}'))
        key = source.key if give is None else (*source.key, source.socket.identifier)
        if key not in self._known:
            # Stays only if the node depends on itself.
            circle = NotUnderstood(f'node "{node.name}" ({node.bl_label}), which is linked in a circle')
            circle.key = source.key
            self._known[key] = circle
            try:
                self._known[key] = write(self, node, source.groups) if give is None else give(self, source)
            except NotUnderstood as error:
                self._known[key] = self._failure(source, error)
            except RecursionError:
                error = NotUnderstood(f'node "{node.name}": more nodes one after another than can be followed')
                raise self._failure(source, error) from None
        found = self._known[key]
        if isinstance(found, NotUnderstood):
            self.not_understood.setdefault(found.key, str(found))
            raise found
        return {"node": found, "output": name} if give is None else found

    def _failure(self, source, error):
        """Notes which node an error is about: the one that met it first."""
        if error.key is None:
            error.key = source.key
            self.not_understood[source.key] = str(error)
        return error

    def geometry_normal(self):
        return {"node": self.add("geometry"), "output": "normal"}

    def add(self, kind, inputs=None, **options):
        """Adds a node; equal ones become one.

        @return  its index
        """
        json = {"type": kind, **{k: v for k, v in options.items() if v is not None}}
        if inputs:
            json["inputs"] = inputs
        key = dumps(json, sort_keys=True)
        if key not in self._indices:
            self._indices[key] = len(self.nodes)
            self.nodes.append(json)
        return self._indices[key]

    def op(self, kind, inputs, output, **options):
        """Adds a node; returns a reference to one of its outputs."""
        return {"node": self.add(kind, inputs, **options), "output": output}

    def inputs(self, node, groups, names):
        """Inputs of a node by our names.

        @param  names  our name by Blender's, or by the number of the socket
        """
        out, failure = {}, None
        for theirs, ours in names.items():
            socket = node.inputs[theirs] if isinstance(theirs, int) else node.inputs.get(theirs)
            if socket is None:
                continue
            try:
                out[ours] = self.value(socket, groups)
            except NotUnderstood as error:  # the others may have something to tell, too
                if nodes.follow(socket, groups).node.bl_idname in _NOT_IN_CYCLES:
                    self.warn(f"{error} as {socket.name}", "the input's own value was used, as in Cycles")
                    out[ours] = self._number_or_color(nodes.own_value(socket), socket)
                else:
                    failure = failure or error
        if failure is not None:
            raise failure
        return out

    def vector(self, node, groups, implicit):
        """A texture's Vector, or what Blender takes where nothing is linked: generated or uv."""
        # A sky with its sun's disk hides the socket; since 4.3 hidden ones are not found.
        socket = node.inputs.get("Vector")
        if socket is not None and socket.enabled and nodes.linked(socket, groups) is not None:
            return self.mapped(node, self.value(socket, groups))
        return self.mapped(node, self.generated() if implicit == "generated" else self.uv(""))

    def mapped(self, node, vector):
        """A texture's vector after the mapping that the node itself has, in files from before Mapping nodes had sockets."""
        if nodes.has_plain_mapping(node):
            return vector
        mapping = node.texture_mapping
        if mapping.vector_type == "NORMAL" or mapping.use_min or mapping.use_max:
            raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): its own mapping as a normal or with limits')
        axes = [mapping.mapping_x, mapping.mapping_y, mapping.mapping_z]
        if axes != ["X", "Y", "Z"]:
            parts = self.add("separate", {"vector": vector})
            chosen = [0.0 if axis == "NONE" else {"node": parts, "output": axis.lower()} for axis in axes]
            vector = {"node": self.add("combine", dict(zip("xyz", chosen))), "output": "vector"}
        inputs = {"vector": vector, "rotation": list(mapping.rotation), "scale": list(mapping.scale)}
        if mapping.vector_type != "VECTOR":
            inputs["location"] = list(mapping.translation)
        return {"node": self.add("mapping", inputs, mapping=_label(mapping.vector_type)), "output": "vector"}

    def generated(self):
        self.uses_generated = True
        return {"node": self.add("texture-coordinate"), "output": "generated"}

    def coordinate_normal(self):
        """Texture Coordinate's Normal."""
        return {"node": self.add("texture-coordinate"), "output": "normal"}

    def uv(self, name):
        number = self.coordinate_set(("uv", name))
        if number is None:
            return mesh_attribute(self, "uv", name, "vector")
        return {"node": self.add("texture-coordinate"), "output": "uv1" if number else "uv"}


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
    inputs, dimensions = _point(g, node, groups)
    names = {"Scale": "scale", "Detail": "detail", "Roughness": "roughness", "Lacunarity": "lacunarity"}
    names.update({"Offset": "offset", "Gain": "gain"})
    inputs.update(g.inputs(node, groups, {**names, "Distortion": "distortion"}))
    if compat.CLAMPS_NOISE_ROUGHNESS:
        inputs["roughness"] = clamped(g, inputs["roughness"])
    kind = _label(getattr(node, "noise_type", "FBM"))
    return g.add(
        "noise-texture",
        inputs,
        dimensions=dimensions,
        noise=kind if kind != "fbm" else None,
        normalize=getattr(node, "normalize", True),
        maths=compat.TEXTURE_MATHS,
    )


def clamped(g, value):
    """A number or a reference, not below 0 nor above 1."""
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
    options = g.texture(node)
    if options is None:
        raise NotUnderstood(f'node "{node.name}": an image without file')
    if node.projection != "FLAT":
        options["projection"] = _label(node.projection)
    if node.projection == "BOX":
        options["blend"] = node.projection_blend
        if "tiles" in options:  # as Cycles, which reads the first alone
            first = options.pop("tiles")[0]
            options.update({"texture": first["texture"], "colorSpace": first["colorSpace"]})
    if node.extension == "CLIP" and not (compat.MISSING_IS_NOT_CLIPPED and is_missing(node.image)):
        options["clip"] = True
    if node.interpolation in {"Cubic", "Smart"}:
        options["filter"] = "cubic"
    return g.add("image-texture", {"vector": g.vector(node, groups, "uv")}, **options)


def _environment(g, node, groups):
    """An image by direction, which a surface takes from its position unless told."""
    options = g.texture(node)
    if options is None:
        raise NotUnderstood(f'node "{node.name}": an image without file')
    socket = node.inputs["Vector"]
    vector = {"node": g.add("geometry"), "output": "position"}
    if nodes.linked(socket, groups) is not None:
        vector = g.value(socket, groups)
    projection = "mirror-ball" if node.projection == "MIRROR_BALL" else "equirectangular"
    return g.add("environment-texture", {"vector": g.mapped(node, vector)}, projection=projection, **options)


_VORONOI = {
    "F1": "f1",
    "F2": "f2",
    "SMOOTH_F1": "smooth-f1",
    "DISTANCE_TO_EDGE": "distance-to-edge",
    "N_SPHERE_RADIUS": "n-sphere-radius",
}


def _voronoi(g, node, groups):
    dimensions = _DIMENSIONS[node.voronoi_dimensions]
    inputs = {"vector": g.vector(node, groups, "generated")} if dimensions > 1 else {}
    if dimensions in {1, 4}:
        inputs["w"] = g.value(node.inputs["W"], groups)
    names = {"Scale": "scale", "Smoothness": "smoothness", "Exponent": "exponent", "Randomness": "randomness"}
    names.update({"Detail": "detail", "Roughness": "roughness", "Lacunarity": "lacunarity"})
    inputs.update(g.inputs(node, groups, names))
    return g.add(
        "voronoi-texture",
        inputs,
        dimensions=dimensions,
        feature=_choice(node, node.feature, _VORONOI),
        metric=_label(node.distance),
        normalize=getattr(node, "normalize", False) or None,
        maths=compat.TEXTURE_MATHS,
    )


def _gabor(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    names = {"Scale": "scale", "Frequency": "frequency", "Anisotropy": "anisotropy"}
    is_3d = node.gabor_type == "3D"
    sockets = {socket.identifier: socket for socket in node.inputs}
    inputs["direction" if is_3d else "orientation"] = g.value(sockets["Orientation 3D" if is_3d else "Orientation 2D"], groups)
    inputs.update(g.inputs(node, groups, names))
    return g.add("gabor-texture", inputs, dimensions=3 if is_3d else 2)


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
    return g.add("magic-texture", inputs, depth=node.turbulence_depth, maths=compat.TEXTURE_MATHS)


def _wave(g, node, groups):
    inputs = {"vector": g.vector(node, groups, "generated")}
    names = {"Scale": "scale", "Distortion": "distortion", "Detail": "detail", "Detail Scale": "detailScale"}
    names.update({"Detail Roughness": "detailRoughness", "Phase Offset": "phaseOffset"})
    inputs.update(g.inputs(node, groups, names))
    if compat.CLAMPS_NOISE_ROUGHNESS:
        inputs["detailRoughness"] = clamped(g, inputs["detailRoughness"])
    are_rings = node.wave_type == "RINGS"
    direction = node.rings_direction if are_rings else node.bands_direction
    return g.add(
        "wave-texture",
        inputs,
        wave="rings" if are_rings else "bands",
        direction=_label(direction),
        profile=_choice(node, node.wave_profile, {"SIN": "sine", "SAW": "saw", "TRI": "triangle"}),
        maths=compat.TEXTURE_MATHS,
    )


def _ramp(g, node, groups):
    table = [c for i in range(compat.TABLE_ENTRIES) for c in node.color_ramp.evaluate(i / (compat.TABLE_ENTRIES - 1))]
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
    for i in range(compat.TABLE_ENTRIES):
        x = low + (high - low) * i / (compat.TABLE_ENTRIES - 1)
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
    if node.data_type == "VECTOR" and node.factor_mode == "UNIFORM" and isinstance(inputs["factor"], dict):
        # One number for all components, also of a colour or vector: ours takes one a component.
        inputs["factor"] = {"node": g.add("math", {"a": inputs["factor"], "b": 0.0}, operation="add"), "output": "value"}
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
    if operation == "power" and compat.NEGATIVE_POWERS_OF_0_ARE_0:
        inputs["b"] = _exponent(g, "math", "value", inputs)
    return g.add("math", inputs, operation=operation, clamp=node.use_clamp or None)


def _exponent(g, kind, output, inputs):
    """The exponent of a power whose base is inputs["a"], without its sign where that is 0: 0 is the power then."""
    exponent = inputs["b"]
    numbers = exponent if isinstance(exponent, list) else [exponent]
    if not isinstance(exponent, dict) and min(numbers) >= 0:
        return exponent

    def op(operation, a, b=None):
        return g.op(kind, {"a": a} if b is None else {"a": a, "b": b}, output, operation=operation)

    ones = [1.0] * 3 if kind == "vector-math" else 1.0
    is_zero = op("subtract", ones, op("absolute", op("sign", inputs["a"])))
    return op("add", exponent, op("multiply", is_zero, op("subtract", op("absolute", exponent), exponent)))


def _vector_math(g, node, groups):
    operation = _OPERATIONS.get(node.operation, _label(node.operation))
    inputs = {name: g.value(socket, groups) for name, socket in zip("abc", node.inputs) if socket.enabled}
    if node.operation in {"SCALE", "REFRACT"}:
        inputs["scale"] = g.value(node.inputs["Scale"], groups)
    if operation == "power":  # which came with 5.0
        inputs["b"] = _exponent(g, "vector-math", "vector", inputs)
    return g.add("vector-math", inputs, operation=operation)


def _separate_rgb(g, node, groups):
    return g.add("separate-color", g.inputs(node, groups, {0: "color"}), space=_label(getattr(node, "mode", "RGB")))


def _combine_rgb(g, node, groups):
    inputs = g.inputs(node, groups, {0: "red", 1: "green", 2: "blue"})
    return g.add("combine-color", inputs, space=_label(getattr(node, "mode", "RGB")))


def _separate_hsv(g, node, groups):
    return g.add("separate-color", g.inputs(node, groups, {0: "color"}), space="hsv")


def _combine_hsv(g, node, groups):
    inputs = g.inputs(node, groups, {0: "red", 1: "green", 2: "blue"})
    return g.add("combine-color", inputs, space="hsv")


def _vector_rotate(g, node, groups):
    kinds = {"AXIS_ANGLE": "axis", "X_AXIS": "x", "Y_AXIS": "y", "Z_AXIS": "z", "EULER_XYZ": "euler"}
    kind = _choice(node, node.rotation_type, kinds)
    names = {"Vector": "vector", "Center": "center"}
    names.update({"Rotation": "rotation"} if kind == "euler" else {"Angle": "angle"})
    if kind == "axis":
        names["Axis"] = "axis"
    return g.add("vector-rotate", g.inputs(node, groups, names), rotate=kind, invert=node.invert or None)


def _hue(g, node, groups):
    names = {"Hue": "hue", "Saturation": "saturation", "Value": "value", "Fac": "factor", "Color": "color"}
    if "Factor" in node.inputs:
        names["Factor"] = "factor"
    return g.add("hue-saturation", g.inputs(node, groups, names), hueGoesRound=compat.HUE_GOES_ROUND or None)


def _bump(g, node, groups):
    inputs = g.inputs(node, groups, {"Strength": "strength", "Distance": "distance", "Height": "height"})
    normal = g.normal(node.inputs["Normal"], groups)
    if normal is not None:
        inputs["normal"] = normal
    return g.add(
        "bump",
        inputs,
        invert=node.invert or None,
        filterWidth=_unless_1(compat.bump_width(node)),
        reflectsAbove=compat.BUMP_REFLECTS_ABOVE or None,
    )


def _unless_1(width):
    return None if width == 1 else width


def bump_of_displacement(g, source):
    """Reference to the normal that Blender's "Bump Only" makes of what is linked to a material's Displacement.

    Cycles bumps by how far the displacement goes along the normal.

    @return  None: the displacement is the same everywhere
    @error   NotUnderstood
    """
    node, groups = source.node, source.groups
    if node.bl_idname == "ShaderNodeDisplacement":
        parts = [g.value(node.inputs[name], groups) for name in ("Height", "Midlevel", "Scale")]
        if not any(isinstance(part, dict) for part in parts):
            return None
        height = _times_shifted(g, *parts)
        if node.space != "WORLD" or g.bends(node.inputs["Normal"], groups):
            direction = _direction(g, node, groups)
            direction = _to_world(g, direction) if node.space == "OBJECT" else direction
            height = g.op("math", {"a": height, "b": _along_normal(g, direction)}, "value", operation="multiply")
    else:
        height = _along_normal(g, g.output(source))
    inputs = {"height": height, "strength": 1.0, "distance": 1.0}
    options = {"filterWidth": _unless_1(compat.BUMP_WIDTH), "reflectsAbove": compat.BUMP_REFLECTS_ABOVE or None}
    return g.op("bump", inputs, "normal", **options)


def _direction(g, node, groups):
    """Where a Displacement node moves points by a height of 1, in its own space."""
    if not g.bends(node.inputs["Normal"], groups):
        if node.space == "OBJECT":
            return {"node": g.add("texture-coordinate"), "output": "normal"}
        return g.normal(node.inputs["Normal"], groups) or g.geometry_normal()
    normal = g.normal(node.inputs["Normal"], groups)
    return transformed_normal(g, normal, "world", "object") if node.space == "OBJECT" else normal


def displaced_in_object(g, node, groups):
    """Reference to where a Displacement or Vector Displacement node moves points, in object space.

    @error  NotUnderstood
    """
    if node.bl_idname == "ShaderNodeVectorDisplacement":
        inputs = g.inputs(node, groups, {"Vector": "vector", "Midlevel": "midlevel", "Scale": "scale"})
        number = tangent_set(g, node, "") if node.space == "TANGENT" else None
        return g.op("vector-displacement", inputs, "vector", space=_label(node.space), uvSet=number)
    height = _times_shifted(g, *(g.value(node.inputs[name], groups) for name in ("Height", "Midlevel", "Scale")))
    moved = g.op("vector-math", {"a": _direction(g, node, groups), "scale": height}, "vector", operation="scale")
    return moved if node.space == "OBJECT" else to_object(g, moved)


def to_object(g, vector):
    """A reference to a vector of the world, in object space."""
    return g.op("vector-transform", {"vector": vector}, "vector", transform="vector", **{"from": "world", "to": "object"})


def _to_world(g, vector):
    return g.op("vector-transform", {"vector": vector}, "vector", transform="vector", **{"from": "object", "to": "world"})


def _along_normal(g, vector):
    return g.op("vector-math", {"a": vector, "b": g.geometry_normal()}, "value", operation="dot")


def _times_shifted(g, height, midlevel, scale):
    """(height − midlevel) · scale"""
    if not any(isinstance(part, dict) for part in (height, midlevel, scale)):
        return (height - midlevel) * scale
    if midlevel != 0:
        height = g.op("math", {"a": height, "b": midlevel}, "value", operation="subtract")
    return height if scale == 1 else g.op("math", {"a": height, "b": scale}, "value", operation="multiply")


def _displacement(g, node, groups):
    """As values have it, in the world."""
    return _to_world(g, displaced_in_object(g, node, groups))["node"]


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
    "ShaderNodeTexEnvironment": (_environment, {"Color": "color"}),
    "ShaderNodeTexGradient": (_gradient, _FACTOR),
    "ShaderNodeTexChecker": (_checker, _FACTOR),
    "ShaderNodeTexMagic": (_magic, _FACTOR),
    "ShaderNodeTexWave": (_wave, _FACTOR),
    "ShaderNodeTexVoronoi": (
        _voronoi,
        {"Distance": "distance", "Color": "color", "Position": "position", "W": "w", "Radius": "radius"},
    ),
    "ShaderNodeTexMusgrave": (_musgrave, _FACTOR),
    "ShaderNodeTexGabor": (_gabor, {"Value": "value", "Phase": "phase", "Intensity": "intensity"}),
    "ShaderNodeSeparateHSV": (_separate_hsv, {"H": "red", "S": "green", "V": "blue"}),
    "ShaderNodeCombineHSV": (_combine_hsv, {"Color": "color"}),
    "ShaderNodeVectorRotate": (_vector_rotate, {"Vector": "vector"}),
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
    "ShaderNodeBump": (_bump, {"Normal": "normal"}),
    "ShaderNodeDisplacement": (_displacement, {"Displacement": "vector"}),
    "ShaderNodeVectorDisplacement": (_displacement, {"Displacement": "vector"}),
}


def knows(node):
    """Whether a node that gives values can be written, if what it is set to can."""
    return node.bl_idname in _NODES or node.bl_idname in OUTPUTS or node.bl_idname in {"ShaderNodeValue", "ShaderNodeRGB"}
