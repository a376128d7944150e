// Colours that colour-blind eyes tell apart: viridis for amounts, the palette of Okabe and Ito for labels.

const VIRIDIS = [
  [68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137],
  [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37],
];

export const LABELS = ['#c8765c', '#0072b2', '#009e73', '#f0c419', '#cc79a7', '#56b4e9', '#e69f00', '#7a7a7a'];

/** Red, green, blue from 0 to 1 of a share from 0 to 1. */
export function viridis(share) {
  const x = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(x), VIRIDIS.length - 2);
  return [0, 1, 2].map((k) => (VIRIDIS[i][k] + (x - i) * (VIRIDIS[i + 1][k] - VIRIDIS[i][k])) / 255);
}

/** The upper end of a scale: 1, 2 or 5 times a power of ten. */
export function nice(x) {
  if (!(x > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(x));
  return power * [1, 2, 5, 10].find((one) => one * power >= x * 0.999999);
}

/** A number with three digits. */
export function short(x) {
  if (x === 0) return '0';
  const size = Math.abs(x);
  if (size >= 1e5 || size < 1e-3) return x.toExponential(1);
  return String(Number(x.toPrecision(3)));
}
