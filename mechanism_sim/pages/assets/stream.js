import { Recording } from 'player';

const TURN = 2 * Math.PI;
const NONE = { t: [], hardest: 0 };
const LAG = 0.12; // [s] of ours that is shown late, so that what comes unevenly is shown evenly
const SMOOTH = 0.3; // [s] over which the pace of what comes is taken
const KEPT = 240; // batches
const GLOW = 0.25; // [s] of ours that an impact is seen

/** The motion of a machine that runs, shown as evenly as it goes. */
export class Stream {
  /** @param {Object} stage as `Stage.to_json` has it */
  constructor(stage) {
    this.stage = stage;
    this.epoch = null;
    this.clear();
  }

  clear() {
    this.parts = [];
    this.struck = [];
    this.hardest = 0;
    this.pace = 0;
    this.now = null;
    this.came = null;
  }

  /**
   * Takes a batch of frames in.
   * @param {Object} batch a message of type 'frames' @param {number} wall [s]
   * @returns {Recording} its instants
   */
  add({ epoch, frames, impacts }, wall) {
    if (epoch !== this.epoch) this.clear();
    this.epoch = epoch;
    const part = new Recording({ stage: this.stage, frames, impacts: NONE });
    const before = this.parts.at(-1);
    if (before && this.came !== null && wall > this.came) {
      const pace = Math.max(0, part.end - before.end) / (wall - this.came);
      this.pace += (pace - this.pace) * (1 - Math.exp((this.came - wall) / SMOOTH));
    }
    this.came = wall;
    if (before && part.start > before.end) this.parts = []; // something is missing between
    this.parts.push(part);
    if (this.parts.length > KEPT) this.parts.shift();
    for (const impact of impacts) this.hardest = Math.max(this.hardest, impact.impulse);
    this.struck.push(...impacts);
    return part;
  }

  /** Lets time go on. @param {number} passed [s] since the last call @param {number} wall [s] */
  tick(passed, wall) {
    if (!this.parts.length) return null;
    const { start } = this.parts[0];
    const { end } = this.parts.at(-1);
    if (wall - this.came > 0.2) this.pace *= Math.exp(-passed / 0.15);
    if (this.now === null) this.now = end;
    const late = end - this.now - LAG * this.pace;
    const on = Math.max(0, passed * this.pace + late * Math.min(1, passed / 0.4));
    this.now = Math.min(end, Math.max(start, this.now + on));
    return this.#at(this.now);
  }

  /** The places [m] of a pin over the last turn of the drive up to t. */
  path(bearing, t) {
    const places = [];
    let turned = null;
    for (let p = this.parts.length - 1; p >= 0; p -= 1) {
      const { t: times, drive, pins, bearings } = this.parts[p];
      for (let i = times.length - 1; i >= 0; i -= 1) {
        if (times[i] <= t) {
          turned ??= drive[i];
          if (Math.abs(drive[i] - turned) > TURN || places.length > 2000) return places.reverse();
          const at = (i * bearings + bearing) * 2;
          places.push([pins[at], pins[at + 1]]);
        }
      }
    }
    return places.reverse();
  }

  #at(t) {
    const part = this.parts.findLast(({ start }) => start <= t) ?? this.parts[0];
    const frame = part.at(t);
    const glow = GLOW * Math.max(this.pace, 1e-3);
    this.struck = this.struck.filter((impact) => impact.t > t - glow);
    frame.impacts = this.struck.filter((impact) => impact.t <= t).map((impact) => ({
      ...impact, share: impact.impulse / this.hardest, age: (t - impact.t) / glow,
    }));
    return frame;
  }
}
