// Points with known coordinates, from a file: surveyed targets, corners measured elsewhere.

import {app} from './app.js';
import {byId, say} from './dom.js';

const kLargestFile = 1 << 20;  // bytes
const kMostTargets = 500;

// Lines LABEL,X,Y,Z (also with semicolons, tabs or blanks), metres in the scan frame; # begins a
// comment, a first line of names is passed over. Throws an Error with a sentence.
export function parseTargets(text) {
  const targets = [];
  const lines = text.replace(/^\uFEFF/, '').split(/\r?\n/);
  lines.forEach((line, index) => {
    if (!line.trim() || line.trim().startsWith('#')) return;
    const separator = line.includes(';') ? ';' : /[,\t]/.exec(line)?.[0] ?? /\s+/;
    const fields = line.trim().split(separator).map((field) => field.trim().replace(/^"|"$/g, ''));
    const point = fields.slice(1, 4).map((field) => field === '' ? NaN : Number(field));
    if (fields.length < 4 || !point.every(Number.isFinite)) {
      if (targets.length === 0 && /^[a-z_ ]+$/i.test(fields.slice(1).join(''))) return;  // names
      throw new Error(
          `Line ${index + 1} is "${line.trim().slice(0, 40)}", expected LABEL,X,Y,Z in metres ` +
          'with decimal points');
    }
    if (targets.some(({label}) => label === fields[0])) {
      throw new Error(`Line ${index + 1} has the label "${fields[0]}" a second time`);
    }
    targets.push({label: fields[0].slice(0, 60), point});
  });
  if (targets.length === 0) throw new Error('The file holds no line LABEL,X,Y,Z');
  if (targets.length > kMostTargets) {
    throw new Error(`The file holds ${targets.length} targets, more than ${kMostTargets}`);
  }
  return targets;
}

export function listenToTargets() {
  const input = byId('targets-file');
  byId('targets').addEventListener('click', () => input.click());
  input.addEventListener('change', async () => {
    const [file] = input.files;
    if (!file) return;
    try {
      if (file.size > kLargestFile) throw new Error(`${file.name} is larger than a megabyte`);
      app.editor.addTargets(parseTargets(await file.text()));
    } catch (error) {
      say(error.message, {seconds: 9, urgent: true});
    }
    input.value = '';
  });
}
