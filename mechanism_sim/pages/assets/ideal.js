import * as equations from 'equations';
import { Curves } from 'curves';
import { drawing } from 'ideal_drawing';
import { IdealMotion, pointOf } from 'ideal_motion';
import { keys } from 'keys';
import { Player } from 'player';
import { Stage, words } from 'stage';
import { onResize, quantity } from 'svg';
import { zoomable } from 'zoom';

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5];
const PERIOD = 4; // of a turn, or of a way there and back, at the start [s]
const WAYS = 1000; // of a slider
const CLIP = 4; // times what is seldom exceeded: at its limits a drive moves links without limit
const DEGREES = 180 / Math.PI;

const by = (id) => document.getElementById(id);
const data = JSON.parse(by('data').textContent);
const timed = data.laws.length > 0;
const drive = words(data.main);
const across = (u) => (timed ? u : data.slides ? 1000 * u : DEGREES * u);
const axis = timed ? 'time [s]' : data.slides ? `${drive} [mm]` : `${drive} [°]`;
const number = (x) => String(Number(x.toPrecision(4)));
const motion = new IdealMotion(data, equations);
const original = new IdealMotion(data, equations);
const wanted = { ...motion.values };
let places = motion.all();
let stage = null;
let box = null;
let widest = null;
let curves = null;
let view = null;
let waiting = false;
const player = new Player(course(), show);

start();
document.documentElement.dataset.ready = '1';

function start() {
  for (const slider of data.sliders) addSlider(slider);
  if (!timed) addSlider(speedSlider());
  for (const [label, choices] of quantities()) {
    const group = document.createElement('optgroup');
    group.label = label;
    for (const { name, key } of choices) group.append(new Option(name, key));
    by('quantity').append(group);
  }
  for (const times of SPEEDS) by('speed').add(new Option(`${times}×`, times, times === 1, times === 1));
  by('quantity').addEventListener('change', chart);
  by('speed').addEventListener('change', pace);
  by('play').addEventListener('click', toggle);
  by('back').addEventListener('click', () => player.step(-1));
  by('on').addEventListener('click', () => player.step(1));
  by('reset').addEventListener('click', reset);
  by('scrub').addEventListener('input', () => {
    const [low, high] = [motion.low, motion.high];
    player.playing = false;
    player.seek(low + Number(by('scrub').value) * (high - low));
  });
  for (const layer of ['names', 'paths']) by(layer).addEventListener('change', layers);
  keys({ ' ': toggle, ArrowLeft: () => player.step(-1), ArrowRight: () => player.step(1), Escape: reset,
    Home: () => player.seek(player.frames.start), End: () => player.seek(motion.high) });
  zoomable(by('stage'), () => [stage].filter(Boolean));
  onResize(by('curves'), chart);
  draw();
  pace();
  player.seek(data.start);
}

/** What is played: the way of the drive, and back where it does not turn round. */
function course() {
  const [start, high] = [motion.low, motion.high];
  const back = !motion.full && !timed;
  const end = back ? 2 * high - start : high;
  const to = (s) => (s > high ? 2 * high - s : s);
  return { start, end, t: places.map(({ u }) => u), at: (s) => ({ ...frameOf(motion.at(to(s))), s }) };
}

function frameOf(place) {
  return { ...place, poses: place.poses.map((pose) => pose.slice(0, 3)), t: place.u, forces: [], pins: [], modes: [] };
}

/** Takes the values of all sliders, as far as the machine can be put together. */
function become() {
  const closed = motion.change({ ...wanted });
  document.body.classList.toggle('torn', !closed);
  if (closed) {
    places = motion.all();
    const at = Math.min(Math.max(player.time, motion.low), motion.high);
    player.frames = course();
    player.now = at;
    draw();
    pace();
    if (!player.playing) player.seek(at);
  }
  told(closed);
}

function draw() {
  const made = drawing(data.stage, motion, places.filter((_, i) => i % 4 === 0));
  // the drawing keeps its scale while a slider moves, unless the machine grows out of it
  widest = widest ? widest.map((x, k) => (k < 2 ? Math.min : Math.max)(x, made.bounds[k])) : made.bounds;
  const width = widest[2] - widest[0];
  const length = below(0.2 * width);
  box = stage && stage.box[2] < stage.all[2] ? stage.box : null;
  stage = new Stage(by('stage'), { ...made, bounds: widest, scale: { length, text: quantity(length, 'm') } });
  stage.trace(places.map(frameOf));
  if (box) stage.look(box);
  layers();
  chart();
  table();
  told(true);
}

function below(x) {
  const ten = 10 ** Math.floor(Math.log10(x));
  return [5, 2, 1].find((times) => times * ten <= x) * ten;
}

function layers() {
  stage.layer('names', by('names').checked);
  stage.layer('paths', by('paths').checked);
}

function show(frame, shown) {
  view = frame;
  stage?.show(frame);
  curves?.show(across(frame.u));
  by('scrub').value = (frame.u - motion.low) / (motion.high - motion.low || 1);
  by('drive').textContent = position(frame.u);
  const choice = chosen();
  if (choice) by('now').textContent = `${number(choice.of(motion.at(frame.u)))} ${choice.unit}`;
  Object.assign(document.documentElement.dataset, { playing: shown?.playing ? '1' : '', u: frame.u });
  by('play').setAttribute('aria-label', shown?.playing ? 'pause' : 'play');
}

function position(u) {
  if (timed) return `${u.toFixed(2)} s`;
  return data.slides ? `${(1000 * u).toFixed(1)} mm` : `${(DEGREES * u).toFixed(1)}°`;
}

/** All that the chart can show: [of what, [{name, key, unit, of: function(Place): number}]]. */
function quantities() {
  const found = data.coordinates.map(({ name, slides }, i) => [words(name.replace('.', ' ')), [
    { what: slides ? 'displacement' : 'angle', unit: slides ? 'mm' : '°', of: ({ q }) => (slides ? 1000 : DEGREES) * q[i] },
    { what: slides ? 'velocity' : 'angular velocity', unit: slides ? 'm/s' : 'rad/s', of: ({ v }) => v[i] },
    { what: slides ? 'acceleration' : 'angular acceleration', unit: slides ? 'm/s²' : 'rad/s²', of: ({ a }) => a[i] },
  ], data.held.includes(i) && !timed]).filter(([, , given]) => !given).reverse();
  for (const [link, name] of data.points) {
    const k = data.stage.links.indexOf(link);
    const at = (machine) => (place) => pointOf(place.poses[k], machine.dimension(`point:${link}.${name}`));
    const of = (value) => (place, machine = motion) => value(at(machine)(place));
    found.push([words(`${link}.${name}`.replace('.', ' ')), [
      { what: 'x', unit: 'mm', of: of(([x]) => 1000 * x) },
      { what: 'y', unit: 'mm', of: of(([, y]) => 1000 * y) },
      { what: 'speed', unit: 'm/s', of: of(([, , vx, vy]) => Math.hypot(vx, vy)) },
      { what: 'acceleration', unit: 'm/s²', of: of(([, , , , ax, ay]) => Math.hypot(ax, ay)) },
    ]]);
  }
  return found.map(([label, choices]) => [label, choices.map((choice) => (
    { ...choice, name: `${label}: ${choice.what}`, key: `${label}: ${choice.what}` }))]);
}

function chosen() {
  return quantities().flatMap(([, choices]) => choices).find(({ key }) => key === by('quantity').value);
}

function chart() {
  const choice = chosen();
  if (!choice) return;
  const { name, unit, of } = choice;
  original.speed = motion.speed;
  const run = (machine, all) => ({ at: all.map(({ u }) => across(u)), values: clipped(all.map((place) => of(place, machine))) });
  const label = name;
  curves = new Curves(by('curves'), { label, unit, along: axis, runs: [run(original, original.all()), run(motion, places)] });
  curves.choose(1);
  if (view) curves.show(across(view.u));
}

/** Without the peaks of links that a drive near its limit moves without limit. */
function clipped(values) {
  const sorted = values.filter(Number.isFinite).map(Math.abs).sort((a, b) => a - b);
  const most = CLIP * (sorted[Math.floor(0.9 * sorted.length)] ?? 0);
  return values.map((x) => (Number.isFinite(x) ? Math.min(Math.max(x, -most), most) : 0));
}

function told(closed) {
  const sentences = [];
  const [low, high] = motion.limited;
  if (!closed) {
    sentences.push('With these values no position of the drive closes the loops. The machine is drawn as it was before.');
  } else if (low || high) {
    const [from, to] = [motion.low, motion.high].map(position);
    sentences.push(timed ? `After ${to} the loops cannot be closed any more.`
      : `The drive cannot go all the way: ${drive} goes from ${from} to ${to}; beyond, the loops cannot be closed.`);
  }
  by('state').textContent = sentences.join(' ');
}

// --- figures ---------------------------------------------------------------------------------------

function table() {
  const rows = [[`${drive}, the drive`, motion.full ? 'turns fully' : `${position(motion.low)} to ${position(motion.high)}`]];
  if (timed) rows.length = 0;
  data.coordinates.forEach(({ name, slides }, i) => {
    if (data.held.includes(i)) return;
    rows.push([words(name.replace('.', ' ')), range(i, slides)]);
  });
  rows.push(...grashof());
  by('figures').replaceChildren(...rows.map(([what, value]) => {
    const row = document.createElement('tr');
    const [th, td] = [document.createElement('th'), document.createElement('td')];
    th.scope = 'row';
    [th.textContent, td.textContent] = [what, value];
    row.append(th, td);
    return row;
  }));
}

/** The stroke or the swing of a coordinate, and how much slower it goes one way. */
function range(i, slides) {
  const values = places.map(({ q }) => q[i]);
  const [[low, at], [high, up]] = [-1, 1].map((sign) => extreme(values, sign));
  if (!slides && motion.full && Math.abs(values.at(-1) - values[0]) > 3) {
    const ratio = (values.at(-1) - values[0]) / (motion.high - motion.low);
    return Math.abs(Math.abs(ratio) - 1) < 1e-9 ? 'turns fully' : `turns ${number(ratio)} times as far`;
  }
  const far = slides ? `stroke ${number(1000 * (high - low))} mm` : `swings ${number(DEGREES * (high - low))}°`;
  const turns = (motion.high - motion.low) / (2 * Math.PI);
  if (!motion.full || turns > 1.5) return far;
  const share = (((up - at) / (places.length - 1)) % 1 + 1) % 1;
  const ratio = Math.max(share, 1 - share) / Math.min(share, 1 - share);
  return Number.isFinite(ratio) ? `${far}, time ratio ${ratio.toFixed(2)}` : far;
}

/** The largest of values, or the least for sign -1, and where it is, on a parabola. */
function extreme(values, sign) {
  let k = 0;
  values.forEach((x, i) => { if (sign * x > sign * values[k]) k = i; });
  const n = values.length - 1;
  if (!motion.full && (k === 0 || k === n)) return [values[k], k];
  const [a, b, c] = [values[k ? k - 1 : n - 1], values[k], values[k < n ? k + 1 : 1]];
  const bend = a - 2 * b + c;
  const off = bend ? Math.max(-1, Math.min(1, (0.5 * (a - c)) / bend)) : 0;
  return [b - 0.25 * (a - c) * off, k + off];
}

function grashof() {
  if (!data.sides.length) return [];
  const ends = data.sides.map((link) => motion.dimension(`side:${link}`));
  const lengths = ends.map(([x, y, u, v]) => Math.hypot(u - x, v - y));
  const order = lengths.map((_, i) => i).sort((i, j) => lengths[i] - lengths[j]);
  const [s, p, q, l] = order.map((i) => 1000 * lengths[i]);
  const room = p + q - s - l;
  const equal = Math.abs(room) < 1e-9 * (s + l);
  const kind = equal ? 'change point' : room < 0 ? 'no link turns fully'
    : ['double crank', 'crank and rocker', 'crank and rocker', 'double rocker, the coupler turns'][order[0]];
  const [few, many] = [s + l, p + q].map(number);
  const angles = places.map(({ poses }) => transmission(poses, ends));
  return [['Grashof', `${few} ${equal ? '=' : room > 0 ? '<' : '>'} ${many} mm: ${kind}`],
    ['transmission angle', `at least ${Math.min(...angles).toFixed(1)}°`]];
}

/** The angle between the coupler and the link that it moves. */
function transmission(poses, ends) {
  const led = data.sides.findIndex((link, i) => i > 0 && i < 3 && link !== data.main);
  const [one, other] = [3, led].map((i) => {
    const [x, y, u, v] = ends[i];
    return poses[data.stage.links.indexOf(data.sides[i])][2] + Math.atan2(v - y, u - x);
  });
  const between = Math.abs(Math.sin(one - other));
  return DEGREES * Math.asin(Math.min(1, between));
}

// --- sliders ---------------------------------------------------------------------------------------

function speedSlider() {
  const [unit, scale] = data.slides ? ['mm/s', 1000] : ['rpm', 30 / Math.PI];
  const [low, high] = [0.1 * data.speed, 3 * data.speed].sort((a, b) => a - b);
  return { path: '', label: `speed of ${drive}`, unit, scale, value: data.speed, low, high };
}

function addSlider({ path, label, unit, scale, value, low, high }) {
  const row = document.createElement('div');
  const [name, typed, ending, range] = ['label', 'input', 'span', 'input'].map((kind) => document.createElement(kind));
  row.className = 'slider';
  name.textContent = label;
  name.htmlFor = typed.id = `value ${path}`;
  ending.textContent = unit;
  const digits = Math.max(0, 2 - Math.floor(Math.log10((scale * (high - low)) || 1)));
  Object.assign(typed, { type: 'number', step: 10 ** -digits });
  Object.assign(range, { type: 'range', min: 0, max: WAYS, step: 1 });
  range.setAttribute('aria-label', label);
  range.dataset.path = path;
  const take = (x, from) => {
    if (from !== range) range.value = Math.round((WAYS * (x - low)) / (high - low));
    if (from !== typed) typed.value = Number((scale * x).toFixed(digits));
    if (!path) {
      [motion.speed, player.frames] = [x, player.frames];
      places = motion.all();
      if (stage) chart();
    } else wanted[path] = x;
  };
  range.addEventListener('input', () => {
    const x = low + (Number(range.value) / WAYS) * (high - low);
    take(Number((scale * x).toFixed(digits)) / scale, range);
    later();
  });
  typed.addEventListener('input', () => {
    const x = typed.valueAsNumber / scale;
    if (!Number.isFinite(x)) return;
    take(x, typed);
    later();
  });
  row.addEventListener('reset', () => take(value));
  row.append(name, typed, ending, range);
  by('sliders').append(row);
  take(value);
}

/** However fast a slider moves, the machine follows it once in each picture. */
function later() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    become();
  });
}

function reset() {
  widest = null;
  for (const row of by('sliders').children) row.dispatchEvent(new Event('reset'));
  become();
}

// --- playing ---------------------------------------------------------------------------------------

function pace() {
  const { start: from, end } = player.frames;
  const turns = motion.full ? (end - from) / (2 * Math.PI) : 1;
  player.speed = (Number(by('speed').value) * (end - from)) / (turns * PERIOD);
  player.loop = [from, end];
}

function toggle() {
  if (player.playing) player.pause();
  else player.play();
}
