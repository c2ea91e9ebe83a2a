#!/usr/bin/env python3
"""A courtyard under a coloured sky: haarlight against Mitsuba 3, which get the same picture of the sky. See README.md.

    courtyard.py [--haarlight target/release/haarlight] [--variant llvm_ad_rgb] [--paths 65536] [--sun | --formula]
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

from gltf import write_quads

WIDTH = 1024  # of the sky's picture
SUN = (50.0, 60.0)  # height and azimuth from north (-Z) over east (+X), degrees
TO_XYZ = np.array([[0.4123907993, 0.3575843394, 0.1804807884], [0.2126390059, 0.7151686788, 0.0721923154],
                   [0.0193308187, 0.1191947798, 0.9505321522]])
PAINTS = {"floor": 0.3, "wall": 0.5, "balcony": 0.7}


def quads():
    """Corner, two sides, paint; fronts where the first side times the second points. 8 m x 10 m, walls of 6 m, a balcony."""
    x, y, z = np.eye(3)
    o = 0 * x
    yield o, 10 * z, 8 * x, "floor"
    yield o, 8 * x, 6 * y, "wall"
    yield 10 * z, 6 * y, 8 * x, "wall"
    yield o, 6 * y, 10 * z, "wall"
    yield 8 * x, 10 * z, 6 * y, "wall"
    low, high = np.array([2, 2.8, 0]), np.array([6, 3.0, 1.5])
    a, b, c = (high - low) * np.eye(3)
    yield low, a, c, "balcony"
    yield low + b, c, a, "balcony"
    yield low + c, a, b, "balcony"
    yield low, c, b, "balcony"
    yield low + a, b, c, "balcony"


def places():
    for i in range(4):
        for j in range(5):
            yield (1 + 2 * i, 0, 1 + 2 * j), (0, 1, 0)
    for k in range(5):
        yield (4, 0.5 + k, 0), (0, 0, 1)
        yield (0, 0.5 + k, 5), (1, 0, 0)
        yield (3.1, 0.5 + k, 10), (0, 0, -1)


def directions():
    """Of the middles of texels, rows from the zenith: the middle of the picture looks along +X."""
    down = np.pi * (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2)
    along = 2 * np.pi * ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5)
    down, along = np.meshgrid(down, along, indexing="ij")
    return np.stack([np.sin(down) * np.cos(along), np.cos(down), np.sin(down) * np.sin(along)], -1)


def sky(sun=False, white=False):
    """The clear sky of ISO 15469, type 12, bluer toward the zenith unless it is white, some 10 klx; with its sun if asked for."""
    d = directions()
    h, a = np.radians(SUN)
    toward = np.array([np.cos(h) * np.sin(a), np.sin(h), -np.cos(h) * np.cos(a)])
    up = np.maximum(d[..., 1], 1e-9)
    cosine = np.clip(d @ toward, -1, 1)
    light = 1 - np.exp(-0.32 / up)
    light *= 1 + 10 * (np.exp(-3 * np.arccos(cosine)) - np.exp(-1.5 * np.pi)) + 0.45 * cosine**2
    blue = np.array([0.6, 0.95, 2.0]) * up[..., None] + np.array([1.0, 1.0, 1.0]) * (1 - up[..., None])
    picture = 3000 * light[..., None] * (np.ones(3) if white else blue)
    if sun:
        picture[cosine > np.cos(np.radians(1.0))] += np.array([6.0e7, 5.5e7, 4.5e7])
    picture[d[..., 1] < 0] = 0
    return picture.astype(np.float32)


def level(picture):
    """Illuminance of open ground."""
    edges = np.sin(np.pi * np.arange(WIDTH // 2 + 1) / (WIDTH // 2)) ** 2
    weight = np.where(np.arange(WIDTH // 2) < WIDTH // 4, np.diff(edges), 0) * np.pi / WIDTH
    return float((picture.astype(float) @ TO_XYZ[1] * weight[:, None]).sum())


def glb(path):
    materials = [{"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": 3 * [rho] + [1]}}
                 for name, rho in PAINTS.items()]
    write_quads(path, quads(), materials)


def ours(program, folder, sky):
    """`sky`: the words that ask for it."""
    room, points = (os.path.join(folder, name) for name in ("room.glb", "points.csv"))
    glb(room)
    with open(points, "w") as out:
        out.write("x,y,z,nx,ny,nz\n" + "".join(",".join(map(str, p + n)) + "\n" for p, n in places()))
    words = [program, "probe", room, "--points", points, "-q", *sky]
    run = subprocess.run(words, capture_output=True, text=True)
    if run.returncode not in (0, 1):
        sys.exit(run.stderr)
    rows = csv.DictReader(run.stdout.splitlines())
    return np.array([[float(row[key]) for key in ("E_X", "E_Y", "E_Z")] for row in rows])


def theirs(mi, picture, paths, seed):
    """Irradiance by paths from each place, the first direction by the cosine or toward the sky, weighted against each other."""
    import drjit as dr

    # Its picture begins at -Z, ours at -X.
    rolled = np.roll(picture, -WIDTH // 4, 1)
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": -1},
             "sky": {"type": "envmap", "bitmap": mi.Bitmap(rolled), "scale": 1.0}}
    for k, (o, u, v, paint) in enumerate(quads()):
        matrix = np.eye(4)
        matrix[:3] = np.stack([u / 2, v / 2, np.cross(u, v) / np.linalg.norm(np.cross(u, v)), o + (u + v) / 2], 1)
        rho = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 3 * [PAINTS[paint]]}}
        scene[f"quad{k}"] = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": rho}
    scene = mi.load_dict(scene)
    integrator, sampler = scene.integrator(), mi.load_dict({"type": "independent"})
    found = []
    for k, (point, normal) in enumerate(places()):
        sampler.seed(seed + k, paths)
        n = mi.Vector3f(*normal)
        here = dr.zeros(mi.SurfaceInteraction3f, paths)
        here.p, here.n, here.sh_frame = mi.Point3f(*(p + 1e-4 * q for p, q in zip(point, normal))), mi.Normal3f(n), mi.Frame3f(n)
        to = here.sh_frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        light = rest(mi, dr, scene, integrator, sampler, here, to)
        lamp, sent = scene.sample_emitter_direction(here, sampler.next_2d(), True)
        cosine = dr.maximum(dr.dot(n, lamp.d), 0)
        light += sent * cosine * lamp.pdf / dr.maximum(lamp.pdf + cosine / dr.pi, 1e-30)
        found.append([float(dr.mean(light[c])[0]) for c in range(3)])
    return np.array(found) @ TO_XYZ.T


def rest(mi, dr, scene, integrator, sampler, here, to):
    """What comes from directions chosen by the cosine: sky, against the other choice, and light that surfaces pass on."""
    ray = mi.RayDifferential3f(mi.Ray3f(here.p, to))
    hit = scene.ray_intersect(ray)
    light, _, _ = integrator.sample(scene, sampler, ray)
    density = dr.maximum(dr.dot(here.n, to), 0) / dr.pi
    target = mi.DirectionSample3f(scene, hit, here)
    target.d = to
    target.emitter = scene.environment()
    other = scene.pdf_emitter_direction(here, target)
    share = dr.select(hit.is_valid(), 1, density / dr.maximum(density + other, 1e-30))
    return light * dr.pi * share


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haarlight", default="target/release/haarlight")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--paths", type=int, default=65536)
    parser.add_argument("--sun", action="store_true", help="a disc of 2 degrees, 50 klx")
    parser.add_argument("--formula", action="store_true", help="haarlight's own sky of type 12, for Mitsuba tabulated; white")
    args = parser.parse_args()
    import mitsuba as mi

    mi.set_variant(args.variant)
    picture = sky(args.sun, args.formula)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "sky.exr")
        mi.Bitmap(picture).write(path)
        words = ["--sky", path]
        if args.formula:
            where = ["--sun", ",".join(map(str, SUN)), "--sun-lux", "0", "--ground", "0"]
            words = ["--sky", "clear", "--sky-cct", "6504", "--sky-lux", str(level(picture)), *where]
        a = ours(os.path.abspath(args.haarlight), folder, words)
    runs = [theirs(mi, picture, args.paths, 1 + 1000 * k) for k in range(4)]
    b, noise = np.mean(runs, 0), np.std(runs, 0, ddof=1) / 2
    for (point, _), x, y, e in zip(places(), a, b, noise):
        off = 100 * (x / y - 1)
        print(f"{point!s:18} {x[1]:9.1f} lx, {y[1]:9.1f} +- {e[1]:5.1f}; X {off[0]:+.2f} % Y {off[1]:+.2f} % Z {off[2]:+.2f} %")
    off = a / b - 1
    print(json.dumps({"rms_percent": (100 * np.sqrt(np.mean(off**2, 0))).round(3).tolist(),
                      "bias_percent": (100 * (a.sum(0) / b.sum(0) - 1)).round(3).tolist(),
                      "worst_percent": (100 * np.abs(off).max(0)).round(3).tolist(),
                      "noise_percent": (100 * np.sqrt(np.mean((noise / b) ** 2, 0))).round(3).tolist()}))


if __name__ == "__main__":
    main()
