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
  // A place of the top view on the screen, once what was done before is drawn.
  const toScreen = async ([x, y]) => {
    await page.evaluate(
        () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const [scale, , , cx, cy] = (await page.getAttribute('#pane', 'data-view')).split(' ').map(Number);
    const box = await page.locator('#pane').boundingBox();
    return [box.x + box.width / 2 + (x - cx) * scale, box.y + box.height / 2 - (y - cy) * scale];
  };
  const press = (key) => page.keyboard.press(key);
  const drag = async (from, to, onTheWay = async () => {}) => {
    await page.mouse.move(...await toScreen(from));
    await page.mouse.down();
    await page.mouse.move(...await toScreen(to), {steps: 5});
    await onTheWay();
    await page.mouse.up();
  };
  const count = (n) => until(() => file().buildings.length === n, `${n} buildings in the file`);
  try {
    await body({page, file, toScreen, press, drag, count, model, output});
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

test('arrows after an undo move nothing that was not chosen, and all goes on being saved', async () => {
  await onStreet(async ({page, file, toScreen, press, drag, count}) => {
    await count(4);
    await page.click('#list li:first-child button');
    const corners = () => file().buildings[0].footprint;
    const earlier = corners();
    const n = earlier.length;
    // Its last wall, four pixels outside: the footprint runs to the left.
    const [a, b] = [earlier[n - 1], earlier[0]];
    const middle = await toScreen([0, 1].map((i) => (a[i] + b[i]) / 2));
    const outside = await toScreen([(a[0] + b[0]) / 2 + b[1] - a[1], (a[1] + b[1]) / 2 + a[0] - b[0]]);
    const away = 4 / Math.hypot(outside[0] - middle[0], outside[1] - middle[1]);
    await page.mouse.dblclick(...[0, 1].map((i) => middle[i] + away * (outside[i] - middle[i])));
    await until(() => corners().length === n + 1, 'a corner in the last wall');
    await press('Control+z');
    await until(() => corners().length === n, 'undone');
    await press('ArrowRight');
    const to = [earlier[0][0] - 1, earlier[0][1] - 1];
    await drag(earlier[0], to);
    await until(() => !near(corners()[0], earlier[0], 0.5), 'a corner that is dragged is saved');
    assert.deepEqual(corners().slice(1), earlier.slice(1));
    await press('Control+z');
    await until(() => near(corners()[0], earlier[0], 1e-9), 'back');

    // Arrow keys one after the other are one step.
    const scale = Number((await page.getAttribute('#pane', 'data-view')).split(' ')[0]);
    for (let i = 0; i < 5; ++i) await press('ArrowLeft');
    const moved = [earlier[0][0] - 5 / scale, earlier[0][1]];
    await until(() => near(corners()[0], moved, 1e-6), 'moved by five pixels');
    await press('Control+z');
    await until(() => near(corners()[0], earlier[0], 1e-9), 'back by one step');
  });
});

test('heights that come late are those of the house that was asked for', async () => {
  await onStreet(async ({page, file, press, count}) => {
    await count(4);
    await page.click('#list li:first-child button');
    await page.fill('#ground', '-1.25');
    await press('Tab');
    await until(() => file().buildings[0].ground === -1.25, 'the ground is typed');
    const earlier = file().buildings;
    let answer;
    const isTime = new Promise((done) => {
      answer = done;
    });
    await page.route('**/heights', async (route) => {
      await isTime;
      await route.continue();
    });
    await page.click('#heights');
    await page.click('#list li:nth-child(2) button');
    answer();
    await until(() => file().buildings[0].ground > -1, 'the ground comes from the points');
    const {footprint, name} = file().buildings[0];
    assert.deepEqual([name, footprint], [earlier[0].name, earlier[0].footprint]);
    assert.deepEqual(file().buildings.slice(1), earlier.slice(1));
  });
});

test('a drag that is given up, and a field that is emptied, change nothing', async () => {
  await onStreet(async ({page, file, press, drag, count}) => {
    await count(4);
    await page.click('#list li:first-child button');
    const house = () => file().buildings[0];
    const earlier = house();
    const [x, y] = earlier.footprint[0];
    await drag([x, y], [x - 2, y - 3], () => press('Escape'));
    await page.fill('#ground', '');
    await press('Tab');
    await until(async () => /Type a number/.test(await page.innerText('#toast')), 'said');
    assert.notEqual(await page.inputValue('#ground'), '');
    assert.deepEqual(house(), earlier);
    await page.fill('#ground', '-1.25');
    await press('Tab');
    await until(() => house().ground === -1.25, 'the ground is typed');
    assert.deepEqual(house(), {...earlier, ground: -1.25});

    // A height that was typed stays to the last digit when something else of the roof changes.
    await page.fill('#eaves', '6.1234');
    await press('Tab');
    const eaves = () => house().roof[0].point[2];
    await until(() => eaves() === 6.1234, 'the eaves are typed');
    await page.selectOption('#shape', 'gable');
    await until(() => house().roof.length === 2, 'a gable');
    assert.ok(Math.abs(eaves() - 6.1234) < 1e-9, `${eaves()}`);
    const direction = house().roof[0].downhill_deg;
    await page.click('#turn');
    await until(() => house().roof[0].downhill_deg !== direction, 'turned');
    assert.ok(Math.abs(eaves() - 6.1234) < 1e-9, `${eaves()}`);
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
