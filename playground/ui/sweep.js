// The sweep beside the slider of g: a line stands at the slider's g, and a click on a panel takes the slider there.
const chart = () => document.querySelector("#guidance-sweep .mtp-chart");
const slider = () => document.querySelector("#guidance-g input[type=range]");

// The panels as [x axis, y axis], once they are drawn.
function panels(box) {
  const { xaxis, yaxis, xaxis2, yaxis2 } = box?._fullLayout ?? {};
  return [[xaxis, yaxis], [xaxis2, yaxis2]].filter(([x, y]) => x && y);
}

// Two elements over the chart: moving them costs nothing, so the line keeps up with the slider.
function place(g = Number(slider()?.value)) {
  const box = chart();
  panels(box).forEach(([x, y], n) => {
    const line = box.querySelectorAll(".mtp-now")[n] ?? box.appendChild(document.createElement("i"));
    const at = x.l2p(g);
    line.className = "mtp-now";
    line.dataset.g = g;
    line.hidden = at < 0 || at > x._length;
    Object.assign(line.style, { left: `${x._offset + at}px`, top: `${y._offset}px`, height: `${y._length}px` });
  });
}

// g under a pointer, in either panel; null beside them.
function pointed(box, event) {
  const x = event.clientX - box.getBoundingClientRect().left;
  const found = panels(box).find(([axis]) => x >= axis._offset && x <= axis._offset + axis._length);
  return found ? found[0].p2l(x - found[0]._offset) : null;
}

window.mtpMarkGuidance = (g) => place(Number(g));
document.addEventListener("mtp-drawn", (event) => event.target === chart() && place());
document.addEventListener("click", (event) => {
  const box = chart(), g = box?.contains(event.target) ? pointed(box, event) : null, range = slider();
  if (g === null || !range) return;
  const near = Math.min(Number(range.max), Math.max(Number(range.min), Math.round(g * 20) / 20));
  Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(range, String(near));
  range.dispatchEvent(new Event("input", { bubbles: true }));
});
