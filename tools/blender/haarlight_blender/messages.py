"""What is said to the user: in the status bar while it works, as reports in the end."""

from __future__ import annotations

import haarlight

from .export import NothingToBake
from .read import Strange


# What to do next, where the command's advice is about its options: what is wrong begins so.
ADVICE = {
    "there is no lamp": "add a lamp, give a material an emission strength, or switch World on",
    "the sun stands": "turn it up, or switch World off",
    "the cache belongs to": "bake again",
}
# Words of the command, and what they are in Blender.
WORDS = {
    "--sky overcast lights it": "a colour or a Sky Texture of the world lights it",
    "the cache belongs to a room of another shape": "the scene has another shape than the one that was baked",
}


def status(context, text: str | None) -> None:
    """Sets the text of the status bar, or gives it back to Blender."""
    if context.workspace is not None:
        context.workspace.status_text_set(text)


def wrong(operator, problem: BaseException) -> set[str]:
    """Reports all that is wrong. Other exceptions are faults, which Blender shows with their traceback."""
    if isinstance(problem, haarlight.Error):
        for one in problem.problems or (problem,):
            operator.report({"ERROR"}, f"haarlight: {_named(one)}")
        return {"CANCELLED"}
    if isinstance(problem, (NothingToBake, Strange, ValueError, OSError)):
        operator.report({"ERROR"}, f"haarlight: {problem}")
        return {"CANCELLED"}
    raise problem


def done(operator, lit) -> None:
    """Reports the end and what the user should know."""
    for text in lit.warnings:
        operator.report({"WARNING"}, f"haarlight: {_here(text)}")
    operator.report({"INFO"}, lit.summary())


def _here(text: str) -> str:
    for command, here in WORDS.items():
        text = text.replace(command, here)
    return text


def _named(problem) -> str:
    """A problem, with the names that the user gave in place of a temporary file's."""
    if not isinstance(problem, haarlight.Problem):
        return str(problem)
    advice = next((here for begins, here in ADVICE.items() if problem.what.startswith(begins)), problem.next)
    place = problem.place.replace(str(problem.file), "").strip(": ") if problem.file else problem.place
    if place.endswith("room.glb"):
        place = ""
    return _here(f"{place}: {problem.what}; {advice}".removeprefix(": "))
