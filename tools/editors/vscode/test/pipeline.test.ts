// Data of the diagram: rows, columns, and the effects of cursor and clicks.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { explain, layout, stalls } from '../../../../emu/analysis/src/pipeline.js';
import { comesFrom, fromView, inStatus, kept, named, sameDocument, type Bundle, type Pipeline } from '../src/pipeline';

const operation = (line: number | null, latency: number | null, file: number | null = 0) =>
  ({ slot: 'mul', unit: 'multiply', text: `op ${line}`, latency, critical: false, file, line });
const bundle = (from: string, cycle: number, operations: Bundle['operations'], stalls: Bundle['stalls'] = []): Bundle =>
  ({ address: 7, from, cycle, stalls, operations });

const picture: Pipeline = {
  machine: 't3',
  current: true,
  sections: ['period: 38 cycles, lower bound 38', 'once: 9 cycles from reset'],
  files: ['file:///p/a%20b.s', null],
  bundles: [
    bundle('once', 1, [operation(0, 4), operation(1, 2)]),
    bundle('once', 3, []),
    bundle('period', 1, [operation(4, null)]),
    bundle('period', 6, [operation(4, 3), operation(9, 1, 1)], [{ cause: 'operand', cycles: 4, text: 'x of bundle 2' }]),
    // A second stretch with the same name starts anew.
    bundle('period', 1, [operation(null, 1, null)]),
  ],
  chain: [],
  more: 0,
};

test('rows stand in the columns of their cycles, stretch after stretch', () => {
  const { rows, stretches, columns } = layout(picture.bundles);
  assert.deepEqual(rows.map((row) => row.column), [0, 0, 2, 4, 9, 9, 12]);
  assert.deepEqual(rows.map((row) => row.first), [true, false, true, true, true, false, true]);
  assert.deepEqual(stretches, [
    { from: 'once', start: 0, rows: [0, 3] },
    { from: 'period', start: 4, rows: [3, 6] },
    { from: 'period', start: 12, rows: [6, 7] },
  ]);
  assert.equal(columns, 13);
  assert.deepEqual(layout([]), { rows: [], stretches: [], first: [], columns: 0 });
});

test('the cursor finds its rows, in its own document only', () => {
  const texts = (document: string, lines: [number, number]) =>
    picture.bundles.flatMap((one) => one.operations).filter((one) => comesFrom(picture, one, document, lines)).map((one) => one.text);
  assert.deepEqual(texts('file:///p/a b.s', [4, 4]), ['op 4', 'op 4']);
  assert.deepEqual(texts('file:///p/a%20b.s', [1, 9]), ['op 1', 'op 4', 'op 4']);
  assert.deepEqual(texts('file:///p/b.s', [0, 99]), []);
});

test('URIs are compared by what they mean', () => {
  assert.ok(sameDocument('file:///c%3A/x.s', 'file:///c:/x.s'));
  assert.ok(!sameDocument('file:///a.s', 'file:///b.s'));
  assert.ok(sameDocument('file:///%', 'file:///%'));
});

test('only messages of the protocol are heard', () => {
  assert.deepEqual(fromView({ type: 'ready', more: 1 }), { type: 'ready' });
  assert.deepEqual(fromView({ type: 'reveal', uri: 'file:///a.s', line: 3 }), { type: 'reveal', uri: 'file:///a.s', line: 3 });
  for (const wrong of [null, 3, 'ready', {}, { type: 'reveal' }, { type: 'reveal', uri: 'a', line: -1 }, { type: 'reveal', uri: 'a', line: 1.5 }]) {
    assert.equal(fromView(wrong), undefined);
  }
});

test('the status bar has the period, and says when it is that of an older text', () => {
  const { text, more } = inStatus(picture);
  assert.equal(text, '$(graph) period: 38 cycles, lower bound 38');
  assert.equal(more, 'On t3\nperiod: 38 cycles, lower bound 38\nonce: 9 cycles from reset\nClick to see the pipeline');
  const old = inStatus({ ...picture, current: false });
  assert.equal(old.text, '$(history) period: 38 cycles, lower bound 38 before');
  assert.match(old.more, /Of the text before/);
  for (const none of [null, { ...picture, sections: [] }]) assert.match(inStatus(none).more, /not counted/);
});

test('of a view only its document is kept', () => {
  assert.equal(kept({ document: 'file:///a.s', more: 1 }), 'file:///a.s');
  for (const wrong of [undefined, null, 'file:///a.s', {}, { document: 3 }]) assert.equal(kept(wrong), undefined);
});

test('a row explains itself', () => {
  const { rows } = layout(named(picture).bundles);
  assert.equal(explain(rows[4]!), 'cycle 6 from period, bundle 7, slot mul\nop 4\nunit multiply, result in cycle 9 (3 cycles)\na b.s:5\n4 cycles lost before: x of bundle 2');
  assert.equal(explain(rows[2]!), 'cycle 3 from once, bundle 7');
});

test('lost cycles are summed by straight line and by line', () => {
  const { total, kinds, loops, lines } = stalls(named(picture));
  assert.deepEqual([total, kinds], [4, { operand: 4 }]);
  assert.deepEqual(loops.map(({ name, cycles }) => [name, cycles]), [['period', 4], ['once', 0]]);
  assert.deepEqual(lines.map(({ name, cycles }) => [name, cycles]), [['a b.s:5', 4]]);
});
