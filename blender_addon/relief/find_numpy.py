# SPDX-License-Identifier: GPL-3.0-or-later
"""Numpy, where Blender's Python does not find it by itself.

A Blender that a distribution packages takes Python's library from beside the first python3 on the PATH. If that is one of
pyenv's or of a virtual environment, the distribution's numpy is out of its sight, though it is made for this Python.
"""

import glob
import importlib
import site
import sys

from .refusal import refuse

#: What distributions call the folders of Python's packages: Debian the first two, others the rest.
_FOLDERS = (
    "/usr/lib/python3/dist-packages",
    "/usr/local/lib/python{version}/dist-packages",
    "/usr/lib*/python{version}/site-packages",
    "/usr/local/lib*/python{version}/site-packages",
)


def find_numpy(package):
    """Makes numpy importable. Of the folder where it is nothing else becomes so.

    @param  package  whose import fails without it
    @error           ImportError about the package, which Blender prints without a traceback
    """
    folders = [None, *site.getsitepackages(), site.getusersitepackages()]
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    folders += [path for pattern in _FOLDERS for path in sorted(glob.glob(pattern.format(version=version)))]
    found = []
    for folder in folders:
        cause = _import_from(folder)
        if cause is None:
            return
        if not (isinstance(cause, ModuleNotFoundError) and cause.name == "numpy"):
            found.append(f"; the one in {folder or 'its path'} is for another ({str(cause).strip().splitlines()[0]})")
    need = f"relief needs numpy, and this Blender's Python {version} with its library in {sys.prefix} has none{''.join(found)}."
    refuse(package, need, "Install it (on Debian and Ubuntu: apt-get install python3-numpy)")


def _import_from(folder):
    """Imports numpy from a folder, None: from where Python looks. Returns an ImportError if that fails."""
    if folder is not None:
        sys.path.insert(0, folder)
    try:
        # A folder of that name, as uninstalling leaves behind, is a module without a file.
        if importlib.import_module("numpy").__file__ is None:
            raise ModuleNotFoundError("nothing but a folder", name="numpy")
        return None
    except ImportError as error:
        # What has come of it so far would stand in the way of the next one.
        for name in [name for name in sys.modules if name.split(".")[0] == "numpy"]:
            del sys.modules[name]
        return error
    finally:
        if folder is not None:
            sys.path.remove(folder)
