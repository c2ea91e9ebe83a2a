// Walking with fingers.

import { $, h } from "./dom.js";

/** Buttons to walk with fingers. */
export function pad(controls) {
  const keys = [["ArrowLeft", "↶", "Turn left"], ["ArrowUp", "↑", "Forward"], ["ArrowRight", "↷", "Turn right"],
    ["KeyA", "←", "Left"], ["ArrowDown", "↓", "Back"], ["KeyD", "→", "Right"]];
  $("pad").append(...keys.map(([code, sign, name]) => h("button", {
    type: "button", "aria-label": name,
    onpointerdown: (e) => (e.preventDefault(), controls.hold(code)),
    onpointerup: () => controls.release(code),
    onpointerleave: () => controls.release(code),
    onpointercancel: () => controls.release(code),
    onkeydown: (e) => ["Enter", " "].includes(e.key) && (e.preventDefault(), controls.hold(code)),
    onkeyup: () => controls.release(code),
    onblur: () => controls.release(code),
    oncontextmenu: (e) => e.preventDefault(),
  }, sign)));
}
