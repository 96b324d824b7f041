// A vertical section: a cut along a line drawn in the plan, and what is seen behind it, true to scale.

import * as THREE from 'three';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';

import {chainSegments, writeDxf} from './dxf.js';
import {length} from './format.js';
import {drawTrueToScale, extentOf, pngOf, scaleBar, worldFile} from './plan.js';

const kColor = 0xffc247;
const kUp = new THREE.Vector3(0, 1, 0);
const kArrow = 0.3;                     // metres, at both ends, to where one looks
const kSnap = 3 * Math.PI / 180;        // a line so near to the walls' directions is taken for one of them
const kShortest = 0.05;                 // metres
const kFarthest = 500;                  // metres, of what is seen behind the cut
const kStrip = 52, kBar = 200;          // pixels: below the picture, of the scale bar at most
const kCutColor = '#101217';
const kCutPx = 2.5;

// Level, from one place to another; along one of the walls if it nearly is.
function alongWalls(from, to, heading) {
  const way = to.clone().sub(from).setY(0);
  const angle = Math.atan2(way.x, way.z), quarter = Math.PI / 2;
  const wall = heading + quarter * Math.round((angle - heading) / quarter);
  if (Math.abs(angle - wall) < kSnap) {
    const direction = new THREE.Vector3(Math.sin(wall), 0, Math.cos(wall));
    way.copy(direction.multiplyScalar(way.dot(direction)));
  }
  return way.add(from);
}

// The line of the cut, in the page's frame, at the height of the floor.
export class SectionLine extends EventTarget {
  // heading: gives that of the walls.
  constructor({heading, invalidate}) {
    super();
    this.heading = heading;
    this.invalidate = invalidate;
    this.ends = [];     // left and right as one looks; one of them while it is drawn
    this.hover = null;  // where the second end would be
    this.group = new THREE.Group();
    this.material = new LineMaterial({color: kColor, linewidth: 3, depthTest: false});
    this.material.transparent = true;
    this.lines = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.lines.renderOrder = 902;
    this.lines.frustumCulled = false;
    this.group.add(this.lines);
    this.#draw();
  }
  resize(width, height) {
    this.material.resolution.set(width, height);
  }
  get drawn() {
    return this.ends.length === 2;
  }
  get length() {
    return this.drawn ? this.ends[0].distanceTo(this.ends[1]) : 0;
  }
  // To where one looks: the first end is on the left.
  get looking() {
    const [left, right] = this.ends;
    return kUp.clone().cross(right.clone().sub(left).normalize());
  }

  // The next end; a third one begins anew. False if it is where the first one is.
  add(point) {
    if (this.drawn) this.ends = [];
    const end = this.ends.length === 0 ? point.clone() :
                                         alongWalls(this.ends[0], point, this.heading());
    if (this.ends.length === 1) {
      end.y = this.ends[0].y;
      if (end.distanceTo(this.ends[0]) < kShortest) return false;
    }
    this.ends.push(end);
    this.hover = null;
    this.#changed();
    return true;
  }
  setHover(point) {
    if (this.ends.length !== 1 || (!point && !this.hover)) return;
    this.hover = point && alongWalls(this.ends[0], point, this.heading());
    this.#draw();
  }
  // Drops an end that lacks the other one; false if there is none.
  cancel() {
    if (this.ends.length !== 1) return false;
    this.clear();
    return true;
  }
  clear() {
    this.ends = [];
    this.hover = null;
    this.#changed();
  }
  turn() {
    this.ends.reverse();
    this.#changed();
  }
  #changed() {
    this.#draw();
    this.dispatchEvent(new Event('change'));
  }

  #draw() {
    const [from, to = this.hover] = this.ends;
    const positions = [];
    const add = (a, b) => positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
    if (from && to) {
      add(from, to);
      const right = to.clone().sub(from).normalize();
      const ahead = kUp.clone().cross(right);
      for (const end of [from, to]) {
        const tip = end.clone().addScaledVector(ahead, kArrow);
        add(end, tip);
        for (const side of [-1, 1]) {
          add(tip, tip.clone()
                       .addScaledVector(ahead, -0.3 * kArrow)
                       .addScaledVector(right, 0.2 * kArrow * side));
        }
      }
    } else if (from) {
      for (const axis of [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 0, 1)]) {
        add(from.clone().addScaledVector(axis, -0.1), from.clone().addScaledVector(axis, 0.1));
      }
    }
    this.lines.geometry.dispose();
    this.lines.geometry = new LineSegmentsGeometry();
    if (positions.length > 0) this.lines.geometry.setPositions(positions);
    this.lines.visible = positions.length > 0;
    this.invalidate();
  }
}

// Where triangles of the whole mesh meet the plane, as pairs of points [x, y, x, y, ...] along the sides of the
// picture, between its ends.
async function cutTriangles(room, rotation, plane, left, right) {
  const toPicture = new THREE.Matrix4()
                        .makeRotationFromQuaternion(rotation.clone().invert())
                        .multiply(room.group.matrixWorld);
  const crosses = (box) => {
    const turned = box.clone().applyMatrix4(toPicture);
    return turned.min.z <= plane && turned.max.z >= plane && turned.min.x <= right &&
        turned.max.x >= left;
  };
  const found = [];
  const corners = [0, 1, 2].map(() => new THREE.Vector3());
  for await (const geometry of room.wholeChunks(crosses)) {
    const {position} = geometry.attributes, index = geometry.index.array;
    for (let i = 0; i < index.length; i += 3) {
      let numBehind = 0;
      corners.forEach((corner, k) => {
        corner.fromBufferAttribute(position, index[i + k]).applyMatrix4(toPicture);
        if (corner.z < plane) ++numBehind;
      });
      if (numBehind % 3 === 0) continue;
      const ends = [];
      for (let k = 0; k < 3; ++k) {
        const a = corners[k], b = corners[(k + 1) % 3];
        if ((a.z < plane) === (b.z < plane)) continue;
        // From the same end for both triangles of an edge, so that they meet in the same point.
        const [from, to] = a.z < b.z ? [a, b] : [b, a];
        ends.push(from.clone().lerp(to, (plane - from.z) / (to.z - from.z)));
      }
      const middle = ends[0].clone().lerp(ends[1], 0.5);
      if (middle.x < left || middle.x > right) continue;
      if (!room.isKept(middle.applyQuaternion(rotation))) continue;
      found.push(ends[0].x, ends[0].y, ends[1].x, ends[1].y);
    }
  }
  return found;
}

function drawCut(canvas, lines, toPixel) {
  const context = canvas.getContext('2d');
  context.strokeStyle = kCutColor;
  context.lineWidth = kCutPx;
  context.lineJoin = context.lineCap = 'round';
  context.beginPath();
  for (const line of lines) {
    line.forEach((point, i) => context[i === 0 ? 'moveTo' : 'lineTo'](...toPixel(point)));
  }
  context.stroke();
}

// The picture with a scale below it.
function withScale(canvas, metresPerPixel, text) {
  const whole = document.createElement('canvas');
  whole.width = canvas.width;
  whole.height = canvas.height + kStrip;
  const context = whole.getContext('2d');
  context.fillStyle = '#fff';
  context.fillRect(0, 0, whole.width, whole.height);
  context.drawImage(canvas, 0, 0);
  const bar = scaleBar(metresPerPixel, Math.min(kBar, 0.8 * canvas.width));
  context.fillStyle = kCutColor;
  context.fillRect(12, whole.height - 16, bar.px, 4);
  context.font = '600 14px system-ui, sans-serif';
  context.fillText(bar.text, 12, whole.height - 24);
  context.font = '14px system-ui, sans-serif';
  context.fillText(text, bar.px + 32, whole.height - 12);
  return whole;
}

// {blob (PNG), world (a world file: metres along the line from its left end, and heights of the scan frame), dxf (the
// cut in the same), width, height, cut (its lines, likewise)}. depth: metres behind the line that are seen; 0 = all.
// Throws an Error whose message is for the user.
export async function makeSection(viewer, depth, metresPerPixel, progress) {
  const {section, room, frames} = viewer;
  const [leftEnd, rightEnd] = section.ends;
  const rotation = new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().makeBasis(
      rightEnd.clone().sub(leftEnd).normalize(), kUp, section.looking.negate()));
  const inverse = rotation.clone().invert();
  const start = leftEnd.clone().applyQuaternion(inverse);
  const left = start.x, right = left + section.length, plane = start.z;
  const far = depth > 0 ? depth : kFarthest;
  const lines = chainSegments(await cutTriangles(room, rotation, plane, left, right));
  const points = room.samplePoints().filter((point) => {
    const {x, z} = point.clone().applyQuaternion(inverse);
    return x >= left && x <= right && z <= plane && z >= plane - far && room.isKept(point);
  });
  for (const [x, y] of lines.flat()) {
    points.push(new THREE.Vector3(x, y, plane).applyQuaternion(rotation));
  }
  if (points.length === 0) {
    throw new Error('There is nothing behind this line: look the other way, or draw another one.');
  }
  const {bottom, top} = extentOf(points, inverse);
  const canvas = await drawTrueToScale(
      viewer, {rotation, left, right, bottom, top, plane, near: 0, far}, metresPerPixel, progress);
  drawCut(
      canvas, lines, ([x, y]) => [(x - left) / metresPerPixel, (top - y) / metresPerPixel]);
  const heightOfOrigin = frames.origin.dot(frames.turnToScan(kUp));
  const cut = lines.map((line) => line.map(([x, y]) => [x - left, y + heightOfOrigin]));
  const whole = withScale(
      canvas, metresPerPixel,
      `${length(section.length)} along the cut, ${1000 * metresPerPixel} mm per pixel`);
  return {
    blob: await pngOf(whole),
    world: worldFile([
      metresPerPixel, 0, 0, -metresPerPixel, metresPerPixel / 2,
      top + heightOfOrigin - metresPerPixel / 2
    ]),
    dxf: writeDxf(cut, 'cut'),
    width: whole.width,
    height: whole.height,
    cut,
  };
}
