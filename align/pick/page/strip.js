// The photos as thumbnails, those to pick in first in front; picks and residual of each on it.

import {api} from './api.js';
import {byId, el, number, setText} from './dom.js';

// The last two names of a path: what tells sparse/0 from sparse/1.
function shortPath(path) {
  return path.split('/').filter((name) => name !== '').slice(-2).join('/');
}

export class Strip {
  #photos = [];
  #models = [];
  #thumbs = new Map();  // id -> {photo, element, picks, rms, image}
  #queue = [];          // ids of thumbnails in view that are not loaded
  #loading = false;
  #shown = [];  // ids in order, under the filter
  #current = null;

  // models: their paths; with several each photo says of which it is.
  constructor(photos, models, choose) {
    this.box = byId('thumbs');
    this.choose = choose;
    this.#photos = photos;
    this.#models = models.length > 1 ? models.map(shortPath) : [];
    const seen = new IntersectionObserver((entries) => this.#seen(entries), {root: this.box});
    for (const photo of photos) {
      const image = el('img', {alt: '', draggable: 'false'});
      const picks = el('span', {class: 'badge', hidden: true});
      const rms = el('span', {class: 'badge rms', hidden: true});
      const element =
          el('div', {
            class: 'thumb',
            role: 'option',
            id: `thumb-${photo.id}`,
            'aria-selected': 'false',
            'aria-disabled': photo.missing ? 'true' : undefined,
            'data-id': photo.id,
            onclick: () => {
              if (!photo.missing) this.choose(photo.id);
            },
          },
             image, picks, rms, el('span', {class: 'name'}, `\u200e${photo.name}`));
      const model = this.#modelOf(photo);
      if (model) element.append(el('span', {class: 'badge model'}, model));
      this.#thumbs.set(photo.id, {photo, element, picks, rms, image});
      this.box.append(element);
      seen.observe(element);
    }
    byId('filter').addEventListener('input', () => this.#filter());
    byId('filter').addEventListener('keydown', (event) => {
      if (event.key !== 'Enter' && event.key !== 'ArrowDown') return;
      const first = this.#shown.find((id) => !this.#thumbs.get(id).photo.missing);
      if (first !== undefined && event.key === 'Enter') this.choose(first);
      this.box.focus();
      event.preventDefault();
    });
    this.box.addEventListener('keydown', (event) => this.#key(event));
    this.#filter();
  }

  // The ones that the filter leaves, in order.
  next(step) {
    const usable = this.#shown.filter((id) => !this.#thumbs.get(id).photo.missing);
    if (usable.length === 0) return null;
    const at = usable.indexOf(this.#current);
    if (at < 0) return usable[0];
    return usable[(at + step + usable.length) % usable.length];
  }

  // solutions: SESSION.photos; counts: Map image_name -> number of picks, half ones too.
  update(current, solutions, counts) {
    if (current !== this.#current) {
      this.#current = current;
      this.#thumbs.get(current)?.element.scrollIntoView({block: 'nearest'});
    }
    this.box.setAttribute('aria-activedescendant', `thumb-${current}`);
    for (const thumb of this.#thumbs.values()) {
      const {photo} = thumb;
      const count = counts.get(photo.name) ?? 0;
      const rms = solutions[photo.name]?.rms_px ?? null;
      const chosen = photo.id === current;
      // Of hundreds of photos few change while a point is dragged.
      const key = [chosen, count, rms, photo.scan_share].join();
      if (thumb.key === key) continue;
      thumb.key = key;
      this.#fill(thumb, chosen, count, rms);
    }
  }

  // Its model, as sparse/0; '' where there is but one.
  #modelOf(photo) {
    return this.#models[photo.model] ?? '';
  }

  #fill({photo, element, picks, rms}, chosen, count, rms_px) {
    element.setAttribute('aria-selected', String(chosen));
    picks.hidden = count === 0 && !photo.suggested && !photo.missing;
    setText(
        picks,
        photo.missing ? 'cannot be shown' :
            count > 0 ? `${count} pick${count > 1 ? 's' : ''}` :
                        'suggested');
    rms.hidden = rms_px === null;
    setText(rms, `${number(rms_px)} px`);
    const sees = typeof photo.scan_share === 'number' ?
        `, sees ${Math.round(100 * photo.scan_share)} % of the scan` :
        '';
    const model = this.#modelOf(photo) || 'the sparse model';
    const points = photo.num_points > 0 ? `${photo.num_points} points of ${model}` : 'a photo';
    element.title =
        `${photo.name}: ${photo.missing ? photo.problem || 'no such file' : points + sees}`;
  }

  #filter() {
    const text = byId('filter').value.trim().toLowerCase();
    this.#shown = [];
    for (const {photo, element} of this.#thumbs.values()) {
      const names = [photo.name, this.#modelOf(photo)];
      element.hidden = !names.some((name) => name.toLowerCase().includes(text));
      if (!element.hidden) this.#shown.push(photo.id);
    }
    setText(
        byId('strip-count'),
        this.#shown.length === this.#photos.length ?
            String(this.#photos.length) :
            `${this.#shown.length} of ${this.#photos.length}`);
  }

  #key(event) {
    const columns = getComputedStyle(this.box).gridTemplateColumns.split(' ').length;
    const step = {ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns}[event.key];
    if (!step) return;
    event.preventDefault();
    const id = this.next(step);
    if (id !== null) this.choose(id);
  }

  #seen(entries) {
    for (const entry of entries) {
      const id = Number(entry.target.dataset.id);
      const thumb = this.#thumbs.get(id);
      this.#queue = this.#queue.filter((one) => one !== id);
      if (entry.isIntersecting && !thumb.loaded && !thumb.photo.missing) this.#queue.push(id);
    }
    this.#load();
  }

  // One at a time: each costs the server the decoding of a photo, and picks go first.
  async #load() {
    if (this.#loading || this.#queue.length === 0) return;
    this.#loading = true;
    const thumb = this.#thumbs.get(this.#queue.shift());
    try {
      const response = await fetch(api.thumbnail(thumb.photo.id));
      if (response.ok) {
        thumb.image.src = URL.createObjectURL(await response.blob());
        thumb.loaded = true;
      }
    } catch {
      // The server is gone: the next time the thumbnail comes into view it is asked for again.
    }
    this.#loading = false;
    this.#load();
  }
}
