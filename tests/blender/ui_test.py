"""The user interface beside Cycles': what a Cycles user knows is where it was, or has a reason for not being there."""

import fnmatch
from types import SimpleNamespace

import bpy

from panels import Context, is_shown, registered, shown_by

#: Why something that Cycles' panels show is in none of relief's: "tab: what", with wildcards, and the reason.
_MISSING = {
    # what there is not
    "render: BakeSettings.*": "relief does not bake",
    "render: RenderSettings.*bake*": "relief does not bake",
    "render: CyclesRenderSettings.bake_type": "relief does not bake",
    "render: operator object.bake*": "relief does not bake",
    "*: *.volume_*": "nothing goes by steps, and lights are looked for in one way",
    "*: *.homogeneous_volume": "what is even is found to be",
    "*: *.use_volumes": "no smoke; a warning tells",
    "*: *.use_pass_volume_*": "no passes of volumes; a warning tells",
    "*: CyclesCurveRenderSettings.*subdivisions": "ribbons are as smooth as they are traced",
    "render: RenderSettings.hair_*": "of other engines",
    "render: operator *hair*": "of other engines",
    "object: ObjectLightLinking.*": "no light linking; a warning tells",
    "object: operator object.light_linking*": "no light linking",
    "object: menu *LIGHT_LINKING*": "no light linking",
    "object: template light_linking*": "no light linking",
    "*: *aov*": "no shader AOVs; a warning tells",
    "view_layer: ViewLayer.use_pass_*": "passes that relief has not; a warning tells",
    "view_layer: *.pass_alpha_threshold": "of a transparent surface each sample meets it or not",
    "view_layer: *.pass_debug_*": "the pass is relief's own, Sample Count",
    "view_layer: *.pass_render_time": "relief's samples take their time together",
    "world: *.use_shadows": "worlds cast shadows; a warning tells",
    "material: *.use_bump_map_correction": "bump is corrected always; a warning tells",
    "render: *fast_gi*": "all bounces are traced; a warning tells",
    "render: *.ao_*": "all bounces are traced",
    "render: WorldLighting.*": "all bounces are traced",
    "object: *.ao_distance": "all bounces are traced",
    "render: *_cull*": "nothing is culled; a warning tells",
    "object: *_cull": "nothing is culled; a warning tells",
    "render: *.texture_limit*": "textures have their full size; a warning tells",
    "render: *.texture_resolution*": "textures have their full size; a warning tells",
    "render: *.rolling_shutter_*": "no rolling shutter; a warning tells",
    "render: *shutter_curve*": "no shutter curve; a warning tells",
    "render: operator *.shutter_curve_preset": "no shutter curve",
    "*: *.max_bounces": "lamps and worlds light all bounces; a warning tells",
    "data: *.cast_shadow": "all lamps cast shadows; a warning tells",
    "data: *.use_shadow": "all lamps cast shadows; a warning tells",
    "material: *.use_transparent_shadow": "shadows are as transparent as the material; a warning tells",
    # what relief does by itself, or otherwise
    "*: *caustics*": "caustics are photons, with settings of their own",
    "render: *.denois*": "the denoisers are relief's own",
    "render: *.use_preview_denoising": "the viewport is not denoised",
    "render: *.preview_denois*": "the viewport is not denoised",
    "object: *.shadow_terminator_*": "done without",
    "render: *.preview_adaptive_*": "the viewport takes all its samples",
    "render: *.use_preview_adaptive_*": "the viewport takes all its samples",
    "render: *.min_*_bounces": "Russian roulette begins by itself",
    "render: *.light_sampling_threshold": "no light is left out",
    "render: *scrambling_distance": "how Cycles samples",
    "render: *.sampl*_pattern": "how Cycles samples",
    "render: *.sample_offset": "it only chooses other samples; for a part of the samples see relief render --samples",
    "render: *sample_subset*": "how Cycles samples; for a part of the samples see relief render --samples",
    "render: *guiding*": "how Cycles samples",
    "render: *light_tree*": "lamps are always chosen by a tree",
    "*: *.use_multiple_importance_sampling": "done always",
    "material: *.sample_as_light": "done always",
    "material: *.emission_sampling": "done always",
    "world: *.sampling_method": "done always",
    "world: *.sample_map_resolution": "that of the image",
    "render: *texture_cache": "textures are kept as Texture Memory says",
    "render: *.preview_dicing_rate": "in viewports faces are as fine as in the picture, but no finer than pixels",
    "render: *.dicing_camera": "the scene's own",
    "render: *tile*": "tiles cost no memory",
    "render: *_bvh*": "Embree's tree",
    "render: *spatial_splits": "Embree's tree",
    "render: *.device": "relief computes on processors",
    "render: *.feature_set": "nothing is experimental",
    "render: *.shading_system": "no OSL",
    "render: *persistent_data": "done always",
    "render: *.preview_pixel_size": "the first picture of a viewport is coarse by itself",
    "render: *.direct_light_sampling_type": "a switch for Cycles' developers",
    "render: *.debug_*": "a switch for Cycles' developers",
    "*: menu *PRESET*": "sets of Cycles' settings",
}

#: Panels that ask their region or the editor for what there is in a window alone.
_NEEDS_WINDOW = {"DATA_PT_shape_keys", "RELIEF_PT_warnings"}

_TABS = ("render", "output", "view_layer", "scene", "world", "object", "data", "material", "texture", "particle", "physics")


def _file():
    """What Blender starts with: a cube, a lamp, a camera and a world; everything that has more to show switched on."""
    bpy.ops.wm.read_factory_settings()
    bpy.ops.preferences.addon_enable(module="relief")
    scene = bpy.context.scene
    scene.world.use_nodes = bpy.data.materials["Material"].use_nodes = True
    bpy.context.view_layer.use_pass_mist = True
    scene.render.use_motion_blur = scene.render.use_simplify = scene.render.film_transparent = True
    return scene


def _panorama_of(camera):
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def _panoramas(camera):
    """Kinds of panoramic cameras that there are; None, which is no panoramic one, first."""
    kinds = type(_panorama_of(camera)).bl_rna.properties["panorama_type"].enum_items
    return [None, *(kind.identifier for kind in kinds)]


def _states(scene):
    """(tab, members of the context) of each thing that the properties editor may show."""
    cube, world = bpy.data.objects["Cube"], scene.world
    nothing = dict.fromkeys(("material", "material_slot", "mesh", "world", "light", "camera"))
    own = {"mesh": cube.data, "material": cube.active_material, "material_slot": cube.material_slots[0], "world": world}
    for tab in _TABS:
        yield tab, {**nothing, **own, "object": cube, "active_object": cube}
    for kind in ("POINT", "SUN", "SPOT", "AREA"):
        light = bpy.data.lights.new(kind, kind)
        if not light.use_nodes:
            light.use_nodes = True
        shown = bpy.data.objects.new(kind, light)
        scene.collection.objects.link(shown)
        for tab in ("object", "data"):
            yield tab, {**nothing, "light": light, "object": shown, "active_object": shown}
    for kind in _panoramas(scene.camera.data):
        camera = scene.camera.copy()
        camera.data = scene.camera.data.copy()
        scene.collection.objects.link(camera)
        if kind is not None:
            camera.data.type, _panorama_of(camera.data).panorama_type = "PANO", kind
        for tab in ("object", "data"):
            yield tab, {**nothing, "camera": camera.data, "object": camera, "active_object": camera}


def _context(engine, tab, members):
    space = SimpleNamespace(type="PROPERTIES", context=tab.upper(), pin_id=None, use_pin_id=False, search_filter="")
    return Context(engine=engine, space_data=space, region=SimpleNamespace(width=400), **members)


def _panels(space_type):
    """Panels of an editor, but for those whose drawing needs a real one: custom properties, constraints."""
    for name, panel in registered(bpy.types.Panel).items():
        if panel.bl_space_type == space_type and "custom_prop" not in name and "Constraint" not in name:
            yield panel


def _drawn(scene, engine, states):
    """[{what is shown: names of the panels that show it}] of each state."""
    scene.render.engine = engine
    out = []
    for tab, members in states:
        context, shown = _context(engine, tab, members), {}
        for panel in _panels("PROPERTIES"):
            if getattr(panel, "bl_context", "") != tab:
                continue
            try:
                is_here = is_shown(panel, context)
            except (AttributeError, TypeError):  # asks for what this state has not
                continue
            if not is_here or panel.__name__ in _NEEDS_WINDOW:
                continue
            for what in shown_by(panel, context):
                shown.setdefault(f"{tab}: {what}", set()).add(panel.__name__)
        out.append(shown)
    return out


def test_nothing_of_cycles_is_missing_without_a_reason():
    scene = _file()
    states = list(_states(scene))
    cycles, relief = (set().union(*_drawn(scene, engine, states)) for engine in ("CYCLES", "RELIEF"))
    assert len(cycles) > 400, "hardly anything was drawn"
    missing = [m for m in sorted(cycles - relief) if not any(fnmatch.fnmatchcase(m, pattern) for pattern in _MISSING)]
    assert not missing, "\n".join(missing)


def test_nothing_is_shown_twice():
    scene = _file()
    states = list(_states(scene))
    for cycles, relief in zip(*(_drawn(scene, engine, states) for engine in ("CYCLES", "RELIEF"))):
        twice = {m: names for m, names in relief.items() if len(names) > 1 and len(cycles.get(m, ())) < 2}
        assert not twice, twice


def test_an_object_can_be_given_a_material():
    scene = _file()
    state = next(members for tab, members in _states(scene) if tab == "material")
    shown = set(_drawn(scene, "RELIEF", [("material", state)])[0])
    wanted = {"Object.active_material", "Object.material_slots", "operator object.material_slot_add"}
    assert {f"material: {what}" for what in wanted} <= shown
    empty = {**state, "material": None, "material_slot": None}
    assert {f"material: {what}" for what in wanted} <= set(_drawn(scene, "RELIEF", [("material", empty)])[0])


def _menus(engine, kind):
    """What the menus show over nodes of a kind, "OBJECT" or "WORLD": {name: set}, of those that need no real editor."""
    cube, scene = bpy.data.objects["Cube"], bpy.context.scene
    scene.render.engine = engine
    owner = scene.world if kind == "WORLD" else cube.active_material
    space = SimpleNamespace(
        type="NODE_EDITOR", tree_type="ShaderNodeTree", shader_type=kind, edit_tree=owner.node_tree, node_tree=owner.node_tree,
        id=owner, id_from=cube,
    )  # fmt: skip
    context = Context(engine=engine, space_data=space, region=SimpleNamespace(width=400))
    out = {"": _nodes_before_4_0(context)}
    for name, menu in registered(bpy.types.Menu).items():
        if not name.startswith(("NODE_", "OUTLINER_", "VIEW3D_", "TOPBAR_", "MATERIAL_", "OBJECT_")):
            continue
        try:
            out[name] = shown_by(menu, context)
        except Exception:  # of whatever it asks for that there is not
            continue
    return out


def _nodes_before_4_0(context):
    """What the Add menu of the shader editor offers."""
    try:
        from nodeitems_utils import node_categories_iter
    except ImportError:
        return set()
    items = [item for category in node_categories_iter(context) for item in category.items(context)]
    return {f"node {item.nodetype}" for item in items if hasattr(item, "nodetype") and (not item.poll or item.poll(context))}


def test_menus_have_all_that_cycles_has():
    """Above all the nodes that the shader editor has to add."""
    _file()
    for kind in ("OBJECT", "WORLD"):
        cycles, relief = (_menus(engine, kind) for engine in ("CYCLES", "RELIEF"))
        offered = set().union(*cycles.values())
        assert "node ShaderNodeMixShader" in offered and "operator outliner.collection_holdout_set" in offered
        assert ("node ShaderNodeBsdfGlass" in offered) == (kind == "OBJECT")
        for name, shown in cycles.items():
            assert shown <= relief[name], (name, shown - relief[name])


def test_switching_off_leaves_menus_and_panels_as_they_were():
    scene = _file()
    bpy.ops.preferences.addon_disable(module="relief")
    before = _menus("CYCLES", "OBJECT")
    bpy.ops.preferences.addon_enable(module="relief")
    scene.render.engine = "CYCLES"
    bpy.ops.preferences.addon_disable(module="relief")
    after = _menus("CYCLES", "OBJECT")
    differs = {name: (shown, after.get(name)) for name, shown in before.items() if after.get(name) != shown}
    assert not differs, differs
    left = [panel.__name__ for panel in registered(bpy.types.Panel).values() if "RELIEF" in getattr(panel, "COMPAT_ENGINES", ())]
    assert not left, left
