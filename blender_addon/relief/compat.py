# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between versions of Blender; nothing else in the add-on asks for the version.

Every function was run in 3.4.1. The branches for 4.0 and later follow Blender's release notes and API reference and
were not run.
"""

import bpy
import numpy as np

IS_4_0 = bpy.app.version >= (4, 0, 0)
IS_4_1 = bpy.app.version >= (4, 1, 0)

#: Names that sockets of the Principled BSDF got in 4.0, by the names of 3.4.
_PRINCIPLED_NAMES_4_0 = {
    "Subsurface": "Subsurface Weight",
    "Specular": "Specular IOR Level",
    "Transmission": "Transmission Weight",
    "Clearcoat": "Coat Weight",
    "Clearcoat Roughness": "Coat Roughness",
    "Clearcoat Normal": "Coat Normal",
    "Sheen": "Sheen Weight",
    "Emission": "Emission Color",
}

#: Before 4.0 the Principled BSDF multiplied its coat by Disney's factor of a quarter.
COAT_SCALE = 1.0 if IS_4_0 else 0.25


def principled_socket(node, name):
    """Input of a Principled BSDF by its name in 3.4; None if this version has no such input."""
    return node.inputs.get(_PRINCIPLED_NAMES_4_0.get(name, name) if IS_4_0 else name)


def sheen_color(base, sheen, tint):
    """Colour of the sheen layer.

    @param  base   base colour, linear RGB
    @param  sheen  weight
    @param  tint   before 4.0 a mix towards the base colour's hue; a colour since
    @return        linear RGB
    """
    if IS_4_0:
        return tuple(sheen * c for c in tint[:3])
    luminance = 0.2126 * base[0] + 0.7152 * base[1] + 0.0722 * base[2]
    hue = [c / luminance for c in base] if luminance > 0 else [1.0] * 3
    return tuple(min(1.0, sheen * (1 + tint * (h - 1))) for h in hue)


def displacement_method(material):
    """'BUMP', 'DISPLACEMENT' or 'BOTH': the material's own setting. It was Cycles' property before 4.1."""
    owner = material if IS_4_1 else getattr(material, "cycles", None)
    return getattr(owner, "displacement_method", "BUMP")


def set_displacement_method(material, method):
    """Sets what displacement_method returns."""
    owner = material if IS_4_1 else material.cycles
    owner.displacement_method = method


def corner_normals(mesh):
    """Normals of all corners, with flat faces, sharp edges and custom normals considered.

    @return  float32 of shape (loops, 3), object space, unit
    """
    normals = np.empty(3 * len(mesh.loops), dtype=np.float32)
    if IS_4_1:
        mesh.corner_normals.foreach_get("vector", normals)
    else:
        mesh.calc_normals_split()
        mesh.loops.foreach_get("normal", normals)
    return normals.reshape(-1, 3)


def vertex_normals(mesh):
    """Smooth normals: float32 of shape (vertices, 3), object space, unit."""
    normals = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("normal", normals)
    return normals.reshape(-1, 3)


def splits_normals(mesh):
    """Whether the mesh asks for hard edges besides flat faces: these stay hard under displacement."""
    if IS_4_1:
        return mesh.normals_domain == "CORNER" and mesh.has_custom_normals
    return mesh.use_auto_smooth


def engine_init(engine_class, engine, *arguments, **keywords):
    """Since 4.4 a render engine's __init__ has to be handed on; before, Blender does not expect it to be."""
    if bpy.app.version >= (4, 4, 0):
        super(engine_class, engine).__init__(*arguments, **keywords)


def casts_shadow(light):
    """Whether a light's shadows are on. It was Cycles' property before 4.2."""
    owner = light if hasattr(light, "use_shadow") and bpy.app.version >= (4, 2, 0) else getattr(light, "cycles", None)
    return getattr(owner, "use_shadow" if owner is light else "cast_shadow", True)


def is_portal(light):
    """Whether an area light only guides Cycles' sampling and does not shine."""
    return light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False)


def light_energy(light):
    """Blender's power of a light: watts, for a sun W/m². Since 4.5 lights have an exposure besides."""
    return light.energy * 2.0 ** getattr(light, "exposure", 0.0)
