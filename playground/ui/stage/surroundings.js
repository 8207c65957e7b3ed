// What a stage must notice of the page round it: its own size, the theme, the screen.

// parts: elements whose size matters. Returns a function that stops watching.
export function watchSurroundings(parts, { onSize, onTheme }) {
  const sizes = new ResizeObserver(onSize), themes = new MutationObserver(onTheme);
  for (const part of parts) sizes.observe(part);
  for (const node of [document.documentElement, document.body]) {
    themes.observe(node, { attributes: true, attributeFilter: ["class", "data-theme"] });
  }
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const onScreen = () => {
    onTheme();
    onSize();
  };
  dark.addEventListener("change", onScreen);
  window.addEventListener("resize", onScreen); // also fires when the pixel ratio changes
  return () => {
    sizes.disconnect();
    themes.disconnect();
    dark.removeEventListener("change", onScreen);
    window.removeEventListener("resize", onScreen);
  };
}
