import { add, line, step } from 'svg';
import { search, unpack } from 'player';

const [WIDEST, HEIGHT] = [640, 220];
const ROOM = { left: 56, right: 12, top: 30, bottom: 34 };

/** A quantity of each run of a family over time: the chosen one in colour, all others pale. */
export class Curves {
  /**
   * @param {SVGSVGElement} svg to draw in
   * @param {{label: string, unit: string, runs: {at: Object, values: Object}[], along: ?string,
   *   every: ?number}} what times [s], or what else it says, and values, as arrays or packed
   */
  constructor(svg, { label, unit, runs, along = 'time [s]', every = 0 }) {
    const read = (x) => (x.bdata === undefined ? x : unpack(x));
    this.runs = runs.map(({ at, values }) => [read(at), read(values)]);
    const [times, values] = [0, 1].map((k) => this.runs.flatMap((run) => Array.from(run[k])));
    const least = (all) => all.reduce((a, b) => Math.min(a, b), Infinity);
    const most = (all) => all.reduce((a, b) => Math.max(a, b), -Infinity);
    const width = Math.min(WIDEST, svg.clientWidth || WIDEST); // so that letters are as large
    this.right = width - ROOM.right;
    this.x = scale(least(times), most(times), ROOM.left, this.right);
    this.y = scale(least(values), most(values), HEIGHT - ROOM.bottom, ROOM.top);
    svg.replaceChildren();
    svg.setAttribute('viewBox', `0 0 ${width} ${HEIGHT}`);
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', `${label} over ${along}, for each value of the slider`);
    add(svg, 'text', { x: 2, y: 14 }).textContent = `${label} [${unit}]`;
    add(svg, 'text', { x: this.right, y: HEIGHT - 4, class: 'end' }).textContent = along;
    for (const [at, far] of ticks(this.y)) {
      add(svg, 'path', { class: 'grid', d: line([[ROOM.left, far], [this.right, far]]) });
      add(svg, 'text', { x: ROOM.left - 6, y: far + 4, class: 'end' }).textContent = at;
    }
    for (const [at, far] of ticks(this.x, every).slice(0, -1)) {
      add(svg, 'text', { x: far, y: HEIGHT - ROOM.bottom + 16, class: 'mid' }).textContent = at;
    }
    this.paths = this.runs.map(([at, of]) => add(svg, 'path', {
      class: 'curve', d: line(Array.from(at, (t, i) => [this.x.to(t), this.y.to(of[i])])),
    }));
    this.cursor = add(svg, 'path', { class: 'now' });
    this.dot = add(svg, 'circle', { class: 'dot', r: 4 });
    this.choose(0);
  }

  /** @param {number} index of the run that is shown */
  choose(index) {
    this.chosen = index;
    this.paths.forEach((path, k) => path.classList.toggle('chosen', k === index));
    this.cursor.before(this.paths[index]);
  }

  /** @param {number} t [s] */
  show(t) {
    const [at, values] = this.runs[this.chosen];
    const i = search(at, t);
    const j = Math.min(i + 1, at.length - 1);
    const share = j > i && at[j] > at[i] ? Math.min(1, (t - at[i]) / (at[j] - at[i])) : 0;
    const [x, y] = [this.x.to(t), this.y.to(values[i] + share * (values[j] - values[i]))];
    this.cursor.setAttribute('d', line([[x, ROOM.top], [x, HEIGHT - ROOM.bottom]]));
    this.dot.setAttribute('cx', x.toFixed(2));
    this.dot.setAttribute('cy', y.toFixed(2));
  }
}

function scale(low, high, from, to) {
  const room = high > low ? 0 : Math.abs(high) || 1;
  const [least, most] = [low - room, high + room];
  return { low: least, high: most, to: (x) => from + ((x - least) / (most - least)) * (to - from) };
}

/** Round numbers along an axis, `every` so many or as they come, and where they are. */
function ticks({ low, high, to }, every = 0) {
  const each = every && high - low > every ? every * Math.ceil((high - low) / (7 * every)) : step((high - low) / 4);
  const found = [];
  for (let k = Math.ceil(low / each); k * each <= high; k += 1) {
    found.push([String(Number((k * each).toPrecision(6))), to(k * each)]);
  }
  return found;
}
