"""Bent normals, and glass seen from within, are as Cycles has them."""

import bpy
import numpy as np
from scenes import (
    add_camera,
    add_image_node,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    degrees,
    diffuse,
    make_sharp,
    new_image,
    new_material,
    set_bounces,
    set_world,
)


def _scene(bounces=16):
    scene = bpy.context.scene
    set_bounces(scene, bounces)
    return scene


def _clear():
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()


def _glass(kind="ShaderNodeBsdfGlass", color=(1, 1, 1, 1)):
    inputs = {"Color": color, "Roughness": 0.0, "IOR": 1.45}
    if kind == "ShaderNodeBsdfPrincipled":
        inputs = {"Base_Color": color, "Roughness": 0.0, "IOR": 1.45, "Transmission": 1.0}
    return new_material("glass", kind, **inputs)[0]


_GLASSES = [
    ("ShaderNodeBsdfGlass", (1, 1, 1, 1)),
    ("ShaderNodeBsdfGlass", (0.9, 0.8, 0.7, 1)),
    ("ShaderNodeBsdfRefraction", (1, 1, 1, 1)),
    ("ShaderNodeBsdfPrincipled", (1, 1, 1, 1)),
]


def test_white_glass_from_within():
    """A camera in a ball: nothing is scaled on the way out, by whichever node."""
    for kind, color in _GLASSES:
        scene = _scene()
        set_world((0.5, 0.4, 0.3))
        add_sphere(2.0, _glass(kind, color), segments=64)
        add_camera((0, 0, 0), degrees(90, 0, 0), lens=35)
        assert_agrees(scene)
        _clear()


def test_a_pane_without_thickness():
    for kind, color in _GLASSES[:2]:
        scene = _scene()
        set_world((0.5, 0.4, 0.3))
        add_plane(8, _glass(kind, color), (0, 0, 1))
        add_plane(8, diffuse((0.6, 0.4, 0.2)))
        add_camera((0, -3, 5), degrees(35, 0, 0))
        assert_agrees(scene)
        _clear()


def test_a_lamp_within_glass():
    """What shines is seen through one interface."""
    scene = _scene()
    set_world((0.1, 0.1, 0.1))
    add_sphere(1.0, _glass(), segments=128)
    material, _, _ = new_material("bulb", "ShaderNodeEmission", Color=(1, 0.8, 0.6, 1), Strength=2.0)
    add_sphere(0.3, material, segments=64)
    add_camera((0, -5, 0), degrees(90, 0, 0))
    # Fireflies of a mesh lamp behind glass are no matter here.
    assert_agrees(scene)


def _waves():
    """A normal map that leans by up to 58 degrees."""
    v, u = np.mgrid[0:64, 0:64] / 64
    x, y = 0.6 * np.sin(u * 40), 0.6 * np.cos(v * 40)
    pixels = np.stack([x, y, np.sqrt(1 - x * x - y * y), np.ones_like(x)], -1)
    pixels[..., :3] = 0.5 + 0.5 * pixels[..., :3]
    return new_image(pixels)


def test_flat_faces_that_are_not_planar():
    """Cycles shades their triangles each by itself; the add-on gave both of a quadrilateral the normal of the face."""
    scene = _scene(0)
    glossy = new_material("glossy", "ShaderNodeBsdfGlossy", Roughness=0.4)[0]
    plane = add_plane(4.0, glossy, subdivisions=6)
    numbers = np.random.default_rng(1)
    for vertex in plane.data.vertices:
        vertex.co.z = 0.2 * numbers.random()
    plane.data.update()
    add_light("SUN", rotation=degrees(20, 10, 0), energy=3.0)
    add_camera((0, 0, 6))
    assert_agrees(scene)


def _mapped(kind, **inputs):
    material, tree, node = new_material("mapped", kind, **inputs)
    texture = add_image_node(tree, _waves())
    normal = tree.nodes.new("ShaderNodeNormalMap")
    tree.links.new(texture.outputs[0], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], node.inputs["Normal"])
    return material, node


def test_normal_maps_over_coordinates_without_area():
    """Faces that were never unwrapped: tangents run along x there, and round the other way than elsewhere."""
    scene = _scene(0)
    _clear()
    for i, spread in enumerate(((0, 0), (1, 0), (0, 1), (1, 1))):
        material, tree, node = new_material(f"bent {i}", "ShaderNodeBsdfDiffuse")
        bend = tree.nodes.new("ShaderNodeNormalMap")
        bend.inputs["Color"].default_value = (0.8, 0.3, 0.9, 1)
        tree.links.new(bend.outputs["Normal"], node.inputs["Normal"])
        plane = add_plane(1.8, material, (2 * (i % 2) - 1, 2 * (i // 2) - 1, 0))
        for corner in plane.data.uv_layers.active.data:
            corner.uv = (corner.uv.x * spread[0], corner.uv.y * spread[1])
    add_light("SUN", rotation=degrees(50, 0, 40), energy=3, angle=0)
    add_camera((0, 0, 9), lens=60)
    assert_agrees(scene, samples=64, block=4)


def test_normals_that_look_through_their_faces():
    """Leaves of trees are given the normals of a crown, half of which look to the other side: they are lit from there.

    By surroundings: of lamps near such a normal's horizon relief and Cycles see different ones.
    """
    scene = _scene(1)
    _clear()
    leaves = new_material("leaf", "ShaderNodeBsdfPrincipled", Roughness=0.6)[0]
    numbers = np.random.default_rng(5)
    points, normals = [], []
    for x in range(5):
        for y in range(4):
            u, v, normal = (vector / np.linalg.norm(vector) for vector in numbers.normal(size=(3, 3)))
            middle = np.array((x - 2, y - 1.5, 0))
            points += [middle + 0.4 * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            normals += [normal] * 4
    mesh = bpy.data.meshes.new("leaves")
    mesh.from_pydata([tuple(point) for point in points], [], [tuple(range(i, i + 4)) for i in range(0, len(points), 4)])
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    if bpy.app.version < (4, 1, 0):
        mesh.use_auto_smooth = True
    mesh.normals_split_custom_set([tuple(normal) for normal in normals])
    mesh.materials.append(leaves)
    bpy.context.collection.objects.link(bpy.data.objects.new("leaves", mesh))
    set_world((0.2, 0.3, 0.5))
    add_camera((0, 0, 9), lens=60)
    # .2 % of the mean is left, not understood; before, it was 9.
    assert_agrees(scene, samples=64, block=4, tolerance=0.01)


def test_mirrors_of_bent_normals_in_a_furnace():
    """Coarse and fine balls, smooth and flat: what is reflected above the true surface is not lost."""
    for segments in (24, 96):
        for smooth in (True, False):
            scene = _scene()
            set_world((1, 1, 1))
            material, node = _mapped("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1))
            make_sharp(node)
            ball = add_sphere(1.0, material, segments=segments)
            for face in ball.data.polygons:
                face.use_smooth = smooth
            add_camera((0, -4, 1), degrees(76, 0, 0))
            assert_agrees(scene)
            _clear()


def test_glass_of_bent_normals_in_a_furnace():
    """Rough glass, too, whose rays are spread within: what they see of the map is not its mean."""
    for roughness in (0.0, 0.3):
        scene = _scene()
        set_world((1, 1, 1))
        material, _ = _mapped("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=roughness, IOR=1.45)
        add_sphere(1.0, material, segments=32)
        add_camera((0, -4, 1), degrees(76, 0, 0))
        assert_agrees(scene, tolerance=0.01)
        _clear()


def test_rough_lobes_of_bent_normals_in_a_furnace():
    """What is above the true surface and below the bent normal, and what goes through: each kind of lobe has its own rule.

    The world is hidden from rays of another kind, so that neither engine asks for it and all is what lobes find themselves."""
    for kind, settings, roughness in (
        ("ShaderNodeBsdfGlossy", {"distribution": "GGX"}, 0.8),
        ("ShaderNodeBsdfGlossy", {"distribution": "BECKMANN"}, 0.8),
        ("ShaderNodeBsdfGlossy", {"distribution": "ASHIKHMIN_SHIRLEY"}, 0.6),
        ("ShaderNodeBsdfAnisotropic", {}, 0.5),
        ("ShaderNodeBsdfTranslucent", {}, None),
        ("ShaderNodeBsdfDiffuse", {}, None),
    ):
        if not hasattr(bpy.types, kind) or (settings.get("distribution") == "ASHIKHMIN_SHIRLEY" and bpy.app.version >= (5, 0)):
            continue
        scene = _scene()
        set_world((1, 1, 1))
        is_diffuse = roughness is None
        scene.world.cycles_visibility.diffuse, scene.world.cycles_visibility.glossy = is_diffuse, not is_diffuse
        material, tree, node = new_material("bent", kind, Color=(1, 1, 1, 1))
        for name, value in settings.items():
            setattr(node, name, value)
        if roughness is not None:
            node.inputs["Roughness"].default_value = roughness
        bend = tree.nodes.new("ShaderNodeNormalMap")
        bend.inputs["Color"].default_value = (0.8, 0.5, 0.9, 1)
        tree.links.new(bend.outputs["Normal"], node.inputs["Normal"])
        add_plane(4, material)
        add_camera((0, -3, 3), degrees(45, 0, 0))
        # Cycles' masking of Beckmann's microfacets is another fit where it samples them: .1 % without bends.
        assert_agrees(scene, tolerance=0.01 if "BECKMANN" in settings.values() else 0.0)
        _clear()


def test_a_coarse_smooth_mirror():
    scene = _scene()
    set_world((1, 1, 1))
    material, _, node = new_material("mirror", "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0)
    make_sharp(node)
    add_sphere(1.0, material, segments=12)
    add_plane(8, diffuse((0.5, 0.3, 0.1)), (0, 0, -1))
    add_camera((0, -4, 1), degrees(76, 0, 0))
    assert_agrees(scene)


def test_normal_maps_finer_than_pixels():
    """On metal: the mean of the normals is a mirror, and what they make of light is not."""
    scene = _scene()
    set_world((0.2, 0.2, 0.2))
    add_light("SUN", (0, 0, 3), energy=3.0, angle=0.3)
    x, y = np.random.default_rng(5).uniform(-0.5, 0.5, (2, 512, 512))
    pixels = np.stack([x, y, np.sqrt(1 - x * x - y * y), np.ones_like(x)], -1)
    pixels[..., :3] = 0.5 + 0.5 * pixels[..., :3]
    material, tree, node = new_material("metal", "ShaderNodeBsdfPrincipled", Roughness=0.3, Metallic=1.0)
    texture = add_image_node(tree, new_image(pixels))
    normal = tree.nodes.new("ShaderNodeNormalMap")
    tree.links.new(texture.outputs[0], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], node.inputs["Normal"])
    add_plane(4, material)
    add_camera((0, -3, 4), degrees(37, 0, 0), type="ORTHO", ortho_scale=4)
    assert_agrees(scene, samples=64)


def test_bumps_of_images_finer_than_pixels():
    scene = _scene()
    set_world((0.2, 0.2, 0.2))
    add_light("SUN", (0, 0, 3), energy=3.0, angle=0.3)
    heights = np.random.default_rng(6).uniform(0, 1, (512, 512))
    pixels = np.stack([heights, heights, heights, np.ones_like(heights)], -1)
    material, tree, node = new_material("metal", "ShaderNodeBsdfPrincipled", Roughness=0.3, Metallic=1.0)
    texture, bump = add_image_node(tree, new_image(pixels)), tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.05
    tree.links.new(texture.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    add_plane(4, material)
    add_camera((0, -3, 4), degrees(37, 0, 0), type="ORTHO", ortho_scale=4)
    # Slopes are taken along other axes than Cycles' where the picture is not square.
    assert_agrees(scene, samples=64, tolerance=0.02)


def _bumped(coordinate):
    """Diffuse, bumped by noise of a coordinate: an output of Texture Coordinate, or Position."""
    material, tree, node = new_material("bumped")
    kind = "ShaderNodeNewGeometry" if coordinate == "Position" else "ShaderNodeTexCoord"
    noise, bump = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBump")
    noise.inputs["Scale"].default_value = {"Object": 1.0, "Position": 1.0}.get(coordinate, 4.0)
    bump.inputs["Distance"].default_value = 1.0
    tree.links.new(tree.nodes.new(kind).outputs[coordinate], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    return material


def test_bumps_seen_from_behind():
    """By what vertices carry, which Cycles reads backwards there, and by places, which it does not."""
    for coordinate, turn, scale in (
        ("Generated", 180, 1),
        ("Generated", 0, -1),
        ("UV", 180, -1),
        ("Object", 180, 1),
        ("Position", 180, 1),
    ):
        scene = _scene(0)
        set_world((0, 0, 0))
        add_light("POINT", (1.5, -1, 1.5), energy=100, shadow_soft_size=0.1)
        plane = add_plane(5, _bumped(coordinate))
        plane.rotation_euler, plane.scale = degrees(turn, 0, 0), (scale, 1, 1)
        add_camera((0, -6, 4), degrees(56, 0, 0))
        print(coordinate, turn, scale)
        assert_agrees(scene, tolerance=0.01)
        _clear()


def test_normal_maps_seen_from_behind():
    for rotation, scale in (((180, 0, 0), (1, 1, 1)), ((180, 0, 0), (-1, 1, 1))):
        scene = _scene(0)
        set_world((0, 0, 0))
        add_light("POINT", (1.5, -1, 1.5), energy=100, shadow_soft_size=0.1)
        material, _ = _mapped("ShaderNodeBsdfDiffuse")
        plane = add_plane(5, material)
        plane.rotation_euler, plane.scale = degrees(*rotation), scale
        add_camera((0, -6, 4), degrees(56, 0, 0))
        assert_agrees(scene)
        _clear()


def _by_graph(kind, **values):
    """A node whose inputs are linked, so that they may leave their range; varying a little, as constants are no links to Cycles."""
    from relief import compat

    material, tree, node = new_material("linked", kind)
    for name, value in values.items():
        number = tree.nodes.new("ShaderNodeMath")
        number.operation = "MULTIPLY_ADD"
        tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], number.inputs[0])
        number.inputs[1].default_value, number.inputs[2].default_value = 1e-3, value
        socket = name.replace("_", " ")
        tree.links.new(number.outputs[0], compat.principled_socket(node, socket) if kind == "ShaderNodeBsdfPrincipled" else node.inputs[socket])
    return material, tree, node


def test_inputs_beyond_their_range_long():
    """Roughness that is negative by its graph, above all; each closure has its own way with it."""
    for kind, values in (
        ("ShaderNodeBsdfPrincipled", {"Roughness": -0.5}),
        ("ShaderNodeBsdfPrincipled", {"Roughness": -0.4, "Metallic": 1.0}),
        ("ShaderNodeBsdfPrincipled", {"Roughness": -0.4, "Transmission": 1.0}),
        ("ShaderNodeBsdfPrincipled", {"Roughness": 1.5, "Metallic": 1.5}),
        ("ShaderNodeBsdfPrincipled", {"Metallic": -0.5, "Specular": 2.0}),
        ("ShaderNodeBsdfGlossy", {"Roughness": -0.5}),
        ("ShaderNodeBsdfGlass", {"Roughness": -0.5}),
        ("ShaderNodeBsdfGlass", {"Roughness": 0.3, "IOR": 0.5}),
        ("ShaderNodeBsdfRefraction", {"Roughness": -0.5}),
        ("ShaderNodeBsdfDiffuse", {"Roughness": -0.5}),
    ):
        material, _, node = _by_graph(kind, **values)
        if hasattr(node, "distribution"):
            node.distribution = "GGX"
        scene = _scene(4)
        set_world((0.4, 0.5, 0.7))
        add_plane(8, diffuse((0.6, 0.4, 0.3)))
        add_sphere(1.0, material, (0, 0, 1), segments=64)
        add_light("AREA", (2, -2, 4), degrees(30, 25, 0), energy=150, size=1.5)
        add_camera((0, -5, 3), degrees(67, 0, 0), lens=45)
        print(kind, values)
        assert_agrees(scene, tolerance=0.01)
        _clear()


def test_clearcoat_under_a_lamp():
    """By itself, by all that finds a lamp together, and by what finds a world alone; up to 3.6."""
    if "Clearcoat" not in new_material("probe", "ShaderNodeBsdfPrincipled")[2].inputs:
        return
    for roughness in (0.03, 0.3, 0.7):
        scene = _scene(4)
        set_world((0.1, 0.1, 0.1))
        material, _, _ = new_material("coat", "ShaderNodeBsdfPrincipled", Base_Color=(0, 0, 0, 1), Specular=0.0, Clearcoat=1.0, Clearcoat_Roughness=roughness)
        add_plane(8, material)
        add_light("AREA", (0, 2, 3), degrees(-30, 0, 0), energy=300, size=2)
        add_camera((0, -4, 3), degrees(60, 0, 0))
        assert_agrees(scene, samples=16, tolerance=0.01)
        _clear()


def test_indirect_light_is_clamped_by_the_mean_of_its_channels():
    scene = _scene(8)
    set_world((0, 0, 0))
    scene.cycles.sample_clamp_indirect = scene.relief.clamp_indirect = 0.2
    # Of red nothing is lost, so that neither engine ends paths by chance: of what is brighter for that, clamping takes more.
    add_plane(8, diffuse((1.0, 0.2, 0.1)))
    add_light("AREA", (0, 0, 1), degrees(180, 0, 0), energy=200, size=1)
    add_plane(8, diffuse((1.0, 0.5, 0.1)), (0, 0, 3))
    add_camera((0, -3.5, 1.5), degrees(90, 0, 0))
    assert_agrees(scene, samples=64)
