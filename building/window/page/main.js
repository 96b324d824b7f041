// The window of roomtex-outline: points from above, contours over them, a list beside.

import {api} from './api.js';
import {drawOver, drawPoints} from './draw.js';
import {guessRoof, makeRoof, roofRange, wallOf} from './roof.js';
import {snap} from './snap.js';
import {View} from './view.js';

const byId = (id) => document.getElementById(id);
const kReach = 11;       // pixels that a corner may snap over
const kWallReach = 8;    // pixels; a click this near to a wall means it
const kNudgeRest = 300;  // milliseconds after the last arrow key until a corner is saved

const view = new View();
const app = {
  state: null,
  cloud: null,
  buildings: [],
  selected: -1,
  corner: -1,
  tool: 'select',
  contour: [],
  cursor: null,  // x, y of the scene, in the top view
  snap: null,
  box: null,
  stroke: null,
  done: [],    // buildings as they were, for undo
  undone: [],
  busy: Promise.resolve(),
};

// --- talking to the server

function say(text, seconds = 6) {
  const toast = byId('toast');
  toast.textContent = text;
  toast.hidden = !text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => {
    toast.hidden = true;
  }, 1000 * seconds);
}

// What the file holds of a building.
const plain = ({name, ground, footprint, roof}) => ({name, ground, footprint, roof});
const copyOf = (buildings) => structuredClone(buildings.map(plain));

function take(answer) {
  const before = app.buildings[app.selected];
  app.state.revision = answer.revision;
  app.buildings = answer.buildings;
  app.selected = Math.min(app.selected, app.buildings.length - 1);
  // The corner of that number is another one now, or none.
  const now = app.buildings[app.selected];
  if (now?.name !== before?.name || now?.footprint.length !== before?.footprint.length) {
    app.corner = -1;
    clearTimeout(nudged?.timer);
    nudged = null;
    if (drag?.kind === 'corner') dropDrag();
  }
  showSaved(answer.save_error);
  showAll();
}

function showSaved(error) {
  byId('save').dataset.state = error ? 'unsaved' : 'saved';
  const path = app.state.output_path;
  byId('save').textContent = error || `saved to ${path.split('/').pop()}`;
  byId('save').title = path;
}

// One after the other, whatever became of those before.
function queue(task) {
  keepNudge();
  app.busy = app.busy.catch(() => {}).then(task);
  return app.busy;
}

// `edit` makes of a copy of the buildings, as they are then, what they become; nothing to drop it.
// `shift`: the corner that it moves, where the page shows it moved already. Resolves to whether it
// was taken.
function change(edit, shift = null) {
  return queue(async () => {
    const before = copyOf(app.buildings);
    if (shift) putBack(before, shift);
    let isTaken = false;
    try {
      const buildings = edit(structuredClone(before));
      if (!buildings) return false;
      take(await api.put(app.state.revision, buildings.map(plain)));
      app.done.push(before);
      app.undone.length = 0;
      isTaken = true;
    } catch (error) {
      // Not taken: as it was.
      const kept = app.buildings;
      before.forEach((building, i) => {
        if (kept[i]) Object.assign(kept[i], building);
      });
      say(error.message);
    }
    showAll();
    return isTaken;
  });
}

// Corner `at` of building `of`, to be moved on the page before that is saved: of which buildings, and
// from where.
function shiftOf(of, at) {
  return {of, at, on: app.buildings, from: [...app.buildings[of].footprint[at]]};
}

// With an answer of the server meanwhile it is back.
function putBack(buildings, {of, at, on, from}) {
  if (on === app.buildings) buildings[of].footprint[at] = [...from];
}

// move: (corner) => corner.
function moveCorner(shift, move) {
  const {of, at} = shift;
  change((all) => {
    if (!all[of]?.footprint[at]) return null;
    all[of].footprint[at] = move(all[of].footprint[at]);
    return all;
  }, shift);
}

function travel(from, to) {
  return queue(async () => {
    const goal = from.pop();
    if (!goal) return;
    try {
      const now = copyOf(app.buildings);
      take(await api.put(app.state.revision, goal));
      to.push(now);
    } catch (error) {
      from.push(goal);
      say(error.message);
    }
    showAll();
  });
}

async function trying(body) {
  try {
    await body();
  } catch (error) {
    say(error.message);
  }
}

// --- showing

const style = getComputedStyle(document.documentElement);
function colors() {
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  return {text: of('text'), quiet: of('quiet'), accent: of('accent'), panel: of('panel'), bad: of('bad')};
}

let asked = {points: false, over: false};
function refresh(points = false) {
  if (!asked.over && !asked.points) requestAnimationFrame(paint);
  asked = {points: asked.points || points, over: true};
}

function paint() {
  const now = asked;
  asked = {points: false, over: false};
  if (!app.cloud) return;
  if (now.points) {
    drawPoints(byId('points'), view, app.cloud, {
      origin: app.state.origin,
      top: Math.max(app.top, 1e-9),
      near: 0.2 * app.state.step,
      showGround: byId('show-ground').checked,
      photoColors: byId('show-colors').checked,
    });
  }
  drawOver(byId('drawing'), view, {
    buildings: app.buildings,
    selected: app.selected,
    corner: app.corner,
    lines: app.state.lines,
    showLines: byId('show-lines').checked,
    contour: app.contour,
    cursor: app.cursor,
    snap: app.snap,
    box: app.box,
    stroke: app.stroke,
  }, colors());
  const {yaw, pitch, scale, centre} = view;
  byId('pane').dataset.view = [scale, yaw, pitch, ...centre].join(' ');
}

const kHints = {
  select: 'Click a building; drag its corners, double-click a wall for a new one. Wheel zooms, drag moves, right drag turns.',
  draw: 'Click the corners; Enter or a click on the first one closes the contour. Alt: no snapping.',
  area: 'Drag a rectangle: buildings are proposed from the points in it.',
  level: 'In Front or Side: drag along something upright (or level).',
};

function showAll() {
  const list = byId('list');
  list.replaceChildren(...app.buildings.map((building, i) => {
    const {eaves, ridge} = roofRange(building);
    const item = document.createElement('li');
    const button = document.createElement('button');
    button.type = 'button';
    button.setAttribute('aria-pressed', String(i === app.selected));
    const height = shown(eaves) === shown(ridge) ? shown(ridge) : `${shown(eaves)} to ${shown(ridge)}`;
    button.textContent =
        `${building.name}: ${building.footprint.length} corners, ${building.shape}, ${height}`;
    if (building.doubts?.length) {
      const sign = document.createElement('span');
      sign.className = 'doubtful';
      sign.textContent = ' ▲ doubtful';
      button.append(sign);
    }
    button.addEventListener('click', () => choose(i));
    item.append(button);
    return item;
  }));
  byId('none').hidden = app.buildings.length > 0;
  showDetails();
  for (const tool of ['select', 'draw', 'area', 'level']) {
    byId(tool).setAttribute('aria-pressed', String(app.tool === tool));
  }
  byId('top').setAttribute('aria-pressed', String(view.isTop));
  byId('undo').disabled = app.done.length === 0;
  byId('redo').disabled = app.undone.length === 0;
  byId('models').disabled = app.buildings.length === 0;
  byId('level').disabled = app.state.on_earth;
  byId('hint').textContent = kHints[app.tool];
  refresh();
}

// Heights: to a hundredth of a metre, finer of small things.
const numDigits = () => Math.min(9, Math.max(2, Math.ceil(1 - Math.log10(app.state.step))));
const shown = (height) => height.toFixed(numDigits());

function showDetails() {
  const building = app.buildings[app.selected];
  byId('details').hidden = !building;
  if (!building) return;
  const {eaves, ridge} = roofRange(building);
  const set = (id, value) => {
    if (document.activeElement !== byId(id)) byId(id).value = value;
  };
  set('name', building.name);
  set('ground', shown(building.ground));
  set('shape', building.shape);
  set('eaves', shown(eaves));
  set('ridge', shown(ridge));
  byId('eaves').disabled = building.shape === 'planes';
  byId('ridge').disabled = building.shape === 'planes' || building.shape === 'flat';
  byId('turn').disabled = building.shape === 'planes' || building.shape === 'flat';
  const sigma = Math.max(...(building.corner_sigma ?? [0]));
  byId('facts').textContent = `Volume ${building.volume.toFixed(1)} ${app.state.unit}³; corners ` +
      `within about ${sigma.toFixed(numDigits() + 1)} ${app.state.unit}; ` +
      `${Math.round(100 * building.explained)} % of its points lie on it.`;
  byId('doubts').replaceChildren(...building.doubts.map((doubt) => {
    const item = document.createElement('li');
    item.textContent = doubt;
    return item;
  }));
}

// --- what can be done

function choose(index) {
  app.selected = index;
  app.corner = -1;
  showAll();
}

function setTool(tool) {
  app.tool = tool;
  app.contour = [];
  app.snap = null;
  if (tool === 'draw' || tool === 'area') look(0, Math.PI / 2);
  if (tool === 'level' && view.isTop) look(0, 0);
  showAll();
}

function look(yaw, pitch) {
  view.yaw = yaw;
  view.pitch = pitch;
  showAll();
  refresh(true);
}

// The buildings and what is around them; without any, all points.
function fit() {
  const corners = app.buildings.flatMap(({faces}) => faces.flatMap((face) => face.corners));
  let bounds = app.state.bounds;
  if (corners.length > 0) {
    const of = (pick) => [0, 1, 2].map((axis) => pick(...corners.map((corner) => corner[axis])));
    const [low, high] = [of(Math.min), of(Math.max)];
    const margin = 4 * app.state.step;
    bounds = [low.map((value) => value - margin), high.map((value) => value + margin)];
  }
  view.fit(bounds);
  refresh(true);
}

function undo() {
  return app.contour.length ? (app.contour.pop(), refresh()) : travel(app.done, app.undone);
}
const redo = () => travel(app.undone, app.done);

function newName() {
  const used = new Set(app.buildings.map((building) => building.name));
  let number = app.buildings.length + 1;
  while (used.has(String(number))) ++number;
  return String(number);
}

function groundAt([x, y]) {
  const {height, gradient} = app.state.ground;
  return height + gradient[0] * x + gradient[1] * y;
}

const areaOf = (corners) => corners.reduce((sum, [x, y], i) => {
  const [u, v] = corners[(i + 1) % corners.length];
  return sum + x * v - u * y;
}, 0) / 2;

function closeContour() {
  const corners = app.contour.filter((corner, i, all) => {
    const next = all[(i + 1) % all.length];
    return Math.hypot(next[0] - corner[0], next[1] - corner[1]) * view.scale > 1;
  });
  if (corners.length < 3) {
    say('A contour needs at least three corners.');
    return;
  }
  const drawn = app.contour;
  app.contour = [];
  const footprint = areaOf(corners) < 0 ? corners.reverse() : corners;
  const ground = Math.min(...footprint.map(groundAt));
  let building = {
    name: newName(),
    ground,
    footprint,
    roof: guessRoof(footprint, ground + 3 * app.state.step),
  };
  trying(async () => {
    try {
      building = (await api.heights(building)).building;
    } catch {
      say('The points tell no roof here: type its height in.');
    }
    if (await change((all) => [...all, building])) {
      choose(app.buildings.length - 1);
      setTool('select');
    } else if (app.tool === 'draw' && app.contour.length === 0) {
      app.contour = drawn;  // to be mended
      refresh();
    }
  });
}

// area: x0, y0, x1, y1, or nothing.
function propose(area) {
  trying(async () => {
    const found = (await api.propose(area)).buildings;
    // One that stands already is kept as it is.
    const middle = ({footprint}) => [0, 1].map((axis) =>
      footprint.reduce((sum, corner) => sum + corner[axis], 0) / footprint.length);
    const fresh = found.filter((building) => !app.buildings.some((known) => {
      const [a, b] = [middle(known), middle(building)];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) < app.state.step;
    }));
    if (fresh.length === 0) {
      say('Nothing new was found in the points.');
      return;
    }
    const isTaken = await change((all) => {
      for (const building of fresh) {
        const used = new Set(all.map((known) => known.name));
        let number = 1;
        while (used.has(String(number))) ++number;
        all.push({...building, name: String(number)});
      }
      return all;
    });
    if (isTaken) say(`${fresh.length} proposed.`);
  });
}

// edit: of the building that is selected now, and of what is known of it when its turn comes.
function editSelected(edit) {
  const at = app.selected;
  if (!app.buildings[at]) return Promise.resolve(false);
  return change((all) => all[at] && edit(all[at], app.buildings[at]) !== false ? all : null);
}

function heights() {
  const building = app.buildings[app.selected];
  if (!building) return;
  trying(async () => {
    const {ground, roof} = (await api.heights(plain(building))).building;
    // Another one may be selected by now, or corners of this one moved.
    change((all) => {
      const same = all.find(({name}) => name === building.name);
      if (!same) return null;
      Object.assign(same, {ground, roof});
      return all;
    });
  });
}

function remove() {
  const building = app.buildings[app.selected];
  if (!building) return;
  if (app.corner >= 0) {
    if (building.footprint.length <= 3) {
      say('A footprint needs at least three corners.');
      return;
    }
    const at = app.corner;
    app.corner = -1;
    editSelected((one) => {
      one.footprint.splice(at, 1);
    });
    return;
  }
  const at = app.selected;
  app.selected = -1;
  change((all) => {
    all.splice(at, 1);
    return all;
  });
}

// What was typed into a field; where that is no number, it shows again what holds: null.
function typedNumber(id) {
  const value = byId(id).valueAsNumber;
  if (Number.isFinite(value)) return value;
  say('Type a number.');
  const building = app.buildings[app.selected];
  if (building) byId(id).value = shown({ground: building.ground, ...roofRange(building)}[id]);
  return null;
}

// typed: the height that was typed, {eaves} or {ridge}. The fields are rounded: the others stay.
function roofFrom({turn = 0, typed = {}} = {}) {
  const shape = byId('shape').value;
  editSelected((building, known) => {
    if (shape === 'planes') return false;
    const {eaves, ridge: top} = {...roofRange(known), ...typed};
    const wall = (wallOf(building.footprint, building.roof) + turn) % building.footprint.length;
    const rises = top > eaves && shown(top) !== shown(eaves);
    const ridge = shape === 'flat' || rises ? top : eaves + app.state.step;
    building.roof = makeRoof(building.footprint, {shape, eaves, ridge, wall});
    return true;
  });
}

function models() {
  trying(() => queue(async () => say(`Written: ${(await api.models()).written.join(', ')}`)));
}

// A corner that the arrows move: shiftOf() and `by`. It is saved once they rest.
let nudged = null;

function nudge(dx, dy) {
  return (event) => {
    if (app.corner < 0 || !view.isTop) {
      view.pan(-dx * 60, dy * 60);
      refresh(true);
      return;
    }
    const [of, at] = [app.selected, app.corner];
    const footprint = app.buildings[of]?.footprint;
    if (!footprint?.[at] || drag) return;
    if (nudged && (nudged.of !== of || nudged.at !== at)) keepNudge();
    nudged ??= {...shiftOf(of, at), by: [0, 0]};
    if (nudged.on !== app.buildings) Object.assign(nudged, shiftOf(of, at));
    const step = (event.shiftKey ? 10 : 1) / view.scale;
    const {right, up} = view.axes();
    nudged.by = nudged.by.map((value, axis) => value + step * (dx * right[axis] + dy * up[axis]));
    footprint[at] = nudged.from.map((value, axis) => value + nudged.by[axis]);
    clearTimeout(nudged.timer);
    nudged.timer = setTimeout(keepNudge, kNudgeRest);
    refresh();
  };
}

function keepNudge() {
  if (!nudged) return;
  const {by, timer, ...shift} = nudged;
  clearTimeout(timer);
  nudged = null;
  moveCorner(shift, (corner) => corner.map((value, axis) => value + by[axis]));
}

// --- the mouse

function placeOf(event) {
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

let drag = null;

// Ends a drag without its effect; false if there is none.
function dropDrag() {
  if (!drag) return false;
  if (drag.kind === 'corner') putBack(app.buildings, drag);
  drag = app.box = app.stroke = app.snap = null;
  refresh();
  return true;
}

function pressed(event) {
  byId('pane').focus();
  dropDrag();
  if (!event.isPrimary) return;  // a second finger
  keepNudge();
  const place = placeOf(event);
  byId('pane').setPointerCapture(event.pointerId);
  drag = {start: place, last: place, moved: false, turn: event.button === 2, kind: 'pan'};
  if (event.button !== 0) return;
  if (app.tool === 'area') drag.kind = 'area';
  if (app.tool === 'level') drag.kind = 'level';
  if (app.tool === 'select') {
    const corner = cornerAt(place);
    if (corner >= 0) {
      Object.assign(drag, shiftOf(app.selected, corner), {kind: 'corner'});
      app.corner = corner;
      refresh();
    }
  }
}

function moved(event) {
  const place = placeOf(event);
  if (!drag) {
    if (app.tool === 'draw') {
      app.cursor = meant(event, app.contour, app.contour[0] ?? null);
      refresh();
    }
    return;
  }
  const [dx, dy] = [place[0] - drag.last[0], place[1] - drag.last[1]];
  drag.last = place;
  drag.moved ||= Math.hypot(place[0] - drag.start[0], place[1] - drag.start[1]) > 3;
  if (!drag.moved) return;
  if (drag.turn) {
    view.yaw -= dx * 0.008;
    view.pitch = Math.min(Math.PI / 2, Math.max(0, view.pitch - dy * 0.008));
    refresh(true);
  } else if (drag.kind === 'pan') {
    view.pan(dx, dy);
    refresh(true);
  } else if (drag.kind === 'area') {
    app.box = [drag.start, place];
    refresh();
  } else if (drag.kind === 'level') {
    app.stroke = [drag.start, place];
    refresh();
  } else if (drag.kind === 'corner') {
    const footprint = app.buildings[drag.of]?.footprint;
    if (!footprint?.[drag.at]) {
      dropDrag();
      return;
    }
    if (drag.on !== app.buildings) Object.assign(drag, shiftOf(drag.of, drag.at));
    const n = footprint.length;
    const at = (i) => footprint[(drag.at + i + n) % n];
    drag.to = meant(event, [at(-2), at(-1)], at(1), drag.at);
    footprint[drag.at] = [...drag.to];
    refresh();
  }
}

function released(event) {
  const ended = drag;
  drag = null;
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
async function addCorner(event) {
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

// --- the keyboard

const kKeys = [
  {keys: ['1'], does: 'from above', run: () => look(0, Math.PI / 2)},
  {keys: ['2'], does: 'from the front', run: () => look(0, 0)},
  {keys: ['3'], does: 'from the side', run: () => look(Math.PI / 2, 0)},
  {keys: ['4'], does: 'from above and the side', run: () => look(0.6, 0.6)},
  {keys: ['f', 'F'], does: 'everything in view', run: fit},
  {keys: ['v', 'V'], does: 'select and move', run: () => setTool('select')},
  {keys: ['d', 'D'], does: 'draw a contour', run: () => setTool('draw')},
  {keys: ['a', 'A'], does: 'propose in a rectangle', run: () => setTool('area')},
  {keys: ['u', 'U'], does: 'say what is upright', run: () => setTool('level')},
  {keys: ['p', 'P'], does: 'propose everywhere', run: () => propose()},
  {keys: ['h', 'H'], does: 'floor and roof by the points', run: heights},
  {keys: ['t', 'T'], does: 'turn the roof', run: () => roofFrom({turn: 1})},
  {keys: ['n', 'N'], does: 'next building', run: () => choose((app.selected + 1) % Math.max(1, app.buildings.length))},
  {keys: ['c', 'C'], does: 'next corner', run: nextCorner},
  {keys: ['ArrowLeft'], does: 'move the corner by a pixel (Shift: 10); without one, the view', run: nudge(-1, 0)},
  {keys: ['ArrowRight'], run: nudge(1, 0)},
  {keys: ['ArrowUp'], run: nudge(0, 1)},
  {keys: ['ArrowDown'], run: nudge(0, -1)},
  {keys: ['+', '='], does: 'zoom in', run: () => zoomBy(1.3)},
  {keys: ['-'], does: 'zoom out', run: () => zoomBy(1 / 1.3)},
  {keys: ['Enter'], does: 'close the contour', run: () => app.tool === 'draw' && closeContour()},
  {keys: ['Escape'], does: 'drop a drag, the contour, the selection', run: escape},
  {
    keys: ['Delete', 'Backspace'],
    does: 'remove the corner, or the building',
    run: (event) => event.repeat || remove(),
  },
  {keys: ['Ctrl+z', 'Ctrl+Z'], does: 'undo', run: undo},
  {keys: ['Ctrl+y', 'Ctrl+Y', 'Ctrl+Shift+Z'], does: 'redo', run: redo},
  {keys: ['m', 'M'], does: 'write the solids', run: models},
  {keys: ['?'], does: 'this help', run: () => byId('help').showModal()},
];

function nextCorner() {
  const building = app.buildings[app.selected];
  if (building) app.corner = (app.corner + 1) % building.footprint.length;
  refresh();
}

function zoomBy(factor) {
  view.zoom(factor, [view.width / 2, view.height / 2]);
  refresh(true);
}

function escape() {
  if (dropDrag()) return;
  if (app.contour.length > 0) {
    app.contour = [];
    refresh();
  } else if (app.corner >= 0) {
    app.corner = -1;
    refresh();
  } else {
    choose(-1);
    setTool('select');
  }
}

function listen() {
  const table = new Map(kKeys.flatMap((entry) => entry.keys.map((key) => [key, entry])));
  document.addEventListener('keydown', (event) => {
    if (event.altKey || byId('help').open) return;
    const {target} = event;
    if (target instanceof HTMLSelectElement ||
        (target instanceof HTMLInputElement && target.type !== 'checkbox')) {
      return;
    }
    if (target instanceof HTMLButtonElement && event.key === 'Enter') return;
    const ctrl = event.ctrlKey || event.metaKey ? 'Ctrl+' : '';
    const entry = table.get(`${ctrl}${ctrl && event.shiftKey ? 'Shift+' : ''}${event.key}`);
    if (!entry) return;
    entry.run(event);
    event.preventDefault();
  });
  byId('keys').append(...kKeys.filter(({does}) => does).flatMap(({keys, does}) => {
    const [dt, dd] = ['dt', 'dd'].map((name) => document.createElement(name));
    dt.textContent = keys[0].length === 1 ? keys[0].toUpperCase() : keys[0];
    dd.textContent = does;
    return [dt, dd];
  }));
  const clicks = {
    top: () => look(0, Math.PI / 2),
    front: () => look(0, 0),
    side: () => look(Math.PI / 2, 0),
    fit,
    select: () => setTool('select'),
    draw: () => setTool('draw'),
    area: () => setTool('area'),
    level: () => setTool('level'),
    undo,
    redo,
    models,
    propose: () => propose(),
    heights,
    remove: () => {
      app.corner = -1;
      remove();
    },
    turn: () => roofFrom({turn: 1}),
    'help-open': () => byId('help').showModal(),
    'help-close': () => byId('help').close(),
  };
  for (const [id, run] of Object.entries(clicks)) byId(id).addEventListener('click', run);
  byId('name').addEventListener('change', () => {
    const name = byId('name').value.trim();
    editSelected((one) => {
      one.name = name;
    });
  });
  byId('ground').addEventListener('change', () => {
    const ground = typedNumber('ground');
    if (ground === null) return;
    editSelected((one) => {
      one.ground = ground;
    });
  });
  byId('shape').addEventListener('change', () => roofFrom());
  for (const id of ['eaves', 'ridge']) {
    byId(id).addEventListener('change', () => {
      const height = typedNumber(id);
      if (height !== null) roofFrom({typed: {[id]: height}});
    });
  }
  for (const id of ['show-lines', 'show-ground', 'show-colors']) {
    byId(id).addEventListener('change', () => refresh(true));
  }
  const pane = byId('pane');
  pane.addEventListener('pointerdown', pressed);
  pane.addEventListener('pointermove', moved);
  pane.addEventListener('pointerup', released);
  pane.addEventListener('pointercancel', dropDrag);
  pane.addEventListener('dblclick', addCorner);
  pane.addEventListener('contextmenu', (event) => event.preventDefault());
  pane.addEventListener('wheel', (event) => {
    view.zoom(Math.exp(-event.deltaY * 0.0015), placeOf(event));
    refresh(true);
    event.preventDefault();
  }, {passive: false});
  new ResizeObserver(() => {
    const {width, height} = pane.getBoundingClientRect();
    const first = view.width <= 1;
    view.width = width;
    view.height = height;
    if (first && app.state) fit();
    refresh(true);
  }).observe(pane);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => refresh());
}

async function load() {
  app.state = await api.state();
  const {positions, colors: bytes} = await api.points(app.state.num_points);
  const heightsAbove = new Float32Array(positions.length / 3);
  const base = app.state.ground.height;
  const {gradient} = app.state.ground;
  const [ox, oy, oz] = app.state.origin;
  for (let i = 0; i < heightsAbove.length; ++i) {
    heightsAbove[i] = oz + positions[3 * i + 2] - base - gradient[0] * (ox + positions[3 * i]) -
        gradient[1] * (oy + positions[3 * i + 1]);
  }
  app.cloud = {positions, colors: bytes, heights: heightsAbove};
  app.top = Math.max(app.state.bounds[1][2] - base, app.state.step);
  for (const id of ['ground', 'eaves', 'ridge']) byId(id).step = 10 ** -numDigits();
  take(app.state);
  refresh(true);
  const leftOut = app.state.left_out ?? [];
  if (leftOut.length > 0) say(`Not shown, and not saved with what you change here: ${leftOut.join(' ')}`, 60);
}

listen();
trying(async () => {
  await load();
  const {width, height} = byId('pane').getBoundingClientRect();
  view.width = width;
  view.height = height;
  fit();
  document.body.dataset.ready = '1';
});
