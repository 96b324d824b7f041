// What can be done with buildings and their corners.

import {api} from './api.js';
import {app, byId, say, trying, view} from './app.js';
import {change, moveCorner, plain, queue, shiftOf} from './changes.js';
import {guessRoof, makeRoof, roofRange, wallOf} from './roof.js';
import {choose, refresh, setTool, shown} from './show.js';

const kNudgeRest = 300;  // milliseconds after the last arrow key until a corner is saved

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

export function closeContour() {
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
export function propose(area) {
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
export function editSelected(edit) {
  const at = app.selected;
  if (!app.buildings[at]) return Promise.resolve(false);
  return change((all) => all[at] && edit(all[at], app.buildings[at]) !== false ? all : null);
}

export function heights() {
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

export function remove() {
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
export function typedNumber(id) {
  const value = byId(id).valueAsNumber;
  if (Number.isFinite(value)) return value;
  say('Type a number.');
  const building = app.buildings[app.selected];
  if (building) byId(id).value = shown({ground: building.ground, ...roofRange(building)}[id]);
  return null;
}

// typed: the height that was typed, {eaves} or {ridge}. The fields are rounded: the others stay.
export function roofFrom({turn = 0, typed = {}} = {}) {
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

export function models() {
  trying(() => queue(async () => say(`Written: ${(await api.models()).written.join(', ')}`)));
}

// A corner that the arrows move: shiftOf() and `by`. It is saved once they rest.
export function nudge(dx, dy) {
  return (event) => {
    if (app.corner < 0 || !view.isTop) {
      view.pan(-dx * 60, dy * 60);
      refresh(true);
      return;
    }
    const [of, at] = [app.selected, app.corner];
    const footprint = app.buildings[of]?.footprint;
    if (!footprint?.[at] || app.drag) return;
    if (app.nudged && (app.nudged.of !== of || app.nudged.at !== at)) keepNudge();
    app.nudged ??= {...shiftOf(of, at), by: [0, 0]};
    if (app.nudged.on !== app.buildings) Object.assign(app.nudged, shiftOf(of, at));
    const step = (event.shiftKey ? 10 : 1) / view.scale;
    const {right, up} = view.axes();
    app.nudged.by = app.nudged.by.map((value, axis) => value + step * (dx * right[axis] + dy * up[axis]));
    footprint[at] = app.nudged.from.map((value, axis) => value + app.nudged.by[axis]);
    clearTimeout(app.nudged.timer);
    app.nudged.timer = setTimeout(keepNudge, kNudgeRest);
    refresh();
  };
}

export function keepNudge() {
  if (!app.nudged) return;
  const {by, timer, ...shift} = app.nudged;
  clearTimeout(timer);
  app.nudged = null;
  moveCorner(shift, (corner) => corner.map((value, axis) => value + by[axis]));
}
