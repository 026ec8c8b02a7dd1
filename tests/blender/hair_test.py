"""Hair: strands of particle systems and hair curves look as in Cycles, their materials too."""

import bpy
import numpy as np

from scenes import (
    IS_5_0,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    link,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _stage(width=64, height=48):
    """A sun over a grey floor."""
    scene = new_scene(width, height)
    set_world((0.15, 0.15, 0.2))
    add_plane(8, diffuse((0.4, 0.4, 0.4)))
    add_light("SUN", rotation=degrees(40, 25, 0), energy=3, angle=0.1)
    add_camera((0, -6, 3), degrees(68, 0, 0), lens=50)
    set_bounces(scene, 4)
    return scene


def _grow(material, count=300, length=0.5, shape="THICK", **settings):
    """A grey ball with hair."""
    bpy.context.scene.cycles_curves.shape = shape
    ball = add_sphere(0.9, diffuse((0.2, 0.2, 0.2)), (0, 0, 1.1), segments=24)
    ball.data.materials.append(material)
    ball.modifiers.new("hair", "PARTICLE_SYSTEM")
    hair = ball.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length = "HAIR", count, length
    hair.material, hair.radius_scale, hair.tip_radius = 2, 0.06, 0.3
    for name, value in settings.items():
        setattr(hair, name, value)
    return ball


#: Tubes are half a per cent brighter than in Cycles of 5.2: docs/blender.md.
_TUBES = 0.012 if IS_5_0 else 0.0


def test_tubes():
    scene = _stage()
    _grow(diffuse((0.7, 0.4, 0.2)))
    assert_agrees(scene, samples=16, tolerance=_TUBES)


def test_ribbons():
    scene = _stage()
    _grow(diffuse((0.7, 0.4, 0.2)), shape="RIBBONS", count=1000, radius_scale=0.02)
    assert_agrees(scene, samples=16)


def test_strands_under_an_uneven_scale():
    """They become elliptic, and ribbons' normals go through the scale: blocks were up to 11 % dark, the mean 1.2 %."""
    for shape in ("THICK", "RIBBONS"):
        scene = _stage()
        ball = _grow(diffuse((0.7, 0.4, 0.2)), shape=shape, count=150, radius_scale=0.05)
        ball.scale, ball.rotation_euler = (1.6, 0.5, 0.9), degrees(0, 0, 25)
        assert_agrees(scene, samples=32, tolerance=_TUBES)


def test_no_width():
    """Strands without a width are not seen, and not asked for point by point; one end is width enough."""
    from relief.export import hair

    scene = _stage()
    ball = _grow(diffuse((0.7, 0.4, 0.2)), root_radius=0, tip_radius=0)
    assert_agrees(scene, samples=16)
    system = ball.particle_systems[0].settings
    for root, tip, scale, is_seen in ((0, 0, 1, False), (1, 1, 0, False), (1, 0, 1, True), (0, 1, 1, True)):
        system.root_radius, system.tip_radius, system.radius_scale = root, tip, scale
        evaluated = ball.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert bool(hair.of_particles(evaluated, True)) == is_seen, (root, tip, scale)


def test_principled_ribbons():
    """Their normals turn from edge to edge, far from the geometric one; light goes on from strand to strand."""
    scene = _stage()
    material, _, node = new_material("fur", "ShaderNodeBsdfPrincipled", **{"Base Color": (0.8, 0.8, 0.8, 1), "Roughness": 0.5})
    _grow(material, shape="RIBBONS", count=6000, radius_scale=0.02)
    assert_agrees(scene, samples=48)


def test_children_of_a_hidden_emitter():
    scene = _stage()
    ball = _grow(
        diffuse((0.3, 0.5, 0.2)),
        count=40,
        child_type="INTERPOLATED",
        rendered_child_count=8,
        kink="CURL",
        kink_amplitude=0.05,
    )
    ball.show_instancer_for_render = False
    assert_agrees(scene, samples=16)


def test_maps_at_the_root_and_curves_info():
    scene = _stage()
    material, tree, node = new_material("striped", "ShaderNodeBsdfDiffuse")
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = 6
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], checks.inputs["Vector"])
    info = tree.nodes.new("ShaderNodeHairInfo")
    mix = tree.nodes.new("ShaderNodeMixRGB")
    tree.links.new(info.outputs["Intercept"], mix.inputs["Fac"])
    tree.links.new(checks.outputs["Color"], mix.inputs["Color1"])
    tree.links.new(info.outputs["Random"], mix.inputs["Color2"])
    tree.links.new(mix.outputs["Color"], node.inputs["Color"])
    _grow(material)
    assert_agrees(scene, samples=16)


def test_tangent_normal_length_thickness():
    for name in ("Tangent Normal", "Length", "Thickness", "Is Strand"):
        scene = _stage()
        material, tree, node = new_material("shown", "ShaderNodeEmission")
        info = tree.nodes.new("ShaderNodeHairInfo")
        tree.links.new(info.outputs[name], node.inputs["Color"])
        node.inputs["Strength"].default_value = 10 if name == "Thickness" else 1
        _grow(material)
        assert_agrees(scene, samples=16)


def _hair_bsdf(component):
    material, _, node = new_material("hair", "ShaderNodeBsdfHair", Color=(0.8, 0.6, 0.4, 1), RoughnessU=0.3, RoughnessV=1.0)
    node.component = component
    return material


def test_hair_bsdf():
    scene = _stage()
    _grow(_hair_bsdf("Reflection"))
    assert_agrees(scene, samples=128)


def test_hair_bsdfs_mixed():
    """As wool is made: what one sends through the strand the other reflects there is not weighed against."""
    scene = _stage()
    material, tree, through = new_material("wool", "ShaderNodeBsdfHair", Color=(0.9, 0.85, 0.8, 1), RoughnessU=0.4)
    through.component = "Transmission"
    reflected = tree.nodes.new("ShaderNodeBsdfHair")
    reflected.inputs["Color"].default_value, reflected.inputs["RoughnessU"].default_value = (0.9, 0.85, 0.8, 1), 0.4
    mix = tree.nodes.new("ShaderNodeMixShader")
    for socket, part in zip(mix.inputs[1:], (reflected, through)):
        tree.links.new(part.outputs[0], socket)
    tree.links.new(mix.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs[0])
    _grow(material, shape="RIBBONS", count=4000, radius_scale=0.02)
    assert_agrees(scene, samples=96)


def test_principled_hair():
    for parametrization, values in (
        ("MELANIN", {"Melanin": 0.9, "Random Color": 0.5}),
        ("COLOR", {"Color": (0.8, 0.6, 0.3, 1), "Coat": 0.2}),
        ("ABSORPTION", {"Absorption Coefficient": (0.2, 0.4, 0.9), "Random Roughness": 0.3}),
    ):
        scene = _stage()
        material, _, node = new_material("hair", "ShaderNodeBsdfHairPrincipled")
        node.parametrization = parametrization
        for name, value in values.items():
            node.inputs[name].default_value = value
        _grow(material)
        assert_agrees(scene, samples=64, tolerance=_TUBES)


def _huang(**values):
    """Principled Hair by its model Huang; None where Blender has none (before 4.0)."""
    material, _, node = new_material("hair", "ShaderNodeBsdfHairPrincipled")
    if not hasattr(node, "model"):
        return None
    node.model, node.parametrization = "HUANG", "COLOR"
    for name, value in values.items():
        node.inputs[name].default_value = value
    return material


def test_principled_hair_of_facets():
    for values in (
        {"Color": (0.8, 0.6, 0.3, 1), "Aspect Ratio": 1.0, "Offset": 0.0},
        {"Color": (0.7, 0.3, 0.2, 1), "Roughness": 0.15, "Aspect Ratio": 0.6},
        {"Color": (0.5, 0.5, 0.5, 1), "Transmission": 0.3, "Secondary Reflection": 0.5, "Random Roughness": 0.4},
    ):
        scene = _stage()
        material = _huang(**values)
        if material is None:
            return
        _grow(material, shape="RIBBONS", radius_scale=0.02, count=600)
        assert_agrees(scene, samples=64)


def test_principled_hair_of_facets_near_by():
    """Strands of many pixels, of which each shows a part."""
    scene = _stage()
    material = _huang(Color=(0.8, 0.5, 0.3, 1))
    if material is None:
        return
    _grow(material, shape="RIBBONS", count=40, radius_scale=0.3)
    assert_agrees(scene, samples=64)


def _add_tuft(material):
    """Hair curves; None where Blender cannot make them (before 4.2)."""
    curves = bpy.data.hair_curves.new("tuft")
    if not hasattr(curves, "add_curves"):
        return None
    curves.add_curves([5] * 40)
    rng = np.random.default_rng(1)
    roots = np.repeat(rng.uniform(-1, 1, (40, 1, 3)) * (1, 1, 0), 5, axis=1)
    points = roots + np.linspace(0, 1.5, 5)[None, :, None] * np.array([0, 0, 1.0]) + rng.uniform(-0.2, 0.2, (40, 5, 3))
    curves.points.foreach_set("position", points.astype(np.float32).ravel())
    radius = curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(200, 0.03, dtype=np.float32))
    curves.materials.append(material)
    return link(curves, "tuft")


def test_hair_curves():
    scene = _stage()
    scene.cycles_curves.shape = "THICK"
    if _add_tuft(diffuse((0.3, 0.6, 0.2))) is not None:
        assert_agrees(scene, samples=64)


def test_hair_curves_of_elliptic_facets():
    """The larger axes lie along the curves' normals."""
    scene = _stage()
    scene.cycles_curves.shape = "RIBBONS"
    material = _huang(**{"Color": (0.8, 0.5, 0.3, 1), "Aspect Ratio": 0.4})
    if material is not None and _add_tuft(material) is not None:
        assert_agrees(scene, samples=64)


def test_arrays_of_strands():
    """Counts, radii, roots, and what has no length, by hand."""
    from relief.export import hair
    from relief.export.mesh import Wanted

    positions = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 3], [1, 0, 0], [5, 5, 5], [5, np.nan, 5]], dtype=np.float32)
    radius = np.array([3, 2, 1, 1, 1, 1], dtype=np.float32)
    strands = hair.Strands(positions, np.array([3, 1, 2]), radius)
    said = []
    wanted = Wanted(attributes=(("hair", "intercept"), ("hair", "length"), ("hair", "thickness"), ("hair", "is_strand")))
    arrays = hair.arrays_of(strands, wanted, lambda *text: said.append(text))
    assert arrays["indices"].tolist() == [0, 1, 1, 2]
    assert arrays["_RADIUS"].tolist() == [3, 2, 1]
    assert np.allclose(arrays["_HAIR_intercept"], [0, 1 / 3, 1])
    assert np.allclose(arrays["_HAIR_length"], 3) and np.allclose(arrays["_HAIR_thickness"], [6, 4, 2])
    assert "not finite" in said[0][0]
    nothing = hair.Strands(positions[:1], np.array([1]), radius[:1])
    assert hair.arrays_of(nothing, wanted, print) is None
