// Points in 3-D, in the sensor's axes, seen without perspective; at first as the sensor sees them.

class Cloud {
  constructor(tile) {
    this.tile = tile;
    this.canvas = make(tile.stage, "canvas", { className: "cloud" });
    this.controls = make(tile.bar, "label", { textContent: "Colour" });
    this.colour = make(this.controls, "select");
    this.colour.onchange = () => { this.wanted = this.colour.value; tile.draw(); };
    this.scale = new Scale(tile.bar);
    this.names = make(tile.bar, "span", { className: "names" });
    this.parts = [this.canvas, this.controls, this.scale.canvas, this.names];
    this.reset();
    // What is in front follows the pointer.
    dragged(this.canvas, { move: (x, y, dx, dy) => {
      this.yaw -= dx / 120;
      this.pitch = Math.min(Math.max(this.pitch + dy / 120, -Math.PI / 2), Math.PI / 2);
      this.draw();
    } });
    this.canvas.onwheel = (event) => {
      event.preventDefault();
      this.zoom *= Math.exp(-event.deltaY / 500);
      this.draw();
    };
    this.canvas.ondblclick = () => { this.reset(); this.draw(); };
  }

  reset() { Object.assign(this, { yaw: 0, pitch: 0, zoom: 1 }); }

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

  // CSS pixels per metre: the spacecraft's longest side is three quarters of the canvas's smaller one.
  get perMetre() {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    return 0.75 * Math.min(W, H) * this.zoom / dataset.spacecraft[this.tile.labels.spacecraft].size_m;
  }

  // Sensor axes, metres, relative to the point in the middle → to the right, down and away, metres.
  turned(x, y, z) {
    const [c, s, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const away = c * z - s * x;
    return [c * x + s * z, cp * y - sp * away, sp * y + cp * away];
  }

  // The middle of the spacecraft's box, sensor axes, metres: what the view turns about.
  get middle() {
    const { q_sensor_from_body: q, t_body_sensor_m: t } = this.tile.reading;
    return rotate(q, dataset.spacecraft[this.tile.labels.spacecraft].middle_body_m).map((value, i) => value + t[i]);
  }

  toCanvas(point) {
    const { middle } = this, [right, down] = this.turned(...point.map((value, i) => value - middle[i]));
    return [this.canvas.clientWidth / 2 + this.perMetre * right, this.canvas.clientHeight / 2 + this.perMetre * down];
  }

  draw() {
    const context = fitted(this.canvas), { xyz, count, perMetre } = this, { clientWidth: W, clientHeight: H } = this.canvas;
    const [x0, y0, z0] = this.middle, side = count < 1000 ? 3 : 2;
    const away = new Float32Array(count), at = new Float32Array(2 * count);
    for (let i = 0; i < count; i++) {
      const [right, down, far] = this.turned(xyz[3 * i] - x0, xyz[3 * i + 1] - y0, xyz[3 * i + 2] - z0);
      away[i] = far;
      at.set([W / 2 + perMetre * right, H / 2 + perMetre * down], 2 * i);
    }
    context.scale(devicePixelRatio, devicePixelRatio);
    context.font = "12px sans-serif";
    const colour = this.colours();
    // The nearest last, so that they are in front.
    for (const i of Uint32Array.from(away.keys()).sort((a, b) => away[b] - away[a])) {
      context.fillStyle = colour(i);
      context.fillRect(at[2 * i] - side / 2, at[2 * i + 1] - side / 2, side, side);
    }
    if (picture.shown.has("axes")) this.drawBodyAxes(context);
    this.drawSensorAxes(context);
    scaleBar(context, this.canvas, perMetre);
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
      tips.forEach((tip, i) => {
        context.strokeStyle = context.fillStyle = AXES[i];
        context.lineWidth = 2;
        stroke(context, origin, tip);
        context.fillText("xyz"[i], tip[0] + 4, tip[1]);
      });
    }
  }

  // Directions of the sensor's axes, in the corner.
  drawSensorAxes(context) {
    const middle = [this.canvas.clientWidth - 42, this.canvas.clientHeight - 42];
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, i) => {
      const [right, down] = this.turned(...axis), tip = [middle[0] + 26 * right, middle[1] + 26 * down];
      context.strokeStyle = context.fillStyle = AXES[i];
      context.lineWidth = 1.5;
      stroke(context, middle, tip);
      context.fillText("xyz"[i], tip[0] + 3 + 4 * right, tip[1] + 4 + 6 * down);
    });
  }
}

// Far apart for neighbouring parts; grey for none.
function partColour(part) {
  return part < 0 ? MUTED : `hsl(${(part * 137.508) % 360} 65% ${part % 2 ? 70 : 55}%)`;
}
