// The page of the view.

const STYLE = `
body { padding: 0; margin: 0; height: 100vh; display: flex; flex-direction: column; color: var(--vscode-foreground); font: 12px var(--vscode-font-family, sans-serif); }
#note { padding: 4px 10px; color: var(--vscode-descriptionForeground); }
#picture { overflow: auto; flex: 1; }
#picture > div { display: flex; width: max-content; min-width: 100%; }
#labels { position: sticky; left: 0; z-index: 1; padding-top: 20px; background: var(--vscode-editor-background); border-right: 1px solid var(--vscode-panel-border); font-family: var(--vscode-editor-font-family, monospace); }
#labels div { box-sizing: border-box; height: 18px; line-height: 18px; padding: 0 8px; max-width: 22em; overflow: hidden; text-overflow: ellipsis; white-space: pre; cursor: pointer; }
#labels .first { border-top: 1px solid var(--vscode-panel-border); }
#labels .on { background: var(--vscode-editor-selectionBackground); }
#labels div:focus-visible { outline: 1px solid var(--vscode-focusBorder); outline-offset: -1px; }
svg { flex: none; } svg g { cursor: pointer; } svg text { fill: var(--vscode-descriptionForeground); font-size: 11px; }
.grid, .stretch { stroke: var(--vscode-panel-border); } .band { fill: var(--vscode-editor-selectionBackground); }
.issue { fill: var(--vscode-charts-blue); } .run { fill: var(--vscode-charts-blue); opacity: .4; } .idle { fill: var(--vscode-panel-border); }
.stall { fill: var(--vscode-charts-orange); } .stall.unit { fill: var(--vscode-charts-red); } .stall.destination { fill: var(--vscode-charts-purple); }
.stall.drain { fill: var(--vscode-charts-green); } .stall.branch, .stall.wait { fill: var(--vscode-descriptionForeground); opacity: .5; }
.stall.write-port { fill: var(--vscode-charts-yellow); }
`;

/** The page; `script` is where its script can be loaded from, `source` what the policy allows it from. */
export function page(script: string, source: string): string {
  const policy = `default-src 'none'; style-src 'unsafe-inline'; script-src ${source}`;
  return `<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="${policy}"><title>Pipeline</title><style>${STYLE}</style></head>
<body><div id="note" role="status"></div>
<div id="picture"><div><div id="labels"></div><svg id="svg" role="img" aria-label="When each operation issues"></svg></div></div>
<script src="${script}"></script></body></html>
`;
}
