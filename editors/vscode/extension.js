// Takt in VS Code: `takt lsp` and `takt dap`, started and asked. Everything else is theirs.
const vscode = require('vscode');
const { LanguageClient } = require('vscode-languageclient/node');

let client;

function command() {
  const settings = vscode.workspace.getConfiguration('takt');
  return { command: settings.get('command'), arguments: settings.get('arguments') };
}

async function start() {
  const { command: program, arguments: options } = command();
  client = new LanguageClient(
    'takt',
    'Takt',
    { command: program, args: ['lsp', ...options] },
    {
      documentSelector: [{ language: 'takt' }],
      synchronize: { fileEvents: vscode.workspace.createFileSystemWatcher('**/*.s') },
    },
  );
  try {
    await client.start();
  } catch (error) {
    vscode.window.showErrorMessage(`Takt: \`${program} lsp\` does not start (setting takt.command): ${error.message}`);
  }
}

// Asks for a number and sends it to the session that is debugged.
function goTo(what) {
  return async () => {
    const session = vscode.debug.activeDebugSession;
    const text = await vscode.window.showInputBox({
      prompt: `Go to which ${what}?`,
      validateInput: (text) => (/^\d+$/.test(text) ? undefined : 'a whole number'),
    });
    if (!session || text === undefined) return;
    try {
      await session.customRequest(`takt/goto${what[0].toUpperCase()}${what.slice(1)}`, { [what]: Number(text) });
    } catch (error) {
      vscode.window.showErrorMessage(`Takt: ${error.message}`);
    }
  };
}

exports.activate = async (context) => {
  context.subscriptions.push(
    vscode.debug.registerDebugAdapterDescriptorFactory('takt', {
      createDebugAdapterDescriptor: () => new vscode.DebugAdapterExecutable(command().command, ['dap']),
    }),
    vscode.debug.registerDebugConfigurationProvider('takt', {
      // Without a launch.json: the file at hand.
      resolveDebugConfiguration(folder, configuration) {
        if (configuration.type) return configuration;
        const editor = vscode.window.activeTextEditor;
        if (!editor || editor.document.languageId !== 'takt') return undefined;
        return { type: 'takt', request: 'launch', name: 'Takt', program: editor.document.fileName };
      },
    }),
    vscode.commands.registerCommand('takt.restart', async () => {
      if (client) await client.stop();
      await start();
    }),
    vscode.commands.registerCommand('takt.gotoCycle', goTo('cycle')),
    vscode.commands.registerCommand('takt.gotoPeriod', goTo('period')),
  );
  await start();
};

exports.deactivate = () => (client ? client.stop() : undefined);
