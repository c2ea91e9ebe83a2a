#!/usr/bin/env python3
"""Lamps with profiles: haarlight against Radiance (ies2rad, rtrace), lux at points of a floor. See README.md.

    pip install pyradiance
    profiles.py [--haarlight target/release/haarlight]

Skips, and says so, where Radiance is not installed.
"""

import argparse
import json
import math
import os
import struct
import subprocess
import sys
import tempfile

HEIGHT = 2.5
DOWN = [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)]  # -Z of a node looks down: C0 is +X, C90 is -Z
LUMINOUS = (47.435, 119.93, 11.635)  # Radiance's 179 lm/W over its three channels
PLACES = [(0, 0), (0.4, 0.1), (-0.7, 0.5), (1.3, -0.9), (-2, -2), (3, 1), (0.2, 3.5), (-4, 0.3)]


def lopsided(gamma, c):
    """cd at gamma and C, degrees."""
    if gamma > 89.9:
        return 0.0
    g, c = math.radians(gamma), math.radians(c)
    return 800 * math.cos(g) * (1 + 0.5 * math.sin(g) * math.cos(c) + 0.3 * math.sin(g) * math.sin(c))


def narrow(gamma, c):
    return 4000 * max(math.cos(math.radians(gamma)), 0) ** 12


def ies(candela, opening, horizontal):
    """`opening`: width and length; the length lies along C0."""
    vertical = [2.5 * k for k in range(37)]
    rows = [vertical, horizontal] + [[candela(v, h) for v in vertical] for h in horizontal]
    head = "IESNA:LM-63-2002\n[TEST] own figures\n[TESTLAB] none\n[ISSUEDATE] 2026\n[MANUFAC] nobody\nTILT=NONE\n"
    numbers = f"1 -1 1 {len(vertical)} {len(horizontal)} 1 2 {opening[0]} {opening[1]} 0\n1 1 10\n"
    return head + numbers + "\n".join(" ".join(f"{x:.4f}" for x in row) for row in rows) + "\n"


def glb(path, panel):
    """A black floor of 12 m, and a point light or a panel at HEIGHT."""
    quads = [([-6, 0, -6], [0, 0, 12], [12, 0, 0], "floor")]
    if panel:
        w, l = panel
        quads.append(([-w / 2, HEIGHT, -l / 2], [w, 0, 0], [0, 0, l], "panel"))
    bin_, nodes, meshes, accessors, views = b"", [], [], [], []
    for k, (o, u, v, _) in enumerate(quads):
        corners = [[o[i] + s * u[i] + t * v[i] for i in range(3)] for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))]
        for data, kind, component in (
            (struct.pack("<12f", *sum(corners, [])), "VEC3", 5126),
            (struct.pack("<6H", 0, 1, 2, 0, 2, 3), "SCALAR", 5123),
        ):
            views.append({"buffer": 0, "byteOffset": len(bin_), "byteLength": len(data)})
            accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind,
                              "count": 4 if kind == "VEC3" else 6})
            bin_ += data
        meshes.append({"primitives": [{"attributes": {"POSITION": 2 * k}, "indices": 2 * k + 1, "material": k}]})
        nodes.append({"mesh": k})
    black = {"metallicFactor": 0, "baseColorFactor": [0, 0, 0, 1]}
    room = {"asset": {"version": "2.0"}, "scene": 0, "meshes": meshes, "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": len(bin_)}],
            "materials": [{"name": q[3], "pbrMetallicRoughness": black} for q in quads]}
    if not panel:
        room["extensionsUsed"] = ["KHR_lights_punctual"]
        room["extensions"] = {"KHR_lights_punctual": {"lights": [{"name": "lamp", "type": "point"}]}}
        nodes.append({"translation": [0, HEIGHT, 0], "rotation": DOWN, "extensions": {"KHR_lights_punctual": {"light": 0}}})
    room["nodes"], room["scenes"] = nodes, [{"nodes": list(range(len(nodes)))}]
    text = json.dumps(room).encode()
    text += b" " * (-len(text) % 4)
    bin_ += b"\0" * (-len(bin_) % 4)
    with open(path, "wb") as out:
        out.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(bin_)))
        out.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(bin_), b"BIN\0") + bin_)


def ours(program, folder, panel):
    path = os.path.join(folder, "room.glb")
    glb(path, panel)
    wish = {"profile": "lamp.ies", "name": "cie/D65"}
    side = {"materials": {"panel": {"emission": wish}}} if panel else {"lights": {"lamp": wish}}
    with open(os.path.join(folder, "room.spectra.json"), "w") as out:
        json.dump(side, out)
    points = os.path.join(folder, "points.csv")
    with open(points, "w") as out:
        out.write("x,y,z,nx,ny,nz\n" + "".join(f"{x},0,{z},0,1,0\n" for x, z in PLACES))
    run = subprocess.run([program, "probe", path, "--points", points, "--error", "0.25", "-q"],
                         capture_output=True, text=True)
    if run.returncode not in (0, 1):
        sys.exit(run.stderr)
    head, *lines = run.stdout.strip().splitlines()
    column = head.split(",").index("lux")
    return [float(line.split(",")[column]) for line in lines]


def radiance(pyradiance, folder):
    tool = lambda name: os.path.join(str(pyradiance.BINPATH), name)
    env = dict(os.environ, RAYPATH=os.pathsep.join([".", str(pyradiance._LIBPATH)]), PATH=f"{pyradiance.BINPATH}:{os.environ['PATH']}")
    call = lambda *words, **more: subprocess.run(words, cwd=folder, env=env, check=True, capture_output=True, **more).stdout
    call(tool("ies2rad"), "-dm", "-o", "lamp", "lamp.ies")
    lamp = call(tool("xform"), "-t", "0", "0", str(HEIGHT), "lamp.rad")
    floor = b"void plastic black 0 0 5 0 0 0 0 0\nblack polygon floor 0 0 12 -6 -6 0 6 -6 0 6 6 0 -6 6 0\n"
    with open(os.path.join(folder, "room.rad"), "wb") as out:
        out.write(lamp + b"\n" + floor)
    with open(os.path.join(folder, "room.oct"), "wb") as out:
        out.write(call(tool("oconv"), "room.rad"))
    # Its z is our y; a light's subdivision (-ds) fine enough for the near field.
    rays = "".join(f"{x} {-z} 0.0001 0 0 1\n" for x, z in PLACES).encode()
    found = call(tool("rtrace"), "-h", "-I", "-ab", "0", "-ds", "0.01", "-dj", "0", "-dt", "0", "-dc", "1", "room.oct", input=rays)
    rows = [[float(x) for x in line.split()[:3]] for line in found.decode().strip().splitlines()]
    return [sum(c * w for c, w in zip(row, LUMINOUS)) for row in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haarlight", default="target/release/haarlight")
    args = parser.parse_args()
    try:
        import pyradiance
    except ImportError:
        print("SKIPPED: no Radiance here (pip install pyradiance)", file=sys.stderr)
        return
    whole = [15.0 * k for k in range(25)]
    cases = [
        ("point, lopsided", lopsided, (0, 0), whole, None),
        ("point, narrow", narrow, (0, 0), [0.0], None),
        ("panel 1.2 x .6 m, lopsided", lopsided, (0.6, 1.2), whole, (1.2, 0.6)),
        ("panel 1.2 x .6 m, narrow", narrow, (0.6, 1.2), [0.0], (1.2, 0.6)),
    ]
    for name, candela, opening, horizontal, panel in cases:
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "lamp.ies"), "w") as out:
                out.write(ies(candela, opening, horizontal))
            a = ours(os.path.abspath(args.haarlight), folder, panel)
            b = radiance(pyradiance, folder)
        print(name)
        for (x, z), a, b in zip(PLACES, a, b):
            print(f"  {x:5.1f} {z:5.1f}  haarlight {a:9.3f} lx  Radiance {b:9.3f} lx  {100 * (a / b - 1) if b else 0:+.2f} %")


if __name__ == "__main__":
    main()
