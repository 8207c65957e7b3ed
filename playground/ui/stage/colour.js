// Colours of the canvases: small arithmetic on [r, g, b], 0-255, and the page's design tokens read from CSS.

export function parse(color) {
  const text = color.trim();
  if (text[0] === "#") {
    const full = text.length === 4 ? text.replace(/[0-9a-f]/gi, "$&$&") : text;
    return [1, 3, 5].map((i) => parseInt(full.slice(i, i + 2), 16));
  }
  const numbers = text.match(/[\d.]+/g);
  return numbers ? numbers.slice(0, 3).map(Number) : [128, 128, 128];
}

export function mix(first, second, share) {
  return first.map((value, i) => value + (second[i] - value) * share);
}

export function css(rgb, alpha = 1) {
  const [r, g, b] = rgb.map(Math.round);
  return alpha >= 1 ? `rgb(${r},${g},${b})` : `rgba(${r},${g},${b},${alpha})`;
}

export function luminance(rgb) {
  const [r, g, b] = rgb.map((value) => {
    const v = value / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

export function contrast(first, second) {
  const a = luminance(first), b = luminance(second);
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}

// The colour, moved towards the ink until text in it can be read on the ground (4.5:1).
export function readable(color, ground, ink) {
  for (let share = 0; share < 1; share += 0.08) {
    const tried = mix(color, ink, share);
    if (contrast(tried, ground) >= 4.5) return tried;
  }
  return ink;
}

// Dark or light text on a filled cell, whichever reads better.
export function textOn(rgb) {
  return luminance(rgb) > 0.179 ? [0, 0, 0] : [255, 255, 255];
}

const NAMES = ["surface", "sunken", "line", "line-strong", "text", "muted", "ink", "on-ink", "focus"];

// The design tokens as they stand at this element, and whether the page is dark.
export function readTheme(element) {
  const style = getComputedStyle(element);
  const theme = { font: style.fontFamily };
  for (const name of NAMES) {
    theme[name.replace(/-(\w)/, (_, letter) => letter.toUpperCase())] = parse(style.getPropertyValue(`--ms-${name}`));
  }
  theme.dark = luminance(theme.surface) < 0.2;
  return theme;
}

export function systemColour(block, theme) {
  return parse(theme.dark ? block.dark_color || block.color : block.color);
}
