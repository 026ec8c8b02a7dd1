# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a glTF file and the files it refers to. Knows nothing of Blender.

Buffers and images are named after their content: what is there already is not written again, so that a second frame in
which only the camera moved costs a few kilobytes.
"""

import contextlib
import hashlib
import json
import math
import os
import secrets
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np

from ..report import ReliefError

_COMPONENT_TYPES = {"float32": 5126, "uint32": 5125}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_NAME_BYTES = 16


def content_name(*parts):
    """Name of a file that says what is in it.

    @param  parts  objects with the buffer protocol, C-contiguous
    """
    digest = hashlib.blake2b(digest_size=_NAME_BYTES)
    for part in parts:
        digest.update(memoryview(part).cast("B"))
    return digest.hexdigest()


@dataclass(frozen=True)
class StoredArrays:
    """Arrays in a file of the data folder.

    uri        relative to the scene file
    accessors  by name: (glTF accessor without its buffer view, offset, bytes)
    """

    uri: str
    num_bytes: int
    accessors: dict


class GltfWriter:
    """Gathers a scene and writes it.

    json           the document so far
    folder         where the scene file will be; buffers and made images go to `data_folder`, a folder beside it
    used_files     names in the data folder that this scene refers to
    bytes_written  of buffers, images and the document
    """

    def __init__(self, folder, data_folder):
        self.folder = folder
        self.data_folder = data_folder
        self.json = {"asset": {"version": "2.0", "generator": "relief add-on for Blender"}}
        self.used_files = set()
        self.bytes_written = 0
        self._unique = {}
        self._buffers = {}
        os.makedirs(os.path.join(folder, data_folder), exist_ok=True)

    def add(self, kind, value):
        """Appends to one of the document's lists; returns its index."""
        values = self.json.setdefault(kind, [])
        values.append(value)
        return len(values) - 1

    def add_unique(self, kind, value):
        """Appends to one of the document's lists unless an equal value is there; returns its index."""
        key = (kind, json.dumps(value, sort_keys=True))
        if key not in self._unique:
            self._unique[key] = self.add(kind, value)
        return self._unique[key]

    def use_extension(self, name):
        """Lists an extension as used."""
        used = self.json.setdefault("extensionsUsed", [])
        if name not in used:
            used.append(name)

    def extend(self, target, name, value):
        """Puts an extension on an object of the document."""
        target.setdefault("extensions", {})[name] = value
        self.use_extension(name)

    def write_file(self, suffix, *parts):
        """Writes a file into the data folder unless it is there.

        @return  its URI, relative to the scene file
        """
        name = content_name(*parts) + suffix
        path = os.path.join(self.folder, self.data_folder, name)
        if name not in self.used_files and not os.path.exists(path):
            # A name promises its content.
            self.bytes_written += _write_whole(path, parts)
        self.used_files.add(name)
        return f"{self.data_folder}/{name}"

    def file_uri(self, path):
        """URI of a file anywhere: relative where that is possible, as on one drive, so that scenes can be moved."""
        path = os.path.abspath(path)
        try:
            path = os.path.relpath(path, self.folder)
        except ValueError:
            pass
        return quote(path.replace(os.sep, "/"), safe="/:")

    def add_accessors(self, arrays):
        """Puts arrays into one buffer.

        @param  arrays  C-contiguous float32 or uint32 arrays of shape (n,) or (n, 1…4) by name
        @return         accessor indices by the same names
        """
        return self.add_stored(self.store(arrays))

    def store(self, arrays):
        """Writes arrays as one file.

        @param  arrays  as for add_accessors
        @return         StoredArrays, which this document or a later one beside the same data folder may refer to
        """
        accessors, offset = {}, 0
        for name, array in arrays.items():
            accessor = {
                "componentType": _COMPONENT_TYPES[array.dtype.name],
                "count": len(array),
                "type": _SHAPES[1 if array.ndim == 1 else array.shape[1]],
            }
            if name.startswith("POSITION") or name == "input":  # glTF asks for bounds of positions and of times
                rows = array.reshape(len(array), -1)
                accessor["min"] = rows.min(axis=0).tolist()
                accessor["max"] = rows.max(axis=0).tolist()
            accessors[name] = (accessor, offset, array.nbytes)
            offset += array.nbytes
        return StoredArrays(self.write_file(".bin", *arrays.values()), offset, accessors)

    def add_stored(self, stored):
        """Refers to stored arrays; returns accessor indices by their names."""
        if stored.uri in self._buffers:
            return self._buffers[stored.uri]
        self.used_files.add(stored.uri.rpartition("/")[2])
        buffer = self.add("buffers", {"uri": stored.uri, "byteLength": stored.num_bytes})
        indices = {}
        for name, (accessor, offset, num_bytes) in stored.accessors.items():
            view = self.add("bufferViews", {"buffer": buffer, "byteOffset": offset, "byteLength": num_bytes})
            indices[name] = self.add("accessors", {"bufferView": view, **accessor})
        self._buffers[stored.uri] = indices
        return indices

    def add_texture(self, uri, wrap, nearest):
        """A texture of an image file.

        @param  wrap     glTF's wrap mode for both directions
        @param  nearest  no interpolation between texels
        @return          index
        """
        filters = {"magFilter": 9728 if nearest else 9729, "wrapS": wrap, "wrapT": wrap}
        image, sampler = self.add_unique("images", {"uri": uri}), self.add_unique("samplers", filters)
        return self.add_unique("textures", {"source": image, "sampler": sampler})

    def write(self, name):
        """Writes the document unless it is there; returns its path."""
        try:
            text = json.dumps(self.json, separators=(",", ":"), allow_nan=False).encode()
        except ValueError as cause:
            raise ReliefError(f"{_place_of_nonfinite(self.json)}: a number that is not finite") from cause
        path = os.path.join(self.folder, name)
        if _has_content(path, text):
            return path
        self.bytes_written += _write_whole(path, [text])
        return path


def _write_whole(path, parts):
    """Writes a file, which appears whole or not at all; returns the number of bytes.

    It is made under a name that nothing has: what stands there already may lead to any other file.
    """
    aside = os.path.join(os.path.dirname(path), f".relief-{secrets.token_hex(8)}.part")
    try:
        with open(aside, "xb") as file:
            count = sum(file.write(part) for part in parts)
        os.replace(aside, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.remove(aside)
        raise
    return count


def _has_content(path, content):
    """Whether a file is there already, which then stays what it is to the program."""
    if not os.path.exists(path) or os.path.getsize(path) != len(content):
        return False
    with open(path, "rb") as file:
        return file.read() == content


def _place_of_nonfinite(value, path=""):
    """Where in a document a number is not finite: keys and indices, names of what has one; "" if all are."""
    if isinstance(value, float):
        return path if not math.isfinite(value) else ""
    name = f' "{value["name"]}"' if isinstance(value, dict) and "name" in value else ""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return next(filter(None, (_place_of_nonfinite(part, f"{path}{name}/{key}") for key, part in parts)), "")


def matrix_property(matrix):
    """glTF's column-major list of a 4×4 matrix whose rows are given."""
    return [float(x) for x in np.asarray(matrix, dtype=np.float64).T.ravel()]
