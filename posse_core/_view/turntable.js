// Things in 3-D, seen without perspective, that the pointer turns: dragging turns what is in front, dragging with
// Shift moves, the wheel zooms, a double click resets. A kind of them has draw(), ``middle`` (what the view turns
// about) and ``size_m``; a click may do something.

class Turntable {
  constructor(canvas) {
    this.canvas = canvas;
    this.reset();
    dragged(canvas, {
      move: (x, y, dx, dy, event) => {
        if (event.shiftKey) { this.x += dx; this.y += dy; }
        else this.turn(dx, dy);
        this.draw();
      },
      click: (x, y) => this.click(x, y),
    });
    canvas.onwheel = (event) => {
      event.preventDefault();
      const by = Math.exp(-event.deltaY / 500);
      this.zoom *= by;
      // What is under the pointer stays there.
      this.x = by * this.x + (1 - by) * (event.offsetX - canvas.clientWidth / 2);
      this.y = by * this.y + (1 - by) * (event.offsetY - canvas.clientHeight / 2);
      this.draw();
    };
    canvas.ondblclick = () => { this.reset(); this.draw(); };
  }

  click() {}

  // Radians, the zoom over the fitted size, and the shift of the middle, CSS pixels.
  reset() { Object.assign(this, { yaw: 0, pitch: 0, zoom: 1, x: 0, y: 0 }); }

  turn(dx, dy) {
    this.yaw -= dx / 120;
    this.pitch = Math.min(Math.max(this.pitch + dy / 120, -Math.PI / 2), Math.PI / 2);
  }

  // CSS pixels per metre: the longest side is three quarters of the canvas's smaller one.
  get perMetre() {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    return 0.75 * Math.min(W, H) * this.zoom / this.size_m;
  }

  // Relative to the middle, metres → to the right, down and away, metres.
  turned(x, y, z) {
    const [c, s, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const away = c * z - s * x;
    return [c * x + s * z, cp * y - sp * away, sp * y + cp * away];
  }

  // Points, three numbers each → where they are drawn, two numbers each, CSS pixels, and how far away, metres.
  placed(xyz) {
    const count = xyz.length / 3, at = new Float64Array(2 * count), away = new Float64Array(count);
    const { perMetre } = this, [x0, y0, z0] = this.middle;
    const left = this.canvas.clientWidth / 2 + this.x, top = this.canvas.clientHeight / 2 + this.y;
    const [[a, d, g], [b, e, h], [c, f, k]] = [this.turned(1, 0, 0), this.turned(0, 1, 0), this.turned(0, 0, 1)];
    for (let i = 0; i < count; i++) {
      const x = xyz[3 * i] - x0, y = xyz[3 * i + 1] - y0, z = xyz[3 * i + 2] - z0;
      at[2 * i] = left + perMetre * (a * x + b * y + c * z);
      at[2 * i + 1] = top + perMetre * (d * x + e * y + f * z);
      away[i] = g * x + h * y + k * z;
    }
    return { at, away };
  }

  toCanvas(point) { return [...this.placed(point).at]; }

  // Directions of the axes, in the corner.
  drawDirections(context) {
    const middle = [this.canvas.clientWidth - 42, this.canvas.clientHeight - 42];
    const tips = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => {
      const [right, down] = this.turned(...axis);
      return [middle[0] + 26 * right, middle[1] + 26 * down];
    });
    drawTriad(context, middle, tips);
  }
}

// Three axes in their colours, with their names at the tips.
function drawTriad(context, origin, tips) {
  tips.forEach((tip, i) => {
    context.strokeStyle = context.fillStyle = AXES[i];
    context.lineWidth = 2;
    stroke(context, origin, tip);
    context.fillText("xyz"[i], tip[0] + 4, tip[1]);
  });
}
