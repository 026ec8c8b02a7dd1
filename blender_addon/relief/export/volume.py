# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's volume shaders as the closures of RELIEF_volume: what fills what a material's meshes bound, or the world.

A tree of Mix and Add Shaders is a weighted sum of closures here as well, see surface.py.
"""

from .. import compat
from .surface import ClosureWriter, knows

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
    "ShaderNodeVolumeCoefficients": "coefficients",
    "ShaderNodeEmission": "emission",
}

#: Closures that scatter and what tells of their phase functions, by Blender's names: since 4.3 a node can have any of them.
_PHASES = {
    "HENYEY_GREENSTEIN": ("scatter", {"Anisotropy": "anisotropy"}),
    "RAYLEIGH": ("rayleigh", {}),
    "DRAINE": ("draine", {"Anisotropy": "anisotropy", "Alpha": "alpha"}),
    "FOURNIER_FORAND": ("fournier-forand", {"IOR": "ior", "Backscatter": "backscatter"}),
    "MIE": ("mie", {"Diameter": "diameter"}),
}


class VolumeWriter(ClosureWriter):
    """Collects the closures of one medium.

    @param  graph   GraphWriter, which gets what varies
    @param  fail    as ClosureWriter's
    @param  voxels  Voxels that it reads by the names of attributes; None: there are none
    closures        JSON of the closures
    """

    def __init__(self, graph, fail, voxels=None):
        super().__init__(graph, None, fail, filters_glossy=False)
        graph.voxels = self._voxels = voxels

    def write(self, source):
        for part, weight in self._parts(source):
            node = part.node
            kind = _NODES.get(node.bl_idname) if part.socket.type == "SHADER" else None
            if kind is None and node.bl_idname == "ShaderNodeBsdfPrincipled" and compat.PRINCIPLED_EMITS_IN_VOLUMES:
                color, strength = (compat.principled_socket(node, name) for name in ("Emission", "Emission Strength"))
                self.add("emission", 1.0, color=self.input(color, part), strength=self.input(strength, part))
                continue
            if kind is None and part.socket.type == "SHADER" and knows(node):
                self.unread(part, "a surface shader as volume", "nothing is there, as in Cycles")
                continue
            if kind is None:
                self._fail(part, f'node "{node.name}" ({node.bl_label}) as volume', "it is left out")
                continue
            if kind == "coefficients":
                self._add_coefficients(part, weight)
                continue
            if kind == "scatter":
                self._add_scattering(part, weight, self.inputs(part, {"Color": "color", "Density": "density"}))
                continue
            inputs = self.inputs(part, _NAMES)
            if kind == "principled" and self._voxels is not None:
                self._add_attributes(node, inputs)
            if kind == "emission" and not compat.MIXES_WEIGH_VOLUME_EMISSION:
                weight = 1.0
            if kind == "principled" and compat.MIXES_WEIGH_VOLUME_EMISSION:
                self._weigh_emission(inputs, weight)
            self.add(kind, weight, **inputs)

    def _add_scattering(self, source, weight, values):
        """Adds what scatters by the phase function of a node.

        @param  values  color and density
        """
        kind, names = _PHASES[getattr(source.node, "phase", "HENYEY_GREENSTEIN")]
        self.add(kind, weight, **values, **self.inputs(source, names))

    def _add_coefficients(self, source, weight):
        """Volume Coefficients, which came with 5.0: what is absorbed, scattered and emitted, each by numbers a metre."""
        names = {"Absorption Coefficients": "absorbed", "Scatter Coefficients": "scattered", "Emission Coefficients": "emitted"}
        values = self.inputs(source, names)
        nothing = [0.0, 0.0, 0.0]
        if values["scattered"] != nothing:
            self._add_scattering(source, weight, {"color": values["scattered"]})
        if values["emitted"] != nothing:
            self.add("emission", weight, color=values["emitted"])
        if values["absorbed"] == nothing:
            return
        if isinstance(values["absorbed"], dict):
            color = self.graph.op("vector-math", {"a": [1.0] * 3, "b": values["absorbed"]}, "vector", operation="subtract")
            self.add("absorption", weight, color=color)
            return
        # Relative to the largest, as 1 less a small number would lose its digits.
        largest = max(values["absorbed"])
        if largest > 0:
            self.add("absorption", weight, color=[1.0 - c / largest for c in values["absorbed"]], density=largest)

    def fill(self):
        """What Cycles fills a volume object with that has no material: a new Principled Volume."""
        density = self._voxels.output(self.graph, "density", "value") if "density" in self._voxels else 1.0
        self.add("principled", 1.0, density=self._math("maximum", density, 0.0))

    def _weigh_emission(self, inputs, weight):
        """Dims what a Principled Volume emits: its closure takes the weight for what absorbs and scatters alone."""
        inputs["emissionStrength"] = self.times(inputs["emissionStrength"], weight)
        tint = inputs["blackbodyTint"]
        if isinstance(tint, dict) or isinstance(weight, dict):
            tint = self.graph.op("vector-math", {"a": tint, "scale": weight}, "vector", operation="scale")
        else:
            tint = [channel * weight for channel in tint]
        inputs["blackbodyTint"] = tint

    def _add_attributes(self, node, inputs):
        """Multiplies what a Principled Volume has by the grids that it names, those that there are."""

        def grid(socket, output="value"):
            name = node.inputs[socket].default_value
            return self._voxels.output(self.graph, name, output) if name in self._voxels else None

        for socket, name in (("Density Attribute", "density"), ("Temperature Attribute", "temperature")):
            value = grid(socket)
            if value is not None:
                inputs[name] = self._math("multiply", inputs[name], self._math("maximum", value, 0.0))
        color = grid("Color Attribute", "color")
        if color is not None:
            inputs["color"] = self.graph.op("vector-math", {"a": inputs["color"], "b": color}, "vector", operation="multiply")

    @property
    def varies(self):
        """Whether something depends on where it is."""
        return any(isinstance(value, dict) for closure in self.closures for value in closure.values())
