# SPDX-License-Identifier: GPL-3.0-or-later
"""What the materials of volumes read as attributes: voxels of smoke domains, as images of their slices, and
grids of OpenVDB, as files that the program reads.

Blender shows the former nowhere but in what is evaluated, and none where nothing is baked for the frame.
"""

import os
import tempfile

import bpy
import numpy as np

from .. import compat

#: Grids of a domain by the names of their attributes, and the numbers of a voxel.
_GRIDS = {
    "density": ("density_grid", 1),
    "color": ("color_grid", 4),
    "flame": ("flame_grid", 1),
    "heat": ("heat_grid", 1),
    "temperature": ("temperature_grid", 1),
}

#: Types of grids that the program reads.
_NUMBERS = {"FLOAT", "DOUBLE", "INT", "INT64", "BOOLEAN", "VECTOR_FLOAT", "VECTOR_DOUBLE", "VECTOR_INT"}

#: Below this Cycles takes colours as they are.
_LEAST_ALPHA = 1e-6

#: Rows that an image has at most.
_MOST_ROWS = 65536


def domain_of(evaluated):
    """Settings of the gas that an evaluated object is the domain of; None: it is none."""
    for modifier in evaluated.modifiers:
        if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN" and modifier.show_render:
            settings = modifier.domain_settings
            return settings if settings.domain_type == "GAS" else None
    return None


def read_grids(domain):
    """float32 of shape (z, y, x, numbers) by the names of attributes, those that there are."""
    base = np.array(domain.domain_resolution)
    grids = {}
    for name, (key, numbers) in _GRIDS.items():
        values = getattr(domain, key)
        shape = base * (domain.noise_scale if domain.use_noise and name in {"density", "color", "flame"} else 1)
        if len(values) != int(np.prod(shape)) * numbers or not len(values):
            continue
        flat = np.empty(len(values), dtype=np.float32)
        values.foreach_get(flat)
        grids[name] = np.nan_to_num(flat).reshape(*shape[::-1], numbers)
    return grids


class Voxels:
    """Grids that graphs read by the names of attributes, in a box that generated coordinates reach through from 0 to 1.

    @param  grids   of read_grids
    @param  images  ImageExporter
    """

    def __init__(self, grids, images):
        self._grids = grids
        self._images = images
        self._uris = {}

    def __contains__(self, name):
        return name in self._grids

    def has_alpha(self, name):
        """Whether a grid's colours are multiplied by a fourth number."""
        return self._grids[name].shape[-1] == 4

    def output(self, graph, name, output="color"):
        """Reference to what a grid has at a point, between the middles of voxels, as a node of a graph.

        @param  output  "color", "value" where a number is wanted, or "alpha" of a grid that has it
        """
        if output == "alpha":
            return self._texture(graph, name, "alpha", "value")
        found = self._texture(graph, name, "color", output)
        if output == "value" or not self.has_alpha(name):
            return found
        # As Cycles, which divides by the fourth number between voxels, not in them: beside smoke there is no colour, not black.
        alpha = graph.op("math", {"a": self._texture(graph, name, "alpha", "value"), "b": _LEAST_ALPHA}, "value", operation="maximum")
        found = graph.op("vector-math", {"a": found, "b": alpha}, "vector", operation="divide")
        # A mean of voxels is not above the largest: without saying so a quotient would have no bound.
        most = self._most_color(name)
        return graph.op("vector-math", {"a": found, "b": most}, "vector", operation="minimum")

    def _most_color(self, name):
        grid = self._grids[name]
        colors = np.maximum(grid[..., :3], 0) / np.maximum(grid[..., 3:], _LEAST_ALPHA)
        return [float(most) for most in colors.reshape(-1, 3).max(axis=0)]

    def _texture(self, graph, name, part, output):
        depth, height, width, _ = self._grids[name].shape
        inputs = {"vector": graph.generated()}
        size = [width, height, depth]
        return graph.op("voxel-texture", inputs, output, uri=self._uri(name, part), size=size, values="centers")

    def _uri(self, name, part):
        """URI of a grid's colours or numbers ("color"), or of its fourth number ("alpha")."""
        if (name, part) not in self._uris:
            grid = self._grids[name]
            rows = _slices(grid[..., 3:] if part == "alpha" else grid[..., :3])
            channels = "RGB" if rows.shape[-1] == 3 else "Y"
            self._uris[name, part] = self._images.write_pixels({c: rows[..., i] for i, c in enumerate(channels)})
        return self._uris[name, part]


def _slices(grid):
    """Slices beside and above one another, as the program reads them: (rows, columns, numbers)."""
    depth, height, width, numbers = grid.shape
    columns = -(-depth // max(_MOST_ROWS // height, 1))
    rows = -(-depth // columns)
    padded = np.zeros((rows * columns, height, width, numbers), dtype=np.float32)
    padded[:depth] = grid
    # From (row, column, y, x) to (row, y, column, x).
    return padded.reshape(rows, columns, height, width, numbers).transpose(0, 2, 1, 3, 4).reshape(rows * height, columns * width, numbers)


class Grids:
    """Grids of a volume object, which graphs read by their names.

    @param  volume   bpy volume, evaluated
    @param  bounds   corners of the box that Blender gives it, float64 (8, 3)
    @param  writer   GltfWriter
    @param  warn     called with what is wrong, and what was used instead

    box             (low, high) of all that has values, object space; None: nothing has
    """

    def __init__(self, volume, bounds, writer, warn):
        self._volume = volume
        self._writer = writer
        self._uri = None
        grids = volume.grids
        if not grids.load():
            warn(f'"{grids.frame_filepath}": {grids.error_message or "it cannot be read"}', "it is left out of this frame")
        known = [grid for grid in grids if grid.data_type in _NUMBERS]
        self._names = {grid.name for grid in known}
        self.box = _box_of(bounds, known) if known else None

    def __contains__(self, name):
        return name in self._names

    def has_alpha(self, name):
        return False

    def output(self, graph, name, output="color"):
        """As that of Voxels; of vectors the mean where a number is wanted."""
        inputs = {"vector": graph.op("texture-coordinate", None, "object")}
        return graph.op("voxel-texture", inputs, output, uri=self._file(), grid=name, values=compat.VOXEL_PLACES)

    def _file(self):
        """URI of the file that the grids are in: what modifiers make is saved as one."""
        if self._uri is None:
            path = bpy.path.abspath(self._volume.grids.frame_filepath, library=self._volume.library)
            self._uri = self._writer.file_uri(path) if os.path.isfile(path) else self._save()
        return self._uri

    def _save(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "grids.vdb")
            self._volume.grids.save(filepath=path)
            with open(path, "rb") as file:
                return self._writer.write_file(".vdb", file.read())


def _box_of(corners, grids):
    """(low, high) of all that has values. Blender's bounds are those of leaves, and beyond the last value it takes one more to 0."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not (np.isfinite((low, high)).all() and (high > low).any()):
        return None
    margin = 2 * np.max([np.abs(np.array(grid.matrix_object)[:3, :3]).sum(axis=1) for grid in grids], axis=0)
    return low - margin, high + margin
