#!/usr/bin/env python3
"""Runs the program with random options and names of files, and asserts that it destroys nothing.

    tests/cli/fuzz_files.py RELIEF [--runs N] [--seed S] [--first I] [--jobs J]

Every run has a new folder of small inputs, of older outputs, and of links, hard links and folders among which the names of its
outputs are drawn. Afterwards no input may have changed (bytes, permissions, times), no link may have become a file, the
exit code is a documented one, and nothing is left behind. Run I depends on seed and I alone: `--first I --runs 1` repeats
it. Prints a summary; exits with 1 after the first failure, which names the folder that it keeps.
"""

import argparse
import base64
import collections
import concurrent.futures
import json
import os
import pathlib
import random
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import zlib

EXIT_CODES = {0, 1, 2, 3, 130}
TIMEOUT_SECONDS = 120
UMASK = 0o022
TINY = ["--resolution", "4x4", "--spp", "1", "--threads", "1", "--progress", "none"]


class Failure(Exception):
    pass


def png(values):
    """A grey PNG of one row."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", len(values), 1, 8, 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" + bytes(values))) +
            chunk(b"IEND", b""))


def square(buffer_uri, length):
    """A glTF scene of one displaced square."""
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["RELIEF_environment", "RELIEF_displacement"],
        "extensions": {"RELIEF_environment": {"color": [0.5, 0.5, 0.5]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0.5, 0.5, 3]}],
        "cameras": [{"type": "perspective", "name": "front", "perspective": {"yfov": 0.6, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "material": 0}]}],
        "materials": [{"doubleSided": True}],
        "accessors": [{"bufferView": i, "componentType": 5126, "count": 6, "type": kind}
                      for i, kind in enumerate(["VEC3", "VEC3", "VEC2"])],
        "bufferViews": [{"buffer": 0, "byteOffset": offset, "byteLength": size}
                        for offset, size in [(0, 72), (72, 72), (144, 48)]],
        "buffers": [{"byteLength": length, "uri": buffer_uri}],
    }


def scene_files(map_suffix, exr):
    """A scene of many files, by name, the scene itself first. Maps are called like frames of a sequence."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    values = [c for x, y in corners for c in (x, y, 0)] + [0, 0, 1] * 6 + [c for x, y in corners for c in (x, y)]
    data = struct.pack("<48f", *values)
    part = square("data:application/octet-stream;base64," + base64.b64encode(data).decode(), len(data))
    scene = square("data.bin", len(data))
    scene["extensionsUsed"].append("RELIEF_reference")
    scene["nodes"].append({"translation": [0, 0, -1], "extensions": {"RELIEF_reference": {"uri": "part.gltf"}}})
    scene["scenes"][0]["nodes"].append(2)
    height, colour, sky = "h.0002" + map_suffix, "c.0001.png", "sky" + map_suffix
    scene["images"] = [{"uri": colour}, {"uri": height}]
    scene["textures"] = [{"source": 0}, {"source": 1}]
    scene["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": {"index": 0}}
    scene["materials"][0]["extensions"] = {"RELIEF_displacement": {"heightTexture": {"index": 1}, "scale": 0.05}}
    scene["extensions"]["RELIEF_environment"] = {"uri": sky}
    grey = png([0, 128, 255]) if map_suffix == ".png" else exr
    return {"scene.gltf": json.dumps(scene).encode(), "part.gltf": json.dumps(part).encode(), "data.bin": data,
            colour: png([200, 100]), height: grey, sky: grey}


def lock_name(name):
    """What the lock of an output is called: exporters/side_file.h."""
    value = 0xCBF29CE484222325
    for byte in name.encode():
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return f".relief-{value:016x}.lock"


class Run:
    """One run of the program in a folder of its own."""

    def __init__(self, program, seed, index, pictures, folder):
        self.program, self.pictures, self.folder = program, pictures, folder
        self.random = random.Random(f"{seed}/{index}")
        self.inputs = {}
        self.outputs = []

    def pick(self, *choices):
        return self.random.choice(choices)

    def chance(self, probability):
        return self.random.random() < probability

    def write(self, name, data, mode=0o644):
        path = self.folder / name
        path.write_bytes(data)
        path.chmod(mode)

    def make_inputs(self, files):
        for name, data in files.items():
            self.write(name, data, self.pick(0o644, 0o644, 0o600, 0o664))
        self.inputs.update(files)

    def make_clutter(self):
        """Older outputs and all that an output should not be mistaken for."""
        self.victims = self.random.sample(list(self.inputs), min(2, len(self.inputs)))
        (self.folder / "sub").mkdir()
        (self.folder / "dir.exr").mkdir()
        (self.folder / "dir.0001.png").mkdir()
        os.symlink(".", self.folder / "alias")
        for i, name in enumerate(self.victims):
            for suffix in (".exr", ".png", ".json"):
                os.symlink(name, self.folder / f"link{i}{suffix}")
                os.link(self.folder / name, self.folder / f"twin{i}{suffix}")
                os.symlink(f"link{i}{suffix}", self.folder / f"chain{i}{suffix}")
            # What numbering makes of "seq.exr" and "seq.#.exr".
            os.symlink(name, self.folder / f"seq.{i:04}.exr")
            os.link(self.folder / name, self.folder / f"seq.{i}.exr")
        os.symlink("missing.exr", self.folder / "dangling.exr")
        os.symlink("nowhere/missing.png", self.folder / "lost.png")
        os.symlink("loop.exr", self.folder / "loop.exr")
        os.symlink("old.exr", self.folder / "again.exr")
        # Devices of our own, and the way to standard output: whatever goes wrong, the machine's stay as they are.
        # Other names of inputs where the program's own locks would be.
        self.planted = set()
        for name in self.random.sample(["out.exr", "out.png", "out.json", "old.exr", "sub/out.exr", "out.0001.exr"], 2):
            planted = self.folder / pathlib.PurePath(name).parent / lock_name(pathlib.PurePath(name).name)
            self.pick(os.link, os.symlink)(self.folder / self.pick(*self.victims), planted)
            self.planted.add(str(planted.relative_to(self.folder)))
        for name, minor in (("null", 3), ("full", 7)):
            try:
                os.mknod(self.folder / name, stat.S_IFCHR | 0o666, os.makedev(1, minor))
            except PermissionError:
                self.write(name, b"no device")
        for suffix in (".exr", ".png", ".json"):
            os.symlink("/proc/self/fd/1", self.folder / f"standard{suffix}")
        self.write("old.exr", b"an older picture", 0o600)
        self.write("old.png", b"an older picture", 0o640)
        self.write("old.json", b"{}", 0o666)

    def output_name(self, suffix):
        """A name for an output, most likely one that must be refused."""
        i = self.random.randrange(len(self.victims))
        name = self.pick(
            self.victims[i], self.pick(*self.inputs), f"link{i}{suffix}", f"twin{i}{suffix}", f"chain{i}{suffix}", f"seq{suffix}",
            f"seq.#{suffix}", f"c{suffix}", f"h.####{suffix}", f"h{suffix}", f"ref{suffix}", f"out{suffix}",
            f"out{suffix}", f"out{suffix}", f"OUT{suffix}", f"out.##{suffix}", f"o#t{suffix}", f"old{suffix}", f"old{suffix}",
            f"again{suffix}", f"env{suffix}", f"dangling{suffix}", f"lost{suffix}", f"loop{suffix}", f"dir{suffix}",
            f"nowhere/out{suffix}", f"sub/out{suffix}", "null", "full", f"standard{suffix}", "",
            "n" * (255 - len(suffix)) + suffix, "n" * (256 - len(suffix)) + suffix, f"a b\n\x1b[1m{suffix}", f"ä{suffix}",
            f"--{suffix}", "-")
        prefix = self.pick("", "", "", "./", "sub/../", "alias/", "alias/alias/", str(self.folder) + "/")
        name = name if name in ("", "-") else prefix + name
        self.outputs.append(name)
        return name

    def numbers(self):
        return self.pick("1", "2", "0-3", "1,2", "1-12x11", "0")

    def render_arguments(self):
        arguments = ["render", "scene.gltf", "-o", self.output_name(".exr")]
        if self.chance(0.5):
            arguments += ["--png=" + self.output_name(".png")]
        if self.chance(0.5):
            arguments += ["--stats=" + self.output_name(".json")]
        if self.chance(0.3):
            arguments += ["--report=" + self.output_name(".html")]
        if self.chance(0.2):
            arguments += ["--log=" + self.output_name(".log")]
        if self.chance(0.4):
            arguments += ["--frames", self.numbers()]
        if self.chance(0.3):
            arguments += ["--reference", self.pick("ref.exr", "ref.####.exr", "ref.000#.exr", "missing.exr", "old.exr")]
        options = [
            ["--resume"], ["--checkpoint", self.pick("0", "0.001")], ["--keep-going"], ["--grace", "60"], ["--strict"],
            ["--continue-without-textures"], ["--float"], ["--seed", "7"], ["--crop", "1,1,3,3"], ["--crop", "0,0,9,9"],
            ["--aov", self.pick("all", "depth", "nothing")], ["--max-bounces", "0"], ["--filter", "box"],
            ["--compression", self.pick("none", "zips", "piz", "dwaa")], ["--camera", self.pick("front", "nobody")],
            ["--displacement", self.pick("rmip", "tfdm", "chord", "tessellate")], ["--lod", self.pick("0", "auto", "-1")],
            ["--caustics", self.pick("on", "off")], ["--exposure", "1"], ["--color-space", "acescg"],
            ["--display", "Nothing"], ["--view", self.pick("Standard", "Nothing")],
            ["--noise-threshold", "0.1"], ["--filter-glossy", "1"], ["--time-limit", "0.001"], ["--bogus"],
            ["--environment", self.pick("studio", "env.png", "env.png,2", "missing.png")], ["--background", "world"],
            ["--look-from", "3,2,1"], ["--denoise", self.pick("none", "builtin", "oidn", "all")]
        ]
        for option in self.random.sample(options, self.pick(0, 0, 1, 1, 2, 3)):
            arguments += option
        # Through the tile cache, which reads while rendering and takes a library that loads slowly.
        if self.chance(0.02):
            arguments += ["--texture-memory", "0"]
        tiny = list(TINY)
        tiny[7] = self.pick("none", "json", "bar")
        if self.chance(0.2):
            tiny[1] = self.pick("1x1", "7x3", "16x16")
        return arguments + tiny

    def farm_arguments(self):
        arguments = ["farm", "slurm", "scene.gltf", "-o", self.pick("out.exr", "sub/out.##.exr", self.output_name(".exr"))]
        arguments.append("--script=" + self.output_name(self.pick(".sh", ".exr", ".png", ".json")))
        if self.chance(0.4):
            arguments += ["--frames", self.numbers()]
        if self.chance(0.3):
            arguments += ["--split", "2"]
        arguments.append("--")
        if self.chance(0.3):
            self.write("env.png", png([9, 99]))
            self.inputs["env.png"] = png([9, 99])
            arguments += ["--environment", "env.png"]
        if self.chance(0.3):
            arguments += ["--stats", self.output_name(".json")]
        return arguments

    def arguments(self):
        command = self.pick(*["render"] * 12, *["trace"] * 4, *["compare", "merge", "info"] * 4, *["farm", "report", "denoise"] * 3,
                            "bench", "help")
        if command in ("render", "trace", "info", "farm", "bench"):
            self.make_inputs(scene_files(".exr" if self.chance(0.03) else ".png", self.pictures[0]))
        if command == "render":
            # Not inputs of every run; but a reference that is not asked for is an older output like any other.
            self.pending = {"ref.exr": self.pictures[0], "ref.0001.exr": self.pictures[1], "ref.0002.exr": self.pictures[0]}
            arguments = None
        elif command == "trace":
            self.make_inputs({"rays.txt": b"0.5 0.5 3 0 0 -1\n0 0 3 0 0 1\n"})
        elif command in ("compare", "merge"):
            self.make_inputs({"A.exr": self.pictures[0], "B.exr": self.pictures[1]})
        elif command == "report":
            self.make_inputs({"A.exr": self.pictures[0], "B.exr": self.pictures[1], "stats.json": b"{}"})
        elif command == "denoise":
            self.make_inputs({"A.exr": self.pictures[2]})
        elif command == "help":
            self.make_inputs({"scene.gltf": b"{}"})
        if command == "render":
            self.make_clutter()
            arguments = self.render_arguments()
            asked = "--reference" in arguments
            if {"env.png", "env.png,2"} & set(arguments):
                self.write("env.png", png([9, 99]))
                self.inputs["env.png"] = png([9, 99])
            for name, data in self.pending.items():
                self.write(name, data)
            if asked:
                # Only those that this run may read; all of a pattern's frames count.
                value = arguments[arguments.index("--reference") + 1]
                if value == "ref.exr":
                    self.inputs["ref.exr"] = self.pending["ref.exr"]
                elif "#" in value and "--frames" in arguments:
                    for frame in (1, 2):
                        if frame in self.frames(arguments):
                            self.inputs[f"ref.{frame:04}.exr"] = self.pending[f"ref.{frame:04}.exr"]
                elif value == "old.exr":
                    self.inputs["old.exr"] = b"an older picture"
            return arguments
        self.make_clutter()
        if command == "trace":
            way = self.pick(["--rays", "rays.txt"], ["--rays", "rays.txt", "--explain", "0"], ["--pixel", "1,1"])
            if way[0] == "--pixel":
                del self.inputs["rays.txt"]
            return ["trace", "scene.gltf", *way, "--output=" + self.output_name(self.pick(".exr", ".json"))]
        if command == "compare":
            arguments = ["compare", "A.exr", "B.exr"]
            if self.chance(0.7):
                arguments.append("--json=" + self.output_name(".json"))
            if self.chance(0.5):
                arguments.append("--diff=" + self.output_name(".png"))
            if self.chance(0.3):
                arguments += ["--max-rmse", self.pick("0", "1")]
            return arguments
        if command == "merge":
            return ["merge", "A.exr", "B.exr", "--output=" + self.output_name(".exr")]
        if command == "farm":
            return self.farm_arguments()
        if command == "bench":
            return ["bench", "error", "scene.gltf", "--quick", "--resolution", "4x4", "--caustics", "off", "--levels", "0",
                    "--json=" + self.output_name(".json"), "--html=" + self.output_name(".html")]
        if command == "report":
            return ["report", "A.exr", "--stats", "stats.json", "--reference", "B.exr", "--output=" + self.output_name(".html")]
        if command == "denoise":
            picture = ["--png=" + self.output_name(".png")] if self.chance(0.6) else []
            return ["denoise", "A.exr", "--output=" + self.output_name(".exr"), *picture, "--threads", "1"]
        if command == "info":
            return ["info", "scene.gltf"]
        return self.pick(["--help"], ["--version"], ["render", "--help"], [], ["merge"])

    @staticmethod
    def frames(arguments):
        text = arguments[arguments.index("--frames") + 1]
        return {"1": [1], "2": [2], "0-3": [0, 1, 2, 3], "1,2": [1, 2], "1-12x11": [1, 12], "0": [0]}[text]

    def state(self):
        """What must not change: inputs in everything, links and folders in what they are, files in their permissions."""
        found = {}
        for path in self.folder.rglob("*"):
            name = str(path.relative_to(self.folder))
            if name in self.planted:
                continue
            status = path.lstat()
            if name in self.inputs:
                found[name] = (path.read_bytes(), status.st_mode, status.st_ino, status.st_mtime_ns, status.st_uid)
            elif stat.S_ISLNK(status.st_mode):
                found[name] = os.readlink(path)
            elif stat.S_ISDIR(status.st_mode):
                found[name] = "folder"
            else:
                found[name] = status.st_mode
        return found

    def open_output(self):
        """Where standard output goes: mostly somewhere, sometimes nowhere."""
        kind = self.pick("pipe", "pipe", "null", "full", "closed", "file")
        if kind == "pipe":
            return kind, subprocess.PIPE
        if kind == "file":
            return kind, os.open(self.folder / "stdout.txt", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        return kind, os.open("/dev/full" if kind == "full" else "/dev/null", os.O_WRONLY)

    def start(self, arguments, kind, output):
        prepare = (lambda: os.close(1)) if kind == "closed" else None
        return subprocess.Popen([self.program, *arguments], cwd=self.folder, stdin=subprocess.DEVNULL, stdout=output,
                                stderr=subprocess.PIPE, preexec_fn=prepare)

    def perform(self):
        """Returns the exit code; below 0: killed by us."""
        arguments = self.arguments()
        self.command = [self.program, *arguments]
        before = self.state()
        kind, output = self.open_output()
        process = self.start(arguments, kind, output)
        if output != subprocess.PIPE:
            os.close(output)
        sent = None
        if self.chance(0.1):
            sent = self.pick(signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
            try:
                process.wait(self.random.uniform(0.005, 0.08))
            except subprocess.TimeoutExpired:
                process.send_signal(sent)
        try:
            _, errors = process.communicate(timeout=TIMEOUT_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            raise Failure("does not end") from None
        code = process.returncode
        # Before it listens for them, a signal ends the program as it ends any other.
        if code not in EXIT_CODES and not (sent is not None and code == -sent):
            raise Failure(f"exit code {code}\n{errors.decode(errors='replace')}")
        if code in (2, 3) and not errors.startswith(b"relief: ") and b"\nrelief: " not in errors:
            raise Failure(f"exit code {code} without a word\n{errors.decode(errors='replace')}")
        if code < 0:
            # The next run in the folder clears away what a killed one leaves.
            for folder in (".", "sub"):
                subprocess.run([self.program, "trace", *self.clean_scene(), "-o", folder + "/cleared.csv"], cwd=self.folder,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=TIMEOUT_SECONDS, check=True)
        self.check(before, code, arguments)
        return code

    def clean_scene(self):
        for name, data in scene_files(".png", b"").items():
            (self.folder / "clean").mkdir(exist_ok=True)
            self.write("clean/" + name, data)
        return ["clean/scene.gltf", "--pixel", "1,1"]

    def check(self, before, code, arguments):
        after = self.state()
        to_run = stat.S_IXUSR if arguments[:1] == ["farm"] else 0  # a script is its owner's
        for name, was in before.items():
            if after.get(name) == was or isinstance(was, int) and after.get(name) == was | to_run:
                continue
            if name in self.inputs:
                raise Failure(f"input {name!r} has changed")
            raise Failure(f"{name!r} was {was!r} and is {after.get(name)!r}")
        for name, now in after.items():
            if os.path.basename(name).startswith(".relief-"):
                raise Failure(f"{name!r} is left behind")
            modes = {0o666 & ~UMASK, 0o666 & ~UMASK | to_run}
            is_new = name not in before and not name.startswith("clean") and name != "stdout.txt"
            if is_new and isinstance(now, int) and stat.S_IMODE(now) not in modes:
                raise Failure(f"{name!r} has the permissions {stat.S_IMODE(now):o}")
        if code == 0 and arguments[:2] == ["render", "scene.gltf"] and "--frames" not in arguments:
            path = self.folder / self.outputs[0]
            if "standard" not in self.outputs[0] and path.is_file() and path.read_bytes()[:4] != b"\x76\x2f\x31\x01":
                raise Failure(f"{path} is not a picture")


def pictures_make(program):
    """Two small pictures of the same scene with different seeds, and one with the layers that a denoiser needs."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for file_name, data in scene_files(".png", b"").items():
            (folder / file_name).write_bytes(data)
        pictures = []
        layers = "beauty,samples,variance,half,denoising_albedo,denoising_normal,denoising_depth,denoising_half"
        for more in (["--seed", "1"], ["--seed", "2"], ["--aov", layers]):
            subprocess.run([program, "render", "scene.gltf", "-o", "a.exr", *more, *TINY], cwd=folder,
                           stderr=subprocess.DEVNULL, check=True)
            pictures.append((folder / "a.exr").read_bytes())
        return pictures


def perform_run(program, seed, index, pictures):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="relief_fuzz_"))
    run = Run(program, seed, index, pictures, folder)
    try:
        code = run.perform()
    except Failure as failure:
        return index, None, f"run {index} of seed {seed} in {folder}\n{run.command}\n{failure}"
    shutil.rmtree(folder)
    return index, code, ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("relief", type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    os.umask(UMASK)
    pictures = pictures_make(options.relief)
    codes = collections.Counter()
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        indices = range(options.first, options.first + options.runs)
        runs = pool.map(lambda i: perform_run(options.relief, options.seed, i, pictures), indices)
        for index, code, failure in runs:
            if failure:
                print(failure)
                pool.shutdown(cancel_futures=True)
                return 1
            codes[code] += 1
            if (index + 1) % 1000 == 0:
                print(f"{index + 1} runs", flush=True)
    print(f"{options.runs} runs, no input changed; exit codes:",
          ", ".join(f"{code} {count}" for code, count in sorted(codes.items())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
