// The point of view in the address' fragment, so that it can be sent: scan frame, metres.

import * as THREE from 'three';

const round = (value, digits) => Number(value.toFixed(digits));

// look: {mode, position, quaternion, height} of the page; extra: {name: text}.
export function writeFragment(look, frames, extra) {
  const point = frames.toScan(look.position);
  const q = frames.scanFromPage.clone().multiply(look.quaternion);
  const parts = new URLSearchParams({
    mode: look.mode,
    at: [point.x, point.y, point.z].map((value) => round(value, 4)).join(','),
    q: [q.w, q.x, q.y, q.z].map((value) => round(value, 5)).join(','),
  });
  if (look.mode === 'top') parts.set('height', round(look.height, 3));
  for (const [name, value] of Object.entries(extra)) {
    if (value) parts.set(name, value);
  }
  return '#' + parts.toString().replaceAll('%2C', ',');
}

// The inverse; null for what is none. {look, extra}.
export function readFragment(text, frames) {
  const parts = new URLSearchParams(text.replace(/^#/, ''));
  const numbers = (name, count) => {
    const values = (parts.get(name) ?? '').split(',').map(Number);
    return values.length === count && values.every(Number.isFinite) ? values : null;
  };
  const at = numbers('at', 3), q = numbers('q', 4), mode = parts.get('mode');
  const extra = Object.fromEntries(
      [...parts].filter(([name]) => !['mode', 'at', 'q', 'height'].includes(name)));
  if (!at || !q || !['orbit', 'walk', 'top'].includes(mode)) return {look: null, extra};
  const quaternion = new THREE.Quaternion(q[1], q[2], q[3], q[0]);
  if (!(quaternion.length() > 0.1)) return {look: null, extra};
  return {
    look: {
      mode,
      position: frames.toPage(new THREE.Vector3(...at)),
      quaternion: frames.pageFromScan.clone().multiply(quaternion.normalize()),
      height: Number(parts.get('height')) || 0,
    },
    extra,
  };
}
