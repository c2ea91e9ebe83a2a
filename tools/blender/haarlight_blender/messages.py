"""What is said to the user: in the status bar while it works, as reports in the end."""

from __future__ import annotations

import haarlight

from .export import NothingToBake
from .read import Strange


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
        operator.report({"WARNING"}, f"haarlight: {text}")
    operator.report({"INFO"}, lit.summary())


def _named(problem) -> str:
    """A problem, with the names that the user gave in place of a temporary file's."""
    text = str(problem)
    file = getattr(problem, "file", None)
    return text.replace(f"{file}: ", "").replace(str(file), "the room") if file else text
