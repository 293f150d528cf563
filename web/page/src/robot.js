// The robot: three arms of changing length from a base triangle to the tool point, over a table that tilts and turns; the path
// that the tool has gone, cutting moves strong.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const DAY = 1000;

export class Robot {
  /** @param moved called with the pose that is shown */
  constructor(canvas, moved) {
    Object.assign(this, { canvas, moved, poses: [], shown: 0, playing: false });
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  begin(base, sampleTime) {
    Object.assign(this, { base, sampleTime, poses: [], shown: 0 });
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
      const step = this.poses.length > 1 ? (this.poses[1][0] - this.poses[0][0]) * this.sampleTime * DAY : Infinity;
      rest += Math.min(now - last, 100) * 8;
      last = now;
      const whole = Math.floor(rest / step);
      rest -= whole * step;
      if (whole) this.show(this.shown + whole);
      if (this.over && this.shown >= this.poses.length - 1) this.playing = false;
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
    // Seen from the side and above; z goes down from the base, as the arms do.
    const turn = 0.6, rise = 0.42, reach = 1.35;
    const scale = Math.min(width / 1.5, height / reach), cx = width / 2, top = height * 0.13;
    const [ct, st, cr, sr] = [Math.cos(turn), Math.sin(turn), Math.cos(rise), Math.sin(rise)];
    const at = ([x, y, z]) => {
      const across = x * ct - y * st, deep = x * st + y * ct;
      return [cx + across * scale, top + (z * cr + deep * sr) * scale];
    };
    const line = (points, colour, weight, close) => {
      g.beginPath();
      points.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
      if (close) g.closePath();
      g.strokeStyle = colour;
      g.lineWidth = weight;
      g.stroke();
    };
    const [, x, y, z, tilt, rotation] = poses[this.shown];
    const base = this.base.map(([x, y]) => [x, y, 0]);
    // The table: a disc below the lowest tool point, tilted about x, turned about its axis.
    const deepest = (this.deepest ??= poses.length > 50 ? Math.max(...poses.map((pose) => pose[3])) : undefined) ?? Math.max(...poses.map((pose) => pose[3]));
    const disc = (r, a) => {
      const [u, v] = [r * Math.cos(a + rotation), r * Math.sin(a + rotation)];
      return [u, v * Math.cos(tilt), deepest + 0.03 + v * Math.sin(tilt)];
    };
    const rim = Array.from({ length: 60 }, (_, i) => disc(0.3, (i / 60) * 2 * Math.PI));
    g.beginPath();
    rim.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
    g.closePath();
    g.fillStyle = style("--panel");
    g.fill();
    line(rim, style("--edge"), 1.5, true);
    line([disc(0, 0), disc(0.3, 0)], style("--edge"), 1.5);
    // The path so far.
    for (const cutting of [false, true]) {
      g.beginPath();
      let drawing = false;
      for (let i = 0; i <= this.shown; i++) {
        const pose = poses[i], is = pose[7] === 1;
        const point = at([pose[1], pose[2], pose[3]]);
        if (is !== cutting) drawing = false;
        else if (drawing) g.lineTo(...point);
        else (g.moveTo(...point), (drawing = true));
      }
      g.strokeStyle = cutting ? style("--accent") : style("--edge");
      g.lineWidth = cutting ? 2 : 1;
      g.stroke();
    }
    line(base, style("--dim"), 3, true);
    for (const foot of base) line([foot, [x, y, z]], style("--fg"), 2.2);
    for (const joint of [...base, [x, y, z]]) {
      g.beginPath();
      g.arc(...at(joint), 4, 0, 2 * Math.PI);
      g.fillStyle = joint === base[0] ? style("--dim") : style("--fg");
      g.fill();
    }
    const [tx, ty] = at([x, y, z]);
    g.beginPath();
    g.arc(tx, ty, 5, 0, 2 * Math.PI);
    g.fillStyle = style("--changed");
    g.fill();
  }
}
