"""Folders that do not let everybody write, and lines without an end.

    RELIEF_BINARY=build/release/cli/relief python3 tests/cli/folders_test.py
"""

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from shot import TINY, run, write_shot

RELIEF = os.path.abspath(os.environ["RELIEF_BINARY"])
NOBODY = 65534


@unittest.skipUnless(os.geteuid() == 0, "only root may run a program as somebody else")
class FoldersTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = pathlib.Path(self.temporary.name)
        self.folder.chmod(0o755)
        write_shot(self.folder / "shot.gltf")
        # Whoever that is need not get to where it was built: a clone in /root is root's alone.
        programs = tempfile.TemporaryDirectory()
        self.addCleanup(programs.cleanup)
        pathlib.Path(programs.name).chmod(0o755)
        self.program = shutil.copy(RELIEF, programs.name)

    def render_as_nobody(self, *words):
        return subprocess.run([self.program, "render", "shot.gltf", *map(str, words), *TINY, "--progress", "json"], cwd=self.folder, text=True,
                              capture_output=True, user=NOBODY, group=NOBODY, extra_groups=[])

    def test_resume_leaves_out_what_is_there_in_a_folder_that_cannot_be_written(self):
        words = "-o", "f.#.exr", "--png", "f.#.png", "--frames", "1,2"
        run(RELIEF, "render", "shot.gltf", *words, *TINY, folder=self.folder)
        outcome = self.render_as_nobody(*words, "--resume")
        self.assertEqual(outcome.returncode, 0, outcome.stderr)
        self.assertEqual(outcome.stdout.count('"skipped"'), 2)
        # What is missing is an error all the same, and so is what would be made anew.
        (self.folder / "f.2.exr").unlink()
        outcome = self.render_as_nobody(*words, "--resume")
        self.assertEqual(outcome.returncode, 1, outcome.stderr)
        self.assertIn("f.2.exr: Permission denied", outcome.stderr)
        self.assertEqual(self.render_as_nobody(*words).returncode, 1)

    def test_another_users_file_in_a_sticky_folder_is_refused_before_the_render(self):
        self.folder.chmod(0o1777)
        (self.folder / "a.exr").write_bytes(b"old")
        (self.folder / "a.exr").chmod(0o666)
        outcome = self.render_as_nobody("-o", "a.exr")
        self.assertEqual(outcome.returncode, 1, outcome.stderr)
        self.assertIn("a.exr: Operation not permitted", outcome.stderr)
        self.assertNotIn('"progress"', outcome.stdout)
        self.assertEqual((self.folder / "a.exr").read_bytes(), b"old")
        self.assertEqual(self.render_as_nobody("-o", "b.exr").returncode, 0)
        self.assertEqual(self.render_as_nobody("-o", "b.exr").returncode, 0, "one's own")


class LinesTest(unittest.TestCase):
    def test_serve_answers_a_line_that_is_too_long_and_does_not_keep_it(self):
        with tempfile.TemporaryDirectory() as folder:
            write_shot(pathlib.Path(folder, "shot.gltf"))
            process = subprocess.Popen([RELIEF, "serve"], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                       stderr=subprocess.DEVNULL)
            megabytes = 400
            for _ in range(megabytes):
                process.stdin.write(b"x" * 1_000_000)
            process.stdin.write(b"\n")
            process.stdin.flush()
            end = json.loads(process.stdout.readline())
            self.assertEqual((end["event"], end["id"], end["exit_code"]), ("end", None, 2))
            self.assertIn("expected a line of at most", end["error"])
            status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
            peak_kib = int(status.split("VmHWM:")[1].split()[0])
            self.assertLess(peak_kib, megabytes * 1000 / 2)
            process.stdin.write(json.dumps({"id": 7, "render": ["shot.gltf", "-o", "a.exr", *TINY]}).encode() + b"\n")
            process.stdin.flush()
            line = {}
            while line.get("event") != "end":
                line = json.loads(process.stdout.readline())
            self.assertEqual((line["id"], line["exit_code"]), (7, 0))
            process.stdin.close()
            self.assertEqual(process.wait(), 0)
            process.stdout.close()


if __name__ == "__main__":
    unittest.main()
