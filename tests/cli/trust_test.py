"""What scenes of strangers may read, what a picture says of itself, and what a program says of itself."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["RELIEF_BINARY"]
EXAMPLE = ROOT / "examples" / "displaced"


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)


class Reading(unittest.TestCase):
    """--root: a scene in scenes/, whose map is beside that folder, or reached by a link."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.scenes = self.folder / "scenes"
        self.scenes.mkdir()
        for name in ("displaced.bin", "weave.png", "sky.hdr"):
            shutil.copy(EXAMPLE / name, self.scenes)
        shutil.copy(EXAMPLE / "cobbles.png", self.folder)
        self.text = (EXAMPLE / "displaced.gltf").read_text(encoding="utf-8")

    def info(self, uri, *before):
        scene = self.scenes / "scene.gltf"
        scene.write_text(self.text.replace('"cobbles.png"', json.dumps(uri)), encoding="utf-8")
        return run(*before, "info", scene)

    def test_files_outside_are_refused(self):
        (self.scenes / "link.png").symlink_to("../cobbles.png")
        for uri in ("../cobbles.png", "link.png", str(self.folder / "cobbles.png"), "../scenes/../cobbles.png"):
            self.assertEqual(self.info(uri).returncode, 0, uri)
            refused = self.info(uri, "--root", self.scenes)
            self.assertEqual(refused.returncode, 3, uri)
            self.assertIn(f"expected a file below {self.scenes.resolve()} (--root), found \"{uri}\"", refused.stderr)
            self.assertEqual(refused.stdout, "")

    def test_files_below_are_read(self):
        shutil.copy(self.folder / "cobbles.png", self.scenes)
        for uri in ("cobbles.png", "../scenes/cobbles.png"):
            read = self.info(uri, "--root", self.scenes)
            self.assertEqual(read.returncode, 0, read.stderr)
        # A folder whose name only begins alike is another one.
        (self.folder / "scenes2").mkdir()
        shutil.copy(self.folder / "cobbles.png", self.folder / "scenes2")
        self.assertEqual(self.info("../scenes2/cobbles.png", "--root", self.scenes).returncode, 3)

    def test_a_root_that_is_no_folder_is_an_error(self):
        for root in (self.folder / "nowhere", self.folder / "cobbles.png"):
            refused = self.info("../cobbles.png", "--root", root)
            self.assertEqual(refused.returncode, 2)
            self.assertIn(f"--root: expected a folder, found '{root}'", refused.stderr)


class Facts(unittest.TestCase):
    def test_a_picture_says_how_it_was_made(self):
        with tempfile.TemporaryDirectory() as folder:
            picture = f"{folder}/a.exr"
            scene = ROOT / "examples" / "cornell" / "cornell.gltf"
            made = run("render", scene, "--resolution", "40x30", "--crop", "8,4,16,12", "--spp", "2", "--seed", "7", "--aov", "depth", "-o", picture)
            self.assertEqual(made.returncode, 0, made.stderr)
            said = run("info", picture)
            self.assertEqual(said.returncode, 0, said.stderr)
            for line in ("picture: 40x30 pixels", "stored: 8x8 pixels from (8, 4) on", "  R: half", "  relief:seed: 7", "  relief:samples: 2"):
                self.assertIn(line + "\n", said.stdout)
            self.assertRegex(said.stdout, r"  relief:command: relief render .*cornell\.gltf")
            self.assertRegex(said.stdout, r"  worldToCamera: ")
            with open(picture, "r+b") as file:
                file.truncate(200)
            broken = run("info", picture)
            self.assertEqual((broken.returncode, broken.stdout), (3, ""))
            self.assertEqual(broken.stderr.count("\n"), 1, broken.stderr)

    def test_the_version_says_what_was_built(self):
        lines = run("--version").stdout.splitlines()
        version = re.search(r"^project\(relief VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
        self.assertEqual(lines[0], f"relief {version}")
        self.assertRegex(lines[1], r"^commit ([0-9a-f]{7,}(-dirty)?|unknown)$")
        self.assertRegex(lines[2], r"^instruction sets: [a-z0-9, ]+ \(here: [a-z0-9, ]+\)$")
        self.assertRegex(lines[3], r"^libraries: Embree [34]\.\S+, oneTBB \S+, OpenEXR \S+, OpenColorIO \S+, libpng \S+, OpenImageIO \S+$")
        self.assertEqual(len(lines), 4)

    def test_the_version_names_no_library_that_is_not_there(self):
        with tempfile.TemporaryDirectory() as folder:
            alone = shutil.copy(PROGRAM, folder)
            said = subprocess.run([alone, "--version"], capture_output=True, text=True, check=True).stdout
        self.assertRegex(said, r"libpng \S+, without OpenImageIO$")


if __name__ == "__main__":
    unittest.main()
