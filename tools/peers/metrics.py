"""How far one set of irradiances is from another: relative error, bias, colour difference."""

import numpy as np

DARK = 0.02  # points darker than this share of the mean are covered places, and left out
FAR = 0.05  # a point off by more than this counts as far off


def de2000(xyz1, xyz2, white):
    """CIEDE2000 (CIE 142:2001) in CIELAB under `white`."""

    def lab(xyz):
        t = np.maximum(xyz / white, 0)
        f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
        return 116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])

    (l1, a1, b1), (l2, a2, b2) = lab(xyz1), lab(xyz2)
    c7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    g = 0.5 * (1 - np.sqrt(c7 / (c7 + 25.0**7)))
    a1, a2 = (1 + g) * a1, (1 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    turn = (h2 - h1 + 180) % 360 - 180
    # The hue of a grey means nothing (note 14 of the recommendation).
    turn = np.where(c1 * c2 == 0, 0, turn)
    dl, dc, dh = l2 - l1, c2 - c1, 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))
    h = np.where(c1 * c2 == 0, h1 + h2, (h1 + turn / 2) % 360)
    l, c = (l1 + l2) / 2, (c1 + c2) / 2
    cos = lambda degrees: np.cos(np.radians(degrees))
    t = 1 - 0.17 * cos(h - 30) + 0.24 * cos(2 * h) + 0.32 * cos(3 * h + 6) - 0.2 * cos(4 * h - 63)
    sl = 1 + 0.015 * (l - 50) ** 2 / np.sqrt(20 + (l - 50) ** 2)
    sc, sh = 1 + 0.045 * c, 1 + 0.015 * c * t
    rt = -2 * np.sqrt(c**7 / (c**7 + 25.0**7)) * np.sin(np.radians(60 * np.exp(-(((h - 275) / 25) ** 2))))
    dl, dc, dh = dl / sl, dc / sc, dh / sh
    return np.sqrt(np.maximum(dl**2 + dc**2 + dh**2 + rt * dc * dh, 0))


class Truth:
    """A reference in independent runs (run, point, XYZ): their mean, and from their spread its noise."""

    def __init__(self, runs):
        runs = np.asarray(runs, dtype=np.float64)
        self.runs = len(runs)
        self.xyz = runs.mean(axis=0)
        y = self.xyz[:, 1]
        self.mean = y.mean()
        self.lit = y > DARK * self.mean
        self.white = 2 * self.xyz.mean(axis=0)
        deviation = runs[:, :, 1].std(axis=0, ddof=1) / np.sqrt(len(runs))
        self.noise = np.divide(deviation, y, out=np.zeros_like(y), where=y > 0)
        halves = runs[0::2].mean(axis=0)[self.lit], runs[1::2].mean(axis=0)[self.lit]
        # Half of the difference of two halves has the noise of their mean.
        self.colour_noise = de2000(*halves, self.white).mean() / 2

    def median_noise(self):
        """Median over the lit points of the relative standard error."""
        return float(np.median(self.noise[self.lit]))

    def rms_noise(self, points=None):
        """RMS over some points, all lit ones unless told, of the relative standard error."""
        return float(np.sqrt(np.mean(self.noise[self.lit if points is None else points] ** 2)))

    def errors(self, xyz):
        """What differs, as a dictionary of numbers; shares and relative errors in per cent. Points that are no numbers are left out."""
        compared = self.lit & np.isfinite(xyz).all(axis=1)
        a, b = np.asarray(xyz)[compared], self.xyz[compared]
        off = a[:, 1] / b[:, 1] - 1
        square = np.mean(off**2) - self.rms_noise(compared) ** 2
        colour = de2000(a, b, self.white)
        return {
            "points": int(compared.sum()),
            "rel": 100 * np.sqrt(max(square, 0)),
            "bias": 100 * (a[:, 1].sum() / b[:, 1].sum() - 1),
            "median": 100 * float(np.median(off)),
            "far": 100 * float(np.mean(np.abs(off) > FAR)),
            "de_mean": float(colour.mean()),
            "de_95": float(np.percentile(colour, 95)),
        }
