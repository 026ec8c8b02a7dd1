# SPDX-License-Identifier: GPL-3.0-or-later
"""What readers of node graphs raise for a node that the scene format cannot say; who asked for it uses something else and tells."""


class NotUnderstood(Exception):
    """A node that graphs do not know; its text names it.

    key  of the node, as nodes.Source has it; None: not known yet
    """

    key = None


def not_understood(node, what):
    """The exception of an output that graphs do not know."""
    return NotUnderstood(f'node "{node.name}" ({node.bl_label}): {what}')
