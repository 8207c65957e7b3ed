/* Plays a clip small beside the point of a map that is hovered. chart.js tells of hovers by 'mtp-hover' {id, x, y}
 * (id null: no more). Everything is fetched once, at the first hover; then a hover asks nobody. */
(() => {
  if (window.mtpPreview) return;
  const WIDTH = 132, HEIGHT = 132, METRES = 2.1; // CSS pixels of the picture, and what it shows
  const calm = matchMedia('(prefers-reduced-motion: reduce)');
  const token = (name) => getComputedStyle(document.body).getPropertyValue(`--mtp-${name}`).trim();

  // The answer of the server, with the joints of every clip found by its id.
  function unpack(found) {
    const bytes = Int8Array.from(atob(found.joints), (character) => character.charCodeAt(0));
    const size = found.parents.length * 2, clips = new Map();
    let at = 0;
    found.ids.forEach((id, n) => {
      clips.set(id, { joints: bytes.subarray(at, at + found.poses[n] * size), poses: found.poses[n], words: found.words[n] });
      at += found.poses[n] * size;
    });
    return { ...found, clips, size };
  }

  // The pose between two stored ones, as pixels [x, y, x, y, ...].
  function poseAt(all, clip, seconds) {
    const place = clip.poses > 1 ? (seconds * all.rate) % (clip.poses - 1) : 0;
    const first = Math.floor(place), share = place - first, zoom = (all.step * HEIGHT) / METRES;
    return Array.from({ length: all.size }, (_, i) => {
      const a = clip.joints[first * all.size + i], b = clip.joints[Math.min(first + 1, clip.poses - 1) * all.size + i];
      const value = (a + (b - a) * share) * zoom;
      return i % 2 ? HEIGHT / 2 - value : WIDTH / 2 + value;
    });
  }

  function paint(canvas, all, clip, seconds) {
    const ratio = window.devicePixelRatio || 1, context = canvas.getContext('2d');
    if (canvas.width !== WIDTH * ratio) Object.assign(canvas, { width: WIDTH * ratio, height: HEIGHT * ratio });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, WIDTH, HEIGHT);
    const floor = HEIGHT / 2 + (all.middle * HEIGHT) / METRES, colours = [token('text'), token('muted')];
    Object.assign(context, { lineCap: 'round', lineJoin: 'round', strokeStyle: token('line-strong'), lineWidth: 1 });
    context.stroke(new Path2D(`M12 ${floor}H${WIDTH - 12}`));
    const pose = poseAt(all, clip, seconds), at = (joint) => [pose[2 * joint], pose[2 * joint + 1]];
    for (const side of [true, false]) { // the right side lies behind, paler
      context.strokeStyle = context.fillStyle = colours[Number(side)];
      context.lineWidth = 4;
      all.parents.forEach((parent, joint) => {
        if (parent < 0 || all.right[joint] !== side) return;
        context.beginPath();
        context.moveTo(...at(parent));
        context.lineTo(...at(joint));
        context.stroke();
      });
    }
    context.beginPath();
    context.arc(...at(15), 6, 0, 2 * Math.PI);
    context.fill();
  }

  window.mtpPreview = (element, chart, fetchAll) => {
    const card = element.querySelector('.mtp-preview'), canvas = card.querySelector('canvas');
    document.body.append(card); // so that no panel cuts it off
    let all = null, coming = null, shown = null;

    function play(started = performance.now()) {
      const own = shown;
      const step = (now) => {
        if (own !== shown || card.hidden) return;
        paint(canvas, all, own, calm.matches ? (own.poses - 1) / all.rate / 2 : (now - started) / 1000);
        if (!calm.matches) requestAnimationFrame(step);
      };
      step(started);
    }

    async function show({ id, x, y }) {
      const clip = id === null ? null : String(id).split('/')[0];
      shown = null;
      card.hidden = true;
      if (clip === null) return;
      const wanted = (shown = { clip });
      coming ??= fetchAll().then((found) => (all = found ? unpack(found) : null), () => { coming = null; });
      await coming;
      if (shown !== wanted || !all?.clips.has(clip)) return;
      shown = all.clips.get(clip);
      card.querySelector('figcaption').textContent = shown.words;
      card.dataset.clip = clip;
      card.hidden = false;
      const right = x + 24 + card.offsetWidth < innerWidth; // beside the pointer, above the words that Plotly shows
      card.style.left = `${right ? x + 24 : Math.max(8, x - 24 - card.offsetWidth)}px`;
      card.style.top = `${Math.max(8, y - card.offsetHeight - 24)}px`;
      play();
    }

    document.addEventListener('mtp-hover', (event) => event.target.closest(`#${CSS.escape(chart)}`) && show(event.detail));
    document.addEventListener('mtp-room', () => show({ id: null }));
    document.addEventListener('scroll', () => shown && show({ id: null }), { passive: true, capture: true });
  };
})();
