// Points in 3-D, in the sensor's axes; at first as the sensor sees them.

class Cloud extends Turntable {
  constructor(tile) {
    super(make(tile.stage, "canvas", { className: "cloud" }));
    this.tile = tile;
    this.controls = make(tile.bar, "label", { textContent: "Colour" });
    this.colour = make(this.controls, "select");
    this.colour.onchange = () => { this.wanted = this.colour.value; tile.draw(); };
    this.scale = new Scale(tile.bar);
    this.names = make(tile.bar, "span", { className: "names" });
    this.parts = [this.canvas, this.controls, this.scale.canvas, this.names];
  }

  show({ data }) {
    this.xyz = decodeNumbers(data.xyz, Float32Array);
    this.count = this.xyz.length / 3;
    this.values = {
      ...(data.part && { part: decodeNumbers(data.part, Int16Array) }),
      ...(data.intensity && { intensity: decodeNumbers(data.intensity.steps, Uint8Array) }),
      range: Float32Array.from({ length: this.count }, (_, i) => Math.hypot(...this.xyz.subarray(3 * i, 3 * i + 3))),
    };
    this.intensity = data.intensity;
    const names = Object.keys(this.values);
    this.colour.replaceChildren(...names.map((name) => new Option(name)));
    this.colour.value = names.includes(this.wanted) ? this.wanted : names[0];
    this.tile.note.textContent = thinned(this.count, data.total, "points");
  }

  get size_m() { return dataset.spacecraft[this.tile.labels.spacecraft].size_m; }

  // The middle of the spacecraft's box, sensor axes, metres: what the view turns about.
  get middle() {
    const { q_sensor_from_body: q, t_body_sensor_m: t } = this.tile.reading;
    return rotate(q, dataset.spacecraft[this.tile.labels.spacecraft].middle_body_m).map((value, i) => value + t[i]);
  }

  draw() {
    const context = fitted(this.canvas), { count } = this, side = count < 1000 ? 3 : 2;
    const { at, away } = this.placed(this.xyz);
    context.scale(devicePixelRatio, devicePixelRatio);
    context.font = "12px sans-serif";
    const colour = this.colours();
    // The nearest last, so that they are in front.
    for (const i of Uint32Array.from(away.keys()).sort((a, b) => away[b] - away[a])) {
      context.fillStyle = colour(i);
      context.fillRect(at[2 * i] - side / 2, at[2 * i + 1] - side / 2, side, side);
    }
    if (picture.shown.has("axes")) this.drawBodyAxes(context);
    this.drawDirections(context);
    scaleBar(context, this.canvas, this.perMetre);
  }

  // Colour of each point; shows what it means.
  colours() {
    const name = this.colour.value, values = this.values[name], { intensity } = this;
    const isPart = name === "part";
    this.names.hidden = !isPart;
    this.scale.canvas.hidden = isPart || !this.count;
    if (isPart) {
      this.nameParts(values);
      return (i) => partColour(values[i]);
    }
    if (!this.count) return () => TEXT;
    const isRange = name === "range", colour = isRange ? nearIsLight : ramp;
    const low = isRange ? values.reduce((a, b) => Math.min(a, b)) : 0, high = isRange ? values.reduce((a, b) => Math.max(a, b)) : 255;
    this.scale.draw(isRange ? { title: "range", low, high, unit: "m", colour }
      : { title: `log₁₀ ${intensity.name.replaceAll("_", " ")}`, low: intensity.low, high: intensity.high, unit: "", colour });
    return (i) => `rgb(${colour((values[i] - low) / Math.max(high - low, 1e-9))})`;
  }

  // The parts with the most points.
  nameParts(values) {
    const counts = new Map(), most = 8;
    for (const part of values) counts.set(part, (counts.get(part) ?? 0) + 1);
    const found = [...counts].sort((a, b) => b[1] - a[1]).map(([part]) => part);
    const names = partNames(this.tile.labels);
    this.names.replaceChildren();
    for (const part of found.slice(0, most)) {
      make(this.names, "span", { className: "swatch" }).style.background = partColour(part);
      this.names.append(names[part] ?? "no part", " ");
    }
    if (found.length > most) this.names.append(`and ${found.length - most} more`);
  }

  drawBodyAxes(context) {
    const { reading, labels } = this.tile;
    for (const [name, , craft] of bodiesOf(labels)) {
      const { q_sensor_from_body, t_body_sensor_m } = name ? reading.bodies[name] : reading;
      const body = { q_cam_from_body: q_sensor_from_body, t_body_cam_m: t_body_sensor_m };
      const [origin, ...tips] = axesOf(body, craft).map((tip) => this.toCanvas(tip));
      context.fillStyle = TEXT;
      context.fillText(name, origin[0] + 6, origin[1] + 14);
      drawTriad(context, origin, tips);
    }
  }
}

// Far apart for neighbouring parts; grey for none.
function partColour(part) {
  return part < 0 ? MUTED : `hsl(${(part * 137.508) % 360} 65% ${part % 2 ? 70 : 55}%)`;
}
