// The sweep beside the slider of g: a line stands at the slider's g, and a click on a curve takes the slider there.
const chart = () => document.querySelector("#guidance-sweep .mtp-chart");
const slider = () => document.querySelector("#guidance-g input[type=range]");
let waiting = false;

function place() {
  waiting = false;
  const box = chart(), g = Number(slider()?.value);
  if (!window.Plotly || !box?.layout?.shapes || !Number.isFinite(g)) return;
  const patch = {};
  box.layout.shapes.forEach((shape, i) => {
    if (shape.name === "now" && shape.x0 !== g) Object.assign(patch, { [`shapes[${i}].x0`]: g, [`shapes[${i}].x1`]: g });
  });
  if (Object.keys(patch).length) Plotly.relayout(box, patch);
}

window.mtpMarkGuidance = () => {
  if (!waiting) requestAnimationFrame(place); // at most once a frame, however fast the slider is dragged
  waiting = true;
};

// g under a pointer, in either panel; null beside them.
function pointed(box, event) {
  const x = event.clientX - box.getBoundingClientRect().left, { xaxis, xaxis2 } = box._fullLayout ?? {};
  const axis = [xaxis, xaxis2].find((one) => one && x >= one._offset && x <= one._offset + one._length);
  return axis ? axis.p2d(x - axis._offset) : null;
}

document.addEventListener("mtp-drawn", (event) => event.target === chart() && place());
document.addEventListener("click", (event) => {
  const box = chart(), g = box?.contains(event.target) ? pointed(box, event) : null, range = slider();
  if (g === null || !range) return;
  const near = Math.min(Number(range.max), Math.max(Number(range.min), Math.round(g * 20) / 20));
  Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(range, String(near));
  range.dispatchEvent(new Event("input", { bubbles: true }));
});
