// The report's parts put together. Called by the page itself: `haarlightReport(data, open)`. A page with a token is live.

import { $, choice, digits, h, linearTicks, niceAbove, whole } from "./dom.js";
import { pad } from "./pad.js";
import { Light, mixed, temperature } from "./light.js";
import { live } from "./live.js";
import { legend, luxScale, MAGMA, VIRIDIS } from "./maps.js";
import { cards, header } from "./panels.js";
import { spectrum } from "./plots.js";
import { Stage } from "./stage.js";

/** Names and explanations of the pictures. */
const LOOKS = [["light", "Light"], ["lux", "Illuminance"], ["error", "Error"], ["both", "Lux | error"]];
const MOVES = [["orbit", "Orbit"], ["walk", "Walk"]];

function scales(light) {
  const lux = luxScale(...light.index.usual_lx);
  const most = niceAbove(Math.max(0.5, 4 * (light.index.error_mean_de2000 ?? 0)));
  const error = { map: MAGMA, low: 0, high: most, ticks: linearTicks(0, most), place: (v) => v / most };
  return { lux, error };
}

window.haarlightReport = async (data, open) => {
  const light = new Light(data.light, data.room, new Uint8Array(await open("planes")));
  header(data, light);
  cards($("cards"), data, light, open);
  const maps = scales(light);
  const point = reading(data, light);
  point(null, light.last);
  let spot = null;
  const picked = (found) => {
    spot = found;
    point(spot, stage.step);
  };
  const stage = await Stage.open($("canvas"), await open("glb"), data, light, maps, picked).catch((problem) => {
    $("state").textContent = `The room cannot be drawn here (${problem.message}). The figures below are whole.`;
    return null;
  });
  document.documentElement.dataset.ready = stage ? "yes" : "no";
  if (!stage) return;
  const legends = {
    lux: legend(VIRIDIS, "Illuminance (lux)", maps.lux, "on the surfaces, logarithmic"),
    error: legend(MAGMA, "Error (ΔE00, estimate)", maps.error,
      "of the light, see below"),
  };
  const shown = { light: [], lux: [legends.lux], error: [legends.error], both: [legends.lux, legends.error] };
  // On wide screens legends lie in the picture, elsewhere below it.
  const foot = () => {
    stage.foot = getComputedStyle($("legends")).position === "absolute" ? $("legends").offsetHeight : 0;
    $("picture").style.setProperty("--foot", `${stage.foot}px`);
  };
  new ResizeObserver(() => (foot(), stage.draw())).observe($("legends"));
  const look = (view) => {
    check(view);
    $("legends").replaceChildren(...shown[view]);
    $("legends").hidden = view === "light";
    foot();
    stage.setView(view);
    $("bright-label").hidden = view !== "light";
    $("contours-label").hidden = view === "light" || view === "error";
    $("picture").classList.toggle("both", view === "both");
  };
  const check = choice($("looks"), "look", LOOKS, look);
  const walk = (on) => {
    checkMove(on ? "walk" : "orbit");
    stage.controls.setWalking(on);
    $("picture").classList.toggle("walking", on);
  };
  const checkMove = choice($("moves"), "move", MOVES, (value) => walk(value === "walk"));
  if (!light.error) {
    for (const value of ["error", "both"]) {
      const input = $("looks").querySelector(`[value=${value}]`);
      input.disabled = true;
      input.parentElement.title =
        data.log.verdict.error_de2000.value == null
          ? "No error is known: it takes two rounds to tell how much they differ."
          : "Where the error is was not kept: the bake went on from a checkpoint.";
    }
  }
  $("views").append(...stage.views.map((view, k) => h("option", { value: k }, view.name)));
  $("views").addEventListener("change", () => {
    stage.goTo(Number($("views").value));
    walk(stage.controls.walking);
  });
  $("contours").addEventListener("change", () => stage.setContours($("contours").checked));
  $("bright").addEventListener("input", () => {
    $("bright").setAttribute("aria-valuetext", `${$("bright").value} stops`);
    stage.setBrightness(2 ** Number($("bright").value));
  });
  const round = rounds(data, light, (step) => {
    stage.show(step);
    point(spot, step);
  });
  pad(stage.controls);
  stage.onDrawn = () =>
    $("marks").replaceChildren(...stage.spots().map(([x, y]) => h("i", { style: `left:${x}px;top:${y}px` })));
  $("canvas").addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const number = LOOKS[Number(event.key) - 1]?.[0];
    if (number && (light.error || number === "light" || number === "lux")) look(number);
    else if (event.key === "Enter") stage.pick();
    else if (event.key === "," || event.key === ".") round(event.key === "," ? -1 : 1);
    else return;
    event.preventDefault();
  });
  addEventListener("beforeprint", () => (foot(), stage.drawNow()));
  addEventListener("afterprint", () => (foot(), stage.draw()));
  look("light");
  walk(stage.controls.walking);
  $("state").textContent = "";
};

/** The slider over the rounds; a function that moves it by so many. */
function rounds(data, light, show) {
  const slider = $("round");
  slider.max = light.last;
  slider.value = light.last;
  slider.disabled = light.last === 0;
  const records = new Map(data.log.rounds.map((r) => [r.round, r]));
  const tell = () => {
    const step = Number(slider.value);
    const number = light.index.rounds[step];
    const record = records.get(number);
    const name = step === light.last ? "The file" : `Round ${number}`;
    const error = record?.error.total_de2000.value;
    $("round-name").textContent = name;
    slider.setAttribute("aria-valuetext", name);
    $("round-note").textContent = record
      ? `${error == null ? "No error known yet" : `ΔE00 ${digits(error)} (estimate)`} after ${digits(record.elapsed_s)} s, ` +
        `${whole(record.elements)} patches, ${whole(record.links)} links. Rounds show the light on the patches; fine shadows come with the file.`
      : light.last === 0
        ? "The light of the rounds was not kept: the bake went on from a checkpoint."
        : "The file: the light looked up once more at each of its vertices.";
    show(step);
  };
  slider.addEventListener("input", tell);
  tell();
  return (by) => {
    slider.value = Number(slider.value) + by;
    tell();
  };
}

/** The card of the measured point. */
function reading(data, light) {
  const card = $("point");
  const title = h("h2", {}, "A point");
  return (spot, step) => {
    card.classList.toggle("measured", Boolean(spot));
    if (!spot) {
      card.replaceChildren(title, h("p", { class: "hint" },
        "Click or tap a surface – or focus the picture and press Enter – to read the light that falls on it there: lux, spectrum, colour and the stated error."));
      return;
    }
    const { vertices, weights } = spot;
    const lux = (k) => mixed(light.steps[k].lux, vertices, weights);
    const xyz = [0, 1, 2].map((c) => vertices.reduce((sum, v, i) => sum + weights[i] * light.steps[light.last].xyz[3 * v + c], 0));
    const sum = xyz[0] + xyz[1] + xyz[2];
    const cct = temperature(data.room, xyz);
    const error = light.error && mixed(light.error, vertices, weights);
    const row = (name, ...value) => [h("dt", {}, name), h("dd", {}, ...value)];
    const rows = [
      h("dt", {}, "Illuminance"), h("dd", { class: "big" }, `${digits(lux(light.last))} lx`),
      step !== light.last && row(`in round ${light.index.rounds[step]}`, `${digits(lux(step))} lx`),
      row("Error", error == null ? "not known" : [`ΔE00 ${digits(error, 2)} `, h("small", {}, "estimate")]),
      sum > 0 && row("x, y", `${(xyz[0] / sum).toFixed(4)}, ${(xyz[1] / sum).toFixed(4)}`),
      row("CCT", cct ? [`${Math.round(cct.kelvin)} K `, h("small", {}, `Duv ${cct.duv >= 0 ? "+" : "−"}${Math.abs(cct.duv).toFixed(4)}`)]
        : ["– ", h("small", {}, sum > 0 ? "too far from white" : "no light")]),
      row("Surface", spot.material || "–"),
      row("Place", h("small", {}, `${spot.point.map((x) => x.toFixed(3)).join(", ")} (x, y, z of the file)`)),
    ];
    const values = light.spectrum(vertices, weights).map((x) => 1000 * x);
    card.replaceChildren(title, h("dl", { class: "reading" }, rows),
      spectrum("Spectral irradiance at the point", data.room.nm, values, "Irradiance (mW/m²/nm)"),
      h("p", { class: "hint" }, "Light that falls on the surface, in the file",
        light.index.spectrum.left_out > 5e-4 ? `; spectra are kept to ${digits(100 * light.index.spectrum.left_out, 1)} %.` : "."));
  };
}

if (document.documentElement.dataset.token) live(document.documentElement.dataset.token);
