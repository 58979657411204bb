import { Stage } from 'stage';
import { add, arrow, carried, line } from 'svg';

const NEAR = 14; // [pixels] within which a handle is caught
const STILL = 4; // [pixels] that a click may move
const ROOM = 70; // [pixels] around what is fitted
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/**
 * The sheet on which a machine is drawn: what is seen of it, and what the pointer grabs.
 * Places are [m] in the world, and pixels of the sheet.
 */
export class Canvas {
  /**
   * @param {SVGSVGElement} under of the grid @param {SVGSVGElement} svg of the machine
   * @param {SVGSVGElement} over what lies above it
   * @param {function(Object): void} act on gestures
   */
  constructor(under, svg, over, act) {
    Object.assign(this, { under, svg, over, act, tool: 'move', pressed: null, handles: [] });
    this.fingers = new Map();
    this.centre = [0, 0];
    this.scale = 2000; // pixels in a metre
    this.grid = add(under, 'g', { class: 'grid' });
    for (const name of ['curves', 'signs', 'band', 'knobs', 'pen']) this[name] = add(over, 'g', { class: name });
    this.marks = [];
    this.layers = { names: false, forces: true };
    over.setAttribute('tabindex', 0);
    over.setAttribute('role', 'application');
    over.setAttribute('aria-label', 'sheet: arrows move the pen, Enter draws');
    over.addEventListener('keydown', (event) => this.#write(event));
    over.addEventListener('focus', () => { this.at = over.matches(':focus-visible') ? this.centre.map((x) => this.#round(x)) : null; this.#pen(); });
    over.addEventListener('blur', () => { this.at = null; this.#pen(); });
    over.addEventListener('pointerdown', (event) => this.#down(event));
    over.addEventListener('pointermove', (event) => this.#move(event));
    over.addEventListener('pointerup', (event) => this.#up(event));
    over.addEventListener('pointercancel', () => this.cancel());
    over.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-0.0015 * event.deltaY), this.#pixel(event));
    }, { passive: false });
    this.bounds = null; // shown whole, until it is zoomed or shifted by hand
    new ResizeObserver(() => (this.bounds ? this.fit(this.bounds) : this.#look())).observe(over);
  }

  get size() { return [this.over.clientWidth || 1, this.over.clientHeight || 1]; }

  /** Of what is placed by hand: a round length of a pixel or less, or of some on a coarse grid. */
  get step() {
    return 10 ** Math.floor(Math.log10(5 / this.scale) + 1e-9);
  }

  /** [m] within which a handle is caught. */
  get near() { return NEAR / this.scale; }

  /** @param {number[]} p @returns {number[]} [m] */
  world([x, y]) {
    const [w, h] = this.size;
    return [this.centre[0] + (x - 0.5 * w) / this.scale, this.centre[1] - (y - 0.5 * h) / this.scale];
  }

  /** @param {number[]} p @returns {number[]} pixels */
  sheet([x, y]) {
    const [w, h] = this.size;
    return [0.5 * w + (x - this.centre[0]) * this.scale, 0.5 * h - (y - this.centre[1]) * this.scale];
  }

  zoom(factor, about = this.size.map((x) => 0.5 * x)) {
    const before = this.world(about);
    this.scale = Math.min(1e7, Math.max(1, this.scale * factor));
    const after = this.world(about);
    this.centre = this.centre.map((x, i) => x + before[i] - after[i]);
    this.bounds = null;
    this.#look();
  }

  /** Shows all within bounds. @param {number[]} bounds left, bottom, right, top [m] */
  fit([left, bottom, right, top]) {
    const [w, h] = this.size;
    this.bounds = [left, bottom, right, top];
    this.centre = [0.5 * (left + right), 0.5 * (bottom + top)];
    const wide = Math.max(right - left, 1e-3);
    const high = Math.max(top - bottom, 1e-3);
    const room = Math.min(ROOM, 0.15 * w, 0.15 * h);
    this.scale = Math.min((w - 2 * room) / wide, (h - 2 * room) / high);
    this.#look();
  }

  /** Draws a machine, and where it is. */
  show(stage, frame) {
    this.machine = stage;
    this.stage = new Stage(this.svg, { ...stage, scale: null, bounds: [0, 0, 1, 1].map((x) => x * stage.symbol) });
    this.frame = { forces: [], pins: [], impacts: [], ...frame };
    this.#look();
  }

  /** The same machine elsewhere. */
  pose(frame) {
    this.frame = { ...this.frame, ...frame };
    this.stage.show(this.frame);
    this.#signs();
  }

  /** What can be grabbed, the paths of points, signs of loads and sensors, and what is chosen. */
  grips({ handles, curves, marks, number }, colours, path) {
    this.number = number;
    this.handles = handles;
    this.marks = marks;
    this.trace(curves, colours);
    this.choose(path);
  }

  /** Paths of points. @param {Object<string, number[][]>} curves [m] by LINK.POINT */
  trace(curves, colours) {
    this.paths = Object.entries(curves).map(([key, points]) => ({
      key, points, colour: colours[key.split('.')[0]] ?? -1,
    }));
    this.#curves();
  }

  #curves() {
    this.curves.replaceChildren();
    for (const { points, colour } of this.paths ?? []) {
      add(this.curves, 'path', { d: line(points.map((p) => this.sheet(p))),
        style: `stroke: var(--link-${colour})` });
    }
  }

  /** Marks a part. @param {string[]} path in the scene */
  choose(path) {
    this.chosen = path;
    const name = path[1] ?? '';
    for (const group of this.svg.querySelectorAll('.machine g')) {
      const own = path[0] === 'links' ? group.dataset.link === name && group.dataset.kind === 'link'
        : path[0] === 'joints' && group.dataset.label === name;
      group.classList.toggle('chosen', own);
    }
    this.#above();
  }

  /** Shows or hides names, or forces. */
  layer(name, shown) {
    this.layers[name] = shown;
    this.stage?.layer(name, shown);
  }

  // --- what is seen -----------------------------------------------------------------------

  #look() {
    if (this.stage) {
      const { unit, corner } = this.stage;
      const [w, h] = this.size;
      const [left, top] = this.world([0, 0]);
      this.svg.setAttribute('viewBox', [(left - corner[0]) / unit, (corner[1] - top) / unit,
        w / this.scale / unit, h / this.scale / unit].join(' '));
      this.stage.pixel = 1 / (this.scale * unit);
      this.svg.style.setProperty('--pixel', this.stage.pixel.toFixed(4));
      for (const [name, shown] of Object.entries(this.layers)) this.stage.layer(name, shown);
      this.stage.show(this.frame);
    }
    const seen = [...this.size, ...this.centre, this.scale].join(' ');
    if (seen === this.seen) return; // by who has new handles to show, they are drawn
    this.seen = seen;
    this.#grid(...this.size);
    this.#above();
  }

  #above() {
    const [w, h] = this.size;
    for (const svg of [this.under, this.over]) svg.setAttribute('viewBox', `0 0 ${w} ${h}`);
    this.over.dataset.view = [...this.centre, this.scale].join(' ');
    this.#curves();
    this.#signs();
    this.#pen();
    const focused = document.activeElement?.dataset?.handle;
    this.knobs.replaceChildren();
    if (this.playing) return;
    for (const handle of this.handles) {
      const [x, y] = this.sheet(handle.at);
      const kind = handle.joint ? 'joint' : handle.ground ? 'ground' : 'free';
      const own = handle.joint ? this.chosen?.[0] === 'joints' && this.chosen[1] === handle.key : false;
      const knob = add(this.knobs, 'circle', { class: `knob ${kind}${own ? ' chosen' : ''}`,
        cx: x.toFixed(2), cy: y.toFixed(2), r: 8, tabindex: 0, role: 'button',
        'data-handle': handle.key, 'aria-label': `${kind === 'free' ? 'point' : kind} ${handle.key}` });
      add(knob, 'title').textContent = handle.members.join(', ');
      knob.addEventListener('keydown', (event) => this.#key(event, handle));
      if (handle.key === focused) knob.focus();
    }
  }

  /** Loads and sensors: signs beside their points, in a row where there are several. */
  #signs() {
    const focused = document.activeElement?.dataset?.mark;
    const beside = new Map();
    this.signs.replaceChildren();
    for (const mark of this.marks) {
      const [x, y] = this.sheet(this.#place(mark));
      const key = `${x.toFixed(0)} ${y.toFixed(0)}`;
      const row = beside.get(key) ?? 0;
      beside.set(key, row + 1);
      mark.seen = [x + 19 + 21 * row, y - 19];
      const name = mark.path.join('.');
      const group = add(this.signs, 'g', { class: `sign${this.chosen?.join('.') === name ? ' chosen' : ''}`,
        'data-mark': name, tabindex: 0, role: 'button', 'aria-label': name });
      add(group, 'title').textContent = mark.path[1] ?? name;
      if (mark.arrow) add(group, 'path', { class: 'load', d: arrow([x, y], this.#tip(mark, [x, y]), 3) });
      const [sx, sy] = mark.seen;
      add(group, 'path', { class: 'lead', d: line([[x, y], row ? [sx - 12, sy] : [sx - 7, sy + 7]]) });
      add(group, 'circle', { cx: sx, cy: sy, r: 9.5 });
      add(group, 'path', { class: 'icon', d: mark.icon, transform: `translate(${sx - 6} ${sy - 6}) scale(0.75)` });
      group.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter') return;
        event.stopPropagation();
        this.act({ type: 'click', from: { mark }, spot: { mark } });
      });
      if (name === focused) group.focus();
    }
  }

  #pose(link) {
    const i = this.machine.links.indexOf(link);
    return this.frame.poses[i] ?? [0, 0, 0];
  }

  /** Where a mark is [m]. */
  #place({ link, at }) {
    return carried(this.#pose(link), at);
  }

  /** Where the arrow of a force ends: a millimetre per newton, as far as that can be seen. */
  #tip({ link, arrow: force, turned }, [x, y]) {
    const [fx, fy] = carried([0, 0, turned ? this.#pose(link)[2] : 0], force);
    const far = Math.hypot(...force) * this.scale;
    const times = (Math.min(Math.max(far, 24), 260) / far) * this.scale;
    return [x + times * fx, y - times * fy];
  }

  /** Lines of a round distance, and how far apart they are. */
  #grid(w, h) {
    const apart = 10 ** Math.ceil(Math.log10(60 / this.scale));
    const far = apart * this.scale > 160 ? 0.5 * apart : apart;
    const [left, top] = this.world([0, 0]);
    const [right, bottom] = this.world([w, h]);
    const strokes = [];
    for (let k = Math.ceil(left / far); k * far <= right; k += 1) {
      strokes.push(`M${this.sheet([k * far, 0])[0].toFixed(1)} 0V${h}`);
    }
    for (let k = Math.ceil(bottom / far); k * far <= top; k += 1) {
      strokes.push(`M0 ${this.sheet([0, k * far])[1].toFixed(1)}H${w}`);
    }
    this.grid.replaceChildren();
    add(this.grid, 'path', { d: strokes.join('') });
    const [x, y] = this.sheet([0, 0]);
    add(this.grid, 'path', { class: 'axes', d: `M${x} 0V${h}M0 ${y}H${w}` });
    const [a, b] = [12, h - 12];
    const long = far * this.scale;
    add(this.grid, 'path', { class: 'rule', d: `M${a} ${b - 5}V${b}H${a + long}V${b - 5}` });
    const text = far >= 1 ? `${far} m` : `${Number((1000 * far).toPrecision(2))} mm`;
    add(this.grid, 'text', { x: a + long + 6, y: b }).textContent = text;
  }

  // --- the pointer ------------------------------------------------------------------------

  #pixel({ clientX, clientY }) {
    const { left, top } = this.over.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  #caught(at) {
    let [best, near] = [null, NEAR];
    for (const handle of this.handles) {
      const [x, y] = this.sheet(handle.at);
      // a point of the frame lies below what moves there
      const far = Math.hypot(x - at[0], y - at[1]) + (handle.ground && !handle.joint ? 4 : 0);
      if (far < near - (best ? 1 : 0)) [best, near] = [handle, far];
    }
    return best;
  }

  /** What is under the pointer: a handle, or a link, or a part by its label. */
  spot(event) {
    const at = this.#pixel(event);
    const mark = this.marks.find(({ seen: [x, y] }) => Math.hypot(x - at[0], y - at[1]) < 10);
    const handle = mark ? null : this.#caught(at);
    const [x, y] = this.world(at);
    this.over.style.pointerEvents = 'none';
    const group = document.elementFromPoint(event.clientX, event.clientY)?.closest('g[data-kind]');
    this.over.style.pointerEvents = '';
    const { kind, link, label } = group?.dataset ?? {};
    return { x, y, number: this.number, handle: handle?.key ?? '', link: link ?? '', kind, label, mark, grip: handle, pixel: at };
  }

  #down(event) {
    if (event.button > 0) return;
    this.fingers.set(event.pointerId, this.#pixel(event));
    this.over.setPointerCapture(event.pointerId);
    if (this.fingers.size === 2) {
      this.cancel();
      return;
    }
    const spot = this.spot(event);
    this.pressed = { from: spot, centre: this.centre, moved: false };
    this.act({ type: 'press', spot });
  }

  #move(event) {
    const at = this.#pixel(event);
    const before = this.fingers.get(event.pointerId);
    if (this.fingers.size === 2 && before) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const span = ([a, b], [c, d]) => Math.hypot(a - c, b - d) || 1;
      this.zoom(span(at, other) / span(before, other), other);
      this.fingers.set(event.pointerId, at);
      return;
    }
    if (!this.pressed) {
      const spot = this.spot(event);
      this.over.dataset.over = spot.handle ? 'handle' : spot.link ? 'link' : '';
      return;
    }
    const { from } = this.pressed;
    const far = Math.hypot(at[0] - from.pixel[0], at[1] - from.pixel[1]);
    this.pressed.moved ||= far > STILL;
    if (!this.pressed.moved) return;
    if (['move', 'turn', 'remove'].includes(this.tool) && !(from.handle && this.tool !== 'remove')) {
      const [x, y] = this.pressed.centre;
      this.centre = [x - (at[0] - from.pixel[0]) / this.scale, y + (at[1] - from.pixel[1]) / this.scale];
      this.bounds = null;
      this.#look();
      return;
    }
    const [x, y] = this.world(at);
    this.act({ type: 'drag', from, spot: this.tool === 'move' || this.tool === 'turn' ? { x, y } : this.spot(event) });
  }

  #up(event) {
    this.fingers.delete(event.pointerId);
    const { pressed } = this;
    this.pressed = null;
    if (!pressed) return;
    const spot = this.spot(event);
    this.act({ type: pressed.moved ? 'drop' : 'click', from: pressed.from, spot });
  }

  /** Ends a gesture that is to have no effect. */
  cancel() {
    if (this.pressed) this.act({ type: 'cancel' });
    this.pressed = null;
  }

  #key(event, handle) {
    const way = WAYS[event.key];
    if (way) {
      event.preventDefault();
      event.stopPropagation();
      const far = (event.shiftKey ? 10 : 1) * this.step;
      const [x, y] = handle.at.map((v, i) => v + far * way[i]);
      this.act({ type: 'nudge', handle, x, y });
    } else if (event.key === 'Enter') {
      event.stopPropagation();
      this.#tap({ number: this.number, handle: handle.key, grip: handle, x: handle.at[0], y: handle.at[1], link: '' });
    }
  }

  /** Enter: a click, or of a tool that draws from place to place first the one, then the other. */
  #tap(spot) {
    const { begun } = this;
    this.begun = null;
    if (!this.bands) this.act({ type: 'click', from: spot, spot });
    else if (begun) this.act({ type: 'drop', from: begun, spot });
    else {
      this.begun = spot;
      this.act({ type: 'drag', from: spot, spot });
    }
  }

  #round(x) { return Math.round(x / this.step) * this.step; }

  /** Keys on the sheet itself: arrows move the pen. */
  #write(event) {
    if (!this.at || event.target !== this.over || event.ctrlKey || event.altKey || event.metaKey) return;
    const way = WAYS[event.key];
    if (!way && event.key !== 'Enter') return;
    event.preventDefault();
    event.stopPropagation();
    if (way) {
      const far = (event.shiftKey ? 10 : 1) * this.step;
      this.at = this.at.map((v, i) => this.#round(v + far * way[i]));
      this.#pen();
      if (this.begun) this.act({ type: 'drag', from: this.begun, spot: this.#under() });
    } else this.#tap(this.#under());
  }

  /** What is under the pen. */
  #under() {
    const { left, top } = this.over.getBoundingClientRect();
    const [x, y] = this.sheet(this.at);
    return { ...this.spot({ clientX: left + x, clientY: top + y }), x: this.at[0], y: this.at[1] };
  }

  #pen() {
    this.pen.replaceChildren();
    if (!this.at || this.playing) return;
    const [x, y] = this.sheet(this.at);
    add(this.pen, 'path', { d: `M${x - 14} ${y}h28M${x} ${y - 14}v28` });
    const text = add(this.pen, 'text', { x: x + 8, y: y + 16 });
    text.textContent = this.at.map((v) => Number((1000 * v).toPrecision(6))).join(', ');
  }

  /** A line from where a part begins to the pointer. @param {?number[][]} ends [m] */
  stretch(ends, kind = '') {
    this.band.replaceChildren();
    if (ends) add(this.band, 'path', { class: kind, d: line(ends.map((p) => this.sheet(p))) });
  }
}
