// The path relative to the target, seen along one of the RTN axes; the target is in the origin.

const TRUE = TEXT, ESTIMATE = ACCENT, IMPULSE = SUN, KEEP_OUT = "#ff6b5e", CONE = "#c58cff";
const UPPER = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];   // position of an element in the triangle that the page has
const impulse_m_s = flight.dv_rtn_m_s.map((dv) => Math.hypot(...dv));
const largest_m_s = impulse_m_s.reduce((a, b) => Math.max(a, b));

class Projection {
  // across and up: 0, 1, 2 for R, T, N, with the words for each.
  constructor({ across, up, title, right, top }, parent) {
    Object.assign(this, { across, up, title, right, top });
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    caption.textContent = title;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    figure.append(caption, this.canvas);
    parent.append(figure);
  }

  flat(point) {
    return [point[this.across], point[this.up]];
  }

  toCanvas(point) {
    const [a, b] = this.flat(point);
    return [this.middle[0] + this.scale * (a - this.centre[0]), this.middle[1] - this.scale * (b - this.centre[1])];
  }

  // Paths of the part shown; for the whole flight, everything that stands in space as well.
  fit() {
    const [first, last] = framesShown(), whole = first === 0 && last === t_s.length - 1;
    const points = [flight.true_rtn_m, flight.estimate_rtn_m].flatMap((path) => path.slice(first, last + 1))
      .filter(([a]) => a !== null).map((point) => this.flat(point));
    if (whole) {
      points.push([0, 0], ...flight.waypoints_rtn_m.map((point) => this.flat(point)));
      const size = flight.keep_out_m && this.flat(flight.keep_out_m);
      if (size) points.push(size, size.map((value) => -value));
    }
    const { clientWidth: W, clientHeight: H } = this.canvas;
    const ends = [0, 1].map((i) => points.map((point) => point[i]))
      .map((values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))]);
    const [wide, tall] = ends.map(([low, high]) => high - low);
    this.centre = ends.map(([low, high]) => (low + high) / 2);
    this.middle = [(W + 40) / 2, (H - 18) / 2];
    this.scale = Math.min((W - 90) / Math.max(wide, 1e-6), (H - 70) / Math.max(tall, 1e-6));
  }

  draw(current) {
    const context = fitted(this.canvas);
    context.scale(devicePixelRatio, devicePixelRatio);
    this.fit();
    this.drawAxes(context);
    this.drawCone(context);
    this.drawKeepOut(context);
    this.drawPath(context, flight.true_rtn_m, TRUE);
    this.drawEllipses(context, current);
    this.drawPath(context, flight.estimate_rtn_m, ESTIMATE);
    this.drawImpulses(context);
    this.drawWaypoints(context);
    ring(context, this.toCanvas(flight.true_rtn_m[current]));
    const [a, b] = this.flat(flight.true_rtn_m[current]);
    this.canvas.setAttribute("aria-label",
      `${this.title}; at ${short(t_s[current])} s the chaser is at ${"RTN"[this.across]} ${short(a)} m, ${"RTN"[this.up]} ${short(b)} m`);
  }

  drawAxes(context) {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    const low = [40, H - 18].map((edge, i) => this.centre[i] + (i ? -1 : 1) * (edge - this.middle[i]) / this.scale);
    const high = [W, 0].map((edge, i) => this.centre[i] + (i ? -1 : 1) * (edge - this.middle[i]) / this.scale);
    context.font = "11px sans-serif";
    context.strokeStyle = "#2a343f";
    context.fillStyle = MUTED;
    context.lineWidth = 1;
    context.textAlign = "center";
    for (const a of ticks(low[0], high[0], 5)) {
      const x = this.middle[0] + this.scale * (a - this.centre[0]);
      stroke(context, [x, 0], [x, H - 18]);
      if (x > 50 && x < W - 20) context.fillText(short(a), x, H - 5);
    }
    context.textAlign = "right";
    for (const b of ticks(low[1], high[1], 5)) {
      const y = this.middle[1] - this.scale * (b - this.centre[1]);
      stroke(context, [40, y], [W, y]);
      if (y > 22) context.fillText(short(b), 36, y + 4);
    }
    context.fillStyle = TEXT;
    context.fillText(this.right, W - 6, H - 24);
    context.textAlign = "left";
    context.fillText(this.top, 44, 13);
    const [x, y] = this.toCanvas([0, 0, 0]);
    context.fillRect(x - 3, y - 3, 6, 6);
  }

  drawPath(context, path, colour) {
    context.strokeStyle = colour;
    context.lineWidth = 1.3;
    context.beginPath();
    for (const [from, to] of runs(path.map(([a]) => a))) {
      context.moveTo(...this.toCanvas(path[from]));
      for (let i = from + 1; i <= to; i++) context.lineTo(...this.toCanvas(path[i]));
    }
    context.stroke();
  }

  // 3σ ellipses of some frames, and of the one shown: the circle through the Cholesky factor.
  drawEllipses(context, current) {
    const [first, last] = framesShown(), every = Math.max(1, Math.round((last - first) / 25));
    for (let i = first; i <= last; i++) {
      if (i !== current && (i - first) % every) continue;
      context.strokeStyle = i === current ? ESTIMATE : `${ESTIMATE}66`;
      context.lineWidth = i === current ? 1.5 : 1;
      const ellipse = this.ellipse(i);
      if (!ellipse) continue;
      context.beginPath();
      ellipse.forEach((point) => context.lineTo(...point));
      context.stroke();
    }
  }

  // Canvas points of the 3σ ellipse of the frame at a position; null where there is no estimate.
  ellipse(position) {
    const P = flight.covariance_m2[position], at = flight.estimate_rtn_m[position];
    if (P[0] === null || at[0] === null) return null;
    const [aa, ab, bb] = [[this.across, this.across], [this.across, this.up], [this.up, this.up]]
      .map(([i, j]) => P[UPPER[i][j]]);
    const one = Math.sqrt(aa), two = one && ab / one, three = Math.sqrt(Math.max(bb - two * two, 0));
    const [x, y] = this.toCanvas(at);
    return Array.from({ length: 49 }, (_, k) => {
      const [c, s] = [Math.cos(k * Math.PI / 24), Math.sin(k * Math.PI / 24)];
      return [x + 3 * this.scale * one * c, y - 3 * this.scale * (two * c + three * s)];
    });
  }

  drawImpulses(context) {
    if (!largest_m_s) return;
    const { clientWidth: W, clientHeight: H } = this.canvas, [first, last] = framesShown();
    context.strokeStyle = context.fillStyle = IMPULSE;
    context.lineWidth = 1.5;
    for (let i = first; i <= last; i++) {
      const [a, b] = this.flat(flight.dv_rtn_m_s[i]), px = 0.2 * Math.min(W, H) / largest_m_s;
      if (Math.hypot(a, b) * px < 1) continue;
      const from = this.toCanvas(flight.true_rtn_m[i]), tip = [from[0] + px * a, from[1] - px * b];
      stroke(context, from, tip);
      if (Math.hypot(a, b) * px > 8) arrowhead(context, from, tip);
    }
  }

  drawWaypoints(context) {
    context.strokeStyle = context.fillStyle = REACHED;
    context.lineWidth = 1.5;
    flight.waypoints_rtn_m.forEach((point, i) => {
      const [x, y] = this.toCanvas(point);
      stroke(context, [x - 5, y - 5], [x + 5, y + 5]);
      stroke(context, [x - 5, y + 5], [x + 5, y - 5]);
      context.fillText(i + 1, x + 7, y - 6);
    });
  }

  drawKeepOut(context) {
    if (!flight.keep_out_m) return;
    const [a, b] = this.flat(flight.keep_out_m);
    context.strokeStyle = KEEP_OUT;
    context.fillStyle = `${KEEP_OUT}22`;
    context.lineWidth = 1.3;
    context.beginPath();
    context.ellipse(...this.toCanvas([0, 0, 0]), this.scale * a, this.scale * b, 0, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  drawCone(context) {
    if (!flight.cone_rtn_m) return;
    context.strokeStyle = `${CONE}aa`;
    context.fillStyle = `${CONE}14`;
    context.lineWidth = 1;
    context.beginPath();
    for (const point of hull(flight.cone_rtn_m.map((corner) => this.toCanvas(corner)))) context.lineTo(...point);
    context.closePath();
    context.fill();
    context.stroke();
  }
}

// The convex hull of points in the plane, in order (Andrew's monotone chain).
function hull(points) {
  const sorted = [...points].sort(([a, b], [c, d]) => a - c || b - d);
  const chain = (ordered) => {
    const kept = [];
    for (const point of ordered) {
      while (kept.length > 1) {
        const [[a, b], [c, d]] = kept.slice(-2);
        if ((c - a) * (point[1] - b) - (d - b) * (point[0] - a) > 0) break;
        kept.pop();
      }
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...chain(sorted), ...chain(sorted.reverse())];
}
