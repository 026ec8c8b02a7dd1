#!/usr/bin/python3
"""benchmarks/f12/run.py BLENDER RELIEF: its measures by closed form, and one small scene by both engines to the end."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.dont_write_bytecode = True
_RUN = pathlib.Path(__file__).resolve().parents[2] / "benchmarks" / "f12" / "run.py"
sys.path.insert(0, str(_RUN.parent))

import run  # noqa: E402

BLENDER, RELIEF = sys.argv[1:3]


class Measures(unittest.TestCase):
    def noisy(self, seeds, level, deviation):
        return level + deviation * np.random.default_rng(4).standard_normal((seeds, 96, 96, 3))

    def test_relmse_of_known_noise(self):
        expected = 0.02**2 / (0.5**2 + 0.01)
        common = np.full((96, 96, 3), 0.5)
        self.assertAlmostEqual(run.relmse(self.noisy(2, 0.5, 0.02), common) / expected, 1, delta=0.05)

    def test_a_reference_adds_bias_and_leaves_out_its_own_noise(self):
        halves = self.noisy(2, 5.0, 0.02)  # bright, so that its noise is little in what errors are relative to
        reference = halves.mean(axis=0), (halves[0] - halves[1]) ** 2 / 4
        pictures = np.full((1, 96, 96, 3), 5.03)
        expected = 0.03**2 / (5.0**2 + 0.01)
        self.assertAlmostEqual(run.relmse(pictures, None, reference) / expected, 1, delta=0.05)

    def test_time_at_equal_noise(self):
        first = {"processor_seconds": 4.0, "relmse": 0.02}
        row = {"processor_seconds": 6.0, "relmse": 0.01}
        ratios = run.beside(row, self.noisy(2, 1.02, 0.0), first, self.noisy(2, 1.0, 0.0))
        self.assertAlmostEqual(ratios["time"], 1.5)
        self.assertAlmostEqual(ratios["equal_noise"], 0.75)
        self.assertAlmostEqual(ratios["mean"], 1.02)
        self.assertAlmostEqual(ratios["blocks"], 0.02)


class Runs(unittest.TestCase):
    def test_a_page_with_both_pictures_and_references_once(self):
        with tempfile.TemporaryDirectory() as folder:
            command = [str(_RUN), "neon", "--at", "1,.5", "--max-samples", "2", "--reference", "2", "--resolution", "32x18"]
            command += ["--blender", BLENDER, "--relief", RELIEF, "--cache", folder + "/cache", "--output", folder + "/out"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            references = {path: path.stat().st_mtime_ns for path in pathlib.Path(folder).rglob("references/*.exr")}
            self.assertEqual(len(references), 4)
            with open(folder + "/out/results.json", encoding="utf-8") as file:
                (scene,) = json.load(file)["scenes"]
            found = [(row["setting"], row["label"]) for row in scene["rows"]]
            expected = [("1 spp", "Cycles"), ("1 spp", "relief"), ("0.5", "Cycles"), ("0.5", "relief")]
            self.assertEqual(found, expected)
            page = pathlib.Path(folder, "out", "index.html").read_text(encoding="utf-8")
            for row in scene["rows"]:
                self.assertGreater(row["processor_seconds"], 0)
                for name in row["files"]:
                    self.assertTrue(os.path.getsize(f"{folder}/out/{name}.png"))
                self.assertIn(f"{row['files'][0]}.png", page)
            subprocess.run([*command, "--rounds", "1"], check=True, stdout=subprocess.DEVNULL)
            again = {path: path.stat().st_mtime_ns for path in pathlib.Path(folder).rglob("references/*.exr")}
            self.assertEqual(again, references)

    def test_every_scene_of_this_blender_can_be_made(self):
        groups = run.scene_functions()[1]
        version = subprocess.run([BLENDER, "--version"], capture_output=True, text=True, check=True).stdout
        is_new = int(version.split()[1].split(".")[0]) >= 5
        names = {name for word, group in groups.items() if is_new or word != "new" for name in group}
        with tempfile.TemporaryDirectory() as folder:
            command = [BLENDER, "-b", "--factory-startup", "--addons", "relief", "--python-exit-code", "9"]
            subprocess.run([*command, "--python", str(_RUN.parent / "scenes.py"), "--", folder], check=True, stdout=subprocess.DEVNULL)
            self.assertEqual({path.stem for path in pathlib.Path(folder).glob("*.blend")}, names)

    def test_what_is_no_scene_is_said(self):
        done = subprocess.run([str(_RUN), "nothing"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("nothing: neither a file nor one of the scenes", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
