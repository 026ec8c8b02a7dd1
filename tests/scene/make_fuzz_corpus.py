#!/usr/bin/env python3
"""Writes the seed corpus of fuzz_scene_load: small scenes that together use everything the loader reads.

usage: make_fuzz_corpus.py FOLDER
"""
import base64
import json
import pathlib
import struct
import sys

PIXEL = ("data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJg"
         "gg==")


class Builder:
    """A glTF document whose buffer grows with its accessors."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], "scene": 0,
                     "scenes": [{"nodes": []}], "nodes": []}
        self.binary = b""

    def view(self, data, stride=None):
        self.binary += b"\0" * (-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if stride:
            view["byteStride"] = stride
        self.binary += data
        self.json["bufferViews"].append(view)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, code, values, kind, **more):
        component = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}[code]
        width = 1 if kind == "SCALAR" else int(kind[-1])
        accessor = {"bufferView": self.view(struct.pack(f"<{len(values)}{code}", *values)),
                    "componentType": component, "count": len(values) // width, "type": kind, **more}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def node(self, **node):
        self.json["nodes"].append(node)
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)

    def square(self, **primitive):
        attributes = {"POSITION": self.accessor("f", [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], "VEC3"),
                      "NORMAL": self.accessor("f", [0, 0, 1] * 4, "VEC3"),
                      "TEXCOORD_0": self.accessor("f", [0, 1, 1, 1, 1, 0, 0, 0], "VEC2")}
        indices = self.accessor("H", [0, 1, 2, 0, 2, 3], "SCALAR")
        self.json.setdefault("meshes", []).append(
            {"primitives": [{"attributes": attributes, "indices": indices, **primitive}]})
        return len(self.json["meshes"]) - 1

    def gltf(self):
        out = dict(self.json)
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        out["buffers"] = [{"byteLength": len(self.binary), "uri": uri}]
        return json.dumps(out, separators=(",", ":")).encode()

    def glb(self):
        out = dict(self.json)
        out["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(out, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def plain():
    b = Builder()
    b.node(name="square", mesh=b.square())
    return b


def topologies():
    b = Builder()
    for mode, code, corners in ((4, "B", [0, 1, 2]), (5, "I", [0, 1, 3, 2]), (6, "H", [0, 1, 2, 3])):
        primitive = {"mode": mode, "attributes": {
            "POSITION": b.accessor("h", [0, 0, 0, 9, 0, 0, 9, 9, 0, 0, 9, 0], "VEC3"),
            "NORMAL": b.accessor("b", [0, 0, 127] * 4, "VEC3", normalized=True),
            "COLOR_0": b.accessor("B", [255] * 12, "VEC3", normalized=True)},
            "indices": b.accessor(code, corners, "SCALAR")}
        b.json.setdefault("meshes", []).append({"primitives": [primitive]})
        b.node(mesh=len(b.json["meshes"]) - 1)
    lines = {"mode": 1, "indices": b.accessor("B", [0, 1, 1, 2, 3, 3], "SCALAR"), "attributes": {
        "POSITION": b.accessor("f", [0, 0, 0, 1, 0, 0, 1, 1, 0, 2, 2, 2], "VEC3"),
        "_RADIUS": b.accessor("f", [.1, .2, 0, 1], "SCALAR")}, "extensions": {"RELIEF_curves": {"shape": "tubes"}}}
    points = {**lines, "mode": 0, "extensions": {"RELIEF_points": {}}}
    b.json["meshes"].append({"primitives": [lines, points]})
    b.node(mesh=len(b.json["meshes"]) - 1)
    sparse = {"count": 1, "indices": {"bufferView": b.view(struct.pack("<H", 2)), "componentType": 5123},
              "values": {"bufferView": b.view(struct.pack("<3f", 5, 5, 5))}}
    position = b.accessor("f", [0, 0, 0, 1, 0, 0, 1, 1, 0], "VEC3", sparse=sparse)
    b.json["meshes"].append({"primitives": [{"attributes": {"POSITION": position}}]})
    b.node(mesh=len(b.json["meshes"]) - 1, matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1])
    return b


def materials():
    b = Builder()
    texture = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [.5, 0], "rotation": 1, "scale": [2, 3]}}}
    b.json.update(
        images=[{"uri": PIXEL}], samplers=[{"wrapS": 33071, "magFilter": 9728}], textures=[{"source": 0, "sampler": 0}],
        materials=[{"name": "m", "alphaMode": "MASK", "alphaCutoff": .4, "doubleSided": True, "emissiveFactor": [1, 1, 1],
                    "pbrMetallicRoughness": {"baseColorTexture": texture, "metallicFactor": 0, "roughnessFactor": .2,
                                             "baseColorFactor": [1, .5, .25, 1]},
                    "normalTexture": {"index": 0, "scale": 2},
                    "extensions": {
                        "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": texture},
                        "KHR_materials_ior": {"ior": 1.33},
                        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationColor": [.5, 1, 1],
                                                 "attenuationDistance": 1},
                        "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatNormalTexture": {"index": 0}},
                        "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": .5},
                        "KHR_materials_specular": {"specularFactor": .5, "specularColorFactor": [1, 1, 1]},
                        "KHR_materials_emissive_strength": {"emissiveStrength": 4}, "KHR_materials_unlit": {},
                        "RELIEF_displacement": {"heightTexture": texture, "scale": .1, "midlevel": .5, "space": "world",
                                                "method": "rmip", "lod": 1.5, "smoothing": True, "seams": "weld"}}}])
    b.node(mesh=b.square(material=0))
    return b


def graphs():
    """Materials of value graphs: a chain of textures and colours, mathematics, and what every kind of error is near to."""
    b = Builder()

    def material(nodes, outputs):
        graph = {"nodes": nodes, "outputs": outputs}
        b.json.setdefault("materials", []).append({"extensions": {"RELIEF_graph": graph}})
        b.node(mesh=b.square(material=len(b.json["materials"]) - 1))

    def of(node, output=None):
        return {"node": node, **({"output": output} if output else {})}

    b.json.update(images=[{"uri": PIXEL}], textures=[{"source": 0}])
    material(
        [{"type": "texture-coordinate"},
         {"type": "mapping", "inputs": {"vector": of(0, "uv"), "rotation": [0, 0, 1], "scale": 2}, "mapping": "texture"},
         {"type": "image-texture", "inputs": {"vector": of(1)}, "texture": {"index": 0}, "colorSpace": "linear"},
         {"type": "noise-texture", "inputs": {"vector": of(0, "object"), "detail": 4.5, "distortion": .1}},
         {"type": "color-ramp", "inputs": {"factor": of(3, "factor")}, "table": [0, 0, 0, 1, 1, .5, 0, 1]},
         {"type": "mix-color", "inputs": {"factor": .3, "a": of(2, "color"), "b": of(4, "color")}, "blend": "overlay"},
         {"type": "layer-weight", "inputs": {"blend": .2}},
         {"type": "color-curves", "inputs": {"color": of(5)}, "table": [0, 0, 0, 1, .5, .2], "max": 2, "extrapolate": False}],
        {"baseColor": of(7), "roughness": of(6, "facing"), "emission": of(2, "color"), "alpha": of(2, "alpha")})
    material(
        [{"type": "geometry"},
         {"type": "math", "inputs": {"a": of(0, "backfacing"), "b": -1e38, "c": 0}, "operation": "wrap", "clamp": True},
         {"type": "vector-math", "inputs": {"a": of(0, "position"), "b": [1, 0, -2], "scale": of(1)}, "operation": "refract"},
         {"type": "voronoi-texture", "inputs": {"vector": of(2, "vector"), "w": of(1), "exponent": 0}, "dimensions": 4,
          "feature": "smooth-f1", "metric": "minkowski"},
         {"type": "musgrave-texture", "inputs": {"vector": of(3, "position"), "w": 1e30}, "dimensions": 4,
          "musgrave": "ridged-multifractal"},
         {"type": "brick-texture", "inputs": {"vector": of(0, "position"), "rowHeight": 0}, "squashFrequency": 0},
         {"type": "map-range", "inputs": {"value": of(4), "fromMax": 0, "steps": 0}, "interpolation": "stepped"},
         {"type": "vertex-color"},
         {"type": "hue-saturation", "inputs": {"color": of(7, "color"), "hue": of(6)}},
         {"type": "wave-texture", "inputs": {"vector": of(8)}, "wave": "rings", "profile": "saw"},
         {"type": "magic-texture", "inputs": {"scale": of(9, "factor")}, "depth": 10}],
        {"metallic": of(10, "factor"), "sheenColor": of(5, "color"), "specular": of(8), "transmission": of(1)})
    # Nothing here depends on the point: all of it is computed while it is read.
    material(
        [{"type": kind, **more} for kind, more in (
            ("noise-texture", {"dimensions": 1}), ("white-noise-texture", {"dimensions": 2}), ("checker-texture", {}),
            ("gradient-texture", {"gradient": "radial"}), ("separate-color", {"space": "hsl"}),
            ("combine-color", {"space": "hsv"}), ("number-curve", {"table": [0, 1]}), ("clamp", {"clamp": "range"}),
            ("bright-contrast", {}), ("gamma", {}), ("invert", {}), ("rgb-to-bw", {}), ("combine", {}),
            ("mix-number", {"clampFactor": False}), ("voronoi-texture", {"feature": "distance-to-edge"}))],
        {"baseColor": of(5), "clearcoat": of(7), "clearcoatRoughness": of(0, "factor"), "specularColor": of(1, "color")})
    return b


def closures():
    """Surfaces of closures, with and without a graph; heights by graph."""
    b = Builder()
    nodes = [{"type": "texture-coordinate"},
             {"type": "noise-texture", "inputs": {"vector": {"node": 0, "output": "uv"}}},
             {"type": "bump", "inputs": {"height": {"node": 1, "output": "factor"}, "distance": .1}, "invert": True,
              "filterWidth": .1}]
    factor, normal = {"node": 1, "output": "factor"}, {"node": 2}
    first = {"closures": [
        {"type": "diffuse", "weight": factor, "roughness": .5, "normal": normal, "maths": "4.3"},
        {"type": "glossy", "weight": .5, "anisotropy": -.5, "tangent": [1, 0, 0], "distribution": "beckmann"},
        {"type": "transparent", "color": [1, .5, .25]}, {"type": "emission", "strength": factor},
        {"type": "toon", "component": "glossy", "size": 1e30}, {"type": "holdout", "weight": 1e-9}],
        "normal": normal}
    second = {"closures": [
        {"type": "principled", "metallic": -1, "ior": 0, "distribution": "multiscatter-ggx"},
        {"type": "principled", "maths": "4.3", "coatWeight": 1, "coatIor": 0, "thinFilmThickness": 500},
        {"type": "principled", "maths": "5.2", "metallic": .5, "thinFilmThickness": 500, "coatRoughness": .5},
        {"type": "metallic", "fresnel": "physical", "maths": "5.2", "thinFilmThickness": 1e30}, {"type": "glass", "ior": 1}, {"type": "refraction"},
        {"type": "hair", "component": "transmission", "roughnessU": -1}, {"type": "fibre", "pigment": "melanin", "random": 1e30, "ior": 0},
        {"type": "fibre", "model": "huang", "aspect": -1e30, "roughness": 0, "offset": 1e30},
        {"type": "velvet"}, {"type": "sheen"}, {"type": "translucent"}]}
    height = {"nodes": nodes[:2], "outputs": {"height": factor}, "resolution": 4}
    vectors = {"nodes": [{"type": "vector-displacement", "inputs": {"vector": [.1, .2, .3]}}],
               "outputs": {"vector": {"node": 0}}, "texCoord": 0}
    b.json["materials"] = [
        {"extensions": {"RELIEF_graph": {"nodes": nodes}, "RELIEF_surface": first}},
        {"extensions": {"RELIEF_surface": second, "RELIEF_displacement": {"heightGraph": height, "scale": .1}}},
        {"extensions": {"RELIEF_displacement": {"vectorGraph": vectors, "space": "tangent", "divide": True}}}]
    for material in range(3):
        b.node(mesh=b.square(material=material))
    return b


def lights():
    b = Builder()
    kinds = [{"type": "point", "intensity": 5}, {"type": "directional", "color": [1, 0, 0]},
             {"type": "spot", "range": 3, "spot": {"innerConeAngle": .1, "outerConeAngle": .5}}]
    b.json["extensions"] = {
        "KHR_lights_punctual": {"lights": kinds},
        "RELIEF_render": {"resolution": [64, 32], "samples": 4, "fps": 25, "frameRange": [1, 2], "maxBounces": 3,
                          "pixelFilter": {"type": "box", "width": 1}, "caustics": {}, "seed": 3, "view": "Standard"},
        "RELIEF_environment": {"color": [1, 1, 1], "strength": 2, "rotation": 1, "image": 0}}
    b.json["images"] = [{"uri": PIXEL}]
    b.json["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": .7, "znear": .1, "aspectRatio": 1.5},
         "extensions": {"RELIEF_camera": {
             "apertureRadius": .01, "apertureBlades": 6, "apertureRotation": 1, "apertureRatio": 2, "pixelAspect": 1.5,
             "focusDistance": 2, "shift": [.1, 0], "clip": [.1, 9]}}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 9}}]
    panoramas = [{"longitude": [-1, 2], "latitude": [0, 1], "window": [2, 2]}, {"type": "cylindrical", "heights": [-1, 2]},
                 {"type": "equidistant", "fieldOfView": 3}, {"type": "equisolid", "sensor": [36, 24], "focalLength": 9},
                 {"type": "polynomial", "coefficients": [0, .1, 0, 0, 0]}, {"type": "mirror-ball"}, {"type": "cube-face"}]
    for panorama in panoramas:
        b.json["cameras"].append({"type": "perspective", "perspective": {"yfov": .7, "znear": .1},
                                  "extensions": {"RELIEF_camera": {"panorama": panorama}}})
    for i in range(3):
        b.node(name=f"light {i}", rotation=[0, .7071, 0, .7071], extensions={"KHR_lights_punctual": {"light": i}})
    b.node(camera=0, translation=[0, 0, 4])
    for i in range(1, len(b.json["cameras"])):
        b.node(camera=i)
    profile = {"type": "ies-texture", "uri": "profile.ies", "inputs": {"strength": 2, "vector": [0, 0, 1]}}
    falloff = {"type": "light-falloff", "inputs": {"strength": {"node": 0}, "smooth": 1}}
    graph = {"nodes": [profile, falloff], "outputs": {"emission": {"node": 1, "output": "linear"}}}
    kinds[2]["extensions"] = {"RELIEF_light": {"radius": .1, "falloff": "smooth", "graph": graph}}
    area = {"shape": "disk", "radius": 2, "power": 10, "twoSided": True, "spread": 2}
    area["graph"] = {"nodes": [{"type": "texture-coordinate"}], "outputs": {"emission": {"node": 0, "output": "uv"}}}
    b.node(extensions={"RELIEF_area_light": area})
    hidden = {"castsShadow": False, "shadowCatcher": True, "lightsFootage": False, "multipleImportance": False}
    b.node(mesh=b.square(), extensions={"RELIEF_object": {**hidden, "causticCaster": "auto"}})
    return b


def animation():
    b = Builder()
    mesh = b.square()
    b.node(mesh=mesh, translation=[1, 2, 3], scale=[1, 2, 1])
    times = b.accessor("f", [0, 1], "SCALAR")
    outputs = {"translation": b.accessor("f", [0, 0, 0, 1, 0, 0], "VEC3"),
               "rotation": b.accessor("h", [0, 0, 0, 32767, 0, 32767, 0, 0], "VEC4", normalized=True),
               "scale": b.accessor("f", [0, 0, 0, 1, 1, 1, 0, 0, 0] * 2, "VEC3")}
    modes = {"translation": "LINEAR", "rotation": "STEP", "scale": "CUBICSPLINE"}
    b.json["animations"] = [{
        "channels": [{"sampler": i, "target": {"node": 0, "path": path}} for i, path in enumerate(outputs)],
        "samplers": [{"input": times, "output": output, "interpolation": modes[path]}
                     for path, output in outputs.items()]}]
    return b


def composition():
    b = Builder()
    offsets = b.accessor("f", [0, 0, 0, 2, 0, 0], "VEC3")
    turns = b.accessor("f", [0, 0, 0, 1, 0, 1, 0, 0], "VEC4")
    b.node(mesh=b.square(), extensions={
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": offsets, "ROTATION": turns}}})
    b.json["materials"] = [{"name": "red"}]
    override = {"square": {"translation": [1, 1, 1], "rotation": [0, 1, 0, 0], "material": "red"}}
    b.node(extensions={"RELIEF_reference": {"uri": "other.gltf", "node": "square", "overrides": override}})
    b.node(extensions={"RELIEF_reference": {"uri": "scene.gltf"}})
    return b


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for make in (plain, topologies, materials, graphs, closures, lights, animation, composition):
        (folder / f"{make.__name__}.gltf").write_bytes(make().gltf())
        (folder / f"{make.__name__}.glb").write_bytes(make().glb())
    numbers = "1 1000 1.5 4 3 {} 2 .1 .2 .3\n1 1 50\n{} 0 45 90\n0 45 90\n1 2 3 4\n5 6 7 8\n9 10 11 12\n"
    (folder / "c.ies").write_text("IESNA:LM-63-1995\n[TEST] A\nTILT=NONE\n" + numbers.format(1, -45))
    (folder / "b.ies").write_text("IESNA91\nTILT=INCLUDE\n1\n2\n0 90\n1 .5\n" + numbers.format(2, -90))
    (folder / "a.ies").write_text("TILT=lamp.tlt\n" + numbers.format(3, -90))


if __name__ == "__main__":
    main()
