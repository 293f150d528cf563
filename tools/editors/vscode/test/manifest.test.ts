// package.json compared with the sources: files that it names exist, and every command is implemented.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { test } from 'node:test';

const manifest = JSON.parse(readFileSync('package.json', 'utf8'));
const { contributes } = manifest;

test('files that the manifest names are there', () => {
  const steps = contributes.walkthroughs[0].steps.map((step: { media: { markdown: string } }) => step.media.markdown);
  const paths = [...contributes.grammars, ...contributes.snippets].map((one: { path: string }) => one.path);
  const pictures = [...readFileSync('README.md', 'utf8').matchAll(/\]\((pictures\/[^)]+)\)/g)].map((match) => match[1]!);
  assert.ok(pictures.length >= 2, 'its page has pictures');
  for (const path of [...steps, ...paths, ...pictures, manifest.icon, contributes.languages[0].configuration]) assert.ok(existsSync(path), path);
});

test('each command is registered, and no other', () => {
  const source = readFileSync('src/extension.ts', 'utf8');
  const registered = [...source.matchAll(/registerCommand\('([^']+)'/g)].map((match) => match[1]).sort();
  assert.deepEqual(contributes.commands.map((one: { command: string }) => one.command).sort(), registered);
});

test('the problem matcher reads what takt says', () => {
  const [first, second] = contributes.problemMatchers[0].pattern;
  const said = 'error[unknown-instruction]: there is no instruction `fadf`\n  ┌─ main.s:12:9\n'.split('\n');
  assert.deepEqual(said[0]!.match(new RegExp(first.regexp))!.slice(1), ['error', 'unknown-instruction', 'there is no instruction `fadf`']);
  assert.deepEqual(said[1]!.match(new RegExp(second.regexp))!.slice(1), ['main.s', '12', '9']);
});

test('what a task complains of stands once: the language server has the same owner, and open files are its own', () => {
  const [matcher] = contributes.problemMatchers;
  assert.deepEqual([matcher.owner, matcher.applyTo], ['takt', 'closedDocuments']);
  assert.match(readFileSync('src/extension.ts', 'utf8'), /diagnosticCollectionName: 'takt'/);
});
