// The viewer: puts the parts together and draws when something has changed, never else.

import * as THREE from 'three';

import {getJson} from './api.js';
import {Cameras} from './cameras.js';
import {length} from './format.js';
import {readFragment, writeFragment} from './fragment.js';
import {Frames} from './frames.js';
import {drawLegend} from './legend.js';
import {Lumigraph} from './lumigraph.js';
import {Measures} from './measure.js';
import {Navigation} from './navigation.js';
import {Panel, showFailure} from './panel.js';
import {scaleBar} from './plan.js';
import {Room} from './room.js';
import {SectionLine} from './section.js';
import {needsEvidence} from './surface.js';

const kSlowFrame = 60;      // milliseconds of the graphics card: coarse while moving
const kLongestFrame = 800;  // milliseconds: coarser at rest, too, up to kMaxTolerance
const kShortFrame = 150;    // milliseconds: as fine as it should be again
const kMaxTolerance = 4;
const kScaleBarPx = 180;     // at most
const kFragmentPause = 300;  // milliseconds between two changes of the address
const kBackgrounds = {
  dark: 0x1b1e24,
  light: 0xf2f3f5
};

THREE.ColorManagement.enabled = false;

class Viewer {
  constructor(scene, renderer) {
    this.renderer = renderer;
    this.canvas = renderer.domElement;
    this.frames = new Frames(scene);
    this.data = scene;
    this.world = new THREE.Scene();
    this.background = 'dark';
    this.mode = 'colour';
    this.evidence = null;
    this.measuring = false;
    this.sectioning = false;  // the line of a section is drawn
    this.drawing = null;      // while a plan or section is made: what is to be done after it
    this.scheduled = false;
    this.handingOver = false;
    this.numPictures = 0;
    this.cost = 0;  // milliseconds that the graphics card took for the last picture
    this.fence = null;
    this.labels = document.getElementById('labels');
    this.labelPool = [];
    const invalidate = () => this.invalidate();
    this.panel = new Panel(this);
    const fail = (sentence) => this.panel.fail(sentence);
    this.room = new Room(
        scene, renderer,
        {invalidate, refine: () => this.refine(), handOver: () => this.#handOver(), fail});
    this.world.add(this.room.group);
    this.navigation = new Navigation(this.canvas, {
      cast: (ray) => this.room.cast(ray),
      floor: () => this.floorHeight(),
      heading: () => this.wallHeading(),
      sample: () => ({room: this.room.samplePoints(), cameras: this.#camerasAround()}),
      invalidate,
    });
    const box = new THREE.Box3();
    for (const chunk of this.room.chunks) {
      box.union(chunk.box.clone().applyMatrix4(this.room.group.matrixWorld));
    }
    this.navigation.setBounds(box);
    this.measures = new Measures(
        {frames: this.frames, up: new THREE.Vector3(...scene.up).normalize(), invalidate});
    this.section = new SectionLine({heading: () => this.wallHeading(), invalidate});
    this.world.add(this.measures.group, this.section.group);
    this.cameras = new Cameras([], {frames: this.frames, invalidate, fail, maxTexture: 4096});
    this.#listen();
  }

  async start() {
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize();
    this.setBackground('dark');
    const fromAddress = readFragment(location.hash, this.frames);
    if (fromAddress.look) {
      this.navigation.setView(fromAddress.look);
    } else {
      this.navigation.home(false);
    }
    this.panel.describe();
    const invalidate = () => this.invalidate(), fail = (sentence) => this.panel.fail(sentence);
    const room = this.room.load();
    if (this.data.num_cameras > 0) {
      const gl = this.renderer.getContext();
      this.cameras = new Cameras(await getJson('cameras'), {
        frames: this.frames,
        invalidate,
        fail,
        maxTexture: gl.getParameter(gl.MAX_TEXTURE_SIZE),
      });
      this.world.add(this.cameras.group, this.cameras.overlay);
      this.cameras.setSize(THREE.MathUtils.clamp(0.03 * this.navigation.size, 0.02, 1));
      this.resize();
    }
    this.panel.showCameras();
    await this.#findPhotos();
    await room;
    this.firstPicture = performance.now();
    if (!fromAddress.look && !this.touched) this.navigation.home(false);
    await this.applyExtra(fromAddress.extra);
    try {
      this.evidence = await getJson('evidence');
    } catch (error) {
      this.evidence = {available: false, reason: error.message};
    }
    this.panel.showEvidence();
    if (fromAddress.extra.surface) this.setMode(fromAddress.extra.surface);
    this.remember();
  }

  // Whether there are photos for view-dependent colour.
  async #findPhotos() {
    try {
      const {photos, reason} = await getJson('lumigraph');
      if (photos.length > 0) {
        this.lumigraph = new Lumigraph(photos, this.cameras.list, {
          renderer: this.renderer,
          uniforms: this.room.look.lumigraphUniforms,
          cast: (ray) => this.room.cast(ray),
          invalidate: () => this.invalidate(),
          fail: (sentence) => this.panel.fail(sentence),
        });
      }
      this.panel.showPhotoColour(reason);
    } catch (error) {
      this.panel.showPhotoColour(error.message);
    }
  }

  // Kept once all of the room is there to tell.
  floorHeight() {
    const height = this.knownFloor ?? this.room.floorHeight();
    if (this.room.loaded) this.knownFloor = height;
    return height;
  }

  // Where the cameras stand, but for those that are far from everything.
  #camerasAround() {
    const around = this.navigation.bounds.clone().expandByScalar(0.5 * this.navigation.size);
    return this.cameras.list.map(({position}) => position).filter((p) => around.containsPoint(p));
  }
  wallHeading() {
    const heading = this.knownHeading ?? this.room.wallHeading();
    if (this.room.loaded) this.knownHeading = heading;
    return heading;
  }

  // --- pictures -------------------------------------------------------------------------------

  invalidate() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((now) => this.#frame(now));
  }

  // A finer picture of the same: on slow graphics cards not for every piece that comes.
  refine() {
    if (this.refineTimer || this.scheduled) return;
    this.refineTimer = setTimeout(() => {
      this.refineTimer = null;
      this.invalidate();
    }, Math.min(3 * this.cost, 2000));
  }

  #frame(now) {
    this.scheduled = false;
    if (this.drawing) return;  // the canvas is that of the plan
    if (this.#isDrawing()) return this.invalidate();  // the last picture is not finished
    const pause = now - (this.lastFrame ?? now);
    this.lastFrame = now;
    const goesOn = this.navigation.step(this.drewLast ? Math.min(pause, 300) / 1000 : 0.016);
    this.room.coarseOnly = this.room.slow && this.navigation.moving;
    const more = this.draw();
    this.drewLast = goesOn;
    if (goesOn) {
      this.invalidate();
    } else if (more) {
      this.refine();
    }
    this.#handOver();
    this.panel.showProgress();
  }

  // What no picture shows yet is handed over without one: on slow graphics cards, that would be
  // most of the time until the room is there.
  #handOver() {
    if (this.handingOver || !this.room.hasPendingTexture) return;
    this.handingOver = true;
    requestAnimationFrame(() => {
      this.handingOver = false;
      if (!this.scheduled && !this.#isDrawing()) this.room.handOverTexture();
      this.#handOver();
    });
  }

  // Whether the graphics card still works on the last picture; learns how long it takes.
  #isDrawing() {
    if (!this.fence) return false;
    const gl = this.renderer.getContext();
    if (gl.getSyncParameter(this.fence.sync, gl.SYNC_STATUS) !== gl.SIGNALED &&
        performance.now() - this.fence.started < 10000) {
      return true;
    }
    gl.deleteSync(this.fence.sync);
    this.cost = performance.now() - this.fence.started;
    this.fence = null;
    // Handing over takes its time once.
    if (!this.room.loaded || this.room.coarseOnly || this.room.handedOver) return false;
    if (this.cost > kSlowFrame) this.room.slow = true;
    const {room} = this;
    if (this.cost > kLongestFrame) {
      room.tolerance = Math.min(room.tolerance * 1.4, kMaxTolerance);
    } else if (this.cost < kShortFrame) {
      room.tolerance = Math.max(room.tolerance / 1.4, 1);
    }
    return false;
  }

  // Gives whether there are more meshes to hand over to the graphics card.
  draw() {
    const {camera} = this.navigation;
    const started = performance.now();
    camera.updateMatrixWorld();
    const more = this.room.update(camera, this.heightPx);
    if (this.mode === 'view-dependent') {
      const fades = this.lumigraph.update(
          camera, this.heightPx, (columns, rows) => this.#raysOver(columns, rows));
      if (fades) this.invalidate();
    }
    this.cameras.update(camera.position);
    this.measures.update(camera);
    this.renderer.render(this.world, camera);
    this.#placeLabels();
    this.#showScale();
    const gl = this.renderer.getContext();
    if (this.fence) gl.deleteSync(this.fence.sync);
    this.fence = {sync: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0), started};
    gl.flush();
    if (!this.scheduled) this.#watch();
    ++this.numPictures;
    return more;
  }
  #raysOver(columns, rows) {
    const {width, height} = this.navigation, rays = [];
    for (let i = 0; i < columns * rows; ++i) {
      const x = (i % columns + 0.5) / columns, y = (Math.floor(i / columns) + 0.5) / rows;
      rays.push(this.navigation.rayAt(x * width, y * height));
    }
    return rays;
  }
  // Looks for the end of the picture although no other one is wanted, to learn its cost.
  #watch() {
    clearTimeout(this.watchTimer);
    this.watchTimer = setTimeout(() => {
      if (this.#isDrawing()) this.#watch();
    }, Math.max(20, Math.min(this.cost / 4, 200)));
  }

  resize() {
    if (this.drawing) return;
    const {clientWidth: width, clientHeight: height} = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.heightPx = this.renderer.domElement.height;
    this.navigation.resize(width, height);
    this.cameras.resize(width, height);
    this.measures.resize(width, height);
    this.section.resize(width, height);
    // At once: a canvas of a new size is empty.
    this.draw();
  }

  // Labels of distances and of the camera under the pointer: [{at (page), text, className}].
  labelList() {
    const list = this.measures.labels().map(
        ({at, metres}) => ({at, text: length(metres), className: 'distance'}));
    if (this.cameras.hovered && this.cameras.visible) {
      const {position, name} = this.cameras.hovered;
      list.push({at: position, text: name, className: 'camera', below: true});
    }
    const {camera, width, height} = this.navigation;
    return list
        .map((label) => {
          const place = label.at.clone().project(camera);
          return {
            ...label,
            x: (place.x + 1) * width / 2,
            y: (1 - place.y) * height / 2,
            inFront: place.z < 1 && Math.abs(place.x) < 1.2 && Math.abs(place.y) < 1.2
          };
        })
        .filter((label) => label.inFront);
  }
  #placeLabels() {
    const list = this.labelList();
    while (this.labelPool.length < list.length) {
      this.labelPool.push(this.labels.appendChild(document.createElement('div')));
    }
    this.labelPool.forEach((element, i) => {
      const label = list[i];
      element.hidden = !label;
      if (!label) return;
      element.textContent = label.text;
      element.className = label.className;
      const shift = label.below ? '14px' : '-50%';
      element.style.transform = `translate(${label.x}px, ${label.y}px) translate(-50%, ${shift})`;
    });
  }

  // Only a view from above has one scale: {px, text} of a bar, or null.
  #scale() {
    const {camera, height, mode} = this.navigation;
    if (mode !== 'top') return null;
    return scaleBar((camera.top - camera.bottom) / camera.zoom / height, kScaleBarPx);
  }
  #showScale() {
    const scale = this.#scale(), bar = document.getElementById('scale-bar');
    bar.hidden = scale === null;
    if (!scale) return;
    bar.style.width = `${scale.px}px`;
    bar.firstElementChild.textContent = scale.text;
  }
  #drawScale(context, scale) {
    const bar = this.#scale();
    if (!bar) return;
    const {width, height} = this.navigation;
    const left = width - bar.px - 24, y = height - 24;
    context.save();
    context.scale(scale, scale);
    context.fillStyle = 'rgba(16, 18, 23, 0.9)';
    context.fillRect(left - 8, y - 22, bar.px + 16, 32);
    context.fillStyle = '#fff';
    context.fillRect(left, y, bar.px, 3);
    context.font = '600 12px system-ui, sans-serif';
    context.fillText(bar.text, left, y - 6);
    context.restore();
  }

  // What is seen as a PNG of `scale` pixels per CSS pixel, with labels and legend.
  async picture(scale) {
    const {width, height} = this.navigation;
    const canvas = document.createElement('canvas');
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
    const context = canvas.getContext('2d');
    const ratio = this.renderer.getPixelRatio();
    const hover = this.measures.hover;
    this.measures.setHover(null);
    this.room.coarseOnly = false;
    this.renderer.setPixelRatio(scale);
    this.renderer.setSize(width, height, false);
    this.draw();
    context.drawImage(this.renderer.domElement, 0, 0, canvas.width, canvas.height);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    context.font = `600 ${13 * scale}px system-ui, sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    for (const {x, y, text} of this.labelList()) {
      const half = context.measureText(text).width / 2 + 8 * scale;
      context.fillStyle = 'rgba(16, 18, 23, 0.9)';
      context.beginPath();
      context.roundRect(x * scale - half, (y - 12) * scale, 2 * half, 24 * scale, 4 * scale);
      context.fill();
      context.fillStyle = '#fff';
      context.fillText(text, x * scale, y * scale);
    }
    context.textAlign = 'left';
    context.textBaseline = 'alphabetic';
    if (needsEvidence(this.mode)) drawLegend(context, this.mode, this.evidence, scale);
    this.#drawScale(context, scale);
    this.measures.setHover(hover);
    this.draw();
    return new Promise((done) => canvas.toBlob(done, 'image/png'));
  }

  // --- what the panel sets --------------------------------------------------------------------

  // Whether a plan or section is being made: what would change it waits until it is done.
  postpone(act) {
    this.drawing?.push(act);
    return this.drawing !== null;
  }
  endDrawing() {
    const acts = this.drawing;
    this.drawing = null;
    this.resize();
    for (const act of acts) act();
  }

  async setMode(mode) {
    if (this.postpone(() => this.setMode(mode))) return;
    if (needsEvidence(mode) && !this.evidence?.available) return;
    if (mode === 'view-dependent' && !this.lumigraph) return;
    this.mode = mode;
    this.panel.showMode();
    try {
      await this.room.setMode(mode, this.evidence);
    } catch (error) {
      this.panel.fail(error.message);
    }
    this.remember();
  }
  setBackground(name) {
    if (this.postpone(() => this.setBackground(name))) return;
    this.background = name;
    this.renderer.setClearColor(kBackgrounds[name]);
    this.invalidate();
  }
  setMeasuring(on) {
    this.measuring = on;
    if (!on) {
      this.measures.cancel();
      this.measures.setHover(null);
    }
    if (on) this.setSectioning(false);
    this.panel.showMeasuring();
  }
  setSectioning(on) {
    if (on === this.sectioning) return;
    this.sectioning = on;
    if (on) {
      this.setMeasuring(false);
      if (this.navigation.mode !== 'top') this.navigation.setMode('top');
    } else {
      this.section.cancel();
    }
    this.panel.showSectioning();
  }

  async standIn(camera) {
    if (!camera) return;
    this.target = camera;
    this.cameras.leave();
    this.cameras.setChosen(camera);
    this.panel.showStanding(camera);
    this.navigation.standIn(camera.position, camera.quaternion, this.cameras.lens(camera), () => {
      if (this.target === camera) this.cameras.stand(camera);
    });
    this.remember();
  }
  stepCamera(step) {
    const {list} = this.cameras;
    if (list.length === 0) return;
    const now = list.indexOf(this.target ?? this.cameras.chosen);
    const first = step > 0 ? 0 : list.length - 1;
    this.standIn(list[now < 0 ? first : (now + step + list.length) % list.length]);
  }
  leaveCamera() {
    this.navigation.leaveCamera();
  }

  // --- pointer --------------------------------------------------------------------------------

  #listen() {
    const {navigation, canvas} = this;
    for (const type of ['pointerdown', 'wheel', 'keydown']) {
      addEventListener(type, () => {
        this.touched = true;
      }, {capture: true, passive: true});
    }
    navigation.addEventListener('move', () => {
      this.remember();
      clearTimeout(this.restTimer);
      this.restTimer = setTimeout(() => this.invalidate(), 230);
    });
    navigation.addEventListener('mode', () => this.panel.showMovement());
    navigation.addEventListener('eye', () => this.panel.showEye());
    navigation.addEventListener('leave', () => {
      this.target = null;
      this.cameras.leave();
      this.panel.showStanding(null);
      this.remember();
    });
    navigation.addEventListener('pick', ({detail}) => this.#pick(detail.x, detail.y));
    this.measures.addEventListener('change', () => this.panel.showMeasures());
    this.section.addEventListener('change', () => this.panel.showSection());
    canvas.addEventListener('pointermove', (event) => this.#hover(event.offsetX, event.offsetY));
    canvas.addEventListener('pointerleave', () => {
      this.cameras.setHovered(null);
      this.measures.setHover(null);
    });
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      showFailure('The graphics card has given up on this page. Reload it.');
    });
    addEventListener('hashchange', () => {
      const {look, extra} = readFragment(location.hash, this.frames);
      if (location.hash === this.written) return;
      if (look) navigation.setView(look);
      this.applyExtra(extra);
      if (extra.surface !== this.mode) this.setMode(extra.surface ?? 'colour');
    });
  }
  #hover(x, y) {
    if (this.navigation.drag && this.navigation.pointers.size > 0) return;
    const ray = this.navigation.rayAt(x, y);
    const hit = this.room.cast(ray);
    if (this.sectioning) {
      this.cameras.setHovered(null);
      this.section.setHover(this.#inPlan(ray, hit));
    } else if (this.measuring) {
      this.cameras.setHovered(null);
      this.measures.setHover(hit?.point ?? null);
    } else {
      this.cameras.setHovered(this.#cameraAt(ray, hit));
    }
    this.canvas.parentElement.classList.toggle('on-camera', this.cameras.hovered !== null);
  }
  #cameraAt(ray, hit) {
    const {camera, height} = this.navigation;
    const pixelAngle = camera.isPerspectiveCamera ? camera.fov * Math.PI / 180 / height : 1e-4;
    return this.cameras.find(ray, hit?.distance ?? Infinity, pixelAngle);
  }
  async #pick(x, y) {
    const ray = this.navigation.rayAt(x, y);
    if (this.measuring) return this.measureAt(x, y);
    if (this.sectioning) return this.sectionAt(x, y);
    const camera = this.#cameraAt(ray, this.room.cast(ray));
    if (camera) this.standIn(camera);
  }
  // Where a ray meets the plan, at the height of the floor; from above that needs no surface.
  #inPlan(ray, hit) {
    const point = this.navigation.mode === 'top' ? ray.origin : hit?.point;
    return point ? point.clone().setY(this.floorHeight()) : null;
  }
  sectionAt(x, y) {
    const ray = this.navigation.rayAt(x, y);
    const point = this.#inPlan(ray, this.room.cast(ray));
    if (!point || !this.section.add(point)) {
      this.panel.hint('A section needs two places of the plan. Click another one.');
    } else if (this.section.drawn) {
      this.setSectioning(false);
    } else {
      this.panel.showSectioning();
    }
  }
  // One after the other: what is far away takes longer.
  measureAt(x, y) {
    const ray = this.navigation.rayAt(x, y);
    this.picking = (this.picking ?? Promise.resolve()).then(() => this.#measure(ray));
  }
  async #measure(ray) {
    try {
      const point = await this.measures.pick(ray, this.room);
      if (!this.measuring) return;
      if (point) this.measures.add(point);
      this.panel.hint(
          point ? this.measures.first ? 'Now the second point.' :
                                        'Click the first point of the next distance; Esc ends.' :
                  'There is no surface. Click another place.');
    } catch (error) {
      this.panel.fail(error.message);
    }
  }

  // --- the address ----------------------------------------------------------------------------

  remember() {
    if (this.fragmentTimer) return;
    this.fragmentTimer = setTimeout(() => {
      this.fragmentTimer = null;
      this.written = writeFragment(this.navigation.view, this.frames, {
        camera: this.target?.name,
        surface: this.mode === 'colour' ? '' : this.mode,
      });
      try {
        history.replaceState(null, '', this.written);
      } catch {
        location.replace(this.written);  // a page from a disk has no other way in some browsers
      }
    }, kFragmentPause);
  }
  applyExtra(extra) {
    if (!extra.camera) return;
    const camera = this.cameras.list.find(({name}) => name === extra.camera);
    if (camera) this.standIn(camera);
  }
}

// Whether WebGL is computed by the processor, as on servers: no time for smooth edges then.
function isSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) return false;
  const name = gl.getParameter(gl.RENDERER) +
      (gl.getExtension('WEBGL_debug_renderer_info') ?
           gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info').UNMASKED_RENDERER_WEBGL) :
           '');
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

async function main() {
  let renderer;
  try {
    const software = isSoftware();
    renderer = new THREE.WebGLRenderer({
      canvas: document.getElementById('canvas'),
      antialias: !software,
      powerPreference: 'high-performance',
    });
    renderer.isSoftware = software;
  } catch {
    return showFailure(
        'This browser shows no three-dimensional graphics (WebGL 2 is missing or ' +
        'switched off). Use a recent Firefox, Chrome, Edge or Safari.');
  }
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;  // bytes as they are
  try {
    const viewer = new Viewer(await getJson('scene'), renderer);
    globalThis.roomtexView = viewer;  // for the browser's console, and for tests
    await viewer.start();
  } catch (error) {
    console.warn(error);
    showFailure(error.message);
  }
}

main();
