# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between versions of Blender; nothing else in the add-on asks for the version.

Checked against 3.4.1, 4.3.2 and 5.2.2, as Debian 12, 13 and unstable package them.
"""

import math
from dataclasses import dataclass

import bpy
import numpy as np

IS_4_0 = bpy.app.version >= (4, 0, 0)
IS_4_1 = bpy.app.version >= (4, 1, 0)
IS_5_0 = bpy.app.version >= (5, 0, 0)
IS_5_2 = bpy.app.version >= (5, 2, 0)

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

#: Names that passes got in 5.0, by the names before.
_PASS_NAMES_5_0 = {
    "DiffDir": "Diffuse Direct",
    "DiffInd": "Diffuse Indirect",
    "DiffCol": "Diffuse Color",
    "GlossDir": "Glossy Direct",
    "GlossInd": "Glossy Indirect",
    "GlossCol": "Glossy Color",
    "TransDir": "Transmission Direct",
    "TransInd": "Transmission Indirect",
    "TransCol": "Transmission Color",
    "Emit": "Emission",
    "Env": "Environment",
    "AO": "Ambient Occlusion",
    "VolumeDir": "Volume Direct",
    "VolumeInd": "Volume Indirect",
}

#: The version whose closures Cycles has, as RELIEF_surface calls it.
MATHS = "5.2" if IS_5_0 else "4.3" if IS_4_0 else "3.4"

#: What faces of a slot without material look like, as a closure; None: diffuse grey. Since 5.0 it is the plastic of a new
#: material.
DEFAULT_CLOSURE = {"type": "principled", "maths": MATHS, "roughness": 0.5} if IS_5_0 else None

#: Inputs of the principled closure by Blender's names: what there is besides anisotropy, emission and alpha.
PRINCIPLED_INPUTS = (
    {
        "Base Color": "baseColor",
        "Metallic": "metallic",
        "Roughness": "roughness",
        "IOR": "ior",
        "Diffuse Roughness": "diffuseRoughness",
        "Subsurface Weight": "subsurfaceWeight",
        "Specular IOR Level": "specularIorLevel",
        "Specular Tint": "specularTint",
        "Transmission Weight": "transmissionWeight",
        "Coat Weight": "coatWeight",
        "Coat Roughness": "coatRoughness",
        "Coat IOR": "coatIor",
        "Coat Tint": "coatTint",
        "Sheen Weight": "sheenWeight",
        "Sheen Roughness": "sheenRoughness",
        "Sheen Tint": "sheenTint",
        "Thin Film Thickness": "thinFilmThickness",
        "Thin Film IOR": "thinFilmIor",
        "Normal": "normal",
        "Coat Normal": "coatNormal",
    }
    if IS_4_0
    else {
        "Base Color": "baseColor",
        "Subsurface": "subsurface",
        "Subsurface Color": "subsurfaceColor",
        "Metallic": "metallic",
        "Specular": "specular",
        "Specular Tint": "specularTint",
        "Roughness": "roughness",
        "Sheen": "sheen",
        "Sheen Tint": "sheenTint",
        "Clearcoat": "clearcoat",
        "Clearcoat Roughness": "clearcoatRoughness",
        "IOR": "ior",
        "Transmission": "transmission",
        "Transmission Roughness": "transmissionRoughness",
        "Normal": "normal",
        "Clearcoat Normal": "clearcoatNormal",
    }
)

#: Further inputs of the principled closure where light goes below the surface.
SUBSURFACE_INPUTS = {
    "Subsurface Radius": "subsurfaceRadius",
    "Subsurface Scale": "subsurfaceScale",
    "Subsurface IOR": "subsurfaceIor",
    "Subsurface Anisotropy": "subsurfaceAnisotropy",
}

#: How light goes below surfaces, as RELIEF_surface calls it. What 4.0 calls skin was the plain random walk before, and 5.2 has a new
#: one.
SUBSURFACE_METHODS = {
    "RANDOM_WALK_FIXED_RADIUS": "random-walk-legacy",
    "RANDOM_WALK_LEGACY": "random-walk-legacy",
    "RANDOM_WALK": "random-walk" if IS_5_2 else "random-walk-legacy" if IS_4_0 else "random-walk-skin",
    "RANDOM_WALK_SKIN": "random-walk-skin",
    "BURLEY": "christensen-burley",
}

#: Before 4.5 an Emission node in a volume, and what a Principled Volume emits, shines as bright whatever Mix Shaders take of it.
MIXES_WEIGH_VOLUME_EMISSION = bpy.app.version >= (4, 5, 0)

#: Before 4.0 Cycles took a Principled BSDF's emission for a node of its own, which shines in a volume as well.
PRINCIPLED_EMITS_IN_VOLUMES = not IS_4_0

#: Before 4.0 the octaves of a Noise Texture never grew.
CLAMPS_NOISE_ROUGHNESS = not IS_4_0

#: Before 4 Vector Transform turned normals as if they were directions, and Normal Map mixed by its Strength in the world.
NORMALS_KEEP_UPRIGHT = TANGENT_STRENGTH = IS_4_0

#: Since 5.0 tangent normal maps stand over a normal of unit length; before, over what interpolation leaves of it.
NORMAL_MAPS_OVER_UNIT_NORMALS = IS_5_0

#: Since 4.5 tangents that lack a uv map run around the mesh as it is; before, as it was at rest.
TANGENTS_AROUND_THE_REST = bpy.app.version < (4, 5, 0)

#: Since 5.0 they also do so across the line where longitudes begin anew; before, faces there had them the wrong way round.
LONGITUDES_ARE_JOINED = IS_5_0

#: Footprints away that the bump of a displacement asks for heights, and a Bump node that has no Filter Width.
BUMP_WIDTH = 0.1 if IS_5_0 else 1.0

#: Up to 3.5 Bump nodes themselves bend normals back until the viewer is reflected above the surface; then closures alone do.
BUMP_REFLECTS_ABOVE = bpy.app.version < (3, 6, 0)

#: Since 5.0 a negative power of 0 is 0; before, without end.
NEGATIVE_POWERS_OF_0_ARE_0 = IS_5_0

#: Before 4 the Hue/Saturation node cut whole turns off towards 0, so that hues below 0 stayed below.
HUE_GOES_ROUND = IS_4_0

#: The version whose Cycles judges noise as this one's does, as RELIEF_render calls it.
NOISE_MATHS = "4.3" if bpy.app.version >= (3, 5, 0) else "3.4"

#: Whose numbers the textures of this version have, as RELIEF_graph calls them; None: those of 3.4.
TEXTURE_MATHS = "5.2" if IS_5_0 else "4.3" if IS_4_0 else None

#: Since 5.2 a missing image is magenta outside of 0…1 too, where an image that is there would be cut off.
MISSING_IS_NOT_CLIPPED = IS_5_2

#: Since 5.2 Cycles takes an image's colours for multiplied by alpha if its alpha mode says so; before, if its file did.
ALPHA_BY_MODE = IS_5_2

#: Where the values of OpenVDB's voxels stand, as RELIEF_graph calls it.
VOXEL_PLACES = "corners" if IS_5_0 else "centers"

#: Entries of the tables that stand for ramps and curves, as many as Cycles'. Checked in 3.4 and 4.3.
TABLE_ENTRIES = 257 if IS_4_0 else 256

#: Since 4.1 Cycles reads IES files of type A.
IES_HAS_TYPE_A = IS_4_1


def normal_map_base(normal_map):
    """Over which surface a Normal Map node stands where one is displaced: "original" or "displaced", whose tangents are then
    moved too. None: before 5.2 over the displaced one, with tangents of before."""
    base = getattr(normal_map, "base", None)
    return base and base.lower()


def is_green_down(normal_map):
    """Whether the green of a Normal Map node counts downwards, as DirectX has it; it came with 5.1."""
    return getattr(normal_map, "convention", "OPENGL") == "DIRECTX"


def bump_width(bump):
    """How many footprints away a Bump node asks for heights; it became an input after 4.3."""
    socket = bump.inputs.get("Filter Width")
    return BUMP_WIDTH if socket is None else min(max(socket.default_value, 1e-3), 1e3)


def sky_kind(sky):
    """Which sky a Sky Texture is, as RELIEF_graph calls it; None: one that is not known."""
    return {
        "NISHITA": "nishita",
        "SINGLE_SCATTERING": "single-scattering",
        "MULTIPLE_SCATTERING": "multiple-scattering",
        "PREETHAM": "preetham",
        "HOSEK_WILKIE": "hosek-wilkie",
    }.get(sky.sky_type)


def principled_socket(node, name):
    """Input of a Principled BSDF by its name in 3.4; None if this version has no such input."""
    return node.inputs.get(_PRINCIPLED_NAMES_4_0.get(name, name) if IS_4_0 else name)


def pass_name(name):
    """This version's name of a render pass, by its name in 3.4."""
    return _PASS_NAMES_5_0.get(name, name) if IS_5_0 else name


def displacement_owner(material):
    """What has a material's `displacement_method`: before 4.1 it was Cycles' property."""
    return material if IS_4_1 else getattr(material, "cycles", None)


def has_transparent_shadow(material):
    """Whether light passes where a material is transparent. Before 4.2 it was Cycles' property."""
    for owner in (material, getattr(material, "cycles", None)):
        if hasattr(owner, "use_transparent_shadow"):
            return owner.use_transparent_shadow
    return True


def displacement_method(material):
    """'BUMP', 'DISPLACEMENT' or 'BOTH': the material's own setting."""
    return getattr(displacement_owner(material), "displacement_method", "BUMP")


def set_displacement_method(material, method):
    """Sets what displacement_method returns."""
    displacement_owner(material).displacement_method = method


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


def has_vertex_normals(mesh):
    """Whether all corners at each vertex have its normal: all faces are smooth, and nothing asks for hard edges."""
    if IS_4_1:
        return mesh.normals_domain == "POINT"
    if mesh.use_auto_smooth:
        return False
    is_smooth = np.empty(len(mesh.polygons), dtype=bool)
    mesh.polygons.foreach_get("use_smooth", is_smooth)
    return bool(is_smooth.all())


def splits_normals(mesh):
    """Whether the mesh asks for hard edges besides flat faces: these stay hard under displacement."""
    if IS_4_1:
        sharp = mesh.attributes.get("sharp_edge")
        if sharp is None or sharp.domain != "EDGE":
            return mesh.has_custom_normals
        values = np.empty(len(sharp.data), dtype=bool)
        sharp.data.foreach_get("value", values)
        return mesh.has_custom_normals or bool(values.any())
    return mesh.use_auto_smooth


def set_pixels(render_pass, values):
    """Hands pixels to a pass of a render result.

    @param  values  float32 of shape (pixels, channels), C-contiguous, bottom row first
    """
    # An assignment, which every version takes, is slower by a factor of 300.
    render_pass.rect.foreach_set(values.ravel() if IS_4_0 else values)


def engine_init(engine_class, engine, *arguments, **keywords):
    """Since 4.4 a render engine's __init__ has to be handed on; before, Blender does not expect it to be."""
    if bpy.app.version >= (4, 4, 0):
        super(engine_class, engine).__init__(*arguments, **keywords)


#: How spots fade towards their rim, as RELIEF_light calls it.
SPOT_FALLOFF = "smooth" if IS_4_0 else "smooth-cosine"

#: A spot's cone is stretched by the scale of its object.
SPOTS_ARE_SCALED = IS_4_0

#: Area lights spread by as little as nothing; before, by a degree.
SPREADS_TO_NOTHING = IS_4_0

#: Lights have coordinates of their surface.
LIGHTS_HAVE_UV = IS_4_0

#: Lights have a space of their own, and properties, as other objects.
LIGHTS_ARE_OBJECTS = IS_5_0

#: An area light of P watts and area A has the radiance P / (this · A).
AREA_DIVISOR = math.pi if IS_4_0 else 4.0


#: Whether a sun shines evenly from a flat disk across its direction, so that its rim is brighter: before 4.0.
SUNS_ARE_FLAT = not IS_4_0


def panorama_of(camera):
    """Owner of a camera's panoramic properties: Cycles' settings before 5.0; None without Cycles there."""
    return camera if hasattr(camera, "panorama_type") else getattr(camera, "cycles", None)


def casts_shadow(light):
    """Whether a light's shadows are on. It was Cycles' property before 4.2."""
    owner = light if hasattr(light, "use_shadow") and bpy.app.version >= (4, 2, 0) else getattr(light, "cycles", None)
    return getattr(owner, "use_shadow" if owner is light else "cast_shadow", True)


def links_light(shown):
    """Whether an object lights, or is shadowed by, some collection alone; it came with 4.0."""
    linking = getattr(shown, "light_linking", None)
    return linking is not None and (linking.receiver_collection or linking.blocker_collection) is not None


def is_portal(light):
    """Whether an area light only guides Cycles' sampling and does not shine."""
    return light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False)


def dices(scene):
    """Whether Cycles dices objects that ask for it. Experimental before 5.0."""
    return IS_5_0 or getattr(getattr(scene, "cycles", None), "feature_set", None) == "EXPERIMENTAL"


def dicing_modifier(shown, scene):
    """The Subdivision modifier of an object that Cycles dices to the picture; None: there is none."""
    last = shown.modifiers[-1] if shown.modifiers else None
    if last is None or last.type != "SUBSURF" or not last.show_render:
        return None
    if IS_5_0:
        return last if last.use_adaptive_subdivision else None
    return last if dices(scene) and shown.cycles.use_adaptive_subdivision else None


#: Max Subdivisions if nobody sets it. It is there so that memory has an end; the program knows its own.
_USUAL_SUBDIVISIONS = 12


@dataclass(frozen=True)
class Dicing:
    """How finely Cycles dices an object.

    pixels      sides of its faces in the picture; None: `length` is
    length      sides of its faces, in the object's own space
    outside     how many times as long they may be out of the picture
    most_cells  along each side of a face, a power of two; None: no fewer than Blender's usual 4096
    """

    pixels: float | None
    length: float | None
    outside: float
    most_cells: int | None


def dicing_of(shown, scene, cycles, least_pixels=0.1):
    """Dicing of an object; None if Cycles does not dice it.

    @param  cycles        Cycles' settings of the scene; None: as they usually are
    @param  least_pixels  no finer; Cycles has a tenth
    """
    modifier = dicing_modifier(shown, scene)
    if modifier is None:
        return None
    rate = getattr(cycles, "dicing_rate", 1.0)
    pixels, length = rate * (modifier.adaptive_pixel_size if IS_5_0 else shown.cycles.dicing_rate), None
    if IS_5_0 and modifier.adaptive_space == "OBJECT":
        pixels, length = None, rate * modifier.adaptive_object_edge_length
    subdivisions = getattr(cycles, "max_subdivisions", _USUAL_SUBDIVISIONS)
    return Dicing(
        None if pixels is None else max(pixels, least_pixels),
        length,
        max(getattr(cycles, "offscreen_dicing_scale", 4.0), 1.0),
        1 << subdivisions if subdivisions < _USUAL_SUBDIVISIONS else None,
    )


def light_energy(light, scale=(1.0, 1.0)):
    """Blender's power of a light: watts, for a sun W/m². Since 4.5 lights have an exposure besides, and may mean what they are
    given for a unit of what shines: the larger, the more.

    @param  scale  of the light's object along X and Y, which area lights follow
    """
    energy = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    return energy if getattr(light, "normalize", True) else energy * _shining_area(light, scale)


def _shining_area(light, scale):
    """What Cycles divides by where a light's power is for all of it; a sun has that of a disk a metre away."""
    if light.type == "AREA":
        area = light.size * scale[0] * (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size) * scale[1]
        return area * math.pi / 4 if light.shape in {"DISK", "ELLIPSE"} else area
    if light.type == "SUN":
        return math.pi * math.sin(light.angle / 2) ** 2 if light.angle > 0 else 1.0
    return 4 * math.pi * light.shadow_soft_size**2 if light.shadow_soft_size > 0 else 4.0


def light_color(light):
    """A light's colour; since 4.5 it may be that of a black body, tinted."""
    color = tuple(light.color)
    if not getattr(light, "use_temperature", False):
        return color
    return tuple(a * b for a, b in zip(color, light.temperature_color))


def has_multiple_importance(light):
    """Whether rays that scatter meet a light, too."""
    return getattr(getattr(light, "cycles", None), "use_multiple_importance_sampling", True)


def is_met_by_rays(light):
    """Whether rays that scatter meet a light that has a size."""
    size = {"AREA": 1.0, "SUN": getattr(light, "angle", 0.0)}.get(light.type, getattr(light, "shadow_soft_size", 0.0))
    return has_multiple_importance(light) and size > 0


def faces_viewer(light):
    """Whether a point or spot with a radius is a disk that faces each point; later it is a ball, unless asked."""
    return not IS_4_0 or getattr(light, "use_soft_falloff", False)


def film_exposure(scene):
    """Factor on all light of the picture, a setting of Cycles."""
    return getattr(getattr(scene, "cycles", None), "film_exposure", 1.0)


def clear_roughness(scene):
    """Roughness up to which glass before a transparent background is transparent, a setting of Cycles; None: none is."""
    cycles = getattr(scene, "cycles", None)
    if not getattr(cycles, "film_transparent_glass", False):
        return None
    return min(max(cycles.film_transparent_roughness, 0.0), 1.0)


def world_of(scene, view_layer):
    """The world of a picture; later versions let a view layer have its own."""
    return getattr(view_layer, "world_override", None) or scene.world


#: What volumes have scattered sees meshes as what was scattered diffusely does, too.
_SCATTERED_RAYS_ARE_DIFFUSE = bpy.app.version < (4, 4, 0)


def sees_object(thing, ray):
    """Whether rays of a kind see an object; see world_visibility."""
    if ray == "volume_scatter" and _SCATTERED_RAYS_ARE_DIFFUSE and thing.type != "LIGHT" and thing.visible_diffuse:
        return True
    return getattr(thing, f"visible_{ray}")


def world_visibility(world, ray):
    """(what has it, its name) of the property by which rays of a kind see the world; None: there is none.

    @param  ray  'camera', 'diffuse', 'glossy', 'transmission' or 'volume_scatter'
    """
    of_cycles = ray.removeprefix("volume_")
    for owner, name in ((world, f"visible_{ray}"), (getattr(world, "cycles_visibility", None), of_cycles)):
        if hasattr(owner, name):
            return owner, name
    return None


def sees_world(world, ray):
    """Whether rays of a kind see the world; see world_visibility."""
    found = world_visibility(world, ray)
    return found is None or getattr(*found)


@dataclass(frozen=True)
class MotionBlur:
    """What of an object takes time while the shutter is open, settings of Cycles.

    moves    its transform
    deforms  its mesh
    steps    how finely: 2 to the power of it are looked up
    """

    moves: bool = True
    deforms: bool = True
    steps: int = 1


def motion_blur_of(shown):
    """MotionBlur of an object."""
    cycles = getattr(shown, "cycles", None)
    if cycles is None:
        return MotionBlur()
    return MotionBlur(cycles.use_motion_blur, cycles.use_deform_motion, cycles.motion_steps)


def shutter_position(scene):
    """"start", "center" or "end": where the frame lies while the shutter is open. Since 4.2 it is a setting of all engines."""
    owner = shutter_position_owner(scene)
    return "center" if owner is None else owner.motion_blur_position.lower()


def shutter_position_owner(scene):
    """What has motion_blur_position, for the panel; None: nothing has."""
    owners = (scene.render, getattr(scene, "cycles", None))
    return next((owner for owner in owners if hasattr(owner, "motion_blur_position")), None)


def is_rolling_shutter(scene):
    """Whether rows of the picture are to be exposed one after the other, a setting of Cycles."""
    return getattr(getattr(scene, "cycles", None), "rolling_shutter_type", "NONE") != "NONE"
