"""Value nodes give the numbers that Cycles gives, point by point, and pictures by them are Cycles' pictures.

Node by node: a sheet of small faces, each as large as a pixel and with coordinates that are the same all over it; what
interpolation leaves of them is cut off by a node, so that both engines evaluate at the very same points. The output is
emitted, be it negative; each row of faces has a material, and so a mode of the node, of its own.
"""

import os

import bpy
import numpy as np
from scenes import (
    add_camera,
    add_light,
    add_plane,
    assert_agrees,
    assert_warns,
    folder,
    link,
    new_material,
    new_scene,
    render,
)

#: Coordinates are this far apart: a power of two, so that they are exact.
_STEP = 2.0**-12

#: Whether Cycles' colours are those of Rec. 709 exactly. In 5.2 it takes its matrices from the configuration of colours, whose
#: primaries are 2·10⁻⁴ off.
_IS_REC_709 = bpy.app.version < (5, 0, 0)

#: Faces, and so points, along a side of the sheet: 102,400 in all.
_SIDE = 320


def _sheet(materials, low, high, seed=1, tilted=False):
    """A square of faces with random coordinates, in rows of the materials' own.

    @param  low, high  limits of the coordinates: uv map "xy" has two, "zw" two more
    @param  tilted     faces have random normals
    """
    count = _SIDE * _SIDE
    x, y = np.meshgrid(np.arange(_SIDE), np.arange(_SIDE))
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    points = np.zeros((count, 4, 3), dtype=np.float32)
    points[..., :2] = np.stack([x, y], axis=-1).reshape(-1, 1, 2) + corners
    random = np.random.default_rng(seed)
    if tilted:
        slopes = random.uniform(-2, 2, (count, 1, 2))
        points[..., 2] = (slopes * (corners - 0.5)).sum(axis=-1)
    mesh = _faces(points)
    for name in ("xy", "zw"):
        steps = random.integers(low / _STEP, high / _STEP, (count, 1, 2)) + 0.5
        values = (_STEP * steps).astype(np.float32).repeat(4, axis=1)
        mesh.uv_layers.new(name=name).data.foreach_set("uv", values.ravel())
    rows = np.minimum(y.ravel() * len(materials) // _SIDE, len(materials) - 1)
    mesh.polygons.foreach_set("material_index", rows.astype(np.int32))
    for material in materials:
        mesh.materials.append(material)
    return link(mesh, "sheet")


def _faces(points):
    """A mesh of four-sided faces that share no vertices.

    @param  points  float32 (faces, 4, 3)
    """
    count = len(points)
    mesh = bpy.data.meshes.new("sheet")
    mesh.vertices.add(4 * count)
    mesh.loops.add(4 * count)
    mesh.polygons.add(count)
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(4 * count, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    # Since 3.6 it follows from the starts.
    if bpy.app.version < (3, 6, 0):
        mesh.polygons.foreach_set("loop_total", np.full(count, 4, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.zeros(count, dtype=bool))
    mesh.update(calc_edges=True)
    return mesh


def _emitter(name, build):
    """A material that emits the socket that build(tree, xyz, w) gives.

    xyz  a vector socket, random over the sheet
    w    a number likewise
    """
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    first, second = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeUVMap")
    first.uv_map, second.uv_map = "xy", "zw"
    xy, zw = tree.nodes.new("ShaderNodeSeparateXYZ"), tree.nodes.new("ShaderNodeSeparateXYZ")
    for uv_map, parts in ((first, xy), (second, zw)):
        snap = tree.nodes.new("ShaderNodeVectorMath")
        snap.operation = "SNAP"
        snap.inputs[1].default_value = (_STEP, _STEP, _STEP)
        tree.links.new(uv_map.outputs[0], snap.inputs[0])
        tree.links.new(snap.outputs[0], parts.inputs[0])
    xyz = tree.nodes.new("ShaderNodeCombineXYZ")
    for number, source in enumerate((xy.outputs[0], xy.outputs[1], zw.outputs[0])):
        tree.links.new(source, xyz.inputs[number])
    emission = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(build(tree, xyz.outputs[0], zw.outputs[1]), emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def _assert_nodes_agree(builders, low=-2.0, high=2.0, relative=1e-5, absolute=1e-6, most_off=0.0, tilted=False):
    """Fails where an engine's picture of a sheet of nodes differs from the other's.

    @param  builders  by name, see _emitter; those of one name share a row
    @param  most_off  share of the points of a row that may be further off: nodes that jump do so at points that rounding moves
    """
    scene = new_scene(_SIDE, _SIDE)
    materials = [_emitter(name, build) for name, build in builders.items()]
    sheet = _sheet(materials, low, high, tilted=tilted)
    if tilted:
        sheet.scale = (1, 1, 0.7)
    sheet.location = (-_SIDE / 2, -_SIDE / 2, 0)
    add_camera((0, 0, 10), type="ORTHO", ortho_scale=_SIDE)
    with folder() as path:
        ours = render(scene, "RELIEF", os.path.join(path, "relief.exr"), samples=1)[::-1].reshape(-1, 3)
        theirs = render(scene, "CYCLES", os.path.join(path, "cycles.exr"), samples=1)[::-1].reshape(-1, 3)
    rows = np.minimum(np.arange(_SIDE) * len(materials) // _SIDE, len(materials) - 1).repeat(_SIDE)
    wrong = []
    for number, name in enumerate(builders):
        a, b = ours[rows == number], theirs[rows == number]
        error = np.abs(a - b)
        off = (error > absolute + relative * np.abs(b)).any(axis=1)
        largest = (error / np.maximum(np.abs(b), 0.1)).max()
        print(f"{name}: largest difference {largest:.2g}, {off.mean():.3%} beyond {relative}, mean {b.mean():.4f}")
        if off.mean() > most_off:
            worst = int(error.max(axis=1).argmax())
            wrong.append(f"{name}: {off.mean():.3%}, worst {a[worst]} for {b[worst]}")
    assert not wrong, wrong


def _node(kind, inputs=None, out=0, **settings):
    """A builder of one node.

    @param  inputs  by the socket's name or number: "xyz", "w", or a value
    @param  out     number or name of the output
    """

    def build(tree, xyz, w):
        node = tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        given = inputs if inputs is not None else {"Vector": "xyz"}
        for name, value in given.items():
            socket = node.inputs.get(name) if isinstance(name, str) else node.inputs[name]
            if socket is None:
                continue
            if value == "xyz":
                tree.links.new(xyz, socket)
            elif value == "w":
                tree.links.new(w, socket)
            elif isinstance(value, tuple) and value[0] == "component":
                parts = tree.nodes.new("ShaderNodeSeparateXYZ")
                tree.links.new(xyz, parts.inputs[0])
                tree.links.new(parts.outputs[value[1]], socket)
            else:
                socket.default_value = value
        return node.outputs[out]

    return build


_X, _Y, _Z = (("component", i) for i in range(3))


def test_noise_textures():
    noise = "ShaderNodeTexNoise"
    builders = {}
    for dimensions in ("1D", "2D", "3D", "4D"):
        base = {"Vector": "xyz", "W": "w", "Scale": 1.3, "Detail": 2.6, "Roughness": 0.55, "Distortion": 0.0}
        for out in (0, 1):
            builders[f"{dimensions} {out}"] = _node(noise, base, out, noise_dimensions=dimensions)
            bent = {**base, "Distortion": 0.8, "Detail": 4.0}
            builders[f"{dimensions} {out} bent"] = _node(noise, bent, out, noise_dimensions=dimensions)
    builders["smooth"] = _node(noise, {"Vector": "xyz", "Detail": 0.0})
    builders["varying detail"] = _node(noise, {"Vector": "xyz", "Scale": 2.0, "Detail": "w"})
    builders["varying roughness"] = _node(noise, {"Vector": "xyz", "Scale": 2.0, "Roughness": "w"})
    builders["far"] = _node(noise, {"Vector": "xyz", "Scale": 64.0, "Detail": 0.0})
    # Colours are noises 100 to 200 units away, where a bent coordinate has lost seven bits more.
    _assert_nodes_agree(builders, relative=5e-5)


def test_white_noise_textures():
    builders = {}
    for dimensions in ("1D", "2D", "3D", "4D"):
        for out in (0, 1):
            inputs = {"Vector": "xyz", "W": "w"}
            builders[f"{dimensions} {out}"] = _node("ShaderNodeTexWhiteNoise", inputs, out, noise_dimensions=dimensions)
    _assert_nodes_agree(builders, most_off=0.0)


def test_other_textures():
    builders = {}
    for kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE", "SPHERICAL"):
        builders[f"gradient {kind}"] = _node("ShaderNodeTexGradient", gradient_type=kind)
    builders["checker"] = _node("ShaderNodeTexChecker", {"Vector": "xyz", "Scale": 3.0})
    for depth in (0, 1, 2, 3, 5, 7, 10):
        inputs = {"Vector": "xyz", "Scale": 0.7, "Distortion": 1.3}
        builders[f"magic {depth}"] = _node("ShaderNodeTexMagic", inputs, turbulence_depth=depth)
    for profile in ("SIN", "SAW", "TRI"):
        for direction in ("X", "Y", "Z", "DIAGONAL"):
            inputs = {"Vector": "xyz", "Scale": 0.3, "Distortion": 1.5, "Phase Offset": 0.3}
            builders[f"bands {profile} {direction}"] = _node(
                "ShaderNodeTexWave", inputs, wave_type="BANDS", bands_direction=direction, wave_profile=profile
            )
    for direction in ("X", "Y", "Z", "SPHERICAL"):
        builders[f"rings {direction}"] = _node(
            "ShaderNodeTexWave", {"Vector": "xyz", "Scale": 0.3}, wave_type="RINGS", rings_direction=direction
        )
    _assert_nodes_agree(builders, relative=1e-4, absolute=1e-5, most_off=2e-3)


def test_voronoi_textures():
    builders = {}
    for dimensions in ("1D", "2D", "3D", "4D"):
        for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"):
            outs = ("Distance", "Color", "Position", "W") if "F" in feature.split("_")[-1] else ("Distance",)
            if feature == "N_SPHERE_RADIUS":
                outs = ("Radius",)
            for out in outs:
                if (out == "W" and dimensions not in {"1D", "4D"}) or (out == "Position" and dimensions == "1D"):
                    continue
                inputs = {"Vector": "xyz", "W": "w", "Scale": 1.7, "Smoothness": 0.6, "Randomness": 0.8}
                builders[f"{dimensions} {feature} {out}"] = _node(
                    "ShaderNodeTexVoronoi", inputs, out, voronoi_dimensions=dimensions, feature=feature
                )
    for metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
        inputs = {"Vector": "xyz", "Scale": 1.7, "Exponent": 1.6}
        builders[metric] = _node("ShaderNodeTexVoronoi", inputs, 0, distance=metric)
    _assert_nodes_agree(builders, absolute=1e-5, most_off=2e-3)


def test_fractal_cells():
    """Octaves of cells, of 4.0 on."""
    if "detail" not in {name.lower() for name in _input_names("ShaderNodeTexVoronoi")}:
        return
    builders = {}
    for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"):
        for dimensions in ("1D", "2D", "3D", "4D"):
            for normalize in (False, True):
                inputs = {"Vector": "xyz", "W": "w", "Scale": 1.7, "Randomness": 0.8, "Smoothness": 0.6}
                inputs.update({"Detail": 2.4, "Roughness": 0.6, "Lacunarity": 1.9})
                settings = {"voronoi_dimensions": dimensions, "feature": feature, "normalize": normalize}
                for out in ("Distance", "Color")[: 1 if feature == "DISTANCE_TO_EDGE" else 2]:
                    name = f"{dimensions} {feature} {normalize} {out}"
                    builders[name] = _node("ShaderNodeTexVoronoi", inputs, out, **settings)
    varying = {"Vector": "xyz", "Scale": 1.7, "Detail": "w", "Roughness": 0.6}
    builders["varying detail"] = _node("ShaderNodeTexVoronoi", varying, 0)
    builders["position"] = _node("ShaderNodeTexVoronoi", {**varying, "Detail": 1.5}, "Position")
    _assert_nodes_agree(builders, absolute=1e-5, most_off=4e-3)


def _input_names(kind):
    material = bpy.data.materials.new("names")
    material.use_nodes = True
    return [socket.name for socket in material.node_tree.nodes.new(kind).inputs]


def test_noise_types():
    """Musgrave's noises as types of Noise, of 4.1 on; and noise that repeats."""
    builders = {}
    types = bpy.types.ShaderNodeTexNoise.bl_rna.properties.get("noise_type")
    for kind in types.enum_items.keys() if types else ():
        for dimensions in ("1D", "2D", "3D", "4D"):
            inputs = {"Vector": "xyz", "W": "w", "Scale": 1.3, "Detail": 3.4, "Roughness": 0.7, "Lacunarity": 1.8}
            inputs.update({"Offset": 0.7, "Gain": 1.3, "Distortion": 0.0})
            settings = {"noise_dimensions": dimensions, "noise_type": kind, "normalize": False}
            builders[f"{dimensions} {kind}"] = _node("ShaderNodeTexNoise", inputs, 0, **settings)
        builders[f"{kind} colour"] = _node("ShaderNodeTexNoise", inputs, 1, noise_type=kind)
        smooth = {**inputs, "Detail": 0.0}
        builders[f"{kind} smooth"] = _node("ShaderNodeTexNoise", smooth, 0, noise_type=kind)
    # Where floats are eighths, quarters, …: far from the lattice's middle.
    for scale in (2.0**16, 2.0**18, 2.0**20) if types else ():
        builders[f"far {scale}"] = _node("ShaderNodeTexNoise", {"Vector": "xyz", "Scale": scale, "Detail": 0.0})
    if builders:
        _assert_nodes_agree(builders, relative=5e-5, absolute=5e-6)


def test_gabor_textures():
    if not hasattr(bpy.types, "ShaderNodeTexGabor"):
        return
    builders = {}
    for kind in ("2D", "3D"):
        for anisotropy in (1.0, 0.6, 0.0):
            for out in ("Value", "Phase", "Intensity"):
                inputs = {"Vector": "xyz", "Scale": 1.3, "Frequency": 2.3, "Anisotropy": anisotropy}
                builders[f"{kind} {anisotropy} {out}"] = _node("ShaderNodeTexGabor", inputs, out, gabor_type=kind)
    _assert_nodes_agree(builders, relative=1e-4, absolute=1e-5, most_off=1e-3)


def _write_image(path, width, height, is_transparent=False, seed=3):
    """Writes random bytes as a PNG file."""
    image = bpy.data.images.new("random", width, height, alpha=is_transparent)
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 4)).astype(np.float32) / 255
    if not is_transparent:
        pixels[..., 3] = 1
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = path, "PNG"
    image.save()
    bpy.data.images.remove(image)


def _image(load, inputs=None, out=0, space="Non-Color", alpha_mode="STRAIGHT", both=False, **settings):
    """A builder of an Image Texture.

    @param  load  gives its image
    @param  both  whether the other output is linked, too
    """

    def build(tree, xyz, w):
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = load()
        node.image.colorspace_settings.name, node.image.alpha_mode = space, alpha_mode
        for name, value in settings.items():
            setattr(node, name, value)
        tree.links.new(xyz, node.inputs["Vector"])
        if both:
            little = tree.nodes.new("ShaderNodeVectorMath")
            little.operation = "MULTIPLY_ADD"
            little.inputs[1].default_value = (1e-12, 1e-12, 1e-12)
            tree.links.new(node.outputs[1 - out], little.inputs[0])
            tree.links.new(node.outputs[out], little.inputs[2])
            return little.outputs[0]
        return node.outputs[out]

    return build


def _extensions():
    return bpy.types.ShaderNodeTexImage.bl_rna.properties["extension"].enum_items.keys()


def test_images():
    with folder() as path:
        opaque, clear = os.path.join(path, "opaque.png"), os.path.join(path, "clear.png")
        _write_image(opaque, 13, 7)
        _write_image(clear, 7, 11, True)
        loaders = {
            name: lambda file=file: bpy.data.images.load(file) for name, file in (("opaque", opaque), ("clear", clear))
        }
        builders = {}
        for projection in ("FLAT", "SPHERE", "TUBE"):
            for extension in _extensions():
                for interpolation in ("Closest", "Linear", "Cubic"):
                    settings = {"projection": projection, "extension": extension, "interpolation": interpolation}
                    builders[" ".join(settings.values())] = _image(loaders["opaque"], **settings)
        builders["smart"] = _image(loaders["opaque"], interpolation="Smart")
        for out in (0, 1):
            for mode in ("STRAIGHT", "CHANNEL_PACKED", "NONE"):
                for space in ("Non-Color", "sRGB"):
                    options = {"space": space, "alpha_mode": mode, "interpolation": "Closest"}
                    builders[f"clear {out} {mode} {space}"] = _image(loaders["clear"], out=out, extension="CLIP", **options)
        _assert_nodes_agree(builders, absolute=1e-5, most_off=2e-3)


def test_images_by_direction():
    """An Environment Texture that no world has; bytes become halves, which keep eleven bits."""
    with folder() as path:
        file = os.path.join(path, "around.png")
        _write_image(file, 13, 7)

        def around(projection, interpolation):
            def build(tree, xyz, w):
                node = tree.nodes.new("ShaderNodeTexEnvironment")
                node.image, node.projection, node.interpolation = bpy.data.images.load(file), projection, interpolation
                node.image.colorspace_settings.name = "Non-Color"
                tree.links.new(xyz, node.inputs["Vector"])
                return node.outputs["Color"]

            return build

        builders = {
            f"{projection} {interpolation}": around(projection, interpolation)
            for projection in ("EQUIRECTANGULAR", "MIRROR_BALL")
            for interpolation in ("Closest", "Linear")
        }
        _assert_nodes_agree(builders, absolute=1e-3, most_off=2e-3)


def test_images_of_encoded_colors():
    """Cycles filters what sRGB files store, multiplied by alpha in whole bytes, and decodes the sum."""
    with folder() as path:
        opaque, clear = os.path.join(path, "opaque.png"), os.path.join(path, "clear.png")
        _write_image(opaque, 13, 7)
        _write_image(clear, 7, 11, True)
        builders = {}
        for interpolation in ("Closest", "Linear", "Cubic"):
            for both in (False, True):
                for name, file in (("opaque", opaque), ("clear", clear)):
                    options = {"space": "sRGB", "interpolation": interpolation, "both": both}
                    builders[f"{name} {interpolation} {both}"] = _image(lambda f=file: bpy.data.images.load(f), **options)
        _assert_nodes_agree(builders, most_off=2e-3)


def test_images_of_floats():
    """Generated ones, whose colours Blender keeps multiplied by alpha; halves keep eleven bits."""

    def load():
        image = bpy.data.images.new("floats", 9, 5, alpha=True, float_buffer=True)
        pixels = np.random.default_rng(5).integers(0, 64, (5, 9, 4)).astype(np.float32) / 32
        pixels[..., 3] = np.minimum(pixels[..., 3], 1)
        image.pixels.foreach_set(pixels.ravel())
        return image

    builders = {}
    for interpolation in ("Closest", "Linear"):
        for both in (False, True):
            settings = {"space": bpy.data.images.new("space", 1, 1, float_buffer=True).colorspace_settings.name, "both": both}
            builders[f"{interpolation} {both}"] = _image(load, interpolation=interpolation, **settings)
    _assert_nodes_agree(builders, absolute=1e-5, most_off=2e-3)


def test_boxes_of_images():
    with folder() as path:
        file = os.path.join(path, "image.png")
        _write_image(file, 13, 7)
        builders = {
            f"{blend}": _image(lambda: bpy.data.images.load(file), projection="BOX", projection_blend=blend)
            for blend in (0.0, 0.2, 0.6, 1.0)
        }
        _assert_nodes_agree(builders, absolute=2e-5, most_off=2e-3, tilted=True)


def test_tiled_images():
    def load(numbers):
        image = bpy.data.images.load(os.path.join(path, "tile.1001.png"))
        image.source = "TILED"
        image.filepath = os.path.join(path, "tile.<UDIM>.png")
        for number in numbers:
            image.tiles.new(number)
        return image

    with folder() as path:
        for seed, number in enumerate((1001, 1002, 1011)):
            _write_image(os.path.join(path, f"tile.{number}.png"), 8 + seed, 7, seed=seed)
        builders = {
            name: _image(lambda n=numbers: load(n), extension="EXTEND", interpolation="Linear")
            for name, numbers in (("three", (1002, 1011)), ("two", (1011,)))
        }
        _assert_nodes_agree(builders, low=-0.5, high=2.5, absolute=1e-5, most_off=2e-3)


def test_musgrave_textures():
    if not hasattr(bpy.types, "ShaderNodeTexMusgrave"):
        return
    builders = {}
    for dimensions in ("1D", "2D", "3D", "4D"):
        for kind in ("MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "FBM", "HETERO_TERRAIN"):
            inputs = {"Vector": "xyz", "W": "w", "Scale": 1.3, "Detail": 3.4, "Dimension": 0.9, "Lacunarity": 1.8}
            inputs.update({"Offset": 0.7, "Gain": 1.3})
            builders[f"{dimensions} {kind}"] = _node(
                "ShaderNodeTexMusgrave", inputs, musgrave_dimensions=dimensions, musgrave_type=kind
            )
    for kind in ("RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "HETERO_TERRAIN"):
        inputs = {"Vector": "xyz", "Scale": 1.3, "Detail": 0.6, "Offset": 0.7, "Gain": 1.3}
        builders[f"{kind} of little detail"] = _node("ShaderNodeTexMusgrave", inputs, musgrave_type=kind)
    _assert_nodes_agree(builders)


def test_brick_textures():
    builders = {}
    for out in (0, 1):
        inputs = {"Vector": "xyz", "Scale": 1.3, "Mortar Size": 0.05, "Mortar Smooth": 0.3, "Bias": -0.2}
        builders[f"bricks {out}"] = _node("ShaderNodeTexBrick", inputs, out)
        shifted = {"offset": 0.3, "offset_frequency": 3, "squash": 0.6, "squash_frequency": 2}
        builders[f"squashed {out}"] = _node("ShaderNodeTexBrick", inputs, out, **shifted)
    sharp = {"Vector": "xyz", "Scale": 1.3, "Mortar Size": 0.05, "Mortar Smooth": 0.0}
    builders["sharp"] = _node("ShaderNodeTexBrick", sharp, 1)
    _assert_nodes_agree(builders, absolute=1e-5, most_off=2e-3)


def test_curves():
    def bent(mapping, curves):
        for number, curve in enumerate(curves):
            curve.points[0].location = (0.1, 0.05 * number)
            curve.points.new(0.4, 0.7 - 0.1 * number)
        mapping.update()

    def rgb(extend, factor):
        def builder(tree, xyz, w):
            node = tree.nodes.new("ShaderNodeRGBCurve")
            node.mapping.extend = extend
            bent(node.mapping, node.mapping.curves)
            node.inputs[0].default_value = factor
            tree.links.new(xyz, node.inputs["Color"])
            return node.outputs[0]

        return builder

    def number(tree, xyz, w):
        node = tree.nodes.new("ShaderNodeFloatCurve")
        bent(node.mapping, node.mapping.curves)
        tree.links.new(w, node.inputs["Value"])
        return node.outputs[0]

    def vector(tree, xyz, w):
        node = tree.nodes.new("ShaderNodeVectorCurve")
        bent(node.mapping, node.mapping.curves)
        tree.links.new(xyz, node.inputs["Vector"])
        return node.outputs[0]

    builders = {f"{extend} {f}": rgb(extend, f) for extend in ("EXTRAPOLATED", "HORIZONTAL") for f in (1.0, 0.6)}
    _assert_nodes_agree({**builders, "number": number, "vector": vector}, low=-1.2, high=1.4, absolute=1e-5)


def test_math():
    operations = bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items.keys()
    builders = {
        name: _node("ShaderNodeMath", {0: _X, 1: _Y, 2: "w"}, operation=name, use_clamp=False) for name in operations
    }
    builders["clamped"] = _node("ShaderNodeMath", {0: _X, 1: _Y}, operation="ADD", use_clamp=True)
    _assert_nodes_agree(builders, relative=1e-5, most_off=1e-3)


def test_vector_math():
    operations = bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items.keys()
    builders = {}
    for name in operations:
        out = 1 if name in {"DOT_PRODUCT", "DISTANCE", "LENGTH"} else 0
        inputs = {0: "xyz", 1: (0.7, -0.4, 1.1), 2: (0.3, 0.2, -0.9), "Scale": 0.8}
        builders[name] = _node("ShaderNodeVectorMath", inputs, out, operation=name)
    _assert_nodes_agree(builders, relative=1e-5, absolute=2e-6, most_off=1e-3)


def test_mixes():
    builders = {}
    for name in bpy.types.ShaderNodeMixRGB.bl_rna.properties["blend_type"].enum_items.keys():
        inputs = {"Factor_Float": 0.7}

        def build(tree, xyz, w, name=name):
            node = tree.nodes.new("ShaderNodeMix")
            node.data_type, node.blend_type = "RGBA", name
            sockets = {socket.identifier: socket for socket in node.inputs}
            sockets["Factor_Float"].default_value = 0.7
            sockets["B_Color"].default_value = (0.2, 0.6, 0.4, 1.0)
            tree.links.new(xyz, sockets["A_Color"])
            return next(socket for socket in node.outputs if socket.identifier == "Result_Color")

        builders[name] = build
    _assert_nodes_agree(builders, low=0.0, high=1.0, relative=1e-5, most_off=1e-3)


def test_mixes_of_numbers_and_vectors():
    def build(kind, clamped):
        def builder(tree, xyz, w):
            node = tree.nodes.new("ShaderNodeMix")
            node.data_type, node.clamp_factor = kind, clamped
            part = {"FLOAT": "Float", "VECTOR": "Vector"}[kind]
            sockets = {socket.identifier: socket for socket in node.inputs}
            tree.links.new(w, sockets["Factor_Float"])
            tree.links.new(xyz, sockets[f"A_{part}"])
            tree.links.new(w, sockets[f"B_{part}"])
            return next(socket for socket in node.outputs if socket.identifier == f"Result_{part}")

        return builder

    _assert_nodes_agree({f"{k} {c}": build(k, c) for k in ("FLOAT", "VECTOR") for c in (True, False)})


def test_colors():
    builders = {
        "invert": _node("ShaderNodeInvert", {0: 0.7, "Color": "xyz"}),
        "gamma": _node("ShaderNodeGamma", {"Color": "xyz", "Gamma": 1.7}),
        "contrast": _node("ShaderNodeBrightContrast", {"Color": "xyz", 1: 0.2, "Contrast": 0.4}),
        "hue": _node("ShaderNodeHueSaturation", {"Hue": 0.7, "Saturation": 1.3, "Value": 0.8, "Color": "xyz"}),
        "grey": _node("ShaderNodeRGBToBW", {"Color": "xyz"}),
    }
    for mode in ("RGB", "HSV", "HSL"):
        for out in range(3):
            builders[f"separate {mode} {out}"] = _node("ShaderNodeSeparateColor", {0: "xyz"}, out, mode=mode)
        builders[f"combine {mode}"] = _node("ShaderNodeCombineColor", {0: _X, 1: _Y, 2: _Z}, mode=mode)
    absolute = 2e-6 if _IS_REC_709 else 1e-4
    _assert_nodes_agree(builders, low=0.0, high=1.0, absolute=absolute, most_off=1e-3)


def test_temperatures_and_wavelengths():
    def build(kind, name, scale, offset):
        def builder(tree, xyz, w):
            scaled = tree.nodes.new("ShaderNodeMath")
            scaled.operation = "MULTIPLY_ADD"
            scaled.inputs[1].default_value, scaled.inputs[2].default_value = scale, offset
            node = tree.nodes.new(kind)
            tree.links.new(w, scaled.inputs[0])
            tree.links.new(scaled.outputs[0], node.inputs[name])
            return node.outputs[0]

        return builder

    builders = {
        "blackbody": build("ShaderNodeBlackbody", "Temperature", 3400.0, 6500.0),
        "embers": build("ShaderNodeBlackbody", "Temperature", 700.0, 1800.0),
        "wavelength": build("ShaderNodeWavelength", "Wavelength", 110.0, 580.0),
    }
    relative = 1e-5 if _IS_REC_709 else 3e-4
    _assert_nodes_agree(builders, relative=relative, absolute=1e-5, most_off=1e-3)


def test_turns():
    builders = {}
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        for invert in (False, True):
            inputs = {"Vector": "xyz", "Center": (0.3, -0.2, 0.5)}
            inputs.update({"Rotation": (0.4, -0.7, 1.1)} if kind == "EULER_XYZ" else {"Angle": "w"})
            if kind == "AXIS_ANGLE":
                inputs["Axis"] = (0.4, -0.8, 0.6)
            builders[f"{kind} {invert}"] = _node("ShaderNodeVectorRotate", inputs, rotation_type=kind, invert=invert)

    def normal(out):
        def builder(tree, xyz, w):
            node = tree.nodes.new("ShaderNodeNormal")
            node.outputs[0].default_value = (0.6, -0.3, 0.7)
            tree.links.new(xyz, node.inputs[0])
            return node.outputs[out]

        return builder

    builders.update({"normal": normal(0), "dot": normal(1)})
    _assert_nodes_agree(builders, absolute=3e-6)


def test_old_nodes_of_hsv():
    if not hasattr(bpy.types, "ShaderNodeCombineHSV"):
        return
    builders = {"combine": _node("ShaderNodeCombineHSV", {0: _X, 1: _Y, 2: _Z})}
    for out in range(3):
        builders[f"separate {out}"] = _node("ShaderNodeSeparateHSV", {0: "xyz"}, out)
    _assert_nodes_agree(builders, low=0.0, high=1.0, absolute=2e-6, most_off=1e-3)


def test_ramps():
    def build(interpolation, mode):
        def builder(tree, xyz, w):
            node = tree.nodes.new("ShaderNodeValToRGB")
            ramp = node.color_ramp
            ramp.color_mode = mode
            ramp.interpolation = interpolation
            ramp.elements[0].position, ramp.elements[0].color = 0.2, (0.1, 0.7, 0.3, 1)
            ramp.elements[1].position, ramp.elements[1].color = 0.8, (0.9, 0.2, 0.5, 1)
            ramp.elements.new(0.55).color = (0.2, 0.1, 0.8, 1)
            tree.links.new(w, node.inputs[0])
            return node.outputs[0]

        return builder

    kinds = ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE")
    builders = {f"{kind} {mode}": build(kind, mode) for kind in kinds for mode in ("RGB", "HSV", "HSL")}
    _assert_nodes_agree(builders, low=-0.2, high=1.2, most_off=1e-3)


def test_ranges():
    builders = {}
    for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        for clamp in (True, False):
            inputs = {0: "w", 1: -0.5, 2: 1.2, 3: 0.3, 4: 1.4, 5: 4.0}
            builders[f"{kind} {clamp}"] = _node("ShaderNodeMapRange", inputs, interpolation_type=kind, clamp=clamp)
    for kind in ("MINMAX", "RANGE"):
        inputs = {"Value": "w", "Min": 0.9, "Max": 0.2}
        builders[f"clamp {kind}"] = _node("ShaderNodeClamp", inputs, clamp_type=kind)
    _assert_nodes_agree(builders, most_off=1e-3)


def test_mappings():
    builders = {}
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        inputs = {"Vector": "xyz", "Rotation": (0.4, -0.7, 1.1), "Scale": (0.7, 1.3, -0.8)}
        if kind in {"POINT", "TEXTURE"}:
            inputs["Location"] = (0.3, 0.5, -0.2)
        builders[kind] = _node("ShaderNodeMapping", inputs, vector_type=kind)
    _assert_nodes_agree(builders, absolute=3e-6)


def test_mappings_of_textures():
    """Textures' own, which no panel shows."""
    def build(kind, **settings):
        def builder(tree, xyz, w):
            node = tree.nodes.new(kind)
            mapping = node.texture_mapping
            mapping.rotation, mapping.scale = (0.4, -0.7, 1.1), (0.7, 1.3, -0.8)
            mapping.translation = (0.3, 0.5, -0.2)
            for name, value in settings.items():
                setattr(mapping, name, value)
            tree.links.new(xyz, node.inputs["Vector"])
            return node.outputs[0]

        return builder

    builders = {
        f"{kind} {mapping}": build(kind, vector_type=mapping)
        for kind in ("ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexGradient")
        for mapping in ("POINT", "TEXTURE", "VECTOR")
    }
    builders["axes"] = build("ShaderNodeTexGradient", vector_type="POINT", mapping_x="Y", mapping_y="NONE", mapping_z="X")
    _assert_nodes_agree(builders, relative=5e-5, absolute=2e-5, most_off=2e-3)


def _procedural_scene():
    """A sphere of wood on a chequered floor, of which nothing is an image; both engines mean its lobes exactly."""
    scene = new_scene(96, 72)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(0, 0, 1))
    sphere = bpy.context.object
    bpy.ops.object.shade_smooth()
    wood, tree, surface = new_material("wood")
    point = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    mapping.inputs["Scale"].default_value = (1, 1, 4)
    mapping.inputs["Rotation"].default_value = (0.3, 0.2, 0.1)
    for name, value in (("Scale", 3), ("Detail", 4.5), ("Distortion", 0.7)):
        noise.inputs[name].default_value = value
    first, last = ramp.color_ramp.elements
    first.position, first.color, last.position, last.color = 0.35, (0.05, 0.02, 0.01, 1), 0.65, (0.8, 0.4, 0.1, 1)
    tree.links.new(point.outputs["Object"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], surface.inputs["Color"])
    sphere.data.materials.append(wood)

    floor, tree, surface = new_material("floor")
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 10
    tree.links.new(checker.outputs[0], surface.inputs["Color"])
    add_plane(8, floor)
    add_light("AREA", (2, -2, 4), (0.6, 0.3, 0.4), energy=300, size=1)
    add_camera((0, -5, 2.2), (1.35, 0, 0))
    return scene


def test_a_procedural_scene():
    assert_agrees(_procedural_scene(), runs=4, samples=16)


def test_it_is_bent_with_its_object():
    """Coordinates of an object that is turned, scaled unevenly and moved stay its own; generated ones follow its box."""
    scene = _procedural_scene()
    sphere = next(o for o in bpy.data.objects if o.type == "MESH" and o.data.materials[0].name == "wood")
    sphere.rotation_euler, sphere.scale, sphere.location = (0.5, 0.3, 0.9), (1.2, 0.7, 0.5), (0.3, 0.2, 1.1)
    tree = bpy.data.materials["wood"].node_tree
    point = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexCoord")
    mapping = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMapping")
    tree.links.new(point.outputs["Generated"], mapping.inputs["Vector"])
    assert_agrees(scene, runs=4, samples=16)


def test_opacity_by_noise():
    """Shadows, too, are let through."""
    scene = _procedural_scene()
    tree = bpy.data.materials["wood"].node_tree
    new = tree.nodes.new
    noise = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexNoise")
    surface = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    mix, clear = new("ShaderNodeMixShader"), new("ShaderNodeBsdfTransparent")
    tree.links.new(noise.outputs[0], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(surface.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    assert_agrees(scene, runs=4, samples=16)


def test_what_is_behind_a_ramp_is_named():
    scene = _procedural_scene()
    tree = bpy.data.materials["wood"].node_tree
    odd = tree.nodes.new("ShaderNodeShaderToRGB")
    ramp = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeValToRGB")
    tree.links.new(odd.outputs[0], ramp.inputs[0])
    assert_warns(scene, 'node "Shader to RGB"', "as Fac", "own value")
    # Cycles has no such node, and the ramp gives what it gives where nothing is linked to it.
    assert_agrees(scene)
