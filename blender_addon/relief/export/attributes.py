# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of meshes that value graphs read by name, as Cycles has them.

An attribute is a pair (kind, name): ("attribute", name) of any type, ("color", name) likewise, where "" is the colour that
is active in renders, ("uv", name) a uv map, ("pointiness", ""), ("island", ""), ("hair", what) of Curves Info and the axis of strands: see hair.py, and
("point", what) of Point Info: see points.py.
"""

import numpy as np

#: Property and components of the elements of an attribute, by its type.
_TYPES = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
}

#: Type that foreach_get wants, where it is not float32.
_DTYPES = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}


def file_name(attribute):
    """What an attribute is called in the file."""
    kind, name = attribute
    return f"_{kind.upper()}_{name}" if kind in {"attribute", "color", "uv", "hair", "point"} else f"_{kind.upper()}"


def read(attribute, mesh, vertex):
    """Values of an attribute at corners.

    @param  mesh    evaluated bpy mesh
    @param  vertex  vertex of each loop
    @return         float32 (loops, 1 to 4); None: the mesh has none
    """
    kind, name = attribute
    if kind in {"hair", "point"}:
        return None
    if kind == "pointiness":
        return _pointiness(mesh)[vertex, None]
    if kind == "island":
        return _islands(mesh)[vertex, None]
    if kind == "uv":
        return _uv(mesh, name)
    values = _named(mesh, name, vertex) if kind == "attribute" else _color(mesh, name, vertex)
    if values is None and kind == "attribute":
        values = _uv(mesh, name)
    if values is None and kind == "color":
        # Without it black and transparent, where others are opaque.
        values = np.zeros((len(vertex), 4), dtype=np.float32)
    return values


def _color(mesh, name, vertex):
    attributes = mesh.color_attributes
    if not name and len(attributes) > 0:
        name = attributes[max(attributes.render_color_index, 0)].name
    return _named(mesh, name, vertex)


def _named(mesh, name, vertex):
    attribute = mesh.attributes.get(name) if name else None
    if attribute is None or attribute.data_type not in _TYPES or attribute.domain not in {"POINT", "CORNER", "FACE"}:
        return None
    values = _elements(attribute)
    if attribute.domain == "POINT":
        return values[vertex]
    if attribute.domain == "FACE":
        sizes = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("loop_total", sizes)
        return values.repeat(sizes, axis=0)
    return values


def _elements(attribute):
    """float32 (elements, 1 to 4)"""
    prop, width = _TYPES[attribute.data_type]
    values = np.empty(width * len(attribute.data), dtype=_DTYPES.get(attribute.data_type, np.float32))
    attribute.data.foreach_get(prop, values)
    return values.astype(np.float32).reshape(-1, width)


def of_points(cloud, name):
    """Values of an attribute at the points of a point cloud: float32 (points, 1 to 4); None: there is none."""
    attribute = cloud.attributes.get(name) if name else None
    if attribute is None or attribute.data_type not in _TYPES or attribute.domain != "POINT":
        return None
    return _elements(attribute)


def _uv(mesh, name):
    layer = mesh.uv_layers.get(name) if name else next((a for a in mesh.uv_layers if a.active_render), None)
    if layer is None:
        return None
    uv = np.empty(2 * len(mesh.loops), dtype=np.float32)
    layer.data.foreach_get("uv", uv)
    return uv.reshape(-1, 2)


def _edges(mesh):
    edges = np.empty(2 * len(mesh.edges), dtype=np.int32)
    mesh.edges.foreach_get("vertices", edges)
    return edges.reshape(-1, 2)


def _positions(mesh):
    positions = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def _unit(vectors):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length == 0, 1, length)


#: Vertices at less than the root of this are one, if the sums of their coordinates differ by less than thrice this.
_WELDED = np.float32(1.1920929e-7)


def _welded(positions):
    """For each vertex the one that stands for all in its place: a later one by the sum of coordinates."""
    sums = positions.sum(axis=1, dtype=np.float32)
    order = np.argsort(sums, kind="stable")
    sums, sorted_positions = sums[order], positions[order]
    count = len(order)
    following = np.arange(count)
    waiting = np.arange(count - 1)
    step = 1
    while len(waiting):
        waiting = waiting[waiting + step < count]
        waiting = waiting[sums[waiting + step] - sums[waiting] <= 3 * _WELDED]
        apart = ((sorted_positions[waiting + step] - sorted_positions[waiting]) ** 2).sum(axis=1)
        found = waiting[apart < _WELDED]
        following[found] = found + step
        waiting = waiting[apart >= _WELDED]
        step += 1
    while True:
        further = following[following]
        if np.array_equal(further, following):
            break
        following = further
    stands_for = np.empty(count, dtype=np.int64)
    stands_for[order] = order[following]
    return stands_for


def _pointiness(mesh):
    """Mean angle between normal and edges over π, averaged over neighbours: float32 (vertices)."""
    positions = _positions(mesh)
    count = len(positions)
    if count == 0:
        return np.zeros(0, dtype=np.float32)
    stands_for = _welded(positions)
    own = np.empty(3 * count, dtype=np.float32)
    mesh.vertices.foreach_get("normal", own)
    normals = np.zeros((count, 3), dtype=np.float32)
    np.add.at(normals, stands_for, own.reshape(-1, 3))
    normals = _unit(normals)
    edges = stands_for[_edges(mesh)].reshape(-1, 2)
    _, first = np.unique(np.sort(edges, axis=1), axis=0, return_index=True)
    edges = edges[np.sort(first)]
    a, b = edges[:, 0], edges[:, 1]
    along = _unit(positions[b] - positions[a])
    sums = np.zeros((count, 3), dtype=np.float32)
    np.add.at(sums, a, along)
    np.add.at(sums, b, -along)
    number = np.bincount(edges.ravel(), minlength=count).astype(np.float32)
    cosine = (normals * (sums / np.maximum(number, 1)[:, None])).sum(axis=1)
    raw = np.where(number > 0, np.arccos(np.clip(cosine, -1, 1)) / np.float32(np.pi), 0).astype(np.float32)
    raw[stands_for != np.arange(count)] = 0
    data = raw.copy()
    np.add.at(data, a, raw[b])
    np.add.at(data, b, raw[a])
    return (data / (number + 1)).astype(np.float32)[stands_for]


def _islands(mesh):
    """A random number of each part of the mesh that edges connect: float32 (vertices)."""
    # Cycles hashes the vertex that its union by rank makes the root, so the unions are made in the same order.
    count = len(mesh.vertices)
    parents, ranks = list(range(count)), [0] * count

    def find(x):
        root = x
        while parents[root] != root:
            root = parents[root]
        while parents[x] != root:
            parents[x], x = root, parents[x]
        return root

    for x, y in _edges(mesh).tolist():
        x, y = find(x), find(y)
        if x == y:
            continue
        if ranks[x] < ranks[y]:
            x, y = y, x
        parents[y] = x
        if ranks[x] == ranks[y]:
            ranks[x] += 1
    roots = np.array([find(x) for x in range(count)], dtype=np.uint32)
    return hashed(roots)


def hashed(*keys):
    """Bob Jenkins' lookup3 of one or two 32-bit numbers each, as a number from 0 to 1: float32.

    @param  keys  one or two arrays of uint32
    """
    return to_unit(hash_bits(*keys))


def to_unit(bits):
    """32 bits as a number from 0 to 1, as Cycles rounds it."""
    return np.asarray(bits).astype(np.float32) * (np.float32(1) / np.float32(0xFFFFFFFF))


def hash_bits(*keys):
    """The bits of `hashed`: uint32."""
    keys = [np.atleast_1d(np.asarray(key, dtype=np.uint32)) for key in keys]
    start = np.full(keys[0].shape, (0xDEADBEEF + (len(keys) << 2) + 13) & 0xFFFFFFFF, dtype=np.uint32)
    a, b, c = start + keys[0], start.copy(), start.copy()
    if len(keys) > 1:
        b = b + keys[1]

    def rotated(x, k):
        return (x << np.uint32(k)) | (x >> np.uint32(32 - k))

    c = (c ^ b) - rotated(b, 14)
    a = (a ^ c) - rotated(c, 11)
    b = (b ^ a) - rotated(a, 25)
    c = (c ^ b) - rotated(b, 16)
    a = (a ^ c) - rotated(c, 4)
    b = (b ^ a) - rotated(a, 14)
    c = (c ^ b) - rotated(b, 24)
    return c
