/* Terms with a hover card, jumps inside Learn, and the guided tour. Texts come from playground/ui/learn. */
(() => {
  if (window.mtpTour) return;
  const el = (tag, className, text = '') => Object.assign(document.createElement(tag), { className, textContent: text });
  const calm = () => matchMedia('(prefers-reduced-motion: reduce)').matches;

  /* One card for all terms of the page, beside the term that is pointed at or has the focus. */
  const card = el('div', 'mtp-term-card');
  card.id = 'mtp-term-card';
  card.setAttribute('role', 'tooltip');
  card.hidden = true;
  let shown = null;

  function showCard(term) {
    if (!card.isConnected) document.body.append(card);
    shown?.removeAttribute('aria-describedby');
    shown = term;
    card.textContent = term.dataset.card;
    term.setAttribute('aria-describedby', card.id);
    card.hidden = false;
    const at = term.getBoundingClientRect(), own = card.getBoundingClientRect();
    const left = Math.max(8, Math.min(at.left, document.documentElement.clientWidth - own.width - 8));
    const above = at.top - own.height - 6;
    card.style.left = `${left}px`;
    card.style.top = `${above >= 8 ? above : at.bottom + 6}px`;
  }

  function hideCard() {
    shown?.removeAttribute('aria-describedby');
    shown = null;
    card.hidden = true;
  }

  const termOf = (event) => event.target.closest?.('.mtp-term');
  for (const type of ['pointerover', 'focusin']) {
    document.addEventListener(type, (event) => {
      const term = termOf(event);
      if (term) showCard(term);
      else if (shown && type === 'pointerover' && document.activeElement !== shown) hideCard();
    });
  }
  document.addEventListener('focusout', (event) => termOf(event) && hideCard());
  // A term that has the focus keeps its card, also when the focus itself made the page scroll.
  const onScroll = () => (shown && shown === document.activeElement ? showCard(shown) : hideCard());
  document.addEventListener('scroll', onScroll, { capture: true, passive: true });

  /* The tour: a ring round what is meant, a card beside it, forward and back by button or arrow key, out by Escape. */
  const steps = window.mtpSteps;
  let parts = null, at = 0, opener = null;

  function build() {
    const ring = el('div', 'mtp-tour-ring');
    const box = el('div', 'mtp-tour');
    box.setAttribute('role', 'dialog');
    box.setAttribute('aria-labelledby', 'mtp-tour-title');
    box.setAttribute('aria-describedby', 'mtp-tour-text');
    const title = Object.assign(el('h2', ''), { id: 'mtp-tour-title' });
    const text = Object.assign(el('p', ''), { id: 'mtp-tour-text' });
    const count = el('span', 'mtp-tour-count');
    const [skip, back, next] = ['Skip', 'Back', 'Next'].map((label) => Object.assign(el('button', '', label), { type: 'button' }));
    next.classList.add('is-next');
    skip.addEventListener('click', () => end());
    back.addEventListener('click', () => go(at - 1));
    next.addEventListener('click', () => go(at + 1));
    const buttons = el('div', 'mtp-tour-buttons');
    buttons.append(count, skip, back, next);
    box.append(title, text, buttons);
    document.body.append(ring, box);
    return { ring, box, title, text, count, skip, back, next };
  }

  const targetOf = (step) => [...document.querySelectorAll(step.target)].find((node) => node.getClientRects().length);

  // Beside the target, wherever there is room; at the foot of the page on a phone.
  function place() {
    if (!parts) return;
    const { ring, box } = parts, target = targetOf(steps[at]);
    const wide = document.documentElement.clientWidth, tall = window.innerHeight, own = box.getBoundingClientRect();
    ring.hidden = !target;
    let left = (wide - own.width) / 2, top = tall - own.height - 16;
    if (target) {
      const seen = target.getBoundingClientRect(), gap = 12;
      Object.assign(ring.style, {
        left: `${seen.left - 4}px`, top: `${seen.top - 4}px`, width: `${seen.width + 8}px`, height: `${seen.height + 8}px`,
      });
      if (wide > 800) {
        const below = seen.bottom + gap, above = seen.top - own.height - gap;
        top = below + own.height < tall ? below : above > 8 ? above : Math.max(8, tall - own.height - 16);
        left = Math.max(16, Math.min(seen.left, wide - own.width - 16));
        if (top !== below && top !== above && seen.right + gap + own.width < wide) left = seen.right + gap;
      } else if (seen.bottom > top && seen.top > own.height + gap) top = 8;
    }
    Object.assign(box.style, { left: `${left}px`, top: `${top}px` });
  }

  function go(to) {
    if (to < 0) return;
    if (to >= steps.length) return end();
    at = to;
    const step = steps[at], { title, text, count, back, next, skip } = parts;
    title.textContent = step.title;
    text.textContent = step.text;
    count.textContent = `${at + 1} of ${steps.length}`;
    back.disabled = at === 0;
    next.textContent = at === steps.length - 1 ? 'Done' : 'Next';
    skip.hidden = at === steps.length - 1;
    const asked = new URLSearchParams(step.query).get('room');
    if (mtpState.room !== asked) mtpState.enter(asked);
    requestAnimationFrame(() => parts && reveal());
    next.focus({ preventScroll: true });
  }

  // A room that is opened for the first time grows for a moment; the page scrolls, figures change size.
  const growing = new ResizeObserver(() => parts && reveal());
  const reveal = () => targetOf(steps[at])?.scrollIntoView({ block: 'center', behavior: 'auto' });

  function follow() {
    if (!parts) return;
    place();
    requestAnimationFrame(follow);
  }

  function start() {
    if (parts) return;
    opener = document.activeElement;
    parts = build();
    document.addEventListener('keydown', keys, true);
    growing.observe(document.body);
    go(0);
    follow();
  }

  function end() {
    document.removeEventListener('keydown', keys, true);
    growing.disconnect();
    parts.ring.remove();
    parts.box.remove();
    parts = null;
    const tour = document.querySelector('[data-part="tour"]');
    (opener?.isConnected && opener.getClientRects().length ? opener : tour)?.focus();
  }

  function keys(event) {
    if (event.key === 'Escape') end();
    else if (!parts.box.contains(event.target)) return;
    else if (event.key === 'ArrowRight') go(at + 1);
    else if (event.key === 'ArrowLeft') go(at - 1);
    else if (event.key === 'Tab') {
      const open = [parts.skip, parts.back, parts.next].filter((button) => !button.disabled && !button.hidden);
      const index = open.indexOf(document.activeElement);
      open[(index + (event.shiftKey ? -1 : 1) + open.length) % open.length].focus();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  document.addEventListener('keydown', (event) => event.key === 'Escape' && shown && hideCard());
  document.addEventListener('click', (event) => {
    if (event.target.closest?.('[data-part="tour"], [data-do="tour"]')) start();
    const jump = event.target.closest?.('.mtp-learn nav a[href^="#"]');
    if (!jump) return;
    event.preventDefault();
    const goal = document.getElementById(jump.getAttribute('href').slice(1));
    goal?.scrollIntoView({ block: 'start', behavior: calm() ? 'auto' : 'smooth' });
    goal?.querySelector('h3')?.setAttribute('tabindex', '-1');
    goal?.querySelector('h3')?.focus({ preventScroll: true });
  });

  window.mtpTour = { start };
})();
