# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports one evaluated frame: walks the depsgraph and hands each thing to its own exporter."""

import time
from dataclasses import dataclass, replace
from itertools import zip_longest

import bpy
import numpy as np

from .. import compat
from ..report import ReliefError
from . import hair, instance_values, unread
from .axes import GLTF_FROM_BLENDER
from .gltf import GltfWriter, matrix_property
from .image import ImageExporter
from .light import Place, export_light
from .material import MaterialExporter, emits, has_volume, holds_out
from .mesh import FARTHEST, add_mesh, store_box, store_mesh, store_points, store_strands
from .motion import numbered
from .objects import collect, decompose, usable_places
from .settings import cycles_settings, render_settings
from .visibility import hidden_settings
from .voxels import Grids, Voxels, domain_of, read_grids
from .world import Eye, export_world

DATA_FOLDER = "relief_data"

#: A radiance that no picture shows, but that is not zero.
_DARKNESS = 1e-20

#: What the uv pass shows of a mesh whose materials ask for no coordinates.
_ACTIVE_UV = (("uv", ""),)

#: Data of hair curves; nothing is, where Blender has none.
_HAIR_CURVES = getattr(bpy.types, "Curves", ())

#: Likewise of point clouds.
_POINT_CLOUD = getattr(bpy.types, "PointCloud", ())


@dataclass
class Exported:
    """What an export did.

    path           of the scene file
    used_files     names in its data folder
    seconds        of wall clock
    bytes_written  files that were there already are not counted
    has_holdouts   something is a hole in the picture
    """

    path: str
    used_files: set
    seconds: float
    bytes_written: int
    has_holdouts: bool


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


def export_scene(depsgraph, view, folder, name, report, motion=None, seen_from=None, stored=None):
    """Writes what a depsgraph holds as a scene file.

    @param  depsgraph  evaluated
    @param  view       View
    @param  folder     where to write; made if it is missing
    @param  name       of the scene file
    @param  report     Report
    @param  motion     Motion while the shutter is open; None: nothing takes time
    @param  seen_from  View by whose coordinates a world may be seen; None: view
    @param  stored     StoredMeshes of earlier exports into the folder; None: there are none
    @return            Exported
    """
    begin = time.perf_counter()
    writer = GltfWriter(folder, DATA_FOLDER)
    exporter = SceneExporter(depsgraph, writer, report, stored, motion)
    exporter.add_all(view, seen_from)
    index_of = {}
    writer.json.update(scene_json(exporter.nodes, index_of))
    if motion is not None:
        motion.write(writer, index_of)
    path = writer.write(name)
    seconds = time.perf_counter() - begin
    has_holdouts = exporter.has_holdouts or any(map(holds_out, writer.json.get("materials", ())))
    return Exported(path, writer.used_files, seconds, writer.bytes_written, has_holdouts)


def write_view(view, folder, name):
    """Writes a scene file with nothing but a camera.

    @param  view    View
    @param  folder  where to write
    @param  name    of the file
    @return         its path
    """
    writer = GltfWriter(folder, DATA_FOLDER)
    writer.json.update(scene_json([_camera_node(view, writer)]))
    return writer.write(name)


def _camera_node(view, writer):
    """Node of a camera, in Blender's world."""
    matrices, _, num_shrunk, num_bad = usable_places(np.array([view.matrix], dtype=np.float64).reshape(1, 4, 4))
    if num_shrunk or num_bad:
        why = "its scale is 0" if num_shrunk else "its transform is not finite"
        raise ReliefError(f'nothing tells where the camera "{view.camera.get("name", "view")}" looks: {why}')
    translation, rotation, _, _ = decompose(matrices)
    writer.use_extension("RELIEF_camera")
    return {
        "name": view.camera.get("name", "view"),
        "camera": writer.add_unique("cameras", view.camera),
        "translation": translation[0].tolist(),
        "rotation": rotation[0].tolist(),
    }


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
        if stored is None or stored.wanted != wanted:
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
        if not self._by_object:
            return
        changed = {update.id.original.as_pointer() for update in depsgraph.updates if update.is_updated_geometry}
        self._by_object = {
            key: entry for key, entry in self._by_object.items() if key not in changed and entry[1] not in changed
        }


class SceneExporter:
    """A scene file in the making.

    @param  stored  StoredMeshes of earlier exports, of which those that changed have been dropped; None: a single export
    @param  motion  Motion while the shutter is open; None: nothing takes time

    writer        GltfWriter
    has_holdouts  an object is a hole in the picture
    nodes         of the frame: glTF nodes in Blender's world, their children nodes instead of indices, the camera's first
    """

    def __init__(self, depsgraph, writer, report, stored=None, motion=None):
        self.writer = writer
        self.nodes = []
        self.has_holdouts = False
        self._depsgraph = depsgraph
        self._scene = depsgraph.scene
        self._report = report
        self._motion = motion
        self._stored = stored if stored is not None else StoredMeshes()
        self._light_groups = {group.name for group in depsgraph.view_layer.lightgroups}
        self._by_shape = {}
        self._images = ImageExporter(self.writer, self._scene)
        view_layer = (depsgraph.view_layer, depsgraph.scene)
        self._materials = MaterialExporter(self.writer, self._images, self._scene.relief, report, lambda: view_layer)

    def add_all(self, view, seen_from=None):
        """Adds the whole frame.

        @param  seen_from  as export_scene has it
        """
        self._add_view(view)
        self._add_world(seen_from or view)
        self.add_objects()
        self._keep_dark()

    def _add_view(self, view):
        """Adds the camera and the settings of the picture."""
        if self._motion is not None:
            view.camera["extensions"]["RELIEF_camera"].update(self._motion.shutter.json())
        node = _camera_node(view, self.writer)
        self.nodes.append(node)
        if self._motion is not None:
            self._motion.move_camera(node)
        settings = render_settings(self._scene, self._depsgraph.view_layer, view.size)
        self.writer.extend(self.writer.json, "RELIEF_render", settings)

    def _add_world(self, view):
        is_opaque, layer = not self._scene.render.film_transparent, self._depsgraph.view_layer
        world = compat.world_of(self._scene, layer) if layer.use_sky else None
        clear_roughness = compat.clear_roughness(self._scene)
        eye = Eye.of(view.camera, view.matrix, view.size)
        export_world(world, is_opaque, clear_roughness, self._light_groups, eye, self.writer, self._images, self._report)

    def add_objects(self):
        """Adds meshes, instances and lights."""
        things = collect(self._depsgraph, self._report)
        things = [thing for thing in things if self._is_shown(thing)]
        for key, thing in numbered(things):
            if thing.kind == "geometry":
                self._add_geometry(thing, key)
        self._stored.forget_unused()
        lights = [thing for thing in things if thing.kind == "light"]
        # Cycles looks for lamps on no path, not even from the camera, unless there is one that bounced rays can meet.
        are_met = any(compat.is_met_by_rays(thing.object.data) for thing in lights)
        for thing in lights:
            self._add_lights(thing, are_met)

    def _is_shown(self, thing):
        """Whether the view layer shows a thing; it may hide a part of it."""
        layer = self._depsgraph.view_layer
        if thing.kind != "geometry":
            return True
        if _is_hair_curves(thing):
            return layer.use_strand
        if _is_volume(thing):
            return layer.use_volumes
        thing.surface = thing.surface and layer.use_solid
        thing.strands = thing.strands and layer.use_strand
        return thing.surface or thing.strands

    def _keep_dark(self):
        """Gives a scene without any light one that is as good as none: the program would put up a lamp of its own."""
        environment = self.writer.json["extensions"]["RELIEF_environment"]
        has_light = any(map(_is_light, self.nodes)) or any(map(emits, self.writer.json.get("materials", ())))
        if not has_light and not {"uri", "graph"} & environment.keys() and not any(environment["color"]):
            environment["color"] = [_DARKNESS] * 3

    def _warner(self, kind, name):
        return lambda what, instead="": self._report.warn(f'{kind} "{name}"', what, instead)

    def _add_geometry(self, thing, key):
        """@param  key  that Motion knows the thing by"""
        matrices, numbers = self._usable(thing, thing.world_matrices())
        if not len(matrices):
            return
        shapes = None if self._motion is None else self._motion.shapes(key, thing.name)
        mesh, reach, read = self._mesh_of(thing, shapes)
        if mesh is None:
            return
        is_near = np.abs(matrices[:, :3, 3]).max(axis=1) + np.abs(matrices[:, :3, :3]).sum(axis=(1, 2)) * reach < FARTHEST
        if not is_near.all():
            self._leave_out(thing, f"{FARTHEST:.0e} m and more from the origin", (~is_near).sum())
            matrices, numbers = matrices[is_near], numbers[is_near]
            if not len(matrices):
                return
        base = {"name": thing.name, "mesh": mesh}
        settings = self._object_settings(thing)
        values = self._values_of(thing, read, numbers)
        moves = [None] * len(numbers) if self._motion is None else self._motion.places(key, thing.name, numbers)
        if len(matrices) == 1:
            self._add_alone(base, settings, matrices[0], values, 0, moves[0], shapes)
            return
        translation, rotation, scale, exact = decompose(matrices)
        exact &= np.array([steps is None for steps in moves]) & (shapes is None)
        if exact.any():
            arrays = {"TRANSLATION": translation[exact], "ROTATION": rotation[exact], "SCALE": scale[exact]}
            arrays.update({key: v[exact] for key, v in values.items()})
            arrays = {key: np.ascontiguousarray(a, dtype=np.float32) for key, a in arrays.items()}
            node = dict(base)
            if settings:
                self.writer.extend(node, "RELIEF_object", settings)
            accessors = self.writer.add_accessors(arrays)
            self.writer.extend(node, "EXT_mesh_gpu_instancing", {"attributes": dict(accessors)})
            self.nodes.append(node)
        for i in np.flatnonzero(~exact):
            self._add_alone(base, settings, matrices[i], values, i, moves[i], shapes)

    def _add_alone(self, base, settings, matrix, values, i, steps, shapes):
        """Adds a node of one place.

        @param  values  of all places by name, of which it has number i
        @param  steps   its matrices while the shutter is open; None: it stands still
        @param  shapes  those of its mesh; None: it does not deform
        """
        node = dict(base)
        if steps is None:
            node["matrix"] = matrix_property(matrix)
        else:
            self._motion.move(node, steps)
        if shapes is not None:
            self._motion.deform(node)
        if values:
            own = {name: v[i].tolist() if v.shape[1] > 1 else float(v[i, 0]) for name, v in values.items()}
            settings = {**settings, "values": own}
        if settings:
            self.writer.extend(node, "RELIEF_object", settings)
        self.nodes.append(node)

    def _values_of(self, thing, read, numbers):
        """Values that graphs read of a thing's places: float32 (places, 1 to 4) by name.

        @param  read     see instance_values.py
        @param  numbers  of the places
        """
        if not read:
            return {}
        evaluated = thing.object.evaluated_get(self._depsgraph)
        data = thing.data if thing.data is not None else evaluated.data
        places = [thing.places[number] for number in numbers]
        values = {instance_values.file_name(v): instance_values.read(v, evaluated, data, places) for v in sorted(read)}
        return {name: np.where(np.isfinite(v), v, np.float32(0)) for name, v in values.items()}

    def _usable(self, thing, matrices):
        """(those of a thing's matrices that can be rendered, their numbers); what is left out is warned about."""
        matrices, numbers, num_shrunk, num_bad = usable_places(matrices)
        if num_shrunk:
            self._leave_out(thing, "a scale of 0", num_shrunk)
        if num_bad:
            self._leave_out(thing, "a transform that is not finite", num_bad)
        return matrices, numbers

    def _leave_out(self, thing, why, number):
        where = f" at {number} of {len(thing.matrices)} places" if len(thing.matrices) > 1 else ""
        kind = "light" if thing.kind == "light" else "object"
        self._report.warn(f'{kind} "{thing.name}"', why + where, "it is left out of this frame")

    def _object_settings(self, thing):
        """RELIEF_object of a thing; {} if all is usual."""
        original = thing.object
        settings = _ray_settings(original)
        if not original.visible_camera or thing.role.indirect_only:
            settings["visibleToCamera"] = False
        if thing.role.holdout:
            self.has_holdouts = True
            settings["holdout"] = True
        if thing.is_catcher:
            settings["shadowCatcher"] = True
        if original.lightgroup in self._light_groups:
            settings["lightGroup"] = original.lightgroup
        if self._depsgraph.view_layer.use_pass_cryptomatte_asset:
            settings["asset"] = _asset_name(original)
        if not original.visible_shadow:
            settings["castsShadow"] = False
        warn = self._warner("object", original.name)
        unread.warn_unread_of_object(original, self._scene, warn)
        if compat.links_light(original):
            warn(*_LINKED)
        caustics = original.relief
        if caustics.caustic_caster != "auto":
            settings["causticCaster"] = caustics.caustic_caster == "yes"
        if not caustics.caustic_receiver:
            settings["causticReceiver"] = False
        if not caustics.caustic_light:
            settings["causticLight"] = False
        return settings

    def _mesh_of(self, thing, shapes):
        """(index of the glTF mesh of a thing, largest coordinate of its vertices, values of objects that graphs read); index
        None: it has no triangles."""
        evaluated = thing.object.evaluated_get(self._depsgraph)
        data = thing.data if thing.data is not None else evaluated.data
        voxels = self._voxels_of(thing, evaluated, data)
        materials = self._materials_of(_slots(thing, evaluated), data, voxels)
        wanted = tuple(w for _, w in materials)
        is_usual = not _is_volume(thing) and thing.data is None and thing.surface and thing.strands == bool(hair.particle_systems(thing.object))
        stored = self._stored.get(thing.object, wanted) if is_usual else None
        if stored is None and _is_volume(thing):
            stored = self._store_volume(thing, evaluated, wanted, voxels)
            if stored is None:
                return None, 0.0, set()
        elif stored is None:
            stored = self._store(thing, evaluated, wanted, shapes or ())
            if stored is None:
                return None, 0.0, set()
            if is_usual:
                self._stored.put(thing.object, stored)
        for text in stored.warnings:
            self._warner("object", thing.name)(*text)
        read = {value for w in wanted for value in w.values}
        # A viewport has to answer: its faces are no finer than pixels.
        least_pixels = 1.0 if self._depsgraph.mode == "VIEWPORT" else 0.1
        dicing = compat.dicing_of(thing.object, self._scene, cycles_settings(self._scene), least_pixels)
        shape = hair.wanted_shape(self._scene)
        return add_mesh(stored, [i for i, _ in materials], self.writer, dicing, shape), stored.reach(), read

    def _store(self, thing, evaluated, wanted, shapes):
        """StoredMesh of a thing; None if it has none. Things of one shape whose materials want the same share theirs."""
        stored = None
        if _is_hair_curves(thing):
            strands = hair.of_curves(thing.data if thing.data is not None else evaluated.data)
            return None if strands is None else store_strands([(0, strands)], thing.name, wanted, self.writer)
        if _is_points(thing):
            return store_points(thing.data if thing.data is not None else evaluated.data, thing.name, wanted, self.writer)
        if thing.surface:
            stored = self._store_surface(thing, evaluated, wanted, shapes)
        if thing.strands and thing.data is None:
            grown = hair.of_particles(evaluated, self._depsgraph.mode == "RENDER")
            of_hair = store_strands(grown, thing.name, wanted, self.writer)
            if stored is None:
                return of_hair
            warnings = (*stored.warnings, *of_hair.warnings)
            stored = replace(stored, strands=of_hair.strands, warnings=warnings)
        return stored

    def _store_volume(self, thing, evaluated, wanted, grids):
        """The same of what is within a volume object: the box around it, with the first material that fills it."""
        override = self._depsgraph.view_layer.material_override
        materials = [override] if override is not None else _slots(thing, evaluated) or [None]
        filling = next((slot for slot, material in enumerate(materials) if has_volume(material)), None)
        if grids.box is None or filling is None:
            return None
        return store_box(grids.box, thing.name, wanted, filling, self.writer)

    def _store_surface(self, thing, evaluated, wanted, shapes):
        """The same of its triangles."""
        key = (_shape(thing, evaluated), wanted)
        if key not in self._by_shape:
            try:
                mesh = _evaluated_mesh(thing, evaluated)
            except RuntimeError as error:
                self._leave_out(thing, f"Blender makes no mesh of it ({str(error).strip()})", len(thing.matrices))
                return None
            if mesh is None:
                return None
            try:
                self._by_shape[key] = store_mesh(mesh, wanted, self.writer, shapes)
            finally:
                if thing.data is None:
                    evaluated.to_mesh_clear()
        return self._by_shape[key]

    def _voxels_of(self, thing, evaluated, data):
        """Voxels of a smoke domain, Grids of a volume object; None: it is neither."""
        if _is_volume(thing):
            return Grids(data, thing.bounds, self.writer, self._warner("object", thing.name))
        domain = domain_of(evaluated)
        if domain is None:
            return None
        grids = read_grids(domain)
        if "density" not in grids:
            self._warner("object", thing.name)("a smoke domain of which nothing is baked for the frame", "it is empty")
            grids["density"] = np.zeros((1, 1, 1, 1), dtype=np.float32)
        if domain.use_adaptive_domain:
            self._warner("object", thing.name)("an adaptive smoke domain", "its smoke fills the box that its mesh has")
        return Voxels(grids, self._images)

    def _materials_of(self, materials, data, voxels):
        """(what gives the index in the glTF, Wanted) of material slots, at least one."""
        override = self._depsgraph.view_layer.material_override
        if override is not None:
            materials = [override] * len(materials)
        exported = [self._materials.export(m, voxels) for m in materials] or [self._materials.export(override, voxels)]
        if self._depsgraph.view_layer.use_pass_uv and getattr(data, "uv_layers", None):
            exported = [(i, w if w.coordinates else replace(w, coordinates=_ACTIVE_UV)) for i, w in exported]
        return exported

    def _add_lights(self, thing, are_met):
        """@param  are_met  whether rays meet any lamp at all"""
        original = thing.object
        light = original.evaluated_get(self._depsgraph).data
        matrices = thing.world_matrices()
        # A point has no direction that a scale of 0 could take from it, but by its nodes, which since 5.0 all lights have.
        if light.type == "POINT":
            axes = matrices[:, :3, :3]
            axes[(np.linalg.det(axes) == 0) | (not light.use_nodes)] = np.eye(3)
        lit = np.flatnonzero(~_has_no_area(light, matrices))
        usable, numbers = self._usable(thing, matrices[lit])
        translation, rotation, scale, _ = decompose(usable)
        randoms = instance_values.randoms(original, thing.places, len(matrices))[lit[numbers]]
        for t, r, s, random in zip(translation, rotation, scale, randoms):
            node = {"name": thing.name, "translation": t.tolist(), "rotation": r.tolist()}
            place = Place(
                node=node,
                scale=tuple(np.abs(s).tolist()),
                visible_to_camera=original.visible_camera and are_met,
                random=float(random),
                writer=self.writer,
                images=self._images,
                warn=self._warner("light", thing.name),
            )
            export_light(light, place)
            if compat.links_light(original):
                place.warn(*_LINKED)
            settings = _ray_settings(original)
            if not original.relief.caustic_light:
                settings["causticLight"] = False
            if not compat.has_multiple_importance(light):
                settings["multipleImportance"] = False
            if not thing.is_catcher:
                settings["lightsFootage"] = False
            if original.lightgroup in self._light_groups:
                settings["lightGroup"] = original.lightgroup
            if settings:
                self.writer.extend(node, "RELIEF_object", settings)
            self.nodes.append(node)


def _is_hair_curves(thing):
    return thing.object.type == "CURVES" if thing.data is None else isinstance(thing.data, _HAIR_CURVES)


def _is_points(thing):
    return thing.object.type == "POINTCLOUD" if thing.data is None else isinstance(thing.data, _POINT_CLOUD)


def _is_volume(thing):
    return thing.object.type == "VOLUME" if thing.data is None else isinstance(thing.data, bpy.types.Volume)


def _slots(thing, evaluated):
    """Materials of a thing: those of its data, but for slots that its object has of its own."""
    slots = list(evaluated.material_slots)
    if thing.data is None:
        return [slot.material for slot in slots]
    pairs = zip_longest(thing.data.materials, slots)
    return [slot.material if slot is not None and slot.link == "OBJECT" else material for material, slot in pairs]


def _evaluated_mesh(thing, evaluated):
    """The mesh of a thing, which Blender makes here unless geometry nodes have; None if there is none."""
    return thing.data if thing.data is not None else evaluated.to_mesh()


def _shape(thing, evaluated):
    """What things with the same mesh have in common, as long as the depsgraph stays as it is."""
    original = thing.object
    if original.type in {"CURVE", "SURFACE", "FONT"} and not original.modifiers and not original.show_only_shape_key:
        return original.data.as_pointer()
    if thing.data is not None:
        return thing.data.as_pointer()
    # Blender evaluates a mesh once for all objects that do nothing of their own to it. Metaballs join with their kin.
    return (evaluated.data if original.type == "MESH" else original).as_pointer()


def _asset_name(original):
    """What Cycles calls the asset that an object belongs to: the topmost of its parents."""
    while original.parent is not None:
        original = original.parent
    return original.name


def _is_light(node):
    """Whether a node or a child of it shines."""
    extensions = node.get("extensions", {})
    if "KHR_lights_punctual" in extensions or "RELIEF_area_light" in extensions:
        return True
    return any(_is_light(child) for child in node.get("children", ()))


def _ray_settings(original):
    """Settings of RELIEF_object by an object's ray visibility, but for cameras and shadows."""
    return hidden_settings(lambda ray: compat.sees_object(original, ray))


def _has_no_area(light, matrices):
    """At which places an area light has shrunk to a line, or a round one to nothing along its axis: then it is dark in Cycles,
    too.
    """
    if light.type != "AREA":
        return np.zeros(len(matrices), dtype=bool)
    needed = 3 if light.shape in {"DISK", "ELLIPSE"} else 2
    return (np.linalg.norm(matrices[:, :3, :needed], axis=1) == 0).any(axis=1)


