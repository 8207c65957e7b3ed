// One camera for all figures: orbit, zoom, pan, and a fit that keeps every figure inside the picture.

const FIELD = (24 * Math.PI) / 180; // vertical field of view
const HOME = { yaw: 0.62, pitch: 0.16, zoom: 1, pan: [0, 0] };

export function createCamera() {
  const camera = {
    ...HOME, pan: [0, 0], fitted: 5, target: [0, 0.9, 0], width: 1, height: 1, top: 0, bottom: 0,
    eye: [0, 0, 0], right: [1, 0, 0], up: [0, 1, 0], forward: [0, 0, -1], focal: 1, cx: 0, cy: 0,
  };
  return Object.assign(camera, {
    reset: () => Object.assign(camera, { ...HOME, pan: [0, 0] }),
    orbit: (dx, dy) => {
      camera.yaw -= dx * 0.008;
      camera.pitch = Math.min(1.5, Math.max(-0.05, camera.pitch + dy * 0.006));
    },
    zoomBy: (factor) => {
      camera.zoom = Math.min(6, Math.max(0.3, camera.zoom * factor));
    },
    panBy: (dx, dy) => {
      const metres = camera.fitted / camera.zoom / camera.focal;
      camera.pan[0] -= dx * metres;
      camera.pan[1] += dy * metres;
    },
    // Size of the picture in CSS pixels; top and bottom are kept free for words.
    resize: (width, height, top, bottom) => Object.assign(camera, { width, height, top, bottom }),
    isHome: () => ["yaw", "pitch", "zoom"].every((key) => camera[key] === HOME[key]) && !camera.pan.some(Boolean),
    place: () => place(camera),
    fit: (points) => fit(camera, points),
  });
}

function place(camera) {
  const { yaw, pitch, target, pan, width, height, top, bottom } = camera;
  const sy = Math.sin(yaw), cy = Math.cos(yaw), sp = Math.sin(pitch), cp = Math.cos(pitch);
  camera.right = [cy, 0, -sy];
  camera.forward = [-sy * cp, -sp, -cy * cp];
  camera.up = [-sy * sp, cp, -cy * sp];
  const distance = camera.fitted / camera.zoom;
  for (let i = 0; i < 3; i++) {
    camera.eye[i] = target[i] - camera.forward[i] * distance + camera.right[i] * pan[0] + camera.up[i] * pan[1];
  }
  camera.focal = (height - top - bottom) / 2 / Math.tan(FIELD / 2);
  camera.cx = width / 2;
  camera.cy = top + (height - top - bottom) / 2;
}

// Screen x, y and depth of a point, written to out[at..at+2]. Depth is metres along the view, never below 0.1.
export function project(camera, x, y, z, out, at) {
  const dx = x - camera.eye[0], dy = y - camera.eye[1], dz = z - camera.eye[2];
  const { right, up, forward, focal } = camera;
  const depth = Math.max(0.1, dx * forward[0] + dy * forward[1] + dz * forward[2]);
  const scale = focal / depth;
  out[at] = camera.cx + (dx * right[0] + dy * right[1] + dz * right[2]) * scale;
  out[at + 1] = camera.cy - (dx * up[0] + dy * up[1] + dz * up[2]) * scale;
  out[at + 2] = depth;
}

// Distance at which all points ([x, y, z, radius] each) are inside the picture, seen from the present angle.
function fit(camera, points) {
  if (!points.length || camera.width < 2 || camera.height < 2) return;
  const kept = { zoom: camera.zoom, pan: camera.pan };
  Object.assign(camera, { zoom: 1, pan: [0, 0] });
  let near = 1, far = 60;
  for (let turn = 0; turn < 24; turn++) {
    camera.fitted = (near + far) / 2;
    place(camera);
    if (allInside(camera, points)) far = camera.fitted;
    else near = camera.fitted;
  }
  camera.fitted = far;
  Object.assign(camera, kept);
  place(camera);
}

function allInside(camera, points) {
  const out = [0, 0, 0];
  return points.every(([x, y, z, radius]) => {
    project(camera, x, y, z, out, 0);
    const pixels = (radius * camera.focal) / out[2];
    return out[2] > 0.3 && out[0] - pixels > 4 && out[0] + pixels < camera.width - 4
      && out[1] - pixels > camera.top && out[1] + pixels < camera.height - camera.bottom;
  });
}
