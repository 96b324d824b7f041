// Small helpers for building and finding elements. The content security policy forbids inline
// scripts and style attributes, so everything that varies is set from here.

// el('button', {class: 'tool', title: 'Undo', onclick: f, 'aria-pressed': 'true'}, 'text', node...)
export function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith('on')) {
      element.addEventListener(key.slice(2), value);
    } else if (key === 'class') {
      element.className = value;
    } else {
      element.setAttribute(key, value === true ? '' : value);
    }
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no #${id}`);
  return element;
}

// Sets the text only if it changed: a live region that is set anew is read out anew.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Numbers of the server as they are shown; a dash where there is none.
export function number(value, digits = 1) {
  return typeof value === 'number' && Number.isFinite(value) ? value.toFixed(digits) : '–';
}

export function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

// Whether keys typed now belong to a field and not to the page.
export function typing(target) {
  return target instanceof HTMLElement &&
      (target.isContentEditable || target.tagName === 'SELECT' || target.tagName === 'TEXTAREA' ||
       (target.tagName === 'INPUT' && target.type !== 'checkbox' && target.type !== 'range'));
}

// At most one sentence at a time, read out by screen readers.
let toastTimer = 0;
export function say(text, {seconds = 5, urgent = false} = {}) {
  const toast = byId('toast');
  toast.setAttribute('role', urgent ? 'alert' : 'status');
  toast.textContent = text;
  toast.hidden = text === '';
  clearTimeout(toastTimer);
  if (text && seconds) {
    toastTimer = setTimeout(() => {
      toast.hidden = true;
    }, seconds * 1000);
  }
}
