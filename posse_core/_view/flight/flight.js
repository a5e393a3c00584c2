// The page of a flight: everything follows the frame shown, and the part of the flight that the plots show.

const plots = flight.plots.map((plot) => new TimePlot(plot, byId("times")));
const projections = [
  { across: 1, up: 0, title: "T and R: in the orbit's plane", right: "V-bar (T) →", top: "↑ R, R-bar is down" },
  { across: 1, up: 2, title: "T and N: from above", right: "V-bar (T) →", top: "↑ N" },
  { across: 2, up: 0, title: "N and R: along the V-bar", right: "N →", top: "↑ R, R-bar is down" },
].map((view) => new Projection(view, byId("projections")));

function drawPlots() {
  plots.forEach((plot) => plot.draw(state.current));
  projections.forEach((projection) => projection.draw(state.current));
}

function showPart(from, to) {
  if (to - from < 1e-6 * (t_s.at(-1) - t_s[0])) return drawAll();
  Object.assign(part, { from, to });
  byId("whole").hidden = false;
  drawAll();
}

function showWhole() {
  Object.assign(part, { from: t_s[0], to: Math.max(t_s.at(-1), t_s[0] + 1e-9) });
  byId("whole").hidden = true;
  drawAll();
}

function showFrame({ labels }) {
  const at = state.current, estimate = flight.estimate_rtn_m[at], truth = flight.true_rtn_m[at];
  byId("labels").textContent = JSON.stringify(labels, null, 1);
  const row = (values, unit) => (values[0] === null ? "–" : `${values.map((x) => x.toFixed(3)).join(", ")} ${unit}`);
  fillFacts({
    "UTC": labels.epoch_utc.slice(0, 23).replace("T", " "),
    "Time": `${t_s[at].toFixed(1)} s`,
    "Range": `${Math.hypot(...truth).toFixed(3)} m`,
    "True position, RTN": row(truth, "m"),
    "Estimate, RTN": row(estimate, "m"),
    "Its error": estimate[0] === null ? "–" : `${short(Math.hypot(...truth.map((x, i) => x - estimate[i])))} m`,
    "Readings, rejected": flight.dof[at] ? `${flight.dof[at]}, ${flight.rejected[at]}` : "none",
    ...(largest_m_s ? { "Impulse after it": impulse_m_s[at] ? row(flight.dv_rtn_m_s[at].map((x) => 1e3 * x), "mm/s") : "none" } : {}),
    "Lit, visible in the image": `${labels.fraction_lit?.toFixed(2) ?? "–"}, ${labels.fraction_visible?.toFixed(2) ?? "–"}`,
  });
}

byId("figures").append(...flight.figures.map(([name, text]) => {
  const entry = document.createElement("div");
  for (const [tag, words] of [["dt", name], ["dd", text]])
    entry.append(Object.assign(document.createElement(tag), { textContent: words }));
  return entry;
}));
byId("arrows").textContent = largest_m_s ? `the longest arrow is ${short(1e3 * largest_m_s)} mm/s` : "";
byId("whole").onclick = showWhole;
document.title = `${dataset.name} – POSSE`;
byId("name").textContent = flight.title;
for (const [what, there] of Object.entries({ impulses: largest_m_s, waypoints: flight.waypoints_rtn_m.length,
  keep_out: flight.keep_out_m, cone: flight.cone_rtn_m }))
  document.querySelectorAll(`[data-of=${what}]`).forEach((words) => { words.hidden = !there; });
byId("summary").textContent = `${count} frames from ${dataset.epoch_utc.slice(0, 19).replace("T", " ")} UTC`;
byId("manifest").textContent = dataset.manifest ? JSON.stringify(dataset.manifest, null, 2) : "There is no manifest yet.";
keep(columns.index.map((_, position) => position));
selectAddressed();
