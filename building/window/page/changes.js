// The buildings as the server has them: every change is sent, taken or taken back, and can be undone.

import {api} from './api.js';
import {app, byId, say} from './app.js';
import {keepNudge} from './edits.js';
import {dropDrag} from './pointer.js';
import {numDigits, refresh, showAll} from './show.js';

// What the file holds of a building.
export const plain = ({name, ground, footprint, roof}) => ({name, ground, footprint, roof});
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
    clearTimeout(app.nudged?.timer);
    app.nudged = null;
    if (app.drag?.kind === 'corner') dropDrag();
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
export function queue(task) {
  keepNudge();
  app.busy = app.busy.catch(() => {}).then(task);
  return app.busy;
}

// `edit` makes of a copy of the buildings, as they are then, what they become; nothing to drop it.
// `shift`: the corner that it moves, where the page shows it moved already. Resolves to whether it
// was taken.
export function change(edit, shift = null) {
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
export function shiftOf(of, at) {
  return {of, at, on: app.buildings, from: [...app.buildings[of].footprint[at]]};
}

// With an answer of the server meanwhile it is back.
export function putBack(buildings, {of, at, on, from}) {
  if (on === app.buildings) buildings[of].footprint[at] = [...from];
}

// move: (corner) => corner.
export function moveCorner(shift, move) {
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

export function undo() {
  return app.contour.length ? (app.contour.pop(), refresh()) : travel(app.done, app.undone);
}
export const redo = () => travel(app.undone, app.done);

export async function load() {
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
