import { Charts, loadPlotly } from 'charts';
import { Curves } from 'curves';
import { keys } from 'keys';
import { lensOf } from 'lens';
import { Player, Recording, nearest, showPlaying } from 'player';
import { Stage } from 'stage';
import { quantity } from 'svg';
import { zoomable } from 'zoom';

const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
const SLOWEST = 0.01; // that is offered where a turn does not need less
const TURN = 4; // of ours [s], at the start
const BINS = 600;
const LAYERS = ['names', 'forces', 'paths'];

const by = (id) => document.getElementById(id);
const data = JSON.parse(by('data').textContent);
const family = [data, ...(data.family ?? [])];
let chosen = data; // of the family
let recording = new Recording(data);
let stage = new Stage(by('stage'), data.stage);
const curves = (data.curves ?? []).map((each, k) => (
  new Curves(document.querySelectorAll('svg.curves')[k], each)));
const others = (data.others ?? []).map((each, k) => ({
  data: each, run: new Recording(each), lens: null,
  ghost: new Stage(document.querySelectorAll('svg.ghost')[k], each.stage),
}));
let lens = null;
let charts = null;

stage.trace(recording.turn());
const player = new Player(recording, show);
start();
performance.mark('plays');
await loadPlotly();
charts = new Charts(JSON.parse(by('charts').textContent), {
  seek, loop, hover: (t) => { if (!player.playing) player.seek(t); },
  light: (names) => stage.light(names), pick,
}, data.dark, data.stage.scene);
charts.cursor(player.time);
charts.place(data.places?.[0]?.[0]);
document.documentElement.dataset.ready = '1';

function start() {
  player.speed = speeds();
  by('family')?.addEventListener('input', () => become(Number(by('family').value)));
  if (data.family) name(0);
  ticks();
  choose(0);
  layers();
  by('play').addEventListener('click', () => player.toggle());
  by('back').addEventListener('click', () => step(-1));
  by('on').addEventListener('click', () => step(1));
  by('scrub').addEventListener('input', () => {
    const share = Number(by('scrub').value);
    seek(recording.start + share * (recording.end - recording.start));
  });
  by('speed').addEventListener('change', () => { player.speed = Number(by('speed').value); });
  by('bearing')?.addEventListener('change', () => choose(Number(by('bearing').value)));
  for (const layer of LAYERS) by(layer)?.addEventListener('change', layers);
  by('loop').addEventListener('click', () => loop(null));
  by('stage').addEventListener('pointerover', ({ target }) => {
    const { kind, link, label } = target.closest('g[data-kind]')?.dataset ?? {};
    charts?.light(kind === 'link' ? link : label || link);
  });
  by('stage').addEventListener('pointerleave', () => charts?.light());
  keys({ ' ': () => player.toggle(), ArrowLeft: () => step(-1), ArrowRight: () => step(1),
    Home: () => seek(recording.start), End: () => seek(recording.end), Escape: () => loop(null) });
  zoomable(by('stage'), () => [stage, ...others.map(({ ghost }) => ghost)]);
  window.addEventListener('beforeprint', () => charts?.paper());
  window.addEventListener('afterprint', () => charts?.screen());
}

function layers() {
  for (const layer of LAYERS) if (by(layer)) stage.layer(layer, by(layer).checked);
}

function name(member) {
  by('value').textContent = by('family').dataset.values.split('|')[member];
  by('family').setAttribute('aria-valuetext', by('value').textContent);
  for (const each of curves) each.choose(member);
  charts?.place(data.places[member]?.[0]);
}

/** Shows the run of the family that is nearest to a place of a chart over its value. */
function pick(x, y) {
  const nearest = (all, to) => Math.min(...all.map((at) => Math.abs(at - to)));
  const at = nearest(data.places.map(([each]) => each), x);
  const off = data.places.map(([each, heights]) => (
    Math.abs(each - x) <= at ? nearest(heights, y) : Infinity));
  const member = off.indexOf(Math.min(...off));
  by('family').value = member;
  become(member);
}

/** Shows another run of the family, as far on as this one. */
function become(member) {
  const share = (player.time - recording.start) / (recording.end - recording.start || 1);
  chosen = family[member];
  recording = new Recording(chosen);
  const before = stage;
  stage = new Stage(by('stage'), chosen.stage);
  stage.trace(recording.turn());
  stage.lookAs(before);
  layers();
  name(member);
  ticks();
  player.frames = recording;
  player.now = recording.start + share * (recording.end - recording.start);
  choose(Number(by('bearing')?.value ?? 0));
}

function show(frame, shown) {
  stage.show(frame);
  for (const each of curves) each.show(frame.t);
  lens?.show(frame);
  for (const { run, ghost, lens: beside } of others) {
    const now = run.at(Math.min(frame.t, run.end), shown?.glow ?? 0);
    ghost.show(now);
    beside?.show(now);
  }
  charts?.cursor(frame.t);
  const share = (frame.t - recording.start) / (recording.end - recording.start || 1);
  by('scrub').value = share;
  by('scrub').style.setProperty('--share', share);
  by('time').textContent = `${frame.t.toFixed(digits())} s`;
  by('scrub').setAttribute('aria-valuetext', by('time').textContent);
  by('drive').textContent = drive(frame.drive);
  by('shown').textContent = `Shown at ${by('time').textContent}, ${
    data.stage.main} ${by('drive').textContent.trim()}.`;
  document.documentElement.dataset.time = frame.t;
  showPlaying(shown?.playing);
}

function drive(value) {
  if (data.stage.slides) return quantity(value, 'm');
  const degrees = (((value * 180) / Math.PI) % 360 + 360) % 360;
  return `${degrees.toFixed(1).padStart(5, '\u2007')}°`;
}

/** So many that an instant can be told from the next. */
function digits() {
  const apart = (recording.end - recording.start) / recording.t.length;
  return Math.max(2, Math.min(9, Math.ceil(-Math.log10(apart)) + 1));
}

/** Fills in the speeds. @returns {number} that at which a turn takes some seconds */
function speeds() {
  const turn = data.turn ?? (recording.end - recording.start) / 2;
  const first = nearest(SPEEDS, turn / TURN);
  for (const speed of SPEEDS.filter((x) => x >= Math.min(first, SLOWEST))) {
    by('speed').add(new Option(`${speed}×`, speed, speed === first, speed === first));
  }
  return first;
}

/** Impacts below the scrub bar, as high as the hardest of each place is hard. */
function ticks() {
  const { t, impulse, hardest } = recording.struck;
  const most = new Float64Array(BINS);
  const scale = (BINS - 1) / (recording.end - recording.start || 1);
  t.forEach((at, i) => {
    const bin = Math.round((at - recording.start) * scale);
    most[bin] = Math.max(most[bin], impulse[i] / hardest);
  });
  const strokes = Array.from(most, (share, bin) => (share
    ? `M${bin + 0.5} 10v${(-10 * Math.max(0.15, Math.sqrt(share))).toFixed(2)}` : ''));
  by('ticks').firstElementChild.setAttribute('d', strokes.join(''));
}

function choose(bearing) {
  player.seek(player.time);
  if (!by('lens')) return;
  lens = magnified(by('lens'), chosen.stage, recording, bearing);
  others.forEach((other, k) => {
    const host = document.querySelectorAll('.beside')[k];
    if (!host) return;
    other.lens = magnified(host, other.data.stage, other.run, bearing);
    [by('lens'), host].forEach((x, i) => {
      const title = x.querySelector('.title');
      if (title) title.textContent = data.names[i && k + 1];
    });
  });
  stage.callout(data.bearings[bearing], by('lens'));
  player.seek(player.time);
}

/** The lens over a bearing of a run. */
function magnified(host, shown, run, bearing) {
  const turns = shown.slides ? 1 : 3; // it may run slower than in the mean
  const span = data.turn ? turns * data.turn : Infinity;
  return lensOf(host, shown, data.bearings[bearing], (index, t) => run.path(index, t, span));
}

/** Plays an interval [s] over and over, and shows it in charts; without one all. */
function loop(span) {
  player.loop = span && [Math.max(span[0], recording.start), Math.min(span[1], recording.end)];
  by('loop').hidden = !span;
  by('loop').textContent = span ? `loop ${player.loop.map((t) => t.toFixed(digits())).join(' to ')} s ×` : '';
  charts?.zoom(player.loop);
  if (span) player.seek(player.loop[0]);
}

function step(count) {
  player.step(count);
}

function seek(t) {
  player.playing = false;
  player.seek(t);
}
