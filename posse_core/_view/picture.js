// The frame: its image, and its labels drawn over it.

// What can be drawn over the image, in the order of drawing; each is drawn in label coordinates, where
// ``line`` is the length of a screen pixel. A page may add its own.
const OVERLAYS = [
  { name: "depth", title: "Depth", key: "d", colour: "#2f9e8f", has: (f) => f.preview && f.preview.depth,
    draw: (context, frame) => { if (picture.depth) drawDepth(context, picture.depth, frame.preview.depth); } },
  { name: "mask", title: "Mask", key: "m", colour: "#3ddcff", has: (f) => f.labels.mask_rle,
    draw: (context, { labels }) => context.drawImage(picture.mask ??= maskImage(labels.mask_rle), -0.5, -0.5) },
  { name: "box", title: "Box", key: "b", colour: "#ffd34d", has: (f) => f.labels.box_visible_px,
    draw: (context, { labels }, line) => drawBoxes(context, labels, line) },
  { name: "axes", title: "Body axes", key: "a", colour: "#ff6b5e", has: (f) => f.labels.q_cam_from_body,
    draw: (context, { labels }, line) => drawAxes(context, labels, line) },
  { name: "keypoints", title: "Keypoints", key: "k", colour: "#58e07a", has: (f) => f.labels.keypoints,
    draw: (context, { labels }, line) => drawKeypoints(context, labels, line) },
  { name: "names", title: "Names", key: "n", colour: "#58e07a", has: (f) => f.labels.keypoints,
    draw: (context, { labels }, line) => drawNames(context, labels, line) },
];
const VISIBILITY = { 1: "#ff9f43", 2: "#58e07a" };   // hidden, seen; 0 is out of the image
const AXES = ["#ff5d5d", "#5dff7f", "#6a9bff"];

const picture = {
  canvas: document.getElementById("picture"),
  shown: new Set(["box", "keypoints"]),
  frame: null, image: null, depth: null, mask: null, gain: 1,
  zoom: 1, x: 0, y: 0,   // zoom over the fitted size, and the shift of the image's middle, screen px
  turn: 0,               // counts frames, so that an image which arrives late is not drawn

  show(position) {
    const turn = ++this.turn, frame = frameAt(position), note = document.getElementById("note");
    Object.assign(this, { frame, image: null, depth: null, mask: null });
    const preview = frame.preview;
    note.textContent = "";
    let whole = false;
    const load = (source, done, failed) => {
      const image = new Image();
      image.onload = () => { if (turn === this.turn) { done(image); this.draw(); } };
      image.onerror = () => { if (turn === this.turn) failed(); };
      image.src = source;
    };
    if (preview) {
      load(`data:image/jpeg;base64,${preview.jpeg}`, (image) => { if (!whole) this.image = image; }, () => {});
      if (preview.depth) load(`data:image/png;base64,${preview.depth.png}`,
        (image) => { this.depth = coloured(image); }, () => {});
    }
    load(imageUrl(frame.labels),
      (image) => { whole = true; this.image = image; },
      () => { note.textContent = preview ? "preview; the image is not beside this page"
        : "the image is not beside this page, and the page has no preview of it"; });
    this.draw();
  },

  draw() {
    const canvas = this.canvas, context = fitted(canvas);
    const { width_px: W, height_px: H } = dataset.camera, ratio = devicePixelRatio;
    const scale = Math.min(canvas.clientWidth / W, canvas.clientHeight / H) * this.zoom;
    this.scale = scale;
    this.left = canvas.clientWidth / 2 + this.x - scale * W / 2;
    this.top = canvas.clientHeight / 2 + this.y - scale * H / 2;
    context.setTransform(ratio * scale, 0, 0, ratio * scale, ratio * this.left, ratio * this.top);
    context.imageSmoothingEnabled = scale < 2;
    context.fillStyle = "#07090b";
    context.fillRect(0, 0, W, H);
    if (this.image) {
      context.filter = `brightness(${this.gain})`;
      context.drawImage(this.image, 0, 0, W, H);
      context.filter = "none";
    }
    // From here on in label coordinates: a pixel's centre is a whole number.
    context.translate(0.5, 0.5);
    const shown = OVERLAYS.filter(({ name, has }) => this.shown.has(name) && has(this.frame));
    for (const overlay of shown) overlay.draw(context, this.frame, 1 / scale);
    showLegend(shown.some(({ name }) => name === "depth") ? this.frame.preview.depth : null);
  },
};

function maskImage(rle) {
  const [height, width] = rle.size, mask = decodeMask(rle);
  return pixels(width, height, (data) => {
    for (let i = 0; i < mask.length; i++) {
      if (!mask[i]) continue;
      const x = i % width;
      const inside = x > 0 && x < width - 1 && mask[i - 1] && mask[i + 1] && mask[i - width] && mask[i + width];
      data.set([61, 220, 255, inside ? 80 : 255], 4 * i);
    }
  });
}

// Grey steps of the preview → colours, none where the step is 0.
function coloured(image) {
  const { width, height } = image;
  const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
  copy.drawImage(image, 0, 0);
  const steps = copy.getImageData(0, 0, width, height).data;
  return pixels(width, height, (data) => {
    for (let i = 0; i < data.length; i += 4)
      if (steps[i]) data.set([...ramp(1 - (steps[i] - 1) / 254), 255], i);
  });
}

function drawDepth(context, image, { box: [x, y, w, h] }) {
  context.imageSmoothingEnabled = false;
  context.drawImage(image, x - 0.5, y - 0.5, w, h);
}

function showLegend(depth) {
  document.getElementById("legend").hidden = !depth;
  if (!depth) return;
  document.getElementById("near").textContent = `${depth.near_m.toFixed(2)} m`;
  document.getElementById("far").textContent = `${depth.far_m.toFixed(2)} m`;
  const canvas = document.getElementById("ramp"), context = canvas.getContext("2d");
  for (let x = 0; x < canvas.width; x++) {
    context.fillStyle = `rgb(${ramp(1 - x / canvas.width)})`;
    context.fillRect(x, 0, 1, canvas.height);
  }
}

function drawBoxes(context, labels, line) {
  context.strokeStyle = "#ffd34d";
  context.lineWidth = 1.5 * line;
  const [x, y, w, h] = labels.box_visible_px;
  context.strokeRect(x - 0.5, y - 0.5, w, h);   // counts pixels: from border to border
  if (!labels.box_whole_px) return;
  context.setLineDash([5 * line, 4 * line]);
  context.lineWidth = line;
  context.strokeRect(...labels.box_whole_px);
  context.setLineDash([]);
}

function drawAxes(context, labels, line) {
  const [origin, ...tips] = bodyAxes(labels);
  context.lineWidth = 2.5 * line;
  context.font = `bold ${13 * line}px sans-serif`;
  tips.forEach((tip, i) => {
    context.strokeStyle = context.fillStyle = AXES[i];
    stroke(context, origin, tip);
    if (tip) context.fillText("xyz"[i], tip[0] + 4 * line, tip[1]);
  });
}

function drawKeypoints(context, labels, line) {
  context.strokeStyle = "#58e07a99";
  context.lineWidth = line;
  for (const [a, b] of dataset.spacecraft[labels.spacecraft].skeleton) {
    const [from, to] = [labels.keypoints[a], labels.keypoints[b]];
    if (from && to && from[0] !== null && to[0] !== null)
      stroke(context, from.slice(0, 2), to.slice(0, 2));
  }
  context.lineWidth = 1.5 * line;
  for (const [u, v, visibility] of Object.values(labels.keypoints)) {
    if (!visibility) continue;
    context.fillStyle = context.strokeStyle = VISIBILITY[visibility];
    context.beginPath();
    context.arc(u, v, 3.5 * line, 0, 2 * Math.PI);
    visibility === 2 ? context.fill() : context.stroke();
  }
}

function drawNames(context, labels, line) {
  context.font = `${11 * line}px sans-serif`;
  for (const [name, [u, v, visibility]] of Object.entries(labels.keypoints)) {
    context.fillStyle = VISIBILITY[visibility];
    if (visibility) context.fillText(name, u + 6 * line, v - 5 * line);
  }
}

dragged(picture.canvas, { move: (x, y, dx, dy) => { picture.x += dx; picture.y += dy; picture.draw(); } });
picture.canvas.onwheel = (event) => {
  event.preventDefault();
  const zoom = Math.min(Math.max(picture.zoom * Math.exp(-event.deltaY / 400), 1), 64), by = zoom / picture.zoom;
  // What is under the pointer stays there.
  const { clientWidth: W, clientHeight: H } = picture.canvas;
  picture.x = by * picture.x + (1 - by) * (event.offsetX - W / 2);
  picture.y = by * picture.y + (1 - by) * (event.offsetY - H / 2);
  if (zoom === 1) picture.x = picture.y = 0;
  picture.zoom = zoom;
  picture.draw();
};
picture.canvas.ondblclick = () => { Object.assign(picture, { zoom: 1, x: 0, y: 0 }); picture.draw(); };
