"""Nothing of a file is lost without a word: what relief does not read is warned about, once, and what it reads is as in Cycles."""

import bpy

from scenes import (
    IS_5_0,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    degrees,
    diffuse,
    folder,
    new_material,
    new_scene,
    render,
    set_world,
)


def _stage():
    scene = new_scene(48, 36)
    set_world((0.3, 0.3, 0.3))
    add_plane(8, diffuse((0.6, 0.5, 0.4)))
    add_sphere(0.8, diffuse(), (0, 0, 0.8))
    add_light("SUN", rotation=degrees(40, 20, 0), energy=2, angle=0.05)
    add_camera((0, -6, 3.5), degrees(62, 0, 0), lens=35)
    return scene


def _warnings(scene):
    from relief import report

    scene.relief.strict, scene.relief.use_cycles_settings = False, True
    with folder() as path:
        render(scene, "RELIEF", f"{path}/picture.exr", samples=1)
    return report.last_warnings[scene.name]


def _assert_warned_once(change, *texts):
    """Fails unless a change to the stage's scene adds one warning, which has some texts."""
    scene = _stage()
    assert not _warnings(scene), _warnings(scene)
    change(scene)
    found = _warnings(scene)
    assert len(found) == 1 and all(text in found[0] for text in texts), found


def _sphere():
    return next(o for o in bpy.data.objects if o.name.startswith("Sphere"))


def _owner(name, *owners):
    return next(owner for owner in owners if hasattr(owner, name))


def test_settings_of_things_that_change_cycles_picture_alone():
    def dice(scene):
        modifier = _sphere().modifiers.new("subdivision", "SUBSURF")
        if IS_5_0:
            modifier.use_adaptive_subdivision = True
            return
        scene.cycles.feature_set = "EXPERIMENTAL"
        _sphere().cycles.use_adaptive_subdivision = True

    def offset(_):
        name = "shadow_terminator_geometry_offset"
        setattr(_owner(name, _sphere().cycles, _sphere()), name, 0.5)

    for change, *texts in (
        (dice, "adaptive subdivision", "2"),
        (offset, "shadow terminator"),
    ):
        _assert_warned_once(change, *texts)


def test_what_is_no_volume_is_told_once_a_material():
    def fill(_):
        fog, tree, surface = new_material("fog", "ShaderNodeBsdfDiffuse")
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        tree.links.remove(output.inputs["Surface"].links[0])
        tree.links.new(surface.outputs[0], output.inputs["Volume"])
        for x in (-2, 2):
            add_sphere(0.5, fog, (x, 0, 0.5))

    _assert_warned_once(fill, 'material "fog"', "as volume", "nothing is there, as in Cycles")


def test_light_probes_are_nothing():
    scene = _stage()
    bpy.ops.object.lightprobe_add(location=(0, 0, 3))
    assert not _warnings(scene), _warnings(scene)
