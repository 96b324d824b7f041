// The surface of the room in chunks: a coarse level of everything first, whole chunks where they
// are looked at, a bounded share of both per picture.

import * as THREE from 'three';

import {getBitmap, getBytes, Queue} from './api.js';
import {kFrontMargin, kModes, needsEvidence, SurfaceLook} from './surface.js';

const kMagic = 0x31435452;
const kUploadBytes = 3 << 20;  // handed to the graphics card per picture; where a picture takes
const kSlowUploadBytes = 24 << 20;  // longer than that takes anyway, more
const kMaxTriangles = 12e6;         // of the finer levels kept; 16 bytes each
const kPreviewTexture = 1024;       // texels of the first, quick texture
const kStripRows = 256;             // of a texture handed over per picture
const kWantedEdgePx = 2;            // an edge longer than this on the screen asks for a finer level
const kEdges = [4, 2, 1];           // edge of each level, in those of the whole mesh
const kFull = 2;
const kAxes = [new THREE.Vector3(0, 1, 0), new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 0, 1)];

// Bytes of ViewChunks::Encode as a geometry whose arrays are views of them.
function parseChunk(bytes, chunk) {
  const [magic, numPoints, numCorners, flags] = new Uint32Array(bytes, 0, 4);
  if (magic !== kMagic) throw new Error('A part of the room came damaged. Reload the page.');
  const geometry = new THREE.BufferGeometry();
  let at = 16;
  const positions = new Float32Array(bytes, at, 3 * numPoints);
  at += positions.byteLength;
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  if (flags & 1) {
    geometry.setAttribute(
        'uv', new THREE.BufferAttribute(new Uint16Array(bytes, at, 2 * numPoints), 2, true));
  } else {
    geometry.setAttribute(
        'tint', new THREE.BufferAttribute(new Uint8Array(bytes, at, 4 * numPoints), 4, true));
  }
  at += 4 * numPoints;
  geometry.setAttribute(
      'normal', new THREE.BufferAttribute(new Int8Array(bytes, at, 4 * numPoints), 4, true));
  at += 4 * numPoints;
  geometry.setIndex(new THREE.BufferAttribute(new Uint16Array(bytes, at, numCorners), 1));
  geometry.boundingBox =
      new THREE.Box3(new THREE.Vector3(...chunk.min), new THREE.Vector3(...chunk.max));
  geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new THREE.Sphere());
  return geometry;
}

// Where a ray meets a triangle; the distance, or Infinity. Both sides.
function meet(origin, direction, positions, a, b, c) {
  const ax = positions[3 * a], ay = positions[3 * a + 1], az = positions[3 * a + 2];
  const ux = positions[3 * b] - ax, uy = positions[3 * b + 1] - ay, uz = positions[3 * b + 2] - az;
  const vx = positions[3 * c] - ax, vy = positions[3 * c + 1] - ay, vz = positions[3 * c + 2] - az;
  const px = direction.y * vz - direction.z * vy;
  const py = direction.z * vx - direction.x * vz;
  const pz = direction.x * vy - direction.y * vx;
  const determinant = ux * px + uy * py + uz * pz;
  if (Math.abs(determinant) < 1e-14) return Infinity;
  const tx = origin.x - ax, ty = origin.y - ay, tz = origin.z - az;
  const u = (tx * px + ty * py + tz * pz) / determinant;
  if (u < 0 || u > 1) return Infinity;
  const qx = ty * uz - tz * uy, qy = tz * ux - tx * uz, qz = tx * uy - ty * ux;
  const v = (direction.x * qx + direction.y * qy + direction.z * qz) / determinant;
  if (v < 0 || u + v > 1) return Infinity;
  const distance = (vx * qx + vy * qy + vz * qz) / determinant;
  return distance > 1e-4 ? distance : Infinity;
}

// Whether who looks along `direction` sees the front, as the shader decides it.
function showsFront(normals, a, b, c, direction) {
  let x = 0, y = 0, z = 0;
  for (const i of [a, b, c]) {
    x += normals[4 * i];
    y += normals[4 * i + 1];
    z += normals[4 * i + 2];
  }
  return x * direction.x + y * direction.y + z * direction.z < kFrontMargin * Math.hypot(x, y, z);
}

// A page of texture: small at once, then whole, strip by strip.
class PageTexture {
  constructor(renderer, page) {
    this.page = page;
    this.renderer = renderer;
    this.texture = null;
    this.pending = null;  // {bitmap, texture, row}
  }
  async loadPreview() {
    const bitmap = await getBitmap(`texture?page=${this.page.id}&max=${kPreviewTexture}`);
    this.#begin(bitmap);
    while (!this.step())
      ;
    this.complete = Math.max(this.page.width, this.page.height) <= kPreviewTexture;
  }
  async loadWhole(max) {
    if (this.complete) return;
    this.#begin(await getBitmap(`texture?page=${this.page.id}&max=${max}`));
  }
  #begin(bitmap) {
    const gl = this.renderer.getContext();
    const levels = 1 + Math.floor(Math.log2(Math.max(bitmap.width, bitmap.height)));
    const texture = gl.createTexture();
    this.renderer.state.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, levels, gl.RGBA8, bitmap.width, bitmap.height);
    gl.texParameteri(
        gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER,
        this.renderer.isSoftware ? gl.LINEAR_MIPMAP_NEAREST : gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, this.page.wrap[0]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, this.page.wrap[1]);
    const anisotropy = gl.getExtension('EXT_texture_filter_anisotropic');
    if (anisotropy && !this.renderer.isSoftware) {
      const most = gl.getParameter(anisotropy.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
      gl.texParameterf(gl.TEXTURE_2D, anisotropy.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(8, most));
    }
    this.renderer.state.unbindTexture();
    this.pending = {bitmap, texture, row: 0};
  }
  // Hands over the next strip; true when the whole texture is there.
  step() {
    if (!this.pending) return true;
    const gl = this.renderer.getContext();
    const {bitmap, texture} = this.pending;
    const rows = Math.min(kStripRows, bitmap.height - this.pending.row);
    this.renderer.state.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.pixelStorei(gl.UNPACK_SKIP_ROWS, this.pending.row);
    gl.texSubImage2D(
        gl.TEXTURE_2D, 0, 0, this.pending.row, bitmap.width, rows, gl.RGBA, gl.UNSIGNED_BYTE,
        bitmap);
    gl.pixelStorei(gl.UNPACK_SKIP_ROWS, 0);
    this.pending.row += rows;
    const done = this.pending.row >= bitmap.height;
    if (done) {
      gl.generateMipmap(gl.TEXTURE_2D);
      if (this.texture) gl.deleteTexture(this.texture.sourceTexture);
      this.texture = new THREE.ExternalTexture(texture);
      bitmap.close();
      this.pending = null;
    }
    this.renderer.state.unbindTexture();
    return done;
  }
}

export class Room {
  // scene: of the server. invalidate: asks for a new picture. fail: takes a sentence.
  // refine: as invalidate, when the graphics card has time. handOver: calls handOverTexture(), as
  // long as there is more.
  constructor(scene, renderer, {invalidate, refine, handOver, fail}) {
    this.scene = scene;
    this.refine = refine;
    this.handOver = handOver;
    this.renderer = renderer;
    this.invalidate = invalidate;
    this.fail = fail;
    this.group = new THREE.Group();  // `scan` relative to its origin, turned so that up is +Y
    this.group.quaternion.setFromUnitVectors(
        new THREE.Vector3(...scene.up).normalize(), new THREE.Vector3(0, 1, 0));
    this.group.updateMatrixWorld();
    this.look = new SurfaceLook(scene.uv);
    this.materials = new Map();
    this.mode = 'colour';
    this.frontOnly = true;
    // What is shown lies between `low` and `high` along each of the axes (unit, page frame; up first).
    this.cut = {axes: kAxes, low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9]};
    this.supplementShown = true;
    this.coarseOnly = false;
    this.queue = new Queue(4);
    this.arrived = [];  // meshes to be handed over
    this.pages = scene.pages.map((page) => new PageTexture(renderer, page));
    this.chunks = scene.chunks.map(
        (chunk) => ({
          ...chunk,
          levels: [null, null, null],
          asked: [true, false, false],
          wanted: 0,
          lastWanted: 0,
          box: new THREE.Box3(new THREE.Vector3(...chunk.min), new THREE.Vector3(...chunk.max)),
        }));
    this.numCoarse = 0;
    this.numTriangles = 0;
    this.slow = false;   // the graphics card takes long
    this.tolerance = 1;  // times kWantedEdgePx: larger on slow graphics cards
    this.longestUpload = 0;
  }

  get loaded() {
    return this.numCoarse === this.chunks.length;
  }
  // Nothing more is on its way for this point of view.
  get settled() {
    return this.loaded && this.queue.idle && this.arrived.length === 0 && !this.dirty &&
        this.pages.every((page) => page.complete);
  }
  get progress() {
    const all = this.chunks.length + this.pages.length;
    return (this.numCoarse + this.pages.filter((page) => page.texture).length) / Math.max(all, 1);
  }

  // Of a page, of the scan or of the supplement.
  #material(page, supplement) {
    const key = `${page} ${supplement}`;
    if (!this.materials.has(key)) {
      const material = this.look.makeMaterial(page >= 0, supplement);
      if (page >= 0 && this.pages[page].texture) {
        material.uniforms.page.value = this.pages[page].texture;
      }
      this.materials.set(key, material);
    }
    return this.materials.get(key);
  }

  async load() {
    for (const page of this.pages) this.#loadPage(page);
    await Promise.all(this.chunks.map((chunk) => new Promise((done) => {
                                        this.queue.add(
                                            chunk.id, () => this.#loadCoarse(chunk).finally(done));
                                      })));
  }

  async #loadPage(page) {
    try {
      await page.loadPreview();
      this.#showPage(page);
      const gl = this.renderer.getContext();
      // After the room as a whole: the first picture does not wait for it.
      while (!this.loaded) await new Promise((later) => setTimeout(later, 50));
      await page.loadWhole(gl.getParameter(gl.MAX_TEXTURE_SIZE));
      this.handOver();
    } catch (error) {
      page.complete = true;
      this.fail(error.message);
    }
  }
  #showPage(page) {
    for (const supplement of [false, true]) {
      this.#material(page.page.id, supplement).uniforms.page.value = page.texture;
    }
    this.refine();
  }

  // Without one of its coarse pieces the room is never whole, and nothing finer comes.
  async #loadCoarse(chunk) {
    for (let pause = 500; pause < 60000; pause *= 2) {
      if (await this.#load(chunk, 0)) return;
      await new Promise((later) => setTimeout(later, pause));
    }
  }

  // Resolves to whether it came.
  async #load(chunk, level) {
    try {
      const geometry = parseChunk(await getBytes(`chunk?id=${chunk.id}&level=${level}`), chunk);
      if (needsEvidence(this.mode)) await this.#loadEvidence(chunk, level, geometry);
      const mesh = new THREE.Mesh(geometry, this.#material(chunk.page, chunk.supplement));
      mesh.matrixAutoUpdate = false;
      this.arrived.push({chunk, level, mesh});
      this.dirty = true;
      this.refine();
      return true;
    } catch (error) {
      if (level > 0) chunk.asked[level] = false;
      this.fail(error.message);
      return false;
    }
  }

  async #loadEvidence(chunk, level, geometry) {
    if (geometry.attributes.evidence) return;
    const bytes = await getBytes(`evidence_chunk?id=${chunk.id}&level=${level}`);
    geometry.setAttribute('evidence', new THREE.BufferAttribute(new Uint8Array(bytes), 4, true));
  }

  // mode: one of kModes; evidence: the server's description.
  async setMode(mode, evidence) {
    if (!kModes.includes(mode)) return;
    this.mode = mode;
    if (needsEvidence(mode)) {
      const tasks = [];
      for (const chunk of this.chunks) {
        for (const [level, mesh] of chunk.levels.entries()) {
          if (mesh && !mesh.geometry.attributes.evidence) {
            tasks.push(new Promise(
                (done, failed) => this.queue.add(
                    level,
                    () => this.#loadEvidence(chunk, level, mesh.geometry).then(done, failed))));
          }
        }
      }
      await Promise.all(tasks);
      if (this.mode !== mode) return;  // another one was chosen meanwhile
    }
    this.look.setMode(mode, evidence);
    this.invalidate();
  }
  setCut(cut) {
    this.cut = cut;
    this.look.setCut(cut);
    this.invalidate();
  }
  // What roomtex-dense has added: whether it is seen, and told apart by a tint.
  setSupplement(shown, marked) {
    this.supplementShown = shown;
    this.look.setMarked(marked);
    this.invalidate();
  }
  setBothSides(both) {
    this.frontOnly = !both;
    this.look.setBothSides(both);
    this.invalidate();
  }

  // To be called before every picture: hands over what has arrived, as much as one picture may, and
  // asks for what the camera wants. heightPx: of the picture. Gives whether there are more meshes
  // to hand over.
  update(camera, heightPx) {
    const started = performance.now();
    let bytes = 0;
    const mayTake = this.slow ? kSlowUploadBytes : kUploadBytes;
    while (this.arrived.length > 0 && bytes < mayTake) {
      const {chunk, level, mesh} = this.arrived.shift();
      this.#accept(chunk, level, mesh);
      bytes += 20 * mesh.geometry.attributes.position.count + 2 * mesh.geometry.index.count;
    }
    if (bytes < mayTake) this.handOverTexture();
    this.#choose(camera, heightPx);
    this.dirty = false;
    this.handedOver = bytes > 0 || this.hasPendingTexture;
    this.longestUpload = Math.max(this.longestUpload, performance.now() - started);
    return this.arrived.length > 0;
  }

  get hasPendingTexture() {
    return this.pages.some((page) => page.pending);
  }
  // A strip of a texture, which no picture shows before it is whole: asks for one then.
  handOverTexture() {
    const page = this.pages.find((candidate) => candidate.pending);
    if (!page?.step()) return;
    page.complete = true;
    this.#showPage(page);
  }

  #accept(chunk, level, mesh) {
    chunk.levels[level] = mesh;
    if (level === 0) {
      ++this.numCoarse;
    } else {
      this.numTriangles += mesh.geometry.index.count / 3;
      // The graphics card has them then; rays are cast at the coarse level, or at chunks that
      // come anew.
      for (const attribute of [...Object.values(mesh.geometry.attributes), mesh.geometry.index]) {
        attribute.onUpload(() => {
          attribute.array = null;
        });
      }
    }
    this.group.add(mesh);
    if (needsEvidence(this.mode) && !mesh.geometry.attributes.evidence) {  // chosen meanwhile
      this.queue.add(
          level,
          () => this.#loadEvidence(chunk, level, mesh.geometry)
                    .then(this.invalidate, (error) => this.fail(error.message)));
    }
  }

  #isShown(chunk) {
    return this.supplementShown || !chunk.supplement;
  }

  // The level whose edges are short enough on the screen, and the nearest to it that is there.
  #choose(camera, heightPx) {
    const frustum = new THREE.Frustum().setFromProjectionMatrix(
        new THREE.Matrix4()
            .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
            .multiply(this.group.matrixWorld));
    const eye = this.group.worldToLocal(camera.position.clone());
    const now = performance.now();
    this.shownTriangles = 0;
    for (const chunk of this.chunks) {
      let pxPerMetre;
      if (camera.isOrthographicCamera) {
        pxPerMetre = heightPx * camera.zoom / (camera.top - camera.bottom);
      } else {
        const distance = Math.max(chunk.box.distanceToPoint(eye), camera.near);
        pxPerMetre = heightPx / (2 * distance * Math.tan(camera.fov * Math.PI / 360));
      }
      const edgePx = chunk.spacing * pxPerMetre;
      const inView = this.#isShown(chunk) && frustum.intersectsBox(chunk.box);
      let level = 0;
      while (level < kFull && kEdges[level] * edgePx > kWantedEdgePx * this.tolerance) ++level;
      if (this.coarseOnly) level = 0;
      if (inView && level > 0) {
        chunk.lastWanted = now;
        if (this.loaded && !chunk.asked[level]) {
          chunk.asked[level] = true;
          this.queue.add(1000 - Math.min(edgePx, 1000), () => this.#load(chunk, level));
        }
      }
      let shown = level;
      while (shown > 0 && !chunk.levels[shown]) --shown;
      chunk.levels.forEach((mesh, i) => {
        if (!mesh) return;
        mesh.visible = i === shown && this.#isShown(chunk);
        // From near to far, so that what is hidden costs little.
        mesh.renderOrder = Math.min(chunk.box.distanceToPoint(eye), 900) - 1000;
      });
      if (inView && chunk.levels[shown]) {
        this.shownTriangles += chunk.levels[shown].geometry.index.count / 3;
      }
    }
    this.#forget(now);
  }

  // The finer levels that were not looked at for the longest time, beyond what may be kept; now: when
  // what is in view was last wanted.
  #forget(now) {
    if (this.numTriangles <= kMaxTriangles) return;
    const byAge = [...this.chunks].sort((a, b) => a.lastWanted - b.lastWanted);
    for (const chunk of byAge) {
      for (const level of [1, 2]) {
        const mesh = chunk.levels[level];
        if (!mesh || (mesh.visible && chunk.lastWanted === now)) continue;
        if (this.numTriangles <= kMaxTriangles) return;
        this.numTriangles -= mesh.geometry.index.count / 3;
        this.group.remove(mesh);
        mesh.geometry.dispose();
        chunk.levels[level] = null;
        chunk.asked[level] = false;
      }
    }
  }

  // Where a ray meets the coarse level, for moving about; {distance, point} or null.
  cast(ray) {
    const local = this.#toGroup(ray);
    let best = Infinity;
    for (const {chunk, entry} of this.#alongRay(local)) {
      if (entry >= best) break;
      if (chunk.levels[0]) best = this.#meet(chunk.levels[0].geometry, ray, local, best);
    }
    return best < Infinity ? {distance: best, point: ray.at(best, new THREE.Vector3())} : null;
  }
  // The same of the whole mesh, for measuring: the chunks along the ray come once more, whole.
  async castWhole(ray) {
    const local = this.#toGroup(ray);
    let best = Infinity;
    for (const {chunk, entry} of this.#alongRay(local)) {
      if (entry >= best) break;
      const bytes = await getBytes(`chunk?id=${chunk.id}&level=${kFull}`);
      best = this.#meet(parseChunk(bytes, chunk), ray, local, best);
    }
    return best < Infinity ? {distance: best, point: ray.at(best, new THREE.Vector3())} : null;
  }
  // Of the chunks whose boxes (relative to the origin) `wants` chooses, one after the other.
  async *wholeChunks(wants) {
    for (const chunk of this.chunks) {
      if (!this.#isShown(chunk) || !wants(chunk.box)) continue;
      yield parseChunk(await getBytes(`chunk?id=${chunk.id}&level=${kFull}`), chunk);
    }
  }
  // Whether what is cut away leaves a point of the page.
  isKept(point) {
    const {axes, low, high} = this.cut;
    return axes.every((axis, i) => {
      const along = axis.dot(point);
      return along >= low[i] && along <= high[i];
    });
  }
  #toGroup(ray) {
    return ray.clone().applyMatrix4(this.group.matrixWorld.clone().invert());
  }
  // The chunks whose boxes the ray meets, the nearest first.
  #alongRay(local) {
    const at = new THREE.Vector3(), found = [];
    for (const chunk of this.chunks) {
      if (!this.#isShown(chunk)) continue;
      if (chunk.box.containsPoint(local.origin)) {
        found.push({chunk, entry: 0});
      } else if (local.intersectBox(chunk.box, at)) {
        found.push({chunk, entry: at.distanceTo(local.origin)});
      }
    }
    return found.sort((a, b) => a.entry - b.entry);
  }
  // The distance to the nearest triangle that is seen and nearer than best, or best.
  #meet(geometry, ray, local, best) {
    const positions = geometry.attributes.position.array;
    const corners = geometry.index.array;
    const normals = geometry.attributes.normal.array;
    const at = new THREE.Vector3();
    for (let i = 0; i < corners.length; i += 3) {
      const a = corners[i], b = corners[i + 1], c = corners[i + 2];
      const distance = meet(local.origin, local.direction, positions, a, b, c);
      if (distance >= best) continue;
      if (this.frontOnly && !showsFront(normals, a, b, c, local.direction)) continue;
      ray.at(distance, at);
      if (!this.isKept(at)) continue;
      best = distance;
    }
    return best;
  }

  // Some points of the room, page frame; before it is loaded the corners of its boxes.
  samplePoints() {
    const points = [];
    for (const {levels: [coarse], box} of this.chunks) {
      if (!coarse) {
        for (let i = 0; i < 8; ++i) {
          points.push(new THREE.Vector3(
              i & 1 ? box.min.x : box.max.x, i & 2 ? box.min.y : box.max.y,
              i & 4 ? box.min.z : box.max.z));
        }
        continue;
      }
      const {position} = coarse.geometry.attributes;
      for (let i = 0; i < position.count; i += 1 + (position.count >> 7)) {
        points.push(new THREE.Vector3().fromBufferAttribute(position, i));
      }
    }
    return points.map((point) => point.applyQuaternion(this.group.quaternion));
  }

  // Heading of the walls, radians in [0, pi/2): where most of what stands upright faces.
  wallHeading() {
    const bins = new Float64Array(90);
    const vector = new THREE.Vector3();
    for (const {levels: [coarse]} of this.chunks) {
      if (!coarse) continue;
      const {position, normal} = coarse.geometry.attributes;
      const corners = coarse.geometry.index.array;
      const area = new THREE.Triangle();
      for (let i = 0; i < corners.length; i += 3) {
        vector.fromBufferAttribute(normal, corners[i]).applyQuaternion(this.group.quaternion);
        if (Math.abs(vector.y) > 0.2) continue;
        area.setFromAttributeAndIndices(position, corners[i], corners[i + 1], corners[i + 2]);
        const degrees = Math.round(Math.atan2(vector.x, vector.z) * 180 / Math.PI);
        bins[((degrees % 90) + 90) % 90] += area.getArea();
      }
    }
    let best = 0, most = -1;
    for (let i = 0; i < 90; ++i) {
      const sum = bins[(i + 89) % 90] + 2 * bins[i] + bins[(i + 1) % 90];
      if (sum > most) [best, most] = [i, sum];
    }
    return best * Math.PI / 180;
  }

  // Height of the floor: the lowest height at which much lies level; tables may have more of it.
  floorHeight() {
    const a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
    const box = new THREE.Box3();
    for (const chunk of this.chunks) {
      box.union(chunk.box.clone().applyMatrix4(this.group.matrixWorld));
    }
    if (box.isEmpty()) return 0;
    const middle = (box.min.y + box.max.y) / 2;
    const step = 0.02, areas = new Map();
    for (const {levels: [coarse]} of this.chunks) {
      if (!coarse) continue;
      const {position} = coarse.geometry.attributes;
      const corners = coarse.geometry.index.array;
      for (let i = 0; i < corners.length; i += 3) {
        for (const [vector, k] of [[a, 0], [b, 1], [c, 2]]) {
          vector.fromBufferAttribute(position, corners[i + k])
              .applyQuaternion(this.group.quaternion);
        }
        const height = (a.y + b.y + c.y) / 3;
        const normal = b.sub(a).cross(c.sub(a));
        if (height > middle || normal.y < 0.9 * normal.length()) continue;
        const bin = Math.floor(height / step);
        areas.set(bin, (areas.get(bin) ?? 0) + normal.y);
      }
    }
    const sumAt = (bin) => areas.get(bin) + (areas.get(bin + 1) ?? 0);
    const bins = [...areas.keys()].sort((low, high) => low - high);
    const most = Math.max(0, ...bins.map(sumAt));
    let bin = bins.find((candidate) => sumAt(candidate) >= 0.2 * most);
    if (bin === undefined) return box.min.y;
    if (areas.has(bin + 1) && sumAt(bin + 1) > sumAt(bin)) ++bin;
    return (bin + 1) * step;
  }
}
