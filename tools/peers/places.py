"""Random places on the surfaces of a room where a path tracer can be trusted."""

from dataclasses import dataclass

import numpy as np

NEAR = 1.5e-4  # of the room's size: about a millimetre in a room of 7 m
OFFSET = 0.2  # of the above: how far a place stands before its surface
SAME = 0.01  # of the above: two planes this close are one
INSIDE = 0.5  # a place that sees this share of black backs is inside something
LOOKS = 256  # directions for that share


@dataclass
class Places:
    """Points with unit normals, and the surfaces they are on."""

    points: np.ndarray
    normals: np.ndarray
    material: np.ndarray

    def __len__(self):
        return len(self.points)

    def kept(self, keep):
        return Places(self.points[keep], self.normals[keep], self.material[keep])


def scattered(room, count, seed):
    """Places evenly by area on surfaces that do not shine, on the front, or on either side of two-sided ones."""
    random = np.random.default_rng(seed)
    dark = [part for part in room.parts if not room.materials[part.material].shines()]
    if not dark:
        return Places(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=int))
    corners = np.concatenate([part.corners for part in dark])
    material = np.concatenate([np.full(len(part.corners), part.material) for part in dark])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normal, axis=1)
    pick = random.choice(len(corners), size=count, p=twice / twice.sum())
    a, b = random.random(count), random.random(count)
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    side = np.where(random.random(count) < 0.5, -1.0, 1.0)
    two_sided = np.array([m.two_sided for m in room.materials])[material[pick]]
    normal = normal[pick] / twice[pick, None] * np.where(two_sided, side, 1.0)[:, None]
    mine = corners[pick]
    on = mine[:, 0] + a[:, None] * (mine[:, 1] - mine[:, 0]) + b[:, None] * (mine[:, 2] - mine[:, 0])
    return Places(on + NEAR * OFFSET * room.size() * normal, normal, material[pick])


def free(room, places):
    """Which places have no other surface within a millimetre. The rest of their own plane does not count, but a sheet
    with its back to theirs does: which of the two a ray finds is chance."""
    near = NEAR * room.size()
    corners = np.concatenate([part.corners for part in room.parts])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    one_sided = np.concatenate([
        np.full(len(part.corners), not room.materials[part.material].two_sided) for part in room.parts
    ])
    low, high = corners.min(axis=1) - near, corners.max(axis=1) + near
    keep = np.ones(len(places), dtype=bool)
    for i, (point, up) in enumerate(zip(places.points, places.normals)):
        on = point - OFFSET * near * up
        around = np.flatnonzero(np.all((low <= on) & (on <= high), axis=1))
        away = np.abs((corners[around] - on) @ up).max(axis=1)
        facing = normal[around] @ up
        own = (away < SAME * near) & ((facing > 0.99) | ~one_sided[around])
        others = around[~own]
        keep[i] = len(others) == 0 or distance(on, corners[others]).min() > near
    return keep


def distance(point, corners):
    """From a point to triangles: to the plane where its foot is inside, else to the nearest edge."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    edges = np.stack([b - a, c - b, a - c], 1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    to = point - corners
    along = np.clip((to * edges).sum(2) / (edges**2).sum(2), 0, 1)
    to_edges = np.linalg.norm(to - along[..., None] * edges, axis=2).min(axis=1)
    inside = np.all((np.cross(edges, to) * normal[:, None]).sum(2) >= 0, axis=1)
    return np.where(inside, np.abs((to[:, 0] * normal).sum(1)), to_edges)


def chosen(room, peer, count, seed):
    """`count` places (fewer if the room has not that many) that are free, outside of solids, and lit."""
    places = scattered(room, 4 * count, seed)
    places = places.kept(free(room, places))
    if len(places) == 0:
        return places
    places = places.kept(peer.backs(places, LOOKS, seed) < INSIDE)
    if len(places) == 0:
        return places
    lit = peer.irradiance(places, 256, seed)[:, 1] > 0
    return places.kept(lit).kept(slice(0, count))
