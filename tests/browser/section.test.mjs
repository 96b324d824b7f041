// Vertical sections of roomtex-view: a line drawn in the plan of a simulated room, judged by its true walls.

import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {after, before, test} from 'node:test';

import {launchBrowser, makeFolder, openPage, run, screenshot, serve} from './browser.mjs';
import {readPng} from './pictures.mjs';

const kRoom = [5, 4, 2.7];  // metres
const kBeyond = 0.3;        // metres of the line outside the walls

let browser, folder, server;

async function succeed(command, args) {
  const result = await run(command, args);
  assert.equal(result.code, 0, result.stderr);
}

before(async () => {
  folder = makeFolder();
  browser = await launchBrowser({webgl: true});
  await succeed('roomtex-simulate', [
    '--output_path', folder.path('room'), '--seed', '3', '--quiet', '1', '--num_photos', '4',
    '--photo_width', '480', '--photo_height', '320', '--scan_columns', '720', '--scan_rows', '360',
    '--range_noise', '0.0003'
  ]);
  await succeed('roomtex-texture', [
    '--input_path', folder.path('room/truth'), '--image_path', folder.path('room/photos'),
    '--scan_path', folder.path('room/scan.rtpi'), '--output_path', folder.path('textured'),
    '--Texture.scale', '1', '--quiet', '1'
  ]);
  server = await serve(
      'roomtex-view', ['--input_path', folder.path('textured'), '--port', '0', '--quiet', '1']);
});
after(async () => {
  await browser?.close();
  const code = await server?.stop();
  folder.remove();
  assert.equal(code, 0);
});

async function settle(page) {
  await page.waitForFunction(
      () => globalThis.roomtexView?.evidence && roomtexView.room.settled &&
          !roomtexView.scheduled && !roomtexView.refineTimer && !roomtexView.fence &&
          !roomtexView.navigation.moving,
      null, {timeout: 120000, polling: 100});
}
async function openView() {
  const {page, errors} = await openPage(browser, 'about:blank', {width: 1200, height: 760});
  await page.emulateMedia({reducedMotion: 'reduce'});
  await page.goto(server.url);
  await settle(page);
  return {page, errors: () => errors().filter((text) => !text.startsWith('asked 127.0.0.1'))};
}

// A place of the room's own frame in the scan's.
function inScan([a, b, c]) {
  const [s, w, x, y, z, ...t] = readFileSync(folder.path('room/truth/scan_from_room.txt'), 'utf8')
                                    .trim()
                                    .split(/\s+/)
                                    .map(Number);
  const u = [y * c - z * b, z * a - x * c, x * b - y * a];
  const v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]];
  return [a + 2 * (w * u[0] + v[0]), b + 2 * (w * u[1] + v[1]), c + 2 * (w * u[2] + v[2])].map(
      (value, i) => s * value + t[i]);
}
// Clicks a place of the plan, room frame.
async function clickInPlan(page, [x, y]) {
  const canvas = await page.locator('#canvas').boundingBox();
  const [px, py] = await page.evaluate((point) => {
    const {camera, width, height} = roomtexView.navigation;
    const at = camera.position.clone().set(...point);
    const place = roomtexView.frames.toPage(at).project(camera);
    return [(place.x + 1) * width / 2, (1 - place.y) * height / 2];
  }, inScan([x, y, 0]));
  await page.mouse.move(canvas.x + px, canvas.y + py, {steps: 3});
  await page.mouse.click(canvas.x + px, canvas.y + py);
}
async function drawLine(page, from, to) {
  await page.click('#section');
  await settle(page);
  assert.ok(await page.isChecked('input[name="mode"][value="top"]'));
  await page.mouse.move(440, 380);
  await page.mouse.wheel(0, 200);  // away from the buttons
  await settle(page);
  await clickInPlan(page, from);
  await page.waitForFunction(() => roomtexView.section.ends.length === 1);
  await clickInPlan(page, to);
  await page.waitForFunction(() => roomtexView.section.drawn);
  assert.equal(await page.getAttribute('#section', 'aria-pressed'), 'false');
}
// {png, world (six numbers), lines (of the DXF: [[x, y], ...])}.
async function save(page, name) {
  const downloads = [];
  const note = (download) => downloads.push(download);
  page.on('download', note);
  await page.click('#save-section');
  const named = (ending) =>
      downloads.find((one) => one.suggestedFilename() === `textured-section.${ending}`);
  for (let i = 0; i < 600 && !(named('png') && named('pgw') && named('dxf')); ++i) {
    await page.waitForTimeout(100);
  }
  page.off('download', note);
  await named('png').saveAs(`${process.env.ROOMTEX_SCREENSHOTS}/${name}.png`);
  const read = async (ending) => readFileSync(await named(ending).path());
  const dxf = (await read('dxf')).toString().split('\n');
  const lines = [];
  for (let i = 0; i < dxf.length; i += 2) {
    if (dxf[i + 1] === 'POLYLINE') lines.push([]);
    if (dxf[i + 1] === 'VERTEX') lines.at(-1).push([Number(dxf[i + 5]), Number(dxf[i + 7])]);
  }
  assert.deepEqual(dxf.slice(-4), ['ENDSEC', '0', 'EOF', '']);
  return {
    png: readPng(await read('png')),
    world: (await read('pgw')).toString().trim().split('\n').map(Number),
    lines
  };
}
const near = (value, expected, tolerance, what) =>
    assert.ok(Math.abs(value - expected) <= tolerance, `${what}: ${value} instead of ${expected}`);
const rangeOf = (values) => [Math.min(...values), Math.max(...values)];

test('a section shows the walls where they are, to the side that is asked for', async () => {
  const {page, errors} = await openView();
  await page.selectOption('#plan-step', '10');
  await drawLine(page, [-kBeyond, 2], [kRoom[0] + kBeyond, 2]);
  await screenshot(page, 'view-section-line');
  const line = kRoom[0] + 2 * kBeyond;
  const {drawn} = await page.evaluate(() => ({drawn: roomtexView.section.length}));
  near(drawn, line, 0.03, 'length of the line, by pixels of the screen');
  const first = await save(page, 'view-section');
  const [left, right] = rangeOf(first.lines.flat().map(([x]) => x));
  const [bottom, top] = rangeOf(first.lines.flat().map(([, y]) => y));
  near(right - left, kRoom[0], 0.005, 'from wall to wall');
  near(top - bottom, kRoom[2], 0.005, 'from floor to ceiling');
  near(left, kBeyond, 0.02, 'the left wall');
  // The cut is one line all around but for what the scanner did not see.
  const longest = Math.max(...first.lines.map((points) => points.length));
  assert.ok(longest > 100, `${longest} points in the longest line`);
  // Heights are those of the scan's frame, whose up is y.
  near(bottom, inScan([2, 2, 0])[1], 0.01, 'height of the floor');
  // The picture and its world file say the same.
  near(first.png.width, 100 * drawn, 1, 'pixels');
  const [a, d, b, e, x0, y0] = first.world;
  assert.deepEqual([a, d, b, e], [0.01, 0, 0, -0.01]);
  const pixel = (x, y) => first.png.at(Math.round((x - x0) / a), Math.round((y - y0) / e));
  assert.deepEqual(pixel(left - 0.15, bottom + 1), [255, 255, 255], 'nothing beyond the wall');
  const dark = ([r, g, blue]) => r + g + blue < 150;
  for (const height of [2.1, 2.2, 2.3, 2.4]) {  // above what hides it and hangs on it
    assert.ok(dark(pixel(left, bottom + height)), `the left wall is drawn ${height} m high`);
  }
  const seen = new Set();
  for (let x = left + 0.2; x < right - 0.2; x += 0.05) seen.add(String(pixel(x, bottom + 1.6)));
  assert.ok(seen.size > 20, 'what is behind the cut is there');

  // The other way round the same cut is mirrored, and something else is behind it.
  await page.click('#turn-section');
  const second = await save(page, 'view-section-turned');
  const others = rangeOf(second.lines.flat().map(([x]) => drawn - x));
  near(others[0], left, 1e-4, 'mirrored');
  near(others[1], right, 1e-4, 'mirrored');
  let sum = 0, count = 0;
  for (let y = 20; y < 240; y += 5) {
    for (let x = 40; x < first.png.width - 40; x += 5) {
      const p = first.png.at(x, y), q = second.png.at(first.png.width - 1 - x, y);
      sum += Math.abs(p[0] - q[0]) + Math.abs(p[1] - q[1]) + Math.abs(p[2] - q[2]);
      count += 3;
    }
  }
  assert.ok(sum / count > 8, `both sides look alike: ${sum / count}`);

  // A metre of depth does not reach the wall, 2 m away.
  await page.selectOption('#section-depth', '1');
  const near1 = await save(page, 'view-section-depth');
  let white = 0;
  for (let x = 60; x < 500; x += 4) white += String(near1.png.at(x, 60)) === '255,255,255' ? 1 : 0;
  assert.ok(white > 60, `${white} of 110 places show nothing within a metre`);
  assert.deepEqual(errors(), []);
  await page.close();
});

test('a section is drawn by keys, given up, and nothing is left of it', async () => {
  const {page, errors} = await openView();
  await page.keyboard.press('v');
  await settle(page);
  assert.ok(await page.isVisible('#crosshair'));
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => roomtexView.section.ends.length === 1);
  assert.match(await page.textContent('#hint'), /where the line ends/);
  await page.keyboard.press('Enter');  // the same place
  assert.equal(await page.evaluate(() => roomtexView.section.ends.length), 1);
  for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowRight');
  await settle(page);
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => roomtexView.section.drawn);
  assert.ok(await page.isVisible('#section-controls'));
  assert.match(await page.textContent('#section-facts'), /m$/);
  await page.click('#clear-section');
  assert.ok(await page.isHidden('#section-controls'));
  await page.keyboard.press('v');
  await page.keyboard.press('Enter');
  await page.keyboard.press('Escape');
  assert.equal(await page.evaluate(() => roomtexView.section.ends.length), 0);
  await page.keyboard.press('Escape');
  assert.equal(await page.getAttribute('#section', 'aria-pressed'), 'false');
  // Measuring and drawing end each other.
  await page.keyboard.press('v');
  await page.keyboard.press('m');
  assert.equal(await page.getAttribute('#section', 'aria-pressed'), 'false');
  assert.equal(await page.getAttribute('#measure', 'aria-pressed'), 'true');
  await page.keyboard.press('v');
  assert.equal(await page.getAttribute('#measure', 'aria-pressed'), 'false');
  assert.deepEqual(errors(), []);
  await page.close();
});
