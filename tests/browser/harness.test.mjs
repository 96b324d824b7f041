// The harness itself: what the other tests rest on.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {launchBrowser, makeFolder, openPage, run} from './browser.mjs';

let browser;
before(async () => {
  browser = await launchBrowser({webgl: true});
});
after(async () => {
  await browser.close();
});

test('errors of a page do not go unseen', async () => {
  const {page, errors} = await openPage(browser, 'data:text/html,<p>page</p>');
  assert.deepEqual(errors(), []);
  await page.evaluate(() => {
    setTimeout(() => {
      throw new Error('said by the page');
    });
  });
  await page.waitForTimeout(200);
  assert.match(errors().join('\n'), /said by the page/);
});

test('the browser draws in three dimensions', async () => {
  const {page} = await openPage(browser, 'data:text/html,<canvas>');
  assert.equal(
      await page.evaluate(() => {
        const gl = document.querySelector('canvas').getContext('webgl2');
        if (!gl) return null;
        gl.clearColor(0, 0.5, 0, 1);
        gl.clear(gl.COLOR_BUFFER_BIT);
        const pixel = new Uint8Array(4);
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return pixel.join(' ');
      }),
      '0 128 0 255');
});

test('a command is run and its exit code seen', async () => {
  const folder = makeFolder();
  const result = await run('roomtex-simulate', ['--output_path', folder.path('x'), '--nonsense']);
  folder.remove();
  assert.equal(result.code, 2);
  assert.match(result.stderr, /nonsense/);
});
