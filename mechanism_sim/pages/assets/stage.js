import { add, arrow, line } from 'svg';

/** Units of the drawing in a symbol, the size of a joint. */
const SYMBOL = 10;
const BAR = 11;

/**
 * @typedef {Object} Frame an instant; SI units, along the world's axes
 * @property {number} t
 * @property {number[][]} poses x, y and angle of each moving link
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
    this.unit = stage.symbol / SYMBOL;
    this.corner = [left, top];
    this.links = new Map(stage.links.map((name, i) => [name, i]));
    svg.replaceChildren();
    svg.classList.add('stage');
    svg.setAttribute('viewBox', [0, 0, (right - left) / this.unit, (top - bottom) / this.unit]
      .map((x) => x.toFixed(2)).join(' '));
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', stage.title);
    this.svg = svg;
    this.pixel = 1;
    this.#machine();
    this.arrows = this.#layer('forces', stage.joints.length, 'path', { class: 'force' });
    this.flashes = this.#layer('impacts', Math.max(stage.bearings.length, stage.joints.length),
      'circle', { class: 'flash', r: 0 });
    stage.joints.forEach((joint, i) => {
      add(this.arrows[i], 'title').textContent = `force of ${words(joint.first)} on ${
        words(joint.link)} in ${words(joint.name)}`;
    });
    new ResizeObserver(() => this.#measure()).observe(svg);
    this.#measure();
  }

  /** Shows or hides a layer: 'forces', 'names' or 'impacts'. */
  layer(name, shown) {
    this.svg.querySelector(`g.${name}`).style.display = shown ? '' : 'none';
  }

  /** A point of a link in the drawing. @returns {number[]} */
  place(frame, link, [x, y]) {
    const [x0, y0, angle] = this.#pose(frame, link);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return this.point([x0 + c * x - s * y, y0 + s * x + c * y]);
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
    for (const { path, ends } of this.springs) {
      const [from, to] = ends.map(([link, at]) => this.place(frame, link, at));
      path.setAttribute('d', line(zigzag(from, to, 0.9 * SYMBOL)));
    }
    for (const name of this.names) {
      const { text, link, at } = name;
      const [x, y] = this.place(frame, link, at);
      const [ax, ay] = this.#outward(frame, name, [x, y]);
      text.setAttribute('x', (x + ax).toFixed(2));
      text.setAttribute('y', (y + ay).toFixed(2));
    }
    this.#forces(frame);
    this.#impacts(frame);
  }

  /** What is thin or written is never smaller than can be seen: how large a pixel is here. */
  #measure() {
    this.pixel = 1 / (this.svg.getScreenCTM()?.a || 1);
    this.svg.style.setProperty('--pixel', this.pixel.toFixed(3));
    if (this.frame) this.show(this.frame);
  }

  #pose(frame, link) {
    const i = this.links.get(link);
    return i === undefined ? [0, 0, 0] : frame.poses[i];
  }

  #layer(name, count, element, attributes) {
    const group = add(this.svg, 'g', { class: name });
    return Array.from({ length: count }, () => add(group, element, attributes));
  }

  #machine() {
    const machine = add(this.svg, 'g', { class: 'machine' });
    this.moving = [];
    this.springs = [];
    this.names = [];
    const below = ['rail', 'support'];
    const shapes = this.stage.shapes;
    const first = shapes.findIndex((shape) => !below.includes(shape.kind));
    shapes.forEach((shape, i) => {
      if (i === first) this.#springs(machine);
      this.#shape(machine, shape);
    });
    if (first < 0) this.#springs(machine);
    const names = add(this.svg, 'g', { class: 'names' });
    for (const shape of shapes.filter(({ kind, label }) => kind === 'link' && label)) {
      this.#name(names, shape);
    }
  }

  #springs(machine) {
    for (const ends of this.stage.springs) {
      const group = add(machine, 'g', { 'data-kind': 'spring' });
      this.springs.push({ path: add(group, 'path', { class: 'spring' }), ends });
    }
  }

  #shape(machine, { kind, link, label, outline }) {
    const group = add(machine, 'g', { 'data-kind': kind, 'data-link': link });
    const ground = !this.links.has(link);
    const points = ground ? outline.map((at) => this.point(at))
      : outline.map(([x, y]) => [x / this.unit, -y / this.unit]);
    if (!ground) this.moving.push({ group, link });
    PAINTERS[kind](group, points, ground);
    const named = kind === 'link' ? words(label) : [words(label), words(link)].find(Boolean);
    add(group, 'title').textContent = named;
  }

  #name(names, { link, label, outline }) {
    const count = outline.length;
    const sum = outline.reduce(([x, y], [px, py]) => [x + px, y + py], [0, 0]);
    const at = sum.map((x) => x / count);
    const [a, b] = outline;
    const aside = count === 2 ? [-(b[1] - a[1]), b[0] - a[0]] : null;
    const text = add(names, 'text');
    text.textContent = words(label);
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
    const { width, height } = this.svg.viewBox.baseVal;
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

/** A name as people read it. */
export const words = (name) => (name ?? '').replaceAll('_', ' ');

/** How a shape of each kind is painted: (group, points, whether it is of the ground). */
const PAINTERS = {
  rail(group, points, ground) {
    if (ground) hatched(group, points);
    else {
      stroke(group, line(points), 'ink', 0.6 * BAR);
      stroke(group, line(points), 'inside', 0.6 * BAR, 2);
    }
  },
  support(group, [[x, y]]) {
    const s = SYMBOL;
    const foot = y + 2.2 * s;
    const corners = [[x, y], [x - 1.3 * s, foot], [x + 1.3 * s, foot]];
    add(group, 'path', { d: line(corners, true), class: 'foot' });
    hatched(group, [[x - 2 * s, foot], [x + 2 * s, foot]], 0);
  },
  wheel(group, points) {
    add(group, 'path', { d: line(points, true), class: 'body' });
  },
  cam(group, points) {
    add(group, 'path', { d: line(points, true), class: 'body' });
  },
  link(group, points) {
    if (points.length < 2) return;
    const closed = points.length > 2;
    const d = line(points, closed);
    if (closed) add(group, 'path', { d, class: 'plate' });
    stroke(group, d, 'ink round', BAR);
    stroke(group, d, 'fill round', BAR, 2);
  },
  slot(group, points) {
    const d = line(points);
    stroke(group, d, 'ink round', 1.7 * BAR);
    stroke(group, d, 'fill round', 1.7 * BAR, 2);
    stroke(group, d, 'ink round', 1.36 * BAR);
    stroke(group, d, 'inside round', 1.36 * BAR, 2);
  },
  slider(group, points) {
    add(group, 'path', { d: line(points, true), class: 'slider' });
  },
  pin(group, [[x, y]]) {
    add(group, 'circle', { cx: x.toFixed(2), cy: y.toFixed(2), r: 0.62 * SYMBOL, class: 'pin' });
  },
};

/** A thick line, less so many edges. */
function stroke(group, d, name, width, edges = 0) {
  add(group, 'path', { d, class: `stroke ${name}`,
    style: `stroke-width: calc(${width.toFixed(2)}px - ${edges} * var(--edge))` });
}

/** A line of the frame, with strokes below it; a rail's strokes begin under its runner. */
function hatched(group, [start, end], gap = 1.1 * SYMBOL) {
  const [dx, dy] = [end[0] - start[0], end[1] - start[1]];
  const length = Math.hypot(dx, dy) || 1;
  const [ux, uy] = [dx / length, dy / length];
  const below = ux > 0 || (ux === 0 && uy < 0) ? [-uy, ux] : [uy, -ux];
  if (gap) add(group, 'path', { d: line([start, end]), class: 'thin' });
  const foot = (s) => [start[0] + s * ux + gap * below[0], start[1] + s * uy + gap * below[1]];
  let d = line([foot(0), foot(length)]);
  add(group, 'path', { d, class: 'thin' });
  d = '';
  for (let s = 0.75 * SYMBOL; s < length; s += 0.8 * SYMBOL) {
    const [x, y] = foot(s);
    d += line([[x, y], [x + 0.7 * SYMBOL * (below[0] - ux), y + 0.7 * SYMBOL * (below[1] - uy)]]);
  }
  add(group, 'path', { d, class: 'hatching' });
}

/** A spring between two points, straight at its ends. */
function zigzag(from, to, width) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  const at = (share, aside) => [from[0] + share * dx - (aside * dy) / length,
    from[1] + share * dy + (aside * dx) / length];
  const coils = Array.from({ length: 13 }, (_, i) => at(0.2 + 0.05 * i, i % 2 ? -width : width));
  return [from, at(0.15, 0), ...coils, at(0.85, 0), to];
}
