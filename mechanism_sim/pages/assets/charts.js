import { bytes } from 'player';

/* global Plotly */

/** Loads plotly.js: the page holds it compressed, as most of itself, or says where it is. */
export async function loadPlotly() {
  const { textContent: packed, dataset: { from } } = document.getElementById('plotly');
  if (!packed && !from) return;
  const script = document.createElement('script');
  if (from) {
    script.src = from;
    document.head.append(script);
    await new Promise((done, failed) => Object.assign(script, { onload: done, onerror: failed }));
    return;
  }
  const unpacked = new Blob([bytes(packed)]).stream().pipeThrough(new DecompressionStream('gzip'));
  script.textContent = await new Response(unpacked).text();
  document.head.append(script);
}

const PAPER = 680; // [px] between the margins of a page
const CONFIG = { responsive: true, displaylogo: false };

/** The charts of a page: each is made when it comes into view, and all before printing. */
export class Charts {
  /**
   * @param {Object<string, {data: Object[], layout: Object}>} figures by key
   * @param {{seek: function(number): void, hover: function(number): void,
   *   light: function(?string[]): void, loop: function(?number[]): void}} acts goes to a time [s],
   *   shows one as long as nothing plays, lights what lines are of, plays an interval over and over
   * @param {Object<string, string>} dark colours on dark ground, by those on paper
   */
  constructor(figures, acts, dark) {
    this.figures = figures;
    this.acts = acts;
    this.colours = new RegExp(Object.keys(dark).join('|'), 'gi');
    this.dark = dark;
    this.night = matchMedia('(prefers-color-scheme: dark)');
    this.night.addEventListener('change', () => this.#again(this.night.matches));
    this.time = 0;
    this.drawn = new Map();
    this.places = [...document.querySelectorAll('figure.chart')];
    this.watch = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) if (isIntersecting) this.#draw(target);
    }, { rootMargin: '300px' });
    for (const place of this.places) this.watch.observe(place);
  }

  /** Draws all that are not yet there, as wide as paper; `screen` takes that back. */
  paper() {
    for (const place of this.places) this.#draw(place);
    if (this.night.matches) this.#again(false);
    for (const { plot, axis } of this.drawn.values()) {
      Plotly.relayout(plot, { autosize: false, width: axis === 'polar' ? PAPER / 2 - 16 : PAPER });
    }
  }

  /** As wide as there is room again. */
  screen() {
    if (this.night.matches) this.#again(true);
    for (const { plot } of this.drawn.values()) {
      Plotly.relayout(plot, { autosize: true, width: null });
    }
  }

  /** Lights the lines of a joint or link; of nothing all of them. @param {string} [name] */
  light(name) {
    for (const { plot } of this.drawn.values()) {
      for (const trace of plot._fullData) {
        const line = plot.querySelector(`.trace${trace.uid}`);
        if (line) line.style.opacity = !name || about(trace).includes(name) ? '' : 0.12;
      }
    }
  }

  /** Shows an interval [s] in all charts over time; without one all. @param {number[]} [span] */
  zoom(span) {
    for (const { plot, axis } of this.drawn.values()) {
      if (axis !== 'time') continue;
      this.zooming = true;
      Plotly.relayout(plot, span ? { 'xaxis.range': [...span] } : { 'xaxis.autorange': true })
        .then(() => { this.zooming = false; });
    }
  }

  /** As on paper, or on dark ground. */
  #figure(key, dark) {
    const { data, layout } = this.figures[key];
    if (!dark) return { data, layout };
    return JSON.parse(JSON.stringify({ data, layout })
      .replace(this.colours, (shade) => this.dark[shade.toLowerCase()]));
  }

  #again(dark) {
    for (const [key, { plot }] of this.drawn) {
      const { data, layout } = this.#figure(key, dark);
      Plotly.react(plot, data, { autosize: true, ...layout }, CONFIG);
    }
  }

  /** Moves the cursors of charts over time. @param {number} t [s] */
  cursor(t) {
    this.time = t;
    for (const chart of this.drawn.values()) this.#point(chart);
  }

  #draw(place) {
    const { chart: key, axis } = place.dataset;
    if (this.drawn.has(key)) return;
    this.watch.unobserve(place);
    const plot = place.querySelector('.plot');
    const { data, layout } = this.#figure(key, this.night.matches);
    const chart = { plot, axis, cursors: [] };
    this.drawn.set(key, chart);
    Plotly.newPlot(plot, data, { autosize: true, ...layout }, CONFIG);
    const when = (point) => (axis === 'time' ? point.x : point.customdata?.[0] ?? point.customdata);
    plot.on('plotly_click', ({ points: [point] }) => {
      if (Number.isFinite(when(point))) this.acts.seek(when(point));
    });
    plot.on('plotly_hover', ({ points: [point] }) => {
      if (Number.isFinite(when(point))) this.acts.hover(when(point));
      this.acts.light(about(point.fullData));
    });
    plot.on('plotly_unhover', () => this.acts.light(null));
    if (axis !== 'time') return;
    plot.on('plotly_relayout', (change) => {
      if (this.zooming) return;
      const span = change['xaxis.range'] ?? [change['xaxis.range[0]'], change['xaxis.range[1]']];
      if (span.every(Number.isFinite)) this.acts.loop(span);
      else if (change['xaxis.autorange']) this.acts.loop(null);
    });
    chart.axes = Object.keys(plot._fullLayout._plots)
      .map((name) => plot._fullLayout._plots[name]);
    chart.cursors = chart.axes.map(() => {
      const cursor = document.createElement('div');
      cursor.className = 'cursor';
      plot.append(cursor);
      return cursor;
    });
    plot.on('plotly_relayout', () => this.#point(chart));
    plot.on('plotly_afterplot', () => this.#point(chart));
    this.#point(chart);
  }

  // Where an axis lies is not part of plotly's interface, but to redraw a chart for every picture
  // of the machine is too slow.
  #point({ plot, cursors, axes }) {
    cursors.forEach((cursor, i) => {
      const { xaxis, yaxis } = plot._fullLayout._plots[axes[i].id] ?? axes[i];
      const x = xaxis.l2p(this.time);
      const seen = x >= 0 && x <= xaxis._length;
      cursor.style.display = seen ? '' : 'none';
      cursor.style.transform = `translateX(${xaxis._offset + x}px)`;
      cursor.style.top = `${yaxis._offset}px`;
      cursor.style.height = `${yaxis._length}px`;
    });
  }
}

/** The joints and links that a line is of: parts of its quantity's name, and its own. */
const about = ({ legendgroup, name }) => [...(legendgroup ?? '').split(/[. ]/), name ?? ''];
