// What is on the screen: the drawing, the list and the details of what is selected.

import {app, byId, view} from './app.js';
import {drawOver, drawPoints} from './draw.js';
import {roofRange} from './roof.js';

const style = getComputedStyle(document.documentElement);
function colors() {
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  return {text: of('text'), quiet: of('quiet'), accent: of('accent'), panel: of('panel'), bad: of('bad')};
}

let asked = {points: false, over: false};
export function refresh(points = false) {
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

export function showAll() {
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
export const numDigits = () => Math.min(9, Math.max(2, Math.ceil(1 - Math.log10(app.state.step))));
export const shown = (height) => height.toFixed(numDigits());

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

export function choose(index) {
  app.selected = index;
  app.corner = -1;
  showAll();
}

export function setTool(tool) {
  app.tool = tool;
  app.contour = [];
  app.snap = null;
  if (tool === 'draw' || tool === 'area') look(0, Math.PI / 2);
  if (tool === 'level' && view.isTop) look(0, 0);
  showAll();
}

export function look(yaw, pitch) {
  view.yaw = yaw;
  view.pitch = pitch;
  showAll();
  refresh(true);
}

// The buildings and what is around them; without any, all points.
export function fit() {
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
