"""Subsurface scattering: light walks below surfaces as far, and comes out as coloured, as in Cycles."""

import bpy
from scenes import (
    IS_4_0,
    IS_5_2,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)

#: The walk whose paths go by the radius alone, by each version's name of it.
_PLAIN = "RANDOM_WALK_LEGACY" if IS_5_2 else "RANDOM_WALK" if IS_4_0 else "RANDOM_WALK_FIXED_RADIUS"
_SKIN = "RANDOM_WALK_SKIN" if IS_4_0 else "RANDOM_WALK"


#: Files of before Blender 3.0 have it where nobody chose.
_PROFILE = "BURLEY"


def _stage(make_material, bounces=0, radius=0.5):
    """A ball beside a lamp: where it is lit, how far light comes round, and the floor that it lies on all show."""
    scene = new_scene()
    add_plane(material=diffuse((0.5, 0.5, 0.5)))
    add_sphere(radius, make_material(), (0, 0, radius))
    add_light("POINT", (1.5, -1, 1.2), energy=150, shadow_soft_size=0.1)
    add_camera((0, -3.2, 1.4), degrees(74, 0, 0), lens=60)
    set_bounces(scene, bounces)
    return scene


def _scattering(method, **inputs):
    """A Subsurface Scattering node."""
    material, tree, node = new_material("wax", "ShaderNodeSubsurfaceScattering", **inputs)
    node.falloff = method
    return material, tree, node


def _skin(method, **inputs):
    """A Principled BSDF whose light goes below the surface."""
    material, _, node = new_material("skin", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.3, 1), **inputs)
    node.subsurface_method = method
    if IS_4_0:
        node.inputs["Subsurface Scale"].default_value = 1.0
    else:
        node.inputs["Subsurface Color"].default_value = (0.9, 0.3, 0.2, 1)
    return material


def test_a_ball_of_wax():
    inputs = {"Color": (0.8, 0.6, 0.3, 1), "Radius": (1.0, 0.6, 0.3), "Scale": 1.0}
    assert_agrees(_stage(lambda: _scattering(_PLAIN, **inputs)[0]), samples=32)


def test_free_paths_as_they_are():
    """5.2's own."""
    if IS_5_2:
        inputs = {"Color": (0.8, 0.6, 0.3, 1), "Radius": (0.2, 0.1, 0.05), "Scale": 1.0, "Anisotropy": -0.4}
        assert_agrees(_stage(lambda: _scattering("RANDOM_WALK", **inputs)[0]), samples=64)


def test_skin_goes_by_its_albedo():
    inputs = {"Color": (0.9, 0.5, 0.2, 1), "Radius": (0.3, 0.2, 0.1), "Scale": 0.5, "IOR": 1.5}
    assert_agrees(_stage(lambda: _scattering(_SKIN, **inputs)[0]), samples=32)


def test_forward_scattering():
    inputs = {"Color": (0.8, 0.8, 0.8, 1), "Radius": (0.2, 0.1, 0.05), "Anisotropy": 0.8, "Scale": 1.0}
    assert_agrees(_stage(lambda: _scattering(_SKIN, **inputs)[0]), samples=32)


def test_principled():
    """With its retro-reflection, and Fresnel where light leaves, up to 3.6."""
    assert_agrees(_stage(lambda: _skin(_PLAIN, Subsurface=0.6, Roughness=0.7)), samples=64)


def test_principled_skin_by_the_sky():
    scene = _stage(lambda: _skin(_SKIN, Subsurface=0.3, Specular=0.8, Roughness=0.3), bounces=3)
    set_world((0.6, 0.7, 0.9))
    assert_agrees(scene, samples=16)


def test_channels_without_radius_are_diffuse():
    inputs = {"Color": (0.7, 0.7, 0.7, 1), "Radius": (1.0, 0.0, 0.2), "Scale": 1.0}
    assert_agrees(_stage(lambda: _scattering(_PLAIN, **inputs)[0]), samples=32)


def test_thin_sheets_let_light_through():
    scene = new_scene()
    material = _scattering(_PLAIN, Color=(0.6, 0.8, 0.4, 1), Radius=(1.0, 1.0, 0.5), Scale=1.0)[0]
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0.5))
    sheet = bpy.context.object
    sheet.scale = (1.2, 0.05, 1)
    sheet.data.materials.append(material)
    add_light("AREA", (0, 2, 0.5), degrees(-90, 0, 0), energy=60, size=1.0)
    add_camera((0, -3, 0.5), degrees(90, 0, 0), lens=60)
    assert_agrees(scene, samples=64)


def test_mixed_with_gloss_and_seen_in_a_mirror():
    scene = _stage(diffuse, bounces=4)
    material, tree, wax = _scattering(_PLAIN, Color=(0.3, 0.8, 0.5, 1), Radius=(0.5, 1.0, 0.5), Scale=1.0)
    gloss = tree.nodes.new("ShaderNodeBsdfGlossy")
    gloss.inputs["Roughness"].default_value = 0.4
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs["Fac"].default_value = 0.3
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(wax.outputs[0], mix.inputs[1])
    tree.links.new(gloss.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    bpy.data.objects["Sphere"].data.materials[0] = material
    # A large lamp, and no photons: what mirrors send on of small ones is too rare, or not exact enough, for this test.
    scene.relief.caustics = "off"
    bpy.data.lights["light"].shadow_soft_size = 0.7
    mirror = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.3)[0]
    bpy.ops.mesh.primitive_plane_add(size=4, location=(0, 1.2, 1), rotation=degrees(90, 0, 0))
    bpy.context.object.data.materials.append(mirror)
    assert_agrees(scene, samples=32)


def test_neighbours_are_passed():
    """Paths leave the object that they have entered, whatever else stands in it."""
    inputs = {"Color": (0.8, 0.6, 0.3, 1), "Radius": (1.0, 0.8, 0.5), "Scale": 1.0}
    scene = _stage(lambda: _scattering(_PLAIN, **inputs)[0])
    material = bpy.data.materials["wax"]
    add_sphere(0.3, material, (0.15, 0, 0.5))
    add_sphere(0.2, diffuse((0.1, 0.1, 0.1)), (-0.2, 0, 0.6))
    assert_agrees(scene, samples=64)


def test_bumps_show_where_light_leaves():
    inputs = {"Color": (0.8, 0.6, 0.5, 1), "Radius": (0.5, 0.4, 0.3), "Scale": 1.0}
    scene = _stage(lambda: _scattering(_PLAIN, **inputs)[0])
    tree = bpy.data.materials["wax"].node_tree
    wax = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeSubsurfaceScattering")
    noise, bump = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexNoise", "Bump"))
    noise.inputs["Scale"].default_value = 3.0
    tree.links.new(noise.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], wax.inputs["Normal"])
    assert_agrees(scene, samples=64)


def test_a_ball_by_profiles():
    """Larger than far, and as far as the ball is wide."""
    for scale in (0.3, 2.0):
        inputs = {"Color": (0.8, 0.6, 0.3, 1), "Radius": (1.0, 0.6, 0.3), "Scale": scale}
        assert_agrees(_stage(lambda: _scattering(_PROFILE, **inputs)[0]), samples=64)


def test_thin_dark_limbs_by_profiles():
    """Light that walked at random would come through: red, where Cycles has dark brown."""
    scene = new_scene()
    color = (0.03, 0.006, 0.003, 1)
    material = new_material("skin", "ShaderNodeBsdfPrincipled", Base_Color=color, Subsurface=0.33, Roughness=0.9)[0]
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    node.subsurface_method = _PROFILE
    if IS_4_0:
        node.inputs["Subsurface Scale"].default_value = 1.0
    else:
        node.inputs["Subsurface Color"].default_value = (0.09, 0.0125, 0.006, 1)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.1, depth=2, location=(0, 0, 0.5))
    bpy.context.object.data.materials.append(material)
    add_light("SUN", (0, 0, 3), degrees(50, 0, 30), energy=3)
    set_world((0.5, 0.5, 0.5))
    add_camera((0, -3, 0.5), degrees(90, 0, 0), lens=120)
    assert_agrees(scene, samples=16)


def test_profiles_at_edges_and_after_diffuse_light():
    """What has scattered diffusely before meets a diffuse surface. At edges it matters along which tangents places are looked for."""
    scene = _stage(lambda: _scattering(_PROFILE, Color=(0.8, 0.6, 0.3, 1), Radius=(1.0, 1.0, 0.0), Scale=0.5)[0], bounces=3)
    bpy.data.objects["Sphere"].scale.x = -1
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0.8, 0, 0.3))
    bpy.context.object.data.materials.append(bpy.data.materials["wax"])
    assert_agrees(scene, samples=64)


def test_walks_and_profiles_know_all_parts_of_an_object():
    """One object of two materials: light that enters by one leaves by the other."""
    for method in (_PLAIN, _PROFILE):
        scene = _stage(lambda: _scattering(method, Color=(0.8, 0.6, 0.3, 1), Radius=(1.0, 1.0, 1.0), Scale=1.0)[0])
        ball = bpy.data.objects["Sphere"]
        ball.data.materials.append(diffuse((0.2, 0.3, 0.8)))
        for face in ball.data.polygons:
            face.material_index = int(face.center.x > 0.1)
        assert_agrees(scene, samples=64)
