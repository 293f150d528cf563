// The script of the view: draws the picture, marks what the cursor is on, and says which row was clicked.
import { explain, layout, plural, rowsOf, type FromView, type Pipeline, type Row, type ToView } from './pipeline';

declare function acquireVsCodeApi(): { postMessage(message: FromView): void };

const SVG = 'http://www.w3.org/2000/svg';
/** Points of a column, of a row, and above the first row. */
const [W, H, TOP] = [9, 18, 20];

const api = acquireVsCodeApi();
const element = (id: string) => document.getElementById(id)!;
let picture: Pipeline | null = null;
let rows: Row[] = [];
let labels: HTMLElement[] = [];
let cursor: { document: string; lines: [number, number] } | undefined;

function shape(name: string, attributes: Record<string, string | number>, title?: string): SVGElement {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  if (title !== undefined) {
    const tip = document.createElementNS(SVG, 'title');
    tip.textContent = title;
    made.append(tip);
  }
  return made;
}

function draw(note: string) {
  const svg = element('svg');
  svg.replaceChildren();
  element('labels').replaceChildren();
  labels = [];
  element('note').textContent = note;
  if (!picture) {
    rows = [];
    return;
  }
  const { rows: drawn, stretches, columns } = layout(picture);
  rows = drawn;
  const height = rows.length * H + TOP;
  svg.setAttribute('width', String(columns * W + 30));
  svg.setAttribute('height', String(height));
  for (const { from, start, rows: [first, last] } of stretches) {
    const y = TOP + first * H;
    svg.append(shape('line', { class: 'stretch', x1: 0, x2: columns * W, y1: y, y2: y }));
    const name = shape('text', { x: start * W + 2, y: y - 5 });
    name.textContent = from;
    svg.append(name);
    const end = Math.max(...rows.slice(first, last).map((row) => row.column));
    for (let column = start + 9; column <= end; column += 10) {
      const x = column * W + W / 2;
      svg.append(shape('line', { class: 'grid', x1: x, x2: x, y1: y, y2: TOP + last * H }));
    }
  }
  rows.forEach((row, index) => {
    const y = TOP + index * H;
    const { bundle, operation, column } = row;
    const title = explain(row);
    if (row.first) {
      let x = column;
      for (const stall of [...bundle.stalls].reverse()) {
        x -= stall.cycles;
        const name = `stall ${stall.cause.replace(' ', '-')}`;
        svg.append(shape('rect', { class: name, x: x * W, y: y + 4, width: stall.cycles * W, height: H - 8 }, `${plural(stall.cycles, 'cycle')} lost: ${stall.text}`));
      }
    }
    const group = shape('g', { 'data-row': index }, title);
    const latency = operation?.latency ?? 1;
    if (latency > 1) group.append(shape('rect', { class: 'run', x: (column + 1) * W, y: y + 4, width: (latency - 1) * W, height: H - 8 }));
    group.append(shape('rect', { class: operation ? 'issue' : 'idle', x: column * W, y: y + 2, width: W, height: H - 4 }));
    svg.append(group);
    const label = document.createElement('div');
    label.textContent = operation?.text ?? 'nop';
    label.title = title;
    label.dataset.row = String(index);
    label.tabIndex = 0;
    label.className = row.first ? 'first' : '';
    element('labels').append(label);
    labels.push(label);
  });
  mark(false);
}

/** Marks the rows that the cursor is on, and with `show` brings the first of them into sight. */
function mark(show: boolean) {
  for (const label of labels) label.classList.remove('on');
  for (const band of document.querySelectorAll('.band')) band.remove();
  if (!picture || !cursor) return;
  const found = rowsOf(picture, rows, cursor.document, cursor.lines);
  for (const index of found) {
    labels[index]?.classList.add('on');
    element('svg').prepend(shape('rect', { class: 'band', x: 0, y: TOP + index * H, width: '100%', height: H }));
  }
  const first = found[0];
  if (show && first !== undefined) {
    const frame = element('picture');
    const [x, y] = [rows[first]!.column * W, TOP + first * H];
    if (y < frame.scrollTop + TOP || y > frame.scrollTop + frame.clientHeight - 2 * H) frame.scrollTop = y - frame.clientHeight / 3;
    const wide = frame.clientWidth - element('labels').offsetWidth;
    if (x < frame.scrollLeft || x > frame.scrollLeft + wide - 4 * W) frame.scrollLeft = x - wide / 3;
  }
}

/** The source line of a row that was clicked. */
function reveal(target: EventTarget | null) {
  const row = (target as Element | null)?.closest('[data-row]')?.getAttribute('data-row');
  const operation = rows[Number(row ?? -1)]?.operation;
  const uri = operation && picture?.files[operation.file ?? -1];
  if (uri && operation.line !== null) api.postMessage({ type: 'reveal', uri, line: operation.line });
}

window.addEventListener('message', ({ data }: MessageEvent<ToView>) => {
  if (data.type === 'picture') {
    picture = data.picture;
    const more = picture?.more ? `; ${plural(picture.more, 'bundle')} more` : '';
    const count = picture && `${plural(picture.bundles.length, 'bundle')} on ${picture.machine}${more}`;
    const old = data.stale ? ' (of the text before: the program has mistakes, or is being counted)' : '';
    draw(count ? count + old : 'The picture appears when the program assembles.');
  } else if (data.type === 'cursor') {
    cursor = { document: data.document, lines: data.lines };
    mark(true);
  }
});
element('picture').addEventListener('click', (event) => reveal(event.target));
element('picture').addEventListener('keydown', (event) => {
  if (event.key === 'Enter' || event.key === ' ') {
    event.preventDefault();
    reveal(event.target);
  }
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const at = labels.indexOf(document.activeElement as HTMLElement);
  if (step && at >= 0) {
    event.preventDefault();
    labels[at + step]?.focus();
  }
});
api.postMessage({ type: 'ready' });
