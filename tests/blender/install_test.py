"""The zip: installed, enabled, used, disabled and removed in a profile that nothing has touched."""

import os
import re
import shutil
import subprocess
import sys

import bpy

from scenes import _ROOT, add_camera, add_plane, folder, set_world

_STEPS = """
import addon_utils, bpy, os, sys
sys.path.insert(0, {tests!r})
bpy.ops.preferences.addon_install(filepath={zip!r})
bpy.ops.preferences.addon_enable(module="relief")
print("STEP enabled", "relief" in bpy.context.preferences.addons, addon_utils.check("relief"))
scene = bpy.context.scene
scene.render.engine = "RELIEF"
scene.relief.samples = 4
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.filepath = {picture!r}
bpy.ops.render.render(write_still=True)
print("STEP rendered", os.path.exists({picture!r}))
bpy.ops.preferences.addon_disable(module="relief")
print("STEP disabled", hasattr(bpy.types.Scene, "relief"), scene.render.engine)
bpy.ops.preferences.addon_enable(module="relief")
bpy.ops.render.render()
bpy.ops.preferences.addon_disable(module="relief")
# Blender's operator wants an area to redraw, which a background process has to name.
window = bpy.context.window_manager.windows[0]
with bpy.context.temp_override(window=window, area=window.screen.areas[0]):
    bpy.ops.preferences.addon_remove(module="relief")
left = os.path.exists(os.path.join(bpy.utils.user_resource("SCRIPTS"), "addons", "relief"))
print("STEP removed", left)
"""


def test_install_use_and_remove():
    with folder() as path:
        archive, picture = f"{path}/relief.zip", f"{path}/picture.png"
        subprocess.run([os.path.join(_ROOT, "scripts", "package_addon"), archive], check=True, capture_output=True)
        script = _STEPS.format(tests=os.path.dirname(os.path.abspath(__file__)), zip=archive, picture=picture)
        environment = {k: v for k, v in os.environ.items() if k != "BLENDER_USER_SCRIPTS"}
        environment.update(HOME=path, XDG_CONFIG_HOME=f"{path}/config", BLENDER_USER_CONFIG=f"{path}/config")
        environment["BLENDER_USER_SCRIPTS"] = f"{path}/scripts"
        os.makedirs(f"{path}/scripts/addons")
        command = [bpy.app.binary_path, "-b", "--python-exit-code", "9", "--python-expr", script]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100)
        output = done.stdout + done.stderr
        assert done.returncode == 0, output
        assert "STEP enabled True (True, True)" in output, output
        assert "STEP rendered True" in output, output
        assert "STEP disabled False BLENDER_" in output or "STEP disabled False CYCLES" in output, output
        assert "STEP removed False" in output, output
        assert not re.search("Traceback|Error:|Warning: .*relief", output), output


_EXTENSION_STEPS = """
import bpy, os
module = "bl_ext.user_default.relief"
print("STEP enabled", module in bpy.context.preferences.addons)
scene = bpy.context.scene
scene.render.engine = "RELIEF"
scene.relief.samples = 4
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.filepath = {picture!r}
bpy.ops.render.render(write_still=True)
print("STEP rendered", os.path.exists({picture!r}))
bpy.ops.preferences.addon_disable(module=module)
print("STEP disabled", hasattr(bpy.types.Scene, "relief"))
"""


def test_install_use_and_remove_as_an_extension():
    """The way of 4.2 and later; before, there are no extensions."""
    if bpy.app.version < (4, 2, 0):
        return
    with folder() as path:
        archive, picture = f"{path}/relief.zip", f"{path}/picture.png"
        subprocess.run([os.path.join(_ROOT, "scripts", "package_addon"), archive], check=True, capture_output=True)
        environment = {k: v for k, v in os.environ.items() if k != "BLENDER_USER_SCRIPTS"}
        environment.update(HOME=path, XDG_CONFIG_HOME=f"{path}/config")

        def blender(*arguments):
            command = [bpy.app.binary_path, *arguments]
            done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100)
            output = done.stdout + done.stderr
            assert done.returncode == 0 and not re.search("Traceback|Error:|Warning: .*relief", output), output
            return output

        blender("--command", "extension", "validate", archive)
        blender("--command", "extension", "install-file", "-r", "user_default", "--enable", archive)
        output = blender("-b", "--python-exit-code", "9", "--python-expr", _EXTENSION_STEPS.format(picture=picture))
        for step in ("enabled True", "rendered True", "disabled False"):
            assert f"STEP {step}" in output, output
        blender("--command", "extension", "remove", "relief")
        left = [n for _, folders, _ in os.walk(f"{path}/config") for n in folders if n == "relief"]
        assert not left, left


#: Enables an add-on as Blender does when it starts.
_ENABLE = """
import addon_utils
print("ENABLED", addon_utils.enable("relief") is not None)
"""


def _enabled_beside_another_python(path, script):
    """What Blender prints that enables the add-on where the first Python on the PATH is one as pyenv's: with no packages."""
    os.makedirs(f"{path}/bin")
    os.makedirs(f"{path}/lib")
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    os.symlink(os.path.dirname(os.__file__), f"{path}/lib/python{version}")
    for name in ("python3", f"python{version}"):
        with open(f"{path}/bin/{name}", "w", encoding="utf-8") as file:
            file.write("#!/bin/sh\nexit 1\n")
        os.chmod(f"{path}/bin/{name}", 0o755)
    environment = {**os.environ, "PATH": f"{path}/bin:{os.environ['PATH']}"}
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-expr", script + _ENABLE]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100)
    # Blender 5 misses packages that its own modules import, and says so with tracebacks.
    assert not re.search(r"Traceback.*addons/relief", done.stderr, re.DOTALL), done.stderr
    return done.stdout


def test_a_zip_that_holds_the_program_needs_no_other():
    """One file, installed where there is no relief: an add-on of old, or an extension where there are such."""
    if not shutil.which("patchelf"):
        print("SKIPPED: patchelf is missing")
        return
    with folder() as path:
        tree, archive, picture = f"{path}/tree", f"{path}/relief.zip", f"{path}/picture.png"
        os.makedirs(f"{tree}/lib/relief")
        os.makedirs(f"{tree}/bin")
        program = os.environ["RELIEF_BINARY"]
        shutil.copy(program, f"{tree}/bin/relief")
        beside = [f"{tree}/lib/relief/{name}" for name in ("relief_image_io.so", "relief_voxels")]
        for file in beside:
            shutil.copy(os.path.join(os.path.dirname(program), os.path.basename(file)), file)
        for command in (
            ["bundle_libraries", f"{tree}/lib/relief", f"{tree}/bin/relief", *beside],
            ["package_addon", "--program", tree, archive],
        ):
            subprocess.run([os.path.join(_ROOT, "scripts", command[0]), *command[1:]], check=True, capture_output=True)
        environment = {k: v for k, v in os.environ.items() if k not in ("BLENDER_USER_SCRIPTS", "RELIEF_BINARY")}
        environment.update(HOME=path, XDG_CONFIG_HOME=f"{path}/config", BLENDER_USER_CONFIG=f"{path}/config")
        if bpy.app.version < (4, 2, 0):
            environment["BLENDER_USER_SCRIPTS"] = f"{path}/scripts"
            os.makedirs(f"{path}/scripts/addons")
            steps = _STEPS.format(tests=os.path.dirname(os.path.abspath(__file__)), zip=archive, picture=picture)
            commands = [["-b", "--python-exit-code", "9", "--python-expr", steps]]
        else:
            commands = [
                ["--command", "extension", "install-file", "-r", "user_default", "--enable", archive],
                ["-b", "--python-exit-code", "9", "--python-expr", _EXTENSION_STEPS.format(picture=picture)],
            ]
        for command in commands:
            done = subprocess.run([bpy.app.binary_path, *command], capture_output=True, text=True, env=environment, timeout=100)
            output = done.stdout + done.stderr
            assert done.returncode == 0 and not re.search("Traceback|Error:|Warning: .*relief", output), output
        assert "STEP rendered True" in output and os.path.exists(picture), output


def test_numpy_is_found_beside_another_python():
    with folder() as path:
        output = _enabled_beside_another_python(path, "")
        assert "ENABLED True" in output, output


#: Python code that takes numpy away.
_WITHOUT_NUMPY = """
import sys
for name in [name for name in sys.modules if name.split(".")[0] == "numpy"]:
    del sys.modules[name]
class NoNumpy:
    def find_spec(self, name, *_):
        if name.split(".")[0] == "numpy":
            raise ModuleNotFoundError("No module named 'numpy'", name="numpy")
sys.meta_path.insert(0, NoNumpy())
"""


def test_missing_numpy_is_one_message():
    with folder() as path:
        output = _enabled_beside_another_python(path, _WITHOUT_NUMPY)
        assert "ENABLED False" in output, output
        assert output.count("relief needs numpy") == 1 and "python3-numpy" in output, output


_SECOND_STEPS = """
import addon_utils
print("FIRST", addon_utils.enable("relief") is not None)
print("SECOND", addon_utils.enable("relief_copy") is not None)
addon_utils.disable("relief")
print("ALONE", addon_utils.enable("relief_copy") is not None)
print("BACK", addon_utils.enable("relief") is not None)
"""


def test_a_second_one_is_refused():
    """Two would take each other's classes away: an extension beside an add-on from before, or two folders."""
    with folder() as path:
        os.makedirs(f"{path}/addons")
        for name in ("relief", "relief_copy"):
            os.symlink(os.path.join(_ROOT, "blender_addon", "relief"), f"{path}/addons/{name}")
        command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-expr", _SECOND_STEPS]
        environment = {**os.environ, "BLENDER_USER_SCRIPTS": path}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100)
        output = done.stdout
        for step in ("FIRST True", "SECOND False", "ALONE True", "BACK False"):
            assert f"{step}\n" in output, output + done.stderr
        assert "has been registered before" not in output, output
        # When the first comes back Blender has imported it already, and shows a traceback.
        for name, said in (("relief", output), ("relief_copy", done.stderr)):
            assert said.count(f"Another add-on of relief is enabled, {name}. Disable or remove it before enabling") == 1, output + done.stderr


def test_versions_agree():
    """bl_info, the manifest and the program's own version are one."""
    import relief
    from relief.process import VERSION

    with open(os.path.join(_ROOT, "blender_addon", "relief", "blender_manifest.toml"), encoding="utf-8") as file:
        manifest = re.search(r'^version = "([^"]+)"', file.read(), re.MULTILINE)[1]
    with open(os.path.join(_ROOT, "CMakeLists.txt"), encoding="utf-8") as file:
        project = re.search(r"VERSION (\d+\.\d+\.\d+)", file.read())[1]
    assert manifest == project == ".".join(str(n) for n in relief.bl_info["version"])
    assert relief.bl_info["version"][:2] == VERSION


def test_equal_sources_give_equal_zips():
    with folder() as path:
        for name in ("a.zip", "b.zip"):
            subprocess.run([os.path.join(_ROOT, "scripts", "package_addon"), f"{path}/{name}"], check=True)
        with open(f"{path}/a.zip", "rb") as a, open(f"{path}/b.zip", "rb") as b:
            assert a.read() == b.read()


def test_every_setting_says_unit_and_default():
    """Tooltips of scene.relief."""
    scene = bpy.context.scene
    for name, setting in scene.relief.bl_rna.properties.items():
        if name not in {"rna_type", "name"}:
            assert "default" in setting.description, name
    for name in (
        "samples seed time_limit noise_threshold max_bounces diffuse_bounces glossy_bounces transmission_bounces volume_bounces "
        "displacement_method displacement_error lod memory_limit caustics"
    ).split():
        assert hasattr(scene.relief, name), name


def test_panels_are_registered_and_taken_away():
    before = {p.__name__ for p in bpy.types.Panel.__subclasses__() if "RELIEF" in getattr(p, "COMPAT_ENGINES", ())}
    assert {"RELIEF_PT_sampling", "RELIEF_PT_displacement", "DATA_PT_lens"} <= before, before
    bpy.ops.preferences.addon_disable(module="relief")
    after = {
        p.__name__
        for p in bpy.types.Panel.__subclasses__()
        if "RELIEF" in getattr(p, "COMPAT_ENGINES", ()) and p.is_registered
    }
    assert not after, after


def test_the_documented_commands_run_without_complaint():
    """The command lines of docs/blender.md, in their order and word for word but for where the programs are."""
    with open(os.path.join(_ROOT, "docs", "blender.md"), encoding="utf-8") as file:
        commands = re.findall(r"^    (\S.*)$", file.read(), re.MULTILINE)
    scene = bpy.context.scene
    scene.render.engine, scene.relief.samples = "RELIEF", 1
    set_world((0.5, 0.5, 0.5))
    add_plane()
    add_camera()
    with folder() as path:
        os.makedirs(f"{path}/scripts/addons")
        os.symlink(os.path.join(_ROOT, "blender_addon", "relief"), f"{path}/scripts/addons/relief")
        bpy.ops.wm.save_as_mainfile(filepath=f"{path}/scene.blend")
        bpy.ops.export_scene.relief(filepath=f"{path}/shot.gltf", use_range=True, frame_start=1, frame_end=48)
        program = os.environ["RELIEF_BINARY"]
        places = (
            # It would build the program: tests/scripts/package_test.py has it.
            (r"^scripts/package addon", f"test -x {_ROOT}/scripts/package"),
            (r"^scripts/package_addon", f"{_ROOT}/scripts/package_addon {path}/relief.zip"),
            (r"build/release/cli/relief", program),
            (r"\bblender -b", f"{bpy.app.binary_path} --factory-startup -b"),
            (r"^relief ", f"{program} "),
        )
        for command in commands:
            for documented, here in places:
                command = re.sub(documented, here, command)
            done = subprocess.run(command, shell=True, cwd=path, capture_output=True, text=True, timeout=100)
            output = done.stdout + done.stderr
            assert done.returncode == 0, (command, output)
            assert not re.search("(?i)not available|not found|warning:|error:|traceback", output), (command, output)
        made = {"relief.zip", "out0001.exr", "shot.0001.exr", "shot.0048.exr"}
        assert len(commands) == 4 and made <= set(os.listdir(path)), (commands, os.listdir(path))
