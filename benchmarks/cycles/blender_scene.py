"""Builds a relief scene in Blender and renders it with Cycles; runs inside Blender 3.4 or 5.2.

    blender -b --factory-startup --debug-cycles --python blender_scene.py -- SCENE JOB.json

JOB.json is written by render_cycles.py, which says what its fields mean. Facts that the conversion rests on
(axes, light units, the environment's orientation, one-sidedness) are checked by check_importer.py.
"""

import json
import math
import os
import sys
import time

import bpy
import mathutils
import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from blender_materials import build_material, is_displaced  # noqa: E402
from gltf_reader import GltfFile, Unsupported  # noqa: E402

# From glTF's axes (Y up) to Blender's (Z up): x, y, z → x, −z, y. Applied to objects, not to vertices. A camera or
# a light looks along its own −Z with Y up in both conventions, so it needs nothing more.
BLENDER_FROM_GLTF = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def _add_object(name, data, matrix):
    new = bpy.data.objects.new(name, data)
    new.matrix_world = mathutils.Matrix((BLENDER_FROM_GLTF @ matrix).tolist())
    bpy.context.scene.collection.objects.link(new)
    # Both terminator softeners change the radiance; relief is compared with the plain rendering equation.
    new.cycles.shadow_terminator_offset = 0.0
    new.cycles.shadow_terminator_geometry_offset = 0.0
    return new


def build_mesh(gltf, primitive, name, material):
    """A Blender mesh of one primitive: its triangles, texture coordinates, and normals if it has any.

    Of a displaced primitive, vertices at one place become one, so that its seams stay closed when they move.
    """
    if primitive.get("mode", 4) != 4:
        raise Unsupported("a primitive that is not triangles")
    attributes = primitive["attributes"]
    unknown = set(attributes) - {"POSITION", "NORMAL", "TEXCOORD_0"}
    if unknown:
        raise Unsupported(f"attributes {', '.join(sorted(unknown))}")
    positions = gltf.accessor(attributes["POSITION"])
    corners = gltf.accessor(primitive["indices"]).astype(np.int32).ravel()
    num_triangles = len(corners) // 3
    corners_of_attributes = corners
    displaced = is_displaced(gltf.json["materials"][primitive["material"]])
    if displaced:
        positions, first, merged = np.unique(positions, axis=0, return_index=True, return_inverse=True)
        corners = merged.ravel()[corners].astype(np.int32)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(num_triangles)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(num_triangles, 3, dtype=np.int32))
    is_smooth = "NORMAL" in attributes
    mesh.polygons.foreach_set("use_smooth", np.full(num_triangles, is_smooth))
    if "TEXCOORD_0" in attributes:
        uv = gltf.accessor(attributes["TEXCOORD_0"])[corners_of_attributes].astype(np.float32)
        uv[:, 1] = 1.0 - uv[:, 1]  # Blender's v grows upwards
        mesh.uv_layers.new(name="TEXCOORD_0").data.foreach_set("uv", uv.ravel())
    mesh.materials.append(material)
    mesh.update(calc_edges=True)
    if displaced:
        _check_normals(mesh, gltf.accessor(attributes["NORMAL"])[first] if is_smooth else None)
    elif is_smooth:
        if bpy.app.version < (4, 1, 0):
            mesh.use_auto_smooth = True
            mesh.auto_smooth_angle = math.pi
        # Blender keeps custom normals as two 16-bit angles, an error of some 1e-4 radians.
        mesh.normals_split_custom_set_from_vertices(gltf.accessor(attributes["NORMAL"]).tolist())
    return mesh


def _check_normals(mesh, normals):
    """Cycles' subdivision displaces along the normals that Blender computes; others would be another surface."""
    computed = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("normal", computed)
    # Around thin triangles Blender's single precision errs by a few ten-thousandths.
    if normals is None or np.abs(computed.reshape(-1, 3) - normals).max() > 1e-3:
        raise Unsupported("a displaced mesh whose normals are not those that Blender computes")


def _dice(displaced_object):
    """Adaptive subdivision of flat triangles: the last modifier, which Cycles then does itself."""
    subdivision = displaced_object.modifiers.new("dicing", "SUBSURF")
    subdivision.subdivision_type = "SIMPLE"
    if bpy.app.version < (5, 0, 0):
        displaced_object.cycles.use_adaptive_subdivision = True
        displaced_object.cycles.dicing_rate = 1.0
    else:
        subdivision.use_adaptive_subdivision = True
        subdivision.adaptive_pixel_size = 1.0


def build_camera(gltf, node, matrix):
    camera = gltf.json["cameras"][node["camera"]]
    if camera["type"] != "perspective":
        raise Unsupported("an orthographic camera")
    lens = camera.get("extensions", {}).get("RELIEF_camera", {})
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "VERTICAL"
    data.sensor_height = 24.0
    data.lens = 12.0 / math.tan(camera["perspective"]["yfov"] / 2)
    if lens.get("shift", [0, 0]) != [0, 0] or "clip" in lens:
        raise Unsupported("camera shift or clipping")
    if "pixelAspect" in lens or "panorama" in lens:
        raise Unsupported("pixels that are not square, or a panorama")
    data.clip_start, data.clip_end = 1e-4, 1e6
    radius = lens.get("apertureRadius", 0)
    if radius > 0:
        data.dof.use_dof = True
        data.dof.focus_distance = lens.get("focusDistance", 1)
        data.dof.aperture_fstop = data.lens * 1e-3 / (2 * radius)
        data.dof.aperture_blades, data.dof.aperture_rotation = lens.get("apertureBlades", 0), lens.get("apertureRotation", 0)
        data.dof.aperture_ratio = lens.get("apertureRatio", 1)
    bpy.context.scene.camera = _add_object("camera", data, matrix)


def build_area_light(light, matrix):
    """RELIEF_area_light. Blender's watts are not ours: its radiance is watts / (4 · area), not power / (π · area)."""
    if light.get("twoSided", False):
        raise Unsupported("a two-sided area light")
    data = bpy.data.lights.new("area light", "AREA")
    if light["shape"] == "rectangle":
        data.shape = "RECTANGLE"
        data.size, data.size_y = light.get("width", 1), light.get("height", 1)
        area = data.size * data.size_y
    else:
        data.shape = "DISK"
        data.size = 2 * light.get("radius", 0.5)
        area = math.pi * (data.size / 2) ** 2
    scales = np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.allclose(scales, 1, atol=1e-5):
        raise Unsupported("a scaled area light")
    radiance = light["power"] / (math.pi * area) if "power" in light else light["radiance"]
    data.energy = 4 * area * radiance
    data.color = light.get("color", (1, 1, 1))
    data.spread = math.pi
    new = _add_object("area light", data, matrix)
    new.visible_camera = light.get("visibleToCamera", True)


def build_punctual_light(light, matrix, efficacy):
    """KHR_lights_punctual: a sun's irradiance is Blender's strength; a point of I W/sr has 4π · I watts."""
    intensity = light.get("intensity", 1) / efficacy
    if light["type"] == "directional":
        data = bpy.data.lights.new("sun", "SUN")
        data.angle = 0.0
        data.energy = intensity
    elif light["type"] == "point":
        data = bpy.data.lights.new("point", "POINT")
        data.shadow_soft_size = 0.0
        data.energy = 4 * math.pi * intensity
    else:
        raise Unsupported("a spot light: its cone fades by another law")
    data.color = light.get("color", (1, 1, 1))
    _add_object(data.name, data, matrix)


def build_environment(gltf):
    """A lat-long map as docs/scene_format.md orients it, or a constant; black without one."""
    settings = gltf.json.get("extensions", {}).get("RELIEF_environment")
    world = bpy.data.worlds.new("environment")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = nodes["Background"]
    if settings is None:
        background.inputs["Strength"].default_value = 0.0
        return
    color = settings.get("color", [1, 1, 1])
    background.inputs["Strength"].default_value = settings.get("strength", 1)
    background.inputs["Color"].default_value = (*color, 1)
    if "uri" in settings or "image" in settings:
        if color != [1, 1, 1]:
            raise Unsupported("a tinted environment map")
        uri = settings.get("uri") or gltf.json["images"][settings["image"]]["uri"]
        texture = nodes.new("ShaderNodeTexEnvironment")
        texture.image = bpy.data.images.load(os.path.join(gltf.folder, uri))
        texture.image.colorspace_settings.name = "Linear" if bpy.app.version < (4, 0, 0) else "Linear Rec.709"
        coordinates = nodes.new("ShaderNodeTexCoord")
        # The centre of Cycles' map looks along Blender's +X, that of ours along glTF's −Z, which is Blender's +Y.
        mapping = nodes.new("ShaderNodeMapping")
        mapping.vector_type = "POINT"
        mapping.inputs["Rotation"].default_value = (0, 0, -math.pi / 2 - settings.get("rotation", 0))
        links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
        links.new(texture.outputs["Color"], background.inputs["Color"])
    world.cycles_visibility.camera = settings.get("visibleToCamera", True)


def build_scene(path):
    """Makes the whole scene in an empty Blender; returns what of it is only approximate, each reason once."""
    gltf = GltfFile(path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build_environment(gltf)
    built = [build_material(gltf, i) for i in range(len(gltf.json.get("materials", [])))]
    top = gltf.json.get("extensions", {})
    efficacy = top.get("RELIEF_render", {}).get("luminousEfficacy", 1)
    meshes = {}
    for node, matrix in gltf.node_matrices():
        extensions = node.get("extensions", {})
        if "mesh" in node:
            source = gltf.json["meshes"][node["mesh"]]
            if node["mesh"] not in meshes:
                name = source.get("name", f"mesh {node['mesh']}")
                meshes[node["mesh"]] = [
                    build_mesh(gltf, primitive, name, built[primitive["material"]][0])
                    for primitive in source["primitives"]
                ]
            for world in gltf.instance_matrices(node, matrix):
                for mesh, primitive in zip(meshes[node["mesh"]], source["primitives"]):
                    new = _add_object(node.get("name", "node"), mesh, world)
                    if is_displaced(gltf.json["materials"][primitive["material"]]):
                        _dice(new)
        if "camera" in node and bpy.context.scene.camera is None:
            build_camera(gltf, node, matrix)
        if "RELIEF_area_light" in extensions:
            build_area_light(extensions["RELIEF_area_light"], matrix)
        if "KHR_lights_punctual" in extensions:
            light = top["KHR_lights_punctual"]["lights"][extensions["KHR_lights_punctual"]["light"]]
            build_punctual_light(light, matrix, efficacy)
    set_up_render(top.get("RELIEF_render", {}))
    return sorted({reason for _, reasons in built for reason in reasons})


def set_up_render(settings):
    """Cycles as an unbiased path tracer: the same filter and limits as relief's, nothing clamped or denoised."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_percentage = 100
    scene.render.resolution_x, scene.render.resolution_y = settings.get("resolution", (960, 540))
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.dither_intensity = 0
    if bpy.app.version >= (5, 0, 0):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "NONE"
    cycles = scene.cycles
    cycles.device = "CPU"
    # Triangles of one pixel, and of Blender's own four outside the picture.
    if bpy.app.version < (5, 0, 0):
        cycles.feature_set = "EXPERIMENTAL"  # adaptive subdivision was
    cycles.dicing_rate = 1.0
    cycles.samples = settings.get("samples", 64)
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.light_sampling_threshold = 0
    cycles.blur_glossy = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_auto_tile = False
    bounces = settings.get("maxBounces", 12)
    cycles.max_bounces = bounces
    cycles.diffuse_bounces = settings.get("diffuseBounces", bounces)
    cycles.glossy_bounces = settings.get("glossyBounces", bounces)
    cycles.transmission_bounces = settings.get("transmissionBounces", bounces)
    cycles.transparent_max_bounces = settings.get("transparentBounces", 32)
    cycles.volume_bounces = 0


def use_manifold_sampling():
    """Cycles' shadow caustics (MNEE): glass casts, everything else receives, all lights take part."""
    for thing in bpy.context.scene.objects:
        if thing.type == "LIGHT":
            thing.data.cycles.is_caustics_light = True
        elif thing.type == "MESH":
            casts = any(
                node.type in {"BSDF_GLASS", "BSDF_REFRACTION"} or (
                    node.type == "BSDF_PRINCIPLED" and node.inputs["Transmission"].default_value > 0)
                for slot in thing.material_slots if slot.material for node in slot.material.node_tree.nodes)
            thing.cycles.is_caustics_caster = casts
            thing.cycles.is_caustics_receiver = not casts


def render(job):
    """Renders one picture a seed; prints a line `RUN {json}` for each.

    A render of one sample before the timed ones takes what only the first one pays: file and colour set-up.
    """
    scene = bpy.context.scene
    if job.get("resolution"):
        scene.render.resolution_x, scene.render.resolution_y = job["resolution"]
    if job.get("threads"):
        scene.render.threads_mode = "FIXED"
        scene.render.threads = job["threads"]
    for run in job["runs"]:
        scene.cycles.samples = run["samples"]
        scene.cycles.seed = run["seed"]
        scene.render.filepath = run["output"]
        start, processor_start = time.monotonic(), time.process_time()
        bpy.ops.render.render(write_still=True)
        run["wall_seconds"] = time.monotonic() - start
        run["processor_seconds"] = time.process_time() - processor_start
        print("RUN " + json.dumps(run), flush=True)


def main():
    scene_path, job_path = sys.argv[sys.argv.index("--") + 1 :]
    with open(job_path, encoding="utf-8") as file:
        job = json.load(file)
    start = time.monotonic()
    approximate = build_scene(scene_path)
    print("SCENE " + json.dumps({"approximate": approximate, "import_seconds": time.monotonic() - start}), flush=True)
    if job.get("manifold"):
        use_manifold_sampling()
    if job.get("blend"):
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(job["blend"]))
    render(job)


if __name__ == "__main__":
    main()
