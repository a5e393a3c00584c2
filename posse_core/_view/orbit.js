// The relative orbit in 3-D: target's RTN axes, the target in the middle, seen without perspective.

const orbit = {
  canvas: document.getElementById("orbit"),
  yaw: -0.6, pitch: 0.45, zoom: 1,
  radius_m: columns.r_chaser_rtn_m.reduce((most, r) => Math.max(most, Math.hypot(...r)), 1e-3),

  // RTN metres → screen; R points up, T to the side, as orbits are drawn.
  toCanvas([R, T, N]) {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    const scale = 0.42 * Math.min(W, H) * this.zoom / this.radius_m;
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const side = c * T + s * N, away = c * N - s * T;
    const up = Math.cos(this.pitch) * R + Math.sin(this.pitch) * away;
    return [W / 2 + scale * side, H / 2 - scale * up];
  },

  draw(kept, current) {
    const context = fitted(this.canvas), r = columns.r_chaser_rtn_m;
    context.scale(devicePixelRatio, devicePixelRatio);
    context.font = "12px sans-serif";
    const reach = 0.55 * this.radius_m;
    this.arrow(context, [reach, 0, 0], "R", "#ff7b72");
    this.arrow(context, [0, reach, 0], "T", "#7ee787");
    this.arrow(context, [0, 0, reach], "N", "#79a8ff");
    context.strokeStyle = "#5b6a7a";
    context.lineWidth = 1;
    context.beginPath();
    for (let position = 0; position < count; position++) {
      const goesOn = position > 0 && columns.sequence[position] === columns.sequence[position - 1];
      goesOn ? context.lineTo(...this.toCanvas(r[position])) : context.moveTo(...this.toCanvas(r[position]));
    }
    context.stroke();
    context.fillStyle = ACCENT;
    for (const position of kept) dot(context, this.toCanvas(r[position]));
    context.fillStyle = TEXT;
    context.fillRect(this.canvas.clientWidth / 2 - 3, this.canvas.clientHeight / 2 - 3, 6, 6);
    const { clientWidth: W, clientHeight: H } = this.canvas;
    scaleBar(context, this.canvas, 0.42 * Math.min(W, H) * this.zoom / this.radius_m);
    if (current === undefined) return;
    const middle = this.toCanvas([0, 0, 0]), camera = this.toCanvas(r[current]);
    context.strokeStyle = "#ffffff66";
    stroke(context, middle, camera);
    this.arrow(context, columns.sun_rtn[current].map((x) => x * 0.8 * this.radius_m), "Sun", SUN);
    ring(context, camera);
  },

  arrow(context, tip_m, name, colour) {
    const from = this.toCanvas([0, 0, 0]), tip = this.toCanvas(tip_m);
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 1.5;
    stroke(context, from, tip);
    arrowhead(context, from, tip);
    context.fillText(name, tip[0] + 5, tip[1] - 3);
  },
};
