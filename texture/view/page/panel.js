// Everything on the page that is not the picture: buttons, lists, keys, sentences.

import {Vector3} from 'three';

import {getImageUrl} from './api.js';
import {coordinates, count, length, setUnit, unit} from './format.js';
import {showLegend} from './legend.js';
import {extentOf, makePlan, planRotation} from './plan.js';
import {makeSection} from './section.js';
import {Shifts} from './shifts.js';
import {kModes, needsEvidence} from './surface.js';

const $ = (id) => document.getElementById(id);
const radios = (name) => [...document.querySelectorAll(`input[name="${name}"]`)];
const check = (name, value) => {
  for (const radio of radios(name)) radio.checked = radio.value === value;
};

const kUnitKey = 'roomtex-view unit';
function keptUnit() {
  try {
    return localStorage.getItem(kUnitKey) ?? 'm';
  } catch {
    return 'm';
  }
}

function make(tag, {text, className, ...properties} = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (className) element.className = className;
  Object.assign(element, properties);
  element.append(...children);
  return element;
}

// Instead of the picture.
export function showFailure(sentence) {
  $('loading').hidden = true;
  const box = make('div', {className: 'failed', text: sentence});
  box.setAttribute('role', 'alert');
  $('stage').append(box);
}

export class Panel {
  constructor(viewer) {
    this.viewer = viewer;
    this.options = [];
    this.shifts = new Shifts([]);
    this.#bind();
    this.#bindKeys();
  }

  fail(sentence) {
    if ([...$('errors').children].some((box) => box.dataset.sentence === sentence)) return;
    const close = make('button', {text: '×', type: 'button', title: 'Close'});
    close.setAttribute('aria-label', 'Close');
    const box = make('div', {}, make('span', {text: sentence}), close);
    box.dataset.sentence = sentence;
    close.addEventListener('click', () => box.remove());
    $('errors').append(box);
  }
  hint(sentence) {
    $('hint').textContent = sentence;
    clearTimeout(this.hintTimer);
    if (!this.viewer.measuring) {
      this.hintTimer = setTimeout(() => {
        $('hint').textContent = '';
      }, 4000);
    }
  }

  // --- controls -------------------------------------------------------------------------------

  #bind() {
    const {viewer} = this;
    const onRadio = (name, set) => {
      for (const radio of radios(name)) radio.addEventListener('change', () => set(radio.value));
    };
    onRadio('mode', (mode) => viewer.navigation.setMode(mode));
    onRadio('surface', (mode) => viewer.setMode(mode));
    onRadio('background', (name) => viewer.setBackground(name));
    const onClick = (id, act) => $(id).addEventListener('click', act);
    onClick('home', () => viewer.navigation.home());
    onClick('measure', () => viewer.setMeasuring(!viewer.measuring));
    onClick('keys', () => $('help').showModal());
    onClick('previous', () => viewer.stepCamera(-1));
    onClick('next', () => viewer.stepCamera(1));
    onClick('leave', () => viewer.leaveCamera());
    onClick('clear-measures', () => viewer.measures.clear());
    onClick(
        'copy-measures',
        () => this.#copy(viewer.measures.csv(), 'The distances are in the clipboard.'));
    onClick('save-picture', () => this.savePicture());
    onClick(
        'copy-link',
        () => this.#copy(location.href, 'The address of this view is in the clipboard.'));
    const onInput = (id, set) => $(id).addEventListener('input', (event) => set(event.target));
    const setBothSides = () => {
      if (!viewer.postpone(setBothSides)) viewer.room.setBothSides($('both-sides').checked);
    };
    const setSupplement = () => {
      if (viewer.postpone(setSupplement)) return;
      viewer.room.setSupplement($('show-supplement').checked, $('mark-supplement').checked);
    };
    onInput('both-sides', setBothSides);
    onInput('show-supplement', setSupplement);
    onInput('mark-supplement', setSupplement);
    onInput('opacity', ({value}) => viewer.cameras.setOpacity(Number(value)));
    for (const side of ['top', 'bottom', 'left', 'right', 'front', 'back']) {
      onInput(side, () => this.#setCut());
    }
    onRadio('unit', (name) => this.#setUnit(name));
    onClick('save-plan', () => this.savePlan());
    onClick('section', () => viewer.setSectioning(!viewer.sectioning));
    onClick('turn-section', () => viewer.section.turn());
    onClick('clear-section', () => viewer.section.clear());
    onClick('save-section', () => this.saveSection());
    this.#setUnit(keptUnit());
    onInput('eye', ({value}) => {
      viewer.navigation.setEyeHeight(Number(value));
      this.showEye();
    });
    onInput('speed', ({value}) => {
      viewer.navigation.speed = Number(value);
      $('speed-value').textContent = `${Number(value).toFixed(1)} m/s`;
    });
    onInput('show-cameras', ({checked}) => viewer.cameras.setVisible(checked));
    onInput('show-pictures', ({checked}) => viewer.cameras.setPictures(checked));
    onInput('show-points', ({checked}) => this.#showPoints(checked));
    onInput('camera-size', ({value}) => this.#setCameraSize(Number(value)));
    $('help').addEventListener('click', (event) => {
      if (event.target === $('help')) $('help').close();
    });
  }
  async #copy(text, sentence) {
    try {
      await navigator.clipboard.writeText(text);
      this.hint(sentence);
    } catch {
      this.fail('The browser does not let this page use the clipboard.');
    }
  }
  async #showPoints(on) {
    try {
      await this.viewer.cameras.setPointsVisible(on);
    } catch (error) {
      this.fail(error.message);
    }
  }
  #setCameraSize(size) {
    this.viewer.cameras.setSize(size);
    $('camera-size-value').textContent = `${Math.round(100 * size)} cm`;
  }
  // The sliders run from floor to ceiling and from wall to wall.
  #setCut() {
    const {viewer} = this;
    if (viewer.postpone(() => this.#setCut())) return;
    const {min, max} = viewer.navigation.bounds;
    const floor = viewer.floorHeight();
    const read = (id, off, from, to, zero) => {
      const share = Number($(id).value), place = from + share * (to - from);
      const shown = Math.abs(place - zero) < 0.005 ? 0 : (place - zero) / unit().metres;
      $(`${id}-value`).textContent =
          share === off ? 'off' : `${shown.toFixed(2)} ${unit().name}`;
      return share !== off ? place : off === 0 ? -1e9 : 1e9;
    };
    const rotation = planRotation(viewer.wallHeading());
    const axes = [new Vector3(0, 1, 0)];
    for (const axis of [new Vector3(1, 0, 0), new Vector3(0, 1, 0)]) {
      axes.push(axis.applyQuaternion(rotation));
    }
    const sides = extentOf(viewer.room.samplePoints(), rotation.clone().invert());
    const {left, right, bottom: front, top: back} = sides;
    const low = [
      read('bottom', 0, min.y, max.y, floor), read('left', 0, left, right, left),
      read('front', 0, front, back, front)
    ];
    const high = [
      read('top', 1, min.y, max.y, floor), read('right', 1, left, right, left),
      read('back', 1, front, back, front)
    ];
    viewer.room.setCut({axes, low, high});
  }
  #setUnit(name) {
    setUnit(name);
    check('unit', unit().name);
    try {
      localStorage.setItem(kUnitKey, unit().name);
    } catch {
      // Not kept, then.
    }
    if (!this.viewer.measures) return;  // not built yet
    this.#setCut();
    this.showMeasures();
    this.showSection();
    this.viewer.invalidate();
  }
  async savePlan() {
    await this.#saveDrawing('plan', (step, progress) => makePlan(this.viewer, step, progress));
  }
  async saveSection() {
    const depth = Number($('section-depth').value);
    await this.#saveDrawing(
        'section', (step, progress) => makeSection(this.viewer, depth, step, progress));
  }
  // what: plan or section. draw: with metres per pixel, and what takes the share that is done.
  async #saveDrawing(what, draw) {
    const {viewer} = this, button = $(`save-${what}`);
    if (this.#isDrawing()) return;
    viewer.drawing = [];
    button.disabled = true;
    try {
      // From everywhere at once nothing is near: the blended colours.
      if (viewer.mode === 'view-dependent') await viewer.room.setMode('colour', null);
      const {blob, world, dxf, width, height} =
          await draw(Number($('plan-step').value) / 1000, (share) => {
            this.hint(`Drawing the ${what}, ${Math.round(100 * share)} %`);
          });
      this.#download(blob, `-${what}.png`);
      this.#download(new Blob([world], {type: 'text/plain'}), `-${what}.pgw`);
      if (dxf) this.#download(new Blob([dxf], {type: 'image/vnd.dxf'}), `-${what}.dxf`);
      this.hint(`The ${what} is saved, ${width} x ${height} pixels.`);
    } catch (error) {
      this.fail(error.message);
    }
    await viewer.room.setMode(viewer.mode, viewer.evidence)
        .catch((error) => this.fail(error.message));
    button.disabled = false;
    viewer.endDrawing();
  }
  #isDrawing() {
    if (this.viewer.drawing) this.hint('One moment: a plan or section is being drawn.');
    return this.viewer.drawing !== null;
  }
  #download(blob, ending) {
    const link = make('a', {
      href: URL.createObjectURL(blob),
      download: `${this.viewer.data.name.replace(/\.[^.]*$/, '')}${ending}`
    });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
  async savePicture() {
    const {viewer} = this;
    if (this.#isDrawing()) return;
    const scale = Number(radios('scale').find((radio) => radio.checked).value);
    const blob = await viewer.picture(scale);
    if (!blob) return this.fail('The picture is too large for this browser.');
    this.#download(blob, '-view.png');
    this.hint('The picture is saved.');
  }

  // --- what is shown --------------------------------------------------------------------------

  describe() {
    const {data} = this.viewer;
    document.title = `${data.name} – roomtex-view`;
    $('name').textContent = data.name;
    $('facts').textContent =
        `${count(data.num_vertices)} points` +
        (data.num_triangles > 0 ? `, ${count(data.num_triangles)} triangles` : '') +
        (data.num_cameras ? `, ${data.num_cameras} cameras` : '');
    $('supplement-controls').hidden = !data.chunks.some(({supplement}) => supplement);
    for (const warning of data.warnings) $('warnings').append(make('p', {text: warning}));
  }
  showProgress() {
    const {room} = this.viewer;
    const first = room.loaded && room.pages.every((page) => page.texture || page.complete);
    $('loading').classList.toggle('quiet', first);
    $('loading').hidden = first && room.settled;
    if (!first) {
      $('loading-bar').value = room.progress;
      $('loading-text').textContent = 'Loading the room …';
    } else if (!room.settled) {
      $('loading-text').textContent = 'Details';
      $('loading-bar').removeAttribute('value');
    }
  }
  showMode() {
    const {mode, evidence} = this.viewer;
    check('surface', mode);
    showLegend($('legend'), mode, evidence);
  }
  showEvidence() {
    const {evidence} = this.viewer;
    for (const radio of radios('surface')) {
      if (needsEvidence(radio.value)) radio.disabled = !evidence.available;
    }
    $('no-evidence').hidden = evidence.available;
    $('no-evidence').textContent = evidence.reason;
  }
  // reason: why there is no view-dependent colour; "" = there is.
  showPhotoColour(reason) {
    radios('surface').find(({value}) => value === 'view-dependent').disabled = reason !== '';
    $('no-photo-colour').hidden = reason === '';
    $('no-photo-colour').textContent = reason;
  }
  showMovement() {
    const {mode} = this.viewer.navigation;
    check('mode', mode);
    $('walk-section').hidden = mode !== 'walk';
  }
  showEye() {
    const {eyeHeight} = this.viewer.navigation;
    $('eye').value = eyeHeight;
    $('eye-value').textContent = `${eyeHeight.toFixed(2)} m`;
  }
  showMeasuring() {
    const {measuring} = this.viewer;
    $('measure').setAttribute('aria-pressed', measuring);
    $('stage').classList.toggle('measuring', measuring);
    $('crosshair').hidden = !measuring || !this.byKeys;
    this.hint(measuring ? 'Click the first point (or Enter for the one at the cross).' : '');
  }
  showSectioning() {
    const {sectioning, section} = this.viewer;
    $('section').setAttribute('aria-pressed', sectioning);
    $('stage').classList.toggle('measuring', sectioning || this.viewer.measuring);
    $('crosshair').hidden = !sectioning || !this.byKeys;
    clearTimeout(this.hintTimer);
    $('hint').textContent = !sectioning ? '' :
        section.ends.length === 1       ? 'Click where the line ends.' :
                                          'Click where the line of the cut begins; Esc ends.';
  }
  showSection() {
    const {section} = this.viewer;
    $('section-controls').hidden = !section.drawn;
    $('section-facts').textContent = section.drawn ? length(section.length) : '';
  }
  showStanding(camera) {
    this.shifts.show(camera);
    $('standing').hidden = !camera;
    if (camera) $('standing-name').textContent = camera.name;
    for (const option of this.options) {
      option.setAttribute('aria-selected', option.camera === camera);
      if (option.camera !== camera) continue;
      this.#activate(option);
    }
    const without = camera !== null && !camera.photo;
    $('opacity').disabled = without;
    if (without) this.hint('The file of this photo is not there.');
  }

  showCameras() {
    const {list, size} = this.viewer.cameras;
    $('no-cameras').hidden = list.length > 0;
    $('camera-controls').hidden = list.length === 0;
    if (list.length === 0) return;
    $('camera-size').value = size;
    $('camera-size').max = Math.max(1, 2 * size);
    this.#setCameraSize(size);
    this.shifts = new Shifts(list);
    // Small photos come once they are in view.
    const seen = new IntersectionObserver((entries) => {
      for (const {isIntersecting, target} of entries) {
        if (!isIntersecting) continue;
        seen.unobserve(target);
        this.#showSmall(target, target.parentElement.camera);
      }
    });
    this.options = list.map((camera) => {
      const image = make('img', {alt: '', width: 54, height: 36});
      if (camera.photo) seen.observe(image);
      const option = make(
          'li', {id: `camera-${camera.id}`, camera}, image,
          make('span', {text: camera.name, title: camera.name}), ...this.shifts.label(camera));
      option.setAttribute('role', 'option');
      option.setAttribute('aria-selected', 'false');
      option.addEventListener('click', () => this.viewer.standIn(camera));
      option.addEventListener('pointerenter', () => this.viewer.cameras.setHovered(camera));
      option.addEventListener('pointerleave', () => this.viewer.cameras.setHovered(null));
      return option;
    });
    $('camera-list').replaceChildren(...this.options);
    $('camera-list').addEventListener('keydown', (event) => this.#listKey(event));
  }
  async #showSmall(image, camera) {
    image.addEventListener('load', () => URL.revokeObjectURL(image.src), {once: true});
    try {
      image.src = await getImageUrl(`photo?id=${camera.id}&max=128`);
    } catch (error) {
      this.fail(error.message);
    }
  }
  #activate(option) {
    for (const other of this.options) other.classList.toggle('active', other === option);
    $('camera-list').setAttribute('aria-activedescendant', option.id);
    option.scrollIntoView({block: 'nearest'});
  }
  #listKey(event) {
    const now = this.options.findIndex((option) => option.classList.contains('active'));
    const last = this.options.length - 1;
    const to = {
      ArrowDown: Math.min(now + 1, last),
      ArrowUp: Math.max(now - 1, 0),
      Home: 0,
      End: last
    }[event.key];
    if (to !== undefined) {
      this.#activate(this.options[to]);
    } else if ((event.key === 'Enter' || event.key === ' ') && now >= 0) {
      const {camera} = this.options[now];
      // Standing there already, Space fades the photo as it does everywhere.
      if (event.key === ' ' && camera === this.viewer.target) return;
      this.viewer.standIn(camera);
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }

  showMeasures() {
    const {list} = this.viewer.measures;
    $('no-measures').hidden = list.length > 0;
    $('copy-measures').disabled = $('clear-measures').disabled = list.length === 0;
    $('measures').replaceChildren(...list.map((m, i) => {
      const remove = make('button', {text: 'Delete', type: 'button'});
      remove.setAttribute('aria-label', `Delete distance ${i + 1}, ${length(m.distance)}`);
      remove.addEventListener('click', () => this.viewer.measures.remove(i));
      const rows = [
        ['height', length(m.height)], ['level', length(m.horizontal)],
        ['dx dy dz', `${coordinates(m.difference)} m`], ['from', `${coordinates(m.from)} m`],
        ['to', `${coordinates(m.to)} m`]
      ];
      const details = make('dl');
      for (const [term, text] of rows) details.append(make('dt', {text: term}), make('dd', {text}));
      return make(
          'li', {},
          make('div', {className: 'head'}, make('strong', {text: length(m.distance)}), remove),
          details);
    }));
  }

  // --- keys -----------------------------------------------------------------------------------

  #bindKeys() {
    addEventListener('keydown', (event) => this.#key(event));
    addEventListener('pointerdown', () => {
      this.byKeys = false;
      $('crosshair').hidden = true;
    });
  }
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || $('help').open) return;
    const {viewer} = this, on = event.target;
    if (on.matches?.('select') && event.key !== 'Escape') return;  // its own keys
    const inSlider = on.matches?.('input[type="range"], input[type="radio"]');
    const onButton = on.matches?.('button, input, a, summary, [role="listbox"]');
    const toggle = (id) => $(id).click();
    const acts = {
      o: () => viewer.navigation.setMode('orbit'),
      g: () => viewer.navigation.setMode('walk'),
      t: () => viewer.navigation.setMode('top'),
      h: () => viewer.navigation.home(),
      m: () => {
        this.byKeys = true;
        viewer.setMeasuring(!viewer.measuring);
      },
      v: () => {
        this.byKeys = true;
        viewer.setSectioning(!viewer.sectioning);
      },
      f: () => toggle('show-cameras'),
      p: () => toggle('show-points'),
      j: () => toggle('show-supplement'),
      ',': () => viewer.stepCamera(-1),
      '.': () => viewer.stepCamera(1),
      l: () => radios('background').find((radio) => !radio.checked).click(),
      x: () => this.savePicture(),
      '?': () => $('help').showModal(),
      '[': () => this.#fade(-0.1),
      ']': () => this.#fade(0.1),
      Escape: () => this.#escape(),
    };
    if (!onButton || on === $('camera-list')) {
      acts[' '] = () => this.#fade(viewer.cameras.opacity > 0 ? -1 : 1);
    }
    if (!onButton) {
      acts.Enter = () => {
        if (!viewer.measuring && !viewer.sectioning) return;
        this.byKeys = true;
        $('crosshair').hidden = false;
        const x = viewer.navigation.width / 2, y = viewer.navigation.height / 2;
        if (viewer.measuring) {
          viewer.measureAt(x, y);
        } else {
          viewer.sectionAt(x, y);
        }
      };
    }
    kModes.forEach((mode, i) => {
      acts[i + 1] = () => viewer.setMode(mode);
    });
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (act && !(event.repeat && !'[],.'.includes(event.key))) {
      act();
      event.preventDefault();
    } else if (!(inSlider && event.key.startsWith('Arrow')) && viewer.navigation.key(event)) {
      event.preventDefault();
    }
  }
  #fade(step) {
    if (!this.viewer.target) return;
    const opacity = Math.min(Math.max(this.viewer.cameras.opacity + step, 0), 1);
    $('opacity').value = opacity;
    this.viewer.cameras.setOpacity(opacity);
  }
  #escape() {
    const {viewer} = this;
    if (viewer.measuring) {
      if (!viewer.measures.cancel()) {
        viewer.setMeasuring(false);
      } else {
        this.hint('Click the first point; Esc ends.');
      }
    } else if (viewer.sectioning) {
      if (!viewer.section.cancel()) {
        viewer.setSectioning(false);
      } else {
        this.showSectioning();
      }
    } else if (viewer.target) {
      viewer.leaveCamera();
    }
  }
}
