// roomtex-pick's page as its user has it: mouse, keys, what can be read. Nothing reaches into the
// page's scripts; where a pixel is on the screen the pane says itself (data-view).

import assert from 'node:assert/strict';
import {existsSync, readFileSync, writeFileSync} from 'node:fs';
import path from 'node:path';

import {makeFolder, openPage, screenshot, serve} from './browser.mjs';

// Waits until `probe` gives something true and returns it; no fixed times anywhere.
export async function until(probe, what, seconds = 30) {
  const end = Date.now() + 1000 * seconds;
  for (;;) {
    const result = await probe();
    if (result) return result;
    if (Date.now() > end) throw new Error(`waited ${seconds} s for: ${what}`);
    await new Promise((done) => setTimeout(done, 20));
  }
}

// Picks of a file: [{image_name, img, point, weight, label}].
export function readPicks(file) {
  if (!existsSync(file)) return [];
  const lines = readFileSync(file, 'utf8').split('\n').filter((line) => line && line[0] !== '#');
  assert.match(lines[0], /^image_name,x,y,scan_x,scan_y,scan_z(,weight)?(,label)?$/);
  const weighted = lines[0].includes(',weight');
  return lines.slice(1).map((line) => {
    const fields = line.split(',');
    const [x, y, px, py, pz] = fields.slice(1, 6).map(Number);
    const weight = weighted ? Number(fields[6]) : 1;
    const label = fields[weighted ? 7 : 6] ?? '';
    return {image_name: fields[0], img: [x, y], point: [px, py, pz], weight, label};
  });
}

export function distance(a, b) {
  return Math.hypot(...a.map((value, i) => value - b[i]));
}

// Of the capture that browser_capture has made.
export function capture(...parts) {
  const folder = process.env.ROOMTEX_CAPTURE;
  if (!folder) throw new Error('ROOMTEX_CAPTURE is not set: run these tests by ctest');
  return path.join(folder, ...parts);
}

// Starts roomtex-pick on it. models: none = on its photos alone; ['first', 'second'] = its photos in
// two models. scan: the first one.
export function servePicks(
    picksPath, more = [], port = 0, models = ['sparse'], scan = capture('capture', 'scan.rtpi')) {
  return serve('roomtex-pick', [
    ...models.flatMap((model) => ['--input_path', capture(model)]),
    '--image_path',
    capture('capture', 'photos'),
    '--scan_path',
    scan,
    '--output_path',
    picksPath,
    '--port',
    String(port),
    ...more,
  ]);
}

export class PickPage {
  static async open(browser, server, picksPath, size = {}) {
    const {page, errors} = await openPage(browser, server.url, size);
    await page.waitForSelector('body[data-ready]');
    const result = new PickPage();
    Object.assign(result, {page, errors, picksPath, url: server.url});
    await result.view('photo');
    await result.view('scan');
    return result;
  }

  // CSS pixels of the window per pixel and where things are: {scale, aspect, centre, box}.
  async view(side) {
    const {text, box} = await until(() => this.page.evaluate((id) => {
      const pane = document.getElementById(id);
      const {x, y, width, height} = pane.getBoundingClientRect();
      const shown = pane.getAttribute('data-view');
      return shown && {text: shown, box: {x, y, width, height}};
    }, `${side}-pane`), `${side} is drawn`);
    const [scale, aspect, x, y] = text.split(' ').map(Number);
    return {scale, aspect, centre: [x, y], box, text};
  }

  async toScreen(side, img) {
    const {scale, aspect, centre, box} = await this.view(side);
    return [
      box.x + box.width / 2 + (img[0] - centre[0]) * scale,
      box.y + box.height / 2 + (img[1] - centre[1]) * scale * aspect,
    ];
  }

  // By the wheel, from the whole picture; so far that a CSS pixel is less than a quarter of a
  // pixel. What is under the mouse stays there.
  async zoomTo(side, img, scale = 5) {
    const button = side === 'photo' ? '#photo-whole' : '#scan-whole';
    await this.page.click(button);
    await this.redrawn();
    await this.page.mouse.move(...await this.toScreen(side, img));
    let view = await this.view(side);
    for (let step = 0; view.scale < scale; ++step) {
      assert.ok(step < 40, 'the wheel does not zoom');
      await this.page.mouse.wheel(0, -400);
      view = await until(async () => {
        const now = await this.view(side);
        return now.text !== view.text && now;
      }, 'the wheel zooms');
    }
  }

  // Two frames: what was changed is drawn.
  redrawn() {
    return this.page.evaluate(
        () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  }

  async click(side, img) {
    await this.zoomTo(side, img);
    await this.page.mouse.click(...await this.toScreen(side, img));
  }

  // Presses on one place of a side and lets go on another; both must be in view.
  async drag(side, from, to, onTheWay = async () => {}) {
    await this.page.mouse.move(...await this.toScreen(side, from));
    await this.page.mouse.down();
    const [x, y] = await this.toScreen(side, to);
    await this.page.mouse.move(x, y, {steps: 12});
    await onTheWay();
    await this.page.mouse.up();
  }

  // Both halves of a place of places.json; waits until it is in the table and in the file.
  async pick(place) {
    const before = (await this.rows()).length;
    await this.click('photo', place.img);
    await this.rowsAre(before + 1);
    await this.click('scan', place.scan);
    await this.rowIs(before, (row) => row.status !== 'half', 'completed');
    await this.saved();
  }

  // The table as it is read.
  rows() {
    return this.page.locator('#rows tr').evaluateAll((lines) => lines.map((line) => {
      const cells = [...line.children].map((cell) => cell.textContent.trim());
      const value = (text) => text === '–' ? null : Number(text);
      return {
        number: Number(cells[0]),
        label: line.querySelector('.label').value,
        photo: cells[2],
        px: value(cells[3]),
        mm: value(cells[4]),
        leftOut: value(cells[5]),
        state: cells[6],
        status: line.dataset.status,
        selected: line.hasAttribute('data-selected'),
        on: line.querySelector('input[type=checkbox]').checked,
      };
    }));
  }

  rowsAre(count) {
    return until(async () => (await this.rows()).length === count, `${count} rows`);
  }

  rowIs(index, test, what) {
    return until(async () => {
      const row = (await this.rows())[index];
      return row && test(row) ? row : null;
    }, `pick ${index + 1}: ${what}`);
  }

  // Presses a key, again each second, until `probe` gives something true: a key that comes before the
  // page has what it acts on does nothing.
  async pressUntil(key, probe, what) {
    let pressed = 0;
    return until(async () => {
      const result = await probe();
      if (!result && Date.now() - pressed > 1000) {
        await this.page.keyboard.press(key);
        pressed = Date.now();
      }
      return result;
    }, what);
  }

  async saved() {
    await until(
        async () => await this.page.getAttribute('#save', 'data-state') === 'saved',
        'the picks are saved');
  }

  file() {
    return readPicks(this.picksPath);
  }

  text(selector) {
    return this.page.locator(selector).innerText();
  }

  // The server's own words: what the page draws but does not write.
  async session() {
    return (await (await fetch(`${this.url}state`)).json()).session;
  }

  async close() {
    await this.page.close();
  }
}

// The colours of the pane's canvas at places of its picture: [[r, g, b]...].
export async function colorsAt(page, side, list) {
  const points = [];
  const {box} = await page.view(side);
  for (const img of list) {
    const [x, y] = await page.toScreen(side, img);
    points.push([Math.floor(x - box.x), Math.floor(y - box.y)]);
  }
  return page.page.evaluate(([id, where]) => {
    const context = document.querySelector(`#${id}-pane canvas`).getContext('2d');
    return where.map(([x, y]) => [...context.getImageData(x, y, 1, 1).data].slice(0, 3));
  }, [side, points]);
}

// Runs `body` on a fresh roomtex-pick and its page; nothing may go wrong on the page meanwhile but
// what `allowed` names. picksFile: what the picks file holds before; more: options of the command;
// models, scan: as servePicks() has them.
export async function onPage(
    browser, body, {image_name, picksFile = '', allowed = [], more = [], models, scan}) {
  const folder = makeFolder();
  const picksPath = folder.path('picks.csv');
  if (picksFile) writeFileSync(picksPath, picksFile);
  const server = await servePicks(picksPath, ['--image_name', image_name, ...more], 0, models, scan);
  // Small: without a graphics processor the time goes into pixels.
  const page = await PickPage.open(browser, server, picksPath, {width: 1280, height: 720});
  try {
    await body(page, {folder, server, picksPath});
    const unexpected = page.errors().filter((one) => !allowed.some((known) => known.test(one)));
    assert.deepEqual(unexpected, []);
  } catch (error) {
    await screenshot(page.page, 'pick-failed');
    throw error;
  } finally {
    await page.close();
    assert.equal(await server.stop(), 0);
    folder.remove();
  }
}

// A picks file of places.
export function fileOf(places) {
  const lines = places.map(({image_name, img, point}) => [image_name, ...img, ...point].join());
  return ['image_name,x,y,scan_x,scan_y,scan_z', ...lines, ''].join('\n');
}

export const kSampleSpacing = 0.04;  // metres; what a scan of 800 columns has at 5 m

// Those of places.json that the server takes, also a little beside them (corners of things are
// often depth edges): {places, other_places}.
export async function usablePlaces() {
  const all = JSON.parse(readFileSync(capture('places.json'), 'utf8'));
  const server = await servePicks(capture('none.csv'));
  const result = {
    places: await usable(server, all.places),
    other_places: await usable(server, all.other_places),
  };
  assert.equal(await server.stop(), 0);
  return result;
}

async function usable(server, list) {
  const ask = async (x, y) => (await fetch(`${server.url}scan_point?scan=0&x=${x}&y=${y}`)).json();
  const result = [];
  for (const place of list) {
    const [x, y] = place.scan;
    const answer = await ask(x, y);
    const beside = await Promise.all(
        [[-1, -1], [-1, 1], [1, -1], [1, 1]].map(([dx, dy]) => ask(x + 0.45 * dx, y + 0.45 * dy)));
    if (!answer.ok || !beside.every((one) => one.ok)) continue;
    // The picture of the scan lies as the test thinks.
    assert.ok(
        distance(answer.point, place.point) < kSampleSpacing,
        `${x}, ${y}: ${answer.point} instead of ${place.point}`);
    result.push(place);
  }
  assert.ok(result.length >= 8, `only ${result.length} places can be picked`);
  return result;
}

// The lowest contrast of the text that is seen below `selector` (WCAG 2): {ratio, text, color,
// ground}. Grounds that shine through are put over what lies behind.
export function lowestContrast(page, selector = 'body') {
  return page.evaluate((root) => {
    const parse = (color) => {
      const [r, g, b, a = 1] = color.match(/[\d.]+/g).map(Number);
      return [r, g, b, a];
    };
    const over =
        ([r, g, b, a],
         below) => [r, g, b].map((value, i) => a * value + (1 - a) * below[i]).concat(1);
    const ground = (element) => {
      const layers = [];
      for (let one = element; one; one = one.parentElement) {
        const color = parse(getComputedStyle(one).backgroundColor);
        layers.unshift(color);
        if (color[3] === 1) break;
      }
      return layers.reduce((below, layer) => over(layer, below), [0, 0, 0, 1]);
    };
    const luminance = (color) => {
      const [r, g, b] = color.slice(0, 3).map((byte) => {
        const value = byte / 255;
        return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
      });
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    let worst = {ratio: Infinity};
    let count = 0;
    for (const element of document.querySelector(root).querySelectorAll('*')) {
      const own = [...element.childNodes]
                      .filter((node) => node.nodeType === Node.TEXT_NODE)
                      .map((node) => node.textContent.trim())
                      .join(' ')
                      .trim();
      const text = own || element.getAttribute('placeholder');
      if (!text || !element.checkVisibility({visibilityProperty: true, opacityProperty: true})) {
        continue;
      }
      // WCAG leaves out what cannot be used at the moment; ours is readable all the same.
      const below = ground(element);
      const color = over(parse(getComputedStyle(element).color), below);
      const [low, high] = [luminance(color), luminance(below)].sort((a, b) => a - b);
      const ratio = (high + 0.05) / (low + 0.05);
      ++count;
      if (ratio < worst.ratio) worst = {ratio, text, color: color.join(), ground: below.join()};
    }
    return {...worst, count};
  }, selector);
}
