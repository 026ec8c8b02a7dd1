"""Node trees of materials in few words, inside Blender."""

import bpy


class NodeTree:
    """A node tree of a material, and a few words over it."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()

    @classmethod
    def of_geometry(cls, name):
        """A tree of geometry nodes; `make` puts it to use."""
        made = cls.__new__(cls)
        made.tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        if bpy.app.version < (4, 0, 0):
            made.tree.outputs.new("NodeSocketGeometry", "Geometry")
        else:
            made.tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        return made

    def make(self, thing, geometry):
        """Makes what an object is by a tree of geometry nodes, whose last socket is given."""
        self.node("NodeGroupOutput", {0: geometry})
        thing.modifiers.new(self.tree.name, "NODES").node_group = self.tree

    def node(self, kind, inputs=(), **attributes):
        """A node, of shaders unless its type's whole name is given; inputs by name or number are sockets to link or values."""
        node = self.tree.nodes.new(kind if "Node" in kind else "ShaderNode" + kind)
        for name, value in attributes.items():
            setattr(node, name, value)
        for key, value in dict(inputs).items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[key])
            else:
                node.inputs[key].default_value = value
        return node

    def ramp(self, factor, *colors):
        node = self.node("ValToRGB", {0: factor})
        elements = node.color_ramp.elements
        while len(elements) < len(colors):
            elements.new(0.5)
        for i, color in enumerate(colors):
            elements[i].position, elements[i].color = 0.25 + 0.5 * i / (len(colors) - 1), (*color, 1)
        return node.outputs[0]

    def math(self, operation, a, b=0.5):
        return self.node("Math", {0: a, 1: b}, operation=operation).outputs[0]

    def mix(self, factor, a, b, blend="MIX"):
        return self.node("MixRGB", {0: factor, 1: a, 2: b}, blend_type=blend).outputs[0]

    def place(self, scale):
        coordinate = self.node("TexCoord")
        return self.node("Mapping", {0: coordinate.outputs["Object"], "Scale": scale}).outputs[0]

    def end(self, shader):
        self.node("OutputMaterial", {0: shader})
        return self.material

    def principled(self, color, roughness=0.5, height=None, **inputs):
        """A Principled BSDF, bumped by a height if there is one; needs the add-on, which knows what each Blender calls inputs.

        @param  inputs  further ones by their names in 3.4, "_" for a space
        """
        from relief import compat

        node = self.node("BsdfPrincipled", {"Base Color": color, "Roughness": roughness})
        if height is not None:
            bump = self.node("Bump", {"Height": height, "Strength": 0.4, "Distance": 0.05})
            self.tree.links.new(bump.outputs[0], node.inputs["Normal"])
        for name, value in inputs.items():
            socket = compat.principled_socket(node, name.replace("_", " "))
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]
