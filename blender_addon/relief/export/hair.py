# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands: hair of particle systems and hair curves as lines of glTF that are curves (RELIEF_curves), as Cycles has them.

Blender hands a strand of particles out point by point, a microsecond each; all else moves as arrays.
"""

from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from .. import compat
from . import attributes

#: Metres from the origin beyond which the program refuses geometry.
_FARTHEST = 1e15

#: Radius of hair curves that have none, in Cycles.
_USUAL_RADIUS = 0.005


@dataclass
class Strands:
    """Some strands in their object's space.

    positions  float32 (points, 3), one strand after the other
    sizes      points of each strand
    radius     float32 (points,)
    roots      what is known of the mesh at each strand's root: float32 (strands, 2 to 4) by ("uv" or "color", name); the first
               of each kind is by "" too if that is the one active in renders
    texspace   (location, 1 / doubled size) of Generated coordinates; None: there are none
    axes       float32 (points, 3): larger axis of an elliptic outline, across each strand; None: they have none
    up         the world's Z
    """

    positions: np.ndarray
    sizes: np.ndarray
    radius: np.ndarray
    roots: dict = field(default_factory=dict)
    texspace: object = None
    axes: object = None
    up: tuple = (0.0, 0.0, 1.0)

    def lengths(self):
        """(length of each strand, length of each up to each point)"""
        steps = np.zeros(len(self.positions))
        if len(steps) > 1:
            steps[1:] = np.linalg.norm(np.diff(self.positions.astype(np.float64), axis=0), axis=1)
        first = np.cumsum(self.sizes) - self.sizes
        steps[first] = 0
        up_to = np.cumsum(steps)
        up_to -= np.repeat(up_to[first], self.sizes)
        return up_to[first + self.sizes - 1], up_to

    def tangents(self):
        """Unit directions of strands at their points, 0 where they have none."""
        is_first, is_last = np.zeros((2, len(self.positions)), dtype=bool)
        end = np.cumsum(self.sizes)
        is_first[end - self.sizes], is_last[end - 1] = True, True
        number = np.arange(len(self.positions))
        position = self.positions.astype(np.float64)
        along = position[np.where(is_last, number, number + 1).clip(max=len(number) - 1)] - position[np.where(is_first, number, number - 1)]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        return np.divide(along, length, out=np.zeros_like(along), where=length > 0)


def wanted_shape(scene):
    """Shape of RELIEF_curves by Cycles' settings of a scene."""
    settings = getattr(scene, "cycles_curves", None)
    return "tubes" if getattr(settings, "shape", "RIBBONS") == "THICK" else "ribbons"


def particle_systems(original):
    """Numbers of an object's particle systems whose strands are rendered as such."""
    systems = getattr(original, "particle_systems", ())
    return [i for i, s in enumerate(systems) if s.settings.type == "HAIR" and s.settings.render_type == "PATH"]


def of_particles(evaluated, is_final):
    """Strands of an object's hair.

    @param  evaluated  bpy object
    @param  is_final   for a render; else as the viewport shows it
    @return            list of (material slot, Strands)
    """
    out = []
    modifiers = [m for m in evaluated.modifiers if m.type == "PARTICLE_SYSTEM"]
    for modifier in modifiers:
        system = modifier.particle_system
        settings = system.settings
        if settings.type != "HAIR" or settings.render_type != "PATH":
            continue
        if not (modifier.show_render if is_final else modifier.show_viewport):
            continue
        strands = _of_system(evaluated, modifier, system, is_final)
        if strands is not None:
            out.append((max(settings.material - 1, 0), strands))
    return out


def _of_system(evaluated, modifier, system, is_final):
    settings = system.settings
    num_parents, num_children = len(system.particles), len(system.child_particles)
    if not is_final:
        num_children = int(num_children * (settings.display_percentage / 100))
    shows_children = settings.child_type != "NONE" and num_children > 0
    numbers = range(num_parents, num_parents + num_children) if shows_children else range(num_parents)
    size = (1 << (settings.render_step if is_final else settings.display_step)) + 1
    if settings.kink == "SPIRAL":
        size += settings.kink_extra_steps
    # Strands without a width are not seen, in Cycles neither, and their points are dear to ask for.
    if not len(numbers) or not settings.radius_scale * max(settings.root_radius, settings.tip_radius) > 0:
        return None
    at = system.co_hair
    points = (at(evaluated, particle_no=number, step=step) for number in numbers for step in range(size))
    count = len(numbers) * size
    world = np.fromiter(chain.from_iterable(points), dtype=np.float32, count=3 * count).reshape(-1, 3).astype(np.float64)
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    if not np.isfinite(matrix).all() or np.linalg.det(matrix[:3, :3]) == 0:
        return None
    inverse = np.linalg.inv(matrix)
    positions = (world @ inverse[:3, :3].T + inverse[:3, 3]).astype(np.float32)
    strands = Strands(positions, np.full(len(numbers), size), np.zeros(count, dtype=np.float32))
    strands.radius = _radii(settings, strands)
    strands.up = matrix[2, :3] / np.linalg.norm(matrix[2, :3])
    mesh = evaluated.data
    strands.texspace = _texspace(mesh)
    strands.roots = _roots(mesh, modifier, system, numbers)
    return strands


def _radii(settings, strands):
    length, up_to = strands.lengths()
    part = _parts(length, up_to, strands.sizes)
    root, tip = settings.root_radius, settings.tip_radius
    shape = settings.shape
    left = np.clip(1 - part, 0, 1)
    with np.errstate(divide="ignore"):
        if shape < 0:
            left = left ** (1 + shape)
        elif shape > 0:
            left = left ** (1 / (1 - shape)) if shape < 1 else np.where(left < 1, 0.0, 1.0)
    radius = 0.5 * settings.radius_scale * (left * (root - tip) + tip)
    if settings.use_close_tip:
        radius[np.cumsum(strands.sizes) - 1] = 0
    return radius.astype(np.float32)


def _parts(length, up_to, sizes):
    """Where points are along their strands, from 0 to 1."""
    whole = np.repeat(length, sizes)
    return np.divide(up_to, whole, out=np.zeros_like(up_to), where=whole > 0)


def _texspace(mesh):
    location = getattr(mesh, "texspace_location", None)
    if location is None:
        return None
    size = np.array(mesh.texspace_size, dtype=np.float32)
    per_metre = np.divide(np.float32(0.5), size, out=np.zeros_like(size), where=size != 0)
    return np.array(location, dtype=np.float32), per_metre


def _roots(mesh, modifier, system, numbers):
    """What the emitter's maps and colours are at the roots of strands, read when it is asked for."""
    particles = list(system.particles)
    last = len(particles) - 1

    def read(at, layer):
        values = (at(modifier, particle=particles[min(n, last)], particle_no=n, **layer) for n in numbers)
        return list(chain.from_iterable(values))

    def read_uv(number):
        return np.array(read(system.uv_on_emitter, {"uv_no": number}), dtype=np.float32).reshape(-1, 2)

    def read_color(number):
        values = np.array(read(system.mcol_on_emitter, {"vcol_no": number}), dtype=np.float32).reshape(-1, 3)
        linear = np.where(values < 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
        return np.concatenate([linear, np.ones((len(values), 1))], axis=1).astype(np.float32)

    out = {}
    for kind, layers, reader in (("uv", mesh.uv_layers, read_uv), ("color", getattr(mesh, "vertex_colors", ()), read_color)):
        for number, layer in enumerate(layers):
            entry = out[kind, layer.name] = _Later(reader, number)
            if layer.active_render:
                out[kind, ""] = entry
    return out


class _Later:
    """An array that is made when it is asked for."""

    def __init__(self, read, number):
        self._read, self._number, self._values = read, number, None

    def get(self):
        if self._values is None:
            self._values = self._read(self._number)
        return self._values


class _Now:
    def __init__(self, values):
        self._values = values

    def get(self):
        return self._values


def of_curves(curves):
    """Strands of bpy hair curves; None: there are none."""
    count = len(curves.points)
    if count == 0:
        return None
    positions = np.empty(3 * count, dtype=np.float32)
    curves.points.foreach_get("position", positions)
    sizes = np.empty(len(curves.curves), dtype=np.int32)
    curves.curves.foreach_get("points_length", sizes)
    radius = np.full(count, _USUAL_RADIUS, dtype=np.float32)
    attribute = curves.attributes.get("radius")
    if attribute is not None and attribute.domain == "POINT" and attribute.data_type == "FLOAT":
        attribute.data.foreach_get("value", radius)
    strands = Strands(positions.reshape(-1, 3), sizes.astype(np.int64), np.maximum(radius, 0))
    normals = getattr(curves, "normals", None)
    if normals is not None and len(normals) == count:
        strands.axes = np.empty(3 * count, dtype=np.float32)
        normals.foreach_get("vector", strands.axes)
        strands.axes = strands.axes.reshape(-1, 3)
    for name, width in (("surface_uv_coordinate", 2),):
        attribute = curves.attributes.get(name)
        if attribute is not None and attribute.domain == "CURVE" and attribute.data_type == "FLOAT2":
            values = np.empty(width * len(attribute.data), dtype=np.float32)
            attribute.data.foreach_get("vector", values)
            strands.roots["uv", ""] = strands.roots["uv", name] = _Now(values.reshape(-1, width))
    return strands


def arrays_of(strands, wanted, warn):
    """Arrays of a glTF primitive by their names, "indices" among them; None: there is no strand.

    @param  wanted  Wanted of the material
    """
    with np.errstate(invalid="ignore"):
        is_placed = (np.abs(strands.positions) < _FARTHEST).all(axis=1) & (strands.radius < _FARTHEST)
    if not is_placed.all():
        first = np.cumsum(strands.sizes) - strands.sizes
        stays = np.logical_and.reduceat(is_placed, first)
        warn(f"{(~stays).sum()} of {len(stays)} strands have points that are not finite, or {_FARTHEST:.0e} m away", "they are left out")
        strands = _chosen(strands, stays)
    strands = _chosen(strands, strands.sizes > 1)
    if not len(strands.sizes):
        return None
    sizes, first = strands.sizes, np.cumsum(strands.sizes) - strands.sizes

    def of_roots(values):
        return np.ascontiguousarray(np.repeat(_finite(values), sizes, axis=0))

    def of_map(source):
        values = strands.roots.get(source)
        return None if values is None else values.get()

    out = {"POSITION": strands.positions, "_RADIUS": strands.radius}
    generated = None
    if strands.texspace is not None:
        location, per_metre = strands.texspace
        generated = (strands.positions[first] - location) * per_metre + np.float32(0.5)
    for number, (kind, name) in enumerate(wanted.coordinates):
        if kind == "uv":
            uv = of_map(("uv", name))
            uv = of_roots(np.zeros((len(sizes), 2), dtype=np.float32) if uv is None else uv)
        elif kind == "generated" and generated is not None:
            uv = of_roots(generated[:, :2])
        else:
            uv = strands.positions[:, :2].copy()
        uv[:, 1] = 1 - uv[:, 1]
        out[f"TEXCOORD_{number}"] = np.ascontiguousarray(uv)
    if wanted.generated and generated is not None:
        out["_GENERATED"] = of_roots(generated)
    if wanted.color is not None and (color := of_map(("color", wanted.color))) is not None:
        out["COLOR_0"] = of_roots(color)
    for source in wanted.attributes:
        values = _attribute(strands, source, of_map, of_roots)
        if values is not None:
            out[attributes.file_name(source)] = values
    begin = np.arange(len(strands.positions), dtype=np.uint32)
    is_last = np.zeros(len(begin), dtype=bool)
    is_last[first + sizes - 1] = True
    begin = begin[~is_last]
    out["indices"] = np.ascontiguousarray(np.stack([begin, begin + np.uint32(1)], axis=1).ravel())
    return out


def _attribute(strands, source, of_map, of_roots):
    kind, name = source
    if kind == "hair":
        length, up_to = strands.lengths()
        if name == "is_strand":
            return np.ones(len(up_to), dtype=np.float32)
        if name == "intercept":
            return _parts(length, up_to, strands.sizes).astype(np.float32)
        if name == "thickness":
            return 2 * strands.radius
        if name == "axis":
            return _any_axes(strands.tangents(), strands.up) if strands.axes is None else _finite(strands.axes)
        if name == "length":
            return of_roots(length.astype(np.float32))
        number = np.arange(len(length), dtype=np.uint32)
        return of_roots(attributes.hashed(number, np.zeros_like(number)))
    values = of_map(source)
    if values is None and kind == "attribute":
        values = of_map(("color", name))
        values = of_map(("uv", name)) if values is None else values
    return None if values is None else of_roots(values)


def _any_axes(along, up):
    """The axes across directions that Cycles takes where a strand has none.

    Since 5.2 it packs normals: 0 becomes Z.
    """
    across = np.stack([along[:, 2] - along[:, 1], along[:, 0] - along[:, 2], along[:, 1] - along[:, 0]], axis=1)
    is_diagonal = (np.abs(across) < 1e-6).all(axis=1)
    across[is_diagonal] = np.stack([along[:, 2] - along[:, 1], along[:, 0] + along[:, 2], -along[:, 1] - along[:, 0]], axis=1)[is_diagonal]
    axes = np.cross(along, across)
    if compat.IS_5_2:
        upright = up - along * (along @ np.array(up))[:, None]
        is_upright = np.linalg.norm(upright, axis=1) > 1e-6
        axes[is_upright] = upright[is_upright]
    return axes.astype(np.float32)


def _finite(values):
    return np.where(np.isfinite(values), values, np.float32(0)).astype(np.float32)


def _chosen(strands, stays):
    """Those of some strands for which a boolean is true."""
    if stays.all():
        return strands
    points = np.repeat(stays, strands.sizes)
    roots = {source: _Now(values.get()[stays]) for source, values in strands.roots.items()}
    axes = None if strands.axes is None else strands.axes[points]
    kept = strands.positions[points], strands.sizes[stays], strands.radius[points]
    return Strands(*kept, roots, strands.texspace, axes, strands.up)
