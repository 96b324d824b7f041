// What is drawn over the two pictures, and where their loupes look.

import {app} from './app.js';
import {byId, el, number, setText} from './dom.js';
import * as markers from './markers.js';

// What says where a photo is, for the views that show it there; '' = nothing does.
export function placedBy(session, photo) {
  const solution = session.photos[photo.name];
  if (!solution?.solved) return '';
  if (solution.by === 'search') {
    return `placed by the search${session.found.trusted ? '' : ', not trusted'}`;
  }
  const rms = typeof solution.rms_px === 'number' ? `, ${number(solution.rms_px, 2)} px rms` : '';
  return `placed by your picks${rms}`;
}

export function drawPicks(side, context, view) {
  const {editor, picks} = app;
  const all = editor.markers(side);
  if (side === 'photo') {
    const shown = byId('residuals').checked ? all.filter((pick) => pick.residual) : [];
    showLegend(shown.length > 0 ? markers.drawResiduals(context, view, shown) : 0);
  }
  for (const pick of all) {
    if (!pick.selected) markers.drawMarker(context, view, pick);
  }
  if (side === 'scan') showPlacedBy();
  const half = editor.half;
  const ghost = editor.ghostOf(half, side);
  if (ghost && !(side === 'scan' && editor.tried)) {
    markers.drawGhost(context, view, ghost, picks.numberOf(half.uid));
  }
  for (const pick of all) {
    if (pick.selected) markers.drawMarker(context, view, pick);
  }
  if (side === 'scan' && editor.tried?.message && editor.tried.scan === editor.scan.id) {
    markers.drawRefused(context, view, editor.tried.place, editor.tried.snap);
  }
  if (crossShown(side)) markers.drawCrosshairCursor(context, view, editor.crossOf(side, view));
}

// Keys move the crosshair where they have no point to move.
export function crossShown(side) {
  const {editor, picks, panes, lastInput} = app;
  return lastInput[side] === 'keys' && document.activeElement === panes[side].element &&
      editor.placeOf(picks.find(editor.selected), side) === null;
}

// Beside the photo that lies on the scan.
function showPlacedBy() {
  const {back, editor, picks} = app;
  const legend = byId('scan-legend');
  const text = placedBy(picks.session, editor.photo);
  legend.hidden = back.mode === 'off' || !back.available || text === '';
  setText(legend, text);
}

function showLegend(factor) {
  const {edges} = app;
  const legend = byId('photo-legend');
  const withEdges = edges.on && edges.edges.length > 0;
  const key = `${factor} ${withEdges}`;
  if (legend.dataset.key === key) return;
  legend.dataset.key = key;
  const lines = [];
  if (factor > 0) lines.push(el('div', {}, `residuals × ${factor}`));
  if (withEdges) lines.push(...markers.edgeLegend());
  legend.replaceChildren(...lines);
  legend.hidden = lines.length === 0;
}

// The cursor, or where keys work: the selected point, the crosshair, the predicted partner.
export function showLoupe(side) {
  const {editor, picks, panes, loupes, lastInput} = app;
  const pane = panes[side];
  const pick = picks.find(editor.selected);
  let place = null;
  if (lastInput[side] === 'mouse' && pane.cursor) {
    const dragged = editor.dragging && editor.side === side;
    place = dragged ? editor.placeOf(pick, side) : pane.view.toImg(pane.cursor);
    if (place && !pane.view.contains(place)) place = null;
  } else {
    place = editor.placeOf(pick, side) ??
        (crossShown(side) ? editor.crossOf(side, pane.view) : null) ??
        editor.ghostOf(editor.half, side);
  }
  loupes[side].show(place);
}
