// Orthographic views of the scene: from above (pitch 90 degrees), from the sides, and between.

export class View {
  constructor() {
    this.yaw = 0;
    this.pitch = Math.PI / 2;
    this.scale = 1;  // pixels of the page per unit
    this.centre = [0, 0, 0];
    this.width = 1;
    this.height = 1;
  }

  get isTop() {
    return Math.abs(this.pitch - Math.PI / 2) < 1e-6;
  }

  // Directions of the scene: right and up on the page, and towards the viewer.
  axes() {
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const [cp, sp] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    return {right: [c, s, 0], up: [-s * sp, c * sp, cp], towards: [s * cp, -c * cp, sp]};
  }

  toScreen(point) {
    const {right, up} = this.axes();
    const d = point.map((value, i) => value - this.centre[i]);
    const dot = (a) => a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
    return [this.width / 2 + dot(right) * this.scale, this.height / 2 - dot(up) * this.scale];
  }

  // Of the top view: x and y of a place on the page.
  toPlan([x, y]) {
    const {right, up} = this.axes();
    const a = (x - this.width / 2) / this.scale;
    const b = (this.height / 2 - y) / this.scale;
    return [
      this.centre[0] + a * right[0] + b * up[0],
      this.centre[1] + a * right[1] + b * up[1],
    ];
  }

  pan(dx, dy) {
    const {right, up} = this.axes();
    for (let i = 0; i < 3; ++i) {
      this.centre[i] += (-dx * right[i] + dy * up[i]) / this.scale;
    }
  }

  // What is under the place stays there.
  zoom(factor, [x, y]) {
    const scale = Math.min(1e6, Math.max(1e-4, this.scale * factor));
    const {right, up} = this.axes();
    const a = (x - this.width / 2) * (1 / this.scale - 1 / scale);
    const b = (this.height / 2 - y) * (1 / this.scale - 1 / scale);
    for (let i = 0; i < 3; ++i) this.centre[i] += a * right[i] + b * up[i];
    this.scale = scale;
  }

  fit([low, high]) {
    this.centre = low.map((value, i) => (value + high[i]) / 2);
    const {right, up} = this.axes();
    const size = (axis) => axis.reduce(
        (sum, value, i) => sum + Math.abs(value) * (high[i] - low[i]), 0);
    this.scale = 0.92 * Math.min(
        this.width / Math.max(size(right), 1e-9), this.height / Math.max(size(up), 1e-9));
  }
}
