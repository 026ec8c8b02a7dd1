"""What packages hold runs without the libraries of the machine, but those of C and C++, and shows the same pictures.

$RELIEF_BUILD is a build folder, in which everything has been built. Needs patchelf.
"""

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENE = ROOT / "examples" / "spheres" / "spheres.gltf"
PIXELS = ROOT / "examples" / "displaced" / "cobbles.png"
SYSTEM = re.compile(r"linux-vdso|ld-linux-x86-64|lib(c|m|dl|rt|pthread|stdc\+\+|gcc_s)\.so")


def run(*command, **options):
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True, **options).stdout


def render(program, folder, image, environment):
    picture = pathlib.Path(folder, "picture.exr")
    picture.unlink(missing_ok=True)
    run(program, "render", SCENE, "--environment", image, "--resolution", "32x24", "--spp", "2", "--output", picture, env=environment)
    return picture


@unittest.skipUnless(shutil.which("patchelf"), "patchelf is missing; run scripts/install_dependencies package")
class Bundle(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.tree = pathlib.Path(cls.temporary.name, "tree")
        run("cmake", "--install", os.environ["RELIEF_BUILD"], "--component", "program", "--prefix", cls.tree, "--strip")
        cls.libraries = cls.tree / "lib" / "relief"
        cls.program = cls.tree / "bin" / "relief"
        cls.beside = [cls.libraries / "relief_image_io.so", cls.libraries / "relief_voxels"]
        run(ROOT / "scripts" / "bundle_libraries", cls.libraries, cls.program, *cls.beside)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_nothing_but_the_systems_libraries_is_missing(self):
        for file in [self.program, *self.beside, *self.libraries.glob("*.so.*")]:
            for line in run("ldd", file, env={"LD_LIBRARY_PATH": "/nowhere"}).splitlines():
                self.assertNotIn("not found", line, file)
                if not SYSTEM.search(line) and "statically linked" not in line:
                    self.assertIn(str(self.libraries), os.path.normpath(line.split(" => ")[1]), file)

    def test_is_small(self):
        # OpenVDB, which reads .vdb files, is 80 MB of it.
        self.assertLess(sum(f.stat().st_size for f in self.tree.rglob("*")), 190e6)

    def test_images_of_every_format_are_read_alike(self):
        if not shutil.which("oiiotool"):
            self.skipTest("oiiotool is missing")
        plain = pathlib.Path(os.environ["RELIEF_BUILD"], "cli", "relief")
        with tempfile.TemporaryDirectory() as folder:
            for suffix in ("png", "jpg", "exr", "hdr", "tif", "webp", "tga", "bmp"):
                image = pathlib.Path(folder, f"image.{suffix}")
                run("oiiotool", PIXELS, "--ch", "0,0,0", "-o", image)
                # Whatever a host such as Blender says of libraries.
                bundled = render(self.program, folder, image, {"LD_LIBRARY_PATH": "/usr/lib/x86_64-linux-gnu"}).rename(f"{folder}/bundled.exr")
                self.assertIn("RMSE    0\n", run(plain, "compare", bundled, render(plain, folder, image, None)), suffix)

    def test_licences_are_there(self):
        licences = [p.name for p in (self.libraries / "licences").iterdir()]
        for library in ("libembree3-3", "libembree4-4"):
            if f"{library}.txt" in licences:
                break
        else:
            self.fail(f"no licence of Embree among {licences}")
        self.assertTrue((self.tree / "share" / "doc" / "relief" / "copyright").exists())


class Addon(unittest.TestCase):
    def test_a_folder_without_the_program_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([ROOT / "scripts" / "package_addon", "--program", folder, f"{folder}/a.zip"], capture_output=True, text=True,
                                  check=False)
            self.assertEqual(done.returncode, 2)
            self.assertIn("expected a folder with bin/relief", done.stderr)
            self.assertFalse(os.path.exists(f"{folder}/a.zip"))


if __name__ == "__main__":
    unittest.main()
