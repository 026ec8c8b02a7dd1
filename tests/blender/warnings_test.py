"""Warnings: grouped by cause in the panel, in full in tooltips and in a text, and never a failure themselves."""

import os
import subprocess
from types import SimpleNamespace

import bpy

from scenes import add_camera, add_plane, add_sphere, folder, new_material, new_scene, render


def _clumsy_scene(number=30):
    """Balls whose materials have a pattern that relief does not know, one with two mistakes, and a pass that nobody fills."""
    scene = new_scene(16, 12)
    scene.relief.strict = False
    add_camera()
    scene.view_layers[0].use_pass_vector = True
    for index in range(number):
        material, tree, node = new_material(f"pattern {index}")
        odd = tree.nodes.new("ShaderNodeShaderToRGB")
        odd.name = f"odd {index}"
        tree.links.new(odd.outputs["Color"], node.inputs["Color"])
        add_sphere(0.1, material, (index * 0.1, 0, 0), segments=4)
    material, tree, mix = new_material("both", "ShaderNodeAddShader")
    for index, kind in enumerate(("ShaderNodeVolumeScatter", "ShaderNodeEeveeSpecular")):
        node = tree.nodes.new(kind)
        tree.links.new(node.outputs[0], mix.inputs[index])
    add_plane(2, material)
    return scene


def _rendered(scene):
    """Warnings of a render."""
    from relief import report

    with folder() as path:
        render(scene, "RELIEF", f"{path}/picture.exr", samples=1)
    return report.last_warnings[scene.name]


def test_warnings_are_grouped_by_cause():
    from relief.report import group

    warnings = _rendered(_clumsy_scene())
    assert len(warnings) == 33, warnings
    groups = group(warnings)
    assert [len(g.warnings) for g in groups] == [30, 1, 1, 1], [g.label for g in groups]
    assert "Shader to RGB" in groups[0].label and "odd 7" not in groups[0].label, groups[0].label
    text = groups[0].text()
    assert all(f'material "pattern {i}": ' in text and f'"odd {i}"' in text for i in range(30)), text
    assert "Vector" in groups[1].label, groups[1].label
    assert groups[1].text().splitlines()[1].strip() == f'view layer "{bpy.context.view_layer.name}"', groups[1].text()


def test_the_tooltip_has_the_whole_text():
    from relief.operators import RELIEF_OT_show_warnings

    _rendered(_clumsy_scene())
    tooltip = RELIEF_OT_show_warnings.description(bpy.context, SimpleNamespace(index=0))
    assert 'material "pattern 7": node "odd 7"' in tooltip and "and 5 more" in tooltip, tooltip
    assert "text editor" in RELIEF_OT_show_warnings.description(bpy.context, SimpleNamespace(index=-1))


def test_all_warnings_are_written_to_a_text():
    warnings = _rendered(_clumsy_scene())
    for _ in range(2):  # the second time over the first
        assert bpy.ops.relief.show_warnings(index=2) == {"FINISHED"}
    text = bpy.data.texts["relief warnings"]
    assert len([t for t in bpy.data.texts if t.name.startswith("relief")]) == 1
    written = text.as_string()
    for warning in warnings:
        assert warning in written or (warning.where in written and warning.cause in written), warning
    assert written.count("material ") == 32, written
    assert text.lines[text.current_line_index].body in {w.cause for w in warnings}, "the text is not shown at the group"


def test_a_console_that_is_gone_fails_no_render():
    """Blender's output goes to a pipe that nobody reads any more, as after `| head`."""
    with folder() as path:
        here = os.path.dirname(os.path.abspath(__file__))
        script = (
            # Debian's 4.3 leaves the signal of such pipes deadly, whichever engine renders; 3.4 and 5.2 ignore it.
            "import os, signal, sys; signal.signal(signal.SIGPIPE, signal.SIG_IGN);"
            "sys.path.insert(0, sys.argv[-1]); import warnings_test; s = warnings_test._clumsy_scene();"
            f"s.relief.samples = 1; s.render.engine = 'RELIEF'; s.render.filepath = '{path}/out.exr'; import bpy;"
            "r, w = os.pipe(); os.close(r); os.dup2(w, 1); bpy.ops.render.render(write_still=True)"
        )
        command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "9", "--python-expr", script]
        done = subprocess.run([*command, "--", here], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        assert os.path.exists(f"{path}/out.exr") and done.returncode == 0, done
        assert "Traceback" not in done.stderr, done.stderr
