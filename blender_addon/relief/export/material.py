# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials as glTF materials: the surface, its textures, its absorption, its displacement."""

import math

from .. import compat
from . import nodes
from .coverage import coverage_of
from .displacement import bump_displaces, diced, export_displacement
from .graph import GraphWriter, bump_of_displacement
from .light import set_emission
from .mesh import Wanted
from .not_understood import NotUnderstood
from .settings import filters_glossy, occlusion_distance
from .surface import TRANSPARENT, ClosureWriter, Inside, Surface, plain_surface
from .texture import Input, TextureReader, ies_uri, image_options
from .volume import VolumeWriter
from .voxels import Grids

#: The format has two sets of texture coordinates a vertex.
_MOST_COORDINATES = 2

#: Solid glass is told from thin walls by a thickness that is not zero; its size means nothing to a ray tracer.
_SOLID = 1.0


class MaterialExporter:
    """Exports each material once.

    @param  writer    GltfWriter
    @param  images    ImageExporter
    @param  settings  scene.relief
    @param  report    Report
    @param  view_layer  gives the things whose properties are the view layer's attributes, the first one first
    """

    def __init__(self, writer, images, settings, report, view_layer=tuple):
        self._view_layer = view_layer
        self._writer = writer
        self._images = images
        self._settings = settings
        self._report = report
        self._exported = {}

    def export(self, material, voxels=None):
        """(what add_mesh asks for the index of the glTF material, Wanted of its meshes); a slot without material is grey.

        @param  voxels  Voxels of the object that it is on
        """
        key = (None if material is None else material.as_pointer(), voxels)
        if key not in self._exported:
            job = MaterialJob(self._writer, self._images, self._settings, self._report, material, self._view_layer, voxels)
            if job.coverage is not None:
                self._report.count(material.name, job.coverage)
            wanted = job.wanted()
            self._exported[key] = (_Indices(self._writer, job.json, wanted.by_shading), wanted)
        return self._exported[key]


def has_volume(material):
    """Whether a bpy material fills what its objects bound; None, of volume objects, does."""
    if material is None:
        return True
    if not material.use_nodes or material.node_tree is None:
        return False
    with nodes.reading():
        output = nodes.active_output(nodes.tree_of(material), "ShaderNodeOutputMaterial")
        return output is not None and nodes.linked(output.inputs["Volume"]) is not None


def _has_closure(material, kind):
    closures = material.get("extensions", {}).get("RELIEF_surface", {}).get("closures", ())
    return any(closure["type"] == kind for closure in closures)


def emits(material):
    """Whether a glTF material gives light."""
    return any(material.get("emissiveFactor", ())) or _has_closure(material, "emission")


def holds_out(material):
    """Whether a glTF material is a hole in the picture, or in parts."""
    return _has_closure(material, "holdout")


class _Indices:
    """A material's place in the document, which it gets when a mesh uses it.

    @param  by_shading  whether faces that are shaded smooth have one of their own: the slopes of its displacement are smooth
    """

    def __init__(self, writer, json, by_shading):
        self._writer = writer
        self._json = json
        self._by_shading = by_shading
        self._indices = {}

    def __call__(self, is_smooth, dicing):
        """Index of the glTF material of smooth or of flat faces, of an object that Cycles dices (compat.Dicing) or not (None)."""
        is_displaced = "RELIEF_displacement" in self._json.get("extensions", {})
        key = (self._by_shading and is_smooth, dicing if is_displaced else None)
        if key not in self._indices:
            self._indices[key] = self._add(*key)
        return self._indices[key]

    def _add(self, is_smooth, dicing):
        json = self._json
        more = {"smoothing": True} if is_smooth else {}
        if dicing is not None:
            more.update(diced(json["extensions"]["RELIEF_displacement"], dicing))
        if more:
            extensions = json["extensions"]
            displacement = {**extensions["RELIEF_displacement"], **more}
            json = {**json, "extensions": {**extensions, "RELIEF_displacement": displacement}}
        return self._writer.add_unique("materials", json)


class MaterialJob:
    """One material on its way.

    json      the glTF material
    coverage  Coverage of its nodes; None without nodes
    """

    def __init__(self, writer, images, settings, report, material, view_layer=tuple, voxels=None):
        self._voxels = voxels
        self._writer = writer
        self._images = images
        self._material = material
        self._name = material.name if material else "default"
        self._report = report
        self._filters_glossy = filters_glossy(settings.id_data)
        self._coordinates = []
        self._color_map = None
        self._displaced = self._by_shading = self._uses_graph = self._uses_height_graph = False
        self._problems = {}
        self.json = {"name": self._name, "doubleSided": True}
        self.coverage = None

        def new_graph():
            return GraphWriter(
                self._coordinate_set,
                lambda node: image_options(node, writer, images, self._warn),
                lambda node: ies_uri(node, writer),
                warn=self._warn,
                material_index=material.pass_index if material else 0,
                view_layer=view_layer,
                moment=images.moment,
                occlusion_distance=occlusion_distance(settings.id_data),
            )

        self._graph, self._height_graph = new_graph(), new_graph()
        self._textures = TextureReader(self._warn)
        if material is not None and material.use_nodes and material.node_tree is not None:
            with nodes.reading():
                self._export_nodes(material, settings)
        elif material is None and isinstance(voxels, Grids):
            self._write_surface(TRANSPARENT)
            self._write_closures(lambda medium: medium.fill())
        elif material is None and compat.DEFAULT_CLOSURE is not None:
            self._extend("RELIEF_surface", {"closures": [compat.DEFAULT_CLOSURE]})
        else:
            color = (0.8, 0.8, 0.8) if material is None else tuple(material.diffuse_color[:3])
            self._write_surface(Surface(base_color=Input(nodes.finite(color, "its colour", self._warn))))

    def _export_nodes(self, material, settings):
        self._textures.takes_bump = bump_displaces(material, settings)
        output = nodes.active_output(nodes.tree_of(material), "ShaderNodeOutputMaterial")
        source, volume, displacement = (
            nodes.linked(output.inputs[name]) if output else None for name in ("Surface", "Volume", "Displacement")
        )
        if displacement and compat.displacement_method(material) == "BUMP" and not settings.bump_displaces:
            self._bump_by(displacement)
        self._graph.displaces = displacement is not None and compat.displacement_method(material) != "BUMP"
        inside = self._export_surface(source, volume is not None)
        if inside is Inside.OPEN and not compat.has_transparent_shadow(material):
            self._warn("shadows without transparency", "they are as transparent as the material")
        if not getattr(getattr(material, "cycles", None), "use_bump_map_correction", True):
            self._warn("Bump Map Correction switched off", "bump is corrected")
        self._write_volume(volume, inside)
        warned = self._displace(material, settings)
        if warned and displacement:
            self._problems.setdefault(displacement.key, warned[0])
        problems = {**self._graph.not_understood, **self._height_graph.not_understood, **self._problems}
        self.coverage = coverage_of([s for s in (source, volume, displacement) if s], problems, material)

    def _bump_by(self, displacement):
        """Bends the surface's own normal."""
        try:
            self._graph.own_normal = bump_of_displacement(self._graph, displacement)
        except NotUnderstood as error:
            self._fail(displacement, f"{error} as displacement", "nothing is displaced", error)

    def _export_surface(self, source, has_volume):
        """Returns the surface's Inside."""
        filters = self._filters_glossy
        plain = plain_surface(source, self._bends, filters) if source or not has_volume else TRANSPARENT
        if plain is not None:
            self._write_surface(plain)
            if plain.ior is not None:
                return Inside.BOUNDED
            return Inside.CLOSED if plain.alpha.is_constant(1.0) else Inside.OPEN
        closures = ClosureWriter(self._graph, self._past_bump, self._fail, filters)
        closures.write(source)
        if not closures.closures:  # black, or shining in the core's words
            self._write_surface(Surface(emission=closures.emission))
            return Inside.CLOSED
        surface = {"closures": closures.closures}
        if self._graph.own_normal is not None:
            surface["normal"] = self._graph.own_normal
        self._extend("RELIEF_surface", surface)
        refers = any(isinstance(value, dict) for closure in closures.closures for value in closure.values())
        self._uses_graph = refers or self._graph.own_normal is not None
        if self._uses_graph:
            self._extend("RELIEF_graph", {"nodes": self._graph.nodes})
        self._write_emission(closures.emission)
        return closures.inside

    def _displace(self, material, settings):
        """Adds the displacement; returns what was warned about."""
        warned = []

        def warn(what, instead=""):
            warned.append(what)
            self._warn(what, instead)

        self._textures.warn = warn
        value = export_displacement(
            material, settings, self._textures, self._data_info, self._images, self._height_graph, self._coordinates
        )
        self._uses_height_graph = value is not None and not {"heightGraph", "vectorGraph"}.isdisjoint(value)
        if value is not None:
            self._displaced = True
            self._by_shading = not value["smoothing"]
            if not self._coordinates:  # the map of a constant height
                self._coordinates.append(("uv", ""))
            self._extend("RELIEF_displacement", value)
        return warned

    def _past_bump(self, socket, groups):
        """The Normal input and its groups that count: behind a Bump that moves the surface instead."""
        source = nodes.linked(socket, groups)
        textures = self._textures
        if source is None or source.node.bl_idname != "ShaderNodeBump" or not textures.takes_bump:
            return socket, groups
        if textures.bump not in (None, source) or textures.image(source.node.inputs["Height"], source.groups) is None:
            return socket, groups
        textures.bump = source
        return source.node.inputs["Normal"], source.groups

    def _bends(self, socket, groups):
        return self._graph.own_normal is not None or self._graph.bends(*self._past_bump(socket, groups))

    def wanted(self):
        graphs = [self._graph] * self._uses_graph + [self._height_graph] * self._uses_height_graph
        return Wanted(
            tuple(self._coordinates),
            self._color_map,
            self._displaced,
            self._by_shading,
            any(graph.uses_generated for graph in graphs),
            any(graph.uses_tangents for graph in graphs),
            tuple(sorted({attribute for graph in graphs for attribute in graph.attributes})),
            tuple(sorted({value for graph in graphs for value in graph.values})),
        )

    def _fail(self, source, what, instead, error=None):
        """Notes what is not understood of a node, unless an error has noted it of another one."""
        if error is None:
            self._problems.setdefault(source.key, what)
        self._warn(what, instead)

    def _warn(self, what, instead=""):
        self._report.warn(f'material "{self._name}"', nodes.original_names(self._material, what), instead)

    def _extend(self, name, value):
        self._writer.extend(self.json, name, value)

    def _info(self, texture, uri):
        """glTF's reference to a texture, with its coordinates and transform; None without a file."""
        if uri is None:
            return None
        info = {"index": self._writer.add_texture(uri, texture.wrap, texture.nearest)}
        source = texture.mapping.source
        number = self._coordinate_set(source)
        if number is None:
            self._warn("more than two sets of texture coordinates", f"{self._coordinates[0]} was used for {source}")
        elif number > 0:
            info["texCoord"] = number
        transform = texture.mapping.transform()
        if transform is not None:
            self._writer.extend(info, "KHR_texture_transform", transform)
        return info

    def _coordinate_set(self, source):
        """Number of the set that coordinates are in; None: there is no room for another."""
        if source not in self._coordinates:
            if len(self._coordinates) == _MOST_COORDINATES:
                return None
            self._coordinates.append(source)
        return self._coordinates.index(source)

    def _color_info(self, texture):
        node = texture.node
        uri = self._images.color_uri(node.image, node.image_user, self._warn)
        return self._info(texture, uri)

    def _data_info(self, texture):
        node = texture.node
        if texture.channel is None:
            uri = self._images.data_uri(node.image, node.image_user, self._warn)
        else:
            uri = self._images.channel_uri(node.image, texture.channel, self._warn)
        return self._info(texture, uri)

    def _write_surface(self, surface):
        pbr = self.json["pbrMetallicRoughness"] = {}
        pbr["baseColorFactor"] = [*(min(max(c, 0.0), 1.0) for c in surface.base_color.value), 1.0]
        if surface.base_color.texture:
            info = self._color_info(surface.base_color.texture)
            if info:
                pbr["baseColorTexture"] = info
        self._color_map = surface.base_color.color_map
        self._write_alpha(surface, pbr)
        pbr["metallicFactor"] = 1.0 if surface.is_mirror else 0.0
        is_smooth = surface.is_mirror or surface.ior is not None
        pbr["roughnessFactor"] = 0.0 if is_smooth else 1.0
        if not is_smooth:
            self._extend("KHR_materials_specular", {"specularFactor": 0.0})
        if surface.ior is not None:
            self._extend("KHR_materials_transmission", {"transmissionFactor": 1.0})
            self._extend("KHR_materials_volume", {"thicknessFactor": _SOLID})
            self._extend("KHR_materials_ior", {"ior": surface.ior})
        self._write_emission(surface.emission)

    def _write_emission(self, emission):
        if emission.is_constant((0.0, 0.0, 0.0)):
            return
        set_emission(self.json, emission.value, self._writer)
        if emission.texture:
            info = self._color_info(emission.texture)
            if info:
                self.json["emissiveTexture"] = info

    def _write_alpha(self, surface, pbr):
        alpha = surface.alpha
        if alpha.is_constant(1.0):
            return
        self.json["alphaMode"] = "BLEND"
        pbr["baseColorFactor"][3] = min(max(alpha.value, 0.0), 1.0)
        if alpha.texture is not None and surface.base_color.texture is None:
            self._write_alpha_image(alpha.texture, pbr)

    def _write_alpha_image(self, texture, pbr):
        """Opacity by an image of its own over a plain colour: a white image with that alpha."""
        info = self._info(texture, self._images.alpha_uri(texture.node.image, texture.channel, self._warn))
        if info:
            pbr["baseColorTexture"] = info

    def _write_volume(self, source, inside):
        if source is None or inside == Inside.CLOSED:  # no light gets there, in Cycles neither
            return
        node, textures = source.node, self._textures
        if node.bl_idname != "ShaderNodeVolumeAbsorption" or inside == Inside.OPEN or self._varies(source):
            self._write_closures(lambda medium: medium.write(source))
            return
        color = textures.constant_color(node.inputs["Color"], source.groups)
        density = max(0.0, textures.constant_number(node.inputs["Density"], source.groups))
        coefficients = [density * (1.0 - min(max(c, 0.0), 1.0)) for c in color]
        if max(coefficients) <= 0:
            return
        # Absorption a metre; the format wants what is left after some distance: after one mean free path.
        distance = 1.0 / max(coefficients)
        value = {
            "thicknessFactor": _SOLID,
            "attenuationDistance": distance,
            "attenuationColor": [math.exp(-c * distance) for c in coefficients],
        }
        self._extend("KHR_materials_volume", value)

    def _varies(self, source):
        """Whether a Volume Absorption's colour or density is no number that a graph need not give."""
        sockets = (source.node.inputs[name] for name in ("Color", "Density"))
        return any(self._graph.constant(socket, source.groups) is None for socket in sockets)

    def _write_closures(self, write):
        medium = VolumeWriter(self._graph, self._fail, self._voxels)
        write(medium)
        if not medium.closures:
            return
        self._extend("RELIEF_volume", {"closures": medium.closures})
        if medium.varies:
            self._uses_graph = True
            self._extend("RELIEF_graph", {"nodes": self._graph.nodes})
