// The dataset that the page was given. Nothing here touches what is seen.

const dataset = blockOf("dataset");
const columns = dataset.columns;
const count = columns.index.length;

// {labels, preview: {jpeg, depth, readings} or null} of the frame at a position in the columns.
const frameAt = (position) => blockOf(`frame-${columns.index[position]}`);

// A file in the dataset's folder, from where the page was written.
function urlOf(file) {
  return dataset.folder + file.split("/").map(encodeURIComponent).join("/");
}

// The target and the bodies beside it in labels: [[name, labels of the body, its spacecraft], ...]; the target has
// no name.
function bodiesOf(labels) {
  return [["", labels, dataset.spacecraft[labels.spacecraft]],
    ...Object.entries(labels.bodies ?? {}).map(([name, body]) => [name, body, dataset.bodies[name]])];
}

// The names of the parts that part ids count: those of the target, then those of each body beside it.
function partNames(labels) {
  return bodiesOf(labels).flatMap(([name, , { parts }]) => parts.map((part) => (name ? `${name}: ${part}` : part)));
}

// The origin of the body axes and the tips of its three axes, pixels; each null behind the camera.
function bodyAxes(labels, camera = dataset.camera, craft = dataset.spacecraft[labels.spacecraft]) {
  return axesOf(labels, craft).map((tip) => project(tip, camera));
}

// The same in camera axes, metres; each axis is half as long as the spacecraft.
function axesOf(labels, craft) {
  const length = craft.size_m / 2, t = labels.t_body_cam_m;
  return [[0, 0, 0], [length, 0, 0], [0, length, 0], [0, 0, length]].map((tip) =>
    rotate(labels.q_cam_from_body, tip).map((value, i) => value + t[i]));
}
