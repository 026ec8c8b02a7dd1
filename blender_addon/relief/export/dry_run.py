# SPDX-License-Identifier: GPL-3.0-or-later
"""What the export of a material would understand and warn about, without writing anything."""

from ..report import Report
from .material import MaterialJob


class _NoWriter:
    """A GltfWriter for one material that keeps nothing."""

    def add_texture(self, *_):
        return 0

    def extend(self, target, name, value):
        target.setdefault("extensions", {})[name] = value


class _NoImages:
    """An ImageExporter that finds every image."""

    moment = (0.0, 0.0)

    def stored_uri(self, *_):
        return "image", False

    def tile_uris(self, image, *_):
        return {tile.number: "image" for tile in image.tiles}

    def __getattr__(self, _):
        return lambda *_, **__: "image"


def try_material(material, settings):
    """(Coverage of a material's nodes, None without nodes; list of Warned) of one material.

    @param  settings  scene.relief
    """
    report = Report()
    job = MaterialJob(_NoWriter(), _NoImages(), settings, report, material)
    return job.coverage, report.warnings
