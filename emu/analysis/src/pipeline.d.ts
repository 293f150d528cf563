// Types of pipeline.js, for the extension of VS Code.

export interface Drawn {
  bundles: { address: number; from?: string; cycle: number; stalls: { cause: string; cycles: number; text: string }[]; operations: object[] }[];
}

export interface Row { index: number; first: boolean; column: number }

/** Rows of the picture, where cycles begin anew, the first row of each bundle, and how many columns there are. */
export function layout(bundles: Drawn['bundles']): { rows: Row[]; stretches: { from: string; start: number; rows: [number, number] }[]; first: number[]; columns: number };

/** What a row says when it is pointed at. */
export function explain(row: Row): string;

/** Cycles lost, by kind, by loop or straight line of code, and by line. */
export function stalls(data: Drawn): { total: number; kinds: Record<string, number>; loops: { name: string; cycles: number; count: number }[]; lines: { name: string; cycles: number; count: number }[] };

export class Pipeline<O> {
  constructor(parent: HTMLElement, reveal: (operation: O) => void);
  readonly rows: Row[];
  show(data: Drawn | null): void;
  mark(wanted: (operation: O) => boolean, show: boolean): void;
}
