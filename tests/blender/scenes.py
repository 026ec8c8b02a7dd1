"""What the tests have in common: small scenes made with bpy, rendering them with both engines, judging the pictures."""

import contextlib
import math
import os
import shutil
import sys
import tempfile

import bpy
import numpy as np

_ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(_ROOT, "benchmarks", "cycles"))

from agreement import compare_runs  # noqa: E402
from exr import read_rgb  # noqa: E402

#: Chance that a test fails although both engines agree. Seeds are fixed: a test passes always or never.
SIGNIFICANCE = 1e-4

#: Cycles changed in this version: Principled BSDF, lights, spot edges. Tests that compare with what it was before, ask.
IS_4_0 = bpy.app.version >= (4, 0, 0)
IS_5_0 = bpy.app.version >= (5, 0, 0)
IS_5_2 = bpy.app.version >= (5, 2, 0)

#: Blender's name of the colour space that pictures are rendered in.
LINEAR = "Linear Rec.709" if IS_4_0 else "Linear"

#: Standard error of the mean of each engine's pictures: above, a comparison would not notice what it is made to notice.
LARGEST_STANDARD_ERROR = 0.01


@contextlib.contextmanager
def folder():
    """A folder for a test's files."""
    path = tempfile.mkdtemp(prefix="relief_test_")
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def new_scene(width=64, height=48):
    """An empty scene with the add-on switched on; both engines set to the same samples, filter and bounces."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="relief")
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = width, height
    set_file_format("OPEN_EXR", "32")
    scene.relief.filter_type, scene.relief.filter_width = "box", 1.0
    scene.relief.strict = True
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.light_sampling_threshold = 0.0
    scene.cycles.sample_clamp_indirect = 0.0
    scene.cycles.blur_glossy = 0.0
    set_bounces(scene, 0)
    return scene


def set_file_format(file_format, color_depth, **others):
    """What pictures of the current scene are saved as; a multilayer EXR is not compressed and has one part."""
    settings = bpy.context.scene.render.image_settings
    is_multilayer = file_format == "OPEN_EXR_MULTILAYER"
    if IS_5_0:
        settings.media_type = "MULTI_LAYER_IMAGE" if is_multilayer else "IMAGE"
    settings.file_format, settings.color_depth = file_format, color_depth
    if is_multilayer:
        settings.exr_codec = "NONE"
        if IS_5_0:
            settings.use_exr_interleave = True
    for name, value in others.items():
        setattr(settings, name, value)


def set_bounces(scene, bounces):
    """The same number of bounces for both engines; 0 is direct light alone."""
    cycles, relief = scene.cycles, scene.relief
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    relief.max_bounces = relief.diffuse_bounces = relief.glossy_bounces = relief.transmission_bounces = bounces


def render(scene, engine, path, seed=0, samples=16):
    """Renders the current frame as F12 does.

    @param  path  of the EXR to write
    @return       float64 (height, width, 3), row 0 the top one
    @error        RuntimeError with what the engine reported
    """
    if scene.render.engine != engine:  # Blender forgets persistent data whenever it is set
        scene.render.engine = engine
    scene.render.filepath = path
    scene.relief.samples = scene.cycles.samples = samples
    scene.relief.seed = scene.cycles.seed = seed
    bpy.ops.render.render(write_still=True)
    return read_rgb(path)


@contextlib.contextmanager
def _one_job(scene):
    """Data persist within, of both engines: preparing a small picture takes most of its time, and here it is the same again and again."""
    from relief import session

    scene.render.use_persistent_data = True
    try:
        yield
    finally:
        scene.render.use_persistent_data = False
        session.end_all()


def render_runs(scene, engine, runs, samples):
    """Renders with different seeds: float64 (runs, height, width, 3)."""
    with folder() as path, _one_job(scene):
        name = os.path.join(path, "picture.exr")
        return np.stack([render(scene, engine, name, seed, samples) for seed in range(runs)])


def assert_agrees(scene, runs=5, samples=32, block=8, least_mean=0.01, tolerance=0.0, dark=0.0):
    """Fails unless relief and Cycles have the same expected picture of a scene.

    @param  runs, samples  of each engine; so many that a difference of the means of 3 % would be found, which is at ten standard
                           errors: most scenes have less than .2 %
    @param  block          side of the blocks of pixels that are compared
    @param  least_mean     the picture must not be darker on the mean: two black ones agree, too
    @param  tolerance      relative difference of a block that is known and allowed; the test says why
    @param  dark           difference of a block that cannot be seen, as part of the picture's mean
    """
    relief = render_runs(scene, "RELIEF", runs, samples)
    cycles = render_runs(scene, "CYCLES", runs, samples)
    assert_same_expectation(relief, cycles, block, least_mean, tolerance, dark)


def assert_same_expectation(relief, cycles, block=8, least_mean=0.01, tolerance=0.0, dark=0.0):
    """The judgement of assert_agrees, for pictures at hand."""
    agreement = _agreement(relief, cycles, block, tolerance, dark)
    print(agreement, "means", relief.mean(axis=(0, 1, 2)), cycles.mean(axis=(0, 1, 2)))
    assert relief.mean() > least_mean, "the picture is black"
    assert agreement.relative_standard_error < LARGEST_STANDARD_ERROR, "too noisy to tell anything"
    assert agreement.passed, "the pictures differ by more than their noise"


def assert_grids_agree(scene, shown, samples):
    """As assert_agrees where Cycles shows grids of OpenVDB. Debian's of 5.2.2 is built without what reads them: its picture is
    that of a scene without volumes. There relief's own picture must at least not be.

    @param  shown  objects that have the grids
    """

    def pictures():
        with folder() as path:
            return [render(scene, engine, os.path.join(path, "picture.exr")) for engine in ("CYCLES", "RELIEF")]

    assert shown
    cycles, relief = pictures()
    for item in shown:
        item.hide_render = True
    cycles_without, relief_without = pictures()
    for item in shown:
        item.hide_render = False
    if not np.array_equal(cycles, cycles_without):
        assert_agrees(scene, samples=samples)
        return
    print("this Cycles shows no grids")
    assert np.abs(relief - relief_without).mean() > 0.02 * relief_without.mean(), "nothing is seen"


def agreement(scene, runs=5, samples=32, block=8, tolerance=0.0):
    """What assert_agrees judges, for measurements: an Agreement, and the relative difference of the means as they are."""
    relief = render_runs(scene, "RELIEF", runs, samples)
    cycles = render_runs(scene, "CYCLES", runs, samples)
    return _agreement(relief, cycles, block, tolerance, 0.0), relief.mean() / cycles.mean() - 1


def _agreement(relief, cycles, block, tolerance, dark):
    if tolerance or dark:
        relief = relief + _allowed_shift(relief, cycles, block, tolerance, dark)
    return compare_runs(relief, cycles, block, SIGNIFICANCE)


def assert_warns(scene, *texts):
    """Fails unless a render warns with a text that has all of some parts, and fails for it in strict mode.

    Afterwards the scene is not strict.
    """
    from relief import report

    with folder() as path:
        scene.relief.strict = True
        try:
            render(scene, "RELIEF", os.path.join(path, "picture.exr"), samples=1)
        except RuntimeError as error:
            assert all(text in str(error) for text in texts), error
        else:
            raise AssertionError(f"a strict render said nothing of {texts}")
        scene.relief.strict = False
        render(scene, "RELIEF", os.path.join(path, "picture.exr"), samples=1)
    warnings = report.last_warnings[scene.name]
    assert any(all(text in warning for text in texts) for warning in warnings), warnings


def _allowed_shift(relief, cycles, block, tolerance, dark):
    """What may be added to relief's blocks to bring their means nearer to those of Cycles: shape (height, width, 3)."""
    height, width = (side // block * block for side in relief.shape[1:3])
    shape = (height // block, block, width // block, block, 3)
    means = [runs[:, :height, :width].mean(axis=0).reshape(shape).mean(axis=(1, 3)) for runs in (relief, cycles)]
    limit = tolerance * means[1] + dark * means[1].mean()
    shift = np.zeros(relief.shape[1:])
    shift[:height, :width] = np.clip(means[1] - means[0], -limit, limit).repeat(block, 0).repeat(block, 1)
    return shift


def link(data, name="object"):
    """An object of some data, in the scene."""
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def add_camera(location=(0, 0, 6), rotation=(0, 0, 0), **settings):
    """The scene's camera; without rotation it looks down."""
    data = bpy.data.cameras.new("camera")
    for name, value in settings.items():
        setattr(data, name, value)
    camera = link(data, "camera")
    camera.location, camera.rotation_euler = location, rotation
    bpy.context.scene.camera = camera
    return camera


def add_light(kind, location=(0, 0, 3), rotation=(0, 0, 0), **settings):
    data = bpy.data.lights.new("light", kind)
    for name, value in settings.items():
        setattr(data, name, value)
    light = link(data, "light")
    light.location, light.rotation_euler = location, rotation
    return light


def set_world(color, strength=1.0):
    """A plain background; returns its node tree."""
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    # What Cycles samples the world by: finer by itself, up to a second a render, and no picture here has need of that.
    world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 512
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return world.node_tree


def new_material(name="material", kind="ShaderNodeBsdfDiffuse", **inputs):
    """A material of one shader node.

    @param  inputs  values by the input's name, "_" for a space; those of the Principled BSDF by their names in 3.4
    @return         (material, tree, node)
    """
    from relief import compat

    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    node = tree.nodes.new(kind)
    for key, value in inputs.items():
        name = key.replace("_", " ")
        socket = compat.principled_socket(node, name) if kind == "ShaderNodeBsdfPrincipled" else node.inputs[name]
        socket.default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material, tree, node


def make_sharp(node):
    """Makes a Glossy or Glass BSDF perfectly smooth. Since 4.0 that is a roughness, before it was a distribution."""
    if IS_4_0:
        node.inputs["Roughness"].default_value = 0.0
    else:
        node.distribution = "SHARP"


def add_group_socket(tree, name, direction, kind):
    """Adds an input or output to a node group.

    @param  direction  "INPUT" or "OUTPUT"
    """
    if IS_4_0:
        tree.interface.new_socket(name, in_out=direction, socket_type=kind)
    else:
        (tree.inputs if direction == "INPUT" else tree.outputs).new(kind, name)


def diffuse(color=(0.8, 0.8, 0.8), name="diffuse"):
    """A Lambertian material, which both engines mean exactly."""
    return new_material(name, Color=(*color, 1), Roughness=0.0)[0]


def add_plane(size=8.0, material=None, location=(0, 0, 0), subdivisions=1):
    """A square in the xy plane with one uv map over [0, 1]²."""
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=subdivisions, y_subdivisions=subdivisions, size=size, location=location
    )
    plane = bpy.context.object
    plane.data.materials.append(material or diffuse())
    return plane


def add_sphere(radius=1.0, material=None, location=(0, 0, 0), segments=32):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2, radius=radius, location=location)
    sphere = bpy.context.object
    bpy.ops.object.shade_smooth()
    sphere.data.materials.append(material or diffuse())
    return sphere


def add_image_node(tree, image, **settings):
    """An Image Texture node."""
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def new_image(pixels, color_space=LINEAR, is_float=True):
    """A generated image.

    @param  pixels  (height, width, 4), bottom row first
    """
    height, width, _ = pixels.shape
    image = bpy.data.images.new("image", width, height, alpha=True, float_buffer=is_float)
    # First, as Blender forgets painted pixels when the colour space changes.
    image.colorspace_settings.name = color_space
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())
    image.update()
    return image


def asymmetric_pixels(width=16, height=8):
    """A picture without any symmetry: a gradient in each colour along another direction, and one bright corner."""
    v, u = np.mgrid[0:height, 0:width]
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., 0] = u / (width - 1)
    pixels[..., 1] = v / (height - 1)
    pixels[..., 2] = 0.5 + 0.5 * np.sin(u * 0.9 + v * 0.4)
    pixels[: height // 4, : width // 4, :3] = 1.0
    return pixels


def smooth_pixels(width=256, height=128):
    """A picture without any symmetry whose neighbouring texels differ little, also around its border."""
    v, u = np.mgrid[0:height, 0:width] * (2 * np.pi)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    for channel in range(3):
        pixels[..., channel] = 0.5 + 0.3 * np.sin(u / width + channel) + 0.15 * np.sin(v / height + 2 * u / width)
    return pixels


def degrees(*angles):
    return tuple(math.radians(a) for a in angles)


def dice(item, scene, pixels=1.0):
    """Has Cycles subdivide an object to the picture."""
    modifier = item.modifiers.new("dice", "SUBSURF")
    modifier.subdivision_type, modifier.render_levels = "SIMPLE", 0
    if IS_5_0:
        modifier.use_adaptive_subdivision, modifier.adaptive_pixel_size = True, pixels
        return
    scene.cycles.feature_set, scene.cycles.dicing_rate = "EXPERIMENTAL", pixels
    item.cycles.use_adaptive_subdivision = True
