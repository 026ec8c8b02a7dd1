# SPDX-License-Identifier: GPL-3.0-or-later
"""Value graphs of lights: what their nodes read where there is no surface, as Cycles has it.

A light's own coordinates are few: normal, incoming direction, position, and a place on it. Positions are the world's, and
of suns directions; of objects' properties there is Random alone.
"""

from .. import compat
from . import nodes
from .emission import EmissionTree
from .graph import GraphWriter
from .not_understood import not_understood
from .texture import ies_uri, image_options


def read_emission(light, random, writer, images, warn):
    """Factor on a light's colour that its nodes give.

    @param  light   bpy light that uses nodes
    @param  random  what Object Info says of its object
    @param  writer  GltfWriter
    @param  images  ImageExporter
    @return         three numbers, or a graph for RELIEF_light and RELIEF_area_light
    """

    def warn_of_own(what, instead=""):
        warn(nodes.original_names(light, what), instead)

    tree = EmissionTree(LightGraph(light, random, writer, images, warn_of_own), warn_of_own)
    with nodes.reading():
        output = nodes.active_output(nodes.tree_of(light), "ShaderNodeOutputLight")
        tree.collect(nodes.linked(output.inputs["Surface"]) if output else None)
        total = tree.total()
    if isinstance(total, list):
        return total
    return {"nodes": tree.graph.nodes, "outputs": {"emission": total}}


def multiplied(graph, factor):
    """A light's graph times three numbers: what takes light away is a graph's to say.

    @param  graph  as read_emission returns it; None: a white light's
    """
    if graph is None:
        return {"nodes": [], "outputs": {"emission": factor}}
    product = {"type": "vector-math", "operation": "multiply", "inputs": {"a": graph["outputs"]["emission"], "b": factor}}
    return {
        "nodes": [*graph["nodes"], product],
        "outputs": {"emission": {"node": len(graph["nodes"]), "output": "vector"}},
    }


class LightGraph(GraphWriter):
    """Value graph of a light, see read_emission."""

    def __init__(self, light, random, writer, images, warn):
        def texture(node):
            return image_options(node, writer, images, warn)

        super().__init__(lambda name: None, texture, lambda node: ies_uri(node, writer), warn, moment=images.moment)
        self._light = light
        self._random = random

    def output(self, source):
        own = self._OWN.get(source.node.bl_idname)
        return super().output(source) if own is None else own(self, source)

    def generated(self):
        return self._position() if not compat.LIGHTS_ARE_OBJECTS else super().generated()

    def uv(self, name):
        if name or not compat.LIGHTS_HAVE_UV:
            return self._constant((0.0, 0.0, 0.0))
        return self._read("texture-coordinate", "uv")

    def coordinate_normal(self):
        if self._light.type != "SUN":
            return super().coordinate_normal()
        spaces = {"from": "world", "to": "object"}
        vector = {"vector": self.geometry_normal()}
        return self.op("vector-transform", vector, "vector", transform="normal", **spaces)

    def geometry_normal(self):
        # A sun is a disk here, whose normal is its axis.
        return self._read("geometry", "incoming" if self._light.type == "SUN" else "normal")

    def _read(self, kind, output):
        return {"node": self.add(kind), "output": output}

    def _constant(self, value):
        if isinstance(value, tuple):
            return self.op("combine", dict(zip("xyz", value)), "vector")
        return self.op("math", {"a": value, "b": 0.0}, "value", operation="add")

    def _position(self):
        return self._read("geometry", "incoming" if self._light.type == "SUN" else "position")

    def _texture_coordinate(self, source):
        node, name = source.node, source.socket.identifier
        if name in {"Camera", "Window"}:
            raise not_understood(node, f"{name} of a light")
        if name in {"UV", "Generated"} and node.from_instancer:
            return self._constant((0.0, 0.0, 0.0))
        if name == "Object":
            if node.object is not None:
                matrix = [c for row in node.object.matrix_world.inverted_safe()[:3] for c in row]
                return self.op("transform", {"vector": self._position()}, "vector", matrix=matrix)
            return self._read("texture-coordinate", "object") if compat.LIGHTS_ARE_OBJECTS else self._position()
        own = {"Generated": self.generated, "Normal": self.coordinate_normal, "UV": lambda: self.uv("")}
        return own[name]() if name in own else self._read("geometry", "incoming")

    def _uv_map(self, source):
        return self.uv("?" if source.node.from_instancer else source.node.uv_map)

    def _geometry(self, source):
        name = source.socket.identifier
        if name == "Position":
            return self._position()
        if name in {"Normal", "True Normal"}:
            return self.geometry_normal()
        if name in {"Pointiness", "Random Per Island"}:
            return self._constant(0.0)
        if name == "Tangent" or (name == "Parametric" and not self._has_parametric()):
            raise not_understood(source.node, f"{name} of a light")
        return self._read("geometry", name.lower())

    def _has_parametric(self):
        return compat.LIGHTS_HAVE_UV or self._light.type == "AREA"

    def _object_info(self, source):
        name = source.socket.identifier
        if compat.LIGHTS_ARE_OBJECTS and name != "Random":
            raise not_understood(source.node, f"{name} of a light")
        if name in {"Location", "Color"}:
            return self._constant((0.0, 0.0, 0.0))
        return self._constant(self._random if name == "Random" else 0.0)

    def _light_path(self, source):
        if source.socket.identifier == "Ray Length" and self._light.type == "SUN":
            raise not_understood(source.node, "the distance of a sun")
        return super().output(source)

    def _falloff(self, source):
        if source.socket.identifier != "Quadratic" and self._light.type == "SUN":
            raise not_understood(source.node, "the distance of a sun")
        return super().output(source)

    def _nothing(self, source):
        """An output of a mesh's attributes, of which a light has none."""
        if source.socket.name == "Alpha":
            return self._constant(1.0)
        return self._constant(0.0 if source.socket.type == "VALUE" else (0.0, 0.0, 0.0))

    def _attribute(self, source):
        node = source.node
        if node.attribute_type == "VIEW_LAYER":
            return super().output(source)
        if node.attribute_type == "GEOMETRY" and node.attribute_name in {"uv", "generated"} and source.socket.name == "Vector":
            return self.uv("") if node.attribute_name == "uv" else self.generated()
        return self._nothing(source)

    def _of_surface(self, source):
        raise not_understood(source.node, "of a light")

    _OWN = {
        "ShaderNodeTexCoord": _texture_coordinate,
        "ShaderNodeUVMap": _uv_map,
        "ShaderNodeNewGeometry": _geometry,
        "ShaderNodeObjectInfo": _object_info,
        "ShaderNodeLightPath": _light_path,
        "ShaderNodeLightFalloff": _falloff,
        "ShaderNodeParticleInfo": _nothing,
        "ShaderNodeAttribute": _attribute,
        "ShaderNodeVertexColor": _nothing,
        "ShaderNodeHairInfo": _nothing,
        "ShaderNodeTangent": _of_surface,
        "ShaderNodeNormalMap": _of_surface,
        "ShaderNodeBump": _of_surface,
    }
