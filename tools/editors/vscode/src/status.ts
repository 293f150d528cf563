// Cycles of the active editor's program in the status bar; a click opens the pipeline view.
import * as vscode from 'vscode';
import type { Ask } from './beside';
import { inStatus } from './pipeline';

/** Milliseconds from a change to a new request. */
const PAUSE = 300;

export class Status implements vscode.Disposable {
  private readonly item = vscode.window.createStatusBarItem('takt.cycles', vscode.StatusBarAlignment.Left);
  private timer: ReturnType<typeof setTimeout> | undefined;
  private readonly subscriptions: vscode.Disposable[] = [];

  constructor(private readonly ask: Ask) {
    this.item.name = 'Takt: cycles';
    this.item.command = 'takt.pipeline';
    this.subscriptions.push(
      this.item,
      vscode.window.onDidChangeActiveTextEditor(() => this.update()),
      vscode.workspace.onDidChangeTextDocument(({ document }) => { if (document.languageId === 'takt') this.later(); }),
      // A mistake may also be in an included file.
      vscode.languages.onDidChangeDiagnostics(() => this.later()),
    );
    this.later();
  }

  /** Called when something has changed, or when the server has counted a program's cycles. */
  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.update(), PAUSE);
  }

  private async update() {
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== 'takt') return this.item.hide();
    const { text, more } = inStatus(await this.ask(document.uri).catch(() => null));
    // Another document may be active by now.
    if (vscode.window.activeTextEditor?.document !== document) return;
    this.item.text = text;
    this.item.tooltip = more;
    this.item.show();
  }

  dispose() {
    clearTimeout(this.timer);
    vscode.Disposable.from(...this.subscriptions).dispose();
  }
}
