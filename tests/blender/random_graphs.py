"""Random trees of Blender's value nodes: any of those that the exporter understands, in any mode, wired at random.

A seed gives one tree, always the same. Rules, so that two engines that compute in single precision can be compared:

- Each value has an estimate of how much it enlarges a change of the coordinates; a value that would pass 10^3.5 is not used
  further, but something nearer to the coordinates is.
- What may leave any bounds (quotients, powers, tangents …) is clamped to -4 … 4 before it is used, and so is the end.
- White noise, which is noise of bits, is over the coordinates themselves alone.
"""

import random

import bpy

#: Values that would enlarge a change of the coordinates by more than ten to this are not used any more.
_MOST_GAIN = 3.5

#: Limits of an input that is not linked, by its name; others are within _OTHERS.
_LIMITS = {
    "Scale": (0.5, 2.0),
    "Detail": (0.0, 3.0),
    "Roughness": (0.0, 1.0),
    "Detail Roughness": (0.0, 1.0),
    "Detail Scale": (0.5, 1.5),
    "Distortion": (0.0, 0.6),
    "Dimension": (0.4, 2.0),
    "Lacunarity": (1.5, 2.5),
    "Offset": (0.0, 1.0),
    "Gain": (0.5, 2.0),
    "Smoothness": (0.0, 1.0),
    "Exponent": (0.6, 3.0),
    "Randomness": (0.0, 1.0),
    "Mortar Size": (0.02, 0.1),
    "Mortar Smooth": (0.1, 1.0),
    "Bias": (-0.5, 0.5),
    "Brick Width": (0.3, 1.0),
    "Row Height": (0.2, 0.5),
    "Fac": (0.0, 1.0),
    "Factor": (0.0, 1.0),
    "Gamma": (0.5, 2.0),
    "Hue": (0.0, 1.0),
    "Saturation": (0.0, 2.0),
    "IOR": (1.1, 2.5),
    "Blend": (0.05, 0.95),
    "Steps": (1.0, 8.0),
    "From Max": (0.3, 2.0),
    "From Min": (-2.0, 0.2),
    "Bright": (-0.5, 0.5),
    "Contrast": (-0.5, 1.0),
    "Phase Offset": (-3.0, 3.0),
}
_OTHERS = (-2.0, 2.0)

#: Inputs that are seldom linked: what they do to a texture is mostly noise of another kind.
_SETTINGS = set(_LIMITS) - {"Fac", "Factor", "Hue", "IOR", "Blend"}


def _modes(*names):
    """Chooses a mode for each of some properties."""

    def choose(rng, node):
        for name in names:
            items = node.bl_rna.properties[name].enum_items.keys()
            setattr(node, name, rng.choice(sorted(items)))

    return choose


def _math(rng, node):
    _modes("operation")(rng, node)
    node.use_clamp = rng.random() < 0.2


def _mix(rng, node):
    node.data_type = rng.choice(("FLOAT", "VECTOR", "RGBA"))
    node.clamp_factor = rng.random() < 0.7
    if node.data_type == "VECTOR":
        node.factor_mode = "UNIFORM"
    if node.data_type == "RGBA":
        _modes("blend_type")(rng, node)
        node.clamp_result = rng.random() < 0.3


def _mix_rgb(rng, node):
    _modes("blend_type")(rng, node)
    node.use_clamp = rng.random() < 0.3


def _map_range(rng, node):
    _modes("data_type", "interpolation_type")(rng, node)
    node.clamp = rng.random() < 0.6


def _wave(rng, node):
    _modes("wave_type", "wave_profile", "bands_direction", "rings_direction")(rng, node)


def _magic(rng, node):
    node.turbulence_depth = rng.randrange(5)


def _brick(rng, node):
    node.offset, node.squash = rng.random(), 0.5 + rng.random()
    node.offset_frequency, node.squash_frequency = rng.randrange(1, 5), rng.randrange(1, 5)


def _ramp(rng, node):
    ramp = node.color_ramp
    ramp.color_mode = rng.choice(("RGB", "HSV", "HSL"))
    if ramp.color_mode == "RGB":
        ramp.interpolation = rng.choice(("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE"))
    else:
        ramp.hue_interpolation = rng.choice(("NEAR", "FAR", "CW", "CCW"))
    for _ in range(rng.randrange(4)):
        ramp.elements.new(rng.random())
    for element in ramp.elements:
        element.color = tuple(rng.random() for _ in range(4))


def _curves(rng, node):
    mapping = node.mapping
    mapping.extend = rng.choice(("EXTRAPOLATED", "HORIZONTAL"))
    for curve in mapping.curves:
        for point in curve.points:
            point.location[1] = rng.uniform(-1.0, 1.0)
        if rng.random() < 0.6:
            curve.points.new(rng.uniform(-0.8, 0.8), rng.uniform(-1.0, 1.0))
    mapping.update()


def _value(rng, node):
    node.outputs[0].default_value = rng.uniform(*_OTHERS)


def _rgb(rng, node):
    node.outputs[0].default_value = tuple(rng.random() for _ in range(4))


#: What sets a node's modes at random, about how much it enlarges changes (a power of ten), and how often it is taken.
_KINDS = {
    "ShaderNodeTexNoise": (_modes("noise_dimensions"), 0.8, 4),
    "ShaderNodeTexWhiteNoise": (_modes("noise_dimensions"), None, 1),
    "ShaderNodeTexVoronoi": (_modes("voronoi_dimensions", "feature", "distance"), 0.5, 4),
    "ShaderNodeTexMusgrave": (_modes("musgrave_dimensions", "musgrave_type"), 1.0, 2),
    "ShaderNodeTexWave": (_wave, 1.3, 2),
    "ShaderNodeTexMagic": (_magic, 1.5, 1),
    "ShaderNodeTexBrick": (_brick, 1.0, 1),
    "ShaderNodeTexGradient": (_modes("gradient_type"), 0.3, 1),
    "ShaderNodeTexChecker": (None, 0.0, 1),
    "ShaderNodeValToRGB": (_ramp, 0.7, 3),
    "ShaderNodeRGBCurve": (_curves, 0.7, 1),
    "ShaderNodeVectorCurve": (_curves, 0.7, 1),
    "ShaderNodeFloatCurve": (_curves, 0.7, 1),
    "ShaderNodeMix": (_mix, 0.3, 5),
    "ShaderNodeMixRGB": (_mix_rgb, 0.3, 2),
    "ShaderNodeInvert": (None, 0.0, 1),
    "ShaderNodeGamma": (None, 0.4, 1),
    "ShaderNodeBrightContrast": (None, 0.3, 1),
    "ShaderNodeHueSaturation": (None, 0.5, 1),
    "ShaderNodeSeparateColor": (_modes("mode"), 0.5, 1),
    "ShaderNodeCombineColor": (_modes("mode"), 0.5, 1),
    "ShaderNodeSeparateRGB": (None, 0.0, 1),
    "ShaderNodeCombineRGB": (None, 0.0, 1),
    "ShaderNodeRGBToBW": (None, 0.0, 1),
    "ShaderNodeSeparateXYZ": (None, 0.0, 2),
    "ShaderNodeCombineXYZ": (None, 0.0, 2),
    "ShaderNodeClamp": (_modes("clamp_type"), 0.0, 1),
    "ShaderNodeMapRange": (_map_range, 0.5, 2),
    "ShaderNodeMapping": (_modes("vector_type"), 0.5, 2),
    "ShaderNodeMath": (_math, 0.5, 8),
    "ShaderNodeVectorMath": (_modes("operation"), 0.5, 5),
    "ShaderNodeFresnel": (None, 0.5, 1),
    "ShaderNodeLayerWeight": (None, 0.5, 1),
    "ShaderNodeValue": (_value, 0.0, 1),
    "ShaderNodeRGB": (_rgb, 0.0, 1),
}

#: Operations whose values are clamped, as they know no bounds or are steep near some.
_UNBOUNDED = set(
    "DIVIDE POWER LOGARITHM INVERSE_SQRT EXPONENT TANGENT SINH COSH MODULO PROJECT NORMALIZE MULTIPLY MULTIPLY_ADD"
    " DEGREES DODGE BURN LINEAR_LIGHT SNAP WRAP REFLECT REFRACT CROSS_PRODUCT LENGTH DISTANCE SCALE DOT_PRODUCT".split()
)

#: Kinds of which all are.
_UNBOUNDED_KINDS = {
    "ShaderNodeMapping",
    "ShaderNodeMapRange",
    "ShaderNodeTexMusgrave",
    "ShaderNodeRGBCurve",
    "ShaderNodeVectorCurve",
    "ShaderNodeFloatCurve",
}

#: Inputs that say something of the scene.
_LEFT_OUT = {"Normal", "Tangent"}


class _Tree:
    """A tree that grows; its values are pairs of a socket and the power of ten by which it enlarges changes."""

    def __init__(self, tree, seed, xyz, w):
        self.tree, self.rng = tree, random.Random(seed)
        self.coordinates = [(xyz, 0.0), (w, 0.0)]
        self.values = list(self.coordinates)
        self.unused = []
        self.made = []  # all outputs of nodes, as they are
        self.count = 0

    def new(self, kind):
        self.count += 1
        return self.tree.nodes.new(kind)

    def pick(self, most_gain):
        """A value to link, rather a new one than an old one."""
        fitting = [value for value in self.values if value[1] <= most_gain] or self.coordinates
        waiting = [value for value in fitting if value in self.unused]
        pool = waiting if waiting and self.rng.random() < 0.6 else fitting
        value = self.rng.choice(pool[-6:] if self.rng.random() < 0.6 else pool)
        if value in self.unused:
            self.unused.remove(value)
        return value

    def link(self, value, socket):
        source = value[0]
        if self.rng.random() < 0.05:
            reroute = self.tree.nodes.new("NodeReroute")
            self.tree.links.new(source, reroute.inputs[0])
            source = reroute.outputs[0]
        self.tree.links.new(source, socket)

    def set(self, socket):
        low, high = _LIMITS.get(socket.name, (0.0, 1.0) if socket.type == "RGBA" else _OTHERS)
        if socket.type == "VALUE":
            socket.default_value = self.rng.uniform(low, high)
        else:
            values = [self.rng.uniform(low, high) for _ in socket.default_value]
            socket.default_value = values[:3] + [1.0] if socket.type == "RGBA" else values

    def clamped(self, value):
        """A value within -4 … 4, in each of its components."""
        source, gain = value
        for operation, limit in (("MINIMUM", 4.0), ("MAXIMUM", -4.0)):
            node = self.new("ShaderNodeVectorMath")
            node.operation = operation
            node.inputs[1].default_value = (limit, limit, limit)
            self.tree.links.new(source, node.inputs[0])
            source = node.outputs[0]
        return source, gain

    def never_links(self, node, socket):
        """Inputs that Cycles makes something else than numbers of, or numbers of no digits."""
        # A normal without length; an index of refraction near 0; bricks without width.
        is_normal = getattr(node, "operation", "") in {"REFLECT", "REFRACT"} and socket == node.inputs[1]
        return is_normal or socket.name in {"IOR", "Brick Width", "Row Height", "Mortar Size", "Mortar Smooth"}

    def grow(self, kind):
        set_modes, own_gain, _ = _KINDS[kind]
        rng, node = self.rng, self.new(kind)
        if set_modes is not None:
            set_modes(rng, node)
        sockets = [s for s in node.inputs if s.enabled and s.type in {"VALUE", "VECTOR", "RGBA"} and s.name not in _LEFT_OUT]
        must_link = [s for s in sockets if s.name == "Vector" and "Tex" in kind]
        gain, is_linked = 0.0, False
        for socket in sockets:
            chance = 1.0 if socket in must_link else 0.08 if socket.name in _SETTINGS else 0.75
            if rng.random() >= chance or self.never_links(node, socket):
                self.set(socket)
                continue
            if own_gain is None:
                value = rng.choice(self.coordinates)
            else:
                value = self.pick(_MOST_GAIN - own_gain)
            self.link(value, socket)
            gain, is_linked = max(gain, value[1]), True
        steep = _UNBOUNDED.intersection(
            getattr(node, name, "") for name in ("operation", "blend_type") if getattr(node, name, "")
        )
        for output in node.outputs:
            if not output.enabled or output.type == "SHADER":
                continue
            value = (output, gain + (own_gain or 0.0) if is_linked else 0.0)
            self.made.append(output)
            if steep or kind in _UNBOUNDED_KINDS:
                value = self.clamped(value)
            self.values.append(value)
            self.unused.append(value)


def grow(seed, tree, xyz, w):
    """Grows a tree of 5 to 40 nodes, the clamps among them.

    @return  its value, a pair as in _Tree; and all outputs of its nodes, in the order in which they are made
    """
    grown = _Tree(tree, seed, xyz, w)
    wanted = grown.rng.randrange(5, 41)
    kinds = sorted(kind for kind in _KINDS if hasattr(bpy.types, kind))
    weights = [_KINDS[kind][2] for kind in kinds]
    while grown.count < 4 or grown.count + len(grown.unused) < wanted:
        grown.grow(grown.rng.choices(kinds, weights)[0])
    # What nothing has used yet is mixed, so that every node counts.
    value, *others = grown.unused or [grown.values[-1]]
    for other in others:
        mix = grown.new("ShaderNodeVectorMath")
        mix.operation = "MULTIPLY_ADD"
        mix.inputs[1].default_value = (0.7, 0.7, 0.7)
        tree.links.new(value[0], mix.inputs[0])
        tree.links.new(other[0], mix.inputs[2])
        value = (mix.outputs[0], max(value[1], other[1]))
    return grown.clamped(value)[0], grown.made


def builder(seed, number=None):
    """What builds a tree as graph_test._emitter wants it: its value is 0 … 8.

    @param  number  of the output that is shown, in the order in which they are made; None: the tree's value
    """

    def build(tree, xyz, w):
        end, made = grow(seed, tree, xyz, w)
        if number is not None:
            end = _Tree(tree, seed, xyz, w).clamped((made[number], 0.0))[0]
        shifted = tree.nodes.new("ShaderNodeVectorMath")
        shifted.operation = "ADD"
        shifted.inputs[1].default_value = (4.0, 4.0, 4.0)
        tree.links.new(end, shifted.inputs[0])
        return shifted.outputs[0]

    return build


def describe(output):
    """A node's name, modes and inputs."""
    node = output.node
    modes = [
        str(getattr(node, p.identifier))
        for p in node.bl_rna.properties
        if p.type in {"ENUM", "BOOLEAN", "INT"} and p.identifier not in bpy.types.Node.bl_rna.properties
    ]
    inputs = []
    for socket in node.inputs:
        if not socket.enabled:
            continue
        if socket.is_linked:
            source = socket.links[0].from_socket
            inputs.append(f"{socket.name} = {source.node.name}.{source.name}")
        elif hasattr(socket, "default_value"):
            value = socket.default_value
            shown = [round(v, 3) for v in value] if hasattr(value, "__len__") else round(value, 3)
            inputs.append(f"{socket.name} = {shown}")
    return f"{node.name}.{output.name} ({' '.join(modes)}): {', '.join(inputs)}"
