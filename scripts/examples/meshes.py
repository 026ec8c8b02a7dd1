"""Triangle meshes made by formula. Front faces are counter-clockwise seen from outside; glTF's UV origin is top left."""

import math
from dataclasses import dataclass, field

from . import vector


@dataclass
class Mesh:
    """Vertices in object space, metres. Without normals the mesh is shaded flat; uvs may be empty too."""

    positions: list
    triangles: list
    normals: list = field(default_factory=list)
    uvs: list = field(default_factory=list)


def quad(corner, edge_u, edge_v):
    """A parallelogram whose front is the side of cross(edge_u, edge_v)."""
    far = vector.add(vector.add(corner, edge_u), edge_v)
    positions = [corner, vector.add(corner, edge_u), far, vector.add(corner, edge_v)]
    return Mesh(positions, [(0, 1, 2), (0, 2, 3)])


def box(size):
    """A box of the given size, its base's centre at the origin."""
    x, y, z = size[0] / 2, size[1], size[2] / 2
    sides = [
        quad((-x, 0, z), (2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, -z), (-2 * x, 0, 0), (0, y, 0)),
        quad((x, 0, z), (0, 0, -2 * z), (0, y, 0)),
        quad((-x, 0, -z), (0, 0, 2 * z), (0, y, 0)),
        quad((-x, y, z), (2 * x, 0, 0), (0, 0, -2 * z)),
        quad((-x, 0, -z), (2 * x, 0, 0), (0, 0, 2 * z)),
    ]
    return joined(sides)


def joined(parts):
    """One mesh of several; all of them have normals, or none, and likewise uvs."""
    result = Mesh([], [])
    for part in parts:
        first = len(result.positions)
        result.positions += part.positions
        result.normals += part.normals
        result.uvs += part.uvs
        result.triangles += [tuple(first + i for i in triangle) for triangle in part.triangles]
    return result


def inside_out(mesh):
    """The same surface seen from its other side."""
    normals = [vector.scale(n, -1.0) for n in mesh.normals]
    return Mesh(mesh.positions, [(a, c, b) for a, b, c in mesh.triangles], normals, mesh.uvs)


def uv_sphere(radius, segments, rings):
    """A smooth sphere about the origin, its poles on the y axis."""
    positions, normals = [], []
    for ring in range(rings + 1):
        theta = math.pi * ring / rings
        for segment in range(segments + 1):
            phi = 2.0 * math.pi * segment / segments
            normal = (math.sin(theta) * math.cos(phi), math.cos(theta), -math.sin(theta) * math.sin(phi))
            normals.append(normal)
            positions.append(vector.scale(normal, radius))
    triangles = []
    for ring in range(rings):
        for segment in range(segments):
            a = ring * (segments + 1) + segment
            below = a + segments + 1
            if ring > 0:
                triangles.append((a, below, a + 1))
            if ring < rings - 1:
                triangles.append((a + 1, below, below + 1))
    return Mesh(positions, triangles, normals)


def icosphere(subdivisions):
    """A unit icosahedron, each triangle split into four `subdivisions` times; flat shaded."""
    golden = (1 + 5**0.5) / 2
    positions = []
    for a in (-1.0, 1.0):
        for b in (-golden, golden):
            positions += [(0.0, a, b), (a, b, 0.0), (b, 0.0, a)]
    positions = [vector.normalize(p) for p in positions]
    edge = min(
        vector.dot(vector.subtract(p, positions[0]), vector.subtract(p, positions[0])) for p in positions[1:]
    )

    def adjacent(i, j):
        d = vector.subtract(positions[i], positions[j])
        return vector.dot(d, d) < 1.01 * edge

    triangles = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if adjacent(i, j) and adjacent(j, k) and adjacent(i, k):
                    outward = vector.dot(vector.cross(positions[i], positions[j]), positions[k]) > 0
                    triangles.append((i, j, k) if outward else (i, k, j))
    for _ in range(subdivisions):
        middles = {}

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                middles[key] = len(positions)
                positions.append(vector.normalize(vector.add(positions[i], positions[j])))
            return middles[key]

        split = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = split
    return Mesh(positions, triangles)


def catmull_rom(points, steps):
    """A smooth curve through 2D points, `steps` segments between each pair."""
    padded = [points[0], *points, points[-1]]
    curve = []
    for i in range(len(points) - 1):
        p0, p1, p2, p3 = padded[i : i + 4]
        for step in range(steps):
            t = step / steps
            curve.append(
                tuple(
                    0.5
                    * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t + (3 * b - a - 3 * c + d) * t**3)
                    for a, b, c, d in zip(p0, p1, p2, p3)
                )
            )
    curve.append(points[-1])
    return curve


def lathe(profile, segments):
    """Turns a profile of (radius, height) about the y axis.

    The outside lies to the right of the profile's direction: a vase goes upwards. u runs around; v follows the
    profile's length, 1 at its start (glTF's v grows downwards).
    """
    lengths = [0.0]
    for (r0, y0), (r1, y1) in zip(profile, profile[1:]):
        lengths.append(lengths[-1] + math.hypot(r1 - r0, y1 - y0))
    positions, normals, uvs = [], [], []
    for i, (radius, height) in enumerate(profile):
        before, after = profile[max(i - 1, 0)], profile[min(i + 1, len(profile) - 1)]
        tangent = (after[0] - before[0], after[1] - before[1])
        norm = math.hypot(*tangent)
        outward, upward = tangent[1] / norm, -tangent[0] / norm
        for segment in range(segments + 1):
            phi = 2.0 * math.pi * segment / segments
            c, s = math.cos(phi), -math.sin(phi)
            positions.append((radius * c, height, radius * s))
            normals.append((outward * c, upward, outward * s))
            uvs.append((segment / segments, 1.0 - lengths[i] / lengths[-1]))
    triangles = []
    for i in range(len(profile) - 1):
        for segment in range(segments):
            a = i * (segments + 1) + segment
            above = a + segments + 1
            if profile[i][0] > 0:
                triangles.append((a, a + 1, above))
            if profile[i + 1][0] > 0:
                triangles.append((a + 1, above + 1, above))
    return Mesh(positions, triangles, normals, uvs)


def _grid(columns, rows):
    """Triangles between (columns + 1) × (rows + 1) points in rows."""
    triangles = []
    for row in range(rows):
        for column in range(columns):
            a = row * (columns + 1) + column
            below = a + columns + 1
            triangles += [(a, below, below + 1), (a, below + 1, a + 1)]
    return triangles


def ground(half, squares):
    """squares × squares squares about the origin, facing up, with texture coordinates."""
    steps = [i / squares for i in range(squares + 1)]
    positions = [(half * (2 * u - 1), 0.0, half * (2 * v - 1)) for v in steps for u in steps]
    uvs = [(u, v) for v in steps for u in steps]
    return Mesh(positions, _grid(squares, squares), [(0.0, 1.0, 0.0)] * len(positions), uvs)


def height_field(height, half_width, half_depth, columns, rows):
    """A smooth surface y = height(x, z) over a rectangle about the origin, facing up."""
    positions, normals = [], []
    delta = 0.05 * min(half_width / columns, half_depth / rows)
    for row in range(rows + 1):
        z = half_depth * (2.0 * row / rows - 1.0)
        for column in range(columns + 1):
            x = half_width * (2.0 * column / columns - 1.0)
            slope_x = (height(x + delta, z) - height(x - delta, z)) / (2 * delta)
            slope_z = (height(x, z + delta) - height(x, z - delta)) / (2 * delta)
            positions.append((x, height(x, z), z))
            normals.append(vector.normalize((-slope_x, 1.0, -slope_z)))
    return Mesh(positions, _grid(columns, rows), normals)


def swept(profile, half_width):
    """A profile of (z, y) points drawn along x: a cyclorama. Its front lies to the left of the profile's direction
    when one looks along −x with z to the right: floor first (towards −z), then the wall."""
    positions, normals = [], []
    for i, (z, y) in enumerate(profile):
        before, after = profile[max(i - 1, 0)], profile[min(i + 1, len(profile) - 1)]
        tangent = (after[0] - before[0], after[1] - before[1])
        norm = math.hypot(*tangent)
        normal = (0.0, -tangent[0] / norm, tangent[1] / norm)
        for x in (-half_width, half_width):
            positions.append((x, y, z))
            normals.append(normal)
    triangles = []
    for i in range(len(profile) - 1):
        a = 2 * i
        triangles += [(a, a + 1, a + 3), (a, a + 3, a + 2)]
    return Mesh(positions, triangles, normals)
