"""Shader trees are exported one to one: what is looked at is the scene file, not the picture."""

import json

import bpy
from scenes import (
    IS_4_0,
    IS_5_0,
    add_camera,
    add_group_socket,
    add_image_node,
    add_plane,
    asymmetric_pixels,
    folder,
    new_image,
    new_material,
)


def _material(name):
    """(material, its tree, Material Output)"""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, material.node_tree, material.node_tree.nodes.new("ShaderNodeOutputMaterial")


def _exported(material, uses=("RELIEF_surface",)):
    """JSON of a material that is exported without a warning.

    @param  uses  relief's extensions that it must have, and no others
    """
    from relief.exporter import export_frames

    if not bpy.context.scene.camera:
        add_camera()
    plane = add_plane(2, material)
    with folder() as path:
        warnings, _ = export_frames(bpy.context.scene, f"{path}/scene.gltf", [1])
        with open(f"{path}/scene.gltf", encoding="utf-8") as file:
            document = json.load(file)
    bpy.data.objects.remove(plane)
    assert not warnings, warnings
    found = next(m for m in document["materials"] if m["name"] == material.name)
    names = {n for n in found.get("extensions", {}) if n.startswith("RELIEF_")}
    assert names == set(uses), found
    return found


_GRAPHED = ("RELIEF_surface", "RELIEF_graph")


def _closures(material, uses=("RELIEF_surface",)):
    """(closures, graph nodes, the material's JSON)"""
    found = _exported(material, uses)
    extensions = found["extensions"]
    return extensions["RELIEF_surface"]["closures"], extensions.get("RELIEF_graph", {}).get("nodes"), found


def _shader(tree, kind, **inputs):
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node


def _near(found, expected):
    if isinstance(expected, (list, tuple)):
        return len(found) == len(expected) and all(map(_near, found, expected))
    return abs(found - expected) < 1e-6


def _value_node(tree, socket, kind="ShaderNodeTexNoise", output=0):
    node = tree.nodes.new(kind)
    tree.links.new(node.outputs[output], socket)
    return node


def test_a_tree_becomes_a_weighted_sum():
    """Weights of two mixes and a sum are multiplied out, and mixes of 0 and 1 leave the other side alone."""
    material, tree, output = _material("tree")
    red = _shader(tree, "ShaderNodeBsdfDiffuse", Color=(1, 0, 0, 1), Roughness=0.3)
    gloss = _shader(tree, "ShaderNodeBsdfGlossy", Color=(0, 1, 0, 1), Roughness=0.2)
    leaf = _shader(tree, "ShaderNodeBsdfTranslucent", Color=(0, 0, 1, 1))
    unseen = _shader(tree, "ShaderNodeBsdfToon")
    outer, inner, total, all_of = (
        tree.nodes.new(f"ShaderNode{kind}Shader") for kind in ("Mix", "Mix", "Add", "Mix")
    )
    for node, factor, first, second in ((outer, 0.25, red, inner), (inner, 0.6, gloss, total), (all_of, 1.7, unseen, outer)):
        node.inputs[0].default_value = factor
        tree.links.new(first.outputs[0], node.inputs[1])
        tree.links.new(second.outputs[0], node.inputs[2])
    tree.links.new(leaf.outputs[0], total.inputs[0])
    tree.links.new(red.outputs[0], total.inputs[1])
    tree.links.new(all_of.outputs[0], output.inputs["Surface"])
    closures, _, found = _closures(material)
    by_type = {c["type"]: c for c in closures}
    assert len(closures) == 3 and set(by_type) == {"diffuse", "glossy", "translucent"}, closures
    # The red one stands in the tree twice, and is one closure.
    for kind, weight in (("diffuse", 0.75 + 0.25 * 0.6), ("glossy", 0.25 * 0.4), ("translucent", 0.25 * 0.6)):
        assert _near(by_type[kind]["weight"], weight), closures
    assert _near(by_type["diffuse"]["color"], (1, 0, 0)) and _near(by_type["diffuse"]["roughness"], 0.3)
    assert found["doubleSided"]


def test_weights_that_vary_are_nodes():
    material, tree, output = _material("mixed")
    mix = tree.nodes.new("ShaderNodeMixShader")
    _value_node(tree, mix.inputs[0])
    for index, kind in ((1, "Diffuse"), (2, "Glossy")):
        tree.links.new(_shader(tree, f"ShaderNodeBsdf{kind}").outputs[0], mix.inputs[index])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    (first, second), graph, _ = _closures(material, _GRAPHED)
    clamp = graph[second["weight"]["node"]]
    assert clamp["type"] == "clamp" and graph[clamp["inputs"]["value"]["node"]]["type"] == "noise-texture", graph
    rest = graph[first["weight"]["node"]]
    assert (rest["type"], rest["operation"]) == ("math", "subtract") and rest["inputs"]["b"] == second["weight"], graph


def test_many_ways_to_one_shader_are_one_closure():
    """Thirty mixes of one thing with itself: a sum over a thousand million ways."""
    material, tree, output = _material("deep")
    shader = _shader(tree, "ShaderNodeBsdfGlossy")
    for _ in range(30):
        mix = tree.nodes.new("ShaderNodeMixShader")
        mix.inputs[0].default_value = 0.3
        for index in (1, 2):
            tree.links.new(shader.outputs[0], mix.inputs[index])
        shader = mix
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    (closure,), _, _ = _closures(material)
    assert _near(closure.get("weight", 1.0), 1.0), closure


def test_every_shader_node():
    """One closure a node, with its inputs by our names, its choices by ours, and no weight."""
    maths = {"maths": "5.2" if IS_5_0 else "4.3"} if IS_4_0 else {}

    def check(kind, expected, settings=(), **inputs):
        material, tree, output = _material(kind)
        node = tree.nodes.new(kind)
        for name, value in settings:
            setattr(node, name, value)
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        (closure,), _, _ = _closures(material)
        assert set(closure) == set(expected), (kind, closure)
        for name, value in expected.items():
            found = closure[name]
            assert found == value if isinstance(value, str) else _near(found, value), (kind, name, closure)

    color, values = (0.1, 0.2, 0.3, 1), {"color": (0.1, 0.2, 0.3)}
    check("ShaderNodeBsdfDiffuse", {"type": "diffuse", **values, "roughness": 0.4, **maths}, Color=color, Roughness=0.4)
    rough = {**values, "roughness": 0.4, **maths}
    for theirs, ours in (("GGX", "ggx"), ("BECKMANN", "beckmann"), ("MULTI_GGX", "multiscatter-ggx")):
        distribution = [("distribution", theirs)]
        expected = {"type": "glossy", **rough, "distribution": ours}
        check("ShaderNodeBsdfGlossy", expected, distribution, Color=color, Roughness=0.4)
        film = {"thinFilmThickness": 0, "thinFilmIor": 1.33} if IS_5_0 else {}
        expected = {"type": "glass", **rough, **film, "ior": 1.3, "distribution": ours}
        check("ShaderNodeBsdfGlass", expected, distribution, Color=color, Roughness=0.4, IOR=1.3)
    check(
        "ShaderNodeBsdfRefraction",
        {"type": "refraction", **rough, "ior": 1.3, "distribution": "beckmann"},
        [("distribution", "BECKMANN")],
        Color=color,
        Roughness=0.4,
        IOR=1.3,
    )
    check("ShaderNodeBsdfTranslucent", {"type": "translucent", **values, **maths}, Color=color)
    check("ShaderNodeBsdfTransparent", {"type": "transparent", **values}, Color=color)
    check("ShaderNodeHoldout", {"type": "holdout"})
    for component in ("diffuse", "glossy"):
        expected = {"type": "toon", **values, "size": 0.6, "smooth": 0.2, "component": component, **maths}
        check("ShaderNodeBsdfToon", expected, [("component", component.upper())], Color=color, Size=0.6, Smooth=0.2)
    if IS_4_0:
        expected = {"type": "sheen", **values, "roughness": 0.4, **maths}
        check("ShaderNodeBsdfSheen", expected, [("distribution", "MICROFIBER")], Color=color, Roughness=0.4)
        expected = {"type": "velvet", **values, "sigma": 0.4, **maths}
        check("ShaderNodeBsdfSheen", expected, [("distribution", "ASHIKHMIN")], Color=color, Roughness=0.4)
        metal = {"type": "metallic", "roughness": 0.4, "distribution": "ggx", **film, **maths}
        expected = {**metal, "baseColor": color[:3], "edgeTint": (1, 0.5, 1), "fresnel": "f82"}
        settings = [("distribution", "GGX"), ("fresnel_type", "F82")]
        values = {"Base_Color": color, "Edge_Tint": (1, 0.5, 1, 1), "Roughness": 0.4}
        check("ShaderNodeBsdfMetallic", expected, settings, **values)
        expected = {**metal, "ior": (1, 2, 3), "extinction": (4, 5, 6), "fresnel": "physical"}
        settings = [("distribution", "GGX"), ("fresnel_type", "PHYSICAL_CONDUCTOR")]
        check("ShaderNodeBsdfMetallic", expected, settings, IOR=(1, 2, 3), Extinction=(4, 5, 6), Roughness=0.4)
    else:
        check("ShaderNodeBsdfVelvet", {"type": "velvet", **values, "sigma": 0.4}, Color=color, Sigma=0.4)


def test_anisotropy_comes_with_a_tangent():
    """That about Z, where nothing is linked; and none of both where there is no anisotropy."""
    material, tree, output = _material("brushed")
    node = _shader(tree, "ShaderNodeBsdfAnisotropic", Anisotropy=0.7, Rotation=0.1, Roughness=0.3)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    (closure,), graph, found = _closures(material, _GRAPHED)
    assert _near(closure["anisotropy"], 0.7) and _near(closure["rotation"], 0.1), closure
    assert graph[closure["tangent"]["node"]] == {"type": "tangent", "direction": "radial-z"}, graph
    node.inputs["Anisotropy"].default_value = 0
    (closure,), _, _ = _closures(material)
    assert not {"anisotropy", "rotation", "tangent"} & set(closure), closure


def test_principled():
    """All inputs by this version's names; alpha and emission apart."""
    material, _, node = new_material("p", "ShaderNodeBsdfPrincipled", Base_Color=(0.1, 0.2, 0.3, 1), Metallic=0.25, Roughness=0.7, IOR=1.6)
    (closure,), _, found = _closures(material)
    assert (closure["type"], closure["maths"]) == ("principled", "5.2" if IS_5_0 else "4.3" if IS_4_0 else "3.4")
    assert _near(closure["baseColor"], (0.1, 0.2, 0.3)) and _near(closure["metallic"], 0.25), closure
    assert _near(closure["ior"], 1.6) and closure["distribution"] in {"ggx", "multiscatter-ggx"}, closure
    ours = "coatWeight sheenWeight specularIorLevel transmissionWeight" if IS_4_0 else "clearcoat sheen specular transmission"
    assert set(ours.split()) < set(closure), closure
    assert "emissiveFactor" not in found and "weight" not in closure
    node.inputs["Alpha"].default_value = 0.25
    node.inputs["Emission Color" if IS_4_0 else "Emission"].default_value = (1, 0.5, 0, 1)
    node.inputs["Emission Strength"].default_value = 4
    (clear, closure), _, found = _closures(material)
    assert clear["type"] == "transparent" and _near(clear["weight"], 0.75), clear
    assert _near(closure["weight"], 0.25), closure
    strength = found["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
    assert _near([strength * c for c in found["emissiveFactor"]], (1, 0.5, 0)), found


def test_inputs_that_vary_are_nodes():
    material, tree, node = new_material("p", "ShaderNodeBsdfPrincipled")
    _value_node(tree, node.inputs["Base Color"], output=1)
    texture = add_image_node(tree, new_image(asymmetric_pixels()))
    tree.links.new(texture.outputs["Color"], node.inputs["Roughness"])
    tree.links.new(texture.outputs["Alpha"], node.inputs["Alpha"])
    (clear, closure), graph, _ = _closures(material, _GRAPHED)
    assert graph[closure["baseColor"]["node"]]["type"] == "noise-texture" and closure["baseColor"]["output"] == "color"
    assert graph[closure["roughness"]["node"]]["type"] == "image-texture", graph
    alpha = graph[closure["weight"]["node"]]
    assert alpha["type"] == "clamp" and alpha["inputs"]["value"]["output"] == "alpha", graph
    assert graph[clear["weight"]["node"]]["operation"] == "subtract", graph


def test_constant_nodes_are_numbers():
    material, tree, output = _material("constant")
    node = _shader(tree, "ShaderNodeBsdfGlossy")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    mix = tree.nodes.new("ShaderNodeMixRGB")
    mix.inputs[0].default_value = 0.25
    mix.inputs[1].default_value, mix.inputs[2].default_value = (1, 0, 0, 1), (0, 1, 0, 1)
    tree.links.new(mix.outputs[0], node.inputs["Color"])
    clamp = _value_node(tree, node.inputs["Roughness"], "ShaderNodeClamp")
    clamp.inputs["Max"].default_value = 0.4
    (closure,), _, _ = _closures(material)
    assert _near(closure["color"], (0.75, 0.25, 0)) and _near(closure["roughness"], 0.4), closure


def test_bumps_are_chained():
    material, tree, output = _material("bumpy")
    node = _shader(tree, "ShaderNodeBsdfDiffuse")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    outer = _value_node(tree, node.inputs["Normal"], "ShaderNodeBump")
    flat = _value_node(tree, outer.inputs["Normal"], "ShaderNodeBump")
    inner = _value_node(tree, flat.inputs["Normal"], "ShaderNodeBump")
    _value_node(tree, outer.inputs["Height"])
    _value_node(tree, inner.inputs["Height"], "ShaderNodeTexMagic", 1)
    outer.invert, inner.inputs["Strength"].default_value, inner.inputs["Distance"].default_value = True, 0.3, 0.2
    (closure,), graph, _ = _closures(material, _GRAPHED)
    first = graph[closure["normal"]["node"]]
    assert first["type"] == "bump" and first["invert"] and closure["normal"]["output"] == "normal", graph
    assert graph[first["inputs"]["height"]["node"]]["type"] == "noise-texture", graph
    # The one in between has the same height everywhere, and so does nothing.
    second = graph[first["inputs"]["normal"]["node"]]
    assert graph[second["inputs"]["height"]["node"]]["type"] == "magic-texture" and "normal" not in second["inputs"], graph
    assert _near(second["inputs"]["strength"], 0.3) and _near(second["inputs"]["distance"], 0.2), graph
    # A bump that has a height alone is no bump, and the surface stays plain.
    tree.links.remove(node.inputs["Normal"].links[0])
    _value_node(tree, node.inputs["Normal"], "ShaderNodeBump")
    _exported(material, ())


def test_any_vector_is_a_normal():
    material, tree, output = _material("bent")
    node = _shader(tree, "ShaderNodeBsdfDiffuse")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    combine = _value_node(tree, node.inputs["Normal"], "ShaderNodeCombineXYZ")
    combine.inputs["Z"].default_value = 1
    (closure,), graph, _ = _closures(material, _GRAPHED)
    assert graph[closure["normal"]["node"]] == {"type": "combine", "inputs": {"x": 0, "y": 0, "z": 1}}, graph


def _displaced(method="BUMP"):
    from relief import compat

    material, tree, output = _material("displaced")
    tree.links.new(_shader(tree, "ShaderNodeBsdfDiffuse").outputs[0], output.inputs["Surface"])
    node = _value_node(tree, output.inputs["Displacement"], "ShaderNodeDisplacement")
    _value_node(tree, node.inputs["Height"])
    node.inputs["Scale"].default_value, node.inputs["Midlevel"].default_value = 0.3, 0.25
    compat.set_displacement_method(material, method)
    return material, tree, output, node


def test_bump_only_bends_every_normal():
    """(height − midlevel) · scale is the height of a bump below all closures and below bumps of their own."""
    material, tree, output, node = _displaced()
    (closure,), graph, found = _closures(material, _GRAPHED)
    own = found["extensions"]["RELIEF_surface"]["normal"]
    assert "normal" not in closure, closure
    bump = graph[own["node"]]
    assert bump["type"] == "bump" and (bump["inputs"]["strength"], bump["inputs"]["distance"]) == (1, 1), graph
    # In object space a height is as long as the object's scale makes it.
    height = graph[bump["inputs"]["height"]["node"]]["inputs"]
    assert graph[height["b"]["node"]]["operation"] == "dot", graph
    scaled = graph[height["a"]["node"]]
    assert scaled["operation"] == "multiply" and _near(scaled["inputs"]["b"], 0.3), graph
    shifted = graph[scaled["inputs"]["a"]["node"]]
    assert shifted["operation"] == "subtract" and _near(shifted["inputs"]["b"], 0.25), graph
    node.space = "WORLD"
    _, graph, found = _closures(material, _GRAPHED)
    own = found["extensions"]["RELIEF_surface"]["normal"]
    assert graph[graph[own["node"]]["inputs"]["height"]["node"]]["operation"] == "multiply", graph
    shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
    above = _value_node(tree, shader.inputs["Normal"], "ShaderNodeBump")
    _value_node(tree, above.inputs["Height"], "ShaderNodeTexMagic", 1)
    (second,), graph, found = _closures(material, _GRAPHED)
    assert graph[second["normal"]["node"]]["inputs"]["normal"] == found["extensions"]["RELIEF_surface"]["normal"], graph
    # A height that is the same everywhere bends nothing.
    tree.links.remove(node.inputs["Height"].links[0])
    tree.links.remove(shader.inputs["Normal"].links[0])
    _exported(material, ())


def test_a_vector_of_the_world_bends_along_the_normal():
    material, tree, output, _ = _displaced()
    node = _value_node(tree, output.inputs["Displacement"], "ShaderNodeVectorDisplacement")
    node.space = "WORLD"
    _value_node(tree, node.inputs["Vector"], output=1)
    _, graph, found = _closures(material, _GRAPHED)
    normal = found["extensions"]["RELIEF_surface"]["normal"]
    height = graph[graph[normal["node"]]["inputs"]["height"]["node"]]
    assert (height["type"], height["operation"]) == ("vector-math", "dot"), graph
    assert graph[height["inputs"]["b"]["node"]]["type"] == "geometry", graph


def test_what_the_core_means_exactly_stays_there():
    """Nothing of relief's own for what costs less without."""
    material, tree, output = _material("plain")
    diffuse = _shader(tree, "ShaderNodeBsdfDiffuse", Color=(0.5, 0.25, 0.125, 1))
    clear, mix = _shader(tree, "ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
    glow, total = _shader(tree, "ShaderNodeEmission", Strength=3), tree.nodes.new("ShaderNodeAddShader")

    def show(node):
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        return _exported(material, ())

    found = show(diffuse)
    assert _near(found["pbrMetallicRoughness"]["baseColorFactor"], (0.5, 0.25, 0.125, 1)), found
    assert found["extensions"] == {"KHR_materials_specular": {"specularFactor": 0.0}}, found
    assert _near(show(glow)["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 3)
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(diffuse.outputs[0], mix.inputs[2])
    mix.inputs[0].default_value = 0.3
    found = show(mix)
    assert found["alphaMode"] == "BLEND" and _near(found["pbrMetallicRoughness"]["baseColorFactor"][3], 0.3), found
    texture = add_image_node(tree, new_image(asymmetric_pixels()))
    tree.links.new(texture.outputs["Color"], diffuse.inputs["Color"])
    tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    assert "baseColorTexture" in show(mix)["pbrMetallicRoughness"]
    tree.links.new(diffuse.outputs[0], total.inputs[0])
    tree.links.new(glow.outputs[0], total.inputs[1])
    assert "emissiveFactor" in show(total)
    mirror = _shader(tree, "ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0)
    assert show(mirror)["pbrMetallicRoughness"]["metallicFactor"] == 1
    glass = _shader(tree, "ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0, IOR=1.3)
    assert _near(show(glass)["extensions"]["KHR_materials_ior"]["ior"], 1.3)


def test_what_the_core_means_otherwise_does_not():
    def check(kind, **inputs):
        material, tree, output = _material(kind)
        tree.links.new(_shader(tree, kind, **inputs).outputs[0], output.inputs["Surface"])
        _exported(material)

    check("ShaderNodeBsdfDiffuse", Roughness=0.1)
    check("ShaderNodeBsdfDiffuse", Color=(2, 0.5, 0.5, 1))
    check("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.1)
    check("ShaderNodeBsdfGlossy", Color=(1, 0.9, 1, 1), Roughness=0)
    check("ShaderNodeBsdfGlass", Color=(1, 0.9, 1, 1), Roughness=0)
    check("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0, IOR=0.9)
    check("ShaderNodeBsdfTransparent", Color=(1, 0.9, 1, 1))
    check("ShaderNodeBsdfPrincipled")


def test_emission_stays_in_the_core_where_no_graph_gives_it():
    material, tree, output = _material("lamps")
    total, gloss = tree.nodes.new("ShaderNodeAddShader"), _shader(tree, "ShaderNodeBsdfGlossy")
    both, mix = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    lamps = [_shader(tree, "ShaderNodeEmission", Color=(1, 0.5, 0, 1), Strength=s) for s in (2, 4)]
    tree.links.new(lamps[0].outputs[0], both.inputs[0])
    tree.links.new(lamps[1].outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], mix.inputs[2])
    tree.links.new(gloss.outputs[0], mix.inputs[1])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    (closure,), _, found = _closures(material)
    assert closure["type"] == "glossy" and _near(closure["weight"], 0.75), closure
    assert _near(found["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 0.25 * 6), found
    _value_node(tree, lamps[1].inputs["Strength"])
    (_, closure), graph, found = _closures(material, _GRAPHED)
    assert closure["type"] == "emission" and _near(closure["weight"], 0.25) and "node" in closure["strength"], closure
    assert _near(found["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 0.25 * 2), found
    texture = add_image_node(tree, new_image(asymmetric_pixels()))
    tree.links.new(texture.outputs["Color"], lamps[0].inputs["Color"])
    found = _exported(material, _GRAPHED)
    assert "emissiveTexture" in found, found
    _value_node(tree, mix.inputs[0])
    closures, _, found = _closures(material, _GRAPHED)
    assert [c["type"] for c in closures].count("emission") == 2 and "emissiveFactor" not in found, closures
    assert not total.inputs[0].is_linked


def test_a_value_in_place_of_a_shader_shines():
    material, tree, output = _material("shining")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], output.inputs["Surface"])
    (closure,), _, _ = _closures(material, _GRAPHED)
    assert closure["type"] == "emission" and closure["color"]["output"] == "color", closure
    color = tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = (0, 0.5, 0.25, 1)
    tree.links.new(color.outputs[0], output.inputs["Surface"])
    assert _near(_exported(material, ())["emissiveFactor"], (0, 1, 0.5))


def test_groups_and_muted_nodes_are_followed():
    group = bpy.data.node_groups.new("paint", "ShaderNodeTree")
    add_group_socket(group, "Paint", "INPUT", "NodeSocketColor")
    add_group_socket(group, "Normal", "INPUT", "NodeSocketVector")
    add_group_socket(group, "Shader", "OUTPUT", "NodeSocketShader")
    inside, out = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    shader = group.nodes.new("ShaderNodeBsdfGlossy")
    group.links.new(inside.outputs["Paint"], shader.inputs["Color"])
    group.links.new(inside.outputs["Normal"], shader.inputs["Normal"])
    group.links.new(shader.outputs[0], out.inputs["Shader"])
    material, tree, output = _material("grouped")
    mix = tree.nodes.new("ShaderNodeAddShader")
    for index in (0, 1):
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.inputs["Paint"].default_value = (0.1, 0.8, index, 1)
        tree.links.new(node.outputs[0], mix.inputs[index])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    closures, _, _ = _closures(material)
    # A normal that nothing is linked to is the surface's own, though the group's input has a value.
    assert [c["color"][2] for c in closures] == [0, 1] and not any("normal" in c for c in closures), closures
    mix.mute = True
    closures, _, _ = _closures(material)
    assert len(closures) == 1, closures


def test_links_that_blender_leaves_out():
    """Muted ones: the input has its own value. Circles end, whatever the version makes of them."""
    from relief.export.dry_run import try_material

    material, tree, output = _material("circle")
    node = _shader(tree, "ShaderNodeBsdfGlossy", Roughness=0.25)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    noise = _value_node(tree, node.inputs["Roughness"])
    noise_link = node.inputs["Roughness"].links[0]
    noise_link.is_muted = True
    (closure,), _, _ = _closures(material)
    assert _near(closure["roughness"], 0.25), closure
    noise_link.is_muted = False
    first = _value_node(tree, noise.inputs["Scale"], "ShaderNodeMath")
    tree.links.new(first.outputs[0], first.inputs[0])
    bumps = [tree.nodes.new("ShaderNodeBump") for _ in range(2)]
    mixes = [tree.nodes.new("ShaderNodeMixShader") for _ in range(2)]
    tree.links.new(bumps[0].outputs[0], node.inputs["Normal"])
    for nodes, socket in ((bumps, "Normal"), (mixes, 1)):
        for one, other in (nodes, reversed(nodes)):
            tree.links.new(one.outputs[0], other.inputs[socket])
    tree.links.new(node.outputs[0], mixes[0].inputs[2])
    tree.links.new(mixes[0].outputs[0], output.inputs["Surface"])
    assert try_material(material, bpy.context.scene.relief)[0].num_nodes >= 4


def test_long_chains_are_followed():
    material, tree, output = _material("long")
    node = _shader(tree, "ShaderNodeBsdfGlossy")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    before = tree.nodes.new("ShaderNodeTexNoise")
    for _ in range(700):
        after = tree.nodes.new("ShaderNodeMath")
        for index in (0, 1):
            tree.links.new(before.outputs[0], after.inputs[index])
        before = after
    tree.links.new(before.outputs[0], node.inputs["Roughness"])
    _, graph, _ = _closures(material, _GRAPHED)
    assert len(graph) == 702, len(graph)


def test_nodes_are_counted():
    """What is not understood is named with its reason, what lies behind it counts, and so does each use of a group."""
    from relief.export.dry_run import try_material
    from relief.report import last_coverage, total

    material, tree, node = new_material("half", "ShaderNodeBsdfPrincipled")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    odd = tree.nodes.new("ShaderNodeShaderToRGB")
    behind = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(behind.outputs[0], odd.inputs[0])
    tree.links.new(odd.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], node.inputs["Base Color"])
    _value_node(tree, node.inputs["Roughness"])
    tree.nodes.new("ShaderNodeTexNoise")  # is linked to nothing
    settings = bpy.context.scene.relief
    coverage, warnings = try_material(material, settings)
    assert str(coverage) == "4 of 5 nodes understood", coverage
    assert coverage.not_understood[0][0] == odd.name and "Shader to RGB" in coverage.not_understood[0][1], coverage
    assert len(warnings) == 1, warnings
    new_material("whole", "ShaderNodeBsdfDiffuse")
    add_plane(1, bpy.data.materials["whole"])
    add_plane(1, material)
    assert bpy.ops.relief.check_materials() == {"FINISHED"}
    checked = last_coverage[bpy.context.scene.name]
    assert total(checked) == "5 of 6 nodes understood, 1 of 2 materials whole", total(checked)
