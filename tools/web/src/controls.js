// Moving about: around the room (orbit) or in it (walk), by mouse, fingers or keys. Tells `changed` of every move.

import { MathUtils, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);
/** Radians for each pixel dragged, for each key press and each second a key is held. */
const DRAG = 0.005;
const PRESS = 0.06;
const TURN = 1.2;
/** Metres a second on foot; in tall or tiny rooms a share of the room's size. */
const PACE = 0.35;
const STEEPEST = 1.53;
const CLICK_PIXELS = 6;

export class Controls {
  constructor(camera, element, size, changed, picked) {
    Object.assign(this, { camera, element, size, changed, picked });
    this.target = new Vector3();
    this.walking = false;
    this.keys = new Set();
    this.fingers = new Map();
    element.addEventListener("pointerdown", (e) => this.#down(e));
    element.addEventListener("pointermove", (e) => this.#move(e));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, (e) => this.#up(e));
    element.addEventListener("wheel", (e) => {
      // Until the picture is clicked the wheel is the page's.
      if (document.activeElement !== element) return;
      e.preventDefault();
      this.zoom(Math.exp(0.0012 * e.deltaY));
    }, { passive: false });
    element.addEventListener("keydown", (e) => this.#key(e));
    element.addEventListener("keyup", (e) => this.keys.delete(e.code));
    element.addEventListener("blur", () => this.keys.clear());
  }

  /** Looks from a place in a direction; `distance` to what is turned around. */
  look(place, direction, distance, walking) {
    this.yaw = Math.atan2(-direction.x, -direction.z);
    this.pitch = Math.asin(MathUtils.clamp(direction.y / direction.length(), -1, 1));
    this.distance = distance;
    this.walking = walking;
    this.target.copy(place).addScaledVector(this.#forward(), walking ? 0 : distance);
    this.apply();
  }

  setWalking(walking) {
    if (walking === this.walking) return;
    const place = this.camera.position.clone();
    this.look(place, this.#forward(), Math.max(this.distance, 0.3 * this.size), walking);
  }

  #forward() {
    const flat = Math.cos(this.pitch);
    return new Vector3(-Math.sin(this.yaw) * flat, Math.sin(this.pitch), -Math.cos(this.yaw) * flat);
  }

  apply() {
    this.pitch = MathUtils.clamp(this.pitch, -STEEPEST, STEEPEST);
    const forward = this.#forward();
    this.camera.position.copy(this.target).addScaledVector(forward, this.walking ? 0 : -this.distance);
    this.camera.up.copy(UP);
    this.camera.lookAt(this.camera.position.clone().add(forward));
    this.changed();
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch += pitch;
    this.apply();
  }

  /** Nearer (below 1) or farther. */
  zoom(factor) {
    if (this.walking) this.go(0, 0, -Math.log(factor) * 0.5 * this.size * PACE * 2);
    else {
      this.distance = MathUtils.clamp(this.distance * factor, 0.02 * this.size, 8 * this.size);
      this.apply();
    }
  }

  /** Right, up, ahead; on the level. */
  go(right, up, ahead) {
    const forward = new Vector3(-Math.sin(this.yaw), 0, -Math.cos(this.yaw));
    const side = new Vector3().crossVectors(forward, UP);
    this.target.addScaledVector(side, right).addScaledVector(UP, up).addScaledVector(forward, ahead);
    this.apply();
  }

  #down(event) {
    this.element.focus({ preventScroll: true });
    this.element.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    this.still = this.fingers.size === 1 ? [event.clientX, event.clientY] : null;
  }

  #move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (this.still && Math.hypot(now[0] - this.still[0], now[1] - this.still[1]) > CLICK_PIXELS) this.still = null;
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    const pixels = this.size / this.element.clientHeight;
    if (this.fingers.size === 2) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      this.fingers.set(event.pointerId, now);
      this.go(-0.5 * dx * pixels, 0.5 * dy * pixels, 0);
      this.zoom(gap(before) / gap(now));
      return;
    }
    this.fingers.set(event.pointerId, now);
    if (this.still) return;
    if (event.buttons & 6 || event.shiftKey) this.go(-dx * pixels, dy * pixels, 0);
    // In the room one takes hold of the picture, outside of the room itself: both follow the finger.
    else this.turn(this.walking ? DRAG * dx : -DRAG * dx, this.walking ? DRAG * dy : -DRAG * dy);
  }

  #up(event) {
    if (!this.fingers.delete(event.pointerId) || event.type === "pointercancel") return;
    if (this.still && event.button === 0) this.picked(event.clientX, event.clientY);
    this.still = null;
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!this.does(event.code)) return;
    event.preventDefault();
    this.hold(event.code);
  }

  does(code) {
    return /^(Arrow|Page(Up|Down)$|Key[WASDQE]$|Minus$|Equal$|Numpad(Add|Subtract)$)/.test(code);
  }

  /** A key or button goes down: one step at once, and on while it is held. */
  hold(code) {
    if (this.keys.has(code)) return;
    this.keys.add(code);
    this.#step(code, PRESS / TURN);
    if (this.moving) return;
    this.moving = true;
    let last = performance.now();
    const tick = (now) => {
      const seconds = Math.min(0.1, (now - last) / 1000);
      last = now;
      for (const key of this.keys) this.#step(key, seconds);
      this.moving = this.keys.size > 0;
      if (this.moving) requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  release(code) {
    this.keys.delete(code);
  }

  #step(code, seconds) {
    const [turn, walk] = [TURN * seconds, PACE * this.size * seconds];
    const keys = {
      ArrowLeft: () => this.turn(turn, 0),
      ArrowRight: () => this.turn(-turn, 0),
      ArrowUp: () => (this.walking ? this.go(0, 0, walk) : this.turn(0, -turn)),
      ArrowDown: () => (this.walking ? this.go(0, 0, -walk) : this.turn(0, turn)),
      KeyW: () => this.go(0, 0, walk),
      KeyS: () => this.go(0, 0, -walk),
      KeyA: () => this.go(-walk, 0, 0),
      KeyD: () => this.go(walk, 0, 0),
      KeyE: () => this.go(0, walk, 0),
      KeyQ: () => this.go(0, -walk, 0),
      PageUp: () => this.turn(0, turn),
      PageDown: () => this.turn(0, -turn),
      Equal: () => this.zoom(Math.exp(-turn)),
      NumpadAdd: () => this.zoom(Math.exp(-turn)),
      Minus: () => this.zoom(Math.exp(turn)),
      NumpadSubtract: () => this.zoom(Math.exp(turn)),
    };
    keys[code]();
  }
}
