"""`relief farm slurm` on a real Slurm: a shot's frames over tasks, a frame's samples over tasks, and a node that dies.

Needs Debian's slurm-wlm and munge, and root; left out without them. Takes some minutes, most of them Slurm's own.

    RELIEF_BINARY=build/release/cli/relief python3 tests/cli/slurm_test.py
"""

import os
import pathlib
import tempfile
import time
import unittest

import slurm_cluster
from shot import TINY, difference, run, write_shot

RELIEF = os.path.abspath(os.environ["RELIEF_BINARY"])


@unittest.skipIf(slurm_cluster.missing(), slurm_cluster.missing())
class SlurmTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.cluster = slurm_cluster.Cluster(cls.temporary.name)
        cls.addClassCleanup(cls.cluster.close)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="it's a shot ", dir=self.temporary.name))
        write_shot(self.folder / "shot.gltf")

    def relief(self, *words):
        return run(RELIEF, *words, folder=self.folder, **self.cluster.environment)

    def farm(self, *words):
        return self.relief("farm", "slurm", "shot.gltf", "--submit", *words)

    def logs(self):
        return "\n".join(f"{log.name}: {log.read_text()}" for log in sorted(self.folder.glob("slurm-*.out")))

    def wait_for_jobs(self):
        self.cluster.wait_for(lambda: not self.cluster.jobs(), "jobs\n" + self.logs(), 300)

    def single(self, name, *words):
        self.relief("render", "shot.gltf", "-o", name, "--progress", "none", *words)

    def test_sixteen_frames_over_two_tasks(self):
        self.farm("-o", "f.##.exr", "--frames", "1-16", "--tasks", "2", "--", *TINY)
        self.wait_for_jobs()
        self.single("one.##.exr", "--frames", "1-16", *TINY)
        for frame in range(1, 17):
            figures = difference(RELIEF, self.folder / f"f.{frame:02}.exr", self.folder / f"one.{frame:02}.exr")
            self.assertEqual(figures["rmse"], 0, self.logs())

    def test_one_frame_over_four_tasks(self):
        self.farm("-o", "f.exr", "--split", "4", "--", *TINY)
        self.wait_for_jobs()
        self.assertTrue((self.folder / "f.exr").exists(), self.logs())
        self.single("one.exr", "--float", *TINY)
        figures = difference(RELIEF, self.folder / "f.exr", self.folder / "one.exr")
        self.assertLess(figures["rmse"], 1e-7)
        self.assertEqual(difference(RELIEF, self.folder / "f.exr", self.folder / "one.exr", "samples")["rmse"], 0)

    def test_a_node_that_dies(self):
        # Each frame takes about a second.
        words = ["--resolution", "96x64", "--spp", "512"]
        self.farm("-o", "f.##.exr", "--frames", "1-8", "--tasks", "4", "--split", "2", "--", *words)
        self.cluster.wait_for(lambda: "n2" in {node for state, node in self.cluster.jobs().values() if state == "RUNNING"}, "a task on n2")
        time.sleep(2)
        before = self.cluster.jobs()
        self.cluster.kill_node("n2")
        lost = [task for task, (state, node) in before.items() if state == "RUNNING" and node == "n2"]
        self.assertEqual(len(lost), 1, before)
        self.cluster.wait_for(lambda: "n2" in self.cluster.nodes("down"), "the loss of n2")
        self.wait_for_jobs()
        self.cluster.start_node("n2")
        # The task was begun twice: Slurm says so in its record of the job.
        record = self.cluster.ask("scontrol", "show", "job", lost[0])
        self.assertIn("Restarts=1", record, self.logs())
        self.single("one.##.exr", "--frames", "1-8", "--float", *words)
        for frame in range(1, 9):
            figures = difference(RELIEF, self.folder / f"f.{frame:02}.exr", self.folder / f"one.{frame:02}.exr")
            # 512 floats of a pixel, added in another order.
            self.assertLess(figures["rmse"], 1e-5)
        self.cluster.wait_for(lambda: self.cluster.nodes("idle") == set(self.cluster.NODES), "n2 again")


if __name__ == "__main__":
    unittest.main()
