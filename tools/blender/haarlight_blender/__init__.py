"""haarlight in Blender: bakes light into the scene, in full spectrum.

| file | what |
|---|---|
| `lamps`, `world`, `paint` | lamps in figures, the world as a sky, materials that glTF's exporter can read |
| `export` | the scene as a .glb, by Blender's exporter, with a number for each piece |
| `spectra` | names of spectra, and what was chosen |
| `bake` | the bake, on a thread |
| `glb`, `read` | the baked .glb as arrays, by number |
| `show` | new objects with the light, and the node group that shows it |
| `session`, `relight` | bakes that are kept, and relighting when a lamp changes |
| `properties`, `operators`, `panel`, `messages` | what the user sees |
"""

import re
import warnings

import bpy


def register():
    """Called by Blender."""
    import haarlight

    from . import operators, panel, properties, relight

    # They are in `Room.warnings`, from where the user gets them.
    warnings.filterwarnings("ignore", category=haarlight.RoomWarning, module=re.escape(__package__))
    for cls in (*properties.CLASSES, *operators.CLASSES, *panel.CLASSES):
        bpy.utils.register_class(cls)
    properties.register()
    relight.register()


def unregister():
    """Called by Blender."""
    from . import operators, panel, properties, relight

    relight.unregister()
    properties.unregister()
    for cls in reversed((*properties.CLASSES, *operators.CLASSES, *panel.CLASSES)):
        bpy.utils.unregister_class(cls)
