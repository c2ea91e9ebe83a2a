// The room on the screen: light, illuminance and error as pictures of the same meshes. Drawn when something changes.

import {
  Box3, DataTexture, LinearFilter, Matrix3, Matrix4, PerspectiveCamera, Raycaster, Scene, ShaderMaterial, SRGBColorSpace, Vector2,
  Vector3, WebGLRenderer, BufferAttribute, Triangle,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Controls } from "./controls.js";
import { displayed } from "./layers.js";
import { table } from "./maps.js";

const TICKS = 24;

/** Ends of a scale and where its lines are, for the shader. */
function measured(scale, log) {
  const lines = scale.ticks.map((t) => (log ? Math.log10(t) : t)).slice(0, TICKS);
  const [low, high] = [scale.low, scale.high].map((x) => (log ? Math.log10(x) : x));
  return { range: new Vector2(low, high), lines: [...lines, ...Array(TICKS - lines.length).fill(1e9)] };
}

/** Values at vertices through a colour map, by pixel, with lines of equal value. */
function falseColour(attribute, map, scale, log, own) {
  const { range, lines } = measured(scale, log);
  const texture = new DataTexture(table(map), 256, 1);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  const mask = own.alphaTest > 0 && own.map;
  if (mask) own.map.updateMatrix();
  return new ShaderMaterial({
    side: own.side,
    uniforms: {
      map: { value: texture },
      range: { value: range },
      lines: { value: lines },
      contour: { value: log ? 1 : 0 },
      cut: { value: mask ? own.map : null },
      cutMatrix: { value: mask ? own.map.matrix : new Matrix3() },
      cutBelow: { value: own.alphaTest },
    },
    vertexShader: `
      attribute float ${attribute};
      varying float value;
      ${mask ? "varying vec2 place; uniform mat3 cutMatrix;" : ""}
      void main() {
        value = ${attribute};
        ${mask ? "place = (cutMatrix * vec3(uv, 1.0)).xy;" : ""}
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      }`,
    fragmentShader: `
      uniform sampler2D map; uniform vec2 range; uniform float lines[${TICKS}]; uniform float contour;
      ${mask ? "varying vec2 place; uniform sampler2D cut; uniform float cutBelow;" : ""}
      varying float value;
      void main() {
        ${mask ? "if (texture2D(cut, place).a < cutBelow) discard;" : ""}
        float v = ${log ? "log2(max(value, 1e-9)) * 0.30103" : "value"};
        float t = clamp((v - range.x) / (range.y - range.x), 0.0, 1.0);
        vec3 shown = texture2D(map, vec2((t * 255.0 + 0.5) / 256.0, 0.5)).rgb;
        float width = max(fwidth(v), 1e-6);
        float near = 1e9;
        for (int k = 0; k < ${TICKS}; k += 1) near = min(near, abs(v - lines[k]));
        float line = contour * (1.0 - smoothstep(0.4, 1.1, near / width)) * step(width, 0.02 * (range.y - range.x));
        gl_FragColor = vec4(mix(shown, vec3(t > 0.55 ? 0.0 : 1.0), 0.55 * line), 1.0);
      }`,
  });
}

export class Stage {
  static async open(canvas, glb, data, light, maps, picked) {
    const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    renderer.outputColorSpace = SRGBColorSpace;
    const gltf = await new GLTFLoader().parseAsync(glb, "");
    return new Stage(canvas, renderer, gltf, data, light, maps, picked);
  }

  constructor(canvas, renderer, gltf, data, light, maps, picked) {
    Object.assign(this, { canvas, renderer, light, maps, picked });
    this.scene = new Scene();
    this.scene.add(gltf.scene);
    this.scene.updateMatrixWorld(true);
    this.parts = [];
    this.view = "light";
    this.foot = 0;
    this.step = light.last;
    this.#attach(gltf);
    this.box = new Box3().setFromObject(this.scene);
    this.size = this.box.getSize(new Vector3()).length() || 1;
    this.camera = new PerspectiveCamera(50, 1, 2e-4 * this.size, 12 * this.size);
    const pick = (x, y) => this.pick(x, y);
    this.controls = new Controls(this.camera, canvas, this.size, () => this.draw(), pick);
    this.views = [...data.room.views.map((v) => this.#viewOf(v)), this.#overview()];
    this.goTo(0);
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** Finds the vertices of each mesh among those of the planes: in the order of the file's primitives with light. */
  #attach(gltf) {
    const { maps } = this;
    const first = new Map();
    const layers = gltf.asset.extras?.haarlight?.layers;
    this.scale = layers?.scale ?? 1;
    let next = 0;
    // Other scenes of the file were not baked.
    const shown = new Set();
    gltf.scene.traverse((mesh) => mesh.isMesh && shown.add(gltf.parser.associations.get(mesh)?.meshes));
    (gltf.parser.json.meshes ?? []).forEach((mesh, m) =>
      mesh.primitives.forEach((primitive, p) => {
        if (!shown.has(m)) return;
        const unlit = gltf.parser.json.materials?.[primitive.material]?.extensions?.KHR_materials_unlit;
        if (!unlit || primitive.attributes.COLOR_0 === undefined || (primitive.mode ?? 4) !== 4) return;
        first.set(`${m} ${p}`, { at: next, glows: this.light.index?.glows[first.size] });
        next += gltf.parser.json.accessors[primitive.attributes.POSITION].count;
      }),
    );
    if (this.light.index && next !== this.light.count) throw new Error(`${next} vertices in the room, ${this.light.count} in its light`);
    gltf.scene.traverse((mesh) => {
      const place = mesh.isMesh && gltf.parser.associations.get(mesh);
      const own = place && first.get(`${place.meshes} ${place.primitives}`);
      if (!own) return;
      const { at, glows } = own;
      const { geometry, material } = mesh;
      const count = geometry.attributes.position.count;
      geometry.setAttribute("error", new BufferAttribute(this.light.error?.slice(at, at + count) ?? new Float32Array(count), 1));
      geometry.setAttribute("lux", new BufferAttribute(new Float32Array(count), 1));
      const colour = geometry.attributes.color;
      this.parts.push({
        mesh, at, count, glows, name: material.name,
        layers: (layers?.names ?? []).map(({ attribute }) => geometry.attributes[attribute.toLowerCase()]),
        file: colour && Float32Array.from({ length: 3 * count }, (_, k) => colour.getComponent(Math.floor(k / 3), k % 3)),
        looks: {
          light: material,
          lux: falseColour("lux", maps.lux.map, maps.lux, true, material),
          error: falseColour("error", maps.error.map, maps.error, false, material),
        },
      });
    });
    if (this.light.index) this.show(this.step);
  }

  /** Shows another file from where one looks now. */
  async replace(glb) {
    const gltf = await new GLTFLoader().parseAsync(glb, "");
    for (const part of this.parts) part.mesh.geometry.dispose();
    this.scene.clear();
    this.scene.add(gltf.scene);
    this.scene.updateMatrixWorld(true);
    this.parts = [];
    this.#attach(gltf);
  }

  /** Another scale of illuminance. */
  setScale(scale) {
    this.maps.lux = scale;
    const { range, lines } = measured(scale, true);
    for (const part of this.parts) {
      part.looks.lux.uniforms.range.value = range;
      part.looks.lux.uniforms.lines.value = lines;
    }
    this.draw();
  }

  /** Shows the light of a step. */
  show(step) {
    this.step = step;
    for (const part of this.parts) {
      const { color, lux } = part.mesh.geometry.attributes;
      lux.array.set((this.light.lux?.(step) ?? this.light.steps[step].lux).subarray(part.at, part.at + part.count));
      lux.needsUpdate = true;
      if (!color) continue;
      if (step === this.light.last && this.#dim(part, color)) continue;
      if (part.glows && !part.layers.length) continue;
      const ratio = step === this.light.last ? null : this.light.ratios(step, part.at, part.count);
      for (let i = 0; i < part.count; i += 1)
        for (let c = 0; c < 3; c += 1) color.setComponent(i, c, part.file[3 * i + c] * (ratio && !part.glows ? ratio[3 * i + c] : 1));
      color.needsUpdate = true;
    }
    this.draw();
  }

  /** Colours under dimmed layers; false where none are. */
  #dim({ count, layers }, color) {
    const { factors } = this.light;
    if (!factors || !layers.every(Boolean) || layers.length !== factors.length) return false;
    for (let i = 0; i < count; i += 1) {
      const sum = [0, 1, 2].map((c) => this.scale * layers.reduce((all, set, k) => all + factors[k] * set.getComponent(i, c), 0));
      displayed(sum).forEach((x, c) => color.setComponent(i, c, x));
    }
    color.needsUpdate = true;
    return true;
  }

  setView(view) {
    this.view = view;
    this.draw();
  }

  /** Multiplies the picture of the light. */
  setBrightness(factor) {
    for (const part of this.parts) part.looks.light.color?.setScalar(factor);
    this.draw();
  }

  setContours(on) {
    for (const part of this.parts) part.looks.lux.uniforms.contour.value = on ? 1 : 0;
    this.draw();
  }

  #viewOf(view) {
    const matrix = new Matrix4().fromArray(view.matrix);
    const place = new Vector3().setFromMatrixPosition(matrix);
    const direction = new Vector3(0, 0, -1).transformDirection(matrix);
    const inside = this.box.containsPoint(place);
    const centre = this.box.getCenter(new Vector3());
    const ahead = Math.max(0.1 * this.size, centre.clone().sub(place).dot(direction));
    const angle = view.perspective ? view.size : 0.8;
    if (!view.perspective) place.addScaledVector(direction, -view.size / Math.tan(angle / 2) + ahead);
    return { name: view.name || "Camera", place, direction, distance: ahead, inside, angle, aspect: view.aspect ?? 4 / 3 };
  }

  #overview() {
    const centre = this.box.getCenter(new Vector3());
    const direction = new Vector3(-0.5, -0.55, -0.75).normalize();
    const angle = 0.7;
    const distance = (0.5 * this.size) / Math.sin(angle / 2);
    return { name: "From above", place: centre.clone().addScaledVector(direction, -distance), direction, distance, inside: false, angle, aspect: 1 };
  }

  goTo(index) {
    const view = this.views[index];
    Object.assign(this, { angle: view.angle, aspect: view.aspect });
    this.controls.look(view.place, view.direction, view.distance, view.inside);
  }

  /** Where pictures go on the canvas: x, y from below, width, height, look. */
  #panes(width, whole) {
    // What the legends cover stays free.
    const foot = Math.min(this.foot, 0.4 * whole);
    const height = whole - foot;
    if (this.view !== "both") return [[0, foot, width, height, this.view]];
    return width >= height
      ? [[0, foot, width / 2, height, "lux"], [width / 2, foot, width / 2, height, "error"]]
      : [[0, foot + height / 2, width, height / 2, "lux"], [0, foot, width, height / 2, "error"]];
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.drawNow();
    });
  }

  drawNow() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return;
    const { renderer } = this;
    renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    const size = renderer.getSize(new Vector2());
    if (size.x !== width || size.y !== height) renderer.setSize(width, height, false);
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    for (const [x, y, w, h, look] of this.#panes(width, height)) {
      renderer.setViewport(x, y, w, h);
      renderer.setScissor(x, y, w, h);
      // Narrow pictures keep the width that the view was made for.
      const tan = Math.tan(this.angle / 2) * Math.max(1, this.aspect / (w / h));
      this.camera.fov = Math.min(110, (360 / Math.PI) * Math.atan(tan));
      this.camera.aspect = w / h;
      this.camera.updateProjectionMatrix();
      for (const part of this.parts) part.mesh.material = part.looks[look];
      renderer.render(this.scene, this.camera);
    }
    this.onDrawn?.();
  }

  /** The surface at a place of the window; the middle of the picture if none is given. */
  pick(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    const panes = this.#panes(box.width, box.height);
    let [x, y] = clientX === undefined ? [panes[0][2] / 2, panes[0][3] / 2] : [clientX - box.left, box.bottom - clientY];
    const pane = panes.find(([px, py, w, h]) => x >= px && x <= px + w && y >= py && y <= py + h) ?? panes[0];
    if (clientX === undefined) [x, y] = [pane[0] + pane[2] / 2, pane[1] + pane[3] / 2];
    const at = new Vector2((2 * (x - pane[0])) / pane[2] - 1, (2 * (y - pane[1])) / pane[3] - 1);
    this.camera.aspect = pane[2] / pane[3];
    this.camera.updateProjectionMatrix();
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    return this.#meet(ray);
  }

  /** Reads the picked spot again, in other light or on another mesh. */
  pickAgain() {
    if (this.again) this.#meet(this.again);
  }

  #meet(ray) {
    for (const part of this.parts) part.mesh.material = part.looks.light;
    const meshes = new Map(this.parts.map((part) => [part.mesh, part]));
    const hit = ray.intersectObjects([...meshes.keys()], false)[0];
    if (!hit) {
      this.spot = this.again = null;
      this.draw();
      return this.picked(null);
    }
    const part = meshes.get(hit.object);
    const corners = [hit.face.a, hit.face.b, hit.face.c];
    const position = hit.object.geometry.attributes.position;
    const places = corners.map((c) => new Vector3().fromBufferAttribute(position, c));
    const local = hit.object.worldToLocal(hit.point.clone());
    const weights = Triangle.getBarycoord(local, ...places, new Vector3())?.toArray() ?? [1, 0, 0];
    this.spot = hit.point.clone();
    // From close before the spot: another mesh lies elsewhere by its rounding.
    const { direction } = ray.ray;
    this.again = new Raycaster(hit.point.clone().addScaledVector(direction, -1e-3 * this.size), direction.clone());
    this.draw();
    const { lux } = hit.object.geometry.attributes;
    return this.picked({
      vertices: corners.map((c) => c + part.at),
      weights,
      part: [...this.parts].sort((a, b) => a.at - b.at).indexOf(part),
      corners,
      lux: corners.reduce((sum, c, i) => sum + weights[i] * lux.getX(c), 0),
      point: hit.point.toArray(),
      material: part.name,
    });
  }

  /** Where the picked spot is in each picture, pixels from the canvas's upper left corner. */
  spots() {
    if (!this.spot) return [];
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    return this.#panes(width, height).flatMap(([x, y, w, h]) => {
      this.camera.aspect = w / h;
      this.camera.updateProjectionMatrix();
      const p = this.spot.clone().project(this.camera);
      if (p.z > 1 || Math.abs(p.x) > 1 || Math.abs(p.y) > 1) return [];
      return [[x + ((p.x + 1) / 2) * w, height - y - ((p.y + 1) / 2) * h]];
    });
  }
}
