# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as RELIEF_environment: a colour, or a lat-long image turned about Z."""

from .. import compat
from . import nodes
from .axes import environment_rotation
from .texture import MISSING


def export_world(world, visible_to_camera, writer, images, report):
    """Adds the surroundings. Without a world, or with a black one, there is none.

    @param  world              bpy world or None
    @param  visible_to_camera  False: films with a transparent background
    @param  writer             GltfWriter
    @param  images             ImageExporter
    @param  report             Report
    """
    if world is None:
        environment = {"color": [0.0, 0.0, 0.0]}
    else:
        environment = _environment(world, images, lambda *text: report.warn(f'world "{world.name}"', *text))
    environment["visibleToCamera"] = visible_to_camera and (world is None or compat.sees_world(world, "camera"))
    for ray in ("diffuse", "glossy", "transmission"):
        if world is not None and not compat.sees_world(world, ray):
            environment[f"visibleTo{ray.capitalize()}"] = False
    if world is not None and not world.relief.caustic_light:
        environment["causticLight"] = False
    writer.extend(writer.json, "RELIEF_environment", environment)


def _environment(world, images, warn):
    if not world.use_nodes:
        return {"color": [max(0.0, c) for c in nodes.finite(tuple(world.color), "its colour", warn)]}
    output = nodes.active_output(world.node_tree, "ShaderNodeOutputWorld")
    if output and nodes.follow(output.inputs["Volume"]) is not None:
        warn("a volume", "it is left out")
    source = nodes.follow(output.inputs["Surface"]) if output else None
    if source is None:
        return {"color": [0.0, 0.0, 0.0]}
    node = source.node
    if node.bl_idname not in {"ShaderNodeBackground", "ShaderNodeEmission"}:
        warn(f'node "{node.name}" ({node.bl_label}) as surface', "black was used")
        return {"color": [0.0, 0.0, 0.0]}
    reader = nodes.Reader(warn, source.groups)
    strength = max(0.0, reader.number(node.inputs["Strength"]))
    if strength == 0:
        return {"color": [0.0, 0.0, 0.0]}
    color = nodes.follow(node.inputs["Color"], source.groups)
    if color is None or color.node.bl_idname != "ShaderNodeTexEnvironment":
        value = reader.color(node.inputs["Color"])
        return {"color": [max(0.0, c) for c in value], "strength": strength}
    texture = color.node
    if texture.image is None:
        return {"color": list(MISSING), "strength": strength}
    if texture.projection != "EQUIRECTANGULAR":
        warn(f'node "{texture.name}": projection {texture.projection.lower()}', "equirectangular was used")
    if texture.interpolation != "Linear":
        warn(f'node "{texture.name}": interpolation {texture.interpolation}', "Linear was used")
    uri = images.color_uri(texture.image, texture.image_user, warn)
    if uri is None:
        return {"color": list(MISSING), "strength": strength}
    rotation = environment_rotation(_turn_about_z(texture, color.groups, warn))
    return {"uri": uri, "strength": strength, "rotation": rotation}


def _turn_about_z(texture, groups, warn):
    """Radians by which the texture's direction is turned about Z; what else is done to it is warned about."""
    vector = nodes.follow(texture.inputs["Vector"], groups)
    if vector is None:
        return 0.0
    node = vector.node
    if node.bl_idname == "ShaderNodeTexCoord":
        if vector.socket.name not in {"Generated", "Object"}:
            warn(f'texture coordinate "{vector.socket.name}" of the environment', "the direction was used")
        return 0.0
    if node.bl_idname != "ShaderNodeMapping":
        warn(f'node "{node.name}" ({node.bl_label}) before the environment texture', "the direction was used")
        return 0.0
    reader = nodes.Reader(warn, vector.groups)
    rotation = reader.vector(node.inputs["Rotation"])
    moved = reader.vector(node.inputs["Location"]) if "Location" in node.inputs else (0, 0, 0)
    scaled = reader.vector(node.inputs["Scale"])
    if any(rotation[:2]) or any(moved) or any(s != 1 for s in scaled):
        warn("an environment moved, scaled or turned about X or Y", "its turn about Z alone was used")
    # Texture mapping applies the inverse, a turn the other way.
    return -rotation[2] if node.vector_type == "TEXTURE" else rotation[2]
