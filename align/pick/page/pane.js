// One of the two pictures: a canvas of tiles, a canvas of drawings above it, and the mouse.
//
// There are no tools to switch between. The wheel zooms at the cursor; a press that moves by more
// than kClickSlack pans, or moves the marker it began on; a press that does not move is a click.

import {drawTiles} from './tiles.js';
import {View} from './view.js';

const kClickSlack = 4;           // CSS pixels
const kWheelZoom = 0.002;        // per CSS pixel of wheel
export const kMarkerReach = 11;  // CSS pixels; a press this near to a marker takes it

export class Pane {
  // on: {click(img), markerAt(screen) -> id | null, select(id), dragStart(id), drag(id, img),
  // drop(id), dragCancel(id), hover(screen | null), grips: [{hit(screen), drag(screen)}]}.
  constructor(element, store, on) {
    this.element = element;
    this.store = store;
    this.on = on;
    this.view = new View();
    this.picture = null;
    this.tone = null;
    this.layers = [];    // of pictures: (context, view, ratio, this) => urls
    this.drawings = [];  // (context, view) in CSS pixels
    this.cursor = null;  // screen place of the mouse, null when it is elsewhere
    this.press = null;
    [this.tiles, this.overlay] = element.querySelectorAll('canvas');
    new ResizeObserver(() => this.#resize()).observe(element);
    this.#watchRatio();
    store.onTile(() => this.redraw());
    // The ground is drawn, too.
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.redraw());
    this.#listen();
    this.#resize();
  }

  get ratio() {
    return window.devicePixelRatio || 1;
  }

  // picture: see tiles.js, with `key` and `aspect`. The view stays when only what is shown of the
  // same place changes (same key).
  setPicture(picture) {
    const same = this.picture && picture && this.picture.key === picture.key;
    this.picture = picture;
    if (picture && !same) {
      this.view.setPicture(picture.width, picture.height, picture.aspect ?? 1, picture.content);
    }
    this.redraw();
  }

  redraw() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      this.#draw();
    });
  }

  fit() {
    this.view.fit();
    this.redraw();
  }

  // One pixel of the picture on one of the screen.
  oneToOne() {
    this.view.zoomAt([this.view.width / 2, this.view.height / 2], 1 / this.ratio / this.view.scale);
    this.redraw();
  }

  zoom(factor, screen = null) {
    this.view.zoomAt(screen ?? [this.view.width / 2, this.view.height / 2], factor);
    this.redraw();
  }

  pan(dx, dy) {
    this.view.panBy(dx, dy);
    this.redraw();
  }

  centreOn(img, atLeast = 0) {
    this.view.centreOn(img, atLeast);
    this.redraw();
  }

  // The density of pixels changes when the window moves to another screen.
  #watchRatio() {
    const now = matchMedia(`(resolution: ${this.ratio}dppx)`);
    now.addEventListener('change', () => {
      this.#resize();
      this.#watchRatio();
    }, {once: true});
  }

  #resize() {
    const {clientWidth: width, clientHeight: height} = this.element;
    if (width === 0 || height === 0) return;
    for (const canvas of [this.tiles, this.overlay]) {
      canvas.width = Math.round(width * this.ratio);
      canvas.height = Math.round(height * this.ratio);
    }
    this.view.resize(width, height);
    this.redraw();
  }

  #draw() {
    const context = this.tiles.getContext('2d', {alpha: false});
    context.fillStyle = getComputedStyle(this.element).backgroundColor;
    context.fillRect(0, 0, this.tiles.width, this.tiles.height);
    const drawing = this.overlay.getContext('2d');
    drawing.setTransform(1, 0, 0, 1, 0, 0);
    drawing.clearRect(0, 0, this.overlay.width, this.overlay.height);
    if (!this.picture) {
      this.store.want(this, []);
      return;
    }
    const urls = drawTiles(
        context, this.picture, this.view, this.store, {ratio: this.ratio, tone: this.tone});
    for (const layer of this.layers) urls.push(...layer(context, this.view, this.ratio, this));
    this.store.want(this, urls);
    // A frame that only clears may never reach the screen: what was drawn before would stay there.
    drawing.fillStyle = 'rgba(0, 0, 0, 0.004)';
    drawing.fillRect(0, 0, this.overlay.width, this.overlay.height);
    drawing.scale(this.ratio, this.ratio);
    for (const draw of this.drawings) {
      drawing.save();
      draw(drawing, this.view);
      drawing.restore();
    }
    // So that a test knows where a pixel is.
    this.element.dataset.view = [this.view.scale, this.view.aspect, ...this.view.centre].join(' ');
    this.on.drawn?.(this);
  }

  #place(event) {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #listen() {
    const element = this.element;
    element.addEventListener('pointerdown', (event) => this.#down(event));
    element.addEventListener('pointermove', (event) => this.#move(event));
    element.addEventListener('pointerup', (event) => this.#up(event));
    for (const type of ['pointercancel', 'lostpointercapture']) {
      element.addEventListener(type, (event) => {
        if (event.pointerId === this.press?.id) this.cancel();
      });
    }
    element.addEventListener('pointerleave', () => {
      this.cursor = null;
      this.on.hover(null);
    });
    element.addEventListener('contextmenu', (event) => event.preventDefault());
    element.addEventListener('auxclick', (event) => event.preventDefault());
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 33 : event.deltaMode === 2 ? 300 : 1;
      const delta = event.deltaY * lines * (event.ctrlKey ? 4 : 1);
      this.zoom(Math.exp(-kWheelZoom * Math.max(-400, Math.min(400, delta))), this.#place(event));
      this.on.hover(this.cursor);
    }, {passive: false});
  }

  #down(event) {
    if (this.press) {
      // A second finger, or the palm: nothing that was meant by the first.
      if (event.pointerId !== this.press.id) this.cancel();
      return;
    }
    if (!event.isPrimary || !this.picture || event.button > 1) return;
    if (event.button === 1) event.preventDefault();
    const at = this.#place(event);
    const grip = event.button === 0 ? this.on.grips?.find((one) => one.hit(at)) : null;
    // Alt: a new point right on top of a marker.
    const marker = event.button === 0 && !grip && !event.altKey ? this.on.markerAt(at) : null;
    let offset = [0, 0];  // the marker keeps its distance from the cursor
    if (marker !== null) {
      const place = this.on.markerPlace(marker);
      const grabbed = this.view.toImg(at);
      offset = [place[0] - grabbed[0], place[1] - grabbed[1]];
    }
    const {pointerId: id, button} = event;
    this.press = {id, at, last: at, marker, grip, offset, button, moved: false};
    try {
      this.element.setPointerCapture(event.pointerId);
    } catch {
      // The pointer is gone already: the press ends with the next event.
    }
  }

  #move(event) {
    const press = this.press;
    if (press && event.pointerId !== press.id) return;
    const at = this.#place(event);
    this.cursor = at;
    if (press) {
      if (!press.moved && Math.hypot(at[0] - press.at[0], at[1] - press.at[1]) > kClickSlack) {
        press.moved = true;
        if (press.marker !== null) this.on.dragStart(press.marker);
      }
      if (press.moved || press.grip) {
        if (press.grip) {
          press.grip.drag(at);
        } else if (press.marker !== null) {
          this.on.drag(press.marker, this.#target(press, at));
        } else {
          this.pan(at[0] - press.last[0], at[1] - press.last[1]);
        }
      }
      press.last = at;
    }
    this.#setCursor(at);
    this.on.hover(at);
  }

  #up(event) {
    const press = this.press;
    if (!press || event.pointerId !== press.id) return;
    if (event.button !== press.button) {
      // The last of several buttons is let go; that of the press was before.
      this.cancel();
      return;
    }
    this.press = null;
    const at = this.#place(event);
    if (press.grip) return;
    if (press.marker !== null) {
      if (press.moved) {
        this.on.drop(press.marker, this.#target(press, at));
      } else {
        this.on.select(press.marker);
      }
    } else if (!press.moved && press.button === 0) {
      const img = this.view.toImg(at);
      if (this.view.contains(img)) this.on.click(img);
    }
    this.#setCursor(at);
  }

  // Ends a press without its effect.
  cancel() {
    const press = this.press;
    this.press = null;
    if (press && press.marker !== null && press.moved) this.on.dragCancel(press.marker);
    return press !== null;
  }

  #target(press, at) {
    const img = this.view.toImg(at);
    return [img[0] + press.offset[0], img[1] + press.offset[1]];
  }

  #setCursor(at) {
    const press = this.press;
    let cursor = 'crosshair';
    if (press?.moved && press.marker === null && !press.grip) {
      cursor = 'grabbing';
    } else if (press?.marker !== null && press?.moved) {
      cursor = 'none';
    } else if (this.on.grips?.some((grip) => grip.hit(at))) {
      cursor = 'ew-resize';
    } else if (this.on.markerAt(at) !== null) {
      cursor = 'move';
    }
    this.element.style.cursor = cursor;
  }
}
