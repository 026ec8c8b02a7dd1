"""What the documentation says to type can be typed, and the files and headings that it names are there.

Commands are the lines of code blocks, and the code in running text, that start with a program or a script. Of `relief` every
sub-command and option is held against its --help; commands that read scenes are run, small, where $RELIEF_BINARY names the
program. Of scripts and benchmarks the file is there, can be run, and mentions the options. install_test.py runs the commands of
docs/blender.md, which want Blender.
"""

import functools
import itertools
import json
import os
import pathlib
import re
import shlex
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md")), ROOT / "benchmarks" / "RESULTS.md"]
FOLDERS = "benchmarks blender_addon cli displacement docs examples exporters integrator kernel python scene scripts tests".split()

# What starts a command, after settings of environment variables.
PROGRAM = re.compile(r"(?:\w+=\S+ )*(?:relief |(?:build/\w+/)?cli/relief |build/\w+/cli/relief |build/\w+/benchmarks/|"
                     r"scripts/\w+(?![\w/])|benchmarks/\S+\.py|relief_(?:bench_\w+|\w+_tests) |cmake --|ctest |blender -)")
OPTION = re.compile(r"(?<![\w=-])(-{1,2}[a-zA-Z][\w-]*)")
PLACEHOLDERS = {"COMMAND", "…"}
# Makes a run short: options that are added where the command does not give them, by sub-command.
SMALL = {"render": {"--resolution": "16x9", "--spp": "8", "--threads": "2", "--progress": "none"},
         "bench": {"--scenes": "glass", "--quick": None}}
# What stands for the words of a usage line.
WORDS = {"SCENE": "examples/cornell/cornell.gltf", "X,Y": "3,3", "X,Y[,SAMPLE]": "3,3", "I": "0", "FILE": "rays.txt", "A": "A.exr", "B": "B.exr",
         "MAP": "examples/displaced/cobbles.png", "MESH": "examples/displaced/displaced.gltf", "S": "0.02", "…": ""}


def blocks(text):
    """Lines of code blocks, fenced without a language or indented by four spaces after an empty line, with their numbers."""
    fence, previous_empty, in_block = None, True, False
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("```"):
            fence = line[3:].strip() if fence is None else None
            continue
        if fence is not None:
            if fence in ("", "sh", "bash"):
                yield number, line
            continue
        indented = line.startswith("    ") and bool(line.strip())
        in_block = indented and (in_block or previous_empty)
        previous_empty = not line.strip()
        if in_block:
            yield number, line[4:]


def spans(text):
    """Code in running text, with the numbers of its lines."""
    fenced = False
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("```"):
            fenced = not fenced
        if not fenced and not line.startswith("    "):
            for found in re.finditer(r"`([^`]+)`", line):
                yield number, found[1]


def commands(path):
    """(place, command) of a page, continuation lines joined, comments and what follows two spaces left out."""
    text = path.read_text(encoding="utf-8")
    found = []
    for number, line in blocks(text):
        if found and found[-1][0] == number - 1 and re.match(r"\s+(\[|-)", line):
            found[-1] = (number, found[-1][1] + " " + line.strip())
        elif PROGRAM.match(line):
            found.append((number, re.split(r"\s{2,}", line)[0]))
    # A name alone is no command, but that of a script, which is there to be run.
    found += [(number, span) for number, span in spans(text)
              if PROGRAM.match(span + " ") and (" " in span or span.startswith("scripts/"))]
    for number, command in found:
        for part in command.split(" && "):
            yield f"{path.relative_to(ROOT)}:{number}", part.strip()


def all_commands():
    return itertools.chain.from_iterable(commands(path) for path in PAGES)


def words(command):
    """The words of a command without the environment variables before it."""
    return [word for word in command.split() if not re.match(r"[A-Z_]+=", word)]


def is_relief(command):
    return words(command)[0].rsplit("/", 1)[-1] == "relief"


@functools.cache
def help_of(*sub_command):
    run = subprocess.run([os.environ["RELIEF_BINARY"], *sub_command, "--help"], capture_output=True, text=True, check=False)
    return run.stdout if run.returncode == 0 else ""


def options_of(*sub_command):
    """Every option in the program's help, as it is written there."""
    return {option for line in help_of(*sub_command).split("\n") if line.startswith("  -")
            for option in line.split()[0].split(",")}


def sub_commands_of(*sub_command):
    listed = help_of(*sub_command).partition("Subcommands:\n")[2].split("\n")
    return {line.split()[0] for line in listed if line.startswith("  ") and line[2:3].strip()}


def split_relief(command):
    """(sub-commands, other words) of a command of `relief`."""
    rest = words(command.split(" | ")[0])[1:]
    sub = []
    while rest and rest[0] in sub_commands_of(*sub):
        sub.append(rest.pop(0))
    return tuple(sub), rest


def slug(heading):
    """The anchor that GitHub makes of a heading."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")


@functools.cache
def anchors(path):
    made, counts = set(), {}
    for heading in re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE):
        name = slug(heading)
        made.add(name if name not in counts else f"{name}-{counts[name]}")
        counts[name] = counts.get(name, 0) + 1
    return made


def expanded(path):
    """Alternatives in braces, multiplied out."""
    found = re.search(r"\{([^{}]*)\}", path)
    if found is None:
        return [path]
    return [p for choice in found[1].split(",") for p in expanded(path[: found.start()] + choice + path[found.end() :])]


def is_there(path):
    """Whether a file or folder that a page names exists; of one that is to be made (NAME, <folder>) the folder before it."""
    known = re.split(r"NAME|<", path)[0]
    if known != path:
        known = known.rsplit("/", 1)[0]
    return any(ROOT.glob(known.rstrip("/")))


def range_of(text):
    """What a cell says of a setting's range: two limits, None where there is none, or the choices; None if it says nothing."""
    if not text or text.startswith("`"):
        return [json.loads(choice.strip("`")) for choice in text.split(", ")] if text else None
    if text.startswith("≥"):
        return [float(text[1:]), None]
    return [float(limit) for limit in text.split("…")]


class Docs(unittest.TestCase):
    def assert_none(self, wrong):
        self.assertEqual([], sorted(set(wrong)))

    def test_versions_are_the_projects(self):
        version = re.search(r"^project\(relief VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
        for name, pattern in {"CITATION.cff": r"^version: (\S+)$", "README.md": r"version = \{([\d.]+)\}",
                              "blender_addon/relief/blender_manifest.toml": r'^version = "(\S+)"$'}.items():
            found = re.findall(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
            self.assertEqual([version], found, name)
        packages = re.findall(r"relief(?:-blender)?[-_](\d+\.\d+\.\d+)", (ROOT / "README.md").read_text(encoding="utf-8"))
        self.assertEqual({version}, set(packages))

    def test_there_are_commands(self):
        self.assertGreater(len(list(all_commands())), 40)

    @unittest.skipUnless("RELIEF_BINARY" in os.environ, "$RELIEF_BINARY is not set")
    def test_sub_commands_and_options_exist(self):
        wrong = []
        for place, command in all_commands():
            if not is_relief(command):
                continue
            sub, rest = split_relief(command)
            if not sub and not set(rest) & (PLACEHOLDERS | {"--help", "--version"}):
                wrong.append(f"{place}: no sub-command: {command}")
            # What stands after "--" is for a render.
            own, _, of_render = " ".join(rest).partition(" -- ")
            for name, text in ((sub, own), (("render",), of_render)):
                wrong += [f"{place}: relief {' '.join(name)} has no {option}"
                          for option in OPTION.findall(text) if option not in options_of(*name) and option != "--help"]
        self.assert_none(wrong)

    @unittest.skipUnless("RELIEF_BINARY" in os.environ, "$RELIEF_BINARY is not set")
    def test_every_option_is_documented(self):
        text = (ROOT / "docs" / "usage.md").read_text(encoding="utf-8")
        documented = set(OPTION.findall(text)) | {"-h", "--help"}
        wrong = []
        names = sub_commands_of()
        for sub in [(), *((name,) for name in names), *((name, below) for name in names for below in sub_commands_of(name))]:
            wrong += [f"docs/usage.md: nothing about {option} of relief {' '.join(sub)}"
                      for option in options_of(*sub) if option not in documented]
        self.assert_none(wrong)

    @unittest.skipUnless("RELIEF_BINARY" in os.environ, "$RELIEF_BINARY is not set")
    def test_options_in_tables_exist(self):
        text = (ROOT / "docs" / "usage.md").read_text(encoding="utf-8")
        wrong = []
        for section in re.split(r"^## ", text, flags=re.MULTILINE):
            command = re.match(r"relief (\w+)\n", section)
            if command is None:
                continue
            subs = [(command[1], name) for name in sub_commands_of(command[1])] or [(command[1],)]
            known = {option for sub in subs for option in options_of(*sub)}
            shown = OPTION.findall(" ".join(re.findall(r"^\| (`-.*?) \|", section, re.MULTILINE)))
            wrong += [f"docs/usage.md: relief {command[1]} has no {option}" for option in shown if option not in known]
        self.assert_none(wrong)

    @unittest.skipUnless("RELIEF_BINARY" in os.environ, "$RELIEF_BINARY is not set")
    def test_commands_of_relief_run(self):
        program = str(pathlib.Path(os.environ["RELIEF_BINARY"]).resolve())
        ran, wrong = 0, []
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "examples").symlink_to(ROOT / "examples")
            (folder / "rays.txt").write_text("0 0 5 0 0 -1\n", encoding="utf-8")
            for seed, picture in enumerate(("A.exr", "B.exr")):
                subprocess.run([program, "render", WORDS["SCENE"], "-o", picture, "--resolution", "16x9", "--spp", "2", "--seed",
                                str(seed), "--progress", "none"], cwd=folder, capture_output=True, check=True)  # fmt: skip
            for place, command in all_commands():
                if not is_relief(command):
                    continue
                line = self.runnable(command)
                if line is None or not self.has_inputs(line, folder):
                    continue
                ran += 1
                run = subprocess.run([program, *line], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                     timeout=300, check=False)  # fmt: skip
                if run.returncode != 0:
                    wrong.append(f"{place}: {command}\n    relief {shlex.join(line)}\n    {run.stderr.strip()}")
        self.assert_none(wrong)
        self.assertGreaterEqual(ran, 9)

    def has_inputs(self, line, folder):
        """Whether a merge's parts are there: what other commands than these made is not."""
        parts = line[1:line.index("-o")] if line[0] == "merge" else []
        return all((pathlib.Path(folder) / part).exists() for part in parts)

    def runnable(self, command):
        """Words after the program of a short run that stands for a command; None if its inputs are not there."""
        sub, rest = split_relief(command)
        if not sub:
            return rest if rest in (["--help"], ["--version"]) else None
        given = " ".join(rest)
        if not rest or any(option not in options_of(*sub) for option in OPTION.findall(given)):
            return None
        # Brackets: what may be left out, but not those inside a word.
        given = re.sub(r"(?<!\S)\[[^\]]*\]", "", given)
        line = [w for w in (WORDS.get(word, word) for word in given.split()) if w]
        files = [w for w in line if re.search(r"\.(gltf|glb|obj)$", w)]
        if any(not (ROOT / f).exists() for f in files) or not (files or sub[0] in ("compare", "merge", "bench")):
            return None
        if sub[0] == "compare" and not {"A.exr", "B.exr"} <= set(line):
            return None
        if sub[0] == "render" and "-o" not in line:
            line += ["-o", "out.exr"]
        for option, value in SMALL.get(sub[0], {}).items():
            of_others = option == "--scenes" and ("--mesh" in line or "vector" in line)
            if option not in line and option in options_of(*sub) and not of_others:
                line += [option] if value is None else [option, value]
        return [*sub, *line]

    def test_scripts_and_examples_are_there_and_options_known(self):
        wrong = []
        for place, command in all_commands():
            program, *rest = words(command)
            wrong += [f"{place}: no file {w}" for w in rest if w.startswith("examples/") and not (ROOT / w).exists()]
            if not re.match(r"(scripts|benchmarks)/", program):
                continue
            file = ROOT / program
            if not file.is_file() or not os.access(file, os.X_OK):
                wrong.append(f"{place}: {program} is no file that can be run")
                continue
            text = file.read_text(encoding="utf-8")
            wrong += [f"{place}: {program} does not know {option}"
                      for option in OPTION.findall(" ".join(rest)) if option.startswith("--") and option not in text]
        self.assert_none(wrong)

    def test_benchmarks_and_test_programs_are_there_and_know_their_options(self):
        targets = "\n".join(p.read_text(encoding="utf-8") for f in FOLDERS for p in (ROOT / f).glob("**/CMakeLists.txt"))
        sources = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "benchmarks").glob("*.cpp"))
        wrong = []
        for place, command in all_commands():
            program = words(command)[0].rsplit("/", 1)[-1]
            if not re.match(r"relief_\w+$", program):
                continue
            # relief_add_tests puts relief_ before the name of a test program.
            if program not in targets and program.removeprefix("relief_") not in targets:
                wrong.append(f"{place}: {program} is not built")
            if program.startswith("relief_bench_"):
                wrong += [f"{place}: {program} does not know {option}"
                          for option in OPTION.findall(command) if option.startswith("--") and option not in sources]
        self.assert_none(wrong)

    def test_presets_and_tests_are_there(self):
        presets = json.loads((ROOT / "CMakePresets.json").read_text(encoding="utf-8"))
        known = {kind: {p["name"] for p in presets[kind]} for kind in ("configurePresets", "buildPresets", "testPresets")}
        tests = "\n".join(p.read_text(encoding="utf-8", errors="replace") for p in (ROOT / "tests").glob("**/*")
                          if p.suffix in (".cpp", ".py", ".txt"))
        wrong = []
        for place, command in all_commands():
            program = words(command)[0]
            kind = "testPresets" if program == "ctest" else "buildPresets" if "--build" in command else "configurePresets"
            preset = re.search(r"--preset (\S+)", command)
            if program in ("cmake", "ctest") and preset and preset[1] not in known[kind]:
                wrong.append(f"{place}: no preset {preset[1]}")
            script = re.search(r"--python (\S+)", command)
            if script and not (ROOT / script[1]).exists():
                wrong.append(f"{place}: no file {script[1]}")
            named = re.search(r" -R (\S+)", command)
            if program in ("ctest", "scripts/test") and named and named[1] not in tests:
                wrong.append(f"{place}: no test {named[1]}")
        self.assert_none(wrong)

    def test_files_that_pages_name_are_there(self):
        wrong = []
        for path in PAGES:
            for number, span in spans(path.read_text(encoding="utf-8")):
                named = re.match(rf"(?:{'|'.join(FOLDERS)})/[\w./<>*{{}},+-]*$", span)
                if named is None or span.startswith("scripts/addons/"):
                    continue
                wrong += [f"{path.relative_to(ROOT)}:{number}: {p}" for p in expanded(span) if not is_there(p)]
        self.assert_none(wrong)

    def test_files_named_without_a_folder_are_there(self):
        """docs/architecture.md names every file with its folder, so that the test above sees it."""
        wrong = []
        page = ROOT / "docs" / "architecture.md"
        for number, span in spans(page.read_text(encoding="utf-8")):
            if re.fullmatch(r"[\w{},*]+\.(h|cpp|inc|py)", span):
                wrong.append(f"docs/architecture.md:{number}: {span} without its folder")
        self.assert_none(wrong)

    def test_hubs_are_named(self):
        """docs/architecture.md names the headers that many files include."""
        most = 10
        text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
        users = {}
        for folder in "kernel displacement scene integrator denoise exporters cli".split():
            for path in (ROOT / folder).rglob("*"):
                if path.suffix not in {".h", ".cpp"}:
                    continue
                for name in re.findall(r'^#include "([^"]+)"', path.read_text(encoding="utf-8"), re.MULTILINE):
                    users.setdefault(name, set()).add(path)
        self.assertGreater(len(users), most)
        self.assert_none([f"{name}: included by {len(by)} files" for name, by in sorted(users.items())
                          if len(by) >= most and f"`{name}`" not in text])

    def test_settings_are_documented_as_they_are_declared(self):
        """The table of RELIEF_render has the declared settings in their order, with default and range, and no others."""
        declared_file = ROOT / "blender_addon" / "relief" / "declared.json"
        declared = {s["name"]: s for s in json.loads(declared_file.read_text(encoding="utf-8"))["settings"]}
        text = (ROOT / "docs" / "scene_format.md").read_text(encoding="utf-8")
        section = text.partition("### `RELIEF_render`")[2].partition("\n### ")[0]
        rows = re.findall(r"^\| `([\w.]+)` \| (.*?) ?\| (.*?) ?\| .* \|$", section, re.MULTILINE)
        self.assertEqual(list(declared), [name for name, _, _ in rows])
        for name, default, allowed in rows:
            setting = declared[name]
            # A default may be another setting's.
            other = declared.get(default.strip("`"))
            shown = other["default"] if other else None if default == "–" else json.loads(default.strip("`"))
            self.assertEqual(setting["default"], shown, f"default of {name}")
            self.assertEqual(setting["range"], range_of(allowed), f"range of {name}")

    def test_methods_are_documented_as_they_are_listed(self):
        declared = json.loads((ROOT / "blender_addon" / "relief" / "declared.json").read_text(encoding="utf-8"))
        text = (ROOT / "docs" / "scene_format.md").read_text(encoding="utf-8")
        rows = re.search(r"\| `method` \| meaning \|\n\|[ |-]+\n((?:\|.*\n)+)", text)[1]
        self.assertEqual([method["name"] for method in declared["methods"]], re.findall(r"^\| `([\w-]+)` \|", rows, re.MULTILINE))

    def test_links_lead_somewhere(self):
        wrong = []
        for path in PAGES:
            text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            for target in re.findall(r"\]\(([^)\s]+)\)", text):
                if re.match(r"\w+://", target):
                    continue
                file, _, anchor = target.partition("#")
                to = (path.parent / file).resolve() if file else path
                if not to.exists():
                    wrong.append(f"{path.relative_to(ROOT)}: {target}: no such file")
                elif anchor and to.suffix == ".md" and anchor not in anchors(to):
                    wrong.append(f"{path.relative_to(ROOT)}: {target}: no such heading")
        self.assert_none(wrong)


if __name__ == "__main__":
    unittest.main()
