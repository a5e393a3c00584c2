// Events of a reading, accumulated over a part of its time.

const ON = "#ff5d5d", OFF = "#5c8dff";

class EventImage {
  constructor(tile) {
    this.tile = tile;
    this.canvas = make(tile.stage, "canvas");
    this.screen = new Screen(this.canvas, () => this.draw());
    [this.until, this.over] = ["Until", "over"].map((name) => slider(tile.bar, name, 1, () => this.draw()));
    this.text = make(tile.bar, "span");
    const key = make(tile.bar, "span");
    for (const [colour, name] of [[ON, "lighter"], [OFF, "darker"]]) {
      make(key, "span", { className: "swatch" }).style.background = colour;
      key.append(` ${name} `);
    }
    this.parts = [this.canvas, this.until.parentElement, this.over.parentElement, this.text, key];
  }

  show({ data }) {
    this.x = decodeNumbers(data.x, Uint16Array);
    this.y = decodeNumbers(data.y, Uint16Array);
    this.t_us = decodeNumbers(data.t_us, Float32Array);
    this.on = decodeNumbers(data.on, Uint8Array);
    this.from_us = Math.min(0, this.t_us[0] ?? 0);
    this.last_us = data.last_us;
    this.tile.note.textContent = thinned(this.x.length, data.total, "events");
  }

  // First and last instant, µs: the sliders' ends are the whole time and, for the second, a thousandth of it.
  get window() {
    const whole = this.last_us - this.from_us, until = this.from_us + this.until.value * whole;
    return [until - whole * 1000 ** (this.over.value - 1), until];
  }

  // The last event of each pixel is on top.
  draw() {
    const [W, H] = this.tile.size(null), context = this.screen.begin(W, H), line = 1 / this.screen.scale;
    const [from_us, until_us] = this.window, side = Math.max(1 + 0.5 * line, 1.6 * line);
    let count = 0;
    for (let i = 0; i < this.x.length; i++) {
      // Instants are in single precision in the page.
      if (this.t_us[i] < from_us - 1 || this.t_us[i] > until_us + 1) continue;
      context.fillStyle = this.on[i] ? ON : OFF;
      context.fillRect(this.x[i] + 0.5 - side / 2, this.y[i] + 0.5 - side / 2, side, side);
      count++;
    }
    const ms = (us) => (us / 1000).toFixed(this.last_us < 1e5 ? 2 : 1);
    this.text.textContent = `${ms(Math.max(from_us, this.from_us))} to ${ms(until_us)} ms: ${count} events`;
    drawOverlays(context, this.tile.frame, line);
  }
}
