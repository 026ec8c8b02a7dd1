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

    def test_members_of_others_are_no_mention(self):
        for text in ("x.name", "x->name", "Type::name", "std::name"):
            self.assertTrue(self.are_together(UNNAMED % "int name = 1;", f"int f() {{ return {text}; }}\n"), text)
        for text in ("space::name", "f(x...name)", "name.x"):
            self.assertFalse(self.are_together(UNNAMED % "int name = 1;", f"int f() {{ return {text}; }}\n"), text)

    def test_what_using_declares_is_a_files_own_unless_the_other_declares_it_alike(self):
        for own in ("using space::name;", "using name = int;", "namespace name = space::other;", "using namespace name;"):
            for text in (own, UNNAMED % own):
                self.assertTrue(self.are_together(text, own + "\n"), own)
                self.assertFalse(self.are_together(text, "namespace relief {\nint f() { return name; }\n}\n"), own)
        self.assertFalse(self.are_together("using space::name;", "using other::name;"))
        self.assertFalse(self.are_together("using space::name;", UNNAMED % "int name = 1;"))
        self.assertTrue(self.are_together("using space::name;", "int f() { return space::name; }\n"))
        self.assertTrue(self.are_together("using namespace std::string_view_literals;", "namespace relief {\n}\n"))

    def test_tests_are_together_unless_they_have_one_name(self):
        test = "namespace relief {\nnamespace {\nTEST_F(%s)\n{\n}\nINSTANTIATE_TEST_SUITE_P(All, %s);\n}  // namespace\n}\n"
        self.assertTrue(self.are_together(test % ("Suite, First", "One"), test % ("Suite, Second", "Two")))
        self.assertFalse(self.are_together(test % ("Suite, First", "One"), test % ("Suite, First", "Two")))
        self.assertFalse(self.are_together(UNNAMED % "struct Suite {\n};", test % ("Suite, First", "One")))

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
        for folder, most in (("cli", 9), ("integrator", 10), ("exporters", 7), ("tests/integrator", 12), ("tests/displacement", 10)):
            files = sorted(str(path) for path in (ROOT / folder).glob("*.cpp"))
            found = groups(12, *files)
            self.assertEqual(sorted(file for group in found for file in group), files)
            self.assertLessEqual(max(map(len, found)), 12)
            self.assertLess(len(found), most, folder)


if __name__ == "__main__":
    unittest.main()
