// roomtex-view in a browser, on a small simulated room and on squares of known colours.

import assert from 'node:assert/strict';
import {copyFileSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {join} from 'node:path';
import {after, before, test} from 'node:test';

import {isSlowRun, launchBrowser, makeFolder, openPage, run, screenshot, serve} from './browser.mjs';
import {readPng, writePng, writeSquareGlb, writeSquarePly} from './pictures.mjs';

const kSize = {
  width: 720,
  height: 460
};
// The processor draws a quarter of the pixels. Clicks are in CSS pixels, and what picture() and the
// downloads show has the size that is asked for.
const kQuarter = {
  ...kSize,
  deviceScaleFactor: 0.5
};
const kWide = {
  width: 1280,
  height: 800,
  deviceScaleFactor: 0.5
};

let browser, folder, server;

async function succeed(command, args) {
  const result = await run(command, args);
  assert.equal(result.code, 0, result.stderr);
}
async function simulate(name, args, colouring = []) {
  const capture = folder.path(name);
  await succeed('roomtex-simulate', [
    '--output_path', capture, '--seed', '3', '--quiet', '1', '--exposure_range_ev', '0',
    '--range_noise', '0.0003', ...args
  ]);
  await succeed('roomtex-texture', [
    '--input_path', `${capture}/truth`, '--image_path', `${capture}/photos`, '--scan_path',
    `${capture}/scan.rtpi`, '--output_path', `${capture}/textured`, '--quiet', '1', ...colouring
  ]);
  return capture;
}
const serveView = (...args) => serve('roomtex-view', [...args, '--port', '0', '--quiet', '1']);

before(async () => {
  folder = makeFolder();
  browser = await launchBrowser({webgl: true});
  const capture = await simulate('room', [
    '--num_photos', '6', '--photo_width', '600', '--photo_height', '400', '--scan_columns', '600',
    '--scan_rows', '300'
  ], ['--Registration.mode', 'measure']);
  server = await serveView(
      '--input_path', `${capture}/textured`, '--aligned', `${capture}/truth`, '--image_path',
      `${capture}/photos`);
});
after(async () => {
  await browser?.close();
  const code = await server?.stop();
  folder.remove();
  assert.equal(code, 0);
});

// The page once the room is there; everything for this view when `whole`.
async function openView(url = server.url, options = kQuarter) {
  const {page, errors} = await openPage(browser, 'about:blank', options);
  await page.emulateMedia({reducedMotion: options.reducedMotion ?? 'reduce'});
  await page.goto(url);
  // openPage was told another host: requests must all go to this one.
  const host = new URL(url).host;
  const strangers = [];
  page.on('request', (request) => {
    const to = new URL(request.url());
    if (to.protocol.startsWith('http') && to.host !== host) strangers.push(to.host);
  });
  await settle(page);
  const noted = () => [...errors().filter((text) => text !== `asked ${host}`), ...strangers];
  return {page, errors: noted};
}
async function settle(page) {
  await page.waitForFunction(
      () => globalThis.roomtexView?.evidence && roomtexView.room.settled &&
          !roomtexView.scheduled && !roomtexView.refineTimer && !roomtexView.fence &&
          !roomtexView.navigation.moving &&
          (roomtexView.room.mode !== 'view-dependent' || roomtexView.lumigraph.settled),
      null, {timeout: 120000, polling: 100});
}
// What is in the picture, without the buttons over it.
async function picture(page) {
  await settle(page);
  // As text: a list of numbers would take longer on the way than the picture to be drawn.
  const url = await page.evaluate(async () => {
    const reader = new FileReader();
    reader.readAsDataURL(await roomtexView.picture(1));
    await new Promise((done) => reader.addEventListener('load', done));
    return reader.result;
  });
  return readPng(Buffer.from(url.slice(url.indexOf(',') + 1), 'base64'));
}
const isBackground = ([r, g, blue]) => r === 0x1b && g === 0x1e && blue === 0x24;
// Mean absolute difference of two pictures, b moved by (dx, dy), in the middle of the picture; only
// where both are surface and not background.
function difference(a, b, dx = 0, dy = 0) {
  let sum = 0, count = 0;
  for (let y = Math.floor(a.height * 0.25); y < a.height * 0.75; y += 2) {
    for (let x = Math.floor(a.width * 0.25); x < a.width * 0.75; x += 2) {
      const p = a.at(x, y), q = b.at(x + dx, y + dy);
      if (isBackground(p) || isBackground(q)) continue;
      sum += Math.abs(p[0] - q[0]) + Math.abs(p[1] - q[1]) + Math.abs(p[2] - q[2]);
      count += 3;
    }
  }
  assert.ok(count > 1000, 'nothing to compare');
  return sum / count;
}
const numMeasures = (page) => page.locator('#measures li').count();

test('the room opens, says what it is and is not drawn while nothing moves', async (t) => {
  const {page, errors} = await openView();
  const complete = await page.evaluate(() => performance.now());
  t.diagnostic(`complete within ${(complete / 1000).toFixed(1)} s of the page`);
  assert.match(await page.title(), /roomtex-view/);
  assert.match(await page.textContent('#facts'), /points, .* triangles, 6 cameras/);
  assert.equal(await page.locator('#camera-list li').count(), 6);
  assert.ok(await page.isHidden('#loading'));
  const seen = new Set();
  const shown = await picture(page);
  for (let x = 0; x < shown.width; x += 7) {
    for (let y = 0; y < shown.height; y += 7) seen.add(String(shown.at(x, y)));
  }
  assert.ok(seen.size > 500, `${seen.size} colours`);
  await screenshot(page, 'view-room');
  await page.waitForTimeout(500);
  const earlier = await page.evaluate(() => roomtexView.numPictures);
  await page.waitForTimeout(1500);
  assert.equal(await page.evaluate(() => roomtexView.numPictures), earlier);
  assert.deepEqual(errors(), []);
  await page.close();
});

test('a texture is on the screen as it is in the file', async () => {
  const colors = [[250, 3, 7], [12, 128, 240], [40, 60, 20], [200, 199, 77]];
  const glb = folder.path('square.glb'), ply = folder.path('square.ply');
  const of = (x, y) => colors[(x >= 64 ? 1 : 0) + (y >= 64 ? 2 : 0)];
  writeFileSync(glb, writeSquareGlb(writePng(128, 128, of)));
  writeFileSync(ply, writeSquarePly([colors[0], colors[0], colors[0], colors[0]]));
  const look = '#mode=orbit&at=0,0,2.5&q=1,0,0,0';
  for (const [path, expected] of [[glb, colors], [ply, Array(4).fill(colors[0])]]) {
    const own = await serveView('--input_path', path);
    const {page, errors} = await openView(own.url + look);
    assert.ok(await page.isVisible('#no-cameras'));
    const shown = await picture(page);
    const {width, height} = shown;
    const quarter = 0.17 * height;  // of the square, some way from its middle
    const places = [[-1, -1], [1, -1], [-1, 1], [1, 1]];
    places.forEach(([dx, dy], i) => {
      const pixel = shown.at(width / 2 + dx * quarter, height / 2 + dy * quarter);
      pixel.forEach(
          (value, k) => assert.ok(
              Math.abs(value - expected[i][k]) <= 3, `${path}: ${pixel} for ${expected[i]}`));
    });
    assert.deepEqual(errors(), []);
    await page.close();
    assert.equal(await own.stop(), 0);
  }
});

test('a texture in many strips comes without a picture for each of them', async () => {
  const glb = folder.path('tall.glb');
  writeFileSync(glb, writeSquareGlb(writePng(64, 8192, (x, y) => [y % 256, 128, y >> 8])));
  const own = await serveView('--input_path', glb);
  const {page, errors} = await openView(own.url);
  assert.ok(await page.evaluate(() => roomtexView.numPictures) < 20);  // strips: 32 of 256 rows
  assert.deepEqual(errors(), []);
  await page.close();
  assert.equal(await own.stop(), 0);
});
test('each way to colour the surface changes the picture and shows its legend', async () => {
  const {page, errors} = await openView();
  const colour = await picture(page);
  assert.ok(await page.isHidden('#legend'));
  const shown = [colour];
  for (const [mode, text] of [
           ['intensity', /intensity/i], ['views', /Photos that see/],
           ['disagreement', /0–255/]]) {
    await page.click(`label:has(input[name="surface"][value="${mode}"])`);
    await page.waitForFunction(() => document.querySelector('#legend').textContent !== '');
    await settle(page);
    assert.match(await page.textContent('#legend'), text);
    const now = await picture(page);
    for (const other of shown) assert.ok(difference(now, other) > 8, `${mode} looks like another`);
    shown.push(now);
    await screenshot(page, `view-${mode}`);
  }
  // Colours mixed afresh for this view are those of the photos, as the blended ones are.
  await page.keyboard.press('5');
  await page.waitForFunction(() => roomtexView.room.mode === 'view-dependent');
  const mixed = difference(await picture(page), colour);
  assert.ok(mixed > 0 && mixed < 15, `mean difference ${mixed}`);
  await screenshot(page, 'view-view-dependent');
  await page.keyboard.press('1');
  assert.ok(await page.isHidden('#legend'));
  // Not to the byte: a slow machine may show another level.
  assert.ok(difference(await picture(page), colour) < 4);
  assert.deepEqual(errors(), []);
  await page.close();
});

test('a photo says how far it is off the others, and where', async () => {
  const {page, errors} = await openView();
  assert.ok(await page.isHidden('#shift'));
  assert.ok(await page.isHidden('#no-shifts'));
  const report = JSON.parse(readFileSync(folder.path('room', 'textured', 'report.json')));
  const {shift_px: {before: px}, shift_before_mm: mm, shift_map_px: map} = report.images[2];
  const option = page.locator('#camera-list li').nth(2);
  assert.equal(await option.locator('.off').textContent(), `${px.toFixed(1)} px`);
  await option.click();
  await page.waitForFunction(() => roomtexView.cameras.photoShown);
  assert.ok(await page.isVisible('#shift'));
  assert.match(
      await page.textContent('#shift-title'),
      new RegExp(`by ${px.toFixed(1)} px \\(${mm.toFixed(1)} mm\\)`));
  // The place that is off most is the lightest one.
  const [most] = map.flat().map((value, i) => [value ?? -1, i]).sort(([a], [b]) => b - a);
  const lightest = await page.evaluate(() => {
    const canvas = document.getElementById('shift-map'), context = canvas.getContext('2d');
    let best = [-1, -1];
    for (let i = 0; i < 48; ++i) {
      const x = (i % 8 + 0.5) * canvas.width / 8, y = (Math.floor(i / 8) + 0.5) * canvas.height / 6;
      const [r, g, b] = context.getImageData(x, y, 1, 1).data;
      if (g + r + b > best[0] && !(r === 92 && g === 98 && b === 110)) best = [g + r + b, i];
    }
    return best[1];
  });
  assert.ok(map.flat()[lightest] >= Math.min(1, most[0]) - 0.1, `${lightest} instead of ${most[1]}`);
  await page.keyboard.press('Escape');
  assert.ok(await page.isHidden('#shift'));
  assert.deepEqual(errors(), []);
  await page.close();
});

test('nothing over the picture lies over something else, nor beyond a small window', async () => {
  for (const size of [{width: 390, height: 844}, kWide]) {
    const {page, errors} = await openView(server.url, size);
    const boxes = () => page.evaluate(() => {
      const shown = ['#toolbar', '#hint', '#legend', '#standing', '#scale-bar', '#leave', '#keys'];
      const found = {};
      for (const name of shown) {
        const box = document.querySelector(name).getBoundingClientRect();
        if (box.width > 0) found[name] = [box.left, box.top, box.right, box.bottom];
      }
      return found;
    });
    const check = (found, expected) => {
      const inside = new Set(['#leave', '#keys']), names = Object.keys(found);
      for (const name of expected) assert.ok(names.includes(name), `${name} at ${size.width}`);
      for (const [i, name] of names.entries()) {
        const [left, top, right, bottom] = found[name];
        assert.ok(left >= 0 && top >= 0 && right <= size.width && bottom <= size.height, name);
        if (inside.has(name)) continue;
        for (const other of names.slice(i + 1).filter((one) => !inside.has(one))) {
          const [l, t, r, b] = found[other];
          const apart = r <= left || l >= right || b <= top || t >= bottom;
          assert.ok(apart, `${other} over ${name} at ${size.width}`);
        }
      }
    };
    await page.keyboard.press('3');
    await page.waitForFunction(() => document.querySelector('#legend').textContent !== '');
    await page.keyboard.press('m');
    check(await boxes(), ['#toolbar', '#hint', '#legend']);
    await page.keyboard.press('Escape');
    await page.keyboard.press('t');
    await settle(page);
    check(await boxes(), ['#legend', '#scale-bar']);
    await page.evaluate(() => roomtexView.standIn(roomtexView.cameras.list[0]));
    await page.waitForFunction(() => roomtexView.cameras.photoShown);
    check(await boxes(), ['#legend', '#standing', '#leave']);
    await page.keyboard.press('?');
    const [wide, room] = await page.evaluate(() => {
      const dialog = document.querySelector('#help');
      return [dialog.scrollWidth, dialog.clientWidth];
    });
    assert.ok(wide <= room, `the keys are ${wide} px wide in ${room}`);
    await screenshot(page, `view-small-${size.width}`);
    assert.deepEqual(errors(), []);
    await page.close();
  }
});

test('a photo lies on the room to the pixel where it was taken', async () => {
  const {page, errors} = await openView();
  await page.keyboard.press('f');  // no frusta in between
  for (const camera of [0, 3]) {
    await page.locator('#camera-list li').nth(camera).click();
    await page.waitForFunction(() => roomtexView.cameras.photoShown);
    assert.ok(await page.isVisible('#standing'));
    await page.fill('#opacity', '1');
    const photo = await picture(page);
    await page.fill('#opacity', '0');
    const room = await picture(page);
    const here = difference(photo, room);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      assert.ok(difference(photo, room, dx, dy) > here, `better when moved by ${dx}, ${dy}`);
    }
    assert.ok(difference(photo, room, 6, 4) > 1.5 * here, 'moved by 6, 4');
    assert.ok(here < 14, `mean difference ${here}`);
    await page.fill('#opacity', '0.5');
    assert.ok(difference(await picture(page), room) < 0.6 * here);
    await screenshot(page, `view-photo-${camera}`);
  }
  await page.keyboard.press('Escape');
  assert.ok(await page.isHidden('#standing'));
  assert.deepEqual(errors(), []);
  await page.close();
});

const fromSrgb = (byte) =>
    byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4;
const toSrgb = (light) => 255 *
    (light <= 0.0031308 ? 12.92 * light : 1.055 * Math.min(light, 1) ** (1 / 2.4) - 0.055);
// How far a prediction of a photo is off, both as the page shows them, at the pixels where
// isMeant(x, y): {sum of squares, count} over the channels; their exposures may differ by a factor.
function misses(photo, predicted, isMeant) {
  const pairs = [];
  let cross = 0, square = 0;
  for (let y = 0; y < photo.height; ++y) {
    for (let x = 0; x < photo.width; ++x) {
      const p = photo.at(x, y), q = predicted.at(x, y);
      if (isBackground(p) || isBackground(q) || !isMeant(x, y)) continue;
      for (let k = 0; k < 3; ++k) {
        pairs.push([p[k], fromSrgb(q[k])]);
        cross += p[k] < 240 ? fromSrgb(p[k]) * fromSrgb(q[k]) : 0;
        square += p[k] < 240 ? fromSrgb(q[k]) ** 2 : 0;
      }
    }
  }
  assert.ok(pairs.length > 3000, `${pairs.length / 3} pixels to compare`);
  const gain = cross / square;
  const sum = pairs.reduce((total, [p, q]) => total + (p - toSrgb(gain * q)) ** 2, 0);
  return {sum, count: pairs.length};
}
// PSNR over the pixels of all of them.
function psnr(all) {
  const sum = all.reduce((total, one) => total + one.sum, 0);
  return 10 * Math.log10(255 ** 2 * all.reduce((total, one) => total + one.count, 0) / sum);
}

// Minutes where the processor draws: run by the tests view_prediction and view_large.
test('photos near the point of view predict those that were left out', {skip: !isSlowRun}, async (t) => {
  const kLeftOut = [5, 13, 21, 29, 37, 45].map((n) => `photo_0${String(n).padStart(2, '0')}.jpg`);
  // Per room and photo: the photo itself, the blended colours, the view-dependent ones.
  const shown = {};
  for (const [name, gloss] of [['matt', '0'], ['glossy', '0.3']]) {
    const capture = folder.path(name), rest = `${capture}/rest`;
    await succeed('roomtex-simulate', [
      '--output_path', capture, '--seed', '11', '--quiet', '1', '--num_photos', '48',
      '--photo_width', '480', '--photo_height', '320', '--scan_columns', '600', '--scan_rows',
      '300', '--range_noise', '0.0003', '--furnished', '0', '--gloss', gloss
    ]);
    mkdirSync(rest);
    for (const file of readdirSync(`${capture}/photos`)) {
      if (!kLeftOut.includes(file)) copyFileSync(`${capture}/photos/${file}`, `${rest}/${file}`);
    }
    await succeed('roomtex-texture', [
      '--input_path', `${capture}/truth`, '--image_path', rest, '--scan_path',
      `${capture}/scan.rtpi`, '--output_path', `${capture}/textured`, '--quiet', '1'
    ]);
    const own = await serveView(
        '--input_path', `${capture}/textured`, '--aligned', `${capture}/truth`, '--image_path',
        `${capture}/photos`);
    const {page, errors} = await openView(own.url, {width: 840, height: 320});
    await page.keyboard.press('f');
    for (const file of kLeftOut) {
      await page.click(`#camera-list li:has-text("${file}")`);
      await page.waitForFunction(() => roomtexView.cameras.photoShown);
      await page.keyboard.press('1');
      await page.fill('#opacity', '1');
      const photo = await picture(page);
      await page.fill('#opacity', '0');
      const blended = await picture(page);
      await page.keyboard.press('5');
      await page.waitForFunction(() => roomtexView.room.mode === 'view-dependent');
      (shown[name] ??= []).push({photo, blended, mixed: await picture(page)});
      await screenshot(page, `view-${name}-${file.slice(0, -4)}`);
    }
    assert.match(page.url(), /surface=view-dependent/);
    assert.deepEqual(errors(), []);
    await page.close();
    assert.equal(await own.stop(), 0);
  }
  const everywhere = () => true;
  const off = {};  // of what is judged, by the blended colours and by the view-dependent ones
  kLeftOut.forEach((file, i) => {
    const matt = shown.matt[i], glossy = shown.glossy[i];
    const shines = (x, y) => {
      const p = matt.photo.at(x, y), q = glossy.photo.at(x, y);
      return Math.max(...p.map((value, k) => Math.abs(value - q[k]))) > 12;
    };
    const gains = {};
    for (const [what, {photo, blended, mixed}, isMeant] of [
           ['matt', matt, everywhere], ['glossy', glossy, everywhere], ['shining', glossy, shines]]) {
      const then = misses(photo, blended, isMeant), now = misses(photo, mixed, isMeant);
      (off[what] ??= {blended: [], mixed: []}).blended.push(then);
      off[what].mixed.push(now);
      gains[what] = psnr([now]) - psnr([then]);
      t.diagnostic(
          `${file}, ${what}: ${psnr([then]).toFixed(2)} -> ${psnr([now]).toFixed(2)} dB, ` +
          `${now.count / 3} pixels`);
    }
    assert.ok(gains.matt > -0.1, `${file}: ${gains.matt} dB, matt`);
    assert.ok(gains.glossy > -0.1, `${file}: ${gains.glossy} dB, glossy`);
    assert.ok(gains.shining > -0.05, `${file}: ${gains.shining} dB where it shines`);
  });
  const all = {};
  for (const [what, {blended, mixed}] of Object.entries(off)) {
    all[what] = psnr(mixed) - psnr(blended);
    t.diagnostic(`all, ${what}: ${psnr(blended).toFixed(2)} -> ${psnr(mixed).toFixed(2)} dB`);
  }
  assert.ok(all.matt > 0, `${all.matt} dB, matt`);
  assert.ok(all.shining > 0.1, `${all.shining} dB where it shines`);
});

// The view from a place of the room's own frame along a direction, as an address.
function lookAlong(capture, fromRoom, towardsRoom) {
  const [s, w, x, y, z, ...t] =
      readFileSync(`${capture}/truth/scan_from_room.txt`, 'utf8').trim().split(/\s+/).map(Number);
  const turn = ([a, b, c]) => {
    const u = [y * c - z * b, z * a - x * c, x * b - y * a];
    const v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]];
    return [a + 2 * (w * u[0] + v[0]), b + 2 * (w * u[1] + v[1]), c + 2 * (w * u[2] + v[2])];
  };
  const at = turn(fromRoom).map((value, i) => s * value + t[i]);
  // The scan's up is y; a camera of the page looks along -z.
  const d = turn(towardsRoom), yaw = Math.atan2(-d[0], -d[2]);
  const q = [Math.cos(yaw / 2), 0, Math.sin(yaw / 2), 0];
  return `#mode=orbit&at=${at.join(',')}&q=${q.join(',')}`;
}

test('two clicks measure the room from wall to wall', async () => {
  const {page, errors} = await openView();
  await page.click('#measure');
  // High up, over the furniture; the room is 5 m wide.
  const canvas = await page.locator('#canvas').boundingBox();
  let numClicks = 0;
  for (const towards of [[-1, 0, 0], [1, 0, 0]]) {
    await page.evaluate((hash) => {
      location.hash = hash;
    }, lookAlong(folder.path('room'), [2.5, 2.0, 2.45], towards));
    await settle(page);
    await page.mouse.click(canvas.x + canvas.width / 2, canvas.y + canvas.height / 2);
    await page.waitForFunction(
        (n) =>
            2 * roomtexView.measures.list.length + (roomtexView.measures.first === null ? 0 : 1) ===
            n,
        ++numClicks);
  }
  assert.equal(await numMeasures(page), 1);
  const measure = await page.evaluate(() => {
    const {distance, height, horizontal, from, to} = roomtexView.measures.list[0];
    return {distance, height, horizontal, from, to};
  });
  assert.ok(Math.abs(measure.distance - 5) < 0.005, `${measure.distance} m`);
  assert.ok(Math.abs(measure.height) < 0.01 && Math.abs(measure.horizontal - 5) < 0.005);
  const text = await page.textContent('#measures li');
  assert.match(text, /(5\.00\d|4\.99\d) m/);
  assert.match(text, /dx dy dz/);
  assert.match(
      await page.evaluate(() => roomtexView.measures.csv()),
      /^from_x,.*horizontal\n(-?\d+\.\d{5},){11}-?\d+\.\d{5}\n$/);
  await screenshot(page, 'view-measure');
  await page.click('#measures button');
  assert.equal(await numMeasures(page), 0);
  await page.keyboard.press('Escape');
  assert.equal(await page.getAttribute('#measure', 'aria-pressed'), 'false');
  assert.deepEqual(errors(), []);
  await page.close();
});

test('the picture is downloaded in the size asked for', async () => {
  const {page, errors} = await openView();
  const canvas = await page.locator('#canvas').boundingBox();
  for (const scale of [1, 2]) {
    await page.click(`label:has(input[name="scale"][value="${scale}"])`);
    const [download] =
        await Promise.all([page.waitForEvent('download'), page.click('#save-picture')]);
    assert.match(download.suggestedFilename(), /^textured-view\.png$/);
    const png = readPng(readFileSync(await download.path()));
    assert.equal(png.width, Math.round(canvas.width * scale));
    assert.equal(png.height, Math.round(canvas.height * scale));
    const seen = new Set();
    for (let x = 0; x < png.width; x += 9) {
      for (let y = 0; y < png.height; y += 9) seen.add(String(png.at(x, y)));
    }
    assert.ok(seen.size > 100, `${seen.size} colours`);
  }
  await planIsTrueToScale(page);
  assert.deepEqual(errors(), []);
  await page.close();
});

// So is a plan, which says where it lies; lengths also in feet.
async function planIsTrueToScale(page) {
  await page.selectOption('#plan-step', '10');
  const downloads = [];
  page.on('download', (download) => downloads.push(download));
  await page.click('#save-plan');
  await page.waitForFunction(() => /plan is saved/.test(document.querySelector('#hint').textContent));
  const named = (ending) => downloads.find((one) => one.suggestedFilename() === `textured${ending}`);
  for (let i = 0; i < 100 && !(named('-plan.png') && named('-plan.pgw')); ++i) await page.waitForTimeout(50);
  await named('-plan.png').saveAs(`${process.env.ROOMTEX_SCREENSHOTS}/view-plan.png`);
  const png = readPng(readFileSync(await named('-plan.png').path()));
  // The room is 5 m wide and 4 m deep, its window 12 cm more; 5 cm of margin on each side.
  assert.ok(Math.abs(png.width - 510) <= 3, `${png.width} pixels wide`);
  assert.ok(Math.abs(png.height - 422) <= 3, `${png.height} pixels high`);
  assert.deepEqual(png.at(1, 1), [255, 255, 255], 'nothing beside the room');
  const seen = new Set();
  for (let x = 20; x < 490; x += 9) seen.add(String(png.at(x, 200)));
  assert.ok(seen.size > 20, 'the plan is empty');
  const world = readFileSync(await named('-plan.pgw').path(), 'utf8').trim().split('\n').map(Number);
  assert.equal(world.length, 6);
  // The room's own axes lie obliquely in the scan's: a pixel is 1 cm in any case.
  const [a, d, b, e] = world;
  assert.ok(Math.abs(Math.hypot(a, d) - 0.01) < 1e-9 && Math.abs(Math.hypot(b, e) - 0.01) < 1e-9);
  assert.ok(Math.abs(a + e) < 1e-9 && Math.abs(d - b) < 1e-9, `${world}`);
  assert.ok(a > 0.0099 * Math.SQRT1_2);

  // From above there is one scale: the bar is as long as it says.
  await page.keyboard.press('t');
  await settle(page);
  const bar = () => page.evaluate(() => {
    const {camera, height} = roomtexView.navigation;
    const {text, px} = {
      text: document.querySelector('#scale-bar').innerText,
      px: document.querySelector('#scale-bar').getBoundingClientRect().width
    };
    return {text, metres: px * (camera.top - camera.bottom) / camera.zoom / height};
  });
  const metric = await bar();
  assert.match(metric.text, /^[125]\d* m$|^0\.[125] m$/);
  assert.ok(Math.abs(metric.metres - Number.parseFloat(metric.text)) < 0.01);
  await page.click('label:has(input[name="unit"][value="ft"])');
  await settle(page);
  const feet = await bar();
  assert.match(feet.text, / ft$/);
  assert.ok(Math.abs(feet.metres / 0.3048 - Number.parseFloat(feet.text)) < 0.03);
  await screenshot(page, 'view-from-above-feet');
}

// Inside the room, in front of a wall.
const insideRoom = () => server.url + lookAlong(folder.path('room'), [2.5, 2.0, 1.6], [1, 0, 0]);

test('everything works by keyboard alone', async () => {
  const {page, errors} = await openView(insideRoom());
  const focused = () =>
      page.evaluate(() => document.activeElement.id || document.activeElement.value);
  await page.keyboard.press('Tab');
  assert.equal(await focused(), 'canvas');
  const earlier = await page.evaluate(() => location.hash);
  await page.keyboard.press('ArrowLeft');
  await page.waitForFunction((hash) => location.hash !== hash, earlier);
  await page.keyboard.press('m');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => roomtexView.measures.first !== null);
  assert.ok(await page.isVisible('#crosshair'));
  await page.keyboard.press('ArrowUp');
  await page.keyboard.press('ArrowLeft');
  await settle(page);
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => roomtexView.measures.list.length === 1);
  await page.keyboard.press('Escape');
  await page.keyboard.press('?');
  assert.ok(await page.isVisible('#help'));
  await page.keyboard.press('Escape');
  assert.ok(await page.isHidden('#help'));
  // To the list of cameras and into one of them.
  for (let i = 0; i < 40 && await focused() !== 'camera-list'; ++i) {
    await page.keyboard.press('Tab');
  }
  assert.equal(await focused(), 'camera-list');
  await page.keyboard.press('ArrowDown');
  await page.keyboard.press('ArrowDown');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => roomtexView.cameras.photoShown);
  assert.equal(await page.textContent('#standing-name'), 'photo_001.jpg');
  // The list has the focus still: Space fades the photo, as everywhere.
  const opacity = () => page.evaluate(() => roomtexView.cameras.opacity);
  const shown = await opacity();
  await page.keyboard.press(' ');
  assert.notEqual(await opacity(), shown);
  await page.keyboard.press('.');
  assert.equal(await page.textContent('#standing-name'), 'photo_002.jpg');
  await page.keyboard.press('Escape');
  assert.ok(await page.isHidden('#standing'));
  await page.keyboard.press('t');
  assert.ok(await page.isChecked('input[name="mode"][value="top"]'));
  await page.keyboard.press('g');
  assert.ok(await page.isVisible('#walk-section'));
  const at = () => page.evaluate(() => roomtexView.navigation.camera.position.toArray());
  const from = await at();
  await page.keyboard.down('w');
  await page.waitForFunction(([x, , z]) => {
    const {position} = roomtexView.navigation.camera;
    return Math.hypot(position.x - x, position.z - z) > 0.1;
  }, from);
  await page.keyboard.up('w');
  const to = await at();
  assert.ok(Math.abs(to[1] - from[1]) < 1e-9, 'walking leaves the eye height');
  // Every control says what it is.
  const nameless = await page.evaluate(
      () => [...document.querySelectorAll('button, input, [role]')]
                .filter(
                    (element) => !element.closest('[hidden]') && !element.closest('dialog') &&
                        !(element.getAttribute('aria-label') ||
                          element.getAttribute('aria-labelledby') || element.textContent.trim() ||
                          element.labels?.[0]?.textContent.trim() ||
                          ['status', 'alert'].includes(element.getAttribute('role'))))
                .map((element) => element.outerHTML.slice(0, 80)));
  assert.deepEqual(nameless, []);
  assert.deepEqual(errors(), []);
  await page.close();
});

test('the mouse turns around what it has got hold of and zooms to it', async () => {
  const {page, errors} = await openView(insideRoom());
  const canvas = await page.locator('#canvas').boundingBox();
  const x = Math.round(canvas.width * 0.45), y = Math.round(canvas.height * 0.55);
  // The point of the surface there, and where it is seen later.
  await page.evaluate(([px, py]) => {
    const {navigation, room} = roomtexView;
    globalThis.held = room.cast(navigation.rayAt(px, py)).point;
  }, [x, y]);
  const seenAt = () => page.evaluate(() => {
    const {camera, width, height} = roomtexView.navigation;
    const p = globalThis.held.clone().project(camera);
    return [
      (p.x + 1) * width / 2, (1 - p.y) * height / 2, camera.position.distanceTo(globalThis.held)
    ];
  });
  const [, , far] = await seenAt();
  await page.mouse.move(canvas.x + x, canvas.y + y);
  await page.mouse.wheel(0, -300);
  await settle(page);
  const [zx, zy, near] = await seenAt();
  assert.ok(Math.hypot(zx - x, zy - y) < 2, 'the point under the pointer stays there');
  assert.ok(near < 0.8 * far);
  await page.mouse.down();
  await page.mouse.move(canvas.x + x + 60, canvas.y + y + 10, {steps: 4});
  await page.mouse.up();
  await settle(page);
  const [ox, oy, turned] = await seenAt();
  assert.ok(Math.abs(turned - near) < 0.02 * near, 'orbiting keeps the distance');
  assert.ok(Math.hypot(ox - x, oy - y) < 2, 'orbiting keeps the point in its place');
  assert.deepEqual(errors(), []);
  await page.close();
});

test('the address carries the point of view', async () => {
  const {page, errors} = await openView();
  await page.keyboard.press('3');
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('+');
  await page.waitForFunction(() => location.hash.includes('surface=views'));
  await page.waitForTimeout(500);
  const url = page.url(), earlier = await picture(page);
  const other = await openView(url);
  await other.page.waitForFunction(() => roomtexView.mode === 'views');
  assert.ok(difference(await picture(other.page), earlier) < 4);
  assert.deepEqual([...errors(), ...other.errors()], []);
  await page.close();
  await other.page.close();
});

test('flights are smooth unless the user wants none', async () => {
  for (const reducedMotion of ['no-preference', 'reduce']) {
    const {page, errors} = await openView(server.url, {...kQuarter, reducedMotion});
    if (reducedMotion === 'no-preference') await askForTheTopDuringAFlight(page);
    const flies = await page.evaluate(() => {
      roomtexView.standIn(roomtexView.cameras.list[2]);
      return roomtexView.navigation.flight !== null;
    });
    assert.equal(flies, reducedMotion === 'no-preference');
    await page.waitForFunction(() => roomtexView.cameras.photoShown);
    assert.deepEqual(errors(), []);
    await page.close();
  }
});

// A view from above is one, also when it was asked for during a flight.
async function askForTheTopDuringAFlight(page) {
  await page.keyboard.press('g');
  await page.waitForFunction(() => roomtexView.navigation.flight !== null);
  await page.keyboard.press('t');
  await settle(page);
  const {mode, flies, down} = await page.evaluate(() => {
    const {navigation} = roomtexView;
    return {
      mode: navigation.mode,
      flies: navigation.flight !== null,
      down: navigation.rayAt(10, 10).direction.y,
    };
  });
  assert.deepEqual([mode, flies], ['top', false]);
  assert.ok(Math.abs(down + 1) < 1e-9, `${down}`);
}

test('nothing that is done meanwhile changes a plan', async () => {
  const {page, errors} = await openView();
  const plan = async (begin) => {
    const [download] = await Promise.all([
      page.waitForEvent('download', (one) => /plan\.png$/.test(one.suggestedFilename())),
      page.evaluate(begin),
    ]);
    const png = readPng(readFileSync(await download.path()));
    await page.waitForFunction(() => roomtexView.drawing === null);
    return png;
  };
  await page.selectOption('#plan-step', '10');
  const quiet = await plan(() => {
    roomtexView.panel.savePlan();
  });
  // All of it before the first piece is in the plan.
  const busy = await plan(() => {
    roomtexView.panel.savePlan();
    roomtexView.setBackground('light');
    roomtexView.setMode('views');
    roomtexView.panel.savePicture();
    roomtexView.panel.saveSection();
    roomtexView.resize();
  });
  assert.deepEqual([busy.width, busy.height], [quiet.width, quiet.height]);
  assert.deepEqual(busy.at(1, 1), [255, 255, 255]);
  assert.ok(difference(busy, quiet) < 0.5, `${difference(busy, quiet)}`);
  await page.waitForFunction(
      () => roomtexView.mode === 'views' && roomtexView.background === 'light');
  await settle(page);
  assert.deepEqual(errors(), []);
  await page.close();
});

test('text stands out from its background, light and dark', async () => {
  const {page, errors} = await openView();
  await page.keyboard.press('4');
  await page.keyboard.press('.');
  await page.keyboard.press('g');
  await page.keyboard.press('m');
  const findWeak = () => page.evaluate(() => {
    const parse = (text) => (text.match(/[\d.]+/g) ?? []).map(Number);
    const luminance = (rgb) => {
      const [r, g, b] =
          rgb.map((v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    // Of the boxes over the picture the worst case: white or black behind what shines through.
    const backgrounds = (element) => {
      const layers = [];
      for (let at = element; at; at = at.parentElement) {
        const [r, g, b, a = 1] = parse(getComputedStyle(at).backgroundColor);
        if (a === 0) continue;
        layers.push([r, g, b, a]);
        if (a === 1) break;
      }
      if (layers.at(-1)?.[3] !== 1) layers.push(null);
      const under = layers.at(-1) && layers.at(-1)[3] === 1 && !element.closest('#stage') ?
          [layers.pop().slice(0, 3)] :
          layers.length > 1 || element.closest('#stage') ?
          [[255, 255, 255], [0, 0, 0]] :
          [layers.pop()?.slice(0, 3) ?? [22, 25, 31]];
      return under.map(
          (base) => layers.filter((l) => l).reverse().reduce(
              (c, [r, g, b, a]) => [r, g, b].map((v, i) => a * v + (1 - a) * c[i]), base));
    };
    const found = [];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const element = walker.currentNode.parentElement;
      if (!walker.currentNode.textContent.trim() || !element.checkVisibility() ||
          element.closest('script, noscript, :disabled, label:has(:disabled)')) {
        continue;
      }
      const color = parse(getComputedStyle(element).color).slice(0, 3);
      for (const background of backgrounds(element)) {
        const [low, high] = [luminance(color), luminance(background)].sort((a, b) => a - b);
        const contrast = (high + 0.05) / (low + 0.05);
        if (contrast < 4.5) {
          found.push(`${walker.currentNode.textContent.trim()}: ${contrast.toFixed(2)}`);
        }
      }
    }
    return found;
  });
  for (const colorScheme of ['light', 'dark']) {
    await page.emulateMedia({colorScheme, reducedMotion: 'reduce'});
    assert.deepEqual(await findWeak(), [], colorScheme);
    await screenshot(page, `view-${colorScheme}`);
  }
  assert.deepEqual(errors(), []);
  await page.close();
});

// Files of a folder, as any web server gives them.
function serveFiles(root) {
  const types = {
    html: 'text/html',
    js: 'text/javascript',
    css: 'text/css'
  };
  const own = createServer((request, response) => {
    const file = join(root, new URL(request.url, 'http://any').pathname);
    try {
      const bytes = readFileSync(file.endsWith('/') ? `${file}index.html` : file);
      response.setHeader('Content-Type', types[file.split('.').at(-1)] ?? types.html);
      response.end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  return new Promise((done) => {
    own.listen(0, '127.0.0.1', () => done({url: `http://127.0.0.1:${own.address().port}/`, own}));
  });
}

test('a folder to give away shows the same from a disk and from any web server', async () => {
  const capture = folder.path('room'), given = folder.path('given');
  await succeed('roomtex-view', [
    '--input_path', `${capture}/textured`, '--aligned', `${capture}/truth`, '--image_path',
    `${capture}/photos`, '--output_path', given
  ]);
  const look = (towards) => lookAlong(capture, [2.5, 2.0, 2.45], towards);
  const {page: served} = await openView(server.url + look([-1, 0, 0]));
  const expected = await picture(served);
  await served.close();
  const {url, own} = await serveFiles(given);
  for (const at of [url, `file://${given}/index.html`]) {
    const {page, errors} = await openView(at + look([-1, 0, 0]));
    assert.ok(difference(await picture(page), expected) < 4, at);
    if (at === url) {
      assert.deepEqual(errors(), []);
      await page.close();
      continue;
    }
    // From wall to wall, on the whole mesh.
    await page.keyboard.press('m');
    const canvas = await page.locator('#canvas').boundingBox();
    const middle = [canvas.x + canvas.width / 2, canvas.y + canvas.height / 2];
    await page.mouse.click(...middle);
    await page.waitForFunction(() => roomtexView.measures.first);
    await page.evaluate((hash) => {
      location.hash = hash;
    }, look([1, 0, 0]));
    await settle(page);
    await page.mouse.click(...middle);
    await page.waitForFunction(() => roomtexView.measures.list.length === 1);
    const {distance} = await page.evaluate(() => roomtexView.measures.list[0]);
    assert.ok(Math.abs(distance - 5) < 0.005, `${distance} m`);
    await page.keyboard.press('Escape');
    // The photo where it was taken, and what the colours rest on.
    await page.keyboard.press('2');
    await page.waitForFunction(() => document.querySelector('#legend').textContent !== '');
    await page.keyboard.press('5');
    await page.waitForFunction(() => roomtexView.room.mode === 'view-dependent');
    await settle(page);
    await page.locator('#camera-list li').first().click();
    await page.waitForFunction(() => roomtexView.cameras.photoShown);
    await page.waitForSelector('#camera-list img[src^="blob:"]');
    assert.match(await page.evaluate(() => location.hash), /at=/);
    await screenshot(page, 'view-given');
    assert.deepEqual(errors(), []);
    await page.close();
  }
  own.close();
  rmSync(`${given}/data/points.js`);
  const {page} = await openView(`file://${given}/index.html`);
  await page.check('#show-points');
  await page.waitForSelector('#errors div');
  assert.match(await page.textContent('#errors'), /points\.js is missing in this folder/);
  await page.close();
});

test('what is missing is said in words', async () => {
  const {page: blind} = await openPage(browser, 'about:blank', kSize);
  await blind.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await blind.goto(server.url);
  await blind.waitForSelector('.failed');
  assert.match(await blind.textContent('.failed'), /WebGL/);
  await blind.close();

  const textured = folder.path('room', 'textured');
  rmSync(`${textured}/evidence.ply`);
  const own =
      await serveView('--input_path', textured, '--aligned', folder.path('room', 'truth'));
  const {page, errors} = await openView(own.url);
  assert.match(await page.textContent('#no-evidence'), /Run roomtex-texture again/);
  assert.ok(await page.isDisabled('input[name="surface"][value="views"]'));
  await page.keyboard.press('3');
  assert.ok(await page.isChecked('input[name="surface"][value="colour"]'));
  assert.deepEqual(errors(), []);
  await own.stop();
  await page.check('#show-points');
  await page.waitForSelector('#errors div');
  assert.match(await page.textContent('#errors'), /no longer answers/);
  await page.close();
});

test('a room of two million points opens without freezing', {skip: !isSlowRun}, async () => {
  const capture = await simulate(
      'large', ['--num_photos', '1', '--photo_width', '300', '--photo_height', '200']);
  const own =
      await serveView('--input_path', `${capture}/textured`, '--aligned', `${capture}/truth`);
  const {page} = await openPage(browser, 'about:blank', kSize);
  await page.addInitScript(() => {
    globalThis.longest = 0;
    new PerformanceObserver((list) => {
      for (const {duration} of list.getEntries()) {
        globalThis.longest = Math.max(globalThis.longest, duration);
      }
    }).observe({type: 'longtask', buffered: true});
  });
  await page.goto(own.url);
  await page.waitForFunction(() => globalThis.roomtexView?.firstPicture, null, {timeout: 120000});
  const first = await page.evaluate(() => roomtexView.firstPicture);
  await settle(page);
  const {longest, all, triangles, points} =
      await page.evaluate(() => ({
                            longest: globalThis.longest,
                            all: performance.now(),
                            triangles: roomtexView.room.shownTriangles,
                            points: roomtexView.data.num_vertices
                          }));
  console.log(
      `${points} points: whole room after ${(first / 1000).toFixed(1)} s, fine after ` +
      `${(all / 1000).toFixed(1)} s with ${Math.round(triangles)} triangles, longest task ${
          Math.round(longest)} ms`);
  assert.ok(points > 1.8e6);
  assert.ok(longest < 5000, 'the page froze');
  await screenshot(page, 'view-large');
  await page.close();
  assert.equal(await own.stop(), 0);
});
