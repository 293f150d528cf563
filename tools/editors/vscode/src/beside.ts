// View beside the source: the document that it shows, and the messages between view and extension.
import * as vscode from 'vscode';
import { page } from './page';
import { fromView, kept, type Pipeline, type ToView } from './pipeline';

/** Milliseconds from a change of the text to a new request, since lines may have moved. */
const PAUSE = 200;

/** Requests the pipeline diagram of a document from the language server. */
export type Ask = (document: vscode.Uri) => Promise<Pipeline | null>;

/** Type of the view, under which VS Code restores it. */
const VIEW = 'takt.pipeline';

/** A document, and the editor column that shows it. */
interface Shown { document: vscode.TextDocument; viewColumn?: vscode.ViewColumn | undefined; selection?: vscode.Selection }

export class Beside implements vscode.Disposable, vscode.WebviewPanelSerializer {
  private panel: vscode.WebviewPanel | undefined;
  private shown: Shown | undefined;
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
      // A mistake in an included file makes the diagram stale; correcting it makes the diagram current.
      vscode.languages.onDidChangeDiagnostics(() => this.later()),
      vscode.window.registerWebviewPanelSerializer(VIEW, this),
      vscode.workspace.onDidChangeTextDocument(({ document }) => {
        if (document === this.shown?.document) this.later();
      }),
    );
  }

  /** Opens the view for an editor, or brings it to the front. */
  async open(editor: vscode.TextEditor) {
    if (!this.panel) {
      this.shown = editor;
      const where = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true };
      this.fill(vscode.window.createWebviewPanel(VIEW, 'Pipeline', where, { retainContextWhenHidden: true }));
      return;
    }
    this.panel.reveal(undefined, true);
    await this.show(editor);
  }

  /** Restores the view that was open when the window was closed or reloaded. */
  async deserializeWebviewPanel(panel: vscode.WebviewPanel, state: unknown) {
    const document = kept(state);
    try {
      const uri = document === undefined ? undefined : vscode.Uri.parse(document);
      if (uri) this.shown = this.editor(uri) ?? { document: await vscode.workspace.openTextDocument(uri) };
    } catch {
      // The document no longer exists: show that of the next editor.
    }
    this.fill(panel);
  }

  private editor(document: vscode.Uri) {
    return vscode.window.visibleTextEditors.find((one) => one.document.uri.toString() === document.toString());
  }

  /** Loads the page of the view, which requests its diagram when it is ready. */
  private fill(panel: vscode.WebviewPanel) {
    const resources = vscode.Uri.joinPath(this.folder, 'dist');
    const { webview } = panel;
    this.panel = panel;
    webview.options = { enableScripts: true, localResourceRoots: [resources] };
    webview.onDidReceiveMessage((message) => this.heard(message), undefined, this.subscriptions);
    panel.onDidDispose(() => { this.panel = undefined; });
    const script = webview.asWebviewUri(vscode.Uri.joinPath(resources, 'view.js'));
    webview.html = page(script.toString(), webview.cspSource);
  }

  /** Called when the server has counted a program's cycles again. */
  counted() {
    this.later();
  }

  private later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { if (this.shown) void this.show(this.shown); }, PAUSE);
  }

  private async show(editor: Shown) {
    this.shown = editor;
    if (!this.panel) return;
    const { document } = editor;
    const version = document.version;
    let picture: Pipeline | null = null;
    try {
      picture = await this.ask(document.uri);
    } catch {
      // The server has not read the document yet; or it has ended, which the client reports.
    }
    // The view may show another document by now.
    if (this.shown !== editor || !this.panel) return;
    const stale = version !== document.version || picture?.current === false;
    this.send({ type: 'picture', document: document.uri.toString(), picture, stale });
    this.follow();
  }

  private follow() {
    if (!this.shown) return;
    const { document, selection } = this.shown;
    if (!selection) return;
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
