/* A bearing that wears: the slider chooses a clearance; what is seen, heard and measured follows. */
import { keys } from 'keys';
import { lensOf } from 'lens';
import { Player, Recording } from 'player';
import { add, line } from 'svg';
import { Stage } from 'stage';

const TURN = 12; // of ours [s]: slow enough to see the pin bounce
const ROOM = { left: 46, right: 10, top: 24, bottom: 32 };
const FIGURES = [['impacts', 'impacts per turn', ''], ['impulse', 'impulse per turn', ' mN s'],
  ['rms', 'RMS', ' m/s²'], ['peak', 'peak', ' m/s²'], ['kurtosis', 'kurtosis', '']];

const by = (id) => document.getElementById(id);
const { runs, joint, turn } = JSON.parse(by('data').textContent);
const seen = runs.map((run) => ({ ...run, recording: new Recording(run) }));
const audio = new Audio();
audio.loop = true;
let [shown, player] = [null, null];

/** Spectra of all runs on one sheet: the chosen one in colour. */
function spectra() {
  const svg = by('spectrum');
  const [WIDE, HIGH] = [Math.min(svg.clientWidth || 680, 1000), 210]; // letters keep their size
  const all = runs.flatMap((run) => run.spectrum);
  const [low, high] = [Math.min, Math.max].map((f) => f(...all.map(([, level]) => level)));
  const last = Math.max(...all.map(([f]) => f));
  const x = (f) => ROOM.left + (f / last) * (WIDE - ROOM.left - ROOM.right);
  const y = (level) => HIGH - ROOM.bottom - ((level - low) / (high - low)) * (HIGH - ROOM.top - ROOM.bottom);
  svg.setAttribute('viewBox', `0 0 ${WIDE} ${HIGH}`);
  svg.setAttribute('role', 'img');
  svg.setAttribute('aria-label', 'Power spectral density of the accelerometer for each clearance');
  add(svg, 'text', { x: 2, y: 13 }).textContent = 'accelerometer: power density [dB re 1 (m/s²)²/Hz]';
  for (let level = 20 * Math.ceil(low / 20); level <= high; level += 20) {
    add(svg, 'path', { class: 'grid', d: line([[ROOM.left, y(level)], [WIDE - ROOM.right, y(level)]]) });
    add(svg, 'text', { class: 'end', x: ROOM.left - 6, y: y(level) + 4 }).textContent = level;
  }
  for (let f = 0; f <= last; f += WIDE < 500 ? 2000 : 1000) {
    add(svg, 'text', { class: f < last - 500 ? 'mid' : 'end', x: x(f), y: HIGH - ROOM.bottom + 16 }).textContent = f;
  }
  add(svg, 'text', { class: 'mid', x: 0.5 * WIDE, y: HIGH - 2 }).textContent = 'frequency [Hz]';
  return runs.map((run) => add(svg, 'path', {
    class: 'curve', d: line(run.spectrum.map(([f, level]) => [x(f), y(level)])),
  }));
}

const curves = spectra();

function choose(index) {
  const run = seen[index];
  const at = player ? player.time : run.recording.start;
  const playing = player ? player.playing : !matchMedia('(prefers-reduced-motion: reduce)').matches;
  if (player) player.pause();
  by('stage').replaceChildren();
  const stage = new Stage(by('stage'), run.stage);
  stage.layer('names', false);
  const lens = lensOf(by('lens'), run.stage, joint, (k, t) => run.recording.path(k, t, Infinity));
  player = new Player(run.recording, (frame) => { stage.show(frame); lens.show(frame); });
  player.speed = turn / TURN;
  player.loop = [run.recording.start, run.recording.end];
  player.seek(at);
  if (playing) player.play();
  by('play').textContent = playing ? 'Pause' : 'Play';
  curves.forEach((curve, k) => curve.classList.toggle('chosen', k === index));
  curves.at(-1).parentNode.append(curves[index]);
  by('value').textContent = `${1000 * run.radial} µm`;
  by('radius').setAttribute('aria-valuetext', by('value').textContent);
  by('figures').innerHTML = FIGURES.map(([key, words, unit]) => `<div><dt>${words}</dt><dd>${
    Number(run.figures[key].toPrecision(3))}${unit}</dd></div>`).join('');
  if (shown !== index) hear(index);
  shown = index;
  document.documentElement.dataset.radial = run.radial;
}

/** The sound of this run goes on where that of the other was. */
function hear(index) {
  const [now, on] = [audio.currentTime, !audio.paused];
  audio.src = `data:audio/wav;base64,${seen[index].sound}`;
  audio.currentTime = now;
  if (on) audio.play();
}

function toggle() {
  player.toggle();
  by('play').textContent = player.playing ? 'Pause' : 'Play';
}

by('radius').max = seen.length - 1;
by('radius').addEventListener('input', () => choose(Number(by('radius').value)));
by('play').addEventListener('click', toggle);
by('listen').addEventListener('click', () => {
  if (audio.paused) audio.play();
  else audio.pause();
  by('listen').textContent = audio.paused ? 'Listen' : 'Silence';
  by('listen').setAttribute('aria-pressed', String(!audio.paused));
});
keys({ ' ': toggle });
choose(0);
document.documentElement.dataset.ready = '1';
