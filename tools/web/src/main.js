// The report's parts put together. Called by the page itself: `haarlightReport(data, open)`. A page with a token is live.

import { around } from "./around.js";
import { $, digits, linearTicks, niceAbove, whole } from "./dom.js";
import { layers } from "./layers.js";
import { Light, mixed } from "./light.js";
import { live } from "./live.js";
import { legend, luxScale, MAGMA, VIRIDIS } from "./maps.js";
import { cards, header } from "./panels.js";
import { pointCard } from "./point.js";
import { Stage } from "./stage.js";

/** Names and explanations of the pictures. */
const LOOKS = [["light", "Light"], ["lux", "Illuminance"], ["error", "Error"], ["both", "Lux | error"]];

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
  $("contours").addEventListener("change", () => stage.setContours($("contours").checked));
  $("bright").addEventListener("input", () => {
    $("bright").setAttribute("aria-valuetext", `${$("bright").value} stops`);
    stage.setBrightness(2 ** Number($("bright").value));
  });
  const round = rounds(data, light, (step) => {
    stage.show(step);
    point(spot, step);
  });
  layers(light.index.layers, (factors) => {
    light.dim(factors);
    stage.show(stage.step);
    point(spot, stage.step);
  });
  const looked = (view) => {
    $("legends").replaceChildren(...shown[view]);
    foot();
    $("bright-label").hidden = view !== "light";
    $("contours-label").hidden = view === "light" || view === "error";
    $("picture").classList.toggle("both", view === "both");
  };
  const allowed = (view) => light.error || view === "light" || view === "lux";
  around(stage, LOOKS, { looked, allowed, keys: { ",": () => round(-1), ".": () => round(1) } });
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
  addEventListener("beforeprint", () => (foot(), stage.drawNow()));
  addEventListener("afterprint", () => (foot(), stage.draw()));
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

/** Shows a spot of the file in its own light, and what a round said of it. */
function reading(data, light) {
  const show = pointCard(data.room);
  return (spot, step) => {
    if (!spot) return show(null);
    const { vertices, weights, material, point: place } = spot;
    const lux = (k) => mixed(light.steps[k].lux, vertices, weights);
    const rows = step === light.last ? [] : [[`in round ${light.index.rounds[step]}`, `${digits(lux(step))} lx`]];
    if (light.factors) rows.push(["as the lamps are set", `${digits(mixed(light.dimmed, vertices, weights))} lx`]);
    const xyz = [0, 1, 2].map((c) => vertices.reduce((sum, v, i) => sum + weights[i] * light.steps[light.last].xyz[3 * v + c], 0));
    const left = light.index.spectrum.left_out;
    return show({
      lux: lux(light.last), xyz, material, place,
      rows,
      error: light.error && mixed(light.error, vertices, weights),
      values: light.spectrum(vertices, weights).map((x) => 1000 * x),
      note: `Light that falls on the surface, in the file${left > 5e-4 ? `; spectra are kept to ${digits(100 * left, 1)} %.` : "."}`,
    });
  };
}

if (document.documentElement.dataset.token) live(document.documentElement.dataset.token);
