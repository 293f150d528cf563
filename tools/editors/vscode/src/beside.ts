// The view beside the source: which document it shows, and what is said between the two.
import * as vscode from 'vscode';
import { page } from './page';
import { fromView, type Pipeline, type ToView } from './pipeline';

/** Milliseconds from a change of the text to a new question about lines that have moved. */
const PAUSE = 200;

/** Asks the language server for a document's picture. */
export type Ask = (document: vscode.Uri) => Promise<Pipeline | null>;

export class Beside implements vscode.Disposable {
  private panel: vscode.WebviewPanel | undefined;
  private shown: vscode.TextEditor | undefined;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private readonly subscriptions: vscode.Disposable[] = [];

  constructor(private readonly folder: vscode.Uri, private readonly ask: Ask) {
    this.subscriptions.push(
      vscode.window.onDidChangeActiveTextEditor((editor) => {
        if (editor?.document.languageId === 'takt') void this.show(editor);
      }),
      vscode.window.onDidChangeTextEditorSelection(({ textEditor }) => {
        if (textEditor === this.shown) this.follow();
      }),
      vscode.workspace.onDidChangeTextDocument(({ document }) => {
        if (document === this.shown?.document) this.later();
      }),
    );
  }

  /** Opens the view for an editor, or brings it to the front. */
  async open(editor: vscode.TextEditor) {
    if (!this.panel) {
      const resources = vscode.Uri.joinPath(this.folder, 'dist');
      this.panel = vscode.window.createWebviewPanel(
        'takt.pipeline',
        'Pipeline',
        { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true },
        { enableScripts: true, localResourceRoots: [resources], retainContextWhenHidden: true },
      );
      const { webview } = this.panel;
      webview.onDidReceiveMessage((message) => this.heard(message), undefined, this.subscriptions);
      this.panel.onDidDispose(() => { this.panel = undefined; });
      const script = webview.asWebviewUri(vscode.Uri.joinPath(resources, 'view.js'));
      this.shown = editor;
      // The view asks for its picture when it is ready.
      webview.html = page(script.toString(), webview.cspSource);
      return;
    }
    this.panel.reveal(undefined, true);
    await this.show(editor);
  }

  /** The server has counted a program anew. */
  counted() {
    this.later();
  }

  private later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { if (this.shown) void this.show(this.shown); }, PAUSE);
  }

  private async show(editor: vscode.TextEditor) {
    this.shown = editor;
    if (!this.panel) return;
    const { document } = editor;
    const version = document.version;
    let picture: Pipeline | null = null;
    try {
      picture = await this.ask(document.uri);
    } catch {
      // The server has not read the document yet, or is gone, which the client tells.
    }
    // Another document may be shown by now.
    if (this.shown !== editor || !this.panel) return;
    const errors = vscode.languages.getDiagnostics(document.uri);
    const stale = version !== document.version || errors.some((one) => one.severity === vscode.DiagnosticSeverity.Error);
    this.send({ type: 'picture', document: document.uri.toString(), picture, stale });
    this.follow();
  }

  private follow() {
    if (!this.shown) return;
    const { document, selection } = this.shown;
    this.send({ type: 'cursor', document: document.uri.toString(), lines: [selection.start.line, selection.end.line] });
  }

  private send(message: ToView) {
    void this.panel?.webview.postMessage(message);
  }

  private async heard(message: unknown) {
    const heard = fromView(message);
    if (heard?.type === 'ready' && this.shown) await this.show(this.shown);
    if (heard?.type !== 'reveal') return;
    try {
      const document = await vscode.workspace.openTextDocument(vscode.Uri.parse(heard.uri));
      const line = Math.min(heard.line, document.lineCount - 1);
      const range = document.lineAt(line).range;
      await vscode.window.showTextDocument(document, {
        viewColumn: this.shown?.viewColumn ?? vscode.ViewColumn.One,
        selection: new vscode.Range(range.start, range.start),
      });
    } catch (error) {
      void vscode.window.showErrorMessage(`Takt: ${(error as Error).message}`);
    }
  }

  dispose() {
    clearTimeout(this.timer);
    this.panel?.dispose();
    vscode.Disposable.from(...this.subscriptions).dispose();
  }
}
