"""What share of the materials and files that people make is understood: counted by the exporter on files made up by statistics.

    BLENDER_USER_SCRIPTS=… RELIEF_BINARY=… blender -b --factory-startup --python tests/blender/measure_coverage.py -- [FILES]

Not a test. Prints the share of materials and of files without a warning, and what is warned about most.

The rule. Counted once were 317 real files with 1,118 materials beyond a lone Principled BSDF: in which share of the files a
node occurs (_KINDS), and which share of materials and files has nothing but nodes of certain kinds (_STEPS). Files are made up
that have these shares:

- Kinds go together: a file has a richness, a normal number, and has a kind where 0.8 of it and 0.6 of another normal number
  are above the kind's quantile.
- A file has 1 to 20 materials, 3.5 on average. Each kind that a file has is in one material of it, and in each other by chance.
- Modes of a node are Blender's defaults every second time, and any otherwise.
- Nodes are linked to one another by their types, until all of them reach the output.

The 0.8, and the chance of a kind in another material, are those by which the made up files have the known shares of _STEPS as
near as may be: within 5 per cent points on average. The script prints both shares. A material is understood if its export
warns of nothing, a file if all of its materials are. Worlds are not counted.
"""

import collections
import math
import os
import random
import statistics
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import bpy  # noqa: E402
import scenes  # noqa: E402

#: Per cent of the files in which a kind of node occurs; a coordinate's outputs and a few inputs count as kinds, too.
_KINDS = {
    "ShaderNodeBsdfPrincipled": 66,
    "ShaderNodeValToRGB": 59,
    "ShaderNodeMapping": 50,
    "ShaderNodeMix": 46,
    "ShaderNodeTexImage": 45,
    "ShaderNodeTexNoise": 42,
    "ShaderNodeEmission": 38,
    "ShaderNodeTexCoord Object": 37,
    "ShaderNodeMixShader": 36,
    "ShaderNodeTexCoord UV": 29,
    "ShaderNodeMath": 28,
    "ShaderNodeBump": 26,
    "ShaderNodeBsdfGlossy": 25,
    "ShaderNodeTexVoronoi": 23,
    "ShaderNodeTexGradient": 23,
    "ShaderNodeNormalMap": 22,
    "ShaderNodeBsdfTransparent": 22,
    "ShaderNodeDisplacement": 21,
    "ShaderNodeTexMusgrave": 18,
    "ShaderNodeFresnel": 18,
    "ShaderNodeBsdfDiffuse": 17,
    "ShaderNodeVectorMath": 16,
    "ShaderNodeRGB": 16,
    "ShaderNodeValue": 16,
    "ShaderNodeTexCoord Generated": 15,
    "ShaderNodeSeparateXYZ": 14,
    "ShaderNodeAddShader": 14,
    "ShaderNodeTexWave": 14,
    "ShaderNodeNewGeometry": 13,
    "ShaderNodeHueSaturation": 12,
    "ShaderNodeCombineXYZ": 12,
    "ShaderNodeBsdfGlass": 11,
    "ShaderNodeRGBCurve": 10,
    "ShaderNodeLayerWeight": 10,
    "ShaderNodeInvert": 10,
    "ShaderNodeMapRange": 9,
    "ShaderNodeObjectInfo": 8,
    "ShaderNodeSeparateColor": 4,
    "ShaderNodeCombineColor": 4,
    "ShaderNodeBsdfTranslucent": 8,
    "ShaderNodeTexBrick": 7,
    "ShaderNodeBrightContrast": 7,
    "ShaderNodeShaderToRGB": 7,
    "ShaderNodeLightPath": 6,
    "ShaderNodeAttribute": 6,
    "ShaderNodeVolumePrincipled": 6,
    "ShaderNodeVolumeAbsorption": 5,
    "ShaderNodeTexChecker": 4,
    "ShaderNodeGamma": 4,
    "ShaderNodeTexWhiteNoise": 4,
    "ShaderNodeRGBToBW": 4,
    "ShaderNodeBsdfRefraction": 4,
    "ShaderNodeBsdfAnisotropic": 4,
    "ShaderNodeTexMagic": 4,
    "ShaderNodeAmbientOcclusion": 4,
    "ShaderNodeVectorTransform": 4,
    "ShaderNodeBlackbody": 3,
    "ShaderNodeBsdfVelvet": 3,
    "ShaderNodeSubsurfaceScattering": 3,
    "ShaderNodeTangent": 2,
    "ShaderNodeVolumeScatter": 2,
    "ShaderNodeHairInfo": 2,
    "ShaderNodeUVMap": 1,
    "ShaderNodeBsdfToon": 1,
    "ShaderNodeBevel": 1,
    "ShaderNodeFloatCurve": 0.5,
    "ShaderNodeTexSky": 0.5,
    "ShaderNodeTexEnvironment": 0.5,
}


def _named(words):
    return {f"ShaderNode{word}" for word in words.split()}


#: Which share of materials and of files is whole with all kinds up to here: as counted in real files.
_STEPS = (
    (
        _named(
            "BsdfPrincipled Mapping Mix TexImage Emission MixShader Math Bump BsdfGlossy NormalMap BsdfTransparent"
            " Displacement Fresnel BsdfDiffuse VectorMath RGB Value SeparateXYZ CombineXYZ AddShader BsdfGlass LayerWeight"
            " SeparateColor CombineColor UVMap BsdfRefraction BsdfAnisotropic VolumeAbsorption RGBToBW"
        )
        | {"ShaderNodeTexCoord UV", "ShaderNodeTexCoord Object", "ShaderNodeTexCoord Generated"},
        51,
        31,
    ),
    (_named("ValToRGB"), 58, 35),
    (_named("TexNoise TexMusgrave TexWhiteNoise"), 61, 42),
    (_named("TexVoronoi"), 66, 45),
    (_named("ObjectInfo NewGeometry LightPath Attribute"), 71, 50),
    (_named("RGBCurve FloatCurve HueSaturation MapRange Gamma Invert BrightContrast Blackbody"), 83, 58),
    (_named("TexWave TexGradient TexBrick TexChecker TexMagic"), 93, 84),
    (_named("BsdfTranslucent SubsurfaceScattering BsdfVelvet BsdfToon"), 95, 88),
)

#: How much of whether a file has a kind is the file's richness.
_RICHNESS = 0.8


def _file(rng, others):
    """Kinds of each material of a file.

    @param  others  chance that a kind of the file is in another material than its first
    """
    normal = statistics.NormalDist()
    richness = rng.gauss(0, 1)
    rest = math.sqrt(1 - _RICHNESS**2)
    kinds = [
        kind
        for kind, share in _KINDS.items()
        if _RICHNESS * richness + rest * rng.gauss(0, 1) > normal.inv_cdf(1 - share / 100)
    ]
    number = min(20, 1 + int(rng.expovariate(1 / 3.0)))
    materials = [[] for _ in range(number)]
    for kind in kinds:
        first = rng.randrange(number)
        for i, material in enumerate(materials):
            if i == first or rng.random() < others:
                material.append(kind)
    return [material for material in materials if material]


def _files(count, others):
    rng = random.Random(1)
    made = []
    while len(made) < count:
        made += [file] if (file := _file(rng, others)) else []
    return made


def _steps(files):
    """Shares of materials and files that have only the kinds up to each of _STEPS."""
    known, out = set(), []
    for kinds, _, _ in _STEPS:
        known |= kinds
        whole = [[set(material) <= known for material in file] for file in files]
        out.append((_share([w for file in whole for w in file]), _share([all(file) for file in whole])))
    return out


def _share(flags):
    return 100 * sum(flags) / len(flags)


def _others():
    """The chance by which made up materials have the known shares."""

    def miss(chance):
        return sum(abs(m - step[1]) for (m, _), step in zip(_steps(_files(600, chance)), _STEPS))

    return min((0.02 * n for n in range(1, 26)), key=miss)


class _Builder:
    """Makes a material's tree of some kinds of nodes."""

    def __init__(self, rng, name, kinds):
        self.rng = rng
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.shaders, self.values, self.vectors, self.normals = [], [], [], []
        self.volume = self.displacement = None
        self.free = []  # inputs that a value may go into
        kinds = sorted(kinds, key=self._rank)
        for kind in kinds:
            self._add(kind)
        self._finish()

    @staticmethod
    def _rank(kind):
        """Coordinates come first, then values, normals, and closures."""
        ranks = (
            ("TexCoord", "UVMap", "NewGeometry", "ObjectInfo", "LightPath", "Attribute", "HairInfo", "Tangent"),
            ("CombineXYZ", "VectorMath", "VectorTransform", "Mapping"),
            ("Tex",),
            ("NormalMap", "Bump", "Bevel", "Displacement"),
            ("Bsdf", "Emission", "Subsurface", "Volume"),
            ("ShaderToRGB", "MixShader", "AddShader"),
        )
        name = kind.removeprefix("ShaderNode")
        order = (0, 1, 2, 4, 5, 6)
        for number, prefixes in zip(order, ranks):
            if any(name.startswith(p) for p in prefixes):
                return number
        return 3

    def _set_modes(self, node):
        for p in node.bl_rna.properties:
            if p.type != "ENUM" or p.is_readonly or p.identifier in bpy.types.Node.bl_rna.properties or self.rng.random() < 0.5:
                continue
            try:
                setattr(node, p.identifier, self.rng.choice(p.enum_items.keys()))
            except TypeError:  # an engine that has not all of them
                pass

    def _take(self, values):
        return values.pop() if values else None

    def _link(self, source, socket):
        if source is not None:
            self.tree.links.new(source, socket)

    def _add(self, kind):
        kind, _, output = kind.partition(" ")
        if kind in {"ShaderNodeMixShader", "ShaderNodeAddShader"}:
            return self._add_mix(kind)
        node = self.tree.nodes.new(kind)
        if kind not in {"ShaderNodeBsdfPrincipled", "ShaderNodeSubsurfaceScattering", "ShaderNodeUVMap"}:
            self._set_modes(node)
        if kind == "ShaderNodeMix":
            node.data_type = "RGBA"
        elif kind == "ShaderNodeTexImage":
            node.projection = "FLAT"
            node.image = bpy.data.images.get("image") or bpy.data.images.new("image", 4, 4)
        elif kind == "ShaderNodeTexEnvironment":
            node.image = bpy.data.images.get("image") or bpy.data.images.new("image", 4, 4)
        elif kind == "ShaderNodeAttribute":
            node.attribute_name = "Col"
        inputs = [s for s in node.inputs if s.enabled and not s.hide_value]
        vector = node.inputs.get("Vector")
        if kind == "ShaderNodeShaderToRGB":
            self._link(self._take(self.shaders) or self.tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], node.inputs[0])
        elif vector is not None and vector.enabled:
            self._link(self._take(self.vectors), vector)
        if kind == "ShaderNodeBump":
            self._link(self._take(self.values), node.inputs["Height"])
            self._link(self._take(self.normals), node.inputs["Normal"])
        elif kind == "ShaderNodeDisplacement":
            self._link(self._take(self.values), node.inputs["Height"])
        elif kind == "ShaderNodeNormalMap":
            self._link(self._take(self.values), node.inputs["Color"])
        elif not kind.startswith("ShaderNodeTex"):
            targets = [s for s in inputs if s.type in {"VALUE", "RGBA", "VECTOR"} and s.name not in {"Normal", "Tangent"}]
            self.rng.shuffle(targets)
            for socket in targets[:2]:
                if not socket.is_linked and "Weight" not in socket.name:
                    self._link(self._take(self.values), socket)
        if "Normal" in node.inputs and "Bsdf" in kind:
            self._link(self._take(self.normals), node.inputs["Normal"])
        self._give(kind, node, output)

    def _give(self, kind, node, output):
        outputs = [s for s in node.outputs if s.enabled]
        if kind == "ShaderNodeDisplacement":
            self.displacement = outputs[0]
        elif kind.startswith("ShaderNodeVolume"):
            self.volume = outputs[0]
        elif outputs[0].type == "SHADER":
            self.shaders.append(outputs[0])
            self.free += [s for s in node.inputs if s.enabled and s.name in {"Color", "Base Color", "Roughness", "Strength"}]
        elif kind in {"ShaderNodeNormalMap", "ShaderNodeBump", "ShaderNodeBevel"}:
            self.normals.append(outputs[0])
        elif output or kind in {"ShaderNodeMapping", "ShaderNodeVectorMath", "ShaderNodeVectorTransform", "ShaderNodeUVMap"}:
            given = node.outputs.get(output or "Vector")
            given = given if given is not None and given.enabled else outputs[0]
            (self.vectors if given.type == "VECTOR" else self.values).append(given)
        elif kind == "ShaderNodeTangent":
            self.normals.append(outputs[0])
        else:
            self.values.append(self.rng.choice(outputs))

    def _add_mix(self, kind):
        node = self.tree.nodes.new(kind)
        sockets = [s for s in node.inputs if s.type == "SHADER"]
        while len(self.shaders) < 2:
            self.shaders.append(self.tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0])
        for socket in sockets:
            self._link(self.shaders.pop(0), socket)
        if kind == "ShaderNodeMixShader":
            self._link(self._take(self.values), node.inputs[0])
        self.shaders.append(node.outputs[0])

    def _finish(self):
        """Links what is left over."""
        tree = self.tree
        end = tree.nodes.new("ShaderNodeOutputMaterial")
        if not self.shaders:
            node = tree.nodes.new("ShaderNodeBsdfPrincipled")
            self.shaders.append(node.outputs[0])
            self.free += [node.inputs["Base Color"], node.inputs["Roughness"]]
        while len(self.shaders) > 1:
            self._add_mix("ShaderNodeAddShader")
        left = self.values + self.vectors
        free = [socket for socket in self.free if not socket.is_linked]
        if left and not free:
            emission = tree.nodes.new("ShaderNodeEmission")
            self.shaders.append(emission.outputs[0])
            self._add_mix("ShaderNodeAddShader")
            free = [emission.inputs["Color"]]
        while len(left) > len(free):
            mix = tree.nodes.new("ShaderNodeMix")
            mix.data_type = "RGBA"
            sockets = {socket.identifier: socket for socket in mix.inputs}
            self._link(left.pop(0), sockets["A_Color"])
            self._link(left.pop(0), sockets["B_Color"])
            left.append(next(s for s in mix.outputs if s.identifier == "Result_Color"))
        for source, socket in zip(left, free):
            self._link(source, socket)
        for normal in self.normals:
            closure = next((n for n in tree.nodes if "Normal" in n.inputs and "Bsdf" in n.bl_idname), None)
            if closure is not None and not closure.inputs["Normal"].is_linked:
                self._link(normal, closure.inputs["Normal"])
        self._link(self.shaders[0], end.inputs["Surface"])
        self._link(self.volume, end.inputs["Volume"])
        self._link(self.displacement, end.inputs["Displacement"])


def _export(rng, file):
    """Warnings by the names of a file's materials."""
    from relief.exporter import export_frames  # switching the add-on on imports it

    scene = bpy.context.scene
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.materials, *bpy.data.cameras])
    scenes.add_camera()
    plane = scenes.add_plane(2, _Builder(rng, "material 0", file[0]).material)
    colors = plane.data.color_attributes
    colors.new(name="Col", type="BYTE_COLOR", domain="CORNER")
    for number, kinds in enumerate(file[1:], 1):
        plane.data.materials.append(_Builder(rng, f"material {number}", kinds).material)
    with scenes.folder() as path:
        warnings, _ = export_frames(scene, f"{path}/scene.gltf", [1])
    found = {f"material {number}": [] for number in range(len(file))}
    for warning in warnings:
        for name in found:
            if f'"{name}"' in warning.where:
                found[name].append(warning.cause)
    return found


def main():
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    count = int(given[0]) if given else 317
    others = _others()
    files = _files(count, others)
    print(f"chance of a file's kind in another material: {others:.2f}")
    print("| kinds up to | materials: real, made up | files: real, made up |")
    for (kinds, real_materials, real_files), (made_materials, made_files) in zip(_STEPS, _steps(files)):
        name = sorted(kinds)[0]
        print(f"| {name} | {real_materials}, {made_materials:.0f} | {real_files}, {made_files:.0f} |")
    scenes.new_scene().relief.strict = False
    rng = random.Random(2)
    wholes, causes, failures = [], collections.Counter(), 0
    for file in files:
        try:
            found = _export(rng, file)
        except Exception as error:  # noqa: BLE001: counted, and shown
            print("failed:", str(error)[:300])
            failures += 1
            found = {f"material {number}": ["the export failed"] for number in range(len(file))}
        wholes.append([not causes_of for causes_of in found.values()])
        for causes_of in found.values():
            causes.update({cause.split(";")[0] for cause in causes_of})
    flat = [whole for file in wholes for whole in file]
    whole_files = _share([all(file) for file in wholes])
    print(f"understood: {_share(flat):.1f} % of {len(flat)} materials, {whole_files:.1f} % of {len(wholes)} files")
    print(f"exports that failed: {failures}")
    for cause, number in causes.most_common(40):
        print(f"{number:5} {cause}")
    sys.stdout.flush()
    os._exit(0)


main()
