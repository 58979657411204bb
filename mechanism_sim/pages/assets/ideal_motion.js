/** Ideal motion of a machine in the page: its loops closed by Newton's method, without a server. */

const STEPS = 360; // of the way of the drive
const SMALLEST = 1e-9; // step, as part of that way: what does not go so far is a limit
const STRAY = 0.3; // of a step, by which it may miss where it points: else it left its branch
const ROUNDING = 1e-11; // of the reach, by which a closed loop is open at most
const TRIES = 24; // positions of the drive from which dimensions are changed
const TURNS = 12; // of the drive, after which a machine is where it was, or is not looked for

/** Solves A x = b by elimination with pivots; null where A is singular. */
export function solve(A, b) {
  const n = b.length;
  const rows = A.map((row, i) => [...row, b[i]]);
  let sign = 1;
  for (let k = 0; k < n; k += 1) {
    let best = k;
    for (let i = k + 1; i < n; i += 1) if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
    if (!(Math.abs(rows[best][k]) > 0)) return null;
    if (best !== k) {
      [rows[k], rows[best]] = [rows[best], rows[k]];
      sign = -sign;
    }
    if (rows[k][k] < 0) sign = -sign;
    for (let i = k + 1; i < n; i += 1) {
      const factor = rows[i][k] / rows[k][k];
      if (factor) for (let j = k; j <= n; j += 1) rows[i][j] -= factor * rows[k][j];
    }
  }
  const x = new Array(n);
  for (let i = n - 1; i >= 0; i -= 1) {
    let sum = rows[i][n];
    for (let j = i + 1; j < n; j += 1) sum -= rows[i][j] * x[j];
    x[i] = sum / rows[i][i];
  }
  x.sign = sign; // of the determinant
  return x;
}

/**
 * @typedef {Object} Place the machine at one position of its drive
 * @property {number} u of the drive [rad, m], or time [s] with several drives
 * @property {number[]} q coordinates, @property {number[]} v, a their derivatives by time
 * @property {number[][]} poses x, y, angle of each moving link, then six numbers of rates
 */

/** A machine whose dimensions may change. */
export class IdealMotion {
  /** @param {Object} data of the page @param {Object} equations its generated module */
  constructor(data, equations) {
    this.data = data;
    this.equations = equations;
    this.n = data.coordinates.length;
    this.r = data.sought.length;
    this.values = Object.fromEntries(data.sliders.map(({ path, si }) => [path, si]));
    this.speed = data.speed;
    this.par = this.parameters(this.values);
    this.trail = this.#follow({ u: data.start, q: data.q });
    this.base = { par: this.par, trail: this.trail };
  }

  /** One of the dimensions, at the values of sliders. @returns {number[]} */
  dimension(name, values = this.values) {
    const own = this.data.dimensions[name] ?? [];
    let found = own;
    for (const { path, si, change } of this.data.sliders) {
      const slope = change[name];
      const off = values[path] - si;
      if (!slope || !off) continue;
      if (found === own) found = own.length ? [...own] : new Array(slope.length).fill(0);
      for (let i = 0; i < slope.length; i += 1) found[i] += off * slope[i];
    }
    return found;
  }

  parameters(values) {
    return this.data.parameters.map((name) => this.dimension(`par:${name}`, values)[0] ?? 0);
  }

  /**
   * Takes other values of the sliders. From positions of the machine as it was, dimensions are
   * changed little by little, so that it is put together the same way.
   * @param {Object<string, number>} values @returns {boolean} whether its loops can be closed
   */
  change(values) {
    const par = this.parameters(values);
    // what does not come from the scene's own values may still come from those before
    for (const known of [this.base, { par: this.par, trail: this.trail }]) {
      const { trail } = known;
      const begun = Math.max(0, trail.findIndex(({ u }) => u === this.data.start));
      const apart = Math.max(1, Math.round(trail.length / TRIES));
      for (let k = 0; k < trail.length; k += apart) {
        const place = trail[(begun + k) % trail.length];
        const q = this.#deformed(place.q, known.par, par);
        if (!q) continue;
        this.values = values;
        this.par = par;
        this.trail = this.#follow({ u: place.u, q });
        return true;
      }
    }
    return false;
  }

  /** The driven coordinates with two derivatives by u. */
  #held(u) {
    if (!this.data.laws.length) return [[u, 1, 0]];
    return this.data.laws.map((pieces) => {
      const [from, powers] = pieces.findLast(([at]) => at <= u) ?? pieces[0];
      const found = [0, 0, 0];
      for (let k = powers.length - 1; k >= 0; k -= 1) {
        found[2] = found[2] * (u - from) + 2 * found[1];
        found[1] = found[1] * (u - from) + found[0];
        found[0] = found[0] * (u - from) + powers[k];
      }
      return found;
    });
  }

  /** Closures and their Jacobian, split into sought columns and held ones. */
  #rows(q, par) {
    const { n, r, equations, data } = this;
    const found = equations.closure(q, par);
    const at = (i, j) => found[r + i * n + j];
    const each = Array.from({ length: r }, (_, i) => i);
    return {
      off: found.slice(0, r),
      sought: each.map((i) => data.sought.map((j) => at(i, j))),
      held: each.map((i) => data.held.map((j) => at(i, j))),
    };
  }

  /** Coordinates near a guess that close all loops; null if there are none. */
  close(guess, par = this.par) {
    const { data, r } = this;
    const q = [...guess];
    if (!r) return q;
    let sign = 0;
    for (let k = 0; k < 40; k += 1) {
      const rows = this.#rows(q, par);
      const step = solve(rows.sought, rows.off.map((x) => -x));
      if (!step) return null;
      ({ sign } = step);
      const reach = Math.max(...step.map((x, i) => Math.abs(x) / data.scale[data.sought[i]]));
      if (!(reach < 1e6)) return null;
      const share = Math.min(1, 0.5 / reach); // a larger step would leave its branch
      step.forEach((x, i) => { q[data.sought[i]] += share * x; });
      if (reach <= 1e-9) break;
    }
    const open = Math.max(...this.equations.closure(q, par).slice(0, r).map(Math.abs));
    const turned = q.reduce((most, x) => Math.max(most, Math.abs(x)), 1);
    if (!(open <= ROUNDING * data.reach * turned)) return null;
    if (!this.equations.facing(q, par).every((x) => x > 0)) return null;
    q.sign = sign;
    return q;
  }

  /** How far two positions are apart, angles in rad and displacements in sizes of the machine. */
  #far(p, q) {
    return p.reduce((most, x, i) => Math.max(most, Math.abs(x - q[i]) / this.data.scale[i]), 0);
  }

  /** Coordinates at a position of the drive while dimensions change to others; null if torn. */
  #deformed(q, from, target) {
    let [share, step] = [0, 1];
    let last = this.close(q, from) ?? q;
    const sense = last.sign;
    while (share < 1) {
      const next = Math.min(1, share + step);
      const par = target.map((x, i) => from[i] + next * (x - from[i]));
      const found = this.close(last, par);
      // the sign of the determinant tells two ways apart of putting loops together
      if (found && this.#far(found, last) < 0.25 && found.sign === sense) {
        [last, share, step] = [found, next, 2 * step];
      } else if (step > 1e-3) step *= 0.5;
      else return null;
    }
    return last;
  }

  /** Rates by u at a position; null where it is singular. */
  #slope(q, u, par = this.par) {
    const rates = this.#held(u).map(([, rate]) => rate);
    const v = new Array(this.n).fill(0);
    this.data.held.forEach((i, k) => { v[i] = rates[k]; });
    if (!this.r) return v;
    const { sought, held } = this.#rows(q, par);
    const found = solve(sought, held.map((row) => -row.reduce((sum, x, k) => sum + x * rates[k], 0)));
    if (!found) return null;
    found.forEach((x, k) => { v[this.data.sought[k]] = x; });
    return v;
  }

  /** The next position on the branch of one; null if it is not found in one step. */
  #step({ u, q, v }, next) {
    const guess = q.map((x, i) => x + (next - u) * v[i]);
    this.#held(next).forEach(([x], k) => { guess[this.data.held[k]] = x; });
    const found = this.close(guess);
    const gone = this.#far(guess, q);
    if (!found || gone > 1 || this.#far(found, guess) > STRAY * gone + 1e-6) return null;
    const slope = this.#slope(found, next);
    return slope && { u: next, q: found, v: slope };
  }

  /** As far as the drive can go from a position, in even steps; both ends are limits or not. */
  #follow(first) {
    const { low, high, turns } = this.data;
    const each = (high - low) / STEPS;
    const from = { ...first, v: this.#slope(first.q, first.u) ?? first.q.map(() => 0) };
    const walk = (count, way) => {
      const found = [];
      let at = from;
      for (let k = 1; at && k <= count; k += 1) at = this.#reach(at, from.u + way * k * each, found, each);
      return { found, limited: !at };
    };
    const below = Math.round((from.u - low) / each);
    const up = walk(turns ? STEPS : STEPS - below, 1);
    const down = walk(turns ? STEPS * up.limited : below, -1);
    this.limited = [down.limited, up.limited];
    const trail = [...down.found.reverse(), from, ...up.found];
    if (turns && !up.limited) this.#repeat(trail, each);
    [this.low, this.high] = [trail[0].u, trail.at(-1).u];
    this.full = turns && !up.limited;
    return trail;
  }

  /** Wheels may need some turns until all is as it was: adds them to a trail of one. */
  #repeat(trail, each) {
    const { coordinates, held, scale } = this.data;
    const [{ u, q }] = trail;
    const back = () => trail.at(-1).q.every((x, i) => held.includes(i)
      || Math.abs(coordinates[i].slides ? (x - q[i]) / scale[i] : Math.sin((x - q[i]) / 2)) < 1e-6);
    for (let k = STEPS + 1; !back() && k <= TURNS * STEPS; k += STEPS) {
      for (let j = k; j < k + STEPS; j += 1) {
        if (!this.#reach(trail.at(-1), u + j * each, trail, each)) return;
      }
    }
    if (!back()) trail.splice(STEPS + 1);
  }

  /** Follows to a position and notes it, or the limit before it. @returns {?Object} the former */
  #reach(from, target, found, whole) {
    let [at, step] = [from, target - from.u];
    while (at.u !== target) {
      const last = Math.abs(target - at.u) <= Math.abs(step) * (1 + 1e-9);
      const next = this.#step(at, last ? target : at.u + step);
      if (next) {
        at = next;
        step *= 2;
      } else if (Math.abs(step) > SMALLEST * Math.abs(whole)) step *= 0.5;
      else {
        if (at !== from) found.push(at);
        return null;
      }
    }
    found.push(at);
    return at;
  }

  /** The machine at a position of the drive, within its limits. @returns {Place} */
  at(u) {
    const { trail } = this;
    const now = Math.min(Math.max(u, this.low), this.high);
    let [first, last] = [0, trail.length - 1];
    while (last - first > 1) {
      const middle = (first + last) >> 1;
      if (trail[middle].u <= now) first = middle;
      else last = middle;
    }
    const [a, b] = [trail[first], trail[last]];
    const share = b.u > a.u ? (now - a.u) / (b.u - a.u) : 0;
    const guess = a.q.map((x, i) => x + share * (b.q[i] - x));
    this.#held(now).forEach(([x], k) => { guess[this.data.held[k]] = x; });
    return this.#moving(now, this.close(guess) ?? guess);
  }

  /** Every position of the trail. @returns {Place[]} */
  all() {
    return this.trail.map(({ u, q }) => this.#moving(u, q));
  }

  #moving(u, q) {
    const { n, r, data, equations, par, speed } = this;
    const held = this.#held(u);
    const slope = this.#slope(q, u) ?? q.map(() => NaN);
    const bend = new Array(n).fill(0);
    data.held.forEach((i, k) => { [, , bend[i]] = held[k]; });
    if (r) {
      const rows = this.#rows(q, par);
      const curved = equations.curvature(q, slope, par);
      const found = solve(rows.sought, rows.held.map((row, i) => -curved[i]
        - row.reduce((sum, x, k) => sum + x * held[k][2], 0)));
      data.sought.forEach((i, k) => { bend[i] = found ? found[k] : NaN; });
    }
    const v = slope.map((x) => x * speed);
    const a = bend.map((x) => x * speed * speed);
    const told = equations.poses(q, v, a, par);
    const links = told.length / 9;
    const poses = Array.from({ length: links }, (_, i) => [0, 1, 2].flatMap(
      (order) => told.slice(3 * (order * links + i), 3 * (order * links + i) + 3)));
    return { u, q, v, a, poses };
  }
}

/** A point of a link in the world with velocity and acceleration. @returns {number[]} x, y, ... */
export function pointOf([x, y, angle, vx, vy, w, ax, ay, alpha], [px, py]) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const [dx, dy] = [c * px - s * py, s * px + c * py];
  return [x + dx, y + dy, vx - w * dy, vy + w * dx,
    ax - alpha * dy - w * w * dx, ay + alpha * dx - w * w * dy];
}
