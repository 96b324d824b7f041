// The page of roomtex-pick: puts the parts together. Frames and conventions: view.js; what is asked
// of the server: align/pick/README.md.

import {AlignDialog} from './align_dialog.js';
import {api} from './api.js';
import {app, kSides} from './app.js';
import {BackProjection, EdgeLayer, settled} from './back.js';
import {kKeys} from './commands.js';
import {listenToDividers} from './dividers.js';
import {byId, el, say, setText} from './dom.js';
import {Editor} from './editor.js';
import {listenToKeys} from './keys.js';
import {Loupe} from './loupe.js';
import {markerAt} from './markers.js';
import {Pane} from './pane.js';
import {Results, showSummary} from './results.js';
import {drawPicks, placedBy, showLoupe} from './scene.js';
import {showHint, showSync} from './status.js';
import {Strip} from './strip.js';
import {listenToTargets} from './targets.js';
import {gammaTable} from './tiles.js';

const kHeartbeat = 5000;   // milliseconds
const kReadyPoll = 500;    // milliseconds
const kStartAgain = 1500;  // milliseconds
const kPatience = 120000;  // milliseconds until a scan should be read again
const kMinPickScale = 2;   // CSS pixels per pixel when a pick is looked at

const views = new Map();  // photo id -> how it was looked at last

function makePane(side) {
  const {editor, picks, lastInput} = app;
  const pane = new Pane(byId(`${side}-pane`), app.store, {
    click: (img) => editor.set(side, img),
    markerAt: (screen) => markerAt(pane.view, editor.markers(side), screen),
    markerPlace: (uid) => editor.placeOf(picks.find(uid), side),
    select: (uid) => {
      editor.select(uid);
      app.results.show(uid);
    },
    dragStart: (uid) => editor.dragStart(side, uid),
    drag: (uid, img) => editor.drag(side, uid, img, pane.view),
    drop: (uid, img) => editor.drop(side, uid, img, pane.view),
    dragCancel: () => editor.dragCancel(),
    hover: () => {
      lastInput[side] = 'mouse';
      showLoupe(side);
    },
    drawn: () => showZoom(side),
    grips: [],
  });
  pane.element.addEventListener('focus', () => {
    editor.side = side;
    app.refresh();
  });
  pane.element.addEventListener('blur', () => app.refresh());
  pane.drawings.push((context, view) => drawPicks(side, context, view));
  return pane;
}

function showZoom(side) {
  const {view, ratio} = app.panes[side];
  setText(byId(`${side}-zoom`), `${Math.round(100 * view.scale * ratio)} %`);
}

function choosePhoto(id) {
  const {editor, panes} = app;
  const photo = app.server.photos.find((one) => one.id === id);
  if (!photo || photo === editor.photo) return;
  const {view} = panes.photo;
  if (editor.photo) views.set(editor.photo.id, [view.scale, view.centre, view.fitted]);
  editor.showPhoto(photo);
  app.edges.leave();
  panes.photo.setPicture(photo.missing ? null : {
    key: `photo ${id}`,
    width: photo.width,
    height: photo.height,
    aspect: 1,
    tile_size: photo.tile_size,
    num_levels: photo.num_levels,
    url: api.photoTile(id),
  });
  if (views.has(id)) [view.scale, view.centre, view.fitted] = views.get(id);
  setText(byId('photo-name'), `\u200e${photo.name}`);
  showNotice();
  byId('photo-name').title = `${photo.name}, ${photo.width} x ${photo.height} pixels`;
  app.refresh();
  follow();
}

// Why the photo cannot be shown.
function showNotice() {
  const {name, missing, problem} = app.editor.photo;
  byId('photo-notice').hidden = !missing && !problem;
  setText(byId('photo-notice'), problem || `There is no ${name} in the photo folder.`);
}

// Also after another picture of the same scan was chosen.
function chooseScan(id) {
  const {editor, panes, server} = app;
  const scan = server.scans.find((one) => one.id === id);
  if (!scan) return;
  const select = byId('scan-picture');
  if (scan !== editor.scan) {
    const before = select.value;
    select.replaceChildren(...scan.pictures.map((name) => el('option', {value: name}, name)));
    if (scan.pictures.includes(before)) select.value = before;
    editor.showScan(scan);
  }
  byId('scan-select').value = String(id);
  byId('scan-name').hidden = server.scans.length > 1;
  setText(byId('scan-name'), scan.name);
  byId('scan-name').title = `${scan.path}, ${scan.width} x ${scan.height} samples`;
  panes.scan.setPicture({
    key: `scan ${id}`,
    width: scan.width,
    height: scan.height,
    aspect: scan.aspect,
    content: scan.content,
    tile_size: scan.tile_size,
    num_levels: scan.num_levels,
    url: api.scanTile(id, select.value),
  });
  app.refresh();
  follow();
}

// What comes with a solution, once the picks rest.
const follow = settled(() => {
  const {editor, picks} = app;
  if (!editor.photo || !editor.scan || editor.dragging || picks.pending) return;
  const solved = picks.session.photos[editor.photo.name]?.solved === true;
  const solution = solved ? picks.session.solution_number : null;
  app.back.show(editor.photo, editor.scan, solution);
  app.edges.show(editor.photo, solution);
});

let frame = 0;
function refresh() {
  if (frame || !app.editor.photo) return;
  frame = requestAnimationFrame(() => {
    frame = 0;
    showAll();
  });
}

function showAll() {
  const {editor, picks} = app;
  const {session} = picks;
  app.results.update(picks, editor.selected);
  showSummary(editor.photo, session, app.server);
  const counts = new Map();
  for (const {image_name} of picks.list) counts.set(image_name, (counts.get(image_name) ?? 0) + 1);
  app.strip.update(editor.photo.id, session.photos, counts);
  setText(byId('photo-fit'), placedBy(session, editor.photo));
  setText(byId('next'), session.next);
  byId('next').title = session.next;
  const steps = [['undo', 'Undo', picks.undoLabel], ['redo', 'Redo', picks.redoLabel]];
  for (const [id, name, label] of steps) {
    byId(id).disabled = !label;
    byId(id).title = label ? `${name}: ${label}` : `Nothing to ${id}`;
  }
  for (const side of kSides) {
    app.panes[side].redraw();
    showLoupe(side);
  }
  showHint();
}

function listen() {
  const {editor, picks, panes} = app;
  for (const side of kSides) {
    byId(`${side}-whole`).addEventListener('click', () => panes[side].fit());
    byId(`${side}-one`).addEventListener('click', () => panes[side].oneToOne());
  }
  byId('undo').addEventListener('click', () => editor.undo(false));
  byId('redo').addEventListener('click', () => editor.undo(true));
  byId('help-open').addEventListener('click', () => byId('help').showModal());
  byId('residuals').addEventListener('change', () => refresh());
  byId('edges').addEventListener('change', () => {
    app.edges.on = byId('edges').checked;
    refresh();
    follow();
  });
  byId('scan-select').addEventListener('change', (event) => chooseScan(Number(event.target.value)));
  byId('scan-picture').addEventListener('change', () => chooseScan(editor.scan.id));
  listenToGamma();
  listenToTargets();
  byId('mirror').hidden = !app.server.can_mirror;
  byId('mirror').addEventListener('click', () => mirrorScan());
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
  // A file that is cut off is noticed when it is first read.
  app.store.onRefused((url, sentence) => {
    const id = Number(/^tile\?photo=(\d+)&/.exec(url)?.[1] ?? NaN);
    const photo = app.server.photos.find((one) => one.id === id);
    if (!photo) return;
    photo.problem = sentence;
    showNotice();
  });
  picks.addEventListener('refused', (event) => say(event.detail, {seconds: 9, urgent: true}));
  addEventListener('focus', () => picks.check());
  setInterval(heartbeat, kHeartbeat);
  addEventListener('beforeunload', (event) => {
    if (picks.pending) event.preventDefault();
  });
}

// The shortest question there is; the answer does not matter.
async function heartbeat() {
  if (document.hidden || app.picks.left || app.picks.state === 'gone' || app.picks.state === 'restarted') return;
  if (app.picks.state === 'unsaved') {
    app.picks.check();  // which has the server try again
    return;
  }
  try {
    await api.align();
  } catch {
    app.picks.check();
  }
}

// The scan's mirror image: the server reads the scan again and is then found under another address.
async function mirrorScan() {
  if (app.picks.pending) {
    say('One moment: the picks are being saved');
    return;
  }
  let path;
  try {
    if ((await api.align()).state === 'running') {
      say('roomtex-align is running, and Mirror would end it: wait for it, or cancel it in Align…', {seconds: 6});
      return;
    }
    ({path} = await api.mirror());
  } catch (error) {
    say(error.message, {seconds: 9, urgent: true});
    return;
  }
  app.picks.leave();
  setText(byId('next'), 'Reading the scan the other way round…');
  document.body.inert = true;
  const late = Date.now() + kPatience;
  while (true) {
    await new Promise((done) => setTimeout(done, kStartAgain));
    try {
      if ((await fetch(`${path}align`)).ok && !app.picks.pending) break;
    } catch {
      // It is still reading.
    }
    // Or it has ended: the picks are still here, and it may come yet.
    if (app.picks.left && Date.now() > late) {
      document.body.inert = false;
      app.picks.stay();
      refresh();
    }
  }
  location.replace(path);
}

function listenToGamma() {
  const slider = byId('gamma');
  // The slider is the logarithm to base 3: gamma goes from a third to three.
  const set = () => {
    app.panes.scan.tone = gammaTable(3 ** Number(slider.value));
    refresh();
  };
  slider.addEventListener('input', set);
  slider.addEventListener('dblclick', () => {
    slider.value = 0;
    set();
  });
}

// The ray caster of a large scan takes a moment: numbers that need it come when it stands.
async function waitUntilReady() {
  const {server} = app;
  while (!server.ready) {
    await new Promise((done) => setTimeout(done, kReadyPoll));
    try {
      const now = await api.state();
      for (const photo of server.photos) {
        const same = now.photos.find((one) => one.id === photo.id);
        photo.scan_share = same?.scan_share ?? photo.scan_share;
      }
      // Picks on their way were solved without the ray caster, perhaps: their answer comes first.
      server.ready = now.ready && app.picks.refresh(now.session);
      refresh();
    } catch {
      // The heartbeat says that the server is gone.
    }
  }
}

function build() {
  const {picks} = app;
  app.refresh = refresh;
  app.choosePhoto = choosePhoto;
  app.chooseScan = chooseScan;
  app.editor = new Editor(picks, {
    changed: () => refresh(),
    choosePhoto: (name) => choosePhoto(app.server.photos.find((one) => one.name === name)?.id),
    chooseScan: (id) => chooseScan(id),
    centre: (side, img) => {
      app.lastInput[side] = 'keys';
      app.panes[side].centreOn(img, kMinPickScale);
    },
  });
  for (const side of kSides) app.panes[side] = makePane(side);
  app.loupes.photo = new Loupe(app.panes.photo, byId('photo-loupe'));
  app.loupes.scan = new Loupe(app.panes.scan, byId('scan-loupe'));
  app.edges = new EdgeLayer(app.panes.photo);
  app.back = new BackProjection(app.panes.scan);
  app.panes.scan.on.grips.push(app.back.grip);
  app.results = new Results({
    choose: (uid) => app.editor.select(uid, {centre: true}),
    enable: (uid, on) => app.editor.enable(uid, on),
    label: (uid, text) => app.editor.setLabel(uid, text),
    remove: (uid) => app.editor.remove(uid),
  });
}

async function start() {
  let server;
  try {
    server = await api.state();
  } catch (error) {
    setText(byId('next'), `roomtex-pick does not answer (${error.message}); trying again.`);
    setTimeout(start, kStartAgain);
    return;
  }
  app.server = server;
  document.title = `roomtex-pick: ${server.picks_path}`;
  build();
  app.strip = new Strip(server.photos, server.models, (id) => choosePhoto(id));
  app.picks.adopt(server.session);
  app.picks.keepHistory(server.picks_path);
  byId('scan-choice').hidden = server.scans.length < 2;
  byId('scan-select')
      .append(...server.scans.map((scan) => el('option', {value: scan.id}, scan.name)));
  listen();
  new AlignDialog(app.picks, server, {
    look: () => {
      app.back.setMode('over');
      if (!byId('edges').checked) byId('edges').click();
    },
    pickIn: (name) => choosePhoto(server.photos.find((photo) => photo.name === name).id),
  });
  chooseScan(server.scans[0].id);
  choosePhoto(server.selected_photo ?? server.photos[0]?.id);
  showSync();
  app.panes.photo.element.focus({preventScroll: true});
  document.body.dataset.ready = 'true';
  waitUntilReady();
}

start();
