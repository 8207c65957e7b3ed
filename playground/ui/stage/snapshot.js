// The picture as it stands, with the names under the figures, as a PNG.

// picture: canvas of the figures; labels: their elements; theme: colours and font. Returns a data URL.
export function snapshot(picture, labels, theme) {
  const copy = document.createElement("canvas"), box = picture.getBoundingClientRect();
  copy.width = picture.width;
  copy.height = picture.height;
  const ctx = copy.getContext("2d"), ratio = picture.width / Math.max(1, box.width);
  ctx.drawImage(picture, 0, 0);
  ctx.scale(ratio, ratio);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (const label of labels) {
    for (const part of label.children) {
      const place = part.getBoundingClientRect(), { font, color } = getComputedStyle(part);
      ctx.font = font || `12px ${theme.font}`;
      ctx.fillStyle = color;
      const x = place.left - box.left + place.width / 2, y = place.top - box.top + place.height / 2;
      if (part.textContent) ctx.fillText(part.textContent, x, y, place.width + 2);
    }
  }
  return copy.toDataURL("image/png");
}
