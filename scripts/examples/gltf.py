"""Writes one glTF 2.0 scene: `Document` collects meshes, materials, nodes and images, `save` writes the files.

Indices returned by the `add_…` functions are glTF's. Units, axes and the RELIEF_ extensions are those of
docs/scene_format.md.
"""

import json
import os
import struct

from . import vector

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def lambert(name, color, texture=None):
    """A purely diffuse material: KHR_materials_specular switches the dielectric's reflection off."""
    material = dielectric(name, color, 1.0)
    material["extensions"] = {"KHR_materials_specular": {"specularFactor": 0}}
    if texture is not None:
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
    return material


def dielectric(name, color, roughness, metallic=0.0):
    """glTF's metallic-roughness material; `color` is linear RGB."""
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*color, 1],
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
    }


def metal(name, color, roughness):
    """A conductor whose reflectance at normal incidence is `color`."""
    return dielectric(name, color, roughness, metallic=1.0)


def glass(name, ior=1.5, roughness=0.0, attenuation=(1, 1, 1), distance=1.0):
    """A solid dielectric; white light has the colour `attenuation` after `distance` metres inside."""
    material = dielectric(name, (1, 1, 1), roughness)
    volume = {"thicknessFactor": 1}
    if tuple(attenuation) != (1, 1, 1):
        volume.update(attenuationColor=list(attenuation), attenuationDistance=distance)
    material["extensions"] = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": ior},
        "KHR_materials_volume": volume,
    }
    return material


def emitter(name, radiance):
    """A black surface whose front side sends out `radiance`, W/m²/sr."""
    strength = max(radiance)
    material = lambert(name, (0, 0, 0))
    material["emissiveFactor"] = [channel / strength for channel in radiance]
    material["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    return material


def displaced(material, height_texture, scale, midlevel=0.5, tiles=(1, 1), **properties):
    """The material with RELIEF_displacement by a texture repeated `tiles` times; further properties by name."""
    height = {"index": height_texture}
    if tuple(tiles) != (1, 1):
        height["extensions"] = {"KHR_texture_transform": {"scale": list(tiles)}}
    displacement = {"heightTexture": height, "scale": scale, "midlevel": midlevel, **properties}
    material.setdefault("extensions", {})["RELIEF_displacement"] = displacement
    return material


class Document:
    """A scene being put together. `gltf` is the JSON object, open to what has no function here."""

    def __init__(self, name, render):
        """`render` holds the RELIEF_render properties."""
        self.name = name
        self.binary = bytearray()
        self.images = {}
        self.gltf = {
            "asset": {"version": "2.0", "generator": "relief scripts/make_examples"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": []}],
            "extensions": {"RELIEF_render": render},
        }

    def _append(self, key, item):
        self.gltf.setdefault(key, []).append(item)
        return len(self.gltf[key]) - 1

    def _add_accessor(self, rows, component_type, target=None, with_bounds=False):
        """One tightly packed accessor in a buffer view of its own; rows are tuples of 1 to 4 numbers."""
        width = len(rows[0])
        code = {_FLOAT: "f", _UINT16: "H", _UINT32: "I"}[component_type]
        flat = [value for row in rows for value in row]
        data = struct.pack(f"<{len(flat)}{code}", *flat)
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self.binary += data
        accessor = {
            "bufferView": self._append("bufferViews", view),
            "componentType": component_type,
            "count": len(rows),
            "type": _KINDS[width],
        }
        if with_bounds:
            # Bounds are those of the stored floats, not of the doubles they were rounded from.
            stored = struct.unpack(f"<{len(flat)}{code}", data)
            accessor["min"] = [min(stored[i::width]) for i in range(width)]
            accessor["max"] = [max(stored[i::width]) for i in range(width)]
        return self._append("accessors", accessor)

    def add_material(self, material):
        return self._append("materials", material)

    def add_mesh(self, name, mesh, material):
        """A mesh of one primitive; `mesh` is a `meshes.Mesh`."""
        return self.add_mesh_like(name, self.add_attributes(mesh), material)

    def add_attributes(self, mesh):
        """Stores a mesh's arrays; several glTF meshes may refer to them with different materials."""
        attributes = {"POSITION": self._add_accessor(mesh.positions, _FLOAT, _ARRAY_BUFFER, with_bounds=True)}
        if mesh.normals:
            attributes["NORMAL"] = self._add_accessor(mesh.normals, _FLOAT, _ARRAY_BUFFER)
        if mesh.uvs:
            attributes["TEXCOORD_0"] = self._add_accessor(mesh.uvs, _FLOAT, _ARRAY_BUFFER)
        index_type = _UINT16 if len(mesh.positions) < 65535 else _UINT32
        rows = [(index,) for triangle in mesh.triangles for index in triangle]
        return attributes, self._add_accessor(rows, index_type, _ELEMENT_ARRAY_BUFFER)

    def add_mesh_like(self, name, stored, material):
        """A mesh that refers to what `add_attributes` returned."""
        attributes, indices = stored
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self._append("meshes", {"name": name, "primitives": [primitive]})

    def add_node(self, name, **properties):
        """A root node; properties are glTF's, and only those that matter need be given."""
        index = self._append("nodes", {"name": name, **properties})
        self.gltf["scenes"][0]["nodes"].append(index)
        return index

    def add_instances(self, name, mesh, translations, rotations, scales):
        """EXT_mesh_gpu_instancing: one node, many copies. Rotations are quaternions, scales triples."""
        attributes = {
            "TRANSLATION": self._add_accessor(translations, _FLOAT),
            "ROTATION": self._add_accessor(rotations, _FLOAT),
            "SCALE": self._add_accessor(scales, _FLOAT),
        }
        # A reader that leaves the extension out would show one copy of thousands.
        required = self.gltf.setdefault("extensionsRequired", [])
        if "EXT_mesh_gpu_instancing" not in required:
            required.append("EXT_mesh_gpu_instancing")
        return self.add_node(
            name, mesh=mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}}
        )

    def add_camera(self, eye, target, vertical_degrees, lens=None):
        """A perspective camera at `eye`; `lens` holds RELIEF_camera properties."""
        width, height = self.gltf["extensions"]["RELIEF_render"]["resolution"]
        camera = {
            "type": "perspective",
            "perspective": {
                "yfov": vertical_degrees * 3.141592653589793 / 180,
                "aspectRatio": width / height,
                "znear": 0.01,
            },
        }
        if lens:
            camera["extensions"] = {"RELIEF_camera": lens}
        return self.add_node(
            "camera",
            camera=self._append("cameras", camera),
            translation=list(eye),
            rotation=list(vector.look_at(eye, target)),
        )

    def add_area_light(self, name, eye, target, width, height, radiance):
        """A rectangle at `eye` that shines towards `target` with the given radiance, W/m²/sr."""
        strength = max(radiance)
        light = {
            "shape": "rectangle",
            "width": width,
            "height": height,
            "color": [channel / strength for channel in radiance],
            "radiance": strength,
        }
        return self.add_node(
            name,
            translation=list(eye),
            rotation=list(vector.look_at(eye, target)),
            extensions={"RELIEF_area_light": light},
        )

    def add_sun(self, towards_sun, irradiance):
        """A directional light; `irradiance` (linear RGB, W/m²) falls on a plane across its direction."""
        strength = max(irradiance)
        light = {
            "type": "directional",
            "color": [channel / strength for channel in irradiance],
            "intensity": strength,
        }
        lights = self.gltf["extensions"].setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        return self.add_node(
            "sun",
            rotation=list(vector.look_at(towards_sun, (0.0, 0.0, 0.0))),
            extensions={"KHR_lights_punctual": {"light": len(lights) - 1}},
        )

    def add_texture(self, file_name, encoded, nearest=False):
        """Stores the bytes of an image file beside the scene and returns a texture that repeats it."""
        self.images[file_name] = encoded
        texture = {"source": self._append("images", {"uri": file_name})}
        if nearest:
            texture["sampler"] = self._append("samplers", {"magFilter": 9728, "minFilter": 9728})
        return self._append("textures", texture)

    def set_environment(self, file_name, encoded, **properties):
        """A lat-long map around the scene; further RELIEF_environment properties by name."""
        self.images[file_name] = encoded
        self.gltf["extensions"]["RELIEF_environment"] = {"uri": file_name, **properties}

    def save(self, folder):
        """Writes <name>.gltf, <name>.bin and the images into `folder`; returns the number of bytes."""
        os.makedirs(folder, exist_ok=True)
        if self.binary:
            self.gltf["buffers"] = [{"uri": f"{self.name}.bin", "byteLength": len(self.binary)}]
        self.gltf["extensionsUsed"] = sorted(_extension_names(self.gltf))
        files = dict(self.images)
        files[f"{self.name}.bin"] = bytes(self.binary)
        rounded = _round_numbers(self.gltf)
        files[f"{self.name}.gltf"] = (json.dumps(rounded, indent=1, ensure_ascii=False) + "\n").encode()
        for file_name, data in files.items():
            with open(os.path.join(folder, file_name), "wb") as file:
                file.write(data)
        return sum(len(data) for data in files.values())


def _extension_names(value):
    """All keys of all `extensions` objects below a JSON value."""
    names = set()
    if isinstance(value, dict):
        names.update(value.get("extensions", {}))
        for item in value.values():
            names |= _extension_names(item)
    elif isinstance(value, list):
        for item in value:
            names |= _extension_names(item)
    return names


def _round_numbers(value):
    """Floats to nine significant digits, enough for any float32, so that the JSON stays readable."""
    if isinstance(value, float):
        rounded = float(f"{value:.9g}")
        return int(rounded) if rounded.is_integer() else rounded
    if isinstance(value, dict):
        return {key: _round_numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_round_numbers(item) for item in value]
    return value
