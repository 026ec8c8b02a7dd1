"""A studio still life: a textured vase with a lacquered stopper, a brass bowl and a velvet runner on a cyclorama."""

import math

from . import images
from .gltf import Document, dielectric, lambert, metal
from .meshes import catmull_rom, height_field, lathe, swept
from .vector import mix, normalize, smoothstep

TEXTURE_WIDTH, TEXTURE_HEIGHT = 448, 384
GOLD_BANDS = ((0.295, 0.305), (0.545, 0.555))  # v ranges; clay between the two, glaze elsewhere


def _height(u, v):
    """Relief of the vase's wall in texture space, arbitrary units: a wheel-thrown clay band, a leaf-like diaper."""
    inside = smoothstep(0.305, 0.312, v) * smoothstep(0.545, 0.538, v)
    # Two families of spirals that cross: raised lozenges, sixteen around.
    phase = (v - 0.425) * 42.0
    lozenge = math.cos(16 * math.pi * u + phase) * math.cos(16 * math.pi * u - phase)
    carved = smoothstep(-0.15, 0.25, lozenge)
    return inside * carved


def _textures():
    """Rows of the vase's base colour (sRGB bytes), metallic-roughness and normal maps."""
    glaze_low, glaze_high = (0.010, 0.055, 0.115), (0.045, 0.22, 0.27)
    clay, gold = (0.55, 0.36, 0.22), (1.0, 0.70, 0.30)
    heights = [
        [_height((x + 0.5) / TEXTURE_WIDTH, (y + 0.5) / TEXTURE_HEIGHT) for x in range(TEXTURE_WIDTH)]
        for y in range(TEXTURE_HEIGHT)
    ]
    color_rows, surface_rows, normal_rows = [], [], []
    for y in range(TEXTURE_HEIGHT):
        v = (y + 0.5) / TEXTURE_HEIGHT
        is_gold = any(low <= v <= high for low, high in GOLD_BANDS)
        is_clay = GOLD_BANDS[0][1] < v < GOLD_BANDS[1][0]
        color_row, surface_row, normal_row = [], [], []
        for x in range(TEXTURE_WIDTH):
            u = (x + 0.5) / TEXTURE_WIDTH
            # A period of 8 cells around closes the noise at the texture's seam.
            cloud = images.noise(u * 8, v * 9, 0.5, (8, 0, 0)) * 0.65 + images.noise(
                u * 32, v * 30, 3.5, (32, 0, 0)
            ) * 0.35
            if is_gold:
                color, metallic, roughness = gold, 255, 0.22
            elif is_clay:
                raised = heights[y][x]
                color = mix(mix((0.16, 0.08, 0.05), clay, 0.35 + 0.65 * cloud), (0.86, 0.80, 0.68), raised)
                metallic, roughness = 0, 0.85 - 0.45 * raised
            else:
                run = smoothstep(0.25, 0.75, cloud)
                color = mix(glaze_low, glaze_high, run)
                metallic, roughness = 0, 0.10 + 0.10 * cloud
            color_row.append(tuple(images.srgb_byte(channel) for channel in color))
            surface_row.append((255, int(roughness * 255 + 0.5), metallic))
            above, below = heights[max(y - 1, 0)][x], heights[min(y + 1, TEXTURE_HEIGHT - 1)][x]
            slope_u = (heights[y][(x + 1) % TEXTURE_WIDTH] - heights[y][x - 1]) / 2
            slope_v = (below - above) / 2
            # glTF: +X of a normal map goes with u, +Y against v's downward direction.
            normal = normalize((-1.6 * slope_u, 1.6 * slope_v, 1.0))
            normal_row.append(tuple(int(channel * 127.5 + 128.0) for channel in normal))
        color_rows.append(color_row)
        surface_rows.append(surface_row)
        normal_rows.append(normal_row)
    return color_rows, surface_rows, normal_rows


def _studio():
    return images.layered(
        images.sky(horizon=(0.30, 0.30, 0.32), zenith=(0.16, 0.17, 0.20), ground=(0.14, 0.13, 0.12)),
        images.soft_box((-0.95, 0.55, 0.45), 0.36, 0.46, (11.0, 10.2, 9.0)),
        images.soft_box((0.9, 0.35, 0.25), 0.12, 0.55, (5.0, 5.6, 6.4)),
        images.soft_box((0.1, 0.95, -0.25), 0.50, 0.28, (4.5, 4.4, 4.2)),
    )


def _cloth_height(x, z):
    """A velvet runner in metres: long folds that grow towards its ends and lie flat below the vase."""
    reach = smoothstep(0.12, 0.62, math.hypot(x * 0.8, z))
    folds = math.sin(19 * x + 5 * z + 1.5 * math.sin(5 * z)) + 0.5 * math.sin(33 * x - 9 * z)
    return 0.004 + 0.016 * reach * (1.5 + folds)


def build():
    document = Document("product", {"resolution": [640, 640], "samples": 64, "maxBounces": 8})
    document.set_environment("studio.hdr", images.environment(_studio()), strength=0.5)

    wall = [(2.0, 0.0), (-0.9, 0.0)]
    wall += [
        (-0.9 - 0.8 * math.sin(a), 0.8 - 0.8 * math.cos(a)) for a in (math.pi / 2 * i / 24 for i in range(1, 25))
    ]
    wall += [(-1.7, 3.5)]
    paper = document.add_material(lambert("paper", (0.60, 0.56, 0.52)))
    document.add_node("cyclorama", mesh=document.add_mesh("cyclorama", swept(wall, 4.0), paper))

    color, surface, normal = (images.png(rows) for rows in _textures())
    vase_material = dielectric("vase", (1, 1, 1), 1.0, metallic=1.0)
    vase_material["pbrMetallicRoughness"].update(
        baseColorTexture={"index": document.add_texture("vase_color.png", color)},
        metallicRoughnessTexture={"index": document.add_texture("vase_surface.png", surface)},
    )
    vase_material["normalTexture"] = {"index": document.add_texture("vase_normal.png", normal)}
    outside = catmull_rom(
        [
            (0.0, 0.0), (0.150, 0.0), (0.172, 0.012), (0.225, 0.11), (0.262, 0.235), (0.250, 0.36),
            (0.185, 0.475), (0.105, 0.56), (0.072, 0.635), (0.073, 0.700), (0.100, 0.752), (0.107, 0.760),
            (0.100, 0.764), (0.074, 0.742), (0.060, 0.700), (0.058, 0.62),
        ],
        4,
    )
    ground = 0.006
    document.add_node(
        "vase",
        mesh=document.add_mesh("vase", lathe(outside, 72), document.add_material(vase_material)),
        translation=[-0.06, ground + 0.008, 0],
    )

    lacquer = dielectric("red lacquer", (0.42, 0.012, 0.010), 0.45)
    lacquer["extensions"] = {
        "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.03}
    }
    stopper = catmull_rom(
        [(0.0, 0.0), (0.050, 0.0), (0.056, 0.06), (0.056, 0.08), (0.084, 0.094), (0.088, 0.104), (0.070, 0.116),
         (0.034, 0.136), (0.034, 0.152), (0.066, 0.190), (0.074, 0.226), (0.052, 0.270), (0.0, 0.288)],
        3,
    )
    document.add_node(
        "stopper",
        mesh=document.add_mesh("stopper", lathe(stopper, 40), document.add_material(lacquer)),
        translation=[-0.06, ground + 0.680, 0],
    )

    brass = document.add_material(metal("brass", (0.91, 0.72, 0.40), 0.18))
    bowl = catmull_rom(
        [(0.0, 0.0), (0.055, 0.0), (0.060, 0.012), (0.105, 0.045), (0.134, 0.105), (0.137, 0.110), (0.133, 0.112),
         (0.127, 0.105), (0.098, 0.053), (0.050, 0.022), (0.0, 0.018)],
        3,
    )
    document.add_node(
        "bowl", mesh=document.add_mesh("bowl", lathe(bowl, 40), brass), translation=[0.31, ground + 0.014, 0.21]
    )

    velvet = dielectric("velvet", (0.085, 0.012, 0.045), 1.0)
    velvet["extensions"] = {
        "KHR_materials_sheen": {"sheenColorFactor": [0.50, 0.16, 0.30], "sheenRoughnessFactor": 0.35}
    }
    runner = height_field(_cloth_height, 0.62, 0.36, 80, 44)
    half = math.radians(14) / 2
    document.add_node(
        "runner",
        mesh=document.add_mesh("runner", runner, document.add_material(velvet)),
        rotation=[0, math.sin(half), 0, math.cos(half)],
        translation=[0.06, 0.0, 0.06],
    )

    lens = {"apertureRadius": 0.012, "focusDistance": 2.45}
    document.add_camera((0.15, 0.86, 2.55), (0.04, 0.40, 0.0), 27, lens)
    return document
