"""The scenes of the comparison: examples that both renderers can mean exactly, and two variants made so.

`environment`  the spheres under the studio map, but diffuse and mirror-like only
`glass_smooth` the glass still life without the frosted sphere, under the sky alone: a small lamp's caustics would
               give both renderers noise too heavy-tailed to compare means with
"""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts"))

from examples import cornell, glass, gltf, images, instances, many_lights, meshes, spheres  # noqa: E402


def environment():
    """Diffuse and perfectly smooth metal spheres, alternating, on the example's floor."""
    document = gltf.Document("environment", {"resolution": [768, 432], "samples": 64, "maxBounces": 8})
    document.set_environment("studio.hdr", images.environment(spheres.studio()))
    floor = document.add_material(gltf.lambert("floor", (0.4, 0.4, 0.4)))
    ground = meshes.quad((-60, 0, 60), (120, 0, 0), (0, 0, -120))
    document.add_node("floor", mesh=document.add_mesh("floor", ground, floor))
    stored = document.add_attributes(meshes.uv_sphere(0.44, 128, 64))
    materials = [
        document.add_material(gltf.lambert("white", (0.8, 0.8, 0.8))),
        document.add_material(gltf.metal("gold", (1.0, 0.62, 0.24), 0.0)),
        document.add_material(gltf.lambert("blue", (0.05, 0.2, 0.6))),
        document.add_material(gltf.metal("silver", (0.95, 0.93, 0.88), 0.0)),
    ]
    balls = [document.add_mesh_like(f"ball {i}", stored, material) for i, material in enumerate(materials)]
    for row in range(4):
        for column in range(6):
            position = [1.05 * (column - 2.5), 0.441, 1.15 * (1.5 - row)]
            document.add_node("ball", mesh=balls[(row + column) % 4], translation=position)
    document.add_camera((0, 6.2, 8.4), (0, 0.22, -0.02), 24.5)
    return document


def glass_smooth():
    """The example's scene with its rough sphere made smooth and its area light left out."""
    document = glass.build()
    document.name = "glass_smooth"
    for material in document.gltf["materials"]:
        if "KHR_materials_transmission" in material.get("extensions", {}):
            material["pbrMetallicRoughness"]["roughnessFactor"] = 0
    nodes = document.gltf["nodes"]
    kept = [i for i, node in enumerate(nodes) if "RELIEF_area_light" not in node.get("extensions", {})]
    document.gltf["scenes"][0]["nodes"] = kept
    return document


SCENES = {
    "cornell": cornell.build,
    "instances": instances.build,
    "many_lights": many_lights.build,
    "environment": environment,
    "glass_smooth": glass_smooth,
}
