// The cameras of the aligned model as frusta, their photos, and the sparse points.

import * as THREE from 'three';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';

import {getBitmap, getBytes, getJson} from './api.js';

const kColors = {
  plain: 0x4fb3ff,
  chosen: 0xffc247,
  hovered: 0xffffff,
  missing: 0x8b95a5
};
const kThumbnail = 256;  // pixels
const kMaxNear = 24;     // cameras that show their photo small
const kMaxKept = 64;     // small photos that are kept

function bitmapTexture(bitmap) {
  const texture = new THREE.Texture(bitmap);
  texture.flipY = false;
  texture.generateMipmaps = true;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.anisotropy = 4;
  texture.needsUpdate = true;
  return texture;
}

export class Cameras {
  // list: of the server. parts: {frames, invalidate, fail, maxTexture}.
  constructor(list, {frames, invalidate, fail, maxTexture}) {
    this.frames = frames;
    this.invalidate = invalidate;
    this.fail = fail;
    this.maxTexture = Math.min(maxTexture, 4096);
    this.group = new THREE.Group();
    this.overlay = new THREE.Group();  // the photo of the camera one stands in
    this.list =
        list.map((camera) => ({
                   ...camera,
                   position: frames.toPage(new THREE.Vector3(...camera.center)),
                   quaternion: frames.cameraRotation(camera.rotation_wxyz),
                   // In the camera of three.js: y up, z backward; at depth 1.
                   corners: camera.corners.map(
                       ([x, y, z]) => new THREE.Vector3(x, -y, -z).divideScalar(Math.max(z, 0.2))),
                 }));
    this.visible = true;
    this.pictures = true;
    this.hovered = null;
    this.chosen = null;
    this.opacity = 1;
    this.size = 0.2;
    this.material = new LineMaterial({vertexColors: true, linewidth: 1.6});
    this.lines = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.lines.frustumCulled = false;
    this.group.add(this.lines);
    this.thumbnails = new Map();  // id -> mesh
    this.near = new Set();        // so near to the eye that they would only be in the way
    this.points = null;
  }

  setSize(size) {
    this.size = size;
    for (const [id, mesh] of this.thumbnails) this.#placeThumbnail(mesh, this.list[id]);
    this.#draw();
  }
  setVisible(visible) {
    this.visible = visible;
    this.#draw();
  }
  resize(width, height) {
    this.material.resolution.set(width, height);
  }

  #corner(camera, k, out) {
    return out.copy(camera.corners[k])
        .multiplyScalar(this.size)
        .applyQuaternion(camera.quaternion)
        .add(camera.position);
  }

  #draw() {
    this.group.visible = this.visible && this.list.length > 0;
    if (this.list.length === 0) return;
    const positions = [], colors = [], color = new THREE.Color();
    const corners = [0, 1, 2, 3].map(() => new THREE.Vector3());
    const add = (a, b) => {
      positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
      colors.push(color.r, color.g, color.b, color.r, color.g, color.b);
    };
    for (const camera of this.list) {
      // To who stands in a camera the others would only be in the way.
      if (this.standing && camera !== this.hovered) continue;
      if (camera === this.standing || this.near.has(camera)) continue;
      color.set(
          camera === this.hovered    ? kColors.hovered :
              camera === this.chosen ? kColors.chosen :
              camera.photo           ? kColors.plain :
                                       kColors.missing);
      corners.forEach((corner, k) => this.#corner(camera, k, corner));
      for (let k = 0; k < 4; ++k) {
        add(camera.position, corners[k]);
        add(corners[k], corners[(k + 1) % 4]);
      }
      // Which side is up.
      const right = corners[1].clone().sub(corners[0]);
      const up = corners[0].clone().sub(corners[3]);
      const left = corners[0].clone().addScaledVector(right, 0.38);
      const tip = corners[0].clone().addScaledVector(right, 0.5).addScaledVector(up, 0.16);
      add(left, tip);
      add(tip, corners[0].clone().addScaledVector(right, 0.62));
    }
    this.lines.geometry.dispose();
    this.lines.geometry = new LineSegmentsGeometry();
    if (positions.length > 0) {
      this.lines.geometry.setPositions(positions);
      this.lines.geometry.setColors(colors);
    }
    this.lines.visible = positions.length > 0;
    this.invalidate();
  }

  // --- the one under the pointer --------------------------------------------------------------

  // The camera whose frustum the ray meets before `limit`, or whose centre is within a few pixels.
  find(ray, limit, pixelAngle) {
    if (!this.visible || this.standing) return null;
    let best = null, nearest = limit;
    const c = [0, 1, 2, 3].map(() => new THREE.Vector3()), at = new THREE.Vector3();
    for (const camera of this.list) {
      if (camera === this.standing || this.near.has(camera)) continue;
      c.forEach((corner, k) => this.#corner(camera, k, corner));
      const faces = [[c[0], c[1], c[2]], [c[0], c[2], c[3]]];
      for (let k = 0; k < 4; ++k) faces.push([camera.position, c[k], c[(k + 1) % 4]]);
      let distance = Infinity;
      for (const [a, b, d] of faces) {
        if (ray.intersectTriangle(a, b, d, false, at)) {
          distance = Math.min(distance, at.distanceTo(ray.origin));
        }
      }
      const along = camera.position.clone().sub(ray.origin).dot(ray.direction);
      if (along > 0 && ray.distanceToPoint(camera.position) < 8 * pixelAngle * along) {
        distance = Math.min(distance, along);
      }
      if (distance < nearest) [best, nearest] = [camera, distance];
    }
    return best;
  }
  setHovered(camera) {
    if (camera === this.hovered) return;
    this.hovered = camera;
    if (camera?.photo) this.#showThumbnail(camera);
    this.#draw();
  }
  setChosen(camera) {
    this.chosen = camera;
    this.#draw();
  }

  // --- small photos ---------------------------------------------------------------------------

  #placeThumbnail(mesh, camera) {
    const corners = [0, 1, 2, 3].map((k) => this.#corner(camera, k, new THREE.Vector3()));
    const {position} = mesh.geometry.attributes;
    [corners[0], corners[1], corners[3], corners[2]].forEach(
        (corner, i) => position.setXYZ(i, corner.x, corner.y, corner.z));
    position.needsUpdate = true;
    mesh.geometry.computeBoundingSphere();
  }
  async #showThumbnail(camera) {
    if (this.thumbnails.has(camera.id) || !camera.photo || camera.loading) return;
    camera.loading = true;
    try {
      const texture = bitmapTexture(await getBitmap(`photo?id=${camera.id}&max=${kThumbnail}`));
      const geometry = new THREE.PlaneGeometry(1, 1);
      const uv = [[0, 0], [1, 0], [0, 1], [1, 1]];
      uv.forEach(([u, v], i) => geometry.attributes.uv.setXY(i, u, v));
      const mesh = new THREE.Mesh(
          geometry,
          new THREE.MeshBasicMaterial({map: texture, side: THREE.DoubleSide, toneMapped: false}));
      this.#placeThumbnail(mesh, camera);
      mesh.userData.seen = performance.now();
      this.thumbnails.set(camera.id, mesh);
      this.group.add(mesh);
      this.invalidate();
    } catch (error) {
      camera.photo = false;
      this.fail(error.message);
    } finally {
      camera.loading = false;
    }
  }
  // Before every picture: small photos in the cameras near the eye.
  update(eye) {
    if (!this.visible) return;
    const inTheWay =
        this.list.filter((camera) => camera.position.distanceTo(eye) < 1.6 * this.size);
    if (inTheWay.length !== this.near.size || inTheWay.some((camera) => !this.near.has(camera))) {
      this.near = new Set(inTheWay);
      this.#draw();
    }
    const near =
        this.list.filter((camera) => camera.photo)
            .sort((a, b) => a.position.distanceToSquared(eye) - b.position.distanceToSquared(eye))
            .slice(0, kMaxNear);
    for (const [id, mesh] of this.thumbnails) {
      const camera = this.list[id];
      mesh.visible = !this.standing && !this.near.has(camera) &&
          (camera === this.hovered || (this.pictures && near.includes(camera)));
      if (mesh.visible) mesh.userData.seen = performance.now();
    }
    this.#forget();
    if (!this.pictures) return;
    for (const camera of near) this.#showThumbnail(camera);
  }
  // Those that were not seen for the longest time.
  #forget() {
    if (this.thumbnails.size <= kMaxKept) return;
    const byAge = [...this.thumbnails].sort(([, a], [, b]) => a.userData.seen - b.userData.seen);
    for (const [id, mesh] of byAge.slice(0, -kMaxKept)) {
      const {geometry, material} = mesh;
      this.group.remove(mesh);
      this.thumbnails.delete(id);
      geometry.dispose();
      material.map.image.close();
      material.map.dispose();
      material.dispose();
    }
  }
  setPictures(on) {
    this.pictures = on;
    this.invalidate();
  }

  // --- standing in a camera -------------------------------------------------------------------

  // Tangents of the half angles that hold the photo, whatever its distortion.
  lens(camera) {
    const tan = (k) =>
        Math.max(...camera.corners.map((corner) => Math.abs(corner.getComponent(k))));
    return {tanX: 1.01 * tan(0), tanY: 1.01 * tan(1)};
  }

  // Draws the photo where it was taken: on a lattice of the directions of its pixels.
  async stand(camera) {
    this.leave();
    this.standing = camera;
    this.setHovered(null);
    this.setChosen(camera);
    if (!camera.photo) return;
    try {
      const size = Math.min(this.maxTexture, Math.max(camera.width, camera.height));
      const [lattice, bitmap] = await Promise.all([
        getJson(`lattice?id=${camera.id}`),
        getBitmap(`photo?id=${camera.id}&max=${size}`),
      ]);
      if (this.standing !== camera) return bitmap.close();
      this.leave(true);
      const mesh = new THREE.Mesh(latticeGeometry(lattice), new THREE.ShaderMaterial({
        glslVersion: THREE.GLSL3,
        uniforms: {photo: {value: bitmapTexture(bitmap)}, opacity: {value: this.opacity}},
        vertexShader: `
          out vec2 v_uv;
          void main() {
            v_uv = uv;
            gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
          }`,
        fragmentShader: `
          uniform sampler2D photo;
          uniform float opacity;
          in vec2 v_uv;
          out vec4 pixel;
          void main() { pixel = vec4(texture(photo, v_uv).rgb, opacity); }`,
        transparent: true,
        depthTest: false,
        depthWrite: false,
        side: THREE.DoubleSide,
      }));
      mesh.position.copy(camera.position);
      mesh.quaternion.copy(camera.quaternion);
      mesh.renderOrder = 500;
      mesh.frustumCulled = false;
      mesh.visible = this.opacity > 0;
      this.overlay.add(mesh);
      this.invalidate();
    } catch (error) {
      this.fail(error.message);
    }
  }
  get photoShown() {
    return this.overlay.children.length > 0;
  }
  // onlyPhoto: stays in the camera.
  leave(onlyPhoto = false) {
    for (const mesh of [...this.overlay.children]) {
      mesh.material.uniforms.photo.value.dispose();
      mesh.material.uniforms.photo.value.image.close?.();
      mesh.material.dispose();
      mesh.geometry.dispose();
      this.overlay.remove(mesh);
    }
    if (onlyPhoto) return;
    this.standing = null;
    this.#draw();
  }
  setOpacity(opacity) {
    this.opacity = opacity;
    for (const mesh of this.overlay.children) {
      mesh.material.uniforms.opacity.value = opacity;
      mesh.visible = opacity > 0;
    }
    this.invalidate();
  }

  // --- sparse points --------------------------------------------------------------------------

  async setPointsVisible(visible) {
    if (visible && !this.points) {
      const bytes = await getBytes('points');
      const count = bytes.byteLength / 16;
      const interleaved = new THREE.InterleavedBuffer(new Float32Array(bytes), 4);
      const colors = new THREE.InterleavedBuffer(new Uint8Array(bytes), 16);
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.InterleavedBufferAttribute(interleaved, 3, 0));
      geometry.setAttribute('color', new THREE.InterleavedBufferAttribute(colors, 3, 12, true));
      geometry.setDrawRange(0, count);
      this.points = new THREE.Points(
          geometry,
          new THREE.PointsMaterial(
              {size: 3, sizeAttenuation: false, vertexColors: true, toneMapped: false}));
      this.points.quaternion.copy(this.frames.pageFromScan);
      this.points.frustumCulled = false;
      this.overlay.parent?.add(this.points);
    }
    if (this.points) this.points.visible = visible;
    this.invalidate();
  }
}

// The nodes of the lattice at unit distance; cells of which a corner has no direction are left out.
function latticeGeometry({columns, rows, directions}) {
  const positions = new Float32Array(3 * columns * rows), uv = new Float32Array(2 * columns * rows);
  const known = new Uint8Array(columns * rows), corners = [];
  for (let row = 0, i = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column, ++i) {
      const [x, y, z] = directions.slice(3 * i, 3 * i + 3);
      positions.set([x, -y, -z], 3 * i);
      uv.set([column / (columns - 1), row / (rows - 1)], 2 * i);
      known[i] = x * x + y * y + z * z > 0.5;
    }
  }
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column + 1 < columns; ++column) {
      const a = row * columns + column, b = a + 1, c = a + columns, d = c + 1;
      if (known[a] && known[b] && known[c] && known[d]) corners.push(a, c, b, b, c, d);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute('uv', new THREE.BufferAttribute(uv, 2));
  geometry.setIndex(corners);
  return geometry;
}
