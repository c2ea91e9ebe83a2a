"""The zip with a real wheel, checked and installed as Blender does it, in a Blender of its own that has no haarlight."""

import os
import subprocess
import sys
from pathlib import Path

import bpy
import build
import numpy
import pytest

PROGRAM = """
import sys, bpy
try:
    import haarlight
    sys.exit("haarlight is there already")
except ImportError:
    pass
bpy.ops.preferences.addon_enable(module="bl_pkg")
bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
sys.path.append(sys.argv[2])
import scenes
scene = bpy.context.scene
for made in list(scene.objects):
    bpy.data.objects.remove(made)
scenes.room()
scenes.lamp("Lamp", "POINT", 10.0, (0, 0, 1))
scene.haarlight.error = 2.0
assert bpy.ops.haarlight.bake() == {"FINISHED"}
assert "haarlight_irradiance" in bpy.data.objects["Room lit"].data.attributes
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.haarlight")
assert not hasattr(scene, "haarlight")
print("installed and baked")
"""


@pytest.mark.skipif("HAARLIGHT_WHEEL" not in os.environ, reason="HAARLIGHT_WHEEL names no wheel")
def test_blender_installs_the_zip_and_bakes(tmp_path):
    path = build.pack([Path(os.environ["HAARLIGHT_WHEEL"])], tmp_path)
    checker = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core/bl_pkg/cli/blender_ext.py"
    subprocess.run([sys.executable, checker, "validate", path], check=True, timeout=60)
    # All that is installed here, without haarlight.
    site = tmp_path / "site"
    site.mkdir()
    for entry in Path(numpy.__file__).parents[1].iterdir():
        if not entry.name.startswith("haarlight"):
            (site / entry.name).symlink_to(entry)
    bare = Path(sys.base_prefix) / "bin" / f"python3.{sys.version_info.minor}"
    out = subprocess.run(
        [bare, "-c", PROGRAM, path, Path(__file__).parent],
        env={**os.environ, "PYTHONPATH": str(site), "BLENDER_USER_RESOURCES": str(tmp_path / "user")},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "installed and baked" in out.stdout, out.stdout + out.stderr
