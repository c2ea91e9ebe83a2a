"""Packs the extension: python tools/blender/build.py WHEEL... [--output FOLDER]

Wheels come from `pip wheel --no-deps ./tools/python` (or maturin), one for each platform. They go into `wheels/` of the
extension, and their platforms into its manifest. Blender brings NumPy along.
"""

from __future__ import annotations

import argparse
import re
import sys
import zipfile
from pathlib import Path

EXTENSION = Path(__file__).parent / "haarlight_blender"
# Of a wheel's platform tag, and what Blender calls it.
PLATFORMS = (
    (r"(many|musl)?linux.*_x86_64", "linux-x64"),
    (r"(many|musl)?linux.*_aarch64", "linux-arm64"),
    (r"macosx.*_x86_64", "macos-x64"),
    (r"macosx.*_(arm64|universal2)", "macos-arm64"),
    (r"win_amd64", "windows-x64"),
    (r"win_arm64", "windows-arm64"),
)
# A zip that is made twice from the same files has the same bytes; the format begins in this year.
MOMENT = (1980, 1, 1, 0, 0, 0)


def platform_of(wheel: Path) -> str:
    """Blender's name for the platform of a wheel."""
    tag = wheel.stem.split("-")[-1]
    for pattern, name in PLATFORMS:
        if re.search(pattern, tag):
            return name
    raise SystemExit(f"{wheel}: is for {tag}, which Blender does not run on; build it on Linux, macOS or Windows")


def manifest(wheels: list[Path]) -> str:
    """The manifest, with the wheels and their platforms in it."""
    text = (EXTENSION / "blender_manifest.toml").read_text(encoding="utf-8")
    lines = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    platforms = ", ".join(f'"{name}"' for name in sorted({platform_of(wheel) for wheel in wheels}))
    made, count = re.subn(r"^wheels = \[\]$", f"platforms = [{platforms}]\nwheels = [\n{lines}]", text, flags=re.M)
    if count != 1:
        raise SystemExit("blender_manifest.toml: has no line `wheels = []`")
    return made


def pack(wheels: list[Path], folder: Path) -> Path:
    """Writes the extension's .zip."""
    for wheel in wheels:
        if not wheel.is_file() or wheel.suffix != ".whl":
            raise SystemExit(f"{wheel}: is no wheel; make one with pip wheel --no-deps ./tools/python")
    wheels = sorted(wheels, key=lambda wheel: wheel.name)
    text = manifest(wheels)
    version = re.search(r'^version = "(.*)"$', text, flags=re.M)[1]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"haarlight-{version}.zip"
    licences = [EXTENSION.parents[2] / name for name in ("LICENSE-MIT", "LICENSE-APACHE", "LICENSE-HOSEK-WILKIE")]
    files = [("blender_manifest.toml", text.encode())]
    files += [(source.name, source.read_bytes()) for source in [*sorted(EXTENSION.glob("*.py")), *licences]]
    files += [(f"wheels/{wheel.name}", wheel.read_bytes()) for wheel in wheels]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in files:
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            out.writestr(entry, data)
    return path


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", nargs="+", type=Path, metavar="WHEEL")
    parser.add_argument("--output", type=Path, default=Path("target/blender"), metavar="FOLDER")
    asked = parser.parse_args()
    sys.stdout.write(f"{pack(asked.wheels, asked.output)}\n")


if __name__ == "__main__":
    main()
