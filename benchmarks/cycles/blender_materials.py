"""Cycles node trees for glTF materials, each as close to docs/scene_format.md as Cycles' own closures allow.

Exact (`approximate` stays empty): diffuse surfaces, mirrors (metal of roughness 0), solid smooth glass with
absorption, one-sided emission. Not exact, and named in the returned list: rough metal (Fresnel at the view's angle
instead of the half vector's; multiple scattering by Cycles' own random walk), plastic (a mix by Fresnel instead of
layered energy), rough glass (no energy compensation), clearcoat and sheen; displacement, which Cycles dices.
"""

import math

import bpy
import numpy as np

from gltf_reader import Unsupported


# What a smooth lobe's distribution is called; since Blender 4 roughness 0 says it.
_SHARP = "SHARP" if bpy.app.version < (4, 0, 0) else "GGX"


class _Tree:
    """A few words over bpy's node trees: `add` makes a node, wires or sets its inputs, and returns it."""

    def __init__(self, tree):
        self.tree = tree
        tree.nodes.clear()

    def add(self, kind, inputs=None, **attributes):
        node = self.tree.nodes.new(kind)
        for name, value in attributes.items():
            setattr(node, name, value)
        for key, value in (inputs or {}).items():
            self.connect(node.inputs[key], value)
        return node

    def connect(self, socket, value):
        """A socket is linked, a number or colour is set."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif value is not None:
            socket.default_value = (*value, 1) if np.ndim(value) == 1 and len(socket.default_value) == 4 else value

    def math(self, operation, a, b=0.0, clamp=False):
        return self.add("ShaderNodeMath", {0: a, 1: b}, operation=operation, use_clamp=clamp).outputs[0]

    def mix_color(self, factor, a, b, blend_type="MIX"):
        return self.add("ShaderNodeMixRGB", {0: factor, 1: a, 2: b}, blend_type=blend_type).outputs[0]

    def mix_shader(self, factor, a, b):
        return self.add("ShaderNodeMixShader", {0: factor, 1: a, 2: b}).outputs[0]


def _schlick_weight(tree, normal):
    """(1 − cos θ)⁵ of the angle between view and normal, as a socket."""
    geometry = tree.add("ShaderNodeNewGeometry")
    normal = normal if normal is not None else geometry.outputs["Normal"]
    cosine = tree.add(
        "ShaderNodeVectorMath", {0: geometry.outputs["Incoming"], 1: normal}, operation="DOT_PRODUCT"
    ).outputs["Value"]
    return tree.math("POWER", tree.math("SUBTRACT", 1.0, tree.math("ABSOLUTE", cosine), clamp=True), 5.0)


def _glossy(tree, color, roughness, normal):
    """A microfacet reflection; glTF and Cycles both square the roughness to the GGX α."""
    is_mirror = not isinstance(roughness, bpy.types.NodeSocket) and roughness < 1e-3
    return tree.add(
        "ShaderNodeBsdfGlossy",
        {"Color": color, "Roughness": roughness, "Normal": normal},
        distribution=_SHARP if is_mirror else "MULTI_GGX",
    ).outputs[0]


def _image(tree, gltf, reference, color_space):
    """The colour socket of a glTF texture reference (texture coordinates 0 only)."""
    if reference.get("texCoord", 0) != 0 or reference.get("extensions"):
        raise Unsupported("a texture reference with texCoord or extensions")
    path = gltf.image_path(reference["index"])
    image = bpy.data.images.load(path, check_existing=True)
    image.colorspace_settings.name = color_space
    uv = tree.add("ShaderNodeUVMap", uv_map="TEXCOORD_0").outputs["UV"]
    nearest = gltf.is_nearest(reference["index"])
    return tree.add(
        "ShaderNodeTexImage", {"Vector": uv}, image=image, interpolation="Closest" if nearest else "Linear"
    ).outputs["Color"]


def build_material(gltf, index):
    """Makes the Blender material of a glTF material.

    @param  gltf   GltfFile
    @param  index  into its materials
    @return        (bpy material, list of what is only approximate, as texts; empty: the same reflectance)
    """
    source = gltf.json["materials"][index]
    material = bpy.data.materials.new(source.get("name", f"material {index}"))
    material.use_nodes = True
    # Cycles leaves small emitters out of light sampling only when told so; nothing is left out here.
    if bpy.app.version < (3, 5, 0):
        material.cycles.sample_as_light = True
    tree = _Tree(material.node_tree)
    approximate = []
    surface, volume = _surface(tree, gltf, source, approximate)
    surface = _with_emission(tree, source, surface)
    output = tree.add("ShaderNodeOutputMaterial", {"Surface": surface})
    if volume is not None:
        tree.connect(output.inputs["Volume"], volume)
        if bpy.app.version < (5, 0, 0):
            material.cycles.homogeneous_volume = True
    if is_displaced(source):
        tree.connect(output.inputs["Displacement"], _displacement(tree, gltf, source))
        owner = material.cycles if bpy.app.version < (4, 1, 0) else material
        owner.displacement_method = "DISPLACEMENT"
        approximate.append("displacement: diced")
    return material, approximate


def is_displaced(source):
    """Whether a glTF material moves its surface."""
    return "RELIEF_displacement" in source.get("extensions", {})


def _displacement(tree, gltf, source):
    """The displacement socket: the map by path, linear between texels, along the interpolated normal."""
    settings = source["extensions"]["RELIEF_displacement"]
    unknown = set(settings) - {"heightTexture", "scale", "midlevel"}
    reference = settings["heightTexture"]
    transform = reference.get("extensions", {}).get("KHR_texture_transform", {})
    unknown |= set(transform) - {"scale", "offset"}
    if unknown or reference.get("texCoord", 0) != 0 or "index" not in reference:
        raise Unsupported(f"displacement with {', '.join(sorted(unknown)) or 'another texture reference'}")
    image = bpy.data.images.load(gltf.image_path(reference["index"]), check_existing=True)
    image.colorspace_settings.name = "Non-Color"
    scale, offset = transform.get("scale", (1, 1)), transform.get("offset", (0, 0))
    # glTF's v is 1 − v of Blender, before and after the transform.
    location = (offset[0], 1 - offset[1] - scale[1], 0)
    uv = tree.add("ShaderNodeUVMap", uv_map="TEXCOORD_0").outputs["UV"]
    mapping = tree.add("ShaderNodeMapping", {"Vector": uv}, vector_type="POINT")
    mapping.inputs["Location"].default_value = location
    mapping.inputs["Scale"].default_value = (scale[0], scale[1], 1)
    height = tree.add("ShaderNodeTexImage", {"Vector": mapping.outputs[0]}, image=image, interpolation="Linear")
    inputs = {
        "Height": height.outputs["Color"],
        "Midlevel": settings.get("midlevel", 0.5),
        "Scale": settings.get("scale", 1),
    }
    return tree.add("ShaderNodeDisplacement", inputs, space="OBJECT").outputs[0]


def _surface(tree, gltf, source, approximate):
    """The reflecting and refracting part: (surface socket or None for black, volume socket or None)."""
    pbr = source.get("pbrMetallicRoughness", {})
    extensions = source.get("extensions", {})
    if source.get("alphaMode", "OPAQUE") != "OPAQUE":
        raise Unsupported("alpha")
    color = tuple(pbr.get("baseColorFactor", (1, 1, 1, 1))[:3])
    metallic, roughness = pbr.get("metallicFactor", 1), pbr.get("roughnessFactor", 1)
    specular = extensions.get("KHR_materials_specular", {}).get("specularFactor", 1)
    ior = extensions.get("KHR_materials_ior", {}).get("ior", 1.5)
    normal = None
    if "normalTexture" in source:
        reference = source["normalTexture"]
        texture = _image(tree, gltf, {"index": reference["index"]}, "Non-Color")
        normal = tree.add(
            "ShaderNodeNormalMap",
            {"Color": texture, "Strength": reference.get("scale", 1.0)},
            uv_map="TEXCOORD_0",
        ).outputs[0]
    if "metallicRoughnessTexture" in pbr:
        texture = _image(tree, gltf, pbr["metallicRoughnessTexture"], "Non-Color")
        channels = tree.add("ShaderNodeSeparateColor", {0: texture}).outputs
        roughness = tree.math("MULTIPLY", channels["Green"], roughness)
        metallic = tree.math("MULTIPLY", channels["Blue"], metallic)
    is_varying = isinstance(metallic, bpy.types.NodeSocket)
    if "baseColorTexture" in pbr:
        texture = _image(tree, gltf, pbr["baseColorTexture"], "sRGB")
        color = texture if color == (1, 1, 1) else tree.mix_color(1.0, texture, color, "MULTIPLY")

    transmission = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
    if transmission > 0:
        return _glass(tree, extensions, transmission, color, roughness, ior, normal, approximate)

    parts = []
    if is_varying or metallic < 1:
        parts.append(_plastic(tree, color, roughness, specular, ior, normal, approximate))
    if is_varying or metallic > 0:
        if is_varying or roughness > 0:
            approximate.append("rough metal: Fresnel at the view's angle, Cycles' own multiple scattering")
        weight = _schlick_weight(tree, normal)
        tint = tree.mix_color(weight, color, (1, 1, 1))
        parts.append(_glossy(tree, tint, roughness, normal))
    surface = parts[0] if len(parts) == 1 else tree.mix_shader(metallic, parts[0], parts[1])

    sheen = extensions.get("KHR_materials_sheen")
    if sheen is not None and max(sheen.get("sheenColorFactor", (0, 0, 0))) > 0:
        approximate.append("sheen: Cycles' velvet")
        velvet = tree.add(
            "ShaderNodeBsdfVelvet",
            {"Color": sheen["sheenColorFactor"], "Sigma": max(sheen.get("sheenRoughnessFactor", 0), 0.05)},
        )
        surface = tree.add("ShaderNodeAddShader", {0: surface, 1: velvet.outputs[0]}).outputs[0]
    coat = extensions.get("KHR_materials_clearcoat")
    if coat is not None and coat.get("clearcoatFactor", 0) > 0:
        approximate.append("clearcoat: a mix by Fresnel")
        fresnel = tree.math("MULTIPLY_ADD", _schlick_weight(tree, None), 0.96)
        fresnel.node.inputs[2].default_value = 0.04
        factor = tree.math("MULTIPLY", fresnel, coat["clearcoatFactor"])
        layer = _glossy(tree, (1, 1, 1), coat.get("clearcoatRoughnessFactor", 0), None)
        surface = tree.mix_shader(factor, surface, layer)
    return surface, None


def _plastic(tree, color, roughness, specular, ior, normal, approximate):
    """Diffuse below a dielectric interface; without specular reflection just diffuse, or None for black."""
    is_black = not isinstance(color, bpy.types.NodeSocket) and max(color) == 0
    diffuse = None
    if not is_black:
        inputs = {"Color": color, "Roughness": 0.0, "Normal": normal}
        diffuse = tree.add("ShaderNodeBsdfDiffuse", inputs).outputs[0]
    if specular == 0:
        return diffuse
    approximate.append("plastic: diffuse and glossy mixed by Fresnel at the view's angle")
    f0 = specular * ((ior - 1) / (ior + 1)) ** 2
    factor = tree.math("MULTIPLY_ADD", _schlick_weight(tree, normal), specular - f0)
    factor.node.inputs[2].default_value = f0
    return tree.mix_shader(factor, diffuse, _glossy(tree, (1, 1, 1), roughness, normal))


def _glass(tree, extensions, transmission, color, roughness, ior, normal, approximate):
    """Solid glass: Fresnel's equations at a smooth interface, Beer's law inside."""
    volume = extensions.get("KHR_materials_volume", {})
    if transmission != 1 or color != (1, 1, 1) or volume.get("thicknessFactor", 0) == 0:
        raise Unsupported("glass that is thin, tinted at its surface or only partly transmissive")
    if isinstance(roughness, bpy.types.NodeSocket):
        raise Unsupported("glass with a roughness texture")
    if roughness > 0:
        approximate.append("rough glass: energy compensation differs")
    surface = tree.add(
        "ShaderNodeBsdfGlass",
        {"Color": (1, 1, 1), "Roughness": roughness, "IOR": ior, "Normal": normal},
        distribution="MULTI_GGX" if roughness > 0 else _SHARP,
    ).outputs[0]
    attenuation = np.array(volume.get("attenuationColor", (1, 1, 1)), dtype=np.float64)
    distance = volume.get("attenuationDistance", math.inf)
    sigma = -np.log(np.maximum(attenuation, 1e-6)) / distance
    if sigma.max() == 0:
        return surface, None
    # Volume Absorption's coefficient is density · (1 − colour), the colour clipped to 0…1.
    density = float(sigma.max())
    absorption = {"Color": tuple(1.0 - sigma / density), "Density": density}
    return surface, tree.add("ShaderNodeVolumeAbsorption", absorption).outputs[0]


def _with_emission(tree, source, surface):
    """Adds radiance, on front faces only unless the material is double sided."""
    if "emissiveTexture" in source:
        raise Unsupported("an emission texture")
    strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    radiance = np.array(source.get("emissiveFactor", (0, 0, 0)), dtype=np.float64) * strength
    if radiance.max() == 0:
        return surface
    largest = float(radiance.max())
    emission = tree.add("ShaderNodeEmission", {"Color": tuple(radiance / largest), "Strength": largest}).outputs[0]
    if not source.get("doubleSided", False):
        backfacing = tree.add("ShaderNodeNewGeometry").outputs["Backfacing"]
        emission = tree.mix_shader(backfacing, emission, None)
    if surface is None:
        return emission
    return tree.add("ShaderNodeAddShader", {0: surface, 1: emission}).outputs[0]
