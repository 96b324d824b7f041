// Roofs by a few numbers. A plane of a roof: see docs/outline.md.

const kDeg = Math.PI / 180;

// The direction out of a wall, and how far the footprint reaches along it.
function across(footprint, wall) {
  const [a, b] = [footprint[wall], footprint[(wall + 1) % footprint.length]];
  const size = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const out = [(b[1] - a[1]) / size, -(b[0] - a[0]) / size];
  const along = footprint.map(([x, y]) => out[0] * x + out[1] * y);
  return {out, low: Math.min(...along), high: Math.max(...along)};
}

function plane(footprint, out, at, height, rise) {
  // A point at `at` along `out`, beside the first corner.
  const [x, y] = footprint[0];
  const more = at - (out[0] * x + out[1] * y);
  return {
    point: [x + more * out[0], y + more * out[1], height],
    'slope_deg': Math.atan(rise) / kDeg,
    'downhill_deg': Math.atan2(out[1], out[0]) / kDeg,
  };
}

// shape: flat, shed or gable. wall: the one that the roof falls to.
export function makeRoof(footprint, {shape, eaves, ridge, wall}) {
  if (shape === 'flat') {
    return [{point: [...footprint[0], eaves], 'slope_deg': 0, 'downhill_deg': 0}];
  }
  const {out, low, high} = across(footprint, wall);
  const rise = Math.max(0, ridge - eaves) / Math.max(high - low, 1e-9);
  if (shape === 'shed') return [plane(footprint, out, high, eaves, rise)];
  return [
    plane(footprint, out, high, eaves, 2 * rise),
    plane(footprint, [-out[0], -out[1]], -low, eaves, 2 * rise),
  ];
}

// The wall that a roof falls to.
export function wallOf(footprint, roof) {
  const angle = roof[0].downhill_deg * kDeg;
  let best = 0;
  let most = -Infinity;
  footprint.forEach((_, wall) => {
    const {out} = across(footprint, wall);
    const along = out[0] * Math.cos(angle) + out[1] * Math.sin(angle);
    if (along > most + 1e-6) {
      most = along;
      best = wall;
    }
  });
  return best;
}

export function roofRange(building) {
  const heights = (building.faces ?? [])
                      .filter((face) => face.kind === 'roof')
                      .flatMap((face) => face.corners.map((corner) => corner[2]));
  return {eaves: Math.min(...heights), ridge: Math.max(...heights)};
}

// For footprints that the points tell nothing of.
export function guessRoof(footprint, height) {
  return makeRoof(footprint, {shape: 'flat', eaves: height});
}
