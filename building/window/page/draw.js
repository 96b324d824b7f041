// The two layers of the picture: points, and what is drawn over them.

const kHeightColors = [[66, 92, 200], [28, 128, 152], [62, 150, 78], [196, 140, 30], [196, 62, 44]];

function heightColor(share) {
  const at = Math.min(0.999, Math.max(0, share)) * (kHeightColors.length - 1);
  const [a, b] = [kHeightColors[Math.floor(at)], kHeightColors[Math.floor(at) + 1]];
  return a.map((value, i) => value + (at - Math.floor(at)) * (b[i] - value));
}

// The colour table by height, 256 steps.
const kTable = Uint8Array.from({length: 256}, (_, i) => i);
const kRamp = Array.from(kTable, (i) => heightColor(i / 255));

// cloud: {positions, colors, heights (above the ground)}, origin of the positions.
export function drawPoints(canvas, view, cloud, {origin, top, near, showGround, photoColors}) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [Math.round(view.width * ratio), Math.round(view.height * ratio)];
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  if (!width || !height) return;
  const context = canvas.getContext('2d');
  const image = context.createImageData(width, height);
  const depth = new Float32Array(width * height).fill(-Infinity);
  const {right, up, towards} = view.axes();
  const scale = view.scale * ratio;
  const o = origin.map((value, i) => value - view.centre[i]);
  const dot = (a) => a[0] * o[0] + a[1] * o[1] + a[2] * o[2];
  const [ox, oy, od] = [width / 2 + dot(right) * scale, height / 2 - dot(up) * scale, dot(towards)];
  const {positions, colors, heights} = cloud;
  const size = ratio > 1.4 ? 3 : 2;
  for (let i = 0, n = heights.length; i < n; ++i) {
    if (!showGround && heights[i] < near) continue;
    const [x, y, z] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
    const px = Math.round(ox + (right[0] * x + right[1] * y) * scale);
    const py = Math.round(oy - (up[0] * x + up[1] * y + up[2] * z) * scale);
    if (px < 0 || py < 0 || px >= width - size || py >= height - size) continue;
    const d = od + towards[0] * x + towards[1] * y + towards[2] * z;
    const level = Math.max(0, Math.min(255, Math.round(255 * heights[i] / top)));
    const color = photoColors ? null : kRamp[level];
    for (let dy = 0; dy < size; ++dy) {
      for (let dx = 0; dx < size; ++dx) {
        const at = (py + dy) * width + px + dx;
        if (depth[at] > d) continue;
        depth[at] = d;
        for (let c = 0; c < 3; ++c) {
          image.data[4 * at + c] = color ? color[c] : colors[3 * i + c];
        }
        image.data[4 * at + 3] = 255;
      }
    }
  }
  context.putImageData(image, 0, 0);
}

function path(context, corners, close = true) {
  context.beginPath();
  corners.forEach(([x, y], i) => i === 0 ? context.moveTo(x, y) : context.lineTo(x, y));
  if (close) context.closePath();
}

// scene: {buildings, selected, corner, lines, showLines, contour (corners being drawn), cursor,
// snap: {place, kind}, box (rectangle), stroke (upright line)}; colors of the page's style.
export function drawOver(canvas, view, scene, colors) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(view.width * ratio);
  canvas.height = Math.round(view.height * ratio);
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  context.lineJoin = 'round';
  const plan = ([x, y], z) => view.toScreen([x, y, z]);

  if (scene.showLines && view.isTop) {
    context.strokeStyle = colors.quiet;
    context.setLineDash([5, 4]);
    for (const [ax, ay, bx, by] of scene.lines) {
      path(context, [plan([ax, ay], 0), plan([bx, by], 0)], false);
      context.stroke();
    }
    context.setLineDash([]);
  }
  drawSolids(context, view, scene, colors);
  const drawing = scene.contour;
  if (drawing.length > 0) {
    const corners = drawing.map((corner) => plan(corner, 0));
    if (scene.cursor) corners.push(plan(scene.snap?.place ?? scene.cursor, 0));
    context.strokeStyle = colors.accent;
    context.lineWidth = 2;
    path(context, corners, false);
    context.stroke();
    for (const [x, y] of corners) context.strokeRect(x - 3, y - 3, 6, 6);
  }
  if (scene.snap) {
    const [x, y] = plan(scene.snap.place, 0);
    context.strokeStyle = colors.accent;
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x, y, 8, 0, 2 * Math.PI);
    context.stroke();
    context.fillStyle = colors.text;
    context.font = '12px system-ui, sans-serif';
    context.fillText(scene.snap.kind, x + 12, y - 8);
  }
  context.lineWidth = 1.5;
  context.strokeStyle = colors.accent;
  if (scene.box) {
    const [[x0, y0], [x1, y1]] = scene.box;
    context.setLineDash([6, 4]);
    context.strokeRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
    context.setLineDash([]);
  }
  if (scene.stroke) {
    path(context, scene.stroke, false);
    context.stroke();
  }
}

function drawSolids(context, view, scene, colors) {
  const {towards} = view.axes();
  scene.buildings.forEach((building, index) => {
    const selected = index === scene.selected;
    const faces = (building.faces ?? []).map((face) => {
      const depth = face.corners.reduce(
          (sum, c) => sum + c[0] * towards[0] + c[1] * towards[1] + c[2] * towards[2], 0);
      return {...face, depth: depth / face.corners.length};
    });
    faces.sort((a, b) => a.depth - b.depth);
    context.lineWidth = selected ? 2 : 1.2;
    context.strokeStyle = selected ? colors.accent : colors.text;
    for (const face of faces) {
      path(context, face.corners.map((corner) => view.toScreen(corner)));
      if (face.kind === 'roof' || !view.isTop) {
        context.globalAlpha = view.isTop ? 0.13 : 0.28;
        context.fillStyle = face.kind === 'roof' ? colors.bad : colors.quiet;
        context.fill();
        context.globalAlpha = 1;
      }
      context.stroke();
    }
    if (!view.isTop) return;
    // The footprint as it is being moved, its corners, its name.
    const corners = building.footprint.map((corner) => view.toScreen([...corner, building.ground]));
    context.lineWidth = selected ? 2.5 : 1.5;
    path(context, corners);
    context.stroke();
    const middle = [0, 1].map((axis) =>
      corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
    context.font = '600 13px system-ui, sans-serif';
    const width = context.measureText(building.name).width;
    context.fillStyle = colors.panel;
    context.fillRect(middle[0] - width / 2 - 5, middle[1] - 10, width + 10, 20);
    context.fillStyle = colors.text;
    context.fillText(building.name, middle[0] - width / 2, middle[1] + 5);
    if (!selected) return;
    corners.forEach(([x, y], i) => {
      context.fillStyle = i === scene.corner ? colors.accent : colors.panel;
      context.fillRect(x - 4.5, y - 4.5, 9, 9);
      context.strokeRect(x - 4.5, y - 4.5, 9, 9);
    });
  });
}
