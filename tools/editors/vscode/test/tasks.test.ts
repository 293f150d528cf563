// Command lines of tasks, and errors in their definitions.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { words } from '../src/tasks';

test('a task is a command line', () => {
  assert.deepEqual(words('takt', { command: 'asm', file: 'a b.s', arguments: ['-m', 't1'] }), ['takt', 'asm', 'a b.s', '-m', 't1']);
});

test('what is wrong with a task is told', () => {
  for (const wrong of [{}, { command: 'asm' }, { command: '--help', file: 'a.s' }, { command: 'asm', file: '' }]) {
    assert.equal(typeof words('takt', wrong), 'string');
  }
  assert.match(String(words('takt', { command: 'asm', file: 'a.s', arguments: 'x' as never })), /list of words/);
});
