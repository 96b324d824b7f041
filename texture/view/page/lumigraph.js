// The surface in the colours of the photos nearest to the point of view (unstructured lumigraph, Buehler
// et al. 2001): a bounded number of photos and their depths on the graphics card, those that suit what
// is looked at. The mixing itself is kLumigraph, a part of the surface's shader.

import * as THREE from 'three';

import {getBitmap, getBytes, Queue} from './api.js';

export const kMaxLayers = 16;  // photos on the graphics card
const kSoftwareLayers = 8;     // where the processor draws
const kSize = 1536;            // pixels of a photo's longer side; 200 MB all together
const kSoftwareSize = 1024;
const kDepthSize = 512;  // ViewLumigraph::kDepthSize
const kMagic = 0x31445452;
const kFade = 300;         // milliseconds in which a photo comes or goes
const kChooseEvery = 250;  // milliseconds, at most
const kRays = [6, 4];      // looked along to find out what is seen
const kPerPlace = 6;       // photos that matter at a place
const kMaxPenalty = 1;     // radians, about: photos farther off than this say nothing
const kReach = 0.25;       // the penalty at which a photo's share has fallen to 1/e

// Defines vec3 lumigraph(point, normal, blended): page frame, metres; linear light.
export const kLumigraph = `
uniform int lumiCount;
uniform vec4 lumiCenter[${kMaxLayers}];   // page frame; w = how far it has faded in
uniform mat4 lumiProject[${kMaxLayers}];  // page frame -> (u z, v z, z), 0..1 over the photo
uniform vec4 lumiGain[${kMaxLayers}];     // w: focal length, pixels
uniform vec4 lumiExtent[${kMaxLayers}];   // part of the layer that is photo, depths
uniform highp sampler2DArray lumiPhotos;
uniform highp sampler2DArray lumiDepths;
uniform float lumiPixel;  // angle of a pixel on the screen; its length without perspective
const int kNearest = 4;
vec3 lumigraph(vec3 point, vec3 normal, vec3 blended) {
  vec3 to_eye = isOrthographic ? vec3(viewMatrix[0][2], viewMatrix[1][2], viewMatrix[2][2])
                               : cameraPosition - point;
  float eye_distance = isOrthographic ? 1e3 : length(to_eye);
  to_eye = normalize(to_eye);
  float eye_facing = dot(normal, normal) > 0.1 ? max(dot(normal, to_eye), 0.1) : 1.0;
  // The best photos in order, and one more: where it comes in, the last of them has no weight.
  float penalty[kNearest + 1];
  vec4 place[kNearest + 1];  // u, v, layer, level of detail
  for (int k = 0; k <= kNearest; ++k) penalty[k] = ${kMaxPenalty.toFixed(1)};
  float footprint = lumiPixel * (isOrthographic ? 1.0 : eye_distance);
  for (int i = 0; i < lumiCount; ++i) {
    vec3 at = (lumiProject[i] * vec4(point, 1.0)).xyz;
    if (at.z < 0.05) continue;
    vec2 uv = at.xy / at.z;
    vec2 inside = min(uv, 1.0 - uv);
    vec3 direction = lumiCenter[i].xyz - point;
    float reach = length(direction);
    direction /= reach;
    float facing = dot(normal, normal) > 0.1 ? dot(normal, direction) : 1.0;
    // How well it sees the place; fades out at its border, at a slant and behind things.
    float seen = lumiCenter[i].w * smoothstep(0.0, 0.06, min(inside.x, inside.y)) *
                 smoothstep(0.05, 0.3, facing);
    if (seen <= 0.0) continue;
    // The angle, and how much coarser the photo shows the place than one from here would.
    float coarser = reach / eye_distance * eye_facing / max(facing, 0.1);
    float cost = acos(clamp(dot(direction, to_eye), -1.0, 1.0)) +
                 0.15 * clamp(log2(coarser), 0.0, 2.0) + 0.01;
    if (cost >= penalty[kNearest] * seen) continue;
    // 1/depth, which is linear over planes. 0: the scan has nothing there.
    float nearest = texture(lumiDepths, vec3(uv * lumiExtent[i].zw, float(i))).r;
    float slack = 0.004 + 0.015 / at.z;
    seen *= 1.0 - smoothstep(slack, 2.0 * slack, nearest * at.z - 1.0);
    if (cost >= penalty[kNearest] * seen) continue;
    cost /= seen;
    float level = log2(max(footprint * lumiGain[i].w / at.z, 1.0));
    vec4 now = vec4(uv * lumiExtent[i].xy, float(i), level);
    for (int k = 0; k <= kNearest; ++k) {
      if (cost >= penalty[k]) continue;
      float other_cost = penalty[k];
      vec4 other = place[k];
      penalty[k] = cost;
      place[k] = now;
      cost = other_cost;
      now = other;
    }
  }
  float limit = penalty[kNearest];
  float weights = 0.7;  // of the blended colour, which is all where no photo near enough sees
  vec3 sum = weights * blended;
  for (int k = 0; k < kNearest; ++k) {
    if (penalty[k] >= limit) break;
    // A mirror image moves with who looks: a photo from farther aside has another one. What is
    // nearest of all counts many times, since mixing blurs.
    float off = penalty[k] / ${kReach}, near = 0.05 / penalty[k];
    float weight = exp(-off * off) * (1.0 + near * near) * (1.0 - penalty[k] / limit);
    int i = int(place[k].z);
    vec3 light = textureLod(lumiPhotos, place[k].xyz, place[k].w).rgb;
    // Near white a photo no longer says how light it is.
    weight *= 1.0 - 0.95 * smoothstep(0.75, 0.95, max(light.r, max(light.g, light.b)));
    sum += weight * lumiGain[i].rgb * light;
    weights += weight;
  }
  return sum / weights;
}`;

// Uniforms of kLumigraph, shared by all materials.
export function lumigraphUniforms() {
  const list = (make) => ({value: Array.from({length: kMaxLayers}, make)});
  return {
    lumiCount: {value: 0},
    lumiCenter: list(() => new THREE.Vector4()),
    lumiProject: list(() => new THREE.Matrix4()),
    lumiGain: list(() => new THREE.Vector4()),
    lumiExtent: list(() => new THREE.Vector4()),
    lumiPhotos: {value: null},
    lumiDepths: {value: null},
    lumiPixel: {value: 0},
  };
}

// Page frame to (u z, v z, z) of a photo: see the shader.
function projection(camera, {focal, centre}) {
  const view = new THREE.Matrix4()
                   .compose(camera.position, camera.quaternion, new THREE.Vector3(1, 1, 1))
                   .invert();  // y up, z backward
  return new THREE.Matrix4()
      .set(focal[0], 0, -centre[0], 0, 0, -focal[1], -centre[1], 0, 0, 0, -1, 0, 0, 0, 0, 1)
      .multiply(view);
}

export class Lumigraph {
  // photos: of the server; cameras: of Cameras. cast: a ray -> {point} or null, page frame.
  constructor(photos, cameras, {renderer, uniforms, cast, invalidate, fail}) {
    this.renderer = renderer;
    this.uniforms = uniforms;
    this.cast = cast;
    this.invalidate = invalidate;
    this.fail = fail;
    this.queue = new Queue(2);
    this.size = renderer.isSoftware ? kSoftwareSize : kSize;
    this.photos = photos.map((photo) => {
      const camera = cameras[photo.id];
      return {...photo, position: camera.position, project: projection(camera, photo), layer: null};
    });
    const numLayers =
        Math.min(renderer.isSoftware ? kSoftwareLayers : kMaxLayers, this.photos.length);
    // photo: whose place this is; bitmap, depths: arrived, not handed over; ready: it is there.
    this.layers =
        Array.from({length: numLayers}, () => ({photo: null, ready: false, fade: 0, target: 0}));
    this.still = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.wanted = [];
    this.chosenFor = '';
    this.chosenAt = -Infinity;
  }

  // Nothing more is on its way for this point of view.
  get settled() {
    return this.queue.idle && this.chosenFor === this.lookedFrom &&
        this.layers.every(({fade, target, bitmap}) => !bitmap && fade === target);
  }

  #makeTextures() {
    const gl = this.renderer.getContext(), {state} = this.renderer;
    const make = (levels, format, size, filter) => {
      const texture = gl.createTexture();
      state.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
      gl.texStorage3D(gl.TEXTURE_2D_ARRAY, levels, format, size, size, this.layers.length);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      state.unbindTexture();
      return new THREE.ExternalTexture(texture);
    };
    // Their bytes are sRGB; the graphics card mixes light.
    this.uniforms.lumiPhotos.value = make(5, gl.SRGB8_ALPHA8, this.size, gl.LINEAR_MIPMAP_LINEAR);
    this.uniforms.lumiDepths.value = make(1, gl.R16F, kDepthSize, gl.LINEAR);
  }

  // Before every picture. heightPx: of the picture. rays: rays of the page over the picture,
  // columns x rows -> [ray]. Gives whether another picture is needed soon.
  update(camera, heightPx, rays) {
    if (!this.uniforms.lumiPhotos.value) this.#makeTextures();
    const now = performance.now();
    const passed = Math.min(now - (this.updatedAt ?? now), 100);
    this.updatedAt = now;
    this.lookedFrom = [...camera.matrixWorld.elements, ...camera.projectionMatrix.elements].join();
    if (this.chosenFor !== this.lookedFrom) {
      clearTimeout(this.timer);
      if (now - this.chosenAt > kChooseEvery) {
        this.chosenFor = this.lookedFrom;
        this.chosenAt = now;
        this.#choose(camera, rays(...kRays));
      } else {
        this.timer = setTimeout(this.invalidate, kChooseEvery);
      }
    }
    this.#fade(passed);
    this.#fill();
    this.#setUniforms(camera, heightPx);
    return this.layers.some(({fade, target}) => fade !== target);
  }

  // The photos that see most of what is looked at from about here.
  #choose(camera, rays) {
    const scores = new Map(this.photos.map((photo) => [photo, 0]));
    const eye = camera.position, direction = new THREE.Vector3(), at = new THREE.Vector3();
    for (const ray of rays) {
      const point = this.cast(ray)?.point;
      if (!point) continue;
      const toEye = ray.direction.clone().negate();
      const distance = camera.isOrthographicCamera ? Infinity : eye.distanceTo(point);
      const able = [];
      for (const photo of this.photos) {
        at.copy(point).applyMatrix4(photo.project);
        if (at.z < 0.05 || Math.min(at.x, at.y) < 0 || Math.max(at.x, at.y) > at.z) continue;
        direction.subVectors(photo.position, point);
        const far = direction.length() / distance - 1;
        const penalty = direction.angleTo(toEye) + 0.1 * Math.min(Math.max(far, 0), 2);
        if (penalty < kMaxPenalty) able.push({photo, penalty});
      }
      able.sort((a, b) => a.penalty - b.penalty);
      for (const {photo, penalty} of able.slice(0, kPerPlace)) {
        scores.set(photo, scores.get(photo) + Math.exp(-((penalty / kReach) ** 2)));
      }
    }
    this.wanted = [...scores.entries()]
                      .filter(([, score]) => score > 0)
                      .sort((a, b) => b[1] - a[1])
                      .slice(0, this.layers.length)
                      .map(([photo]) => photo);
    this.#assign();
  }

  // Layers for the wanted photos that have none; a photo that has to go fades first.
  #assign() {
    const missing = this.wanted.filter((photo) => photo.layer === null);
    const free = this.layers.filter(({photo}) => !this.wanted.includes(photo))
                     .sort((a, b) => a.fade - b.fade || (a.usedAt ?? 0) - (b.usedAt ?? 0));
    for (const layer of this.layers) {
      if (this.wanted.includes(layer.photo)) {
        layer.usedAt = performance.now();
        layer.target = layer.ready ? 1 : 0;
      }
    }
    missing.forEach((photo, i) => {
      const layer = free[i];
      if (!layer) return;
      layer.target = 0;
      if (layer.fade > 0 && !this.still) return;  // the next time
      if (layer.photo) layer.photo.layer = null;
      Object.assign(layer, {photo, ready: false, fade: 0, bitmap: null, usedAt: performance.now()});
      photo.layer = layer;
      this.queue.add(i, () => this.#load(layer, photo));
    });
  }
  async #load(layer, photo) {
    if (layer.photo !== photo) return;  // gone before its turn
    try {
      const [bitmap, depths] = await Promise.all([
        getBitmap(`pinhole_photo?id=${photo.id}&max=${this.size}`),
        getBytes(`depths?id=${photo.id}`),
      ]);
      if (layer.photo !== photo) return bitmap.close();
      Object.assign(layer, {bitmap, depths});
      this.invalidate();
    } catch (error) {
      // It does not take part; its layer is free for another.
      this.photos = this.photos.filter((other) => other !== photo);
      if (layer.photo === photo) layer.photo = null;
      this.fail(error.message);
    }
  }

  // Hands over what has arrived.
  #fill() {
    const gl = this.renderer.getContext(), {state} = this.renderer;
    let changed = false;
    this.layers.forEach((layer, i) => {
      if (!layer.bitmap) return;
      const {bitmap, depths, photo} = layer;
      const [magic, width, height] = new Uint32Array(depths, 0, 3);
      layer.bitmap = layer.depths = null;
      if (magic !== kMagic || Math.max(width, height) > kDepthSize ||
          Math.max(bitmap.width, bitmap.height) > this.size) {
        bitmap.close();
        return this.fail('A photo came damaged. Reload the page.');
      }
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
      gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
      state.bindTexture(gl.TEXTURE_2D_ARRAY, this.uniforms.lumiPhotos.value.sourceTexture);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
      gl.texSubImage3D(
          gl.TEXTURE_2D_ARRAY, 0, 0, 0, i, bitmap.width, bitmap.height, 1, gl.RGBA,
          gl.UNSIGNED_BYTE, bitmap);
      state.bindTexture(gl.TEXTURE_2D_ARRAY, this.uniforms.lumiDepths.value.sourceTexture);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
      gl.texSubImage3D(
          gl.TEXTURE_2D_ARRAY, 0, 0, 0, i, width, height, 1, gl.RED, gl.HALF_FLOAT,
          new Uint16Array(depths, 16));
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
      this.uniforms.lumiProject.value[i].copy(photo.project);
      this.uniforms.lumiGain.value[i].set(...photo.gain, photo.focal[0] * bitmap.width);
      this.uniforms.lumiExtent.value[i].set(
          bitmap.width / this.size, bitmap.height / this.size, width / kDepthSize,
          height / kDepthSize);
      bitmap.close();
      layer.ready = true;
      layer.target = 1;
      changed = true;
    });
    if (!changed) return;
    state.bindTexture(gl.TEXTURE_2D_ARRAY, this.uniforms.lumiPhotos.value.sourceTexture);
    gl.generateMipmap(gl.TEXTURE_2D_ARRAY);
    state.unbindTexture();
  }

  #fade(passed) {
    let gone = false;
    for (const layer of this.layers) {
      const step = this.still ? 1 : passed / kFade;
      const before = layer.fade;
      layer.fade += Math.min(Math.max(layer.target - layer.fade, -step), step);
      gone ||= before > 0 && layer.fade === 0;
    }
    if (gone) this.#assign();
  }

  #setUniforms(camera, heightPx) {
    this.uniforms.lumiCount.value = this.layers.length;
    this.uniforms.lumiPixel.value = camera.isOrthographicCamera ?
        (camera.top - camera.bottom) / camera.zoom / heightPx :
        2 * Math.tan(camera.fov * Math.PI / 360) / heightPx;
    this.layers.forEach(({photo, ready, fade}, i) => {
      const {x, y, z} = photo?.position ?? {x: 0, y: 0, z: 0};
      this.uniforms.lumiCenter.value[i].set(x, y, z, ready ? fade : 0);
    });
  }
}
