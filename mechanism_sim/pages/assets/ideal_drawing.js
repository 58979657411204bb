/** Drawings of machines whose dimensions change, as `Stage` takes them. */

const SPARE = 2.5; // symbols of a rail beyond what slides on it, and of room around a drawing
const LEAST = 18; // half of a drawing's width at least, in symbols
const UNIT = 10; // of paths in a symbol
const AROUND = 24;

/** The convex polygon around points, counterclockwise. @param {number[][]} points */
export function hull(points) {
  const sorted = [...points].sort(([a, b], [c, d]) => a - c || b - d);
  const half = (all) => {
    const found = [];
    for (const p of all) {
      while (found.length > 1 && turn(found.at(-2), found.at(-1), p) <= 0) found.pop();
      found.push(p);
    }
    return found.slice(0, -1);
  };
  return sorted.length < 2 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}

const turn = ([ax, ay], [bx, by], [cx, cy]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);

const pairs = (flat) => Array.from({ length: flat.length / 2 }, (_, i) => [flat[2 * i], flat[2 * i + 1]]);

/** The edge of the plate that reaches so far around all points. */
function rounded(points, radius) {
  return hull(points.flatMap(([x, y]) => Array.from({ length: AROUND }, (_, k) => [
    x + radius * Math.cos((2 * Math.PI * k) / AROUND), y + radius * Math.sin((2 * Math.PI * k) / AROUND)])));
}

/** A point of the world in the frame of a link. */
function within([x, y, angle], [px, py]) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c * (px - x) + s * (py - y), c * (py - y) - s * (px - x)];
}

/** Where a point of a link is. */
function placed([x, y, angle], [px, py]) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [x + c * px - s * py, y + s * px + c * py];
}

/**
 * A machine as it can be drawn.
 * @param {Object} stage what does not change @param {import('ideal_motion').IdealMotion} motion
 * @param {Object[]} places along its way
 */
export function drawing(stage, motion, places) {
  const numbers = new Map(stage.links.map((link, i) => [link, i]));
  const pose = (place, link) => (numbers.has(link) ? place.poses[numbers.get(link)] : [0, 0, 0]);
  const { symbol } = stage;
  const guides = Object.fromEntries(Object.entries(stage.rails).map(([i, { link, runner }]) => {
    const [x, y, c, s, ...at] = motion.dimension(`rail:${i}`);
    const along = places.map((place) => {
      const [px, py] = within(pose(place, link), placed(pose(place, runner), at));
      return c * (px - x) + s * (py - y);
    });
    const [low, high] = [Math.min(...along) - SPARE * symbol, Math.max(...along) + SPARE * symbol];
    return [i, { link, ends: [low, high].map((far) => [x + far * c, y + far * s]) }];
  }));
  const points = [];
  const shapes = stage.shapes.map((shape, i) => {
    const { outline, paths } = shapeOf(shape, i, motion, guides, stage);
    const around = hull(paths.flatMap(([, curves]) => curves.flat()).concat(paths.length ? [] : outline));
    const every = numbers.has(shape.link) ? places : places.slice(0, 1);
    for (const place of every) points.push(...around.map((p) => placed(pose(place, shape.link), p)));
    return { ...shape, outline,
      paths: paths.map(([style, curves]) => [style, curves.map((curve) => curve.flat().map((x) => (UNIT * x) / symbol))]) };
  });
  return {
    ...stage,
    shapes,
    bounds: bounds(points, symbol),
    springs: stage.springs.map((links, i) => zipped(links, motion.dimension(`spring:${i}`), 2)),
    ropes: stage.ropes.map((links, i) => zipped(links, motion.dimension(`rope:${i}`), 3)),
    bendings: {}, joints: [], bearings: [], plays: [], frames: [], force: 0, force_scale: 0,
  };
}

const zipped = (links, flat, size) => links.map((link, k) => {
  const [x, y, ...more] = flat.slice(size * k, size * (k + 1));
  return [link, [x, y], ...more];
});

/** Left, bottom, right and top of a drawing of points. */
function bounds(points, symbol) {
  const sides = [0, 1].map((axis) => {
    const [low, high] = points.reduce(([least, most], p) => [Math.min(least, p[axis]), Math.max(most, p[axis])],
      [Infinity, -Infinity]);
    const half = Math.max(0.5 * (high - low) + SPARE * symbol, LEAST * symbol);
    return [0.5 * (low + high) - half, 0.5 * (low + high) + half];
  });
  return [sides[0][0], sides[1][0], sides[0][1], sides[1][1]];
}

/** Outline and paths [m] of a shape in the frame of its link. */
function shapeOf(shape, i, motion, guides, { symbol, sizes, links }) {
  const outline = pairs(motion.dimension(`outline:${i}`));
  if (guides[i]) {
    const { ends } = guides[i];
    const thick = (far) => rounded(ends, far * symbol);
    if (shape.kind === 'slot') {
      const [inner, outer] = [thick(sizes.slot), thick(sizes.slot + 0.35)];
      return { outline: ends, paths: [['body', [outer, [...inner].reverse()]], ['paper', [inner]]] };
    }
    return { outline: ends, paths: links.includes(shape.link) ? [['body', [thick(0.6 * sizes.bar)]]] : fixed(ends, symbol) };
  }
  if (shape.joined) {
    const corners = pairs(motion.dimension(`corners:${shape.link}`));
    for (const { link, ends } of Object.values(guides)) if (link === shape.link) corners.push(nearest(ends, corners));
    const around = hull(corners);
    return { outline: around, paths: [[isBar(around, symbol) ? 'body' : 'plate', [rounded(corners, sizes.bar * symbol)]]] };
  }
  const flat = motion.dimension(`shape:${i}`);
  return { outline,
    paths: shape.paths.map(([style, curves]) => [style, curves.map((curve) => curve.map((k) => [flat[2 * k], flat[2 * k + 1]]))]) };
}

/** Whether all corners lie on one line, or nearly so. */
function isBar(corners, symbol) {
  return corners.length < 3 || corners.some((a, i) => {
    const b = corners[(i + 1) % corners.length];
    const far = Math.hypot(b[0] - a[0], b[1] - a[1]);
    return far > symbol && corners.every((c) => turn(a, b, c) < symbol * far);
  });
}

/** The point of a line that is nearest to the middle of others. */
function nearest([[x, y], [u, v]], others) {
  const middle = [0, 1].map((axis) => (others.length
    ? others.reduce((sum, p) => sum + p[axis], 0) / others.length : 0.5 * ([x, y][axis] + [u, v][axis])));
  const [dx, dy] = [u - x, v - y];
  const share = ((middle[0] - x) * dx + (middle[1] - y) * dy) / (dx * dx + dy * dy);
  const on = Math.min(Math.max(share, 0), 1);
  return [x + on * dx, y + on * dy];
}

/** A guide of the frame: a line, hatched below where nothing slides. */
function fixed([start, end], s) {
  const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
  const [ux, uy] = [(end[0] - start[0]) / length, (end[1] - start[1]) / length];
  const side = -ux > 1e-9 ? -1 : 1;
  const [bx, by] = [side * uy, -side * ux];
  const foot = [start, end].map(([x, y]) => [x + 1.1 * s * bx, y + 1.1 * s * by]);
  const strokes = [];
  for (let far = 0.75 * s; far < length; far += 0.8 * s) {
    const [x, y] = [foot[0][0] + far * ux, foot[0][1] + far * uy];
    strokes.push([[x, y], [x + 0.7 * s * (bx - ux), y + 0.7 * s * (by - uy)]]);
  }
  return [['line', [[start, end]]], ['line', [foot]], ['thin', strokes]];
}
