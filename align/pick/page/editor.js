// What clicks, drags and keys do to the picks. Sides are "photo" and "scan".
//
// Where a click of the scan lands is for the server to judge (missing samples, depth edges), so a
// place in the scan is first only tried: until the answer has come, and after a refusal, it is
// `tried` and not part of the picks.

import {api, ServerError} from './api.js';
import {clamp, say} from './dom.js';
import {inScan} from './picks.js';

const kCornerReach = 8;    // CSS pixels: how far from a corner somebody clicks
const kLiveInterval = 80;  // milliseconds between two places tried while a marker is dragged
const kFixed = 'The place of a target is that of its file: only its point in the photo can be moved';

export class Editor {
  photo = null;  // of the server's state
  scan = null;
  selected = null;  // uid
  side = 'photo';   // the pane that keys mean
  // {uid (null: a new pick), place: [x, y], scan: id, message, snap: [x, y] | null}
  tried = null;
  cross = {photo: null, scan: null};  // img of the crosshair that keys move, once they did
  #tryCount = 0;
  #drag = null;  // {side, uid, last, busy, next}

  // on: {changed(), choosePhoto(name), chooseScan(id), centre(side, img)}
  constructor(picks, on) {
    this.picks = picks;
    this.on = on;
  }

  showPhoto(photo) {
    this.photo = photo;
    this.cross.photo = null;
    this.#bringAlong();
  }

  // Scan points without a partner go along to the photo that is shown.
  #bringAlong() {
    const name = this.photo?.name;
    const isBehind = (pick) => !pick.img && pick.image_name !== name;
    if (!this.picks.list.some(isBehind)) return;
    this.picks.follow((pick) => isBehind(pick) ? {...pick, image_name: name} : pick);
  }

  showScan(scan) {
    this.scan = scan;
    this.cross.scan = null;
  }

  // The unfinished pick that a click completes or moves: of this photo, or of none yet.
  get half() {
    const isHalf = (pick) => (!pick.img || !inScan(pick)) &&
        (pick.image_name === this.photo?.name || !pick.img);
    const selected = this.picks.find(this.selected);
    return selected && isHalf(selected) ? selected : this.picks.list.find(isHalf) ?? null;
  }

  // Where a pick lies on a side, or null; only what is on the picture that is shown.
  placeOf(pick, side) {
    if (!pick) return null;
    if (side === 'photo') return pick.image_name === this.photo?.name ? pick.img : null;
    if (this.tried && this.tried.uid === pick.uid && this.tried.scan === this.scan?.id) {
      return this.tried.place;
    }
    return pick.scan && pick.scan.id === this.scan?.id ? [pick.scan.x, pick.scan.y] : null;
  }

  // What the server says of a pick, if that is of the pick as it is now; else null.
  #rowOf(pick) {
    const row = pick && this.picks.rows.get(pick.uid);
    const place = ({image_name, img, scan, point}) =>
        JSON.stringify([image_name, img, scan ? [scan.id, scan.x, scan.y] : point]);
    return row && place(row) === place(pick) ? row : null;
  }

  // Where the solution expects the missing half, on the picture that is shown.
  ghostOf(pick, side) {
    const row = this.#rowOf(pick);
    if (!row) return null;
    if (side === 'photo') {
      return !pick.img && pick.scan && pick.image_name === this.photo?.name ? row.predicted_img :
                                                                              null;
    }
    const place = row.predicted_scan;
    return !pick.scan && pick.img && place && place.id === this.scan?.id ? [place.x, place.y] :
                                                                           null;
  }

  // For drawing and for the mouse.
  markers(side) {
    const markers = [];
    this.picks.list.forEach((pick, index) => {
      if (side === 'scan' && this.tried?.message && this.tried.uid === pick.uid) return;
      const place = this.placeOf(pick, side);
      if (!place) return;
      const row = this.picks.rows.get(pick.uid);
      markers.push({
        id: pick.uid,
        number: index + 1,
        label: pick.label,
        place,
        status: this.picks.statusOf(pick),
        worst: row?.worst === true,
        selected: pick.uid === this.selected,
        dim: side === 'scan' && pick.image_name !== this.photo?.name && pick.img !== null,
        residual: row?.residual ?? null,
      });
    });
    return markers;
  }

  select(uid, {centre = false} = {}) {
    const pick = this.picks.find(uid);
    this.forgetTried();
    this.selected = pick ? uid : null;
    if (pick && centre) {
      if (pick.img && pick.image_name !== this.photo?.name) this.on.choosePhoto(pick.image_name);
      if (pick.scan && pick.scan.id !== this.scan?.id) this.on.chooseScan(pick.scan.id);
      for (const side of ['photo', 'scan']) {
        const place = this.placeOf(pick, side) ?? this.ghostOf(pick, side);
        if (place) this.on.centre(side, place);
      }
    }
    this.on.changed();
  }

  step(step) {
    const {list} = this.picks;
    if (list.length === 0) return;
    const at = list.findIndex((pick) => pick.uid === this.selected);
    const to = at < 0 ? (step > 0 ? 0 : list.length - 1) : (at + step + list.length) % list.length;
    this.select(list[to].uid, {centre: true});
    say(`Pick ${to + 1} of ${list.length}`, {seconds: 1.5});
  }

  // A point is set: the click of a mouse, or of the crosshair.
  set(side, img) {
    this.cross = {photo: null, scan: null};
    const half = this.half;
    if (side === 'scan') {
      // A target that waits for its click in the photo keeps its place: this is another pick.
      this.#tryPlace(half && !half.fixed ? half.uid : null, img);
      return;
    }
    this.forgetTried();
    const name = this.photo.name;
    const target = half && !half.img;
    if (half) {
      const label = half.img ? 'moved' : 'completed';
      this.picks.set(
          `pick ${this.picks.numberOf(half.uid)} ${label}`, half.uid, {img, image_name: name});
      this.selected = half.uid;
    } else {
      this.selected =
          this.picks.add(`pick ${this.picks.list.length + 1} begun`, {image_name: name, img});
    }
    const next = target ? this.half : null;
    if (next && !next.img) say(`Next: ${next.label || `pick ${this.picks.numberOf(next.uid)}`}`);
    this.on.changed();
  }

  // Points with coordinates (targets.js): each waits for its click in the photo.
  addTargets(targets) {
    const name = this.photo.name;
    const here = this.picks.list.filter((pick) => pick.image_name === name);
    const fresh = targets.filter(({label}) => !here.some((pick) => pick.label === label));
    if (fresh.length === 0) {
      say(`All of these targets are there for ${name} already`);
      return;
    }
    this.selected = this.picks.addAll(
        `${fresh.length} targets added`,
        fresh.map(({label, point}) => ({image_name: name, label, point, fixed: true})));
    const first = this.picks.find(this.selected);
    say(`${fresh.length} targets: click ${first.label} in the photo, or choose another below`,
        {seconds: 6});
    this.on.changed();
  }

  setLabel(uid, label) {
    const pick = this.picks.find(uid);
    if (!pick || pick.label === label) return;
    this.picks.set(`pick ${this.picks.numberOf(uid)} labelled`, uid, {label});
    this.on.changed();
  }

  async #ask(scan, [x, y]) {
    try {
      return await api.scanPoint(scan, x, y);
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      if (error.kind !== 'refused') this.picks.check();
      return {ok: false, message: `Not set: ${error.message}.`, snap: null};
    }
  }

  // merge: see Picks.change().
  async #tryPlace(uid, place, merge = '') {
    const count = ++this.#tryCount;
    const scan = this.scan.id;
    this.tried = {uid, place, scan, message: '', snap: null};
    this.on.changed();
    const answer = await this.#ask(scan, place);
    if (count !== this.#tryCount) return;  // another place has been tried since
    if (!answer.ok) {
      const snap = answer.snap ? [answer.snap.x, answer.snap.y] : null;
      this.tried = {uid, place, scan, message: answer.message, snap};
      this.on.changed();
      return;
    }
    this.tried = null;
    this.#setScan(uid, {id: scan, x: place[0], y: place[1]}, answer.point, merge);
  }

  #setScan(uid, scan, point, merge) {
    const pick = uid === null ? null : this.picks.find(uid);
    if (pick) {
      const label = pick.scan ? 'moved in the scan' : 'completed';
      // A scan point that was clicked first belongs to the photo that is shown when it is
      // completed.
      this.picks.set(`pick ${this.picks.numberOf(uid)} ${label}`, uid, {scan, point: null}, merge);
      this.selected = uid;
    } else {
      this.selected = this.picks.add(
          `pick ${this.picks.list.length + 1} begun`, {image_name: this.photo.name, scan});
    }
    this.on.changed();
  }

  takeSnap() {
    if (!this.tried?.snap) return false;
    this.#tryPlace(this.tried.uid, this.tried.snap);
    return true;
  }

  forgetTried() {
    ++this.#tryCount;
    if (!this.tried) return false;
    this.tried = null;
    return true;
  }

  // The prediction becomes the missing half.
  acceptGhost() {
    const half = this.half;
    const row = this.#rowOf(half);
    if (!row) return false;
    if (!half.img && row.predicted_img) {
      this.set('photo', row.predicted_img);
      return true;
    }
    if (!half.scan && row.predicted_scan) {
      const {id, x, y} = row.predicted_scan;
      if (id !== this.scan?.id) this.on.chooseScan(id);
      this.#tryPlace(half.uid, [x, y]);
      return true;
    }
    return false;
  }

  showGhost() {
    const half = this.half;
    const row = this.#rowOf(half);
    if (row?.predicted_scan && row.predicted_scan.id !== this.scan?.id) {
      this.on.chooseScan(row.predicted_scan.id);
    }
    for (const side of ['photo', 'scan']) {
      const ghost = this.ghostOf(half, side);
      if (ghost) this.on.centre(side, ghost);
    }
  }

  remove(uid = this.selected) {
    const pick = this.picks.find(uid);
    if (!pick) return;
    const number = this.picks.numberOf(uid);
    this.forgetTried();
    this.picks.remove(`pick ${number} removed`, uid);
    if (this.selected === uid) this.selected = null;
    say(`Pick ${number} removed; Ctrl+Z brings it back`);
    this.on.changed();
  }

  enable(uid, on) {
    const pick = this.picks.find(uid);
    if (!pick || !pick.img || !inScan(pick) || (pick.weight !== 0) === on) return;
    const number = this.picks.numberOf(uid);
    this.picks.set(
        `pick ${number} ${on ? 'counts' : 'only checks'}`, uid,
        {weight: on ? pick.onWeight ?? 1 : 0, onWeight: pick.weight});
    this.on.changed();
  }

  toggle() {
    const pick = this.picks.find(this.selected);
    if (pick) this.enable(pick.uid, pick.weight === 0);
  }

  // Escape: the first of these that there is.
  back() {
    if (this.#drag) return;
    if (this.tried?.message) {
      this.forgetTried();
    } else if (this.half && this.half.uid === this.selected) {
      this.remove(this.selected);
    } else {
      this.selected = null;
      this.cross = {photo: null, scan: null};
    }
    this.on.changed();
  }

  undo(redo) {
    this.forgetTried();
    const step = redo ? this.picks.redo() : this.picks.undo();
    if (!step) return;
    say(`${redo ? 'Again' : 'Undone'}: ${step.label}`, {seconds: 2.5});
    const pick = this.picks.find(step.uid);
    if (pick?.img && pick.image_name !== this.photo?.name) this.on.choosePhoto(pick.image_name);
    this.#bringAlong();
    this.selected = pick ? step.uid : null;
    this.on.changed();
  }

  // Arrow keys: the selected point of the side by dx, dy pixels, else the crosshair: by more where
  // the picture is small, ten CSS pixels for each, so that it is quick.
  move(side, dx, dy, view) {
    const pick = this.picks.find(this.selected);
    const place = this.placeOf(pick, side);
    const width = view.pictureWidth, height = view.pictureHeight;
    if (!place) {
      const from = this.crossOf(side, view);
      const step = Math.max(1, 10 / view.scale);
      this.cross[side] =
          [clamp(from[0] + dx * step, 0, width), clamp(from[1] + dy * step, 0, height)];
      this.on.changed();
      return;
    }
    const to = [clamp(place[0] + dx, 0, width), clamp(place[1] + dy, 0, height)];
    if (side === 'scan' && pick.fixed) {
      say(kFixed);
    } else if (side === 'scan') {
      this.#tryPlace(pick.uid, to, `nudge scan ${pick.uid}`);
    } else {
      this.picks.set(
          `pick ${this.picks.numberOf(pick.uid)} moved`, pick.uid, {img: to},
          `nudge photo ${pick.uid}`);
    }
    this.on.changed();
  }

  // The crosshair begins where the missing half is expected, else in the middle of what is shown.
  crossOf(side, view) {
    return this.cross[side] ?? this.ghostOf(this.half, side) ?? [...view.centre];
  }

  // The selected point of the photo, or the one that is being clicked, onto the corner within reach.
  async toCorner(view) {
    const pick = this.picks.find(this.selected);
    const {photo} = this;
    if (!pick?.img || pick.image_name !== photo?.name) {
      say('Select a point in the photo: it is moved onto the corner that it was meant for');
      return;
    }
    const reach = clamp(kCornerReach / view.scale, 3, 25);
    let answer;
    try {
      answer = await api.corner(photo.id, pick.img, reach);
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      say(error.message, {urgent: true});
      return;
    }
    // Moved or removed meanwhile.
    if (this.picks.find(pick.uid)?.img !== pick.img) return;
    const number = this.picks.numberOf(pick.uid);
    if (!answer.img) {
      say(`There is no corner within ${reach.toFixed(0)} pixels of pick ${number}`);
      return;
    }
    this.picks.set(`pick ${number} moved onto the corner`, pick.uid, {img: answer.img});
    const distance = Math.hypot(answer.img[0] - pick.img[0], answer.img[1] - pick.img[1]);
    say(`Pick ${number} moved onto the corner, by ${distance.toFixed(1)} pixels`);
    this.on.changed();
  }

  dragStart(side, uid) {
    this.forgetTried();
    this.selected = uid;
    if (side === 'scan' && this.picks.find(uid)?.fixed) {
      say(kFixed);
      return;
    }
    this.#drag = {side, uid, last: 0, busy: false, next: null};
    this.picks.begin(`pick ${this.picks.numberOf(uid)} moved`, uid);
  }

  drag(side, uid, img, view) {
    const drag = this.#drag;
    if (!drag) return;
    const to = [clamp(img[0], 0, view.pictureWidth), clamp(img[1], 0, view.pictureHeight)];
    if (side === 'photo') {
      this.picks.live(uid, {img: to});
    } else {
      this.tried = {uid, place: to, scan: this.scan.id, message: '', snap: null};
      drag.next = to;
      this.#dragScan(drag);
    }
    this.on.changed();
  }

  // While dragging: places that can be picked go on to the solution, others only say why not.
  async #dragScan(drag) {
    if (drag.busy || !drag.next) return;
    drag.busy = true;
    const wait = drag.last + kLiveInterval - Date.now();
    if (wait > 0) await new Promise((done) => setTimeout(done, wait));
    const place = drag.next;
    drag.next = null;
    drag.last = Date.now();
    const scan = this.scan.id;
    const answer = this.#drag === drag ? await this.#ask(scan, place) : null;
    drag.busy = false;
    if (this.#drag !== drag) return;
    if (answer.ok) {
      this.picks.live(drag.uid, {scan: {id: scan, x: place[0], y: place[1]}, point: null});
    }
    drag.message = answer.ok ? '' : answer.message;
    this.on.changed();
    this.#dragScan(drag);
  }

  get dragMessage() {
    return this.#drag?.message ?? '';
  }
  get dragging() {
    return this.#drag !== null;
  }

  async drop(side, uid, img, view) {
    const drag = this.#drag;
    if (!drag) return;
    const to = [clamp(img[0], 0, view.pictureWidth), clamp(img[1], 0, view.pictureHeight)];
    this.#drag = null;
    if (side === 'photo') {
      this.picks.live(uid, {img: to});
      this.picks.keep();
      this.on.changed();
      return;
    }
    // Where it was dropped decides; a place that cannot be picked leaves the pick where it was.
    this.picks.drop();
    await this.#tryPlace(uid, to);
  }

  dragCancel() {
    this.#drag = null;
    this.forgetTried();
    this.picks.drop();
    this.on.changed();
  }
}
