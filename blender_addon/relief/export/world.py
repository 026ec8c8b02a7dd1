# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as RELIEF_environment: a colour, a lat-long image turned about Z, or a graph over directions."""

import math
from dataclasses import dataclass

import numpy as np

from .. import compat
from . import nodes
from .axes import environment_rotation
from .emission import EmissionTree
from .graph import GraphWriter
from .image import MISSING, is_encoded, reads_as_stored
from .not_understood import NotUnderstood
from .texture import ies_uri, image_options
from .visibility import hidden_settings
from .volume import VolumeWriter


@dataclass
class Eye:
    """What a world that is seen by the camera's coordinates depends on.

    axes         rows of a 3×3: right, up and forward in Blender's axes, unit
    half_window  half the width and height of the window at distance 1
    shift        of the window, in fractions of its width and height
    """

    axes: np.ndarray
    half_window: tuple
    shift: tuple

    @classmethod
    def of(cls, camera, matrix, size):
        """None where rays do not go out from one point, or there is no camera: a viewport that is turned is not exported again.

        @param  camera, matrix, size  of a View
        """
        extension = camera.get("extensions", {}).get("RELIEF_camera")
        if camera["type"] != "perspective" or extension is None or "panorama" in extension:
            return None
        columns = np.array(matrix, dtype=np.float64)[:3, :3]
        right, up, back = (columns / np.linalg.norm(columns, axis=0)).T
        half_height = math.tan(camera["perspective"]["yfov"] / 2)
        half_window = (half_height * size[0] * extension.get("pixelAspect", 1) / size[1], half_height)
        return cls(np.stack([right, up, -back]), half_window, tuple(extension["shift"]))


def export_world(world, visible_to_camera, clear_roughness, light_groups, eye, writer, images, report):
    """Adds the surroundings. Without a world, or with a black one, there is none.

    @param  world              bpy world or None
    @param  visible_to_camera  False: films with a transparent background
    @param  clear_roughness    up to which glass is as clear as air then; None: it is opaque
    @param  light_groups       names of those that have passes
    @param  eye                Eye or None
    @param  writer             GltfWriter
    @param  images             ImageExporter
    @param  report             Report
    """
    if world is None:
        environment = {"color": [0.0, 0.0, 0.0]}
    else:
        environment = _environment(world, eye, writer, images, lambda *text: report.warn(f'world "{world.name}"', *text))
    seen = environment.get("visibleToCamera", True) and (world is None or compat.sees_world(world, "camera"))
    environment["visibleToCamera"] = visible_to_camera and seen
    if not visible_to_camera and clear_roughness is not None:
        environment["clearGlass"] = clear_roughness
    if world is not None:
        environment.update(hidden_settings(lambda ray: compat.sees_world(world, ray)))
        if not world.relief.caustic_light:
            environment["causticLight"] = False
        if world.lightgroup in light_groups:
            environment["lightGroup"] = world.lightgroup
    writer.extend(writer.json, "RELIEF_environment", environment)


def _environment(world, eye, writer, images, warn):
    """RELIEF_environment of a world, but for what says who sees it."""
    if not world.use_nodes:
        return _even(nodes.finite(tuple(world.color), "its colour", warn))

    def warn_of_own(what, instead=""):
        warn(nodes.original_names(world, what), instead)

    with nodes.reading():
        output = nodes.active_output(nodes.tree_of(world), "ShaderNodeOutputWorld")
        source, volume = (nodes.linked(output.inputs[name]) if output else None for name in ("Surface", "Volume"))
        environment = _surroundings(source, eye, writer, images, warn_of_own)
        if volume is not None:
            _add_medium(environment, volume, writer, images, warn_of_own)
    return environment


def _add_medium(environment, source, writer, images, warn):
    """What fills the world."""
    graph = WorldGraph(writer, images, warn)
    medium = VolumeWriter(graph, lambda _source, what, instead, _error=None: warn(what, instead))
    medium.write(source)
    if medium.closures:
        nodes_of = {"nodes": graph.nodes} if medium.varies else {}
        environment["volume"] = {"closures": medium.closures, **nodes_of}


def _surroundings(source, eye, writer, images, warn):
    """RELIEF_environment of a shader, None: it is black."""
    if source is None:
        return {"color": [0.0, 0.0, 0.0]}
    seen = _Surroundings(eye, writer, images, warn, is_camera=False)
    backdrop = None
    environment = seen.read(source)
    if seen.asks_for_camera:
        backdrop = _Surroundings(eye, writer, images, lambda *_: None, is_camera=True).read(source)
    if backdrop == {"color": [0.0, 0.0, 0.0]}:
        environment["visibleToCamera"] = False
    elif backdrop is not None and (backdrop != environment or "graph" in backdrop):
        environment["backdrop"] = backdrop
    return environment


def _even(color):
    """Surroundings of one colour. Those that take light away are a graph's to say."""
    if min(color) < 0:
        return {"graph": {"nodes": [], "outputs": {"color": list(color)}}}
    return {"color": list(color)}


class _Surroundings(EmissionTree):
    """What a world's tree of shaders comes to.

    @param  is_camera  whether a camera ray looks: what Light Path's Is Camera Ray says
    asks_for_camera    whether something depended on that
    """

    def __init__(self, eye, writer, images, warn, is_camera):
        super().__init__(WorldGraph(writer, images, warn, eye), warn)
        self._images = images
        self._is_camera = is_camera
        self.asks_for_camera = False

    def read(self, source):
        self.collect(source)
        if len(self.terms) == 1 and self.terms[0][1] == 1.0:
            plain = self._plain(self.terms[0][0])
            if plain is not None:
                return plain
        total = self.total()
        if isinstance(total, list):
            return _even(total)
        if any(node["type"] == "light-path" for node in self.graph.nodes):
            self.asks_for_camera = True
        return {"graph": {"nodes": self.graph.nodes, "outputs": {"color": total}}}

    def factor(self, socket, groups):
        source = nodes.linked(socket, groups)
        if source is not None and source.node.bl_idname == "ShaderNodeLightPath":
            if source.socket.identifier == "Is Camera Ray":
                self.asks_for_camera = True
                return 1.0 if self._is_camera else 0.0
        return super().factor(socket, groups)

    def _plain(self, source):
        """A single background that needs no graph; None: it does."""
        inputs = source.node.inputs
        strength = self.graph.constant(inputs["Strength"], source.groups)
        if strength is None:
            return None
        value = self.graph.constant(inputs["Color"], source.groups)
        if strength == 0:
            return {"color": [0.0, 0.0, 0.0]}
        if strength < 0 or (value is not None and min(value) < 0):
            return None
        if value is not None:
            return {"color": list(value), "strength": strength}
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
        if is_encoded(texture.node.image) or not reads_as_stored(texture.node.image, True, False):
            return None
        uri = self._images.color_uri(texture.node.image, texture.node.image_user, self.warn)
        return {"uri": uri, "strength": strength, "rotation": environment_rotation(turn)}


class WorldGraph(GraphWriter):
    """Value graph of a world, in which textures look into a direction.

    @param  eye  Eye by which coordinates of the camera are told; None: they are left to the program
    """

    def __init__(self, writer, images, warn, eye=None):
        super().__init__(
            lambda name: None,
            lambda node: image_options(node, writer, images, warn),
            lambda node: ies_uri(node, writer),
            warn,
            moment=images.moment,
        )
        self._eye = eye

    def output(self, source):
        own = {"ShaderNodeTexEnvironment": self._image_around, "ShaderNodeTexSky": self._sky}
        if self._eye is not None and source.socket.identifier in {"Camera", "Window"}:
            own["ShaderNodeTexCoord"] = self._seen_from_the_eye
        write = own.get(source.node.bl_idname, super().output)
        if source.node.bl_idname == "ShaderNodeLightPath" and source.socket.identifier != "Is Camera Ray":
            self.warn(f'node "{source.node.name}": {source.socket.name}', "all rays but the camera's see the same")
        return write(source)

    def _seen_from_the_eye(self, source):
        """Coordinates of a direction as those of a point that far from the camera, as Cycles has them for all rays."""
        matrix = [c for row in self._eye.axes for c in (*row.tolist(), 0.0)]
        direction = self.op("transform", {"vector": self.op("geometry", {}, "position")}, "vector", matrix=matrix)
        if source.socket.identifier == "Camera":
            return direction
        parts = self.add("separate", {"vector": direction})
        window = {}
        for axis, half, shift in zip("xy", self._eye.half_window, self._eye.shift):
            across = {"node": parts, "output": axis}
            slope = self.op("math", {"a": across, "b": {"node": parts, "output": "z"}}, "value", operation="divide")
            window[axis] = self.op(
                "math", {"a": slope, "b": 0.5 / half, "c": 0.5 - shift}, "value", operation="multiply-add"
            )
        return self.op("combine", {**window, "z": 0.0}, "vector")

    def _image_around(self, source):
        node = source.node
        if node.image is None:
            return self.op("combine-color", {"red": 1.0, "green": 0.0, "blue": 1.0}, "color")
        if node.interpolation not in {"Linear", "Closest"}:
            self.warn(f'node "{node.name}": interpolation {node.interpolation}', "Linear was used")
        return self.op(
            "environment-texture",
            {"vector": self.vector(node, source.groups, "generated")},
            "alpha" if source.socket.identifier == "Alpha" else "color",
            projection="mirror-ball" if node.projection == "MIRROR_BALL" else "equirectangular",
            **self.texture(node),
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
            return self.made_color(self.op("sky-texture", vector, "color", **settings))
        elevation, turn = _sun_angles(node.sun_elevation, node.sun_rotation)
        color = self.op(
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
        return self.made_color(color)


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
