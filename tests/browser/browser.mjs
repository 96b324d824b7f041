// What every test of a page needs: a command that serves it, a browser that opens it, and folders.

import {spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {after} from 'node:test';

function fromEnvironment(name) {
  const value = process.env[name];
  if (!value) throw new Error(`${name} is not set: run these tests by ctest`);
  return value;
}

const bin = fromEnvironment('ROOMTEX_BIN');
const require =
    createRequire(path.join(fromEnvironment('ROOMTEX_BROWSER_PACKAGES'), 'package.json'));
const {chromium} = require('playwright-core');

// Whether tests run that have the label slow: {skip: !isSlowRun}.
export const isSlowRun = process.env.ROOMTEX_SLOW === '1';

export function makeFolder() {
  const folder = mkdtempSync(path.join(tmpdir(), 'roomtex-browser-'));
  return {
    path: (...parts) => path.join(folder, ...parts),
    remove: () => rmSync(folder, {recursive: true, force: true}),
  };
}

// Runs a command to its end: {code, stdout, stderr}.
export function run(command, args) {
  return new Promise((resolve, reject) => {
    const child = spawn(path.join(bin, command), args);
    const result = {code: null, stdout: '', stderr: ''};
    child.stdout.on('data', (data) => {
      result.stdout += data;
    });
    child.stderr.on('data', (data) => {
      result.stderr += data;
    });
    child.on('error', reject);
    child.on('close', (code) => resolve({...result, code}));
  });
}

// What a test that failed left running would keep its program waiting for ever. The tests' own hooks come first.
const served = new Set();
after(() => {
  setTimeout(() => {
    for (const child of served) child.kill('SIGKILL');
  }, 10000).unref();
});

// Starts a command that serves a page and waits until it has printed its URL on stdout.
export function serve(command, args) {
  return new Promise((resolve, reject) => {
    const child = spawn(path.join(bin, command), args);
    served.add(child);
    const server = {
      stdout: '',
      stderr: '',
      url: null,
      // Ends it as Ctrl-C does; gives the exit code.
      stop: () => {
        child.kill('SIGINT');
        return closed;
      },
    };
    const closed = new Promise((done) => child.on('close', done));
    closed.then(() => served.delete(child));
    child.stderr.on('data', (data) => {
      server.stderr += data;
    });
    child.stdout.on('data', (data) => {
      server.stdout += data;
      const found = server.stdout.match(/http:\/\/\S+\n/);
      if (found && !server.url) {
        server.url = found[0].trim();
        resolve(server);
      }
    });
    child.on('error', reject);
    closed.then(
        (code) =>
            reject(new Error(`${command} ended with ${code} before it served: ${server.stderr}`)));
  });
}

// A page that remembers what went wrong in it: errors() must be empty at the end of a test.
// width, height: CSS pixels; each has deviceScaleFactor pixels of the screen.
export async function openPage(
    browser, url, {width = 1600, height = 1000, deviceScaleFactor = 1} = {}) {
  const page = await browser.newPage({viewport: {width, height}, deviceScaleFactor});
  const errors = [];
  page.on('pageerror', (error) => errors.push(String(error)));
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  page.on('requestfailed', (request) => {
    // A page may give up what it no longer needs (tiles out of view).
    if (request.failure()?.errorText === 'net::ERR_ABORTED') return;
    errors.push(`${request.url()} failed`);
  });
  page.on('request', (request) => {
    const to = new URL(request.url());
    if (to.protocol === 'http:' && to.host !== new URL(url).host) errors.push(`asked ${to.host}`);
  });
  if (url !== 'about:blank') await page.goto(url);
  return {page, errors: () => errors};
}

// webgl: SwiftShader draws it, there need be no GPU. Pages without are drawn faster without.
export function launchBrowser({webgl = false} = {}) {
  const graphics = webgl ?
      ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'] :
      ['--disable-gpu'];
  // --no-sandbox: containers run as root.
  return chromium.launch(
      {executablePath: fromEnvironment('ROOMTEX_CHROMIUM'), args: ['--no-sandbox', ...graphics]});
}

export async function screenshot(page, name) {
  const folder = fromEnvironment('ROOMTEX_SCREENSHOTS');
  mkdirSync(folder, {recursive: true});
  await page.screenshot({path: path.join(folder, `${name}.png`)});
}
