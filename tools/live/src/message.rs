// SPDX-License-Identifier: MIT OR Apache-2.0
//! Messages between a session and its pages, as JSON.

use crate::control::Control;
use crate::report::Report;
use crate::shown::Shown;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use takt_board::scope::Recording;
use takt_isa::Type;

/// Message to a page.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(crate) enum ToPage<'a> {
    /// The program, and names that never change.
    Hello {
        version: &'static str,
        program: &'a str,
        /// Machine, or machines of the cores.
        machine: &'a str,
        port: &'a str,
        baud: u32,
        parameters: &'a [Shown],
        inputs: &'a [Shown],
        outputs: &'a [Shown],
        /// Names that may be channels.
        channels: &'a [String],
    },
    /// Role of the page: it may set and control, or another page does, or none; and the number of pages.
    Role { writer: bool, free: bool, pages: usize },
    /// State of the line: the board answers, or the reason for its silence; cycles from tick to tick, and the scope.
    Link { connected: bool, text: &'a str, cycles: u32, scope: Option<ScopeSize> },
    /// State, and values of parameters, inputs and outputs in the order of `Hello`; without values, the reason.
    State { report: &'a Report, values: &'a [String], busy: Option<&'a str> },
    /// Scope at rest, armed, recording after its trigger, or being read.
    Scope { phase: Phase, text: &'a str, passed: usize, all: usize, request: Option<&'a Request> },
    /// A recording; cells are numbers, `"NaN"`, `"inf"`, `"-inf"`, or null where a channel had no value yet.
    Recording {
        summary: &'a str,
        channels: Vec<Named<'a>>,
        periods: &'a [u32],
        values: Vec<Vec<Option<Cell>>>,
        trigger: Option<usize>,
        /// Length of a period in seconds, if the wiring is known.
        seconds: Option<f64>,
    },
    /// Answer to the message with this number.
    Answer { id: u64, error: Option<&'a str>, file: Option<&'a str> },
}

impl ToPage<'_> {
    pub(crate) fn text(&self) -> Arc<str> {
        // Keys are strings and numbers finite: there is nothing that JSON cannot say.
        serde_json::to_string(self).unwrap_or_default().into()
    }
}

/// Size of the board's scope.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct ScopeSize {
    pub(crate) channels: u32,
    pub(crate) depth: u32,
}

/// Name and type of a channel.
#[derive(Serialize)]
pub(crate) struct Named<'a> {
    name: &'a str,
    #[serde(rename = "type")]
    ty: &'static str,
}

/// Phase of the scope.
#[derive(Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Phase {
    Rest,
    Armed,
    Triggered,
    Reading,
}

/// Sample of a channel.
#[derive(Serialize)]
#[serde(untagged)]
pub(crate) enum Cell {
    Float(f32),
    Integer(i32),
    Bits(u32),
    Word(&'static str),
}

impl Cell {
    fn of(ty: Type, bits: u32) -> Cell {
        match (ty, f32::from_bits(bits)) {
            (Type::I, _) => Cell::Integer(bits.cast_signed()),
            (Type::B, _) => Cell::Bits(bits),
            (Type::F, value) if value.is_nan() => Cell::Word("NaN"),
            (Type::F, f32::INFINITY) => Cell::Word("inf"),
            (Type::F, f32::NEG_INFINITY) => Cell::Word("-inf"),
            (Type::F, value) => Cell::Float(value),
        }
    }
}

/// Message with a recording.
pub(crate) fn recording(recording: &Recording, summary: &str, seconds: Option<f64>) -> Arc<str> {
    let Recording { channels, periods, values, trigger, .. } = recording;
    let cells = |(values, (_, ty)): (&Vec<Option<u32>>, &(String, Type))| {
        values.iter().map(|bits| Some(Cell::of(*ty, (*bits)?))).collect()
    };
    let message = ToPage::Recording {
        summary,
        channels: channels.iter().map(|(name, ty)| Named { name, ty: ty.name() }).collect(),
        periods,
        values: values.iter().zip(channels).map(cells).collect(),
        trigger: trigger.map(|(index, _)| index),
        seconds,
    };
    message.text()
}

/// Message from a page.
#[derive(Deserialize)]
pub(crate) struct FromPage {
    /// Number for the answer.
    pub(crate) id: u64,
    #[serde(flatten)]
    pub(crate) wish: Wish,
}

/// Request of a page.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "lowercase")]
pub(crate) enum Wish {
    /// Take control, if no page has it.
    Claim,
    /// Give control up.
    Release,
    /// Set parameters, all at once.
    Parameters {
        values: BTreeMap<String, String>,
    },
    /// Set parameters as a file states them.
    Load {
        text: String,
    },
    /// Send a file of the parameters on the board.
    Save,
    /// Set an input.
    Input {
        name: String,
        value: String,
    },
    Control {
        command: Control,
    },
    /// Arm the scope.
    Arm {
        request: Request,
    },
    /// End the recording.
    End,
    /// Send the last recording as CSV.
    Csv,
}

impl Wish {
    /// A page that only shows may ask for it.
    pub(crate) fn is_harmless(&self) -> bool {
        matches!(self, Wish::Claim | Wish::Save | Wish::Csv)
    }
}

/// Recording that a page asks for; names and triggers as `takt live scope` takes them.
#[derive(Clone, Deserialize, Serialize)]
pub(crate) struct Request {
    pub(crate) channels: Vec<String>,
    pub(crate) triggers: Vec<String>,
    pub(crate) every: u32,
    pub(crate) samples: Option<u32>,
    pub(crate) before: Option<u32>,
    /// Arm again after each recording.
    pub(crate) repeat: bool,
}
