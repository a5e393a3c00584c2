// Drawing on canvases, and the pointer over them: what the pages of the viewer share.

const byId = (id) => document.getElementById(id);
const make = (parent, tag, properties = {}) => parent.appendChild(Object.assign(document.createElement(tag), properties));
const GREY = "#465361", ACCENT = "#4fb3ff", SUN = "#ffc857", TEXT = "#e3e9ef", MUTED = "#8d9aa8";
const AXES = ["#ff5d5d", "#5dff7f", "#6a9bff"];   // of x, y, z
const MARGIN = 10;

// A canvas's context, with as many pixels as the screen has in its area.
function fitted(canvas) {
  const width = Math.round(canvas.clientWidth * devicePixelRatio);
  const height = Math.round(canvas.clientHeight * devicePixelRatio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

function pixels(width, height, paint) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const context = canvas.getContext("2d"), data = context.createImageData(width, height);
  paint(data.data);
  context.putImageData(data, 0, 0);
  return canvas;
}

function stroke(context, from, to) {
  if (!from || !to) return;
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
}

// Words that can be read on any image: in the fill's colour, with a dark line around them.
function words(context, text, x, y, line = 1) {
  context.strokeStyle = "#000";
  context.lineWidth = 3 * line;
  context.lineJoin = "round";
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}

// The head of an arrow, filled, at its tip.
function arrowhead(context, from, tip) {
  const angle = Math.atan2(tip[1] - from[1], tip[0] - from[0]);
  context.beginPath();
  for (const turn of [-0.4, 0, 0.4]) {
    const back = turn ? 8 : 0;
    context.lineTo(tip[0] - back * Math.cos(angle + turn), tip[1] - back * Math.sin(angle + turn));
  }
  context.fill();
}

function ring(context, [x, y]) {
  context.strokeStyle = "#fff";
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x, y, 5, 0, 2 * Math.PI);
  context.stroke();
}

// Up to four significant digits, without an exponent where that is short.
function short(value) {
  return String(Number(value.toPrecision(4)));
}

// Pointer handling shared by the plots: start(x, y), move(x, y, dx, dy, event), end() of what was moved, or
// click(x, y), in CSS pixels.
function dragged(canvas, { start = () => {}, move, end = () => {}, click = () => {} }) {
  let last = null, moved = 0;
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    last = [event.offsetX, event.offsetY];
    moved = 0;
    start(...last);
  };
  canvas.onpointermove = (event) => {
    if (!last) return;
    const [x, y] = [event.offsetX, event.offsetY], dx = x - last[0], dy = y - last[1];
    moved += Math.abs(dx) + Math.abs(dy);
    last = [x, y];
    if (moved > 3) move(x, y, dx, dy, event);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => {
    if (last && moved > 3) end();
    else if (last && event.type === "pointerup") click(...last);
    last = null;
  };
}

// A length of 1, 2 or 5 times a power of ten, about a quarter of the width, where a metre is so many CSS pixels.
function scaleBar(context, canvas, perMetre) {
  const { clientWidth: W, clientHeight: H } = canvas, wanted = W / 4 / perMetre;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const length_m = [5, 2, 1].map((k) => k * power).find((length) => length <= wanted);
  context.strokeStyle = context.fillStyle = MUTED;
  context.lineWidth = 1.5;
  stroke(context, [14, H - 12], [14 + length_m * perMetre, H - 12]);
  context.fillText(length_m >= 1000 ? `${length_m / 1000} km` : `${short(length_m)} m`, 14, H - 18);
}

// A canvas with something of W × H pixels fitted into it: the wheel zooms, dragging moves, a double click resets.
// A click may do something, click(x, y) in CSS pixels.
class Screen {
  constructor(canvas, draw, click) {
    Object.assign(this, { canvas, scale: 1 });
    this.reset();
    dragged(canvas, { move: (x, y, dx, dy) => { this.x += dx; this.y += dy; draw(); }, click });
    canvas.onwheel = (event) => { event.preventDefault(); this.turnWheel(event); draw(); };
    canvas.ondblclick = () => { this.reset(); draw(); };
  }

  // zoom over the fitted size, and the shift of the image's middle, screen px
  reset() { Object.assign(this, { zoom: 1, x: 0, y: 0 }); }

  // What is under the pointer stays there.
  turnWheel({ deltaY, offsetX, offsetY }) {
    const zoom = Math.min(Math.max(this.zoom * Math.exp(-deltaY / 400), 1), 64), by = zoom / this.zoom;
    const { clientWidth, clientHeight } = this.canvas;
    this.x = zoom === 1 ? 0 : by * this.x + (1 - by) * (offsetX - clientWidth / 2);
    this.y = zoom === 1 ? 0 : by * this.y + (1 - by) * (offsetY - clientHeight / 2);
    this.zoom = zoom;
  }

  // A context whose unit is a pixel, from the left upper corner of the first one, on an empty ground.
  begin(W, H) {
    const { canvas } = this, context = fitted(canvas), ratio = devicePixelRatio;
    const scale = this.scale = Math.min(canvas.clientWidth / W, canvas.clientHeight / H) * this.zoom;
    const left = this.left = canvas.clientWidth / 2 + this.x - scale * W / 2;
    const top = this.top = canvas.clientHeight / 2 + this.y - scale * H / 2;
    context.setTransform(ratio * scale, 0, 0, ratio * scale, ratio * left, ratio * top);
    context.imageSmoothingEnabled = scale < 2;
    context.fillStyle = "#07090b";
    context.fillRect(0, 0, W, H);
    return context;
  }

  // What is at a place of the canvas, CSS pixels, in label coordinates: the first pixel's centre is at [0, 0].
  pixelAt(x, y) { return [(x - this.left) / this.scale - 0.5, (y - this.top) / this.scale - 0.5]; }
}

// Images that are loaded for one frame after another; those that arrive when the next has begun are dropped.
class Arrivals {
  turn = 0;

  begin() { this.turn++; }

  load(source, done, failed = () => {}) {
    const image = new Image(), turn = this.turn;
    image.onload = () => { if (turn === this.turn) done(image); };
    image.onerror = () => { if (turn === this.turn) failed(); };
    image.src = source;
  }

  // The page's preview, if there is one, until the image itself arrives; note(text) says what is missing.
  loadBest(jpeg, url, done, note) {
    let whole = false;
    note("");
    if (jpeg) this.load(`data:image/jpeg;base64,${jpeg}`, (image) => { if (!whole) done(image); });
    this.load(url, (image) => { whole = true; done(image); },
      () => note(jpeg ? "preview; the image is not beside this page"
        : "the image is not beside this page, and the page has no preview of it"));
  }
}
