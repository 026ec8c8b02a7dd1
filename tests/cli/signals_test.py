"""Signals: whatever the program is doing, it ends, says so by its exit code, and leaves nothing behind.

A pipe that nobody writes to stands for all that takes long: the program waits for it and can look at nothing meanwhile.

    RELIEF_BINARY=build/release/cli/relief python3 tests/cli/signals_test.py
"""

import json
import os
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

from shot import TINY, run, write_shot

RELIEF = os.path.abspath(os.environ["RELIEF_BINARY"])
HANGS_SECONDS = 60  # no measure of time: what has not ended by then does not end


class SignalsTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = pathlib.Path(self.temporary.name)
        write_shot(self.folder / "shot.gltf")
        os.mkfifo(self.folder / "pipe")
        self.clean = self.names()

    def names(self):
        return sorted(path.name for path in self.folder.iterdir())

    def start(self, *words, stdin=subprocess.DEVNULL, **environment):
        process = subprocess.Popen([RELIEF, *map(str, words)], cwd=self.folder, env={**os.environ, **environment}, stdin=stdin,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        return process

    def wait_for_pipe(self, process):
        """Until the program has gone to sleep over the pipe, which it opens: another opener then does not wait."""
        while process.poll() is None:
            tasks = pathlib.Path(f"/proc/{process.pid}/task").iterdir()
            try:
                if any("wait_for_partner" in (task / "wchan").read_text() for task in tasks):
                    return
                if any((task / "syscall").read_text().split()[0] in ("2", "257") for task in
                       pathlib.Path(f"/proc/{process.pid}/task").iterdir()):
                    time.sleep(0.2)  # it is opening something, which takes no time unless it is the pipe
                    return
            except (OSError, IndexError):
                pass
            time.sleep(0.02)

    def end(self, process):
        output, errors = process.communicate(timeout=HANGS_SECONDS)
        return process.returncode, output, errors

    def render_words(self, *more):
        return "render", "shot.gltf", "-o", "a.exr", *TINY, *more

    def test_loading_ends_at_once(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            process = self.start(*self.render_words("--png", "a.png"), OCIO="pipe")
            self.wait_for_pipe(process)
            process.send_signal(number)
            code, _, errors = self.end(process)
            self.assertEqual(code, 130, errors)
            self.assertIn("a.exr: interrupted before the first sample, not written", errors)
            self.assertEqual(self.names(), self.clean)

    def test_half_of_the_grace_time_is_for_loading_too(self):
        process = self.start(*self.render_words("--png", "a.png", "--grace", "0.5"), OCIO="pipe")
        self.wait_for_pipe(process)
        process.send_signal(signal.SIGTERM)
        self.assertEqual(self.end(process)[0], 130)
        self.assertEqual(self.names(), self.clean)

    def test_commands_that_only_read_end_at_once(self):
        run(RELIEF, *self.render_words(), folder=self.folder)
        before = self.names()
        for words in (("trace", "shot.gltf", "--rays", "pipe", "-o", "t.csv"), ("report", "a.exr", "--stats", "pipe", "-o", "r.html"),
                      ("denoise", "a.exr", "-o", "d.exr", "--png", "d.png")):
            process = self.start(*words, OCIO="pipe")
            self.wait_for_pipe(process)
            process.send_signal(signal.SIGINT)
            code, _, errors = self.end(process)
            self.assertEqual(code, 130, (words, errors))
            self.assertEqual(self.names(), before, words)

    def test_serve_ends_while_a_request_is_loaded(self):
        for how, code in (("end of input", 0), (signal.SIGTERM, 130)):
            process = self.start("serve", stdin=subprocess.PIPE, OCIO="pipe")
            for number in (1, 2):
                process.stdin.write(json.dumps({"id": number, "render": self.render_words("--png", "a.png")[1:]}) + "\n")
            process.stdin.flush()
            self.wait_for_pipe(process)
            if how == "end of input":
                process.stdin.close()
                process.stdin = None
            else:
                process.send_signal(how)
                process.wait(HANGS_SECONDS)  # before its input ends
            ended, output, errors = self.end(process)
            self.assertEqual(ended, code, errors)
            ends = [json.loads(line) for line in output.splitlines() if '"end"' in line]
            self.assertEqual({e["id"]: e["exit_code"] for e in ends}, {1: 130, 2: 130}, output)
            self.assertEqual(self.names(), self.clean)

    def test_a_bench_tells_what_it_has_measured(self):
        (self.folder / "slow.sh").write_text("touch slow.began; exec sleep 1000\n")
        process = self.start("bench", "error", "shot.gltf", "--quick", "--resolution", "8x8", "--json", "b.json", "--beside",
                             "Slow=sh slow.sh")
        while not (self.folder / "slow.began").exists() and process.poll() is None:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        # Its standard output is inherited by the other renderer: it ends with that one, too.
        code, output, errors = self.end(process)
        self.assertEqual(code, 130, errors)
        self.assertIn("| relief |", output)
        series = json.loads((self.folder / "b.json").read_text())["scenes"][0]["series"]
        self.assertEqual([s["way"] for s in series if s["points"]], ["relief"])
        self.assertGreaterEqual(len(series[0]["points"]), 3)

    def test_denoising_ends_and_what_was_rendered_is_saved(self):
        process = self.start("render", "shot.gltf", "-o", "a.exr", "--resolution", "1200x1200", "--spp", "4", "--denoise", "builtin",
                             "--progress", "json", "--threads", "1")
        for line in process.stdout:
            if json.loads(line).get("fraction") == 1:
                break
        process.send_signal(signal.SIGINT)
        code, _, errors = self.end(process)
        self.assertEqual(code, 130, errors)
        self.assertIn("a.exr: interrupted, not denoised", errors)
        self.assertEqual(run(RELIEF, "compare", "a.exr", "a.exr", "--layer", "denoised", folder=self.folder, check=False).returncode, 3)
        self.assertEqual(self.names(), sorted([*self.clean, "a.exr"]))

    def test_a_second_signal_ends_what_does_not_listen(self):
        # Nobody reads the picture.
        process = self.start("render", "shot.gltf", "-o", "pipe", *TINY)
        self.wait_for_pipe(process)
        process.send_signal(signal.SIGINT)
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        self.assertEqual(self.end(process)[0], 130)


if __name__ == "__main__":
    unittest.main()
