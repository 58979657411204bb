/** What drawings of pages are made of. */

const SPACE = 'http://www.w3.org/2000/svg';

/**
 * An SVG element, appended to its parent.
 * @param {Element} parent
 * @param {string} name
 * @param {Object<string, string|number>} attributes
 * @returns {SVGElement}
 */
export function add(parent, name, attributes = {}) {
  const made = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.append(made);
  return made;
}

/** Points as the data of a path. @param {number[][]} points @param {boolean} closed */
export function line(points, closed = false) {
  const places = points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`);
  return `M${places.join('L')}${closed ? 'Z' : ''}`;
}

/** A point of a link in the world. @param {number[]} pose x, y and angle @param {number[]} at */
export function carried([x, y, angle], [px, py]) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [x + c * px - s * py, y + s * px + c * py];
}

/**
 * An arrow as a filled path; nothing where it is too short to be seen.
 * @param {number[]} from @param {number[]} to @param {number} thick width of its shaft
 */
export function arrow(from, to, thick) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  if (!(length > 0.5 * thick)) return '';
  const [ux, uy] = [dx / length, dy / length];
  const head = Math.min(4.5 * thick, 0.6 * length);
  const sides = [[0, 0.5 * thick], [length - head, 0.5 * thick], [length - head, 0.45 * head],
    [length, 0], [length - head, -0.45 * head], [length - head, -0.5 * thick], [0, -0.5 * thick]];
  return line(sides.map(([s, a]) => [from[0] + s * ux - a * uy, from[1] + s * uy + a * ux]), true);
}

const watched = new WeakMap();

/** Calls `act` whenever an element changes its size, in place of what was called before. */
export function onResize(element, act) {
  watched.get(element)?.disconnect();
  const watch = new ResizeObserver(act);
  watch.observe(element);
  watched.set(element, watch);
}

/**
 * A number with a unit of a size that people read, as '12.3 mN'.
 * @param {number} value @param {string} unit
 */
export function quantity(value, unit) {
  if (!(Math.abs(value) > 0)) return `0 ${unit}`;
  const thousands = Math.max(-4, Math.min(3, Math.floor(Math.log10(Math.abs(value)) / 3)));
  const prefix = ['p', 'n', 'µ', 'm', '', 'k', 'M', 'G'][thousands + 4];
  return `${Number((value / 1000 ** thousands).toPrecision(3))} ${prefix}${unit}`;
}

/** The nearest of 1, 2 and 5 times a power of ten that is not below x. */
export function step(x) {
  const ten = 10 ** Math.floor(Math.log10(x));
  return [1, 2, 5, 10].find((times) => times * ten >= x) * ten;
}
