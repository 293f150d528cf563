// Distances of colours as people see them, also with a deficiency.

/** Machado, Oliveira and Fernandes (2009), severity 1, for linear sRGB. */
const VISION = {
  normal: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  protanopia: [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
  deuteranopia: [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
};
export const VISIONS = Object.keys(VISION);
const TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]];
const WHITE = [0.95047, 1, 1.08883];

const times = (matrix, vector) => matrix.map((row) => row.reduce((sum, value, i) => sum + value * vector[i], 0));
const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const degrees = (radians) => (((radians * 180) / Math.PI) % 360 + 360) % 360;
const cos = (angle) => Math.cos((angle * Math.PI) / 180), sin = (angle) => Math.sin((angle * Math.PI) / 180);

/** CIELAB of a colour `#rrggbb`, as seen. */
function lab(colour, vision) {
  const rgb = [1, 3, 5].map((at) => linear(parseInt(colour.slice(at, at + 2), 16) / 255));
  const seen = times(VISION[vision], rgb).map((value) => Math.min(1, Math.max(0, value)));
  const [x, y, z] = times(TO_XYZ, seen).map((value, i) => value / WHITE[i]).map((value) => (value > 216 / 24389 ? Math.cbrt(value) : ((24389 / 27) * value + 16) / 116));
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

/** CIEDE2000 between two CIELAB colours (Sharma, Wu and Dalal 2005). */
export function ciede2000([L1, a1, b1], [L2, a2, b2]) {
  const seventh = (C) => Math.sqrt(C ** 7 / (C ** 7 + 25 ** 7)), stretch = 1.5 - 0.5 * seventh((Math.hypot(a1, b1) + Math.hypot(a2, b2)) / 2);
  const [C1, C2] = [Math.hypot(a1 * stretch, b1), Math.hypot(a2 * stretch, b2)], [h1, h2] = [degrees(Math.atan2(b1, a1 * stretch)), degrees(Math.atan2(b2, a2 * stretch))];
  const grey = C1 * C2 === 0, turn = grey ? 0 : ((h2 - h1 + 540) % 360) - 180;
  const [dL, dC, dH] = [L2 - L1, C2 - C1, 2 * Math.sqrt(C1 * C2) * sin(turn / 2)];
  const [L, C, h] = [(L1 + L2) / 2, (C1 + C2) / 2, grey ? h1 + h2 : (h1 + turn / 2 + 360) % 360];
  const T = 1 - 0.17 * cos(h - 30) + 0.24 * cos(2 * h) + 0.32 * cos(3 * h + 6) - 0.2 * cos(4 * h - 63);
  const [SL, SC, SH] = [1 + (0.015 * (L - 50) ** 2) / Math.sqrt(20 + (L - 50) ** 2), 1 + 0.045 * C, 1 + 0.015 * C * T];
  const RT = -2 * seventh(C) * sin(60 * Math.exp(-(((h - 275) / 25) ** 2)));
  return Math.sqrt((dL / SL) ** 2 + (dC / SC) ** 2 + (dH / SH) ** 2 + ((RT * dC) / SC) * (dH / SH));
}

/** Distance of two colours as seen. */
export const distance = (a, b, vision) => ciede2000(lab(a, vision), lab(b, vision));
