// roomtex-pick in a browser, on a simulated room: by mouse and by keys, as its user works.

import assert from 'node:assert/strict';
import {readFileSync, writeFileSync} from 'node:fs';
import {after, before, test} from 'node:test';

import {isSlowRun, launchBrowser, run, screenshot} from './browser.mjs';
import {capture, colorsAt, distance, fileOf, kSampleSpacing, lowestContrast, onPage, PickPage, servePicks, until, usablePlaces} from './pick_page.mjs';

let browser;
let places;  // of the photo that suits best, those that can be picked
let other_places;

const pageOn = (body, options = {}) =>
    onPage(browser, body, {image_name: places[0].image_name, ...options});

// Of an aligned model against the truth, by roomtex-evaluate.
async function posesOf(aligned) {
  const result = await run(
      'roomtex-evaluate', ['--truth_path', capture('capture', 'truth'), '--input_path', aligned]);
  assert.equal(result.code, 0, result.stderr);
  return JSON.parse(result.stdout).poses;
}

before(async () => {
  browser = await launchBrowser();
  ({places, other_places} = await usablePlaces());
});

after(async () => {
  await browser.close();
});

test('six pairs by mouse: numbers come, the file follows every step', async () => {
  await pageOn(async (page) => {
    assert.equal(page.file().length, 0);
    for (const [index, place] of places.slice(0, 6).entries()) {
      // Either side first.
      const sides = index % 2 === 0 ? ['photo', 'scan'] : ['scan', 'photo'];
      await page.click(sides[0], place[sides[0] === 'photo' ? 'img' : 'scan']);
      await page.rowIs(index, (row) => row.status === 'half', 'half finished');
      await page.saved();
      assert.equal(page.file().length, index, 'half a pick is not written');
      if (index === 5) await watchForResiduals(page.page);
      await page.click(sides[1], place[sides[1] === 'photo' ? 'img' : 'scan']);
      await page.rowIs(index, (row) => row.status !== 'half', 'completed');
      await page.saved();
      const picks = page.file();
      assert.equal(picks.length, index + 1);
      assert.equal(picks[index].image_name, place.image_name);
      assert.ok(distance(picks[index].img, place.img) < 0.5, `${picks[index].img}`);
      assert.ok(distance(picks[index].point, place.point) < kSampleSpacing);
    }
    const milliseconds =
        await until(() => page.page.evaluate(() => window.residualsAfter), 'the sixth residual');
    console.log(
        `from the sixth click to its residual on the screen: ${milliseconds.toFixed(0)} ms`);
    await until(async () => (await page.rows()).every((row) => row.status === 'used'), 'all used');
    for (const row of await page.rows()) {
      assert.ok(row.px !== null && row.px < 2.5, `pick ${row.number}: ${row.px} px`);
      assert.ok(row.mm !== null && row.mm < 30, `pick ${row.number}: ${row.mm} mm`);
      assert.ok(row.leftOut !== null && row.leftOut >= row.px);
    }
    assert.match(await page.text('#summary-body'), /6 used of 6/);
    assert.match(await page.text('#photo-fit'), /px rms/);
    await page.page.click('#photo-whole');
    await page.page.click('#scan-whole');
    await screenshot(page.page, 'pick-six');
  });
});

// Notes the time from the next mouse button that is let go until pick 6 has a residual.
function watchForResiduals(page) {
  return page.evaluate(() => {
    let released = 0;
    addEventListener('pointerup', () => {
      released = performance.now();
    }, true);
    new MutationObserver(() => {
      const cell = document.querySelector('#rows tr:nth-child(6) .value');
      if (released === 0 || window.residualsAfter || !/\d/.test(cell?.textContent)) return;
      requestAnimationFrame(() => {
        window.residualsAfter = performance.now() - released;
      });
    })
        .observe(
            document.querySelector('#rows'), {subtree: true, childList: true, characterData: true});
  });
}

test('a pick dragged far off is marked, dragged back it is good again; undo and redo', async () => {
  const first = places.slice(0, 8);
  await pageOn(async (page) => {
    await page.rowsAre(8);
    const from = first[2].img;
    const to = [from[0] < 480 ? from[0] + 60 : from[0] - 60, from[1]];
    let onTheWay = null;
    await page.page.click('#photo-whole');
    await page.drag('photo', from, to, async () => {
      // The numbers follow before the button is let go.
      onTheWay = await page.rowIs(2, (row) => row.px > 10, 'its residual grows');
    });
    assert.ok(onTheWay);
    await page.saved();
    const bad = await page.rowIs(
        2, (row) => row.leftOut > 30 && (row.status === 'bad' || /worst/.test(row.state)),
        'marked');
    assert.match(bad.state, /✕|▲/, 'not by colour alone');
    assert.ok(distance(page.file()[2].img, to) < 2.5, `${page.file()[2].img}`);
    const far = page.file()[2].img;
    await screenshot(page.page, 'pick-far');

    await page.drag('photo', far, from);
    await page.rowIs(2, (row) => row.status === 'used' && row.px < 5, 'good again');
    await page.saved();
    assert.ok(distance(page.file()[2].img, from) < 2.5);

    await page.page.keyboard.press('Control+z');
    await page.rowIs(2, (row) => row.leftOut > 30, 'far again');
    await page.saved();
    assert.deepEqual(page.file()[2].img, far);
    await page.page.keyboard.press('Control+z');
    await page.rowIs(2, (row) => row.status === 'used', 'as in the file');
    await page.saved();
    assert.ok(distance(page.file()[2].img, from) < 1e-6);
    assert.ok(await page.page.isDisabled('#undo'));
    await page.page.keyboard.press('Control+Shift+Z');
    await page.rowIs(2, (row) => row.leftOut > 30, 'far once more');
    await page.page.keyboard.press('Control+y');
    await page.rowIs(2, (row) => row.status === 'used', 'back once more');
    assert.ok(await page.page.isDisabled('#redo'));
    await page.saved();
  }, {picksFile: fileOf(first)});
});

test('a point in the scan is dragged: the new place counts; undo brings back the old', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(7);
    const [x, y] = places[1].scan;
    const ask = async (to) => (await fetch(`${page.url}scan_point?scan=0&x=${to}&y=${y}`)).json();
    let to = x + 3;
    let answers = [];
    do {
      assert.ok(++to < x + 30, 'no place beside it can be picked');
      answers = await Promise.all([to - 0.4, to, to + 0.4].map(ask));
    } while (!answers.every((answer) => answer.ok));
    await page.zoomTo('scan', places[1].scan);
    await page.drag('scan', [x, y], [to, y]);
    await until(
        () => distance(page.file()[1].point, answers[1].point) < kSampleSpacing / 2,
        'the point of where it was dropped');
    await page.page.keyboard.press('Control+z');
    await until(() => distance(page.file()[1].point, places[1].point) < 1e-6, 'as in the file');
    await page.saved();
  }, {picksFile: fileOf(places.slice(0, 7))});
});

test('off and on, remove and bring back, next and previous', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(7);
    await page.page.focus('#photo-pane');
    for (let step = 0; step < 3; ++step) await page.page.keyboard.press('n');
    await page.rowIs(2, (row) => row.selected, 'selected by the third N');
    const view = await page.view('photo');
    assert.ok(distance(view.centre, places[2].img) < 0.01, 'in the middle of the photo');
    assert.ok(distance((await page.view('scan')).centre, places[2].scan) < 2, 'and of the scan');
    await page.page.keyboard.press('p');
    await page.rowIs(1, (row) => row.selected, 'selected by P');

    await page.page.keyboard.press('x');
    await page.rowIs(1, (row) => row.status === 'off' && !row.on, 'off');
    await page.saved();
    assert.deepEqual(page.file().map((pick) => pick.weight), [1, 0, 1, 1, 1, 1, 1]);
    await page.page.keyboard.press('x');
    await page.rowIs(1, (row) => row.status === 'used' && row.on, 'on');
    await page.saved();
    assert.ok(page.file().every((pick) => pick.weight === 1));
    // The same by mouse.
    await page.page.locator('#rows tr').nth(3).locator('input[type=checkbox]').click();
    await page.rowIs(3, (row) => row.status === 'off', 'off by its box');
    await page.saved();
    assert.equal(page.file()[3].weight, 0);
    await page.page.locator('#rows tr').nth(3).locator('input[type=checkbox]').click();
    await page.rowIs(3, (row) => row.status === 'used', 'on by its box');

    const earlier = page.file();
    await page.page.focus('#photo-pane');
    await page.page.keyboard.press('Delete');
    await page.rowsAre(6);
    await page.saved();
    assert.deepEqual(page.file(), earlier.filter((pick, index) => index !== 1));
    await page.page.keyboard.press('Control+z');
    await page.rowsAre(7);
    await page.saved();
    assert.deepEqual(page.file(), earlier);
  }, {picksFile: fileOf(places.slice(0, 7))});
});

test('the missing half is predicted near the truth, and taken by Enter', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    const place = places[6];
    await page.click('photo', place.img);
    await page.rowIs(6, (row) => row.status === 'half', 'half finished');
    await page.saved();
    const ghost =
        await until(async () => (await page.session()).picks[6].predicted_scan, 'a prediction');
    assert.ok(
        distance([ghost.x, ghost.y], place.scan) < 4, `${ghost.x}, ${ghost.y}: ${place.scan}`);
    await page.page.click('#scan-whole');
    await page.redrawn();
    await screenshot(page.page, 'pick-half');
    await page.page.focus('#photo-pane');
    // A prediction on a depth edge is refused, and the nearest place offered.
    await page.pressUntil(
        'Enter',
        async () => (await page.rows())[6].status !== 'half' ||
            await page.page.locator('#hint').isVisible(),
        'taken or refused');
    if ((await page.rows())[6].status === 'half') await page.page.keyboard.press('Enter');
    await page.rowIs(6, (row) => row.status === 'used', 'completed by the prediction');
    await page.saved();
    assert.ok(distance(page.file()[6].point, place.point) < 3 * kSampleSpacing);

    // The other way round: from the scan into the photo.
    await page.click('scan', places[7].scan);
    await page.rowIs(7, (row) => row.status === 'half', 'half finished');
    await page.saved();
    const inPhoto =
        await until(async () => (await page.session()).picks[7].predicted_img, 'a prediction');
    assert.ok(distance(inPhoto, places[7].img) < 5, `${inPhoto}: ${places[7].img}`);
    await page.pressUntil(
        'Enter', async () => (await page.rows())[7].status === 'used',
        'completed by the prediction');
    await page.saved();
    assert.ok(distance(page.file()[7].img, places[7].img) < 5);
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('Enter takes no prediction of a place that was moved since', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.click('photo', places[6].img);
    await page.rowIs(6, (row) => row.status === 'half', 'half finished');
    await page.saved();
    await until(async () => (await page.session()).picks[6].predicted_scan, 'a prediction');
    let answer;
    const isTime = new Promise((done) => {
      answer = done;
    });
    await page.page.route('**/picks', async (route) => {
      await isTime;
      await route.continue();
    });
    await page.page.click('#scan-whole');
    await page.page.focus('#photo-pane');
    for (let i = 0; i < 5; ++i) await page.page.keyboard.press('ArrowRight');
    await page.page.keyboard.press('Enter');
    await until(
        async () => /Nothing is predicted here yet/.test(await page.text('#toast')), 'it says so');
    answer();
    await page.saved();
    assert.equal((await page.rows())[6].status, 'half');
    assert.equal(page.file().length, 6);
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('reloading the page goes on with the picks, and so does a new server', async () => {
  await pageOn(async (page, {picksPath}) => {
    await page.rowsAre(6);
    await page.pick(places[6]);
    await page.rowIs(6, (row) => row.px !== null, 'has its numbers');
    const earlier = (await page.rows()).map(({photo, px, status}) => [photo, px, status]);
    const file = page.file();
    await page.page.reload();
    await page.page.waitForSelector('body[data-ready]');
    await page.rowsAre(7);
    await page.rowIs(6, (row) => row.px !== null, 'has its numbers');
    assert.deepEqual(
        (await page.rows()).map(({photo, px, status}) => [photo, px, status]), earlier);
    assert.deepEqual(page.file(), file);
    // What was done before the page was loaded anew can still be undone, and done again.
    await page.page.keyboard.press('Control+z');
    await page.rowIs(6, (row) => row.status === 'half', 'its second half is undone');
    await page.page.keyboard.press('Control+z');
    await page.rowsAre(6);
    await page.page.keyboard.press('Control+y');
    await page.page.keyboard.press('Control+y');
    await page.rowIs(6, (row) => row.px !== null, 'is back');
    await page.saved();
    assert.deepEqual(page.file(), file);
    await page.page.keyboard.press('c');
    await until(async () => /corner/.test(await page.text('#toast')), 'a corner, or that there is none');
    const second = await servePicks(picksPath);
    const again = await PickPage.open(browser, second, picksPath);
    await again.rowsAre(7);
    await until(async () => (await again.rows())[6].px !== null, 'numbers');
    const [row] = (await again.rows()).slice(6);
    assert.ok(Math.abs(row.px - earlier[6][1]) < 0.02, `${row.px} after ${earlier[6][1]}`);
    assert.deepEqual(again.errors(), []);
    await again.close();
    assert.equal(await second.stop(), 0);
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('picks in a second photo', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    const name = other_places[0].image_name;
    await page.page.fill('#filter', name);
    await until(
        async () => await page.page.locator('.thumb:visible').count() === 1, 'one thumbnail');
    await page.page.locator('.thumb:visible').click();
    await until(async () => (await page.text('#photo-name')).replace('\u200e', '') === name, 'the photo is chosen');
    await page.page.fill('#filter', '');
    await page.pick(other_places[0]);
    await page.pick(other_places[1]);
    const row = await page.rowIs(7, (one) => one.status === 'used', 'used');
    assert.equal(row.photo, name);
    assert.ok(row.px < 8, `${row.px}`);
    assert.equal(page.file().filter((pick) => pick.image_name === name).length, 2);
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('to look at another photo is no step of the history', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.click('scan', places[6].scan);
    const {photo} = await page.rowIs(6, (row) => row.status === 'half', 'half finished');
    await page.saved();
    assert.match(await page.text('#save'), /saved, but for 1 unfinished/);
    const step = await page.page.getAttribute('#undo', 'title');
    await page.page.keyboard.press('PageDown');
    await page.rowIs(6, (row) => row.photo !== photo, 'goes along');
    assert.equal(await page.page.getAttribute('#undo', 'title'), step);
    await page.page.keyboard.press('Control+z');
    await page.rowsAre(6);
    await page.page.keyboard.press('PageUp');
    await page.page.keyboard.press('Control+y');
    await page.rowIs(6, (row) => row.photo === photo, 'again, in the photo that is shown');
    await page.saved();
    await page.page.keyboard.press('Control+z');
    await page.rowsAre(6);
    await page.saved();
    assert.match(await page.text('#save'), /saved$/);
  }, {picksFile: fileOf(places.slice(0, 6))});
});

test('two scans: what is predicted in the other one is taken there', async () => {
  const more = [
    '--scan_path',
    capture('capture', 'scan_1.rtpi'),
    '--scan_poses',
    capture('capture', 'scan_poses.txt'),
  ];
  await pageOn(async (page) => {
    await page.rowsAre(6);
    const select = page.page.locator('#scan-select');
    assert.deepEqual(await select.locator('option').allInnerTexts(), ['scan.rtpi', 'scan_1.rtpi']);
    await page.click('photo', places[6].img);
    const ghost =
        await until(async () => (await page.session()).picks[6]?.predicted_scan, 'a prediction');
    await page.saved();
    await select.selectOption(String(1 - ghost.id));
    await page.redrawn();
    await screenshot(page.page, 'pick-two-scans');
    await page.page.focus('#scan-pane');
    await page.pressUntil(
        'Enter', async () => await select.inputValue() === String(ghost.id), 'the other scan');
    await until(
        async () => (await page.rows())[6].status !== 'half' ||
            await page.page.locator('#hint').isVisible(),
        'taken or refused');
    if ((await page.rows())[6].status === 'half') await page.page.keyboard.press('Enter');
    await page.rowIs(6, (row) => row.status === 'used', 'used');
    await page.saved();
    // The point is in the frame of the first scan, whichever scan it was picked in.
    assert.ok(distance(page.file()[6].point, places[6].point) < 3 * kSampleSpacing);
  }, {picksFile: fileOf(places.slice(0, 6)), more});
});

test('one pick by the keyboard alone', async () => {
  await pageOn(async (page) => {
    const {page: window} = page;
    const place = places[0];
    // The photo has the focus from the start; Tab and W lead to the other pane.
    assert.equal(await window.evaluate(() => document.activeElement.id), 'photo-pane');
    for (const [side, target] of [['photo', place.img], ['scan', place.scan]]) {
      if (side === 'scan') await window.keyboard.press('w');
      assert.equal(await window.evaluate(() => document.activeElement.id), `${side}-pane`);
      await steerCrosshair(page, side, target);
      await window.keyboard.press(side === 'photo' ? 'Space' : 'Enter');
    }
    await page.rowIs(0, (row) => row.status !== 'half', 'completed');
    await page.saved();
    const [pick] = page.file();
    assert.ok(distance(pick.img, place.img) < 1, `${pick.img}: ${place.img}`);
    assert.ok(distance(pick.point, place.point) < 2 * kSampleSpacing);
    // Then the arrows move the selected point: by one pixel, with Shift by a tenth.
    await window.keyboard.press('w');
    await window.keyboard.press('ArrowRight');
    await window.keyboard.press('Shift+ArrowDown');
    await page.saved();
    await until(
        () => distance(page.file()[0].img, [pick.img[0] + 1, pick.img[1] + 0.1]) < 1e-9,
        'moved by 1 and 0.1');
  });
});

// By arrow keys, first coarsely, then with Shift; the loupe says where the crosshair is.
async function steerCrosshair(page, side, target) {
  const {page: window} = page;
  const loupe = window.locator(`#${side}-loupe`);
  const press = async (key, times) => {
    for (let i = 0; i < times; ++i) await window.keyboard.press(key);
    await page.redrawn();
    return [Number(await loupe.getAttribute('data-x')), Number(await loupe.getAttribute('data-y'))];
  };
  for (const shift of ['', 'Shift+', 'Shift+']) {
    for (const [axis, minus, plus] of [
             [0, 'ArrowLeft', 'ArrowRight'], [1, 'ArrowUp', 'ArrowDown']]) {
      const one = await press(shift + plus, 1);
      const two = await press(shift + minus, 1);
      const step = one[axis] - two[axis];
      const count = Math.round((target[axis] - two[axis]) / step);
      await press(shift + (count > 0 ? plus : minus), Math.abs(count));
    }
    await press('+', 4);
  }
}

test('Align says trusted, and the model lies where it should', async () => {
  await pageOn(async (page, {folder}) => {
    await page.rowsAre(8);
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.match(await page.text('#align .verdict'), /✓\s*Trusted/);
    assert.ok((await page.text('#align .headline')).length > 10);
    assert.match(await page.text('#align code'), /roomtex-align .*--picks_path/);
    assert.ok(await page.page.locator('#align .facts dt').count() > 0);
    const overlays = page.page.locator('#align .overlays button');
    assert.ok(await overlays.count() > 0);
    await overlays.first().click();
    await page.page.waitForSelector('#large[open] img');
    await until(
        () => page.page.evaluate(() => document.querySelector('#large img').naturalWidth > 300),
        'the overlay');
    await page.page.keyboard.press('Escape');
    await until(async () => !await page.page.isVisible('#large'), 'Escape closes it');
    await screenshot(page.page, 'pick-align');
    assert.ok((await lowestContrast(page.page, '#align')).ratio >= 4.5);
    const poses = await posesOf(folder.path('aligned'));
    assert.equal(poses.num_registered, 12);
    assert.ok(poses.position_median_mm < 10, `${poses.position_median_mm} mm`);
    assert.ok(poses.rotation_median_deg < 0.15, `${poses.rotation_median_deg} degrees`);
    // The focus stays in the dialog and comes back afterwards.
    for (let press = 0; press < 12; ++press) {
      await page.page.keyboard.press('Tab');
      assert.ok(
          await page.page.evaluate(
              () => document.activeElement === document.body ||
                  document.activeElement.closest('#align') !== null),
          'the focus is trapped');
    }
    await page.page.keyboard.press('Escape');
    await until(async () => !await page.page.isVisible('#align'), 'Escape closes the dialog');
    assert.equal(await page.page.evaluate(() => document.activeElement.id), 'align-open');
  }, {picksFile: fileOf(places.slice(0, 8))});
});

test('picks that are wrong are refused in words', async () => {
  const wrong = places.slice(0, 6).map((place) => ({...place}));
  [wrong[0].img, wrong[3].img] = [wrong[3].img, wrong[0].img];
  [wrong[1].img, wrong[4].img] = [wrong[4].img, wrong[1].img];
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    const text = await page.text('#align .verdict');
    assert.match(text, /Not trusted|Failed/);
    assert.match(text, /▲|✕/);
    assert.match(await page.text('#align .headline'), /\w+ \w+ \w+/);
    await screenshot(page.page, 'pick-refused');
  }, {picksFile: fileOf(wrong)});
});

test('six pairs in two photos are enough', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await until(async () => (await page.rows()).every((row) => row.px !== null), 'all are solved');
    for (const row of await page.rows()) {
      assert.ok(row.px < 2.5, `pick ${row.number}: ${row.px} px`);
    }
    assert.match(await page.text('#summary-body'), /px rms in 2 photos/);
    assert.match(await page.text('#next'), /Enough picks/);
    await screenshot(page.page, 'pick-spread');
  }, {picksFile: fileOf([...places.slice(0, 3), ...other_places.slice(0, 3)])});
});

test('two sparse models: each is placed by the pairs in its photos', async () => {
  await pageOn(async (page, {folder}) => {
    await page.rowsAre(9);
    const second = capture('second');
    await until(
        async () => (await page.text('#next')).includes(second), 'the second model needs more');
    assert.match(await page.text('#next'), /3 more pairs to go, in this photo or in others of /);
    assert.match(await page.text('#summary-body'), /6 used of 6[^]*Scale/);
    const labels = await page.page.locator('.thumb .badge.model').allInnerTexts();
    assert.equal(labels.length, 12);
    const isOf = (name) => labels.filter((label) => label.endsWith(`/${name}`)).length;
    assert.deepEqual([isOf('first'), isOf('second')], [6, 6], labels.join());
    await page.page.fill('#filter', '/second');
    await until(
        async () => await page.text('#strip-count') === '6 of 12', 'the second model\u2019s');
    await page.page.fill('#filter', '');
    await page.page.click('#align-open');
    assert.match(
        await page.text('#align .body'), /needs 6 picks; there are 3 so far in photos of .*second/);
    await page.page.keyboard.press('Escape');
    await page.page.locator(`.thumb[title^="${other_places[0].image_name}:"]`).click();
    for (const place of other_places.slice(3, 6)) await page.pick(place);
    await until(
        async () => /^Enough picks/.test(await page.text('#next')), 'both models have enough');
    await screenshot(page.page, 'pick-two-models');
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.match(await page.text('#align .verdict'), /Trusted/);
    await screenshot(page.page, 'pick-two-models-aligned');
    const poses = await posesOf(folder.path('aligned'));
    assert.equal(poses.num_registered, 12);
    assert.ok(poses.position_max_mm < 15, `${poses.position_max_mm}`);
  }, {
    models: ['first', 'second'],
    picksFile: fileOf([...places.slice(0, 6), ...other_places.slice(0, 3)]),
  });
});

test('photos alone: each is solved by its own pairs, and aligned', async () => {
  const [camera] = readFileSync(capture('capture', 'cameras.txt'), 'utf8')
                       .split('\n')
                       .filter((line) => line && line[0] !== '#');
  const [, model, , , ...params] = camera.trim().split(' ');
  await pageOn(async (page) => {
    await page.rowsAre(6);
    await until(async () => (await page.rows()).every((row) => row.px !== null), 'all are solved');
    const summary = await page.text('#summary-body');
    assert.match(summary, /its own picks/);
    assert.doesNotMatch(summary, /Scale/);
    await until(
        async () => /Enough picks for this photo/.test(await page.text('#next')), 'enough picks');
    await screenshot(page.page, 'pick-alone');
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.match(await page.text('#align .verdict'), /^✓\s*Trusted/);
    await screenshot(page.page, 'pick-alone-aligned');
  }, {
    models: [],
    picksFile: fileOf(places.slice(0, 6)),
    more: ['--camera_model', model, '--camera_params', params.join(',')],
  });
});

test('too few picks: Align says so without running', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(3);
    await page.page.click('#align-open');
    assert.match(await page.text('#align .body'), /needs 6 picks; there are 3/);
  }, {picksFile: fileOf(places.slice(0, 3))});
});

// Presses Find it for me, and waits for what it says.
async function findIt(page) {
  await page.page.click('#align-open');
  const button = page.page.locator('#align .body button', {hasText: 'Find it for me'});
  await button.waitFor();
  await screenshot(page.page, 'pick-find');
  await button.click();
  await page.page.waitForSelector('#align .verdict', {timeout: 240000});
}

// This one and the undecided search below: run by the test pick_search.
test('a few picks: the place is found by them', {skip: !isSlowRun}, async () => {
  await pageOn(async (page) => {
    await page.rowsAre(4);
    await findIt(page);
    await screenshot(page.page, 'pick-found');
    assert.match(await page.text('#align .verdict'), /Trusted/);
  }, {picksFile: fileOf(places.slice(0, 4))});
});

const upperQuartile = (numbers) => [...numbers].sort((a, b) => a - b)[Math.floor(0.75 * numbers.length)];

test('without a pick: found, and seen on the scan until picks place the photo', async () => {
  await pageOn(async (page, {folder}) => {
    const eight = places.slice(0, 8);
    const onScan = () => colorsAt(page, 'scan', eight.map(({scan}) => scan));
    const onPhoto = () => colorsAt(page, 'photo', eight.map(({img}) => img));
    assert.ok(await page.page.isDisabled('#back-mode'), 'nothing says where the photos are');
    await findIt(page);
    const first = readFileSync(folder.path('aligned', 'alignment.json'), 'utf8');
    await page.page.locator('#align footer button', {hasText: 'Run again'}).click();
    await page.page.waitForSelector('#align progress');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.notEqual(readFileSync(folder.path('aligned', 'alignment.json'), 'utf8'), first);
    assert.match(await page.text('#align .verdict'), /Trusted/);
    assert.doesNotMatch(await page.text('#align code'), /--picks_path/);
    assert.doesNotMatch(await page.text('#align .body'), /One pair decides/);
    await screenshot(page.page, 'pick-searched');
    const poses = await posesOf(folder.path('aligned'));
    assert.equal(poses.num_registered, 12);
    assert.ok(poses.position_max_mm < 15, `${poses.position_max_mm}`);

    await page.page.locator('#align button', {hasText: 'Look at them'}).click();
    await until(async () => !await page.page.isVisible('#align'), 'the dialog makes way');
    assert.equal(await page.page.inputValue('#back-mode'), 'over');
    assert.match(await page.text('#photo-fit'), /^placed by the search$/);
    assert.match(await page.text('#scan-legend'), /^placed by the search$/);
    assert.match(await page.text('#summary-body'), /the search, trusted/);
    assert.match(await page.text('#next'), /The search has placed the photos/);
    await until(async () => /crease/.test(await page.text('#photo-legend')), 'edges on the photo');
    await page.redrawn();
    await screenshot(page.page, 'pick-searched-over');
    // Left of the line lies the photo, and each place of it where the scan has it.
    const differences = async () => {
      const [scan, photo] = [await onScan(), await onPhoto()];
      return scan.map((color, i) => distance(color, photo[i]));
    };
    await page.page.locator('#edges').uncheck();
    await page.page.selectOption('#back-mode', 'swipe');
    await page.page.locator('#back-range').fill('0');
    await until(async () => upperQuartile(await differences()) > 60, 'the scan itself is another');
    await page.page.locator('#back-range').fill('100');
    await until(async () => upperQuartile(await differences()) < 40, 'the photo lies on the scan');
    await page.page.locator('#back-range').fill('80');
    await page.redrawn();
    await screenshot(page.page, 'pick-searched-swipe');

    // Picks of one's own take over, and give way again. (A tile that is asked for while a pick is
    // set is not found any more.)
    await page.page.selectOption('#back-mode', 'off');
    for (const place of places.slice(0, 4)) await page.pick(place);
    await until(
        async () => /^placed by your picks, .* px rms$/.test(await page.text('#photo-fit')),
        'by the picks');
    await until(
        async () => /its own picks/.test(await page.text('#summary-body')), 'by its own picks');
    for (let index = 3; index >= 0; --index) {
      await page.page.locator('#rows tr').nth(index).locator('button.icon').click();
    }
    await until(
        async () => await page.text('#photo-fit') === 'placed by the search', 'by the search again');
  });
});

test('an undecided search asks for one pair, and goes on with it', {skip: !isSlowRun}, async () => {
  await pageOn(async (page, {folder}) => {
    await findIt(page);
    assert.match(await page.text('#align .verdict'), /Not trusted/);
    const body = await page.text('#align .body');
    const [, name] = /One pair decides: click a corner in (\S+) /.exec(body) ?? [];
    assert.ok(name, body);
    assert.doesNotMatch(body, /six pairs/i);
    await screenshot(page.page, 'pick-undecided');
    assert.ok((await lowestContrast(page.page, '#align')).ratio >= 4.5);
    await page.page.locator('#align button', {hasText: 'Set the pair'}).click();
    await until(async () => !await page.page.isVisible('#align'), 'the dialog makes way');
    assert.equal((await page.text('#photo-name')).replace('\u200e', ''), name);
    assert.equal(await page.text('#photo-fit'), 'placed by the search, not trusted');
    assert.ok((await page.text('#next')).endsWith(`set it in ${name}.`));
    // In another photo it does as well. Where the search has the other half is not shown.
    await page.page.locator(`.thumb[title^="${places[0].image_name}:"]`).click();
    await page.click('photo', places[0].img);
    await page.rowIs(0, (row) => row.status === 'half', 'half');
    await page.saved();
    const [half] = (await page.session()).picks;
    assert.equal(half.predicted_scan, null);
    await screenshot(page.page, 'pick-undecided-half');
    await page.click('scan', places[0].scan);
    await page.page.waitForSelector('#align[open] progress');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.match(await page.text('#align .verdict'), /Trusted/);
    assert.doesNotMatch(await page.text('#align .verdict'), /Not trusted/);
    assert.match(await page.text('#align code'), /--picks_path/);
    await screenshot(page.page, 'pick-confirmed');
    const poses = await posesOf(folder.path('aligned'));
    assert.ok(poses.position_max_mm < 30, `${poses.position_max_mm}`);
    await page.page.keyboard.press('Escape');
    const [row] = await page.rows();
    assert.ok(row.px < 5, `the pick is ${row.px} px from where the search has it`);
    assert.equal(row.state, 'compared with the search');
    assert.equal(await page.text('#photo-fit'), 'placed by the search');
  }, {scan: capture('blank.rtpi')});
});

test('Align can be cancelled, and run again', async () => {
  await pageOn(async (page) => {
    await page.rowsAre(8);
    await page.page.click('#align-open');
    const cancel = page.page.locator('#align footer button', {hasText: 'Cancel'});
    await cancel.click();
    await until(async () => /Cancelled/.test(await page.text('#align .body')), 'it says so');
    await until(async () => {
      const answer = await (await fetch(`${page.url}align`)).json();
      return answer.state !== 'running';
    }, 'it has ended');
    await page.page.keyboard.press('Escape');
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    assert.match(await page.text('#align .verdict'), /Trusted/);
  }, {picksFile: fileOf(places.slice(0, 8))});
});

test('labels and check points: their errors are shown, nothing rests on them', async () => {
  const eight = places.slice(0, 8);
  // A check point that is far off changes nothing.
  const wrong = {...eight[7], img: [eight[7].img[0] + 25, eight[7].img[1]]};
  await pageOn(async (page) => {
    await until(async () => (await page.rows())[7]?.px > 0, 'numbers');
    for (const index of [6, 7]) {
      await page.page.locator('#rows tr').nth(index).locator('input[type=checkbox]').uncheck();
      await page.rowIs(index, (row) => row.status === 'off', 'a check point');
    }
    const label = page.page.locator('#rows tr').nth(7).locator('.label');
    await label.fill('lamp, left');
    await label.press('Enter');
    await page.saved();
    await until(() => page.file().length === 8, 'eight picks in the file');
    const lines = readFileSync(page.picksPath, 'utf8').trim().split('\n');
    assert.match(lines[0], /,weight,label$/);
    assert.match(lines[8], /,0,"lamp, left"$/);
    const rows = await page.rows();
    assert.ok(rows.slice(0, 6).every(({px}) => px < 2.5));
    assert.ok(rows[6].px < 4, `${rows[6].px}`);
    assert.ok(rows[7].px > 20 && rows[7].px < 30, `${rows[7].px}`);
    assert.match(await page.text('#summary-body'), /Check points\s+2, off by/);
    await screenshot(page.page, 'pick-check-points');
    await page.page.reload();
    await page.page.waitForSelector('body[data-ready]');
    await page.rowIs(7, (row) => row.label === 'lamp, left' && !row.on, 'is there again');
  }, {picksFile: fileOf([...eight.slice(0, 7), wrong])});
});

test('targets with coordinates need a click in the photo only', async () => {
  const six = places.slice(0, 6);
  const csv = ['label;x;y;z', ...six.map(({point}, i) => [`T${i + 1}`, ...point].join(';'))];
  await pageOn(async (page, {folder}) => {
    const load = async (name, text) => {
      writeFileSync(folder.path(name), text);
      const chosen = page.page.waitForEvent('filechooser');
      await page.page.click('#targets');
      await (await chosen).setFiles(folder.path(name));
    };
    await load('broken.csv', 'T1,1,2\n');
    await until(async () => /Line 1 is "T1,1,2"/.test(await page.text('#toast')), 'the sentence');
    await load('targets.csv', csv.join('\n'));
    await page.rowsAre(6);
    await screenshot(page.page, 'pick-targets');
    for (const [index, place] of six.entries()) {
      await page.rowIs(index, (row) => row.status === 'half', 'waits');
      await page.click('photo', place.img);
      await page.rowIs(index, (row) => row.status !== 'half', 'completed');
    }
    await until(async () => (await page.rows()).every((row) => row.status === 'used'), 'all used');
    await page.saved();
    const file = page.file();
    assert.deepEqual(file.map(({label}) => label), ['T1', 'T2', 'T3', 'T4', 'T5', 'T6']);
    file.forEach(({point}, i) => assert.ok(distance(point, six[i].point) < 1e-9));

    // Neither arrows nor the mouse move what the file has said.
    const saysWhy = async () => {
      await until(async () => /that of its file/.test(await page.text('#toast')), 'it says why');
      await page.saved();
      assert.deepEqual(page.file(), file);
    };
    await page.page.keyboard.press('w');
    await page.page.keyboard.press('ArrowRight');
    await saysWhy();
    await page.page.reload();
    await page.page.waitForSelector('body[data-ready]');
    await page.rowsAre(6);
    const [x, y] = six[2].scan;
    await page.zoomTo('scan', [x, y]);
    await page.drag('scan', [x, y], [x + 6, y]);
    await saysWhy();
    // In the photo they can be moved.
    await page.page.focus('#photo-pane');
    await page.page.keyboard.press('ArrowRight');
    await until(
        () => distance(page.file()[2].img, [file[2].img[0] + 1, file[2].img[1]]) < 1e-9, 'moved');
  });
});

test('Mirror reads the scan the other way round and keeps the picks', async () => {
  const six = places.slice(0, 6);
  const mirror = async (page) => {
    const old = page.page.url();
    await page.page.click('#mirror');
    await page.page.waitForURL((url) => String(url) !== old, {timeout: 60000});
    await page.page.waitForSelector('body[data-ready]');
  };
  await pageOn(async (page) => {
    await until(async () => /mirror image/.test(await page.text('#dock')), 'the warning');
    await screenshot(page.page, 'pick-mirror');
    // What it advises can be done here, without options of a command line.
    assert.doesNotMatch(await page.text('#dock'), /--[a-z]/);
    await page.page.click('#align-open');
    await page.page.waitForSelector('#align .verdict', {timeout: 240000});
    const advice = (await page.page.locator('#align .sentences li').allInnerTexts()).join(' ');
    assert.match(advice, /Press Mirror/);
    assert.doesNotMatch(advice, /--[a-z]/);
    await page.page.keyboard.press('Escape');
    await mirror(page);  // to the room that the picks were made in
    await until(
        async () => (await page.rows()).every(({status, px}) => status === 'used' && px < 2.5),
        'they fit');
    page.file().forEach(({point}, i) => assert.ok(distance(point, six[i].point) < 1e-9));
    await mirror(page);  // and with the scan into its mirror image
    await until(async () => (await page.rows()).length === 6, 'the picks');
    page.file().forEach(({point: [x, y, z]}, i) => {
      assert.ok(distance([-x, y, z], six[i].point) < 1e-6, `${[x, y, z]}`);
    });
  }, {
    picksFile: fileOf(six),
    more: ['--azimuth', 'counterclockwise'],
    // The page asks for the new address until it is there; the server that is still ending forbids it.
    allowed: [/ERR_CONNECTION_REFUSED/, /failed/, /403 \(Forbidden\)/],
  });
});
