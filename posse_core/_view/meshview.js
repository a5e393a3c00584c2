// The mesh of a spacecraft with its keypoints, seen without perspective; the pointer turns it, and finds vertices.

const PLACE = "#58e07a", CHOSEN = "#ffc857";
const REACH_PX = 40;   // the pointer finds what is no farther
const MOST_DOTS = 4000;

class MeshView extends Turntable {
  // craft: the block that the page was given. pointed(vertex or -1), clicked(vertex or -1, x, y).
  constructor(canvas, craft, { pointed = () => {}, clicked = () => {} }) {
    super(canvas);
    this.size_m = craft.size_m;
    this.middle = craft.middle_m;
    this.xyz = decodeNumbers(craft.vertices_m, Float64Array);
    this.faces = decodeNumbers(craft.faces, Uint32Array);
    this.partOf = new Uint16Array(this.xyz.length / 3);
    this.colours = new Uint8Array(this.faces.length);   // of each triangle
    let vertex = 0, face = 0;
    craft.parts.forEach(({ vertices, triangles, colour }, part) => {
      this.partOf.fill(part, vertex, vertex += vertices);
      for (const end = face + triangles; face < end; face++) this.colours.set(colour, 3 * face);
    });
    this.keypoints = new Map();   // name → position, as the page says
    this.chosen = null;           // name of the keypoint that stands out
    this.near = -1;               // vertex at the pointer
    Object.assign(this, { pointed, clicked });
    canvas.ondblclick = null;     // two clicks may be meant for two vertices
    canvas.addEventListener("pointermove", (event) => this.point(event.buttons ? -1 : this.nearest(event.offsetX, event.offsetY)));
    canvas.addEventListener("pointerleave", () => this.point(-1));
  }

  reset() { Object.assign(this, { yaw: 0.6, pitch: 0.45, zoom: 1, x: 0, y: 0 }); }

  click(x, y) { this.clicked(this.nearest(x, y), x, y); }

  point(vertex) {
    if (vertex === this.near) return;
    this.near = vertex;
    this.pointed(vertex);
    this.draw();
  }

  position(vertex) { return [...this.xyz.subarray(3 * vertex, 3 * vertex + 3)]; }

  // At first seen from −Y with Z up: to the right, down and away are X, −Z and Y.
  turned(x, y, z) { return super.turned(x, -z, y); }

  draw() {
    const { clientWidth: W, clientHeight: H } = this.canvas;
    if (!W || !H) return;
    const seenAs = [this.yaw, this.pitch, this.zoom, this.x, this.y, W, H].join();
    if (seenAs !== this.seenAs) {
      this.shade(W, H);
      this.seenAs = seenAs;
    }
    const context = fitted(this.canvas);
    context.scale(devicePixelRatio, devicePixelRatio);
    context.drawImage(this.image, 0, 0);
    context.font = "12px sans-serif";
    this.drawVertices(context);
    this.drawAxes(context);
    this.drawKeypoints(context);
    this.drawDirections(context);
    scaleBar(context, this.canvas, this.perMetre);
    if (this.near >= 0) ring(context, [this.at[2 * this.near], this.at[2 * this.near + 1]]);
  }

  // Paint the triangles that are in front, by their depth at each pixel, and find the vertices that are seen.
  shade(W, H) {
    const { at, away } = this.placed(this.xyz), { faces, colours } = this, perMetre = this.perMetre;
    const depth = this.depth = new Float32Array(W * H).fill(Infinity);
    Object.assign(this, { at, away, width: W, height: H });
    this.image = pixels(W, H, (data) => {
      const words = new Uint32Array(data.buffer);
      for (let f = 0; f < faces.length; f += 3) {
        const i = faces[f], j = faces[f + 1], k = faces[f + 2];
        const x0 = at[2 * i], y0 = at[2 * i + 1], x1 = at[2 * j] - x0, y1 = at[2 * j + 1] - y0;
        const x2 = at[2 * k] - x0, y2 = at[2 * k + 1] - y0, area = x1 * y2 - x2 * y1;
        const left = Math.max(0, Math.ceil(x0 + Math.min(0, x1, x2))), right = Math.min(W - 1, Math.floor(x0 + Math.max(0, x1, x2)));
        const top = Math.max(0, Math.ceil(y0 + Math.min(0, y1, y2))), bottom = Math.min(H - 1, Math.floor(y0 + Math.max(0, y1, y2)));
        if (!area || left > right || top > bottom) continue;
        const z0 = away[i], z1 = away[j] - z0, z2 = away[k] - z0;
        // The cosine between the normal and the line of sight, where a pixel is the unit of length.
        const nx = perMetre * (y1 * z2 - y2 * z1), ny = perMetre * (z1 * x2 - z2 * x1);
        const light = 0.2 + 0.8 * Math.abs(area) / Math.hypot(nx, ny, area);
        const word = 0xff000000 | (light * colours[f + 2]) << 16 | (light * colours[f + 1]) << 8 | light * colours[f];
        for (let y = top; y <= bottom; y++) {
          for (let x = left; x <= right; x++) {
            const u = ((x - x0) * y2 - (y - y0) * x2) / area, v = ((y - y0) * x1 - (x - x0) * y1) / area;
            if (u < 0 || v < 0 || u + v > 1) continue;
            const z = z0 + u * z1 + v * z2, pixel = y * W + x;
            if (z < depth[pixel]) { depth[pixel] = z; words[pixel] = word; }
          }
        }
      }
    });
    this.found = null;
  }

  // Whether a position on the canvas is not behind the surface, which is judged within a pixel around it.
  isSeen(x, y, away) {
    const { width: W, height: H } = this, column = Math.round(x), row = Math.round(y);
    if (!(column >= 0 && column < W && row >= 0 && row < H)) return false;
    for (let r = Math.max(0, row - 1); r <= Math.min(H - 1, row + 1); r++)
      for (let c = Math.max(0, column - 1); c <= Math.min(W - 1, column + 1); c++)
        if (away <= this.depth[r * W + c] + 1e-4 * this.size_m) return true;
    return false;
  }

  // The vertices that are seen.
  get seen() {
    const { at, away } = this;
    return this.found ??= Uint32Array.from(away.keys()).filter((i) => this.isSeen(at[2 * i], at[2 * i + 1], away[i]));
  }

  // The nearest vertex that is seen; -1 if none is within reach.
  nearest(x, y) {
    if (!this.at) return -1;
    const { at } = this;
    let best = -1, least = REACH_PX * REACH_PX;
    for (const i of this.seen) {
      const d = (at[2 * i] - x) ** 2 + (at[2 * i + 1] - y) ** 2;
      if (d < least) [best, least] = [i, d];
    }
    return best;
  }

  // The name of the nearest keypoint within a few pixels, one that is seen before one that is hidden.
  keypointAt(x, y) {
    let best = null, least = 12;
    for (const [name, point] of this.keypoints) {
      const { at: [u, v], away: [away] } = this.placed(point), d = Math.hypot(u - x, v - y) + (this.isSeen(u, v, away) ? 0 : 6);
      if (d < least) [best, least] = [name, d];
    }
    return best;
  }

  // Small dots where they do not cover everything.
  drawVertices(context) {
    if (this.seen.length > MOST_DOTS) return;
    context.fillStyle = "#ffffff66";
    for (const i of this.seen) context.fillRect(this.at[2 * i] - 1, this.at[2 * i + 1] - 1, 2, 2);
  }

  drawAxes(context) {
    const length = this.size_m / 2;
    const [origin, ...tips] = [[0, 0, 0], [length, 0, 0], [0, length, 0], [0, 0, length]].map((point) => this.toCanvas(point));
    drawTriad(context, origin, tips);
  }

  drawKeypoints(context) {
    for (const [name, point] of this.keypoints) {
      const { at: [u, v], away: [away] } = this.placed(point);
      context.fillStyle = context.strokeStyle = name === this.chosen ? CHOSEN : PLACE;
      context.lineWidth = 1.5;
      context.beginPath();
      context.arc(u, v, 4, 0, 2 * Math.PI);
      this.isSeen(u, v, away) ? context.fill() : context.stroke();
      words(context, name, u + 7, v - 5);
    }
  }
}
