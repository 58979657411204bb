import { bytes } from 'player';

/* global Plotly */

/** Unpacks plotly.js, which the page holds compressed: it is most of it. */
export async function loadPlotly() {
  const packed = document.getElementById('plotly').textContent;
  if (!packed) return;
  const unpacked = new Blob([bytes(packed)]).stream().pipeThrough(new DecompressionStream('gzip'));
  const script = document.createElement('script');
  script.textContent = await new Response(unpacked).text();
  document.head.append(script);
}

const PAPER = 680; // [px] between the margins of a page
const CONFIG = { responsive: true, displaylogo: false };

/** The charts of a page: each is made when it comes into view, and all before printing. */
export class Charts {
  /**
   * @param {Object<string, {data: Object[], layout: Object}>} figures by key
   * @param {function(number): void} seek goes to a time [s]
   */
  constructor(figures, seek) {
    this.figures = figures;
    this.seek = seek;
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
    for (const { plot, axis } of this.drawn.values()) {
      Plotly.relayout(plot, { autosize: false, width: axis === 'polar' ? PAPER / 2 - 16 : PAPER });
    }
  }

  /** As wide as there is room again. */
  screen() {
    for (const { plot } of this.drawn.values()) {
      Plotly.relayout(plot, { autosize: true, width: null });
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
    const { data, layout } = this.figures[key];
    const chart = { plot, axis, cursors: [] };
    this.drawn.set(key, chart);
    Plotly.newPlot(plot, data, { autosize: true, ...layout }, CONFIG);
    plot.on('plotly_click', ({ points: [point] }) => {
      const t = axis === 'time' ? point.x : point.customdata?.[0] ?? point.customdata;
      if (Number.isFinite(t)) this.seek(t);
    });
    if (axis !== 'time') return;
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
