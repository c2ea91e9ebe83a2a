// Light and error at the vertices, unpacked; colours and colour temperature from spectra. The planes: see light.rs.

const XYZ_TO_RGB = [
  [3.2404542, -1.5371385, -0.4985314],
  [-0.969266, 1.8760108, 0.041556],
  [0.0556434, -0.2040259, 1.0572252],
];
/** Second radiation constant, nm K. */
const C2 = 1.438776877e7;

export const rgbOf = (xyz) => XYZ_TO_RGB.map((row) => row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]);

export class Light {
  constructor(index, room, bytes) {
    this.index = index;
    this.room = room;
    const n = (this.count = index.vertices);
    const steps = index.rounds.length + 1;
    const plane = (k) => bytes.subarray(k * n, (k + 1) * n);
    // Each step is what has to be added to the one after it: undone from the last.
    for (let k = steps - 2; k >= 0; k -= 1) {
      const [own, next] = [bytes.subarray(4 * k * n), bytes.subarray(4 * (k + 1) * n)];
      for (let i = 0; i < 4 * n; i += 1) own[i] = (own[i] + next[i]) & 255;
    }
    this.steps = Array.from({ length: steps }, (_, k) => this.#step([0, 1, 2, 3].map((p) => plane(4 * k + p))));
    let next = 4 * steps;
    if (index.error_most_de2000 != null) {
      const codes = plane(next);
      next += 1;
      this.error = Float32Array.from(codes, (c) => index.error_most_de2000 * (c / 255) ** 2);
    }
    this.coefficients = index.spectrum.ranges.map(([low, high], k) => {
      const [a, b] = [plane(next + 2 * k), plane(next + 2 * k + 1)];
      return Float32Array.from(a, (x, i) => low + ((high - low) * (256 * x + b[i])) / 65535);
    });
    next += 2 * this.coefficients.length;
    // What each layer brings of the file's illuminance.
    this.shares = index.layers.map((_, k) => {
      const [a, b] = [plane(next + 2 * k), plane(next + 2 * k + 1)];
      return Float32Array.from(a, (x, i) => (256 * x + b[i]) / 65535);
    });
    this.factors = null;
  }

  /** Dims the layers by a factor each; null: as in the file. */
  dim(factors) {
    this.factors = factors;
    const { lux } = this.steps[this.last];
    this.dimmed = factors && lux.map((x, i) => x * factors.reduce((sum, f, k) => sum + f * this.shares[k][i], 0));
  }

  /** Illuminance of a step at the vertices; of the file's own with its layers dimmed. */
  lux(step) {
    return (step === this.last && this.factors && this.dimmed) || this.steps[step].lux;
  }

  #step([high, low, u, v]) {
    const { lux_log10: range, uv } = this.index;
    const lux = new Float32Array(this.count);
    const xyz = new Float32Array(3 * this.count);
    for (let i = 0; i < this.count; i += 1) {
      const code = 256 * high[i] + low[i];
      if (code === 0) continue;
      const y = 10 ** (range[0] + ((range[1] - range[0]) * (code - 1)) / 65534);
      const a = uv[0][0] + ((uv[0][1] - uv[0][0]) * u[i]) / 255;
      const b = uv[1][0] + ((uv[1][1] - uv[1][0]) * v[i]) / 255;
      lux[i] = y;
      xyz.set([(9 * a * y) / (4 * b), y, ((12 - 3 * a - 20 * b) * y) / (4 * b)], 3 * i);
    }
    return { lux, xyz };
  }

  get last() {
    return this.steps.length - 1;
  }

  /** What a colour of the file is multiplied by to show a step, at each vertex, linear sRGB. */
  ratios(step, first, count) {
    const [now, file] = [this.steps[step].xyz, this.steps[this.last].xyz];
    const out = new Float32Array(3 * count);
    for (let i = 0; i < count; i += 1) {
      const at = 3 * (first + i);
      const [a, b] = [rgbOf(now.subarray(at, at + 3)), rgbOf(file.subarray(at, at + 3))];
      for (let c = 0; c < 3; c += 1) out[3 * i + c] = b[c] > 1e-6 ? Math.min(8, Math.max(0, a[c] / b[c])) : 1;
    }
    return out;
  }

  /** Irradiance at a point between vertices, W/m2/nm. */
  spectrum(vertices, weights) {
    const { mean, components } = this.index.spectrum;
    const lux = this.steps[this.last].lux;
    return mean.map((m, k) => {
      let sum = 0;
      vertices.forEach((v, i) => {
        let shape = m;
        components.forEach((axis, c) => (shape += this.coefficients[c][v] * axis[k]));
        sum += weights[i] * lux[v] * shape;
      });
      return Math.max(0, sum);
    });
  }
}

export const mixed = (values, vertices, weights) => vertices.reduce((sum, v, i) => sum + weights[i] * values[v], 0);

export const xyzOf = (room, spectrum) =>
  room.observer.map((w) => w.reduce((sum, x, k) => sum + x * spectrum[k], 0));

const uv1960 = ([x, y, z]) => {
  const sum = x + 15 * y + 3 * z;
  return [(4 * x) / sum, (6 * y) / sum];
};

/** Correlated colour temperature, K, and distance from the black body's curve in (u, v) of CIE 1960; null where there is none. */
export function temperature(room, xyz) {
  if (!(xyz[1] > 0)) return null;
  const own = uv1960(xyz);
  const at = (mired) => {
    const kelvin = 1e6 / mired;
    const planck = room.nm.map((nm) => nm ** -5 / Math.expm1(C2 / (nm * kelvin)));
    return uv1960(xyzOf(room, planck));
  };
  const away = (mired) => Math.hypot(...at(mired).map((x, k) => x - own[k]));
  // From 1 000 to 50 000 K the curve has no second nearest point within .05.
  let [low, high] = [20, 1000];
  const golden = (Math.sqrt(5) - 1) / 2;
  for (let k = 0; k < 60; k += 1) {
    const [a, b] = [high - golden * (high - low), low + golden * (high - low)];
    if (away(a) < away(b)) high = b;
    else low = a;
  }
  const mired = (low + high) / 2;
  const size = away(mired);
  if (size > 0.05 || mired < 20.5 || mired > 999) return null;
  return { kelvin: 1e6 / mired, duv: own[1] >= at(mired)[1] ? size : -size };
}

/** A colour for the screen, as bright as it can be. */
export function swatch(rgb, stretch = true) {
  const most = stretch ? Math.max(...rgb, 1e-9) : 1;
  const encode = (c) => {
    const x = Math.min(1, Math.max(0, c / most));
    return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
  };
  return `rgb(${rgb.map(encode).join(" ")})`;
}
