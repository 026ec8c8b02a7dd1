# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxels of smoke domains: what their materials read as attributes, as images whose rows are those of all slices.

Blender shows them nowhere but in what is evaluated, and none where nothing is baked for the frame.
"""

import numpy as np

#: Grids of a domain by the names of their attributes, and the numbers of a voxel.
_GRIDS = {
    "density": ("density_grid", 1),
    "color": ("color_grid", 4),
    "flame": ("flame_grid", 1),
    "heat": ("heat_grid", 1),
    "temperature": ("temperature_grid", 1),
}

_CLAMP = 33071  # glTF's CLAMP_TO_EDGE


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
    @param  writer  GltfWriter
    @param  images  ImageExporter
    """

    def __init__(self, grids, writer, images):
        self._grids = grids
        self._writer = writer
        self._images = images

    def __contains__(self, name):
        return name in self._grids

    def output(self, graph, name):
        """Reference to the colour of a grid at a point, between the middles of voxels, as a node of a graph."""
        grid = self._grids[name]
        depth, height, width, numbers = grid.shape

        def math(operation, *values):
            return graph.op("math", dict(zip("abc", values)), "value", operation=operation)

        parts = graph.add("separate", {"vector": graph.generated()})
        x, y, z = ({"node": parts, "output": axis} for axis in "xyz")
        slices = math("maximum", math("minimum", math("multiply-add", z, float(depth), -0.5), float(depth - 1)), 0.0)
        first = math("floor", slices)
        # Rows of two slices do not mix.
        row = math("maximum", math("minimum", math("multiply", y, float(height)), height - 0.5), 0.5)
        texture = {"index": self._writer.add_texture(self._uri(grid), _CLAMP, False)}
        color = []
        for offset in (0.0, float(height)):
            rows = math("add", math("multiply-add", first, float(height), row), offset)
            place = graph.op("combine", {"x": x, "y": math("divide", rows, float(height * depth)), "z": 0.0}, "vector")
            color.append(graph.op("image-texture", {"vector": place}, "color", texture=texture, colorSpace="linear", alpha="opaque"))
        inputs = {"factor": math("subtract", slices, first), "a": color[0], "b": color[1]}
        return graph.op("mix-color", inputs, "color", blend="mix", clampFactor=False)

    def _uri(self, grid):
        rows = grid.reshape(-1, *grid.shape[2:])
        if grid.shape[-1] == 1:
            return self._images.write_pixels({"Y": rows[..., 0]})
        # As Cycles, which takes what the fourth number has been multiplied by.
        alpha = rows[..., 3:]
        color = np.where((alpha > 1e-6) & (alpha != 1), rows[..., :3] / np.where(alpha > 1e-6, alpha, 1), rows[..., :3])
        return self._images.write_pixels({name: color[..., i] for i, name in enumerate("RGB")})
