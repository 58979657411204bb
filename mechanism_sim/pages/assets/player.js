const TURN = 2 * Math.PI;
const ARRAYS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array, i1: Int8Array,
  i2: Int16Array };

/** What is written in base64. @returns {Uint8Array} */
export function bytes(base64) {
  const text = atob(base64);
  const found = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i += 1) found[i] = text.charCodeAt(i);
  return found;
}

/** An array as plotly writes it. @param {{dtype: string, bdata: string}} packed */
export function unpack({ dtype, bdata }) {
  return new ARRAYS[dtype](bytes(bdata).buffer);
}

/** The last index whose value is not above x; 0 if there is none. */
export function search(values, x) {
  let [low, high] = [0, values.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

/** That of some positive numbers whose ratio to a wanted one is nearest to 1. */
export function nearest(all, wanted) {
  const far = (x) => Math.abs(Math.log(x / wanted));
  return all.reduce((a, b) => (far(b) < far(a) ? b : a));
}

/** Shows on the button of a page, and says to its styles, whether it plays. */
export function showPlaying(playing) {
  document.documentElement.dataset.playing = playing ? '1' : '';
  document.getElementById('play').setAttribute('aria-label', playing ? 'pause' : 'play');
}

/** A run between its instants. */
export class Recording {
  /** @param {Object} data with `stage`, `frames` and `impacts` as `Recorded.to_json` has them */
  constructor({ stage, frames, impacts }) {
    const columns = Object.entries(frames).map(([name, packed]) => [name, unpack(packed)]);
    Object.assign(this, Object.fromEntries(columns));
    this.struck = Object.fromEntries(Object.entries(impacts)
      .map(([name, value]) => [name, value.bdata === undefined ? value : unpack(value)]));
    this.links = stage.links.length;
    this.radial = stage.bearings.map(({ radial }) => radial);
    this.bearings = stage.bearings.length;
    this.joints = stage.joints.length;
    this.plays = stage.plays.length;
    this.frames = stage.frames?.length ?? 0;
    this.moving = stage.joints.filter(({ foot }) => foot !== undefined).length;
    this.slides = stage.slides;
    this.wide = this.poses.length / (this.t.length * this.links) || 3;
  }

  get start() { return this.t[0]; }

  get end() { return this.t[this.t.length - 1]; }

  /**
   * The machine at an instant, straight between those recorded; pins on cubics.
   * @param {number} t @param {number} glow how long impacts are seen [s]
   * @returns {import('stage').Frame}
   */
  at(t, glow = 0) {
    const i = search(this.t, t);
    const j = Math.min(i + 1, this.t.length - 1);
    const share = j > i ? Math.min(1, Math.max(0, (t - this.t[i]) / (this.t[j] - this.t[i]))) : 0;
    const between = (values, k, width) => Array.from({ length: k }, (_, row) => Array.from(
      { length: width }, (__, c) => {
        const at = row * width + c;
        const [a, b] = [values[i * k * width + at], values[j * k * width + at]];
        return a + share * (b - a);
      }));
    const poses = between(this.poses, this.links, this.wide);
    for (let link = 0; link < this.links; link += 1) {
      const at = link * this.wide + 2;
      const each = this.links * this.wide;
      const [a, b] = [this.poses[i * each + at], this.poses[j * each + at]];
      poses[link][2] = a + share * (b - a - TURN * Math.round((b - a) / TURN));
    }
    return {
      t,
      poses,
      pins: this.#pins(i, j, share),
      modes: Array.from(this.modes.subarray(i * this.bearings, (i + 1) * this.bearings)),
      walls: between(this.walls, this.plays, 2),
      off: between(this.off, this.plays, 2),
      touching: Array.from(this.touching.subarray(i * this.plays, (i + 1) * this.plays)),
      forces: between(this.forces, this.joints, 2),
      feet: between(this.feet, this.moving, 2),
      sway: between(this.sway, this.frames, 3),
      drive: this.drive[i] + share * (this.drive[j] - this.drive[i]),
      impacts: this.#impacts(t, glow),
    };
  }

  /** Cubics through places and rates of pins at two instants, within the wall or what both were. */
  #pins(i, j, s) {
    const h = this.t[j] - this.t[i];
    const [a, b] = [(1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s)];
    const [c, d] = [h * s * (1 - s) ** 2, h * s * s * (s - 1)];
    const each = 2 * this.bearings;
    const at = (k) => a * this.pins[i * each + k] + b * this.pins[j * each + k]
      + c * this.pin_rates[i * each + k] + d * this.pin_rates[j * each + k];
    return this.radial.map((radial, k) => {
      const pin = [at(2 * k), at(2 * k + 1)];
      const far = [i, j].map((n) => Math.hypot(this.pins[n * each + 2 * k], this.pins[n * each + 2 * k + 1]));
      const share = Math.min(1, Math.max(radial, ...far) / (Math.hypot(...pin) || 1));
      return pin.map((x) => share * x);
    });
  }

  /** The places [m] of a pin over the last turn of the drive up to t, at most `span` [s]. */
  path(bearing, t, span) {
    const i = search(this.t, t);
    const now = this.drive[i];
    let first = i;
    const far = this.slides ? Infinity : TURN;
    while (first > 0 && t - this.t[first] < span
      && Math.abs(this.drive[first] - now) < far) first -= 1;
    const places = [];
    for (let k = first; k <= i; k += 1) {
      const at = (k * this.bearings + bearing) * 2;
      places.push([this.pins[at], this.pins[at + 1]]);
    }
    places.push(this.at(t).pins[bearing]);
    return places;
  }

  /** The instants of the last turn of the drive, or of all, at most so many. */
  turn(most = 1500) {
    const last = this.t.length - 1;
    let first = last;
    while (first > 0 && (this.slides || Math.abs(this.drive[last] - this.drive[first]) < TURN)) first -= 1;
    const step = Math.max(1, Math.ceil((last - first) / most));
    const found = [];
    for (let i = first; i <= last; i += step) found.push(this.at(this.t[i]));
    return found;
  }

  /** The impacts of the last `glow` seconds. */
  #impacts(t, glow) {
    const { t: times, bearing, joint, angle, impulse, hardest } = this.struck;
    const seen = [];
    for (let k = times.length ? search(times, t) : -1; k >= 0 && t - times[k] < glow; k -= 1) {
      if (times[k] <= t) {
        seen.push({ bearing: bearing[k], joint: joint[k], angle: angle[k], impulse: impulse[k],
          share: impulse[k] / hardest, age: (t - times[k]) / glow });
      }
    }
    return seen;
  }
}

/** Moves through a recording as time goes on. */
export class Player {
  /** @param {Recording} frames @param {function(Object): void} onFrame shows an instant */
  constructor(frames, onFrame) {
    this.frames = frames;
    this.onFrame = onFrame;
    this.speed = 1;
    this.playing = false;
    this.loop = null; // interval [s] that is played over and over
    this.seek(frames.start);
  }

  /** Of the machine [s]. */
  get time() { return this.now; }

  /** How long impacts are seen, in the machine's time [s]: a quarter of a second of ours. */
  get glow() { return 0.25 * this.speed; }

  play() {
    if (this.playing) return;
    if (this.now >= this.frames.end) this.now = this.frames.start;
    this.playing = true;
    this.last = null;
    requestAnimationFrame((wall) => this.#tick(wall));
  }

  pause() {
    this.playing = false;
    this.seek(this.now);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  /** @param {number} t [s]; the nearest there is */
  seek(t) {
    this.now = Math.min(Math.max(t, this.frames.start), this.frames.end);
    this.#show();
  }

  /** To another of the recorded instants; those before and after an impact count as one. */
  step(count) {
    const { t } = this.frames;
    const apart = 1e-9 * (this.frames.end - this.frames.start);
    this.playing = false;
    for (let left = Math.abs(count); left > 0; left -= 1) {
      const i = count > 0 ? search(t, this.now + apart) + 1 : search(t, this.now - apart);
      this.now = t[Math.min(i, t.length - 1)];
    }
    this.seek(this.now);
  }

  #tick(wall) {
    if (!this.playing) return;
    const passed = this.last === null ? 0 : Math.min(wall - this.last, 100) / 1000;
    this.last = wall;
    this.now = Math.min(this.now + passed * this.speed, this.frames.end);
    if (this.loop && !(this.now >= this.loop[0] && this.now < this.loop[1])) [this.now] = this.loop;
    if (this.now >= this.frames.end) this.playing = false;
    this.#show();
    if (this.playing) requestAnimationFrame((next) => this.#tick(next));
  }

  #show() {
    this.onFrame(this.frames.at(this.now, this.glow), this);
  }
}
