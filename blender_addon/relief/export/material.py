# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials as glTF materials: the surface, its textures, its absorption, its displacement."""

import math

from .. import compat
from . import nodes
from .displacement import bump_displaces, export_displacement
from .graph import GraphWriter
from .light import set_emission
from .mesh import Wanted
from .surface import TRANSPARENT, Surface, surface_from
from .texture import Input, Mapping, Texture, TextureReader

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

    def export(self, material):
        """(what add_mesh asks for the index of the glTF material, Wanted of its meshes); a slot without material is grey."""
        key = None if material is None else material.as_pointer()
        if key not in self._exported:
            job = _MaterialJob(self._writer, self._images, self._settings, self._report, material, self._view_layer)
            wanted = job.wanted()
            self._exported[key] = (_Indices(self._writer, job.json, wanted.by_shading), wanted)
        return self._exported[key]


class _Indices:
    """A material's place in the document, which it gets when a mesh uses it.

    @param  by_shading  whether faces that are shaded smooth have one of their own: the slopes of its displacement are smooth
    """

    def __init__(self, writer, json, by_shading):
        self._writer = writer
        self._json = json
        self._by_shading = by_shading

    def __call__(self, is_smooth):
        """Index of the glTF material of smooth or of flat faces."""
        json = self._json
        if self._by_shading and is_smooth:
            extensions = json["extensions"]
            displacement = {**extensions["RELIEF_displacement"], "smoothing": True}
            json = {**json, "extensions": {**extensions, "RELIEF_displacement": displacement}}
        return self._writer.add_unique("materials", json)


class _MaterialJob:
    """One material on its way."""

    def __init__(self, writer, images, settings, report, material, view_layer):
        self._writer = writer
        self._images = images
        self._name = material.name if material else "default"
        self._report = report
        self._coordinates = []
        self._color_map = None
        self._displaced = self._by_shading = False
        self.json = {"name": self._name, "doubleSided": True}
        self._graph = GraphWriter(self._coordinate_set, self._graph_texture, material.pass_index if material else 0, view_layer)
        textures = TextureReader(self._warn, self._graph)
        if material is None or not material.use_nodes or material.node_tree is None:
            color = (0.8, 0.8, 0.8) if material is None else tuple(material.diffuse_color[:3])
            color = nodes.finite(color, "its colour", self._warn)
            layers = compat.DEFAULT_SURFACE if material is None else {}
            layers = {name: Input(value) if name == "roughness" else value for name, value in layers.items()}
            self._write_surface(Surface(base_color=Input(color), **layers))
            return
        textures.takes_bump = bump_displaces(material, settings)
        output = nodes.active_output(material.node_tree, "ShaderNodeOutputMaterial")
        source = nodes.follow(output.inputs["Surface"]) if output else None
        volume = nodes.follow(output.inputs["Volume"]) if output else None
        surface = surface_from(source, textures) if source or not volume else TRANSPARENT
        self._write_surface(surface)
        self._write_volume(volume, surface, textures)
        value = export_displacement(material, settings, textures, self._data_info, images)
        if value is not None:
            self._displaced = True
            self._by_shading = not value["smoothing"]
            if not self._coordinates:  # the map of a constant height
                self._coordinates.append(("uv", ""))
            writer.extend(self.json, "RELIEF_displacement", value)

    def wanted(self):
        graph, has_graph = self._graph, "RELIEF_graph" in self.json.get("extensions", {})
        return Wanted(
            tuple(self._coordinates),
            self._color_map,
            self._displaced,
            self._by_shading,
            has_graph and graph.uses_generated,
            tuple(sorted(graph.attributes)) if has_graph else (),
            tuple(sorted(graph.values)) if has_graph else (),
        )

    def _warn(self, what, instead=""):
        self._report.warn(f'material "{self._name}"', what, instead)

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

    def _graph_texture(self, node):
        """(glTF's reference to an Image Texture node's image without its coordinates, whether it is sRGB); None without a file."""
        is_data = node.image.colorspace_settings.is_data
        if is_data:
            uri = self._images.data_uri(node.image, node.image_user, self._warn)
        else:
            uri = self._images.color_uri(node.image, node.image_user, self._warn, node.outputs["Alpha"].is_linked)
        if uri is None:
            return None
        texture = Texture(node, None, Mapping())
        return {"index": self._writer.add_texture(uri, texture.wrap, texture.nearest)}, not is_data

    def _color_info(self, texture):
        node = texture.node
        uri = self._images.color_uri(node.image, node.image_user, self._warn, node.outputs["Alpha"].is_linked)
        return self._info(texture, uri)

    def _data_info(self, texture):
        node = texture.node
        if texture.channel is None:
            uri = self._images.data_uri(node.image, node.image_user, self._warn)
        else:
            uri = self._images.channel_uri(node.image, texture.channel, self._warn)
        return self._info(texture, uri)

    def _without_offset(self, value, what):
        if value.offset and value.graph is None:
            self._warn(f"a sum with the texture of its {what}", "the texture alone was used")

    def _write_surface(self, surface):
        pbr = self.json["pbrMetallicRoughness"] = {}
        pbr["baseColorFactor"] = [*(min(max(c, 0.0), 1.0) for c in surface.base_color.value), 1.0]
        if surface.base_color.texture:
            info = self._base_color_info(surface.base_color.texture)
            if info:
                pbr["baseColorTexture"] = info
        self._color_map = surface.base_color.color_map
        self._write_alpha(surface, pbr)
        self._write_metallic_roughness(surface, pbr)
        if surface.normal is not None:
            info = self._data_info(surface.normal.texture)
            if info:
                self.json["normalTexture"] = {**info, "scale": surface.normal.value}
        self._write_reflection(surface)
        self._write_layers(surface)
        if surface.emission.color_map is not None:
            self._warn("a colour attribute as emission", "it is left out: the emission has one colour")
        self._write_graph(surface)
        if surface.emits() and surface.emission.graph is None:
            set_emission(self.json, [max(0.0, c) for c in surface.emission.value], self._writer)
            if surface.emission.texture:
                info = self._color_info(surface.emission.texture)
                if info:
                    self.json["emissiveTexture"] = info

    def _write_graph(self, surface):
        """What a graph gives of a surface."""
        given = {
            "baseColor": surface.base_color,
            "alpha": surface.alpha,
            "metallic": surface.metallic,
            "roughness": surface.roughness,
            "transmission": surface.transmission,
            "clearcoat": surface.coat,
            "clearcoatRoughness": surface.coat_roughness,
            "emission": surface.emission,
        }
        graph = self._graph
        for name, source in given.items():
            if source.graph is None:
                continue
            is_color = isinstance(source.value, tuple)
            reference = graph.scaled(source.graph, source.value, is_color)
            graph.outputs[name] = reference if is_color else graph.shifted(reference, source.offset)
        if graph.outputs:
            self._extend("RELIEF_graph", {"nodes": graph.nodes, "outputs": graph.outputs})

    def _base_color_info(self, texture):
        if texture.channel is None:
            return self._color_info(texture)
        # A grey float image stays linear where colours are read.
        node = texture.node
        return self._info(texture, self._images.channel_uri(node.image, texture.channel, self._warn))

    def _write_alpha(self, surface, pbr):
        alpha = surface.alpha
        if alpha.graph is not None:
            self.json["alphaMode"] = "BLEND"
            return
        if alpha.is_constant():
            if alpha.value < 1:
                self.json["alphaMode"] = "BLEND"
                pbr["baseColorFactor"][3] = max(0.0, alpha.value)
            return
        base = surface.base_color.texture
        own = alpha.texture
        if base and own and own.channel == 3 and own.node.image == base.node.image and own.mapping == base.mapping:
            self.json["alphaMode"] = "BLEND"
            pbr["baseColorFactor"][3] = min(max(alpha.value, 0.0), 1.0)
            return
        if base is None and own is not None:
            self._write_alpha_image(own, surface, pbr)
            return
        self._warn("opacity by another image than its base colour's alpha", "it is opaque")

    def _write_alpha_image(self, texture, surface, pbr):
        """Opacity by an image of its own over a plain colour: a white image with that alpha."""
        image = texture.node.image
        uri = self._images.alpha_uri(image, texture.channel, self._warn)
        info = self._info(texture, uri)
        if info:
            self.json["alphaMode"] = "BLEND"
            pbr["baseColorTexture"] = info
            pbr["baseColorFactor"][3] = min(max(surface.alpha.value, 0.0), 1.0)

    def _write_metallic_roughness(self, surface, pbr):
        metallic, roughness = surface.metallic, surface.roughness
        for value, what in ((metallic, "metallic"), (roughness, "roughness")):
            self._without_offset(value, what)
        pbr["metallicFactor"] = min(max(metallic.value, 0.0), 1.0)
        pbr["roughnessFactor"] = min(max(roughness.value, 0.0), 1.0)
        if metallic.texture is None and roughness.texture is None:
            return
        info = self._metallic_roughness_info(metallic, roughness, pbr)
        if info:
            pbr["metallicRoughnessTexture"] = info

    def _metallic_roughness_info(self, metallic, roughness, pbr):
        """glTF keeps both in one image, roughness in green and metallic in blue."""
        rough, metal = roughness.texture, metallic.texture
        if metal is None and metallic.value == 0:
            # Blue is multiplied by 0, so a grey image does, and so does one whose green it is.
            if rough.channel in {None, 1}:
                node = rough.node
                return self._info(rough, self._images.data_uri(node.image, node.image_user, self._warn))
            return self._data_info(rough)
        if rough and metal and (rough.channel, metal.channel) == (1, 2) and rough.node.image == metal.node.image:
            node = rough.node
            return self._info(rough, self._images.data_uri(node.image, node.image_user, self._warn))
        if rough and metal and rough.mapping != metal.mapping:
            self._warn("different mappings for roughness and metallic", "the one of the roughness was used for both")
        texture = rough or metal
        planes = [(t.node.image, t.channel) if t else None for t in (rough, metal)]
        return self._info(texture, self._images.combined_uri(*planes, self._warn))

    def _write_reflection(self, surface):
        if not surface.transmission.is_constant(0.0):
            value = {"transmissionFactor": min(max(surface.transmission.value, 0.0), 1.0)}
            if surface.transmission.texture:
                info = self._data_info(surface.transmission.texture)
                if info:
                    value["transmissionTexture"] = info
            self._extend("KHR_materials_transmission", value)
            self._extend("KHR_materials_volume", {"thicknessFactor": _SOLID})
        if surface.ior != 1.5:
            self._extend("KHR_materials_ior", {"ior": surface.ior})
        if surface.specular != 1 or surface.specular_color != (1.0, 1.0, 1.0):
            value = {"specularFactor": min(surface.specular, 1.0), "specularColorFactor": list(surface.specular_color)}
            self._extend("KHR_materials_specular", value)

    def _write_layers(self, surface):
        if not surface.coat.is_constant(0.0):
            value = {
                "clearcoatFactor": min(max(surface.coat.value, 0.0), 1.0),
                "clearcoatRoughnessFactor": min(max(surface.coat_roughness.value, 0.0), 1.0),
            }
            textured = {"clearcoatTexture": surface.coat, "clearcoatRoughnessTexture": surface.coat_roughness}
            for name, source in textured.items():
                info = self._data_info(source.texture) if source.texture else None
                if info:
                    value[name] = info
            self._extend("KHR_materials_clearcoat", value)
        if max(surface.sheen_color) > 0:
            color = [min(max(c, 0.0), 1.0) for c in surface.sheen_color]
            value = {"sheenColorFactor": color, "sheenRoughnessFactor": surface.sheen_roughness}
            self._extend("KHR_materials_sheen", value)

    def _write_volume(self, source, surface, textures):
        if source is None:
            return
        node = source.node
        if node.bl_idname != "ShaderNodeVolumeAbsorption" or surface.transmission.is_constant(0.0):
            self._warn(f'node "{node.name}" ({node.bl_label}) as volume', "it is left out")
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
