"""scripts/check_isa tells mergeable definitions from those that stay in their object file.

The compiler is taken from the environment variable CXX (c++ if it is not set).
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_isa"


class CheckIsa(unittest.TestCase):
    def run_on(self, source):
        """Exit code and output for the object file made from `source`."""
        with tempfile.TemporaryDirectory() as folder:
            object_file = pathlib.Path(folder, "object.o")
            compiler = os.environ.get("CXX", "c++")
            subprocess.run([compiler, "-std=c++20", "-O2", "-fPIE", "-x", "c++", "-c", "-o", object_file, "-"],
                           input=source, text=True, check=True)
            run = subprocess.run([sys.executable, SCRIPT, object_file], capture_output=True, text=True, check=False)
            return run.returncode, run.stdout

    def assert_wrong(self, source, name):
        code, output = self.run_on(source)
        self.assertEqual(code, 1, output)
        self.assertIn(name, output)

    def assert_right(self, source):
        code, output = self.run_on(source)
        self.assertEqual(code, 0, output)

    def test_internal_functions_and_entry_points_are_right(self):
        self.assert_right("static inline int f(int i) { return i; } int entry(int i) { return f(i); }")

    def test_read_only_table_is_right(self):
        self.assert_right("inline constexpr int kTable[] = {1, 2}; const int* entry() { return kTable; }")

    def test_inline_function_that_was_inlined_everywhere_is_right(self):
        self.assert_right("inline int f(int i) { return i + 1; } int entry(int i) { return f(i); }")

    def test_inline_function_with_a_body_of_its_own(self):
        self.assert_wrong("[[gnu::noinline]] inline int helper(int i) { return i; } int entry(int i) { return helper(i); }",
                          "helper(int)")

    def test_template_with_a_body_of_its_own(self):
        self.assert_wrong("template <class T> [[gnu::noinline]] T twice(T t) { return t + t; }"
                          "int entry(int i) { return twice(i); }", "twice<int>")

    def test_virtual_function(self):
        self.assert_wrong("struct Base { virtual int f() { return 1; } }; Base* entry() { return new Base; }",
                          "Base::f()")

    def test_table_of_internal_functions(self):
        self.assert_wrong("static int f() { return 1; } static int g() { return 2; }"
                          "inline int (*const kCalls[])() = {f, g}; int entry(int i) { return kCalls[i](); }", "kCalls")


if __name__ == "__main__":
    unittest.main()
