// Robot panel: drives the robot along the path with the program, and replays the drive.
import { chart } from "./plot.js";
import { Robot } from "./robot.js";
import { fetched } from "./thread.js";

const el = (id) => document.getElementById(id);
const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
/** The build's drive along the path, once it is asked for. */
let ahead;
const prepared = () => (ahead ??= fetched("ahead/drive.json.gz").then((bytes) => JSON.parse(new TextDecoder().decode(bytes))));
/** Number of periods per call. */
const PERIODS = 2000;
/** Tool error that the founding paper permits while cutting, µm. */
const LIMIT = 10;

export class Drive {
  /** @param machine the worker; for `work` and `current` see main.js */
  constructor({ machine, work, current }) {
    Object.assign(this, { machine, work, current, driving: false });
    this.robot = new Robot(el("scene"), (pose, index) => this.shows(pose, index), () => (el("play").textContent = "Play"));
    el("drive").addEventListener("click", () => this.drive());
    el("play").addEventListener("click", () => this.play());
    el("time").addEventListener("input", () => {
      this.robot.play(false);
      el("play").textContent = "Play";
      this.robot.show(Number(el("time").value));
    });
  }

  draw() {
    this.robot.draw();
    // A replay begins when somebody sees it.
    if (this.waits) this.starts();
  }

  /** Dims the result of an earlier program's drive. */
  set old(on) {
    this.isOld = on && this.robot.poses.length > 0;
    el("robot").classList.toggle("old", this.isOld);
    if (on) this.robot.play(false);
  }

  /** Whether nothing has been driven since a program was opened. */
  get idle() {
    return !this.driving && !this.tried;
  }

  /** Says, before the first drive, what there is to drive. */
  offer() {
    if (!this.idle) return;
    this.prepare(false);
    el("drove").textContent = "The program as the controller of the five-axis hybrid robot, in a closed loop.";
  }

  /** Discards the drive. */
  clear() {
    this.waits = false;
    this.tried = this.driving = this.built = false;
    this.drives = (this.drives ?? 0) + 1;
    this.robot.play(false);
    this.robot.begin(null, 0);
    this.robot.draw();
    this.error?.destroy();
    this.error = null;
    el("play").hidden = true;
    el("time").disabled = true;
    el("drove").textContent = "";
    el("robot-fault").textContent = "";
    el("robot").classList.remove("old");
  }

  /** Shows path and robot before a drive; with `whole`, the build's drive, which this program on this machine repeats. */
  async prepare(whole) {
    const mine = this.drives;
    try {
      const drive = await prepared();
      if (mine !== this.drives || !this.idle) return;
      this.robot.begin(drive.base, drive.sample_time, drive.poses);
      if (!whole) return this.robot.draw();
      this.tried = this.built = true;
      this.robot.over = false;
      this.starts();
      this.robot.add(drive.poses);
      this.tells(drive, "driven when this page was built");
      this.ends();
    } catch {
      // The page's folder lacks the file: the robot is there once it is driven.
    }
  }

  play() {
    const { robot } = this;
    if (!robot.playing && robot.over && robot.shown >= robot.poses.length - 1) robot.show(0);
    robot.play(!robot.playing);
    el("play").textContent = robot.playing ? "Pause" : "Play";
  }

  shows(pose, index) {
    el("time").value = index;
    el("time-at").textContent = `${(pose[0] * this.robot.sampleTime).toFixed(1)} s`;
    this.error?.cursor(index);
  }

  drive() {
    if (this.idle) el("drove").textContent = "The drive begins as soon as the program is assembled.";
    return this.work(async () => {
      await this.current();
      const { base, sampleTime, plan } = this.robot;
      this.clear();
      this.robot.begin(base, sampleTime, plan);
      this.robot.draw();
      el("drove").textContent = "The robot starts …";
      this.driving = this.tried = true;
      const mine = this.drives;
      try {
        await this.along(mine);
      } finally {
        if (mine === this.drives) this.driving = false;
      }
    });
  }

  /** Drives along the path until another drive begins. */
  async along(mine) {
    const { robot } = this, begun = performance.now();
    for (let begin = true, over = false; !over; begin = false) {
      const part = await this.machine.call("track", { begin, periods: PERIODS });
      if (mine !== this.drives) return;
      if (begin) {
        robot.begin(part.base, part.sample_time, robot.plan);
        robot.over = false;
        this.starts();
      }
      robot.add(part.poses);
      over = part.over;
      const seconds = (performance.now() - begun) / 1000;
      el("robot-fault").textContent = part.fault ?? "";
      this.tells(part, `${(part.operations / seconds / 1e6).toFixed(1)} million operations/s here`);
    }
    this.ends();
  }

  starts() {
    this.waits = el("robot").hidden;
    this.robot.play(!this.waits);
    el("play").hidden = false;
    el("play").textContent = this.waits ? "Play" : "Pause";
    el("time").disabled = false;
  }

  /** Tells how far the drive is, and its figures. */
  tells(part, more) {
    el("time").max = this.robot.poses.length - 1;
    el("drove").textContent = `${(part.done * part.sample_time).toFixed(1)} s of ${(part.all * part.sample_time).toFixed(1)} s of path; ${plural(part.cycles, "cycle")} a period, ${part.longest} at most; largest tool error ${(part.cutting * 1e6).toFixed(2)} µm cutting, ${(part.overall * 1e6).toFixed(2)} µm overall; ${more}`;
  }

  ends() {
    const { robot } = this, { poses } = robot;
    robot.over = true;
    this.error = chart(el("error-chart"), {
      x: poses.map((pose) => pose[0] * robot.sampleTime), name: "time", label: "time", unit: "s", height: () => 150, lines: [{ at: LIMIT, text: `${LIMIT} µm` }],
      curves: [{ name: "tool error", unit: "µm", values: poses.map((pose) => pose[6] * 1e6) }], picked: (index) => (robot.play(false), (el("play").textContent = "Play"), robot.show(index)),
    });
  }
}
