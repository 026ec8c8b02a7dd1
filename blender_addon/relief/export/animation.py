# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of a shot joined into one glTF file whose nodes are animated.

The format animates translations, rotations and scales. What moves gets those; what changes in any other way (a mesh
that deforms, a light that dims, a lens that zooms) becomes one node for each of its states, shown in its frames and
shrunk to nothing in the others, which the program leaves out. All keys are steps half a frame before their frame: each
frame has exactly its own values, whatever the rounding of its time.
"""

import json

import numpy as np

from .objects import decompose, rotation_matrices
from .scene import scene_json

#: Scale of what rests out of sight.
_NEARLY_NOTHING = 1e-6

_TRANSFORMS = ("matrix", "translation", "rotation", "scale")


class Shot:
    """Collects the nodes of frame after frame.

    @param  fps  frames a second: frame f is at time f / fps
    """

    def __init__(self, fps):
        self._fps = fps
        self._frames = []
        self._states = {}

    def add_frame(self, frame, nodes):
        """Adds a frame; frames come in increasing order.

        @param  nodes  as SceneExporter has them
        """
        self._frames.append(frame)
        seen = {}
        for node in nodes:
            fixed = {key: value for key, value in node.items() if key not in _TRANSFORMS}
            text = json.dumps(fixed, sort_keys=True)
            seen[text] = seen.get(text, 0) + 1
            state = self._states.setdefault((text, seen[text]), (fixed, {}))
            state[1][frame] = _matrix(node)

    def write(self, writer):
        """Puts scene, nodes and animations into the document of a GltfWriter."""
        nodes, moves = [], []
        for fixed, matrices in self._states.values():
            nodes.extend(self._nodes(fixed, matrices, moves))
        index_of = {}
        writer.json.update(scene_json(nodes, index_of))
        if moves:
            self._write_animation(writer, moves, index_of)

    def _nodes(self, fixed, matrices, moves):
        """Nodes of one thing.

        @param  matrices  its world matrix in each frame in which it is there
        @param  moves     gets (node, frames, columns by channel) of what is animated
        """
        stacked = np.stack(list(matrices.values()))
        is_still = (stacked == stacked[0]).all()
        translation, rotation, scale, exact = decompose(stacked)
        if not is_still and not exact.all():
            # A sheared matrix cannot be animated: one node for each frame.
            for frame, matrix in matrices.items():
                yield self._shown(_placed(fixed, matrix), [frame], moves)
            return
        node = _placed(fixed, stacked[0])
        if not is_still:
            node = {**fixed, "translation": translation[0].tolist()}
            columns = {"translation": translation, "rotation": rotation, "scale": scale}
            moves.append((node, list(matrices), columns))
        yield self._shown(node, list(matrices), moves)

    def _shown(self, node, frames, moves):
        """A node that is there in some frames alone: below one whose scale is 0 in the others."""
        if len(frames) == len(self._frames):
            return node
        visible = set(frames)
        scale = np.array([[1.0 if f in visible else 0.0] * 3 for f in self._frames])
        parent = {"name": f"{node.get('name', '')} in its frames", "children": [node]}
        if not scale[0].any():
            # Without a frame the program shows nodes as they rest, and refuses a scale of 0 there.
            parent["scale"] = [_NEARLY_NOTHING] * 3
        moves.append((parent, self._frames, {"scale": scale}))
        return parent

    def _write_animation(self, writer, moves, index_of):
        samplers, channels = [], []
        for node, frames, columns in moves:
            times = (np.maximum(np.array(frames) - 0.5, 0) / self._fps).astype(np.float32)
            arrays = {path: np.ascontiguousarray(values, dtype=np.float32) for path, values in columns.items()}
            accessors = writer.add_accessors({"input": times, **arrays})
            for path in columns:
                samplers.append({"input": accessors["input"], "output": accessors[path], "interpolation": "STEP"})
                target = {"node": index_of[id(node)], "path": path}
                channels.append({"sampler": len(samplers) - 1, "target": target})
        writer.add("animations", {"name": "shot", "samplers": samplers, "channels": channels})


def _matrix(node):
    """A node's transform as a matrix, float64 (4, 4)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    matrix[:3, :3] = rotation_matrices(np.array([node.get("rotation", (0, 0, 0, 1))]))[0]
    return matrix


def _placed(fixed, matrix):
    """A node with a transform that stays; instanced nodes have none."""
    if (matrix == np.eye(4)).all():
        return dict(fixed)
    return {**fixed, "matrix": [float(x) for x in matrix.T.ravel()]}

