"""Displaced surfaces as fine triangles, from the definition in docs/displacement.md. Shares no code with the renderer.

Triangles end where the height map's lattice does, since the surface has creases there; between them they are as fine
as asked for. They are meant to be flat shaded: what that does to a picture falls with the square of their size.
"""

from dataclasses import dataclass

import numpy as np

from examples import meshes


@dataclass
class HeightMap:
    """Texels in 0…1 as stored, row 0 at v = 0, and where they lie on a mesh: uv · tiles + offset, then repeated or clamped."""

    texels: np.ndarray
    scale: float
    midlevel: float
    tiles: tuple = (1.0, 1.0)
    offset: tuple = (0.0, 0.0)
    clamped: bool = False

    def lattice(self, uv):
        """Texture coordinates as positions on the lattice, whose integers are centres of texels."""
        rows, columns = self.texels.shape
        return (uv * np.array(self.tiles) + np.array(self.offset)) * (columns, rows) - 0.5

    def displacement(self, uv):
        """Metres along the unit normal at points of shape (…, 2)."""
        rows, columns = self.texels.shape
        position = self.lattice(uv)
        cell = np.floor(position).astype(int)
        x, y = np.moveaxis(position - cell, -1, 0)

        def texel(i, j):
            row, column = cell[..., 1] + j, cell[..., 0] + i
            if self.clamped:
                return self.texels[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
            return self.texels[row % rows, column % columns]

        h = (1 - y) * ((1 - x) * texel(0, 0) + x * texel(1, 0)) + y * ((1 - x) * texel(0, 1) + x * texel(1, 1))
        return self.scale * (h - self.midlevel)


def _clipped(polygon, axis, sign, border):
    """The part of a convex polygon of points (x, y, b0, b1, b2) where sign · (coordinate − border) ≥ 0."""
    kept = []
    for a, b in zip(polygon, polygon[1:] + polygon[:1]):
        side_a, side_b = sign * (a[axis] - border), sign * (b[axis] - border)
        if side_a >= 0:
            kept.append(a)
        if side_a * side_b < 0:
            t = side_a / (side_a - side_b)
            cut = a + t * (b - a)
            cut[axis] = border
            kept.append(cut)
    return kept


def _cells_of_triangle(corners):
    """A triangle's barycentric weights cut along integers of its lattice positions `corners`: triangles of shape (3, 3)."""
    start = [np.concatenate([corner, weights]) for corner, weights in zip(corners, np.eye(3))]
    low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
    pieces = []
    for i in range(low[0], max(high[0], low[0] + 1)):
        column = _clipped(_clipped(start, 0, 1, i), 0, -1, i + 1)
        for j in range(low[1], max(high[1], low[1] + 1)):
            polygon = column and _clipped(_clipped(column, 1, 1, j), 1, -1, j + 1)
            for k in range(1, len(polygon) - 1):
                piece = np.array([polygon[0][2:], polygon[k][2:], polygon[k + 1][2:]])
                if abs(np.linalg.det(piece)) > 1e-12:
                    pieces.append(piece)
    return pieces


def _split(weights, steps):
    """Each triangle of shape (n, 3, 3), corners by weights, cut into steps² equal ones."""
    corners = []
    for i in range(steps):
        for j in range(steps - i):
            corners.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < steps - 1:
                corners.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    part = np.array(corners) / steps
    part = np.concatenate([1 - part.sum(axis=-1, keepdims=True), part], axis=-1)
    return np.einsum("pcw,nwk->npck", part, weights).reshape(-1, 3, 3)


def as_mesh(corners):
    """A flat shaded mesh of triangles of shape (n, 3, 3), vertices at one place (in single precision) shared."""
    positions, index = np.unique(corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
    return meshes.Mesh(positions.tolist(), index.reshape(-1, 3).tolist())


def _displaced(mesh, triangle, weights, displacement):
    """Points at weights (…, 3) of base triangles: P + d · N/|N| with P, N and uv interpolated linearly."""
    corners = np.array(mesh.triangles)[triangle]
    P = np.einsum("...w,...wk->...k", weights, np.array(mesh.positions)[corners])
    N = np.einsum("...w,...wk->...k", weights, np.array(mesh.normals)[corners])
    uv = np.einsum("...w,...wk->...k", weights, np.array(mesh.uvs)[corners]) if mesh.uvs else None
    return P + displacement(P, uv)[..., None] * N / np.linalg.norm(N, axis=-1, keepdims=True)


def by_map(mesh, heights, steps):
    """The triangles (n, 3, 3) of a mesh displaced by a HeightMap; `steps` to a side of each piece of a cell."""
    pieces, owners = [], []
    for index, triangle in enumerate(mesh.triangles):
        cells = _cells_of_triangle(heights.lattice(np.array([mesh.uvs[corner] for corner in triangle])))
        pieces += cells
        owners += [index] * len(cells)
    weights = _split(np.array(pieces), steps)
    owner = np.repeat(owners, steps * steps)[:, None]
    return _displaced(mesh, np.broadcast_to(owner, weights.shape[:2]), weights, lambda _, uv: heights.displacement(uv))


def by_function(mesh, displacement, steps):
    """The triangles of a mesh displaced by a function of positions (…, 3), in metres; steps² of each."""
    count = len(mesh.triangles)
    weights = _split(np.broadcast_to(np.eye(3), (count, 3, 3)), steps)
    owner = np.repeat(np.arange(count), steps * steps)[:, None]
    return _displaced(mesh, np.broadcast_to(owner, weights.shape[:2]), weights, lambda P, _: displacement(P))


def seam_walls(mesh, heights):
    """Walls between the displaced borders of edges that have one place and normal but two texture coordinates.

    Only for seams along rows or columns of the map over one normal: borders are then straight between texels' centres.
    """
    edges = {}
    for triangle in mesh.triangles:
        for a, b in zip(triangle, triangle[1:] + triangle[:1]):
            if tuple(mesh.positions[a]) > tuple(mesh.positions[b]):
                a, b = b, a
            place = tuple(map(tuple, (mesh.positions[a], mesh.positions[b], mesh.normals[a], mesh.normals[b])))
            edges.setdefault(place, []).append((a, b))
    walls = []
    for (P0, P1, N, _), sides in edges.items():
        if len(sides) != 2 or sides[0] == sides[1]:
            continue
        ends = [np.array([mesh.uvs[a], mesh.uvs[b]]) for a, b in sides]
        places = {0.0, 1.0}
        for uv in ends:
            x0, x1 = heights.lattice(uv)
            for axis in np.nonzero(abs(x1 - x0) > 1e-9)[0]:
                low, high = sorted((x0[axis], x1[axis]))
                crossed = np.arange(np.ceil(low), high)
                places |= set(((crossed - x0[axis]) / (x1[axis] - x0[axis])).tolist())
        at = lambda f, uv: heights.displacement(uv[0] + f[:, None] * (uv[1] - uv[0]))  # noqa: E731
        f = np.array(sorted(places))
        difference = at(f, ends[0]) - at(f, ends[1])
        # Where the borders change sides the wall has no height, and a quad across would turn itself over.
        turns = np.nonzero(difference[1:] * difference[:-1] < 0)[0]
        t = difference[turns] / (difference[turns] - difference[turns + 1])
        f = np.sort(np.concatenate([f, f[turns] + t * (f[turns + 1] - f[turns])]))
        foot = np.array(P0) + f[:, None] * (np.array(P1) - np.array(P0))
        a, b = (foot + at(f, uv)[:, None] * np.array(N) for uv in ends)
        walls += [np.stack([a[:-1], a[1:], b[1:]], 1), np.stack([a[:-1], b[1:], b[:-1]], 1)]
    return np.concatenate(walls)
