// Bundles the extension and the script of its view; with --tests, also the tests.
import { build } from 'esbuild';
import { copyFileSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from 'node:fs';

const tests = process.argv.includes('--tests');
const common = { bundle: true, target: 'es2022', logLevel: 'warning', minify: !tests, loader: { '.css': 'text' } };
const extension = { platform: 'node', format: 'cjs', external: ['vscode'] };
const view = { ...common, entryPoints: ['src/view.ts'], outfile: 'dist/view.js', platform: 'browser', format: 'iife' };

await build(view);
if (tests) {
  const entryPoints = readdirSync('test').filter((name) => name.endsWith('.test.ts')).map((name) => `test/${name}`);
  await build({ ...common, ...extension, entryPoints, outdir: 'dist-tests' });
} else {
  // The package must contain a copy of the licence.
  copyFileSync('../../../LICENSE-MIT', 'LICENSE.txt');
  // VS Code does not show pictures from files beside a page, so embed them in the text.
  const inside = (all, name, path) => `![${name}](data:image/png;base64,${readFileSync(path).toString('base64')})`;
  mkdirSync('dist', { recursive: true });
  writeFileSync('dist/README.md', readFileSync('README.md', 'utf8').replaceAll(/!\[([^\]]*)\]\((pictures\/[^)]+)\)/g, inside));
  await build({ ...common, ...extension, entryPoints: ['src/extension.ts'], outfile: 'dist/extension.js' });
}
