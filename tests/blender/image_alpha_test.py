"""Colour and alpha of images, as colours, masks and heights: every kind of file, alpha mode and colour space, with the node's
Alpha used or not. Each cell of the table is a square of a plain image, and its mean is that of Cycles."""

import os

import bpy
import numpy as np

from scenes import IS_5_2, LINEAR, add_camera, folder, link, new_scene, render, set_file_format, set_world

#: Name: (Blender's format, bits, suffix, whether it is a sequence).
KINDS = {
    "PNG 8": ("PNG", "8", ".png", False),
    "PNG 16": ("PNG", "16", ".png", False),
    "TIFF 8": ("TIFF", "8", ".tif", False),
    "TIFF 16": ("TIFF", "16", ".tif", False),
    "WebP": ("WEBP", "8", ".webp", False),
    "TGA": ("TARGA", "8", ".tga", False),
    "EXR 16": ("OPEN_EXR", "16", ".exr", False),
    "EXR 32": ("OPEN_EXR", "32", ".exr", False),
    "sequence of PNG 8": ("PNG", "8", ".png", True),
    "sequence of PNG 16": ("PNG", "16", ".png", True),
}
ALPHA_MODES = ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE")
COLOR_SPACES = ("sRGB", "Non-Color", LINEAR)
TEXEL = (0.5, 0.25, 0.125, 0.5)
COLUMNS, PIXELS = 20, 4


def _write_files(path):
    """A plain image of each kind; names by kind."""
    scene, names = bpy.context.scene, {}
    scene.view_settings.view_transform = "Standard"
    for number, (kind, (file_format, bits, suffix, _)) in enumerate(KINDS.items()):
        image = bpy.data.images.new("plain", 4, 4, alpha=True, float_buffer=bits != "8")
        image.pixels.foreach_set(np.tile(np.float32(TEXEL), 16))
        set_file_format(file_format, bits, color_mode="RGBA")
        names[kind] = os.path.join(path, f"{chr(ord('a') + number)}0001{suffix}")
        image.save_render(names[kind], scene=scene)
        bpy.data.images.remove(image)
    set_file_format("OPEN_EXR", "32")
    return names


def _load(name, is_sequence, alpha_mode, color_space):
    image = bpy.data.images.load(name)
    if is_sequence:
        image.source = "SEQUENCE"
    image.colorspace_settings.name = color_space
    image.alpha_mode = alpha_mode
    return image


class _Cell:
    """A square with a material of its own."""

    def __init__(self, number, image):
        self.material = bpy.data.materials.new("cell")
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.output = self.node("OutputMaterial")
        self.texture = self.node("TexImage")
        self.texture.image = image
        self.texture.image_user.frame_duration = 1
        x, y = number % COLUMNS, number // COLUMNS
        mesh = bpy.data.meshes.new("cell")
        corners = [(x, -y - 1, 0), (x + 1, -y - 1, 0), (x + 1, -y, 0), (x, -y, 0)]
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
        mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        mesh.materials.append(self.material)
        link(mesh, "cell")

    def node(self, kind, **settings):
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, source, target):
        self.tree.links.new(source, target)

    def emission(self, color=(1, 1, 1)):
        node = self.node("Emission")
        node.inputs["Color"].default_value = (*color, 1)
        return node

    def mix(self, factor, first, second):
        node = self.node("MixShader")
        self.link(factor, node.inputs[0])
        self.link(first.outputs[0], node.inputs[1])
        self.link(second.outputs[0], node.inputs[2])
        return node

    def show(self, shader):
        self.link(shader.outputs[0], self.output.inputs["Surface"])


def _as_color(cell, uses_alpha):
    shader = cell.emission()
    cell.link(cell.texture.outputs["Color"], shader.inputs["Color"])
    if uses_alpha:
        shader = cell.mix(cell.texture.outputs["Alpha"], cell.node("BsdfTransparent"), shader)
    cell.show(shader)


def _as_mask(cell, uses_alpha):
    first, second = cell.emission((0.2, 0, 1)), cell.emission((1, 0.5, 0))
    if uses_alpha:
        cell.link(cell.texture.outputs["Alpha"], first.inputs["Strength"])
    cell.show(cell.mix(cell.texture.outputs["Color"], first, second))


def _as_height(cell, uses_alpha):
    """Shows how high the square has been moved."""
    from relief import compat

    shader, move, place = cell.emission(), cell.node("Displacement"), cell.node("NewGeometry")
    parts = cell.node("SeparateXYZ")
    move.inputs["Scale"].default_value, move.inputs["Midlevel"].default_value = 1, -0.5
    compat.set_displacement_method(cell.material, "DISPLACEMENT")
    cell.link(cell.texture.outputs["Color"], move.inputs["Height"])
    cell.link(move.outputs[0], cell.output.inputs["Displacement"])
    cell.link(place.outputs["Position"], parts.inputs[0])
    cell.link(parts.outputs["Z"], shader.inputs["Color"])
    if uses_alpha:
        cell.link(cell.texture.outputs["Alpha"], shader.inputs["Strength"])
    cell.show(shader)


def _coarseness(kind):
    """Difference that is allowed."""
    # Since 5.2 WebP's bytes come from Blender, and their products with alpha are not rounded to bytes as Cycles' are.
    return 1 / 255 if IS_5_2 and kind == "WebP" else 0.001


def _is_known(kind, mode, space, uses_alpha):
    """Whether a cell differs since 5.2, where Cycles multiplies and divides by alpha what is stored, and relief light."""
    if not IS_5_2:
        return False
    if mode == "STRAIGHT" and space == "sRGB":
        # Floats, and files whose colours are multiplied once already.
        return kind in {"TIFF 16", "EXR 16", "EXR 32"}
    return mode == "PREMUL" and uses_alpha and "sequence" in kind


def _assert_table(build, strict=True):
    with folder() as path:
        cells = [
            (kind, mode, space, uses_alpha)
            for kind in KINDS
            for mode in ALPHA_MODES
            for space in COLOR_SPACES
            for uses_alpha in (False, True)
        ]
        rows = -(-len(cells) // COLUMNS)
        scene = new_scene(COLUMNS * PIXELS, rows * PIXELS)
        set_world((0, 0, 0))
        scene.relief.strict = strict
        names = _write_files(path)
        for number, (kind, mode, space, uses_alpha) in enumerate(cells):
            image = _load(names[kind], KINDS[kind][3], mode, space)
            build(_Cell(number, image), uses_alpha)
        middle = (COLUMNS / 2, -rows / 2, 6)
        add_camera(middle, type="ORTHO", ortho_scale=max(COLUMNS, rows))
        pictures = [render(scene, engine, os.path.join(path, "p.exr"), samples=16) for engine in ("CYCLES", "RELIEF")]
    means = [p.reshape(rows, PIXELS, COLUMNS, PIXELS, 3)[:, 1:-1, :, 1:-1].mean(axis=(1, 3)) for p in pictures]
    expected, found = (m.reshape(-1, 3)[: len(cells)] for m in means)
    assert expected.max() > 0.1, "the picture is black"
    wrong = [
        f"{' '.join(map(str, cell))}: {e.round(4)} {f.round(4)}"
        for cell, e, f in zip(cells, expected, found)
        # Cycles' own bytes and halves are coarser than this in the darkest cells.
        if not np.allclose(e, f, rtol=0.01, atol=_coarseness(cell[0])) and not _is_known(*cell)
    ]
    print(len(cells) - len(wrong), "of", len(cells), "cells agree")
    assert not wrong, "cell: Cycles, relief\n" + "\n".join(wrong)


def test_colors():
    _assert_table(_as_color)


def test_masks():
    _assert_table(_as_mask)


def test_heights():
    # Of images that are divided by alpha no bounds are known, which is warned about.
    _assert_table(_as_height, strict=False)
