# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports one evaluated frame: walks the depsgraph and hands each thing to its own exporter."""

import time
from dataclasses import dataclass, replace

import numpy as np

from .. import compat
from .axes import GLTF_FROM_BLENDER
from .gltf import GltfWriter, matrix_property
from .image import ImageExporter
from .light import Place, export_light
from .material import MaterialExporter
from .mesh import add_mesh, store_mesh
from .objects import collect, decompose
from .settings import render_settings
from .world import export_world

DATA_FOLDER = "relief_data"

#: A radiance that no picture shows, but that is not zero.
_DARKNESS = 1e-20

#: What the uv pass shows of a mesh whose materials ask for no coordinates.
_ACTIVE_UV = (("uv", ""),)


@dataclass
class Exported:
    """What an export did.

    path           of the scene file
    used_files     names in its data folder
    seconds        of wall clock
    bytes_written  files that were there already are not counted
    """

    path: str
    used_files: set
    seconds: float
    bytes_written: int


@dataclass
class View:
    """The camera of a picture.

    camera  glTF camera
    matrix  its world matrix in Blender's axes (4×4 nested floats); a scale is ignored
    size    (width, height) in pixels of the whole picture
    """

    camera: dict
    matrix: object
    size: tuple


def export_scene(depsgraph, view, folder, name, report):
    """Writes what a depsgraph holds as a scene file.

    @param  depsgraph  evaluated
    @param  view       View
    @param  folder     where to write; made if it is missing
    @param  name       of the scene file
    @param  report     Report
    @return            Exported
    """
    begin = time.perf_counter()
    writer = GltfWriter(folder, DATA_FOLDER)
    exporter = SceneExporter(depsgraph, writer, report)
    exporter.add_all(view)
    writer.json.update(scene_json(exporter.nodes))
    path = writer.write(name)
    return Exported(path, writer.used_files, time.perf_counter() - begin, writer.bytes_written)


def scene_json(nodes, index_of=None):
    """The document's scene and nodes.

    @param  nodes     in Blender's world, their children nodes instead of indices
    @param  index_of  a dictionary that gets the index of each node by its id()
    @return           "scene", "scenes", "nodes": the root, which turns Blender's axes into glTF's, is node 0
    """
    flat = [{"name": "Blender", "matrix": matrix_property(GLTF_FROM_BLENDER)}]

    def add(node):
        index = len(flat)
        if index_of is not None:
            index_of[id(node)] = index
        flat.append(node := dict(node))
        if "children" in node:
            node["children"] = [add(child) for child in node["children"]]
        return index

    flat[0]["children"] = [add(node) for node in nodes]
    return {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": flat}


class StoredMeshes:
    """Meshes of objects that have been written before, for exports into the same data folder."""

    def __init__(self):
        self._by_object = {}
        self._used = set()

    def get(self, original, wanted):
        """StoredMesh of an object whose materials ask for the same as before; None if there is none."""
        stored, _ = self._by_object.get(original.as_pointer(), (None, None))
        if stored is None or stored.wanted != tuple(wanted):
            return None
        self._used.add(original.as_pointer())
        return stored

    def put(self, original, stored):
        self._by_object[original.as_pointer()] = (stored, original.data.as_pointer())
        self._used.add(original.as_pointer())

    def forget_unused(self):
        """Drops what no export has asked for since the last call: its files may be removed."""
        self._by_object = {key: entry for key, entry in self._by_object.items() if key in self._used}
        self._used.clear()

    def forget_changed(self, depsgraph):
        """Drops what the depsgraph says has a new shape, objects and their data alike."""
        changed = {update.id.original.as_pointer() for update in depsgraph.updates if update.is_updated_geometry}
        self._by_object = {
            key: entry for key, entry in self._by_object.items() if key not in changed and entry[1] not in changed
        }


class SceneExporter:
    """A scene file in the making.

    @param  stored  StoredMeshes of earlier exports, of which those that changed have been dropped; None: a single export

    writer  GltfWriter
    nodes   of the frame: glTF nodes in Blender's world, their children nodes instead of indices, the camera's first
    """

    def __init__(self, depsgraph, writer, report, stored=None):
        self.writer = writer
        self.nodes = []
        self._depsgraph = depsgraph
        self._scene = depsgraph.scene
        self._report = report
        self._stored = stored if stored is not None else StoredMeshes()
        self._images = ImageExporter(self.writer, self._scene.frame_current)
        self._materials = MaterialExporter(self.writer, self._images, self._scene.relief, report)

    def add_all(self, view):
        """Adds the whole frame."""
        self.set_view(view)
        self.add_world()
        self.add_objects()
        self._keep_dark()

    def set_view(self, view):
        """Sets the camera and the settings of the picture; a later call replaces them."""
        translation, rotation, _, _ = decompose(np.array([view.matrix], dtype=np.float64).reshape(1, 4, 4))
        self.writer.use_extension("RELIEF_camera")
        if self.nodes:
            index = self.nodes[0]["camera"]
            self.writer.json["cameras"][index] = view.camera
        else:
            index = self.writer.add_unique("cameras", view.camera)
        node = {"name": view.camera.get("name", "view"), "camera": index}
        node.update(translation=translation[0].tolist(), rotation=rotation[0].tolist())
        self.nodes[:1] = [node]
        self.writer.extend(self.writer.json, "RELIEF_render", render_settings(self._scene, view.size))

    def add_world(self):
        is_opaque = not self._scene.render.film_transparent
        export_world(self._scene.world, is_opaque, self.writer, self._images, self._report)

    def add_objects(self):
        """Adds meshes, instances and lights."""
        things = collect(self._depsgraph, self._report)
        for thing in things:
            if thing.kind == "geometry":
                self._add_geometry(thing)
        self._stored.forget_unused()
        size = _extent(things)
        for thing in things:
            if thing.kind == "light":
                self._add_lights(thing, size)

    def _keep_dark(self):
        """Gives a scene without any light one that is as good as none: the program would put up a lamp of its own."""
        environment = self.writer.json["extensions"]["RELIEF_environment"]
        has_light = any(_is_light(node) for node in self.nodes) or any(
            any(material.get("emissiveFactor", ())) for material in self.writer.json.get("materials", ())
        )
        if not has_light and "uri" not in environment and not any(environment["color"]):
            environment["color"] = [_DARKNESS] * 3

    def _warner(self, kind, name):
        return lambda what, instead="": self._report.warn(f'{kind} "{name}"', what, instead)

    def _add_geometry(self, thing):
        matrices = thing.world_matrices()
        for system in thing.object.particle_systems:
            if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
                self._report.warn(f'object "{thing.name}"', f'hair "{system.name}" as strands', "it is left out")
        mesh = self._mesh_of(thing, matrices)
        if mesh is None:
            return
        base = {"name": thing.name, "mesh": mesh}
        settings = self._object_settings(thing.object)
        if settings:
            self.writer.extend(base, "RELIEF_object", settings)
        if len(matrices) == 1:
            self.nodes.append({**base, "matrix": matrix_property(matrices[0])})
            return
        translation, rotation, scale, exact = decompose(matrices)
        if exact.any():
            arrays = {"TRANSLATION": translation[exact], "ROTATION": rotation[exact], "SCALE": scale[exact]}
            arrays = {key: np.ascontiguousarray(a, dtype=np.float32) for key, a in arrays.items()}
            node = {**base, "extensions": dict(base.get("extensions", {}))}
            accessors = self.writer.add_accessors(arrays)
            self.writer.extend(node, "EXT_mesh_gpu_instancing", {"attributes": dict(accessors)})
            self.nodes.append(node)
        for matrix in matrices[~exact]:
            self.nodes.append({**base, "matrix": matrix_property(matrix)})

    def _object_settings(self, original):
        """RELIEF_object of an object; {} if all is usual."""
        settings = {}
        if not original.visible_camera:
            settings["visibleToCamera"] = False
        if not original.visible_shadow:
            settings["castsShadow"] = False
        warn = self._warner("object", original.name)
        _warn_visibility(original, warn)
        caustics = original.relief
        if caustics.caustic_caster != "auto":
            settings["causticCaster"] = caustics.caustic_caster == "yes"
        if not caustics.caustic_receiver:
            settings["causticReceiver"] = False
        if not caustics.caustic_light:
            settings["causticLight"] = False
        if original.is_holdout or original.is_shadow_catcher:
            warn("holdouts and shadow catchers", "it is an ordinary object")
        return settings

    def _mesh_of(self, thing, matrices):
        """Index of the glTF mesh of a thing; None if it has no triangles."""
        if thing.data is not None:
            materials = self._materials_of(thing, thing.data.materials, thing.data, matrices)
            stored = store_mesh(thing.data, [w for _, w in materials], self.writer, self._warner("object", thing.name))
            return add_mesh(stored, [i for i, _ in materials], self.writer)
        evaluated = thing.object.evaluated_get(self._depsgraph)
        slots = [slot.material for slot in evaluated.material_slots]
        materials = self._materials_of(thing, slots, evaluated.data, matrices)
        wanted = [w for _, w in materials]
        stored = self._stored.get(thing.object, wanted)
        if stored is None:
            mesh = evaluated.to_mesh()
            if mesh is None:
                return None
            try:
                stored = store_mesh(mesh, wanted, self.writer, self._warner("object", thing.name))
            finally:
                evaluated.to_mesh_clear()
            self._stored.put(thing.object, stored)
        return add_mesh(stored, [i for i, _ in materials], self.writer)

    def _materials_of(self, thing, materials, data, matrices):
        """(index in the glTF, Wanted) of a thing's material slots, at least one."""
        exported = [self._materials.export(m) for m in materials] or [self._materials.export(None)]
        if any(wanted.world_space for _, wanted in exported) and _is_uneven(matrices):
            warn = self._warner("object", thing.name)
            warn("displacement in world space on an uneven scale", "the scale's mean was used")
        if self._depsgraph.view_layer.use_pass_uv and getattr(data, "uv_layers", None):
            exported = [(i, w if w.coordinates else replace(w, coordinates=_ACTIVE_UV)) for i, w in exported]
        return exported

    def _add_lights(self, thing, scene_size):
        original = thing.object
        light = original.evaluated_get(self._depsgraph).data
        translation, rotation, scale, _ = decompose(thing.world_matrices())
        for t, r, s in zip(translation, rotation, scale):
            node = {"name": thing.name, "translation": t.tolist(), "rotation": r.tolist()}
            place = Place(
                node=node,
                scale=tuple(np.abs(s).tolist()),
                visible_to_camera=original.visible_camera,
                scene_size=scene_size,
                writer=self.writer,
                warn=self._warner("light", thing.name),
            )
            export_light(light, place)
            _warn_visibility(original, place.warn)
            if not original.relief.caustic_light:
                settings = node.setdefault("extensions", {}).get("RELIEF_object", {})
                self.writer.extend(node, "RELIEF_object", {**settings, "causticLight": False})
            self.nodes.append(node)


def _is_light(node):
    """Whether a node or a child of it shines."""
    extensions = node.get("extensions", {})
    if "KHR_lights_punctual" in extensions or "RELIEF_area_light" in extensions:
        return True
    return any(_is_light(child) for child in node.get("children", ()))


def _warn_visibility(original, warn):
    """Warns where an object shines on, or is seen by, some things alone."""
    hidden = [k for k in ("diffuse", "glossy", "transmission") if not getattr(original, f"visible_{k}")]
    if hidden:
        warn(f"hidden from {' and '.join(hidden)} rays", "these see it")
    if compat.links_light(original):
        warn("light linking", "it shines on everything")


def _is_uneven(matrices):
    """Whether some matrix scales one axis more than another."""
    lengths = np.linalg.norm(matrices[:, :3, :3], axis=1)
    return bool((np.ptp(lengths, axis=1) > 1e-3 * lengths.max(axis=1)).any())


def _extent(things):
    """Metres that the centres of all things and their own sizes reach over: at least 1."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for thing in things:
        if thing.kind != "geometry":
            continue
        matrices = thing.world_matrices()
        corners = np.array(thing.object.bound_box, dtype=np.float64)
        reach = np.abs(corners).max() * np.abs(matrices[:, :3, :3]).sum(axis=2).max()
        low = np.minimum(low, matrices[:, :3, 3].min(axis=0) - reach)
        high = np.maximum(high, matrices[:, :3, 3].max(axis=0) + reach)
    return max(1.0, float((high - low).max())) if np.isfinite(low).all() else 1.0
