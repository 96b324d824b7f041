// Lines for CAD programs: DXF of release 12, which all of them read.

const kJoin = 1e5;  // per metre: ends that are nearer to each other than this are one point

// Pairs of points [x, y, x, y, ...] put together to lines [[x, y], ...] as long as may be.
export function chainSegments(segments) {
  const name = (i) => `${Math.round(segments[i] * kJoin)} ${Math.round(segments[i + 1] * kJoin)}`;
  const at = new Map();  // point, the segment ends there
  for (let i = 0; i < segments.length; i += 2) {
    const key = name(i);
    if (!at.has(key)) at.set(key, []);
    at.get(key).push(i);
  }
  const used = new Uint8Array(segments.length / 4);
  const other = (i) => i % 4 === 0 ? i + 2 : i - 2;
  // On from the end of a segment, as long as exactly one other one begins there.
  const follow = (end) => {
    const line = [];
    for (;;) {
      const ends = at.get(name(end));
      const next = ends.length === 2 ? ends.find((i) => !used[i >> 2]) : undefined;
      if (next === undefined) return line;
      used[next >> 2] = 1;
      end = other(next);
      line.push([segments[end], segments[end + 1]]);
    }
  };
  const lines = [];
  for (let i = 0; i < segments.length; i += 4) {
    if (used[i >> 2] || name(i) === name(i + 2)) continue;
    used[i >> 2] = 1;
    lines.push([
      ...follow(i).reverse(), [segments[i], segments[i + 1]], [segments[i + 2], segments[i + 3]],
      ...follow(i + 2)
    ]);
  }
  return lines;
}

// Polylines on one layer, in the unit of their numbers.
export function writeDxf(lines, layer) {
  const rows = [0, 'SECTION', 2, 'HEADER', 9, '$ACADVER', 1, 'AC1009', 0, 'ENDSEC',
                0, 'SECTION', 2, 'ENTITIES'];
  for (const line of lines) {
    rows.push(0, 'POLYLINE', 8, layer, 66, 1, 70, 0, 10, 0, 20, 0, 30, 0);
    for (const [x, y] of line) {
      rows.push(0, 'VERTEX', 8, layer, 10, x.toFixed(5), 20, y.toFixed(5), 30, 0);
    }
    rows.push(0, 'SEQEND', 8, layer);
  }
  rows.push(0, 'ENDSEC', 0, 'EOF');
  return rows.join('\n') + '\n';
}
