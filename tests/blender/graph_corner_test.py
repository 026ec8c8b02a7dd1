"""Nodes one by one at corners: inputs of 0, of each other's size, below 0 and above 1, normals of any length, and far away.

random_graphs.py keeps away from those. Here each mode of each node has a row of the sheet; its inputs are linked to
coordinates that are multiples of a half, or have numbers that formulas divide by, are raised to or are cut off at.
"""

import itertools
import random

import bpy
import random_graphs
from random_graph_test import compare_trees
from scenes import IS_5_0

#: Numbers of inputs that are not linked.
_CORNERS = (-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.0, 2.0)

#: Rows of a sheet.
_ROWS = 160

#: What its own inputs alone say too little of: modes by node.
_MODES = {
    "ShaderNodeTexNoise": ("noise_dimensions",),
    "ShaderNodeTexWhiteNoise": ("noise_dimensions",),
    "ShaderNodeTexVoronoi": ("voronoi_dimensions", "feature", "distance"),
    "ShaderNodeTexMusgrave": ("musgrave_dimensions", "musgrave_type"),
    "ShaderNodeTexWave": ("wave_type", "wave_profile", "bands_direction"),
    "ShaderNodeTexMagic": (),
    "ShaderNodeTexBrick": (),
    "ShaderNodeTexGradient": ("gradient_type",),
    "ShaderNodeTexChecker": (),
    "ShaderNodeValToRGB": (),
    "ShaderNodeRGBCurve": (),
    "ShaderNodeVectorCurve": (),
    "ShaderNodeFloatCurve": (),
    "ShaderNodeMix": ("data_type", "blend_type", "clamp_factor"),
    "ShaderNodeMixRGB": ("blend_type", "use_clamp"),
    "ShaderNodeInvert": (),
    "ShaderNodeGamma": (),
    "ShaderNodeBrightContrast": (),
    "ShaderNodeHueSaturation": (),
    "ShaderNodeSeparateColor": ("mode",),
    "ShaderNodeCombineColor": ("mode",),
    "ShaderNodeRGBToBW": (),
    "ShaderNodeSeparateXYZ": (),
    "ShaderNodeCombineXYZ": (),
    "ShaderNodeClamp": ("clamp_type",),
    "ShaderNodeMapRange": ("data_type", "interpolation_type", "clamp"),
    "ShaderNodeMapping": ("vector_type",),
    "ShaderNodeMath": ("operation",),
    "ShaderNodeVectorMath": ("operation",),
    "ShaderNodeVectorRotate": ("rotation_type", "invert"),
    "ShaderNodeFresnel": (),
    "ShaderNodeLayerWeight": (),
    "ShaderNodeNormal": (),
}

#: Modes in which Cycles gives numbers of no digits, or none.
_LEFT_OUT = {
    ("ShaderNodeVectorMath", "REFLECT"): "of a normal without length Cycles 3.4 makes what is no number",
    ("ShaderNodeVectorMath", "REFRACT"): "likewise",
}


def _choices(kind):
    """All combinations of a node's modes, as dictionaries."""
    properties = getattr(bpy.types, kind).bl_rna.properties
    names = [name for name in _MODES[kind] if name in properties]
    values = [
        sorted(properties[name].enum_items.keys()) if properties[name].type == "ENUM" else (False, True) for name in names
    ]
    combined = [dict(zip(names, chosen)) for chosen in itertools.product(*values)]
    # Rotations are geometry nodes' alone, blends are colours'.
    combined = [c for c in combined if c.get("data_type") != "ROTATION"]
    return [c for c in combined if c.get("data_type", "RGBA") == "RGBA" or c.get("blend_type", "MIX") == "MIX"]


def _numbers(rng, socket):
    if socket.type == "VALUE":
        socket.default_value = rng.choice(_CORNERS)
        return
    numbers = [rng.choice(_CORNERS) for _ in socket.default_value]
    socket.default_value = numbers[:3] + [1.0] if socket.type == "RGBA" else numbers


def _normals(tree, rng, xyz):
    """A normal: of any length, unit, bumped by where the point is, or none."""
    kind = rng.choice(("any", "unit", "bump", "none"))
    if kind == "any":
        return xyz
    if kind == "unit":
        node = tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "NORMALIZE"
        tree.links.new(xyz, node.inputs[0])
        return node.outputs[0]
    if kind == "none":
        return None
    geometry, parts, bump = (tree.nodes.new(f"ShaderNode{name}") for name in ("NewGeometry", "SeparateXYZ", "Bump"))
    tree.links.new(geometry.outputs["Position"], parts.inputs[0])
    tree.links.new(parts.outputs[rng.randrange(3)], bump.inputs["Height"])
    bump.inputs["Strength"].default_value = rng.choice((0.0, 0.5, 1.0))
    bump.inputs["Distance"].default_value = rng.choice((-1.0, 0.3, 2.0))
    return bump.outputs["Normal"]


def _builder(seed, kind, modes, factor):
    """What builds a node as graph_test._emitter wants it: its value is 0 … 8.

    @param  factor  of the coordinates; 0: they are multiples of a half
    """

    def build(tree, xyz, w):
        rng = random.Random(f"{seed} {kind} {modes}")
        scaled = tree.nodes.new("ShaderNodeVectorMath")
        scaled.operation = "MULTIPLY" if factor else "SNAP"
        scaled.inputs[1].default_value = (factor or 0.5,) * 3
        tree.links.new(xyz, scaled.inputs[0])
        snapped = tree.nodes.new("ShaderNodeMath")
        snapped.operation = scaled.operation
        snapped.inputs[1].default_value = factor or 0.5
        tree.links.new(w, snapped.inputs[0])
        xyz, w = scaled.outputs[0], snapped.outputs[0]
        parts = tree.nodes.new("ShaderNodeSeparateXYZ")
        tree.links.new(xyz, parts.inputs[0])
        node = tree.nodes.new(kind)
        choose = random_graphs._KINDS.get(kind, (None,))[0]
        if choose is not None:
            choose(rng, node)
        for name, value in modes.items():
            setattr(node, name, value)
        if kind == "ShaderNodeNormal":
            node.outputs[0].default_value = [rng.choice(_CORNERS[2:]) for _ in range(3)]
        for socket in node.inputs:
            if not socket.enabled or socket.type not in {"VALUE", "VECTOR", "RGBA"}:
                continue
            if socket.name == "Normal" and kind != "ShaderNodeNormal":
                normal = _normals(tree, rng, xyz)
                if normal is not None:
                    tree.links.new(normal, socket)
                continue
            is_texture = "Tex" in kind
            must_link = is_texture and socket.name in {"Vector", "W"}
            if not must_link and (is_texture or rng.random() < 0.4):
                if is_texture:
                    _limited(rng, socket)
                else:
                    _numbers(rng, socket)
                continue
            source = rng.choice((*parts.outputs[:], w)) if socket.type == "VALUE" else xyz
            tree.links.new(source, socket)
        shown = [output for output in node.outputs if output.enabled and output.type != "SHADER"]
        value = random_graphs._Tree(tree, 0, xyz, w).clamped((rng.choice(shown), 0.0))[0]
        shifted = tree.nodes.new("ShaderNodeVectorMath")
        shifted.operation = "ADD"
        shifted.inputs[1].default_value = (4.0, 4.0, 4.0)
        tree.links.new(value, shifted.inputs[0])
        build.text = random_graphs.describe(shown[0])
        return shifted.outputs[0]

    return build


def _limited(rng, socket):
    """A texture's setting, now and then at an end of its range."""
    low, high = random_graphs._LIMITS.get(socket.name, random_graphs._OTHERS)
    if socket.name == "Smoothness":
        low = 0.1  # of none Cycles makes what is no number, where two points are equally far
    if socket.type == "VALUE":
        socket.default_value = rng.choice((low, high, rng.uniform(low, high)))
    else:
        socket.default_value = [rng.random() for _ in range(3)] + [1.0]


def differing(kinds, seeds, factor=0.0, most_off=0.0):
    """Texts of the rows in which more than a share of the points differ."""
    rows = [
        (seed, kind, modes)
        for kind in kinds
        if hasattr(bpy.types, kind)
        for modes in _choices(kind)
        if not any((kind, value) in _LEFT_OUT for value in modes.values())
        for seed in seeds
    ]
    out = []
    for start in range(0, len(rows), _ROWS):
        builders = {row_number: _builder(*row, factor) for row_number, row in enumerate(rows[start : start + _ROWS])}
        for number, result in compare_trees(builders).items():
            is_lattice = "Voronoi" in builders[number].text and "Randomness = 0.0" in builders[number].text
            if result.off > (_MOST_OFF_OF_LATTICES if is_lattice else most_off):
                seed = rows[start + number][0]
                out.append(f"{seed} {builders[number].text}: {result.off:.2%} median {result.median:.2g}")
    return out


#: Share of points that may be off: where two points of cells are equally far, rounding says which of them counts. In a plain
#: lattice that is so at 3 % of these points, of the versions whose Cycles was built with another library of functions.
_MOST_OFF = 0.005
_MOST_OFF_OF_LATTICES = 0.04 if IS_5_0 else _MOST_OFF

#: Other primaries than Cycles' of 5.2 by .03 %, see docs/blender.md.
_OTHER_PRIMARIES = {"ShaderNodeRGBToBW"} if IS_5_0 else set()


def test_corners():
    wrong = differing([kind for kind in _MODES if kind not in _OTHER_PRIMARIES], range(2), most_off=_MOST_OFF)
    assert not wrong, "\n".join(wrong)


def test_textures_far_away():
    """Where whole numbers are halves, and where they are eight apart."""
    textures = [kind for kind in _MODES if "Tex" in kind and "Wave" not in kind]
    wrong = [text for factor in (2.0**15, 2.0**22, 2.0**26) for text in differing(textures, (0,), factor, _MOST_OFF)]
    assert not wrong, "\n".join(wrong)
