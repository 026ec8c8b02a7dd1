"""What the add-on does in other versions of Blender than this one runs: a name that is wrong there would be noticed here."""

import contextlib

import bpy

from scenes import new_scene


@contextlib.contextmanager
def _as_elsewhere(name):
    """While a switch of compat is thrown the other way."""
    from relief import compat

    before = getattr(compat, name)
    setattr(compat, name, not before)
    try:
        yield
    finally:
        setattr(compat, name, before)


def _switches():
    """Names in compat that are True or False by the version, of what things mean; not the versions themselves."""
    from relief import compat

    return [name for name, value in vars(compat).items() if isinstance(value, bool) and name.isupper() and not name.startswith("IS_")]


def _mixed(kind, linked):
    """A material of which a shader node is half, as a surface or as a volume.

    @param  linked  whether numbers and colours of the node vary
    """
    material = bpy.data.materials.new(kind)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node, mix = tree.nodes.new(kind), tree.nodes.new("ShaderNodeMixShader")
    shader = next(socket for socket in node.outputs if socket.type == "SHADER")
    tree.links.new(shader, mix.inputs[1])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(mix.outputs[0], output.inputs["Volume" if "Volume" in kind else "Surface"])
    if linked:
        noise = tree.nodes.new("ShaderNodeTexNoise")
        for socket in node.inputs:
            if socket.enabled and socket.type in {"VALUE", "RGBA"}:
                tree.links.new(noise.outputs["Color"], socket)
    return material


def test_shaders_are_exported_as_elsewhere():
    from relief.export import surface
    from relief.export.dry_run import try_material

    settings = new_scene().relief
    kinds = [kind for kind in surface._NODES if hasattr(bpy.types, kind)]
    assert len(kinds) >= 20, kinds
    for linked in (False, True):
        materials = [_mixed(kind, linked) for kind in kinds]
        for name in _switches():
            with _as_elsewhere(name):
                for material in materials:
                    try:
                        try_material(material, settings)
                    except Exception as error:
                        raise AssertionError(f"{name} the other way, {material.name}, linked {linked}: {error!r}") from error
