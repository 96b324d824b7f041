// The picks of this page, their history, and their way to the server.
//
// The list here is what the user sees and changes at once; the server's answer (SESSION of
// align/pick/README.md) follows and brings all the numbers. One request is under way at a time and
// carries the whole list, so an answer never mixes with a later change. Entries of the list are
// never changed, only replaced: the history then costs nothing.

import {api, ServerError} from './api.js';

const kMinInterval = 80;   // milliseconds between two requests while something is dragged
const kRetryAfter = 1500;  // milliseconds
const kHistory = 500;      // changes that can be undone
const kKeptHistory = 50;   // of these after a reload

const sentFields = ({image_name, img, scan, point, weight, label}) =>
    ({image_name, img, scan, point, weight, label});

const kEmptyPick =
    {image_name: '', img: null, scan: null, point: null, weight: 1, label: ''};

// A target beside every scan has a point and no place in a picture.
export const inScan = (pick) => Boolean(pick.scan || pick.point);

// Of a target the server says where it is drawn in the scan: its point counts then.
function samePicks(theirs, ours) {
  const place = ({scan, point}, byPoint) => byPoint ? point : scan && [scan.id, scan.x, scan.y];
  const text = (picks) => JSON.stringify(picks.map(
      (pick, k) => [pick.image_name, pick.img, place(pick, !ours[k]?.scan), pick.weight,
                    pick.label]));
  return theirs.length === ours.length && text(theirs) === text(ours);
}

// Events: "change" (list or numbers), "sync" (state), "refused" (detail: the server's sentence).
export class Picks extends EventTarget {
  list = [];         // {uid, image_name, img, scan, point, weight, label}
  rows = new Map();  // uid -> the server's pick with its numbers
  session = null;
  // "saved", "saving", "unsaved" (the file could not be written), "gone" (no answer), "restarted",
  // "stale" (another tab was faster)
  state = 'saved';
  why = '';
  #nextUid = 1;
  #undo = [];
  #redo = [];
  #draft = null;  // {label, uid, before}: a drag under way
  #version = 0;   // of the list
  #accepted = 0;  // version that the server has
  #acceptedList = [];
  #sent = [];  // {version, list} whose answers have not come, the newest last
  #busy = false;
  #lastSent = 0;
  #timer = 0;
  #retry = 0;     // timer of the next question to a server that is gone
  #other = null;  // session of the faster tab
  #kept = '';     // where the history is kept

  // Takes the server's picks as they are; nothing to undo from here.
  adopt(session) {
    this.list = session.picks.map((pick) => ({uid: this.#nextUid++, ...sentFields(pick)}));
    this.#undo = [];
    this.#redo = [];
    this.#draft = null;
    this.#accepted = ++this.#version;
    this.#take(session, this.list);
  }

  // Keeps list and history over a reload of this page, and takes what it had before if the picks
  // are still the same. `name`: what the history belongs to.
  keepHistory(name) {
    this.#kept = `picks of ${name}`;
    try {
      const {list, undo, redo} = JSON.parse(sessionStorage.getItem(this.#kept) ?? '{}');
      if (!list || !samePicks(this.list, list)) return;
      // The pieces of the history share picks with the list by number, no longer as objects.
      this.#nextUid = 1 + Math.max(
          0, ...[list, ...[...undo, ...redo].flatMap(({before, after}) => [before, after])]
                 .flat().map(({uid}) => uid));
      this.list = list;
      this.#undo = undo;
      this.#redo = redo;
      this.#take(this.session, this.list);
    } catch {
      // No storage, or of another version: there is nothing to undo.
    }
  }
  #keepHistory() {
    if (!this.#kept) return;
    const [undo, redo] = [this.#undo, this.#redo].map((steps) => steps.slice(-kKeptHistory));
    try {
      sessionStorage.setItem(this.#kept, JSON.stringify({list: this.list, undo, redo}));
    } catch {
      sessionStorage.removeItem(this.#kept);
    }
  }

  // The same picks with more numbers.
  refresh(session) {
    if (session.revision !== this.session.revision || this.pending) return false;
    this.#take(session, this.list);
    return true;
  }

  find(uid) {
    return this.list.find((pick) => pick.uid === uid) ?? null;
  }
  numberOf(uid) {
    return this.list.findIndex((pick) => pick.uid === uid) + 1;
  }
  statusOf(pick) {
    if (!pick.img || !inScan(pick)) return 'half';
    if (pick.weight === 0) return 'off';
    const status = this.rows.get(pick.uid)?.status;
    return status && status !== 'half' && status !== 'off' ? status : 'waiting';
  }
  get pending() {
    return this.#version !== this.#accepted;
  }
  // Those that no file has: half finished, or targets that wait.
  get numUnfinished() {
    return this.list.filter((pick) => !pick.img || !inScan(pick)).length;
  }

  // Changes the list by fn(list) -> list. Changes with the same `merge` within a second are one
  // step of the history (a key held down).
  change(label, uid, fn, merge = '') {
    this.#drop();
    const before = this.list;
    this.list = fn(before);
    const last = this.#undo.at(-1);
    if (merge && last && last.merge === merge && Date.now() - last.time < 1000) {
      last.after = this.list;
      last.time = Date.now();
    } else {
      this.#push({label, uid, before, after: this.list, merge, time: Date.now()});
    }
    this.#changed();
  }

  add(label, fields) {
    const uid = this.#nextUid++;
    const pick = {uid, ...kEmptyPick, ...fields};
    this.change(label, uid, (list) => [...list, pick]);
    return uid;
  }

  // Several at once; the first one's uid.
  addAll(label, fieldsOfEach) {
    const first = this.#nextUid;
    const added = fieldsOfEach.map((fields) => ({uid: this.#nextUid++, ...kEmptyPick, ...fields}));
    this.change(label, first, (list) => [...list, ...added]);
    return first;
  }

  set(label, uid, fields, merge = '') {
    this.change(
        label, uid, (list) => list.map((pick) => pick.uid === uid ? {...pick, ...fields} : pick),
        merge);
  }

  // Changes picks by fn(pick) -> pick, also as the history has them: that is no step of it.
  follow(fn) {
    // Lists and picks that were the same stay the same.
    const mapped = new Map();
    const once = (key, map) => {
      if (!mapped.has(key)) mapped.set(key, map(key));
      return mapped.get(key);
    };
    const follow = (list) => once(list, () => list.map((pick) => once(pick, fn)));
    for (const step of [...this.#undo, ...this.#redo]) {
      step.before = follow(step.before);
      step.after = follow(step.after);
    }
    if (this.#draft) this.#draft.before = follow(this.#draft.before);
    this.#acceptedList = follow(this.#acceptedList);
    this.list = follow(this.list);
    this.#changed();
  }

  remove(label, uid) {
    this.change(label, uid, (list) => list.filter((pick) => pick.uid !== uid));
  }

  // A drag: begin, any number of live(), then keep() or drop().
  begin(label, uid) {
    this.#draft = {label, uid, before: this.list};
  }
  live(uid, fields) {
    this.list = this.list.map((pick) => pick.uid === uid ? {...pick, ...fields} : pick);
    this.#changed();
  }
  keep() {
    const draft = this.#draft;
    this.#draft = null;
    if (draft && draft.before !== this.list) {
      this.#push({...draft, after: this.list, merge: '', time: Date.now()});
    }
  }
  drop() {
    if (this.#drop()) this.#changed();
  }
  #drop() {
    const draft = this.#draft;
    this.#draft = null;
    if (!draft || draft.before === this.list) return false;
    this.list = draft.before;
    return true;
  }

  get undoLabel() {
    return this.#undo.at(-1)?.label ?? '';
  }
  get redoLabel() {
    return this.#redo.at(-1)?.label ?? '';
  }

  // The step that was undone ({label, uid}), or null.
  undo() {
    return this.#step(this.#undo, this.#redo, 'before');
  }
  redo() {
    return this.#step(this.#redo, this.#undo, 'after');
  }
  #step(from, to, side) {
    this.#drop();
    const step = from.pop();
    if (!step) return null;
    to.push(step);
    this.list = step[side];
    this.#changed();
    return step;
  }
  #push(step) {
    this.#undo.push(step);
    if (this.#undo.length > kHistory) this.#undo.shift();
    this.#redo = [];
  }

  #changed() {
    ++this.#version;
    if (this.state === 'saved' || this.state === 'unsaved') this.#setState('saving');
    this.dispatchEvent(new Event('change'));
    this.#schedule();
  }

  #setState(state, why = '') {
    this.state = state;
    this.why = why;
    this.dispatchEvent(new Event('sync'));
  }

  #schedule() {
    if (this.#busy || this.#timer || this.state === 'stale' || !this.pending) return;
    const wait = this.#draft ? Math.max(0, this.#lastSent + kMinInterval - Date.now()) : 0;
    if (wait === 0) {
      this.#send();
      return;
    }
    this.#timer = setTimeout(() => {
      this.#timer = 0;
      this.#schedule();
    }, wait);
  }

  async #send() {
    this.#busy = true;
    this.#lastSent = Date.now();
    const version = this.#version;
    const list = this.list;
    this.#sent.push({version, list});
    try {
      const session = await api.putPicks(this.session.revision, list.map(sentFields));
      this.#accepted = version;
      this.#busy = false;
      this.#take(session, list);
      this.#schedule();
    } catch (error) {
      this.#busy = false;
      if (!(error instanceof ServerError)) throw error;
      if (error.kind === 'refused') {
        await this.#refused(error);
      } else {
        this.#gone(error);
      }
    }
  }

  // The numbers for `list`, which may be older than the one that is shown.
  #take(session, list) {
    this.session = session;
    this.#acceptedList = list;
    this.#sent = [];
    this.rows = new Map(list.map((pick, index) => [pick.uid, session.picks[index]]));
    // The point of a place comes from the server.
    this.list = this.list.map((pick) => {
      const sent = list.find((one) => one.uid === pick.uid);
      const row = this.rows.get(pick.uid);
      if (!row || !sent || sent.scan !== pick.scan || !row.point) return pick;
      // A target comes with its point; where that is drawn the server says.
      if (pick.point) return pick.scan || !row.scan ? pick : {...pick, scan: row.scan};
      return {...pick, point: row.point};
    });
    if (this.pending) {
      this.#setState('saving');
    } else if (session.saved) {
      this.#setState('saved');
    } else {
      this.#setState('unsaved', session.save_error);
    }
    if (!this.pending) this.#keepHistory();
    this.dispatchEvent(new Event('change'));
  }

  // The server said no: either another tab changed the picks since, or there is something wrong
  // with what was sent; then the last list that it took is back.
  async #refused(error) {
    let now;
    try {
      now = (await api.state()).session;
    } catch (failure) {
      this.#gone(failure);
      return;
    }
    if (now.revision !== this.session.revision) {
      this.#differs(now);
      return;
    }
    while (this.#undo.length > 0 && this.#undo.at(-1).after === this.list) {
      if (this.#undo.pop().before === this.#acceptedList) break;
    }
    this.#sent = [];
    this.list = this.#acceptedList;
    this.#draft = null;
    this.#accepted = this.#version;
    this.#setState(this.session.saved ? 'saved' : 'unsaved', this.session.save_error);
    this.dispatchEvent(new Event('change'));
    this.dispatchEvent(new CustomEvent('refused', {detail: error.message}));
  }

  // The server has another revision than this page. If it is something that was sent, only the
  // answer was lost, and what was changed since is sent now.
  #differs(now) {
    const newest = {version: this.#version, list: this.list};
    const taken = [newest, ...[...this.#sent].reverse()].find(({list}) => samePicks(now.picks, list));
    if (taken) {
      this.#accepted = taken.version;
      this.#take(now, taken.list);
      this.#schedule();
      return;
    }
    this.#other = now;
    this.#setState('stale', 'the picks were changed in another tab');
  }

  #gone(error) {
    this.#setState(error.kind === 'restarted' ? 'restarted' : 'gone', error.message);
    clearTimeout(this.#retry);
    this.#retry = setTimeout(() => this.check(), kRetryAfter);
  }

  // This page is about to be replaced by that of another server.
  left = false;
  leave() {
    this.left = true;
    clearTimeout(this.#retry);
  }
  // It did not come.
  stay() {
    this.left = false;
    this.check();
  }

  // Asks how the picks stand at the server: after it was gone, and when this page comes back to the
  // front.
  async check() {
    if (this.#busy || this.left || this.state === 'stale') return;
    this.#busy = true;
    let now;
    try {
      now = (await api.state()).session;
    } catch (error) {
      this.#busy = false;
      this.#gone(error instanceof ServerError ? error : new ServerError('gone', String(error)));
      return;
    }
    this.#busy = false;
    if (now.revision !== this.session.revision) {
      this.#differs(now);
      return;
    }
    const solved = now.solution_number !== this.session.solution_number;  // by another tab's search
    if ((solved || (this.state === 'unsaved' && now.saved)) && !this.pending) {
      this.#take(now, this.list);
    } else if (this.state === 'gone' || this.state === 'restarted') {
      this.#setState(
          this.pending           ? 'saving' :
              this.session.saved ? 'saved' :
                                   'unsaved',
          this.session.save_error);
    }
    this.#schedule();  // what was changed while this was asked
  }

  // A stale page: takes the picks of the other tab, or puts its own over them.
  takeOther() {
    this.state = 'saved';
    this.adopt(this.#other);
    this.#other = null;
  }
  keepOwn() {
    this.session = {...this.session, revision: this.#other.revision};
    this.#other = null;
    ++this.#version;
    this.#setState('saving');
    this.#schedule();
  }
}
