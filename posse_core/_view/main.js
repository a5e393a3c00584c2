// What the user does, and what is drawn after it. All that can change is in state and in picture.

const byId = (id) => document.getElementById(id);
const state = { current: 0, kept: [], filters: {}, crafts: new Set(Object.keys(dataset.spacecraft)) };
const THUMB = 114;   // px from one small image to the next

const histograms = QUANTITIES.map((quantity) =>
  new Histogram(quantity, (limits) => setFilter(quantity.name, limits)));

function setFilter(name, limits) {
  if (limits) state.filters[name] = limits;
  else delete state.filters[name];
  refilter();
}

function refilter() {
  state.kept = passing(state.filters, state.crafts);
  const kept = state.kept;
  byId("scrub").max = Math.max(kept.length - 1, 0);
  byId("belt").style.width = `${kept.length * THUMB + 6}px`;
  const of = count === dataset.frames ? `${count} frames` : `${count} frames shown, of ${dataset.frames} in the dataset`;
  byId("summary").textContent = kept.length === count ? of : `${kept.length} of ${of}`;
  byId("clear").hidden = kept.length === count && !Object.keys(state.filters).length;
  for (const thumb of [...byId("belt").children]) thumb.remove();
  if (kept.length && !kept.includes(state.current)) select(kept.find((p) => p > state.current) ?? kept.at(-1));
  else drawAll();
}

function select(position) {
  state.current = position;
  history.replaceState(null, "", `#${columns.index[position]}`);
  picture.show(position);
  const frame = picture.frame;
  for (const overlay of OVERLAYS) overlay.label.classList.toggle("off", !overlay.has(frame));
  byId("labels").textContent = JSON.stringify(frame.labels, null, 1);
  byId("go").value = columns.index[position];
  showFacts(frame.labels);
  drawAll();
}

function step(by) {
  const at = state.kept.indexOf(state.current), n = state.kept.length;
  if (n) select(state.kept[Math.min(Math.max(at + by, 0), n - 1)]);
}

let waiting = false;
function drawAll() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    const { kept, current, filters } = state, at = kept.indexOf(current);
    picture.draw();
    orbit.draw(kept, current);
    sphere.draw(kept, current);
    histograms.forEach((plot) => plot.draw(kept, current, filters[plot.quantity.name]));
    byId("scrub").value = Math.max(at, 0);
    const strip = byId("strip"), left = at * THUMB;
    if (left < strip.scrollLeft || left + THUMB > strip.scrollLeft + strip.clientWidth)
      strip.scrollLeft = left - strip.clientWidth / 2;
    drawStrip();
  });
}

// Only the small images that can be seen are there.
function drawStrip() {
  const strip = byId("strip"), belt = byId("belt"), { kept } = state;
  const first = Math.max(0, Math.floor(strip.scrollLeft / THUMB) - 1);
  const last = Math.min(kept.length, first + Math.ceil(strip.clientWidth / THUMB) + 3);
  const there = new Map([...belt.children].map((thumb) => [Number(thumb.dataset.at), thumb]));
  for (const [at, thumb] of there) if (at < first || at >= last) thumb.remove();
  for (let at = first; at < last; at++) {
    const thumb = there.get(at) ?? belt.appendChild(makeThumb(at));
    thumb.classList.toggle("current", kept[at] === state.current);
  }
}

function makeThumb(at) {
  const position = state.kept[at], { preview, labels } = frameAt(position);
  const thumb = Object.assign(document.createElement("button"), { className: "thumb", type: "button" });
  const number = Object.assign(document.createElement("span"), { textContent: columns.index[position] });
  const image = Object.assign(document.createElement("img"), { alt: "" });
  image.src = preview ? `data:image/jpeg;base64,${preview.jpeg}` : imageUrl(labels);
  thumb.dataset.at = at;
  thumb.style.left = `${6 + at * THUMB}px`;
  thumb.onclick = () => select(position);
  thumb.append(image, number);
  return thumb;
}

function showFacts(labels) {
  const number = (value, digits, unit = "") =>
    value === null || value === undefined ? "–" : `${value.toFixed(digits)}${unit}`;
  const points = labels.keypoints && Object.values(labels.keypoints);
  const rows = {
    "UTC": labels.epoch_utc.slice(0, 23).replace("T", " "),
    "Time": number(labels.t_s, 1, " s"),
    "Spacecraft, sequence": `${labels.spacecraft}, ${labels.sequence}`,
    "Range": number(labels.range_m, 3, " m"),
    "Phase angle": number(labels.phase_angle_rad && labels.phase_angle_rad * DEG, 2, "°"),
    "Lit, in the image": `${number(labels.fraction_lit, 3)}, ${number(labels.fraction_visible, 3)}`,
    "Keypoints seen": points ? `${points.filter((p) => p[2] === 2).length} of ${points.length}` : "–",
    "Sun at target, camera": `${number(labels.sun_fraction_target, 3)}, ${number(labels.sun_fraction_camera, 3)}`,
    "Solar flux": number(labels.solar_flux_w_m2, 1, " W/m²"),
    "Box": labels.box_visible_px ? `${labels.box_visible_px.join(", ")} px` : "–",
  };
  byId("facts").replaceChildren(...Object.entries(rows).map(([name, value]) => {
    const row = document.createElement("tr");
    for (const [tag, text] of [["th", name], ["td", value]])
      row.append(Object.assign(document.createElement(tag), { textContent: text }));
    return row;
  }));
}

function checkbox(parent, title, colour, checked, changed) {
  const label = document.createElement("label"), swatch = document.createElement("span");
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked });
  Object.assign(swatch, { className: "swatch" }).style.background = colour;
  box.onchange = () => changed(box.checked);
  label.append(box, swatch, title);
  parent.append(label);
  return label;
}

for (const overlay of OVERLAYS) {
  overlay.label = checkbox(byId("overlays"), overlay.title, overlay.colour, picture.shown.has(overlay.name),
    (on) => { on ? picture.shown.add(overlay.name) : picture.shown.delete(overlay.name); picture.draw(); });
  overlay.label.title = `Key ${overlay.key}`;
}
const gain = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 6, step: 0.25, value: 0 });
gain.oninput = () => { picture.gain = 2 ** gain.value; picture.draw(); };
const brightness = document.createElement("label");
brightness.append("Brightness", gain);
byId("overlays").append(brightness);

if (state.crafts.size > 1) for (const name of [...state.crafts])
  checkbox(byId("craft-filter"), name, ACCENT, true,
    (on) => { on ? state.crafts.add(name) : state.crafts.delete(name); refilter(); });

byId("clear").onclick = () => { state.filters = {}; refilter(); };
byId("previous").onclick = () => step(-1);
byId("next").onclick = () => step(1);
byId("scrub").oninput = (event) => { if (state.kept.length) select(state.kept[event.target.value]); };
byId("go").onchange = (event) => selectIndex(Number(event.target.value));
byId("strip").onscroll = drawStrip;
let player = null;
byId("play").onclick = () => {
  player = player ? clearInterval(player) : setInterval(() =>
    state.current === state.kept.at(-1) ? select(state.kept[0]) : step(1), 250);
  byId("play").textContent = player ? "Stop" : "Play";
};

function selectIndex(index) {
  const position = columns.index.indexOf(index);
  select(position < 0 ? state.current : position);
}

document.onkeydown = (event) => {
  if (event.target.matches("input[type=number]") || event.ctrlKey || event.metaKey || event.altKey) return;
  const overlay = OVERLAYS.find(({ key }) => key === event.key);
  if (overlay) overlay.label.querySelector("input").click();
  else if (event.key === "ArrowLeft") step(-1);
  else if (event.key === "ArrowRight") step(1);
  else if (event.key === "Home") step(-Infinity);
  else if (event.key === "End") step(Infinity);
  else if (event.key === " ") byId("play").click();
  else return;
  event.preventDefault();
};

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
dragged(orbit.canvas, { move: (x, y, dx, dy) => {
  orbit.yaw += dx / 120;
  orbit.pitch = Math.min(Math.max(orbit.pitch + dy / 120, -Math.PI / 2), Math.PI / 2);
  orbit.draw(state.kept, state.current);
} });
orbit.canvas.onwheel = (event) => {
  event.preventDefault();
  orbit.zoom *= Math.exp(-event.deltaY / 500);
  orbit.draw(state.kept, state.current);
};
dragged(sphere.canvas, { move: () => {}, click: (x, y) => {
  const position = sphere.nearest(state.kept, x, y);
  if (position !== undefined) select(position);
} });
window.onresize = drawAll;

document.title = `${dataset.name} – POSSE`;
byId("name").textContent = dataset.name;
byId("manifest").textContent = dataset.manifest ? JSON.stringify(dataset.manifest, null, 2)
  : "The run has not ended: there is no manifest yet.";
refilter();
selectIndex(Number(location.hash.slice(1)) || columns.index[0]);
