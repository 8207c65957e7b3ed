// The figures' canvas: every figure of the payload in sync on one floor, each in its lane or all on one spot.

import { css, mix, readable, systemColour } from "./colour.js";
import { project } from "./camera.js";
import { clear } from "./dom.js";
import { findContacts, paintContacts, paintFade, paintGrid, paintJoints, paintShadow, paintWay } from "./floor.js";
import { guidedJoints } from "./guidance.js";
import { Labels } from "./labels.js";
import { AIR, WORDS, arrange, reachOf, smoothRoot, tallOf } from "./lanes.js";
import { Painter, tonesOf } from "./paint.js";
import { createBody } from "./skeleton.js";
import { litToken } from "./store.js";
import { jointsOf } from "./strips.js";

const REACHING = [ // joints that a body reaches farthest with
  "pelvis", "head", "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist", "l_knee", "r_knee",
  "l_foot", "r_foot",
];

export class Figures {
  constructor(canvas, labels, store, camera) {
    Object.assign(this, { canvas, store, camera });
    this.labels = new Labels(labels, canvas);
    Object.assign(this, { data: null, figures: [], theme: null, ratio: 1, spacing: 1.2, rows: 1, across: 1 });
    this.plain = false; // whether bodies are painted without shades, which is faster
    this.ctx = canvas.getContext("2d", { alpha: false });
    this.layer = document.createElement("canvas"); // where a figure is painted that is to be seen through
  }

  clear() {
    this.data = null;
    this.figures = [];
    this.labels.clear();
  }

  setData(data) {
    const names = data.skeleton.names;
    this.data = data;
    this.width = 3 * names.length; // numbers in a pose
    this.body = createBody(data.skeleton);
    this.painter = new Painter(this.body);
    this.pose = new Float64Array(this.width);
    this.spheres = new Float64Array(this.body.size * 3);
    this.screen = new Float64Array(this.body.size * 3);
    this.reaching = REACHING.map((name) => 3 * names.indexOf(name));
    this.head = 3 * names.indexOf("head");
    this.figures = data.figures.map((block) => ({ block, frames: block.frames, joints: block.joints }));
    for (const figure of this.figures) {
      const g = figure.block.g === "live" ? this.store.state.guidance : figure.block.g;
      if (g !== null && data.features) figure.joints = guidedJoints(data.features, g);
      this.measure(figure);
    }
    this.labels.write(data);
    this.dress();
  }

  setGuidance(g) {
    for (const figure of this.figures) {
      if (figure.block.g !== "live") continue;
      figure.joints = guidedJoints(this.data.features, g, figure.joints);
      this.measure(figure);
    }
  }

  measure(figure) {
    const { names } = this.data.skeleton;
    figure.contacts = findContacts(figure.joints, figure.frames, names, this.data.fps);
    figure.centre = smoothRoot(figure.joints, figure.frames, this.width);
  }

  dress(theme = this.theme) {
    this.theme = theme;
    if (!theme) return;
    for (const figure of this.figures) {
      figure.rgb = systemColour(figure.block, theme);
      figure.tones = tonesOf(figure.rgb, theme);
    }
    this.labels.dress(this.figures.map(({ rgb }) => css(readable(rgb, theme.surface, theme.text))));
  }

  resize(width, height, ratio) {
    this.ratio = ratio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    Object.assign(this, this.plan(width, height));
    this.camera.resize(width, height / this.rows, AIR, WORDS);
  }

  // In how many rows the figures stand, and how far apart.
  plan(width, height) {
    const count = this.figures.length;
    if (!count || this.store.state.layout !== "lanes") return { rows: 1, across: Math.max(1, count) };
    return arrange(count, width, height, reachOf(this.figures, this.width, this.reaching), this.tall());
  }

  // Lanes lie along the camera's right-hand direction, so figures stay side by side from every angle.
  laneOf(index) {
    if (this.store.state.layout === "overlay") return [0, 0];
    const metres = ((index % this.across) - (this.across - 1) / 2) * this.spacing;
    return [this.camera.right[0] * metres, this.camera.right[2] * metres];
  }

  tall() {
    return tallOf(this.figures, this.width, this.head);
  }

  // The point that the camera follows at a frame: the first figure's way, smoothed; the origin when it does not follow.
  followed(frame) {
    if (!this.store.state.follow) return [0, 0];
    const { centre, frames } = this.figures[0];
    const at = Math.min(Math.floor(frame), frames - 1), next = Math.min(at + 1, frames - 1);
    const share = frame - Math.floor(frame);
    return [0, 1].map((i) => centre[2 * at + i] + (centre[2 * next + i] - centre[2 * at + i]) * share);
  }

  // Finds how far the camera must stand. Called when the payload, the size or the layout has changed.
  fit() {
    if (!this.figures.length) return;
    const { follow } = this.store.state;
    const tall = this.tall();
    this.camera.place();
    const points = [], box = [Infinity, -Infinity, Infinity, -Infinity];
    this.figures.forEach(({ joints, frames }, index) => {
      const [dx, dz] = this.laneOf(index);
      for (let t = 0; t < frames; t += 3) {
        const [cx, cz] = this.followed(t);
        for (const j of this.reaching) {
          const at = t * this.width + j, head = j === this.head;
          const x = joints[at] - cx + dx, z = joints[at + 2] - cz + dz;
          points.push([x, joints[at + 1] + (head ? 0.09 : 0), z, head ? 0.12 : 0.08]);
          box[0] = Math.min(box[0], x);
          box[1] = Math.max(box[1], x);
          box[2] = Math.min(box[2], z);
          box[3] = Math.max(box[3], z);
        }
      }
    });
    this.camera.target = follow ? [0, tall * 0.5, 0] : [(box[0] + box[1]) / 2, tall * 0.5, (box[2] + box[3]) / 2];
    this.fitCalmly(points);
  }

  // While a motion grows scale by scale the camera stays, unless the new one would not fit or would be tiny.
  fitCalmly(points) {
    const { camera, figures } = this, { follow, layout } = this.store.state;
    const ids = figures.map((figure) => figure.block.id);
    const scene = [this.data.frames, ...ids, camera.width, camera.height, follow, layout].join();
    const before = scene === this.scene ? camera.fitted : 0;
    camera.fit(points);
    if (camera.fitted < before && camera.fitted > 0.75 * before) camera.fitted = before;
    this.scene = scene;
  }

  poseAt(figure, frame) {
    const last = figure.frames - 1, at = Math.min(Math.floor(frame), last), next = Math.min(at + 1, last);
    const share = Math.min(frame, last) - at, { width, pose } = this;
    for (let i = 0; i < width; i++) {
      const value = figure.joints[at * width + i];
      pose[i] = value + (figure.joints[next * width + i] - value) * share;
    }
  }

  projectBody(dx, dz) {
    const { spheres, screen } = this;
    this.body.place(this.pose, spheres);
    for (let i = 0; i < spheres.length; i += 3) {
      project(this.camera, spheres[i] + dx, spheres[i + 1], spheres[i + 2] + dz, screen, i);
    }
  }

  draw() {
    const { ctx, camera, theme } = this;
    if (!theme || camera.width < 2) return;
    const { frame, follow } = this.store.state;
    if (follow && this.data) [camera.target[0], camera.target[2]] = this.followed(frame);
    camera.place();
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.fillStyle = css(theme.surface);
    ctx.fillRect(0, 0, camera.width, camera.height * this.rows);
    const lanes = this.figures.map((_, index) => this.laneOf(index));
    for (let row = 0; row < this.rows; row++) this.drawRow(row * this.across, lanes, frame, row * camera.height);
    const spots = this.figures.map((figure, index) => this.labelSpot(figure, index, lanes[index], frame));
    this.labels.place(spots, camera.width / this.across, this.across);
  }

  // Where the name of a figure goes: under it where figures have lanes, beside the others where they have one spot.
  labelSpot(figure, index, [dx, dz], frame) {
    const { camera, across } = this, { follow, layout } = this.store.state;
    const y = (Math.floor(index / across) + 1) * camera.height - WORDS + 2;
    const beside = (index - (across - 1) / 2) * Math.min(camera.width / across, 140);
    if (layout === "overlay") return [camera.width / 2 + beside, y];
    const t = Math.min(Math.floor(frame), figure.frames - 1), spot = [0, 0, 0];
    const [cx, cz] = follow ? [camera.target[0], camera.target[2]] : figure.centre.subarray(2 * t, 2 * t + 2);
    project(camera, cx + dx, 0.9, cz + dz, spot, 0);
    return [Math.min(Math.max(spot[0], 40), camera.width - 40), y];
  }

  drawRow(first, lanes, frame, top) {
    const { ctx, camera, across } = this, shown = this.figures.slice(first, first + across);
    ctx.save();
    ctx.translate(0, top);
    ctx.beginPath();
    ctx.rect(0, 0, camera.width, camera.height);
    ctx.clip();
    paintGrid(ctx, camera, this.theme);
    shown.forEach((figure, index) => this.drawGround(figure, lanes[first + index], frame));
    paintFade(ctx, camera, this.theme, WORDS);
    shown.forEach((figure, index) => this.drawFigure(figure, lanes[first + index], frame));
    ctx.restore();
  }

  drawGround(figure, [dx, dz], frame) {
    const { ctx, camera, theme, data } = this, { trail } = this.store.state;
    const now = Math.min(frame, figure.frames - 1);
    const way = (alpha, line, span, rgb = figure.rgb) =>
      paintWay(ctx, camera, css(rgb, alpha), line, figure.joints, this.width, span, dx, dz);
    const last = figure.frames - 1, lit = litToken(data.tracks, this.store.state)?.span;
    if (trail) way(0.85, 2, [0, now]);
    if (trail) way(0.28, 1.5, [now, last]);
    if (lit) way(1, 4, lit.map((frame) => Math.min(frame, last)), theme.focus);
    this.poseAt(figure, frame);
    paintShadow(ctx, camera, theme, this.pose, data.skeleton.parents, dx, dz);
    paintContacts(ctx, camera, figure.rgb, figure.contacts, now, data.fps, dx, dz, trail);
  }

  drawFigure(figure, [dx, dz], frame) {
    const { ctx, camera, theme, screen, painter, figures } = this, { ghost, layout } = this.store.state;
    const twin = ghost && figures.find((other) => other.block.id === figure.block.ghost_of);
    if (twin) {
      this.poseAt(twin, frame);
      this.projectBody(dx, dz);
      const [fill, line] = [0.3, 0.62].map((share) => css(mix(theme.surface, twin.rgb, share)));
      painter.paintFlat(ctx, screen, camera.focal, fill, line);
    }
    this.poseAt(figure, frame);
    this.projectBody(dx, dz);
    const span = litToken(this.data.tracks, this.store.state)?.span;
    const look = { plain: this.plain, halo: span && frame >= span[0] && frame < span[1] ? css(theme.focus) : null };
    if (frame >= figure.frames + 0.5) this.paintThrough(figure, 0.45, look); // a shorter motion has ended and waits
    else if (layout === "overlay" && figures.length > 1) {
      this.paintThrough(figure, figure === figures[0] ? 0.9 : 0.68, look);
    } else painter.paint(ctx, screen, camera.focal, figure.tones, look);
    const { probe } = this.store.state, marked = probe && jointsOf(this.data.strips[probe.strip], probe.row);
    if (marked) paintJoints(ctx, camera, theme, this.pose, this.data.skeleton.parents, marked, dx, dz);
  }

  // Paints the projected body as one see-through shape, without its inside showing.
  paintThrough(figure, alpha, look) {
    const { canvas, layer, ctx } = this;
    if (layer.width !== canvas.width) layer.width = canvas.width; // setting a size clears and costs
    if (layer.height !== canvas.height) layer.height = canvas.height;
    const over = clear(layer, 1);
    over.setTransform(ctx.getTransform());
    this.painter.paint(over, this.screen, this.camera.focal, figure.tones, look);
    ctx.save();
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.globalAlpha = alpha;
    ctx.drawImage(layer, 0, 0);
    ctx.restore();
  }
}
