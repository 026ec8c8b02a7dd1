# SPDX-License-Identifier: GPL-3.0-or-later
"""What was not understood, and what was used instead: collected during an export, then shown by whoever ran it."""

import contextlib
import re
from dataclasses import dataclass


class ReliefError(Exception):
    """A failure that is told to the artist; its text says what, where, and what to do."""


class StrictError(ReliefError):
    """A warning, where the scene's settings ask for warnings to be errors."""


class Warned(str):
    """Text of a warning.

    where  kind and name of what it is about
    cause  what is not understood, and what was used instead
    """

    def __new__(cls, where, cause):
        text = super().__new__(cls, f"{where}: {cause}")
        text.where, text.cause = where, cause
        return text


class Report:
    """Warnings of one export, each once and in the order they came up.

    @param  strict  make each warning an error
    coverage  export.coverage.Coverage by names of materials
    """

    def __init__(self, strict=False):
        self._texts = {}
        self._strict = strict
        self.coverage = {}

    @property
    def warnings(self):
        """A list of Warned."""
        return list(self._texts)

    def warn(self, where, what, instead=""):
        """Notes a warning.

        @param  where    kind and name of what it is about, such as 'material "Wood"'
        @param  what     what is not understood
        @param  instead  what was used in its place
        @error           StrictError in strict mode
        """
        text = Warned(where, what + (f"; {instead}" if instead else ""))
        if self._strict:
            raise StrictError(f"{text} (an error because warnings are: Render > Performance > Strict)")
        self._texts.setdefault(text)

    def count(self, material, coverage):
        """Notes how much of a material's nodes is understood."""
        self.coverage[material] = coverage


@dataclass(frozen=True)
class Group:
    """Warnings of one cause.

    label     the cause; names and numbers that differ are left out of it
    warnings  list of Warned, at least one
    """

    label: str
    warnings: list

    def text(self, most=None):
        """All of them in full.

        @param  most  that are named; None: no limit
        """
        is_common = all(w.cause == self.label for w in self.warnings)
        lines = [w.where if is_common else w for w in self.warnings[:most]]
        if len(lines) < len(self.warnings):
            lines.append(f"and {len(self.warnings) - len(lines)} more")
        return self.label + "".join(f"\n    {line}" for line in lines)


def group(warnings):
    """Groups of warnings, those of many first."""
    by_pattern = {}
    for warning in warnings:
        pattern = re.sub(r'"[^"]*"', '"…"', warning.cause)
        by_pattern.setdefault(re.sub(r"\d[\d.,e+]*", "…", pattern), []).append(warning)
    groups = [
        Group(members[0].cause if len({w.cause for w in members}) == 1 else pattern, members)
        for pattern, members in by_pattern.items()
    ]
    return sorted(groups, key=lambda g: -len(g.warnings))


#: Warnings of the scene's last render, or its viewport's, by the scene's name: what the panel shows.
last_warnings = {}

#: Report.coverage of the same, or of the last check of all materials, by the scene's name.
last_coverage = {}


def total(coverage):
    """What is understood of all materials, in words.

    @param  coverage  as Report.coverage
    """
    understood = sum(c.num_understood for c in coverage.values())
    nodes = sum(c.num_nodes for c in coverage.values())
    whole = sum(not c.not_understood for c in coverage.values())
    return f"{understood} of {nodes} nodes understood, {whole} of {len(coverage)} materials whole"


def say(text):
    """Prints a line on the console. A render does not fail because nobody listens any more."""
    with contextlib.suppress(OSError):
        print(f"relief: {text}", flush=True)


def publish(scene_name, warnings, known=()):
    """Shows warnings in the panel, and on the console.

    @param  warnings  list of Warned: all there are
    @param  known     those that are on the console already
    """
    last_warnings[scene_name] = warnings
    for text in warnings:
        if text not in known:
            say(f"warning: {text}")
