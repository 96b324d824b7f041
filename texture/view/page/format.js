// Numbers as the user reads them: lengths in metres or millimetres, always with the unit.

const kDigits = 4;  // of a metre: tenths of a millimetre say nothing, the next digit rounds fairly

export function length(metres) {
  return Math.abs(metres) < 1 ? `${(1000 * metres).toFixed(1)} mm` :
                                `${metres.toFixed(kDigits - 1)} m`;
}
export function coordinates(point) {
  return [point.x, point.y, point.z].map((value) => value.toFixed(kDigits)).join(', ');
}
export function count(number) {
  if (number >= 1e6) return `${(number / 1e6).toFixed(2)} M`;
  if (number >= 1e4) return `${Math.round(number / 1e3)} k`;
  return String(number);
}
