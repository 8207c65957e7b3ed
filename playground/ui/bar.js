/* The line above the rooms: copies the link and the script of the room that is shown; takes it to Compare and back. */
(() => {
  if (window.mtpBar) return;

  // navigator.clipboard is there on https and on this machine; elsewhere the older way.
  async function copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      const area = Object.assign(document.createElement('textarea'), { value: text, readOnly: true });
      area.style.cssText = 'position:fixed;top:0;opacity:0';
      (document.querySelector('dialog[open]') ?? document.body).append(area);
      area.select();
      const done = document.execCommand('copy');
      area.remove();
      return done;
    }
  }

  window.mtpBar = (element, scriptOf, compareOf) => {
    const find = (selector) => element.querySelector(selector);
    const part = (name) => find(`.mtp-tools [data-part="${name}"]`);
    const dialog = find('dialog'), code = find('code'), note = find('.mtp-dialog-note'), toast = find('.mtp-toast');
    const header = find('.mtp-header'), more = find('.mtp-more');
    let fading = null;

    function say(text) {
      toast.textContent = text;
      toast.classList.add('is-shown');
      clearTimeout(fading);
      fading = setTimeout(() => toast.classList.remove('is-shown'), 4000);
    }

    part('link').addEventListener('click', async () => {
      const own = mtpState.query().includes('file%3A');
      const done = await copy(location.href);
      if (!done) return say('Copying is not allowed here; the address line has the link.');
      say(own ? 'Link copied. Your own file is not in it: whoever opens it needs the file too.' : 'Link copied.');
    });

    async function copyCode() {
      const done = await copy(code.textContent);
      note.textContent = done ? 'Copied. Run it with the Python that the playground is installed in.' : 'Select the text to copy it.';
    }

    part('python').addEventListener('click', async () => {
      const answer = await scriptOf(mtpState.query() || '?').catch(() => null);
      if (!answer?.code) return say(answer?.error ?? 'The playground did not answer; try again.');
      code.textContent = answer.code;
      dialog.showModal();
      await copyCode();
    });
    find('[data-do="copy"]').addEventListener('click', copyCode);
    find('[data-do="close"]').addEventListener('click', () => dialog.close());
    dialog.addEventListener('click', (event) => event.target === dialog && dialog.close());

    // The switch in a room's panel, and the way back to that room, which stands as it was left.
    let origin = null;
    const name = (room) => document.getElementById(`room-${room}-button`).textContent.trim();
    async function compare(button) {
      const room = mtpState.room;
      button.disabled = true;
      const answer = await compareOf(mtpState.query() || '?').catch(() => null);
      button.disabled = false;
      if (!answer?.query) return say(answer?.error ?? 'The playground did not answer; try again.');
      origin = room;
      mtpState.open(answer.query);
      leadBack(`Back to ${name(room)}`);
    }
    // The panel of Compare is only there once its tab has been opened.
    function leadBack(textContent, tries = 600) {
      const back = document.querySelector('[data-part="back"]');
      if (back) Object.assign(back, { hidden: false, textContent });
      else if (tries) requestAnimationFrame(() => leadBack(textContent, tries - 1));
    }
    document.addEventListener('click', (event) => {
      const button = event.target.closest?.('.mtp-lead [data-part]');
      if (button?.dataset.part === 'compare') compare(button);
      if (button?.dataset.part === 'back' && origin) mtpState.enter(origin);
    });

    // On a phone the tools are a menu under "⋯", which closes behind a choice.
    const unfold = (open) => {
      header.classList.toggle('is-open', open);
      more.setAttribute('aria-expanded', String(open));
    };
    more.addEventListener('click', () => unfold(!header.classList.contains('is-open')));
    find('.mtp-tools').addEventListener('click', () => unfold(false));
    document.addEventListener('pointerdown', (event) => element.contains(event.target) || unfold(false));
    document.addEventListener('keydown', (event) => event.key === 'Escape' && unfold(false));
    window.mtpHeader(element);
    window.mtpExport.mount(header, part('export'));
    window.mtpSay = say;
  };
})();
