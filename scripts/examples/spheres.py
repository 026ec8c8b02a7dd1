"""Twenty-four spheres: roughness from left to right, metallic from the front row to the back, under a studio sky."""

from . import images
from .gltf import Document, dielectric, lambert
from .meshes import quad, uv_sphere
from .vector import mix

COLUMNS, ROWS = 6, 4


def studio():
    """Radiance of a dim evening gradient with three soft boxes: key left, rim right, a strip behind the camera."""
    return images.layered(
        images.sky(horizon=(0.42, 0.40, 0.42), zenith=(0.10, 0.14, 0.24), ground=(0.10, 0.09, 0.08)),
        images.soft_box((-0.8, 0.75, 0.25), 0.42, 0.30, (9.0, 8.2, 7.0)),
        images.soft_box((0.95, 0.45, -0.35), 0.16, 0.40, (4.0, 5.0, 6.5)),
        images.soft_box((0.25, 0.5, 0.9), 0.60, 0.10, (3.0, 2.9, 2.7)),
    )


def build():
    document = Document("spheres", {"resolution": [768, 432], "samples": 64, "maxBounces": 8})
    document.set_environment("studio.hdr", images.environment(studio()))
    floor = document.add_material(lambert("floor", (0.105, 0.105, 0.115)))
    ground = quad((-60, 0, 60), (120, 0, 0), (0, 0, -120))
    document.add_node("floor", mesh=document.add_mesh("floor", ground, floor))

    stored = document.add_attributes(uv_sphere(0.44, 64, 32))
    plastic, gold = (0.02, 0.13, 0.20), (1.0, 0.62, 0.24)
    for row in range(ROWS):
        metallic = row / (ROWS - 1)
        for column in range(COLUMNS):
            roughness = column / (COLUMNS - 1)
            name = f"metallic {metallic:.2f} roughness {roughness:.1f}"
            material = document.add_material(
                dielectric(name, mix(plastic, gold, metallic), roughness, metallic)
            )
            mesh = document.add_mesh_like(name, stored, material)
            position = [1.05 * (column - (COLUMNS - 1) / 2), 0.44, 1.15 * ((ROWS - 1) / 2 - row)]
            document.add_node(name, mesh=mesh, translation=position)
    document.add_camera((0, 6.2, 8.4), (0, 0.22, -0.02), 24.5)
    return document
