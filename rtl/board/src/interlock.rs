// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reasons why outputs are safe, as text: causes seen by the interlock of each core, and missing conditions.

use crate::application::Application;
use crate::host::{Host, Status, TRIP, fault_kind};
use crate::protocol::{ENABLE, HOLD, Line, LinkError, RUN};
use crate::wiring::{Peripheral, Wiring};
use takt_isa::Type;

/// Figures of a core that the text of a cause contains.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figures {
    /// The register `fault`, of a core that has one.
    pub(crate) fault: Option<u32>,
    pub(crate) misses: u32,
    pub(crate) most_cycles: u32,
    pub(crate) period: u32,
    /// The outputs that are NaN.
    pub(crate) nan: Vec<String>,
}

/// Describes the host's command that made outputs safe without a cause, from two bits of the register `control`.
pub(crate) fn command(run: bool, enable: bool) -> &'static str {
    match (run, enable) {
        (false, _) => "it is stopped",
        (true, false) => "outputs are no longer enabled",
        (true, true) => "it is started again",
    }
}

/// Describes a held trip, by its number.
pub(crate) fn trip(wiring: Option<&Wiring>, number: usize) -> String {
    let Some((wiring, Peripheral { name, .. })) =
        wiring.and_then(|wiring| Some((wiring, wiring.trips().nth(number)?)))
    else {
        return format!("the trip number {number} of the wiring is held");
    };
    let stopped = wiring.peripherals.iter().filter(|peripheral| peripheral.trips.contains(name));
    let stopped: Vec<String> = stopped.map(|peripheral| format!("`{}`", peripheral.name)).collect();
    match stopped[..] {
        [] => format!("the trip `{name}` is held, and makes nothing safe"),
        [_] => format!("the trip `{name}` is held: {} is safe", stopped.join(", ")),
        _ => format!("the trip `{name}` is held: {} are safe", stopped.join(", ")),
    }
}

impl Figures {
    /// Describes a cause with its figures; `cause` is a name of [`Status::causes`].
    pub(crate) fn reason(&self, cause: &str) -> String {
        match (cause, self.fault) {
            ("fault", Some(word)) => format!("fault: {} at bundle {}", fault_kind(word), word & 0xffff),
            ("missed deadline", _) => {
                let most = match self.most_cycles {
                    0 => String::new(),
                    most => format!("a period took {most} cycles at most, and "),
                };
                format!("missed deadline: {} of them; {most}ticks come every {}", self.misses, self.period)
            }
            ("host silent", _) => {
                "host silent: no request for as many periods as the wiring's `host` allows".to_owned()
            }
            ("cores differ", _) => {
                "cores differ: the second core did not do what the first one did".to_owned()
            }
            ("memory error", _) => {
                "memory error: a word of a memory was wrong and could not be corrected".to_owned()
            }
            ("stop", _) => "stop: the pin `stop` was 1, or open".to_owned(),
            ("NaN output", _) if self.nan.is_empty() => "NaN output: no output is NaN any more".to_owned(),
            ("NaN output", _) => format!("NaN output: {}", self.nan.join(", ")),
            (other, _) => other.to_owned(),
        }
    }
}

impl<L: Line> Host<L> {
    /// Reasons why the outputs are safe (`drive` is 0); empty if they drive. The application provides names of cores, bundles and outputs.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn safe_reasons(&mut self, application: Option<&Application<'_>>) -> Result<Vec<String>, LinkError> {
        let statuses = (0..self.cores).map(|core| self.status_of(core)).collect::<Result<Vec<_>, _>>()?;
        if statuses.iter().all(|status| status.drives()) {
            return Ok(Vec::new());
        }
        let control = self.register("control")?;
        if control & RUN == 0 {
            return Ok(vec!["it is stopped, and not started again".to_owned()]);
        }
        let mut reasons = Vec::new();
        for (core, status) in statuses.iter().enumerate() {
            let core_name = application.filter(|known| !known.is_program());
            let core_name = core_name.map(|known| known.description().cores[core].name.as_str());
            for cause in status.causes().filter(|cause| *cause != TRIP) {
                let text = self.detail(core, *status, cause, application)?;
                reasons.push(core_name.map_or(text.clone(), |name| format!("core `{name}`: {text}")));
            }
        }
        if reasons.is_empty() {
            reasons.push(match () {
                () if control & ENABLE == 0 => "outputs are not enabled: a start enables them".to_owned(),
                () if control & HOLD != 0 => "it is held before its first period has ended".to_owned(),
                () => "the first period has not ended yet".to_owned(),
            });
        }
        Ok(reasons)
    }

    /// Trips that are held, with the peripherals that they make safe, if the wiring is known. They are separate from
    /// [`Host::safe_reasons`], since other outputs may drive.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn tripped(&mut self, wiring: Option<&Wiring>) -> Result<Vec<String>, LinkError> {
        if self.status()?.causes().all(|cause| cause != TRIP) {
            return Ok(Vec::new());
        }
        let held = self.register("trips")?;
        let trips = (0..u32::BITS as usize).filter(|number| held >> number & 1 == 1);
        Ok(trips.map(|number| trip(wiring, number)).collect())
    }

    /// Text of a cause, with figures from the board.
    fn detail(
        &mut self,
        core: usize,
        status: Status,
        cause: &str,
        application: Option<&Application<'_>>,
    ) -> Result<String, LinkError> {
        let mut figures = Figures::default();
        match cause {
            "fault" => figures.fault = status.fault().then(|| self.register_of(core, "fault")).transpose()?,
            "missed deadline" => {
                figures.misses = self.register_of(core, "misses")?;
                figures.most_cycles = self.register_of(core, "most_cycles")?;
                figures.period = self.register("period")?;
            }
            "NaN output" => figures.nan = self.nan_outputs(core, application)?,
            _ => {}
        }
        Ok(figures.reason(cause))
    }

    /// Outputs of a core that are NaN at present.
    fn nan_outputs(
        &mut self,
        core: usize,
        application: Option<&Application<'_>>,
    ) -> Result<Vec<String>, LinkError> {
        let Some(application) = application else { return Ok(Vec::new()) };
        let mut names = Vec::new();
        for port in &application.description().cores[core].program.outputs {
            let name = application.name(core, &port.name);
            let Ok(place) = application.find(&name) else { continue };
            if place.ty != Type::F {
                continue;
            }
            match self.read(place.read, 1) {
                Ok(words) if words.first().is_some_and(|word| f32::from_bits(*word).is_nan()) => {
                    names.push(format!("`{name}`"));
                }
                // Ports can be read only between two periods, which a program that never waits does not have.
                Ok(_) | Err(LinkError::Busy) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(names)
    }
}
