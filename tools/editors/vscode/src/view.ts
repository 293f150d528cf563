// Script of the view: shows the diagram that the playground and `takt analyse --html` draw, for the document in the editor. Marks
// operations at the cursor, and reports clicks on operations.
import { Pipeline as Picture } from '../../../../emu/analysis/src/pipeline.js';
import { comesFrom, named, plural, type FromView, type Kept, type Operation, type Pipeline, type ToView } from './pipeline';

declare function acquireVsCodeApi(): { postMessage(message: FromView): void; setState(state: Kept): void };

const api = acquireVsCodeApi();
const element = (id: string) => document.getElementById(id)!;
let picture: Pipeline | null = null;
let cursor: { document: string; lines: [number, number] } | undefined;

const drawing = new Picture<Operation>(element('picture'), (operation) => {
  const uri = picture?.files[operation.file ?? -1];
  if (uri && operation.line !== null) api.postMessage({ type: 'reveal', uri, line: operation.line });
});

/** Marks operations whose lines the cursor is on; with `show`, scrolls to the first. */
function mark(show: boolean) {
  drawing.mark((operation) => !!picture && !!cursor && comesFrom(picture, operation, cursor.document, cursor.lines), show);
}

window.addEventListener('message', ({ data }: MessageEvent<ToView>) => {
  if (data.type === 'picture') {
    // After a reload of the window, the extension shows this document again.
    api.setState({ document: data.document });
    picture = data.picture && named(data.picture);
    const more = picture?.more ? `; ${plural(picture.more, 'bundle')} more` : '';
    const count = picture && `${plural(picture.bundles.length, 'bundle')} on ${picture.machine}${more}`;
    const old = data.stale ? ' (of the text before: the program has mistakes, or is being counted)' : '';
    element('note').textContent = count ? count + old : 'The picture appears when the program assembles.';
    document.body.classList.toggle('stale', data.stale);
    drawing.show(picture);
    mark(false);
  } else if (data.type === 'cursor') {
    cursor = { document: data.document, lines: data.lines };
    mark(true);
  }
});
api.postMessage({ type: 'ready' });
