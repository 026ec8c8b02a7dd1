# SPDX-License-Identifier: GPL-3.0-or-later
"""What was not understood, and what was used instead: collected during an export, then shown by whoever ran it."""


class ReliefError(Exception):
    """A failure that is told to the artist; its text says what, where, and what to do."""


class StrictError(ReliefError):
    """A warning, where the scene's settings ask for warnings to be errors."""


class Report:
    """Warnings of one export, each once and in the order they came up.

    @param  strict  make each warning an error
    """

    def __init__(self, strict=False):
        self.warnings = []
        self._strict = strict

    def warn(self, where, what, instead=""):
        """Notes a warning.

        @param  where    kind and name of what it is about, such as 'material "Wood"'
        @param  what     what is not understood
        @param  instead  what was used in its place
        @error           StrictError in strict mode
        """
        text = f"{where}: {what}" + (f"; {instead}" if instead else "")
        if self._strict:
            raise StrictError(f"{text} (an error because warnings are: Render > Performance > Strict)")
        if text not in self.warnings:
            self.warnings.append(text)


#: Warnings of the scene's last render, by the scene's name: what the panel shows.
last_warnings = {}


def publish(scene_name, warnings):
    """Shows warnings in the panel and on the console."""
    last_warnings[scene_name] = list(warnings)
    for text in warnings:
        print(f"relief: warning: {text}", flush=True)


def publish_more(scene_name, warnings):
    """Publishes those of some warnings that are new."""
    known = last_warnings.get(scene_name, [])
    new = [w for w in warnings if w not in known]
    publish(scene_name, new)
    last_warnings[scene_name] = known + new
