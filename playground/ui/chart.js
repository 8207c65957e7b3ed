/* Draws a Plotly figure (JSON text) in the page's own colours, light or dark, and reports clicks.
 *
 * Plotly itself is served by the playground and loaded once, after the page stands. A trace may carry
 * meta.dark = {"marker.color": ...} with what changes in the dark; every other colour comes from the --mtp tokens.
 * A hover over a point that has customdata is told by 'mtp-hover' {id, x, y}, its end by one with id null.
 * A click on such a point triggers 'pick' and rings that point in every panel of the chart, but for traces whose
 * meta.ring is false; the figure's
 * layout.meta.picked names the point that is ringed at first; an event 'mtp-pick' {chart: element id, id} rings another.
 * An event 'mtp-lasso' {chart, group} lets a drag draw a group of that name ('' ends it): its points are outlined, and
 * 'lasso' is triggered with {group, ids}; with {chart, forget: true} the groups are gone.
 */
(() => {
  if (window.mtpChart) return;
  let library = null;

  // The figures come first: a large script is only fetched once the page has nothing more urgent to do.
  const idle = () => new Promise((done) => (window.requestIdleCallback ?? setTimeout)(done, { timeout: 1500 }));

  function plotly(url) {
    if (window.Plotly) return Promise.resolve(window.Plotly);
    library ??= idle().then(() => new Promise((resolve, reject) => {
      const script = document.createElement('script');
      script.src = new URL(url, document.baseURI).href;
      script.onload = () => resolve(window.Plotly);
      script.onerror = () => { library = null; reject(new Error('the chart library did not load')); };
      document.head.appendChild(script);
    }));
    return library;
  }

  const token = (name) => getComputedStyle(document.body).getPropertyValue(`--mtp-${name}`).trim();
  const isDark = () => document.body.classList.contains('dark') || document.documentElement.classList.contains('dark');

  function put(target, path, value) {
    const keys = path.split('.');
    const last = keys.pop();
    for (const key of keys) target = target[key] ??= {};
    target[last] = value;
  }

  function dressAxis(axis) {
    return {
      ...axis, gridcolor: token('line'), zerolinecolor: token('line'), linecolor: token('line-strong'),
      tickcolor: token('line-strong'), tickfont: { ...axis.tickfont, color: token('muted') },
    };
  }

  function dress(figure) {
    const layout = {
      ...figure.layout, autosize: true, paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
      font: { size: 12, ...figure.layout?.font, color: token('text'), family: token('sans') },
      hoverlabel: { ...figure.layout?.hoverlabel, bgcolor: token('surface'), bordercolor: token('line-strong'),
                    font: { color: token('text'), family: token('sans'), size: 12 } },
    };
    delete layout.width;
    delete layout.height;
    for (const key of Object.keys(layout)) if (/^[xy]axis\d*$/.test(key)) layout[key] = dressAxis(layout[key]);
    if (layout.template?.layout) {
      for (const key of ['xaxis', 'yaxis']) layout[key] ??= dressAxis({});
    }
    const data = figure.data.map((trace) => {
      const copy = structuredClone(trace);
      if (isDark() && copy.meta?.dark) for (const [path, value] of Object.entries(copy.meta.dark)) put(copy, path, value);
      return copy;
    });
    return { data, layout };
  }

  const first = (entry) => String([entry].flat()[0]);

  // Rings round the point `id`, one in each panel that has it.
  function rings(data, id) {
    return data.filter(({ meta }) => meta?.ring !== false).flatMap((trace) => {
      const at = Array.isArray(trace.customdata) ? trace.customdata.findIndex((entry) => first(entry) === id) : -1;
      if (at < 0) return [];
      return [{ type: 'scatter', mode: 'markers', x: [trace.x[at]], y: [trace.y[at]], xaxis: trace.xaxis, yaxis: trace.yaxis,
                hoverinfo: 'skip', showlegend: false, cliponaxis: false,
                marker: { size: 18, symbol: 'circle-open', color: token('text'), line: { width: 3 } } }];
    });
  }

  // Outlines round the points of each group; the first one round, the second one square.
  function outlines(data, groups) {
    return [...groups].flatMap(([group, ids], place) => data.filter(({ customdata }) => Array.isArray(customdata)).map((trace) => {
      const at = trace.customdata.flatMap((entry, i) => (ids.has(first(entry)) ? [i] : []));
      return { type: 'scatter', mode: 'markers', name: group, x: at.map((i) => trace.x[i]), y: at.map((i) => trace.y[i]),
               xaxis: trace.xaxis, yaxis: trace.yaxis, hoverinfo: 'skip', showlegend: false,
               marker: { size: 11, symbol: place ? 'square-open' : 'circle-open', color: token('text'), line: { width: 1.2 } } };
    }));
  }

  window.mtpChart = (element, props, trigger, watch) => {
    const box = element.querySelector('.mtp-chart');
    let picked = null, group = '';
    const groups = new Map(); // name -> Set of ids

    async function draw() {
      if (!props.value || !box.isConnected || box.clientWidth === 0) return;
      const text = props.value;
      const Plotly = await plotly(props.plotly_url);
      if (text !== props.value || box.clientWidth === 0) return;
      const figure = JSON.parse(text);
      const { data, layout } = dress(figure);
      const ringed = picked ?? figure.layout?.meta?.picked;
      const told = outlines(data, groups);
      if (ringed !== undefined && ringed !== null) data.push(...rings(data, String(ringed)));
      data.push(...told);
      if (group) layout.dragmode = 'lasso';
      layout.height = box.clientHeight || undefined;
      await Plotly.react(box, data, layout, { displayModeBar: false, responsive: true, doubleClick: 'reset' });
      box.dataset.drawn = String(Number(box.dataset.drawn || 0) + 1);
      box.dispatchEvent(new Event('mtp-drawn', { bubbles: true }));
      if (!box.mtpListening) {
        box.mtpListening = true;
        box.on('plotly_click', (event) => {
          const hit = event.points.find((point) => point.customdata !== undefined && point.customdata !== null);
          if (!hit) return;
          picked = first(hit.customdata);
          trigger('pick', { id: picked });
          redraw();
        });
        const hover = (id, event) => box.dispatchEvent(new CustomEvent('mtp-hover', {
          bubbles: true, detail: { id, x: event?.clientX ?? 0, y: event?.clientY ?? 0 },
        }));
        box.on('plotly_hover', ({ points, event }) => {
          const hit = points.find((point) => point.customdata !== undefined && point.customdata !== null);
          if (hit) hover(first(hit.customdata), event);
        });
        box.on('plotly_unhover', () => hover(null));
        box.on('plotly_selected', (event) => {
          const hits = (event?.points ?? []).filter(({ customdata }) => customdata !== undefined && customdata !== null);
          if (!group || !hits.length) return;
          groups.set(group, new Set(hits.map(({ customdata }) => first(customdata))));
          trigger('lasso', { group, ids: [...groups.get(group)] });
          redraw();
        });
      }
    }

    const redraw = () => draw().catch((error) => { box.textContent = error.message; });
    watch('value', () => { picked = null; redraw(); });
    document.addEventListener('mtp-pick', (event) => {
      if (!element.closest(`#${CSS.escape(event.detail.chart)}`)) return;
      picked = event.detail.id;
      redraw();
    });
    document.addEventListener('mtp-lasso', (event) => {
      if (!element.closest(`#${CSS.escape(event.detail.chart)}`)) return;
      group = event.detail.group ?? group;
      if (event.detail.forget) groups.clear();
      redraw();
    });
    const figure = element.querySelector('.mtp-figure'); // one that scrolls sideways can be reached by keyboard
    const reachable = () => {
      if (figure.scrollWidth > figure.clientWidth + 1) figure.tabIndex = 0;
      else figure.removeAttribute('tabindex');
    };
    new ResizeObserver(reachable).observe(figure);
    let width = 0; // the observer also speaks once at the start, and when a hidden tab is opened
    new ResizeObserver(() => {
      if (box.clientWidth === width) return;
      width = box.clientWidth;
      redraw();
    }).observe(box);
    new MutationObserver(redraw).observe(document.body, { attributes: true, attributeFilter: ['class'] });
  };
})();
