"""The job script of `relief farm slurm`, run without Slurm: sbatch and scontrol are stand-ins that run each task of an array by
hand. slurm_test.py has the real ones.

    RELIEF_BINARY=build/release/cli/relief python3 tests/cli/farm_test.py
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from shot import TINY, difference, run, write_shot

RELIEF = os.path.abspath(os.environ["RELIEF_BINARY"])
NODE = shutil.which("node")
JOB_TYPE = pathlib.Path(__file__).resolve().parents[2] / "cli" / "flamenco" / "relief_render.js"

# Runs the tasks of the array that is asked for, or that the script asks for; prints a job's number as --parsable does.
SBATCH = r"""#!/bin/bash
echo "$*" >> "$STUB_LOG"
while [[ $1 == --* ]]; do [[ $1 == --array=* ]] && array=${1#--array=}; shift; done
script=$(realpath "$1")
shift
: "${array:=$(sed -n 's/^#SBATCH --array=//p' "$script")}"
for ((task = 1; task <= ${array#1-}; ++task)); do
  for restart in 0 1 2 3; do
    rm -f "$STUB_LOG.requeue"
    (cd / && SLURM_ARRAY_TASK_ID=$task SLURM_ARRAY_JOB_ID=7 SLURM_CPUS_ON_NODE=2 SLURM_RESTART_COUNT=$restart sh "$script" "$@") \
      >> "$STUB_LOG.out" 2>&1 < /dev/null
    echo "task $task: $?" >> "$STUB_LOG"
    [[ -e $STUB_LOG.requeue ]] || break
  done
done
echo "7;cluster"
"""
SCONTROL = '#!/bin/sh\necho "scontrol $*" >> "$STUB_LOG"\ntouch "$STUB_LOG.requeue"\n'


class FarmTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        # Everything that a shell could trip over.
        self.folder = pathlib.Path(self.temporary.name, "it's \"my\" $HOME; `shot` \\ é")
        self.folder.mkdir()
        tools = pathlib.Path(self.temporary.name, "tools")
        tools.mkdir()
        for name, text in (("sbatch", SBATCH), ("scontrol", SCONTROL)):
            (tools / name).write_text(text)
            (tools / name).chmod(0o755)
        self.log = pathlib.Path(self.temporary.name, "log")
        self.environment = {"PATH": f"{tools}:{os.environ['PATH']}", "STUB_LOG": str(self.log)}
        write_shot(self.folder / "a 'shot'.gltf")

    def relief(self, *words, check=True, **environment):
        return run(RELIEF, *words, folder=self.folder, check=check, **{**self.environment, **environment})

    def farm(self, *words, check=True, **environment):
        return self.relief("farm", "slurm", "a 'shot'.gltf", *words, check=check, **environment)

    def logged(self):
        return self.log.read_text()

    def test_frames_are_those_of_a_single_run(self):
        done = self.farm("-o", "out 'f'.#.exr", "--frames", "1-5,9,8", "--tasks", "2", "--submit", "--", *TINY)
        self.assertIn("render: job 7, 2 tasks", done.stdout)
        self.assertNotIn("merge", done.stdout)
        self.assertEqual(self.logged().count(": 0"), 2, self.logged())
        self.relief("render", "a 'shot'.gltf", "-o", "one.#.exr", "--frames", "1-5,8,9", *TINY)
        for frame in (1, 2, 3, 4, 5, 8, 9):
            self.assertEqual(difference(RELIEF, self.folder / f"out 'f'.{frame}.exr", self.folder / f"one.{frame}.exr")["rmse"], 0)

    def test_parts_of_a_frame_become_the_single_run(self):
        done = self.farm("-o", "o.exr", "--frames", "2,7", "--split", "3", "--submit", "--sbatch=--mem=1G", "--sbatch=--partition=x",
                         "--", *TINY, "--aov", "all")
        self.assertIn("merge: job 7, 2 tasks", done.stdout)
        self.assertIn("--dependency=afterok:7 ", self.logged())
        self.assertEqual(self.logged().count(": 0"), 8, self.logged())
        self.assertRegex((self.folder / "farm.slurm.sh").read_text(), r"(?m)^#SBATCH --mem=1G\n#SBATCH --partition=x$")
        self.relief("render", "a 'shot'.gltf", "-o", "one.exr", "--frames", "2,7", "--float", *TINY, "--aov", "all")
        for frame in (2, 7):
            files = self.folder / f"o.000{frame}.exr", self.folder / f"one.000{frame}.exr"
            # Sums of floats in another order, and nothing more.
            figures = difference(RELIEF, *files)
            self.assertLess(figures["rmse"], 1e-7)
            for layer in ("samples", "object_id", "material_id"):
                self.assertEqual(difference(RELIEF, *files, layer)["rmse"], 0, layer)
            for layer in ("half", "direct", "albedo", "normal", "depth", "position"):
                self.assertLess(difference(RELIEF, *files, layer)["rmse"], 1e-6, layer)

    def test_what_is_there_is_left_out(self):
        words = ("-o", "o.#.exr", "--frames", "1-3", "--submit", "--", *TINY)
        self.farm(*words)
        before = {path: path.stat().st_mtime_ns for path in self.folder.glob("o.*.exr")}
        self.assertEqual(len(before), 3)
        (self.folder / "o.2.exr").unlink()
        run("sh", "farm.slurm.sh", folder=self.folder, **self.environment)
        self.assertTrue((self.folder / "o.2.exr").exists())
        for number in (1, 3):
            path = self.folder / f"o.{number}.exr"
            self.assertEqual(path.stat().st_mtime_ns, before[path])

    def test_a_task_that_fails_is_queued_again_where_that_may_help(self):
        self.farm("-o", "o.#.exr", "--frames", "1-2", "--retries", "2", "--", *TINY)
        script = self.folder / "farm.slurm.sh"
        # Stand-ins that fail with these codes: another try may help, or not.
        for code, tries in ((1, 3), (134, 3), (2, 1), (3, 1), (130, 1)):
            self.log.unlink(missing_ok=True)
            stand_in = pathlib.Path(self.temporary.name, "fails")
            stand_in.write_text(f"#!/bin/sh\nexit {code}\n")
            stand_in.chmod(0o755)
            script.write_text(re.sub(r"(?m)^relief=.*$", f"relief={stand_in}", script.read_text()))
            run("sh", script, folder=self.folder, **self.environment)
            self.assertEqual(self.logged().count(f"task 1: {code}"), tries, self.logged())
            self.assertEqual(self.logged().count("scontrol requeue 7_1"), tries - 1)

    def test_mistakes_are_found_before_anything_is_written(self):
        cases = [
            (("--", "--sp", "4"), 2, "--sp"),
            (("--", "--compression", "zap"), 2, "zap"),
            (("--", "--frames", "4"), 2, "no --frames"),
            (("--", "--progress", "json"), 2, "no --progress"),
            (("--split", "2", "--", "--png", "a.png"), 2, "no --png"),
            (("--split", "2", "--", "--report", "a.html"), 2, "no --report"),
            (("--sbatch=a\nrm -r .",), 2, "one line"),
            (("--split", "0"), 2, "--split"),
            (("--split", "5", "--", "--spp", "16"), 2, "at most 4 parts"),
            (("--script", "a 'shot'.gltf"), 2, "--script"),
        ]
        for words, code, message in cases:
            outcome = self.farm("-o", "o.exr", *words, check=False)
            self.assertEqual(outcome.returncode, code, outcome.stderr)
            self.assertIn(message, outcome.stderr)
        # The scene's own number, where none is given.
        scene = json.loads((self.folder / "a 'shot'.gltf").read_text())
        scene["extensions"]["RELIEF_render"] = {"samples": 16}
        scene["extensionsUsed"].append("RELIEF_render")
        (self.folder / "sixteen.gltf").write_text(json.dumps(scene))
        outcome = self.relief("farm", "slurm", "sixteen.gltf", "-o", "o.exr", "--split", "5", check=False)
        self.assertEqual(outcome.returncode, 2, outcome.stderr)
        self.assertIn("at most 4 parts of 16 samples", outcome.stderr)
        self.assertFalse((self.folder / "farm.slurm.sh").exists())
        self.relief("farm", "slurm", "sixteen.gltf", "-o", "o.exr", "--split", "5", "--", "--spp", "20")
        (self.folder / "farm.slurm.sh").unlink()
        scene = json.loads((self.folder / "a 'shot'.gltf").read_text())
        scene["extensions"]["RELIEF_render"] = {"frameRange": [-2, 1]}
        scene["extensionsUsed"].append("RELIEF_render")
        (self.folder / "early.gltf").write_text(json.dumps(scene))
        outcome = self.relief("farm", "slurm", "early.gltf", "-o", "o.exr", "--frames", "all", check=False)
        self.assertEqual(outcome.returncode, 2, outcome.stderr)
        self.assertIn("found -2 to 1", outcome.stderr)
        outcome = self.farm("-o", "o.exr", "--submit", check=False, PATH="/nowhere")
        self.assertEqual(outcome.returncode, 1)
        self.assertIn("sbatch", outcome.stderr)
        outcome = self.relief("farm", "slurm", "none.gltf", "-o", "o.exr", check=False)
        self.assertEqual(outcome.returncode, 3, outcome.stderr)
        self.assertFalse((self.folder / "farm.slurm.sh").exists())

    def test_no_script_takes_the_place_of_what_its_tasks_read_or_write(self):
        write_shot(self.folder / "other.gltf")
        self.relief("render", "other.gltf", "-o", "ref.0002.exr", *TINY)
        self.relief("render", "other.gltf", "-o", "sky.exr", *TINY)
        (self.folder / "link.sh").symlink_to("a 'shot'.bin")
        os.link(self.folder / "a 'shot'.bin", self.folder / "twin.sh")
        os.link(self.folder / "other.bin", self.folder / "other.sh")
        before = {path.name: path.read_bytes() for path in self.folder.iterdir()}
        common = "-o", "o.exr", "--frames", "1-2"
        for script, words in (("a 'shot'.bin", ()), ("link.sh", ()), ("twin.sh", ()), ("o.0002.exr", ()),
                              ("o.0002.part-2-of-2.exr", ("--split", "2")), ("sky.exr", ("--", "--environment", "sky.exr")),
                              ("ref.0002.exr", ("--", "--reference", "ref.####.exr")), ("p.0001.png", ("--", "--png", "p.png")),
                              ("other.bin", ("--", "--camera-from", "other.gltf")), ("other.sh", ("--", "--camera-from", "other.gltf"))):
            outcome = self.farm(*common, "--script", script, *words, check=False)
            self.assertEqual(outcome.returncode, 2, (script, outcome.stderr))
            self.assertIn("--script: expected a file that", outcome.stderr)
            self.assertEqual({path.name: path.read_bytes() for path in self.folder.iterdir()}, before)
        # Nor an output that of an input, which every task would find out.
        self.assertEqual(self.farm("-o", "ref.exr", "--frames", "2", "--", "--reference", "ref.####.exr", check=False).returncode, 2)
        self.farm(*common, "--script", "own.sh")
        self.farm(*common, "--script", "own.sh")

    def test_no_bench_takes_the_place_of_what_it_reads(self):
        scene = self.folder / "s.gltf"
        write_shot(scene)
        os.link(scene.with_suffix(".bin"), self.folder / "twin.json")
        (self.folder / "link.html").symlink_to("s.bin")
        before = {path.name: path.read_bytes() for path in self.folder.iterdir()}
        for words in (("error", "s.gltf", "--quick", "--json", "twin.json"), ("error", "s.gltf", "--quick", "--html", "link.html"),
                      ("procedural", "--quick", "--parts", "smoothing", "--mesh", "s.gltf", "--json", "twin.json")):
            outcome = self.relief("bench", *words, check=False)
            self.assertEqual(outcome.returncode, 2, outcome.stderr)
            self.assertIn("read as a file of the scene", outcome.stderr)
            self.assertEqual({path.name: path.read_bytes() for path in self.folder.iterdir()}, before)

    def test_the_tasks_are_as_many_as_there_may_be(self):
        for words, tasks in ((("--frames", "1-240"), 240), (("--frames", "1-240", "--split", "4"), 960),
                             (("--frames", "1-2400"), 1000), (("--frames", "1-240", "--tasks", "7"), 7),
                             (("--frames", "1-240", "--tasks", "7", "--split", "3"), 6), ((), 1), (("--split", "5"), 5)):
            self.farm("-o", "o.exr", *words)
            script = (self.folder / "farm.slurm.sh").read_text()
            self.assertIn(f"#SBATCH --array=1-{tasks}\n", script)
            given = [frame for text in re.findall(r"\) echo (\S+) ;;", script) for piece in text.split(",")
                     for frame in range(int(piece.split("-")[0]), int(piece.split("-")[-1]) + 1)]
            if "--frames" in words:
                self.assertEqual(given, list(range(1, 1 + int(words[1].split("-")[1]))))


# Stands in for what Flamenco's manager gives to a script, and prints what the script makes of a job.
MANAGER = r"""
const vm = require("vm"), fs = require("fs");
const job = { settings: JSON.parse(process.argv[3]), tasks: [], addTask(task) { this.tasks.push(task); } };
const author = {
    Task: (name, type) => ({ name, type, commands: [], dependencies: [],
        addCommand(command) { this.commands.push(command); },
        addDependency(task) { this.dependencies.push(task.name); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
function frameChunker(frames, size) {
    const numbers = frames.split(",").flatMap((piece) => {
        const [first, last] = piece.trim().split("-").map(Number);
        return Array.from({ length: (last ?? first) - first + 1 }, (_, i) => first + i);
    });
    const chunks = [];
    for (let i = 0; i < numbers.length; i += size) chunks.push(numbers.slice(i, i + size).join(","));
    return chunks;
}
const context = vm.createContext({ author, frameChunker, print: () => {} });
vm.runInContext(fs.readFileSync(process.argv[2], "utf8") + "\n;globalThis.jobType = JOB_TYPE;", context);
for (const setting of context.jobType.settings) {
    if (!(setting.key in job.settings) && "default" in setting) job.settings[setting.key] = setting.default;
    if (setting.required && !(setting.key in job.settings)) throw new Error(setting.key);
}
context.compileJob(job);
console.log(JSON.stringify(job.tasks));
"""


@unittest.skipUnless(NODE, "node is not installed")
class FlamencoTest(unittest.TestCase):
    def tasks(self, **settings):
        outcome = run(NODE, "-e", MANAGER, "--", "x", JOB_TYPE, json.dumps(settings), check=False)
        self.assertEqual(outcome.returncode, 0, outcome.stderr)
        return json.loads(outcome.stdout)

    def perform(self, tasks, folder):
        """Runs the commands of tasks in the order of their dependencies."""
        done = set()
        for task in tasks:
            self.assertLessEqual(set(task["dependencies"]), done)
            for command in task["commands"]:
                self.assertEqual(command["name"], "exec")
                run(command["parameters"]["exe"], *command["parameters"]["args"], folder=folder)
            done.add(task["name"])

    def test_a_job_renders_its_frames(self):
        with tempfile.TemporaryDirectory(prefix="a 'b' ") as folder:
            write_shot(pathlib.Path(folder, "shot.gltf"))
            common = {"scene": "shot.gltf", "frames": "1-3, 7", "options": " ".join(TINY), "program": RELIEF}
            tasks = self.tasks(output="f.#.exr", chunk_size=3, **common)
            self.assertEqual([task["name"] for task in tasks], ["render-1,2,3", "render-7"])
            self.perform(tasks, folder)
            tasks = self.tasks(output="p", chunk_size=2, parts=2, **common)
            self.assertEqual(len(tasks), 6)
            self.perform(tasks, folder)
            for frame in (1, 2, 3, 7):
                figures = difference(RELIEF, pathlib.Path(folder, f"p.000{frame}.exr"), pathlib.Path(folder, f"f.{frame}.exr"))
                # Of which one is stored in halves.
                self.assertLess(figures["rmse"], 3e-4)


if __name__ == "__main__":
    unittest.main()
