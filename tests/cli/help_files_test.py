"""Manual pages and completion say what --help says, formatters have nothing to complain about the pages, and real shells complete.

Shells and formatters that are not installed are left out.

    RELIEF_BINARY=build/release/cli/relief python3 tests/cli/help_files_test.py
"""

import functools
import os
import pathlib
import pty
import re
import select
import shlex
import shutil
import subprocess
import tempfile
import time
import unittest

RELIEF = os.path.abspath(os.environ["RELIEF_BINARY"])


def relief(*words, check=True):
    return subprocess.run([RELIEF, *words], capture_output=True, text=True, check=check)


@functools.cache
def help_of(*command):
    return relief(*command, "--help").stdout


def sub_commands(*command):
    listed = help_of(*command).partition("Subcommands:\n")[2].split("\n")
    return [line.split()[0] for line in listed if line.startswith("  ") and line[2:3].strip()]


def all_commands():
    found = [()]
    for command in found:
        found += [(*command, name) for name in sub_commands(*command)]
    return found


def options(*command):
    """Long options, as --help has them."""
    return {name for line in help_of(*command).split("\n") if line.startswith("  -")
            for name in line.split()[0].split(",") if name.startswith("--")}


class ManTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        relief("man", "--folder", cls.folder)

    def pages(self):
        return sorted(self.folder.iterdir())

    def test_every_command_has_a_page(self):
        self.assertEqual({page.name for page in self.pages()}, {"-".join(("relief", *c)) + ".1" for c in all_commands()})
        self.assertIn("relief-render.1", {page.name for page in self.pages()})
        self.assertEqual(relief("man", "bench", "displacement").stdout, (self.folder / "relief-bench-displacement.1").read_text())

    def test_a_page_that_is_not_there(self):
        for words in (("man", "rendr"), ("man", "render", "more"), ("man", "complete")):
            outcome = relief(*words, check=False)
            self.assertEqual(outcome.returncode, 2)
            self.assertIn("expected", outcome.stderr)

    def complaints(self, *formatter):
        if shutil.which(formatter[0]) is None:
            self.skipTest(f"{formatter[0]} is not installed")
        for page in self.pages():
            run = subprocess.run([*formatter, page], capture_output=True, text=True, check=False,
                                 env={**os.environ, "LC_ALL": "C.UTF-8", "MANWIDTH": "100"})
            said = run.stderr + (run.stdout if "-Tlint" in formatter else "")
            self.assertEqual((run.returncode, said), (0, ""), page)

    def test_groff_has_no_warnings(self):
        self.complaints("groff", "-man", "-ww", "-Tutf8", "-z")

    def test_man_has_no_warnings(self):
        self.complaints("man", "--warnings=w", "-l")

    def test_mandoc_has_no_warnings(self):
        self.complaints("mandoc", "-Tlint", "-Wwarning")

    def test_pages_show_what_help_shows(self):
        if shutil.which("groff") is None:
            self.skipTest("groff is not installed")
        for command in all_commands():
            page = self.folder / ("-".join(("relief", *command)) + ".1")
            text = subprocess.run(["groff", "-man", "-Tutf8", "-P-c", "-rLL=2000n", page], capture_output=True, text=True, check=True).stdout
            text = re.sub(r".\x08", "", text)
            for option in options(*command):
                self.assertRegex(text, rf"(?m)^\s+(-\w, )?{option}( |$)", page)
            for name in sub_commands(*command):
                self.assertRegex(text, rf"(?m)^\s+{name}( |$)", page)
        render = (self.folder / "relief-render.1").read_text()
        for words in ("none, zips, zip, piz, dwaa, dwab", "Range: 1..4096", "Not together with", "Files: .gltf, .glb", "130", "143"):
            self.assertIn(words, render.replace("\\-", "-"))


class Completion(unittest.TestCase):
    """What each shell makes of words; the last is to be completed."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        for name in ("shot.gltf", "my shot.GLB", "notes.txt", "a.exr", "b.exr", "sky.hdr", "c.png"):
            (cls.folder / name).touch()
        (cls.folder / "scenes").mkdir()
        tools = cls.folder / "scenes" / "bin"
        tools.mkdir()
        (tools / "relief").symlink_to(RELIEF)
        cls.environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}", "TERM": "dumb", "HOME": cls.temporary.name,
                           "LC_ALL": "C.UTF-8"}

    def check_completion(self, complete):
        """@param complete  words to set of completions, of files their names"""
        self.assertEqual(complete("ren"), {"render"})
        self.assertEqual(complete("bench", ""), {"displacement", "error", "heightfield", "procedural"})
        self.assertEqual(complete(""), set(sub_commands()))
        self.assertNotIn("complete", complete("c"))
        for command in all_commands():
            self.assertEqual(complete(*command, "--"), options(*command), command)
        self.assertEqual(complete("render", "--compression", "z"), {"zips", "zip"})
        self.assertEqual(complete("render", "--compression", ""), {"none", "zips", "zip", "piz", "dwaa", "dwab"})
        self.assertEqual(complete("render", "s.gltf", "--progress", ""), {"bar", "json", "none"})
        self.assertEqual(complete("render", "--aov", "beauty,denoising_"),
                         {f"beauty,denoising_{layer}" for layer in ("albedo", "normal", "depth", "half")})
        self.assertEqual(complete("bench", "heightfield", "--cones", "relaxed,qu"), {"relaxed,quick", "relaxed,quick-relaxed"})
        self.assertEqual(complete("info", "--displacement", "rmip"), {"rmip", "rmip-minmax"})
        self.assertEqual(complete("completion", ""), {"bash", "zsh", "fish"})
        self.assertEqual(complete("render", "--frames", ""), set())
        self.assertEqual(complete("compare", "a.exr", "b"), {"b.exr"})
        self.assertEqual(complete("merge", "a.exr", "b.exr", "x"), set())
        self.assertEqual(complete("report", "a.exr", "--reference", "b"), {"b.exr"})
        self.assertEqual(complete("denoise", "a"), {"a.exr"})
        self.assertEqual(complete("render", "shot.gltf", "--environment", "s"), {"studio", "sky", "sky.hdr", "scenes/"})
        # A value is no option, and what was given once is not offered again.
        self.assertNotIn("--output", complete("render", "-o", "--png", "--ou"))
        self.assertEqual(complete("render", "--spp", "4", "--sp"), set())

    def test_bash(self):
        if shutil.which("bash") is None:
            self.skipTest("bash is not installed")

        def complete(*words):
            script = (f'source <({shlex.quote(RELIEF)} completion bash); compopt() {{ :; }}; COMP_WORDS=(relief {shlex.join(words)}); '
                      f'COMP_CWORD={len(words)}; _relief; for w in "${{COMPREPLY[@]}}"; do [[ -d $w ]] && w+=/; echo "$w"; done')
            run = subprocess.run(["bash", "--norc", "-c", script], capture_output=True, text=True, check=False, cwd=self.folder,
                                 env=self.environment)
            self.assertEqual(run.stderr, "")
            return set(run.stdout.split("\n")[:-1])

        self.check_completion(complete)
        self.assertEqual(complete("render", ""), {"shot.gltf", "my shot.GLB", "scenes/"})
        # As bash parts words at "=".
        self.assertEqual(complete("render", "--compression", "=", "dw"), {"dwaa", "dwab"})
        self.assertEqual(complete("render", "--compression", "="), {"none", "zips", "zip", "piz", "dwaa", "dwab"})
        self.assertEqual(complete("render", "--png", "=", "c"), {"c.png"})
        self.assertEqual(complete("render", "--compression", "=", "zip", "--png", ""), {"c.png", "scenes/"})

    def test_fish(self):
        if shutil.which("fish") is None:
            self.skipTest("fish is not installed")

        def complete(*words):
            script = f"{RELIEF} completion fish | source; complete -C {shlex.quote(' '.join(('relief', *words)))}"
            run = subprocess.run(["fish", "--no-config", "-c", script], capture_output=True, text=True, check=False,
                                 cwd=self.folder, env=self.environment)
            self.assertEqual(run.stderr, "")
            return {line.split("\t")[0] for line in run.stdout.split("\n")[:-1]}

        self.check_completion(complete)
        self.assertEqual(complete("render", "--compression=dw"), {"--compression=dwaa", "--compression=dwab"})
        self.assertEqual(complete("render", "--png=c"), {"--png=c.png"})

    def typed(self, shell, start, keys, expected):
        """Types a command in an interactive shell, and echo before it, and waits for what that prints."""
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(self.folder)
            os.execvpe(shell[0], shell, self.environment)
        self.addCleanup(os.close, terminal)
        shown = ""

        def wait_for(text):
            nonlocal shown
            end = time.monotonic() + 60
            while text not in shown and time.monotonic() < end:
                if select.select([terminal], [], [], 0.2)[0]:
                    shown += os.read(terminal, 4096).decode(errors="replace")
            self.assertIn(text, shown)

        os.write(terminal, (start + "\necho rea''dy\n").encode())
        wait_for("ready\r\n")
        shown = ""
        os.write(terminal, keys.encode() + b"\x01echo \n")
        try:
            wait_for("\n" + expected)
        finally:
            os.kill(pid, 9)
            os.waitpid(pid, 0)

    def test_bash_at_a_terminal(self):
        if shutil.which("bash") is None:
            self.skipTest("bash is not installed")
        self.typed(["bash", "--norc", "-i"], f"source <({RELIEF} completion bash); PS1='$ '",
                   "relief rend\t--comp\tdwaa my\t", "relief render --compression dwaa my shot.GLB")

    def test_zsh_at_a_terminal(self):
        if shutil.which("zsh") is None:
            self.skipTest("zsh is not installed")
        start = f"autoload -U compinit; compinit -u -D; source <({RELIEF} completion zsh); PS1='$ '"
        for keys, expected in (("relief rend\t--compr\tdwaa my\t", "relief render --compression dwaa my shot.GLB"),
                               ("relief render --compression=no\t", "relief render --compression=none"),
                               ("relief render --aov beauty,hal\t", "relief render --aov beauty,half"),
                               ("relief compare --diff=c\t a.\t", "relief compare --diff=c.png a.exr")):
            self.typed(["zsh", "-f", "-i"], start, keys, expected)


if __name__ == "__main__":
    unittest.main()
