"""How long the viewport takes from a view that moves to its first picture. Prints a Markdown table.

    xvfb-run -a blender --factory-startup --python tests/blender/measure_viewport.py

Not a test. Needs a window, with $BLENDER_USER_SCRIPTS and $RELIEF_BINARY as for the tests. A picture counts when it is there
to be drawn; coarse pictures are a quarter of the view's size.
"""

import os
import sys
import time

import bpy
import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from scenes import (  # noqa: E402
    add_image_node,
    add_light,
    add_plane,
    add_sphere,
    degrees,
    diffuse,
    new_image,
    set_world,
)

_MOVES = 6
_pictures = []  # times at which pictures came, with the seconds that the view had moved before


def _small():
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    add_sphere(1.0, diffuse((0.9, 0.1, 0.1)), (0, 0, 1))


def _triangles():
    """A ball of half a million triangles."""
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    add_sphere(1.0, diffuse((0.9, 0.1, 0.1)), (0, 0, 1), segments=720)


def _noise(side):
    heights = np.random.default_rng(1).random((side, side, 1), dtype=np.float32)
    return np.concatenate([np.repeat(heights, 3, axis=2), np.ones((side, side, 1), np.float32)], axis=2)


def _displaced():
    """A plane of 80,000 triangles under a map of 2048 texels a side."""
    from relief import compat

    material = diffuse((0.5, 0.5, 0.5))
    tree = material.node_tree
    image = add_image_node(tree, new_image(_noise(2048)))
    node = tree.nodes.new("ShaderNodeDisplacement")
    node.inputs["Scale"].default_value = 0.05
    tree.links.new(image.outputs["Color"], node.inputs["Height"])
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    compat.set_displacement_method(material, "DISPLACEMENT")
    add_plane(8, material, subdivisions=200)


_SCENES = {"small": _small, "triangles": _triangles, "displaced": _displaced}


def _area():
    areas = bpy.context.window_manager.windows[0].screen.areas
    return max((a for a in areas if a.type == "VIEW_3D"), key=lambda a: a.width * a.height)


def _watch():
    """Has the viewport note when a picture of another view than before comes."""
    from relief import viewport

    add = viewport.Viewport._add

    def noting(self, picture):
        add(self, picture)
        _pictures.append((time.perf_counter(), self._run.divisor))

    viewport.Viewport._add = noting


def _start(build):
    bpy.ops.preferences.addon_enable(module="relief")
    scene = bpy.context.scene
    for made in list(scene.objects):
        bpy.data.objects.remove(made)
    set_world((0.6, 0.7, 0.9))
    build()
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0)
    scene.render.engine = "RELIEF"
    scene.relief.preview_samples = 4
    space = _area().spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_distance = 8
    space.shading.type = "RENDERED"


def _steps():
    """Yields seconds to wait until."""
    print("| scene | first | coarse | one sample |\n| --- | --: | --: | --: |")
    for name, build in _SCENES.items():
        begin = time.perf_counter()
        _start(build)
        if "add" not in globals():
            _watch()
            globals()["add"] = True
        yield lambda: _pictures and _pictures[-1][1] == 1
        first = _pictures[0][0] - begin
        coarse, full = [], []
        for number in range(_MOVES):
            yield lambda end=time.perf_counter() + 3: time.perf_counter() > end
            _pictures.clear()
            begin = time.perf_counter()
            _area().spaces.active.region_3d.view_distance = 8 + 0.3 * (number + 1)
            _area().tag_redraw()
            yield lambda: _pictures and _pictures[-1][1] == 1
            coarse.append(next(t for t, divisor in _pictures if divisor > 1) - begin)
            full.append(next(t for t, divisor in _pictures if divisor == 1) - begin)
        print(f"| {name} | {first:.2f} | {np.median(coarse):.2f} | {np.median(full):.2f} |", flush=True)
        _area().spaces.active.shading.type = "SOLID"
        _pictures.clear()
    bpy.ops.wm.quit_blender()


bpy.context.preferences.view.show_splash = False
_todo = _steps()
_is_due = [lambda: True]


def _next():
    if _is_due[0]():
        _is_due[0] = next(_todo, None) or (lambda: False)
    return 0.01


bpy.app.timers.register(_next, first_interval=1.0)
