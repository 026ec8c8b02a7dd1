"""Colours where $OCIO names a configuration: the same as Cycles', whatever the working space and its names are.

Blender reads $OCIO when it starts, so each test runs in a Blender of its own.
"""

import os
import subprocess

import bpy
import numpy as np

from scenes import (
    IS_4_0,
    _ROOT,
    add_camera,
    add_plane,
    add_sphere,
    assert_agrees,
    folder,
    new_material,
    new_scene,
    set_file_format,
    set_world,
)

_D60, _D65 = (0.32168, 0.33767), (0.3127, 0.3290)
_AP0 = ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770))
_AP1 = ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044))
_REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))

#: An interchange space, a working space with wide primaries, and names that say nothing to anybody but this file.
_CONFIG = """ocio_profile_version: 2
search_path: ""
roles: {{aces_interchange: A0, cie_xyz_d65_interchange: XYZ65, scene_linear: Work, rendering: Work, default: Plain, data: Plain,
  color_timing: Work, compositing_log: Work, default_byte: Screen texture, default_float: Work,
  default_sequencer: Screen texture, color_picking: Screen texture, texture_paint: Screen texture, matte_paint: Screen texture}}
displays:
  Screen:
    - !<View> {{name: Shown, colorspace: Screen texture}}
    - !<View> {{name: Plain, colorspace: Plain}}
colorspaces:
  - !<ColorSpace> {{name: A0}}
  - !<ColorSpace> {{name: Work, to_reference: {work}}}
  - !<ColorSpace> {{name: Narrow, aliases: [lin_rec709], to_reference: {narrow}}}
  - !<ColorSpace> {{name: XYZ65, to_reference: {xyz}}}
  - !<ColorSpace> {{name: Screen texture, aliases: [sRGB], to_reference: !<GroupTransform> {{children: [{curve}, {narrow}]}}}}
  - !<ColorSpace> {{name: Wide screen, to_reference: !<GroupTransform> {{children: [{power}, {work}]}}}}
  - !<ColorSpace> {{name: Plain, isdata: true}}
"""


def _white(x, y):
    return np.array([x / y, 1, (1 - x - y) / y])


def _xyz_from_rgb(primaries, white):
    columns = np.array([_white(*p) for p in primaries]).T
    return columns * np.linalg.solve(columns, _white(*white))


def _adapted(a, b):
    """Bradford's adaptation of XYZ from a white point to another."""
    cones = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
    return np.linalg.inv(cones) @ np.diag((cones @ _white(*b)) / (cones @ _white(*a))) @ cones


def _config():
    to_ap0 = np.linalg.inv(_xyz_from_rgb(_AP0, _D60))

    def transform(matrix):
        whole = np.eye(4)
        whole[:3, :3] = matrix
        return f"!<MatrixTransform> {{matrix: [{', '.join(f'{v:.9g}' for v in whole.ravel())}]}}"

    return _CONFIG.format(
        work=transform(to_ap0 @ _xyz_from_rgb(_AP1, _D60)),
        narrow=transform(to_ap0 @ _adapted(_D65, _D60) @ _xyz_from_rgb(_REC709, _D65)),
        xyz=transform(to_ap0 @ _adapted(_D65, _D60)),
        curve="!<ExponentWithLinearTransform> {gamma: [2.4, 2.4, 2.4, 1], offset: [0.055, 0.055, 0.055, 0]}",
        power="!<ExponentTransform> {value: [2.2, 2.2, 2.2, 1]}",
    )


def _run(function):
    """Runs a function of this file in a Blender with the configuration."""
    with folder() as path:
        with open(f"{path}/config.ocio", "w", encoding="utf-8") as file:
            file.write(_config())
        runner = os.path.join(_ROOT, "tests", "blender", "run_test.py")
        command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "9", "--python", runner]
        done = subprocess.run(
            [*command, "--", "ocio_test", function],
            capture_output=True,
            text=True,
            env={**os.environ, "OCIO": f"{path}/config.ocio"},
            timeout=250,
        )
        print(done.stdout)
        assert done.returncode == 0, done.stdout + done.stderr


def _image(path, kind, space, is_float):
    """A file of a colour that every space reads differently."""
    image = bpy.data.images.new("made", 4, 4, alpha=False, float_buffer=is_float)
    pixels = np.ones((16, 4), dtype=np.float32)
    pixels[:, :3] = (0.8, 0.3, 0.1)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = os.path.join(path, f"{space}{is_float}.{kind[0]}"), kind[1]
    image.save()
    loaded = bpy.data.images.load(image.filepath_raw)
    loaded.colorspace_settings.name = space
    return loaded


def _stage(path):
    """Tiles that shine in a colour each: textures of all spaces, and colours that are made or read by nodes."""
    scene = new_scene(80, 64)
    set_file_format("OPEN_EXR", "32")
    set_world((0, 0, 0))
    add_camera((2, 1.5, 6), type="ORTHO", ortho_scale=5.2)
    png, exr = ("png", "PNG"), ("exr", "OPEN_EXR")
    number = 0

    def tile():
        nonlocal number
        material, tree, emission = new_material(f"tile {number}", "ShaderNodeEmission")
        add_plane(1, material, (number % 5, number // 5, 0))
        number += 1
        return tree, emission

    for kind, space in (
        *((png, space) for space in ("Screen texture", "Wide screen", "Work", "Narrow", "A0", "Plain")),
        *((exr, space) for space in ("Work", "Narrow", "A0", "Plain")),
    ):
        tree, emission = tile()
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = _image(path, kind, space, kind is exr)
        tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    tree, emission = tile()
    body = tree.nodes.new("ShaderNodeBlackbody")
    body.inputs[0].default_value = 2500.0
    tree.links.new(body.outputs["Color"], emission.inputs["Color"])
    for kind in ("ShaderNodeRGBToBW", "ShaderNodeMath"):
        tree, emission = tile()
        texture, node = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new(kind)
        texture.image = bpy.data.images["Work" + "False.png"]
        tree.links.new(texture.outputs["Color"], node.inputs[0])
        tree.links.new(node.outputs[0], emission.inputs["Strength"])
    return scene


def colours_are_those_of_cycles():
    with folder() as path:
        scene = _stage(path)
        # Cycles keeps bytes of other spaces as bytes of its own.
        assert_agrees(scene, runs=3, samples=8, tolerance=0.01)


def a_sky_is_that_of_cycles():
    scene = new_scene()
    tree = set_world((0, 0, 0))
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "SINGLE_SCATTERING" if bpy.app.version >= (5, 0, 0) else "NISHITA"
    sky.sun_disc, sky.sun_elevation = False, 0.5
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 0.1
    material, tree, shader = new_material("painted", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.2, 0.1, 1), Roughness=0.5)
    add_sphere(1.5, material)
    add_camera(lens=40)
    assert_agrees(scene, samples=32, tolerance=0.02)


def an_exported_scene_says_so():
    from relief.exporter import export_frames

    scene = new_scene()
    add_camera()
    add_plane()
    scene.relief.strict = False
    with folder() as path:
        warnings, _ = export_frames(scene, f"{path}/scene.gltf", [1])
    assert any("working space" in warning for warning in warnings), warnings


def test_exported_scenes():
    _run("an_exported_scene_says_so")


def test_colours():
    _run("colours_are_those_of_cycles")


def test_sky():
    _run("a_sky_is_that_of_cycles")


def test_spaces_of_blenders_own_configuration():
    """Here, without $OCIO: also those that no texture of a material has by itself."""
    with folder() as path:
        scene = new_scene()
        set_file_format("OPEN_EXR", "32")
        set_world((0, 0, 0))
        add_camera((1, 0.5, 6), type="ORTHO", ortho_scale=3.2)
        spaces = ("Linear ACEScg", "Filmic sRGB") if not IS_4_0 else ("ACEScg", "Filmic sRGB")
        for row, (kind, is_float) in enumerate(((("png", "PNG"), False), (("exr", "OPEN_EXR"), True))):
            for column, space in enumerate((*spaces, "sRGB")):
                material, tree, emission = new_material("tile", "ShaderNodeEmission")
                texture = tree.nodes.new("ShaderNodeTexImage")
                texture.image = _image(path, kind, space, is_float)
                tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
                add_plane(1, material, (column, row, 0))
        assert_agrees(scene, runs=3, samples=8, tolerance=0.01)
