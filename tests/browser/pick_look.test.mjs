// roomtex-pick in a browser: what is drawn lies where it should, what goes wrong is said, and
// everything can be read and reached.

import assert from 'node:assert/strict';
import {renameSync, writeFileSync} from 'node:fs';
import {after, before, test} from 'node:test';

import {launchBrowser, makeFolder, screenshot} from './browser.mjs';
import {colorsAt, distance, fileOf, lowestContrast, onPage, PickPage, servePicks, until, usablePlaces} from './pick_page.mjs';

let browser;
let places;

before(async () => {
  browser = await launchBrowser();
  ({places} = await usablePlaces());
});

after(async () => {
  await browser.close();
});

const pageOn = (body, options = {}) =>
    onPage(browser, body, {image_name: places[0].image_name, ...options});

// The colours of the tiles of level 0 themselves, below the middles of the pixels.
function tileColors(page, address, list) {
  return page.page.evaluate(async ([url, where]) => {
    const tiles = new Map();
    const colors = [];
    for (const [x, y] of where) {
      const name = `${url}&level=0&x=${Math.floor(x / 512)}&y=${Math.floor(y / 512)}`;
      if (!tiles.has(name)) {
        const bitmap = await createImageBitmap(await (await fetch(name)).blob());
        const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
        canvas.getContext('2d').drawImage(bitmap, 0, 0);
        tiles.set(name, canvas.getContext('2d'));
      }
      const data =
          tiles.get(name).getImageData(Math.floor(x) % 512, Math.floor(y) % 512, 1, 1).data;
      colors.push([...data].slice(0, 3));
    }
    return colors;
  }, [address, list]);
}

test('a pixel is drawn where its coordinates say, without smoothing', async () => {
  await pageOn(async (page) => {
    const {selected_photo: photo} = await (await fetch(`${page.url}state`)).json();
    const cases = [
      ['photo', [515.5, 300.5], `tile?photo=${photo}`],  // beside the border of two tiles
      ['scan', [511.5, 200.5], 'tile?scan=0&picture=intensity'],
    ];
    for (const [side, middle, address] of cases) {
      await page.zoomTo(side, middle, 8);
      const around = [];
      for (let dy = -6; dy <= 6; dy += 3) {
        for (let dx = -9; dx <= 9; dx += 3) around.push([middle[0] + dx, middle[1] + dy]);
      }
      const expected = await tileColors(page, address, around);
      assert.ok(new Set(expected.map(String)).size > 5, 'there is something to see');
      await until(async () => {
        const seen = await colorsAt(page, side, around);
        return seen.every((color, i) => distance(color, expected[i]) <= 2);
      }, `${side}: the pixels themselves`, 10);
    }
  });
});

test('gamma lightens the scan by a table, and leaves the photo alone', async () => {
  await pageOn(async (page) => {
    const where = [200, 300, 400, 500, 600].map((x) => [x + 0.5, 200.5]);
    await page.zoomTo('scan', [400.5, 200.5], 1.2);
    const tiles = await tileColors(page, 'tile?scan=0&picture=intensity', where);
    // Places on the screen lie between pixels here: what is drawn without gamma is the reference.
    await until(
        async () => (await colorsAt(page, 'scan', where))
                        .some((color, i) => distance(color, tiles[i]) < 40),
        'drawn');
    await page.redrawn();
    const plain = await colorsAt(page, 'scan', where);
    await page.page.locator('#gamma').fill('0.5');
    const table = (value) => 255 * (value / 255) ** (1 / Math.sqrt(3));
    await until(async () => {
      const lighter = await colorsAt(page, 'scan', where);
      return lighter.every(([value], i) => Math.abs(value - table(plain[i][0])) <= 8);
    }, 'every pixel by the table');
  });
});

test('views stay when the window is resized and the divider dragged', async () => {
  await pageOn(async (page) => {
    await page.zoomTo('photo', places[0].img, 3);
    await page.zoomTo('scan', places[0].scan, 3);
    const earlier = [await page.view('photo'), await page.view('scan')];
    await page.page.setViewportSize({width: 1100, height: 640});
    await until(async () => (await page.view('photo')).box.width < earlier[0].box.width, 'smaller');
    await page.redrawn();
    assert.deepEqual(
        [(await page.view('photo')).text, (await page.view('scan')).text],
        earlier.map((view) => view.text));
    const bar = await page.page.locator('#divider').boundingBox();
    const width = (await page.view('photo')).box.width;
    await page.page.mouse.move(bar.x + 3, bar.y + 100);
    await page.page.mouse.down();
    await page.page.mouse.move(bar.x - 197, bar.y + 100, {steps: 5});
    await page.page.mouse.up();
    await until(
        async () => Math.abs((await page.view('photo')).box.width - width + 200) < 3, 'moved');
    await page.redrawn();
    assert.deepEqual(
        [(await page.view('photo')).text, (await page.view('scan')).text],
        earlier.map((view) => view.text));
    // By keys, too.
    await page.page.focus('#divider');
    await page.page.keyboard.press('ArrowRight');
    await until(async () => (await page.view('photo')).box.width > width - 195, 'moved back a bit');
  });
});

test('keys that look act on the picture under the mouse, not on the focused one', async () => {
  await pageOn(async (page) => {
    await page.zoomTo('photo', places[0].img, 3);
    await page.zoomTo('scan', places[0].scan, 3);
    await page.page.focus('#photo-pane');
    const photo = await page.view('photo'), scan = await page.view('scan');
    await page.page.mouse.move(scan.box.x + scan.box.width / 2, scan.box.y + scan.box.height / 2);
    await page.page.keyboard.press('f');
    await until(async () => (await page.view('scan')).text !== scan.text, 'whole scan');
    assert.equal((await page.view('photo')).text, photo.text);
    // Without the mouse over either, the focus counts.
    await page.page.mouse.move(5, 5);
    await page.page.keyboard.press('f');
    await until(async () => (await page.view('photo')).text !== photo.text, 'whole photo');
  });
});

test('in a window of 900 x 700 every control is in reach', async () => {
  await pageOn(async (page) => {
    await page.page.setViewportSize({width: 900, height: 700});
    await page.redrawn();
    const hidden = await page.page.evaluate(
        () => [...document.querySelectorAll(
                   '#bar button, .side .tools button, .side .tools select, .side .tools input')]
                  .filter((one) => {
                    if (!one.checkVisibility()) return false;
                    const {x, y, width, height} = one.getBoundingClientRect();
                    const top = document.elementFromPoint(x + width / 2, y + height / 2);
                    return !(top && (one.contains(top) || one.closest('label')?.contains(top)));
                  })
                  .map((one) => one.id));
    assert.deepEqual(hidden, []);
    assert.ok((await page.view('scan')).box.height > 200, 'the pictures keep their room');
    await screenshot(page.page, 'pick-900');
  });
});

test('a press that moves pans, one that does not sets a point', async () => {
  await pageOn(async (page) => {
    const img = [480, 320];
    await page.zoomTo('photo', img, 2);
    const earlier = await page.view('photo');
    await page.drag('photo', img, [img[0] + 30, img[1] + 20]);
    await until(async () => (await page.view('photo')).text !== earlier.text, 'panned');
    const view = await page.view('photo');
    assert.ok(Math.abs(view.centre[0] - earlier.centre[0] + 30) < 0.6);
    assert.ok(Math.abs(view.centre[1] - earlier.centre[1] + 20) < 0.6);
    assert.equal((await page.rows()).length, 0);
    // Less than four pixels is still a click.
    await page.drag('photo', img, [img[0] + 0.5, img[1]]);
    await page.rowsAre(1);
  });
});

test('a second finger, or a second button, moves nothing', async () => {
  const eight = places.slice(0, 8);
  await pageOn(async (page) => {
    await page.rowsAre(8);
    const earlier = page.file();
    const [x, y] = await page.toScreen('photo', eight[2].img);
    const fingers = await page.page.context().newCDPSession(page.page);
    const touch = (type, ...points) => fingers.send('Input.dispatchTouchEvent', {
      type: `touch${type}`,
      touchPoints: points.map(([px, py], id) => ({x: px, y: py, id})),
    });
    await touch('Start', [x, y]);
    await touch('Move', [x + 30, y]);
    await touch('Start', [x + 30, y], [x + 90, y + 40]);
    await touch('Move', [x + 30, y], [x + 120, y + 60]);
    await touch('Move', [x + 40, y], [x + 120, y + 60]);
    await touch('End');
    await page.saved();
    assert.deepEqual(page.file(), earlier);
    await page.rowsAre(8);
    // One finger moves a point.
    await touch('Start', [x, y]);
    await touch('Move', [x + 30, y]);
    await touch('End');
    await until(() => distance(page.file()[2].img, earlier[2].img) > 10, 'moved');
    await page.page.keyboard.press('Control+z');
    await until(() => distance(page.file()[2].img, earlier[2].img) < 1e-9, 'back');

    const {mouse} = page.page;
    await mouse.move(x, y);
    await mouse.down();
    await mouse.move(x + 30, y, {steps: 4});
    await mouse.down({button: 'right'});
    await mouse.up();
    await mouse.up({button: 'right'});
    await mouse.move(x + 60, y + 30, {steps: 4});
    await page.saved();
    assert.deepEqual(page.file(), earlier);
  }, {picksFile: fileOf(eight)});
});

// A place that the server refuses for this reason, and that has one near it that can be picked.
async function refusedPlace(page, reason) {
  for (let y = 20; y < 400; y += 7) {
    for (let x = 20; x < 800; x += 7) {
      const place = [x + 0.5, y + 0.5];
      const answer =
          await (await fetch(`${page.url}scan_point?scan=0&x=${place[0]}&y=${place[1]}`)).json();
      if (answer.reason === reason && answer.snap) return {place, ...answer};
    }
  }
  throw new Error(`no place is refused as ${reason}`);
}

test('where nothing can be picked the page says why and offers the nearest place', async () => {
  await pageOn(async (page) => {
    for (const [index, reason] of ['missing', 'depth_edge'].entries()) {
      const refused = await refusedPlace(page, reason);
      await page.zoomTo('scan', refused.place, 8);
      await page.page.mouse.click(...await page.toScreen('scan', refused.place));
      await page.page.waitForSelector('#hint:not([hidden])');
      assert.ok((await page.text('#hint p')).split(' ').length > 4, 'a sentence');
      assert.equal((await page.rows()).length, index);
      if (index === 0) {
        await screenshot(page.page, 'pick-refused-place');
        assert.ok((await lowestContrast(page.page, '#hint')).ratio >= 4.5);
        await page.page.keyboard.press('Enter');
      } else {
        await page.page.click('#hint button.main');
      }
      await page.rowsAre(index + 1);
      await page.saved();
      const {scan} = (await page.session()).picks[index];
      const snap = [refused.snap.x, refused.snap.y];
      assert.ok(
          distance([scan.x, scan.y], refused.place) < distance(snap, refused.place) + 1.5,
          `${scan.x}, ${scan.y} instead of ${snap}`);
      // The next one is a new pick.
      await page.click('photo', places[index].img);
      await page.rowIs(index, (row) => row.status !== 'half', 'completed');
    }
    const refused = await refusedPlace(page, 'missing');
    await page.zoomTo('scan', refused.place, 8);
    await page.page.mouse.click(...await page.toScreen('scan', refused.place));
    await page.page.waitForSelector('#hint:not([hidden])');
    await page.page.keyboard.press('Escape');
    await until(async () => !await page.page.isVisible('#hint'), 'Escape drops it');
    assert.equal((await page.rows()).length, 2);
  });
});

test(
    'from a solution on the photo lies on the scan: over it, swipe, blink; edges on the photo',
    async () => {
      await pageOn(async (page) => {
        await page.rowsAre(8);
        const where = places.slice(0, 8).map((place) => place.scan);
        const saturation = async () =>
            Math.max(...(await colorsAt(page, 'scan', where))
                         .map((color) => Math.max(...color) - Math.min(...color)));
        await until(() => page.page.isEnabled('#back-mode'), 'there is a solution');
        assert.ok(await saturation() < 4, 'the scan is grey');
        await page.page.keyboard.press('o');
        await until(async () => await saturation() > 30, 'the photo has colours');
        await page.page.locator('#back-range').fill('0');
        await until(async () => await saturation() < 4, 'opacity 0');
        await page.page.keyboard.press('o');
        // The line to the far right: all is photo; to the left: all is scan.
        await page.page.selectOption('#back-mode', 'swipe');
        await page.page.locator('#back-range').fill('100');
        await until(async () => await saturation() > 30, 'right of the line');
        await page.page.locator('#back-range').fill('0');
        await until(async () => await saturation() < 4, 'left of the line');
        await page.page.focus('#scan-pane');
        await page.page.keyboard.press('b');
        await until(async () => await saturation() > 30, 'the photo blinks');
        await until(async () => await saturation() < 4, 'the scan blinks');
        await page.page.keyboard.press('b');
        await page.page.keyboard.press('e');
        await until(
            async () => /crease/.test(await page.text('#photo-legend')), 'the legend of the edges');
        await page.page.keyboard.press('o');
        await page.page.locator('#back-range').fill('70');
        await until(async () => await saturation() > 20, 'over it again');
        await screenshot(page.page, 'pick-back');
        // The edges are those of the photo that is shown, or there are none.
        let answer;
        const isTime = new Promise((done) => {
          answer = done;
        });
        await page.page.route('**/edges?*', async (route) => {
          await isTime;
          await route.continue();
        });
        await page.page.focus('#photo-pane');
        await page.page.keyboard.press('PageDown');
        const legend = () => page.page.locator('#photo-legend').innerText();
        await until(async () => !/crease/.test(await legend()), 'the edges are gone');
        answer();
        await until(async () => /crease/.test(await legend()), 'those of this photo');
      }, {picksFile: fileOf(places.slice(0, 8))});
    });

test('a tab that another one has overtaken says so, and can reload or keep', async () => {
  const refusals = {allowed: [/status of 4\d\d/]};
  await pageOn(async (page, {server, picksPath}) => {
    await page.rowsAre(6);
    const other = await PickPage.open(browser, server, picksPath);
    await other.rowsAre(6);
    await other.page.keyboard.press('n');
    await other.page.keyboard.press('x');
    await other.saved();
    await until(() => page.file()[0].weight === 0, 'saved by the other tab');

    await page.page.focus('#photo-pane');
    await page.page.keyboard.press('p');
    await page.page.keyboard.press('x');
    await page.page.waitForSelector('#banner:not([hidden])');
    assert.match(await page.text('#banner'), /another tab/);
    assert.match(await page.text('#save'), /not saved/);
    assert.ok((await lowestContrast(page.page, '#banner')).ratio >= 4.5);
    assert.ok((await lowestContrast(page.page, '#save')).ratio >= 4.5);
    await page.page.click('#banner button.main');
    await page.rowIs(0, (row) => row.status === 'off', 'as in the other tab');
    await page.rowIs(5, (row) => row.status !== 'off', 'as in the other tab');
    await page.saved();

    // The other tab is the old one now.
    await page.page.keyboard.press('n');
    await page.page.keyboard.press('x');
    await page.saved();
    await other.page.focus('#photo-pane');
    await other.page.keyboard.press('p');
    await other.page.keyboard.press('x');
    await other.page.waitForSelector('#banner:not([hidden])');
    await other.page.click('#banner button:not(.main)');
    await other.saved();
    await until(
        () => other.file().filter((pick) => pick.weight === 0).length === 2, 'kept its own');
    await other.close();
  }, {picksFile: fileOf(places.slice(0, 6)), ...refusals});
});

test('a server that does not answer loses nothing', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.page.route('**/*', (route) => route.abort('connectionrefused'));
    await page.page.keyboard.press('n');
    await page.page.keyboard.press('Delete');
    await page.rowsAre(5);
    await until(async () => /not saved/.test(await page.text('#save')), 'it says so');
    await page.page.waitForSelector('#banner:not([hidden])');
    assert.equal(page.file().length, 6);
    await page.page.unroute('**/*');
    await page.saved();
    await until(() => page.file().length === 5, 'saved once the server is back');
    assert.ok(!await page.page.isVisible('#banner'));
  }, {picksFile: fileOf(places.slice(0, 6)), allowed: [/ERR_CONNECTION_REFUSED/, /failed$/]});
});

test('a server that takes questions and never answers loses nothing', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.page.clock.install();
    let asked = 0;
    await page.page.route('**/picks', () => ++asked);  // neither answered nor refused
    await page.page.keyboard.press('n');
    await page.page.keyboard.press('Delete');
    await page.rowsAre(5);
    await until(() => asked === 1, 'it has asked');
    assert.equal(await page.text('#save'), 'saving…');
    await page.page.clock.fastForward(20000);
    await until(async () => /not saved/.test(await page.text('#save')), 'it says so');
    assert.equal(page.file().length, 6);
    await page.page.unroute('**/picks');
    await page.page.clock.resume();
    await page.page.clock.fastForward(5000);
    await page.saved();
    await until(() => page.file().length === 5, 'saved once the server is back');
  }, {picksFile: fileOf(places.slice(0, 6)), allowed: [/ERR_/, /failed$/]});
});

test('why picks cannot be saved is said in full, and they are once they can', async () => {
  await pageOn(async (page, {folder}) => {
    await page.rowsAre(6);
    const away = `${folder.path('')}-away`;
    renameSync(folder.path(''), away);
    await page.page.focus('#photo-pane');
    await page.page.keyboard.press('n');
    await page.page.keyboard.press('x');
    await page.page.waitForSelector('#banner:not([hidden])');
    const banner = await page.text('#banner');
    assert.match(banner, /could not be saved: .*picks\.csv.*[^.]\. They are kept here/s);
    // Nothing of it is cut off.
    assert.ok(await page.page.$eval(
        '#banner p', (p) => p.scrollWidth <= p.clientWidth && p.scrollHeight <= p.clientHeight));
    assert.ok((await lowestContrast(page.page, '#banner')).ratio >= 4.5);
    await screenshot(page.page, 'pick-not-saved');
    renameSync(away, folder.path(''));
    await page.saved();
    await until(() => page.file()[0].weight === 0, 'saved once the folder is there again');
    assert.ok(!await page.page.isVisible('#banner'));
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test(
    'a server that was started anew is told from one that is gone; picks can be copied',
    async () => {
      const folder = makeFolder();
      const picksPath = folder.path('picks.csv');
      writeFileSync(picksPath, fileOf(places.slice(0, 6)));
      const server = await servePicks(picksPath);
      const page = await PickPage.open(browser, server, picksPath);
      await page.page.context().grantPermissions(['clipboard-read', 'clipboard-write']);
      await page.rowsAre(6);
      assert.equal(await server.stop(), 0);
      await page.page.focus('#photo-pane');
      await page.page.keyboard.press('n');
      await page.page.keyboard.press('Delete');
      await until(async () => /does not answer/.test(await page.text('#save')), 'gone');
      const again = await servePicks(picksPath, [], new URL(server.url).port);
      await until(async () => /started anew/.test(await page.text('#banner')), 'started anew');
      assert.match(await page.text('#save'), /not saved/);
      await page.page.click('#banner button');
      await until(async () => /Copied 5/.test(await page.text('#banner')), 'copied');
      writeFileSync(picksPath, await page.page.evaluate(() => navigator.clipboard.readText()));
      assert.deepEqual(page.file().map(({img}) => img), places.slice(1, 6).map(({img}) => img));
      await page.close();
      assert.equal(await again.stop(), 0);
      folder.remove();
    });

test('all text has a contrast of 4.5 or more, at every size, light and dark', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.page.keyboard.press('n');
    await page.page.keyboard.press('x');
    const sizes = [[1280, 720], [1600, 1000], [2560, 1440]];
    for (const colorScheme of ['light', 'dark']) {
      await page.page.emulateMedia({colorScheme});
      for (const [width, height] of sizes) {
        await page.page.setViewportSize({width, height});
        await page.redrawn();
        const lowest = await lowestContrast(page.page);
        assert.ok(lowest.count > 60, `${lowest.count} texts`);
        assert.ok(lowest.ratio >= 4.5, `${colorScheme}: ${JSON.stringify(lowest)}`);
        const wide = await page.page.evaluate(
            () => [...document.querySelectorAll('.tools, #bar, #table-box')]
                      .filter((one) => one.scrollWidth > one.clientWidth + 1)
                      .map((one) => one.innerText));
        assert.deepEqual(wide, [], `cut off at ${width} x ${height}`);
        await screenshot(page.page, `pick-${width}-${colorScheme}`);
      }
      await page.page.focus('#scan-pane');
      await page.page.keyboard.press('?');
      await page.page.waitForSelector('#help[open]');
      const lowest = await lowestContrast(page.page, '#help');
      assert.ok(lowest.ratio >= 4.5, `${colorScheme}: ${JSON.stringify(lowest)}`);
      await page.page.keyboard.press('Escape');
      await until(async () => !await page.page.isVisible('#help'), 'closed');
    }
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('names of photos are told apart at every size', async () => {
  await pageOn(async (page) => {
    // Without a camera six picks are not enough, which takes room beside the names.
    await page.rowIs(0, (row) => row.status === 'waiting', 'waits');
    for (const [width, height] of [[900, 700], [1100, 700], [1280, 720], [1600, 1000]]) {
      await page.page.setViewportSize({width, height});
      await page.redrawn();
      const [name, box] = await page.page.evaluate(() => {
        const {clientWidth, scrollWidth} = document.querySelector('#table-box');
        return [document.querySelector('td.photo').clientWidth, scrollWidth - clientWidth];
      });
      assert.ok(name >= 80, `${name} pixels are left for names of photos at ${width} x ${height}`);
      if (width >= 1280) assert.ok(box <= 1, `the table is ${box} pixels too wide at ${width}`);
      await screenshot(page.page, `pick-names-${width}`);
    }
  }, {picksFile: fileOf(places.slice(0, 6)), models: []});
});

test('every control has a name, and shows when it has the focus', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    const nameless = await page.page.evaluate(
        () => [...document.querySelectorAll('button, input, select, [tabindex], [role]')]
                  .filter((one) => one.checkVisibility() && !one.closest('[aria-hidden="true"]'))
                  .filter((one) => {
                    const label = one.closest('label') ??
                        (one.id && document.querySelector(`label[for="${one.id}"]`));
                    return !(
                        one.getAttribute('aria-label') || one.getAttribute('aria-labelledby') ||
                        label?.textContent.trim() || one.textContent.trim() ||
                        one.getAttribute('role') === 'status');
                  })
                  .map((one) => one.outerHTML));
    assert.deepEqual(nameless, []);
    // Through the whole page by Tab: each stop shows it.
    const stops = new Set();
    for (let press = 0; press < 80; ++press) {
      await page.page.keyboard.press('Tab');
      const stop = await page.page.evaluate(() => {
        const one = document.activeElement;
        if (one === document.body) return null;
        const around = getComputedStyle(one);
        const ring = getComputedStyle(one, '::after');
        const shown = (around.outlineStyle !== 'none' && parseFloat(around.outlineWidth) >= 1) ||
            parseFloat(ring.borderTopWidth) >= 2 || around.backgroundColor === 'rgb(125, 125, 125)';
        return {name: one.id || one.getAttribute('aria-label') || one.textContent, shown};
      });
      if (!stop) continue;
      assert.ok(stop.shown, `${stop.name} does not show the focus`);
      stops.add(stop.name);
    }
    for (const name
             of ['photo-pane', 'scan-pane', 'divider', 'thumbs', 'align-open', 'gamma', 'Pick 1']) {
      assert.ok(stops.has(name), `${name} is not reached by Tab: ${[...stops]}`);
    }
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('tiles: few at a time, and those out of view are given up', async () => {
  await pageOn(async (page) => {
    await page.page.waitForLoadState('networkidle');
    // Held back here, so that they pile up as over a slow line.
    let asked = 0, givenUp = 0;
    let holding = true;
    const held = [];
    await page.page.route('**/tile?*', async (route) => {
      ++asked;
      if (holding) await new Promise((go) => held.push(go));
      await route.continue().catch(() => {});  // it may have been given up meanwhile
    });
    page.page.on('requestfailed', (request) => {
      givenUp += /tile\?/.test(request.url());
    });
    const isEmpty = async () => {
      const [color] = await colorsAt(page, 'scan', [[400.5, 200.5]]);
      return distance(color, [214, 214, 212]) === 0;  // --picture of theme.css, light
    };
    await page.page.selectOption('#scan-picture', 'local');
    await until(() => asked === 3, 'tiles of the other picture are asked for');
    for (let frame = 0; frame < 5; ++frame) await page.redrawn();
    assert.equal(asked, 3, 'three at a time, the picks do not wait behind them');
    assert.ok(await isEmpty());
    await page.page.selectOption('#scan-picture', 'shaded');
    await until(() => givenUp >= 3, 'those of the first are given up');
    assert.ok(await isEmpty());
    holding = false;
    for (const go of held) go();
    await until(async () => !await isEmpty(), 'the tiles of the second have come');
  });
});

test('with reduced motion B changes the picture once for each press', async () => {
  await pageOn(async (page) => {
    await page.page.emulateMedia({reducedMotion: 'reduce'});
    await page.rowsAre(8);
    const where = places.slice(0, 8).map((place) => place.scan);
    const saturation = async () =>
        Math.max(...(await colorsAt(page, 'scan', where))
                     .map((color) => Math.max(...color) - Math.min(...color)));
    await until(() => page.page.isEnabled('#back-mode'), 'there is a solution');
    await page.page.focus('#scan-pane');
    for (let press = 0; press < 2; ++press) {
      await page.page.keyboard.press('b');
      await until(async () => await saturation() > 30, 'the photo');
      await page.page.keyboard.press('b');
      await until(async () => await saturation() < 4, 'the scan');
    }
  }, {picksFile: fileOf(places.slice(0, 8))});
});
