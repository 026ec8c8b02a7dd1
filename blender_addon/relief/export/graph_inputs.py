# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs of Blender's input nodes as RELIEF_graph: what is read of the point, its object, the ray and the camera.

One function a kind of node, listed at the end. Each gives the value of one output: a reference, or numbers.
"""

import math

import bpy

from .. import compat
from . import attributes, instance_values, nodes
from .image import MISSING
from .not_understood import not_understood


def _output(index, name):
    return {"node": index, "output": name}


def _constant(g, value):
    """Numbers as a node: they may be all that a graph gives."""
    if isinstance(value, (tuple, list)):
        return _output(g.add("combine", dict(zip("xyz", (float(v) for v in value)))), "vector")
    return _output(g.add("math", {"a": float(value), "b": 0.0}, operation="add"), "value")


def image_of_nothing(g, source):
    """What an image node without an image gives."""
    return _constant(g, 1.0 if source.socket.name == "Alpha" else MISSING)


def mesh_attribute(g, kind, name, output):
    """An output of an attribute of the mesh: see attributes.py."""
    if (kind, name) not in g.attributes:
        g.attributes.append((kind, name))
    return _output(g.add("attribute", name=attributes.file_name((kind, name))), output)


def instance_value(g, kind, name, output):
    """An output of a value of the object: see instance_values.py."""
    if (kind, name) not in g.values:
        g.values.append((kind, name))
    return _output(g.add("attribute", name=instance_values.file_name((kind, name))), output)


def _texture_coordinate(g, source):
    node, name = source.node, source.socket.identifier
    if name == "UV":
        return instance_value(g, "uv", "", "vector") if node.from_instancer else g.uv("")
    if name == "Generated":
        if node.from_instancer:
            return instance_value(g, "generated", "", "vector")
        g.uses_generated = True
    if name == "Object" and node.object is not None:
        inverse = node.object.matrix_world.inverted_safe()
        matrix = [c for row in inverse[:3] for c in row]
        position = _output(g.add("geometry"), "position")
        return _output(g.add("transform", {"vector": position}, matrix=matrix), "vector")
    return _output(g.add("texture-coordinate"), name.lower())


def _uv_map(g, source):
    node = source.node
    return instance_value(g, "uv", "", "vector") if node.from_instancer else g.uv(node.uv_map)


def _geometry(g, source):
    name = source.socket.identifier
    if name == "Pointiness":
        return mesh_attribute(g, "pointiness", "", "value")
    if name == "Random Per Island":
        return mesh_attribute(g, "island", "", "value")
    if name == "Tangent":
        g.uses_generated = True
    return _output(g.add("geometry"), "trueNormal" if name == "True Normal" else name.lower())


def _object_info(g, source):
    name = source.socket.identifier
    if name == "Location":
        return _output(g.add("object-info"), "location")
    if name == "Material Index":
        return _constant(g, g.material_index)
    kind = {"Color": "color", "Alpha": "color", "Object Index": "index", "Random": "random"}[name]
    return instance_value(g, kind, "", {"Color": "color", "Alpha": "alpha"}.get(name, "value"))


def _particle_info(g, source):
    name = source.socket.identifier.upper().replace(" ", "_")
    is_vector = name in {"LOCATION", "VELOCITY", "ANGULAR_VELOCITY"}
    return instance_value(g, "particle", name, "vector" if is_vector else "value")


_LIGHT_PATH = {
    "Is Camera Ray": "camera",
    "Is Shadow Ray": "shadow",
    "Is Diffuse Ray": "diffuse",
    "Is Glossy Ray": "glossy",
    "Is Singular Ray": "singular",
    "Is Reflection Ray": "reflection",
    "Is Transmission Ray": "transmission",
    "Ray Length": "length",
    "Ray Depth": "depth",
    "Diffuse Depth": "diffuseDepth",
    "Glossy Depth": "glossyDepth",
    "Transparent Depth": "transparentDepth",
    "Transmission Depth": "transmissionDepth",
}


def _light_path(g, source):
    name = source.socket.identifier
    if name in {"Is Volume Scatter Ray", "Portal Depth"}:  # portals are warned about themselves
        return _constant(g, 0.0)
    if name not in _LIGHT_PATH:
        raise not_understood(source.node, name)
    return _output(g.add("light-path"), _LIGHT_PATH[name])


def _camera_data(g, source):
    names = {"View Vector": "vector", "View Z Depth": "depth", "View Distance": "distance"}
    return _output(g.add("camera-data"), names[source.socket.identifier])


#: Outputs of Attribute by its sockets' names.
_ATTRIBUTE = {"Color": "color", "Vector": "vector", "Fac": "value", "Factor": "value", "Alpha": "alpha"}

#: Attributes that Cycles has by these names without the mesh having them.
_STANDARD = {"pointiness": ("pointiness", ""), "random_per_island": ("island", ""), "uv": ("uv", "")}


def _attribute(g, source):
    node = source.node
    output = _ATTRIBUTE[source.socket.name]
    name = node.attribute_name
    if not name:
        return _constant(g, 1.0 if output == "alpha" else (0.0, 0.0, 0.0))
    if node.attribute_type == "GEOMETRY":
        if name == "generated" and output == "vector":
            g.uses_generated = True
            return _output(g.add("texture-coordinate"), "generated")
        if g.voxels is not None and name in g.voxels:
            if output == "alpha" and not g.voxels.has_alpha(name):
                return _constant(g, 1.0)
            return g.voxels.output(g, name, "color" if output == "vector" else output)
        return mesh_attribute(g, *_STANDARD.get(name, ("attribute", name)), output)
    if node.attribute_type == "VIEW_LAYER":
        layer = g.view_layer()
        value = instance_values.look_up(name, layer)
        return _constant(g, {"alpha": value[3], "value": sum(value[:3]) / 3}.get(output, value[:3]))
    return instance_value(g, node.attribute_type.lower(), name, output)


def _color_attribute(g, source):
    return mesh_attribute(g, "color", source.node.layer_name, _ATTRIBUTE[source.socket.name])


def tangent_set(g, node, uv_map):
    """Option that names the uv set of a node's tangents; uv_map "" is the one that is active in renders."""
    number = g.coordinate_set(("uv", uv_map))
    if number is None:
        raise not_understood(node, "tangents of a third uv map")
    g.uses_tangents = g.uses_tangents or not uv_map
    return number or None


def _tangent(g, source):
    node = source.node
    if node.direction_type == "UV_MAP":
        return _output(g.add("tangent", direction="uv", uvSet=tangent_set(g, node, node.uv_map)), "tangent")
    g.uses_generated = True
    return _output(g.add("tangent", direction=f"radial-{node.axis.lower()}"), "tangent")


def _normal_map(g, source):
    node = source.node
    inputs = g.inputs(node, source.groups, {"Strength": "strength", "Color": "color"})
    space = node.space.lower().replace("_", "-")
    if node.space != "TANGENT":
        return _output(g.add("normal-map", inputs, space=space), "normal")
    if compat.is_green_down(node):
        inputs["color"] = _multiply_add(g, inputs["color"], (1.0, -1.0, 1.0), (0.0, 1.0, 0.0))
    # Only where the surface moves are there two of it.
    base = compat.normal_map_base(node) if g.displaces else None
    options = {"base": base} if base == "original" else {"displacedTangents": base is not None or None}
    if compat.TANGENT_STRENGTH and base != "original" and inputs["strength"] != 1:
        inputs = {"color": _flattened(g, **inputs)}
    is_unit = compat.NORMAL_MAPS_OVER_UNIT_NORMALS or None
    return _output(g.add("normal-map", inputs, space=space, uvSet=tangent_set(g, node, node.uv_map), unitNormals=is_unit, **options), "normal")


def _multiply_add(g, vector, factors, summands):
    inputs = {"a": vector, "b": list(factors), "c": list(summands)}
    return g.op("vector-math", inputs, "vector", operation="multiply-add")


def _flattened(g, color, strength):
    """The colour of a tangent normal map nearer to even, or farther: x and y by all of the strength, z by at most 1."""
    share = g.op("clamp", {"value": strength}, "value") if isinstance(strength, dict) else min(max(strength, 0.0), 1.0)
    shares = g.op("combine", {"x": strength, "y": strength, "z": share}, "vector")
    # Even is half, half, 1.
    return g.op("mix-vector", {"factor": shares, "a": [0.5, 0.5, 1.0], "b": color}, "vector", clampFactor=False)


def _vector_transform(g, source):
    node = source.node
    vector = g.inputs(node, source.groups, {"Vector": "vector"})["vector"]
    kind, spaces = node.vector_type.lower(), (node.convert_from.lower(), node.convert_to.lower())
    if kind == "normal" and compat.NORMALS_KEEP_UPRIGHT and spaces[0] != spaces[1]:
        return transformed_normal(g, vector, *spaces)
    return _transformed(g, vector, kind, *spaces)


def _transformed(g, vector, kind, first, second):
    options = {"transform": kind, "from": first, "to": second}
    return g.op("vector-transform", {"vector": vector}, "vector", **options)


def transformed_normal(g, normal, first, second):
    """A normal by the inverse, transposed: its dot product with what each of the new axes was."""
    dots = {}
    for number, axis in enumerate("xyz"):
        unit = [float(i == number) for i in range(3)]
        was = _transformed(g, unit, "vector", second, first)
        dots[axis] = g.op("vector-math", {"a": normal, "b": was}, "value", operation="dot")
    return g.op("vector-math", {"a": g.op("combine", dots, "vector")}, "vector", operation="normalize")


def _normal(g, source):
    node = source.node
    inputs = g.inputs(node, source.groups, {"Normal": "normal"})
    index = g.add("normal", inputs, direction=[float(c) for c in node.outputs["Normal"].default_value])
    return _output(index, source.socket.identifier.lower())


def _wireframe(g, source):
    inputs = g.inputs(source.node, source.groups, {"Size": "size"})
    return _output(g.add("wireframe", inputs, pixels=source.node.use_pixel_size), "factor")


def _ambient_occlusion(g, source):
    node, groups = source.node, source.groups
    inputs = g.inputs(node, groups, {"Color": "color", "Distance": "distance"})
    if g.constant(node.inputs["Distance"], groups) == 0.0:
        inputs["distance"] = g.occlusion_distance
    normal = g.normal(node.inputs["Normal"], groups)
    if normal is not None:
        inputs["normal"] = normal
    index = g.add("ambient-occlusion", inputs, samples=node.samples, inside=node.inside, onlyLocal=node.only_local)
    return _output(index, "factor" if source.socket.identifier == "AO" else "color")


def _bevel(g, source):
    node, groups = source.node, source.groups
    inputs = g.inputs(node, groups, {"Radius": "radius"})
    normal = g.normal(node.inputs["Normal"], groups)
    if normal is not None:
        inputs["normal"] = normal
    return _output(g.add("bevel", inputs, samples=node.samples), "normal")


def _light_falloff(g, source):
    inputs = g.inputs(source.node, source.groups, {"Strength": "strength", "Smooth": "smooth"})
    return _output(g.add("light-falloff", inputs), source.socket.identifier.lower())


def _unread_by_cycles(node):
    """What keeps Cycles from reading a node's IES file that the program reads; None: nothing."""
    if node.mode == "INTERNAL":
        return None
    try:
        with open(bpy.path.abspath(node.filepath, library=node.id_data.library), "rb") as file:
            # Where lines end, and the type of photometry, are seen in the beginning.
            data = file.read(1 << 16)
    except OSError:
        return None
    if b"\nTILT=" not in data and (b"\rTILT=" in data or data.startswith(b"TILT=")):
        return "whose lines end with CR alone" if b"\n" not in data else "that begins with TILT"
    words = data.partition(b"\nTILT=")[2].replace(b",", b" ").split()
    if not compat.IES_HAS_TYPE_A and words[:1] == [b"NONE"] and words[6:7] == [b"3"]:
        return "of type A"
    return None


def _ies(g, source):
    node, groups = source.node, source.groups
    strength = g.inputs(node, groups, {"Strength": "strength"})["strength"]
    uri = g.ies(node)
    if uri is None:
        g.warn(f'node "{node.name}" ({node.bl_label}) without a file', "its strength times 100 was used, as in Cycles")
        return _output(g.add("math", {"a": strength, "b": 100.0}, operation="multiply"), "value")
    what = _unread_by_cycles(node)
    if what is not None:
        g.warn(f'node "{node.name}" ({node.bl_label}): an IES file {what}', "it was read; Cycles takes 100 times the strength")
    socket = node.inputs["Vector"]
    vector = g.value(socket, groups) if nodes.linked(socket, groups) is not None else g.coordinate_normal()
    inputs = {"vector": g.mapped(node, vector), "strength": strength}
    return _output(g.add("ies-texture", inputs, uri=uri, maths=compat.TEXTURE_MATHS), "factor")


def _scene_time(g, source):
    """The same while the shutter is open, as in Cycles."""
    frame, seconds = g.moment
    return _constant(g, frame if source.socket.identifier == "Frame" else seconds)


def _implicit_conversion(g, source):
    """What Blender puts into trees that it makes (nodes.tree_of), where types differ."""
    node, groups = source.node, source.groups
    value = g.value(node.inputs[0], groups)
    inner = nodes.follow(node.inputs[0], groups)
    from_color = inner is not None and inner.socket.type == "RGBA"
    if node.data_type in {"FLOAT", "INT", "BOOLEAN"} and from_color:
        value = g.grey(value)
    return value if isinstance(value, dict) else _constant(g, value)


def _volume_info(g, source):
    name = source.socket.identifier
    if g.voxels is not None and name.lower() in g.voxels:
        return g.voxels.output(g, name.lower(), "color" if name == "Color" else "value")
    return _constant(g, (0.0, 0.0, 0.0) if name == "Color" else 0.0)


def _hair_info(g, source):
    """Of a surface that is no hair all is 0."""
    name = source.socket.identifier
    if name == "Tangent Normal":
        return _output(g.add("geometry", {}), "tangentNormal")
    return mesh_attribute(g, "hair", name.lower().replace(" ", "_"), "value")


def strand_ellipse(g, aspect):
    """A strand whose outline is an ellipse.

    @param  aspect  its smaller axis over the larger one, or the reverse, which Cycles takes for the same
    @return  (direction of its larger axis in the world, 1 where rays meet the ellipse within the circle about it).
             Shadows are of the circle, as Cycles bakes along strands what they let through
    """

    def dot(a, b):
        return g.op("vector-math", {"a": a, "b": b}, "value", operation="dot")

    def math(operation, a, b):
        return g.op("math", {"a": a, "b": b}, "value", operation=operation)

    axis = mesh_attribute(g, "hair", "axis", "vector")
    axis = g.op("vector-transform", {"vector": axis}, "vector", **{"transform": "vector", "from": "object", "to": "world"})
    axis = g.op("vector-math", {"a": axis}, "vector", operation="normalize")
    geometry = g.add("geometry", {})
    towards = _output(geometry, "tangentNormal")
    flatter = math("minimum", aspect, math("divide", 1.0, aspect))
    less = math("multiply", math("subtract", 1.0, math("multiply", flatter, flatter)), math("power", dot(axis, towards), 2.0))
    # The square of where the circle is met, from its middle, beside that of the outline's radius.
    cosine = dot(_output(geometry, "normal"), towards)
    is_met = math("greater-than", math("multiply", cosine, cosine), less)
    return axis, math("maximum", is_met, _output(g.add("light-path"), "shadow"))


def _point_info(g, source):
    """In the world. Of a surface that is no point all is 0."""
    name = source.socket.identifier.lower()
    if name == "random":
        return mesh_attribute(g, "point", name, "value")

    def in_world(vector, transform):
        spaces = {"from": "object", "to": "world"}
        return g.op("vector-transform", {"vector": vector}, "vector", transform=transform, **spaces)

    if name == "position":
        position = in_world(mesh_attribute(g, "point", name, "vector"), "point")
        is_point = mesh_attribute(g, "point", "is_point", "value")
        return g.op("vector-math", {"a": position, "b": is_point}, "vector", operation="multiply")
    # As much as along the diagonal, as in Cycles.
    along = g.op("vector-math", {"a": mesh_attribute(g, "point", name, "value"), "b": [3**-0.5] * 3}, "vector", operation="multiply")
    return g.op("vector-math", {"a": in_world(along, "vector")}, "value", operation="length")


def _made_color(kind, name):
    """Writer of a node that makes a colour of a number, by its name."""

    def write(g, source):
        node = source.node
        color = _output(g.add(kind, g.inputs(node, source.groups, {name: name.lower()})), "color")
        converted = g.made_color(color)
        if kind == "wavelength" and converted is not color:
            g.warn(f'node "{node.name}" ({node.bl_label}) in a working space of other primaries', "colours end at Rec. 709")
        return converted

    return write


def _rgb_to_bw(g, source):
    color = g.inputs(source.node, source.groups, {"Color": "color"})
    weighted = g.grey(color["color"])
    return _output(g.add("rgb-to-bw", color), "value") if weighted is color["color"] else weighted


def _by_normal(kind, names):
    """Writer of a node whose Normal may be linked.

    @param  names  our names of the inputs by Blender's
    """

    def write(g, source):
        node, groups = source.node, source.groups
        inputs = g.inputs(node, groups, names)
        normal = g.normal(node.inputs["Normal"], groups)
        if normal is not None:
            inputs["normal"] = normal
        name = source.socket.identifier
        return _output(g.add(kind, inputs), "factor" if name in {"Fac", "Factor"} else name.lower())

    return write


def _radial_tiling(g, source):
    """Radial Tiling of 5.0: the plane in sectors about the origin, each with coordinates across and along its bisector."""
    node, groups = source.node, source.groups
    sides, roundness = (g.constant(node.inputs[name], groups) for name in ("Sides", "Roundness"))
    if sides is None or (sides := max(sides, 2.0)) != math.floor(sides):
        raise not_understood(node, "sides that vary or are no whole number")
    if roundness is None or 0.0 < roundness < 1.0:
        raise not_understood(node, "a roundness other than 0 and 1")
    half = math.pi / sides

    def op(operation, a, b=0.0):
        return g.op("math", {"a": a, "b": b}, "value", operation=operation)

    parts = g.add("separate", g.inputs(node, groups, {"Vector": "vector"}))
    x, y = _output(parts, "x"), _output(parts, "y")
    turn = op("add", op("arctangent2", y, x), op("multiply", op("less-than", y, 0.0), 2.0 * math.pi))
    number = op("floor", op("divide", turn, 2.0 * half))
    name = source.socket.name
    if name == "Segment ID":
        return number
    if name == "Segment Rotation":
        return op("add", op("multiply", number, 2.0 * half), half)
    is_round = roundness >= 1.0
    if name == "Segment Width":
        return _constant(g, half if is_round else math.tan(half) if sides != 2.0 else 0.0)
    aside = op("subtract", op("subtract", turn, op("multiply", number, 2.0 * half)), half)
    length = g.op("vector-math", {"a": g.op("combine", {"x": x, "y": y}, "vector")}, "value", operation="length")
    if is_round:
        across, along = op("divide", aside, half) if node.normalize else aside, length
    else:
        along = op("multiply", length, op("cosine", aside))
        is_whole = not node.normalize or sides == 2.0  # whose sectors are half planes, without an end aside
        across = op("multiply", length, op("sine", aside)) if is_whole else op("divide", op("tangent", aside), math.tan(half))
    if node.normalize:
        across = op("add", op("multiply", across, 0.5), 0.5)
    else:
        along = op("subtract", along, 1.0)  # from the side of a polygon about the unit circle on
    return g.op("combine", {"x": across, "y": along}, "vector")


#: What gives an output of a node.
OUTPUTS = {
    "ShaderNodeTexCoord": _texture_coordinate,
    "ShaderNodeUVMap": _uv_map,
    "ShaderNodeNewGeometry": _geometry,
    "ShaderNodeObjectInfo": _object_info,
    "ShaderNodeParticleInfo": _particle_info,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeCameraData": _camera_data,
    "ShaderNodeAttribute": _attribute,
    "ShaderNodeVertexColor": _color_attribute,
    "ShaderNodeTangent": _tangent,
    "ShaderNodeNormalMap": _normal_map,
    "ShaderNodeVectorTransform": _vector_transform,
    "ShaderNodeNormal": _normal,
    "ShaderNodeWireframe": _wireframe,
    "ShaderNodeAmbientOcclusion": _ambient_occlusion,
    "ShaderNodeBevel": _bevel,
    "ShaderNodeLightFalloff": _light_falloff,
    "ShaderNodeTexIES": _ies,
    "ShaderNodeVolumeInfo": _volume_info,
    "ShaderNodeHairInfo": _hair_info,
    "GeometryNodeInputSceneTime": _scene_time,
    "ShaderNodeRadialTiling": _radial_tiling,
    "NodeImplicitConversion": _implicit_conversion,
    "ShaderNodePointInfo": _point_info,
    "ShaderNodeBlackbody": _made_color("blackbody", "Temperature"),
    "ShaderNodeWavelength": _made_color("wavelength", "Wavelength"),
    "ShaderNodeRGBToBW": _rgb_to_bw,
    "ShaderNodeFresnel": _by_normal("fresnel", {"IOR": "ior"}),
    "ShaderNodeLayerWeight": _by_normal("layer-weight", {"Blend": "blend"}),
}
