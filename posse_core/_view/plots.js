// Distributions, which are the filters as well, and the map of view directions.

// Quantities to filter by; scale leads from the label's unit to the one shown.
const QUANTITIES = [
  { name: "range_m", title: "Range", unit: "m", scale: 1 },
  { name: "phase_angle_rad", title: "Phase angle", unit: "°", scale: DEG },
  { name: "fraction_lit", title: "Share of the craft lit", unit: "", scale: 1 },
  { name: "sun_fraction_target", title: "Sun's disc in view", unit: "", scale: 1 },
  { name: "fraction_visible", title: "Share in the image", unit: "", scale: 1 },
  { name: "keypoints_visible", title: "Keypoints seen", unit: "", scale: 1, whole: true },
  { name: "sequence", title: "Sequence", unit: "", scale: 1, whole: true },
].filter((quantity) => columns[quantity.name].some((value) => value !== null));

const BINS = 30;

class Histogram {
  constructor(quantity, changed) {
    Object.assign(this, { quantity, changed, column: columns[quantity.name] });
    const values = this.column.filter((value) => value !== null);
    this.low = values.reduce((a, b) => Math.min(a, b));
    this.high = values.reduce((a, b) => Math.max(a, b));
    this.ends = [this.low, this.high].map((value) => short(value * quantity.scale));
    if (quantity.whole && this.high - this.low < BINS) {
      this.bins = this.high - this.low + 1;
      this.low -= 0.5;
      this.high += 0.5;
    } else {
      this.bins = BINS;
      // A little room, so that the ends lie within; more where all values are one.
      const room = (this.high - this.low) * 1e-6 || Math.max(Math.abs(this.high), 1) * 0.05;
      this.low -= room;
      this.high += room;
    }
    this.all = this.counts(this.column.map((_, position) => position));
    this.build();
  }

  build() {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    const { title, unit } = this.quantity;
    caption.textContent = unit ? `${title}, ${unit}` : title;
    this.canvas = document.createElement("canvas");
    const limits = Object.assign(document.createElement("div"), { className: "limits" });
    this.inputs = ["from", "to"].map((word) => {
      const input = Object.assign(document.createElement("input"), { type: "number", step: "any" });
      input.setAttribute("aria-label", `${title} ${word}`);
      input.onchange = () => this.typed();
      limits.append(word, input);
      return input;
    });
    figure.append(caption, this.canvas, limits);
    document.getElementById("plots").append(figure);
    dragged(this.canvas, {
      start: (x) => { this.from = this.valueAt(x); },
      move: (x) => this.changed([this.from, this.valueAt(x)].sort((a, b) => a - b)),
      click: () => this.changed(null),
    });
  }

  typed() {
    const [low, high] = this.inputs.map((input) => input.value.trim());
    if (low === "" && high === "") return this.changed(null);
    const limit = (text, open) => (text === "" ? open : Number(text) / this.quantity.scale);
    this.changed([limit(low, -Infinity), limit(high, Infinity)]);
  }

  counts(positions) {
    const bins = new Array(this.bins).fill(0);
    for (const position of positions) {
      const value = this.column[position];
      if (value === null) continue;
      const bin = Math.floor((value - this.low) / (this.high - this.low) * this.bins);
      bins[Math.min(Math.max(bin, 0), this.bins - 1)]++;
    }
    return bins;
  }

  valueAt(x) {
    const share = (x - MARGIN) / (this.canvas.clientWidth - 2 * MARGIN);
    return this.low + Math.min(Math.max(share, 0), 1) * (this.high - this.low);
  }

  draw(kept, position, limits) {
    const context = fitted(this.canvas), ratio = devicePixelRatio;
    context.scale(ratio, ratio);
    const width = this.canvas.clientWidth - 2 * MARGIN, height = this.canvas.clientHeight - 18;
    const at = (value) => MARGIN + (value - this.low) / (this.high - this.low) * width;
    const most = Math.max(...this.all), bar = width / this.bins;
    for (const [bins, colour] of [[this.all, GREY], [this.counts(kept), ACCENT]]) {
      context.fillStyle = colour;
      bins.forEach((n, i) => {
        const tall = n ? Math.max(n / most * (height - 4), 1.5) : 0;
        context.fillRect(MARGIN + i * bar + 0.5, height - tall, Math.max(bar - 1, 1), tall);
      });
    }
    if (limits) {
      const [from, to] = limits.map((value) => Math.min(Math.max(at(value), MARGIN), MARGIN + width));
      context.fillStyle = "#4fb3ff26";
      context.fillRect(from, 0, to - from, height);
    }
    const value = this.column[position];
    context.fillStyle = TEXT;
    if (value !== undefined && value !== null) context.fillRect(at(value) - 0.75, 0, 1.5, height);
    context.fillStyle = MUTED;
    context.font = "11px sans-serif";
    context.fillText(this.ends[0], MARGIN, height + 14);
    context.textAlign = "right";
    context.fillText(this.ends[1], MARGIN + width, height + 14);
    context.textAlign = "center";
    context.fillText(`at most ${most}`, MARGIN + width / 2, height + 14);
    context.textAlign = "left";
    this.inputs.forEach((input, i) => {
      if (input !== document.activeElement)
        input.value = limits && Number.isFinite(limits[i]) ? short(limits[i] * this.quantity.scale) : "";
    });
  }
}

const sphere = {
  canvas: document.getElementById("sphere"),

  toCanvas([x, y]) {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    const scale = Math.min((W - 30) / (4 * Math.SQRT2), (H - 34) / (2 * Math.SQRT2));
    return [W / 2 + scale * x, H / 2 - scale * y];
  },

  draw(kept, current) {
    const context = fitted(this.canvas);
    context.scale(devicePixelRatio, devicePixelRatio);
    context.strokeStyle = "#2f3a46";
    const line = (point) => {
      context.beginPath();
      for (let i = 0; i <= 60; i++) context.lineTo(...this.toCanvas(hammer(point(i / 60))));
      context.stroke();
    };
    const direction = (longitude, latitude) => [Math.cos(latitude) * Math.cos(longitude),
      Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude)];
    const almost = Math.PI * 0.99999;   // the rim's two sides are one meridian
    for (let k = -6; k <= 6; k++)
      line((s) => direction(Math.max(-almost, Math.min(almost, k * Math.PI / 6)), Math.PI * (s - 0.5)));
    for (let k = -2; k <= 2; k++) line((s) => direction(almost * (2 * s - 1), k * Math.PI / 6));
    this.dots(context, GREY, columns.index.keys());
    this.dots(context, ACCENT, kept);
    context.font = "11px sans-serif";
    context.fillStyle = MUTED;
    context.textAlign = "center";
    const names = [["+x", [1, 0, 0]], ["+y", [0, 1, 0]], ["−y", [0, -1, 0]], ["+z", [0, 0, 1]], ["−z", [0, 0, -1]]];
    for (const [name, axis] of names) {
      const [x, y] = this.toCanvas(hammer(axis));
      context.fillText(name, x, y + (axis[2] < 0 ? 14 : -5));
    }
    context.fillText("−x", this.toCanvas([2 * Math.SQRT2, 0])[0] + 9, this.toCanvas([0, 0])[1] + 4);
    if (current === undefined) return;
    const [x, y] = this.toCanvas(hammer(columns.sun_body[current]));
    context.fillStyle = SUN;
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fill();
    context.fillText("Sun", x, y - 8);
    ring(context, this.toCanvas(hammer(columns.view_body[current])));
  },

  dots(context, colour, positions) {
    context.fillStyle = colour;
    for (const position of positions) dot(context, this.toCanvas(hammer(columns.view_body[position])));
  },

  nearest(kept, x, y) {
    let best, least = 20;
    for (const position of kept) {
      const [u, v] = this.toCanvas(hammer(columns.view_body[position])), away = Math.hypot(u - x, v - y);
      if (away < least) [best, least] = [position, away];
    }
    return best;
  },
};

// A frame among others: smaller where there are thousands.
function dot(context, [x, y]) {
  const size = count > 2000 ? 1.5 : 3;
  context.fillRect(x - size / 2, y - size / 2, size, size);
}

// Hammer's equal-area map of a unit vector: x within ±2√2, y within ±√2; the body's x in the middle.
function hammer([x, y, z]) {
  const longitude = Math.atan2(y, x), cos = Math.hypot(x, y);
  const k = Math.SQRT2 / Math.sqrt(1 + cos * Math.cos(longitude / 2));
  return [2 * k * cos * Math.sin(longitude / 2), k * z];
}
