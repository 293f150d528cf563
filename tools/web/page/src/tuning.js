// Sliders for the constants of the text, and for the parameters of a program and of a plant. A constant's slider writes its value into the text, so that
// text, plots, links and exports agree.

import { initial, isNumber, node, short } from "./parts.js";

/** Significant digits of a slider's steps: a hundredth of the power of ten below its range. */
const DIGITS = 2;
/** Pause after which a key press on a slider begins another movement, to be compared with the state before it; ms. */
const RUN = 2000;

/** Text of a value in the source; a real number stays one. */
function written(constant, value) {
  const text = short(value);
  return constant.integer || /[.e]/.test(text) ? text : `${text}.0`;
}

/** Value within a constant's range, where one is stated. */
const within = ({ low, high }, value) => Math.min(Math.max(value, low ?? value), high ?? value);

export class Tuning {
  /**
   * @param box element with the sliders
   * @param begins called before the first change of a movement, with the constant and the text of its value
   * @param sets called with a map from names to texts
   * @param textOf returns the present text of a constant's value
   * @param bounded values beyond a constant's range, which its declaration states, are refused
   * @param isChanged returns whether there is something to reset; without it, the texts before the changes are remembered
   * @param resets resets it
   */
  constructor(box, { begins, sets, textOf, bounded, isChanged, resets }) {
    Object.assign(this, { box, begins, sets, textOf, bounded, resets, rows: new Map(), originals: new Map() });
    this.isChanged = isChanged ?? (() => this.originals.size > 0);
    this.list = box.querySelector("fieldset");
    this.back = box.querySelector("button");
    this.back.addEventListener("click", () => this.reset());
  }

  /** Shows the constants of an assembled text, those with `under` below that heading. Rows of the same names stay, so that a movement goes on. */
  show(constants) {
    this.box.hidden = !constants.length;
    if (constants.map(({ name }) => name).join() !== [...this.rows.keys()].join()) {
      this.rows = new Map(constants.map((constant) => [constant.name, this.row(constant)]));
      const heading = ({ constant: { under } }, i, all) => (under && under !== all[i - 1]?.constant.under ? [node("p", { textContent: under })] : []);
      this.list.replaceChildren(...[...this.rows.values()].flatMap((row, i, all) => [...heading(row, i, all), row.element]));
    }
    for (const constant of constants) {
      const row = this.rows.get(constant.name);
      Object.assign(row, { constant });
      row.formula.textContent = constant.formula ? `= ${constant.formula}` : "";
      if (!this.moving) row.put(constant.value);
    }
    const differ = (one, other) => one !== other && Number(one) !== Number(other);
    for (const [name, { last }] of this.originals) if (differ(this.textOf(name), last)) this.originals.delete(name);
    this.back.disabled = !this.isChanged();
    this.enabled = true;
  }

  set enabled(on) {
    this.list.disabled = !on;
    // The text was changed otherwise: a movement does not go on.
    if (!on) this.last = null;
  }

  /** Forgets the values before the changes: another text is opened. */
  clear() {
    this.originals.clear();
    this.rows.clear();
    this.moving = false;
    this.last = null;
    this.box.hidden = true;
  }

  row(constant) {
    const { name, unit, text, whole, value } = constant, usual = initial(value);
    const low = constant.low ?? usual[0], high = constant.high ?? usual[1];
    const number = (what, of, className) => node("input", { inputMode: "decimal", value: short(of), className, ariaLabel: `${what} of ${name}` });
    const slider = node("input", { type: "range", ariaLabel: `${name}, slider` });
    const least = number("Least value", low, "end"), most = number("Largest value", high, "end"), field = number("Value", value, "field");
    const formula = node("code", { className: "formula" });
    const element = node("div", { className: "constant", title: text ?? "" }, node("b", { textContent: name }), least, slider, most, field, node("small", { textContent: unit ?? "" }), formula);
    /** Why the present value forbids an end. */
    const beyond = ({ value }) => {
      const [low, high] = [least, most].map((end) => Number(end.value)), now = Number(field.value);
      return now < low || now > high ? `${name} is ${field.value}, ${now < low ? "below" : "above"} ${value}` : null;
    };
    const row = { element, slider, least, most, field, formula, constant };
    const fit = () => {
      for (const end of [least, most]) end.style.width = `${end.value.length + 1}ch`;
      const range = Math.abs(most.value - least.value) || 1;
      Object.assign(slider, { min: least.value, max: most.value, step: whole ? 1 : 10 ** (Math.floor(Math.log10(range)) - DIGITS) });
    };
    row.put = (value) => {
      if (value < Number(least.value)) least.value = short(value);
      if (value > Number(most.value)) most.value = short(value);
      fit();
      slider.value = value;
      field.value = short(value);
      field.setCustomValidity("");
    };
    for (const input of [least, most, field]) input.addEventListener("input", () => input.setCustomValidity(""));
    const refuse = (input, why, kept) => {
      input.value = kept;
      input.setCustomValidity(`${why}: ${input === field ? name : input.ariaLabel} stays ${kept}`);
      input.reportValidity();
    };
    for (const end of [least, most]) {
      end.addEventListener("change", () => {
        const why = this.refusal(row.constant, end.value.trim()) ?? beyond(end);
        if (why) return refuse(end, why, end === least ? slider.min : slider.max);
        row.put(Number(field.value));
      });
    }
    // A finger that scrolls across a slider moves no value: the browser cancels the pointer, and the value is that before.
    let before;
    slider.addEventListener("pointerdown", () => {
      this.last = null;
      before = Number(field.value);
    });
    slider.addEventListener("pointercancel", () => {
      this.moving = false;
      if (Number(field.value) === before) return;
      row.put(before);
      this.set(row, before);
    });
    slider.addEventListener("input", () => {
      // Each press of a key is an input and a change: together they are one movement.
      const goesOn = this.moving || (this.last?.row === row && performance.now() - this.last.at < RUN);
      if (!goesOn) this.start(row);
      this.moving = true;
      field.value = short(Number(slider.value));
      this.set(row, Number(slider.value));
    });
    slider.addEventListener("change", () => {
      this.moving = false;
      this.last = { row, at: performance.now() };
    });
    field.addEventListener("change", () => {
      const why = this.refusal(row.constant, field.value.trim());
      if (why) {
        row.put(row.constant.value);
        return refuse(field, why, field.value);
      }
      this.start(row);
      row.put(Number(field.value));
      this.set(row, Number(field.value));
    });
    return row;
  }

  /** Why a constant cannot have the value of a text. */
  refusal(constant, text) {
    if (!text) return "a number is missing";
    if (!isNumber(text)) return `"${text}" is not a number`;
    const value = Number(text), limit = within(constant, value);
    if (this.bounded && value !== limit) return `${text} is ${value < limit ? "below the least value" : "above the largest value"}, ${short(limit)}`;
    const { least } = constant;
    if (least > 0 && value <= 0) return `${text} is not above 0`;
    return least === 0 && value < 0 ? `${text} is below 0` : null;
  }

  start({ constant }) {
    this.begins(`${constant.name} = ${this.textOf(constant.name)}`);
  }

  set({ constant }, value) {
    const { name } = constant, text = written(constant, value), original = this.originals.get(name)?.text ?? this.textOf(name);
    if (text === original) this.originals.delete(name);
    else this.originals.set(name, { text: original, last: text });
    this.sets(new Map([[name, text]]));
    this.back.disabled = !this.isChanged();
  }

  /** Gives all constants the texts that they had before the changes. */
  reset() {
    if (!this.isChanged()) return;
    this.last = null;
    if (this.resets) {
      this.begins("what was set");
      this.resets();
      return;
    }
    const texts = new Map([...this.originals].map(([name, { text }]) => [name, text]));
    this.begins([...texts.keys()].map((name) => `${name} = ${this.textOf(name)}`).join(", "));
    this.originals.clear();
    this.back.disabled = true;
    this.sets(texts);
  }
}
