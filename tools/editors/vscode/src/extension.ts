// Takt in VS Code: starts `takt lsp` and `takt dap`, and shows the pipeline view. All knowledge of the language is in these two.
import * as vscode from 'vscode';
import { LanguageClient } from 'vscode-languageclient/node';
import { Beside } from './beside';
import type { Pipeline } from './pipeline';
import { isSource } from './recognise';
import { reason } from './reason';
import { Status } from './status';
import { COMMANDS, words, type Definition } from './tasks';

let client: LanguageClient | undefined;
let beside: Beside | undefined;
let status: Status | undefined;

function settings(): { program: string; options: string[] } {
  const settings = vscode.workspace.getConfiguration('takt');
  return { program: settings.get('command', 'takt'), options: settings.get('arguments', []) };
}

async function start() {
  const { program, options } = settings();
  client = new LanguageClient(
    'takt',
    'Takt',
    { command: program, args: ['lsp', ...options] },
    {
      documentSelector: [{ language: 'takt' }],
      // Owner of the problem matcher: diagnostics of the server replace those of a task for the same file, so that none appears twice.
      diagnosticCollectionName: 'takt',
      synchronize: { fileEvents: vscode.workspace.createFileSystemWatcher('**/*.{s,tks}') },
    },
  );
  client.registerFeature({
    getState: () => ({ kind: 'static' }),
    fillClientCapabilities: (capabilities) => {
      capabilities.experimental = { ...capabilities.experimental, 'takt/counted': true, 'takt/runs': true };
    },
    initialize: () => undefined,
    clear: () => undefined,
  });
  client.onNotification('takt/counted', () => {
    beside?.counted();
    status?.later();
  });
  try {
    await client.start();
  } catch (error) {
    const open = 'Open the setting';
    const text = `Takt: \`${program} lsp\` does not start (setting takt.command): ${reason(error)}`;
    void vscode.window.showErrorMessage(text, open).then((chosen) => {
      if (chosen === open) void vscode.commands.executeCommand('workbench.action.openSettings', 'takt.command');
    });
  }
}

/** Starts the server with the first source of Takt: a window of other texts needs none. */
async function begin() {
  if (!client && vscode.workspace.textDocuments.some((document) => document.languageId === 'takt')) await start();
}

async function restart() {
  await client?.stop().catch(() => undefined);
  await start();
}

/** Asks the user for a number, and sends it to the active debug session. */
function goTo(what: 'cycle' | 'period') {
  return async () => {
    const session = vscode.debug.activeDebugSession;
    const text = await vscode.window.showInputBox({
      prompt: `Go to which ${what}?`,
      validateInput: (text) => (/^\d+$/.test(text) ? undefined : 'a whole number'),
    });
    if (!session || text === undefined) return;
    try {
      await session.customRequest(what === 'cycle' ? 'takt/gotoCycle' : 'takt/gotoPeriod', { [what]: Number(text) });
    } catch (error) {
      void vscode.window.showErrorMessage(`Takt: ${reason(error)}`);
    }
  };
}

function task(definition: Definition, scope: vscode.TaskScope | vscode.WorkspaceFolder): vscode.Task | undefined {
  const found = words(settings().program, definition);
  if (typeof found === 'string') {
    void vscode.window.showErrorMessage(`Takt: in the task: ${found}`);
    return undefined;
  }
  const [program, ...rest] = found;
  const execution = new vscode.ProcessExecution(program!, rest);
  return new vscode.Task(definition, scope, `${definition.command} ${definition.file}`, 'takt', execution, '$takt');
}

const tasks: vscode.TaskProvider = {
  provideTasks() {
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== 'takt' || document.uri.scheme !== 'file') return [];
    const file = vscode.workspace.asRelativePath(document.uri, false);
    const scope = vscode.workspace.getWorkspaceFolder(document.uri) ?? vscode.TaskScope.Workspace;
    return COMMANDS.flatMap((command) => task({ type: 'takt', command, file }, scope) ?? []);
  },
  resolveTask({ definition, scope }) {
    return task(definition as Definition, scope ?? vscode.TaskScope.Workspace);
  },
};

const configurations: vscode.DebugConfigurationProvider = {
  // Without a launch.json, debug the file in the active editor.
  resolveDebugConfiguration(_, configuration) {
    if (configuration.type) return configuration;
    const document = vscode.window.activeTextEditor?.document;
    if (document?.languageId !== 'takt') return undefined;
    return { type: 'takt', request: 'launch', name: 'Takt', program: document.fileName };
  },
};

/** Runs a program on the emulator, in a task. */
async function run(uri: vscode.Uri) {
  const file = vscode.workspace.asRelativePath(uri, false);
  const inputs = await table(uri);
  const definition: Definition = { type: 'takt', command: 'run', file, ...(inputs && { arguments: ['--inputs', inputs] }) };
  const one = task(definition, vscode.workspace.getWorkspaceFolder(uri) ?? vscode.TaskScope.Workspace);
  if (one) await vscode.tasks.executeTask(one);
}

/** Debugs a program. */
async function debug(uri: vscode.Uri) {
  const inputs = await table(uri);
  const configuration = { type: 'takt', request: 'launch', name: 'Takt', program: uri.fsPath, ...(inputs && { inputs }) };
  await vscode.debug.startDebugging(vscode.workspace.getWorkspaceFolder(uri), configuration);
}

/** Command of a code lens, which gives the program's URI, or of the palette, which gives none: then the active editor's program. */
function runs(command: (uri: vscode.Uri) => Promise<void>) {
  return async (uri?: string) => {
    const document = vscode.window.activeTextEditor?.document;
    const file = uri === undefined ? document?.uri : vscode.Uri.parse(uri);
    if (file?.scheme !== 'file') return void vscode.window.showInformationMessage('Takt: only a program in a file runs: save it first.');
    await vscode.workspace.textDocuments.find((open) => open.uri.toString() === file.toString())?.save();
    await command(file);
  };
}

/** Table of inputs of the program's name, as `pi.csv` of `pi.s`, if there is one. */
async function table(uri: vscode.Uri): Promise<string | undefined> {
  const csv = uri.with({ path: uri.path.replace(/\.[^./]*$/, '.csv') });
  const isThere = await vscode.workspace.fs.stat(csv).then(() => true, () => false);
  return isThere ? csv.fsPath : undefined;
}

/** A document called *.s with a directive that GNU's assembler does not know is a source of Takt; others stay as they are. */
async function recognise(document: vscode.TextDocument) {
  if (document.languageId !== 'takt' && document.fileName.endsWith('.s') && isSource(document.getText())) {
    await vscode.languages.setTextDocumentLanguage(document, 'takt');
  }
}

export async function activate(context: vscode.ExtensionContext) {
  const ask = async (uri: vscode.Uri) => {
    const textDocument = { uri: client!.code2ProtocolConverter.asUri(uri) };
    return client!.sendRequest<Pipeline | null>('takt/pipeline', { textDocument });
  };
  beside = new Beside(context.extensionUri, ask);
  status = new Status(ask);
  context.subscriptions.push(
    beside,
    status,
    vscode.workspace.onDidOpenTextDocument(async (document) => {
      await recognise(document);
      await begin();
    }),
    vscode.debug.registerDebugAdapterDescriptorFactory('takt', {
      createDebugAdapterDescriptor: () => new vscode.DebugAdapterExecutable(settings().program, ['dap']),
    }),
    vscode.debug.registerDebugConfigurationProvider('takt', configurations),
    vscode.tasks.registerTaskProvider('takt', tasks),
    vscode.commands.registerCommand('takt.restart', restart),
    vscode.commands.registerCommand('takt.pipeline', async () => {
      const editor = vscode.window.activeTextEditor;
      if (editor?.document.languageId === 'takt') await beside?.open(editor);
      else void vscode.window.showInformationMessage('Takt: the pipeline is that of a Takt source: open one.');
    }),
    vscode.commands.registerCommand('takt.run', runs(run)),
    vscode.commands.registerCommand('takt.debug', runs(debug)),
    vscode.commands.registerCommand('takt.gotoCycle', goTo('cycle')),
    vscode.commands.registerCommand('takt.gotoPeriod', goTo('period')),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration('takt')) void restart();
    }),
  );
  await Promise.all(vscode.workspace.textDocuments.map(recognise));
  await begin();
}

export function deactivate() {
  return client?.stop();
}
