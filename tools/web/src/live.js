// The live page: the state of the program by events, light as bytes when it says that there is other light.

import { around } from "./around.js";
import { $, digits, h, whole } from "./dom.js";
import { grow } from "./growth.js";
import { lamps } from "./lamps.js";
import { legend, luxScale, MAGMA, VIRIDIS } from "./maps.js";
import { pointCard } from "./point.js";
import { Stage } from "./stage.js";

const LOOKS = [["light", "Light"], ["lux", "Illuminance"]];
const DOING = {
  preparing: "Preparing the room", solving: "Solving", stopped: "Stopped", gathering: "Looking closely at every vertex",
  relighting: "Relighting", saving: "Saving", done: "Done",
};
/** So many values say where most of the light lies. */
const SAMPLED = 20000;

export async function live(token) {
  const address = (path, more = "") => `${path}?token=${token}${more}`;
  const ask = async (path, more, options) => {
    const answer = await fetch(address(path, more), options);
    if (!answer.ok) throw new Error((await answer.text()).trim());
    return answer;
  };
  const post = (path, body) => ask(path, "", { method: "POST", body });
  const say = (text) => ($("state").textContent = text);
  const view = new View(ask, say);

  let state = null;
  let known = null;
  let shown = "{}";
  const act = (path) => post(path).catch((problem) => note(problem.message));
  const note = (text) => {
    $("note").hidden = !text;
    $("note").textContent = text ?? "";
  };
  // One change is on its way at a time, and the newest waits.
  let waiting = null;
  let sending = false;
  const send = async (body) => {
    waiting = JSON.stringify(body);
    if (sending) return;
    sending = true;
    while (waiting != null) {
      const text = waiting;
      waiting = null;
      shown = text;
      note(null);
      await post("/change", text).catch((problem) => note(problem.message));
    }
    sending = false;
  };
  for (const path of ["stop", "go", "save", "expose"]) $(path).addEventListener("click", () => act(`/${path}`));

  const events = new EventSource(address("/events"));
  events.onerror = () => {
    document.documentElement.dataset.doing = "away";
    say(events.readyState === EventSource.CLOSED ? "The program does not answer. Load the page again when it runs." : "No connection to the program …");
  };
  events.onmessage = async (event) => {
    state = JSON.parse(event.data);
    if (state.picture == null) say(`${DOING[state.doing]} …`);
    tell(state);
    if (state.note) note(state.note);
    if (!known && state.picture) {
      known = await (await ask("/room")).json();
      $("name").textContent = document.title = known.name;
      $("program").textContent = `${known.program} · live`;
      view.room = known.room;
      view.controls = lamps(known, send);
    }
    // What another window changed.
    const changes = JSON.stringify(state.changes);
    if (view.controls && !sending && waiting == null && changes !== shown) {
      shown = changes;
      view.controls(state.changes);
    }
    view.want(state);
  };
}

/** What the program does, in words. */
function tell(state) {
  const last = state.rounds.at(-1);
  const { doing, relit, progress } = state;
  const error = relit ? relit.de2000 : state.fine ? state.file_de2000 : last?.de2000;
  const off = error == null ? "no error known yet" : `off by ΔE00 ${digits(error)} (estimate)`;
  $("doing").textContent = DOING[doing];
  $("doing").className = `badge ${doing === "done" ? (state.reached ? "good" : "warm") : ""}`;
  const what = !last ? "" : relit ? `Relit in ${digits(1000 * relit.first_s, 2)} ms${relit.whole_s ? `, whole after ${digits(1000 * relit.whole_s, 2)} ms` : ""}` : state.fine ? "The file" : `Round ${last.round}`;
  const how = last ? `${whole(last.patches)} patches after ${digits(last.elapsed_s)} s` : "";
  $("status").textContent = last
    ? `${what}: ${off}, asked for ${digits(state.asked_de2000, 2)}. ${how}.`
    : "The first light comes after the first round.";
  const bar = $("progress");
  const busy = !["done", "stopped"].includes(doing);
  bar.hidden = !busy;
  if (progress) [bar.max, bar.value] = [Math.max(1, progress[1]), progress[0]];
  else bar.removeAttribute("value");
  const changed = Object.keys(state.changes).length > 0;
  $("stop").disabled = !["solving", "gathering"].includes(doing);
  $("go").disabled = !(doing === "stopped" || (doing === "done" && relit));
  $("go").textContent = relit ? "Solve anew" : "Go on";
  $("save").disabled = !last || doing === "saving";
  $("expose").disabled = !last;
  $("undo").disabled = !changed;
  $("saved").textContent = state.saved ? `Saved: ${state.saved[0]}` : "";
  $("warnings").hidden = state.warnings.length === 0;
  $("warnings").querySelector("ul").replaceChildren(...state.warnings.map((w) => h("li", {}, w)));
  Object.assign(document.documentElement.dataset, { doing, rounds: state.rounds.length, saved: state.saved?.[1] ?? 0 });
}

/** The room on the screen, as new as the program tells. */
class View {
  constructor(ask, say) {
    Object.assign(this, { ask, say, stage: null, numbers: null, busy: false, wanted: null });
  }

  /** Takes up a state; where light is on its way already, afterwards. */
  async want(state) {
    this.wanted = state;
    if (this.busy || !this.room) return;
    this.busy = true;
    try {
      while (this.wanted) {
        const wanted = this.wanted;
        this.wanted = null;
        if (wanted.picture && `${wanted.picture}` !== `${this.numbers}`) await this.#catchUp();
        document.documentElement.dataset.light = this.numbers?.[2] ?? 0;
      }
    } catch (problem) {
      this.say(`The room cannot be drawn here (${problem.message}).`);
    } finally {
      this.busy = false;
    }
  }

  async #catchUp() {
    let bytes = null;
    while (!bytes) {
      const had = this.numbers ?? [0, 0];
      const answer = await this.ask("/light", `&mesh=${had[0]}&had=${had[1]}`);
      if (answer.status === 204) await this.#begin();
      else bytes = await answer.arrayBuffer();
    }
    const { numbers, lux } = grow(this.stage, bytes);
    this.numbers = numbers;
    this.#scale(lux);
    this.stage.pickAgain();
    this.say("");
    document.documentElement.dataset.ready = "yes";
  }

  /** Another mesh. */
  async #begin() {
    const answer = await this.ask("/mesh", "");
    const glb = await answer.arrayBuffer();
    if (this.stage) await this.stage.replace(glb);
    else await this.#open(glb);
    this.numbers = [Number(answer.headers.get("X-Mesh")), 0, 0];
  }

  async #open(glb) {
    const maps = { lux: luxScale(1, 100), error: { ...luxScale(1, 10), map: MAGMA } };
    const { room } = this;
    const card = pointCard(room);
    const picked = (spot) => this.#read(spot, card);
    const stage = (this.stage = await Stage.open($("canvas"), glb, { room }, { steps: [], last: 0 }, maps, picked));
    card(null);
    around(stage, LOOKS, { looked: () => {} });
  }

  /** What falls on a spot: its illuminance is here, the program knows the rest. */
  async #read(spot, card) {
    this.spot = spot;
    if (!spot) return card(null);
    const { lux, material, point: place, part, corners, weights } = spot;
    // Where the old reading stands it stays until the new one comes.
    if (!$("point").classList.contains("measured")) card({ lux, material, place });
    const share = weights.map((w) => Math.min(1, Math.max(0, w)));
    try {
      const answer = await this.ask("/point", `&mesh=${this.numbers[0]}&part=${part}&vertices=${corners}&weights=${share}`);
      // Another spot was asked for meanwhile, or there is another mesh: it is read again then.
      if (this.spot !== spot || answer.status === 204) return;
      const found = await answer.json();
      card({
        lux: found.xyz[1], xyz: found.xyz, material, place,
        error: found.error_de2000, errorIs: found.error_here ? "estimate" : "estimate, mean of the room",
        values: found.spectrum.map((x) => 1000 * x), note: "Light that falls on the surface.",
      });
    } catch (problem) {
      card({ lux, material, place, note: problem.message });
    }
  }

  /** Fits the scale of illuminance to where most of the light lies. */
  #scale(lux) {
    const step = Math.max(1, Math.floor(lux.length / SAMPLED));
    const some = lux.filter((x, k) => k % step === 0 && x > 0).sort((a, b) => a - b);
    const at = (share) => some[Math.floor(share * (some.length - 1))] ?? 1;
    const scale = luxScale(at(0.02), at(0.98));
    const text = `${scale.low} ${scale.high}`;
    if (this.scaled === text) return;
    this.scaled = text;
    this.stage.setScale(scale);
    $("legends").replaceChildren(legend(VIRIDIS, "Illuminance (lux)", scale, "on the surfaces, logarithmic"));
  }
}
