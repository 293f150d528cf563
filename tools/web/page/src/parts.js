// Parts that the playground and the page of `takt live serve` share: elements, numbers, downloads, colours of curves.

/** Colours of curves on a light and on a dark page. */
const LIGHT = ["#2f6fbf", "#d9534f", "#5aa469", "#b07cd8", "#d98a1f", "#26a0a8", "#a3156b", "#8d6e63"];
const DARK = ["#6fa8ee", "#ff8a80", "#84cf94", "#c9a2ee", "#f0b060", "#5cc8d0", "#ff8ac8", "#c4a294"];
/** Number of different colours of curves. */
export const COLOURS = LIGHT.length;

/** Colour of curve `i` on the page as it is now. */
export const colour = (i) => (matchMedia("(prefers-color-scheme: dark)").matches ? DARK : LIGHT)[i % COLOURS];

/** Digits that a value keeps: those of a binary32 that people read. */
const PRECISION = 6;

/** A number's text with a minus sign instead of a hyphen. */
export const signed = (text) => String(text).replace(/-/g, "−");

/** Creates an element with properties and children. */
export const node = (name, set = {}, ...children) => {
  const made = Object.assign(document.createElement(name), set);
  made.append(...children);
  return made;
};

/** The text is a finite number. */
export const isNumber = (text) => text.trim() !== "" && Number.isFinite(Number(text));

/** Range of a slider if none is stated: from 0 to twice the value. */
export function initial(value) {
  if (value === 0) return [-1, 1];
  const end = Number((2 * value).toPrecision(3));
  return value > 0 ? [0, end] : [end, 0];
}

/** Shortest text of a number. */
export function short(value) {
  const plain = String(Number(value.toPrecision(PRECISION))), power = Number(value.toPrecision(PRECISION)).toExponential().replace("e+", "e");
  return power.length < plain.length ? power : plain;
}

/** Shortest decimal text of a number that is a binary32 (0.3 for 0.30000001192092896), and of another its own. */
export function binary32(value) {
  for (let digits = 1; digits <= 9; digits++) {
    const near = Number(value.toPrecision(digits));
    if (Math.fround(near) === value) return String(near);
  }
  return String(value);
}

/** Offers a file for download. */
export function save(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Adds a style sheet to the page. */
export const styled = (sheet) => document.head.append(node("style", { textContent: sheet }));
