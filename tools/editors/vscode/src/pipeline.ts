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
  /** It is on the longest chain of its straight line of code. */
  critical: boolean;
  /** Index of its file, and its line there, from 0. */
  file: number | null;
  line: number | null;
  /** File and line as people name them. */
  place?: string | undefined;
}

/** What a bundle waited for: indices of bundles, and slots where one operation is the reason. */
export interface Link { from: number; to: number; from_slot: string | null; to_slot: string | null; cycles: number; text: string }

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
  /** No source of the program, included files too, has changed since. */
  current: boolean;
  /** The cycles of each section in words, those of periods first. */
  sections: string[];
  files: (string | null)[];
  bundles: Bundle[];
  chain: Link[];
  /** Bundles that are not shown. */
  more: number;
}

/** What the extension tells the view. */
export type ToView =
  | { type: 'picture'; document: string; picture: Pipeline | null; stale: boolean }
  | { type: 'cursor'; document: string; lines: [number, number] };

/** What VS Code keeps of a view when its window is loaded again. */
export interface Kept { document: string }

/** The document of a view that was kept, if it is what a view keeps. */
export function kept(state: unknown): string | undefined {
  const document = typeof state === 'object' && state !== null ? (state as Record<string, unknown>).document : undefined;
  return typeof document === 'string' ? document : undefined;
}

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

/** Whether an operation comes from some lines of a document, both ends included. */
export function comesFrom(picture: Pipeline, operation: Operation, document: string, lines: [number, number]): boolean {
  if (operation.file === null || operation.line === null) return false;
  const here = sameDocument(picture.files[operation.file] ?? '', document);
  return here && operation.line >= lines[0] && operation.line <= lines[1];
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

/** A picture as it is drawn: operations with their places, as people name them. */
export function named(picture: Pipeline): Pipeline {
  const file = (index: number) => decodeURIComponent(picture.files[index] ?? '').replace(/^.*\//, '') || '?';
  const place = (one: Operation) => (one.file === null || one.line === null ? undefined : `${file(one.file)}:${one.line + 1}`);
  const bundles = picture.bundles.map((bundle) => ({ ...bundle, operations: bundle.operations.map((one) => ({ ...one, place: place(one) })) }));
  return { ...picture, bundles };
}

export function plural(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}

/** What the status bar says of a program: the first period, and all sections to whoever points at it. */
export function inStatus(picture: Pipeline | null): { text: string; more: string } {
  if (!picture?.sections.length) return { text: '$(graph) Takt', more: 'The cycles are not counted: the program does not assemble, or has no bound' };
  const { current, machine, sections } = picture;
  const old = 'Of the text before: the program has mistakes, or is being counted';
  const more = [`On ${machine}`, ...sections, ...(current ? [] : [old]), 'Click to see the pipeline'].join('\n');
  return { text: `$(${current ? 'graph' : 'history'}) ${sections[0]}${current ? '' : ' before'}`, more };
}
