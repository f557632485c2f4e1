// Small drawings of the doors, in the colors of the page.

const FACE = `<path d="M32 12c-10 0-16 8-16 18 0 13 8 22 16 22s16-9 16-22c0-10-6-18-16-18z"/>`;

export const DRAWINGS = {
  face: `<svg viewBox="0 0 64 64" aria-hidden="true"><g class="line">${FACE}<path d="M25 30h2M37 30h2M26 41c3 3 9 3 12 0"/><path d="M6 16V6h10M48 6h10v10M58 48v10H48M16 58H6V48"/></g></svg>`,
  demo: `<svg viewBox="0 0 64 64" aria-hidden="true"><g class="warm"><path d="M32 12c-10 0-16 8-16 18 0 13 8 22 16 22z"/></g><g class="cold"><path d="M32 12c10 0 16 8 16 18 0 13-8 22-16 22z"/></g><g class="line">${FACE}<path d="M25 30h2M37 30h2M26 41c3 3 9 3 12 0"/><path d="M4 30h6M7 14l4 4M7 46l4-4M54 30h6M57 14l-4 4M57 46l-4-4"/></g></svg>`,
  file: `<svg viewBox="0 0 64 64" aria-hidden="true"><g class="line"><path d="M16 6h22l12 12v40H16z"/><path d="M38 6v12h12"/><path d="M33 48V28M25 36l8-8 8 8"/></g></svg>`,
};
