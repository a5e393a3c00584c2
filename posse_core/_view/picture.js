// The frame: its image, and its labels drawn over it.

// What can be drawn over an image, in the order of drawing; each is drawn in label coordinates, where
// ``line`` is the length of a screen pixel. A page may add its own. A frame is the camera's, or what a sensor's
// reading has of it: {labels, camera}. Labels are drawn of every body that has them.
const OVERLAYS = [
  { name: "depth", title: "Depth", key: "d", colour: "#2f9e8f", has: (f) => f.preview && f.preview.depth,
    draw: (context, frame) => { if (picture.depth) drawDepth(context, picture.depth, frame.preview.depth); } },
  { name: "mask", title: "Mask", key: "m", colour: "#3ddcff", has: (f) => some(f, "mask_rle"),
    draw: (context, frame) => drawMasks(context, frame) },
  { name: "box", title: "Box", key: "b", colour: "#ffd34d", has: (f) => some(f, "box_visible_px"),
    draw: (context, frame, line) => each(frame, "box_visible_px", (...body) => drawBoxes(context, line, ...body)) },
  { name: "axes", title: "Body axes", key: "a", colour: "#ff6b5e", has: (f) => some(f, "q_cam_from_body"),
    draw: (context, frame, line) => each(frame, "q_cam_from_body", (body, craft) => drawAxes(context, body, craft, frame.camera, line)) },
  { name: "keypoints", title: "Keypoints", key: "k", colour: "#58e07a", has: (f) => some(f, "keypoints"),
    draw: (context, frame, line) => each(frame, "keypoints", (body, craft) => drawKeypoints(context, body, craft, line)) },
  { name: "names", title: "Names", key: "n", colour: "#58e07a", has: (f) => some(f, "keypoints"),
    draw: (context, frame, line) => each(frame, "keypoints", (body) => drawNames(context, body, line)) },
];
const VISIBILITY = { 1: "#ff9f43", 2: "#58e07a" };   // hidden, seen; 0 is out of the image
// Of masks and boxes: those of the target, then those of the bodies beside it, in turn.
const MASKS = [[61, 220, 255], [199, 146, 255], [255, 159, 107], [155, 229, 100]];
const BOXES = ["#ffd34d", "#c792ff", "#ff9f6b", "#9be564"];
const ofBody = (colours, number) => colours[number && 1 + (number - 1) % (colours.length - 1)];

// Whether a body of the frame has a label, and what to do with each that has it: (labels, spacecraft, number, name).
const some = (frame, label) => bodiesOf(frame.labels).some(([, body]) => body[label]);
function each(frame, label, draw) {
  bodiesOf(frame.labels).forEach(([name, body, craft], number) => { if (body[label]) draw(body, craft, number, name); });
}

const picture = {
  shown: new Set(["box", "keypoints"]),
  frame: null, image: null, depth: null, gain: 1,
  arrivals: new Arrivals(),

  show(position) {
    const frame = frameAt(position), { preview } = frame;
    Object.assign(this, { frame, image: null, depth: null });
    this.arrivals.begin();
    this.arrivals.loadBest(preview?.jpeg, urlOf(frame.labels.image), (image) => { this.image = image; this.draw(); },
      (text) => { byId("note").textContent = text; });
    if (preview?.depth) this.arrivals.load(`data:image/png;base64,${preview.depth.png}`,
      (image) => { this.depth = coloured(image, nearIsLight); this.draw(); });
    this.draw();
  },

  draw() {
    const { width_px: W, height_px: H } = dataset.camera, context = this.screen.begin(W, H);
    drawImage(context, this.image, W, H);
    drawOverlays(context, this.frame, 1 / this.screen.scale);
    showLegend(this.shown.has("depth") && this.frame.preview?.depth);
  },
};
picture.canvas = byId("picture");
picture.screen = new Screen(picture.canvas, () => picture.draw());

function drawImage(context, image, W, H) {
  if (!image) return;
  context.filter = `brightness(${picture.gain})`;
  context.drawImage(image, 0, 0, W, H);
  context.filter = "none";
}

// From then on the context is in label coordinates: a pixel's centre is a whole number.
function drawOverlays(context, frame, line) {
  context.translate(0.5, 0.5);
  for (const { name, has, draw } of OVERLAYS) if (picture.shown.has(name) && has(frame)) draw(context, frame, line);
}

function drawMasks(context, frame) {
  frame.masks ??= bodiesOf(frame.labels).map(([, body], number) =>
    body.mask_rle && maskImage(body.mask_rle, ofBody(MASKS, number)));
  for (const mask of frame.masks) if (mask) context.drawImage(mask, -0.5, -0.5);
}

function maskImage(rle, colour) {
  const [height, width] = rle.size, mask = decodeMask(rle);
  return pixels(width, height, (data) => {
    for (let i = 0; i < mask.length; i++) {
      if (!mask[i]) continue;
      const x = i % width;
      const inside = x > 0 && x < width - 1 && mask[i - 1] && mask[i + 1] && mask[i - width] && mask[i + width];
      data.set([...colour, inside ? 80 : 255], 4 * i);
    }
  });
}

const nearIsLight = (share) => ramp(1 - share);

// Grey steps 1 … 255 of an image → the colours of 0 … 1, none where the step is 0.
function coloured(image, colour) {
  const { width, height } = image;
  const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
  copy.drawImage(image, 0, 0);
  const steps = copy.getImageData(0, 0, width, height).data;
  return pixels(width, height, (data) => {
    for (let i = 0; i < data.length; i += 4)
      if (steps[i]) data.set([...colour((steps[i] - 1) / 254), 255], i);
  });
}

function drawDepth(context, image, { box: [x, y, w, h] }) {
  context.imageSmoothingEnabled = false;
  context.drawImage(image, x - 0.5, y - 0.5, w, h);
}

function showLegend(depth) {
  byId("legend").hidden = !depth;
  if (!depth) return;
  byId("near").textContent = `${depth.low.toFixed(2)} m`;
  byId("far").textContent = `${depth.high.toFixed(2)} m`;
  const canvas = byId("ramp"), context = canvas.getContext("2d");
  for (let x = 0; x < canvas.width; x++) {
    context.fillStyle = `rgb(${ramp(1 - x / canvas.width)})`;
    context.fillRect(x, 0, 1, canvas.height);
  }
}

// A body beside the target has its name at its box.
function drawBoxes(context, line, labels, craft, number, name) {
  context.strokeStyle = context.fillStyle = ofBody(BOXES, number);
  context.lineWidth = 1.5 * line;
  const [x, y, w, h] = labels.box_visible_px;
  if (name) {
    context.font = `bold ${12 * line}px sans-serif`;
    context.fillText(name, x - 0.5, y - 0.5 - 4 * line);
  }
  context.strokeRect(x - 0.5, y - 0.5, w, h);   // counts pixels: from border to border
  if (!labels.box_whole_px) return;
  context.setLineDash([5 * line, 4 * line]);
  context.lineWidth = line;
  context.strokeRect(...labels.box_whole_px);
  context.setLineDash([]);
}

function drawAxes(context, labels, craft, camera, line) {
  const [origin, ...tips] = bodyAxes(labels, camera, craft);
  context.lineWidth = 2.5 * line;
  context.font = `bold ${13 * line}px sans-serif`;
  tips.forEach((tip, i) => {
    context.strokeStyle = context.fillStyle = AXES[i];
    stroke(context, origin, tip);
    if (tip) context.fillText("xyz"[i], tip[0] + 4 * line, tip[1]);
  });
}

function drawKeypoints(context, labels, { skeleton }, line) {
  context.strokeStyle = "#58e07a99";
  context.lineWidth = line;
  for (const [a, b] of skeleton) {
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
    if (visibility) words(context, name, u + 6 * line, v - 5 * line, line);
  }
}
