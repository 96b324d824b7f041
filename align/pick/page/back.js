// What a solution lets us see: the photo back-projected onto the scan (thesis figure 7.2), and the
// scan's edges over the photo. Both belong to one solution; they follow once the picks rest for a
// moment, and until the new one has come the old one stays.

import {api, ServerError} from './api.js';
import {byId, clamp, setText} from './dom.js';
import {drawEdges} from './markers.js';
import {drawTiles} from './tiles.js';

const kSettle = 250;  // milliseconds without a change
const kBlink = 500;   // milliseconds on, and off

export class BackProjection {
  mode = 'off';   // "over", "swipe", "blink"
  #shown = null;  // picture, see tiles.js
  #next = null;   // the picture of a newer solution, while its tiles come
  #canvas = new OffscreenCanvas(1, 1);
  #opacity = 0.6;
  #line = 0.5;  // of the swipe, share of the pane's width
  #lit = true;
  #before = 'off';  // mode before blinking
  #timer = 0;

  constructor(pane) {
    this.pane = pane;
    this.select = byId('back-mode');
    this.range = byId('back-range');
    pane.layers.push((...all) => this.#draw(...all));
    pane.drawings.push((context, view) => this.#drawLine(context, view));
    this.select.addEventListener('change', () => this.setMode(this.select.value));
    this.range.addEventListener('input', () => {
      if (this.mode === 'swipe') {
        this.#line = this.range.value / 100;
      } else {
        this.#opacity = this.range.value / 100;
      }
      pane.redraw();
    });
    // The line can be taken with the mouse.
    this.grip = {
      hit: ([x]) =>
          this.mode === 'swipe' && this.available && Math.abs(x - this.#line * pane.view.width) < 6,
      drag: ([x]) => {
        this.#line = clamp(x / pane.view.width, 0.02, 0.98);
        this.#showRange();
        pane.redraw();
      },
    };
  }

  get available() {
    return this.#shown !== null || this.#next !== null;
  }

  // picture: of the scan; null: no solution for this photo.
  show(photo, scan, solution) {
    if (!scan || solution === null) {
      this.#shown = this.#next = null;
    } else {
      const {width, height, tile_size, num_levels} = scan;
      const next = {
        width,
        height,
        tile_size,
        num_levels,
        photo: photo.id,
        scan: scan.id,
        solution,
        url: api.backTile(photo.id, scan.id, solution)
      };
      const now = this.#next ?? this.#shown;
      if (now && now.photo === next.photo && now.scan === next.scan && now.solution === solution) {
        return;
      }
      if (this.#shown && (this.#shown.photo !== next.photo || this.#shown.scan !== next.scan)) {
        this.#shown = null;
      }
      this.#next = next;
    }
    this.select.disabled = this.range.disabled = !this.available;
    this.pane.redraw();
  }

  setMode(mode) {
    if (mode !== 'blink') this.#before = mode;
    this.mode = this.select.value = mode;
    clearInterval(this.#timer);
    this.#lit = true;
    if (mode === 'blink' && !matchMedia('(prefers-reduced-motion: reduce)').matches) {
      this.#timer = setInterval(() => {
        this.#lit = !this.#lit;
        this.pane.redraw();
      }, kBlink);
    }
    this.#showRange();
    this.pane.redraw();
  }

  toggle(mode) {
    if (!this.available) return false;
    if (mode === 'blink' && this.mode === 'blink') {
      // Without motion each press of the key is one change of the picture.
      if (matchMedia('(prefers-reduced-motion: reduce)').matches) {
        this.#lit = !this.#lit;
        this.pane.redraw();
      } else {
        this.setMode(this.#before);
      }
    } else {
      this.setMode(this.mode === mode ? 'off' : mode);
    }
    return true;
  }

  #showRange() {
    const swipe = this.mode === 'swipe';
    setText(byId('back-label'), swipe ? 'Place of the line' : 'Opacity of the photo');
    this.range.title = swipe ? 'Place of the line' : 'Opacity of the photo';
    this.range.value = Math.round(100 * (swipe ? this.#line : this.#opacity));
  }

  #draw(context, view, ratio, pane) {
    if (this.mode === 'off' || !this.available) return [];
    const {width, height} = context.canvas;
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      [this.#canvas.width, this.#canvas.height] = [width, height];
    }
    const layer = this.#canvas.getContext('2d');
    layer.clearRect(0, 0, width, height);
    const urls = [];
    if (this.#next) {
      const coming = drawTiles(layer, this.#next, view, pane.store, {ratio});
      urls.push(...coming);
      if (coming.every((url) => pane.store.get(url))) {
        this.#shown = this.#next;
        this.#next = null;
      }
    }
    if (this.#shown && this.#next) layer.clearRect(0, 0, width, height);
    if (this.#shown) {
      const old = drawTiles(layer, this.#shown, view, pane.store, {ratio});
      if (!this.#next) urls.push(...old);
    }
    if (!this.#lit) return urls;
    context.globalAlpha = this.mode === 'over' ? this.#opacity : 1;
    const shown = this.mode === 'swipe' ? Math.round(this.#line * width) : width;
    if (shown > 0) context.drawImage(this.#canvas, 0, 0, shown, height, 0, 0, shown, height);
    context.globalAlpha = 1;
    return urls;
  }

  #drawLine(context, view) {
    if (this.mode !== 'swipe' || !this.available) return;
    const x = Math.round(this.#line * view.width);
    context.fillStyle = 'rgba(0, 0, 0, 0.7)';
    context.fillRect(x - 2, 0, 4, view.height);
    context.fillStyle = '#ffffff';
    context.fillRect(x - 0.5, 0, 1, view.height);
    context.beginPath();
    context.roundRect(x - 9, view.height - 60, 18, 28, 5);
    context.fill();
    context.fillStyle = '#222222';
    for (const dx of [-3, 1]) context.fillRect(x + dx, view.height - 52, 1.5, 12);
  }
}

export class EdgeLayer {
  on = false;
  edges = [];
  #key = '';
  #asking = null;
  // Thousands of lines are slow to stroke, above all without a graphics processor: they are
  // stroked again only when the view has changed.
  #canvas = new OffscreenCanvas(1, 1);
  #drawn = '';

  constructor(pane) {
    this.pane = pane;
    pane.drawings.unshift((context, view) => {
      if (this.on && this.edges.length > 0) this.#draw(context, view);
    });
  }

  #draw(context, view) {
    const {ratio} = this.pane;
    const {width, height} = context.canvas;
    const key = [this.#key, view.scale, ...view.centre, width, height, this.edges.length].join();
    if (this.#drawn !== key) {
      this.#drawn = key;
      [this.#canvas.width, this.#canvas.height] = [width, height];
      const layer = this.#canvas.getContext('2d', {willReadFrequently: true});
      layer.scale(ratio, ratio);
      drawEdges(layer, view, this.edges);
    }
    context.drawImage(this.#canvas, 0, 0, width / ratio, height / ratio);
  }

  // Another photo is shown: those of the last one are not its edges.
  leave() {
    this.#asking?.abort();
    this.#key = '';
    this.edges = [];
  }

  // solution null: no solution.
  async show(photo, solution) {
    const key = solution === null || !this.on ? '' : `${photo.id} ${solution}`;
    if (key === this.#key) return;
    if (!key || !this.#key.startsWith(`${photo.id} `)) this.edges = [];
    this.#key = key;
    this.#asking?.abort();
    this.pane.redraw();
    if (!key) return;
    this.#asking = new AbortController();
    try {
      const edges = await api.edges(photo.id, solution, this.#asking.signal);
      if (this.#key !== key) return;
      this.edges = edges;
      this.#drawn = '';
      this.pane.redraw();
    } catch (error) {
      if (error.name !== 'AbortError' && !(error instanceof ServerError)) throw error;
      if (this.#key !== key) return;
      // None rather than old ones; the next change asks again.
      this.#key = '';
      this.edges = [];
      this.pane.redraw();
    }
  }
}

// Calls fn once nothing has called for a moment.
export function settled(fn) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(fn, kSettle);
  };
}
