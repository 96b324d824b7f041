// Drawings over the pictures: picks, predictions, residuals, edges. All in CSS pixels of a pane
// (see view.js). Everything has a dark rim, because photos are light and dark; what a pick is shows
// in its shape and its text as well as in its colour.

import {kMarkerReach} from './pane.js';

const kRadius = 9;
export const kColors = {
  used: '#7ee787',
  waiting: '#ffffff',
  half: '#ffd24a',
  off: '#b8b8b8',
  bad: '#ff8f80',
  worst: '#ffb057',
  ghost: '#8fd3ff',
  vector: '#ffffff',
};
const kRim = 'rgba(0, 0, 0, 0.8)';
const kFont = '600 12px system-ui, "DejaVu Sans", sans-serif';

// Draws what `path` traces, light on a dark rim.
function twice(context, color, width, path) {
  for (const [style, extra] of [[kRim, 2.5], [color, 0]]) {
    context.strokeStyle = style;
    context.lineWidth = width + extra;
    context.beginPath();
    path();
    context.stroke();
  }
}

// Right of and above a marker at x, y that reaches `reach` to the sides; left of it at the border.
function labelBeside(context, view, text, [x, y], reach, color, strong) {
  context.font = kFont;
  const width = context.measureText(text).width + 8;
  const left = x + reach + width > view.width ? x - reach - width : x + reach;
  label(context, text, left, Math.max(18, y), color, strong);
}

function label(context, text, x, y, color, strong) {
  context.font = kFont;
  const width = context.measureText(text).width + 8;
  context.fillStyle = strong ? color : 'rgba(20, 20, 20, 0.85)';
  context.beginPath();
  context.roundRect(x, y - 16, width, 17, 3);
  context.fill();
  context.fillStyle = strong ? '#141414' : color;
  context.fillText(text, x + 4, y - 3.5);
}

const shortened = (text) => text.length > 16 ? `${text.slice(0, 15)}…` : text;

// pick: {id, number, label, place: [x, y] img, status, worst, selected, dim}.
export function drawMarker(context, view, pick) {
  const [x, y] = view.toScreen(pick.place);
  const reach = 40;
  if (x < -reach || y < -reach || x > view.width + reach || y > view.height + reach) return;
  const color = kColors[pick.status === 'used' && pick.worst ? 'worst' : pick.status] ?? '#ffffff';
  context.globalAlpha = pick.dim ? 0.55 : 1;
  context.setLineDash(pick.status === 'off' ? [3, 3] : []);
  const r = pick.dim ? 6 : kRadius;
  const width = pick.selected ? 2.4 : 1.5;
  twice(context, color, width, () => {
    if (pick.status === 'half') {
      context.rect(x - r, y - r, 2 * r, 2 * r);
    } else if (pick.status === 'bad') {
      for (const [dx, dy] of [[0, -r - 2], [r + 2, 0], [0, r + 2], [-r - 2, 0]]) {
        context.lineTo(x + dx, y + dy);
      }
      context.closePath();
    } else {
      context.arc(x, y, r, 0, 2 * Math.PI);
    }
    // Four ticks that point at the place and leave it free.
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + dx * (r - 5), y + dy * (r - 5));
      context.lineTo(x + dx * (r + 5), y + dy * (r + 5));
    }
  });
  context.setLineDash([]);
  if (pick.selected) twice(context, '#ffffff', 1, () => context.arc(x, y, r + 8, 0, 2 * Math.PI));
  const signs = {bad: ' ✕', off: ' check', half: ' ?'};
  const text = pick.number + (pick.label ? ` ${shortened(pick.label)}` : '') +
      (pick.status === 'used' && pick.worst ? ' ▲' : signs[pick.status] ?? '');
  labelBeside(context, view, text, [x, y - r + 2], r + 4, color, pick.selected);
  context.globalAlpha = 1;
}

// Where the solution expects the other half of a pick.
export function drawGhost(context, view, place, number) {
  const [x, y] = view.toScreen(place);
  if (!view.shows(place, 0)) {
    drawAway(context, view, [x, y], `${number}: G goes there`);
    return;
  }
  context.setLineDash([4, 3]);
  twice(context, kColors.ghost, 1.6, () => {
    context.arc(x, y, kRadius + 3, 0, 2 * Math.PI);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + dx * 4, y + dy * 4);
      context.lineTo(x + dx * (kRadius + 3), y + dy * (kRadius + 3));
    }
  });
  context.setLineDash([]);
  labelBeside(
      context, view, `${number} predicted · Enter`, [x, y - kRadius + 2], kRadius + 8,
      kColors.ghost, false);
}

// An arrow at the pane's border towards something that lies outside.
function drawAway(context, view, [x, y], text) {
  const middle = [view.width / 2, view.height / 2];
  const dx = x - middle[0], dy = y - middle[1];
  const scale =
      Math.min((middle[0] - 18) / Math.abs(dx || 1e-9), (middle[1] - 18) / Math.abs(dy || 1e-9));
  const tip = [middle[0] + dx * scale, middle[1] + dy * scale];
  const angle = Math.atan2(dy, dx);
  context.save();
  context.translate(...tip);
  context.rotate(angle);
  twice(context, kColors.ghost, 2, () => {
    context.moveTo(-8, -7);
    context.lineTo(4, 0);
    context.lineTo(-8, 7);
  });
  context.restore();
  context.font = kFont;
  const width = context.measureText(text).width + 8;
  label(
      context, text, Math.min(Math.max(tip[0] - width / 2, 6), view.width - width - 6),
      Math.min(Math.max(tip[1] + (dy > 0 ? -16 : 32), 22), view.height - 8), kColors.ghost, false);
}

// A place that was clicked and cannot be picked.
export function drawRefused(context, view, place, snap) {
  const [x, y] = view.toScreen(place);
  twice(context, kColors.bad, 2, () => {
    context.moveTo(x - 7, y - 7);
    context.lineTo(x + 7, y + 7);
    context.moveTo(x + 7, y - 7);
    context.lineTo(x - 7, y + 7);
  });
  if (!snap) return;
  const [sx, sy] = view.toScreen(snap);
  context.setLineDash([3, 3]);
  twice(context, kColors.ghost, 1.4, () => {
    context.moveTo(x, y);
    context.lineTo(sx, sy);
  });
  context.setLineDash([]);
  twice(context, kColors.ghost, 2, () => context.arc(sx, sy, 5, 0, 2 * Math.PI));
}

// The crosshair that the arrow keys move where no point is selected.
export function drawCrosshairCursor(context, view, place) {
  const [x, y] = view.toScreen(place);
  twice(context, '#ffffff', 1.2, () => {
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + dx * 5, y + dy * 5);
      context.lineTo(x + dx * 22, y + dy * 22);
    }
  });
}

// From clicks to projections, longer than they are by a factor that is returned (and shown): the
// largest round one with which none that may be right is longer than a twentieth of the photo.
// picks: [{place, residual: [dx, dy] pixels, status}].
export function drawResiduals(context, view, picks) {
  const longest = Math.max(
      0,
      ...picks.filter(({status}) => status === 'used' || status === 'waiting')
          .map((pick) => Math.hypot(...pick.residual)));
  const limit = Math.hypot(view.pictureWidth, view.pictureHeight) / 20;
  const factor = [200, 100, 50, 20, 10, 5, 2].find((one) => one * longest <= limit) ?? 1;
  for (const {place, residual} of picks) {
    const length = Math.hypot(...residual) * factor;
    const shown = Math.min(1, 3 * limit / Math.max(length, 1e-9));  // a pick far off: cut short
    const from = view.toScreen(place);
    const to = view.toScreen(
        [place[0] + residual[0] * factor * shown, place[1] + residual[1] * factor * shown]);
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 1) continue;
    twice(context, kColors.vector, 1.8, () => {
      context.moveTo(...from);
      context.lineTo(...to);
      for (const turn of shown < 1 ? [] : [2.6, -2.6]) {
        context.moveTo(...to);
        context.lineTo(to[0] + 7 * Math.cos(angle + turn), to[1] + 7 * Math.sin(angle + turn));
      }
    });
  }
  return factor;
}

// Colours as in the overlays of roomtex-align.
const kEdgeStyles = {
  depth: {color: '#ff9cf0', width: 1.6, dash: []},
  crease: {color: '#7fe7ff', width: 1.6, dash: [7, 4]},
  intensity: {color: '#ffe066', width: 1.6, dash: [2, 3]},
};

// edges: [{kind, points: [[x, y]...] img}]. One path per kind, on a dark line without gaps.
export function drawEdges(context, view, edges) {
  for (const [kind, style] of Object.entries(kEdgeStyles)) {
    const path = new Path2D();
    for (const edge of edges) {
      if (edge.kind === kind) addVisible(path, view, edge.points);
    }
    context.setLineDash([]);
    context.strokeStyle = 'rgba(0, 0, 0, 0.5)';
    context.lineWidth = style.width + 1.4;
    context.stroke(path);
    context.setLineDash(style.dash);
    context.strokeStyle = style.color;
    context.lineWidth = style.width;
    context.stroke(path);
  }
  context.setLineDash([]);
}

// The pieces of a line that may touch the pane.
function addVisible(path, view, points) {
  let before = null;
  let begun = false;
  for (const point of points) {
    const here = view.toScreen(point);
    const seen = before !== null && Math.max(before[0], here[0]) >= 0 &&
        Math.max(before[1], here[1]) >= 0 && Math.min(before[0], here[0]) <= view.width &&
        Math.min(before[1], here[1]) <= view.height;
    if (seen) {
      if (!begun) path.moveTo(...before);
      path.lineTo(...here);
    }
    begun = seen;
    before = here;
  }
}

// The marker of a list that a press at `screen` takes: its id, or null.
export function markerAt(view, markers, screen) {
  let best = null;
  let bestDistance = kMarkerReach;
  for (const marker of markers) {
    if (marker.dim) continue;
    const [x, y] = view.toScreen(marker.place);
    const distance = Math.hypot(screen[0] - x, screen[1] - y) - (marker.selected ? 0.5 : 0);
    if (distance < bestDistance) [best, bestDistance] = [marker.id, distance];
  }
  return best;
}

// What the line styles of drawEdges() mean, as elements.
export function edgeLegend() {
  const names = {depth: 'rim', crease: 'crease', intensity: 'intensity'};
  return Object.entries(kEdgeStyles).map(([kind, {color, width, dash}]) => {
    const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    svg.setAttribute('viewBox', '0 0 30 8');
    const line = document.createElementNS('http://www.w3.org/2000/svg', 'line');
    const attributes = {
      x1: 1,
      y1: 4,
      x2: 29,
      y2: 4,
      stroke: color,
      'stroke-width': width + 0.6,
      'stroke-dasharray': dash.join(' ')
    };
    for (const [name, value] of Object.entries(attributes)) line.setAttribute(name, value);
    svg.append(line);
    const row = document.createElement('div');
    row.append(svg, names[kind]);
    return row;
  });
}
