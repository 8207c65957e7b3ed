// Base64 of little-endian arrays -> typed arrays; payload of playground/figures/stage.py -> what the views draw.

export function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

export function floatsOf(text) {
  const bytes = bytesOf(text);
  const view = new DataView(bytes.buffer);
  const out = new Float32Array(bytes.length >> 2);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat32(4 * i, true);
  return out;
}

export function shortsOf(text) {
  const bytes = bytesOf(text);
  const view = new DataView(bytes.buffer);
  const out = new Int16Array(bytes.length >> 1);
  for (let i = 0; i < out.length; i++) out[i] = view.getInt16(2 * i, true);
  return out;
}

function decodeLevel(level) {
  const rgb = level.colors ? bytesOf(level.colors) : null;
  return {
    size: level.size,
    codes: level.codes,
    ids: level.ids ? shortsOf(level.ids) : null,
    rgb,
    entropy: level.entropy ? floatsOf(level.entropy) : null,
    spans: level.spans ? shortsOf(level.spans) : null,
    marks: level.marks ? bytesOf(level.marks) : null,
  };
}

function decodeStrip(strip) {
  const values = floatsOf(strip.values), frames = values.length / strip.rows.length;
  if (!Number.isInteger(frames)) {
    throw new Error(`This result cannot be shown: strip "${strip.name}" does not fill its ${strip.rows.length} rows.`);
  }
  return { ...strip, values, frames };
}

function decodeFeatures(block) {
  if (!block) return null;
  return {
    figure: block.figure,
    guidance: block.guidance,
    conditional: floatsOf(block.conditional),
    unconditional: floatsOf(block.unconditional),
    mean: floatsOf(block.mean),
    std: floatsOf(block.std),
  };
}

// Throws an Error with one sentence for a person when the payload is not one of ours.
export function decodePayload(payload) {
  if (!payload || payload.version !== 1 || !Array.isArray(payload.figures) || !payload.skeleton) {
    throw new Error("This result cannot be shown: it is not in the stage's format.");
  }
  const joints = payload.skeleton.names.length;
  const figures = payload.figures.map((figure) => {
    const positions = figure.joints ? floatsOf(figure.joints) : null;
    if (positions && positions.length !== figure.frames * joints * 3) {
      throw new Error(`This result cannot be shown: figure "${figure.name}" does not have ${figure.frames} frames.`);
    }
    if (!positions && !payload.features) {
      throw new Error(`This result cannot be shown: figure "${figure.name}" has no motion.`);
    }
    return { ...figure, joints: positions, g: figure.g ?? null };
  });
  const { growing = null, frames } = payload, origin = growing?.first ?? 0;
  return {
    fps: payload.fps,
    frames: Math.max(frames, growing?.window ?? 0), // of the time axis
    growing: growing && { ...growing, made: frames, pieces: [frames] },
    origin, // the clock at the first frame
    ribbon: payload.ribbon || [],
    skeleton: payload.skeleton,
    figures,
    tracks: (payload.tracks || []).map((track) => ({ ...track, origin, levels: track.levels.map(decodeLevel) })),
    features: decodeFeatures(payload.features),
    badge: payload.badge || null,
    strips: (payload.strips || []).map(decodeStrip),
    hatch: payload.hatch || [],
    hatched: payload.hatched || "kept as it was",
    scene: payload.scene ?? null,
  };
}
