# SPDX-License-Identifier: GPL-3.0-or-later
"""The `relief` program: finding it, starting it, listening to it, ending it."""

import json
import os
import platform
import queue
import shutil
import subprocess
import threading

from .report import ReliefError

#: What the add-on speaks: programs of this major and minor version.
VERSION = (0, 1)

#: How long a program that was asked to end may take before it is killed.
_PATIENCE_SECONDS = 5.0

#: How the program begins lines that are warnings.
_WARNING = "relief: warning: "

_checked_binaries = {}


#: Where an add-on that holds the program has it, and for which machines that is.
_OWN_PROGRAM = os.path.join(os.path.dirname(os.path.abspath(__file__)), "program", "bin", "relief")
_OWN_PLATFORM = ("Linux", "x86_64")


def _own_program():
    """Path of the program that came with the add-on, ready to be run; None: it came without.

    @error  ReliefError if it is not for this machine, or cannot be made executable
    """
    if not os.path.isfile(_OWN_PROGRAM):
        return None
    if (platform.system(), platform.machine()) != _OWN_PLATFORM:
        raise ReliefError(
            f"this add-on holds a relief program for {' on '.join(_OWN_PLATFORM)}, and this is {platform.system()} on {platform.machine()}: "
            "build relief here and set its path in Edit > Preferences > Add-ons > relief"
        )
    if not os.access(_OWN_PROGRAM, os.X_OK):
        # Blender does not keep the permissions of what it unpacks.
        try:
            os.chmod(_OWN_PROGRAM, 0o755)
        except OSError as cause:
            raise ReliefError(f"{_OWN_PROGRAM} cannot be made executable: {cause.strerror}") from cause
    return _OWN_PROGRAM


def find_binary(preference):
    """Path of the program: the preference, then $RELIEF_BINARY, then the one that came with the add-on, then the PATH.

    @error  ReliefError that names the places looked at
    """
    for origin, path in (("the add-on's preferences", preference), ("$RELIEF_BINARY", os.environ.get("RELIEF_BINARY"))):
        if path:
            if not (os.path.isfile(path) and os.access(path, os.X_OK)):
                raise ReliefError(f"{origin} name {path!r} as the relief program, which is not an executable file")
            return path
    found = _own_program() or shutil.which("relief")
    if not found:
        raise ReliefError(
            "the relief program was not found. Set its path in Edit > Preferences > Add-ons > relief, "
            "or in $RELIEF_BINARY, or put it on the PATH"
        )
    return found


def check_version(binary):
    """Makes sure that the program is one that this add-on can talk to.

    @return  its version, such as '0.1.0'
    @error   ReliefError with both versions, or with why it does not run: a library that is missing, another machine's program
    """
    stamp = (binary, os.stat(binary).st_mtime_ns)
    if stamp not in _checked_binaries:
        try:
            run = subprocess.run([binary, "--version"], capture_output=True, text=True, timeout=20)
        except (OSError, subprocess.TimeoutExpired) as cause:
            raise ReliefError(f"{binary} cannot be run: {getattr(cause, 'strerror', None) or cause}") from cause
        if run.returncode != 0:
            ended = f"ended by signal {-run.returncode}" if run.returncode < 0 else f"ended with code {run.returncode}"
            # On a Linux that is older than the one it was made on each library says what it misses, one after the other.
            reason = run.stderr.strip().partition("\n")[0]
            raise ReliefError(f"{binary} cannot be run: " + (" ".join(reason.split()) or ended))
        words = run.stdout.partition("\n")[0].split()
        numbers = words[1].split(".") if len(words) == 2 and words[0] == "relief" else []
        if len(numbers) < 2 or not all(n.isdigit() for n in numbers[:2]):
            raise ReliefError(f"{binary} is not the relief program: `--version` says {run.stdout.strip()!r}")
        if tuple(int(n) for n in numbers[:2]) != VERSION:
            wanted = ".".join(str(n) for n in VERSION)
            raise ReliefError(f"{binary} is relief {words[1]}; this add-on needs {wanted}.x")
        _checked_binaries[stamp] = words[1]
    return _checked_binaries[stamp]


class Process:
    """One running program. Use as a context manager: leaving the block ends it, whatever happened.

    @param  arguments    command line, the program first
    @param  takes_input  there is something to say to it
    """

    def __init__(self, arguments, takes_input=False):
        self._events = queue.SimpleQueue()
        self._messages = []
        try:
            # A session of its own: Ctrl-C in Blender's terminal reaches Blender alone, which then ends the program.
            self._popen = subprocess.Popen(
                arguments,
                stdin=subprocess.PIPE if takes_input else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,
            )
        except OSError as cause:
            raise ReliefError(f"{arguments[0]} cannot be started: {cause}") from cause
        # Pipes that nobody empties would stop the program, and reading them here would stop Blender.
        self._readers = [
            threading.Thread(target=self._read_events, daemon=True),
            threading.Thread(target=self._read_messages, daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def _read_events(self):
        for line in self._popen.stdout:
            try:
                self._events.put(json.loads(line))
            except ValueError:
                self._messages.append(line.rstrip())

    def _read_messages(self):
        for line in self._popen.stderr:
            self._messages.append(line.rstrip())

    def say(self, value):
        """Sends a value as a line of JSON. One that has ended does not hear it."""
        try:
            self._popen.stdin.write(json.dumps(value) + "\n")
            self._popen.stdin.flush()
        except OSError:
            pass

    def events(self, seconds=0.0):
        """Progress objects that have arrived since the last call; waits for the first at most so long."""
        out = []
        if seconds > 0:
            try:
                out.append(self._events.get(timeout=seconds))
            except queue.Empty:
                pass
        while not self._events.empty():
            out.append(self._events.get())
        return out

    def wait(self, seconds):
        """Waits for the program to end, at most so long.

        @return  its exit code; negative: the signal that ended it; None: still running
        """
        try:
            code = self._popen.wait(seconds)
        except subprocess.TimeoutExpired:
            return None
        for reader in self._readers:
            reader.join(_PATIENCE_SECONDS)
        return code

    def interrupt(self):
        """Asks the program to save what it has and end."""
        if self._popen.poll() is None:
            self._popen.terminate()

    def end(self):
        """Makes sure that the program has ended: asks, waits, kills. Returns its exit code."""
        self.interrupt()
        code = self.wait(_PATIENCE_SECONDS)
        if code is None:
            self._popen.kill()
            code = self.wait(None)
        return code

    def kill(self):
        """Ends the program at once, where what it has rendered does not matter."""
        if self._popen.poll() is None:
            self._popen.kill()
        self.wait(None)

    def warnings(self):
        """Texts of the program's warnings so far."""
        return [m.removeprefix(_WARNING) for m in self._messages if m.startswith(_WARNING)]

    def forget_messages(self):
        """Forgets what the program has said so far: what failure() tells begins here."""
        self._messages.clear()

    def failure(self, code):
        """Text for an exit code that is not success: the program's own words, or what ended it."""
        errors = [m for m in self._messages if not m.startswith(_WARNING)]
        said = " ".join(m.strip().removeprefix("relief: ") for m in errors)
        cause = f"ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return f"relief {cause}" + (f": {said}" if said else "")
