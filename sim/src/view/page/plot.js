// Curves over the last steps, or over all steps of a run that is over.

import { short } from './colour.js';

const KEPT = 600;

/**
 * Adds a plot to an element: its series by name and colour, stacked or beside each other. `pick` is told the
 * number of the row that is pressed, of a run that is over.
 */
export function plot(parent, { title, unit, series, stacked = false, log = false }, pick) {
  const figure = document.createElement('div');
  figure.className = 'plot';
  const head = document.createElement('div');
  const name = document.createElement('span');
  name.textContent = title;
  const now = document.createElement('b');
  head.append(name, now);
  const canvas = document.createElement('canvas');
  canvas.setAttribute('role', 'img');
  figure.append(head, canvas);
  const keys = document.createElement('div');
  figure.append(keys);
  /** Names the series, where there are several. */
  const name_series = () => keys.replaceChildren(...(series.length > 1 ? series : []).map(({ name, colour }) => {
    const key = document.createElement('span');
    key.className = 'key';
    const mark = document.createElement('i');
    mark.style.background = colour;
    key.append(mark, name);
    return key;
  }));
  name_series();
  parent.append(figure);
  let rows = [];
  let is_whole = false;
  let marked = -1;
  const press = ({ clientX, buttons, type }) => {
    if (!is_whole || (type === 'pointermove' && !(buttons & 1))) return;
    const place = canvas.getBoundingClientRect();
    pick(Math.round(((clientX - place.left) / place.width) * (rows.length - 1)));
  };
  canvas.addEventListener('pointerdown', press);
  canvas.addEventListener('pointermove', press);
  return {
    name: name_series,
    /** Shows all rows of a run that is over. */
    show(all) {
      rows = all;
      is_whole = true;
      figure.classList.add('whole');
    },
    /** Marks a row; -1 for none. */
    mark(row) { marked = row; },
    add(row) {
      rows.push(row);
      if (rows.length > KEPT) rows = rows.slice(-KEPT);
    },
    clear() { rows = []; },
    draw() {
      const ratio = devicePixelRatio || 1;
      const [w, h] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
      if (w === 0) return;
      if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
      const pen = canvas.getContext('2d');
      pen.clearRect(0, 0, w, h);
      const total = (row) => row.reduce((a, b) => a + (b ?? 0), 0);
      const value = (x) => (x === null || x === undefined ? null : log ? Math.log10(Math.max(x, 1e-16)) : x);
      let low = log ? Infinity : 0;
      let high = log ? -Infinity : 0;
      for (const row of rows) for (const x of stacked ? [total(row)] : row) {
        const v = value(x);
        if (v === null) continue;
        low = Math.min(low, v);
        high = Math.max(high, v);
      }
      if (!(high > low)) high = low + 1;
      const last = is_whole ? rows[marked] : rows.at(-1);
      const shown = last ? (stacked ? total(last) : last[0]) : null;
      now.textContent = shown === null || shown === undefined ? '–' : `${short(shown)} ${unit}`;
      canvas.setAttribute('aria-label', `${title}: ${now.textContent}`);
      const x = (i) => (is_whole ? i / Math.max(rows.length - 1, 1) : (i + KEPT - rows.length) / (KEPT - 1)) * w;
      const y = (v) => h - 1 - ((v - low) / (high - low)) * (h - 3 * ratio);
      if (stacked) {
        for (let s = series.length - 1; s >= 0; s -= 1) {
          pen.fillStyle = series[s].colour;
          pen.beginPath();
          pen.moveTo(x(0), h);
          rows.forEach((row, i) => pen.lineTo(x(i), y(total(row.slice(0, s + 1)))));
          pen.lineTo(x(rows.length - 1), h);
          pen.fill();
        }
      } else series.forEach(({ colour }, s) => {
        pen.strokeStyle = colour;
        pen.lineWidth = 1.5 * ratio;
        pen.lineJoin = 'round';
        pen.beginPath();
        let is_down = false;
        rows.forEach((row, i) => {
          const v = value(row[s]);
          if (v === null) { is_down = false; return; }
          if (is_down) pen.lineTo(x(i), y(v)); else pen.moveTo(x(i), y(v));
          is_down = true;
        });
        pen.stroke();
      });
      if (is_whole && marked >= 0) {
        pen.fillStyle = getComputedStyle(canvas).color;
        pen.fillRect(Math.min(x(marked), w - 2 * ratio), 0, 2 * ratio, h);
      }
    },
  };
}
