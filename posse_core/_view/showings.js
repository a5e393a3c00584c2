// How one thing of a reading is shown in its tile. Each way has show(choice, reading), draw(), and ``parts``, the
// elements that are seen while it is the way.

// A slider from 0 to 1.
function slider(parent, name, value, changed) {
  const label = make(parent, "label", { textContent: name });
  return make(label, "input", { type: "range", min: 0, max: 1, step: 0.001, value, oninput: changed });
}

// A bar of colours with its values below.
class Scale {
  constructor(parent) {
    this.canvas = make(parent, "canvas", { className: "scale" });
  }

  // colour: 0 … 1 → [r, g, b], for low … high.
  draw({ title, low, high, unit, colour }) {
    const { canvas } = this, context = fitted(canvas), { clientWidth: W } = canvas, left = 10, width = W - 50;
    context.scale(devicePixelRatio, devicePixelRatio);
    context.font = "11px sans-serif";
    for (let x = 0; x < width; x++) {
      context.fillStyle = `rgb(${colour(x / (width - 1))})`;
      context.fillRect(left + x, 16, 1.5, 9);
    }
    context.fillStyle = context.strokeStyle = TEXT;
    context.textAlign = "left";
    context.fillText(`${title}: ${short(low)} … ${short(high)} ${unit}`, left, 11);
    context.textAlign = "center";
    for (const value of ticks(low, high)) {
      const x = left + width * (value - low) / (high - low);
      stroke(context, [x, 25], [x, 28]);
      context.fillText(`${short(value)} ${unit}`, x, 39);
    }
    canvas.setAttribute("aria-label", `${title}, ${short(low)} to ${short(high)} ${unit}`);
  }
}

// Where the colours of temperatures begin: space, at 3 K, would leave few of them to the spacecraft.
const COLDEST_K = 150;

// An image or a map in the sensor's pixels, with the reading's labels over it.
class Flat {
  constructor(tile) {
    this.tile = tile;
    this.canvas = make(tile.stage, "canvas");
    this.screen = new Screen(this.canvas, () => this.draw());
    this.arrivals = new Arrivals();
    const changed = () => { this.colour(); this.draw(); };
    [this.from, this.to] = [0, 1].map((value) => slider(tile.bar, value ? "to" : "Colours from", value, changed));
    this.scale = new Scale(tile.bar);
    this.ofMaps = [this.from.parentElement, this.to.parentElement, this.scale.canvas];
    this.parts = [this.canvas, ...this.ofMaps];
  }

  show({ name, data }) {
    const { tile } = this, isMap = "png" in data;
    if (isMap && name !== this.name) {
      const isCold = titleOf(name).unit === "K" && data.low < COLDEST_K && data.high > COLDEST_K;
      this.from.value = isCold ? (COLDEST_K - data.low) / (data.high - data.low) : 0;
      this.to.value = 1;
    }
    Object.assign(this, { name, image: null, steps: null, map: isMap ? data : null });
    for (const part of this.ofMaps) part.hidden = !isMap;
    this.arrivals.begin();
    if (isMap) this.arrivals.load(`data:image/png;base64,${data.png}`, (image) => {
      this.steps = image;
      this.colour();
      tile.draw();
    });
    else this.arrivals.loadBest(data.jpeg, data.url, (image) => { this.image = image; tile.draw(); },
      (text) => { tile.note.textContent = text; });
  }

  // The part of the map's values that has the colours, as shares of all of it.
  get part() {
    const [from, to] = [Number(this.from.value), Number(this.to.value)].sort((a, b) => a - b);
    return [from, Math.max(to, from + 0.004)];
  }

  colour() {
    const { title, unit } = titleOf(this.name), { low, high } = this.map, [from, to] = this.part;
    const colour = unit === "K" ? (share) => ramp(share, HEAT) : unit === "m" ? nearIsLight : (share) => ramp(share);
    this.key = { title, unit, colour, low: low + from * (high - low), high: low + to * (high - low) };
    if (this.steps) this.image = coloured(this.steps, (share) => colour((share - from) / (to - from)));
  }

  draw() {
    const [W, H] = this.tile.size(this.image), context = this.screen.begin(W, H);
    if (!this.map) drawImage(context, this.image, W, H);
    else if (this.image) {
      context.imageSmoothingEnabled = false;
      context.drawImage(this.image, ...this.map.box);
      this.scale.draw(this.key);
    }
    drawOverlays(context, this.tile.frame, 1 / this.screen.scale);
  }
}

// Tables of the labels, arrays and files, for a reading that nothing else can be shown of.
class Contents {
  constructor(tile) {
    this.tile = tile;
    this.body = make(tile.stage, "div", { className: "contents" });
    this.parts = [this.body];
  }

  show({ data }, { labels, files }) {
    const written = (value) => (typeof value === "object" ? JSON.stringify(value) : String(value));
    const sections = {
      "Labels": Object.entries(labels).map(([name, value]) => [name, written(value)]),
      "Arrays": (data?.arrays ?? []).map(([name, type, shape]) => [name, `${shape.join(" × ") || "one number"}, ${type}`]),
      "Files": files.map((file) => [file, sizeOf(file, data)]),
    };
    this.body.replaceChildren();
    for (const [title, rows] of Object.entries(sections)) {
      if (!rows.length) continue;
      make(this.body, "h2", { textContent: title });
      const table = make(this.body, "table");
      for (const [name, value] of rows) {
        const row = make(table, "tr");
        make(row, "th", { textContent: name });
        make(row, "td", { textContent: value });
      }
    }
    if (!data) this.tile.note.textContent = "what this reading holds is not in the page";
  }

  draw() {}
}

function sizeOf(file, data) {
  const bytes = data?.files[file.slice(file.lastIndexOf("."))];
  return bytes === undefined ? "" : `${bytes} bytes`;
}

// How many of the whole are in the page, in words; nothing if all.
function thinned(kept, total, what) {
  return kept < total ? `${kept} of ${total} ${what}, evenly spread` : `${total} ${what}`;
}
