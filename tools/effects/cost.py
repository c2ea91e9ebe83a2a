"""What each effect costs: CPU seconds of a whole bake of one room, with the effect and without.

    cargo build --release
    python3 tools/effects/cost.py sun-room.glb [--error 1] [--haarlight target/release/haarlight]

The room is the sun-room of the Godot engine's demo projects (global illumination, MIT) with a lamp panel below its ceiling: 5,090
triangles, a directional light `sun`, materials `wall`, `top` (of a table), `panel` and others. Each case is that room with a side file of
its own; user CPU seconds of the process count, reading and writing included.
"""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
DYE = {
    "excitation": {"csv": "380,0.5\n430,0.5\n470,0"},
    "emission": {"csv": "440,0\n500,1\n600,0"},
    "yield": 0.8,
}
CASES = [
    ("as it came: sun and panel", {}, []),
    ("sky: overcast", {}, ["--sky", "overcast"]),
    ("sky: clear, its sun the file's", {"sky": {"type": "clear", "sun": "sun"}}, []),
    ("sky: hosek, its sun the file's", {"sky": {"type": "hosek", "sun": "sun"}}, []),
    ("pane: the table's top is glass", {"materials": {"top": {"transmittance": 0.78}}}, []),
    ("sheet: the table's top is paper", {"materials": {"top": {"reflectance": 0.4, "transmission": 0.4}}}, []),
    ("mirror: the table's top is one", {"materials": {"top": {"mirror": True}}}, []),
    (
        "profile: the panel has one",
        {"materials": {"panel": {"emission": {"profile": "gallery-panel.ldt", "name": "cie/LED-B3"}}}},
        [],
    ),
    ("dye: the walls fluoresce", {"materials": {"wall": {"fluorescence": DYE}}}, []),
]


def cost(command):
    """User CPU seconds of a process; its exit code is 0 (done) or 1 (further rounds no longer pay)."""
    process = subprocess.Popen(command)
    _, status, usage = os.wait4(process.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit(f"{' '.join(command)} ended with {code}")
    return usage.ru_utime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", type=Path)
    parser.add_argument("--error", default="1")
    parser.add_argument("--haarlight", default="target/release/haarlight")
    args = parser.parse_args()
    print("| case | CPU s | to plain | megabytes of the file |")
    print("|---|---:|---:|---:|")
    plain = None
    for name, said, options in CASES:
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            shutil.copy(args.room, folder / "room.glb")
            shutil.copy(SCENES / "gallery-panel.ldt", folder)
            if said:
                (folder / "room.spectra.json").write_text(json.dumps(said))
            room, baked = str(folder / "room.glb"), folder / "out.glb"
            command = [args.haarlight, "bake", room, "-o", str(baked), "--error", args.error, "--quiet", *options]
            seconds = cost(command)
            plain = plain or seconds
            size = baked.stat().st_size / 1e6
        print(f"| {name} | {seconds:.1f} | {seconds / plain:.2f} | {size:.1f} |", flush=True)


if __name__ == "__main__":
    main()
