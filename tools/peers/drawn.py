"""The light of a baked file as a viewer draws it: `_XYZ` of its vertices, interpolated over triangles."""

import numpy as np

from grey import GREY
from room import Reader, has_area, triangles

UPRIGHT = 0.999  # cosine between a point's normal and the one that is shaded with, from which on both have the same light


class Baked(Reader):
    """Corners of all triangles, and the tristimulus radiosity there."""

    def __init__(self, path):
        self.found = []
        super().__init__(path)
        self.corners, self.light, self.normals = (np.concatenate(values) for values in zip(*self.found))

    def lamp(self, light, to_world):
        pass

    def primitive(self, primitive, to_world):
        attributes = primitive["attributes"]
        if "_XYZ" not in attributes:
            return
        positions = self.file.accessor(attributes["POSITION"]).astype(np.float64)
        faces = triangles(4, self.file.accessor(primitive["indices"])[:, 0].astype(np.int64))
        if np.linalg.det(to_world[:3, :3]) < 0:
            faces = faces[:, [0, 2, 1]]
        corners = (positions @ to_world[:3, :3].T + to_world[:3, 3])[faces]
        whole = has_area(corners)
        light = self.file.accessor(attributes["_XYZ"]).astype(np.float64)
        normals = np.repeat(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None], 3, axis=1)
        if "NORMAL" in attributes:
            normals = (self.file.accessor(attributes["NORMAL"]).astype(np.float64) @ np.linalg.inv(to_world[:3, :3]))[faces]
        self.found.append((corners[whole], light[faces[whole]], normals[whole]))

    def irradiance(self, points, normals):
        """Tristimulus irradiance of a grey room that is drawn at points just before its surfaces; none where these are shaded with other
        normals, and their light is that of another direction."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        across = np.cross(b - a, c - a)
        double = np.linalg.norm(across, axis=1)
        upright = across / double[:, None]
        return np.array([self.at(p, n, (a, b, c), upright, double) for p, n in zip(points, normals)])

    def at(self, point, normal, corners, upright, double):
        """At one point: on the nearest triangle that faces the same way, measured through its plane and along it."""
        near = np.flatnonzero(upright @ normal > 0.99)
        a, b, c = (corner[near] for corner in corners)
        n = upright[near]
        part = lambda p, q: np.einsum("ij,ij->i", np.cross(p - point, q - point), n) / double[near]
        weights = np.stack([part(b, c), part(c, a), part(a, b)], 1)
        outside = np.maximum(-weights.min(axis=1), 0) * np.sqrt(double[near])
        off = np.abs(np.einsum("ij,ij->i", point - a, n)) + outside
        best = int(np.argmin(off))
        shaded = weights[best] @ self.normals[near[best]]
        if shaded @ normal < UPRIGHT * np.linalg.norm(shaded):
            return np.full(3, np.nan)
        return weights[best] @ self.light[near[best]] / GREY
