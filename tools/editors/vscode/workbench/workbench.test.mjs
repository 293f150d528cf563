// The extension in VS Code's workbench, in a browser: `cargo xtask extension --workbench`. Workbench and extension host come from the
// package code-server; of its native modules only the terminal's is present, in which tasks run.
import assert from 'node:assert/strict';
import { spawn, execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { chromium } from 'playwright-core';

const HERE = import.meta.dirname;
const SERVER = join(HERE, 'node_modules/code-server/lib/vscode');
const PACKAGE = join(HERE, '../dist/takt.vsix');
const { TAKT, TAKT_SCREENSHOTS: SHOTS } = process.env;
/** Time limit in a browser on a busy machine; ms. */
const PATIENCE = 120_000;
const limit = { timeout: 5 * PATIENCE };

let folder, browser;
const servers = [];

before(async () => {
  assert.ok(TAKT, 'TAKT says which `takt`: `cargo xtask extension --workbench` sets it');
  folder = mkdtempSync(join(tmpdir(), 'takt-workbench-'));
  mkdirSync(join(folder, 'project'));
  cpSync(join(HERE, '../../../../programs/examples/pi.s'), join(folder, 'project/pi.s'));
  const install = ['out/server-main.js', ...folders('good'), '--install-extension', PACKAGE];
  execFileSync(process.execPath, install, { cwd: SERVER, env: environment(), timeout: PATIENCE, stdio: 'pipe' });
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', args: ['--no-sandbox'] });
}, limit);

after(async () => {
  await browser?.close();
  for (const server of servers) server.kill();
  if (folder) rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
});

function environment() {
  return { ...process.env, HOME: folder };
}

function folders(name) {
  return ['--accept-server-license-terms', '--extensions-dir', join(folder, 'extensions'), '--server-data-dir', join(folder, name)];
}

/** Opens a workbench on the project, with `takt` as the executable in its settings. */
async function open(name, takt) {
  const machine = join(folder, name, 'data/Machine');
  mkdirSync(machine, { recursive: true });
  const settings = { 'takt.command': takt, 'workbench.startupEditor': 'none', 'terminal.integrated.gpuAcceleration': 'off', 'telemetry.telemetryLevel': 'off', 'extensions.ignoreRecommendations': true };
  writeFileSync(join(machine, 'settings.json'), JSON.stringify(settings));
  const options = ['--host', '127.0.0.1', '--port', '0', '--without-connection-token', '--disable-workspace-trust', ...folders(name)];
  const server = spawn(process.execPath, ['out/server-main.js', ...options], { cwd: SERVER, env: environment() });
  servers.push(server);
  const port = await new Promise((resolve, reject) => {
    let said = '';
    server.stdout.on('data', (data) => {
      said += data;
      const found = /listening on (\d+)/.exec(said);
      if (found) resolve(found[1]);
    });
    server.stderr.resume();
    server.on('exit', () => reject(new Error(`the server ended: ${said}`)));
  });
  const page = await browser.newPage({ viewport: { width: 1400, height: 900 } });
  page.setDefaultTimeout(PATIENCE);
  await page.goto(`http://127.0.0.1:${port}/?folder=${join(folder, 'project')}`);
  await page.dblclick('.explorer-folders-view .monaco-list-row[aria-label="pi.s"]');
  await page.waitForSelector('.monaco-editor .view-line');
  return page;
}

async function shot(page, name) {
  if (!SHOTS) return;
  mkdirSync(SHOTS, { recursive: true });
  await page.screenshot({ path: join(SHOTS, `vscode-${name}.png`) });
}

/** Runs a part of a test; takes a screenshot if it fails. */
async function part(t, page, name, body) {
  await t.test(name, limit, async () => {
    try {
      await body();
    } catch (error) {
      await shot(page, `failed-${name.replaceAll(/[^a-z]+/gi, '-')}`);
      throw error;
    }
  });
}

/** Executes a command of the palette by its title. */
async function command(page, title) {
  await page.keyboard.press('F1');
  await page.locator('.quick-input-widget input.input').waitFor();
  await pick(page, title);
}

/** Types into the open box, and accepts the first entry once it matches; lists are filled late. */
async function pick(page, text) {
  await page.keyboard.type(text);
  await page.locator('.quick-input-list .monaco-list-row.focused', { hasText: text }).waitFor();
  await page.waitForTimeout(1000);
  await page.locator('.quick-input-list .monaco-list-row.focused', { hasText: text }).waitFor();
  await page.keyboard.press('Enter');
}

/** Moves the cursor to the beginning of a line. */
async function goTo(page, line) {
  // The first editor group shows the source, wherever the focus was.
  await page.keyboard.press('Control+1');
  await page.keyboard.press('Control+g');
  await page.keyboard.type(`${line}`);
  await page.keyboard.press('Enter');
  await page.keyboard.press('Home');
}

/** Opens a file of the project by name, with the cursor at its beginning. */
async function openFile(page, name) {
  await page.keyboard.press('Control+1');
  await page.locator('.explorer-folders-view .monaco-list-row', { hasText: name }).dblclick();
  await page.locator('.tab.active', { hasText: name }).waitFor();
  await page.keyboard.press('Control+Home');
}

const source = () => readFileSync(join(folder, 'project/pi.s'), 'utf8');
const LINES = readFileSync(join(HERE, '../../../../programs/examples/pi.s'), 'utf8').split('\n');
/** Line number of the first operation in the period, from 1. */
const FIRST = LINES.findIndex((line) => /^\s+fsub\s+e,/.test(line)) + 1;

test('a server that does not start is told with the reason', limit, async () => {
  const page = await open('broken', '/nowhere/takt');
  const told = page.locator('.notification-list-item', { hasText: 'does not start' });
  await told.waitFor();
  const text = await told.textContent();
  assert.match(text, /\/nowhere\/takt lsp.*takt\.command/);
  assert.doesNotMatch(text, /undefined/);
  await page.close();
});

test('cycles, a mistake and its fix, the pipeline beside the source, the debugger', limit, async (t) => {
  const page = await open('good', TAKT);
  await part(t, page, 'cycles stand above sections and behind lines', async () => {
    await page.locator('.codelens-decoration', { hasText: 'period: 38 cycles, lower bound 38' }).waitFor();
    await page.locator('.view-line', { hasText: 'fsub' }).filter({ hasText: '1 · add' }).first().waitFor();
  });
  await part(t, page, 'a mistake is marked as it is typed, and mended by its fix', async () => {
    await goTo(page, FIRST);
    await page.keyboard.type('x');
    await page.waitForSelector('.squiggly-error');
    const fix = page.locator('.action-widget .monaco-list-row', { hasText: 'write `fsub`' });
    // While the diagnostic is still on its way, no fix is offered.
    for (let asked = 0; asked < 10 && !(await fix.isVisible()); asked++) {
      await page.keyboard.press('Escape');
      await page.keyboard.press('Control+.');
      await page.waitForTimeout(2000);
    }
    await shot(page, 'fix');
    // Use the keyboard: menus of VS Code ignore the mouse for a while.
    await page.keyboard.press('Enter');
    await page.locator('.view-line', { hasText: 'xfsub' }).waitFor({ state: 'detached' });
    await page.keyboard.press('Control+s');
    for (let looked = 0; looked < 40 && source().includes('xfsub'); looked++) await page.waitForTimeout(500);
    assert.equal(source(), LINES.join('\n'));
  });
  await part(t, page, 'the pipeline follows the cursor, and the cursor the pipeline', async () => {
    await page.keyboard.press('Control+k');
    await page.keyboard.press('p');
    const picture = page.frameLocator('iframe.webview').frameLocator('#active-frame');
    const row = (text) => picture.locator('div[data-row]', { hasText: text });
    await row('fsub e, w_ref, w').waitFor();
    await goTo(page, FIRST);
    await picture.locator('.tp-marked', { hasText: 'fsub e, w_ref, w' }).waitFor();
    assert.ok(await picture.locator('.tp-critical').count(), 'the longest chain is marked');
    await shot(page, 'pipeline');
    await row('wait period').last().click();
    const wait = LINES.findLastIndex((line) => /^\s+wait\s+period/.test(line)) + 1;
    await page.locator('.statusbar-item', { hasText: `Ln ${wait},` }).waitFor();
  });
  await part(t, page, 'the status bar has the cycles, and the view comes back with the window', async () => {
    await page.locator('.statusbar-item', { hasText: 'period: 38 cycles, lower bound 38' }).waitFor();
    // Reload the window as users do; VS Code restores what was open.
    await Promise.all([page.waitForEvent('load'), command(page, 'Developer: Reload Window')]);
    const picture = page.frameLocator('iframe.webview').frameLocator('#active-frame');
    await picture.locator('div[data-row]', { hasText: 'fsub e, w_ref, w' }).waitFor();
    await shot(page, 'reloaded');
    if (!SHOTS) return;
    for (const name of ['dark', 'light']) {
      await command(page, 'Preferences: Toggle between Light/Dark Themes');
      await page.waitForTimeout(2000);
      await shot(page, name);
    }
  });
  await part(t, page, 'a mistake in an included file dims the view until it is mended', async () => {
    const part = 'gain.s', body = readFileSync(join(folder, 'project/pi.s'), 'utf8');
    writeFileSync(join(folder, 'project', part), '.const  K2 = 2\n');
    const end = body.lastIndexOf('        wait');
    writeFileSync(join(folder, 'project/whole.s'), `.include "${part}"\n${body.slice(0, end)}        fadd    s, s, K2\n${body.slice(end)}`);
    await openFile(page, 'whole.s');
    const picture = page.frameLocator('iframe.webview').frameLocator('#active-frame');
    const note = (text) => picture.locator('#note', { hasText: text });
    // The program has been counted, and the diagram belongs to it.
    await note('13 bundles on t3').waitFor();
    await openFile(page, part);
    await page.keyboard.type('x');
    await openFile(page, 'whole.s');
    await note('of the text before').waitFor();
    assert.ok(await picture.locator('body.stale').count(), 'it is dimmed');
    await page.locator('.statusbar-item', { hasText: /period: 4\d cycles, lower bound 4\d before/ }).waitFor();
    await shot(page, 'stale');
    await openFile(page, part);
    await page.keyboard.press('Control+z');
    await openFile(page, 'whole.s');
    await note('of the text before').waitFor({ state: 'detached' });
    await openFile(page, part);
    await page.keyboard.press('Control+s');
    await openFile(page, 'pi.s');
  });
  await part(t, page, 'the debugger stops, steps and steps back', async () => {
    await goTo(page, FIRST);
    await page.keyboard.press('F5');
    await page.locator('.debug-call-stack', { hasText: 'pi.s' }).waitFor();
    const at = () => page.locator('.debug-call-stack .stack-frame .line-number').first().textContent();
    const first = await at();
    await page.keyboard.press('F10');
    await page.waitForFunction((old) => {
      const now = document.querySelector('.debug-call-stack .stack-frame .line-number')?.textContent;
      return now && now !== old;
    }, first);
    await shot(page, 'debugger');
    await page.click('.debug-toolbar .codicon-debug-step-back');
    await page.waitForFunction((old) => document.querySelector('.debug-call-stack .stack-frame .line-number')?.textContent === old, first);
    await page.keyboard.press('Shift+F5');
    await page.waitForSelector('.debug-toolbar', { state: 'hidden' });
  });
});

test('tasks, the problem matcher, snippets, the walkthrough', limit, async (t) => {
  writeFileSync(join(folder, 'project/wrong.s'), '.reg a\n        fad     a, a\n        halt\n');
  mkdirSync(join(folder, 'project/.vscode'));
  const assemble = { label: 'assemble the wrong one', type: 'takt', command: 'asm', file: 'wrong.s', problemMatcher: '$takt' };
  writeFileSync(join(folder, 'project/.vscode/tasks.json'), JSON.stringify({ version: '2.0.0', tasks: [assemble] }));
  const page = await open('tasks', TAKT);
  // The extension is active once the cycles appear.
  await page.locator('.codelens-decoration', { hasText: 'period: 38 cycles' }).waitFor();
  const task = async (name) => {
    await page.keyboard.press('Control+p');
    // First select the type of the task, then the task.
    await page.keyboard.type('task takt');
    await page.locator('.quick-input-list .monaco-list-row.focused', { hasText: 'takt' }).waitFor();
    await page.keyboard.press('Enter');
    await page.locator('.quick-input-list .monaco-list-row', { hasText: name }).first().waitFor();
    await pick(page, name);
  };
  const terminal = () => page.evaluate(() => [...document.querySelectorAll('.xterm-rows > div')].map((row) => row.textContent).join('\n'));
  const said = (pattern) => page.waitForFunction((source) => {
    const rows = [...document.querySelectorAll('.xterm-rows > div')].map((row) => row.textContent.replaceAll('\u00a0', ' '));
    return new RegExp(source).test(rows.join('\n'));
  }, pattern).catch(async (error) => { throw new Error(`${error.message}; the terminal has: ${await terminal()}`); });

  await part(t, page, 'a task runs `takt` on the source at hand', async () => {
    await task('bound');
    await said('period +38');
    await shot(page, 'task');
  });
  await part(t, page, 'what a task complains of stands among the problems, at its place', async () => {
    // The language server does not report on a file that is not open, so the diagnostic is the task's.
    await page.keyboard.press('Control+p');
    await page.keyboard.type('task assemble');
    await page.locator('.quick-input-list .monaco-list-row.focused', { hasText: assemble.label }).waitFor();
    await page.keyboard.press('Enter');
    await said('there is no instruction');
    await command(page, 'Problems: Focus on Problems View');
    const problem = page.locator('.markers-panel .monaco-list-row', { hasText: 'there is no instruction or macro `fad`' });
    await problem.waitFor();
    await shot(page, 'problems');
    await problem.dblclick();
    await page.locator('.statusbar-item', { hasText: 'Ln 2,' }).waitFor();
    // The file is now open: the language server's diagnostic replaces the task's, even when the task runs again.
    await page.locator('.view-line', { hasText: 'fad' }).first().waitFor();
    await page.waitForTimeout(3000);
    assert.equal(await problem.count(), 1, 'it stands once');
    await command(page, 'Tasks: Rerun Last Task');
    await page.waitForTimeout(8000);
    await command(page, 'Problems: Focus on Problems View');
    await shot(page, 'problems-once');
    assert.equal(await problem.count(), 1, 'it stands once, although task and server found it');
  });
  await part(t, page, 'a snippet writes a controller that assembles', async () => {
    writeFileSync(join(folder, 'project/new.s'), '');
    await page.locator('.explorer-folders-view .monaco-list-row[aria-label="new.s"]').waitFor();
    await page.dblclick('.explorer-folders-view .monaco-list-row[aria-label="new.s"]');
    await page.locator('.tab.active', { hasText: 'new.s' }).waitFor();
    await page.keyboard.press('Control+1');
    await command(page, 'Snippets: Insert Snippet');
    await page.locator('.quick-input-list .monaco-list-row', { hasText: 'controller' }).first().waitFor();
    await page.keyboard.type('controller');
    await page.keyboard.press('Enter');
    await page.locator('.view-line', { hasText: 'wait' }).waitFor();
    await page.keyboard.press('Escape');
    await page.keyboard.press('Control+s');
    const file = join(folder, 'project/new.s');
    for (let looked = 0; looked < 40 && readFileSync(file, 'utf8') === ''; looked++) await page.waitForTimeout(500);
    execFileSync(TAKT, ['asm', file], { stdio: 'pipe' });
  });
  await part(t, page, "the extension's page has an icon and shows its pictures", async () => {
    await command(page, 'Extensions: Show Enabled Extensions');
    await page.locator('.extension-list-item', { hasText: 'Takt' }).first().click();
    const pictures = page.locator('.extension-editor iframe.webview').or(page.locator('iframe.webview')).last().contentFrame().frameLocator('#active-frame').locator('img');
    await pictures.first().waitFor();
    const widths = await pictures.evaluateAll(async (all) => Promise.all(all.map(async (one) => (await one.decode(), one.naturalWidth))));
    assert.ok(widths.length >= 2 && widths.every((width) => width > 500), `${widths}`);
    const icon = page.locator('.extension-editor img.icon').first();
    assert.ok(await icon.evaluate((one) => one.naturalWidth) === 256);
    await shot(page, 'extension');
  });
  await part(t, page, 'the walkthrough opens, and its steps do what they say', async () => {
    await command(page, 'Welcome: Open Walkthrough');
    await page.locator('.quick-input-list .monaco-list-row', { hasText: 'Get started with Takt' }).first().waitFor();
    await page.keyboard.type('Get started with Takt');
    await page.keyboard.press('Enter');
    const step = (title) => page.locator('.gettingStarted .getting-started-step', { hasText: title });
    for (const title of ['Install Takt', 'Write a controller', 'See where the cycles go', 'Debug, forward and back']) {
      await step(title).waitFor();
    }
    await shot(page, 'walkthrough');
    await step('Write a controller').click();
    await page.locator('.gettingStarted .monaco-button', { hasText: 'New file' }).click();
    await page.locator('.tab.active', { hasText: 'Untitled' }).waitFor();
    await page.locator('.statusbar-item', { hasText: 'Takt' }).first().waitFor();
  });
});
