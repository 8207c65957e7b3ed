/* The address holds the state of the room that is shown. The table of controls comes from playground/ui/state.py.
 *
 * A room opens a door: mtpState.door(room, (query) => ...) is called with the address when a link asks for that room.
 * It keeps its controls there: mtpState.keep(room, keys, values) on every commit; the address follows at once.
 * Nothing here asks the server, and nothing of an address is ever read as HTML.
 */
(() => {
  if (window.mtpState) return;
  const table = window.mtpTable;
  const kept = new Map(); // room -> Map of key -> text
  const doors = new Map(); // room -> function(query)
  const heard = new WeakSet(); // stages whose selection is listened to
  let waiting = null; // {room, query} that no door has taken yet
  let room = table.rooms[0];
  let hidden = '';
  let pushed = false; // whether a link inside the page has made an entry of the browser's history

  const rowsOf = (name) => table.controls.filter((row) => row.room === name);
  const panelOf = (name) => document.getElementById(`room-${name}`);
  const tabOf = (name) => document.getElementById(`room-${name}-button`);

  // What an address says, as texts of known keys; an unknown room is the first one.
  function read(query) {
    const words = new URLSearchParams(query.slice(0, table.longest));
    const asked = words.get('room');
    const name = table.rooms.includes(asked) ? asked : table.rooms[0];
    const values = new Map();
    for (const { key } of rowsOf(name)) if (words.has(key)) values.set(key, words.get(key));
    return { room: name, values, hide: words.get('hide') || '' };
  }

  function query(name = room) {
    const words = new URLSearchParams();
    words.set('room', name);
    for (const { key, default: usual } of rowsOf(name)) {
      const value = kept.get(name)?.get(key);
      if (value !== undefined && value !== usual) words.set(key, value);
    }
    if (hidden) words.set('hide', hidden);
    const bare = words.toString() === `room=${table.rooms[0]}`;
    return bare ? '' : `?${words}`;
  }

  function write() {
    history.replaceState(history.state, '', location.pathname + query() + location.hash);
  }

  // A file of the visitor's own stands in the address by its name alone; a menu calls it by a word of its own.
  let ownFile = null;
  function written(key, value) {
    if (value?.orig_name) ownFile = `file:${value.orig_name.replace(/[^\w .+-]/g, '_').slice(-60)}`;
    if (value?.orig_name || (key === 'motion' && value === table.uploaded)) return ownFile;
    return typeof value === 'boolean' ? String(Number(value)) : [value].flat().join(',');
  }

  // Values as they come from controls; null and undefined take a key out.
  function keep(name, keys, values) {
    const own = kept.get(name) ?? new Map();
    keys.forEach((key, i) => {
      const value = values[i];
      if (value === null || value === undefined) own.delete(key);
      else own.set(key, written(key, value));
    });
    kept.set(name, own);
    if (name === room) write();
  }

  // hide=seed,prompt: the elements of these controls, in every room, and parts of the page by their names.
  function hide(names) {
    const asked = new Set(names.split(','));
    const elements = table.controls.filter((row) => row.element && asked.has(row.key)).map((row) => `#${row.element}`);
    const parts = Object.keys(table.parts).filter((part) => asked.has(part)).map((part) => table.parts[part]);
    const known = new Set([...table.controls.filter((row) => row.element).map((row) => row.key), ...Object.keys(table.parts)]);
    hidden = [...asked].filter((name) => known.has(name)).join(',');
    const sheet = document.getElementById('mtp-hidden') ?? document.head.appendChild(document.createElement('style'));
    sheet.id = 'mtp-hidden';
    const all = [...elements, ...parts];
    sheet.textContent = all.length ? `${all.join(', ')} { display: none !important; }` : '';
  }

  function knock(name, asked) {
    const door = doors.get(name);
    if (!door) {
      waiting = { room: name, query: asked };
      return;
    }
    waiting = null;
    door(asked);
  }

  function door(name, open) {
    doors.set(name, open);
    if (waiting?.room === name) knock(name, waiting.query);
    listen(name);
  }

  // Shows what an address asks for: its tab, then its controls and result by way of the room's door.
  function show(asked) {
    const { room: name, values, hide: names } = read(asked);
    hide(names);
    kept.set(name, values);
    room = name;
    if ([...values.keys()].some((key) => key !== 'selection')) knock(name, asked);
    else settled(name);
    enter(name);
  }

  // Opens a room by its tab; a page that is still waking up, or in the middle of another tab, may need to be told twice.
  function enter(name, tries = 20) {
    whenThere(() => tabOf(name), (tab) => {
      if (room !== name || tab.getAttribute('aria-selected') === 'true') return;
      tab.click();
      if (tries) setTimeout(() => enter(name, tries - 1), 150);
    });
  }

  // A link inside the page: the same as opening its address, without leaving.
  function open(asked) {
    pushed = true;
    history.pushState(null, '', location.pathname + asked);
    show(asked);
  }

  function whenThere(find, act, tries = 600) {
    const found = find();
    if (found) act(found);
    else if (tries) requestAnimationFrame(() => whenThere(find, act, tries - 1));
  }

  const stageName = (name) => panelOf(name)?.querySelector('[id$="-stage"]')?.id.slice(0, -6);
  const stageOf = (name) => window.MotionStage?.get(stageName(name));

  // After a room has shown what a link asked for: what the link selects on the stage.
  function settled(name) {
    const asked = kept.get(name)?.get('selection');
    listen(name);
    if (!asked) return;
    const token = /^(.+)\.(\d+)\.(\d+)$/.exec(asked), span = /^(\d+)-(\d+)$/.exec(asked);
    const ready = () => {
      const stage = stageOf(name), track = stage?.data?.tracks?.find(({ system }) => !token || system === token[1]);
      return (token ? track?.levels[Number(token[2]) - 1]?.ids : stage?.data) ? stage : null;
    };
    whenThere(ready, (stage) => {
      if (token) stage.store.commit('select', { selection: { system: token[1], scale: Number(token[2]), position: Number(token[3]) } });
      else if (span) stage.store.commit('span', { span: [Number(span[1]), Number(span[2])] });
    });
  }

  function listen(name) {
    whenThere(() => stageOf(name), (stage) => {
      if (heard.has(stage)) return;
      heard.add(stage);
      stage.on('select', (token) => keep(name, ['selection'], [token && `${token.system}.${token.scale}.${token.position}`]));
      stage.on('span', (span) => keep(name, ['selection'], [span && `${span.start}-${span.stop}`]));
    });
  }

  document.addEventListener('click', (event) => {
    const tab = event.target.closest?.('#mtp-rooms [role="tab"]');
    const name = tab && table.rooms.find((one) => tab.id === `room-${one}-button`);
    if (name && name !== room) {
      room = name;
      write();
      listen(name);
      document.dispatchEvent(new Event('mtp-room'));
    }
    const link = event.target.closest?.('a[data-state]');
    if (link && !event.ctrlKey && !event.metaKey && !event.shiftKey && event.button === 0) {
      event.preventDefault();
      open(link.getAttribute('href').replace(/^[^?]*/, ''));
    }
  });
  window.addEventListener('popstate', () => pushed && show(location.search));

  window.mtpState = {
    door, keep, settled, open, query,
    enter: (name) => {
      room = name;
      write();
      enter(name);
    },
    get room() { return room; },
    get panel() { return panelOf(room); },
    stage: () => stageOf(room),
  };
  show(location.search);
})();
