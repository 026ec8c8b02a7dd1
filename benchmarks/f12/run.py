#!/usr/bin/python3
"""F12 from Blender, in Cycles and in relief: processor seconds, noise, time at equal noise, and both pictures.

Each render is a Blender of its own that opens the file and renders; what counts is from there to the finished picture, of
Blender and of the program that it starts. Engines take turns, and each renders every setting with several seeds. Noise is
relMSE = mean over pixels and channels of (x − r)² / (r² + 0.01). With --reference N, r is the same engine's picture of N
samples, and its own variance is taken off; it is kept in --cache until the scene, the settings, Blender or relief change.
Without one r is the mean of all pictures, and (x − r)² half the squared difference of two seeds: noise alone, no bias. Time
at equal noise is processor seconds × relMSE, over those of Cycles. Needs Blender 3.4 or later and numpy.
"""

import argparse
import ast
import dataclasses
import hashlib
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile

import numpy as np

sys.dont_write_bytecode = True
_FOLDER = os.path.dirname(os.path.abspath(__file__))
_ROOT = os.path.dirname(os.path.dirname(_FOLDER))
sys.path[:0] = [_FOLDER, os.path.join(_ROOT, "benchmarks", "cycles")]

from exr import read_rgb  # noqa: E402
from page import page, table  # noqa: E402
from render_cycles import blender_version  # noqa: E402

_RELMSE_FLOOR = 0.01  # as in exporters/image_metrics.h
_REFERENCE_SEEDS = (1001, 1002)
_BLOCK = 16  # pixels a side of the blocks whose means are compared
_MOST_SAMPLES = 4096  # Blender's default, where a threshold ends the render
_MODULES = {"usual": ("scenes.py", "more_scenes.py"), "inside": ("inside_scenes.py",), "new": ("new_scenes.py",)}  # of scenes, by the words for all of them


@dataclasses.dataclass(frozen=True)
class Contender:
    """An engine as installed in a folder of Blender's user scripts."""

    label: str
    engine: str  # as bpy calls it
    binary: str  # of relief; "" for Cycles
    scripts: str  # folder with addons/relief
    forced: tuple  # pairs of scene.relief's properties and values
    identity: str  # hash of all that its pictures depend on


@dataclasses.dataclass(frozen=True)
class Setting:
    """What a picture is rendered until."""

    samples: int
    threshold: float = 0.0

    def __str__(self):
        return f"{self.threshold:g}" if self.threshold else f"{self.samples} spp"


def scene_functions():
    """(source text by name of a scene, of all else by ""; names by word of _MODULES), both in the order of the modules."""
    functions, groups, others = {}, {}, ""
    files = [(word, name) for word, names in _MODULES.items() for name in names]
    for word, name in (*files, ("", "stage.py"), ("", os.path.join("..", "cycles", "node_tree.py"))):
        with open(os.path.join(_FOLDER, name), encoding="utf-8") as file:
            source = file.read()
        for node in ast.parse(source).body:
            if word and isinstance(node, ast.FunctionDef) and not node.args.args and not node.name.startswith("_"):
                functions[node.name] = ast.get_source_segment(source, node)
                groups.setdefault(word, []).append(node.name)
            else:
                others += ast.get_source_segment(source, node)
    return {**functions, "": others}, groups


def _hash(*parts):
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def _hash_files(*roots):
    digest = hashlib.sha256()
    for root in roots:
        found = [root] if os.path.isfile(root) else [os.path.join(f, n) for f, _, names in os.walk(root) for n in names]
        for path in sorted(path for path in found if not path.endswith(".pyc")):
            with open(path, "rb") as file:
                digest.update(path[len(root) :].encode() + file.read())
    return digest.hexdigest()[:16]


class Bench:
    """All renders of one call.

    @param  options  of the command line
    @param  scratch  a folder that is removed at the end
    """

    def __init__(self, options, scratch):
        self.options = options
        self.version = ".".join(map(str, blender_version(options.blender)))
        addon = os.path.join(_ROOT, "blender_addon", "relief")
        cycles = Contender("Cycles", "CYCLES", "", self._scripts(scratch, "cycles", addon), (), _hash(self.version))
        self.contenders = [] if options.no_cycles else [cycles]
        self._builder = cycles
        for i, word in enumerate(options.relief):
            label, _, binary = word.rpartition("=")
            binary = os.path.abspath(binary)
            if not os.path.isfile(binary):
                sys.exit(f"f12: --relief {word}: {binary} is not a file")
            # A binary in a tree's build folder comes with that tree's add-on.
            own = os.path.join(binary, "..", "..", "..", "..", "blender_addon", "relief")
            folder = os.path.normpath(own) if os.path.isdir(os.path.normpath(own)) else addon
            scripts = self._scripts(scratch, f"relief{i}", folder)
            label = label or ("relief" if len(options.relief) == 1 else f"relief {i + 1}")
            for caustics in options.caustics:
                forced = (("caustics", caustics),) if caustics else ()
                identity = _hash(self.version, _hash_files(binary), _hash_files(folder), forced)
                named = f"{label}, caustics {caustics}" if caustics else label
                self.contenders.append(Contender(named, "RELIEF", binary, scripts, forced, identity))
        self._scratch = scratch

    @staticmethod
    def _scripts(scratch, name, addon):
        folder = os.path.join(scratch, name, "addons")
        os.makedirs(folder)
        os.symlink(addon, os.path.join(folder, "relief"))
        return os.path.dirname(folder)

    def _blender(self, contender, script, *words):
        command = [self.options.blender, "-b", "--factory-startup", "--addons", "relief", "--python-exit-code", "9"]
        command += ["--python", os.path.join(_FOLDER, script), "--", *words]
        environment = {**os.environ, "BLENDER_USER_SCRIPTS": contender.scripts, "PYTHONDONTWRITEBYTECODE": "1"}
        # Debian's Blender borrows modules from the first python3 on PATH: let that be Debian's, which has numpy.
        environment["PATH"] = os.pathsep.join(["/usr/bin", "/bin", os.environ.get("PATH", "")])
        if contender.binary:
            environment["RELIEF_BINARY"] = contender.binary
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, check=False)
        if done.returncode != 0:
            last = "\n".join(done.stdout.splitlines()[-25:])
            raise RuntimeError(f"Blender ended with {done.returncode}, rendering by {contender.label}:\n{last}")

    def blend(self, name, functions):
        """Path of a scene's .blend, made if it is not in the cache; of a file that was named as such, itself."""
        if name not in functions:
            return os.path.abspath(name)
        folder = os.path.join(self.options.cache, "scenes", _hash(functions[name], functions[""], self.version))
        path = os.path.join(folder, f"{name}.blend")
        if not os.path.exists(path):
            os.makedirs(folder, exist_ok=True)
            self._blender(self._builder, "scenes.py", folder, name)
        return path

    def press(self, contender, blend, setting, seed, output):
        """One F12; {"processor_seconds", "wall_seconds", "peak_memory_bytes"}, and output.exr and output.png."""
        options = self.options
        job = {"blend": blend, "engine": contender.engine, "seed": seed, "resolution": options.resolution, "output": output}
        job |= {"threads": options.threads, "relief": dict(contender.forced), **dataclasses.asdict(setting)}
        path = os.path.join(self._scratch, "job.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(job, file)
        self._blender(contender, "press.py", path)
        with open(output + ".json", encoding="utf-8") as file:
            return json.load(file)

    def reference(self, contender, blend):
        """(picture, variance of each of its values) of many samples; rendered unless the cache has it."""
        half = Setting(self.options.reference // 2)
        key = _hash(_hash_files(blend), contender.identity, self.options.resolution, half)
        folder = os.path.join(self.options.cache, "references")
        os.makedirs(folder, exist_ok=True)
        pictures = []
        for seed in _REFERENCE_SEEDS:
            path = os.path.join(folder, f"{key}_{seed}.exr")
            if not os.path.exists(path):
                output = os.path.join(self._scratch, "reference")
                self.press(contender, blend, half, seed, output)
                shutil.move(output + ".exr", path)
            pictures.append(read_rgb(path))
        return np.mean(pictures, axis=0), (pictures[0] - pictures[1]) ** 2 / 4

    def measure(self, name, blend):
        """Every contender on one scene; {"name", "rows": [{"setting", "label", …}]}, Cycles' first of each setting."""
        options = self.options
        stem = os.path.splitext(os.path.basename(blend))[0]
        costs, files = {}, {}
        for seed in range(1, options.rounds + 1):
            for setting in options.at:
                # In turns, the first one too: whatever else the machine does hits all alike.
                for contender in self.contenders if seed % 2 else self.contenders[::-1]:
                    key = (setting, contender)
                    part = f"{stem}_{setting}_{contender.label}_{seed}".replace(", ", "_").replace(" ", "_")
                    output = os.path.join(options.output, part)
                    costs.setdefault(key, []).append(self.press(contender, blend, setting, seed, output))
                    files.setdefault(key, []).append(part)
        pictures = {
            key: np.stack([read_rgb(os.path.join(options.output, part + ".exr")) for part in parts])
            for key, parts in files.items()
        }
        references = {c: self.reference(c, blend) for c in self.contenders} if options.reference else {}
        rows = []
        for setting in options.at:
            common = np.mean([pictures[setting, c].mean(axis=0) for c in self.contenders], axis=0)
            first = None
            for contender in self.contenders:
                key = (setting, contender)
                error = relmse(pictures[key], common, references.get(contender))
                row = {"setting": str(setting), "label": contender.label, "relmse": error, "files": files[key]}
                row |= {k: float(np.mean([cost[k] for cost in costs[key]])) for k in costs[key][0]}
                if first is None:
                    first = (row, pictures[key])
                row |= beside(row, pictures[key], *first)
                rows.append(row)
        return {"name": stem, "rows": rows}


def relmse(pictures, common, reference=None):
    """Mean relMSE of pictures.

    @param  pictures   (seeds, height, width, 3)
    @param  common     what the noise is relative to where there is no reference
    @param  reference  (picture, its variance) or None
    @return            NaN of one picture without a reference
    """
    if reference is not None:
        truth, variance = reference
        squares = (pictures - truth) ** 2 - variance
        return float((squares / (truth**2 + _RELMSE_FLOOR)).mean())
    pairs = [(a - b) ** 2 / 2 for a, b in itertools.combinations(pictures, 2)]
    return float((np.mean(pairs, axis=0) / (common**2 + _RELMSE_FLOOR)).mean()) if pairs else math.nan


def _block_means(picture):
    height, width = (side // _BLOCK * _BLOCK for side in picture.shape[-3:-1])
    shape = (*picture.shape[:-3], height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, 3)
    return picture[..., :height, :width, :].reshape(shape).mean(axis=(-4, -2))


def beside(row, pictures, first_row, first_pictures):
    """A row's ratios to the first one: of time, of time at equal noise, of means, and the difference of block means.

    @return  "blocks" is the root of the mean square difference of block means over the mean, "blocks_noise" what of it
             is expected from the seeds' spread
    """
    own, other = _block_means(pictures), _block_means(first_pictures)
    level = max(float(other.mean()), 1e-9)
    spread = sum(float(b.var(axis=0, ddof=1).mean()) / len(b) for b in (own, other)) if len(own) > 1 else math.nan
    time = row["processor_seconds"] / first_row["processor_seconds"]
    noise = row["relmse"] / first_row["relmse"] if first_row["relmse"] > 0 else math.nan
    return {
        "time": time,
        "equal_noise": time * noise,
        "mean": float(pictures.mean()) / max(float(first_pictures.mean()), 1e-9),
        "blocks": math.sqrt(float(((own.mean(axis=0) - other.mean(axis=0)) ** 2).mean())) / level,
        "blocks_noise": math.sqrt(spread) / level,
    }


def _parse(arguments, groups):
    def setting(word):
        value = float(word)
        return Setting(int(value)) if value >= 1 else Setting(_MOST_SAMPLES, value)

    def size(word):
        return [int(side) for side in word.split("x")]

    cache = os.path.join(os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache")), "relief_f12")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [name for group in groups.values() for name in group]
    known = "; ".join(f"{word}, which are {', '.join(group)}" for word, group in groups.items())
    parser.add_argument("scenes", nargs="*", metavar="SCENE", default=["usual"], help=f"a .blend, or of {known} (default: usual)")
    parser.add_argument("--at", type=lambda text: [setting(w) for w in text.split(",")], default="64,.05,.01", metavar="LIST",
                        help="samples (1 and more) and noise thresholds (below 1) (default: 64,.05,.01)")
    parser.add_argument("--max-samples", type=int, metavar="N", help=f"where there is a threshold (default: {_MOST_SAMPLES})")
    parser.add_argument("--rounds", type=int, default=2, help="seeds of each (default: 2)")
    parser.add_argument("--resolution", type=size, default="320x180", metavar="WxH", help="default: 320x180")
    parser.add_argument("--reference", type=int, default=1024, metavar="N",
                        help="samples of an engine's own reference; 0: none, noise by the seeds' spread (default: 1024)")
    parser.add_argument("--relief", action="append", metavar="[LABEL=]BINARY",
                        help="one or more to compare, each with the add-on of its tree (default: this tree's build/release)")
    parser.add_argument("--caustics", type=lambda text: text.split(","), default=[None], metavar="LIST",
                        help="relief's setting in all scenes, of auto, on and off; several: relief with each")
    parser.add_argument("--no-cycles", action="store_true", help="the first relief is what the others are set beside")
    parser.add_argument("--threads", type=int, default=os.cpu_count(), help="default: all")
    parser.add_argument("--blender", default="blender")
    parser.add_argument("--cache", default=cache, metavar="FOLDER", help=f"scenes and references (default: {cache})")
    parser.add_argument("--output", default="f12", metavar="FOLDER", help="page, pictures and results.json (default: f12)")
    options = parser.parse_args(arguments)
    options.scenes = [name for word in options.scenes for name in groups.get(word, [word])]
    for name in options.scenes:
        if name not in names and not os.path.isfile(name):
            parser.error(f"{name}: neither a file nor one of the scenes {', '.join(names)}")
    if options.max_samples:
        options.at = [Setting(options.max_samples, s.threshold) if s.threshold else s for s in options.at]
    if options.rounds < 2 and not options.reference:
        parser.error("--rounds must be at least 2 where there is no reference: noise is their spread")
    options.relief = options.relief or [os.path.join(_ROOT, "build", "release", "cli", "relief")]
    options.cache, options.output = os.path.abspath(options.cache), os.path.abspath(options.output)
    return options


def main(arguments):
    functions, groups = scene_functions()
    options = _parse(arguments, groups)
    os.makedirs(options.output, exist_ok=True)
    results, failed = [], []
    with tempfile.TemporaryDirectory() as scratch:
        bench = Bench(options, scratch)
        for name in options.scenes:
            try:
                results.append(bench.measure(name, bench.blend(name, functions)))
            except RuntimeError as error:
                failed.append(name)
                print(f"f12: {name}: {error}", file=sys.stderr)
                continue
            print(table(results[-1:], is_last=False), file=sys.stderr, flush=True)
            with open(os.path.join(options.output, "results.json"), "w", encoding="utf-8") as file:
                json.dump({"blender": bench.version, "options": arguments, "scenes": results}, file, indent=1)
            with open(os.path.join(options.output, "index.html"), "w", encoding="utf-8") as file:
                file.write(page(results, bench.version))
    print(table(results))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main(sys.argv[1:])
