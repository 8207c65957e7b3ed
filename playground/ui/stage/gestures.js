// Pointer, wheel and touch on the figures: drag orbits, shift or right drag or two fingers pan, pinch or wheel zooms.

export function addGestures(canvas, camera, { onMove, onReset }) {
  const touches = new Map();
  let pinch = null;

  canvas.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && event.button > 2) return;
    canvas.setPointerCapture(event.pointerId);
    touches.set(event.pointerId, [event.clientX, event.clientY]);
    pinch = touches.size === 2 ? gap(touches) : null;
    canvas.classList.add("is-held");
  });

  canvas.addEventListener("pointermove", (event) => {
    const last = touches.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last[0], dy = event.clientY - last[1];
    touches.set(event.pointerId, [event.clientX, event.clientY]);
    if (touches.size === 2) {
      const now = gap(touches);
      if (pinch) camera.zoomBy(now / pinch);
      pinch = now;
      camera.panBy(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons & 6) camera.panBy(dx, dy);
    else camera.orbit(dx, event.pointerType === "touch" ? 0 : dy);
    onMove();
  });

  const end = (event) => {
    touches.delete(event.pointerId);
    pinch = null;
    if (!touches.size) canvas.classList.remove("is-held");
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", onReset);

  // The page keeps its own scrolling: the wheel zooms with ctrl (a trackpad's pinch, too) or once the stage is in use.
  canvas.addEventListener("wheel", (event) => {
    const inUse = canvas.closest(".ms")?.contains(document.activeElement);
    if (!event.ctrlKey && !event.metaKey && !inUse) return;
    event.preventDefault();
    camera.zoomBy(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)));
    onMove();
  }, { passive: false });
}

function gap(touches) {
  const [a, b] = [...touches.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
}
