// Numbers as the user reads them: lengths in metres or millimetres, or in feet or inches, always with
// the unit.

const kDigits = 4;  // of a metre: tenths of a millimetre say nothing, the next digit rounds fairly

const kFoot = 0.3048;  // metres, exactly
const kUnits = {
  m: {name: 'm', metres: 1},
  ft: {name: 'ft', metres: kFoot},
};
let chosen = kUnits.m;
// The unit of lengths: {name, metres}.
export const unit = () => chosen;
export function setUnit(name) {
  chosen = kUnits[name] ?? kUnits.m;
}

export function length(metres) {
  if (chosen === kUnits.ft) {
    const feet = metres / kFoot;
    return Math.abs(feet) < 1 ? `${(12 * feet).toFixed(2)} in` : `${feet.toFixed(3)} ft`;
  }
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
