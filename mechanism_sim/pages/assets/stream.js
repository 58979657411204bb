import { Recording, nearest } from 'player';

const TURN = 2 * Math.PI;
const NONE = { t: [], hardest: 0 };
const LAG = 0.12; // [s] of ours that is shown late, so that what comes unevenly is shown evenly
const SMOOTH = 0.3; // [s] over which the pace of what comes is taken
const IDLE = 0.2; // [s] without anything new, beyond three times the usual, after which it rests
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
    this.pace = 0; // of what is shown, [s] of the machine's in one of ours
    this.usual = 0; // the same of what comes, also while nothing does
    this.each = 0; // [s] of ours between batches
    this.spanned = 0; // [s] that charts show
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
      const passed = wall - this.came;
      const share = 1 - Math.exp(-passed / SMOOTH);
      if (passed < this.#patience) {
        const pace = Math.max(0, part.end - before.end) / passed;
        this.usual = this.usual ? this.usual + (pace - this.usual) * share : pace;
        this.pace += (pace - this.pace) * share;
      }
      this.each += (Math.min(passed, this.#patience) - this.each) * share;
    }
    this.came = wall;
    this.parts.push(part);
    if (this.parts.length > KEPT) this.parts.shift();
    for (const impact of impacts) this.hardest = Math.max(this.hardest, impact.impulse);
    this.struck.push(...impacts);
    return part;
  }

  /** How long nothing new may come [s] before what is shown comes to rest. */
  get #patience() { return IDLE + 3 * this.each; }

  /** Lets time go on. @param {number} passed [s] since the last call @param {number} wall [s] */
  tick(passed, wall) {
    if (!this.parts.length) return null;
    const { start } = this.parts[0];
    const { end } = this.parts.at(-1);
    if (wall - this.came > this.#patience) this.pace *= Math.exp(-passed / 0.15);
    if (this.now === null) this.now = end;
    const late = end - this.now - Math.max(LAG, 1.2 * this.each) * this.pace;
    const soon = Math.min(1, passed / Math.max(0.4, this.each));
    const on = Math.max(0, passed * this.pace + late * soon);
    this.now = Math.min(end, Math.max(start, this.now + on));
    return this.#at(this.now);
  }

  /**
   * How much of the machine's time charts show [s], in round numbers: by the pace at which it
   * comes, which may be slower than was asked for, or have no limit.
   * @param {number} seconds of ours @param {number} asked pace, until something comes
   */
  span(seconds, asked) {
    const wanted = seconds * (this.usual || asked || 1);
    if (!this.spanned || Math.abs(Math.log2(wanted / this.spanned)) > 1.2) {
      const ten = 10 ** Math.floor(Math.log10(wanted));
      this.spanned = nearest([1, 2, 5, 10].map((x) => x * ten), wanted);
    }
    return this.spanned;
  }

  /** The places [m] of a pin over the last turn of the drive up to t. */
  path(bearing, t) {
    const places = [];
    let turned = null;
    let later = Infinity;
    for (let p = this.parts.length - 1; p >= 0; p -= 1) {
      const { t: times, drive, pins, bearings, start, end } = this.parts[p];
      if (end < later && later <= t) return places.reverse(); // something is missing between
      later = start;
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
