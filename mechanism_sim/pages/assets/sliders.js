import { html } from 'html';

const EVERY = 150; // [ms] between what is sent while a slider moves
const PATIENCE = 20_000; // [ms] that a value is shown as asked for while the machine has another
const WAYS = 1000;
const DIGITS = 4; // that tell each of these from the next
const ANEW = 'restarts the run';

/** Whether a value is that of the machine, but for rounding. */
const same = ({ known, control: { low, high } }, value) => (
  Math.abs(value - known) <= 1e-6 * Math.abs(known) + 1e-9 * (high - low));

/** Whether a value is what was asked for last, or what the machine has. */
const known = (slider, value) => (
  value === slider.asked || (slider.asked === null && same(slider, value)));

/** Sliders for the values of a machine. */
export class Sliders {
  /**
   * @param {HTMLElement} parent
   * @param {function(string, number): void} ask is called with a control's path and a value
   * @param {number} every [ms] between these calls while a slider moves
   */
  constructor(parent, ask, every = EVERY) {
    this.parent = parent;
    this.every = every;
    this.ask = ask;
    this.all = new Map();
    parent.addEventListener('submit', (event) => event.preventDefault());
  }

  /** @param {Object[]} controls as `Control.to_json` has them */
  show(controls) {
    const alike = controls.length === this.all.size
      && controls.every(({ path, low, high }) => {
        const known = this.all.get(path)?.control;
        return known && known.low === low && known.high === high;
      });
    if (!alike) {
      this.all = new Map(controls.map((control) => [control.path, this.#make(control)]));
      this.parent.replaceChildren(...[...this.all.values()].map(({ box }) => box));
    }
    this.set(Object.fromEntries(controls.map(({ path, value }) => [path, value])), true);
  }

  /** What the machine has. @param {Object<string, number>} values @param {boolean} operable */
  set(values, operable) {
    for (const [path, value] of Object.entries(values)) {
      const slider = this.all.get(path);
      if (!slider) continue;
      slider.known = value;
      const waits = slider.asked !== null && !same(slider, slider.asked)
        && performance.now() < slider.until;
      if (!slider.held && !waits) this.#take(slider);
    }
    for (const { control, input } of this.all.values()) {
      input.disabled = !operable && control.effect === 'restart';
    }
  }

  /** What was asked for last is not done: the machine's own value is shown again. */
  refuse(path) {
    const slider = this.all.get(path);
    if (slider) this.#take(slider);
  }

  #take(slider) {
    slider.asked = null;
    slider.input.value = place(slider.control, slider.known);
    write(slider, slider.known);
    if (slider.note) slider.note.textContent = ANEW;
  }

  #make(control) {
    const { path } = control;
    const id = `set ${path}`;
    const output = html('output');
    const input = html('input', { id, type: 'range', min: 0, max: WAYS, step: 1, 'data-path': path });
    const note = control.effect === 'restart' ? html('small', { role: 'status' }, ANEW) : null;
    const label = html('label', { for: id }, control.label);
    const box = html('div', { class: 'slider' }, label, output, input, ...(note ? [note] : []));
    const slider = { control, box, input, output, note, asked: null, known: control.value,
      key: null, held: false, until: 0, sent: 0, later: 0 };
    input.addEventListener('keydown', () => { slider.key = Number(input.value); });
    input.addEventListener('input', () => this.#move(slider));
    input.addEventListener('change', () => this.#send(slider, true));
    return slider;
  }

  #move(slider) {
    slider.held = true; // by a hand
    if (slider.key !== null) step(slider);
    write(slider, valueOf(slider));
    if (slider.control.effect !== 'now' || slider.later) return;
    const wait = Math.max(0, slider.sent + this.every - performance.now());
    slider.later = setTimeout(() => this.#send(slider), wait);
  }

  #send(slider, released = false) {
    clearTimeout(slider.later);
    slider.later = 0;
    slider.held = !released;
    const value = valueOf(slider);
    if (known(slider, value)) return;
    slider.sent = performance.now();
    slider.until = slider.sent + PATIENCE;
    slider.asked = value;
    if (slider.note) slider.note.textContent = 'restarting …';
    this.ask(slider.control.path, value);
  }
}

/** Moves the thumb, which a key has moved, on to where the rounded value is another. */
function step(slider) {
  const { input } = slider;
  const way = Math.sign(Number(input.value) - slider.key);
  const before = slider.asked ?? slider.known;
  const stays = (value) => known(slider, value) || way * (value - before) < 0;
  while (input.value > 0 && input.value < WAYS && stays(valueOf(slider))) {
    input.value = Number(input.value) + way;
  }
  slider.key = null;
}

function valueOf({ control, input }) {
  const { low, high, step, logarithmic } = control;
  const share = Number(input.value) / WAYS;
  if (share === 0 || share === 1) return share ? high : low;
  const value = logarithmic ? low * (high / low) ** share : low + share * (high - low);
  const round = step ? Math.round(value / step) * step : Number(value.toPrecision(2));
  return Math.min(high, Math.max(low, Number(round.toPrecision(12))));
}

/** Where on its way a slider stands for a value. */
function place({ low, high, logarithmic }, value) {
  const share = logarithmic ? Math.log(value / low) / Math.log(high / low)
    : (value - low) / (high - low);
  return Math.round(WAYS * Math.min(1, Math.max(0, share)));
}

function write({ control, input, output }, value) {
  output.textContent = control.path === 'realtime_factor' && !value ? 'no limit'
    : `${Number(value.toPrecision(DIGITS))} ${control.unit}`.trim();
  input.setAttribute('aria-valuetext', output.textContent);
}
