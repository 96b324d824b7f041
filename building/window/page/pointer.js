// The mouse, a pen or a finger over the drawing.

import {api} from './api.js';
import {app, byId, say, trying, view} from './app.js';
import {load, moveCorner, putBack, queue, shiftOf} from './changes.js';
import {closeContour, editSelected, keepNudge, propose} from './edits.js';
import {choose, refresh, showAll} from './show.js';
import {snap} from './snap.js';

const kReach = 11;       // pixels that a corner may snap over
const kWallReach = 8;    // pixels; a click this near to a wall means it

export function placeOf(event) {
  const box = byId('pane').getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

function cornerAt(place) {
  const building = app.buildings[app.selected];
  if (!building || !view.isTop) return -1;
  return building.footprint.findIndex((corner) => {
    const [x, y] = view.toScreen([...corner, 0]);
    return Math.hypot(x - place[0], y - place[1]) < 9;
  });
}

function inside(corners, [x, y]) {
  let is = false;
  corners.forEach(([ax, ay], i) => {
    const [bx, by] = corners[(i + 1) % corners.length];
    if ((ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax) is = !is;
  });
  return is;
}

function buildingAt(place) {
  if (view.isTop) {
    const at = view.toPlan(place);
    return app.buildings.findIndex(({footprint}) => inside(footprint, at));
  }
  return app.buildings.findIndex(
      ({faces}) => faces.some(({corners}) => inside(corners.map((c) => view.toScreen(c)), place)));
}

// Snapped unless Alt is held. skip: a corner of the selected building that is on the way.
function meant(event, before, after, skip = -1) {
  const at = view.toPlan(placeOf(event));
  app.snap = null;
  if (event.altKey) return at;
  const corners = app.buildings.flatMap(
      ({footprint}, b) => footprint.filter((_, i) => b !== app.selected || i !== skip));
  app.snap = snap(at, kReach / view.scale,
                  {corners: [...corners, ...app.contour.slice(0, 1)], lines: app.state.lines, before, after});
  return app.snap?.place ?? at;
}

// Ends a drag without its effect; false if there is none.
export function dropDrag() {
  if (!app.drag) return false;
  if (app.drag.kind === 'corner') putBack(app.buildings, app.drag);
  app.drag = app.box = app.stroke = app.snap = null;
  refresh();
  return true;
}

export function pressed(event) {
  byId('pane').focus();
  dropDrag();
  if (!event.isPrimary) return;  // a second finger
  keepNudge();
  const place = placeOf(event);
  byId('pane').setPointerCapture(event.pointerId);
  app.drag = {start: place, last: place, moved: false, turn: event.button === 2, kind: 'pan'};
  if (event.button !== 0) return;
  if (app.tool === 'area') app.drag.kind = 'area';
  if (app.tool === 'level') app.drag.kind = 'level';
  if (app.tool === 'select') {
    const corner = cornerAt(place);
    if (corner >= 0) {
      Object.assign(app.drag, shiftOf(app.selected, corner), {kind: 'corner'});
      app.corner = corner;
      refresh();
    }
  }
}

export function moved(event) {
  const place = placeOf(event);
  if (!app.drag) {
    if (app.tool === 'draw') {
      app.cursor = meant(event, app.contour, app.contour[0] ?? null);
      refresh();
    }
    return;
  }
  const [dx, dy] = [place[0] - app.drag.last[0], place[1] - app.drag.last[1]];
  app.drag.last = place;
  app.drag.moved ||= Math.hypot(place[0] - app.drag.start[0], place[1] - app.drag.start[1]) > 3;
  if (!app.drag.moved) return;
  if (app.drag.turn) {
    view.yaw -= dx * 0.008;
    view.pitch = Math.min(Math.PI / 2, Math.max(0, view.pitch - dy * 0.008));
    refresh(true);
  } else if (app.drag.kind === 'pan') {
    view.pan(dx, dy);
    refresh(true);
  } else if (app.drag.kind === 'area') {
    app.box = [app.drag.start, place];
    refresh();
  } else if (app.drag.kind === 'level') {
    app.stroke = [app.drag.start, place];
    refresh();
  } else if (app.drag.kind === 'corner') {
    const footprint = app.buildings[app.drag.of]?.footprint;
    if (!footprint?.[app.drag.at]) {
      dropDrag();
      return;
    }
    if (app.drag.on !== app.buildings) Object.assign(app.drag, shiftOf(app.drag.of, app.drag.at));
    const n = footprint.length;
    const at = (i) => footprint[(app.drag.at + i + n) % n];
    app.drag.to = meant(event, [at(-2), at(-1)], at(1), app.drag.at);
    footprint[app.drag.at] = [...app.drag.to];
    refresh();
  }
}

export function released(event) {
  const ended = app.drag;
  app.drag = null;
  if (!ended) return;
  const place = placeOf(event);
  if (ended.kind === 'corner' && ended.moved) {
    app.snap = null;
    const {of, at, on, from, to} = ended;
    moveCorner({of, at, on, from}, () => to);
  } else if (ended.kind === 'area' && ended.moved) {
    const [a, b] = [view.toPlan(ended.start), view.toPlan(place)];
    app.box = null;
    propose([0, 1].map((i) => Math.min(a[i], b[i])).concat([0, 1].map((i) => Math.max(a[i], b[i]))));
  } else if (ended.kind === 'level' && ended.moved) {
    app.stroke = null;
    turnUpright(ended.start, place);
  } else if (!ended.moved && !ended.turn && event.button === 0) {
    clicked(event, place);
  }
  showAll();
}

function clicked(event, place) {
  if (app.tool === 'draw') {
    const at = meant(event, app.contour, app.contour[0] ?? null);
    const first = app.contour[0] && view.toScreen([...app.contour[0], 0]);
    if (first && app.contour.length > 2 &&
        Math.hypot(first[0] - place[0], first[1] - place[1]) < kReach) {
      closeContour();
    } else {
      app.contour.push(at);
    }
  } else if (app.tool === 'select' && cornerAt(place) < 0) {
    // Walls are clicked from both sides.
    choose(wallAt(place) ? app.selected : buildingAt(place));
  }
}

// Of the selected building: {wall, share (along it)}, or null.
function wallAt(place) {
  const building = app.buildings[app.selected];
  if (!building || !view.isTop) return null;
  const n = building.footprint.length;
  for (let i = 0; i < n; ++i) {
    const [a, b] = [i, (i + 1) % n].map((k) => view.toScreen([...building.footprint[k], 0]));
    const d = [b[0] - a[0], b[1] - a[1]];
    const share = ((place[0] - a[0]) * d[0] + (place[1] - a[1]) * d[1]) / (d[0] ** 2 + d[1] ** 2);
    if (share < 0.02 || share > 0.98) continue;
    const away = Math.hypot(a[0] + share * d[0] - place[0], a[1] + share * d[1] - place[1]);
    if (away <= kWallReach) return {wall: i, share};
  }
  return null;
}

// A corner in the wall that was clicked twice.
export async function addCorner(event) {
  const found = app.tool === 'select' && wallAt(placeOf(event));
  if (!found) return;
  const {wall, share} = found;
  const of = app.selected;
  const isTaken = await editSelected(({footprint}) => {
    const [p, q] = [footprint[wall], footprint[(wall + 1) % footprint.length]];
    if (!p || !q) return false;
    footprint.splice(wall + 1, 0, [0, 1].map((k) => p[k] + share * (q[k] - p[k])));
    return true;
  });
  if (!isTaken || app.selected !== of) return;
  app.corner = wall + 1;
  refresh();
}

// The line that was drawn is upright, or level if it is nearer to that.
function turnUpright(from, to) {
  if (view.isTop) {
    say('Look from the front or the side first: 2 or 3.');
    return;
  }
  let [dx, dy] = [to[0] - from[0], from[1] - to[1]];
  if (Math.abs(dx) > Math.abs(dy)) [dx, dy] = [-dy, dx];
  if (dy < 0) [dx, dy] = [-dx, -dy];
  const {right, up} = view.axes();
  const direction = right.map((value, i) => (dx * value + dy * up[i]) / Math.hypot(dx, dy));
  trying(() => queue(async () => {
    await api.up(app.state.revision, direction);
    app.done.length = 0;  // what was done lies in another frame
    app.undone.length = 0;
    await load();
    say('Turned.');
  }));
}
