// The figures' canvas: every figure of the payload in sync on one floor, each in its lane or all on one spot.

import { css, mix, readable, systemColour } from "./colour.js";
import { project } from "./camera.js";
import { findContacts, paintContacts, paintGrid, paintShadow, paintTrail } from "./floor.js";
import { guidedJoints } from "./guidance.js";
import { createPainter, tonesOf } from "./paint.js";
import { createBody } from "./skeleton.js";

const SMOOTH = 10; // frames on either side over which the followed point is averaged

export function createFigures(canvas, labels, store, camera) {
  const ctx = canvas.getContext("2d");
  let data = null, figures = [], body = null, painter = null, theme = null, ratio = 1, spacing = 1.2;
  const pose = new Float64Array(66);
  let spheres = null, screen = null;

  function setData(next) {
    data = next;
    body = createBody(data.skeleton);
    painter = createPainter(body);
    spheres = new Float64Array(body.size * 3);
    screen = new Float64Array(body.size * 3);
    figures = data.figures.map((block) => ({ block, frames: block.frames, joints: block.joints }));
    for (const figure of figures) {
      if (figure.block.g === "live") figure.joints = guidedJoints(data.features, store.state.guidance);
      else if (figure.block.g !== null && !figure.joints) figure.joints = guidedJoints(data.features, figure.block.g);
      measure(figure);
    }
    spacing = laneSpacing();
    writeLabels();
    dress();
  }

  function measure(figure) {
    const names = data.skeleton.names;
    figure.contacts = findContacts(figure.joints, figure.frames, names, data.fps);
    figure.centre = smoothRoot(figure.joints, figure.frames, 3 * names.length);
  }

  function setGuidance(g) {
    for (const figure of figures) {
      if (figure.block.g !== "live") continue;
      figure.joints = guidedJoints(data.features, g, figure.joints);
      measure(figure);
    }
  }

  function dress(nextTheme = theme) {
    theme = nextTheme;
    if (!theme) return;
    for (const figure of figures) {
      figure.rgb = systemColour(figure.block, theme);
      figure.tones = tonesOf(figure.rgb, theme);
      if (figure.label) figure.label.style.setProperty("--system", css(readable(figure.rgb, theme.surface, theme.text)));
    }
  }

  function writeLabels() {
    labels.replaceChildren(...figures.map((figure) => {
      const label = document.createElement("div");
      const name = document.createElement("strong"), caption = document.createElement("span");
      name.textContent = figure.block.name;
      caption.textContent = figure.block.caption || "";
      label.className = "ms-label";
      label.append(name, caption);
      figure.label = label;
      figure.labelAt = null;
      return label;
    }));
    const told = figures.map(({ block }) => (block.caption ? `${block.name} (${block.caption})` : block.name));
    const count = figures.length === 1 ? "One figure" : `${figures.length} figures in sync`;
    canvas.setAttribute("aria-label", `${count}: ${told.join(", ")}. ${(data.frames / data.fps).toFixed(1)} seconds.`);
  }

  function resize(width, height, pixelRatio) {
    ratio = pixelRatio;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    camera.resize(width, height, 10, 44);
  }

  // Lanes lie along the camera's right-hand direction, so figures stay side by side from every angle.
  function laneOf(index) {
    if (store.state.layout === "overlay") return [0, 0];
    const metres = (index - (figures.length - 1) / 2) * spacing;
    return [camera.right[0] * metres, camera.right[2] * metres];
  }

  function laneSpacing() {
    let half = 0.45;
    for (const { joints, frames, centre } of figures) {
      for (let t = 0; t < frames; t += 3) {
        for (let j = 0; j < 66; j += 3) {
          const at = t * 66 + j;
          half = Math.max(half, Math.hypot(joints[at] - centre[2 * t], joints[at + 2] - centre[2 * t + 1]));
        }
      }
    }
    return Math.min(2.2, Math.max(1.05, 1.75 * half));
  }

  function followed(frame) {
    const { centre, frames } = figures[0];
    const last = frames - 1, at = Math.min(Math.floor(frame), last), next = Math.min(at + 1, last), share = frame - Math.floor(frame);
    return [0, 1].map((i) => centre[2 * at + i] + (centre[2 * next + i] - centre[2 * at + i]) * share);
  }

  // Looks again at how far the camera must stand. Only while all is visible and the payload, size or layout changed.
  function fit() {
    if (!figures.length) return;
    camera.place();
    const points = [], box = [Infinity, -Infinity, Infinity, -Infinity];
    figures.forEach(({ joints, frames, centre }, index) => {
      const [dx, dz] = laneOf(index);
      for (let t = 0; t < frames; t += 2) {
        const [cx, cz] = store.state.follow ? followed(t) : [0, 0];
        for (const j of [0, 15, 20, 21, 10, 11]) {
          const at = t * 66 + 3 * j;
          const x = joints[at] - cx + dx, z = joints[at + 2] - cz + dz;
          points.push([x, joints[at + 1] + (j === 15 ? 0.08 : 0), z, j === 15 ? 0.13 : 0.1]);
          box[0] = Math.min(box[0], x);
          box[1] = Math.max(box[1], x);
          box[2] = Math.min(box[2], z);
          box[3] = Math.max(box[3], z);
        }
      }
    });
    const top = points.reduce((high, point) => Math.max(high, point[1]), 1.7);
    camera.target = store.state.follow ? [0, top * 0.5, 0] : [(box[0] + box[1]) / 2, top * 0.5, (box[2] + box[3]) / 2];
    camera.home = [...camera.target];
    camera.fit(points);
  }

  function poseAt(figure, frame) {
    const last = figure.frames - 1, at = Math.min(Math.floor(frame), last), next = Math.min(at + 1, last);
    const share = Math.min(frame, last) - at;
    for (let i = 0; i < 66; i++) {
      const value = figure.joints[at * 66 + i];
      pose[i] = value + (figure.joints[next * 66 + i] - value) * share;
    }
  }

  function projectBody(dx, dz) {
    body.place(pose, spheres);
    for (let i = 0; i < spheres.length; i += 3) {
      project(camera, spheres[i] + dx, spheres[i + 1], spheres[i + 2] + dz, screen, i);
    }
  }

  function draw() {
    if (!data || !theme || camera.width < 2) return;
    const { frame, follow, trail } = store.state;
    if (follow) [camera.target[0], camera.target[2]] = followed(frame);
    camera.place();
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, camera.width, camera.height);
    paintGrid(ctx, camera, theme);
    const lanes = figures.map((_, index) => laneOf(index));
    figures.forEach((figure, index) => {
      const [dx, dz] = lanes[index];
      if (trail) paintTrail(ctx, camera, figure.rgb, figure.joints, figure.frames, 66, frame, dx, dz);
      paintContacts(ctx, camera, figure.rgb, figure.contacts, Math.min(frame, figure.frames - 1), data.fps, dx, dz, trail);
      poseAt(figure, frame);
      paintShadow(ctx, camera, theme, pose, data.skeleton.parents, dx, dz);
    });
    figures.forEach((figure, index) => drawFigure(figure, lanes[index], frame));
    placeLabels(lanes, frame);
  }

  function drawFigure(figure, [dx, dz], frame) {
    const twin = store.state.ghost && figure.block.ghost_of && figures.find((other) => other.block.id === figure.block.ghost_of);
    if (twin) {
      poseAt(twin, frame);
      projectBody(dx, dz);
      painter.paintFlat(ctx, screen, camera.focal, css(mix(theme.surface, twin.rgb, 0.3)), css(mix(theme.surface, twin.rgb, 0.62)));
    }
    poseAt(figure, frame);
    projectBody(dx, dz);
    const over = frame > figure.frames ? 0.45 : store.state.layout === "overlay" && figures.length > 1 ? 0.82 : 1;
    painter.paint(ctx, screen, camera.focal, figure.tones, over);
  }

  function placeLabels(lanes, frame) {
    const point = [0, 0, 0], room = camera.width / figures.length;
    figures.forEach((figure, index) => {
      let x = (index + 0.5) * room;
      if (store.state.layout !== "overlay") {
        const t = Math.min(Math.floor(frame), figure.frames - 1);
        const [cx, cz] = store.state.follow ? [camera.target[0], camera.target[2]] : [figure.centre[2 * t], figure.centre[2 * t + 1]];
        project(camera, cx + lanes[index][0], 0.9, cz + lanes[index][1], point, 0);
        x = point[0];
      }
      x = Math.round(Math.min(Math.max(x, 40), camera.width - 40));
      if (figure.labelAt === x) return;
      figure.labelAt = x;
      figure.label.style.transform = `translateX(${x}px) translateX(-50%)`;
      figure.label.style.maxWidth = `${Math.max(room - 8, 56)}px`;
    });
  }

  return {
    setData, setGuidance, dress, resize, fit, draw,
    get figures() {
      return figures;
    },
  };
}

// Root x, z averaged over neighbouring frames: what the camera follows without shaking at every step.
function smoothRoot(joints, frames, width) {
  const out = new Float32Array(frames * 2);
  for (let t = 0; t < frames; t++) {
    const from = Math.max(0, t - SMOOTH), to = Math.min(frames - 1, t + SMOOTH);
    for (let s = from; s <= to; s++) {
      out[2 * t] += joints[s * width] / (to - from + 1);
      out[2 * t + 1] += joints[s * width + 2] / (to - from + 1);
    }
  }
  return out;
}
