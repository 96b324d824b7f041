// How the surface is drawn: the colours of the file, to the byte; or what they rest on, as a colour
// map. No light, no tone mapping, no colour conversion: what is in the texture is on the screen.

import * as THREE from 'three';

import {kLumigraph, lumigraphUniforms} from './lumigraph.js';

export const kModes = ['colour', 'intensity', 'views', 'disagreement', 'view-dependent'];
// Those that show what the colours rest on, by evidence.ply.
export const needsEvidence = (mode) => ['intensity', 'views', 'disagreement'].includes(mode);

// OKLCh (Ottosson 2020) to sRGB bytes; null outside sRGB.
function srgbFromOklch(lightness, chroma, hueDeg) {
  const a = chroma * Math.cos(hueDeg * Math.PI / 180);
  const b = chroma * Math.sin(hueDeg * Math.PI / 180);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3;
  const linear = [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s
  ];
  if (linear.some((value) => value < -1e-4 || value > 1.0001)) return null;
  return linear.map((value) => {
    const v = Math.min(Math.max(value, 0), 1);
    return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  });
}

// A colour map whose lightness rises evenly from end to end, so that more always looks like more,
// in grey and to the colour-blind as well. t: 0..1. hues: of both ends.
function mapColor(t, [from, to]) {
  const lightness = 0.27 + 0.66 * t;
  const hue = from + (to - from) * t;
  for (let chroma = 0.16; chroma > 0; chroma -= 0.004) {
    const color = srgbFromOklch(lightness, chroma, hue);
    if (color) return color;
  }
  return [128, 128, 128];
}

// Blue to yellow by way of green; violet to yellow by way of red.
const kHues = {
  views: [285, 105],
  disagreement: [290, 450]
};

// Bytes r g b of the map of a mode, from low to high.
export function colorMap(mode, steps) {
  const colors = [];
  for (let i = 0; i < steps; ++i) {
    const t = steps > 1 ? i / (steps - 1) : 0;
    colors.push(
        mode === 'intensity' ? Array(3).fill(Math.round(255 * t)) : mapColor(t, kHues[mode]));
  }
  return colors;
}

// Where nothing is known: no photo, no pair of photos, no evidence. A blue grey that none of the
// maps holds at that lightness.
export const kUnknownColor = [92, 98, 110];

// Over what roomtex-dense has added, where that is to be told apart.
const kMarkColor = [230, 60, 220];

function mapTexture(mode) {
  const bytes = new Uint8Array(4 * 256);
  colorMap(mode, 256).forEach(([r, g, b], i) => bytes.set([r, g, b, 255], 4 * i));
  const texture = new THREE.DataTexture(bytes, 256, 1);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

// The front is what the scanner saw; the normals are smooth, so that at edges they lean
// (view_model.h).
export const kFrontMargin = 0.05;

const kVertex = `
in vec4 tint;
in vec4 evidence;
uniform bool front_only;
uniform vec2 uvLow;
uniform vec2 uvHigh;
out float v_facing;
out vec2 v_uv;
out vec3 v_color;
out float v_known;
out vec4 v_evidence;
out vec3 v_point;
out vec3 v_normal;
void main() {
  v_uv = mix(uvLow, uvHigh, uv);
  v_color = tint.rgb;
  // The shares of what is known, so that it does not mix with what is not.
  float known = 1.0 - evidence.w;
  float compared = evidence.z < 0.9999 ? known : 0.0;
  v_evidence = vec4(evidence.x, evidence.y * 255.0, evidence.z * 255.0 * compared, compared);
  vec4 place = modelMatrix * vec4(position, 1.0);
  // From the eye; in a picture without perspective along its axis.
  vec3 along = isOrthographic ? -vec3(viewMatrix[0][2], viewMatrix[1][2], viewMatrix[2][2])
                              : normalize(place.xyz - cameraPosition);
  vec3 up = mat3(modelMatrix) * normal;
  v_facing = front_only && dot(up, up) > 0.1 ? dot(up, along) : -1.0;
  v_known = known;
  v_point = place.xyz;
  v_normal = up;
  gl_Position = projectionMatrix * viewMatrix * place;
}`;

const kFragment = `
uniform int mode;
uniform bool textured;
uniform sampler2D page;
uniform sampler2D ramp;
uniform mat3 cutAxes;  // a row each
uniform vec3 cutLow;
uniform vec3 cutHigh;
uniform float high;
uniform vec3 unknown;
uniform float mark;
in vec2 v_uv;
in vec3 v_color;
in float v_known;
in vec4 v_evidence;
in float v_facing;
in vec3 v_point;
in vec3 v_normal;
out vec4 pixel;
#ifdef LUMIGRAPH
${kLumigraph}
vec3 linear_from_srgb(vec3 c) {
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}
vec3 srgb_from_linear(vec3 c) {
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
#endif
vec3 mapped(float t) {
  return texture(ramp, vec2((clamp(t, 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5)).rgb;
}
void main() {
  vec3 along = cutAxes * v_point;
  if (v_facing > ${kFrontMargin} || any(lessThan(along, cutLow)) ||
      any(greaterThan(along, cutHigh))) {
    discard;
  }
  vec3 shown;
  if (mode == 0 || mode == 4) {
    shown = textured ? texture(page, v_uv).rgb : v_color;
#ifdef LUMIGRAPH
    float length2 = dot(v_normal, v_normal);
    vec3 normal = length2 > 0.1 ? v_normal * inversesqrt(length2) : vec3(0.0);
    shown = srgb_from_linear(clamp(lumigraph(v_point, normal, linear_from_srgb(shown)), 0.0, 1.0));
#endif
  } else if (v_known < 0.5) {
    shown = unknown;
  } else if (mode == 1) {
    shown = vec3(v_evidence.x);
  } else if (mode == 2) {
    float views = floor(v_evidence.y + 0.5);
    shown = views < 0.5 ? unknown : mapped((views - 1.0) / max(high - 1.0, 1.0));
  } else {
    shown = v_evidence.w < 0.5 ? unknown : mapped(v_evidence.z / v_evidence.w / high);
  }
  pixel = vec4(mix(shown, vec3(${kMarkColor.map((value) => (value / 255).toFixed(3))}), mark), 1.0);
}`;

// The materials of all pages and what they have in common.
export class SurfaceLook {
  #ramps = {views: mapTexture('views'), disagreement: mapTexture('disagreement')};
  #blank = new THREE.DataTexture(new Uint8Array([120, 120, 120, 255]), 1, 1);
  #shared = {
    mode: {value: 0},
    ramp: {value: this.#ramps.views},
    cutAxes: {value: new THREE.Matrix3()},
    cutLow: {value: new THREE.Vector3(-1e9, -1e9, -1e9)},
    cutHigh: {value: new THREE.Vector3(1e9, 1e9, 1e9)},
    front_only: {value: true},
    high: {value: 1},
    unknown: {value: new THREE.Vector3(...kUnknownColor).divideScalar(255)},
    uvLow: {value: new THREE.Vector2(0, 0)},
    uvHigh: {value: new THREE.Vector2(1, 1)},
    ...lumigraphUniforms(),
  };
  #mark = {value: 0};  // share of kMarkColor in the supplement
  #materials = [];
  #viewDependent = false;

  // uv: {low, high} of what the pieces have as 0 and 1.
  constructor(uv) {
    this.#blank.needsUpdate = true;
    this.#shared.uvLow.value.set(...uv.low);
    this.#shared.uvHigh.value.set(...uv.high);
  }

  // textured: or in the colours of the points. supplement: what may be marked.
  makeMaterial(textured, supplement) {
    const material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: kVertex,
      fragmentShader: kFragment,
      side: THREE.DoubleSide,
      uniforms: {
        ...this.#shared,
        textured: {value: textured},
        page: {value: this.#blank},
        mark: supplement ? this.#mark : {value: 0},
      },
      defines: this.#viewDependent ? {LUMIGRAPH: ''} : {},
    });
    this.#materials.push(material);
    return material;
  }

  // Those of kLumigraph.
  get lumigraphUniforms() {
    return this.#shared;
  }

  // evidence: the server's description; needed where needsEvidence(mode).
  setMode(mode, evidence) {
    if (this.#viewDependent !== (mode === 'view-dependent')) {
      this.#viewDependent = mode === 'view-dependent';
      for (const material of this.#materials) {
        material.defines = this.#viewDependent ? {LUMIGRAPH: ''} : {};
        material.needsUpdate = true;
      }
    }
    this.#shared.mode.value = kModes.indexOf(mode);
    if (mode === 'views') this.#shared.high.value = Math.max(evidence.max_views, 2);
    if (mode === 'disagreement') {
      this.#shared.high.value = evidence.disagreement_high / evidence.disagreement_step;
    }
    this.#shared.ramp.value = this.#ramps[mode] ?? this.#ramps.views;
  }
  // What lies between is shown.
  setCut({axes: [a, b, c], low, high}) {
    this.#shared.cutAxes.value.set(a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z);
    this.#shared.cutLow.value.set(...low);
    this.#shared.cutHigh.value.set(...high);
  }
  setMarked(marked) {
    this.#mark.value = marked ? 0.45 : 0;
  }
  setBothSides(both) {
    this.#shared.front_only.value = !both;
  }
}
