"""Random graphs of value nodes give the numbers that Cycles gives, point by point: see random_graphs.py.

Where a graph jumps, rounding decides on which side a point lies; so a few points may differ, and of each graph it is
counted how many do.
"""

import dataclasses
import os

import graph_test
import numpy as np
import random_graphs
from scenes import IS_5_0, add_camera, folder, new_scene, render

#: Graphs that are rendered at once; each has so many of the sheet's rows.
GRAPHS_A_SHEET = 20

#: A point agrees within this, where values are 0 … 8.
_TOLERANCE = 1e-4

#: Share of points that may be off: at jumps.
_MOST_OFF = 0.01

#: Difference of the median point that is allowed besides. Since 5.0 numbers that are made of colours are luminances of primaries
#: that differ by .03 % (docs/blender.md), and textures make more of it.
_MOST_MEDIAN = 2e-4 if IS_5_0 else 0.0


@dataclasses.dataclass
class Result:
    num_nodes: int
    off: float  # share of points that differ
    median: float  # difference of the median point
    spread: float  # standard deviation of the values
    error: str = ""  # of the export

    @property
    def judgement(self):
        if self.error:
            return "not exported"
        return "agrees" if self.off <= _MOST_OFF or self.median < _MOST_MEDIAN else "differs"

    def __str__(self):
        numbers = f"{self.num_nodes} nodes, {self.off:.3%} of points off, median {self.median:.1g}, spread {self.spread:.2g}"
        return f"{self.judgement}: {self.error or numbers}"


def compare(seeds):
    """Result by seed."""
    return compare_trees({seed: random_graphs.builder(seed) for seed in seeds})


def compare_trees(builders):
    """Result by what the builders are keyed by."""
    side = graph_test._SIDE
    scene = new_scene(side, side)
    materials = [graph_test._emitter(str(name), build) for name, build in builders.items()]
    graph_test._sheet(materials, -2.0, 2.0).location = (-side / 2, -side / 2, 0)
    add_camera((0, 0, 10), type="ORTHO", ortho_scale=side)
    with folder() as path:
        ours = render(scene, "RELIEF", os.path.join(path, "relief.exr"), samples=1)[::-1].reshape(-1, 3)
        theirs = render(scene, "CYCLES", os.path.join(path, "cycles.exr"), samples=1)[::-1].reshape(-1, 3)
    rows = np.minimum(np.arange(side) * len(materials) // side, len(materials) - 1).repeat(side)
    results = {}
    for number, name in enumerate(builders):
        error = np.abs(ours - theirs)[rows == number].max(axis=1)
        # Where both are no numbers they agree.
        both = np.isnan(ours[rows == number]).any(axis=1) & np.isnan(theirs[rows == number]).any(axis=1)
        off = ~(error <= _TOLERANCE) & ~both
        num_nodes = len(materials[number].node_tree.nodes)
        spread = float(np.nanstd(theirs[rows == number], axis=0).max())
        results[name] = Result(num_nodes, float(off.mean()), float(np.median(error)), spread)
    return results


def test_random_graphs():
    results = compare(range(1, GRAPHS_A_SHEET + 1))
    for seed, result in results.items():
        print(f"seed {seed}: {result}")
    assert all(result.judgement == "agrees" for result in results.values())
