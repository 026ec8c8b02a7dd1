"""Volumes are Cycles': what absorbs, scatters and shines within meshes and in the whole world, lit, seen through and from within."""

import bpy

from scenes import (
    IS_4_0,
    add_camera,
    add_light,
    add_plane,
    add_sphere,
    assert_agrees,
    assert_grids_agree,
    assert_warns,
    degrees,
    diffuse,
    folder,
    make_sharp,
    new_material,
    new_scene,
    set_bounces,
    set_world,
)


def _scene(bounces=0, volume_bounces=0, width=48, height=32):
    scene = new_scene(width, height)
    set_bounces(scene, bounces)
    scene.cycles.volume_bounces = scene.relief.volume_bounces = volume_bounces
    add_camera((0, -7, 1.6), degrees(82, 0, 0), lens=35)
    return scene


def _volume(kind, surface=None, **inputs):
    """A material of one volume shader.

    @param  surface  type of the node that is its surface; None: it has none
    """
    material, tree, node = new_material("volume", kind, **inputs)
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.remove(output.inputs["Surface"].links[0])
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    if surface is not None:
        made = tree.nodes.new(surface)
        tree.links.new(made.outputs[0], output.inputs["Surface"])
        if surface == "ShaderNodeBsdfGlass":
            make_sharp(made)
    return material


def _mix_in(material, factor, kind, **inputs):
    """Mixes another shader into a material's volume; returns (tree, Mix Shader, Material Output)."""
    tree = material.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    mix, other = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new(kind)
    mix.inputs[0].default_value = factor
    for name, value in inputs.items():
        other.inputs[name].default_value = value
    tree.links.new(output.inputs["Volume"].links[0].from_socket, mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Volume"])
    return tree, mix, output


def _add_box(size, material, location=(0, 0, 1)):
    bpy.ops.mesh.primitive_cube_add(size=1, location=location)
    box = bpy.context.object
    box.scale = size
    box.data.materials.append(material)
    return box


def test_absorption_without_a_surface():
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(40, 20, 0), energy=3.0)
    set_world((0.4, 0.5, 0.7))
    add_sphere(1.2, _volume("ShaderNodeVolumeAbsorption", Color=(0.9, 0.5, 0.2, 1), Density=1.5), (0, 0, 1.2))
    assert_agrees(scene)


def test_fog_with_a_sun():
    scene = _scene()
    add_plane(20)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (0.5, 0, 1.2))
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.05, 0.07, 0.1))
    _add_box((6, 4, 3), _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.2), (0, 0, 1.4))
    assert_agrees(scene, samples=24)


def test_lamp_in_fog():
    """The light is small and near the camera's rays, which its own distance is the best measure for."""
    scene = _scene()
    add_plane(20)
    add_light("POINT", (0.8, 0, 1.5), energy=60.0, shadow_soft_size=0.05)
    box = _volume("ShaderNodeVolumeScatter", Color=(0.9, 0.8, 0.6, 1), Density=0.3, Anisotropy=0.6)
    _add_box((6, 4, 3), box, (0, 0, 1.4))
    assert_agrees(scene, samples=128)


def test_what_scattered_light_does_not_see():
    """A wall, a lamp and the world, and where Cycles' rays and lights agree about it, a wall that shines."""
    for hidden in ("wall", "lamp", "world", *(["bright wall"] if bpy.app.version >= (4, 4, 0) else [])):
        scene = _scene()
        add_plane(20)
        bright = new_material("light", "ShaderNodeEmission", Color=(1, 0.7, 0.4, 1), Strength=3.0)[0]
        wall = add_plane(2, bright if hidden == "bright wall" else diffuse((0.7, 0.3, 0.2)), (0.5, 1.0, 1.2))
        wall.rotation_euler = degrees(80, 0, 0)
        lamp = add_light("AREA", (1, 0, 2.5), energy=40.0, size=0.8)
        set_world((0.2, 0.25, 0.3))
        _add_box((6, 4, 3), _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.3), (0, 0, 1.4))
        if hidden == "world":
            scene.world.cycles_visibility.scatter = False
        else:
            (lamp if hidden == "lamp" else wall).visible_volume_scatter = False
        assert_agrees(scene, samples=96)


def test_dense_ball_long():
    scene = _scene(8, 8)
    add_plane(20)
    add_light("AREA", (2, -2, 4), degrees(35, 25, 0), energy=200.0, size=1.5)
    set_world((0.2, 0.25, 0.3))
    ball = _volume("ShaderNodeVolumeScatter", Color=(0.95, 0.9, 0.7, 1), Density=4.0, Anisotropy=-0.3)
    add_sphere(1.2, ball, (0, 0, 1.2))
    assert_agrees(scene, samples=96)


def test_principled_absorbs_scatters_and_shines():
    scene = _scene(2, 2)
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=2.0)
    fire = _volume(
        "ShaderNodeVolumePrincipled",
        Color=(0.4, 0.5, 0.6, 1),
        Density=0.8,
        Anisotropy=0.3,
        Absorption_Color=(0.1, 0.3, 0.2, 1),
        Emission_Strength=0.2,
        Emission_Color=(1, 0.6, 0.3, 1),
        Blackbody_Intensity=0.4,
        Blackbody_Tint=(1, 0.9, 0.8, 1),
        Temperature=1500.0,
    )
    add_sphere(1.2, fire, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


def test_domains_that_overlap():
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.1))
    add_sphere(1.0, _volume("ShaderNodeVolumeScatter", Color=(1, 0.3, 0.2, 1), Density=1.0), (-0.6, 0, 1.2))
    add_sphere(1.0, _volume("ShaderNodeVolumeAbsorption", Color=(0.2, 0.4, 1, 1), Density=1.0), (0.6, 0, 1.2))
    add_sphere(0.4, diffuse((0.2, 0.8, 0.2)), (0, 0.2, 1.2))
    assert_agrees(scene, samples=24)


def test_camera_within():
    scene = _scene(1, 1)
    add_plane(20)
    add_light("POINT", (1.0, 1, 2.0), energy=120.0, shadow_soft_size=0.2)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    box = _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.08)
    _add_box((30, 30, 8), box, (0, 0, 3.9))
    assert_agrees(scene, samples=64)


def _fog(far_end):
    """A camera, a lamp and a ball in fog that has no end."""
    scene = _scene(1, 1)
    scene.camera.data.clip_end = far_end
    add_plane(20)
    add_light("POINT", (1.0, 0, 2.0), energy=150.0, shadow_soft_size=0.3)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    tree = set_world((0.3, 0.4, 0.6))
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Color"].default_value = (0.8, 0.85, 0.9, 1)
    scatter.inputs["Density"].default_value = 0.06
    tree.links.new(scatter.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    return scene


def test_world():
    assert_agrees(_fog(100), samples=64)


def test_world_beyond_the_far_end():
    """What is behind the camera's far end is not seen, but for the fog there, which hides the sky."""
    scene = _fog(7.5)
    bpy.data.lights[0].energy = 600.0
    assert_agrees(scene, samples=64)


def test_mixed_shaders():
    """One that scatters: of several, 3.4 adds the phase functions up without their weights."""
    scene = _scene()
    add_plane(20)
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.1))
    material = _volume("ShaderNodeVolumeScatter", Color=(1, 0.5, 0.2, 1), Density=1.2, Anisotropy=0.4)
    tree, mix, output = _mix_in(material, 0.3, "ShaderNodeVolumeAbsorption", Color=(0.2, 0.6, 0.9, 1))
    shine, add = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeAddShader")
    shine.inputs["Color"].default_value, shine.inputs["Strength"].default_value = (0.2, 0.4, 1, 1), 0.1
    tree.links.new(mix.outputs[0], add.inputs[0])
    tree.links.new(shine.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], output.inputs["Volume"])
    add_sphere(1.2, material, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


def test_emission_mixed_with_scattering():
    """Before 4.5 it shines as if it were not mixed."""
    scene = _scene()
    material = _volume("ShaderNodeVolumeScatter", Color=(0.8, 0.8, 0.8, 1), Density=1.0)
    _mix_in(material, 0.2, "ShaderNodeEmission", Color=(1, 0.6, 0.2, 1))
    add_sphere(1.2, material, (0, 0, 1.2))
    assert_agrees(scene, samples=64)


def test_principled_bsdf_as_volume():
    """Before 4.0 its emission shines there; since then it is nothing."""
    scene = _scene()
    add_plane(20)
    set_world((0.1, 0.1, 0.1))
    surface = _volume("ShaderNodeBsdfPrincipled", **{"Emission": (0.2, 0.6, 1, 1), "Emission Strength": 0.4})
    add_sphere(1.2, surface, (0, 0, 1.2))
    if IS_4_0:
        assert_warns(scene, 'node "Principled BSDF"', "as volume", "nothing is there")
    else:
        assert_agrees(scene, samples=32)


def test_scattering_in_glass():
    """Lit by the world, as the light of lamps does not get into glass but by caustics."""
    scene = _scene(6, 4)
    scene.relief.caustics = "off"
    add_plane(20)
    set_world((0.5, 0.6, 0.8))
    milk = _volume("ShaderNodeVolumeScatter", "ShaderNodeBsdfGlass", Color=(0.9, 0.85, 0.8, 1), Density=1.5)
    add_sphere(1.2, milk, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


class _Varying:
    """A volume of one shader whose inputs are nodes, of a material or of the world.

    @param  kind    type of the shader's node
    @param  inputs  its other inputs, with _ for blanks
    """

    def __init__(self, kind, tree=None, **inputs):
        self.material = None
        if tree is None:
            self.material = _volume(kind, **inputs)
            tree = self.material.node_tree
            self.shader = next(n for n in tree.nodes if n.bl_idname == kind)
        else:
            self.shader = tree.nodes.new(kind)
            for name, value in inputs.items():
                self.shader.inputs[name.replace("_", " ")].default_value = value
            tree.links.new(self.shader.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        self.tree = tree

    def node(self, kind, options=(), **inputs):
        """Adds a node; inputs are values or sockets, by name or, after an i, by number."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in dict(options).items():
            setattr(node, name, value)
        for name, value in inputs.items():
            self.link(node.inputs[int(name[1:]) if name[1:].isdigit() else name.replace("_", " ")], value)
        return node

    def link(self, socket, value):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def give(self, **inputs):
        """Links the shader's inputs to sockets."""
        for name, value in inputs.items():
            self.link(self.shader.inputs[name.replace("_", " ")], value)

    def math(self, operation, *values):
        inputs = {f"i{i}": value for i, value in enumerate(values)}
        return self.node("Math", {"operation": operation}, **inputs).outputs[0]

    def coordinate(self, name, axis=None):
        socket = self.node("TexCoord").outputs[name]
        return socket if axis is None else self.node("SeparateXYZ", Vector=socket).outputs[axis]

    def ramp(self, factor, low, high):
        """0 below one value of a factor and 1 above another."""
        node = self.node("ValToRGB", Fac=factor)
        node.color_ramp.elements[0].position, node.color_ramp.elements[1].position = low, high
        return node.outputs["Color"]


def _varying_scene(bounces=0, volume_bounces=0):
    """Cycles' steps are short enough for its error to be below the noise."""
    scene = _scene(bounces, volume_bounces)
    scene.cycles.volume_step_rate = 0.1
    add_plane(20)
    return scene


def test_nebula_by_noise():
    scene = _varying_scene()
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.12))
    v = _Varying("ShaderNodeVolumeScatter", Color=(0.9, 0.7, 0.5, 1), Anisotropy=0.3)
    noise = v.node("TexNoise", Vector=v.coordinate("Object"), Scale=1.6, Detail=2.0)
    v.give(Density=v.math("MULTIPLY", v.ramp(noise.outputs["Fac"], 0.45, 0.65), 4.0))
    add_sphere(1.2, v.material, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


def test_cloud_by_gradient_and_noise():
    """In a box that is turned and longer than wide, lit by a lamp and by what it scatters."""
    scene = _varying_scene(2, 2)
    add_light("AREA", (1.5, -1.5, 4), degrees(35, 25, 0), energy=150.0, size=1.0)
    set_world((0.2, 0.25, 0.3))
    v = _Varying("ShaderNodeVolumePrincipled", Color=(0.8, 0.8, 0.85, 1))
    height = v.coordinate("Generated", 2)
    noise = v.node("TexNoise", Scale=3.0, Detail=1.0).outputs["Fac"]
    density = v.math("MULTIPLY", v.math("SUBTRACT", 1.0, height), v.math("SUBTRACT", noise, 0.35))
    v.give(Density=v.math("MULTIPLY", density, 8.0))
    box = _add_box((2.4, 1.6, 1.8), v.material, (0, 0, 1.2))
    box.rotation_euler = degrees(10, 20, 30)
    assert_agrees(scene, samples=24)


def test_colors_that_vary():
    """Each channel is let through by another part of the ball."""
    scene = _varying_scene()
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.3, 0.3, 0.3))
    v = _Varying("ShaderNodeVolumePrincipled", Density=1.5)
    generated = v.coordinate("Generated")
    noise = v.node("TexVoronoi", Vector=generated, Scale=3.0)
    v.give(Color=noise.outputs["Color"], Absorption_Color=generated, Anisotropy=v.math("SUBTRACT", 1.0, v.coordinate("Generated", 0)))
    add_sphere(1.2, v.material, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


def test_fire_by_a_gradient():
    """A black body that absorbs nothing, beside smoke that is mixed with it by a mask."""
    scene = _varying_scene()
    v = _Varying("ShaderNodeVolumePrincipled", Density=0.0, Blackbody_Intensity=1.0)
    height = v.coordinate("Generated", 2)
    v.give(Temperature=v.math("MULTIPLY_ADD", v.math("SUBTRACT", 1.0, height), 1500.0, 300.0))
    smoke = v.node("VolumeAbsorption", Color=(0.2, 0.2, 0.2, 1), Density=v.math("MULTIPLY", height, 6.0))
    mask = v.ramp(v.coordinate("Generated", 0), 0.3, 0.7)
    mix = v.node("MixShader", i0=mask, i1=v.shader.outputs[0], i2=smoke.outputs[0])
    output = next(n for n in v.tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    v.tree.links.new(mix.outputs[0], output.inputs["Volume"])
    set_world((0.2, 0.2, 0.25))
    _add_box((2.4, 1.6, 2.2), v.material, (0, 0, 1.2))
    assert_agrees(scene, samples=24)


def test_two_that_vary_and_overlap_an_even_one():
    scene = _varying_scene()
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.1, 0.1, 0.1))
    for x, color in ((-0.6, (1, 0.3, 0.2, 1)), (0.6, (0.2, 0.4, 1, 1))):
        v = _Varying("ShaderNodeVolumeScatter", Color=color)
        wave = v.math("SINE", v.math("MULTIPLY", v.coordinate("Object", 0), 6.0))
        v.give(Density=v.math("MULTIPLY", v.math("ADD", wave, 1.0), 0.8))
        add_sphere(1.0, v.material, (x, 0, 1.2))
    add_sphere(0.8, _volume("ShaderNodeVolumeAbsorption", Color=(0.5, 0.5, 0.5, 1), Density=1.0), (0, -0.3, 1.2))
    assert_agrees(scene, samples=24)


def test_smoke_of_two_colors():
    """Between its voxels and those beside, which have no colour, it is as bright as within."""
    scene = _varying_scene()
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.2, 0.2, 0.25))
    material = _volume("ShaderNodeVolumePrincipled", Density=10.0)
    next(n for n in material.node_tree.nodes if n.type == "PRINCIPLED_VOLUME").inputs["Color Attribute"].default_value = "color"
    domain = _add_box((1.6, 1.6, 2.2), material, (0, 0, 1.2))
    domain.modifiers.new("fluid", "FLUID").fluid_type = "DOMAIN"
    settings = domain.modifiers["fluid"].domain_settings
    settings.domain_type, settings.resolution_max, settings.cache_type, settings.cache_frame_end = "GAS", 12, "REPLAY", 16
    for x, color in ((-0.3, (0.9, 0.5, 0.2)), (0.3, (0.3, 0.5, 0.9))):
        source = add_sphere(0.3, diffuse((0.5, 0.5, 0.5)), (x, 0, 0.7), segments=16)
        source.hide_render = True
        source.modifiers.new("fluid", "FLUID").fluid_type = "FLOW"
        flow = source.modifiers["fluid"].flow_settings
        flow.flow_behavior, flow.smoke_color = "INFLOW", color
    with folder() as path:
        settings.cache_directory = path
        for frame in range(1, 17):
            scene.frame_set(frame)
        assert_grids_agree(scene, [domain], 48)


def test_camera_within_fog_by_height():
    scene = _varying_scene(1, 1)
    add_light("POINT", (1.0, 1, 2.0), energy=120.0, shadow_soft_size=0.3)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    v = _Varying("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1))
    position = v.node("NewGeometry").outputs["Position"]
    height = v.node("SeparateXYZ", Vector=position).outputs[2]
    v.give(Density=v.math("MULTIPLY", v.math("POWER", 0.4, height), 0.3))
    _add_box((30, 30, 8), v.material, (0, 0, 3.9))
    scene.cycles.volume_step_rate = 0.1
    assert_agrees(scene, samples=128)


def test_world_that_varies_long():
    """In a room: into the distance Cycles' steps get longer and longer."""
    scene = _varying_scene(1, 1)
    _add_box((18, 18, 9), diffuse((0.5, 0.5, 0.5)), (0, 0, 4.4))
    add_light("POINT", (1.0, 0, 2.0), energy=150.0, shadow_soft_size=0.3)
    add_sphere(0.7, diffuse((0.7, 0.3, 0.2)), (-0.5, 0, 1.2))
    tree = set_world((0.0, 0.0, 0.0))
    v = _Varying("ShaderNodeVolumeScatter", tree, Color=(0.8, 0.85, 0.9, 1))
    noise = v.node("TexNoise", Vector=v.coordinate("Object"), Scale=0.8, Detail=1.0).outputs["Fac"]
    height = v.math("MULTIPLY", v.coordinate("Object", 2), -0.5)
    v.give(Density=v.math("MULTIPLY", v.math("MULTIPLY", v.math("EXPONENT", height), noise), 0.3))
    scene.world.cycles.volume_step_size = 5.0
    assert_agrees(scene, runs=4, samples=24)


def test_density_without_a_bound_is_warned_about():
    """It grows without end towards a point; the picture is finite, and as far as it tells Cycles'."""
    scene = _varying_scene()
    add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
    set_world((0.5, 0.6, 0.8))
    v = _Varying("ShaderNodeVolumeAbsorption", Color=(0.5, 0.6, 0.7, 1))
    distance = v.node("VectorMath", {"operation": "LENGTH"}, i0=v.coordinate("Object")).outputs["Value"]
    v.give(Density=v.math("DIVIDE", 1.0, distance))
    add_sphere(1.2, v.material, (0, 0, 1.2))
    assert_warns(scene, "no bounds on its density")
    assert_agrees(scene, samples=16)


#: What tells of each phase function, where it says more than the defaults.
_PHASES = (
    ("RAYLEIGH", {}),
    ("DRAINE", {"Anisotropy": 0.6, "Alpha": 0.9}),
    ("DRAINE", {"Anisotropy": -0.4, "Alpha": 0.3}),
    ("FOURNIER_FORAND", {"IOR": 1.2, "Backscatter": 0.15}),
    ("MIE", {"Diameter": 0.05}),
    ("MIE", {"Diameter": 0.8}),
    ("MIE", {"Diameter": 3.0}),
    ("MIE", {"Diameter": 12.0}),
)


def _fog_by(material, phase, inputs):
    node = next(n for n in material.node_tree.nodes if hasattr(n, "phase"))
    node.phase = phase
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return material


def test_phase_functions():
    """Of suns that shine from behind, the side and ahead, so that directions all count. Suns without a size: where rays can meet
    lights, Cycles weighs them by another density than it asks for lights with, as soon as two functions mix."""
    if bpy.app.version < (4, 3, 0):
        return
    for phase, inputs in _PHASES:
        scene = _scene(volume_bounces=2)
        for angles, energy in (((-75, 0, 0), 1.0), ((75, 20, 0), 3.0), ((10, 80, 0), 2.0)):
            add_light("SUN", rotation=degrees(*angles), energy=energy, angle=0.0)
        set_world((0.1, 0.12, 0.15))
        fog = _fog_by(_volume("ShaderNodeVolumeScatter", Color=(0.8, 0.9, 1, 1), Density=0.6), phase, inputs)
        _add_box((3, 3, 3), fog, (0, 0, 1.4))
        assert_agrees(scene, samples=64)


def test_coefficients():
    """Numbers, and a gradient along the height."""
    if bpy.app.version < (5, 0, 0):
        return
    for linked in (False, True):
        scene = _scene(volume_bounces=1)
        add_plane(20)
        add_light("SUN", rotation=degrees(50, 30, 0), energy=4.0)
        set_world((0.1, 0.12, 0.15))
        fog = _fog_by(_volume("ShaderNodeVolumeCoefficients"), "DRAINE", {"Anisotropy": 0.5})
        tree = fog.node_tree
        node = next(n for n in tree.nodes if hasattr(n, "phase"))
        node.inputs["Absorption Coefficients"].default_value = (0.001, 0.1, 0.4)
        node.inputs["Scatter Coefficients"].default_value = (0.2, 0.5, 0.1)
        node.inputs["Emission Coefficients"].default_value = (0.02, 0.0, 0.05)
        if linked:
            generated = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
            for name in ("Absorption Coefficients", "Scatter Coefficients", "Emission Coefficients"):
                scaled = tree.nodes.new("ShaderNodeVectorMath")
                scaled.operation = "MULTIPLY"
                tree.links.new(generated, scaled.inputs[0])
                scaled.inputs[1].default_value = tuple(node.inputs[name].default_value)
                tree.links.new(scaled.outputs[0], node.inputs[name])
        _add_box((3, 3, 3), fog, (0, 0, 1.4))
        assert_agrees(scene, samples=64)
