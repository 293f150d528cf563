// The view's own script in a real browser: it draws, marks operations at the cursor, and reports clicks.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { test } from 'node:test';
import { page } from '../src/page';
import type { Pipeline } from '../src/pipeline';

const picture: Pipeline = {
  machine: 't3',
  current: true,
  sections: [],
  files: ['file:///p/a.s'],
  bundles: [0, 1, 2].map((index) => ({
    address: index,
    from: 'period',
    cycle: 1 + 3 * index,
    stalls: index ? [{ cause: 'write port', cycles: 2, text: '<taken>' }] : [],
    operations: [{ slot: 'mul', unit: 'multiply', text: `fmul <b${index}>`, latency: 4, critical: index > 0, file: 0, line: 5 + index }],
  })),
  chain: [{ from: 1, to: 2, from_slot: 'mul', to_slot: 'mul', cycles: 3, text: '<b> through multiply' }],
  more: 2,
};

// Stand-in for VS Code: collects messages of the view, and sends messages once the view is ready.
const host = `
const said = [];
window.acquireVsCodeApi = () => ({ postMessage: (message) => { said.push(message); if (message.type === 'ready') queueMicrotask(speak); }, setState: (state) => (document.body.dataset.kept = state.document) });
const tell = (data) => window.dispatchEvent(new MessageEvent('message', { data }));
function speak() {
  const document_ = 'file:///p/a.s';
  tell({ type: 'picture', document: document_, picture: null, stale: false });
  said.push({ note: document.getElementById('note').textContent });
  tell({ type: 'picture', document: document_, picture: ${JSON.stringify(picture)}, stale: true });
  tell({ type: 'cursor', document: document_, lines: [6, 6] });
  document.querySelectorAll('.tp-label')[2].click();
  document.querySelector('svg g[data-row="0"] rect').dispatchEvent(new MouseEvent('click', { bubbles: true }));
  const label = document.querySelectorAll('.tp-label')[0];
  label.focus();
  for (const key of ['ArrowDown', 'Enter']) document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
  const operations = (selector) => [...document.querySelectorAll(selector)].map((one) => one.firstChild.textContent);
  const texts = (selector) => [...document.querySelectorAll(selector)].map((one) => one.textContent);
  said.push({
    note: document.getElementById('note').textContent, labels: operations('.tp-label'), on: operations('.tp-marked'), from: texts('.tp-from'),
    stalls: [...document.querySelectorAll('svg .tp-stall')].map((one) => one.dataset.tip), bands: texts('svg .tp-band').length,
    critical: operations('.tp-on-chain'), links: [...document.querySelectorAll('svg .tp-link')].map((one) => one.dataset.tip), legend: texts('.tp-legend span'),
    issues: [...document.querySelectorAll('svg .tp-issue')].map((one) => one.getAttribute('x') - document.querySelector('.tp-labels').offsetWidth),
  });
  document.body.dataset.said = JSON.stringify(said);
}
`;

test('the view draws, follows and tells', () => {
  const folder = mkdtempSync(join(tmpdir(), 'takt-view-'));
  try {
    const script = pathToFileURL(resolve('dist/view.js')).toString();
    writeFileSync(join(folder, 'host.js'), host);
    const html = page(script, 'file:').replace('<script src', '<script src="host.js"></script><script src');
    writeFileSync(join(folder, 'view.html'), html);
    const dom = execFileSync('chromium', [
      '--headless', '--no-sandbox', '--disable-gpu', `--user-data-dir=${folder}`, '--dump-dom', pathToFileURL(join(folder, 'view.html')).toString(),
    ], { encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'], timeout: 120_000 });
    const said = dom.match(/data-said="([^"]*)"/)?.[1]?.replaceAll('&quot;', '"').replaceAll('&lt;', '<').replaceAll('&gt;', '>').replaceAll('&amp;', '&');
    assert.ok(said, dom);
    const [ready, empty, clicked, drawn, entered, seen] = JSON.parse(said);
    assert.deepEqual(ready, { type: 'ready' });
    assert.match(dom, /data-kept="file:\/\/\/p\/a\.s"/);
    assert.match(empty.note, /when the program assembles/);
    const reveal = (line: number) => ({ type: 'reveal', uri: 'file:///p/a.s', line });
    assert.deepEqual([clicked, drawn, entered], [reveal(7), reveal(5), reveal(6)]);
    assert.match(seen.note, /^3 bundles on t3; 2 bundles more \(of the text before/);
    assert.deepEqual(seen.labels, ['fmul <b0>', 'fmul <b1>', 'fmul <b2>']);
    assert.deepEqual(seen.on, ['fmul <b1>']);
    assert.deepEqual([seen.bands, seen.from], [1, ['period']]);
    assert.deepEqual(seen.stalls, [4, 7].map((cycle) => `2 cycles lost before cycle ${cycle}: the bank's write port is taken\n<taken>`));
    assert.deepEqual([seen.critical, seen.links], [['fmul <b1>', 'fmul <b2>'], ['3 cycles of it: <b> through multiply']]);
    assert.deepEqual(seen.legend, ['multiply 3', 'pale: until the result', "the bank's write port is taken (4 cycles)", 'longest chain']);
    assert.deepEqual(seen.issues.map((x: number) => (x - seen.issues[0]) / (seen.issues[1] - seen.issues[0])), [0, 1, 2], 'every third cycle');
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
});
