// The page on which keypoints are picked: its list of them, and the YAML that it saves.

const craft = blockOf("craft");
// {name, at: [x, y, z] metres, joint: name or null, part: index or -1 where it is at no vertex}
const keypoints = craft.keypoints.map((point) => ({ ...point }));
const skeleton = craft.skeleton.map((pair) => [...pair]);
const NAME = /^[A-Za-z][\w.-]*$/;
let chosen = null;

const view = new MeshView(byId("mesh"), craft, {
  pointed: (vertex) => { byId("note").textContent = vertex < 0 ? "" : about(vertex); },
  clicked: (vertex, x, y) => {
    const name = view.keypointAt(x, y);
    if (name !== null) choose(keypoints.find((point) => point.name === name));
    else if (vertex >= 0) add(vertex);
  },
});

function about(vertex) {
  return `${craft.parts[view.partOf[vertex]].name}: ${view.position(vertex).map((value) => value.toFixed(3)).join(", ")} m`;
}

function add(vertex) {
  const part = view.partOf[vertex], at = view.position(vertex), { category, joint } = craft.parts[part];
  const letter = byId("category").value || category || (at[2] < 0 ? "T" : "B");
  choose(keypoints[keypoints.push({ name: freeName(letter), at, joint, part }) - 1]);
}

function freeName(letter) {
  for (let number = 1; ; number++) if (!keypoints.some(({ name }) => name === `${letter}${number}`)) return `${letter}${number}`;
}

function remove(point) {
  keypoints.splice(keypoints.indexOf(point), 1);
  for (let i = skeleton.length; i--;) if (skeleton[i].includes(point.name)) skeleton.splice(i, 1);
  choose(chosen === point ? null : chosen);
}

// What is wrong with a new name of a keypoint; nothing if it may have it.
function faultOf(point, name) {
  if (!NAME.test(name)) return "A name begins with a letter and has letters, digits, _, . and - only.";
  return keypoints.some((other) => other !== point && other.name === name) ? `There is another ${name}.` : "";
}

function rename(point, name) {
  for (const pair of skeleton) pair.forEach((end, i) => { if (end === point.name) pair[i] = name; });
  point.name = name;
  choose(point);
}

function choose(point) {
  chosen = point;
  view.chosen = point && point.name;
  view.keypoints = new Map(keypoints.map(({ name, at }) => [name, at]));
  byId("points").tBodies[0].replaceChildren();
  for (const each of keypoints) listRow(each);
  byId("yaml").value = written();
  byId("saved").textContent = "";
  view.draw();
}

function listRow(point) {
  const row = make(byId("points").tBodies[0], "tr", { className: point === chosen ? "chosen" : "" });
  row.onclick = (event) => { if (event.target.tagName === "TD" && point !== chosen) choose(point); };
  const name = make(make(row, "td"), "input", { value: point.name, ariaLabel: `Name of ${point.name}` });
  name.oninput = () => {
    name.setCustomValidity(faultOf(point, name.value));
    byId("saved").textContent = name.validationMessage;
  };
  name.onchange = () => rename(point, name.validity.valid ? name.value : point.name);
  for (const value of point.at) make(row, "td", { textContent: value.toFixed(3) });
  make(row, "td", { textContent: point.part < 0 ? "–" : craft.parts[point.part].name });
  const button = make(make(row, "td"), "button", { type: "button", textContent: "×", title: `Remove ${point.name}` });
  button.onclick = () => remove(point);
  if (point === chosen) row.scrollIntoView({ block: "nearest" });
}

// Metres to 1e-6, as 'posse import' writes them; YAML would take 1e-6 itself for a word.
function number(value) {
  return value.toFixed(6).replace(/(\.\d+?)0+$/, "$1").replace(/^-(0\.0)$/, "$1");
}

const triple = (point) => `[${point.map(number).join(", ")}]`;
// A plain word such as no or 1e5 is none of text to YAML.
const key = (name) => (/^[A-Z]+\d+$/.test(name) ? name : JSON.stringify(name));

function written() {
  const hasJoints = craft.parts.some(({ joint }) => joint !== null);
  const lines = keypoints.map(({ name, at, joint }) =>
    `  ${key(name)}: ${hasJoints ? `{"at": ${triple(at)}, "joint": ${JSON.stringify(joint)}}` : triple(at)}`);
  const rows = (pairs) => JSON.stringify(pairs).replaceAll(",", ", ");
  return [`measured_from_m: ${JSON.stringify(blockOf("measured_from_m")).replaceAll(",", ", ")}`, lines.length ? "keypoints:" : "keypoints: {}", ...lines, `skeleton: ${rows(skeleton)}`,
    `symmetries: ${rows(craft.symmetries)}`, ""].join("\n");
}

byId("copy").onclick = () => {
  byId("yaml").select();
  const by = navigator.clipboard?.writeText(byId("yaml").value) ?? Promise.reject();
  by.then(() => "Copied.", () => "Press Ctrl+C to copy.").then((text) => { byId("saved").textContent = text; });
};
byId("save").onclick = () => {
  const url = URL.createObjectURL(new Blob([byId("yaml").value], { type: "application/yaml" }));
  Object.assign(document.createElement("a"), { href: url, download: "keypoints.yaml" }).click();
  URL.revokeObjectURL(url);
  byId("saved").textContent = "Saved among your downloads.";
};
byId("whole").onclick = () => { view.reset(); view.draw(); };
window.onresize = () => view.draw();
document.onkeydown = (event) => {
  if (event.key === "Delete" && chosen && !event.target.matches("input, textarea")) remove(chosen);
};

document.title = `Keypoints of ${craft.name} – POSSE`;
byId("name").textContent = `Keypoints of ${craft.name}`;
choose(null);
