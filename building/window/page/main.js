// The window of roomtex-outline: points from above, contours over them, a list beside. Keys and buttons.

import {app, byId, trying, view} from './app.js';
import {load, redo, undo} from './changes.js';
import {closeContour, editSelected, heights, models, nudge, propose, remove, roofFrom, typedNumber} from './edits.js';
import {addCorner, dropDrag, moved, placeOf, pressed, released} from './pointer.js';
import {choose, fit, look, refresh, setTool} from './show.js';

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

listen();
trying(async () => {
  await load();
  const {width, height} = byId('pane').getBoundingClientRect();
  view.width = width;
  view.height = height;
  fit();
  document.body.dataset.ready = '1';
});
