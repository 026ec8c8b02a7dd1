# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels, where a Cycles user looks for them. Those of Blender that make sense for any engine are shared.

tests/blender/ui_test.py compares them with those of Cycles, setting by setting, and has the reason of each that is missing.
"""

import sys
import textwrap

import bpy
from bl_ui.properties_view_layer import ViewLayerLightgroupsPanel

from . import compat
from .export.displacement import needs_switch
from .export.nodes import active_output
from .export.objects import GEOMETRY_TYPES
from .export.settings import cycles_settings
from .preferences import find_checked_binary
from .report import ReliefError, group, last_coverage, last_warnings, total
from .result import CRYPTOMATTES, PASSES

_ENGINE = "RELIEF"

#: Panels made for Blender's own engines in whose place relief has others, or of which it knows nothing.
_FOREIGN_PANELS = {
    "DATA_PT_area",
    "DATA_PT_camera_dof",
    "DATA_PT_falloff_curve",
    "DATA_PT_light",
    "DATA_PT_shadow",
    "DATA_PT_spot",
    "NODE_DATA_PT_light",
    "OBJECT_PT_shading",
    "RENDER_PT_simplify",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
}

#: Panels that Blender keeps for its own engines, but that are of use to every one: Cycles has a copy of each.
_BORROWED_PANELS = {"EEVEE_MATERIAL_PT_context_material", "MATERIAL_PT_preview"}

#: Modules whose cycles_shader_nodes_poll(context) tells which nodes the Add menu of the shader editor offers: before 4.0, and
#: since.
_NODE_MENUS = ("nodeitems_builtins", "bl_ui.node_add_menu_shader")


#: What each kind of panoramic camera has.
_PANORAMA_ROWS = {
    "EQUIRECTANGULAR": ("latitude_min", "latitude_max", "longitude_min", "longitude_max"),
    "CENTRAL_CYLINDRICAL": (
        *(f"central_cylindrical_range_{end}" for end in ("v_min", "v_max", "u_min", "u_max")),
        "central_cylindrical_radius",
    ),
    "FISHEYE_EQUIDISTANT": ("fisheye_fov",),
    "FISHEYE_EQUISOLID": ("fisheye_lens", "fisheye_fov"),
    "FISHEYE_LENS_POLYNOMIAL": ("fisheye_fov", *(f"fisheye_polynomial_k{i}" for i in range(5))),
}


class _Panel:
    """Base of panels: properties editor, shown for this engine alone."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {_ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def rows(self):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


def _panel_of(member):
    """Base of panels that are there while the properties editor shows something.

    @param  member  of the context, such as "world"
    """

    class Panel(_Panel):
        @classmethod
        def poll(cls, context):
            shown = getattr(context, member)
            # The materials of grease pencils are drawn by no engine.
            return super().poll(context) and shown is not None and not getattr(shown, "grease_pencil", None)

    return Panel


_MaterialPanel, _WorldPanel, _LightPanel, _CameraPanel, _ObjectPanel = map(
    _panel_of, ("material", "world", "light", "camera", "object")
)


def _like(panel, name, **own):
    """The class of a panel that shows the same as another elsewhere.

    @param  own  what differs
    """
    members = {key: value for key, value in vars(panel).items() if key not in {"bl_rna", "__dict__", "__weakref__"}}
    return type(name, panel.__bases__, {**members, **own})


def _in_node_editor(panel):
    """The same beside the nodes."""
    own = {"bl_space_type": "NODE_EDITOR", "bl_region_type": "UI", "bl_category": "Options"}
    return _like(panel, f"NODE_{panel.__name__}", **own)


class _RenderPanel(_Panel):
    bl_context = "render"


class RELIEF_PT_warnings(_RenderPanel, bpy.types.Panel):
    bl_label = "Warnings"
    bl_order = 0

    @classmethod
    def poll(cls, context):
        return super().poll(context) and (last_warnings.get(context.scene.name) or _binary_problem())

    def draw_header(self, context):
        warnings = last_warnings.get(context.scene.name)
        if warnings:
            self.layout.label(text=f"{len(warnings)}")

    def draw(self, context):
        column = self.layout.column(align=True)
        width = _characters_in(context.region)
        problem = _binary_problem()
        for line, text in enumerate(textwrap.wrap(problem, width)):
            column.label(text=text, icon="BLANK1" if line else "CANCEL")
        groups = group(last_warnings.get(context.scene.name, []))
        for index, members in enumerate(groups):
            number = len(members.warnings)
            origin = members.warnings[0].where if number == 1 else f"{number} ×"
            for line, text in enumerate(textwrap.wrap(f"{origin}: {members.label}", width)):
                row = column.row()
                row.alignment = "LEFT"
                icon = "BLANK1" if line else "ERROR"
                row.operator("relief.show_warnings", text=text, icon=icon, emboss=False).index = index
        if groups:
            self.layout.operator("relief.show_warnings", text="Show All as Text", icon="TEXT").index = -1


class RELIEF_PT_materials(_RenderPanel, bpy.types.Panel):
    bl_label = "Materials"
    bl_order = 0
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        coverage = last_coverage.get(context.scene.name, {})
        column = self.layout.column(align=True)
        if coverage:
            column.label(text=total(coverage))
        for name, members in coverage.items():
            if members.not_understood:
                column.label(text=f'"{name}": {members}', icon="ERROR")
        self.layout.operator("relief.check_materials")


class RELIEF_PT_sampling(_RenderPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        if hasattr(context.scene, "cycles"):
            rows.prop(settings, "use_cycles_settings")
        cycles = cycles_settings(context.scene)
        if cycles is not None:
            _draw_cycles_sampling(cycles, rows)
        else:
            self._draw_own_sampling(settings, rows)

    @staticmethod
    def _draw_own_sampling(settings, rows):
        rows.prop(settings, "samples")
        rows.prop(settings, "noise_threshold")
        rows.prop(settings, "min_samples")
        rows.prop(settings, "time_limit")
        rows.separator()
        rows.prop(settings, "preview_samples")
        rows.prop(settings, "seed")


class RELIEF_PT_sampling_denoise(_RenderPanel, bpy.types.Panel):
    bl_label = "Denoise"
    bl_parent_id = "RELIEF_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(self._owner(context), "use_denoising", text="")

    def draw(self, context):
        rows = self.rows()
        rows.active = self._owner(context).use_denoising
        rows.prop(context.scene.relief, "denoiser")

    @staticmethod
    def _owner(context):
        return cycles_settings(context.scene) or context.scene.relief


class RELIEF_PT_light_paths(_RenderPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        cycles = cycles_settings(context.scene)
        owner = settings if cycles is None else cycles
        for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "volume_bounces"):
            rows.prop(owner, name)
        rows.prop(owner, "transparent_bounces" if cycles is None else "transparent_max_bounces")
        rows.separator()
        for kind in ("direct", "indirect"):
            rows.prop(owner, f"clamp_{kind}" if cycles is None else f"sample_clamp_{kind}", text=f"Clamp {kind.title()}")
        rows.prop(owner, "filter_glossy" if cycles is None else "blur_glossy", text="Filter Glossy")
        rows.prop(settings, "caustics")
        if cycles is None:
            rows.prop(settings, "caustic_kinds")
        else:
            rows.prop(cycles, "caustics_reflective")
            rows.prop(cycles, "caustics_refractive")


class RELIEF_PT_displacement(_RenderPanel, bpy.types.Panel):
    bl_label = "Displacement"

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        rows.prop(settings, "displacement_method")
        row = rows.row()
        row.active = settings.displacement_method == "auto" and settings.lod <= 0
        row.prop(settings, "displacement_error")
        rows.prop(settings, "lod")
        rows.prop(settings, "cell_pixels")
        cycles = cycles_settings(context.scene)
        if cycles is not None and compat.dices(context.scene):
            rows.prop(cycles, "dicing_rate")
            rows.prop(cycles, "offscreen_dicing_scale")
            rows.prop(cycles, "max_subdivisions")
        rows.prop(settings, "bump_displaces")
        rows.prop(settings, "weld_seams")
        row = rows.row()
        row.active = settings.displacement_method == "auto"
        row.prop(settings, "memory_limit")
        waiting = [m for m in bpy.data.materials if m.users and needs_switch(m) and not settings.bump_displaces]
        for material in waiting:
            rows.label(text=f'"{material.name}" has a Displacement node, but is set to Bump Only', icon="INFO")


class RELIEF_PT_film(_RenderPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        cycles = cycles_settings(context.scene)
        rows.prop(*(settings, "filter_type") if cycles is None else (cycles, "pixel_filter_type"), text="Filter")
        if cycles is None or cycles.pixel_filter_type != "BOX":
            rows.prop(settings if cycles is None else cycles, "filter_width")
        rows.prop(context.scene.render, "film_transparent")
        own = getattr(context.scene, "cycles", None)
        if own is not None:
            row = rows.row()
            row.active = context.scene.render.film_transparent
            row.prop(own, "film_transparent_glass")
            row = rows.row()
            row.active = context.scene.render.film_transparent and own.film_transparent_glass
            row.prop(own, "film_transparent_roughness", text="Roughness Threshold")
            rows.prop(own, "film_exposure")


class RELIEF_PT_simplify(_RenderPanel, bpy.types.Panel):
    bl_label = "Simplify"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        pass


def _simplify_panels():
    """What Blender has below its own panel Simplify, which would stand above all of relief's."""
    for panel in bpy.types.Panel.__subclasses__():
        if getattr(panel, "bl_parent_id", "") == "RENDER_PT_simplify" and "BLENDER_RENDER" in panel.COMPAT_ENGINES:
            name = panel.__name__.replace("RENDER_PT", "RELIEF_PT")
            yield _like(panel, name, bl_parent_id="RELIEF_PT_simplify", COMPAT_ENGINES={_ENGINE})


class RELIEF_PT_curves(_RenderPanel, bpy.types.Panel):
    bl_label = "Curves"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.scene, "cycles_curves")

    def draw(self, context):
        self.rows().prop(context.scene.cycles_curves, "shape")


class RELIEF_PT_motion_blur(_RenderPanel, bpy.types.Panel):
    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        render, rows = context.scene.render, self.rows()
        rows.active = render.use_motion_blur
        owner = compat.shutter_position_owner(context.scene)
        if owner is not None:
            rows.prop(owner, "motion_blur_position", text="Position")
        rows.prop(render, "motion_blur_shutter")


class RELIEF_PT_performance(_RenderPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, render, rows = context.scene.relief, context.scene.render, self.rows()
        if settings.threads > 0:  # files from before Blender's own setting was used
            rows.prop(settings, "threads")
        else:
            rows.prop(render, "threads_mode")
            row = rows.row()
            row.active = render.threads_mode == "FIXED"
            row.prop(render, "threads")
        rows.prop(settings, "texture_memory")
        rows.prop(render, "use_persistent_data")
        for name in ("device", "precision", "denoise_device", "denoise_preview_quality", "denoise_final_quality"):
            if hasattr(render, f"compositor_{name}"):
                rows.prop(render, f"compositor_{name}")
        rows.prop(settings, "strict")


def _draw_light_group(rows, owner, view_layer):
    row = rows.row(align=True)
    row.prop_search(owner, "lightgroup", view_layer, "lightgroups", text="Light Group", results_are_suggestions=True)
    add = row.column(align=True)
    add.enabled = bool(owner.lightgroup) and owner.lightgroup not in {group.name for group in view_layer.lightgroups}
    add.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = owner.lightgroup


class _LayerPanel(_Panel):
    bl_context = "view_layer"


class RELIEF_PT_filter(_LayerPanel, bpy.types.Panel):
    bl_label = "Filter"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer, rows = context.view_layer, self.rows()
        rows.prop(layer, "use_sky", text="Environment")
        rows.prop(layer, "use_solid", text="Surfaces")
        rows.prop(layer, "use_strand", text="Hair")
        if hasattr(layer, "use_grease_pencil"):
            rows.prop(layer, "use_grease_pencil", text="Grease Pencil")
        row = rows.row()
        row.active = context.scene.render.use_motion_blur
        row.prop(layer, "use_motion_blur", text="Motion Blur")
        cycles = cycles_settings(context.scene)
        if cycles is not None:
            row = rows.row()
            row.active = cycles.use_denoising
            row.prop(layer.cycles, "use_denoising", text="Denoising")


class RELIEF_PT_override(_LayerPanel, bpy.types.Panel):
    bl_label = "Override"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer, rows = context.view_layer, self.rows()
        rows.prop(layer, "material_override")
        if hasattr(layer, "world_override"):
            rows.prop(layer, "world_override")
        rows.prop(layer, "samples")


class RELIEF_PT_passes(_LayerPanel, bpy.types.Panel):
    bl_label = "Passes"

    def draw(self, context):
        layer, rows = context.view_layer, self.rows()
        for name in dict.fromkeys(p.setting for p in PASSES if not p.owner):
            rows.prop(layer, name)
        if hasattr(layer, "cycles"):
            rows.prop(layer.cycles, "use_pass_shadow_catcher")
            rows.prop(layer.cycles, "denoising_store_passes")
        rows.separator()
        for kind in CRYPTOMATTES:
            rows.prop(layer, f"use_pass_cryptomatte_{kind}")
        rows.prop(layer, "pass_cryptomatte_depth")
        rows.separator()
        for name in layer.relief.bl_rna.properties.keys():
            if name.startswith("use_pass_"):
                rows.prop(layer.relief, name)


class RELIEF_PT_light_groups(_LayerPanel, ViewLayerLightgroupsPanel):
    bl_label = "Light Groups"
    bl_parent_id = "RELIEF_PT_passes"


class RELIEF_PT_material_surface(_MaterialPanel, bpy.types.Panel):
    bl_label = "Surface"
    bl_context = "material"

    def draw(self, context):
        material, layout = context.material, self.layout
        if not compat.IS_5_0:  # since then materials have nodes always
            layout.prop(material, "use_nodes", icon="NODETREE")
        if material.use_nodes:
            _draw_coverage(layout, last_coverage.get(context.scene.name, {}).get(material.name))
            _draw_output(layout, material.node_tree, "ShaderNodeOutputMaterial", "Surface")
        else:
            layout.prop(material, "diffuse_color", text="Base Color")


class _MaterialNodesPanel(_MaterialPanel):
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material.use_nodes


class RELIEF_PT_material_volume(_MaterialNodesPanel, bpy.types.Panel):
    bl_label = "Volume"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _draw_output(self.layout, context.material.node_tree, "ShaderNodeOutputMaterial", "Volume")


class RELIEF_PT_material_displacement(_MaterialNodesPanel, bpy.types.Panel):
    bl_label = "Displacement"

    def draw(self, context):
        material, rows = context.material, self.rows()
        owner = compat.displacement_owner(material)
        if owner is not None:
            rows.prop(owner, "displacement_method", text="Displacement")
        if needs_switch(material):
            rows.label(text="Bump Only: it bends normals, but moves nothing", icon="INFO")
            rows.operator("relief.displace")
        _draw_output(self.layout, material.node_tree, "ShaderNodeOutputMaterial", "Displacement")


class RELIEF_PT_material_settings(_MaterialPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.rows().prop(context.material, "pass_index")


class RELIEF_PT_world_preview(_WorldPanel, bpy.types.Panel):
    bl_label = "Preview"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.template_preview(context.world)


class RELIEF_PT_world(_WorldPanel, bpy.types.Panel):
    bl_label = "Surface"
    bl_context = "world"

    def draw(self, context):
        world, layout = context.world, self.layout
        if not compat.IS_5_0:
            layout.prop(world, "use_nodes", icon="NODETREE")
        if world.use_nodes:
            _draw_output(layout, world.node_tree, "ShaderNodeOutputWorld", "Surface")
        else:
            layout.prop(world, "color")
        self.rows().prop(world.relief, "caustic_light")


class RELIEF_PT_world_volume(_WorldPanel, bpy.types.Panel):
    bl_label = "Volume"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world.use_nodes

    def draw(self, context):
        _draw_output(self.layout, context.world.node_tree, "ShaderNodeOutputWorld", "Volume")


class RELIEF_PT_world_ray_visibility(_WorldPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and compat.world_visibility(context.world, "camera") is not None

    def draw(self, context):
        rows = self.rows()
        for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter"):
            rows.prop(*compat.world_visibility(context.world, ray))


class RELIEF_PT_world_light_group(_WorldPanel, bpy.types.Panel):
    bl_label = "Light Group"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _draw_light_group(self.rows(), context.world, context.view_layer)


class RELIEF_PT_world_mist(_WorldPanel, bpy.types.Panel):
    bl_label = "Mist Pass"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        mist, rows = context.world.mist_settings, self.rows()
        rows.prop(mist, "start")
        rows.prop(mist, "depth")
        rows.prop(mist, "falloff")


class RELIEF_PT_light(_LightPanel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    def draw(self, context):
        light = context.light
        is_beside_nodes = self.bl_space_type != "PROPERTIES"
        self.layout.row().prop(light, "type", expand=not is_beside_nodes)
        rows = self.rows()
        rows.prop(light, "color")
        for name in ("use_temperature", "temperature"):
            if hasattr(light, name):
                rows.prop(light, name)
        rows.prop(light, "energy", text="Strength" if light.type == "SUN" else "Power")
        for name in ("exposure", "normalize"):
            if hasattr(light, name):
                rows.prop(light, name)
        if light.type == "SUN":
            rows.prop(light, "angle")
        elif light.type == "AREA":
            self._draw_area(light, rows)
        else:
            if hasattr(light, "use_soft_falloff"):
                rows.prop(light, "use_soft_falloff")
            rows.prop(light, "shadow_soft_size", text="Radius")
        if light.type == "SPOT":
            rows.prop(light, "spot_size")
            rows.prop(light, "spot_blend", slider=True)
            rows.prop(light, "show_cone")

    @staticmethod
    def _draw_area(light, rows):
        rows.prop(light, "shape")
        is_uneven = light.shape in {"RECTANGLE", "ELLIPSE"}
        rows.prop(light, "size", text="Size X" if is_uneven else "Size")
        if is_uneven:
            rows.prop(light, "size_y", text="Y")
        rows.prop(light, "spread")
        if hasattr(light, "cycles"):
            rows.prop(light.cycles, "is_portal")


class RELIEF_PT_light_nodes(_LightPanel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"

    def draw(self, context):
        light, layout = context.light, self.layout
        layout.prop(light, "use_nodes", icon="NODETREE")
        if light.use_nodes:
            _draw_output(layout, light.node_tree, "ShaderNodeOutputLight", "Surface")


class RELIEF_PT_object_motion_blur(_ObjectPanel, bpy.types.Panel):
    bl_label = "Motion Blur"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.object, "cycles") and context.object.type != "LIGHT"

    def draw_header(self, context):
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context):
        cycles, rows = context.object.cycles, self.rows()
        rows.active = context.scene.render.use_motion_blur and cycles.use_motion_blur
        rows.prop(cycles, "motion_steps", text="Steps")
        if context.object.type != "CAMERA":
            rows.prop(cycles, "use_deform_motion", text="Deformation")


class _SeenObjectPanel(_ObjectPanel):
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        shown = context.object
        return super().poll(context) and (shown.type in {"LIGHT", *GEOMETRY_TYPES} or shown.is_instancer)


class RELIEF_PT_object_ray_visibility(_SeenObjectPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_parent_id = "OBJECT_PT_visibility"

    def draw(self, context):
        shown, rows = context.object, self.rows()
        for ray in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
            if ray != "shadow" or shown.type != "LIGHT":
                rows.prop(shown, f"visible_{ray}", text=ray.replace("_", " ").title())
        rows.prop(shown, "is_shadow_catcher")


class RELIEF_PT_object_caustics(_SeenObjectPanel, bpy.types.Panel):
    bl_label = "Caustics"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.object.relief, self.rows()
        if context.object.type != "LIGHT":
            rows.prop(settings, "caustic_caster")
            rows.prop(settings, "caustic_receiver")
        rows.prop(settings, "caustic_light")


class RELIEF_PT_object_light_group(_SeenObjectPanel, bpy.types.Panel):
    bl_label = "Light Group"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _draw_light_group(self.rows(), context.object, context.view_layer)


class RELIEF_PT_camera_panorama(_CameraPanel, bpy.types.Panel):
    bl_label = "Panorama"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        is_panoramic = super().poll(context) and context.camera.type == "PANO"
        return is_panoramic and compat.panorama_of(context.camera) is not None

    def draw(self, context):
        lens, rows = compat.panorama_of(context.camera), self.rows()
        rows.prop(lens, "panorama_type")
        for name in _PANORAMA_ROWS.get(lens.panorama_type, ()):
            rows.prop(lens, name)


class RELIEF_PT_camera_dof(_CameraPanel, bpy.types.Panel):
    bl_label = "Depth of Field"
    bl_context = "data"

    def draw_header(self, context):
        self.layout.prop(context.camera.dof, "use_dof", text="")

    def draw(self, context):
        dof, rows = context.camera.dof, self.rows()
        rows.active = dof.use_dof
        rows.prop(dof, "focus_object")
        target = dof.focus_object
        if target is not None and target.type == "ARMATURE":
            rows.prop_search(dof, "focus_subtarget", target.data, "bones", text="Focus Bone")
        row = rows.row()
        row.active = target is None
        row.prop(dof, "focus_distance")
        if compat.IS_5_0:  # before, it picks what the pointer is over without being told what for
            pick = row.operator("ui.eyedropper_depth", icon="EYEDROPPER", text="")
            pick.prop_data_path = "scene.camera.data.dof.focus_distance"
        for name in ("aperture_fstop", "aperture_blades", "aperture_rotation", "aperture_ratio"):
            rows.prop(dof, name)


_classes = (
    RELIEF_PT_warnings,
    RELIEF_PT_materials,
    RELIEF_PT_sampling,
    RELIEF_PT_sampling_denoise,
    RELIEF_PT_light_paths,
    RELIEF_PT_displacement,
    RELIEF_PT_film,
    RELIEF_PT_simplify,
    *_simplify_panels(),
    RELIEF_PT_curves,
    RELIEF_PT_motion_blur,
    RELIEF_PT_performance,
    RELIEF_PT_filter,
    RELIEF_PT_override,
    RELIEF_PT_passes,
    RELIEF_PT_light_groups,
    RELIEF_PT_material_surface,
    RELIEF_PT_material_volume,
    RELIEF_PT_material_displacement,
    RELIEF_PT_material_settings,
    RELIEF_PT_world_preview,
    RELIEF_PT_world,
    RELIEF_PT_world_volume,
    RELIEF_PT_world_light_group,
    RELIEF_PT_world_mist,
    RELIEF_PT_world_ray_visibility,
    RELIEF_PT_light,
    RELIEF_PT_light_nodes,
    RELIEF_PT_object_motion_blur,
    RELIEF_PT_object_ray_visibility,
    RELIEF_PT_object_caustics,
    RELIEF_PT_object_light_group,
    RELIEF_PT_camera_panorama,
    RELIEF_PT_camera_dof,
    *map(_in_node_editor, (RELIEF_PT_light, RELIEF_PT_material_settings, RELIEF_PT_world_ray_visibility)),
)


def _characters_in(region):
    """How many characters of a text are sure to be seen beside an icon."""
    pixels = region.width / bpy.context.preferences.system.ui_scale
    return max(20, int((pixels - 90) / 6.2))


def _draw_cycles_sampling(cycles, rows):
    rows.prop(cycles, "use_adaptive_sampling", text="Noise Threshold")
    row = rows.row()
    row.active = cycles.use_adaptive_sampling
    row.prop(cycles, "adaptive_threshold", text="Threshold")
    row = rows.row()
    row.active = cycles.use_adaptive_sampling
    row.prop(cycles, "adaptive_min_samples", text="Min Samples")
    rows.prop(cycles, "samples", text="Max Samples" if cycles.use_adaptive_sampling else "Samples")
    rows.prop(cycles, "time_limit")
    rows.separator()
    rows.prop(cycles, "preview_samples", text="Viewport Samples")
    row = rows.row(align=True)
    row.prop(cycles, "seed")
    row.prop(cycles, "use_animated_seed", text="", icon="TIME")


def _binary_problem():
    """What keeps the program from running; empty if nothing does."""
    try:
        find_checked_binary()
    except ReliefError as error:
        return str(error)
    return ""


def _draw_coverage(layout, coverage):
    """How much of a material is understood, and what is not; nothing before it has been looked at."""
    if coverage is None:
        return
    column = layout.column(align=True)
    column.label(text=str(coverage), icon="ERROR" if coverage.not_understood else "CHECKMARK")
    for _, reason in coverage.not_understood:
        column.label(text=reason, icon="BLANK1")


def _draw_output(layout, tree, idname, socket_name):
    """The nodes behind one socket of a tree's output, as Blender draws them."""
    node = active_output(tree, idname)
    if node is None:
        layout.label(text="No output node")
        return
    layout.template_node_view(tree, node, node.inputs[socket_name])


def _shared_panels():
    """Blender's panels that any engine of nodes and render results can use."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if "BLENDER_RENDER" in engines and panel.__name__ not in _FOREIGN_PANELS or panel.__name__ in _BORROWED_PANELS:
            yield panel


def _offer_nodes():
    """Has the shader editor's Add menu offer what it offers for Cycles: Blender asks for the engine by its name there."""
    for module in filter(None, map(sys.modules.get, _NODE_MENUS)):
        ask = getattr(module, "cycles_shader_nodes_poll", None)
        if ask is not None:

            def offers(context, ask=ask):
                return context.engine == _ENGINE or ask(context)

            offers.before = ask
            module.cycles_shader_nodes_poll = offers


def _withdraw_nodes():
    """Undoes what _offer_nodes does."""
    for module in filter(None, map(sys.modules.get, _NODE_MENUS)):
        before = getattr(getattr(module, "cycles_shader_nodes_poll", None), "before", None)
        if before is not None:
            module.cycles_shader_nodes_poll = before


def _draw_indirect_only(menu, context):
    """What Blender's menu of collections in the outliner has for Cycles alone."""
    if context.engine == _ENGINE:
        menu.layout.operator("outliner.collection_indirect_only_set")
        menu.layout.operator("outliner.collection_indirect_only_clear")


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(_ENGINE)
    bpy.types.OUTLINER_MT_collection_view_layer.append(_draw_indirect_only)
    _offer_nodes()


def unregister():
    _withdraw_nodes()
    bpy.types.OUTLINER_MT_collection_view_layer.remove(_draw_indirect_only)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(_ENGINE)
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)
