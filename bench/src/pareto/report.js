"use strict";
// Sorts the table by a column; what has no value comes last, whichever way.
const body = document.querySelector("tbody");
function sort(button) {
  const head = button.parentElement;
  const column = Number(button.dataset.column);
  const down = head.getAttribute("aria-sort") === "ascending";
  for (const other of document.querySelectorAll("th")) other.setAttribute("aria-sort", "none");
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const key = (row) => {
    const cell = row.cells[column];
    if (!cell || cell.classList.contains("reason")) return null;
    if (column < 2) return cell.textContent;
    return cell.dataset.value === "" ? null : Number(cell.dataset.value);
  };
  const rows = [...body.rows].map((row) => [key(row), row]);
  rows.sort(([a], [b]) => {
    if (a === null || b === null) return (a === null) - (b === null);
    const order = a < b ? -1 : a > b ? 1 : 0;
    return down ? -order : order;
  });
  for (const [, row] of rows) body.append(row);
}
for (const button of document.querySelectorAll("th button")) {
  button.addEventListener("click", () => sort(button));
}
// report.html#sort=5 opens sorted by the sixth column.
const wanted = /^#sort=(\d+)$/.exec(location.hash);
if (wanted) document.querySelector(`button[data-column="${wanted[1]}"]`)?.click();
document.documentElement.dataset.ready = String(body.rows.length);
