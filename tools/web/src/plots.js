// Plots as SVG, drawn as wide as their place and again when that changes. Colours come from the page's style.

import { digits, h, label, linearTicks, logTicks, niceAbove, niceBelow, s } from "./dom.js";

/** A figure that draws itself at its width. */
export function plot(caption, draw) {
  const place = h("div", { class: "plot" });
  const figure = h("figure", {}, place, caption && h("figcaption", {}, caption));
  let drawn = 0;
  new ResizeObserver(() => {
    const width = Math.round(place.clientWidth);
    if (!width || width === drawn) return;
    drawn = width;
    place.replaceChildren(draw(width));
  }).observe(place);
  return figure;
}

function frame(width, height, title, x, y) {
  const margin = { left: 54, right: 14, top: 12, bottom: 44 };
  const inner = { x0: margin.left, x1: width - margin.right, y0: height - margin.bottom, y1: margin.top };
  const along = (axis, [from, to]) => (value) => {
    const place = axis.log
      ? Math.log(value / axis.low) / Math.log(axis.high / axis.low)
      : (value - axis.low) / (axis.high - axis.low);
    return from + place * (to - from);
  };
  const [px, py] = [along(x, [inner.x0, inner.x1]), along(y, [inner.y0, inner.y1])];
  const svg = s("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title });
  for (const tick of y.ticks) {
    svg.append(s("line", { class: "grid", x1: inner.x0, x2: inner.x1, y1: py(tick), y2: py(tick) }));
    svg.append(s("text", { class: "tick", x: inner.x0 - 7, y: py(tick) + 4, "text-anchor": "end" }, label(tick)));
  }
  for (const tick of x.ticks) {
    svg.append(s("line", { class: "grid", x1: px(tick), x2: px(tick), y1: inner.y0, y2: inner.y1 }));
    svg.append(s("text", { class: "tick", x: px(tick), y: inner.y0 + 17, "text-anchor": "middle" }, label(tick)));
  }
  svg.append(
    s("path", { class: "axis", d: `M${inner.x0} ${inner.y1}V${inner.y0}H${inner.x1}` }),
    s("text", { class: "name", x: (inner.x0 + inner.x1) / 2, y: height - 6, "text-anchor": "middle" }, x.name),
    s("text", { class: "name", x: 13, y: (inner.y0 + inner.y1) / 2, "text-anchor": "middle",
      transform: `rotate(-90 13 ${(inner.y0 + inner.y1) / 2})` }, y.name),
  );
  return { svg, px, py, inner };
}

/** Colour of a wavelength, as well as a screen can show it. */
function hue(nm) {
  const bump = (at, left, right) => Math.exp(-0.5 * ((nm - at) / (nm < at ? left : right)) ** 2);
  const rgb = [bump(605, 38, 45) + 0.32 * bump(425, 14, 22), bump(540, 38, 34), bump(452, 22, 28)];
  return `rgb(${rgb.map((c) => Math.round(235 * Math.min(1, c) ** 0.6)).join(" ")})`;
}

/** A spectrum as steps over wavelengths, with the colours of the light below it. */
export function spectrum(title, nm, values, name, { most, height = 200 } = {}) {
  return plot(null, (width) => {
    const step = nm[1] - nm[0];
    const [low, high] = [nm[0] - step / 2, nm.at(-1) + step / 2];
    const highest = Math.max(...values, 1e-12);
    const top = most ?? Math.ceil((1.02 * highest) / niceAbove(highest / 4)) * niceAbove(highest / 4);
    const x = { low, high, ticks: linearTicks(low, high, width < 380 ? 4 : 8), name: "Wavelength (nm)" };
    const y = { low: 0, high: top, ticks: linearTicks(0, top, 4), name };
    const { svg, px, py, inner } = frame(width, height, title, x, y);
    nm.forEach((at, k) => {
      const [from, to] = [px(at - step / 2), px(at + step / 2)];
      svg.append(s("rect", { class: "band", x: from, y: py(Math.min(top, values[k])), width: to - from + 0.4,
        height: Math.max(0, inner.y0 - py(Math.min(top, values[k]))), fill: hue(at) }));
    });
    const line = values.map((v, k) => `${k ? "L" : "M"}${px(nm[k] - step / 2).toFixed(1)} ${py(Math.min(top, v)).toFixed(1)}H${px(nm[k] + step / 2).toFixed(1)}`);
    svg.append(s("path", { class: "line", d: line.join("") }));
    return svg;
  });
}

/** Error against time: rounds, the error asked for, and the file's. */
export function errors(rounds, asked, file) {
  const known = rounds.filter((r) => r.error > 0);
  if (!known.length) return h("p", {}, "No error is known: it takes two rounds to tell how much they differ.");
  return plot(null, (width) => {
    const ends = [...known.map((r) => r.seconds), file?.seconds].filter((t) => t > 0);
    const values = [...known.map((r) => r.error), asked, file?.error].filter((e) => e > 0);
    const axis = (all, name) => {
      let [low, high] = [niceBelow(Math.min(...all) / 1.2), niceAbove(Math.max(...all) * 1.2)];
      if (low >= high) [low, high] = [low / 2, high * 2];
      const ticks = logTicks(low, high);
      return { low, high, log: true, name, ticks: ticks.length > 9 ? ticks.filter((t) => /^1/.test(t.toExponential())) : ticks };
    };
    const [x, y] = [axis(ends, "Time since the start (s)"), axis(values, "Mean error (ΔE00)")];
    const { svg, px, py, inner } = frame(width, 280, "Error against time", x, y);
    svg.append(
      s("line", { class: "asked", x1: inner.x0, x2: inner.x1, y1: py(asked), y2: py(asked) }),
      s("text", { class: "note", x: inner.x1 - 4, y: py(asked) - 6, "text-anchor": "end" }, `asked for: ${label(asked)}`),
      s("path", { class: "line", d: known.map((r, k) => `${k ? "L" : "M"}${px(r.seconds)} ${py(r.error)}`).join("") }),
    );
    for (const r of known) {
      svg.append(s("circle", { class: "dot", cx: px(r.seconds), cy: py(r.error), r: 4.5 },
        s("title", {}, `Round ${r.round}: ΔE00 ${digits(r.error)} after ${digits(r.seconds)} s`)));
      svg.append(s("text", { class: "note", x: px(r.seconds) + 8, y: py(r.error) - 7 }, `${r.round}`));
    }
    if (file?.error > 0) {
      const [cx, cy] = [px(file.seconds), py(file.error)];
      svg.append(s("path", { class: "file", d: `M${cx} ${cy - 7}L${cx + 7} ${cy}L${cx} ${cy + 7}L${cx - 7} ${cy}Z` },
        s("title", {}, `The file: ΔE00 ${digits(file.error)}`)));
      svg.append(s("text", { class: "note", x: cx - 11, y: cy - 9, "text-anchor": "end" }, "the file"));
    }
    return svg;
  });
}

/** Lying stacked bars with their parts named above. */
export function bars(title, unit, parts, rows) {
  const key = h("ul", { class: "key" }, parts.map((p, k) => h("li", { class: `part${k}` }, p)));
  const figure = plot(null, (width) => {
    const most = Math.max(...rows.map((r) => r.values.reduce((a, b) => a + b, 0)), 1e-9);
    const [left, right, step] = [72, 58, 30];
    const height = rows.length * step + 44;
    const px = (v) => left + (v / most) * (width - left - right);
    const svg = s("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title });
    for (const tick of linearTicks(0, most, width < 420 ? 3 : 5)) {
      svg.append(s("line", { class: "grid", x1: px(tick), x2: px(tick), y1: 0, y2: height - 38 }));
      svg.append(s("text", { class: "tick", x: px(tick), y: height - 23, "text-anchor": "middle" }, label(tick)));
    }
    rows.forEach((row, r) => {
      let sum = 0;
      svg.append(s("text", { class: "tick", x: left - 8, y: r * step + 19, "text-anchor": "end" }, row.name));
      row.values.forEach((value, k) => {
        svg.append(s("rect", { class: `part${k}`, x: px(sum), y: r * step + 4, height: step - 9, width: Math.max(0, px(sum + value) - px(sum)) },
          s("title", {}, `${row.name}, ${parts[k]}: ${digits(value)} s`)));
        sum += value;
      });
      svg.append(s("text", { class: "tick", x: px(sum) + 6, y: r * step + 19 }, digits(sum)));
    });
    svg.append(s("text", { class: "name", x: (left + width - right) / 2, y: height - 5, "text-anchor": "middle" }, unit));
    return svg;
  });
  figure.prepend(key);
  return figure;
}
