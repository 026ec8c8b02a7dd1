# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated depsgraph as a list of distinct things and the places they stand at."""

from dataclasses import dataclass, field

import numpy as np

from . import hair
from .instance_values import Place, are_read

#: Objects that Blender can turn into a mesh, and those that have shapes of their own.
GEOMETRY_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "VOLUME", "POINTCLOUD"}

#: Scale below which nothing is seen of an object: its inverse would leave the range of single precision.
_NOTHING = 1e-30

#: Volume of three unit axes below which they lie in a plane but for rounding: the program asks for 4e-7.
_FLAT = 1e-6

#: Thickness of what is flat, as a part of its smaller extent.
_THICKNESS = 1e-4

#: Evaluated objects that have nothing to render.
_SILENT_TYPES = {"CAMERA", "EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}

#: Those that Blender draws over the picture of any engine.
_DRAWN_TYPES = {"GPENCIL", "GREASEPENCIL"}


@dataclass(frozen=True)
class Role:
    """What collections of a view layer make of an object.

    holdout        it is a hole in the picture
    indirect_only  the camera does not see it
    """

    holdout: bool = False
    indirect_only: bool = False


@dataclass
class Things:
    """One object's data and where it stands.

    object    original bpy object: it outlives the walk
    name      of the object
    kind      "geometry" or "light"
    data      evaluated mesh of an instance that geometry nodes made; None: the object's own
    role      Role in the view layer
    is_catcher  it catches shadows; of a light: it shines in the footage, too, which what catches shadows stands for
    matrices  world matrices, row-major, one a place: list of 16 floats each
    places    Place of each, where value graphs may read them; else empty
    surface   its surface is shown
    strands   its hair is shown
    bounds    corners of a volume's box, object space; None of all else
    """

    object: object
    name: str
    kind: str
    data: object = None
    role: Role = Role()
    is_catcher: bool = False
    matrices: list = field(default_factory=list)
    places: list = field(default_factory=list)
    surface: bool = True
    strands: bool = False
    bounds: object = None

    def world_matrices(self):
        """float64 of shape (places, 4, 4)."""
        return np.array(self.matrices, dtype=np.float64).reshape(-1, 4, 4)


def collect(depsgraph, report):
    """Everything to render, each thing once.

    @param  depsgraph  evaluated for a render or a viewport
    @param  report     Report
    @return            list of Things, in the depsgraph's order
    """
    things = {}
    roles = _roles(depsgraph.view_layer)
    looks_at_places, frame = are_read(), depsgraph.scene.frame_current_final
    for instance in depsgraph.object_instances:
        # Blender reuses one object for all instances: only its original and its data tell them apart.
        shown = instance.object
        kind = "geometry" if shown.type in GEOMETRY_TYPES else "light" if shown.type == "LIGHT" else None
        if kind is None:
            if shown.type not in _SILENT_TYPES | _DRAWN_TYPES:
                report.warn(f'object "{shown.name}"', f"objects of type {shown.type.lower()}", "it is left out")
            continue
        original = shown.original
        surface = instance.show_self if not instance.is_instance else True
        strands = kind == "geometry" and instance.show_particles and bool(hair.particle_systems(original))
        if not surface and not strands:
            continue
        data = shown.data
        role = Role()
        if roles:  # an instance has the role of what makes it
            owner = instance.parent if instance.is_instance else shown
            role = roles.get(owner.original.as_pointer(), role)
        is_catcher = shown.is_shadow_catcher
        if kind == "geometry" and instance.is_instance:  # or what makes it
            is_catcher = is_catcher or instance.parent.is_shadow_catcher
        key = (original.as_pointer(), data.as_pointer() if data is not None else 0, role, is_catcher, surface, strands)
        thing = things.get(key)
        if thing is None:
            thing = things[key] = Things(
                original, shown.name, kind, role=role, is_catcher=is_catcher, surface=surface, strands=strands
            )
            if instance.is_instance and kind == "geometry" and _is_made(shown, original, depsgraph):
                thing.data = data
            if shown.type == "VOLUME":
                thing.bounds = np.array(shown.bound_box, dtype=np.float64)
        matrix = instance.matrix_world
        thing.matrices.append((*matrix[0], *matrix[1], *matrix[2], *matrix[3]))
        if looks_at_places:
            thing.places.append(Place(instance, frame))
    # The mesh of a curve or a text comes as an instance besides, and must not stand there twice.
    twice = {pointer for (pointer, *_), thing in things.items() if thing.data is not None and thing.object.type != "MESH"}
    return [thing for (pointer, *_), thing in things.items() if thing.data is not None or pointer not in twice]


def _roles(view_layer):
    """Roles of a view layer's objects by pointer, but of those that have none."""

    def is_special(collection):
        own = not collection.exclude and (collection.holdout or collection.indirect_only)
        return own or any(is_special(child) for child in collection.children)

    objects = view_layer.objects
    if not is_special(view_layer.layer_collection) and not any(shown.is_holdout for shown in objects):
        return {}
    roles = {}
    for shown in objects:
        holdout = shown.holdout_get(view_layer=view_layer)
        role = Role(holdout, not holdout and shown.indirect_only_get(view_layer=view_layer))
        if role != Role():
            roles[shown.as_pointer()] = role
    return roles


def _is_made(shown, original, depsgraph):
    """Whether an instance shows a mesh of its own, made by geometry nodes, instead of an object's."""
    return shown.type in {"MESH", "CURVES", "VOLUME", "POINTCLOUD"} and shown.data != original.evaluated_get(depsgraph).data


def usable_places(matrices):
    """The places at which something can be seen.

    What is flat along one axis stays visible and is given a thickness that nobody sees, as the program's transforms have
    an inverse; what has shrunk to a line or a point is not to be seen.

    @param  matrices  float64 (n, 4, 4)
    @return           (matrices of the places that stay, their numbers among all, number of those that have shrunk to
                      nothing, number of those that are not finite)
    """
    is_finite = np.isfinite(matrices).all(axis=(1, 2))
    finite = matrices[is_finite]
    linear = finite[:, :3, :3]
    numbers = np.flatnonzero(is_finite)
    if not len(linear):
        return finite, numbers, 0, len(matrices)
    lengths = np.linalg.norm(linear, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        volume = np.abs(np.linalg.det(linear / np.where(lengths == 0, 1, lengths)[:, None, :]))
    is_solid = (lengths > _NOTHING).all(axis=1) & (volume > _FLAT)
    if is_solid.all():
        return finite, numbers, 0, len(matrices) - len(finite)
    places, stay = list(finite[is_solid]), list(numbers[is_solid])
    num_shrunk = 0
    for number, matrix in zip(numbers[~is_solid], finite[~is_solid]):
        u, s, v = np.linalg.svd(matrix[:3, :3])
        if s[1] <= max(_NOTHING, _FLAT * s[0]):
            num_shrunk += 1
            continue
        matrix = matrix.copy()
        matrix[:3, :3] = (u * (s[0], s[1], _THICKNESS * s[1])) @ v
        places.append(matrix)
        stay.append(number)
    return np.array(places).reshape(-1, 4, 4), np.array(stay, dtype=np.int64), num_shrunk, int((~is_finite).sum())


def decompose(matrices):
    """Translations, rotations and scales of matrices.

    @param  matrices  float64 (n, 4, 4)
    @return           (translation (n, 3), quaternion (n, 4) as x y z w, scale (n, 3), exact (n,)): exact tells whether
                      the three make the matrix again to 10⁻⁶ of its size; a sheared one cannot be made
    """
    linear = matrices[:, :3, :3]
    scale = np.linalg.norm(linear, axis=1)
    scale[:, 0] *= np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
    safe = np.where(scale == 0, 1.0, scale)
    rotation = linear / safe[:, None, :]
    quaternion = _quaternion(rotation)
    again = rotation_matrices(quaternion) * scale[:, None, :]
    size = np.abs(linear).max(axis=(1, 2))
    exact = np.abs(again - linear).max(axis=(1, 2)) <= 1e-6 * size
    return matrices[:, :3, 3], quaternion, scale, exact & (scale != 0).all(axis=1)


def _quaternion(r):
    """Unit quaternions (x, y, z, w) of rotations (n, 3, 3): the best conditioned of four equal formulas each.

    @source  K. Shoemake 1985, "Animating rotation with quaternion curves", appendix
    """
    xx, yy, zz = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    squares = 1 + np.stack([xx - yy - zz, yy - zz - xx, zz - xx - yy, xx + yy + zz], axis=-1)
    sums = np.stack([r[:, 1, 0] + r[:, 0, 1], r[:, 2, 0] + r[:, 0, 2], r[:, 2, 1] + r[:, 1, 2]], axis=-1)
    turns = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=-1)
    rows = np.stack(
        [
            np.stack([squares[:, 0], sums[:, 0], sums[:, 1], turns[:, 0]], axis=-1),
            np.stack([sums[:, 0], squares[:, 1], sums[:, 2], turns[:, 1]], axis=-1),
            np.stack([sums[:, 1], sums[:, 2], squares[:, 2], turns[:, 2]], axis=-1),
            np.stack([turns[:, 0], turns[:, 1], turns[:, 2], squares[:, 3]], axis=-1),
        ],
        axis=1,
    )
    best = rows[np.arange(len(r)), squares.argmax(axis=1)]
    return best / np.maximum(np.linalg.norm(best, axis=1, keepdims=True), 1e-300)


def rotation_matrices(q):
    """Rotation matrices of unit quaternions."""
    x, y, z, w = q.T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=1,
    )
