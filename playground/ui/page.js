/* The few lines of behaviour that belong to the page as a whole. */
window.mtpHeader = (element) => {
  const key = 'mtp-dark';
  const body = document.body;
  const remembered = localStorage.getItem(key);
  const asked = new URLSearchParams(location.search).get('__theme');
  if (remembered !== null && !asked) body.classList.toggle('dark', remembered === '1');
  element.querySelector('.mtp-dark').addEventListener('click', () => {
    localStorage.setItem(key, body.classList.toggle('dark') ? '1' : '0');
  });
};

/* The file picker starts with what can be read; anything else is answered by the server in a sentence. */
document.addEventListener('click', (event) => {
  const button = event.target.closest?.('#tokenize-upload');
  if (button) button.parentElement.querySelector('input[type=file]')?.setAttribute('accept', '.bvh,.npy,.npz');
}, true);
