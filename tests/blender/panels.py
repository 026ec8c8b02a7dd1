"""What panels and menus show, without a window: they are drawn into something that takes notes."""

import bpy

#: Methods of a layout that show a property of their first argument.
_SHOWS_PROPERTY = {"prop", "prop_enum", "prop_search", "prop_tabs_enum", "template_ID", "template_curve_mapping"}


class Notes:
    """A layout that draws nothing, and whatever its methods return; notes what it is asked to show.

    shown  set of "Struct.property", "operator NAME", "menu NAME", "node TYPE", "nodes SOCKET" and "template NAME"
    """

    def __init__(self, shown=None, name=""):
        self.__dict__.update(shown=set() if shown is None else shown, _name=name)

    def __getattr__(self, name):
        return Notes(self.shown, name)

    def __setattr__(self, name, value):
        if name == "type" and hasattr(bpy.types, str(value)):  # of the node that an operator adds
            self.shown.add(f"node {value}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def __call__(self, *arguments, **keywords):
        name = self._name
        if name in _SHOWS_PROPERTY:
            data = arguments[0] if arguments else keywords["data"]
            if data is not None:
                self.shown.add(f"{data.bl_rna.identifier}.{arguments[1] if len(arguments) > 1 else keywords['property']}")
        elif name == "template_list":
            self.shown.add(f"{arguments[2].bl_rna.identifier}.{arguments[3]}")
        elif name in {"operator", "menu"}:
            self.shown.add(f"{name} {arguments[0]}")
        elif name == "template_node_view":
            self.shown.add(f"nodes {arguments[2].name}")
        elif name.startswith("template_"):
            self.shown.add(f"template {name.removeprefix('template_')}")
        return Notes(self.shown)


class _Instance:
    """Stands for an instance of a class that Blender alone can make one of."""

    is_popover = False

    def __init__(self, cls, layout):
        self._cls = cls
        self.layout = layout

    def __getattr__(self, name):
        value = getattr(self._cls, name)
        raw = next((vars(base)[name] for base in self._cls.__mro__ if name in vars(base)), None)
        is_method = callable(value) and not isinstance(raw, (staticmethod, classmethod)) and hasattr(value, "__get__")
        return value.__get__(self, self._cls) if is_method else value


class Context:
    """bpy.context, but for what is given: what an editor says it shows."""

    def __init__(self, **members):
        self.__dict__.update(members)

    def __getattr__(self, name):
        return getattr(bpy.context, name, None)


def registered(base):
    """Classes of panels or menus by name.

    @param  base  bpy.types.Panel, Menu or Header
    """

    def below(cls):
        for child in cls.__subclasses__():
            yield child
            yield from below(child)

    return {cls.__name__: cls for cls in below(base) if getattr(bpy.types, cls.__name__, None) is cls}


def is_shown(panel, context):
    """Whether Blender would draw a panel, and the one that it is a part of."""
    if hasattr(panel, "poll") and not panel.poll(context):
        return False
    parent = getattr(panel, "bl_parent_id", "")
    return not parent or is_shown(getattr(bpy.types, parent), context)


def shown_by(cls, context):
    """What a panel or menu shows, as Notes has it."""
    notes = Notes()
    for name in ("draw_header", "draw_header_preset", "draw"):
        if hasattr(cls, name):
            getattr(cls, name)(_Instance(cls, notes), context)
    return notes.shown
