// The cycles of the program at hand in the status bar; a click shows its pipeline.
import * as vscode from 'vscode';
import type { Ask } from './beside';
import { inStatus } from './pipeline';

/** Milliseconds from a change to a new question. */
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
      // A mistake in an included file, too.
      vscode.languages.onDidChangeDiagnostics(() => this.later()),
    );
    this.later();
  }

  /** Something has changed, or the server has counted a program. */
  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.update(), PAUSE);
  }

  private async update() {
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== 'takt') return this.item.hide();
    const { text, more } = inStatus(await this.ask(document.uri).catch(() => null));
    // Another document may be at hand by now.
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
