# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender meshes as glTF primitives, one a material.

All data moves by foreach_get into typed arrays. A vertex of glTF has one normal and one pair of texture coordinates, one
of Blender as many as corners; so corners that are equal in everything are joined again.
"""

from dataclasses import dataclass, field

import numpy as np

from .. import compat
from . import attributes, hair, points

#: Odd 64-bit constants for hashing the columns of a corner; any will do, equality is checked afterwards.
_HASH_FACTORS = np.random.default_rng(1).integers(1, 2**63, size=32, dtype=np.uint64) | np.uint64(1)


#: Of which those without area are told apart together.
_TRIANGLES_AT_A_TIME = 1 << 14

#: Metres from the origin beyond which the program refuses geometry.
FARTHEST = 1e15


@dataclass(frozen=True)
class Wanted:
    """What a material asks of the meshes that use it.

    coordinates  at most two: ("uv", name of a map, or "" for the one active in renders), ("generated", ""), ("object", "")
    color        name of a colour attribute that multiplies the base colour, "" for the active one; None: none
    displaced    normals say where surfaces go to, so they must not open flat-shaded edges
    by_shading   smooth and flat faces have materials of their own
    generated    value graphs read the coordinates that Blender generates
    tangents     value graphs read tangents along the uv map that is active in renders
    attributes   that value graphs read by name: see attributes.py
    values       of objects that value graphs read: see instance_values.py; the mesh does not depend on them
    """

    coordinates: tuple = ()
    color: object = None
    displaced: bool = False
    by_shading: bool = False
    generated: bool = False
    tangents: bool = False
    attributes: tuple = ()
    values: tuple = field(default=(), compare=False)


@dataclass(frozen=True, eq=False)
class _OfVertices:
    """An attribute that all corners at a vertex have in common.

    values  float32 (vertices, 1 to 4)
    """

    values: np.ndarray


class _Corners:
    """A mesh's triangles and the attributes of their corners, which are read once for all slots.

    @param  num_slots  of materials; where there is but one, all triangles have it
    """

    def __init__(self, mesh, warn, num_slots=1):
        self.mesh = mesh
        self._warn = warn
        self._read = {}
        mesh.calc_loop_triangles()
        num_triangles, num_loops = len(mesh.loop_triangles), len(mesh.loops)
        loops = np.empty(3 * num_triangles, dtype=np.int32)
        mesh.loop_triangles.foreach_get("loops", loops)
        self.loops = loops.reshape(-1, 3)
        self.material = np.zeros(num_triangles, dtype=np.int32)
        if num_slots > 1:
            mesh.loop_triangles.foreach_get("material_index", self.material)
        self.is_smooth = np.empty(num_triangles, dtype=bool)
        mesh.loop_triangles.foreach_get("use_smooth", self.is_smooth)
        self.vertex = np.empty(num_loops, dtype=np.int32)
        mesh.loops.foreach_get("vertex_index", self.vertex)
        self.positions = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", self.positions)
        self.positions = self.positions.reshape(-1, 3)
        self._drop_unplaced()
        self._drop_empty()

    def _drop_unplaced(self):
        """Leaves out triangles with a corner that is nowhere."""
        with np.errstate(invalid="ignore"):
            is_placed = (np.abs(self.positions) < FARTHEST).all(axis=1)
        if is_placed.all():
            return
        keep = is_placed[self.vertex[self.loops]].all(axis=1)
        number = f"{(~is_placed).sum()} of {len(is_placed)} vertices are not finite, or {FARTHEST:.0e} m away"
        self._warn(number, "its triangles there are left out" if keep.any() else "it is left out of this frame")
        self._keep(keep)
        # Of unused vertices, too, nothing that is not finite may reach the files or the sums below.
        self.positions[~is_placed] = 0

    def _drop_empty(self):
        """Leaves out triangles without area, which text and bevels are full of: nothing can be seen of them."""
        keep = np.empty(len(self.loops), dtype=bool)
        # As many at a time as stay in a cache: of a large mesh the arrays between would be memory that is new each time.
        for begin in range(0, len(keep), _TRIANGLES_AT_A_TIME):
            some = slice(begin, begin + _TRIANGLES_AT_A_TIME)
            vertex = self.vertex[self.loops[some]]
            keep[some] = _is_wide(*(self.positions.take(vertex[:, i], axis=0) for i in range(3)))
        if keep.all():
            return
        vertex = self.vertex[self.loops]
        a, b, c = (self.positions[vertex[~keep, i]].astype(np.float64) for i in range(3))
        keep[~keep] = np.cross(b - a, c - a).any(axis=1)
        if not keep.all():
            self._keep(keep)

    def _keep(self, keep):
        """Leaves out triangles: those for which a boolean is not true."""
        self.loops, self.material, self.is_smooth = self.loops[keep], self.material[keep], self.is_smooth[keep]

    def _once(self, read, *source):
        """What a method reads from a source; what it gave stays for the next slot."""
        key = (read.__name__, *source)
        if key not in self._read:
            self._read[key] = read(*source)
        return self._read[key]

    def at(self, values, loops):
        """An attribute at some corners.

        @param  values  float32 (all loops, k), or _OfVertices
        @param  loops   numbers of them, or a slice
        @return         float32 (loops, k)
        """
        return values.values[self.vertex[loops]] if isinstance(values, _OfVertices) else values[loops]

    def normals(self):
        """Normals with flat faces, sharp edges and custom normals considered: as `at` takes them."""
        return self._once(self._read_normals)

    def displacement_normals(self):
        """Normals without the edges of flat faces, which displacement would tear open; marked edges stay: as `at` takes them."""
        return self._once(self._read_displacement_normals)

    def warped(self, triangles):
        """Which triangles are shaded by themselves: those of flat faces that are not planar. Cycles knows no normal of a face.

        @param  triangles  loop numbers (n, 3)
        @return            bool (n,)
        """
        flat = self._once(self._read_flat)
        if flat is None:
            return np.zeros(len(triangles), dtype=bool)
        normals = triangle_normals(self.positions[self.vertex[triangles]])
        cosines = np.einsum("ij,ij->i", normals, self.normals()[triangles[:, 0]])
        return flat[triangles[:, 0]] & (cosines < 1 - 5e-7) & normals.any(axis=1)

    def coordinates(self, source):
        """Texture coordinates in glTF's orientation, v = 0 at the top: float32 (loops, 2); None if there are none."""
        return self._once(self._read_coordinates, source)

    def generated(self):
        """Generated coordinates: _OfVertices of three numbers."""
        return self._once(self._read_generated)

    def attribute(self, source):
        """An attribute that graphs read by name: float32 (loops, 1 to 4); None if there is none."""
        return self._once(self._read_attribute, source)

    def color(self, name):
        """A colour attribute, linear: float32 (loops, 4); None if there is none on vertices or corners."""
        return self._once(self._read_color, name)

    def _read_normals(self):
        if compat.has_vertex_normals(self.mesh):
            return self._once(self._read_vertex_normals)
        return _zero_where_not_finite(compat.corner_normals(self.mesh))

    def _read_flat(self):
        """Whether corners are of flat faces with more than three: bool (loops,); None: none is."""
        polygons = self.mesh.polygons
        if compat.has_vertex_normals(self.mesh) or self.mesh.has_custom_normals:
            return None
        smooth, corners = np.empty(len(polygons), dtype=bool), np.empty(len(polygons), dtype=np.int32)
        polygons.foreach_get("use_smooth", smooth)
        polygons.foreach_get("loop_total", corners)
        flat = ~smooth & (corners > 3)
        return np.repeat(flat, corners) if flat.any() else None

    def _read_displacement_normals(self):
        return self.normals() if compat.splits_normals(self.mesh) else self._once(self._read_vertex_normals)

    def _read_vertex_normals(self):
        return _OfVertices(_zero_where_not_finite(compat.vertex_normals(self.mesh)))

    def _read_coordinates(self, source):
        kind, name = source
        if kind == "uv":
            layer = self._uv_layer(name)
            if layer is None:
                return None
            uv = np.empty(2 * len(self.mesh.loops), dtype=np.float32)
            layer.data.foreach_get("uv", uv)
            uv = uv.reshape(-1, 2)
        elif kind == "around":
            uv = self._around()
        else:
            uv = self.positions[self.vertex, :2]
            if kind == "generated":
                uv = self.at(self.generated(), slice(None))[:, :2]
        out = np.empty_like(uv)
        out[:, 0] = uv[:, 0]
        out[:, 1] = 1 - uv[:, 1]
        return self._finite(out, "texture coordinates")

    def _rest(self):
        """Where vertices are at rest: float32 (vertices, 3)."""
        rest = np.empty(3 * len(self.mesh.vertices), dtype=np.float32)
        self.mesh.vertices.foreach_get("undeformed_co", rest)
        return rest.reshape(-1, 3)

    def _around(self):
        """Longitude and latitude around the object's origin, a turn of 1: what Cycles takes for a uv map that tangents lack."""
        places = self._rest() if compat.TANGENTS_AROUND_THE_REST else self.positions
        x, y, z = places.astype(np.float64).T
        length = np.sqrt(x * x + y * y + z * z)
        longitude = np.where((x == 0) & (y == 0), 0, 0.5 - np.arctan2(x, y) / (2 * np.pi))
        cosine = np.divide(z, length, out=np.ones_like(z), where=length > 0)
        uv = np.stack([longitude, 1 - np.arccos(np.clip(cosine, -1, 1)) / np.pi], axis=-1)
        uv[length == 0] = 0
        uv = uv[self.vertex]
        if compat.LONGITUDES_ARE_JOINED:
            # Within half a turn of each face's first corner.
            sizes = np.empty(len(self.mesh.polygons), dtype=np.int32)
            self.mesh.polygons.foreach_get("loop_total", sizes)
            first = np.repeat(uv[np.cumsum(sizes) - sizes, 0], sizes)
            uv[:, 0] += np.round(first - uv[:, 0])
        return uv.astype(np.float32)

    def _read_generated(self):
        # Of the mesh at rest, carried along by modifiers that make or remove vertices; Blender's texture space is its box.
        location = np.array(self.mesh.texspace_location, dtype=np.float32)
        size = np.array(self.mesh.texspace_size, dtype=np.float32)
        per_metre = np.divide(np.float32(0.5), size, out=np.zeros_like(size), where=size != 0)
        generated = (self._rest() - location) * per_metre + np.float32(0.5)
        return _OfVertices(self._finite(generated, "generated coordinates"))

    def _finite(self, values, what):
        """Values with 0 where they are not finite."""
        finite = _zero_where_not_finite(values)
        if finite is not values:
            self._warn(f"{what} that are not finite", "0 was used")
        return finite

    def _uv_layer(self, name):
        if name:
            return self.mesh.uv_layers.get(name)
        return next((layer for layer in self.mesh.uv_layers if layer.active_render), None)

    def _read_attribute(self, source):
        values = attributes.read(source, self.mesh, self.vertex)
        return None if values is None else self._finite(values, f"values of the attribute {source[1]}")

    def _read_color(self, name):
        attributes = self.mesh.color_attributes
        attribute = attributes.get(name)
        if not name and len(attributes) > 0:
            attribute = attributes[max(attributes.render_color_index, 0)]
        if attribute is None or attribute.domain not in {"POINT", "CORNER"}:
            return None
        values = np.empty(4 * len(attribute.data), dtype=np.float32)
        attribute.data.foreach_get("color", values)
        values = self._finite(values.reshape(-1, 4), "colours")
        return values[self.vertex] if attribute.domain == "POINT" else values


def _is_wide(a, b, c):
    """Whether triangles have an area for sure, as nearly all have: float32 tells it in a fifth of the time of float64.

    @param  a, b, c  corners, float32 (n, 3)
    @return          of (n,); false says nothing
    """
    b, c = b - a, c - a
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.einsum("ij,ij->i", b, b) * np.einsum("ij,ij->i", c, c)
        cosine = np.einsum("ij,ij->i", b, c)
        # A sine of .01: what is rounded is a thousandth of its square. Squares that overflow, or are all lost, say no.
        return squares - cosine * cosine > np.float32(1e-4) * squares


def _zero_where_not_finite(values):
    """The same array if all is finite. Normals of length 0, as they are around a vertex that is nowhere, the program replaces."""
    is_finite = np.isfinite(values)
    return values if is_finite.all() else np.where(is_finite, values, np.float32(0))


@dataclass(frozen=True, eq=False)
class Shape:
    """Where a mesh's vertices are at one time.

    positions            float32 (vertices, 3)
    normals              of corners, float32 (loops, 3)
    displacement_normals likewise
    """

    positions: np.ndarray
    normals: np.ndarray
    displacement_normals: np.ndarray

    def __eq__(self, other):
        return self.fits(other) and np.array_equal(self.positions, other.positions) and np.array_equal(self.normals, other.normals)

    def fits(self, other):
        """Whether both have the same vertices and corners."""
        return len(self.positions) == len(other.positions) and len(self.normals) == len(other.normals)


def shape_of(mesh):
    """Shape of an evaluated bpy mesh."""
    corners = _Corners(mesh, lambda *_: None)
    normals, displacement_normals = (corners.at(n, slice(None)) for n in (corners.normals(), corners.displacement_normals()))
    return Shape(corners.positions, normals, displacement_normals)


@dataclass(frozen=True)
class StoredMesh:
    """A mesh whose arrays are in files.

    wanted      what its slots' materials asked for: tuple of Wanted
    primitives  (slot, whether its faces are smooth, StoredArrays) for each slot that has triangles; smooth and flat faces
                are told apart where the slot's material wants it
    warnings    what is to be said of each object that has it: arguments of a warning's function
    strands     (slot, StoredArrays) of its hair
    points      StoredArrays of a point cloud; None: it is none
    """

    name: str
    wanted: tuple
    primitives: list
    warnings: tuple
    strands: tuple = ()
    points: object = None

    def reach(self):
        """Largest coordinate of a vertex, metres in object space."""
        parts = [arrays for *_, arrays in (*self.primitives, *self.strands)] + [self.points] * (self.points is not None)
        bounds = [arrays.accessors["POSITION"][0] for arrays in parts]
        return max((abs(x) for accessor in bounds for x in accessor["min"] + accessor["max"]), default=0.0)


def store_mesh(mesh, wanted, writer, shapes=()):
    """Writes a mesh's arrays.

    @param  mesh    evaluated bpy mesh; its caches of triangles and normals are filled
    @param  wanted  tuple of the Wanted of each slot's material, at least one
    @param  writer  GltfWriter
    @param  shapes  Shape at each step of a shutter, which become morph targets; empty: it does not deform
    @return         StoredMesh
    """
    warnings = []

    def warn(*text):
        warnings.append(text)

    corners = _Corners(mesh, warn, len(wanted))
    slots = np.clip(corners.material, 0, len(wanted) - 1)
    primitives = []
    parts = 2 * slots
    if any(w.by_shading for w in wanted):
        parts += corners.is_smooth & np.array([w.by_shading for w in wanted])[slots]
    joiner = _Joiner(corners.vertex, len(corners.positions))
    for part, triangles in _by_part(parts, corners.loops):
        slot, is_smooth = divmod(part, 2)
        arrays = _primitive_arrays(corners, triangles, joiner, wanted[slot], shapes, warn)
        primitives.append((slot, bool(is_smooth), writer.store(arrays)))
    return StoredMesh(mesh.name, wanted, primitives, tuple(warnings))


def _by_part(parts, triangles):
    """Triangles by the part that they belong to: pairs (number of the part, its triangles), both in order."""
    if len(parts) > 0 and (parts == parts[0]).all():
        return [(int(parts[0]), triangles)]
    order = np.argsort(parts, kind="stable")
    numbers, begins = np.unique(parts[order], return_index=True)
    return list(zip(numbers.tolist(), np.split(triangles[order], begins[1:])))


def store_box(box, name, wanted, slot, writer):
    """Writes a box.

    @param  box     (low, high)
    @param  wanted  tuple of the Wanted of each slot's material, at least one
    @param  slot    whose material it has
    @return         StoredMesh
    """
    corners = np.array([[box[(i >> axis) & 1][axis] for axis in range(3)] for i in range(8)], dtype=np.float32)
    sides = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    normals = np.zeros((24, 3), dtype=np.float32)
    for side, (axis, sign) in enumerate(((2, -1), (2, 1), (1, -1), (1, 1), (0, -1), (0, 1))):
        normals[4 * side : 4 * side + 4, axis] = sign
    triangles = np.array([[4 * side + i for i in (0, 1, 2, 0, 2, 3)] for side in range(6)], dtype=np.uint32)
    arrays = {"POSITION": corners[sides.ravel()], "NORMAL": normals, "indices": triangles.ravel()}
    if wanted[slot].generated:  # a volume has none: they are its coordinates
        arrays["_GENERATED"] = arrays["POSITION"]
    return StoredMesh(name, wanted, [(slot, False, writer.store(arrays))], ())


def store_strands(strands, name, wanted, writer):
    """Writes strands.

    @param  strands  list of (slot, Strands)
    @param  wanted   tuple of the Wanted of each slot's material, at least one
    @return          StoredMesh without triangles
    """
    warnings, out = [], []
    for slot, some in strands:
        slot = min(slot, len(wanted) - 1)
        arrays = hair.arrays_of(some, wanted[slot], lambda *text: warnings.append(text))
        if arrays is not None:
            out.append((slot, writer.store(arrays)))
    return StoredMesh(name, wanted, [], tuple(warnings), tuple(out))


def store_points(cloud, name, wanted, writer):
    """Writes an evaluated bpy point cloud, whose points have the first slot's material.

    @param  wanted  tuple of the Wanted of each slot's material, at least one
    @return         StoredMesh without triangles
    """
    warnings = []
    arrays = points.arrays_of(cloud, wanted[0], lambda *text: warnings.append(text))
    return StoredMesh(name, wanted, [], tuple(warnings), points=None if arrays is None else writer.store(arrays))


def add_mesh(stored, materials, writer, dicing=None, curve_shape="ribbons"):
    """Refers to a stored mesh.

    @param  materials  for each slot what gives its material's index in the glTF, for smooth faces or for flat ones
    @param  dicing       compat.Dicing; None: Cycles does not dice it
    @param  curve_shape  of its strands, as RELIEF_curves has it
    @return              index of a glTF mesh; None if there is nothing in it
    """
    if not stored.primitives and not stored.strands and stored.points is None:
        return None
    primitives = []
    for slot, is_smooth, arrays in stored.primitives:
        attributes = dict(writer.add_stored(arrays))
        targets = []
        while _target("POSITION", len(targets)) in attributes:
            number = len(targets)
            targets.append({name: attributes.pop(_target(name, number)) for name in ("POSITION", "NORMAL")})
        primitive = {"indices": attributes.pop("indices"), "attributes": attributes, "material": materials[slot](is_smooth, dicing)}
        if targets:
            primitive["targets"] = targets
        primitives.append(primitive)
    for slot, arrays in stored.strands:
        attributes = dict(writer.add_stored(arrays))
        lines = {"mode": 1, "indices": attributes.pop("indices"), "attributes": attributes, "material": materials[slot](True, False)}
        writer.extend(lines, "RELIEF_curves", {"shape": curve_shape})
        primitives.append(lines)
    if stored.points is not None:
        balls = {"mode": 0, "attributes": dict(writer.add_stored(stored.points)), "material": materials[0](True, False)}
        writer.extend(balls, "RELIEF_points", {})
        primitives.append(balls)
    return writer.add_unique("meshes", {"name": stored.name, "primitives": primitives})


def triangle_normals(points):
    """Unit normals of triangles, 0 of those without area.

    @param  points  (n, 3 corners, 3)
    """
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)


def _target(name, number):
    """Name of an array of a morph target."""
    return f"{name} {number}"


def _primitive_arrays(corners, triangles, joiner, wanted, shapes, warn):
    """Attributes and indices of some triangles.

    @param  triangles  loop numbers of shape (n, 3)
    @param  joiner     _Joiner of the mesh
    @return            arrays by glTF's names, "indices" among them
    """
    per_loop = {"NORMAL": corners.displacement_normals() if wanted.displaced else corners.normals()}
    for number, source in enumerate(wanted.coordinates):
        uv = corners.coordinates(source)
        if uv is None and wanted.tangents and not source[1] and len(corners.mesh.uv_layers) == 0:
            uv = corners.coordinates(("around", ""))
        elif uv is None:
            warn(f'no uv map "{source[1]}"' if source[1] else "a textured material, but no uv map")
            uv = np.broadcast_to(np.float32(0), (len(corners.vertex), 2))
        per_loop[f"TEXCOORD_{number}"] = uv
    if wanted.generated:
        per_loop["_GENERATED"] = corners.generated()
    if wanted.color is not None:
        color = corners.color(wanted.color)
        if color is None:
            warn(f'no colour attribute "{wanted.color}" on vertices or corners; its colour is white')
        else:
            per_loop["COLOR_0"] = color
    for source in wanted.attributes:
        values = corners.attribute(source)
        if values is not None:  # where it is not, it is 0 for Blender, too
            per_loop[attributes.file_name(source)] = values
    may_differ = [values for values in per_loop.values() if not isinstance(values, _OfVertices)]
    representatives, indices = joiner.join(triangles.ravel(), may_differ)
    warped = np.zeros(0, dtype=bool) if wanted.displaced else corners.warped(triangles)
    own = slice(len(representatives), None)  # corners that no other triangle has
    if warped.any():
        indices = indices.reshape(-1, 3)
        indices[warped] = own.start + np.arange(3 * np.count_nonzero(warped)).reshape(-1, 3)
        indices = indices.ravel()
        representatives = np.concatenate((representatives, triangles[warped].ravel()))
    arrays = {"POSITION": np.ascontiguousarray(corners.positions[corners.vertex[representatives]])}
    for name, values in per_loop.items():
        arrays[name] = np.ascontiguousarray(corners.at(values, representatives))
    if warped.any():
        arrays["NORMAL"][own] = np.repeat(triangle_normals(arrays["POSITION"][own].reshape(-1, 3, 3)), 3, axis=0)
    for number, shape in enumerate(shapes):
        normals = shape.displacement_normals if wanted.displaced else shape.normals
        moved = {"POSITION": shape.positions[corners.vertex[representatives]], "NORMAL": normals[representatives]}
        if warped.any():
            moved["NORMAL"][own] = np.repeat(triangle_normals(moved["POSITION"][own].reshape(-1, 3, 3)), 3, axis=0)
        for name, values in moved.items():
            arrays[_target(name, number)] = np.ascontiguousarray(values - arrays[name])
    arrays["indices"] = indices
    return arrays


class _Joiner:
    """Finds equal corners. Its tables serve all parts of a mesh: what a part costs grows with the part, not with the mesh.

    @param  vertex  vertex of each loop
    """

    def __init__(self, vertex, num_vertices):
        self._vertex = vertex
        # Of other parts' loops and vertices they say what was written last, so they are read where this part has written.
        self._at_loop = np.zeros(len(vertex), dtype=np.uint32)
        self._at_vertex = np.zeros(num_vertices, dtype=np.int64)

    def join(self, loops, attributes):
        """Finds the corners that are equal in vertex and attributes.

        @param  loops       loop numbers of triangle corners
        @param  attributes  float32 arrays of shape (all loops, k)
        @return             (one loop for each distinct corner, uint32 index into these for each of `loops`)
        @cost               linear, but for sorts: of the corners that differ from the first one at their vertex, and of all
                            if they are few
        """
        used = _in_order(loops, len(self._vertex))
        vertex = self._vertex[used]
        # The first corner at each vertex: of equal indices, the last assignment stays.
        self._at_vertex[vertex[::-1]] = used[::-1]
        nominal = self._at_vertex[vertex]
        differs = np.zeros(len(used), dtype=bool)
        for values in attributes:
            differs |= (values[used] != values[nominal]).any(axis=1)
        others, group = _distinct(used[differs], self._vertex, attributes)
        vertices = _in_order(vertex, len(self._at_vertex))
        first = self._at_vertex[vertices]
        self._at_vertex[vertices] = np.arange(len(vertices))
        self._at_loop[used] = self._at_vertex[vertex]
        self._at_loop[used[differs]] = len(vertices) + group
        return np.concatenate([first, others]), self._at_loop[loops]


def _in_order(numbers, end):
    """The distinct ones of some whole numbers from 0 to below an end, in order."""
    # Marks cost time for each number below the end, a sort for each that is there, and about ten times as much.
    if end > 16 * len(numbers):
        return np.unique(numbers)
    is_there = np.zeros(end, dtype=bool)
    is_there[numbers] = True
    return np.flatnonzero(is_there)


def _distinct(loops, vertex, attributes):
    """Distinct corners among some: (a loop for each, index into these for each of `loops`)."""
    columns = [vertex[loops].astype(np.uint64)]
    for values in attributes:
        columns.extend(np.ascontiguousarray(values[loops]).view(np.uint32).astype(np.uint64).T)
    key = np.zeros(len(loops), dtype=np.uint64)
    for column, factor in zip(columns, _HASH_FACTORS):
        key = (key ^ column) * factor
        key ^= key >> np.uint64(29)
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    if not all(np.array_equal(column[first][group], column) for column in columns):
        # Two different corners with one key: about once in 10⁷ meshes of a million vertices.
        first = group = np.arange(len(loops))
    return loops[first], group
