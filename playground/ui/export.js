/* The export menu of the bar: what stands on the room's stage and in its charts, as files.
 *
 * Motions, tokens and pictures are written by the server (export.py), which is sent what the stage shows. Plots are
 * written here: PNG and SVG by Plotly, CSV from the traces.
 */
(() => {
  if (window.mtpExport) return;
  let server = null; // {write, render, stop}
  let run = 0; // number of the newest wish
  let panel = null;
  let button = null;

  const make = (tag, attributes = {}, ...children) => {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith('on')) node.addEventListener(key.slice(2), value);
      else if (value !== null && value !== undefined && value !== false) node.setAttribute(key, value === true ? '' : value);
    }
    node.append(...children);
    return node;
  };

  function base64(array) {
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    let text = '';
    for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
    return btoa(text);
  }

  const isDark = () => document.body.classList.contains('dark');
  const token = (name) => getComputedStyle(document.body).getPropertyValue(`--mtp-${name}`).trim();

  // A figure of the stage as it is drawn now.
  function figureOf(stage, block) {
    const joints = Float32Array.from(stage.joints(block.id));
    const color = (isDark() && block.dark_color) || block.color;
    return { name: block.name, caption: block.caption || '', color, joints: base64(joints) };
  }

  function trackOf({ system, frames, levels }) {
    return { system, frames, levels: levels.map(({ codes, ids }) => ({ codes, ids: ids ? Array.from(ids) : [] })) };
  }

  function wish(kind, more) {
    return { kind, query: mtpState.query() || '?', dark: isDark(), ...more };
  }

  function save(href, name) {
    const link = make('a', { href, download: name });
    document.body.append(link);
    link.click();
    link.remove();
  }

  function saveText(text, type, name) {
    const url = URL.createObjectURL(new Blob([text], { type }));
    save(url, name);
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }

  const slug = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-|-$/g, '').slice(0, 60) || 'plot';

  // Quotes as RFC 4180 wants them; a text that a spreadsheet would take for a formula gets an apostrophe.
  function cell(value) {
    if (value === null || value === undefined) return '';
    if (typeof value === 'number') return String(value);
    const text = String(value).replace(/<br\s*\/?>/gi, ' · ').replace(/<[^>]*>/g, '');
    const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
    return /[",\n\r]/.test(safe) ? `"${safe.replace(/"/g, '""')}"` : safe;
  }

  // The data of a drawn chart: one line a point.
  function csv(box) {
    const rows = [['panel', 'trace', 'x', 'y', 'id', 'note']];
    for (const trace of box.data) {
      if (trace.hoverinfo === 'skip' || !trace.x || !trace.y) continue;
      const panel = Number(String(trace.xaxis || 'x').slice(1) || 1), xs = Array.from(trace.x), ys = Array.from(trace.y);
      const ids = trace.customdata ? Array.from(trace.customdata) : [], notes = [].concat(trace.hovertext ?? []);
      xs.forEach((x, i) => rows.push([panel, trace.name ?? '', x, ys[i], [ids[i]].flat()[0], notes[i]]));
    }
    return rows.map((row) => row.map(cell).join(',')).join('\r\n') + '\r\n';
  }

  async function savePlot(box, name, format) {
    const file = `${mtpState.room}-${slug(name)}.${format}`;
    if (format === 'csv') return saveText(csv(box), 'text/csv', file);
    const ground = token('surface');
    const layout = { ...box.layout, paper_bgcolor: ground, plot_bgcolor: ground };
    const size = { width: box.clientWidth, height: box.clientHeight };
    const url = await Plotly.toImage({ data: box.data, layout }, { format, ...size, scale: format === 'png' ? 2 : 1 });
    if (format === 'png') return save(url, file);
    saveText(decodeURIComponent(url.slice(url.indexOf(',') + 1)), 'image/svg+xml', file);
  }

  function row(label, control, ...buttons) {
    return make('div', { class: 'mtp-export-row' }, make('span', {}, label), control ?? '', make('div', {}, ...buttons));
  }

  function choice(label, entries) {
    if (entries.length === 1) return [make('span', { class: 'mtp-export-only' }, entries[0].name), () => entries[0]];
    const select = make('select', { 'aria-label': label }, ...entries.map(({ name }, i) => make('option', { value: i }, name)));
    return [select, () => entries[Number(select.value)]];
  }

  function rowsOfStage(stage) {
    if (!stage?.data) return [];
    const { figures, tracks } = stage.data;
    const all = figures.length > 1 ? [{ name: `All ${figures.length} figures`, figures }] : [];
    const each = figures.map((figure) => ({ name: figure.name, figures: [figure] }));
    const [whose, figure] = choice('Figure to write', each);
    const [which, shown] = choice('Figures in the picture', [...all, ...each]);
    const go = (kind, pick, call) => ask(call, wish(kind, { figures: pick().figures.map((block) => figureOf(stage, block)) }));
    const rows = [
      row('Motion', whose, ...['bvh', 'glb', 'npz'].map((kind) => act(kind.toUpperCase(), () => go(kind, figure, 'write')))),
      row('Picture', which, act('MP4', () => go('mp4', shown, 'render')), act('GIF', () => go('gif', shown, 'render')),
        act('Pose strip', () => go('png', shown, 'render'))),
    ];
    if (tracks?.length) {
      const [from, track] = choice('Tokens of', tracks.map((one) => ({ name: one.name, track: one })));
      rows.push(row('Tokens', from, act('JSON', () => ask('write', wish('json', { track: trackOf(track().track) })))));
    }
    return rows;
  }

  function rowsOfCharts(room) {
    return [...(room?.querySelectorAll('.mtp-chart') ?? [])].filter((box) => box.data).map((box) => {
      const name = box.getAttribute('aria-label');
      const buttons = ['png', 'svg', 'csv'].map((format) => act(format.toUpperCase(), () => savePlot(box, name, format)));
      return row('Plot', make('span', { class: 'mtp-export-only' }, name), ...buttons);
    });
  }

  const act = (label, run) => make('button', { type: 'button', onclick: run }, label);

  function ask(call, wished) {
    if (!server) return tell('The page is not ready yet; try again in a moment.');
    busy(true);
    tell(call === 'render' ? 'Starting the renderer' : 'Writing');
    server[call]({ ...wished, run: ++run });
  }

  // A button that is switched off loses the focus; it gets it back.
  let pressed = null;
  function busy(on) {
    if (on && !panel.classList.contains('is-busy')) pressed = document.activeElement;
    panel.classList.toggle('is-busy', on);
    for (const node of panel.querySelectorAll('.mtp-export-row :is(button, select)')) node.disabled = on;
    const lost = [null, document.body, panel.querySelector('.mtp-export-stop')].includes(document.activeElement);
    if (!on && lost && !panel.hidden) pressed?.focus();
  }

  function tell(text, share = null) {
    panel.querySelector('[role=status]').textContent = text;
    const bar = panel.querySelector('progress');
    bar.hidden = share === null;
    if (share !== null) bar.value = share;
  }

  // What the server says: {state: "working", done, total} | {state: "done", file, name, note} | {state: "error", message}
  function hear(value) {
    if (!value || !panel) return;
    if (value.state === 'working') return tell(value.total ? `Picture ${value.done} of ${value.total}` : 'Starting the renderer', value.total ? value.done / value.total : 0);
    busy(false);
    if (value.state === 'error') return tell(value.message);
    save(value.file.url, value.name);
    const size = value.file.size < 1e6 ? `${Math.max(1, Math.round(value.file.size / 1e3))} kB` : `${(value.file.size / 1e6).toFixed(1)} MB`;
    tell(`Saved ${value.name}, ${size}. ${value.note}`.trim());
  }

  function fill() {
    const rows = [...rowsOfStage(mtpState.stage()), ...rowsOfCharts(mtpState.panel)];
    const chosen = new Map([...panel.querySelectorAll('select')].map((node) => [node.ariaLabel, node.value]));
    const none = make('p', {}, 'There is nothing to export here yet.');
    panel.querySelector('.mtp-export-rows').replaceChildren(...(rows.length ? rows : [none]));
    for (const node of panel.querySelectorAll('select')) {
      const before = chosen.get(node.ariaLabel);
      if ([...node.options].some(({ value }) => value === before)) node.value = before;
    }
    if (panel.classList.contains('is-busy')) busy(true);
  }

  function open() {
    fill();
    if (!panel.classList.contains('is-busy')) tell('');
    panel.hidden = false;
    button.setAttribute('aria-expanded', 'true');
    panel.querySelector('button, select')?.focus();
  }

  function close(back = true) {
    if (panel.hidden) return;
    panel.hidden = true;
    button.setAttribute('aria-expanded', 'false');
    if (back) (button.getClientRects().length ? button : document.querySelector('.mtp-more'))?.focus();
  }

  function mount(header, opener) {
    button = opener;
    const stop = make('button', { type: 'button', class: 'mtp-export-stop', onclick: () => server.stop(run) }, 'Stop');
    panel = make(
      'div', { class: 'mtp-export', role: 'dialog', 'aria-label': 'Export', hidden: true }, make('div', { class: 'mtp-export-rows' }),
      make('div', { class: 'mtp-export-foot' }, make('progress', { max: 1, hidden: true, 'aria-label': 'Rendering' }), make('span', { role: 'status' }), stop),
    );
    header.append(panel);
    button.addEventListener('click', () => (panel.hidden ? open() : close()));
    document.addEventListener('keydown', (event) => event.key === 'Escape' && close());
    document.addEventListener('pointerdown', (event) => {
      if (!panel.contains(event.target) && !button.contains(event.target)) close(false);
    });
    document.addEventListener('mtp-room', () => close(false));
    document.addEventListener('mtp-drawn', () => panel.hidden || panel.classList.contains('is-busy') || fill());
  }

  window.mtpExport = { mount, hear, csv, channel: (given) => (server = given) };
})();
