// The robot: three arms of changing length from a base triangle to the tool point, over a table that tilts and turns; the path
// that the tool has gone, cutting moves strong.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const MS = 1000;
/** Radius of the table, m; pixels around the picture. */
const TABLE = 0.3, MARGIN = 12;

export class Robot {
  /** @param moved called with the pose that is shown; ended when playing comes to the end */
  constructor(canvas, moved, ended) {
    Object.assign(this, { canvas, moved, ended, poses: [], shown: 0, playing: false });
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  begin(base, sampleTime) {
    Object.assign(this, { base, sampleTime, poses: [], shown: 0, looked: 0, box: { x: [Infinity, -Infinity], y: [Infinity, -Infinity], z: -Infinity } });
  }

  add(poses) {
    this.poses.push(...poses);
  }

  show(index) {
    this.shown = Math.max(0, Math.min(index, this.poses.length - 1));
    this.draw();
    if (this.poses.length) this.moved(this.poses[this.shown], this.shown);
  }

  /** Moves at eight times its real speed. */
  play(on) {
    this.playing = on;
    let last = performance.now(), rest = 0;
    const frame = (now) => {
      if (!this.playing) return;
      const step = this.poses.length > 1 ? (this.poses[1][0] - this.poses[0][0]) * this.sampleTime * MS : Infinity;
      rest += Math.min(now - last, 100) * 8;
      last = now;
      const whole = Math.floor(rest / step);
      rest -= whole * step;
      if (whole) this.show(this.shown + whole);
      if (this.over && this.shown >= this.poses.length - 1) {
        this.playing = false;
        this.ended();
      }
      requestAnimationFrame(frame);
    };
    if (on) requestAnimationFrame(frame);
  }

  draw() {
    const { canvas, poses } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = devicePixelRatio || 1;
    if (!width || !height) return;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    g.clearRect(0, 0, width, height);
    if (!this.base || !poses.length) return;
    const [, x, y, z, tilt, rotation] = poses[this.shown];
    const base = this.base.map(([x, y]) => [x, y, 0]);
    // The table: a disc below the lowest tool point so far, tilted about x, turned about its axis.
    const below = this.deepest() + 0.03;
    const disc = (r, a, tilted = tilt) => {
      const [u, v] = [r * Math.cos(a), r * Math.sin(a)];
      return [u, v * Math.cos(tilted), below + v * Math.sin(tilted)];
    };
    const circle = (tilted) => Array.from({ length: 60 }, (_, i) => disc(TABLE, (i / 60) * 2 * Math.PI, tilted));
    // Seen from the side and above; z goes down from the base, as the arms do. All of it fits in, however the table is tilted.
    const turn = 0.6, rise = 0.42;
    const [ct, st, cr, sr] = [Math.cos(turn), Math.sin(turn), Math.cos(rise), Math.sin(rise)];
    const flat = ([x, y, z]) => [x * ct - y * st, z * cr + (x * st + y * ct) * sr];
    const all = [...base, ...circle(0.5), ...circle(-0.5)].map(flat);
    const [across, down] = [0, 1].map((i) => all.map((point) => point[i]));
    const [left, right, high, low] = [Math.min(...across), Math.max(...across), Math.min(...down), Math.max(...down)];
    // Beside the path from above, or over it where it is narrow.
    const side = Math.min(width * 0.36, height * 0.45, 220);
    const [wide, tall] = width < 560 ? [width, height - side] : [width - side, height];
    const scale = Math.min((wide - 2 * MARGIN) / (right - left), (tall - 2 * MARGIN) / (low - high));
    const at = (point) => {
      const [across, down] = flat(point);
      return [width - wide / 2 + (across - (left + right) / 2) * scale, tall / 2 + (down - (low + high) / 2) * scale];
    };
    const line = (points, colour, weight, close) => {
      g.beginPath();
      points.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
      if (close) g.closePath();
      g.strokeStyle = colour;
      g.lineWidth = weight;
      g.stroke();
    };
    const rim = circle(tilt);
    g.beginPath();
    rim.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
    g.closePath();
    g.fillStyle = style("--panel");
    g.fill();
    line(rim, style("--edge"), 1.5, true);
    line([disc(0, 0), disc(TABLE, rotation)], style("--edge"), 1.5);
    this.path(g, (pose) => at(pose.slice(1, 4)), 2);
    line(base, style("--dim"), 3, true);
    for (const foot of base) line([foot, [x, y, z]], style("--fg"), 2.2);
    for (const joint of [...base, [x, y, z]]) {
      g.beginPath();
      g.arc(...at(joint), 4, 0, 2 * Math.PI);
      g.fillStyle = joint === base[0] ? style("--dim") : style("--fg");
      g.fill();
    }
    const tool = (point) => {
      g.beginPath();
      g.arc(...point, 5, 0, 2 * Math.PI);
      g.fillStyle = style("--changed");
      g.fill();
    };
    tool(at([x, y, z]));
    this.inset(g, side, height, tool);
  }

  /** The lowest point of the tool so far. */
  deepest() {
    for (; this.looked < this.poses.length; this.looked++) {
      const [, x, y, z] = this.poses[this.looked];
      const { box } = this;
      Object.assign(box, { x: [Math.min(box.x[0], x), Math.max(box.x[1], x)], y: [Math.min(box.y[0], y), Math.max(box.y[1], y)], z: Math.max(box.z, z) });
    }
    return this.box.z;
  }

  /** The path so far, cutting moves strong. */
  path(g, at, weight) {
    for (const cutting of [false, true]) {
      g.beginPath();
      let drawing = false;
      for (let i = 0; i <= this.shown; i++) {
        const pose = this.poses[i];
        if ((pose[7] === 1) !== cutting) drawing = false;
        else if (drawing) g.lineTo(...at(pose));
        else (g.moveTo(...at(pose)), (drawing = true));
      }
      g.strokeStyle = cutting ? style("--accent") : style("--edge");
      g.lineWidth = cutting ? weight : 1;
      g.stroke();
    }
  }

  /** The tool's path from above, large enough to be read. */
  inset(g, side, height, tool) {
    const { box } = this, wide = box.x[1] - box.x[0], tall = box.y[1] - box.y[0];
    if (side < 90 || this.poses.length < 2) return;
    const scale = (side - 24) / Math.max(wide, tall, 1e-3);
    const left = 1, top = height - side - 1;
    g.fillStyle = style("--bg");
    g.strokeStyle = style("--edge");
    g.lineWidth = 1;
    g.fillRect(left, top, side, side);
    g.strokeRect(left, top, side, side);
    g.fillStyle = style("--dim");
    g.font = "11px system-ui, sans-serif";
    g.fillText("from above", left + 6, top + 14);
    const at = ([, x, y]) => [left + side / 2 + (x - (box.x[0] + box.x[1]) / 2) * scale, top + side / 2 - (y - (box.y[0] + box.y[1]) / 2) * scale];
    this.path(g, at, 2);
    tool(at(this.poses[this.shown]));
  }
}
