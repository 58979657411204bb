const MOST = 40; // times
const STEP = 0.0015; // of a wheel, in the logarithm of the size

/**
 * Lets a drawing be enlarged by the wheel or two fingers and moved by dragging; a double click
 * shows all again.
 * @param {SVGSVGElement} svg
 * @param {function(): import('stage').Stage[]} stages that are drawn in it, and those that follow
 */
export function zoomable(svg, stages) {
  const fingers = new Map();
  const show = (left, top, times) => {
    const [{ all }] = stages();
    const [w, h] = [all[2] / times, all[3] / times];
    const inside = (x, most) => Math.min(Math.max(x, 0), most);
    const box = times > 1 ? [inside(left, all[2] - w), inside(top, all[3] - h), w, h] : all;
    for (const stage of stages()) stage.look(box);
  };
  const place = (x, y) => {
    const { a, d, e, f } = svg.getScreenCTM();
    return [(x - e) / a, (y - f) / d];
  };
  const enlarge = (x, y, by) => {
    const [{ all, box } = {}] = stages();
    if (!all) return;
    const [px, py] = place(x, y);
    const times = Math.min(MOST, Math.max(1, (all[2] / box[2]) * by));
    const share = all[2] / times / box[2];
    show(px - share * (px - box[0]), py - share * (py - box[1]), times);
  };
  svg.addEventListener('wheel', (event) => {
    event.preventDefault();
    const lines = event.deltaMode ? 16 : 1;
    enlarge(event.clientX, event.clientY, Math.exp(-STEP * lines * event.deltaY * (event.ctrlKey ? 6 : 1)));
  }, { passive: false });
  svg.addEventListener('dblclick', () => { if (stages().length) show(0, 0, 1); });
  svg.addEventListener('pointerdown', (event) => {
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (svg.classList.contains('zoomed')) svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    fingers.set(event.pointerId, now);
    if (fingers.size === 2) {
      const [[x, y]] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const far = ([px, py]) => Math.hypot(px - x, py - y) || 1;
      enlarge(0.5 * (now[0] + x), 0.5 * (now[1] + y), far(now) / far(before));
    } else if (svg.classList.contains('zoomed')) {
      const [{ all, box }] = stages();
      const scale = svg.getScreenCTM().a;
      show(box[0] - (now[0] - before[0]) / scale, box[1] - (now[1] - before[1]) / scale, all[2] / box[2]);
    }
  });
  for (const kind of ['pointerup', 'pointercancel']) {
    svg.addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
  }
}
