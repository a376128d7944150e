// Curves over the last steps.

import { short } from './colour.js';

const KEPT = 600;

/** Adds a plot to an element: its series by name and colour, stacked or beside each other. */
export function plot(parent, { title, unit, series, stacked = false, log = false }) {
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
  if (series.length > 1) {
    const keys = document.createElement('div');
    for (const { name, colour } of series) {
      const key = document.createElement('span');
      key.className = 'key';
      const mark = document.createElement('i');
      mark.style.background = colour;
      key.append(mark, name);
      keys.append(key);
    }
    figure.append(keys);
  }
  parent.append(figure);
  let rows = [];
  return {
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
      const last = rows.at(-1);
      const shown = last ? (stacked ? total(last) : last[0]) : null;
      now.textContent = shown === null || shown === undefined ? '–' : `${short(shown)} ${unit}`;
      canvas.setAttribute('aria-label', `${title}: ${now.textContent}`);
      const x = (i) => ((i + KEPT - rows.length) / (KEPT - 1)) * w;
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
        return;
      }
      series.forEach(({ colour }, s) => {
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
    },
  };
}
