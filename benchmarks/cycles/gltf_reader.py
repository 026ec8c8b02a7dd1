"""Reads the part of a glTF scene that the comparison needs into plain numpy arrays, for blender_scene.py.

Not a general reader: what it does not know it refuses by name, since a comparison must not leave things out.
"""

import json
import os

import numpy as np

_DTYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
KNOWN_EXTENSIONS = {
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
    "RELIEF_area_light",
    "RELIEF_camera",
    "RELIEF_displacement",
    "RELIEF_environment",
    "RELIEF_render",
}


class Unsupported(Exception):
    """The scene holds something that has no counterpart here."""


class GltfFile:
    """One parsed .gltf with its buffers."""

    def __init__(self, path):
        self.folder = os.path.dirname(os.path.abspath(path))
        with open(path, encoding="utf-8") as file:
            self.json = json.load(file)
        unknown = set(self.json.get("extensionsUsed", [])) - KNOWN_EXTENSIONS
        if unknown:
            raise Unsupported(f"{path}: extensions {', '.join(sorted(unknown))}")
        if "animations" in self.json or "skins" in self.json:
            raise Unsupported(f"{path}: animations or skins")
        self.buffers = []
        for buffer in self.json.get("buffers", []):
            if buffer.get("uri", "data:").startswith("data:"):
                raise Unsupported(f"{path}: a buffer that is not a file")
            self.buffers.append(np.fromfile(os.path.join(self.folder, buffer["uri"]), np.uint8))

    def accessor(self, index):
        """The accessor as an array of shape (count, width), in its stored type."""
        accessor = self.json["accessors"][index]
        if "sparse" in accessor or accessor.get("normalized") or "bufferView" not in accessor:
            raise Unsupported(f"accessor {index}: sparse, normalized or without a buffer view")
        view = self.json["bufferViews"][accessor["bufferView"]]
        if "byteStride" in view:
            raise Unsupported(f"accessor {index}: interleaved")
        width = _WIDTHS[accessor["type"]]
        data = np.frombuffer(
            self.buffers[view["buffer"]],
            dtype=_DTYPES[accessor["componentType"]],
            count=accessor["count"] * width,
            offset=view.get("byteOffset", 0) + accessor.get("byteOffset", 0),
        )
        return data.reshape(accessor["count"], width)

    def image_path(self, texture_index):
        image = self.json["images"][self.json["textures"][texture_index]["source"]]
        return os.path.join(self.folder, image["uri"])

    def is_nearest(self, texture_index):
        sampler = self.json["textures"][texture_index].get("sampler")
        return sampler is not None and self.json["samplers"][sampler].get("magFilter") == 9728

    def node_matrices(self):
        """Yields (node, world matrix of shape (4, 4), double) for every node of the default scene."""

        def visit(index, parent):
            node = self.json["nodes"][index]
            matrix = parent @ local_matrix(node)
            yield node, matrix
            for child in node.get("children", []):
                yield from visit(child, matrix)

        for root in self.json["scenes"][self.json.get("scene", 0)]["nodes"]:
            yield from visit(root, np.eye(4))

    def instance_matrices(self, node, matrix):
        """World matrices, shape (n, 4, 4), of a node's mesh: one, or those of EXT_mesh_gpu_instancing."""
        instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instancing is None:
            return matrix[None]
        columns = {name: self.accessor(index) for name, index in instancing["attributes"].items()}
        count = len(next(iter(columns.values())))
        translations = columns.get("TRANSLATION", np.zeros((count, 3)))
        rotations = columns.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1)))
        scales = columns.get("SCALE", np.ones((count, 3)))
        local = np.stack([trs_matrix(t, r, s) for t, r, s in zip(translations, rotations, scales)])
        return matrix @ local


def local_matrix(node):
    """A node's own transform, shape (4, 4)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    return trs_matrix(
        node.get("translation", (0, 0, 0)), node.get("rotation", (0, 0, 0, 1)), node.get("scale", (1, 1, 1))
    )


def trs_matrix(translation, rotation, scale):
    """Scale first, then the unit quaternion (x, y, z, w), then the translation."""
    x, y, z, w = np.asarray(rotation, dtype=np.float64)
    rotate = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotate * np.asarray(scale, dtype=np.float64)
    matrix[:3, 3] = translation
    return matrix
