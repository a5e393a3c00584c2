// The page of a dataset: its filters, and what is drawn after them.

Object.assign(state, { filters: {}, crafts: new Set(Object.keys(dataset.spacecraft)) });

const histograms = QUANTITIES.map((quantity) =>
  new Histogram(quantity, (limits) => setFilter(quantity.name, limits)));

// Places of the frames that pass: filters is {quantity: [low, high]}, in the label's unit, both
// ends included; crafts is a Set of names. A frame without the label does not pass its filter.
function passing(filters, crafts) {
  const positions = [];
  const tests = Object.entries(filters).map(([name, limits]) => [columns[name], ...limits]);
  for (let position = 0; position < count; position++) {
    if (!crafts.has(columns.spacecraft[position])) continue;
    if (tests.every(([column, low, high]) =>
      column[position] !== null && column[position] >= low && column[position] <= high)) positions.push(position);
  }
  return positions;
}

function setFilter(name, limits) {
  if (limits) state.filters[name] = limits;
  else delete state.filters[name];
  refilter();
}

function refilter() {
  const kept = passing(state.filters, state.crafts);
  const of = count === dataset.frames ? `${count} frames` : `${count} frames shown, of ${dataset.frames} in the dataset`;
  byId("summary").textContent = kept.length === count ? of : `${kept.length} of ${of}`;
  byId("clear").hidden = kept.length === count && !Object.keys(state.filters).length;
  keep(kept);
}

function drawPlots() {
  const { kept, current, filters } = state;
  orbit.draw(kept, current);
  sphere.draw(kept, current);
  histograms.forEach((plot) => plot.draw(kept, current, filters[plot.quantity.name]));
}

function showFrame({ labels }) {
  byId("labels").textContent = JSON.stringify(labels, null, 1);
  const number = (value, digits, unit = "") =>
    value === null || value === undefined ? "–" : `${value.toFixed(digits)}${unit}`;
  const points = labels.keypoints && Object.values(labels.keypoints);
  fillFacts({
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
    ...Object.fromEntries(bodiesOf(labels).flatMap(([name, body, craft]) => [
      ...(name ? [[name, `${body.spacecraft}, ${number(body.range_m, 3, " m")}, in the image ${number(body.fraction_visible, 3)}`]] : []),
      ...jointRows(body, craft, name),
    ])),
  });
}

// A row of each joint that moves: its value and its rate.
function jointRows(labels, craft, body) {
  return Object.entries(labels.joints ?? {}).map(([name, { value, rate }]) => {
    const slides = craft.joints[name] === "prismatic";
    const text = slides ? `${value.toFixed(4)} m, ${short(rate)} m/s`
      : `${(value * DEG).toFixed(3)}°, ${short(rate * DEG)} °/s`;
    return [body ? `${body}: joint ${name}` : `Joint ${name}`, text];
  });
}

if (state.crafts.size > 1) for (const name of [...state.crafts])
  checkbox(byId("craft-filter"), name, ACCENT, true,
    (on) => { on ? state.crafts.add(name) : state.crafts.delete(name); refilter(); });

byId("clear").onclick = () => { state.filters = {}; refilter(); };
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

document.title = `${dataset.name} – POSSE`;
byId("name").textContent = dataset.name;
byId("manifest").textContent = dataset.manifest ? JSON.stringify(dataset.manifest, null, 2)
  : "The run has not ended: there is no manifest yet.";
refilter();
selectAddressed();
