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
