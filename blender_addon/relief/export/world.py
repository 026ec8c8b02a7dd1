# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as RELIEF_environment: a colour, a lat-long image turned about Z, or a graph over directions."""

import math

from .. import compat
from . import nodes
from .axes import environment_rotation
from .graph import GraphWriter, NotUnderstood
from .texture import MISSING


def export_world(world, visible_to_camera, writer, images, report):
    """Adds the surroundings. Without a world, or with a black one, there is none.

    @param  world              bpy world or None
    @param  visible_to_camera  False: films with a transparent background
    @param  writer             GltfWriter
    @param  images             ImageExporter
    @param  report             Report
    """
    if world is None:
        environment = {"color": [0.0, 0.0, 0.0]}
    else:
        environment = _environment(world, writer, images, lambda *text: report.warn(f'world "{world.name}"', *text))
    seen = environment.get("visibleToCamera", True) and (world is None or compat.sees_world(world, "camera"))
    environment["visibleToCamera"] = visible_to_camera and seen
    for ray in ("diffuse", "glossy", "transmission"):
        if world is not None and not compat.sees_world(world, ray):
            environment[f"visibleTo{ray.capitalize()}"] = False
    if world is not None and not world.relief.caustic_light:
        environment["causticLight"] = False
    writer.extend(writer.json, "RELIEF_environment", environment)


def _environment(world, writer, images, warn):
    """RELIEF_environment of a world, but for what says who sees it."""
    if not world.use_nodes:
        return {"color": [max(0.0, c) for c in nodes.finite(tuple(world.color), "its colour", warn)]}
    output = nodes.active_output(world.node_tree, "ShaderNodeOutputWorld")
    if output and nodes.linked(output.inputs["Volume"]) is not None:
        warn("a volume", "it is left out")
    source = nodes.linked(output.inputs["Surface"]) if output else None
    if source is None:
        return {"color": [0.0, 0.0, 0.0]}
    seen = _Surroundings(writer, images, warn, is_camera=False)
    in_picture = None
    with nodes.reading():
        environment = seen.read(source)
        if seen.asks_for_camera:
            in_picture = _Surroundings(writer, images, lambda *_: None, is_camera=True).read(source)
    if in_picture is not None:
        if in_picture == {"color": [0.0, 0.0, 0.0]}:
            environment["visibleToCamera"] = False
        elif in_picture != environment:
            warn("surroundings of their own for the camera", "it sees those that other rays see")
    return environment


_BLACK = [0.0, 0.0, 0.0]


class _Surroundings:
    """What a world's tree of shaders comes to: a sum of backgrounds, each times its weight.

    @param  is_camera  whether a camera ray looks: what Light Path's Is Camera Ray says
    asks_for_camera    whether a weight depended on that
    """

    def __init__(self, writer, images, warn, is_camera):
        self._writer = writer
        self._images = images
        self._warn = warn
        self._is_camera = is_camera
        self.asks_for_camera = False
        self._graph = WorldGraph(writer, images, warn)
        self._terms = []  # (Source of a Background, its weight)

    def read(self, source):
        self._collect(source, 1.0, ())
        if len(self._terms) == 1 and self._terms[0][1] == 1.0:
            plain = self._plain(self._terms[0][0])
            if plain is not None:
                return plain
        total = _BLACK
        for term, weight in self._terms:
            radiance = self._radiance(term)
            total = self._sum(total, self._times(radiance, weight))
        if isinstance(total, list):
            return {"color": [max(0.0, c) for c in total]}
        if any(node["type"] == "light-path" for node in self._graph.nodes):
            self._warn("surroundings that depend on the ray by more than a factor", "all rays see the same")
        return {"graph": {"nodes": self._graph.nodes, "outputs": {"color": total}}}

    def _collect(self, source, weight, above):
        """Adds the backgrounds below a shader."""
        if source is None or source.is_value or weight == 0.0:
            return
        node, inputs = source.node, source.node.inputs
        if source.key in above:
            self._warn(f'node "{node.name}" ({node.bl_label}), which is linked in a circle', "black was used")
            return
        above = (*above, source.key)

        def below(socket, weight):
            self._collect(nodes.linked(socket, source.groups), weight, above)

        if node.bl_idname == "ShaderNodeAddShader":
            below(inputs[0], weight)
            below(inputs[1], weight)
        elif node.bl_idname == "ShaderNodeMixShader":
            factor = self._factor(inputs[0], source.groups)
            below(inputs[1], self._product(weight, self._inverse(factor)))
            below(inputs[2], self._product(weight, factor))
        elif node.bl_idname in {"ShaderNodeBackground", "ShaderNodeEmission"}:
            self._terms.append((source, weight))
        else:
            self._warn(f'node "{node.name}" ({node.bl_label}) as surface', "black was used")

    def _factor(self, socket, groups):
        """A Mix Shader's factor, from 0 to 1."""
        source = nodes.linked(socket, groups)
        if source is not None and source.node.bl_idname == "ShaderNodeLightPath":
            if source.socket.identifier == "Is Camera Ray":
                self.asks_for_camera = True
                return 1.0 if self._is_camera else 0.0
        value = self._value(socket, groups)
        if isinstance(value, dict):
            return self._graph.op("clamp", {"value": value}, "value")
        return min(max(value, 0.0), 1.0)

    def _value(self, socket, groups):
        """An input as graphs have it; what they do not know is warned about, and the socket's own value taken."""
        try:
            return self._graph.value(socket, groups)
        except NotUnderstood as error:
            value = nodes.own_value(socket)
            if isinstance(value, tuple):
                value = [float(c) for c in value[:3]]
                self._warn(str(error), f"the value {tuple(round(c, 4) for c in value)} was used")
            else:
                self._warn(str(error), f"the value {round(value, 4)} was used")
            return value

    def _radiance(self, source):
        inputs = source.node.inputs
        strength = self._value(inputs["Strength"], source.groups)
        if strength == 0.0:
            return _BLACK
        return self._times(self._value(inputs["Color"], source.groups), strength)

    def _product(self, a, b):
        """Of two numbers."""
        if not isinstance(a, dict) and not isinstance(b, dict):
            return a * b
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        if a == 0.0 or b == 0.0:
            return 0.0
        return self._graph.op("math", {"a": a, "b": b}, "value", operation="multiply")

    def _inverse(self, factor):
        if not isinstance(factor, dict):
            return 1.0 - factor
        return self._graph.op("math", {"a": 1.0, "b": factor}, "value", operation="subtract")

    def _times(self, color, weight):
        if weight == 0.0 or color == _BLACK:
            return _BLACK
        if weight == 1.0:
            return color
        if isinstance(color, list) and not isinstance(weight, dict):
            return [c * weight for c in color]
        return self._graph.op("vector-math", {"a": color, "scale": weight}, "vector", operation="scale")

    def _sum(self, a, b):
        if a == _BLACK or b == _BLACK:
            return b if a == _BLACK else a
        if isinstance(a, list) and isinstance(b, list):
            return [x + y for x, y in zip(a, b)]
        return self._graph.op("vector-math", {"a": a, "b": b}, "vector", operation="add")

    def _plain(self, source):
        """A single background that needs no graph; None: it does."""
        inputs = source.node.inputs
        strength = self._graph.constant(inputs["Strength"], source.groups)
        if strength is None:
            return None
        strength = max(0.0, strength)
        if strength == 0:
            return {"color": [0.0, 0.0, 0.0]}
        value = self._graph.constant(inputs["Color"], source.groups)
        if value is not None:
            return {"color": [max(0.0, c) for c in value], "strength": strength}
        texture = nodes.follow(inputs["Color"], source.groups)
        if texture.node.bl_idname != "ShaderNodeTexEnvironment" or texture.node.projection != "EQUIRECTANGULAR":
            return None
        if not nodes.has_plain_mapping(texture.node) or texture.node.interpolation != "Linear":
            return None
        turn = _turn_about_z(texture.node, texture.groups)
        if turn is None:
            return None
        if texture.node.image is None:
            return {"color": list(MISSING), "strength": strength}
        uri = self._images.color_uri(texture.node.image, texture.node.image_user, self._warn)
        if uri is None:
            return {"color": list(MISSING), "strength": strength}
        return {"uri": uri, "strength": strength, "rotation": environment_rotation(turn)}


class WorldGraph(GraphWriter):
    """Value graph of a world, in which textures look into a direction."""

    def __init__(self, writer, images, warn):
        super().__init__(lambda name: None, lambda node: None, warn)
        self._writer = writer
        self._images = images

    def output(self, source):
        own = {"ShaderNodeTexEnvironment": self._image_around, "ShaderNodeTexSky": self._sky}
        write = own.get(source.node.bl_idname, super().output)
        return write(source)

    def _image_around(self, source):
        node = source.node
        if node.image is None:
            return self.op("combine-color", {"red": 1.0, "green": 0.0, "blue": 1.0}, "color")
        uri = self._images.color_uri(node.image, node.image_user, self.warn)
        if uri is None:
            raise NotUnderstood(f'node "{node.name}": an image without file')
        if node.interpolation not in {"Linear", "Closest"}:
            self.warn(f'node "{node.name}": interpolation {node.interpolation}', "Linear was used")
        return self.op(
            "environment-texture",
            {"vector": self.vector(node, source.groups, "generated")},
            "alpha" if source.socket.identifier == "Alpha" else "color",
            projection="mirror-ball" if node.projection == "MIRROR_BALL" else "equirectangular",
            texture={"index": self._writer.add_texture(uri, _REPEAT, node.interpolation == "Closest")},
            colorSpace="linear" if node.image.colorspace_settings.is_data else "srgb",
        )

    def _sky(self, source):
        node = source.node
        kind = compat.sky_kind(node)
        if kind is None:
            raise NotUnderstood(f'node "{node.name}" ({node.bl_label}): {node.sky_type.lower()}')
        if kind in {"preetham", "hosek-wilkie"}:
            vector = {"vector": self.vector(node, source.groups, "generated")}
            settings = {"sky": kind, "sunDirection": list(node.sun_direction), "turbidity": node.turbidity}
            if kind == "hosek-wilkie":
                settings["groundAlbedo"] = node.ground_albedo
            return self.op("sky-texture", vector, "color", **settings)
        elevation, turn = _sun_angles(node.sun_elevation, node.sun_rotation)
        return self.op(
            "sky-texture",
            {"vector": self.vector(node, source.groups, "generated")},
            "color",
            sky=None if kind == "nishita" else kind,
            sunDisc=node.sun_disc,
            sunSize=node.sun_size,
            sunIntensity=node.sun_intensity,
            sunElevation=elevation,
            sunRotation=turn,
            altitude=node.altitude,
            air=node.air_density,
            dust=node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density,
            ozone=node.ozone_density,
        )


#: glTF's wrap mode.
_REPEAT = 10497


def _sun_angles(elevation, turn):
    """A sun's elevation and rotation; one that has risen past the zenith goes down on the other side."""
    elevation = math.remainder(elevation, 2 * math.pi)
    if abs(elevation) <= math.pi / 2:
        return elevation, turn
    return math.copysign(math.pi, elevation) - elevation, turn + math.pi


def _turn_about_z(texture, groups):
    """Radians by which a texture's direction is turned about Z; None: something else is done to it."""
    vector = nodes.linked(texture.inputs["Vector"], groups)
    if vector is None:
        return 0.0
    node = vector.node
    if node.bl_idname == "ShaderNodeTexCoord":
        return 0.0 if vector.socket.name == "Generated" else None
    if node.bl_idname != "ShaderNodeMapping":
        return None
    before = nodes.linked(node.inputs["Vector"], vector.groups)
    if before is not None and (before.node.bl_idname != "ShaderNodeTexCoord" or before.socket.name != "Generated"):
        return None
    values = [nodes.fold(node.inputs[name], vector.groups) for name in ("Rotation", "Scale")]
    moved = nodes.fold(node.inputs["Location"], vector.groups) if node.inputs["Location"].enabled else (0, 0, 0)
    if any(value is None for value in (*values, moved)):
        return None
    rotation, scale = (nodes.as_color(value) for value in values)
    if before is None or any(rotation[:2]) or any(nodes.as_color(moved)) or any(s != 1 for s in scale):
        return None
    if not all(math.isfinite(c) for c in rotation):
        return None
    # Texture mapping applies the inverse, a turn the other way.
    return -rotation[2] if node.vector_type == "TEXTURE" else rotation[2]
