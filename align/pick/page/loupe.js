// The place under the cursor, or of the selected point, at eight times its size: true pixels, a
// crosshair, and the coordinates. It sits in a lower corner of the pane and goes up
// when the cursor comes.

import {drawTiles} from './tiles.js';
import {View} from './view.js';

const kMagnification = 8;  // device-independent pixels per pixel of the picture

export class Loupe {
  constructor(pane, element) {
    this.pane = pane;
    this.element = element;
    this.canvas = element.querySelector('canvas');
    this.text = element.querySelector('p');
    this.view = new View();
    this.place = null;  // img
    this.shown = true;
    pane.store.onTile(() => this.draw());
  }

  // img, or null: nothing to look at.
  show(img) {
    this.place = img && this.pane.picture ? img : null;
    this.draw();
  }

  draw() {
    const {pane, view, canvas, place} = this;
    const picture = pane.picture;
    this.element.hidden = !this.shown || !place || !picture;
    if (this.element.hidden) {
      pane.store.want(this, []);
      return;
    }
    const ratio = pane.ratio;
    const size = canvas.clientWidth;
    if (canvas.width !== Math.round(size * ratio)) {
      canvas.width = canvas.height = Math.round(size * ratio);
    }
    view.pictureWidth = picture.width;
    view.pictureHeight = picture.height;
    view.aspect = picture.aspect ?? 1;
    view.width = view.height = size;
    view.scale = kMagnification;
    view.centre = [...place];
    const context = canvas.getContext('2d', {alpha: false});
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = getComputedStyle(pane.element).backgroundColor;
    context.fillRect(0, 0, canvas.width, canvas.height);
    pane.store.want(
        this, drawTiles(context, picture, view, pane.store, {ratio, tone: pane.tone, level: 0}));
    context.scale(ratio, ratio);
    drawCrosshair(context, size);
    this.text.textContent = `${place[0].toFixed(1)}, ${place[1].toFixed(1)}`;
    this.element.dataset.x = place[0];
    this.element.dataset.y = place[1];
    this.#avoidCursor();
  }

  // Down unless that covers the cursor, or the place that is looked at; then up.
  #avoidCursor() {
    const {cursor, view} = this.pane;
    const [x, y] = cursor ?? view.toScreen(this.place);
    const {offsetLeft: left, offsetWidth: width, offsetHeight: height, classList} = this.element;
    const beside = x > left - 40 && x < left + width + 40;
    const up = classList.contains('up');
    if (beside && !up && y > view.height - height - 50) classList.add('up');
    if (up && (!beside || y < height + 50)) classList.remove('up');
  }
}

// Leaves the place itself free. Light on dark, so that it is seen on any picture.
function drawCrosshair(context, size) {
  const middle = size / 2;
  const gap = 7;
  const lines = [
    [0, middle, middle - gap, middle], [middle + gap, middle, size, middle],
    [middle, 0, middle, middle - gap], [middle, middle + gap, middle, size]
  ];
  for (const [style, width] of [['rgba(0, 0, 0, 0.75)', 3], ['#ffffff', 1]]) {
    context.strokeStyle = style;
    context.lineWidth = width;
    context.beginPath();
    for (const [x0, y0, x1, y1] of lines) {
      context.moveTo(x0, y0);
      context.lineTo(x1, y1);
    }
    context.stroke();
  }
  context.fillStyle = '#000000';
  context.fillRect(middle - 1.5, middle - 1.5, 3, 3);
  context.fillStyle = '#ffffff';
  context.fillRect(middle - 0.5, middle - 0.5, 1, 1);
}
