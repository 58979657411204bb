import { add, arrow, carried, line, onResize, quantity } from 'svg';

/** Units of the drawing in a symbol, the size of a joint. */
const SYMBOL = 10;
const FOOT = 34; // [px] below the machine, for the scales of lengths and forces
const BAR = 11;
const OPEN = ['line', 'thin'];

/**
 * @typedef {Object} Frame an instant; SI units, along the world's axes
 * @property {number} t
 * @property {number[][]} poses x, y, angle and elastic coordinates of each moving link
 * @property {number[][]} pins centre of each loose pin less that of its bushing
 * @property {number[]} modes of contact, as in ModeChange
 * @property {number[][]} forces in each joint, of its first link on its second
 * @property {number[][]} [feet] where forces act that act at no fixed point
 * @property {{bearing: number, joint: number, angle: number, impulse: number, share: number,
 *   age: number}[]} [impacts] that are to be seen: share of the hardest, age from 0 to 1
 */

/** A machine drawn as textbooks do, at the instant that is shown. */
export class Stage {
  /** @param {SVGSVGElement} svg to draw in @param {Object} stage as `Stage.to_json` has it */
  constructor(svg, stage) {
    const [left, bottom, right, top] = stage.bounds;
    this.stage = stage;
    this.frames = stage.frames ?? []; // on springs
    this.unit = stage.symbol / SYMBOL;
    this.corner = [left, top];
    this.links = new Map(stage.links.map((name, i) => [name, i]));
    svg.replaceChildren();
    svg.classList.add('stage');
    svg.classList.remove('zoomed');
    this.height = (top - bottom) / this.unit;
    this.all = [0, 0, (right - left) / this.unit, this.height];
    this.box = this.all;
    svg.setAttribute('viewBox', this.all.map((x) => x.toFixed(2)).join(' '));
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', stage.title);
    this.svg = svg;
    this.pixel = 1;
    this.#machine();
    this.arrows = this.#layer('forces', stage.joints.length, 'path', { class: 'force' });
    this.flashes = this.#layer('impacts', Math.max(stage.bearings.length, stage.joints.length),
      'circle', { class: 'flash', r: 0 });
    stage.joints.forEach((joint, i) => {
      add(this.arrows[i], 'title').textContent = `force of ${joint.first} on ${joint.link} in ${joint.name}`;
    });
    onResize(svg, () => this.#measure());
    this.#measure();
  }

  /** Shows a part of the drawing: left, top, width and height. @param {number[]} box */
  look(box) {
    this.box = box;
    this.svg.setAttribute('viewBox', box.map((x) => x.toFixed(4)).join(' '));
    this.svg.classList.toggle('zoomed', box[2] < this.all[2]);
    this.#measure();
  }

  /** Shows the part of the world that another drawing is enlarged to. @param {?Stage} other */
  lookAs(other) {
    if (!other || other.box[2] >= other.all[2]) return;
    const { box: [left, top, ...size], unit, corner: [x, y] } = other;
    const corner = this.point([x + left * unit, y - top * unit]);
    this.look([...corner, ...size.map((far) => (far * unit) / this.unit)]);
  }

  /** Shows or hides a layer: 'forces', 'names' or 'impacts'. */
  layer(name, shown) {
    for (const group of this.svg.querySelectorAll(`g.${name}, g.of-${name}`)) {
      group.style.display = shown ? '' : 'none';
    }
  }

  /**
   * Draws the paths of the marked points of links.
   * @param {Object[]} frames with the poses that they pass
   */
  trace(frames) {
    const group = add(this.svg, 'g', { class: 'paths' });
    this.svg.querySelector('g.machine').before(group);
    for (const { kind, link, colour, outline: [at] } of this.stage.shapes) {
      if (kind !== 'point' || !this.links.has(link)) continue;
      add(group, 'path', { class: 'trace', d: line(frames.map((frame) => this.place(frame, link, at))),
        style: `stroke: var(--link-${colour})` });
    }
  }

  /** Lights links and joints of these names; of nothing all. @param {?string[]} names */
  light(names) {
    const groups = [...this.svg.querySelectorAll('.machine g')];
    const own = (group) => names?.includes(group.dataset.link) || names?.includes(group.dataset.label);
    this.svg.classList.toggle('lit', groups.some(own));
    for (const group of groups) group.classList.toggle('lit', Boolean(own(group)));
  }

  /** A point of a link in the drawing. @returns {number[]} */
  place(frame, link, at) {
    const pose = this.#pose(frame, link);
    return this.point(carried(pose, this.#bent(link, at, pose.slice(3))));
  }

  /** A point of the world in the drawing. @returns {number[]} */
  point([x, y]) {
    return [(x - this.corner[0]) / this.unit, (this.corner[1] - y) / this.unit];
  }

  /** @param {Frame} frame */
  show(frame) {
    this.frame = frame;
    for (const { group, link } of this.moving) {
      const [x, y, angle] = this.#pose(frame, link);
      const [px, py] = this.point([x, y]);
      const turn = (-180 / Math.PI) * angle;
      group.setAttribute('transform',
        `translate(${px.toFixed(3)} ${py.toFixed(3)}) rotate(${turn.toFixed(4)})`);
    }
    for (const { path, link, style, curves } of this.elastic) {
      const bends = this.#pose(frame, link).slice(3);
      path.setAttribute('d', outline(style, curves.map((curve) => curve.map(([x, y]) => {
        const [u, v] = this.#bent(link, [x * this.unit, -y * this.unit], bends);
        return [u / this.unit, -v / this.unit];
      }))));
    }
    this.frames.forEach(({ name, cog }, k) => {
      const [x, y] = this.point(this.#swayed(frame, k, cog));
      const turn = ((-180 / Math.PI) * frame.sway[k][2]).toFixed(4);
      const back = `${-cog[0] / this.unit} ${cog[1] / this.unit}`;
      for (const group of this.swaying.get(name)) {
        group.setAttribute('transform', `translate(${x} ${y}) rotate(${turn}) translate(${back})`);
      }
    });
    for (const [i, { path, ends }] of this.springs.entries()) {
      const [from, to] = ends.map(([link, at]) => this.place(frame, link, at));
      const k = this.frames.findIndex(({ springs }) => springs.includes(i));
      if (k >= 0) [from[0], from[1]] = this.point(this.#swayed(frame, k, ends[0][1]));
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      const far = SYMBOL / (Math.hypot(dx, dy) || 1);
      path.setAttribute('d', line(this.stage.coil.map(([share, aside]) => [
        from[0] + share * dx - aside * far * dy, from[1] + share * dy + aside * far * dx])));
    }
    for (const { path, ends } of this.ropes) path.setAttribute('d', line(this.#strung(frame, ends)));
    for (const name of this.names) {
      const { text, link, at } = name;
      const [x, y] = this.place(frame, link, at);
      const [ax, ay] = this.#outward(frame, name, [x, y]);
      text.setAttribute('x', (x + ax).toFixed(2));
      text.setAttribute('y', (y + ay).toFixed(2));
    }
    this.#forces(frame);
    this.#impacts(frame);
    this.#callout(frame);
  }

  /** Leads a line from a joint to its lens. @param {string} name @param {Element} lens */
  callout(name, lens) {
    this.line ??= add(this.svg, 'path', { class: 'callout' });
    this.lens = lens;
    this.called = [...this.stage.bearings, ...this.stage.plays].find(({ joint }) => joint === name);
    this.#measure();
  }

  #callout(frame) {
    if (!this.called) return;
    const { joint, second, on_second: on, link = second, at = on } = this.called;
    const foot = this.stage.joints.find(({ name }) => name === joint)?.foot;
    const [x, y] = foot === undefined ? this.place(frame, link, at) : this.point(frame.feet[foot]);
    const [dx, dy, r] = [this.goal[0] - x, this.goal[1] - y, 1.6 * SYMBOL];
    const far = Math.hypot(dx, dy) || 1;
    const end = 1 - Math.min(1, this.goal[2] / far);
    this.line.setAttribute('d', `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0${
      line([[x + (r * dx) / far, y + (r * dy) / far], [x + end * dx, y + end * dy]])}`);
  }

  /** What is thin or written is never smaller than can be seen: how large a pixel is here. */
  #measure() {
    const { width, height } = this.svg.getBoundingClientRect();
    if (this.stage.scale && height > 2 * FOOT && this.box[2] >= this.all[2]) {
      const scale = Math.min(width / this.all[2], (height - FOOT) / this.height);
      this.all = [0, 0, this.all[2], this.height + FOOT / scale];
      this.box = this.all;
      this.svg.setAttribute('viewBox', this.all.map((x) => x.toFixed(2)).join(' '));
    }
    this.pixel = 1 / (this.svg.getScreenCTM()?.a || 1);
    this.svg.style.setProperty('--pixel', this.pixel.toFixed(4));
    this.whole = this.pixel * (this.all[2] / this.box[2]);
    this.svg.style.setProperty('--whole', this.whole.toFixed(4));
    this.#rule();
    this.#aim();
    if (this.frame) this.show(this.frame);
  }

  /** Where the lens is in the drawing: its centre and its radius; below it if nobody says. */
  #aim() {
    const [left, top, width, height] = this.box;
    this.goal = [left + 0.5 * width, top + height, 0];
    const to = this.svg.getScreenCTM();
    const { left: x, top: y, width: wide, height: high } = this.lens?.querySelector('svg')
      ?.getBoundingClientRect() ?? {};
    if (!to || !wide) return;
    this.goal = [(x + wide / 2 - to.e) / to.a, (y + high / 2 - to.f) / to.d,
      (0.49 * Math.min(wide, high)) / to.a];
  }

  /** Ends of a stretch of a rope, a tangent of the pulleys there. */
  #strung(frame, ends) {
    const [[x1, y1], [x2, y2]] = ends.map(([link, at]) => this.place(frame, link, at));
    const [r1, r2] = ends.map(([, , radius]) => radius / this.unit);
    const [x, y, off] = [x2 - x1, y1 - y2, r2 - r1]; // counterclockwise again
    const far = x * x + y * y || 1;
    const long = Math.sqrt(Math.max(far - off * off, 0));
    const [dx, dy] = [(long * x + off * y) / far, (long * y - off * x) / far];
    return [[x1 + r1 * dy, y1 + r1 * dx], [x2 + r2 * dy, y2 + r2 * dx]];
  }

  /** Where a point of a frame on springs is drawn [m]. */
  #swayed(frame, k, [x, y]) {
    const [dx, dy, angle] = frame.sway[k];
    const [cx, cy] = this.frames[k].cog;
    return carried([cx + dx, cy + dy, angle], [x - cx, y - cy]);
  }

  #pose(frame, link) {
    const i = this.links.get(link);
    return i === undefined ? [0, 0, 0] : frame.poses[i];
  }

  /** A point of an elastic link in its frame, as it is drawn at these elastic coordinates. */
  #bent(link, [x, y], bends) {
    const field = this.stage.bendings[link];
    if (!field) return [x, y];
    const on = Math.min(Math.max(x, 0), field.length);
    const last = field.slope[0].length - 1;
    const i = Math.min(Math.floor((on / field.length) * last), last - 1);
    const share = (on / field.length) * last - i;
    const [along, across, slope] = ['along', 'across', 'slope'].map((name) => field[name].reduce(
      (sum, row, k) => sum + bends[k] * (row[i] + share * (row[i + 1] - row[i])), 0));
    return [x + along - y * slope, y + across + (x - on) * slope];
  }

  #layer(name, count, element, attributes) {
    const group = add(this.svg, 'g', { class: name });
    return Array.from({ length: count }, () => add(group, element, attributes));
  }

  #machine() {
    const machine = add(this.svg, 'g', { class: 'machine' });
    this.moving = [];
    this.swaying = new Map(this.frames.map(({ name }) => [name, []]));
    this.elastic = [];
    this.names = [];
    this.springs = this.stage.springs.map((ends) => ({
      path: add(machine, 'path', { class: 'line spring' }), ends,
    }));
    this.ropes = (this.stage.ropes ?? []).map((ends) => ({
      path: add(machine, 'path', { class: 'line spring' }), ends,
    }));
    const shapes = this.stage.shapes;
    for (const shape of shapes) this.#shape(machine, shape);
    const names = add(this.svg, 'g', { class: 'names' });
    for (const shape of shapes.filter(({ kind, label }) => kind === 'link' && label)) {
      this.#name(names, shape);
    }
  }

  #shape(machine, { kind, link, label, colour, paths }) {
    const group = add(machine, 'g', { 'data-kind': kind, 'data-link': link,
      'data-label': label,
      style: `--link: var(--link-${colour})` });
    if (this.links.has(link)) this.moving.push({ group, link });
    else if (this.swaying.has(label) && kind === 'frame') this.swaying.get(label).push(group);
    else group.setAttribute('transform', `translate(${this.point([0, 0]).join(' ')})`);
    for (const [style, flats] of paths) {
      const curves = flats.map((flat) => Array.from({ length: flat.length / 2 },
        (_, i) => [flat[2 * i], -flat[2 * i + 1]]));
      const path = add(group, 'path', { class: style, d: outline(style, curves) });
      if (this.stage.bendings[link]) this.elastic.push({ path, link, style, curves });
    }
    add(group, 'title').textContent = label || (kind === 'link' ? '' : link);
  }

  /** How long things are, in the corner of what is shown and as large as ever. */
  #rule() {
    if (!this.stage.scale) return; // it is part of another drawing
    const [left, top, width, height] = this.box;
    const times = this.all[2] / width;
    const { length, text } = this.stage.scale;
    const shown = times > 1 ? below(length / times) : length;
    const far = (shown * times) / this.unit;
    const at = { transform: `translate(${left} ${top + height - 3 * this.pixel}) scale(${1 / times})` };
    const [hidden = '', hiddenForces = ''] = this.rules?.map(({ style }) => style.display) ?? [];
    this.rules?.forEach((rule) => rule.remove());
    const rule = add(this.svg, 'g', { class: 'rule', ...at });
    this.rules = [rule];
    rule.style.display = hidden;
    add(rule, 'path', { class: 'line', d: line([[0, -4], [0, 0], [far, 0], [far, -4]]) });
    add(rule, 'text', { x: far + 6, y: 0 }).textContent = times > 1 ? quantity(shown, 'm') : text;
    if (!this.stage.force) return;
    const force = times > 1 ? below(this.stage.force / times) : this.stage.force;
    const long = (force * times * this.stage.force_scale) / this.unit;
    const forces = add(this.svg, 'g', { class: 'rule of-forces', ...at });
    this.rules.push(forces);
    forces.style.display = hiddenForces;
    const up = -Math.max(2.4 * SYMBOL, 15 * this.whole);
    add(forces, 'path', { class: 'force', d: arrow([0, up - 3], [long, up - 3], 2.2) });
    add(forces, 'text', { x: long + 6, y: up }).textContent = quantity(force, 'N');
  }

  #name(names, { link, label, outline }) {
    const count = outline.length;
    const sum = outline.reduce(([x, y], [px, py]) => [x + px, y + py], [0, 0]);
    const at = sum.map((x) => x / count);
    const [a, b] = outline;
    const aside = count === 2 ? [-(b[1] - a[1]), b[0] - a[0]] : null;
    const text = add(names, 'text');
    text.textContent = label;
    this.names.push({ text, link, at, aside: count === 1 ? [0, 0] : aside });
  }

  /** Where a name stands beside a bar: across, away from the middle of the drawing. */
  #outward(frame, { text, link, aside }, [x, y]) {
    if (!aside) return [0, 0];
    const far = Math.hypot(...aside);
    if (!far) return [0, -1.6 * SYMBOL - 9 * this.pixel];
    const angle = this.#pose(frame, link)[2];
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const [ax, ay] = [(c * aside[0] - s * aside[1]) / far, -(s * aside[0] + c * aside[1]) / far];
    const [, , width, height] = this.all;
    const away = ax * (x - 0.5 * width) + ay * (y - 0.5 * height) < 0 ? -1 : 1;
    const room = 0.5 * BAR + 3 * this.pixel;
    const half = 3.6 * text.textContent.length * this.pixel; // of its width, about
    return [away * ax * (room + half), away * ay * (room + 7 * this.pixel)];
  }

  #forces(frame) {
    const scale = this.stage.force_scale / this.unit;
    this.stage.joints.forEach((joint, i) => {
      const [fx, fy] = frame.forces[i];
      const from = joint.foot === undefined ? this.place(frame, joint.link, joint.at)
        : this.point(frame.feet[joint.foot]);
      const to = [from[0] + scale * fx, from[1] - scale * fy];
      this.arrows[i].setAttribute('d', arrow(from, to, 2.2 * Math.max(1, 0.75 * this.pixel)));
    });
  }

  #impacts(frame) {
    const { bearings, joints } = this.stage;
    this.flashes.forEach((flash) => flash.setAttribute('r', 0));
    for (const impact of frame.impacts ?? []) {
      const bearing = bearings[impact.bearing];
      const joint = joints[impact.joint];
      if (!bearing && !joint) continue;
      const flash = this.flashes[bearing ? impact.bearing : impact.joint];
      const [x, y] = bearing ? this.place(frame, bearing.second, bearing.on_second)
        : joint.foot === undefined ? this.place(frame, joint.link, joint.at)
          : this.point(frame.feet[joint.foot]);
      flash.setAttribute('cx', x.toFixed(2));
      flash.setAttribute('cy', y.toFixed(2));
      flash.setAttribute('r', (2.4 * SYMBOL * Math.max(impact.share, 1e-3) ** (1 / 3)).toFixed(2));
      flash.setAttribute('opacity', (1 - impact.age).toFixed(3));
    }
  }
}

const outline = (style, curves) => curves.map((curve) => line(curve, !OPEN.includes(style)))
  .join('');

/** The greatest of 1, 2 and 5 times a power of ten that is not above x. */
function below(x) {
  const ten = 10 ** Math.floor(Math.log10(x) + 1e-9);
  return [5, 2, 1].find((times) => times * ten <= x * (1 + 1e-9)) * ten;
}

/** A key of scenes, or a tool, as people read it; names of parts stand as the scene has them. */
export const words = (key) => key.replaceAll('_', ' ');
