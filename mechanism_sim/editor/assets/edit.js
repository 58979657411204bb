import { Canvas } from 'canvas';
import { Curves } from 'curves';
import { Fields } from 'fields';
import { html } from 'html';
import { lensOf } from 'lens';
import { Wear, LengthOfRun } from 'wear';
import { Player, Recording, nearest, showPlaying } from 'player';
import { words } from 'stage';
import { add, carried, quantity } from 'svg';
import { connected, say } from 'wire';

const TYPED = 400; // [ms] after which text that is being typed is told
const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];
const TURN = 4; // [s] of ours that a run takes at first, or longer
const TABS = ['parts', 'chart', 'run', 'yaml'];
const BOUNDS = [-0.1, -0.1, 0.3, 0.2]; // [m] of a machine that is begun

/** Tools that draw nothing: as those of `Tool.to_json`, which the page has from the kinds. */
const HAND = { name: 'hand', tools: [
  { name: 'move', key: 'V', icon: 'M4 2v11l3-3 2 4 2-1-2-4h4z', hint: 'Drag a joint or a point; drag the sheet to shift it' },
  { name: 'turn', key: 'T', icon: 'M8 2a6 6 0 1 0 6 6h-2a4 4 0 1 1-4-4v3l5-4-5-4z', hint: 'Drag a joint: the machine moves along its path' },
  { name: 'remove', key: 'X', icon: 'M4 5h8l-1 10H5zM6 1h4v1h4v2H2V2h4z', hint: 'Click on what to remove' },
] };
const GROUPS = [HAND, ...JSON.parse(document.getElementById('tools').textContent)];
const TOOLS = new Map(GROUPS.flatMap(({ tools }) => tools.map((tool) => [tool.name, tool])));

const by = (id) => document.getElementById(id);
const root = document.documentElement;
let state = null;
let run = null; // recording, player, message
let shown = null; // the state or the frame of a drag that is drawn
let pressed = null; // forces of ideal joints over a turn, or at its start
let typed = 0; // a timer, while text is typed that was not told
let held = null; // what is asked for goes with the next message
let waiting = null; // a gesture that is sent when the answer to the last one is there
let flying = false;
let fitted = null; // the document that was fitted
let curves = null;

const canvas = new Canvas(by('under'), by('stage'), by('over'), gesture);
const fields = new Fields(by('outline'), by('fields'), ask);
const wear = new Wear(ask);
const lengthOfRun = new LengthOfRun(ask);
const heard = { state: show, frame, pose, forces, checked, progress, run: ran, worn, problem, said: ({ text }) => announce(text), busy };
const send = connected(`/live${window.location.search}`, heard, () => {
  if (state) announce('The editor has ended; this page tries to reconnect.');
  flying = false;
  by('text').readOnly = true;
});
start();

function start() {
  by('palette').append(...GROUPS.flatMap(({ name, tools }) => (
    [html('h2', {}, name), ...tools.map(paletteButton)])));
  take('move');
  by('undo').addEventListener('click', () => ask({ type: 'undo' }));
  by('redo').addEventListener('click', () => ask({ type: 'redo' }));
  by('save').addEventListener('click', save);
  by('new').addEventListener('click', () => open(''));
  by('scenes').addEventListener('change', () => open(by('scenes').value));
  by('make').addEventListener('change', () => {
    ask({ type: 'make', what: by('make').value });
    by('make').value = '';
  });
  by('in').addEventListener('click', () => canvas.zoom(1.25));
  by('out').addEventListener('click', () => canvas.zoom(0.8));
  by('fit').addEventListener('click', fit);
  for (const name of ['names', 'forces']) by(name).addEventListener('change', () => canvas.layer(name, by(name).checked));
  by('text').addEventListener('input', () => { typed ||= setTimeout(tellText, TYPED); });
  by('text').addEventListener('change', tellText);
  by('quantity').addEventListener('change', () => ask({ type: 'chart', quantity: by('quantity').value }));
  by('play').addEventListener('click', toggle);
  by('scrub').addEventListener('input', () => {
    playing(true);
    run.player.playing = false;
    run.player.seek(run.recording.start + Number(by('scrub').value) * length());
  });
  by('speed').addEventListener('change', () => { run.player.speed = Number(by('speed').value); });
  for (const name of TABS) by(`tab-${name}`).addEventListener('click', () => tab(name));
  document.addEventListener('keydown', key);
  document.addEventListener('dragover', (event) => event.preventDefault());
  document.addEventListener('drop', async (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (file && leaves()) ask({ type: 'import', name: file.name, text: await file.text() });
  });
  window.addEventListener('beforeunload', (event) => {
    tellText();
    if (state?.changed || fields.typed) event.preventDefault();
  });
}

function paletteButton({ name, key: letter, icon, hint }) {
  const button = html('button', { type: 'button', title: `${hint} (${letter})`, 'data-tool': name });
  add(add(button, 'svg', { viewBox: '0 0 16 16' }), 'path', { d: icon, 'fill-rule': 'evenodd' });
  button.append(html('span', {}, words(name)));
  button.addEventListener('click', () => take(name));
  return button;
}

function ask(message) {
  by('said').hidden = true; // of what was asked for before
  if (held) held.push(message);
  else send(message);
}

/** Shows that something takes long, which is done elsewhere: the page goes on meanwhile. */
function busy(news) {
  by('busy').hidden = !news.busy;
}

/** Sends gestures one after the other, of those that wait the newest. */
function follow(message) {
  if (flying) waiting = message;
  else {
    flying = true;
    ask(message);
  }
}

function landed() {
  flying = false;
  if (!waiting) return;
  const next = waiting;
  waiting = null;
  follow(next);
}

// --- what is shown -------------------------------------------------------------------------

function show(news) {
  const other = !state || state.file !== news.file || state.name !== news.name;
  if (state?.number !== news.number) forget();
  else news.forces = state.forces;
  state = news;
  waiting = null;
  flying = false;
  canvas.stretch(null);
  by('hint').textContent = TOOLS.get(canvas.tool).hint;
  by('title').textContent = news.stage.title;
  document.title = `${news.changed ? '• ' : ''}${news.name}: editor`;
  if (document.activeElement !== by('file')) by('file').value = news.file || `${news.name}.yaml`;
  by('save').classList.toggle('changed', news.changed);
  by('undo').disabled = !news.undo;
  by('redo').disabled = !news.redo;
  if (document.activeElement !== by('text')) by('text').value = news.text;
  by('text').readOnly = false;
  draw(news);
  fields.show(news, news.stage.colours);
  by('quantity').replaceChildren(new Option(news.quantities.length ? 'choose …' : 'nothing moves', ''),
    ...news.quantities.map((name) => new Option(name, name, false, name === news.chart?.name)));
  chart(news.chart);
  if (other && fitted !== news.name) fit();
  fitted = news.name;
  tell();
  root.dataset.number = news.number;
}

function draw(news) {
  playing(false);
  shown = news;
  pressed = news.forces ?? null;
  canvas.show({ ...news.stage, ...(pressed ?? {}) }, { poses: news.poses, ...acting(0) });
  canvas.grips(news, news.stage.colours, state.path);
  document.body.dataset.assembled = news.assembled ? '1' : '';
}

/** Forces and where they act at an instant of a turn, as a stage wants them. */
const acting = (k) => (pressed ? { forces: pressed.forces[k], feet: pressed.feet[k] } : { forces: [] });

/** Forces of ideal joints over a turn, of the machine that is shown. */
function forces({ data, number }) {
  if (number !== state.number) return;
  state.forces = data;
  if (!canvas.playing) draw({ ...shown, forces: data });
}

/** What a run of what is dragged says. */
function problem({ data, number }) {
  if (number !== state.number) return;
  state.problem = data;
  tell();
}

/** A frame of a drag. */
function frame(news) {
  landed(); // the next is made while this one is drawn
  if (state.number !== news.number) {
    if (run || root.dataset.checked) forget();
    state.number = news.number;
  }
  if (news.forces === undefined) news.forces = pressed; // those of a frame before
  draw(news);
  chart(news.chart);
  Object.assign(state, { problem: news.problem, hint: news.hint });
  tell();
  root.dataset.frames = Number(root.dataset.frames ?? 0) + 1;
}

function pose({ poses, instant: k }) {
  landed();
  canvas.pose({ poses, ...acting(k) });
  if (curves) curves.drawn.show(curves.at[k]);
  root.dataset.poses = Number(root.dataset.poses ?? 0) + 1;
}

/** The quantity that is charted, over a turn; pale as it was before a drag. */
function chart(now) {
  by('curves').replaceChildren();
  curves = null;
  if (!now || by('chart').hidden) return;
  const run = ({ at, values }) => (at[0] > at.at(-1) ? { at: at.toReversed(), values: values.toReversed() } : { at, values });
  const alike = ['name', 'unit', 'along'].every((key) => state.chart?.[key] === now[key]);
  const before = alike ? state.chart : now;
  curves = { at: now.at, drawn: new Curves(by('curves'), { ...now, every: now.along.endsWith('[°]') ? 60 : 0, runs: [run(before), run(now)] }) };
  curves.drawn.choose(1);
  curves.drawn.show(now.at[0]);
  root.dataset.charted = now.name;
}

function fit() {
  const [left, bottom, right, top] = state.stage.bounds;
  const empty = state.handles.length === 0 && state.stage.shapes.length === 0;
  canvas.fit(empty ? BOUNDS : [left, bottom, right, top]);
}

function tell(text = '') {
  const { problem, hint } = state;
  by('state').classList.toggle('wrong', Boolean(problem) && !hint);
  by('state').classList.toggle('next', Boolean(problem && hint));
  by('state').textContent = (problem && hint) || problem || text || (run ? by('state').textContent : 'checking …');
  root.dataset.problem = problem;
}

function announce(text) {
  say(text);
  if (flying) {
    flying = false;
    waiting = null;
  }
}

// --- the run --------------------------------------------------------------------------------

function forget() {
  run = null;
  by('play').disabled = by('scrub').disabled = by('speed').disabled = true;
  by('time').textContent = '';
  by('run').replaceChildren();
  root.dataset.run = '';
  root.dataset.checked = '';
  root.dataset.worn = '';
}

function checked({ data, number }) {
  if (number !== state.number) return;
  const driven = Object.entries(data.coordinates).filter(([, what]) => /prescribed|moved|^free$/.test(what));
  tell([data.level, ...driven.map(([c, what]) => `${c} ${what}`)].join('; '));
  const list = (title, items) => (items.length
    ? [html('h3', {}, title), html('ul', {}, ...items.map((x) => html('li', {}, x)))] : []);
  by('run').replaceChildren(
    html('div', { id: 'length' }), html('div', { id: 'lenses' }),
    html('div', { id: 'figures' }, html('p', { class: 'soft' }, 'running …')),
    html('div', { id: 'wear' }), html('h3', {}, 'Model'), html('p', {}, `${data.level}: ${data.why}`),
    ...list('Questions', data.questions), ...list('What limits the motion', data.limits),
    ...list('Gaps', data.gaps),
    ...list('Notes', data.notes.filter((x) => !data.limits.includes(x))),
  );
  lengthOfRun.show(by('length'), state.length);
  wear.show(by('wear'), state.wears);
  root.dataset.checked = number;
}

/** Loads of the same run with a pin that has worn. */
function worn({ data, number }) {
  if (number !== state.number || !run) return;
  wear.compare(run.data.figures, data);
  if (!canvas.playing) by('time').textContent = `${Number(length().toPrecision(4))} s`; // not its progress
  root.dataset.worn = `${data.joint} ${data.radial}`;
}

function progress({ data }) {
  by('time').textContent = `running ${Math.round(100 * data)} %`;
}

function ran({ data, number }) {
  if (number !== state.number) return;
  const recording = new Recording(data);
  for (const shape of data.stage.shapes) shape.colour = state.stage.colours[shape.link] ?? -1;
  run = { recording, data, player: new Player(recording, instant) };
  by('play').disabled = by('scrub').disabled = by('speed').disabled = false;
  run.player.speed = nearest(SPEEDS, length() / TURN);
  by('speed').replaceChildren(...SPEEDS.map((x) => new Option(`${x}×`, x, false, x === run.player.speed)));
  by('time').textContent = `${Number(length().toPrecision(4))} s`;
  const titles = { force: 'Largest forces', drive: 'Largest efforts of drives', impacts: 'Impacts', hardest: 'Hardest impact' };
  const rows = data.figures.flatMap(([what, name, value, unit, t], k) => {
    const head = html('tr', {}, html('th', { colspan: 3 }, html('h3', {}, titles[what])));
    const shown = value === null ? 'without limit' : unit ? quantity(value, unit) : value;
    const at = t === null ? '' : `at ${quantity(Math.abs(t) < 1e-9 * data.end ? 0 : t, 's')}`;
    const row = html('tr', { 'data-figure': what }, html('th', {}, name || 'in all'),
      html('td', {}, shown), html('td', {}, at));
    return what === data.figures[k - 1]?.[0] ? [row] : [head, row];
  });
  by('figures')?.replaceChildren(
    html('table', {}, html('tbody', {}, ...rows)),
    html('p', { class: 'soft' }, `over ${quantity(data.end, 's')}; digest `,
      html('code', { title: data.digest }, `${data.digest.slice(0, 12)}…`)),
  );
  run.lenses = by('lenses') ? lenses(recording, data.stage) : [];
  if (Object.keys(shown.traced).length) canvas.trace(traces(recording, data.stage), shown.stage.colours);
  instant(recording.at(recording.start));
  wear.enable();
  lengthOfRun.tell(data.end);
  root.dataset.digest = data.digest;
  root.dataset.run = number;
}

/** What is loose, magnified: pins with their ways, and what parts from its wall. */
function lenses(recording, stage) {
  return [...stage.bearings, ...stage.plays].map(({ joint }) => {
    const host = html('div');
    by('lenses').append(host);
    return lensOf(host, stage, joint, (index, t) => recording.path(index, t, Infinity));
  });
}

/** Paths that only a run knows: of points of a machine that nothing drives, or not alone. */
function traces(recording, { links }) {
  const instants = Array.from({ length: 400 }, (_, i) => recording.at(recording.start + (i / 399) * length()));
  return Object.fromEntries(Object.entries(shown.traced).map(([key, [link, at]]) => {
    const i = links.indexOf(link);
    return [key, instants.map(({ poses: { [i]: pose } }) => carried(pose, at))];
  }));
}

const length = () => run.recording.end - run.recording.start || 1;

function instant(now) {
  if (!run) return;
  for (const lens of run.lenses ?? []) lens.show(now);
  if (!canvas.playing) return;
  canvas.pose(now);
  by('scrub').value = (now.t - run.recording.start) / length();
  by('time').textContent = `${now.t.toPrecision(4)} s`;
  showPlaying(run.player.playing);
  root.dataset.time = now.t;
}

/** Between the machine that is edited and the one that runs. */
function playing(on) {
  if (on === Boolean(canvas.playing) || (on && !run)) return;
  canvas.playing = on;
  if (on) {
    canvas.show(run.data.stage, run.recording.at(run.recording.start));
    canvas.choose(state.path);
  } else if (run) {
    run.player.playing = false;
    showPlaying(false);
  }
}

function toggle() {
  if (!run) return;
  if (!run.player.playing) playing(true);
  run.player.toggle();
}

// --- what is asked for ----------------------------------------------------------------------

function take(tool) {
  const { gesture: how, hint } = TOOLS.get(tool);
  Object.assign(canvas, { tool, bands: how === 'band', begun: null });
  canvas.stretch(null);
  if (how === 'now') {
    part(tool, { x: 0, y: 0 }, { x: 0, y: 0 });
    take('move');
    return;
  }
  for (const button of by('palette').querySelectorAll('button')) {
    button.setAttribute('aria-pressed', button.dataset.tool === tool);
  }
  by('over').dataset.tool = tool;
  by('over').dataset.gesture = how ?? '';
  by('hint').textContent = hint;
}

/** What the pointer does on the sheet. */
function gesture({ type, from, spot, handle, x, y }) {
  if (!state) return;
  const { tool } = canvas;
  const { gesture: how } = TOOLS.get(tool);
  const { step } = canvas;
  if (type === 'press' || type === 'cancel') {
    if (canvas.playing && type === 'press') back();
    if (type === 'cancel') {
      waiting = null;
      ask({ type: 'select', path: state.path }); // which shows the document as it is
    }
  } else if (type === 'nudge') ask({ type: 'drop', handle: handle.key, x, y, step });
  else if (tool === 'move' || tool === 'turn') {
    if (type === 'click') select(spot);
    else if (from.handle) {
      const move = { handle: from.handle, x: spot.x, y: spot.y, step };
      if (tool === 'turn') follow({ type: 'pull', ...move });
      else if (type === 'drag') follow({ type: 'drag', ...move });
      else {
        waiting = null;
        ask({ type: 'drop', ...move });
      }
    }
  } else if (tool === 'remove') {
    if (type === 'click' && path(spot)) ask({ type: 'remove', path: path(spot) });
  } else if (how === 'click' && (type === 'click' || type === 'drop')) {
    part(tool, from, spot);
  } else if (how === 'band') {
    if (type === 'drag') {
      const begin = from.grip?.at ?? [from.x, from.y];
      const end = spot.grip?.at ?? [spot.x, spot.y];
      canvas.stretch([begin, end], tool);
      by('hint').textContent = quantity(Math.hypot(end[0] - begin[0], end[1] - begin[1]), 'm');
    } else if (type === 'drop' || type === 'click') {
      part(tool, from, spot);
    }
  }
}

/** Draws a part. The number says what was seen: of what came since the session finds what is near. */
function part(what, from, to) {
  const plain = ({ x, y, number, handle, link }) => ({ x, y, number, handle, link });
  ask({ type: 'draw', what, step: canvas.step, near: canvas.near, from: plain(from), to: plain(to) });
}

/** Where the scene says what is under the pointer. */
function path({ grip, link, kind, label, mark }) {
  if (mark) return mark.path;
  if (grip) {
    const [owner, name] = grip.members[0].split('.');
    if (grip.joint) return grip.path;
    return ['start', 'end'].includes(name) ? ['links', owner] : ['links', owner, 'points', name];
  }
  if (kind === 'slider' && label) return ['joints', label];
  return link && state.outline.some(({ name, parts }) => name === 'links' && parts.some((p) => p[1] === link))
    ? ['links', link] : null;
}

function select(spot) {
  const found = path(spot);
  ask({ type: 'select', path: (found ?? []).slice(0, 2) });
  tab('parts');
}

/** From the run to the machine that is edited. */
function back() {
  draw(state);
}

/** Tells the text as far as it is typed. */
function tellText() {
  if (!typed) return;
  clearTimeout(typed);
  typed = 0;
  ask({ type: 'text', text: by('text').value });
  if (!held) state.changed = true;
}

/** Saves, with what is being typed: that comes first, and if it cannot be, nothing is saved. */
function save() {
  held = [];
  const field = document.activeElement.closest('#side :is(textarea, input:not([type=range], [type=checkbox]))');
  field?.dispatchEvent(new Event('change'));
  const [first] = held;
  held = null;
  ask({ type: 'save', name: by('file').value, first });
}

function open(name) {
  by('scenes').value = '';
  if (leaves()) ask({ type: 'open', name });
}

/** Whether the document may be left for another one. */
function leaves() {
  // eslint-disable-next-line no-alert
  if (state?.changed && !window.confirm('Your changes are not saved. Leave the page?')) return false;
  fitted = null;
  return true;
}

function tab(name) {
  for (const each of TABS) {
    by(each).hidden = each !== name;
    by(`tab-${each}`).setAttribute('aria-selected', each === name);
  }
  if (name === 'chart' && state) chart(state.chart);
}

function key(event) {
  const letter = event.key.toLowerCase();
  const typing = event.target.closest('input:not([type=range], [type=checkbox]), textarea, select');
  if (event.ctrlKey || event.metaKey) {
    const own = typing && (fields.typed || !by('fields').contains(typing)); // its undo is the browser's
    const acts = { s: save, ...(own ? {} : {
      z: () => ask({ type: event.shiftKey ? 'redo' : 'undo' }), y: () => ask({ type: 'redo' }) }) };
    if (!(letter in acts)) return;
    event.preventDefault();
    acts[letter]();
    return;
  }
  if (event.altKey || typing) return;
  const pressed = `${event.shiftKey ? 'Shift+' : ''}${letter.toUpperCase()}`;
  const tool = [...TOOLS.values()].find((each) => each.key === pressed);
  if (tool) take(tool.name);
  else if (pressed === 'F') fit();
  else if (event.key === 'Escape') {
    canvas.cancel();
    take('move');
    if (canvas.playing) back();
  } else if (['Delete', 'Backspace'].includes(event.key) && state.path.length) ask({ type: 'remove', path: state.path });
  else if (event.key === ' ' && !event.target.closest('button')) toggle();
  else return;
  event.preventDefault();
}
