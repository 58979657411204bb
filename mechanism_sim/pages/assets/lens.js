import { add, arrow, line, onResize, quantity } from 'svg';
import { words } from 'stage';

/** Radii in units of the drawing: of the bore, of the pin; between them, of the clearance. */
const BORE = 104;
const PIN = 42;
const PLAY = BORE - PIN;
const PIECES = 8;
const HALF = 64; // of what is between walls, along them
const SHOWN = 400;
const PIXELS = 96 / 0.0254; // in a metre

/** What modes of contact are called, by their number in ModeChange. */
export const MODES = ['', 'free flight', 'following', 'sticking', 'sliding forward',
  'sliding backward', 'recovering'];

/**
 * The lens over a joint with play; null where a machine has none there.
 * @param {SVGSVGElement} svg @param {Object} stage @param {string} name of the joint
 * @param {function(number, number): number[][]} path places of the pin of a bearing up to a time
 */
export function lensOf(svg, stage, name, path) {
  const [bearing, play] = [stage.bearings, stage.plays]
    .map((all) => all.findIndex(({ joint }) => joint === name));
  svg.toggleAttribute('hidden', bearing < 0 && play < 0);
  if (play >= 0) return new Slit(svg, stage, play);
  return bearing < 0 ? null : new Lens(svg, stage, bearing, (t) => path(bearing, t));
}

/** The clearance of a bearing, magnified: its bushing, and the pin at its true place in it. */
class Lens {
  /**
   * @param {SVGSVGElement} svg to draw in
   * @param {Object} stage as `Stage.to_json` has it
   * @param {number} index of the bearing
   * @param {function(number): number[][]} [pathOfPin] its places [m] up to a time; without it
   *   those that were shown
   */
  constructor(svg, stage, index, pathOfPin) {
    this.index = index;
    this.bearing = stage.bearings[index];
    this.joint = stage.joints.findIndex(({ name }) => name === this.bearing.joint);
    this.scale = PLAY / this.bearing.radial;
    // the arrow of a force that is rarely exceeded reaches about the bore
    this.force = stage.force_scale ? (BORE * stage.force_scale) / (21 * stage.symbol) : 0;
    this.links = new Map(stage.links.map((name, i) => [name, i]));
    this.pathOfPin = pathOfPin ?? ((t) => this.#seen(t));
    this.trail = [];
    this.#draw(svg);
  }

  /** @param {import('stage').Frame} frame */
  show(frame) {
    const [x, y] = frame.pins[this.index];
    const mode = frame.modes[this.index];
    const [px, py] = [x * this.scale, -y * this.scale];
    const far = Math.hypot(px, py) || 1;
    const out = [px / far, py / far];
    this.now = [frame.t, x, y];
    this.#turn(this.bushing, this.bearing.second, frame);
    const moved = `translate(${px.toFixed(3)} ${py.toFixed(3)}) `;
    this.#turn(this.pin, this.bearing.first, frame, moved);
    this.pin.dataset.x = x;
    this.pin.dataset.y = y;
    this.svg.dataset.mode = mode;
    this.words.textContent = mode ? MODES[mode]
      : this.bearing.contact === 'film' ? 'on its oil film' : '';
    this.#path(frame.t);
    this.#forces(frame, [px, py], out, mode);
    this.#impact(frame);
  }

  /** How many times larger than life it is on a screen of 96 pixels an inch. */
  get magnification() {
    const drawn = this.svg.getScreenCTM()?.a ?? 0;
    return (this.scale * drawn) / PIXELS;
  }

  #turn(group, link, frame, before = '') {
    const i = this.links.get(link);
    const angle = i === undefined ? 0 : frame.poses[i][2];
    group.setAttribute('transform', `${before}rotate(${((-180 / Math.PI) * angle).toFixed(3)})`);
  }

  #draw(svg) {
    svg.replaceChildren();
    svg.classList.add('lens');
    svg.setAttribute('viewBox', '-132 -160 264 352');
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', `clearance of ${words(this.bearing.joint)}, magnified`);
    this.svg = svg;
    const title = add(svg, 'text', { class: 'title', x: 0, y: -142 });
    title.textContent = words(this.bearing.joint);
    this.bushing = add(svg, 'g', { class: 'bushing' });
    add(this.bushing, 'circle', { r: BORE + 18, class: 'body' });
    add(this.bushing, 'circle', { r: BORE, class: 'bore' });
    add(this.bushing, 'path', { d: line([[BORE + 4, 0], [BORE + 14, 0]]), class: 'mark' });
    add(svg, 'circle', { r: PLAY, class: 'limit' });
    this.pin = add(svg, 'g', { class: 'journal' });
    add(this.pin, 'circle', { r: PIN, class: 'body' });
    add(this.pin, 'path', { d: line([[PIN - 12, 0], [PIN - 3, 0]]), class: 'mark' });
    add(this.pin, 'circle', { r: 2.5, class: 'centre' });
    const path = add(svg, 'g', { class: 'path' });
    this.pieces = Array.from({ length: PIECES }, (_, i) => add(path, 'path', {
      opacity: (((i + 1) / PIECES) ** 1.5).toFixed(2),
    }));
    this.flash = add(svg, 'circle', { class: 'flash', r: 0 });
    this.normal = add(svg, 'path', { class: 'force' });
    this.friction = add(svg, 'path', { class: 'force' });
    this.words = add(svg, 'text', { class: 'mode', x: 0, y: 144 });
    this.values = add(svg, 'text', { class: 'values', x: 0, y: 162 });
    this.note = add(svg, 'text', { class: 'note', x: 0, y: 182 });
    const tell = () => {
      const times = this.magnification;
      this.note.textContent = `radial clearance ${quantity(this.bearing.radial, 'm')}, ${
        Number(times.toPrecision(2))} × true size`;
    };
    onResize(svg, tell);
    tell();
  }

  #seen(t) {
    if (this.trail.length && t < this.trail.at(-1)[0]) this.trail = [];
    if (t !== this.trail.at(-1)?.[0]) this.trail.push(this.now);
    if (this.trail.length > SHOWN) this.trail.shift();
    return this.trail.map(([, x, y]) => [x, y]);
  }

  #path(t) {
    const points = this.pathOfPin(t).map(([x, y]) => [x * this.scale, -y * this.scale]);
    const each = Math.max(1, Math.ceil((points.length - 1) / PIECES));
    this.pieces.forEach((piece, i) => {
      const end = points.length - (PIECES - 1 - i) * each;
      const part = points.slice(Math.max(0, end - each - 1), Math.max(0, end));
      piece.setAttribute('d', part.length > 1 ? line(part) : '');
    });
  }

  /** Those of the pin on the bushing: along the line through both centres, and across it. */
  #forces(frame, pin, [ux, uy], mode) {
    const force = frame.forces[this.joint];
    if (!force || mode === 1) {
      for (const drawn of [this.normal, this.friction]) drawn.setAttribute('d', '');
      this.values.textContent = '';
      return;
    }
    const [fx, fy] = [force[0], -force[1]];
    const normal = fx * ux + fy * uy;
    const friction = -fx * uy + fy * ux;
    const touch = [BORE * ux, BORE * uy];
    const k = this.force;
    this.normal.setAttribute('d',
      arrow(pin, [pin[0] + k * normal * ux, pin[1] + k * normal * uy], 3.2));
    this.friction.setAttribute('d',
      arrow(touch, [touch[0] - k * friction * uy, touch[1] + k * friction * ux], 3.2));
    const rubs = this.bearing.friction || this.bearing.contact === 'film';
    this.values.textContent = `normal ${quantity(normal, 'N')}${
      rubs ? `, tangential ${quantity(Math.abs(friction), 'N')}` : ''}`;
  }

  #impact(frame) {
    const own = (frame.impacts ?? []).filter(({ bearing }) => bearing === this.index);
    const last = own.reduce((a, b) => (a && a.age <= b.age ? a : b), null);
    this.flash.setAttribute('r', last ? 30 * Math.max(last.share, 1e-3) ** (1 / 3) : 0);
    if (!last) return;
    this.flash.setAttribute('cx', (BORE * Math.cos(last.angle)).toFixed(2));
    this.flash.setAttribute('cy', (-BORE * Math.sin(last.angle)).toFixed(2));
    this.flash.setAttribute('opacity', (1 - last.age).toFixed(3));
  }
}

/** A play between walls, or what may part, magnified: what has the walls, and what is between. */
class Slit {
  /** @param {SVGSVGElement} svg to draw in @param {Object} stage @param {number} index of the play */
  constructor(svg, stage, index) {
    this.index = index;
    this.play = stage.plays[index];
    this.two = this.play.walls > 1;
    this.scale = (2 * PLAY) / this.play.width;
    svg.replaceChildren();
    svg.classList.add('lens');
    svg.setAttribute('viewBox', '-132 -160 264 352');
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', `play of ${words(this.play.joint)}, magnified`);
    this.svg = svg;
    add(svg, 'text', { class: 'title', x: 0, y: -142 }).textContent = words(this.play.joint);
    for (const side of this.two ? [-1, 1] : [1]) {
      add(svg, 'rect', { class: 'part', x: side > 0 ? BORE : -BORE - 26, y: -100, width: 26,
        height: 200, style: `--link: var(--link-${this.play.face})` });
    }
    this.body = add(svg, 'rect', { class: 'part journal', x: -PIN, y: -HALF, width: 2 * PIN,
      height: 2 * HALF, rx: this.play.tilts ? 0 : 10, style: `--link: var(--link-${this.play.body})` });
    this.words = add(svg, 'text', { class: 'mode', x: 0, y: 144 });
    this.values = add(svg, 'text', { class: 'values', x: 0, y: 162 });
    this.note = add(svg, 'text', { class: 'note', x: 0, y: 182 });
    const tell = () => {
      const times = (this.scale * (svg.getScreenCTM()?.a ?? 0)) / PIXELS;
      this.note.textContent = `${this.two ? 'play' : 'at most'} ${
        quantity(this.play.width, 'm')}, ${Number(times.toPrecision(2))} × true size`;
    };
    onResize(svg, tell);
    tell();
  }

  /** @param {import('stage').Frame} frame */
  show(frame) {
    const none = 1e-6 * this.play.width; // is rounding
    const [left, right] = frame.walls[this.index].map((x) => (Math.abs(x) < none ? 0 : x));
    const x = this.two ? 0.5 * this.scale * (left - right) : PLAY - this.scale * right;
    // across the walls all is as many times larger, so that corners touch them where they do
    const tilt = Math.abs(frame.tilts[this.index]) < none ? 0 : frame.tilts[this.index];
    const lean = (0.5 * this.scale * tilt) / HALF;
    this.body.setAttribute('transform', `matrix(1 0 ${lean.toFixed(5)} 1 ${x.toFixed(3)} 0)`);
    this.body.dataset.tilt = tilt;
    this.body.dataset.x = this.two ? 0.5 * (left - right) : right;
    const touching = frame.touching[this.index];
    this.words.textContent = touching
      ? ['', 'on the left', 'on the right', 'on both sides'][this.two ? touching : 0] || 'in contact'
      : this.two ? 'between the walls' : 'lifted off';
    this.values.textContent = this.two
      ? `left ${quantity(left, 'm')}, right ${quantity(right, 'm')}` : `gap ${quantity(right, 'm')}`;
    if (this.play.tilts) this.values.textContent += `, tilt ${quantity(tilt, 'm')}`;
  }
}
