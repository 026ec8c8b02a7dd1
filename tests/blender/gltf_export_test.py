"""Files of Blender's own glTF exporter come out as bright as Blender shows them."""

import os
import subprocess

import bpy
import numpy as np
from scenes import IS_5_0, add_camera, add_light, add_plane, folder, new_material, new_scene, read_rgb, render_runs


def _stage():
    """A dull grey floor under a lamp and a sun."""
    scene = new_scene()
    material = new_material("dull", "ShaderNodeBsdfPrincipled", Base_Color=(0.5, 0.5, 0.5, 1), Specular=0, Roughness=1)
    add_plane(material=material[0])
    add_camera((0, 0, 6))
    add_light("POINT", (1, -1, 3), energy=300, shadow_soft_size=0)
    sun = add_light("SUN", energy=0.5, angle=0)
    if IS_5_0:
        # Lights have nodes always, and outside of Eevee the exporter writes the strength of a sun's Emission node alone,
        # without its energy: the file of a sun of energy 0.5 and strength 1 says 1 W/m². The other way round it is right.
        sun.data.energy = 1
        sun.data.node_tree.nodes["Emission"].inputs["Strength"].default_value = 0.5
    return scene


def _export(path, mode=None):
    """@param mode  one of the exporter's lighting modes; None: its default"""
    options = {"filepath": path, "export_format": "GLTF_SEPARATE"}
    known = bpy.ops.export_scene.gltf.get_rna_type().properties.keys()
    options["export_lights"] = options["export_cameras"] = True
    if mode is not None:
        name = "export_import_convert_lighting_mode"
        options[name if name in known else "convert_lighting_mode"] = mode
    bpy.ops.export_scene.gltf(**{k: v for k, v in options.items() if k in known})


def _render_file(path, *options):
    """@return the picture of a glTF file, what was said"""
    picture = path + ".exr"
    done = subprocess.run(
        [os.environ["RELIEF_BINARY"], "render", path, "-o", picture, "--resolution", "64x48", "--spp", "16", *options],
        check=True,
        capture_output=True,
        text=True,
    )
    return read_rgb(picture), done.stderr


def _assert_same_brightness(file_options=(), mode=None, said=""):
    scene = _stage()
    expected = render_runs(scene, "CYCLES", 1, 64)[0]
    with folder() as path:
        name = os.path.join(path, "stage.gltf")
        _export(name, mode)
        picture, messages = _render_file(name, *file_options)
    assert said in messages, messages
    ratio = picture.mean() / expected.mean()
    assert abs(ratio - 1) < 0.02, f"{ratio} of Blender's brightness"
    assert np.abs(picture - expected).max() < 0.1 * expected.max()


def test_lights_of_the_default_unit():
    _assert_same_brightness(said="683 lm/W")


def test_lights_without_unit():
    _assert_same_brightness(mode="COMPAT", said="Unitless")


def test_the_unit_can_be_told():
    _assert_same_brightness(("--luminous-efficacy", "683", "--strict"))
