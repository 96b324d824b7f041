// Moving about: orbit around what is under the pointer, walk, look from above, stand in a camera.
// The frame is the page's: metres, +Y up.

import * as THREE from 'three';

const kUp = new THREE.Vector3(0, 1, 0);
const kMaxPitch = 89.5 * Math.PI / 180;
const kFov = 60;     // degrees, of the shorter side of the picture
const kClickPx = 4;  // a pointer that moved less has clicked
const kMinDistance = 0.05;

const reducedMotion = matchMedia('(prefers-reduced-motion: reduce)');

export class Navigation extends EventTarget {
  // canvas takes pointer and keys; cast(ray) gives {distance, point} | null; floor() a height.
  // heading() that of the walls; sample() gives {room, cameras}, points.
  constructor(canvas, {cast, floor, heading, sample, invalidate}) {
    super();
    this.canvas = canvas;
    this.cast = cast;
    this.floor = floor;
    this.heading = heading;
    this.sample = sample;
    this.invalidate = invalidate;
    this.perspective = new THREE.PerspectiveCamera(kFov, 1, 0.02, 500);
    this.orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, -500, 500);
    this.camera = this.perspective;
    this.mode = 'orbit';   // 'orbit' | 'walk' | 'top'
    this.standing = null;  // of a photo: {fov of the smaller half-angle ...}
    this.eyeHeight = 1.6;
    this.speed = 1.4;  // metres a second
    this.bounds = new THREE.Box3();
    this.keys = new Set();
    this.pointers = new Map();
    this.flight = null;
    this.motionUntil = 0;
    this.#listen();
  }

  setBounds(box) {
    this.bounds = box;
    const size = box.getSize(new THREE.Vector3()).length();
    this.perspective.far = Math.max(50, 6 * size);
    this.perspective.near = Math.max(0.01, size / 2000);
  }
  get size() {
    return Math.max(this.bounds.getSize(new THREE.Vector3()).length(), 0.1);
  }
  get moving() {
    return this.flight !== null || performance.now() < this.motionUntil;
  }

  resize(width, height) {
    this.width = width;
    this.height = height;
    this.perspective.aspect = width / height;
    this.#applyFov();
    const half = (this.orthographic.top - this.orthographic.bottom) / 2;
    this.orthographic.left = -half * width / height;
    this.orthographic.right = half * width / height;
    this.orthographic.updateProjectionMatrix();
    this.invalidate();
  }

  // The vertical field of view that shows what is to be seen in this shape of picture.
  #applyFov() {
    const aspect = this.perspective.aspect || 1;
    if (this.standing) {
      const {tanX, tanY} = this.standing;
      const tan = Math.max(tanY, tanX / aspect) * this.standing.zoom;
      this.perspective.fov = 2 * Math.atan(tan) * 180 / Math.PI;
    } else {
      this.perspective.fov = 2 * Math.atan(this.#freeLens().tan) * 180 / Math.PI;
    }
    this.perspective.updateProjectionMatrix();
  }

  #freeLens() {
    const aspect = this.perspective.aspect || 1;
    return {aspect, tan: Math.tan(kFov * Math.PI / 360) / Math.max(Math.min(aspect, 1), 0.4)};
  }

  // --- points of view -------------------------------------------------------------------------

  // {mode, position, quaternion, height (of an orthographic picture, metres)}.
  get view() {
    return {
      mode: this.mode,
      position: this.camera.position.clone(),
      quaternion: this.camera.quaternion.clone(),
      height: (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom,
    };
  }

  // Goes there at once.
  setView({mode, position, quaternion, height}) {
    this.#endFlight();
    this.leaveCamera();
    this.#switchMode(mode);
    this.camera.position.copy(position);
    this.camera.quaternion.copy(quaternion);
    if (mode === 'top' && height > 0) this.#setOrthographicHeight(height);
    this.moved();
  }

  // The whole room from above one of its corners, as large as it fits.
  home(fly = true) {
    this.leaveCamera();
    if (this.mode !== 'orbit') this.#switchMode('orbit');
    const rotation = rotationOf(this.heading() + 0.62, -0.68);
    const position = this.#framing(rotation);
    if (fly) return this.flyTo(position, rotation);
    this.perspective.position.copy(position);
    this.perspective.quaternion.copy(rotation);
    this.moved();
  }
  // From where a camera turned so sees all of the room, but for the few strays beyond it.
  #framing(rotation) {
    const {tan, aspect} = this.#freeLens();
    const inverse = rotation.clone().invert();
    const turned = (points) => points.map((p) => p.clone().applyQuaternion(inverse));
    const {room, cameras} = this.sample();
    const points = turned(room), all = turned(cameras);
    // Of the planes through the borders of the picture each has all points on one side: where they
    // meet, the eye is. u = x or y, depth -z: u <= eye + t (eye_z - z), so eye_z >= ...
    const bound = (values) => values.sort((a, b) => a - b)[Math.floor(0.999 * (values.length - 1))];
    const side = (k, t) => {
      const reach = (sign) => {
        const of = (p) => sign * p.getComponent(k) + t * p.z;
        return Math.max(bound(points.map(of)), ...all.map(of));
      };
      const high = reach(1), low = reach(-1);
      return {middle: (high - low) / 2, back: (high + low) / (2 * t)};
    };
    const x = side(0, 0.93 * tan * aspect), y = side(1, 0.9 * tan);
    return new THREE.Vector3(x.middle, y.middle, Math.max(x.back, y.back))
        .applyQuaternion(rotation);
  }

  #frameFromAbove(rotation) {
    const inverse = rotation.clone().invert();
    const points = this.sample().room.map((p) => p.applyQuaternion(inverse));
    const extent = (k) => {
      const values = points.map((p) => p.getComponent(k)).sort((a, b) => a - b);
      const stray = Math.floor(0.001 * values.length);
      return [values[stray] ?? -1, values[values.length - 1 - stray] ?? 1];
    };
    const [left, right] = extent(0), [bottom, top] = extent(1);
    this.orthographic.position.set((left + right) / 2, (bottom + top) / 2, 0)
        .applyQuaternion(rotation);
    this.orthographic.quaternion.copy(rotation);
    this.#setOrthographicHeight(
        1.16 * Math.max(top - bottom, (right - left) * this.height / this.width, 0.1));
  }

  setMode(mode, fly = true) {
    if (mode === this.mode && !this.standing) return;
    const before = this.camera;
    this.leaveCamera();
    this.#switchMode(mode);
    if (mode === 'top') {
      // Along the walls; what was ahead stays ahead, to the nearest quarter turn.
      const heading = this.heading(), quarter = Math.PI / 2;
      const turns = Math.round((yawPitch(before.quaternion)[0] - heading) / quarter);
      const yaw = heading + turns * quarter;
      this.#frameFromAbove(rotationOf(yaw, -Math.PI / 2));
    } else if (before === this.orthographic) {
      const yaw = yawPitch(before.quaternion)[0];
      if (mode === 'orbit') {
        this.home(fly);
      } else {
        this.perspective.position.copy(before.position);
        this.perspective.quaternion.copy(rotationOf(yaw, 0));
      }
    }
    if (mode === 'walk') {
      // From where one is, unless that is far outside.
      const near = this.bounds.clone().expandByScalar(2).containsPoint(this.perspective.position);
      const position =
          near ? this.perspective.position.clone() : this.bounds.getCenter(new THREE.Vector3());
      position.y = this.floor() + this.eyeHeight;
      const yaw = yawPitch(this.perspective.quaternion)[0];
      if (fly) {
        this.flyTo(position, rotationOf(yaw, 0));
      } else {
        this.perspective.position.copy(position);
      }
    }
    this.moved();
  }

  #switchMode(mode) {
    this.#endFlight();  // it would move the other camera from now on
    this.mode = mode;
    this.camera = mode === 'top' ? this.orthographic : this.perspective;
    this.dispatchEvent(new Event('mode'));
  }
  #setOrthographicHeight(height) {
    const half = height / 2;
    Object.assign(this.orthographic, {
      top: half,
      bottom: -half,
      zoom: 1,
      left: -half * this.width / this.height,
      right: half * this.width / this.height,
    });
    this.orthographic.updateProjectionMatrix();
  }

  setEyeHeight(height) {
    this.eyeHeight = height;
    if (this.mode !== 'walk' || this.standing) return;
    this.perspective.position.y = this.floor() + height;
    this.moved();
  }

  // Stands where a photo was taken. lens: {tanX, tanY}, tangents of its half angles.
  standIn(position, quaternion, lens, done) {
    if (this.mode === 'top') this.#switchMode('orbit');
    this.flyTo(position, quaternion, lens, done);
  }
  leaveCamera() {
    if (!this.standing) return;
    this.standing = null;
    this.#applyFov();
    this.dispatchEvent(new Event('leave'));
    this.invalidate();
  }

  flyTo(position, quaternion, lens = null, done = () => {}) {
    this.#endFlight();
    const from = {
      position: this.camera.position.clone(),
      quaternion: this.camera.quaternion.clone(),
      tan: Math.tan(this.perspective.fov * Math.PI / 360)
    };
    this.standing = lens ? {...lens, zoom: 1} : null;
    this.#applyFov();
    const tan = Math.tan(this.perspective.fov * Math.PI / 360);
    const distance = from.position.distanceTo(position);
    const seconds = reducedMotion.matches || this.camera === this.orthographic ?
        0 :
        Math.min(1.4, 0.5 + 0.12 * distance);
    const started = performance.now();
    this.flight = () => {
      const t = seconds > 0 ? Math.min((performance.now() - started) / (1000 * seconds), 1) : 1;
      const s = t * t * (3 - 2 * t);
      this.camera.position.lerpVectors(from.position, position, s);
      this.camera.quaternion.slerpQuaternions(from.quaternion, quaternion, s);
      this.perspective.fov = 2 * Math.atan(from.tan + (tan - from.tan) * s) * 180 / Math.PI;
      this.perspective.updateProjectionMatrix();
      if (t < 1) return;
      this.flight = null;
      this.#applyFov();
      this.moved();
      done();
    };
    if (seconds === 0) this.flight();
    this.invalidate();
  }
  #endFlight() {
    this.flight = null;
    this.#applyFov();
  }

  // Before every picture; seconds since the last one. Gives whether it goes on.
  step(seconds) {
    if (this.flight) {
      this.flight();
      return this.flight !== null;
    }
    return this.#walkByKeys(seconds);
  }

  moved() {
    this.motionUntil = performance.now() + 200;
    this.dispatchEvent(new Event('move'));
    this.invalidate();
  }

  // --- rays -----------------------------------------------------------------------------------

  // Of a place in the canvas, CSS pixels from its upper left corner.
  rayAt(x, y) {
    this.camera.updateMatrixWorld();
    const caster = new THREE.Raycaster();
    caster.setFromCamera(
        new THREE.Vector2(2 * x / this.width - 1, 1 - 2 * y / this.height), this.camera);
    if (this.camera === this.orthographic) {
      caster.ray.origin.addScaledVector(caster.ray.direction, -2 * this.size);
    }
    return caster.ray;
  }
  #pivotInView() {
    const ray = this.rayAt(this.width / 2, this.height / 2);
    return this.cast(ray)?.point ?? ray.at(this.size / 3, new THREE.Vector3());
  }

  // --- moves ----------------------------------------------------------------------------------

  orbit(pivot, yaw, pitch) {
    this.#straighten();
    const camera = this.perspective;
    const [oldYaw, oldPitch] = yawPitch(camera.quaternion);
    const newPitch = THREE.MathUtils.clamp(oldPitch + pitch, -kMaxPitch, kMaxPitch);
    const before = rotationOf(oldYaw, oldPitch), after = rotationOf(oldYaw + yaw, newPitch);
    const offset =
        camera.position.clone().sub(pivot).applyQuaternion(before.invert()).applyQuaternion(after);
    camera.position.copy(pivot).add(offset);
    camera.quaternion.copy(after);
    this.moved();
  }
  look(yaw, pitch) {
    this.orbit(this.perspective.position.clone(), yaw, pitch);
  }
  // right and up in metres.
  pan(right, up) {
    this.#straighten();
    this.camera.position.add(
        new THREE.Vector3(right, up, 0).applyQuaternion(this.camera.quaternion));
    this.moved();
  }
  // steps > 0: nearer, to the point under the place in the canvas.
  zoom(x, y, steps) {
    if (this.standing) {
      this.standing.zoom = THREE.MathUtils.clamp(this.standing.zoom * 0.9 ** steps, 0.05, 1.5);
      this.#applyFov();
      return this.moved();
    }
    const factor = 0.88 ** steps;
    if (this.camera === this.orthographic) {
      const before = this.rayAt(x, y).origin;
      this.orthographic.zoom = THREE.MathUtils.clamp(this.orthographic.zoom / factor, 0.05, 500);
      this.orthographic.updateProjectionMatrix();
      this.orthographic.position.add(before.sub(this.rayAt(x, y).origin));
      return this.moved();
    }
    const ray = this.rayAt(x, y);
    const hit = this.cast(ray);
    const distance = Math.max(hit?.distance ?? this.size / 4, kMinDistance);
    const step = distance * (1 - factor);
    if (steps > 0 && distance - step < kMinDistance) return;
    this.camera.position.addScaledVector(ray.direction, step);
    this.moved();
  }

  #straighten() {
    if (this.flight) this.#endFlight();
    if (!this.standing && this.camera !== this.perspective) return;
    this.leaveCamera();
    if (this.camera !== this.perspective) return;
    const [yaw, pitch] = yawPitch(this.perspective.quaternion);
    this.perspective.quaternion.copy(rotationOf(yaw, pitch));
  }

  #walkByKeys(seconds) {
    if (this.keys.size === 0 || this.camera !== this.perspective) return false;
    const has = (...codes) => codes.some((code) => this.keys.has(code));
    const forward = has('KeyW', 'ArrowUp') - has('KeyS', 'ArrowDown');
    const right = has('KeyD') - has('KeyA');
    const up = has('KeyE', 'PageUp') - has('KeyQ', 'PageDown');
    const turn = has('ArrowLeft') - has('ArrowRight');
    if (!forward && !right && !up && !turn) return false;
    this.#straighten();
    if (turn) this.look(turn * 1.2 * seconds, 0);
    const run = has('ShiftLeft', 'ShiftRight') ? 3 : 1;
    const step = seconds * this.speed * run;
    const [yaw] = yawPitch(this.perspective.quaternion);
    const level = new THREE.Vector3(right, 0, -forward).applyAxisAngle(kUp, yaw);
    if (level.lengthSq() > 0) this.perspective.position.addScaledVector(level.normalize(), step);
    if (up) {
      this.perspective.position.y += up * step;
      this.eyeHeight = this.perspective.position.y - this.floor();
      this.dispatchEvent(new Event('eye'));
    }
    this.moved();
    return true;
  }

  // --- pointer and keys -----------------------------------------------------------------------

  #listen() {
    const {canvas} = this;
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    canvas.addEventListener('pointerdown', (event) => this.#pointerDown(event));
    canvas.addEventListener('pointermove', (event) => this.#pointerMove(event));
    for (const type of ['pointerup', 'pointercancel']) {
      canvas.addEventListener(type, (event) => this.#pointerUp(event));
    }
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaY / (event.deltaMode === 0 ? 100 : event.deltaMode === 1 ? 3 : 1);
      this.zoom(event.offsetX, event.offsetY, -THREE.MathUtils.clamp(lines, -4, 4) * 1.5);
    }, {passive: false});
    addEventListener('keyup', (event) => this.keys.delete(event.code));
    addEventListener('blur', () => this.keys.clear());
  }

  #pointerDown(event) {
    this.canvas.focus({preventScroll: true});
    this.canvas.setPointerCapture(event.pointerId);
    const at = new THREE.Vector2(event.offsetX, event.offsetY);
    this.pointers.set(event.pointerId, {at: at.clone(), from: at, moved: false});
    if (this.pointers.size === 1) {
      const hit = this.cast(this.rayAt(at.x, at.y));
      this.drag = {
        pivot: hit?.point ?? this.#pivotInView(),
        distance: hit?.distance ?? this.size / 3,
        pan: event.button === 2 || event.button === 1 || event.shiftKey,
      };
    }
  }

  #pointerMove(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return;
    const at = new THREE.Vector2(event.offsetX, event.offsetY);
    if (!pointer.moved && at.distanceTo(pointer.from) < kClickPx && this.pointers.size === 1) {
      return;
    }
    pointer.moved = true;
    const delta = at.clone().sub(pointer.at);
    if (this.pointers.size === 2) {
      const other = [...this.pointers.entries()].find(([id]) => id !== event.pointerId)[1];
      other.moved = true;
      const before = pointer.at.distanceTo(other.at), after = at.distanceTo(other.at);
      const middle = at.clone().add(other.at).multiplyScalar(0.5);
      if (before > 10 && after > 10) this.zoom(middle.x, middle.y, 5 * Math.log(after / before));
      this.#panBy(delta.multiplyScalar(0.5));
    } else if (this.drag.pan || this.camera === this.orthographic) {
      this.#panBy(delta);
    } else {
      const perPixel = this.perspective.fov * Math.PI / 180 / this.height;
      if (this.mode === 'walk') {
        this.look(delta.x * perPixel, delta.y * perPixel);
      } else {
        this.orbit(this.drag.pivot, -delta.x * 0.006, -delta.y * 0.006);
      }
    }
    pointer.at.copy(at);
  }

  #panBy(delta) {
    const perPixel = this.camera === this.orthographic ?
        (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom / this.height :
        2 * this.drag.distance * Math.tan(this.perspective.fov * Math.PI / 360) / this.height;
    this.pan(-delta.x * perPixel, delta.y * perPixel);
  }

  #pointerUp(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!pointer || pointer.moved || event.type === 'pointercancel' || event.button !== 0) return;
    this.dispatchEvent(new CustomEvent('pick', {detail: {x: pointer.at.x, y: pointer.at.y}}));
  }

  // A key that moves; false if it is none.
  key(event) {
    const steps = {ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    if (steps[event.key]) {
      const [x, y] = steps[event.key];
      if (this.camera === this.orthographic) {
        const step =
            (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom / 12;
        this.pan(-x * step, y * step);
      } else if (event.shiftKey) {
        this.pan(-x * this.size / 60, y * this.size / 60);
      } else if (this.mode === 'walk') {
        this.keys.add(event.code);
        this.invalidate();
      } else {
        this.orbit(this.#pivotInView(), -x * 0.08, -y * 0.08);
      }
      return true;
    }
    if (event.key === '+' || event.key === '=' || event.key === '-') {
      this.zoom(this.width / 2, this.height / 2, event.key === '-' ? -1 : 1);
      return true;
    }
    if ([
          'KeyW', 'KeyA', 'KeyS', 'KeyD', 'KeyQ', 'KeyE', 'PageUp', 'PageDown', 'ShiftLeft',
          'ShiftRight'
        ].includes(event.code)) {
      this.keys.add(event.code);
      this.invalidate();
      return !event.code.startsWith('Shift');
    }
    return false;
  }
}

// Heading and tilt of a camera; roll is lost.
export function yawPitch(quaternion) {
  const direction = new THREE.Vector3(0, 0, -1).applyQuaternion(quaternion);
  const pitch = Math.asin(THREE.MathUtils.clamp(direction.y, -1, 1));
  if (Math.abs(pitch) < 89.9 * Math.PI / 180) {
    return [Math.atan2(-direction.x, -direction.z), pitch];
  }
  const up =
      new THREE.Vector3(0, 1, 0).applyQuaternion(quaternion).multiplyScalar(-Math.sign(pitch));
  return [Math.atan2(-up.x, -up.z), pitch];
}
export function rotationOf(yaw, pitch) {
  return new THREE.Quaternion().setFromEuler(new THREE.Euler(pitch, yaw, 0, 'YXZ'));
}
