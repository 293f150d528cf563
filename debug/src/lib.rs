//! What an engineer looks at a running program with: traces, and debug sessions. Plain data in and out; nothing here prints.

pub mod trace;
