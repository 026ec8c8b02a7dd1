"""scripts/check_layers finds every kind of mistake it is there for, and nothing in a tree without any."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_layers"
HEADER = "#pragma once\n"


class CheckLayers(unittest.TestCase):
    def run_on(self, files):
        """Exit code and output for a tree given as {path: text}."""
        with tempfile.TemporaryDirectory() as folder:
            for path, text in files.items():
                file = pathlib.Path(folder, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, encoding="utf-8")
            run = subprocess.run([sys.executable, SCRIPT, folder], capture_output=True, text=True, check=False)
            return run.returncode, run.stdout

    def assert_wrong(self, files, message):
        code, output = self.run_on(files)
        self.assertEqual(code, 1, output)
        self.assertIn(message, output)

    def test_accepts_what_the_table_allows(self):
        code, output = self.run_on({
            "kernel/a.h": HEADER + "#include <cmath>\n#include <immintrin.h>\n",
            "scene/b.h": HEADER + '#include "kernel/a.h"\n#include <nlohmann/json.hpp>\n',
            "tests/oracle/c.h": HEADER + "#include <vector>\n",
            "tests/scene/d.cpp": '#include "scene/b.h"\n#include "tests/oracle/c.h"\n#include <gtest/gtest.h>\n',
        })
        self.assertEqual(code, 0, output)

    def test_cycle_of_imports(self):
        addon = "blender_addon/relief/"
        files = {"kernel/a.h": HEADER, addon + "a.py": "from .export import b\n",
                 addon + "export/b.py": "def f():\n    from ..a import g\n"}
        self.assert_wrong(files, f"cycle of imports: {addon}a.py -> {addon}export/b.py -> {addon}a.py")

    def test_lower_layer_includes_higher(self):
        self.assert_wrong({"kernel/a.h": HEADER + '#include "scene/b.h"\n', "scene/b.h": HEADER},
                          "kernel/a.h:2: kernel/ may not include scene/")

    def test_library_outside_its_layer(self):
        self.assert_wrong({"scene/a.h": HEADER + "#include <embree3/rtcore.h>\n"}, "may not use embree")

    def test_oracle_shares_no_code(self):
        self.assert_wrong({"tests/oracle/a.h": HEADER + '#include "kernel/b.h"\n', "kernel/b.h": HEADER},
                          "tests/oracle/ may not include kernel/")

    def test_kernel_does_not_use_the_system(self):
        self.assert_wrong({"kernel/a.h": HEADER + "#include <unistd.h>\n"}, "may not use the operating system")

    def test_unknown_library(self):
        self.assert_wrong({"cli/a.cpp": "#include <curl/curl.h>\n"}, "is not known")

    def test_path_not_from_the_root(self):
        self.assert_wrong({"kernel/a.h": HEADER + '#include "b.h"\n', "kernel/b.h": HEADER}, "is no file below the root")

    def test_cycle(self):
        self.assert_wrong({"kernel/a.h": HEADER + '#include "kernel/b.h"\n',
                           "kernel/b.h": HEADER + '#include "kernel/a.h"\n'},
                          "cycle of includes: kernel/a.h -> kernel/b.h -> kernel/a.h")

    def test_missing_pragma_once(self):
        self.assert_wrong({"kernel/a.h": "int x;\n"}, "no #pragma once")

    def test_using_namespace_in_a_header(self):
        self.assert_wrong({"kernel/a.h": HEADER + "using namespace std;\n"}, "`using namespace` in a header")

    def test_empty_tree(self):
        self.assert_wrong({"readme.txt": ""}, "no source files found")


if __name__ == "__main__":
    unittest.main()
