"use strict";
// What every page computes with: coded numbers and masks, rotations, projections, colours, ticks.

const DEG = 180 / Math.PI;

// The JSON value in an element of the page.
function blockOf(id) {
  return JSON.parse(document.getElementById(id).textContent);
}

// Binary numbers, base64 → an array of the type, such as Float32Array.
function decodeNumbers(text, type) {
  return new type(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// COCO's compressed run lengths → Uint8Array of H × W, by rows.
function decodeMask(rle) {
  const [height, width] = rle.size, runs = [], mask = new Uint8Array(height * width);
  for (let at = 0; at < rle.counts.length;) {
    let value = 0, shift = 0, group;
    do {
      group = rle.counts.charCodeAt(at++) - 48;
      value |= (group & 31) << shift;
      shift += 5;
    } while (group & 32);
    if (group & 16) value |= -1 << shift;
    runs.push(runs.length > 2 ? value + runs[runs.length - 2] : value);
  }
  let pixel = 0;
  runs.forEach((run, i) => {
    for (let end = pixel + run; pixel < end; pixel++)
      if (i % 2) mask[(pixel % height) * width + Math.floor(pixel / height)] = 1;
  });
  return mask;
}

// Scalar-first unit quaternion times vector.
function rotate([w, x, y, z], [a, b, c]) {
  const s = 2 * (y * c - z * b), t = 2 * (z * a - x * c), u = 2 * (x * b - y * a);
  return [a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s];
}

// Camera axes, metres → [u, v] pixels, the top-left pixel's centre at (0, 0); null behind the camera and
// beyond its lens.
function project([X, Y, Z], camera = dataset.camera) {
  const { matrix: K, model, distortion, reach } = camera;
  const x = X / Z, y = Y / Z, r2 = x * x + y * y;
  if (Z <= 0 || (reach !== null && r2 > reach * reach)) return null;
  const [u, v] = (model === "fisheye" ? fisheye : brownConrady)(x, y, r2, distortion);
  return [K[0][0] * u + K[0][2], K[1][1] * v + K[1][2]];
}

// A pinhole's image point (x, y), with r2 = x² + y² → the lens's, by the formulas of _model/distortion.py.
function brownConrady(x, y, r2, [k1, k2, p1, p2, k3, k4 = 0, k5 = 0, k6 = 0]) {
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return [x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y];
}

function fisheye(x, y, r2, [k1, k2, k3, k4]) {
  const r = Math.sqrt(r2), theta = Math.atan(r), t2 = theta * theta;
  const ratio = r === 0 ? 1 : theta / r * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
  return [x * ratio, y * ratio];
}

// Colours whose lightness rises evenly: dark blue over green to yellow, and for temperatures black over red
// to light yellow (viridis and inferno by Smith and van der Walt).
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const HEAT = [[0, 0, 4], [33, 12, 74], [87, 16, 110], [138, 34, 106], [188, 55, 84], [228, 90, 49], [249, 142, 9],
  [249, 203, 53], [252, 255, 164]];

// 0 … 1 → [r, g, b]
function ramp(share, colours = RAMP) {
  const at = Math.min(Math.max(share, 0), 1) * (colours.length - 1), i = Math.min(Math.floor(at), colours.length - 2);
  return colours[i].map((low, c) => low + (at - i) * (colours[i + 1][c] - low));
}

// Round values between low and high, about four of them.
function ticks(low, high) {
  const wanted = (high - low) / 4, power = 10 ** Math.floor(Math.log10(wanted));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= wanted) ?? 10 * power, found = [];
  if (high > low) for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return found;
}
