// Pipeline diagram as data: the language server's response to `takt/pipeline`, the messages between view and extension, and functions on
// them. Independent of VS Code and of the page.

/** Cycles before a bundle in which nothing issued. */
export interface Stall { cause: string; cycles: number; text: string }

export interface Operation {
  slot: string;
  unit: string;
  text: string;
  /** Latency in cycles; null for an operation without a result. */
  latency: number | null;
  /** The operation is on the longest dependence chain of its straight-line block. */
  critical: boolean;
  /** Index of the operation's file, and the line number in it, from 0. */
  file: number | null;
  line: number | null;
  /** File and line for display. */
  place?: string | undefined;
}

/** Reason why a bundle waited: indices of bundles, and slots if a single operation is the reason. */
export interface Link { from: number; to: number; from_slot: string | null; to_slot: string | null; cycles: number; text: string }

export interface Bundle {
  address: number;
  /** Point from which the cycles are counted: a section, a label, or a bundle. */
  from: string;
  cycle: number;
  stalls: Stall[];
  operations: Operation[];
}

export interface Pipeline {
  machine: string;
  /** No source of the program, including included files, has changed since. */
  current: boolean;
  /** Cycles of each section as text, periods first. */
  sections: string[];
  files: (string | null)[];
  bundles: Bundle[];
  chain: Link[];
  /** Number of bundles left out. */
  more: number;
}

/** Messages from the extension to the view. */
export type ToView =
  | { type: 'picture'; document: string; picture: Pipeline | null; stale: boolean }
  | { type: 'cursor'; document: string; lines: [number, number] };

/** State of a view that VS Code restores when its window is reloaded. */
export interface Kept { document: string }

/** Document in a view's restored state; undefined if the state is not that of a view. */
export function kept(state: unknown): string | undefined {
  const document = typeof state === 'object' && state !== null ? (state as Record<string, unknown>).document : undefined;
  return typeof document === 'string' ? document : undefined;
}

/** Messages from the view to the extension. */
export type FromView =
  | { type: 'ready' }
  | { type: 'reveal'; uri: string; line: number };

/** Validates a message from the view. */
export function fromView(message: unknown): FromView | undefined {
  if (typeof message !== 'object' || message === null) return undefined;
  const { type, uri, line } = message as Record<string, unknown>;
  if (type === 'ready') return { type };
  if (type === 'reveal' && typeof uri === 'string' && Number.isInteger(line) && (line as number) >= 0) {
    return { type, uri, line: line as number };
  }
  return undefined;
}

/** Whether an operation comes from a range of lines in a document, both ends included. */
export function comesFrom(picture: Pipeline, operation: Operation, document: string, lines: [number, number]): boolean {
  if (operation.file === null || operation.line === null) return false;
  const here = sameDocument(picture.files[operation.file] ?? '', document);
  return here && operation.line >= lines[0] && operation.line <= lines[1];
}

/** Whether two URIs denote the same file: editors differ in which characters they escape. */
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

/** Adds places for display to the operations of a diagram. */
export function named(picture: Pipeline): Pipeline {
  const file = (index: number) => decodeURIComponent(picture.files[index] ?? '').replace(/^.*\//, '') || '?';
  const place = (one: Operation) => (one.file === null || one.line === null ? undefined : `${file(one.file)}:${one.line + 1}`);
  const bundles = picture.bundles.map((bundle) => ({ ...bundle, operations: bundle.operations.map((one) => ({ ...one, place: place(one) })) }));
  return { ...picture, bundles };
}

export function plural(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}

/** Text for a program in the status bar: the first period; as tooltip, all sections. */
export function inStatus(picture: Pipeline | null): { text: string; more: string } {
  if (!picture?.sections.length) return { text: '$(graph) Takt', more: 'The cycles are not counted: the program does not assemble, or has no bound' };
  const { current, machine, sections } = picture;
  const old = 'Of the text before: the program has mistakes, or is being counted';
  const more = [`On ${machine}`, ...sections, ...(current ? [] : [old]), 'Click to see the pipeline'].join('\n');
  return { text: `$(${current ? 'graph' : 'history'}) ${sections[0]}${current ? '' : ' before'}`, more };
}
