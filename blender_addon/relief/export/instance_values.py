# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that objects and their instances have for value graphs, as Cycles has them.

A value is a pair (kind, name): ("color", ""), ("index", ""), ("random", "") of Object Info; ("generated", ""), ("uv", "") of
the instancer; ("particle", what) of Particle Info; ("object", name) or ("instancer", name), a property.
"""

import bpy
import numpy as np

from .attributes import hash_bits, hashed, to_unit

#: Nodes that read values; an Attribute node may.
_READERS = {"ShaderNodeObjectInfo", "ShaderNodeParticleInfo", "ShaderNodeTexCoord", "ShaderNodeUVMap", "ShaderNodeAttribute"}


def file_name(value):
    """What a value is called in the file."""
    kind, name = value
    return f"_{kind.upper()}_{name}" if name else f"_OBJECT_{kind.upper()}"


def are_read():
    """Whether any material or light of the file may read values, so that instances have to be looked at."""
    owners = [*bpy.data.materials, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners if owner.use_nodes and owner.node_tree is not None]
    trees += list(bpy.data.node_groups)
    return any(_reads(node) for tree in trees for node in tree.nodes)


def _reads(node):
    if node.bl_idname not in _READERS:
        return False
    if node.bl_idname == "ShaderNodeAttribute":
        return node.attribute_type in {"OBJECT", "INSTANCER"}
    return getattr(node, "from_instancer", True)


class Place:
    """What the depsgraph says of one place of an object, as long as its iterator stands there.

    parent    original bpy object that makes the instance; None: it is no instance
    particle  (its particle system's settings, the particle's values by their names in Particle Info); None: there is none
    """

    def __init__(self, instance, frame):
        self.is_instance = instance.is_instance
        self.random_id = instance.random_id & 0xFFFFFFFF
        self.orco = tuple(instance.orco) if self.is_instance else (1.0, 1.0, 1.0)
        # Blender gives instances the colour of what makes them.
        self.color = tuple(instance.object.color)
        self.uv = tuple(instance.uv) if self.is_instance else (0.0, 0.0)
        self.parent = instance.parent.original if self.is_instance and instance.parent is not None else None
        system = instance.particle_system if self.is_instance else None
        self.settings = system.settings.original if system is not None else None
        self.particle = _particle(system, instance.persistent_id[0], frame) if system is not None else None


def _particle(system, number, frame):
    if not 0 <= number < len(system.particles):
        return None  # a child of another
    particle = system.particles[number]
    return {
        "INDEX": float(number),
        "AGE": frame - particle.birth_time,
        "LIFETIME": particle.lifetime,
        "LOCATION": tuple(particle.location),
        "SIZE": particle.size,
        "VELOCITY": tuple(particle.velocity),
        "ANGULAR_VELOCITY": tuple(particle.angular_velocity),
    }


def read(value, shown, data, places):
    """A value at all places of an object.

    @param  shown   evaluated bpy object
    @param  data    its data, or the mesh that stands there instead
    @param  places  list of Place
    @return         float32 (places, 1 to 4)
    """
    kind, name = value
    count = len(places)
    if kind == "color":
        return np.array([place.color for place in places], dtype=np.float32)
    if kind == "index":
        return np.full((count, 1), shown.pass_index, dtype=np.float32)
    if kind == "random":
        return _random(shown, places)[:, None]
    if kind == "generated":
        return np.array([[0.5 * c - 0.5 for c in place.orco] for place in places], dtype=np.float32)
    if kind == "uv":
        return np.array([place.uv for place in places], dtype=np.float32)
    if kind == "particle":
        return _of_particles(name, places)
    properties = [_property(name, shown, data, place, kind == "instancer") for place in places]
    return np.array(properties, dtype=np.float32)


def randoms(shown, places, count):
    """Object Info's Random at the places of an object; as if they were no instances where `places` is empty.

    @return  float32 (count,)
    """
    if not places:
        return np.full(count, to_unit(hash_bits(_hashed_name(shown.name), 0)[0]), dtype=np.float32)
    return _random(shown, places)


def _random(shown, places):
    numbers = np.array([place.random_id for place in places], dtype=np.uint32)
    is_instance = np.array([place.is_instance for place in places])
    if not is_instance.all():
        numbers = np.where(is_instance, numbers, hash_bits(_hashed_name(shown.name), 0)[0])
    return to_unit(numbers)


def _hashed_name(name):
    number = 0
    for byte in name.encode():
        number = (number * 37 + byte) & 0xFFFFFFFF
    return number


def _of_particles(name, places):
    is_vector = name in {"LOCATION", "VELOCITY", "ANGULAR_VELOCITY"}
    if name == "RANDOM":
        numbers = [place.particle["INDEX"] if place.particle else 0.0 for place in places]
        return hashed(np.array(numbers, dtype=np.uint32), np.zeros(len(places), dtype=np.uint32))[:, None]
    nothing = (0.0, 0.0, 0.0) if is_vector else 0.0
    values = [place.particle[name] if place.particle else nothing for place in places]
    return np.array(values, dtype=np.float32).reshape(len(places), -1)


def _property(name, shown, data, place, asks_instancer):
    """A property by its name, with alpha: of what makes the instance, of the object, of its data; else 0."""
    owners = []
    if asks_instancer and place.is_instance:
        owners = [owner for owner in (place.settings, place.parent) if owner is not None]
    if name != "color":
        return look_up(name, [*owners, shown, data])
    found = look_up(name, owners)
    return place.color if found == NOTHING else found


#: What there is of a property that nothing has.
NOTHING = (0.0, 0.0, 0.0, 0.0)


def look_up(name, owners):
    """The first number, or two to four of them, that one of some things has by a name: (x, y, z, alpha)."""
    for owner in owners:
        for path in (f'["{name}"]', name):
            value = _resolve(owner, path)
            if value is not None:
                return value
    return NOTHING


def _resolve(owner, path):
    try:
        value = owner.path_resolve(path)
    except (ValueError, AttributeError):
        return None
    if isinstance(value, (bool, str)):
        return None
    if isinstance(value, (int, float)):
        return (float(value),) * 3 + (1.0,)
    try:
        numbers = [float(v) for v in value]
    except (TypeError, ValueError):
        return None
    if not 1 <= len(numbers) <= 4:
        return None
    return tuple(numbers + [0.0, 0.0, 0.0, 1.0][len(numbers) :])
