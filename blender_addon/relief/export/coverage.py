# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of a material's nodes is understood: counted by the exporter itself, as it goes.

Counted are the nodes that the active output can be reached from, each once for every use of the group that it is in.
Outputs, groups and reroutes do not count. A node is understood unless something of it was warned about, or its kind is
not known.
"""

from dataclasses import dataclass

from . import graph, nodes, surface


@dataclass(frozen=True)
class Coverage:
    """num_nodes       that count
    not_understood  (name of a node, reason) of those that are not understood
    """

    num_nodes: int
    not_understood: tuple

    @property
    def num_understood(self):
        return self.num_nodes - len(self.not_understood)

    def __str__(self):
        return f"{self.num_understood} of {self.num_nodes} nodes understood"


_ENDS = {"ShaderNodeVolumeAbsorption", "ShaderNodeDisplacement", "ShaderNodeVectorDisplacement"}


def coverage_of(ends, problems, owner):
    """Coverage of all nodes behind some outputs.

    @param  ends      nodes.Source of what is linked to a material's output
    @param  problems  texts by the keys of nodes, as nodes.Source has them
    @param  owner     of the tree
    """
    reached = _reached(ends)
    missing = []
    for key, source in reached.items():
        node = source.node
        reason = problems.get(key)
        if reason is None and not (graph.knows(node) or surface.knows(node) or node.bl_idname in _ENDS):
            reason = f'node "{node.name}" ({node.bl_label})'
        if reason is not None:
            missing.append(tuple(nodes.original_names(owner, text) for text in (node.name, reason)))
    return Coverage(len(reached), tuple(missing))


def _reached(ends):
    """Sources by their keys."""
    reached, waiting = {}, list(ends)
    while waiting:
        source = waiting.pop()
        if source.is_value or source.key in reached:
            continue
        reached[source.key] = source
        inner = (nodes.linked(socket, source.groups) for socket in source.node.inputs if socket.enabled)
        waiting.extend(s for s in inner if s is not None)
    return reached
