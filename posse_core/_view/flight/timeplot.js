// A value over the time of the flight. All plots show the same part of the flight, and the frame shown.

const NO_READINGS = "#8d9aa8", REJECTED = "#ff9f43", REACHED = "#58e07a", SINGLE = "#c58cff";
const t_s = flight.t_s;
const part = { from: t_s[0], to: Math.max(t_s.at(-1), t_s[0] + 1e-9) };   // seconds that the plots show

// Round values from low to high, about as many as wanted; powers of ten, where the axis is logarithmic.
function ticks(low, high, wanted, logarithmic = false) {
  const values = [];
  if (logarithmic) {
    const [first, last] = [Math.log10(low), Math.log10(high)].map((value) => Math.round(value));
    for (let power = first; power <= last; power += Math.max(1, Math.round((last - first) / wanted)))
      values.push(10 ** power);
    return values;
  }
  const rough = (high - low) / wanted, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= rough * 0.999);
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  return values;
}

// The frames whose instants are within the part shown, and one more at either side.
function framesShown() {
  const first = t_s.findIndex((t) => t >= part.from), last = t_s.findLastIndex((t) => t <= part.to);
  return [Math.max(first - 1, 0), Math.min(last + 1, t_s.length - 1)];
}

class TimePlot {
  constructor(plot, parent) {
    Object.assign(this, plot, { until: null });   // s, where a drag has come to
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    this.readout = document.createElement("span");
    caption.append(this.unit ? `${this.title}, ${this.unit}` : this.title, this.readout);
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    figure.append(caption, this.canvas);
    parent.append(figure);
    dragged(this.canvas, {
      // The part is shown when the pointer lets go: until then the axis must stay.
      start: (x) => { this.from = this.timeAt(x); },
      move: (x) => { this.until = this.timeAt(x); drawAll(); },
      end: () => {
        const ends = [this.from, this.until].sort((a, b) => a - b);
        this.until = null;
        showPart(...ends);
      },
      click: (x) => select(nearestFrame(this.timeAt(x))),
    });
    this.canvas.ondblclick = showWhole;
  }

  // The ends of the vertical axis: all values, and nearly all of the band, which may begin very wide.
  limits() {
    const [first, last] = framesShown(), within = (column) =>
      column ? column.slice(first, last + 1).filter((value) => value !== null) : [];
    const band = within(this.band).filter(([low]) => low !== null);
    const ends = band.map(([low, high]) => high - low).sort((a, b) => a - b);
    const widest = ends[Math.floor(0.9 * (ends.length - 1))];
    const values = [...within(this.values), ...band.filter(([low, high]) => high - low <= widest).flat()];
    if (this.level !== null) values.push(this.level);
    if (this.shape !== "line") values.push(0, ...within(this.dots));
    if (this.logarithmic) {
      const positive = values.filter((value) => value > 0);
      if (!positive.length) return [0.1, 10];
      const [low, high] = [Math.min(...positive), Math.max(...positive)].map((value) => Math.log10(value));
      return [10 ** Math.floor(low), 10 ** Math.max(Math.ceil(high), Math.floor(low) + 1)];
    }
    if (!values.length) return [0, 1];
    const low = Math.min(...values), high = Math.max(...values);
    const room = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    return [low - (this.shape === "line" ? room : 0), high + room];
  }

  timeAt(x) {
    const share = (x - this.left) / (this.right - this.left);
    return part.from + Math.min(Math.max(share, 0), 1) * (part.to - part.from);
  }

  draw(current) {
    const context = fitted(this.canvas), { clientWidth: W, clientHeight: H } = this.canvas;
    Object.assign(this, { left: 52, right: W - MARGIN, top: 6, bottom: H - 22 });
    const [low, high] = this.limits(), scale = this.logarithmic ? (value) => Math.log10(Math.max(value, 1e-300)) : Number;
    const x = (t) => this.left + (t - part.from) / (part.to - part.from) * (this.right - this.left);
    const y = (value) => this.bottom - (scale(value) - scale(low)) / (scale(high) - scale(low)) * (this.bottom - this.top);
    Object.assign(this, { x, y, low, high });
    context.scale(devicePixelRatio, devicePixelRatio);
    this.drawAxes(context);
    context.save();
    context.beginPath();
    context.rect(this.left, this.top, this.right - this.left, this.bottom - this.top);
    context.clip();
    this.drawBand(context);
    this.drawTimes(context);
    this.drawValues(context);
    this.drawMarks(context);
    if (this.until !== null) {
      context.fillStyle = `${TEXT}33`;
      context.fillRect(x(this.from), this.top, x(this.until) - x(this.from), this.bottom - this.top);
    }
    context.fillStyle = TEXT;
    context.fillRect(x(t_s[current]) - 0.75, this.top, 1.5, this.bottom - this.top);
    context.restore();
    this.tell(current);
  }

  drawAxes(context) {
    context.font = "11px sans-serif";
    context.fillStyle = MUTED;
    context.strokeStyle = "#2a343f";
    context.lineWidth = 1;
    context.textAlign = "right";
    for (const value of ticks(this.low, this.high, 4, this.logarithmic)) {
      stroke(context, [this.left, this.y(value)], [this.right, this.y(value)]);
      context.fillText(short(value), this.left - 5, this.y(value) + 4);
    }
    context.textAlign = "center";
    for (const t of ticks(part.from, part.to, 5)) {
      stroke(context, [this.x(t), this.top], [this.x(t), this.bottom]);
      if (this.x(t) < this.right - 24) context.fillText(short(t), this.x(t), this.bottom + 14);
    }
    context.textAlign = "right";
    context.fillText("s", this.right, this.bottom + 14);
  }

  drawBand(context) {
    if (this.level !== null) {
      context.strokeStyle = MUTED;
      context.setLineDash([5, 4]);
      stroke(context, [this.left, this.y(this.level)], [this.right, this.y(this.level)]);
      context.setLineDash([]);
    }
    if (!this.band) return;
    context.fillStyle = `${ACCENT}33`;
    for (const [from, to] of runs(this.band.map(([low]) => low))) {
      context.beginPath();
      for (let i = from; i <= to; i++) context.lineTo(this.x(t_s[i]), this.y(this.band[i][1]));
      for (let i = to; i >= from; i--) context.lineTo(this.x(t_s[i]), this.y(this.band[i][0]));
      context.fill();
    }
  }

  drawTimes(context) {
    context.fillStyle = `${REACHED}88`;
    for (const [from, until] of flight.waypoints_s) {
      context.fillRect(this.x(from) - 0.5, this.top, 1, this.bottom - this.top);
      if (until > from) context.fillRect(this.x(from), this.top, this.x(until) - this.x(from), 3);
    }
  }

  drawValues(context) {
    context.strokeStyle = context.fillStyle = ACCENT;
    context.lineWidth = 1.5;
    if (this.shape === "stems") {
      this.values.forEach((value, i) => {
        if (value) stroke(context, [this.x(t_s[i]), this.y(0)], [this.x(t_s[i]), this.y(value)]);
      });
    } else for (const [from, to] of runs(this.values)) {
      context.beginPath();
      for (let i = from; i <= to; i++) {
        if (this.shape === "steps" && i > from) context.lineTo(this.x(t_s[i]), this.y(this.values[i - 1]));
        context.lineTo(this.x(t_s[i]), this.y(this.values[i]));
      }
      from === to ? context.fillRect(this.x(t_s[from]) - 1, this.y(this.values[from]) - 1, 2, 2) : context.stroke();
    }
    context.fillStyle = SINGLE;
    this.dots?.forEach((value, i) => {
      // A dot that is outside the axis stands at its border.
      if (value !== null) context.fillRect(this.x(t_s[i]) - 1,
        Math.min(Math.max(this.y(value), this.top + 1), this.bottom - 1) - 1, 2, 2);
    });
  }

  drawMarks(context) {
    flight.dof.forEach((dof, i) => {
      if (dof && !flight.rejected[i]) return;
      context.fillStyle = dof ? REJECTED : NO_READINGS;
      context.fillRect(this.x(t_s[i]) - 1, this.bottom - 5, 2, 5);
    });
  }

  // The value of the frame shown, in words: for those who do not see the drawing too.
  tell(current) {
    const [value, band] = [this.values[current], this.band?.[current]];
    const expected = band && band[0] !== null ? `, band ${short(band[0])} to ${short(band[1])}` : "";
    this.readout.textContent = value === null ? "none" : short(value) + expected;
    this.canvas.setAttribute("aria-label", `${this.title} over time, ${this.unit}; at ${short(t_s[current])} s `
      + this.readout.textContent);
  }
}

// First and last position of each part of a column without a gap.
function runs(column) {
  const found = [];
  column.forEach((value, i) => {
    if (value === null) return;
    if (i > 0 && column[i - 1] !== null) found.at(-1)[1] = i;
    else found.push([i, i]);
  });
  return found;
}

function nearestFrame(t) {
  return t_s.reduce((best, other, i) => (Math.abs(other - t) < Math.abs(t_s[best] - t) ? i : best), 0);
}
