"""Lights: every kind has Cycles' strength, colour and shape."""

import math

import bpy
from scenes import (
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_warns,
    degrees,
    diffuse,
    make_sharp,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _stage(scene_light):
    """A floor with a ball on it, seen obliquely: strengths, angles and shadows all show."""
    scene = new_scene()
    add_plane(material=diffuse((0.8, 0.5, 0.3)))
    add_sphere(0.6, location=(0.3, 0.2, 0.6))
    add_camera((0, -6, 5), degrees(50, 0, 0), lens=40)
    scene_light()
    return scene


def test_point_without_size():
    assert_agrees(_stage(lambda: add_light("POINT", (1, -1, 3), energy=300, color=(1, 0.8, 0.4), shadow_soft_size=0)))


def _add_light_with_nodes():
    """A point whose colour and strength nodes make of constants.

    @return  the tree and its Emission node
    """
    light = add_light("POINT", (1, -1, 3), energy=50, shadow_soft_size=0).data
    light.use_nodes = True
    tree = light.node_tree
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    product, falloff, color = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Math", "LightFalloff", "RGB"))
    product.operation = "MULTIPLY"
    product.inputs[0].default_value, product.inputs[1].default_value = 3, 2
    color.outputs[0].default_value = (1, 0.5, 0.2, 1)
    tree.links.new(product.outputs[0], falloff.inputs["Strength"])
    tree.links.new(falloff.outputs["Quadratic"], emission.inputs["Strength"])
    tree.links.new(color.outputs[0], emission.inputs["Color"])
    return tree, emission


def test_lamps_that_take_light_away():
    """Some of all kinds, one by its nodes; and glass, which photons pass."""

    def lights():
        set_world((0.5, 0.5, 0.5))
        add_light("POINT", (1, -1, 3), energy=-60, shadow_soft_size=0.2)
        add_light("AREA", (-1, -1, 3), energy=90, size=0.5)
        add_light("AREA", (-1, 1, 3), energy=-40, size=0.5, color=(1, 0.4, 0.1))
        add_light("SPOT", (0, -2, 4), degrees(20, 0, 0), energy=-50)
        add_light("SUN", (0, 0, 1), degrees(20, 0, 0), energy=-0.2, angle=0.1)
        tree, _ = _add_light_with_nodes()
        tree.nodes["Math"].inputs[1].default_value = -0.4
        glass = new_material("glass", "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0.0)[0]
        add_sphere(0.5, glass, location=(-1, -0.5, 0.6))

    assert_agrees(_stage(lights), samples=32)


def _set_multiple_importance(light, is_used):
    """Of a light that the camera may see."""
    light.data.cycles.use_multiple_importance_sampling = is_used
    light.visible_camera = True
    return light


def test_lamps_without_multiple_importance():
    """Neither mirrors nor glass show them; the camera does only where there is a lamp that rays meet."""

    def lights(*others):
        _set_multiple_importance(add_light("POINT", (-0.8, 1.5, 1), energy=100, shadow_soft_size=0.4), False)
        _set_multiple_importance(add_light("AREA", (1, 1, 4), energy=60, size=1), False)
        for other in others:
            other()
        mirror = new_material("mirror", "ShaderNodeBsdfGlossy", Roughness=0.0)[0]
        add_sphere(0.6, mirror, location=(-1.2, -0.3, 0.6))
        glass = new_material("glass", "ShaderNodeBsdfGlass", Roughness=0.0)[0]
        add_sphere(0.6, glass, location=(1.6, 0.2, 0.6))

    def sun(angle, is_met):
        return lambda: _set_multiple_importance(add_light("SUN", (0, 0, 1), degrees(-50, 0, 20), energy=1, angle=angle), is_met)

    for others in ((), (sun(0.3, False),), (sun(0.02, True),), (sun(0, True),)):
        scene = _stage(lambda others=others: lights(*others))
        scene.relief.use_cycles_settings = True
        scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
        set_bounces(scene, 2)
        assert_agrees(scene)


def test_nodes_of_constants():
    assert_agrees(_stage(_add_light_with_nodes))


def test_a_light_by_nodes_of_a_surface_is_warned_about():
    scene = _stage(lambda: None)
    tree, emission = _add_light_with_nodes()
    tree.links.new(tree.nodes.new("ShaderNodeTangent").outputs[0], emission.inputs["Strength"])
    assert_warns(scene, "Tangent", "of a light")


def test_point_with_radius():
    scene = _stage(lambda: add_light("POINT", (1, -1, 3), energy=300, shadow_soft_size=0.2))
    assert_agrees(scene, samples=32)


def test_point_whose_radius_reaches_geometry():
    """What lay inside was black: a disc on the floor, and a part of the ball."""
    scene = _stage(lambda: add_light("POINT", (1.5, -0.5, 0.4), energy=300, shadow_soft_size=1.2))
    assert_agrees(scene, samples=64)


def test_spot_whose_radius_reaches_geometry():
    def light():
        spot = {"energy": 500, "spot_size": math.radians(120), "spot_blend": 0.5, "shadow_soft_size": 1.0}
        add_light("SPOT", (1.5, -0.5, 0.7), **spot)

    assert_agrees(_stage(light), samples=64)


def test_a_large_point_lets_other_light_pass():
    """Rays that start inside see the world; they ended at the sphere that the point was."""
    scene = _stage(lambda: add_light("POINT", (0.5, -0.5, 1.0), energy=30, shadow_soft_size=2.0))
    set_world((0.6, 0.8, 1.0))
    set_bounces(scene, 2)
    assert_agrees(scene, samples=32)


def test_points_and_spots_in_a_mirror():
    """Both are seen where a smooth metal mirrors them: as a disk of their radius."""
    scene = new_scene()
    material, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.7, 0.5, 1))
    make_sharp(node)
    add_plane(material=material)
    add_light("POINT", (-0.8, 0, 2), energy=60, shadow_soft_size=0.5)
    add_light("SPOT", (0.8, 0, 2), energy=60, spot_size=math.radians(80), shadow_soft_size=0.4)
    add_camera((0, 0, 4), lens=50)
    set_bounces(scene, 1)
    assert_agrees(scene, samples=16, block=4)


def test_a_point_that_the_camera_sees():
    scene = _stage(lambda: add_light("POINT", (0.5, 1, 1.5), energy=60, shadow_soft_size=0.5))
    bpy.data.objects["light"].visible_camera = True
    assert_agrees(scene, samples=32, block=4)


def test_sun_without_size():
    assert_agrees(_stage(lambda: add_light("SUN", rotation=degrees(30, 20, 0), energy=3, color=(1, 0.5, 1), angle=0)))


def test_sun_with_angle():
    scene = _stage(lambda: add_light("SUN", rotation=degrees(40, 20, 0), energy=3, angle=math.radians(11)))
    assert_agrees(scene, samples=32)


def test_wide_suns():
    """Before 4.0 they are flat disks, whose rim is brighter: one of 120° lit what faces it 13 % too much."""
    for angle in (57, 120):
        scene = _stage(lambda: add_light("SUN", rotation=degrees(40, 20, 0), energy=3, angle=math.radians(angle)))
        assert_agrees(scene, samples=64)


def _spot(degrees_wide, blend, radius=0.0):
    def light():
        spot = {"energy": 500, "spot_size": math.radians(degrees_wide), "spot_blend": blend, "shadow_soft_size": radius}
        add_light("SPOT", (0, -1, 4), degrees(-10, 5, 0), **spot)

    return _stage(light)


def test_spot_with_hard_edge():
    assert_agrees(_spot(26, 0.0), samples=64)


def test_spot_with_soft_edge():
    assert_agrees(_spot(40, 0.5), samples=64)


def test_spot_that_is_all_edge():
    assert_agrees(_spot(90, 1.0), samples=64)


def test_spot_with_uneven_scale():
    scene = _spot(40, 0.5)
    bpy.data.objects["light"].scale = (2, 1, 1)
    # Cones follow the scale since 4.0.
    if bpy.app.version >= (4, 0, 0):
        assert_warns(scene, 'light "light"', "uneven scale of a spot")
    else:
        assert_agrees(scene, samples=64)


def test_spot_with_radius():
    assert_agrees(_spot(40, 0.5, 0.25), samples=64)


def test_square_area():
    assert_agrees(_stage(lambda: add_light("AREA", (1, 0, 3), degrees(10, 15, 30), energy=200, size=1.5)), samples=32)


def test_rectangular_area():
    def light():
        add_light("AREA", (1, 0, 3), degrees(10, 15, 30), shape="RECTANGLE", energy=200, size=2.0, size_y=0.4)

    assert_agrees(_stage(light), samples=32)


def test_disk_area():
    def light():
        add_light("AREA", (1, 0, 3), degrees(10, 15, 30), shape="DISK", energy=200, size=1.5)

    assert_agrees(_stage(light), samples=32)


def test_elliptic_area_with_scaled_object():
    def light():
        made = add_light("AREA", (1, 0, 3), degrees(10, 15, 30), shape="ELLIPSE", energy=200, size=2.0, size_y=0.4)
        made.scale = (0.7, 1.5, 2.0)

    assert_agrees(_stage(light), samples=32)


def test_temperature_and_exposure():
    """Which lights have since 4.5."""
    if "temperature" not in bpy.types.Light.bl_rna.properties:
        return

    def add():
        light = add_light("POINT", (1, -1, 3), energy=200, color=(1, 0.9, 0.8), shadow_soft_size=0.2).data
        light.use_temperature, light.temperature, light.exposure = True, 3000, 0.5

    assert_agrees(_stage(add))


def test_powers_of_a_unit_of_area():
    """What lights mean since 4.5 if they are not normalized."""
    if "normalize" not in bpy.types.Light.bl_rna.properties:
        return
    for kind, settings in (
        ("POINT", {"energy": 300, "shadow_soft_size": 0.3}),
        ("POINT", {"energy": 50, "shadow_soft_size": 0.0}),
        ("SPOT", {"energy": 300, "shadow_soft_size": 0.3, "spot_size": 1.0}),
        ("SUN", {"energy": 100, "angle": 0.2}),
        ("SUN", {"energy": 2, "angle": 0.0}),
        ("AREA", {"energy": 30, "shape": "ELLIPSE", "size": 1.5, "size_y": 0.7}),
    ):
        def add(kind=kind, settings=settings):
            light = add_light(kind, (0.3, -0.2, 3), normalize=False, **settings)
            light.scale = (1.5, 1.2, 1.0) if kind == "AREA" else (1, 1, 1)

        assert_agrees(_stage(add))


def test_sun_with_angle_far_from_the_origin():
    """A disk in its place was 3 % darker at 10 km, 38 % at 100 km."""
    for metres in (1e4, 1e5):
        scene = _stage(lambda: add_light("SUN", rotation=degrees(40, 20, 0), energy=3, angle=math.radians(4)))
        for shown in scene.objects:
            if shown.type != "LIGHT":
                shown.location = (shown.location[0] + metres, shown.location[1] + metres, shown.location[2])
        scene.camera.data.clip_end = 1e3
        assert_agrees(scene, samples=64, tolerance=0.02)


def _hidden_stage(kind, ray, **settings):
    """A plastic floor, a matt wall, a mirror and a pane before a lamp that some rays do not see."""
    scene = new_scene()
    plastic, tree, node = new_material("plastic", "ShaderNodeBsdfPrincipled", Roughness=0.3)
    add_plane(material=plastic)
    add_sphere(0.6, diffuse((0.7, 0.3, 0.2)), (-1.1, 0.4, 0.6))
    mirror, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9, 1))
    make_sharp(node)
    add_sphere(0.6, mirror, (1.1, 0.4, 0.6))
    translucent = new_material("translucent", "ShaderNodeBsdfTranslucent")[0]
    pane = add_plane(1.0, translucent, (0, -0.6, 0.5))
    pane.rotation_euler = degrees(75, 0, 0)
    lamp = add_light(kind, (0, 0.5, 3), degrees(10, 5, 0), **settings)
    setattr(lamp, f"visible_{ray}", False)
    set_world((0.05, 0.05, 0.05))
    add_camera((0, -6, 5), degrees(50, 0, 0), lens=40)
    set_bounces(scene, 1)
    return scene


def test_lamps_that_some_rays_do_not_see_long():
    """What is behind glass, or mirrored, or lit diffusely may be without a lamp that lights everything else."""
    # Of 96 samples a lamp that is not hidden from the first two fails by a chance of 1e-7 at most. Of what is transmitted there is less.
    for ray, area, sun in (("diffuse", 96, 384), ("glossy", 96, 96), ("transmission", 512, 512)):
        assert_agrees(_hidden_stage("AREA", ray, energy=100, size=1.0), samples=area)
        assert_agrees(_hidden_stage("POINT", ray, energy=100, shadow_soft_size=0.3), samples=96)
        assert_agrees(_hidden_stage("SUN", ray, energy=3, angle=0.2), samples=sun)


def test_a_lamp_behind_glass_that_transmission_rays_do_not_see():
    scene = new_scene()
    add_plane(8, diffuse())
    glass, _, node = new_material("glass", "ShaderNodeBsdfGlass", IOR=1.45)
    make_sharp(node)
    add_plane(3.0, glass, (0, 0, 1))
    add_light("AREA", (0, 0, 2.5), energy=200, size=1.0).visible_transmission = False
    set_world((0.1, 0.1, 0.1))
    add_camera((0, -4, 0.8), degrees(83, 0, 0), lens=40)
    set_bounces(scene, 4)
    assert_agrees(scene, samples=128, tolerance=0.02)


def test_area_lights_scaled_to_a_line_are_dark():
    for shape in ("SQUARE", "DISK"):
        for scale in ((0, 1, 1), (1, 0, 1), (0, 0, 1)):

            def light():
                add_light("AREA", (1, 0, 3), shape=shape, energy=200, size=1.5).scale = scale

            scene = _stage(light)
            set_world((0.2, 0.2, 0.2))
            assert_agrees(scene, samples=16)


def test_a_strength_three_percent_off_is_noticed():
    """The comparison itself: it must be able to fail."""
    import numpy as np
    from scenes import assert_same_expectation, render_runs

    scene = _stage(lambda: add_light("POINT", (1, -1, 3), energy=300, shadow_soft_size=0.5))
    cycles = render_runs(scene, "CYCLES", 5, 32)
    bpy_light = next(o for o in scene.objects if o.type == "LIGHT")
    bpy_light.data.energy *= 1.03
    relief = render_runs(scene, "RELIEF", 5, 32)
    try:
        assert_same_expectation(relief, cycles)
    except AssertionError as error:
        assert "differ" in str(error), error
        return
    raise AssertionError(f"{np.mean(relief) / np.mean(cycles)} was taken for 1")
