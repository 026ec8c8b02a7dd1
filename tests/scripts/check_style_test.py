"""scripts/check_style finds every kind of mistake it is there for, and nothing in a tree without any."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
GOOD = "int square(int x) { return x * x; }\n"


class CheckStyle(unittest.TestCase):
    def run_on(self, *commits):
        """Exit code and output for a tree that came about by commits, each given as {path: text}."""
        with tempfile.TemporaryDirectory() as folder:
            def git(*arguments):
                subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b.invalid", "-c", "commit.gpgsign=false", "-C", folder, *arguments],
                               capture_output=True, check=True)

            git("init")
            pathlib.Path(folder, ".clang-format").write_bytes((ROOT / ".clang-format").read_bytes())
            for files in commits:
                for path, text in files.items():
                    file = pathlib.Path(folder, path)
                    file.parent.mkdir(parents=True, exist_ok=True)
                    file.write_text(text, encoding="utf-8", newline="")
                git("add", "--all")
                git("commit", "--allow-empty", "-m", "a")
            command = [sys.executable, ROOT / "scripts" / "check_style", "--root", folder]
            run = subprocess.run(command, capture_output=True, text=True, check=False)
            return run.returncode, run.stdout + run.stderr

    def assert_wrong(self, files, message):
        code, output = self.run_on({}, files)
        self.assertEqual(code, 1, output)
        self.assertIn(message, output)

    def test_tests_that_are_not_built(self):
        self.assert_wrong({"tests/a_test.cpp": GOOD, "tests/CMakeLists.txt": "x(SOURCES b_a_test.cpp)\n"}, "tests/a_test.cpp:1: test that is not built")
        self.assert_wrong({"tests/a_test.cpp": GOOD}, "tests/a_test.cpp:1: test that is not built")
        code, output = self.run_on({}, {"tests/a_test.cpp": GOOD, "tests/CMakeLists.txt": "x(SOURCES a_test.cpp)\n"})
        self.assertEqual(code, 0, output)

    def test_a_tree_without_faults(self):
        text = ("struct Named {\n  int member = 0;\n};\nconstexpr int kMost = 3;\nstruct stat;\n#define X(name) int name;\n"
                "X(a)\n#undef X\n")
        code, output = self.run_on({}, {"scene/a.h": text.replace("struct stat;\n", ""), "a.py": "x = 1\n", "CMakeLists.txt": "\n"})
        self.assertEqual(code, 0, output)

    def test_each_rule(self):
        for files, message in (
            ({"scene/NotSnake.cpp": GOOD}, "scene/NotSnake.cpp:1: names of files"),
            ({"a.cpp": "\n" + GOOD + "// TO" "DO: cubes\n"}, "a.cpp:3: what is left to do"),
            ({"a.py": "if True:\n\tpass\n"}, "a.py:2: tab"),
            ({"a.py": "x = 1 \n"}, "a.py:1: blank at the end"),
            ({"a.py": "x = 1\r\n"}, "a.py:1: blank at the end"),
            ({"a.cpp": GOOD + "#if 0\n#endif\n"}, "a.cpp:2: code that is switched off"),
            ({"a.cpp": "TEST(Square, DISA" "BLED_IsPositive) {}\n"}, "a.cpp:1: test that is switched off"),
            ({"a.h": "struct square {\n  int side;\n};\n"}, "a.h:1: types are PascalCase"),
            ({"a.h": "enum class side : int { kLeft };\n"}, "a.h:1: types are PascalCase"),
            ({"a.cpp": "constexpr double most_ever = 3;\n"}, "a.cpp:1: constants are kPascal"),
            ({"a.h": "#define SQUARE(x) ((x) * (x))\n"}, "a.h:1: macros begin with RELIEF_"),
            ({"a.cpp": "// " + 200 * "x" + "\n"}, "a.cpp:1: 203 characters"),
            ({"a.py": "x = 1"}, "a.py:1: no end of the last line"),
        ):
            with self.subTest(message):
                self.assert_wrong(files, message)

    def test_format_of_changed_lines_alone(self):
        old = "int cube( int x ) { return x*x*x; }\n" + 5 * "\n" + GOOD
        code, output = self.run_on({"a.cpp": old}, {"a.cpp": old + "\nint half(int x) { return x / 2; }\n"})
        self.assertEqual(code, 0, output)
        self.assert_wrong({"a.cpp": "int half( int x ) { return x/2; }\n"}, "+int half(int x) { return x / 2; }")

    def test_the_first_commit(self):
        code, output = self.run_on({"a.cpp": GOOD})
        self.assertEqual(code, 0, output)
        self.assertIn("is not checked", output)


if __name__ == "__main__":
    unittest.main()
