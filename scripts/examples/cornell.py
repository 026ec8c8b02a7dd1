"""The Cornell box: a square emissive mesh under the ceiling, two boxes, nothing but diffuse surfaces."""

from . import vector
from .gltf import Document, emitter, lambert
from .meshes import box, joined, quad


def build():
    document = Document("cornell", {"resolution": [512, 512], "samples": 64, "maxBounces": 8})
    white = document.add_material(lambert("white", (0.725, 0.71, 0.68)))
    red = document.add_material(lambert("red", (0.63, 0.065, 0.05)))
    green = document.add_material(lambert("green", (0.14, 0.45, 0.091)))
    lamp = document.add_material(emitter("lamp", (27.0, 21.0, 14.0)))

    shell = joined(
        [
            quad((-1, 0, 1), (2, 0, 0), (0, 0, -2)),
            quad((-1, 2, -1), (2, 0, 0), (0, 0, 2)),
            quad((-1, 0, -1), (2, 0, 0), (0, 2, 0)),
        ]
    )
    document.add_node("shell", mesh=document.add_mesh("shell", shell, white))
    left = quad((-1, 0, 1), (0, 0, -2), (0, 2, 0))
    right = quad((1, 0, -1), (0, 0, 2), (0, 2, 0))
    document.add_node("left wall", mesh=document.add_mesh("left wall", left, red))
    document.add_node("right wall", mesh=document.add_mesh("right wall", right, green))
    # The front of the lamp looks down; 1 cm below the ceiling, which it would otherwise cross.
    light = quad((-0.25, 1.99, -0.22), (0.5, 0, 0), (0, 0, 0.44))
    document.add_node("lamp", mesh=document.add_mesh("lamp", light, lamp))

    up = (0.0, 1.0, 0.0)
    tall = document.add_mesh("tall box", box((0.6, 1.2, 0.6)), white)
    short = document.add_mesh("short box", box((0.6, 0.6, 0.6)), white)
    document.add_node(
        "tall box", mesh=tall, translation=[-0.34, 0, -0.29], rotation=list(vector.axis_angle(up, 17))
    )
    document.add_node(
        "short box", mesh=short, translation=[0.33, 0, 0.37], rotation=list(vector.axis_angle(up, -17))
    )
    document.add_camera((0, 1, 3.9), (0, 1, 0), 39.5)
    return document
