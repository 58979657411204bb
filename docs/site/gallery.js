/* Plays the pictures of scenes that are in view; the data of each come when it does. */
import { Player, Recording } from 'player';
import { add } from 'svg';
import { Stage } from 'stage';

const TURN = 4; // of ours [s]
const WHOLE = 6; // of a run without turns [s]
const still = matchMedia('(prefers-reduced-motion: reduce)');
const cards = new Map();
const waiting = new Map();
let playing = !still.matches;

globalThis.moves = (scene, data) => waiting.get(scene)?.forEach((begin) => begin(data));

class Card {
  constructor(link) {
    this.link = link;
    this.scene = link.getAttribute('href').match(/([^/]+)\.html$/)[1];
    this.image = link.querySelector('img');
    link.title = `Open the report of ${this.scene}`;
    for (const kind of ['pointerenter', 'focus']) link.addEventListener(kind, () => this.over(true));
    for (const kind of ['pointerleave', 'blur']) link.addEventListener(kind, () => this.over(false));
  }

  over(over) {
    this.hovered = over;
    this.update();
  }

  see(seen) {
    this.seen = seen;
    this.update();
  }

  update() {
    const moves = this.hovered || (this.seen && playing);
    if (moves && !this.loading) this.#load();
    if (!this.player) return;
    if (moves) this.player.play();
    else if (this.player.playing) this.player.pause();
  }

  #load() {
    this.loading = true;
    const known = waiting.get(this.scene) ?? [];
    waiting.set(this.scene, [...known, (data) => this.#begin(data)]);
    if (known.length) return;
    const script = document.createElement('script');
    script.src = this.link.getAttribute('href').replace(/html$/, 'js');
    document.head.append(script);
  }

  #begin({ stage, frames, turn }) {
    const svg = add(this.link, 'svg');
    const recording = new Recording({ stage, frames, impacts: { t: [], hardest: 0 } });
    const shown = new Stage(svg, stage);
    svg.setAttribute('aria-label', this.image.alt);
    shown.layer('names', false);
    shown.layer('rule', false);
    shown.trace(recording.turn());
    this.image.remove();
    this.player = new Player(recording, (frame) => shown.show(frame));
    this.player.speed = turn ? turn / TURN : (recording.end - recording.start) / WHOLE;
    this.player.loop = [recording.start, recording.end];
    this.link.dataset.moves = '1';
    this.update();
  }
}

const watch = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) cards.get(target).see(isIntersecting);
}, { rootMargin: '80px' });
for (const link of document.querySelectorAll('a.plays')) {
  cards.set(link, new Card(link));
  watch.observe(link);
}

const button = document.createElement('button');
button.type = 'button';
button.className = 'motion';
const name = () => { button.textContent = playing ? 'Stop motion' : 'Play all'; };
button.addEventListener('click', () => {
  playing = !playing;
  name();
  for (const card of cards.values()) card.update();
});
name();
document.querySelector('article h1')?.after(button);
