import * as equations from 'equations';
import { Curves } from 'curves';
import { html } from 'html';
import { IdealMotion, pointOf } from 'ideal_motion';
import { keys } from 'keys';
import { Player, showPlaying } from 'player';
import { Sliders } from 'sliders';
import { Stage } from 'stage';
import { onResize, quantity, step } from 'svg';
import { zoomable } from 'zoom';

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5];
const PERIOD = 4; // of a turn, or of a way, at the start [s]
const CLIP = 4; // times what is seldom exceeded: at its limits a drive moves links without limit
const ROOM = 2.5; // symbols around a drawing
const EACH = 8; // of the places by which a drawing is bounded
const [TURN, DEGREES, RPM] = [2 * Math.PI, 180 / Math.PI, 30 / Math.PI];

const by = (id) => document.getElementById(id);
const data = JSON.parse(by('data').textContent);
const timed = data.laws.length > 0;
const backwards = data.speed < 0;
const drive = data.main;
const [LENGTH, METRE] = data.length;
const shift = data.turns && data.low > Math.PI ? TURN : 0; // angles are written from -180° on
const across = (u) => (timed ? u : data.slides ? METRE * u : DEGREES * (u - shift));
const axis = timed ? 'time [s]' : `${drive} [${data.slides ? LENGTH : '°'}]`;
const written = (u) => (timed ? `${u.toFixed(2)} s` : `${across(u).toFixed(1)}${data.slides ? ` ${LENGTH}` : '°'}`);
const number = (x) => String(Number(x.toPrecision(4)));
const motion = new IdealMotion(data, equations);
const original = new IdealMotion(data, equations);
const controls = data.sliders.concat(timed ? [] : [speedControl()]);
const choices = quantities();
let places = motion.all(); // of the whole way
let pale = original.all();
let [stage, corners, curves, view] = [null, null, null, null];
const player = new Player(course(), show);
const sliders = new Sliders(by('sliders'), ask, 0);

sliders.show(controls);
for (const [group, key] of choices) {
  by('quantity').append(Object.assign(new Option(key, key), { title: group }));
}
for (const times of SPEEDS) by('speed').add(new Option(`${times}×`, times, times === 1, times === 1));
by('quantity').addEventListener('change', chart);
by('speed').addEventListener('change', pace);
by('play').addEventListener('click', () => player.toggle());
by('reset').addEventListener('click', reset);
by('scrub').addEventListener('input', () => seek(motion.low + Number(by('scrub').value) * (motion.high - motion.low)));
for (const layer of ['names', 'paths']) by(layer).addEventListener('change', layers);
keys({ ' ': () => player.toggle(), ArrowLeft: () => player.step(-1), ArrowRight: () => player.step(1), Escape: reset,
  Home: () => seek(motion.low), End: () => seek(motion.high) });
zoomable(by('stage'), () => [stage].filter(Boolean));
draw();
seek(data.start);
onResize(by('curves'), chart);
document.documentElement.dataset.ready = '1';

function speedControl() {
  const [unit, scale] = data.slides ? ['m/s', 1] : ['rpm', RPM];
  const value = scale * data.speed;
  const [low, high] = [0.1 * value, 3 * value].sort((a, b) => a - b);
  return { path: '', label: `speed of ${drive}`, unit, scale, low, high, value, step: (high - low) / 1000,
    effect: 'now', logarithmic: false };
}

/** Another value of a slider, in its unit. */
function ask(path, value) {
  const { scale } = controls.find((control) => control.path === path);
  sliders.set({ [path]: value }, true);
  if (path) become({ ...(motion.asked ?? motion.values), [path]: value / scale });
  else {
    motion.speed = value / scale;
    original.speed = motion.speed;
    pale = original.all();
    draw();
  }
}

function reset() {
  sliders.set(Object.fromEntries(controls.map(({ path, value }) => [path, value])), true);
  for (const { path } of controls) sliders.refuse(path);
  [motion.speed, original.speed, corners] = [data.speed, data.speed, null];
  pale = original.all();
  become({ ...original.values });
}

/** Takes the values of all sliders, as far as the machine can be put together. */
function become(values) {
  motion.asked = values;
  const closed = motion.change(values);
  document.body.classList.toggle('torn', !closed);
  if (closed) draw();
  else by('state').textContent = 'With these values the loops cannot be closed: the machine is drawn as it was before.';
}

function draw() {
  places = motion.all();
  player.frames = course();
  const made = drawing();
  const length = [5, 2, 1, 0.5].map((x) => x * 0.2 * step(made.bounds[2] - made.bounds[0]))
    .find((x) => x <= 0.2 * (made.bounds[2] - made.bounds[0]));
  const before = stage;
  stage = new Stage(by('stage'), { ...made, scale: { length, text: quantity(length, 'm') } });
  stage.trace(places.map(frameOf));
  stage.lookAs(before);
  layers();
  chart();
  pace();
  const [low, high] = motion.limited;
  const [from, to] = [motion.low, motion.high].map(written);
  by('state').textContent = !(low || high) ? '' : timed ? `The loops can be closed from ${from} to ${to} only.`
    : `${drive} goes from ${from} to ${to} only; beyond, the loops cannot be closed.`;
  by('figures').replaceChildren(...figures().map(([name, value]) => (
    html('div', {}, html('dt', {}, name), html('dd', {}, value)))));
  if (view && !player.playing) seek(view.u);
}

// --- drawing ---------------------------------------------------------------------------------------

/** The machine as `Stage` takes it; it keeps its scale unless it grows out of it. */
function drawing() {
  const { stage: given } = data;
  const { symbol } = given;
  const points = [];
  const shapes = given.shapes.map((shape) => {
    const pairs = (name) => motion.dimension(name).reduce((all, x, i) => (
      i % 2 ? all.at(-1).push(x) : all.push([x])) && all, []);
    const every = pairs(`shape:${shape.name}`);
    const paths = shape.paths.map(([style, ranges, radii]) => [style, ranges.map((range, i) => {
      const curve = range.map((k) => every[k]);
      return radii[i] ? rounded(curve, radii[i]) : curve;
    })]);
    const outline = shape.kind === 'link' && paths.length ? hull(every) : pairs(`outline:${shape.name}`);
    const link = given.links.indexOf(shape.link);
    const around = hull(paths.length ? paths.flatMap(([, curves]) => curves.flat()) : outline);
    for (const { poses } of link < 0 ? places.slice(0, 1) : places.filter((_, k) => k % EACH === 0)) {
      for (const p of around) points.push(link < 0 ? p : pointOf(poses[link], p));
    }
    return { ...shape, outline,
      paths: paths.map(([style, all]) => [style, all.map((curve) => curve.flat().map((x) => (10 * x) / symbol))]) };
  });
  const sides = [0, 1].map((k) => points.reduce(([a, b], p) => [Math.min(a, p[k]), Math.max(b, p[k])], [Infinity, -Infinity]));
  const own = [0, 1].flatMap((k) => sides.map((side) => side[k] + (k ? ROOM : -ROOM) * symbol));
  corners = own.map((x, k) => (corners ? [Math.min, Math.max][Number(k > 1)](x, corners[k]) : x));
  const ends = (links, name, size) => links.map((link, k) => {
    const [x, y, ...more] = motion.dimension(name).slice(size * k, size * (k + 1));
    return [link, [x, y], ...more];
  });
  return { ...given, shapes, bounds: corners,
    springs: given.springs.map((links, i) => ends(links, `spring:${i}`, 2)),
    ropes: given.ropes.map((links, i) => ends(links, `rope:${i}`, 3)) };
}

/** The convex polygon around points, counterclockwise. */
function hull(points) {
  const sorted = [...points].sort(([a, b], [c, d]) => a - c || b - d);
  const half = (all) => all.reduce((found, [x, y]) => {
    const left = () => {
      const [[a, b], [c, d]] = found.slice(-2);
      return (c - a) * (y - b) - (d - b) * (x - a) <= 0;
    };
    while (found.length > 1 && left()) found.pop();
    found.push([x, y]);
    return found;
  }, []).slice(0, -1);
  return sorted.length < 2 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}

/** The edge of the plate that reaches so far around all points. */
function rounded(points, radius) {
  return hull(points.flatMap(([x, y]) => Array.from({ length: 24 }, (_, k) => [
    x + radius * Math.cos((TURN * k) / 24), y + radius * Math.sin((TURN * k) / 24)])));
}

function layers() {
  for (const layer of ['names', 'paths']) stage.layer(layer, by(layer).checked);
}

// --- chart and figures -----------------------------------------------------------------------------

/** All that the chart can show: [of what, name, unit, function(Place, IdealMotion)]. */
function quantities() {
  const found = data.coordinates.flatMap(({ name, slides }, i) => {
    if (data.held.includes(i) && !timed) return [];
    const label = name;
    return [
      [label, slides ? `${label}: displacement` : `${label}: angle`, slides ? LENGTH : '°',
        ({ q }) => (slides ? METRE : DEGREES) * q[i]],
      [label, slides ? `${label}: velocity` : `${label}: angular velocity`, slides ? 'm/s' : 'rad/s', ({ v }) => v[i]],
      [label, slides ? `${label}: acceleration` : `${label}: angular acceleration`, slides ? 'm/s²' : 'rad/s²', ({ a }) => a[i]],
    ];
  });
  const outputs = Math.max(0, found.length - 3);
  found.unshift(...found.splice(outputs, 3)); // the last link is mostly what a machine is for
  for (const [link, name] of data.points) {
    const k = data.stage.links.indexOf(link);
    const label = `${link}.${name}`;
    const of = (value) => ({ poses }, machine) => value(pointOf(poses[k], machine.dimension(`point:${link}.${name}`)));
    found.push([label, `${label}: x`, LENGTH, of(([x]) => METRE * x)], [label, `${label}: y`, LENGTH, of(([, y]) => METRE * y)],
      [label, `${label}: speed`, 'm/s', of(([, , vx, vy]) => Math.hypot(vx, vy))],
      [label, `${label}: acceleration`, 'm/s²', of(([, , , , ax, ay]) => Math.hypot(ax, ay))]);
  }
  return found;
}

function chosen() {
  return choices.find(([, key]) => key === by('quantity').value);
}

function chart() {
  if (!chosen()) return;
  const [, label, unit, of] = chosen();
  const run = (machine, all) => ({ at: all.map(({ u }) => across(u)), values: clipped(all.map((place) => of(place, machine))) });
  curves = new Curves(by('curves'), { label, unit, along: axis, every: timed || data.slides ? 0 : 60,
    runs: [run(original, pale), run(motion, places)] });
  curves.choose(1);
  if (view) curves.show(across(view.u));
}

function clipped(values) {
  const sorted = values.filter(Number.isFinite).map(Math.abs).sort((a, b) => a - b);
  const most = CLIP * (sorted[Math.floor(0.9 * sorted.length)] ?? 0);
  return values.map((x) => (Number.isFinite(x) ? Math.min(Math.max(x, -most), most) : 0));
}

/** Rows of names and values. */
function figures() {
  const found = timed ? [] : [[`${drive}, the drive`, motion.full ? 'turns fully' : `${written(motion.low)} to ${written(motion.high)}`]];
  data.coordinates.forEach(({ name, slides }, i) => {
    if (!data.held.includes(i)) found.push([name, range(i, slides)]);
  });
  if (!data.sides.length) return found;
  const ends = data.sides.map((link) => motion.dimension(`side:${link}`));
  const lengths = ends.map(([x, y, u, v]) => METRE * Math.hypot(u - x, v - y));
  const order = [0, 1, 2, 3].sort((i, j) => lengths[i] - lengths[j]);
  const [s, p, q, l] = order.map((i) => lengths[i]);
  const equal = Math.abs(p + q - s - l) < 1e-9 * l;
  const sign = equal ? '=' : s + l < p + q ? '<' : '>';
  const kind = { '=': 'change point', '>': 'no link turns fully',
    '<': ['double crank', 'crank and rocker', 'crank and rocker', 'double rocker'][order[0]] }[sign];
  const led = data.sides.findIndex((link, i) => i > 0 && i < 3 && link !== data.main);
  const between = places.map(({ poses }) => [3, led].map((i) => {
    const [x, y, u, v] = ends[i];
    return poses[data.stage.links.indexOf(data.sides[i])][2] + Math.atan2(v - y, u - x);
  })).map(([a, b]) => DEGREES * Math.asin(Math.min(1, Math.abs(Math.sin(a - b)))));
  found.push(['Grashof', `${number(s + l)} ${sign} ${number(p + q)} ${LENGTH}: ${kind}`],
    ['transmission angle', `at least ${Math.min(...between).toFixed(1)}°`]);
  return found;
}

/** The stroke or the swing of a coordinate, and how much slower it goes one way. */
function range(i, slides) {
  const values = places.map(({ q }) => q[i]);
  const far = values.at(-1) - values[0];
  const ways = (motion.high - motion.low) / TURN;
  if (!slides && motion.full && Math.abs(far) > 3) {
    return Math.abs(Math.abs(far) / (ways * TURN) - 1) < 1e-9 ? 'turns fully' : `turns ${number(far / (ways * TURN))} times as far`;
  }
  const [[low, at], [high, up]] = [-1, 1].map((sign) => extreme(values, sign));
  const text = slides ? `stroke ${number(METRE * (high - low))} ${LENGTH}` : `swings ${number(DEGREES * (high - low))}°`;
  if (!motion.full || ways > 1.5) return text;
  const share = (((up - at) / (values.length - 1)) % 1 + 1) % 1;
  const ratio = Math.max(share, 1 - share) / Math.min(share, 1 - share);
  return Number.isFinite(ratio) ? `${text}, time ratio ${ratio.toFixed(2)}` : text;
}

/** The largest of values, or the least for sign -1, and its index, on a parabola. */
function extreme(values, sign) {
  const last = values.length - 1;
  const k = values.reduce((best, x, i) => (sign * x > sign * values[best] ? i : best), 0);
  if (!motion.full && (k === 0 || k === last)) return [values[k], k];
  const [a, b, c] = [values[k ? k - 1 : last - 1], values[k], values[k < last ? k + 1 : 1]];
  const off = a - 2 * b + c ? (0.5 * (a - c)) / (a - 2 * b + c) : 0;
  return [b - 0.25 * (a - c) * off, k + off];
}

// --- playing ---------------------------------------------------------------------------------------

/** What is played: the way of the drive as it runs, and back where it does not turn round. */
function course() {
  const { low, high } = motion;
  const end = motion.full || timed ? high : 2 * high - low;
  return { start: low, end, t: places.map(({ u }) => u), at: (s) => frameOf(motion.at(played(s))) };
}

/** The position of the drive at a place of the way that is played, and the other way round. */
function played(s) {
  if (s > motion.high) return 2 * motion.high - s;
  return backwards && motion.full ? motion.low + motion.high - s : s;
}

function frameOf(place) {
  return { ...place, t: place.u, forces: [], pins: [], modes: [] };
}

function show(frame, shown) {
  view = frame;
  stage?.show(frame);
  curves?.show(across(frame.u));
  by('scrub').value = (frame.u - motion.low) / (motion.high - motion.low || 1);
  by('drive').textContent = written(frame.u);
  by('scrub').setAttribute('aria-valuetext', by('drive').textContent);
  const [, , unit, of] = chosen() ?? [];
  if (of) by('now').textContent = `${number(of(frame, motion))} ${unit}`;
  showPlaying(shown?.playing);
}

function seek(u) {
  player.playing = false;
  player.seek(played(Math.min(Math.max(u, motion.low), motion.high)));
}

function pace() {
  const { start, end } = player.frames;
  const ways = motion.full ? (end - start) / TURN : 1;
  player.speed = (Number(by('speed').value) * (end - start)) / (ways * PERIOD);
  player.loop = [start, end];
}
