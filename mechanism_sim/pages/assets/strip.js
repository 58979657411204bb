import { html } from 'html';
import { quantity, step } from 'svg';

const ROOM = { left: 76, right: 4, top: 8, bottom: 16 }; // [px]; on the left for '-500 mN m'
const LINES = 3;
const ROUNDING = 1e-8; // of the largest

/** A curve over the last moments, and marks where something struck. */
export class Strip {
  /**
   * @param {HTMLElement} parent
   * @param {{label: string, unit: string, scale?: number, usual?: number}} what `scale`: how many
   *   of its unit an SI unit is; without it units take the prefixes of SI. `usual`: about how
   *   large it is in this machine [SI]; what is smaller by far is rounding, and zero
   */
  constructor(parent, { label, unit, scale, usual = 0 }) {
    this.unit = unit;
    this.plain = scale !== undefined;
    this.scale = scale ?? 1;
    this.usual = usual * this.scale;
    this.largest = this.usual;
    this.value = html('output');
    this.canvas = html('canvas', { role: 'img', 'aria-label': `${label} over the last moments` });
    const caption = html('figcaption', {}, html('span', {}, label), this.value);
    parent.append(html('figure', {}, caption, this.canvas));
    this.clear();
  }

  clear() {
    this.t = [];
    this.y = [];
    this.struck = [];
    this.largest = this.usual;
    this.value.textContent = '';
  }

  /** @param {ArrayLike<number>} t [s] @param {ArrayLike<number>} y SI */
  add(t, y) {
    for (let i = 0; i < t.length; i += 1) {
      if (!this.t.length || t[i] > this.t.at(-1) || Number.isNaN(this.y.at(-1))) {
        this.t.push(t[i]);
        this.y.push(this.scale * y[i]);
        this.largest = Math.max(this.largest, Math.abs(this.scale * y[i]) || 0);
      }
    }
  }

  /** Something is missing before an instant: no line leads there. @param {number} t [s] */
  part(t) {
    if (!this.t.length) return;
    this.t.push(t);
    this.y.push(NaN);
  }

  /** @param {number} t [s] of an impact */
  mark(t) { this.struck.push(t); }

  /** Draws what was up to `now`. @param {number} now [s] @param {number} span [s] */
  draw(now, span) {
    const old = this.t.findIndex((t) => t >= now - span);
    if (old > 400) {
      this.t.splice(0, old - 1);
      this.y.splice(0, old - 1);
    }
    this.struck = this.struck.filter((t) => t >= now - span);
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    const ratio = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const pen = this.canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const points = this.#shown(now, span);
    const values = points.map(([, y]) => y).filter((y) => !Number.isNaN(y));
    if (values.length < 2 || !width) return;
    const [low, high] = range(values, ROUNDING * this.largest);
    const x = (t) => width - ROOM.right
      - ((now - t) / span) * (width - ROOM.left - ROOM.right);
    const y = (value) => ROOM.top
      + ((high - value) / (high - low)) * (height - ROOM.top - ROOM.bottom);
    const shade = (name) => getComputedStyle(this.canvas).getPropertyValue(name);
    this.#frame(pen, { low, high, y, width, height, span, shade });
    pen.strokeStyle = shade('--touching');
    pen.lineWidth = 1;
    pen.beginPath();
    for (const t of this.struck.filter((at) => at <= now)) {
      pen.moveTo(x(t), height - ROOM.bottom);
      pen.lineTo(x(t), height - ROOM.bottom - 7);
    }
    pen.stroke();
    pen.strokeStyle = shade('--accent');
    pen.lineWidth = 1.5;
    pen.lineJoin = 'round';
    pen.beginPath();
    let joined = false;
    for (const [t, value] of points) {
      const known = !Number.isNaN(value);
      if (known && joined) pen.lineTo(x(t), y(value));
      else if (known) pen.moveTo(x(t), y(value));
      joined = known;
    }
    pen.stroke();
    const [, last] = points.findLast(([, value]) => !Number.isNaN(value));
    this.value.textContent = this.#written(last);
  }

  #shown(now, span) {
    const inside = this.t.findIndex((t) => t >= now - span);
    if (inside < 0) return [];
    const first = Math.max(0, inside - 1);
    const points = [];
    for (let i = first; i < this.t.length && this.t[i] <= now; i += 1) {
      points.push([Math.max(this.t[i], now - span), this.#rounded(this.y[i])]);
    }
    return points;
  }

  #rounded(value) { return Math.abs(value) < ROUNDING * this.largest ? 0 : value; }

  #frame(pen, { low, high, y, width, height, span, shade }) {
    pen.strokeStyle = shade('--faint');
    pen.lineWidth = 1;
    pen.fillStyle = shade('--soft');
    pen.font = '11px system-ui, sans-serif';
    const each = step((high - low) / LINES);
    pen.beginPath();
    for (let k = Math.ceil(low / each); k * each <= high; k += 1) {
      const at = Math.round(y(k * each)) + 0.5;
      pen.moveTo(ROOM.left, at);
      pen.lineTo(width - ROOM.right, at);
    }
    pen.stroke();
    pen.textAlign = 'right';
    pen.textBaseline = 'middle';
    for (let k = Math.ceil(low / each); k * each <= high; k += 1) {
      pen.fillText(this.#written(k * each), ROOM.left - 5, Math.round(y(k * each)));
    }
    pen.textBaseline = 'bottom';
    pen.fillText(`last ${quantity(span, 's')}`, width - ROOM.right, height - 1);
  }

  #written(value) {
    return this.plain ? `${Number(value.toPrecision(4))} ${this.unit}`
      : quantity(value, this.unit);
  }
}

/** Limits around values; never so near to each other that rounding is seen. */
function range(values, rounding) {
  const low = values.reduce((a, b) => Math.min(a, b), Infinity);
  const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  const room = Math.max(0.12 * (high - low), 0.05 * Math.max(Math.abs(high), Math.abs(low)), rounding) || 1;
  return [low - room, high + room];
}
