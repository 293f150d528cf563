// The robot: three arms of variable length from a base triangle to the tool, above a table that tilts and turns; beside it, magnified,
// the path of the tool. Dragging rotates the scene under the pointer, and the wheel zooms it.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const MS = 1000;
/** Fraction of the width for the path; radius of the table, m; margin of a scene, pixels; permitted tool error while cutting, m. */
const PATH = 0.62, TABLE = 0.3, MARGIN = 14, ALLOWED = 10e-6;
/** Initial views: rotation about the vertical, elevation, zoom. The path faces the viewer, so that its letters are readable. */
const VIEWS = { robot: { turn: 0.6, rise: 0.42, zoom: 1 }, path: { turn: 0, rise: -1.2, zoom: 1 } };

export class Robot {
  /** @param moved called with the displayed pose; ended called at the end of the replay */
  constructor(canvas, moved, ended) {
    Object.assign(this, { canvas, moved, ended, poses: [], plan: [], shown: 0, playing: false, scenes: [] });
    this.reset();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  reset() {
    this.views = { robot: { ...VIEWS.robot }, path: { ...VIEWS.path } };
  }

  listen() {
    const { canvas } = this, pointers = new Map();
    const scene = (event) => {
      const box = canvas.getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
      return this.scenes.find(({ left, top, wide, tall }) => x >= left && x < left + wide && y >= top && y < top + tall)?.name ?? "robot";
    };
    const distance = () => {
      const [a, b] = [...pointers.values()];
      return Math.hypot(a.x - b.x, a.y - b.y);
    };
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      canvas.setPointerCapture(event.pointerId);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const apart = pointers.size === 2 ? distance() : 0;
      const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
      Object.assign(before, { x: event.clientX, y: event.clientY });
      if (pointers.size === 2) return this.nearer(scene(event), distance() / apart);
      this.orbit(dx * 0.01, dy * 0.01, [scene(event)]);
    });
    canvas.addEventListener("wheel", (event) => (event.preventDefault(), this.nearer(scene(event), Math.exp(-event.deltaY * 0.0015))), { passive: false });
    canvas.addEventListener("dblclick", () => (this.reset(), this.draw()));
    canvas.addEventListener("keydown", (event) => {
      const both = (factor) => (this.nearer("robot", factor), this.nearer("path", factor));
      const act = {
        ArrowLeft: () => this.orbit(-0.1, 0), ArrowRight: () => this.orbit(0.1, 0), ArrowUp: () => this.orbit(0, -0.1), ArrowDown: () => this.orbit(0, 0.1),
        "+": () => both(1.2), "=": () => both(1.2), "-": () => both(1 / 1.2), 0: () => (this.reset(), this.draw()),
      }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
  }

  orbit(turn, rise, scenes = ["robot", "path"]) {
    for (const name of scenes) {
      const view = this.views[name];
      view.turn += turn;
      view.rise = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.rise + rise));
    }
    this.draw();
  }

  nearer(scene, factor) {
    const view = this.views[scene];
    view.zoom = Math.max(0.5, Math.min(30, view.zoom * factor));
    this.draw();
  }

  /** @param plan poses of the path that is ahead */
  begin(base, sampleTime, plan = []) {
    Object.assign(this, { base, sampleTime, plan, poses: [], shown: 0, looked: 0, box: { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] } });
    this.look(plan);
  }

  /** Pose that is shown. */
  get pose() {
    return this.poses[this.shown] ?? this.plan[0];
  }

  add(poses) {
    this.poses.push(...poses);
  }

  show(index) {
    this.shown = Math.max(0, Math.min(index, this.poses.length - 1));
    this.draw();
    if (this.poses.length) this.moved(this.poses[this.shown], this.shown);
  }

  /** Replays at eight times real speed. */
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
    const { canvas } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = devicePixelRatio || 1;
    if (!width || !height) return;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    g.lineJoin = g.lineCap = "round";
    g.clearRect(0, 0, width, height);
    this.scenes = [];
    if (!this.base || !this.pose) return;
    this.look(this.poses.slice(this.looked));
    this.looked = this.poses.length;
    // The path is wider than high and gets most of the space: beside the robot, or in a narrow panel the upper half.
    const beside = width >= 520, across = Math.round(width * PATH), down = height / 2;
    if (beside) {
      this.scene(g, "path", 0, 0, across, height);
      this.scene(g, "robot", across, 0, width - across, height);
    } else {
      this.scene(g, "path", 0, 0, width, down);
      this.scene(g, "robot", 0, down, width, down);
    }
    g.strokeStyle = style("--edge");
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(...(beside ? [across, 0] : [0, down]));
    g.lineTo(...(beside ? [across, height] : [width, down]));
    g.stroke();
  }

  scene(g, name, left, top, wide, tall) {
    this.scenes.push({ name, left, top, wide, tall });
    g.save();
    g.beginPath();
    g.rect(left, top, wide, tall);
    g.clip();
    const { turn, rise, zoom } = this.views[name];
    const [ct, st, cr, sr] = [Math.cos(turn), Math.sin(turn), Math.cos(rise), Math.sin(rise)];
    // The z axis points down from the base, along the arms.
    const flat = ([x, y, z]) => [x * ct - y * st, z * cr + (x * st + y * ct) * sr];
    const all = (name === "robot" ? this.whole() : this.corners()).map(flat);
    const [across, down] = [0, 1].map((i) => all.map((point) => point[i]));
    const [low, high] = [[Math.min(...across), Math.min(...down)], [Math.max(...across), Math.max(...down)]];
    const fits = Math.min((wide - 2 * MARGIN) / Math.max(high[0] - low[0], 1e-3), (tall - 2 * MARGIN - 18) / Math.max(high[1] - low[1], 1e-3));
    // A zoomed view stays centred on the tool.
    const [, ...tool] = this.pose, near = Math.min(1, (zoom - 1) / 2), focus = flat(tool);
    const centre = [0, 1].map((i) => (zoom > 1 ? ((low[i] + high[i]) / 2) * (1 - near) + focus[i] * near : (low[i] + high[i]) / 2));
    const at = (point) => flat(point).map((value, i) => (i ? top + tall / 2 + 8 : left + wide / 2) + (value - centre[i]) * fits * zoom);
    if (name === "robot") this.arms(g, at);
    else this.path(g, at, 2.4);
    g.fillStyle = style("--changed");
    g.beginPath();
    g.arc(...at(tool.slice(0, 3)), 5, 0, 2 * Math.PI);
    g.fill();
    g.fillStyle = style("--dim");
    g.font = "12px system-ui, sans-serif";
    g.fillText(name === "robot" ? "robot" : "path of the tool", left + 8, top + 16);
    g.restore();
  }

  /** Outline of the whole robot, for any tilt of the table. */
  whole() {
    return [...this.base.map(([x, y]) => [x, y, 0]), ...this.circle(0.5), ...this.circle(-0.5)];
  }

  /** Corners of the box around the path so far. */
  corners() {
    const { low, high } = this.box;
    return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? high[axis] : low[axis])));
  }

  /** Table: a disc below the lowest tool point so far, tilted about x and turned about its axis. */
  disc(r, a, tilt) {
    const [u, v] = [r * Math.cos(a), r * Math.sin(a)];
    return [u, v * Math.cos(tilt), this.box.high[2] + 0.03 + v * Math.sin(tilt)];
  }

  circle(tilt) {
    return Array.from({ length: 60 }, (_, i) => this.disc(TABLE, (i / 60) * 2 * Math.PI, tilt));
  }

  arms(g, at) {
    const [, x, y, z, tilt, rotation] = this.pose, base = this.base.map(([x, y]) => [x, y, 0]);
    const line = (points, colour, weight, close) => {
      g.beginPath();
      points.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
      if (close) g.closePath();
      g.strokeStyle = colour;
      g.lineWidth = weight;
      g.stroke();
    };
    const rim = this.circle(tilt);
    g.beginPath();
    rim.forEach((point, i) => g[i ? "lineTo" : "moveTo"](...at(point)));
    g.closePath();
    g.fillStyle = style("--panel");
    g.fill();
    line(rim, style("--edge"), 1.5, true);
    line([this.disc(0, 0, tilt), this.disc(TABLE, rotation, tilt)], style("--edge"), 1.5);
    this.path(g, at, 2.2);
    line(base, style("--dim"), 4, true);
    for (const foot of base) line([foot, [x, y, z]], style("--fg"), 4);
    for (const joint of [...base, [x, y, z]]) {
      g.beginPath();
      g.arc(...at(joint), 5, 0, 2 * Math.PI);
      g.fillStyle = style("--fg");
      g.fill();
    }
  }

  /** Extends the box around the path to include poses. */
  look(poses) {
    const { low, high } = this.box;
    for (const [, ...pose] of poses) for (const axis of [0, 1, 2]) [low[axis], high[axis]] = [Math.min(low[axis], pose[axis]), Math.max(high[axis], pose[axis])];
  }

  /** Draws the path: pale what is ahead, then what is behind; cutting moves bold, and in the error colour where the tool error exceeds the permitted one. */
  path(g, at, weight) {
    g.beginPath();
    this.plan.forEach((pose, i) => g[i ? "lineTo" : "moveTo"](...at(pose.slice(1, 4))));
    g.strokeStyle = style("--edge");
    g.lineWidth = 1;
    g.stroke();
    const strokes = [[(pose) => pose[7] !== 1, style("--dim"), 1], [(pose) => pose[7] === 1, style("--accent"), weight], [(pose) => pose[7] === 1 && Math.abs(pose[6]) > ALLOWED, style("--bad"), weight + 2]];
    for (const [drawn, colour, wide] of strokes) {
      g.beginPath();
      let drawing = false;
      // Before a drive, there is only what is ahead.
      for (const pose of this.poses.slice(0, this.shown + 1)) {
        if (!drawn(pose)) drawing = false;
        else if (drawing) g.lineTo(...at(pose.slice(1, 4)));
        else (g.moveTo(...at(pose.slice(1, 4))), (drawing = true));
      }
      g.strokeStyle = colour;
      g.lineWidth = wide;
      g.stroke();
    }
  }
}
