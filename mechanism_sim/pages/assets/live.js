import { Lens } from 'lens';
import { Stage, words } from 'stage';
import { Stream } from 'stream';
import { Strip } from 'strip';
import { Sliders } from 'sliders';

const AGAIN = 1000; // [ms] until a lost connection is tried again
const SAID = 6000; // [ms] that a message stays
const SECONDS = 4; // of ours, in a strip

const by = (id) => document.getElementById(id);
const html = document.documentElement;
let socket = null;
let shown = null; // what is shown of a machine: stage, stream, lens, strips
let state = {};
let quiet = 0;

const sliders = new Sliders(by('sliders'), (path, value) => ask({ type: 'set', path, value }));
const heard = { stage: begin, frames, state: tell, waiting, message: ({ text }) => say(text) };

start();

function start() {
  by('play').addEventListener('click', toggle);
  by('step').addEventListener('click', () => ask({ type: 'step' }));
  by('reset').addEventListener('click', () => ask({ type: 'reset' }));
  by('bearing').addEventListener('change', () => choose(Number(by('bearing').value)));
  for (const name of ['names', 'forces']) by(name).addEventListener('change', layers);
  document.addEventListener('keydown', key);
  let before = performance.now();
  const tick = (wall) => {
    draw(Math.max(0, wall - before) / 1000, wall / 1000);
    before = wall;
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
  connect();
}

function connect() {
  socket = new WebSocket(`ws://${window.location.host}/live`);
  socket.addEventListener('message', ({ data }) => {
    const message = JSON.parse(data);
    heard[message.type]?.(message);
  });
  socket.addEventListener('close', () => {
    if (shown) say('The view has ended; this page looks for it again.');
    setTimeout(connect, AGAIN);
  });
}

function ask(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function waiting({ starting }) {
  if (shown) say('The run has ended.');
  by('starting').hidden = !starting;
  by('none').hidden = starting;
  shown = null;
  document.body.dataset.shown = 'waiting';
  by('title').textContent = starting ? 'The machine is being started' : 'No machine is running';
  html.dataset.time = '';
}

function begin({ stage, controls }) {
  const bearing = shown?.bearing ?? 0;
  document.body.dataset.shown = 'machine';
  by('scene').textContent = stage.scene;
  by('title').textContent = stage.title;
  document.title = `${stage.scene}: live view`;
  const loose = stage.bearings.length;
  document.body.classList.toggle('tight', !loose);
  by('magnified').hidden = !loose;
  by('choice').hidden = loose < 2;
  by('arrows').hidden = !stage.joints.length;
  by('bearing').replaceChildren(...stage.bearings.map(({ joint }, i) => new Option(words(joint), i)));
  shown = { data: stage, stage: new Stage(by('stage'), stage), stream: new Stream(stage) };
  layers();
  choose(bearing < loose ? bearing : 0);
  sliders.show(controls);
}

function choose(bearing) {
  const { data, stream } = shown;
  shown.bearing = bearing;
  by('bearing').value = bearing;
  shown.lens = data.bearings.length
    ? new Lens(by('lens'), data, bearing, (t) => stream.path(bearing, t)) : null;
  by('strips').replaceChildren();
  shown.strips = strips(data, bearing).map(([of, what]) => ({
    of, strip: new Strip(by('strips'), what),
  }));
  for (const part of stream.parts) chart(part);
}

/** What strips show: (part of the stream, instant) to a value, and its name and unit. */
function strips({ main, slides, joints, bearings }, bearing) {
  const found = [[(part) => part.speed, {
    label: `speed of ${words(main)}`, ...(slides ? { unit: 'm/s' }
      : { unit: 'rpm', scale: 30 / Math.PI }),
  }]];
  if (!joints.length) return found;
  found.push([(part) => part.torque, {
    label: slides ? 'force of the drive' : 'torque of the drive', unit: slides ? 'N' : 'N m',
  }]);
  const loose = bearings[bearing];
  const index = loose ? joints.findIndex(({ name }) => name === loose.joint) : joints.length - 1;
  found.push([({ t, forces, joints: all }) => Array.from(t, (_, i) => Math.hypot(
    forces[(i * all + index) * 2], forces[(i * all + index) * 2 + 1])), {
    label: `force in ${words(joints[index].name)}`, unit: 'N',
  }]);
  return found;
}

function frames(batch) {
  if (!shown) return;
  const { stream } = shown;
  if (batch.epoch !== stream.epoch) shown.strips.forEach(({ strip }) => strip.clear());
  const before = stream.parts.at(-1)?.end;
  const part = stream.add(batch, performance.now() / 1000);
  if (part.start > before) shown.strips.forEach(({ strip }) => strip.part(part.start));
  chart(part);
  for (const { t } of batch.impacts) shown.strips.forEach(({ strip }) => strip.mark(t));
}

function chart(part) {
  for (const { of, strip } of shown.strips) strip.add(part.t, of(part));
}

function draw(passed, wall) {
  const frame = shown?.stream.tick(passed, wall);
  if (!frame) return;
  shown.stage.show(frame);
  shown.lens?.show(frame);
  const seconds = shown.stream.span(SECONDS, state.values?.realtime_factor);
  for (const { strip } of shown.strips) strip.draw(frame.t, seconds);
  const digits = Math.min(9, Math.max(0, 2 - Math.round(Math.log10(seconds / SECONDS))));
  by('time').textContent = `${frame.t.toFixed(digits)} s`;
  html.dataset.time = frame.t;
}

function tell(news) {
  state = news;
  html.dataset.playing = state.playing ? '1' : '';
  html.dataset.run = state.run;
  by('factor').textContent = state.factor === null ? '' : `${Number(state.factor.toPrecision(2))} ×`;
  by('impacts').textContent = state.impacts;
  by('struck').hidden = !shown?.data.bearings.length && !state.impacts;
  by('play').setAttribute('aria-label', state.playing ? 'pause' : 'play');
  by('play').disabled = by('reset').disabled = !state.operable;
  by('step').disabled = !state.operable || state.playing;
  sliders.set(state.values, state.operable);
}

function say(text) {
  by('said').textContent = text;
  by('said').hidden = false;
  clearTimeout(quiet);
  quiet = setTimeout(() => { by('said').hidden = true; }, SAID);
}

function layers() {
  for (const name of ['names', 'forces']) shown?.stage.layer(name, by(name).checked);
}

function toggle() {
  ask({ type: state.playing ? 'pause' : 'play' });
}

function key(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const acts = { ' ': toggle, ArrowRight: () => ask({ type: 'step' }) };
  if (!(event.key in acts) || event.target.closest('select, button, input')) return;
  event.preventDefault();
  acts[event.key]();
}
