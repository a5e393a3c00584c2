// The page on which keypoints are clicked on photographs, and the file of points that it saves.

const craft = blockOf("craft"), task = blockOf("task");
const names = craft.keypoints.map(({ name }) => name);
const points = Object.fromEntries(task.photos.map((photo) => [photo, {}]));   // photograph → name → [u, v] px
let photo = task.photos[0], image = null, chosen = names[0], isSaved = true;

const screen = new Screen(byId("photo"), () => draw(), (x, y) => place(screen.pixelAt(x, y)));
byId("photo").ondblclick = null;   // two clicks may be meant for two keypoints
const arrivals = new Arrivals();
const view = new MeshView(byId("mesh"), craft, {
  clicked: (vertex, x, y) => { const name = view.keypointAt(x, y); if (name !== null) choose(name); },
});
view.keypoints = new Map(craft.keypoints.map(({ name, at }) => [name, at]));

function show(name) {
  photo = name;
  image = null;
  byId("photos").value = photo;
  byId("note").textContent = "";
  screen.reset();
  arrivals.begin();
  arrivals.load(encodeURIComponent(photo), (loaded) => {
    const { naturalWidth: W, naturalHeight: H } = loaded;
    if (W !== task.width_px || H !== task.height_px)
      byId("note").textContent = `${photo} is ${W} × ${H} pixels here, but the camera's are ${task.width_px} × ${task.height_px}.`;
    else image = loaded;
    draw();
  }, () => { byId("note").textContent = `${photo} is not beside this page.`; });
  choose(names.find((each) => !points[photo][each]) ?? names[0]);
}

function step(by) {
  show(task.photos[Math.min(Math.max(task.photos.indexOf(photo) + by, 0), task.photos.length - 1)]);
}

function choose(name) {
  chosen = view.chosen = name;
  update();
}

// Put the chosen keypoint somewhere on the photograph, and choose the next that has no place.
function place([u, v]) {
  if (!image || u < -0.5 || v < -0.5 || u > task.width_px - 0.5 || v > task.height_px - 0.5) return;
  const isNew = !points[photo][chosen], at = names.indexOf(chosen);
  points[photo][chosen] = [u, v].map((value) => Number(value.toFixed(2)));
  isSaved = false;
  const rest = [...names.slice(at + 1), ...names.slice(0, at)].find((name) => !points[photo][name]);
  choose(isNew && rest ? rest : chosen);
}

function nudge(right, down) {
  const point = points[photo][chosen];
  if (!point) return;
  points[photo][chosen] = [point[0] + right / screen.scale, point[1] + down / screen.scale].map((value) => Number(value.toFixed(2)));
  isSaved = false;
  update();
}

function remove(name) {
  delete points[photo][name];
  isSaved = false;
  choose(name);
}

function update() {
  byId("points").tBodies[0].replaceChildren();
  for (const name of names) listRow(name);
  for (const option of byId("photos").options) option.textContent = `${option.value} (${Object.keys(points[option.value]).length})`;
  byId("saved").textContent = isSaved ? "" : "not saved yet";
  draw();
}

function listRow(name) {
  const point = points[photo][name];
  const row = make(byId("points").tBodies[0], "tr", { className: name === chosen ? "chosen" : "" });
  row.onclick = () => choose(name);
  make(row, "td", { textContent: name });
  for (const i of [0, 1]) make(row, "td", { textContent: point ? point[i].toFixed(1) : "" });
  const last = make(row, "td");
  if (point) make(last, "button", { type: "button", textContent: "×", title: `Remove ${name}`,
    onclick: (event) => { event.stopPropagation(); remove(name); } });
  if (name === chosen) row.scrollIntoView({ block: "nearest" });
}

function draw() {
  const { width_px: W, height_px: H } = task, context = screen.begin(W, H), line = 1 / screen.scale;
  if (image) {
    context.filter = `brightness(${2 ** byId("gain").value})`;
    context.drawImage(image, 0, 0, W, H);
    context.filter = "none";
  }
  context.translate(0.5, 0.5);   // a pixel's centre is a whole number
  context.strokeStyle = "#58e07a66";
  context.lineWidth = line;
  for (const [a, b] of craft.skeleton) stroke(context, points[photo][a], points[photo][b]);
  context.font = `12px sans-serif`;
  for (const [name, [u, v]] of Object.entries(points[photo])) drawPoint(context, name, u, v, line);
  view.draw();
}

// A cross that leaves its middle free.
function drawPoint(context, name, u, v, line) {
  context.strokeStyle = context.fillStyle = name === chosen ? CHOSEN : PLACE;
  context.lineWidth = 1.5 * line;
  for (const [x, y] of [[1, 0], [-1, 0], [0, 1], [0, -1]])
    stroke(context, [u + 3 * line * x, v + 3 * line * y], [u + 10 * line * x, v + 10 * line * y]);
  context.font = `${12 * line}px sans-serif`;
  words(context, name, u + 7 * line, v - 6 * line, line);
}

function save() {
  const placed = Object.fromEntries(Object.entries(points).filter(([, of]) => Object.keys(of).length));
  const text = `${JSON.stringify({ spacecraft: craft.name, photos: placed }, null, 1)}\n`;
  const url = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  Object.assign(document.createElement("a"), { href: url, download: "points.json" }).click();
  URL.revokeObjectURL(url);
  isSaved = true;
  byId("saved").textContent = "Saved among your downloads.";
}

// The points of a file that was saved before, in place of those here.
async function open(file) {
  let told = "";
  try {
    const value = JSON.parse(await file.text());
    if (value.spacecraft !== craft.name) throw new Error(`its points are of ${value.spacecraft}`);
    for (const name of task.photos) points[name] = { ...value.photos[name] };
    isSaved = true;
    show(photo);
  } catch (error) {
    told = `${file.name}: not points of ${craft.name}: ${error.message}`;
  }
  byId("saved").textContent = told;
}

for (const name of task.photos) make(byId("photos"), "option", { value: name });
byId("photos").onchange = (event) => show(event.target.value);
byId("previous").onclick = () => step(-1);
byId("next").onclick = () => step(1);
byId("whole").onclick = () => { screen.reset(); draw(); };
byId("gain").oninput = draw;
byId("save").onclick = save;
byId("open").onclick = () => {
  byId("file").value = "";   // so that the same file can be opened again
  byId("file").click();
};
byId("file").onchange = (event) => { if (event.target.files.length) open(event.target.files[0]); };
window.onresize = draw;
window.onbeforeunload = (event) => { if (!isSaved) event.preventDefault(); };
document.onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select")) return;
  const far = event.shiftKey ? 10 : 1;
  const does = {
    ArrowLeft: () => nudge(-far, 0), ArrowRight: () => nudge(far, 0), ArrowUp: () => nudge(0, -far), ArrowDown: () => nudge(0, far),
    Delete: () => remove(chosen), PageUp: () => step(-1), PageDown: () => step(1),
  }[event.key];
  if (!does) return;
  does();
  event.preventDefault();
};

document.title = `Photographs of ${craft.name} – POSSE`;
byId("name").textContent = `Photographs of ${craft.name}`;
byId("command").textContent = task.command;
show(photo);
