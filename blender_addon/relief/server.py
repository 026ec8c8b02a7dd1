# SPDX-License-Identifier: GPL-3.0-or-later
"""`relief serve`: one program for many pictures, which keeps what does not change from one to the next."""

from .process import Process
from .report import ReliefError


class ServerEnded(ReliefError):
    """The program has ended by itself in the middle of a request, which may be asked for again."""


class Server:
    """The program, started when it is first asked for something, and anew if it has ended or is another one by now."""

    def __init__(self):
        self._process = None
        self._binary = None
        self._number = 0

    def ask(self, binary, words):
        """Asks for a picture in place of any other.

        @param  binary  path of the program
        @param  words   of a command line, after `relief render`
        @return         Request
        @error          ReliefError if the program cannot be started
        """
        if self._process is None or self._binary != binary or self._process.wait(0) is not None:
            self.stop()
            self._process, self._binary = Process([binary, "serve"], takes_input=True), binary
        self._number += 1
        self._process.say({"id": self._number, "render": words})
        return Request(self._process, self._number)

    def stop(self):
        """Ends the program at once."""
        if self._process is not None:
            self._process.kill()
            self._process = None


class Request:
    """A picture that the program is asked for.

    warnings  texts of the program's, so far
    """

    def __init__(self, process, number):
        self._process = process
        self._number = number
        self._code = None
        self.warnings = []
        self._error = ""

    def events(self, seconds=0.0):
        """Progress objects that have arrived since the last call; waits for the program's next word at most so long.

        @error  ServerEnded
        """
        code = self._process.wait(0)  # before its last words are read
        out = []
        for event in self._process.events(seconds):
            if event.get("id") != self._number:
                continue
            kind = event.get("event")
            if kind == "warning":
                self.warnings.append(event["text"])
            elif kind == "end":
                self._code = event["exit_code"]
                self._process.forget_messages()
                self._error = " ".join(event[key] for key in ("error", "hint") if key in event)
            else:
                out.append(event)
        if self._code is None and code is not None:
            raise ServerEnded(self._process.failure(code))
        return out

    @property
    def code(self):
        """Exit code as of `relief render`, 130 if it was cancelled; None until events() has met its end."""
        return self._code

    def failure(self):
        """Text for a code that is not success: the program's own words."""
        return f"relief ended with code {self._code}" + (f": {self._error}" if self._error else "")

    def cancel(self):
        """Asks the program to save what it has and leave it."""
        self._process.say({"cancel": self._number})
