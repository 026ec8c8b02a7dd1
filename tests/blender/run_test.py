"""Runs tests inside Blender, one after the other: blender … --python run_test.py -- MODULE [FUNCTION …]

A test is a function test_… of a module in this folder that raises when its claim is not true. Without functions those of the
module run whose names do not end in _long. Each starts in an empty scene. Says of each how it went; ends Blender with 0 if
all claims are true, with 1 otherwise.
"""

import importlib
import os
import shutil
import sys
import time
import traceback

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import scenes  # noqa: E402


def passes(module, name):
    """Whether a test's claim is true."""
    print(f"[ RUN    ] {name}", flush=True)
    begin = time.perf_counter()
    try:
        # With the add-on; those that want another size make another.
        scenes.new_scene()
        getattr(module, name)()
    except BaseException:  # Blender itself would end with 0
        traceback.print_exc()
        print(f"[ FAILED ] {name}", flush=True)
        return False
    print(f"[ OK     ] {name} ({time.perf_counter() - begin:.1f} s)", flush=True)
    return True


try:
    module_name, *names = sys.argv[sys.argv.index("--") + 1 :]
    module = importlib.import_module(module_name)
    if not names:
        names = [name for name in vars(module) if name.startswith("test_") and not name.endswith("_long")]
    failed = [name for name in names if not passes(module, name)]
    if failed:
        print(f"{len(failed)} of {len(names)} failed: {', '.join(failed)}", flush=True)
    code = 1 if failed or not names else 0
except BaseException:
    traceback.print_exc()
    code = 1
sys.stdout.flush()
sys.stderr.flush()
# Without Blender's own end: what it frees then is no part of the test, and its exit code would not be ours.
shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
os._exit(code)
