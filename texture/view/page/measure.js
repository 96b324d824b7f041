// Distances between points of the surface, of the whole mesh whatever is drawn of it.

import * as THREE from 'three';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';

const kColor = 0xffc247;

// A dot with a dark rim.
function dotTexture() {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 64;
  const context = canvas.getContext('2d');
  for (const [radius, color] of [[30, '#111318'], [22, '#ffc247'], [8, '#111318']]) {
    context.fillStyle = color;
    context.beginPath();
    context.arc(32, 32, radius, 0, 2 * Math.PI);
    context.fill();
  }
  return new THREE.CanvasTexture(canvas);
}

// What there is to say about two points of the scan frame; up: unit.
export function describe(from, to, up) {
  const difference = to.clone().sub(from);
  const height = difference.dot(up);
  return {
    from,
    to,
    distance: difference.length(),
    difference,
    height,
    horizontal: Math.sqrt(Math.max(difference.lengthSq() - height * height, 0)),
  };
}

export class Measures extends EventTarget {
  constructor({frames, up, invalidate}) {
    super();
    this.frames = frames;
    this.up = up;  // scan frame
    this.invalidate = invalidate;
    this.list = [];
    this.first = null;  // of a half distance, scan frame
    this.hover = null;  // page frame
    this.group = new THREE.Group();
    this.material = new LineMaterial({color: kColor, linewidth: 2.5, depthTest: false});
    this.material.transparent = true;
    this.lines = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.lines.renderOrder = 900;
    this.lines.frustumCulled = false;
    this.dots = [];
    this.dotMaterial = new THREE.SpriteMaterial(
        {map: dotTexture(), depthTest: false, sizeAttenuation: false, transparent: true});
    this.group.add(this.lines);
    this.#draw();
  }
  resize(width, height) {
    this.material.resolution.set(width, height);
    this.heightPx = height;
  }

  // The point of the surface along a ray of the page, scan frame; null without.
  async pick(ray, room) {
    const hit = await room.castWhole(ray);
    return hit ? this.frames.toScan(hit.point) : null;
  }

  add(point) {
    if (!this.first) {
      this.first = point;
    } else {
      this.list.push(describe(this.first, point, this.up));
      this.first = null;
      this.dispatchEvent(new Event('change'));
    }
    this.#draw();
  }
  // Drops the half distance; false if there is none.
  cancel() {
    const had = this.first !== null;
    this.first = null;
    this.#draw();
    return had;
  }
  remove(index) {
    this.list.splice(index, 1);
    this.dispatchEvent(new Event('change'));
    this.#draw();
  }
  clear() {
    this.list = [];
    this.dispatchEvent(new Event('change'));
    this.#draw();
  }
  setHover(point) {
    if (!point && !this.hover) return;
    this.hover = point;
    this.#draw();
  }

  csv() {
    const row = (m) => [m.from.x, m.from.y, m.from.z, m.to.x, m.to.y, m.to.z, m.distance,
                        m.difference.x, m.difference.y, m.difference.z, m.height, m.horizontal]
                           .map((value) => value.toFixed(5))
                           .join(',');
    return 'from_x,from_y,from_z,to_x,to_y,to_z,distance,dx,dy,dz,height,horizontal\n' +
        this.list.map((measure) => row(measure) + '\n').join('');
  }

  // Middle of each distance (page frame) with its length, for labels.
  labels() {
    const all = this.list.map((m) => ({from: m.from, to: m.to}));
    if (this.first && this.hover) all.push({from: this.first, to: this.frames.toScan(this.hover)});
    return all.map(({from, to}) => ({
                     at: this.frames.toPage(from.clone().add(to).multiplyScalar(0.5)),
                     metres: from.distanceTo(to),
                   }));
  }

  #draw() {
    const positions = [], points = [];
    const add = (a, b) => positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
    for (const {from, to} of this.list) {
      const a = this.frames.toPage(from), b = this.frames.toPage(to);
      add(a, b);
      points.push(a, b);
    }
    if (this.first) points.push(this.frames.toPage(this.first));
    if (this.hover) points.push(this.hover);
    if (this.first && this.hover) add(points.at(-2), this.hover);
    this.lines.geometry.dispose();
    this.lines.geometry = new LineSegmentsGeometry();
    if (positions.length > 0) this.lines.geometry.setPositions(positions);
    this.lines.visible = positions.length > 0;
    while (this.dots.length < points.length) {
      const dot = new THREE.Sprite(this.dotMaterial);
      dot.renderOrder = 901;
      this.dots.push(dot);
      this.group.add(dot);
    }
    this.dots.forEach((dot, i) => {
      dot.visible = i < points.length;
      if (dot.visible) dot.position.copy(points[i]);
    });
    this.invalidate();
  }

  // Dots keep their size on the screen.
  update(camera) {
    const px = 14;
    const scale = camera.isOrthographicCamera ?
        px * (camera.top - camera.bottom) / camera.zoom / this.heightPx :
        2 * px * Math.tan(camera.fov * Math.PI / 360) / this.heightPx;
    for (const dot of this.dots) dot.scale.setScalar(scale);
  }
}
