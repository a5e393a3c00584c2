// The readings of sensors, each in a tile beside the camera's image. How a reading is shown follows from what it
// holds: points, events, maps, an image, or else a table of its contents.

const UNITS = { k: "K", m: "m", px: "px" };   // by the ending of an array's name
function titleOf(name) {
  const words = name.split("_"), unit = UNITS[words.at(-1)];
  return { title: (unit ? words.slice(0, -1) : words).join(" "), unit: unit ?? "" };
}

// What can be shown of a reading, the first by default: {name, way, data}, where the way is a property of the tile.
function choicesOf({ preview, files }) {
  const maps = Object.entries(preview?.maps ?? {}).map(([name, data]) => ({ name, way: "flat", data }));
  const isTemperature = ({ name }) => TEMPERATURES.includes(name);
  const image = files.find((file) => file.endsWith(".png"));
  return [
    ...(preview?.points ? [{ name: "points", way: "cloud", data: preview.points }] : []),
    ...(preview?.events ? [{ name: "events", way: "events", data: preview.events }] : []),
    ...maps.filter(isTemperature).reverse(),
    ...(image ? [{ name: "image", way: "flat", data: { jpeg: preview?.image, url: urlOf(image) } }] : []),
    ...maps.filter((map) => !isTemperature(map)),
    { name: "contents", way: "contents", data: preview },
  ];
}
const TEMPERATURES = ["temperature_k", "brightness_temperature_k"];

// A label of a third party's sensor may have the name of one of the core's and hold something else.
const numbers = (value, count) => Array.isArray(value) && value.length === count
  && value.every((number) => number === null || Number.isFinite(number));
const DRAWN = {
  box_visible_px: (value) => numbers(value, 4),
  box_whole_px: (value) => numbers(value, 4),
  keypoints: (value) => value && Object.values(value).every((point) => numbers(point, 3)),
  mask_rle: (value) => value && numbers(value.size, 2) && typeof value.counts === "string",
};

// What the overlays draw over a reading's pixels: its labels, and the poses where the sensor has a camera.
function frameOf(reading, camera, labels) {
  const ofBody = (taken, made, { spacecraft }) => {
    const drawn = Object.entries(made ?? {}).filter(([name, value]) => DRAWN[name]?.(value));
    const pose = camera ? { q_cam_from_body: taken.q_sensor_from_body, t_body_cam_m: taken.t_body_sensor_m } : {};
    return { spacecraft, ...pose, ...Object.fromEntries(drawn) };
  };
  const bodies = Object.entries(reading.bodies ?? {}).map(([name, taken]) =>
    [name, ofBody(taken, reading.labels.bodies?.[name], labels.bodies[name])]);
  return { camera, labels: { ...ofBody(reading, reading.labels, labels), bodies: Object.fromEntries(bodies) } };
}

class Tile {
  constructor(name) {
    Object.assign(this, { name, ...dataset.sensors[name] });
    this.figure = make(byId("views"), "figure", { className: "sensor" });
    const caption = make(this.figure, "figcaption");
    make(caption, "b", { textContent: name });
    make(caption, "small", { textContent: this.type });
    this.choose = make(caption, "select", { ariaLabel: `What is shown of ${name}` });
    this.choose.onchange = () => { this.chosen = this.choose.value; this.fill(); };
    this.instant = make(caption, "small", { className: "instant", title: "Seconds after the frame" });
    this.stage = make(this.figure, "div", { className: "stage" });
    this.bar = make(this.figure, "div", { className: "bar" });
    this.note = make(this.bar, "span", { className: "note" });
    this.ways = { cloud: new Cloud(this), events: new EventImage(this), flat: new Flat(this), contents: new Contents(this) };
  }

  // Show the reading at a place in the frame's list; there may be none.
  show(frame, place, after_s) {
    const readings = frame.labels.sensors?.[this.name] ?? [];
    this.reading = readings.length ? { ...readings[place], preview: frame.preview?.readings?.[this.name]?.[place] } : null;
    this.labels = frame.labels;
    this.instant.textContent = this.reading
      ? `${readings.length > 1 ? `${place + 1} of ${readings.length}, ` : ""}+${after_s.toFixed(3)} s` : "no reading";
    this.fill();
  }

  fill() {
    const choices = this.reading ? choicesOf(this.reading) : [];
    const choice = choices.find(({ name }) => name === this.chosen) ?? choices[0];
    this.choose.replaceChildren(...choices.map(({ name }) => new Option(Object.values(titleOf(name)).filter(Boolean).join(", "), name)));
    this.choose.hidden = choices.length < 2;
    this.note.textContent = "";
    for (const way of Object.values(this.ways)) way.parts.forEach((part) => { part.hidden = way !== this.ways[choice?.way]; });
    this.way = choice ? this.ways[choice.way] : null;
    if (!choice) return;
    this.choose.value = choice.name;
    this.frame = frameOf(this.reading, this.camera, this.labels);
    this.way.show(choice, this.reading);
    this.draw();
  }

  draw() { this.way?.draw(); }

  // Width and height of its pixels; those of the image where nothing else tells.
  size(image) {
    if (this.camera) return [this.camera.width_px, this.camera.height_px];
    return this.reading.preview?.size_px ?? [image?.naturalWidth || 1, image?.naturalHeight || 1];
  }
}

const sensors = {
  tiles: Object.keys(dataset.sensors).map((name) => new Tile(name)),
  frame: null, instants: [0], at: 0,   // instants of the frame's readings, s after the frame's, and the one shown

  show(frame, at) {
    const taken = Object.values(frame.labels.sensors ?? {}).flat().map((reading) => this.after(frame, reading));
    this.frame = frame;
    this.instants = [...new Set([0, ...taken])].sort((a, b) => a - b);
    byId("instants").hidden = this.instants.length < 2;
    byId("instant").max = this.instants.length - 1;
    this.showAt(at);
  },

  // Each sensor's last reading that is not later.
  showAt(at) {
    this.at = Math.min(Math.max(at, 0), this.instants.length - 1);
    const now_s = this.instants[this.at];
    for (const tile of this.tiles) {
      const taken = (this.frame.labels.sensors?.[tile.name] ?? []).map((reading) => this.after(this.frame, reading));
      const place = Math.max(taken.findLastIndex((after_s) => after_s <= now_s), 0);
      tile.show(this.frame, place, taken[place]);
    }
    byId("instant").value = this.at;
    byId("after").textContent = `${now_s.toFixed(3)} s after the frame`;
    setAddress();
  },

  // Whole microseconds, so that readings of several sensors at one instant are at one.
  after({ labels }, { t_s }) { return Math.round((t_s - labels.t_s) * 1e6) / 1e6; },

  draw() { for (const tile of this.tiles) tile.draw(); },
};

// From reading to reading, and over the end of the frame to the next one.
function stepReading(by) {
  const at = sensors.at + by, before = state.current;
  if (at >= 0 && at < sensors.instants.length) return sensors.showAt(at);
  step(by);
  if (by < 0 && state.current !== before) sensors.showAt(Infinity);
}

byId("earlier").onclick = () => stepReading(-1);
byId("later").onclick = () => stepReading(1);
byId("instant").oninput = (event) => sensors.showAt(Number(event.target.value));
