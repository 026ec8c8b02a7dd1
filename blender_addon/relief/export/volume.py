# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's volume shaders as the closures of RELIEF_volume: what fills what a material's meshes bound, or the world.

A tree of Mix and Add Shaders is a weighted sum of closures here as well, see surface.py.
"""

from .surface import ClosureWriter

_NAMES = {
    "Color": "color",
    "Density": "density",
    "Strength": "strength",
    "Anisotropy": "anisotropy",
    "Absorption Color": "absorptionColor",
    "Emission Strength": "emissionStrength",
    "Emission Color": "emissionColor",
    "Blackbody Intensity": "blackbodyIntensity",
    "Blackbody Tint": "blackbodyTint",
    "Temperature": "temperature",
}

_NODES = {
    "ShaderNodeVolumeAbsorption": "absorption",
    "ShaderNodeVolumeScatter": "scatter",
    "ShaderNodeVolumePrincipled": "principled",
    "ShaderNodeEmission": "emission",
}


class VolumeWriter(ClosureWriter):
    """Collects the closures of one medium.

    @param  graph  GraphWriter, which gets what varies
    @param  fail   as ClosureWriter's
    closures       JSON of the closures
    """

    def __init__(self, graph, fail):
        super().__init__(graph, None, fail, filters_glossy=False)

    def write(self, source):
        for part, weight in self._parts(source):
            node = part.node
            kind = _NODES.get(node.bl_idname) if part.socket.type == "SHADER" else None
            if kind is None:
                self._fail(part, f'node "{node.name}" ({node.bl_label}) as volume', "it is left out")
                continue
            if getattr(node, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
                self.unread(part, f"the phase function {node.phase}", "Henyey and Greenstein's was used")
            self.add(kind, weight, **self.inputs(part, _NAMES))

    @property
    def varies(self):
        """Whether something depends on where it is."""
        return any(isinstance(value, dict) for closure in self.closures for value in closure.values())
