"""Runs one test inside Blender: blender … --python run_test.py -- MODULE FUNCTION

A test is a function of a module in this folder that raises when its claim is not true. Ends Blender with 0 if it does
not, with 1 if it does.
"""

import importlib
import os
import shutil
import sys
import traceback

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import scenes  # noqa: E402

module_name, function_name = sys.argv[sys.argv.index("--") + 1 :][:2]
try:
    # Tests start in an empty scene with the add-on; those that want another size make another.
    scenes.new_scene()
    getattr(importlib.import_module(module_name), function_name)()
    code = 0
except BaseException:  # Blender itself would end with 0
    traceback.print_exc()
    code = 1
sys.stdout.flush()
sys.stderr.flush()
# Without Blender's own end: what it frees then is no part of the test, and its exit code would not be ours.
shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
os._exit(code)
