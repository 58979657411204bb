import { keys } from 'keys';
import { lensOf } from 'lens';
import { showPlaying } from 'player';
import { Stage } from 'stage';
import { Stream } from 'stream';
import { Strip } from 'strip';
import { Sliders } from 'sliders';
import { connected, say } from 'wire';
import { zoomable } from 'zoom';

const SECONDS = 4; // of ours, in a strip

const by = (id) => document.getElementById(id);
const html = document.documentElement;
let shown = null; // what is shown of a machine: stage, stream, lens, strips
let state = {};
let wanted = null; // playing or not, as it was asked for, until the run says the same

const sliders = new Sliders(by('sliders'), (path, value) => ask({ type: 'set', path, value }));
const heard = { stage: begin, frames, state: tell, waiting, message: refused };
const ask = connected('/live', heard, () => {
  if (shown) say('The view has ended; this page tries to reconnect.');
  else waiting({ ended: true });
});

start();

function start() {
  by('play').addEventListener('click', toggle);
  by('step').addEventListener('click', () => ask({ type: 'step' }));
  by('reset').addEventListener('click', () => ask({ type: 'reset' }));
  by('bearing').addEventListener('change', () => choose(by('bearing').value));
  for (const name of ['names', 'forces']) by(name).addEventListener('change', layers);
  keys({ ' ': toggle, ArrowRight: () => ask({ type: 'step' }) });
  zoomable(by('stage'), () => (shown ? [shown.stage] : []));
  let before = performance.now();
  const tick = (wall) => {
    draw(Math.max(0, wall - before) / 1000, wall / 1000);
    before = wall;
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

function waiting({ starting, ended }) {
  if (shown) say('The run has ended.');
  by('starting').hidden = !starting;
  by('none').hidden = starting || ended;
  by('ended').hidden = !ended;
  shown = null;
  document.body.dataset.shown = 'waiting';
  const title = starting ? 'The machine is being started' : 'No machine is running';
  by('title').textContent = ended ? 'The view has ended' : title;
  html.dataset.time = '';
}

function begin({ stage, controls }) {
  const before = shown;
  document.body.dataset.shown = 'machine';
  by('scene').textContent = stage.scene;
  by('title').textContent = stage.title;
  document.title = `${stage.scene}: live view`;
  const loose = [...stage.bearings, ...stage.plays].map(({ joint }) => joint);
  document.body.classList.toggle('tight', !loose.length);
  by('magnified').hidden = !loose.length;
  by('choice').hidden = loose.length < 2;
  by('arrows').hidden = !stage.joints.length;
  by('bearing').replaceChildren(...loose.map((joint) => new Option(joint, joint)));
  shown = { data: stage, stage: new Stage(by('stage'), stage), stream: new Stream(stage) };
  html.dataset.time = ''; // nothing stands anywhere yet
  if (before?.data.scene === stage.scene) shown.stage.lookAs(before.stage);
  layers();
  choose(loose.includes(before?.joint) ? before.joint : loose[0]);
  sliders.show(controls);
}

function choose(joint) {
  const { data, stage, stream } = shown;
  shown.joint = joint;
  by('bearing').value = joint;
  shown.lens = lensOf(by('lens'), data, joint, (bearing, t) => stream.path(bearing, t));
  stage.callout(joint, by('lens'));
  by('strips').replaceChildren();
  shown.strips = strips(data, joint).map(([of, what]) => ({
    of, strip: new Strip(by('strips'), what),
  }));
  for (const part of stream.parts) chart(part);
}

/** What strips show: (part of the stream, instant) to a value, and its name and unit. */
function strips({ main, slides, joints, force, bounds: [left, , right] }, joint) {
  const found = [[(part) => part.speed, {
    label: `speed of ${main}`, usual: 1, ...(slides ? { unit: 'm/s' }
      : { unit: 'rpm', scale: 30 / Math.PI }),
  }]];
  if (!joints.length) return found;
  found.push([(part) => part.torque, {
    label: slides ? 'force of the drive' : 'torque of the drive', unit: slides ? 'N' : 'N m',
    usual: slides ? force : force * (right - left),
  }]);
  const index = joint ? joints.findIndex(({ name }) => name === joint) : joints.length - 1;
  found.push([({ t, forces, joints: all }) => Array.from(t, (_, i) => Math.hypot(
    forces[(i * all + index) * 2], forces[(i * all + index) * 2 + 1])), {
    label: `force in ${joints[index].name}`, unit: 'N', usual: force,
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

function refused({ text, path }) {
  if (path) sliders.refuse(path);
  wanted = null;
  say(text);
}

function tell(news) {
  state = news;
  if (state.playing === wanted) wanted = null;
  html.dataset.run = state.run;
  by('factor').textContent = state.factor === null ? '' : `${Number(state.factor.toPrecision(2))} ×`;
  by('impacts').textContent = state.impacts;
  by('struck').hidden = !shown?.joint && !state.impacts;
  showPlaying(state.playing);
  by('play').disabled = by('reset').disabled = !state.operable;
  by('step').disabled = !state.operable || state.playing;
  sliders.set(state.values, state.operable);
}

function layers() {
  for (const name of ['names', 'forces']) shown?.stage.layer(name, by(name).checked);
}

function toggle() {
  wanted = !(wanted ?? state.playing);
  ask({ type: wanted ? 'play' : 'pause' });
}
