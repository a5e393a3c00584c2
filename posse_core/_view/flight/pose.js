// The spacecraft's lines over the image, where a pose puts them: the truth, the estimate, the frame's own pose.

const flight = blockOf("flight");
const POSES = [
  { name: "true", title: "True pose", key: "t", colour: "#e3e9ef" },
  { name: "single", title: "Single frame's pose", key: "s", colour: "#c58cff" },
  { name: "estimate", title: "Estimated pose", key: "e", colour: "#4fb3ff" },
];
for (const { name, title, key, colour } of POSES)
  OVERLAYS.push({ name, title, key, colour, has: (frame) => frame.poses?.[name],
    draw: (context, frame, line) => drawPose(context, frame.poses[name], colour, line) });
picture.shown = new Set(["estimate"]);

// The ends of the lines, pixels, null behind the camera; no lines where the attitude is not known.
function wireOf({ q, t }) {
  if (!q) return [];
  const points = flight.wire.points_body_m.map((point) => project(rotate(q, point).map((value, i) => value + t[i])));
  return flight.wire.lines.map(([a, b]) => [points[a], points[b]]);
}

// Lines, and a cross at the origin of the body axes.
function drawPose(context, pose, colour, line) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5 * line;
  for (const [from, to] of wireOf(pose)) stroke(context, from, to);
  const origin = project(pose.t);
  if (!origin) return;
  const [u, v] = origin, arm = 6 * line;
  stroke(context, [u - arm, v], [u + arm, v]);
  stroke(context, [u, v - arm], [u, v + arm]);
}
