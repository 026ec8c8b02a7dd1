"""The program of examples/embedding is built and run in each of the ways that docs/embedding.md names: out of an installed library, and
twice with relief as a part of its own build.

$RELIEF_BUILD is a build folder of relief, in which the library has been built.
"""

import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "embedding"


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


class Embedding(unittest.TestCase):
    def build_and_run(self, way, *options):
        with tempfile.TemporaryDirectory() as folder:
            run("cmake", "-S", EXAMPLE, "-B", folder, "-G", "Ninja", f"-DRELIEF_FROM={way}", "-DCMAKE_BUILD_TYPE=Debug",
                # Warnings that relief asks for itself, and one that it does not pass.
                "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wswitch-default -Wuseless-cast", "-DRELIEF_ISAS=native", *options)
            run("cmake", "--build", folder, "--target", "embedding")
            self.assertIn("1000 rays, largest error ", run(f"{folder}/embedding"))

    def test_installed(self):
        with tempfile.TemporaryDirectory() as prefix:
            run("cmake", "--install", os.environ["RELIEF_BUILD"], "--component", "library", "--prefix", prefix)
            headers = [p.relative_to(prefix) for p in pathlib.Path(prefix).rglob("*.h")]
            self.assertEqual(headers, [pathlib.Path("include/relief/displaced_geometry.h")])
            self.build_and_run("package", f"-DCMAKE_PREFIX_PATH={prefix}")

    def test_subdirectory(self):
        self.build_and_run("subdirectory")

    def test_fetched(self):
        self.build_and_run("fetch")


if __name__ == "__main__":
    unittest.main()
