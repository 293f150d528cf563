// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three cores on the emulator, with the plant in their loop: the far end of the host's link.

use crate::dynamics::{JOINTS, Joints};
use crate::host::{Inputs, Mode, Robot, TICK, View};
use crate::plant::Plant;
use crate::standard;
use std::collections::BTreeMap;
use takt_emu::LoadError;
use takt_system::{CorePeriods, Description, HostError, ProgramError, ReadError, Request, System};

/// Limit on the cycles until the cores' first ticks.
const START: u64 = 10_000_000;
/// Ticks between two records.
pub const RECORD_TICKS: u64 = 10;
/// Limit on the records; later ones are dropped.
const RECORDS: usize = 1 << 20;

/// Controller that comes with the crate.
///
/// # Errors
/// If one of its programs does not assemble; the text renders the mistakes.
pub fn standard() -> Result<Description, String> {
    let text =
        |name: &str| takt_programs::THREE.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
    let program = |request: &Request<'_>| {
        standard::program(request.path, request.machine).map_err(ProgramError::Invalid)
    };
    let read = takt_system::read("controller.toml", text("controller.toml").unwrap_or(""), program);
    read.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => mistakes.render(false),
        ReadError::Program(text) => text,
    })
}

/// Reason why there is no controller.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// The system lacks a port or link that the host needs.
    #[error("the system is not a robot controller: {0}")]
    Host(#[from] HostError),
    /// A core's memories cannot hold its program.
    #[error("{0}")]
    Load(#[from] LoadError),
    /// A fault before the first ticks, or no ticks within ten million cycles.
    #[error("the cores did not reach their first ticks: {0}")]
    Start(String),
}

/// State of the robot at a time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Record {
    /// Time since power-up, s.
    pub time: f64,
    /// Joint angles of the plant, rad.
    pub joints: Joints,
    /// Servo's reference for this time, rad.
    pub reference: Joints,
    /// Controls held since this time.
    pub controls: Joints,
    /// Sequence number of the packet of the running segment.
    pub segment: u32,
    /// Mode as its number on the link.
    pub mode: u32,
}

/// Statistics of the tracking error.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Tracking {
    /// Number of ticks in which the robot moved.
    pub ticks: u64,
    /// Largest differences between reference and plant while moving, rad.
    pub largest: Joints,
    /// Sums of the squared differences while moving, rad².
    pub squares: Joints,
    /// Largest differences while standing, rad.
    pub standing: Joints,
}

impl Tracking {
    /// Root mean square error while moving, rad.
    pub fn rms(&self) -> Joints {
        self.squares.map(|sum| (sum / self.ticks.max(1) as f64).sqrt())
    }
}

/// Position of a value in the system: link and field.
type FieldIndex = (usize, usize);

#[derive(Clone)]
struct Ports {
    controls: [FieldIndex; JOINTS],
    reference: [FieldIndex; JOINTS],
    enable: FieldIndex,
    state: [FieldIndex; 15],
    outputs: [FieldIndex; 3],
    commands: usize,
    depth: usize,
    reports: usize,
}

/// Names of the encoder inputs.
const ENCODERS: [&str; JOINTS] = ["n1", "n2", "n3", "n4", "n5", "n6"];
/// Fields of the snapshot `state`.
const STATE: [&str; 15] =
    ["q1", "q2", "q3", "q4", "q5", "q6", "x", "y", "z", "roll", "pitch", "yaw", "mode", "segment", "queued"];

impl Ports {
    fn of(description: &Description) -> Result<Ports, HostError> {
        let outputs: BTreeMap<String, FieldIndex> =
            description.outputs().into_iter().map(|port| (port.name, (port.link, port.field))).collect();
        let unknown = |what, name: &str| HostError::Unknown { what, name: name.to_owned() };
        let place = |name: &str| outputs.get(name).copied().ok_or_else(|| unknown("output", name));
        let link = |name: &str| description.link_named(name).ok_or_else(|| unknown("link", name));
        let six = |letter: char| -> Result<[FieldIndex; JOINTS], HostError> {
            let mut places = [(0, 0); JOINTS];
            for (joint, known) in places.iter_mut().enumerate() {
                *known = place(&format!("{letter}{}", joint + 1))?;
            }
            Ok(places)
        };
        let mut state = [(0, 0); STATE.len()];
        for (known, name) in state.iter_mut().zip(STATE) {
            *known = place(&format!("state.{name}"))?;
        }
        let commands = link("commands")?;
        let depth = match description.links[commands].kind {
            takt_system::LinkKind::Fifo { depth, .. } => depth as usize,
            _ => return Err(unknown("FIFO", "commands")),
        };
        let given: Vec<String> = description.inputs().into_iter().map(|port| port.name).collect();
        for name in ENCODERS.into_iter().chain(["inputs", "analogue1", "analogue2", "commands.word"]) {
            if !given.iter().any(|known| known == name) {
                return Err(unknown("input", name));
            }
        }
        Ok(Ports {
            controls: six('u')?,
            reference: six('r')?,
            enable: place("enable")?,
            state,
            outputs: [place("outputs")?, place("level1")?, place("level2")?],
            commands,
            depth,
            reports: link("reports")?,
        })
    }
}

/// Cores of the controller with the plant.
#[derive(Clone)]
pub struct Controller {
    system: System,
    plant: Plant,
    ports: Ports,
    /// Cycle in which the host writes for the coming tick.
    next: u64,
    tick: u64,
    ticks: u64,
    words: Vec<u32>,
    view: View,
    inputs: Inputs,
    /// Joints at the encoders in the last tick, and the controls held since.
    sampled: Option<(Joints, Joints)>,
    /// Host actions are recorded ([`Controller::keep_host_actions`]).
    kept: bool,
    records: Vec<Record>,
    tracking: Tracking,
}

impl Controller {
    /// Controller after reset, with a plant.
    ///
    /// # Errors
    /// If the system lacks a port or link of the host, or its cores do not start.
    pub fn new(description: &Description, plant: Plant) -> Result<Controller, ControllerError> {
        let ports = Ports::of(description)?;
        let mut system = System::new(description)?;
        let start = system.run_to_start(START).map_err(|fault| ControllerError::Start(fault.to_string()))?;
        let start = start.ok_or_else(|| {
            ControllerError::Start(format!("{START} cycles have passed, or all cores have halted"))
        })?;
        let view = View {
            joints: plant.joints(),
            pose: [0.0; 6],
            mode: Mode::Standing,
            segment: 0,
            queued: 0,
            outputs: 0,
            levels: [0.0; 2],
        };
        Ok(Controller {
            system,
            plant,
            ports,
            next: start - description.lead(),
            tick: description.tick,
            ticks: 0,
            words: Vec::new(),
            view,
            inputs: Inputs::default(),
            sampled: None,
            kept: false,
            records: Vec::new(),
            tracking: Tracking::default(),
        })
    }

    /// Records the host's and the encoders' actions from now on, for [`System::host_actions`]. The link then takes one word per tick, like
    /// a row of a table.
    pub fn keep_host_actions(&mut self) {
        self.system.keep_host_actions();
        self.kept = true;
    }

    /// Plant in the loop.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// System of the three cores.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Records of the robot's state, one every [`RECORD_TICKS`] ticks.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Statistics of the tracking error.
    pub fn tracking(&self) -> &Tracking {
        &self.tracking
    }

    /// Names of the cores with their periods.
    pub fn periods(&self) -> Vec<(String, CorePeriods)> {
        let cores = self.system.description().cores.iter().enumerate();
        cores.map(|(number, core)| (core.name.clone(), self.system.periods(number))).collect()
    }

    fn bits(&self, (link, field): FieldIndex) -> u32 {
        self.system.field_bits(link, field).unwrap_or(0)
    }

    fn float(&self, place: FieldIndex) -> f64 {
        f64::from(f32::from_bits(self.bits(place)))
    }

    /// Reads the cores' outputs before the coming tick.
    fn look(&mut self) {
        let state: [u32; STATE.len()] = self.ports.state.map(|place| self.bits(place));
        let float = |i: usize| f64::from(f32::from_bits(state[i]));
        let outputs = self.ports.outputs.map(|place| self.bits(place));
        // The outputs are invalid before the first period of the kinematic core.
        if self.ticks > 0 {
            self.view = View {
                joints: std::array::from_fn(float),
                pose: std::array::from_fn(|i| float(i + 6)),
                mode: Mode::of(state[12]).unwrap_or(Mode::Error),
                segment: state[13],
                queued: state[14],
                outputs: outputs[0],
                levels: [f32::from_bits(outputs[1]), f32::from_bits(outputs[2])],
            };
        }
    }

    /// Compares the reference of the last period with the plant's joints in that period.
    fn compare(&mut self, controls: Joints) {
        let Some((sampled, _)) = self.sampled else { return };
        let reference = self.ports.reference.map(|place| self.float(place));
        let moves = self.view.mode != Mode::Standing && self.view.mode != Mode::Error;
        self.tracking.ticks += u64::from(moves);
        for i in 0..JOINTS {
            let error = (reference[i] - sampled[i]).abs();
            let largest = if moves { &mut self.tracking.largest[i] } else { &mut self.tracking.standing[i] };
            *largest = largest.max(error);
            if moves {
                self.tracking.squares[i] += error * error;
            }
        }
        if self.ticks.is_multiple_of(RECORD_TICKS) && self.records.len() < RECORDS {
            let mode = self.bits(self.ports.state[12]);
            let (time, segment) = ((self.ticks - 1) as f64 * TICK, self.view.segment);
            self.records.push(Record { time, joints: sampled, reference, controls, segment, mode });
        }
    }
}

impl Robot for Controller {
    fn tick(&mut self, inputs: &Inputs) -> Result<(), String> {
        self.system.run_until(self.next).map_err(|fault| fault.to_string())?;
        self.next += self.tick;
        self.look();
        let controls = self.ports.controls.map(|place| self.float(place));
        let enabled = self.bits(self.ports.enable) != 0;
        if enabled {
            self.compare(controls);
        }
        let counts = self.plant.counts();
        let host = |error: HostError| error.to_string();
        for (name, count) in ENCODERS.into_iter().zip(counts) {
            self.system.set_input(name, count as u32).map_err(host)?;
        }
        if self.ticks == 0 || *inputs != self.inputs {
            self.inputs = *inputs;
            self.system.set_input("inputs", inputs.digital).map_err(host)?;
            for (name, value) in ["analogue1", "analogue2"].into_iter().zip(inputs.analogue) {
                self.system.set_input(name, value.to_bits()).map_err(host)?;
            }
        }
        for word in std::mem::take(&mut self.words) {
            self.system.set_input("commands.word", word).map_err(host)?;
            self.system.push(self.ports.commands).map_err(host)?;
        }
        self.sampled = Some((self.plant.joints(), controls));
        // Controls seen now were computed in the period before, and are held until the next tick.
        self.plant.advance(TICK, enabled.then_some(&controls));
        self.ticks += 1;
        Ok(())
    }

    fn room(&self) -> usize {
        let taken = self.system.fifo_entries(self.ports.commands).len() + self.words.len();
        // Entries of the last tick may still be on the link.
        let room = (self.ports.depth / 2).saturating_sub(taken);
        if self.kept { room.min(1usize.saturating_sub(self.words.len())) } else { room }
    }

    fn send(&mut self, word: u32) {
        self.words.push(word);
    }

    fn reports(&mut self) -> Vec<[u32; 4]> {
        let mut reports = Vec::new();
        while let Ok(Some(entry)) = self.system.pop(self.ports.reports) {
            reports.push(std::array::from_fn(|i| entry.get(i).copied().unwrap_or(0)));
        }
        reports
    }

    fn view(&self) -> View {
        self.view
    }
}
