"""Motion blur: what moves, turns and deforms while the shutter is open looks as in Cycles."""

import bpy
import numpy as np
from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    folder,
    link,
    new_image,
    new_scene,
    render,
    set_world,
)


def _stage():
    """A floor and a lamp, seen from before; the shutter is open for a whole frame around frame 10."""
    scene = new_scene(64, 48)
    set_world((0.1, 0.15, 0.2))
    add_plane(8, diffuse((0.4, 0.4, 0.4)), (0, 0, -0.6))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2.0)
    add_camera((0, -5, 1), degrees(80, 0, 0), lens=40)
    scene.frame_set(10)
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0
    return scene


def _animate(owner, path, before, after, frames=(9, 11)):
    """Lets a property go evenly from one value to another."""
    for frame, value in zip(frames, (before, after)):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    for animated in bpy.data.actions:
        for curve in _curves(animated):
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
    bpy.context.scene.frame_set(10)


def _curves(action):
    """Curves of an action; since 4.4 they are in its layers."""
    if hasattr(action, "fcurves"):
        return action.fcurves
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves]


def _box(size=(0.9, 0.5, 0.3), material=None):
    bpy.ops.mesh.primitive_cube_add()
    shown = bpy.context.object
    shown.scale = size
    shown.data.materials.append(material or diffuse((0.8, 0.5, 0.3)))
    return shown


def test_objects_that_go():
    scene = _stage()
    _animate(_box(), "location", (-1.2, 0, 0), (1.2, 0, 0.4))
    assert_agrees(scene, block=8)


def test_objects_that_turn():
    """In as many steps as Cycles has."""
    scene = _stage()
    shown = _box()
    shown.cycles.motion_steps = 4
    _animate(shown, "rotation_euler", (0, 0, 0), degrees(0, 120, 60))
    assert_agrees(scene, block=8)


def test_cameras():
    scene = _stage()
    _box()
    camera = scene.camera
    camera.cycles.motion_steps = 3
    _animate(camera, "location", (-0.8, -5, 1), (0.8, -5, 1.4))
    _animate(camera, "rotation_euler", degrees(80, 0, -8), degrees(74, 0, 8))
    assert_agrees(scene, block=8)


def test_meshes_that_deform():
    scene = _stage()
    shown = add_sphere(0.6, diffuse((0.8, 0.5, 0.3)))
    shown.shape_key_add(name="Basis")
    wide = shown.shape_key_add(name="wide")
    for vertex in wide.data:
        x, y, z = vertex.co
        vertex.co = (2.5 * x, y, 0.5 * z + 0.3 * x)
    _animate(wide, "value", 0.0, 1.0)
    assert_agrees(scene, block=8)


def _waves():
    """A grid that is displaced by waves."""
    from relief import compat

    waves = np.full((64, 64, 4), 1.0)
    x = np.linspace(0, 8 * np.pi, 64, endpoint=False)
    waves[:, :, :3] = (0.5 + 0.5 * np.sin(x)[None, :] * np.sin(x)[:, None])[:, :, None]
    material = diffuse((0.8, 0.5, 0.3))
    nodes, links = material.node_tree.nodes, material.node_tree.links
    image, displacement = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeDisplacement")
    image.image = new_image(waves, "Non-Color")
    displacement.inputs["Scale"].default_value = 0.25
    links.new(image.outputs["Color"], displacement.inputs["Height"])
    output = next(n for n in nodes if n.type == "OUTPUT_MATERIAL")
    links.new(displacement.outputs["Displacement"], output.inputs["Displacement"])
    compat.set_displacement_method(material, "DISPLACEMENT")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=128, y_subdivisions=128, size=1.6)
    shown = bpy.context.object
    shown.data.materials.append(material)
    shown.rotation_euler = degrees(60, 0, 0)
    return shown


def test_displaced_meshes():
    """Cycles dices them once, at the middle of the shutter; so does what goes here keep its shape."""
    scene = _stage()
    _animate(_waves(), "location", (-0.6, 0, 0.2), (0.6, 0, 0.2))
    assert_agrees(scene, block=8, tolerance=0.01)


def test_displaced_meshes_that_deform():
    """In their plane: Cycles adds the displacement of the middle to all steps, which here is that of each."""
    scene = _stage()
    shown = _waves()
    shown.shape_key_add(name="Basis")
    wide = shown.shape_key_add(name="wide")
    for vertex in wide.data:
        x, y, z = vertex.co
        vertex.co = (1.8 * x + 0.3 * y + 0.3, 0.7 * y, z)
    _animate(wide, "value", 0.0, 1.0)
    assert_agrees(scene, block=8, tolerance=0.01)


def test_position_of_the_shutter():
    """What has yet to go when the shutter closes, and what is there when it opens."""
    scene = _stage()
    _animate(_box(), "location", (-1.2, 0, 0), (1.2, 0, 0), (10, 11))
    owner = scene.render if hasattr(scene.render, "motion_blur_position") else scene.cycles
    owner.motion_blur_position = "START"
    assert_agrees(scene, block=8)
    owner.motion_blur_position = "END"
    assert_agrees(scene, block=8)


def test_objects_without_motion_blur_stand_still():
    scene = _stage()
    shown = _box()
    _animate(shown, "location", (-1.2, 0, 0), (1.2, 0, 0))
    shown.cycles.use_motion_blur = False
    assert_agrees(scene, block=8)


def test_instances_move():
    """Children of a parent that moves, and objects that share a mesh."""
    scene = _stage()
    parent = link(None, "parent")
    first = _box((0.3, 0.3, 0.3))
    for place in ((-0.8, 0, 0), (0.8, 0, 0.3)):
        child = bpy.data.objects.new("child", first.data)
        scene.collection.objects.link(child)
        child.parent, child.location, child.scale = parent, place, (0.3, 0.3, 0.3)
    _animate(parent, "rotation_euler", (0, 0, 0), degrees(0, 60, 0))
    parent.cycles.motion_steps = 3
    for child in parent.children:
        child.cycles.motion_steps = 3
    assert_agrees(scene, block=8)


def test_the_frame_stays_what_it_was():
    scene = _stage()
    _animate(_box(), "location", (-1.2, 0, 0), (1.2, 0, 0))
    with folder() as path:
        render(scene, "RELIEF", f"{path}/picture.exr")
    assert (scene.frame_current, scene.frame_subframe) == (10, 0.0)


def test_what_is_not_understood_is_said():
    scene = _stage()
    scene.cycles.rolling_shutter_type = "TOP"
    assert_warns(scene, "a rolling shutter", "all of the picture is exposed at once")
    scene.cycles.rolling_shutter_type = "NONE"
    scene.render.motion_blur_shutter_curve.curves[0].points[0].location = (0, 0)
    assert_warns(scene, "a shutter curve", "the shutter is fully open all the time")


def test_a_lens_that_changes_is_warned_about():
    for name, values in (("lens", (30, 90)), ("sensor_width", (18, 54))):
        scene = _stage()
        scene.render.use_motion_blur = True
        scene.render.motion_blur_shutter = 1.0
        camera = scene.camera.data
        for frame, value in zip((9, 11), values):
            setattr(camera, name, value)
            camera.keyframe_insert(name, frame=frame)
        scene.frame_set(10)
        assert_warns(scene, 'camera "', "a lens that changes", "stays as it is half way")
