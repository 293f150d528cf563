// SPDX-License-Identifier: MIT OR Apache-2.0
//! Messages of the debug adapter protocol, restricted to the fields in use, with the names of the specification:
//! <https://microsoft.github.io/debug-adapter-protocol/specification>.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Body of an answer, or an error message.
pub(super) type Answer = Result<Value, String>;

/// Serialises an answer's body.
pub(super) fn answer(body: impl Serialize) -> Answer {
    serde_json::to_value(body).map_err(|error| error.to_string())
}

/// Deserialises a request's arguments. Clients may omit the object if all its fields are optional.
pub(super) fn read<T: DeserializeOwned>(arguments: &Value) -> Result<T, String> {
    let arguments = if arguments.is_null() { Value::Object(Map::new()) } else { arguments.clone() };
    serde_json::from_value(arguments).map_err(|error| format!("wrong arguments: {error}"))
}

// ---- Requests.

#[derive(Deserialize)]
pub(super) struct Request {
    pub(super) seq: i64,
    pub(super) command: String,
    #[serde(default)]
    pub(super) arguments: Value,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct InitializeArguments {
    pub(super) lines_start_at1: Option<bool>,
    pub(super) columns_start_at1: Option<bool>,
}

/// Launch arguments defined by the protocol. All others are for the [`Launcher`](super::Launcher).
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct LaunchArguments {
    pub(super) no_debug: Option<bool>,
    pub(super) stop_on_entry: Option<bool>,
}

/// Arguments of all requests that move the run.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MoveArguments {
    pub(super) thread_id: Option<u64>,
    pub(super) granularity: Option<String>,
}

/// Arguments of `takt/gotoCycle` and `takt/gotoPeriod`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct GotoArguments {
    #[serde(alias = "cycle", alias = "period")]
    pub(super) count: u64,
    pub(super) thread_id: Option<u64>,
}

#[derive(Deserialize)]
pub(super) struct SetBreakpointsArguments {
    #[serde(default)]
    pub(super) source: SourceReference,
    pub(super) breakpoints: Option<Vec<BreakpointRequest>>,
}

/// A breakpoint of any kind: source, function, instruction or data.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BreakpointRequest {
    pub(super) line: Option<u64>,
    pub(super) name: Option<String>,
    pub(super) instruction_reference: Option<String>,
    pub(super) offset: Option<i64>,
    pub(super) data_id: Option<String>,
    condition: Option<String>,
    hit_condition: Option<String>,
    log_message: Option<String>,
}

impl BreakpointRequest {
    pub(super) fn condition(&self) -> Option<&str> {
        filled(self.condition.as_ref())
    }

    pub(super) fn hit_condition(&self) -> Option<&str> {
        filled(self.hit_condition.as_ref())
    }

    pub(super) fn log_message(&self) -> Option<&str> {
        filled(self.log_message.as_ref())
    }
}

/// Text that is not blank; some clients send an empty string for an absent text.
fn filled(text: Option<&String>) -> Option<&str> {
    text.map(|text| text.trim()).filter(|text| !text.is_empty())
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase")]
pub(super) struct SourceReference {
    pub(super) path: Option<String>,
    pub(super) name: Option<String>,
    pub(super) source_reference: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ExceptionArguments {
    pub(super) filters: Vec<String>,
    pub(super) filter_options: Option<Vec<FilterOption>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct FilterOption {
    pub(super) filter_id: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct StackTraceArguments {
    pub(super) thread_id: Option<u64>,
    pub(super) start_frame: Option<u64>,
    pub(super) levels: Option<u64>,
}

/// Scope of a request: a frame or a variable list.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ScopeArguments {
    pub(super) frame_id: Option<u64>,
    pub(super) variables_reference: Option<u64>,
}

#[derive(Deserialize)]
pub(super) struct NamedArguments {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) of: ScopeArguments,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct VariablesArguments {
    pub(super) variables_reference: u64,
    pub(super) format: Option<Format>,
    pub(super) start: Option<u64>,
    pub(super) count: Option<u64>,
}

#[derive(Deserialize)]
pub(super) struct Format {
    pub(super) hex: Option<bool>,
}

impl Format {
    pub(super) fn is_hex(format: Option<&Format>) -> bool {
        format.and_then(|format| format.hex).unwrap_or(false)
    }
}

/// Arguments of `setVariable` and `setExpression`.
#[derive(Deserialize)]
pub(super) struct SetArguments {
    #[serde(alias = "expression")]
    pub(super) name: String,
    pub(super) value: String,
    #[serde(flatten)]
    pub(super) of: ScopeArguments,
}

#[derive(Deserialize)]
pub(super) struct EvaluateArguments {
    pub(super) expression: String,
    pub(super) context: Option<String>,
    pub(super) format: Option<Format>,
    #[serde(flatten)]
    pub(super) of: ScopeArguments,
}

#[derive(Deserialize)]
pub(super) struct CompletionsArguments {
    pub(super) text: String,
    pub(super) column: Option<u64>,
    #[serde(flatten)]
    pub(super) of: ScopeArguments,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DisassembleArguments {
    pub(super) memory_reference: String,
    pub(super) offset: Option<i64>,
    pub(super) instruction_offset: Option<i64>,
    pub(super) instruction_count: u64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ReadMemoryArguments {
    pub(super) memory_reference: String,
    pub(super) offset: Option<i64>,
    pub(super) count: u64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SourceArguments {
    #[serde(default)]
    pub(super) source: SourceReference,
    pub(super) source_reference: Option<u64>,
}

// ---- Messages to the client.

/// A message from the adapter to the client.
#[derive(Serialize, Debug)]
pub struct Message {
    pub(super) seq: i64,
    #[serde(flatten)]
    pub(super) kind: Kind,
}

impl Message {
    /// Error in the stream, as output on the client's console.
    pub fn complaint(text: &str) -> Message {
        let output = Output { category: "stderr", output: format!("{text}\n") };
        Message { seq: 0, kind: Kind::Event(Event::Output(output)) }
    }
}

#[derive(Serialize, Debug)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Kind {
    Response(Response),
    Event(Event),
}

#[derive(Serialize, Debug)]
pub(super) struct Response {
    pub(super) request_seq: i64,
    pub(super) command: String,
    pub(super) success: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) message: Option<String>,
    pub(super) body: Value,
}

#[derive(Serialize, Debug)]
#[serde(tag = "event", content = "body", rename_all = "lowercase")]
pub(super) enum Event {
    Initialized,
    Output(Output),
    Stopped(StoppedEvent),
    Terminated,
}

#[derive(Serialize, Debug)]
pub(super) struct Output {
    pub(super) category: &'static str,
    pub(super) output: String,
}

#[derive(Serialize, Debug)]
#[serde(rename_all = "camelCase")]
pub(super) struct StoppedEvent {
    pub(super) reason: &'static str,
    pub(super) thread_id: usize,
    pub(super) all_threads_stopped: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) description: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) text: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) hit_breakpoint_ids: Vec<u32>,
}

/// Body of an error response. The text is a variable of `format`, so that braces in it are literal.
#[derive(Serialize)]
pub(super) struct Refusal {
    error: ErrorMessage,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct ErrorMessage {
    id: u32,
    format: &'static str,
    variables: BTreeMap<&'static str, String>,
    show_user: bool,
}

impl Refusal {
    pub(super) fn of(text: String) -> Refusal {
        let variables = BTreeMap::from([("text", text)]);
        Refusal { error: ErrorMessage { id: 1, format: "{text}", variables, show_user: true } }
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Capabilities {
    #[serde(flatten)]
    supported: BTreeMap<&'static str, bool>,
    exception_breakpoint_filters: Vec<ExceptionFilter>,
}

impl Capabilities {
    pub(super) fn new(exception_breakpoint_filters: Vec<ExceptionFilter>) -> Capabilities {
        Capabilities { supported: SUPPORTED.map(|name| (name, true)).into(), exception_breakpoint_filters }
    }
}

const SUPPORTED: [&str; 19] = [
    "supportsCompletionsRequest",
    "supportsConditionalBreakpoints",
    "supportsConfigurationDoneRequest",
    "supportsDataBreakpoints",
    "supportsDisassembleRequest",
    "supportsEvaluateForHovers",
    "supportsExceptionInfoRequest",
    "supportsFunctionBreakpoints",
    "supportsHitConditionalBreakpoints",
    "supportsInstructionBreakpoints",
    "supportsLoadedSourcesRequest",
    "supportsLogPoints",
    "supportsReadMemoryRequest",
    "supportsSetExpression",
    "supportsSetVariable",
    "supportsStepBack",
    "supportsSteppingGranularity",
    "supportsTerminateRequest",
    "supportsValueFormattingOptions",
];

#[derive(Serialize)]
pub(super) struct ExceptionFilter {
    pub(super) filter: &'static str,
    pub(super) label: &'static str,
    pub(super) description: &'static str,
    pub(super) default: bool,
}

/// Responses that consist of a single list or value, keyed by its name.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) enum Body {
    AllThreadsContinued(bool),
    Breakpoints(Vec<Breakpoint>),
    Content(String),
    Instructions(Vec<DisassembledInstruction>),
    Scopes(Vec<Scope>),
    Sources(Vec<Source>),
    Targets(Vec<CompletionItem>),
    Threads(Vec<Thread>),
    Variables(Vec<Variable>),
}

#[derive(Serialize)]
pub(super) struct Thread {
    pub(super) id: usize,
    pub(super) name: String,
}

#[derive(Serialize, Default)]
pub(super) struct Breakpoint {
    pub(super) verified: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) id: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) message: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) line: Option<u64>,
}

/// Response to a request for watching a value; the identifier is `None` if the value cannot be watched.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DataBreakpointInfo {
    pub(super) data_id: Option<String>,
    pub(super) description: String,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(super) access_types: &'static [&'static str],
    pub(super) can_persist: bool,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ExceptionInfo<'e> {
    pub(super) exception_id: &'e str,
    pub(super) description: &'e str,
    pub(super) break_mode: &'static str,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Source {
    pub(super) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) path: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) source_reference: Option<u64>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct StackTrace {
    pub(super) stack_frames: Vec<StackFrame>,
    pub(super) total_frames: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct StackFrame {
    pub(super) id: u64,
    pub(super) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) source: Option<Source>,
    pub(super) line: u32,
    pub(super) column: u32,
    pub(super) instruction_pointer_reference: String,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Scope {
    pub(super) name: String,
    pub(super) variables_reference: u64,
    pub(super) named_variables: usize,
    pub(super) expensive: bool,
}

#[derive(Serialize, Default)]
#[serde(rename_all = "camelCase")]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) value: String,
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    pub(super) ty: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) evaluate_name: Option<String>,
    pub(super) variables_reference: u64,
}

/// Result of `evaluate` (`result`), `setVariable` and `setExpression` (`value`).
#[derive(Serialize, Default)]
#[serde(rename_all = "camelCase")]
pub(super) struct EvaluateResponse {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) result: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) value: Option<String>,
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    pub(super) ty: Option<&'static str>,
    pub(super) variables_reference: u64,
}

#[derive(Serialize)]
pub(super) struct CompletionItem {
    pub(super) label: String,
    pub(super) start: usize,
    pub(super) length: usize,
}

#[derive(Serialize, Default)]
#[serde(rename_all = "camelCase")]
pub(super) struct DisassembledInstruction {
    pub(super) address: String,
    pub(super) instruction: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) instruction_bytes: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) symbol: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) location: Option<Source>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) line: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) presentation_hint: Option<&'static str>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Memory {
    pub(super) address: String,
    pub(super) unreadable_bytes: usize,
    pub(super) data: String,
}
