// What part of a picture a pane shows.
//
// Frames: `img` - pixels of the picture (level 0 of its tiles), the upper-left pixel covers 0..1
// and is centred at 0.5, 0.5: the coordinates of the picks, without any shift. `screen` - CSS
// pixels from the pane's upper-left corner. `scale` is CSS pixels per pixel along x; along y it is
// scale * aspect, because the samples of a scan need not be as high as they are wide.

import {clamp} from './dom.js';

const kMaxScale = 64;

export class View {
  constructor() {
    this.pictureWidth = this.pictureHeight = 1;
    this.content = [0, 0, 1, 1];  // img
    this.aspect = 1;
    this.width = this.height = 1;  // of the pane, CSS pixels
    this.scale = 1;
    this.centre = [0.5, 0.5];  // img, shown in the middle of the pane
    this.fitted = true;        // follows the pane's size until the user zooms or pans
  }

  // content: [left, top, right, bottom] of what is to be seen, without an empty border; null = all.
  setPicture(width, height, aspect, content = null) {
    this.pictureWidth = width;
    this.pictureHeight = height;
    this.aspect = aspect;
    this.content = content ?? [0, 0, width, height];
    this.fit();
  }

  // The middle stays in the middle and the scale as it is; a fitted view stays fitted.
  resize(width, height) {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    if (this.fitted) this.fit();
  }

  get fitScale() {
    const margin = 24;
    const [left, top, right, bottom] = this.content;
    return Math.max(
        1e-4,
        Math.min(
            (this.width - margin) / (right - left),
            (this.height - margin) / ((bottom - top) * this.aspect)));
  }

  fit() {
    const [left, top, right, bottom] = this.content;
    this.scale = this.fitScale;
    this.centre = [(left + right) / 2, (top + bottom) / 2];
    this.fitted = true;
  }

  toScreen([x, y]) {
    return [
      (x - this.centre[0]) * this.scale + this.width / 2,
      (y - this.centre[1]) * this.scale * this.aspect + this.height / 2
    ];
  }

  toImg([x, y]) {
    return [
      (x - this.width / 2) / this.scale + this.centre[0],
      (y - this.height / 2) / (this.scale * this.aspect) + this.centre[1]
    ];
  }

  contains([x, y]) {
    return x >= 0 && y >= 0 && x <= this.pictureWidth && y <= this.pictureHeight;
  }

  // Whether a place is seen, at least `margin` CSS pixels inside the pane.
  shows(img, margin = 0) {
    const [x, y] = this.toScreen(img);
    return x >= margin && y >= margin && x <= this.width - margin && y <= this.height - margin;
  }

  panBy(dx, dy) {
    this.centre =
        [this.centre[0] - dx / this.scale, this.centre[1] - dy / (this.scale * this.aspect)];
    this.#moved();
  }

  // What is at `screen` stays there.
  zoomAt(screen, factor) {
    const fixed = this.toImg(screen);
    this.scale = clamp(this.scale * factor, Math.min(this.fitScale, 1) / 2, kMaxScale);
    const now = this.toImg(screen);
    this.centre = [this.centre[0] + fixed[0] - now[0], this.centre[1] + fixed[1] - now[1]];
    this.#moved();
  }

  // atLeast: CSS pixels per pixel; a finer scale is kept.
  centreOn(img, atLeast = 0) {
    this.centre = [...img];
    this.scale = clamp(Math.max(this.scale, atLeast), 1e-4, kMaxScale);
    this.#moved();
  }

  #moved() {
    this.fitted = false;
    this.centre =
        [clamp(this.centre[0], 0, this.pictureWidth), clamp(this.centre[1], 0, this.pictureHeight)];
  }
}
