// Which frame is shown, and how the user goes from one to another: slider, strip, keys, address. A page
// defines what it shows of a frame, showFrame(frame), and its plots, drawPlots().

const state = { current: 0, kept: [] };   // positions: of the frame shown, and of those that are gone through
const THUMB = 114;   // px from one small image to the next

// Go through these frames from now on; their order ascends.
function keep(kept) {
  state.kept = kept;
  byId("scrub").max = Math.max(kept.length - 1, 0);
  byId("belt").style.width = `${kept.length * THUMB + 6}px`;
  for (const thumb of [...byId("belt").children]) thumb.remove();
  if (kept.length && !kept.includes(state.current)) select(kept.find((p) => p > state.current) ?? kept.at(-1));
  else moveSlider();
}

// The slider is right in a page that is not drawn too, such as one in a hidden tab.
function moveSlider() {
  byId("scrub").value = Math.max(state.kept.indexOf(state.current), 0);
  drawAll();
}

function select(position, at = 0) {
  state.current = position;
  picture.show(position);
  const frame = picture.frame;
  sensors.show(frame, at);
  for (const overlay of OVERLAYS) overlay.label.classList.toggle("off", !overlay.has(frame));
  byId("go").value = columns.index[position];
  showFrame(frame);
  moveSlider();
}

// The address leads to the frame, and to a later instant of its readings.
function setAddress() {
  const { at } = sensors;
  history.replaceState(null, "", `#frame=${columns.index[state.current]}${at ? `&reading=${at}` : ""}`);
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
    const at = state.kept.indexOf(state.current);
    picture.draw();
    sensors.draw();
    drawPlots();
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
  image.src = preview ? `data:image/jpeg;base64,${preview.jpeg}` : urlOf(labels.image);
  thumb.dataset.at = at;
  thumb.style.left = `${6 + at * THUMB}px`;
  thumb.onclick = () => select(position);
  thumb.append(image, number);
  return thumb;
}

// Fill the table of facts with rows, {name: text}.
function fillFacts(rows) {
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
    (on) => { on ? picture.shown.add(overlay.name) : picture.shown.delete(overlay.name); drawAll(); });
  overlay.label.title = `Key ${overlay.key}`;
}
const gain = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 6, step: 0.25, value: 0 });
gain.oninput = () => { picture.gain = 2 ** gain.value; drawAll(); };
const brightness = document.createElement("label");
brightness.append("Brightness", gain);
byId("overlays").append(brightness);

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

// What the address names, #frame=INDEX&reading=NUMBER of an instant of its readings, or the first frame.
function selectAddressed() {
  const named = new URLSearchParams(location.hash.slice(1));
  select(Math.max(columns.index.indexOf(Number(named.get("frame") ?? NaN)), 0), Number(named.get("reading")) || 0);
}
window.onhashchange = selectAddressed;
window.onresize = drawAll;

document.onkeydown = (event) => {
  if (event.target.matches("input[type=number]") || event.ctrlKey || event.metaKey || event.altKey) return;
  const overlay = OVERLAYS.find(({ key }) => key === event.key);
  if (overlay) overlay.label.querySelector("input").click();
  else if (event.key === "ArrowLeft") step(-1);
  else if (event.key === "ArrowRight") step(1);
  else if (event.key === ",") stepReading(-1);
  else if (event.key === ".") stepReading(1);
  else if (event.key === "Home") step(-Infinity);
  else if (event.key === "End") step(Infinity);
  else if (event.key === " ") byId("play").click();
  else return;
  event.preventDefault();
};
