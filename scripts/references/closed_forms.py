"""Pictures by formula, in double precision, of the scenes in scenes.py. Shares no code with the renderer.

Every function returns radiance of shape (height, width, 3), the mean over each pixel's square.
"""

import math

import numpy as np

from . import scenes


def _camera_rays(camera, width, height, subdivisions):
    """Directions through the centres of `subdivisions`² cells of every pixel: shape (height, width, cells, 3)."""
    eye, target = np.array(camera["eye"]), np.array(camera["target"])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    tangent = math.tan(camera["vertical_degrees"] * math.pi / 360)
    x = (np.arange(width * subdivisions) + 0.5) / (width * subdivisions) * 2 - 1
    y = 1 - (np.arange(height * subdivisions) + 0.5) / (height * subdivisions) * 2
    x, y = np.meshgrid(x * tangent * width / height, y * tangent)
    directions = forward + x[..., None] * right + y[..., None] * up
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    cells = directions.reshape(height, subdivisions, width, subdivisions, 3)
    return cells.transpose(0, 2, 1, 3, 4).reshape(height, width, subdivisions**2, 3)


def _floor_points(subdivisions):
    width, height = scenes.RESOLUTION
    eye = np.array(scenes.CAMERA["eye"])
    directions = _camera_rays(scenes.CAMERA, width, height, subdivisions)
    assert (directions[..., 1] < 0).all()
    return eye - directions * (eye[1] / directions[..., 1:2])


def rectangle_floor():
    """Lambert's formula for a polygon: E = L/2 Σ Θᵢ n·Γᵢ over its edges, Θᵢ the angle an edge spans and Γᵢ the unit
    normal of the plane through the edge and the point (J. H. Lambert 1760, Photometria)."""
    light = scenes.RECTANGLE
    eye = np.array(light["eye"])
    axis = np.array(light["target"]) - eye
    axis /= np.linalg.norm(axis)
    right = np.cross(axis, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    u, v = right * light["width"] / 2, np.cross(right, axis) * light["height"] / 2
    corners = [eye - u - v, eye + u - v, eye + u + v, eye - u + v]
    points = _floor_points(4)
    assert all(corner[1] > 0 for corner in corners)  # the formula wants the whole polygon above the horizon
    is_in_front = (points - eye) @ axis > 0
    irradiance = np.zeros(points.shape[:-1])
    for i in range(4):
        a = corners[i] - points
        b = corners[(i + 1) % 4] - points
        normal = np.cross(a, b)
        length = np.linalg.norm(normal, axis=-1)
        angle = np.arctan2(length, (a * b).sum(axis=-1))
        irradiance += 0.5 * angle * normal[..., 1] / length
    seen = np.where(is_in_front, abs(irradiance), 0).mean(axis=-1)
    return seen[..., None] * np.multiply(light["radiance"], scenes.FLOOR_COLOR) / math.pi


def punctual_floor():
    """E = I cos θ / r² of the point and of the spot, whose cone fades as KHR_lights_punctual recommends, and E cos θ of
    the sun, whose rays a parallelogram stops."""
    points = _floor_points(32)
    irradiance = np.zeros((*points.shape[:-1], 3))
    for light, position in ((scenes.POINT, scenes.POINT["position"]), (scenes.SPOT, scenes.SPOT["eye"])):
        to_light = np.array(position) - points
        squared = (to_light**2).sum(axis=-1)
        falloff = to_light[..., 1] / squared**1.5
        if light is scenes.SPOT:
            axis = np.array(light["target"]) - np.array(light["eye"])
            cosine = -(to_light @ axis) / np.sqrt(squared) / np.linalg.norm(axis)
            inner, outer = math.cos(light["inner"]), math.cos(light["outer"])
            falloff *= np.clip((cosine - outer) / (inner - outer), 0, 1) ** 2
        irradiance += falloff[..., None] * np.array(light["intensity"])
    towards = np.array(scenes.SUN["towards"])
    towards /= np.linalg.norm(towards)
    # Where P + t·towards = corner + a·u + b·v; in the blocker if both a and b lie in [0, 1].
    columns = np.array([scenes.BLOCKER["edge_u"], scenes.BLOCKER["edge_v"], -towards]).T
    a, b, _ = np.moveaxis((points - scenes.BLOCKER["corner"]) @ np.linalg.inv(columns).T, -1, 0)
    lit = ~((a > 0) & (a < 1) & (b > 0) & (b < 1))
    irradiance += lit[..., None] * towards[1] * np.array(scenes.SUN["irradiance"])
    return irradiance.mean(axis=2) * np.array(scenes.FLOOR_COLOR) / math.pi


def environment_polyhedron():
    """Each face has one radiance, albedo/π ∫ L(ω) max(n·ω, 0) dω: quadrature over the map's bilinear interpolation."""
    map_ = scenes.environment_map()
    rows, columns = map_.shape[:2]
    steps = 64  # of the quadrature, per texel and axis
    v = (np.arange(rows * steps) + 0.5) / steps - 0.5
    u = (np.arange(columns * steps) + 0.5) / steps - 0.5
    below, left = np.floor(v).astype(int), np.floor(u).astype(int)
    fv, fu = (v - below)[:, None, None], (u - left)[None, :, None]
    # Around the circle the map repeats; beyond the poles there is nothing, so the last row goes on.
    at = lambda i, j: map_[np.clip(below + i, 0, rows - 1)][:, (left + j) % columns]  # noqa: E731
    radiance = (1 - fv) * ((1 - fu) * at(0, 0) + fu * at(0, 1)) + fv * ((1 - fu) * at(1, 0) + fu * at(1, 1))
    theta = math.pi * (v + 0.5) / rows
    phi = 2 * math.pi * ((u + 0.5) / columns - 0.5)
    # The map's centre looks along −Z, its right half is +X; the rotation turns the surroundings about +Y.
    x, z = np.sin(theta)[:, None] * np.sin(phi), -np.sin(theta)[:, None] * np.cos(phi)
    c, s = math.cos(scenes.ROTATION), math.sin(scenes.ROTATION)
    direction = np.stack([c * x + s * z, np.broadcast_to(np.cos(theta)[:, None], x.shape), c * z - s * x], axis=-1)
    weight = np.sin(theta)[:, None] * (math.pi / theta.size) * (2 * math.pi / phi.size)

    width, height = scenes.RESOLUTION
    solid = scenes.polyhedron()
    corners = np.array(solid.positions)
    eye = np.array(scenes.POLYHEDRON_CAMERA["eye"])
    rays = _camera_rays(scenes.POLYHEDRON_CAMERA, width, height, 32)
    entry, exit_ = np.full(rays.shape[:-1], -np.inf), np.full(rays.shape[:-1], np.inf)
    face = np.full(rays.shape[:-1], -1)
    shades = np.zeros((len(solid.triangles) + 1, 3))  # the last one is the background's
    for i, triangle in enumerate(solid.triangles):
        p, q, r = corners[list(triangle)]
        normal = np.cross(q - p, r - p)
        normal /= np.linalg.norm(normal)
        cosine = np.maximum(direction @ normal, 0) * weight
        shades[i] = np.einsum("ij,ijc->c", cosine, radiance) * np.array(scenes.FLOOR_COLOR) / math.pi
        # The solid is where all half spaces overlap: a ray enters through the last plane it meets from outside.
        speed = rays @ normal
        t = np.dot(p - eye, normal) / speed
        later = (speed < 0) & (t > entry)
        entry[later], face[later] = t[later], i
        exit_ = np.where(speed > 0, np.minimum(exit_, t), exit_)
    face[entry >= exit_] = len(solid.triangles)
    return shades[face].mean(axis=2)


CLOSED_FORMS = {
    "rectangle_floor": rectangle_floor,
    "punctual_floor": punctual_floor,
    "environment_polyhedron": environment_polyhedron,
}
