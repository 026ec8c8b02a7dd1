"""Exported files: the same pictures as F12, shots whose frames change in every way, and how little is written again."""

import json
import os
import subprocess
import sys
from contextlib import contextmanager

import bpy
import numpy as np

from scenes import (
    add_camera,
    add_image_node,
    add_light,
    add_plane,
    add_sphere,
    asymmetric_pixels,
    degrees,
    diffuse,
    folder,
    link,
    new_image,
    new_material,
    new_scene,
    read_rgb,
    render,
    set_bounces,
    set_world,
)


def _shot():
    """Three frames: a camera that moves and zooms, balls that move, turn and stretch, a light that dims, a mesh that
    deforms, something that appears."""
    scene = new_scene(64, 48)
    set_bounces(scene, 2)
    set_world((0.3, 0.3, 0.4))
    scene.frame_start, scene.frame_end = 1, 3
    add_plane(8, diffuse((0.5, 0.5, 0.5)))
    camera = add_camera((0, -6, 4), degrees(57, 0, 0), lens=40)
    light = add_light("POINT", (1, -1, 3), energy=200, shadow_soft_size=0)
    moving = add_sphere(0.5, diffuse((0.9, 0.2, 0.1), "red"), (-1.5, 0, 0.6))
    turning = add_sphere(0.5, diffuse((0.1, 0.2, 0.9), "blue"), (1.5, 0, 0.6), segments=6)
    waving = add_plane(1.5, diffuse((0.2, 0.8, 0.2), "green"), (0, 0.5, 0.7), subdivisions=8)
    waving.modifiers.new("wave", "WAVE").height = 0.4
    appearing = add_sphere(0.3, diffuse((0.9, 0.9, 0.1), "yellow"), (0, -1.5, 0.3))
    for frame in (1, 3):
        camera.location.x = 0.2 * frame
        camera.data.lens = 40 + 2 * frame
        moving.location.z = 0.4 * frame
        turning.rotation_euler, turning.scale = degrees(0, 20 * frame, 70 * frame), (1, 1 + 0.2 * frame, 1)
        light.data.energy = 100 * frame
        appearing.hide_render = frame == 1
        camera.keyframe_insert("location", frame=frame)
        camera.data.keyframe_insert("lens", frame=frame)
        moving.keyframe_insert("location", frame=frame)
        turning.keyframe_insert("rotation_euler", frame=frame)
        turning.keyframe_insert("scale", frame=frame)
        light.data.keyframe_insert("energy", frame=frame)
        appearing.keyframe_insert("hide_render", frame=frame)
    return scene


def _run(*arguments):
    done = subprocess.run([os.environ["RELIEF_BINARY"], *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


def test_command_line_frames_are_those_of_f12():
    from relief.exporter import export_frames

    scene = _shot()
    scene.relief.samples = 8
    with folder() as path:
        warnings, _ = export_frames(scene, f"{path}/shot.gltf", [1, 2, 3])
        assert not warnings, warnings
        _run("render", f"{path}/shot.gltf", "--frames", "1-3", "-o", f"{path}/batch.####.exr", "--float")
        for frame in (1, 2, 3):
            scene.frame_set(frame)
            shown = render(scene, "RELIEF", f"{path}/f12.exr", samples=8)
            batch = read_rgb(f"{path}/batch.{frame:04d}.exr")
            # Rotations pass through quaternions: single rays may graze an edge on the other side.
            different = np.abs(shown - batch).max(axis=-1) > 1e-3
            assert different.mean() < 0.01, (frame, different.mean())
            assert shown.mean() > 0.05
            scene.frame_set(frame)
        frames = [read_rgb(f"{path}/batch.{f:04d}.exr") for f in (1, 2, 3)]
        assert np.abs(frames[0] - frames[1]).mean() > 0.005 < np.abs(frames[1] - frames[2]).mean()


def test_still_is_the_picture_of_f12():
    from relief.exporter import export_frames

    scene = _shot()
    scene.relief.samples = 8
    scene.frame_set(2)
    with folder() as path:
        export_frames(scene, f"{path}/still.gltf", [2])
        _run("render", f"{path}/still.gltf", "-o", f"{path}/still.exr", "--float")
        assert np.array_equal(read_rgb(f"{path}/still.exr"), render(scene, "RELIEF", f"{path}/f12.exr", samples=8))


def test_the_operator_exports_a_range():
    scene = _shot()
    with folder() as path:
        assert bpy.ops.export_scene.relief(
            filepath=f"{path}/shot.gltf", use_range=True, frame_start=1, frame_end=2
        ) == {"FINISHED"}
        assert "animations" in open(f"{path}/shot.gltf", encoding="utf-8").read()
        assert scene.render.engine != "RELIEF", "the scene's engine was changed"
        _run("info", f"{path}/shot.gltf")


def test_no_file_is_written_through_a_link_that_somebody_has_planted():
    from relief.exporter import export_frames

    scene = _shot()
    with folder() as path:
        export_frames(scene, f"{path}/first.gltf", [1])
        names = [f"shot_data/{name}" for name in os.listdir(f"{path}/first_data")] + ["shot.gltf"]
        os.mkdir(f"{path}/shot_data")
        for i, name in enumerate(names):
            with open(f"{path}/precious{i}", "w", encoding="utf-8") as file:
                file.write("mine")
            os.symlink(f"{path}/precious{i}", f"{path}/{name}.part")
        export_frames(scene, f"{path}/shot.gltf", [1])
        for i in range(len(names)):
            with open(f"{path}/precious{i}", encoding="utf-8") as file:
                assert file.read() == "mine", names[i]
        assert sorted(n for n in os.listdir(path) if n.startswith(".relief")) == []
        _run("info", f"{path}/shot.gltf")


def test_animation_renders_every_frame():
    """blender -a: three frames, each its own."""
    scene = _shot()
    scene.render.engine = "RELIEF"
    scene.relief.samples = 8
    with folder() as path:
        scene.render.filepath = f"{path}/####.exr"
        bpy.ops.render.render(animation=True)
        frames = [read_rgb(f"{path}/{f:04d}.exr") for f in (1, 2, 3)]
    assert np.abs(frames[0] - frames[1]).mean() > 0.005 < np.abs(frames[1] - frames[2]).mean()
    assert not [n for n in os.listdir(bpy.app.tempdir) if n.startswith("relief_")]


def test_a_second_frame_writes_what_changed():
    """After a frame with a large mesh, one in which only the camera moved costs a few kilobytes."""
    from relief import final

    scene = new_scene()
    set_world((1, 1, 1))
    add_plane(8, subdivisions=200)
    camera = add_camera()
    for frame in (1, 2):
        camera.location.x = 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.engine, scene.relief.samples = "RELIEF", 1
    written = []
    kept = final.export_scene

    def spy(*arguments, **words):
        exported = kept(*arguments, **words)
        written.append(exported.bytes_written)
        return exported

    final.export_scene = spy
    with folder() as path:
        scene.render.filepath = f"{path}/####.exr"
        bpy.ops.render.render(animation=True)
    final.export_scene = kept
    assert written[0] > 1e6 and written[1] < 5000, written


@contextmanager
def _evaluations():
    """Gathers the names of the things whose meshes exports evaluate."""
    from relief.export import scene as export

    names, kept = [], export._evaluated_mesh

    def spy(thing, evaluated):
        names.append(thing.name)
        return kept(thing, evaluated)

    export._evaluated_mesh = spy
    try:
        yield names
    finally:
        export._evaluated_mesh = kept


def _export_cost(scene):
    """(names of the things whose meshes were evaluated, lines of Python that were run, bytes of data) of an export.

    A loop runs a line at least each time around, even one inside an expression.
    """
    from relief.exporter import export_frames

    num_lines = 0

    def count(frame, event, _):
        nonlocal num_lines
        num_lines += event == "line"
        return count

    with folder() as path, _evaluations() as names:
        sys.settrace(count)
        try:
            export_frames(scene, f"{path}/scene.gltf", [1])
        finally:
            sys.settrace(None)
        size = sum(os.path.getsize(f"{path}/scene_data/{n}") for n in os.listdir(f"{path}/scene_data"))
    print(f"{len(names)} meshes evaluated, {num_lines} lines, {size / 1e6:.1f} MB")
    return names, num_lines, size


def test_a_million_vertices():
    """No loop over vertices is one of Python's."""
    scene = new_scene()
    add_camera()
    add_plane(8, subdivisions=1000)
    names, num_lines, _ = _export_cost(scene)
    assert names == ["Grid"] and num_lines < 100_000, (names, num_lines)


def test_a_hundred_thousand_instances():
    """Faces of a plane carry an object: one mesh, one node, 40 bytes an instance."""
    scene = new_scene()
    add_camera()
    carrier = add_plane(100, subdivisions=316)
    child = add_sphere(0.1, segments=8)
    child.parent = carrier
    carrier.instance_type = "FACES"
    names, num_lines, size = _export_cost(scene)
    assert names == ["Grid", "Sphere"] and size < 12e6, (names, size)
    # It takes 19 an instance; were each compared with all others, 100,000.
    assert num_lines < 60 * 99_856, num_lines


def _duplicate(original, x, name):
    """A linked duplicate: an object of the same data."""
    made = original.copy()
    made.location.x, made.name = x, name
    bpy.context.scene.collection.objects.link(made)
    return made


def _duplicates():
    """Objects that share data, some of which do something of their own to it; returns how many shapes they have."""
    textured, tree, node = new_material("textured")
    image = add_image_node(tree, new_image(asymmetric_pixels()))
    tree.links.new(image.outputs[0], node.inputs["Color"])
    ball = add_sphere(0.4, diffuse((0.9, 0.1, 0.1), "red"), (-2, 0, 0), segments=8)
    _duplicate(ball, -1, "plain")
    for x, name, material in ((0, "blue", diffuse((0.1, 0.1, 0.9), "blue")), (1, "textured", textured)):
        slot = _duplicate(ball, x, name).material_slots[0]
        slot.link, slot.material = "OBJECT", material
    _duplicate(ball, 2, "subdivided").modifiers.new("subdivision", "SUBSURF").render_levels = 1
    _duplicate(ball, 3, "inflated").modifiers.new("displacement", "DISPLACE").strength = 0.2

    morphed = add_sphere(0.4, location=(-2, 1, 0), segments=8)
    morphed.name = "morphed"
    for name, z in (("Basis", 0), ("lifted", 0.5), ("sunk", -0.5)):
        key = morphed.shape_key_add(name=name)
        for point in key.data:
            point.co.z += z
        key.value = 0.3
    _duplicate(morphed, -1, "morphed too")
    for x, index in ((0, 1), (1, 2)):
        pinned = _duplicate(morphed, x, f"pinned {index}")
        pinned.show_only_shape_key, pinned.active_shape_key_index = True, index

    text = bpy.data.curves.new("text", "FONT")
    text.body, text.extrude = "relief", 0.1
    text.materials.append(diffuse((0.9, 0.9, 0.1), "yellow"))
    written = link(text, "text")
    written.location = (-2, -1, 0)
    slot = _duplicate(written, -1, "red text").material_slots[0]
    slot.link, slot.material = "OBJECT", bpy.data.materials["red"]
    _duplicate(written, 0, "thick text").modifiers.new("thickness", "SOLIDIFY").thickness = 0.3
    return 4 + 4 + 2


def _nodes_of(path):
    """{name: [(attributes, material, transform) of each primitive]} of an exported scene's nodes.

    Attributes are names and bounds of positions: normals are not the same twice, as Blender sums them in any order.
    """
    with open(path, encoding="utf-8") as file:
        document = json.load(file)
    found = {}
    for node in document["nodes"]:
        for primitive in document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
            position = document["accessors"][primitive["attributes"]["POSITION"]]
            attributes = (sorted(primitive["attributes"]), position["count"], position["min"], position["max"])
            material = document["materials"][primitive["material"]]["name"]
            found.setdefault(node["name"], []).append((attributes, material, node.get("matrix")))
    return found


def test_linked_duplicates_are_evaluated_once():
    """Objects that share a mesh share its export, but for what each does to it: as if each had data of its own."""
    from relief.exporter import export_frames

    scene = new_scene()
    set_world((1, 1, 1))
    add_camera()
    num_shapes = _duplicates()
    with folder() as path:
        with _evaluations() as names:
            export_frames(scene, f"{path}/linked.gltf", [1])
        linked = _nodes_of(f"{path}/linked.gltf")
        for shown in scene.objects:
            if shown.type in {"MESH", "FONT"}:
                shown.data = shown.data.copy()
        export_frames(scene, f"{path}/single.gltf", [1])
        single = _nodes_of(f"{path}/single.gltf")
        assert linked == single, [(n, linked[n], single[n]) for n in linked if linked[n] != single[n]]
    assert len(linked) == 13 and all(len(primitives) == 1 for primitives in linked.values()), linked
    assert len(names) == num_shapes, names
    assert [linked[name][0][1] for name in ("plain", "blue", "text", "red text")] == ["red", "blue", "yellow", "red"]


def test_freestyle_draws_nothing_for_an_export():
    import parameter_editor
    from relief.exporter import export_frames

    scene = new_scene()
    scene.relief.strict = False
    scene.render.use_freestyle = True
    scene.render.use_compositing = False
    add_camera()
    add_sphere(0.4, segments=8)
    drawn = []
    note = lambda scene, layer, lineset: drawn.append(lineset)
    parameter_editor.callbacks_lineset_pre.append(note)
    try:
        with folder() as path:
            warnings, _ = export_frames(scene, f"{path}/scene.gltf", [1])
    finally:
        parameter_editor.callbacks_lineset_pre.remove(note)
    assert not drawn
    assert any("Freestyle" in w for w in warnings), warnings
    assert scene.render.use_freestyle and not scene.render.use_compositing and scene.render.use_sequencer


def test_every_linked_duplicate_has_its_warning():
    from relief.exporter import export_frames

    scene = new_scene()
    scene.relief.strict = False
    add_camera()
    ball = add_sphere(0.4, segments=8)
    ball.data.vertices[0].co.x = np.nan
    _duplicate(ball, 1, "second")
    with folder() as path:
        warnings, _ = export_frames(scene, f"{path}/scene.gltf", [1])
    for name in ("Sphere", "second"):
        assert any(name in w and "1 of 26 vertices" in w for w in warnings), warnings


def test_two_thousand_linked_duplicates():
    from relief.exporter import export_frames

    scene = new_scene()
    add_camera()
    ball = add_sphere(0.3, segments=64)
    for number in range(2000):
        _duplicate(ball, number, "ball")
    with folder() as path, _evaluations() as names:
        export_frames(scene, f"{path}/scene.gltf", [1])
    assert names == ["Sphere"], len(names)
