"""What the user sees, as far as it goes without a window: the timer's steps, the status bar, panels that draw."""

import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import haarlight
import pytest
import scenes
from haarlight_blender import messages, operators, panel, session, show


class Bake(operators._Works):
    """The operator without Blender's base class, which nobody but Blender can make."""

    job, take = operators.HAARLIGHT_OT_bake.job, operators.HAARLIGHT_OT_bake.take

    def __init__(self):
        self.said = []

    def report(self, kind, text):
        self.said.append((set(kind).pop(), text))


def context():
    """Blender's context, with a status bar and timers that note what they are told. Of the file that is open: reading another one
    makes another window."""
    here = bpy.context
    return SimpleNamespace(
        scene=here.scene,
        view_layer=here.view_layer,
        window=here.window,
        window_manager=MagicMock(windows=here.window_manager.windows),
        workspace=MagicMock(),
        evaluated_depsgraph_get=here.evaluated_depsgraph_get,
        temp_override=here.temp_override,
    )


def small(error=2.0):
    scene = scenes.empty()
    scenes.room()
    scenes.lamp("Lamp", "POINT", 10.0, (0, 0, 1))
    scene.haarlight.error = error
    bpy.context.view_layer.update()
    return scene


def run(bake, here, events):
    assert bake.begin(here) == {"RUNNING_MODAL"}
    assert operators.running is not None and not operators.HAARLIGHT_OT_bake.poll(bpy.context)
    for _ in range(600):
        ended = bake.modal(here, SimpleNamespace(type=events.pop(0) if events else "TIMER"))
        if ended != {"PASS_THROUGH"}:
            return ended
        time.sleep(0.05)
    raise AssertionError("it does not end")


@pytest.fixture(autouse=True)
def none_runs():
    """The next test finds no bake of this one."""
    yield
    operators.running = None


def test_a_bake_beside_the_user():
    scene = small()
    here = context()
    bake = Bake()
    assert run(bake, here, []) == {"FINISHED"}
    said = [call.args[0] for call in here.workspace.status_text_set.call_args_list]
    assert said[0].startswith("haarlight: ") and "Esc ends with what is whole" in said[0]
    assert said[-1] is None, "the status bar is given back"
    assert here.window_manager.event_timer_remove.called and here.window_manager.progress_end.called
    assert operators.running is None and show.of_scene(scene) is not None
    assert bake.said[-1][0] == "INFO" and "dE00" in bake.said[-1][1]


def test_escape_ends_it_with_what_is_whole():
    scene = small(error=0.05)
    here = context()
    bake = Bake()
    assert run(bake, here, ["TIMER", "MOUSEMOVE", "ESC"]) == {"FINISHED"}
    said = [call.args[0] for call in here.workspace.status_text_set.call_args_list]
    assert any(text and "ending with what is whole" in text for text in said)
    assert "stopped; what is there is whole" in bake.said[-1][1]
    assert session.baked(show.of_scene(scene), show.KEY).light.verdict == "interrupted"


def test_the_scene_may_change_while_it_is_baked():
    scene = small(error=0.3)
    here = context()
    bake = Bake()
    assert bake.begin(here) == {"RUNNING_MODAL"}
    bpy.data.objects.remove(scene.objects["Room"])
    bpy.data.materials.remove(bpy.data.materials["wall"])
    for _ in range(600):
        ended = bake.modal(here, SimpleNamespace(type="TIMER"))
        if ended != {"PASS_THROUGH"}:
            break
        time.sleep(0.05)
    assert ended == {"FINISHED"}
    assert [made.name for made in show.of_scene(scene).objects] == ["Room lit"]


def test_all_problems_are_said_and_faults_are_not_hidden():
    said = []
    operator = SimpleNamespace(report=lambda kind, text: said.append((set(kind).pop(), text)))
    problems = [haarlight.Problem("material 'a'", "is wrong", "mend it"), haarlight.Problem("light 'b'", "too", "mend it")]
    assert messages.wrong(operator, haarlight.InputError("all", problems)) == {"CANCELLED"}
    assert said == [
        ("ERROR", "haarlight: material 'a': is wrong; mend it"),
        ("ERROR", "haarlight: light 'b': too; mend it"),
    ]
    assert messages.wrong(operator, haarlight.InternalError("a fault")) == {"CANCELLED"}
    assert said[-1] == ("ERROR", "haarlight: a fault")
    with pytest.raises(KeyError):
        messages.wrong(operator, KeyError("ours"))


def test_panels_draw():
    scene = small()
    for medium in ("VERTICES", "MAPS"):
        scene.haarlight.medium = medium
        layout = MagicMock()
        panel.HAARLIGHT_PT_bake.draw(SimpleNamespace(layout=layout), bpy.context)
        drawn = [call.args[1] for call in layout.prop.call_args_list]
        assert "error" in drawn and ("map_size" in drawn) == (medium == "MAPS")
    scene.haarlight.medium = "VERTICES"
    bpy.ops.haarlight.bake()
    layout = MagicMock()
    panel.HAARLIGHT_PT_bake.draw(SimpleNamespace(layout=layout), bpy.context)
    assert "dE00" in layout.label.call_args.kwargs["text"]
    assert [call.args[0] for call in layout.operator.call_args_list][-1] == "haarlight.originals"
    for kind, block in ((panel.HAARLIGHT_PT_material, "material"), (panel.HAARLIGHT_PT_lamp, "light")):
        here = SimpleNamespace(**{block: bpy.data.materials[0] if block == "material" else bpy.data.lights[0]})
        assert kind.poll(here)
        kind.draw(SimpleNamespace(layout=MagicMock()), here)
