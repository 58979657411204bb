import { html } from 'html';
import { add, arrow, line, onResize, quantity } from 'svg';

/** Units of the drawing in a radius of the bushing, or half the space between walls. */
const BORE = 104;
const PIECES = 8;
const PIXELS = 96 / 0.0254; // in a metre

/**
 * The lens over a joint with play; null where a machine has none there.
 * @param {HTMLElement} host to be filled @param {Object} stage @param {string} name of the joint
 * @param {function(number, number): number[][]} path places of the pin of a bearing up to a time
 */
export function lensOf(host, stage, name, path) {
  const [bearing, play] = [stage.bearings, stage.plays]
    .map((all) => all.findIndex(({ joint }) => joint === name));
  host.hidden = bearing < 0 && play < 0;
  if (play >= 0) return new Slit(host, stage, play);
  return bearing < 0 ? null : new Lens(host, stage, bearing, (t) => path(bearing, t));
}

/** A play, magnified: what all lenses have. */
class Glass {
  /**
   * @param {HTMLElement} host to be filled by the drawing and lines of text below it
   * @param {Object} stage as `Stage.to_json` has it
   * @param {Object} play one of its bearings or plays
   * @param {number} wide how far it goes to each side [m]
   * @param {string} what is magnified, in words
   * @param {string} note that stands before how many times it is
   */
  constructor(host, stage, play, wide, what, note) {
    const { play: share, half } = stage.lens;
    host.replaceChildren();
    const svg = add(host, 'svg', { class: 'lens', viewBox: '-132 -126 264 252', role: 'img',
      'aria-label': `${what} of ${play.joint}, magnified` });
    this.svg = svg;
    this.said = play.words;
    this.room = share * BORE;
    this.inner = BORE - this.room; // of what is in the bushing or between the walls
    this.half = half * BORE;
    this.scale = this.room / wide;
    const texts = ['title', 'mode', 'values', 'note'].map((kind) => html('p', { class: kind }));
    host.append(...texts);
    const [title, mode, values, said] = texts;
    title.textContent = play.joint;
    Object.assign(this, { words: mode, values, note: said });
    const tell = () => {
      const times = (this.scale * (svg.getScreenCTM()?.a ?? 0)) / PIXELS;
      this.note.textContent = `${note}, ${Number(times.toPrecision(2))} × true size`;
    };
    onResize(svg, tell);
    tell();
  }
}

/** The clearance of a bearing, magnified: its bushing, and the pin at its true place in it. */
class Lens extends Glass {
  /**
   * @param {HTMLElement} host to be filled
   * @param {Object} stage as `Stage.to_json` has it
   * @param {number} index of the bearing
   * @param {function(number): number[][]} pathOfPin its places [m] up to a time
   */
  constructor(host, stage, index, pathOfPin) {
    const bearing = stage.bearings[index];
    const worn = bearing.worn?.map((depths) => Math.max(...depths)) ?? [0, 0];
    const names = ['bushing', 'pin'].map((name, k) => `, ${name} worn by ${quantity(worn[k], 'm')}`);
    const note = `radial clearance ${quantity(bearing.radial, 'm')}${
      names.filter((_, k) => worn[k] > 0).join('')}`;
    super(host, stage, bearing, bearing.radial + Math.max(worn[0], 0), 'clearance', note);
    this.bore = this.inner + bearing.radial * this.scale; // where it is not worn
    this.index = index;
    this.bearing = bearing;
    this.joint = stage.joints.findIndex(({ name }) => name === this.bearing.joint);
    // the arrow of a force that is rarely exceeded reaches about the bore
    this.force = stage.force_scale ? (BORE * stage.force_scale) / (21 * stage.symbol) : 0;
    this.links = new Map(stage.links.map((name, i) => [name, i]));
    this.pathOfPin = pathOfPin;
    this.#draw(this.svg);
  }

  /** @param {import('stage').Frame} frame */
  show(frame) {
    const [x, y] = frame.pins[this.index];
    const mode = frame.modes[this.index];
    const [px, py] = [x * this.scale, -y * this.scale];
    const far = Math.hypot(px, py) || 1;
    const out = [px / far, py / far];
    this.#turn(this.bushing, this.bearing.second, frame);
    if (this.limit) this.#turn(this.limit, this.bearing.second, frame);
    const moved = `translate(${px.toFixed(3)} ${py.toFixed(3)}) `;
    this.#turn(this.pin, this.bearing.first, frame, moved);
    this.pin.dataset.x = x;
    this.pin.dataset.y = y;
    this.svg.dataset.mode = mode;
    this.words.textContent = this.said[mode];
    this.#path(frame.t);
    this.#forces(frame, [px, py], out, mode);
    this.#impact(frame);
  }

  #turn(group, link, frame, before = '') {
    const i = this.links.get(link);
    const angle = i === undefined ? 0 : frame.poses[i][2];
    group.setAttribute('transform', `${before}rotate(${((-180 / Math.PI) * angle).toFixed(3)})`);
  }

  #draw(svg) {
    this.bushing = add(svg, 'g', { class: 'bushing' });
    add(this.bushing, 'circle', { r: BORE + 18, class: 'body' });
    const [bushing, pin] = this.bearing.worn ?? [];
    this.#surface(this.bushing, 'bore', this.bore, bushing);
    add(this.bushing, 'path', { d: line([[BORE + 4, 0], [BORE + 14, 0]]), class: 'mark' });
    // where the centre of a pin that has its shape can be
    if (!pin?.some((x) => x)) {
      const within = bushing ? add(svg, 'g') : svg;
      this.#surface(within, 'limit', this.bearing.radial * this.scale, bushing);
      if (bushing) this.limit = within;
    }
    this.pin = add(svg, 'g', { class: 'journal' });
    this.#surface(this.pin, 'body', this.inner, pin?.map((x) => -x));
    add(this.pin, 'path', { d: line([[this.inner - 12, 0], [this.inner - 3, 0]]), class: 'mark' });
    add(this.pin, 'circle', { r: 2.5, class: 'centre' });
    const path = add(svg, 'g', { class: 'path' });
    this.pieces = Array.from({ length: PIECES }, (_, i) => add(path, 'path', {
      opacity: (((i + 1) / PIECES) ** 1.5).toFixed(2),
    }));
    this.flash = add(svg, 'circle', { class: 'flash', r: 0 });
    this.normal = add(svg, 'path', { class: 'force' });
    this.friction = add(svg, 'path', { class: 'force' });
  }

  /** A circle, or what is deeper by so much [m] at even angles of its link. */
  #surface(group, kind, radius, depths) {
    if (!depths?.some((x) => x)) {
      add(group, 'circle', { r: radius, class: kind });
      return;
    }
    const points = depths.map((depth, k) => {
      const [far, angle] = [radius + depth * this.scale, (2 * Math.PI * k) / depths.length];
      return [far * Math.cos(angle), -far * Math.sin(angle)];
    });
    add(group, 'path', { class: kind, d: `${line(points)}Z` });
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
    const touch = [this.bore * ux, this.bore * uy];
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
    this.flash.setAttribute('cx', (this.bore * Math.cos(last.angle)).toFixed(2));
    this.flash.setAttribute('cy', (-this.bore * Math.sin(last.angle)).toFixed(2));
    this.flash.setAttribute('opacity', (1 - last.age).toFixed(3));
  }
}

/** A play between walls, or what may part, magnified: what has the walls, and what is between. */
class Slit extends Glass {
  /** @param {HTMLElement} host to be filled @param {Object} stage @param {number} index of the play */
  constructor(host, stage, index) {
    const play = stage.plays[index];
    const two = play.walls > 1;
    const kind = play.parts ? ['at most', 'play'][Number(two)] : 'space drawn';
    super(host, stage, play, play.width / 2, 'play', `${kind} ${quantity(play.width, 'm')}`);
    Object.assign(this, { index, play, two });
    for (const side of this.two ? [-1, 1] : [1]) {
      add(this.svg, 'rect', { class: 'part', x: side > 0 ? BORE : -BORE - 26, y: -100, width: 26,
        height: 200, style: `--link: var(--link-${this.play.face})` });
    }
    const [wide, high] = [this.inner, this.half];
    this.body = add(this.svg, 'rect', { class: 'part journal', x: -wide, y: -high,
      width: 2 * wide, height: 2 * high, rx: this.play.tilts ? 0 : 10, style: `--link: var(--link-${this.play.body})` });
  }

  /** @param {import('stage').Frame} frame */
  show(frame) {
    const none = 1e-6 * this.play.width; // is rounding
    const known = (x) => (Math.abs(x) < none ? 0 : x);
    const [left, right] = frame.walls[this.index].map(known);
    const [off, tilt] = frame.off[this.index].map(known);
    // across the walls all is as many times larger, so that corners touch them where they do
    const lean = (0.5 * this.scale * tilt) / this.half;
    this.body.setAttribute('transform',
      `matrix(1 0 ${lean.toFixed(5)} 1 ${(this.scale * off).toFixed(3)} 0)`);
    this.body.dataset.x = this.two ? off : right;
    this.words.textContent = this.said[frame.touching[this.index]];
    this.values.textContent = this.two
      ? `left ${quantity(left, 'm')}, right ${quantity(right, 'm')}` : `gap ${quantity(right, 'm')}`;
    if (this.play.tilts) this.values.textContent += `, tilt ${quantity(tilt, 'm')}`;
  }
}
