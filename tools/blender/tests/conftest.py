"""Tests of the extension, in a Blender without a window: the module `bpy`. Without it all of them skip, and say so."""

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
MISSING = [name for name in ("bpy", "haarlight", "numpy") if importlib.util.find_spec(name) is None]


def pytest_report_header():
    if MISSING:
        return f"SKIPPED, ALL OF THEM: {', '.join(MISSING)} cannot be imported; pip install bpy==5.0.1 ./tools/python"


def pytest_ignore_collect(collection_path):
    """Without Blender only the test that says so."""
    if MISSING and collection_path.name.startswith("test_"):
        return collection_path.name != "test_build.py"
    return None


def pytest_terminal_summary(terminalreporter):
    if MISSING:
        terminalreporter.write_line(f"SKIPPED: tools/blender, without {', '.join(MISSING)}", yellow=True)


@pytest.fixture(scope="session", autouse=True)
def extension():
    """The extension, registered."""
    if MISSING:
        yield
        return
    import haarlight_blender

    haarlight_blender.register()
    yield
    haarlight_blender.unregister()
