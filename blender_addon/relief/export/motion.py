# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur: where things are while the shutter is open, asked of Blender and written as an animation.

The file of a frame has keys at the steps of the shutter, which the program then looks up. What is not animated by them is as
it is when the shutter is half done, as in Cycles; so are lights, which Cycles does not blur either.
"""

import math
from dataclasses import dataclass

import numpy as np

from .. import compat
from .mesh import shape_of
from .objects import collect, decompose, usable_places

#: glTF's paths of what moves, by their place in what decompose returns.
_PATHS = ("translation", "rotation", "scale")


@dataclass(frozen=True)
class Shutter:
    """A camera's shutter.

    frames    how long it is open
    position  of the frame's own time: "start", "center" or "end"
    steps     from one place that is looked up to the next
    """

    frames: float
    position: str
    steps: int

    def frame_at(self, frame, part):
        """Frame number when a part of the time has passed, from 0 to 1."""
        return frame + self.frames * (part - {"start": 0.0, "center": 0.5, "end": 1.0}[self.position])

    def json(self):
        """Its part of RELIEF_camera."""
        return {"shutter": self.frames, "shutterPosition": self.position, "shutterSteps": self.steps}


def shutter_of(scene, view_layer, warn):
    """Shutter of a scene's view layer; None if it is closed.

    @param  warn  called with what is not understood, and what was used instead
    """
    render = scene.render
    if not (render.use_motion_blur and view_layer.use_motion_blur) or render.motion_blur_shutter <= 0:
        return None
    if compat.is_rolling_shutter(scene):
        warn("a rolling shutter", "all of the picture is exposed at once")
    points = render.motion_blur_shutter_curve.curves[0].points
    if any(abs(p.location[1] - points[0].location[1]) > 1e-4 for p in points):
        warn("a shutter curve", "the shutter is fully open all the time")
    objects = [o for o in scene.objects if compat.motion_blur_of(o).moves]
    finest = max((compat.motion_blur_of(o).steps for o in objects), default=1)
    return Shutter(render.motion_blur_shutter, compat.shutter_position(scene), min(2**finest, 64))


class Motion:
    """Where things are at the steps of a shutter.

    shutter  Shutter
    frame    number of the frame in the file, so late that no key is before the time 0
    moves    (node, {glTF's path: columns}) of what is animated
    """

    def __init__(self, engine, depsgraph, shutter, report):
        """Asks Blender. Leaves the engine at the time when the shutter is half done."""
        scene = depsgraph.scene
        self.shutter = shutter
        self.frame = math.ceil(shutter.frames) + 1
        self.moves = []
        self._fps = scene.render.fps / scene.render.fps_base
        self._report = report
        self._camera, self._lenses = [], set()
        self._places, self._shapes = {}, {}
        now = scene.frame_current_final
        for step in range(shutter.steps + 1):
            _set_frame(engine, shutter.frame_at(now, step / shutter.steps))
            self._look(engine, depsgraph)
        _set_frame(engine, shutter.frame_at(now, 0.5))
        if len(self._lenses) > 1:
            report.warn(
                f'camera "{scene.camera.name}"', "a lens that changes while the shutter is open", "it stays as it is half way"
            )

    def _look(self, engine, depsgraph):
        """Adds what things are now to what they were at the steps before."""
        camera = depsgraph.scene.camera
        if camera is not None:
            self._lenses.add(_lens(camera.evaluated_get(depsgraph).data))
            self._camera.append(np.array(engine.camera_model_matrix(camera.evaluated_get(depsgraph)), dtype=np.float64))
        for key, thing in numbered(collect(depsgraph, _Silent())):
            settings = compat.motion_blur_of(thing.object)
            if thing.kind != "geometry" or not settings.moves:
                continue
            self._places.setdefault(key, []).append(thing.world_matrices())
            if settings.deforms and thing.data is None and _deforms(thing.object, depsgraph.scene):
                self._shapes.setdefault(key, []).append(_shape(thing, depsgraph))

    def camera_moves(self):
        """Whether the camera moves."""
        return any((m != self._camera[0]).any() for m in self._camera)

    def shapes(self, key, name):
        """Shape of a thing at each step; None: it does not deform."""
        shapes = self._shapes.get(key)
        if shapes is None or all(s is not None and s == shapes[0] for s in shapes):
            return None
        if any(s is None or not s.fits(shapes[0]) for s in shapes) or len(shapes) <= self.shutter.steps:
            self._warn(name, "a mesh whose vertices become more or fewer while the shutter is open", "it keeps its shape meanwhile")
            return None
        return shapes

    def places(self, key, name, numbers):
        """Matrices of a thing's places at each step, float64 (steps + 1, 4, 4), for each number of a place; None: it stands
        still.
        """
        still = [None] * len(numbers)
        steps = self._places.get(key)
        if steps is None:
            return still
        if len(steps) <= self.shutter.steps or any(len(s) != len(steps[0]) for s in steps):
            self._warn(name, "places that become more or fewer while the shutter is open", "it stands still meanwhile")
            return still
        steps = np.stack(steps)
        moves = (steps != steps[0]).any(axis=(0, 2, 3))
        return [self._usable(name, steps[:, number]) if moves[number] else None for number in numbers]

    def _usable(self, name, matrices):
        """Matrices of one place; None, with a warning, if they cannot be animated."""
        usable, _, _, _ = usable_places(matrices)
        if np.array_equal(usable, matrices) and decompose(matrices)[3].all():
            return matrices
        self._warn(name, "a transform that shears or flattens while the shutter is open", "it stands still meanwhile")
        return None

    def _warn(self, name, what, instead):
        self._report.warn(f'object "{name}"', what, instead)

    def move_camera(self, node):
        """Animates the camera's node, which has neither matrix nor scale."""
        if self.camera_moves():
            translation, rotation, _, _ = decompose(np.stack(self._camera))
            self.moves.append((node, {"translation": translation, "rotation": rotation}))

    def move(self, node, matrices):
        """Animates a node, which gets a translation, a rotation and a scale.

        @param  matrices  as places returns them
        """
        parts = decompose(matrices)[:3]
        node.update({path: part[0].tolist() for path, part in zip(_PATHS, parts)})
        self.moves.append((node, dict(zip(_PATHS, parts))))

    def deform(self, node):
        """Animates the weights of a node whose mesh has a target for each step."""
        self.moves.append((node, {"weights": np.eye(self.shutter.steps + 1).ravel()}))

    def write(self, writer, index_of):
        """Puts the animation into the document of a GltfWriter.

        @param  index_of  of each node by its id()
        """
        if not self.moves:
            return
        steps = self.shutter.steps
        frames = [self.shutter.frame_at(self.frame, step / steps) for step in range(steps + 1)]
        times = (np.array(frames) / self._fps).astype(np.float32)
        samplers, channels = [], []
        for node, columns in self.moves:
            arrays = {path: np.ascontiguousarray(values, dtype=np.float32) for path, values in columns.items()}
            accessors = writer.add_accessors({"input": times, **arrays})
            for path in columns:
                samplers.append({"input": accessors["input"], "output": accessors[path]})
                channels.append({"sampler": len(samplers) - 1, "target": {"node": index_of[id(node)], "path": path}})
        writer.add("animations", {"name": "shutter", "samplers": samplers, "channels": channels})


def numbered(things):
    """(key, thing) of things; the key is the same in every walk through the depsgraph."""
    seen = {}
    for thing in things:
        pointer = thing.object.as_pointer()
        seen[pointer] = seen.get(pointer, 0) + 1
        yield (pointer, seen[pointer]), thing


class _Silent:
    """A report for walks whose warnings have been or will be heard."""

    def warn(self, *_):
        pass


def _lens(camera):
    """What of a bpy camera makes its picture smaller or larger."""
    if camera.type == "ORTHO":
        return (camera.type, camera.ortho_scale)
    return (camera.type, camera.sensor_fit, camera.sensor_width, camera.sensor_height, camera.lens)


def _set_frame(engine, frame):
    whole = math.floor(frame)
    engine.frame_set(whole, frame - whole)


def _deforms(original, scene):
    """Whether modifiers or shape keys may move an object's vertices."""
    return original.type == "MESH" and original.is_deform_modified(scene, "RENDER")


def _shape(thing, depsgraph):
    """Shape of a thing now; None if Blender makes no mesh of it."""
    evaluated = thing.object.evaluated_get(depsgraph)
    try:
        mesh = evaluated.to_mesh()
    except RuntimeError:
        return None
    try:
        return shape_of(mesh)
    finally:
        evaluated.to_mesh_clear()

