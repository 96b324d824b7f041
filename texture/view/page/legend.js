// What the colours of the surface mean.

import {colorMap, kUnknownColor} from './surface.js';

// {title, ends: [low, high], steps (0 = smooth), unknown}; null where the colours are the photos'.
export function legendOf(mode, evidence) {
  if (mode === 'intensity') {
    return {
      title: 'Scan intensity (unit of the scanner)',
      steps: 0,
      unknown: 'no sample',
      ends: evidence.intensity.map((value) => `${Number(value.toPrecision(4))}`)
    };
  }
  if (mode === 'views') {
    const most = Math.max(evidence.max_views, 2);
    return {
      title: 'Photos that see the place',
      steps: most <= 40 ? most : 0,
      unknown: 'none',
      ends: ['1', `${most}`]
    };
  }
  if (mode === 'disagreement') {
    return {
      title: 'Mean difference between the photos (levels, 0–255)',
      steps: 0,
      unknown: 'fewer than two photos',
      ends: ['0', `${Math.round(evidence.disagreement_high)} and more`]
    };
  }
  return null;
}

export function paintBar(canvas, mode, steps) {
  canvas.width = 512;
  canvas.height = 14;
  const context = canvas.getContext('2d');
  const colors = colorMap(mode, steps || 256);
  colors.forEach(([r, g, b], i) => {
    context.fillStyle = `rgb(${r}, ${g}, ${b})`;
    const from = Math.floor(i * 512 / colors.length);
    context.fillRect(from, 0, Math.ceil(512 / colors.length) + 1, 14);
  });
}
function paintSwatch(canvas) {
  canvas.width = canvas.height = 14;
  const context = canvas.getContext('2d');
  context.fillStyle = `rgb(${kUnknownColor.join(', ')})`;
  context.fillRect(0, 0, 14, 14);
}

export function showLegend(element, mode, evidence) {
  const legend = legendOf(mode, evidence);
  element.hidden = legend === null;
  element.replaceChildren();
  if (!legend) return;
  const make = (tag, text, className) => {
    const made = document.createElement(tag);
    if (text) made.textContent = text;
    if (className) made.className = className;
    return made;
  };
  const bar = make('canvas'), swatch = make('canvas');
  paintBar(bar, mode, legend.steps);
  paintSwatch(swatch);
  const ends = make('div', '', 'ends');
  ends.append(make('span', legend.ends[0]), make('span', legend.ends[1]));
  const unknown = make('div', '', 'unknown');
  unknown.append(swatch, make('span', legend.unknown));
  element.append(make('h3', legend.title), bar, ends, unknown);
}

// The same on a picture; scale: pixels of the picture per CSS pixel.
export function drawLegend(context, mode, evidence, scale) {
  const legend = legendOf(mode, evidence);
  if (!legend) return;
  context.font = '600 12px system-ui, sans-serif';
  const width = Math.max(300, context.measureText(legend.title).width + 24);
  const height = 84, left = 12, top = context.canvas.height / scale - height - 12;
  context.save();
  context.scale(scale, scale);
  context.fillStyle = 'rgba(16, 18, 23, 0.92)';
  context.beginPath();
  context.roundRect(left, top, width, height, 8);
  context.fill();
  const bar = document.createElement('canvas'), swatch = document.createElement('canvas');
  paintBar(bar, mode, legend.steps);
  paintSwatch(swatch);
  context.drawImage(bar, left + 12, top + 28, width - 24, 14);
  context.drawImage(swatch, left + 12, top + 64);
  context.fillStyle = '#fff';
  context.font = '600 12px system-ui, sans-serif';
  context.fillText(legend.title, left + 12, top + 19);
  context.font = '12px system-ui, sans-serif';
  context.fillText(legend.ends[0], left + 12, top + 56);
  context.textAlign = 'right';
  context.fillText(legend.ends[1], left + width - 12, top + 56);
  context.textAlign = 'left';
  context.fillText(legend.unknown, left + 32, top + 75);
  context.restore();
}
