// Drawing on canvases, and the pointer over them: what the pages of the viewer share.

const GREY = "#465361", ACCENT = "#4fb3ff", SUN = "#ffc857", TEXT = "#e3e9ef", MUTED = "#8d9aa8";
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

// Pointer handling shared by the plots: start(x, y), move(x, y, dx, dy), click(x, y), in CSS pixels.
function dragged(canvas, { start = () => {}, move, click = () => {} }) {
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
    if (moved > 3) move(x, y, dx, dy);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => {
    if (last && moved <= 3 && event.type === "pointerup") click(...last);
    last = null;
  };
}
