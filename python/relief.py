"""Scenes rendered to arrays of numpy, and rays traced in them: runs the program `relief`, and reads what it writes.

    import relief

    scene = relief.load("examples/product/product.gltf")
    picture = scene.render(spp=64, resolution=(640, 360))           # height × width × RGBA, linear, float32
    layers = scene.render(spp=16, layers=["depth", "normal"])       # {"beauty": …, "depth": …, "normal": …}
    hits = scene.trace([[0, 0, 5, 0, 0, -1]])                       # {"hit": …, "t": …, "P": …, "N": …, …}

The program is $RELIEF_BINARY or `relief` on the PATH. Each call is one run of it, which loads the scene anew. Needs numpy.
"""

import os
import shutil
import struct
import subprocess
import tempfile

import numpy as np


class ReliefError(RuntimeError):
    """What the program said when it failed."""


def load(path, **options):
    """A scene, once the program has loaded it without an error.

    @param path     .gltf or .glb
    @param options  of `relief info` as Scene.render takes its own, for this check alone
    """
    _run("info", os.fspath(path), *_words(options))
    return Scene(os.path.abspath(path))


class Scene:
    """A scene's file; see load."""

    def __init__(self, path):
        self.path = path

    def render(self, layers=None, **options):
        """Renders the scene.

        @param layers   names of layers besides the picture (docs/usage.md); None: the picture alone
        @param options  of `relief render`: max_bounces=4 is --max-bounces 4, strict=True is --strict, and a list or tuple is joined as
                        the option wants it, resolution=(640, 360)
        @return  RGBA, height × width × 4; with layers a dictionary of arrays by name, "beauty" among them, those of one channel
                 without a third axis. Rows from the top; float32 or uint32
        @error   ReliefError
        """
        with tempfile.TemporaryDirectory(prefix="relief_") as folder:
            file = os.path.join(folder, "picture.exr")
            _run("render", self.path, "-o", file, "--float", "--compression", "none", "--progress", "none",
                 "--aov", ",".join(["beauty", *(layers or ())]), *_words(options))
            with open(file, "rb") as stream:
                found = _layers(stream.read())
        return found if layers is not None else found["beauty"]

    def trace(self, rays, **options):
        """The nearest hits of rays.

        @param rays     n × 6, origin and direction in world space, or n × 8 with tmin and tmax
        @param options  of `relief trace`, as those of render
        @return  a dictionary of arrays of n: "hit" (bool), "t" in lengths of the direction, "P" and "N" (n × 3; N is geometric and
                 unit), "uv" (n × 2, weights of the triangle's second and third vertex), "mesh", "triangle" (−1: none), "steps" in
                 displaced meshes. What a miss has none of is NaN
        @error   ReliefError; ValueError for another shape
        """
        rays = np.asarray(rays, dtype=np.float64)
        if rays.ndim != 2 or rays.shape[1] not in (6, 8):
            raise ValueError(f"rays: expected n × 6 or n × 8 numbers, found the shape {rays.shape}")
        with tempfile.TemporaryDirectory(prefix="relief_") as folder:
            ray_file, hit_file = os.path.join(folder, "rays.txt"), os.path.join(folder, "hits.csv")
            np.savetxt(ray_file, rays, fmt="%.17g")
            _run("trace", self.path, "--rays", ray_file, "-o", hit_file, *_words(options))
            columns = np.genfromtxt(hit_file, delimiter=",", names=True, dtype=np.float64, ndmin=1)

        def together(*names):
            return np.stack([columns[n] for n in names], axis=1)

        def index(name):
            return np.where(np.isnan(columns[name]), -1, columns[name]).astype(np.int64)

        return {"hit": columns["hit"] == 1, "t": columns["t"], "P": together("px", "py", "pz"), "N": together("nx", "ny", "nz"),
                "uv": together("u", "v"), "mesh": index("mesh"), "triangle": index("triangle"), "steps": columns["steps"]}


def _run(*arguments):
    program = os.environ.get("RELIEF_BINARY") or shutil.which("relief")
    if not program:
        raise ReliefError("the relief program was not found: put it on the PATH or name it in $RELIEF_BINARY")
    try:
        run = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    except OSError as cause:
        raise ReliefError(f"{program} cannot be run: {cause.strerror}") from cause
    if run.returncode != 0:
        raise ReliefError(run.stderr.strip().removeprefix("relief: ") or f"relief ended with code {run.returncode}")


def _words(options):
    """Options of the command line for keyword arguments."""
    words = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            joint = "x" if name == "resolution" else ","
            words += [option, joint.join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)]
    return words


#: Channels of a layer in the order of its array's last axis; the others by name.
_ORDERS = ("RGBA", "XYZ", "UV")
_TYPES = (np.dtype("<u4"), np.dtype("<f2"), np.dtype("<f4"))


def _layers(data):
    """Layers of an OpenEXR file of scanlines that is not compressed, as relief writes it: {name: array}."""
    header, at = {}, 8
    while data[at]:
        end = data.index(b"\0", at)
        type_end = data.index(b"\0", end + 1)
        size = struct.unpack_from("<i", data, type_end + 1)[0]
        header[data[at:end].decode()] = data[type_end + 5 : type_end + 5 + size]
        at = type_end + 5 + size
    if header["compression"] != b"\0":
        raise ReliefError("expected an OpenEXR that is not compressed: `compression` is set by this module")
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels, rest = [], header["channels"]
    while rest[0]:
        name, _, rest = rest.partition(b"\0")
        channels.append((name.decode(), _TYPES[struct.unpack_from("<i", rest)[0]]))
        rest = rest[16:]
    # Each line: its number, its bytes, and the channels in the order of their names.
    line = np.dtype([("y", "<i4"), ("bytes", "<i4"), *((n, t, width) for n, t in channels)])
    lines = np.frombuffer(data, dtype=line, count=height, offset=at + 1 + 8 * height)

    members = {}
    for name, _ in channels:
        layer, _, channel = name.rpartition(".")
        members.setdefault(layer or "beauty", []).append((channel, name))
    layers = {}
    for layer, of_it in members.items():
        order = next((o for o in _ORDERS if {c.upper() for c, _ in of_it} <= set(o)), "")
        planes = [lines[n] for c, n in sorted(of_it, key=lambda pair: (order.find(pair[0].upper()), pair[0]))]
        layers[layer] = np.ascontiguousarray(np.stack(planes, axis=2) if len(planes) > 1 else planes[0])
    return layers
