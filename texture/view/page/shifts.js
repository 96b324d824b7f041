// How far photos are off the others: a number and a bar in the list of cameras, and a map of the photo
// in which one stands.

import {paintBar} from './legend.js';
import {colorMap, kUnknownColor} from './surface.js';

const $ = (id) => document.getElementById(id);
const kCellPx = 32;  // of the map
const css = (color) => `rgb(${color.join(', ')})`;

export class Shifts {
  // cameras: of the server, with `shift` {before_px, after_px, before_mm, map_px} or null.
  constructor(cameras) {
    const known = cameras.filter(({shift}) => shift);
    // All photos on one scale, so that the bad ones stand out.
    this.high = Math.max(1, ...known.map(({shift}) => shift.before_px));
    this.colors = colorMap('disagreement', 256);
    $('no-shifts').hidden = cameras.length === 0 || known.length > 0;
  }

  #color(px) {
    return css(this.colors[Math.min(255, Math.round(255 * px / this.high))]);
  }

  // What stands behind the name in the list; nothing where nothing was measured.
  label({shift}) {
    if (!shift) return [];
    const label = document.createElement('span'), bar = document.createElement('i');
    label.className = 'off';
    label.textContent = `${shift.before_px.toFixed(1)} px`;
    label.title = sentence(shift);
    bar.style.width = `${100 * Math.min(1, shift.before_px / this.high)}%`;
    bar.style.background = this.#color(shift.before_px);
    label.append(bar);
    return [label];
  }

  // camera: null = none.
  show(camera) {
    const rows = camera?.shift?.map_px ?? [];
    $('shift').hidden = rows.length === 0;
    if (rows.length === 0) return;
    $('shift-title').textContent = sentence(camera.shift);
    const canvas = $('shift-map'), context = canvas.getContext('2d');
    canvas.width = kCellPx * rows[0].length;
    canvas.height = Math.round(canvas.width * camera.height / camera.width);
    const height = canvas.height / rows.length;
    rows.forEach((row, y) => row.forEach((px, x) => {
      context.fillStyle = px === null ? css(kUnknownColor) : this.#color(px);
      context.fillRect(x * kCellPx, y * height, kCellPx, height);
    }));
    paintBar($('shift-bar'), 'disagreement', 0);
    $('shift-high').textContent = `${this.high.toFixed(1)} px and more`;
  }
}

function sentence({before_px: before, after_px: after, before_mm: mm}) {
  const off = `Off the other photos by ${before.toFixed(1)} px (${mm.toFixed(1)} mm)`;
  return after < before ? `${off}, corrected to ${after.toFixed(1)} px` : off;
}
