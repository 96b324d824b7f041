// Where a corner may be meant: at a corner, on a line of the points, square to the wall before.

const sub = (a, b) => [a[0] - b[0], a[1] - b[1]];
const length = (a) => Math.hypot(a[0], a[1]);

function onLine(place, [point, direction]) {
  const d = sub(place, point);
  const t = d[0] * direction[0] + d[1] * direction[1];
  return [point[0] + t * direction[0], point[1] + t * direction[1]];
}

function crossing([p, d], [q, e]) {
  const cross = d[0] * e[1] - d[1] * e[0];
  if (Math.abs(cross) < 0.05) return null;
  const w = sub(q, p);
  const t = (w[0] * e[1] - w[1] * e[0]) / cross;
  return [p[0] + t * d[0], p[1] + t * d[1]];
}

function lineOf(a, b) {
  const d = sub(b, a);
  const size = length(d);
  return size > 0 ? [a, [d[0] / size, d[1] / size]] : null;
}

// The walls of the points that pass by here, also a little beyond where their points end.
function wallsAt(place, lines, reach) {
  return lines.flatMap(([ax, ay, bx, by]) => {
    const line = lineOf([ax, ay], [bx, by]);
    if (!line || length(sub(onLine(place, line), place)) > reach) return [];
    const [point, direction] = line;
    const d = sub(place, point);
    const t = d[0] * direction[0] + d[1] * direction[1];
    const beyond = 2 * reach;
    return t > -beyond && t < length(sub([bx, by], [ax, ay])) + beyond ? [line] : [];
  });
}

// place: x, y; reach: how far it may move. corners: places to meet. lines: [ax, ay, bx, by] of walls
// in the points. before: the corners that came before it, the nearest last; after: one that follows.
// Gives {place, kind} or null.
export function snap(place, reach, {corners, lines, before = [], after = null}) {
  const near = (p) => p && length(sub(p, place)) <= reach;
  const nearest = (candidates) => candidates.filter(({place: p}) => near(p)).sort((a, b) => {
    return length(sub(a.place, place)) - length(sub(b.place, place));
  })[0] ?? null;

  const corner = nearest(corners.map((c) => ({place: c, kind: 'corner'})));
  if (corner) return corner;

  const walls = wallsAt(place, lines, reach);
  const square = [];
  const last = before[before.length - 1];
  if (last && before.length > 1) {
    const wall = lineOf(before[before.length - 2], last);
    if (wall) square.push([last, [-wall[1][1], wall[1][0]]], [last, wall[1]]);
  } else if (last) {
    // The first wall may run as the walls of the points do.
    for (const [, direction] of wallsAt(last, lines, reach)) square.push([last, direction]);
  }
  if (after && last) {
    const wall = before.length > 1 ? lineOf(before[before.length - 2], last) : null;
    if (wall) square.push([after, wall[1]], [after, [-wall[1][1], wall[1][0]]]);
  }
  const angles = square.filter((line) => near(onLine(place, line)));

  const crossings = [];
  for (const [i, a] of walls.entries()) {
    for (const b of walls.slice(i + 1)) crossings.push({place: crossing(a, b), kind: 'two walls'});
    for (const b of angles) crossings.push({place: crossing(a, b), kind: 'wall, right angle'});
  }
  for (const [i, a] of angles.entries()) {
    for (const b of angles.slice(i + 1)) {
      crossings.push({place: crossing(a, b), kind: 'right angles'});
    }
  }
  return nearest(crossings) ??
      nearest([
        ...walls.map((line) => ({place: onLine(place, line), kind: 'wall'})),
        ...angles.map((line) => ({place: onLine(place, line), kind: 'right angle'})),
      ]);
}
