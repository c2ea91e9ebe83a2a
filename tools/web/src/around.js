// Around the picture: what is shown, how to move, from where, and by which keys. Reports and live pages have it alike.

import { $, choice, h } from "./dom.js";
import { pad } from "./pad.js";

const MOVES = [["orbit", "Orbit"], ["walk", "Walk"]];

/**
 * Sets up the controls of a stage. `looks`: pictures with their names; `looked` is called when one is chosen, `allowed` says
 * which of them keys may choose, `keys` are further keys by name. A function that chooses a picture.
 */
export function around(stage, looks, { looked, allowed = () => true, keys = {} }) {
  const look = (view) => {
    check(view);
    $("legends").hidden = view === "light";
    looked(view);
    stage.setView(view);
  };
  const check = choice($("looks"), "look", looks, look);
  const walk = (on) => {
    checkMove(on ? "walk" : "orbit");
    stage.controls.setWalking(on);
    $("picture").classList.toggle("walking", on);
  };
  const checkMove = choice($("moves"), "move", MOVES, (value) => walk(value === "walk"));
  $("views").append(...stage.views.map((view, k) => h("option", { value: k }, view.name)));
  $("views").addEventListener("change", () => {
    stage.goTo(Number($("views").value));
    walk(stage.controls.walking);
  });
  $("canvas").addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const view = looks[Number(event.key) - 1]?.[0];
    if (view && allowed(view)) look(view);
    else if (event.key === "Enter") stage.pick();
    else if (keys[event.key]) keys[event.key]();
    else return;
    event.preventDefault();
  });
  stage.onDrawn = () =>
    $("marks").replaceChildren(...stage.spots().map(([x, y]) => h("i", { style: `left:${x}px;top:${y}px` })));
  pad(stage.controls);
  look("light");
  walk(stage.controls.walking);
  return look;
}
