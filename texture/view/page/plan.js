// The room from above as a picture true to scale (an orthophoto), and how long things are in a view
// from above.

import * as THREE from 'three';

import {unit} from './format.js';
import {rotationOf} from './navigation.js';

const kMaxSide = 12000;   // pixels of a plan; browsers refuse much larger canvases
const kTile = 2048;       // pixels drawn at once
const kMargin = 0.05;     // metres around the room
const kLongest = 120000;  // milliseconds until all details of a tile must be there

// The longest round length, 1, 2 or 5 times a power of ten, of at most maxPx: {px, text}.
export function scaleBar(metresPerPx, maxPx) {
  const {metres, name} = unit();
  const most = maxPx * metresPerPx / metres;
  const power = 10 ** Math.floor(Math.log10(most));
  const value = [5, 2, 1].find((factor) => factor * power <= most) * power;
  return {px: value * metres / metresPerPx, text: `${Number(value.toPrecision(1))} ${name}`};
}

// Where the room lies along the sides of the picture, metres, without the few strays beyond it.
export function extentOf(points, inverse) {
  const seen = points.map((point) => point.clone().applyQuaternion(inverse));
  const between = (values) => {
    values.sort((a, b) => a - b);
    const stray = Math.floor(0.001 * values.length);
    return [values[stray] - kMargin, values[values.length - 1 - stray] + kMargin];
  };
  const [left, right] = between(seen.map((point) => point.x));
  const [bottom, top] = between(seen.map((point) => point.y));
  return {left, right, bottom, top};
}

// From above, along the walls: of the four headings the one that turns the picture least.
export function planRotation(heading) {
  const quarter = Math.PI / 2;
  return rotationOf(heading - quarter * Math.round(heading / quarter), -quarter);
}

// Gives whether all details are there.
async function drawn(viewer, camera, height) {
  const until = performance.now() + kLongest;
  for (;;) {
    viewer.room.coarseOnly = false;
    viewer.room.tolerance = 1;
    const more = viewer.room.update(camera, height);
    viewer.renderer.render(viewer.world, camera);
    if (!more && viewer.room.settled) return true;
    if (performance.now() > until) return false;
    await new Promise((later) => setTimeout(later, 20));
  }
}

// What lies in front of a plane, seen at right angles to it, on white: a canvas. rotation: of the camera; left,
// right, bottom, top: of the picture, metres along its sides; plane: the same along its depth, towards the eye;
// near, far: what is seen, metres from the plane. Throws an Error whose message is for the user.
export async function drawTrueToScale(
    viewer, {rotation, left, right, bottom, top, plane, near, far}, metresPerPixel, progress) {
  const width = Math.ceil((right - left) / metresPerPixel);
  const height = Math.ceil((top - bottom) / metresPerPixel);
  if (Math.max(width, height) > kMaxSide) {
    const enough = Math.ceil(1000 * Math.max(right - left, top - bottom) / kMaxSide);
    throw new Error(`The picture would be ${width} x ${height} pixels; from ${
        enough} mm per pixel on it fits.`);
  }
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d');
  const camera = new THREE.OrthographicCamera();
  camera.near = near;
  camera.far = far;
  camera.quaternion.copy(rotation);
  const {renderer, world, cameras, measures, section, room} = viewer;
  const ratio = renderer.getPixelRatio();
  const background = renderer.getClearColor(new THREE.Color()), alpha = renderer.getClearAlpha();
  const beside = [cameras.group, cameras.overlay, measures.group, section.group].filter(
      (group) => group?.parent === world);
  world.remove(...beside);
  const tolerance = room.tolerance;
  renderer.setPixelRatio(1);
  renderer.setClearColor(0xffffff, 1);
  try {
    const numTiles = Math.ceil(width / kTile) * Math.ceil(height / kTile);
    let done = 0;
    for (let y = 0; y < height; y += kTile) {
      for (let x = 0; x < width; x += kTile) {
        const columns = Math.min(kTile, width - x), rows = Math.min(kTile, height - y);
        camera.left = -columns * metresPerPixel / 2;
        camera.right = -camera.left;
        camera.top = rows * metresPerPixel / 2;
        camera.bottom = -camera.top;
        camera.position
            .set(
                left + (x + columns / 2) * metresPerPixel, top - (y + rows / 2) * metresPerPixel,
                plane)
            .applyQuaternion(rotation);
        camera.updateProjectionMatrix();
        camera.updateMatrixWorld();
        renderer.setSize(columns, rows, false);
        if (!await drawn(viewer, camera, rows)) {
          viewer.panel.fail('Details of the room did not come in time: parts of the picture are coarse.');
        }
        context.drawImage(renderer.domElement, x, y);
        progress(++done / numTiles);
      }
    }
  } finally {
    world.add(...beside);
    room.tolerance = tolerance;
    renderer.setClearColor(background, alpha);
    renderer.setPixelRatio(ratio);
    viewer.resize();
  }
  return canvas;
}

export async function pngOf(canvas) {
  const blob = await new Promise((finished) => canvas.toBlob(finished, 'image/png'));
  if (!blob) throw new Error('The picture is too large for this browser: take more mm per pixel.');
  return blob;
}
export const worldFile = (numbers) => numbers.map((value) => `${value}\n`).join('');

// Along the walls, as the view from above. {blob (PNG), world (text of a world file: what of the scan's
// level axes, x and y of a scan whose up is z, a pixel is), width, height}.
export async function makePlan(viewer, metresPerPixel, progress) {
  const rotation = planRotation(viewer.wallHeading());
  const {left, right, bottom, top} =
      extentOf(viewer.room.samplePoints(), rotation.clone().invert());
  const canvas = await drawTrueToScale(
      viewer, {rotation, left, right, bottom, top, plane: 0, near: -500, far: 500},
      metresPerPixel, progress);
  const {frames} = viewer;
  const levelX = frames.turnToScan(new THREE.Vector3(1, 0, 0));
  const levelY = frames.turnToScan(new THREE.Vector3(0, 0, -1));
  const inScan = (vector) => frames.turnToScan(vector.applyQuaternion(rotation));
  const toRight = inScan(new THREE.Vector3(metresPerPixel, 0, 0));
  const downwards = inScan(new THREE.Vector3(0, -metresPerPixel, 0));
  const first = frames.toScan(
      new THREE.Vector3(left + metresPerPixel / 2, top - metresPerPixel / 2, 0)
          .applyQuaternion(rotation));
  const world =
      worldFile([toRight, downwards, first].flatMap((at) => [at.dot(levelX), at.dot(levelY)]));
  return {blob: await pngOf(canvas), world, width: canvas.width, height: canvas.height};
}
