// Microsoft's test client for the debug adapter protocol, run against `takt dap`: writes its findings to standard output as JSON.
const { DebugClient } = require('@vscode/debugadapter-testsupport');
const [takt, folder] = process.argv.slice(2);
const path = require('path');
const program = path.join(folder, 'sum.s');
const found = {};

async function main() {
  const client = new DebugClient(takt, 'dap', 'takt', { cwd: folder });
  client.defaultTimeout = 60000;
  await client.start();
  const capabilities = (await client.initializeRequest()).body;
  found.stepsBack = capabilities.supportsStepBack;
  // Errors in a configuration are reported.
  found.refused = await client.launchRequest({ program: path.join(folder, 'none.s') }).catch((error) => error.message);
  await Promise.all([
    client.waitForEvent('initialized'),
    client.launchRequest({ program, stopOnEntry: true }),
  ]);
  const lines = (await client.setBreakpointsRequest({
    source: { path: program },
    breakpoints: [{ line: 12, hitCondition: '2' }, { line: 8, logMessage: 'i is {i}' }, { line: 1 }],
  })).body.breakpoints;
  found.verified = lines.map((line) => line.verified);
  found.unverified = lines[2].message;
  const logged = [];
  client.on('output', (event) => logged.push(event.body.output.trim()));
  const stopped = () => client.waitForEvent('stopped').then((event) => event.body.reason);
  const entry = stopped();
  await client.configurationDoneRequest();
  found.entry = await entry;
  const threadId = 1;
  const top = async () => {
    const frames = (await client.stackTraceRequest({ threadId })).body.stackFrames;
    return { line: frames[0].line, name: frames[0].name, depth: frames.length, file: frames[0].source && frames[0].source.path };
  };
  const run = async (request) => {
    const reason = stopped();
    await request({ threadId });
    return { reason: await reason, ...(await top()) };
  };
  found.second = await run((a) => client.continueRequest(a));
  found.logged = logged.slice();
  const scopes = (await client.scopesRequest({ frameId: 0 })).body.scopes;
  found.scopes = scopes.map((scope) => scope.name);
  const registers = scopes.find((scope) => scope.name === 'Registers').variablesReference;
  const rows = (await client.variablesRequest({ variablesReference: registers })).body.variables;
  found.i = rows.find((row) => row.name === 'i').value;
  const views = rows.find((row) => row.name === 'i').variablesReference;
  found.views = (await client.variablesRequest({ variablesReference: views })).body.variables.map((row) => row.name);
  found.evaluated = (await client.evaluateRequest({ expression: 'i + 40', context: 'watch' })).body.result;
  found.wrong = await client.evaluateRequest({ expression: 'i +', context: 'watch' }).catch((error) => error.message);
  found.out = await run((a) => client.stepOutRequest(a));
  found.back = await run((a) => client.stepBackRequest(a));
  found.set = (await client.setVariableRequest({ variablesReference: registers, name: 'n', value: '2' })).body.value;
  await client.setBreakpointsRequest({ source: { path: program }, breakpoints: [] });
  const info = (await client.dataBreakpointInfoRequest({ name: 'sum' })).body;
  await client.setDataBreakpointsRequest({ breakpoints: [{ dataId: info.dataId }] });
  found.changed = await run((a) => client.continueRequest(a));
  await client.setDataBreakpointsRequest({ breakpoints: [] });
  await client.setFunctionBreakpointsRequest({ breakpoints: [{ name: 'add' }] });
  found.reverse = await run((a) => client.reverseContinueRequest(a));
  await client.setFunctionBreakpointsRequest({ breakpoints: [] });
  // Takt's own requests, and log points, which do not stop when going back.
  found.cycle = await run(() => client.customRequest('takt/gotoCycle', { cycle: 9 }));
  found.atCycle = (await client.evaluateRequest({ expression: 'cycle', context: 'watch' })).body.result;
  found.noCycle = await client.customRequest('takt/gotoCycle', { cycle: -1 }).catch((error) => error.message);
  await run(() => client.customRequest('takt/gotoCycle', { cycle: 45 }));
  await client.setBreakpointsRequest({ source: { path: program }, breakpoints: [{ line: 8, logMessage: 'back' }] });
  found.beginning = await run((a) => client.reverseContinueRequest(a));
  await client.setBreakpointsRequest({ source: { path: program }, breakpoints: [] });
  found.filters = capabilities.exceptionBreakpointFilters.map((filter) => filter.filter);
  await client.setExceptionBreakpointsRequest({ filters: found.filters });
  found.halted = await run((a) => client.continueRequest(a));
  found.count = (await client.evaluateRequest({ expression: 'count', context: 'watch' })).body.result;
  const over = client.waitForEvent('terminated');
  await client.continueRequest({ threadId });
  found.terminated = (await over).event;
  await client.stop();
  await closedLoop();
}

// Attach to the closed loop: periods, hexadecimal values, and changes of a port.
async function closedLoop() {
  const client = new DebugClient(takt, 'dap', 'takt', { cwd: folder });
  client.defaultTimeout = 60000;
  await client.start();
  await client.initializeRequest();
  await Promise.all([
    client.waitForEvent('initialized'),
    client.attachRequest({ track: true, periods: 10 }),
  ]);
  const entry = client.waitForEvent('stopped');
  await client.configurationDoneRequest();
  await entry;
  const evaluate = async (expression, format) =>
    (await client.evaluateRequest({ expression, context: 'watch', format })).body.result;
  const run = async (request) => {
    const stopped = client.waitForEvent('stopped');
    await request;
    return (await stopped).body.reason;
  };
  found.gone = await run(client.customRequest('takt/gotoPeriod', { period: 3 }));
  found.period = await evaluate('period');
  const scopes = (await client.scopesRequest({ frameId: 0 })).body.scopes;
  const outputs = scopes.find((scope) => scope.name === 'Outputs').variablesReference;
  const rows = (await client.variablesRequest({ variablesReference: outputs, format: { hex: true } })).body.variables;
  found.hex = rows.map((row) => row.value);
  const views = rows.find((row) => row.variablesReference > 0).variablesReference;
  found.ulp = (await client.variablesRequest({ variablesReference: views })).body.variables.at(-1);
  const info = (await client.dataBreakpointInfoRequest({ name: rows[0].name })).body;
  const before = await evaluate(rows[0].name);
  await client.setDataBreakpointsRequest({ breakpoints: [{ dataId: info.dataId }] });
  found.port = await run(client.continueRequest({ threadId: 1 }));
  found.another = (await evaluate(rows[0].name)) !== before;
  // No NaN occurs, so the run continues to the last period.
  const checked = await client.setDataBreakpointsRequest({ breakpoints: [{ dataId: info.dataId, condition: 'nan' }] });
  found.nan = checked.body.breakpoints[0].verified;
  await client.stop();
}

main()
  .catch((error) => { found.problem = String((error && error.stack) || error); })
  .finally(() => { console.log(JSON.stringify(found)); process.exit(0); });
