// HTML page of the view.
import STYLE from '../../../../emu/analysis/src/pipeline.css';

// Use the editor's colours; VS Code's theme, not the system's, decides between light and dark.
const THEME = `
:root { --bg: var(--vscode-editor-background); --fg: var(--vscode-foreground); --dim: var(--vscode-descriptionForeground); --edge: var(--vscode-panel-border); --panel: var(--vscode-editorWidget-background); --accent: var(--vscode-focusBorder); --select: var(--vscode-editor-selectionBackground); }
body { padding: 0; margin: 0; height: 100vh; display: flex; flex-direction: column; color: var(--fg); background: var(--bg); font: 12px var(--vscode-font-family, sans-serif); }
#note { padding: 4px 10px; color: var(--dim); } #picture { flex: 1; padding: 0 8px 4px; } #picture:has(.tp-legend:empty) { visibility: hidden; } .stale .tp-scroll, .stale .tp-stalls, .stale .tp-legend { opacity: .45; }
body.vscode-light .tp { --crit:#d6115c; --run-l:78%; --issue-l:46%; } body.vscode-dark .tp { --crit:#ff5c98; --run-l:30%; --issue-l:60%; }
`;

/** HTML page of the view; `script` is the URL of its script, `source` the origin from which the policy allows scripts. */
export function page(script: string, source: string): string {
  const policy = `default-src 'none'; style-src 'unsafe-inline'; script-src ${source}`;
  return `<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="${policy}"><title>Pipeline</title><style>${STYLE}${THEME}</style></head>
<body><div id="note" role="status"></div>
<div id="picture"></div>
<script src="${script}"></script></body></html>
`;
}
