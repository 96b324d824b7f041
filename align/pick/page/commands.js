// What the keys do, with the sentences that the help dialog shows for them.

import {app, kSides} from './app.js';
import {byId, say} from './dom.js';
import {crossShown} from './scene.js';

// dx, dy: -1, 0 or 1. Ctrl moves the picture, Shift makes it a tenth.
function arrows(dx, dy) {
  return (event) => {
    const {editor, picks, panes, lastInput} = app;
    const {side} = editor;
    const pane = panes[side];
    if (event.ctrlKey || event.metaKey) {
      pane.pan(-dx * 60, -dy * 60);
      return;
    }
    if (document.activeElement !== pane.element) pane.element.focus();
    lastInput[side] = 'keys';
    const size = event.shiftKey ? 0.1 : 1;
    editor.move(side, dx * size, dy * size, pane.view);
    const place =
        editor.placeOf(picks.find(editor.selected), side) ?? editor.crossOf(side, pane.view);
    if (!pane.view.shows(place, 20)) pane.centreOn(place);
  };
}

function setPoint() {
  const {editor, picks, panes, lastInput} = app;
  const {side} = editor;
  const {view, cursor, element} = panes[side];
  if (document.activeElement !== element) return false;
  const byMouse = lastInput[side] === 'mouse' && cursor;
  if (!byMouse && editor.placeOf(picks.find(editor.selected), side) !== null) {
    // A point is selected here: a second one on top of it is hardly meant.
    say('Escape first; then the arrows move the crosshair for a new point');
    return true;
  }
  const place = byMouse ? view.toImg(cursor) : editor.crossOf(side, view);
  lastInput[side] = 'keys';
  if (view.contains(place)) editor.set(side, place);
  return true;
}

// Whether keys have taken the crosshair somewhere: then Enter means that place.
function crossMoved() {
  const {side, cross} = app.editor;
  return cross[side] !== null && crossShown(side);
}

// Enter never puts a half's partner where nobody pointed: a prediction may still be on its way.
function takeOrSet() {
  const {editor, panes, lastInput} = app;
  if (editor.takeSnap()) return true;
  if (!crossMoved()) {
    if (editor.acceptGhost()) return true;
    const {side} = editor;
    const byMouse = lastInput[side] === 'mouse' && panes[side].cursor;
    if (editor.half && !byMouse) {
      say('Nothing is predicted here yet; the arrows move the crosshair, Space sets a point');
      return true;
    }
  }
  return setPoint();
}

// The picture under the mouse; without one, that of the focus.
function lookedAt() {
  const {editor, panes} = app;
  return kSides.find((side) => panes[side].cursor !== null) ?? editor.side;
}

function zoom(factor) {
  const {editor, picks, panes} = app;
  const side = lookedAt();
  const {view} = panes[side];
  const place = editor.placeOf(picks.find(editor.selected), side) ??
      (crossShown(side) ? editor.crossOf(side, view) : null);
  panes[side].zoom(factor, place && view.shows(place) ? view.toScreen(place) : null);
}

function step(by) {
  app.editor.step(by);
  if (app.editor.selected !== null) app.results.show(app.editor.selected);
}

function overlay(mode) {
  if (!app.back.toggle(mode)) say('The photo can be laid over the scan once its pose is solved');
}

function nextPicture() {
  const select = byId('scan-picture');
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  app.chooseScan(app.editor.scan.id);
}

function toggleLoupes() {
  for (const side of kSides) {
    app.loupes[side].shown = !app.loupes[side].shown;
    app.loupes[side].draw();
  }
}

function escape() {
  if (!kSides.some((side) => app.panes[side].cancel())) app.editor.back();
}

const pane = () => app.panes[lookedAt()];
const otherPane = () => app.panes[app.editor.side === 'photo' ? 'scan' : 'photo'];
const arrowKeys = (name) => [name, `Ctrl+${name}`, `Shift+${name}`, `Ctrl+Shift+${name}`];

// See listenToKeys(). Entries without `does` share the line of the one before; entries with `mouse`
// have no key.
export const kKeys = [
  {
    title: 'Setting points',
    keys: [
      {
        mouse: 'Click',
        does: 'sets a point, in either picture first; again on the same side moves it'
      },
      {mouse: 'Drag a marker', does: 'moves it, the numbers follow'},
      {mouse: 'Alt + click', does: 'sets a point right on top of a marker'},
      {
        keys: ['Enter'],
        shown: 'Enter',
        does: 'takes the predicted partner, or the nearest place that can be picked',
        run: () => takeOrSet(),
      },
      {
        keys: ['Space'],
        shown: 'Space',
        does: 'sets a point at the crosshair',
        run: () => setPoint()
      },
      {
        keys: ['G'],
        shown: 'G',
        does: 'goes to the predicted partner',
        run: () => app.editor.showGhost(),
      },
      {
        keys: ['Escape'],
        shown: 'Esc',
        does: 'drops a refused place, a half-finished pick, the selection',
        run: () => escape(),
      },
    ],
  },
  {
    title: 'Moving points exactly',
    keys: [
      {
        keys: arrowKeys('ArrowLeft'),
        shown: '← → ↑ ↓',
        does: 'move the selected point by 1 pixel; without one, the crosshair',
        run: arrows(-1, 0),
      },
      {keys: arrowKeys('ArrowRight'), run: arrows(1, 0)},
      {keys: arrowKeys('ArrowUp'), run: arrows(0, -1)},
      {keys: arrowKeys('ArrowDown'), run: arrows(0, 1)},
      {mouse: 'Shift + arrows', does: 'the same by a tenth'},
      {
        keys: ['C'],
        shown: 'C',
        does: 'moves the selected point of the photo onto the corner beside it',
        run: () => app.editor.toCorner(app.panes.photo.view),
      },
      {
        keys: ['W'],
        shown: 'W',
        does: 'goes to the other picture, as Tab does',
        run: () => otherPane().element.focus(),
      },
    ],
  },
  {
    title: 'Picks',
    keys: [
      {
        keys: ['N'],
        shown: 'N or P',
        does: 'next or previous pick, in the middle of both pictures',
        run: () => step(1),
      },
      {keys: ['P'], run: () => step(-1)},
      {
        keys: ['X'],
        shown: 'X',
        does: 'makes the selected pick a check point, on which nothing rests, or one that counts',
        run: () => app.editor.toggle(),
      },
      {
        keys: ['Delete', 'Backspace'],
        shown: 'Delete',
        does: 'removes it',
        run: () => app.editor.remove(),
      },
      {keys: ['Ctrl+Z'], shown: 'Ctrl+Z', does: 'undoes', run: () => app.editor.undo(false)},
      {
        keys: ['Ctrl+Shift+Z', 'Ctrl+Y'],
        shown: 'Ctrl+Y or Ctrl+Shift+Z',
        does: 'does it again',
        run: () => app.editor.undo(true),
      },
    ],
  },
  {
    title: 'Looking',
    keys: [
      {mouse: 'Wheel', does: 'zooms at the cursor'},
      {mouse: 'Drag', does: 'moves the picture, as Ctrl with the arrows does'},
      {keys: ['+', '='], shown: '+ –', does: 'zoom in and out', run: () => zoom(1.4)},
      {keys: ['-'], run: () => zoom(1 / 1.4)},
      {keys: ['F', '0'], shown: 'F', does: 'whole picture, of the one under the mouse', run: () => pane().fit()},
      {keys: ['1'], shown: '1', does: 'one pixel on one pixel', run: () => pane().oneToOne()},
      {keys: ['L'], shown: 'L', does: 'loupes on or off', run: () => toggleLoupes()},
      {
        keys: ['PageDown', ']'],
        shown: 'PgDn or ]',
        does: 'next photo',
        run: () => app.choosePhoto(app.strip.next(1)),
      },
      {
        keys: ['PageUp', '['],
        shown: 'PgUp or [',
        does: 'previous photo',
        run: () => app.choosePhoto(app.strip.next(-1)),
      },
      {
        keys: ['M'],
        shown: 'M',
        does: 'next picture of the scan (intensity, local, shaded)',
        run: () => nextPicture(),
      },
    ],
  },
  {
    title: 'Checking',
    keys: [
      {
        keys: ['E'],
        shown: 'E',
        does: 'edges of the scan over the photo',
        run: () => byId('edges').click(),
      },
      {
        keys: ['R'],
        shown: 'R',
        does: 'residuals, longer than they are',
        run: () => byId('residuals').click(),
      },
      {keys: ['O'], shown: 'O', does: 'photo over the scan', run: () => overlay('over')},
      {
        keys: ['S'],
        shown: 'S',
        does: 'photo left of a line, scan right of it',
        run: () => overlay('swipe'),
      },
      {
        keys: ['B'],
        shown: 'B',
        does: 'photo and scan in turns, half a second each',
        run: () => overlay('blink'),
      },
      {keys: ['?'], shown: '?', does: 'this list', run: () => byId('help').showModal()},
    ],
  },
];
