"""What is known of images without decoding them: that it is what Blender says, and that no export has Blender decode one."""

import os
import struct
import zlib

import bpy
import numpy as np

from scenes import add_camera, add_plane, folder, new_scene, render, set_file_format

#: Colour types of PNG, and their channels.
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _filtered(row, above, pixel, kind):
    """A row of bytes as a PNG's filter leaves them, by its definition."""
    out = [kind]
    for i, byte in enumerate(row):
        a = row[i - pixel] if i >= pixel else 0
        b = above[i] if above is not None else 0
        c = above[i - pixel] if above is not None and i >= pixel else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out.append((byte - (0, a, b, (a + b) // 2, paeth)[kind]) % 256)
    return bytes(out)


def _png(values, depth, color, filters, extra=b""):
    """A PNG.

    @param  values   integers (height, width, channels)
    @param  filters  number of each row's
    """
    height, width, channels = values.shape
    if depth == 16:
        data = values.astype(">u2").view(np.uint8).reshape(height, -1)
    elif depth == 8:
        data = values.astype(np.uint8).reshape(height, -1)
    else:
        data = np.packbits(values.astype(np.uint8).reshape(height, -1), axis=1)
    rows = [row.tolist() for row in data]
    pixel = max(channels * depth // 8, 1)
    body = b"".join(_filtered(row, rows[y - 1] if y else None, pixel, filters[y]) for y, row in enumerate(rows))
    head = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    packed = zlib.compress(body)
    parts = [packed[: len(packed) // 2], packed[len(packed) // 2 :]]
    palette = _chunk(b"PLTE", bytes([10, 20, 30, 40, 50, 60])) if color == 3 else b""
    data = b"".join(_chunk(b"IDAT", part) for part in parts)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + palette + extra + data + _chunk(b"IEND", b"")


def test_headers_say_what_blender_says():
    new_scene()
    from relief.export import image, image_header

    with folder() as path:
        names = []
        transparent = {3: bytes([255, 100]), 2: bytes([0, 1] * 3), 0: bytes([0, 1])}
        for depth, color in ((8, 0), (16, 0), (1, 0), (8, 2), (16, 2), (8, 3), (8, 4), (16, 4), (8, 6), (16, 6)):
            for extra in (b"", _chunk(b"tRNS", transparent[color]) if color in transparent else b""):
                values = np.ones((8, 8, _CHANNELS[color]), dtype=int)
                names.append(os.path.join(path, f"{depth}_{color}_{len(extra)}.png"))
                with open(names[-1], "wb") as file:
                    file.write(_png(values, depth, color, [0] * 8, extra))
        plain = bpy.data.images.new("plain", 4, 4, alpha=True)
        plain.pixels.foreach_set(np.tile(np.float32([0.5, 0.25, 0.125, 0.5]), 16))
        for file_format, bits, suffix, modes in (
            ("JPEG", "8", ".jpg", ("BW", "RGB")),
            ("BMP", "8", ".bmp", ("RGB",)),
            ("TARGA", "8", ".tga", ("RGB", "RGBA")),
            ("TIFF", "8", ".tif", ("RGB", "RGBA")),
            ("TIFF", "16", ".tif", ("RGB", "RGBA")),
            ("WEBP", "8", ".webp", ("RGB", "RGBA")),
            ("OPEN_EXR", "32", ".exr", ("RGB", "RGBA")),
            ("HDR", "32", ".hdr", ("RGB",)),
        ):
            for mode in modes:
                set_file_format(file_format, bits, color_mode=mode)
                names.append(os.path.join(path, f"{file_format}_{bits}_{mode}{suffix}"))
                plain.save_render(names[-1], scene=bpy.context.scene)
        for name in names:
            loaded = bpy.data.images.load(name)
            found = image_header.read_header(image_header.file_head(loaded), name)
            is_transparent = image.has_transparency(loaded)
            assert found == image_header.Header(loaded.channels, loaded.is_float), (name, found)
            pixels = np.empty(4 * loaded.size[0] * loaded.size[1], dtype=np.float32)
            loaded.pixels.foreach_get(pixels)
            assert is_transparent == (pixels[3::4] < 1).any(), name


def test_opaque_pngs_are_told_without_their_pixels():
    new_scene()
    from relief.export.image_header import png_is_opaque

    random = np.random.default_rng(1)
    for number in range(200):
        depth, color = (8, 16)[number % 2], (4, 6)[number // 2 % 2]
        height, width = random.integers(1, 9, 2)
        values = random.integers(0, 2**depth, (height, width, _CHANNELS[color]))
        values[..., -1] = 2**depth - 1
        filters = random.integers(0, 5, height)
        assert png_is_opaque(_png(values, depth, color, filters)) is True, number
        values[random.integers(height), random.integers(width), -1] -= random.integers(1, 2**depth)
        data = _png(values, depth, color, filters)
        assert png_is_opaque(data) is False, number
        assert png_is_opaque(data[: len(data) // 2]) is not True, number
    assert png_is_opaque(_png(np.ones((2, 2, 3), dtype=int), 8, 2, [0, 0])) is None


def _textured(image, linked):
    """Material of a plane that has an image as its colour, or the height of a bump."""
    material = bpy.data.materials.new("textured")
    material.use_nodes = True
    tree, shader = material.node_tree, material.node_tree.nodes["Principled BSDF"]
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    if linked == "Normal":
        bump = tree.nodes.new("ShaderNodeBump")
        tree.links.new(texture.outputs["Color"], bump.inputs["Height"])
        tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    else:
        tree.links.new(texture.outputs["Color"], shader.inputs[linked])
    return material


def test_no_image_is_decoded_by_an_export():
    random = np.random.default_rng(2)
    for depth, color, linked, is_packed in (
        (8, 6, "Base Color", False),
        (8, 6, "Base Color", True),
        (8, 2, "Base Color", True),
        (16, 0, "Base Color", False),
        (16, 0, "Normal", False),
        (16, 6, "Normal", True),
        (8, 0, "Roughness", False),
    ):
        scene = new_scene()
        with folder() as path:
            values = random.integers(0, 2**depth, (8, 8, _CHANNELS[color]))
            values[..., -1] = 2**depth - 1
            name = os.path.join(path, "texture.png")
            with open(name, "wb") as file:
                file.write(_png(values, depth, color, [4] * 8))
            image = bpy.data.images.load(name)
            if linked != "Base Color":
                image.colorspace_settings.name = "Non-Color"
            if is_packed:
                image.pack()
                image.buffers_free()
            add_camera()
            add_plane(2).data.materials.append(_textured(image, linked))
            assert not image.has_data
            render(scene, "RELIEF", os.path.join(path, "picture.exr"), samples=1)
            assert not image.has_data, (depth, color, linked, is_packed)
