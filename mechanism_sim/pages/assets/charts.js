import { html } from 'html';
import { bytes, unpack } from 'player';
import { save, table } from 'saving';

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
const NARROW = 520; // [px] of a chart whose panels are above each other
const SCALE = 2; // pixels of a picture to one of the screen
const DIGITS = { f4: 8, f8: 15 }; // significant, of numbers as they come to the page

/**
 * All buttons over a chart: these and no others, whatever a version of plotly.js adds to its own;
 * some versions offer to upload the chart.
 */
const buttons = (save) => ({
  responsive: true,
  displaylogo: false,
  showSendToCloud: false,
  plotlyServerURL: '',
  modeBarButtons: [
    ['png', 'svg', 'csv'].map((format) => ({
      name: format,
      title: `Save as ${format.toUpperCase()}`,
      icon: { svg: `<svg xmlns="http://www.w3.org/2000/svg" class="icon format" viewBox="0 0 30 16"><text x="15" y="12.5">${format.toUpperCase()}</text></svg>` },
      click: () => save(format),
    })),
    ['zoom2d', 'pan2d', 'resetScale2d'],
  ],
});

/** The charts of a page: each is made when it comes into view, and all before printing. */
export class Charts {
  /**
   * @param {Object<string, {data: Object[], layout: Object, columns: Object}>} figures by key
   * @param {{seek: function(number): void, hover: function(number): void,
   *   light: function(?string[]): void, loop: function(?number[]): void,
   *   pick: function(number, number): void}} acts goes to a time [s], shows one as long as nothing
   *   plays, lights what lines are of, plays an interval over and over, chooses a run
   * @param {Object<string, string>} dark colours on dark ground, by those on paper
   * @param {string} scene with whose name files begin
   */
  constructor(figures, acts, dark, scene) {
    this.figures = figures;
    this.scene = scene;
    this.acts = acts;
    this.colours = new RegExp(Object.keys(dark).join('|'), 'gi');
    this.dark = dark;
    this.night = matchMedia('(prefers-color-scheme: dark)');
    this.night.addEventListener('change', () => this.#again(this.night.matches));
    addEventListener('resize', () => matchMedia('print').matches || this.#again(this.night.matches));
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

  /** As on paper, or on dark ground; panels above each other where it is narrow. */
  #figure(key, dark, narrow = false) {
    const { data, narrow: changed, layout: whole } = this.figures[key];
    const layout = narrow ? { ...whole, ...changed } : whole;
    if (!dark) return { data, layout };
    return JSON.parse(JSON.stringify({ data, layout })
      .replace(this.colours, (shade) => this.dark[shade.toLowerCase()]));
  }

  #again(dark) {
    for (const [key, chart] of this.drawn) this.#show(key, chart, dark);
  }

  #show(key, chart, dark) {
    const { plot, config } = chart;
    const narrow = plot.clientWidth < NARROW;
    if (chart.dark === dark && chart.narrow === narrow) return;
    Object.assign(chart, { dark, narrow });
    const { data, layout } = this.#figure(key, dark, narrow);
    plot.style.height = `${layout.height}px`;
    Plotly.react(plot, data, { autosize: true, ...layout }, config);
  }

  /** Saves a chart, as far as it is zoomed: as a picture on paper, or its numbers. */
  async #save(key, format) {
    const name = `${this.scene}_${key}.${format}`;
    const { plot, narrow } = this.drawn.get(key);
    if (format === 'csv') {
      save(table(this.#columns(key)), name);
      return;
    }
    const { data, layout } = this.#figure(key, false, narrow);
    const zoomed = Object.fromEntries(Object.entries(plot.layout)
      .filter(([axis, { range }]) => /^[xy]axis/.test(axis) && range)
      .map(([axis, { range, autorange }]) => [axis, { ...layout[axis], range, autorange }]));
    const shown = data.map((trace, i) => ({ ...trace, visible: plot.data[i].visible ?? true }));
    const { width, height } = plot._fullLayout;
    const paper = { ...layout, ...zoomed, width, height, paper_bgcolor: '#ffffff' };
    const address = await Plotly.toImage(
      { data: shown, layout: paper },
      { format, width, height, scale: SCALE, imageDataOnly: false },
    );
    save(contents(address), name);
  }

  /** The numbers of the curves; those of one place in a row share a column along x. */
  #columns(key) {
    const { data, layout, columns } = this.figures[key];
    const found = [];
    let last = null;
    for (const { trace, x: along, y: across } of columns) {
      const { x, y, theta, r, xaxis, yaxis, hovertext } = data[trace];
      const places = x ?? theta;
      const [first, second] = [[x ?? theta, xaxis], [y ?? r, yaxis]].map(([values, axis]) => (
        numbers(values, layout[axis && `${axis[0]}axis${axis.slice(1)}`])));
      if (places.bdata !== last?.bdata || !last?.bdata || found.at(-1).along !== along) {
        found.push({ along, column: [along, first] });
      }
      found.push({ along, column: [across, second] });
      if (hovertext) found.push({ along, column: ['note', hovertext] });
      last = places;
    }
    return found.map(({ column }) => column);
  }

  /** Moves the cursors of charts over time. @param {number} t [s] */
  cursor(t) {
    this.time = t;
    for (const chart of this.drawn.values()) this.#point(chart);
  }

  /** Moves the cursors of charts over the value of a family. @param {number} [value] */
  place(value) {
    this.value = value;
    for (const chart of this.drawn.values()) this.#point(chart);
  }

  #draw(place) {
    const { chart: key, axis } = place.dataset;
    if (this.drawn.has(key)) return;
    this.watch.unobserve(place);
    const plot = place.querySelector('.plot');
    const config = buttons((format) => this.#save(key, format));
    const chart = { plot, axis, config, cursors: [] };
    this.drawn.set(key, chart);
    this.#show(key, chart, this.night.matches);
    const when = (point) => (axis === 'time' ? point.x : point.customdata?.[0] ?? point.customdata);
    plot.on('plotly_click', ({ points: [point] }) => {
      if (axis === 'value') this.acts.pick(point.x, point.y);
      if (Number.isFinite(when(point))) this.acts.seek(when(point));
    });
    plot.on('plotly_hover', ({ points: [point] }) => {
      if (Number.isFinite(when(point))) this.acts.hover(when(point));
      this.acts.light(about(point.fullData));
    });
    plot.on('plotly_unhover', () => this.acts.light(null));
    plot.on('plotly_afterplot', () => reachable(plot));
    plot.addEventListener('keydown', ({ key: pressed, target }) => {
      if (pressed !== 'Enter' || !target.matches('.legendtoggle')) return;
      for (const kind of ['mousedown', 'mouseup']) target.dispatchEvent(new MouseEvent(kind));
    });
    reachable(plot);
    if (axis !== 'time' && axis !== 'value') return;
    plot.on('plotly_relayout', (change) => {
      if (this.zooming || axis === 'value') return;
      const span = change['xaxis.range'] ?? [change['xaxis.range[0]'], change['xaxis.range[1]']];
      if (span.every(Number.isFinite)) this.acts.loop(span);
      else if (change['xaxis.autorange']) this.acts.loop(null);
    });
    chart.axes = Object.keys(plot._fullLayout._plots)
      .map((name) => plot._fullLayout._plots[name]);
    chart.cursors = chart.axes.map(() => {
      const cursor = html('div', { class: 'cursor' });
      plot.append(cursor);
      return cursor;
    });
    plot.on('plotly_relayout', () => this.#point(chart));
    plot.on('plotly_afterplot', () => this.#point(chart));
    this.#point(chart);
  }

  // Where an axis lies is not part of plotly's interface, but to redraw a chart for every picture
  // of the machine is too slow.
  #point({ plot, cursors, axes, axis }) {
    cursors.forEach((cursor, i) => {
      const { xaxis, yaxis } = plot._fullLayout._plots[axes[i].id] ?? axes[i];
      const x = xaxis.l2p(axis === 'time' ? this.time : this.value);
      const seen = x >= 0 && x <= xaxis._length;
      cursor.style.display = seen ? '' : 'none';
      cursor.style.transform = `translateX(${xaxis._offset + x}px)`;
      cursor.style.top = `${yaxis._offset}px`;
      cursor.style.height = `${yaxis._length}px`;
    });
  }
}

/** Lets the keyboard go to entries of legends, which Enter switches as a click does. */
function reachable(plot) {
  for (const entry of plot.querySelectorAll('.legendtoggle')) {
    const { name, visible } = entry.__data__[0].trace;
    const told = { tabindex: 0, role: 'button', 'aria-label': name, 'aria-pressed': visible === true };
    for (const [key, value] of Object.entries(told)) entry.setAttribute(key, value);
  }
}

/** The joints and links that a line is of: parts of its quantity's name, and its own. */
const about = ({ legendgroup, name }) => [...(legendgroup ?? '').split('.'), ...(name ?? '').split(/[. ]/)];

/** Values of a packed array, or the names that an axis gives them. */
function numbers(packed, axis) {
  if (!packed.dtype) return packed;
  const names = new Map((axis?.ticktext ?? []).map((name, i) => [axis.tickvals[i], name]));
  return Array.from(unpack(packed), (x) => (
    names.get(x) ?? Number(x.toPrecision(DIGITS[packed.dtype] ?? 15))));
}

/** What an address that begins with data: stands for. */
function contents(address) {
  const [, type, coding, data] = address.match(/^data:([^;,]*)(?:;charset=[^;,]*)?(;base64)?,(.*)$/s);
  return new Blob([coding ? bytes(data) : decodeURIComponent(data)], { type });
}
