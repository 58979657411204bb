import { html } from 'html';
import { quantity } from 'svg';

const [LEAST, MOST] = [1e-5, 3e-3]; // [m] of radial clearance that the slider reaches
const TITLES = { force: 'force', drive: 'effort of', impacts: 'impacts', hardest: 'hardest impact' };

/** A slider that wears a pin, and the loads of the run before and after. */
export class Wear {
  /** @param {function(Object): void} ask for a run */
  constructor(ask) {
    Object.assign(this, { ask, joint: '', radial: 0 });
  }

  /** @param {HTMLElement} host @param {Object<string, ?number>} pins with their clearances [m] */
  show(host, pins) {
    const names = Object.keys(pins);
    if (!names.length) return;
    if (!names.includes(this.joint)) Object.assign(this, { joint: names.find((name) => pins[name]) ?? names.at(-1), radial: 0 });
    this.choice = html('select', { id: 'wear-joint', 'aria-label': 'pin that wears' },
      ...names.map((name) => new Option(name, name, false, name === this.joint)));
    const now = this.radial || pins[this.joint] || LEAST;
    this.slider = html('input', { type: 'range', id: 'wear-radial', min: Math.log(LEAST), max: Math.log(MOST),
      step: 'any', value: Math.log(now), 'aria-label': 'radial clearance after wear' });
    this.size = html('output', { for: 'wear-radial' }, this.radial ? quantity(this.radial, 'm') : 'as drawn');
    this.table = html('div', { id: 'worn', role: 'status' });
    for (const each of [this.choice, this.slider]) each.disabled = true;
    this.choice.addEventListener('change', () => { this.joint = this.choice.value; this.#run(); });
    this.slider.addEventListener('input', () => { this.size.textContent = quantity(this.#value(), 'm'); });
    this.slider.addEventListener('change', () => this.#run());
    host.replaceChildren(html('h3', {}, 'Wear of a pin'),
      html('div', { class: 'wear' }, this.choice, this.slider, this.size), this.table);
  }

  /** There is a run to compare with. */
  enable() {
    for (const each of [this.choice, this.slider]) if (each) each.disabled = false;
    if (this.radial && this.table) this.table.textContent = 'running with wear …';
  }

  /** @param {Array} before and @param {Object} after: figures, or the problem, with wear */
  compare(before, { joint, radial, figures, problem }) {
    if (!this.table || joint !== this.joint) return;
    if (problem) {
      this.table.replaceChildren(html('p', { class: 'wrong' }, problem));
      return;
    }
    const key = ([what, name]) => (what === 'hardest' ? what : `${what} ${name}`);
    const old = new Map(before.map((figure) => [key(figure), figure]));
    const shown = (value, unit) => (value === null ? 'no limit' : unit ? quantity(value, unit) : value);
    const rows = figures.map((figure) => {
      const [what, name, value, unit] = figure;
      const was = old.get(key(figure))?.[2];
      const ratio = was && value !== null ? `× ${Number((value / was).toPrecision(3))}` : '';
      const cells = [was === undefined ? '–' : shown(was, unit), shown(value, unit), ratio];
      return html('tr', { 'data-worn': key(figure) }, html('th', {}, `${TITLES[what]} ${name}`.trim()),
        ...cells.map((text) => html('td', {}, String(text))));
    });
    const heads = ['', 'before', `${quantity(radial, 'm')}`, ''].map((text) => html('th', {}, text));
    this.table.replaceChildren(html('table', {}, html('tr', {}, ...heads), ...rows));
  }

  #value() {
    return Number(Math.exp(this.slider.value).toPrecision(2));
  }

  #run() {
    this.radial = this.#value();
    this.table.textContent = 'running with wear …';
    this.ask({ type: 'wear', joint: this.joint, radial: this.radial });
  }
}

/** How long a run is: as the scene says, or what follows from the drive. */
export class LengthOfRun {
  /** @param {function(Object): void} ask for changes */
  constructor(ask) {
    this.ask = ask;
  }

  /** @param {HTMLElement} host @param {string} given in the scene */
  show(host, given) {
    this.field = html('input', { id: 'duration', value: given, spellcheck: 'false', autocomplete: 'off', size: '9' });
    this.field.addEventListener('change', () => this.ask({ type: 'set', path: ['duration'], text: this.field.value }));
    host.replaceChildren(html('label', { class: 'length' }, 'Length of the run ', this.field));
  }

  /** @param {number} end [s] of the run that is there */
  tell(end) {
    if (this.field) this.field.placeholder = quantity(end, 's');
  }
}
