// The page of roomtex-pick: puts the parts together. Frames and conventions: view.js; what is asked of
// the server: align/pick/README.md.

import { AlignDialog } from './align_dialog.js';
import { api } from './api.js';
import { BackProjection, EdgeLayer, settled } from './back.js';
import { byId, el, number, say, setText } from './dom.js';
import { Editor } from './editor.js';
import { listenToKeys } from './keys.js';
import { listenToDividers } from './dividers.js';
import { Loupe } from './loupe.js';
import * as markers from './markers.js';
import { Pane } from './pane.js';
import { Picks } from './picks.js';
import { Results, showSummary } from './results.js';
import { Strip } from './strip.js';
import { gammaTable, TileStore } from './tiles.js';

const kSides = ['photo', 'scan'];
const kHeartbeat = 5000;  // milliseconds
const kReadyPoll = 500;   // milliseconds

const store = new TileStore();
const picks = new Picks();
let server = null;  // its state
let strip = null;
let results = null;
let align = null;
let last_input = { photo: 'mouse', scan: 'mouse' };  // what the loupe follows
const views = new Map();  // photo id -> how it was looked at last

const editor = new Editor(picks, {
  changed: () => refresh(),
  choosePhoto: (name) => choosePhoto(server.photos.find((photo) => photo.name === name)?.id),
  chooseScan: (id) => chooseScan(id),
  centre: (side, img) => {
    last_input[side] = 'keys';
    panes[side].centreOn(img, 2);
  },
});

function makePane(side) {
  const on = {
    click: (img) => editor.set(side, img),
    markerAt: (screen) => markers.markerAt(panes[side].view, editor.markers(side), screen),
    markerPlace: (uid) => editor.placeOf(picks.find(uid), side),
    select: (uid) => {
      editor.select(uid);
      results.show(uid);
    },
    dragStart: (uid) => editor.dragStart(side, uid),
    drag: (uid, img) => editor.drag(side, uid, img, panes[side].view),
    drop: (uid, img) => editor.drop(side, uid, img, panes[side].view),
    dragCancel: () => editor.dragCancel(),
    hover: () => {
      last_input[side] = 'mouse';
      showLoupe(side);
    },
    drawn: () => showZoom(side),
    grips: [],
  };
  const pane = new Pane(byId(`${side}-pane`), store, on);
  pane.element.addEventListener('focus', () => {
    editor.side = side;
    refresh();
  });
  pane.element.addEventListener('blur', () => refresh());
  pane.drawings.push((context, view) => drawPicks(side, context, view));
  return pane;
}

const panes = { photo: makePane('photo'), scan: makePane('scan') };
const loupes = {
  photo: new Loupe(panes.photo, byId('photo-loupe'), 'px'),
  scan: new Loupe(panes.scan, byId('scan-loupe'), 'samples'),
};
const edges = new EdgeLayer(panes.photo, byId('photo-legend'));
const back = new BackProjection(panes.scan);
panes.scan.on.grips.push(back.grip);

function drawPicks(side, context, view) {
  const all = editor.markers(side);
  if (side === 'photo') {
    const shown = byId('residuals').checked ? all.filter((pick) => pick.residual) : [];
    const factor = shown.length > 0 ? markers.drawResiduals(context, view, shown) : 0;
    showLegend(factor);
  }
  for (const pick of all) if (!pick.selected) markers.drawMarker(context, view, pick);
  const half = editor.half;
  const ghost = editor.ghostOf(half, side);
  if (ghost && !(side === 'scan' && editor.tried)) {
    markers.drawGhost(context, view, ghost, picks.numberOf(half.uid));
  }
  for (const pick of all) if (pick.selected) markers.drawMarker(context, view, pick);
  if (side === 'scan' && editor.tried?.message && editor.tried.scan === editor.scan.id) {
    markers.drawRefused(context, view, editor.tried.place, editor.tried.snap);
  }
  if (crossShown(side)) markers.drawCrosshairCursor(context, view, editor.crossOf(side, view));
}

// Keys move the crosshair where they have no point to move.
function crossShown(side) {
  return last_input[side] === 'keys' && document.activeElement === panes[side].element &&
      editor.placeOf(picks.find(editor.selected), side) === null;
}

function showLegend(factor) {
  const legend = byId('photo-legend');
  const key = `${factor} ${edges.on && edges.edges.length > 0}`;
  if (legend.dataset.key === key) return;
  legend.dataset.key = key;
  const lines = [];
  if (factor > 0) lines.push(el('div', {}, `residuals × ${factor}`));
  if (edges.on && edges.edges.length > 0) lines.push(...markers.edgeLegend());
  legend.replaceChildren(...lines);
  legend.hidden = lines.length === 0;
}

function showLoupe(side) {
  const pane = panes[side];
  let place = null;
  const pick = picks.find(editor.selected);
  if (last_input[side] === 'mouse' && pane.cursor) {
    const dragged = editor.dragging && editor.side === side;
    place = dragged ? editor.placeOf(pick, side) : pane.view.toImg(pane.cursor);
    if (!pane.view.contains(place ?? [-1, -1])) place = null;
  } else {
    place = editor.placeOf(pick, side) ??
        (crossShown(side) ? editor.crossOf(side, pane.view) : null) ?? editor.ghostOf(editor.half, side);
  }
  loupes[side].show(place);
}

function showZoom(side) {
  const scale = panes[side].view.scale * panes[side].ratio;
  setText(byId(`${side}-zoom`), `${scale < 0.995 ? Math.round(100 * scale) : number(100 * scale, 0)} %`);
}

function choosePhoto(id) {
  const photo = server.photos.find((one) => one.id === id);
  if (!photo || photo === editor.photo) return;
  const { view } = panes.photo;
  if (editor.photo) views.set(editor.photo.id, [view.scale, view.centre, view.fitted]);
  editor.photo = photo;
  editor.cross.photo = null;
  // A scan point without a partner goes along to the new photo.
  const loose = picks.list.find((pick) => !pick.img);
  if (loose && loose.image_name !== photo.name) {
    picks.set(`pick ${picks.numberOf(loose.uid)} to ${photo.name}`, loose.uid, { image_name: photo.name }, `photo of ${loose.uid}`);
  }
  panes.photo.setPicture({
    key: `photo ${id}`, width: photo.width, height: photo.height, aspect: 1,
    tile_size: photo.tile_size, num_levels: photo.num_levels, url: api.photoTile(id),
  });
  if (views.has(id)) [view.scale, view.centre, view.fitted] = views.get(id);
  setText(byId('photo-name'), photo.name);
  byId('photo-name').title = `${photo.name}, ${photo.width} x ${photo.height} pixels`;
  refresh();
  follow();
}

function chooseScan(id) {
  const scan = server.scans.find((one) => one.id === id);
  if (!scan) return;
  const select = byId('scan-picture');
  if (scan !== editor.scan) {
    const before = select.value;
    select.replaceChildren(...scan.pictures.map((name) => el('option', { value: name }, name)));
    if (scan.pictures.includes(before)) select.value = before;
    editor.cross.scan = null;
  }
  editor.scan = scan;
  byId('scan-select').value = String(id);
  setText(byId('scan-name'), server.scans.length > 1 ? 'Scan' : scan.name);
  byId('scan-name').title = `${scan.path}, ${scan.width} x ${scan.height} samples`;
  panes.scan.setPicture({
    key: `scan ${id}`, width: scan.width, height: scan.height, aspect: scan.aspect,
    tile_size: scan.tile_size, num_levels: scan.num_levels, url: api.scanTile(id, select.value),
  });
  refresh();
  follow();
}

// What comes with a solution, once the picks rest.
const follow = settled(() => {
  if (!server || editor.dragging || picks.pending) return;
  const solved = picks.session.photos[editor.photo?.name]?.solved === true;
  const revision = solved ? picks.session.revision : null;
  back.show(editor.photo, editor.scan, revision);
  edges.show(editor.photo, revision);
});

let refreshing = 0;
function refresh() {
  if (refreshing || !server) return;
  refreshing = requestAnimationFrame(() => {
    refreshing = 0;
    showAll();
  });
}

function showAll() {
  const { session } = picks;
  results.update(picks, editor.selected);
  showSummary(editor.photo, session, server.min_picks);
  const counts = new Map();
  for (const { image_name } of picks.list) counts.set(image_name, (counts.get(image_name) ?? 0) + 1);
  strip.update(editor.photo?.id, session.photos, counts);
  const solution = session.photos[editor.photo?.name];
  setText(byId('photo-fit'), solution?.solved ? `${number(solution.rms_px, 2)} px rms` : '');
  setText(byId('next'), session.next);
  byId('undo').disabled = !picks.can_undo;
  byId('redo').disabled = !picks.can_redo;
  byId('undo').title = picks.can_undo ? `Undo: ${picks.undo_label} (Ctrl+Z)` : 'Nothing to undo';
  byId('redo').title = picks.can_redo ? `Redo: ${picks.redo_label} (Ctrl+Y)` : 'Nothing to redo';
  for (const side of kSides) {
    panes[side].redraw();
    showLoupe(side);
  }
  showHint();
}

// The server's sentence where the click was, with the nearest place that can be picked.
function showHint() {
  const hint = byId('hint');
  const { tried } = editor;
  const message = tried?.message || (tried ? editor.drag_message : '');
  if (!message || tried.scan !== editor.scan.id) {
    hint.hidden = true;
    return;
  }
  if (hint.dataset.text !== message || hint.dataset.snap !== String(tried.snap !== null)) {
    hint.dataset.text = message;
    hint.dataset.snap = String(tried.snap !== null);
    hint.replaceChildren(el('p', {}, message), el('div', { class: 'actions' },
        tried.snap ? el('button', { type: 'button', class: 'main', onclick: () => {
          editor.takeSnap();
          panes.scan.element.focus();
        } }, 'Nearest place (Enter)') : null,
        tried.message ? el('button', { type: 'button', onclick: () => {
          editor.back();
          panes.scan.element.focus();
        } }, 'Leave it (Esc)') : null));
  }
  hint.hidden = false;
  const box = panes.scan.element.getBoundingClientRect();
  const [x, y] = panes.scan.view.toScreen(tried.place);
  hint.style.left = `${Math.max(8, Math.min(box.left + x + 18, innerWidth - hint.offsetWidth - 8))}px`;
  hint.style.top = `${Math.max(50, Math.min(box.top + y + 18, innerHeight - hint.offsetHeight - 8))}px`;
}

const kSaveTexts = {
  saved: () => 'saved',
  saving: () => 'saving…',
  unsaved: (why) => `not saved: ${why}`,
  gone: (why) => `not saved: ${why}; trying again`,
  restarted: (why) => `not saved: ${why}`,
  stale: (why) => `not saved: ${why}`,
};

function showSync() {
  const box = byId('save');
  // Nothing is unsaved when the server is gone and nothing was changed since.
  const gone = picks.state === 'gone' && !picks.pending;
  box.dataset.state = picks.state;
  box.title = server ? server.picks_path : '';
  setText(byId('save-text'), gone ? 'the server does not answer; trying again' : kSaveTexts[picks.state](picks.why));
  const banner = byId('banner');
  if (banner.dataset.state === picks.state) return;
  banner.dataset.state = picks.state;
  if (picks.state === 'stale') {
    banner.replaceChildren(
        el('p', {}, 'The picks were changed in another tab or window. What you change here is not saved until you choose.'),
        el('button', { type: 'button', onclick: () => picks.keepOwn() }, 'Keep mine'),
        el('button', { type: 'button', class: 'main', onclick: () => {
          picks.takeOther();
          editor.select(null);
        } }, 'Reload the picks'));
  } else if (picks.state === 'gone') {
    banner.replaceChildren(el('p', {}, 'roomtex-pick does not answer. Go on: your changes are kept here and saved ' +
        'as soon as it is back. Do not close this page.'));
  } else if (picks.state === 'restarted') {
    banner.replaceChildren(el('p', {}, 'roomtex-pick was started anew and has a new address, which it printed. ' +
        'What the last one had not saved is only on this page.'));
  }
  banner.hidden = !['stale', 'gone', 'restarted'].includes(picks.state);
}

function arrows(dx, dy) {
  return (event) => {
    const { side } = editor;
    const pane = panes[side];
    if (event.ctrlKey || event.metaKey) {
      pane.pan(-dx * 60, -dy * 60);
      return;
    }
    if (document.activeElement !== pane.element) pane.element.focus();
    last_input[side] = 'keys';
    const size = event.shiftKey ? 0.1 : 1;
    editor.move(side, dx * size, dy * size, pane.view);
    const pick = picks.find(editor.selected);
    const place = editor.placeOf(pick, side) ?? editor.crossOf(side, pane.view);
    if (!pane.view.shows(place, 20)) pane.centreOn(place);
  };
}

function setPoint() {
  const { side } = editor;
  const { view } = panes[side];
  if (document.activeElement !== panes[side].element) return false;
  if (editor.placeOf(picks.find(editor.selected), side) !== null && last_input[side] === 'keys') {
    // A point is selected here: a second one on top of it is hardly meant.
    say('Escape first, then the arrows move the crosshair for a new point');
    return true;
  }
  const place = last_input[side] === 'mouse' && panes[side].cursor ? view.toImg(panes[side].cursor) :
      editor.crossOf(side, view);
  last_input[side] = 'keys';
  editor.cross[side] = null;
  if (view.contains(place)) editor.set(side, place);
  return true;
}

function zoomKey(factor) {
  const { side } = editor;
  const { view } = panes[side];
  const place = editor.placeOf(picks.find(editor.selected), side) ?? (crossShown(side) ? editor.crossOf(side, view) : null);
  panes[side].zoom(factor, place && view.shows(place) ? view.toScreen(place) : null);
}

const kKeys = [
  { title: 'Setting points', keys: [
    { keys: [], mouse: true, shown: 'Click', does: 'sets a point, in either picture first; a second click on the same side moves it' },
    { keys: [], mouse: true, shown: 'Drag a marker', does: 'moves it, the numbers follow' },
    { keys: [], mouse: true, shown: 'Alt + click', does: 'sets a point on top of a marker' },
    { keys: ['Enter'], shown: 'Enter', does: 'takes the predicted partner, or the nearest place that can be picked; else as Space',
      run: () => editor.takeSnap() || editor.acceptGhost() || setPoint() },
    { keys: ['Space'], shown: 'Space', does: 'sets a point at the crosshair', run: () => setPoint() },
    { keys: ['G'], shown: 'G', does: 'goes to the predicted partner', run: () => editor.showGhost() },
    { keys: ['Escape'], shown: 'Esc', does: 'drops the half-finished pick, the selection, a refused place',
      run: () => { if (!kSides.some((side) => panes[side].cancel())) editor.back(); } },
  ] },
  { title: 'Moving points exactly', keys: [
    { keys: ['ArrowLeft', 'Ctrl+ArrowLeft', 'Shift+ArrowLeft'], shown: '← → ↑ ↓',
      does: 'move the selected point by 1 pixel; without one, the crosshair', run: arrows(-1, 0) },
    { keys: ['ArrowRight', 'Ctrl+ArrowRight', 'Shift+ArrowRight'], run: arrows(1, 0) },
    { keys: ['ArrowUp', 'Ctrl+ArrowUp', 'Shift+ArrowUp'], run: arrows(0, -1) },
    { keys: ['ArrowDown', 'Ctrl+ArrowDown', 'Shift+ArrowDown'], run: arrows(0, 1) },
    { keys: [], shown: 'Shift ←', does: 'the same by a tenth' },
    { keys: ['W'], shown: 'W', does: 'the other picture (also Tab)',
      run: () => panes[editor.side === 'photo' ? 'scan' : 'photo'].element.focus() },
  ] },
  { title: 'Picks', keys: [
    { keys: ['N'], shown: 'N or P', does: 'next, previous pick, in the middle of both pictures', run: () => step(1) },
    { keys: ['P'], run: () => step(-1) },
    { keys: ['X'], shown: 'X', does: 'switches the selected pick off or on', run: () => editor.toggle() },
    { keys: ['Delete', 'Backspace'], shown: 'Del', does: 'removes it', run: () => editor.remove() },
    { keys: ['Ctrl+Z'], shown: 'Ctrl Z', does: 'undoes', run: () => editor.undo(false) },
    { keys: ['Ctrl+Shift+Z', 'Ctrl+Y'], shown: 'Ctrl Y or Ctrl Shift Z', does: 'does it again', run: () => editor.undo(true) },
  ] },
  { title: 'Looking', keys: [
    { keys: [], mouse: true, shown: 'Wheel', does: 'zooms at the cursor' },
    { keys: [], mouse: true, shown: 'Drag', does: 'moves the picture; so does Ctrl with the arrows' },
    { keys: ['+', '='], shown: '+ –', does: 'zoom', run: () => zoomKey(1.4) },
    { keys: ['-'], run: () => zoomKey(1 / 1.4) },
    { keys: ['F', '0'], shown: 'F', does: 'the whole picture', run: () => panes[editor.side].fit() },
    { keys: ['1'], shown: '1', does: 'one pixel on one pixel', run: () => panes[editor.side].oneToOne() },
    { keys: ['L'], shown: 'L', does: 'loupe on or off', run: () => {
      for (const side of kSides) {
        loupes[side].shown = !loupes[side].shown;
        loupes[side].draw();
      }
    } },
    { keys: ['PageDown', ']'], shown: 'PgDn or ]', does: 'next photo', run: () => choosePhoto(strip.next(1)) },
    { keys: ['PageUp', '['], shown: 'PgUp or [', does: 'previous photo', run: () => choosePhoto(strip.next(-1)) },
    { keys: ['M'], shown: 'M', does: 'next picture of the scan (intensity, local, shaded)', run: () => nextPicture() },
  ] },
  { title: 'Checking', keys: [
    { keys: ['E'], shown: 'E', does: 'edges of the scan over the photo', run: () => byId('edges').click() },
    { keys: ['R'], shown: 'R', does: 'residuals', run: () => byId('residuals').click() },
    { keys: ['O'], shown: 'O', does: 'photo over the scan', run: () => overlay('over') },
    { keys: ['S'], shown: 'S', does: 'swipe', run: () => overlay('swipe') },
    { keys: ['B'], shown: 'B', does: 'blink, half a second each', run: () => overlay('blink') },
    { keys: ['?'], shown: '?', does: 'this list', run: () => byId('help').showModal() },
  ] },
];

function step(by) {
  editor.step(by);
  if (editor.selected !== null) results.show(editor.selected);
}

function overlay(mode) {
  if (!back.toggle(mode)) say('The photo can be laid over the scan once its pose is solved');
}

function nextPicture() {
  const select = byId('scan-picture');
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  chooseScan(editor.scan.id);
}

function listen() {
  for (const side of kSides) {
    byId(`${side}-whole`).addEventListener('click', () => panes[side].fit());
    byId(`${side}-one`).addEventListener('click', () => panes[side].oneToOne());
  }
  byId('undo').addEventListener('click', () => editor.undo(false));
  byId('redo').addEventListener('click', () => editor.undo(true));
  byId('help-open').addEventListener('click', () => byId('help').showModal());
  byId('residuals').addEventListener('change', () => refresh());
  byId('edges').addEventListener('change', () => {
    edges.on = byId('edges').checked;
    refresh();
    follow();
  });
  byId('scan-select').addEventListener('change', (event) => chooseScan(Number(event.target.value)));
  byId('scan-picture').addEventListener('change', () => chooseScan(editor.scan.id));
  const gamma = byId('gamma');
  const setGamma = () => {
    // The slider is the logarithm to base 3: a third to three.
    panes.scan.tone = gammaTable(3 ** Number(gamma.value));
    refresh();
  };
  gamma.addEventListener('input', setGamma);
  gamma.addEventListener('dblclick', () => {
    gamma.value = 0;
    setGamma();
  });
  listenToDividers();
  listenToKeys(kKeys);
  picks.addEventListener('change', () => {
    refresh();
    follow();
  });
  picks.addEventListener('sync', () => {
    showSync();
    follow();
  });
  picks.addEventListener('refused', (event) => say(event.detail, { seconds: 9, urgent: true }));
  addEventListener('focus', () => picks.check());
  setInterval(() => { if (!document.hidden) picks.check(); }, kHeartbeat);
  addEventListener('beforeunload', (event) => { if (picks.pending) event.preventDefault(); });
}

// The ray caster of a large scan takes a moment: numbers that need it come when it stands.
async function waitUntilReady() {
  while (!server.ready) {
    await new Promise((done) => setTimeout(done, kReadyPoll));
    try {
      const now = await api.state();
      if (now.ready) picks.refresh(now.session);
      Object.assign(server, { ready: now.ready });
      for (const photo of server.photos) {
        photo.scan_share = now.photos.find((one) => one.id === photo.id)?.scan_share ?? photo.scan_share;
      }
      refresh();
    } catch (error) {
      // The heartbeat says that the server is gone.
    }
  }
}

async function start() {
  try {
    server = await api.state();
  } catch (error) {
    setText(byId('next'), `roomtex-pick does not answer (${error.message}); trying again.`);
    setTimeout(start, 1500);
    return;
  }
  document.title = `roomtex-pick: ${server.picks_path}`;
  strip = new Strip(server.photos, (id) => choosePhoto(id));
  results = new Results({
    choose: (uid) => editor.select(uid, { centre: true }),
    enable: (uid, on) => editor.enable(uid, on),
    remove: (uid) => editor.remove(uid),
  });
  picks.adopt(server.session);
  byId('scan-choice').hidden = server.scans.length < 2;
  byId('scan-select').append(...server.scans.map((scan) => el('option', { value: scan.id }, scan.name)));
  listen();
  align = new AlignDialog(picks, server);
  chooseScan(server.scans[0].id);
  choosePhoto(server.selected_photo ?? server.photos[0]?.id);
  showSync();
  panes.photo.element.focus({ preventScroll: true });
  document.body.dataset.ready = 'true';
  waitUntilReady();
}

start();
