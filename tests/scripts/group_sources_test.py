"""scripts/group_sources puts files together that do not see each other's own names, and no others."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
UNNAMED = "namespace relief {\nnamespace {\nint first()\n{\n}\n%s\n}  // namespace\n}\n"


def groups(size, *files):
    run = subprocess.run([sys.executable, ROOT / "scripts" / "group_sources", str(size), *files], capture_output=True, text=True, check=True)
    return [line.split(";") for line in run.stdout.split()]


class GroupSources(unittest.TestCase):
    def are_together(self, first, second):
        with tempfile.TemporaryDirectory() as folder:
            paths = [pathlib.Path(folder, name) for name in ("a.cpp", "b.cpp")]
            for path, text in zip(paths, (first, second)):
                path.write_text(text, encoding="utf-8")
            return len(groups(2, *paths)) == 1

    def test_what_is_a_files_own_is_not_seen_by_others(self):
        for own in ("int name = 1;", "constexpr int name[2] = {1, 2};", "float name(float x)\n{\n  return x;\n}",
                    "std::vector<float>\nname(float x);", "struct name {\n};",
                    "using name = int;", "template <class T>\nT name(T x) { return x; }", "enum class name : int { a };",
                    "const std::map<int, std::string>& name();", "class name : public Base {\n};", "std::atomic<int> name{0};"):
            self.assertFalse(self.are_together(UNNAMED % own, "int f() { return name; }\n"), own)
            self.assertFalse(self.are_together("int f() { return name; }\n", UNNAMED % own), own)
            self.assertTrue(self.are_together(UNNAMED % own, "int f() { return names; }  // name\nconst char* t = \"name\";\n"), own)

    def test_static_functions_and_macros_are_a_files_own(self):
        for own in ("static int name(int x)\n{\n  return x;\n}\n", "#define name 1\n"):
            self.assertFalse(self.are_together(own, "int f() { return name; }\n"), own)

    def test_what_a_header_declares_is_another_than_a_files_own(self):
        included = '#include "displacement/stretch.h"\n'
        self.assertFalse(self.are_together(UNNAMED % "struct Stretch {\n};", included))
        self.assertTrue(self.are_together(included + UNNAMED % "struct Stretch {\n};", included), "as it stands alone")
        self.assertTrue(self.are_together(UNNAMED % "struct Stretched {\n};", included))

    def test_what_all_see_keeps_none_apart(self):
        self.assertTrue(self.are_together("namespace relief {\nint name() { return 1; }\n}\n", "int f() { return name; }\n"))

    def test_sources_of_the_tree_are_each_in_one_group(self):
        for folder, most in (("cli", 14), ("integrator", 14), ("exporters", 10)):
            files = sorted(str(path) for path in (ROOT / folder).glob("*.cpp"))
            found = groups(12, *files)
            self.assertEqual(sorted(file for group in found for file in group), files)
            self.assertLessEqual(max(map(len, found)), 12)
            self.assertLess(len(found), most, folder)


if __name__ == "__main__":
    unittest.main()
