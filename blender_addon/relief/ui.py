# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels, where a Cycles user looks for them. Those of Blender that make sense for any engine are shared."""

import textwrap

import bpy

from . import compat
from .export.displacement import has_displacement_node, needs_switch
from .export.settings import cycles_settings
from .preferences import find_checked_binary
from .report import ReliefError, group, last_coverage, last_warnings, total
from .result import CRYPTOMATTES, PASSES

_ENGINE = "RELIEF"

#: Panels made for Blender's own engines of which relief knows nothing.
_FOREIGN_PANELS = {
    "DATA_PT_area",
    "DATA_PT_camera_dof",
    "DATA_PT_falloff_curve",
    "DATA_PT_light",
    "DATA_PT_shadow",
    "DATA_PT_spot",
    "NODE_DATA_PT_light",
    "OBJECT_PT_shading",
    "RENDER_PT_freestyle",
    "RENDER_PT_simplify",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
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
        rows.separator()
        rows.prop(settings, "denoise")

    @staticmethod
    def _draw_own_sampling(settings, rows):
        rows.prop(settings, "samples")
        rows.prop(settings, "noise_threshold")
        rows.prop(settings, "time_limit")
        rows.separator()
        rows.prop(settings, "preview_samples")
        rows.prop(settings, "seed")


class RELIEF_PT_light_paths(_RenderPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        cycles = cycles_settings(context.scene)
        owner = settings if cycles is None else cycles
        for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
            rows.prop(owner, name)
        rows.prop(owner, "transparent_bounces" if cycles is None else "transparent_max_bounces")
        rows.separator()
        rows.prop(owner, "clamp_indirect" if cycles is None else "sample_clamp_indirect", text="Clamp Indirect")
        rows.prop(settings, "caustics")


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
        if hasattr(context.scene, "cycles"):
            rows.prop(context.scene.cycles, "film_exposure")


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
        cycles = getattr(context.object, "cycles", None)
        if cycles is not None:
            rows.prop(cycles, "motion_steps", text="Steps of the Active Object")


class RELIEF_PT_performance(_RenderPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.scene.relief, self.rows()
        rows.prop(settings, "threads")
        rows.prop(settings, "texture_memory")
        rows.prop(settings, "strict")


class RELIEF_PT_passes(_Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layer, rows = context.view_layer, self.rows()
        for name in dict.fromkeys(p.setting for p in PASSES if not p.owner):
            rows.prop(layer, name)
        if hasattr(layer, "cycles"):
            rows.prop(layer.cycles, "denoising_store_passes")
        rows.separator()
        for kind in CRYPTOMATTES:
            rows.prop(layer, f"use_pass_cryptomatte_{kind}")
        rows.prop(layer, "pass_cryptomatte_depth")
        rows.separator()
        for name in layer.relief.bl_rna.properties.keys():
            if name.startswith("use_pass_"):
                rows.prop(layer.relief, name)


class RELIEF_PT_material_surface(_Panel, bpy.types.Panel):
    bl_label = "Surface"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None

    def draw(self, context):
        material, layout = context.material, self.layout
        layout.prop(material, "use_nodes", icon="NODETREE")
        if material.use_nodes:
            _draw_coverage(layout, last_coverage.get(context.scene.name, {}).get(material.name))
            _draw_output(layout, material.node_tree, "ShaderNodeOutputMaterial", "Surface")
        else:
            layout.prop(material, "diffuse_color", text="Base Color")


class RELIEF_PT_material_displacement(_Panel, bpy.types.Panel):
    bl_label = "relief Displacement"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None and has_displacement_node(context.material)

    def draw(self, context):
        material, rows = context.material, self.rows()
        rows.prop(compat.displacement_owner(material), "displacement_method", text="Displacement")
        if needs_switch(material):
            rows.label(text="Bump Only: it bends normals, but moves nothing", icon="INFO")
            rows.operator("relief.displace")
        _draw_output(self.layout, material.node_tree, "ShaderNodeOutputMaterial", "Displacement")


class RELIEF_PT_world(_Panel, bpy.types.Panel):
    bl_label = "Surface"
    bl_context = "world"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world is not None

    def draw(self, context):
        world, layout = context.world, self.layout
        layout.prop(world, "use_nodes", icon="NODETREE")
        if world.use_nodes:
            _draw_output(layout, world.node_tree, "ShaderNodeOutputWorld", "Surface")
        else:
            layout.prop(world, "color")
        self.rows().prop(world.relief, "caustic_light")


class RELIEF_PT_light(_Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        light, rows = context.light, self.rows()
        rows.prop(light, "type", expand=False)
        rows.prop(light, "color")
        rows.prop(light, "energy", text="Strength" if light.type == "SUN" else "Power")
        if light.type == "SUN":
            rows.prop(light, "angle")
        elif light.type == "AREA":
            rows.prop(light, "shape")
            rows.prop(light, "size")
            if light.shape in {"RECTANGLE", "ELLIPSE"}:
                rows.prop(light, "size_y")
        else:
            rows.prop(light, "shadow_soft_size", text="Radius")
        if light.type == "SPOT":
            rows.prop(light, "spot_size")
            rows.prop(light, "spot_blend")


class RELIEF_PT_object_visibility(_Panel, bpy.types.Panel):
    bl_label = "Visibility"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        shown, rows = context.object, self.rows()
        rows.prop(shown, "hide_render", text="Renders", invert_checkbox=True)
        rows.prop(shown, "visible_camera", text="Camera")
        rows.prop(shown, "visible_shadow", text="Shadow")


class RELIEF_PT_object_caustics(_Panel, bpy.types.Panel):
    bl_label = "Caustics"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings, rows = context.object.relief, self.rows()
        if context.object.type != "LIGHT":
            rows.prop(settings, "caustic_caster")
            rows.prop(settings, "caustic_receiver")
        rows.prop(settings, "caustic_light")


class RELIEF_PT_camera_dof(_Panel, bpy.types.Panel):
    bl_label = "Depth of Field"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.camera is not None

    def draw_header(self, context):
        self.layout.prop(context.camera.dof, "use_dof", text="")

    def draw(self, context):
        dof, rows = context.camera.dof, self.rows()
        rows.active = dof.use_dof
        rows.prop(dof, "focus_object")
        row = rows.row()
        row.active = dof.focus_object is None
        row.prop(dof, "focus_distance")
        rows.prop(dof, "aperture_fstop")


_classes = (
    RELIEF_PT_warnings,
    RELIEF_PT_materials,
    RELIEF_PT_sampling,
    RELIEF_PT_light_paths,
    RELIEF_PT_displacement,
    RELIEF_PT_film,
    RELIEF_PT_motion_blur,
    RELIEF_PT_performance,
    RELIEF_PT_passes,
    RELIEF_PT_material_surface,
    RELIEF_PT_material_displacement,
    RELIEF_PT_world,
    RELIEF_PT_light,
    RELIEF_PT_object_visibility,
    RELIEF_PT_object_caustics,
    RELIEF_PT_camera_dof,
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
    node = next((n for n in tree.nodes if n.bl_idname == idname and n.is_active_output), None)
    if node is None:
        layout.label(text="No output node")
        return
    layout.template_node_view(tree, node, node.inputs[socket_name])


def _shared_panels():
    """Blender's panels that any engine of nodes and render results can use."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if "BLENDER_RENDER" in engines and panel.__name__ not in _FOREIGN_PANELS:
            yield panel


def register():
    for cls in _classes:
        bpy.utils.register_class(cls)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(_ENGINE)


def unregister():
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(_ENGINE)
    for cls in reversed(_classes):
        bpy.utils.unregister_class(cls)
