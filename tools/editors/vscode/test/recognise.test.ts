// Sources of Takt and of GNU's assembler, both called *.s.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { isSource } from '../src/recognise';

test('programs and parts of Takt are recognised', () => {
  for (const name of ['examples/pi.s', 'hybrid/robot.s', 'examples/blink.s']) {
    assert.ok(isSource(readFileSync(`../../../programs/${name}`, 'utf8')), name);
  }
});

test("GNU's assembly is left alone", () => {
  const texts = [
    '\t.file\t"a.c"\n\t.text\n\t.globl\tmain\nmain:\n\tret\n',
    '.syntax unified\n.cpu cortex-m7\n.rept 3\n nop\n.endr\n.section .rodata\n',
    '.machine power9\n# .period\n.set output, 3\n',
    '',
  ];
  for (const text of texts) assert.ok(!isSource(text), text);
});
