// roomtex-outline's window as its user has it: contours drawn, snapped, changed, undone, saved.

import assert from 'node:assert/strict';
import {existsSync, readFileSync} from 'node:fs';
import {after, before, test} from 'node:test';

import {launchBrowser, makeFolder, openPage, screenshot, serve} from './browser.mjs';
import {lowestContrast, until} from './pick_page.mjs';

const street = process.env.ROOMTEX_STREET;
let browser;

before(async () => {
  browser = await launchBrowser();
});
after(async () => {
  await browser.close();
});

async function onStreet(body, {scheme = 'light', size = {width: 1280, height: 800}} = {}) {
  const folder = makeFolder();
  const output = folder.path('outline.json');
  const model = folder.path('building.glb');
  const server = await serve('roomtex-outline', [
    '--input_path', street, '--scale', '1', '--output_path', output, '--model_path', model,
    '--window', '--port', '0',
  ]);
  const {page, errors} = await openPage(browser, server.url, size);
  await page.emulateMedia({colorScheme: scheme});
  await page.waitForSelector('body[data-ready]');
  const file = () => JSON.parse(readFileSync(output, 'utf8'));
  // A place of the top view on the screen.
  const toScreen = async ([x, y]) => {
    const [scale, , , cx, cy] = (await page.getAttribute('#pane', 'data-view')).split(' ').map(Number);
    const box = await page.locator('#pane').boundingBox();
    return [box.x + box.width / 2 + (x - cx) * scale, box.y + box.height / 2 - (y - cy) * scale];
  };
  const press = (key) => page.keyboard.press(key);
  const count = (n) => until(() => file().buildings.length === n, `${n} buildings in the file`);
  try {
    await body({page, file, toScreen, press, count, model, output});
    // What the server refuses, Chromium notes.
    assert.deepEqual(errors().filter((error) => !/status of 422/.test(error)), []);
  } catch (error) {
    await screenshot(page, 'outline-failed');
    throw error;
  } finally {
    await page.close();
    assert.equal(await server.stop(), 0);
    folder.remove();
  }
}

const near = (a, b, limit) => Math.hypot(a[0] - b[0], a[1] - b[1]) < limit;

test('a house is removed, drawn again with snapping, and stands where it stood', async () => {
  await onStreet(async ({page, file, toScreen, press, count, model, output}) => {
    await count(4);
    const house = file().buildings[0];
    await page.click('#list li:first-child button');
    await press('Delete');
    await count(3);
    await press('d');
    // Two pixels beside each corner: the walls of the points draw it there.
    for (const corner of house.footprint) {
      const [x, y] = await toScreen(corner);
      await page.mouse.move(x + 2, y - 2);
      await page.mouse.click(x + 2, y - 2);
    }
    await press('Enter');
    await count(4);
    const again = file().buildings[3];
    assert.equal(again.footprint.length, 4);
    for (const corner of house.footprint) {
      assert.ok(again.footprint.some((other) => near(corner, other, 0.1)), `${corner}`);
    }
    assert.ok(Math.abs(again.roof[0].point[2] - 6) < 0.1, 'the roof comes from the points');
    await screenshot(page, 'outline-drawn');

    // A corner is moved, undone, done again.
    const start = again.footprint[0];
    await page.mouse.move(...await toScreen(start));
    await page.mouse.down();
    const [x, y] = await toScreen([start[0] - 3, start[1] - 2]);
    await page.keyboard.down('Alt');
    await page.mouse.move(x, y, {steps: 5});
    await page.mouse.up();
    await page.keyboard.up('Alt');
    await until(() => !near(file().buildings[3].footprint[0], start, 2), 'the corner is moved');
    await press('Control+z');
    await until(() => near(file().buildings[3].footprint[0], start, 0.01), 'undone');
    await press('Control+y');
    await until(() => !near(file().buildings[3].footprint[0], start, 2), 'done again');

    // Numbers are typed.
    await page.selectOption('#shape', 'gable');
    await until(() => file().buildings[3].roof.length === 2, 'a gable');
    await page.fill('#ground', '-1.25');
    await press('Tab');
    await until(() => file().buildings[3].ground === -1.25, 'the ground is typed');
    await page.click('#models');
    await until(() => existsSync(model), 'the model is written');

    // A contour that crosses itself is refused with a sentence, and nothing is lost.
    const kept = readFileSync(output, 'utf8');
    await page.fill('#ground', '100');
    await press('Tab');
    await until(async () => /roof does not lie above/.test(await page.innerText('#toast')), 'said');
    assert.equal(readFileSync(output, 'utf8'), kept);
    assert.equal(await page.inputValue('#ground'), '-1.25');
  });
});

test('an area is proposed, up is turned, pages are readable in light and dark', async () => {
  for (const scheme of ['light', 'dark']) {
    await onStreet(async ({page, file, toScreen, press, count}) => {
      await count(4);
      await page.click('#list li:nth-child(2) button');
      const contrast = await lowestContrast(page);
      assert.ok(contrast.ratio >= 4.5, JSON.stringify(contrast));
      await screenshot(page, `outline-${scheme}`);
      await press('4');
      await screenshot(page, `outline-${scheme}-oblique`);
      if (scheme === 'dark') return;
      await press('Delete');
      await count(3);
      await press('a');
      const [from, to] = [await toScreen([13.5, -1]), await toScreen([25.5, 14])];
      await page.mouse.move(...from);
      await page.mouse.down();
      await page.mouse.move(...to, {steps: 4});
      await page.mouse.up();
      await count(4);
      assert.equal(file().buildings[3].roof.length, 2);

      // Upright in the front view, 2 degrees off: all turns along.
      const level = file().outline_from_input.rotation_wxyz;
      await press('2');
      await press('u');
      const box = await page.locator('#pane').boundingBox();
      const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
      await page.mouse.move(x, y + 150);
      await page.mouse.down();
      await page.mouse.move(x + 10, y - 150, {steps: 4});
      await page.mouse.up();
      await until(() => {
        const now = file().outline_from_input.rotation_wxyz;
        const dot = Math.abs(now.reduce((sum, value, i) => sum + value * level[i], 0));
        return Math.abs(2 * Math.acos(Math.min(1, dot)) - Math.atan(10 / 300)) < 1e-3;
      }, 'everything is turned');
    }, {scheme, size: scheme === 'dark' ? {width: 900, height: 700} : undefined});
  }
});
