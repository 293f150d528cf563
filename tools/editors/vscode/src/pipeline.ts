// The picture of the pipeline as data: what the language server answers to `takt/pipeline`, what the view and the
// extension say to one another, and where things stand. Nothing here knows VS Code or a page.

/** Cycles in which nothing issued, before a bundle. */
export interface Stall { cause: string; cycles: number; text: string }

export interface Operation {
  slot: string;
  unit: string;
  text: string;
  /** Cycles to the result; none if it has none. */
  latency: number | null;
  /** Index of its file, and its line there, from 0. */
  file: number | null;
  line: number | null;
}

export interface Bundle {
  address: number;
  /** Where its cycles count from. */
  from: string;
  cycle: number;
  stalls: Stall[];
  operations: Operation[];
}

export interface Pipeline {
  machine: string;
  files: (string | null)[];
  bundles: Bundle[];
  /** Bundles that are not shown. */
  more: number;
}

/** What the extension tells the view. */
export type ToView =
  | { type: 'picture'; document: string; picture: Pipeline | null; stale: boolean }
  | { type: 'cursor'; document: string; lines: [number, number] };

/** What the view tells the extension. */
export type FromView =
  | { type: 'ready' }
  | { type: 'reveal'; uri: string; line: number };

/** A message of the view, if it is one. */
export function fromView(message: unknown): FromView | undefined {
  if (typeof message !== 'object' || message === null) return undefined;
  const { type, uri, line } = message as Record<string, unknown>;
  if (type === 'ready') return { type };
  if (type === 'reveal' && typeof uri === 'string' && Number.isInteger(line) && (line as number) >= 0) {
    return { type, uri, line: line as number };
  }
  return undefined;
}

/** One row of the picture: an operation, or a bundle without one. */
export interface Row {
  bundle: Bundle;
  operation?: Operation;
  first: boolean;
  /** The column of its issue: cycles run on from one straight line to the next. */
  column: number;
}

/** A straight line of code: rows that count their cycles from the same place. */
export interface Stretch { from: string; start: number; rows: [number, number] }

/** The rows of a picture, its stretches, and how many columns it has. */
export function layout(picture: Pipeline): { rows: Row[]; stretches: Stretch[]; columns: number } {
  const rows: Row[] = [];
  const stretches: Stretch[] = [];
  let [start, end, last] = [0, 0, 0];
  for (const bundle of picture.bundles) {
    const stretch = stretches.at(-1);
    // Cycles begin anew with a stretch, even if it is called as the one before.
    if (!stretch || stretch.from !== bundle.from || bundle.cycle <= last) {
      start = end;
      stretches.push({ from: bundle.from, start, rows: [rows.length, rows.length] });
    }
    last = bundle.cycle;
    const column = start + bundle.cycle - 1;
    const operations: (Operation | undefined)[] = bundle.operations.length ? bundle.operations : [undefined];
    operations.forEach((operation, index) => {
      rows.push({ bundle, ...(operation && { operation }), first: index === 0, column });
      end = Math.max(end, column + Math.max(1, operation?.latency ?? 1));
    });
    stretches.at(-1)!.rows[1] = rows.length;
  }
  return { rows, stretches, columns: end };
}

/** The rows whose operations come from some lines of a document, both ends included. */
export function rowsOf(picture: Pipeline, rows: Row[], document: string, lines: [number, number]): number[] {
  return rows.flatMap(({ operation }, index) => {
    if (!operation || operation.file === null || operation.line === null) return [];
    const here = sameDocument(picture.files[operation.file] ?? '', document);
    return here && operation.line >= lines[0] && operation.line <= lines[1] ? [index] : [];
  });
}

/** Whether two URIs name one file: editors differ in which characters they escape. */
export function sameDocument(a: string, b: string): boolean {
  const plain = (uri: string) => {
    try {
      return decodeURIComponent(uri);
    } catch {
      return uri;
    }
  };
  return plain(a) === plain(b);
}

/** What a row says when it is pointed at. */
export function explain({ bundle, operation }: Row): string {
  const lines = [`cycle ${bundle.cycle} from ${bundle.from}, bundle ${bundle.address}`];
  if (operation) {
    lines[0] += `, slot ${operation.slot}`;
    lines.push(operation.text);
    const result = operation.latency === null ? '' : `, result after ${plural(operation.latency, 'cycle')}`;
    lines.push(`unit ${operation.unit}${result}`);
  }
  for (const stall of bundle.stalls) lines.push(`${plural(stall.cycles, 'cycle')} lost: ${stall.text}`);
  return lines.join('\n');
}

export function plural(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}
